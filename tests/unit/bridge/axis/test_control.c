/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/control.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define START (1000 * MS)

static const struct db_client plc = { .id = 1, .address = { [15] = 1 }, .may_write = true };
static const struct db_client plc_again = { .id = 2, .address = { [15] = 1 }, .may_write = true };
static const struct db_client hmi = { .id = 3, .address = { [15] = 2 }, .may_write = true };

static void off(void **state)
{
	struct db_control control;

	(void)state;
	db_control_init(&control, false, 5000);
	assert_true(db_control_holds(&control, &plc, START));
	assert_true(db_control_take(&control, &plc, START));
	assert_true(db_control_take(&control, &hmi, START));
	assert_null(db_control_holder(&control, START));
	assert_int_equal(db_control_remaining_ms(&control, START), 0);
}

static void the_first_writer_takes_it(void **state)
{
	struct db_control control;

	(void)state;
	db_control_init(&control, true, 5000);
	assert_null(db_control_holder(&control, START));
	assert_false(db_control_holds(&control, &plc, START));
	assert_true(db_control_take(&control, &plc, START));
	assert_true(db_control_take(&control, &plc, START));
	assert_int_equal(db_control_holder(&control, START)->id, plc.id);
	assert_false(db_control_take(&control, &hmi, START));
	assert_false(db_control_request(&control, &hmi, START));
	assert_false(db_control_holds(&control, &hmi, START));
	db_control_release(&control, &hmi);
	assert_true(db_control_holds(&control, &plc, START));
	db_control_release(&control, &plc);
	assert_null(db_control_holder(&control, START));
	assert_true(db_control_take(&control, &hmi, START));
}

static void silence_ends_it(void **state)
{
	struct db_control control;

	(void)state;
	db_control_init(&control, true, 5000);
	assert_true(db_control_take(&control, &plc, START));
	assert_int_equal(db_control_remaining_ms(&control, START), 5000);
	assert_int_equal(db_control_remaining_ms(&control, START + 1), 5000);
	db_control_hear(&control, &plc, START + 4999 * MS, START + 4999 * MS);
	/* Somebody else's requests do not count. */
	db_control_hear(&control, &hmi, START + 9000 * MS, START + 9000 * MS);
	assert_int_equal(db_control_remaining_ms(&control, START + 9998 * MS), 1);
	assert_true(db_control_holds(&control, &plc, START + 9998 * MS));
	assert_false(db_control_holds(&control, &plc, START + 9999 * MS));
	assert_int_equal(db_control_remaining_ms(&control, START + 9999 * MS), 0);
	/* It does not come back by itself. */
	db_control_hear(&control, &plc, START + 10000 * MS, START + 10000 * MS);
	assert_null(db_control_holder(&control, START + 10000 * MS));
	assert_true(db_control_take(&control, &hmi, START + 10000 * MS));
	assert_false(db_control_take(&control, &plc, START + 10000 * MS));
}

static void the_same_address_may_ask_again(void **state)
{
	struct db_control control;

	(void)state;
	db_control_init(&control, true, 5000);
	assert_true(db_control_take(&control, &plc, START));
	assert_false(db_control_take(&control, &plc_again, START + MS));
	assert_true(db_control_request(&control, &plc_again, START + MS));
	assert_false(db_control_holds(&control, &plc, START + MS));
	/* The end of the old connection is nothing to the new one. */
	db_control_release(&control, &plc);
	assert_true(db_control_holds(&control, &plc_again, START + MS));
}

/* Another configuration: who has control keeps it, as long as there is such a thing. */
static void a_reload_leaves_it_where_it_is(void **state)
{
	struct db_control control;

	(void)state;
	db_control_init(&control, true, 5000);
	assert_true(db_control_take(&control, &plc, START));
	db_control_change(&control, true, 7000);
	assert_int_equal(db_control_remaining_ms(&control, START), 7000);
	assert_true(db_control_holds(&control, &plc, START));
	assert_false(db_control_holds(&control, &hmi, START));
	db_control_change(&control, false, 7000);
	assert_null(db_control_holder(&control, START));
	assert_true(db_control_holds(&control, &hmi, START));
	db_control_change(&control, true, 7000);
	assert_null(db_control_holder(&control, START));
	assert_true(db_control_take(&control, &hmi, START));
}

/* What waited in a buffer tells of the time before. */
static void older_requests_take_nothing_back(void **state)
{
	struct db_control control;

	(void)state;
	db_control_init(&control, true, 5000);
	assert_true(db_control_take(&control, &plc, START));
	db_control_hear(&control, &plc, START - 3000 * MS, START + MS);
	assert_int_equal(db_control_remaining_ms(&control, START), 5000);
	db_control_hear(&control, &plc, START + 1000 * MS, START + 4000 * MS);
	assert_int_equal(db_control_remaining_ms(&control, START + 4000 * MS), 2000);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(off),
		cmocka_unit_test(the_first_writer_takes_it),
		cmocka_unit_test(silence_ends_it),
		cmocka_unit_test(the_same_address_may_ask_again),
		cmocka_unit_test(a_reload_leaves_it_where_it_is),
		cmocka_unit_test(older_requests_take_nothing_back),
	};

	return cmocka_run_group_tests_name("axis/control", tests, NULL, NULL);
}
