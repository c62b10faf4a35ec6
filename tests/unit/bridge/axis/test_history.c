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

/* Whatever is written all the time: a count that is too large for its register stays at its end. */
static void repeats_are_counted_to_the_last(void **state)
{
	static struct db_history history;
	const struct db_history_entry entry = { .result = DB_RESULT_REFUSED };
	struct db_history_entry found;

	(void)state;
	for (unsigned i = 0; i < UINT16_MAX + 3u; i++)
		assert_int_equal(db_history_add(&history, &entry, false), 1);
	assert_true(db_history_get(&history, 0, &found));
	assert_int_equal(found.repeats, UINT16_MAX);
}

/* Of another client, another request or result: another entry. */
static void only_the_same_refusal_is_a_repeat(void **state)
{
	static struct db_history history;
	const struct db_history_entry first = { .result = DB_RESULT_REFUSED, .real = 1.0f };
	struct db_history_entry others[] = {
		first, first, first, first, first, first, first, first
	};
	struct db_history_entry success = { .result = DB_RESULT_OK };
	uint32_t count = 0;

	(void)state;
	others[0].command = 1;
	others[1].command_id = 1;
	others[2].number = 1;
	others[3].position = 1;
	others[4].position_2 = 1;
	others[5].real = 0.5f;
	others[6].value = 1;
	others[7].address[15] = 1;
	for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
		assert_int_equal(db_history_add(&history, &first, false), ++count);
		assert_int_equal(db_history_add(&history, &others[i], false), ++count);
		assert_int_equal(db_history_add(&history, &others[i], false), count);
	}
	/* What went to the bus is what happened, each time. */
	assert_int_equal(db_history_add(&history, &first, true), ++count);
	assert_int_equal(db_history_add(&history, &first, true), ++count);
	assert_int_equal(db_history_add(&history, &first, false), ++count);
	/* And so is a success without it. */
	assert_int_equal(db_history_add(&history, &success, false), ++count);
	assert_int_equal(db_history_add(&history, &success, false), ++count);
}

/* Those of an earlier run, as they were. */
static void an_earlier_entry_is_recalled_whole(void **state)
{
	static struct db_history history;
	const struct db_history_entry entry = { .timestamp_us = 7,
		                                .sequence = 99,
		                                .command = DB_CMD_HOME,
		                                .result = DB_RESULT_FAILED,
		                                .duration_us = 8,
		                                .repeats = 9 };
	struct db_history_entry found;

	(void)state;
	db_history_recall(&history, &entry);
	db_history_recall(&history, &entry);
	for (size_t age = 0; age < 2; age++) {
		assert_true(db_history_get(&history, age, &found));
		assert_int_equal(found.sequence, 2 - age);
		assert_int_equal(found.timestamp_us, 7);
		assert_int_equal(found.command, DB_CMD_HOME);
		assert_int_equal(found.result, DB_RESULT_FAILED);
		assert_int_equal(found.duration_us, 8);
		assert_int_equal(found.repeats, 9);
	}
	assert_false(db_history_get(&history, 2, &found));
}

static struct db_history_entry args_of(enum db_command command, const struct db_args *args)
{
	struct db_history_entry entry = { .number = 0 };

	db_history_args(&entry, command, args);
	return entry;
}

/* Those that the command has, each in its place. */
static void arguments_are_kept_where_they_belong(void **state)
{
	const struct db_args args = {
		.target_position = 1,
		.target_velocity = 2.0f,
		.output_number = 3,
		.output_value = 4,
		.output_mask = 5,
		.output_levels = 6,
		.shake_start_position = 7,
		.shake_end_position = 8,
		.shake_frequency = 9.0f,
		.shake_cycles = 0x10000A,
		.shake_time = 0x10000B,
		.target_current = 12.0f,
		.program_number = 13,
		.program_delay = 14,
	};
	struct db_history_entry entry;

	(void)state;
	entry = args_of(DB_CMD_MOVE_ABSOLUTE, &args);
	assert_int_equal(entry.position, 1);
	assert_float_equal(entry.real, 2.0f, 0.0f);
	assert_int_equal(entry.number, 0);
	assert_int_equal(entry.value, 0);
	entry = args_of(DB_CMD_SET_OUTPUT, &args);
	assert_int_equal(entry.number, 3);
	assert_int_equal(entry.value, 4);
	assert_int_equal(entry.position, 0);
	entry = args_of(DB_CMD_SET_OUTPUTS, &args);
	assert_int_equal(entry.number, 5);
	assert_int_equal(entry.value, 6);
	entry = args_of(DB_CMD_SHAKE_START, &args);
	assert_int_equal(entry.position, 7);
	assert_int_equal(entry.position_2, 8);
	assert_float_equal(entry.real, 9.0f, 0.0f);
	assert_int_equal(entry.value, 0x10000A);
	entry = args_of(DB_CMD_SHAKE_START_TIME, &args);
	assert_int_equal(entry.value, 0x10000B);
	entry = args_of(DB_CMD_MOVE_CURRENT, &args);
	assert_float_equal(entry.real, 12.0f, 0.0f);
	entry = args_of(DB_CMD_START_PROGRAM, &args);
	assert_int_equal(entry.number, 13);
	assert_int_equal(entry.value, 14);
	entry = args_of(DB_CMD_STOP, &args);
	assert_int_equal(entry.number, 0);
	entry = args_of((enum db_command)63, &args);
	assert_int_equal(entry.number, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_entry_comes_back_as_it_was),
		cmocka_unit_test(numbers_wrap),
		cmocka_unit_test(repeats_are_counted_to_the_last),
		cmocka_unit_test(only_the_same_refusal_is_a_repeat),
		cmocka_unit_test(an_earlier_entry_is_recalled_whole),
		cmocka_unit_test(arguments_are_kept_where_they_belong),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
