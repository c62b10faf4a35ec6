/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/vsmd_layout.h"

#include "fakes/nameplate.h"
#include "fakes/registers.h"

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

/* Addresses and codes are literals here: they are the vendor's map. */

static void publish(struct fake_registers *fake, uint32_t status)
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

	db_axis_publish(fake->axes[0], &snapshot);
}

static struct db_nameplate usual_plate(struct db_nameplate_copy *room)
{
	struct db_nameplate plate = fake_nameplate(room, UINT64_MAX);

	strcpy(plate.identity, "VSMD113_025T-1.0.008.170428");
	plate.values[VSMD_SPD].f = 6400.0f;
	plate.values[VSMD_BDR].u = 115200;
	plate.values[VSMD_CID].u = 5;
	plate.values[VSMD_ZSP].i = -2;
	return plate;
}

static void make(struct fake_registers *fake)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = usual_plate(&room);

	fake_registers_init(fake, 1, 1);
	fake->drives[0].vendor_unit = VENDOR;
	fake->drives[0].watchdog_ms = 500;
	publish(fake, ONLINE);
	db_axis_publish_nameplate(fake->axes[0], &plate);
	fake_registers_open(fake);
}

#define FAKE()                      \
	struct fake_registers fake; \
	(void)state;                \
	make(&fake)

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
	db_vsmd_layout_visit(db_driver_find("vsmd-serial"), expect_row, &seen);
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
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 0, 20, values), 0);
	assert_int_equal(values[0], 0x0000);
	assert_int_equal(values[1], 0x3FC0); /* 1.5 */
	assert_int_equal(values[2], 0x7960); /* -100000 = FFFE7960 */
	assert_int_equal(values[3], 0xFFFE);
	assert_int_equal(values[4], 0xC3D4);
	assert_int_equal(values[5], 0xA1B2);
	for (unsigned i = 0; i < sizeof text; i++)
		assert_int_equal(values[6 + i / 2] >> 8 * (i % 2) & 0xFF, text[i]);
	/* The other word order; text is not a number. */
	assert_int_equal(fake_put(&fake, VENDOR, 0x29, 1, 1), 0);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 0, 20, values), 0);
	assert_int_equal(values[0], 0x3FC0);
	assert_int_equal(values[3], 0x7960);
	assert_int_equal(values[5], 0xC3D4);
	assert_int_equal(values[6], 'S' << 8 | 'V');
	/* From the middle of a value. */
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 3, 2, values), 0);
	assert_int_equal(values[0], 0x7960);
	assert_int_equal(values[1], 0xA1B2);
	fake_registers_close(&fake);
}

static void what_does_not_exist(void **state)
{
	uint16_t values[80];

	FAKE();
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 20, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 0, 21, values), ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0, 0x47, values), 0);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0, 0x48, values),
	                 ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0x47, 1, values),
	                 ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 65535, 2, values),
	                 ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_COILS, 0, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_DISCRETE, 0, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(fake_put(&fake, VENDOR, 0x47, 1, 0), ILLEGAL_ADDRESS);
	assert_int_equal(fake_put(&fake, VENDOR, 0x46, 2, 0, 0), ILLEGAL_ADDRESS);
	assert_int_equal(fake_put(&fake, VENDOR, 101, 1, DB_CMD_ENABLE), ILLEGAL_ADDRESS);
	/* The places between the registers. */
	for (unsigned i = 0; i < 4; i++) {
		static const uint16_t between[] = { 0x16, 0x17, 0x32, 0x3B };

		assert_int_equal(fake_get1(&fake, VENDOR, between[i]), 0);
		assert_int_equal(fake_put(&fake, VENDOR, between[i], 1, 0), 0);
		assert_int_equal(fake_put(&fake, VENDOR, between[i], 1, 1), ILLEGAL_VALUE);
	}
	assert_int_equal(fake.submitted, 0);
	fake_registers_close(&fake);
}

static void parameters_are_read(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = usual_plate(&room);
	uint16_t values[2];

	FAKE();
	plate.values[VSMD_S1].u = 1;
	plate.values[VSMD_S6].u = 1;
	plate.values[VSMD_S3F].u = 6;
	plate.values[VSMD_S3R].u = 9;
	db_axis_publish_nameplate(fake.axes[0], &plate);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x0F), 0x21);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x12), 0x0609);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x1F), 5);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0x20, 2, values), 0);
	assert_int_equal(values[0], 115200 & 0xFFFF);
	assert_int_equal(values[1], 115200 >> 16);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0x03, 2, values), 0);
	assert_int_equal(values[1], 0x45C8); /* 6400 = 45C80000 */
	assert_int_equal(fake_put(&fake, VENDOR, 0x29, 1, 1), 0);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0x1D, 2, values), 0);
	assert_int_equal(values[0], 0xFFFF);
	assert_int_equal(values[1], 0xFFFE);
	/* Each port has a bit of its own, the first one, too. */
	for (unsigned port = 0; port < 6; port++) {
		for (unsigned i = 0; i < 6; i++)
			plate.values[VSMD_S1 + i].u = i == port;
		db_axis_publish_nameplate(fake.axes[0], &plate);
		assert_int_equal(fake_get1(&fake, VENDOR, 0x0F), 1 << port);
	}
	fake_registers_close(&fake);
}

static void a_drive_that_does_not_answer(void **state)
{
	uint16_t values[80];

	FAKE();
	/* Online, but nothing is known of its parameters yet. */
	publish(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 0, 6, values), 0);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 3, 2, values), NO_ANSWER);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0, 0x47, values), NO_ANSWER);
	publish(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 0, 2, values), NO_ANSWER);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0x0F, 1, values), NO_ANSWER);
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_HOLDING, 0, 3, values), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0101), NO_ANSWER);
	assert_int_equal(fake_get1(&fake, VENDOR, 0), 0);
	fake.config.modbus.stale_values = true;
	assert_int_equal(fake_get(&fake, VENDOR, DB_TABLE_INPUT, 0, 6, values), 0);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x1F), 5);
	fake_registers_close(&fake);
}

static void parameters_a_model_does_not_have(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = usual_plate(&room);
	FAKE();
	plate.valid[0] &= ~(UINT64_C(1) << VSMD_ELNS);
	plate.values[VSMD_ELNS].u = 77;
	db_axis_publish_nameplate(fake.axes[0], &plate);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x2C), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0x2C, 1, 0), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0x2C, 1, 1000), ILLEGAL_ADDRESS);
	assert_int_equal(fake.submitted, 0);
	fake_registers_close(&fake);
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
	assert_int_equal(fake_put(&fake, VENDOR, 0x3C, 7, 100, 0, 0xFFFF, 0xFFFF, 0, 0x3F80, 7), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0x01, 2, 0x7960, 0xFFFE), 0);
	for (size_t i = 0; i < sizeof(CODES) / sizeof(CODES[0]); i++) {
		const struct db_request *request = &fake.requests[0];

		fake.submitted = 0;
		assert_int_equal(fake_put(&fake, VENDOR, 0, 1, CODES[i].code), DB_WRITE_LATER);
		assert_int_equal(fake.submitted, 1);
		assert_int_equal(request->command, CODES[i].command);
		assert_int_equal(request->args->output_number, CODES[i].port);
		if (CODES[i].port)
			assert_int_equal(request->args->output_value, CODES[i].value);
		if (CODES[i].command == DB_CMD_SET_POSITION)
			assert_int_equal(request->args->target_position, 0);
		else
			assert_int_equal(request->args->target_position, -100000);
		assert_true(request->args->target_velocity == 0.0f);
		assert_int_equal(request->args->shake_start_position, 100);
		assert_int_equal(request->args->shake_end_position, -1);
		assert_true(request->args->shake_frequency == 1.0f);
		assert_int_equal(request->args->shake_cycles, 7);
		assert_int_equal(request->args->shake_time, 7);
		fake_complete(&fake, 0, DB_RESULT_OK);
		assert_int_equal(fake.answered, i + 1);
		assert_int_equal(fake.answered_with, 0);
		assert_int_equal(fake_get1(&fake, VENDOR, 0), CODES[i].code);
	}
	fake_registers_close(&fake);
}

static void codes_that_do_not_exist(void **state)
{
	static const uint16_t wrong[] = { 0x0001, 0x0102, 0x0201, 0x0303, 0x0402,
		                          0x0501, 0x0602, 0x0702, 0x0C02, 0x0D00,
		                          0x1001, 0x1303, 0x13FF, 0x1A00, 0xFFFF };

	FAKE();
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0101), DB_WRITE_LATER);
	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		assert_int_equal(fake_put(&fake, VENDOR, 0, 3, wrong[i], 5, 0), ILLEGAL_VALUE);
		assert_int_equal(fake_get1(&fake, VENDOR, 0), 0x0101);
		assert_int_equal(fake_get1(&fake, VENDOR, 1), 0);
	}
	/* Shaking without a frequency. */
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x1301), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 1);
	fake_registers_close(&fake);
}

static void writing_pos_starts_a_move(void **state)
{
	FAKE();
	/* Not before position mode. */
	assert_int_equal(fake_put(&fake, VENDOR, 1, 2, 11, 0), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0301), DB_WRITE_LATER);
	assert_int_equal(fake.requests[0].args->target_position, 11);
	assert_int_equal(fake_put(&fake, VENDOR, 1, 2, 12, 0), DB_WRITE_LATER);
	assert_int_equal(fake.requests[1].command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake.requests[1].args->target_position, 12);
	/* Both at once are one move. */
	assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0x0302, 13, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(fake.requests[2].command, DB_CMD_MOVE_RELATIVE);
	assert_int_equal(fake.requests[2].args->target_position, 13);
	assert_int_equal(fake_put(&fake, VENDOR, 1, 2, 14, 0), DB_WRITE_LATER);
	assert_int_equal(fake.requests[3].command, DB_CMD_MOVE_RELATIVE);
	/* Half a position is none. */
	assert_int_equal(fake_put(&fake, VENDOR, 1, 1, 15), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 2, 1, 15), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 2, 0x0301, 15), ILLEGAL_VALUE);
	assert_int_equal(fake_get1(&fake, VENDOR, 1), 14);
	/* Other commands end the mode. */
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0400), DB_WRITE_LATER);
	assert_int_equal(fake_put(&fake, VENDOR, 1, 2, 16, 0), 0);
	assert_int_equal(fake.submitted, 5);
	assert_int_equal(fake_get1(&fake, VENDOR, 1), 16);
	fake_registers_close(&fake);
}

static void no_command_ends_position_mode(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0301), DB_WRITE_LATER);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0, 5, 0), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 1, 2, 6, 0), 0);
	assert_int_equal(fake_get1(&fake, VENDOR, 1), 6);
	assert_int_equal(fake.submitted, 1);
	fake_registers_close(&fake);
}

static void each_write_executes(void **state)
{
	FAKE();
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0x0302, 5, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	fake_registers_close(&fake);
}

static void word_order_of_writes(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0x0301, 2, 1), DB_WRITE_LATER);
	assert_int_equal(fake.requests[0].args->target_position, 0x10002);
	assert_int_equal(fake_put(&fake, VENDOR, 0x29, 1, 2), ILLEGAL_VALUE);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x29), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0x29, 1, 1), 0);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x29), 1);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0x0301, 2, 1), DB_WRITE_LATER);
	assert_int_equal(fake.requests[1].args->target_position, 0x20001);
	assert_int_equal(fake_get1(&fake, VENDOR, 1), 2);
	fake_registers_close(&fake);
}

static void first_word_order(void **state)
{
	FAKE();
	fake.drives[0].vendor_high_first = true;
	fake_registers_open(&fake);
	assert_int_equal(fake_get1(&fake, VENDOR, 0x29), 1);
	fake_registers_close(&fake);
}

/* --- parameters -------------------------------------------------------------------------------------- */

static void parameter_writes(void **state)
{
	const struct db_request *request;

	FAKE();
	request = &fake.requests[0];
	/* spd 1000, acc 2000, dec 3000 */
	assert_int_equal(fake_put(&fake, VENDOR, 3, 6, 0, 0x447A, 0, 0x44FA, 0x8000, 0x453B),
	                 DB_WRITE_LATER);
	assert_int_equal(request->command, DB_CMD_NONE);
	assert_int_equal(request->setting_count, 3);
	assert_int_equal(request->settings[0].param, VSMD_SPD);
	assert_true(request->settings[0].value.f == 1000.0f);
	assert_int_equal(request->settings[2].param, VSMD_DEC);
	assert_true(request->settings[2].value.f == 3000.0f);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);

	fake.submitted = 0;
	assert_int_equal(fake_put(&fake, VENDOR, 0x0F, 2, 0x21, 0x0903), DB_WRITE_LATER);
	assert_int_equal(request->setting_count, 8);
	for (unsigned i = 0; i < 6; i++) {
		assert_int_equal(request->settings[i].param, VSMD_S1 + i);
		assert_int_equal(request->settings[i].value.u, i == 0 || i == 5);
	}
	assert_int_equal(request->settings[6].param, VSMD_S1F);
	assert_int_equal(request->settings[6].value.u, 9);
	assert_int_equal(request->settings[7].param, VSMD_S1R);
	assert_int_equal(request->settings[7].value.u, 3);
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered_with, FAILURE);
	fake_registers_close(&fake);
}

/* The last one of the map has nothing behind it. */
static void the_last_parameter_is_written_alone(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, VENDOR, 69, 2, 0xFFFB, 0xFFFF), DB_WRITE_LATER);
	assert_int_equal(fake.requests[0].setting_count, 1);
	assert_int_equal(fake.requests[0].settings[0].param, VSMD_SPL);
	assert_int_equal(fake.requests[0].settings[0].value.i, -5);
	/* Half of it, or more than there is. */
	assert_int_equal(fake_put(&fake, VENDOR, 70, 1, 0xFFFF), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 69, 3, 0xFFFB, 0xFFFF, 0), ILLEGAL_ADDRESS);
	assert_int_equal(fake.submitted, 1);
	fake_registers_close(&fake);
}

static void parameters_out_of_range(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, VENDOR, 0x0F, 1, 0x40), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 0x10, 1, 0x0A00), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 0x10, 1, 0x000A), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 0x22, 1, 9), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 0x2A, 1, 64), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 0x05, 2, 0, 0xBF80), ILLEGAL_VALUE); /* -1 */
	assert_int_equal(fake_put(&fake, VENDOR, 0x05, 2, 0, 0x7FC0),
	                 ILLEGAL_VALUE);                                      /* not a number */
	assert_int_equal(fake_put(&fake, VENDOR, 0x05, 1, 0), ILLEGAL_VALUE); /* half */
	assert_int_equal(fake_put(&fake, VENDOR, 0x39, 2, 999, 0), ILLEGAL_VALUE);    /* res */
	assert_int_equal(fake_put(&fake, VENDOR, 0x40, 2, 0, 0x7F80), ILLEGAL_VALUE); /* infinite */
	assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0x0301, 0, 0x7F80), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	fake_registers_close(&fake);
}

/* --- parameters and a command in one write --------------------------------------------------------------- */

/* Command, pos 5, spd 1000. */
static int put_both(struct fake_registers *fake, uint16_t code)
{
	return fake_put(fake, VENDOR, 0, 5, code, 5, 0, 0, 0x447A);
}

static void the_command_follows_its_parameters(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.requests[0].setting_count, 1);
	/* Nothing may get in between. */
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0300), BUSY);
	assert_int_equal(fake_put(&fake, VENDOR, 1, 2, 6, 0), BUSY);
	assert_int_equal(fake_put(&fake, VENDOR, 0x28, 1, 1), BUSY);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake.requests[1].args->target_position, 5);
	fake_complete(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_to.client, fake_client.id);
	assert_int_equal(fake.answered_with, FAILURE);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0300), DB_WRITE_LATER);
	fake_registers_close(&fake);
}

/* Other requests of the drive end meanwhile; only its own parameters let the command go. */
static void the_command_waits_for_its_own_parameters(void **state)
{
	const struct db_write_token other = { 2, FAKE_TOKEN.sequence };
	const uint16_t one = 1;

	FAKE();
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, NEUTRAL,
	                                            DB_TABLE_HOLDING, 202, 1, &one, other),
	                 DB_WRITE_LATER);
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.answered, 1);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_MOVE_ABSOLUTE);
	fake_complete(&fake, 2, DB_RESULT_OK);
	assert_int_equal(fake.answered, 2);
	/* It goes once. */
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, NEUTRAL,
	                                            DB_TABLE_HOLDING, 202, 1, &one, other),
	                 DB_WRITE_LATER);
	fake_complete(&fake, 3, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 4);
	fake_registers_close(&fake);
}

/* The stop of a write that ends in the middle of a value is carried out, and nothing else. */
static void half_a_value_is_refused_and_a_stop_is_not(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, VENDOR, 0, 2, 0x0301, 5), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 2, 0x0401, 5), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_QUICK_STOP);
	assert_int_equal(fake_get1(&fake, VENDOR, 0), 0);
	assert_int_equal(fake_get1(&fake, VENDOR, 1), 0);
	/* So is one beside a value that is wrong. */
	assert_int_equal(fake_put(&fake, VENDOR, 0, 5, 0x0400, 5, 0, 0, 0x7FC0), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(fake.submitted, 2);
	fake_registers_close(&fake);
}

static void refused_parameters_hold_the_command_back(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, FAILURE);
	assert_int_equal(fake.submitted, 1);
	/* Wrong ones, and those of a wrong command, are not even asked for. */
	assert_int_equal(put_both(&fake, 0x0303), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 5, 0x0301, 5, 0, 0, 0x7FC0), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 1);
	fake_registers_close(&fake);
}

static void a_stop_in_between_ends_the_chain(void **state)
{
	const uint16_t stop[] = { 0, DB_CMD_STOP };

	FAKE();
	assert_int_equal(put_both(&fake, 0x0301), DB_WRITE_LATER);
	/* From the neutral unit, for instance. */
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, NEUTRAL,
	                                            DB_TABLE_HOLDING, 100, 2, stop, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, FAILURE);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);
	assert_int_equal(fake.submitted, 2);
	fake_registers_close(&fake);
}

static void a_stop_goes_first(void **state)
{
	FAKE();
	assert_int_equal(put_both(&fake, 0x0400), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[0].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[1].setting_count, 1);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, 0);
	fake_registers_close(&fake);
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
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_MOVE_ABSOLUTE);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	fake_registers_close(&fake);
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
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0300), DB_WRITE_LATER);
	fake_registers_close(&fake);
}

static void accepted_writes_are_chained_too(void **state)
{
	FAKE();
	fake.config.modbus.accept_writes = true;
	fake_registers_open(&fake);
	assert_int_equal(put_both(&fake, 0x0301), 0);
	assert_int_equal(fake.submitted, 1);
	fake_complete(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	fake_registers_close(&fake);
}

/* --- one drive, two units ------------------------------------------------------------------------------------ */

/* FC 22 with a mask that changes nothing, and the like: only a stop has an effect. */
static void a_register_that_stays_as_it_is(void **state)
{
	FAKE();
	assert_int_equal(db_registers_backend.write_same(fake.registers, &fake_client, VENDOR, 0x47,
	                                                 0, FAKE_TOKEN),
	                 ILLEGAL_ADDRESS);
	assert_int_equal(db_registers_backend.write_same(fake.registers, &fake_client, VENDOR, 0x01,
	                                                 0, FAKE_TOKEN),
	                 ILLEGAL_VALUE);
	assert_int_equal(db_registers_backend.write_same(fake.registers, &fake_client, VENDOR, 0x1F,
	                                                 5, FAKE_TOKEN),
	                 0);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(db_registers_backend.write_same(fake.registers, &fake_client, VENDOR, 0,
	                                                 0x0400, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	fake_registers_close(&fake);
}

/* As of the neutral layout: a role without parameters may stop all the same. */
static void a_role_without_parameters_writes_none(void **state)
{
	const struct db_role_config role = { .write.all = true };
	const struct db_client operates = { .id = 2, .port = 1, .may_write = true, .role = &role };
	const uint16_t five = 5;
	const uint16_t both[] = { 0x0400, 0, 0, 0, 0x45C8 }; /* stop, pos, spd */

	FAKE();
	assert_int_equal(db_registers_backend.write(fake.registers, &operates, VENDOR,
	                                            DB_TABLE_HOLDING, 0x1F, 1, &five, FAKE_TOKEN),
	                 0x01);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake.refused_by_role, 1);
	assert_int_equal(db_registers_backend.write(fake.registers, &operates, VENDOR,
	                                            DB_TABLE_HOLDING, 0, 5, both, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(fake_get1(&fake, VENDOR, 0), 0);
	fake_registers_close(&fake);
}

static void units(void **state)
{
	uint16_t values[2];

	FAKE();
	assert_int_equal(db_registers_backend.unit(fake.registers, &fake_client, VENDOR), 0);
	assert_int_equal(db_registers_backend.unit(fake.registers, &fake_client, VENDOR + 1), 0x0A);
	assert_int_equal(db_registers_backend.read(fake.registers, &fake_client, NEUTRAL,
	                                           DB_TABLE_INPUT, 12, 2, values),
	                 0);
	assert_int_equal(values[0], 0xFFFE);
	assert_int_equal(values[1], 0x7960);
	/* The result registers tell of commands of both. */
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0101), DB_WRITE_LATER);
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(db_registers_backend.read(fake.registers, &fake_client, NEUTRAL,
	                                           DB_TABLE_HOLDING, 23, 1, values),
	                 0);
	assert_int_equal(values[0], DB_RESULT_REFUSED);
	fake_registers_close(&fake);
}

static void layout_of_the_only_unit(void **state)
{
	uint16_t values[2];

	FAKE();
	fake.drives[0].vendor_unit = 0;
	fake.drives[0].vendor_layout = true;
	fake_registers_open(&fake);
	assert_int_equal(db_registers_backend.unit(fake.registers, &fake_client, VENDOR), 0x0A);
	assert_int_equal(db_registers_backend.read(fake.registers, &fake_client, NEUTRAL,
	                                           DB_TABLE_INPUT, 2, 2, values),
	                 0);
	assert_int_equal(values[0], 0x7960);
	fake_registers_close(&fake);
}

static void the_watchdog_stops_and_latches(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x0300), DB_WRITE_LATER);
	fake_complete(&fake, 0, DB_RESULT_OK);
	fake.now += 501 * MS;
	publish(&fake, ONLINE);
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	fake_complete(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0x0301, 5, 0), FAILURE);
	assert_int_equal(fake_get1(&fake, VENDOR, 0), 0x0300);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 1, 0x1000), 0);
	assert_int_equal(fake_put(&fake, VENDOR, 0, 3, 0x0301, 5, 0), DB_WRITE_LATER);
	fake_registers_close(&fake);
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
		cmocka_unit_test(the_last_parameter_is_written_alone),
		cmocka_unit_test(parameters_out_of_range),
		cmocka_unit_test(the_command_follows_its_parameters),
		cmocka_unit_test(the_command_waits_for_its_own_parameters),
		cmocka_unit_test(half_a_value_is_refused_and_a_stop_is_not),
		cmocka_unit_test(refused_parameters_hold_the_command_back),
		cmocka_unit_test(a_stop_in_between_ends_the_chain),
		cmocka_unit_test(a_stop_goes_first),
		cmocka_unit_test(a_slow_chain_goes_on_unattended),
		cmocka_unit_test(a_failed_writers_command_is_dropped),
		cmocka_unit_test(accepted_writes_are_chained_too),
		cmocka_unit_test(a_register_that_stays_as_it_is),
		cmocka_unit_test(a_role_without_parameters_writes_none),
		cmocka_unit_test(units),
		cmocka_unit_test(layout_of_the_only_unit),
		cmocka_unit_test(the_watchdog_stops_and_latches),
	};

	return cmocka_run_group_tests_name("vsmd_layout", tests, NULL, NULL);
}
