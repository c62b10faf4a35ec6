/* SPDX-License-Identifier: Apache-2.0 */
#include "server/peers.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define START (1000 * MS)

static void a_tenth_comes_at_once(void **state)
{
	struct db_rate rate = { 0 };

	(void)state;
	for (int i = 0; i < 10; i++)
		assert_int_equal(db_rate_take(&rate, 100, START), START);
	/* Then one every 10 ms, each with a turn of its own. */
	for (int i = 1; i < 5; i++)
		assert_int_equal(db_rate_take(&rate, 100, START), START + i * 10 * MS);
}

static void one_at_least(void **state)
{
	struct db_rate rate = { 0 };

	(void)state;
	assert_int_equal(db_rate_take(&rate, 2, START), START);
	assert_int_equal(db_rate_take(&rate, 2, START), START + 500 * MS);
	assert_int_equal(db_rate_take(&rate, 2, START + 499 * MS), START + 1000 * MS);
}

static void silence_fills_it_up_to_its_size(void **state)
{
	struct db_rate rate = { 0 };
	db_time late = START + 3600 * 1000 * MS;

	(void)state;
	for (int i = 0; i < 15; i++)
		db_rate_take(&rate, 100, START);
	for (int i = 0; i < 10; i++)
		assert_int_equal(db_rate_take(&rate, 100, late), late);
	assert_int_equal(db_rate_take(&rate, 100, late), late + 10 * MS);
}

/* Whoever takes each request at its turn gets what was promised, no more and no less. */
static void the_rate_is_kept(void **state)
{
	struct db_rate rate = { 0 };
	db_time now = START;
	int taken = 0;

	(void)state;
	while (now < START + 10000 * MS) {
		now = db_rate_take(&rate, 250, now);
		taken++;
	}
	assert_in_range(taken, 2500, 2500 + 25 + 1);
}

/* Late by some milliseconds every time, as timers are: the bucket makes up for it. */
static void lateness_is_made_up_for(void **state)
{
	struct db_rate rate = { 0 };
	db_time now = START;
	int taken = 0;

	(void)state;
	while (now < START + 10000 * MS) {
		db_time turn = db_rate_take(&rate, 1000, now);

		if (turn > now)
			now = turn + 5 * MS;
		taken++;
	}
	assert_in_range(taken, 9900, 10000 + 100 + 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_tenth_comes_at_once),
		cmocka_unit_test(one_at_least),
		cmocka_unit_test(silence_fills_it_up_to_its_size),
		cmocka_unit_test(the_rate_is_kept),
		cmocka_unit_test(lateness_is_made_up_for),
	};

	return cmocka_run_group_tests_name("server/rate", tests, NULL, NULL);
}
