/* SPDX-License-Identifier: Apache-2.0 */
#include "params/file.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* A family with one parameter of each kind. */
static json_t *make_families(void)
{
	return json_pack("{s:[{s:s, s:s, s:b, s:b, s:s, s:f, s:f, s:f, s:s},"
	                 "    {s:s, s:s, s:b, s:b, s:s, s:f, s:f, s:s},"
	                 "    {s:s, s:s, s:b, s:b, s:s, s:s, s:[s]},"
	                 "    {s:s, s:s, s:b, s:b, s:s, s:s, s:[s]},"
	                 "    {s:s, s:s, s:b, s:b, s:s, s:s}]}",
	                 "test", "name", "spd", "type", "f32", "writable", 1, "parameter", 1,
	                 "unit", "pulses/s", "min", -192000.0, "max", 192000.0, "default", 100.0,
	                 "description", "Preset speed (运行速度); the sign is the direction",
	                 "name", "mcs", "type", "u16", "writable", 1, "parameter", 1, "unit", "",
	                 "min", 0.0, "max", 8.0, "description", "Microstepping", "name", "cid",
	                 "type", "u16", "writable", 1, "parameter", 1, "unit", "", "description",
	                 "Device id", "traits", "address", "name", "reset", "type", "u16",
	                 "writable", 1, "parameter", 1, "unit", "", "description", "As delivered",
	                 "traits", "action", "name", "watchdog_ms", "type", "u32", "writable", 1,
	                 "parameter", 0, "unit", "ms", "description", "No parameter");
}

struct fixture {
	json_t *families;
	struct db_params params;
	char *said;
};

static int set_up(void **state)
{
	struct fixture *fixture = calloc(1, sizeof(*fixture));

	fixture->families = make_families();
	*state = fixture;
	return fixture->families ? 0 : -1;
}

static int tear_down(void **state)
{
	struct fixture *fixture = *state;

	db_params_clear(&fixture->params);
	json_decref(fixture->families);
	free(fixture->said);
	free(fixture);
	return 0;
}

static bool read_text(struct fixture *fixture, const char *text)
{
	size_t length = 0;
	FILE *errors;
	bool right;

	db_params_clear(&fixture->params);
	free(fixture->said);
	errors = open_memstream(&fixture->said, &length);
	right = db_params_read(&fixture->params, "f", text, fixture->families, errors);
	(void)fclose(errors);
	return right;
}

#define HEAD "drive \"feeder\" {\n format = 1\n family = test\n identity = \"X 1\"\n}\n"
#define BODY(text) HEAD "parameters {\n" text "}\nend\n"

static void expect_mistake(void **state, const char *text, const char *expected)
{
	struct fixture *fixture = *state;

	assert_false(read_text(fixture, text));
	assert_string_equal(fixture->said, expected);
}

static void test_a_file_has_names_and_values(void **state)
{
	struct fixture *fixture = *state;

	assert_true(read_text(fixture, BODY("spd = -0.1 # slow\nmcs = 4\ncid = 7\n")));
	assert_string_equal(fixture->said, "");
	assert_string_equal(fixture->params.family, "test");
	assert_string_equal(fixture->params.identity, "X 1");
	assert_int_equal(fixture->params.family_line, 3);
	assert_int_equal(json_integer_value(db_params_value(&fixture->params, "mcs")), 4);
	assert_int_equal(json_object_size(fixture->params.values), 3);
	assert_null(db_params_value(&fixture->params, "reset"));
}

static void test_each_mistake_has_its_line(void **state)
{
	expect_mistake(state, BODY("spd = 200000\n"),
	               "f:7: spd: 200000 is out of range, -192000 to 192000 pulses/s\n");
	expect_mistake(state, BODY("spd = fast\nmcs = 1.5\n"),
	               "f:7: spd: \"fast\" is no number; right is -192000 to 192000 pulses/s\n"
	               "f:8: mcs: \"1.5\" is no whole number; right is 0 to 8\n");
	expect_mistake(state, BODY("mcs = 1\n\nmcs = 1\n"),
	               "f:9: 'mcs' is given twice, first on line 7\n");
	expect_mistake(state, BODY("spdd = 1\n"),
	               "f:7: test has no parameter 'spdd'; did you mean spd?\n");
	expect_mistake(state, BODY("watchdog_ms = 1\n"),
	               "f:7: test has no parameter 'watchdog_ms'; there are spd, mcs and cid\n");
	expect_mistake(state, BODY("reset = 1\n"), "f:7: 'reset' cannot be written from a file\n");
	expect_mistake(state, BODY("mcs = {1, 2}\n"), "f:7: 'mcs' is a list; right is one value\n");
	expect_mistake(state, HEAD "parameters {\nmcs = 1\n}\n",
	               "f: the last line is not 'end': a part of the file is missing\n");
	expect_mistake(
		state, HEAD "parameters {\nmcs = 1\n",
		"f:8: the file ends too early; expected a key, or } at the end of the section\n");
	expect_mistake(state, "mcs = 1\n" BODY("spd = 1\n"),
	               "f:1: 'mcs' stands outside of drive and parameters\n");
	expect_mistake(state, BODY("mcs = 1\n") "parameters {\n}\n",
	               "f:9: end says that the file is complete, but more follows on line 10; move "
	               "it to the last line\n");
	expect_mistake(state, HEAD "parameters {\n}\nparameters {\n}\nend\n",
	               "f:8: there is a second section 'parameters'\n");
	expect_mistake(state, HEAD "values {\n}\nend\n",
	               "f: there is no section 'parameters': this is no file of parameters\n"
	               "f:6: there is no section 'values'; right is drive or parameters\n");
	expect_mistake(state, "drive x {\nformat = 2\nname = 1\n}\nparameters {\n}\nend\n",
	               "f:1: the drive has no family\n"
	               "f:2: the format is 2; this program reads format 1\n"
	               "f:3: a drive has no 'name'; right is format, family or identity\n");
	expect_mistake(state, "",
	               "f: the last line is not 'end': a part of the file is missing\n"
	               "f: there is no section 'drive': this is no file of parameters\n"
	               "f: there is no section 'parameters': this is no file of "
	               "parameters\n");
}

static void test_of_another_family_only_numbers_are_known(void **state)
{
	struct fixture *fixture = *state;

	assert_true(read_text(fixture, "drive a {\nformat = 1\nfamily = other\n}\nparameters {\n"
	                               "x = 1.5\ny = 3\n}\nend\n"));
	assert_null(fixture->params.registers);
	assert_true(json_is_real(db_params_value(&fixture->params, "x")));
	assert_true(json_is_integer(db_params_value(&fixture->params, "y")));
	expect_mistake(state,
	               "drive a {\nformat = 1\nfamily = other\n}\nparameters {\nx = nan\n"
	               "y = 99999999999999999999\n}\nend\n",
	               "f:6: x: \"nan\" is no number\n"
	               "f:7: y: \"99999999999999999999\" is no number\n");
}

/* What a drive holds is in the file down to the last bit, and nothing but its parameters. */
static void test_values_survive_the_file(void **state)
{
	static const uint32_t patterns[] = { 0x00000000, 0x3dcccccd, 0x3eaaaaab, 0x47bb8000,
		                             0xc83b8000, 0x00000001, 0x007fffff, 0xb3d6bf95,
		                             0x483b8000, 0x3f7fffff };
	struct fixture *fixture = *state;
	struct db_params drive = { .name = "a \"b\" \\", .family = "test", .identity = "\\\"" };
	char *text;
	float real;
	float found;

	drive.registers = json_object_get(fixture->families, "test");
	for (size_t i = 0; i < sizeof(patterns) / sizeof(patterns[0]); i++) {
		memcpy(&real, &patterns[i], sizeof(real));
		drive.values = json_pack("{s:f, s:i, s:n, s:i, s:i}", "spd", (double)real, "mcs", 8,
		                         "cid", "reset", 1, "watchdog_ms", 1000);
		text = db_params_write(&drive);
		assert_non_null(text);
		assert_true(read_text(fixture, text));
		found = (float)json_number_value(db_params_value(&fixture->params, "spd"));
		assert_memory_equal(&found, &real, sizeof(real));
		assert_string_equal(fixture->params.identity, drive.identity);
		assert_int_equal(json_object_size(fixture->params.values), 2);
		assert_non_null(strstr(text, "\t# cid: the drive does not tell it: Device id\n"));
		assert_non_null(strstr(text, "\tmcs = 8          # Microstepping\n"));
		assert_non_null(strstr(text, " # pulses/s, Preset speed (运行速度)\n"));
		free(text);
		json_decref(drive.values);
	}
}

static void expect_difference(struct db_params *one, struct db_params *other, const char *expected)
{
	json_t *differ = db_params_compare(one, other);
	char *text = json_dumps(differ, JSON_COMPACT);

	assert_string_equal(text, expected);
	free(text);
	json_decref(differ);
}

static void test_what_differs_is_in_the_order_of_the_table(void **state)
{
	struct fixture *fixture = *state;
	struct db_params one = { .name = "one", .family = "test" };
	struct db_params other = { .name = "other", .family = "test" };
	struct db_params defaults;

	one.registers = other.registers = json_object_get(fixture->families, "test");
	one.values = json_pack("{s:i, s:f, s:i, s:i}", "mcs", 1, "spd", 0.1, "cid", 1, "reset", 1);
	other.values = json_pack("{s:f, s:i, s:n}", "spd", (double)0.1F, "mcs", 1, "cid");
	expect_difference(&one, &other, "[\"cid\"]");
	expect_difference(&other, &one, "[\"cid\"]");
	(void)json_object_set_new(other.values, "spd", json_real(0.2));
	expect_difference(&one, &other, "[\"spd\",\"cid\"]");
	/* Only of spd is there a default. */
	db_params_take_defaults(&one, &defaults);
	expect_difference(&one, &defaults, "[\"spd\"]");
	(void)json_object_set_new(one.values, "spd", json_integer(100));
	expect_difference(&defaults, &one, "[]");
	/* Files of a family that is not here: what they say. */
	one.registers = other.registers = NULL;
	(void)json_object_set_new(other.values, "more", json_integer(1));
	expect_difference(&one, &other, "[\"spd\",\"cid\",\"reset\",\"more\"]");
	db_params_clear(&one);
	db_params_clear(&other);
	db_params_clear(&defaults);
}

static void add_register(json_t *registers, const char *name, const char *trait)
{
	(void)json_array_append_new(registers,
	                            trait ? json_pack("{s:s, s:b, s:[s]}", "name", name,
	                                              "parameter", 1, "traits", trait) :
	                                    json_pack("{s:s, s:b}", "name", name, "parameter", 1));
}

static void expect_text(json_t *found, const char *expected)
{
	char *text = json_dumps(found, JSON_COMPACT);

	assert_string_equal(text, expected);
	free(text);
	json_decref(found);
}

static void expect_changes(const struct db_params *drive, const struct db_params *file,
                           const char *expected)
{
	struct db_params_changes changes;

	db_params_find_changes(drive, file, &changes);
	expect_text(json_pack("[O,O,O]", changes.settings, changes.addresses, changes.states),
	            expected);
	db_params_clear_changes(&changes);
}

static void test_the_plan_has_the_order_of_the_traits(void **state)
{
	static const char *const names[][2] = {
		{ "event", "last" },     { "left", "together" }, { "right", "together" },
		{ "speed", NULL },       { "cid", "address" },   { "bdr", "address" },
		{ "factory", "action" }, { "mode", "first" },    { "ramp", "derived" },
		{ "power", "state" },
	};
	json_t *registers = json_array();
	struct db_params drive = { .name = "d", .family = "test", .registers = registers };
	struct db_params file = { .name = "f", .family = "test", .registers = registers };
	json_t *all = json_array();

	(void)state;
	drive.values = json_object();
	file.values = json_object();
	for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
		add_register(registers, names[i][0], names[i][1]);
		(void)json_object_set_new(drive.values, names[i][0], json_integer(1));
		(void)json_object_set_new(file.values, names[i][0], json_integer(2));
	}
	expect_changes(&drive, &file,
	               "[[\"event\",\"left\",\"right\",\"speed\",\"mode\"],"
	               "[\"cid\",\"bdr\"],[\"power\"]]");
	for (size_t i = 0; i < 6; i++)
		(void)json_array_append_new(all, json_string(names[i][0]));
	(void)json_array_append_new(all, json_string("mode"));
	(void)json_array_append_new(all, json_string("unknown"));
	expect_text(
		db_params_order(registers, all),
		"[[\"mode\"],[\"left\",\"right\"],[\"speed\"],[\"event\"],[\"cid\"],[\"bdr\"]]");
	json_decref(all);
	/* What is so already, and what the file does not say. */
	(void)json_object_set_new(file.values, "left", json_integer(1));
	(void)json_object_del(file.values, "mode");
	(void)json_object_set_new(drive.values, "speed", json_null());
	expect_changes(&drive, &file,
	               "[[\"event\",\"right\",\"speed\"],[\"cid\",\"bdr\"],[\"power\"]]");
	json_decref(file.values);
	file.values = json_incref(drive.values);
	expect_changes(&drive, &file, "[[],[],[]]");
	json_decref(drive.values);
	json_decref(file.values);
	json_decref(registers);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(test_a_file_has_names_and_values, set_up,
		                                tear_down),
		cmocka_unit_test_setup_teardown(test_each_mistake_has_its_line, set_up, tear_down),
		cmocka_unit_test_setup_teardown(test_of_another_family_only_numbers_are_known,
		                                set_up, tear_down),
		cmocka_unit_test_setup_teardown(test_values_survive_the_file, set_up, tear_down),
		cmocka_unit_test(test_the_plan_has_the_order_of_the_traits),
		cmocka_unit_test_setup_teardown(test_what_differs_is_in_the_order_of_the_table,
		                                set_up, tear_down),
	};

	return cmocka_run_group_tests_name("params: sets and files", tests, NULL, NULL);
}
