/* SPDX-License-Identifier: Apache-2.0 */
#include "client/clock.h"

#include <time.h>

static db_time read_clock(clockid_t clock)
{
	struct timespec time;

	(void)clock_gettime(clock, &time);
	return (db_time)time.tv_sec * DB_NS_PER_S + time.tv_nsec;
}

db_time db_client_now(void)
{
	return read_clock(CLOCK_MONOTONIC);
}

int64_t db_client_wall_us(void)
{
	return read_clock(CLOCK_REALTIME) / DB_NS_PER_US;
}
