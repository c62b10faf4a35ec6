/* SPDX-License-Identifier: Apache-2.0 */
/* The calls that look for drives and set one up: Scan and SetUp. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_SCAN_H
#define DRIVEBRIDGE_CONTROL_SCAN_H

#include "control/call.h"

void db_scan_call(const struct db_call *call);
void db_scan_set_up(const struct db_call *call);

/* It is due (DB_WAITS_FOR_SCAN). */
void db_scan_look(struct db_session *session, db_time now);

/* The session is over, or nobody reads what it says any more: its scan ends, if it has one. */
void db_scan_forget(struct db_session *session);

#endif
