/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What happened just now and happens again: logged a few times (struct db_event_kind), and then as
 * a count, once a minute and with the newest text. Pure: no clock, no allocation. Internal to
 * src/log.
 */
#ifndef DRIVEBRIDGE_LOG_REPEAT_H
#define DRIVEBRIDGE_LOG_REPEAT_H

#include "log/record.h"

#include <stdbool.h>

#define DB_REPEAT_PERIOD_S 60

/* Subjects of which something happened in the last minute. With more, the one that is remembered
 * longest is forgotten, and may be logged once more than it should. */
#define DB_REPEATS_MAX 64

struct db_repeat {
	db_time since; /* when this minute began; 0 = a free place */
	uint64_t subject;
	unsigned logged;
	uint32_t withheld;
};

struct db_repeats {
	struct db_repeat entries[DB_REPEATS_MAX];
	/* Of each the newest of the withheld ones. Apart, because most have none: then it is not
	 * touched. */
	struct db_log_record newest[DB_REPEATS_MAX];
};

/* Whether the line is to be logged; else it is counted. */
bool db_repeats_pass(struct db_repeats *repeats, const struct db_log_record *record, db_time now);

/* When db_repeats_due() has something to do; DB_TIME_NEVER. */
db_time db_repeats_next(const struct db_repeats *repeats);

/* The next line with a count that is due, or with `all` any. False: there is none. */
bool db_repeats_due(struct db_repeats *repeats, db_time now, bool all,
                    struct db_log_record *record);

#endif
