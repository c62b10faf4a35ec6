/* SPDX-License-Identifier: Apache-2.0 */
/* What the server says of itself in the standard's nodes: its namespaces, what it is capable of,
 * and its limits. One thread. */
#ifndef DRIVEBRIDGE_OPCUA_ABOUT_H
#define DRIVEBRIDGE_OPCUA_ABOUT_H

#include "opcua/config.h"

#include <open62541/server.h>

/* To be called once, after both namespaces were added and before the server serves. Bytes of a
 * message at most; no text and no array is longer. */
UA_StatusCode db_opcua_about_set_up(UA_Server *server, const struct db_opcua_config *config,
                                    UA_UInt32 message_max);

#endif
