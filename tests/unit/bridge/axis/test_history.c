/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

/* Every member has a value of its own. */
static void an_entry_comes_back_as_it_was(void **state)
{
	static struct db_history history;
	struct db_history_entry entry = {
		.timestamp_us = 1,
		.address = { 2, [15] = 3 },
		.port = 4,
		.command_id = 5,
		.command = 0xFFFF, /* whatever a client wrote */
		.result = DB_RESULT_OUT_OF_RANGE,
		.number = 6,
		.position = 7,
		.position_2 = 8,
		.real = 9.0f,
		.value = 10,
	};
	struct db_history_entry found;

	(void)state;
	memset(&found, 0xA5, sizeof found);
	assert_int_equal(db_history_add(&history, &entry, false), 1);
	assert_int_equal(db_history_add(&history, &entry, false), 1);
	assert_true(db_history_get(&history, 0, &found));
	assert_false(db_history_get(&history, 1, &found));
	entry.sequence = 1;
	entry.repeats = 1;
	assert_int_equal(found.timestamp_us, entry.timestamp_us);
	assert_memory_equal(found.address, entry.address, sizeof entry.address);
	assert_int_equal(found.sequence, entry.sequence);
	assert_int_equal(found.port, entry.port);
	assert_int_equal(found.command_id, entry.command_id);
	assert_int_equal(found.command, entry.command);
	assert_int_equal(found.result, entry.result);
	assert_int_equal(found.duration_us, 0);
	assert_int_equal(found.repeats, entry.repeats);
	assert_int_equal(found.number, entry.number);
	assert_int_equal(found.position, entry.position);
	assert_int_equal(found.position_2, entry.position_2);
	assert_float_equal(found.real, entry.real, 0.0f);
	assert_int_equal(found.value, entry.value);
}

/* 2^32 commands: numbers begin anew, and what was under way is still ended. */
static void numbers_wrap(void **state)
{
	static struct db_history history = { .count = UINT32_MAX - 2 };
	const struct db_history_entry entry = { .result = DB_RESULT_PENDING };
	struct db_history_entry found;
	uint32_t before;
	uint32_t after;

	(void)state;
	before = db_history_add(&history, &entry, true);
	assert_int_equal(db_history_add(&history, &entry, true), UINT32_MAX);
	after = db_history_add(&history, &entry, true);
	assert_int_not_equal(after, 0);
	db_history_end(&history, before, DB_RESULT_OK, 5 * DB_NS_PER_US);
	db_history_end(&history, after, DB_RESULT_REFUSED, -1);
	db_history_end(&history, 0, DB_RESULT_FAILED, 0);
	assert_true(db_history_get(&history, 0, &found));
	assert_int_equal(found.result, DB_RESULT_REFUSED);
	assert_int_equal(found.duration_us, 0);
	assert_true(db_history_get(&history, 1, &found));
	assert_int_equal(found.result, DB_RESULT_PENDING);
	assert_true(db_history_get(&history, 2, &found));
	assert_int_equal(found.result, DB_RESULT_OK);
	assert_int_equal(found.duration_us, 5);
	/* Overwritten. */
	for (unsigned i = 0; i < DB_HISTORY_MAX; i++)
		(void)db_history_add(&history, &entry, true);
	db_history_end(&history, before, DB_RESULT_FAILED, 0);
	db_history_end(&history, after, DB_RESULT_FAILED, 0);
	for (unsigned i = 0; i < DB_HISTORY_MAX; i++) {
		assert_true(db_history_get(&history, i, &found));
		assert_int_equal(found.result, DB_RESULT_PENDING);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_entry_comes_back_as_it_was),
		cmocka_unit_test(numbers_wrap),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
