/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Stops over the control socket: which calls are stops, and the call Stop, which stops several drives at once, each by
 * itself. Internal to src/control; network thread only.
 */
#ifndef DRIVEBRIDGE_CONTROL_STOPS_H
#define DRIVEBRIDGE_CONTROL_STOPS_H

#include "control/call.h"

/* Whether a call may be made on a place that is kept for stops: a stop by Stop, Run or Write, or an Introduce, which says
 * for whom the stop behind it is. Pure. */
bool db_stops_has_place(const struct db_message *message);

void db_stops_call(const struct db_call *call);

/* One of the stops that the session waits for (DB_WAITS_FOR_STOPS) has ended. */
void db_stops_ended(struct db_session *session, uint32_t sequence, enum db_result result);

/* Answers a session that waits for a stop of whatever kind: the stop goes on, and nobody waits for it. For
 * DB_WAITS_FOR_STOPS that is also what is to be done when it is due. */
void db_stops_leave(struct db_session *session);

#endif
