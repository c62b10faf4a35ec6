/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The last commands and parameter writes of one drive, for whoever asks later what moved it. Pure;
 * in memory only, no allocation.
 */
#ifndef DRIVEBRIDGE_AXIS_HISTORY_H
#define DRIVEBRIDGE_AXIS_HISTORY_H

#include "drivebridge/history.h"
#include "drivebridge/time.h"

/* A struct db_history_entry as it is kept, where its number is known by its place. */
struct db_history_kept {
	uint64_t timestamp_us;
	uint8_t address[16];
	uint32_t duration_us;
	int32_t position;
	int32_t position_2;
	float real;
	uint32_t value;
	uint16_t port;
	uint16_t command_id;
	uint16_t command;
	uint16_t number;
	uint16_t repeats;
	uint8_t result;
	bool bus; /* it went to the bus */
};

struct db_history {
	uint32_t count; /* entries so far; the newest is number `count` */
	struct db_history_kept entries[DB_HISTORY_MAX];
};

/*
 * Adds an entry and returns its number, which is given here; `bus`: it goes to the bus, and is to
 * be ended. What is refused without the bus exactly as the entry before, and to the same client,
 * only counts there: a scanner that writes for ever does not wipe out what happened before.
 */
uint32_t db_history_add(struct db_history *history, const struct db_history_entry *entry, bool bus);

/* The following ignore entries that have been overwritten, and number 0, which none has. */

/* A writer joined the request: no entry of its own. */
void db_history_repeat(struct db_history *history, uint32_t number);

/*
 * What became of a request after so long: called when the bus ended it, and again when the motion
 * that it began ended.
 */
void db_history_end(struct db_history *history, uint32_t number, enum db_result result,
                    db_time took);

/* age 0 is the newest; false: there are not so many. */
bool db_history_get(const struct db_history *history, size_t age, struct db_history_entry *entry);

/* Puts the arguments that a command has into the entry. */
void db_history_args(struct db_history_entry *entry, unsigned code, const struct db_args *args);

#endif
