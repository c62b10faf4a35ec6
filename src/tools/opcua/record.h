/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A record of the audit trail as an event of the type AuditTrailEventType: the fields that a client
 * has selected. Pure but for memory.
 */
#ifndef DRIVEBRIDGE_OPCUA_RECORD_H
#define DRIVEBRIDGE_OPCUA_RECORD_H

#include "opcua/roster.h"

#include <jansson.h>
#include <open62541/types_generated.h>

/* Whether such a filter can be carried out: its condition may be about the type of events. */
UA_StatusCode db_opcua_record_check(const UA_EventFilter *filter);

/* True if the condition, which was checked, is met by records: they all have one type. */
bool db_opcua_record_is_wanted(const struct db_opcua_roster *roster, const UA_ContentFilter *where);

/* Fills in empty `fields`, as the filter selects them. What a record does not have is null.
 * `server`: the URI of this server. */
UA_StatusCode db_opcua_record_fill(const struct db_opcua_roster *roster, const char *server,
                                   const json_t *record, const UA_EventFilter *filter,
                                   UA_HistoryEventFieldList *fields);

#endif
