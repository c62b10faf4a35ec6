/* SPDX-License-Identifier: Apache-2.0 */
/*
 * When a bus is reported as too slow, and how long its thread waited for a processor. Figures and
 * times are made up.
 */
#include "sched/bus_watch.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define S DB_NS_PER_S
#define BEGIN (1000 * S)

static void it_is_judged_every_ten_seconds(void **state)
{
	struct db_bus_stats stats = { .cycles = 1 };
	struct bus_watch watch = { .judge_at = 0 };
	struct bus_slowness slow;

	(void)state;
	assert_false(bus_watch_is_due(&watch, &stats, 0));
	assert_true(bus_watch_is_due(&watch, &stats, 1));
	assert_true(bus_watch_is_due(&watch, &stats, BEGIN));
	(void)bus_watch_judge(&watch, &stats, 0, BEGIN, &slow);
	assert_false(bus_watch_is_due(&watch, &stats, BEGIN + 10 * S - 1));
	assert_true(bus_watch_is_due(&watch, &stats, BEGIN + 10 * S));
}

/* Judges an interval of ten seconds with this many cycles, of which so many overran. */
static bool judge(uint32_t cycles, uint32_t overruns, struct bus_slowness *slow)
{
	struct db_bus_stats stats = {
		.cycles = 500, .overruns = 400, .overslept_us = 7000, .cycle_us = 1
	};
	struct bus_watch watch = { .judge_at = 0 };

	(void)bus_watch_judge(&watch, &stats, 3 * MS, BEGIN, slow);
	stats.cycles += cycles;
	stats.overruns += overruns;
	stats.overslept_us += 2000;
	stats.cycle_us = 12345;
	return bus_watch_judge(&watch, &stats, 8 * MS, BEGIN + 10 * S, slow);
}

static void it_is_too_slow_if_more_than_every_tenth_cycle_overruns(void **state)
{
	struct bus_slowness slow;

	(void)state;
	assert_false(judge(1000, 0, &slow));
	assert_false(judge(1000, 100, &slow));
	assert_true(judge(1000, 101, &slow));
	assert_int_equal(slow.overruns, 101);
	assert_int_equal(slow.seconds, 10);
	assert_int_equal(slow.cycle_us, 12345);
	assert_int_equal(slow.waited, 5 * MS);
	assert_int_equal(slow.overslept, 2 * MS);
	assert_false(slow.has_priority);
}

/* The first figures since the start, or since a scan had the bus to itself, have none before them
 * to be compared with. */
static void the_first_figures_are_not_judged(void **state)
{
	struct db_bus_stats stats = { .cycles = 100, .overruns = 90 };
	struct bus_watch watch = { .judge_at = 0 };
	struct bus_slowness slow;

	(void)state;
	assert_false(bus_watch_judge(&watch, &stats, 0, BEGIN, &slow));
	stats.aside = true;
	assert_true(bus_watch_is_due(&watch, &stats, BEGIN + 1 * S));
	stats.overruns += 50;
	assert_false(bus_watch_judge(&watch, &stats, 0, BEGIN + 1 * S, &slow));
	stats.aside = false;
	stats.cycles += 100;
	stats.overruns += 50;
	assert_true(bus_watch_is_due(&watch, &stats, BEGIN + 11 * S));
	assert_true(bus_watch_judge(&watch, &stats, 0, BEGIN + 11 * S, &slow));
	assert_int_equal(slow.overruns, 50);
}

/* The kernel counts this time, and the thread measures how late it woke: the larger figure of each
 * interval is taken. */
static void time_without_a_processor_is_summed_over_two_intervals(void **state)
{
	struct db_bus_stats stats = { .overslept_us = 4000 };
	struct bus_watch watch = { .judge_at = 0 };
	struct bus_slowness slow;

	(void)state;
	(void)bus_watch_judge(&watch, &stats, 1 * MS, BEGIN, &slow);
	assert_int_equal(bus_watch_missed(&watch, &stats, 1 * MS), 4 * MS);
	assert_int_equal(bus_watch_missed(&watch, &stats, 11 * MS), 14 * MS);
	stats.overslept_us += 20000;
	assert_int_equal(bus_watch_missed(&watch, &stats, 11 * MS), 24 * MS);
	(void)bus_watch_judge(&watch, &stats, 31 * MS, BEGIN + 10 * S, &slow);
	assert_int_equal(bus_watch_missed(&watch, &stats, 31 * MS), 30 * MS);
	assert_int_equal(bus_watch_missed(&watch, &stats, 32 * MS), 31 * MS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_is_judged_every_ten_seconds),
		cmocka_unit_test(it_is_too_slow_if_more_than_every_tenth_cycle_overruns),
		cmocka_unit_test(the_first_figures_are_not_judged),
		cmocka_unit_test(time_without_a_processor_is_summed_over_two_intervals),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
