/* SPDX-License-Identifier: Apache-2.0 */
/* The role of a certificate: one UTF8String of 1 to 32 visible bytes, and nothing else. */
#include "tls/role.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static bool reads(const char *value, size_t size, const char *role)
{
	char found[DB_SECURE_ROLE_MAX + 1] = "before";
	bool good = db_tls_role_read((const uint8_t *)value, size, found);

	assert_string_equal(found, role);
	return good;
}

static void test_roles(void **state)
{
	(void)state;
	assert_true(reads("\x0C\x08Operator", 10, "Operator"));
	assert_true(reads("\x0C\x01x", 3, "x"));
	assert_true(reads("\x0C\x20"
	                  "01234567890123456789012345678901",
	                  34, "01234567890123456789012345678901"));
}

static void test_what_is_none(void **state)
{
	(void)state;
	assert_false(reads("", 0, ""));
	assert_false(reads("\x0C", 1, ""));
	assert_false(reads("\x0C\x00", 2, ""));
	assert_false(reads("\x0C\x21"
	                   "012345678901234567890123456789012",
	                   35, ""));
	assert_false(reads("\x16\x08Operator", 10, ""));         /* IA5String */
	assert_false(reads("\x13\x08Operator", 10, ""));         /* PrintableString */
	assert_false(reads("\x0C\x08Operator\x00", 11, ""));     /* something behind it */
	assert_false(reads("\x0C\x81\x08Operator", 11, ""));     /* not the shortest length */
	assert_false(reads("\x0C\x80Operator\x00\x00", 12, "")); /* no length at all */
	assert_false(reads("\x0C\x09Operator", 10, ""));
	assert_false(reads("\x0C\x07Operator", 10, ""));
	assert_false(reads("\x0C\x08Oper tor", 10, ""));
	assert_false(reads("\x0C\x08Oper\0tor", 10, ""));
	assert_false(reads("\x0C\x08Oper\ntor", 10, ""));
	assert_false(reads("\x0C\x09Oper\xC3\xA4tor", 11, ""));
	assert_false(reads("\x30\x0A\x0C\x08Operator", 12, ""));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_roles),
		cmocka_unit_test(test_what_is_none),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
