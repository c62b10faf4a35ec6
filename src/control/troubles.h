/* SPDX-License-Identifier: Apache-2.0 */
/* The call Troubles: what is wrong, and what to do about it, for all front ends alike. Internal to src/control. */
#ifndef DRIVEBRIDGE_CONTROL_TROUBLES_H
#define DRIVEBRIDGE_CONTROL_TROUBLES_H

#include "control/call.h"

void db_troubles_call(const struct db_call *call);

/* It is due (DB_WAITS_FOR_TROUBLES). */
void db_troubles_look(struct db_session *session, db_time now);

#endif
