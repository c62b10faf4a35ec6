/* SPDX-License-Identifier: Apache-2.0 */
/* What all families have in common: found by name, what may be written, settings, and times on the wire. */
#include "driver/list.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

/* A family whose times can be counted on one's fingers: a byte takes a millisecond. */

static db_time byte_by_byte(const struct db_bus_config *bus, const uint8_t *request,
                            size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	return (db_time)(request_length + answer_length) * MS;
}

static const struct db_transport line = { .medium = DB_MEDIUM_SERIAL, .wire_time = byte_by_byte };

static db_time ten_ms(const struct db_bus_config *bus)
{
	(void)bus;
	return 10 * MS;
}

static db_time three_ms(const struct db_bus_config *bus)
{
	(void)bus;
	return 3 * MS;
}

static const struct db_param params[] = {
	{ .name = "signed", .type = DB_I32, .unit = "", .min = -5, .max = 7 },
	{ .name = "real", .type = DB_F32, .unit = "", .min = 0.5, .max = 2.5 },
};

static const struct db_driver plain = {
	.name = "plain",
	.params = params,
	.param_count = 2,
	.commands = DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_HOME),
	.poll_time = ten_ms,
};

static struct db_bus_config bus_of(const struct db_driver *driver)
{
	return (struct db_bus_config){ .driver = driver, .transport = &line };
}

static void families_are_found_by_their_whole_name(void **state)
{
	(void)state;
	for (size_t i = 0; db_drivers[i]; i++)
		assert_ptr_equal(db_driver_find(db_drivers[i]->name), db_drivers[i]);
	assert_null(db_driver_find(""));
	assert_null(db_driver_find("vsmd"));
	assert_null(db_driver_find("vsmd-serial "));
}

static void a_fault_is_found_by_its_own_value_only(void **state)
{
	static const struct db_drive_fault faults[] = { { .error = 40, .name = "hot" },
		                                        { .error = 42, .name = "cold" } };
	struct db_driver driver = plain;

	(void)state;
	assert_null(db_driver_fault(&driver, 0));
	driver.faults = faults;
	driver.fault_count = 2;
	assert_ptr_equal(db_driver_fault(&driver, 42), &faults[1]);
	assert_null(db_driver_fault(&driver, 41));
	assert_null(db_driver_fault(&driver, 43));
}

static uint64_t no_homing(const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)bus;
	(void)drive;
	return DB_COMMAND_BIT(DB_CMD_HOME) | DB_COMMAND_BIT(DB_CMD_ENABLE);
}

static void a_configuration_may_forbid_commands_of_the_family(void **state)
{
	const struct db_drive_config drive = { .address = 1 };
	struct db_driver driver = plain;
	struct db_bus_config bus = bus_of(&driver);

	(void)state;
	assert_true(db_driver_commands(&bus, &drive) == plain.commands);
	driver.forbidden = no_homing;
	assert_true(db_driver_commands(&bus, &drive) == DB_COMMAND_BIT(DB_CMD_STOP));
}

/* --- parameters ------------------------------------------------------------------------------- */

static void a_parameter_may_be_at_its_ends_and_no_further(void **state)
{
	const struct db_bus_config bus = bus_of(&plain);

	(void)state;
	assert_int_equal(db_driver_check_param(&bus, 0, (union db_value){ .i = -5 }), DB_RESULT_OK);
	assert_int_equal(db_driver_check_param(&bus, 0, (union db_value){ .i = 7 }), DB_RESULT_OK);
	assert_int_equal(db_driver_check_param(&bus, 0, (union db_value){ .i = -6 }),
	                 DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(db_driver_check_param(&bus, 0, (union db_value){ .i = 8 }),
	                 DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(db_driver_check_param(&bus, 1, (union db_value){ .f = 0.5f }),
	                 DB_RESULT_OK);
	assert_int_equal(db_driver_check_param(&bus, 1, (union db_value){ .f = 2.5f }),
	                 DB_RESULT_OK);
	assert_int_equal(db_driver_check_param(&bus, 1, (union db_value){ .f = NAN }),
	                 DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(db_driver_check_param(&bus, 1, (union db_value){ .f = INFINITY }),
	                 DB_RESULT_OUT_OF_RANGE);
	/* The first one that is not there. */
	assert_int_equal(db_driver_check_param(&bus, 2, (union db_value){ .u = 1 }),
	                 DB_RESULT_UNSUPPORTED);
}

static enum db_result only_42(const struct db_bus_config *bus, size_t param, union db_value value)
{
	(void)bus;
	return param == 1 && value.u == 42 ? DB_RESULT_OK : DB_RESULT_REFUSED;
}

static void a_family_may_judge_its_parameters_itself(void **state)
{
	struct db_driver driver = plain;
	const struct db_bus_config bus = bus_of(&driver);

	(void)state;
	driver.check_param = only_42;
	assert_int_equal(db_driver_check_param(&bus, 1, (union db_value){ .u = 42 }), DB_RESULT_OK);
	assert_int_equal(db_driver_check_param(&bus, 0, (union db_value){ .i = 0 }),
	                 DB_RESULT_REFUSED);
	assert_int_equal(db_driver_check_param(&bus, 2, (union db_value){ .u = 42 }),
	                 DB_RESULT_UNSUPPORTED);
}

/* --- settings --------------------------------------------------------------------------------- */

static void a_setting_is_read_as_it_was_set(void **state)
{
	struct {
		double before;
		double number;
		unsigned word;
		unsigned behind;
	} options = { 1.0, 2.0, 3, 4 };
	const struct db_option number = { .words = "", .offset = sizeof(double) };
	const struct db_option word = { .words = "off on auto", .offset = 2 * sizeof(double) };

	(void)state;
	assert_true(db_option_value(&number, &options) == 2.0);
	assert_true(db_option_value(&word, &options) == 3.0);
	db_option_set(&number, &options, -0.25);
	db_option_set(&word, &options, 2.0);
	assert_true(db_option_value(&number, &options) == -0.25);
	assert_true(db_option_value(&word, &options) == 2.0);
	/* The first word; and one that no list has. */
	db_option_set(&word, &options, 0.0);
	assert_int_equal(options.word, 0);
	db_option_set(&word, &options, -1.0);
	assert_int_equal(options.word, 0);
	db_option_set(&number, &options, NAN);
	assert_true(isnan(db_option_value(&number, &options)));
	/* What stands next to them is as it was. */
	assert_true(options.before == 1.0);
	assert_int_equal(options.behind, 4);
}

static double counts;

static double told_counts(const struct db_drive_config *drive)
{
	(void)drive;
	return counts;
}

static void a_velocity_whose_scale_is_not_known_is_in_the_drives_own_units(void **state)
{
	const struct db_drive_config drive = { .address = 1 };
	struct db_driver driver = plain;

	(void)state;
	assert_true(db_driver_velocity_counts(&driver, &drive) == 1.0);
	driver.velocity_counts = told_counts;
	counts = 0.25;
	assert_true(db_driver_velocity_counts(&driver, &drive) == 0.25);
	counts = 0.0;
	assert_true(db_driver_velocity_counts(&driver, &drive) == 1.0);
	counts = -2.0;
	assert_true(db_driver_velocity_counts(&driver, &drive) == 1.0);
}

/* --- times on the wire ------------------------------------------------------------------------ */

static void write_four(const struct db_bus_config *bus, uint32_t number,
                       struct db_exchange *exchange)
{
	(void)bus;
	(void)number;
	exchange->request_length = 4;
}

static void write_nine(const struct db_bus_config *bus, uint32_t number,
                       struct db_exchange *exchange)
{
	(void)bus;
	(void)number;
	exchange->request_length = 9;
}

static db_time once(const struct db_bus_config *bus)
{
	(void)bus;
	return DB_TIME_NEVER;
}

static db_time not_here(const struct db_bus_config *bus)
{
	(void)bus;
	return 0;
}

static db_time each_20_ms(const struct db_bus_config *bus)
{
	(void)bus;
	return 20 * MS;
}

static db_time each_5_ms(const struct db_bus_config *bus)
{
	(void)bus;
	return 5 * MS;
}

static bool is_near(double number, double expected)
{
	return fabs(number - expected) < 1e-9;
}

static void the_buss_own_messages_take_their_part_of_the_wire(void **state)
{
	struct db_bus_message messages[] = { { "start", once, write_nine },
		                             { "sync", each_20_ms, write_four },
		                             { "heartbeat", not_here, write_nine } };
	struct db_driver driver = plain;
	const struct db_bus_config bus = bus_of(&driver);

	(void)state;
	assert_true(db_driver_own_part(&bus) == 0.0);
	assert_true(db_driver_own_time(&bus) == 0);
	driver.messages = messages;
	driver.message_count = 3;
	/* One that is sent once takes no part of the time, but may be in the way once. */
	assert_true(is_near(db_driver_own_part(&bus), 0.2));
	assert_true(db_driver_own_time(&bus) == 9 * MS);
	/* One that is not on this bus takes nothing. */
	messages[0].period = not_here;
	assert_true(db_driver_own_time(&bus) == 4 * MS);
	/* Two of them. */
	messages[0].period = each_20_ms;
	assert_true(is_near(db_driver_own_part(&bus), 0.65));
	/* Some of the wire is always left for drives. */
	messages[0].period = each_5_ms;
	assert_true(is_near(db_driver_own_part(&bus), 0.9));
}

static void a_round_is_as_long_as_its_parts(void **state)
{
	struct db_bus_message sync = { "sync", each_20_ms, write_four };
	struct db_driver driver = plain;
	const struct db_bus_config bus = bus_of(&driver);

	(void)state;
	assert_true(db_driver_round_time(&bus, 3, 3) == 30 * MS);
	/* Without a time of its own a further axis comes with the first one. */
	assert_true(db_driver_round_time(&bus, 2, 5) == 20 * MS);
	driver.axis_time = three_ms;
	assert_true(db_driver_round_time(&bus, 2, 5) == 29 * MS);
	/* A fifth of the wire is not theirs. */
	driver.messages = &sync;
	driver.message_count = 1;
	assert_true(is_near((double)db_driver_round_time(&bus, 4, 4) / MS, 50.0));
}

static void what_is_brief_is_twice_one_exchange_of_a_poll(void **state)
{
	struct db_driver driver = plain;
	const struct db_bus_config bus = bus_of(&driver);

	(void)state;
	assert_true(db_driver_brief_time(&bus) == 20 * MS);
	driver.poll_exchanges = 1;
	assert_true(db_driver_brief_time(&bus) == 20 * MS);
	driver.poll_exchanges = 4;
	assert_true(db_driver_brief_time(&bus) == 5 * MS);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(families_are_found_by_their_whole_name),
		cmocka_unit_test(a_fault_is_found_by_its_own_value_only),
		cmocka_unit_test(a_configuration_may_forbid_commands_of_the_family),
		cmocka_unit_test(a_parameter_may_be_at_its_ends_and_no_further),
		cmocka_unit_test(a_family_may_judge_its_parameters_itself),
		cmocka_unit_test(a_setting_is_read_as_it_was_set),
		cmocka_unit_test(a_velocity_whose_scale_is_not_known_is_in_the_drives_own_units),
		cmocka_unit_test(the_buss_own_messages_take_their_part_of_the_wire),
		cmocka_unit_test(a_round_is_as_long_as_its_parts),
		cmocka_unit_test(what_is_brief_is_twice_one_exchange_of_a_poll),
	};

	return cmocka_run_group_tests_name("driver: what all families have in common", tests, NULL,
	                                   NULL);
}
