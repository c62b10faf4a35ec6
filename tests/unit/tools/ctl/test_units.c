/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/units.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static json_t *make_register(const char *name, const char *type, const char *unit)
{
	return json_pack("{s:s, s:s, s:s, s:f, s:f}", "name", name, "type", type, "unit", unit,
	                 "min", -2147483648.0, "max", 2147483647.0);
}

static json_t *make_registers(const char *velocity, const char *users)
{
	char per_second[32];

	(void)snprintf(per_second, sizeof(per_second), "%s/s", users);
	return json_pack("[o,o,o,o,o,o,o]", make_register("position", "i32", "counts"),
	                 make_register("velocity", "f32", velocity),
	                 make_register("position_units", "f32", users),
	                 make_register("velocity_units", "f32", per_second),
	                 make_register("target_position", "i32", "counts"),
	                 make_register("target_velocity", "f32", velocity),
	                 make_register("target_current", "f32", "A"));
}

static const char *users_of(const json_t *registers, const char *name)
{
	const char *unit = db_ctl_users_unit(registers, db_words_look_up(registers, name));

	return unit ? unit : "";
}

static void test_what_people_count_in(void **state)
{
	json_t *registers = make_registers("counts/s", "mm");

	(void)state;
	assert_string_equal(users_of(registers, "target_position"), "mm");
	assert_string_equal(users_of(registers, "target_velocity"), "mm/s");
	assert_string_equal(users_of(registers, "target_current"), "");
	json_decref(registers);
	/* A velocity in rpm is no multiple of mm/s by counts_per_unit. */
	registers = make_registers("rpm", "mm");
	assert_string_equal(users_of(registers, "target_position"), "mm");
	assert_string_equal(users_of(registers, "target_velocity"), "");
	json_decref(registers);
	registers = make_registers("counts/s", "user units");
	assert_string_equal(users_of(registers, "target_position"), "");
	assert_string_equal(users_of(registers, "target_velocity"), "");
	json_decref(registers);
}

static void expect(const char *type, const char *unit, const char *users, const char *text,
                   double expected)
{
	json_t *reg = make_register("target", type, unit);
	char problem[256] = "";
	json_t *value = db_ctl_parse_quantity(reg, users, 640.1, text, problem, sizeof(problem));

	assert_string_equal(problem, "");
	assert_float_equal(json_number_value(value), expected, 1e-9);
	json_decref(value);
	json_decref(reg);
}

static void test_values_with_a_unit(void **state)
{
	(void)state;
	expect("i32", "counts", "mm", "3200", 3200);
	expect("i32", "counts", "mm", "0x10", 16);
	expect("i32", "counts", "mm", "3200counts", 3200);
	expect("i32", "counts", "mm", "10mm", 6401);
	expect("i32", "counts", "mm", "10 mm", 6401);
	expect("i32", "counts", "mm", "-10mm", -6401);
	expect("i32", "counts", "mm", "+1e1mm", 6401);
	/* To the nearest. */
	expect("i32", "counts", "mm", "1mm", 640);
	expect("i32", "counts", "mm", "-0.001mm", -1);
	expect("i32", "counts", "mm", "3300000mm", 2112330000);
	expect("f32", "counts/s", "mm/s", "100mm/s", 64010);
	expect("f32", "counts/s", "mm/s", "0.5mm/s", 320.05);
	expect("f32", "rpm", NULL, "30rpm", 30);
	expect("f32", "A", NULL, "-1.5 A", -1.5);
	expect("i32", "counts", "\xc2\xb0", "90\xc2\xb0", 57609);
}

static void refuse(const char *type, const char *unit, const char *users, double per_unit,
                   const char *text, const char *expected)
{
	json_t *reg = make_register("target", type, unit);
	char problem[256] = "";

	assert_null(db_ctl_parse_quantity(reg, users, per_unit, text, problem, sizeof(problem)));
	assert_string_equal(problem, expected);
	json_decref(reg);
}

static void test_other_units_are_refused(void **state)
{
	(void)state;
	refuse("i32", "counts", "mm", 640, "10cm",
	       "\"cm\" is no unit of it; right are counts and mm");
	refuse("i32", "counts", "mm", 640, "10mm/s",
	       "\"mm/s\" is no unit of it; right are counts and mm");
	refuse("i32", "counts", "mm", 640, "10MM",
	       "\"MM\" is no unit of it; right are counts and mm");
	refuse("i32", "counts", "mm", 640, "10,5mm",
	       "\",5mm\" is no unit of it; right are counts and mm");
	refuse("i32", "counts", "mm", 640, "1.2.3mm",
	       "\".3mm\" is no unit of it; right are counts and mm");
	refuse("f32", "rpm", NULL, 640, "10mm/s", "\"mm/s\" is no unit of it; right is rpm");
	refuse("u16", "", NULL, 0, "10mm", "it has no unit, and \"mm\" is none of it");
	refuse("i32", "counts", "mm", 0, "10mm", "how many counts one mm is is not known");
	refuse("i32", "counts", "mm", 640, "4000000mm",
	       "2560000000 is out of range, -2147483648 to 2147483647 counts");
	refuse("i32", "counts", "mm", 640, "1e300mm",
	       "1000000000000000000 is out of range, -2147483648 to 2147483647 counts");
	refuse("i32", "counts", "mm", 640, "0x10mm",
	       "\"0x10mm\" is no whole number; right is -2147483648 to 2147483647 counts");
	refuse("i32", "counts", "mm", 640, "3.5",
	       "\"3.5\" is no whole number; right is -2147483648 to 2147483647 counts");
	refuse("i32", "counts", "mm", 640, "mm",
	       "\"mm\" is no whole number; right is -2147483648 to 2147483647 counts");
	refuse("f32", "counts/s", "mm/s", 640, "infmm/s",
	       "\"infmm/s\" is no number; right is -2147483648 to 2147483647 counts/s");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_people_count_in),
		cmocka_unit_test(test_values_with_a_unit),
		cmocka_unit_test(test_other_units_are_refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
