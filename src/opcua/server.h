/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The OPC UA server: the library with its network, the address space and the plant behind it. One thread; waits for
 * nothing but, for as long as the configuration says, for the confirmation of a command.
 */
#ifndef DRIVEBRIDGE_OPCUA_SERVER_H
#define DRIVEBRIDGE_OPCUA_SERVER_H

#include "drivebridge/time.h"
#include "opcua/config.h"

#include <poll.h>

struct db_opcua_server;

/* Listens. `config` must outlive it. NULL when that cannot be, which is logged; freed with db_opcua_server_free(). */
struct db_opcua_server *db_opcua_server_new(const struct db_opcua_config *config);
void db_opcua_server_free(struct db_opcua_server *server);

/* For poll(): how many places it takes at most, and those that it takes now. */
size_t db_opcua_server_places(const struct db_opcua_server *server);
size_t db_opcua_server_watch(const struct db_opcua_server *server, struct pollfd *fds, size_t room);

/* When db_opcua_server_handle() is to be called without anything being ready. */
db_time db_opcua_server_due(const struct db_opcua_server *server, db_time now);

/* Does what is to be done. `us`: microseconds since 1970-01-01 UTC. */
void db_opcua_server_handle(struct db_opcua_server *server, db_time now, int64_t us);

#endif
