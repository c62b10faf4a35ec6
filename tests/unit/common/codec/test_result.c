/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/result.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <string.h>
#include <cmocka.h>

/* Numbers and names are what PLC programs rely on, so they are written out here once more. */
static const struct {
	enum db_result result;
	int number;
	const char *name;
} rows[] = {
	{ DB_RESULT_NONE, 0, "none" },
	{ DB_RESULT_OK, 1, "ok" },
	{ DB_RESULT_PENDING, 2, "pending" },
	{ DB_RESULT_REFUSED, 3, "refused" },
	{ DB_RESULT_OUT_OF_RANGE, 4, "out_of_range" },
	{ DB_RESULT_TIMEOUT, 5, "timeout" },
	{ DB_RESULT_INDETERMINATE, 6, "indeterminate" },
	{ DB_RESULT_RESTARTED, 7, "restarted" },
	{ DB_RESULT_CANCELLED, 8, "cancelled" },
	{ DB_RESULT_LIMIT, 9, "limit" },
	{ DB_RESULT_LATCHED, 10, "latched" },
	{ DB_RESULT_UNSUPPORTED, 11, "unsupported" },
	{ DB_RESULT_BUSY, 12, "busy" },
	{ DB_RESULT_BUS_DOWN, 13, "bus_down" },
	{ DB_RESULT_OFFLINE, 14, "offline" },
	{ DB_RESULT_FAILED, 15, "failed" },
	{ DB_RESULT_RATE_LIMITED, 16, "rate_limited" },
	{ DB_RESULT_NOT_IN_CONTROL, 17, "not_in_control" },
	{ DB_RESULT_UNPROVEN, 18, "unproven" },
	{ DB_RESULT_RUNS_ON, 19, "runs_on" },
	{ DB_RESULT_LINE_MOVES, 20, "line_moves" },
};

static void every_code_is_listed(void **state)
{
	(void)state;
	assert_int_equal(sizeof rows / sizeof rows[0], DB_RESULT_COUNT);
}

static void numbers_and_names(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
		assert_int_equal((int)rows[i].result, rows[i].number);
		assert_string_equal(db_result_name(rows[i].result), rows[i].name);
	}
}

static void success_is_proven_or_not(void **state)
{
	(void)state;
	for (int i = 0; i < DB_RESULT_COUNT; i++)
		assert_int_equal(db_result_is_success((enum db_result)i),
		                 i == DB_RESULT_OK || i == DB_RESULT_UNPROVEN);
}

static void names_are_distinct(void **state)
{
	(void)state;
	for (int i = 0; i < DB_RESULT_COUNT; i++) {
		for (int j = 0; j < i; j++)
			assert_true(strcmp(db_result_name((enum db_result)i),
			                   db_result_name((enum db_result)j)) != 0);
	}
}

static void outside_the_enum(void **state)
{
	(void)state;
	assert_string_equal(db_result_name(DB_RESULT_COUNT), "unknown");
	assert_string_equal(db_result_name((enum db_result) - 1), "unknown");
	assert_string_equal(db_result_name((enum db_result)1000), "unknown");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_code_is_listed),     cmocka_unit_test(numbers_and_names),
		cmocka_unit_test(success_is_proven_or_not), cmocka_unit_test(names_are_distinct),
		cmocka_unit_test(outside_the_enum),
	};

	return cmocka_run_group_tests_name("codec/result", tests, NULL, NULL);
}
