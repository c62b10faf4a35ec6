/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/vsmd_layout.h"

#include "drivebridge/driver.h"
#include "drivebridge/registers.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

#define ILLEGAL_ADDRESS 0x02
#define ILLEGAL_VALUE 0x03
#define FAILURE 0x04
#define BUSY 0x06
#define NO_ANSWER 0x0B

#define ONLINE (DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID)
#define NEUTRAL 1
#define VENDOR 9
#define REQUESTS_MAX 8

/* Addresses and codes are literals here: they are the vendor's map. */

struct fake {
	struct db_bus_config bus;
	struct db_drive_config drive;
	struct db_config config;
	struct db_axis *axis;
	struct db_registers *registers;
	struct db_nameplate plate;
	db_time now;
	struct db_request requests[REQUESTS_MAX];
	struct db_setting settings[REQUESTS_MAX][DB_SETTINGS_MAX];
	unsigned submitted;
	unsigned answered;
	uint8_t answered_with;
};

static db_time fake_now(void *context)
{
	return ((struct fake *)context)->now;
}

static bool fake_submit(void *context, struct db_bus *bus, const struct db_request *request)
{
	struct fake *fake = context;

	assert_null(bus);
	assert_true(fake->submitted < REQUESTS_MAX);
	fake->requests[fake->submitted] = *request;
	fake->requests[fake->submitted].settings = fake->settings[fake->submitted];
	for (size_t i = 0; i < request->setting_count; i++)
		fake->settings[fake->submitted][i] = request->settings[i];
	fake->submitted++;
	return true;
}

static void fake_answer(void *context, struct db_write_token token, uint8_t exception)
{
	struct fake *fake = context;

	assert_int_equal(token.client, 1);
	assert_int_equal(token.sequence, 42);
	fake->answered++;
	fake->answered_with = exception;
}

static void fake_bus_stats(void *context, struct db_bus *bus, struct db_bus_stats *stats)
{
	(void)context;
	(void)bus;
	*stats = (struct db_bus_stats){ .up = true };
}

static void fake_server_stats(void *context, struct db_server_stats *stats)
{
	(void)context;
	*stats = (struct db_server_stats){ 0 };
}

static uint64_t fake_wall(void *context)
{
	return 1700000000000000u + (uint64_t)((struct fake *)context)->now / 1000;
}

static const struct db_registers_ops ops = {
	.wall_us = fake_wall,
	.now = fake_now,
	.submit = fake_submit,
	.answer = fake_answer,
	.bus_stats = fake_bus_stats,
	.server_stats = fake_server_stats,
};

static void publish(struct fake *fake, uint32_t status)
{
	struct db_snapshot snapshot = {
		.feedback = {
			.taken = fake->now,
			.position = -100000,
			.velocity = 1.5f,
			.drive_status = 0xA1B2C3D4,
			.state = DB_AXIS_STANDSTILL,
			.status = status,
		},
	};

	db_axis_publish(fake->axis, &snapshot);
}

static void make_registers(struct fake *fake)
{
	const struct db_roster_bus bus = { .config = &fake->bus };
	const struct db_roster_drive drive = { .config = &fake->drive, .axis = fake->axis };
	const struct db_roster roster = { &fake->config.modbus, &bus, 1, &drive, 1 };

	assert_int_equal(db_registers_new(&roster, &ops, fake, &fake->registers), 0);
}

static void make(struct fake *fake)
{
	static char name[] = "feeder";
	static char unit_name[] = "counts";

	memset(fake, 0, sizeof *fake);
	fake->now = 5000 * MS;
	fake->bus = (struct db_bus_config){ .driver = db_driver_find("vsmd-serial"),
		                            .transport = &db_transport_serial,
		                            .queue = 32,
		                            .baud = 115200,
		                            .stop_bits = 1,
		                            .cycle_ms = 20 };
	fake->drive = (struct db_drive_config){ .name = name,
		                                .address = 5,
		                                .unit = NEUTRAL,
		                                .vendor_unit = VENDOR,
		                                .counts_per_unit = 1.0,
		                                .unit_name = unit_name,
		                                .on_client_loss = DB_ON_LOSS_STOP,
		                                .watchdog_ms = 500,
		                                .min_position = (double)NAN,
		                                .max_position = (double)NAN,
		                                .max_velocity = (double)NAN,
		                                .max_acceleration = (double)NAN };
	fake->config = (struct db_config){
		.modbus = { .confirm_ms = 40 },
		.buses = &fake->bus,
		.bus_count = 1,
		.drives = &fake->drive,
		.drive_count = 1,
	};
	fake->axis = db_axis_new();
	publish(fake, ONLINE);
	fake->plate = (struct db_nameplate){ .valid = UINT64_MAX,
		                             .identity = "VSMD113_025T-1.0.008.170428" };
	fake->plate.values[VSMD_SPD].f = 6400.0f;
	fake->plate.values[VSMD_BDR].u = 115200;
	fake->plate.values[VSMD_CID].u = 5;
	fake->plate.values[VSMD_ZSP].i = -2;
	db_axis_publish_nameplate(fake->axis, &fake->plate);
	make_registers(fake);
}

#define FAKE()            \
	struct fake fake; \
	(void)state;      \
	make(&fake)

static void drop(struct fake *fake)
{
	db_registers_free(fake->registers);
	db_axis_free(fake->axis);
}

static const struct db_client client = { .id = 1, .may_write = true };

static int get(struct fake *fake, enum db_table table, uint16_t address, uint16_t count,
               uint16_t *values)
{
	return db_registers_backend.read(fake->registers, &client, VENDOR, table, address, count,
	                                 values);
}

static uint16_t get1(struct fake *fake, uint16_t address)
{
	uint16_t value = 0xDEAD;

	assert_int_equal(get(fake, DB_TABLE_HOLDING, address, 1, &value), 0);
	return value;
}

static int put(struct fake *fake, uint16_t address, unsigned count, ...)
{
	uint16_t values[128];
	va_list words;

	va_start(words, count);
	for (unsigned i = 0; i < count; i++)
		values[i] = (uint16_t)va_arg(words, int);
	va_end(words);
	return db_registers_backend.write(fake->registers, &client, VENDOR, DB_TABLE_HOLDING,
	                                  address, (uint16_t)count, values,
	                                  (struct db_write_token){ 1, 42 });
}

/* The bus ends its request of this number, from 0. */
static void finish(struct fake *fake, unsigned number, enum db_result result)
{
	struct db_completion completion = {
		.ticket = fake->requests[number].ticket,
		.result = result,
		.finished = fake->now,
	};

	assert_true(number < fake->submitted);
	db_registers_complete(fake->registers, &completion, fake->now);
}

/* --- the table --------------------------------------------------------------------------------------- */

static const struct {
	unsigned address;
	unsigned registers;
	const char *name;
} MAP[] = {
	{ 0x00, 1, "command" },   { 0x01, 2, "pos" },       { 0x03, 2, "spd" },
	{ 0x05, 2, "acc" },       { 0x07, 2, "dec" },       { 0x09, 2, "cra" },
	{ 0x0B, 2, "crn" },       { 0x0D, 2, "crh" },       { 0x0F, 1, "s_modes" },
	{ 0x10, 1, "s1_events" }, { 0x11, 1, "s2_events" }, { 0x12, 1, "s3_events" },
	{ 0x13, 1, "s4_events" }, { 0x14, 1, "s5_events" }, { 0x15, 1, "s6_events" },
	{ 0x18, 1, "zmd" },       { 0x19, 1, "osv" },       { 0x1A, 1, "snr" },
	{ 0x1B, 2, "zsd" },       { 0x1D, 2, "zsp" },       { 0x1F, 1, "cid" },
	{ 0x20, 2, "bdr" },       { 0x22, 1, "mcs" },       { 0x23, 1, "msr" },
	{ 0x24, 1, "msv" },       { 0x25, 1, "psr" },       { 0x26, 1, "psv" },
	{ 0x27, 1, "zar" },       { 0x28, 1, "pae" },       { 0x29, 1, "mbs" },
	{ 0x2A, 1, "pud" },       { 0x2B, 1, "emod" },      { 0x2C, 1, "elns" },
	{ 0x2D, 1, "estp" },      { 0x2E, 1, "erty" },      { 0x2F, 1, "edir" },
	{ 0x30, 1, "ewr" },       { 0x31, 1, "ez" },        { 0x33, 2, "zcr" },
	{ 0x35, 2, "eratio" },    { 0x37, 2, "esds" },      { 0x39, 2, "res" },
	{ 0x3C, 2, "spos" },      { 0x3E, 2, "epos" },      { 0x40, 2, "freq" },
	{ 0x42, 1, "cycles" },    { 0x43, 2, "sml" },       { 0x45, 2, "spl" },
	{ 0, 2, "speed" },        { 2, 2, "position" },     { 4, 2, "status" },
	{ 6, 14, "version" },
};

#define MAP_ROWS (sizeof(MAP) / sizeof(MAP[0]))

static void expect_row(void *context, const struct db_entry *entry)
{
	size_t *seen = context;

	if (entry->name[0] == '\0')
		return;
	assert_true(*seen < MAP_ROWS);
	assert_string_equal(entry->name, MAP[*seen].name);
	assert_int_equal(entry->cell.address, MAP[*seen].address);
	assert_int_equal(entry->cell.registers, MAP[*seen].registers);
	assert_int_equal(entry->table, *seen < MAP_ROWS - 4 ? DB_TABLE_HOLDING : DB_TABLE_INPUT);
	++*seen;
}

static void the_map(void **state)
{
	static const enum db_table tables[] = { DB_TABLE_HOLDING, DB_TABLE_INPUT };
	size_t seen = 0;

	(void)state;
	db_vsmd_layout_each(db_driver_find("vsmd-serial"), expect_row, &seen);
	assert_int_equal(seen, MAP_ROWS);
	for (unsigned i = 0; i < 2; i++) {
		size_t count;
		const struct vsmd_row *rows = db_vsmd_layout_rows(tables[i], &count);
		unsigned next = 0;

		for (size_t j = 0; j < count; j++) {
			struct db_cell cell = db_vsmd_layout_cell(&rows[j]);

			assert_int_equal(cell.address, next);
			next += cell.registers;
		}
	}
}

static void families(void **state)
{
	(void)state;
	assert_true(db_driver_find("vsmd-serial")->vendor_layout);
	assert_true(db_driver_find("vsmd-can")->vendor_layout);
	assert_false(db_driver_find("servo-can")->vendor_layout);
}

/* --- reading ----------------------------------------------------------------------------------------- */

static void input_registers(void **state)
{
	static const char text[] = "VSMD113_025T-1.0.008.170428";
	uint16_t values[20];

	FAKE();
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 0, 20, values), 0);
	assert_int_equal(values[0], 0x0000);
	assert_int_equal(values[1], 0x3FC0); /* 1.5 */
	assert_int_equal(values[2], 0x7960); /* -100000 = FFFE7960 */
	assert_int_equal(values[3], 0xFFFE);
	assert_int_equal(values[4], 0xC3D4);
	assert_int_equal(values[5], 0xA1B2);
	for (unsigned i = 0; i < sizeof text; i++)
		assert_int_equal(values[6 + i / 2] >> 8 * (i % 2) & 0xFF, text[i]);
	/* The other word order; text is not a number. */
	assert_int_equal(put(&fake, 0x29, 1, 1), 0);
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 0, 20, values), 0);
	assert_int_equal(values[0], 0x3FC0);
	assert_int_equal(values[3], 0x7960);
	assert_int_equal(values[5], 0xC3D4);
	assert_int_equal(values[6], 'S' << 8 | 'V');
	/* From the middle of a value. */
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 3, 2, values), 0);
	assert_int_equal(values[0], 0x7960);
	assert_int_equal(values[1], 0xA1B2);
	drop(&fake);
}

static void what_does_not_exist(void **state)
{
	uint16_t values[80];

	FAKE();
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 20, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 0, 21, values), ILLEGAL_ADDRESS);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0, 0x47, values), 0);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0, 0x48, values), ILLEGAL_ADDRESS);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0x47, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 65535, 2, values), ILLEGAL_ADDRESS);
	assert_int_equal(get(&fake, DB_TABLE_COILS, 0, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(get(&fake, DB_TABLE_DISCRETE, 0, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(put(&fake, 0x47, 1, 0), ILLEGAL_ADDRESS);
	assert_int_equal(put(&fake, 0x46, 2, 0, 0), ILLEGAL_ADDRESS);
	assert_int_equal(put(&fake, 101, 1, DB_CMD_ENABLE), ILLEGAL_ADDRESS);
	/* The places between the registers. */
	for (unsigned i = 0; i < 4; i++) {
		static const uint16_t between[] = { 0x16, 0x17, 0x32, 0x3B };

		assert_int_equal(get1(&fake, between[i]), 0);
		assert_int_equal(put(&fake, between[i], 1, 0), 0);
		assert_int_equal(put(&fake, between[i], 1, 1), ILLEGAL_VALUE);
	}
	assert_int_equal(fake.submitted, 0);
	drop(&fake);
}

static void parameters_are_read(void **state)
{
	uint16_t values[2];

	FAKE();
	fake.plate.values[VSMD_S1].u = 1;
	fake.plate.values[VSMD_S6].u = 1;
	fake.plate.values[VSMD_S3F].u = 6;
	fake.plate.values[VSMD_S3R].u = 9;
	db_axis_publish_nameplate(fake.axis, &fake.plate);
	assert_int_equal(get1(&fake, 0x0F), 0x21);
	assert_int_equal(get1(&fake, 0x12), 0x0609);
	assert_int_equal(get1(&fake, 0x1F), 5);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0x20, 2, values), 0);
	assert_int_equal(values[0], 115200 & 0xFFFF);
	assert_int_equal(values[1], 115200 >> 16);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0x03, 2, values), 0);
	assert_int_equal(values[1], 0x45C8); /* 6400 = 45C80000 */
	assert_int_equal(put(&fake, 0x29, 1, 1), 0);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0x1D, 2, values), 0);
	assert_int_equal(values[0], 0xFFFF);
	assert_int_equal(values[1], 0xFFFE);
	drop(&fake);
}

static void a_drive_that_does_not_answer(void **state)
{
	uint16_t values[80];

	FAKE();
	/* Online, but nothing is known of its parameters yet. */
	publish(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 0, 6, values), 0);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 3, 2, values), NO_ANSWER);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0, 0x47, values), NO_ANSWER);
	publish(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 0, 2, values), NO_ANSWER);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0x0F, 1, values), NO_ANSWER);
	assert_int_equal(get(&fake, DB_TABLE_HOLDING, 0, 3, values), 0);
	assert_int_equal(put(&fake, 0, 1, 0x0101), NO_ANSWER);
	assert_int_equal(get1(&fake, 0), 0);
	fake.config.modbus.stale_values = true;
	assert_int_equal(get(&fake, DB_TABLE_INPUT, 0, 6, values), 0);
	assert_int_equal(get1(&fake, 0x1F), 5);
	drop(&fake);
}

static void parameters_a_model_does_not_have(void **state)
{
	FAKE();
	fake.plate.valid &= ~(UINT64_C(1) << VSMD_ELNS);
	fake.plate.values[VSMD_ELNS].u = 77;
	db_axis_publish_nameplate(fake.axis, &fake.plate);
	assert_int_equal(get1(&fake, 0x2C), 0);
	assert_int_equal(put(&fake, 0x2C, 1, 0), 0);
	assert_int_equal(put(&fake, 0x2C, 1, 1000), ILLEGAL_ADDRESS);
	assert_int_equal(fake.submitted, 0);
	drop(&fake);
}

/* --- commands ---------------------------------------------------------------------------------------- */

static const struct {
	uint16_t code;
	enum db_command command;
	uint16_t port;
	uint16_t value;
} CODES[] = {
	{ 0x0100, DB_CMD_DISABLE, 0, 0 },
	{ 0x0101, DB_CMD_ENABLE, 0, 0 },
	{ 0x0200, DB_CMD_SET_POSITION, 0, 0 },
	{ 0x0300, DB_CMD_MOVE_PRESET, 0, 0 },
	{ 0x0301, DB_CMD_MOVE_ABSOLUTE, 0, 0 },
	{ 0x0302, DB_CMD_MOVE_RELATIVE, 0, 0 },
	{ 0x0400, DB_CMD_STOP, 0, 0 },
	{ 0x0401, DB_CMD_QUICK_STOP, 0, 0 },
	{ 0x0500, DB_CMD_SAVE_PARAMETERS, 0, 0 },
	{ 0x0600, DB_CMD_HOME_STOP, 0, 0 },
	{ 0x0601, DB_CMD_HOME, 0, 0 },
	{ 0x0700, DB_CMD_SET_OUTPUT, 1, 0 },
	{ 0x0701, DB_CMD_SET_OUTPUT, 1, 1 },
	{ 0x0800, DB_CMD_SET_OUTPUT, 2, 0 },
	{ 0x0901, DB_CMD_SET_OUTPUT, 3, 1 },
	{ 0x0A00, DB_CMD_SET_OUTPUT, 4, 0 },
	{ 0x0B01, DB_CMD_SET_OUTPUT, 5, 1 },
	{ 0x0C00, DB_CMD_SET_OUTPUT, 6, 0 },
	{ 0x0C01, DB_CMD_SET_OUTPUT, 6, 1 },
	{ 0x1000, DB_CMD_CLEAR_FAULT, 0, 0 },
	{ 0x1300, DB_CMD_SHAKE_STOP, 0, 0 },
	{ 0x1301, DB_CMD_SHAKE_START, 0, 0 },
	{ 0x1302, DB_CMD_SHAKE_START_TIME, 0, 0 },
	{ 0x1400, DB_CMD_SET_NMOS, 1, 0 },
	{ 0x1555, DB_CMD_SET_NMOS, 2, 0x55 },
	{ 0x16FF, DB_CMD_SET_NMOS, 3, 0xFF },
	{ 0x1701, DB_CMD_SET_SV, 1, 1 },
	{ 0x1880, DB_CMD_SET_SV, 2, 0x80 },
	{ 0x19FF, DB_CMD_SET_SV, 3, 0xFF },
};

static void command_codes(void **state)
{
	FAKE();
	/* 1 Hz, from 100 to -1, 7 cycles */
	assert_int_equal(put(&fake, 0x3C, 7, 100, 0, 0xFFFF, 0xFFFF, 0, 0x3F80, 7), 0);
	assert_int_equal(put(&fake, 0x01, 2, 0x7960, 0xFFFE), 0);
	for (size_t i = 0; i < sizeof(CODES) / sizeof(CODES[0]); i++) {
		const struct db_request *request = &fake.requests[0];

		fake.submitted = 0;
		assert_int_equal(put(&fake, 0, 1, CODES[i].code), DB_WRITE_LATER);
		assert_int_equal(fake.submitted, 1);
		assert_int_equal(request->command, CODES[i].command);
		assert_int_equal(request->args.output_number, CODES[i].port);
		if (CODES[i].port)
			assert_int_equal(request->args.output_value, CODES[i].value);
		if (CODES[i].command == DB_CMD_SET_POSITION)
			assert_int_equal(request->args.target_position, 0);
		else
			assert_int_equal(request->args.target_position, -100000);
		assert_true(request->args.target_velocity == 0.0f);
		assert_int_equal(request->args.shake_start_position, 100);
		assert_int_equal(request->args.shake_end_position, -1);
		assert_true(request->args.shake_frequency == 1.0f);
		assert_int_equal(request->args.shake_cycles, 7);
		assert_int_equal(request->args.shake_time, 7);
		finish(&fake, 0, DB_RESULT_OK);
		assert_int_equal(fake.answered, i + 1);
		assert_int_equal(fake.answered_with, 0);
		assert_int_equal(get1(&fake, 0), CODES[i].code);
	}
	drop(&fake);
}

static void codes_that_do_not_exist(void **state)
{
	static const uint16_t wrong[] = { 0x0001, 0x0102, 0x0201, 0x0303, 0x0402,
		                          0x0501, 0x0602, 0x0702, 0x0C02, 0x0D00,
		                          0x1001, 0x1303, 0x13FF, 0x1A00, 0xFFFF };

	FAKE();
	assert_int_equal(put(&fake, 0, 1, 0x0101), DB_WRITE_LATER);
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_int_equal(put(&fake, 0, 3, wrong[i], 5, 0), ILLEGAL_VALUE);
		assert_int_equal(get1(&fake, 0), 0x0101);
		assert_int_equal(get1(&fake, 1), 0);
	}
	/* Shaking without a frequency. */
	assert_int_equal(put(&fake, 0, 1, 0x1301), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

static void writing_pos_starts_a_move(void **state)
{
	FAKE();
	/* Not before position mode. */
	assert_int_equal(put(&fake, 1, 2, 11, 0), 0);
	assert_int_equal(put(&fake, 0, 1, 0x0301), DB_WRITE_LATER);
	assert_int_equal(fake.requests[0].args.target_position, 11);
	assert_int_equal(put(&fake, 1, 2, 12, 0), DB_WRITE_LATER);
	assert_int_equal(fake.requests[1].command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake.requests[1].args.target_position, 12);
	/* Both at once are one move. */
	assert_int_equal(put(&fake, 0, 3, 0x0302, 13, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(fake.requests[2].command, DB_CMD_MOVE_RELATIVE);
	assert_int_equal(fake.requests[2].args.target_position, 13);
	assert_int_equal(put(&fake, 1, 2, 14, 0), DB_WRITE_LATER);
	assert_int_equal(fake.requests[3].command, DB_CMD_MOVE_RELATIVE);
	/* Half a position is none. */
	assert_int_equal(put(&fake, 1, 1, 15), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 2, 1, 15), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0, 2, 0x0301, 15), ILLEGAL_VALUE);
	assert_int_equal(get1(&fake, 1), 14);
	/* Other commands end the mode. */
	assert_int_equal(put(&fake, 0, 1, 0x0400), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 1, 2, 16, 0), 0);
	assert_int_equal(fake.submitted, 5);
	assert_int_equal(get1(&fake, 1), 16);
	drop(&fake);
}

static void no_command_ends_position_mode(void **state)
{
	FAKE();
	assert_int_equal(put(&fake, 0, 1, 0x0301), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, 3, 0, 5, 0), 0);
	assert_int_equal(put(&fake, 1, 2, 6, 0), 0);
	assert_int_equal(get1(&fake, 1), 6);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

static void each_write_executes(void **state)
{
	FAKE();
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(put(&fake, 0, 3, 0x0302, 5, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static void word_order_of_writes(void **state)
{
	FAKE();
	assert_int_equal(put(&fake, 0, 3, 0x0301, 2, 1), DB_WRITE_LATER);
	assert_int_equal(fake.requests[0].args.target_position, 0x10002);
	assert_int_equal(put(&fake, 0x29, 1, 2), ILLEGAL_VALUE);
	assert_int_equal(get1(&fake, 0x29), 0);
	assert_int_equal(put(&fake, 0x29, 1, 1), 0);
	assert_int_equal(get1(&fake, 0x29), 1);
	assert_int_equal(put(&fake, 0, 3, 0x0301, 2, 1), DB_WRITE_LATER);
	assert_int_equal(fake.requests[1].args.target_position, 0x20001);
	assert_int_equal(get1(&fake, 1), 2);
	drop(&fake);
}

static void first_word_order(void **state)
{
	FAKE();
	db_registers_free(fake.registers);
	fake.drive.vendor_high_first = true;
	make_registers(&fake);
	assert_int_equal(get1(&fake, 0x29), 1);
	drop(&fake);
}

/* --- parameters -------------------------------------------------------------------------------------- */

static void parameter_writes(void **state)
{
	const struct db_request *request;

	FAKE();
	request = &fake.requests[0];
	/* spd 1000, acc 2000, dec 3000 */
	assert_int_equal(put(&fake, 3, 6, 0, 0x447A, 0, 0x44FA, 0x8000, 0x453B), DB_WRITE_LATER);
	assert_int_equal(request->command, DB_CMD_NONE);
	assert_int_equal(request->setting_count, 3);
	assert_int_equal(request->settings[0].param, VSMD_SPD);
	assert_true(request->settings[0].value.f == 1000.0f);
	assert_int_equal(request->settings[2].param, VSMD_DEC);
	assert_true(request->settings[2].value.f == 3000.0f);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);

	fake.submitted = 0;
	assert_int_equal(put(&fake, 0x0F, 2, 0x21, 0x0903), DB_WRITE_LATER);
	assert_int_equal(request->setting_count, 8);
	for (unsigned i = 0; i < 6; i++) {
		assert_int_equal(request->settings[i].param, VSMD_S1 + i);
		assert_int_equal(request->settings[i].value.u, i == 0 || i == 5);
	}
	assert_int_equal(request->settings[6].param, VSMD_S1F);
	assert_int_equal(request->settings[6].value.u, 9);
	assert_int_equal(request->settings[7].param, VSMD_S1R);
	assert_int_equal(request->settings[7].value.u, 3);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered_with, FAILURE);
	drop(&fake);
}

static void parameters_out_of_range(void **state)
{
	FAKE();
	assert_int_equal(put(&fake, 0x0F, 1, 0x40), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0x10, 1, 0x0A00), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0x10, 1, 0x000A), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0x22, 1, 9), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0x2A, 1, 64), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0x05, 2, 0, 0xBF80), ILLEGAL_VALUE); /* -1 */
	assert_int_equal(put(&fake, 0x05, 2, 0, 0x7FC0), ILLEGAL_VALUE); /* not a number */
	assert_int_equal(put(&fake, 0x05, 1, 0), ILLEGAL_VALUE);         /* half */
	assert_int_equal(put(&fake, 0x39, 2, 999, 0), ILLEGAL_VALUE);    /* res */
	assert_int_equal(put(&fake, 0x40, 2, 0, 0x7F80), ILLEGAL_VALUE); /* infinite */
	assert_int_equal(put(&fake, 0, 3, 0x0301, 0, 0x7F80), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

/* --- parameters and a command in one write --------------------------------------------------------------- */

/* Command, pos 5, spd 1000. */
static int put_both(struct fake *fake, uint16_t code)
{
	return put(fake, 0, 5, code, 5, 0, 0, 0x447A);
}

static void the_command_follows_its_parameters(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.requests[0].setting_count, 1);
	/* Nothing may get in between. */
	assert_int_equal(put(&fake, 0, 1, 0x0300), BUSY);
	assert_int_equal(put(&fake, 1, 2, 6, 0), BUSY);
	assert_int_equal(put(&fake, 0x28, 1, 1), BUSY);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake.requests[1].args.target_position, 5);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, FAILURE);
	assert_int_equal(put(&fake, 0, 1, 0x0300), DB_WRITE_LATER);
	drop(&fake);
}

static void refused_parameters_hold_the_command_back(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, FAILURE);
	assert_int_equal(fake.submitted, 1);
	/* Wrong ones, and those of a wrong command, are not even asked for. */
	assert_int_equal(put_both(&fake, 0x0303), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0, 5, 0x0301, 5, 0, 0, 0x7FC0), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

static void a_stop_in_between_ends_the_chain(void **state)
{
	const uint16_t stop[] = { 0, DB_CMD_STOP };

	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	/* From the neutral unit, for instance. */
	assert_int_equal(db_registers_backend.write(fake.registers, &client, NEUTRAL,
	                                            DB_TABLE_HOLDING, 100, 2, stop,
	                                            (struct db_write_token){ 1, 42 }),
	                 DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, FAILURE);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

static void a_stop_goes_first(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0400), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[0].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[1].setting_count, 1);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, 0);
	drop(&fake);
}

static void a_slow_chain_goes_on_unattended(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	fake.now += 41 * MS;
	publish(&fake, ONLINE);
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, 0x05);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_MOVE_ABSOLUTE);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	drop(&fake);
}

static void a_failed_writers_command_is_dropped(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	publish(&fake, DB_STATUS_BUS_UP);
	fake.now += 41 * MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.answered_with, NO_ANSWER);
	publish(&fake, ONLINE);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(put(&fake, 0, 1, 0x0300), DB_WRITE_LATER);
	drop(&fake);
}

static void accepted_writes_are_chained_too(void **state)
{
	FAKE();
	db_registers_free(fake.registers);
	fake.config.modbus.accept_writes = true;
	make_registers(&fake);
	assert_int_equal(put_both(&fake, 0x0301), 0);
	assert_int_equal(fake.submitted, 1);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	drop(&fake);
}

/* --- one drive, two units ------------------------------------------------------------------------------------ */

static void units(void **state)
{
	uint16_t values[2];

	FAKE();
	assert_int_equal(db_registers_backend.unit(fake.registers, VENDOR), 0);
	assert_int_equal(db_registers_backend.unit(fake.registers, VENDOR + 1), 0x0A);
	assert_int_equal(db_registers_backend.read(fake.registers, &client, NEUTRAL, DB_TABLE_INPUT,
	                                           12, 2, values),
	                 0);
	assert_int_equal(values[0], 0xFFFE);
	assert_int_equal(values[1], 0x7960);
	/* The result registers tell of commands of both. */
	assert_int_equal(put(&fake, 0, 1, 0x0101), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(db_registers_backend.read(fake.registers, &client, NEUTRAL,
	                                           DB_TABLE_HOLDING, 23, 1, values),
	                 0);
	assert_int_equal(values[0], DB_RESULT_REFUSED);
	drop(&fake);
}

static void layout_of_the_only_unit(void **state)
{
	uint16_t values[2];

	FAKE();
	db_registers_free(fake.registers);
	fake.drive.vendor_unit = 0;
	fake.drive.vendor_layout = true;
	make_registers(&fake);
	assert_int_equal(db_registers_backend.unit(fake.registers, VENDOR), 0x0A);
	assert_int_equal(db_registers_backend.read(fake.registers, &client, NEUTRAL, DB_TABLE_INPUT,
	                                           2, 2, values),
	                 0);
	assert_int_equal(values[0], 0x7960);
	drop(&fake);
}

static void the_watchdog_stops_and_latches(void **state)
{
	FAKE();
	assert_int_equal(put(&fake, 0, 1, 0x0300), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += 501 * MS;
	publish(&fake, ONLINE);
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, 3, 0x0301, 5, 0), FAILURE);
	assert_int_equal(get1(&fake, 0), 0x0300);
	assert_int_equal(put(&fake, 0, 1, 0x1000), 0);
	assert_int_equal(put(&fake, 0, 3, 0x0301, 5, 0), DB_WRITE_LATER);
	drop(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_map),
		cmocka_unit_test(families),
		cmocka_unit_test(input_registers),
		cmocka_unit_test(what_does_not_exist),
		cmocka_unit_test(parameters_are_read),
		cmocka_unit_test(a_drive_that_does_not_answer),
		cmocka_unit_test(parameters_a_model_does_not_have),
		cmocka_unit_test(command_codes),
		cmocka_unit_test(codes_that_do_not_exist),
		cmocka_unit_test(writing_pos_starts_a_move),
		cmocka_unit_test(no_command_ends_position_mode),
		cmocka_unit_test(each_write_executes),
		cmocka_unit_test(word_order_of_writes),
		cmocka_unit_test(first_word_order),
		cmocka_unit_test(parameter_writes),
		cmocka_unit_test(parameters_out_of_range),
		cmocka_unit_test(the_command_follows_its_parameters),
		cmocka_unit_test(refused_parameters_hold_the_command_back),
		cmocka_unit_test(a_stop_in_between_ends_the_chain),
		cmocka_unit_test(a_stop_goes_first),
		cmocka_unit_test(a_slow_chain_goes_on_unattended),
		cmocka_unit_test(a_failed_writers_command_is_dropped),
		cmocka_unit_test(accepted_writes_are_chained_too),
		cmocka_unit_test(units),
		cmocka_unit_test(layout_of_the_only_unit),
		cmocka_unit_test(the_watchdog_stops_and_latches),
	};

	return cmocka_run_group_tests_name("vsmd_layout", tests, NULL, NULL);
}
