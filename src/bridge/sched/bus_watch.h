/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether the cycles of a bus are long enough, and how long its thread was kept from running,
 * judged every ten seconds from the bus's figures. Pure: figures and times are passed in. Internal
 * to src/bridge/sched; bus thread.
 */
#ifndef DRIVEBRIDGE_SCHED_BUS_WATCH_H
#define DRIVEBRIDGE_SCHED_BUS_WATCH_H

#include "drivebridge/bus.h"
#include "sched/bus_log.h"

#include <stdbool.h>

#define BUS_WATCH_INTERVAL (10 * DB_NS_PER_S)

/* Begins as 0. */
struct bus_watch {
	struct db_bus_stats judged; /* figures at the last judgement */
	db_time judged_wait;        /* time spent waiting for a processor until then */
	db_time judge_at;           /* time of the next judgement; 0 before the first */
	db_time missed_before;      /* time without a processor in the interval before that one */
};

/* True if bus_watch_judge() is to be called: the wait is read only then. To be called in each turn
 * with its figures. */
bool bus_watch_is_due(struct bus_watch *watch, const struct db_bus_stats *stats, db_time now);
/* `waited`: the time that the thread was ready to run but not running, since it began. True: too
 * many cycles overran, and *slow tells all but whether the thread has its priority. */
bool bus_watch_judge(struct bus_watch *watch, const struct db_bus_stats *stats, db_time waited,
                     db_time now, struct bus_slowness *slow);
/* Time without a processor in this interval and the one before. */
db_time bus_watch_missed(const struct bus_watch *watch, const struct db_bus_stats *stats,
                         db_time waited);

#endif
