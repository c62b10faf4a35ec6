/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The clocks, for who owns a loop or tells people the time; everything else gets `now` passed in
 * (time.h). Any thread.
 */
#ifndef DRIVEBRIDGE_CLOCK_H
#define DRIVEBRIDGE_CLOCK_H

#include "drivebridge/time.h"

#include <time.h>

/* CLOCK_MONOTONIC, CLOCK_BOOTTIME or CLOCK_REALTIME, nanoseconds. */
static inline db_time db_clock_read(clockid_t clock)
{
	struct timespec now;

	clock_gettime(clock, &now);
	return (db_time)now.tv_sec * DB_NS_PER_S + now.tv_nsec;
}

/* What db_time counts. */
static inline db_time db_clock_now(void)
{
	return db_clock_read(CLOCK_MONOTONIC);
}

/* Microseconds since 1970-01-01 UTC. */
static inline uint64_t db_clock_wall_us(void)
{
	return (uint64_t)(db_clock_read(CLOCK_REALTIME) / DB_NS_PER_US);
}

/* The same of an earlier moment, where both clocks are now at `now` and `wall_us`. */
static inline uint64_t db_clock_wall_us_of(db_time moment, db_time now, uint64_t wall_us)
{
	uint64_t age = now > moment ? (uint64_t)((now - moment) / DB_NS_PER_US) : 0;

	return wall_us > age ? wall_us - age : 0;
}

/* CLOCK_REALTIME minus CLOCK_MONOTONIC, nanoseconds, as `read` (db_clock_read) reads them. A thread
 * that has to wait for the processor between two readings would be wrong by that time, and the
 * times of its data would go back: the quickest of some readings counts. */
static inline db_time db_clock_wall_offset(db_time (*read)(clockid_t))
{
	db_time least = DB_TIME_NEVER;
	db_time offset = 0;

	for (unsigned i = 0; i < 5 && least > 10 * DB_NS_PER_US; i++) {
		db_time before = read(CLOCK_MONOTONIC);
		db_time wall = read(CLOCK_REALTIME);
		db_time took = read(CLOCK_MONOTONIC) - before;

		if (took < least) {
			least = took;
			offset = wall - before - took / 2;
		}
	}
	return offset;
}

#endif
