/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/moment.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static void expect_text(int64_t us, const char *text)
{
	json_t *described = db_mqtt_moment_describe(us);

	assert_string_equal(json_string_value(described), text);
	json_decref(described);
}

static void test_there_and_back(void **state)
{
	static const struct {
		int64_t us;
		const char *text;
	} moments[] = {
		{ 0, "1970-01-01T00:00:00.000000Z" },
		{ 1, "1970-01-01T00:00:00.000001Z" },
		{ 951782400000000, "2000-02-29T00:00:00.000000Z" },
		{ 1772366400000125, "2026-03-01T12:00:00.000125Z" },
		{ 253402300799999999, "9999-12-31T23:59:59.999999Z" },
	};
	int64_t us;

	(void)state;
	for (size_t i = 0; i < sizeof(moments) / sizeof(moments[0]); i++) {
		expect_text(moments[i].us, moments[i].text);
		assert_true(db_mqtt_moment_read(moments[i].text, &us));
		assert_int_equal(us, moments[i].us);
	}
	/* A clock that cannot be. */
	expect_text(-1, moments[0].text);
	expect_text(INT64_MAX, moments[0].text);
}

static void test_other_ways_to_write_it(void **state)
{
	static const char *const same[] = {
		"2026-03-01T12:00:00Z",
		"2026-03-01T12:00:00.0Z",
		"2026-03-01T13:00:00+01:00",
		"2026-03-01T06:30:00.000000000-05:30",
	};
	int64_t us;

	(void)state;
	for (size_t i = 0; i < sizeof(same) / sizeof(same[0]); i++) {
		assert_true(db_mqtt_moment_read(same[i], &us));
		assert_int_equal(us, INT64_C(1772366400000000));
	}
}

static void test_what_is_none(void **state)
{
	static const char *const wrong[] = {
		"",
		"now",
		"2026-03-01",
		"2026-03-01 12:00:00Z",
		"2026-03-01T12:00:00",
		"2026-03-01T12:00:00.Z",
		"2026-03-01T12:00:00ZZ",
		"2026-03-01T12:00:00+0100",
		"2026-03-01T12:00:00+15:00",
		"2026-13-01T12:00:00Z",
		"2026-00-01T12:00:00Z",
		"2026-03-00T12:00:00Z",
		"2026-03-01T24:00:00Z",
		"2026-03-01T12:60:00Z",
		"1969-12-31T23:59:59Z",
		"1970-01-01T00:00:00+01:00",
		"02026-03-01T12:00:00Z",
		" 2026-03-01T12:00:00Z",
		"-026-03-01T12:00:00Z",
	};
	int64_t us;

	(void)state;
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++)
		assert_false(db_mqtt_moment_read(wrong[i], &us));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_there_and_back),
		cmocka_unit_test(test_other_ways_to_write_it),
		cmocka_unit_test(test_what_is_none),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
