/* SPDX-License-Identifier: Apache-2.0 */
/* Address lists, users, roles of certificates, and the listening address. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <arpa/inet.h>
#include <errno.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivebridge/client.h"
#include "server/acl.h"
#include "server/listener.h"

static struct db_network network(const char *text, uint8_t prefix)
{
	struct db_network n = { .prefix = prefix };

	assert_int_equal(inet_pton(AF_INET6, text, n.address), 1);
	return n;
}

static enum db_access access_of(const struct db_modbus_config *config, const char *text)
{
	return db_acl_access(config, DB_ENDPOINT_FIRST, network(text, 128).address);
}

static void matches_prefixes(void **state)
{
	struct db_network lan = network("::ffff:192.168.10.0", 96 + 24);
	struct db_network odd = network("2001:db8:8000::", 33);
	struct db_network all = network("::", 0);

	(void)state;
	assert_true(db_acl_match(&lan, 1, network("::ffff:192.168.10.255", 128).address));
	assert_false(db_acl_match(&lan, 1, network("::ffff:192.168.11.0", 128).address));
	assert_false(db_acl_match(&lan, 1, network("::192.168.10.1", 128).address));
	assert_true(db_acl_match(&odd, 1, network("2001:db8:ffff::1", 128).address));
	assert_false(db_acl_match(&odd, 1, network("2001:db8:7fff::1", 128).address));
	assert_true(db_acl_match(&all, 1, network("::ffff:10.0.0.1", 128).address));
	assert_true(db_acl_match(&all, 1, all.address));
}

static void empty_lists(void **state)
{
	struct db_modbus_config config = { 0 };

	(void)state;
	assert_int_equal(access_of(&config, "::1"), DB_ACCESS_WRITE);
	assert_int_equal(access_of(&config, "::ffff:127.9.9.9"), DB_ACCESS_WRITE);
	assert_int_equal(access_of(&config, "::ffff:128.0.0.1"), DB_ACCESS_READ);
	assert_int_equal(access_of(&config, "2001:db8::1"), DB_ACCESS_READ);
}

static void both_lists(void **state)
{
	struct db_network readers = network("::ffff:10.0.0.0", 96 + 8);
	struct db_network writer = network("::ffff:192.168.10.5", 128);
	struct db_modbus_config config = {
		.allow_read = &readers,
		.allow_read_count = 1,
		.allow_write = &writer,
		.allow_write_count = 1,
	};

	(void)state;
	assert_int_equal(access_of(&config, "::ffff:192.168.10.5"), DB_ACCESS_WRITE);
	assert_int_equal(access_of(&config, "::ffff:10.1.2.3"), DB_ACCESS_READ);
	assert_int_equal(access_of(&config, "::ffff:127.0.0.1"), DB_ACCESS_NONE);
	assert_int_equal(access_of(&config, "::1"), DB_ACCESS_NONE);
}

static void peers(void **state)
{
	struct sockaddr_storage peer = { 0 };
	struct sockaddr_in v4 = { .sin_family = AF_INET, .sin_port = htons(77) };
	uint8_t address[16];
	uint16_t port;

	(void)state;
	v4.sin_addr.s_addr = htonl(0x01020304);
	memcpy(&peer, &v4, sizeof(v4));
	assert_true(db_acl_peer(&peer, address, &port));
	assert_int_equal(port, 77);
	assert_memory_equal(address, network("::ffff:1.2.3.4", 128).address, 16);
	peer.ss_family = AF_UNIX;
	assert_false(db_acl_peer(&peer, address, &port));
}

static void listen_addresses(void **state)
{
	static const char *const bad[] = {
		"",
		"502",
		":502",
		"127.0.0.1",
		"127.0.0.1:",
		"127.0.0.1:x",
		"127.0.0.1:-1",
		"127.0.0.1:+1",
		"127.0.0.1: 1",
		"127.0.0.1:999999",
		"a.b:0",
		"::1:0",
		"[::1]",
		"[]:502",
		"[::1:502",
		"::1]:502",
	};
	int fd;

	(void)state;
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
		assert_int_equal(db_listener_open(NULL, 0, bad[i]), -EINVAL);
	fd = db_listener_open(NULL, 0, "127.0.0.1:0");
	assert_true(fd >= 0);
	assert_int_not_equal(db_listener_port(fd), 0);
	close(fd);
}

/* Of a client with this network address; known by user 4711 of this machine if `local`. */
static enum db_access access_of_client(const struct db_modbus_config *config,
                                       const struct db_rights *rights, const char *text, bool local)
{
	struct db_network from = network(text, 128);
	uint8_t address[16];

	memcpy(address, from.address, sizeof(address));
	if (local)
		db_client_address_of_user(from.address, 4711, address);
	return db_acl_of_client(config, DB_ENDPOINT_FIRST, rights, from.address, address);
}

static void without_a_certificate(void **state)
{
	static const struct {
		enum db_require_secure require;
		enum db_access most;
	} rows[] = {
		{ DB_SECURE_NOT_REQUIRED, DB_ACCESS_WRITE },
		{ DB_SECURE_FOR_WRITES, DB_ACCESS_READ },
		{ DB_SECURE_FOR_ALL, DB_ACCESS_NONE },
	};
	struct db_network writer = network("::ffff:192.168.10.5", 128);
	struct db_network local = network("::1", 128);
	struct db_network writers[] = { writer, local };
	struct db_modbus_config config = { .allow_write = writers, .allow_write_count = 2 };
	/* Of user 4711, whom no file has. */
	const struct db_rights none = { .everybody_reads = false };
	const struct db_rights read = { .everybody_reads = true };
	const struct db_rights own = { .own = 4711 };

	(void)state;
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		config.require_secure = rows[i].require;
		/* Whatever the rights of users are, the network has its own. */
		assert_int_equal(access_of_client(&config, &none, "::ffff:192.168.10.5", false),
		                 rows[i].most);
		assert_int_equal(access_of_client(&config, NULL, "::ffff:192.168.10.6", false),
		                 rows[i].most < DB_ACCESS_READ ? rows[i].most : DB_ACCESS_READ);
		/* The kernel says who is on this machine, so these need no certificate. */
		assert_int_equal(access_of_client(&config, &own, "::1", true), DB_ACCESS_WRITE);
		assert_int_equal(access_of_client(&config, &read, "::1", true), DB_ACCESS_READ);
		assert_int_equal(access_of_client(&config, &none, "::1", true), DB_ACCESS_NONE);
		/* A user has no more than his address has. */
		assert_int_equal(access_of_client(&config, &own, "::ffff:192.168.10.6", true),
		                 DB_ACCESS_READ);
	}
}

static void with_a_certificate(void **state)
{
	char feeder[] = "feeder\0";
	struct db_role_config roles[] = {
		{ .name = (char[]){ "Reader" }, .read.all = true },
		{ .name = (char[]){ "Operator" }, .write.names = feeder },
		{ .name = (char[]){ "Claims" }, .control = true },
		{ .name = (char[]){ "All" }, .write.all = true },
	};
	static const struct {
		const char *role;
		int found; /* -1: none */
		enum db_access access;
	} rows[] = {
		{ "Reader", 0, DB_ACCESS_READ },   { "Operator", 1, DB_ACCESS_WRITE },
		{ "Claims", 2, DB_ACCESS_WRITE },  { "All", 3, DB_ACCESS_WRITE },
		{ "", -1, DB_ACCESS_READ },        { "operator", -1, DB_ACCESS_READ },
		{ "Operato", -1, DB_ACCESS_READ },
	};
	struct db_network writer = network("::ffff:192.168.10.0", 96 + 24);
	struct db_network reader = network("::ffff:192.168.11.0", 96 + 24);
	struct db_modbus_config config = { .allow_write = &writer,
		                           .allow_write_count = 1,
		                           .allow_read = &reader,
		                           .allow_read_count = 1,
		                           .roles = roles,
		                           .role_count = 4,
		                           .require_secure = DB_SECURE_FOR_ALL };
	const struct db_role_config *role;

	(void)state;
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		struct db_network from = network("::ffff:192.168.10.5", 128);

		assert_int_equal(db_acl_of_certificate(&config, DB_ENDPOINT_FIRST, from.address,
		                                       rows[i].role, &role),
		                 rows[i].access);
		assert_ptr_equal(role, rows[i].found < 0 ? NULL : &roles[rows[i].found]);
		/* A role gives no address more than it has. */
		from = network("::ffff:192.168.11.5", 128);
		assert_int_equal(db_acl_of_certificate(&config, DB_ENDPOINT_FIRST, from.address,
		                                       rows[i].role, &role),
		                 DB_ACCESS_READ);
		from = network("::ffff:192.168.12.5", 128);
		assert_int_equal(db_acl_of_certificate(&config, DB_ENDPOINT_FIRST, from.address,
		                                       rows[i].role, &role),
		                 DB_ACCESS_NONE);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(matches_prefixes),   cmocka_unit_test(empty_lists),
		cmocka_unit_test(both_lists),         cmocka_unit_test(peers),
		cmocka_unit_test(listen_addresses),   cmocka_unit_test(without_a_certificate),
		cmocka_unit_test(with_a_certificate),
	};

	return cmocka_run_group_tests_name("server/acl", tests, NULL, NULL);
}
