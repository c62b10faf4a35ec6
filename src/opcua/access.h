/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who may do what: security policies and users, and the sessions with what is known of them. One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_ACCESS_H
#define DRIVEBRIDGE_OPCUA_ACCESS_H

#include "opcua/config.h"
#include "opcua/network.h"

#include <open62541/server.h>

struct db_opcua_access;

/* `config` and `network` must outlive it. NULL without memory; freed with db_opcua_access_free(), NULL is allowed. */
struct db_opcua_access *db_opcua_access_new(const struct db_opcua_config *config,
                                            const struct db_opcua_network *network);
void db_opcua_access_free(struct db_opcua_access *access);

/* Policies, endpoints and the rights of a server that is to be made. */
UA_StatusCode db_opcua_access_set_up(struct db_opcua_access *access, UA_ServerConfig *settings);

/* A connection is gone, and with it who spoke over it. */
void db_opcua_access_forget_connection(struct db_opcua_access *access, uintptr_t connection);

#endif
