/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Past events for clients: the service's audit trail, for those who may read it. A search goes on
 * in the loop after its request was answered, because the library wants an answer at once and pages
 * come from a disk: the client asks again and gets the result.
 *
 * One thread; a request waits for the service, some milliseconds at most.
 */
#ifndef DRIVEBRIDGE_OPCUA_PAST_H
#define DRIVEBRIDGE_OPCUA_PAST_H

#include "drivebridge/time.h"
#include "opcua/config.h"
#include "opcua/roster.h"

#include <open62541/server.h>
#include <systemd/sd-event.h>

struct db_opcua_past;

/* May this session read the trail of this drive, or, of "", the whole one? If not, that is on
 * record. `*number` is the session's, which no other one has. */
typedef UA_StatusCode db_opcua_may_read_trail_fn(void *context, const UA_NodeId *session,
                                                 const char *drive, unsigned *number);

/* `config` and `roster` must outlive it. NULL without memory; freed with db_opcua_past_free(), NULL
 * is allowed. */
struct db_opcua_past *db_opcua_past_new(sd_event *loop, const struct db_opcua_config *config,
                                        const struct db_opcua_roster *roster,
                                        db_opcua_may_read_trail_fn *may, void *context);
void db_opcua_past_free(struct db_opcua_past *past);

/* Forgets a result that nobody fetches. Returns when it is to be called next. */
db_time db_opcua_past_tend(struct db_opcua_past *past, db_time now);

/* Of one node's events, waiting for the service until then at most. */
UA_StatusCode db_opcua_past_read(struct db_opcua_past *past, const UA_NodeId *session,
                                 const UA_ReadEventDetails *details,
                                 const UA_HistoryReadValueId *wanted, db_time until,
                                 UA_HistoryReadResult *result, UA_HistoryEvent *events);

#endif
