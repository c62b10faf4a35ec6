/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/names.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static void test_names_follow_a_rule(void **state)
{
	static const char *const names[][2] = {
		{ "move_absolute", "MoveAbsolute" }, { "target_position", "TargetPosition" },
		{ "watchdog_ms", "WatchdogMs" },     { "home", "Home" },
		{ "raw_request1", "RawRequest1" },   { "n1_2", "N1_2" },
		{ "input_16", "Input16" },           { "position_2", "Position2" },
		{ "axis_state", "AxisState" },       { "", "" },
	};
	char name[DB_OPCUA_NAME_MAX];

	(void)state;
	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
		db_opcua_name_of(names[i][0], name);
		assert_string_equal(name, names[i][1]);
	}
}

static void test_the_standard_has_its_own_names(void **state)
{
	char name[DB_OPCUA_NAME_MAX];

	(void)state;
	db_opcua_name_of("position", name);
	assert_string_equal(name, "PositionActualValue");
	db_opcua_name_of("velocity", name);
	assert_string_equal(name, "VelocityActualValue");
	db_opcua_name_of("temperature", name);
	assert_string_equal(name, "ConverterTemperature");
}

/* No two names of one drive may become one. */
static void test_names_of_the_table_are_different(void **state)
{
	char one[DB_OPCUA_NAME_MAX];
	char other[DB_OPCUA_NAME_MAX];

	(void)state;
	for (const struct db_opcua_name *a = db_opcua_names; a->reg; a++) {
		for (const struct db_opcua_name *b = db_opcua_names; b < a; b++) {
			db_opcua_name_of(a->reg, one);
			db_opcua_name_of(b->reg, other);
			assert_string_not_equal(one, other);
		}
	}
}

static void test_what_is_too_long_is_cut(void **state)
{
	char reg[200];
	char name[DB_OPCUA_NAME_MAX];

	(void)state;
	memset(reg, 'a', sizeof(reg) - 1);
	reg[sizeof(reg) - 1] = '\0';
	db_opcua_name_of(reg, name);
	assert_int_equal(strlen(name), DB_OPCUA_NAME_MAX - 1);
}

static void test_what_the_bridge_knows_by_itself(void **state)
{
	(void)state;
	assert_true(db_opcua_name_is_own("axis_state"));
	assert_false(db_opcua_name_is_own("position"));
	assert_false(db_opcua_name_is_own("spd"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_names_follow_a_rule),
		cmocka_unit_test(test_the_standard_has_its_own_names),
		cmocka_unit_test(test_names_of_the_table_are_different),
		cmocka_unit_test(test_what_is_too_long_is_cut),
		cmocka_unit_test(test_what_the_bridge_knows_by_itself),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
