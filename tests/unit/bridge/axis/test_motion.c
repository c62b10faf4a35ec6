/* SPDX-License-Identifier: Apache-2.0 */
/* Motions, followed to their end and kept within the limits. */
#include "commander_world.h"

#include "fakes/nameplate.h"

/* --- to their end ----------------------------------------------------------------------------- */

static void result_follows_a_move_to_its_end(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	/* Its writer has his answer; the motion goes on. */
	assert_int_equal(fake.answered_with[0], 0);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_false(look(&fake).results.done);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_DISCRETE_MOTION, DB_STATUS_MOVING, 500);
	let_pass(&fake, 500 * MS);
	assert_false(look(&fake).results.done);
	/* The same id again: it was accepted, and nothing is sent. */
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_ABSOLUTE, 1000), 0);
	assert_int_equal(fake.submitted, 1);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 50 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_true(look(&fake).results.done);
	assert_false(look(&fake).results.aborted);
	assert_false(look(&fake).busy);
	assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
	drop(&fake);
}

/* From the moment it was asked for, whatever the status still shows. */
static void a_motion_is_to_come_until_it_has_ended(void **state)
{
	FAKE(false);
	assert_false(db_commander_is_to_move(fake.commander));
	assert_int_equal(put(&fake, 0, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_false(db_commander_is_to_move(fake.commander));
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_true(db_commander_is_to_move(fake.commander));
	finish(&fake, 1, DB_RESULT_OK);
	assert_true(db_commander_is_to_move(fake.commander));
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 50 * MS);
	assert_false(db_commander_is_to_move(fake.commander));
	drop(&fake);
}

static void old_data_ends_no_move(void **state)
{
	FAKE(false);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_AT_TARGET, 1000);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	fake.now += MS;
	finish(&fake, 0, DB_RESULT_OK);
	let_pass(&fake, 1000 * MS);
	assert_false(look(&fake).results.done);
	drop(&fake);
}

static void a_move_that_stops_elsewhere_has_failed(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	let_pass(&fake, 190 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	let_pass(&fake, 60 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_false(look(&fake).results.done);
	drop(&fake);
}

/* The log says how near it came, so that somebody knows what to set. */
static void a_move_that_rests_beside_its_target_says_so(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 999);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	assert_true(fake.refused_write.off < -0.5 && fake.refused_write.off > -1.5);
	/* That far it was stopped by something. */
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	drop(&fake);
}

/* Of relative moves as well, and of nothing else: homing has no target. */
static void what_rests_beside_its_target_is_a_move(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1001);
	let_pass(&fake, 300 * MS);
	assert_int_equal(fake.refused, 1);
	assert_true(fake.refused_write.off > 0.5 && fake.refused_write.off < 1.5);
	assert_int_equal(fake.refused_write.command, DB_CMD_MOVE_RELATIVE);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1001);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	/* One with a fault did not come to rest there. */
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_ERROR_STOP, 0, 1001);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	drop(&fake);
}

/* A bit that says "there" may be of the last target, or of the reference only. */
static void no_bit_ends_a_move_elsewhere(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_AT_TARGET, 0);
	let_pass(&fake, 250 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_false(look(&fake).results.done);
	drop(&fake);
}

static void another_command_does_not_hide_the_end(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_SET_OUTPUT, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

static void a_shake_is_done_when_it_has_moved(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_SHAKE_START, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 0);
	let_pass(&fake, 50 * MS);
	assert_false(look(&fake).results.done);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 5);
	let_pass(&fake, 50 * MS);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 0);
	let_pass(&fake, 50 * MS);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

static void homing_ends_homed_or_failed(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_HOMING, 0, 5);
	let_pass(&fake, 100 * MS);
	assert_false(look(&fake).results.done);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_HOMED, 0);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_true(look(&fake).results.done);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 3);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	drop(&fake);
}

static void home_and_fail(struct fake *fake, unsigned request)
{
	assert_int_equal(put(fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(fake, request, DB_RESULT_OK);
	fake->now += MS;
	set_axis(fake, DB_AXIS_STANDSTILL, 0, 3);
	let_pass(fake, 100 * MS);
	assert_int_equal(look(fake).results.motion_result, DB_RESULT_FAILED);
	assert_int_equal(entry_of(fake, 0).result, DB_RESULT_FAILED);
}

/* It stood for long between two phases, and was not at its end. */
static void a_late_end_of_homing_corrects_its_result(void **state)
{
	FAKE(false);
	home_and_fail(&fake, 0);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 2);
	let_pass(&fake, 5000 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_FAILED);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_HOMED, 0);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_OK);
	assert_true(look(&fake).results.done);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_OK);
	/* One that was stopped since has not come to its end. */
	home_and_fail(&fake, 1);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_HOMED, 0);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_FAILED);
	drop(&fake);
}

/* Ten counts a unit: -5..100 units, 20 units per second. The drive stands at 500 counts. */
static void a_speed_that_never_begins_has_failed_and_is_stopped(void **state)
{
	FAKE(false);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_UNPROVEN);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, 0, 3);
	let_pass(&fake, 900 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(fake.submitted, 1);
	let_pass(&fake, 200 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_FAILED);
	/* It may not begin any more. */
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[1].cause, DB_STAND_MOTION);
	assert_int_equal(entry_of(&fake, 1).result, DB_RESULT_FAILED);
	/* One that is seen to begin is left alone. */
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, DB_CMD_JOG_POSITIVE, 0), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_UNPROVEN);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 3);
	let_pass(&fake, 3000 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

/* --- one behind another ----------------------------------------------------------------------- */

static void a_new_command_aborts_the_motion(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 8, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_true(look(&fake).results.aborted);
	assert_int_equal(look(&fake).results.aborted_id, 7);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result_id, 8);
	assert_false(look(&fake).results.done);
	/* What moves nothing aborts nothing. */
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_false(look(&fake).results.aborted);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(put(&fake, 10, DB_CMD_READ_PARAMETERS, 0), DB_WRITE_LATER);
	assert_false(look(&fake).results.aborted);
	drop(&fake);
}

/* The drive turned the second one down: the first goes on, and its end is told. */
static void a_refused_motion_leaves_the_one_before(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_DISCRETE_MOTION, DB_STATUS_MOVING, 500);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_ABSOLUTE, 2000), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(look(&fake).results.result_id, 8);
	assert_int_equal(look(&fake).results.result, DB_RESULT_REFUSED);
	assert_false(look(&fake).results.aborted);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	/* `done` is about what was asked for last: who waits for id 8 must not take it for its own. */
	assert_false(look(&fake).results.done);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result, DB_RESULT_REFUSED);
	drop(&fake);
}

/* The one that was asked for last is the one whose end is awaited. */
static void a_refused_motion_leaves_the_one_behind_it(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 500), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_REFUSED);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.motion_id, 8);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

/* It was refused before the one that was asked for first had begun: whoever waits for it must not take
 * the other one's end for its own. */
static void a_motion_refused_in_between_is_the_newest(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	fake.drive.max_position = 100.0;
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_ABSOLUTE, 1001), ILLEGAL_VALUE);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result_id, 8);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_OK);
	assert_false(look(&fake).results.done);
	/* The next one is, again. */
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

static void a_motion_is_aborted_when_the_drive_takes_the_next(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	/* It would be there, but whether the next one has begun is open: nothing is said yet. */
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 300 * MS);
	assert_false(look(&fake).results.done);
	assert_int_equal(look(&fake).results.motion_id, 7);
	finish(&fake, 1, DB_RESULT_OK);
	assert_true(look(&fake).results.aborted);
	assert_int_equal(look(&fake).results.aborted_id, 7);
	assert_int_equal(look(&fake).results.motion_id, 8);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	/* Nobody knows whether this one moves it: then the one before is over. */
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_INDETERMINATE);
	assert_int_equal(look(&fake).results.motion_id, 8);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_CANCELLED);
	drop(&fake);
}

/* A stop was sent behind it: that it was begun in between is no motion that goes on. */
static void a_motion_that_a_stop_overtook_is_over(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 8, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_CANCELLED);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_false(look(&fake).results.done);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_CANCELLED);
	drop(&fake);
}

/* --- jogs towards a limit --------------------------------------------------------------------- */

/* Ten counts a unit; 100 counts/s take it some 5 counts further before it hears a stop. */
static void a_jog_is_held_back_before_a_limit(void **state)
{
	FAKE(false);
	fake.drive.max_position = 100.0;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 950);
	let_pass(&fake, 50 * MS);
	assert_int_equal(fake.submitted, 1);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 994);
	let_pass(&fake, 50 * MS);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(look(&fake).results.result_limit, DB_LIMIT_MAX_POSITION);
	finish(&fake, 1, DB_RESULT_OK);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 998);
	let_pass(&fake, 2 * DB_NS_PER_S);
	assert_int_equal(fake.submitted, 2);
	/* A move to a position has been checked, and is not watched. */
	assert_int_equal(move(&fake, DB_CMD_MOVE_ABSOLUTE, 1000, 50.0f), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	set_axis(&fake, DB_AXIS_DISCRETE_MOTION, DB_STATUS_MOVING, 999);
	let_pass(&fake, 200 * MS);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

/* Two cycles and the time of a command: no more than the drive may need to hear of it. */
static void a_jog_is_not_held_back_too_early(void **state)
{
	FAKE(false);
	fake.drive.max_position = 100.0;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 900);
	wake(&fake);
	/* In 50 ms it goes 5 counts. */
	fake.now = db_commander_next_deadline(fake.commander);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 994);
	wake(&fake);
	assert_int_equal(fake.submitted, 1);
	fake.now = db_commander_next_deadline(fake.commander);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 995);
	wake(&fake);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

/* Begins a jog towards 1000 counts, at 100 counts/s. */
static void jog(struct fake *fake)
{
	fake->drive.max_position = 100.0;
	set_axis(fake, DB_AXIS_STANDSTILL, 0, 900);
	assert_int_equal(move(fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(fake, fake->submitted - 1, DB_RESULT_OK);
	fake->now += MS;
	set_axis(fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 900);
	wake(fake);
}

/* Looks once, at data of this moment. */
static void pass_by(struct fake *fake, uint32_t status, int32_t position)
{
	fake->now = db_commander_next_deadline(fake->commander);
	set_axis(fake, DB_AXIS_CONTINUOUS_MOTION, status, position);
	wake(fake);
}

/* Its target was checked. */
static void a_move_behind_a_jog_is_not_watched(void **state)
{
	FAKE(false);
	jog(&fake);
	assert_int_equal(move(&fake, DB_CMD_MOVE_ABSOLUTE, 1000, 100.0f), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	pass_by(&fake, DB_STATUS_MOVING, 999);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

/* What a drive that does not answer said last is not what it does. */
static void data_of_before_stop_no_jog(void **state)
{
	struct db_snapshot snapshot = { .feedback = { .status = DB_STATUS_BUS_UP | DB_STATUS_MOVING,
		                                      .state = DB_AXIS_OFFLINE,
		                                      .position = 999,
		                                      .velocity = 100.0f } };

	FAKE(false);
	jog(&fake);
	snapshot.feedback.taken = fake.now;
	db_axis_publish(fake.axis, &snapshot);
	let_pass(&fake, 100 * MS);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

/* As far as it went after the last stop, it may go after the next one. */
static void a_stop_by_a_client_is_measured(void **state)
{
	FAKE(false);
	jog(&fake);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += 500 * MS;
	/* 50 counts. */
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 950);
	let_pass(&fake, 50 * MS);
	jog(&fake);
	assert_int_equal(fake.submitted, 3);
	pass_by(&fake, DB_STATUS_MOVING, 940);
	assert_int_equal(fake.submitted, 3);
	pass_by(&fake, DB_STATUS_MOVING, 946);
	assert_int_equal(fake.submitted, 4);
	assert_int_equal(fake.requests[3].cause, DB_STAND_LIMIT);
	drop(&fake);
}

static const struct db_param preset_params[] = {
	{ .name = "speed", .type = DB_F32, .unit = "", .min = -1000, .max = 1000 },
};

static struct db_driver presetting; /* its first parameter is the speed of moves without one */

/* Half of the square of its speed by its deceleration. */
static void a_known_deceleration_is_allowed_for(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate;
	struct db_commander_config config;

	FAKE(false);
	presetting = driver;
	presetting.params = preset_params;
	presetting.param_count = 1;
	presetting.deceleration_param = 0;
	config = config_of(&fake);
	config.driver = &presetting;
	remake(&fake, &config);
	/* 400 counts/s^2: 12.5 counts, and 5 in the time until it hears of the stop. */
	plate = fake_nameplate(&room, 1);
	plate.values[0].f = 400.0f;
	db_axis_publish_nameplate(fake.axis, &plate);
	jog(&fake);
	pass_by(&fake, DB_STATUS_MOVING, 982);
	assert_int_equal(fake.submitted, 1);
	pass_by(&fake, DB_STATUS_MOVING, 983);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(result_follows_a_move_to_its_end),
		cmocka_unit_test(a_motion_is_to_come_until_it_has_ended),
		cmocka_unit_test(old_data_ends_no_move),
		cmocka_unit_test(a_move_that_stops_elsewhere_has_failed),
		cmocka_unit_test(a_move_that_rests_beside_its_target_says_so),
		cmocka_unit_test(what_rests_beside_its_target_is_a_move),
		cmocka_unit_test(no_bit_ends_a_move_elsewhere),
		cmocka_unit_test(another_command_does_not_hide_the_end),
		cmocka_unit_test(a_shake_is_done_when_it_has_moved),
		cmocka_unit_test(homing_ends_homed_or_failed),
		cmocka_unit_test(a_late_end_of_homing_corrects_its_result),
		cmocka_unit_test(a_speed_that_never_begins_has_failed_and_is_stopped),
		cmocka_unit_test(a_new_command_aborts_the_motion),
		cmocka_unit_test(a_refused_motion_leaves_the_one_before),
		cmocka_unit_test(a_refused_motion_leaves_the_one_behind_it),
		cmocka_unit_test(a_motion_refused_in_between_is_the_newest),
		cmocka_unit_test(a_motion_is_aborted_when_the_drive_takes_the_next),
		cmocka_unit_test(a_motion_that_a_stop_overtook_is_over),
		cmocka_unit_test(a_jog_is_held_back_before_a_limit),
		cmocka_unit_test(a_jog_is_not_held_back_too_early),
		cmocka_unit_test(a_move_behind_a_jog_is_not_watched),
		cmocka_unit_test(data_of_before_stop_no_jog),
		cmocka_unit_test(a_stop_by_a_client_is_measured),
		cmocka_unit_test(a_known_deceleration_is_allowed_for),
	};

	return cmocka_run_group_tests_name("motion", tests, NULL, NULL);
}
