/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Commands and writes of OPC sessions, over connections of their own to drivebridged: for the service each OPC session
 * that acts is a client of its own, with its control of drives and their watchdogs. What a drive is told goes over
 * the same connection always, in its order; a stop goes past what waits.
 *
 * A caller is waited for until the drive has confirmed, some milliseconds: the library answers a method when its
 * callback returns, and those that it could answer later would bypass the access control. So the wait is bounded twice:
 * by the configuration, and to SHARE_MAX once an operator has something to say, all callers of one turn of the
 * loop together. A stop that somebody calls is never behind more than that. What moves is fed meanwhile.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_ACTING_H
#define DRIVEBRIDGE_OPCUA_ACTING_H

#include "opcua/config.h"
#include "opcua/network.h"

#include <jansson.h>

struct db_opcua_acting;

/* How it ended. */
struct db_opcua_outcome {
	bool pending; /* it is not confirmed yet and goes on; the drive has it, or will */
	char result
		[32]; /* by the name that the service has for results, or that of its error: NotAllowed ... */
	char reason[256]; /* in words, "" when it is well */
};

/* Something that was pending has ended. */
typedef void db_opcua_ended_fn(void *context, const char *drive,
                               const struct db_opcua_outcome *outcome);

/* Whose session is heard is to be fed, db_opcua_acting_feed(). */
typedef void db_opcua_feed_fn(void *context, db_time now);

/* Who acts, for as long as the session lives. */
struct db_opcua_actor {
	unsigned session;  /* a number that no other session ever has */
	const char *user;  /* "" is anonymous */
	const char *label; /* for the log: user and address */
	const char *token; /* of the service's clock, with what starts a motion; "": none */
	bool stops_only;   /* it has a place that is kept for stops: nothing else is done for it */
};

/* `config` and `network` must outlive it. NULL without memory; freed with db_opcua_acting_free(), NULL is allowed. */
struct db_opcua_acting *db_opcua_acting_new(const struct db_opcua_config *config,
                                            const struct db_opcua_network *network,
                                            db_opcua_ended_fn *ended, db_opcua_feed_fn *feed,
                                            void *context);
void db_opcua_acting_free(struct db_opcua_acting *acting);

/* Takes `arguments` over. What was told the drive before must have ended, except for a stop: a command that waits would move
 * the drive when nobody expects it any more. */
void db_opcua_acting_run(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                         const char *drive, const char *command, json_t *arguments,
                         struct db_opcua_outcome *outcome);

/* Writes a register; `value` stays the caller's. What is written into the command `block` is kept for the session: its
 * register of the command, with the name of that as `command` (else NULL), is written together with that, as one. */
void db_opcua_acting_write(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                           const char *drive, const char *reg, json_t *value, bool block,
                           const char *command, struct db_opcua_outcome *outcome);

/* The session is heard: the watchdogs of what it has moved are fed when they are to be, and its control kept. */
void db_opcua_acting_feed(struct db_opcua_acting *acting, unsigned session, db_time now);

/* In the middle of a turn that takes long: feeds what is due, by the function of db_opcua_acting_new(). */
void db_opcua_acting_go_on(struct db_opcua_acting *acting);

/* The session is lost or over: for the service its client is gone. */
void db_opcua_acting_drop(struct db_opcua_acting *acting, unsigned session);

/* Connections at the same time; the service has 64 for all its tools. */
#define DB_OPCUA_ACTING_FDS 16

/* For poll(): places without a connection have fd -1. */
void db_opcua_acting_watch(const struct db_opcua_acting *acting,
                           struct pollfd fds[DB_OPCUA_ACTING_FDS]);

/* When feeding is due next, for sessions that are heard; DB_TIME_NEVER. */
db_time db_opcua_acting_due(const struct db_opcua_acting *acting);

/* A turn of the loop begins: takes what came. */
void db_opcua_acting_handle(struct db_opcua_acting *acting, db_time now);

#endif
