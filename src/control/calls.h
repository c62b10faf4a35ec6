/* SPDX-License-Identifier: Apache-2.0 */
/* Which methods there are, and one call of a session. Internal to src/control; network thread only. */
#ifndef DRIVEBRIDGE_CONTROL_CALLS_H
#define DRIVEBRIDGE_CONTROL_CALLS_H

#include "control/session.h"

/* Whether the message that came first may be taken now, and how long it is, which is left alone otherwise. */
bool db_calls_has_next(struct db_session *session, size_t *length);

/* Carries out a message, whatever it holds. */
void db_calls_take(struct db_session *session, const char *text, size_t length);

/* The description of the interface, as docs/ has it. */
extern const char db_calls_interface[];

#endif
