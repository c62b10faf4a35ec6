/* SPDX-License-Identifier: Apache-2.0 */
/* What is kept of a bus when there is trouble on it. */
#include "drivebridge/trace_keeper.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#define SECOND DB_NS_PER_S
#define WALL (1000 * SECOND)

static struct db_trace *trace;
static struct db_trace_keeper *keeper;

static int begin(void **state)
{
	(void)state;
	trace = db_trace_new(4096);
	keeper = db_trace_keeper_new();
	return trace && keeper ? 0 : -1;
}

static int end(void **state)
{
	(void)state;
	db_trace_keeper_free(keeper);
	db_trace_free(trace);
	return 0;
}

static void lose(const char *drive, db_time now)
{
	db_trace_write_event(trace, now, DB_EVENT_DRIVE_LOST, drive);
	db_trace_keeper_look(keeper, "line", trace, now);
}

static void keep(db_time now)
{
	db_trace_keeper_run(keeper, now, WALL);
}

static void expect(size_t at, uint32_t number, enum db_event event, const char *drive)
{
	const struct db_trace_kept *kept = db_trace_keeper_at(keeper, at);

	assert_non_null(kept);
	assert_int_equal(kept->number, number);
	assert_int_equal(kept->cause.event, event);
	assert_string_equal(kept->cause.drive, drive);
	assert_string_equal(kept->bus, "line");
}

static void a_trace_is_kept_some_time_behind_the_trouble(void **state)
{
	struct db_trace_place place = { .at = 0 };
	struct db_trace_record record;
	uint32_t missed;
	unsigned count = 0;

	(void)state;
	db_trace_keeper_look(keeper, "line", trace, SECOND);
	assert_true(db_trace_keeper_next(keeper) == DB_TIME_NEVER);
	lose("feeder", SECOND);
	assert_true(db_trace_keeper_next(keeper) == SECOND + DB_TRACE_AFTER);
	db_trace_write(trace, SECOND + 1, DB_TRACE_PROBE, 0, "x", 1);
	keep(SECOND + DB_TRACE_AFTER - 1);
	assert_null(db_trace_keeper_at(keeper, 0));
	keep(SECOND + DB_TRACE_AFTER);
	expect(0, 1, DB_EVENT_DRIVE_LOST, "feeder");
	assert_null(db_trace_keeper_at(keeper, 1));
	assert_true(db_trace_keeper_at(keeper, 0)->cause.time == SECOND);
	assert_true(db_trace_keeper_at(keeper, 0)->wall_offset == WALL);
	while (db_trace_read(db_trace_keeper_at(keeper, 0)->trace, &place, &record, &missed))
		count++;
	assert_int_equal(count, 2);
	/* Once. */
	assert_true(db_trace_keeper_next(keeper) == DB_TIME_NEVER);
	db_trace_keeper_look(keeper, "line", trace, 9 * SECOND);
	assert_true(db_trace_keeper_next(keeper) == DB_TIME_NEVER);
}

static void what_happened_first_is_the_cause(void **state)
{
	struct db_trace_cause cause = { .event = DB_EVENT_WATCHDOG_TRIPPED,
		                        .time = SECOND - 1,
		                        .drive = "lift" };

	(void)state;
	lose("feeder", SECOND);
	lose("conveyor", SECOND + 1);
	keep(2 * SECOND);
	expect(0, 1, DB_EVENT_DRIVE_LOST, "feeder");
	/* The watchdog is not in the bus's own trace. */
	cause.time = 3 * SECOND - 1;
	db_trace_keeper_note(keeper, "line", trace, &cause, 3 * SECOND);
	lose("feeder", 3 * SECOND);
	keep(4 * SECOND);
	expect(1, 2, DB_EVENT_WATCHDOG_TRIPPED, "lift");
	cause.time = 6 * SECOND;
	lose("feeder", 5 * SECOND);
	db_trace_keeper_note(keeper, "line", trace, &cause, 6 * SECOND);
	keep(7 * SECOND);
	expect(2, 3, DB_EVENT_DRIVE_LOST, "feeder");
}

static void what_happens_again_and_again_leaves_what_happened_once(void **state)
{
	(void)state;
	lose("lift", SECOND);
	keep(2 * SECOND);
	for (int i = 0; i < 10; i++) {
		lose("feeder", (3 + 2 * i) * SECOND);
		keep((4 + 2 * i) * SECOND);
	}
	expect(0, 1, DB_EVENT_DRIVE_LOST, "lift");
	expect(1, 9, DB_EVENT_DRIVE_LOST, "feeder");
	expect(3, 11, DB_EVENT_DRIVE_LOST, "feeder");
	assert_null(db_trace_keeper_at(keeper, DB_TRACES_KEPT_EACH));
	/* Something else takes the place of the oldest. */
	lose("conveyor", 50 * SECOND);
	keep(51 * SECOND);
	expect(3, 12, DB_EVENT_DRIVE_LOST, "conveyor");
	expect(0, 9, DB_EVENT_DRIVE_LOST, "feeder");
}

static void a_bus_that_goes_leaves_its_trace(void **state)
{
	(void)state;
	lose("feeder", SECOND);
	db_trace_keeper_leave(keeper, trace, WALL);
	db_trace_free(trace);
	trace = db_trace_new(4096);
	assert_non_null(trace);
	expect(0, 1, DB_EVENT_DRIVE_LOST, "feeder");
	assert_true(db_trace_keeper_next(keeper) == DB_TIME_NEVER);
}

static void all_buses_together_are_bounded(void **state)
{
	char name[16];

	(void)state;
	for (int i = 0; i < 2 * DB_TRACES_KEPT; i++) {
		snprintf(name, sizeof name, "bus%d", i);
		db_trace_write_event(trace, (i + 1) * SECOND, DB_EVENT_BUS_OFF, NULL);
		db_trace_keeper_look(keeper, name, trace, (i + 1) * SECOND);
		db_trace_keeper_leave(keeper, trace, WALL);
	}
	assert_non_null(db_trace_keeper_at(keeper, DB_TRACES_KEPT - 1));
	assert_null(db_trace_keeper_at(keeper, DB_TRACES_KEPT));
	assert_int_equal(db_trace_keeper_at(keeper, DB_TRACES_KEPT - 1)->number,
	                 2 * DB_TRACES_KEPT);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(a_trace_is_kept_some_time_behind_the_trouble),
		TEST(what_happened_first_is_the_cause),
		TEST(what_happens_again_and_again_leaves_what_happened_once),
		TEST(a_bus_that_goes_leaves_its_trace),
		TEST(all_buses_together_are_bounded),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
