/* SPDX-License-Identifier: Apache-2.0 */
/* What the server is told of writes before they are carried out, and writes to all units of a line. */
#include "driver/list.h"
#include "fakes/registers.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define COMMAND 101 /* its register */

/* Drives in these units, the last one also with the vendor's layout. */
static const unsigned units[] = { 7, 8, 247 };
#define VENDOR_UNIT 16

static void make(struct fake_registers *fake)
{
	struct db_snapshot snapshot = {
		.feedback = { .status = DB_STATUS_BUS_UP | DB_STATUS_ONLINE,
		              .state = DB_AXIS_STANDSTILL,
		              .taken = 1 },
	};

	fake_registers_init(fake, 2, 3);
	for (unsigned i = 0; i < 3; i++) {
		fake->drives[i].unit = units[i];
		db_axis_publish(fake->axes[i], &snapshot);
	}
	fake->drives[2].vendor_unit = VENDOR_UNIT;
	fake_registers_open(fake);
}

#define FAKE()                      \
	struct fake_registers fake; \
	(void)state;                \
	make(&fake)

static bool broadcast_to(struct fake_registers *fake, const uint8_t set[32], unsigned command)
{
	const uint16_t value = (uint16_t)command;

	return db_registers_backend.broadcast(fake->registers, &fake_client, set, COMMAND, 1,
	                                      &value);
}

/* Writes to this unit alone. */
static bool broadcast(struct fake_registers *fake, unsigned unit, unsigned command)
{
	uint8_t set[32] = { 0 };

	set[unit / 8] = (uint8_t)(1u << unit % 8);
	return broadcast_to(fake, set, command);
}

/* Whichever unit a line has: its drive stops, and no other. */
static void a_stop_for_all_of_a_line_reaches_its_units_only(void **state)
{
	FAKE();
	for (unsigned unit = 1; unit < 256; unit++) {
		unsigned before = fake.submitted;
		unsigned drive = 0;

		while (drive < 3 && units[drive] != unit)
			drive++;
		if (unit == VENDOR_UNIT)
			drive = 2;
		assert_int_equal(broadcast(&fake, unit, DB_CMD_STOP), drive < 3);
		assert_int_equal(fake.submitted - before, drive < 3);
		if (drive == 3)
			continue;
		assert_int_equal(fake_last_request(&fake)->drive, drive);
		assert_int_equal(fake_last_request(&fake)->command, DB_CMD_STOP);
		fake_complete(&fake, before, DB_RESULT_OK);
	}
	/* Nobody waits for an answer. */
	assert_int_equal(fake.answered, 0);
	fake_registers_close(&fake);
}

static void a_stop_for_all_units_reaches_every_drive_once(void **state)
{
	uint8_t all[32];
	unsigned stopped = 0;

	FAKE();
	memset(all, 0xFF, sizeof(all));
	assert_true(broadcast_to(&fake, all, DB_CMD_QUICK_STOP));
	assert_int_equal(fake.submitted, 3);
	for (unsigned i = 0; i < 3; i++) {
		assert_int_equal(fake.requests[i].command, DB_CMD_QUICK_STOP);
		stopped |= 1u << fake.requests[i].drive;
	}
	assert_int_equal(stopped, 7);
	fake_registers_close(&fake);
}

/* A drive without a unit of its own has unit 0, which no line has. */
static void a_drive_without_a_unit_hears_no_broadcast(void **state)
{
	uint8_t all[32];

	FAKE();
	fake.drives[0].unit = 0;
	fake_registers_open(&fake);
	memset(all, 0xFF, sizeof(all));
	assert_true(broadcast_to(&fake, all, DB_CMD_STOP));
	assert_int_equal(fake.submitted, 2);
	assert_int_not_equal(fake.requests[0].drive, 0);
	assert_int_not_equal(fake.requests[1].drive, 0);
	fake_registers_close(&fake);
}

/* Nobody would know which drives have begun what. */
static void nothing_but_stops_is_broadcast(void **state)
{
	static const enum db_command commands[] = { DB_CMD_NONE, DB_CMD_ENABLE, DB_CMD_HOME,
		                                    DB_CMD_MOVE_VELOCITY, DB_CMD_CLEAR_FAULT };
	uint8_t all[32];

	FAKE();
	memset(all, 0xFF, sizeof(all));
	for (size_t i = 0; i < sizeof(commands) / sizeof(commands[0]); i++)
		assert_false(broadcast_to(&fake, all, commands[i]));
	assert_int_equal(fake.submitted, 0);
	fake_registers_close(&fake);
}

static bool stops(struct fake_registers *fake, uint8_t unit, uint16_t address, uint16_t count,
                  const uint16_t *values)
{
	return db_registers_backend.stops(fake->registers, &fake_client, unit, address, count,
	                                  values);
}

/* Such a write goes before others, and finds room where there is none for them. */
static void a_stop_is_known_before_it_is_carried_out(void **state)
{
	const uint16_t block[] = { 500, DB_CMD_STOP, 0, 5 };
	const uint16_t disable = DB_CMD_DISABLE;
	const uint16_t enable = DB_CMD_ENABLE;

	FAKE();
	assert_true(stops(&fake, 7, COMMAND, 1, &disable));
	assert_true(stops(&fake, 7, COMMAND - 1, 4, block));
	/* One register further on it would be an argument. */
	assert_false(stops(&fake, 7, COMMAND, 4, block));
	assert_false(stops(&fake, 7, COMMAND, 1, &enable));
	/* No such unit, the gateway's, and the vendor's layout, whose commands are its own. */
	assert_false(stops(&fake, 9, COMMAND, 1, &disable));
	assert_false(stops(&fake, 255, COMMAND, 1, &disable));
	assert_false(stops(&fake, VENDOR_UNIT, COMMAND, 1, &disable));
	assert_int_equal(fake.submitted, 0);
	fake_registers_close(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_stop_for_all_of_a_line_reaches_its_units_only),
		cmocka_unit_test(a_stop_for_all_units_reaches_every_drive_once),
		cmocka_unit_test(a_drive_without_a_unit_hears_no_broadcast),
		cmocka_unit_test(nothing_but_stops_is_broadcast),
		cmocka_unit_test(a_stop_is_known_before_it_is_carried_out),
	};

	return cmocka_run_group_tests_name("regmap: what the server asks for", tests, NULL, NULL);
}
