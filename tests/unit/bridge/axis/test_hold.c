/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static const struct db_client anna = { .id = 1 };
static const struct db_client bert = { .id = 2 };

static void begin(struct db_hold *hold, const struct db_client *client, uint16_t span_ms,
                  db_time now)
{
	struct db_request motion = { .client = *client, .hold_ms = span_ms };

	db_hold_begin(hold, &motion, now);
}

static void a_hold_lasts_from_beat_to_beat(void **state)
{
	struct db_hold hold = { .span = 0 };

	(void)state;
	assert_true(db_hold_deadline(&hold) == DB_TIME_NEVER);
	begin(&hold, &anna, 300, 1000 * MS);
	assert_true(db_hold_deadline(&hold) == 1300 * MS);
	assert_true(db_hold_beat(&hold, &anna, 1299 * MS, 1299 * MS));
	assert_true(db_hold_deadline(&hold) == 1599 * MS);
	db_hold_end(&hold);
	assert_true(db_hold_deadline(&hold) == DB_TIME_NEVER);
	assert_false(db_hold_beat(&hold, &anna, 1300 * MS, 1300 * MS));
}

static void only_its_holder_keeps_it_going(void **state)
{
	struct db_hold hold = { .span = 0 };

	(void)state;
	assert_false(db_hold_beat(&hold, &anna, 1000 * MS, 1000 * MS));
	assert_false(db_hold_beat(&hold, &(struct db_client){ .id = DB_CLIENT_NOBODY }, 0, 0));
	begin(&hold, &anna, 300, 1000 * MS);
	assert_false(db_hold_beat(&hold, &bert, 1200 * MS, 1200 * MS));
	assert_true(db_hold_deadline(&hold) == 1300 * MS);
	/* The other one takes it over with a motion of its own. */
	hold.begun = true;
	begin(&hold, &bert, 100, 1200 * MS);
	assert_true(hold.begun);
	assert_false(db_hold_beat(&hold, &anna, 1250 * MS, 1250 * MS));
	assert_true(db_hold_beat(&hold, &bert, 1250 * MS, 1250 * MS));
	assert_true(db_hold_deadline(&hold) == 1350 * MS);
}

/* The clock is looked at first: what waited while nobody served it is no sign of life. */
static void a_beat_that_is_served_late_is_none(void **state)
{
	struct db_hold hold = { .span = 0 };

	(void)state;
	begin(&hold, &anna, 300, 1000 * MS);
	assert_false(db_hold_beat(&hold, &anna, 1300 * MS, 1300 * MS));
	assert_false(db_hold_beat(&hold, &anna, 1100 * MS, 4000 * MS));
	assert_true(db_hold_deadline(&hold) == 1300 * MS);
}

/* It counts as of its arrival, and none takes anything back. */
static void a_beat_counts_from_its_arrival(void **state)
{
	struct db_hold hold = { .span = 0 };

	(void)state;
	begin(&hold, &anna, 300, 1000 * MS);
	assert_true(db_hold_beat(&hold, &anna, 1200 * MS, 1250 * MS));
	assert_true(db_hold_deadline(&hold) == 1500 * MS);
	assert_true(db_hold_beat(&hold, &anna, 1100 * MS, 1260 * MS));
	assert_true(db_hold_deadline(&hold) == 1500 * MS);
}

static void a_holder_that_goes_is_missed_at_once(void **state)
{
	struct db_hold hold = { .span = 0 };

	(void)state;
	begin(&hold, &anna, 300, 1000 * MS);
	db_hold_desert(&hold, &bert, 1050 * MS);
	assert_true(db_hold_deadline(&hold) == 1300 * MS);
	db_hold_desert(&hold, &anna, 1100 * MS);
	assert_true(db_hold_deadline(&hold) == 1100 * MS);
	assert_true(hold.deserted);
	/* No later than it was missed already. */
	db_hold_desert(&hold, &anna, 1200 * MS);
	assert_true(db_hold_deadline(&hold) == 1100 * MS);
	assert_false(db_hold_beat(&hold, &anna, 1100 * MS, 1100 * MS));
	db_hold_end(&hold);
	db_hold_desert(&hold, &anna, 1300 * MS);
	db_hold_desert(&hold, &(struct db_client){ .id = DB_CLIENT_NOBODY }, 1300 * MS);
	assert_true(db_hold_deadline(&hold) == DB_TIME_NEVER);
}

/* Registers: what an I/O scanner repeats by itself is no sign of life. */
static void a_counter_that_stands_is_no_beat(void **state)
{
	struct db_request motion = {
		.client = anna, .hold_ms = 300, .hold_beat = 7, .counted = true
	};
	struct db_hold hold = { .span = 0 };

	(void)state;
	assert_true(db_hold_may_begin(&hold, &motion));
	db_hold_begin(&hold, &motion, 1000 * MS);
	assert_false(db_hold_count(&hold, &anna, 7, 1100 * MS, 1100 * MS));
	db_hold_begin(&hold, &motion, 1100 * MS);
	assert_true(db_hold_deadline(&hold) == 1300 * MS);
	assert_true(db_hold_count(&hold, &anna, 8, 1200 * MS, 1200 * MS));
	assert_false(db_hold_count(&hold, &bert, 9, 1210 * MS, 1210 * MS));
	assert_false(db_hold_count(&hold, &anna, 8, 1220 * MS, 1220 * MS));
	assert_true(db_hold_deadline(&hold) == 1500 * MS);
	/* With the command itself. */
	motion.hold_beat = 9;
	db_hold_begin(&hold, &motion, 1300 * MS);
	assert_true(db_hold_deadline(&hold) == 1600 * MS);
	assert_false(db_hold_count(&hold, &anna, 10, 1600 * MS, 1600 * MS));
}

static void after_a_loss_the_counter_must_have_gone_on(void **state)
{
	struct db_request motion = {
		.client = anna, .hold_ms = 300, .hold_beat = 7, .counted = true
	};
	struct db_hold hold = { .span = 0 };

	(void)state;
	db_hold_begin(&hold, &motion, 1000 * MS);
	db_hold_end(&hold);
	assert_true(db_hold_may_begin(&hold, &motion));
	db_hold_begin(&hold, &motion, 2000 * MS);
	db_hold_end(&hold);
	hold.lost = true;
	assert_true(db_hold_deadline(&hold) == DB_TIME_NEVER);
	assert_false(db_hold_may_begin(&hold, &motion));
	/* A stop by somebody changes nothing of that. */
	db_hold_end(&hold);
	assert_false(db_hold_may_begin(&hold, &motion));
	assert_true(
		db_hold_may_begin(&hold, &(struct db_request){ .hold_ms = 300, .hold_beat = 7 }));
	motion.hold_beat = 8;
	assert_true(db_hold_may_begin(&hold, &motion));
	db_hold_begin(&hold, &motion, 3000 * MS);
	assert_true(db_hold_may_begin(&hold, &motion));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_hold_lasts_from_beat_to_beat),
		cmocka_unit_test(only_its_holder_keeps_it_going),
		cmocka_unit_test(a_beat_that_is_served_late_is_none),
		cmocka_unit_test(a_beat_counts_from_its_arrival),
		cmocka_unit_test(a_holder_that_goes_is_missed_at_once),
		cmocka_unit_test(a_counter_that_stands_is_no_beat),
		cmocka_unit_test(after_a_loss_the_counter_must_have_gone_on),
	};

	return cmocka_run_group_tests_name("axis/hold", tests, NULL, NULL);
}
