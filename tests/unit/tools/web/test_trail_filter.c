/* SPDX-License-Identifier: Apache-2.0 */
/* Which records of the audit trail a page asks for, and which of them its user may see. */
#include "web/trail_filter.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

static struct db_web_trail_filter filter_of(const char *text)
{
	struct db_web_trail_filter filter = { .grant = { DB_ROLE_ENGINEER, false, "*" } };
	json_t *parameters = json_loads(text, 0, NULL);

	assert_non_null(parameters);
	assert_true(db_web_trail_filter_read(&filter, parameters));
	json_decref(parameters);
	return filter;
}

static bool has(const struct db_web_trail_filter *filter, const char *text)
{
	json_t *record = json_loads(text, 0, NULL);
	bool found;

	assert_non_null(record);
	found = db_web_trail_filter_has(filter, record);
	json_decref(record);
	return found;
}

static void test_reading(void **state)
{
	static const char *const wrong[] = {
		"{\"who\": 1}",
		"{\"drive\": null}",
		"{\"text\": \"a\\u0000b\"}",
		"{\"since_us\": \"1\"}",
		"{\"until_us\": -1}",
		"{\"kind\": \"0123456789012345678901234567890123456789012345678901234567890123\"}",
	};
	struct db_web_trail_filter filter = filter_of("{\"who\": \"anna\", \"refused\": true, "
	                                              "\"since_us\": 5, \"kind\": \"write\"}");
	json_t *query = db_web_trail_filter_query(&filter, 7);
	json_t *expected = json_pack("{s:i, s:i, s:s, s:s, s:b}", "from", 7, "since_us", 5, "drive",
	                             "", "who", "anna", "refused", 1);

	(void)state;
	assert_true(json_equal(query, expected));
	json_decref(query);
	json_decref(expected);
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		json_t *parameters = json_loads(wrong[i], JSON_ALLOW_NUL, NULL);

		assert_non_null(parameters);
		assert_false(db_web_trail_filter_read(&filter, parameters));
		json_decref(parameters);
	}
}

static void test_wishes(void **state)
{
	static const char record[] =
		"{\"kind\": \"write\", \"drive\": \"lift\", \"time_us\": 100, \"result\": \"limit\", "
		"\"who\": \"control, user root for anna, page, 10.0.0.5\", "
		"\"values\": {\"acc\": [1, 2]}}";
	static const struct {
		const char *filter;
		bool has;
	} rows[] = {
		{ "{}", true },
		{ "{\"kind\": \"write\"}", true },
		{ "{\"kind\": \"writ\"}", false },
		{ "{\"through\": \"page\"}", true },
		{ "{\"through\": \"Modbus\"}", false },
		{ "{\"text\": \"ACC 1 -> 2\"}", true },
		{ "{\"text\": \"limit\"}", true },
		{ "{\"text\": \"anna\"}", false },
		{ "{\"until_us\": 100}", true },
		{ "{\"until_us\": 99}", false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
		struct db_web_trail_filter filter = filter_of(rows[i].filter);

		assert_int_equal(has(&filter, record), rows[i].has);
	}
}

/* Records without a drive name users and addresses of everybody. */
static void test_drives_of_others(void **state)
{
	struct db_web_trail_filter filter = filter_of("{}");

	(void)state;
	for (enum db_role role = DB_ROLE_NONE; role < DB_ROLES; role++) {
		bool may = role == DB_ROLE_ENGINEER || role == DB_ROLE_ADMINISTRATOR;

		filter.grant = (struct db_grant){ role, true, "*" };
		assert_int_equal(has(&filter, "{\"drive\": \"press\"}"), may);
		assert_int_equal(has(&filter, "{\"kind\": \"login\"}"), may);
		filter.grant = (struct db_grant){ role, true, "lift,feeder" };
		assert_int_equal(has(&filter, "{\"drive\": \"feeder\"}"), may);
		assert_false(has(&filter, "{\"drive\": \"press\"}"));
		assert_false(has(&filter, "{\"drive\": \"lift,feeder\"}"));
		assert_false(has(&filter, "{\"drive\": \"\"}"));
		assert_false(has(&filter, "{\"kind\": \"login\", \"drive\": 7}"));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_reading),
		cmocka_unit_test(test_wishes),
		cmocka_unit_test(test_drives_of_others),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
