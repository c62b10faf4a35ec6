/* SPDX-License-Identifier: Apache-2.0 */
#include "web/hasher.h"

#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static struct db_web_work wait_for(struct db_web_hasher *hasher)
{
	struct pollfd fd = { .fd = db_web_hasher_fd(hasher), .events = POLLIN };
	struct db_web_work work = { .number = 0 };

	assert_int_equal(poll(&fd, 1, 30000), 1);
	assert_true(db_web_hasher_take(hasher, &work));
	return work;
}

static void test_passwords_are_compared_beside(void **state)
{
	struct db_web_hasher *hasher = db_web_hasher_new();
	struct db_web_work work = { .compares = true, .pam_folder = "" };
	char again[DB_PASSWORD_HASH_MAX + 1];
	unsigned rights = 0;

	(void)state;
	assert_non_null(hasher);
	assert_true(db_password_hash("correct horse", work.user.hash));
	assert_true(db_password_hash("correct horse", again));
	assert_string_not_equal(work.user.hash, again);
	assert_null(strstr(work.user.hash, "horse"));
	/* Strangers leave some places for browsers that are known. */
	for (uint64_t i = 0; i < DB_WEB_HASHER_JOBS; i++) {
		bool last = i >= DB_WEB_HASHER_JOBS - DB_WEB_HASHER_KNOWN;

		work.number = i;
		(void)strcpy(work.password, i % 2 ? "correct horse" : "wrong");
		assert_int_equal(db_web_hasher_ask(hasher, &work, false), !last);
		assert_true(!last || db_web_hasher_ask(hasher, &work, true));
	}
	assert_false(db_web_hasher_ask(hasher, &work, true));
	for (unsigned answers = 0; answers < DB_WEB_HASHER_JOBS;) {
		struct pollfd fd = { .fd = db_web_hasher_fd(hasher), .events = POLLIN };
		struct db_web_work done;

		assert_int_equal(poll(&fd, 1, 30000), 1);
		while (db_web_hasher_take(hasher, &done)) {
			assert_int_equal(done.right, done.number % 2);
			assert_string_equal(done.password, "");
			rights += done.right;
			answers++;
		}
	}
	assert_int_equal(rights, DB_WEB_HASHER_JOBS / 2);
	/* What is no hash fits no password; ended while one is compared. */
	assert_true(db_web_hasher_ask(hasher, &work, false));
	db_web_hasher_free(hasher);
}

static void test_users_are_changed_beside(void **state)
{
	char folder[] = "/tmp/drivebridge-hasher-XXXXXX";
	char path[64];
	struct db_web_hasher *hasher = db_web_hasher_new();
	struct db_web_work work = { .change = DB_WEB_CHANGE_PUT, .pam_folder = "", .path = path };
	struct db_web_work own;
	struct db_user now = { .pam = false };

	(void)state;
	assert_non_null(mkdtemp(folder));
	(void)snprintf(path, sizeof(path), "%s/users", folder);
	work.fresh = (struct db_user){ .name = "anna",
		                       .grant = { .role = DB_ROLE_OPERATOR, .drives = "*" } };
	(void)strcpy(work.fresh_password, "her first word");
	assert_true(db_web_hasher_ask(hasher, &work, true));
	work = wait_for(hasher);
	assert_true(work.right && work.done);
	assert_true(db_password_matches(work.fresh.hash, "her first word"));

	/* With a wrong password nothing is changed; with the right one it is, once: behind that the
	 * user is another one. */
	own = work;
	own.compares = true;
	own.known = true;
	own.user = own.fresh;
	for (unsigned i = 0; i < 3; i++) {
		struct db_web_work done;

		(void)strcpy(own.password, i == 0 ? "not her word" : "her first word");
		(void)strcpy(own.fresh_password, "her second word");
		assert_true(db_web_hasher_ask(hasher, &own, true));
		done = wait_for(hasher);
		assert_int_equal(done.right, i > 0);
		assert_int_equal(done.done, i == 1);
		now = i == 1 ? done.fresh : now;
		assert_int_equal(strstr(done.why, "changed meanwhile") != NULL, i == 2);
	}
	/* Nor is one put who is there already, nor removed as the one she was. */
	for (unsigned i = 0; i < 2; i++) {
		assert_true(db_web_hasher_ask(hasher, &work, true));
		own = wait_for(hasher);
		assert_false(own.done);
		assert_non_null(strstr(own.why, "changed meanwhile"));
		work.change = DB_WEB_CHANGE_REMOVE;
		work.known = true;
		work.user = work.fresh;
	}
	work.user = now;
	assert_true(db_web_hasher_ask(hasher, &work, true));
	assert_true(wait_for(hasher).done);
	work.known = false;
	assert_true(db_web_hasher_ask(hasher, &work, true));
	own = wait_for(hasher);
	assert_false(own.done);
	assert_non_null(strstr(own.why, "no user anna"));
	/* In somebody's name who is not there. */
	(void)strcpy(work.by, "ada");
	work.change = DB_WEB_CHANGE_PUT;
	assert_true(db_web_hasher_ask(hasher, &work, true));
	own = wait_for(hasher);
	assert_false(own.done);
	assert_non_null(strstr(own.why, "ada is no administrator any more"));
	db_web_hasher_free(hasher);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(rmdir(folder), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_passwords_are_compared_beside),
		cmocka_unit_test(test_users_are_changed_beside),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
