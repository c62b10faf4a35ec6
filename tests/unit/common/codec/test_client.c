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

static void users_of_this_machine(void **state)
{
	const uint8_t v4[16] = { [10] = 0xFF, [11] = 0xFF, [12] = 127, [15] = 1 };
	const uint8_t loopback[16] = { [15] = 1 };
	const uint8_t v6[16] = { 0xFD, [15] = 5 };
	const char *const longest = "a-name-of-thirty-one-characters";
	struct db_client_session session;
	struct db_client_words words;
	char text[DB_CLIENT_ADDRESS_MAX];
	uint8_t address[16];
	uint8_t other[16];
	uint32_t user;

	(void)state;
	assert_false(db_client_user_of_address(v4, &user));
	assert_false(db_client_user_of_address(v6, &user));
	db_client_address_of_user(v4, 1000, address);
	assert_true(db_client_user_of_address(address, &user));
	assert_int_equal(user, 1000);
	assert_false(db_client_session_of_address(address, &session));
	assert_int_equal(db_client_ipv4(address), 0x7F000001);
	db_client_address(address, text);
	assert_string_equal(text, "127.0.0.1, user 1000");
	/* Another user is another client. */
	db_client_address_of_user(v4, 1001, other);
	assert_memory_not_equal(address, other, sizeof address);
	db_client_words_init(&words, address, "anna", "");
	assert_string_equal(words.address, "127.0.0.1, user anna");
	/* Half a name could be another user's. */
	db_client_address_of_user((const uint8_t[16]){ [10] = 0xFF, 0xFF, 192, 168, 100, 100 }, 7,
	                          other);
	db_client_words_init(&words, other, longest, "");
	assert_string_equal(words.address, "192.168.100.100, user 7");
	db_client_words_init(&words, address, longest, "");
	assert_string_equal(words.address, "127.0.0.1, user 1000");
	db_client_address_of_user(v4, DB_CLIENT_USER_UNKNOWN, other);
	db_client_address(other, text);
	assert_string_equal(text, "127.0.0.1, user unknown");
	db_client_address_of_user(loopback, 0, other);
	db_client_address(other, text);
	assert_string_equal(text, "::1, user 0");
	assert_int_equal(db_client_ipv4(other), DB_CLIENT_IPV6);
	db_client_address_of_user(v6, 0, other);
	db_client_address(other, text);
	assert_string_equal(text, "this machine, user 0");
}

static void sessions_in_the_place_of_addresses(void **state)
{
	const struct db_client_session anna = { .user = 1000, .actor = 0x01020304, .named = true };
	const struct db_client_session high = { .user = 4000000000, .actor = UINT32_MAX };
	struct db_client_session found;
	uint8_t address[16];
	uint8_t other[16];
	char text[DB_CLIENT_ADDRESS_MAX];

	(void)state;
	db_client_address_of_session(&anna, address);
	assert_true(db_client_session_of_address(address, &found));
	assert_int_equal(found.user, 1000);
	assert_int_equal(found.actor, 0x01020304);
	assert_true(found.named);
	assert_int_equal(db_client_ipv4(address), DB_CLIENT_IPV6);
	db_client_address(address, text);
	assert_string_equal(text, "control, user 1000");
	db_client_address_of_session(&high, other);
	assert_true(db_client_session_of_address(other, &found));
	assert_int_equal(found.user, 4000000000);
	assert_int_equal(found.actor, UINT32_MAX);
	assert_false(found.named);
	assert_memory_not_equal(address, other, sizeof(address));
	memset(other, 0, sizeof(other));
	assert_false(db_client_session_of_address(other, &found));
	other[0] = 0xFD;
	assert_false(db_client_session_of_address(other, &found));
}

static void clients_in_words(void **state)
{
	const struct db_client_session session = { .user = 997, .actor = 1, .named = true };
	const uint8_t plc[16] = {
		[10] = 0xFF, [11] = 0xFF, [12] = 192, [13] = 168, [14] = 1, [15] = 20
	};
	struct db_client_words words;
	uint8_t address[16];
	char text[DB_CLIENT_TEXT_MAX];

	(void)state;
	db_client_address_of_session(&session, address);
	db_client_words_init(&words, address, "drivebridge-web", "J\xC3\xBCrgen");
	assert_string_equal(words.address, "control, user drivebridge-web");
	assert_string_equal(words.user, "J\xC3\xBCrgen");
	db_client_words_join(&words, text);
	assert_string_equal(text, "control, user drivebridge-web for J\xC3\xBCrgen");
	db_client_words_init(&words, address, "", "");
	db_client_words_join(&words, text);
	assert_string_equal(text, "control, user 997");
	db_client_words_init(&words, plc, "", "");
	db_client_words_join(&words, text);
	assert_string_equal(text, "192.168.1.20");
	/* The longest of both. */
	db_client_words_init(&words, address, "abcdefghijabcdefghijabcdefghija",
	                     "abcdefghijabcdefghijabcdefghijab");
	db_client_words_join(&words, text);
	assert_string_equal(text, "control, user abcdefghijabcdefghijabcdefghija for "
	                          "abcdefghijabcdefghijabcdefghijab");
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
		cmocka_unit_test(users_of_this_machine),
		cmocka_unit_test(sessions_in_the_place_of_addresses),
		cmocka_unit_test(clients_in_words),
		cmocka_unit_test(numbers_of_clients),
	};

	return cmocka_run_group_tests_name("codec/client", tests, NULL, NULL);
}
