/* SPDX-License-Identifier: Apache-2.0 */
/* The calls about what buses carry: Trace and Traces. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_TRACES_H
#define DRIVEBRIDGE_CONTROL_TRACES_H

#include "control/call.h"

void db_traces_follow(const struct db_call *call);
void db_traces_list(const struct db_call *call);

/* It is due (DB_WAITS_FOR_TRACE). */
void db_traces_look(struct db_session *session, db_time now);

#endif
