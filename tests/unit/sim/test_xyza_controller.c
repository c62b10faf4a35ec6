/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/xyza_controller.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#define NUMBER 3
#define SECOND DB_NS_PER_S
#define MIN_SPEED 200
#define MAX_SPEED 6400
#define MANUAL_SPEED 3200
#define RAMP_TIME 0.2 /* s, from the lowest speed to the highest */
#define STEPS 6
#define STEP (SECOND / 2)

struct bench {
	struct sim_xyza_config config;
	struct sim_xyza *controller;
	db_time now;
	struct xyza_reply reply;
};

static void make(struct bench *bench)
{
	free(bench->controller);
	bench->controller = sim_xyza_new(&bench->config, bench->now);
	assert_non_null(bench->controller);
}

static int setup(void **state)
{
	static struct bench bench;

	bench = (struct bench){ .now = 50 * SECOND };
	sim_xyza_config_init(&bench.config, NUMBER);
	bench.config.steps = STEPS;
	bench.config.step_time = STEP;
	make(&bench);
	*state = &bench;
	return 0;
}

static int teardown(void **state)
{
	struct bench *bench = *state;

	free(bench->controller);
	bench->controller = NULL;
	return 0;
}

static void pass(struct bench *b, db_time time)
{
	b->now += time;
	sim_xyza_advance(b->controller, b->now);
}

/* Sends through the codec, so that order and object are as on a wire. */
static bool ask(struct bench *b, struct xyza_request request)
{
	uint8_t frame[XYZA_FRAME_MAX];
	struct xyza_request decoded;
	int length;

	request.object = NUMBER;
	length = xyza_encode_request(&request, frame, sizeof(frame));
	assert_true(length > 0);
	assert_int_equal(xyza_decode_request(frame, (size_t)length, &decoded), XYZA_OK);
	if (!sim_xyza_execute(b->controller, &decoded, XYZA_OK, b->now, &b->reply))
		return false;
	assert_true(xyza_fits(&request, &b->reply));
	return true;
}

static void assert_done(struct bench *b, struct xyza_request request)
{
	assert_true(ask(b, request));
	if (b->reply.kind != XYZA_REPLY_DONE)
		fail_msg("verb %d was not done", (int)request.verb);
}

static void assert_failed(struct bench *b, struct xyza_request request)
{
	assert_true(ask(b, request));
	if (b->reply.kind != XYZA_REPLY_FAILED)
		fail_msg("verb %d did not fail", (int)request.verb);
}

static uint32_t value_of(struct bench *b, struct xyza_request request)
{
	assert_true(ask(b, request));
	assert_int_equal(b->reply.kind, XYZA_REPLY_DATA);
	return b->reply.value;
}

static uint32_t axis_value(struct bench *b, enum xyza_verb verb, enum xyza_axis axis)
{
	return value_of(b, (struct xyza_request){ .verb = verb, .axis = axis });
}

static void write_item(struct bench *b, enum xyza_item item, enum xyza_axis axis, uint32_t value)
{
	assert_done(b,
	            (struct xyza_request){
			    .verb = XYZA_WRITE_ITEM, .item = item, .axis = axis, .value = value });
}

static void jog(struct bench *b, enum xyza_axis axis, bool negative)
{
	assert_done(b, (struct xyza_request){
			       .verb = XYZA_MANUAL_JOG, .axis = axis, .negative = negative });
}

static void start_program(struct bench *b, uint8_t number)
{
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_START, .number = number });
}

static void assert_program(struct bench *b, enum xyza_program_state state, unsigned program,
                           unsigned step)
{
	assert_true(ask(b, (struct xyza_request){ .verb = XYZA_PROGRAM_STATE }));
	assert_int_equal(b->reply.kind, XYZA_REPLY_PROGRAM_STATE);
	assert_int_equal(b->reply.state, state);
	assert_int_equal(b->reply.program, program);
	assert_int_equal(b->reply.step, step);
}

/* --- motion --------------------------------------------------------------------------------------- */

static void a_jog_runs_at_the_manual_speed(void **state)
{
	struct bench *b = *state;

	jog(b, XYZA_X, false);
	/* From the lowest speed at once, then along the ramp. */
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).speed == MIN_SPEED);
	pass(b, SECOND / 20);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).speed > MIN_SPEED);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).speed < MANUAL_SPEED);
	assert_int_equal(axis_value(b, XYZA_READ_STANDING, XYZA_X), 0);
	pass(b, SECOND);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).speed == MANUAL_SPEED);
	/* Without a brake it stands at once, on a whole pulse. */
	assert_done(b, (struct xyza_request){ .verb = XYZA_MANUAL_STOP });
	assert_int_equal(axis_value(b, XYZA_READ_STANDING, XYZA_X), 1);
	assert_int_equal(axis_value(b, XYZA_READ_SIGN, XYZA_X), 0);
	assert_in_range(axis_value(b, XYZA_READ_MAGNITUDE, XYZA_X), MANUAL_SPEED * 9 / 10,
	                MANUAL_SPEED * 21 / 20);
}

static void a_brake_takes_its_time(void **state)
{
	struct bench *b = *state;
	const double ramp = (MAX_SPEED - MIN_SPEED) / RAMP_TIME;
	db_time needed = (db_time)((MANUAL_SPEED - MIN_SPEED) / ramp * (double)SECOND);

	write_item(b, XYZA_ITEM_BRAKE, XYZA_X, 1u << XYZA_Y);
	jog(b, XYZA_Y, false);
	pass(b, SECOND);
	assert_done(b, (struct xyza_request){ .verb = XYZA_MANUAL_STOP });
	pass(b, needed - SECOND / 1000);
	assert_false(sim_xyza_axis_state(b->controller, XYZA_Y).standing);
	/* Below its lowest speed it does not go on. */
	pass(b, SECOND / 500);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_Y).standing);
	/* An emergency stop does not brake. */
	jog(b, XYZA_Y, true);
	pass(b, SECOND);
	assert_done(b, (struct xyza_request){ .verb = XYZA_MANUAL_QUICK_STOP });
	assert_true(sim_xyza_axis_state(b->controller, XYZA_Y).standing);
}

static void one_axis_moves_at_a_time(void **state)
{
	struct bench *b = *state;

	jog(b, XYZA_X, true);
	assert_failed(b, (struct xyza_request){ .verb = XYZA_MANUAL_JOG, .axis = XYZA_Y });
	/* The same axis may turn round. */
	jog(b, XYZA_X, false);
	assert_done(b, (struct xyza_request){ .verb = XYZA_MANUAL_STOP });
	jog(b, XYZA_Y, false);
	assert_int_equal(b->controller->failures, 1);
	assert_int_equal(b->controller->counts[XYZA_MANUAL_JOG], 3);
}

static void a_new_manual_speed_holds_from_the_next_jog(void **state)
{
	struct bench *b = *state;

	jog(b, XYZA_A, false);
	pass(b, SECOND);
	write_item(b, XYZA_ITEM_MANUAL_SPEED, XYZA_A, 1000);
	pass(b, SECOND);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_A).speed == MANUAL_SPEED);
	jog(b, XYZA_A, false);
	pass(b, SECOND);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_A).speed == 1000);
	/* Others have their own. */
	assert_int_equal(
		sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_MANUAL_SPEED, XYZA_X),
		MANUAL_SPEED);
}

static void positions_are_magnitude_and_sign(void **state)
{
	struct bench *b = *state;

	assert_done(b, (struct xyza_request){
			       .verb = XYZA_WRITE_MAGNITUDE, .axis = XYZA_Z, .value = 268 });
	assert_done(b, (struct xyza_request){
			       .verb = XYZA_WRITE_SIGN, .axis = XYZA_Z, .negative = true });
	assert_true(sim_xyza_axis_state(b->controller, XYZA_Z).position == -268);
	assert_int_equal(axis_value(b, XYZA_READ_MAGNITUDE, XYZA_Z), 268);
	assert_int_equal(axis_value(b, XYZA_READ_SIGN, XYZA_Z), 1);
	assert_done(b, (struct xyza_request){ .verb = XYZA_MANUAL_CLEAR, .axis = XYZA_Z });
	assert_int_equal(axis_value(b, XYZA_READ_MAGNITUDE, XYZA_Z), 0);
	assert_int_equal(axis_value(b, XYZA_READ_SIGN, XYZA_Z), 0);
	/* In the other order it comes to the same. */
	assert_done(b, (struct xyza_request){
			       .verb = XYZA_WRITE_SIGN, .axis = XYZA_Z, .negative = true });
	assert_done(b, (struct xyza_request){
			       .verb = XYZA_WRITE_MAGNITUDE, .axis = XYZA_Z, .value = 5 });
	assert_true(sim_xyza_axis_state(b->controller, XYZA_Z).position == -5);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_CLEAR, .axis = XYZA_Z });
	assert_true(sim_xyza_axis_state(b->controller, XYZA_Z).position == 0);
}

/* What a driver has to be safe against: both answers are true, each in its moment, and together they
 * are a place the axis never was at. */
static void magnitude_and_sign_can_be_of_two_moments(void **state)
{
	struct bench *b = *state;
	uint32_t magnitude;
	uint32_t sign;

	sim_xyza_place(b->controller, XYZA_X, -20, b->now);
	jog(b, XYZA_X, false);
	pass(b, SECOND / 1000);
	magnitude = axis_value(b, XYZA_READ_MAGNITUDE, XYZA_X);
	assert_int_equal(axis_value(b, XYZA_READ_SIGN, XYZA_X), 1);
	pass(b, SECOND / 10);
	sign = axis_value(b, XYZA_READ_SIGN, XYZA_X);
	assert_in_range(magnitude, 1, 20);
	assert_int_equal(sign, 0);
}

/* --- ports ---------------------------------------------------------------------------------------- */

static void outputs_are_switched_singly_or_all(void **state)
{
	struct bench *b = *state;
	const struct xyza_request ports = { .verb = XYZA_READ_PORTS };

	assert_done(b, (struct xyza_request){ .verb = XYZA_WRITE_OUTPUT, .number = 2, .on = true });
	assert_done(b, (struct xyza_request){ .verb = XYZA_WRITE_OUTPUT, .number = 8, .on = true });
	sim_xyza_set_input(b->controller, 1, true, b->now);
	sim_xyza_set_input(b->controller, 16, true, b->now);
	assert_int_equal(xyza_outputs(value_of(b, ports)), 0x0082);
	assert_int_equal(xyza_inputs(value_of(b, ports)), 0x8001);
	assert_done(b, (struct xyza_request){ .verb = XYZA_WRITE_OUTPUT, .number = 2 });
	assert_int_equal(b->controller->outputs, 0x0080);
	assert_done(b, (struct xyza_request){ .verb = XYZA_WRITE_OUTPUTS, .on = true });
	assert_int_equal(b->controller->outputs, 0x00ff);
	assert_done(b, (struct xyza_request){ .verb = XYZA_WRITE_OUTPUTS });
	assert_int_equal(b->controller->outputs, 0);
}

/* --- programs ------------------------------------------------------------------------------------- */

static void a_program_runs_step_by_step_to_its_end(void **state)
{
	struct bench *b = *state;

	assert_program(b, XYZA_PROGRAM_IDLE, 0, 0);
	start_program(b, 2);
	assert_program(b, XYZA_PROGRAM_RUNNING, 2, 1);
	assert_int_equal(axis_value(b, XYZA_READ_STANDING, XYZA_X), 0);
	pass(b, 2 * STEP + 1);
	assert_program(b, XYZA_PROGRAM_RUNNING, 2, 3);
	pass(b, (STEPS - 2) * STEP);
	assert_program(b, XYZA_PROGRAM_IDLE, 2, 0);
	assert_false(sim_xyza_busy(b->controller));
}

static void a_delayed_start_waits(void **state)
{
	struct bench *b = *state;

	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_DELAY, .number = 2 });
	start_program(b, 1);
	pass(b, 2 * SECOND - 1);
	assert_program(b, XYZA_PROGRAM_IDLE, 1, 0);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).standing);
	pass(b, 1);
	assert_program(b, XYZA_PROGRAM_RUNNING, 1, 1);
}

static void a_stop_calls_a_delayed_start_off(void **state)
{
	struct bench *b = *state;

	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_DELAY, .number = 1 });
	start_program(b, 1);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_STOP });
	pass(b, 5 * SECOND);
	assert_program(b, XYZA_PROGRAM_IDLE, 1, 0);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).standing);
}

static void a_stopped_program_goes_on_or_ends(void **state)
{
	struct bench *b = *state;

	start_program(b, 1);
	pass(b, STEP + 1);
	assert_failed(b, (struct xyza_request){ .verb = XYZA_PROGRAM_END });
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_STOP });
	pass(b, 10 * SECOND);
	assert_program(b, XYZA_PROGRAM_WAITING, 1, 2);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).standing);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_CONTINUE });
	assert_program(b, XYZA_PROGRAM_RUNNING, 1, 3);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_QUICK_STOP });
	assert_program(b, XYZA_PROGRAM_INTERRUPTED, 1, 3);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).standing);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_END });
	assert_program(b, XYZA_PROGRAM_IDLE, 1, 0);
	assert_failed(b, (struct xyza_request){ .verb = XYZA_PROGRAM_CONTINUE });
}

static void single_steps_wait_for_each_other(void **state)
{
	struct bench *b = *state;

	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_STEP_ON });
	start_program(b, 1);
	pass(b, 10 * STEP);
	assert_program(b, XYZA_PROGRAM_WAITING, 1, 1);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_CONTINUE });
	pass(b, 10 * STEP);
	assert_program(b, XYZA_PROGRAM_WAITING, 1, 2);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_STEP_OFF });
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_CONTINUE });
	pass(b, 10 * STEP);
	assert_program(b, XYZA_PROGRAM_IDLE, 1, 0);
}

static void programs_and_jogs_exclude_each_other(void **state)
{
	struct bench *b = *state;

	assert_failed(b, (struct xyza_request){ .verb = XYZA_PROGRAM_START, .number = 9 });
	assert_failed(b, (struct xyza_request){ .verb = XYZA_PROGRAM_START });
	start_program(b, 1);
	assert_failed(b, (struct xyza_request){ .verb = XYZA_PROGRAM_START, .number = 1 });
	assert_failed(b, (struct xyza_request){ .verb = XYZA_MANUAL_JOG, .axis = XYZA_Y });
	/* Stops of manual mode are not for programs. */
	assert_done(b, (struct xyza_request){ .verb = XYZA_MANUAL_STOP });
	assert_done(b, (struct xyza_request){ .verb = XYZA_MANUAL_QUICK_STOP });
	assert_program(b, XYZA_PROGRAM_RUNNING, 1, 1);
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_STOP });
	assert_done(b, (struct xyza_request){ .verb = XYZA_PROGRAM_END });
	jog(b, XYZA_Y, false);
	assert_failed(b, (struct xyza_request){ .verb = XYZA_PROGRAM_START, .number = 1 });
}

static void keys_do_what_commands_do(void **state)
{
	struct bench *b = *state;

	sim_xyza_set_input(b->controller, 6, true, b->now); /* start */
	assert_program(b, XYZA_PROGRAM_RUNNING, 1, 1);
	sim_xyza_set_input(b->controller, 8, true, b->now); /* pause */
	assert_program(b, XYZA_PROGRAM_WAITING, 1, 1);
	/* Held, it does nothing more. */
	sim_xyza_set_input(b->controller, 6, true, b->now);
	assert_program(b, XYZA_PROGRAM_WAITING, 1, 1);
	sim_xyza_set_input(b->controller, 6, false, b->now);
	sim_xyza_set_input(b->controller, 6, true, b->now);
	assert_program(b, XYZA_PROGRAM_RUNNING, 1, 2);
	sim_xyza_set_input(b->controller, 7, true, b->now); /* stop: waits, then ends */
	assert_program(b, XYZA_PROGRAM_WAITING, 1, 2);
	sim_xyza_set_input(b->controller, 7, false, b->now);
	sim_xyza_set_input(b->controller, 7, true, b->now);
	assert_program(b, XYZA_PROGRAM_IDLE, 1, 0);
	/* Keys can be moved, and no pause key is one, too. */
	write_item(b, XYZA_ITEM_KEYS, XYZA_X, 0x000201);
	sim_xyza_set_input(b->controller, 1, true, b->now);
	sim_xyza_set_input(b->controller, 8, false, b->now);
	sim_xyza_set_input(b->controller, 8, true, b->now);
	assert_program(b, XYZA_PROGRAM_RUNNING, 1, 1);
}

/* --- parameters, power ---------------------------------------------------------------------------- */

static void missing_axes_and_wrong_requests_fail(void **state)
{
	struct bench *b = *state;
	struct xyza_request request = { .object = NUMBER, .order = XYZA_ORDER_DATA };

	b->config.axes = 2;
	make(b);
	assert_int_equal(axis_value(b, XYZA_READ_MAGNITUDE, XYZA_Y), 0);
	assert_failed(b, (struct xyza_request){ .verb = XYZA_READ_MAGNITUDE, .axis = XYZA_Z });
	assert_failed(b, (struct xyza_request){
				 .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_LEAD, .axis = XYZA_A });
	assert_true(
		sim_xyza_execute(b->controller, &request, XYZA_ERR_CHECKSUM, b->now, &b->reply));
	assert_int_equal(b->reply.kind, XYZA_REPLY_FAILED);
	assert_int_equal(b->reply.order, XYZA_ORDER_DATA);
	assert_int_equal(b->controller->failures, 3);
}

static void every_item_keeps_what_is_written(void **state)
{
	struct bench *b = *state;

	for (int item = 0; item < XYZA_ITEM_FACTORY_RESET; item++) {
		/* In the range of all but the keys. */
		uint32_t value = item == XYZA_ITEM_KEYS ? 0x000102 : 1;
		struct xyza_request read = { .verb = XYZA_READ_ITEM,
			                     .item = (enum xyza_item)item,
			                     .axis = XYZA_Y };

		write_item(b, read.item, XYZA_Y, value);
		assert_int_equal(value_of(b, read), value);
	}
	assert_int_equal(sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_LEAD, XYZA_X), 5000);
}

static void the_slave_number_changes_at_once(void **state)
{
	struct bench *b = *state;

	write_item(b, XYZA_ITEM_SLAVE_NUMBER, XYZA_X, 6);
	/* The answer still came from the old one: xyza_fits() has checked that. */
	assert_int_equal(
		sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_SLAVE_NUMBER, XYZA_X), 6);
	sim_xyza_power(b->controller, false, b->now);
	sim_xyza_power(b->controller, true, b->now);
	assert_int_equal(
		sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_SLAVE_NUMBER, XYZA_X), 6);
}

static void without_power_positions_go_and_parameters_stay(void **state)
{
	struct bench *b = *state;

	write_item(b, XYZA_ITEM_LEAD, XYZA_Z, 2000);
	sim_xyza_place(b->controller, XYZA_Z, 77, b->now);
	assert_done(b, (struct xyza_request){ .verb = XYZA_WRITE_OUTPUTS, .on = true });
	jog(b, XYZA_X, false);
	sim_xyza_power(b->controller, false, b->now);
	assert_false(b->controller->powered);
	assert_false(sim_xyza_busy(b->controller));
	assert_false(ask(b, (struct xyza_request){ .verb = XYZA_VERB_ONLINE }));
	pass(b, SECOND);
	sim_xyza_power(b->controller, true, b->now);
	assert_done(b, (struct xyza_request){ .verb = XYZA_VERB_ONLINE });
	assert_true(sim_xyza_axis_state(b->controller, XYZA_Z).position == 0);
	assert_true(sim_xyza_axis_state(b->controller, XYZA_X).standing);
	assert_int_equal(b->controller->outputs, 0);
	assert_int_equal(sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_LEAD, XYZA_Z), 2000);
}

static void start_up_runs_a_program_at_power_up(void **state)
{
	struct bench *b = *state;

	write_item(b, XYZA_ITEM_START_UP, XYZA_X, 1);
	sim_xyza_power(b->controller, false, b->now);
	sim_xyza_power(b->controller, true, b->now);
	assert_program(b, XYZA_PROGRAM_RUNNING, 1, 1);
}

static void a_factory_reset_needs_time_and_a_power_cycle(void **state)
{
	struct bench *b = *state;
	const struct xyza_request reset = { .verb = XYZA_WRITE_ITEM,
		                            .item = XYZA_ITEM_FACTORY_RESET };

	write_item(b, XYZA_ITEM_LEAD, XYZA_X, 2000);
	assert_done(b, reset);
	/* It does not speak until it was without power ... */
	pass(b, SIM_XYZA_RESET_TIME - 1);
	assert_false(ask(b, (struct xyza_request){ .verb = XYZA_VERB_ONLINE }));
	/* ... and when that was too soon, nothing was reset. */
	sim_xyza_power(b->controller, false, b->now);
	sim_xyza_power(b->controller, true, b->now);
	assert_done(b, (struct xyza_request){ .verb = XYZA_VERB_ONLINE });
	assert_int_equal(sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_LEAD, XYZA_X), 2000);
	assert_done(b, reset);
	pass(b, 2 * SIM_XYZA_RESET_TIME);
	assert_false(ask(b, (struct xyza_request){ .verb = XYZA_VERB_ONLINE }));
	sim_xyza_power(b->controller, false, b->now);
	sim_xyza_power(b->controller, true, b->now);
	assert_done(b, (struct xyza_request){ .verb = XYZA_VERB_ONLINE });
	assert_int_equal(sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_LEAD, XYZA_X), 5000);
}

static void memory_outlives_the_process(void **state)
{
	struct bench *b = *state;
	char path[] = "/tmp/sim-xyza-XXXXXX";
	int fd = mkstemp(path);
	FILE *file;

	assert_true(fd >= 0);
	(void)close(fd);
	b->config.flash_path = path;
	make(b); /* an empty file is no memory */
	assert_int_equal(sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_LEAD, XYZA_A), 5000);
	write_item(b, XYZA_ITEM_LEAD, XYZA_A, 4294967295u);
	write_item(b, XYZA_ITEM_SLAVE_NUMBER, XYZA_X, 9);
	make(b);
	assert_int_equal(sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_LEAD, XYZA_A),
	                 4294967295u);
	assert_int_equal(sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_LEAD, XYZA_Z), 5000);
	assert_int_equal(
		sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_SLAVE_NUMBER, XYZA_X), 9);
	file = fopen(path, "w"); /* half of it is none either */
	assert_non_null(file);
	assert_true(fputs("1 2 3", file) >= 0);
	assert_int_equal(fclose(file), 0);
	make(b);
	assert_int_equal(
		sim_xyza_memory_get(&b->controller->memory, XYZA_ITEM_SLAVE_NUMBER, XYZA_X),
		NUMBER);
	(void)unlink(path);
	b->config.flash_path = "/nowhere/memory"; /* what cannot be kept fails */
	make(b);
	assert_failed(b, (struct xyza_request){
				 .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_LEAD, .value = 1000 });
	b->config.flash_path = NULL;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
		TEST(a_jog_runs_at_the_manual_speed),
		TEST(a_brake_takes_its_time),
		TEST(one_axis_moves_at_a_time),
		TEST(a_new_manual_speed_holds_from_the_next_jog),
		TEST(positions_are_magnitude_and_sign),
		TEST(magnitude_and_sign_can_be_of_two_moments),
		TEST(outputs_are_switched_singly_or_all),
		TEST(a_program_runs_step_by_step_to_its_end),
		TEST(a_delayed_start_waits),
		TEST(a_stop_calls_a_delayed_start_off),
		TEST(a_stopped_program_goes_on_or_ends),
		TEST(single_steps_wait_for_each_other),
		TEST(programs_and_jogs_exclude_each_other),
		TEST(keys_do_what_commands_do),
		TEST(missing_axes_and_wrong_requests_fail),
		TEST(every_item_keeps_what_is_written),
		TEST(the_slave_number_changes_at_once),
		TEST(without_power_positions_go_and_parameters_stay),
		TEST(start_up_runs_a_program_at_power_up),
		TEST(a_factory_reset_needs_time_and_a_power_cycle),
		TEST(memory_outlives_the_process),
	};

	return cmocka_run_group_tests_name("sim/xyza_controller", tests, NULL, NULL);
}
