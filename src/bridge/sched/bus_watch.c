/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/bus_watch.h"

/* It is too slow when more than one cycle in this number overran. A few are not reported: the
 * figures count them. */
#define OVERRUN_SHARE 10

static db_time overslept(const struct bus_watch *watch, const struct db_bus_stats *stats)
{
	return (db_time)(stats->overslept_us - watch->judged.overslept_us) * DB_NS_PER_US;
}

bool bus_watch_is_due(struct bus_watch *watch, const struct db_bus_stats *stats, db_time now)
{
	/* The figures before and after a scan that had the bus to itself cannot be compared. */
	if (stats->aside)
		watch->judge_at = 0;
	/* The first figures are made before the thread runs. */
	return now >= watch->judge_at && now != 0;
}

bool bus_watch_judge(struct bus_watch *watch, const struct db_bus_stats *stats, db_time waited,
                     db_time now, struct bus_slowness *slow)
{
	uint32_t cycles = stats->cycles - watch->judged.cycles;
	uint32_t overruns = stats->overruns - watch->judged.overruns;
	bool is_slow = watch->judge_at != 0 && overruns > cycles / OVERRUN_SHARE;

	*slow = (struct bus_slowness){
		.overruns = overruns,
		.seconds = (unsigned)(BUS_WATCH_INTERVAL / DB_NS_PER_S),
		.cycle_us = stats->cycle_us,
		.waited = waited - watch->judged_wait,
		.overslept = overslept(watch, stats),
	};
	watch->missed_before = db_time_max(slow->waited, slow->overslept);
	watch->judged = *stats;
	watch->judged_wait = waited;
	watch->judge_at = now + BUS_WATCH_INTERVAL;
	return is_slow;
}

db_time bus_watch_missed(const struct bus_watch *watch, const struct db_bus_stats *stats,
                         db_time waited)
{
	return watch->missed_before +
	       db_time_max(waited - watch->judged_wait, overslept(watch, stats));
}
