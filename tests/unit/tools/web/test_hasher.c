/* SPDX-License-Identifier: Apache-2.0 */
#include "users/users.h"
#include "web/hasher.h"

#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static void test_passwords_are_compared_beside(void **state)
{
	struct db_web_hasher *hasher = db_web_hasher_new();
	char hash[sizeof(((struct db_user *)0)->hash)];
	char again[sizeof(hash)];
	unsigned rights = 0;
	uint64_t number;
	bool right;

	(void)state;
	assert_non_null(hasher);
	assert_true(db_users_hash("correct horse", hash, sizeof(hash)));
	assert_true(db_users_hash("correct horse", again, sizeof(again)));
	assert_string_not_equal(hash, again);
	assert_null(strstr(hash, "horse"));
	/* Strangers leave some places for browsers that are known. */
	for (uint64_t i = 0; i < DB_WEB_HASHER_JOBS; i++) {
		bool last = i >= DB_WEB_HASHER_JOBS - DB_WEB_HASHER_KNOWN;
		const char *password = i % 2 ? "correct horse" : "wrong";

		assert_int_equal(db_web_hasher_ask(hasher, i, password, hash, false), !last);
		assert_true(!last || db_web_hasher_ask(hasher, i, password, hash, true));
	}
	assert_false(db_web_hasher_ask(hasher, 9, "wrong", hash, true));
	for (unsigned answers = 0; answers < DB_WEB_HASHER_JOBS;) {
		struct pollfd fd = { .fd = db_web_hasher_fd(hasher), .events = POLLIN };

		assert_int_equal(poll(&fd, 1, 30000), 1);
		while (db_web_hasher_take(hasher, &number, &right)) {
			assert_int_equal(right, number % 2);
			rights += right;
			answers++;
		}
	}
	assert_int_equal(rights, DB_WEB_HASHER_JOBS / 2);
	/* What is no hash fits no password; ended while one is compared. */
	assert_true(db_web_hasher_ask(hasher, 1, "", "", false));
	assert_true(db_web_hasher_ask(hasher, 2, "correct horse", hash, false));
	db_web_hasher_free(hasher);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_passwords_are_compared_beside),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
