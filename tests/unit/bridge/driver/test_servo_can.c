/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The servo family's driver alone, against frames written by hand: which each job puts on the wire,
 * and what it makes of those that come back. Node 5: its frames are the bases of the document plus
 * 5, acknowledgements have id 006. The command words, which no page of the document shows, are made
 * up: id 0A5, word 0 in bytes 0 and 1, word 1 in bytes 2 and 3, acknowledged with 07.
 */
#include "codec/can.h"
#include "codec/servo_can.h"
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
#define NODE 5
#define CYCLE_MS 20

static const struct db_driver *const driver = &db_driver_servo_can;

struct fixture {
	struct db_bus_config bus;
	struct db_drive_config drive;
	struct fake_options options;
	struct db_device *device;
	struct db_job job;
	struct db_request request;
	struct db_args args; /* of the request */
	struct db_setting settings[DB_SETTINGS_MAX];
	struct db_exchange exchange;
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_conversation talk;
	db_time now;
	char said[256]; /* the exchange, as "ID#DATA ID#DATA" */
};

/* --- a drive ------------------------------------------------------------------------------------- */

static void option(struct fixture *f, const char *name, double value)
{
	fake_set_option(driver, &f->options, name, value);
}

static struct fixture *make(void)
{
	struct fixture *f = calloc(1, sizeof *f);

	assert_non_null(f);
	f->bus.driver = driver;
	f->bus.cycle_ms = CYCLE_MS;
	f->bus.bitrate = 1000000;
	f->drive.address = NODE;
	f->bus.options = f->options.bus;
	f->drive.options = f->options.drive;
	f->drive.max_velocity = NAN;
	f->drive.max_acceleration = NAN;
	fake_preset_options(driver, &f->options);
	f->exchange.request = f->bytes;
	f->exchange.request_size = sizeof f->bytes;
	f->now = 1000 * MS;
	return f;
}

/* With the settings as they are now. */
static void switch_on(struct fixture *f)
{
	f->device = calloc(1, driver->device_size);
	assert_non_null(f->device);
	driver->init(f->device, NULL, &f->bus, &f->drive);
}

static void drop(struct fixture *f)
{
	free(f->device);
	free(f);
}

/* --- frames as text ------------------------------------------------------------------------------ */

/* The job as the scheduler hands it to the driver now. */
static struct db_conversation *talk(struct fixture *f)
{
	f->talk = (struct db_conversation){
		.device = f->device, .job = &f->job, .exchange = &f->exchange, .now = f->now
	};
	return &f->talk;
}

static const char *next(struct fixture *f, enum db_step step)
{
	char *at = f->said;

	if (step == DB_STEP_DONE) {
		snprintf(f->said, sizeof f->said, "=%s", db_result_name(f->talk.result));
		return f->said;
	}
	if (step != DB_STEP_SEND) {
		snprintf(f->said, sizeof f->said, step == DB_STEP_MORE ? "more" : "ignored");
		return f->said;
	}
	f->exchange.sending++;
	for (size_t i = 0; i < f->exchange.request_length; i += sizeof(struct db_can_frame)) {
		struct db_can_frame frame;

		memcpy(&frame, f->exchange.request + i, sizeof frame);
		assert_true(frame.id <= DB_CAN_STANDARD_MASK);
		at += sprintf(at, "%s%03X#", i > 0 ? " " : "", frame.id);
		for (unsigned j = 0; j < frame.length; j++)
			at += sprintf(at, "%02X", frame.data[j]);
	}
	return f->said;
}

static struct db_can_frame frame_of(const char *text)
{
	struct db_can_frame frame = { .id = (uint32_t)strtoul(text, NULL, 16) };

	for (text = strchr(text, '#') + 1; *text; text += 2) {
		char byte[3] = { text[0], text[1], '\0' };

		frame.data[frame.length++] = (uint8_t)strtoul(byte, NULL, 16);
	}
	return frame;
}

static const char *begin(struct fixture *f, enum db_job_kind kind)
{
	f->job = (struct db_job){ .kind = kind, .request = &f->request, .started = f->now };
	return next(f, driver->begin(talk(f)));
}

static const char *command(struct fixture *f, enum db_command code, struct db_args args)
{
	f->args = args;
	f->request = (struct db_request){ .command = code, .args = &f->args };
	return begin(f, DB_JOB_COMMAND);
}

static const char *plain(struct fixture *f, enum db_command code)
{
	return command(f, code, (struct db_args){ 0 });
}

static const char *answer(struct fixture *f, const char *text)
{
	struct db_can_frame frame = frame_of(text);

	f->now += MS / 2;
	f->exchange.begins = f->exchange.again = false;
	return next(f, driver->answer(talk(f), (const uint8_t *)&frame, sizeof frame));
}

static const char *lost(struct fixture *f)
{
	f->now += 30 * MS;
	return next(f, driver->lost(talk(f)));
}

static bool report(struct fixture *f, const char *text)
{
	struct db_can_frame frame = frame_of(text);

	return driver->report(f->device, (const uint8_t *)&frame, sizeof frame, f->now);
}

/* All three parts of the answer to a read of selector 0. */
static const char *tell(struct fixture *f, int32_t position, int16_t rpm, uint16_t bits)
{
	char text[32];

	snprintf(text, sizeof text, "165#%08X", (unsigned)position);
	assert_string_equal(answer(f, text), "more");
	snprintf(text, sizeof text, "185#%04X0000", (unsigned)(uint16_t)rpm);
	assert_string_equal(answer(f, text), "more");
	snprintf(text, sizeof text, "1A5#%04X0000", (unsigned)bits);
	return answer(f, text);
}

#define ON SERVO_CAN_ST_STARTED
#define STILL SERVO_CAN_ST_ZERO_SPEED
#define THERE SERVO_CAN_ST_POSITION_REACHED

static struct db_feedback feedback(const struct fixture *f)
{
	struct db_feedback feedback = { 0 };

	driver->feedback(f->device, &feedback);
	return feedback;
}

static const char *state(const struct fixture *f)
{
	return db_axis_state_name((enum db_axis_state)feedback(f).state);
}

/* A cyclic read; also of the analogue input, when it is time. */
static void poll(struct fixture *f, int32_t position, int16_t rpm, uint16_t bits)
{
	f->now += CYCLE_MS * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	if (strcmp(tell(f, position, rpm, bits), "145#07") == 0)
		assert_string_equal(answer(f, "225#0123"), "=ok");
	assert_string_equal(f->said, "=ok");
}

static struct fixture *make_on(uint16_t bits)
{
	struct fixture *f = make();

	switch_on(f);
	poll(f, 0, 0, bits);
	return f;
}

static void set_words(struct fixture *f)
{
	option(f, "command-word-base", 0x0A0);
	option(f, "command-word-length", 4);
	option(f, "command-word-0-at", 0);
	option(f, "command-word-1-at", 2);
	option(f, "command-word-ack", 7);
}

/* Enabled, standing, able to make position moves. */
static struct fixture *make_positioner(void)
{
	struct fixture *f = make();

	set_words(f);
	switch_on(f);
	poll(f, 1000, 0, ON | STILL | THERE);
	return f;
}

static struct db_args velocity(float rpm)
{
	return (struct db_args){ .target_velocity = rpm };
}

static struct db_args current(float amperes)
{
	return (struct db_args){ .target_current = amperes };
}

static struct db_args to(int32_t position)
{
	return (struct db_args){ .target_position = position };
}

/* The speed mode is selected by a first move, what may have been left in it is cleared. */
static void select_speed(struct fixture *f, float rpm, int16_t now)
{
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(rpm)), "145#00");
	assert_string_equal(tell(f, 0, now, ON | STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "045#0001000000");
	assert_string_equal(answer(f, "006#02"), f->said);
	assert_memory_equal(f->said, "065#01", 6);
}

/* Behind the acknowledgement a read shows that it begins. */
static void run(struct fixture *f, float rpm)
{
	select_speed(f, rpm, 0);
	assert_string_equal(answer(f, "006#040000"), "145#00");
	assert_string_equal(tell(f, 0, rpm > 0 ? 2 : -2, ON), "=ok");
}

static void select_current(struct fixture *f, float amperes)
{
	assert_string_equal(command(f, DB_CMD_MOVE_CURRENT, current(amperes)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "065#020000");
	assert_string_equal(answer(f, "006#050000"), "045#0002000000");
	assert_string_equal(answer(f, "006#02"), f->said);
	assert_memory_equal(f->said, "065#02", 6);
}

/* All three parts of an answer, with a current in 0.1 A. */
static const char *tell_current(struct fixture *f, int16_t steps)
{
	char text[32];

	assert_string_equal(answer(f, "165#00000000"), "more");
	snprintf(text, sizeof text, "185#0000%04X", (unsigned)(uint16_t)steps);
	assert_string_equal(answer(f, text), "more");
	return answer(f, "1A5#00050000");
}

/* --- power --------------------------------------------------------------------------------------- */

/* What another program may have left in the drive is cleared before its motor gets power, and the
 * demand is brought to where it stands. */
static void send_enable(struct fixture *f, int32_t position)
{
	char text[32];

	snprintf(text, sizeof text, "085#%08X", (unsigned)position);
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, position, 0, STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "065#020000");
	assert_string_equal(answer(f, "006#050000"), text);
	assert_string_equal(answer(f, "006#06"), "025#000A");
}

static void enable_is_acknowledged_and_then_seen(void **unused)
{
	struct fixture *f = make_on(0);

	(void)unused;
	assert_string_equal(state(f), "Disabled");
	send_enable(f, 700);
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 700, 0, 0), "145#00");
	/* With its power it is watched for a while. */
	assert_string_equal(tell(f, 700, 0, ON | STILL), "145#00");
	assert_true(f->exchange.again);
	f->now += 190 * MS;
	assert_string_equal(tell(f, 702, 0, ON | STILL), "145#00");
	f->now += 10 * MS;
	assert_string_equal(tell(f, 700, 0, ON | STILL), "=ok");
	assert_string_equal(state(f), "Standstill");
	assert_true(feedback(f).status & DB_STATUS_ENABLED);
	drop(f);
}

/* Some drives do not answer a speed or current that their mode has no use for. */
static void enabling_does_not_need_an_answer_to_what_is_cleared(void **unused)
{
	struct fixture *f = make_on(0);

	(void)unused;
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 5, 0, STILL), "065#010000");
	assert_false(f->exchange.repeatable);
	assert_string_equal(lost(f), "065#020000");
	assert_string_equal(answer(f, "006#01"), "ignored");
	assert_string_equal(lost(f), "085#00000005");
	/* But without the demand at the position the motor could jump. */
	assert_string_equal(lost(f), "=timeout");
	drop(f);
}

static void power_that_does_not_follow_is_a_failure(void **unused)
{
	struct fixture *f = make_on(0);

	(void)unused;
	send_enable(f, 0);
	assert_string_equal(answer(f, "006#01"), "145#00");
	f->now += 201 * MS;
	/* Nor later, when nobody expects it any more. */
	assert_string_equal(tell(f, 0, 0, 0), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=failed");
	drop(f);
}

/* From the rise of the power on nothing is to move: a demand of the drive's own may be in force. */
static void a_motor_that_jumps_when_it_gets_power_loses_it(void **unused)
{
	static const struct {
		int32_t position;
		int16_t rpm;
		uint16_t bits;
	} astray[] = {
		{ 599, 0, ON | STILL },
		{ 801, -50, ON },
		{ 820, 50, 0 }, /* before the status shows its power */
	};

	(void)unused;
	for (size_t i = 0; i < sizeof astray / sizeof astray[0]; i++) {
		struct fixture *f = make_on(0);

		send_enable(f, 700);
		assert_string_equal(answer(f, "006#01"), "145#00");
		if (astray[i].bits & ON)
			assert_string_equal(tell(f, 799, 0, ON | STILL), "145#00");
		assert_string_equal(tell(f, astray[i].position, astray[i].rpm, astray[i].bits),
		                    "025#0001");
		assert_string_equal(answer(f, "006#01"), "145#00");
		assert_string_equal(tell(f, 900, 10, 0), "=failed");
		drop(f);
	}
}

/* How far is a setting; a motor that turned when it got its power may come to rest first. */
static void how_a_motor_may_move_when_it_gets_power(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "power-on-window", 2);
	f->drive.counts_per_unit = 10;
	switch_on(f);
	poll(f, 0, 500, 0);
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 500, 0), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "065#020000");
	assert_string_equal(answer(f, "006#050000"), "085#00000000");
	assert_string_equal(answer(f, "006#06"), "025#000A");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 300, 400, ON), "145#00");
	assert_string_equal(tell(f, 600, 0, ON | STILL), "145#00");
	assert_string_equal(tell(f, 620, 0, ON | STILL), "145#00");
	assert_string_equal(tell(f, 621, 0, ON | STILL), "025#0001");
	drop(f);
	f = make_on(0);
	poll(f, 0, 500, 0);
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 500, 0), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "065#020000");
	assert_string_equal(answer(f, "006#050000"), "085#00000000");
	assert_string_equal(answer(f, "006#06"), "025#000A");
	assert_string_equal(answer(f, "006#01"), "145#00");
	/* Back to where it was told to stay, or away. */
	assert_string_equal(tell(f, 300, -510, ON), "025#0001");
	drop(f);
}

/* Compared with the reading before, as exact as a speed is. */
static void a_motor_that_runs_out_gets_no_faster(void **unused)
{
	static const struct {
		int16_t speeds[3];
		unsigned good; /* of them */
	} cases[] = {
		{ { 510, 520, 530 }, 3 }, { { 511 }, 0 },       { { -510, 400, -410 }, 3 },
		{ { 400, 411 }, 1 },      { { 400, -411 }, 1 },
	};

	(void)unused;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make();

		option(f, "standstill-speed", 10);
		switch_on(f);
		poll(f, 0, 500, 0);
		assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
		assert_string_equal(tell(f, 0, 500, 0), "065#010000");
		assert_string_equal(answer(f, "006#040000"), "065#020000");
		assert_string_equal(answer(f, "006#050000"), "085#00000000");
		assert_string_equal(answer(f, "006#06"), "025#000A");
		assert_string_equal(answer(f, "006#01"), "145#00");
		for (unsigned j = 0; j < cases[i].good; j++)
			assert_string_equal(tell(f, 0, cases[i].speeds[j], ON), "145#00");
		if (cases[i].good < 3)
			assert_string_equal(tell(f, 0, cases[i].speeds[cases[i].good], ON),
			                    "025#0001");
		drop(f);
	}
}

/* Power that goes by itself again, or comes although there is a fault, is none. */
static void power_that_does_not_stay_is_a_failure(void **unused)
{
	static const uint16_t bits[] = { STILL, ON | STILL | SERVO_CAN_ST_ERROR };

	(void)unused;
	for (size_t i = 0; i < 2; i++) {
		struct fixture *f = make_on(0);

		send_enable(f, 0);
		assert_string_equal(answer(f, "006#01"), "145#00");
		assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
		assert_string_equal(tell(f, 0, 0, bits[i]), "025#0001");
		assert_string_equal(answer(f, "006#01"), "145#00");
		assert_string_equal(tell(f, 0, 0, STILL), "=failed");
		drop(f);
	}
}

static void disable(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	assert_string_equal(plain(f, DB_CMD_DISABLE), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=ok");
	assert_string_equal(state(f), "Disabled");
	drop(f);
}

static void which_bit_tells_of_power_is_a_setting(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "enabled-bit", 1);
	switch_on(f);
	poll(f, 0, 0, SERVO_CAN_ST_STARTED | STILL);
	assert_string_equal(state(f), "Disabled");
	poll(f, 0, 0, SERVO_CAN_ST_RUNNING | STILL);
	assert_string_equal(state(f), "Standstill");
	drop(f);
}

/* They may be late ones of earlier frames: the right one counts, and where none comes, what can be seen. */
static void other_acknowledgements_decide_nothing(void **unused)
{
	static const char *const wrong[] = { "006#02", "006#07", "006#55", "006#040000" };

	(void)unused;
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
		struct fixture *f = make_on(0);

		send_enable(f, 0);
		assert_string_equal(answer(f, "165#00000000"), "ignored");
		assert_string_equal(answer(f, "1C5#00000000"), "ignored");
		assert_string_equal(answer(f, wrong[i]), "ignored");
		assert_string_equal(answer(f, "006#01"), "145#00");
		drop(f);
		f = make_on(0);
		send_enable(f, 0);
		assert_string_equal(answer(f, wrong[i]), "ignored");
		assert_string_equal(lost(f), "145#00");
		assert_true(feedback(f).status & DB_STATUS_REFUSED);
		assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
		f->now += 201 * MS;
		assert_string_equal(tell(f, 0, 0, ON | STILL), "=ok");
		drop(f);
	}
}

/* The motor turns whatever was acknowledged. */
static void a_speed_is_judged_by_its_effect(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_speed(f, 250, 0);
	assert_string_equal(answer(f, "006#01"), "ignored");
	assert_false(f->exchange.repeatable);
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 0, 30, ON), "=ok");
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(0)), "065#010000");
	assert_string_equal(lost(f), "145#00");
	f->now += 201 * MS;
	assert_string_equal(tell(f, 0, 250, ON), "=indeterminate");
	drop(f);
}

static void a_lost_enable_is_looked_up(void **unused)
{
	struct fixture *f = make_on(0);

	(void)unused;
	send_enable(f, 0);
	assert_true(f->exchange.repeatable);
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(lost(f), "=indeterminate");
	/* One that did not arrive must not come later. */
	send_enable(f, 0);
	assert_string_equal(lost(f), "145#00");
	f->now += 201 * MS;
	assert_string_equal(tell(f, 0, 0, STILL), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=failed");
	drop(f);
}

/* What was commanded before the power went must not go on when it is back. */
static void enabling_clears_an_old_speed(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, 1000);
	assert_string_equal(plain(f, DB_CMD_DISABLE), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=ok");
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "045#0001000000");
	assert_string_equal(answer(f, "006#02"), "025#000A");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
	f->now += 201 * MS;
	assert_string_equal(tell(f, 0, 0, ON | STILL), "=ok");
	/* A drive that has power is left alone. */
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "025#000A");
	drop(f);
}

static void an_old_speed_outlives_the_mode(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, -3);
	driver->gone(f->device);
	poll(f, 0, 0, STILL);
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "045#0001000000");
	assert_string_equal(answer(f, "006#02"), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "025#000A");
	drop(f);
}

/* The shaft may have been turned by hand, or its position set: it is held where it is. */
static void enabling_in_position_mode_holds_the_place(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "allow-mode-change", 0);
	option(f, "mode", 1);
	switch_on(f);
	poll(f, 900, 0, STILL);
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, -70000, 0, STILL), "085#FFFEEE90");
	assert_string_equal(answer(f, "006#06"), "025#000A");
	drop(f);
}

/* --- speed and current --------------------------------------------------------------------------- */

static void first_speed_selects_the_mode(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_speed(f, -300, 0);
	assert_string_equal(f->said, "065#01FED4");
	/* The acknowledgement tells what is measured: not the same, and no reason to complain. */
	assert_string_equal(answer(f, "006#040007"), "145#00");
	assert_string_equal(tell(f, 0, -2, ON), "=ok");
	assert_string_equal(state(f), "ContinuousMotion");
	/* In the mode already; is it allowed to go on? */
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(32767)), "145#00");
	assert_string_equal(tell(f, 0, -300, ON), "065#017FFF");
	assert_true(f->exchange.repeatable);
	assert_string_equal(answer(f, "006#04FED4"), "145#00");
	assert_string_equal(tell(f, 0, -200, ON), "=ok");
	poll(f, -5, -300, ON);
	assert_true(feedback(f).velocity == -300.0f);
	assert_true(feedback(f).status & DB_STATUS_MOVING);
	drop(f);
}

/* Nothing reads a setpoint back: where the motor does not show it, it is not claimed. */
static void a_speed_that_does_not_show_is_unproven(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_speed(f, 300, 0);
	assert_string_equal(answer(f, "006#040000"), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
	/* Trembling is no motion. */
	assert_string_equal(tell(f, 0, 1, ON | STILL), "145#00");
	f->now += 201 * MS;
	assert_string_equal(tell(f, 0, 0, ON | STILL), "=unproven");
	/* It is to run all the same. */
	assert_string_equal(state(f), "ContinuousMotion");
	drop(f);
}

static void a_motor_that_lost_its_power_does_not_run(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_speed(f, 300, 0);
	assert_string_equal(answer(f, "006#040000"), "145#00");
	/* Nor when it gets it back. */
	assert_string_equal(tell(f, 0, 0, STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "=failed");
	drop(f);
}

static void current_has_its_own_mode(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_current(f, -1.25f);
	assert_string_equal(f->said, "065#02FFF4");
	assert_string_equal(answer(f, "006#050000"), "145#00");
	assert_string_equal(tell_current(f, 0), "145#00");
	assert_string_equal(tell_current(f, -11), "=ok");
	assert_string_equal(command(f, DB_CMD_MOVE_CURRENT, current(2)), "145#00");
	assert_string_equal(tell_current(f, -12), "065#020014");
	/* The acknowledgement of a speed is not one of a current. */
	assert_string_equal(answer(f, "006#040000"), "ignored");
	drop(f);
}

static void torque_direction_goes_with_every_mode(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "torque-direction", 1);
	switch_on(f);
	poll(f, 0, 0, ON | STILL);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(1)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "045#0011000000");
	drop(f);
}

static void modes_change_only_at_rest(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	/* Turning, for whatever reason. */
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(10)), "145#00");
	assert_string_equal(tell(f, 0, 40, ON), "=busy");
	run(f, 10);
	/* Told to run, even if it stands. */
	assert_string_equal(command(f, DB_CMD_MOVE_CURRENT, current(1)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "=busy");
	assert_string_equal(plain(f, DB_CMD_STOP), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "=ok");
	assert_string_equal(command(f, DB_CMD_MOVE_CURRENT, current(1)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "065#020000");
	assert_string_equal(answer(f, "006#050000"), "045#0002000000");
	drop(f);
}

/* Nothing was sent yet that could move it. */
static void a_move_whose_first_read_is_lost_was_not_begun(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(10)), "145#00");
	assert_string_equal(lost(f), "=timeout");
	drop(f);
}

/* What the codec cuts out of the bus, by its id alone. */
static void parts_of_an_answer_are_told_apart(void **unused)
{
	static const struct {
		const char *text;
		uint32_t part;
	} cases[] = { { "165#00000000", 0x160 }, { "185#00000000", 0x180 },
		      { "1A5#00000000", 0x1A0 }, { "1C5#00000000", 0 },
		      { "006#01", 0 },           { "145#00", 0 } };
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct db_can_frame frame = frame_of(cases[i].text);

		assert_int_equal(driver->part(&f->bus, (const uint8_t *)&frame, sizeof frame),
		                 cases[i].part);
	}
	drop(f);
}

static void the_mode_counts_when_acknowledged(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(10)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "045#0001000000");
	assert_string_equal(lost(f), "=timeout");
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(10)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "045#0001000000");
	assert_string_equal(answer(f, "006#02"), "065#01000A");
	assert_string_equal(lost(f), "145#00");
	f->now += 201 * MS;
	assert_string_equal(tell(f, 0, 0, ON | STILL), "=indeterminate");
	driver->gone(f->device);
	poll(f, 0, 0, ON | STILL);
	assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
	drop(f);
}

static void without_power_nothing_is_staged(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, 10);
	poll(f, 0, 0, STILL);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(10)), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=refused");
	/* Its power went unasked: which mode it is in is not known any more. */
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(0)), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=refused");
	drop(f);
}

static void a_bridge_that_may_not_change_modes(void **unused)
{
	struct fixture *f = make();
	struct db_args args = velocity(10);

	(void)unused;
	option(f, "allow-mode-change", 0);
	assert_int_equal(driver->check(&f->bus, &f->drive, DB_CMD_MOVE_VELOCITY, &args),
	                 DB_RESULT_UNSUPPORTED);
	option(f, "mode", 2);
	assert_int_equal(driver->check(&f->bus, &f->drive, DB_CMD_MOVE_VELOCITY, &args),
	                 DB_RESULT_OK);
	assert_int_equal(driver->check(&f->bus, &f->drive, DB_CMD_MOVE_CURRENT, &args),
	                 DB_RESULT_UNSUPPORTED);
	switch_on(f);
	for (int i = 0; i < 2; i++) {
		poll(f, 0, 0, ON | STILL);
		assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, args), "145#00");
		assert_string_equal(tell(f, 0, 0, ON | STILL), "065#01000A");
		driver->gone(f->device);
	}
	drop(f);
}

/* --- stopping ------------------------------------------------------------------------------------ */

static void stop_is_speed_0(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, 100);
	poll(f, 0, 100, ON);
	assert_string_equal(plain(f, DB_CMD_STOP), "065#010000");
	assert_string_equal(answer(f, "006#040064"), "=ok");
	assert_string_equal(state(f), "Stopping");
	poll(f, 0, 0, ON | STILL);
	assert_string_equal(state(f), "Standstill");
	drop(f);
}

static void stop_in_current_mode_is_current_0(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_current(f, 1);
	assert_string_equal(f->said, "065#02000A");
	assert_string_equal(answer(f, "006#050000"), "145#00");
	assert_string_equal(tell_current(f, 10), "=ok");
	assert_string_equal(plain(f, DB_CMD_QUICK_STOP), "065#020000");
	assert_string_equal(answer(f, "006#050000"), "=ok");
	drop(f);
}

static void a_stop_that_is_refused_takes_the_power(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, 100);
	assert_string_equal(plain(f, DB_CMD_STOP), "065#010000");
	assert_string_equal(answer(f, "006#02"), "ignored");
	assert_string_equal(answer(f, "006#040064"), "=ok");
	assert_string_equal(plain(f, DB_CMD_STOP), "065#010000");
	assert_string_equal(answer(f, "006#02"), "ignored");
	/* Nothing else came, and it is told again. */
	assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
	assert_string_equal(answer(f, "006#02"), "145#00");
	assert_string_equal(tell(f, 0, 0, ON), "145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=ok");
	drop(f);
}

static void stop_in_an_unknown_mode_takes_the_power(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=ok");
	drop(f);
}

/* The zero speed bit of many drives has a threshold: 20 rpm is a motion. */
static void a_slow_motor_moves(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	poll(f, 0, 20, ON | STILL);
	assert_true(feedback(f).status & DB_STATUS_MOVING);
	assert_string_equal(state(f), "ContinuousMotion");
	/* One that trembles while it is held stands; but not when it is told to run so slowly. */
	poll(f, 0, -1, ON | STILL);
	assert_false(feedback(f).status & DB_STATUS_MOVING);
	poll(f, 0, -1, ON);
	assert_true(feedback(f).status & DB_STATUS_MOVING);
	run(f, 3);
	poll(f, 0, 1, ON | STILL);
	assert_true(feedback(f).status & DB_STATUS_MOVING);
	drop(f);
}

/* --- position moves -------------------------------------------------------------------------------- */

/* From where a move begins to the rise of CTRG. The mode is changed at the place where it stands. */
static void raise_ctrg(struct fixture *f, int32_t target)
{
	char text[32];

	snprintf(text, sizeof text, "085#%08X", (unsigned)target);
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(target)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "085#000003E8");
	assert_string_equal(answer(f, "006#06"), "045#0000000000");
	assert_string_equal(answer(f, "006#02"), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), text);
	assert_true(f->exchange.repeatable);
	assert_string_equal(answer(f, "006#06"), "0A5#00080000");
	assert_false(f->exchange.repeatable);
}

/* To its end as a command: it is seen to get on. */
static void start_move(struct fixture *f, int32_t target)
{
	raise_ctrg(f, target);
	assert_string_equal(answer(f, "006#07"), "145#00");
	assert_string_equal(tell(f,
	                         1000 + (target > 1000 ? 2 :
	                                 target < 1000 ? -2 :
	                                                 0),
	                         0, ON | STILL | THERE),
	                    "=ok");
	if (target == 1000)
		return;
	assert_string_equal(state(f), "DiscreteMotion");
	assert_true(feedback(f).status & DB_STATUS_MOVING);
	assert_true(feedback(f).has_target);
	assert_int_equal(feedback(f).target, target);
}

static void an_absolute_move(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	start_move(f, -70000);
	poll(f, 0, -500, ON);
	/* "Reached" may be of the last target, or of the reference's way: the motor is not there. */
	poll(f, -60000, -500, ON | THERE);
	assert_string_equal(state(f), "DiscreteMotion");
	assert_false(feedback(f).status & DB_STATUS_AT_TARGET);
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	/* And without it, it is. */
	assert_string_equal(tell(f, -70000, 0, ON | STILL), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "=ok");
	assert_string_equal(state(f), "Standstill");
	assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
	/* The next one finds mode and trigger as it needs them. */
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(2)), "145#00");
	assert_string_equal(tell(f, -70000, 0, ON | STILL | THERE), "085#00000002");
	assert_string_equal(answer(f, "006#06"), "0A5#00080000");
	drop(f);
}

/* Else no poll would come to its end, and no stop could be seen to have had its effect. */
static void polls_end_though_nothing_acknowledges_that_ctrg_falls(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	start_move(f, 2000);
	poll(f, 1500, 500, ON);
	/* One that was lost is said again at once. */
	for (unsigned i = 0; i < 2; i++) {
		assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
		assert_string_equal(tell(f, 2000, 0, ON | STILL), "0A5#00000000");
		assert_string_equal(lost(f), "=timeout");
	}
	for (unsigned i = 0; i < 40; i++)
		poll(f, 2000, 0, ON | STILL);
	f->now += 1001 * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 2000, 0, ON | STILL), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "145#07");
	drop(f);
}

/* Word 0 at the wrong byte, or a drive whose address 0x1070 is not 4: acknowledged, and nothing else. */
static void a_move_without_motion_has_failed(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	raise_ctrg(f, 5000);
	assert_string_equal(answer(f, "006#07"), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "145#00");
	assert_string_equal(tell(f, 1001, 0, ON | STILL | THERE), "145#00");
	f->now += 201 * MS;
	/* It may only be slow: it must not begin when its writer has been told that it failed. */
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "145#00");
	/* CTRG is dropped, so that the next one rises. */
	assert_string_equal(tell(f, 1000, 0, STILL | THERE), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "=failed");
	assert_string_equal(state(f), "Disabled");
	assert_false(feedback(f).status & DB_STATUS_AT_TARGET);
	drop(f);
}

/* A drive that must not lose its power is followed when it begins yet. */
static void a_late_move_may_be_followed(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	set_words(f);
	option(f, "late-move", 1);
	switch_on(f);
	poll(f, 1000, 0, ON | STILL | THERE);
	raise_ctrg(f, 5000);
	assert_string_equal(answer(f, "006#07"), "145#00");
	f->now += 201 * MS;
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "=indeterminate");
	f->now += 200 * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "145#07");
	assert_string_equal(answer(f, "225#0000"), "=ok");
	assert_string_equal(state(f), "Standstill");
	poll(f, 1100, 50, ON);
	assert_string_equal(state(f), "DiscreteMotion");
	assert_int_equal(feedback(f).target, 5000);
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(9)), "145#00");
	assert_string_equal(tell(f, 1200, 50, ON), "=busy");
	poll(f, 5000, 0, ON | STILL);
	assert_string_equal(state(f), "Standstill");
	assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
	/* Where the power is gone there is nothing to be followed. */
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(9)), "145#00");
	assert_string_equal(tell(f, 5000, 0, ON | STILL), "085#00000009");
	assert_string_equal(answer(f, "006#06"), "0A5#00080000");
	assert_string_equal(answer(f, "006#07"), "145#00");
	assert_string_equal(tell(f, 5000, 0, STILL), "025#0001");
	drop(f);
}

/* Where not even that can be seen, nobody claims that it will not move. */
static void a_move_that_cannot_be_ended_is_indeterminate(void **unused)
{
	static const bool acknowledged[] = { false, true };

	(void)unused;
	for (size_t i = 0; i < 2; i++) {
		struct fixture *f = make_positioner();

		raise_ctrg(f, 5000);
		assert_string_equal(answer(f, "006#07"), "145#00");
		f->now += 201 * MS;
		assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "025#0001");
		if (acknowledged[i]) {
			assert_string_equal(answer(f, "006#01"), "145#00");
			f->now += 201 * MS;
			assert_string_equal(tell(f, 1000, 0, ON | STILL), "=indeterminate");
		} else {
			assert_string_equal(lost(f), "=indeterminate");
		}
		/* A stop does not believe that it stands for good. */
		f->now += 400 * MS;
		assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
		tell(f, 1000, 0, ON | STILL);
		assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
		drop(f);
	}
}

/* It got stuck on its way: it does not move any more, and is not there. */
static void a_move_that_ends_elsewhere_is_not_there(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	start_move(f, 5000);
	poll(f, 3000, 0, ON | STILL | THERE);
	assert_string_equal(state(f), "DiscreteMotion");
	f->now += 200 * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 3000, 0, ON | STILL | THERE), "0A5#00000000");
	assert_string_equal(state(f), "Standstill");
	assert_true(feedback(f).has_target);
	assert_false(feedback(f).status & DB_STATUS_AT_TARGET);
	drop(f);
}

static void in_position_window_counts(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	set_words(f);
	f->drive.in_position_window = 0.5;
	f->drive.counts_per_unit = 10;
	switch_on(f);
	poll(f, 1000, 0, ON | STILL);
	raise_ctrg(f, 5000);
	assert_string_equal(answer(f, "006#07"), "145#00");
	/* As far off as counts as being there is no motion. */
	assert_string_equal(tell(f, 1005, 0, ON | STILL | THERE), "145#00");
	assert_string_equal(tell(f, 1006, 0, ON | STILL | THERE), "=ok");
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 4994, 0, ON | STILL), "=ok");
	assert_string_equal(state(f), "DiscreteMotion");
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 4995, 0, ON | STILL), "0A5#00000000");
	assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
	drop(f);
}

static void a_move_to_where_it_is_ends_too(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	start_move(f, 1000);
	assert_string_equal(state(f), "Standstill");
	assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "0A5#00000000");
	/* The drop was lost: the next poll drops it again. */
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "=ok");
	drop(f);
}

static void a_relative_move_counts_from_a_fresh_position(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	assert_string_equal(command(f, DB_CMD_MOVE_RELATIVE, to(-20)), "145#00");
	assert_string_equal(tell(f, 1010, 0, ON | STILL | THERE), "085#000003F2");
	assert_string_equal(answer(f, "006#06"), "045#0000000000");
	assert_string_equal(answer(f, "006#02"), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "085#000003DE"); /* 990 */
	assert_string_equal(answer(f, "006#06"), "0A5#00080000");
	assert_string_equal(answer(f, "006#07"), "145#00");
	assert_string_equal(tell(f, 1009, -9, ON), "=ok");
	drop(f);
}

static void a_lost_start_is_looked_up(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	raise_ctrg(f, 1500);
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 1100, 300, ON), "=ok");
	drop(f);
}

/* The target stays the one that was computed first, and CTRG that is up does not rise again. */
static void a_start_that_did_not_arrive_is_sent_again(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	raise_ctrg(f, 1500);
	for (int i = 0; i < 2; i++) {
		assert_string_equal(lost(f), "145#00");
		assert_string_equal(tell(f, 1001, 0, ON | STILL | THERE), "0A5#00080000");
	}
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 1001, 0, ON | STILL | THERE), "=indeterminate");
	drop(f);
}

static void a_move_on_top_of_a_move_is_busy(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	start_move(f, 5);
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(9)), "145#00");
	assert_string_equal(tell(f, 900, -50, ON), "=busy");
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(9)), "145#00");
	assert_string_equal(tell(f, 900, 0, ON), "=busy");
	drop(f);
}

static void moves_need_power(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(9)), "145#00");
	assert_string_equal(tell(f, 900, 0, STILL), "=refused");
	drop(f);
}

static void the_target_must_exist(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	assert_string_equal(command(f, DB_CMD_MOVE_RELATIVE, to(INT32_MAX)), "145#00");
	assert_string_equal(tell(f, 1, 0, ON | STILL), "=out_of_range");
	drop(f);
}

/* The last places that a counter has are places like others. */
static void a_target_may_be_at_the_end_of_the_counter(void **unused)
{
	static const struct {
		int32_t from;
		int32_t way;
		const char *said;
	} cases[] = {
		{ INT32_MAX - 5, 5, "085#7FFFFFFA" },
		{ INT32_MAX - 5, 6, "=out_of_range" },
		{ INT32_MIN + 5, -5, "085#80000005" },
		{ INT32_MIN + 5, -6, "=out_of_range" },
	};

	(void)unused;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make_positioner();

		poll(f, cases[i].from, 0, ON | STILL | THERE);
		assert_string_equal(command(f, DB_CMD_MOVE_RELATIVE, to(cases[i].way)), "145#00");
		assert_string_equal(tell(f, cases[i].from, 0, ON | STILL | THERE), cases[i].said);
		drop(f);
	}
}

static void a_target_that_is_refused_moves_nothing(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(9)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL), "085#000003E8");
	assert_string_equal(answer(f, "006#06"), "045#0000000000");
	assert_string_equal(answer(f, "006#02"), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "085#00000009");
	assert_string_equal(answer(f, "006#03"), "ignored");
	assert_string_equal(lost(f), "=refused");
	assert_string_equal(state(f), "Standstill");
	drop(f);
}

static void only_power_stops_a_move(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	start_move(f, 5);
	poll(f, 900, -50, ON);
	assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 800, -10, 0), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "=ok");
	assert_string_equal(state(f), "Disabled");
	/* Standing in position mode it has nothing to stop, and keeps its power. */
	poll(f, 800, 0, ON | STILL);
	assert_string_equal(plain(f, DB_CMD_STOP), "145#00");
	assert_string_equal(tell(f, 800, 0, ON | STILL), "=ok");
	assert_string_equal(plain(f, DB_CMD_STOP), "145#00");
	assert_string_equal(tell(f, 800, 9, ON), "025#0001");
	drop(f);
}

static void other_places_for_the_words(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "command-word-base", 0x120);
	option(f, "command-word-length", 6);
	option(f, "command-word-0-at", 3);
	option(f, "command-word-1-at", NAN);
	option(f, "command-word-fixed", 0x010203AA);
	option(f, "command-word-ack", 0x0B);
	option(f, "allow-mode-change", 0);
	option(f, "mode", 1);
	switch_on(f);
	poll(f, 0, 0, ON | STILL);
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(9)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "125#0102030000AA");
	assert_string_equal(answer(f, "006#0B"), "085#00000009");
	assert_string_equal(answer(f, "006#06"), "125#0102030008AA");
	drop(f);
}

/* Eight bytes on the ids of speed and current, told apart by byte 0, and acknowledged by nothing. */
static void words_that_nothing_acknowledges(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "command-word-base", 0x60);
	option(f, "command-word-length", 8);
	option(f, "command-word-0-at", 1);
	option(f, "command-word-fixed", 0x030000000000 + 0xA1B2C3D4E5);
	option(f, "command-word-ack", 0);
	option(f, "allow-mode-change", 0);
	option(f, "mode", 1);
	switch_on(f);
	poll(f, 0, 0, ON | STILL);
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(9)), "145#00");
	/* A read behind it shows that the drive was there. */
	assert_string_equal(tell(f, 0, 0, ON | STILL), "065#030000A1B2C3D4E5 145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "085#00000009");
	assert_string_equal(answer(f, "006#06"), "065#030008A1B2C3D4E5 145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
	assert_string_equal(tell(f, 5, 10, ON), "=ok");
	drop(f);
}

/* --- set_position -------------------------------------------------------------------------------- */

/* Demand and position become the same, and a read shows it. */
static void set_position(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	assert_string_equal(command(f, DB_CMD_SET_POSITION, to(-2)), "145#00");
	assert_string_equal(tell(f, 7, 0, STILL), "085#FFFFFFFE");
	assert_string_equal(answer(f, "006#06"), "0E5#FFFFFFFE");
	assert_false(f->exchange.repeatable);
	assert_string_equal(answer(f, "006#09"), "145#00");
	assert_string_equal(tell(f, 7, 0, STILL), "145#00");
	assert_string_equal(tell(f, -2, 0, STILL), "=ok");
	/* Held in an unknown mode, perhaps in position: it could jump, and waiting does not help. */
	assert_string_equal(command(f, DB_CMD_SET_POSITION, to(-2)), "145#00");
	assert_string_equal(tell(f, 7, 0, ON | STILL), "=refused");
	assert_string_equal(command(f, DB_CMD_SET_POSITION, to(-2)), "145#00");
	assert_string_equal(tell(f, 7, 20, 0), "=busy");
	drop(f);
}

static void a_position_that_is_not_taken_is_a_failure(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	assert_string_equal(command(f, DB_CMD_SET_POSITION, to(100)), "145#00");
	assert_string_equal(tell(f, 7, 0, STILL), "085#00000064");
	assert_string_equal(answer(f, "006#06"), "0E5#00000064");
	assert_string_equal(answer(f, "006#09"), "145#00");
	f->now += 201 * MS;
	assert_string_equal(tell(f, 7, 0, STILL), "=failed");
	drop(f);
}

static void a_lost_set_position_is_looked_up(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	assert_string_equal(command(f, DB_CMD_SET_POSITION, to(100)), "145#00");
	assert_string_equal(tell(f, 7, 0, STILL), "085#00000064");
	assert_string_equal(answer(f, "006#06"), "0E5#00000064");
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 100, 0, STILL), "=ok");
	assert_string_equal(command(f, DB_CMD_SET_POSITION, to(0)), "145#00");
	assert_string_equal(tell(f, 100, 0, STILL), "085#00000000");
	assert_string_equal(answer(f, "006#06"), "0E5#00000000");
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 100, 0, STILL), "0E5#00000000");
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 55, 0, STILL), "=indeterminate");
	drop(f);
}

/* --- sync mode ----------------------------------------------------------------------------------- */

static void staged_speeds_begin_together(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "sync", 1);
	set_words(f);
	switch_on(f);
	poll(f, 0, 0, ON | STILL);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(50)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "045#0001000000");
	assert_string_equal(answer(f, "006#02"), "065#010032");
	/* Until the sync frame nothing shows it. */
	assert_string_equal(answer(f, "006#040000"), "=unproven");
	assert_string_equal(state(f), "Standstill");
	assert_string_equal(plain(f, DB_CMD_SYNC_START), "01F# 145#00");
	assert_false(f->exchange.repeatable);
	assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
	assert_string_equal(tell(f, 0, 2, ON), "=ok");
	assert_string_equal(state(f), "ContinuousMotion");
	assert_string_equal(plain(f, DB_CMD_SYNC_START), "01F# 145#00");
	assert_string_equal(lost(f), "=indeterminate");
	/* A speed 0 would need another sync, which starts what others have staged. */
	assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=ok");
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=busy");
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(0)), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "=unproven");
	assert_string_equal(plain(f, DB_CMD_SYNC_START), "01F# 145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=ok");
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "045#0001000000");
	assert_string_equal(answer(f, "006#02"), "025#000A");
	drop(f);
}

/* --- parameters ---------------------------------------------------------------------------------- */

static const char *set(struct fixture *f, size_t count, const struct db_setting *settings)
{
	f->request = (struct db_request){ .setting_count = (uint8_t)count,
		                          .settings = f->settings };
	memcpy(f->settings, settings, count * sizeof settings[0]);
	return begin(f, DB_JOB_SETTINGS);
}

#define ACCELERATION(rpm_s)          \
	{                            \
		0,                   \
		{                    \
			.f = (rpm_s) \
		}                    \
	}
#define DECELERATION(rpm_s)          \
	{                            \
		1,                   \
		{                    \
			.f = (rpm_s) \
		}                    \
	}
#define MAX_SPEED(rpm)             \
	{                          \
		2,                 \
		{                  \
			.u = (rpm) \
		}                  \
	}

static void ramps_are_known_once_written(void **unused)
{
	static const struct db_setting both[] = { ACCELERATION(1000), DECELERATION(65536) };
	static const struct db_setting one[] = { DECELERATION(2) };
	struct fixture *f = make_on(STILL);
	const struct db_nameplate *plate = driver->nameplate(f->device);

	(void)unused;
	assert_int_equal(plate->valid[0], 0);
	/* One alone would set the other to something nobody said. */
	assert_string_equal(set(f, 1, one), "=out_of_range");
	assert_string_equal(set(f, 2, both), "105#000003E800010000");
	/* Nothing reads them back. */
	assert_string_equal(answer(f, "006#0A"), "=unproven");
	assert_int_equal(plate->valid[0], 3);
	assert_true(plate->values[1].f == 65536.0f);
	assert_string_equal(set(f, 1, one), "105#000003E800000002");
	assert_string_equal(lost(f), "=timeout");
	assert_int_equal(plate->valid[0], 0);
	assert_string_equal(set(f, 2, both), "105#000003E800010000");
	assert_string_equal(answer(f, "006#0A"), "=unproven");
	driver->gone(f->device);
	assert_int_equal(plate->valid[0], 0);
	drop(f);
}

static void max_speed_goes_with_the_mode(void **unused)
{
	static const struct db_setting all[] = { MAX_SPEED(3000), ACCELERATION(1),
		                                 DECELERATION(2) };
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	/* With power, in a mode nobody knows: held in position, perhaps. */
	assert_string_equal(set(f, 1, all), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "=refused");
	run(f, 20);
	assert_string_equal(set(f, 1, all), "145#00");
	assert_string_equal(tell(f, 0, 20, ON), "=busy");
	assert_string_equal(plain(f, DB_CMD_STOP), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "=ok");
	assert_string_equal(set(f, 3, all), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "105#0000000100000002");
	assert_string_equal(answer(f, "006#0A"), "045#0001010BB8");
	assert_string_equal(answer(f, "006#02"), "=unproven");
	assert_int_equal(driver->nameplate(f->device)->values[2].u, 3000);
	drop(f);
}

/* Before the first motion no mode is known: without power speed mode is as good as any. */
static void max_speed_comes_before_the_first_motion(void **unused)
{
	static const struct db_setting speed[] = { MAX_SPEED(500) };
	struct fixture *f = make_on(STILL);

	(void)unused;
	assert_string_equal(set(f, 1, speed), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "045#00010101F4");
	assert_string_equal(answer(f, "006#02"), "=unproven");
	assert_int_equal(driver->nameplate(f->device)->values[2].u, 500);
	drop(f);
}

static void set_profile(struct fixture *f)
{
	option(f, "mode", 1);
	option(f, "max-speed", 1500);
	option(f, "ramp-acceleration", 1000);
	option(f, "ramp-deceleration", 2000);
}

/* A drive that was switched off has forgotten what it was told. */
static void a_profile_is_given_each_time_the_drive_comes(void **unused)
{
	struct fixture *f = make();
	const struct db_nameplate *plate;

	(void)unused;
	set_profile(f);
	switch_on(f);
	plate = driver->nameplate(f->device);
	for (int i = 0; i < 2; i++) {
		assert_string_equal(begin(f, DB_JOB_IDENTIFY), "145#00");
		assert_string_equal(tell(f, 0, 0, STILL), "105#000003E8000007D0");
		assert_string_equal(answer(f, "006#0A"), "045#00000105DC");
		assert_string_equal(answer(f, "006#02"), "=ok");
		assert_int_equal(plate->valid[0], 7);
		assert_true(plate->values[0].f == 1000.0f);
		assert_int_equal(plate->values[2].u, 1500);
		assert_false(plate->doubtful);
		driver->gone(f->device);
	}
	drop(f);
}

/* A motor with power keeps its mode; a drive that refuses a part gets the rest, and is asked again. */
static void what_a_profile_lacks_comes_later(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	set_profile(f);
	switch_on(f);
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "105#000003E8000007D0");
	assert_string_equal(answer(f, "006#01"), "ignored");
	assert_string_equal(lost(f), "=ok");
	assert_true(feedback(f).status & DB_STATUS_PARAMS_VALID);
	assert_true(driver->nameplate(f->device)->doubtful);
	/* The next change of the mode brings the speed limit along ... */
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(10)), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "045#00010105DC");
	assert_string_equal(lost(f), "=timeout");
	/* ... and no motor gets power before its drive has all of it. */
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "105#000003E8000007D0");
	assert_string_equal(answer(f, "006#0A"), "045#00000105DC");
	assert_string_equal(answer(f, "006#02"), "085#00000000");
	assert_string_equal(answer(f, "006#06"), "025#000A");
	drop(f);
}

#define WORD_BIT(place, level)       \
	{                            \
		(place),             \
		{                    \
			.u = (level) \
		}                    \
	}

/* Torque limit and speed limit, for instance, hold over every rise of CTRG. */
static void command_words_are_held(void **unused)
{
	static const struct db_setting limits[] = { WORD_BIT(5, 1), WORD_BIT(6, 1),
		                                    WORD_BIT(10, 0x8001) };
	static const struct db_setting less[] = { WORD_BIT(6, 0) };
	static const struct db_setting elsewhere[] = { WORD_BIT(7, 1) };
	struct fixture *f = make_positioner();
	const struct db_nameplate *plate = driver->nameplate(f->device);

	(void)unused;
	assert_string_equal(set(f, 3, limits), "0A5#00308001");
	assert_string_equal(answer(f, "006#07"), "=unproven");
	assert_int_equal(plate->valid[0], 0x7F8);
	assert_int_equal(plate->values[5].u, 1);
	assert_int_equal(plate->values[3].u, 0);
	assert_int_equal(plate->values[10].u, 0x8001);
	assert_string_equal(set(f, 1, less), "0A5#00108001");
	assert_string_equal(answer(f, "006#07"), "=unproven");
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(5000)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | THERE), "085#000003E8");
	assert_string_equal(answer(f, "006#06"), "045#0000000000");
	assert_string_equal(answer(f, "006#02"), "0A5#00108001");
	assert_string_equal(answer(f, "006#07"), "085#00001388");
	assert_string_equal(answer(f, "006#06"), "0A5#00188001");
	assert_string_equal(answer(f, "006#07"), "145#00");
	assert_string_equal(tell(f, 1100, 50, ON), "=ok");
	/* Written while CTRG is up, it stays up. */
	assert_string_equal(set(f, 1, elsewhere), "0A5#00588001");
	assert_string_equal(answer(f, "006#07"), "=unproven");
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 5000, 0, ON | STILL), "0A5#00508001");
	assert_string_equal(answer(f, "006#07"), "=ok");
	/* With another internal position selected CTRG would go to where nobody knows. */
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(7)), "145#00");
	assert_string_equal(tell(f, 5000, 0, ON | STILL), "=refused");
	/* They are given again when the drive comes back. */
	driver->gone(f->device);
	assert_int_equal(plate->valid[0], 0);
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "145#00");
	assert_string_equal(tell(f, 5000, 0, STILL), "0A5#00508001");
	assert_string_equal(answer(f, "006#07"), "=ok");
	assert_int_equal(plate->valid[0], 0x7F8);
	drop(f);
}

/* Nobody knows whether it was taken. What other frames set is known as before. */
static void a_lost_setting_is_unknown_with_all_of_its_frame(void **unused)
{
	static const struct db_setting both[] = { ACCELERATION(1000), DECELERATION(65536) };
	static const struct db_setting ramp[] = { DECELERATION(2) };
	static const struct db_setting word[] = { WORD_BIT(6, 1) };
	struct fixture *f = make_positioner();
	const struct db_nameplate *plate = driver->nameplate(f->device);
	uint32_t generation;

	(void)unused;
	assert_string_equal(set(f, 2, both), "105#000003E800010000");
	assert_string_equal(answer(f, "006#0A"), "=unproven");
	set(f, 1, word);
	assert_string_equal(answer(f, "006#07"), "=unproven");
	assert_int_equal(plate->valid[0], 0x7FB);
	generation = plate->generation;
	assert_string_equal(set(f, 1, ramp), "105#000003E800000002");
	assert_string_equal(lost(f), "=timeout");
	assert_int_equal(plate->valid[0], 0x7F8);
	/* Readers are shown it. */
	assert_true(plate->generation > generation);
	generation = plate->generation;
	assert_string_equal(set(f, 2, both), "105#000003E800010000");
	assert_string_equal(answer(f, "006#0A"), "=unproven");
	assert_true(plate->generation > generation);
	set(f, 1, word);
	assert_string_equal(lost(f), "=timeout");
	assert_int_equal(plate->valid[0], 3);
	drop(f);
}

static void parameters_have_ranges(void **unused)
{
	union db_value value = { .f = 4294967296.0f };

	(void)unused;
	assert_int_equal(driver->check_param(NULL, 0, value), DB_RESULT_OUT_OF_RANGE);
	value.f = NAN;
	assert_int_equal(driver->check_param(NULL, 1, value), DB_RESULT_OUT_OF_RANGE);
	value.f = 0;
	assert_int_equal(driver->check_param(NULL, 1, value), DB_RESULT_OK);
	assert_int_equal(driver->check_param(NULL, 11, value), DB_RESULT_UNSUPPORTED);
}

static void command_words_need_their_settings(void **unused)
{
	struct fixture *f = make();
	union db_value value = { .u = 1 };

	(void)unused;
	assert_int_equal(driver->check_param(&f->bus, 3, value), DB_RESULT_UNSUPPORTED);
	set_words(f);
	assert_int_equal(driver->check_param(&f->bus, 3, value), DB_RESULT_OK);
	assert_int_equal(driver->check_param(&f->bus, 10, value), DB_RESULT_OK);
	value.u = 2;
	assert_int_equal(driver->check_param(&f->bus, 3, value), DB_RESULT_OUT_OF_RANGE);
	option(f, "command-word-1-at", NAN);
	assert_int_equal(driver->check_param(&f->bus, 10, value), DB_RESULT_UNSUPPORTED);
	drop(f);
}

static void identifying_ends_without_parameters(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	assert_false(feedback(f).status & DB_STATUS_PARAMS_VALID);
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=ok");
	assert_true(feedback(f).status & DB_STATUS_PARAMS_VALID);
	assert_int_equal(driver->nameplate(f->device)->valid[0], 0);
	assert_string_equal(plain(f, DB_CMD_READ_PARAMETERS), "145#00");
	assert_string_equal(tell(f, 0, 0, 0), "=ok");
	drop(f);
}

/* --- process data -------------------------------------------------------------------------------- */

static void a_poll_shows_one_moment(void **unused)
{
	struct fixture *f = make();
	db_time moment;

	(void)unused;
	switch_on(f);
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(answer(f, "185#FFFE000F"), "more");
	assert_int_equal(feedback(f).taken, 0);
	assert_string_equal(answer(f, "165#80000000"), "more");
	moment = f->now;
	assert_string_equal(answer(f, "165#800000"), "ignored"); /* too short */
	assert_string_equal(answer(f, "1A5#0105A55A"), "145#07");
	assert_string_equal(answer(f, "1A5#0105A55A"), "ignored");
	assert_string_equal(answer(f, "225#0FFF"), "=ok");
	assert_true(feedback(f).taken < f->now);
	assert_true(feedback(f).taken >= moment - MS);
	assert_int_equal(feedback(f).position, INT32_MIN);
	assert_true(feedback(f).velocity == -2.0f);
	assert_true(feedback(f).current == 1.5f);
	assert_int_equal(feedback(f).drive_status, 0x0105);
	assert_int_equal(feedback(f).inputs, 0xA5);
	assert_int_equal(feedback(f).outputs, 0x5A);
	assert_int_equal(feedback(f).analogue_1, 0x0FFF);
	assert_true(feedback(f).status & DB_STATUS_HOMED);
	drop(f);
}

/* Frames of a question that was sent again do not mix with those of the first time. */
static void halves_of_two_answers_do_not_mix(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(answer(f, "165#00000001"), "more");
	f->exchange.sending++;
	assert_string_equal(answer(f, "185#00000000"), "more");
	assert_string_equal(answer(f, "1A5#00000000"), "more");
	assert_string_equal(answer(f, "165#00000002"), "=ok");
	assert_int_equal(feedback(f).position, 2);
	drop(f);
}

static void reports_that_come_together_are_shown(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	f->now += 10 * MS;
	assert_true(report(f, "1C5#0000007B"));
	assert_int_equal(feedback(f).position, 0);
	f->now += 4 * MS;
	assert_true(report(f, "1E5#00640014"));
	assert_int_equal(feedback(f).position, 123);
	assert_true(feedback(f).velocity == 100.0f);
	assert_true(feedback(f).current == 2.0f);
	assert_int_equal(feedback(f).taken, f->now - 4 * MS);
	/* Too far apart: of two moments. */
	f->now += 10 * MS;
	assert_true(report(f, "1C5#000000FF"));
	f->now += 6 * MS;
	assert_true(report(f, "1E5#00010001"));
	assert_int_equal(feedback(f).position, 123);
	/* No answer is taken for a report. */
	assert_false(report(f, "165#00000001"));
	assert_false(report(f, "006#01"));
	assert_false(report(f, "1C5#0000"));
	drop(f);
}

static void reports_save_reads(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	assert_true(driver->wants_poll(f->device, f->now));
	report(f, "1C5#00000001");
	report(f, "1E5#00000000");
	assert_false(driver->wants_poll(f->device, f->now + 30 * MS));
	assert_true(driver->wants_poll(f->device, f->now + 31 * MS));
	/* Status bits are asked for all the same, but nothing else. */
	for (int i = 0; i < 5; i++) {
		f->now += CYCLE_MS * MS;
		report(f, "1C5#00000001");
		report(f, "1E5#00000000");
	}
	assert_true(driver->wants_poll(f->device, f->now));
	assert_string_equal(begin(f, DB_JOB_POLL), "145#06");
	assert_string_equal(answer(f, "1A5#00050000"), "145#07");
	assert_string_equal(answer(f, "225#0000"), "=ok");
	assert_false(driver->wants_poll(f->device, f->now));
	drop(f);
}

static void reports_can_be_ignored(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "reports", 1);
	switch_on(f);
	poll(f, 5, 0, STILL);
	report(f, "1C5#00000001");
	report(f, "1E5#00000000");
	assert_int_equal(feedback(f).position, 5);
	assert_true(driver->wants_poll(f->device, f->now));
	drop(f);
}

/* Some drives tell how fast, and only bits 14 and 15 which way. */
static void a_speed_without_a_sign_has_its_bits(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "speed-sign", 1);
	switch_on(f);
	poll(f, 1000, 300, ON | SERVO_CAN_ST_REVERSE);
	assert_true(feedback(f).velocity == -300.0f);
	poll(f, 1000, 300, ON | SERVO_CAN_ST_FORWARD);
	assert_true(feedback(f).velocity == 300.0f);
	poll(f, 1000, -300, ON | SERVO_CAN_ST_FORWARD);
	assert_true(feedback(f).velocity == 300.0f);
	/* Below the threshold of both the way tells. */
	poll(f, 999, 2, ON);
	assert_true(feedback(f).velocity == -2.0f);
	poll(f, 1001, 2, ON);
	assert_true(feedback(f).velocity == 2.0f);
	/* Reports lack the bits. */
	report(f, "1C5#00000001");
	report(f, "1E5#012C0000");
	assert_int_equal(feedback(f).position, 1001);
	drop(f);
}

/* The one that it has also tells the other way, by being clear. */
static void one_bit_tells_both_directions(void **unused)
{
	static const struct {
		const char *missing;
		uint16_t backwards;
		uint16_t forwards;
	} cases[] = {
		{ "reverse-bit", 0, SERVO_CAN_ST_FORWARD },
		{ "forward-bit", SERVO_CAN_ST_REVERSE, 0 },
	};

	(void)unused;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture *f = make();

		option(f, "speed-sign", 1);
		option(f, cases[i].missing, -1);
		switch_on(f);
		poll(f, 1000, 300, ON | cases[i].forwards);
		assert_true(feedback(f).velocity == 300.0f);
		/* Whatever the way says, which may be that of a moment ago. */
		poll(f, 1001, 300, ON | cases[i].backwards);
		assert_true(feedback(f).velocity == -300.0f);
		drop(f);
	}
}

static void an_older_read_does_not_replace_a_report(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(answer(f, "165#00000001"), "more");
	f->now += MS;
	report(f, "1C5#00000002");
	report(f, "1E5#00000000");
	assert_string_equal(answer(f, "185#00000000"), "more");
	assert_string_equal(answer(f, "1A5#00000000"), "=ok");
	assert_int_equal(feedback(f).position, 2);
	drop(f);
}

/* --- faults -------------------------------------------------------------------------------------- */

static void faults_have_names(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	assert_true(isnan((double)feedback(f).supply_voltage));
	for (unsigned bit = 0; bit < 16; bit++) {
		char text[32];

		snprintf(text, sizeof text, "205#01E0FFF0%04X", 1u << bit);
		assert_true(report(f, text));
		assert_string_equal(state(f), "ErrorStop");
		assert_string_equal(db_error_name(&db_driver_servo_can, feedback(f).error),
		                    servo_can_faults[bit].name);
		assert_int_equal(feedback(f).fault_bits, 1u << bit);
	}
	assert_int_equal(feedback(f).supply_voltage_raw, 0x01E0);
	assert_int_equal(feedback(f).temperature_raw, 0xFFF0);
	assert_true(report(f, "205#01E0FFF00000"));
	assert_string_equal(state(f), "Standstill");
	drop(f);
}

#define UNDERVOLTAGE "205#01E000230001"
#define HEALTHY "205#01E000230000"
#define ALARM SERVO_CAN_ST_ERROR

/* On a fault speed and current become 0, and the power is taken off: some drives keep both, and go on
 * when the fault is gone. */
static void a_fault_takes_the_speed_and_the_power(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, 800);
	assert_true(report(f, UNDERVOLTAGE));
	assert_true(driver->wants_poll(f->device, f->now));
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "025#0001");
	/* Gone again already: what was begun is done all the same. */
	assert_true(report(f, HEALTHY));
	assert_string_equal(answer(f, "006#01"), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "145#00");
	/* Not off yet: said again with the next poll. */
	assert_string_equal(tell(f, 0, 0, ON | STILL), "=ok");
	assert_true(driver->wants_poll(f->device, f->now));
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=ok");
	assert_string_equal(state(f), "Disabled");
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=ok");
	drop(f);
}

static void what_a_fault_does_is_a_setting(void **unused)
{
	static const double settings[] = { 0, 1 }; /* none, stop */

	(void)unused;
	for (size_t i = 0; i < 2; i++) {
		struct fixture *f = make();

		option(f, "on-fault", settings[i]);
		set_words(f);
		switch_on(f);
		poll(f, 1000, 0, ON | STILL);
		/* A stop in speed mode is speed 0. */
		run(f, 800);
		report(f, UNDERVOLTAGE);
		assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
		assert_string_equal(tell(f, 1000, 0, ON | STILL), "065#010000");
		assert_string_equal(answer(f, "006#040000"), "=ok");
		report(f, HEALTHY);
		/* In a position move it takes the power. */
		assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(5000)), "145#00");
		assert_string_equal(tell(f, 1000, 0, ON | STILL), "085#000003E8");
		assert_string_equal(answer(f, "006#06"), "045#0000000000");
		assert_string_equal(answer(f, "006#02"), "0A5#00000000");
		assert_string_equal(answer(f, "006#07"), "085#00001388");
		assert_string_equal(answer(f, "006#06"), "0A5#00080000");
		assert_string_equal(answer(f, "006#07"), "145#00");
		assert_string_equal(tell(f, 1100, 50, ON), "=ok");
		report(f, UNDERVOLTAGE);
		assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
		assert_string_equal(tell(f, 1100, 50, ON), i == 0 ? "=ok" : "025#0001");
		/* Its target is where it still goes, as long as it has its power. */
		assert_true(feedback(f).has_target);
		assert_int_equal(feedback(f).target, 5000);
		if (i == 1) {
			assert_string_equal(answer(f, "006#01"), "145#00");
			assert_string_equal(tell(f, 1100, 0, STILL), "0A5#00000000");
			assert_string_equal(answer(f, "006#07"), "=ok");
			assert_false(feedback(f).has_target);
		}
		drop(f);
	}
}

/* Nothing begins while a fault is there, or may be: the error bit comes before its reason. */
static void no_motion_with_a_fault(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	report(f, UNDERVOLTAGE);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(800)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL), "=refused");
	assert_string_equal(command(f, DB_CMD_MOVE_CURRENT, current(1)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL), "=refused");
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(1)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL), "=refused");
	report(f, HEALTHY);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(800)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | ALARM), "=refused");
	/* Whatever a report says: the bit is the fault. */
	f->now += MS;
	report(f, HEALTHY);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(800)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | ALARM), "=refused");
	assert_string_equal(state(f), "ErrorStop");
	drop(f);
	/* Unless it is known to be an alarm, which the report explains. */
	f = make();
	option(f, "error-bit", 1);
	switch_on(f);
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL | ALARM), "025#0001");
	assert_string_equal(state(f), "ErrorStop");
	f->now += MS;
	report(f, HEALTHY);
	assert_string_equal(state(f), "Disabled");
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(800)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL | ALARM), "065#010000");
	report(f, UNDERVOLTAGE);
	assert_string_equal(state(f), "ErrorStop");
	drop(f);
}

/* The bit is there at once, its reason with the next report, which may be a second later or never. */
static void the_error_bit_is_the_fault(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, 300);
	/* While the motor runs it is looked for in every cycle, whatever is reported. */
	report(f, "1C5#00000000");
	report(f, "1E5#012C0000");
	assert_true(driver->wants_poll(f->device, f->now));
	assert_string_equal(begin(f, DB_JOB_POLL), "145#06");
	assert_string_equal(answer(f, "1A5#04010000"), "025#0001");
	assert_string_equal(state(f), "ErrorStop");
	assert_string_equal(db_error_name(&db_driver_servo_can, feedback(f).error),
	                    "unexplained_fault");
	assert_true(feedback(f).status & DB_STATUS_ERROR);
	assert_string_equal(answer(f, "006#01"), "065#010000");
	assert_string_equal(answer(f, "006#040064"), "145#00");
	/* Gone already; what was begun is done all the same. */
	assert_string_equal(tell(f, 0, 0, STILL), "=ok");
	assert_string_equal(state(f), "Disabled");
	assert_int_equal(feedback(f).error, DB_ERROR_NONE);
	/* Another one is another fault, and its reason has a name. */
	f->now += 100 * MS;
	poll(f, 0, 0, STILL);
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL | ALARM), "025#0001");
	report(f, UNDERVOLTAGE);
	assert_string_equal(db_error_name(&db_driver_servo_can, feedback(f).error), "undervoltage");
	drop(f);
}

/* Some drives take the bit of the power away with the fault and give it back, also behind the bridge's 0. */
static void power_may_come_back_behind_a_fault(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	run(f, 300);
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 300, ALARM), "025#0001");
	assert_string_equal(lost(f), "=timeout");
	assert_true(driver->wants_poll(f->device, f->now));
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 250, ALARM), "025#0001");
	assert_string_equal(answer(f, "006#01"), "065#010000");
	assert_string_equal(answer(f, "006#0400FA"), "145#00");
	assert_string_equal(tell(f, 0, 200, ALARM), "=ok");
	drop(f);
}

/* A 0 that is never acknowledged does not keep the power where it is. */
static void a_fault_takes_the_power_when_the_0_is_not_taken(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "on-fault", 1); /* stop */
	switch_on(f);
	poll(f, 0, 0, ON | STILL);
	run(f, 300);
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 300, ON | ALARM), "065#010000");
	assert_string_equal(answer(f, "006#02"), "ignored");
	assert_string_equal(lost(f), "=timeout");
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	assert_string_equal(tell(f, 0, 300, ON | ALARM), "025#0001");
	drop(f);
}

/* --- resets -------------------------------------------------------------------------------------- */

/* The power went and nobody took it: the drive was without supply for a moment, and has forgotten all. */
static void power_that_goes_unasked_is_a_reset(void **unused)
{
	static const struct db_setting ramps[] = { ACCELERATION(1000), DECELERATION(65536) };
	struct fixture *f = make_positioner();

	(void)unused;
	assert_string_equal(set(f, 2, ramps), "105#000003E800010000");
	assert_string_equal(answer(f, "006#0A"), "=unproven");
	run(f, 300);
	assert_string_equal(plain(f, DB_CMD_STOP), "065#010000");
	assert_string_equal(answer(f, "006#040064"), "=ok");
	poll(f, 5000, 0, ON | STILL);
	poll(f, 5000, 0, STILL);
	poll(f, 5000, 0, STILL);
	assert_int_equal(driver->nameplate(f->device)->valid[0], 0);
	assert_true(driver->nameplate(f->device)->doubtful);
	/* Which mode it is in is as unknown as at first. */
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 5000, 0, STILL), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "065#020000");
	/* Another program may have left it up. */
	assert_string_equal(answer(f, "006#050000"), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "085#00001388");
	/* Some drives take that only when CTRG rises, which without power moves nothing. */
	assert_string_equal(answer(f, "006#06"), "0A5#00080000");
	assert_false(f->exchange.begins);
	assert_false(f->exchange.repeatable);
	assert_string_equal(answer(f, "006#07"), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "025#000A");
	drop(f);
}

/* Taken from all drives of a bus with one frame, and then from this one. */
static void power_that_all_drives_lose_is_no_reset(void **unused)
{
	static const struct db_setting ramps[] = { ACCELERATION(1000), DECELERATION(65536) };
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	assert_string_equal(set(f, 2, ramps), "105#000003E800010000");
	assert_string_equal(answer(f, "006#0A"), "=unproven");
	poll(f, 0, 0, STILL);
	assert_string_equal(plain(f, DB_CMD_DISABLE), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "=ok");
	poll(f, 0, 0, STILL);
	assert_int_equal(driver->nameplate(f->device)->valid[0], 3);
	drop(f);
}

/* Without power a reset does not show, so all is said each time. */
static void all_is_said_before_the_power(void **unused)
{
	static const struct db_setting ramps[] = { ACCELERATION(1000), DECELERATION(65536),
		                                   MAX_SPEED(3000) };
	struct fixture *f = make();

	(void)unused;
	option(f, "mode", 2); /* speed */
	switch_on(f);
	poll(f, 0, 0, STILL);
	assert_string_equal(set(f, 3, ramps), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "105#000003E800010000");
	assert_string_equal(answer(f, "006#0A"), "045#0001010BB8");
	assert_string_equal(answer(f, "006#02"), "=unproven");
	for (int i = 0; i < 2; i++) {
		assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
		assert_string_equal(tell(f, 0, 0, STILL), "105#000003E800010000");
		assert_string_equal(answer(f, "006#0A"), "045#0001010BB8");
		assert_string_equal(answer(f, "006#02"), "065#010000");
		assert_true(f->exchange.repeatable);
		assert_string_equal(answer(f, "006#040000"), "025#000A");
		assert_string_equal(answer(f, "006#01"), "145#00");
		assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
		f->now += 201 * MS;
		assert_string_equal(tell(f, 0, 0, ON | STILL), "=ok");
		assert_string_equal(plain(f, DB_CMD_DISABLE), "025#0001");
		assert_string_equal(answer(f, "006#01"), "145#00");
		assert_string_equal(tell(f, 0, 0, STILL), "=ok");
	}
	/* What took the power was asked for. */
	poll(f, 0, 0, STILL);
	assert_int_equal(driver->nameplate(f->device)->valid[0], 7);
	/* Without the 0 there is no power. */
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "105#000003E800010000");
	assert_string_equal(answer(f, "006#0A"), "045#0001010BB8");
	assert_string_equal(answer(f, "006#02"), "065#010000");
	assert_string_equal(lost(f), "=timeout");
	drop(f);
}

/* Where the modes of a drive are its own, its speed limit comes with that for speeds. */
static void a_speed_limit_without_a_mode_is_said_before_the_power(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "max-speed", 1500);
	switch_on(f);
	poll(f, 0, 0, STILL);
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "045#00010105DC");
	assert_string_equal(answer(f, "006#02"), "065#010000");
	drop(f);
}

static void command_words_are_said_before_the_power(void **unused)
{
	static const struct db_setting limit[] = { WORD_BIT(5, 1) };
	struct fixture *f = make();

	(void)unused;
	set_words(f);
	switch_on(f);
	poll(f, 0, 0, STILL);
	assert_string_equal(set(f, 1, limit), "0A5#00100000");
	assert_string_equal(answer(f, "006#07"), "=unproven");
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 0, 0, STILL), "0A5#00100000");
	drop(f);
}

/* The profile's mode, also where a position move has left another. */
static void enabling_goes_back_to_the_mode_of_the_profile(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	set_words(f);
	option(f, "mode", 2); /* speed */
	switch_on(f);
	poll(f, 1000, 0, ON | STILL | THERE);
	start_move(f, 1000);
	assert_string_equal(plain(f, DB_CMD_DISABLE), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 1000, 0, STILL), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "=ok");
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 1000, 0, STILL), "045#0001000000");
	assert_string_equal(answer(f, "006#02"), "065#010000");
	assert_string_equal(answer(f, "006#040000"), "025#000A");
	drop(f);
}

/* A drive that has no use for CTRG before it has power is watched like others. */
static void a_demand_that_is_not_loaded_is_no_obstacle(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	set_words(f);
	option(f, "mode", 1); /* position */
	switch_on(f);
	poll(f, 1000, 0, STILL);
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 1000, 0, STILL), "045#0000000000");
	assert_string_equal(answer(f, "006#02"), "0A5#00000000");
	assert_string_equal(lost(f), "085#000003E8");
	assert_string_equal(answer(f, "006#06"), "0A5#00080000");
	assert_string_equal(lost(f), "0A5#00000000");
	assert_string_equal(lost(f), "025#000A");
	/* A stop that comes while it is watched takes the power, though it stands, and before it shows. */
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 1000, 0, STILL), "145#00");
	assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(plain(f, DB_CMD_ENABLE), "145#00");
	assert_string_equal(tell(f, 1000, 0, STILL), "045#0000000000");
	assert_string_equal(answer(f, "006#02"), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "085#000003E8");
	assert_string_equal(answer(f, "006#06"), "0A5#00080000");
	assert_string_equal(answer(f, "006#07"), "0A5#00000000");
	assert_string_equal(answer(f, "006#07"), "025#000A");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON | STILL), "145#00");
	assert_string_equal(plain(f, DB_CMD_STOP), "025#0001");
	drop(f);
}

static void warnings_are_no_faults(void **unused)
{
	struct fixture *f = make_on(ON | STILL | SERVO_CAN_ST_WARNING);

	(void)unused;
	assert_string_equal(state(f), "Standstill");
	assert_true(feedback(f).status & DB_STATUS_WARNING);
	assert_int_equal(feedback(f).error, DB_ERROR_NONE);
	assert_string_equal(plain(f, DB_CMD_CLEAR_FAULT), "=unsupported");
	drop(f);
}

static void health_is_scaled(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "voltage-scale", 0.1);
	option(f, "temperature-scale", 0.5);
	option(f, "temperature-offset", -40);
	switch_on(f);
	poll(f, 0, 0, STILL);
	report(f, "205#01E0FFEC0000");
	assert_true(fabs((double)feedback(f).temperature + 50.0) < 1e-4);
	report(f, "205#01E000A00000");
	assert_true(fabs((double)feedback(f).supply_voltage - 48.0) < 1e-4);
	assert_true(fabs((double)feedback(f).temperature - 40.0) < 1e-4);
	assert_int_equal(feedback(f).supply_voltage_raw, 480);
	drop(f);
}

/* --- the bus's side ------------------------------------------------------------------------------ */

static enum db_frame accept_frame(const struct fixture *f, const char *text, int *address)
{
	struct db_can_frame frame = frame_of(text);

	*address = -1;
	return driver->accept(&f->bus, (const uint8_t *)&frame, sizeof frame, address);
}

static void frames_tell_their_node(void **unused)
{
	struct fixture *f = make();
	int address;

	(void)unused;
	assert_int_equal(accept_frame(f, "006#01", &address), DB_FRAME_GOOD);
	assert_int_equal(address, 5);
	assert_int_equal(accept_frame(f, "020#01", &address), DB_FRAME_GOOD);
	assert_int_equal(address, 31);
	assert_int_equal(accept_frame(f, "006#7F", &address), DB_FRAME_GOOD);
	assert_int_equal(accept_frame(f, "17F#00000000", &address), DB_FRAME_GOOD);
	assert_int_equal(address, 31);
	assert_int_equal(accept_frame(f, "161#000000", &address), DB_FRAME_BAD);
	assert_int_equal(accept_frame(f, "0A1#00", &address), DB_FRAME_FOREIGN);
	assert_int_equal(accept_frame(f, "160#00000000", &address), DB_FRAME_FOREIGN);
	drop(f);
}

static void filters_pass_what_drives_send(void **unused)
{
	static const uint32_t wanted[] = { 0x002, 0x020, 0x161, 0x17F, 0x181, 0x1A1,
		                           0x1C1, 0x1E1, 0x201, 0x23F, 0x221 };
	struct db_can_filter filters[DB_FILTERS_MAX];
	struct fixture *f = make();
	size_t count = driver->filters(&f->bus, filters);
	struct db_can_frame frame = { 0 };

	(void)unused;
	assert_true(count > 0 && count <= DB_FILTERS_MAX);
	for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
		frame.id = wanted[i];
		assert_true(db_can_filter_passes(filters, count, &frame));
		frame.id |= DB_CAN_EXTENDED;
		assert_false(db_can_filter_passes(filters, count, &frame));
	}
	frame.id = 0x141;
	assert_false(db_can_filter_passes(filters, count, &frame));
	drop(f);
}

static void padded_frames(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	option(f, "padded", 1);
	option(f, "ack-base", 0x300);
	switch_on(f);
	assert_string_equal(begin(f, DB_JOB_PROBE), "145#0700000000000000");
	assert_string_equal(answer(f, "225#01"), "ignored");
	/* Whether the drive fills its own frames up does not matter. */
	assert_string_equal(answer(f, "225#0102"), "=ok");
	assert_string_equal(begin(f, DB_JOB_PROBE), "145#0700000000000000");
	assert_string_equal(answer(f, "225#0102000000000000"), "=ok");
	assert_string_equal(plain(f, DB_CMD_DISABLE), "025#0001000000000000");
	assert_string_equal(answer(f, "006#0100000000000000"), "ignored");
	assert_string_equal(answer(f, "305#0100000000000000"), "145#0000000000000000");
	drop(f);
}

static void enable_and_disable_for_all(void **unused)
{
	struct fixture *f = make();

	(void)unused;
	assert_true(driver->broadcast(DB_CMD_DISABLE, &f->bus, &f->exchange));
	assert_string_equal(next(f, DB_STEP_SEND), "020#0001");
	assert_true(driver->broadcast(DB_CMD_ENABLE, &f->bus, &f->exchange));
	assert_string_equal(next(f, DB_STEP_SEND), "020#000A");
	assert_false(driver->broadcast(DB_CMD_STOP, &f->bus, &f->exchange));
	drop(f);
}

static bool interrupt(struct fixture *f, enum db_command code)
{
	return driver->interrupt(f->device, code, &f->exchange);
}

/* Half a frame stops nothing, and must not count as sent. */
static void nothing_is_sent_that_has_no_room(void **unused)
{
	struct fixture *f = make_on(0);

	(void)unused;
	f->exchange.request_size = sizeof(struct db_can_frame) - 1;
	assert_string_equal(begin(f, DB_JOB_PROBE), "=unsupported");
	assert_string_equal(plain(f, DB_CMD_DISABLE), "=unsupported");
	assert_int_equal(f->exchange.request_length, 0);
	f->exchange.request_size++;
	assert_string_equal(plain(f, DB_CMD_DISABLE), "025#0001");
	drop(f);
}

static void an_interrupt_needs_room_for_a_whole_frame(void **unused)
{
	struct fixture *f = make_on(ON | STILL | THERE);

	(void)unused;
	f->exchange.request_size = sizeof(struct db_can_frame) - 1;
	assert_false(interrupt(f, DB_CMD_DISABLE));
	f->exchange.request_size++;
	assert_true(interrupt(f, DB_CMD_DISABLE));
	assert_int_equal(f->exchange.request_length, sizeof(struct db_can_frame));
	assert_int_equal(f->exchange.answer_length, 0);
	drop(f);
}

static void a_stop_while_an_answer_is_outstanding(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	/* In no mode that a 0 stops, and at rest: it keeps its power until that was read. */
	assert_false(interrupt(f, DB_CMD_STOP));
	assert_true(interrupt(f, DB_CMD_DISABLE));
	assert_string_equal(next(f, DB_STEP_SEND), "025#0001");
	run(f, 300.0f);
	assert_true(interrupt(f, DB_CMD_STOP));
	assert_string_equal(next(f, DB_STEP_SEND), "065#010000");
	assert_true(interrupt(f, DB_CMD_DISABLE));
	assert_string_equal(next(f, DB_STEP_SEND), "025#0001");
	/* It turns, and in which mode is not known any more: nothing but the power is sure to stop it. */
	driver->gone(f->device);
	poll(f, 0, 300, ON);
	assert_true(interrupt(f, DB_CMD_STOP));
	assert_string_equal(next(f, DB_STEP_SEND), "025#0001");
	drop(f);
}

static void answers_have_their_length(void **unused)
{
	struct fixture *f = make_on(STILL);

	(void)unused;
	/* On CAN: eight and the data of each frame. */
	begin(f, DB_JOB_POLL);
	assert_int_equal(f->exchange.answer_length, 3 * (8 + 4));
	plain(f, DB_CMD_DISABLE);
	assert_int_equal(f->exchange.answer_length, 8 + 3);
	assert_true(driver->poll_time(&f->bus) > 200 * DB_NS_PER_US);
	assert_true(driver->poll_time(&f->bus) < 2 * MS);
	assert_true(driver->command_time(&f->bus) > driver->poll_time(&f->bus));
	drop(f);
}

/* --- settings -------------------------------------------------------------------------------------- */

static void arguments_have_ranges(void **unused)
{
	static const struct {
		enum db_command command;
		struct db_args args;
		enum db_result result;
	} cases[] = {
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = 32767 }, DB_RESULT_OK },
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = 32768 }, DB_RESULT_OUT_OF_RANGE },
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = -32768 }, DB_RESULT_OUT_OF_RANGE },
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = NAN }, DB_RESULT_OUT_OF_RANGE },
		{ DB_CMD_MOVE_CURRENT, { .target_current = 3276.5f }, DB_RESULT_OK },
		{ DB_CMD_MOVE_CURRENT, { .target_current = -3277 }, DB_RESULT_OUT_OF_RANGE },
		{ DB_CMD_MOVE_ABSOLUTE, { .target_position = INT32_MIN }, DB_RESULT_OK },
		/* No frame carries the speed of a position move. */
		{ DB_CMD_MOVE_ABSOLUTE, { .target_velocity = 1 }, DB_RESULT_OUT_OF_RANGE },
		{ DB_CMD_HOME, { 0 }, DB_RESULT_UNSUPPORTED },
		{ DB_CMD_SAVE_PARAMETERS, { 0 }, DB_RESULT_UNSUPPORTED },
		{ DB_CMD_SYNC_START, { 0 }, DB_RESULT_UNSUPPORTED },
		{ DB_CMD_NONE, { 0 }, DB_RESULT_UNSUPPORTED },
		{ DB_CMD_LIMIT, { 0 }, DB_RESULT_UNSUPPORTED },
	};
	struct fixture *f = make();

	(void)unused;
	set_words(f);
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
		assert_int_equal(
			driver->check(&f->bus, &f->drive, cases[i].command, &cases[i].args),
			cases[i].result);
	drop(f);
}

static void position_moves_wait_for_their_settings(void **unused)
{
	uint64_t moves = DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) |
	                 DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE);
	struct db_args args = to(1);
	struct fixture *f = make();

	(void)unused;
	assert_true((driver->forbidden(&f->bus, &f->drive) & moves) == moves);
	assert_int_equal(driver->check(&f->bus, &f->drive, DB_CMD_MOVE_RELATIVE, &args),
	                 DB_RESULT_UNSUPPORTED);
	set_words(f);
	option(f, "command-word-ack", NAN);
	assert_true((driver->forbidden(&f->bus, &f->drive) & moves) == moves);
	option(f, "command-word-ack", 3);
	assert_true((driver->forbidden(&f->bus, &f->drive) & moves) == 0);
	option(f, "sync", 1);
	assert_true((driver->forbidden(&f->bus, &f->drive) & moves) == moves);
	drop(f);
}

struct complaints {
	unsigned errors;
	unsigned warnings;
	char text[1024];
};

static void complain(void *context, const struct db_drive_config *drive, bool error,
                     const char *format, ...) __attribute__((format(printf, 4, 5)));

static void complain(void *context, const struct db_drive_config *drive, bool error,
                     const char *format, ...)
{
	struct complaints *complaints = context;
	size_t length = strlen(complaints->text);
	va_list arguments;

	(void)drive;
	complaints->errors += error;
	complaints->warnings += !error;
	va_start(arguments, format);
	vsnprintf(complaints->text + length, sizeof complaints->text - length, format, arguments);
	va_end(arguments);
}

static struct complaints check_config(struct fixture *f)
{
	const struct db_drive_config *drives[] = { &f->drive };
	struct complaints complaints = { 0 };

	driver->check_config(&f->bus, drives, 1, complain, &complaints);
	return complaints;
}

static void what_the_check_tells(void **unused)
{
	struct fixture *f = make();
	struct complaints told;

	(void)unused;
	told = check_config(f);
	assert_int_equal(told.errors, 0);
	assert_non_null(strstr(told.text, "position moves are refused"));
	set_words(f);
	told = check_config(f);
	assert_int_equal(told.warnings, 1);
	assert_memory_equal(told.text, "in-position-window is 0", 23);
	f->drive.in_position_window = 1;
	assert_int_equal(check_config(f).warnings, 0);
	option(f, "command-word-length", NAN);
	told = check_config(f);
	assert_int_equal(told.errors, 1);
	assert_memory_equal(told.text, "command-word-length is missing", 30);
	option(f, "command-word-length", 3);
	assert_int_equal(check_config(f).errors, 1);
	set_words(f);
	/* Half of a frame. */
	option(f, "position-slot-ack", 9);
	assert_non_null(strstr(check_config(f).text, "position-slot-base is missing"));
	option(f, "position-slot-ack", NAN);
	option(f, "move-frame-at", 0);
	assert_non_null(strstr(check_config(f).text, "move-frame-base is missing"));
	option(f, "move-frame-at", NAN);
	option(f, "command-word-base", 0x100);
	assert_int_equal(check_config(f).errors, 1);
	set_words(f);
	f->drive.address = 30;
	assert_non_null(strstr(check_config(f).text, "0x1F, which is a sync frame"));
	f->drive.address = 31;
	assert_non_null(strstr(check_config(f).text, "0x20, which is an enable for all"));
	option(f, "ack-base", 0x300);
	assert_int_equal(check_config(f).warnings, 0);
	option(f, "ack-base", 0x160);
	assert_memory_equal(check_config(f).text, "ack-base", 8);
	option(f, "ack-base", 1);
	f->drive.address = 5;
	option(f, "allow-mode-change", 0);
	assert_int_equal(check_config(f).warnings, 1);
	option(f, "mode", 3);
	assert_int_equal(check_config(f).warnings, 0);
	option(f, "max-speed", 3000);
	assert_int_equal(check_config(f).errors, 1);
	option(f, "allow-mode-change", 1);
	assert_int_equal(check_config(f).errors, 0);
	option(f, "ramp-acceleration", 5);
	assert_int_equal(check_config(f).errors, 1);
	option(f, "ramp-deceleration", 5);
	assert_int_equal(check_config(f).errors, 0);
	f->drive.max_velocity = 10;
	f->drive.max_acceleration = 10;
	assert_int_equal(check_config(f).errors, 2);
	option(f, "counts-per-turn", 10000);
	assert_int_equal(check_config(f).errors, 0);
	assert_true(fabs(driver->velocity_counts(&f->drive) * 60 - 10000) < 1e-9);
	drop(f);
}

/* --- a common start ------------------------------------------------------------------------------ */

static const char *for_all(struct fixture *f)
{
	uint8_t bytes[DB_SHORT_REQUEST];
	struct db_exchange all = { .request = bytes, .request_size = sizeof bytes };
	struct db_exchange prepared = f->exchange;

	if (!f->exchange.begins || !driver->begin_all(f->device, &f->exchange, &all))
		return "nothing";
	f->exchange = all;
	next(f, DB_STEP_SEND);
	f->exchange = prepared;
	return f->said;
}

static const char *begun_by_all(struct fixture *f)
{
	f->exchange.begins = false;
	return next(f, driver->begun_by_all(talk(f)));
}

static void a_speed_can_be_said_to_all(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_speed(f, 300.0f, 0);
	assert_string_equal(for_all(f), "060#01012C");
	assert_string_equal(begun_by_all(f), "145#00");
	/* Nobody is waited for to acknowledge it. */
	assert_string_equal(answer(f, "006#040000"), "ignored");
	assert_string_equal(tell(f, 0, 0, ON | STILL), "145#00");
	assert_string_equal(tell(f, 0, 20, ON), "=ok");
	/* What stops is said to each. */
	f->exchange.begins = false;
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, velocity(0.0f)), "065#010000");
	assert_string_equal(for_all(f), "nothing");
	drop(f);
}

static void a_speed_that_was_said_to_all_and_does_not_show_has_failed(void **unused)
{
	struct fixture *f = make_on(ON | STILL);

	(void)unused;
	select_speed(f, 300.0f, 0);
	for (begun_by_all(f); strcmp(f->said, "145#00") == 0;)
		tell(f, 0, 0, ON | STILL);
	/* Nor does it begin later. */
	assert_string_equal(f->said, "065#010000");
	assert_string_equal(answer(f, "006#040000"), "=failed");
	drop(f);
}

static void a_trigger_can_be_said_to_all(void **unused)
{
	struct fixture *f = make_positioner();

	(void)unused;
	command(f, DB_CMD_MOVE_ABSOLUTE, to(5000));
	for (unsigned i = 0; i < 8 && strcmp(for_all(f), "nothing") == 0; i++) {
		next(f, DB_STEP_SEND);
		f->exchange.begins = false;
		if (strcmp(f->said, "145#00") == 0)
			tell(f, 1000, 0, ON | STILL | THERE);
		else
			answer(f, strncmp(f->said, "045", 3) == 0 ? "006#02" :
			          strncmp(f->said, "085", 3) == 0 ? "006#06" :
			                                            "006#07");
	}
	assert_string_equal(for_all(f), "0A0#00080000");
	assert_string_equal(begun_by_all(f), "145#00");
	assert_string_equal(tell(f, 1010, 20, ON), "=ok");
	drop(f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(enable_is_acknowledged_and_then_seen),
		cmocka_unit_test(enabling_does_not_need_an_answer_to_what_is_cleared),
		cmocka_unit_test(enabling_in_position_mode_holds_the_place),
		cmocka_unit_test(a_speed_that_does_not_show_is_unproven),
		cmocka_unit_test(a_motor_that_lost_its_power_does_not_run),
		cmocka_unit_test(a_slow_motor_moves),
		cmocka_unit_test(polls_end_though_nothing_acknowledges_that_ctrg_falls),
		cmocka_unit_test(a_move_without_motion_has_failed),
		cmocka_unit_test(a_move_that_ends_elsewhere_is_not_there),
		cmocka_unit_test(in_position_window_counts),
		cmocka_unit_test(words_that_nothing_acknowledges),
		cmocka_unit_test(a_position_that_is_not_taken_is_a_failure),
		cmocka_unit_test(power_that_does_not_follow_is_a_failure),
		cmocka_unit_test(disable),
		cmocka_unit_test(which_bit_tells_of_power_is_a_setting),
		cmocka_unit_test(other_acknowledgements_decide_nothing),
		cmocka_unit_test(a_speed_is_judged_by_its_effect),
		cmocka_unit_test(a_lost_enable_is_looked_up),
		cmocka_unit_test(a_motor_that_jumps_when_it_gets_power_loses_it),
		cmocka_unit_test(how_a_motor_may_move_when_it_gets_power),
		cmocka_unit_test(a_motor_that_runs_out_gets_no_faster),
		cmocka_unit_test(power_that_does_not_stay_is_a_failure),
		cmocka_unit_test(a_late_move_may_be_followed),
		cmocka_unit_test(a_move_that_cannot_be_ended_is_indeterminate),
		cmocka_unit_test(the_error_bit_is_the_fault),
		cmocka_unit_test(power_may_come_back_behind_a_fault),
		cmocka_unit_test(a_fault_takes_the_power_when_the_0_is_not_taken),
		cmocka_unit_test(power_that_goes_unasked_is_a_reset),
		cmocka_unit_test(power_that_all_drives_lose_is_no_reset),
		cmocka_unit_test(all_is_said_before_the_power),
		cmocka_unit_test(a_speed_limit_without_a_mode_is_said_before_the_power),
		cmocka_unit_test(command_words_are_said_before_the_power),
		cmocka_unit_test(enabling_goes_back_to_the_mode_of_the_profile),
		cmocka_unit_test(a_demand_that_is_not_loaded_is_no_obstacle),
		cmocka_unit_test(a_speed_without_a_sign_has_its_bits),
		cmocka_unit_test(enabling_clears_an_old_speed),
		cmocka_unit_test(an_old_speed_outlives_the_mode),
		cmocka_unit_test(first_speed_selects_the_mode),
		cmocka_unit_test(current_has_its_own_mode),
		cmocka_unit_test(torque_direction_goes_with_every_mode),
		cmocka_unit_test(modes_change_only_at_rest),
		cmocka_unit_test(a_move_whose_first_read_is_lost_was_not_begun),
		cmocka_unit_test(parts_of_an_answer_are_told_apart),
		cmocka_unit_test(the_mode_counts_when_acknowledged),
		cmocka_unit_test(without_power_nothing_is_staged),
		cmocka_unit_test(a_bridge_that_may_not_change_modes),
		cmocka_unit_test(stop_is_speed_0),
		cmocka_unit_test(stop_in_current_mode_is_current_0),
		cmocka_unit_test(a_stop_that_is_refused_takes_the_power),
		cmocka_unit_test(stop_in_an_unknown_mode_takes_the_power),
		cmocka_unit_test(an_absolute_move),
		cmocka_unit_test(a_move_to_where_it_is_ends_too),
		cmocka_unit_test(a_relative_move_counts_from_a_fresh_position),
		cmocka_unit_test(a_lost_start_is_looked_up),
		cmocka_unit_test(a_start_that_did_not_arrive_is_sent_again),
		cmocka_unit_test(a_move_on_top_of_a_move_is_busy),
		cmocka_unit_test(moves_need_power),
		cmocka_unit_test(the_target_must_exist),
		cmocka_unit_test(a_target_may_be_at_the_end_of_the_counter),
		cmocka_unit_test(a_target_that_is_refused_moves_nothing),
		cmocka_unit_test(only_power_stops_a_move),
		cmocka_unit_test(other_places_for_the_words),
		cmocka_unit_test(set_position),
		cmocka_unit_test(a_lost_set_position_is_looked_up),
		cmocka_unit_test(staged_speeds_begin_together),
		cmocka_unit_test(ramps_are_known_once_written),
		cmocka_unit_test(max_speed_goes_with_the_mode),
		cmocka_unit_test(command_words_are_held),
		cmocka_unit_test(a_lost_setting_is_unknown_with_all_of_its_frame),
		cmocka_unit_test(what_a_profile_lacks_comes_later),
		cmocka_unit_test(a_profile_is_given_each_time_the_drive_comes),
		cmocka_unit_test(max_speed_comes_before_the_first_motion),
		cmocka_unit_test(parameters_have_ranges),
		cmocka_unit_test(command_words_need_their_settings),
		cmocka_unit_test(identifying_ends_without_parameters),
		cmocka_unit_test(a_poll_shows_one_moment),
		cmocka_unit_test(halves_of_two_answers_do_not_mix),
		cmocka_unit_test(reports_that_come_together_are_shown),
		cmocka_unit_test(reports_save_reads),
		cmocka_unit_test(reports_can_be_ignored),
		cmocka_unit_test(one_bit_tells_both_directions),
		cmocka_unit_test(an_older_read_does_not_replace_a_report),
		cmocka_unit_test(faults_have_names),
		cmocka_unit_test(no_motion_with_a_fault),
		cmocka_unit_test(what_a_fault_does_is_a_setting),
		cmocka_unit_test(a_fault_takes_the_speed_and_the_power),
		cmocka_unit_test(warnings_are_no_faults),
		cmocka_unit_test(health_is_scaled),
		cmocka_unit_test(frames_tell_their_node),
		cmocka_unit_test(filters_pass_what_drives_send),
		cmocka_unit_test(padded_frames),
		cmocka_unit_test(nothing_is_sent_that_has_no_room),
		cmocka_unit_test(an_interrupt_needs_room_for_a_whole_frame),
		cmocka_unit_test(enable_and_disable_for_all),
		cmocka_unit_test(a_stop_while_an_answer_is_outstanding),
		cmocka_unit_test(answers_have_their_length),
		cmocka_unit_test(arguments_have_ranges),
		cmocka_unit_test(position_moves_wait_for_their_settings),
		cmocka_unit_test(what_the_check_tells),
		cmocka_unit_test(a_speed_can_be_said_to_all),
		cmocka_unit_test(a_speed_that_was_said_to_all_and_does_not_show_has_failed),
		cmocka_unit_test(a_trigger_can_be_said_to_all),
	};

	return cmocka_run_group_tests_name("driver/servo_can", tests, NULL, NULL);
}
