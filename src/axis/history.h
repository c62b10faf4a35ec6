/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The last commands and parameter writes of one drive, for whoever asks later what moved it. Pure; in
 * memory only, no allocation.
 */
#ifndef DRIVEBRIDGE_AXIS_HISTORY_H
#define DRIVEBRIDGE_AXIS_HISTORY_H

#include "drivebridge/history.h"

struct db_history {
	uint32_t count; /* entries so far; the newest is number `count` */
	struct db_history_entry entries[DB_HISTORY_MAX];
	struct db_history_part {
		uint32_t ticket; /* of its request; 0: it never went to the bus, or is over */
		db_time arrived;
	} parts[DB_HISTORY_MAX];
};

/*
 * Adds an entry, whose sequence is given here. What is refused without the bus (ticket 0) exactly as
 * the entry before, and to the same client, only counts there: a scanner that writes for ever does
 * not wipe out what happened before.
 */
void db_history_add(struct db_history *history, const struct db_history_entry *entry,
                    uint32_t ticket, db_time now);

/* A writer joined the request: no entry of its own. */
void db_history_repeat(struct db_history *history, uint32_t ticket);

/* Another request took the place of this one. */
void db_history_retarget(struct db_history *history, uint32_t ticket, uint32_t to);

/*
 * What became of a request at `end`: called when the bus ended it, and again when the motion that it
 * began ended. Unknown tickets are ignored.
 */
void db_history_end(struct db_history *history, uint32_t ticket, enum db_result result,
                    db_time end);

/* age 0 is the newest; null: there are not so many. */
const struct db_history_entry *db_history_get(const struct db_history *history, size_t age);

/* Puts the arguments that a command has into the entry. */
void db_history_args(struct db_history_entry *entry, unsigned code, const struct db_args *args);

#endif
