/* SPDX-License-Identifier: Apache-2.0 */
/* Names of those for whom sessions act, and how long they are remembered. */
#include "control/actors.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static void names_that_people_can_see(void **state)
{
	static const char *const good[] = {
		"a",
		"anna",
		"Anna M. (shift 2)",
		"J\xC3\xBCrgen",
		"\xE5\xBC\xA0\xE4\xB8\x89",
		"\xF0\x9F\x94\xA7",
		"abcdefghijabcdefghijabcdefghijab",
	};
	static const char *const bad[] = {
		"",
		" anna",
		"anna ",
		"an\tna",
		"an\nna",
		"an\x1B[31mna",
		"an\x7Fna",
		"an\xC2\x85na",     /* a control of Latin-1 */
		"an\xC2\xA0na",     /* a space that is none */
		"an\xE2\x80\x8Bna", /* without width */
		"an\xE2\x80\xAEna", /* turns what follows around */
		"an\xE2\x80\xA8na", /* ends a line */
		"\xEF\xBB\xBFotto", /* a byte order mark */
		"\xF3\xA0\x81\x81", /* a tag */
		"\xC0\xAF",         /* longer than it need be */
		"\xE0\x80\xAF",
		"\xF0\x80\x80\xAF",
		"\xED\xA0\x80",        /* half of a pair */
		"\xF4\x90\x80\x80",    /* behind the last one */
		"na\xFB\x90\x8B\x8Bo", /* no first byte, and what would follow one */
		"\xF8\x88\x80\x80\x80",
		"\xC3", /* ends within a character */
		"\xE5\xBC",
		"\x80",
		"abcdefghijabcdefghijabcdefghijabc", /* one too long */
		"abcdefghijabcdefghijabcdefghija\xC3\xBC",
	};

	(void)state;
	for (size_t i = 0; i < sizeof(good) / sizeof(good[0]); i++)
		assert_true(db_actors_name_is_good(good[i]));
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
		if (db_actors_name_is_good(bad[i]))
			fail_msg("taken: number %zu", i);
	}
}

static void one_number_for_the_same_names(void **state)
{
	static struct db_actors actors;
	uint32_t anna;
	uint32_t otto;

	(void)state;
	anna = db_actors_hold(&actors, 997, "drivebridge-web", "anna");
	otto = db_actors_hold(&actors, 997, "drivebridge-web", "otto");
	assert_int_not_equal(anna, 0);
	assert_int_not_equal(anna, otto);
	assert_int_equal(db_actors_hold(&actors, 997, "drivebridge-web", "anna"), anna);
	assert_int_not_equal(db_actors_hold(&actors, 998, "drivebridge-web", "anna"), anna);
	assert_int_not_equal(db_actors_hold(&actors, 997, "drivebridge-opcua", "anna"), anna);
	/* Gone, and still known; and the same when it comes back. */
	db_actors_let_go(&actors, anna);
	db_actors_let_go(&actors, anna);
	assert_string_equal(db_actors_find(&actors, anna)->named, "anna");
	assert_string_equal(db_actors_find(&actors, anna)->process_user, "drivebridge-web");
	assert_int_equal(db_actors_hold(&actors, 997, "drivebridge-web", "anna"), anna);
	assert_null(db_actors_find(&actors, 0));
	assert_null(db_actors_find(&actors, anna + DB_ACTORS_MAX));
	db_actors_let_go(&actors, 0);
	db_actors_let_go(&actors, anna + DB_ACTORS_MAX);
}

/* However many come: who has a session keeps the name, and of the others those that left last. */
static void the_one_that_left_first_is_forgotten(void **state)
{
	static struct db_actors actors;
	uint32_t stays = db_actors_hold(&actors, 0, "root", "");
	uint32_t numbers[3 * DB_ACTORS_MAX];
	char name[DB_CLIENT_USER_MAX];

	(void)state;
	for (unsigned i = 0; i < 3 * DB_ACTORS_MAX; i++) {
		(void)snprintf(name, sizeof(name), "user %u", i);
		numbers[i] = db_actors_hold(&actors, 997, "drivebridge-web", name);
		assert_int_not_equal(numbers[i], 0);
		db_actors_let_go(&actors, numbers[i]);
	}
	assert_string_equal(db_actors_find(&actors, stays)->process_user, "root");
	for (unsigned i = 0; i < 3 * DB_ACTORS_MAX; i++) {
		const struct db_actor *actor = db_actors_find(&actors, numbers[i]);

		(void)snprintf(name, sizeof(name), "user %u", i);
		if (i < 2 * DB_ACTORS_MAX + 1)
			assert_null(actor);
		else
			assert_string_equal(actor->named, name);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(names_that_people_can_see),
		cmocka_unit_test(one_number_for_the_same_names),
		cmocka_unit_test(the_one_that_left_first_is_forgotten),
	};

	return cmocka_run_group_tests_name("control/actors", tests, NULL, NULL);
}
