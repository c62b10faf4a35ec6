/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/client.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static void addresses_as_text(void **state)
{
	const uint8_t v4[16] = {
		[10] = 0xFF, [11] = 0xFF, [12] = 192, [13] = 168, [14] = 1, [15] = 20
	};
	const uint8_t v6[16] = { 0xFD, [15] = 5 };
	uint8_t longest[16];
	char text[DB_CLIENT_ADDRESS_MAX];

	(void)state;
	db_client_address(v4, text);
	assert_string_equal(text, "192.168.1.20");
	db_client_address(v6, text);
	assert_string_equal(text, "fd00::5");
	memset(longest, 0xAB, sizeof(longest));
	db_client_address(longest, text);
	assert_int_equal(strlen(text), 39);
}

static void addresses_as_numbers(void **state)
{
	const uint8_t v4[16] = {
		[10] = 0xFF, [11] = 0xFF, [12] = 192, [13] = 168, [14] = 1, [15] = 20
	};
	const uint8_t v6[16] = { 0xFD, [15] = 5 };

	(void)state;
	assert_int_equal(db_client_ipv4(v4), 0xC0A80114);
	assert_int_equal(db_client_ipv4(v6), DB_CLIENT_IPV6);
}

static void users_in_the_place_of_addresses(void **state)
{
	uint8_t anna[16];
	uint8_t other[16];
	char text[DB_CLIENT_ADDRESS_MAX];

	(void)state;
	db_client_address_of_user(1000, "anna", anna);
	db_client_address(anna, text);
	assert_string_equal(text, "control, user anna");
	assert_int_equal(db_client_ipv4(anna), DB_CLIENT_IPV6);
	db_client_address_of_user(1001, "anna", other);
	assert_memory_not_equal(anna, other, sizeof(anna));
	/* Half a name would be another one's. */
	db_client_address_of_user(4000000000, "a-name-that-is-long", other);
	db_client_address(other, text);
	assert_string_equal(text, "control, user 4000000000");
	db_client_address_of_user(7, NULL, other);
	db_client_address(other, text);
	assert_string_equal(text, "control, user 7");
}

/* Round and round: those that mean nobody and a group are left out. */
static void numbers_of_clients(void **state)
{
	(void)state;
	assert_int_equal(db_client_number_after(DB_CLIENT_NOBODY), 1);
	assert_int_equal(db_client_number_after(1), 2);
	assert_int_equal(db_client_number_after(DB_CLIENT_FIRST_SESSION - 2),
	                 DB_CLIENT_FIRST_SESSION - 1);
	assert_int_equal(db_client_number_after(DB_CLIENT_FIRST_SESSION - 1), 1);
	assert_int_equal(db_client_number_after(DB_CLIENT_GROUP - 2), DB_CLIENT_GROUP - 1);
	assert_int_equal(db_client_number_after(DB_CLIENT_GROUP - 1), DB_CLIENT_FIRST_SESSION);
	assert_false(db_client_is_session(DB_CLIENT_FIRST_SESSION - 1));
	assert_true(db_client_is_session(DB_CLIENT_FIRST_SESSION));
	assert_false(db_client_is_session(DB_CLIENT_GROUP));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(addresses_as_text),
		cmocka_unit_test(addresses_as_numbers),
		cmocka_unit_test(users_in_the_place_of_addresses),
		cmocka_unit_test(numbers_of_clients),
	};

	return cmocka_run_group_tests_name("codec/client", tests, NULL, NULL);
}
