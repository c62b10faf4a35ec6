/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Registers 0 to 66 of VSMD drives on RS485 while their parameters are not known yet, or never: the real registers, engine
 * and driver beside simulated drives in made-up time. Once a drive was read, its block is.
 */
#include "drivebridge/transport.h"
#include "fakes/bus.h"
#include "fakes/registers.h"
#include "sim/serial_bus.h"
#include "transport/serial.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define BLOCK 67

struct plant {
	struct fake_bus *bus;
	struct sim_serial_bus *wire;
	struct sim_serial_config config;
	struct sim_vsmd_config drives[FAKE_DRIVES]; /* to be changed before open_plant() */
	struct sim_node nodes[FAKE_DRIVES];
	struct fake_registers registers;
	size_t shown[FAKE_PLANT_DRIVES]; /* the drives behind its units 1 to 3 */
};

static db_time put_on_wire(void *context, const uint8_t *bytes, size_t length)
{
	struct plant *plant = context;

	sim_serial_bus_receive(plant->wire, bytes, length, plant->bus->now);
	return plant->bus->now;
}

static const struct db_engine_ops ops = { .send = put_on_wire };

static db_time next_of_wire(void *context)
{
	return sim_serial_bus_next(((struct plant *)context)->wire);
}

static void take_off_wire(void *context)
{
	struct plant *plant = context;
	uint8_t bytes[512];
	size_t length;

	while ((length = sim_serial_bus_run(plant->wire, plant->bus->now, bytes, sizeof bytes)) > 0)
		fake_receive(plant->bus, bytes, length);
}

static struct plant *new_plant(size_t drives, unsigned baud)
{
	struct plant *plant = calloc(1, sizeof *plant);
	const struct db_driver *driver = db_driver_find("vsmd-serial");

	assert_non_null(plant);
	plant->bus = fake_bus_new(driver, drives);
	plant->bus->context = plant;
	plant->bus->next = next_of_wire;
	plant->bus->happen = take_off_wire;
	plant->bus->config.transport = &db_transport_serial;
	plant->bus->config.baud = baud;
	plant->bus->config.stop_bits = 1;
	plant->bus->config.drive_latency_ms = 30;
	plant->bus->config.turnaround_us = 1000;
	fake_preset_options(driver, &plant->bus->options);
	plant->config = (struct sim_serial_config){
		.baud = baud, .rs485 = true, .paced = true, .latency = 800 * DB_NS_PER_US
	};
	for (size_t i = 0; i < drives; i++)
		sim_vsmd_config_init(&plant->drives[i], (unsigned)i + 1, baud);
	return plant;
}

/* Unit 1 is the first drive, 2 the one in the middle and 3 the last. */
static void open_plant(struct plant *plant)
{
	size_t drives = plant->bus->drive_count;

	plant->wire = sim_serial_bus_new(&sim_vsmd_serial_protocol, &plant->config, NULL, NULL);
	assert_non_null(plant->wire);
	for (size_t i = 0; i < drives; i++) {
		plant->nodes[i].drive = sim_vsmd_new(&plant->drives[i], plant->bus->now);
		assert_non_null(plant->nodes[i].drive);
		assert_true(sim_serial_bus_attach(plant->wire, &plant->nodes[i]));
	}
	fake_bus_open(plant->bus, drives, &ops);
	fake_registers_init(&plant->registers, 1, FAKE_PLANT_DRIVES);
	for (size_t i = 0; i < FAKE_PLANT_DRIVES; i++) {
		plant->shown[i] = i * (drives - 1) / (FAKE_PLANT_DRIVES - 1);
		db_axis_free(plant->registers.axes[i]);
		plant->registers.axes[i] = plant->bus->list[plant->shown[i]].axis;
	}
	fake_registers_open(&plant->registers);
	fake_port(plant->bus, 0);
}

static void free_plant(struct plant *plant)
{
	/* The axes are the bus's. */
	for (size_t i = 0; i < FAKE_PLANT_DRIVES; i++)
		plant->registers.axes[i] = NULL;
	fake_registers_close(&plant->registers);
	free(plant->wire);
	for (size_t i = 0; i < plant->bus->drive_count; i++)
		free(plant->nodes[i].drive);
	fake_bus_free(plant->bus);
	free(plant);
}

static int read_block(struct plant *plant, size_t unit)
{
	uint16_t values[BLOCK];

	plant->registers.now = plant->bus->now;
	return fake_get(&plant->registers, (uint8_t)(unit + 1), DB_TABLE_HOLDING, 0, BLOCK, values);
}

static bool knows_params(const struct plant *plant, size_t unit)
{
	return fake_feedback(plant->bus, plant->shown[unit]).status & DB_STATUS_PARAMS_VALID;
}

/* Each block is there by `first_ms`, before the parameters are, and stays until `ms`. */
static void expect_blocks(struct plant *plant, unsigned first_ms, unsigned ms)
{
	bool there[FAKE_PLANT_DRIVES] = { false };

	for (unsigned at = 0; at < ms; at++) {
		fake_pass(plant->bus, MS);
		for (size_t unit = 0; unit < FAKE_PLANT_DRIVES; unit++) {
			bool reads = read_block(plant, unit) == 0;

			assert_true(reads || (!there[unit] && at < first_ms));
			assert_true(there[unit] || !reads || !knows_params(plant, unit));
			there[unit] = there[unit] || reads;
		}
	}
}

static void of_32_drives_in_the_first_moments(void **state)
{
	struct plant *plant = new_plant(32, 115200);

	(void)state;
	open_plant(plant);
	expect_blocks(plant, 1000, 5000);
	free_plant(plant);
}

/* One whose text takes a quarter of a second, one that keeps silent instead, and one that refuses. */
static void of_drives_whose_parameters_are_late_or_never_known(void **state)
{
	struct plant *plant = new_plant(3, 115200);

	(void)state;
	plant->drives[0].temper.text_length = 2500;
	plant->drives[1].temper.parameters = SIM_PARAMETERS_SILENT;
	plant->drives[2].temper.parameters = SIM_PARAMETERS_REFUSED;
	open_plant(plant);
	expect_blocks(plant, 200, 20000);
	assert_true(knows_params(plant, 0));
	assert_false(knows_params(plant, 1));
	assert_false(knows_params(plant, 2));
	free_plant(plant);
}

static enum db_result do_command(struct plant *plant, struct db_request request)
{
	enum db_result result = DB_RESULT_NONE;

	fake_request(plant->bus, 0, request);
	for (unsigned ms = 0; ms < 3000 && result == DB_RESULT_NONE; ms++) {
		fake_pass(plant->bus, MS);
		result = fake_result(plant->bus);
	}
	return result;
}

/* While it moves, nothing so long as the text of all parameters is read from anybody. */
static void of_drives_that_come_while_another_one_moves(void **state)
{
	static const unsigned bauds[] = { 9600, 115200 };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct plant *plant = new_plant(3, bauds[i]);

		open_plant(plant);
		sim_vsmd_power(plant->nodes[1].drive, false, plant->bus->now);
		sim_vsmd_power(plant->nodes[2].drive, false, plant->bus->now);
		fake_pass(plant->bus, 3000 * MS);
		assert_int_equal(do_command(plant, (struct db_request){ .command = DB_CMD_ENABLE }),
		                 DB_RESULT_OK);
		assert_int_equal(
			do_command(
				plant,
				(struct db_request){
					.command = DB_CMD_MOVE_VELOCITY,
					.args = &(struct db_args){ .target_velocity = 500.0f } }),
			DB_RESULT_OK);
		sim_vsmd_power(plant->nodes[1].drive, true, plant->bus->now);
		sim_vsmd_power(plant->nodes[2].drive, true, plant->bus->now);
		for (unsigned ms = 0; ms < 4000; ms++) {
			fake_pass(plant->bus, MS);
			assert_int_equal(read_block(plant, 0), 0);
			if (ms < 3000)
				continue;
			for (size_t unit = 1; unit < FAKE_PLANT_DRIVES; unit++) {
				assert_int_equal(read_block(plant, unit), 0);
				assert_false(knows_params(plant, unit));
			}
		}
		free_plant(plant);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(of_32_drives_in_the_first_moments),
		cmocka_unit_test(of_drives_whose_parameters_are_late_or_never_known),
		cmocka_unit_test(of_drives_that_come_while_another_one_moves),
	};

	return cmocka_run_group_tests_name("sched/process_data", tests, NULL, NULL);
}
