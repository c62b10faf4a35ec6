/* SPDX-License-Identifier: Apache-2.0 */
/* Proof of age (Clock, and the tokens of calls that move), and the beats of held motions. Internal to src/control;
 * network thread only. */
#ifndef DRIVEBRIDGE_CONTROL_HELD_H
#define DRIVEBRIDGE_CONTROL_HELD_H

#include "control/call.h"

void db_held_clock(const struct db_call *call);
void db_held_beat(const struct db_call *call);
/* A Beat that nobody waits for an answer of, while its session waits for the end of another call. */
void db_held_beat_silently(const struct db_call *call);

/* A token of now; the caller frees it. */
json_t *db_held_token(const struct db_control_socket *control);

/* Whether the call's token, if it has one, is young enough for what starts or holds a motion; if not, the call is
 * answered. */
bool db_held_is_young(const struct db_call *call);

/* The optional parameter hold_ms, 0 when it is missing: a motion that is to be held needs a token, a command that moves,
 * and a client that can send beats. False: the call is answered. */
bool db_held_span(const struct db_call *call, const struct db_command_row *row, uint32_t *hold_ms);

#endif
