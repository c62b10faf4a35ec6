/* SPDX-License-Identifier: Apache-2.0 */
/* What clients may, what of it is recorded, and whose requests keep a drive moving. */
#include "fakes/registers.h"
#include "regmap/clients.h"
#include "regmap/regmap_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

#define ILLEGAL_FUNCTION 0x01
#define ILLEGAL_ADDRESS 0x02
#define NO_PATH 0x0A

#define ONLINE (DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID)

/* Three drives that stand: feeder, press and saw, in units 1 to 3. */
static void make(struct fake_registers *fake, const struct db_modbus_config *modbus)
{
	static char names[][8] = { "feeder", "press", "saw" };

	fake_registers_init(fake, 2, 3);
	fake->config.modbus = *modbus;
	for (size_t i = 0; i < 3; i++) {
		struct db_snapshot snapshot = {
			.feedback = { .taken = fake->now,
			              .state = DB_AXIS_STANDSTILL,
			              .status = ONLINE,
			              .position = 7 },
		};

		fake->drives[i].name = names[i];
		fake->drives[i].watchdog_ms = 3000;
		db_axis_publish(fake->axes[i], &snapshot);
	}
	fake_registers_open(fake);
}

#define FAKE()                      \
	struct fake_registers fake; \
	(void)state;                \
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40 })

/* --- roles ------------------------------------------------------------------------------------------ */

static struct db_client with_role(const struct db_role_config *role)
{
	return (struct db_client){
		.id = 2, .address = { 9 }, .port = 5, .may_write = true, .role = role
	};
}

static int write1(struct fake_registers *fake, const struct db_client *client, uint8_t unit,
                  uint16_t address, uint16_t value)
{
	return db_registers_backend.write(fake->registers, client, unit, DB_TABLE_HOLDING, address,
	                                  1, &value, FAKE_TOKEN);
}

static int write2(struct fake_registers *fake, const struct db_client *client, uint8_t unit,
                  uint16_t address, uint16_t first, uint16_t second)
{
	const uint16_t values[] = { first, second };

	return db_registers_backend.write(fake->registers, client, unit, DB_TABLE_HOLDING, address,
	                                  2, values, FAKE_TOKEN);
}

static uint16_t read1(struct fake_registers *fake, const struct db_client *client, uint8_t unit,
                      uint16_t address)
{
	uint16_t value = 0xDEAD;

	assert_int_equal(db_registers_backend.read(fake->registers, client, unit, DB_TABLE_HOLDING,
	                                           address, 1, &value),
	                 0);
	return value;
}

static void a_role_commands_its_own_drives(void **state)
{
	const struct db_role_config role = { .read.all = true, .write.names = "press\0" };
	const struct db_client client = with_role(&role);

	FAKE();
	assert_int_equal(write1(&fake, &client, 1, 101, DB_CMD_HOME), ILLEGAL_FUNCTION);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake.refused_by_role, 1);
	assert_int_equal(fake.record.kind, DB_AUDIT_DENIED);
	assert_string_equal(fake.record.drive, "feeder");
	assert_int_equal(fake.record.unit, 1);
	assert_int_equal(fake.record.first, 101);
	assert_int_equal(fake.record_client, client.id);
	assert_non_null(strstr(fake.record.text, "role"));
	assert_int_equal(write1(&fake, &client, 2, 101, DB_CMD_HOME), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.record.kind, DB_AUDIT_COMMAND);
	/* One register of the vendor's way to write, too. */
	assert_int_equal(db_registers_backend.write_same(fake.registers, &client, 1, 101,
	                                                 DB_CMD_STOP, FAKE_TOKEN),
	                 ILLEGAL_FUNCTION);
	assert_int_equal(db_registers_backend.write_same(fake.registers, &client, 2, 101,
	                                                 DB_CMD_STOP, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.refused_by_role, 2);
	fake_registers_close(&fake);
}

static void a_role_sees_its_own_drives(void **state)
{
	const struct db_role_config role = { .read.names = "saw\0", .write.names = "press\0" };
	const struct db_client client = with_role(&role);
	const struct db_client other = with_role(NULL);

	FAKE();
	assert_int_equal(db_registers_backend.role(fake.registers, &client, 1), ILLEGAL_FUNCTION);
	assert_int_equal(db_registers_backend.role(fake.registers, &client, 2), 0);
	assert_int_equal(db_registers_backend.role(fake.registers, &client, 3), 0);
	assert_int_equal(db_registers_backend.role(fake.registers, &client, 0), 0);
	assert_int_equal(db_registers_backend.role(fake.registers, &other, 1), 0);
	assert_int_equal(fake.refused_by_role, 1);
	/* Who only looks is not on record. */
	assert_int_equal(fake.recorded, 0);
	/* What it may see it may not always command. */
	assert_int_equal(write1(&fake, &client, 3, 101, DB_CMD_HOME), ILLEGAL_FUNCTION);
	/* In the gateway's registers and in its window the others are empty. */
	for (unsigned i = 0; i < 3; i++) {
		uint16_t unit = i == 0 ? 0 : (uint16_t)(i + 1);

		assert_int_equal(read1(&fake, &client, 0, (uint16_t)(1000 + 16 * i)), unit);
		assert_int_equal(read1(&fake, &client, 0, (uint16_t)(2000 + 24 * i)), unit);
		assert_int_equal(read1(&fake, &client, 0, (uint16_t)(2000 + 24 * i + 11)),
		                 i == 0 ? 0 : 7);
		assert_int_equal(read1(&fake, &other, 0, (uint16_t)(1000 + 16 * i)), i + 1);
		assert_int_equal(read1(&fake, &other, 0, (uint16_t)(2000 + 24 * i)), i + 1);
	}
	fake_registers_close(&fake);
}

static void parameters_need_a_permission_of_their_own(void **state)
{
	const struct db_role_config operates = { .read.all = true, .write.all = true };
	const struct db_role_config fitter = { .write.all = true, .parameters = true };
	struct db_client client = with_role(&operates);

	FAKE();
	assert_int_equal(write1(&fake, &client, 1, 202, 5), ILLEGAL_FUNCTION);
	assert_int_equal(write2(&fake, &client, 1, 32, 0x42C8, 0), ILLEGAL_FUNCTION);
	assert_int_equal(write2(&fake, &client, 1, 46, 0, 1000), ILLEGAL_FUNCTION);
	assert_int_equal(write1(&fake, &client, 1, 101, DB_CMD_SAVE_PARAMETERS), ILLEGAL_FUNCTION);
	assert_int_equal(write1(&fake, &client, 1, 101, DB_CMD_RAW_FRAME), ILLEGAL_FUNCTION);
	assert_int_equal(write1(&fake, &client, 1, 124, DB_CMD_RAW_FRAME), ILLEGAL_FUNCTION);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake.refused_by_role, 6);
	assert_int_equal(fake.record.kind, DB_AUDIT_DENIED);
	assert_int_equal(read1(&fake, &client, 1, 47), 3000);
	/* What it may write is more than commands. */
	assert_int_equal(write1(&fake, &client, 1, 66, 1), 0);
	assert_int_equal(write2(&fake, &client, 1, 102, 0, 5), 0);
	assert_int_equal(write1(&fake, &client, 1, 101, DB_CMD_SET_POSITION), DB_WRITE_LATER);
	client.role = &fitter;
	assert_int_equal(write1(&fake, &client, 1, 202, 5), DB_WRITE_LATER);
	assert_int_equal(write2(&fake, &client, 1, 46, 0, 1000), 0);
	assert_int_equal(write1(&fake, &client, 1, 101, DB_CMD_SAVE_PARAMETERS), DB_WRITE_LATER);
	assert_int_equal(fake.refused_by_role, 6);
	fake_registers_close(&fake);
}

/* sync_start and raw frames reach every drive of the bus, now or when a staged command is started. */
static void what_reaches_the_bus_needs_all_of_its_drives(void **state)
{
	static const uint16_t commands[] = { DB_CMD_SYNC_START, DB_CMD_RAW_FRAME };
	static const uint16_t addresses[] = { 101, 124 };
	const struct db_role_config one = { .write.names = "press\0", .parameters = true };
	const struct db_role_config both = { .write.names = "press\0saw\0", .parameters = true };
	struct db_client client = with_role(&one);

	FAKE();
	for (size_t i = 0; i < 4; i++) {
		uint16_t command = commands[i / 2];
		uint16_t address = addresses[i % 2];

		client.role = &one;
		assert_int_equal(write1(&fake, &client, 2, address, command), ILLEGAL_FUNCTION);
		assert_int_equal(fake.refused_by_role, i + 1);
		assert_int_equal(fake.record.kind, DB_AUDIT_DENIED);
		assert_string_equal(fake.record.drive, "press");
		assert_non_null(strstr(fake.record.text, "every drive of the bus"));
		/* feeder is on another bus. What is wrong with it now is not the role. */
		client.role = &both;
		(void)write1(&fake, &client, 2, address, command);
		assert_int_equal(fake.refused_by_role, i + 1);
	}
	fake_registers_close(&fake);
}

/* Whatever its rights: drives of another endpoint of the same bus are none of its units. */
static void what_reaches_the_bus_stays_on_the_endpoint(void **state)
{
	static struct db_endpoint_config hall = { .name = (char *)"hall2" };
	struct db_client client = with_role(NULL);

	FAKE();
	hall.number = db_endpoint_number(hall.name);
	fake.config.modbus.endpoints = &hall;
	fake.config.modbus.endpoint_count = 1;
	fake.drives[2].endpoint = hall.number;
	fake_registers_open(&fake);
	assert_int_equal(write1(&fake, &client, 2, 101, DB_CMD_SYNC_START), ILLEGAL_FUNCTION);
	assert_non_null(strstr(fake.record.text, "drives of another endpoint"));
	assert_int_equal(write1(&fake, &client, 2, 101, DB_CMD_RAW_FRAME), ILLEGAL_FUNCTION);
	assert_int_equal(fake.submitted, 0);
	/* That drive is not there for this client. */
	assert_int_equal(db_registers_backend.unit(fake.registers, &client, 3), 0x0A);
	client.endpoint = hall.number;
	assert_int_equal(db_registers_backend.unit(fake.registers, &client, 3), 0);
	assert_int_equal(write1(&fake, &client, 3, 101, DB_CMD_SYNC_START), ILLEGAL_FUNCTION);
	/* And nothing is, for a client of an endpoint that is gone. */
	client.endpoint = db_endpoint_number("hall3");
	for (unsigned unit = 0; unit < 256; unit++)
		assert_int_equal(db_registers_backend.unit(fake.registers, &client, (uint8_t)unit),
		                 0x0A);
	fake_registers_close(&fake);
}

/* Also the first drive of all, and whichever drive is written to. */
static void every_drive_of_the_bus_counts(void **state)
{
	static char *const names[] = { "press\0saw\0", "feeder\0saw\0", "feeder\0press\0" };
	struct db_role_config role = { .parameters = true };
	struct db_client client = with_role(&role);
	struct fake_registers fake;

	(void)state;
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40 });
	for (unsigned i = 0; i < 3; i++)
		fake.drives[i].bus = 0;
	fake_registers_open(&fake);
	for (unsigned missing = 0; missing < 3; missing++) {
		role.write.names = names[missing];
		for (unsigned unit = 1; unit <= 3; unit++)
			assert_int_equal(
				write1(&fake, &client, (uint8_t)unit, 101, DB_CMD_SYNC_START),
				ILLEGAL_FUNCTION);
	}
	assert_int_equal(fake.refused_by_role, 9);
	fake_registers_close(&fake);
}

/* A stop beside something that is not permitted is carried out all the same. */
static void a_stop_is_a_stop_beside_what_is_not_permitted(void **state)
{
	const struct db_role_config operates = { .write.all = true };
	const struct db_client client = with_role(&operates);
	uint16_t block[25] = { 0 };

	FAKE();
	block[1] = DB_CMD_STOP;
	block[24] = DB_CMD_RAW_FRAME;
	assert_int_equal(db_registers_backend.write(fake.registers, &client, 1, DB_TABLE_HOLDING,
	                                            100, 25, block, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
	assert_int_equal(read1(&fake, &client, 1, 124), DB_CMD_NONE);
	fake_registers_close(&fake);
}

static void claims_and_the_gateway_need_a_permission_of_their_own(void **state)
{
	const struct db_role_config operates = { .read.all = true, .write.all = true };
	const struct db_role_config foreman = { .write.all = true, .control = true };
	struct db_client client = with_role(&operates);
	struct fake_registers fake;

	(void)state;
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40,
	                                        .control = DB_CONTROL_DRIVE,
	                                        .control_timeout_ms = 5000 });
	assert_int_equal(write1(&fake, &client, 1, 56, 1), ILLEGAL_FUNCTION);
	assert_int_equal(read1(&fake, &client, 1, 56), 0);
	assert_int_equal(write1(&fake, &client, 1, 56, 0), 0);
	assert_int_equal(write1(&fake, &client, 0, 60, 1), ILLEGAL_FUNCTION);
	assert_int_equal(fake.record.kind, DB_AUDIT_DENIED);
	assert_null(fake.record.drive);
	assert_int_equal(
		db_registers_backend.write_same(fake.registers, &client, 0, 60, 1, FAKE_TOKEN),
		ILLEGAL_FUNCTION);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(fake.refused_by_role, 3);
	client.role = &foreman;
	assert_int_equal(write1(&fake, &client, 1, 56, 1), 0);
	assert_int_equal(read1(&fake, &client, 1, 56), 1);
	assert_int_equal(fake.record.kind, DB_AUDIT_CONTROL);
	assert_string_equal(fake.record.what, "taken");
	/* Said once. */
	fake.recorded = 0;
	assert_int_equal(write1(&fake, &client, 1, 56, 1), 0);
	assert_int_equal(write1(&fake, &client, 1, 66, 1), 0);
	assert_int_equal(fake.recorded, 0);
	assert_int_equal(write1(&fake, &client, 1, 56, 0), 0);
	assert_string_equal(fake.record.what, "released");
	assert_int_equal(write1(&fake, &client, 0, 60, 1), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	fake_registers_close(&fake);
}

/* --- the audit trail -------------------------------------------------------------------------------- */

static void writes_that_no_drive_was_asked_for_are_on_record(void **state)
{
	const struct db_client client = with_role(NULL);

	FAKE();
	assert_int_equal(write1(&fake, &client, 1, 999, 1), ILLEGAL_ADDRESS);
	assert_int_equal(fake.recorded, 1);
	assert_int_equal(fake.record.kind, DB_AUDIT_DENIED);
	assert_string_equal(fake.record.drive, "feeder");
	assert_int_equal(fake.record.first, 999);
	assert_int_equal(fake.record.unit, 0); /* the drive is known */
	assert_int_equal(write1(&fake, &client, 0, 5, 1), ILLEGAL_ADDRESS);
	assert_int_equal(fake.recorded, 2);
	assert_null(fake.record.drive);
	assert_int_equal(fake.record.first, 5);
	db_registers_backend.denied(fake.registers, &client, 2, 101);
	assert_int_equal(fake.recorded, 3);
	assert_string_equal(fake.record.drive, "press");
	assert_int_equal(fake.record.unit, 2);
	/* What the gateway accepts is recorded as what it asks the drives for, if anything. */
	assert_int_equal(write1(&fake, &client, 0, 68, 1), 0);
	assert_int_equal(fake.recorded, 3);
	assert_int_equal(write1(&fake, &client, 9, 0, 1), NO_PATH);
	fake_registers_close(&fake);
}

/* Old and new, as far as the drive has told the old one. */
static void settings_are_on_record_with_their_values(void **state)
{
	const struct db_client client = with_role(NULL);

	FAKE();
	assert_int_equal(write1(&fake, &client, 1, 202, 5), DB_WRITE_LATER);
	assert_int_equal(fake.record.kind, DB_AUDIT_WRITE);
	assert_int_equal(fake.record.result, DB_RESULT_PENDING);
	assert_int_equal(fake.record.value_count, 1);
	assert_string_equal(fake.record.values[0].name, "cid");
	assert_int_equal(fake.record.values[0].new.u, 5);
	assert_false(fake.record.values[0].known);
	assert_string_equal(fake.record.drive, "feeder");
	assert_int_equal(fake.record.node, 5);
	assert_int_equal(fake.record_client, client.id);
	fake_complete(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(fake.record_ends, 1);
	assert_int_equal(fake.ended_record, 1);
	assert_int_equal(fake.ended_with, DB_RESULT_REFUSED);
	/* The watchdog is a setting as well. */
	assert_int_equal(write2(&fake, &client, 1, 46, 0, 700), 0);
	assert_int_equal(fake.record.kind, DB_AUDIT_WRITE);
	assert_string_equal(fake.record.values[0].name, "watchdog_ms");
	assert_int_equal(fake.record.values[0].old.u, 3000);
	assert_int_equal(fake.record.values[0].new.u, 700);
	assert_true(fake.record.values[0].known);
	fake_registers_close(&fake);
}

/* And why: those of clients have their client. */
static void stops_of_the_bridge_are_on_record_with_their_cause(void **state)
{
	const struct db_client client = with_role(NULL);

	FAKE();
	assert_int_equal(write1(&fake, &client, 1, 101, DB_CMD_STOP), DB_WRITE_LATER);
	assert_int_equal(fake.record.kind, DB_AUDIT_COMMAND);
	assert_int_equal(fake.record.command, DB_CMD_STOP);
	assert_null(fake.record.text);
	db_registers_stand(fake.registers, 1, DB_CMD_STOP, DB_STAND_FAULT, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake_last_request(&fake)->drive, 1);
	assert_string_equal(fake.record.drive, "press");
	assert_int_equal(fake.record_client, DB_CLIENT_NOBODY);
	assert_string_equal(fake.record.text, db_stand_cause_name(DB_STAND_FAULT));
	/* Nobody has this number. */
	db_registers_stand(fake.registers, 9, DB_CMD_STOP, DB_STAND_FAULT, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(db_registers_owed_stop(fake.registers, 1), DB_CMD_STOP);
	assert_int_equal(db_registers_owed_stop(fake.registers, 2), DB_CMD_NONE);
	assert_int_equal(db_registers_owed_stop(fake.registers, 9), DB_CMD_NONE);
	fake_registers_close(&fake);
}

/* --- signs of life ---------------------------------------------------------------------------------- */

static void run(struct fake_registers *fake, const struct db_client *client, uint8_t unit)
{
	const uint16_t block[] = { 0, DB_CMD_MOVE_RELATIVE, 0, 9 };

	assert_int_equal(db_registers_backend.write(fake->registers, client, unit, DB_TABLE_HOLDING,
	                                            100, 4, block, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	fake_complete(fake, fake->submitted - 1, DB_RESULT_OK);
}

/* Without a sign of life: looked at by nobody. */
static uint32_t remaining_ms(struct fake_registers *fake, size_t place)
{
	struct db_command_state state;

	db_commander_state(fake->registers->roster->drives[place]->commander, NULL, &state,
	                   fake->now);
	return state.watchdog_remaining_ms;
}

static void only_who_may_command_keeps_a_drive_moving(void **state)
{
	const struct db_role_config viewer = { .read.all = true, .write.names = "press\0" };
	struct db_client client = with_role(&viewer);

	FAKE();
	run(&fake, &fake_client, 1);
	fake.now += 1000 * MS;
	(void)read1(&fake, &client, 1, 0);
	assert_int_equal(remaining_ms(&fake, 0), 2000);
	client.role = NULL;
	client.may_write = false;
	(void)read1(&fake, &client, 1, 0);
	assert_int_equal(remaining_ms(&fake, 0), 2000);
	client.may_write = true;
	(void)read1(&fake, &client, 1, 0);
	assert_int_equal(remaining_ms(&fake, 0), 3000);
	fake_registers_close(&fake);
}

static void reads_keep_control_for_who_may_command(void **state)
{
	struct fake_registers fake;
	struct db_client client = with_role(NULL);
	const struct db_role_config viewer = { .read.all = true };

	(void)state;
	make(&fake, &(struct db_modbus_config){ .confirm_ms = 40,
	                                        .control = DB_CONTROL_DRIVE,
	                                        .control_timeout_ms = 5000 });
	assert_int_equal(write1(&fake, &client, 1, 56, 1), 0);
	fake.now += 3000 * MS;
	assert_int_equal(read1(&fake, &client, 1, 61), 5000);
	fake.now += 3000 * MS;
	client.role = &viewer;
	assert_int_equal(read1(&fake, &client, 1, 61), 2000);
	client.role = NULL;
	client.may_write = false;
	assert_int_equal(read1(&fake, &client, 1, 61), 2000);
	fake_registers_close(&fake);
}

/* The process did not run for a while: a client that waited with one request is there for all drives. */
static void who_had_to_wait_is_there_for_all_its_drives(void **state)
{
	const struct db_client other = with_role(NULL);

	FAKE();
	for (unsigned late_ms = 99; late_ms <= 100; late_ms++) {
		fake_registers_open(&fake);
		db_registers_expire(fake.registers, fake.now);
		run(&fake, &fake_client, 1);
		run(&fake, &fake_client, 2);
		run(&fake, &other, 3);
		/* The motion of each is looked at after 5 ms. */
		assert_true(db_registers_next_deadline(fake.registers) == fake.now + 5 * MS);
		fake.now += (5 + late_ms) * MS;
		(void)read1(&fake, &fake_client, 1, 0);
		assert_int_equal(remaining_ms(&fake, 0), 3000);
		assert_int_equal(remaining_ms(&fake, 1), late_ms < 100 ? 2896 : 3000);
		assert_int_equal(remaining_ms(&fake, 2), 3000 - 5 - late_ms);
	}
	/* Once what was due is done, a request is for its drive alone. */
	db_registers_expire(fake.registers, fake.now);
	(void)db_registers_next_deadline(fake.registers);
	fake.now += 50 * MS;
	(void)read1(&fake, &fake_client, 1, 0);
	assert_int_equal(remaining_ms(&fake, 1), 2950);
	fake_registers_close(&fake);
}

static void a_silence_is_said_with_who_was_there_last(void **state)
{
	const struct db_client other = with_role(NULL);

	FAKE();
	run(&fake, &fake_client, 1);
	fake.now += 1000 * MS;
	(void)read1(&fake, &other, 1, 0);
	fake.now += 2999 * MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.tripped, 0);
	fake.now += MS;
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.tripped, 1);
	assert_int_equal(fake.tripped_last.id, other.id);
	db_registers_expire(fake.registers, fake.now);
	assert_int_equal(fake.tripped, 1);
	fake_registers_close(&fake);
}

/* With command-id-scope = client the ids of those are forgotten who were silent longest. */
static void who_reads_is_not_forgotten(void **state)
{
	struct fake_registers fake;
	struct db_client clients[9];
	const uint16_t first[] = { 1, DB_CMD_ENABLE };
	const uint16_t second[] = { 2, DB_CMD_ENABLE };

	(void)state;
	make(&fake,
	     &(struct db_modbus_config){ .confirm_ms = 40, .command_id_scope = DB_IDS_OF_CLIENT });
	for (uint8_t i = 0; i < 9; i++) {
		fake.now += MS;
		clients[i] = (struct db_client){
			.id = 10u + i, .address = { i }, .port = 1, .may_write = true
		};
		/* The first one was there before the last one came. */
		if (i == 8)
			(void)read1(&fake, &clients[0], 1, 0);
		assert_int_equal(db_registers_backend.write(fake.registers, &clients[i], 1,
		                                            DB_TABLE_HOLDING, 100, 2, first,
		                                            FAKE_TOKEN),
		                 0x04);
	}
	assert_int_equal(db_registers_backend.write(fake.registers, &clients[0], 1,
	                                            DB_TABLE_HOLDING, 100, 2, second, FAKE_TOKEN),
	                 DB_WRITE_LATER);
	assert_int_equal(db_registers_backend.write(fake.registers, &clients[1], 1,
	                                            DB_TABLE_HOLDING, 100, 2, second, FAKE_TOKEN),
	                 0x04);
	fake_registers_close(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_role_commands_its_own_drives),
		cmocka_unit_test(a_role_sees_its_own_drives),
		cmocka_unit_test(parameters_need_a_permission_of_their_own),
		cmocka_unit_test(what_reaches_the_bus_needs_all_of_its_drives),
		cmocka_unit_test(what_reaches_the_bus_stays_on_the_endpoint),
		cmocka_unit_test(every_drive_of_the_bus_counts),
		cmocka_unit_test(a_stop_is_a_stop_beside_what_is_not_permitted),
		cmocka_unit_test(claims_and_the_gateway_need_a_permission_of_their_own),
		cmocka_unit_test(writes_that_no_drive_was_asked_for_are_on_record),
		cmocka_unit_test(settings_are_on_record_with_their_values),
		cmocka_unit_test(stops_of_the_bridge_are_on_record_with_their_cause),
		cmocka_unit_test(only_who_may_command_keeps_a_drive_moving),
		cmocka_unit_test(reads_keep_control_for_who_may_command),
		cmocka_unit_test(who_had_to_wait_is_there_for_all_its_drives),
		cmocka_unit_test(who_reads_is_not_forgotten),
		cmocka_unit_test(a_silence_is_said_with_who_was_there_last),
	};

	return cmocka_run_group_tests_name("regmap/clients", tests, NULL, NULL);
}
