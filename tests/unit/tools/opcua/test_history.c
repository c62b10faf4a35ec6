/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/history.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

/* Values at 10, 20 ... 50; that at 30 does not have the field. */
static json_t *make_values(void)
{
	json_t *values = json_array();

	for (int us = 10; us <= 50; us += 10)
		json_array_append_new(
			values, us == 30 ?
					json_pack("{s:i, s:n}", "end_us", us, "hottest") :
					json_pack("{s:i, s:i}", "end_us", us, "hottest", us + 1));
	return values;
}

/* The times of all answers, one after the other; ? before one where nothing is. */
static void read_all(struct db_opcua_history_query query, char *text)
{
	static struct db_opcua_history_page page;
	json_t *values = make_values();

	text[0] = '\0';
	do {
		db_opcua_history_pick(&query, values, "hottest", &page);
		for (size_t i = 0; i < page.count; i++) {
			const struct db_opcua_history_value *value = &page.list[i];

			if (!value->missing)
				assert_true(value->number == (double)(value->us + 1));
			(void)sprintf(text + strlen(text), "%s%d ", value->missing ? "?" : "",
			              (int)value->us);
		}
		if (page.after_us != 0)
			strcat(text, "| ");
		query.after_us = page.after_us;
	} while (query.after_us != 0);
	json_decref(values);
}

static void test_what_is_picked(void **state)
{
	static const struct {
		struct db_opcua_history_query query;
		const char *times;
	} cases[] = {
		/* The start belongs to it, the end does not. */
		{ { .start_us = 10, .end_us = 50 }, "10 20 40 " },
		{ { .start_us = 11, .end_us = 51 }, "20 40 50 " },
		{ { .start_us = 50, .end_us = 10 }, "50 40 20 " },
		{ { .start_us = 60, .end_us = 70 }, "" },
		/* So many at a time. */
		{ { .start_us = 10, .end_us = 51, .most = 3 }, "10 20 40 | 50 " },
		{ { .start_us = 10, .end_us = 51, .most = 4 }, "10 20 40 50 " },
		{ { .start_us = 51, .end_us = 5, .most = 1 }, "50 | 40 | 20 | 10 " },
		/* One end is open. */
		{ { .start_us = 15, .most = 2 }, "20 40 | 50 " },
		{ { .end_us = 45, .most = 2 }, "40 20 | 10 " },
		/* With what is next to the bounds. */
		{ { .start_us = 15, .end_us = 45, .bounds = true }, "10 20 40 50 " },
		{ { .start_us = 20, .end_us = 40, .bounds = true }, "20 40 " },
		{ { .start_us = 45, .end_us = 15, .bounds = true }, "50 40 20 10 " },
		{ { .start_us = 5, .end_us = 60, .bounds = true }, "?5 10 20 40 50 ?60 " },
		{ { .start_us = 60, .end_us = 70, .bounds = true }, "50 ?70 " },
		{ { .start_us = 1, .end_us = 2, .bounds = true }, "?1 10 " },
		{ { .start_us = 15, .end_us = 45, .bounds = true, .most = 2 }, "10 20 | 40 50 " },
	};
	char text[200];

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		read_all(cases[i].query, text);
		assert_string_equal(text, cases[i].times);
	}
}

static void test_two_of_three_are_needed(void **state)
{
	(void)state;
	assert_true(db_opcua_history_is_valid(
		&(struct db_opcua_history_query){ .start_us = 1, .end_us = 2 }));
	assert_true(db_opcua_history_is_valid(
		&(struct db_opcua_history_query){ .end_us = 2, .most = 1 }));
	assert_false(db_opcua_history_is_valid(&(struct db_opcua_history_query){ .start_us = 1 }));
	assert_false(db_opcua_history_is_valid(&(struct db_opcua_history_query){ .most = 1 }));
}

static void test_since_when(void **state)
{
	(void)state;
	assert_int_equal(db_opcua_history_since(
				 &(struct db_opcua_history_query){ .start_us = 3, .end_us = 9 }),
	                 2);
	assert_int_equal(db_opcua_history_since(
				 &(struct db_opcua_history_query){ .start_us = 9, .end_us = 3 }),
	                 2);
	assert_int_equal(
		db_opcua_history_since(&(struct db_opcua_history_query){ .end_us = 9, .most = 1 }),
		0);
}

static void test_what_is_kept(void **state)
{
	(void)state;
	assert_string_equal(db_opcua_history_field("temperature"), "hottest");
	assert_null(db_opcua_history_field("position"));
	assert_null(db_opcua_history_field("retries"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_is_picked),
		cmocka_unit_test(test_two_of_three_are_needed),
		cmocka_unit_test(test_since_when),
		cmocka_unit_test(test_what_is_kept),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
