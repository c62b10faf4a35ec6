/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The library's event loop with its TCP connections, and what is put between them and the library: which connection is
 * being served, when each was heard, that operators are served before others, and sending that never waits. Of its own the
 * library serves a connection for as long as that asks for something, and waits for a client that does not read.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_NETWORK_H
#define DRIVEBRIDGE_OPCUA_NETWORK_H

#include "drivebridge/time.h"
#include "users/roles.h"

#include <open62541/plugin/eventloop.h>
#include <poll.h>
#include <stdbool.h>

struct db_opcua_network;

/* Never more connections and listeners than this. */
#define DB_OPCUA_NETWORK_PLACES 256

/* Called when a connection is gone. */
typedef void db_opcua_gone_fn(void *context, uintptr_t connection);

/* What a connection had to say is done; others may wait for their turn. */
typedef void db_opcua_served_fn(void *context);

/* With room for so many connections; when all are taken, who is not logged in makes room. NULL without memory; freed with
 * db_opcua_network_free() after the server. */
struct db_opcua_network *db_opcua_network_new(unsigned connections, db_opcua_gone_fn *gone,
                                              db_opcua_served_fn *served, void *context);
void db_opcua_network_free(struct db_opcua_network *network);

/* For the server's configuration, which ends and frees the loop; the log stays the network's. */
UA_EventLoop *db_opcua_network_give_loop(struct db_opcua_network *network);
UA_Logger *db_opcua_network_logger(struct db_opcua_network *network);

/* The port that is listened on; 0: none is. */
unsigned db_opcua_network_port(const struct db_opcua_network *network);

/* Whose bytes are being served, and whence they come; 0 and "" while nobody's are. */
uintptr_t db_opcua_network_current(const struct db_opcua_network *network);
const char *db_opcua_network_address(struct db_opcua_network *network, uintptr_t connection);

/* When bytes of a connection came last; 0: there is none. */
db_time db_opcua_network_heard(struct db_opcua_network *network, uintptr_t connection);

/* The highest role that is logged in over it. A connection with DB_ROLE_NONE is closed after some seconds. */
void db_opcua_network_know(struct db_opcua_network *network, uintptr_t connection,
                           enum db_role role);

/* For poll(), connections over which somebody of this role or a higher one is logged in; with DB_ROLE_NONE all, and the
 * listeners: at most `room` places, those that were filled. */
size_t db_opcua_network_watch(const struct db_opcua_network *network, enum db_role least,
                              struct pollfd *fds, size_t room);
size_t db_opcua_network_places(const struct db_opcua_network *network);

/* When db_opcua_network_flush() or the library has something to do without bytes coming. */
db_time db_opcua_network_due(const struct db_opcua_network *network, db_time now);

/* Sends what could not be sent at once. Who takes nothing for long, or does not log in, is dropped. To be called in each turn of the loop,
 * before the server's. */
void db_opcua_network_flush(struct db_opcua_network *network, db_time now);

/* Whether bytes came or connections went in this turn: then the library may have more to do at once. */
bool db_opcua_network_is_busy(const struct db_opcua_network *network);

#endif
