/* SPDX-License-Identifier: Apache-2.0 */
/* The calls that act: Write and Run, for whom they do it, and how they go on when what they wait for comes. Internal to
 * src/control. */
#ifndef DRIVEBRIDGE_CONTROL_ACT_H
#define DRIVEBRIDGE_CONTROL_ACT_H

#include "control/call.h"

/* Whether the session may act; else its call is answered. */
bool db_act_is_allowed(struct db_session *session);

/* Why a command ended like that, for people. */
const char *db_act_reason_of(enum db_result result);

/* For the next answer that the session waits for. */
struct db_write_token db_act_next_token(struct db_session *session);

void db_act_introduce(const struct db_call *call);
void db_act_write(const struct db_call *call);
void db_act_run(const struct db_call *call);

/* What the session waits for (DB_WAITS_FOR_WRITE, _RUN) has ended. */
void db_act_ended(struct db_session *session, enum db_result result);

/* It is due (DB_WAITS_FOR_MOTION, _FIRST). */
void db_act_look(struct db_session *session, db_time now);

#endif
