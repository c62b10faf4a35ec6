/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Events that happen again within a short time: logged a few times (struct db_event_kind), and then
 * as a count, once a minute and with the newest text. More of them are stored than logged. Pure: no
 * clock, no allocation. Internal to src/bridge/log.
 */
#ifndef DRIVEBRIDGE_LOG_REPEAT_H
#define DRIVEBRIDGE_LOG_REPEAT_H

#include "log/log_private.h"

#include <stdbool.h>

#define DB_REPEAT_PERIOD_S 60

/* Number of subjects with events in the last minute. If there are more, the oldest entry is
 * removed, and its subject may be logged once more than it should. */
#define DB_REPEATS_MAX 64

struct db_repeat {
	db_time since; /* beginning of this minute; 0 = a free place */
	uint64_t subject;
	unsigned logged;
	unsigned kept;
	uint32_t withheld; /* number withheld from the log; ... */
	uint32_t unkept;   /* ... and of these, number not stored either */
};

/* What to do with a line. */
enum db_repeat_verdict {
	DB_REPEAT_COUNTED, /* nothing */
	DB_REPEAT_KEPT,    /* it is stored, and not logged */
	DB_REPEAT_LOGGED,  /* it is stored and logged */
};

struct db_repeats {
	struct db_repeat entries[DB_REPEATS_MAX];
	/* The newest withheld line of each. Separate, because most have none: then this memory is
	 * not touched. */
	struct db_log_record newest[DB_REPEATS_MAX];
};

/* Decides what to do with the line; lines that are not logged are counted. */
enum db_repeat_verdict db_repeats_pass(struct db_repeats *repeats,
                                       const struct db_log_record *record, db_time now);

/* When db_repeats_due() has something to do; DB_TIME_NEVER. */
db_time db_repeats_next(const struct db_repeats *repeats);

/* The next line with a count that is due, or with `all` any. False: there is none. `unkept`: number
 * of counted lines that are not stored either; if there are any, this line is stored. */
bool db_repeats_due(struct db_repeats *repeats, db_time now, bool all, struct db_log_record *record,
                    uint32_t *unkept);

#endif
