/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Time as every room understands it: signed nanoseconds of CLOCK_MONOTONIC, handed in as `now` by
 * whoever owns the loop. Rooms never read a clock themselves, so tests can make their own time.
 */
#ifndef DRIVEBRIDGE_TIME_H
#define DRIVEBRIDGE_TIME_H

#include <stdint.h>

typedef int64_t db_time;

#define DB_TIME_NEVER INT64_MAX

#define DB_NS_PER_US INT64_C(1000)
#define DB_NS_PER_MS INT64_C(1000000)
#define DB_NS_PER_S INT64_C(1000000000)

/* A span as a figure in microseconds, as far as 32 bits go; 0 for one that is negative. */
static inline uint32_t db_time_us32(db_time span)
{
	db_time us = span / DB_NS_PER_US;

	return us < 0 ? 0 : us > UINT32_MAX ? UINT32_MAX : (uint32_t)us;
}

#endif
