/* SPDX-License-Identifier: Apache-2.0 */
/* The service's events as OPC UA events: each kind has its own type, which is there before its
 * first event, so that clients can choose. One thread. */
#ifndef DRIVEBRIDGE_OPCUA_EVENTS_H
#define DRIVEBRIDGE_OPCUA_EVENTS_H

#include "opcua/locales.h"

#include <jansson.h>
#include <open62541/server.h>

/* Adds their types. */
UA_StatusCode db_opcua_events_set_up(UA_Server *server);

/* Sends it to the clients that subscribe to events, to each in the language of its session. `event`
 * of the interface's type Event; `origin` is the drive's node. */
void db_opcua_events_tell(UA_Server *server, const struct db_opcua_locales *locales,
                          const json_t *event, UA_NodeId origin);

/* Tells the clients that nodes have come and gone: `changes` stay the caller's. */
void db_opcua_events_tell_changes(UA_Server *server, UA_ModelChangeStructureDataType *changes,
                                  size_t count);

#endif
