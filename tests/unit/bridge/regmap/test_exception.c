/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "drivebridge/server.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

/* What PLC programs rely on, so it is written out here once more. */
static const struct {
	enum db_result result;
	int exception;
} rows[] = {
	{ DB_RESULT_NONE, 0x00 },          { DB_RESULT_OK, 0x00 },
	{ DB_RESULT_PENDING, 0x05 },       { DB_RESULT_REFUSED, 0x04 },
	{ DB_RESULT_OUT_OF_RANGE, 0x03 },  { DB_RESULT_TIMEOUT, 0x0B },
	{ DB_RESULT_INDETERMINATE, 0x0B }, { DB_RESULT_RESTARTED, 0x04 },
	{ DB_RESULT_CANCELLED, 0x04 },     { DB_RESULT_LIMIT, 0x03 },
	{ DB_RESULT_LATCHED, 0x04 },       { DB_RESULT_UNSUPPORTED, 0x01 },
	{ DB_RESULT_BUSY, 0x06 },          { DB_RESULT_BUS_DOWN, 0x0A },
	{ DB_RESULT_OFFLINE, 0x0B },       { DB_RESULT_FAILED, 0x04 },
	{ DB_RESULT_RATE_LIMITED, 0x04 },  { DB_RESULT_NOT_IN_CONTROL, 0x06 },
	{ DB_RESULT_UNPROVEN, 0x00 },      { DB_RESULT_RUNS_ON, 0x04 },
	{ DB_RESULT_LINE_MOVES, 0x06 },
};

static void every_result_is_listed(void **state)
{
	(void)state;
	assert_int_equal(sizeof rows / sizeof rows[0], DB_RESULT_COUNT);
}

static void each_result_has_its_exception(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
		struct db_write_answer answer = { .result = rows[i].result };

		assert_int_equal(db_exception_of(rows[i].result), rows[i].exception);
		assert_int_equal(db_exception_of_answer(answer), rows[i].exception);
		answer.later = true;
		assert_int_equal(db_exception_of_answer(answer), DB_WRITE_LATER);
	}
}

static void outside_the_enum(void **state)
{
	(void)state;
	assert_int_equal(db_exception_of(DB_RESULT_COUNT), 0x04);
	assert_int_equal(db_exception_of((enum db_result) - 1), 0x04);
}

static void what_was_taken(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
		struct db_write_answer answer = { .result = rows[i].result };

		/* NONE is no answer to a write. */
		if (rows[i].result != DB_RESULT_NONE)
			assert_int_equal(db_write_is_taken(answer),
			                 rows[i].exception == 0x00 || rows[i].exception == 0x05);
		answer.later = true;
		assert_true(db_write_is_taken(answer));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_result_is_listed),
		cmocka_unit_test(each_result_has_its_exception),
		cmocka_unit_test(outside_the_enum),
		cmocka_unit_test(what_was_taken),
	};

	return cmocka_run_group_tests_name("regmap/exception", tests, NULL, NULL);
}
