/* SPDX-License-Identifier: Apache-2.0 */
/* Hashes of passwords, and why a new password is not good enough. */
#include "users/password.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#define PASSWORD "grease the lift on mondays"

static void a_hash_is_of_one_password(void **state)
{
	static const char *const others[] = { "",
		                              "grease",
		                              PASSWORD " ",
		                              "Grease the lift on mondays",
		                              "grease the lift on monday",
		                              "*0" };
	char hash[DB_PASSWORD_HASH_MAX + 1];

	(void)state;
	assert_true(db_password_hash(PASSWORD, hash));
	assert_true(db_password_is_hash(hash));
	assert_null(strstr(hash, "grease"));
	assert_true(db_password_matches(hash, PASSWORD));
	for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++)
		assert_false(db_password_matches(hash, others[i]));
}

/* Whoever has two files of hashes sees nothing of what is the same in them. */
static void each_hash_has_a_salt_of_its_own(void **state)
{
	char one[DB_PASSWORD_HASH_MAX + 1];
	char other[DB_PASSWORD_HASH_MAX + 1];

	(void)state;
	assert_true(db_password_hash(PASSWORD, one));
	assert_true(db_password_hash(PASSWORD, other));
	assert_string_not_equal(one, other);
	assert_true(db_password_matches(other, PASSWORD));
	/* A part of one, or one with something behind it, is none. */
	strcat(other, "x");
	assert_false(db_password_matches(other, PASSWORD));
	other[strlen(other) - 3] = '\0';
	assert_false(db_password_matches(other, PASSWORD));
}

static void what_is_no_hash_is_nobodys(void **state)
{
	static const char *const none[] = {
		"", "*", "*0", "!", "x", "$", "$nosuch$aaaaaaaa$bbbb", PASSWORD
	};

	(void)state;
	for (size_t i = 0; i < sizeof(none) / sizeof(none[0]); i++) {
		assert_false(db_password_matches(none[i], PASSWORD));
		assert_false(db_password_matches(none[i], none[i]));
		assert_false(db_password_matches(none[i], ""));
	}
}

static void a_hash_has_a_form(void **state)
{
	static const char forbidden[] = ":;*!\\ \t\n\x7f\x80";
	char text[DB_PASSWORD_HASH_MAX + 3];

	(void)state;
	memset(text, 'a', sizeof(text));
	text[0] = '$';
	text[DB_PASSWORD_HASH_MAX + 1] = '\0';
	assert_false(db_password_is_hash(text));
	text[DB_PASSWORD_HASH_MAX] = '\0';
	assert_true(db_password_is_hash(text));
	text[13] = '\0';
	assert_true(db_password_is_hash(text));
	for (size_t i = 0; i + 1 < sizeof(forbidden); i++) {
		text[12] = forbidden[i];
		assert_false(db_password_is_hash(text));
	}
	text[12] = '~';
	assert_true(db_password_is_hash(text));
	text[12] = '\0';
	assert_false(db_password_is_hash(text));
	assert_false(db_password_is_hash("aaaaaaaaaaaaaaaa"));
	assert_false(db_password_is_hash(""));
}

/* Each reason is one that the user can do something about. */
static void a_bad_password_is_told_why(void **state)
{
	static const char row[] = "it is a row, or one piece again and again";
	static const char name[] = "it is made of the user's name";
	static const char common[] = "it is one that everybody tries first";
	static const struct {
		const char *password;
		const char *wrong; /* NULL: nothing */
	} cases[] = {
		{ "eleven char", "it is too short" },
		{ "eleven chars", NULL },
		{ "12anna3-anna", name },
		{ "1annaanna234", name },
		{ "annaanna-lift", name },
		{ "annaanna-lifts", NULL },
		{ "ANNAannaAnna", name },
		{ "aaaaaaaaaaaa", row },
		{ "bcdefghijklm", row },
		{ "mlkjihgfedcb", row },
		{ "456789012345", row },
		{ "432109876543", row },
		{ "acegikmoqsuw", NULL },
		{ "liftliftlift", row },
		{ "lift9lift9lift9", row },
		{ "机器停止机器停止机器停止", row },
		{ "grease liftgrease lift", row },
		{ "grease liftsgrease lifts", NULL }, /* one of them would do */
		{ "qwerty123456", common },
		{ "__P4$$w0rd__", common },
		{ "12siemens!!34", common },
	};
	char text[DB_PASSWORD_MAX + 2];

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		const char *wrong = db_password_judge(cases[i].password, "Anna", 12);

		assert_string_equal(wrong ? wrong : "good",
		                    cases[i].wrong ? cases[i].wrong : "good");
	}
	for (size_t i = 0; i < sizeof(text) - 1; i++)
		text[i] = (char)('a' + i * i % 26);
	text[DB_PASSWORD_MAX + 1] = '\0';
	assert_string_equal(db_password_judge(text, "anna", 12), "it is too long");
	text[DB_PASSWORD_MAX] = '\0';
	assert_null(db_password_judge(text, "anna", 12));
	/* Twice is again and again, too. */
	assert_string_equal(db_password_judge("liftlift", "anna", 8), row);
	assert_null(db_password_judge("liftlifs", "anna", 8));
	/* Nobody is called so: then no name is in it. */
	assert_null(db_password_judge("the annas lift", "", 12));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_hash_is_of_one_password),
		cmocka_unit_test(each_hash_has_a_salt_of_its_own),
		cmocka_unit_test(what_is_no_hash_is_nobodys),
		cmocka_unit_test(a_hash_has_a_form),
		cmocka_unit_test(a_bad_password_is_told_why),
	};

	return cmocka_run_group_tests_name("users: passwords", tests, NULL, NULL);
}
