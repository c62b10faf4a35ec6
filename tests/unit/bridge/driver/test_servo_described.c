/* SPDX-License-Identifier: Apache-2.0 */
/* Servos that deviate from the document, as the configuration says: their frames, bits, signs and steps. */
#include "codec/can.h"
#include "drivebridge/axis.h"
#include "drivebridge/driver.h"
#include "driver/list.h"
#include "fakes/options.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static const struct db_driver *const driver = &db_driver_servo_can;

struct fixture {
	struct db_bus_config bus;
	struct db_drive_config drive;
	struct fake_options options;
	struct db_device *device;
	struct db_job job;
	struct db_request request;
	struct db_args args; /* of the request */
	struct db_setting setting;
	struct db_exchange exchange;
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_conversation talk;
	db_time now;
	char said[256]; /* the exchange, as "ID#DATA ID#DATA"; or how it ended, as "=ok" */
};

/* --- a drive at node 5 --------------------------------------------------------------------------------- */

static void option(struct fixture *f, const char *name, double value)
{
	fake_set_option(driver, &f->options, name, value);
}

static struct fixture *make(void)
{
	struct fixture *f = calloc(1, sizeof *f);

	assert_non_null(f);
	f->bus.driver = driver;
	f->bus.cycle_ms = 10;
	f->bus.bitrate = 1000000;
	f->drive.address = 5;
	f->bus.options = f->options.bus;
	f->drive.options = f->options.drive;
	f->drive.counts_per_unit = 1;
	f->drive.in_position_window = 5;
	f->drive.max_velocity = f->drive.max_acceleration = NAN;
	fake_preset_options(driver, &f->options);
	f->exchange.request = f->bytes;
	f->exchange.request_size = sizeof f->bytes;
	f->now = 1000 * MS;
	return f;
}

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

/* --- frames as text ------------------------------------------------------------------------------------- */

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

	if (step == DB_STEP_DONE)
		snprintf(f->said, sizeof f->said, "=%s", db_result_name(f->talk.result));
	else if (step != DB_STEP_SEND)
		snprintf(f->said, sizeof f->said, step == DB_STEP_MORE ? "more" : "ignored");
	if (step != DB_STEP_SEND)
		return f->said;
	f->exchange.sending++;
	for (size_t i = 0; i < f->exchange.request_length; i += sizeof(struct db_can_frame)) {
		struct db_can_frame frame;

		memcpy(&frame, f->exchange.request + i, sizeof frame);
		at += sprintf(at, "%s%03X#", i > 0 ? " " : "", frame.id);
		for (unsigned j = 0; j < frame.length; j++)
			at += sprintf(at, "%02X", frame.data[j]);
	}
	return f->said;
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

static const char *answer(struct fixture *f, const char *text)
{
	struct db_can_frame frame = { .id = (uint32_t)strtoul(text, NULL, 16) };

	for (text = strchr(text, '#') + 1; *text; text += 2) {
		char byte[3] = { text[0], text[1], '\0' };

		frame.data[frame.length++] = (uint8_t)strtoul(byte, NULL, 16);
	}
	f->now += MS / 2;
	f->exchange.begins = f->exchange.again = false;
	return next(f, driver->answer(talk(f), (const uint8_t *)&frame, sizeof frame));
}

static const char *lost(struct fixture *f)
{
	f->now += 30 * MS;
	return next(f, driver->lost(talk(f)));
}

/* All three parts of an answer, raw. */
static const char *tell(struct fixture *f, int32_t position, int16_t speed, uint16_t bits)
{
	char text[32];

	snprintf(text, sizeof text, "165#%08X", (unsigned)position);
	assert_string_equal(answer(f, text), "more");
	snprintf(text, sizeof text, "185#%04X0014", (unsigned)(uint16_t)speed);
	assert_string_equal(answer(f, text), "more");
	snprintf(text, sizeof text, "1A5#%04X0000", (unsigned)bits);
	return answer(f, text);
}

#define ON_AND_STILL 0x0005

static void poll(struct fixture *f, int32_t position, int16_t speed, uint16_t bits)
{
	f->now += 10 * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	if (strcmp(tell(f, position, speed, bits), "145#07") == 0)
		assert_string_equal(answer(f, "225#0123"), "=ok");
	assert_string_equal(f->said, "=ok");
}

static struct db_feedback feedback(const struct fixture *f)
{
	struct db_feedback feedback = { 0 };

	driver->feedback(f->device, &feedback);
	return feedback;
}

static struct db_args to(int32_t position)
{
	return (struct db_args){ .target_position = position };
}

/* --- the frame that moves -------------------------------------------------------------------------------- */

static struct fixture *make_mover(double relative, double ack)
{
	struct fixture *f = make();

	option(f, "move-frame-base", 0x120);
	option(f, "move-frame-length", 6);
	option(f, "move-frame-at", 1);
	option(f, "move-frame-bytes", 4);
	option(f, "move-frame-fixed", 0x5A01);
	option(f, "move-frame-ack", ack);
	option(f, "move-frame-target", relative);
	option(f, "allow-mode-change", 0);
	option(f, "mode", 1);
	switch_on(f);
	poll(f, 1000, 0, ON_AND_STILL);
	return f;
}

static void a_move_has_one_frame(void **state)
{
	struct fixture *f = make_mover(0, 3);

	(void)state;
	assert_string_equal(command(f, DB_CMD_MOVE_ABSOLUTE, to(-2)), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON_AND_STILL), "125#5AFFFFFFFE01");
	assert_false(f->exchange.repeatable);
	assert_string_equal(answer(f, "006#03"), "145#00");
	assert_string_equal(tell(f, 900, -100, 0x0001), "=ok");
	assert_int_equal(feedback(f).state, DB_AXIS_DISCRETE_MOTION);
	poll(f, -1, 0, ON_AND_STILL);
	assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
	assert_int_equal(feedback(f).target, -2);
	drop(f);
}

/* What the drive does shows whether the first one came: it stands, so the same target is said again. */
static void an_absolute_move_that_is_not_acknowledged_is_said_again(void **state)
{
	struct fixture *f = make_mover(0, 3);

	(void)state;
	command(f, DB_CMD_MOVE_ABSOLUTE, to(5000));
	assert_string_equal(tell(f, 1000, 0, ON_AND_STILL), "125#5A0000138801");
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 1000, 0, ON_AND_STILL), "125#5A0000138801");
	assert_string_equal(answer(f, "006#03"), "145#00");
	assert_string_equal(tell(f, 1100, 50, 0x0001), "=ok");
	drop(f);
}

/* A second one would be a second way. */
static void a_relative_move_is_never_said_twice(void **state)
{
	struct fixture *f = make_mover(1, 3);

	(void)state;
	command(f, DB_CMD_MOVE_ABSOLUTE, to(5000));
	assert_string_equal(tell(f, 1010, 0, ON_AND_STILL), "125#5A00000F9601");
	assert_string_equal(lost(f), "145#00");
	assert_string_equal(tell(f, 1010, 0, ON_AND_STILL), "145#00");
	f->now += 250 * MS;
	/* What may still begin loses its power before it is called failed. */
	assert_string_equal(tell(f, 1010, 0, ON_AND_STILL), "025#0001");
	assert_string_equal(answer(f, "006#01"), "145#00");
	assert_string_equal(tell(f, 1010, 0, 0x0004), "=failed");
	drop(f);
}

static void where_nothing_acknowledges_it_a_read_does(void **state)
{
	struct fixture *f = make_mover(0, 0);

	(void)state;
	command(f, DB_CMD_MOVE_RELATIVE, to(10));
	assert_string_equal(tell(f, 1000, 0, ON_AND_STILL), "125#5A000003F201 145#00");
	assert_string_equal(tell(f, 1000, 0, ON_AND_STILL), "145#00");
	assert_string_equal(tell(f, 1010, 0, ON_AND_STILL), "=ok");
	drop(f);
}

static void a_target_in_steps_that_fits(void **state)
{
	struct fixture *f = make();

	(void)state;
	option(f, "move-frame-base", 0x120);
	option(f, "move-frame-length", 2);
	option(f, "move-frame-at", 0);
	option(f, "move-frame-bytes", 2);
	option(f, "move-frame-order", 1);
	option(f, "move-frame-ack", 3);
	option(f, "move-frame-scale", -10);
	option(f, "allow-mode-change", 0);
	option(f, "mode", 1);
	switch_on(f);
	poll(f, 0, 0, ON_AND_STILL);
	command(f, DB_CMD_MOVE_ABSOLUTE, to(2560));
	assert_string_equal(tell(f, 0, 0, ON_AND_STILL), "125#00FF");
	assert_string_equal(answer(f, "006#03"), "145#00");
	assert_string_equal(tell(f, 2560, 0, ON_AND_STILL), "=ok");
	command(f, DB_CMD_MOVE_ABSOLUTE, to(327690));
	assert_string_equal(tell(f, 2560, 0, ON_AND_STILL), "=out_of_range");
	drop(f);
}

/* The demand before the power is said in the same way: what was told last would count. */
static void enable_says_where_it_stands(void **state)
{
	struct fixture *f = make_mover(0, 3);

	(void)state;
	poll(f, 4096, 0, 0x0004);
	assert_string_equal(command(f, DB_CMD_ENABLE, (struct db_args){ 0 }), "145#00");
	assert_string_equal(tell(f, 4096, 0, 0x0004), "125#5A0000100001");
	assert_string_equal(answer(f, "006#03"), "025#000A");
	drop(f);
}

/* --- words, and the internal position ------------------------------------------------------------------- */

static struct fixture *make_worded(void)
{
	struct fixture *f = make();

	option(f, "command-word-base", 0x0A0);
	option(f, "command-word-length", 2);
	option(f, "command-word-0-at", 0);
	option(f, "command-word-ack", 7);
	option(f, "command-word-1-base", 0x0C0);
	option(f, "command-word-1-length", 3);
	option(f, "command-word-1-at", 1);
	option(f, "command-word-1-fixed", 0x5A);
	option(f, "command-word-1-ack", 8);
	option(f, "position-slot", 5);
	option(f, "position-slot-base", 0x120);
	option(f, "position-slot-ack", 11);
	option(f, "allow-mode-change", 0);
	option(f, "mode", 1);
	switch_on(f);
	poll(f, 1000, 0, ON_AND_STILL);
	return f;
}

static void a_move_goes_through_its_internal_position(void **state)
{
	struct fixture *f = make_worded();

	(void)state;
	command(f, DB_CMD_MOVE_ABSOLUTE, to(2000));
	assert_string_equal(tell(f, 1000, 0, ON_AND_STILL), "0A5#0140");
	assert_string_equal(answer(f, "006#07"), "125#000007D0");
	assert_string_equal(answer(f, "006#0B"), "0A5#0148");
	assert_string_equal(answer(f, "006#07"), "145#00");
	assert_string_equal(tell(f, 1100, 50, 0x0001), "=ok");
	drop(f);
}

static size_t find_param(const char *name)
{
	size_t i = 0;

	while (strcmp(driver->params[i].name, name) != 0)
		i++;
	return i;
}

static const char *set(struct fixture *f, const char *name, uint32_t value)
{
	f->setting = (struct db_setting){ .param = (uint16_t)find_param(name),
		                          .value = { .u = value } };
	f->request = (struct db_request){ .settings = &f->setting, .setting_count = 1 };
	return begin(f, DB_JOB_SETTINGS);
}

static void each_word_has_its_frame(void **state)
{
	struct fixture *f = make_worded();

	(void)state;
	assert_string_equal(set(f, "command_word_1", 0x8001), "0C5#5A8001");
	assert_string_equal(answer(f, "006#08"), "=unproven");
	assert_int_equal(driver->nameplate(f->device)->values[find_param("command_word_1")].u,
	                 0x8001);
	assert_string_equal(set(f, "zclamp", 1), "0A5#0144");
	/* An acknowledgement of the other frame is none. */
	assert_string_equal(answer(f, "006#08"), "ignored");
	assert_string_equal(answer(f, "006#07"), "=unproven");
	/* A drive that comes back gets both. */
	driver->gone(f->device);
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "145#00");
	assert_string_equal(tell(f, 1000, 0, 0x0004), "0A5#0144");
	assert_string_equal(answer(f, "006#07"), "0C5#5A8001");
	assert_string_equal(answer(f, "006#08"), "=ok");
	drop(f);
}

/* --- bits, signs and steps -------------------------------------------------------------------------------- */

static void status_bits_mean_what_is_said(void **state)
{
	struct fixture *f = make();
	struct db_feedback seen;

	(void)state;
	option(f, "enabled-bit", 3);
	option(f, "fault-bit", 0);
	option(f, "standstill-bit", -1);
	option(f, "homed-bit", 12);
	option(f, "warning-bit", -1);
	option(f, "overload-bit", -1);
	option(f, "limit-bit", 2);
	option(f, "moving-bit", 8);
	option(f, "status-inverted", 0x0108);
	switch_on(f);
	poll(f, 0, 1, 0x1100); /* powered: bit 3 is 0; standing: bit 8 is 1 */
	seen = feedback(f);
	assert_int_equal(seen.state, DB_AXIS_STANDSTILL);
	assert_true(seen.status & DB_STATUS_HOMED);
	assert_false(seen.status & (DB_STATUS_MOVING | DB_STATUS_WARNING));
	assert_int_equal(seen.drive_status, 0x1100);
	poll(f, 0, 0, 0x0000);
	assert_int_equal(feedback(f).state, DB_AXIS_CONTINUOUS_MOTION);
	assert_false(feedback(f).status & DB_STATUS_HOMED);
	poll(f, 0, 0, 0x0104);
	assert_true(feedback(f).status & DB_STATUS_WARNING);
	poll(f, 0, 0, 0x0108);
	assert_int_equal(feedback(f).state, DB_AXIS_DISABLED);
	f->now += 10 * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	(void)tell(f, 0, 0, 0x0109);
	assert_int_equal(feedback(f).state, DB_AXIS_ERROR_STOP);
	drop(f);
}

static void a_move_is_done_with_its_bit(void **state)
{
	struct fixture *f = make();

	(void)state;
	option(f, "command-word-base", 0x0A0);
	option(f, "command-word-length", 2);
	option(f, "command-word-0-at", 0);
	option(f, "command-word-ack", 7);
	option(f, "allow-mode-change", 0);
	option(f, "mode", 1);
	option(f, "target-bit", 4);
	switch_on(f);
	poll(f, 0, 0, ON_AND_STILL);
	command(f, DB_CMD_MOVE_ABSOLUTE, to(100));
	tell(f, 0, 0, ON_AND_STILL);
	answer(f, "006#07");
	answer(f, "006#06");
	answer(f, "006#07");
	assert_string_equal(tell(f, 50, 5, 0x0001), "=ok");
	f->now += 10 * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	tell(f, 100, 0, ON_AND_STILL);
	assert_false(feedback(f).status & DB_STATUS_AT_TARGET);
	assert_int_equal(feedback(f).state, DB_AXIS_DISCRETE_MOTION);
	f->now += 10 * MS;
	assert_string_equal(begin(f, DB_JOB_POLL), "145#00");
	tell(f, 100, 0, ON_AND_STILL | 0x10);
	assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
	assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
	drop(f);
}

static void positions_have_a_sign_and_steps(void **state)
{
	struct fixture *f = make();

	(void)state;
	option(f, "position-sign", 1);
	option(f, "position-command-scale", 4);
	switch_on(f);
	poll(f, 1000, 0, 0x0004);
	assert_int_equal(feedback(f).position, -1000);
	/* Demand in steps, the position itself as the drive reports it. */
	assert_string_equal(command(f, DB_CMD_SET_POSITION, to(-400)), "145#00");
	assert_string_equal(tell(f, 1000, 0, 0x0004), "085#00000064");
	assert_string_equal(answer(f, "006#06"), "0E5#00000190");
	drop(f);
}

static void speeds_and_currents_have_signs_and_steps(void **state)
{
	struct fixture *f = make();
	struct db_args args = { .target_velocity = 60 };

	(void)state;
	option(f, "allow-mode-change", 0);
	option(f, "mode", 2);
	option(f, "speed-scale", -0.5);
	option(f, "speed-command-scale", 0.25);
	option(f, "current-scale", -0.01);
	option(f, "standstill-speed", 2);
	switch_on(f);
	poll(f, 0, 100, 0x0001);
	assert_float_equal(feedback(f).velocity, -50, 0);
	assert_float_equal(feedback(f).current, -0.2, 1e-6);
	/* 4 steps are 2 rpm. */
	poll(f, 0, 4, ON_AND_STILL);
	assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
	poll(f, 0, 5, ON_AND_STILL);
	assert_int_equal(feedback(f).state, DB_AXIS_CONTINUOUS_MOTION);
	poll(f, 0, 0, ON_AND_STILL);
	assert_string_equal(command(f, DB_CMD_MOVE_VELOCITY, args), "145#00");
	assert_string_equal(tell(f, 0, 0, ON_AND_STILL), "065#0100F0");
	assert_string_equal(answer(f, "006#040000"), "145#00");
	assert_string_equal(tell(f, 0, -120, 0x0001), "=ok");
	/* 16 bits of steps of 0.25 rpm. */
	args.target_velocity = 8200;
	assert_int_equal(driver->check(&f->bus, &f->drive, DB_CMD_MOVE_VELOCITY, &args),
	                 DB_RESULT_OUT_OF_RANGE);
	drop(f);
}

/* --- what cannot be ---------------------------------------------------------------------------------------- */

struct told {
	unsigned errors;
	char text[2048];
};

static void complain(void *context, const struct db_drive_config *drive, bool error,
                     const char *format, ...) __attribute__((format(printf, 4, 5)));

static void complain(void *context, const struct db_drive_config *drive, bool error,
                     const char *format, ...)
{
	struct told *told = context;
	size_t length = strlen(told->text);
	va_list arguments;

	(void)drive;
	told->errors += error;
	va_start(arguments, format);
	vsnprintf(told->text + length, sizeof told->text - length, format, arguments);
	va_end(arguments);
}

static const struct {
	struct {
		const char *name;
		double value;
	} options[8];
	const char *message;
} WRONG[] = {
	{ { { "command-word-ack", 1 } },
	  "command-word-base and what belongs to it cannot be: the acknowledgement of the command words "
	  "is 01, which is that of enable" },
	{ { { "move-frame-ack", 7 } },
	  "move-frame-base and what belongs to it cannot be: the acknowledgement of the move frame is 07, "
	  "which is that of the command words" },
	{ { { "move-frame-ack", 10 } }, "is 0A, which is that of the ramps" },
	{ { { "move-frame-base", 0xA0 } },
	  "the move frame and the command words have ids in common, and no fixed byte 0" },
	{ { { "move-frame-base", 0x61 } },
	  "the ids of the move frame belong to a documented frame" },
	{ { { "move-frame-base", 0x60 } },
	  "the move frame and speed and current have the same ids, so byte 0 must be a fixed number" },
	{ { { "move-frame-length", 4 } },
	  "the number in the frame of the move frame does not fit it" },
	{ { { "move-frame-length", NAN } },
	  "move-frame-length is missing, but another setting of the" },
	{ { { "move-frame-scale", 0 } }, "move-frame-scale = 0 makes every target the same" },
	{ { { "command-word-1-base", 0xC0 },
	    { "command-word-1-length", 2 },
	    { "command-word-1-ack", 8 } },
	  "command-word-1-base needs command-word-1-at" },
	{ { { "command-word-1-base", 0xC0 }, { "command-word-1-ack", 8 } },
	  "command-word-1-length is missing" },
	{ { { "position-slot", 3 } },
	  "position-slot = 3 is for moves through an internal position" },
	{ { { "position-slot", 3 },
	    { "move-frame-base", NAN },
	    { "move-frame-length", NAN },
	    { "move-frame-at", NAN },
	    { "move-frame-ack", NAN } },
	  "position-slot = 3 needs the frame that sets internal position 3" },
	{ { { "enabled-bit", 10 } }, "fault-bit = 10 is also enabled-bit" },
	{ { { "speed-scale", 0 } }, "speed-scale = 0 makes every value the same" },
	{ { { "speed-sign", 1 }, { "reverse-bit", -1 }, { "forward-bit", -1 } },
	  "speed-sign = bits needs reverse-bit or forward-bit" },
};

static void what_cannot_be_is_refused_with_what_it_collides(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof WRONG / sizeof WRONG[0]; i++) {
		struct fixture *f = make();
		const struct db_drive_config *drives[] = { &f->drive };
		struct told told = { 0 };

		option(f, "command-word-base", 0x0A0);
		option(f, "command-word-length", 2);
		option(f, "command-word-0-at", 0);
		option(f, "command-word-ack", 7);
		option(f, "move-frame-base", 0x120);
		option(f, "move-frame-length", 5);
		option(f, "move-frame-at", 1);
		option(f, "move-frame-ack", 3);
		driver->check_config(&f->bus, drives, 1, complain, &told);
		if (told.errors > 0)
			fail_msg("%s", told.text);
		for (size_t j = 0; WRONG[i].options[j].name; j++)
			option(f, WRONG[i].options[j].name, WRONG[i].options[j].value);
		/* Byte 0 is the target's then. */
		if (strstr(WRONG[i].message, "so byte 0") ||
		    strstr(WRONG[i].message, "ids in common"))
			option(f, "move-frame-at", 0);
		told = (struct told){ 0 };
		driver->check_config(&f->bus, drives, 1, complain, &told);
		if (told.errors != 1 || !strstr(told.text, WRONG[i].message))
			fail_msg("%zu: %u errors: %s", i, told.errors, told.text);
		drop(f);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_move_has_one_frame),
		cmocka_unit_test(an_absolute_move_that_is_not_acknowledged_is_said_again),
		cmocka_unit_test(a_relative_move_is_never_said_twice),
		cmocka_unit_test(where_nothing_acknowledges_it_a_read_does),
		cmocka_unit_test(a_target_in_steps_that_fits),
		cmocka_unit_test(enable_says_where_it_stands),
		cmocka_unit_test(a_move_goes_through_its_internal_position),
		cmocka_unit_test(each_word_has_its_frame),
		cmocka_unit_test(status_bits_mean_what_is_said),
		cmocka_unit_test(a_move_is_done_with_its_bit),
		cmocka_unit_test(positions_have_a_sign_and_steps),
		cmocka_unit_test(speeds_and_currents_have_signs_and_steps),
		cmocka_unit_test(what_cannot_be_is_refused_with_what_it_collides),
	};

	return cmocka_run_group_tests_name("driver/servo_described", tests, NULL, NULL);
}
