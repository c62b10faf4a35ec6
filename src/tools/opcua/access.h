/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Access control: security policies, users with their roles, and the sessions with what is known of
 * them. An observer reads and, over a signed connection, may stop; an operator and an engineer,
 * whose connection is signed, also write and call methods of their drives; nobody changes the
 * address space.
 *
 * Clients without a login cannot keep others out: their sessions have places of their own, one for
 * each connection, and end with it. When all places are taken, sessions that have lost their
 * connection make room, and readers make room for operators. When operators have all places, a
 * further operator gets a place that is kept for stops.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_ACCESS_H
#define DRIVEBRIDGE_OPCUA_ACCESS_H

#include "client/plant.h"
#include "opcua/config.h"
#include "opcua/network.h"
#include "users/users.h"

#include <open62541/server.h>

/* Sessions in addition to the configured number, for operators that may read and stop; the oldest
 * makes room for the next. */
#define DB_OPCUA_STOP_PLACES 2

struct db_opcua_session {
	UA_NodeId id;
	unsigned number;      /* unique among all sessions; 0: the place is free */
	uintptr_t connection; /* over which it was last activated; 0: it is lost */
	struct db_grant grant;
	bool stops_only;                  /* its place is one that is kept for stops */
	char user[DB_USERS_NAME_MAX + 1]; /* "": anonymous */
	/* of the service's clock, last written by the client; "": none */
	char token[DB_OPCUA_TOKEN_MAX];
	unsigned long digest; /* of the user at login, db_users_digest() */
	char label[128];      /* for the log: the user and the address */
	char from[65];        /* for the audit trail: "OPC UA, 10.0.0.7" */
};

/* A session has ended, or has lost its connection. */
typedef void db_opcua_left_fn(void *context, unsigned session);

/* What a user did is to be noted, see db_opcua_plant_note(). */
typedef void db_opcua_note_fn(void *context, const struct db_plant_note *note);

struct db_opcua_access;

/* `config` and `network` must outlive it. NULL without memory; freed with db_opcua_access_free()
 * after the server, NULL is allowed. */
struct db_opcua_access *db_opcua_access_new(const struct db_opcua_config *config,
                                            struct db_opcua_network *network,
                                            db_opcua_left_fn *left, db_opcua_note_fn *note,
                                            void *context);
void db_opcua_access_free(struct db_opcua_access *access);

/* Sets policies, endpoints, certificates and rights in the configuration of a new server. */
UA_StatusCode db_opcua_access_set_up(struct db_opcua_access *access, UA_ServerConfig *settings);

/* Reads the server's certificate again: channels that are opened from now on have it, if it can be
 * used. */
void db_opcua_access_renew(struct db_opcua_access *access);

/* To be called now and then: says in the log that it ends. `us`: microseconds since 1970-01-01
 * UTC. */
void db_opcua_access_look(struct db_opcua_access *access, int64_t us);

/* From now on new sessions of the server are noticed. */
UA_StatusCode db_opcua_access_watch(struct db_opcua_access *access, UA_Server *server);

/* To be called at the begin of each round of serving clients: limits what wrong passwords cost per
 * round. */
void db_opcua_access_begin(struct db_opcua_access *access);

/* Ends the sessions of users that were removed, or changed since their login: another role or
 * password. To be called regularly. */
void db_opcua_access_review(struct db_opcua_access *access);

/* NULL: no such session was activated. The library gives no context of a session in its callbacks,
 * so it is found by its id. */
const struct db_opcua_session *db_opcua_access_find(const struct db_opcua_access *access,
                                                    const UA_NodeId *session);

/* The session has written a token of the service's clock, or "". False: no such session was
 * activated. */
bool db_opcua_access_set_token(struct db_opcua_access *access, const UA_NodeId *session,
                               const char *token);

/* The session's user may not do that: adds it to the audit trail. `what`: the command, "write spd";
 * `of`: the drive; NULL: none. `may` and `drive` as in db_grant_has(). NULL as a session is
 * allowed. Returns BadUserAccessDenied. */
UA_StatusCode db_opcua_access_deny(const struct db_opcua_access *access,
                                   const struct db_opcua_session *session, const char *what,
                                   const char *of, enum db_may may, const char *drive);

/* Iterates over the sessions that have a connection. NULL: the end. `place` begins with 0. */
const struct db_opcua_session *db_opcua_access_next(const struct db_opcua_access *access,
                                                    size_t *place);

/* When the server's own certificate ends, in seconds since 1970-01-01 UTC. */
int64_t db_opcua_access_certificate_ends(const struct db_opcua_access *access);

/* A connection is closed: its sessions have lost it. */
void db_opcua_access_forget_connection(struct db_opcua_access *access, uintptr_t connection);

#endif
