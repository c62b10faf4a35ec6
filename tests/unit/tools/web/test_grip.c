/* SPDX-License-Identifier: Apache-2.0 */
#include "web/grip.h"
#include "web/tokens.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define BEAT (100 * MS)
#define FRESH 0

static void test_is_held_while_beats_come(void **state)
{
	struct db_web_grip grip = { .number = 0 };
	db_time now = 5 * DB_NS_PER_S;
	uint64_t beat;

	(void)state;
	assert_false(db_web_grip_is_held(&grip));
	for (beat = 1; beat <= 50; beat++) {
		db_web_grip_take(&grip, 1, beat, 7.5, FRESH, now);
		assert_true(db_web_grip_is_held(&grip));
		assert_true(grip.velocity == 7.5);
		assert_int_equal(grip.until, now + DB_WEB_GRIP_LATE);
		now += BEAT;
	}
	/* A changed velocity changes it. */
	db_web_grip_take(&grip, 1, beat, -2, FRESH, now);
	assert_true(grip.velocity == -2);
	db_web_grip_look(&grip, now + DB_WEB_GRIP_LATE - 1);
	assert_true(db_web_grip_is_held(&grip));
	db_web_grip_look(&grip, now + DB_WEB_GRIP_LATE);
	assert_false(db_web_grip_is_held(&grip));
	assert_int_equal(grip.end, DB_WEB_GRIP_OVERDUE);
	assert_true(grip.velocity == 0);
	assert_int_equal(grip.until, DB_TIME_NEVER);
}

static void test_late_and_doubled_beats_keep_nothing_held(void **state)
{
	struct db_web_grip grip = { .number = 0 };

	(void)state;
	db_web_grip_take(&grip, 4, 10, 1, FRESH, 0);
	for (db_time now = 0; now < DB_WEB_GRIP_LATE; now += 10 * MS) {
		db_web_grip_take(&grip, 4, 10, 9, FRESH, now);
		db_web_grip_take(&grip, 4, 3, 9, FRESH, now);
		db_web_grip_take(&grip, 3, 99, 9, FRESH, now);
		assert_true(db_web_grip_is_held(&grip));
		assert_true(grip.velocity == 1);
	}
	/* A beat that comes when it is overdue finds it over, before anybody looked. */
	db_web_grip_take(&grip, 4, 11, 1, FRESH, DB_WEB_GRIP_LATE);
	assert_false(db_web_grip_is_held(&grip));
	assert_int_equal(grip.end, DB_WEB_GRIP_OVERDUE);
}

static void test_what_is_over_stays_over(void **state)
{
	static const enum db_web_grip_end ends[] = { DB_WEB_GRIP_REFUSED, DB_WEB_GRIP_STOPPED,
		                                     DB_WEB_GRIP_LOGOUT, DB_WEB_GRIP_LOST,
		                                     DB_WEB_GRIP_ENDING };
	struct db_web_grip grip = { .number = 0 };
	uint64_t number = 1;

	(void)state;
	db_web_grip_take(&grip, number, 1, 1, FRESH, 0);
	db_web_grip_take(&grip, number, 2, 0, FRESH, BEAT);
	assert_int_equal(grip.end, DB_WEB_GRIP_RELEASED);
	db_web_grip_take(&grip, number, 3, 1, FRESH, BEAT);
	assert_false(db_web_grip_is_held(&grip));
	for (size_t i = 0; i < sizeof(ends) / sizeof(ends[0]); i++) {
		db_web_grip_take(&grip, ++number, 1, 1, FRESH, 0);
		assert_true(db_web_grip_is_held(&grip));
		db_web_grip_finish(&grip, ends[i]);
		/* The first reason counts. */
		db_web_grip_finish(&grip, DB_WEB_GRIP_RELEASED);
		for (uint64_t beat = 2; beat < 9; beat++)
			db_web_grip_take(&grip, number, beat, 1, FRESH, 1);
		assert_false(db_web_grip_is_held(&grip));
		assert_int_equal(grip.end, ends[i]);
	}
}

static void test_a_release_that_comes_before_its_beats(void **state)
{
	struct db_web_grip grip = { .number = 0 };

	(void)state;
	db_web_grip_take(&grip, 2, 3, 0, FRESH, 0);
	assert_false(db_web_grip_is_held(&grip));
	db_web_grip_take(&grip, 2, 1, 1, FRESH, 1);
	db_web_grip_take(&grip, 2, 2, 1, FRESH, 2);
	assert_false(db_web_grip_is_held(&grip));
	/* The next press is one of its own, and ends the one before whose release is missing. */
	db_web_grip_take(&grip, 3, 1, 1, FRESH, 3);
	assert_true(db_web_grip_is_held(&grip));
	db_web_grip_take(&grip, 4, 1, -1, FRESH, 4);
	assert_true(db_web_grip_is_held(&grip));
	db_web_grip_take(&grip, 3, 2, 0, FRESH, 5);
	assert_true(grip.velocity == -1);
}

static void test_what_was_long_on_its_way_moves_nothing(void **state)
{
	struct db_web_grip grip = { .number = 0 };

	(void)state;
	/* The limit belongs to what is fresh. */
	db_web_grip_take(&grip, 1, 1, 1, DB_WEB_TOKEN_FRESH, 0);
	assert_true(db_web_grip_is_held(&grip));
	/* What is old does not keep it held, nor changes it. */
	db_web_grip_take(&grip, 1, 2, 9, DB_WEB_TOKEN_FRESH + 1, 200 * MS);
	assert_true(grip.velocity == 1);
	assert_int_equal(grip.until, DB_WEB_GRIP_LATE);
	db_web_grip_take(&grip, 1, 3, 1, FRESH, 250 * MS);
	assert_int_equal(grip.until, 250 * MS + DB_WEB_GRIP_LATE);
	/* Letting go is never too late. */
	db_web_grip_take(&grip, 1, 4, 0, DB_TIME_NEVER, 300 * MS);
	assert_int_equal(grip.end, DB_WEB_GRIP_RELEASED);
	/* A press whose first beat was late is over, and ends the one before. */
	db_web_grip_take(&grip, 2, 1, 1, FRESH, 400 * MS);
	assert_true(db_web_grip_is_held(&grip));
	db_web_grip_take(&grip, 3, 1, 1, 2000 * MS, 500 * MS);
	assert_int_equal(grip.end, DB_WEB_GRIP_OLD);
	assert_true(grip.velocity == 0);
	assert_int_equal(grip.until, DB_TIME_NEVER);
	db_web_grip_take(&grip, 3, 2, 1, FRESH, 600 * MS);
	assert_false(db_web_grip_is_held(&grip));
	/* Without a token it is not known how old it is. */
	db_web_grip_take(&grip, 4, 1, 1, DB_TIME_NEVER, 700 * MS);
	assert_false(db_web_grip_is_held(&grip));
	db_web_grip_take(&grip, 5, 1, 1, FRESH, 800 * MS);
	assert_true(db_web_grip_is_held(&grip));
}

/* Whatever a network does to requests: nothing is held that has no beat of the latest LATE, and no grip twice. */
static void test_any_order(void **state)
{
	unsigned roll = 12345;

	(void)state;
	for (unsigned story = 0; story < 2000; story++) {
		struct db_web_grip grip = { .number = 0 };
		bool over[16] = { false };
		db_time now = 0;
		db_time fresh = 0;

		for (unsigned step = 0; step < 60; step++) {
			uint64_t before = grip.number;
			uint64_t number;
			uint64_t beat;
			db_time age;

			roll = roll * 1103515245 + 12345;
			number = 1 + (roll >> 8) % 15;
			beat = 1 + (roll >> 16) % 20;
			now += (db_time)((roll >> 4) % 200) * MS;
			db_web_grip_look(&grip, now);
			if (before != 0 && !db_web_grip_is_held(&grip))
				over[before] = true;
			age = (db_time)((roll >> 11) % 8) * BEAT;
			if ((number > before || (number == before && beat > grip.beat)) &&
			    age <= DB_WEB_TOKEN_FRESH)
				fresh = now;
			db_web_grip_take(&grip, number, beat, (double)((roll >> 20) % 3), age, now);
			for (uint64_t i = 1; i < grip.number; i++)
				over[i] = true;
			if (!db_web_grip_is_held(&grip))
				over[grip.number] = true;
			else if (over[grip.number] || now - fresh >= DB_WEB_GRIP_LATE ||
			         grip.velocity == 0)
				fail();
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_is_held_while_beats_come),
		cmocka_unit_test(test_late_and_doubled_beats_keep_nothing_held),
		cmocka_unit_test(test_what_is_over_stays_over),
		cmocka_unit_test(test_a_release_that_comes_before_its_beats),
		cmocka_unit_test(test_what_was_long_on_its_way_moves_nothing),
		cmocka_unit_test(test_any_order),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
