/* SPDX-License-Identifier: Apache-2.0 */
/* How the time of a reading becomes the time of day, on a machine that is busy. */
#include "drivebridge/clock.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define OFFSET (1000 * DB_NS_PER_S)

static db_time now;
static unsigned readings;
static unsigned waits; /* bits: before this reading the thread has to wait for the processor */

static db_time read_clock(clockid_t clock)
{
	now += waits >> readings & 1 ? 9 * DB_NS_PER_MS : 100;
	readings++;
	return clock == CLOCK_REALTIME ? now + OFFSET : now;
}

/* Whichever reading comes late: one of three, of the first three, and of each three but the last. */
static void a_reading_that_comes_late_does_not_count(void **state)
{
	static const unsigned cases[] = { 0, 1 << 1, 1 << 2, 1 << 1 | 1 << 5, 02222, 04444 };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		readings = 0;
		waits = cases[i];
		assert_int_equal(db_clock_wall_offset(read_clock), OFFSET);
	}
}

static void on_a_machine_that_is_always_late_it_is_nearly_right(void **state)
{
	(void)state;
	readings = 0;
	waits = ~0u;
	assert_in_range(db_clock_wall_offset(read_clock), OFFSET - 9 * DB_NS_PER_MS,
	                OFFSET + 9 * DB_NS_PER_MS);
	assert_true(readings <= 15);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_reading_that_comes_late_does_not_count),
		cmocka_unit_test(on_a_machine_that_is_always_late_it_is_nearly_right),
	};

	return cmocka_run_group_tests_name("clock", tests, NULL, NULL);
}
