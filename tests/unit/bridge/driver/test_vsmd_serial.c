/* SPDX-License-Identifier: Apache-2.0 */
/* VSMD on serial lines, the driver alone: which lines each job says, and what it makes of the replies. */
#include "codec/vsmd.h"
#include "codec/vsmd_serial_frames.h"
#include "driver/list.h"
#include "driver/vsmd/vsmd_private.h"
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
	struct db_write_part later[2]; /* writers that joined it */
	struct db_request joined[2];
	bool brief;       /* a drive of the line moves */
	bool out_of_step; /* the previous line was not answered */
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
		.device = f->device,
		.job = &f->job,
		.exchange = &f->exchange,
		.now = f->now,
		.brief = f->brief,
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
	f->job = (struct db_job){ .kind = kind,
		                  .request = &f->request,
		                  .out_of_step = f->out_of_step,
		                  .started = f->now };
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

static const char *tell_all(struct fixture *f, int32_t position, float velocity, uint32_t bits)
{
	const struct vsmd_status status = { .position = position,
		                            .velocity = velocity,
		                            .status = bits };
	uint8_t frame[VSMD_SERIAL_STATUS_FRAME];
	int length = vsmd_serial_encode_status(1, &status, frame, sizeof frame);

	assert_true(length > 0);
	f->now += 4 * MS;
	return next(f, db_driver_vsmd_serial.answer(talk(f), frame, (size_t)length));
}

static const char *tell(struct fixture *f, uint32_t bits)
{
	return tell_all(f, 0, 0.0f, bits);
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
	/* Nor is it unproven what it refused and does not print. */
	(void)write_two(f, 0.5f, 4);
	assert_string_equal(tell(f, STANDS | WRONG), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "=refused");
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
	static const char *const names[] = { "VSMD-1", "VSMD-2", "\"VSMD-3\"", " VSMD-4" };
	const struct db_nameplate *plate;
	struct fixture *f = make();
	uint32_t seen[4];

	(void)state;
	plate = db_driver_vsmd_serial.nameplate(f->device);
	poll(f, STANDS);
	for (unsigned i = 0; i < 4; i++) {
		assert_string_equal(begin(f, DB_JOB_IDENTIFY), "1 dev");
		assert_string_equal(say(f, VSMD_REPLY_IDENTITY, names[i]), "1 cfg");
		assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4"), "=ok");
		/* Without quotation marks and blanks. */
		assert_memory_equal(plate->identity, "VSMD-", 5);
		assert_int_equal(plate->identity[5], '1' + i);
		seen[i] = plate->generation;
		for (unsigned j = 0; j < i; j++)
			assert_int_not_equal(seen[i], seen[j]);
	}
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

/* --- writes of several writers ------------------------------------------------------------------ */

static struct vsmd_axis *axis(const struct fixture *f)
{
	return (struct vsmd_axis *)f->device;
}

static const char *lose(struct fixture *f)
{
	f->now += 300 * MS;
	return next(f, db_driver_vsmd_serial.lost(talk(f)));
}

/* Three writers, the first of them with two settings. */
static const char *write_three(struct fixture *f)
{
	static const struct db_setting settings[] = {
		{ .param = VSMD_CRN, .value = { .f = 0.5f } },
		{ .param = VSMD_MCS, .value = { .u = 4 } },
		{ .param = VSMD_ACC, .value = { .f = 1000.0f } },
		{ .param = VSMD_DEC, .value = { .f = 2000.0f } },
	};

	f->request = (struct db_request){ .settings = settings, .setting_count = 2 };
	f->job = (struct db_job){ .kind = DB_JOB_SETTINGS,
		                  .request = &f->request,
		                  .parts = &f->part,
		                  .started = f->now };
	f->part = (struct db_write_part){ .request = &f->request,
		                          .next = &f->later[0],
		                          .result = DB_RESULT_PENDING };
	for (unsigned i = 0; i < 2; i++) {
		f->joined[i] = (struct db_request){ .settings = &settings[2 + i],
			                            .setting_count = 1 };
		f->later[i] = (struct db_write_part){ .request = &f->joined[i],
			                              .next = i == 0 ? &f->later[1] : NULL,
			                              .result = DB_RESULT_PENDING };
	}
	return next(f, db_driver_vsmd_serial.begin(talk(f)));
}

static void assert_results(const struct fixture *f, enum db_result first, enum db_result second,
                           enum db_result third)
{
	assert_int_equal(f->part.result, first);
	assert_int_equal(f->later[0].result, second);
	assert_int_equal(f->later[1].result, third);
}

static void assert_taken(const struct fixture *f, bool first, bool second, bool third)
{
	assert_int_equal(f->part.taken, first);
	assert_int_equal(f->later[0].taken, second);
	assert_int_equal(f->later[1].taken, third);
}

static const union db_value *held(const struct fixture *f)
{
	return db_driver_vsmd_serial.nameplate(f->device)->values;
}

/* One line and one proof for all of them; each has its own result. */
static void writers_share_a_line_and_its_proof(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	assert_string_equal(write_three(f), "1 cfg crn=0.5 mcs=4 acc=1000 dec=2000");
	assert_taken(f, false, false, false);
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_taken(f, true, true, true);
	/* What one does not hold is written again for this one only. */
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4 acc=900.00"),
	                    "1 cfg acc=1000");
	assert_results(f, DB_RESULT_OK, DB_RESULT_PENDING, DB_RESULT_UNPROVEN);
	assert_false(f->later[0].taken);
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_true(f->later[0].taken);
	assert_false(f->exchange.joins);
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4 acc=900.00"), "=ok");
	assert_results(f, DB_RESULT_OK, DB_RESULT_REFUSED, DB_RESULT_UNPROVEN);
	assert_true(feedback_of(f).status & DB_STATUS_REFUSED);
	/* Until a later one is accepted. */
	assert_string_equal(write_three(f), "1 cfg crn=0.5 mcs=4 acc=1000 dec=2000");
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4 acc=1000 dec=2000"), "=ok");
	assert_results(f, DB_RESULT_OK, DB_RESULT_OK, DB_RESULT_OK);
	assert_false(feedback_of(f).status & DB_STATUS_REFUSED);
	drop(f);
}

/* One of them is to blame: each gets a line of its own. */
static void a_refused_line_of_several_writers_is_said_in_one_line_for_each(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	for (unsigned i = 0; i < 2; i++) {
		assert_string_equal(write_three(f), "1 cfg crn=0.5 mcs=4 acc=1000 dec=2000");
		assert_string_equal(tell(f, STANDS | WRONG), "1 cfg crn=0.5 mcs=4");
		assert_taken(f, false, false, false);
		assert_string_equal(tell(f, STANDS), "1 cfg acc=1000");
		assert_taken(f, true, false, false);
		assert_string_equal(tell(f, STANDS | WRONG), "1 cfg dec=2000");
		assert_taken(f, true, false, false);
		assert_true(f->later[0].refused);
		/* The last one's refusal is not the others'. */
		assert_string_equal(tell(f, STANDS | WRONG), "1 cfg");
		assert_taken(f, true, false, false);
		assert_false(f->part.refused);
		assert_true(f->later[1].refused);
		assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4 acc=900 dec=2000"),
		                    "=ok");
		assert_results(f, DB_RESULT_OK, DB_RESULT_REFUSED, DB_RESULT_OK);
	}
	drop(f);
}

/* A stop waits for one short line at most; nothing is read. */
static void on_a_moving_line_each_setting_has_its_own_line(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	f->brief = true;
	assert_string_equal(write_three(f), "1 cfg crn=0.5");
	assert_string_equal(tell(f, STANDS), "1 cfg mcs=4");
	/* Not all of it was acknowledged. */
	assert_taken(f, false, false, false);
	assert_string_equal(tell(f, STANDS), "1 cfg acc=1000");
	assert_taken(f, true, false, false);
	assert_string_equal(tell(f, STANDS | WRONG), "1 cfg dec=2000");
	assert_taken(f, true, false, false);
	assert_string_equal(tell(f, STANDS), "=unproven");
	assert_taken(f, true, false, true);
	assert_results(f, DB_RESULT_UNPROVEN, DB_RESULT_REFUSED, DB_RESULT_UNPROVEN);
	/* What it accepted is shown, and read as soon as the line stands. */
	assert_int_equal(held(f)[VSMD_MCS].u, 4);
	assert_true(held(f)[VSMD_DEC].f > 1999.0f);
	assert_false(held(f)[VSMD_ACC].f > 0.0f);
	assert_true(db_driver_vsmd_serial.nameplate(f->device)->doubtful);
	assert_true(feedback_of(f).status & DB_STATUS_REFUSED);
	f->brief = false;
	assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "=ok");
	f->brief = true;
	assert_string_equal(write_three(f), "1 cfg crn=0.5");
	for (unsigned i = 0; i < 4; i++)
		(void)tell(f, STANDS);
	assert_string_equal(f->said, "=unproven");
	assert_false(feedback_of(f).status & DB_STATUS_REFUSED);
	drop(f);
}

/* Of one refused setting it is known that the drive does not have it; of several it is not. */
static void a_refusal_of_several_settings_is_read_again(void **state)
{
	static const struct db_setting one = { .param = VSMD_CRN, .value = { .f = 0.5f } };
	const struct db_nameplate *plate;
	struct fixture *f = make();

	(void)state;
	plate = db_driver_vsmd_serial.nameplate(f->device);
	poll(f, VSMD_ST_PWR);
	f->request = (struct db_request){ .settings = &one, .setting_count = 1 };
	assert_string_equal(begin(f, DB_JOB_SETTINGS), "1 cfg crn=0.5");
	assert_string_equal(tell(f, VSMD_ST_PWR | WRONG), "=refused");
	assert_false(plate->doubtful);
	assert_string_equal(write_two(f, 0.5f, 4), "1 cfg crn=0.5 mcs=4");
	assert_string_equal(tell(f, VSMD_ST_PWR | WRONG), "=refused");
	assert_true(plate->doubtful);
	drop(f);
}

/* What was acknowledged or refused before stays so; of the lost line and of what follows nothing is
 * known. */
static void a_lost_line_takes_nothing_from_the_lines_before(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	f->brief = true;
	assert_string_equal(write_three(f), "1 cfg crn=0.5");
	assert_string_equal(tell(f, STANDS), "1 cfg mcs=4");
	assert_string_equal(tell(f, STANDS), "1 cfg acc=1000");
	assert_false(db_driver_vsmd_serial.nameplate(f->device)->doubtful);
	assert_string_equal(lose(f), "=timeout");
	assert_results(f, DB_RESULT_UNPROVEN, DB_RESULT_PENDING, DB_RESULT_PENDING);
	assert_int_equal(held(f)[VSMD_MCS].u, 4);
	assert_true(db_driver_vsmd_serial.nameplate(f->device)->doubtful);
	/* The first refusal behind a lost answer may be of the lost one: its line is said again. */
	assert_string_equal(write_three(f), "1 cfg crn=0.5");
	assert_string_equal(tell(f, STANDS | WRONG), "1 cfg crn=0.5");
	assert_false(f->part.refused);
	assert_string_equal(tell(f, STANDS | WRONG), "1 cfg mcs=4");
	assert_true(f->part.refused);
	assert_string_equal(tell(f, STANDS), "1 cfg acc=1000");
	assert_string_equal(tell(f, STANDS), "1 cfg dec=2000");
	assert_taken(f, false, true, false);
	assert_string_equal(lose(f), "=timeout");
	assert_results(f, DB_RESULT_REFUSED, DB_RESULT_UNPROVEN, DB_RESULT_PENDING);
	drop(f);
}

/* It was read that the drive does not hold it: an acknowledgement alone does not change that. */
static void a_lost_repeat_leaves_its_end_open(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	assert_string_equal(write_three(f), "1 cfg crn=0.5 mcs=4 acc=1000 dec=2000");
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=3 acc=900 dec=2000"),
	                    "1 cfg crn=0.5 mcs=4 acc=1000");
	f->brief = true;
	assert_string_equal(lose(f), "=timeout");
	assert_results(f, DB_RESULT_PENDING, DB_RESULT_PENDING, DB_RESULT_OK);
	assert_int_equal(held(f)[VSMD_MCS].u, 3);
	drop(f);
}

/* --- reading parameters ------------------------------------------------------------------------ */

/* Exactly those that the drive printed last, each as of then. */
static void known_is_what_the_drive_printed_last(void **state)
{
	const struct db_nameplate *plate;
	struct fixture *f = make();
	uint32_t tellings;

	(void)state;
	plate = db_driver_vsmd_serial.nameplate(f->device);
	poll(f, STANDS);
	assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4 new=7"), "=ok");
	assert_true(plate->valid[0] == (UINT64_C(1) << VSMD_CRN | UINT64_C(1) << VSMD_MCS));
	assert_int_equal(plate->told[VSMD_MCS], db_told_at(f->now));
	tellings = plate->tellings;
	assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "=ok");
	assert_true(plate->valid[0] == UINT64_C(1) << VSMD_CRN);
	assert_int_not_equal(plate->tellings, tellings);
	drop(f);
}

/* The long text would delay a stop: only for the first look at a drive. */
static void a_moving_drive_is_asked_who_it_is_only_once(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, VSMD_ST_PWR);
	assert_string_equal(begin(f, DB_JOB_REFRESH), "=busy");
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "1 dev");
	assert_string_equal(say(f, VSMD_REPLY_IDENTITY, "VSMD-1"), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "=ok");
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "=busy");
	/* It may begin to move between the two. */
	poll(f, STANDS);
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "1 dev");
	axis(f)->last.status = VSMD_ST_PWR;
	assert_string_equal(say(f, VSMD_REPLY_IDENTITY, "VSMD-1"), "=busy");
	/* Somebody wants it now: it is read, unless the line moves. */
	assert_string_equal(command(f, DB_CMD_READ_PARAMETERS), "1 dev");
	assert_string_equal(say(f, VSMD_REPLY_IDENTITY, "VSMD-1"), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "=ok");
	f->brief = true;
	assert_string_equal(command(f, DB_CMD_READ_PARAMETERS), "=line_moves");
	drop(f);
}

/* A status instead of a text says no only if it says that something was wrong; what is not awaited
 * is no answer. */
static void what_was_not_asked_for_is_no_answer(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
	assert_string_equal(tell(f, STANDS), "ignored");
	assert_string_equal(say(f, VSMD_REPLY_IDENTITY, "VSMD-1"), "ignored");
	assert_string_equal(tell(f, STANDS | WRONG), "=refused");
	assert_null(f->talk.reply);
	/* Its identity it tells, or nothing. */
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "1 dev");
	assert_string_equal(tell(f, STANDS | WRONG), "ignored");
	assert_string_equal(begin(f, DB_JOB_POLL), "1 sts");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "ignored");
	assert_string_equal(command(f, DB_CMD_ENABLE), "1 ena");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50"), "ignored");
	assert_string_equal(say(f, VSMD_REPLY_IDENTITY, "VSMD-1"), "ignored");
	/* Nor is the proof of a write refused by what says nothing of it. */
	assert_string_equal(write_two(f, 0.5f, 4), "1 cfg crn=0.5 mcs=4");
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_string_equal(tell(f, STANDS), "ignored");
	assert_string_equal(tell(f, STANDS | WRONG), "=unproven");
	drop(f);
}

/* The speed that a command is judged by is one read behind it: not a poll's, and not the answer to a
 * stop that came between. */
static void a_speed_counts_that_answers_the_command(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	f->args = (struct db_args){ .target_velocity = 100.0f };
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY), "1 mov spd=100");
	poll(f, STANDS);
	assert_false(axis(f)->watch.has_speed);
	assert_string_equal(command(f, DB_CMD_STOP), "1 stp");
	(void)tell(f, STANDS);
	assert_false(axis(f)->watch.has_speed);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY), "1 mov spd=100");
	(void)tell(f, VSMD_ST_PWR);
	assert_true(axis(f)->watch.has_speed);
	drop(f);
}

/* A drive that tells no sign and runs backwards runs as it should when it is told to run faster. */
static void a_speed_without_a_sign_has_that_of_the_way(void **state)
{
	struct fixture *f = make();
	int32_t position = 0;

	(void)state;
	fake_set_option(&db_driver_vsmd_serial, &f->options, "speed-sign", 1);
	db_driver_vsmd_serial.init(f->device, NULL, &f->bus, &f->drive);
	poll(f, STANDS);
	f->args = (struct db_args){ .target_velocity = -1000.0f };
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY), "1 mov spd=-1000");
	for (unsigned tells = 0; tells < 5 && f->said[0] != '='; tells++)
		(void)tell_all(f, position -= 4, 1000.0f, VSMD_ST_PWR);
	assert_string_equal(f->said, "=ok");
	assert_string_equal(begin(f, DB_JOB_POLL), "1 sts");
	assert_string_equal(tell_all(f, position -= 40, 1000.0f, VSMD_ST_PWR), "=ok");
	f->args.target_velocity = -2000.0f;
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY), "1 mov spd=-2000");
	assert_string_equal(tell_all(f, position -= 4, 1000.0f, VSMD_ST_PWR), "1 sts");
	assert_string_equal(tell_all(f, position -= 8, 2000.0f, VSMD_ST_PWR), "=ok");
	drop(f);
}

/* --- saving ------------------------------------------------------------------------------------ */

static const char *save(struct fixture *f)
{
	f->now += 20000 * MS;
	return command(f, DB_CMD_SAVE_PARAMETERS);
}

/* Its values are the answer to a save that worked. It takes time, once, and is not said twice. */
static void a_save_is_answered_with_what_was_saved(void **state)
{
	struct fixture *f = make();

	(void)state;
	fake_set_option(&db_driver_vsmd_serial, &f->options, "save-ms", 700);
	db_driver_vsmd_serial.init(f->device, NULL, &f->bus, &f->drive);
	poll(f, STANDS);
	assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.70 mcs=4"), "=ok");
	assert_string_equal(write_two(f, 0.5f, 4), "1 cfg crn=0.5 mcs=4");
	assert_string_equal(tell(f, STANDS), "1 cfg");
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=4"), "=ok");
	assert_true(feedback_of(f).status & DB_STATUS_PARAMS_UNSAVED);
	assert_string_equal(save(f), "1 sav");
	assert_true(f->exchange.extra_time == 700 * MS);
	assert_int_equal(f->exchange.answer_length, VSMD_PARAMS_FRAME);
	assert_true(f->exchange.open_ended && !f->exchange.repeatable);
	assert_string_equal(say(f, VSMD_REPLY_PARAMS, "crn=0.50 mcs=3"), "=ok");
	assert_int_equal(held(f)[VSMD_MCS].u, 3);
	/* Without power it would come back with these. */
	assert_false(feedback_of(f).status & DB_STATUS_PARAMS_UNSAVED);
	poll(f, STANDS);
	assert_true(f->exchange.extra_time == 0);
	drop(f);
}

static void a_save_that_did_not_work_has_failed_or_was_refused(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	assert_string_equal(save(f), "1 sav");
	assert_string_equal(tell(f, STANDS | WRONG), "=refused");
	assert_string_equal(save(f), "1 sav");
	assert_string_equal(tell(f, STANDS), "=refused");
	assert_string_equal(save(f), "1 sav");
	assert_string_equal(tell(f, STANDS | VSMD_ST_FLASH_ERR), "=failed");
	assert_string_equal(save(f), "1 sav");
	assert_string_equal(say(f, VSMD_REPLY_IDENTITY, "VSMD-1"), "ignored");
	drop(f);
}

/* --- lines -------------------------------------------------------------------------------------- */

/* How much is awaited, and whether its length is known. */
static void each_line_says_what_is_awaited(void **state)
{
	struct fixture *f = make();

	(void)state;
	poll(f, STANDS);
	assert_int_equal(f->exchange.answer_length, VSMD_SERIAL_STATUS_FRAME);
	assert_true(f->exchange.repeatable && !f->exchange.open_ended);
	assert_string_equal(begin(f, DB_JOB_PROBE), "1 dev");
	assert_int_equal(f->exchange.answer_length, VSMD_IDENTITY_FRAME);
	assert_false(f->exchange.open_ended);
	assert_string_equal(say(f, VSMD_REPLY_IDENTITY, "VSMD-1"), "=ok");
	assert_string_equal(begin(f, DB_JOB_REFRESH), "1 cfg");
	assert_int_equal(f->exchange.answer_length, VSMD_PARAMS_FRAME);
	assert_true(f->exchange.open_ended);
	/* What does not fit is not said. */
	f->exchange.request_size = strlen("1 sts\n") - 1;
	assert_string_equal(begin(f, DB_JOB_POLL), "=out_of_range");
	drop(f);
}

/* The end of the line before may be lost: a line end goes first, if there is room. */
static void behind_an_unanswered_line_a_line_end_goes_first(void **state)
{
	struct fixture *f = make();

	(void)state;
	f->out_of_step = true;
	f->exchange.request_size = strlen("\n1 sts\n");
	assert_string_equal(begin(f, DB_JOB_POLL), "\n1 sts");
	f->exchange.request_size--;
	assert_string_equal(begin(f, DB_JOB_POLL), "1 sts");
	f->exchange.request_size = sizeof f->bytes;
	assert_string_equal(tell(f, VSMD_ST_PWR), "=ok");
	/* Nothing is said, and nothing is put before it. */
	f->exchange.request_length = 0;
	assert_string_equal(begin(f, DB_JOB_REFRESH), "=busy");
	assert_int_equal(f->exchange.request_length, 0);
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
		cmocka_unit_test(writers_share_a_line_and_its_proof),
		cmocka_unit_test(a_refused_line_of_several_writers_is_said_in_one_line_for_each),
		cmocka_unit_test(on_a_moving_line_each_setting_has_its_own_line),
		cmocka_unit_test(a_refusal_of_several_settings_is_read_again),
		cmocka_unit_test(a_lost_line_takes_nothing_from_the_lines_before),
		cmocka_unit_test(a_lost_repeat_leaves_its_end_open),
		cmocka_unit_test(known_is_what_the_drive_printed_last),
		cmocka_unit_test(a_moving_drive_is_asked_who_it_is_only_once),
		cmocka_unit_test(what_was_not_asked_for_is_no_answer),
		cmocka_unit_test(a_speed_counts_that_answers_the_command),
		cmocka_unit_test(a_speed_without_a_sign_has_that_of_the_way),
		cmocka_unit_test(a_save_is_answered_with_what_was_saved),
		cmocka_unit_test(a_save_that_did_not_work_has_failed_or_was_refused),
		cmocka_unit_test(each_line_says_what_is_awaited),
		cmocka_unit_test(behind_an_unanswered_line_a_line_end_goes_first),
	};

	return cmocka_run_group_tests_name("vsmd_serial", tests, NULL, NULL);
}
