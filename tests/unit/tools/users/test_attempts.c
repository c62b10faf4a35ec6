/* SPDX-License-Identifier: Apache-2.0 */
/* Attempts to log in: some at once, then one at an interval, for each who tries. */
#include "users/attempts.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define S DB_NS_PER_S
#define NOW (1000 * S)

/* Three at once, then one in ten seconds. */
static const struct db_attempts_limit limit = { .most = 3, .every = 10 * S };

static struct db_attempts attempts;

static int begin(void **state)
{
	(void)state;
	memset(&attempts, 0, sizeof(attempts));
	attempts.seed = 42;
	return 0;
}

static db_time wait_of(uint64_t key, db_time now)
{
	return db_attempts_wait(&attempts, key, limit, now);
}

static void try(uint64_t key, db_time now)
{
	db_attempts_count(&attempts, key, 0, limit, now);
}

static void some_are_free_and_then_one_at_an_interval(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		assert_true(wait_of(7, NOW) == 0);
		try(7, NOW);
	}
	assert_true(wait_of(7, NOW) == 10 * S);
	assert_true(wait_of(7, NOW + 4 * S) == 6 * S);
	assert_true(wait_of(7, NOW + 10 * S) == 0);
	/* The next one begins another interval. */
	try(7, NOW + 10 * S);
	assert_true(wait_of(7, NOW + 10 * S) == 10 * S);
	/* After a long time all of them are free again, and no more than these. */
	for (unsigned i = 0; i < 3; i++) {
		assert_true(wait_of(7, NOW + 5000 * S) == 0);
		try(7, NOW + 5000 * S);
	}
	assert_true(wait_of(7, NOW + 5000 * S) == 10 * S);
}

static void each_key_is_limited_by_itself(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 3; i++)
		try(7, NOW);
	assert_true(wait_of(7, NOW) > 0);
	assert_true(wait_of(8, NOW) == 0);
	try(8, NOW);
	assert_true(wait_of(8, NOW) == 0);
}

/* A login that was right is none that was tried. */
static void what_is_given_back_does_not_count(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 3; i++)
		try(7, NOW);
	db_attempts_give_back(&attempts, 7, limit);
	assert_true(wait_of(7, NOW) == 0);
	try(7, NOW);
	assert_true(wait_of(7, NOW) == 10 * S);
	/* Of a key that is not there nothing is given back. */
	db_attempts_give_back(&attempts, 9, limit);
	assert_true(wait_of(9, NOW) == 0);
	assert_true(wait_of(7, NOW) == 10 * S);
}

/* Who floods it with names forgets those first that are limited least. */
static void the_least_limited_is_dropped_when_it_is_full(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 3; i++)
		try(1, NOW);
	for (uint64_t key = 2; key <= 5000; key++)
		try(key, NOW);
	assert_true(wait_of(1, NOW) == 10 * S);
}

/* Also the one that would be dropped is kept where it is asked for, wherever it stands. */
static void a_kept_key_is_not_dropped(void **state)
{
	for (uint64_t kept = 1; kept <= 3; kept++) {
		(void)begin(state);
		for (uint64_t key = 1; key <= DB_ATTEMPTS_PLACES; key++) {
			try(key, NOW);
			if (key != kept)
				try(key, NOW);
		}
		for (uint64_t key = 10000; key < 10100; key++)
			db_attempts_count(&attempts, key, kept, limit, NOW);
		try(kept, NOW);
		try(kept, NOW);
		assert_true(wait_of(kept, NOW) == 10 * S);
	}
}

static void kinds_and_seeds_have_keys_of_their_own(void **state)
{
	struct db_attempts other = { .seed = 43 };
	uint64_t key = db_attempts_key(&attempts, 'n', "anna", 4);

	(void)state;
	assert_true(key == db_attempts_key(&attempts, 'n', "anna", 4));
	assert_true(key != db_attempts_key(&attempts, 'a', "anna", 4));
	assert_true(key != db_attempts_key(&attempts, 'n', "anne", 4));
	assert_true(key != db_attempts_key(&attempts, 'n', "anna", 3));
	assert_true(key != db_attempts_key(&other, 'n', "anna", 4));
	assert_true(db_attempts_key(&attempts, 'n', "", 0) != 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(some_are_free_and_then_one_at_an_interval, begin),
		cmocka_unit_test_setup(each_key_is_limited_by_itself, begin),
		cmocka_unit_test_setup(what_is_given_back_does_not_count, begin),
		cmocka_unit_test_setup(the_least_limited_is_dropped_when_it_is_full, begin),
		cmocka_unit_test_setup(a_kept_key_is_not_dropped, begin),
		cmocka_unit_test_setup(kinds_and_seeds_have_keys_of_their_own, begin),
	};

	return cmocka_run_group_tests_name("users: attempts to log in", tests, NULL, NULL);
}
