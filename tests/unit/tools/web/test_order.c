/* SPDX-License-Identifier: Apache-2.0 */
#include "web/order.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

static void test_each_is_carried_out_once_in_any_order(void **state)
{
	static const uint64_t numbers[] = { 1, 3, 2, 4, 70, 68, 69, 10 };
	struct db_web_order order = { .highest = 0 };

	(void)state;
	for (size_t i = 0; i < sizeof(numbers) / sizeof(numbers[0]); i++)
		assert_int_equal(db_web_order_take(&order, numbers[i]), DB_WEB_TURN_NOW);
	for (size_t i = 0; i < sizeof(numbers) / sizeof(numbers[0]); i++)
		assert_int_equal(db_web_order_take(&order, numbers[i]), DB_WEB_TURN_REPEATED);
}

static void test_what_is_far_behind_may_have_come(void **state)
{
	struct db_web_order order = { .highest = 0 };

	(void)state;
	assert_int_equal(db_web_order_take(&order, 1), DB_WEB_TURN_NOW);
	assert_int_equal(db_web_order_take(&order, 1000), DB_WEB_TURN_NOW);
	assert_int_equal(db_web_order_take(&order, 1000 - DB_WEB_ORDER_WINDOW + 1),
	                 DB_WEB_TURN_NOW);
	assert_int_equal(db_web_order_take(&order, 1000 - DB_WEB_ORDER_WINDOW),
	                 DB_WEB_TURN_REPEATED);
	assert_int_equal(db_web_order_take(&order, 1000), DB_WEB_TURN_REPEATED);
}

static void test_nothing_comes_behind_a_stop_that_was_pressed_later(void **state)
{
	struct db_web_order order = { .highest = 0 };

	(void)state;
	assert_int_equal(db_web_order_take(&order, 1), DB_WEB_TURN_NOW);
	db_web_order_stop(&order, 4);
	assert_int_equal(db_web_order_take(&order, 2), DB_WEB_TURN_OVERTAKEN);
	assert_int_equal(db_web_order_take(&order, 3), DB_WEB_TURN_OVERTAKEN);
	assert_int_equal(db_web_order_take(&order, 3), DB_WEB_TURN_REPEATED);
	assert_int_equal(db_web_order_take(&order, 5), DB_WEB_TURN_NOW);
	/* An older stop that comes late takes nothing back, nor does one without a number. */
	db_web_order_stop(&order, 2);
	db_web_order_stop(&order, 0);
	assert_true(db_web_order_is_overtaken(&order, 3));
	assert_false(db_web_order_is_overtaken(&order, 5));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_each_is_carried_out_once_in_any_order),
		cmocka_unit_test(test_what_is_far_behind_may_have_come),
		cmocka_unit_test(test_nothing_comes_behind_a_stop_that_was_pressed_later),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
