/* SPDX-License-Identifier: Apache-2.0 */
/* Registers by their names, and commands, as the sessions of the control socket use them. */
#include "codec/vsmd.h"
#include "drivebridge/trouble.h"
#include "fakes/nameplate.h"
#include "fakes/registers.h"
#include "regmap/clients.h"
#include "regmap/named.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

#define ILLEGAL_FUNCTION 0x01
#define ILLEGAL_ADDRESS 0x02
#define ILLEGAL_VALUE 0x03
#define BUSY 0x06
#define NO_PATH 0x0A

#define ONLINE (DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID)

static const struct db_client session = {
	.id = DB_CLIENT_FIRST_SESSION + 1, .address = { 1, 2 }, .port = 9, .may_write = true
};
/* A Modbus client. */
static const struct db_client plc = { .id = 2, .address = { 3 }, .port = 8, .may_write = true };

static struct db_snapshot usual(const struct fake_registers *fake)
{
	return (struct db_snapshot){
		.feedback = { .taken = fake->now - 10 * MS,
		              .taken_wall_us = 0x0001000200030004,
		              .state = DB_AXIS_STANDSTILL,
		              .status = ONLINE,
		              .position = -100000,
		              .velocity = 1.5f,
		              .inputs = 0x21 },
		.stats = { .samples = 77 },
	};
}

static void make(struct fake_registers *fake, const struct db_modbus_config *modbus)
{
	static char names[][8] = { "feeder", "press", "saw" };
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX & ~(UINT64_C(1) << VSMD_MCS));
	struct db_snapshot snapshot;

	fake_registers_init(fake, 2, 3);
	fake->config.modbus = *modbus;
	for (size_t i = 0; i < 3; i++) {
		fake->drives[i].name = names[i];
		fake->drives[i].watchdog_ms = 3000;
	}
	snapshot = usual(fake);
	db_axis_publish(fake->axes[0], &snapshot);
	plate.values[VSMD_CID].u = 5;
	plate.values[VSMD_ACC].f = 25000.0f;
	plate.missing[0] = UINT64_C(1) << VSMD_MCS;
	plate.told[VSMD_CID] = db_told_at(fake->now - 2 * DB_NS_PER_S);
	strcpy(plate.identity, "VSMD113");
	db_axis_publish_nameplate(fake->axes[0], &plate);
	fake_registers_open(fake);
}

#define FAKE()                      \
	struct fake_registers fake; \
	(void)state;                \
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40 })

/* Control is a client's. */
#define CONTROL_FAKE()                                                       \
	struct fake_registers fake;                                          \
	(void)state;                                                         \
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40,            \
	                                        .control = DB_CONTROL_DRIVE, \
	                                        .control_timeout_ms = 5000 })

static const struct db_entry *entry_of(struct fake_registers *fake, uint16_t number,
                                       const char *name)
{
	const struct db_entry *entry = db_name_list_find(
		db_named_registers(fake->registers, number), name);

	assert_non_null(entry);
	return entry;
}

static bool is_wanted(const struct db_entry *entry)
{
	return entry->table == DB_TABLE_HOLDING;
}

/* --- what there is ------------------------------------------------------------------------------------ */

static void drives_and_buses_are_found(void **state)
{
	struct db_named_drive drive;
	struct db_bus_stats stats;

	FAKE();
	assert_int_equal(db_named_drive_count(fake.registers), 3);
	assert_true(db_named_drive_at(fake.registers, 2, &drive));
	assert_int_equal(drive.number, 2);
	assert_string_equal(drive.config->name, "saw");
	assert_ptr_equal(drive.bus, &fake.buses[1]);
	assert_true(drive.commands & DB_COMMAND_BIT(DB_CMD_HOME));
	assert_false(db_named_drive_at(fake.registers, 3, &drive));
	assert_true(db_named_drive_find(fake.registers, "press", &drive));
	assert_int_equal(drive.number, 1);
	assert_false(db_named_drive_find(fake.registers, "lathe", &drive));
	assert_ptr_equal(db_named_bus(fake.registers, 1), &fake.buses[1]);
	assert_null(db_named_bus(fake.registers, 2));
	fake.bus_stats[1].cycles = 12;
	db_named_bus_stats(fake.registers, 1, &stats);
	assert_int_equal(stats.cycles, 12);
	assert_true(db_named_cycle(fake.registers, 0) == 20 * MS);
	assert_true(db_named_cycle(fake.registers, 9) == 0);
	assert_string_equal(db_named_name(fake.registers, 1), "press");
	assert_string_equal(db_named_name(fake.registers, 9), "");
	assert_ptr_equal(db_named_modbus(fake.registers), &fake.config.modbus);
	fake_registers_close(&fake);
}

static void what_is_known_of_a_drive_at_once(void **state)
{
	struct db_named_moment moment;
	struct db_trouble trouble;
	uint16_t error = 99;

	FAKE();
	moment = db_named_moment(fake.registers, 0);
	assert_true(moment.taken == fake.now - 10 * MS);
	assert_int_equal(moment.wall_us, 0x0001000200030004);
	assert_int_equal(moment.samples, 77);
	assert_true(db_named_moment(fake.registers, 9).taken == 0);
	assert_true(db_named_online(fake.registers, 0));
	assert_false(db_named_online(fake.registers, 1));
	assert_false(db_named_online(fake.registers, 9));
	assert_true(db_named_trouble(fake.registers, 0, &trouble, &error));
	assert_int_equal(trouble.cause, DB_TROUBLE_NONE);
	assert_int_equal(error, DB_ERROR_NONE);
	assert_true(db_named_trouble(fake.registers, 1, &trouble, &error));
	assert_int_equal(trouble.cause, DB_TROUBLE_PORT);
	assert_false(db_named_trouble(fake.registers, 9, &trouble, &error));
	fake_registers_close(&fake);
}

/* It is in the list, but nobody reaches it any more. */
static void a_drive_that_leaves_is_not_there(void **state)
{
	const struct db_args none = { 0 };
	struct db_registers_change *change = NULL;
	struct db_named_drive drive;
	struct fake_sheet sheet;
	uint32_t generation;
	uint32_t entry = 9;

	FAKE();
	generation = db_named_generation(fake.registers);
	fake_write_sheet(&fake, &sheet);
	sheet.roster.drive_count = 2;
	assert_int_equal(db_registers_prepare(fake.registers, &sheet.roster, &change), 0);
	db_registers_retire(fake.registers, change);
	assert_int_not_equal(db_named_generation(fake.registers), generation);
	assert_false(db_named_drive_at(fake.registers, 2, &drive));
	assert_false(db_named_drive_find(fake.registers, "saw", &drive));
	assert_true(db_named_drive_find(fake.registers, "press", &drive));
	assert_null(db_named_registers(fake.registers, 2));
	assert_int_equal(
		db_named_run(fake.registers, &session, 2, DB_CMD_STOP, &none, 0, FAKE_TOKEN, &entry)
			.result,
		DB_RESULT_OFFLINE);
	assert_int_equal(entry, 0);
	assert_int_equal(db_named_outcome(fake.registers, 2, 1), DB_RESULT_CANCELLED);
	assert_false(db_named_may_command(fake.registers, &session, 2));
	assert_false(db_named_beat(fake.registers, &session, 2));
	db_named_hear(fake.registers, &session, 2);
	assert_int_equal(fake.submitted, 0);
	db_registers_apply(fake.registers, change);
	fake_registers_close(&fake);
}

static void names_are_by_table_and_address(void **state)
{
	static const int order[] = { [DB_TABLE_HOLDING] = 0,
		                     [DB_TABLE_INPUT] = 1,
		                     [DB_TABLE_DISCRETE] = 2,
		                     [DB_TABLE_COILS] = 3 };
	const struct db_name_list *names;
	bool coils = false;
	bool bits = false;

	FAKE();
	names = db_named_registers(fake.registers, 0);
	for (size_t i = 1; i < names->count; i++) {
		const struct db_entry *last = &names->entries[i - 1];
		const struct db_entry *entry = &names->entries[i];

		assert_true(
			order[entry->table] > order[last->table] ||
			(entry->table == last->table && entry->cell.address >= last->cell.address));
		assert_true(entry->name[0] != '\0');
		assert_ptr_equal(db_name_list_find(names, entry->name), entry);
		bits = bits || entry->table == DB_TABLE_DISCRETE;
		coils = coils || entry->table == DB_TABLE_COILS;
	}
	assert_true(bits && coils);
	/* Drives of a family have theirs in common. */
	assert_ptr_equal(db_named_registers(fake.registers, 1), names);
	assert_null(db_named_registers(fake.registers, 9));
	assert_null(db_name_list_find(names, "aaa"));
	assert_null(db_name_list_find(names, "zzz"));
	fake_registers_close(&fake);
}

/* The gateway's own, and those that repeat the drives' apart. */
static void the_gateways_names_are_its_own(void **state)
{
	const struct db_name_list *own;
	const struct db_name_list *windows;

	FAKE();
	own = db_named_registers(fake.registers, DB_NAMED_GATEWAY);
	windows = db_named_windows(fake.registers);
	assert_non_null(db_name_list_find(own, "bus_count"));
	assert_non_null(db_name_list_find(own, "group_start"));
	for (size_t i = 0; i < own->count; i++)
		assert_false(own->entries[i].cell.part & (DB_PART_DRIVES | DB_PART_WINDOWS));
	assert_true(windows->count > 0);
	for (size_t i = 0; i < windows->count; i++) {
		assert_true(windows->entries[i].cell.part & DB_PART_WINDOWS);
		assert_in_range(windows->entries[i].cell.address, 2000, 2000 + 3 * 24 - 1);
	}
	assert_ptr_equal(db_named_windows(fake.registers), windows);
	fake_registers_close(&fake);
}

/* --- reading ---------------------------------------------------------------------------------------- */

struct seen {
	unsigned count;
	char name[DB_ROW_NAME_MAX];
	struct db_named_value value;
};

static void see(void *context, const char *name, const struct db_entry *entry,
                const struct db_named_value *value)
{
	struct seen *seen = context;

	(void)entry;
	seen->count++;
	strcpy(seen->name, name);
	seen->value = *value;
}

static struct db_named_value read_name(struct fake_registers *fake, uint16_t number,
                                       const char *name)
{
	const struct db_entry *entry = entry_of(fake, number, name);
	struct seen seen = { .count = 0 };

	assert_true(db_named_read(fake->registers, &session, number, &entry, 1, NULL, see, &seen));
	assert_int_equal(seen.count, 1);
	assert_string_equal(seen.name, name);
	return seen.value;
}

static void values_are_what_the_registers_hold(void **state)
{
	struct db_named_value value;

	FAKE();
	value = read_name(&fake, 0, "position");
	assert_int_equal(value.kind, DB_NAMED_WHOLE);
	assert_int_equal(value.whole, -100000);
	assert_true(value.told == 0);
	value = read_name(&fake, 0, "timestamp_us");
	assert_int_equal(value.kind, DB_NAMED_WHOLE);
	assert_true(value.whole == INT64_C(0x0001000200030004));
	value = read_name(&fake, 0, "velocity");
	assert_int_equal(value.kind, DB_NAMED_REAL);
	assert_true(value.real > 1.4f && value.real < 1.6f);
	value = read_name(&fake, 0, "identity");
	assert_int_equal(value.kind, DB_NAMED_TEXT);
	assert_string_equal(value.text, "VSMD113");
	value = read_name(&fake, 0, "online");
	assert_int_equal(value.kind, DB_NAMED_FLAG);
	assert_int_equal(value.whole, 1);
	assert_int_equal(read_name(&fake, 0, "params_valid").whole, 1);
	assert_int_equal(read_name(&fake, 0, "moving").whole, 0);
	assert_int_equal(read_name(&fake, 0, "bus_up").whole, 1);
	assert_int_equal(read_name(&fake, 0, "input_1").kind, DB_NAMED_FLAG);
	assert_int_equal(read_name(&fake, 0, "input_1").whole, 1);
	assert_int_equal(read_name(&fake, 0, "input_2").whole, 0);
	assert_int_equal(read_name(&fake, DB_NAMED_GATEWAY, "drive_count").whole, 3);
	fake_registers_close(&fake);
}

static void parameters_say_when_they_were_told(void **state)
{
	struct db_snapshot snapshot;
	struct db_named_value value;

	FAKE();
	value = read_name(&fake, 0, "cid");
	assert_int_equal(value.kind, DB_NAMED_WHOLE);
	assert_int_equal(value.whole, 5);
	assert_in_range(fake.now - value.told, 1990 * MS, 2010 * MS);
	assert_int_equal(read_name(&fake, 0, "mcs").kind, DB_NAMED_MISSING);
	assert_true(read_name(&fake, 0, "mcs").told == 0);
	/* Nothing is known of one of before. */
	snapshot = usual(&fake);
	snapshot.feedback.status &= ~(uint32_t)DB_STATUS_PARAMS_VALID;
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(read_name(&fake, 0, "cid").kind, DB_NAMED_UNKNOWN);
	assert_true(read_name(&fake, 0, "cid").told == 0);
	/* Nor of what is read from a drive that does not answer. */
	snapshot.feedback.status = DB_STATUS_BUS_UP;
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(read_name(&fake, 0, "position").kind, DB_NAMED_UNKNOWN);
	assert_int_equal(read_name(&fake, 0, "online").whole, 0);
	fake_registers_close(&fake);
}

static void a_read_is_of_one_moment(void **state)
{
	const struct db_entry *entries[2];
	struct db_named_moment moment = { .samples = 5 };
	struct seen seen = { .count = 0 };

	FAKE();
	entries[0] = entry_of(&fake, 0, "position");
	entries[1] = entry_of(&fake, 0, "unit_name");
	assert_true(db_named_read(fake.registers, &session, 0, entries, 2, &moment, see, &seen));
	assert_int_equal(seen.count, 2);
	assert_string_equal(seen.name, "unit_name");
	assert_string_equal(seen.value.text, "counts");
	assert_true(moment.taken == fake.now - 10 * MS);
	assert_int_equal(moment.samples, 77);
	/* Also where none of the values is of it. */
	moment = (struct db_named_moment){ .samples = 5 };
	assert_true(
		db_named_read(fake.registers, &session, 0, &entries[1], 1, &moment, see, &seen));
	assert_int_equal(moment.samples, 77);
	/* The gateway has none, nor has a drive that is not there. */
	entries[0] = entry_of(&fake, DB_NAMED_GATEWAY, "bus_count");
	assert_true(db_named_read(fake.registers, &session, DB_NAMED_GATEWAY, entries, 1, &moment,
	                          see, &seen));
	assert_int_equal(seen.count, 4);
	assert_int_equal(moment.samples, 0);
	moment.samples = 5;
	assert_false(db_named_read(fake.registers, &session, 9, entries, 1, &moment, see, &seen));
	assert_int_equal(seen.count, 4);
	assert_int_equal(moment.samples, 0);
	fake_registers_close(&fake);
}

struct figures {
	unsigned count;
	int64_t cycles;
	int64_t state;
	int64_t error;
	bool has_number; /* a name with the number of a bus in it */
};

static void see_figure(void *context, const char *name, const struct db_entry *entry,
                       const struct db_named_value *value)
{
	struct figures *figures = context;

	(void)entry;
	figures->count++;
	if (strcmp(name, "cycles") == 0)
		figures->cycles = value->whole;
	if (strcmp(name, "line_state") == 0)
		figures->state = value->whole;
	if (strcmp(name, "line_error") == 0)
		figures->error = value->whole;
	figures->has_number = figures->has_number || strpbrk(name, "#1") || name[0] == '\0';
}

/* The requests of one call reach their buses together. */
static void commands_are_gathered_at_every_bus(void **state)
{
	FAKE();
	db_named_gather(fake.registers, true);
	assert_true(fake.gathers[0] && fake.gathers[1]);
	db_named_gather(fake.registers, false);
	assert_false(fake.gathers[0] || fake.gathers[1]);
	fake_registers_close(&fake);
}

/* A parameter that is called as a register of all families is only known by its address. */
static void a_neutral_name_comes_before_a_parameter(void **state)
{
	static const struct db_param params[] = {
		{ .name = "zeta", .type = DB_U16, .unit = "" },
		{ .name = "position", .type = DB_U16, .unit = "" },
		{ .name = "alpha", .type = DB_U16, .unit = "" },
	};
	static const struct db_driver family = {
		.name = "family",
		.params = params,
		.param_count = 3,
		.param_page = 1,
		.acceleration_param = -1,
		.deceleration_param = -1,
	};
	const struct db_scope scope = { .view = DB_VIEW_DRIVE, .driver = &family };
	struct db_name_list *names = db_name_list_new(&scope, is_wanted);

	(void)state;
	assert_int_equal(db_name_list_find(names, "position")->cell.address, 12);
	assert_int_equal(db_name_list_find(names, "zeta")->cell.address, 400);
	assert_int_equal(db_name_list_find(names, "alpha")->cell.address, 402);
	for (size_t i = 0; i < names->count; i++) {
		assert_int_not_equal(names->entries[i].cell.address, 401);
		assert_ptr_equal(db_name_list_find(names, names->entries[i].name),
		                 &names->entries[i]);
	}
	db_name_list_free(names);
}

static void figures_of_a_bus_have_no_number(void **state)
{
	struct figures figures = { .cycles = -1, .state = -1, .error = -1 };

	FAKE();
	fake.bus_stats[1].cycles = 70001;
	fake.bus_stats[1].port.up = true;
	fake.bus_stats[1].port.error = 19;
	assert_true(db_named_read_bus(fake.registers, 1, see_figure, &figures));
	assert_true(figures.count > 20);
	assert_int_equal(figures.cycles, 70001);
	assert_true(figures.state & DB_LINE_UP);
	assert_int_equal(figures.error, 19);
	assert_false(figures.has_number);
	figures.count = 0;
	assert_false(db_named_read_bus(fake.registers, 2, see_figure, &figures));
	assert_int_equal(figures.count, 0);
	fake_registers_close(&fake);
}

/* --- writing ---------------------------------------------------------------------------------------- */

static void numbers_become_words(void **state)
{
	uint16_t words[DB_NAMED_WORDS];

	FAKE();
	assert_true(
		db_named_encode(fake.registers, entry_of(&fake, 0, "target_position"), -2, words));
	assert_int_equal(words[0], 0xFFFF);
	assert_int_equal(words[1], 0xFFFE);
	assert_true(db_named_encode(fake.registers, entry_of(&fake, 0, "cid"), 7, words));
	assert_int_equal(words[0], 7);
	assert_false(db_named_encode(fake.registers, entry_of(&fake, 0, "cid"), 70000, words));
	fake.config.modbus.low_word_first = true;
	assert_true(
		db_named_encode(fake.registers, entry_of(&fake, 0, "target_position"), -2, words));
	assert_int_equal(words[0], 0xFFFE);
	assert_int_equal(words[1], 0xFFFF);
	fake_registers_close(&fake);
}

static void arguments_are_known_by_their_registers(void **state)
{
	struct db_args args = { .target_position = 5 };

	FAKE();
	assert_true(db_named_is_argument(entry_of(&fake, 0, "target_position"),
	                                 DB_ARG_TARGET_POSITION));
	assert_false(db_named_is_argument(entry_of(&fake, 0, "target_position"),
	                                  DB_ARG_TARGET_VELOCITY));
	assert_false(db_named_is_argument(entry_of(&fake, 0, "target_velocity"),
	                                  DB_ARG_TARGET_POSITION));
	assert_false(db_named_is_argument(entry_of(&fake, 0, "command"), DB_ARG_TARGET_POSITION));
	assert_false(db_named_is_argument(entry_of(&fake, 0, "position"), DB_ARG_TARGET_POSITION));
	/* One of several words. */
	assert_true(db_named_is_argument(entry_of(&fake, 0, "raw_request1"), DB_ARG_RAW_REQUEST));
	assert_true(db_named_is_argument(entry_of(&fake, 0, "raw_request8"), DB_ARG_RAW_REQUEST));
	db_named_store_argument(entry_of(&fake, 0, "target_velocity"), 2.5, &args);
	assert_true(args.target_velocity > 2.4f && args.target_velocity < 2.6f);
	db_named_store_argument(entry_of(&fake, 0, "output_number"), 3, &args);
	assert_int_equal(args.output_number, 3);
	assert_int_equal(args.target_position, 5);
	/* What is none of its values is not stored. */
	db_named_store_argument(entry_of(&fake, 0, "output_number"), -1, &args);
	assert_int_equal(args.output_number, 3);
	fake_registers_close(&fake);
}

static void units_are_those_of_the_drive(void **state)
{
	char unit[DB_NAMED_UNIT_MAX];

	FAKE();
	fake.drives[0].unit_name = (char *)"mm";
	db_named_unit(fake.registers, 0, entry_of(&fake, 0, "position_units"), unit);
	assert_string_equal(unit, "mm");
	db_named_unit(fake.registers, 0, entry_of(&fake, 0, "velocity_units"), unit);
	assert_string_equal(unit, "mm/s");
	db_named_unit(fake.registers, 0, entry_of(&fake, 0, "velocity"), unit);
	assert_string_equal(unit, "counts/s");
	db_named_unit(fake.registers, 0, entry_of(&fake, 0, "acc"), unit);
	assert_string_equal(unit, entry_of(&fake, 0, "acc")->param->unit);
	assert_string_equal(entry_of(&fake, 0, "acc")->param->name, "acc");
	db_named_unit(fake.registers, 0, entry_of(&fake, 0, "age_ms"), unit);
	assert_string_equal(unit, "ms");
	db_named_unit(fake.registers, 0, entry_of(&fake, 0, "axis_state"), unit);
	assert_string_equal(unit, "");
	db_named_unit(fake.registers, DB_NAMED_GATEWAY,
	              entry_of(&fake, DB_NAMED_GATEWAY, "group_skew_us"), unit);
	assert_string_equal(unit, "us");
	fake_registers_close(&fake);
}

static void the_limits_of_a_position_are_told(void **state)
{
	double min = 1;
	double max = 1;

	FAKE();
	fake.drives[0].counts_per_unit = 10.0;
	fake.drives[0].max_position = 300.0;
	/* One alone is no range. */
	assert_false(db_named_limit(fake.registers, 0, entry_of(&fake, 0, "position"), &min, &max));
	fake.drives[0].min_position = -5.0;
	assert_true(db_named_limit(fake.registers, 0, entry_of(&fake, 0, "position"), &min, &max));
	assert_true(fabs(min + 50.0) < 1e-9 && fabs(max - 3000.0) < 1e-9);
	/* A way may be longer than where it may lead. */
	assert_false(db_named_limit(fake.registers, 0, entry_of(&fake, 0, "target_position"), &min,
	                            &max));
	assert_false(db_named_limit(fake.registers, 9, entry_of(&fake, 0, "position"), &min, &max));
	fake_registers_close(&fake);
}

static void the_limit_of_a_velocity_is_told(void **state)
{
	double min = 1;
	double max = 1;

	FAKE();
	assert_false(db_named_limit(fake.registers, 0, entry_of(&fake, 0, "target_velocity"), &min,
	                            &max));
	fake.drives[0].counts_per_unit = 10.0;
	fake.drives[0].max_velocity = 20.0;
	assert_true(db_named_limit(fake.registers, 0, entry_of(&fake, 0, "target_velocity"), &min,
	                           &max));
	assert_true(fabs(max - 200.0) < 1e-9 && fabs(min + 200.0) < 1e-9);
	min = max = 1;
	assert_true(db_named_limit(fake.registers, 0, entry_of(&fake, 0, "velocity"), &min, &max));
	assert_true(fabs(max - 200.0) < 1e-9 && fabs(min + 200.0) < 1e-9);
	assert_false(db_named_limit(fake.registers, 0, entry_of(&fake, 0, "target_position"), &min,
	                            &max));
	assert_false(db_named_limit(fake.registers, 9, entry_of(&fake, 0, "target_velocity"), &min,
	                            &max));
	fake_registers_close(&fake);
}

static void a_write_reaches_its_drive_or_the_gateway(void **state)
{
	const uint16_t stop = DB_CMD_STOP;
	const uint16_t seven = 7;

	FAKE();
	assert_int_equal(db_named_write(fake.registers, &session, 0, DB_TABLE_HOLDING, 101, 1,
	                                &stop, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->drive, 0);
	assert_int_equal(db_named_write(fake.registers, &session, DB_NAMED_GATEWAY,
	                                DB_TABLE_HOLDING, 68, 1, &seven, FAKE_TOKEN),
	                 0);
	assert_int_equal(read_name(&fake, DB_NAMED_GATEWAY, "heartbeat").whole, 7);
	assert_int_equal(db_named_write(fake.registers, &session, 9, DB_TABLE_HOLDING, 101, 1,
	                                &stop, FAKE_TOKEN),
	                 NO_PATH);
	assert_int_equal(fake.submitted, 1);
	fake_registers_close(&fake);
}

/* More than an exception says, where there is more. */
static void a_refused_write_has_a_result(void **state)
{
	const uint16_t wrong[] = { 0x7FC0, 0 };
	const uint16_t number = 63;

	CONTROL_FAKE();
	assert_int_equal(db_named_write(fake.registers, &session, 0, DB_TABLE_HOLDING, 101, 1,
	                                &number, FAKE_TOKEN),
	                 ILLEGAL_VALUE);
	assert_int_equal(db_named_write_result(fake.registers, &session, 0, ILLEGAL_VALUE),
	                 DB_RESULT_OUT_OF_RANGE);
	fake.drives[0].max_velocity = 1.0;
	assert_int_equal(fake_put(&fake, 1, 56, 1, 1), BUSY);
	assert_int_equal(db_named_write_result(fake.registers, &session, 0, BUSY),
	                 DB_RESULT_NOT_IN_CONTROL);
	/* That never came so far. */
	assert_int_equal(db_named_write(fake.registers, &session, 0, DB_TABLE_HOLDING, 104, 2,
	                                wrong, FAKE_TOKEN),
	                 ILLEGAL_VALUE);
	assert_int_equal(db_named_write_result(fake.registers, &session, 0, NO_PATH),
	                 db_exception_result(NO_PATH));
	assert_int_equal(db_named_write_result(fake.registers, &session, 9, NO_PATH),
	                 db_exception_result(NO_PATH));
	fake_registers_close(&fake);
}

/* Nothing was sent that the drive could have failed at. */
static void a_write_to_what_the_drive_lacks_is_unsupported(void **state)
{
	const uint16_t value = 5;
	const uint16_t xyza_slave_number = 430;

	CONTROL_FAKE();
	assert_int_equal(db_named_write(fake.registers, &session, 0, DB_TABLE_HOLDING,
	                                xyza_slave_number, 1, &value, FAKE_TOKEN),
	                 ILLEGAL_ADDRESS);
	assert_int_equal(db_named_write_result(fake.registers, &session, 0, ILLEGAL_ADDRESS),
	                 DB_RESULT_UNSUPPORTED);
	assert_int_equal(fake.submitted, 0);
	fake_registers_close(&fake);
}

/* What a page asks before it writes registers for somebody who may not be there. */
static void registers_that_command_are_known(void **state)
{
	const struct db_entry *command;
	const struct db_entry *beat;
	const struct db_entry *start;

	FAKE();
	command = entry_of(&fake, 0, "command");
	beat = entry_of(&fake, 0, "hold_beat");
	start = entry_of(&fake, DB_NAMED_GATEWAY, "group_start");
	assert_true(db_named_commands(0, command, DB_CMD_ENABLE));
	assert_true(db_named_commands(0, command, DB_CMD_HOME));
	assert_false(db_named_commands(0, command, DB_CMD_NONE));
	assert_false(db_named_commands(0, command, DB_CMD_STOP));
	assert_false(db_named_commands(0, entry_of(&fake, 0, "command_id"), 5));
	assert_false(db_named_commands(0, entry_of(&fake, 0, "cid"), 5));
	assert_false(db_named_commands(DB_NAMED_GATEWAY, command, DB_CMD_HOME));
	assert_false(db_named_commands(0, entry_of(&fake, 0, "output_1"), 1));

	assert_true(db_named_moves(0, command, DB_CMD_HOME));
	assert_false(db_named_moves(0, command, DB_CMD_ENABLE));
	assert_false(db_named_moves(0, command, DB_CMD_STOP));
	assert_true(db_named_moves(0, beat, 0));
	assert_false(db_named_moves(0, entry_of(&fake, 0, "target_velocity"), 5));
	assert_false(db_named_moves(0, entry_of(&fake, 0, "cid"), 5));
	assert_false(db_named_moves(0, entry_of(&fake, 0, "output_1"), 1));
	assert_true(db_named_moves(DB_NAMED_GATEWAY, start, 1));
	assert_false(db_named_moves(DB_NAMED_GATEWAY, start, 0));
	assert_false(db_named_moves(DB_NAMED_GATEWAY,
	                            entry_of(&fake, DB_NAMED_GATEWAY, "group_stop"), 1));
	assert_false(db_named_moves(DB_NAMED_GATEWAY,
	                            entry_of(&fake, DB_NAMED_GATEWAY, "heartbeat"), 1));
	fake_registers_close(&fake);
}

static void add_up(void *context, const char *name, const struct db_entry *entry,
                   const struct db_named_value *value)
{
	(void)name;
	(void)entry;
	*(int64_t *)context += value->whole;
}

/* Of the gateway in one read, whichever bus they are of. */
static void figures_of_several_buses_are_read_at_once(void **state)
{
	const struct db_entry *entries[2];
	int64_t sum = 0;

	FAKE();
	fake.bus_stats[0].cycles = 70000;
	fake.bus_stats[1].cycles = 5;
	entries[0] = entry_of(&fake, DB_NAMED_GATEWAY, "bus1_cycles");
	entries[1] = entry_of(&fake, DB_NAMED_GATEWAY, "bus2_cycles");
	assert_true(db_named_read(fake.registers, &session, DB_NAMED_GATEWAY, entries, 2, NULL,
	                          add_up, &sum));
	assert_int_equal(sum, 70005);
	fake_registers_close(&fake);
}

/* --- commands ---------------------------------------------------------------------------------------- */

static struct db_write_answer run(struct fake_registers *fake, const struct db_client *client,
                                  enum db_command command, uint32_t hold_ms, uint32_t *entry)
{
	const struct db_args args = { .target_position = 12, .target_velocity = 100.0f };

	return db_named_run(fake->registers, client, 0, command, &args, hold_ms, FAKE_TOKEN, entry);
}

static void a_command_runs_with_its_arguments(void **state)
{
	uint32_t entry = 0;

	FAKE();
	assert_true(run(&fake, &session, DB_CMD_MOVE_ABSOLUTE, 0, &entry).later);
	assert_int_equal(entry, 1);
	assert_int_equal(fake_last_request(&fake)->args->target_position, 12);
	assert_int_equal(fake_get2(&fake, 1, 102), 0);
	assert_int_equal(db_named_outcome(fake.registers, 0, entry), DB_RESULT_PENDING);
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(db_named_outcome(fake.registers, 0, entry), DB_RESULT_REFUSED);
	assert_true(run(&fake, &session, DB_CMD_STOP, 0, &entry).later);
	assert_int_equal(entry, 2);
	/* A stop has no arguments. */
	assert_int_equal(fake_last_request(&fake)->args->target_position, 0);
	fake_registers_close(&fake);
}

/* Whoever has control: another one may stop, and nothing else. */
static void everybody_may_stop(void **state)
{
	const uint16_t one = 1;
	uint32_t entry = 0;

	CONTROL_FAKE();
	assert_int_equal(db_registers_backend.write(fake.registers, &plc, 1, DB_TABLE_HOLDING, 56,
	                                            1, &one, FAKE_TOKEN),
	                 0);
	assert_false(db_named_may_command(fake.registers, &fake_client, 0));
	assert_int_equal(run(&fake, &fake_client, DB_CMD_HOME, 0, &entry).result,
	                 DB_RESULT_NOT_IN_CONTROL);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake.record.kind, DB_AUDIT_COMMAND);
	assert_int_equal(fake.record.result, DB_RESULT_NOT_IN_CONTROL);
	assert_true(run(&fake, &fake_client, DB_CMD_STOP, 0, &entry).later);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_true(db_named_may_command(fake.registers, &plc, 0));
	assert_true(run(&fake, &plc, DB_CMD_HOME, 0, &entry).later);
	/* Free again: who asks whether it may has it. */
	db_clients_release_control(fake.registers, &plc);
	assert_true(db_named_may_command(fake.registers, &fake_client, 0));
	assert_false(db_named_may_command(fake.registers, &plc, 0));
	fake_registers_close(&fake);
}

static uint32_t remaining_ms(struct fake_registers *fake)
{
	struct db_command_state state;

	db_commander_state(fake->registers->roster->drives[0]->commander, NULL, &state, fake->now);
	return state.watchdog_remaining_ms;
}

/* A motion that is held goes on with the beats of its holder, which are signs of life as well. */
static void beats_keep_a_held_motion_going(void **state)
{
	uint32_t entry;

	FAKE();
	assert_true(run(&fake, &session, DB_CMD_MOVE_VELOCITY, 300, &entry).later);
	fake_complete(&fake, 0, DB_RESULT_OK);
	for (unsigned i = 0; i < 5; i++) {
		fake.now += 299 * MS;
		assert_false(db_named_beat(fake.registers, &plc, 0));
		assert_false(db_named_beat(fake.registers, &session, 1));
		assert_true(db_named_beat(fake.registers, &session, 0));
		assert_int_equal(remaining_ms(&fake), 3000);
		db_registers_expire(fake.registers, fake.now);
		assert_int_equal(fake.submitted, 1);
	}
	fake.now += 300 * MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(fake_last_request(&fake)->cause, DB_STAND_HOLD);
	assert_int_equal(fake.holds_lost, 1);
	assert_false(db_named_beat(fake.registers, &session, 0));
	fake_registers_close(&fake);
}

static void who_sends_nothing_any_more_holds_nothing(void **state)
{
	uint32_t entry;

	FAKE();
	assert_true(run(&fake, &session, DB_CMD_MOVE_VELOCITY, 300, &entry).later);
	fake_complete(&fake, 0, DB_RESULT_OK);
	db_named_desert(fake.registers, &plc);
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 1);
	db_named_desert(fake.registers, &session);
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	fake_complete(&fake, 1, DB_RESULT_OK);
	/* Nor does anybody when the service ends. */
	assert_true(run(&fake, &plc, DB_CMD_MOVE_VELOCITY, 300, &entry).later);
	fake_complete(&fake, 2, DB_RESULT_OK);
	db_registers_end_holds(fake.registers, fake.now);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(fake_last_request(&fake)->cause, DB_STAND_HOLD);
	fake_registers_close(&fake);
}

static void the_end_of_the_service_ends_every_hold(void **state)
{
	const struct db_args args = { .target_velocity = 100.0f };
	struct db_snapshot snapshot;
	unsigned stopped = 0;
	uint32_t entry;

	FAKE();
	snapshot = usual(&fake);
	db_axis_publish(fake.axes[1], &snapshot);
	db_axis_publish(fake.axes[2], &snapshot);
	for (uint16_t drive = 0; drive < 3; drive++) {
		assert_true(db_named_run(fake.registers, &session, drive, DB_CMD_MOVE_VELOCITY,
		                         &args, 300, FAKE_TOKEN, &entry)
		                    .later);
		fake_complete(&fake, drive, DB_RESULT_OK);
	}
	db_registers_end_holds(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 6);
	for (unsigned i = 3; i < 6; i++) {
		assert_int_equal(fake.requests[i].command, DB_CMD_STOP);
		stopped |= 1u << fake.requests[i].drive;
	}
	assert_int_equal(stopped, 7);
	fake_registers_close(&fake);
}

static void who_waits_for_its_motion_is_alive(void **state)
{
	const struct db_entry *position;
	uint32_t entry;
	struct seen seen = { .count = 0 };

	FAKE();
	position = entry_of(&fake, 0, "position");
	assert_true(run(&fake, &session, DB_CMD_MOVE_ABSOLUTE, 0, &entry).later);
	fake_complete(&fake, 0, DB_RESULT_OK);
	fake.now += 1000 * MS;
	assert_int_equal(remaining_ms(&fake), 2000);
	db_named_hear(fake.registers, &session, 0);
	assert_int_equal(remaining_ms(&fake), 3000);
	fake.now += 1000 * MS;
	assert_true(db_named_read(fake.registers, &session, 0, &position, 1, NULL, see, &seen));
	assert_int_equal(remaining_ms(&fake), 3000);
	fake_registers_close(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(drives_and_buses_are_found),
		cmocka_unit_test(what_is_known_of_a_drive_at_once),
		cmocka_unit_test(a_drive_that_leaves_is_not_there),
		cmocka_unit_test(names_are_by_table_and_address),
		cmocka_unit_test(the_gateways_names_are_its_own),
		cmocka_unit_test(values_are_what_the_registers_hold),
		cmocka_unit_test(parameters_say_when_they_were_told),
		cmocka_unit_test(a_read_is_of_one_moment),
		cmocka_unit_test(commands_are_gathered_at_every_bus),
		cmocka_unit_test(a_neutral_name_comes_before_a_parameter),
		cmocka_unit_test(figures_of_a_bus_have_no_number),
		cmocka_unit_test(numbers_become_words),
		cmocka_unit_test(arguments_are_known_by_their_registers),
		cmocka_unit_test(units_are_those_of_the_drive),
		cmocka_unit_test(the_limits_of_a_position_are_told),
		cmocka_unit_test(the_limit_of_a_velocity_is_told),
		cmocka_unit_test(a_write_reaches_its_drive_or_the_gateway),
		cmocka_unit_test(a_refused_write_has_a_result),
		cmocka_unit_test(a_write_to_what_the_drive_lacks_is_unsupported),
		cmocka_unit_test(registers_that_command_are_known),
		cmocka_unit_test(a_command_runs_with_its_arguments),
		cmocka_unit_test(everybody_may_stop),
		cmocka_unit_test(beats_keep_a_held_motion_going),
		cmocka_unit_test(who_sends_nothing_any_more_holds_nothing),
		cmocka_unit_test(figures_of_several_buses_are_read_at_once),
		cmocka_unit_test(the_end_of_the_service_ends_every_hold),
		cmocka_unit_test(who_waits_for_its_motion_is_alive),
	};

	return cmocka_run_group_tests_name("regmap/named", tests, NULL, NULL);
}
