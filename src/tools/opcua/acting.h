/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Commands and writes of OPC sessions, over connections of their own to drivebridged: for the
 * service each acting OPC session is a client of its own, with its control of drives and their
 * watchdogs. All commands for a drive use the same connection, in their order; a stop goes past
 * waiting calls.
 *
 * The caller waits until the drive has confirmed, some milliseconds: the library answers a method
 * when its callback returns, and its asynchronous methods would bypass the access control. So the
 * wait is bounded twice: by the configuration, and to SHARE_MAX for all callers of one turn of the
 * loop together once an operator's request is waiting. A stop never waits longer than that. Moving
 * drives are fed meanwhile.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_ACTING_H
#define DRIVEBRIDGE_OPCUA_ACTING_H

#include "opcua/config.h"
#include "opcua/network.h"

#include <jansson.h>
#include <systemd/sd-event.h>

struct db_opcua_acting;

/* Result of a call. */
struct db_opcua_outcome {
	bool pending;     /* not confirmed yet, and continues; the drive has it, or will get it */
	char result[32];  /* the service's name of the result, or of its error: NotAllowed ... */
	char reason[256]; /* in words, "" without an error */
};

/* A pending call has ended. */
typedef void db_opcua_ended_fn(void *context, const char *drive,
                               const struct db_opcua_outcome *outcome);

/* To call db_opcua_acting_feed() for each session that was heard from lately. */
typedef void db_opcua_feed_fn(void *context, db_time now);

/* The acting session, valid while it lives. */
struct db_opcua_actor {
	unsigned session;  /* unique among all sessions */
	const char *user;  /* "": anonymous */
	const char *label; /* for the log: user and address */
	const char *from;  /* for the audit trail: "OPC UA, 10.0.0.7"; "": the service has none */
	const char *token; /* of the service's clock, for calls that start a motion; "": none */
	bool stops_only;   /* it has a place that is kept for stops, and may do nothing else */
};

/* `config` and `network` must outlive it. NULL without memory; freed with db_opcua_acting_free(),
 * NULL is allowed. */
struct db_opcua_acting *db_opcua_acting_new(sd_event *loop, const struct db_opcua_config *config,
                                            const struct db_opcua_network *network,
                                            db_opcua_ended_fn *ended, db_opcua_feed_fn *feed,
                                            void *context);
void db_opcua_acting_free(struct db_opcua_acting *acting);

/* Takes `arguments` over. `stops`: the command stops the drive. The drive's former command must
 * have ended, except for a stop: a waiting command would move the drive when nobody expects it any
 * more. */
void db_opcua_acting_run(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                         const char *drive, const char *command, bool stops, json_t *arguments,
                         struct db_opcua_outcome *outcome);

/* Writes a register; `value` stays the caller's. Values for the command `block` are kept for the
 * session: its command register, with `command` (and `stops` if that one stops), is written
 * together with them in one call. */
void db_opcua_acting_write(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                           const char *drive, const char *reg, json_t *value, bool block,
                           bool command, bool stops, struct db_opcua_outcome *outcome);

/* Acknowledges the service's alarm of this number; `comment` for its audit trail, "": none. */
void db_opcua_acting_acknowledge(struct db_opcua_acting *acting, const struct db_opcua_actor *actor,
                                 int64_t alarm, const char *comment,
                                 struct db_opcua_outcome *outcome);

/* The session is alive: feeds the watchdogs of what it has moved when they are due, and keeps its
 * control. */
void db_opcua_acting_feed(struct db_opcua_acting *acting, unsigned session, db_time now);

/* During a long turn: feeds what is due, by the function given to db_opcua_acting_new(). */
void db_opcua_acting_go_on(struct db_opcua_acting *acting);

/* The session is lost or over: closes its connections, so that for the service its client is
 * gone. */
void db_opcua_acting_drop(struct db_opcua_acting *acting, unsigned session);

/* When the next feeding is due, for sessions that are alive; DB_TIME_NEVER: none. */
db_time db_opcua_acting_due(const struct db_opcua_acting *acting);

/* A turn of the loop begins. */
void db_opcua_acting_begin(struct db_opcua_acting *acting, db_time now);

#endif
