/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd.h"
#include "drivebridge/trouble.h"
#include "drivebridge/version.h"
#include "fakes/nameplate.h"
#include "fakes/registers.h"
#include "regmap/image.h"
#include "regmap/named.h"
#include "regmap/table.h"

#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

#define ILLEGAL_FUNCTION 0x01
#define ILLEGAL_ADDRESS 0x02
#define ILLEGAL_VALUE 0x03
#define LATER 0x05
#define BUSY 0x06
#define NO_PATH 0x0A
#define NO_ANSWER 0x0B

/* Addresses are literals here: they are the contract. */
#define ONLINE (DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID)

static const struct db_client intruder = {
	.id = 2,
	.address = { [10] = 0xFF, [11] = 0xFF, [12] = 192, [13] = 168, [14] = 10, [15] = 5 },
	.port = 50001,
	.may_write = true,
};

/* A standing drive that was polled 10 ms ago. */
static struct db_snapshot usual(const struct fake_registers *fake)
{
	return (struct db_snapshot){
		.feedback = {
			.taken = fake->now - 10 * MS,
			.taken_wall_us = 0x0001000200030004,
			.position = -100000,
			.velocity = 1.5f,
			.drive_status = 0xA1B2C3D4,
			.inputs = 0x21,
			.outputs = 0x02,
			.state = DB_AXIS_STANDSTILL,
			.status = ONLINE | DB_STATUS_ENABLED,
		},
		.stats = { .requests = 0x12345 },
	};
}

static void publish_status(struct fake_registers *fake, uint32_t status)
{
	struct db_snapshot snapshot = usual(fake);

	snapshot.feedback.status = status;
	if (!(status & DB_STATUS_ONLINE))
		snapshot.feedback.state = DB_AXIS_OFFLINE;
	db_axis_publish(fake->axes[0], &snapshot);
}

static void make_with(struct fake_registers *fake, const struct db_modbus_config *modbus)
{
	struct db_snapshot snapshot;
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX);

	fake_registers_init(fake, 2, 3);
	fake->config.modbus = *modbus;
	for (unsigned i = 0; i < 2; i++)
		fake->bus_stats[i] = (struct db_bus_stats){
			.up = true, .period_us = 20000, .cycles = i + 70000, .online = i + 1
		};
	fake->server_stats = (struct db_server_stats){ .clients = 3, .requests = 0xFFFF0007 };
	fake->clients[0] = (struct db_server_client){
		.client = intruder,
		.requests = 0x100000002,
		.idle = 3900 * MS,
		.connected = 70000 * MS,
	};
	fake->clients[1].client = fake_client;
	memset(fake->clients[1].client.address, 0xFD, sizeof fake->clients[1].client.address);
	for (unsigned i = 0; i < 3; i++) {
		fake->drives[i].counts_per_unit = 640.0;
		fake->drives[i].unit_name = (char *)"mm";
	}
	strcpy(plate.identity, "VSMD113");
	plate.generation = 4;
	plate.values[4].f = 25000.0f; /* acc */
	plate.values[1].u = 5;        /* cid */
	snapshot = usual(fake);
	db_axis_publish(fake->axes[0], &snapshot);
	db_axis_publish_nameplate(fake->axes[0], &plate);
	fake_registers_open(fake);
}

static void make(struct fake_registers *fake)
{
	make_with(fake, &(struct db_modbus_config){ .confirm_ms = 40, .gateway_unit = 200 });
}

#define FAKE()                      \
	struct fake_registers fake; \
	(void)state;                \
	make(&fake)

/* Of unit 1, the values thrown away. */
static int try_get(struct fake_registers *fake, enum db_table table, uint16_t address,
                   uint16_t count)
{
	uint16_t values[2000];

	return fake_get(fake, 1, table, address, count, values);
}

static int put_values(struct fake_registers *fake, enum db_table table, uint16_t address,
                      uint16_t count, const uint16_t *values)
{
	return fake_put_values(fake, 1, table, address, count, values);
}

/* The bus ends its latest request. */
static void complete_last(struct fake_registers *fake, enum db_result result)
{
	fake_complete(fake, fake->submitted - 1, result);
}

/* --- units ------------------------------------------------------------------------------------------ */

static void units(void **state)
{
	FAKE();
	for (unsigned unit = 0; unit < 256; unit++) {
		bool there = unit <= 3 || unit == 200 || unit == 255;

		assert_int_equal(
			db_registers_backend.unit(fake.registers, &fake_client, (uint8_t)unit),
			there ? 0 : NO_PATH);
	}
	fake_registers_close(&fake);
}

static void requests_find_their_bus(void **state)
{
	const uint16_t stop[] = { 0, DB_CMD_STOP };

	FAKE();
	publish_status(&fake, ONLINE);
	db_axis_publish(fake.axes[2], &(struct db_snapshot){ .feedback.status = ONLINE });
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, 3,
	                                            DB_TABLE_HOLDING, 100, 2, stop, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.submitted_to, 1);
	assert_int_equal(fake_last_request(&fake)->drive, 2);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	fake_registers_close(&fake);
}

/* --- reading a drive ---------------------------------------------------------------------------------- */

static void process_data(void **state)
{
	float number;
	uint32_t word;

	FAKE();
	assert_int_equal(fake_get1(&fake, 1, 0), DB_AXIS_STANDSTILL);
	assert_int_equal(fake_get1(&fake, 1, 4), 192);
	assert_int_equal(fake_get2(&fake, 1, 2), ONLINE | DB_STATUS_ENABLED);
	assert_int_equal(fake_get2(&fake, 1, 6), 10);
	assert_int_equal((int32_t)fake_get2(&fake, 1, 12), -100000);
	word = fake_get2(&fake, 1, 14);
	memcpy(&number, &word, sizeof number);
	assert_true(number == 1.5f);
	word = fake_get2(&fake, 1, 16);
	memcpy(&number, &word, sizeof number);
	assert_true(number == -156.25f);
	assert_int_equal(fake_get2(&fake, 1, 20), 0xA1B2C3D4);
	assert_int_equal(fake_get1(&fake, 1, 30), 0x21);
	assert_int_equal(fake_get2(&fake, 1, 1032), 0x12345);
	fake_registers_close(&fake);
}

static void word_order(void **state)
{
	uint16_t values[16];

	FAKE();
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 8, 4, values), 0);
	for (uint16_t i = 0; i < 4; i++)
		assert_int_equal(values[i], i + 1);
	fake.config.modbus.low_word_first = true;
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_INPUT, 8, 4, values), 0);
	for (uint16_t i = 0; i < 4; i++)
		assert_int_equal(values[i], 4 - i);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 20, 2, values), 0);
	assert_int_equal(values[0], 0xC3D4);
	assert_int_equal(values[1], 0xA1B2);
	/* Text is not a number. */
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 1000, 5, values), 0);
	assert_int_equal(values[0], 'V' << 8 | 'S');
	assert_int_equal(values[3], '3' << 8);
	assert_int_equal(values[4], 0);
	assert_int_equal(fake_put(&fake, 1, 102, 2, 2, 1), 0);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 102, 2, values), 0);
	assert_int_equal(values[0], 2);
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_MOVE_ABSOLUTE), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->args->target_position, 0x10002);
	fake_registers_close(&fake);
}

static void parts_of_wide_registers(void **state)
{
	uint16_t whole[40];
	uint16_t part[40];

	FAKE();
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 0, 36, whole), 0);
	for (uint16_t from = 0; from < 36; from++) {
		for (uint16_t count = 1; count <= 36 - from; count++) {
			memset(part, 0xEE, sizeof part);
			assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, from, count, part),
			                 0);
			assert_memory_equal(part, &whole[from], count * sizeof part[0]);
			assert_int_equal(part[count], 0xEEEE);
		}
	}
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 1001, 2, part), 0);
	assert_int_equal(part[0], 'M' << 8 | 'D');
	fake_registers_close(&fake);
}

static void registers_that_do_not_exist(void **state)
{
	FAKE();
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 36, 1), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 98, 2), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 65535, 125), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_DISCRETE, 19, 2), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_COILS, 0, 7), ILLEGAL_ADDRESS);
	/* Input registers: what can be written is none. */
	assert_int_equal(try_get(&fake, DB_TABLE_INPUT, 0, 32), 0);
	assert_int_equal(try_get(&fake, DB_TABLE_INPUT, 32, 2), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_INPUT, 100, 1), ILLEGAL_ADDRESS);
	fake_registers_close(&fake);
}

/* A PLC reads one block per drive, whatever the family lacks in between. */
static void blocks_cross_what_the_drive_lacks(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX & ~(UINT64_C(1) << 2));
	uint16_t values[125];

	FAKE();
	memset(values, 0xFF, sizeof values);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 0, 100, values), 0);
	assert_int_equal(values[0], fake_get1(&fake, 1, 0));
	assert_int_equal(values[66], 0);
	for (uint16_t address = 36; address < 46; address++)
		assert_int_equal(values[address], 0);
	for (uint16_t address = 67; address < 100; address++)
		assert_int_equal(values[address], 0);
	assert_int_equal(values[47], fake_get1(&fake, 1, 47));
	/* Half of a value at either end. */
	memset(values, 0xFF, sizeof values);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 33, 14, values), 0);
	assert_int_equal(values[0], fake_get1(&fake, 1, 33));
	assert_int_equal(values[3], 0);
	assert_int_equal(values[13], fake_get1(&fake, 1, 46));
	/* Input registers lack what can be written. */
	memset(values, 0xFF, sizeof values);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_INPUT, 30, 8, values), 0);
	assert_int_equal(values[0], fake_get1(&fake, 1, 30));
	assert_int_equal(values[2], 0);
	/* Bits. */
	memset(values, 0xFF, sizeof values);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_DISCRETE, 0, 48, values), 0);
	assert_int_equal(values[0], 1);
	assert_int_equal(values[20], 0);
	assert_int_equal(values[32], 1);
	/* Writing does not. */
	assert_int_equal(fake_put(&fake, 1, 135, 2, 0, 0), ILLEGAL_ADDRESS);
	assert_int_equal(fake_put(&fake, 1, 36, 1, 0), ILLEGAL_ADDRESS);
	/* A parameter that this model lacks, too, unless it is all there is. */
	db_axis_publish_nameplate(fake.axes[0], &plate);
	memset(values, 0xFF, sizeof values);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 202, 2, values), 0);
	assert_int_equal(values[1], 0);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 203, 1), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 203, 1), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 600, 10), ILLEGAL_ADDRESS);
	/* What is old is not shown in a block either. */
	publish_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 0, 100, values), NO_ANSWER);
	fake_registers_close(&fake);
}

/* Process data do not wait for parameters. */
static void blocks_with_unknown_parameters(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_C(1) << 4);
	uint16_t values[125];
	float read;

	FAKE();
	plate.values[4].f = 25000.0f; /* of before */
	plate.values[5].f = 25000.0f;
	db_axis_publish_nameplate(fake.axes[0], &plate);
	publish_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	memset(values, 0, sizeof values);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 0, 67, values), 0);
	assert_int_equal((int32_t)((uint32_t)values[12] << 16 | values[13]), -100000);
	for (unsigned at = 32; at < 36; at += 2) {
		uint32_t word = (uint32_t)values[at] << 16 | values[at + 1];

		memcpy(&read, &word, sizeof read);
		assert_true(isnan(read));
	}
	assert_false(fake_get2(&fake, 1, 2) & DB_STATUS_PARAMS_VALID);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 47, 1, values), 0);
	/* Nothing but parameters. */
	for (uint16_t address = 32; address < 36; address++)
		assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, address, 1), NO_ANSWER);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 32, 4), NO_ANSWER);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 200, 60), NO_ANSWER);
	/* What is not known is not written from such a block. */
	assert_int_equal(fake_put(&fake, 1, 32, 2, 0x7FC0, 0), ILLEGAL_VALUE);
	/* The last value is shown where that was asked for. */
	fake.config.modbus.stale_values = true;
	assert_int_equal(fake_get2(&fake, 1, 32), 0x46C35000);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 30, 6, values), 0);
	assert_int_equal(values[2], 0x46C3);
	assert_int_equal(values[4], 0x7FC0);
	fake_registers_close(&fake);
}

static void offline_drive(void **state)
{
	FAKE();
	publish_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 0, 8), 0);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 22, 8), 0);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 100, 20), 0);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 1000, 56), 0);
	assert_int_equal(try_get(&fake, DB_TABLE_DISCRETE, 0, 15), 0);
	assert_int_equal(fake_get1(&fake, 1, 4), 0);
	for (uint16_t address = 8; address < 22; address++)
		assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, address, 1), NO_ANSWER);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 0, 36), NO_ANSWER);
	for (uint16_t address = 30; address < 36; address++)
		assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, address, 1), NO_ANSWER);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 200, 1), NO_ANSWER);
	assert_int_equal(try_get(&fake, DB_TABLE_DISCRETE, 32, 1), NO_ANSWER);
	assert_int_equal(try_get(&fake, DB_TABLE_COILS, 0, 1), NO_ANSWER);
	publish_status(&fake, 0);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 12, 2), NO_PATH);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 200, 1), NO_PATH);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 0, 2), 0);
	fake_registers_close(&fake);
}

static void stale_values(void **state)
{
	FAKE();
	fake.config.modbus.stale_values = true;
	publish_status(&fake, DB_STATUS_BUS_UP);
	fake.now += 990 * MS;
	assert_int_equal((int32_t)fake_get2(&fake, 1, 12), -100000);
	assert_int_equal(fake_get2(&fake, 1, 6), 1000);
	assert_int_equal(fake_get1(&fake, 1, 4), 64);
	assert_int_equal(fake_get2(&fake, 1, 2) & DB_STATUS_ONLINE, 0);
	assert_int_equal(fake_get1(&fake, 1, 202), 5);
	/* Its second drive was never heard: nothing to tell about parameters. */
	assert_int_equal(fake_get1(&fake, 2, 4), 0);
	assert_int_equal(fake_get2(&fake, 2, 6), UINT32_MAX);
	assert_int_equal(fake_get2(&fake, 2, 12), 0);
	{
		uint16_t value;

		assert_int_equal(fake_get(&fake, 2, DB_TABLE_HOLDING, 202, 1, &value), NO_PATH);
	}
	fake_registers_close(&fake);
}

static void quality_and_age(void **state)
{
	struct db_snapshot snapshot;

	FAKE();
	fake.now += 90 * MS;
	assert_int_equal(fake_get1(&fake, 1, 4), 192);
	fake.now += 1 * MS;
	assert_int_equal(fake_get1(&fake, 1, 4), 64);
	assert_int_equal(fake_get2(&fake, 1, 6), 101);
	/* Up to a second old it is shown with its age, then the drive counts as silent. */
	fake.now += 899 * MS;
	assert_int_equal((int32_t)fake_get2(&fake, 1, 12), -100000);
	fake.now += 1 * MS;
	{
		uint16_t value[2];

		assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 12, 2, value), NO_ANSWER);
	}
	assert_int_equal(fake_get1(&fake, 1, 0), DB_AXIS_OFFLINE);
	assert_int_equal(fake_get2(&fake, 1, 2) & DB_STATUS_ONLINE, 0);
	fake.now += UINT32_MAX * MS;
	assert_int_equal(fake_get2(&fake, 1, 6), UINT32_MAX);
	/* Published between the clock and the look. */
	snapshot = usual(&fake);
	snapshot.feedback.taken = fake.now + 1;
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(fake_get2(&fake, 1, 6), 0);
	assert_int_equal(fake_get1(&fake, 1, 4), 192);
	/* Online, but no status came yet. */
	snapshot.feedback.taken = 0;
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(fake_get1(&fake, 1, 4), 0);
	assert_int_equal(fake_get2(&fake, 1, 6), UINT32_MAX);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 12, 2), NO_ANSWER);
	fake_registers_close(&fake);
}

static void parameters(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX & ~(UINT64_C(1) << 2));
	float number;
	uint32_t word;

	FAKE();
	assert_int_equal(fake_get1(&fake, 1, 202), 5);
	word = fake_get2(&fake, 1, 206);
	memcpy(&number, &word, sizeof number);
	assert_true(number == 25000.0f);
	assert_int_equal(fake_get2(&fake, 1, 32), word);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 200, 76), 0);
	assert_int_equal(fake_get1(&fake, 1, 241), 0);
	/* Known from before, not read again yet. */
	publish_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 202, 1), NO_ANSWER);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 32, 2), NO_ANSWER);
	/* A model without mcs. */
	publish_status(&fake, ONLINE);
	db_axis_publish_nameplate(fake.axes[0], &plate);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 203, 1), ILLEGAL_ADDRESS);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 202, 1), 0);
	fake_registers_close(&fake);
}

static void bits(void **state)
{
	uint16_t values[16];

	FAKE();
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_DISCRETE, 0, 15, values), 0);
	for (unsigned i = 0; i < 15; i++)
		assert_int_equal(values[i], (ONLINE | DB_STATUS_ENABLED) >> i & 1);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_DISCRETE, 32, 16, values), 0);
	for (unsigned i = 0; i < 16; i++)
		assert_int_equal(values[i], i == 0 || i == 5);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_COILS, 1, 2, values), 0);
	assert_int_equal(values[0], 1);
	assert_int_equal(values[1], 0);
	fake_registers_close(&fake);
}

/* --- writing a drive ------------------------------------------------------------------------------------- */

/* The drive's own status word, bit by bit under the vendor's names. */
static void bits_of_the_drives_own_status(void **state)
{
	struct db_snapshot snapshot;
	uint16_t value = 9;

	FAKE();
	snapshot = usual(&fake);
	snapshot.feedback.drive_status = 1u << 13 | 1u << 24;
	db_axis_publish(fake.axes[0], &snapshot);
	for (uint16_t bit = 0; bit < 32; bit++) {
		bool named = bit != 15 && bit != 18 && bit != 19 && bit != 23 && bit != 25 &&
		             bit != 26 && bit < 28;

		assert_int_equal(
			fake_get(&fake, 1, DB_TABLE_DISCRETE, (uint16_t)(64 + bit), 1, &value),
			named ? 0 : ILLEGAL_ADDRESS);
		if (named)
			assert_int_equal(value, bit == 13 || bit == 24);
	}
	publish_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_DISCRETE, 77, 1, &value), NO_ANSWER);
	fake_registers_close(&fake);
}

static void a_block_is_one_command(void **state)
{
	struct db_snapshot snapshot;

	FAKE();
	assert_int_equal(
		fake_put(&fake, 1, 100, 6, 0, DB_CMD_MOVE_ABSOLUTE, 0xFFFF, 0xFFFE, 0x42C8, 0),
		DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake_last_request(&fake)->args->target_position, -2);
	assert_true(fake_last_request(&fake)->args->target_velocity == 100.0f);
	assert_int_equal(fake_get1(&fake, 1, 23), DB_RESULT_PENDING);
	assert_int_equal(fake_get1(&fake, 1, 5), DB_CMD_MOVE_ABSOLUTE);
	assert_true(fake_get2(&fake, 1, 2) & DB_STATUS_BUSY);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, 0);
	/* It has begun; now it goes on to its end. */
	assert_int_equal(fake_get1(&fake, 1, 23), DB_RESULT_OK);
	assert_false(fake_get2(&fake, 1, 2) & DB_STATUS_DONE);
	fake.now += 20 * MS;
	snapshot = usual(&fake);
	snapshot.feedback.status |= DB_STATUS_AT_TARGET;
	db_axis_publish(fake.axes[0], &snapshot);
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake_get1(&fake, 1, 23), DB_RESULT_OK);
	assert_int_equal(fake_get1(&fake, 1, 25), DB_CMD_MOVE_ABSOLUTE);
	assert_false(fake_get2(&fake, 1, 2) & DB_STATUS_BUSY);
	assert_true(fake_get2(&fake, 1, 2) & DB_STATUS_DONE);
	assert_int_equal((int32_t)fake_get2(&fake, 1, 102), -2);
	fake_registers_close(&fake);
}

static void arguments_are_kept_for_a_single_register(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 7), 0);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_SET_POSITION), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->args->target_position, 7);
	fake_registers_close(&fake);
}

/* The id that is kept was another command's: this one has none. */
static void a_command_alone_has_no_used_id(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, 1, 100, 2, 7, DB_CMD_HOME), 0x04);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 8, DB_CMD_HOME), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_get1(&fake, 1, 22), 8);
	/* The same block again is not executed again, the command alone is. */
	assert_int_equal(fake_put(&fake, 1, 100, 2, 8, DB_CMD_HOME), 0);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_ENABLE), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_ENABLE);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_get1(&fake, 1, 22), 0);
	assert_int_equal(fake.submitted, 2);
	fake_registers_close(&fake);
}

static void writes_that_are_refused(void **state)
{
	FAKE();
	/* Halves */
	assert_int_equal(fake_put(&fake, 1, 102, 1, 1), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 103, 1, 1), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 100, 3, 0, DB_CMD_HOME, 0), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 207, 1, 0), ILLEGAL_VALUE);
	/* Not a number */
	assert_int_equal(fake_put(&fake, 1, 104, 2, 0x7FC0, 0), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 104, 2, 0x7F80, 0), ILLEGAL_VALUE);
	/* Read-only, and nothing there */
	assert_int_equal(fake_put(&fake, 1, 0, 1, 0), ILLEGAL_ADDRESS);
	assert_int_equal(fake_put(&fake, 1, 31, 3, 0, 0, 0), ILLEGAL_ADDRESS);
	assert_int_equal(fake_put(&fake, 1, 135, 2, 0, 0), ILLEGAL_ADDRESS);
	assert_int_equal(fake_put(&fake, 1, 1000, 1, 0), ILLEGAL_ADDRESS);
	/* Commands */
	assert_int_equal(fake_put(&fake, 1, 101, 1, 63), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 100, 6, 0, DB_CMD_MOVE_VELOCITY, 0, 9, 0x4B00, 0),
	                 ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 0);
	for (uint16_t address = 100; address < 120; address++)
		assert_int_equal(fake_get1(&fake, 1, address), 0);
	assert_int_equal(fake_get1(&fake, 1, 24), DB_RESULT_OUT_OF_RANGE);
	fake_registers_close(&fake);
}

/* Also where the write ends in the middle of an argument, or that is no number. */
static void a_stop_is_a_stop_whatever_is_written_with_it(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, 1, 100, 3, 0, DB_CMD_STOP, 7), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_get1(&fake, 1, 101), 0);
	assert_int_equal(fake_put(&fake, 1, 101, 5, DB_CMD_DISABLE, 0, 0, 0x7FC0, 0),
	                 DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_DISABLE);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_put(&fake, 1, 100, 3, 0, DB_CMD_ENABLE, 7), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 2);
	fake_registers_close(&fake);
}

static void parameter_writes(void **state)
{
	FAKE();
	/* cid mcs spd: one request */
	assert_int_equal(fake_put(&fake, 1, 202, 4, 5, 3, 0xC2C8, 0), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->setting_count, 3);
	assert_int_equal(fake_last_request(&fake)->settings[0].param, 1);
	assert_int_equal(fake_last_request(&fake)->settings[0].value.u, 5);
	assert_int_equal(fake_last_request(&fake)->settings[2].param, 3);
	assert_true(fake_last_request(&fake)->settings[2].value.f == -100.0f);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.answered_with, 0);
	assert_int_equal(fake_get1(&fake, 1, 24), DB_RESULT_OK);
	assert_int_equal(fake_get1(&fake, 1, 23), DB_RESULT_NONE);
	/* One wrong value, and none is written. */
	assert_int_equal(fake_put(&fake, 1, 202, 2, 5, 9), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 202, 2, 33, 1), ILLEGAL_VALUE);
	assert_int_equal(fake.submitted, 1);
	/* The free register keeps quiet. */
	assert_int_equal(fake_put(&fake, 1, 240, 2, 1, 0), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->setting_count, 1);
	assert_int_equal(fake_put(&fake, 1, 240, 2, 1, 1), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 241, 1, 0), 0);
	assert_int_equal(fake.submitted, 2);
	/* acceleration and deceleration */
	assert_int_equal(fake_put(&fake, 1, 32, 4, 0x42C8, 0, 0x4348, 0), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->settings[0].param, 4);
	assert_int_equal(fake_last_request(&fake)->settings[1].param, 5);
	assert_true(fake_last_request(&fake)->settings[1].value.f == 200.0f);
	publish_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(fake_put(&fake, 1, 202, 1, 5), NO_ANSWER);
	fake_registers_close(&fake);
}

/* The first one is named until the next write; what the model lacks takes back the 0 that it reads as. */
static void a_refused_parameter_is_named(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX & ~(UINT64_C(1) << 2));

	FAKE();
	assert_int_equal(fake_put(&fake, 1, 202, 2, 5, 9), ILLEGAL_VALUE);
	assert_int_equal(fake_get1(&fake, 1, 67), 203);
	assert_int_equal(fake_put(&fake, 1, 202, 2, 5, 8), DB_WRITE_LATER);
	assert_int_equal(fake_get1(&fake, 1, 67), 0);
	complete_last(&fake, DB_RESULT_OK);
	db_axis_publish_nameplate(fake.axes[0], &plate);
	assert_int_equal(fake_put(&fake, 1, 202, 2, 5, 0), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->setting_count, 1);
	complete_last(&fake, DB_RESULT_OK);
	/* By itself, or another value: that is for the drive to say. */
	assert_int_equal(fake_put(&fake, 1, 202, 2, 5, 1), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->setting_count, 2);
	assert_int_equal(fake_put(&fake, 1, 203, 1, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 4);
	fake_registers_close(&fake);
}

static void coils(void **state)
{
	const uint16_t levels[] = { 1, 0, 1, 1, 1, 1, 1 };
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX);

	FAKE();
	for (unsigned i = 0; i < 6; i++)
		plate.values[VSMD_S1 + i].u = 1;
	db_axis_publish_nameplate(fake.axes[0], &plate);
	assert_int_equal(put_values(&fake, DB_TABLE_COILS, 1, 3, levels), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_SET_OUTPUTS);
	assert_int_equal(fake_last_request(&fake)->args->output_mask, 0x0E);
	assert_int_equal(fake_last_request(&fake)->args->output_levels, 0x0A);
	complete_last(&fake, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered_with, 4);
	assert_int_equal(put_values(&fake, DB_TABLE_COILS, 0, 7, levels), ILLEGAL_ADDRESS);
	assert_int_equal(fake_get1(&fake, 1, 108), 0);
	fake_registers_close(&fake);
}

/* Slow controllers with several axes: what is read every two seconds is two seconds old. */
static void a_slow_round_is_no_silence(void **state)
{
	FAKE();
	fake.now += 2000 * MS;
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 12, 2), NO_ANSWER);
	fake.bus_stats[0].cycle_us = 1900 * 1000;
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 12, 2), 0);
	fake.now += 4000 * MS;
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 12, 2), NO_ANSWER);
	fake_registers_close(&fake);
}

/* One port after the other is switched: none is, when one of them cannot be. */
static void coils_with_an_input_among_them(void **state)
{
	const uint16_t levels[] = { 1, 0, 1 };
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, UINT64_MAX);

	FAKE();
	for (unsigned i = 0; i < 6; i++)
		plate.values[VSMD_S1 + i].u = i != 2;
	db_axis_publish_nameplate(fake.axes[0], &plate);
	assert_int_equal(put_values(&fake, DB_TABLE_COILS, 0, 3, levels), 4);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake_get1(&fake, 1, 24), DB_RESULT_REFUSED);
	assert_int_equal(fake_get1(&fake, 1, 67), 3);
	/* A command with a mask is the same. */
	assert_int_equal(fake_put(&fake, 1, 108, 2, 0x0C, 0x0C), 0);
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_SET_OUTPUTS), 4);
	assert_int_equal(fake.submitted, 0);
	/* Whether it still is one is to be read again. */
	plate.doubtful = true;
	db_axis_publish_nameplate(fake.axes[0], &plate);
	assert_int_equal(put_values(&fake, DB_TABLE_COILS, 0, 3, levels), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_REFUSED);
	fake_registers_close(&fake);
}

/* --- control ----------------------------------------------------------------------------------------------- */

#define CONTROL_FAKE()                                                            \
	struct fake_registers fake;                                               \
	(void)state;                                                              \
	make_with(&fake, &(struct db_modbus_config){ .confirm_ms = 40,            \
	                                             .control = DB_CONTROL_DRIVE, \
	                                             .control_timeout_ms = 5000 })

/* FC 16 on unit 1 by somebody else than `fake_client`. */
static int intrude(struct fake_registers *fake, uint16_t address, unsigned count, ...)
{
	uint16_t values[16];
	va_list words;

	va_start(words, count);
	for (unsigned i = 0; i < count; i++)
		values[i] = (uint16_t)va_arg(words, int);
	va_end(words);
	return db_registers_backend.write(fake->registers, &intruder, 1, DB_TABLE_HOLDING, address,
	                                  (uint16_t)count, values,
	                                  (struct db_write_token){ 2, 42 });
}

static uint16_t intruder_sees(struct fake_registers *fake, uint16_t address)
{
	uint16_t value = 0xDEAD;

	assert_int_equal(db_registers_backend.read(fake->registers, &intruder, 1, DB_TABLE_HOLDING,
	                                           address, 1, &value),
	                 0);
	return value;
}

static void without_control(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, 1, 56, 1, 1), ILLEGAL_FUNCTION);
	assert_int_equal(fake_get1(&fake, 1, 24), DB_RESULT_UNSUPPORTED);
	assert_int_equal(fake_put(&fake, 1, 56, 1, 0), 0);
	assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 1), 0);
	assert_int_equal(intrude(&fake, 102, 2, 0, 2), 0);
	assert_int_equal(intrude(&fake, 100, 2, 0, DB_CMD_HOME), DB_WRITE_LATER);
	assert_int_equal(fake_get1(&fake, 1, 56), 0);
	assert_int_equal(fake_get2(&fake, 1, 58), 0);
	assert_int_equal(fake_get2(&fake, 1, 60), 0);
	assert_int_equal(fake.refused[intruder.id], 0);
	fake_registers_close(&fake);
}

static void control_is_asked_for_and_let_go(void **state)
{
	CONTROL_FAKE();
	assert_int_equal(intrude(&fake, 56, 1, 2), ILLEGAL_VALUE);
	assert_int_equal(intrude(&fake, 56, 2, 1, 0), ILLEGAL_ADDRESS);
	assert_int_equal(intrude(&fake, 56, 1, 1), 0);
	assert_int_equal(intruder_sees(&fake, 56), 1);
	assert_int_equal(fake_get1(&fake, 1, 56), 0);
	assert_int_equal(fake_get1(&fake, 1, 57), 50001);
	assert_int_equal(fake_get2(&fake, 1, 58), 0xC0A80A05);
	/* As text: 192.168.10.5 */
	assert_int_equal(fake_get1(&fake, 1, 1056), '1' << 8 | '9');
	assert_int_equal(fake_get1(&fake, 2, 1056), 0);
	fake.now += 1500 * MS;
	assert_int_equal(fake_get2(&fake, 1, 60), 3500);
	assert_int_equal(fake_put(&fake, 1, 56, 1, 1), BUSY);
	assert_int_equal(fake_get1(&fake, 1, 24), DB_RESULT_NOT_IN_CONTROL);
	assert_int_equal(fake_get1(&fake, 1, 67), 0);
	/* Letting go what one does not have is nothing. */
	assert_int_equal(fake_put(&fake, 1, 56, 1, 0), 0);
	assert_int_equal(intruder_sees(&fake, 56), 1);
	/* Other drives are free. */
	assert_int_equal(fake_get1(&fake, 2, 57), 0);
	assert_int_equal(intrude(&fake, 56, 1, 0), 0);
	assert_int_equal(fake_put(&fake, 1, 56, 1, 1), 0);
	assert_int_equal(fake_get1(&fake, 1, 56), 1);
	/* `client` has no IPv4 address. */
	assert_int_equal(fake_get2(&fake, 1, 58), UINT32_MAX);
	fake_registers_close(&fake);
}

/* Neither arguments nor settings of who has no control are kept, and no register is to blame. */
static void who_has_no_control_changes_nothing(void **state)
{
	CONTROL_FAKE();
	assert_int_equal(fake_put(&fake, 1, 56, 1, 1), 0);
	assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 5), 0);
	assert_int_equal(fake_put(&fake, 1, 46, 2, 0, 900), 0);
	assert_int_equal(intrude(&fake, 102, 2, 0, 6), BUSY);
	assert_int_equal(intruder_sees(&fake, 24), DB_RESULT_NOT_IN_CONTROL);
	assert_int_equal(intruder_sees(&fake, 67), 0);
	assert_int_equal(fake_get2(&fake, 1, 102), 5);
	assert_int_equal(intrude(&fake, 46, 2, 0, 100), BUSY);
	assert_int_equal(intruder_sees(&fake, 24), DB_RESULT_NOT_IN_CONTROL);
	assert_int_equal(intruder_sees(&fake, 67), 0);
	assert_int_equal(fake_get2(&fake, 1, 46), 900);
	assert_int_equal(intrude(&fake, 66, 1, 1), BUSY);
	assert_int_equal(intruder_sees(&fake, 67), 0);
	assert_int_equal(fake.submitted, 0);
	fake_registers_close(&fake);
}

static void the_first_write_takes_control(void **state)
{
	const uint16_t level = 1;

	CONTROL_FAKE();
	assert_int_equal(intrude(&fake, 102, 2, 0, 7), 0);
	assert_int_equal(intruder_sees(&fake, 56), 1);
	assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 8), BUSY);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 5, DB_CMD_HOME), BUSY);
	assert_int_equal(fake_put(&fake, 1, 202, 1, 5), BUSY);
	assert_int_equal(fake_put(&fake, 1, 46, 2, 0, 100), BUSY);
	assert_int_equal(put_values(&fake, DB_TABLE_COILS, 0, 1, &level), BUSY);
	assert_int_equal(fake_get1(&fake, 1, 24), DB_RESULT_NOT_IN_CONTROL);
	assert_int_equal(fake.submitted, 0);
	/* Nothing of it was kept. */
	assert_int_equal(fake_get2(&fake, 1, 102), 7);
	assert_int_equal(fake_get1(&fake, 1, 100), 0);
	assert_int_equal(fake_get2(&fake, 1, 46), 0);
	assert_int_equal(fake_get1(&fake, 1, 23), DB_RESULT_NONE);
	assert_int_equal(intrude(&fake, 101, 1, DB_CMD_SET_POSITION), DB_WRITE_LATER);
	fake_registers_close(&fake);
}

static void everybody_may_stop(void **state)
{
	CONTROL_FAKE();
	/* The first id is only remembered. */
	assert_int_equal(intrude(&fake, 100, 4, 4, DB_CMD_MOVE_RELATIVE, 0, 9), 4);
	assert_int_equal(intrude(&fake, 100, 4, 5, DB_CMD_MOVE_RELATIVE, 0, 9), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_put(&fake, 1, 100, 4, 77, DB_CMD_STOP, 0, 1000), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_DISABLE), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(fake.refused[intruder.id], 0);
	/* The one in control still is, and finds id and arguments as it left them: writing its last
	 * block again, as scanners do, does not move the drive. */
	assert_int_equal(intruder_sees(&fake, 56), 1);
	assert_int_equal(intruder_sees(&fake, 100), 5);
	assert_int_equal(intruder_sees(&fake, 103), 9);
	assert_int_equal(intrude(&fake, 100, 4, 5, DB_CMD_MOVE_RELATIVE, 0, 9), 0);
	assert_int_equal(fake.submitted, 3);
	fake_registers_close(&fake);
}

static void a_stop_takes_no_control(void **state)
{
	CONTROL_FAKE();
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_QUICK_STOP), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_get1(&fake, 1, 56), 0);
	assert_int_equal(fake_get2(&fake, 1, 60), 0);
	fake_registers_close(&fake);
}

static void control_is_lost(void **state)
{
	CONTROL_FAKE();
	assert_int_equal(intrude(&fake, 56, 1, 1), 0);
	assert_int_equal(fake_put(&fake, 1, 202, 1, 5), BUSY);
	/* Its connection ends; those of others are nothing to it. */
	db_registers_backend.client(fake.registers, &fake_client, false);
	assert_int_equal(intruder_sees(&fake, 56), 1);
	db_registers_backend.client(fake.registers, &intruder, false);
	assert_int_equal(fake_get1(&fake, 1, 57), 0);
	/* It is silent towards this drive, while reading goes on keeping it. */
	assert_int_equal(intrude(&fake, 56, 1, 1), 0);
	for (int i = 0; i < 3; i++) {
		fake.now += 4999 * MS;
		assert_int_equal(intruder_sees(&fake, 56), 1);
		assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 1), BUSY);
	}
	assert_int_equal(fake.refused[intruder.id], 0);
	fake.now += 5000 * MS;
	assert_int_equal(fake_get1(&fake, 1, 57), 0);
	assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 1), 0);
	assert_int_equal(intrude(&fake, 102, 2, 0, 1), BUSY);
	assert_int_equal(fake.refused[intruder.id], 1);
	fake_registers_close(&fake);
}

/* Who does not control a drive does not keep it moving either. */
static void only_who_controls_feeds_the_watchdog(void **state)
{
	CONTROL_FAKE();
	fake.drives[0].on_client_loss = DB_ON_LOSS_STOP;
	fake_registers_open(&fake);
	assert_int_equal(intrude(&fake, 46, 2, 0, 1000), 0);
	assert_int_equal(intrude(&fake, 100, 4, 0, DB_CMD_MOVE_RELATIVE, 0, 9), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_OK);
	fake.now += 600 * MS;
	assert_int_equal(fake_get2(&fake, 1, 48), 400);
	assert_int_equal(intruder_sees(&fake, 48), 0);
	assert_int_equal(fake_get2(&fake, 1, 48), 1000);
	fake.now += 999 * MS;
	assert_int_equal(fake_get2(&fake, 1, 48), 1);
	fake.now += 1 * MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(fake_get2(&fake, 1, 50), 1);
	fake_registers_close(&fake);
}

/* Drive 1 moves, with a watchdog of a second. */
static void move_with_watchdog(struct fake_registers *fake, enum db_watchdog_feed feed)
{
	fake->drives[0].on_client_loss = DB_ON_LOSS_STOP;
	fake->drives[0].watchdog_ms = 1000;
	fake->drives[0].watchdog_feed = feed;
	fake_registers_open(fake);
	assert_int_equal(fake_put(fake, 1, 100, 4, 0, DB_CMD_MOVE_RELATIVE, 0, 9), DB_WRITE_LATER);
	complete_last(fake, DB_RESULT_OK);
}

static int put_gateway(struct fake_registers *fake, const struct db_client *who, uint16_t address,
                       uint16_t value)
{
	return db_registers_backend.write(fake->registers, who, 255, DB_TABLE_HOLDING, address, 1,
	                                  &value, FAKE_TOKEN);
}

static void requests_feed_unless_only_writes_do(void **state)
{
	FAKE();
	move_with_watchdog(&fake, DB_FEED_REQUESTS);
	fake.now += 600 * MS;
	assert_int_equal(fake_get2(&fake, 1, 48), 1000);
	fake_registers_close(&fake);
	make(&fake);
	move_with_watchdog(&fake, DB_FEED_WRITES);
	fake.now += 600 * MS;
	assert_int_equal(fake_get2(&fake, 1, 48), 400);
	/* Of the heartbeat, too, whatever its value, but not to the gateway. */
	assert_int_equal(put_gateway(&fake, &fake_client, 68, 1), 0);
	assert_int_equal(put_gateway(&fake, &fake_client, 68, 2), 0);
	assert_int_equal(fake_get2(&fake, 1, 48), 400);
	assert_int_equal(fake_put(&fake, 1, 66, 1, 0), 0);
	assert_int_equal(fake_get2(&fake, 1, 48), 1000);
	fake_registers_close(&fake);
}

/* Settings that are admitted are a sign of life of who commands, and of nobody else. */
static void settings_feed_from_who_commands(void **state)
{
	FAKE();
	for (enum db_watchdog_feed feed = DB_FEED_COMMANDERS; feed <= DB_FEED_WRITES; feed++) {
		move_with_watchdog(&fake, feed);
		fake.now += 600 * MS;
		assert_int_equal(intrude(&fake, 202, 1, 5), DB_WRITE_LATER);
		complete_last(&fake, DB_RESULT_OK);
		assert_int_equal(intrude(&fake, 46, 2, 0, 1000), 0);
		assert_int_equal(intrude(&fake, 66, 1, 7), 0);
		assert_int_equal(intruder_sees(&fake, 49), 400);
		assert_int_equal(fake_put(&fake, 1, 202, 1, 99), ILLEGAL_VALUE);
		assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 9), 0);
		assert_int_equal(intruder_sees(&fake, 49), 400);
		assert_int_equal(fake_put(&fake, 1, 202, 1, 5), DB_WRITE_LATER);
		assert_int_equal(intruder_sees(&fake, 49), 1000);
		complete_last(&fake, DB_RESULT_OK);
	}
	fake_registers_close(&fake);
}

static void only_a_new_heartbeat_feeds(void **state)
{
	FAKE();
	move_with_watchdog(&fake, DB_FEED_HEARTBEAT);
	assert_int_equal(fake_put(&fake, 1, 66, 1, 7), 0);
	fake.now += 600 * MS;
	/* What a scanner repeats: reads, the same heartbeat, settings and commands. */
	assert_int_equal(fake_put(&fake, 1, 66, 1, 7), 0);
	assert_int_equal(fake_put(&fake, 1, 46, 2, 0, 1000), 0);
	assert_int_equal(fake_put(&fake, 1, 100, 4, 0, DB_CMD_MOVE_RELATIVE, 0, 9), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake_get2(&fake, 1, 48), 400);
	assert_int_equal(fake_get1(&fake, 1, 66), 7);
	assert_int_equal(fake_put(&fake, 1, 66, 1, 8), 0);
	assert_int_equal(fake_get2(&fake, 1, 48), 1000);
	assert_int_equal(fake_get1(&fake, 1, 66), 8);
	assert_int_equal(fake_put(&fake, 1, 66, 1, 8), 0);
	fake.now += 1000 * MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(fake_get2(&fake, 1, 50), 1);
	fake_registers_close(&fake);
}

static void a_heartbeat_of_the_gateway_feeds_who_waits_for_one(void **state)
{
	FAKE();
	move_with_watchdog(&fake, DB_FEED_HEARTBEAT);
	assert_int_equal(put_gateway(&fake, &fake_client, 68, 3), 0);
	fake.now += 600 * MS;
	assert_int_equal(put_gateway(&fake, &fake_client, 68, 3), 0);
	assert_int_equal(fake_get2(&fake, 1, 48), 400);
	assert_int_equal(put_gateway(&fake, &fake_client, 68, 0), 0);
	assert_int_equal(fake_get2(&fake, 1, 48), 1000);
	assert_int_equal(fake_get1(&fake, 255, 68), 0);
	/* Together with a group command the order would be a guess. */
	assert_int_equal(put_gateway(&fake, &fake_client, 67, 0), ILLEGAL_ADDRESS);
	fake_registers_close(&fake);
}

/* A dead PLC in control is not kept alive by others that beat. */
static void only_who_controls_beats(void **state)
{
	CONTROL_FAKE();
	fake.config.modbus.control_timeout_ms = 600000;
	move_with_watchdog(&fake, DB_FEED_HEARTBEAT);
	fake.now += 100 * MS;
	assert_int_equal(intrude(&fake, 66, 1, 1), BUSY);
	assert_int_equal(fake_get1(&fake, 1, 66), 0);
	for (uint16_t i = 1; i < 5; i++) {
		assert_int_equal(put_gateway(&fake, &intruder, 68, i), 0);
		assert_int_equal(fake_get1(&fake, 255, 68), i);
		assert_int_equal(put_gateway(&fake, &fake_client, 68, 0), 0);
	}
	assert_int_equal(fake_get2(&fake, 1, 48), 900);
	assert_int_equal(put_gateway(&fake, &fake_client, 68, 1), 0);
	assert_int_equal(fake_get2(&fake, 1, 48), 1000);
	fake_registers_close(&fake);
}

static void who_is_connected(void **state)
{
	uint16_t values[40];

	CONTROL_FAKE();
	assert_int_equal(intrude(&fake, 56, 1, 1), 0);
	assert_int_equal(fake_get2(&fake, 0, 700), 0xC0A80A05);
	assert_int_equal(fake_get1(&fake, 0, 702), 50001);
	assert_int_equal(fake_get1(&fake, 0, 703), 1);
	assert_int_equal(fake_get2(&fake, 0, 704), 2);
	assert_int_equal(fake_get2(&fake, 0, 706), 3);
	assert_int_equal(fake_get2(&fake, 0, 708), 70);
	assert_int_equal(fake_get2(&fake, 0, 710), 1);
	assert_int_equal(fake_get2(&fake, 0, 712), UINT32_MAX);
	assert_int_equal(fake_get2(&fake, 0, 722), 0);
	for (uint16_t address = 724; address < 736; address++)
		assert_int_equal(fake_get1(&fake, 0, address), 0);
	assert_int_equal(fake_get2(&fake, 0, 700 + 15 * 12 + 10), 0);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_INPUT, 1520, 40, values), 0);
	assert_int_equal(values[0], '1' << 8 | '9');
	assert_int_equal(values[5], '.' << 8 | '5');
	assert_int_equal(values[6], 0);
	/* fdfd:fdfd:...: 39 characters */
	assert_int_equal(values[20], 'f' << 8 | 'd');
	assert_int_equal(values[39], 'd' << 8);
	fake_registers_close(&fake);
}

/* --- time -------------------------------------------------------------------------------------------------- */

static void late_answers(void **state)
{
	FAKE();
	assert_true(db_registers_next_deadline(fake.registers) == DB_TIME_NEVER);
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_HOME), DB_WRITE_LATER);
	assert_true(db_registers_next_deadline(fake.registers) == fake.now + 40 * MS);
	db_registers_expire(fake.registers, fake.now + 40 * MS);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, LATER);
	fake_registers_close(&fake);
}

static void foreign_tickets_are_ignored(void **state)
{
	FAKE();
	for (uint32_t ticket = 0; ticket < 10; ticket++)
		db_registers_complete(fake.registers,
		                      &(struct db_request){ .ticket = ticket << 16,
		                                            .drive = (uint16_t)(ticket - 1) },
		                      fake.now);
	assert_int_equal(fake.answered, 0);
	fake_registers_close(&fake);
}

/* --- the gateway ------------------------------------------------------------------------------------------- */

/* The flat window shows what the drive's own unit shows, all drives in one read. */
static void flat_window(void **state)
{
	uint16_t own[40];
	uint16_t values[72];

	FAKE();
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 0, 36, own), 0);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 2000, 72, values), 0);
	assert_int_equal(values[0], 1);
	assert_int_equal(values[1], 1);
	assert_int_equal(values[2], own[0]);
	assert_memory_equal(&values[4], &own[2], 4);   /* status */
	assert_int_equal(values[6], own[4]);           /* quality */
	assert_memory_equal(&values[8], &own[6], 4);   /* age */
	assert_memory_equal(&values[10], &own[12], 8); /* position, velocity */
	assert_memory_equal(&values[14], &own[16], 8); /* in units */
	assert_memory_equal(&values[18], &own[20], 4); /* drive_status */
	assert_int_equal(values[21], own[23]);
	assert_int_equal(values[22], own[30]);
	/* The third drive, and none behind it. */
	assert_int_equal(values[48], 3);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 2072, 1, values), ILLEGAL_ADDRESS);
	/* Too old to be shown: not online any more. */
	fake.now += 7000 * MS;
	assert_int_equal(fake_get1(&fake, 0, 2001), 0);
	assert_int_equal(fake_get1(&fake, 0, 2002), DB_AXIS_OFFLINE);
	fake_registers_close(&fake);
}

static void gateway(void **state)
{
	uint16_t values[125];

	FAKE();
	assert_int_equal(fake_get1(&fake, 0, 1001), 1);
	assert_int_equal(fake_get1(&fake, 0, 1002), DB_AXIS_STANDSTILL);
	fake.now += 7000 * MS;
	assert_int_equal(fake_get(&fake, 255, DB_TABLE_INPUT, 0, 28, values), 0);
	assert_int_equal(values[0], DB_VERSION_MAJOR);
	assert_int_equal(values[1], DB_VERSION_MINOR);
	assert_int_equal(values[2], DB_VERSION_PATCH);
	assert_int_equal(values[3], 2);
	assert_int_equal(values[4], 3);
	assert_int_equal(values[5], 3);
	assert_int_equal(fake_get2(&fake, 0, 6), 7);
	assert_int_equal(fake_get2(&fake, 200, 8), 3);
	assert_int_equal(fake_get2(&fake, 0, 20), 0xFFFF0007);
	assert_int_equal(fake_get1(&fake, 0, 100), 1);
	assert_int_equal(fake_get2(&fake, 0, 102), 20000);
	assert_int_equal(fake_get2(&fake, 0, 140 + 14), 70001);
	assert_int_equal(fake_get1(&fake, 0, 1000), 1);
	/* Seven seconds old: as good as none. */
	assert_int_equal(fake_get1(&fake, 0, 1001), 0);
	assert_int_equal(fake_get1(&fake, 0, 1002), DB_AXIS_OFFLINE);
	assert_int_equal(fake_get2(&fake, 0, 1004), 7010);
	assert_int_equal(fake_get1(&fake, 0, 1017), 0);
	assert_int_equal(fake_get2(&fake, 0, 1020), UINT32_MAX);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 1000, 48, values), 0);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 180, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 1048, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_COILS, 0, 1, values), ILLEGAL_ADDRESS);
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, 0,
	                                            DB_TABLE_HOLDING, 0, 1, values, FAKE_TOKEN),
	                 ILLEGAL_ADDRESS);
	fake_registers_close(&fake);
}

/* The first message only, and as much of it as there is room for. */
static void the_gateway_tells_of_a_refused_configuration(void **state)
{
	char text[1024];
	uint16_t values[80];
	unsigned length = 0;

	FAKE();
	assert_int_equal(fake_get1(&fake, 0, 36), DB_CONFIGURATION_IN_FORCE);
	assert_int_equal(fake_get1(&fake, 0, 600), 0);
	fake.configuration = (struct db_configuration_report){
		.state = DB_CONFIGURATION_REFUSED,
		.since_us = 0x0001000200030004,
		.messages = "a.conf:7: no\nb.conf:9: nor this",
		.replaced = "",
	};
	assert_int_equal(fake_get1(&fake, 0, 36), DB_CONFIGURATION_REFUSED);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 40, 4, values), 0);
	for (unsigned i = 0; i < 4; i++)
		assert_int_equal(values[i], i + 1);
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 600, 80, values), 0);
	assert_int_equal(values[5], ('n' << 8) | 'o');
	assert_int_equal(values[6], 0);
	memset(text, 'x', sizeof(text));
	text[sizeof(text) - 1] = '\0';
	fake.configuration.messages = text;
	assert_int_equal(fake_get(&fake, 0, DB_TABLE_HOLDING, 600, 80, values), 0);
	while (length < 80 && values[length] == (('x' << 8) | 'x'))
		length++;
	assert_int_equal(length, 80);
	fake_registers_close(&fake);
}

static void identification(void **state)
{
	char text[100];
	char small[8];
	size_t length;
	bool running;

	FAKE();
	length = db_registers_backend.server_id(fake.registers, &fake_client, 1, text, sizeof text,
	                                        &running);
	text[length] = '\0';
	assert_true(running);
	assert_string_equal(text, "drivebridge " DB_VERSION " unit 1 feeder VSMD113");
	length = db_registers_backend.server_id(fake.registers, &fake_client, 1, small,
	                                        sizeof small, &running);
	assert_true(length < sizeof small);
	assert_int_equal(
		db_registers_backend.server_id(fake.registers, &fake_client, 1, small, 0, &running),
		0);
	/* One byte is for the end of the text. */
	length = strlen("drivebridge " DB_VERSION " gateway");
	assert_int_equal(db_registers_backend.server_id(fake.registers, &fake_client, 0, text,
	                                                length, &running),
	                 length - 1);
	assert_int_equal(db_registers_backend.server_id(fake.registers, &fake_client, 0, text,
	                                                length + 1, &running),
	                 length);
	length = db_registers_backend.server_id(fake.registers, &fake_client, 0, text, sizeof text,
	                                        &running);
	text[length] = '\0';
	assert_string_equal(text, "drivebridge " DB_VERSION " gateway");
	(void)db_registers_backend.server_id(fake.registers, &fake_client, 2, text, sizeof text,
	                                     &running);
	assert_false(running);
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 1, 0),
	                    "drivebridge");
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 1, 1),
	                    "vsmd-serial");
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 1, 2),
	                    DB_VERSION);
	/* Nobody publishes what is built here. */
	assert_null(db_registers_backend.device_id(fake.registers, &fake_client, 1, 3));
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 1, 4),
	                    db_driver_find("vsmd-serial")->title);
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 1, 5),
	                    "VSMD113");
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 2, 5),
	                    db_driver_find("vsmd-serial")->title);
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 1, 6),
	                    "feeder");
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 0, 0),
	                    "drivebridge");
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 0, 4),
	                    "drivebridge gateway");
	assert_string_equal(db_registers_backend.device_id(fake.registers, &fake_client, 0, 5),
	                    "gateway");
	assert_null(db_registers_backend.device_id(fake.registers, &fake_client, 0, 6));
	assert_null(db_registers_backend.device_id(fake.registers, &fake_client, 1, 7));
	db_registers_backend.client(fake.registers, &fake_client, true);
	assert_int_equal(fake.connected, 1);
	fake_registers_close(&fake);
}

/* --- another roster ----------------------------------------------------------------------------------- */

/* What was written by fake_write_sheet() and changed since takes its place. */
static struct db_registers_change *prepare(struct fake_registers *fake,
                                           const struct fake_sheet *sheet)
{
	struct db_registers_change *made = NULL;

	assert_int_equal(db_registers_prepare(fake->registers, &sheet->roster, &made), 0);
	return made;
}

static int unit_of(struct fake_registers *fake, uint8_t unit)
{
	return db_registers_backend.unit(fake->registers, &fake_client, unit);
}

/* Takes the drive of this place out of the sheet. */
static void strike_out(struct fake_sheet *sheet, size_t place)
{
	sheet->roster.drive_count--;
	for (size_t i = place; i < sheet->roster.drive_count; i++)
		sheet->drives[i] = sheet->drives[i + 1];
}

static void drives_that_stay_keep_everything(void **state)
{
	struct db_modbus_config modbus = { .confirm_ms = 70, .gateway_unit = 100 };
	struct db_registers_change *change;
	struct fake_sheet sheet;

	CONTROL_FAKE();
	publish_status(&fake, ONLINE);
	assert_int_equal(fake_put(&fake, 1, 100, 4, 7, DB_CMD_MOVE_RELATIVE, 0, 9), 0x04);
	assert_int_equal(fake_put(&fake, 1, 100, 4, 8, DB_CMD_MOVE_RELATIVE, 0, 9), DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->ticket >> 16, 1);
	/* Last of its bus now, and the buses have changed places, too. */
	fake_write_sheet(&fake, &sheet);
	modbus.control = DB_CONTROL_DRIVE;
	modbus.control_timeout_ms = 7000;
	sheet.roster.modbus = &modbus;
	sheet.buses[0] = (struct db_roster_bus){ &fake.buses[1], (void *)&fake.buses[1] };
	sheet.buses[1] = (struct db_roster_bus){ &fake.buses[0], (void *)&fake.buses[0] };
	sheet.drives[0] = (struct db_roster_drive){ 2, 0, &fake.drives[2], fake.axes[2] };
	sheet.drives[1] = (struct db_roster_drive){ 1, 0, &fake.drives[1], fake.axes[1] };
	sheet.drives[2] = (struct db_roster_drive){ 0, 1, &fake.drives[0], fake.axes[0] };
	change = prepare(&fake, &sheet);
	db_registers_retire(fake.registers, change);
	assert_int_equal(unit_of(&fake, 1), 0);
	db_registers_apply(fake.registers, change);
	assert_int_equal(fake.answered, 0);
	assert_int_equal(fake_get1(&fake, 1, 56), 1);
	/* The write that was pending ends, and its id is known. */
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, 0);
	assert_int_equal(fake_get1(&fake, 1, 22), 8);
	assert_int_equal(fake_get1(&fake, 1, 23), DB_RESULT_OK);
	assert_int_equal(fake_put(&fake, 1, 100, 4, 8, DB_CMD_MOVE_RELATIVE, 0, 9), 0);
	assert_int_equal(fake.submitted, 1);
	/* Control is kept, with its new time. */
	assert_int_equal(fake_get1(&fake, 1, 56), 1);
	assert_int_equal(fake_get2(&fake, 1, 60), 7000);
	assert_int_equal(intrude(&fake, 100, 4, 0, DB_CMD_MOVE_RELATIVE, 0, 9), BUSY);
	/* Requests go where they went. */
	assert_int_equal(fake_put(&fake, 1, 100, 2, 9, DB_CMD_ENABLE), DB_WRITE_LATER);
	assert_int_equal(fake.submitted_to, 0);
	/* The gateway follows the new order. */
	assert_int_equal(fake_get1(&fake, 100, 1000), 3);
	assert_int_equal(fake_get1(&fake, 100, 2048), 1);
	assert_int_equal(unit_of(&fake, 200), NO_PATH);
	fake_registers_close(&fake);
}

/* Lists of names that somebody keeps are read anew when drives leave, and when they came. */
static void names_have_another_generation_after_each_change(void **state)
{
	struct db_registers_change *change;
	struct fake_sheet sheet;
	uint32_t first;
	uint32_t second;

	FAKE();
	fake_write_sheet(&fake, &sheet);
	strike_out(&sheet, 0);
	first = db_named_generation(fake.registers);
	change = prepare(&fake, &sheet);
	assert_int_equal(db_named_generation(fake.registers), first);
	db_registers_retire(fake.registers, change);
	second = db_named_generation(fake.registers);
	assert_int_not_equal(second, first);
	db_registers_apply(fake.registers, change);
	assert_int_not_equal(db_named_generation(fake.registers), second);
	assert_int_not_equal(db_named_generation(fake.registers), first);
	fake_registers_close(&fake);
}

static void a_drive_that_leaves_is_gone_at_once_and_still_answered(void **state)
{
	struct db_registers_change *change;
	struct fake_sheet sheet;

	FAKE();
	publish_status(&fake, ONLINE);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 0, DB_CMD_ENABLE), DB_WRITE_LATER);
	fake_write_sheet(&fake, &sheet);
	strike_out(&sheet, 0);
	change = prepare(&fake, &sheet);
	assert_int_equal(unit_of(&fake, 1), 0);
	db_registers_retire(fake.registers, change);
	assert_int_equal(unit_of(&fake, 1), NO_PATH);
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 0, 2), NO_PATH);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 0, DB_CMD_STOP), NO_PATH);
	/* In the gateway's registers it keeps its place, so that nobody is taken for it. */
	assert_int_equal(fake_get1(&fake, 255, 1000), 1);
	assert_int_equal(fake_get1(&fake, 255, 1001), 0);
	assert_int_equal(fake_get1(&fake, 255, 2000), 1);
	assert_int_equal(fake_get1(&fake, 255, 2024), 2);
	/* How its last write ended. */
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with, 0);
	db_registers_apply(fake.registers, change);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake_get1(&fake, 255, 1000), 2);
	assert_int_equal(unit_of(&fake, 1), NO_PATH);
	/* A completion that comes late finds nobody. */
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	fake_registers_close(&fake);
}

static void who_still_waits_is_told_that_it_was_cancelled(void **state)
{
	struct db_registers_change *change;
	struct fake_sheet sheet;

	FAKE();
	publish_status(&fake, ONLINE);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 0, DB_CMD_ENABLE), DB_WRITE_LATER);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 0, DB_CMD_STOP), DB_WRITE_LATER);
	fake_write_sheet(&fake, &sheet);
	strike_out(&sheet, 0);
	change = prepare(&fake, &sheet);
	db_registers_retire(fake.registers, change);
	db_registers_apply(fake.registers, change);
	assert_int_equal(fake.answered, 2);
	assert_int_equal(fake.answered_with, 0x04);
	assert_true(db_registers_next_deadline(fake.registers) == DB_TIME_NEVER);
	fake_registers_close(&fake);
}

/* The bus must not have sent the first drive's when the last one's comes: one frame may stop them all. */
static void the_stops_of_a_group_reach_a_bus_at_once(void **state)
{
	const uint16_t listed[] = { 6, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3 };
	const uint16_t stop = 1;
	struct db_snapshot snapshot;

	FAKE();
	snapshot = usual(&fake);
	for (unsigned i = 0; i < FAKE_PLANT_DRIVES; i++)
		db_axis_publish(fake.axes[i], &snapshot);
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, 255,
	                                            DB_TABLE_HOLDING, 60, 1, &stop, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(fake.gathered, 3);
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, 255,
	                                            DB_TABLE_HOLDING, 70, 17, listed, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 5);
	assert_int_equal(fake.gathered, 5);
	assert_false(fake.gathers[0] || fake.gathers[1]);
	fake_registers_close(&fake);
}

static void the_watchdogs_stops_reach_a_bus_at_once(void **state)
{
	FAKE();
	move_with_watchdog(&fake, DB_FEED_REQUESTS);
	fake.submitted = fake.gathered = 0;
	fake.now += 1100 * MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.gathered, 1);
	assert_false(fake.gathers[0] || fake.gathers[1]);
	fake_registers_close(&fake);
}

/* The group's write was waiting for a drive that is taken out. */
static void a_group_does_not_wait_for_who_left(void **state)
{
	struct db_registers_change *change;
	struct fake_sheet sheet;
	const uint16_t stop = 1;

	FAKE();
	publish_status(&fake, ONLINE);
	assert_int_equal(db_registers_backend.write(fake.registers, &fake_client, 255,
	                                            DB_TABLE_HOLDING, 60, 1, &stop, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	fake_write_sheet(&fake, &sheet);
	while (sheet.roster.drive_count > 0)
		strike_out(&sheet, 0);
	change = prepare(&fake, &sheet);
	db_registers_retire(fake.registers, change);
	db_registers_apply(fake.registers, change);
	assert_int_equal(fake.answered, 1);
	fake_registers_close(&fake);
}

/* Taken out and put in again under another number: to the bridge it is another drive. */
static void a_changed_drive_begins_anew(void **state)
{
	struct db_drive_config changed;
	struct db_registers_change *change;
	uint32_t late;
	struct fake_sheet sheet;

	FAKE();
	publish_status(&fake, ONLINE);
	fake_put(&fake, 1, 100, 2, 5, DB_CMD_ENABLE);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 6, DB_CMD_ENABLE), DB_WRITE_LATER);
	late = fake_last_request(&fake)->ticket;
	changed = fake.drives[0];
	changed.max_velocity = 1.0;
	fake_write_sheet(&fake, &sheet);
	sheet.drives[0].drive = 3;
	sheet.drives[0].config = &changed;
	change = prepare(&fake, &sheet);
	db_registers_retire(fake.registers, change);
	assert_int_equal(unit_of(&fake, 1), NO_PATH);
	db_registers_apply(fake.registers, change);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake_get1(&fake, 1, 22), 0);
	/* The same id is the first one again. */
	assert_int_equal(fake_put(&fake, 1, 100, 2, 6, DB_CMD_ENABLE), 0x04);
	assert_int_equal(fake_get1(&fake, 1, 23), DB_RESULT_RESTARTED);
	assert_int_equal(fake_put(&fake, 1, 100, 2, 7, DB_CMD_ENABLE), DB_WRITE_LATER);
	assert_true(fake_last_request(&fake)->ticket != late);
	db_registers_complete(fake.registers,
	                      &(struct db_request){ .ticket = late, .result = DB_RESULT_OK },
	                      fake.now);
	assert_int_equal(fake.answered, 1);
	complete_last(&fake, DB_RESULT_OK);
	assert_int_equal(fake.answered, 2);
	fake_registers_close(&fake);
}

static void what_was_prepared_can_be_forgotten(void **state)
{
	struct db_modbus_config modbus = { .confirm_ms = 70, .gateway_unit = 100 };
	struct fake_sheet sheet;

	FAKE();
	fake_write_sheet(&fake, &sheet);
	sheet.roster.modbus = &modbus;
	sheet.drives[1].drive = 9;
	strike_out(&sheet, 0);
	db_registers_change_free(prepare(&fake, &sheet));
	assert_int_equal(unit_of(&fake, 200), 0);
	assert_int_equal(unit_of(&fake, 100), NO_PATH);
	assert_int_equal(fake_get1(&fake, 255, 1000), 1);
	fake_registers_close(&fake);
}

static void who_may_not_write_any_more_loses_control(void **state)
{
	CONTROL_FAKE();
	publish_status(&fake, ONLINE);
	assert_int_equal(intrude(&fake, 56, 1, 1), 0);
	assert_int_equal(fake_get1(&fake, 1, 57), intruder.port);
	db_registers_backend.restricted(fake.registers, &fake_client);
	assert_int_equal(fake_get1(&fake, 1, 57), intruder.port);
	db_registers_backend.restricted(fake.registers, &intruder);
	assert_int_equal(fake_get1(&fake, 1, 57), 0);
	fake_registers_close(&fake);
}

/* An exact interval is still one. */
static void data_are_useless_after_ten_intervals(void **state)
{
	struct db_snapshot snapshot;

	FAKE();
	snapshot = usual(&fake);
	snapshot.feedback.taken = fake.now;
	snapshot.stats.poll_interval_us = 500 * 1000;
	db_axis_publish(fake.axes[0], &snapshot);
	fake.now += 5000 * MS;
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 12, 2), 0);
	fake.now += 1;
	assert_int_equal(try_get(&fake, DB_TABLE_HOLDING, 12, 2), NO_ANSWER);
	fake_registers_close(&fake);
}

/* Three rounds over all the drives of their bus, where those take longer than a second. */
static void a_slow_line_has_old_data(void **state)
{
	struct db_snapshot snapshot;
	db_time round;

	FAKE();
	fake.buses[1].baud = 300;
	fake_registers_open(&fake);
	round = 2 * fake.buses[1].driver->poll_time(&fake.buses[1]);
	assert_true(3 * round > 1500 * MS);
	snapshot = usual(&fake);
	snapshot.feedback.taken = fake.now;
	db_axis_publish(fake.axes[1], &snapshot);
	fake.now += 3 * round;
	assert_int_equal(fake_get1(&fake, 2, 0), DB_AXIS_STANDSTILL);
	fake.now += 1;
	assert_int_equal(fake_get1(&fake, 2, 0), DB_AXIS_OFFLINE);
	fake_registers_close(&fake);
}

/* What its own list says. */
static void what_is_configured_is_shown(void **state)
{
	uint16_t values[10];

	FAKE();
	assert_int_equal(fake_get1(&fake, 1, 1020), 1);
	assert_int_equal(fake_get1(&fake, 1, 1021), 5);
	assert_int_equal(fake_get1(&fake, 3, 1020), 2);
	assert_int_equal(fake_get1(&fake, 3, 1021), 7);
	assert_int_equal(fake_get2(&fake, 1, 1030), 0x44200000); /* 640 */
	assert_int_equal(fake_get(&fake, 1, DB_TABLE_HOLDING, 1022, 8, values), 0);
	assert_int_equal(values[0], 'm' << 8 | 'm');
	for (unsigned i = 1; i < 8; i++)
		assert_int_equal(values[i], 0);
	fake_registers_close(&fake);
}

static void lines_and_buses_show_their_state(void **state)
{
	FAKE();
	fake.bus_stats[0].last_error = 5;
	assert_int_equal(fake_get1(&fake, 0, 101), 5);
	assert_int_equal(fake_get1(&fake, 0, 440), 0);
	fake.bus_stats[0].port.up = true;
	assert_int_equal(fake_get1(&fake, 0, 440), 1);
	fake.bus_stats[0].port.error = ENETRESET;
	assert_int_equal(fake_get1(&fake, 0, 440), 3);
	assert_int_equal(fake_get1(&fake, 0, 441), ENETRESET);
	fake.bus_stats[0].port.error = EBUSY;
	fake.bus_stats[0].port.error_passive = true;
	assert_int_equal(fake_get1(&fake, 0, 440), 5);
	fake.bus_stats[0].port.error_warning = true;
	assert_int_equal(fake_get1(&fake, 0, 440), 13);
	fake.bus_stats[0].up = false;
	assert_int_equal(fake_get1(&fake, 0, 440), 12);
	assert_int_equal(fake_get1(&fake, 0, 100), 0);
	fake_registers_close(&fake);
}

/* Since when it is, by what the cause is. */
static void trouble_is_as_old_as_its_cause(void **state)
{
	static const enum db_trouble_cause silences[] = { DB_TROUBLE_NO_ANSWER,
		                                          DB_TROUBLE_NOT_UNDERSTOOD,
		                                          DB_TROUBLE_LATE, DB_TROUBLE_DEAF };
	struct db_snapshot snapshot;

	FAKE();
	snapshot = usual(&fake);
	assert_int_equal(fake_get1(&fake, 1, 92), DB_TROUBLE_NONE);
	assert_int_equal(fake_get2(&fake, 1, 94), 0);
	/* What the bus has seen. */
	for (size_t i = 0; i < sizeof silences / sizeof silences[0]; i++) {
		snapshot.feedback.status = DB_STATUS_BUS_UP;
		snapshot.trouble.cause = (uint16_t)silences[i];
		snapshot.trouble.since = fake.now - 70 * MS;
		db_axis_publish(fake.axes[0], &snapshot);
		assert_int_equal(fake_get1(&fake, 1, 92), silences[i]);
		assert_int_equal(fake_get2(&fake, 1, 94), 70);
	}
	/* A drive that must stand and is not seen to. */
	snapshot = usual(&fake);
	snapshot.must_stand.cause = DB_STAND_CLIENT;
	snapshot.must_stand.since = fake.now - 1500 * MS;
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(fake_get1(&fake, 1, 92), DB_TROUBLE_MUST_STAND);
	assert_int_equal(fake_get2(&fake, 1, 94), 1500);
	assert_int_equal(fake_get1(&fake, 1, 79), DB_STAND_CLIENT);
	assert_int_equal(fake_get2(&fake, 1, 80), 1500);
	/* What only shows in the data is as old as those. */
	snapshot = usual(&fake);
	snapshot.feedback.status |= DB_STATUS_WARNING;
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(fake_get1(&fake, 1, 92), DB_TROUBLE_WARNING);
	assert_int_equal(fake_get2(&fake, 1, 94), 10);
	/* 0 is no trouble: one that has just begun is 1 ms old. */
	snapshot.must_stand.cause = DB_STAND_HOLD;
	snapshot.must_stand.since = fake.now;
	snapshot.feedback.taken = fake.now;
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(fake_get2(&fake, 1, 94), 1);
	assert_int_equal(fake_get2(&fake, 1, 80), 1);
	fake_registers_close(&fake);
}

static void a_latch_is_trouble_since_it_tripped(void **state)
{
	struct db_snapshot snapshot;

	FAKE();
	move_with_watchdog(&fake, DB_FEED_HEARTBEAT);
	fake.now += 1000 * MS;
	db_registers_expire(fake.registers, fake.now);
	fake.now += 300 * MS;
	snapshot = usual(&fake);
	db_axis_publish(fake.axes[0], &snapshot);
	assert_int_equal(fake_get1(&fake, 1, 92), DB_TROUBLE_WATCHDOG);
	assert_int_equal(fake_get2(&fake, 1, 94), 300);
	assert_int_equal(fake_get1(&fake, 1, 1), DB_ERROR_CLIENT_LOSS);
	assert_true(fake_get2(&fake, 1, 2) & DB_STATUS_LATCHED);
	fake_registers_close(&fake);
}

/* Who did what, of a parameter with its register. */
static void the_history_names_clients_and_registers(void **state)
{
	FAKE();
	assert_int_equal(intrude(&fake, 202, 1, 5), DB_WRITE_LATER);
	assert_int_equal(fake_get1(&fake, 1, 3010), DB_CMD_NONE);
	assert_int_equal(fake_get1(&fake, 1, 3020), 202);
	assert_int_equal(fake_get2(&fake, 1, 3006), 0xC0A80A05);
	assert_int_equal(fake_get1(&fake, 1, 3008), 50001);
	assert_int_equal(fake_get2(&fake, 1, 3022), 5);
	complete_last(&fake, DB_RESULT_OK);
	/* By its other name it is the same register. */
	assert_int_equal(intrude(&fake, 32, 2, 0x42C8, 0), DB_WRITE_LATER);
	assert_int_equal(fake_get1(&fake, 1, 3020), 206);
	/* The older one has moved on by one place. */
	assert_int_equal(fake_get1(&fake, 1, 3020 + 24), 202);
	db_registers_stand(fake.registers, 0, DB_CMD_STOP, DB_STAND_FAULT, fake.now);
	assert_int_equal(fake_get1(&fake, 1, 3010), DB_CMD_STOP);
	assert_int_equal(fake_get1(&fake, 1, 3008), 0);
	assert_int_equal(fake_get2(&fake, 1, 3006), 0);
	assert_int_equal(fake_get2(&fake, 1, 3004), 3);
	/* There are no more. */
	assert_int_equal(fake_get2(&fake, 1, 3004 + 72), 0);
	fake_registers_close(&fake);
}

/* Of an earlier run, if it is still the same drive. */
static void recalled_entries_are_those_of_the_same_drive(void **state)
{
	const struct db_recalled right = {
		.drive = "feeder",
		.bus = "line",
		.node = 5,
		.entry = { .timestamp_us = 9,
		           .command = DB_CMD_MOVE_ABSOLUTE,
		           .result = DB_RESULT_OK },
		.args = { .target_position = 12 },
	};
	struct db_recalled other = right;

	FAKE();
	fake.buses[0].name = (char *)"line";
	fake.buses[1].name = (char *)"other";
	other.drive = "press";
	db_registers_recall(fake.registers, &other);
	other = right;
	other.bus = "other";
	db_registers_recall(fake.registers, &other);
	other = right;
	other.node = 6;
	db_registers_recall(fake.registers, &other);
	other = right;
	other.axis = 1;
	db_registers_recall(fake.registers, &other);
	assert_int_equal(fake_get2(&fake, 1, 3004), 0);
	db_registers_recall(fake.registers, &right);
	assert_int_equal(fake_get2(&fake, 1, 3004), 1);
	assert_int_equal(fake_get1(&fake, 1, 3010), DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake_get2(&fake, 1, 3014), 12);
	/* A parameter by its name, in the type that it has now. */
	other = right;
	other.entry.command = DB_CMD_NONE;
	other.param = "acc";
	other.value = 2.0;
	db_registers_recall(fake.registers, &other);
	assert_int_equal(fake_get1(&fake, 1, 3020), 206);
	assert_int_equal(fake_get2(&fake, 1, 3022), 0x40000000);
	other.param = "gone";
	db_registers_recall(fake.registers, &other);
	assert_int_equal(fake_get1(&fake, 1, 3020), 0);
	fake_registers_close(&fake);
}

static void a_watchdog_has_its_limits(void **state)
{
	FAKE();
	assert_int_equal(
		fake_put(&fake, 1, 46, 2, DB_WATCHDOG_MAX_MS >> 16, DB_WATCHDOG_MAX_MS & 0xFFFF),
		0);
	assert_int_equal(fake_get2(&fake, 1, 46), DB_WATCHDOG_MAX_MS);
	assert_int_equal(fake_put(&fake, 1, 46, 2, (DB_WATCHDOG_MAX_MS + 1) >> 16,
	                          (DB_WATCHDOG_MAX_MS + 1) & 0xFFFF),
	                 ILLEGAL_VALUE);
	assert_int_equal(fake_get1(&fake, 1, 67), 0);
	assert_int_equal(fake_put(&fake, 1, 46, 2, 0, 0), 0);
	/* One that would stop nothing is none. */
	fake.drives[0].on_client_loss = DB_ON_LOSS_NONE;
	fake_registers_open(&fake);
	assert_int_equal(fake_put(&fake, 1, 46, 2, 0, 1000), ILLEGAL_FUNCTION);
	assert_int_equal(fake_get1(&fake, 1, 24), DB_RESULT_UNSUPPORTED);
	assert_int_equal(fake_put(&fake, 1, 46, 2, 0, 0), 0);
	assert_int_equal(fake_get2(&fake, 1, 46), 0);
	fake_registers_close(&fake);
}

/* A push button: the motion goes on while the counter does. */
static void a_held_motion_lives_by_its_counter(void **state)
{
	FAKE();
	assert_int_equal(fake_put(&fake, 1, 104, 2, 0x42C8, 0), 0);
	assert_int_equal(fake_put(&fake, 1, 134, 2, 99, 1), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 134, 2, 1001, 1), ILLEGAL_VALUE);
	assert_int_equal(fake_put(&fake, 1, 134, 2, 300, 1), 0);
	assert_int_equal(fake_put(&fake, 1, 101, 1, DB_CMD_MOVE_VELOCITY), DB_WRITE_LATER);
	complete_last(&fake, DB_RESULT_OK);
	for (uint16_t beat = 2; beat < 5; beat++) {
		fake.now += 200 * MS;
		assert_int_equal(fake_put(&fake, 1, 135, 1, beat), 0);
		db_registers_expire(fake.registers, fake.now);
		assert_int_equal(fake.submitted, 1);
	}
	/* Other registers of the block, and the same value again, are no beats. */
	fake.now += 200 * MS;
	assert_int_equal(fake_put(&fake, 1, 135, 1, 4), 0);
	assert_int_equal(fake_put(&fake, 1, 102, 2, 0, 7), 0);
	fake.now += 100 * MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(fake_last_request(&fake)->cause, DB_STAND_HOLD);
	assert_int_equal(fake.holds_lost, 1);
	fake_registers_close(&fake);
}

/* FC 22 with a mask that changes nothing, and the like: only a stop has an effect. */
static void a_register_that_stays_as_it_is(void **state)
{
	static const struct {
		uint8_t unit;
		uint16_t address;
		uint16_t value;
		int answer;
	} cases[] = {
		{ 1, 999, 0, ILLEGAL_ADDRESS },
		{ 1, 0, 0, ILLEGAL_ADDRESS },
		{ 1, 102, 0, ILLEGAL_VALUE },
		{ 1, 101, DB_CMD_HOME, 0 },
		{ 1, 202, 5, 0 },
		{ 0, 60, 1, 0 },
		{ 0, 999, 1, ILLEGAL_ADDRESS },
		{ 0, 0, 1, ILLEGAL_ADDRESS },
		{ 1, 101, DB_CMD_STOP, DB_WRITE_LATER },
	};

	FAKE();
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		assert_int_equal(fake.submitted, 0);
		assert_int_equal(db_registers_backend.write_same(fake.registers, &fake_client,
		                                                 cases[i].unit, cases[i].address,
		                                                 cases[i].value, FAKE_TOKEN),
		                 cases[i].answer);
	}
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	fake_registers_close(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(units),
		cmocka_unit_test(requests_find_their_bus),
		cmocka_unit_test(process_data),
		cmocka_unit_test(word_order),
		cmocka_unit_test(parts_of_wide_registers),
		cmocka_unit_test(registers_that_do_not_exist),
		cmocka_unit_test(blocks_cross_what_the_drive_lacks),
		cmocka_unit_test(offline_drive),
		cmocka_unit_test(blocks_with_unknown_parameters),
		cmocka_unit_test(stale_values),
		cmocka_unit_test(quality_and_age),
		cmocka_unit_test(parameters),
		cmocka_unit_test(bits),
		cmocka_unit_test(bits_of_the_drives_own_status),
		cmocka_unit_test(a_block_is_one_command),
		cmocka_unit_test(arguments_are_kept_for_a_single_register),
		cmocka_unit_test(a_command_alone_has_no_used_id),
		cmocka_unit_test(writes_that_are_refused),
		cmocka_unit_test(a_stop_is_a_stop_whatever_is_written_with_it),
		cmocka_unit_test(parameter_writes),
		cmocka_unit_test(a_refused_parameter_is_named),
		cmocka_unit_test(a_slow_round_is_no_silence),
		cmocka_unit_test(coils),
		cmocka_unit_test(coils_with_an_input_among_them),
		cmocka_unit_test(without_control),
		cmocka_unit_test(control_is_asked_for_and_let_go),
		cmocka_unit_test(who_has_no_control_changes_nothing),
		cmocka_unit_test(the_first_write_takes_control),
		cmocka_unit_test(everybody_may_stop),
		cmocka_unit_test(a_stop_takes_no_control),
		cmocka_unit_test(control_is_lost),
		cmocka_unit_test(only_who_controls_feeds_the_watchdog),
		cmocka_unit_test(requests_feed_unless_only_writes_do),
		cmocka_unit_test(settings_feed_from_who_commands),
		cmocka_unit_test(only_a_new_heartbeat_feeds),
		cmocka_unit_test(a_heartbeat_of_the_gateway_feeds_who_waits_for_one),
		cmocka_unit_test(only_who_controls_beats),
		cmocka_unit_test(who_is_connected),
		cmocka_unit_test(late_answers),
		cmocka_unit_test(foreign_tickets_are_ignored),
		cmocka_unit_test(flat_window),
		cmocka_unit_test(gateway),
		cmocka_unit_test(the_gateway_tells_of_a_refused_configuration),
		cmocka_unit_test(identification),
		cmocka_unit_test(drives_that_stay_keep_everything),
		cmocka_unit_test(names_have_another_generation_after_each_change),
		cmocka_unit_test(a_drive_that_leaves_is_gone_at_once_and_still_answered),
		cmocka_unit_test(who_still_waits_is_told_that_it_was_cancelled),
		cmocka_unit_test(the_stops_of_a_group_reach_a_bus_at_once),
		cmocka_unit_test(the_watchdogs_stops_reach_a_bus_at_once),
		cmocka_unit_test(a_group_does_not_wait_for_who_left),
		cmocka_unit_test(a_changed_drive_begins_anew),
		cmocka_unit_test(what_was_prepared_can_be_forgotten),
		cmocka_unit_test(who_may_not_write_any_more_loses_control),
		cmocka_unit_test(data_are_useless_after_ten_intervals),
		cmocka_unit_test(a_slow_line_has_old_data),
		cmocka_unit_test(what_is_configured_is_shown),
		cmocka_unit_test(lines_and_buses_show_their_state),
		cmocka_unit_test(trouble_is_as_old_as_its_cause),
		cmocka_unit_test(a_latch_is_trouble_since_it_tripped),
		cmocka_unit_test(the_history_names_clients_and_registers),
		cmocka_unit_test(recalled_entries_are_those_of_the_same_drive),
		cmocka_unit_test(a_watchdog_has_its_limits),
		cmocka_unit_test(a_held_motion_lives_by_its_counter),
		cmocka_unit_test(a_register_that_stays_as_it_is),
	};

	return cmocka_run_group_tests_name("view", tests, NULL, NULL);
}
