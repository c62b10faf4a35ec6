/* SPDX-License-Identifier: Apache-2.0 */
/* The common part of Run and Write for calls with an id and a maximum wait: a call is carried out
 * in time and once, and a repeat gets the result of the first time. Internal to src/bridge/control;
 * network thread only. */
#ifndef DRIVEBRIDGE_CONTROL_ONCE_H
#define DRIVEBRIDGE_CONTROL_ONCE_H

#include "control/call.h"

/* True if the call is to be begun now, with the session's `once` as its handle (0: no id). Else it
 * was answered, or waits for the end of the first one. `drive` is the name; a call that `stops` is
 * always begun. */
bool db_once_begin(const struct db_call *call, const char *drive, bool stops);

/* The call is refused after all, and was not begun: its id counts as unused. */
void db_once_drop(struct db_session *session);

/* Notes the token by which its end will be reported, and for a command also its entry in the
 * drive's history. */
void db_once_note_begun(struct db_session *session, struct db_write_token token, uint32_t entry);

/* Records the result, for repeats. `over`: no motion continues. */
void db_once_end(struct db_session *session, enum db_result result, bool over);

/* The present state of the first call, for a session that waits for it (DB_WAITS_FOR_FIRST). Null:
 * it was not begun after all. */
const struct db_id_call *db_once_first(const struct db_session *session);

/* Nobody waits for the session's call any more. */
void db_once_abandon(struct db_session *session);

#endif
