/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The OPC UA server: the library with its network, the address space and the plant. One thread; it
 * only waits for the confirmation of a command, for the configured time.
 */
#ifndef DRIVEBRIDGE_OPCUA_SERVER_H
#define DRIVEBRIDGE_OPCUA_SERVER_H

#include "drivebridge/time.h"
#include "opcua/config.h"

#include <systemd/sd-event.h>

struct db_opcua_server;

/* Listens. `config` must outlive it. NULL when that fails, which is logged; freed with
 * db_opcua_server_free(). */
struct db_opcua_server *db_opcua_server_new(sd_event *loop, const struct db_opcua_config *config);
void db_opcua_server_free(struct db_opcua_server *server);

/* As db_program_renew_fn, with the server as its context. */
void db_opcua_server_renew(void *context);

/* As db_program_turn_fn, with the server as its context. */
db_time db_opcua_server_turn(void *context, db_time now, int64_t us);

#endif
