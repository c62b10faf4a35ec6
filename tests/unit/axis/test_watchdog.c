/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/watchdog.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static void it_sleeps_until_something_moves(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500);
	assert_int_equal(db_watchdog_deadline(&watchdog), DB_TIME_NEVER);
	assert_false(db_watchdog_trip(&watchdog, 3600 * DB_NS_PER_S));
	db_watchdog_arm(&watchdog, 1000 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 1500 * MS);
	assert_int_equal(db_watchdog_remaining_ms(&watchdog, 1100 * MS), 400);
}

static void requests_keep_it_quiet_and_silence_trips_it_once(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500);
	db_watchdog_arm(&watchdog, 0);
	db_watchdog_feed(&watchdog, 400 * MS);
	assert_false(db_watchdog_trip(&watchdog, 899 * MS));
	assert_true(db_watchdog_trip(&watchdog, 900 * MS));
	assert_true(watchdog.latched);
	assert_int_equal(watchdog.trips, 1);
	assert_false(db_watchdog_trip(&watchdog, 5000 * MS));
	/* Talking again does not end the latch. */
	db_watchdog_feed(&watchdog, 5000 * MS);
	assert_true(watchdog.latched);
	db_watchdog_reset(&watchdog);
	assert_false(watchdog.latched);
	assert_false(db_watchdog_trip(&watchdog, 9000 * MS));
	db_watchdog_arm(&watchdog, 9000 * MS);
	assert_true(db_watchdog_trip(&watchdog, 9500 * MS));
	assert_int_equal(watchdog.trips, 2);
}

static void zero_turns_it_off(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 0);
	db_watchdog_arm(&watchdog, 0);
	assert_false(db_watchdog_trip(&watchdog, 3600 * DB_NS_PER_S));
	assert_int_equal(db_watchdog_remaining_ms(&watchdog, 1), 0);
	db_watchdog_set(&watchdog, 100, 10 * MS);
	assert_true(db_watchdog_trip(&watchdog, 110 * MS));
	db_watchdog_set(&watchdog, 0, 200 * MS);
	assert_true(watchdog.latched);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_sleeps_until_something_moves),
		cmocka_unit_test(requests_keep_it_quiet_and_silence_trips_it_once),
		cmocka_unit_test(zero_turns_it_off),
	};

	return cmocka_run_group_tests_name("watchdog", tests, NULL, NULL);
}
