/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/doubled.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

/* A machine has run for a while. */
#define BEGIN (1000 * DB_NS_PER_S)

static enum doubled_kind take(struct doubled *doubled, uint32_t part, uint8_t content, bool asked,
                              db_time now)
{
	return doubled_judge(doubled, part, &content, 1, asked, BEGIN + now);
}

/* A question, and an answer of each of two drives. */
static enum doubled_kind ask_two(struct doubled *doubled, uint8_t one, uint8_t other, db_time now)
{
	doubled->seen_count = 0;
	assert_int_equal(take(doubled, 1, one, true, now), DOUBLED_NOT);
	return take(doubled, 1, other, false, now + MS);
}

static void a_frame_that_came_twice_shows_nothing(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	for (unsigned i = 1; i < 9; i++)
		assert_int_equal(ask_two(&doubled, 5, 5, i * 20 * MS), DOUBLED_SAME);
	assert_int_equal(doubled.until, 0);
}

static void one_other_answer_may_be_chance_and_two_are_two_drives(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	assert_int_equal(ask_two(&doubled, 5, 6, 20 * MS), DOUBLED_OTHER);
	assert_int_equal(doubled.until, 0);
	assert_int_equal(ask_two(&doubled, 5, 6, 40 * MS), DOUBLED_TWO);
	assert_int_equal(doubled.until, BEGIN + 41 * MS + DOUBLED_TIME);
	/* It is news once. */
	assert_int_equal(ask_two(&doubled, 6, 5, 60 * MS), DOUBLED_OTHER);
	assert_int_equal(doubled.until, BEGIN + 61 * MS + DOUBLED_TIME);
}

static void chance_is_forgotten(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	assert_int_equal(ask_two(&doubled, 5, 6, 20 * MS), DOUBLED_OTHER);
	assert_int_equal(ask_two(&doubled, 5, 6, 20 * MS + DOUBLED_TIME), DOUBLED_OTHER);
	assert_int_equal(doubled.until, 0);
	assert_int_equal(ask_two(&doubled, 5, 6, 20 * MS + 2 * DOUBLED_TIME - 1), DOUBLED_TWO);
}

static void two_drives_are_forgotten(void **state)
{
	struct doubled doubled = { 0 };
	db_time until;

	(void)state;
	(void)ask_two(&doubled, 5, 6, 20 * MS);
	assert_int_equal(ask_two(&doubled, 5, 6, 40 * MS), DOUBLED_TWO);
	until = doubled.until;
	/* Its time is over: what comes then is chance again, and a copy may be one. */
	assert_int_equal(ask_two(&doubled, 5, 6, until - BEGIN - MS), DOUBLED_OTHER);
	assert_int_equal(doubled.until, until);
	doubled.seen_count = 0;
	assert_int_equal(take(&doubled, 1, 6, true, until - BEGIN), DOUBLED_NOT);
	assert_int_equal(take(&doubled, 1, 7, false, until - BEGIN), DOUBLED_NOT);
}

static void a_machine_that_has_just_started_is_like_any_other(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	for (unsigned i = 1; i < 3; i++) {
		doubled.seen_count = 0;
		assert_int_equal(doubled_judge(&doubled, 1, (const uint8_t *)"a", 1, true, i * MS),
		                 DOUBLED_NOT);
		assert_int_equal(doubled_judge(&doubled, 1, (const uint8_t *)"b", 1, false, i * MS),
		                 i == 1 ? DOUBLED_OTHER : DOUBLED_TWO);
	}
}

/* Of a frame every byte counts. */
static void frames_differ_wherever_they_do(void **state)
{
	uint8_t frame[21] = { 1, 2, 3 };

	(void)state;
	for (size_t i = 0; i < sizeof frame; i++) {
		struct doubled doubled = { 0 };

		assert_int_equal(doubled_judge(&doubled, 1, frame, sizeof frame, true, BEGIN),
		                 DOUBLED_NOT);
		assert_int_equal(doubled_judge(&doubled, 1, frame, sizeof frame, true, BEGIN),
		                 DOUBLED_SAME);
		frame[i]++;
		assert_int_equal(doubled_judge(&doubled, 1, frame, sizeof frame, true, BEGIN),
		                 DOUBLED_OTHER);
	}
}

/* As fast as drives are, one that is asked does not wait so long. */
static void what_comes_long_after_an_answer_was_sent_unasked(void **state)
{
	struct doubled together = { 0 };
	struct doubled unasked = { 0 };

	(void)state;
	assert_int_equal(take(&together, 1, 5, true, 0), DOUBLED_NOT);
	assert_int_equal(take(&together, 1, 6, false, 30 * MS), DOUBLED_OTHER);
	assert_int_equal(take(&unasked, 1, 5, true, 0), DOUBLED_NOT);
	assert_int_equal(take(&unasked, 1, 6, false, 30 * MS + 1), DOUBLED_NOT);
	/* It may do so again, for a while. */
	assert_int_equal(ask_two(&unasked, 5, 6, 5029 * MS), DOUBLED_NOT);
	assert_int_equal(ask_two(&unasked, 5, 6, 5029 * MS + 1), DOUBLED_OTHER);
}

static void what_is_asked_again_is_answered_again(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	for (uint8_t i = 1; i < 9; i++) {
		doubled.seen_count = 0;
		assert_int_equal(take(&doubled, 1, i, true, i * 20 * MS), DOUBLED_NOT);
		assert_int_equal(take(&doubled, 2, i, true, i * 20 * MS + MS), DOUBLED_NOT);
	}
}

/* A line that doubles frames: the copy comes when the next question has left, and is taken for its answer. */
static void the_copy_of_an_older_answer_is_no_other_drive(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	doubled.seen_count = 0;
	assert_int_equal(take(&doubled, 1, 9, true, 19 * MS), DOUBLED_NOT);
	for (uint8_t i = 10; i < 19; i++) {
		doubled.seen_count = 0;
		assert_int_equal(take(&doubled, 1, i - 1, true, i * 20 * MS), DOUBLED_NOT);
		assert_int_equal(take(&doubled, 1, i, false, i * 20 * MS + MS), DOUBLED_NOT);
	}
	assert_int_equal(doubled.until, 0);
	assert_int_equal(take(&doubled, 1, 18, false, 361 * MS), DOUBLED_SAME);
	/* A third one is. */
	assert_int_equal(take(&doubled, 1, 77, false, 362 * MS), DOUBLED_OTHER);
	assert_int_equal(take(&doubled, 1, 78, false, 363 * MS), DOUBLED_TWO);
}

/* On a drive that sends by itself what looks like an answer, a second one is no other drive's. */
static void who_sends_unasked_is_not_two(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	doubled.seen_count = 0;
	assert_int_equal(take(&doubled, 1, 5, true, 20 * MS), DOUBLED_NOT);
	assert_int_equal(take(&doubled, 1, 6, false, 70 * MS), DOUBLED_NOT);
	for (unsigned i = 5; i < 20; i++)
		assert_int_equal(ask_two(&doubled, 5, 6, i * 20 * MS), DOUBLED_NOT);
	assert_int_equal(doubled.until, 0);
}

static void more_parts_than_there_is_room_for_show_nothing(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	doubled.seen_count = 0;
	for (unsigned round = 0; round < 2; round++) {
		for (uint32_t part = 1; part < DOUBLED_PARTS + 9; part++)
			(void)take(&doubled, part, 5, true, 20 * MS);
	}
	assert_int_equal(doubled.seen_count, DOUBLED_PARTS);
	assert_int_equal(doubled.until, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_frame_that_came_twice_shows_nothing),
		cmocka_unit_test(one_other_answer_may_be_chance_and_two_are_two_drives),
		cmocka_unit_test(chance_is_forgotten),
		cmocka_unit_test(two_drives_are_forgotten),
		cmocka_unit_test(a_machine_that_has_just_started_is_like_any_other),
		cmocka_unit_test(frames_differ_wherever_they_do),
		cmocka_unit_test(what_comes_long_after_an_answer_was_sent_unasked),
		cmocka_unit_test(what_is_asked_again_is_answered_again),
		cmocka_unit_test(the_copy_of_an_older_answer_is_no_other_drive),
		cmocka_unit_test(who_sends_unasked_is_not_two),
		cmocka_unit_test(more_parts_than_there_is_room_for_show_nothing),
	};

	return cmocka_run_group_tests_name("doubled", tests, NULL, NULL);
}
