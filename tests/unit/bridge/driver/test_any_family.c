/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a family of drives may be, end to end from the wire to the registers: an invented one
 * (fakes/rtu.h) that is unlike those of the list.
 */
#include "driver/list.h"

#include "drivebridge/trouble.h"
#include "fakes/rtu.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define UNIT 1
#define ERROR 1 /* registers */
#define ACCELERATION 32
#define COMMAND 101
#define POSITION 12
#define IDENTIFIED (500 * MS)

#define OPEN(driver)                                      \
	struct rtu_drives drives = { .plant.bus = NULL }; \
                                                          \
	(void)state;                                      \
	rtu_open(&drives, driver, 2)

static uint16_t error_of(struct rtu_drives *drives)
{
	return fake_plant_get1(&drives->plant, UNIT, ERROR);
}

/* --- faults ----------------------------------------------------------------------------------- */

static void a_fault_code_is_shown_as_it_is(void **state)
{
	OPEN(&rtu_family);
	drives.drives[0].alarm = RTU_OVERHEAT;
	fake_plant_pass(&drives.plant, IDENTIFIED);
	assert_int_equal(error_of(&drives), RTU_OVERHEAT);
	assert_string_equal(db_error_name(&rtu_family, RTU_OVERHEAT), "heat_sink");
	assert_string_equal(db_trouble_fault_advice(&rtu_family, RTU_OVERHEAT), "clean the fan");
	assert_int_equal(fake_plant_write(&drives.plant, UNIT, COMMAND, 1,
	                                  (uint16_t[]){ DB_CMD_CLEAR_FAULT }),
	                 0);
	fake_plant_pass(&drives.plant, 50 * MS);
	assert_int_equal(error_of(&drives), DB_ERROR_NONE);
	rtu_close(&drives);
}

/* The same number is another fault in another family, and none where no family is meant. */
static void a_fault_code_belongs_to_its_family(void **state)
{
	char text[DB_ERROR_TEXT_MAX];

	(void)state;
	assert_string_equal(db_error_name(&rtu_family, RTU_LOW_ALARM), "regeneration");
	assert_string_equal(db_error_name(&db_driver_servo_can, RTU_LOW_ALARM), "phase_loss");
	assert_string_equal(db_error_name(&db_driver_xyza, RTU_LOW_ALARM), "unknown");
	assert_string_equal(db_error_name(NULL, RTU_LOW_ALARM), "unknown");
	assert_string_equal(db_trouble_fault_advice(&rtu_family, RTU_LOW_ALARM),
	                    "check the braking resistor");
	assert_string_equal(db_trouble_fault_advice(&db_driver_xyza, RTU_LOW_ALARM),
	                    "see the drive's manual");
	assert_string_equal(db_error_name(&rtu_family, RTU_UNNAMED), "unknown");
	assert_string_equal(db_error_text(&rtu_family, RTU_UNNAMED, text), "30583 (hex 7777)");
	assert_string_equal(db_error_text(&rtu_family, DB_ERROR_VOLTAGE, text), "voltage");
}

/* PLC programs rely on these. */
static void servo_can_keeps_its_numbers(void **state)
{
	(void)state;
	assert_int_equal(db_driver_servo_can.fault_count, 16);
	for (unsigned bit = 0; bit < 16; bit++)
		assert_int_equal(db_driver_servo_can.faults[bit].error, 32 + bit);
	assert_string_equal(db_error_name(&db_driver_servo_can, 32), "undervoltage");
	assert_string_equal(db_error_name(&db_driver_servo_can, 47), "locked");
}

/* --- parameters ------------------------------------------------------------------------------- */

static void put32(uint16_t words[2], int32_t value)
{
	words[0] = (uint16_t)((uint32_t)value >> 16);
	words[1] = (uint16_t)value;
}

static void hundreds_of_parameters_are_registers(void **state)
{
	uint16_t words[2];

	OPEN(&rtu_family);
	for (int32_t i = 0; i < RTU_PARAMS; i++)
		drives.drives[0].params[i] = 7 * i - 20;
	assert_int_not_equal(fake_plant_get(&drives.plant, UNIT, RTU_FIRST_PARAM, 2, words), 0);
	fake_plant_pass(&drives.plant, IDENTIFIED);
	for (unsigned i = 0; i < RTU_PARAMS; i++)
		assert_int_equal((int32_t)fake_plant_get2(&drives.plant, UNIT,
		                                          (uint16_t)(RTU_FIRST_PARAM + 2 * i)),
		                 7 * (int)i - 20);
	/* One with a neutral name, and nothing after the last one. */
	assert_int_equal(fake_plant_get2(&drives.plant, UNIT, ACCELERATION), 7 * 250 - 20);
	assert_int_not_equal(
		fake_plant_get(&drives.plant, UNIT, RTU_FIRST_PARAM + 2 * RTU_PARAMS, 2, words), 0);
	rtu_close(&drives);
}

static void a_parameter_above_64_is_written(void **state)
{
	const uint16_t at = RTU_FIRST_PARAM + 2 * 299;
	uint16_t words[2];

	OPEN(&rtu_family);
	fake_plant_pass(&drives.plant, IDENTIFIED);
	put32(words, 4711);
	assert_int_equal(fake_plant_write(&drives.plant, UNIT, at, 2, words), 0);
	assert_int_equal(drives.drives[0].params[299], 4711);
	assert_int_equal(fake_plant_get2(&drives.plant, UNIT, at), 4711);
	assert_int_equal(drives.drives[1].writes, 0);
	/* The family has no check of its own: the table's range holds. */
	put32(words, 100001);
	assert_int_equal(fake_plant_write(&drives.plant, UNIT, at, 2, words), 3);
	assert_int_equal(drives.drives[0].writes, 1);
	rtu_close(&drives);
}

static void parameters_that_a_model_lacks(void **state)
{
	uint16_t words[4];

	OPEN(&rtu_family);
	drives.drives[0].lacks_last = true;
	drives.drives[0].params[239] = 5;
	fake_plant_pass(&drives.plant, IDENTIFIED);
	assert_int_equal(fake_plant_get2(&drives.plant, UNIT, RTU_FIRST_PARAM + 2 * 239), 5);
	assert_int_equal(fake_plant_get(&drives.plant, UNIT, RTU_FIRST_PARAM + 2 * 240, 2, words),
	                 2);
	assert_int_equal(fake_plant_get(&drives.plant, UNIT, RTU_FIRST_PARAM + 2 * 239, 4, words),
	                 0);
	assert_int_equal(words[3], 0);
	assert_int_equal(fake_plant_get2(&drives.plant, 2, RTU_FIRST_PARAM + 2 * 240), 0);
	rtu_close(&drives);
}

/* --- frames ----------------------------------------------------------------------------------- */

static void a_frame_ends_as_the_question_says(void **state)
{
	OPEN(&rtu_family);
	drives.drives[0].position = 99;
	fake_plant_pass(&drives.plant, IDENTIFIED);
	assert_int_equal(fake_plant_get2(&drives.plant, UNIT, POSITION), 99);
	assert_int_equal(fake_snapshot(drives.plant.bus, 0).stats.timeouts, 0);
	assert_in_range(fake_snapshot(drives.plant.bus, 0).stats.round_trip_max_us, 1000, 1001);
	rtu_close(&drives);
}

/* Nothing tells how long it is: it is taken when the line has been silent. */
static void a_frame_ends_by_silence(void **state)
{
	OPEN(&rtu_family);
	drives.drives[0].long_answers = true;
	drives.drives[0].position = 99;
	fake_plant_pass(&drives.plant, IDENTIFIED);
	assert_int_equal(fake_plant_get2(&drives.plant, UNIT, POSITION), 99);
	assert_int_equal(fake_snapshot(drives.plant.bus, 0).stats.timeouts, 0);
	assert_in_range(fake_snapshot(drives.plant.bus, 0).stats.round_trip_max_us, 3000, 3001);
	rtu_close(&drives);
}

/* Garbage does not stay in front of the next answer. */
static void garbage_ends_by_silence_too(void **state)
{
	OPEN(&rtu_family);
	fake_plant_pass(&drives.plant, IDENTIFIED);
	drives.drives[0].gone = drives.drives[1].gone = true;
	fake_plant_pass(&drives.plant, 5 * MS);
	fake_receive(drives.plant.bus, "\x01\x03\x55", 3);
	drives.drives[0].gone = drives.drives[1].gone = false;
	fake_plant_pass(&drives.plant, 200 * MS);
	assert_true(fake_is_online(drives.plant.bus, 0));
	assert_in_range(fake_snapshot(drives.plant.bus, 0).stats.timeouts, 0, 1);
	rtu_close(&drives);
}

/* --- what the bus itself sends ---------------------------------------------------------------- */

enum { HEARTBEAT, START };

static db_time each_50_ms(const struct db_bus_config *bus)
{
	(void)bus;
	return 50 * MS;
}

static db_time once(const struct db_bus_config *bus)
{
	(void)bus;
	return DB_TIME_NEVER;
}

static void write_heartbeat(const struct db_bus_config *bus, uint32_t number,
                            struct db_exchange *exchange)
{
	(void)bus;
	rtu_write_broadcast(exchange, HEARTBEAT, number);
}

static void write_start(const struct db_bus_config *bus, uint32_t number,
                        struct db_exchange *exchange)
{
	(void)bus;
	rtu_write_broadcast(exchange, START, number);
}

static const struct db_bus_message messages[] = {
	{ "start", once, write_start },
	{ "heartbeat", each_50_ms, write_heartbeat },
};

static struct db_driver with_messages(void)
{
	struct db_driver family = rtu_family;

	family.messages = messages;
	family.message_count = 2;
	return family;
}

static void a_bus_sends_what_it_must(void **state)
{
	const struct db_driver family = with_messages();

	OPEN(&family);
	fake_plant_pass(&drives.plant, 1001 * MS);
	assert_int_equal(drives.broadcasts[START], 1);
	assert_in_range(drives.broadcasts[HEARTBEAT], 20, 21);
	assert_int_equal(drives.last_number, drives.broadcasts[HEARTBEAT] - 1);
	assert_true(fake_is_online(drives.plant.bus, 0));
	assert_int_equal(fake_snapshot(drives.plant.bus, 0).stats.timeouts, 0);
	/* Whatever the drives do, and from the beginning when the port is back. */
	drives.drives[0].gone = drives.drives[1].gone = true;
	fake_plant_pass(&drives.plant, 1000 * MS);
	assert_in_range(drives.broadcasts[HEARTBEAT], 40, 41);
	fake_port(drives.plant.bus, 5);
	fake_plant_pass(&drives.plant, 1000 * MS);
	assert_in_range(drives.broadcasts[HEARTBEAT], 40, 41);
	fake_port(drives.plant.bus, 0);
	fake_plant_pass(&drives.plant, 10 * MS);
	assert_int_equal(drives.broadcasts[START], 2);
	assert_int_equal(drives.last_number, 0);
	rtu_close(&drives);
}

static void what_a_bus_sends_counts(void **state)
{
	const struct db_driver family = with_messages();
	const double part = (double)FAKE_WIRE_TIME / (double)(50 * MS);
	db_time round;

	OPEN(&family);
	assert_true(db_driver_own_part(&drives.plant.bus->config) == part);
	assert_int_equal(db_driver_own_time(&drives.plant.bus->config), FAKE_WIRE_TIME);
	round = db_driver_round_time(&drives.plant.bus->config, 2, 2);
	drives.plant.bus->config.driver = &rtu_family;
	assert_int_equal(round,
	                 (db_time)((double)db_driver_round_time(&drives.plant.bus->config, 2, 2) /
	                           (1.0 - part)));
	assert_true(db_driver_own_part(&drives.plant.bus->config) == 0.0);
	rtu_close(&drives);
}

/* --- conversations ---------------------------------------------------------------------------- */

static enum db_step stops_without_a_word(struct db_conversation *talk)
{
	if (talk->job->kind != DB_JOB_COMMAND || !db_command_is_stop(talk->job->request->command))
		return rtu_family.begin(talk);
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

/* A driver that knows that its drive stands ends a stop in begin(). */
static void a_stop_may_need_no_request(void **state)
{
	struct db_driver family = rtu_family;

	family.begin = stops_without_a_word;
	OPEN(&family);
	fake_plant_pass(&drives.plant, IDENTIFIED);
	assert_int_equal(
		fake_plant_write(&drives.plant, UNIT, COMMAND, 1, (uint16_t[]){ DB_CMD_STOP }), 0);
	assert_int_equal(drives.drives[0].command, DB_CMD_NONE);
	/* fake_pass() would have seen an engine that never rests. */
	fake_plant_pass(&drives.plant, 100 * MS);
	rtu_close(&drives);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_fault_code_is_shown_as_it_is),
		cmocka_unit_test(a_fault_code_belongs_to_its_family),
		cmocka_unit_test(servo_can_keeps_its_numbers),
		cmocka_unit_test(hundreds_of_parameters_are_registers),
		cmocka_unit_test(a_parameter_above_64_is_written),
		cmocka_unit_test(parameters_that_a_model_lacks),
		cmocka_unit_test(a_frame_ends_as_the_question_says),
		cmocka_unit_test(a_frame_ends_by_silence),
		cmocka_unit_test(garbage_ends_by_silence_too),
		cmocka_unit_test(a_bus_sends_what_it_must),
		cmocka_unit_test(what_a_bus_sends_counts),
		cmocka_unit_test(a_stop_may_need_no_request),
	};

	return cmocka_run_group_tests_name("driver: what a family may be", tests, NULL, NULL);
}
