/* SPDX-License-Identifier: Apache-2.0 */
/* What drivebridge-tls says at the secure socket: there and back, and what is no hello. */
#include "codec/secure_hello.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct db_secure_hello make_client(const char *name, const char *role)
{
	struct db_secure_hello hello = { .kind = DB_SECURE_CLIENT };

	memset(hello.client.address, 0, 10);
	memcpy(hello.client.address + 10, (uint8_t[]){ 0xFF, 0xFF, 192, 168, 10, 5 }, 6);
	hello.client.port = 50123;
	for (unsigned i = 0; i < DB_SECURE_FINGERPRINT_SIZE; i++)
		hello.client.fingerprint[i] = (uint8_t)(0xA0 + i);
	hello.client.expires = 1893456000;
	hello.client.waited_ms = 70000;
	hello.client.serial_size = 3;
	memcpy(hello.client.serial, "\x01\x02\x03", 3);
	strcpy(hello.client.name, name);
	strcpy(hello.client.role, role);
	return hello;
}

static void test_client_there_and_back(void **state)
{
	static const char *const names[] = {
		"press-plc", "", "Press PLC 1",
		"0123456789012345678901234567890123456789012345678901234567890123"
	};
	static const char *const roles[] = { "Operator", "", "01234567890123456789012345678901" };
	uint8_t bytes[DB_SECURE_HELLO_SIZE];
	struct db_secure_hello read;

	(void)state;
	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
		for (size_t j = 0; j < sizeof(roles) / sizeof(roles[0]); j++) {
			struct db_secure_hello hello = make_client(names[i], roles[j]);

			db_secure_hello_write(&hello, bytes);
			assert_int_equal(db_secure_hello_read(bytes, &read), DB_SECURE_CLIENT);
			assert_memory_equal(read.client.address, hello.client.address, 16);
			assert_int_equal(read.client.port, 50123);
			assert_memory_equal(read.client.fingerprint, hello.client.fingerprint,
			                    DB_SECURE_FINGERPRINT_SIZE);
			assert_int_equal(read.client.expires, 1893456000);
			assert_int_equal(read.client.waited_ms, 70000);
			assert_int_equal(read.client.serial_size, 3);
			assert_memory_equal(read.client.serial, "\x01\x02\x03", 3);
			assert_string_equal(read.client.name, names[i]);
			assert_string_equal(read.client.role, roles[j]);
		}
	}
}

static void test_status_there_and_back(void **state)
{
	const struct db_secure_status status = { 1893456000, 0, 1893456001, 12, 3, 400, 50, 6 };
	struct db_secure_hello hello = { .kind = DB_SECURE_STATUS, .status = status };
	uint8_t bytes[DB_SECURE_HELLO_SIZE];
	struct db_secure_hello read;

	(void)state;
	db_secure_hello_write(&hello, bytes);
	assert_int_equal(db_secure_hello_read(bytes, &read), DB_SECURE_STATUS);
	assert_int_equal(read.status.expires, status.expires);
	assert_int_equal(read.status.crl_expires, 0);
	assert_int_equal(read.status.client_expires, status.client_expires);
	assert_int_equal(read.status.clients, 12);
	assert_int_equal(read.status.greetings, 3);
	assert_int_equal(read.status.accepted, 400);
	assert_int_equal(read.status.refused, 50);
	assert_int_equal(read.status.displaced, 6);
}

/* The first bytes as they are on the socket. */
static void test_form(void **state)
{
	const struct db_secure_hello hello = make_client("plc", "Reader");
	static const uint8_t head[] = { 'D', 'B',  'T',  'L', 'S', 1,  1, 0xC3, 0xCB,
		                        0,   0,    0,    0,   0,   0,  0, 0,    0,
		                        0,   0xFF, 0xFF, 192, 168, 10, 5, 0xA0, 0xA1 };
	uint8_t bytes[DB_SECURE_HELLO_SIZE];

	(void)state;
	db_secure_hello_write(&hello, bytes);
	assert_memory_equal(bytes, head, sizeof(head));
}

static void test_what_is_none(void **state)
{
	static const char *const names[] = { " plc", "plc ", "a,b", "a\nb", "\xC3\xBC", "a\x7F" };
	static const char *const roles[] = { "a b", "\xC3\xBC", "a\tb" };
	const struct db_secure_hello good = make_client("plc", "Reader");
	uint8_t bytes[DB_SECURE_HELLO_SIZE];
	struct db_secure_hello read;

	(void)state;
	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
		struct db_secure_hello hello = make_client(names[i], "Reader");

		db_secure_hello_write(&hello, bytes);
		assert_int_equal(db_secure_hello_read(bytes, &read), DB_SECURE_WRONG);
	}
	for (size_t i = 0; i < sizeof(roles) / sizeof(roles[0]); i++) {
		struct db_secure_hello hello = make_client("plc", roles[i]);

		db_secure_hello_write(&hello, bytes);
		assert_int_equal(db_secure_hello_read(bytes, &read), DB_SECURE_WRONG);
	}
	/* Another version, another kind, no port, bytes where nothing is. */
	for (size_t at = 0; at < 9; at++) {
		db_secure_hello_write(&good, bytes);
		bytes[at] = at == 7 ? 0 : (uint8_t)(bytes[at] + 7);
		if (at == 7)
			bytes[8] = 0;
		if (at != 8)
			assert_int_equal(db_secure_hello_read(bytes, &read), DB_SECURE_WRONG);
	}
	db_secure_hello_write(&good, bytes);
	bytes[DB_SECURE_HELLO_SIZE - 1] = 1;
	assert_int_equal(db_secure_hello_read(bytes, &read), DB_SECURE_WRONG);
	db_secure_hello_write(&good, bytes);
	bytes[9 + 16 + 32 + 8] = DB_SECURE_SERIAL_MAX + 1;
	assert_int_equal(db_secure_hello_read(bytes, &read), DB_SECURE_WRONG);
}

static void test_roles(void **state)
{
	(void)state;
	assert_true(db_secure_role_is_good("Operator"));
	assert_true(db_secure_role_is_good("01234567890123456789012345678901"));
	assert_false(db_secure_role_is_good("012345678901234567890123456789012"));
	assert_false(db_secure_role_is_good(""));
	assert_false(db_secure_role_is_good("a b"));
	assert_false(db_secure_role_is_good("a\x1F"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_client_there_and_back),
		cmocka_unit_test(test_status_there_and_back),
		cmocka_unit_test(test_form),
		cmocka_unit_test(test_what_is_none),
		cmocka_unit_test(test_roles),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
