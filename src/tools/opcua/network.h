/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The library's event loop with its TCP connections, and a layer between them and the library:
 * which connection is being served, when bytes of each last arrived, serving operators before
 * others, and sending that never waits. By itself the library serves a connection for as long as it
 * sends requests, and waits for a client that does not read.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_NETWORK_H
#define DRIVEBRIDGE_OPCUA_NETWORK_H

#include "drivebridge/time.h"
#include "users/roles.h"

#include <open62541/server.h>
#include <poll.h>
#include <stdbool.h>

struct db_opcua_network;

/* Most connections and listeners. */
#define DB_OPCUA_NETWORK_PLACES 256

/* Called when a connection is closed. */
typedef void db_opcua_gone_fn(void *context, uintptr_t connection);

/* A message of a connection has been processed; others may wait for their turn. */
typedef void db_opcua_served_fn(void *context);

/* With room for this number of connections; when all are taken, those without a login make room.
 * NULL without memory; freed with db_opcua_network_free() after the server. */
struct db_opcua_network *db_opcua_network_new(unsigned connections, db_opcua_gone_fn *gone,
                                              db_opcua_served_fn *served, void *context);
void db_opcua_network_free(struct db_opcua_network *network);

/* The server's configuration gets the loop, which it ends and frees, and the log, which stays the
 * network's. */
void db_opcua_network_give(struct db_opcua_network *network, UA_ServerConfig *settings);

/* The listening port; 0: none. */
unsigned db_opcua_network_port(const struct db_opcua_network *network);

/* The connection whose bytes are being served, and its address; 0 and "" at other times. */
uintptr_t db_opcua_network_current(const struct db_opcua_network *network);
const char *db_opcua_network_address(struct db_opcua_network *network, uintptr_t connection);

/* When bytes of a connection last arrived; 0: there is no such connection. */
db_time db_opcua_network_heard(struct db_opcua_network *network, uintptr_t connection);

/* The highest role logged in over it. A connection with DB_ROLE_NONE is closed after some
 * seconds. */
void db_opcua_network_know(struct db_opcua_network *network, uintptr_t connection,
                           enum db_role role);

/* Readable when a connection or a listener has work for the library, or for
 * db_opcua_network_flush(). */
int db_opcua_network_fd(const struct db_opcua_network *network);

/* For poll(): the connections of those who move drives, at most `room` places. Returns the number
 * of used ones. */
size_t db_opcua_network_watch(const struct db_opcua_network *network, struct pollfd *fds,
                              size_t room);

/* When db_opcua_network_flush() or the library has work without incoming bytes. */
db_time db_opcua_network_due(const struct db_opcua_network *network, db_time now);

/* Sends what could not be sent at once. Clients that accept nothing for long, or do not log in, are
 * disconnected. To be called in each turn of the loop, before the server's. */
void db_opcua_network_flush(struct db_opcua_network *network, db_time now);

/* True if bytes arrived or connections ended in this turn: then the library may have more work at
 * once. */
bool db_opcua_network_is_busy(const struct db_opcua_network *network);

#endif
