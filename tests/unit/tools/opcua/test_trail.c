/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/trail.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* A trail with a record each second, number 1 at second 1; of drive a those with even numbers. */
#define RECORDS 1500
#define PER_PAGE 100
#define SECOND 1000000

static int64_t time_of(int64_t number)
{
	return number * SECOND;
}

/* As the service answers: the next lines, of which the wanted ones are records. */
static json_t *answer_of(const json_t *question, int64_t count)
{
	int64_t from = json_integer_value(json_object_get(question, "from"));
	int64_t since_us = json_integer_value(json_object_get(question, "since_us"));
	const char *drive = json_string_value(json_object_get(question, "drive"));
	int64_t number = from > 0 ? from : 1;
	json_t *records = json_array();

	for (int i = 0; i < PER_PAGE && number <= count; i++, number++) {
		if (time_of(number) < since_us || (drive && strcmp(drive, "a") == 0 && number % 2))
			continue;
		assert_int_equal(
			json_array_append_new(records,
		                              json_pack("{s:I, s:I}", "number", (json_int_t)number,
		                                        "time_us", (json_int_t)time_of(number))),
			0);
	}
	return json_pack("{s:o, s:I, s:b, s:{s:I, s:b}}", "records", records, "next",
	                 (json_int_t)number, "over", number > count, "trail", "newest",
	                 (json_int_t)count, "kept", 1);
}

/* Carries the search out, and returns the number of questions. */
static unsigned search(struct db_opcua_trail *trail, const struct db_opcua_trail_query *query,
                       int64_t count)
{
	unsigned questions = 0;
	bool over = false;

	assert_true(db_opcua_trail_begin(trail, query));
	while (!over) {
		json_t *question = db_opcua_trail_question(trail);
		json_t *answer = answer_of(question, count);

		over = db_opcua_trail_take(trail, answer);
		json_decref(question);
		json_decref(answer);
		assert_true(++questions < 100);
		/* However long the trail is. */
		assert_true(json_array_size(trail->window) <= DB_OPCUA_TRAIL_PAGE);
	}
	return questions;
}

static int64_t number_at(const struct db_opcua_trail *trail, size_t place)
{
	return json_integer_value(json_object_get(json_array_get(trail->found, place), "number"));
}

/* All pages of a query have the numbers from `first` to `last`, in this direction. */
static void assert_numbers(struct db_opcua_trail_query query, int64_t first, int64_t last, int step)
{
	int64_t next = first;

	do {
		struct db_opcua_trail trail;

		(void)search(&trail, &query, RECORDS);
		assert_true(json_array_size(trail.found) <= DB_OPCUA_TRAIL_PAGE);
		for (size_t i = 0; i < json_array_size(trail.found); i++, next += step)
			assert_int_equal(number_at(&trail, i), next);
		query.after = trail.after;
		db_opcua_trail_clear(&trail);
	} while (query.after != 0);
	assert_int_equal(next, last + step);
}

static void test_forward(void **state)
{
	(void)state;
	assert_numbers((struct db_opcua_trail_query){ .start_us = 1, .end_us = time_of(9999) }, 1,
	               RECORDS, 1);
	/* The first bound is in the range, the last one is not. */
	assert_numbers(
		(struct db_opcua_trail_query){ .start_us = time_of(700), .end_us = time_of(905) },
		700, 904, 1);
	assert_numbers((struct db_opcua_trail_query){ .start_us = 1, .most = 7 }, 1, RECORDS, 1);
	assert_numbers((struct db_opcua_trail_query){ .drive = "a",
	                                              .start_us = time_of(3),
	                                              .end_us = time_of(300) },
	               4, 298, 2);
}

static void test_backward(void **state)
{
	(void)state;
	assert_numbers((struct db_opcua_trail_query){ .start_us = time_of(9999), .end_us = 1 },
	               RECORDS, 1, -1);
	assert_numbers(
		(struct db_opcua_trail_query){ .start_us = time_of(905), .end_us = time_of(700) },
		905, 701, -1);
	/* The latest ones, without a last bound. */
	assert_numbers((struct db_opcua_trail_query){ .end_us = time_of(9999), .most = 60 },
	               RECORDS, 1, -1);
	assert_numbers((struct db_opcua_trail_query){ .drive = "a",
	                                              .start_us = time_of(300),
	                                              .end_us = time_of(3) },
	               300, 4, -2);
}

/* The latest ones are found without reading all. */
static void test_the_latest_ones_take_few_questions(void **state)
{
	struct db_opcua_trail_query query = { .end_us = time_of(99999), .most = 10 };
	struct db_opcua_trail trail;

	(void)state;
	query.after = RECORDS + 1;
	assert_true(search(&trail, &query, RECORDS) <= 3);
	assert_int_equal(json_array_size(trail.found), 10);
	assert_int_equal(trail.after, RECORDS - 9);
	db_opcua_trail_clear(&trail);
}

static void test_nothing_is_there(void **state)
{
	struct db_opcua_trail_query query = { .start_us = time_of(9999), .end_us = time_of(99999) };
	struct db_opcua_trail trail;

	(void)state;
	for (int i = 0; i < 2; i++) {
		(void)search(&trail, &query, RECORDS);
		assert_int_equal(json_array_size(trail.found), 0);
		assert_int_equal(trail.after, 0);
		db_opcua_trail_clear(&trail);
		(void)search(&trail, &query, 0);
		assert_int_equal(json_array_size(trail.found), 0);
		db_opcua_trail_clear(&trail);
		query = (struct db_opcua_trail_query){ .start_us = time_of(3),
			                               .end_us = time_of(3) };
	}
	query = (struct db_opcua_trail_query){ .end_us = 5, .most = 3 };
	(void)search(&trail, &query, RECORDS);
	assert_int_equal(json_array_size(trail.found), 0);
	db_opcua_trail_clear(&trail);
}

static void test_a_service_without_files_has_no_past(void **state)
{
	struct db_opcua_trail_query query = { .start_us = 1, .most = 3 };
	json_t *answer = json_pack("{s:[], s:i, s:b, s:{s:b}}", "records", "next", 1, "over", 0,
	                           "trail", "kept", 0);
	struct db_opcua_trail trail;

	(void)state;
	assert_true(db_opcua_trail_begin(&trail, &query));
	assert_true(db_opcua_trail_take(&trail, answer));
	assert_false(trail.kept);
	db_opcua_trail_clear(&trail);
	json_decref(answer);
}

/* Later times than the service takes. */
static void test_the_end_of_time(void **state)
{
	struct db_opcua_trail_query query = { .start_us = INT64_C(253402300799000000),
		                              .end_us = 1 };
	struct db_opcua_trail trail;
	json_t *question;

	(void)state;
	assert_true(db_opcua_trail_begin(&trail, &query));
	question = db_opcua_trail_question(&trail);
	assert_true(json_integer_value(json_object_get(question, "since_us")) <=
	            INT64_C(9007199254740992));
	json_decref(question);
	db_opcua_trail_clear(&trail);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_forward),
		cmocka_unit_test(test_backward),
		cmocka_unit_test(test_the_latest_ones_take_few_questions),
		cmocka_unit_test(test_nothing_is_there),
		cmocka_unit_test(test_a_service_without_files_has_no_past),
		cmocka_unit_test(test_the_end_of_time),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
