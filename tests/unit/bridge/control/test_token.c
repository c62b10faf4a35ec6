/* SPDX-License-Identifier: Apache-2.0 */
#include "control/token.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define RUN UINT32_C(0x8f3a2c71)

static void a_token_gets_older(void **state)
{
	char text[DB_TOKEN_MAX];

	(void)state;
	db_token_write(text, RUN, 123456 * MS + 7);
	assert_string_equal(text, "8f3a2c71-123456");
	assert_int_equal(db_token_age_ms(text, RUN, 123456 * MS + 7), 0);
	assert_int_equal(db_token_age_ms(text, RUN, 123956 * MS), 500);
	assert_int_equal(db_token_age_ms(text, RUN, 1123456 * MS), 1000000);
}

static void a_run_with_a_small_number_has_as_many_digits(void **state)
{
	char text[DB_TOKEN_MAX];

	(void)state;
	db_token_write(text, 0x2a, 5 * MS);
	assert_string_equal(text, "0000002a-5");
	assert_int_equal(db_token_age_ms(text, 0x2a, 6 * MS), 1);
}

static void the_longest_one_fits(void **state)
{
	char text[DB_TOKEN_MAX];

	(void)state;
	db_token_write(text, UINT32_MAX, INT64_MAX);
	assert_int_equal(db_token_age_ms(text, UINT32_MAX, INT64_MAX), 0);
}

static void of_other_texts_the_age_is_not_known(void **state)
{
	static const char *const wrong[] = {
		"",
		"8f3a2c71",
		"8f3a2c71-",
		"8f3a2c70-1000",
		"8F3A2C71-1000",
		"8f3a2c71-1000 ",
		"8f3a2c71- 1000",
		"8f3a2c71-+1000",
		"8f3a2c71--1",
		"8f3a2c71-0x10",
		"8f3a2c71-1000000000000000000",
		"8f3a2c71-99999999999999999999999999",
		"8f3a2c71-1001", /* of the future */
		"1000",
		"-1000",
	};

	(void)state;
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
		assert_int_equal(db_token_age_ms(wrong[i], RUN, 1000 * MS), DB_TOKEN_UNKNOWN);
	assert_int_equal(db_token_age_ms("8f3a2c71-1000", RUN, 1000 * MS), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_token_gets_older),
		cmocka_unit_test(a_run_with_a_small_number_has_as_many_digits),
		cmocka_unit_test(the_longest_one_fits),
		cmocka_unit_test(of_other_texts_the_age_is_not_known),
	};

	return cmocka_run_group_tests_name("control/token", tests, NULL, NULL);
}
