/* SPDX-License-Identifier: Apache-2.0 */
/*
 * VSMD on CAN, the driver alone: which frames each job puts on the wire, written as a person with
 * the document would, and what it makes of the frames that come back. Drive 1, host 1, extended
 * frames: commands are 00080380 + code, status replies 00080200 + register, data replies 00080280 +
 * register.
 */
#include "codec/can.h"
#include "codec/vsmd.h"
#include "codec/vsmd_describe.h"
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

/* Status words: handshake, power, standing or not. */
#define STANDS (VSMD_ST_PWR | VSMD_ST_STP)
#define RUNS (VSMD_ST_PWR)

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
	char said[1024]; /* the exchange, as "ID#DATA ID#DATA" */
};

/* The frames whose time was asked for, as in `said`. */
static char timed[256];

static db_time wire_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	struct db_can_frame frame;
	char *at = timed + strlen(timed);

	(void)bus;
	memcpy(&frame, request, sizeof frame);
	at += sprintf(at, "%08X#", frame.id & DB_CAN_ID_MASK);
	for (unsigned i = 0; i < frame.length; i++)
		at += sprintf(at, "%02X", frame.data[i]);
	sprintf(at, " ");
	return (db_time)(request_length + answer_length) * DB_NS_PER_US;
}

static const struct db_transport wire = { .medium = DB_MEDIUM_CAN, .wire_time = wire_time };

static struct fixture *make_reporting(double standard, double report_ms, double report)
{
	struct fixture *f = calloc(1, sizeof *f);

	assert_non_null(f);
	f->bus.driver = &db_driver_vsmd_can;
	f->bus.transport = &wire;
	f->bus.save_interval_s = 10;
	fake_preset_options(&db_driver_vsmd_can, &f->options);
	fake_set_option(&db_driver_vsmd_can, &f->options, "frames", standard);
	fake_set_option(&db_driver_vsmd_can, &f->options, "report-ms", report_ms);
	fake_set_option(&db_driver_vsmd_can, &f->options, "report", report);
	fake_set_option(&db_driver_vsmd_can, &f->options, "reaction-ms", REACTION_MS);
	f->bus.options = f->options.bus;
	f->drive.options = f->options.drive;
	f->drive.address = 1;
	f->drive.counts_per_unit = 1.0;
	f->drive.min_position = f->drive.max_position = NAN;
	f->exchange.request = f->bytes;
	f->exchange.request_size = sizeof f->bytes;
	f->now = 1000 * MS;
	f->device = calloc(1, db_driver_vsmd_can.device_size);
	assert_non_null(f->device);
	db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
	return f;
}

static struct fixture *make(double standard, double report_ms)
{
	return make_reporting(standard, report_ms, 0);
}

static void drop(struct fixture *f)
{
	free(f->device);
	free(f);
}

static void spell(struct fixture *f)
{
	char *at = f->said;

	*at = '\0';
	for (size_t i = 0; i < f->exchange.request_length; i += sizeof(struct db_can_frame)) {
		struct db_can_frame frame;

		memcpy(&frame, f->exchange.request + i, sizeof frame);
		at += sprintf(at, frame.id & DB_CAN_EXTENDED ? "%s%08X#" : "%s%03X#",
		              i > 0 ? " " : "", frame.id & DB_CAN_ID_MASK);
		for (unsigned j = 0; j < frame.length; j++)
			at += sprintf(at, "%02X", frame.data[j]);
	}
}

/* The job as the scheduler hands it to the driver now. */
static struct db_conversation *talk(struct fixture *f)
{
	f->talk = (struct db_conversation){
		.device = f->device, .job = &f->job, .exchange = &f->exchange, .now = f->now
	};
	return &f->talk;
}

/* What the driver wants next: the frames, or how the job ended as "=name". */
static const char *next(struct fixture *f, enum db_step step)
{
	if (step == DB_STEP_SEND) {
		f->exchange.sending++;
		spell(f);
	} else if (step == DB_STEP_DONE) {
		snprintf(f->said, sizeof f->said, "=%s", db_result_name(f->talk.result));
	} else {
		snprintf(f->said, sizeof f->said, step == DB_STEP_MORE ? "more" : "ignored");
	}
	return f->said;
}

static const char *begin(struct fixture *f, enum db_job_kind kind)
{
	f->job = (struct db_job){ .kind = kind, .request = &f->request, .started = f->now };
	return next(f, db_driver_vsmd_can.begin(talk(f)));
}

static const char *command(struct fixture *f, enum db_command code, struct db_args args)
{
	f->args = args;
	f->request = (struct db_request){ .command = code, .args = &f->args };
	return begin(f, DB_JOB_COMMAND);
}

static struct db_can_frame frame_of(uint32_t id, uint32_t first, uint32_t second, uint8_t length)
{
	struct db_can_frame frame = { .id = id | DB_CAN_EXTENDED, .length = length };

	for (unsigned i = 0; i < 4; i++) {
		frame.data[i] = (uint8_t)(first >> (24 - 8 * i));
		frame.data[4 + i] = (uint8_t)(length > 4 ? second >> (24 - 8 * i) : 0);
	}
	return frame;
}

static const char *answer(struct fixture *f, struct db_can_frame frame)
{
	f->now += MS / 2;
	return next(f, db_driver_vsmd_can.answer(talk(f), (const uint8_t *)&frame, sizeof frame));
}

/* The answer to the read behind a command: position and status. */
static const char *confirm(struct fixture *f, int32_t position, uint32_t status)
{
	return answer(f, frame_of(0x00080201, (uint32_t)position, status, 8));
}

static const char *speed(struct fixture *f, float velocity)
{
	uint32_t raw;

	memcpy(&raw, &velocity, sizeof raw);
	return answer(f, frame_of(0x00080200, raw, 0, 4));
}

static const char *place(struct fixture *f, int32_t position)
{
	return answer(f, frame_of(0x00080201, (uint32_t)position, 0, 4));
}

/* What was asked behind registers is answered: no more of them will come. */
static const char *guard(struct fixture *f)
{
	return answer(f, frame_of(0x0008020B, 0x3130362D, 0, 4));
}

static const char *data(struct fixture *f, unsigned reg, uint32_t value)
{
	const char *said = answer(f, frame_of(0x00080280 + reg, value, 0, 4));

	return strcmp(said, "more") == 0 ? guard(f) : said;
}

static const char *lost(struct fixture *f)
{
	return next(f, db_driver_vsmd_can.lost(talk(f)));
}

/* A cyclic status. */
static void poll_running(struct fixture *f, float velocity, int32_t position, uint32_t status)
{
	uint32_t raw;

	memcpy(&raw, &velocity, sizeof raw);
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	assert_string_equal(answer(f, frame_of(0x00080200, raw, (uint32_t)position, 8)), "more");
	assert_string_equal(answer(f, frame_of(0x00080202, status, 0, 4)), "=ok");
}

static void poll(struct fixture *f, int32_t position, uint32_t status)
{
	poll_running(f, 0.0f, position, status);
}

static struct db_feedback feedback(const struct fixture *f)
{
	struct db_feedback feedback;

	db_driver_vsmd_can.feedback(f->device, &feedback);
	return feedback;
}

/* --- reading --------------------------------------------------------------------------------------- */

static void cyclic_status_is_put_together_whatever_the_order(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	assert_int_equal(feedback(f).state, DB_AXIS_OFFLINE);
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	assert_string_equal(answer(f, frame_of(0x00080202, RUNS, 0, 4)), "more");
	/* 1600.0 pulses per second, at -5 */
	assert_string_equal(answer(f, frame_of(0x00080200, 0x44C80000, 0xFFFFFFFB, 8)), "=ok");
	assert_int_equal(feedback(f).position, -5);
	assert_true(feedback(f).velocity > 1599.9f && feedback(f).velocity < 1600.1f);
	assert_int_equal(feedback(f).state, DB_AXIS_CONTINUOUS_MOTION);
	drop(f);
}

static void a_half_answer_is_not_completed_by_the_next_one(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	begin(f, DB_JOB_POLL);
	assert_string_equal(answer(f, frame_of(0x00080200, 0, 111, 8)), "more");
	/* The rest was lost; asked again, with another position meanwhile. */
	begin(f, DB_JOB_POLL);
	assert_string_equal(answer(f, frame_of(0x00080200, 0, 222, 8)), "more");
	assert_string_equal(answer(f, frame_of(0x00080202, STANDS, 0, 4)), "=ok");
	assert_int_equal(feedback(f).position, 222);
	drop(f);
}

/* On a bus with other traffic the kernel keeps that away. */
static void filters_pass_answers_and_nothing_else(void **state)
{
	struct fixture *f = make(0, 0);
	struct db_can_filter filters[DB_FILTERS_MAX] = { { 0 } };
	size_t count = db_driver_vsmd_can.filters(&f->bus, filters);
	struct db_can_frame answer = frame_of(0x00080202, STANDS, 0, 4);
	struct db_can_frame question = frame_of(0x0008039E, 0, 0, 2);
	struct db_can_frame other = frame_of(0x123, 0, 0, 4);

	(void)state;
	other.id &= ~DB_CAN_EXTENDED;
	assert_int_equal(count, 1);
	assert_true(db_can_filter_passes(filters, count, &answer));
	assert_false(db_can_filter_passes(filters, count, &question));
	assert_false(db_can_filter_passes(filters, count, &other));
	drop(f);
}

/* Some drives tell no more than two registers at once. One that has told three is asked for three, whatever is lost. */
static void a_drive_is_asked_for_as_much_as_it_has_told(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 1, STANDS);
	for (unsigned i = 0; i < 9; i++)
		assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	drop(f);
	f = make(0, 0);
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0002 0008039E#0201");
	drop(f);
}

static void a_confirmation_is_nothing_else(void **state)
{
	struct fixture *f = make(0, 0);
	int address = 0;
	struct db_can_frame frame = frame_of(0x00080200, 0, 7, 8);

	(void)state;
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	assert_string_equal(answer(f, frame), "ignored");
	assert_string_equal(answer(f, frame_of(0x00080202, STANDS, 0, 4)), "ignored");
	assert_string_equal(answer(f, frame_of(0x00080281, 0, STANDS, 8)), "ignored");
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	/* Who it comes from, and for whom it is. */
	assert_int_equal(
		db_driver_vsmd_can.accept(&f->bus, (uint8_t *)&frame, sizeof frame, &address),
		DB_FRAME_GOOD);
	assert_int_equal(address, 1);
	frame.id = 0x00180200 | DB_CAN_EXTENDED; /* for host 3 */
	assert_int_equal(
		db_driver_vsmd_can.accept(&f->bus, (uint8_t *)&frame, sizeof frame, &address),
		DB_FRAME_FOREIGN);
	frame = frame_of(0x00080200, 0, 7, 8);
	frame.length = 5;
	assert_int_equal(
		db_driver_vsmd_can.accept(&f->bus, (uint8_t *)&frame, sizeof frame, &address),
		DB_FRAME_BAD);
	drop(f);
}

static void probe_and_identity(void **state)
{
	static const uint32_t text[] = { 0x56534D44, 0x3130362D, 0x30323554, 0x2D312E30,
		                         0x2E303430, 0x2E313731, 0x31303120 };
	struct fixture *f = make(0, 0);
	unsigned blocks = 0;

	(void)state;
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0A01");
	assert_string_equal(answer(f, frame_of(0x0008020A, text[0], 0, 4)), "=ok");
	/* Reports are turned off, then the text is read. */
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#00 0008039E#0A07");
	answer(f, frame_of(0x00080210, text[6], 0, 4));
	answer(f, frame_of(0x0008020A, text[0], text[1], 8));
	answer(f, frame_of(0x0008020E, text[4], text[5], 8));
	assert_string_equal(answer(f, frame_of(0x0008020C, text[2], text[3], 8)),
	                    "0008039F#0008 0008039E#0B01");
	assert_memory_equal(db_driver_vsmd_can.nameplate(f->device)->identity,
	                    "VSMD106-025T-1.0.040.171101", 27);
	while (f->said[0] != '=') {
		unsigned first;
		unsigned count;

		assert_int_equal(sscanf(f->said, "0008039F#%2x%2x", &first, &count), 2);
		for (unsigned reg = first; reg < first + count; reg += 2)
			answer(f,
			       frame_of(0x00080280 + reg, reg == 0 ? 1 : 0, reg == 0 ? 0x5A132 : 0,
			                first + count - reg > 1 ? 8 : 4));
		guard(f);
		blocks++;
	}
	assert_string_equal(f->said, "=ok");
	assert_int_equal(blocks, 7);
	assert_int_equal(db_driver_vsmd_can.nameplate(f->device)->values[VSMD_CID].u, 1);
	assert_int_equal(db_driver_vsmd_can.nameplate(f->device)->values[VSMD_BDR].u, 100000);
	drop(f);
}

/* --- parameters in turn ----------------------------------------------------------------------- */

/* Of every register 0. */
static void identify(struct fixture *f)
{
	unsigned first;
	unsigned count;

	(void)begin(f, DB_JOB_IDENTIFY);
	for (unsigned reg = 0; reg < 6; reg += 2)
		answer(f, frame_of(0x0008020A + reg, 0x56534D44, 0x20202020, 8));
	answer(f, frame_of(0x00080210, 0x20202020, 0, 4));
	while (sscanf(f->said, "0008039F#%2x%2x", &first, &count) == 2) {
		for (unsigned reg = first; reg < first + count; reg += 2)
			answer(f,
			       frame_of(0x00080280 + reg, 0, 0, first + count - reg > 1 ? 8 : 4));
		guard(f);
	}
	assert_string_equal(f->said, "=ok");
}

/* The register that is read now. */
static unsigned refresh(struct fixture *f)
{
	unsigned reg;
	unsigned count;

	assert_int_equal(sscanf(begin(f, DB_JOB_REFRESH), "0008039F#%2x%2x", &reg, &count), 2);
	assert_int_equal(count, 1);
	return reg;
}

/* Each that has parameters, from the first to the last and again. */
static void registers_are_read_again_in_turn(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);
	uint64_t seen = 0;
	unsigned count = 0;
	unsigned reg;

	(void)state;
	identify(f);
	for (reg = refresh(f); !(seen >> reg & 1); reg = refresh(f)) {
		uint32_t generation = plate->generation;

		seen |= UINT64_C(1) << reg;
		count++;
		assert_string_equal(data(f, reg, 0), "=ok");
		/* Nothing has changed. */
		assert_int_equal(plate->generation, generation);
	}
	assert_int_equal(count, 42);
	assert_true(seen >> 0x2B & 1);
	assert_true(seen & 1);
	drop(f);
}

static void a_value_that_was_changed_at_the_drive_is_taken(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);
	uint32_t generation;
	unsigned reg;

	(void)state;
	identify(f);
	while ((reg = refresh(f)) != 0x02) /* mcs */
		assert_string_equal(data(f, reg, 0), "=ok");
	generation = plate->generation;
	f->now += 7000 * MS;
	assert_string_equal(data(f, 0x02, 5), "=ok");
	assert_int_equal(plate->values[VSMD_MCS].u, 5);
	assert_int_equal(plate->generation, generation + 1);
	assert_true(plate->told[VSMD_MCS] == db_told_at(f->now - MS / 2));
	drop(f);
}

/* The guard came, the register did not: nothing is known anew. */
static void a_register_that_is_not_answered_stays_as_it_is(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);
	uint32_t generation;

	(void)state;
	identify(f);
	generation = plate->generation;
	(void)refresh(f);
	assert_string_equal(guard(f), "=unsupported");
	assert_int_equal(plate->generation, generation);
	drop(f);
}

/* --- commands ---------------------------------------------------------------------------------------- */

static void every_command_in_bytes(void **state)
{
	static const struct {
		enum db_command command;
		struct db_args args;
		const char *said;
	} cases[] = {
		{ DB_CMD_ENABLE, { 0 }, "00080381# 0008039E#0102" },
		{ DB_CMD_DISABLE, { 0 }, "00080382# 0008039E#0102" },
		{ DB_CMD_STOP, { 0 }, "00080384#00 0008039E#0102" },
		{ DB_CMD_QUICK_STOP, { 0 }, "00080384#01 0008039E#0102" },
		{ DB_CMD_MOVE_VELOCITY,
		  { .target_velocity = -1600.0f },
		  "00080385#C4C80000 0008039E#0102" },
		{ DB_CMD_MOVE_PRESET, { 0 }, "00080385# 0008039E#0102" },
		{ DB_CMD_MOVE_ABSOLUTE,
		  { .target_position = 25000 },
		  "00080386#000061A8 0008039E#0102" },
		{ DB_CMD_MOVE_ABSOLUTE,
		  { .target_position = -2, .target_velocity = 1600.0f },
		  "00080386#FFFFFFFE44C80000 0008039E#0102" },
		{ DB_CMD_MOVE_RELATIVE, { .target_position = 5 }, "0008039E#0102" },
		{ DB_CMD_HOME, { 0 }, "0008038A# 0008039E#0102" },
		{ DB_CMD_HOME_STOP, { 0 }, "0008038A# 0008039E#0102" },
		{ DB_CMD_SET_POSITION,
		  { .target_position = 258 },
		  "00080383#00000102 0008039E#0102" },
		{ DB_CMD_CLEAR_FAULT, { 0 }, "0008039D#00 0008039E#0102" },
		{ DB_CMD_SAVE_PARAMETERS, { 0 }, "00080387# 0008039E#0102" },
		{ DB_CMD_SET_OUTPUT,
		  { .output_number = 5, .output_value = 1 },
		  "00080388#0501 0008039E#0102" },
		{ DB_CMD_SET_SV,
		  { .output_number = 3, .output_value = 255 },
		  "0008038D#02FF 0008039E#0102" },
		{ DB_CMD_SET_NMOS,
		  { .output_number = 1, .output_value = 16 },
		  "0008038E#0010 0008039E#0102" },
		{ DB_CMD_SHAKE_START,
		  { .shake_start_position = 1,
		    .shake_end_position = 200,
		    .shake_frequency = 0.5f,
		    .shake_cycles = 7 },
		  "0008039B#1000000001 0008039B#11000000C8 0008039B#123F000000 "
		  "0008039B#1000000001 0008039B#11000000C8 0008039B#123F000000 "
		  "0008039B#0100000007 0008039E#0102" },
		{ DB_CMD_SHAKE_START_TIME,
		  { .shake_frequency = 2.0f, .shake_time = 60 },
		  "0008039B#1000000000 0008039B#1100000000 0008039B#1240000000 "
		  "0008039B#1000000000 0008039B#1100000000 0008039B#1240000000 "
		  "0008039B#020000003C 0008039E#0102" },
		{ DB_CMD_SHAKE_STOP, { 0 }, "0008039B#00 0008039E#0102" },
		{ DB_CMD_READ_PARAMETERS, { 0 }, "0008038F#00 0008039E#0A07" },
	};
	uint64_t tried = DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS); /* below */
	struct fixture *f;

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		f = make(0, 0);
		assert_int_equal(db_driver_vsmd_can.check(&f->bus, &f->drive, cases[i].command,
		                                          &cases[i].args),
		                 DB_RESULT_OK);
		assert_string_equal(command(f, cases[i].command, cases[i].args), cases[i].said);
		tried |= DB_COMMAND_BIT(cases[i].command);
		drop(f);
	}
	assert_true(tried == db_driver_vsmd_can.commands);
	f = make(0, 0);
	assert_string_equal(command(f, DB_CMD_SET_OUTPUTS,
	                            (struct db_args){ .output_mask = 0x28, .output_levels = 0x20 }),
	                    "00080388#0400 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "00080388#0601 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_S6), "=ok");
	drop(f);
	/* From the first port on. */
	f = make(0, 0);
	assert_string_equal(command(f, DB_CMD_SET_OUTPUTS,
	                            (struct db_args){ .output_mask = 1, .output_levels = 1 }),
	                    "00080388#0101 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_S1), "=ok");
	drop(f);
}

static void standard_frames(void **state)
{
	struct fixture *f = make(1, 0);

	(void)state;
	assert_string_equal(command(f, DB_CMD_STOP, (struct db_args){ 0 }), "0E4#00 0FE#0102");
	assert_int_equal(
		db_driver_vsmd_can.check_param(&f->bus, VSMD_SPL, (union db_value){ .i = 5 }),
		DB_RESULT_UNSUPPORTED);
	assert_int_equal(
		db_driver_vsmd_can.check_param(&f->bus, VSMD_MCS, (union db_value){ .u = 5 }),
		DB_RESULT_OK);
	drop(f);
}

static void what_the_drive_refuses(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 5 });
	assert_string_equal(confirm(f, 0, VSMD_ST_STP | VSMD_ST_CMD_WRG), "=refused");
	assert_true(feedback(f).status == 0 || feedback(f).status & DB_STATUS_REFUSED);
	drop(f);
}

/* --- looking for the effect ---------------------------------------------------------------------------- */

static void a_move_counts_when_it_shows(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	/* The status was read before the drive got going. */
	assert_string_equal(confirm(f, 0, STANDS), "0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "0008039E#0102");
	assert_string_equal(confirm(f, 1, RUNS), "=ok");
	/* Already there. */
	poll(f, 500, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	assert_string_equal(confirm(f, 500, STANDS), "=ok");
	drop(f);
}

static void a_move_that_does_not_show_is_said_again_and_then_failed(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned moves = 1;
	unsigned reads = 0;

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	while (f->said[0] != '=' && reads < 200) {
		confirm(f, 0, STANDS);
		moves += strncmp(f->said, "00080386#000001F4 ", 18) == 0;
		reads++;
	}
	assert_string_equal(f->said, "=failed");
	assert_int_equal(moves, 3);
	assert_in_range(reads, 3 * 2 * REACTION_MS, 3 * (2 * REACTION_MS + 2));
	drop(f);
}

/* --- motion on top of a motion ---------------------------------------------------------------------------- */

/* Runs with 3000 pulses per second because it was told to. */
static void run_at_3000(struct fixture *f)
{
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 3000.0f });
	assert_string_equal(confirm(f, 1, RUNS), "=ok");
	poll_running(f, 3000.0f, 100, RUNS);
}

/* Answers every look with this. The end, and how often the frame was said again. */
static const char *go_on_with(struct fixture *f, float velocity, int32_t position,
                              const char *frame, unsigned *said)
{
	*said = 0;
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++) {
		*said += strncmp(f->said, frame, strlen(frame)) == 0;
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, velocity);
		else
			confirm(f, position, RUNS);
	}
	return f->said;
}

static void a_reversal_counts_when_the_speed_turns(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	run_at_3000(f);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -3000.0f });
	assert_string_equal(confirm(f, 103, RUNS), "0008039E#0001");
	assert_string_equal(speed(f, 2930.0f), "=ok");
	/* Its frame was lost: it runs on as it did, and that it moves proves nothing. */
	run_at_3000(f);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -3000.0f });
	assert_string_equal(go_on_with(f, 3000.0f, 200, "00080385#C53B8000 ", &said), "=failed");
	assert_int_equal(said, 3);
	drop(f);
}

/* From `place` on by `step` counts with each look, at a speed of 0. */
static const char *go_without_speed(struct fixture *f, int32_t place, int32_t step)
{
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++) {
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, 0.0f);
		else
			confirm(f, place += step, RUNS);
	}
	return f->said;
}

static void where_no_speed_is_told_the_position_tells_the_direction(void **state)
{
	static const struct db_args back = { .target_velocity = -3000.0f };
	static const struct db_args behind = { .target_position = -5000 };
	struct fixture *f = make(0, 0);

	(void)state;
	run_at_3000(f);
	poll_running(f, 0.0f, 160, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, back);
	assert_string_equal(go_without_speed(f, 160, -10), "=ok");
	/* Whether it goes faster now cannot be seen. */
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -4000.0f });
	assert_string_equal(go_without_speed(f, 0, -10), "=unproven");
	/* It goes on as before: the command may have been lost, or be slow. */
	run_at_3000(f);
	poll_running(f, 0.0f, 160, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, back);
	assert_string_equal(go_without_speed(f, 160, 10), "=unproven");
	run_at_3000(f);
	poll_running(f, 0.0f, 160, RUNS);
	command(f, DB_CMD_MOVE_ABSOLUTE, behind);
	assert_string_equal(go_without_speed(f, 160, -10), "=ok");
	/* Also far from 0: what counts is where it was first seen after the command. */
	run_at_3000(f);
	poll_running(f, 0.0f, 60000, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, back);
	assert_string_equal(go_without_speed(f, 60000, -10), "=ok");
	drop(f);
}

/* Its speeds are never below 0. */
static void a_reversal_shows_in_the_position_too(void **state)
{
	struct fixture *f = make(0, 0);
	int32_t place = 160;

	(void)state;
	run_at_3000(f);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -3000.0f });
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++) {
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, 3000.0f);
		else
			confirm(f, place -= 3, RUNS);
	}
	assert_string_equal(f->said, "=ok");
	drop(f);
}

static void a_speed_that_an_older_command_explains_proves_nothing(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	/* Told 3000, and still accelerating: 2000 is on the way. */
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 3000.0f });
	assert_string_equal(confirm(f, 1, RUNS), "=ok");
	poll_running(f, 1000.0f, 100, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 2000.0f });
	assert_string_equal(go_on_with(f, 2000.0f, 110, "00080385#44FA0000 ", &said), "=unproven");
	assert_int_equal(said, 2);
	/* Faster than it was ever told before: that is this command. */
	run_at_3000(f);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 5000.0f });
	confirm(f, 110, RUNS);
	assert_string_equal(speed(f, 3050.0f), "=ok");
	drop(f);
}

static void a_new_target_counts_when_the_drive_turns_to_it(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	run_at_3000(f);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = -500 });
	confirm(f, 103, RUNS);
	assert_string_equal(speed(f, 2930.0f), "=ok");
	/* Behind it: the way there is the way back, and it comes from 0 speed. */
	poll_running(f, -500.0f, 50, RUNS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 4000 });
	confirm(f, 45, RUNS);
	assert_string_equal(speed(f, 10.0f), "=ok");
	/* Farther in the same direction: nothing shows, so it is said twice, and the result says so. */
	poll_running(f, 3000.0f, 1000, RUNS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 9000 });
	assert_string_equal(go_on_with(f, 3000.0f, 1100, "00080386#00002328 ", &said), "=unproven");
	assert_int_equal(said, 2);
	assert_int_equal(feedback(f).target, 9000);
	/* The same target again is what it does already. */
	poll_running(f, 3000.0f, 2000, RUNS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 9000 });
	assert_string_equal(confirm(f, 2010, RUNS), "=ok");
	drop(f);
}

/* Runs, was told to stop, and slows down from 3000. */
static void slow_down_from_3000(struct fixture *f)
{
	run_at_3000(f);
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 103, RUNS), "=ok");
}

/* Answers every look with a speed that changes by `step` from one look to the next. */
static const char *go_on_slowly(struct fixture *f, float velocity, float step, int32_t position,
                                const char *frame, unsigned *said)
{
	*said = 0;
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++) {
		*said += strncmp(f->said, frame, strlen(frame)) == 0;
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, velocity += step);
		else
			confirm(f, position, RUNS);
	}
	return f->said;
}

static void what_slows_down_for_a_halt_proves_no_new_target(void **state)
{
	const struct db_args behind = { .target_position = 50 };
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	/* It may be turning to the target, or still be obeying the halt. */
	slow_down_from_3000(f);
	command(f, DB_CMD_MOVE_ABSOLUTE, behind);
	assert_string_equal(go_on_slowly(f, 3000.0f, -4.0f, 110, "00080386#00000032 ", &said),
	                    "=unproven");
	assert_int_equal(said, 2);
	assert_int_equal(feedback(f).target, 50);
	/* Comes back, which no halt makes it do. */
	slow_down_from_3000(f);
	command(f, DB_CMD_MOVE_ABSOLUTE, behind);
	confirm(f, 110, RUNS);
	assert_string_equal(speed(f, 8.0f), "0008039E#0102");
	confirm(f, 110, RUNS);
	assert_string_equal(speed(f, -8.0f), "=ok");
	/* Neither of them: it runs on away from the target. */
	slow_down_from_3000(f);
	command(f, DB_CMD_MOVE_ABSOLUTE, behind);
	assert_string_equal(go_on_slowly(f, 3000.0f, 0.0f, 110, "00080386#00000032 ", &said),
	                    "=failed");
	assert_int_equal(said, 3);
	drop(f);
}

static void what_slows_down_for_a_halt_proves_no_reversal(void **state)
{
	const struct db_args back = { .target_velocity = -3000.0f };
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	slow_down_from_3000(f);
	command(f, DB_CMD_MOVE_VELOCITY, back);
	assert_string_equal(go_on_slowly(f, 3000.0f, -4.0f, 110, "00080385#C53B8000 ", &said),
	                    "=unproven");
	assert_int_equal(said, 2);
	slow_down_from_3000(f);
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	confirm(f, 110, RUNS);
	assert_string_equal(go_on_slowly(f, 3000.0f, -4.0f, 110, "00080389#", &said), "=unproven");
	drop(f);
}

/* On its way back to a target behind it, and the next one lies before it again. */
static void what_slows_down_for_a_target_proves_no_other(void **state)
{
	const struct db_args ahead = { .target_position = 9000 };
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	run_at_3000(f);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 50 });
	confirm(f, 110, RUNS);
	assert_string_equal(speed(f, 2900.0f), "=ok");
	command(f, DB_CMD_MOVE_ABSOLUTE, ahead);
	assert_string_equal(go_on_slowly(f, 2890.0f, -4.0f, 120, "00080386#00002328 ", &said),
	                    "=unproven");
	assert_int_equal(said, 2);
	/* Faster again, and away from the older target. */
	run_at_3000(f);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 50 });
	confirm(f, 110, RUNS);
	assert_string_equal(speed(f, 2900.0f), "=ok");
	command(f, DB_CMD_MOVE_ABSOLUTE, ahead);
	assert_string_equal(go_on_slowly(f, 2890.0f, 4.0f, 120, "00080386#00002328 ", &said),
	                    "=ok");
	drop(f);
}

static void a_move_that_ended_does_not_prove_the_next(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned moves = 0;

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	assert_string_equal(confirm(f, 1, RUNS), "=ok");
	poll_running(f, 1000.0f, 400, RUNS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 900 });
	/* It reaches the old target and stands there. */
	while (f->said[0] != '=') {
		moves += strncmp(f->said, "00080386#00000384 ", 18) == 0;
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, 0.0f);
		else
			confirm(f, 500, STANDS);
	}
	assert_string_equal(f->said, "=failed");
	assert_int_equal(moves, 3);
	drop(f);
}

static void set_position_while_moving_must_change_the_position(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	run_at_3000(f);
	command(f, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 100000 });
	assert_string_equal(confirm(f, 100002, RUNS), "=ok");
	run_at_3000(f);
	command(f, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 100000 });
	assert_string_equal(go_on_with(f, 3000.0f, 110, "00080383#000186A0 ", &said), "=failed");
	assert_int_equal(said, 3);
	drop(f);
}

static void outputs_show_their_level(void **state)
{
	const struct db_args on = { .output_number = 5, .output_value = 1 };
	struct fixture *f = make(0, 0);
	unsigned said = 0;

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_SET_OUTPUT, on);
	assert_string_equal(confirm(f, 0, STANDS), "0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_S5), "=ok");
	/* Not documented to show: without a level the result is open ... */
	command(f, DB_CMD_SET_OUTPUT, on);
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++) {
		said += strncmp(f->said, "00080388#", 9) == 0;
		confirm(f, 0, STANDS);
	}
	assert_string_equal(f->said, "=unproven");
	assert_int_equal(said, 3);
	/* ... but a port that is an input has taken nothing. */
	f->request = (struct db_request){ .args = &f->args };
	f->settings[0] = (struct db_setting){ .param = VSMD_S5 };
	f->request.settings = f->settings;
	f->request.setting_count = 1;
	begin(f, DB_JOB_SETTINGS);
	data(f, 0x0D, 0);
	assert_string_equal(data(f, 0x0D, 0), "=ok");
	command(f, DB_CMD_SET_OUTPUT, on);
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++)
		confirm(f, 0, STANDS);
	assert_string_equal(f->said, "=refused");
	/* What is connected to it may hold it high. */
	poll(f, 0, STANDS | VSMD_ST_S5);
	command(f, DB_CMD_SET_OUTPUT, on);
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++)
		confirm(f, 0, STANDS | VSMD_ST_S5);
	assert_string_equal(f->said, "=refused");
	drop(f);
}

static void what_cannot_be_read_is_unproven(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_SET_SV, (struct db_args){ .output_number = 1, .output_value = 9 });
	assert_string_equal(confirm(f, 0, STANDS), "=unproven");
	command(f, DB_CMD_SET_NMOS, (struct db_args){ .output_number = 1, .output_value = 9 });
	assert_string_equal(confirm(f, 0, STANDS), "=unproven");
	command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "=unproven");
	command(f, DB_CMD_SHAKE_START,
	        (struct db_args){ .shake_frequency = 1.0f, .shake_end_position = 50 });
	assert_string_equal(confirm(f, 1, RUNS), "=unproven");
	drop(f);
}

/* --- origin and restarts ------------------------------------------------------------------------------------ */

static bool has(const struct fixture *f, uint32_t bit)
{
	return feedback(f).status & bit;
}

static void a_power_cut_loses_the_origin(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	/* Homed, by whomever: the drive says so. */
	poll(f, 0, STANDS);
	assert_false(has(f, DB_STATUS_HOMED));
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	assert_true(has(f, DB_STATUS_HOMED));
	/* Away and back, and nothing says that it counted on. */
	db_driver_vsmd_can.gone(f->device);
	poll(f, 0, STANDS);
	assert_false(has(f, DB_STATUS_HOMED));
	assert_true(has(f, DB_STATUS_ORIGIN_LOST));
	/* Homed again; away and back with its homing bit: that was the cable. */
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	assert_true(has(f, DB_STATUS_HOMED) && !has(f, DB_STATUS_ORIGIN_LOST));
	db_driver_vsmd_can.gone(f->device);
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	assert_true(has(f, DB_STATUS_HOMED) && !has(f, DB_STATUS_ORIGIN_LOST));
	/* Shorter than a cycle: the bit or the power is gone, and the counter at 0. */
	poll(f, 0, STANDS);
	assert_false(has(f, DB_STATUS_HOMED));
	assert_true(has(f, DB_STATUS_ORIGIN_LOST));
	drop(f);
}

/* Between the command and the status behind it: its places are other ones now. */
static void a_power_cut_while_moving_ends_the_move(void **state)
{
	static const unsigned gaps[] = { 4000, 60000 };

	(void)state;
	for (size_t i = 0; i < sizeof gaps / sizeof gaps[0]; i++) {
		struct fixture *f = make(0, 0);
		unsigned said = 0;

		run_at_3000(f);
		poll_running(f, 3000.0f, (int32_t)gaps[i], RUNS);
		command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 90000 });
		/* It stands at 0, as after power came, and would go to 90000 from there. */
		while (f->said[0] != '=') {
			said += strncmp(f->said, "00080386#", 9) == 0;
			if (strcmp(f->said, "0008039E#0001") == 0)
				speed(f, 0.0f);
			else
				confirm(f, 0, STANDS);
		}
		assert_string_equal(f->said, "=failed");
		assert_int_equal(said, 1);
		assert_true(feedback(f).status & DB_STATUS_ORIGIN_LOST);
		drop(f);
	}
}

static void a_drive_that_counts_on_has_not_restarted(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 700 });
	assert_string_equal(confirm(f, 700, STANDS | VSMD_ST_HS), "=ok");
	db_driver_vsmd_can.gone(f->device);
	poll(f, 700, STANDS);
	assert_false(has(f, DB_STATUS_ORIGIN_LOST));
	f->now += 1000 * MS;
	poll(f, 700, VSMD_ST_STP); /* power off, and it counts on */
	assert_false(has(f, DB_STATUS_ORIGIN_LOST));
	poll(f, 700, STANDS);
	f->now += 1000 * MS;
	poll(f, 0, STANDS); /* nobody told it anything */
	assert_true(has(f, DB_STATUS_ORIGIN_LOST));
	drop(f);
}

/* Its bit is still of the homing before, but off has made 0 of the counter. */
static void the_homing_bit_outlives_the_origin(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	command(f, DB_CMD_DISABLE, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, VSMD_ST_STP | VSMD_ST_ZERO), "=ok");
	poll(f, 0, VSMD_ST_STP | VSMD_ST_ZERO);
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_ZERO), "=ok");
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	assert_false(has(f, DB_STATUS_HOMED));
	assert_true(has(f, DB_STATUS_ORIGIN_LOST));
	drop(f);
}

/* When the service starts. Without power the counter went to 0 wherever the motor was. */
static void a_homing_bit_is_believed_of_a_motor_with_power(void **state)
{
	struct fixture *with = make(0, 0);
	struct fixture *without = make(0, 0);

	(void)state;
	poll(with, 500, STANDS | VSMD_ST_ZERO);
	assert_true(has(with, DB_STATUS_HOMED));
	poll(without, 500, VSMD_ST_STP | VSMD_ST_ZERO);
	assert_false(has(without, DB_STATUS_HOMED));
	drop(with);
	drop(without);
}

/* Another master homes it. While it still moves, its origin is not known. */
static void the_homing_bit_of_a_moving_drive_is_no_origin(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	poll_running(f, 800.0f, 100, RUNS);
	poll_running(f, 800.0f, 200, RUNS | VSMD_ST_ZERO);
	assert_false(has(f, DB_STATUS_HOMED));
	drop(f);
}

static void closed_loop_rests_beside_its_place(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	f->drive.in_position_window = 1.0;
	db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
	poll(f, 1, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	confirm(f, 5, RUNS);
	poll(f, 501, STANDS);
	assert_true(has(f, DB_STATUS_AT_TARGET));
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	assert_string_equal(confirm(f, 501, STANDS), "=ok");
	command(f, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 20 });
	assert_string_equal(confirm(f, 21, STANDS), "=ok");
	drop(f);
}

/* Two answers, and one of them is of before. */
static void a_relative_move_is_counted_from_readings_that_agree(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 100, STANDS);
	command(f, DB_CMD_MOVE_RELATIVE, (struct db_args){ .target_position = 50 });
	assert_string_equal(confirm(f, 40, STANDS), "0008039E#0101");
	assert_string_equal(place(f, 100), "0008039E#0102");
	assert_string_equal(confirm(f, 100, STANDS), "0008039E#0101");
	assert_string_equal(place(f, 100), "00080386#00000096 0008039E#0102");
	drop(f);
}

/* The move before goes on to where it was sent. */
static void a_refused_move_changes_no_target(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	assert_string_equal(confirm(f, 0, RUNS), "=ok");
	assert_int_equal(feedback(f).target, 500);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 900 });
	assert_string_equal(confirm(f, 10, RUNS | VSMD_ST_CMD_WRG), "=refused");
	assert_int_equal(feedback(f).target, 500);
	command(f, DB_CMD_MOVE_RELATIVE, (struct db_args){ .target_position = 100 });
	confirm(f, 20, RUNS);
	place(f, 21);
	assert_string_equal(confirm(f, 20, RUNS | VSMD_ST_CMD_WRG), "=refused");
	assert_int_equal(feedback(f).target, 500);
	poll(f, 500, STANDS);
	assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
	drop(f);
}

static void homing_and_shaking_are_never_begun_twice(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned starts = 0;

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "00080389# 0008039E#0102");
	for (unsigned i = 0; i < 200 && f->said[0] != '='; i++) {
		starts += strncmp(f->said, "00080389#", 9) == 0;
		confirm(f, 0, STANDS);
	}
	assert_string_equal(f->said, "=failed");
	assert_int_equal(starts, 1);
	drop(f);
}

/* `zero stop` does not clear it, the next homing does. */
static void a_homing_bit_that_stays_set_is_no_end(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned stops = 0;

	(void)state;
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	for (unsigned i = 0; i < 3000 && strncmp(f->said, "00080389#", 9) != 0; i++) {
		stops += strncmp(f->said, "0008038A#", 9) == 0;
		confirm(f, 0, STANDS | VSMD_ST_ZERO);
	}
	assert_int_equal(stops, 3);
	/* It stands for a moment before it begins, and the bit is that of before. */
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_ZERO), "0008039E#0102");
	assert_string_equal(confirm(f, 0, RUNS | VSMD_ST_ZERO), "=ok");
	poll(f, -3, RUNS | VSMD_ST_ZERO);
	poll(f, -5, STANDS | VSMD_ST_ZERO);
	assert_int_equal(feedback(f).state, DB_AXIS_HOMING);
	assert_false(has(f, DB_STATUS_HOMED));
	poll(f, -5, RUNS);
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	assert_true(has(f, DB_STATUS_HOMED));
	assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
	/* That it is cleared shows that homing has begun. */
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	while (strncmp(f->said, "00080389#", 9) != 0)
		confirm(f, 0, STANDS | VSMD_ST_ZERO);
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	drop(f);
}

/* Saying it again is the scheduler's part; the driver does not claim a stand that it has not read. */
static void a_stop_that_shows_no_effect_still_moves(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 800.0f });
	assert_string_equal(confirm(f, 0, RUNS), "=ok");
	assert_string_equal(command(f, DB_CMD_STOP, (struct db_args){ 0 }),
	                    "00080384#00 0008039E#0102");
	assert_string_equal(confirm(f, 1, RUNS), "=ok");
	assert_int_equal(feedback(f).state, DB_AXIS_STOPPING);
	assert_true(feedback(f).status & DB_STATUS_MOVING);
	drop(f);
}

static void stopping_a_homing_run_ends_homing_too(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	confirm(f, 0, STANDS);
	assert_string_equal(confirm(f, 0, RUNS), "=ok");
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, RUNS), "0008038A# 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	drop(f);
}

/* As after a restart of the bridge, or when a sensor started the motor. */
static void a_motion_not_begun_here_is_told_all_the_ends(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, RUNS);
	assert_int_equal(feedback(f).state, DB_AXIS_CONTINUOUS_MOTION);
	assert_string_equal(command(f, DB_CMD_STOP, (struct db_args){ 0 }),
	                    "00080384#00 0008039E#0102");
	assert_string_equal(confirm(f, 1, RUNS), "0008038A# 0008039E#0102");
	assert_string_equal(confirm(f, 2, RUNS), "0008039B#00 0008039E#0102");
	/* That this model may not know how to shake does not make the stop a failure. */
	assert_string_equal(confirm(f, 3, STANDS | VSMD_ST_CMD_WRG), "=ok");
	assert_false(feedback(f).status & DB_STATUS_REFUSED);
	drop(f);
}

/* Ending homing would clear the bit that says that it was done. */
static void a_homed_drive_that_moves_is_not_homing(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, RUNS | VSMD_ST_ZERO);
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 1, RUNS | VSMD_ST_ZERO), "0008039B#00 0008039E#0102");
	assert_string_equal(confirm(f, 2, STANDS | VSMD_ST_ZERO), "=ok");
	drop(f);
}

static void homing_found_between_two_phases_is_ended_too(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, RUNS);
	poll(f, 0, STANDS);
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "0008038A# 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "0008039B#00 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	/* Standing for long, it is not homing any more. */
	for (unsigned i = 0; i < 7; i++) {
		poll(f, 0, STANDS);
		f->now += 100 * MS;
	}
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	drop(f);
}

/* However short or long the cycle is. */
static void homing_may_stand_for_a_moment(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	for (unsigned cycle_ms = 1; cycle_ms <= 1000; cycle_ms *= 10) {
		unsigned polls = 0;

		poll(f, 0, STANDS);
		command(f, DB_CMD_HOME, (struct db_args){ 0 });
		confirm(f, 0, STANDS);
		assert_string_equal(confirm(f, 0, RUNS), "=ok");
		while (feedback(f).state == DB_AXIS_HOMING) {
			poll(f, 0, STANDS);
			f->now += (cycle_ms - 1) * MS;
			polls++;
		}
		assert_true(polls * cycle_ms > 500 && polls > 5);
		assert_true(polls * cycle_ms <= 500 + 2 * cycle_ms || polls == 6);
		assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
		assert_false(feedback(f).status & DB_STATUS_HOMED);
	}
	drop(f);
}

static void power_must_follow(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	for (unsigned i = 0; i < 2 * REACTION_MS; i++)
		assert_string_equal(confirm(f, 0, VSMD_ST_STP), "0008039E#0102");
	assert_string_equal(confirm(f, 0, VSMD_ST_STP), "00080381# 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	/* One that never follows has failed, however often it is told. */
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	for (unsigned i = 0; i < 200 && f->said[0] != '='; i++)
		confirm(f, 0, VSMD_ST_STP);
	assert_string_equal(f->said, "=failed");
	/* Off is said again while the power stays on. */
	command(f, DB_CMD_DISABLE, (struct db_args){ 0 });
	for (unsigned i = 0; i < 20; i++)
		assert_string_equal(confirm(f, 0, STANDS), "0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "00080382# 0008039E#0102");
	assert_string_equal(confirm(f, 0, VSMD_ST_STP), "=ok");
	drop(f);
}

/* --- relative moves and lost answers ------------------------------------------------------------------- */

static void a_relative_move_is_an_absolute_one(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 100, STANDS);
	command(f, DB_CMD_MOVE_RELATIVE, (struct db_args){ .target_position = 50 });
	/* It is at 110 by now, and a second reading in another frame agrees. */
	assert_string_equal(confirm(f, 110, STANDS), "0008039E#0101");
	assert_string_equal(place(f, 110), "00080386#000000A0 0008039E#0102");
	assert_string_equal(confirm(f, 111, RUNS), "=ok");
	drop(f);
}

static void a_lost_confirmation_never_repeats_a_relative_move(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 100, STANDS);
	command(f, DB_CMD_MOVE_RELATIVE, (struct db_args){ .target_position = 50 });
	confirm(f, 100, STANDS);
	place(f, 100);
	assert_string_equal(f->said, "00080386#00000096 0008039E#0102");
	assert_false(f->exchange.repeatable);
	/* Its answer is lost: the drive is read, and stands where it was to go. */
	assert_string_equal(lost(f), "0008039E#0102");
	assert_string_equal(confirm(f, 150, STANDS), "=ok");
	/* Or it has not moved at all: the same target again, not another 50. */
	poll(f, 150, STANDS);
	command(f, DB_CMD_MOVE_RELATIVE, (struct db_args){ .target_position = 50 });
	confirm(f, 150, STANDS);
	place(f, 150);
	lost(f);
	for (unsigned i = 0; i < 2 * REACTION_MS; i++)
		assert_string_equal(confirm(f, 150, STANDS), "0008039E#0102");
	assert_string_equal(confirm(f, 150, STANDS), "00080386#000000C8 0008039E#0102");
	/* Or nobody can tell. */
	lost(f);
	assert_string_equal(lost(f), "=indeterminate");
	drop(f);
}

static void saving_is_rate_limited_and_its_failure_seen(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
	assert_false(f->exchange.repeatable);
	assert_true(f->exchange.extra_time >= 100 * MS);
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_FLASH_ERR), "=failed");
	assert_string_equal(command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 }),
	                    "=rate_limited");
	f->now += 11000 * MS;
	command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
	assert_string_equal(lost(f), "=indeterminate");
	drop(f);
}

/* It may have moved since the command was checked: a target is never outside of the limits. */
static void a_relative_move_keeps_the_limits(void **state)
{
	static const struct {
		int32_t place;
		int32_t way;
		const char *said;
	} cases[] = {
		{ 100, 50, "00080386#00000096 0008039E#0102" },
		{ 150, 50, "00080386#000000C8 0008039E#0102" },
		{ 151, 50, "=limit" },
		{ 50, -70, "00080386#FFFFFFEC 0008039E#0102" },
		{ 49, -70, "=limit" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make(0, 0);

		f->drive.counts_per_unit = 10.0;
		f->drive.min_position = -2.0;
		f->drive.max_position = 20.0;
		db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
		poll(f, cases[i].place, STANDS);
		command(f, DB_CMD_MOVE_RELATIVE,
		        (struct db_args){ .target_position = cases[i].way });
		confirm(f, cases[i].place, STANDS);
		assert_string_equal(place(f, cases[i].place), cases[i].said);
		drop(f);
	}
}

static void a_relative_move_ends_where_counters_do(void **state)
{
	static const struct {
		int32_t place;
		int32_t way;
		bool in;
	} cases[] = {
		{ INT32_MAX - 10, 10, true },
		{ INT32_MAX - 10, 11, false },
		{ INT32_MIN + 10, -10, true },
		{ INT32_MIN + 10, -11, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make(0, 0);

		poll(f, cases[i].place, STANDS);
		command(f, DB_CMD_MOVE_RELATIVE,
		        (struct db_args){ .target_position = cases[i].way });
		confirm(f, cases[i].place, STANDS);
		place(f, cases[i].place);
		assert_true((strcmp(f->said, "=out_of_range") == 0) == !cases[i].in);
		drop(f);
	}
}

/* Three pairs of readings that do not agree, and no drive is as fast as that. */
static void a_relative_move_without_readings_that_agree_fails(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	for (unsigned moves = 0; moves < 2; moves++) {
		int32_t position = 0;
		unsigned reads = 0;

		poll(f, 0, moves ? RUNS : STANDS);
		command(f, DB_CMD_MOVE_RELATIVE, (struct db_args){ .target_position = 50 });
		while (f->said[0] != '=' && reads < 50) {
			position += moves ? 10000 : 1;
			if (reads++ % 2 == 0)
				confirm(f, position, moves ? RUNS : STANDS);
			else
				place(f, position);
		}
		assert_string_equal(f->said, "=failed");
		assert_int_equal(reads, 6);
	}
	drop(f);
}

/* What is read after the answer to an order was lost. */
static void a_lost_answer_is_looked_into(void **state)
{
	static const char again[] = "0008039E#0102";
	static const struct {
		enum db_command command;
		uint32_t before;
		int32_t position;
		uint32_t now;
		const char *said; /* how it begins */
	} cases[] = {
		{ DB_CMD_MOVE_ABSOLUTE, STANDS, 1, RUNS, "=ok" },
		{ DB_CMD_MOVE_ABSOLUTE, STANDS, 500, STANDS, "=ok" },
		{ DB_CMD_MOVE_ABSOLUTE, RUNS, 500, STANDS, "=ok" },
		{ DB_CMD_MOVE_ABSOLUTE, STANDS, 60, STANDS, "=indeterminate" },
		{ DB_CMD_MOVE_ABSOLUTE, STANDS, 0, STANDS, again },
		{ DB_CMD_MOVE_ABSOLUTE, STANDS, 0, STANDS | VSMD_ST_CMD_WRG, "=refused" },
		{ DB_CMD_MOVE_ABSOLUTE, STANDS, 60, STANDS | VSMD_ST_CMD_WRG, "=indeterminate" },
		{ DB_CMD_MOVE_ABSOLUTE, RUNS, 0, STANDS | VSMD_ST_CMD_WRG, "=indeterminate" },
		/* Said once more it changes nothing. */
		{ DB_CMD_MOVE_ABSOLUTE, RUNS, 60, RUNS, "00080386#" },
		{ DB_CMD_MOVE_VELOCITY, RUNS, 60, RUNS, "00080385#" },
		{ DB_CMD_MOVE_PRESET, RUNS, 60, RUNS, "00080385#" },
		{ DB_CMD_SET_POSITION, RUNS, 60, RUNS, "=indeterminate" },
		{ DB_CMD_SHAKE_START, RUNS, 60, RUNS, "=indeterminate" },
		{ DB_CMD_MOVE_VELOCITY, RUNS, 60, STANDS, "=indeterminate" },
		{ DB_CMD_MOVE_VELOCITY, STANDS, 60, RUNS, "=ok" },
		{ DB_CMD_MOVE_VELOCITY, STANDS, 500, STANDS, "=indeterminate" },
		/* That it is homed shows the end of homing, and of nothing else. */
		{ DB_CMD_MOVE_VELOCITY, STANDS, 0, STANDS | VSMD_ST_ZERO, again },
		{ DB_CMD_HOME, STANDS, 0, STANDS | VSMD_ST_ZERO, "=ok" },
		{ DB_CMD_HOME, STANDS, 0, STANDS, again },
		{ DB_CMD_HOME, STANDS, 60, RUNS, "=ok" },
		{ DB_CMD_SET_POSITION, STANDS, 500, STANDS, "=ok" },
		{ DB_CMD_SET_POSITION, STANDS, 500, RUNS, "=indeterminate" },
		{ DB_CMD_SET_POSITION, STANDS, 1, RUNS, "=indeterminate" },
		{ DB_CMD_SHAKE_START, STANDS, 0, STANDS, again },
	};
	const struct db_args args = { .target_position = 500,
		                      .target_velocity = 800.0f,
		                      .shake_frequency = 1.0f };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make(0, 0);

		poll(f, 0, cases[i].before);
		command(f, cases[i].command, args);
		if (cases[i].command == DB_CMD_HOME)
			confirm(f, 0, cases[i].before);
		assert_string_equal(lost(f), again);
		confirm(f, cases[i].position, cases[i].now);
		assert_memory_equal(f->said, cases[i].said, strlen(cases[i].said));
		/* It may be on its way there. */
		if (cases[i].command == DB_CMD_MOVE_ABSOLUTE)
			assert_int_equal(feedback(f).target, 500);
		assert_true(feedback(f).has_target == (cases[i].command == DB_CMD_MOVE_ABSOLUTE));
		drop(f);
	}
}

/* It has not moved in all its time: said again, and not for ever. A shake may have ended where it began. */
static void an_order_that_is_never_answered_is_said_three_times(void **state)
{
	static const struct {
		enum db_command command;
		unsigned said;
		const char *ends;
	} cases[] = {
		{ DB_CMD_MOVE_ABSOLUTE, 3, "=timeout" },
		{ DB_CMD_MOVE_VELOCITY, 3, "=timeout" },
		{ DB_CMD_SET_POSITION, 3, "=timeout" },
		{ DB_CMD_SHAKE_START, 1, "=indeterminate" },
	};
	const struct db_args args = { .target_position = 500,
		                      .target_velocity = 800.0f,
		                      .shake_frequency = 1.0f };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make(0, 0);
		unsigned said = 0;

		poll(f, 0, STANDS);
		command(f, cases[i].command, args);
		for (unsigned j = 0; j < 1000 && f->said[0] != '='; j++) {
			bool read = strcmp(f->said, "0008039E#0102") == 0;

			said += !read;
			if (read)
				confirm(f, 0, STANDS);
			else
				lost(f);
		}
		assert_string_equal(f->said, cases[i].ends);
		assert_int_equal(said, cases[i].said);
		drop(f);
	}
}

/* What a command that failed has left is not known: the older one does not explain the next. */
static void after_a_failed_move_nothing_is_taken_for_granted(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned said;

	(void)state;
	run_at_3000(f);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 3000.0f });
	assert_string_equal(confirm(f, 110, RUNS), "=ok");
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -3000.0f });
	assert_string_equal(go_on_with(f, 3000.0f, 200, "00080385#C53B8000 ", &said), "=failed");
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 3000.0f });
	assert_string_not_equal(confirm(f, 210, RUNS), "=ok");
	/* What is no motion changes nothing of that. */
	run_at_3000(f);
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++)
		confirm(f, 110, 0);
	assert_string_equal(f->said, "=failed");
	poll_running(f, 3000.0f, 120, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 3000.0f });
	assert_string_equal(confirm(f, 130, RUNS), "=ok");
	drop(f);
}

/* Every 10 ms, until the power must have followed. */
static void off_is_said_again_until_its_time_is_over(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned offs = 0;
	unsigned reads = 0;

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_DISABLE, (struct db_args){ 0 });
	for (; reads < 1000 && f->said[0] != '='; reads++) {
		offs += strncmp(f->said, "00080382#", 9) == 0;
		confirm(f, 0, STANDS);
	}
	assert_string_equal(f->said, "=failed");
	assert_int_equal(offs, 2);
	assert_int_equal(reads, 2 * REACTION_MS + 1);
	drop(f);
}

/* Shaking or homing that may have begun is ended by a stop. */
static void a_stop_ends_what_may_have_begun(void **state)
{
	const struct db_args shake = { .shake_frequency = 1.0f, .shake_end_position = 50 };
	static const enum db_command commands[] = { DB_CMD_SHAKE_START, DB_CMD_SHAKE_START_TIME };
	struct fixture *f = make(0, 0);

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		poll(f, 0, STANDS);
		command(f, commands[i], shake);
		command(f, DB_CMD_STOP, (struct db_args){ 0 });
		assert_string_equal(confirm(f, 0, STANDS), "0008039B#00 0008039E#0102");
		assert_string_equal(confirm(f, 0, STANDS), "=ok");
		command(f, DB_CMD_STOP, (struct db_args){ 0 });
		assert_string_equal(confirm(f, 0, STANDS), "=ok");
	}
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	confirm(f, 0, STANDS);
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "0008038A# 0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	drop(f);
}

/* Each port is set, and has its own time and its own repeats. */
static void outputs_are_set_one_after_the_other(void **state)
{
	const struct db_args both = { .output_mask = 3, .output_levels = 3 };
	struct fixture *f = make(0, 0);
	unsigned said[2] = { 0, 0 };

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_SET_OUTPUTS, both);
	for (unsigned port = 0; port < 2; port++) {
		uint32_t levels = STANDS | (port > 0 ? VSMD_ST_S1 : 0);

		assert_memory_equal(f->said, "00080388#", 9);
		for (unsigned i = 0; i < 30; i++)
			assert_string_equal(confirm(f, 0, levels), "0008039E#0102");
		confirm(f, 0, levels | (port > 0 ? VSMD_ST_S2 : VSMD_ST_S1));
	}
	assert_string_equal(f->said, "=ok");
	poll(f, 0, STANDS);
	command(f, DB_CMD_SET_OUTPUTS, both);
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++) {
		said[0] += strncmp(f->said, "00080388#01", 11) == 0;
		said[1] += strncmp(f->said, "00080388#02", 11) == 0;
		confirm(f, 0, STANDS);
	}
	assert_string_equal(f->said, "=unproven");
	assert_int_equal(said[0], 3);
	assert_int_equal(said[1], 3);
	drop(f);
}

static void saving_is_allowed_again_when_its_time_is_over(void **state)
{
	struct fixture *f = make(0, 0);
	db_time began = f->now;

	(void)state;
	for (unsigned i = 0; i < 2; i++) {
		command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
		assert_string_equal(confirm(f, 0, STANDS), "=unproven");
		began += i == 0 ? 0 : 10000 * MS;
		f->now = began + 10000 * MS - 1;
		assert_string_equal(command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 }),
		                    "=rate_limited");
		f->now++;
	}
	drop(f);
}

/* An encoder error is cleared in the drive, whether or not its position is doubted; a doubt alone is not. */
static void a_fault_is_cleared_where_there_is_one(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 5000, STANDS);
	poll(f, 0, STANDS);
	assert_int_not_equal(feedback(f).doubt, DB_DOUBT_NONE);
	assert_string_equal(command(f, DB_CMD_CLEAR_FAULT, (struct db_args){ 0 }), "=ok");
	assert_int_equal(feedback(f).doubt, DB_DOUBT_NONE);
	poll(f, 5000, STANDS);
	poll(f, 0, STANDS);
	assert_int_not_equal(feedback(f).doubt, DB_DOUBT_NONE);
	poll(f, 0, STANDS | VSMD_ST_ENC_ERR);
	assert_string_not_equal(command(f, DB_CMD_CLEAR_FAULT, (struct db_args){ 0 }), "=ok");
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	assert_int_equal(feedback(f).doubt, DB_DOUBT_NONE);
	drop(f);
}

/* A target is shown as long as the drive has it. */
static void a_target_does_not_outlive_its_move(void **state)
{
	static const struct {
		enum db_command command;
		uint32_t status;
	} cases[] = {
		{ DB_CMD_STOP, STANDS },
		{ DB_CMD_SET_POSITION, STANDS },
		{ DB_CMD_DISABLE, VSMD_ST_STP },
		{ DB_CMD_MOVE_VELOCITY, RUNS },
	};
	const struct db_args args = { .target_position = 500, .target_velocity = 800.0f };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make(0, 0);

		poll(f, 0, STANDS);
		command(f, DB_CMD_MOVE_ABSOLUTE, args);
		assert_string_equal(confirm(f, 1, RUNS), "=ok");
		poll(f, 500, STANDS);
		assert_true(feedback(f).has_target);
		assert_true(feedback(f).status & DB_STATUS_AT_TARGET);
		command(f, cases[i].command, args);
		assert_string_equal(confirm(f, 500, cases[i].status), "=ok");
		assert_false(feedback(f).has_target);
		assert_false(feedback(f).status & DB_STATUS_AT_TARGET);
		drop(f);
	}
}

/* speed-sign=position: the direction is that in which its place changes, and stays while it does not. */
static void a_speed_has_the_sign_of_its_way(void **state)
{
	static const struct {
		int32_t position;
		float shown;
	} cases[] = {
		{ 1000, 800.0f }, { 900, -800.0f }, { 905, -800.0f }, { 895, -800.0f },
		{ 906, 800.0f },  { 896, 800.0f },  { 885, -800.0f },
	};
	struct fixture *f = make(0, 0);

	(void)state;
	fake_set_option(&db_driver_vsmd_can, &f->options, "speed-sign", 1);
	f->drive.in_position_window = 10.0;
	db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		poll_running(f, 800.0f, cases[i].position, RUNS);
		assert_float_equal(feedback(f).velocity, cases[i].shown, 0.0f);
	}
	drop(f);
	f = make(0, 0);
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		poll_running(f, 800.0f, cases[i].position, RUNS);
		assert_float_equal(feedback(f).velocity, 800.0f, 0.0f);
	}
	drop(f);
}

/* A drive that tells its speed without a sign runs backwards. When it is told to run faster, its
 * speed shows that it obeys. */
static struct fixture *run_backwards_without_a_sign(void)
{
	struct fixture *f = make(0, 0);

	fake_set_option(&db_driver_vsmd_can, &f->options, "speed-sign", 1);
	f->drive.in_position_window = 2.0;
	db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
	poll(f, 1000, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -1000.0f });
	assert_string_equal(confirm(f, 999, RUNS), "=ok");
	poll_running(f, 1000.0f, 960, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -2000.0f });
	assert_string_equal(confirm(f, 959, RUNS), "0008039E#0001");
	assert_string_equal(speed(f, 1000.0f), "0008039E#0102");
	assert_string_equal(confirm(f, 958, RUNS), "0008039E#0001");
	assert_string_equal(speed(f, 2000.0f), "=ok");
	poll_running(f, 2000.0f, 900, RUNS);
	return f;
}

/* The drive is told to turn round. Its position shows when it has, without waiting for the next
 * poll; as long as the position goes on as before, the command is not obeyed. */
static void a_speed_without_a_sign_has_that_of_the_way(void **state)
{
	struct fixture *f = run_backwards_without_a_sign();

	(void)state;
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 2000.0f });
	assert_string_equal(confirm(f, 899, RUNS), "0008039E#0001");
	assert_string_equal(speed(f, 2000.0f), "0008039E#0102");
	assert_string_equal(confirm(f, 901, RUNS), "0008039E#0001");
	assert_string_equal(speed(f, 2000.0f), "0008039E#0102");
	assert_string_equal(confirm(f, 902, RUNS), "0008039E#0001");
	assert_string_equal(speed(f, 2000.0f), "=ok");
	drop(f);
	f = run_backwards_without_a_sign();
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 2000.0f });
	for (int32_t position = 899; f->said[0] != '=';) {
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, 2000.0f);
		else
			confirm(f, position--, RUNS);
	}
	assert_string_equal(f->said, "=failed");
	drop(f);
}

/* The position moves by less than the in-position window from one reading to the next; all these
 * steps together show the direction. */
static void a_slow_way_has_a_direction(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	fake_set_option(&db_driver_vsmd_can, &f->options, "speed-sign", 1);
	f->drive.in_position_window = 10.0;
	db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
	for (int32_t position = 1000; position > 900; position -= 4) {
		poll_running(f, 80.0f, position, RUNS);
		assert_float_equal(feedback(f).velocity, position < 990 ? -80.0f : 80.0f, 0.0f);
	}
	drop(f);
	/* A drive that stood moves in the direction of its command. */
	f = run_backwards_without_a_sign();
	poll(f, 900, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 1000 });
	assert_string_equal(confirm(f, 900, RUNS), "=ok");
	poll_running(f, 80.0f, 900, RUNS);
	assert_float_equal(feedback(f).velocity, 80.0f, 0.0f);
	poll(f, 1000, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -80.0f });
	assert_string_equal(confirm(f, 1000, RUNS), "=ok");
	poll_running(f, 80.0f, 1000, RUNS);
	assert_float_equal(feedback(f).velocity, -80.0f, 0.0f);
	drop(f);
}

/* The result of the command while the drive runs at this velocity, and its position changes by
 * `step` from each reading to the next. */
static const char *run_on(struct fixture *f, float velocity, int32_t position, int32_t step)
{
	while (f->said[0] != '=') {
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, velocity);
		else
			confirm(f, position, RUNS);
		position = (int32_t)((uint32_t)position + (uint32_t)step);
	}
	return f->said;
}

/* A position that jumps because it was set does not show a direction. */
static void a_position_that_was_set_shows_no_direction(void **state)
{
	struct fixture *f = run_backwards_without_a_sign();

	(void)state;
	command(f, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 90000 });
	assert_string_equal(run_on(f, 2000.0f, 90000, -1), "=ok");
	assert_true(((struct vsmd_axis *)f->device)->last.velocity < 0.0f);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 1000.0f });
	assert_string_equal(run_on(f, 2000.0f, 89990, 0), "=failed");
	drop(f);
}

/* An overflow of the position counter does not look as if the drive had turned round, neither with
 * the sign of the speed nor without it. */
static void a_counter_that_overflows_does_not_look_like_a_turn(void **state)
{
	(void)state;
	for (unsigned without_sign = 0; without_sign < 2; without_sign++) {
		struct fixture *f = make(0, 0);

		fake_set_option(&db_driver_vsmd_can, &f->options, "speed-sign", without_sign);
		db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
		poll(f, INT32_MAX - 100, STANDS);
		command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 1000.0f });
		assert_string_equal(confirm(f, INT32_MAX - 99, RUNS), "=ok");
		poll_running(f, 1000.0f, INT32_MAX - 10, RUNS);
		command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -1000.0f });
		assert_string_equal(run_on(f, 1000.0f, INT32_MAX - 8, 3), "=failed");
		poll_running(f, 1000.0f, INT32_MIN + 500, RUNS);
		assert_float_equal(feedback(f).velocity, 1000.0f, 0.0f);
		drop(f);
	}
}

/* The drive still turns round for its last command when it gets the next one. Without a sign its
 * speed falls and grows again, as if it had taken the next command, too, which it may never have
 * received. */
static void a_speed_that_turns_round_proves_nothing(void **state)
{
	static const float speeds[] = { 300.0f, 100.0f, 200.0f, 500.0f, 900.0f, 1000.0f };
	struct fixture *f = make(0, 0);

	(void)state;
	fake_set_option(&db_driver_vsmd_can, &f->options, "speed-sign", 1);
	f->drive.in_position_window = 10.0;
	db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 1000.0f });
	assert_string_equal(confirm(f, 1, RUNS), "=ok");
	poll_running(f, 1000.0f, 100, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -1000.0f });
	assert_string_equal(confirm(f, 101, RUNS), "0008039E#0001");
	speed(f, 1000.0f);
	assert_string_equal(confirm(f, 102, RUNS), "0008039E#0001");
	assert_string_equal(speed(f, 400.0f), "=ok");
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 1000.0f });
	for (unsigned i = 0; f->said[0] != '='; i++) {
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, speeds[i / 2 < 6 ? i / 2 : 5]);
		else
			confirm(f, 102, RUNS);
	}
	assert_string_equal(f->said, "=unproven");
	drop(f);
}

/* After readings that showed no effect yet, a lost answer gives the command its whole time again. */
static void a_lost_look_begins_anew(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 500 });
	for (unsigned i = 0; i < 30; i++)
		assert_string_equal(confirm(f, 0, STANDS), "0008039E#0102");
	lost(f);
	for (unsigned i = 0; i < 2 * REACTION_MS; i++)
		assert_string_equal(confirm(f, 0, STANDS), "0008039E#0102");
	assert_memory_equal(confirm(f, 0, STANDS), "00080386#", 9);
	drop(f);
}

/* A motion that the older command explains, too, is watched for 20 ms, however slow the drive may be. */
static void what_stays_open_ends_soon(void **state)
{
	struct fixture *f = make(0, 0);
	db_time first;

	(void)state;
	fake_set_option(&db_driver_vsmd_can, &f->options, "reaction-ms", 500);
	db_driver_vsmd_can.init(f->device, NULL, &f->bus, &f->drive);
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 3000.0f });
	assert_string_equal(confirm(f, 1, RUNS), "=ok");
	poll_running(f, 1000.0f, 100, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 2000.0f });
	assert_string_equal(confirm(f, 110, RUNS), "0008039E#0001");
	first = f->now;
	assert_memory_equal(speed(f, 2000.0f), "00080385#44FA0000 ", 18);
	while (f->said[0] != '=') {
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, 2000.0f);
		else
			confirm(f, 110, RUNS);
	}
	assert_string_equal(f->said, "=unproven");
	assert_int_equal(f->now - first, 20 * MS);
	drop(f);
}

/* Only a further end, which the model may not know, may be refused. */
static void a_stop_may_not_be_refused(void **state)
{
	static const enum db_command commands[] = { DB_CMD_STOP, DB_CMD_QUICK_STOP,
		                                    DB_CMD_DISABLE };
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, RUNS);
	for (size_t i = 0; i < sizeof(commands) / sizeof(commands[0]); i++) {
		command(f, commands[i], (struct db_args){ 0 });
		assert_string_equal(confirm(f, 1, RUNS | VSMD_ST_CMD_WRG), "=refused");
		assert_true(feedback(f).status & DB_STATUS_REFUSED);
	}
	drop(f);
}

/* What a command does to the homing bit is no sign of a restart. */
static void ending_homing_is_no_restart(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	command(f, DB_CMD_HOME_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	assert_int_equal(feedback(f).doubts, 0);
	assert_int_equal(feedback(f).restarts, 0);
	/* Said again because it did not show, it is not repeated for a lost answer as well. */
	poll(f, 0, STANDS | VSMD_ST_ZERO);
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	assert_true(f->exchange.repeatable);
	do
		confirm(f, 0, STANDS | VSMD_ST_ZERO);
	while (strncmp(f->said, "0008038A#", 9) != 0);
	assert_false(f->exchange.repeatable);
	drop(f);
}

static void told_a_setting(struct fixture *f, enum vsmd_param param, union db_value value)
{
	const struct vsmd_axis *axis = (const struct vsmd_axis *)f->device;
	uint32_t generation = axis->plate.generation;
	struct db_setting setting = { .param = (uint16_t)param, .value = value };
	const struct db_request request = { .settings = &setting, .setting_count = 1 };

	vsmd_take_settings((struct vsmd_axis *)f->device, &request);
	assert_int_equal(axis->plate.generation, generation + 1);
}

/* A running motor follows its preset speed at once; other settings do not touch it. */
static void another_preset_speed_may_change_a_run(void **state)
{
	const struct db_args same = { .target_velocity = 3000.0f };
	struct fixture *f = make(0, 0);

	(void)state;
	run_at_3000(f);
	told_a_setting(f, VSMD_MCS, (union db_value){ .u = 4 });
	command(f, DB_CMD_MOVE_VELOCITY, same);
	assert_string_equal(confirm(f, 110, RUNS), "=ok");
	told_a_setting(f, VSMD_SPD, (union db_value){ .f = 500.0f });
	command(f, DB_CMD_MOVE_VELOCITY, same);
	assert_string_not_equal(confirm(f, 120, RUNS), "=ok");
	drop(f);
}

/* Of a port that is an output its level is not documented to show. */
static void an_output_without_a_level_is_unproven(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	told_a_setting(f, VSMD_S5, (union db_value){ .u = 1 });
	poll(f, 0, STANDS);
	command(f, DB_CMD_SET_OUTPUT, (struct db_args){ .output_number = 5, .output_value = 1 });
	for (unsigned i = 0; i < 1000 && f->said[0] != '='; i++)
		confirm(f, 0, STANDS);
	assert_string_equal(f->said, "=unproven");
	drop(f);
}

/* What was stopping does so until it stands; what moves it then is not known. */
static void what_stands_is_at_rest(void **state)
{
	const struct db_args back = { .target_velocity = -3000.0f };
	struct fixture *f = make(0, 0);

	(void)state;
	run_at_3000(f);
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	confirm(f, 110, RUNS);
	assert_int_equal(feedback(f).state, DB_AXIS_STOPPING);
	poll(f, 120, STANDS);
	assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
	assert_false(feedback(f).status & DB_STATUS_MOVING);
	/* Something else starts it: it is not stopping, and may turn for that reason as well. */
	poll_running(f, 100.0f, 130, RUNS);
	assert_int_equal(feedback(f).state, DB_AXIS_CONTINUOUS_MOTION);
	command(f, DB_CMD_MOVE_VELOCITY, back);
	confirm(f, 140, RUNS);
	speed(f, 100.0f);
	confirm(f, 150, RUNS);
	assert_memory_equal(speed(f, -500.0f), "00080385#C53B8000 ", 18);
	assert_string_equal(command(f, DB_CMD_STOP, (struct db_args){ 0 }),
	                    "00080384#00 0008039E#0102");
	assert_string_equal(confirm(f, 140, RUNS), "0008038A# 0008039E#0102");
	drop(f);
}

/* Told to stop and to shake while it stands: nothing ends, and it counts as moving until it was seen. */
static void a_motion_counts_from_its_order_on(void **state)
{
	const struct db_args shake = { .shake_frequency = 1.0f, .shake_end_position = 50 };
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "=ok");
	assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
	command(f, DB_CMD_SHAKE_START, shake);
	assert_string_equal(confirm(f, 1, RUNS), "=unproven");
	assert_int_equal(feedback(f).state, DB_AXIS_CONTINUOUS_MOTION);
	/* Between two strokes, too, a stop ends it. */
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 1, RUNS), "0008039B#00 0008039E#0102");
	assert_string_equal(confirm(f, 1, STANDS), "=ok");
	/* Until a cycle has seen it standing it counts as moving. */
	assert_true(feedback(f).status & DB_STATUS_MOVING);
	poll(f, 1, STANDS);
	assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
	/* Nothing is left of the shaking. */
	command(f, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 1, STANDS), "=ok");
	drop(f);
}

/* --- parameters ---------------------------------------------------------------------------------------- */

static void set(struct fixture *f, enum vsmd_param param, uint32_t value)
{
	struct db_setting *setting = &f->settings[f->request.setting_count++];

	f->request.settings = f->settings;
	setting->param = (uint16_t)param;
	setting->value.u = value;
}

static void a_plain_register_is_written_and_read_back(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	/* Never 00080382, which would disable the motor. */
	assert_string_equal(begin(f, DB_JOB_SETTINGS),
	                    "00080302#00000005 0008039F#0201 0008039E#0B01");
	assert_string_equal(data(f, 0x03, 5), "ignored");
	assert_string_equal(data(f, 0x02, 5), "=ok");
	assert_int_equal(db_driver_vsmd_can.nameplate(f->device)->values[VSMD_MCS].u, 5);
	begin(f, DB_JOB_SETTINGS);
	/* The drive holds something else: that is shown. */
	assert_string_equal(data(f, 0x02, 4), "00080302#00000005 0008039F#0201 0008039E#0B01");
	assert_string_equal(data(f, 0x02, 4), "0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "=refused");
	assert_int_equal(db_driver_vsmd_can.nameplate(f->device)->values[VSMD_MCS].u, 4);
	assert_false(db_driver_vsmd_can.nameplate(f->device)->doubtful);
	/* A register that this model has not: asked for once more, as a frame may have been lost. */
	begin(f, DB_JOB_SETTINGS);
	assert_string_equal(guard(f), "0008039F#0201 0008039E#0B01");
	assert_string_equal(guard(f), "=unsupported");
	begin(f, DB_JOB_SETTINGS);
	guard(f);
	assert_string_equal(data(f, 0x02, 5), "=ok");
	drop(f);
}

/* A lost frame, a refusal, and a drive that does not care. */
static void a_write_that_does_not_show_is_written_once_more(void **state)
{
	static const char write[] = "00080302#00000006 0008039F#0201 0008039E#0B01";
	struct fixture *f = make(0, 0);

	(void)state;
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	assert_string_equal(data(f, 0x02, 5), "=ok");
	f->settings[0].value.u = 6;
	assert_string_equal(begin(f, DB_JOB_SETTINGS), write);
	assert_string_equal(data(f, 0x02, 5), write);
	assert_string_equal(data(f, 0x02, 6), "=ok");
	f->settings[0].value.u = 5;
	begin(f, DB_JOB_SETTINGS);
	data(f, 0x02, 6);
	assert_string_equal(data(f, 0x02, 6), "0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_CMD_WRG), "=refused");
	assert_true(feedback(f).status & DB_STATUS_REFUSED);
	begin(f, DB_JOB_SETTINGS);
	data(f, 0x02, 6);
	assert_string_equal(data(f, 0x02, 6), "0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "=failed");
	assert_int_equal(db_driver_vsmd_can.nameplate(f->device)->values[VSMD_MCS].u, 6);
	assert_false(feedback(f).status & DB_STATUS_REFUSED);
	drop(f);
}

static void a_packed_register_keeps_its_other_parameters(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_S1R, 3);
	set(f, VSMD_MCS, 2);
	set(f, VSMD_S2R, 4);
	assert_string_equal(begin(f, DB_JOB_SETTINGS), "0008039F#0901 0008039E#0B01");
	/* s1f, s1r, s2f, s2r */
	assert_string_equal(data(f, 0x09, 0x01020506),
	                    "00080309#01030504 0008039F#0901 0008039E#0B01");
	assert_string_equal(data(f, 0x09, 0x01030504),
	                    "00080302#00000002 0008039F#0201 0008039E#0B01");
	assert_string_equal(data(f, 0x02, 2), "=ok");
	drop(f);
}

/* Identifies a drive that lacks these registers; how many reads it took. */
static unsigned identify_without(struct fixture *f, unsigned lack_first, unsigned lack_last,
                                 unsigned other)
{
	unsigned reads = 0;

	begin(f, DB_JOB_IDENTIFY);
	answer(f, frame_of(0x0008020A, 0x56534D44, 0x20202020, 8));
	answer(f, frame_of(0x0008020C, 0x20202020, 0x20202020, 8));
	answer(f, frame_of(0x0008020E, 0x20202020, 0x20202020, 8));
	answer(f, frame_of(0x00080210, 0x20202020, 0, 4));
	while (f->said[0] != '=') {
		unsigned first;
		unsigned count;
		bool silent;

		assert_true(++reads < 200);
		assert_int_equal(sscanf(f->said, "0008039F#%2x%2x 0008039E#0B01", &first, &count),
		                 2);
		silent = (first <= lack_last && first + count > lack_first) ||
		         (first <= other && first + count > other);
		for (unsigned reg = first; reg < first + count && !silent; reg += 2)
			answer(f,
			       frame_of(0x00080280 + reg, 1, 1, first + count - reg > 1 ? 8 : 4));
		guard(f);
	}
	assert_string_equal(f->said, "=ok");
	return reads;
}

static bool is_valid(const struct fixture *f, enum vsmd_param param)
{
	return db_driver_vsmd_can.nameplate(f->device)->valid[0] >> param & 1;
}

static void a_model_without_some_registers_is_identified_at_once(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned reads = identify_without(f, 0x1C, 0x2B, 0x0B);

	(void)state;
	assert_true(is_valid(f, VSMD_MCS) && is_valid(f, VSMD_CRH) && is_valid(f, VSMD_S4R) &&
	            is_valid(f, VSMD_PUD) && is_valid(f, VSMD_ZAR));
	assert_false(is_valid(f, VSMD_S5F) || is_valid(f, VSMD_ZCR) || is_valid(f, VSMD_SPL));
	assert_true(reads > 20);
	/* What it lacks is remembered, also over a time offline ... */
	db_driver_vsmd_can.gone(f->device);
	assert_true(identify_without(f, 0x1C, 0x2B, 0x0B) < 10);
	/* ... until somebody asks. */
	command(f, DB_CMD_READ_PARAMETERS, (struct db_args){ 0 });
	assert_true(identify_without(f, 0xFF, 0xFE, 0xFF) < 10);
	assert_true(is_valid(f, VSMD_S5F) && is_valid(f, VSMD_SPL));
	drop(f);
}

/* The text of an identification: this word, and blanks. */
static const char *tell_identity(struct fixture *f, uint32_t word)
{
	answer(f, frame_of(0x0008020A, word, 0x20202020, 8));
	answer(f, frame_of(0x0008020C, 0x20202020, 0x20202020, 8));
	answer(f, frame_of(0x0008020E, 0x20202020, 0x20202020, 8));
	return answer(f, frame_of(0x00080210, 0x20202020, 0, 4));
}

/* These registers are read now, and no others; then the answer of all of them, or of none. */
static void is_read(struct fixture *f, unsigned first, unsigned count, bool answered)
{
	char said[64];

	sprintf(said, "0008039F#%02X%02X 0008039E#0B01", first, count);
	assert_string_equal(f->said, said);
	for (unsigned reg = first; reg < first + count && answered; reg += 2)
		assert_string_equal(answer(f, frame_of(0x00080280 + reg, 1, 1,
		                                       first + count - reg > 1 ? 8 : 4)),
		                    "more");
	guard(f);
}

/* A frame may have been lost: it takes two reads of one register alone to say that a model lacks it. */
static void a_register_is_missing_that_was_asked_for_twice(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);
	uint32_t generation;

	(void)state;
	begin(f, DB_JOB_IDENTIFY);
	tell_identity(f, 0x56534D44);
	is_read(f, 0x00, 8, false);
	is_read(f, 0x00, 4, false);
	generation = plate->generation;
	is_read(f, 0x00, 2, true);
	/* What is known is shown at once. */
	assert_true(is_valid(f, VSMD_CID));
	assert_int_equal(plate->generation, generation + 1);
	assert_false(feedback(f).status & DB_STATUS_PARAMS_VALID);
	is_read(f, 0x02, 2, false);
	is_read(f, 0x02, 1, false);
	is_read(f, 0x02, 1, false);
	/* The one after it has its own two. */
	is_read(f, 0x03, 1, false);
	is_read(f, 0x03, 1, true);
	is_read(f, 0x04, 8, false);
	is_read(f, 0x04, 4, false);
	is_read(f, 0x04, 2, false);
	is_read(f, 0x04, 1, false);
	is_read(f, 0x04, 1, true);
	is_read(f, 0x05, 1, false);
	is_read(f, 0x05, 1, true);
	is_read(f, 0x06, 8, true);
	is_read(f, 0x0E, 8, true);
	is_read(f, 0x17, 8, true);
	is_read(f, 0x1F, 8, true);
	is_read(f, 0x27, 2, true);
	is_read(f, 0x2A, 2, true);
	assert_string_equal(f->said, "=ok");
	assert_false(is_valid(f, VSMD_MCS));
	assert_true(is_valid(f, VSMD_SPD) && is_valid(f, VSMD_ACC) && is_valid(f, VSMD_DEC) &&
	            is_valid(f, VSMD_SPL));
	assert_true(feedback(f).status & DB_STATUS_PARAMS_VALID);
	/* Another model may have it ... */
	begin(f, DB_JOB_IDENTIFY);
	tell_identity(f, 0x56534D44);
	is_read(f, 0x00, 2, true);
	begin(f, DB_JOB_IDENTIFY);
	tell_identity(f, 0x56534D45);
	is_read(f, 0x00, 8, true);
	/* ... and what one does not answer any more is not known of it. */
	is_read(f, 0x08, 8, true);
	is_read(f, 0x10, 6, true);
	is_read(f, 0x17, 8, true);
	is_read(f, 0x1F, 8, true);
	is_read(f, 0x27, 2, true);
	is_read(f, 0x2A, 2, false);
	is_read(f, 0x2A, 1, true);
	is_read(f, 0x2B, 1, false);
	is_read(f, 0x2B, 1, false);
	assert_string_equal(f->said, "=ok");
	assert_true(is_valid(f, VSMD_SML));
	assert_false(is_valid(f, VSMD_SPL));
	/* A request for all parameters is answered with all of them. */
	command(f, DB_CMD_READ_PARAMETERS, (struct db_args){ 0 });
	tell_identity(f, 0x56534D45);
	is_read(f, 0x00, 8, true);
	is_read(f, 0x08, 8, true);
	is_read(f, 0x10, 6, true);
	is_read(f, 0x17, 8, true);
	is_read(f, 0x1F, 8, true);
	is_read(f, 0x27, 2, true);
	is_read(f, 0x2A, 2, true);
	assert_string_equal(f->said, "=ok");
	assert_true(is_valid(f, VSMD_SPL));
	drop(f);
}

/* In its turn comes the only one that there is. */
static void a_single_register_is_read_again_and_again(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	identify_without(f, 0x01, 0x2B, 0xFF);
	for (unsigned i = 0; i < 3; i++) {
		assert_int_equal(refresh(f), 0x00);
		assert_string_equal(data(f, 0x00, 1), "=ok");
	}
	drop(f);
}

/* An empty text is none. */
static void an_identity_is_what_was_told_last(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);

	(void)state;
	begin(f, DB_JOB_IDENTIFY);
	tell_identity(f, 0x56534D44);
	assert_string_equal(plate->identity, "VSMD");
	begin(f, DB_JOB_IDENTIFY);
	tell_identity(f, 0x20202020);
	assert_string_equal(plate->identity, "VSMD");
	begin(f, DB_JOB_IDENTIFY);
	tell_identity(f, 0x56202020);
	assert_string_equal(plate->identity, "V");
	/* As long as there is room for. */
	begin(f, DB_JOB_IDENTIFY);
	for (unsigned reg = 0; reg < 6; reg += 2)
		answer(f, frame_of(0x0008020A + reg, 0x41424344, 0x45464748, 8));
	answer(f, frame_of(0x00080210, 0x41424344, 0, 4));
	assert_string_equal(plate->identity, "ABCDEFGHABCDEFGHABCDEFGHABCD");
	drop(f);
}

/* A drive that answers no long read: everything is asked for in parts, and put together again. */
static void a_drive_that_tells_two_registers_at_once(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	begin(f, DB_JOB_POLL);
	begin(f, DB_JOB_POLL);
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0002 0008039E#0201");
	assert_string_equal(answer(f, frame_of(0x00080200, 0x44C80000, 111, 8)), "more");
	assert_string_equal(answer(f, frame_of(0x00080202, RUNS, 0, 4)), "=ok");
	assert_int_equal(feedback(f).position, 111);
	assert_true(feedback(f).velocity == 1600.0f);
	/* There is no room for the reports and the identity in one burst. */
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#00 0008039E#0B01");
	assert_string_equal(guard(f), "0008039E#0A02 0008039E#0C02 0008039E#0E02 0008039E#1001");
	assert_int_equal(f->exchange.answer_length, 4 * 8 + 7 * 4);
	tell_identity(f, 0x56534D44);
	assert_string_equal(db_driver_vsmd_can.nameplate(f->device)->identity, "VSMD");
	is_read(f, 0x00, 2, true);
	is_read(f, 0x02, 2, true);
	assert_true(is_valid(f, VSMD_MCS));
	drop(f);
}

/* A drive that is only ever asked for two has not shown that it tells three. */
static void a_short_read_shows_nothing_of_long_ones(void **state)
{
	struct fixture *f = make_reporting(0, 50, 1);

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		begin(f, DB_JOB_POLL);
		assert_string_equal(answer(f, frame_of(0x00080201, 0, STANDS, 8)), "=ok");
	}
	assert_string_equal(command(f, DB_CMD_ENABLE, (struct db_args){ 0 }),
	                    "00080381# 0008039E#0003");
	assert_string_equal(lost(f), "=timeout");
	assert_string_equal(command(f, DB_CMD_ENABLE, (struct db_args){ 0 }),
	                    "00080381# 0008039E#0003");
	assert_string_equal(lost(f), "=timeout");
	assert_string_equal(command(f, DB_CMD_ENABLE, (struct db_args){ 0 }),
	                    "00080381# 0008039E#0002 0008039E#0201");
	drop(f);
}

/* Lost short reads do not show that the drive leaves long reads unanswered, no matter how many were
 * lost; and one answered long read shows that it answers long reads. */
static void a_lost_short_read_shows_nothing_of_long_ones(void **state)
{
	(void)state;
	for (unsigned identity = 0; identity < 2; identity++) {
		struct fixture *f = make_reporting(0, 50, 1);

		for (unsigned i = 0; i < 4; i++)
			begin(f, DB_JOB_POLL);
		assert_string_equal(command(f, DB_CMD_ENABLE, (struct db_args){ 0 }),
		                    "00080381# 0008039E#0003");
		lost(f);
		if (identity) {
			begin(f, DB_JOB_IDENTIFY);
			tell_identity(f, 0x56534D44);
		} else {
			command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
			answer(f, frame_of(0x00080200, 0, 0, 8));
			assert_string_equal(answer(f, frame_of(0x00080202, STANDS, 0, 4)), "=ok");
		}
		for (unsigned i = 0; i < 4; i++) {
			assert_string_equal(command(f, DB_CMD_ENABLE, (struct db_args){ 0 }),
			                    "00080381# 0008039E#0003");
			lost(f);
		}
		drop(f);
	}
}

/* Lost reads that were to confirm stops do not show that the drive leaves long reads unanswered: it
 * may be gone. */
static void lost_stops_show_nothing_of_long_reads(void **state)
{
	struct fixture *f = make_reporting(0, 50, 1);

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		command(f, DB_CMD_STOP, (struct db_args){ 0 });
		lost(f);
	}
	begin(f, DB_JOB_POLL);
	answer(f, frame_of(0x00080201, 0, STANDS, 8));
	assert_string_equal(command(f, DB_CMD_ENABLE, (struct db_args){ 0 }),
	                    "00080381# 0008039E#0003");
	drop(f);
}

/* If the cyclic reads are short, the read of the identity is the first long one: after two losses
 * the identity is asked for in parts. */
static void a_lost_identity_is_asked_for_in_parts(void **state)
{
	struct fixture *f = make_reporting(0, 50, 1);

	(void)state;
	for (unsigned i = 0; i < 2; i++) {
		begin(f, DB_JOB_PROBE);
		answer(f, frame_of(0x0008020A, 0x56534D44, 0, 4));
		assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#020032 0008039E#0A07");
		lost(f);
	}
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#020032 0008039E#0B01");
	assert_string_equal(guard(f), "0008039E#0A02 0008039E#0C02 0008039E#0E02 0008039E#1001");
	drop(f);
}

/* A command is confirmed by a read of two registers, and the cyclic read has three. Lost reads of
 * two do not show that the drive leaves those of three unanswered. */
static void a_lost_confirmation_shows_nothing_of_long_reads(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
		lost(f);
	}
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	drop(f);
}

/* Until one is answered; that one is kept. */
static void probes_are_tried_in_turn(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0A01");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0001");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039F#0001");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0A01");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0001");
	assert_string_equal(speed(f, 0.0f), "=ok");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0001");
	assert_string_equal(answer(f, frame_of(0x0008020A, 0x56534D44, 0, 4)), "ignored");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0001");
	/* What it answers follows what it may not answer: here it tells no identity. */
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#00 0008039E#0A07 0008039E#0001");
	assert_string_equal(speed(f, 0.0f), "0008039F#0008 0008039E#0001");
	assert_string_equal(db_driver_vsmd_can.nameplate(f->device)->identity, "");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0001");
	/* It tells one all the same: then that is what it is asked for. */
	begin(f, DB_JOB_IDENTIFY);
	assert_string_equal(tell_identity(f, 0x56534D44), "more");
	assert_string_equal(speed(f, 0.0f), "0008039F#0008 0008039E#0B01");
	assert_string_equal(db_driver_vsmd_can.nameplate(f->device)->identity, "VSMD");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0A01");
	drop(f);
	/* A drive that tells neither an identity nor three registers is asked for parameters at once. */
	f = make(0, 0);
	begin(f, DB_JOB_PROBE);
	begin(f, DB_JOB_PROBE);
	assert_string_equal(speed(f, 0.0f), "=ok");
	for (unsigned i = 0; i < 3; i++)
		begin(f, DB_JOB_POLL);
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#00 0008039E#0001");
	assert_string_equal(speed(f, 0.0f), "0008039F#0002 0008039E#0001");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0001");
	drop(f);
}

/* It shows that the drive is there, and which probe it answers; nothing else does. */
static void a_late_answer_to_the_first_probe_counts(void **state)
{
	static const struct {
		uint32_t id;
		uint8_t length;
	} others[] = {
		{ 0x0008040A, 4 }, /* of drive 2 */
		{ 0x0008028A, 4 }, /* a parameter */
		{ 0x0008020B, 4 },
		{ 0x0008020A, 8 },
	};
	struct fixture *f = make(0, 0);

	(void)state;
	begin(f, DB_JOB_PROBE);
	begin(f, DB_JOB_PROBE);
	for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
		assert_string_equal(
			answer(f, frame_of(others[i].id, 0x56534D44, 0, others[i].length)),
			"ignored");
	/* It is no answer to a read of the status. */
	begin(f, DB_JOB_POLL);
	assert_string_equal(answer(f, frame_of(0x0008020A, 0x56534D44, 0, 4)), "ignored");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039F#0001");
	assert_string_equal(answer(f, frame_of(0x0008020A, 0x56534D44, 0, 4)), "=ok");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0A01");
	drop(f);
}

/* --- parameters: what is shown of them ---------------------------------------------------------- */

static bool is_told_now(const struct fixture *f, enum vsmd_param param)
{
	return db_driver_vsmd_can.nameplate(f->device)->told[param] == db_told_at(f->now);
}

/* All parameters of a register were seen when it was; those of others were not. */
static void a_register_tells_all_its_parameters(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);

	(void)state;
	identify(f);
	f->now += 100000 * MS;
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	assert_string_equal(data(f, 0x02, 5), "=ok");
	assert_true(is_told_now(f, VSMD_MCS));
	assert_false(is_told_now(f, VSMD_BDR) || is_told_now(f, VSMD_SPD));
	/* The same in its turn, whether it holds something else ... */
	while (refresh(f) != 0x09)
		lost(f);
	f->now += 100000 * MS;
	assert_string_equal(data(f, 0x09, 0x00000004), "=ok");
	assert_int_equal(plate->values[VSMD_S2R].u, 4);
	assert_true(is_told_now(f, VSMD_S1F) && is_told_now(f, VSMD_S1R) &&
	            is_told_now(f, VSMD_S2F) && is_told_now(f, VSMD_S2R));
	assert_false(is_told_now(f, VSMD_BDR) || is_told_now(f, VSMD_S3F) ||
	             is_told_now(f, VSMD_CRH));
	/* ... or not. */
	while (refresh(f) != 0x0D)
		lost(f);
	f->now += 100000 * MS;
	assert_string_equal(data(f, 0x0D, 0), "=ok");
	for (unsigned i = 0; i < 6; i++)
		assert_true(is_told_now(f, VSMD_S1 + i));
	assert_false(is_told_now(f, VSMD_BDR) || is_told_now(f, VSMD_PUD) ||
	             is_told_now(f, VSMD_ZMD));
	drop(f);
}

/* What lies behind the settings of a request is none of it. */
static void only_what_was_asked_for_is_written(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_S1R, 3);
	set(f, VSMD_S2R, 4);
	f->request.setting_count = 1;
	begin(f, DB_JOB_SETTINGS);
	assert_string_equal(data(f, 0x09, 0x01020506),
	                    "00080309#01030506 0008039F#0901 0008039E#0B01");
	assert_string_equal(data(f, 0x09, 0x01030506), "=ok");
	f->exchange.request_size = sizeof(struct db_can_frame) - 1;
	f->settings[0].param = VSMD_MCS;
	assert_string_equal(begin(f, DB_JOB_SETTINGS), "=failed");
	drop(f);
}

/* A drive that keeps a value nobody knew has not changed it: it ignores what it is told. What it holds is shown. */
static void a_write_that_is_ignored_shows_what_is_held(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);
	uint32_t generation = plate->generation;

	(void)state;
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	data(f, 0x02, 4);
	assert_int_equal(plate->generation, generation);
	assert_string_equal(data(f, 0x02, 4), "0008039E#0102");
	assert_true(is_valid(f, VSMD_MCS));
	assert_int_equal(plate->values[VSMD_MCS].u, 4);
	assert_int_equal(plate->generation, generation + 1);
	assert_string_equal(confirm(f, 0, STANDS), "=failed");
	assert_false(plate->doubtful);
	/* Of several, some may have been written that are not shown. */
	set(f, VSMD_CRA, 1);
	begin(f, DB_JOB_SETTINGS);
	data(f, 0x02, 4);
	data(f, 0x02, 4);
	assert_true(plate->doubtful);
	drop(f);
}

/* Whatever becomes of it: the drive may have taken the value. */
static void a_write_without_an_answer_leaves_doubt(void **state)
{
	struct fixture *f = make(0, 0);
	const struct db_nameplate *plate = db_driver_vsmd_can.nameplate(f->device);

	(void)state;
	begin(f, DB_JOB_POLL);
	assert_string_equal(lost(f), "=timeout");
	assert_false(plate->doubtful);
	/* A refusal that shows now may be of what was not answered. */
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 5 });
	assert_string_not_equal(confirm(f, 0, STANDS | VSMD_ST_CMD_WRG), "=refused");
	drop(f);

	f = make(0, 0);
	plate = db_driver_vsmd_can.nameplate(f->device);
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	assert_string_equal(lost(f), "=timeout");
	assert_true(plate->doubtful);
	drop(f);

	f = make(0, 0);
	plate = db_driver_vsmd_can.nameplate(f->device);
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	guard(f);
	assert_string_equal(guard(f), "=unsupported");
	assert_true(plate->doubtful);
	drop(f);
}

/* What a drive holds beside what it saved is lost without power: until it has said that it saved. */
static void what_is_not_saved_is_shown_until_it_is(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	identify(f);
	poll(f, 0, STANDS);
	assert_false(feedback(f).status & DB_STATUS_PARAMS_UNSAVED);
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	data(f, 0x02, 4);
	data(f, 0x02, 4);
	assert_true(feedback(f).status & DB_STATUS_PARAMS_UNSAVED);

	command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_CMD_WRG), "=refused");
	assert_true(feedback(f).status & DB_STATUS_PARAMS_UNSAVED);
	assert_true(feedback(f).status & DB_STATUS_REFUSED);
	f->now += 20000 * MS;
	command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS | VSMD_ST_FLASH_ERR), "=failed");
	assert_true(feedback(f).status & DB_STATUS_PARAMS_UNSAVED);
	f->now += 20000 * MS;
	command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
	assert_string_equal(confirm(f, 0, STANDS), "=unproven");
	assert_false(feedback(f).status & DB_STATUS_PARAMS_UNSAVED);
	assert_false(feedback(f).status & DB_STATUS_REFUSED);
	/* Somebody changes it at the drive. */
	while (refresh(f) != 0x02)
		lost(f);
	data(f, 0x02, 6);
	assert_true(feedback(f).status & DB_STATUS_PARAMS_UNSAVED);
	drop(f);
}

/* --- reports and broadcast ------------------------------------------------------------------------------- */

static bool report(struct fixture *f, struct db_can_frame frame)
{
	return db_driver_vsmd_can.report(f->device, (const uint8_t *)&frame, sizeof frame, f->now);
}

static void reports_take_the_place_of_polls(void **state)
{
	struct fixture *f = make(0, 50);

	(void)state;
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#010032 0008039E#0A07");
	assert_true(db_driver_vsmd_can.wants_poll(f->device, f->now));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	assert_true(report(f, frame_of(0x00080200, 0, 77, 8)));
	assert_true(db_driver_vsmd_can.wants_poll(f->device, f->now));
	assert_true(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	assert_int_equal(feedback(f).position, 77);
	/* Half of the next one is none: it would be of another moment. */
	assert_false(report(f, frame_of(0x00080202, RUNS, 0, 4)));
	assert_false(feedback(f).status & DB_STATUS_MOVING);
	assert_false(db_driver_vsmd_can.wants_poll(f->device, f->now + 100 * MS));
	assert_true(db_driver_vsmd_can.wants_poll(f->device, f->now + 151 * MS));
	drop(f);
	f = make(0, 0);
	assert_false(report(f, frame_of(0x00080200, 0, 77, 8)));
	drop(f);
}

/* A velocity that is computed from reported positions varies by a count, which is no change of
 * speed. */
static void reports_of_the_position_prove_no_speed(void **state)
{
	struct fixture *f = make_reporting(0, 50, 2);
	int32_t position = 1010;

	(void)state;
	poll(f, 1000, STANDS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 100.0f });
	assert_string_equal(confirm(f, 1001, RUNS), "=ok");
	poll_running(f, 100.0f, position, RUNS);
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 300.0f });
	for (unsigned i = 0; f->said[0] != '='; i++) {
		assert_true(report(f, frame_of(0x00080201, (uint32_t)position, 0, 4)));
		if (strcmp(f->said, "0008039E#0001") == 0)
			speed(f, 100.0f);
		else
			confirm(f, position, RUNS);
		position += i % 2 == 0 ? 4 : 6;
	}
	assert_string_equal(f->said, "=failed");
	drop(f);
}

/* What is read in cycles and what confirms a command change places, so that no report confirms one. */
static void reports_of_position_and_status(void **state)
{
	struct fixture *f = make_reporting(0, 50, 0);

	assert_false(feedback(f).velocity_is_computed);
	drop(f);
	f = make_reporting(0, 50, 1);
	assert_true(feedback(f).velocity_is_computed);

	(void)state;
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#020032 0008039E#0A07");
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0102");
	assert_string_equal(answer(f, frame_of(0x00080201, 0, STANDS, 8)), "=ok");
	assert_true(db_driver_vsmd_can.wants_poll(f->device, f->now));
	assert_true(report(f, frame_of(0x00080201, 100, RUNS, 8)));
	assert_false(db_driver_vsmd_can.wants_poll(f->device, f->now));
	/* A report that the line held up was sent in its time all the same. */
	f->now += 62 * MS;
	assert_true(report(f, frame_of(0x00080201, 200, RUNS, 8)));
	assert_int_equal(feedback(f).position, 200);
	assert_true(feedback(f).velocity == 2000.0f);
	f->now += 50 * MS;
	assert_true(report(f, frame_of(0x00080201, 250, STANDS, 8)));
	assert_true(feedback(f).velocity == 0.0f);
	assert_false(report(f, frame_of(0x00080200, 0, 77, 8)));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 4)));

	f->request = (struct db_request){ .command = DB_CMD_ENABLE, .args = &f->args };
	assert_string_equal(begin(f, DB_JOB_COMMAND), "00080381# 0008039E#0003");
	assert_string_equal(answer(f, frame_of(0x00080201, 250, STANDS, 8)), "ignored");
	assert_string_equal(answer(f, frame_of(0x00080200, 0, 250, 8)), "more");
	assert_string_equal(answer(f, frame_of(0x00080202, STANDS, 0, 4)), "=ok");
	drop(f);
}

static void a_position_that_was_set_is_no_motion(void **state)
{
	struct fixture *f = make_reporting(0, 50, 1);

	(void)state;
	assert_true(report(f, frame_of(0x00080201, 0, RUNS, 8)));
	f->args = (struct db_args){ .target_position = 5000 };
	f->request = (struct db_request){ .command = DB_CMD_SET_POSITION, .args = &f->args };
	assert_string_equal(begin(f, DB_JOB_COMMAND), "00080383#00001388 0008039E#0003");
	f->now += 50 * MS;
	assert_true(report(f, frame_of(0x00080201, 10, RUNS, 8)));
	f->now += 50 * MS;
	assert_true(report(f, frame_of(0x00080201, 5020, RUNS, 8)));
	assert_true(feedback(f).velocity == 0.0f);
	drop(f);
}

/* The status is asked for as ever. */
static void reports_of_the_position(void **state)
{
	struct fixture *f = make_reporting(0, 10, 2);

	(void)state;
	assert_string_equal(begin(f, DB_JOB_IDENTIFY), "0008038F#03000A 0008039E#0A07");
	/* Nothing is shown of a drive whose status is not known. */
	assert_true(report(f, frame_of(0x00080201, 100, 0, 4)));
	assert_int_equal(feedback(f).state, DB_AXIS_OFFLINE);
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	assert_string_equal(answer(f, frame_of(0x00080200, 0, 100, 8)), "more");
	assert_string_equal(answer(f, frame_of(0x00080202, RUNS, 0, 4)), "=ok");
	assert_true(report(f, frame_of(0x00080201, 100, 0, 4)));
	f->now += 10 * MS;
	assert_true(report(f, frame_of(0x00080201, 90, 0, 4)));
	assert_int_equal(feedback(f).position, 90);
	assert_true(feedback(f).velocity == -1000.0f);
	assert_int_equal(feedback(f).drive_status, RUNS);
	assert_true(db_driver_vsmd_can.wants_poll(f->device, f->now));
	assert_false(report(f, frame_of(0x00080201, 90, RUNS, 8)));
	drop(f);
}

/* The readings that a relative move counts from do not look like reports. */
static void a_relative_move_beside_reports_of_the_position(void **state)
{
	struct fixture *f = make_reporting(0, 10, 2);

	(void)state;
	f->args = (struct db_args){ .target_position = 10 };
	f->request = (struct db_request){ .command = DB_CMD_MOVE_RELATIVE, .args = &f->args };
	assert_string_equal(begin(f, DB_JOB_COMMAND), "0008039E#0102");
	assert_string_equal(answer(f, frame_of(0x00080201, 100, STANDS, 8)), "0008039E#0002");
	assert_string_equal(answer(f, frame_of(0x00080201, 99, 0, 4)), "ignored");
	assert_string_equal(answer(f, frame_of(0x00080200, 0, 100, 8)),
	                    "00080386#0000006E 0008039E#0102");
	drop(f);
}

static void all_at_once(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	assert_true(db_driver_vsmd_can.broadcast(DB_CMD_STOP, &f->bus, &f->exchange));
	spell(f);
	assert_string_equal(f->said, "00040384#00");
	assert_int_equal(f->exchange.answer_length, 0);
	assert_false(db_driver_vsmd_can.broadcast(DB_CMD_HOME, &f->bus, &f->exchange));
	drop(f);
}

/* A read behind it would be taken for what the drive still owes. */
static void a_stop_while_an_answer_is_outstanding(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	assert_true(db_driver_vsmd_can.interrupt(f->device, DB_CMD_STOP, &f->exchange));
	spell(f);
	assert_string_equal(f->said, "00080384#00");
	assert_true(db_driver_vsmd_can.interrupt(f->device, DB_CMD_DISABLE, &f->exchange));
	spell(f);
	assert_int_equal(strlen(f->said), 9);
	assert_false(db_driver_vsmd_can.interrupt(f->device, DB_CMD_HOME, &f->exchange));
	drop(f);
}

/* Reports are sent at even intervals, however the line holds them up. */
static void a_late_report_was_sent_in_its_time(void **state)
{
	struct fixture *f = make_reporting(0, 50, 1);

	(void)state;
	assert_true(report(f, frame_of(0x00080201, 0, RUNS, 8)));
	/* One was lost. */
	f->now += 80 * MS;
	assert_true(report(f, frame_of(0x00080201, 100, RUNS, 8)));
	assert_true(feedback(f).velocity == 1000.0f);
	/* Two of them are never of one moment. */
	f->now += 10 * MS;
	assert_true(report(f, frame_of(0x00080201, 150, RUNS, 8)));
	assert_true(feedback(f).velocity == 1000.0f);
	/* No drive is faster than that: its counter began anew. */
	f->now += 50 * MS;
	assert_true(report(f, frame_of(0x00080201, 150 + 19200, RUNS, 8)));
	assert_true(feedback(f).velocity == 384000.0f);
	f->now += 50 * MS;
	assert_true(report(f, frame_of(0x00080201, 150 + 19200 + 19201, RUNS, 8)));
	assert_true(feedback(f).velocity == 0.0f);
	drop(f);
}

/* What a command makes of the position is no motion; what others leave alone is one. */
static void only_a_command_that_sets_the_position_breaks_the_way(void **state)
{
	static const struct {
		enum db_command command;
		float velocity;
	} cases[] = {
		{ DB_CMD_ENABLE, -2000.0f },
		{ DB_CMD_SET_POSITION, 0.0f },
		{ DB_CMD_DISABLE, 0.0f },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture *f = make_reporting(0, 50, 1);

		assert_true(report(f, frame_of(0x00080201, 100, RUNS, 8)));
		command(f, cases[i].command, (struct db_args){ 0 });
		f->now += 50 * MS;
		assert_true(report(f, frame_of(0x00080201, 0, RUNS, 8)));
		assert_true(feedback(f).velocity == cases[i].velocity);
		drop(f);
	}
	/* The same where it is told in between. */
	for (unsigned i = 0; i < 2; i++) {
		struct fixture *f = make_reporting(0, 50, 1);

		assert_true(report(f, frame_of(0x00080201, 100, RUNS, 8)));
		assert_true(db_driver_vsmd_can.interrupt(
			f->device, i == 0 ? DB_CMD_STOP : DB_CMD_DISABLE, &f->exchange));
		f->now += 50 * MS;
		assert_true(report(f, frame_of(0x00080201, 0, RUNS, 8)));
		assert_true(feedback(f).velocity == (i == 0 ? -2000.0f : 0.0f));
		drop(f);
	}
}

/* Until then the position may still change because of it. */
static void a_way_counts_again_when_the_time_of_a_set_position_is_over(void **state)
{
	const db_time over = (500 + REACTION_MS) * MS;

	(void)state;
	for (unsigned early = 0; early < 2; early++) {
		struct fixture *f = make_reporting(0, 50, 1);

		assert_true(report(f, frame_of(0x00080201, 0, RUNS, 8)));
		command(f, DB_CMD_SET_POSITION, (struct db_args){ 0 });
		f->now += over - early;
		assert_true(report(f, frame_of(0x00080201, 10, RUNS, 8)));
		f->now += 50 * MS;
		assert_true(report(f, frame_of(0x00080201, 110, RUNS, 8)));
		assert_true(feedback(f).velocity == (early ? 0.0f : 2000.0f));
		drop(f);
	}
}

/* Whether the status is reported or asked for: where it stands, the motion has ended. */
static void a_status_without_a_speed_shows_the_end_of_a_motion(void **state)
{
	const struct db_args shake = { .shake_frequency = 1.0f, .shake_end_position = 50 };

	(void)state;
	for (unsigned asked = 0; asked < 2; asked++) {
		struct fixture *f = make_reporting(0, 50, 1);

		begin(f, DB_JOB_POLL);
		assert_string_equal(answer(f, frame_of(0x00080201, 100, STANDS, 8)), "=ok");
		command(f, DB_CMD_SHAKE_START, shake);
		assert_string_equal(answer(f, frame_of(0x00080200, 0, 100, 8)), "more");
		assert_string_equal(answer(f, frame_of(0x00080202, RUNS, 0, 4)), "=unproven");
		assert_true(feedback(f).status & DB_STATUS_MOVING);
		if (asked) {
			assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0102");
			assert_string_equal(answer(f, frame_of(0x00080201, 100, STANDS, 8)), "=ok");
		} else {
			assert_true(report(f, frame_of(0x00080201, 100, STANDS, 8)));
		}
		assert_int_equal(feedback(f).state, DB_AXIS_STANDSTILL);
		assert_false(feedback(f).status & DB_STATUS_MOVING);
		/* Two answers show the velocity, too. */
		begin(f, DB_JOB_POLL);
		assert_string_equal(answer(f, frame_of(0x00080201, 100, RUNS, 8)), "=ok");
		f->now += 100 * MS - MS / 2;
		begin(f, DB_JOB_POLL);
		assert_string_equal(answer(f, frame_of(0x00080201, 300, RUNS, 8)), "=ok");
		assert_int_equal(feedback(f).position, 300);
		assert_int_equal(feedback(f).drive_status, RUNS);
		assert_true(feedback(f).velocity == 2000.0f);
		drop(f);
	}
}

/* The answer after a command has it, then: that is what shows a reversal. */
static void a_speed_beside_reports_of_position_and_status(void **state)
{
	struct fixture *f = make_reporting(0, 50, 1);

	(void)state;
	begin(f, DB_JOB_POLL);
	assert_string_equal(answer(f, frame_of(0x00080201, 0, STANDS, 8)), "=ok");
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 3000.0f });
	answer(f, frame_of(0x00080200, 0x453B8000, 1, 8));
	assert_string_equal(answer(f, frame_of(0x00080202, RUNS, 0, 4)), "=ok");
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -3000.0f });
	answer(f, frame_of(0x00080200, 0x453B8000, 100, 8));
	assert_string_not_equal(answer(f, frame_of(0x00080202, RUNS, 0, 4)), "=ok");
	for (unsigned i = 0; i < 4 && f->said[0] != '='; i++) {
		if (strcmp(f->said, "0008039E#0001") == 0) {
			speed(f, -500.0f);
		} else {
			answer(f, frame_of(0x00080200, 0xC3FA0000, 100, 8));
			answer(f, frame_of(0x00080202, RUNS, 0, 4));
		}
	}
	assert_string_equal(f->said, "=ok");
	drop(f);
}

/* A high position is no high speed: a drive that stands at 0 soon after has not come there by itself. */
static void a_position_is_not_taken_for_a_speed(void **state)
{
	const int32_t far = 0x4D000000; /* as a speed: 134217728 pulses per second */
	struct fixture *f = make(0, 0);

	(void)state;
	poll_running(f, 100.0f, far, RUNS);
	command(f, DB_CMD_MOVE_RELATIVE, (struct db_args){ .target_position = 10 });
	assert_string_equal(confirm(f, far, RUNS), "0008039E#0101");
	place(f, far);
	f->now += 6000 * MS;
	poll(f, 0, STANDS);
	assert_int_equal(feedback(f).doubts, 1);
	drop(f);
}

/* Of the two frames of a report each has its own form. */
static void half_a_report_is_none(void **state)
{
	struct fixture *f = make(0, 50);
	struct db_can_frame whole = frame_of(0x00080200, 0, 77, 8);

	(void)state;
	assert_false(report(f, frame_of(0x00080200, 0, 0, 4)));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	assert_false(report(f, frame_of(0x00080201, 77, STANDS, 8)));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	/* Nor are parameters a report, nor bytes that are no frame. */
	assert_false(report(f, frame_of(0x00080280, 0, 77, 8)));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	assert_false(db_driver_vsmd_can.report(f->device, (const uint8_t *)&whole, sizeof whole - 1,
	                                       f->now));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	assert_int_equal(feedback(f).state, DB_AXIS_OFFLINE);
	/* What comes between the two changes nothing. */
	assert_true(report(f, whole));
	assert_false(report(f, frame_of(0x00080201, 5, 0, 4)));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 8)));
	assert_int_equal(feedback(f).state, DB_AXIS_OFFLINE);
	assert_true(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	assert_int_equal(feedback(f).position, 77);
	assert_false(db_driver_vsmd_can.wants_poll(f->device, f->now + 150 * MS));
	assert_true(db_driver_vsmd_can.wants_poll(f->device, f->now + 150 * MS + 1));
	drop(f);
	/* In the other kinds of reports the same. */
	for (unsigned kind = 1; kind <= 2; kind++) {
		f = make_reporting(0, 50, kind);
		assert_false(report(f, frame_of(0x00080281, 0, STANDS, kind == 1 ? 8 : 4)));
		assert_false(report(f, frame_of(0x00080202, STANDS, 0, kind == 1 ? 8 : 4)));
		drop(f);
	}
}

/* Another drive may come back: nothing counts that was learnt of the former one. */
static void nothing_is_known_of_a_drive_that_comes_back(void **state)
{
	struct fixture *f = make(0, 60000);

	(void)state;
	report(f, frame_of(0x00080200, 0, 77, 8));
	assert_true(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	assert_true(report(f, frame_of(0x00080200, 0, 78, 8)));
	assert_false(db_driver_vsmd_can.wants_poll(f->device, f->now));
	db_driver_vsmd_can.gone(f->device);
	/* It is asked until it reports again, and the half of a report is forgotten. */
	assert_true(db_driver_vsmd_can.wants_poll(f->device, f->now));
	assert_false(report(f, frame_of(0x00080202, STANDS, 0, 4)));
	drop(f);

	/* Its place is another one, which is no motion. */
	f = make_reporting(0, 50, 1);
	assert_true(report(f, frame_of(0x00080201, 0, RUNS, 8)));
	db_driver_vsmd_can.gone(f->device);
	f->now += 50 * MS;
	assert_true(report(f, frame_of(0x00080201, 100, RUNS, 8)));
	assert_true(feedback(f).velocity == 0.0f);
	drop(f);

	f = make(0, 0);
	/* What is lost before does not count against it. */
	begin(f, DB_JOB_POLL);
	begin(f, DB_JOB_POLL);
	db_driver_vsmd_can.gone(f->device);
	begin(f, DB_JOB_POLL);
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0003");
	assert_string_equal(begin(f, DB_JOB_POLL), "0008039E#0002 0008039E#0201");
	/* Nor what its first probe was. */
	db_driver_vsmd_can.gone(f->device);
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0A01");
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0001");
	db_driver_vsmd_can.gone(f->device);
	assert_string_equal(begin(f, DB_JOB_PROBE), "0008039E#0A01");
	drop(f);
}

/* One that pads the last of an odd number shows that in what no report resembles; then it counts everywhere. */
static void a_padded_answer_is_believed_once_the_drive_has_shown_it(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	begin(f, DB_JOB_POLL);
	answer(f, frame_of(0x00080200, 0, 5, 8));
	assert_string_equal(answer(f, frame_of(0x00080202, STANDS, 0, 8)), "ignored");
	begin(f, DB_JOB_PROBE);
	assert_string_equal(answer(f, frame_of(0x0008020A, 0x56534D44, 0, 8)), "=ok");
	begin(f, DB_JOB_POLL);
	answer(f, frame_of(0x00080200, 0, 6, 8));
	assert_string_equal(answer(f, frame_of(0x00080202, STANDS, 0, 8)), "=ok");
	assert_int_equal(feedback(f).position, 6);
	/* The read after registers, too. */
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	assert_string_equal(answer(f, frame_of(0x00080282, 5, 0, 8)), "more");
	assert_string_equal(answer(f, frame_of(0x0008020B, 0, 0, 8)), "=ok");
	/* Another drive has to show it anew. */
	db_driver_vsmd_can.gone(f->device);
	begin(f, DB_JOB_POLL);
	answer(f, frame_of(0x00080200, 0, 7, 8));
	assert_string_equal(answer(f, frame_of(0x00080202, STANDS, 0, 8)), "ignored");
	begin(f, DB_JOB_SETTINGS);
	assert_string_equal(answer(f, frame_of(0x00080282, 5, 0, 4)), "more");
	assert_string_equal(answer(f, frame_of(0x0008020B, 0, 0, 8)), "ignored");
	assert_string_equal(guard(f), "=ok");
	drop(f);
}

/* --- what is sent, and what for --------------------------------------------------------------- */

/* The time on the wire and the patience are reckoned from that. */
static void each_exchange_says_how_long_its_answer_is(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	begin(f, DB_JOB_PROBE);
	assert_int_equal(f->exchange.answer_length, 8 + 4);
	begin(f, DB_JOB_POLL);
	assert_int_equal(f->exchange.answer_length, 2 * 8 + 3 * 4);
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	assert_int_equal(f->exchange.answer_length, 8 + 2 * 4);
	f->request = (struct db_request){ .args = &f->args };
	set(f, VSMD_MCS, 5);
	begin(f, DB_JOB_SETTINGS);
	assert_int_equal(f->exchange.answer_length, 8 + 4 + 8 + 4);
	/* Only the flash takes time. */
	assert_true(f->exchange.extra_time == 0);
	command(f, DB_CMD_SAVE_PARAMETERS, (struct db_args){ 0 });
	assert_int_equal(f->exchange.answer_length, 8 + 2 * 4);
	assert_true(f->exchange.extra_time == 500 * MS);
	begin(f, DB_JOB_POLL);
	assert_true(f->exchange.extra_time == 0);
	begin(f, DB_JOB_IDENTIFY);
	assert_int_equal(f->exchange.answer_length, 4 * 8 + 7 * 4);
	/* To all of them there is none. */
	assert_true(db_driver_vsmd_can.broadcast(DB_CMD_STOP, &f->bus, &f->exchange));
	assert_int_equal(f->exchange.answer_length, 0);
	drop(f);
}

/* All frames of a burst, or none. */
static void a_burst_without_room_is_not_begun(void **state)
{
	const struct db_args shake = { .shake_frequency = 1.0f };
	struct fixture *f = make(0, 0);

	(void)state;
	f->exchange.request_size = 8 * sizeof(struct db_can_frame);
	assert_string_not_equal(command(f, DB_CMD_SHAKE_START, shake), "=unsupported");
	f->exchange.request_size--;
	assert_string_equal(command(f, DB_CMD_SHAKE_START, shake), "=unsupported");
	f->exchange.request_size = 7 * sizeof(struct db_can_frame) - 1;
	assert_string_equal(command(f, DB_CMD_SHAKE_START, shake), "=out_of_range");
	drop(f);
}

/* It has no read at its end: what comes now answers what was asked before. */
static void an_interrupt_is_answered_by_nothing(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	assert_string_equal(answer(f, frame_of(0x00080200, 0, 0, 8)), "ignored");
	assert_true(db_driver_vsmd_can.interrupt(f->device, DB_CMD_STOP, &f->exchange));
	f->exchange.sending++;
	assert_string_equal(confirm(f, 0, STANDS), "ignored");
	drop(f);
}

/* What it is told in between has the same effect as otherwise: off by command is no restart. */
static void off_in_between_is_no_restart(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 2; i++) {
		struct fixture *f = make(0, 0);

		poll(f, 5000, STANDS);
		assert_true(db_driver_vsmd_can.interrupt(
			f->device, i == 0 ? DB_CMD_STOP : DB_CMD_DISABLE, &f->exchange));
		poll(f, 0, VSMD_ST_STP);
		assert_int_equal(feedback(f).restarts, i == 0 ? 1 : 0);
		drop(f);
	}
}

/* A frame that says one thing to one drive; nothing else can be said to all. */
static void only_what_is_one_frame_is_said_to_all(void **state)
{
	struct fixture *f = make(0, 0);
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_exchange all = { .request = bytes,
		                   .request_size = sizeof bytes,
		                   .request_length = sizeof(struct db_can_frame),
		                   .answer_length = 99 };

	(void)state;
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 300 });
	assert_true(db_driver_vsmd_can.begin_all(f->device, &f->exchange, &all));
	assert_int_equal(all.request_length, sizeof(struct db_can_frame));
	assert_int_equal(all.answer_length, 0);
	/* No frame of this family. */
	f->bytes[offsetof(struct db_can_frame, length)] = 3;
	assert_false(db_driver_vsmd_can.begin_all(f->device, &f->exchange, &all));
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 300 });
	f->exchange.request_length += sizeof(struct db_can_frame);
	assert_false(db_driver_vsmd_can.begin_all(f->device, &f->exchange, &all));
	f->exchange.request_length = sizeof(struct db_can_frame);
	assert_false(db_driver_vsmd_can.begin_all(f->device, &f->exchange, &all));
	drop(f);
}

/* --- the bus's side ----------------------------------------------------------------------------- */

static enum db_frame accepted(const struct fixture *f, struct db_can_frame frame, int *address)
{
	*address = -2;
	return db_driver_vsmd_can.accept(&f->bus, (const uint8_t *)&frame, sizeof frame, address);
}

/* Whose answer it is; of others, who may have sent it. */
static void only_answers_of_drives_are_accepted(void **state)
{
	struct fixture *f = make(0, 0);
	struct db_can_frame frame = frame_of(0x00080282, 5, 0, 4);
	int address;

	(void)state;
	assert_int_equal(accepted(f, frame, &address), DB_FRAME_GOOD);
	assert_int_equal(address, 1);
	/* What a host sends. */
	assert_int_equal(accepted(f, frame_of(0x0008039E, 0x00030000, 0, 2), &address),
	                 DB_FRAME_FOREIGN);
	assert_int_equal(accepted(f, frame_of(0x00080302, 5, 0, 4), &address), DB_FRAME_FOREIGN);
	/* A drive that answers in the other kind of frames. */
	frame = frame_of(0x080, 0, 0, 8);
	frame.id &= ~DB_CAN_EXTENDED;
	assert_int_equal(accepted(f, frame, &address), DB_FRAME_FOREIGN);
	assert_int_equal(address, 1);
	/* No frame with content. */
	frame = frame_of(0x00080200, 0, 0, 8);
	frame.id |= DB_CAN_REMOTE;
	assert_int_equal(accepted(f, frame, &address), DB_FRAME_FOREIGN);
	assert_int_equal(address, -1);
	drop(f);
}

/* A register asked for twice has two answers; a report looks like one and cannot be counted. */
static void an_answer_is_told_by_its_register(void **state)
{
	static const struct {
		double report_ms;
		uint32_t id;
		uint32_t part;
	} cases[] = {
		{ 0, 0x00080200, 1 },
		{ 0, 0x0008020A, 11 },
		{ 0, 0x00080282, 0 },
		{ 1, 0x0008020A, 0 },
		{ 0, 0x0008020A | DB_CAN_REMOTE, 0 },
	};

	const struct db_can_frame first = frame_of(0x0008020A, 0, 0, 4);
	const struct db_can_frame second = frame_of(0x00080201, 0, 0, 4);
	struct fixture *f;

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		const struct db_can_frame frame = frame_of(cases[i].id, 0, 0, 8);

		f = make(0, cases[i].report_ms);
		assert_int_equal(
			db_driver_vsmd_can.part(&f->bus, (const uint8_t *)&frame, sizeof frame),
			cases[i].part);
		drop(f);
	}
	f = make(0, 0);
	assert_int_equal(db_driver_vsmd_can.part(&f->bus, (const uint8_t *)&first, sizeof first),
	                 11);
	assert_int_equal(db_driver_vsmd_can.part(&f->bus, (const uint8_t *)&second, sizeof second),
	                 2);
	drop(f);
}

/* Where only positions are reported, and only there. */
static void a_velocity_is_computed_where_none_is_reported(void **state)
{
	(void)state;
	for (unsigned kind = 0; kind < 3; kind++) {
		for (unsigned report_ms = 0; report_ms < 2; report_ms++) {
			struct fixture *f = make_reporting(0, report_ms, kind);

			assert_int_equal(db_driver_vsmd_can.not_measured(&f->bus),
			                 kind > 0 && report_ms > 0 ? DB_MEASURE_VELOCITY : 0);
			drop(f);
		}
	}
}

static void a_frame_in_a_trace_has_words(void **state)
{
	struct fixture *f = make(0, 0);
	struct db_can_frame frame = frame_of(0x00080384, 0, 0, 1);
	struct db_description said;
	struct db_description expected;
	struct vsmd_can_style style = { .extended = true, .host = 1, .output_base = 1 };

	(void)state;
	db_description_begin(&said);
	db_description_begin(&expected);
	db_driver_vsmd_can.describe(&f->bus, true, (const uint8_t *)&frame, sizeof frame, &said);
	vsmd_can_describe(&style, &frame, &expected);
	assert_string_not_equal(said.text, "");
	assert_string_equal(said.text, expected.text);
	assert_int_equal(said.address, 1);
	drop(f);
}

/* A cycle is one read and its answer; a command has no answer of its own, but the read after it has. */
static void times_are_those_of_the_frames(void **state)
{
	struct fixture *f = make(0, 0);
	const db_time frame = (db_time)sizeof(struct db_can_frame) * DB_NS_PER_US;

	(void)state;
	timed[0] = '\0';
	assert_true(db_driver_vsmd_can.poll_time(&f->bus) == frame + 28 * DB_NS_PER_US);
	assert_string_equal(timed, "0008039E#0003 ");
	timed[0] = '\0';
	assert_true(db_driver_vsmd_can.command_time(&f->bus) ==
	            2 * frame + (16 + 500) * DB_NS_PER_US);
	assert_string_equal(timed, "00080386#0000000000000000 0008039E#0102 ");
	drop(f);
}

static void complain(void *context, const struct db_drive_config *drive, bool error,
                     const char *format, ...)
{
	unsigned *complaints = context;

	(void)format;
	assert_true(error);
	*complaints = *complaints * 1000 + drive->address;
}

static void standard_frames_reach_no_drive_above_15(void **state)
{
	const struct db_drive_config last = { .address = 15 };
	const struct db_drive_config beyond = { .address = 16 };
	const struct db_drive_config far = { .address = 110 };
	const struct db_drive_config *drives[] = { &beyond, &last, &far, &beyond };

	(void)state;
	for (unsigned standard = 0; standard < 2; standard++) {
		struct fixture *f = make(standard, 0);
		unsigned complaints = 0;

		db_driver_vsmd_can.check_config(&f->bus, drives, 3, complain, &complaints);
		assert_int_equal(complaints, standard ? 16110 : 0);
		assert_int_equal(db_driver_vsmd_can.check_param(&f->bus, VSMD_PARAM_COUNT,
		                                                (union db_value){ .u = 0 }),
		                 DB_RESULT_UNSUPPORTED);
		drop(f);
	}
}

/* --- a common start ------------------------------------------------------------------------------------ */

static const char *for_all(struct fixture *f)
{
	static struct db_exchange all;
	static uint8_t bytes[DB_SHORT_REQUEST];
	struct db_exchange prepared = f->exchange;

	all = (struct db_exchange){ .request = bytes, .request_size = sizeof bytes };
	if (!f->exchange.begins || !db_driver_vsmd_can.begin_all(f->device, &f->exchange, &all))
		return "nothing";
	f->exchange = all;
	spell(f);
	f->exchange = prepared;
	return f->said;
}

static const char *begun_by_all(struct fixture *f)
{
	f->exchange.begins = false;
	return next(f, db_driver_vsmd_can.begun_by_all(talk(f)));
}

static void what_begins_a_motion_can_be_said_to_all(void **state)
{
	struct fixture *f = make(0, 0);

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 300 });
	assert_string_equal(for_all(f), "00040386#0000012C");
	assert_string_equal(begun_by_all(f), "0008039E#0102");
	assert_string_equal(confirm(f, 0, STANDS), "0008039E#0102");
	assert_string_equal(confirm(f, 2, RUNS), "=ok");
	command(f, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 1600.0f });
	assert_string_equal(for_all(f), "00040385#44C80000");
	/* First the old end of homing is cleared, which moves nothing. */
	command(f, DB_CMD_HOME, (struct db_args){ 0 });
	assert_string_equal(for_all(f), "nothing");
	f->exchange.begins = false;
	assert_string_equal(confirm(f, 0, STANDS), "00080389# 0008039E#0102");
	assert_string_equal(for_all(f), "00040389#");
	command(f, DB_CMD_ENABLE, (struct db_args){ 0 });
	assert_string_equal(for_all(f), "nothing");
	command(f, DB_CMD_SHAKE_START, (struct db_args){ .shake_frequency = 1.0f });
	assert_string_equal(for_all(f), "nothing");
	drop(f);
}

/* It would begin later than the others. */
static void what_was_said_to_all_is_not_said_again(void **state)
{
	struct fixture *f = make(0, 0);
	unsigned looks = 0;

	(void)state;
	poll(f, 0, STANDS);
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 300 });
	for (begun_by_all(f); f->said[0] != '='; confirm(f, 0, STANDS)) {
		assert_string_equal(f->said, "0008039E#0102");
		looks++;
	}
	assert_string_equal(f->said, "=failed");
	assert_true(looks > 10);
	/* Nor when the answers are lost. */
	command(f, DB_CMD_MOVE_ABSOLUTE, (struct db_args){ .target_position = 300 });
	begun_by_all(f);
	assert_string_equal(next(f, db_driver_vsmd_can.lost(talk(f))), "0008039E#0102");
	while (f->said[0] != '=') {
		assert_string_equal(f->said, "0008039E#0102");
		confirm(f, 0, STANDS);
	}
	assert_string_equal(f->said, "=timeout");
	drop(f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(cyclic_status_is_put_together_whatever_the_order),
		cmocka_unit_test(a_half_answer_is_not_completed_by_the_next_one),
		cmocka_unit_test(filters_pass_answers_and_nothing_else),
		cmocka_unit_test(a_drive_is_asked_for_as_much_as_it_has_told),
		cmocka_unit_test(a_confirmation_is_nothing_else),
		cmocka_unit_test(probe_and_identity),
		cmocka_unit_test(registers_are_read_again_in_turn),
		cmocka_unit_test(a_value_that_was_changed_at_the_drive_is_taken),
		cmocka_unit_test(a_register_that_is_not_answered_stays_as_it_is),
		cmocka_unit_test(every_command_in_bytes),
		cmocka_unit_test(standard_frames),
		cmocka_unit_test(what_the_drive_refuses),
		cmocka_unit_test(a_move_counts_when_it_shows),
		cmocka_unit_test(a_move_that_does_not_show_is_said_again_and_then_failed),
		cmocka_unit_test(a_reversal_counts_when_the_speed_turns),
		cmocka_unit_test(where_no_speed_is_told_the_position_tells_the_direction),
		cmocka_unit_test(a_reversal_shows_in_the_position_too),
		cmocka_unit_test(a_speed_that_an_older_command_explains_proves_nothing),
		cmocka_unit_test(a_new_target_counts_when_the_drive_turns_to_it),
		cmocka_unit_test(what_slows_down_for_a_halt_proves_no_new_target),
		cmocka_unit_test(what_slows_down_for_a_halt_proves_no_reversal),
		cmocka_unit_test(what_slows_down_for_a_target_proves_no_other),
		cmocka_unit_test(a_move_that_ended_does_not_prove_the_next),
		cmocka_unit_test(set_position_while_moving_must_change_the_position),
		cmocka_unit_test(outputs_show_their_level),
		cmocka_unit_test(what_cannot_be_read_is_unproven),
		cmocka_unit_test(a_power_cut_loses_the_origin),
		cmocka_unit_test(a_power_cut_while_moving_ends_the_move),
		cmocka_unit_test(a_drive_that_counts_on_has_not_restarted),
		cmocka_unit_test(the_homing_bit_outlives_the_origin),
		cmocka_unit_test(a_homing_bit_is_believed_of_a_motor_with_power),
		cmocka_unit_test(the_homing_bit_of_a_moving_drive_is_no_origin),
		cmocka_unit_test(closed_loop_rests_beside_its_place),
		cmocka_unit_test(a_relative_move_is_counted_from_readings_that_agree),
		cmocka_unit_test(a_refused_move_changes_no_target),
		cmocka_unit_test(homing_and_shaking_are_never_begun_twice),
		cmocka_unit_test(a_homing_bit_that_stays_set_is_no_end),
		cmocka_unit_test(a_stop_that_shows_no_effect_still_moves),
		cmocka_unit_test(stopping_a_homing_run_ends_homing_too),
		cmocka_unit_test(a_motion_not_begun_here_is_told_all_the_ends),
		cmocka_unit_test(a_homed_drive_that_moves_is_not_homing),
		cmocka_unit_test(homing_found_between_two_phases_is_ended_too),
		cmocka_unit_test(homing_may_stand_for_a_moment),
		cmocka_unit_test(power_must_follow),
		cmocka_unit_test(a_relative_move_is_an_absolute_one),
		cmocka_unit_test(a_lost_confirmation_never_repeats_a_relative_move),
		cmocka_unit_test(saving_is_rate_limited_and_its_failure_seen),
		cmocka_unit_test(a_plain_register_is_written_and_read_back),
		cmocka_unit_test(a_write_that_does_not_show_is_written_once_more),
		cmocka_unit_test(a_packed_register_keeps_its_other_parameters),
		cmocka_unit_test(a_model_without_some_registers_is_identified_at_once),
		cmocka_unit_test(a_register_is_missing_that_was_asked_for_twice),
		cmocka_unit_test(a_single_register_is_read_again_and_again),
		cmocka_unit_test(an_identity_is_what_was_told_last),
		cmocka_unit_test(a_drive_that_tells_two_registers_at_once),
		cmocka_unit_test(a_short_read_shows_nothing_of_long_ones),
		cmocka_unit_test(a_lost_short_read_shows_nothing_of_long_ones),
		cmocka_unit_test(lost_stops_show_nothing_of_long_reads),
		cmocka_unit_test(a_lost_identity_is_asked_for_in_parts),
		cmocka_unit_test(a_lost_confirmation_shows_nothing_of_long_reads),
		cmocka_unit_test(probes_are_tried_in_turn),
		cmocka_unit_test(a_late_answer_to_the_first_probe_counts),
		cmocka_unit_test(a_register_tells_all_its_parameters),
		cmocka_unit_test(only_what_was_asked_for_is_written),
		cmocka_unit_test(a_write_that_is_ignored_shows_what_is_held),
		cmocka_unit_test(a_write_without_an_answer_leaves_doubt),
		cmocka_unit_test(what_is_not_saved_is_shown_until_it_is),
		cmocka_unit_test(reports_take_the_place_of_polls),
		cmocka_unit_test(reports_of_the_position_prove_no_speed),
		cmocka_unit_test(reports_of_position_and_status),
		cmocka_unit_test(a_position_that_was_set_is_no_motion),
		cmocka_unit_test(reports_of_the_position),
		cmocka_unit_test(a_relative_move_beside_reports_of_the_position),
		cmocka_unit_test(all_at_once),
		cmocka_unit_test(a_stop_while_an_answer_is_outstanding),
		cmocka_unit_test(a_late_report_was_sent_in_its_time),
		cmocka_unit_test(only_a_command_that_sets_the_position_breaks_the_way),
		cmocka_unit_test(a_way_counts_again_when_the_time_of_a_set_position_is_over),
		cmocka_unit_test(a_status_without_a_speed_shows_the_end_of_a_motion),
		cmocka_unit_test(a_speed_beside_reports_of_position_and_status),
		cmocka_unit_test(a_position_is_not_taken_for_a_speed),
		cmocka_unit_test(half_a_report_is_none),
		cmocka_unit_test(nothing_is_known_of_a_drive_that_comes_back),
		cmocka_unit_test(a_padded_answer_is_believed_once_the_drive_has_shown_it),
		cmocka_unit_test(each_exchange_says_how_long_its_answer_is),
		cmocka_unit_test(a_burst_without_room_is_not_begun),
		cmocka_unit_test(an_interrupt_is_answered_by_nothing),
		cmocka_unit_test(off_in_between_is_no_restart),
		cmocka_unit_test(only_what_is_one_frame_is_said_to_all),
		cmocka_unit_test(only_answers_of_drives_are_accepted),
		cmocka_unit_test(an_answer_is_told_by_its_register),
		cmocka_unit_test(a_velocity_is_computed_where_none_is_reported),
		cmocka_unit_test(a_frame_in_a_trace_has_words),
		cmocka_unit_test(times_are_those_of_the_frames),
		cmocka_unit_test(standard_frames_reach_no_drive_above_15),
		cmocka_unit_test(what_begins_a_motion_can_be_said_to_all),
		cmocka_unit_test(what_was_said_to_all_is_not_said_again),
		cmocka_unit_test(a_relative_move_keeps_the_limits),
		cmocka_unit_test(a_relative_move_ends_where_counters_do),
		cmocka_unit_test(a_relative_move_without_readings_that_agree_fails),
		cmocka_unit_test(a_lost_answer_is_looked_into),
		cmocka_unit_test(an_order_that_is_never_answered_is_said_three_times),
		cmocka_unit_test(after_a_failed_move_nothing_is_taken_for_granted),
		cmocka_unit_test(off_is_said_again_until_its_time_is_over),
		cmocka_unit_test(a_stop_ends_what_may_have_begun),
		cmocka_unit_test(outputs_are_set_one_after_the_other),
		cmocka_unit_test(saving_is_allowed_again_when_its_time_is_over),
		cmocka_unit_test(a_fault_is_cleared_where_there_is_one),
		cmocka_unit_test(a_target_does_not_outlive_its_move),
		cmocka_unit_test(a_speed_has_the_sign_of_its_way),
		cmocka_unit_test(a_speed_without_a_sign_has_that_of_the_way),
		cmocka_unit_test(a_slow_way_has_a_direction),
		cmocka_unit_test(a_position_that_was_set_shows_no_direction),
		cmocka_unit_test(a_counter_that_overflows_does_not_look_like_a_turn),
		cmocka_unit_test(a_speed_that_turns_round_proves_nothing),
		cmocka_unit_test(a_lost_look_begins_anew),
		cmocka_unit_test(what_stays_open_ends_soon),
		cmocka_unit_test(a_stop_may_not_be_refused),
		cmocka_unit_test(ending_homing_is_no_restart),
		cmocka_unit_test(another_preset_speed_may_change_a_run),
		cmocka_unit_test(an_output_without_a_level_is_unproven),
		cmocka_unit_test(what_stands_is_at_rest),
		cmocka_unit_test(a_motion_counts_from_its_order_on),
	};

	return cmocka_run_group_tests_name("driver/vsmd_can", tests, NULL, NULL);
}
