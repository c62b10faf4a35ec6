/* SPDX-License-Identifier: Apache-2.0 */
#include "web/tokens.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static void add(struct db_web_tokens *tokens, unsigned number, db_time now)
{
	char text[DB_WEB_TOKEN_MAX];

	(void)snprintf(text, sizeof(text), "run-%u", number);
	db_web_tokens_add(tokens, text, now);
}

static void test_each_has_its_age(void **state)
{
	struct db_web_tokens tokens = { .count = 0 };

	(void)state;
	assert_true(db_web_tokens_age(&tokens, "run-0", 0) == DB_TIME_NEVER);
	for (unsigned i = 0; i < 3 * DB_WEB_TOKENS_KEPT; i++) {
		add(&tokens, i, (db_time)i * 100 * MS);
		assert_true(db_web_tokens_age(&tokens, "run-0", (db_time)i * 100 * MS) ==
		            (i < DB_WEB_TOKENS_KEPT ? (db_time)i * 100 * MS : DB_TIME_NEVER));
	}
	assert_true(db_web_tokens_age(&tokens, "run-295", 30000 * MS) == 500 * MS);
	assert_true(db_web_tokens_age(&tokens, "run-299", 30000 * MS) == 100 * MS);
}

static void test_what_is_none_is_as_old_as_can_be(void **state)
{
	struct db_web_tokens tokens = { .count = 0 };
	char longer[DB_WEB_TOKEN_MAX + 8];

	(void)state;
	add(&tokens, 1, 0);
	(void)snprintf(longer, sizeof(longer), "%0*d", (int)sizeof(longer) - 1, 1);
	db_web_tokens_add(&tokens, longer, 0);
	assert_int_equal(tokens.count, 1);
	assert_true(db_web_tokens_age(&tokens, longer, 0) == DB_TIME_NEVER);
	assert_true(db_web_tokens_age(&tokens, "run-10", 0) == DB_TIME_NEVER);
	assert_true(db_web_tokens_age(&tokens, "", 0) == DB_TIME_NEVER);
	assert_true(db_web_tokens_age(&tokens, NULL, 0) == DB_TIME_NEVER);
}

static void test_says_how_late(void **state)
{
	char text[DB_WEB_LATE_TEXT];

	(void)state;
	db_web_tokens_write_late(text, 2040 * MS);
	assert_string_equal(text, "came 2.0 s late and was not carried out");
	db_web_tokens_write_late(text, DB_TIME_NEVER);
	assert_string_equal(text, "came too late and was not carried out");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_each_has_its_age),
		cmocka_unit_test(test_what_is_none_is_as_old_as_can_be),
		cmocka_unit_test(test_says_how_late),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
