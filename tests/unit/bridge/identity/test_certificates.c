/* SPDX-License-Identifier: Apache-2.0 */
/* Certificates and their numbers: the same again, names that outlive connections, room for all. */
#include "identity/certificates.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static struct db_secure_client make_client(unsigned number, uint8_t last)
{
	struct db_secure_client client = { .port = 1000, .role = "Reader" };

	memcpy(client.address + 10, (uint8_t[]){ 0xFF, 0xFF, 10, 0, 0, last }, 6);
	client.fingerprint[0] = 0x3F;
	client.fingerprint[3] = 0x01;
	client.fingerprint[30] = (uint8_t)(number >> 8);
	client.fingerprint[31] = (uint8_t)number;
	(void)snprintf(client.name, sizeof(client.name), "plc-%u", number);
	return client;
}

static const char *name_of(const struct db_certificates *certificates, const uint8_t address[16])
{
	const char *name;
	const char *role;

	assert_true(db_certificates_find(certificates, address, &name, &role));
	return name;
}

/* Each is its own, though the first bytes of their fingerprints are the same. */
static void test_numbers(void **state)
{
	struct db_certificates *certificates = db_certificates_new();
	struct db_secure_client one = make_client(1, 5), there = make_client(1, 6),
				two = make_client(2, 5);
	uint8_t first[16], elsewhere[16], second[16], again[16];
	char text[DB_CLIENT_ADDRESS_MAX];

	(void)state;
	assert_true(db_certificates_hold(certificates, &one, first));
	assert_true(db_certificates_hold(certificates, &there, elsewhere));
	assert_true(db_certificates_hold(certificates, &two, second));
	assert_true(db_client_same(first, elsewhere));
	assert_memory_not_equal(first, elsewhere, 16);
	assert_false(db_client_same(first, second));
	assert_int_equal(db_client_ipv4(first), 0x0A000005);
	assert_int_equal(db_client_ipv4(elsewhere), 0x0A000006);
	db_client_address(first, text);
	assert_string_equal(text, "10.0.0.5, certificate 3f000001");
	db_certificates_let_go(certificates, first);
	db_certificates_let_go(certificates, elsewhere);
	assert_string_equal(name_of(certificates, first), "plc-1");
	assert_string_equal(name_of(certificates, second), "plc-2");
	assert_true(db_certificates_hold(certificates, &one, again));
	assert_memory_equal(first, again, 16);
	db_certificates_free(certificates);
}

/* Those without connections give way, the ones that left first before others. */
static void test_room(void **state)
{
	struct db_certificates *certificates = db_certificates_new();
	struct db_secure_client client;
	uint8_t kept[16], addresses[2000][16];
	unsigned count = 0;

	(void)state;
	client = make_client(5000, 1);
	assert_true(db_certificates_hold(certificates, &client, kept));
	for (unsigned i = 0; i < 2000; i++) {
		client = make_client(i, 1);
		assert_true(db_certificates_hold(certificates, &client, addresses[i]));
		db_certificates_let_go(certificates, addresses[i]);
	}
	assert_string_equal(name_of(certificates, kept), "plc-5000");
	assert_string_equal(name_of(certificates, addresses[1999]), "plc-1999");
	/* All of them at the same time: then there is an end. */
	for (unsigned i = 0; i < 2000; i++) {
		client = make_client(i, 1);
		count += db_certificates_hold(certificates, &client, addresses[i]);
	}
	assert_in_range(count, 1023, 1300);
	assert_string_equal(name_of(certificates, kept), "plc-5000");
	db_certificates_free(certificates);
}

static void test_others(void **state)
{
	static const uint8_t network[16] = { [10] = 0xFF, 0xFF, 10, 0, 0, 1 };
	struct db_client_words words;
	const char *name;
	const char *role;
	uint8_t address[16];

	(void)state;
	assert_false(db_certificates_find(NULL, network, &name, &role));
	db_client_address_of_certificate(network, 0x12345678, address);
	assert_true(db_certificates_find(NULL, address, &name, &role));
	assert_string_equal(name, "");
	db_client_words_init_certificate(&words, address, name, role);
	assert_string_equal(words.address, "10.0.0.1, certificate 12345678");
	db_client_words_init_certificate(&words, address, "press-plc", "Operator");
	assert_string_equal(words.address, "10.0.0.1, certificate press-plc, role Operator");
	db_client_words_init_certificate(&words, address, "press-plc", "");
	assert_string_equal(words.address, "10.0.0.1, certificate press-plc");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_numbers),
		cmocka_unit_test(test_room),
		cmocka_unit_test(test_others),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
