/* SPDX-License-Identifier: Apache-2.0 */
/* The calls that act: Write and Run, for whom they are made (Introduce), and how they continue when
 * what they wait for has arrived. Internal to src/bridge/control. */
#ifndef DRIVEBRIDGE_CONTROL_ACT_H
#define DRIVEBRIDGE_CONTROL_ACT_H

#include "control/call.h"

/* True if the session may act; else its call is answered. */
bool db_act_is_allowed(struct db_session *session);

/* The reason for a command's result, for people. */
const char *db_act_reason_of(enum db_result result);

/* A token for the next answer that the session waits for. */
struct db_write_token db_act_next_token(struct db_session *session);

void db_act_introduce(const struct db_call *call);
void db_act_write(const struct db_call *call);
void db_act_run(const struct db_call *call);

/* The write or command that the session waits for (DB_WAITS_FOR_WRITE, _RUN) has ended. */
void db_act_ended(struct db_session *session, enum db_result result);

/* Called when it is due (DB_WAITS_FOR_MOTION, _FIRST). */
void db_act_look(struct db_session *session, db_time now);

#endif
