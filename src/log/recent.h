/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The latest lines of the log, for those who ask later: packed behind each other, because most are short. Pure: no
 * clock, no allocation. Internal to src/log.
 */
#ifndef DRIVEBRIDGE_LOG_RECENT_H
#define DRIVEBRIDGE_LOG_RECENT_H

#include "log/record.h"

#include <stdbool.h>

/* Some two hundred bytes for each line. */
#define DB_RECENT_BYTES 49152

struct db_recent {
	uint64_t last;  /* number of the newest line; 0: none yet */
	uint32_t count; /* lines that are kept */
	uint32_t begin; /* place of the oldest one */
	uint32_t used;
	unsigned char bytes[DB_RECENT_BYTES]; /* a ring */
	/* Beginnings of the lines by number, modulo. */
	uint32_t places[DB_LOG_RECENT];
};

void db_recent_add(struct db_recent *recent, const struct db_log_record *record, uint64_t time_us);

/* The line of this number, or the oldest one that is younger. False: there is none. */
bool db_recent_find(const struct db_recent *recent, uint64_t from, struct db_log_line *line);

/* The latest of these events (DB_EVENT_BIT() each) with these names, "" for none, not older than `since_us`. */
bool db_recent_latest(const struct db_recent *recent, uint64_t events, const char *bus,
                      const char *drive, uint64_t since_us, struct db_log_line *line);

#endif
