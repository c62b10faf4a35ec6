/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Time in every room: signed nanoseconds of CLOCK_MONOTONIC, passed in as `now` by the owner of the
 * loop. Rooms never read a clock themselves, so tests can make their own time.
 */
#ifndef DRIVEBRIDGE_TIME_H
#define DRIVEBRIDGE_TIME_H

#include <stdint.h>

typedef int64_t db_time;

#define DB_TIME_NEVER INT64_MAX

#define DB_NS_PER_US INT64_C(1000)
#define DB_NS_PER_MS INT64_C(1000000)
#define DB_NS_PER_S INT64_C(1000000000)

static inline db_time db_time_min(db_time a, db_time b)
{
	return a < b ? a : b;
}

static inline db_time db_time_max(db_time a, db_time b)
{
	return a > b ? a : b;
}

/* A span in microseconds, limited to 32 bits; 0 if negative. */
static inline uint32_t db_time_us32(db_time span)
{
	db_time us = span / DB_NS_PER_US;

	return us < 0 ? 0 : us > UINT32_MAX ? UINT32_MAX : (uint32_t)us;
}

#endif
