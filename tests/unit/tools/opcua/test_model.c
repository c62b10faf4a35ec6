/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/model.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static const char registers_text[] =
	"[{'name':'axis_state','type':'u16','writable':false,'unit':'','parameter':false,"
	"  'codes':{'0':'Offline','2':'Standstill'},'description':'State'},"
	" {'name':'status','type':'bits32','writable':false,'unit':'','parameter':false,"
	"  'codes':{'0':'online','3':'moving'},'description':'Bits'},"
	" {'name':'quality','type':'u16','writable':false,'unit':'','parameter':false,'description':''},"
	" {'name':'timestamp_us','type':'u64','writable':false,'unit':'us','parameter':false,'description':''},"
	" {'name':'position','type':'i32','writable':false,'unit':'counts','parameter':false,'description':''},"
	" {'name':'velocity','type':'f32','writable':false,'unit':'counts/s','parameter':false,'description':''},"
	" {'name':'command_id','type':'u16','writable':true,'unit':'','parameter':false,'description':'',"
	"  'min':0,'max':65535},"
	" {'name':'command','type':'u16','writable':true,'unit':'','parameter':false,'description':''},"
	" {'name':'target_position','type':'i32','writable':true,'unit':'counts','parameter':false,'description':''},"
	" {'name':'raw_length','type':'u16','writable':true,'unit':'','parameter':false,'description':''},"
	" {'name':'spd','type':'f32','writable':true,'unit':'pulses/s','parameter':true,'min':-5,'max':5,"
	"  'description':'Speed'},"
	" {'name':'identity','type':'text','writable':false,'unit':'','parameter':false,'description':''},"
	" {'name':'history1_command','type':'u16','writable':false,'unit':'','parameter':false,'description':''},"
	" {'name':'history1_address','type':'text','writable':false,'unit':'','parameter':false,'description':''},"
	" {'name':'history2_command','type':'u16','writable':false,'unit':'','parameter':false,'description':'x'},"
	" {'name':'history2_address','type':'text','writable':false,'unit':'','parameter':false,'description':''},"
	" {'name':'future','type':'quaternion','writable':false,'unit':'','parameter':false,'description':''},"
	" {'name':'online','type':'bool','writable':false,'unit':'','parameter':false,'description':''},"
	" {'name':'input_1','type':'bool','writable':false,'unit':'','parameter':false,'description':''}]";

static const char commands_text[] =
	"[{'name':'move_absolute','code':6,'arguments':['target_position'],'description':''}]";

/* JSON with single quotes. */
static json_t *parse(const char *text)
{
	char copy[8192];
	json_t *json;

	assert_true(strlen(text) < sizeof(copy));
	memcpy(copy, text, strlen(text) + 1);
	for (char *at = copy; *at; at++)
		*at = *at == '\'' ? '"' : *at;
	json = json_loads(copy, 0, NULL);
	assert_non_null(json);
	return json;
}

struct plant {
	struct db_opcua_kind *kinds;
	struct db_opcua_drive *drive;
};

static struct db_opcua_kind *take_kind(struct db_opcua_kind **kinds)
{
	json_t *registers = parse(registers_text);
	json_t *commands = parse(commands_text);
	struct db_opcua_kind *kind;

	db_opcua_registers_shorten(registers, true);
	kind = db_opcua_kind_take(kinds, db_opcua_type_of_family("vsmd-serial"), registers,
	                          commands);
	assert_non_null(kind);
	json_decref(registers);
	json_decref(commands);
	return kind;
}

static void make_plant(struct plant *plant, const char *name)
{
	plant->kinds = NULL;
	plant->drive = db_opcua_drive_new(name, "line", take_kind(&plant->kinds));
	assert_non_null(plant->drive);
}

static void free_plant(struct plant *plant)
{
	db_opcua_drive_free(&plant->kinds, plant->drive);
	assert_null(plant->kinds);
}

static void take(struct db_opcua_drive *drive, const char *text, int64_t time_us)
{
	json_t *values = parse(text);

	db_opcua_drive_take(drive, values, time_us);
	json_decref(values);
}

static enum db_opcua_group group_of(const struct plant *plant, const char *reg)
{
	const struct db_opcua_item *item = db_opcua_drive_find(plant->drive, reg);

	assert_non_null(item);
	return item->reg->group;
}

static void test_registers_find_their_folders(void **state)
{
	struct plant plant;

	(void)state;
	make_plant(&plant, "feeder");
	assert_int_equal(group_of(&plant, "position"), DB_OPCUA_PROCESS);
	assert_int_equal(group_of(&plant, "command_id"), DB_OPCUA_COMMAND);
	assert_int_equal(group_of(&plant, "target_position"), DB_OPCUA_COMMAND);
	assert_int_equal(group_of(&plant, "spd"), DB_OPCUA_PARAMETERS);
	assert_int_equal(group_of(&plant, "identity"), DB_OPCUA_SERVICE);
	assert_int_equal(group_of(&plant, "history2_command"), DB_OPCUA_HISTORY);
	assert_int_equal(group_of(&plant, "online"), DB_OPCUA_BITS);
	/* An argument of no command of this drive, and a type that is not known here. */
	assert_null(db_opcua_drive_find(plant.drive, "raw_length"));
	assert_null(db_opcua_drive_find(plant.drive, "future"));
	assert_string_equal(db_opcua_drive_find(plant.drive, "spd")->reg->shown, "spd");
	assert_true(db_opcua_drive_find(plant.drive, "online")->reg->own);
	assert_false(db_opcua_drive_find(plant.drive, "input_1")->reg->own);
	free_plant(&plant);
}

static void test_the_history_has_columns(void **state)
{
	struct plant plant;
	const struct db_opcua_kind *kind;

	(void)state;
	make_plant(&plant, "feeder");
	kind = plant.drive->kind;
	assert_int_equal(kind->column_count, 2);
	assert_string_equal(kind->columns[0].shown, "Command");
	assert_int_equal(kind->columns[0].count, 2);
	assert_string_equal(kind->list[kind->columns[0].places[1]].name, "history2_command");
	assert_string_equal(kind->columns[1].shown, "Address");
	free_plant(&plant);
}

static void test_the_history_can_be_left_out(void **state)
{
	json_t *registers = parse(registers_text);
	size_t count = json_array_size(registers);

	(void)state;
	db_opcua_registers_shorten(registers, false);
	assert_int_equal(json_array_size(registers), count - 4);
	json_decref(registers);
}

static void test_drives_that_are_alike_share_their_registers(void **state)
{
	struct db_opcua_kind *kinds = NULL;
	struct db_opcua_kind *one = take_kind(&kinds);
	struct db_opcua_kind *other = take_kind(&kinds);

	(void)state;
	assert_ptr_equal(one, other);
	db_opcua_kind_release(&kinds, one);
	assert_non_null(kinds);
	db_opcua_kind_release(&kinds, other);
	assert_null(kinds);
}

static void test_another_drive_is_watched_as_the_one_before(void **state)
{
	json_t *registers = parse("[{'name':'new','type':'u16','unit':''},"
	                          " {'name':'position','type':'i32','unit':'mm'}]");
	json_t *commands = parse(commands_text);
	struct db_opcua_drive *other;
	struct plant plant;

	(void)state;
	make_plant(&plant, "drive1");
	other = db_opcua_drive_new("drive1", "line",
	                           db_opcua_kind_take(&plant.kinds,
	                                              db_opcua_type_of_family("vsmd-serial"),
	                                              registers, commands));
	assert_non_null(other);
	db_opcua_drive_find(plant.drive, "position")->watchers = 2;
	db_opcua_drive_find(plant.drive, "velocity")->watchers = 1;
	db_opcua_drive_take_watchers(other, plant.drive);
	assert_int_equal(db_opcua_drive_find(other, "position")->watchers, 2);
	assert_int_equal(db_opcua_drive_find(other, "new")->watchers, 0);
	db_opcua_drive_free(&plant.kinds, other);
	free_plant(&plant);
	json_decref(registers);
	json_decref(commands);
}

static void test_what_is_no_list_is_no_kind(void **state)
{
	struct db_opcua_kind *kinds = NULL;
	json_t *object = json_object();

	(void)state;
	assert_null(db_opcua_kind_take(&kinds, db_opcua_type_of_gateway(), object, object));
	assert_null(db_opcua_kind_take(&kinds, db_opcua_type_of_gateway(), NULL, NULL));
	json_decref(object);
}

static enum db_opcua_quality quality_of(const struct plant *plant, const char *reg)
{
	return db_opcua_item_quality(db_opcua_drive_find(plant->drive, reg));
}

static void test_quality_is_the_drives(void **state)
{
	struct plant plant;

	(void)state;
	make_plant(&plant, "feeder");
	assert_int_equal(quality_of(&plant, "position"), DB_OPCUA_NOTHING_YET);
	assert_int_equal(quality_of(&plant, "axis_state"), DB_OPCUA_NOTHING_YET);
	take(plant.drive, "{'quality':192,'position':-7,'axis_state':2}", 1000);
	assert_int_equal(quality_of(&plant, "position"), DB_OPCUA_GOOD);
	assert_int_equal(db_opcua_drive_find(plant.drive, "position")->value.whole, -7);
	take(plant.drive, "{'quality':64}", 0);
	assert_int_equal(quality_of(&plant, "position"), DB_OPCUA_UNCERTAIN);
	take(plant.drive, "{'quality':0,'axis_state':0}", 0);
	assert_int_equal(quality_of(&plant, "position"), DB_OPCUA_NO_CONTACT);
	/* What the bridge knows is good. */
	assert_int_equal(quality_of(&plant, "axis_state"), DB_OPCUA_GOOD);
	plant.drive->lost = true;
	assert_int_equal(quality_of(&plant, "axis_state"), DB_OPCUA_NO_CONTACT);
	free_plant(&plant);
}

static void test_time_is_the_drives(void **state)
{
	struct plant plant;
	const struct db_opcua_item *item;

	(void)state;
	make_plant(&plant, "feeder");
	item = db_opcua_drive_find(plant.drive, "spd");
	take(plant.drive, "{'quality':192,'spd':1.5}", 1000);
	assert_int_equal(item->value.since_us, 1000);
	take(plant.drive, "{'quality':192,'spd':1.5}", 2000);
	assert_int_equal(plant.drive->time_us, 2000);
	assert_int_equal(item->value.since_us, 1000);
	take(plant.drive, "{'spd':2.5}", 3000);
	assert_int_equal(item->value.since_us, 3000);
	take(plant.drive, "{'spd':null}", 4000);
	assert_false(item->value.known);
	free_plant(&plant);
}

static void test_values_that_cannot_be_are_not_known(void **state)
{
	struct plant plant;

	(void)state;
	make_plant(&plant, "feeder");
	take(plant.drive, "{'position':'far','velocity':'fast','identity':5,'online':'yes'}", 1000);
	assert_false(db_opcua_drive_find(plant.drive, "position")->value.known);
	assert_false(db_opcua_drive_find(plant.drive, "velocity")->value.known);
	assert_false(db_opcua_drive_find(plant.drive, "identity")->value.known);
	assert_false(db_opcua_drive_find(plant.drive, "online")->value.known);
	take(plant.drive, "{'online':1,'identity':'VSMD','velocity':3}", 1000);
	assert_true(db_opcua_drive_find(plant.drive, "online")->value.flag);
	assert_string_equal(db_opcua_drive_find(plant.drive, "identity")->value.text, "VSMD");
	assert_true(db_opcua_drive_find(plant.drive, "velocity")->value.real == 3.0F);
	free_plant(&plant);
}

static void test_the_gateway_has_no_drive_behind_it(void **state)
{
	struct plant plant;

	(void)state;
	make_plant(&plant, "");
	take(plant.drive, "{'position':5}", 0);
	assert_int_equal(quality_of(&plant, "position"), DB_OPCUA_GOOD);
	free_plant(&plant);
}

static void test_a_group_is_read_with_its_quality(void **state)
{
	struct plant plant;
	json_t *names;
	json_t *expected = parse("['quality','timestamp_us','spd']");

	(void)state;
	make_plant(&plant, "feeder");
	names = db_opcua_group_names(plant.drive->kind, DB_OPCUA_PARAMETERS, true);
	assert_true(json_equal(names, expected));
	json_decref(names);
	json_decref(expected);
	/* What a stream tells is not asked for. */
	db_opcua_drive_find(plant.drive, "spd")->reg->streamed = true;
	expected = parse("['timestamp_us']");
	names = db_opcua_group_names(plant.drive->kind, DB_OPCUA_PARAMETERS, false);
	assert_true(json_equal(names, expected));
	json_decref(names);
	json_decref(expected);
	free_plant(&plant);
}

static void test_a_range_that_ends_with_its_type_is_not_said(void **state)
{
	static const struct {
		enum db_opcua_type type;
		double min, max;
		bool open;
	} cases[] = {
		{ DB_OPCUA_U16, 0, 65535, true },
		{ DB_OPCUA_U16, 1, 65535, true },
		{ DB_OPCUA_U16, 0, 65534, false },
		{ DB_OPCUA_I16, -32768, 32767, true },
		{ DB_OPCUA_I16, -32767, 32766, false },
		{ DB_OPCUA_U32, 1, 4294967295.0, true },
		{ DB_OPCUA_U32, 0, 4294967294.0, false },
		{ DB_OPCUA_I32, -2147483648.0, 2147483647.0, true },
		{ DB_OPCUA_I32, -2147483648.0, 10, true },
		{ DB_OPCUA_I32, -10, 2147483647.0, true },
		{ DB_OPCUA_I32, -2147483647.0, 2147483646.0, false },
		{ DB_OPCUA_F32, 0, 3.402823466e+38, true },
		{ DB_OPCUA_F32, -3.402823466e+38, 5, true },
		{ DB_OPCUA_F32, -192000, 192000, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		const struct db_opcua_register reg = {
			.type = cases[i].type,
			.min = cases[i].min,
			.max = cases[i].max,
		};

		assert_int_equal(db_opcua_register_is_open(&reg), cases[i].open);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_registers_find_their_folders),
		cmocka_unit_test(test_the_history_has_columns),
		cmocka_unit_test(test_the_history_can_be_left_out),
		cmocka_unit_test(test_drives_that_are_alike_share_their_registers),
		cmocka_unit_test(test_another_drive_is_watched_as_the_one_before),
		cmocka_unit_test(test_what_is_no_list_is_no_kind),
		cmocka_unit_test(test_quality_is_the_drives),
		cmocka_unit_test(test_time_is_the_drives),
		cmocka_unit_test(test_values_that_cannot_be_are_not_known),
		cmocka_unit_test(test_the_gateway_has_no_drive_behind_it),
		cmocka_unit_test(test_a_group_is_read_with_its_quality),
		cmocka_unit_test(test_a_range_that_ends_with_its_type_is_not_said),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
