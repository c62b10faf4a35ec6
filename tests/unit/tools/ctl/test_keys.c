/* SPDX-License-Identifier: Apache-2.0 */
/* Keys of a terminal, and what holding them means for a drive. */
#include "ctl/hold.h"
#include "ctl/terminal.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static void test_a_key_that_stays_away_is_released(void **state)
{
	struct db_ctl_hold hold = { .direction = 0 };
	db_time now = 0;

	(void)state;
	assert_int_equal(db_ctl_hold_direction(&hold, now), 0);
	db_ctl_hold_press(&hold, 1, now);
	assert_int_equal(db_ctl_hold_direction(&hold, now + 249 * MS), 1);
	/* Repeated, it goes on for as long as it is. */
	for (; now < 5000 * MS; now += 33 * MS) {
		db_ctl_hold_press(&hold, 1, now);
		assert_int_equal(db_ctl_hold_direction(&hold, now), 1);
	}
	assert_int_equal(db_ctl_hold_direction(&hold, now + 300 * MS), 0);
	/* And pressed again it moves again. */
	db_ctl_hold_press(&hold, -1, now + 400 * MS);
	assert_int_equal(db_ctl_hold_direction(&hold, now + 400 * MS), -1);
}

static void test_the_other_direction_stops_first(void **state)
{
	struct db_ctl_hold hold = { .direction = 0 };

	(void)state;
	db_ctl_hold_press(&hold, 1, 0);
	db_ctl_hold_press(&hold, -1, 50 * MS);
	assert_int_equal(db_ctl_hold_direction(&hold, 50 * MS), 0);
	/* Held on, it does not begin by itself. */
	db_ctl_hold_press(&hold, -1, 100 * MS);
	assert_int_equal(db_ctl_hold_direction(&hold, 100 * MS), 0);
	db_ctl_hold_press(&hold, -1, 400 * MS);
	assert_int_equal(db_ctl_hold_direction(&hold, 400 * MS), -1);
}

static void test_what_was_refused_is_not_tried_before_the_release(void **state)
{
	struct db_ctl_hold hold = { .direction = 0 };

	(void)state;
	db_ctl_hold_cancel(&hold);
	db_ctl_hold_press(&hold, 1, 0);
	assert_int_equal(db_ctl_hold_direction(&hold, 0), 1);
	db_ctl_hold_cancel(&hold);
	assert_int_equal(db_ctl_hold_direction(&hold, 10 * MS), 0);
	db_ctl_hold_press(&hold, 1, 100 * MS);
	assert_int_equal(db_ctl_hold_direction(&hold, 100 * MS), 0);
	assert_int_equal(db_ctl_hold_direction(&hold, 351 * MS), 0);
	db_ctl_hold_press(&hold, 1, 360 * MS);
	assert_int_equal(db_ctl_hold_direction(&hold, 360 * MS), 1);
}

static void expect_keys(const char *bytes, const enum db_ctl_key *keys, size_t count)
{
	size_t at = 0;

	for (size_t i = 0; i < count; i++)
		assert_int_equal(db_ctl_terminal_next_key(bytes, strlen(bytes), &at), keys[i]);
	assert_int_equal(db_ctl_terminal_next_key(bytes, strlen(bytes), &at), DB_CTL_KEY_NONE);
}

static void test_arrows_come_in_two_forms_and_with_modifiers(void **state)
{
	static const enum db_ctl_key keys[] = { DB_CTL_KEY_FORWARD,  DB_CTL_KEY_FORWARD,
		                                DB_CTL_KEY_BACKWARD, DB_CTL_KEY_BACKWARD,
		                                DB_CTL_KEY_FORWARD,  DB_CTL_KEY_OTHER };

	(void)state;
	expect_keys("\033[A\033OC\033[B\033OD\033[1;5C\033[6~", keys, 6);
}

static void test_who_wants_out_gets_out(void **state)
{
	static const char *const ways[] = { "q", "Q", "\003", "\004", "\x1c", "\x1a", "\033" };
	static const enum db_ctl_key quit[] = { DB_CTL_KEY_QUIT };
	static const enum db_ctl_key others[] = { DB_CTL_KEY_OTHER, DB_CTL_KEY_OTHER };

	(void)state;
	for (size_t i = 0; i < sizeof(ways) / sizeof(ways[0]); i++)
		expect_keys(ways[i], quit, 1);
	expect_keys(" x", others, 2);
	/* Half of a sequence ends it too. */
	{
		size_t at = 0;

		assert_int_equal(db_ctl_terminal_next_key("\033[", 2, &at), DB_CTL_KEY_QUIT);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_key_that_stays_away_is_released),
		cmocka_unit_test(test_the_other_direction_stops_first),
		cmocka_unit_test(test_what_was_refused_is_not_tried_before_the_release),
		cmocka_unit_test(test_arrows_come_in_two_forms_and_with_modifiers),
		cmocka_unit_test(test_who_wants_out_gets_out),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
