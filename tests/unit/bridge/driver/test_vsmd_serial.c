/* SPDX-License-Identifier: Apache-2.0 */
/* VSMD on serial lines, the driver alone: which lines each job says, and what it makes of the replies. */
#include "codec/vsmd.h"
#include "codec/vsmd_serial_frames.h"
#include "driver/list.h"
#include "fakes/options.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define REACTION_MS 20

#define OFF VSMD_ST_STP
#define STANDS (VSMD_ST_PWR | VSMD_ST_STP)
#define WRONG VSMD_ST_CMD_WRG

struct fixture {
	struct db_bus_config bus;
	struct db_drive_config drive;
	struct fake_options options;
	struct db_device *device;
	struct db_job job;
	struct db_request request;
	struct db_args args; /* of the request */
	struct db_write_part part;
	struct db_exchange exchange;
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_conversation talk;
	db_time now;
	char said[DB_REQUEST_MAX + 16];
};

static db_time wire_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	return (db_time)(request_length + answer_length) * DB_NS_PER_US;
}

static const struct db_transport wire = { .medium = DB_MEDIUM_SERIAL, .wire_time = wire_time };

static struct fixture *make(void)
{
	struct fixture *f = calloc(1, sizeof *f);

	assert_non_null(f);
	f->bus.driver = &db_driver_vsmd_serial;
	f->bus.transport = &wire;
	f->bus.line = DB_LINE_RS485;
	f->bus.baud = 115200;
	f->bus.save_interval_s = 10;
	fake_preset_options(&db_driver_vsmd_serial, &f->options);
	fake_set_option(&db_driver_vsmd_serial, &f->options, "reaction-ms", REACTION_MS);
	f->bus.options = f->options.bus;
	f->drive.options = f->options.drive;
	f->drive.address = 1;
	f->drive.counts_per_unit = 1.0;
	f->drive.min_position = f->drive.max_position = NAN;
	f->exchange.request = f->bytes;
	f->exchange.request_size = sizeof f->bytes;
	f->now = 1000 * MS;
	f->device = calloc(1, db_driver_vsmd_serial.device_size);
	assert_non_null(f->device);
	db_driver_vsmd_serial.init(f->device, NULL, &f->bus, &f->drive);
	return f;
}

static void drop(struct fixture *f)
{
	free(f->device);
	free(f);
}

static struct db_conversation *talk(struct fixture *f)
{
	f->talk = (struct db_conversation){
		.device = f->device, .job = &f->job, .exchange = &f->exchange, .now = f->now
	};
	return &f->talk;
}

/* What the driver wants next: the line without its end, or how the job ended as "=name". */
static const char *next(struct fixture *f, enum db_step step)
{
	if (step == DB_STEP_SEND)
		snprintf(f->said, sizeof f->said, "%.*s", (int)f->exchange.request_length - 1,
		         (const char *)f->exchange.request);
	else
		snprintf(f->said, sizeof f->said, step == DB_STEP_DONE ? "=%s" : "ignored",
		         db_result_name(f->talk.result));
	return f->said;
}

static const char *begin(struct fixture *f, enum db_job_kind kind)
{
	f->job = (struct db_job){ .kind = kind, .request = &f->request, .started = f->now };
	f->part = (struct db_write_part){ .request = &f->request, .result = DB_RESULT_PENDING };
	if (kind == DB_JOB_SETTINGS)
		f->job.parts = &f->part;
	return next(f, db_driver_vsmd_serial.begin(talk(f)));
}

static const char *command(struct fixture *f, enum db_command code)
{
	f->request = (struct db_request){ .command = code, .args = &f->args };
	return begin(f, DB_JOB_COMMAND);
}

static const char *tell(struct fixture *f, uint32_t bits)
{
	const struct vsmd_status status = { .status = bits };
	uint8_t frame[VSMD_SERIAL_STATUS_FRAME];
	int length = vsmd_serial_encode_status(1, &status, frame, sizeof frame);

	assert_true(length > 0);
	f->now += 4 * MS;
	return next(f, db_driver_vsmd_serial.answer(talk(f), frame, (size_t)length));
}

static void poll(struct fixture *f, uint32_t bits)
{
	assert_string_equal(begin(f, DB_JOB_POLL), "1 sts");
	assert_string_equal(tell(f, bits), "=ok");
}

/* It does not answer what it does not know, and says in its next status that something was wrong. */
static void lose_parameters(struct fixture *f)
{
	assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
	f->now += 300 * MS;
	(void)db_driver_vsmd_serial.lost(talk(f));
}

static void a_refusal_of_what_was_not_answered_is_not_the_next_ones(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, OFF);
	lose_parameters(f);
	assert_string_equal(command(f, DB_CMD_ENABLE), "1 ena");
	assert_string_equal(tell(f, STANDS | WRONG), "=ok");
	/* Nor is a stop refused by it. */
	lose_parameters(f);
	assert_string_equal(command(f, DB_CMD_STOP), "1 stp");
	assert_string_not_equal(tell(f, STANDS | WRONG), "=refused");
	drop(f);
}

/* Without its effect it is looked at again. */
static void a_refusal_that_may_be_old_is_looked_into(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, OFF);
	lose_parameters(f);
	assert_string_equal(command(f, DB_CMD_ENABLE), "1 ena");
	assert_string_equal(tell(f, OFF | WRONG), "1 sts");
	assert_string_equal(tell(f, OFF | WRONG), "=refused");
	/* One that was read behind it is of what is said now. */
	lose_parameters(f);
	poll(f, OFF | WRONG);
	assert_string_equal(command(f, DB_CMD_ENABLE), "1 ena");
	assert_string_equal(tell(f, OFF | WRONG), "=refused");
	drop(f);
}

static void a_setting_that_may_be_refused_is_said_again(void **state)
{
	const struct db_setting setting = { .param = VSMD_CRN, .value = { .f = 0.5f } };
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	lose_parameters(f);
	f->request = (struct db_request){ .settings = &setting, .setting_count = 1 };
	assert_string_equal(begin(f, DB_JOB_SETTINGS), "1 cfg crn=0.5");
	assert_string_equal(tell(f, STANDS | WRONG), "1 cfg crn=0.5");
	(void)tell(f, STANDS);
	assert_false(f->part.refused);
	drop(f);
}

/* Drives print two decimals at least, and no more digits than a float has. */
static void a_number_holds_as_far_as_drives_print_it(void **state)
{
	static const struct {
		float held;
		float written;
		bool holds;
	} cases[] = {
		{ 0.5f, 0.5f, true },
		{ 0.505f, 0.5f, true },
		{ 0.495f, 0.5f, true },
		{ 0.506f, 0.5f, false },
		{ 0.494f, 0.5f, false },
		{ 192000.9f, 192000.0f, true },
		{ 191999.1f, 192000.0f, true },
		{ 192002.0f, 192000.0f, false },
		{ 191998.0f, 192000.0f, false },
		{ -192000.9f, -192000.0f, true },
		{ 192000.0f, -192000.0f, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++)
		assert_int_equal(db_driver_vsmd_serial.holds(
					 VSMD_SPD, (union db_value){ .f = cases[i].held },
					 (union db_value){ .f = cases[i].written }),
		                 cases[i].holds);
	assert_true(db_driver_vsmd_serial.holds(VSMD_MCS, (union db_value){ .u = 4 },
	                                        (union db_value){ .u = 4 }));
	assert_false(db_driver_vsmd_serial.holds(VSMD_MCS, (union db_value){ .u = 4 },
	                                         (union db_value){ .u = 5 }));
}

/* --- parameter writes -------------------------------------------------------------------------- */

static const char *say(struct fixture *f, enum vsmd_reply_code code, const char *text)
{
	uint8_t frame[512];
	int length = vsmd_serial_encode_text(1, code, text, strlen(text), frame, sizeof(frame));

	assert_true(length > 0);
	f->now += 4 * MS;
	return next(f, db_driver_vsmd_serial.answer(talk(f), frame, (size_t)length));
}

static const char *write_two(struct fixture *f, float current, unsigned step)
{
	static struct db_setting settings[2];

	settings[0] = (struct db_setting){ .param = VSMD_CRN, .value = { .f = current } };
	settings[1] = (struct db_setting){ .param = VSMD_MCS, .value = { .u = step } };
	f->request = (struct db_request){ .settings = settings, .setting_count = 2 };
	return begin(f, DB_JOB_SETTINGS);
}

static void a_write_is_ok_when_the_drive_holds_what_was_written(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	assert_string_equal(write_two(f, 0.5f, 4), "1 cfg crn=0.5 mcs=4");
	assert_true(f->exchange.repeatable && f->exchange.joins && !f->exchange.proof);
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_true(f->exchange.proof && !f->exchange.joins && f->exchange.open_ended);
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4"), "=ok");
	assert_int_equal(f->part.result, DB_RESULT_OK);
	drop(f);
}

/* Once: a line may have arrived damaged. Then it is refused. */
static void a_write_that_the_drive_does_not_hold_is_said_once_more(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	(void)write_two(f, 0.5f, 4);
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=3"), "1 cfg crn=0.5 mcs=4");
	assert_false(f->exchange.joins);
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_true(f->exchange.proof);
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=3"), "=refused");
	assert_int_equal(f->part.result, DB_RESULT_REFUSED);
	/* What it holds is known now. */
	assert_int_equal(db_driver_vsmd_serial.nameplate(f->device)->values[VSMD_MCS].u, 3);
	drop(f);
}

static void a_drive_that_does_not_print_a_parameter_leaves_it_unproven(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	(void)write_two(f, 0.5f, 4);
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "=unproven");
	drop(f);
}

/* While a drive moves its values are not read: a stop would wait for the long text. */
static void a_moving_drive_is_not_asked_what_it_holds(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, VSMD_ST_PWR);
	assert_string_equal(write_two(f, 0.5f, 4), "1 cfg crn=0.5 mcs=4");
	assert_string_equal(tell(f, VSMD_ST_PWR), "=unproven");
	assert_int_equal(f->part.result, DB_RESULT_UNPROVEN);
	/* Nor when it says no, twice, to what may be old: then it is refused. */
	assert_string_equal(write_two(f, 0.5f, 4), "1 cfg crn=0.5 mcs=4");
	assert_string_equal(tell(f, VSMD_ST_PWR | WRONG), "=refused");
	assert_int_equal(f->part.result, DB_RESULT_REFUSED);
	drop(f);
}

/* A refusal while it holds the values already is none; otherwise it is. */
static void what_a_drive_holds_decides_after_a_refusal(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	(void)write_two(f, 0.5f, 4);
	assert_string_equal(tell(f, STANDS | WRONG), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4"), "=ok");
	(void)write_two(f, 0.7f, 4);
	assert_string_equal(tell(f, STANDS | WRONG), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4"), "=refused");
	drop(f);
}

/* What was acknowledged and is not proved when the answer is lost. */
static void a_lost_proof_leaves_what_was_acknowledged_unproven(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	(void)write_two(f, 0.5f, 4);
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_string_equal(next(f, db_driver_vsmd_serial.lost(talk(f))), "=unproven");
	assert_true(db_driver_vsmd_serial.nameplate(f->device)->doubtful);
	/* Nothing was acknowledged. */
	(void)write_two(f, 0.5f, 4);
	assert_string_equal(next(f, db_driver_vsmd_serial.lost(talk(f))), "=timeout");
	assert_int_equal(f->part.result, DB_RESULT_PENDING);
	drop(f);
}

/* --- frames --------------------------------------------------------------------------------------- */

/* Only a status is process data, which two drives at one address would both send. */
static void frames_tell_their_sender_and_their_part(void **state)
{
	const struct vsmd_status status = { .status = STANDS };
	struct fixture *f = make();
	uint8_t frame[64];
	int address = 0;
	size_t length = (size_t)vsmd_serial_encode_status(7, &status, frame, sizeof(frame));

	(void)state;
	assert_int_equal(db_driver_vsmd_serial.accept(&f->bus, frame, length, &address),
	                 DB_FRAME_GOOD);
	assert_int_equal(address, 7);
	assert_int_not_equal(db_driver_vsmd_serial.part(&f->bus, frame, length), 0);
	/* On RS232 there is one drive, whatever it calls itself. */
	f->bus.line = DB_LINE_RS232;
	assert_int_equal(db_driver_vsmd_serial.accept(&f->bus, frame, length, &address),
	                 DB_FRAME_GOOD);
	assert_int_equal(address, -1);
	frame[5] ^= 1;
	assert_int_equal(db_driver_vsmd_serial.accept(&f->bus, frame, length, &address),
	                 DB_FRAME_BAD);
	length = (size_t)vsmd_serial_encode_text(7, VSMD_REPLY_IDENTITY, "VSMD", 4, frame,
	                                         sizeof(frame));
	assert_int_equal(db_driver_vsmd_serial.part(&f->bus, frame, length), 0);
	length = (size_t)vsmd_serial_encode_text(7, VSMD_REPLY_PARAMS, "mcs=4", 5, frame,
	                                         sizeof(frame));
	assert_int_equal(db_driver_vsmd_serial.part(&f->bus, frame, length), 0);
	drop(f);
}

/* --- ports -------------------------------------------------------------------------------------- */

/* A port is an input or an output, as the parameters say; its level is in the status. */
static void the_parameters_say_which_port_is_an_output(void **state)
{
	static const uint32_t levels[] = { VSMD_ST_S1, VSMD_ST_S2, VSMD_ST_S3,
		                           VSMD_ST_S4, VSMD_ST_S5, VSMD_ST_S6 };
	struct db_feedback feedback = { 0 };
	struct fixture *f = make();
	char text[128];

	(void)state;
	poll(f, STANDS);
	for (unsigned port = 0; port < 6; port++) {
		char *at = text;

		for (unsigned i = 0; i < 6; i++)
			at += sprintf(at, "%ss%u=%d", i > 0 ? " " : "", i + 1, i == port);
		assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
		assert_string_equal(say(f, VSMD_REPLY_PARAMS, text), "=ok");
		assert_int_equal(db_driver_vsmd_serial.input_ports(
					 db_driver_vsmd_serial.nameplate(f->device)),
		                 0x3F & ~(1u << port));
		poll(f, STANDS | levels[port]);
		db_driver_vsmd_serial.feedback(f->device, &feedback);
		assert_int_equal(feedback.inputs, 1u << port);
		assert_int_equal(feedback.outputs, 1u << port);
		/* Another one is no output, whatever its level. */
		poll(f, STANDS | levels[(port + 1) % 6]);
		db_driver_vsmd_serial.feedback(f->device, &feedback);
		assert_int_equal(feedback.inputs, 1u << (port + 1) % 6);
		assert_int_equal(feedback.outputs, 0);
	}
	drop(f);
}

/* --- identity ----------------------------------------------------------------------------------- */

/* The same parameters may be another drive's: what it is called is published again. */
static void another_drive_has_another_generation(void **state)
{
	static const char *const names[] = { "VSMD-1", "VSMD-2", "\"VSMD-3\"" };
	const struct db_nameplate *plate;
	struct fixture *f = make();
	uint32_t seen[3];

	(void)state;
	plate = db_driver_vsmd_serial.nameplate(f->device);
	poll(f, STANDS);
	for (unsigned i = 0; i < 3; i++) {
		assert_string_equal(begin(f, DB_JOB_IDENTIFY), "1 dev");
		assert_string_equal(say(f, VSMD_REPLY_IDENTITY, names[i]), "1 cfg");
		assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4"), "=ok");
		assert_int_equal(plate->identity[5], '1' + i);
		seen[i] = plate->generation;
		for (unsigned j = 0; j < i; j++)
			assert_int_not_equal(seen[i], seen[j]);
	}
	/* Without the quotation marks. */
	assert_int_equal(plate->identity[0], 'V');
	drop(f);
}

/* --- what a status tells ----------------------------------------------------------------------- */

static struct db_feedback feedback_of(const struct fixture *f)
{
	struct db_feedback feedback = { .taken = 0 };

	db_driver_vsmd_serial.feedback(f->device, &feedback);
	return feedback;
}

static void each_bit_of_a_status_is_told_as_what_it_is(void **state)
{
	static const struct {
		uint32_t bits;
		enum db_axis_state state;
		uint32_t status;
		uint16_t error;
	} cases[] = {
		{ OFF, DB_AXIS_DISABLED, 0, DB_ERROR_NONE },
		{ STANDS, DB_AXIS_STANDSTILL, DB_STATUS_ENABLED, DB_ERROR_NONE },
		{ VSMD_ST_PWR, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_ENABLED | DB_STATUS_MOVING,
		  DB_ERROR_NONE },
		{ 0, DB_AXIS_DISABLED, DB_STATUS_MOVING, DB_ERROR_NONE },
		{ STANDS | VSMD_ST_FLT, DB_AXIS_ERROR_STOP, DB_STATUS_ENABLED | DB_STATUS_ERROR,
		  DB_ERROR_HARDWARE },
		{ OFF | VSMD_ST_VOLTAGE | VSMD_ST_FLT, DB_AXIS_ERROR_STOP, DB_STATUS_ERROR,
		  DB_ERROR_VOLTAGE },
		{ OFF | VSMD_ST_OVER_TEMPERATURE, DB_AXIS_ERROR_STOP, DB_STATUS_ERROR,
		  DB_ERROR_OVER_TEMPERATURE },
		{ OFF | VSMD_ST_OVER_CURRENT, DB_AXIS_ERROR_STOP, DB_STATUS_ERROR,
		  DB_ERROR_OVER_CURRENT },
		{ OFF | VSMD_ST_ENC_ERR, DB_AXIS_ERROR_STOP, DB_STATUS_ERROR, DB_ERROR_ENCODER },
		/* No motion is lost by that. */
		{ STANDS | VSMD_ST_FLASH_ERR, DB_AXIS_STANDSTILL,
		  DB_STATUS_ENABLED | DB_STATUS_WARNING, DB_ERROR_FLASH },
		{ STANDS | VSMD_ST_POS_REACHED | VSMD_ST_SPD_REACHED | VSMD_ST_HS | VSMD_ST_ACT,
		  DB_AXIS_STANDSTILL, DB_STATUS_ENABLED, DB_ERROR_NONE },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture *f = make();
		struct db_feedback feedback = feedback_of(f);

		assert_int_equal(feedback.state, DB_AXIS_OFFLINE);
		assert_int_equal(feedback.taken, 0);
		poll(f, cases[i].bits);
		feedback = feedback_of(f);
		assert_int_equal(feedback.state, cases[i].state);
		assert_int_equal(feedback.status, cases[i].status);
		assert_int_equal(feedback.error, cases[i].error);
		assert_int_equal(feedback.drive_status, cases[i].bits);
		assert_true(feedback.taken == f->now);
		drop(f);
	}
}

static void a_status_has_the_levels_of_the_inputs(void **state)
{
	static const uint32_t bits[] = { VSMD_ST_S1, VSMD_ST_S2, VSMD_ST_S3,
		                         VSMD_ST_S4, VSMD_ST_S5, VSMD_ST_S6 };
	struct fixture *f = make();

	(void)state;
	for (unsigned i = 0; i < 6; i++) {
		poll(f, STANDS | bits[i]);
		assert_int_equal(feedback_of(f).inputs, 1 << i);
	}
	drop(f);
}

/* It stands for a while, then moves. */
static void carry_out(struct fixture *f, enum db_command motion)
{
	f->args = (struct db_args){ .target_velocity = 100.0f, .target_position = 1000 };
	(void)command(f, motion);
	for (unsigned tells = 0; tells < 5 && f->said[0] != '='; tells++)
		(void)tell(f, tells < 3 ? STANDS : VSMD_ST_PWR);
	assert_string_equal(f->said, "=ok");
}

/* By what was commanded, while it moves, with a target if it has one. */
static void a_motion_is_told_by_its_kind(void **state)
{
	static const struct {
		enum db_command command;
		enum db_axis_state state;
	} cases[] = {
		{ DB_CMD_MOVE_VELOCITY, DB_AXIS_CONTINUOUS_MOTION },
		{ DB_CMD_MOVE_PRESET, DB_AXIS_CONTINUOUS_MOTION },
		{ DB_CMD_MOVE_ABSOLUTE, DB_AXIS_DISCRETE_MOTION },
		{ DB_CMD_MOVE_RELATIVE, DB_AXIS_DISCRETE_MOTION },
		{ DB_CMD_HOME, DB_AXIS_HOMING },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture *f = make();

		poll(f, STANDS);
		carry_out(f, DB_CMD_MOVE_ABSOLUTE);
		assert_true(feedback_of(f).has_target);
		poll(f, STANDS);
		carry_out(f, cases[i].command);
		assert_int_equal(feedback_of(f).has_target,
		                 cases[i].state == DB_AXIS_DISCRETE_MOTION);
		assert_int_equal(feedback_of(f).state, cases[i].state);
		assert_int_equal(feedback_of(f).status & (DB_STATUS_MOVING | DB_STATUS_HOMING),
		                 DB_STATUS_MOVING |
		                         (cases[i].state == DB_AXIS_HOMING ? DB_STATUS_HOMING : 0));
		drop(f);
	}
}

/* A run for the origin that may have begun ends with the power that is taken: a stop is no more than that. */
static void what_may_have_begun_is_over_without_power(void **state)
{
	struct fixture *f = make();

	(void)state;
	for (unsigned off = 0; off < 2; off++) {
		poll(f, STANDS);
		assert_string_equal(command(f, DB_CMD_HOME), "1 zero stop");
		assert_string_equal(tell(f, STANDS), "1 zero start");
		f->now += 300 * MS;
		(void)db_driver_vsmd_serial.lost(talk(f));
		if (off) {
			assert_string_equal(command(f, DB_CMD_DISABLE), "1 off");
			assert_string_equal(tell(f, OFF), "=ok");
			poll(f, STANDS);
		}
		assert_string_equal(command(f, DB_CMD_STOP), "1 stp");
		assert_string_equal(tell(f, STANDS), off ? "=ok" : "1 zero stop");
		if (!off)
			assert_string_equal(tell(f, STANDS), "=ok");
	}
	drop(f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_refusal_of_what_was_not_answered_is_not_the_next_ones),
		cmocka_unit_test(a_refusal_that_may_be_old_is_looked_into),
		cmocka_unit_test(a_setting_that_may_be_refused_is_said_again),
		cmocka_unit_test(a_number_holds_as_far_as_drives_print_it),
		cmocka_unit_test(a_write_is_ok_when_the_drive_holds_what_was_written),
		cmocka_unit_test(a_write_that_the_drive_does_not_hold_is_said_once_more),
		cmocka_unit_test(a_drive_that_does_not_print_a_parameter_leaves_it_unproven),
		cmocka_unit_test(a_moving_drive_is_not_asked_what_it_holds),
		cmocka_unit_test(what_a_drive_holds_decides_after_a_refusal),
		cmocka_unit_test(a_lost_proof_leaves_what_was_acknowledged_unproven),
		cmocka_unit_test(frames_tell_their_sender_and_their_part),
		cmocka_unit_test(the_parameters_say_which_port_is_an_output),
		cmocka_unit_test(another_drive_has_another_generation),
		cmocka_unit_test(each_bit_of_a_status_is_told_as_what_it_is),
		cmocka_unit_test(a_status_has_the_levels_of_the_inputs),
		cmocka_unit_test(a_motion_is_told_by_its_kind),
		cmocka_unit_test(what_may_have_begun_is_over_without_power),
	};

	return cmocka_run_group_tests_name("vsmd_serial", tests, NULL, NULL);
}
