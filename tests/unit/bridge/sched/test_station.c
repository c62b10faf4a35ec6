/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One drive on a bus: its command of several exchanges and their repeats, the questions for its
 * parameters, and its figures. Made-up drives in made-up time.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	unsigned lose[FAKE_KINDS]; /* number of the next frames of this kind that are lost */
	bool has_no_parameters;
	db_time answer_time;
};

/* --- a family with a command of two exchanges, and a question when the second one is lost ----- */

static enum db_result ending; /* of commands */

static enum db_step begin(struct db_conversation *talk)
{
	enum db_step step = fake_family.begin(talk);

	return fake_kind_of(talk->job) == FAKE_COMMAND ? fake_say(talk, FAKE_PREPARE) : step;
}

static enum db_step answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	struct fake_frame frame = fake_frame_at(bytes, length);
	enum db_step step;

	if (fake_kind_of(talk->job) == FAKE_COMMAND) {
		if (frame.kind == FAKE_PREPARE)
			return fake_say(talk, FAKE_BEGIN);
		talk->result = ending;
		return frame.kind == FAKE_BEGIN || frame.kind == FAKE_LOOK ? DB_STEP_DONE :
		                                                             DB_STEP_IGNORE;
	}
	step = fake_family.answer(talk, bytes, length);
	talk->device->identified &= !frame.refused;
	return step;
}

static enum db_step lost(struct db_conversation *talk)
{
	if (fake_frame_at(talk->exchange->request, talk->exchange->request_length).kind ==
	    FAKE_BEGIN)
		return fake_say(talk, FAKE_LOOK);
	return fake_family.lost(talk);
}

static db_time obey(void *context, struct fake_frame *frame)
{
	struct world *world = context;

	if (world->lose[frame->kind] > 0) {
		world->lose[frame->kind]--;
		return 0;
	}
	frame->refused = frame->kind == FAKE_IDENTIFY && world->has_no_parameters;
	return world->answer_time;
}

static struct world *open_world(bool has_no_parameters)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->has_no_parameters = has_no_parameters;
	world->answer_time = FAKE_ANSWER_TIME;
	ending = DB_RESULT_OK;
	world->driver = fake_family;
	world->driver.begin = begin;
	world->driver.answer = answer;
	world->driver.lost = lost;
	world->bus = fake_bus_new(&world->driver, 1);
	world->bus->context = world;
	world->bus->obey = obey;
	fake_bus_open(world->bus, 1, NULL);
	fake_port(world->bus, 0);
	return world;
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

static enum db_result run_command(struct world *world)
{
	fake_pass(world->bus, 300 * MS);
	fake_forget_sent(world->bus);
	fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(world->bus, 300 * MS);
	return fake_result(world->bus);
}

/* --- commands --------------------------------------------------------------------------------- */

static void each_exchange_of_a_command_is_repeated_as_often_as_configured(void **state)
{
	struct world *world = open_world(false);

	(void)state;
	world->bus->config.retries = 2;
	world->lose[FAKE_PREPARE] = 1;
	world->lose[FAKE_BEGIN] = 2;
	assert_int_equal(run_command(world), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 2);
	assert_int_equal(fake_count(world->bus, 1, FAKE_BEGIN), 3);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 0);
	assert_int_equal(fake_snapshot(world->bus, 0).stats.retries, 3);
	close_world(world);
}

static void a_question_after_a_loss_is_repeated_as_often_as_configured(void **state)
{
	struct world *world = open_world(false);

	(void)state;
	world->bus->config.retries = 2;
	world->lose[FAKE_BEGIN] = 3;
	world->lose[FAKE_LOOK] = 2;
	assert_int_equal(run_command(world), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_BEGIN), 3);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 3);
	close_world(world);
}

static void what_is_lost_more_often_ends_the_command(void **state)
{
	struct world *world = open_world(false);

	(void)state;
	world->bus->config.retries = 1;
	world->lose[FAKE_PREPARE] = 2;
	assert_int_equal(run_command(world), DB_RESULT_TIMEOUT);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 2);
	assert_int_equal(fake_count(world->bus, 1, FAKE_BEGIN), 0);
	close_world(world);
}

/* --- parameters ------------------------------------------------------------------------------- */

static void a_drive_that_does_not_report_its_parameters_is_asked_ever_less_often(void **state)
{
	struct world *world = open_world(true);
	db_time pause = 500 * MS;
	db_time last = 0;
	unsigned asked = 0;

	(void)state;
	fake_pass(world->bus, 100 * DB_NS_PER_S);
	for (size_t i = 0; i < world->bus->sent_count; i++) {
		if (world->bus->sent[i].frame.kind != FAKE_IDENTIFY)
			continue;
		if (asked++ > 0) {
			/* It is asked when a cycle begins, or in between. */
			assert_in_range(world->bus->sent[i].at - last, pause, pause + 25 * MS);
			pause = 2 * pause < 30 * DB_NS_PER_S ? 2 * pause : 30 * DB_NS_PER_S;
		}
		last = world->bus->sent[i].at;
	}
	/* After 0, 0.5, 1, 2, 4, 8, 16, 30 and 30 s. */
	assert_int_equal(asked, 9);
	close_world(world);
}

static void a_drive_that_returns_is_asked_at_once(void **state)
{
	struct world *world = open_world(true);

	(void)state;
	fake_pass(world->bus, 20 * DB_NS_PER_S);
	fake_port(world->bus, 5);
	fake_pass(world->bus, 100 * MS);
	fake_forget_sent(world->bus);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 1100 * MS);
	/* At once, and again after half a second: the pauses begin anew, too. */
	assert_int_equal(fake_count(world->bus, 1, FAKE_IDENTIFY), 2);
	close_world(world);
}

/* What it does not answer is left out, and the rest asked for. */
static enum db_step leave_out(struct db_conversation *talk)
{
	if (fake_frame_at(talk->exchange->request, talk->exchange->request_length).kind ==
	    FAKE_IDENTIFY)
		return fake_say(talk, FAKE_LOOK);
	return fake_family.lost(talk);
}

static enum db_step answer_rest(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	if (fake_frame_at(bytes, length).kind != FAKE_LOOK)
		return fake_family.answer(talk, bytes, length);
	talk->device->identified = true;
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

static void parameters_that_are_not_answered_are_left_out(void **state)
{
	struct world *world = open_world(false);

	(void)state;
	fake_bus_free(world->bus);
	world->driver.begin = fake_family.begin;
	world->driver.answer = answer_rest;
	world->driver.lost = leave_out;
	world->lose[FAKE_IDENTIFY] = 1000;
	world->bus = fake_bus_new(&world->driver, 1);
	world->bus->context = world;
	world->bus->obey = obey;
	fake_bus_open(world->bus, 1, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 400 * MS);
	/* Then the drive is known, and is not asked again. */
	assert_int_equal(fake_count(world->bus, 1, FAKE_IDENTIFY), 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 1);
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_PARAMS_VALID);
	fake_pass(world->bus, 5000 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_IDENTIFY), 1);
	assert_true(fake_is_online(world->bus, 0));
	close_world(world);
}

/* --- what it must stand for ------------------------------------------------------------------- */

static enum db_axis_state told; /* by the drive, which never stops */

static void tell_state(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	feedback->state = (uint16_t)told;
	feedback->status |= DB_STATUS_MOVING;
}

static db_time run_on(void *context, struct fake_frame *frame)
{
	(void)context;
	frame->speed = 100.0f;
	return FAKE_ANSWER_TIME;
}

/* A fault is not hidden by a stop, nor that it has no power; anything else is not standing yet. */
static void what_is_to_stand_is_shown_as_stopping(void **state)
{
	static const struct {
		enum db_axis_state told;
		enum db_axis_state shown;
	} cases[] = {
		{ DB_AXIS_CONTINUOUS_MOTION, DB_AXIS_STOPPING },
		{ DB_AXIS_STANDSTILL, DB_AXIS_STOPPING },
		{ DB_AXIS_ERROR_STOP, DB_AXIS_ERROR_STOP },
		{ DB_AXIS_DISABLED, DB_AXIS_DISABLED },
	};
	struct world *world = open_world(false);

	(void)state;
	world->driver.feedback = tell_state;
	world->bus->obey = run_on;
	told = DB_AXIS_CONTINUOUS_MOTION;
	fake_pass(world->bus, 300 * MS);
	assert_int_equal(fake_feedback(world->bus, 0).state, DB_AXIS_CONTINUOUS_MOTION);
	fake_post(world->bus, 0, DB_CMD_STOP);
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		bool stopping = cases[i].shown == DB_AXIS_STOPPING;

		told = cases[i].told;
		fake_pass(world->bus, 60 * MS);
		assert_int_equal(fake_feedback(world->bus, 0).state, cases[i].shown);
		assert_int_equal(!!(fake_feedback(world->bus, 0).status & DB_STATUS_STOPPING),
		                 stopping);
	}
	/* In the end it runs on, whatever it says. */
	assert_int_not_equal(fake_feedback(world->bus, 0).error, DB_ERROR_RUNS_ON);
	fake_pass(world->bus, 2000 * MS);
	assert_int_equal(fake_feedback(world->bus, 0).error, DB_ERROR_RUNS_ON);
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_ERROR);
	close_world(world);
}

/* A motion that was sent just before the stop may begin after it, unless the drive has answered that
 * it stops. */
static void a_motion_just_before_a_stop_makes_it_doubtful(void **state)
{
	const db_time now = 1000 * DB_NS_PER_S;
	const db_time span = 100 * MS;
	const struct db_drive_config config = { .stop_reaction_ms = 700 };
	struct station station = { .config = &config, .motion_sent = now };
	struct db_driver silent = fake_family;

	(void)state;
	silent.acknowledges = false;
	assert_int_equal(station_rules(&station, &silent, now).patience, 700 * MS);
	assert_int_equal(station_rules(&station, &silent, now).doubt, span);
	assert_int_equal(station_rules(&station, &silent, now + span - 1).doubt, span);
	assert_int_equal(station_rules(&station, &silent, now + span).doubt, 0);
	/* A homing has phases in which it stands. */
	station.snapshot.feedback.status = DB_STATUS_HOMING;
	assert_int_equal(station_rules(&station, &silent, now + span).doubt, span);
	/* What a family acknowledges counts when it was acknowledged. */
	assert_int_equal(station_rules(&station, &fake_family, now + span).doubt, span);
	station.standing.acknowledged = true;
	assert_int_equal(station_rules(&station, &fake_family, now).doubt, 0);
	assert_int_equal(station_rules(&station, &silent, now).doubt, span);
}

/* A program of a controller moves other axes than the one that it was started at: that this one stands
 * does not show that the program will not begin late. */
static void a_motion_that_failed_is_stopped_until_the_controller_answers(void **state)
{
	struct world *world = open_world(false);

	(void)state;
	ending = DB_RESULT_FAILED;
	world->lose[FAKE_STOP] = 12;
	assert_int_equal(run_command(world), DB_RESULT_FAILED);
	while (world->lose[FAKE_STOP] > 0) {
		assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
		fake_pass(world->bus, 100 * MS);
	}
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 13);
	assert_false(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	close_world(world);
}

/* The network thread posts a stop when it hears that another one has ended. What waited there was asked for
 * before that stop, and must not begin meanwhile. */
static void nothing_begins_between_a_stop_and_the_one_that_follows(void **state)
{
	struct world *world = open_world(false);
	struct db_request stop = { .command = DB_CMD_STOP };
	struct db_request *posted;

	(void)state;
	fake_pass(world->bus, 300 * MS);
	stop.submitted = world->bus->now;
	posted = db_queue_post(world->bus->queue, &stop);
	assert_non_null(posted);
	fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	atomic_store(&posted->stop_follows, true);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 0);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 0);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 2);
	while (fake_result(world->bus) != DB_RESULT_NONE)
		;
	/* What comes behind that one begins. */
	fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(world->bus, 300 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 1);
	close_world(world);
}

/* --- figures ---------------------------------------------------------------------------------- */

static void round_trips_are_measured(void **state)
{
	struct world *world = open_world(false);
	struct db_axis_stats stats;

	(void)state;
	fake_pass(world->bus, 500 * MS);
	stats = fake_snapshot(world->bus, 0).stats;
	assert_int_equal(stats.round_trip_us, FAKE_ANSWER_TIME / DB_NS_PER_US);
	assert_int_equal(stats.round_trip_min_us, FAKE_ANSWER_TIME / DB_NS_PER_US);
	assert_int_equal(stats.round_trip_mean_us, FAKE_ANSWER_TIME / DB_NS_PER_US);
	assert_int_equal(stats.round_trip_max_us, FAKE_ANSWER_TIME / DB_NS_PER_US);
	assert_int_equal(stats.requests, stats.answers);
	assert_int_equal(stats.came_online, 1);
	assert_in_range(stats.samples, 24, 26);
	close_world(world);
}

/* Shortest, longest and last one: slower answers first, then quicker ones, then as at first. */
static void round_trips_that_vary_are_measured(void **state)
{
	struct world *world = open_world(false);
	struct db_axis_stats stats;

	(void)state;
	world->answer_time = 2 * FAKE_ANSWER_TIME;
	fake_pass(world->bus, 200 * MS);
	world->answer_time = FAKE_ANSWER_TIME / 2;
	fake_pass(world->bus, 200 * MS);
	world->answer_time = FAKE_ANSWER_TIME;
	fake_pass(world->bus, 200 * MS);
	stats = fake_snapshot(world->bus, 0).stats;
	assert_int_equal(stats.round_trip_us, FAKE_ANSWER_TIME / DB_NS_PER_US);
	assert_int_equal(stats.round_trip_min_us, FAKE_ANSWER_TIME / 2 / DB_NS_PER_US);
	assert_int_equal(stats.round_trip_max_us, 2 * FAKE_ANSWER_TIME / DB_NS_PER_US);
	assert_in_range(stats.round_trip_mean_us, stats.round_trip_min_us + 1,
	                stats.round_trip_max_us - 1);
	close_world(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_exchange_of_a_command_is_repeated_as_often_as_configured),
		cmocka_unit_test(a_question_after_a_loss_is_repeated_as_often_as_configured),
		cmocka_unit_test(what_is_lost_more_often_ends_the_command),
		cmocka_unit_test(
			a_drive_that_does_not_report_its_parameters_is_asked_ever_less_often),
		cmocka_unit_test(a_drive_that_returns_is_asked_at_once),
		cmocka_unit_test(parameters_that_are_not_answered_are_left_out),
		cmocka_unit_test(what_is_to_stand_is_shown_as_stopping),
		cmocka_unit_test(a_motion_just_before_a_stop_makes_it_doubtful),
		cmocka_unit_test(a_motion_that_failed_is_stopped_until_the_controller_answers),
		cmocka_unit_test(nothing_begins_between_a_stop_and_the_one_that_follows),
		cmocka_unit_test(round_trips_are_measured),
		cmocka_unit_test(round_trips_that_vary_are_measured),
	};

	return cmocka_run_group_tests_name("station", tests, NULL, NULL);
}
