/* SPDX-License-Identifier: Apache-2.0 */
/* Whose greeting gives way, and whose is served first. */
#include "tls/places.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const uint8_t V4[16] = { [10] = 0xFF, 0xFF, 10, 0, 0, 0 };
static const uint8_t PLC[16] = { [10] = 0xFF, 0xFF, 10, 0, 0, 200 };

static void make(uint8_t address[16], uint8_t last)
{
	memcpy(address, V4, 16);
	address[15] = last;
}

static void test_what_counts_as_one(void **state)
{
	uint8_t one[16] = { 0xFD, 0, 0, 0, 0, 0, 0, 1, 1 };
	uint8_t two[16] = { 0xFD, 0, 0, 0, 0, 0, 0, 1, 2 };
	uint8_t other[16] = { 0xFD, 0, 0, 0, 0, 0, 0, 2, 1 };
	uint8_t none[16] = { 0 };

	(void)state;
	assert_true(db_tls_places_same(one, two));
	assert_false(db_tls_places_same(one, other));
	assert_false(db_tls_places_same(V4, PLC));
	assert_true(db_tls_places_same(PLC, PLC));
	assert_false(db_tls_places_same(PLC, none));
	assert_false(db_tls_places_same(none, PLC));
}

static void test_who_gives_way(void **state)
{
	struct db_tls_places places = { .last = 0 };
	char who[64];
	uint8_t address[16];
	unsigned taken = 0;

	(void)state;
	/* One's own oldest, when one has one's share. */
	for (unsigned i = 0; i < DB_TLS_GREETINGS_PER_ADDRESS; i++) {
		assert_null(db_tls_places_displaced(&places, V4));
		db_tls_places_take(&places, V4, &who[taken++]);
	}
	assert_ptr_equal(db_tls_places_displaced(&places, V4), &who[0]);
	assert_null(db_tls_places_displaced(&places, PLC));
	/* When all are taken, the oldest of who has most: never a single one. */
	for (uint8_t last = 1; taken < DB_TLS_GREETINGS - 1; last++) {
		make(address, last);
		for (unsigned i = 0; i < 3 && taken < DB_TLS_GREETINGS - 1; i++)
			db_tls_places_take(&places, address, &who[taken++]);
	}
	db_tls_places_take(&places, PLC, &who[taken++]);
	assert_int_equal(db_tls_places_count(&places), DB_TLS_GREETINGS);
	make(address, 100);
	assert_ptr_equal(db_tls_places_displaced(&places, address), &who[0]);
	db_tls_places_leave(&places, &who[0]);
	db_tls_places_take(&places, address, &who[taken++]);
	assert_ptr_equal(db_tls_places_displaced(&places, PLC), &who[1]);
	db_tls_places_leave(&places, &who[1]);
	assert_null(db_tls_places_displaced(&places, PLC));
	db_tls_places_leave(&places, &who[60]);
	assert_int_equal(db_tls_places_count(&places), DB_TLS_GREETINGS - 1);
}

static void test_who_is_served_first(void **state)
{
	struct db_tls_places places = { .last = 0 };
	char who[8];

	(void)state;
	for (unsigned i = 0; i < 5; i++)
		db_tls_places_take(&places, V4, &who[i]);
	db_tls_places_take(&places, PLC, &who[5]);
	assert_false(db_tls_places_any_ready(&places));
	assert_null(db_tls_places_next(&places));
	for (unsigned i = 5; i-- > 0;)
		db_tls_places_set_ready(&places, &who[i]);
	db_tls_places_set_ready(&places, &who[5]);
	assert_true(db_tls_places_any_ready(&places));
	assert_ptr_equal(db_tls_places_next(&places), &who[5]);
	for (unsigned i = 0; i < 5; i++)
		assert_ptr_equal(db_tls_places_next(&places), &who[i]);
	assert_null(db_tls_places_next(&places));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_counts_as_one),
		cmocka_unit_test(test_who_gives_way),
		cmocka_unit_test(test_who_is_served_first),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
