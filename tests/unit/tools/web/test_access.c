/* SPDX-License-Identifier: Apache-2.0 */
/* Who may ask: addresses, names, origins, paths, sessions, attempts. */
#include "web/address.h"
#include "web/attempts.h"
#include "web/device.h"
#include "web/origin.h"
#include "web/route.h"
#include "web/sessions.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static void test_hosts(void **state)
{
	static char names[] = "gateway.example\0press-7\0";
	const struct db_setting_list hosts = { DB_SETTING_NAMED, names };
	static const char *const good[] = { "127.0.0.1", "127.0.0.1:8080",
		                            "localhost", "LocalHost:80",
		                            "[::1]",     "[fd00::7]:8080",
		                            "press-7",   "Gateway.Example:443" };
	static const char *const bad[] = { "",
		                           ":80",
		                           "evil.example",
		                           "gateway.example.evil",
		                           "press-7.evil",
		                           "127.0.0.1.evil",
		                           "127.0.0.1:80:80",
		                           "127.0.0.1:",
		                           "127.0.0.1:port",
		                           "127.0.0.1:808080",
		                           "::1",
		                           "[::1",
		                           "[]",
		                           "[::1]x",
		                           "a@127.0.0.1",
		                           "127.0.0.1/",
		                           "localhost " };

	(void)state;
	for (size_t i = 0; i < sizeof(good) / sizeof(good[0]); i++)
		assert_true(db_web_host_is_good(good[i], &hosts));
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
		assert_false(db_web_host_is_good(bad[i], &hosts));
	assert_false(db_web_host_is_good(NULL, &hosts));
	assert_false(db_web_host_is_good("press-7", &(struct db_setting_list){ 0, NULL }));
}

static void test_origins(void **state)
{
	(void)state;
	assert_true(db_web_origin_is_good(NULL, "gw:8080"));
	assert_true(db_web_origin_is_good("http://gw:8080", "gw:8080"));
	assert_true(db_web_origin_is_good("https://GW", "gw"));
	assert_false(db_web_origin_is_good("http://gw", "gw:8080"));
	assert_false(db_web_origin_is_good("http://gw:8080.evil", "gw:8080"));
	assert_false(db_web_origin_is_good("null", "gw"));
	assert_false(db_web_origin_is_good("", "gw"));
	assert_false(db_web_origin_is_good("gw", "gw"));
	assert_false(db_web_origin_is_good("ftp://gw", "gw"));
	assert_false(db_web_origin_is_good("http://gw", NULL));
}

static void test_networks(void **state)
{
	static char names[] = "192.168.10.0/24\0fd00::/8\0"
			      "10.0.0.7\0";
	const struct db_setting_list list = { DB_SETTING_NAMED, names };
	static const char *const in[] = { "192.168.10.1", "192.168.10.255", "fd12::1", "10.0.0.7" };
	static const char *const out[] = { "192.168.11.1", "fe80::1", "10.0.0.8", "::1" };
	static const char *const bad[] = { "",          "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1",
		                           "10.0.0",    "::/129",      "/8",        "10.0.0.0/8x",
		                           "localhost", "10.0.0.0/ 8" };
	struct db_web_address address;
	struct sockaddr_storage endpoint;
	socklen_t size;

	(void)state;
	for (size_t i = 0; i < sizeof(in) / sizeof(in[0]); i++) {
		assert_true(db_web_address_parse(in[i], &address));
		assert_true(db_web_networks_have(&list, &address));
		assert_true(db_web_address_parse(out[i], &address));
		assert_false(db_web_networks_have(&list, &address));
	}
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
		assert_false(db_web_network_is_good(bad[i]));
	assert_true(db_web_network_is_good("0.0.0.0/0"));
	assert_true(db_web_address_parse("127.9.9.9", &address));
	assert_true(db_web_address_is_local(&address));
	assert_true(db_web_address_parse("::1", &address));
	assert_true(db_web_address_is_local(&address));
	assert_true(db_web_address_parse("::2", &address));
	assert_false(db_web_address_is_local(&address));
	assert_true(db_web_endpoint_parse("[::]:8080", &endpoint, &size));
	assert_true(db_web_endpoint_parse("0.0.0.0:0", &endpoint, &size));
	assert_false(db_web_endpoint_parse("8080", &endpoint, &size));
	assert_false(db_web_endpoint_parse(":8080", &endpoint, &size));
	assert_false(db_web_endpoint_parse("::1:8080", &endpoint, &size));
	assert_false(db_web_endpoint_parse("[::1]", &endpoint, &size));
	assert_false(db_web_endpoint_parse("127.0.0.1:65536", &endpoint, &size));
	assert_false(db_web_endpoint_parse("127.0.0.1:80x", &endpoint, &size));
}

static void test_routes(void **state)
{
	struct db_web_route route;

	(void)state;
	route = db_web_route_find("GET", "/");
	assert_int_equal(route.kind, DB_WEB_FILE);
	assert_string_equal(route.name, "index.html");
	assert_int_equal(db_web_route_find("HEAD", "/app.js").kind, DB_WEB_FILE);
	assert_int_equal(db_web_route_find("GET", "/a/b").kind, DB_WEB_UNKNOWN);
	assert_int_equal(db_web_route_find("GET", "nothing").kind, DB_WEB_UNKNOWN);
	assert_int_equal(db_web_route_find("PUT", "/api/session").kind, DB_WEB_WRONG_METHOD);
	assert_int_equal(db_web_route_find("GET", "/api/login").kind, DB_WEB_WRONG_METHOD);
	assert_int_equal(db_web_route_find("POST", "/api/call/").kind, DB_WEB_UNKNOWN);
	assert_int_equal(db_web_route_find("POST", "/api/call/Metrics").kind, DB_WEB_UNKNOWN);
	route = db_web_route_find("POST", "/api/call/Run");
	assert_int_equal(route.needs, DB_MAY_STOP);
	assert_true(route.acts);
	assert_int_equal(db_web_route_find("POST", "/api/stream/Scan").needs, DB_MAY_MANAGE);
	assert_int_equal(db_web_route_find("POST", "/api/call/Read").needs, DB_MAY_LOOK);
	assert_int_equal(db_web_route_find("POST", "/api/call/Audit").kind, DB_WEB_UNKNOWN);
	assert_int_equal(db_web_route_find("POST", "/api/audit").needs, DB_MAY_AUDIT);
	assert_int_equal(db_web_route_find("GET", "/api/audit.cef").needs, DB_MAY_AUDIT);
}

static const struct db_web_session *begin(struct db_web_sessions *sessions, unsigned number,
                                          db_time now)
{
	const struct db_web_address from = { .bytes = { 1 } };
	struct db_web_secret secrets[2] = { { { 0 } } };
	struct db_user user = { .name = "anna",
		                .grant = { .role = DB_ROLE_OBSERVER, .drives = "*" } };

	(void)snprintf((char *)secrets[0].bytes, sizeof(secrets[0].bytes), "id %u", number);
	(void)snprintf((char *)secrets[1].bytes, sizeof(secrets[1].bytes), "token %u", number);
	(void)snprintf(user.hash, sizeof(user.hash), "%u", number);
	return db_web_sessions_begin(sessions, &user, NULL, &from, secrets, now);
}

/* Of the users that begin() has made, the digest of this one. */
static bool is_kept(void *context, const struct db_web_session *session)
{
	return session->hash == *(unsigned long *)context;
}

static void test_sessions(void **state)
{
	struct db_web_sessions *sessions = db_web_sessions_new(60 * DB_NS_PER_S, 600 * DB_NS_PER_S);
	char ids[DB_WEB_SESSIONS_MAX + 1][DB_WEB_SECRET_TEXT];
	const struct db_web_session *found[DB_WEB_SESSIONS_MAX];
	struct db_user user;
	unsigned long kept;
	const struct db_web_session *session = begin(sessions, 1, 0);

	(void)state;
	assert_string_equal(session->user, "anna");
	assert_string_not_equal(session->id, session->token);
	assert_true(db_web_secret_is_good(session->id));
	memcpy(ids[0], session->id, sizeof(ids[0]));
	assert_null(db_web_sessions_find(sessions, "", 0));
	assert_null(db_web_sessions_find(sessions, session->token, 0));
	/* It lasts while it is used, but not for ever. */
	for (db_time now = 0; now < 600 * DB_NS_PER_S; now += 50 * DB_NS_PER_S) {
		assert_non_null(db_web_sessions_find(sessions, ids[0], now));
		db_web_sessions_touch(sessions, ids[0], now);
	}
	assert_null(db_web_sessions_find(sessions, ids[0], 600 * DB_NS_PER_S));
	session = begin(sessions, 2, 0);
	memcpy(ids[0], session->id, sizeof(ids[0]));
	assert_non_null(db_web_sessions_find(sessions, ids[0], 60 * DB_NS_PER_S - 1));
	assert_null(db_web_sessions_find(sessions, ids[0], 60 * DB_NS_PER_S));
	assert_null(db_web_sessions_find(sessions, ids[0], 1));

	/* Of too many the one that was used longest ago goes. */
	for (unsigned i = 0; i <= DB_WEB_SESSIONS_MAX; i++) {
		session = begin(sessions, 10 + i, 1000 + i);
		memcpy(ids[i], session->id, sizeof(ids[i]));
		if (i == 1)
			db_web_sessions_touch(sessions, ids[0], 5000);
	}
	assert_non_null(db_web_sessions_find(sessions, ids[0], 5000));
	assert_null(db_web_sessions_find(sessions, ids[1], 5000));
	assert_non_null(db_web_sessions_find(sessions, ids[DB_WEB_SESSIONS_MAX], 5000));
	db_web_sessions_end(sessions, ids[2]);
	assert_null(db_web_sessions_find(sessions, ids[2], 5000));
	/* Each of his own, and nobody else's. */
	assert_int_equal(db_web_sessions_of(sessions, "olga", 5000, found), 0);
	assert_int_equal(db_web_sessions_of(sessions, "anna", 5000, found),
	                 DB_WEB_SESSIONS_MAX - 1);
	for (size_t i = 1; i < DB_WEB_SESSIONS_MAX - 1; i++)
		assert_true(found[i - 1]->number < found[i]->number);
	assert_string_equal(found[0]->id, ids[0]);
	assert_int_equal(found[0]->from.bytes[0], 1);
	assert_int_equal(db_web_sessions_of(sessions, "anna", 60 * DB_NS_PER_S + 5000, found), 0);
	/* Whoever gives himself another password stays, and no other session of his. */
	user = (struct db_user){ .name = "anna", .hash = "fresh" };
	kept = db_users_digest(&user);
	db_web_sessions_renew(sessions, ids[4], &user);
	db_web_sessions_review(sessions, is_kept, &kept);
	assert_null(db_web_sessions_find(sessions, ids[3], 5000));
	assert_non_null(db_web_sessions_find(sessions, ids[4], 5000));
	db_web_sessions_free(sessions);

	assert_true(db_web_secret_equal(ids[3], ids[3]));
	assert_false(db_web_secret_equal(ids[3], ids[4]));
	assert_false(db_web_secret_equal("", ""));
}

static struct db_web_attempt attempt_at(const char *address, const char *user)
{
	struct db_web_attempt attempt = { .user = user, .device = "" };

	assert_true(db_web_address_parse(address, &attempt.address));
	return attempt;
}

static void test_attempts_are_limited(void **state)
{
	struct db_attempts attempts = { .seed = 7 };
	struct db_web_attempt here = attempt_at("192.168.1.5", "anna");
	struct db_web_attempt other = attempt_at("192.168.1.5", "olga");
	struct db_web_attempt there = attempt_at("fd00::1", "anna");
	struct db_web_attempt others = attempt_at("fd00::1", "olga");
	struct db_web_attempt beside = attempt_at("fd00::2", "another");
	db_time now = 0;

	(void)state;
	for (unsigned i = 0; i < DB_WEB_ATTEMPTS_AT_ONCE; i++)
		assert_int_equal(db_web_attempts_take(&attempts, &here, now), 0);
	assert_int_equal(db_web_attempts_take(&attempts, &here, now), DB_WEB_ATTEMPT_USER_EVERY);
	/* Neither another name nor another address helps; others are not concerned. */
	assert_int_equal(db_web_attempts_take(&attempts, &other, now), DB_WEB_ATTEMPT_EVERY);
	assert_true(db_web_attempts_take(&attempts, &there, now) > 0);
	assert_int_equal(db_web_attempts_take(&attempts, &others, now), 0);
	/* One each so often, and not more for having been refused. */
	for (unsigned i = 0; i < 5; i++) {
		now += DB_WEB_ATTEMPT_USER_EVERY;
		assert_int_equal(db_web_attempts_take(&attempts, &here, now), 0);
		assert_true(db_web_attempts_take(&attempts, &here, now) > 0);
	}
	/* What was right does not count. */
	now += 3600 * DB_NS_PER_S;
	for (unsigned i = 0; i < 100; i++) {
		assert_int_equal(db_web_attempts_take(&attempts, &here, now), 0);
		db_web_attempts_give_back(&attempts, &here);
	}
	/* All addresses of a network of IPv6 count as one. */
	for (unsigned i = 0; i < DB_WEB_ATTEMPTS_AT_ONCE; i++) {
		char name[16];

		(void)snprintf(name, sizeof(name), "user%u", i);
		there.user = name;
		assert_int_equal(db_web_attempts_take(&attempts, &there, now), 0);
	}
	assert_true(db_web_attempts_take(&attempts, &beside, now) > 0);
}

static void test_a_known_browser_has_attempts_of_its_own(void **state)
{
	struct db_attempts attempts = { .seed = 7 };
	struct db_web_attempt stranger = attempt_at("192.168.1.66", "anna");
	struct db_web_attempt known = attempt_at("192.168.1.66", "anna");
	db_time now = 0;

	(void)state;
	known.device = "0123456789abcdef0123456789abcdef";
	while (db_web_attempts_take(&attempts, &stranger, now) == 0)
		now++;
	for (unsigned i = 0; i < DB_WEB_ATTEMPTS_AT_ONCE; i++)
		assert_int_equal(db_web_attempts_take(&attempts, &known, now), 0);
	assert_true(db_web_attempts_take(&attempts, &known, now) > 0);
}

static void test_a_proxy_that_invents_addresses_is_limited(void **state)
{
	struct db_attempts attempts = { .seed = 7 };
	struct db_web_address proxy;
	unsigned count = 0;

	(void)state;
	assert_true(db_web_address_parse("127.0.0.1", &proxy));
	for (unsigned i = 0; i < 200; i++) {
		struct db_web_attempt attempt = { .proxy = &proxy, .device = "" };
		char user[16];

		memset(attempt.address.bytes, (int)i, sizeof(attempt.address.bytes));
		(void)snprintf(user, sizeof(user), "user%u", i);
		attempt.user = user;
		count += db_web_attempts_take(&attempts, &attempt, 0) == 0;
	}
	assert_int_equal(count, DB_WEB_ATTEMPTS_PROXY_AT_ONCE);
}

static void test_attempts_of_very_many_are_bounded(void **state)
{
	struct db_attempts attempts = { .seed = 9 };
	struct db_web_attempt here = attempt_at("192.168.1.5", "anna");
	struct db_web_attempt other = attempt_at("10.0.0.0", "");

	(void)state;
	for (unsigned i = 0; i < DB_WEB_ATTEMPTS_AT_ONCE; i++)
		assert_int_equal(db_web_attempts_take(&attempts, &here, 0), 0);
	for (unsigned i = 0; i < 4 * DB_ATTEMPTS_PLACES; i++) {
		char name[16];

		other.address.bytes[14] = (unsigned char)(i >> 8);
		other.address.bytes[15] = (unsigned char)i;
		(void)snprintf(name, sizeof(name), "user%u", i);
		other.user = name;
		(void)db_web_attempts_take(&attempts, &other, 0);
	}
	/* Who is limited most is not forgotten for them. */
	assert_true(db_web_attempts_take(&attempts, &here, 0) > 0);
}

static void test_a_browser_proves_who_has_logged_in_with_it(void **state)
{
	static const char hash[] = "$y$j9T$abc$def";
	struct db_web_secret number = { { 1, 2, 3 } };
	char text[DB_WEB_DEVICE_TEXT];
	char name[DB_WEB_DEVICE_NAME];
	char other[DB_WEB_DEVICE_NAME];
	char id[DB_WEB_SECRET_TEXT];

	(void)state;
	assert_true(db_web_device_write(&number, "anna", hash, text));
	assert_int_equal(strlen(text), DB_WEB_DEVICE_TEXT - 1);
	assert_true(db_web_device_read(text, "anna", hash, id));
	assert_string_equal(id, "01020300000000000000000000000000");
	/* nobody else, and with no other password */
	assert_false(db_web_device_read(text, "olga", hash, id));
	assert_false(db_web_device_read(text, "anna", "$y$j9T$abc$deg", id));
	for (size_t i = 0; i < strlen(text); i++) {
		char before = text[i];

		text[i] = before == 'f' ? '0' : 'f';
		assert_false(db_web_device_read(text, "anna", hash, id));
		text[i] = before;
	}
	text[strlen(text) - 1] = '\0';
	assert_false(db_web_device_read(text, "anna", hash, id));
	assert_false(db_web_device_read("", "anna", hash, id));
	assert_false(db_web_device_write(&number, "anna", "", text));
	db_web_device_name("anna", true, name);
	db_web_device_name("olga", true, other);
	assert_string_not_equal(name, other);
	assert_memory_equal(name, "__Host-drivebridge-device-", 26);
	assert_null(strstr(name, "anna"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_hosts),
		cmocka_unit_test(test_origins),
		cmocka_unit_test(test_networks),
		cmocka_unit_test(test_routes),
		cmocka_unit_test(test_sessions),
		cmocka_unit_test(test_attempts_are_limited),
		cmocka_unit_test(test_a_known_browser_has_attempts_of_its_own),
		cmocka_unit_test(test_a_proxy_that_invents_addresses_is_limited),
		cmocka_unit_test(test_a_browser_proves_who_has_logged_in_with_it),
		cmocka_unit_test(test_attempts_of_very_many_are_bounded),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
