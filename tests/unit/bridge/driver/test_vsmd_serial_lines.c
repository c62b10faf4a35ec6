/* SPDX-License-Identifier: Apache-2.0 */
/* VSMD on serial lines: what is sent to all drives at once, what a drive may mishear, and lines in words. */
#include "codec/vsmd_describe.h"
#include "codec/vsmd_serial_frames.h"
#include "driver/list.h"
#include "driver/vsmd/vsmd_private.h"
#include "fakes/options.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const struct db_bus_config rs485 = { .driver = &db_driver_vsmd_serial,
	                                    .line = DB_LINE_RS485 };
static const struct db_bus_config rs232 = { .driver = &db_driver_vsmd_serial,
	                                    .line = DB_LINE_RS232 };

/* --- a broadcast -------------------------------------------------------------------------------- */

/* Stops, and the power; nothing that begins a motion. No drive answers. */
static void all_are_stopped_or_given_power_at_once(void **state)
{
	static const struct {
		enum db_command command;
		const char *line;
	} cases[] = {
		{ DB_CMD_STOP, "0 stp\n" },
		{ DB_CMD_QUICK_STOP, "0 stp 1\n" },
		{ DB_CMD_DISABLE, "0 off\n" },
		{ DB_CMD_ENABLE, "0 ena\n" },
	};
	uint8_t bytes[DB_SHORT_REQUEST];

	(void)state;
	for (enum db_command command = DB_CMD_NONE; command < DB_CMD_LIMIT; command++) {
		struct db_exchange exchange = { .request = bytes, .request_size = sizeof(bytes) };
		const char *line = NULL;

		for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
			if (cases[i].command == command)
				line = cases[i].line;
		}
		/* One drive has no address, and on its line there are no others. */
		assert_false(db_driver_vsmd_serial.broadcast(command, &rs232, &exchange));
		exchange.answer_length = 21;
		assert_int_equal(db_driver_vsmd_serial.broadcast(command, &rs485, &exchange),
		                 line != NULL);
		if (!line)
			continue;
		assert_int_equal(exchange.request_length, strlen(line));
		assert_memory_equal(bytes, line, strlen(line));
		assert_int_equal(exchange.answer_length, 0);
		assert_false(exchange.repeatable);
		/* No half of a line. */
		exchange.request_size = strlen(line) - 1;
		assert_false(db_driver_vsmd_serial.broadcast(command, &rs485, &exchange));
	}
}

/* --- a common start ----------------------------------------------------------------------------- */

struct start {
	struct fake_options options;
	struct db_device *device;
	uint8_t bytes[64];
	struct db_exchange all;
};

static void make(struct start *start, const struct db_bus_config *line, unsigned address)
{
	struct db_bus_config bus = *line;
	struct db_drive_config drive = { .address = address, .counts_per_unit = 1.0 };

	fake_preset_options(&db_driver_vsmd_serial, &start->options);
	bus.options = start->options.bus;
	drive.options = start->options.drive;
	start->device = calloc(1, db_driver_vsmd_serial.device_size);
	assert_non_null(start->device);
	db_driver_vsmd_serial.init(start->device, NULL, &bus, &drive);
	memset(start->bytes, 'x', sizeof(start->bytes));
	start->all = (struct db_exchange){ .request = start->bytes,
		                           .request_size = sizeof(start->bytes),
		                           .answer_length = 21 };
}

static bool begin_all(struct start *start, const char *line, size_t length)
{
	uint8_t bytes[DB_SHORT_REQUEST] = { 0 };
	const struct db_exchange prepared = { .request = bytes, .request_length = length };

	memcpy(bytes, line, strlen(line));
	return db_driver_vsmd_serial.begin_all(start->device, &prepared, &start->all);
}

/* The same words to address 0, and nothing behind them. */
static void what_one_drive_is_told_is_told_to_all(void **state)
{
	static const char *const cases[][2] = {
		{ "1 mov spd=100\n", "0 mov spd=100\n" },
		{ "32 pos 1000 spd=100\n", "0 pos 1000 spd=100\n" },
		{ "\n12 zero start\n", "0 zero start\n" },
		{ "\n\n7 mov\n", "0 mov\n" },
	};
	struct start start;

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		size_t length = strlen(cases[i][1]);

		make(&start, &rs485, 1);
		assert_true(begin_all(&start, cases[i][0], strlen(cases[i][0])));
		assert_int_equal(start.all.request_length, length);
		assert_memory_equal(start.bytes, cases[i][1], length);
		assert_int_equal(start.bytes[length], 'x');
		assert_int_equal(start.all.answer_length, 0);
		/* All of it, or nothing. */
		start.all.request_size = length;
		assert_true(begin_all(&start, cases[i][0], strlen(cases[i][0])));
		start.all.request_size = length - 1;
		assert_false(begin_all(&start, cases[i][0], strlen(cases[i][0])));
		free(start.device);
	}
}

static void a_line_without_an_address_is_not_told_to_all(void **state)
{
	struct start start;

	(void)state;
	make(&start, &rs232, 1);
	assert_false(begin_all(&start, "mov spd=100\n", strlen("mov spd=100\n")));
	free(start.device);
	make(&start, &rs485, 1);
	assert_false(begin_all(&start, "mov\n", strlen("mov\n")));
	/* What is behind its end is not of it. */
	assert_false(begin_all(&start, "\n\n mov\n", 1));
	assert_int_equal(start.bytes[0], 'x');
	free(start.device);
}

/* --- half of a line ----------------------------------------------------------------------------- */

static bool mishears(unsigned address, const char *line)
{
	return db_driver_vsmd_serial.mishears(address, (const uint8_t *)line, strlen(line));
}

/* A drive that misses the first character may be called by the rest of the address, as may all. */
static void the_rest_of_an_address_is_an_address(void **state)
{
	(void)state;
	assert_true(mishears(2, "12 stp\n"));
	assert_true(mishears(9, "19 stp\n"));
	assert_true(mishears(7, "10 stp\n"));
	assert_true(mishears(7, "30 stp\n"));
	assert_true(mishears(12, "\n12 stp\n"));
	assert_false(mishears(12, "12 stp\n"));
	assert_false(mishears(1, "12 stp\n"));
	assert_false(mishears(3, "12 stp\n"));
	assert_false(mishears(7, "1 stp\n"));
	assert_false(mishears(7, "12 stp\n"));
}

/* A number alone is an address that answers, wherever it stands; to all it says nothing. */
static void a_number_in_a_line_is_an_address(void **state)
{
	(void)state;
	assert_true(mishears(5, "1 pos 5\n"));
	assert_true(mishears(5, "1 pos 125\n"));
	assert_true(mishears(32, "1 pos 32\n"));
	assert_true(mishears(25, "1 pos 25 spd=100\n"));
	assert_true(mishears(4, "1 cfg mcs=4\n"));
	assert_true(mishears(4, "1 cfg mcs=4 crn=0.5\n"));
	assert_false(mishears(32, "1 pos 320\n"));
	assert_false(mishears(3, "1 pos 32\n"));
	assert_false(mishears(5, "1 mov spd=5.7\n"));
	assert_false(mishears(7, "1 pos 0\n"));
	assert_false(mishears(7, "1 pos 100 spd=20\n"));
	assert_false(mishears(7, "1 0\n"));
}

/* Not of the bytes behind the line. */
static void a_line_ends_where_it_ends(void **state)
{
	static const uint8_t line[] = "1 pos 12 5 \n";

	(void)state;
	assert_true(db_driver_vsmd_serial.mishears(12, line, strlen("1 pos 12 ")));
	assert_false(db_driver_vsmd_serial.mishears(12, line, strlen("1 pos 1")));
	assert_false(db_driver_vsmd_serial.mishears(1, line, strlen("1 pos 1")));
	assert_false(db_driver_vsmd_serial.mishears(12, line, strlen("1 pos 12")));
	assert_false(db_driver_vsmd_serial.mishears(5, line, strlen("1 pos 12 ")));
}

/* --- in words ----------------------------------------------------------------------------------- */

/* A line by what was sent, with an address on RS485 only; a frame by what came. */
static void lines_and_frames_are_described_as_what_they_are(void **state)
{
	const struct vsmd_status status = { .position = 1000, .status = VSMD_ST_STP };
	const uint8_t *addressed = (const uint8_t *)"7 ena\n";
	const uint8_t *plain = (const uint8_t *)"ena\n";
	struct db_description description;
	uint8_t frame[VSMD_SERIAL_STATUS_FRAME];
	int length = vsmd_serial_encode_status(7, &status, frame, sizeof(frame));

	(void)state;
	assert_true(length > 0);
	db_driver_vsmd_serial.describe(&rs485, true, addressed, 6, &description);
	assert_string_equal(description.text, "enable");
	assert_int_equal(description.address, 7);
	db_driver_vsmd_serial.describe(&rs232, true, addressed, 6, &description);
	assert_string_equal(description.text, "");
	db_driver_vsmd_serial.describe(&rs232, true, plain, 4, &description);
	assert_string_equal(description.text, "enable");
	db_driver_vsmd_serial.describe(&rs485, true, plain, 4, &description);
	assert_string_equal(description.text, "");
	db_driver_vsmd_serial.describe(&rs485, false, frame, (size_t)length, &description);
	assert_non_null(strstr(description.text, "position 1000 pulses"));
	assert_int_equal(description.address, 7);
	db_driver_vsmd_serial.describe(&rs485, true, frame, (size_t)length, &description);
	assert_string_equal(description.text, "");
	db_driver_vsmd_serial.describe(&rs485, false, addressed, 6, &description);
	assert_string_equal(description.text, "");
}

/* --- parameters --------------------------------------------------------------------------------- */

/* Those that serial lines have, in their ranges. */
static void a_parameter_is_one_that_serial_lines_have(void **state)
{
	const union db_value four = { .u = 4 };
	const union db_value none = { .u = 0 };

	(void)state;
	assert_int_equal(db_driver_vsmd_serial.check_param(&rs485, VSMD_CID, four), DB_RESULT_OK);
	assert_int_equal(db_driver_vsmd_serial.check_param(&rs485, VSMD_CID, none),
	                 DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(
		db_driver_vsmd_serial.check_param(&rs485, VSMD_SERIAL_PARAM_COUNT - 1, none),
		DB_RESULT_OK);
	assert_int_equal(db_driver_vsmd_serial.check_param(&rs485, VSMD_CAF, none),
	                 DB_RESULT_UNSUPPORTED);
	assert_int_equal(db_driver_vsmd_serial.check_param(&rs485, VSMD_PARAM_COUNT, none),
	                 DB_RESULT_UNSUPPORTED);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(all_are_stopped_or_given_power_at_once),
		cmocka_unit_test(what_one_drive_is_told_is_told_to_all),
		cmocka_unit_test(a_line_without_an_address_is_not_told_to_all),
		cmocka_unit_test(the_rest_of_an_address_is_an_address),
		cmocka_unit_test(a_number_in_a_line_is_an_address),
		cmocka_unit_test(a_line_ends_where_it_ends),
		cmocka_unit_test(lines_and_frames_are_described_as_what_they_are),
		cmocka_unit_test(a_parameter_is_one_that_serial_lines_have),
	};

	return cmocka_run_group_tests_name("vsmd_serial_lines", tests, NULL, NULL);
}
