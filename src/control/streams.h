/* SPDX-License-Identifier: Apache-2.0 */
/* The calls that wait for what comes: Subscribe, Events and Reload. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_STREAMS_H
#define DRIVEBRIDGE_CONTROL_STREAMS_H

#include "control/call.h"

void db_streams_subscribe(const struct db_call *call);
void db_streams_events(const struct db_call *call);
void db_streams_reload(const struct db_call *call);

/* An event as the definition has it. */
json_t *db_streams_event(const struct db_log_line *line);

/* It is due (DB_WAITS_FOR_VALUES, _EVENTS). */
void db_streams_look(struct db_session *session, db_time now);

/* A reload has ended, with these lines of errors. */
void db_streams_reloaded(struct db_session *session, const char *errors);

#endif
