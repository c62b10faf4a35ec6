/* SPDX-License-Identifier: Apache-2.0 */
/* What VSMD drives can be told: the ends of each argument's range, on serial lines and on CAN. */
#include "codec/vsmd.h"
#include "driver/list.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static enum db_result on_serial(enum db_command command, struct db_args args)
{
	const struct db_bus_config bus = { .driver = &db_driver_vsmd_serial };
	const struct db_drive_config drive = { .address = 1 };

	return db_driver_vsmd_serial.check(&bus, &drive, command, &args);
}

static enum db_result on_can(enum db_command command, struct db_args args)
{
	const struct db_bus_config bus = { .driver = &db_driver_vsmd_can };
	const struct db_drive_config drive = { .address = 1 };

	return db_driver_vsmd_can.check(&bus, &drive, command, &args);
}

static void expect(enum db_command command, struct db_args args, enum db_result result)
{
	assert_int_equal(on_serial(command, args), result);
	assert_int_equal(on_can(command, args), result);
}

static void allow(enum db_command command, struct db_args args)
{
	expect(command, args, DB_RESULT_OK);
}

static void refuse(enum db_command command, struct db_args args)
{
	expect(command, args, DB_RESULT_OUT_OF_RANGE);
}

#define ARGS(...) ((struct db_args){ __VA_ARGS__ })
#define TOO_FAST (VSMD_SPEED_MAX + 0.1f)

static void speeds_have_a_sign_where_they_say_the_direction(void **state)
{
	static const enum db_command moves[] = { DB_CMD_MOVE_ABSOLUTE, DB_CMD_MOVE_RELATIVE };

	(void)state;
	allow(DB_CMD_MOVE_VELOCITY, ARGS(.target_velocity = VSMD_SPEED_MAX));
	allow(DB_CMD_MOVE_VELOCITY, ARGS(.target_velocity = -VSMD_SPEED_MAX));
	refuse(DB_CMD_MOVE_VELOCITY, ARGS(.target_velocity = TOO_FAST));
	refuse(DB_CMD_MOVE_VELOCITY, ARGS(.target_velocity = -TOO_FAST));
	refuse(DB_CMD_MOVE_VELOCITY, ARGS(.target_velocity = NAN));
	for (size_t i = 0; i < 2; i++) {
		allow(moves[i], ARGS(.target_velocity = 0.0f));
		allow(moves[i], ARGS(.target_velocity = VSMD_SPEED_MAX));
		refuse(moves[i], ARGS(.target_velocity = TOO_FAST));
		refuse(moves[i], ARGS(.target_velocity = -0.1f));
		refuse(moves[i], ARGS(.target_velocity = NAN));
		/* Any place. */
		allow(moves[i], ARGS(.target_position = INT32_MIN));
		allow(moves[i], ARGS(.target_position = INT32_MAX));
	}
}

static void outputs_are_those_that_the_drive_has(void **state)
{
	(void)state;
	for (unsigned port = 0; port < 8; port++)
		expect(DB_CMD_SET_OUTPUT, ARGS(.output_number = (uint16_t)port, .output_value = 1),
		       port >= 1 && port <= 6 ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE);
	allow(DB_CMD_SET_OUTPUT, ARGS(.output_number = 1, .output_value = 0));
	refuse(DB_CMD_SET_OUTPUT, ARGS(.output_number = 1, .output_value = 2));
	refuse(DB_CMD_SET_OUTPUTS, ARGS(.output_mask = 0, .output_levels = 1));
	allow(DB_CMD_SET_OUTPUTS, ARGS(.output_mask = 1));
	allow(DB_CMD_SET_OUTPUTS, ARGS(.output_mask = 0x3f));
	refuse(DB_CMD_SET_OUTPUTS, ARGS(.output_mask = 0x40));
	refuse(DB_CMD_SET_OUTPUTS, ARGS(.output_mask = 0x41));
}

static void ports_of_their_own_are_three_with_a_byte_each(void **state)
{
	static const enum db_command commands[] = { DB_CMD_SET_SV, DB_CMD_SET_NMOS };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		refuse(commands[i], ARGS(.output_number = 0));
		allow(commands[i], ARGS(.output_number = 1));
		allow(commands[i], ARGS(.output_number = 3, .output_value = 255));
		refuse(commands[i], ARGS(.output_number = 3, .output_value = 256));
		refuse(commands[i], ARGS(.output_number = 4));
	}
}

static void a_shake_has_a_frequency_and_an_end(void **state)
{
	static const enum db_command commands[] = { DB_CMD_SHAKE_START, DB_CMD_SHAKE_START_TIME };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		allow(commands[i], ARGS(.shake_frequency = VSMD_SHAKE_FREQ_MAX));
		refuse(commands[i], ARGS(.shake_frequency = VSMD_SHAKE_FREQ_MAX + 0.01f));
		allow(commands[i], ARGS(.shake_frequency = VSMD_SHAKE_FREQ_MIN));
		refuse(commands[i], ARGS(.shake_frequency = 0.0f));
		refuse(commands[i], ARGS(.shake_frequency = NAN));
		/* On CAN it may be slower. */
		assert_int_equal(on_can(commands[i], ARGS(.shake_frequency = 0.1f)), DB_RESULT_OK);
		assert_int_equal(on_serial(commands[i], ARGS(.shake_frequency = 0.1f)),
		                 DB_RESULT_OUT_OF_RANGE);
		/* Its cycles and its time are numbers with a sign on the wire. */
		allow(commands[i], ARGS(.shake_frequency = 1.0f, .shake_cycles = INT32_MAX,
		                        .shake_time = INT32_MAX));
		refuse(commands[i],
		       ARGS(.shake_frequency = 1.0f, .shake_cycles = (uint32_t)INT32_MAX + 1));
		refuse(commands[i],
		       ARGS(.shake_frequency = 1.0f, .shake_time = (uint32_t)INT32_MAX + 1));
	}
}

static void what_the_family_does_not_have_is_unsupported(void **state)
{
	const uint64_t known = db_driver_vsmd_serial.commands;

	(void)state;
	assert_true(known == db_driver_vsmd_can.commands);
	for (enum db_command command = DB_CMD_NONE; command <= DB_CMD_LIMIT; command++) {
		bool has = command < DB_CMD_LIMIT && (known & DB_COMMAND_BIT(command));

		assert_int_equal(on_serial(command, ARGS(0)) != DB_RESULT_UNSUPPORTED, has);
		assert_int_equal(on_can(command, ARGS(0)) != DB_RESULT_UNSUPPORTED, has);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(speeds_have_a_sign_where_they_say_the_direction),
		cmocka_unit_test(outputs_are_those_that_the_drive_has),
		cmocka_unit_test(ports_of_their_own_are_three_with_a_byte_each),
		cmocka_unit_test(a_shake_has_a_frequency_and_an_end),
		cmocka_unit_test(what_the_family_does_not_have_is_unsupported),
	};

	return cmocka_run_group_tests_name("vsmd: what can be told", tests, NULL, NULL);
}
