/* SPDX-License-Identifier: Apache-2.0 */
/* How classes share a wire: by their weights while several want it, and without saving up for later. */
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static const unsigned everything = (1U << DB_SHARE_COUNT) - 1;

/* What each class gets of so many exchanges that take this long, in thousandths of the time. */
static void share(unsigned waiting, const db_time *cost, unsigned *permille)
{
	struct shares shares = { 0 };
	db_time used[DB_SHARE_COUNT] = { 0 };
	db_time all = 0;

	for (unsigned n = 0; n < 20000; n++) {
		enum db_share chosen = shares_choose(&shares, waiting);

		assert_true(waiting & DB_SHARE_BIT(chosen));
		shares_charge(&shares, chosen, cost[chosen]);
		used[chosen] += cost[chosen];
		all += cost[chosen];
	}
	for (unsigned i = 0; i < DB_SHARE_COUNT; i++)
		permille[i] = (unsigned)(used[i] * 1000 / all);
}

static void classes_get_what_their_weights_say(void **state)
{
	static const db_time costs[][DB_SHARE_COUNT] = {
		{ MS, MS, MS, MS, MS },
		{ 5 * MS, 3 * MS, 2 * MS, 50 * MS, 30 * MS },
		{ MS / 2, 40 * MS, MS, 7 * MS, MS },
	};
	unsigned permille[DB_SHARE_COUNT];

	(void)state;
	for (size_t c = 0; c < sizeof costs / sizeof costs[0]; c++) {
		for (unsigned waiting = 1; waiting <= everything; waiting++) {
			share(waiting, costs[c], permille);
			for (unsigned i = 0; i < DB_SHARE_COUNT; i++) {
				double part = db_share_part((enum db_share)i, waiting) * 1000.0;

				if (!(waiting & DB_SHARE_BIT(i)))
					assert_int_equal(permille[i], 0);
				else
					assert_in_range(permille[i], (unsigned)(part * 0.98) - 1,
					                (unsigned)(part * 1.02) + 2);
			}
		}
	}
}

static void moving_drives_have_seventy_percent_beside_standing_ones(void **state)
{
	const unsigned both = DB_SHARE_BIT(DB_SHARE_MOVING) | DB_SHARE_BIT(DB_SHARE_STANDING);

	(void)state;
	assert_true(db_share_part(DB_SHARE_MOVING, both) == 0.7);
	assert_true(db_share_part(DB_SHARE_STANDING, both) == 0.3);
}

/* One that had nothing to send for a while goes first when it has, and before those after it in the list. */
static void a_class_with_something_new_goes_first(void **state)
{
	const unsigned standing = DB_SHARE_BIT(DB_SHARE_STANDING);
	struct shares shares = { 0 };

	(void)state;
	for (unsigned n = 0; n < 100; n++) {
		for (unsigned i = 0; i < 7; i++)
			shares_charge(&shares, shares_choose(&shares, standing), MS);
		assert_int_equal(shares_choose(&shares, standing | DB_SHARE_BIT(DB_SHARE_MOVING)),
		                 DB_SHARE_MOVING);
		shares_charge(&shares, DB_SHARE_MOVING, 3 * MS);
	}
}

/* It cannot save up: what it did not use is gone. */
static void nothing_is_owed_for_time_without_anything_to_send(void **state)
{
	const unsigned two = DB_SHARE_BIT(DB_SHARE_STANDING) | DB_SHARE_BIT(DB_SHARE_PARAMETERS);
	struct shares shares = { 0 };
	unsigned parameters = 0;

	(void)state;
	for (unsigned n = 0; n < 1000; n++)
		shares_charge(&shares, shares_choose(&shares, DB_SHARE_BIT(DB_SHARE_STANDING)), MS);
	for (unsigned n = 0; n < 9; n++) {
		enum db_share chosen = shares_choose(&shares, two);

		parameters += chosen == DB_SHARE_PARAMETERS;
		shares_charge(&shares, chosen, MS);
	}
	assert_int_equal(parameters, 3);
}

/* Time that a class was owed while it waited is not kept when it has nothing to send any more. */
static void a_class_with_nothing_to_send_is_owed_nothing(void **state)
{
	(void)state;
	for (unsigned i = 0; i < DB_SHARE_COUNT; i++) {
		const unsigned other = i == DB_SHARE_STANDING ? DB_SHARE_MOVING : DB_SHARE_STANDING;
		const unsigned both = DB_SHARE_BIT(i) | DB_SHARE_BIT(other);
		struct shares shares = { 0 };

		(void)shares_choose(&shares, both);
		shares_charge(&shares, (enum db_share)other, 100 * MS);
		assert_true(shares.owed[i] > 0);
		assert_int_equal(shares_choose(&shares, DB_SHARE_BIT(other)), other);
		assert_int_equal(shares.owed[i], 0);
		shares_charge(&shares, (enum db_share)other, MS);
		assert_int_equal(shares.owed[other], 0);
	}
}

/* The parameters are owed time; the commands, which are new, are owed nothing yet. */
static void a_class_with_something_new_goes_before_one_that_is_owed_time(void **state)
{
	const unsigned both = DB_SHARE_BIT(DB_SHARE_STANDING) | DB_SHARE_BIT(DB_SHARE_PARAMETERS);
	struct shares shares = { 0 };

	(void)state;
	assert_int_equal(shares_choose(&shares, both), DB_SHARE_STANDING);
	shares_charge(&shares, DB_SHARE_STANDING, 10 * MS);
	assert_int_equal(shares_choose(&shares, both), DB_SHARE_PARAMETERS);
	assert_int_equal(shares_choose(&shares, both | DB_SHARE_BIT(DB_SHARE_COMMANDS)),
	                 DB_SHARE_COMMANDS);
}

/* A late answer may be charged to a class that has already had more than its part. */
static void every_charge_counts_in_full(void **state)
{
	const unsigned both = DB_SHARE_BIT(DB_SHARE_MOVING) | DB_SHARE_BIT(DB_SHARE_STANDING);
	struct shares shares = { 0 };

	(void)state;
	(void)shares_choose(&shares, both);
	for (int n = 1; n <= 3; n++) {
		shares_charge(&shares, DB_SHARE_MOVING, 10 * MS);
		assert_int_equal(shares.owed[DB_SHARE_MOVING], -n * 3 * MS);
		assert_int_equal(shares.owed[DB_SHARE_STANDING], n * 3 * MS);
	}
}

/* A class that comes again and again cannot starve the others: what it had too much it pays back first. */
static void a_class_that_comes_and_goes_keeps_to_its_part(void **state)
{
	const unsigned standing = DB_SHARE_BIT(DB_SHARE_STANDING);
	const unsigned both = standing | DB_SHARE_BIT(DB_SHARE_COMMANDS);
	struct shares shares = { 0 };
	unsigned commands = 0;

	(void)state;
	for (unsigned n = 0; n < 10000; n++) {
		enum db_share chosen = shares_choose(&shares, both);

		commands += chosen == DB_SHARE_COMMANDS;
		shares_charge(&shares, chosen, MS);
		/* It is looked at while the next command has not come yet. */
		if (chosen == DB_SHARE_COMMANDS)
			(void)shares_choose(&shares, standing);
	}
	assert_in_range(commands, 7000, 7800);
}

static void what_a_stop_takes_is_charged_to_nobody(void **state)
{
	struct shares shares = { 0 };

	(void)state;
	(void)shares_choose(&shares, everything);
	shares_charge(&shares, DB_SHARE_NONE, 100 * MS);
	for (unsigned i = 0; i < DB_SHARE_COUNT; i++)
		assert_int_equal(shares.owed[i], 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(classes_get_what_their_weights_say),
		cmocka_unit_test(moving_drives_have_seventy_percent_beside_standing_ones),
		cmocka_unit_test(a_class_with_something_new_goes_first),
		cmocka_unit_test(nothing_is_owed_for_time_without_anything_to_send),
		cmocka_unit_test(a_class_with_nothing_to_send_is_owed_nothing),
		cmocka_unit_test(a_class_with_something_new_goes_before_one_that_is_owed_time),
		cmocka_unit_test(every_charge_counts_in_full),
		cmocka_unit_test(a_class_that_comes_and_goes_keeps_to_its_part),
		cmocka_unit_test(what_a_stop_takes_is_charged_to_nobody),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
