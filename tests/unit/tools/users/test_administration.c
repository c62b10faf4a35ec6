/* SPDX-License-Identifier: Apache-2.0 */
/* Users made and removed on a command line: what it must say, and what is in the file then. */
#include "users/administration.h"

#include "users/password.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define PASSWORD "grease the lift on mondays"

static const struct db_users_keeper keeper = { .program = "test" };

static char folder[40];
static char path[64];
static char typed[64]; /* what stands in for a keyboard */

static int begin(void **state)
{
	(void)state;
	strcpy(folder, "/tmp/drivebridge-users-XXXXXX");
	assert_non_null(mkdtemp(folder));
	snprintf(path, sizeof(path), "%s/users", folder);
	snprintf(typed, sizeof(typed), "%s/typed", folder);
	return 0;
}

static int end(void **state)
{
	(void)state;
	(void)unlink(path);
	(void)unlink(typed);
	return rmdir(folder);
}

static int administer(const struct db_users_task *task, const char *input)
{
	FILE *file = fopen(typed, "w");

	assert_non_null(file);
	assert_true(fputs(input, file) >= 0);
	assert_int_equal(fclose(file), 0);
	assert_non_null(freopen(typed, "r", stdin));
	return db_users_administer(&keeper, path, 12, task);
}

static int add(const char *name, const char *role, const char *drives, const char *input)
{
	const struct db_users_task task = { .add = name, .role = role, .drives = drives };

	assert_int_equal(db_users_count_tasks(&task), 1);
	return administer(&task, input);
}

static size_t count_users(void)
{
	struct db_users users;
	size_t count;

	if (access(path, F_OK) != 0)
		return 0;
	assert_true(db_users_load(&users, path, &keeper, stderr));
	count = users.count;
	db_users_clear(&users);
	return count;
}

static void one_task_at_a_time_and_nobody_without_a_role(void **state)
{
	static const struct {
		struct db_users_task task;
		int tasks;
	} cases[] = {
		{ { .list = false }, 0 },
		{ { .list = true }, 1 },
		{ { .move = true }, 1 },
		{ { .remove = "anna" }, 1 },
		{ { .add = "anna", .role = "operator" }, 1 },
		{ { .add = "anna", .role = "reader", .drives = "lift", .pam = true }, 1 },
		{ { .add = "anna" }, -1 },
		{ { .add = "anna", .role = "boss" }, -1 },
		{ { .add = "anna", .role = "none" }, -1 },
		{ { .role = "operator" }, -1 },
		{ { .drives = "lift" }, -1 },
		{ { .pam = true }, -1 },
		{ { .remove = "anna", .drives = "lift" }, -1 },
		{ { .remove = "anna", .role = "operator" }, -1 },
		{ { .list = true, .move = true }, -1 },
		{ { .list = true, .remove = "anna" }, -1 },
		{ { .add = "anna", .role = "operator", .remove = "rudi" }, -1 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++)
		assert_int_equal(db_users_count_tasks(&cases[i].task), cases[i].tasks);
}

static void who_is_added_is_in_the_file(void **state)
{
	const struct db_user *anna;
	struct db_users users;

	(void)state;
	assert_int_equal(add("anna", "operator", "lift,feeder", PASSWORD "\n"), EXIT_SUCCESS);
	/* The end of a line may be missing, or be another system's. */
	assert_int_equal(add("rudi", "engineer", NULL, PASSWORD "\r\n"), EXIT_SUCCESS);
	assert_int_equal(add("eva", "reader", NULL, PASSWORD), EXIT_SUCCESS);
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_int_equal(users.count, 3);
	anna = db_users_find(&users, "anna");
	assert_int_equal(anna->grant.role, DB_ROLE_OPERATOR);
	assert_string_equal(anna->grant.drives, "lift,feeder");
	assert_false(anna->pam);
	assert_true(db_password_matches(anna->hash, PASSWORD));
	assert_int_equal(db_users_find(&users, "rudi")->grant.role, DB_ROLE_ENGINEER);
	assert_string_equal(db_users_find(&users, "rudi")->grant.drives, "*");
	assert_true(db_password_matches(db_users_find(&users, "rudi")->hash, PASSWORD));
	assert_true(db_password_matches(db_users_find(&users, "eva")->hash, PASSWORD));
	db_users_clear(&users);
}

/* PAM knows it: none is asked for. */
static void with_pam_no_password_is_needed(void **state)
{
	const struct db_users_task task = { .add = "anna", .role = "operator", .pam = true };
	struct db_users users;

	(void)state;
	assert_int_equal(administer(&task, ""), EXIT_SUCCESS);
	assert_true(db_users_load(&users, path, &keeper, stderr));
	assert_true(db_users_find(&users, "anna")->pam);
	db_users_clear(&users);
}

static void nobody_is_added_with_a_bad_password(void **state)
{
	static const char *const bad[] = { "", "\n", "short\n", "annaannaanna\n", "eleven char\n" };
	char text[400];

	(void)state;
	for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
		assert_int_equal(add("anna", "operator", NULL, bad[i]), EXIT_FAILURE);
	/* What is cut off would be another one. */
	for (size_t i = 0; i < sizeof(text) - 2; i++)
		text[i] = (char)('a' + i * i % 26);
	text[sizeof(text) - 2] = '\n';
	text[sizeof(text) - 1] = '\0';
	assert_int_equal(add("anna", "operator", NULL, text), EXIT_FAILURE);
	text[DB_PASSWORD_MAX + 1] = '\n';
	text[DB_PASSWORD_MAX + 2] = '\0';
	assert_int_equal(add("anna", "operator", NULL, text), EXIT_FAILURE);
	assert_int_equal(count_users(), 0);
	/* The longest one. */
	text[DB_PASSWORD_MAX] = '\n';
	text[DB_PASSWORD_MAX + 1] = '\0';
	assert_int_equal(add("anna", "operator", NULL, text), EXIT_SUCCESS);
	assert_int_equal(count_users(), 1);
}

static void names_and_drives_have_a_form(void **state)
{
	static const char *const names[] = { "", "-anna", "an na", "anna:x", "anna\n" };
	static const char *const drives[] = { "", ",", "lift,", "lift feeder", "lift:x", "lift,*" };

	(void)state;
	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++)
		assert_int_equal(add(names[i], "operator", NULL, PASSWORD "\n"), 2);
	for (size_t i = 0; i < sizeof(drives) / sizeof(drives[0]); i++)
		assert_int_equal(add("anna", "operator", drives[i], PASSWORD "\n"), 2);
	assert_int_equal(count_users(), 0);
}

static void who_is_removed_is_gone(void **state)
{
	(void)state;
	assert_int_equal(add("anna", "operator", NULL, PASSWORD "\n"), EXIT_SUCCESS);
	assert_int_equal(administer(&(struct db_users_task){ .remove = "rudi" }, ""), EXIT_FAILURE);
	assert_int_equal(count_users(), 1);
	assert_int_equal(administer(&(struct db_users_task){ .list = true }, ""), EXIT_SUCCESS);
	assert_int_equal(count_users(), 1);
	assert_int_equal(administer(&(struct db_users_task){ .remove = "anna" }, ""), EXIT_SUCCESS);
	assert_int_equal(count_users(), 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)
	const struct CMUnitTest tests[] = {
		TEST(one_task_at_a_time_and_nobody_without_a_role),
		TEST(who_is_added_is_in_the_file),
		TEST(with_pam_no_password_is_needed),
		TEST(nobody_is_added_with_a_bad_password),
		TEST(names_and_drives_have_a_form),
		TEST(who_is_removed_is_gone),
	};

	return cmocka_run_group_tests_name("users: on a command line", tests, NULL, NULL);
}
