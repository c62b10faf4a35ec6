/* SPDX-License-Identifier: Apache-2.0 */
#include "users/users.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

static const struct db_users_keeper keeper = { .program = "test", .group = "no-such-group" };

#define HASH "$y$j7T$abc$0123456789"

static void test_lines(void **state)
{
	static const char *const bad[] = {
		"anna",
		"anna:operator",
		"anna:operator:",
		"anna:operator:plain password",
		"anna:operator:!" HASH,
		"anna:operator:" HASH ":1",
		"anna:chief:" HASH,
		"anna:none:" HASH,
		":operator:" HASH,
		".anna:operator:" HASH,
		"an na:operator:" HASH,
		"anna-of-a-name-that-is-much-too-long:operator:" HASH,
		"anna:reader:" HASH "\nanna:reader:" HASH,
	};
	struct db_users users;
	char *said = NULL;
	size_t size = 0;
	FILE *out = open_memstream(&said, &size);

	(void)state;
	assert_true(db_users_parse(
		&users, "# who may\n\n  \nanna:operator:" HASH "\nrudi:reader:" HASH, "f", out));
	assert_int_equal(users.count, 2);
	assert_int_equal(db_users_find(&users, "anna")->role, DB_ROLE_OPERATOR);
	assert_string_equal(db_users_find(&users, "rudi")->hash, HASH);
	assert_null(db_users_find(&users, "ann"));
	assert_int_not_equal(db_users_digest(&users.list[0]), db_users_digest(&users.list[1]));
	db_users_clear(&users);
	(void)fflush(out);
	assert_int_equal(size, 0);
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
		assert_false(db_users_parse(&users, bad[i], "file", out));
		assert_true(users.count <= 1);
		db_users_clear(&users);
		(void)fflush(out);
		assert_non_null(strstr(said, "file:"));
		rewind(out);
	}
	(void)fclose(out);
	free(said);
}

static void test_a_file_is_changed_as_a_whole(void **state)
{
	char folder[] = "/tmp/drivebridge-users-XXXXXX";
	char path[64];
	struct db_users users;
	struct stat status;
	FILE *file;

	(void)state;
	assert_non_null(mkdtemp(folder));
	(void)snprintf(path, sizeof(path), "%s/users", folder);
	/* None is there: nobody is in it. */
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_int_equal(users.count, 0);
	db_users_clear(&users);
	assert_true(db_users_change(&keeper, path, "anna", DB_ROLE_OPERATOR, HASH, stderr));
	assert_true(db_users_change(&keeper, path, "ann", DB_ROLE_READER, HASH, stderr));
	assert_true(db_users_change(&keeper, path, "anna", DB_ROLE_READER, HASH, stderr));
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_int_equal(users.count, 2);
	assert_int_equal(db_users_find(&users, "anna")->role, DB_ROLE_READER);
	db_users_clear(&users);
	assert_int_equal(stat(path, &status), 0);
	assert_int_equal(status.st_mode & 0777, 0640);
	assert_true(db_users_change(&keeper, path, "anna", DB_ROLE_NONE, NULL, stderr));
	/* Lines of others, comments too, stay; the mode as well. */
	file = fopen(path, "a");
	assert_non_null(file);
	(void)fputs("# the end", file);
	(void)fclose(file);
	assert_int_equal(chmod(path, 0600), 0);
	assert_true(db_users_change(&keeper, path, "rudi", DB_ROLE_READER, HASH, stderr));
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_int_equal(users.count, 2);
	db_users_clear(&users);
	assert_int_equal(stat(path, &status), 0);
	assert_int_equal(status.st_mode & 0777, 0600);
	assert_int_equal(chmod(path, 0604), 0);
	assert_false(db_users_load(&users, path, &keeper, NULL));
	assert_int_equal(users.count, 0);
	db_users_clear(&users);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(rmdir(folder), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_lines),
		cmocka_unit_test(test_a_file_is_changed_as_a_whole),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
