/* SPDX-License-Identifier: Apache-2.0 */
/* The service's events as those of OPC UA: each kind a type of its own, so that clients can choose. One thread. */
#ifndef DRIVEBRIDGE_OPCUA_EVENTS_H
#define DRIVEBRIDGE_OPCUA_EVENTS_H

#include <jansson.h>
#include <open62541/server.h>

/* What all of them are. */
UA_StatusCode db_opcua_events_set_up(UA_Server *server);

/* Tells who wants to know. `event` of the interface's type Event; `origin` is the drive's node. */
void db_opcua_events_tell(UA_Server *server, const json_t *event, UA_NodeId origin);

#endif
