/* SPDX-License-Identifier: Apache-2.0 */
/* How what a drive was told to do ends, as far as its feedback shows it. */
#include "axis/axis_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static const struct db_follow_config config = { .patience = 200 * MS, .reaction = 1000 * MS };

struct sample {
	int ms; /* since the command */
	enum db_axis_state state;
	uint16_t program_state;
	enum db_result result;
	bool moves;
	bool offline;
	bool staged;
	int32_t position;
};

static void begin(struct db_follow *follow, enum db_command command, const struct db_args *args,
                  bool proven, db_time now)
{
	struct db_request request = { .command = command, .ticket = 1, .args = args };

	db_follow_begin(follow, &request, proven, now);
}

static void expect(enum db_command command, db_time delay, bool proven,
                   const struct sample *samples, size_t count)
{
	struct db_args args = { .program_delay = (uint16_t)(delay / DB_NS_PER_S) };
	struct db_follow follow;
	db_time begun = 1000 * MS;

	assert_int_not_equal(db_motion_of(command), DB_MOTION_NONE);
	begin(&follow, command, &args, proven, begun);
	for (size_t i = 0; i < count; i++) {
		db_time now = begun + samples[i].ms * MS;
		struct db_feedback feedback = {
			.taken = now,
			.state = (uint16_t)samples[i].state,
			.program_state = samples[i].program_state,
			.staged = samples[i].staged,
			.position = samples[i].position,
			.status = (samples[i].offline ? 0 : DB_STATUS_ONLINE) |
			          (samples[i].moves ? DB_STATUS_MOVING : 0),
		};

		assert_true(follow.active);
		assert_int_equal(db_follow_check(&follow, &config, &feedback, now),
		                 samples[i].result);
		assert_int_equal(follow.active, samples[i].result == DB_RESULT_PENDING);
	}
}

#define EXPECT_OF(proven, command, delay, ...)                                       \
	expect((command), (delay), (proven), (const struct sample[]){ __VA_ARGS__ }, \
	       sizeof((const struct sample[]){ __VA_ARGS__ }) / sizeof(struct sample))
#define EXPECT(command, delay, ...) EXPECT_OF(true, command, delay, __VA_ARGS__)
#define PENDING .result = DB_RESULT_PENDING
#define RUNS .state = DB_AXIS_CONTINUOUS_MOTION, .moves = true
#define STANDS .state = DB_AXIS_STANDSTILL

/* What is seen at these velocities, a sample each 10 ms: at which of them it shows; -1: never. */
static int shows_at(float speed, float before, const float *velocities, size_t count)
{
	const struct db_args args = { .target_velocity = speed };
	const struct db_request request = {
		.command = DB_CMD_MOVE_VELOCITY, .ticket = 1, .args = &args, .before = before
	};
	struct db_follow follow;

	db_follow_begin(&follow, &request, false, 1000 * MS);
	for (size_t i = 0; i < count; i++) {
		struct db_feedback feedback = {
			.taken = (1010 + 10 * (int)i) * MS,
			.status = DB_STATUS_ONLINE | DB_STATUS_MOVING,
			.velocity = velocities[i],
		};

		if (db_follow_shows(&follow, &feedback)) {
			assert_false(db_follow_shows(&follow, &feedback));
			return (int)i;
		}
		/* The same sample again is no second one. */
		assert_false(db_follow_shows(&follow, &feedback));
	}
	return -1;
}

/* Data of the moment of the command may be from before it. */
static void data_of_the_moment_of_the_command_show_nothing(void **state)
{
	const struct db_args args = { .target_velocity = 1000.0f };
	const struct db_request request = { .command = DB_CMD_MOVE_VELOCITY,
		                            .ticket = 1,
		                            .args = &args };
	struct db_feedback feedback = { .status = DB_STATUS_ONLINE | DB_STATUS_MOVING,
		                        .velocity = 1000.0f };
	struct db_follow follow;
	unsigned samples = 0;

	(void)state;
	db_follow_begin(&follow, &request, false, 1000 * MS);
	feedback.taken = 1000 * MS;
	assert_false(db_follow_shows(&follow, &feedback));
	do {
		samples++;
		feedback.taken += 10 * MS;
	} while (!db_follow_shows(&follow, &feedback) && samples < 10);
	assert_int_equal(samples, 3);
}

static void a_speed_without_proof_shows_later(void **state)
{
	static const float up[] = { 100, 500, 990, 1000, 1010, 1000 };
	static const float passing[] = { 100, 990, 1200, 1000, 1000, 900, 1000 };
	static const float back[] = { 100, 0, -990, -1000, -1010 };

	(void)state;
	assert_int_equal(shows_at(1000, 100, up, 6), 4);
	assert_int_equal(shows_at(-1000, 100, up, 6), -1);
	assert_int_equal(shows_at(1000, 100, passing, 7), -1);
	assert_int_equal(shows_at(-1000, 100, back, 5), 4);
	/* The one before looks the same. */
	assert_int_equal(shows_at(1000, 960, up, 6), -1);
	/* Nothing was in doubt. */
	assert_int_equal(shows_at(0, 100, up, 6), -1);
}

static void what_goes_on_for_ever_and_stands_has_failed(void **state)
{
	static const enum db_command commands[] = { DB_CMD_MOVE_VELOCITY, DB_CMD_MOVE_PRESET,
		                                    DB_CMD_JOG_POSITIVE, DB_CMD_JOG_NEGATIVE };

	(void)state;
	for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
		assert_int_equal(db_motion_of(commands[i]), DB_MOTION_ENDLESS);
		/* A moment between two directions is no end, nor is a drive that is not there. */
		EXPECT(commands[i], 0, { 10, STANDS, PENDING }, { 20, RUNS, PENDING },
		       { 30, STANDS, PENDING }, { 130, RUNS, PENDING },
		       { 140, .offline = true, PENDING }, { 900, STANDS, PENDING },
		       { 1099, STANDS, PENDING }, { 1100, STANDS, .result = DB_RESULT_FAILED });
		/* Without power it stands as well. */
		EXPECT(commands[i], 0, { 20, RUNS, PENDING },
		       { 30, .state = DB_AXIS_DISABLED, PENDING },
		       { 230, .state = DB_AXIS_DISABLED, .result = DB_RESULT_FAILED });
		EXPECT(commands[i], 0, { 20, RUNS, PENDING },
		       { 30, .state = DB_AXIS_ERROR_STOP, .result = DB_RESULT_FAILED });
		/* One that was not seen to begin may wait for others; one that is blocked runs. */
		EXPECT(commands[i], 0, { 10, STANDS, PENDING }, { 5000, STANDS, PENDING });
		EXPECT(commands[i], 0, { 10, RUNS, PENDING },
		       { 20, .state = DB_AXIS_CONTINUOUS_MOTION, PENDING },
		       { 5000, .state = DB_AXIS_CONTINUOUS_MOTION, PENDING });
	}
	assert_int_equal(db_motion_of(DB_CMD_MOVE_CURRENT), DB_MOTION_NONE);
}

static void what_was_taken_without_proof_and_never_begins_has_failed(void **state)
{
	static const enum db_command commands[] = { DB_CMD_MOVE_VELOCITY, DB_CMD_MOVE_PRESET,
		                                    DB_CMD_JOG_POSITIVE, DB_CMD_JOG_NEGATIVE };

	(void)state;
	for (size_t i = 0; i < sizeof commands / sizeof commands[0]; i++) {
		EXPECT_OF(false, commands[i], 0, { 10, STANDS, PENDING }, { 999, STANDS, PENDING },
		          { 1000, STANDS, .result = DB_RESULT_FAILED });
		/* A servo's state is that of its setpoint. */
		EXPECT_OF(false, commands[i], 0,
		          { 10, .state = DB_AXIS_CONTINUOUS_MOTION, .position = 5, PENDING },
		          { 1000, .state = DB_AXIS_CONTINUOUS_MOTION, .position = 5,
		            .result = DB_RESULT_FAILED });
		/* That shows no speed, but goes. */
		EXPECT_OF(false, commands[i], 0,
		          { 10, .state = DB_AXIS_CONTINUOUS_MOTION, .position = 5, PENDING },
		          { 900, .state = DB_AXIS_CONTINUOUS_MOTION, .position = 4, PENDING },
		          { 5000, .state = DB_AXIS_CONTINUOUS_MOTION, .position = 4, PENDING });
		EXPECT_OF(false, commands[i], 0, { 10, STANDS, PENDING }, { 900, RUNS, PENDING },
		          { 1000, RUNS, PENDING }, { 2000, STANDS, PENDING },
		          { 2200, STANDS, .result = DB_RESULT_FAILED });
		/* It is not to begin yet. */
		EXPECT_OF(false, commands[i], 0, { 10, STANDS, .staged = true, PENDING },
		          { 5000, STANDS, .staged = true, PENDING });
		EXPECT_OF(false, commands[i], 0, { 10, STANDS, PENDING },
		          { 500, .offline = true, PENDING }, { 5000, .offline = true, PENDING });
	}
}

static void homing_may_end_late(void **state)
{
	struct db_feedback feedback = { .taken = 10 * MS,
		                        .state = DB_AXIS_STANDSTILL,
		                        .status = DB_STATUS_ONLINE };
	struct db_follow follow;

	(void)state;
	begin(&follow, DB_CMD_HOME, NULL, true, MS);
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 10 * MS), DB_RESULT_FAILED);
	assert_false(db_follow_is_late(&follow, &feedback));
	feedback.status |= DB_STATUS_MOVING | DB_STATUS_HOMED;
	assert_false(db_follow_is_late(&follow, &feedback));
	feedback.status = DB_STATUS_HOMED;
	assert_false(db_follow_is_late(&follow, &feedback));
	feedback.status |= DB_STATUS_ONLINE;
	assert_true(db_follow_is_late(&follow, &feedback));
	assert_false(db_follow_is_late(&follow, &feedback));
	/* Not after something else, nor of a move, nor without power. */
	feedback.status = DB_STATUS_ONLINE;
	begin(&follow, DB_CMD_HOME, NULL, true, MS);
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 10 * MS), DB_RESULT_FAILED);
	follow.active = follow.late = false;
	feedback.status |= DB_STATUS_HOMED;
	assert_false(db_follow_is_late(&follow, &feedback));
	feedback.state = DB_AXIS_ERROR_STOP;
	begin(&follow, DB_CMD_HOME, NULL, true, MS);
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 10 * MS), DB_RESULT_FAILED);
	assert_false(db_follow_is_late(&follow, &feedback));
}

static void a_program_ends_when_it_is_idle(void **state)
{
	(void)state;
	assert_true(db_motion_of(DB_CMD_START_PROGRAM) > DB_MOTION_ENDLESS);
	assert_true(db_motion_of(DB_CMD_CONTINUE_PROGRAM) > DB_MOTION_ENDLESS);
	/* It may stand for long, on an axis without power of its own. */
	EXPECT(DB_CMD_START_PROGRAM, 0, { 10, .program_state = 1, RUNS, PENDING },
	       { 900, .program_state = 1, .state = DB_AXIS_DISABLED, PENDING },
	       { 990, .program_state = 6, .state = DB_AXIS_DISABLED, PENDING },
	       { 999, .state = DB_AXIS_DISABLED, .result = DB_RESULT_OK });
	EXPECT(DB_CMD_CONTINUE_PROGRAM, 0, { 10, .program_state = 1, RUNS, PENDING },
	       { 30, .program_state = 2, STANDS, .result = DB_RESULT_CANCELLED });
	EXPECT(DB_CMD_START_PROGRAM, 0, { 10, .program_state = 1, RUNS, PENDING },
	       { 20, .program_state = 3, RUNS, PENDING },
	       { 30, .program_state = 3, .state = DB_AXIS_ERROR_STOP, .result = DB_RESULT_FAILED });
	EXPECT(DB_CMD_START_PROGRAM, 0, { 10, .program_state = 1, RUNS, PENDING },
	       { 20, .offline = true, .result = DB_RESULT_INDETERMINATE });
	/* So short that no cycle has seen it: its start was. */
	EXPECT(DB_CMD_START_PROGRAM, 0, { 10, STANDS, PENDING },
	       { 200, STANDS, .result = DB_RESULT_OK });
}

static void a_delayed_program_is_waited_for(void **state)
{
	(void)state;
	EXPECT(DB_CMD_START_PROGRAM, 2000 * MS, { 10, STANDS, PENDING }, { 1900, STANDS, PENDING },
	       { 2050, .program_state = 1, RUNS, PENDING },
	       { 2060, STANDS, .result = DB_RESULT_OK });
	EXPECT(DB_CMD_START_PROGRAM, 2000 * MS, { 2199, STANDS, PENDING },
	       { 2200, STANDS, .result = DB_RESULT_INDETERMINATE });
	/* Nor is anything known of one that is not told. */
	EXPECT(DB_CMD_START_PROGRAM, 0, { 10, .program_state = UINT16_MAX, STANDS, PENDING },
	       { 200, .program_state = UINT16_MAX, STANDS, .result = DB_RESULT_INDETERMINATE });
}

/* It stands within the window of its target, for as long as is asked for. */
static void a_move_is_there_when_it_has_settled(void **state)
{
	const struct db_follow_config settling = { .window = 5.0,
		                                   .settling = 100 * MS,
		                                   .patience = 200 * MS };
	struct db_feedback feedback = { .status = DB_STATUS_ONLINE,
		                        .state = DB_AXIS_STANDSTILL,
		                        .has_target = true,
		                        .target = 1000 };
	static const struct {
		int ms;
		int32_t position;
		bool moves;
		enum db_result result;
	} samples[] = {
		{ 10, 1005, true, DB_RESULT_PENDING },   { 20, 1005, false, DB_RESULT_PENDING },
		{ 119, 1005, false, DB_RESULT_PENDING }, { 125, 1006, false, DB_RESULT_PENDING },
		{ 130, 995, false, DB_RESULT_PENDING },  { 140, 995, true, DB_RESULT_PENDING },
		{ 150, 995, false, DB_RESULT_PENDING },  { 249, 995, false, DB_RESULT_PENDING },
		{ 250, 995, false, DB_RESULT_OK },
	};
	struct db_follow follow;

	(void)state;
	begin(&follow, DB_CMD_MOVE_ABSOLUTE, NULL, true, 1000 * MS);
	for (size_t i = 0; i < sizeof samples / sizeof samples[0]; i++) {
		feedback.taken = (1000 + samples[i].ms) * MS;
		feedback.position = samples[i].position;
		feedback.status = DB_STATUS_ONLINE | (samples[i].moves ? DB_STATUS_MOVING : 0);
		assert_int_equal(db_follow_check(&follow, &settling, &feedback, feedback.taken),
		                 samples[i].result);
	}
}

/* Of a drive that does not tell its target it is the drive's own bit that says so. */
static void without_a_target_the_drive_says_that_it_is_there(void **state)
{
	struct db_feedback feedback = { .status = DB_STATUS_ONLINE, .state = DB_AXIS_STANDSTILL };
	struct db_follow follow;

	(void)state;
	begin(&follow, DB_CMD_MOVE_RELATIVE, NULL, true, 1000 * MS);
	feedback.taken = 1010 * MS;
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 1010 * MS),
	                 DB_RESULT_PENDING);
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 1209 * MS),
	                 DB_RESULT_PENDING);
	feedback.status |= DB_STATUS_AT_TARGET;
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 1209 * MS), DB_RESULT_OK);
	begin(&follow, DB_CMD_MOVE_RELATIVE, NULL, true, 1000 * MS);
	feedback.status = DB_STATUS_ONLINE;
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 1010 * MS),
	                 DB_RESULT_PENDING);
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 1210 * MS), DB_RESULT_FAILED);
}

/* It has moved, or it was too short for that to be seen. */
static void a_shake_ends_when_it_stands(void **state)
{
	static const enum db_command shakes[] = { DB_CMD_SHAKE_START, DB_CMD_SHAKE_START_TIME };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		EXPECT(shakes[i], 0, { 10, STANDS, PENDING }, { 50, RUNS, PENDING },
		       { 5000, RUNS, PENDING }, { 5010, STANDS, .result = DB_RESULT_OK });
		EXPECT(shakes[i], 0, { 10, STANDS, PENDING }, { 199, STANDS, PENDING },
		       { 200, STANDS, .result = DB_RESULT_OK });
		EXPECT(shakes[i], 0, { 10, RUNS, PENDING },
		       { 20, .state = DB_AXIS_DISABLED, .result = DB_RESULT_CANCELLED });
	}
}

/* In between it may stand, or move in a way that its state does not call homing. */
static void homing_goes_on_while_either_shows(void **state)
{
	struct db_feedback feedback = { .taken = 10 * MS };
	struct db_follow follow;

	(void)state;
	begin(&follow, DB_CMD_HOME, NULL, true, MS);
	feedback.status = DB_STATUS_ONLINE | DB_STATUS_HOMED;
	feedback.state = DB_AXIS_HOMING;
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 10 * MS), DB_RESULT_PENDING);
	feedback.status |= DB_STATUS_MOVING;
	feedback.state = DB_AXIS_DISCRETE_MOTION;
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 10 * MS), DB_RESULT_PENDING);
	feedback.status = DB_STATUS_ONLINE | DB_STATUS_HOMED;
	feedback.state = DB_AXIS_STANDSTILL;
	assert_int_equal(db_follow_check(&follow, &config, &feedback, 10 * MS), DB_RESULT_OK);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(data_of_the_moment_of_the_command_show_nothing),
		cmocka_unit_test(a_speed_without_proof_shows_later),
		cmocka_unit_test(what_goes_on_for_ever_and_stands_has_failed),
		cmocka_unit_test(what_was_taken_without_proof_and_never_begins_has_failed),
		cmocka_unit_test(homing_may_end_late),
		cmocka_unit_test(homing_goes_on_while_either_shows),
		cmocka_unit_test(a_program_ends_when_it_is_idle),
		cmocka_unit_test(a_delayed_program_is_waited_for),
		cmocka_unit_test(a_move_is_there_when_it_has_settled),
		cmocka_unit_test(without_a_target_the_drive_says_that_it_is_there),
		cmocka_unit_test(a_shake_ends_when_it_stands),
	};

	return cmocka_run_group_tests_name("axis/follow", tests, NULL, NULL);
}
