/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Alarms as conditions of OPC UA (OPC 10000-9), of the standard's type DiscreteAlarmType. The
 * library of Debian is built without its own: so their nodes are made when they are asked for, as
 * those of drives are, and a condition's node is also the node of its events.
 *
 * One thread.
 */
#ifndef DRIVEBRIDGE_OPCUA_CONDITIONS_H
#define DRIVEBRIDGE_OPCUA_CONDITIONS_H

#include "drivebridge/time.h"
#include "opcua/roster.h"

#include <jansson.h>
#include <open62541/server.h>

struct db_opcua_conditions;

/* A client acknowledges an alarm: checks whether its user may, and does it. */
typedef UA_StatusCode db_opcua_acknowledge_fn(void *context, const UA_NodeId *session,
                                              const struct db_opcua_alarm *alarm,
                                              const char *comment);

/* `roster` must outlive it. NULL without memory; the caller frees them. */
struct db_opcua_conditions *db_opcua_conditions_new(struct db_opcua_roster *roster,
                                                    db_opcua_acknowledge_fn *acknowledge,
                                                    void *context);

/* From now on its methods can be called. */
UA_StatusCode db_opcua_conditions_begin(struct db_opcua_conditions *conditions, UA_Server *server);

/* An answer to the service's method Alarms; `first` of a new connection. Tells clients what has
 * changed. */
void db_opcua_conditions_take(struct db_opcua_conditions *conditions, const json_t *answer,
                              bool first);

/* Goes on with what a client wanted to see again; returns when it is to be called next. */
db_time db_opcua_conditions_tend(struct db_opcua_conditions *conditions, db_time now);

/* The type of a member's value. */
const UA_DataType *db_opcua_condition_type(enum db_opcua_member member);

/* The value of a member; `quality` of what is known of the service. */
UA_StatusCode db_opcua_condition_read(const struct db_opcua_roster *roster,
                                      const struct db_opcua_subject *subject, UA_StatusCode quality,
                                      UA_DataValue *value);

#endif
