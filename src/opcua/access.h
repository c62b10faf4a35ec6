/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who may do what: security policies, users with their roles, and the sessions with what is known of them. A reader
 * reads; an operator, whose connection is signed, also writes and calls methods; nobody changes the address space.
 *
 * Nobody is kept out by who has not logged in: such sessions have places of their own, one for each connection, and end
 * with it. When all places are taken, sessions that have lost their connection make room, and readers for operators. When
 * operators have all of them, one more has a place that is kept for stops.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_ACCESS_H
#define DRIVEBRIDGE_OPCUA_ACCESS_H

#include "opcua/config.h"
#include "opcua/network.h"
#include "users/users.h"

#include <open62541/server.h>

/* Of the file of users. */
extern const struct db_users_keeper db_opcua_keeper;

/* Sessions besides those of the configuration, of operators who may read and stop; the oldest makes room for the next. */
#define DB_OPCUA_STOP_PLACES 2

struct db_opcua_session {
	UA_NodeId id;
	unsigned number;      /* no other session ever has it; 0: a free place */
	uintptr_t connection; /* over which it was activated last; 0: it is gone */
	enum db_role role;
	bool stops_only;                  /* its place is one that is kept for stops */
	char user[DB_USERS_NAME_MAX + 1]; /* "" is anonymous */
	char token[DB_OPCUA_TOKEN_MAX];   /* of the service's clock that it wrote last; "": none */
	unsigned long digest;             /* of the user when he logged in, db_users_digest() */
	char label[128];                  /* for the log: the user and whence */
};

/* A session is over, or has lost its connection. */
typedef void db_opcua_left_fn(void *context, unsigned session);

struct db_opcua_access;

/* `config` and `network` must outlive it. NULL without memory; freed with db_opcua_access_free() after the server, NULL is
 * allowed. */
struct db_opcua_access *db_opcua_access_new(const struct db_opcua_config *config,
                                            struct db_opcua_network *network,
                                            db_opcua_left_fn *left, void *context);
void db_opcua_access_free(struct db_opcua_access *access);

/* Policies, endpoints, certificates and the rights of a server that is to be made. */
UA_StatusCode db_opcua_access_set_up(struct db_opcua_access *access, UA_ServerConfig *settings);

/* Sessions of the server are heard of from now on. */
UA_StatusCode db_opcua_access_watch(struct db_opcua_access *access, UA_Server *server);

/* Clients are served once more: to be called before each time, for the bound of what wrong passwords cost. */
void db_opcua_access_begin(struct db_opcua_access *access);

/* Ends the sessions of users who are no more, or are others than when they logged in: with another role or password. To be
 * called again and again. */
void db_opcua_access_review(struct db_opcua_access *access);

/* NULL: it is none that was activated. The library gives no context of a session in its callbacks, so it is looked for by
 * its id. */
const struct db_opcua_session *db_opcua_access_find(const struct db_opcua_access *access,
                                                    const UA_NodeId *session);

/* The session has written a token of the service's clock, or "". False: it is none that was activated. */
bool db_opcua_access_set_token(struct db_opcua_access *access, const UA_NodeId *session,
                               const char *token);

/* One after the other: those that have a connection. NULL: no more. `place` begins with 0. */
const struct db_opcua_session *db_opcua_access_next(const struct db_opcua_access *access,
                                                    size_t *place);

/* A connection is gone, and with it who spoke over it. */
void db_opcua_access_forget_connection(struct db_opcua_access *access, uintptr_t connection);

#endif
