/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/doubled.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static enum doubled_kind take(struct doubled *doubled, uint32_t part, uint8_t content, bool asked,
                              db_time now)
{
	return doubled_judge(doubled, part, &content, 1, asked, now);
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
	assert_int_equal(doubled.until, 41 * MS + DOUBLED_TIME);
	/* It is news once. */
	assert_int_equal(ask_two(&doubled, 6, 5, 60 * MS), DOUBLED_OTHER);
	assert_int_equal(doubled.until, 61 * MS + DOUBLED_TIME);
}

static void chance_is_forgotten(void **state)
{
	struct doubled doubled = { 0 };

	(void)state;
	assert_int_equal(ask_two(&doubled, 5, 6, 20 * MS), DOUBLED_OTHER);
	assert_int_equal(ask_two(&doubled, 5, 6, 40 * MS + DOUBLED_TIME), DOUBLED_OTHER);
	assert_int_equal(doubled.until, 0);
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
		cmocka_unit_test(what_is_asked_again_is_answered_again),
		cmocka_unit_test(the_copy_of_an_older_answer_is_no_other_drive),
		cmocka_unit_test(who_sends_unasked_is_not_two),
		cmocka_unit_test(more_parts_than_there_is_room_for_show_nothing),
	};

	return cmocka_run_group_tests_name("doubled", tests, NULL, NULL);
}
