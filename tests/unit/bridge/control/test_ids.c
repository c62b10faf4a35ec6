/* SPDX-License-Identifier: Apache-2.0 */
/* Calls with ids: which are the same, how long they are kept, and when there is no room. */
#include "control/ids.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define KEPT (10 * DB_NS_PER_S)

static int open_ids(void **state)
{
	*state = calloc(1, sizeof(struct db_ids));
	return *state ? 0 : -1;
}

static int close_ids(void **state)
{
	db_ids_clear(*state);
	free(*state);
	return 0;
}

/* Odd numbers are one user's, all else the other's. */
static struct db_id_key key_of(const char *drive, const char *id)
{
	return (struct db_id_key){
		.user = 1000,
		.named = strtol(id, NULL, 10) % 2 != 0 ? "anna" : "berta",
		.drive = drive,
		.id = id,
	};
}

static struct db_id_call *add(struct db_ids *ids, const char *drive, const char *id, db_time now)
{
	struct db_id_key key = key_of(drive, id);

	return db_ids_add(ids, &key, now + KEPT, now);
}

/* Ends it, as what is pending is never forgotten. */
static void add_ended(struct db_ids *ids, const char *drive, int number, db_time now)
{
	struct db_id_call *call;
	char id[16];

	(void)snprintf(id, sizeof(id), "%d", number);
	call = add(ids, drive, id, now);
	assert_non_null(call);
	call->result = DB_RESULT_OK;
}

static bool knows(struct db_ids *ids, const char *drive, const char *id)
{
	struct db_id_key key = key_of(drive, id);

	return db_ids_find(ids, &key) != NULL;
}

static void one_for_each_user_and_drive(void **state)
{
	struct db_id_key key = key_of("lift", "7");
	struct db_id_call *call;

	assert_null(db_ids_find(*state, &key));
	call = add(*state, "lift", "7", 0);
	assert_non_null(call);
	assert_int_equal(call->result, DB_RESULT_PENDING);
	assert_ptr_equal(db_ids_find(*state, &key), call);
	assert_ptr_equal(db_ids_at(*state, call->number), call);
	key.named = "otto";
	assert_null(db_ids_find(*state, &key));
	key.named = "";
	assert_null(db_ids_find(*state, &key));
	key = key_of("lift", "7");
	key.user = 1001;
	assert_null(db_ids_find(*state, &key));
	assert_false(knows(*state, "feeder", "7"));
	assert_false(knows(*state, "lift", "77"));
}

static void the_longest_fit_and_longer_ones_do_not(void **state)
{
	char id[DB_ID_MAX + 2];

	memset(id, 'x', sizeof(id));
	id[DB_ID_MAX + 1] = '\0';
	assert_null(add(*state, "lift", id, 0));
	id[DB_ID_MAX] = '\0';
	assert_non_null(add(*state, "abcdefghijabcdefghijabcdefghija", id, 0));
	assert_true(knows(*state, "abcdefghijabcdefghijabcdefghija", id));
	assert_null(add(*state, "abcdefghijabcdefghijabcdefghijab", id, 0));
}

/* The session that began it is gone: the end is kept all the same. */
static void its_end_is_kept_by_its_token(void **state)
{
	struct db_write_token token = { .client = 5, .sequence = 9 };
	struct db_id_call *call = add(*state, "lift", "7", 0);

	call->token = token;
	token.sequence = 8;
	db_ids_end_by_token(*state, token, DB_RESULT_REFUSED);
	assert_int_equal(call->result, DB_RESULT_PENDING);
	token.sequence = 9;
	db_ids_end_by_token(*state, token, DB_RESULT_REFUSED);
	assert_int_equal(call->result, DB_RESULT_REFUSED);
	/* Once. */
	db_ids_end_by_token(*state, token, DB_RESULT_OK);
	assert_int_equal(call->result, DB_RESULT_REFUSED);
}

static void what_was_not_begun_is_new_again(void **state)
{
	uint64_t number = add(*state, "lift", "7", 0)->number;

	db_ids_drop(*state, number);
	assert_null(db_ids_at(*state, number));
	assert_false(knows(*state, "lift", "7"));
	db_ids_drop(*state, number);
	assert_null(db_ids_at(*state, 0));
	/* Another one in its place has another handle. */
	assert_int_not_equal(add(*state, "lift", "7", 0)->number, number);
	assert_null(db_ids_at(*state, number));
}

/* None is forgotten before its time, and later only for a newer one. */
static void the_latest_are_kept(void **state)
{
	for (int i = 0; i < DB_IDS_EACH; i++)
		add_ended(*state, "lift", i, i);
	assert_null(add(*state, "lift", "x", KEPT));
	/* Other drives have room. */
	assert_non_null(add(*state, "feeder", "x", KEPT));
	/* The time of the first one is over. */
	add_ended(*state, "lift", DB_IDS_EACH, KEPT + 1);
	assert_false(knows(*state, "lift", "0"));
	for (int i = 1; i <= DB_IDS_EACH; i++) {
		char id[16];

		(void)snprintf(id, sizeof(id), "%d", i);
		assert_true(knows(*state, "lift", id));
	}
	assert_null(add(*state, "lift", "x", KEPT + 1));
}

static void what_is_pending_is_never_forgotten(void **state)
{
	struct db_id_call *first = add(*state, "lift", "first", 0);

	for (int i = 1; i < DB_IDS_EACH; i++)
		add_ended(*state, "lift", i, 0);
	add_ended(*state, "lift", DB_IDS_EACH, 2 * KEPT);
	assert_true(knows(*state, "lift", "first"));
	assert_false(knows(*state, "lift", "1"));
	first->result = DB_RESULT_OK;
	add_ended(*state, "lift", DB_IDS_EACH + 1, 2 * KEPT);
	assert_false(knows(*state, "lift", "first"));
}

static void one_user_leaves_places_to_the_others(void **state)
{
	struct db_id_key key = key_of("lift", "x");

	key.user = 7;
	for (int i = 0; i < DB_IDS_OF_USER; i++) {
		char id[16];

		(void)snprintf(id, sizeof(id), "n%d", i);
		key.id = id;
		assert_non_null(db_ids_add(*state, &key, KEPT, 0));
	}
	key.id = "x";
	assert_null(db_ids_add(*state, &key, KEPT, 0));
	assert_non_null(add(*state, "lift", "2", 0));
}

/* Drives that come and go under ever new names take no more memory. */
static void drives_are_bounded(void **state)
{
	char name[16];

	for (int i = 0; i < DB_IDS_DRIVES; i++) {
		(void)snprintf(name, sizeof(name), "d%d", i);
		add_ended(*state, name, 1, i == 3 ? 0 : 1);
	}
	assert_null(add(*state, "new", "1", KEPT));
	/* All ids of the fourth are old enough. */
	assert_non_null(add(*state, "new", "1", KEPT + 1));
	assert_false(knows(*state, "d3", "1"));
	assert_true(knows(*state, "new", "1"));
	assert_true(knows(*state, "d4", "1"));
	assert_null(add(*state, "newer", "1", KEPT + 1));
}

static void cleared_ones_are_forgotten(void **state)
{
	struct db_ids *ids = *state;
	const struct db_id_call *call = add(ids, "lift", "7", 0);
	uint64_t number;

	assert_non_null(call);
	number = call->number;
	db_ids_clear(ids);
	assert_false(knows(ids, "lift", "7"));
	assert_null(db_ids_at(ids, number));
	assert_non_null(add(ids, "lift", "7", 0));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(one_for_each_user_and_drive, open_ids, close_ids),
		cmocka_unit_test_setup_teardown(the_longest_fit_and_longer_ones_do_not, open_ids,
		                                close_ids),
		cmocka_unit_test_setup_teardown(its_end_is_kept_by_its_token, open_ids, close_ids),
		cmocka_unit_test_setup_teardown(what_was_not_begun_is_new_again, open_ids,
		                                close_ids),
		cmocka_unit_test_setup_teardown(the_latest_are_kept, open_ids, close_ids),
		cmocka_unit_test_setup_teardown(what_is_pending_is_never_forgotten, open_ids,
		                                close_ids),
		cmocka_unit_test_setup_teardown(one_user_leaves_places_to_the_others, open_ids,
		                                close_ids),
		cmocka_unit_test_setup_teardown(drives_are_bounded, open_ids, close_ids),
		cmocka_unit_test_setup_teardown(cleared_ones_are_forgotten, open_ids, close_ids),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
