/* SPDX-License-Identifier: Apache-2.0 */
/*
 * XYZA controllers, the driver alone: which frames each job puts on the wire, written as a person
 * with the document would, and what it makes of the frames that come back. Controller 3. Frames are
 * spelt in hexadecimal without the header 5A A5 and without the sum at their end, which is computed
 * here by the document's rule and not by the codec.
 */
#include "codec/description.h"
#include "codec/xyza.h"
#include "driver/list.h"
#include "driver/xyza/xyza_private.h"
#include "fakes/options.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define OBJECT 3
#define OK_MANUAL "0CAA000300F3"
#define OK_PROGRAM "0CAA000300F4"
#define OK_DATA "0CAA000300F1"
#define FAILED_MANUAL "0CAB000300F3"
#define FAILED_PROGRAM "0CAB000300F4"
#define FAILED_DATA "0CAB000300F1"
#define ASK_PROGRAM "0AF401030A00"
#define ASK_PORTS "0AF10103E400"

/* A controller with some of its axes; one conversation at a time, as on the bus. */
struct fixture {
	struct db_bus_config bus;
	struct fake_options options;
	struct db_drive_config drives[XYZA_AXIS_COUNT];
	struct db_device *axes[XYZA_AXIS_COUNT];
	struct db_device *talking;
	struct db_job job;
	struct db_request request;
	struct db_args args; /* of the request */
	struct db_setting setting;
	struct db_exchange exchange;
	uint8_t bytes[DB_REQUEST_MAX];
	struct db_conversation talk;
	db_time now;
	char said[64];
	/* The controller behind it, for those tests that do not answer each frame themselves. */
	uint32_t memory[5][256]; /* by class and target */
	unsigned program_state;
	unsigned program_number;
	unsigned program_step;
	const char *ignores;   /* frames that begin so are acknowledged, and have no effect */
	bool no_negative_zero; /* the sign of a zero is lost */
};

/* `axes` is a set: bit 0 = x. The first of them is the one that polls. */
static struct fixture *make(unsigned axes)
{
	struct fixture *f = calloc(1, sizeof *f);
	struct db_device *first = NULL;

	assert_non_null(f);
	f->bus.driver = &db_driver_xyza;
	f->bus.options = f->options.bus;
	f->exchange.request = f->bytes;
	f->exchange.request_size = sizeof f->bytes;
	f->now = 1000 * MS;
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (!(axes >> i & 1))
			continue;
		f->drives[i].address = OBJECT;
		f->drives[i].axis = i;
		f->drives[i].min_position = f->drives[i].max_position = (double)NAN;
		f->axes[i] = calloc(1, db_driver_xyza.device_size);
		assert_non_null(f->axes[i]);
		db_driver_xyza.init(f->axes[i], first, &f->bus, &f->drives[i]);
		if (!first)
			first = f->axes[i];
	}
	f->talking = first;
	for (unsigned target = 0xA3; target <= 0xD3; target += 0x10)
		f->memory[0][target] = 1; /* stands */
	return f;
}

static void set_option(struct fixture *f, const char *name, double value)
{
	fake_set_option(&db_driver_xyza, &f->options, name, value);
}

static void drop(struct fixture *f)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++)
		free(f->axes[i]);
	free(f);
}

static void spell(struct fixture *f)
{
	uint8_t sum = 0;
	size_t length = f->exchange.request_length;

	assert_in_range(length, 9, 13);
	assert_memory_equal(f->bytes, "\x5A\xA5", 2);
	for (size_t i = 2; i < length - 1; i++)
		sprintf(f->said + 2 * (i - 2), "%02X", (unsigned)f->bytes[i]);
	for (size_t i = 3; i < length - 1; i++)
		sum = (uint8_t)(sum + f->bytes[i]);
	assert_int_equal(f->bytes[length - 1], sum);
}

/* The job as the scheduler hands it to the driver now. */
static struct db_conversation *talk(struct fixture *f)
{
	f->exchange.again = false;
	f->talk = (struct db_conversation){
		.device = f->talking, .job = &f->job, .exchange = &f->exchange, .now = f->now
	};
	return &f->talk;
}

/* What the driver wants next: the frame, or how the job ended as "=name". */
static const char *next(struct fixture *f, enum db_step step)
{
	if (step == DB_STEP_SEND)
		spell(f);
	else if (step == DB_STEP_DONE)
		snprintf(f->said, sizeof f->said, "=%s", db_result_name(f->talk.result));
	else
		snprintf(f->said, sizeof f->said, "ignored");
	return f->said;
}

static const char *begin(struct fixture *f, unsigned axis, enum db_job_kind kind)
{
	f->talking = f->axes[axis];
	f->job = (struct db_job){ .kind = kind, .request = &f->request, .started = f->now };
	return next(f, db_driver_xyza.begin(talk(f)));
}

static const char *command(struct fixture *f, unsigned axis, enum db_command code,
                           struct db_args args)
{
	f->args = args;
	f->request = (struct db_request){ .command = code, .args = &f->args };
	return begin(f, axis, DB_JOB_COMMAND);
}

static const char *jog(struct fixture *f, unsigned axis)
{
	return command(f, axis, DB_CMD_JOG_POSITIVE, (struct db_args){ 0 });
}

static size_t compose(const char *hex, uint8_t frame[XYZA_FRAME_MAX])
{
	size_t length = 2;

	frame[0] = 0x5A;
	frame[1] = 0xA5;
	for (; *hex; hex += 2) {
		unsigned byte;

		assert_int_equal(sscanf(hex, "%2x", &byte), 1);
		frame[length++] = (uint8_t)byte;
	}
	frame[length] = 0;
	for (size_t i = 3; i < length; i++)
		frame[length] = (uint8_t)(frame[length] + frame[i]);
	return length + 1;
}

/* What all axes show; the rest is 0. */
static void look(const struct fixture *f, struct db_feedback shown[XYZA_AXIS_COUNT])
{
	memset(shown, 0, XYZA_AXIS_COUNT * sizeof shown[0]);
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		if (f->axes[axis])
			db_driver_xyza.feedback(f->axes[axis], &shown[axis]);
	}
}

static const char *answer(struct fixture *f, const char *hex)
{
	struct db_feedback before[XYZA_AXIS_COUNT];
	struct db_feedback after[XYZA_AXIS_COUNT];
	uint8_t frame[XYZA_FRAME_MAX];
	size_t length = compose(hex, frame);
	enum db_step step;

	f->now += MS;
	look(f, before);
	step = db_driver_xyza.answer(talk(f), frame, length);
	look(f, after);
	/* Nobody is shown what changed then. */
	if (f->talk.unchanged)
		assert_memory_equal(before, after, sizeof before);
	return next(f, step);
}

/* A refusal may be a damaged request: it is said once more, the same, and refused again. */
static const char *refuse(struct fixture *f, const char *hex)
{
	char said[sizeof f->said];

	strcpy(said, f->said);
	assert_string_equal(answer(f, hex), said);
	return answer(f, hex);
}

/* The answer to the read that was just asked. */
static const char *value(struct fixture *f, uint32_t content)
{
	char hex[32];

	snprintf(hex, sizeof hex, "0BF10003%02X%02X%02X%02X%02X%02X", (unsigned)f->bytes[6],
	         (unsigned)f->bytes[7], content & 0xFF, content >> 8 & 0xFF, content >> 16 & 0xFF,
	         content >> 24);
	return answer(f, hex);
}

static const char *program(struct fixture *f, unsigned state, unsigned number, unsigned step)
{
	char hex[32];

	snprintf(hex, sizeof hex, "0BF40003%02X%02X%02X%02X0000", state, number, step & 0xFF,
	         step >> 8);
	return answer(f, hex);
}

static const char *lost(struct fixture *f)
{
	return next(f, db_driver_xyza.lost(talk(f)));
}

static struct db_feedback feedback(const struct fixture *f, unsigned axis)
{
	struct db_feedback feedback = { .state = 0 };

	db_driver_xyza.feedback(f->axes[axis], &feedback);
	return feedback;
}

static const struct db_nameplate *plate(const struct fixture *f, unsigned axis)
{
	return db_driver_xyza.nameplate(f->axes[axis]);
}

/* A whole cycle in which x is at `position`, the other axes at 0, and the program's state is told. */
static void poll_all(struct fixture *f, bool standing, int32_t position, unsigned state)
{
	const char *said = begin(f, 0, DB_JOB_POLL);

	while (said[0] != '=') {
		bool x = f->bytes[7] >> 4 == 0xA;

		assert_string_not_equal(said, "ignored");
		if (strcmp(said, ASK_PROGRAM) == 0)
			said = program(f, state, 1, 7);
		else if (strcmp(said, ASK_PORTS) == 0)
			said = value(f, 0);
		else if (f->bytes[7] % 16 == 3)
			said = value(f, x ? standing : 1);
		else if (f->bytes[7] % 16 == 2)
			said = value(f, x && position < 0);
		else
			said = value(f, x ? (uint32_t)labs(position) : 0);
	}
	assert_string_equal(said, "=ok");
}

/* --- reading --------------------------------------------------------------------------------------- */

static void one_cycle_asks_once_for_all_axes(void **state)
{
	struct fixture *f = make(0x5); /* x and z */

	(void)state;
	assert_int_equal(feedback(f, 0).state, DB_AXIS_OFFLINE);
	assert_string_equal(begin(f, 0, DB_JOB_POLL), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF10103E1A2");
	assert_string_equal(value(f, 1), "0AF10103E1A1");
	assert_string_equal(value(f, 257), "0AF10103E1A2");
	assert_string_equal(value(f, 1), "0AF10103E1C3");
	assert_string_equal(value(f, 0), "0AF10103E1C2");
	assert_string_equal(value(f, 0), "0AF10103E1C1");
	assert_string_equal(value(f, 5), "0AF10103E1C2");
	assert_string_equal(value(f, 0), "0AF10103E400");
	/* The reply to the ports has another target in the document. */
	assert_string_equal(answer(f, "0BF10003E4C101000300"), "0AF401030A00");
	assert_string_equal(program(f, 2, 2, 264), "=ok");
	assert_int_equal(feedback(f, 0).position, -257);
	assert_int_equal(feedback(f, 2).position, 5);
	assert_int_equal(feedback(f, 2).state, DB_AXIS_CONTINUOUS_MOTION);
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis += 2) {
		assert_int_equal(feedback(f, axis).inputs, 1);
		assert_int_equal(feedback(f, axis).outputs, 3);
		assert_int_equal(feedback(f, axis).program, 2);
		assert_int_equal(feedback(f, axis).program_state, XYZA_PROGRAM_WAITING);
		assert_int_equal(feedback(f, axis).program_step, 264);
	}
	drop(f);
}

/* A counter at 0 all of a sudden may be a restart, unless a command of this axis, or a program, may
 * have brought it there. */
static void a_jump_to_0_is_doubted_where_nothing_was_commanded(void **state)
{
	static const struct {
		unsigned axis;
		enum db_command command;
		unsigned doubts;
	} cases[] = {
		{ 0, DB_CMD_NONE, 1 },          { 0, DB_CMD_MOVE_ABSOLUTE, 0 },
		{ 0, DB_CMD_SET_POSITION, 0 },  { 0, DB_CMD_SET_OUTPUT, 1 },
		{ 1, DB_CMD_MOVE_ABSOLUTE, 1 }, { 1, DB_CMD_START_PROGRAM, 0 },
		{ 0, DB_CMD_START_PROGRAM, 0 }, { 1, DB_CMD_CONTINUE_PROGRAM, 0 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make(0x3);

		poll_all(f, true, 5000, XYZA_PROGRAM_IDLE);
		if (cases[i].command != DB_CMD_NONE)
			(void)command(f, cases[i].axis, cases[i].command,
			              (struct db_args){ .output_number = 1, .program_number = 1 });
		poll_all(f, true, 0, XYZA_PROGRAM_IDLE);
		assert_int_equal(feedback(f, 0).doubts, cases[i].doubts);
		assert_int_equal(feedback(f, 1).doubts, 0);
		drop(f);
	}
}

/* A speed is told from two places: of the first one nobody knows where it came from. */
static void the_first_place_tells_no_speed(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, false, 90000, XYZA_PROGRAM_IDLE);
	assert_int_equal(feedback(f, 0).position, 90000);
	assert_float_equal(feedback(f, 0).velocity, 0.0f, 0.0f);
	poll_all(f, false, 90100, XYZA_PROGRAM_IDLE);
	assert_true(feedback(f, 0).velocity > 0.0f);
	drop(f);
}

/* Of an axis that stands still only its position is news, and of the controller what has changed. */
static void what_changes_nothing_is_said_to(void **state)
{
	struct fixture *f = make(0x1);

	(void)state;
	poll_all(f, true, 7, XYZA_PROGRAM_IDLE);
	assert_string_equal(begin(f, 0, DB_JOB_POLL), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF10103E1A2");
	assert_true(f->talk.unchanged);
	assert_string_equal(value(f, 0), "0AF10103E1A1");
	assert_true(f->talk.unchanged);
	assert_string_equal(value(f, 7), "0AF10103E400");
	assert_false(f->talk.unchanged); /* its age */
	(void)answer(f, "0BF10003E4C101000700");
	assert_false(f->talk.unchanged);
	assert_string_equal(f->said, "0AF401030A00");
	assert_string_equal(program(f, 2, 2, 264), "=ok");
	assert_string_equal(begin(f, 0, DB_JOB_POLL), "0AF10103E1A3");
	(void)value(f, 1);
	(void)value(f, 0);
	(void)value(f, 7);
	(void)answer(f, "0BF10003E4C101000700");
	assert_true(f->talk.unchanged);
	drop(f);
}

/* The first axis leaves and goes on to ask for the other; then it comes back. */
static void an_axis_that_leaves_is_not_asked_for(void **state)
{
	struct fixture *f = make(0x5); /* x and z */
	struct db_device *back = calloc(1, db_driver_xyza.device_size);

	(void)state;
	assert_non_null(back);
	poll_all(f, true, 0, XYZA_PROGRAM_WAITING);
	db_driver_xyza.leave(f->axes[0]);
	assert_string_equal(begin(f, 0, DB_JOB_POLL), "0AF10103E1C3");
	assert_string_equal(value(f, 1), "0AF10103E1C2");
	assert_string_equal(value(f, 0), "0AF10103E1C1");
	assert_string_equal(value(f, 0), "0AF10103E400");
	assert_string_equal(answer(f, "0BF10003E4C101000300"), "0AF401030A00");
	assert_string_equal(program(f, 2, 2, 264), "=ok");
	assert_int_equal(feedback(f, 2).program, 2);
	/* What the other one did does not count for this one. */
	db_driver_xyza.init(back, f->axes[0], &f->bus, &f->drives[0]);
	assert_string_equal(begin(f, 0, DB_JOB_POLL), "0AF10103E1A3");
	free(back);
	drop(f);
}

static void what_stands_where_it_stood_needs_no_second_look(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, -257, 0);
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	value(f, 1);
	assert_string_equal(value(f, 257), ASK_PORTS);
	value(f, 0);
	program(f, 0, 0, 0);
	/* Elsewhere, or moving: it does. */
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	value(f, 1);
	assert_string_equal(value(f, 258), "0AF10103E1A2");
	value(f, 1);
	value(f, 0);
	program(f, 0, 0, 0);
	begin(f, 0, DB_JOB_POLL);
	value(f, 0);
	value(f, 1);
	assert_string_equal(value(f, 258), "0AF10103E1A2");
	drop(f);
}

static void a_state_reply_may_echo_the_next_target(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	begin(f, 0, DB_JOB_POLL);
	assert_string_equal(answer(f, "0BF10003E1A401000000"), "0AF10103E1A2");
	drop(f);
}

/* An axis moves with every read; whatever the speed and wherever it crosses zero, a position that is
 * shown lies between where it was before and after the cycle, so its sign is right. */
static void the_sign_is_right_while_zero_is_crossed(void **state)
{
	static const int32_t speeds[] = { 1, 2, 3, 7, 40, 400 };
	unsigned shown = 0;

	(void)state;
	for (size_t s = 0; s < sizeof speeds / sizeof speeds[0]; s++) {
		for (int32_t start = -12 * speeds[s]; start < 2 * speeds[s]; start++) {
			struct fixture *f = make(1);
			int32_t position = start;
			const char *said = begin(f, 0, DB_JOB_POLL);

			while (strcmp(said, ASK_PORTS) != 0) {
				unsigned number = f->bytes[7] % 16;

				said = value(f, number == 1 ? (uint32_t)labs(position) :
				                number == 2 ? position < 0 :
				                              0);
				position += speeds[s];
			}
			if (feedback(f, 0).state != DB_AXIS_OFFLINE) {
				assert_in_range(feedback(f, 0).position + 10000, start + 10000,
				                position + 10000);
				shown++;
			}
			drop(f);
		}
	}
	assert_true(shown > 1000);
}

/* A sign that never settles: nothing is shown, and the cycle goes on. */
static void a_position_whose_sign_is_in_doubt_is_not_shown(void **state)
{
	struct fixture *f = make(3);
	unsigned reads = 0;
	const char *said;

	(void)state;
	poll_all(f, true, 5, 0);
	said = begin(f, 0, DB_JOB_POLL);
	while (strncmp(said + 10, "B", 1) != 0) {
		unsigned number = f->bytes[7] % 16;

		said = value(f, number == 1 ? 6 : number == 2 ? reads / 2 % 2 : 0);
		assert_true(++reads < 20);
	}
	assert_int_equal(feedback(f, 0).position, 5);
	drop(f);
}

static void a_velocity_comes_from_two_positions(void **state)
{
	struct fixture *f = make(1);
	db_time taken;

	(void)state;
	poll_all(f, false, 100, 0);
	taken = feedback(f, 0).taken;
	f->now += 40 * MS;
	poll_all(f, false, 0, 0);
	assert_float_equal(feedback(f, 0).velocity,
	                   -100.0f * (float)DB_NS_PER_S / (float)(feedback(f, 0).taken - taken),
	                   0.01f);
	poll_all(f, true, 0, 0);
	assert_float_equal(feedback(f, 0).velocity, 0.0f, 0.0f);
	drop(f);
}

/* A counter of 24 bits has come to its end: no motor is that fast, and where it is counted from is not certain. */
static void a_jump_of_the_counter_is_no_velocity(void **state)
{
	struct fixture *f = make(1);
	float velocity;

	(void)state;
	poll_all(f, false, 8388000, 0);
	f->now += 40 * MS;
	poll_all(f, false, 8388100, 0);
	velocity = feedback(f, 0).velocity;
	assert_true(velocity > 0.0f && velocity < 1e5f);
	assert_int_equal(feedback(f, 0).doubt, DB_DOUBT_NONE);
	f->now += 40 * MS;
	poll_all(f, false, -8388600, 0);
	assert_int_equal(feedback(f, 0).position, -8388600);
	assert_float_equal(feedback(f, 0).velocity, velocity, 0.0f);
	assert_int_equal(feedback(f, 0).doubt, DB_DOUBT_SIGN);
	assert_int_equal(feedback(f, 0).doubts, 1);
	f->now += 40 * MS;
	poll_all(f, false, -8388500, 0);
	assert_true(fabsf(feedback(f, 0).velocity) < 1e5f);
	assert_int_equal(feedback(f, 0).doubts, 1);
	/* A program sets positions. */
	poll_all(f, false, -8388400, 1);
	poll_all(f, false, 8388400, 1);
	assert_int_equal(feedback(f, 0).doubts, 1);
	drop(f);
}

/* --- who says what ------------------------------------------------------------------------------------ */

static enum db_frame accepts(const struct fixture *f, const char *hex, int *address)
{
	uint8_t frame[XYZA_FRAME_MAX];
	size_t length = compose(hex, frame);

	return db_driver_xyza.accept(&f->bus, frame, length, address);
}

static void frames_of_others_are_not_taken(void **state)
{
	struct fixture *f = make(1);
	uint8_t frame[XYZA_FRAME_MAX];
	int address = 0;

	(void)state;
	assert_int_equal(accepts(f, "0CAA000700F3", &address), DB_FRAME_GOOD);
	assert_int_equal(address, 7);
	assert_int_equal(accepts(f, "0AF301030200", &address), DB_FRAME_FOREIGN);
	compose(OK_MANUAL, frame);
	frame[8]++;
	assert_int_equal(db_driver_xyza.accept(&f->bus, frame, 9, &address), DB_FRAME_BAD);
	jog(f, 0);
	assert_string_equal(answer(f, OK_PROGRAM), "ignored");
	assert_string_equal(answer(f, OK_DATA), "ignored");
	assert_string_equal(answer(f, "0CAA000400F3"), "ignored");
	assert_string_equal(answer(f, "0BF10003E1A301000000"), "ignored");
	/* Mark 0A is as good as 0C. */
	assert_string_equal(answer(f, "0AAA000300F3"), "0AF10103E1A3");
	drop(f);
}

static void a_read_takes_only_what_was_read(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	assert_string_equal(f->said, "0AF10103E1A2");
	assert_string_equal(answer(f, "0BF10003E1A101000000"), "ignored");
	assert_string_equal(answer(f, "0BF10003E1B201000000"), "ignored");
	assert_string_equal(answer(f, "0BF10003E2A201000000"), "ignored");
	assert_string_equal(answer(f, "0BF10003E1A202000000"), "ignored"); /* no sign */
	assert_string_equal(answer(f, OK_DATA), "ignored");
	assert_string_equal(answer(f, "0BF10003E1A201000000"), "0AF10103E1A1");
	drop(f);
}

static void the_probe_has_an_order_of_its_own(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	assert_string_equal(begin(f, 0, DB_JOB_PROBE), "0AAC0103ACAC");
	assert_string_equal(answer(f, OK_MANUAL), "ignored");
	assert_string_equal(answer(f, "0CAA000300AC"), "=ok");
	drop(f);
}

/* --- commands ---------------------------------------------------------------------------------------- */

static uint32_t *memory(struct fixture *f, unsigned item_class, unsigned target)
{
	return &f->memory[item_class - 0xE1][target];
}

static void obey_write(struct fixture *f, unsigned item_class, unsigned target, uint32_t content)
{
	uint32_t *magnitude = memory(f, 0xE1, (target & 0xF0) + 1);
	uint32_t *sign = memory(f, 0xE1, (target & 0xF0) + 2);
	uint32_t *ports = memory(f, 0xE4, 0);
	uint32_t bit = 1u << (15 + (content >> 4 & 0x0F));

	if (item_class == 0xE4 && (content == 0x9F || content == 0x90))
		*ports = content == 0x9F ? *ports | 0xFF0000 : *ports & ~0xFF0000u;
	else if (item_class == 0xE4)
		*ports = content & 0x0F ? *ports | bit : *ports & ~bit;
	else
		*memory(f, item_class, target) = content;
	if (item_class == 0xE1 && f->no_negative_zero && *magnitude == 0)
		*sign = 0;
}

static void obey_manual(struct fixture *f, unsigned verb, unsigned target)
{
	unsigned axis = (target - 0xA1) / 2;

	for (unsigned i = 0; i < XYZA_AXIS_COUNT && verb <= 2; i++)
		*memory(f, 0xE1, 0xA3 + 0x10 * i) = 1;
	if (verb == 3)
		*memory(f, 0xE1, 0xA3 + 0x10 * axis) = 0;
	if (verb == 4)
		*memory(f, 0xE1, 0xA1 + 0x10 * axis) = *memory(f, 0xE1, 0xA2 + 0x10 * axis) = 0;
}

static void obey_program(struct fixture *f, unsigned verb, unsigned target)
{
	if (verb == 1 && f->program_state == 1)
		f->program_state = 3;
	else if (verb == 2 && f->program_state == 1)
		f->program_state = 2;
	else if (verb == 3)
		f->program_number = target;
	else if (verb == 7)
		f->program_state = 0;
	if (verb == 3 || verb == 6)
		f->program_state = 1;
}

/* What a controller does about the frame that was said last, and its answer. */
static const char *obey(struct fixture *f)
{
	unsigned order = f->bytes[3];
	unsigned item_class = f->bytes[6];
	unsigned target = f->bytes[7];
	bool ignored = f->ignores && strncmp(f->said, f->ignores, strlen(f->ignores)) == 0;
	char done[16];

	snprintf(done, sizeof done, "0CAA000300%02X", order);
	if (strcmp(f->said, ASK_PROGRAM) == 0)
		return program(f, f->program_state, f->program_number, f->program_step);
	if (f->bytes[2] == 0x0A && order == 0xF1)
		return value(f, *memory(f, item_class, target));
	if (!ignored && f->bytes[2] == 0x0B)
		obey_write(f, item_class, target,
		           (uint32_t)f->bytes[8] | (uint32_t)f->bytes[9] << 8 |
		                   (uint32_t)f->bytes[10] << 16 | (uint32_t)f->bytes[11] << 24);
	else if (!ignored && order == 0xF3)
		obey_manual(f, item_class, target);
	else if (!ignored && order == 0xF4)
		obey_program(f, item_class, target);
	return answer(f, done);
}

/* The controller obeys until the job ends; all frames, separated by spaces, and how it ended. */
static const char *whole(struct fixture *f, const char *said)
{
	static char all[2048];

	all[0] = '\0';
	while (said[0] != '=') {
		assert_true(strlen(all) < sizeof all - 64);
		snprintf(all + strlen(all), sizeof all - strlen(all), "%s ", said);
		said = obey(f);
	}
	strcat(all, said);
	return all;
}

static const struct {
	unsigned axis;
	enum db_command command;
	struct db_args args;
	const char *said;
} every_command[] = {
	{ 1, DB_CMD_ENABLE, { 0 }, "0AF10103E5C1 0BF10103E5C102000000 0AF10103E5C1 =ok" },
	{ 2, DB_CMD_DISABLE, { 0 }, "0AF10103E1C3 0AF10103E5C1 =ok" },
	{ 0, DB_CMD_STOP, { 0 }, "0AF301030200 0AF401030200 =ok" },
	{ 3, DB_CMD_QUICK_STOP, { 0 }, "0AF301030100 0AF401030200 =ok" },
	{ 0,
	  DB_CMD_MOVE_VELOCITY,
	  { .target_velocity = 1600.4f },
	  "0AF10103E2A4 0BF10103E2A440060000 0AF10103E2A4 0AF3010303A1 0AF10103E1A3 =ok" },
	{ 3,
	  DB_CMD_MOVE_VELOCITY,
	  { .target_velocity = -70000.0f },
	  "0AF10103E2D4 0BF10103E2D470110100 0AF10103E2D4 0AF3010303A8 0AF10103E1D3 =ok" },
	{ 0, DB_CMD_MOVE_VELOCITY, { 0 }, "0AF301030200 0AF10103E1A3 =ok" },
	{ 1, DB_CMD_JOG_POSITIVE, { 0 }, "0AF3010303A3 0AF10103E1B3 =ok" },
	{ 2, DB_CMD_JOG_NEGATIVE, { 0 }, "0AF3010303A6 0AF10103E1C3 =ok" },
	{ 2, DB_CMD_SET_POSITION, { 0 }, "0AF10103E1C3 0AF3010304A5 0AF10103E1C1 =ok" },
	{ 1,
	  DB_CMD_SET_POSITION,
	  { .target_position = -4108 },
	  "0AF10103E1B3 0BF10103E1B10C100000 0BF10103E1B201000000 0AF10103E1B2 0AF10103E1B1 =ok" },
	{ 0,
	  DB_CMD_SET_OUTPUT,
	  { .output_number = 2, .output_value = 1 },
	  "0BF10103E40022000000 0AF10103E400 =ok" },
	{ 3, DB_CMD_SET_OUTPUT, { .output_number = 8 }, "0BF10103E40080000000 0AF10103E400 =ok" },
	{ 0,
	  DB_CMD_SET_OUTPUTS,
	  { .output_mask = 0x0A, .output_levels = 0x08 },
	  "0BF10103E40020000000 0BF10103E40044000000 0AF10103E400 =ok" },
	{ 0,
	  DB_CMD_SET_OUTPUTS,
	  { .output_mask = 0xFF, .output_levels = 0xFF },
	  "0BF10103E4009F000000 0AF10103E400 =ok" },
	{ 0,
	  DB_CMD_SET_OUTPUTS,
	  { .output_mask = 0xFF, .output_levels = 0xFF00 },
	  "0BF10103E40090000000 0AF10103E400 =ok" },
	{ 0,
	  DB_CMD_SET_OUTPUTS,
	  { .output_mask = 0xFF, .output_levels = 0xF7 },
	  "0BF10103E40011000000 0BF10103E40022000000 0BF10103E40033000000 0BF10103E40040000000 "
	  "0BF10103E40055000000 0BF10103E40066000000 0BF10103E40077000000 0BF10103E40088000000 "
	  "0AF10103E400 =ok" },
	{ 0,
	  DB_CMD_START_PROGRAM,
	  { .program_number = 2, .program_delay = 0 },
	  "0AF401030A00 0AF401030500 0AF401030302 0AF401030A00 =ok" },
	{ 0, DB_CMD_PAUSE_PROGRAM, { 0 }, "0AF401030A00 0AF401030200 0AF401030A00 =unproven" },
	{ 1, DB_CMD_CONTINUE_PROGRAM, { 0 }, "0AF401030A00 =refused" },
	{ 0, DB_CMD_END_PROGRAM, { 0 }, "0AF401030A00 0AF401030700 0AF401030A00 =unproven" },
	{ 0, DB_CMD_SINGLE_STEP, { .output_value = 1 }, "0AF401030800 =unproven" },
	{ 0, DB_CMD_SINGLE_STEP, { 0 }, "0AF401030900 =unproven" },
	{ 2, DB_CMD_CLEAR_FAULT, { 0 }, "0AF401030A00 =ok" },
};

static void every_command_in_bytes(void **state)
{
	uint64_t tried = DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) |
	                 DB_COMMAND_BIT(DB_CMD_RAW_FRAME); /* below */

	(void)state;
	for (size_t i = 0; i < sizeof every_command / sizeof every_command[0]; i++) {
		struct fixture *f = make(0xF);

		assert_int_equal(db_driver_xyza.check(&f->bus, &f->drives[every_command[i].axis],
		                                      every_command[i].command,
		                                      &every_command[i].args),
		                 DB_RESULT_OK);
		assert_string_equal(
			whole(f, command(f, every_command[i].axis, every_command[i].command,
		                         every_command[i].args)),
			every_command[i].said);
		tried |= DB_COMMAND_BIT(every_command[i].command);
		drop(f);
	}
	assert_true(tried == db_driver_xyza.commands);
}

static void what_the_family_does_not_have_is_refused(void **state)
{
	static const enum db_command others[] = {
		DB_CMD_MOVE_ABSOLUTE,    DB_CMD_MOVE_RELATIVE,
		DB_CMD_MOVE_PRESET,      DB_CMD_HOME,
		DB_CMD_SAVE_PARAMETERS,  DB_CMD_SHAKE_START,
		DB_CMD_SHAKE_START_TIME, DB_CMD_SYNC_START,
	};
	static const struct {
		enum db_command command;
		struct db_args args;
	} out[] = {
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = 0.4f } },
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = 5e9f } },
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = NAN } },
		{ DB_CMD_SET_POSITION, { .target_position = INT32_MIN } },
		{ DB_CMD_SET_OUTPUT, { .output_number = 0 } },
		{ DB_CMD_SET_OUTPUT, { .output_number = 9 } },
		{ DB_CMD_SET_OUTPUT, { .output_number = 1, .output_value = 2 } },
		{ DB_CMD_SET_OUTPUTS, { .output_mask = 0 } },
		{ DB_CMD_SET_OUTPUTS, { .output_mask = 0x100 } },
		{ DB_CMD_START_PROGRAM, { .program_number = 256 } },
		{ DB_CMD_START_PROGRAM, { .program_number = 1, .program_delay = 256 } },
		{ DB_CMD_SINGLE_STEP, { .output_value = 2 } },
	};
	static const int none_at_all[] = { -1, DB_CMD_NONE, DB_CMD_LIMIT, 64, 999 };
	struct fixture *f = make(1);
	struct db_args none = { 0 };

	(void)state;
	for (size_t i = 0; i < sizeof none_at_all / sizeof none_at_all[0]; i++)
		assert_int_equal(db_driver_xyza.check(&f->bus, &f->drives[0],
		                                      (enum db_command)none_at_all[i], &none),
		                 DB_RESULT_UNSUPPORTED);
	for (size_t i = 0; i < sizeof others / sizeof others[0]; i++)
		assert_int_equal(db_driver_xyza.check(&f->bus, &f->drives[0], others[i], &none),
		                 DB_RESULT_UNSUPPORTED);
	for (size_t i = 0; i < sizeof out / sizeof out[0]; i++)
		assert_int_equal(
			db_driver_xyza.check(&f->bus, &f->drives[0], out[i].command, &out[i].args),
			DB_RESULT_OUT_OF_RANGE);
	drop(f);
}

static void the_last_values_of_a_range_are_in_it(void **state)
{
	static const struct {
		enum db_command command;
		struct db_args args;
	} in[] = {
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = 0.5f } },
		{ DB_CMD_MOVE_VELOCITY, { .target_velocity = -4294967040.0f } },
		{ DB_CMD_SET_POSITION, { .target_position = -INT32_MAX } },
		{ DB_CMD_SET_OUTPUT, { .output_number = 1, .output_value = 1 } },
		{ DB_CMD_SET_OUTPUT, { .output_number = 8, .output_value = 0 } },
		{ DB_CMD_SET_OUTPUTS, { .output_mask = 1 } },
		{ DB_CMD_SET_OUTPUTS, { .output_mask = 0xFF } },
		{ DB_CMD_START_PROGRAM, { .program_number = 255, .program_delay = 255 } },
		{ DB_CMD_SINGLE_STEP, { .output_value = 1 } },
	};
	struct fixture *f = make(1);

	(void)state;
	for (size_t i = 0; i < sizeof in / sizeof in[0]; i++)
		assert_int_equal(
			db_driver_xyza.check(&f->bus, &f->drives[0], in[i].command, &in[i].args),
			DB_RESULT_OK);
	drop(f);
}

/* Whether a controller that refuses has obeyed nevertheless is looked into before it is asked again. */
static void a_refusal_is_told(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, 0);
	jog(f, 0);
	assert_string_equal(answer(f, FAILED_MANUAL), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF3010303A1");
	assert_string_equal(answer(f, "0ABB000300F3"), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "=refused");
	assert_true(feedback(f, 0).status & DB_STATUS_REFUSED);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	/* A stray refusal: it has obeyed. */
	jog(f, 0);
	answer(f, FAILED_MANUAL);
	assert_string_equal(value(f, 0), "=ok");
	assert_false(feedback(f, 0).status & DB_STATUS_REFUSED);
	drop(f);
}

/* The controller's answer to a wrong sum. */
static void a_damaged_request_is_said_again(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	/* Each step has its own repeat. */
	command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 5.0f });
	assert_string_equal(answer(f, FAILED_DATA), "0AF10103E2A4");
	assert_string_equal(value(f, 4), "0BF10103E2A405000000");
	assert_string_equal(answer(f, FAILED_DATA), "0BF10103E2A405000000");
	assert_string_equal(answer(f, OK_DATA), "0AF10103E2A4");
	assert_string_equal(value(f, 5), "0AF3010303A1");
	assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
	assert_string_equal(answer(f, FAILED_DATA), "0AF10103E1A3");
	assert_string_equal(value(f, 0), "=ok");
	begin(f, 0, DB_JOB_POLL);
	assert_string_equal(answer(f, FAILED_DATA), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF10103E1A2");
	drop(f);
}

static void an_axis_that_is_not_there_leaves_the_others(void **state)
{
	struct fixture *f = make(7);

	(void)state;
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	value(f, 0);
	value(f, 9);
	assert_string_equal(value(f, 0), "0AF10103E1B3");
	assert_string_equal(refuse(f, FAILED_DATA), "0AF10103E1C3");
	value(f, 1);
	value(f, 0);
	value(f, 8);
	assert_string_equal(value(f, 0), ASK_PORTS);
	assert_string_equal(refuse(f, FAILED_DATA), ASK_PROGRAM);
	assert_string_equal(refuse(f, FAILED_PROGRAM), "=ok");
	assert_int_equal(feedback(f, 0).position, 9);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_OFFLINE);
	assert_int_equal(feedback(f, 2).position, 8);
	drop(f);
}

/* A cycle in which x stands at 0, up to this question or its end. */
static const char *poll_up_to(struct fixture *f, const char *question)
{
	const char *said = begin(f, 0, DB_JOB_POLL);

	while (said[0] != '=' && strcmp(said, question) != 0) {
		if (strcmp(said, ASK_PROGRAM) == 0)
			said = program(f, 0, 0, 0);
		else
			said = value(f, strcmp(said, ASK_PORTS) != 0 && f->bytes[7] % 16 == 3);
	}
	return said;
}

/* The axis is passed over for two seconds at first, whether or not it has ever answered. */
static void a_silent_axis_is_passed_over_and_offline(void **state)
{
	static const char ask_y[] = "0AF10103E1B3";
	struct fixture *f = make(3);

	(void)state;
	assert_string_equal(poll_up_to(f, ask_y), ask_y);
	assert_string_equal(poll_up_to(f, ask_y), ask_y);
	assert_string_equal(poll_up_to(f, ask_y), "=ok");
	assert_int_equal(feedback(f, 1).state, DB_AXIS_OFFLINE);
	f->now += 2000 * MS;
	assert_string_equal(poll_up_to(f, "none"), "=ok");
	assert_int_not_equal(feedback(f, 1).state, DB_AXIS_OFFLINE);
	/* A single loss may be due to the line: the axis is asked again. */
	assert_string_equal(poll_up_to(f, ask_y), ask_y);
	assert_string_equal(poll_up_to(f, ask_y), ask_y);
	assert_int_not_equal(feedback(f, 1).state, DB_AXIS_OFFLINE);
	assert_string_equal(poll_up_to(f, ask_y), "=ok");
	assert_int_equal(feedback(f, 1).state, DB_AXIS_OFFLINE);
	assert_int_not_equal(feedback(f, 0).state, DB_AXIS_OFFLINE);
	f->now += 2000 * MS;
	assert_string_equal(poll_up_to(f, ""), "=ok");
	assert_int_not_equal(feedback(f, 1).state, DB_AXIS_OFFLINE);
	drop(f);
}

/* Ports and program may keep silent for ever: the axes are what a stop is judged by. */
static void what_is_silent_in_a_cycle_is_passed_over(void **state)
{
	static const char *const silent[] = { ASK_PORTS, ASK_PROGRAM };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct fixture *f = make(1);

		poll_all(f, true, 0, XYZA_PROGRAM_INTERRUPTED);
		assert_string_equal(poll_up_to(f, silent[i]), silent[i]);
		assert_string_equal(poll_up_to(f, silent[i]), silent[i]);
		assert_string_equal(poll_up_to(f, silent[i]), "=ok");
		assert_string_equal(poll_up_to(f, silent[i]), "=ok");
		/* Rarely it is asked for once more: 2 s later, then 4 s. */
		f->now += 2000 * MS;
		assert_string_equal(poll_up_to(f, silent[i]), silent[i]);
		assert_string_equal(poll_up_to(f, silent[i]), "=ok");
		f->now += 2000 * MS;
		assert_string_equal(poll_up_to(f, silent[i]), "=ok");
		f->now += 2000 * MS;
		assert_string_equal(poll_up_to(f, silent[i]), silent[i]);
		if (i == 0)
			value(f, 0x00030001);
		else
			assert_string_equal(program(f, 2, 1, 7), "=ok");
		/* It tells it after all. A single loss is the line's. */
		assert_string_equal(poll_up_to(f, silent[i]), silent[i]);
		assert_string_equal(poll_up_to(f, silent[i]), silent[i]);
		drop(f);
	}
}

/* What it told of its program before it fell silent stands in the way of nothing. */
static void a_program_that_is_not_told_is_not_believed(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, XYZA_PROGRAM_INTERRUPTED);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_ERROR_STOP);
	for (unsigned i = 0; i < 2; i++) {
		poll_up_to(f, ASK_PROGRAM);
		assert_int_equal(feedback(f, 0).state, DB_AXIS_ERROR_STOP);
	}
	assert_string_equal(poll_up_to(f, ASK_PROGRAM), "=ok");
	assert_int_equal(feedback(f, 0).program_state, UINT16_MAX);
	assert_int_equal(feedback(f, 0).program, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	/* Both modes are stopped, and nothing is asked that is not answered. */
	assert_string_equal(whole(f, command(f, 0, DB_CMD_STOP, (struct db_args){ 0 })),
	                    "0AF301030200 0AF401030200 =ok");
	assert_string_equal(whole(f, command(f, 0, DB_CMD_START_PROGRAM,
	                                     (struct db_args){ .program_number = 2 })),
	                    "0AF401030500 0AF401030302 =unproven");
	assert_string_equal(whole(f, command(f, 0, DB_CMD_END_PROGRAM, (struct db_args){ 0 })),
	                    "0AF401030700 =unproven");
	assert_string_equal(whole(f, jog(f, 0)), "0AF3010303A1 0AF10103E1A3 =ok");
	drop(f);
}

static void outputs_that_are_not_told_are_unproven(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	for (unsigned i = 0; i < 3; i++)
		poll_up_to(f, ASK_PORTS);
	assert_string_equal(
		whole(f, command(f, 0, DB_CMD_SET_OUTPUT,
	                         (struct db_args){ .output_number = 2, .output_value = 1 })),
		"0BF10103E40022000000 =unproven");
	drop(f);
}

/* An axis that keeps silent instead of refusing is asked less and less often. */
static void an_axis_that_never_answers_leaves_the_others(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	for (unsigned i = 0; i < 2; i++)
		assert_string_equal(poll_up_to(f, "0AF10103E1B3"), "0AF10103E1B3");
	assert_string_equal(poll_up_to(f, "0AF10103E1B3"), "=ok");
	f->now += 2000 * MS;
	assert_string_equal(poll_up_to(f, "0AF10103E1B3"), "0AF10103E1B3");
	assert_string_equal(poll_up_to(f, ""), "=ok");
	f->now += 4000 * MS;
	assert_string_equal(poll_up_to(f, "0AF10103E1B3"), "0AF10103E1B3");
	assert_string_equal(poll_up_to(f, ""), "=ok");
	drop(f);
}

static void the_other_axes_are_read_when_one_falls_silent(void **state)
{
	static const char ask_x[] = "0AF10103E1A3";
	struct fixture *f = make(7);
	db_time taken;

	(void)state;
	poll_all(f, true, 5, 0);
	for (unsigned i = 0; i < 2; i++)
		assert_string_equal(poll_up_to(f, ask_x), ask_x);
	for (unsigned i = 0; i < 4; i++) {
		taken = f->now += 10 * MS;
		assert_string_equal(poll_up_to(f, ask_x), "=ok");
		assert_true(feedback(f, 0).taken < taken);
		for (unsigned axis = 1; axis < 3; axis++)
			assert_true(feedback(f, axis).taken >= taken);
	}
	/* Once the axis has answered again, a single loss is no reason to pass it over. */
	f->now += 2000 * MS;
	assert_string_equal(poll_up_to(f, ""), "=ok");
	assert_string_equal(poll_up_to(f, ask_x), ask_x);
	assert_string_equal(poll_up_to(f, ask_x), ask_x);
	drop(f);
}

/* The axis may be back together with the controller: it is asked at once, although the time for
 * which it is passed over has not ended. */
static void an_axis_passed_over_is_asked_when_the_controller_is_back(void **state)
{
	static const char ask_y[] = "0AF10103E1B3";
	struct fixture *f = make(3);

	(void)state;
	for (unsigned i = 0; i < 2; i++)
		assert_string_equal(poll_up_to(f, ask_y), ask_y);
	assert_string_equal(poll_up_to(f, ask_y), "=ok");
	for (unsigned axis = 0; axis < 2; axis++)
		db_driver_xyza.gone(f->axes[axis]);
	assert_string_equal(poll_up_to(f, ask_y), ask_y);
	drop(f);
}

/* While no axis is known to answer, all axes are asked in turn. When another axis answers, the
 * first one is passed over if it stays silent. */
static void the_other_axes_are_read_when_the_first_never_answers(void **state)
{
	static const char ask_x[] = "0AF10103E1A3";
	static const char ask_y[] = "0AF10103E1B3";
	struct fixture *f = make(7);

	(void)state;
	assert_string_equal(begin(f, 0, DB_JOB_POLL), ask_x);
	assert_string_equal(begin(f, 0, DB_JOB_POLL), ask_y);
	assert_string_equal(begin(f, 0, DB_JOB_POLL), "0AF10103E1C3");
	assert_string_equal(begin(f, 0, DB_JOB_POLL), ask_x);
	/* The other axes answer. */
	assert_string_equal(poll_up_to(f, ask_x), "=ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_OFFLINE);
	for (unsigned axis = 1; axis < 3; axis++)
		assert_int_equal(feedback(f, axis).state, DB_AXIS_DISABLED);
	assert_string_equal(poll_up_to(f, ask_x), ask_x);
	assert_string_equal(poll_up_to(f, ask_x), ask_x);
	assert_string_equal(poll_up_to(f, ask_x), "=ok");
	/* The first axis answers later. */
	f->now += 2000 * MS;
	assert_string_equal(poll_up_to(f, "none"), "=ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	drop(f);
}

/* The loss that took the controller offline does not count as a loss of its first axis. */
static void a_controller_that_is_back_is_read_from_its_first_axis_on(void **state)
{
	static const char ask_x[] = "0AF10103E1A3";
	struct fixture *f = make(3);

	(void)state;
	poll_all(f, true, 5, 0);
	assert_string_equal(poll_up_to(f, ask_x), ask_x);
	for (unsigned axis = 0; axis < 2; axis++)
		db_driver_xyza.gone(f->axes[axis]);
	assert_string_equal(poll_up_to(f, ask_x), ask_x);
	drop(f);
}

/* Without retries each loss takes the whole controller offline; the other axes have their turn all
 * the same. */
static void the_other_axes_are_read_when_the_first_takes_all_offline(void **state)
{
	static const char ask_x[] = "0AF10103E1A3";
	struct fixture *f = make(3);

	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		assert_string_equal(poll_up_to(f, ask_x), ask_x);
		for (unsigned axis = 0; axis < 2; axis++)
			db_driver_xyza.gone(f->axes[axis]);
		assert_string_equal(poll_up_to(f, ask_x), i == 0 ? "=ok" : ask_x);
		if (i > 0) {
			for (unsigned axis = 0; axis < 2; axis++)
				db_driver_xyza.gone(f->axes[axis]);
			assert_string_equal(poll_up_to(f, ask_x), "=ok");
		}
		assert_int_equal(feedback(f, 1).state, DB_AXIS_DISABLED);
	}
	drop(f);
}

/* The document's table has room for more than it explains. In what it does not, it may run. */
static void any_state_of_a_program_is_shown(void **state)
{
	static const unsigned states[] = { 4, 5, 6, 255 };
	struct fixture *f = make(1);

	(void)state;
	for (size_t i = 0; i < sizeof states / sizeof states[0]; i++) {
		poll_all(f, true, 0, states[i]);
		assert_int_equal(feedback(f, 0).program_state, states[i]);
		assert_int_equal(feedback(f, 0).drive_status >> 8, states[i]);
		assert_string_equal(
			whole(f, command(f, 0, DB_CMD_QUICK_STOP, (struct db_args){ 0 })),
			"0AF401030100 0AF301030100 =ok");
		assert_string_equal(whole(f, jog(f, 0)), "0AF3010303A1 0AF10103E1A3 =ok");
		poll_all(f, true, 0, states[i]);
	}
	/* It may also take no stop then. */
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(refuse(f, FAILED_PROGRAM), "0AF301030200");
	assert_string_equal(answer(f, OK_MANUAL), "=ok");
	drop(f);
}

static void one_axis_at_a_time(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	poll_all(f, true, 0, 0);
	whole(f, jog(f, 0));
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	/* It still does. */
	assert_string_equal(whole(f, jog(f, 1)), "0AF10103E1A3 =refused");
	assert_true(feedback(f, 1).status & DB_STATUS_REFUSED);
	poll_all(f, false, 100, 0);
	assert_string_equal(jog(f, 1), "0AF10103E1A3");
	/* It has come to a stand since it was seen. */
	assert_string_equal(value(f, 1), "0AF3010303A3");
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 0), "=ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	drop(f);
}

/* What was believed of the program is read again before anything is refused for it. */
static void a_jog_right_behind_a_program(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	poll_all(f, true, 100, 1);
	assert_string_equal(jog(f, 0), ASK_PROGRAM);
	assert_string_equal(program(f, 1, 2, 3), "=refused");
	assert_string_equal(jog(f, 0), ASK_PROGRAM);
	assert_string_equal(program(f, 0, 2, 3), "0AF3010303A1");
	drop(f);
}

/* A jog is told between two reads of a cycle: that it stood before says nothing. */
static void what_was_seen_before_a_jog_does_not_end_it(void **state)
{
	struct fixture *f = make(1);
	struct db_job poll;

	(void)state;
	poll_all(f, true, 0, 0);
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	poll = f->job;
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 0), "=ok");
	f->job = poll;
	compose("0AF10103E1A2", f->bytes);
	f->exchange.request_length = 9;
	assert_string_equal(value(f, 0), "0AF10103E1A1");
	assert_string_equal(value(f, 3), "0AF10103E1A2");
	value(f, 0);
	assert_int_equal(feedback(f, 0).position, 3);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	drop(f);
}

/* Nor that it still stood when it was told: meanwhile it was seen to move. */
static void what_was_seen_before_its_effect_does_not_end_a_jog(void **state)
{
	struct fixture *f = make(1);
	struct db_job poll;
	struct db_job told;

	(void)state;
	set_option(f, "reaction-ms", 100);
	db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	told = f->job;
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	poll = f->job;
	f->job = told;
	f->request.command = DB_CMD_JOG_POSITIVE;
	compose("0AF10103E1A3", f->bytes);
	f->exchange.request_length = 9;
	assert_string_equal(value(f, 0), "=ok");
	f->job = poll;
	compose("0AF10103E1A2", f->bytes);
	f->exchange.request_length = 9;
	value(f, 0);
	value(f, 3);
	value(f, 0);
	assert_int_equal(feedback(f, 0).position, 3);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	drop(f);
}

static void another_way_is_gone_only_from_a_stand(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, false, 0, 0);
	poll_all(f, false, 5, 0);
	assert_string_equal(
		command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -5.0f }),
		"0AF301030200");
	assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
	assert_string_equal(value(f, 0), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF10103E2A4");
	assert_string_equal(value(f, 9), "0BF10103E2A405000000");
	answer(f, OK_DATA);
	assert_string_equal(value(f, 5), "0AF3010303A2");
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 0), "=ok");
	drop(f);
}

/* What says that it stands may say it late: a jog seen by its place is under way, and stopped right behind that
 * the axis does not stand because it still says so. */
static void a_stand_from_before_a_motion_is_none(void **state)
{
	struct fixture *f = make(1);
	struct db_job told;

	(void)state;
	set_option(f, "reaction-ms", 100);
	db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 1), "0AF10103E1A3");
	assert_true(f->exchange.again);
	for (int32_t place = 1; place < 3; place++) {
		told = f->job;
		poll_all(f, true, place, 0);
		assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
		f->job = told;
		compose("0AF10103E1A3", f->bytes);
		f->exchange.request_length = 9;
		value(f, 1);
	}
	assert_string_equal(f->said, "=ok");
	/* It is slowing down, and nothing says so. */
	poll_all(f, true, 40, 0);
	assert_true(feedback(f, 0).velocity > 0.0f);
	assert_string_equal(command(f, 0, DB_CMD_JOG_NEGATIVE, (struct db_args){ 0 }),
	                    "0AF301030200");
	assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF10103E1A3");
	assert_true(f->exchange.again);
	/* Now it does, and is believed when it stands. */
	assert_string_equal(value(f, 0), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF3010303A2");
	drop(f);
}

/* Likewise an axis of a program that was stopped: any of them may have begun to move. */
static void a_stand_from_before_a_programs_motion_is_none(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	set_option(f, "reaction-ms", 100);
	db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
	db_driver_xyza.init(f->axes[1], f->axes[0], &f->bus, &f->drives[1]);
	poll_all(f, true, 0, 1);
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	answer(f, OK_PROGRAM);
	assert_string_equal(answer(f, OK_MANUAL), "=ok");
	poll_all(f, true, 0, 2);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STOPPING);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_STOPPING);
	f->now += 100 * MS;
	poll_all(f, true, 0, 2);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_DISABLED);
	drop(f);
}

/* Brakes may take as long as they like, as long as the axis slows down. */
static void slow_brakes_are_no_failure(void **state)
{
	struct fixture *f = make(1);
	struct db_job job;
	int32_t position = 1000;

	(void)state;
	poll_all(f, false, 0, 0);
	f->now += 100 * MS;
	poll_all(f, false, 1000, 0);
	command(f, 0, DB_CMD_JOG_NEGATIVE, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	for (int32_t way = 900; way > 100; way -= 100) {
		job = f->job;
		f->now += 1500 * MS;
		poll_all(f, false, position += way, 0);
		f->job = job;
		compose("0AF10103E1A3", f->bytes);
		f->exchange.request_length = 9;
		assert_string_equal(value(f, 0), "0AF10103E1A3");
	}
	/* It does not slow down any more. */
	for (unsigned i = 0; i < 2; i++) {
		assert_string_equal(f->said, "0AF10103E1A3");
		f->now += 1500 * MS;
		value(f, 0);
	}
	assert_string_equal(f->said, "=failed");
	drop(f);
}

/* The same way at another speed: nothing stops, unless the drive needs that. */
static void another_speed_is_taken_while_it_moves(void **state)
{
	struct fixture *f = make(1);
	struct db_args fast = { .target_velocity = 900.0f };

	(void)state;
	assert_string_equal(
		whole(f, command(f, 0, DB_CMD_MOVE_VELOCITY,
	                         (struct db_args){ .target_velocity = 300.0f })),
		"0AF10103E2A4 0BF10103E2A42C010000 0AF10103E2A4 0AF3010303A1 0AF10103E1A3 =ok");
	/* That it goes at this speed nothing tells. */
	assert_string_equal(
		whole(f, command(f, 0, DB_CMD_MOVE_VELOCITY, fast)),
		"0AF10103E2A4 0BF10103E2A484030000 0AF10103E2A4 0AF3010303A1 0AF10103E1A3 =unproven");
	/* Nothing changes, and nothing is written. */
	assert_string_equal(whole(f, command(f, 0, DB_CMD_MOVE_VELOCITY, fast)),
	                    "0AF10103E2A4 0AF3010303A1 0AF10103E1A3 =ok");
	drop(f);

	f = make(1);
	set_option(f, "jog-speed-change", 1);
	db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
	whole(f, jog(f, 0));
	assert_string_equal(
		whole(f, command(f, 0, DB_CMD_MOVE_VELOCITY, fast)),
		"0AF301030200 0AF10103E1A3 0AF10103E2A4 0BF10103E2A484030000 0AF10103E2A4 0AF3010303A1 0AF10103E1A3 =ok");
	drop(f);
}

/* Goes on at this speed and is asked once more; 100 ms pass. */
static const char *ask_at_speed(struct fixture *f, int32_t *position, int32_t speed)
{
	struct db_job job = f->job;

	f->now += 100 * MS;
	poll_all(f, false, *position += speed / 10, 0);
	f->job = job;
	compose("0AF10103E1A3", f->bytes);
	f->exchange.request_length = 9;
	return value(f, 0);
}

/* x runs at 500 Hz, and is to run at 1500: up to where only its velocity can show it. Its position. */
static int32_t begin_another_speed(struct fixture *f)
{
	poll_all(f, false, 1000, 0);
	f->now += 93 * MS;
	poll_all(f, false, 1050, 0);
	command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 1500.0f });
	assert_string_equal(value(f, 500), "0BF10103E2A4DC050000");
	answer(f, OK_DATA);
	assert_string_equal(value(f, 1500), "0AF3010303A1");
	assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
	return 1050;
}

/* Another speed is there when cycles have seen it, and not when it was acknowledged. */
static void another_speed_shows_in_its_velocity(void **state)
{
	struct fixture *f = make(1);
	int32_t position = begin_another_speed(f);

	(void)state;
	assert_string_equal(value(f, 0), "0AF10103E1A3");
	assert_string_equal(ask_at_speed(f, &position, 500), "0AF10103E1A3");
	assert_string_equal(ask_at_speed(f, &position, 800), "0AF10103E1A3");
	assert_string_equal(ask_at_speed(f, &position, 1450), "0AF10103E1A3");
	assert_string_equal(ask_at_speed(f, &position, 1550), "=ok");
	drop(f);

	/* Ramps take as long as they like. */
	f = make(1);
	position = begin_another_speed(f);
	value(f, 0);
	for (int32_t speed = 500; speed < 980; speed += 40)
		assert_string_equal(ask_at_speed(f, &position, speed), "0AF10103E1A3");
	ask_at_speed(f, &position, 1100);
	assert_string_equal(ask_at_speed(f, &position, 1200), "=ok");
	drop(f);
}

/* It stays as it was: it has not done it, and is stopped, so that it does not do it later. */
static void another_speed_that_is_ignored_fails(void **state)
{
	struct fixture *f = make(1);
	int32_t position = begin_another_speed(f);
	const char *said = value(f, 0);
	struct db_job job;

	(void)state;
	for (unsigned i = 0; i < 20 && strcmp(said, "0AF301030200") != 0; i++) {
		assert_string_equal(said, "0AF10103E1A3");
		said = ask_at_speed(f, &position, 500);
	}
	assert_string_equal(said, "0AF301030200");
	assert_string_equal(answer(f, OK_MANUAL), "=failed");
	drop(f);
	/* One that is stopped meanwhile has not failed. */
	f = make(1);
	begin_another_speed(f);
	value(f, 0);
	job = f->job;
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	f->job = job;
	f->args = (struct db_args){ .target_velocity = 1500.0f };
	f->request = (struct db_request){ .command = DB_CMD_MOVE_VELOCITY, .args = &f->args };
	compose("0AF10103E1A3", f->bytes);
	assert_string_equal(value(f, 0), "=cancelled");
	drop(f);
}

static void a_stop_stops_what_runs(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	poll_all(f, false, 0, 0);
	command(f, 1, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(answer(f, OK_MANUAL), "0AF401030200");
	assert_string_equal(answer(f, FAILED_PROGRAM), "=ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STOPPING);
	/* While a program runs it is stopped first, and manual mode may refuse. */
	poll_all(f, false, 0, 1);
	assert_string_equal(command(f, 0, DB_CMD_QUICK_STOP, (struct db_args){ 0 }),
	                    "0AF401030100");
	assert_string_equal(answer(f, OK_PROGRAM), "0AF301030100");
	assert_string_equal(answer(f, FAILED_MANUAL), "=ok");
	/* y stood when it was looked at, but the program may have moved it since. */
	assert_int_equal(feedback(f, 1).state, DB_AXIS_STOPPING);
	/* Said again until it stands: another stop would end the program, unless that runs after all. */
	assert_string_equal(command(f, 0, DB_CMD_QUICK_STOP, (struct db_args){ 0 }),
	                    "0AF301030100");
	assert_string_equal(answer(f, OK_MANUAL), ASK_PROGRAM);
	assert_string_equal(program(f, 3, 1, 7), "=ok");
	command(f, 0, DB_CMD_QUICK_STOP, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	assert_string_equal(program(f, 1, 1, 7), "0AF401030100");
	assert_string_equal(answer(f, OK_PROGRAM), "=ok");
	/* What is to stop the motion must not be refused. */
	poll_all(f, false, 0, 1);
	assert_string_equal(command(f, 0, DB_CMD_STOP, (struct db_args){ 0 }), "0AF401030200");
	assert_string_equal(refuse(f, FAILED_PROGRAM), "=refused");
	/* An interrupted program is an error until it is ended. */
	poll_all(f, true, 0, 3);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_ERROR_STOP);
	assert_int_equal(feedback(f, 1).error, DB_ERROR_INTERRUPTED);
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 1).error, DB_ERROR_NONE);
	drop(f);
}

/* From anywhere to anywhere, whether or not a zero keeps a sign. */
static void a_position_is_set(void **state)
{
	static const int32_t positions[] = { 0, -4108, 500, -700, 500, 0, -1, 1, -2, INT32_MAX };

	(void)state;
	for (unsigned forgets = 0; forgets < 2; forgets++) {
		struct fixture *f = make(1);

		f->no_negative_zero = forgets;
		for (size_t i = 0; i < sizeof positions / sizeof positions[0]; i++) {
			struct db_args args = { .target_position = positions[i] };
			const char *said = whole(f, command(f, 0, DB_CMD_SET_POSITION, args));

			assert_string_equal(strchr(said, '='), "=ok");
			assert_int_equal(*memory(f, 0xE1, 0xA1), (uint32_t)labs(positions[i]));
			if (positions[i] != 0)
				assert_int_equal(*memory(f, 0xE1, 0xA2), positions[i] < 0);
			assert_int_equal(feedback(f, 0).position, positions[i]);
		}
		drop(f);
	}
}

static void a_position_that_is_not_taken_is_no_success(void **state)
{
	struct fixture *f = make(1);
	struct db_args args = { .target_position = -50 };

	(void)state;
	f->ignores = "0BF10103E1A2";
	assert_string_equal(whole(f, command(f, 0, DB_CMD_SET_POSITION, args)),
	                    "0AF10103E1A3"
	                    " 0BF10103E1A132000000 0BF10103E1A201000000 0AF10103E1A2"
	                    " 0BF10103E1A132000000 0BF10103E1A201000000 0AF10103E1A2"
	                    " 0BF10103E1A132000000 0BF10103E1A201000000 0AF10103E1A2 =failed");
	/* One that is taken the second time is mended. */
	command(f, 0, DB_CMD_SET_POSITION, args);
	obey(f);
	obey(f);
	obey(f);
	obey(f);
	f->ignores = NULL;
	assert_string_equal(
		whole(f, f->said),
		"0BF10103E1A132000000 0BF10103E1A201000000 0AF10103E1A2 0AF10103E1A1 =ok");
	/* Not while it moves. */
	whole(f, jog(f, 0));
	assert_string_equal(whole(f, command(f, 0, DB_CMD_SET_POSITION, args)),
	                    "0AF10103E1A3 =refused");
	drop(f);
}

/* Neither what is there between the two writes, nor what was read half before and half after them. */
static void a_position_in_the_making_is_not_shown(void **state)
{
	struct fixture *f = make(1);
	struct db_job poll;
	struct db_job set;

	(void)state;
	poll_all(f, true, 100, 0);
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	value(f, 0);
	poll = f->job;
	command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = -7 });
	value(f, 1);
	answer(f, OK_DATA);
	set = f->job;
	f->job = poll;
	compose("0AF10103E1A1", f->bytes);
	f->exchange.request_length = 9;
	value(f, 7);
	value(f, 0);
	assert_int_equal(feedback(f, 0).position, 100);
	poll_all(f, true, 7, 0);
	assert_int_equal(feedback(f, 0).position, 100);
	f->job = set;
	f->request.command = DB_CMD_SET_POSITION;
	compose("0BF10103E1A201000000", f->bytes);
	f->exchange.request_length = 13;
	f->talking = f->axes[0];
	assert_string_equal(answer(f, OK_DATA), "0AF10103E1A2");
	value(f, 1);
	assert_string_equal(value(f, 7), "=ok");
	assert_int_equal(feedback(f, 0).position, -7);
	poll_all(f, true, -7, 0);
	assert_int_equal(feedback(f, 0).position, -7);
	drop(f);
}

/* That it was refused before does not count any more: it is not said a third time. */
static void a_program_that_is_taken_after_a_refusal_may_have_run(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	command(f, 0, DB_CMD_START_PROGRAM, (struct db_args){ .program_number = 4 });
	assert_string_equal(program(f, 0, 0, 0), "0AF401030500");
	assert_string_equal(answer(f, OK_PROGRAM), "0AF401030304");
	assert_string_equal(answer(f, FAILED_PROGRAM), ASK_PROGRAM);
	assert_string_equal(program(f, 0, 0, 0), "0AF401030304");
	assert_string_equal(answer(f, OK_PROGRAM), ASK_PROGRAM);
	/* It may be a short one that has ended. */
	assert_string_equal(program(f, 0, 0, 0), "=indeterminate");
	drop(f);
}

static void a_delay_does_not_outlive_its_start(void **state)
{
	struct fixture *f = make(1);
	struct db_args later = { .program_number = 4, .program_delay = 9 };
	struct db_args now = { .program_number = 4 };

	(void)state;
	/* Nobody knows what was set before this program began. A controller may refuse 0. */
	command(f, 0, DB_CMD_START_PROGRAM, now);
	assert_string_equal(program(f, 0, 0, 0), "0AF401030500");
	assert_string_equal(answer(f, FAILED_PROGRAM), "0AF401030304");
	answer(f, OK_PROGRAM);
	assert_string_equal(program(f, 1, 4, 1), "=ok");
	assert_int_equal(feedback(f, 0).program, 4);
	assert_int_equal(feedback(f, 0).program_state, XYZA_PROGRAM_RUNNING);
	command(f, 0, DB_CMD_START_PROGRAM, now);
	assert_string_equal(program(f, 0, 4, 1), "0AF401030304");
	/* An idle program has no number. */
	assert_int_equal(feedback(f, 0).program, 0);
	answer(f, OK_PROGRAM);
	program(f, 1, 4, 2);
	command(f, 0, DB_CMD_START_PROGRAM, later);
	assert_string_equal(program(f, 0, 4, 1), "0AF401030509");
	assert_string_equal(answer(f, OK_PROGRAM), "0AF401030304");
	answer(f, OK_PROGRAM);
	/* Until its delay is over nothing shows that it has begun. */
	assert_string_equal(program(f, 0, 4, 0), "=unproven");
	command(f, 0, DB_CMD_START_PROGRAM, now);
	assert_string_equal(program(f, 0, 4, 0), "0AF401030500");
	assert_string_equal(answer(f, OK_PROGRAM), "0AF401030304");
	drop(f);
}

/* --- acknowledged, and not done ---------------------------------------------------------------------- */

static const struct {
	enum db_command command;
	struct db_args args;
	unsigned program_state;
	const char *ignores;
	const char *ends;
} without_effect[] = {
	{ DB_CMD_ENABLE, { 0 }, 0, "0BF10103E5", "=failed" },
	{ DB_CMD_JOG_POSITIVE, { 0 }, 0, "0AF3010303", "=failed" },
	{ DB_CMD_MOVE_VELOCITY, { .target_velocity = 7.0f }, 0, "0AF3010303", "=failed" },
	{ DB_CMD_MOVE_VELOCITY, { .target_velocity = 7.0f }, 0, "0BF10103E2", "=refused" },
	{ DB_CMD_SET_OUTPUT,
	  { .output_number = 3, .output_value = 1 },
	  0,
	  "0BF10103E4",
	  "=failed" },
	{ DB_CMD_SET_POSITION, { .target_position = 9 }, 0, "0BF10103E1A1", "=failed" },
	{ DB_CMD_START_PROGRAM, { .program_number = 2 }, 0, "0AF4010303", "=indeterminate" },
	{ DB_CMD_PAUSE_PROGRAM, { 0 }, 1, "0AF4010302", "=failed" },
	{ DB_CMD_CONTINUE_PROGRAM, { 0 }, 2, "0AF4010306", "=failed" },
	{ DB_CMD_END_PROGRAM, { 0 }, 2, "0AF4010307", "=failed" },
	{ DB_CMD_CLEAR_FAULT, { 0 }, 3, "0AF4010307", "=failed" },
};

/* An acknowledgement proves that a frame arrived whole. */
static void an_acknowledgement_is_no_proof(void **state)
{
	(void)state;
	for (size_t i = 0; i < sizeof without_effect / sizeof without_effect[0]; i++) {
		for (unsigned ignores = 0; ignores < 2; ignores++) {
			struct fixture *f = make(1);
			const char *said;

			f->program_state = without_effect[i].program_state;
			f->ignores = ignores ? without_effect[i].ignores : NULL;
			said = whole(f, command(f, 0, without_effect[i].command,
			                        without_effect[i].args));
			assert_string_equal(strchr(said, '='),
			                    ignores ? without_effect[i].ends : "=ok");
			drop(f);
		}
	}
}

/* What takes its time to show is waited for, and not longer than configured. */
static void an_effect_may_take_its_time(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	set_option(f, "reaction-ms", 100);
	db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	for (unsigned i = 0; i < 3; i++) {
		assert_string_equal(value(f, 1), "0AF10103E1A3");
		assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
		f->now += 30 * MS;
	}
	assert_string_equal(value(f, 0), "=ok");
	/* One that never begins is ended, so that it does not begin later. */
	f->now += 200 * MS;
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 1), "0AF10103E1A3");
	f->now += 100 * MS;
	assert_string_equal(value(f, 1), "0AF301030200");
	assert_string_equal(answer(f, OK_MANUAL), "=failed");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	drop(f);
}

/* Two cycles that find it at two places are as good a proof as its state. */
static void another_position_shows_that_it_moves(void **state)
{
	struct fixture *f = make(1);
	struct db_job job;

	(void)state;
	set_option(f, "reaction-ms", 100);
	db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 1), "0AF10103E1A3");
	for (int32_t position = 5; position < 7; position++) {
		job = f->job;
		poll_all(f, true, position, 0);
		f->job = job;
		compose("0AF10103E1A3", f->bytes);
		f->exchange.request_length = 9;
		assert_string_equal(value(f, 1), position == 5 ? "0AF10103E1A3" : "=ok");
	}
	drop(f);
}

/* It is disabled, and nothing else happens to the controller. */
static void disabling_one_axis_leaves_the_others(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	*memory(f, 0xE5, 0xC1) = 3;
	poll_all(f, true, 0, 0);
	whole(f, jog(f, 1));
	assert_string_equal(whole(f, command(f, 0, DB_CMD_DISABLE, (struct db_args){ 0 })),
	                    "0AF10103E1A3 0AF10103E5C1 0BF10103E5C102000000 0AF10103E5C1 =ok");
	assert_int_equal(*memory(f, 0xE1, 0xB3), 0);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_CONTINUOUS_MOTION);
	/* The one that moves is stopped first. */
	assert_string_equal(
		whole(f, command(f, 1, DB_CMD_DISABLE, (struct db_args){ 0 })),
		"0AF10103E1B3 0AF301030100 0AF10103E5C1 0BF10103E5C100000000 0AF10103E5C1 =ok");
	drop(f);
}

/* An interrupted program is the one fault that there is to clear. */
static void an_interruption_is_cleared(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	f->program_state = 3;
	poll_all(f, true, 0, 3);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_ERROR_STOP);
	assert_string_equal(whole(f, command(f, 0, DB_CMD_CLEAR_FAULT, (struct db_args){ 0 })),
	                    ASK_PROGRAM " 0AF401030700 " ASK_PROGRAM " =ok");
	assert_int_equal(feedback(f, 0).error, DB_ERROR_NONE);
	drop(f);
}

/* --- what crosses a cycle ------------------------------------------------------------------------------ */

/* A job that was put aside goes on behind the frame that it has sent. */
static void go_on(struct fixture *f, struct db_job job, const char *said)
{
	f->job = job;
	f->talking = f->axes[0];
	f->exchange.request_length = compose(said, f->bytes);
}

static struct fixture *make_slow(unsigned axes)
{
	struct fixture *f = make(axes);
	struct db_device *first = NULL;

	set_option(f, "reaction-ms", 100);
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (!f->axes[i])
			continue;
		db_driver_xyza.init(f->axes[i], first, &f->bus, &f->drives[i]);
		first = first ? first : f->axes[i];
	}
	return f;
}

/* That it moved before it was told to says no more about now than that it stood. */
static void a_motion_from_before_a_jog_does_not_show_it(void **state)
{
	struct fixture *f = make_slow(1);
	struct db_job poll;

	(void)state;
	poll_all(f, true, 0, 0);
	begin(f, 0, DB_JOB_POLL);
	value(f, 0);
	poll = f->job;
	jog(f, 0);
	answer(f, OK_MANUAL);
	go_on(f, poll, "0AF10103E1A2");
	value(f, 0);
	value(f, 3);
	value(f, 0);
	/* So "standing" may still be from before it. */
	poll_all(f, true, 3, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	f->now += 100 * MS;
	poll_all(f, true, 3, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	drop(f);
}

/* A program that is ended may have started any axis right before. */
static void a_motion_from_before_a_programs_end_does_not_show_its_last(void **state)
{
	struct fixture *f = make_slow(1);
	struct db_job poll;

	(void)state;
	poll_all(f, true, 0, 1);
	begin(f, 0, DB_JOB_POLL);
	value(f, 0);
	poll = f->job;
	command(f, 0, DB_CMD_END_PROGRAM, (struct db_args){ 0 });
	program(f, 1, 1, 7);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	answer(f, OK_PROGRAM);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	assert_true(feedback(f, 0).status & DB_STATUS_MOVING);
	go_on(f, poll, "0AF10103E1A2");
	value(f, 0);
	value(f, 3);
	value(f, 0);
	poll_all(f, true, 3, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	f->now += 100 * MS;
	poll_all(f, true, 3, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	drop(f);
}

/* A stop is sent between two reads of a cycle: what was seen before does not end it. */
static void what_was_seen_before_a_stop_does_not_end_it(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	for (uint32_t stood = 0; stood < 2; stood++) {
		struct db_job poll;

		poll_all(f, false, 0, 0);
		begin(f, 0, DB_JOB_POLL);
		value(f, stood);
		poll = f->job;
		command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
		answer(f, OK_MANUAL);
		assert_string_equal(answer(f, OK_PROGRAM), "=ok");
		go_on(f, poll, "0AF10103E1A2");
		value(f, 0);
		value(f, 3);
		value(f, 0);
		assert_int_equal(feedback(f, 0).state, DB_AXIS_STOPPING);
		assert_true(feedback(f, 0).status & DB_STATUS_MOVING);
		poll_all(f, true, 3, 0);
		assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	}
	drop(f);
}

/* It stands since that was read: a cycle that saw it moving before does not say otherwise. */
static void what_was_seen_before_a_stand_does_not_end_it(void **state)
{
	struct fixture *f = make(1);
	struct db_job poll;

	(void)state;
	poll_all(f, false, 0, 0);
	poll_all(f, false, 50, 0);
	assert_true(feedback(f, 0).velocity > 0.0f);
	begin(f, 0, DB_JOB_POLL);
	value(f, 0);
	poll = f->job;
	command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 1), "=ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	assert_float_equal(feedback(f, 0).velocity, 0.0f, 0.0f);
	go_on(f, poll, "0AF10103E1A2");
	value(f, 0);
	value(f, 60);
	value(f, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	assert_false(feedback(f, 0).status & DB_STATUS_MOVING);
	drop(f);
}

/* An axis that was to stop, and was jogged after that, is not stopping. */
static void a_jog_behind_a_stop_is_a_motion(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, 1);
	whole(f, command(f, 0, DB_CMD_STOP, (struct db_args){ 0 }));
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STOPPING);
	assert_string_equal(whole(f, jog(f, 0)), ASK_PROGRAM " 0AF3010303A1 0AF10103E1A3 =ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	assert_false(feedback(f, 0).status & DB_STATUS_STOPPING);
	drop(f);
}

/* The direction of a jog is known before any cycle has seen it. */
static void a_jog_goes_on_in_its_direction(void **state)
{
	static const struct db_args back = { .target_velocity = -900.0f };
	static const struct db_args forth = { .target_velocity = 900.0f };

	(void)state;
	for (unsigned negative = 0; negative < 2; negative++) {
		struct fixture *f = make(1);
		enum db_command way = negative ? DB_CMD_JOG_NEGATIVE : DB_CMD_JOG_POSITIVE;

		whole(f, command(f, 0, way, (struct db_args){ 0 }));
		assert_string_equal(command(f, 0, DB_CMD_MOVE_VELOCITY, negative ? back : forth),
		                    "0AF10103E2A4");
		assert_string_equal(command(f, 0, DB_CMD_MOVE_VELOCITY, negative ? forth : back),
		                    "0AF301030200");
		drop(f);
	}
}

/* A position that is set is not shown half; a stop ends that, and what is read counts at once. */
static void a_stop_shows_positions_again(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 100, 0);
	command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = -7 });
	value(f, 1);
	answer(f, OK_DATA);
	poll_all(f, true, 7, 0);
	assert_int_equal(feedback(f, 0).position, 100);
	whole(f, command(f, 0, DB_CMD_STOP, (struct db_args){ 0 }));
	poll_all(f, true, 7, 0);
	assert_int_equal(feedback(f, 0).position, 7);
	drop(f);
}

/* A program that ended by itself was not paused; one that goes on may differ in any bit of its step. */
static void a_program_shows_what_was_done_to_it(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	command(f, 0, DB_CMD_PAUSE_PROGRAM, (struct db_args){ 0 });
	program(f, 1, 6, 1);
	answer(f, OK_PROGRAM);
	assert_string_equal(program(f, 0, 6, 1), "=failed");
	command(f, 0, DB_CMD_CONTINUE_PROGRAM, (struct db_args){ 0 });
	program(f, 2, 6, 1);
	answer(f, OK_PROGRAM);
	assert_string_equal(program(f, 2, 6, 0x8001), "=ok");
	drop(f);
}

/* Speeds are told apart from positions by a fifth, and by 4 pulses of a cycle: nearer ones are not
 * waited for. x goes by `way` in 100 ms, and is to go at `wanted`. */
static void speeds_too_near_to_tell_apart_are_not_waited_for(void **state)
{
	static const struct {
		int32_t way;
		float wanted;
		bool waits;
	} cases[] = {
		{ 50, 550.0f, false },    { 50, 700.0f, true },    { 80, 1000.0f, false },
		{ 80, 1001.0f, true },    { 1, 50.0f, false },     { 1, 51.0f, true },
		{ -80, -1000.0f, false }, { -80, -1001.0f, true },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture *f = make(1);
		db_time taken;

		poll_all(f, false, -10000, 0);
		taken = feedback(f, 0).taken;
		f->now = taken + 97 * MS; /* the place is the third answer, 1 ms each */
		poll_all(f, false, -10000 + cases[i].way, 0);
		assert_float_equal(feedback(f, 0).velocity, 10.0f * (float)cases[i].way, 0.001f);
		command(f, 0, DB_CMD_MOVE_VELOCITY,
		        (struct db_args){ .target_velocity = cases[i].wanted });
		value(f, 1);
		answer(f, OK_DATA);
		value(f, (uint32_t)fabsf(cases[i].wanted));
		assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
		assert_string_equal(value(f, 0), cases[i].waits ? "0AF10103E1A3" : "=unproven");
		drop(f);
	}
}

/* --- lost answers ------------------------------------------------------------------------------------ */

static void a_jog_is_never_repeated_blindly(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, 0);
	/* It moves: it was heard. */
	jog(f, 0);
	assert_false(f->exchange.repeatable);
	assert_string_equal(lost(f), "0AF10103E1A3");
	assert_true(f->exchange.repeatable);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	assert_string_equal(value(f, 0), "=ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	/* It moved before: whether it was heard this time nobody can tell. */
	jog(f, 0);
	lost(f);
	assert_string_equal(value(f, 0), "=unproven");
	/* It stands: it was not; said again, but not for ever, and then not left to begin. */
	poll_all(f, true, 0, 0);
	jog(f, 0);
	for (unsigned i = 0; i < 2; i++) {
		lost(f);
		assert_string_equal(value(f, 1), "0AF3010303A1");
	}
	lost(f);
	assert_string_equal(value(f, 1), "0AF301030200");
	assert_string_equal(answer(f, OK_MANUAL), "=timeout");
	/* Nobody can tell. */
	jog(f, 0);
	lost(f);
	assert_string_equal(lost(f), "=indeterminate");
	poll_all(f, true, 0, 0);
	jog(f, 0);
	lost(f);
	assert_string_equal(refuse(f, FAILED_DATA), "=indeterminate");
	drop(f);
}

/* It may stand because it was stopped: the operator of another axis stops all of them. */
static void a_jog_is_not_repeated_after_a_stop(void **state)
{
	struct fixture *f = make(3);
	struct db_request request;
	struct db_job job;

	(void)state;
	poll_all(f, true, 0, 0);
	jog(f, 0);
	lost(f);
	job = f->job;
	request = f->request;
	whole(f, command(f, 1, DB_CMD_STOP, (struct db_args){ 0 }));
	f->job = job;
	f->request = request;
	f->talking = f->axes[0];
	compose("0AF10103E1A3", f->bytes);
	f->exchange.request_length = 9;
	assert_string_equal(value(f, 1), "=cancelled");
	drop(f);
}

static void program_commands_are_never_repeated_blindly(void **state)
{
	static const struct {
		enum db_command command;
		unsigned before;
		unsigned after;
		const char *ends;
	} cases[] = {
		{ DB_CMD_START_PROGRAM, 0, 1, "=ok" },
		{ DB_CMD_START_PROGRAM, 0, 0, "=indeterminate" },
		{ DB_CMD_PAUSE_PROGRAM, 1, 2, "=ok" },
		{ DB_CMD_PAUSE_PROGRAM, 1, 1, "=indeterminate" },
		{ DB_CMD_CONTINUE_PROGRAM, 2, 1, "=ok" },
		{ DB_CMD_CONTINUE_PROGRAM, 2, 2, "=indeterminate" },
		{ DB_CMD_END_PROGRAM, 2, 0, "=ok" },
		{ DB_CMD_END_PROGRAM, 2, 2, "=indeterminate" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture *f = make(1);
		bool start = cases[i].command == DB_CMD_START_PROGRAM;

		command(f, 0, cases[i].command, (struct db_args){ .program_number = 6 });
		program(f, cases[i].before, 6, 1);
		if (start)
			answer(f, OK_PROGRAM);
		assert_false(f->exchange.repeatable);
		assert_string_equal(lost(f), ASK_PROGRAM);
		assert_string_equal(program(f, cases[i].after, 6, 1), cases[i].ends);
		/* Another program is no proof. */
		if (start) {
			command(f, 0, cases[i].command, (struct db_args){ .program_number = 6 });
			program(f, 0, 6, 1);
			if (strcmp(f->said, "0AF401030500") == 0)
				answer(f, OK_PROGRAM);
			lost(f);
			assert_string_equal(program(f, 1, 5, 1), "=indeterminate");
		}
		drop(f);
	}
}

static void stops_and_writes_are_repeated(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, 1);
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	assert_true(f->exchange.repeatable);
	assert_string_equal(lost(f), "=timeout");
	command(f, 0, DB_CMD_SET_OUTPUT, (struct db_args){ .output_number = 1 });
	assert_true(f->exchange.repeatable);
	assert_string_equal(lost(f), "=timeout");
	drop(f);
}

/* One that was just jogged may still say that it stands: it is stopped before its power goes, and
 * no other axis begins to move. */
static void a_stand_right_behind_a_jog_is_not_believed(void **state)
{
	struct fixture *f = make_slow(3);

	(void)state;
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(command(f, 0, DB_CMD_DISABLE, (struct db_args){ 0 }), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF301030100");
	drop(f);
	f = make_slow(3);
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(jog(f, 1), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF10103E1A3");
	assert_true(f->exchange.again);
	f->now += 100 * MS;
	assert_string_equal(value(f, 1), "0AF10103E1A3");
	assert_string_equal(value(f, 1), "0AF3010303A3");
	drop(f);
}

/* Disabling what moves stops all axes: a jog of another one is not said again. */
static void a_jog_is_not_repeated_after_a_moving_axis_was_disabled(void **state)
{
	struct fixture *f = make(3);
	struct db_request request;
	struct db_job job;

	(void)state;
	poll_all(f, true, 0, 0);
	jog(f, 0);
	lost(f);
	job = f->job;
	request = f->request;
	*memory(f, 0xE1, 0xB3) = 0;
	assert_string_equal(command(f, 1, DB_CMD_DISABLE, (struct db_args){ 0 }), "0AF10103E1B3");
	assert_string_equal(obey(f), "0AF301030100");
	obey(f);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STOPPING);
	f->request = request;
	go_on(f, job, "0AF10103E1A3");
	assert_string_equal(value(f, 1), "=cancelled");
	drop(f);
}

/* A place that was read before another one was set is not the present one. */
static void a_place_from_before_a_set_position_is_not_shown(void **state)
{
	struct fixture *f = make(1);
	struct db_job poll;

	(void)state;
	poll_all(f, true, 90, 0);
	begin(f, 0, DB_JOB_POLL);
	value(f, 1);
	value(f, 0);
	assert_string_equal(value(f, 100), "0AF10103E1A2");
	poll = f->job;
	whole(f, command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 7 }));
	assert_int_equal(feedback(f, 0).position, 7);
	go_on(f, poll, "0AF10103E1A2");
	value(f, 0);
	assert_int_equal(feedback(f, 0).position, 7);
	/* One whose sign was refused has the place that is read. */
	command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = -8 });
	value(f, 1);
	answer(f, OK_DATA);
	assert_string_equal(refuse(f, FAILED_DATA), "=refused");
	poll_all(f, true, 8, 0);
	assert_int_equal(feedback(f, 0).position, 8);
	drop(f);
}

/* What is read of a program on the way is shown. */
static void a_commands_look_at_the_program_is_shown(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, 2);
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(answer(f, OK_MANUAL), ASK_PROGRAM);
	assert_string_equal(program(f, 3, 1, 9), "=ok");
	assert_int_equal(feedback(f, 0).program_state, 3);
	assert_int_equal(feedback(f, 0).program_step, 9);
	poll_all(f, true, 0, 1);
	assert_string_equal(jog(f, 0), ASK_PROGRAM);
	program(f, 2, 1, 5);
	assert_int_equal(feedback(f, 0).program_state, 2);
	drop(f);
}

/* What is written once more has its whole time again. */
static void a_position_that_is_written_again_has_its_time_again(void **state)
{
	struct fixture *f = make_slow(1);
	unsigned reads = 0;

	(void)state;
	command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = -9 });
	value(f, 1);
	for (unsigned writes = 0; writes < 3; writes++) {
		answer(f, OK_DATA);
		assert_string_equal(answer(f, OK_DATA), "0AF10103E1A2");
		for (reads = 0; strcmp(f->said, "0AF10103E1A2") == 0; reads++) {
			f->now += 9 * MS;
			value(f, 0);
		}
		assert_int_equal(reads, 11);
	}
	assert_string_equal(f->said, "=failed");
	drop(f);
}

/* What one command came to is not the next one's. */
static void each_command_begins_anew(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, 0);
	whole(f, command(f, 0, DB_CMD_STOP, (struct db_args){ 0 }));
	for (unsigned i = 0; i < 2; i++) {
		jog(f, 0);
		for (unsigned again = 0; again < 2; again++) {
			lost(f);
			assert_string_equal(value(f, 1), "0AF3010303A1");
		}
		lost(f);
		assert_string_equal(value(f, 1), "0AF301030200");
		assert_string_equal(answer(f, OK_MANUAL), "=timeout");
	}
	/* Lost, and answered the second time: it has not begun, and that is all. */
	jog(f, 0);
	lost(f);
	value(f, 1);
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 1), "0AF301030200");
	assert_string_equal(answer(f, OK_MANUAL), "=failed");
	drop(f);
}

/* A program that is refused is asked for twice, and not more often. */
static void a_refused_program_is_said_twice(void **state)
{
	struct fixture *f = make(1);
	unsigned said = 0;

	(void)state;
	command(f, 0, DB_CMD_END_PROGRAM, (struct db_args){ 0 });
	program(f, 2, 6, 1);
	for (unsigned i = 0; i < 20 && f->said[0] != '='; i++) {
		bool asks = strcmp(f->said, ASK_PROGRAM) == 0;

		said += !asks;
		if (asks)
			program(f, 2, 6, 1);
		else
			answer(f, FAILED_PROGRAM);
	}
	assert_string_equal(f->said, "=refused");
	assert_int_equal(said, 2);
	drop(f);
}

/* While a program is stopped manual mode may refuse: what counts is whether the program runs. */
static void a_stop_beside_a_stopped_program_may_be_refused(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, true, 0, XYZA_PROGRAM_WAITING);
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	assert_string_equal(answer(f, FAILED_MANUAL), ASK_PROGRAM);
	assert_string_equal(program(f, 2, 1, 7), "=ok");
	drop(f);
}

/* Where others share an item, it is not written without having been read. */
static void an_item_that_is_refused_is_written_only_as_a_whole(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	command(f, 0, DB_CMD_ENABLE, (struct db_args){ 0 });
	assert_string_equal(refuse(f, FAILED_DATA), "=refused");
	assert_true(feedback(f, 0).status & DB_STATUS_REFUSED);
	f->setting = (struct db_setting){ .param = XYZA_START_KEY, .value.u = 3 };
	f->request = (struct db_request){ .setting_count = 1, .settings = &f->setting };
	begin(f, 0, DB_JOB_SETTINGS);
	assert_string_equal(refuse(f, FAILED_DATA), "=refused");
	command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 5.0f });
	assert_string_equal(refuse(f, FAILED_DATA), "0BF10103E2A405000000");
	answer(f, OK_DATA);
	/* Nothing can show it; that it moves is seen. */
	assert_string_equal(refuse(f, FAILED_DATA), "0AF3010303A1");
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 0), "=unproven");
	drop(f);
}

/* What a command has read shows at once; what it leaves half done is read by the next cycle. */
static void what_a_command_reads_is_shown(void **state)
{
	struct fixture *f = make_slow(1);
	const struct db_args place = { .target_position = 9 };

	(void)state;
	poll_all(f, true, 3, 0);
	whole(f, command(f, 0, DB_CMD_SET_OUTPUT,
	                 (struct db_args){ .output_number = 2, .output_value = 1 }));
	assert_int_equal(feedback(f, 0).outputs, 2);
	whole(f, command(f, 0, DB_CMD_SET_POSITION, place));
	assert_string_equal(f->said, "=ok");
	assert_int_equal(feedback(f, 0).taken, f->now);
	assert_int_equal(feedback(f, 0).outputs, 2);
	/* Not taken, or lost. */
	for (unsigned i = 0; i < 2; i++) {
		command(f, 0, DB_CMD_SET_POSITION, place);
		value(f, 1);
		answer(f, OK_DATA);
		if (i == 0) {
			answer(f, OK_DATA);
			value(f, 1);
		} else {
			lost(f);
		}
		poll_all(f, true, (int32_t)(20 + i), 0);
		assert_int_equal(feedback(f, 0).position, 20 + i);
	}
	drop(f);
}

/* --- raw frames ----------------------------------------------------------------------------------------- */

static struct db_args raw(const char *hex)
{
	struct db_args args = { .raw_length = (uint16_t)(strlen(hex) / 2) };

	for (size_t i = 0; i < args.raw_length; i++) {
		unsigned byte;

		assert_int_equal(sscanf(hex + 2 * i, "%2x", &byte), 1);
		args.raw_request[i / 2] |= (uint16_t)(byte << (i % 2 == 0 ? 8 : 0));
	}
	return args;
}

static enum db_result check_raw(struct fixture *f, const char *hex)
{
	struct db_args args = raw(hex);

	return db_driver_xyza.check(&f->bus, &f->drives[0], DB_CMD_RAW_FRAME, &args);
}

static void a_raw_frame_is_refused_unless_it_is_allowed(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	assert_int_equal(check_raw(f, "0AF10100E1A1"), DB_RESULT_UNSUPPORTED);
	assert_true(db_driver_xyza.forbidden(&f->bus, &f->drives[0]) ==
	            DB_COMMAND_BIT(DB_CMD_RAW_FRAME));
	set_option(f, "raw-frames", 1);
	assert_true(db_driver_xyza.forbidden(&f->bus, &f->drives[0]) == 0);
	assert_int_equal(check_raw(f, "0AF10100E1A1"), DB_RESULT_OK);
	drop(f);
}

static void count_warning(void *context, const struct db_drive_config *drive, bool error,
                          const char *format, ...)
{
	assert_null(drive);
	assert_false(error);
	assert_non_null(strstr(format, "raw-frames is on"));
	++*(unsigned *)context;
}

/* Such frames pass every limit and lock. */
static void who_allows_raw_frames_is_warned(void **state)
{
	struct fixture *f = make(1);
	unsigned warnings = 0;

	(void)state;
	db_driver_xyza.check_config(&f->bus, NULL, 0, count_warning, &warnings);
	assert_int_equal(warnings, 0);
	set_option(f, "raw-frames", 1);
	db_driver_xyza.check_config(&f->bus, NULL, 0, count_warning, &warnings);
	assert_int_equal(warnings, 1);
	drop(f);
}

/* Nobody but the drive itself can be meant, and nothing but a whole frame goes out. */
static void a_raw_frame_is_checked(void **state)
{
	static const char *const wrong[] = {
		"",
		"0A",
		"0AF10104E1A1",                     /* another controller */
		"0AF10000E1A1",                     /* of a controller */
		"0AF10100E1",                       /* too short */
		"0AF10100E1A100",                   /* too long */
		"0CAA010000F1",                     /* an answer */
		"09F10100E1A1",                     /* no such mark */
		"0BF10100E1A1",                     /* of data */
		"0F010100000000000001020304050607", /* whole */
	};
	struct fixture *f = make(1);
	struct db_args args = raw("0AF10100E1A1");

	(void)state;
	set_option(f, "raw-frames", 1);
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0] - 1; i++) {
		if (check_raw(f, wrong[i]) != DB_RESULT_OUT_OF_RANGE)
			fail_msg("%s", wrong[i]);
	}
	assert_int_equal(check_raw(f, wrong[sizeof wrong / sizeof wrong[0] - 1]), DB_RESULT_OK);
	args.raw_length = 2 * DB_RAW_REQUEST_WORDS + 1;
	assert_int_equal(db_driver_xyza.check(&f->bus, &f->drives[0], DB_CMD_RAW_FRAME, &args),
	                 DB_RESULT_OUT_OF_RANGE);
	drop(f);
}

static void the_answer_to_a_raw_frame_is_shown(void **state)
{
	struct fixture *f = make(3);
	const struct db_nameplate *x = plate(f, 0);

	(void)state;
	set_option(f, "raw-frames", 1);
	/* The object may be given, or left to the bridge. */
	assert_string_equal(command(f, 0, DB_CMD_RAW_FRAME, raw("0AF10103E1A1")), "0AF10103E1A1");
	assert_false(f->exchange.repeatable);
	assert_string_equal(answer(f, OK_MANUAL), "ignored");
	assert_string_equal(answer(f, "0BF40003000001000000"), "ignored");
	assert_string_equal(value(f, 257), "=ok");
	assert_int_equal(x->raw_length, 13);
	assert_int_equal(x->raw_answer[0], 0x5AA5);
	assert_int_equal(x->raw_answer[4], 0x0101);
	assert_int_equal(x->raw_answer[6] & 0xFF, 0);
	assert_int_equal(plate(f, 1)->raw_length, 0);
	assert_false(x->doubtful);
	/* An acknowledgement proves nothing, and what was changed is unknown. */
	assert_string_equal(command(f, 0, DB_CMD_RAW_FRAME, raw("0BF10100E2A464000000")),
	                    "0BF10103E2A464000000");
	assert_int_equal(x->raw_length, 0);
	assert_string_equal(answer(f, OK_DATA), "=unproven");
	assert_int_equal(x->raw_length, 9);
	assert_true(x->doubtful && plate(f, 1)->doubtful);
	/* Not said again, whatever becomes of it. */
	command(f, 0, DB_CMD_RAW_FRAME, raw("0AF301000101"));
	assert_string_equal(answer(f, FAILED_MANUAL), "=refused");
	command(f, 0, DB_CMD_RAW_FRAME, raw("0AF301000101"));
	assert_string_equal(lost(f), "=indeterminate");
	assert_int_equal(x->raw_length, 0);
	drop(f);
}

/* Orders and marks that no page has. */
static void what_no_document_has_may_come_back(void **state)
{
	struct fixture *f = make(1);
	uint8_t frame[XYZA_FRAME_MAX];
	size_t length = compose("0BFC0003010203040506", frame);
	int address = -1;

	(void)state;
	assert_int_equal(db_driver_xyza.accept(&f->bus, frame, length, &address), DB_FRAME_BAD);
	set_option(f, "raw-frames", 1);
	assert_int_equal(db_driver_xyza.accept(&f->bus, frame, length, &address), DB_FRAME_GOOD);
	assert_int_equal(address, OBJECT);
	command(f, 0, DB_CMD_RAW_FRAME, raw("0AFB01000100"));
	assert_string_equal(answer(f, "0BFC0004010203040506"), "ignored");
	assert_string_equal(answer(f, "0BFC0003010203040506"), "=ok");
	/* Nothing else takes it. */
	command(f, 0, DB_CMD_JOG_POSITIVE, (struct db_args){ 0 });
	assert_string_equal(answer(f, "0BFC0003010203040506"), "ignored");
	frame[length - 1] ^= 1;
	assert_int_equal(db_driver_xyza.accept(&f->bus, frame, length, &address), DB_FRAME_BAD);
	drop(f);
}

/* --- parameters ---------------------------------------------------------------------------------------- */

static const char *set(struct fixture *f, unsigned axis, enum xyza_param param, uint32_t number)
{
	f->setting = (struct db_setting){ .param = (uint16_t)param, .value.u = number };
	f->request = (struct db_request){ .setting_count = 1, .settings = &f->setting };
	return begin(f, axis, DB_JOB_SETTINGS);
}

static void all_parameters_are_read(void **state)
{
	struct fixture *f = make(3);
	const struct db_nameplate *y = plate(f, 1);
	unsigned reads = 0;
	const char *said = begin(f, 1, DB_JOB_IDENTIFY);

	(void)state;
	assert_string_equal(said, "0AF10103E2B1");
	while (said[0] != '=') {
		unsigned key = (unsigned)f->bytes[6] << 8 | f->bytes[7];

		/* C8 is not known to this controller. */
		said = key == 0xE3B1 ? value(f, 200) :
		       key == 0xE3B2 ? value(f, 16) :
		       key == 0xE3B3 ? value(f, 5000) :
		       key == 0xE5C2 ? value(f, 0x080706) :
		       key == 0xE5C1 ? value(f, 2) :
		       key == 0xE5C8 ? refuse(f, FAILED_DATA) :
		                       value(f, 1);
		reads++;
	}
	assert_string_equal(said, "=ok");
	assert_int_equal(reads, 16);
	assert_int_equal(y->values[XYZA_START_KEY].u, 6);
	assert_int_equal(y->values[XYZA_STOP_KEY].u, 7);
	assert_int_equal(y->values[XYZA_PAUSE_KEY].u, 8);
	assert_false(y->valid[0] >> XYZA_SYSTEM_INFO & 1);
	assert_false(y->valid[0] >> XYZA_FACTORY_RESET & 1);
	assert_false(y->valid[0] >> XYZA_SLAVE_NUMBER & 1);
	/* What the axes share, x knows as well; what is y's own it does not. */
	assert_int_equal(plate(f, 0)->values[XYZA_STOP_KEY].u, 7);
	assert_false(plate(f, 0)->valid[0] >> XYZA_LEAD & 1);
	/* 3200 pulses for 5 mm. */
	assert_float_equal(feedback(f, 1).counts_per_unit, 640.0f, 0.001f);
	assert_float_equal(feedback(f, 0).counts_per_unit, 0.0f, 0.0f);
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_STANDSTILL);
	assert_true(feedback(f, 1).status & DB_STATUS_PARAMS_VALID);
	/* One that was gone may have been exchanged. */
	db_driver_xyza.gone(f->axes[1]);
	assert_false(feedback(f, 1).status & DB_STATUS_PARAMS_VALID);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_OFFLINE);
	drop(f);
}

static void identify(struct fixture *f, unsigned axis)
{
	whole(f, begin(f, axis, DB_JOB_IDENTIFY));
	assert_string_equal(f->said, "=ok");
}

/* So many readings 100 ms apart; how often a question that begins so was among theirs. */
static unsigned count_in_cycles(struct fixture *f, unsigned cycles, const char *question)
{
	unsigned count = 0;

	while (cycles-- > 0) {
		const char *said = begin(f, 0, DB_JOB_POLL);

		for (; said[0] != '='; said = obey(f))
			count += strncmp(said, question, strlen(question)) == 0;
		f->now += 100 * MS;
	}
	return count;
}

/* Whoever stands at the controller may take the power off, and a reset does. */
static void the_power_is_read_again(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	*memory(f, 0xE5, 0xC1) = 1;
	/* First all is read once. */
	assert_int_equal(count_in_cycles(f, 30, "0AF10103E5"), 0);
	assert_int_equal(count_in_cycles(f, 30, "0AF10103E2"), 0);
	identify(f, 0);
	identify(f, 1);
	count_in_cycles(f, 1, "");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STANDSTILL);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_DISABLED);
	*memory(f, 0xE5, 0xC1) = 2;
	assert_int_equal(count_in_cycles(f, 10, "0AF10103E5C1"), 1);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_STANDSTILL);
	assert_int_equal(plate(f, 0)->values[XYZA_ENABLE].u, 2);
	/* One that is told to stop is judged by the end of a reading: nothing comes before that. */
	*memory(f, 0xE1, 0xA3) = 0;
	count_in_cycles(f, 1, "");
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	answer(f, OK_PROGRAM);
	assert_int_equal(count_in_cycles(f, 40, "0AF10103E5C1"), 0);
	drop(f);
}

static void every_item_is_read_again_in_turn(void **state)
{
	static const unsigned items[][3] = {
		{ 0xE2, 0xA1, XYZA_MIN_SPEED },    { 0xE2, 0xB2, XYZA_MAX_SPEED },
		{ 0xE2, 0xB4, XYZA_MANUAL_SPEED }, { 0xE3, 0xA2, XYZA_MICROSTEP },
		{ 0xE5, 0xC3, XYZA_BRAKE },        { 0xE5, 0xC2, XYZA_START_KEY },
		{ 0xE5, 0xC7, XYZA_START_UP },     { 0xE5, 0xC9, XYZA_PULSE_MODE },
	};
	struct fixture *f = make(3);

	(void)state;
	identify(f, 0);
	identify(f, 1);
	for (size_t i = 0; i < sizeof items / sizeof items[0]; i++)
		*memory(f, items[i][0], items[i][1]) = 1;
	/* At most one a second, and one in ten readings: two axes have 7 each, and 6 together. */
	assert_in_range(count_in_cycles(f, 200, "0AF10103E2"), 8, 9);
	for (size_t i = 0; i < sizeof items / sizeof items[0]; i++)
		assert_int_equal(plate(f, items[i][1] >> 4 == 0xB)->values[items[i][2]].u, 1);
	assert_int_equal(plate(f, 1)->values[XYZA_BRAKE].u, 1);
	assert_int_equal(count_in_cycles(f, 200, "0AF10103E5C5"), 0);
	assert_in_range(count_in_cycles(f, 200, "0AF10103E5C3"), 1, 1);
	drop(f);
}

/* What told its power and does not any more is read anew as a whole; what then is silent is left out. */
static void an_item_that_falls_silent_is_doubtful(void **state)
{
	struct fixture *f = make(3);
	unsigned losses = 0;

	(void)state;
	identify(f, 0);
	identify(f, 1);
	for (unsigned i = 0; i < 20; i++) {
		const char *said = begin(f, 0, DB_JOB_POLL);

		assert_false(plate(f, 0)->doubtful);
		while (said[0] != '=' && strcmp(said, "0AF10103E5C1") != 0)
			said = obey(f);
		losses += said[0] != '=';
	}
	assert_int_equal(losses, 2);
	begin(f, 0, DB_JOB_POLL);
	assert_true(plate(f, 0)->doubtful);
	assert_true(plate(f, 1)->doubtful);
	for (unsigned axis = 0; axis < 2; axis++) {
		const char *said = begin(f, axis, DB_JOB_IDENTIFY);

		while (said[0] != '=')
			said = strcmp(said, "0AF10103E5C1") == 0 ? lost(f) : obey(f);
		assert_false(plate(f, axis)->valid[0] >> XYZA_ENABLE & 1);
	}
	assert_int_equal(count_in_cycles(f, 100, "0AF10103E5C1"), 0);
	drop(f);
}

/* All parameters of an axis are read; the answer to this is lost each time. */
static void identify_without(struct fixture *f, unsigned axis, const char *question)
{
	const char *said = begin(f, axis, DB_JOB_IDENTIFY);

	while (said[0] != '=')
		said = strcmp(said, question) == 0 ? lost(f) : obey(f);
	assert_string_equal(said, "=ok");
}

/* Two answers were lost, but the line's losses are not the controller's. */
static void what_was_lost_is_asked_for_again(void **state)
{
	static const char *const questions[] = { "0AF10103E2A1", "0AF10103E5C1", "0AF10103E5C9" };
	static const enum xyza_param params[] = { XYZA_MIN_SPEED, XYZA_ENABLE, XYZA_PULSE_MODE };

	(void)state;
	for (size_t i = 0; i < sizeof params / sizeof params[0]; i++) {
		struct fixture *f = make(3);
		uint64_t bit = UINT64_C(1) << params[i];

		identify_without(f, 0, questions[i]);
		identify_without(f, 1, questions[i]);
		assert_true(plate(f, 0)->missing[0] & bit);
		assert_int_equal(count_in_cycles(f, 140, questions[i]), 0);
		assert_true(count_in_cycles(f, 450, questions[i]) > 0);
		assert_true(plate(f, 0)->valid[0] & bit);
		assert_false(plate(f, 0)->missing[0] & bit);
		/* From now on in its turn, as all others. */
		assert_true(count_in_cycles(f, 200, questions[i]) > 0);
		drop(f);
	}
}

/* The other axis has read what is common. */
static void what_one_axis_lost_another_has_read(void **state)
{
	struct fixture *f = make(3);
	uint64_t bit = UINT64_C(1) << XYZA_PULSE_MODE;

	(void)state;
	identify(f, 0);
	identify_without(f, 1, "0AF10103E5C9");
	assert_true(plate(f, 1)->missing[0] & bit);
	count_in_cycles(f, 250, "");
	assert_true(plate(f, 1)->valid[0] & bit);
	assert_false(plate(f, 1)->missing[0] & bit);
	drop(f);
}

static bool is_lacking(const char *question)
{
	static const char *const lacks[] = { "0AF10103E2A1", "0AF10103E2A2", "0AF10103E2A3",
		                             "0AF10103E2A4" };
	bool found = false;

	for (size_t i = 0; i < sizeof(lacks) / sizeof(lacks[0]); i++)
		found = found || strcmp(question, lacks[i]) == 0;
	return found;
}

/* One that the line lost is asked for soon, however many the controller does not have. */
static void what_a_controller_lacks_keeps_nothing_else(void **state)
{
	struct fixture *f = make(1);
	const char *said = begin(f, 0, DB_JOB_IDENTIFY);
	unsigned asked = 0;

	(void)state;
	while (said[0] != '=')
		said = is_lacking(said) || strcmp(said, "0AF10103E5C9") == 0 ? lost(f) : obey(f);
	for (unsigned i = 0; i < 450; i++) {
		for (said = begin(f, 0, DB_JOB_POLL); said[0] != '=';) {
			asked += is_lacking(said);
			said = is_lacking(said) ? lost(f) : obey(f);
		}
		f->now += 100 * MS;
	}
	assert_true(plate(f, 0)->valid[0] >> XYZA_PULSE_MODE & 1);
	assert_in_range(asked, 4, 8);
	drop(f);
}

/* What it lacks is asked for once in 16 minutes by then, what the line lost when all were read anew is not. */
static void what_is_lost_when_a_controller_returns_is_asked_for_soon(void **state)
{
	struct fixture *f = make(1);
	const char *said = begin(f, 0, DB_JOB_IDENTIFY);

	(void)state;
	while (said[0] != '=')
		said = is_lacking(said) ? lost(f) : obey(f);
	for (unsigned i = 0; i < 36000; i++) {
		for (said = begin(f, 0, DB_JOB_POLL); said[0] != '=';)
			said = is_lacking(said) ? lost(f) : obey(f);
		f->now += 100 * MS;
	}
	db_driver_xyza.gone(f->axes[0]);
	said = begin(f, 0, DB_JOB_IDENTIFY);
	while (said[0] != '=')
		said = is_lacking(said) || strcmp(said, "0AF10103E5C9") == 0 ? lost(f) : obey(f);
	for (unsigned i = 0; i < 450; i++) {
		for (said = begin(f, 0, DB_JOB_POLL); said[0] != '=';)
			said = is_lacking(said) ? lost(f) : obey(f);
		f->now += 100 * MS;
	}
	assert_true(plate(f, 0)->valid[0] >> XYZA_PULSE_MODE & 1);
	drop(f);
}

/* Each time is a lost answer, for which all axes wait. */
static void what_a_controller_lacks_is_asked_for_seldom(void **state)
{
	struct fixture *f = make(3);
	unsigned asked = 0;

	(void)state;
	identify_without(f, 0, "0AF10103E2A1");
	identify(f, 1);
	for (unsigned i = 0; i < 36000; i++) {
		const char *said = begin(f, 0, DB_JOB_POLL);

		while (said[0] != '=' && strcmp(said, "0AF10103E2A1") != 0)
			said = obey(f);
		asked += said[0] != '=';
		assert_false(plate(f, 0)->doubtful);
		f->now += 100 * MS;
	}
	assert_in_range(asked, 4, 10);
	drop(f);
}

/* The way that it needs for stopping is looked up before it begins to move. */
static void a_jog_with_limits_looks_at_its_brakes(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	f->drives[0].max_position = 100.0;
	db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
	identify(f, 0);
	assert_true(isinf(feedback(f, 0).deceleration));
	*memory(f, 0xE2, 0xA2) = 1000;
	identify(f, 0);
	*memory(f, 0xE5, 0xC3) = 1;
	*memory(f, 0xE2, 0xA3) = 20;
	assert_string_equal(whole(f, jog(f, 0)),
	                    "0AF10103E5C3 0AF10103E2A3 0AF3010303A1 0AF10103E1A3 =ok");
	assert_float_equal(feedback(f, 0).deceleration, 500.0f, 0.01f);
	drop(f);
}

static void one_key_is_changed_and_the_others_kept(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	assert_string_equal(set(f, 0, XYZA_STOP_KEY, 5), "0AF10103E5C2");
	assert_string_equal(value(f, 0x080706), "0BF10103E5C206050800");
	assert_string_equal(answer(f, OK_DATA), "0AF10103E5C2");
	assert_string_equal(value(f, 0x080506), "=ok");
	assert_int_equal(plate(f, 1)->values[XYZA_STOP_KEY].u, 5);
	assert_int_equal(plate(f, 1)->values[XYZA_START_KEY].u, 6);
	/* Not written, not known. */
	set(f, 0, XYZA_START_KEY, 1);
	value(f, 0x080506);
	assert_string_equal(refuse(f, FAILED_DATA), "=refused");
	assert_int_equal(plate(f, 0)->values[XYZA_START_KEY].u, 6);
	assert_true(plate(f, 0)->doubtful);
	drop(f);
}

static void enabling_an_axis_leaves_the_others(void **state)
{
	struct fixture *f = make(0xF);

	(void)state;
	*memory(f, 0xE5, 0xC1) = 0x9;
	whole(f, command(f, 1, DB_CMD_ENABLE, (struct db_args){ 0 }));
	assert_int_equal(*memory(f, 0xE5, 0xC1), 0xB);
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++)
		assert_int_equal(plate(f, axis)->values[XYZA_ENABLE].u, 0xB);
	command(f, 3, DB_CMD_DISABLE, (struct db_args){ 0 });
	assert_string_equal(value(f, 1), "0AF10103E5C1");
	assert_string_equal(value(f, 0xB), "0BF10103E5C103000000");
	/* Refused: all is as it was. */
	assert_string_equal(refuse(f, FAILED_DATA), "=refused");
	assert_int_equal(plate(f, 3)->values[XYZA_ENABLE].u, 0xB);
	drop(f);
}

/* The document does not know all bits and keys that controllers have: they go back as they came. */
static void what_is_not_changed_need_not_be_in_range(void **state)
{
	struct fixture *f = make(0xF);

	(void)state;
	*memory(f, 0xE5, 0xC1) = 0x01000011;
	assert_string_equal(whole(f, command(f, 1, DB_CMD_ENABLE, (struct db_args){ 0 })),
	                    "0AF10103E5C1 0BF10103E5C113000001 0AF10103E5C1 =ok");
	assert_string_equal(whole(f, command(f, 0, DB_CMD_DISABLE, (struct db_args){ 0 })),
	                    "0AF10103E1A3 0AF10103E5C1 0BF10103E5C112000001 0AF10103E5C1 =ok");
	*memory(f, 0xE5, 0xC2) = 0x050706;
	assert_string_equal(whole(f, set(f, 0, XYZA_START_KEY, 1)),
	                    "0AF10103E5C2 0BF10103E5C201070500 0AF10103E5C2 =ok");
	assert_int_equal(plate(f, 0)->values[XYZA_PAUSE_KEY].u, 5);
	/* What is written is. */
	assert_int_equal(
		db_driver_xyza.check_param(&f->bus, XYZA_PAUSE_KEY, (union db_value){ .u = 5 }),
		DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(
		db_driver_xyza.check_param(&f->bus, XYZA_ENABLE, (union db_value){ .u = 0x11 }),
		DB_RESULT_OUT_OF_RANGE);
	drop(f);
}

static void what_an_axis_has_alone_stays_its_own(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	assert_string_equal(set(f, 1, XYZA_LEAD, 2000), "0AF10103E3B3");
	assert_string_equal(value(f, 5000), "0BF10103E3B3D0070000");
	assert_string_equal(answer(f, OK_DATA), "0AF10103E3B3");
	assert_string_equal(value(f, 2000), "=ok");
	assert_int_equal(plate(f, 1)->values[XYZA_LEAD].u, 2000);
	assert_false(plate(f, 0)->valid[0] >> XYZA_LEAD & 1);
	/* A speed that was given with a motion is the parameter from now on. */
	whole(f,
	      command(f, 1, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = -70.0f }));
	assert_int_equal(plate(f, 1)->values[XYZA_MANUAL_SPEED].u, 70);
	drop(f);
}

/* What it has made of it instead is shown, and is no success. */
static void what_is_read_back_counts(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	set(f, 0, XYZA_MANUAL_SPEED, 50000);
	value(f, 900);
	answer(f, OK_DATA);
	assert_string_equal(value(f, 20000), "=refused");
	assert_int_equal(plate(f, 0)->values[XYZA_MANUAL_SPEED].u, 20000);
	drop(f);
}

static void what_is_so_already_is_not_written(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	set(f, 0, XYZA_BRAKE, 5);
	assert_string_equal(value(f, 5), "=ok");
	set(f, 0, XYZA_PAUSE_KEY, 8);
	assert_string_equal(value(f, 0x080706), "=ok");
	drop(f);
}

/* Several at once: one after the other. */
static void several_parameters_are_written(void **state)
{
	struct fixture *f = make(1);
	const struct db_setting settings[] = {
		{ .param = XYZA_MIN_SPEED, .value.u = 1 },
		{ .param = XYZA_MAX_SPEED, .value.u = 2 },
		{ .param = XYZA_BRAKE, .value.u = 3 },
	};

	(void)state;
	f->request = (struct db_request){ .setting_count = 3, .settings = settings };
	assert_string_equal(whole(f, begin(f, 0, DB_JOB_SETTINGS)),
	                    "0AF10103E2A1 0BF10103E2A101000000 0AF10103E2A1 "
	                    "0AF10103E2A2 0BF10103E2A202000000 0AF10103E2A2 "
	                    "0AF10103E5C3 0BF10103E5C303000000 0AF10103E5C3 =ok");
	drop(f);
}

/* Nobody who may only read is to read them. */
/* The last frame that was sent, in words of a trace. */
static struct db_description described(const struct fixture *f)
{
	struct db_description description;

	db_description_begin(&description);
	db_driver_xyza.describe(&f->bus, true, f->bytes, f->exchange.request_length, &description);
	return description;
}

static void a_trace_says_what_is_asked(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	(void)begin(f, 0, DB_JOB_POLL);
	assert_int_equal(described(f).address, OBJECT);
	assert_int_equal(described(f).axis, XYZA_X);
	assert_false(described(f).secret);
	assert_true(described(f).length > 0);
	drop(f);
}

static void passwords_are_not_shown(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	set(f, 0, XYZA_PASSWORD, 1234);
	value(f, 99);
	assert_true(described(f).secret);
	answer(f, OK_DATA);
	assert_string_equal(value(f, 1234), "=ok");
	assert_true(plate(f, 0)->valid[0] >> XYZA_PASSWORD & 1);
	assert_int_equal(plate(f, 0)->values[XYZA_PASSWORD].u, 0);
	drop(f);
}

/* Silence about one item hides no other; it can be written, but nothing shows that. */
static void what_is_never_answered_is_left_out(void **state)
{
	struct fixture *f = make(1);
	const char *said = begin(f, 0, DB_JOB_IDENTIFY);
	unsigned asked = 0;

	(void)state;
	while (said[0] != '=') {
		bool silent = strcmp(said, "0AF10103E5C5") == 0;

		asked += silent;
		said = silent ? lost(f) : value(f, 1);
	}
	assert_string_equal(said, "=ok");
	assert_int_equal(asked, 2);
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STANDSTILL);
	assert_true(feedback(f, 0).status & DB_STATUS_PARAMS_VALID);
	assert_true(plate(f, 0)->missing[0] == UINT64_C(1) << XYZA_READ_PASSWORD);
	assert_string_equal(set(f, 0, XYZA_READ_PASSWORD, 5), "0BF10103E5C505000000");
	assert_string_equal(answer(f, OK_DATA), "=unproven");
	/* Another controller may come back. */
	db_driver_xyza.gone(f->axes[0]);
	assert_string_equal(set(f, 0, XYZA_READ_PASSWORD, 5), "0AF10103E5C5");
	drop(f);
}

static const char *set_ramp(struct fixture *f, unsigned axis, enum xyza_param param, float ramp)
{
	f->setting = (struct db_setting){ .param = (uint16_t)param, .value.f = ramp };
	f->request = (struct db_request){ .setting_count = 1, .settings = &f->setting };
	return begin(f, axis, DB_JOB_SETTINGS);
}

/* From 200 to 3200 Hz in half a second are 6000 Hz/s. */
static void the_ramp_follows_from_speeds_and_time(void **state)
{
	struct fixture *f = make(3);
	const struct db_nameplate *y = plate(f, 1);

	(void)state;
	*memory(f, 0xE2, 0xB1) = 200;
	*memory(f, 0xE2, 0xB2) = 3200;
	*memory(f, 0xE2, 0xB3) = 5;
	*memory(f, 0xE5, 0xC3) = 1; /* X brakes, Y does not */
	assert_false(y->valid[0] >> XYZA_RAMP_ACCELERATION & 1);
	whole(f, begin(f, 1, DB_JOB_IDENTIFY));
	assert_true(y->valid[0] >> XYZA_RAMP_ACCELERATION & 1);
	assert_true(y->values[XYZA_RAMP_ACCELERATION].f == 6000.0f);
	assert_true(y->valid[0] >> XYZA_RAMP_DECELERATION & 1);
	assert_true(y->values[XYZA_RAMP_DECELERATION].f == 0.0f);
	assert_true(isinf(feedback(f, 1).deceleration));
	assert_false(plate(f, 0)->valid[0] >> XYZA_RAMP_DECELERATION & 1);
	/* Whoever writes one of them changes it. */
	whole(f, set(f, 0, XYZA_BRAKE, 3));
	assert_true(y->values[XYZA_RAMP_DECELERATION].f == 6000.0f);
	assert_true(feedback(f, 1).deceleration == 6000.0f);
	whole(f, set(f, 1, XYZA_MAX_SPEED, 1200));
	assert_true(y->values[XYZA_RAMP_ACCELERATION].f == 2000.0f);
	whole(f, set(f, 1, XYZA_ACCELERATION_TIME, 0));
	assert_true(y->values[XYZA_RAMP_ACCELERATION].f == 0.0f);
	assert_true(isinf(feedback(f, 1).deceleration));
	drop(f);
}

static void a_ramp_is_written_as_its_time(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	*memory(f, 0xE2, 0xA1) = 200;
	*memory(f, 0xE2, 0xA2) = 3200;
	*memory(f, 0xE2, 0xA3) = 5;
	*memory(f, 0xE5, 0xC3) = 1;
	assert_string_equal(whole(f, set_ramp(f, 0, XYZA_RAMP_ACCELERATION, 1000.0f)),
	                    "0AF10103E2A1 0AF10103E2A2 "
	                    "0AF10103E2A3 0BF10103E2A31E000000 0AF10103E2A3 =ok");
	assert_true(plate(f, 0)->values[XYZA_RAMP_ACCELERATION].f == 1000.0f);
	/* What can be said is a multiple of 0.1 s. */
	whole(f, set_ramp(f, 0, XYZA_RAMP_DECELERATION, 8000.0f));
	assert_int_equal(*memory(f, 0xE2, 0xA3), 4);
	assert_true(plate(f, 0)->values[XYZA_RAMP_DECELERATION].f == 7500.0f);
	assert_true(plate(f, 0)->values[XYZA_RAMP_ACCELERATION].f == 7500.0f);
	whole(f, set_ramp(f, 0, XYZA_RAMP_ACCELERATION, 70000.0f));
	assert_int_equal(f->talk.result, DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(*memory(f, 0xE2, 0xA3), 4);
	/* Without brakes there is nothing to slow down with. */
	*memory(f, 0xE5, 0xC3) = 2;
	assert_string_equal(whole(f, set_ramp(f, 0, XYZA_RAMP_DECELERATION, 1000.0f)),
	                    "0AF10103E2A1 0AF10103E2A2 0AF10103E5C3 =refused");
	*memory(f, 0xE2, 0xA2) = 100;
	whole(f, set_ramp(f, 0, XYZA_RAMP_ACCELERATION, 1000.0f));
	assert_int_equal(f->talk.result, DB_RESULT_OUT_OF_RANGE);
	/* From speeds that are not told no time follows. */
	set_ramp(f, 0, XYZA_RAMP_ACCELERATION, 1000.0f);
	assert_string_equal(refuse(f, FAILED_DATA), "=refused");
	assert_int_equal(db_driver_xyza.check_param(&f->bus, XYZA_RAMP_ACCELERATION,
	                                            (union db_value){ .f = 0.0f }),
	                 DB_RESULT_OUT_OF_RANGE);
	drop(f);
}

/* What was read once and is not told any more counts for nothing. */
static void what_is_not_told_any_more_is_not_shown(void **state)
{
	static const char *const of_scale[] = { "0AF10103E3A1", "0AF10103E3A2", "0AF10103E3A3" };
	static const char *const of_ramp[] = { "0AF10103E2A1", "0AF10103E2A2", "0AF10103E2A3",
		                               "0AF10103E5C3" };
	struct fixture *f = make(1);

	(void)state;
	*memory(f, 0xE2, 0xA1) = 200;
	*memory(f, 0xE2, 0xA2) = 3200;
	*memory(f, 0xE2, 0xA3) = 5;
	*memory(f, 0xE3, 0xA1) = 200;
	*memory(f, 0xE3, 0xA2) = 16;
	*memory(f, 0xE3, 0xA3) = 5000;
	*memory(f, 0xE5, 0xC1) = *memory(f, 0xE5, 0xC3) = 1;
	poll_all(f, true, 0, 0);
	for (size_t i = 0; i < 3; i++) {
		identify(f, 0);
		assert_float_equal(feedback(f, 0).counts_per_unit, 640.0f, 0.001f);
		identify_without(f, 0, of_scale[i]);
		assert_float_equal(feedback(f, 0).counts_per_unit, 0.0f, 0.0f);
		assert_float_equal(feedback(f, 0).deceleration, 6000.0f, 0.0f);
	}
	for (size_t i = 0; i < 4; i++) {
		uint32_t generation;

		identify(f, 0);
		generation = plate(f, 0)->generation;
		assert_float_equal(feedback(f, 0).deceleration, 6000.0f, 0.0f);
		identify_without(f, 0, of_ramp[i]);
		assert_float_equal(feedback(f, 0).deceleration, 0.0f, 0.0f);
		assert_int_equal(plate(f, 0)->generation, generation + 1 + (i < 3 ? 2 : 1));
		for (unsigned ramp = 0; ramp < 2; ramp++) {
			uint64_t bit = UINT64_C(1)
			               << (ramp ? XYZA_RAMP_DECELERATION : XYZA_RAMP_ACCELERATION);

			/* Without brakes it accelerates all the same. */
			assert_true(!(plate(f, 0)->missing[0] & bit) == (i == 3 && !ramp));
			assert_true(!(plate(f, 0)->valid[0] & bit) == !(i == 3 && !ramp));
		}
	}
	identify(f, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STANDSTILL);
	identify_without(f, 0, "0AF10103E5C1");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	/* No spindle has a lead of 0. */
	*memory(f, 0xE3, 0xA3) = 0;
	identify(f, 0);
	assert_true(feedback(f, 0).counts_per_unit == 0.0f);
	drop(f);
}

/* A value counts as changed when it is another one, and a ramp with what it is computed from. */
static void what_is_read_again_unchanged_is_no_change(void **state)
{
	struct fixture *f = make(1);
	uint32_t generation;

	(void)state;
	*memory(f, 0xE2, 0xA1) = 200;
	*memory(f, 0xE2, 0xA2) = 3200;
	*memory(f, 0xE2, 0xA3) = 5;
	*memory(f, 0xE5, 0xC3) = 1;
	identify(f, 0);
	generation = plate(f, 0)->generation;
	identify(f, 0);
	assert_int_equal(plate(f, 0)->generation, generation + 1); /* that all was read */
	*memory(f, 0xE3, 0xA3) = 7;
	identify(f, 0);
	assert_int_equal(plate(f, 0)->generation, generation + 3);
	/* Both ramps as well. */
	*memory(f, 0xE2, 0xA3) = 6;
	identify(f, 0);
	assert_int_equal(plate(f, 0)->generation, generation + 7);
	drop(f);
}

static void read_value(struct fixture *f, enum xyza_item item, db_time now)
{
	xyza_learn_item(f->axes[0], item, 1, now);
}

static uint32_t told(struct fixture *f, enum xyza_param param)
{
	return plate(f, 0)->told[param];
}

/* A ramp is as old as the oldest value that it is computed from. */
static void a_ramp_is_as_old_as_its_values(void **state)
{
	static const enum xyza_item items[] = { XYZA_ITEM_MIN_SPEED, XYZA_ITEM_MAX_SPEED,
		                                XYZA_ITEM_ACCELERATION_TIME };
	static const enum xyza_param params[] = { XYZA_MIN_SPEED, XYZA_MAX_SPEED,
		                                  XYZA_ACCELERATION_TIME };

	(void)state;
	for (unsigned first = 0; first < 3; first++) {
		struct fixture *f = make(1);

		for (unsigned i = 0; i < 3; i++) {
			unsigned next = (first + i) % 3;

			assert_int_equal(told(f, XYZA_RAMP_ACCELERATION), 0);
			/* The first is read when the clock begins. */
			read_value(f, items[next], 1000 * MS * i);
			assert_int_equal(told(f, params[next]), db_told_at(1000 * MS * i));
		}
		assert_int_equal(told(f, XYZA_RAMP_ACCELERATION), db_told_at(0));
		assert_int_equal(told(f, XYZA_RAMP_DECELERATION), 0);
		read_value(f, XYZA_ITEM_BRAKE, 500 * MS);
		assert_int_equal(told(f, XYZA_RAMP_DECELERATION), db_told_at(0));
		read_value(f, items[first], 3000 * MS);
		assert_int_equal(told(f, XYZA_RAMP_ACCELERATION), db_told_at(1000 * MS));
		assert_int_equal(told(f, XYZA_RAMP_DECELERATION), db_told_at(500 * MS));
		read_value(f, XYZA_ITEM_BRAKE, 4000 * MS);
		assert_int_equal(told(f, XYZA_RAMP_DECELERATION), db_told_at(1000 * MS));
		assert_true(plate(f, 0)->valid[0] >> XYZA_RAMP_DECELERATION & 1);
		xyza_forget_item(f->axes[0], XYZA_ITEM_BRAKE);
		assert_false(plate(f, 0)->valid[0] >> XYZA_RAMP_DECELERATION & 1);
		assert_true(plate(f, 0)->valid[0] >> XYZA_RAMP_ACCELERATION & 1);
		drop(f);
	}
}

/* It stands when that was read, whatever a program may have begun before. */
static void a_refused_jog_shows_a_stand(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	f->program_state = 1;
	poll_all(f, true, 0, 1);
	whole(f, command(f, 0, DB_CMD_END_PROGRAM, (struct db_args){ 0 }));
	jog(f, 0);
	for (unsigned i = 0; i < 2; i++) {
		answer(f, FAILED_MANUAL);
		value(f, 1);
	}
	assert_string_equal(f->said, "=refused");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	poll_all(f, true, 3, 0);
	assert_float_equal(feedback(f, 0).velocity, 0.0f, 0.0f);
	drop(f);
}

/* Exactly the bits of what it does. */
static void a_status_says_what_an_axis_does(void **state)
{
	struct fixture *f = make(1);
	const uint32_t valid = DB_STATUS_PARAMS_VALID;
	db_time began = f->now;

	(void)state;
	assert_int_equal(feedback(f, 0).status, 0);
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 0).status, 0);
	assert_int_equal(feedback(f, 0).taken, began + 3 * MS);
	*memory(f, 0xE5, 0xC1) = 1;
	identify(f, 0);
	assert_int_equal(feedback(f, 0).status, DB_STATUS_ENABLED | valid);
	poll_all(f, false, 0, 0);
	assert_int_equal(feedback(f, 0).status, DB_STATUS_ENABLED | valid | DB_STATUS_MOVING);
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	answer(f, OK_PROGRAM);
	assert_int_equal(feedback(f, 0).status,
	                 DB_STATUS_ENABLED | valid | DB_STATUS_MOVING | DB_STATUS_STOPPING);
	poll_all(f, true, 0, XYZA_PROGRAM_INTERRUPTED);
	assert_int_equal(feedback(f, 0).status, DB_STATUS_ENABLED | valid | DB_STATUS_ERROR);
	/* A program that goes on may have started it. */
	poll_all(f, true, 0, 1);
	command(f, 0, DB_CMD_STOP, (struct db_args){ 0 });
	answer(f, OK_PROGRAM);
	answer(f, OK_MANUAL);
	assert_int_equal(feedback(f, 0).status,
	                 DB_STATUS_ENABLED | valid | DB_STATUS_MOVING | DB_STATUS_STOPPING);
	drop(f);
}

/* It was away, and stands where counters begin: it has restarted. A position that is set, or
 * clear_fault, ends what follows from that. */
static void one_that_comes_back_at_0_has_restarted(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	identify_without(f, 0, "0AF10103E2A1");
	poll_all(f, true, 5000, 0);
	assert_true(plate(f, 0)->missing[0] != 0);
	db_driver_xyza.gone(f->axes[0]);
	assert_true(plate(f, 0)->missing[0] == 0);
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 0).restarts, 1);
	assert_true(feedback(f, 0).status & DB_STATUS_ORIGIN_LOST);
	whole(f, command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = -70 }));
	assert_false(feedback(f, 0).status & DB_STATUS_ORIGIN_LOST);
	assert_int_equal(feedback(f, 0).drive_status & 1, 1);
	whole(f, command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 0 }));
	assert_int_equal(feedback(f, 0).drive_status & 1, 0);
	whole(f, command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 70 }));
	assert_int_equal(feedback(f, 0).drive_status & 1, 0);
	/* What is read from now on is shown. */
	poll_all(f, true, 72, 0);
	assert_int_equal(feedback(f, 0).position, 72);
	/* Without its having been away it is a doubt. */
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 0).doubt, DB_DOUBT_SIGN);
	whole(f, command(f, 0, DB_CMD_CLEAR_FAULT, (struct db_args){ 0 }));
	assert_int_equal(feedback(f, 0).doubt, DB_DOUBT_NONE);
	drop(f);
}

/* A lost read leaves open what became of a write before it, and of nothing else. */
static void a_lost_read_tells_what_was_done_before(void **state)
{
	struct fixture *f = make(1);
	const struct db_args args = { .target_position = 9 };

	(void)state;
	command(f, 0, DB_CMD_SET_POSITION, args);
	assert_string_equal(lost(f), "=timeout");
	command(f, 0, DB_CMD_SET_POSITION, args);
	value(f, 1);
	answer(f, OK_DATA);
	assert_string_equal(answer(f, OK_DATA), "0AF10103E1A2");
	assert_string_equal(lost(f), "=indeterminate");
	/* Behind a single write nothing is read, though a jog before it had a read there. */
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 0), "=ok");
	command(f, 0, DB_CMD_SINGLE_STEP, (struct db_args){ 0 });
	assert_string_equal(lost(f), "=timeout");
	drop(f);
}

/* Each value has its own time to show. */
static void each_effect_may_take_its_time(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = -9 });
	value(f, 1);
	answer(f, OK_DATA);
	answer(f, OK_DATA);
	for (unsigned i = 0; i < 2; i++) {
		assert_string_equal(value(f, 0), i == 0 ? "0AF10103E1A2" : "0AF10103E1A1");
		f->now += 60 * MS;
		assert_string_equal(value(f, 0), i == 0 ? "0AF10103E1A2" : "0AF10103E1A1");
		value(f, i == 0 ? 1 : 9);
	}
	assert_string_equal(f->said, "=ok");
	drop(f);
}

/* Even the shortest delay is one. */
static void a_delay_of_1_is_cleared_too(void **state)
{
	struct fixture *f = make(1);
	const struct db_args later = { .program_number = 4, .program_delay = 1 };
	const struct db_args now = { .program_number = 4 };

	(void)state;
	assert_string_equal(whole(f, command(f, 0, DB_CMD_START_PROGRAM, later)),
	                    ASK_PROGRAM " 0AF401030501 0AF401030304 " ASK_PROGRAM " =ok");
	f->program_state = 0;
	assert_string_equal(whole(f, command(f, 0, DB_CMD_START_PROGRAM, now)),
	                    ASK_PROGRAM " 0AF401030500 0AF401030304 " ASK_PROGRAM " =ok");
	f->program_state = 0;
	assert_string_equal(whole(f, command(f, 0, DB_CMD_START_PROGRAM, now)),
	                    ASK_PROGRAM " 0AF401030304 " ASK_PROGRAM " =ok");
	/* Until it is over nothing shows. */
	f->program_state = 0;
	f->ignores = "0AF4010303";
	assert_string_equal(strchr(whole(f, command(f, 0, DB_CMD_START_PROGRAM, later)), '='),
	                    "=unproven");
	drop(f);
}

/* Two axes at 0 all of a sudden: that is the controller, and all that is known of it is read again. */
static void two_axes_at_0_are_a_restart(void **state)
{
	(void)state;
	for (unsigned both = 0; both < 2; both++) {
		struct fixture *f = make(0xF);

		*memory(f, 0xE1, 0xA1) = 5000;
		*memory(f, 0xE1, 0xD1) = 4000;
		for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++)
			identify(f, axis);
		whole(f, begin(f, 0, DB_JOB_POLL));
		*memory(f, 0xE1, 0xA1) = 0;
		*memory(f, 0xE1, 0xD1) = both ? 0 : 4000;
		whole(f, begin(f, 0, DB_JOB_POLL));
		assert_int_equal(feedback(f, 0).restarts, both);
		assert_int_equal(feedback(f, 0).doubts, 1);
		assert_int_equal(feedback(f, 3).restarts, both);
		assert_int_equal(feedback(f, 3).doubts, both);
		for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
			assert_true(plate(f, axis)->doubtful == both);
			assert_true(!(feedback(f, axis).status & DB_STATUS_ORIGIN_LOST) ==
			            !(both && axis % 3 == 0));
		}
		drop(f);
	}
}

/* Ports that are not told any more are shown as low, and settings whose answer was lost are read again. */
static void what_was_lost_is_not_believed(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_up_to(f, ASK_PORTS);
	value(f, 0x00030001);
	program(f, 0, 0, 0);
	assert_int_equal(feedback(f, 0).outputs, 3);
	for (unsigned i = 0; i < 2; i++) {
		poll_up_to(f, ASK_PORTS);
		assert_int_equal(feedback(f, 0).outputs, 3);
	}
	poll_up_to(f, ASK_PORTS);
	assert_int_equal(feedback(f, 0).outputs, 0);
	assert_int_equal(feedback(f, 0).inputs, 0);
	identify(f, 0);
	assert_false(plate(f, 0)->doubtful);
	command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = 9 });
	assert_string_equal(lost(f), "=timeout");
	assert_false(plate(f, 0)->doubtful);
	set(f, 0, XYZA_MANUAL_SPEED, 5);
	lost(f);
	assert_true(plate(f, 0)->doubtful);
	drop(f);
}

static void dangerous_parameters_are_locked(void **state)
{
	static const enum xyza_param locked[] = { XYZA_FACTORY_RESET, XYZA_SLAVE_NUMBER,
		                                  XYZA_SYSTEM_INFO };
	struct fixture *f = make(3);
	union db_value one = { .u = 1 };

	(void)state;
	for (size_t i = 0; i < sizeof locked / sizeof locked[0]; i++) {
		set_option(f, "unlock-system", 0);
		assert_int_equal(db_driver_xyza.check_param(&f->bus, locked[i], one),
		                 DB_RESULT_UNSUPPORTED);
		set_option(f, "unlock-system", 1);
		assert_int_equal(db_driver_xyza.check_param(&f->bus, locked[i], one), DB_RESULT_OK);
	}
	assert_int_equal(db_driver_xyza.check_param(&f->bus, XYZA_BRAKE, (union db_value){ 16 }),
	                 DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(db_driver_xyza.check_param(&f->bus, XYZA_SHOWN_COUNT, one),
	                 DB_RESULT_UNSUPPORTED);
	/* They are not read before they are written. */
	assert_string_equal(set(f, 0, XYZA_SLAVE_NUMBER, 6), "0BF10103E5CB06000000");
	assert_int_equal(f->exchange.also_from, 6);
	assert_string_equal(answer(f, OK_DATA), "=unproven");
	/* It may go by the new number at once. */
	assert_string_equal(set(f, 0, XYZA_SLAVE_NUMBER, 6), "0BF10103E5CB06000000");
	assert_string_equal(answer(f, "0CAA000700F1"), "ignored");
	assert_string_equal(answer(f, "0CAA000600F1"), "=unproven");
	begin(f, 0, DB_JOB_POLL);
	assert_int_equal(f->exchange.also_from, 0);
	assert_string_equal(set(f, 0, XYZA_FACTORY_RESET, 1), "0BF10103E5CA00000000");
	assert_false(plate(f, 1)->doubtful);
	assert_string_equal(answer(f, OK_DATA), "=unproven");
	assert_true(plate(f, 0)->doubtful && plate(f, 1)->doubtful);
	drop(f);
}

/* --- what is left of the one before ------------------------------------------------------------------ */

/* The buffer is the bus's: what an exchange before it was like is none of this one's business. */
static void an_exchange_inherits_nothing(void **state)
{
	const struct db_exchange before = {
		.answer_length = 99, .extra_time = 7000 * MS, .repeatable = true, .also_from = 9
	};
	struct fixture *f = make(1);
	const uint8_t *bytes = f->bytes;

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		static const size_t lengths[] = { XYZA_DATA_FRAME, XYZA_COMMAND_FRAME,
			                          XYZA_FRAME_MAX, XYZA_COMMAND_FRAME };

		f->exchange = before;
		f->exchange.request = f->bytes;
		f->exchange.request_size = sizeof f->bytes;
		if (i == 0)
			begin(f, 0, DB_JOB_POLL);
		else if (i == 1)
			jog(f, 0);
		else if (i == 2)
			command(f, 0, DB_CMD_RAW_FRAME, raw("0AF10100E1A1"));
		else
			begin(f, 0, DB_JOB_PROBE);
		assert_ptr_equal(f->exchange.request, bytes);
		assert_int_equal(f->exchange.answer_length, lengths[i]);
		assert_int_equal(f->exchange.extra_time, 0);
		assert_true(f->exchange.repeatable == (i == 0 || i == 3));
		assert_int_equal(f->exchange.also_from, 0);
	}
	/* A number that is written is an address only where it is one. */
	set(f, 0, XYZA_MANUAL_SPEED, 6);
	value(f, 5);
	assert_string_equal(f->said, "0BF10103E2A406000000");
	assert_int_equal(f->exchange.also_from, 0);
	drop(f);
}

/* Word by word, the first byte above; beyond its end nothing is shown. */
static void show_raw(const struct fixture *f, const char *hex)
{
	const struct db_nameplate *shown = plate(f, 0);
	uint16_t words[sizeof shown->raw_answer / sizeof shown->raw_answer[0]] = { 0 };
	uint8_t frame[XYZA_FRAME_MAX];
	size_t length = hex ? compose(hex, frame) : 0;

	for (size_t i = 0; i < length; i++)
		words[i / 2] = (uint16_t)(i % 2 == 0 ? frame[i] << 8 : words[i / 2] | frame[i]);
	assert_int_equal(shown->raw_length, length);
	assert_memory_equal(shown->raw_answer, words, sizeof words);
}

/* Whoever waits for the answer sees that it is another one, and never two of them in one. */
static void a_raw_answer_is_shown_alone(void **state)
{
	static const char *const said[] = { "0AF10100E1A1", "0AF301000101", "0AF10100E1A1" };
	static const char *const answers[] = { "0BF10003E1A1FFFEFDFC", FAILED_MANUAL,
		                               "0BF10003E1A101020304" };
	struct fixture *f = make(1);
	uint32_t generation = plate(f, 0)->generation;

	(void)state;
	for (size_t i = 0; i < sizeof said / sizeof said[0]; i++) {
		command(f, 0, DB_CMD_RAW_FRAME, raw(said[i]));
		show_raw(f, NULL);
		assert_int_equal(plate(f, 0)->generation, ++generation);
		answer(f, answers[i]);
		show_raw(f, answers[i]);
		assert_int_equal(plate(f, 0)->generation, ++generation);
		assert_true(!(feedback(f, 0).status & DB_STATUS_REFUSED) == (i != 1));
	}
	drop(f);
}

/* --- how a command is put together ------------------------------------------------------------------- */

/* Exactly what had no effect is written again: not the question whether the axis stands. */
static void what_is_written_again_is_the_write(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	*memory(f, 0xE1, 0xA1) = 77;
	f->ignores = "0AF3010304";
	assert_string_equal(whole(f, command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ 0 })),
	                    "0AF10103E1A3 0AF3010304A1 0AF10103E1A1 0AF3010304A1 0AF10103E1A1"
	                    " 0AF3010304A1 0AF10103E1A1 =failed");
	f->ignores = "0BF10103E1A1";
	assert_string_equal(
		whole(f, command(f, 0, DB_CMD_SET_POSITION,
	                         (struct db_args){ .target_position = 50 })),
		"0AF10103E1A3"
		" 0BF10103E1A132000000 0BF10103E1A200000000 0AF10103E1A2 0AF10103E1A1"
		" 0BF10103E1A132000000 0BF10103E1A200000000 0AF10103E1A2 0AF10103E1A1"
		" 0BF10103E1A132000000 0BF10103E1A200000000 0AF10103E1A2 0AF10103E1A1 =failed");
	drop(f);
}

/* One that the program moves is stopped with it, before its power goes. */
static void disabling_what_a_program_moves_stops_the_program(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	*memory(f, 0xE5, 0xC1) = 1;
	*memory(f, 0xE1, 0xA3) = 0;
	poll_all(f, false, 0, XYZA_PROGRAM_RUNNING);
	assert_string_equal(
		whole(f, command(f, 0, DB_CMD_DISABLE, (struct db_args){ 0 })),
		"0AF10103E1A3 0AF401030200 0AF10103E5C1 0BF10103E5C100000000 0AF10103E5C1 =ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_STOPPING);
	drop(f);
}

/* What others share an item with is not overwritten by somebody who has never read it. */
static void a_shared_item_is_read_though_it_was_silent(void **state)
{
	static const char *const silent[] = { "0AF10103E5C1", "0AF10103E5C2" };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct fixture *f = make(3);

		identify_without(f, 0, silent[i]);
		assert_string_equal(i == 0 ? command(f, 0, DB_CMD_ENABLE, (struct db_args){ 0 }) :
		                             set(f, 0, XYZA_STOP_KEY, 5),
		                    silent[i]);
		drop(f);
	}
}

/* It is in the controller from then on, whatever became of the start itself. */
static void a_delay_whose_start_was_lost_is_cleared(void **state)
{
	const struct db_args later = { .program_number = 4, .program_delay = 1 };
	const struct db_args now = { .program_number = 4 };
	struct fixture *f = make(1);

	(void)state;
	whole(f, command(f, 0, DB_CMD_START_PROGRAM, now));
	f->program_state = 0;
	assert_string_equal(whole(f, command(f, 0, DB_CMD_START_PROGRAM, now)),
	                    ASK_PROGRAM " 0AF401030304 " ASK_PROGRAM " =ok");
	command(f, 0, DB_CMD_START_PROGRAM, later);
	assert_string_equal(program(f, 0, 4, 1), "0AF401030501");
	assert_string_equal(answer(f, OK_PROGRAM), "0AF401030304");
	assert_string_equal(lost(f), ASK_PROGRAM);
	assert_string_equal(program(f, 0, 4, 1), "=indeterminate");
	command(f, 0, DB_CMD_START_PROGRAM, now);
	assert_string_equal(program(f, 0, 4, 1), "0AF401030500");
	drop(f);
}

/* Whoever moves any other axis, and it need not be a jog, is asked before this one begins. */
static void any_other_axis_that_moves_is_asked(void **state)
{
	struct fixture *f = make(0xF);

	(void)state;
	poll_all(f, true, 0, 0);
	whole(f, jog(f, 3));
	assert_string_equal(jog(f, 0), "0AF10103E1D3");
	assert_string_equal(value(f, 0), "=refused");
	drop(f);
	f = make(3);
	poll_all(f, false, 0, 0);
	assert_string_equal(jog(f, 1), "0AF10103E1A3");
	assert_string_equal(value(f, 0), "=refused");
	drop(f);
}

/* Whether an item is silent is a question of this item, and not of its neighbour. */
static void a_jog_with_limits_does_not_ask_what_is_silent(void **state)
{
	static const struct {
		const char *silent;
		const char *said;
	} cases[] = {
		{ "0AF10103E2A3", "0AF10103E5C3 0AF3010303A1 0AF10103E1A3 =ok" },
		{ "0AF10103E2A4", "0AF10103E5C3 0AF10103E2A3 0AF3010303A1 0AF10103E1A3 =ok" },
		{ "0AF10103E5C3", "0AF10103E2A3 0AF3010303A1 0AF10103E1A3 =ok" },
		{ "0AF10103E5C4", "0AF10103E5C3 0AF10103E2A3 0AF3010303A1 0AF10103E1A3 =ok" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture *f = make(1);

		f->drives[0].max_position = 100.0;
		db_driver_xyza.init(f->axes[0], NULL, &f->bus, &f->drives[0]);
		identify_without(f, 0, cases[i].silent);
		assert_string_equal(whole(f, jog(f, 0)), cases[i].said);
		drop(f);
	}
}

/* A jog without a speed has none that could be waited for. */
static void a_jog_on_without_a_speed_waits_for_none(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, false, 0, 0);
	poll_all(f, false, 500, 0);
	assert_string_equal(jog(f, 0), "0AF3010303A1");
	assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
	assert_string_equal(value(f, 0), "=ok");
	drop(f);
}

/* Only an axis that is known to go that way goes on: one that is to stop, or whose way nobody has
 * seen, stands first. */
static void a_jog_goes_on_only_where_the_way_is_known(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		enum db_command way = i % 2 == 0 ? DB_CMD_JOG_POSITIVE : DB_CMD_JOG_NEGATIVE;
		struct fixture *f = make(1);

		poll_all(f, false, 0, 0);
		if (i < 2) {
			poll_all(f, false, i == 0 ? 50 : -50, 0);
			whole(f, command(f, 0, DB_CMD_STOP, (struct db_args){ 0 }));
			assert_int_equal(feedback(f, 0).state, DB_AXIS_STOPPING);
		}
		assert_string_equal(command(f, 0, way, (struct db_args){ 0 }), "0AF301030200");
		assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
		drop(f);
	}
}

static void the_first_output_goes_off(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	*memory(f, 0xE4, 0) = 0xFF0000;
	assert_string_equal(
		whole(f, command(f, 0, DB_CMD_SET_OUTPUT, (struct db_args){ .output_number = 1 })),
		"0BF10103E40010000000 0AF10103E400 =ok");
	drop(f);
}

/* --- what counts as an effect, and when -------------------------------------------------------------- */

/* The bits of the other keys go back as they were read, each of them. */
static void all_bits_of_the_other_keys_are_kept(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	set(f, 0, XYZA_STOP_KEY, 4);
	assert_string_equal(value(f, 0x0F0F0F), "0BF10103E5C20F040F00");
	drop(f);
}

/* Up to the end of its reaction an axis that was jogged may still say that it stands, and from then on it
 * is believed. */
static void a_stand_is_believed_when_a_jog_had_its_time(void **state)
{
	(void)state;
	for (unsigned late = 0; late < 2; late++) {
		for (unsigned i = 0; i < 4; i++) {
			struct fixture *f = make_slow(3);
			db_time until;

			poll_all(f, true, 0, 0);
			jog(f, 0);
			answer(f, OK_MANUAL);
			until = f->now + 100 * MS - !late * MS;
			/* An answer takes 1 ms. */
			f->now = until - (i == 0) * MS;
			if (i == 0) {
				command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ 0 });
				assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
				assert_string_equal(value(f, 1), late ? "=ok" : "0AF10103E1A3");
			} else if (i == 1) {
				command(f, 0, DB_CMD_DISABLE, (struct db_args){ 0 });
				assert_string_equal(value(f, 1),
				                    late ? "0AF10103E5C1" : "0AF301030100");
			} else if (i == 2) {
				assert_string_equal(jog(f, 1), "0AF10103E1A3");
				assert_string_equal(value(f, 1),
				                    late ? "0AF3010303A3" : "0AF10103E1A3");
			} else {
				poll_all(f, true, 0, 0);
				assert_int_equal(feedback(f, 0).state,
				                 late ? DB_AXIS_DISABLED :
				                        DB_AXIS_CONTINUOUS_MOTION);
			}
			drop(f);
		}
	}
}

/* The time begins anew when it is looked at, and not when it was sent: so it does when that was lost. */
static void a_jog_that_is_awaited_is_not_ended_by_a_cycle(void **state)
{
	(void)state;
	for (unsigned heard = 0; heard < 2; heard++) {
		struct fixture *f = make_slow(1);

		poll_all(f, true, 0, 0);
		jog(f, 0);
		assert_string_equal(heard ? answer(f, OK_MANUAL) : lost(f), "0AF10103E1A3");
		f->now += 90 * MS;
		assert_string_equal(value(f, 1), "0AF10103E1A3");
		f->now += 50 * MS;
		poll_all(f, true, 0, 0);
		assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
		drop(f);
	}
}

/* It was seen to move: from then on a stand is one, however early. */
static void a_stand_after_a_motion_is_believed_at_once(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 0), "=ok");
	command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 1), "=ok");
	drop(f);
}

/* What is read back right ends it, what is read back wrong may only be late. */
static void a_parameter_is_awaited_while_it_is_wrong(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	set(f, 0, XYZA_MANUAL_SPEED, 50);
	value(f, 9);
	answer(f, OK_DATA);
	assert_string_equal(value(f, 50), "=ok");
	set(f, 0, XYZA_MANUAL_SPEED, 60);
	value(f, 50);
	answer(f, OK_DATA);
	assert_string_equal(value(f, 50), "0AF10103E2A4");
	assert_true(f->exchange.again);
	assert_string_equal(value(f, 60), "=ok");
	assert_false(feedback(f, 0).status & DB_STATUS_REFUSED);
	/* Not longer than configured; what it holds instead is shown. */
	set(f, 0, XYZA_MANUAL_SPEED, 70);
	value(f, 60);
	answer(f, OK_DATA);
	value(f, 60);
	f->now += 100 * MS;
	assert_string_equal(value(f, 65), "=refused");
	assert_true(feedback(f, 0).status & DB_STATUS_REFUSED);
	assert_int_equal(plate(f, 0)->values[XYZA_MANUAL_SPEED].u, 65);
	/* A value that was there already is known as well. */
	set(f, 0, XYZA_MANUAL_SPEED, 80);
	assert_string_equal(value(f, 80), "=ok");
	assert_int_equal(plate(f, 0)->values[XYZA_MANUAL_SPEED].u, 80);
	drop(f);
}

/* Any stop of any axis ends the wait of a jog; power that is taken off a standing one is no stop. */
static void which_commands_end_a_jog_that_was_lost(void **state)
{
	static const struct {
		enum db_command command;
		const char *said;
	} cases[] = {
		{ DB_CMD_STOP, "=cancelled" },
		{ DB_CMD_QUICK_STOP, "=cancelled" },
		{ DB_CMD_DISABLE, "0AF3010303A1" },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture *f = make(3);
		struct db_request request;
		struct db_job job;

		poll_all(f, true, 0, 0);
		jog(f, 0);
		lost(f);
		job = f->job;
		request = f->request;
		whole(f, command(f, 1, cases[i].command, (struct db_args){ 0 }));
		f->request = request;
		go_on(f, job, "0AF10103E1A3");
		assert_string_equal(value(f, 1), cases[i].said);
		drop(f);
	}
}

/* A cycle 100 ms after the last one, by this way; then the standing read is answered so often. */
static const char *read_speed(struct fixture *f, db_time pause, int32_t *position, int32_t way,
                              unsigned reads)
{
	struct db_job job = f->job;

	f->now = feedback(f, 0).taken + pause - 3 * MS; /* the place is the third answer */
	poll_all(f, false, *position += way, 0);
	while (reads-- > 0) {
		go_on(f, job, "0AF10103E1A3");
		value(f, 0);
		job = f->job;
	}
	return f->said;
}

/* x runs at 640 Hz, and is to run at 1920: up to where its velocity is awaited. */
static int32_t begin_triple_speed(struct fixture *f)
{
	int32_t position = 0;

	poll_all(f, false, position, 0);
	read_speed(f, 100 * MS, &position, 64, 0);
	command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ .target_velocity = 1920.0f });
	value(f, 1920);
	assert_string_equal(answer(f, OK_MANUAL), "0AF10103E1A3");
	value(f, 0);
	assert_string_equal(value(f, 0), "0AF10103E1A3");
	return position;
}

/* A velocity is a sample once, however often the axis is asked in between. */
static void a_velocity_is_one_sample(void **state)
{
	struct fixture *f = make(1);
	int32_t position = begin_triple_speed(f);

	(void)state;
	assert_string_equal(read_speed(f, 100 * MS, &position, 192, 5), "0AF10103E1A3");
	/* Half of the change is near. */
	assert_string_equal(read_speed(f, 100 * MS, &position, 128, 1), "=ok");
	assert_float_equal(feedback(f, 0).velocity, 1280.0f, 0.0f);
	drop(f);
}

/* Four velocities at least, and a second without coming nearer, before it counts as ignored. */
static void another_speed_has_its_samples_and_its_time(void **state)
{
	struct fixture *f = make(1);
	int32_t position = begin_triple_speed(f);
	struct db_job job;
	db_time progress;

	(void)state;
	for (unsigned i = 0; i < 3; i++)
		assert_string_equal(read_speed(f, 1500 * MS, &position, 960, 1), "0AF10103E1A3");
	assert_string_equal(read_speed(f, 1500 * MS, &position, 960, 1), "0AF301030200");
	/* A refusal ends it too, and is not said again. */
	assert_string_equal(answer(f, FAILED_MANUAL), "=failed");
	drop(f);
	f = make(1);
	position = begin_triple_speed(f);
	read_speed(f, 100 * MS, &position, 64, 1);
	progress = f->now;
	for (unsigned i = 0; i < 4; i++)
		assert_string_equal(read_speed(f, 100 * MS, &position, 64, 1), "0AF10103E1A3");
	job = f->job;
	f->now = progress + 999 * MS;
	go_on(f, job, "0AF10103E1A3");
	assert_string_equal(value(f, 0), "0AF10103E1A3");
	assert_string_equal(value(f, 0), "0AF301030200");
	drop(f);
}

/* Two seconds, and not one answer more. */
static void brakes_that_do_nothing_have_two_seconds(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, false, 0, 0);
	command(f, 0, DB_CMD_MOVE_VELOCITY, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	assert_string_equal(value(f, 0), "0AF10103E1A3");
	f->now += 1999 * MS;
	assert_string_equal(value(f, 0), "0AF10103E1A3");
	assert_string_equal(value(f, 0), "=failed");
	drop(f);
}

/* Nothing of a parameter write before this one counts: neither how far it was, nor what it came to. */
static void each_parameter_write_begins_anew(void **state)
{
	const struct db_setting settings[] = {
		{ .param = XYZA_MIN_SPEED, .value.u = 1 },
		{ .param = XYZA_MAX_SPEED, .value.u = 2 },
	};
	struct fixture *f = make(1);

	(void)state;
	set(f, 0, XYZA_SLAVE_NUMBER, OBJECT);
	assert_string_equal(answer(f, OK_DATA), "=unproven");
	for (unsigned i = 0; i < 2; i++) {
		*memory(f, 0xE2, 0xA1) = *memory(f, 0xE2, 0xA2) = 9;
		f->request = (struct db_request){ .setting_count = 2, .settings = settings };
		assert_string_equal(whole(f, begin(f, 0, DB_JOB_SETTINGS)),
		                    "0AF10103E2A1 0BF10103E2A101000000 0AF10103E2A1 "
		                    "0AF10103E2A2 0BF10103E2A202000000 0AF10103E2A2 =ok");
	}
	drop(f);
}

/* A time that is never told is written all the same, as computed. */
static void a_ramp_is_written_where_its_time_is_silent(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	*memory(f, 0xE2, 0xA1) = 200;
	*memory(f, 0xE2, 0xA2) = 3200;
	identify_without(f, 0, "0AF10103E2A3");
	assert_string_equal(whole(f, set_ramp(f, 0, XYZA_RAMP_ACCELERATION, 1000.0f)),
	                    "0AF10103E2A1 0AF10103E2A2 0BF10103E2A31E000000 =unproven");
	drop(f);
}

/* A controller that accepts and cannot be asked: it is not known, and no failure. */
static void an_effect_that_cannot_be_read_is_unproven(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	command(f, 0, DB_CMD_PAUSE_PROGRAM, (struct db_args){ 0 });
	assert_string_equal(refuse(f, FAILED_PROGRAM), "0AF401030200");
	assert_string_equal(answer(f, OK_PROGRAM), ASK_PROGRAM);
	assert_string_equal(program(f, 2, 1, 1), "=unproven");
	command(f, 0, DB_CMD_SET_OUTPUT, (struct db_args){ .output_number = 1 });
	answer(f, OK_DATA);
	assert_string_equal(refuse(f, FAILED_DATA), "=unproven");
	drop(f);
}

/* What there is nothing to do about is done: an earlier refusal does not count any more. */
static void a_program_that_waits_already_is_no_refusal(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	command(f, 0, DB_CMD_START_PROGRAM, (struct db_args){ .program_number = 1 });
	assert_string_equal(program(f, 1, 1, 1), "=refused");
	assert_true(feedback(f, 0).status & DB_STATUS_REFUSED);
	command(f, 0, DB_CMD_PAUSE_PROGRAM, (struct db_args){ 0 });
	assert_string_equal(program(f, 2, 1, 1), "=ok");
	assert_false(feedback(f, 0).status & DB_STATUS_REFUSED);
	drop(f);
}

/* An accepted command to a program may show late; one that was refused is said again at once. */
static void a_program_is_awaited_when_it_has_accepted(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	command(f, 0, DB_CMD_PAUSE_PROGRAM, (struct db_args){ 0 });
	program(f, 1, 1, 1);
	answer(f, OK_PROGRAM);
	assert_string_equal(program(f, 1, 1, 1), ASK_PROGRAM);
	assert_true(f->exchange.again);
	assert_string_equal(program(f, 2, 1, 1), "=ok");
	command(f, 0, DB_CMD_CONTINUE_PROGRAM, (struct db_args){ 0 });
	program(f, 2, 1, 1);
	answer(f, FAILED_PROGRAM);
	assert_string_equal(program(f, 2, 1, 1), "0AF401030600");
	drop(f);
}

/* A cycle may find it standing before the motion shows: once that has shown, it moves for everybody. */
static void a_motion_that_was_seen_is_one_for_all(void **state)
{
	struct fixture *f = make(3);
	struct db_job job;

	(void)state;
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	job = f->job;
	poll_all(f, true, 0, 0);
	go_on(f, job, "0AF10103E1A3");
	assert_string_equal(value(f, 0), "=ok");
	assert_int_equal(feedback(f, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	assert_true(feedback(f, 0).status & DB_STATUS_MOVING);
	/* No other axis begins to move beside it. */
	assert_string_equal(jog(f, 1), "0AF10103E1A3");
	assert_string_equal(value(f, 0), "=refused");
	drop(f);
}

/* --- which cycles tell what -------------------------------------------------------------------------- */

/* "Standing" may be from before the motion that the program's end left behind: a jump is none then. */
static void a_jump_of_what_may_move_is_no_doubt(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	poll_all(f, true, 5000, XYZA_PROGRAM_RUNNING);
	command(f, 0, DB_CMD_END_PROGRAM, (struct db_args){ 0 });
	program(f, 1, 1, 7);
	answer(f, OK_PROGRAM);
	assert_string_equal(program(f, 0, 1, 7), "=ok");
	poll_all(f, true, 0, XYZA_PROGRAM_IDLE);
	assert_int_equal(feedback(f, 0).doubts, 0);
	drop(f);
}

/* Once a cycle has seen the motion, the next one may see its end. */
static void a_stand_that_follows_a_motion_is_shown(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	poll_all(f, true, 0, 0);
	jog(f, 0);
	answer(f, OK_MANUAL);
	poll_all(f, false, -3, 0);
	assert_int_equal(feedback(f, 0).drive_status & 1, 1);
	poll_all(f, true, -5, 0);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	assert_int_equal(feedback(f, 0).drive_status & 1, 1);
	poll_all(f, true, 5, 0);
	assert_int_equal(feedback(f, 0).drive_status & 1, 0);
	drop(f);
}

/* It crosses zero again and again: three tries for each axis in each cycle. */
static void each_axis_has_three_tries_for_its_sign(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	for (unsigned cycle = 0; cycle < 2; cycle++) {
		const char *said = begin(f, 0, DB_JOB_POLL);
		unsigned magnitudes[2] = { 0, 0 };

		for (unsigned reads = 0; said[0] != '='; reads++) {
			unsigned number = f->bytes[7] % 16;

			assert_true(reads < 40);
			if (strcmp(said, ASK_PROGRAM) == 0 || strcmp(said, ASK_PORTS) == 0) {
				said = obey(f);
				continue;
			}
			magnitudes[f->bytes[7] >> 4 == 0xB] += number == 1;
			said = value(f, number == 1 ? 6 : number == 2 ? reads / 2 % 2 : 0);
			assert_true(f->talk.unchanged || number != 1);
		}
		assert_int_equal(magnitudes[0], 3);
		assert_int_equal(magnitudes[1], 3);
	}
	assert_int_equal(feedback(f, 0).state, DB_AXIS_OFFLINE);
	drop(f);
}

/* Half a second after it was written the position that is read counts, whatever became of it. */
static void a_position_is_held_back_for_half_a_second(void **state)
{
	struct fixture *f = make(1);
	db_time written;

	(void)state;
	poll_all(f, true, 100, 0);
	command(f, 0, DB_CMD_SET_POSITION, (struct db_args){ .target_position = -7 });
	value(f, 1);
	answer(f, OK_DATA);
	written = f->now;
	/* The position is the third answer. */
	f->now = written + 496 * MS;
	poll_all(f, true, 7, 0);
	assert_int_equal(feedback(f, 0).position, 100);
	f->now = written + 497 * MS;
	poll_all(f, true, 8, 0);
	assert_int_equal(feedback(f, 0).position, 8);
	drop(f);
}

/* One that never answers is asked for after 2 s, 4 s and so on, and after 64 s at last. */
static void a_silent_axis_is_asked_for_less_and_less(void **state)
{
	static const char ask_y[] = "0AF10103E1B3";
	static const unsigned pauses[] = { 2, 4, 8, 16, 32, 64, 64, 64 };
	struct fixture *f = make(3);

	(void)state;
	poll_up_to(f, ask_y);
	assert_string_equal(poll_up_to(f, ask_y), ask_y);
	for (size_t i = 0; i < sizeof pauses / sizeof pauses[0]; i++) {
		db_time noticed = f->now;

		assert_string_equal(poll_up_to(f, ask_y), "=ok");
		/* x is read before, in three answers. */
		f->now = noticed + pauses[i] * DB_NS_PER_S - 4 * MS;
		assert_string_equal(poll_up_to(f, ask_y), "=ok");
		f->now = noticed + pauses[i] * DB_NS_PER_S - 3 * MS;
		assert_string_equal(poll_up_to(f, ask_y), ask_y);
	}
	drop(f);
}

/* Which one has answered does not matter: the controller is there, and this axis is not. */
static void a_silent_axis_is_passed_over_whoever_answers(void **state)
{
	struct fixture *f = make(7);

	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		begin(f, 0, DB_JOB_POLL);
		assert_string_equal(refuse(f, FAILED_DATA), "0AF10103E1B3");
		value(f, 1);
		value(f, 0);
		value(f, 5);
		if (i == 0)
			value(f, 0);
		assert_string_equal(f->said, i < 2 ? "0AF10103E1C3" : ASK_PORTS);
	}
	drop(f);
}

/* Any two axes at 0; and one that was away and comes back there. Then all is read again. */
static void a_restart_is_read_anew(void **state)
{
	struct fixture *f = make(0xF);

	(void)state;
	*memory(f, 0xE1, 0xB1) = *memory(f, 0xE1, 0xC1) = 5000;
	whole(f, begin(f, 0, DB_JOB_POLL));
	*memory(f, 0xE1, 0xB1) = *memory(f, 0xE1, 0xC1) = 0;
	whole(f, begin(f, 0, DB_JOB_POLL));
	assert_int_equal(feedback(f, 1).restarts, 1);
	assert_int_equal(feedback(f, 2).restarts, 1);
	assert_true(plate(f, 0)->doubtful && plate(f, 3)->doubtful);
	drop(f);
	f = make(3);
	poll_all(f, true, 5000, 0);
	for (unsigned axis = 0; axis < 2; axis++)
		db_driver_xyza.gone(f->axes[axis]);
	assert_false(plate(f, 0)->doubtful);
	poll_all(f, true, 0, 0);
	assert_int_equal(feedback(f, 0).restarts, 1);
	assert_true(plate(f, 0)->doubtful && plate(f, 1)->doubtful);
	drop(f);
}

/* A program is news when anything of it is. */
static void any_change_of_a_program_is_told(void **state)
{
	static const unsigned programs[][3] = {
		{ 2, 3, 264 }, { 1, 3, 264 }, { 1, 4, 264 }, { 1, 4, 265 }
	};
	struct fixture *f = make(1);

	(void)state;
	for (size_t i = 0; i < sizeof programs / sizeof programs[0]; i++) {
		for (unsigned again = 0; again < 2; again++) {
			assert_string_equal(poll_up_to(f, ASK_PROGRAM), ASK_PROGRAM);
			program(f, programs[i][0], programs[i][1], programs[i][2]);
			assert_true(f->talk.unchanged == (again == 1));
		}
	}
	drop(f);
}

/* One whole reading with this pause after it; the item that was read in it, or null. */
static const char *read_turn(struct fixture *f, db_time pause)
{
	static char item[16];
	const char *said = begin(f, 0, DB_JOB_POLL);

	item[0] = '\0';
	for (; said[0] != '='; said = obey(f)) {
		if (strncmp(said, "0AF10103E", 9) == 0 && strchr("235", said[9]))
			strcpy(item, said);
	}
	f->now += pause;
	return item[0] ? item : NULL;
}

/* However long a reading takes, one in ten reads the power and one an item; and however short it is,
 * items are read once a second. All items of an axis, then those of the next one. */
static void items_are_read_in_order_and_seldom(void **state)
{
	struct fixture *f = make(7);
	unsigned power = 0;
	unsigned items = 0;
	char order[64] = "";
	const char *item;

	(void)state;
	for (unsigned axis = 0; axis < 3; axis++)
		identify(f, axis);
	for (unsigned i = 0; i < 400; i++) {
		item = read_turn(f, 2000 * MS);
		if (!item)
			continue;
		power += strcmp(item, "0AF10103E5C1") == 0;
		items += strcmp(item, "0AF10103E5C1") != 0;
		if (item[9] != '5' && order[strlen(order) - (order[0] != '\0')] != item[10])
			strncat(order, item + 10, 1);
	}
	assert_int_equal(power, 40);
	assert_int_equal(items, 40);
	assert_true(strncmp(order, "ABCA", 4) == 0);
	items = 0;
	for (db_time end = f->now + 10 * DB_NS_PER_S; f->now < end;) {
		item = read_turn(f, 0);
		items += item && strcmp(item, "0AF10103E5C1") != 0;
	}
	assert_in_range(items, 7, 10);
	drop(f);
}

/* Common items belong to any axis that is there. */
static void the_power_is_read_again_without_x(void **state)
{
	struct fixture *f = make(2);
	unsigned reads = 0;

	(void)state;
	f->talking = f->axes[1];
	identify(f, 1);
	for (unsigned i = 0; i < 10; i++) {
		const char *said = begin(f, 1, DB_JOB_POLL);

		for (; said[0] != '='; said = obey(f))
			reads += strcmp(said, "0AF10103E5C1") == 0;
	}
	assert_int_equal(reads, 1);
	drop(f);
}

/* Any axis that is to stop is judged by the end of a reading. */
static void no_item_is_read_while_any_axis_stops(void **state)
{
	struct fixture *f = make(3);

	(void)state;
	identify(f, 0);
	identify(f, 1);
	*memory(f, 0xE1, 0xB3) = 0;
	count_in_cycles(f, 1, "");
	command(f, 1, DB_CMD_STOP, (struct db_args){ 0 });
	answer(f, OK_MANUAL);
	answer(f, OK_PROGRAM);
	assert_int_equal(feedback(f, 0).state, DB_AXIS_DISABLED);
	assert_int_equal(feedback(f, 1).state, DB_AXIS_STOPPING);
	assert_int_equal(count_in_cycles(f, 40, "0AF10103E5"), 0);
	drop(f);
}

/* Up to the first item of an axis that is read again. */
static const char *reach_item(struct fixture *f)
{
	for (;;) {
		const char *said = begin(f, 0, DB_JOB_POLL);

		while (said[0] != '=' && strncmp(said, "0AF10103E2", 10) != 0)
			said = obey(f);
		if (said[0] != '=')
			return said;
		f->now += 100 * MS;
	}
}

/* One loss is the line's: the same item is read again, and not the next one. */
static void an_item_whose_answer_was_lost_is_read_next(void **state)
{
	struct fixture *f = make(3);
	char item[16];

	(void)state;
	identify(f, 0);
	identify(f, 1);
	strcpy(item, reach_item(f));
	f->now += 100 * MS;
	assert_string_equal(reach_item(f), item);
	assert_string_equal(obey(f), "=ok");
	assert_false(plate(f, 0)->doubtful);
	assert_string_not_equal(reach_item(f), item);
	drop(f);
}

/* A refusal has no value: what is known stays, and all of whom it concerns is read again. */
static void an_item_that_is_refused_is_doubtful(void **state)
{
	struct fixture *f = make(3);
	const char *said = NULL;

	(void)state;
	*memory(f, 0xE5, 0xC1) = 3;
	for (unsigned target = 0xA1; target <= 0xA4; target++)
		*memory(f, 0xE2, target) = 50;
	identify(f, 0);
	identify(f, 1);
	assert_true(strncmp(reach_item(f), "0AF10103E2A", 11) == 0);
	assert_string_equal(refuse(f, FAILED_DATA), "=ok");
	assert_true(plate(f, 0)->doubtful);
	assert_false(plate(f, 1)->doubtful);
	assert_int_equal(plate(f, 0)->values[XYZA_MIN_SPEED].u, 50);
	do {
		for (said = begin(f, 0, DB_JOB_POLL);
		     said[0] != '=' && strcmp(said, "0AF10103E5C1") != 0;)
			said = obey(f);
	} while (said[0] == '=');
	assert_string_equal(refuse(f, FAILED_DATA), "=ok");
	assert_true(plate(f, 1)->doubtful);
	assert_int_equal(plate(f, 1)->values[XYZA_ENABLE].u, 3);
	drop(f);
}

/* That the program does not run any more says nothing about the axis: it goes on as it did. */
static void a_look_at_the_program_shows_no_stand(void **state)
{
	struct fixture *f = make_slow(1);

	(void)state;
	poll_all(f, false, 0, XYZA_PROGRAM_RUNNING);
	poll_all(f, false, 500, XYZA_PROGRAM_RUNNING);
	assert_string_equal(jog(f, 0), ASK_PROGRAM);
	assert_string_equal(program(f, XYZA_PROGRAM_WAITING, 1, 7), "0AF3010303A1");
	assert_true(feedback(f, 0).velocity > 0.0f);
	assert_true(feedback(f, 0).status & DB_STATUS_MOVING);
	drop(f);
}

/* A whole reading that begins then, in which the power is not answered; true if it was asked for. */
static bool read_without_power(struct fixture *f, db_time at, unsigned *items)
{
	const char *said;

	f->now = at;
	for (said = begin(f, 0, DB_JOB_POLL); said[0] != '='; said = obey(f)) {
		if (strcmp(said, "0AF10103E5C1") == 0)
			return true;
		*items += strncmp(said, "0AF10103E2", 10) == 0 ||
		          strncmp(said, "0AF10103E3", 10) == 0 ||
		          strncmp(said, "0AF10103E5", 10) == 0;
	}
	return false;
}

/* 15 s after it was missed, then after twice as long, up to 16 min; it has a turn each 5 s here. */
static void a_silent_power_is_asked_for_less_and_less(void **state)
{
	static const unsigned asked[] = { 15, 50, 115, 240, 485, 970, 1935, 2900, 3865 };
	struct fixture *f = make(1);
	unsigned items = 0;
	size_t count = 0;
	db_time begins;

	(void)state;
	identify_without(f, 0, "0AF10103E5C1");
	begins = f->now;
	for (unsigned i = 1; i < 8000; i++) {
		if (!read_without_power(f, begins + i * 500 * MS, &items))
			continue;
		assert_true(count < sizeof asked / sizeof asked[0]);
		/* The first turn is that of the tenth reading. */
		assert_int_equal(i, 10 + 2 * asked[count]);
		count++;
	}
	assert_int_equal(count, sizeof asked / sizeof asked[0]);
	/* Ten readings took longer than the pause between two items. */
	assert_int_equal(items, 800);
	drop(f);
}

/* Ten readings of 100 ms are exactly the pause between two items. */
static void an_item_is_read_each_second(void **state)
{
	struct fixture *f = make(1);
	unsigned items = 0;
	db_time begins;

	(void)state;
	identify_without(f, 0, "0AF10103E5C1");
	begins = f->now + DB_NS_PER_S;
	for (unsigned i = 1; i <= 100; i++)
		(void)read_without_power(f, begins + i * 100 * MS, &items);
	assert_int_equal(items, 10);
	drop(f);
}

/* 10 MHz is a velocity still. */
static void the_fastest_velocity_is_one(void **state)
{
	struct fixture *f = make(1);

	(void)state;
	poll_all(f, false, 0, 0);
	f->now = feedback(f, 0).taken + 997 * MS; /* the place is the third answer */
	poll_all(f, false, 10000000, 0);
	assert_float_equal(feedback(f, 0).velocity, 1e7f, 0.0f);
	assert_int_equal(feedback(f, 0).doubts, 0);
	drop(f);
}

/* What the line lost may not have been lost alone: when one is told, the others are asked for anew. */
static void what_is_told_after_all_brings_back_the_others(void **state)
{
	static const char speed[] = "0AF10103E2A1";
	struct fixture *f = make(1);
	const char *said = begin(f, 0, DB_JOB_IDENTIFY);
	bool told = false;
	unsigned turns = 0;
	unsigned asked = 0;
	db_time begins;

	(void)state;
	while (said[0] != '=')
		said = strcmp(said, speed) == 0 || strcmp(said, "0AF10103E5C1") == 0 ? lost(f) :
		                                                                       obey(f);
	begins = f->now;
	/* For 700 s both are silent; then 60 s from the first answer on. */
	for (unsigned i = 1; turns < 120; i++) {
		bool power = false;

		assert_true(i < 8000);
		f->now = begins + i * 500 * MS;
		turns += told;
		said = begin(f, 0, DB_JOB_POLL);
		while (said[0] != '=' && !power && (i >= 1400 || strcmp(said, speed) != 0)) {
			power = strcmp(said, "0AF10103E5C1") == 0;
			told = told || strcmp(said, speed) == 0;
			if (!power)
				said = obey(f);
		}
		asked += told && power;
	}
	assert_in_range(asked, 2, 3);
	drop(f);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_first_place_tells_no_speed),
		cmocka_unit_test(one_cycle_asks_once_for_all_axes),
		cmocka_unit_test(a_jump_to_0_is_doubted_where_nothing_was_commanded),
		cmocka_unit_test(what_changes_nothing_is_said_to),
		cmocka_unit_test(an_axis_that_leaves_is_not_asked_for),
		cmocka_unit_test(what_stands_where_it_stood_needs_no_second_look),
		cmocka_unit_test(a_state_reply_may_echo_the_next_target),
		cmocka_unit_test(the_sign_is_right_while_zero_is_crossed),
		cmocka_unit_test(a_position_whose_sign_is_in_doubt_is_not_shown),
		cmocka_unit_test(a_velocity_comes_from_two_positions),
		cmocka_unit_test(a_jump_of_the_counter_is_no_velocity),
		cmocka_unit_test(frames_of_others_are_not_taken),
		cmocka_unit_test(a_read_takes_only_what_was_read),
		cmocka_unit_test(the_probe_has_an_order_of_its_own),
		cmocka_unit_test(every_command_in_bytes),
		cmocka_unit_test(what_the_family_does_not_have_is_refused),
		cmocka_unit_test(the_last_values_of_a_range_are_in_it),
		cmocka_unit_test(a_refusal_is_told),
		cmocka_unit_test(a_damaged_request_is_said_again),
		cmocka_unit_test(an_axis_that_is_not_there_leaves_the_others),
		cmocka_unit_test(one_axis_at_a_time),
		cmocka_unit_test(a_silent_axis_is_passed_over_and_offline),
		cmocka_unit_test(what_is_silent_in_a_cycle_is_passed_over),
		cmocka_unit_test(a_program_that_is_not_told_is_not_believed),
		cmocka_unit_test(outputs_that_are_not_told_are_unproven),
		cmocka_unit_test(an_axis_that_never_answers_leaves_the_others),
		cmocka_unit_test(the_other_axes_are_read_when_one_falls_silent),
		cmocka_unit_test(an_axis_passed_over_is_asked_when_the_controller_is_back),
		cmocka_unit_test(the_other_axes_are_read_when_the_first_never_answers),
		cmocka_unit_test(a_controller_that_is_back_is_read_from_its_first_axis_on),
		cmocka_unit_test(the_other_axes_are_read_when_the_first_takes_all_offline),
		cmocka_unit_test(any_state_of_a_program_is_shown),
		cmocka_unit_test(a_jog_right_behind_a_program),
		cmocka_unit_test(what_was_seen_before_a_jog_does_not_end_it),
		cmocka_unit_test(what_was_seen_before_its_effect_does_not_end_a_jog),
		cmocka_unit_test(another_way_is_gone_only_from_a_stand),
		cmocka_unit_test(a_stand_from_before_a_motion_is_none),
		cmocka_unit_test(a_stand_from_before_a_programs_motion_is_none),
		cmocka_unit_test(slow_brakes_are_no_failure),
		cmocka_unit_test(another_speed_is_taken_while_it_moves),
		cmocka_unit_test(another_speed_shows_in_its_velocity),
		cmocka_unit_test(another_speed_that_is_ignored_fails),
		cmocka_unit_test(a_stop_stops_what_runs),
		cmocka_unit_test(a_position_is_set),
		cmocka_unit_test(a_position_that_is_not_taken_is_no_success),
		cmocka_unit_test(a_position_in_the_making_is_not_shown),
		cmocka_unit_test(a_program_that_is_taken_after_a_refusal_may_have_run),
		cmocka_unit_test(a_delay_does_not_outlive_its_start),
		cmocka_unit_test(an_acknowledgement_is_no_proof),
		cmocka_unit_test(an_effect_may_take_its_time),
		cmocka_unit_test(another_position_shows_that_it_moves),
		cmocka_unit_test(disabling_one_axis_leaves_the_others),
		cmocka_unit_test(an_interruption_is_cleared),
		cmocka_unit_test(a_jog_is_never_repeated_blindly),
		cmocka_unit_test(a_jog_is_not_repeated_after_a_stop),
		cmocka_unit_test(program_commands_are_never_repeated_blindly),
		cmocka_unit_test(stops_and_writes_are_repeated),
		cmocka_unit_test(all_parameters_are_read),
		cmocka_unit_test(the_power_is_read_again),
		cmocka_unit_test(every_item_is_read_again_in_turn),
		cmocka_unit_test(an_item_that_falls_silent_is_doubtful),
		cmocka_unit_test(what_was_lost_is_asked_for_again),
		cmocka_unit_test(what_one_axis_lost_another_has_read),
		cmocka_unit_test(what_a_controller_lacks_keeps_nothing_else),
		cmocka_unit_test(what_is_lost_when_a_controller_returns_is_asked_for_soon),
		cmocka_unit_test(what_a_controller_lacks_is_asked_for_seldom),
		cmocka_unit_test(a_jog_with_limits_looks_at_its_brakes),
		cmocka_unit_test(one_key_is_changed_and_the_others_kept),
		cmocka_unit_test(enabling_an_axis_leaves_the_others),
		cmocka_unit_test(what_is_not_changed_need_not_be_in_range),
		cmocka_unit_test(what_an_axis_has_alone_stays_its_own),
		cmocka_unit_test(what_is_read_back_counts),
		cmocka_unit_test(what_is_so_already_is_not_written),
		cmocka_unit_test(several_parameters_are_written),
		cmocka_unit_test(a_trace_says_what_is_asked),
		cmocka_unit_test(passwords_are_not_shown),
		cmocka_unit_test(what_is_never_answered_is_left_out),
		cmocka_unit_test(a_raw_frame_is_refused_unless_it_is_allowed),
		cmocka_unit_test(who_allows_raw_frames_is_warned),
		cmocka_unit_test(a_raw_frame_is_checked),
		cmocka_unit_test(the_answer_to_a_raw_frame_is_shown),
		cmocka_unit_test(what_no_document_has_may_come_back),
		cmocka_unit_test(the_ramp_follows_from_speeds_and_time),
		cmocka_unit_test(a_ramp_is_written_as_its_time),
		cmocka_unit_test(dangerous_parameters_are_locked),
		cmocka_unit_test(a_motion_from_before_a_jog_does_not_show_it),
		cmocka_unit_test(a_motion_from_before_a_programs_end_does_not_show_its_last),
		cmocka_unit_test(what_was_seen_before_a_stop_does_not_end_it),
		cmocka_unit_test(what_was_seen_before_a_stand_does_not_end_it),
		cmocka_unit_test(a_jog_behind_a_stop_is_a_motion),
		cmocka_unit_test(a_jog_goes_on_in_its_direction),
		cmocka_unit_test(a_stop_shows_positions_again),
		cmocka_unit_test(a_program_shows_what_was_done_to_it),
		cmocka_unit_test(speeds_too_near_to_tell_apart_are_not_waited_for),
		cmocka_unit_test(what_is_not_told_any_more_is_not_shown),
		cmocka_unit_test(what_is_read_again_unchanged_is_no_change),
		cmocka_unit_test(a_ramp_is_as_old_as_its_values),
		cmocka_unit_test(a_refused_jog_shows_a_stand),
		cmocka_unit_test(a_status_says_what_an_axis_does),
		cmocka_unit_test(one_that_comes_back_at_0_has_restarted),
		cmocka_unit_test(a_lost_read_tells_what_was_done_before),
		cmocka_unit_test(each_effect_may_take_its_time),
		cmocka_unit_test(a_delay_of_1_is_cleared_too),
		cmocka_unit_test(a_stand_right_behind_a_jog_is_not_believed),
		cmocka_unit_test(a_jog_is_not_repeated_after_a_moving_axis_was_disabled),
		cmocka_unit_test(a_place_from_before_a_set_position_is_not_shown),
		cmocka_unit_test(a_commands_look_at_the_program_is_shown),
		cmocka_unit_test(a_position_that_is_written_again_has_its_time_again),
		cmocka_unit_test(each_command_begins_anew),
		cmocka_unit_test(a_refused_program_is_said_twice),
		cmocka_unit_test(a_stop_beside_a_stopped_program_may_be_refused),
		cmocka_unit_test(an_item_that_is_refused_is_written_only_as_a_whole),
		cmocka_unit_test(what_a_command_reads_is_shown),
		cmocka_unit_test(two_axes_at_0_are_a_restart),
		cmocka_unit_test(what_was_lost_is_not_believed),
		cmocka_unit_test(an_exchange_inherits_nothing),
		cmocka_unit_test(a_raw_answer_is_shown_alone),
		cmocka_unit_test(what_is_written_again_is_the_write),
		cmocka_unit_test(disabling_what_a_program_moves_stops_the_program),
		cmocka_unit_test(a_shared_item_is_read_though_it_was_silent),
		cmocka_unit_test(a_delay_whose_start_was_lost_is_cleared),
		cmocka_unit_test(any_other_axis_that_moves_is_asked),
		cmocka_unit_test(a_jog_with_limits_does_not_ask_what_is_silent),
		cmocka_unit_test(a_jog_on_without_a_speed_waits_for_none),
		cmocka_unit_test(a_jog_goes_on_only_where_the_way_is_known),
		cmocka_unit_test(the_first_output_goes_off),
		cmocka_unit_test(all_bits_of_the_other_keys_are_kept),
		cmocka_unit_test(a_stand_is_believed_when_a_jog_had_its_time),
		cmocka_unit_test(a_jog_that_is_awaited_is_not_ended_by_a_cycle),
		cmocka_unit_test(a_stand_after_a_motion_is_believed_at_once),
		cmocka_unit_test(a_parameter_is_awaited_while_it_is_wrong),
		cmocka_unit_test(which_commands_end_a_jog_that_was_lost),
		cmocka_unit_test(a_velocity_is_one_sample),
		cmocka_unit_test(another_speed_has_its_samples_and_its_time),
		cmocka_unit_test(brakes_that_do_nothing_have_two_seconds),
		cmocka_unit_test(each_parameter_write_begins_anew),
		cmocka_unit_test(a_ramp_is_written_where_its_time_is_silent),
		cmocka_unit_test(an_effect_that_cannot_be_read_is_unproven),
		cmocka_unit_test(a_program_that_waits_already_is_no_refusal),
		cmocka_unit_test(a_program_is_awaited_when_it_has_accepted),
		cmocka_unit_test(a_motion_that_was_seen_is_one_for_all),
		cmocka_unit_test(a_jump_of_what_may_move_is_no_doubt),
		cmocka_unit_test(a_stand_that_follows_a_motion_is_shown),
		cmocka_unit_test(each_axis_has_three_tries_for_its_sign),
		cmocka_unit_test(a_position_is_held_back_for_half_a_second),
		cmocka_unit_test(a_silent_axis_is_asked_for_less_and_less),
		cmocka_unit_test(a_silent_axis_is_passed_over_whoever_answers),
		cmocka_unit_test(a_restart_is_read_anew),
		cmocka_unit_test(any_change_of_a_program_is_told),
		cmocka_unit_test(items_are_read_in_order_and_seldom),
		cmocka_unit_test(the_power_is_read_again_without_x),
		cmocka_unit_test(no_item_is_read_while_any_axis_stops),
		cmocka_unit_test(an_item_whose_answer_was_lost_is_read_next),
		cmocka_unit_test(an_item_that_is_refused_is_doubtful),
		cmocka_unit_test(a_look_at_the_program_shows_no_stand),
		cmocka_unit_test(a_silent_power_is_asked_for_less_and_less),
		cmocka_unit_test(an_item_is_read_each_second),
		cmocka_unit_test(the_fastest_velocity_is_one),
		cmocka_unit_test(what_is_told_after_all_brings_back_the_others),
	};

	return cmocka_run_group_tests_name("driver/xyza", tests, NULL, NULL);
}
