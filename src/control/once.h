/* SPDX-License-Identifier: Apache-2.0 */
/* What Run and Write have in common where a call says its id and how long it may wait: it is carried out in time and
 * once, and when it comes again it gets the result of the first time. Internal to src/control; network thread only. */
#ifndef DRIVEBRIDGE_CONTROL_ONCE_H
#define DRIVEBRIDGE_CONTROL_ONCE_H

#include "control/call.h"

/* Whether the call is to be begun now, with the session's `once` as its handle (0: it has no id). Else it is answered, or
 * waits for the end of the first one. `drive` is the name; a call that `stops` is always begun. */
bool db_once_begin(const struct db_call *call, const char *drive, bool stops);

/* It is refused after all, and was not begun: its id is as good as new. */
void db_once_drop(struct db_session *session);

/* By which its end will be told, of a command also its place in the drive's history. */
void db_once_note_begun(struct db_session *session, struct db_write_token token, uint32_t entry);

/* How it ended, for who asks again. `over`: no motion goes on. */
void db_once_end(struct db_session *session, enum db_result result, bool over);

/* The first one as it is now, of a session that waits for it (DB_WAITS_FOR_FIRST). Null: it was not begun after all. */
const struct db_id_call *db_once_first(const struct db_session *session);

/* Nobody waits for the session's call any more. */
void db_once_abandon(struct db_session *session);

#endif
