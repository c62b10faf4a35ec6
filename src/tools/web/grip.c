/* SPDX-License-Identifier: Apache-2.0 */
#include "web/grip.h"
#include "web/tokens.h"

const char *const db_web_grip_ends[] = { "",       "released", "late",   "refused", "stopped",
	                                 "logout", "lost",     "ending", "old",     "done" };

void db_web_grip_finish(struct db_web_grip *grip, enum db_web_grip_end end)
{
	if (!db_web_grip_is_held(grip))
		return;
	grip->end = end;
	grip->velocity = 0;
	grip->until = DB_TIME_NEVER;
}

void db_web_grip_look(struct db_web_grip *grip, db_time now)
{
	if (db_web_grip_is_held(grip) && now >= grip->until)
		db_web_grip_finish(grip, DB_WEB_GRIP_OVERDUE);
}

void db_web_grip_take(struct db_web_grip *grip, uint64_t number, uint64_t beat, double velocity,
                      db_time age, db_time now)
{
	bool is_old = velocity != 0 && age > DB_WEB_TOKEN_FRESH;

	db_web_grip_look(grip, now);
	if (number < grip->number || (number == grip->number && beat <= grip->beat))
		return;
	if (number > grip->number) {
		/* The former grip is over, even if its release arrives later or never. */
		grip->number = number;
		grip->end = DB_WEB_GRIP_HELD;
		if (is_old)
			db_web_grip_finish(grip, DB_WEB_GRIP_OLD);
	}
	if (!db_web_grip_is_held(grip) || is_old)
		return;
	grip->beat = beat;
	grip->velocity = velocity;
	grip->until = now + DB_WEB_GRIP_LATE;
	if (velocity == 0)
		db_web_grip_finish(grip, DB_WEB_GRIP_RELEASED);
}
