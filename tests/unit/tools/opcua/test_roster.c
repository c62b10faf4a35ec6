/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/roster.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static const char registers_text[] =
	"[{\"name\":\"axis_state\",\"type\":\"u16\",\"unit\":\"\",\"codes\":{\"0\":\"Offline\"}},"
	" {\"name\":\"status\",\"type\":\"bits32\",\"unit\":\"\",\"codes\":{\"0\":\"online\"}},"
	" {\"name\":\"position\",\"type\":\"i32\",\"unit\":\"counts\"},"
	" {\"name\":\"target_position\",\"type\":\"i32\",\"writable\":true,\"unit\":\"counts\"},"
	" {\"name\":\"spd\",\"type\":\"f32\",\"writable\":true,\"unit\":\"\",\"parameter\":true,"
	"  \"min\":-5,\"max\":5},"
	" {\"name\":\"acc\",\"type\":\"f32\",\"writable\":true,\"unit\":\"\",\"parameter\":true},"
	" {\"name\":\"history1_result\",\"type\":\"u16\",\"unit\":\"\"},"
	" {\"name\":\"bus1_up\",\"type\":\"bool\",\"unit\":\"\"},"
	" {\"name\":\"online\",\"type\":\"bool\",\"unit\":\"\"}]";

static const char commands_text[] =
	"[{\"name\":\"move_absolute\",\"arguments\":[\"target_position\"]},"
	" {\"name\":\"stop\",\"arguments\":[]},"
	" {\"name\":\"position\",\"arguments\":[]}]";

struct plant {
	struct db_opcua_config config;
	struct db_opcua_kind *kinds;
	struct db_opcua_roster roster;
	struct db_opcua_drive *drives[8];
	size_t count;
};

static struct db_opcua_shown *add_drive(struct plant *plant, const char *name)
{
	json_t *registers = json_loads(registers_text, 0, NULL);
	json_t *commands = json_loads(commands_text, 0, NULL);
	json_t *description = json_loads("{\"address\":3,\"axis\":\"x\"}", 0, NULL);
	struct db_opcua_drive *drive;
	struct db_opcua_shown *shown;

	drive = db_opcua_drive_new(name, "line",
	                           db_opcua_kind_take(&plant->kinds,
	                                              db_opcua_type_of_family("vsmd-serial"),
	                                              registers, commands));
	assert_non_null(drive);
	plant->drives[plant->count++] = drive;
	shown = db_opcua_roster_add(&plant->roster, &plant->config, drive, description);
	assert_non_null(shown);
	json_decref(registers);
	json_decref(commands);
	json_decref(description);
	return shown;
}

static void free_plant(struct plant *plant)
{
	db_opcua_roster_clear(&plant->roster);
	for (size_t i = 0; i < plant->count; i++)
		db_opcua_drive_free(&plant->kinds, plant->drives[i]);
	db_settings_free(&db_opcua_form, &plant->config);
}

static struct plant make_plant(const char *config)
{
	struct plant plant = { .count = 0 };

	assert_true(db_settings_parse(&db_opcua_form, config, "opcua.conf", stderr, &plant.config,
	                              "gw"));
	return plant;
}

static bool identify(const struct plant *plant, const char *id, struct db_opcua_subject *subject)
{
	char text[64];

	/* What follows it is not part of it. */
	(void)snprintf(text, sizeof(text), "%sX", id);
	return db_opcua_roster_identify(&plant->roster, text, strlen(id), subject);
}

static void test_what_stands_below_a_drive(void **state)
{
	static const struct {
		const char *path;
		enum db_opcua_branch_type type;
		const char *name;
		const char *parent;
	} expected[] = {
		{ "", DB_OPCUA_ROOT, "", "" },
		{ "AxisState", DB_OPCUA_VARIABLE, "AxisState", "" },
		{ "PositionActualValue.EngineeringUnits", DB_OPCUA_UNIT, "EngineeringUnits",
		  "PositionActualValue" },
		{ "MoveAbsolute", DB_OPCUA_METHOD, "MoveAbsolute", "" },
		{ "MoveAbsolute.InputArguments", DB_OPCUA_INPUTS, "InputArguments",
		  "MoveAbsolute" },
		{ "Stop.OutputArguments", DB_OPCUA_OUTPUTS, "OutputArguments", "Stop" },
		{ "CommandBlock.TargetPosition", DB_OPCUA_VARIABLE, "TargetPosition",
		  "CommandBlock" },
		{ "Parameters.spd", DB_OPCUA_VARIABLE, "spd", "Parameters" },
		{ "Parameters.spd.EURange", DB_OPCUA_RANGE, "EURange", "Parameters.spd" },
		{ "History.Result", DB_OPCUA_COLUMN, "Result", "History" },
		{ "Bits.Online", DB_OPCUA_VARIABLE, "Online", "Bits" },
		{ "Identification.Location", DB_OPCUA_LOCATION, "Location", "Identification" },
	};
	struct plant plant = make_plant("");
	const struct db_opcua_tree *tree = add_drive(&plant, "feeder")->tree;

	(void)state;
	for (size_t i = 0; i < sizeof(expected) / sizeof(expected[0]); i++) {
		const struct db_opcua_branch *branch = db_opcua_tree_find(tree, expected[i].path,
		                                                          strlen(expected[i].path));

		assert_non_null(branch);
		assert_int_equal(branch->type, expected[i].type);
		assert_string_equal(branch->name, expected[i].name);
		assert_string_equal(tree->list[branch->parent].path, expected[i].parent);
	}
	/* No range, no unit, no arguments. */
	assert_null(db_opcua_tree_find(tree, "Parameters.acc.EURange", 22));
	assert_null(db_opcua_tree_find(tree, "Stop.InputArguments", 19));
	assert_null(db_opcua_tree_find(tree, "Param", 5));
	free_plant(&plant);
}

static void test_children_stand_side_by_side(void **state)
{
	struct plant plant = make_plant("");
	const struct db_opcua_tree *tree = add_drive(&plant, "feeder")->tree;
	size_t seen = 1;

	(void)state;
	for (size_t i = 0; i < tree->count; i++) {
		for (size_t at = 0; at < tree->list[i].count; at++)
			assert_int_equal(tree->list[tree->list[i].first + at].parent, i);
		seen += tree->list[i].count;
	}
	assert_int_equal(seen, tree->count);
	free_plant(&plant);
}

static void test_only_what_is_chosen_is_shown(void **state)
{
	struct plant plant = make_plant("server {\n\tshow = {\"Parameters\"}\n}\n");
	const struct db_opcua_tree *tree = add_drive(&plant, "feeder")->tree;

	(void)state;
	assert_non_null(db_opcua_tree_find(tree, "Parameters.spd", 14));
	assert_null(db_opcua_tree_find(tree, "Bits", 4));
	assert_null(db_opcua_tree_find(tree, "History", 7));
	free_plant(&plant);
}

static void test_ids_are_of_drives(void **state)
{
	struct plant plant = make_plant("");
	struct db_opcua_shown *feeder = add_drive(&plant, "feeder");
	struct db_opcua_shown *dotted = add_drive(&plant, "feeder.Parameters");
	struct db_opcua_shown *gateway = add_drive(&plant, "");
	struct db_opcua_subject subject;

	(void)state;
	assert_ptr_equal(feeder->tree, dotted->tree);
	assert_string_equal(feeder->location, "line/3/x");
	assert_true(identify(&plant, "feeder", &subject));
	assert_int_equal(subject.type, DB_OPCUA_OF_DRIVE);
	assert_ptr_equal(subject.shown, feeder);
	assert_true(identify(&plant, "feeder.Parameters.spd", &subject));
	assert_ptr_equal(subject.shown, feeder);
	assert_string_equal(subject.branch->path, "Parameters.spd");
	assert_true(identify(&plant, "feeder.Parameters.Bits.Online", &subject));
	assert_ptr_equal(subject.shown, dotted);
	assert_true(identify(&plant, "/Gateway", &subject));
	assert_ptr_equal(subject.shown, gateway);
	assert_false(identify(&plant, "feeder.", &subject));
	assert_false(identify(&plant, "feede", &subject));
	assert_false(identify(&plant, "feeder.Parameters.", &subject));
	assert_false(identify(&plant, "", &subject));
	assert_false(identify(&plant, "/Events.DriveLost", &subject));
	db_opcua_roster_remove(&plant.roster, feeder);
	assert_false(identify(&plant, "feeder", &subject));
	assert_true(identify(&plant, "feeder.Parameters", &subject));
	free_plant(&plant);
}

/* As bytes from outside may be: what stands behind the zero byte is part of the id. */
static void test_ids_with_zero_bytes_are_of_nothing(void **state)
{
	static const char *const ids[] = { "feeder.Bits.Online", "feeder", "/Buses.line" };
	struct plant plant = make_plant("");
	struct db_opcua_subject subject;
	char text[200];

	(void)state;
	(void)add_drive(&plant, "feeder");
	for (size_t i = 0; i < sizeof(ids) / sizeof(ids[0]); i++) {
		memset(text, 0, sizeof(text));
		memcpy(text, ids[i], strlen(ids[i]));
		for (size_t length = strlen(ids[i]) + 1; length <= sizeof(text); length++)
			assert_false(
				db_opcua_roster_identify(&plant.roster, text, length, &subject));
	}
	free_plant(&plant);
}

static void test_the_gateway_has_no_buses_and_no_identification(void **state)
{
	struct plant plant = make_plant("");
	const struct db_opcua_tree *tree = add_drive(&plant, "")->tree;

	(void)state;
	assert_non_null(db_opcua_tree_find(tree, "Bits.Online", 11));
	assert_null(db_opcua_tree_find(tree, "Bits.Bus1Up", 11));
	assert_null(db_opcua_tree_find(tree, "Identification", 14));
	free_plant(&plant);
}

static void describe(struct plant *plant, const char *text, int64_t time_us)
{
	json_t *told = json_loads(text, 0, NULL);

	assert_non_null(told);
	db_opcua_buses_describe(&plant->roster.buses, told, time_us);
	json_decref(told);
}

static void test_ids_are_of_buses(void **state)
{
	struct plant plant = make_plant("");
	json_t *figures = json_loads(
		"{\"line.1\":{\"cycle_us\":5,\"up\":1},\"none\":{\"cycle_us\":6}}", 0, NULL);
	struct db_opcua_subject subject;

	(void)state;
	describe(&plant,
	         "[{\"name\":\"line\",\"up\":true},{\"name\":\"line.1\",\"up\":false,\"list\":[]}]",
	         7);
	db_opcua_buses_measure(plant.roster.buses, figures, 8);
	json_decref(figures);
	assert_true(identify(&plant, "/Drives", &subject));
	assert_int_equal(subject.type, DB_OPCUA_ALL_DRIVES);
	assert_true(identify(&plant, "/Buses", &subject));
	assert_int_equal(subject.type, DB_OPCUA_ALL_BUSES);
	assert_true(identify(&plant, "/Buses.line", &subject));
	assert_int_equal(subject.type, DB_OPCUA_BUS);
	assert_true(identify(&plant, "/Buses.line.1.CycleUs", &subject));
	assert_int_equal(subject.type, DB_OPCUA_FACT);
	assert_int_equal(json_integer_value(subject.fact->value), 5);
	assert_int_equal(subject.fact->time_us, 8);
	/* Told twice, as a boolean and as a number. */
	assert_true(identify(&plant, "/Buses.line.1.Up", &subject));
	assert_true(json_is_false(subject.fact->value));
	assert_int_equal(subject.fact->time_us, 7);
	assert_false(identify(&plant, "/Buses.line.List", &subject));
	assert_false(identify(&plant, "/Buses.", &subject));
	assert_false(identify(&plant, "/Buses.lin", &subject));
	/* A bus that goes takes its facts along; the other one keeps its own. */
	describe(&plant, "[{\"name\":\"line.1\",\"up\":true}]", 9);
	assert_false(identify(&plant, "/Buses.line", &subject));
	assert_true(identify(&plant, "/Buses.line.1.CycleUs", &subject));
	free_plant(&plant);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_stands_below_a_drive),
		cmocka_unit_test(test_children_stand_side_by_side),
		cmocka_unit_test(test_only_what_is_chosen_is_shown),
		cmocka_unit_test(test_ids_are_of_drives),
		cmocka_unit_test(test_ids_with_zero_bytes_are_of_nothing),
		cmocka_unit_test(test_the_gateway_has_no_buses_and_no_identification),
		cmocka_unit_test(test_ids_are_of_buses),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
