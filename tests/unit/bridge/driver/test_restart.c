/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/restart.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define SECOND DB_NS_PER_S

static db_time now;

static enum restart_verdict see(struct restart *restart, int32_t position, bool stands)
{
	const struct restart_sample sample = { .position = position, .stands = stands };

	now += SECOND / 10;
	return restart_judge(restart, &sample, now);
}

/* One that stands at 5000, and was seen there. */
static struct restart standing(void)
{
	struct restart restart = { .known = false };

	now = 10 * SECOND;
	assert_int_equal(see(&restart, 5000, true), RESTART_NONE);
	assert_int_equal(see(&restart, 5000, true), RESTART_NONE);
	return restart;
}

static void test_one_sign_is_a_doubt(void **state)
{
	struct restart restart = standing();
	struct db_feedback feedback = { 0 };

	(void)state;
	assert_int_equal(see(&restart, 0, true), RESTART_DOUBT);
	assert_int_equal(see(&restart, 0, true), RESTART_NONE);
	restart_show(&restart, &feedback);
	assert_int_equal(feedback.doubt, DB_DOUBT_SIGN);
	assert_int_equal(feedback.doubts, 1);
	assert_int_equal(feedback.restarts, 0);
	assert_int_equal(feedback.status, 0);
	/* It was a wrong reading. */
	assert_int_equal(see(&restart, 5000, true), RESTART_NONE);
	assert_int_equal(restart.doubt, DB_DOUBT_NONE);
}

static void test_silence_is_the_second(void **state)
{
	struct restart restart = standing();
	struct db_feedback feedback = { 0 };

	(void)state;
	restart_note_away(&restart);
	assert_int_equal(see(&restart, 0, true), RESTART_SEEN);
	restart_show(&restart, &feedback);
	assert_int_equal(feedback.restarts, 1);
	assert_int_equal(feedback.status, DB_STATUS_ORIGIN_LOST);
	restart_note_placed(&restart, 0);
	assert_false(restart.origin_lost);
}

static void test_silence_alone_is_none(void **state)
{
	struct restart restart = standing();

	(void)state;
	restart_note_away(&restart);
	assert_int_equal(see(&restart, 5000, true), RESTART_NONE);
	/* It moved when it was heard last: it may have come to 0. */
	assert_int_equal(see(&restart, 4000, false), RESTART_NONE);
	restart_note_away(&restart);
	assert_int_equal(see(&restart, 0, true), RESTART_NONE);
	assert_int_equal(restart.doubts, 0);
}

static void test_power_is_the_second_before_and_after(void **state)
{
	for (unsigned late = 0; late < 2; late++) {
		struct restart restart = standing();
		struct restart_sample sample = { .position = late ? 0 : 5000,
			                         .stands = true,
			                         .power_went = true };

		(void)state;
		if (late)
			assert_int_equal(see(&restart, 0, true), RESTART_DOUBT);
		assert_int_equal(restart_judge(&restart, &sample, now + 1),
		                 late ? RESTART_SEEN : RESTART_NONE);
		if (!late)
			assert_int_equal(see(&restart, 0, true), RESTART_SEEN);
		assert_int_equal(restart.restarts, 1);
	}
}

static void test_another_axis_confirms_in_time(void **state)
{
	struct restart restart = standing();

	(void)state;
	assert_false(restart_confirm(&restart, now));
	assert_int_equal(see(&restart, 0, true), RESTART_DOUBT);
	assert_false(restart_confirm(&restart, now + 3 * SECOND));
	assert_true(restart_confirm(&restart, now + SECOND));
	assert_int_equal(restart.restarts, 1);
	assert_int_equal(restart.doubt, DB_DOUBT_NONE);
}

static void test_what_was_told_is_no_sign(void **state)
{
	struct restart restart = standing();

	(void)state;
	restart_note_command(&restart, DB_CMD_MOVE_ABSOLUTE, now);
	assert_int_equal(see(&restart, 0, true), RESTART_NONE);
	restart = standing();
	restart_note_command(&restart, DB_CMD_SET_POSITION, now);
	restart_note_placed(&restart, 0);
	assert_int_equal(see(&restart, 0, true), RESTART_NONE);
	restart = standing();
	restart_note_command(&restart, DB_CMD_ENABLE, now);
	assert_int_equal(see(&restart, 0, true), RESTART_DOUBT);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_one_sign_is_a_doubt),
		cmocka_unit_test(test_silence_is_the_second),
		cmocka_unit_test(test_silence_alone_is_none),
		cmocka_unit_test(test_power_is_the_second_before_and_after),
		cmocka_unit_test(test_another_axis_confirms_in_time),
		cmocka_unit_test(test_what_was_told_is_no_sign),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
