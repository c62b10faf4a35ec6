/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A stop is done when the drive stops: drives that take it and do not, slow down for long, reverse,
 * or begin to move after it, in made-up time.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 4
#define LATENCY (100 * MS)
#define MS DB_NS_PER_MS
#define TOP_SPEED 1000.0f
/* Marks a frame that its drive obeys and does not answer. */
#define FAKE_UNANSWERED 3

/* The drive's side. */
struct drive {
	float speed;
	float target_speed;
	float ramp; /* per ms */
	bool powered;
	unsigned deaf; /* to so many stops: they are acknowledged and nothing happens */
	bool deaf_to_disable;
	bool silent_to_disable; /* it does not even answer that */
	db_time moves_at;       /* a motion that was taken and does not show yet; 0: none */
	db_time delay;          /* from taking a motion to showing it */
};

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	struct drive sim[DRIVES];
	db_time motors_at; /* when they run next */
	db_time answer_time;
};

static db_time obey(void *context, struct fake_frame *frame)
{
	struct world *world = context;
	struct drive *drive = &world->sim[frame->address - 1];

	if (frame->kind == FAKE_DISABLE && drive->silent_to_disable)
		return 0;
	if (frame->kind == FAKE_COMMAND) {
		drive->powered = true;
		drive->moves_at = world->bus->now + drive->delay;
	} else if (frame->kind == FAKE_STOP && drive->deaf > 0) {
		drive->deaf--;
	} else if (frame->kind == FAKE_STOP) {
		drive->target_speed = 0;
		drive->moves_at = 0;
	} else if (frame->kind == FAKE_DISABLE && !drive->deaf_to_disable) {
		drive->powered = false;
		drive->target_speed = drive->speed = 0;
	}
	frame->powered = drive->powered;
	frame->speed = drive->speed;
	if (frame->axis == FAKE_UNANSWERED)
		return 0;
	return world->answer_time;
}

static void run_motor(struct drive *drive, db_time now)
{
	float ramp = drive->ramp > 0 ? drive->ramp : TOP_SPEED;
	float way;

	if (drive->moves_at != 0 && now >= drive->moves_at) {
		drive->target_speed = TOP_SPEED;
		drive->moves_at = 0;
	}
	way = drive->target_speed - drive->speed;
	drive->speed += fabsf(way) < ramp ? way : copysignf(ramp, way);
}

static db_time motors_at(void *context)
{
	return ((const struct world *)context)->motors_at;
}

/* Each millisecond. */
static void run_motors(void *context)
{
	struct world *world = context;

	if (world->bus->now < world->motors_at)
		return;
	world->motors_at = (world->bus->now / MS + 1) * MS;
	for (size_t i = 0; i < DRIVES; i++)
		run_motor(&world->sim[i], world->bus->now);
}

static struct world *make_world(enum db_medium medium, bool acknowledges)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->driver.medium = medium;
	world->driver.acknowledges = acknowledges;
	world->answer_time = 2 * MS;
	world->bus = fake_bus_new(&world->driver, DRIVES);
	world->bus->context = world;
	world->bus->obey = obey;
	world->bus->next = motors_at;
	world->bus->happen = run_motors;
	world->bus->config.drive_latency_ms = LATENCY / MS;
	return world;
}

static void open_bus(struct world *world, unsigned stop_reaction_ms)
{
	for (size_t i = 0; i < DRIVES; i++)
		world->bus->drives[i].stop_reaction_ms = stop_reaction_ms;
	fake_bus_open(world->bus, DRIVES, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 300 * MS);
}

static struct world *open_world_on(enum db_medium medium, bool acknowledges)
{
	struct world *world = make_world(medium, acknowledges);

	open_bus(world, 500);
	return world;
}

static struct world *open_world(bool acknowledges)
{
	return open_world_on(DB_MEDIUM_SERIAL, acknowledges);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

static struct world *moving(bool acknowledges)
{
	struct world *world = open_world(acknowledges);

	fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_true(fake_feedback(world->bus, 0).velocity == TOP_SPEED);
	return world;
}

/* --- what is told ----------------------------------------------------------------------------------- */

static void a_drive_that_stands_is_stopped_at_once(void **state)
{
	struct world *world = open_world(true);

	(void)state;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	close_world(world);
}

/* A client that has the result of its stop must see in the same moment that the drive is free. */
static void a_confirmed_stop_frees_the_drive_with_its_result(void **state)
{
	struct world *world = open_world(true);
	enum db_result result = DB_RESULT_NONE;

	(void)state;
	fake_post(world->bus, 0, DB_CMD_STOP);
	for (unsigned i = 0; i < 200 && result == DB_RESULT_NONE; i++) {
		fake_pass(world->bus, MS / 10);
		result = fake_result(world->bus);
	}
	assert_int_equal(result, DB_RESULT_OK);
	assert_false(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	close_world(world);
}

/* The first disable is on the wire when the second one is posted: its answer proves nothing about
 * the second one, which is sent, too. */
static void a_disable_is_not_done_by_the_answer_to_an_earlier_one(void **state)
{
	struct world *world = moving(true);
	enum db_result result = DB_RESULT_NONE;
	db_time sent;

	(void)state;
	world->answer_time = 20 * MS;
	fake_post(world->bus, 0, DB_CMD_DISABLE);
	for (unsigned i = 0; i < 1000 && fake_count(world->bus, 1, FAKE_DISABLE) == 0; i++)
		fake_pass(world->bus, MS / 2);
	sent = world->bus->now;
	fake_post(world->bus, 0, DB_CMD_DISABLE);
	for (unsigned i = 0; i < 1000 && result == DB_RESULT_NONE; i++) {
		fake_pass(world->bus, MS);
		result = fake_result(world->bus);
	}
	assert_int_equal(result, DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_DISABLE), 2);
	assert_true(world->bus->now >= sent + 39 * MS);
	close_world(world);
}

static void a_stop_that_is_lost_is_said_again_and_not_confirmed(void **state)
{
	for (int acknowledges = 0; acknowledges < 2; acknowledges++) {
		struct world *world = moving(acknowledges);

		(void)state;
		world->sim[0].deaf = 5;
		fake_post(world->bus, 0, DB_CMD_STOP);
		fake_pass(world->bus, 30 * MS);
		assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
		assert_true(fake_count(world->bus, 1, FAKE_STOP) >= 2);
		fake_pass(world->bus, 300 * MS);
		assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
		assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 6);
		assert_true(world->sim[0].speed == 0.0f);
		assert_int_equal(world->bus->told[DB_EVENT_DRIVE_RUNS_ON], 0);
		close_world(world);
	}
}

static void a_drive_that_runs_on_is_told_of_and_told_on(void **state)
{
	struct world *world = moving(true);
	db_time begun = world->bus->now;
	enum db_result result;
	unsigned heard;

	(void)state;
	world->sim[0].deaf = 1000;
	fake_post(world->bus, 0, DB_CMD_QUICK_STOP);
	fake_pass(world->bus, 450 * MS);
	while ((result = fake_result(world->bus)) == DB_RESULT_NONE &&
	       world->bus->now < begun + 650 * MS)
		fake_pass(world->bus, MS / 10);
	assert_int_equal(result, DB_RESULT_RUNS_ON);
	assert_true(world->bus->now > begun + 450 * MS);
	/* Who has the result finds it in the registers. */
	assert_int_equal(world->bus->told[DB_EVENT_DRIVE_RUNS_ON], 1);
	assert_int_equal(fake_feedback(world->bus, 0).error, DB_ERROR_RUNS_ON);
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_ERROR);
	heard = fake_count(world->bus, 1, FAKE_STOP);
	fake_pass(world->bus, 5000 * MS);
	assert_in_range(fake_count(world->bus, 1, FAKE_STOP) - heard, 40, 70);
	assert_int_equal(fake_count(world->bus, 1, FAKE_DISABLE), 0);
	assert_int_equal(world->bus->told[DB_EVENT_DRIVE_RUNS_ON], 1);
	/* Who asks again is told the same, and not left waiting. */
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	/* The other drive's cycle goes on as ever. */
	assert_true(fake_feedback(world->bus, 1).taken > world->bus->now - 30 * MS);
	world->sim[0].deaf = 0;
	fake_pass(world->bus, 700 * MS);
	assert_int_equal(fake_feedback(world->bus, 0).error, DB_ERROR_NONE);
	heard = fake_count(world->bus, 1, FAKE_STOP);
	fake_pass(world->bus, 2000 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), heard);
	close_world(world);
}

static void the_last_resort_is_taken_where_it_is_configured(void **state)
{
	struct world *world = open_world(true);

	(void)state;
	world->bus->drives[0].on_stop_failure = DB_ON_STOP_FAILURE_DISABLE;
	fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	world->sim[0].deaf = 1000;
	world->sim[0].deaf_to_disable = true;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 2000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	assert_true(fake_count(world->bus, 1, FAKE_DISABLE) >= 2);
	world->sim[0].deaf_to_disable = false;
	fake_pass(world->bus, 1000 * MS);
	assert_true(world->sim[0].speed == 0.0f);
	assert_int_equal(fake_feedback(world->bus, 0).error, DB_ERROR_NONE);
	close_world(world);
}

static void a_disable_does_not_wait_for_a_stop_without_effect(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].deaf = 1000;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 30 * MS);
	fake_post(world->bus, 0, DB_CMD_DISABLE);
	fake_pass(world->bus, 15 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_DISABLE), 1);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

/* It answers all others: it is there, and its motor has power when its time is over. */
static void a_disable_that_is_never_answered_is_told_in_time(void **state)
{
	struct world *world = moving(true);
	db_time begun = world->bus->now;
	enum db_result result;

	(void)state;
	world->sim[0].silent_to_disable = true;
	fake_post(world->bus, 0, DB_CMD_DISABLE);
	while ((result = fake_result(world->bus)) == DB_RESULT_NONE &&
	       world->bus->now < begun + 5000 * MS)
		fake_pass(world->bus, MS);
	assert_int_equal(result, DB_RESULT_RUNS_ON);
	assert_true(world->bus->now < begun + 2000 * MS);
	assert_true(fake_is_online(world->bus, 0));
	close_world(world);
}

/* The drive answers the enable after the disable has joined. */
static void a_disable_is_not_undone_by_the_enable_on_the_wire(void **state)
{
	struct world *world = open_world(true);

	(void)state;
	world->answer_time = 20 * MS;
	fake_pass(world->bus, 100 * MS);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	while (fake_count(world->bus, 1, FAKE_COMMAND) == 0)
		fake_pass(world->bus, MS / 2);
	fake_post(world->bus, 0, DB_CMD_DISABLE);
	fake_pass(world->bus, 300 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_DISABLE), 1);
	assert_false(world->sim[0].powered);
	assert_true(fake_result(world->bus) != DB_RESULT_NONE);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

static void a_long_deceleration_is_no_failure(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].ramp = TOP_SPEED / 10000; /* ten seconds */
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 700 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	fake_pass(world->bus, 11000 * MS);
	assert_int_equal(world->bus->told[DB_EVENT_DRIVE_RUNS_ON], 0);
	assert_true(world->sim[0].speed == 0.0f);
	close_world(world);
}

/* Saying it again does not take the time in which the stand could be read. */
static void a_slow_drive_is_read_between_two_stops(void **state)
{
	struct world *world = moving(true);
	unsigned polls;

	(void)state;
	world->answer_time = 60 * MS;
	fake_pass(world->bus, 500 * MS);
	polls = fake_count(world->bus, 1, FAKE_POLL);
	world->sim[0].deaf = 1;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 2);
	assert_true(fake_count(world->bus, 1, FAKE_POLL) - polls > 3);
	close_world(world);
}

/* Three drives move. All but `one` ignore their stops, which are sent again and again: together
 * with the readings after them they could fill the line. */
static struct world *all_that_do_not_stop_but(unsigned one)
{
	struct world *world = open_world(true);

	for (unsigned i = 0; i < 3; i++)
		fake_post(world->bus, i, DB_CMD_MOVE_VELOCITY);
	fake_pass(world->bus, 200 * MS);
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	for (unsigned i = 0; i < 3; i++) {
		if (i == one)
			continue;
		world->sim[i].deaf = 100000;
		world->bus->drives[i].stop_reaction_ms = 10000;
		fake_post(world->bus, i, DB_CMD_STOP);
	}
	world->answer_time = 30 * MS;
	fake_pass(world->bus, 500 * MS);
	fake_forget_sent(world->bus);
	return world;
}

static void one_that_moves_is_read_between_stops_without_effect(void **state)
{
	struct world *world = all_that_do_not_stop_but(2);
	db_time read = world->bus->now;

	(void)state;
	fake_pass(world->bus, 5000 * MS);
	for (size_t i = 0; i < world->bus->sent_count; i++) {
		const struct fake_sent *sent = &world->bus->sent[i];

		if (sent->frame.address != 3)
			continue;
		assert_int_equal(sent->frame.kind, FAKE_POLL);
		/* Every second exchange is another one's, and the three take turns. */
		assert_true(sent->at - read <= 180 * MS);
		read = sent->at;
	}
	/* It pays for that as for any reading while it moves. */
	while (!world->bus->engine->nodes[2]->flight.station)
		fake_pass(world->bus, MS);
	assert_int_equal(world->bus->engine->nodes[2]->flight.share, DB_SHARE_MOVING);
	/* And those are told to stop as often as before. */
	assert_true(fake_count(world->bus, 1, FAKE_STOP) >= 18);
	assert_true(fake_count(world->bus, 2, FAKE_STOP) >= 18);
	close_world(world);
}

/* Also where standing drives are read as often as others in the cycle: what is read instead of saying a stop again is
 * another one that moves, never one that stands, nor the one whose stop was said just now. */
static void stops_without_effect_are_said_as_often_where_all_are_read_evenly(void **state)
{
	struct world *world = all_that_do_not_stop_but(2);

	(void)state;
	world->bus->config.polls_evenly = true;
	fake_pass(world->bus, 5000 * MS);
	assert_true(fake_count(world->bus, 1, FAKE_STOP) + fake_count(world->bus, 2, FAKE_STOP) >=
	            55);
	close_world(world);
}

/* All three ignore their stops: each is sent its stop equally often. */
static void drives_that_do_not_obey_take_turns(void **state)
{
	struct world *world = all_that_do_not_stop_but(DRIVES);

	(void)state;
	fake_pass(world->bus, 5000 * MS);
	for (unsigned address = 1; address <= 3; address++)
		assert_in_range(fake_count(world->bus, address, FAKE_STOP), 26, 29);
	close_world(world);
}

static void a_stop_that_was_never_said_waits_for_no_reading(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 60; i++) {
		struct world *world = all_that_do_not_stop_but(i % 3);
		const struct fake_sent *next;

		fake_pass(world->bus, (50 + 6 * i) * MS);
		fake_forget_sent(world->bus);
		fake_post(world->bus, i % 3, DB_CMD_STOP);
		fake_pass(world->bus, 31 * MS);
		assert_true(world->bus->sent_count > 0);
		next = &world->bus->sent[0];
		assert_int_equal(next->frame.address, i % 3 + 1);
		assert_int_equal(next->frame.kind, FAKE_STOP);
		close_world(world);
	}
}

/* So many stops are said in two seconds to the first drive, which does not obey, and to the second one, which is gone where
 * it must stop, too. */
static void count_stops(bool gone, unsigned *first, unsigned *second)
{
	struct world *world = moving(true);

	world->bus->drives[0].stop_reaction_ms = 10000;
	world->sim[0].deaf = 100000;
	world->bus->dead[2] = gone;
	fake_pass(world->bus, 3000 * MS);
	assert_int_equal(fake_is_online(world->bus, 1), !gone);
	if (gone)
		fake_post(world->bus, 1, DB_CMD_STOP);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 1000 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 2000 * MS);
	*first = fake_count(world->bus, 1, FAKE_STOP);
	*second = fake_count(world->bus, 2, FAKE_STOP);
	close_world(world);
}

/* It has a fifth of the line at most. */
static void one_that_is_gone_does_not_keep_stops_from_one_that_is_there(void **state)
{
	unsigned alone;
	unsigned beside;
	unsigned gone;

	(void)state;
	count_stops(false, &alone, &gone);
	assert_int_equal(gone, 0);
	count_stops(true, &beside, &gone);
	/* A stop and the wait for its answer take 100 ms. */
	assert_in_range(gone, 2, 2000 / 100 / 5);
	assert_true(beside * 4 >= alone * 3);
}

/* The stop came to nothing, while the motion before it was on its way through zero. */
static void a_reversal_is_no_stop(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].ramp = TOP_SPEED / 100;
	world->sim[0].target_speed = -TOP_SPEED;
	world->sim[0].deaf = 10;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 4000 * MS);
	assert_true(world->sim[0].speed == 0.0f);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 11);
	close_world(world);
}

/* Drives that do not answer: the motion that was just told does not show yet, and the stop is lost. */
static void a_motion_that_does_not_show_yet_is_waited_for(void **state)
{
	struct world *world = open_world(false);

	(void)state;
	world->sim[0].delay = 60 * MS;
	world->sim[0].deaf = 1;
	fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_true(world->sim[0].speed == 0.0f);
	close_world(world);
}

static void another_motion_takes_its_place(void **state)
{
	struct world *world = moving(true);
	unsigned heard;

	(void)state;
	world->sim[0].deaf = 1000;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 700 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(world->bus, 20 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	heard = fake_count(world->bus, 1, FAKE_STOP);
	fake_pass(world->bus, 2000 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), heard);
	assert_int_equal(fake_feedback(world->bus, 0).error, DB_ERROR_NONE);
	close_world(world);
}

static void a_drive_that_returns_moving_is_stopped(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].deaf = 3;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 10 * MS);
	world->bus->dead[1] = true;
	fake_pass(world->bus, 3000 * MS);
	assert_false(fake_feedback(world->bus, 0).status & DB_STATUS_ONLINE);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	world->bus->dead[1] = false;
	fake_pass(world->bus, 3000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_true(world->sim[0].speed == 0.0f);
	close_world(world);
}

static void the_end_waits_until_it_stops(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].deaf = 3;
	db_engine_shut_down(world->bus->engine, world->bus->now);
	fake_pass(world->bus, 20 * MS);
	assert_false(db_engine_is_quiet(world->bus->engine, false));
	fake_pass(world->bus, 300 * MS);
	assert_true(db_engine_is_quiet(world->bus->engine, false));
	assert_true(world->sim[0].speed == 0.0f);
	close_world(world);
}

/* --- several of them -------------------------------------------------------------------------------- */

/* All but the last one do not answer any more, and must stand. */
static struct world *losing(void)
{
	struct world *world = open_world(true);

	for (unsigned i = 0; i < DRIVES - 1; i++) {
		world->bus->dead[i + 1] = true;
		fake_post(world->bus, i, DB_CMD_STOP);
	}
	return world;
}

/* At whichever of the others the round is. */
static void a_first_stop_waits_for_one_exchange(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 2 * DRIVES; i++) {
		struct world *world = losing();

		/* Each of them was sent its own. */
		fake_pass(world->bus, (DRIVES + i) * LATENCY + LATENCY / 2);
		assert_true(fake_count(world->bus, DRIVES - 1, FAKE_STOP) > 0);
		fake_post(world->bus, DRIVES - 1, DB_CMD_STOP);
		fake_pass(world->bus, LATENCY + LATENCY / 10);
		assert_int_equal(fake_count(world->bus, DRIVES, FAKE_STOP), 1);
		close_world(world);
	}
}

static void drives_that_do_not_answer_take_turns(void **state)
{
	struct world *world = losing();
	unsigned first;

	(void)state;
	fake_pass(world->bus, 20 * LATENCY);
	first = fake_count(world->bus, 1, FAKE_STOP);
	assert_true(first > 2);
	for (unsigned i = 1; i < DRIVES - 1; i++)
		assert_in_range(fake_count(world->bus, i + 1, FAKE_STOP), first - 1, first + 1);
	close_world(world);
}

/* --- what drivers may say --------------------------------------------------------------------------- */

/* The ramp of an earlier command looks like that of the stop. When it ends and the drive runs on,
 * that is reported. */
static void the_ramp_of_an_earlier_command_hides_nothing_for_long(void **state)
{
	struct world *world = moving(true);

	(void)state;
	fake_pass(world->bus, 100 * MS);
	while (fake_result(world->bus) != DB_RESULT_NONE)
		;
	world->sim[0].target_speed = TOP_SPEED / 2;
	world->sim[0].ramp = TOP_SPEED / 400;
	world->sim[0].deaf = 100000;
	fake_pass(world->bus, 50 * MS);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(world->bus->told[DB_EVENT_DRIVE_RUNS_ON], 1);
	assert_int_equal(fake_feedback(world->bus, 0).error, DB_ERROR_RUNS_ON);
	close_world(world);
}

/* Says that it moves, whatever its speed is. */
static void tell_moving(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	feedback->status |= DB_STATUS_MOVING;
}

static db_time taken_last; /* time of the last sample that arrives; 0: all samples arrive */

static void tell_late(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	if (taken_last != 0)
		feedback->taken = taken_last;
}

/* A silent axis is passed over when its controller is read: its last sample stays as it was. */
static void a_stop_is_not_judged_by_a_sample_from_before_it(void **state)
{
	struct world *world = open_world(true);

	(void)state;
	world->driver.feedback = tell_late;
	taken_last = fake_feedback(world->bus, 0).taken;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 5000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	taken_last = 0;
	fake_pass(world->bus, 200 * MS);
	assert_false(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	close_world(world);
}

static void moving_at_speed_0_runs_on_and_is_waited_for_no_longer(void **state)
{
	struct world *world = open_world(true);

	(void)state;
	world->driver.feedback = tell_moving;
	fake_pass(world->bus, 50 * MS);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 10 * MS);
	fake_post(world->bus, 0, DB_CMD_SET_POSITION);
	fake_pass(world->bus, 440 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	fake_pass(world->bus, 150 * MS);
	/* In the order of their places in the queue. */
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	assert_int_equal(world->bus->told[DB_EVENT_DRIVE_RUNS_ON], 1);
	close_world(world);
}

/* Where its first drive is, in counts, and where it was when it was read. */
static double place;
static int32_t place_read;
static db_time place_taken;

static void move_on(void *context)
{
	struct world *world = context;
	db_time before = world->motors_at;

	run_motors(world);
	if (world->motors_at != before)
		place += world->sim[0].speed / 1000.0;
}

static void tell_place(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	if (feedback->taken != place_taken)
		place_read = (int32_t)place;
	place_taken = feedback->taken;
	feedback->position = place_read;
	feedback->velocity_is_computed = true;
}

/* Where its speed is computed from positions it is read often enough for that, however long the cycle is. */
static void a_ramp_is_followed_on_a_long_cycle(void **state)
{
	static const float seconds[] = { 0.5f, 1, 2, 5, 10 };

	(void)state;
	for (size_t i = 0; i < sizeof seconds / sizeof seconds[0]; i++) {
		for (db_time wait = 0; wait < 500 * MS; wait += 50 * MS) {
			struct world *world = make_world(DB_MEDIUM_SERIAL, true);

			world->driver.feedback = tell_place;
			world->bus->config.cycle_ms = 500;
			world->bus->happen = move_on;
			place = 0.0;
			open_bus(world, 1000);
			fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
			fake_pass(world->bus, 2000 * MS + wait);
			assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
			world->sim[0].ramp = TOP_SPEED / (1000 * seconds[i]);
			fake_post(world->bus, 0, DB_CMD_STOP);
			fake_pass(world->bus, 12000 * MS);
			assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
			assert_int_equal(world->bus->told[DB_EVENT_DRIVE_RUNS_ON], 0);
			close_world(world);
		}
	}
}

/* Imitates a speed that is computed from rounded positions: at odd positions it is a quarter too
 * low. */
static void tell_trembling(const struct db_device *device, struct db_feedback *feedback)
{
	tell_place(device, feedback);
	if (place_read % 2 != 0)
		feedback->velocity *= 0.75f;
}

/* The computed speed falls again and again, as if the drive slowed down. The drive ignores its
 * stop, and must be reported as running on. */
static void a_computed_speed_that_trembles_is_no_ramp(void **state)
{
	struct world *world = make_world(DB_MEDIUM_CAN, true);

	(void)state;
	world->driver.feedback = tell_trembling;
	world->bus->happen = move_on;
	place = 0.0;
	open_bus(world, 1000);
	fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	world->sim[0].deaf = 1000;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 3000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	close_world(world);
}

static bool take_report(struct db_device *device, const uint8_t *bytes, size_t length, db_time now)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	if (frame.kind != FAKE_REPORT)
		return false;
	device->speed = frame.speed;
	device->taken = now;
	return true;
}

/* It may have been on its way since before the stop. */
static void a_report_right_behind_a_stop_proves_nothing(void **state)
{
	const struct fake_frame report = {
		.address = 1, .kind = FAKE_REPORT, .powered = true, .speed = TOP_SPEED / 2
	};
	struct world *world = moving(true);

	(void)state;
	world->driver.report = take_report;
	world->sim[0].deaf = 1000;
	fake_post(world->bus, 0, DB_CMD_STOP);
	for (unsigned i = 0; i < 12; i++) {
		fake_pass(world->bus, 8 * MS);
		fake_receive(world->bus, &report, sizeof report);
		assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	}
	close_world(world);
}

static unsigned stops_begun;

/* Knows without asking that nothing has to be sent. */
static enum db_step end_stops_at_once(struct db_conversation *talk)
{
	if (fake_kind_of(talk->job) != FAKE_STOP)
		return fake_family.begin(talk);
	stops_begun++;
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

static void a_stop_that_ends_unsent_keeps_its_pace(void **state)
{
	struct world *world = moving(true);

	(void)state;
	stops_begun = 0;
	world->driver.begin = end_stops_at_once;
	fake_post(world->bus, 0, DB_CMD_STOP);
	/* Within this the engine is called so often that fake_pass() gives up, if it spins. */
	fake_pass(world->bus, 400 * MS);
	assert_in_range(stops_begun, 2, 40);
	/* The drives are read meanwhile. */
	assert_true(fake_feedback(world->bus, 0).taken > world->bus->now - 50 * MS);
	assert_true(fake_feedback(world->bus, 1).taken > world->bus->now - 50 * MS);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	close_world(world);
}

/* --- counters -------------------------------------------------------------------------------------- */

static void figures_survive_a_clock_that_was_asleep(void **state)
{
	struct world *world = open_world(true);
	struct db_bus_stats stats;

	(void)state;
	/* Longer than 32 bits of microseconds. */
	world->bus->now += 100 * 60 * DB_NS_PER_S;
	fake_pass(world->bus, 100 * MS);
	stats = fake_stats(world->bus);
	assert_int_equal(stats.jitter_max_us, UINT32_MAX);
	assert_in_range(stats.overruns, 299990, 300010);
	close_world(world);
}

static bool write_stop(struct db_device *device, enum db_command command,
                       struct db_exchange *exchange)
{
	assert_true(db_command_is_stop(command));
	const struct fake_frame frame = {
		.address = device->address,
		.kind = command == DB_CMD_DISABLE ? FAKE_DISABLE : FAKE_STOP,
		.axis = FAKE_UNANSWERED,
	};

	memcpy(exchange->request, &frame, sizeof frame);
	exchange->request_length = sizeof frame;
	return true;
}

/* On CAN it waits for nothing, and what is proven is proven by what was asked after it. */
static void a_stop_waits_for_no_answer_that_is_outstanding(void **state)
{
	struct world *world = open_world_on(DB_MEDIUM_CAN, true);
	uint32_t frames;
	db_time asked;

	(void)state;
	world->driver.interrupt = write_stop;
	world->sim[0].target_speed = world->sim[0].speed = TOP_SPEED;
	fake_pass(world->bus, 100 * MS);
	world->answer_time = 15 * MS;
	fake_forget_sent(world->bus);
	while (fake_count(world->bus, 1, FAKE_POLL) == 0)
		fake_pass(world->bus, MS / 4);
	asked = world->bus->now;
	fake_pass(world->bus, MS);
	frames = fake_stats(world->bus).transactions;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_post(world->bus, 2, DB_CMD_STOP);
	fake_pass(world->bus, MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	assert_int_equal(fake_count(world->bus, 3, FAKE_STOP), 1);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	assert_int_equal(fake_stats(world->bus).transactions, frames + 2);
	assert_true(world->bus->now - asked < 3 * MS);
	/* Once, while the answer is outstanding. */
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	/* The answer to the older question comes, and after it the stop is said once more, as usual. */
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_snapshot(world->bus, 0).must_stand.count, 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 2);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_true(fake_is_online(world->bus, 0));
	/* The others owed answers, too. */
	assert_int_equal(
		fake_count(world->bus, 2, FAKE_STOP) + fake_count(world->bus, 4, FAKE_STOP), 0);
	close_world(world);
}

/* When its answer is what is outstanding. */
static void a_stop_that_was_said_is_not_said_again_before_its_answer(void **state)
{
	struct world *world = open_world_on(DB_MEDIUM_CAN, true);

	(void)state;
	world->driver.interrupt = write_stop;
	fake_pass(world->bus, 100 * MS);
	while (world->bus->engine->flights > 0 || fake_count(world->bus, 1, FAKE_POLL) == 0)
		fake_pass(world->bus, MS / 4);
	world->answer_time = 15 * MS;
	fake_forget_sent(world->bus);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 14 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	close_world(world);
}

/* Where the family has no frame for that, it waits for the answer. */
static void a_stop_without_such_a_frame_is_said_after_the_answer(void **state)
{
	struct world *world = open_world_on(DB_MEDIUM_CAN, true);
	db_time asked;

	(void)state;
	world->answer_time = 15 * MS;
	fake_forget_sent(world->bus);
	while (fake_count(world->bus, 1, FAKE_POLL) == 0)
		fake_pass(world->bus, MS / 4);
	asked = world->bus->sent[world->bus->sent_count - 1].at;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, asked + 14 * MS - world->bus->now);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 0);
	fake_pass(world->bus, 2 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	close_world(world);
}

/* --- one frame for all ------------------------------------------------------------------------ */

static bool write_broadcast(enum db_command command, const struct db_bus_config *bus,
                            struct db_exchange *exchange)
{
	struct fake_frame frame = { .address = FAKE_ALL, .kind = FAKE_STOP };

	(void)bus;
	memcpy(exchange->request, &frame, sizeof frame);
	exchange->request_length = sizeof frame;
	exchange->answer_length = 0;
	return command == DB_CMD_STOP;
}

/* The number of frames to all when the service ends, and whether the first frame was one. */
static unsigned count_broadcasts_at_the_end(size_t drives, bool *first)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus;
	unsigned count;

	driver.broadcast = write_broadcast;
	bus = fake_bus_new(&driver, drives);
	fake_bus_open(bus, drives, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	fake_forget_sent(bus);
	db_engine_shut_down(bus->engine, bus->now);
	fake_pass(bus, 200 * MS);
	assert_true(db_engine_is_quiet(bus->engine, false));
	count = fake_count(bus, FAKE_ALL, FAKE_STOP);
	*first = bus->sent[0].frame.address == FAKE_ALL;
	/* Each one is asked for its confirmation all the same. */
	for (unsigned address = 1; address <= drives; address++)
		assert_int_equal(fake_count(bus, address, FAKE_STOP), 1);
	fake_bus_free(bus);
	return count;
}

static void drives_that_all_have_to_stop_get_one_frame_first(void **state)
{
	bool first;

	(void)state;
	assert_int_equal(count_broadcasts_at_the_end(2, &first), 1);
	assert_true(first);
	assert_int_equal(count_broadcasts_at_the_end(3, &first), 1);
	assert_true(first);
	/* A drive alone on its line gets its own stop, which it answers. */
	assert_int_equal(count_broadcasts_at_the_end(1, &first), 0);
}

/* Sends this to all of three drives at once, over a family that says it to all if it is a stop. */
static struct fake_bus *post_to_all(struct db_driver *driver, enum db_command command)
{
	struct fake_bus *bus;

	*driver = fake_family;
	driver->broadcast = write_broadcast;
	bus = fake_bus_new(driver, 3);
	fake_bus_open(bus, 3, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	while (bus->engine->flights > 0)
		fake_pass(bus, MS / 4);
	fake_forget_sent(bus);
	for (size_t i = 0; i < 3; i++)
		fake_post(bus, i, command);
	fake_pass(bus, 100 * MS);
	return bus;
}

static void drives_have_time_to_act_on_what_all_are_told(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = post_to_all(&driver, DB_CMD_STOP);
	struct db_request ended;

	(void)state;
	assert_int_equal(bus->sent[0].frame.address, FAKE_ALL);
	assert_true(bus->sent[1].at - bus->sent[0].at >= 2 * MS);
	for (size_t i = 0; i < 3; i++) {
		assert_true(fake_collect(bus->queue, &ended));
		assert_int_equal(ended.result, DB_RESULT_OK);
		/* It left with the frame for all. */
		assert_true(ended.sent == bus->sent[0].at);
	}
	fake_bus_free(bus);
}

static void what_cannot_be_said_to_all_is_said_to_each(void **state)
{
	struct db_driver driver;
	struct fake_bus *bus = post_to_all(&driver, DB_CMD_DISABLE);

	(void)state;
	assert_int_equal(fake_count(bus, FAKE_ALL, FAKE_STOP), 0);
	for (unsigned address = 1; address <= 3; address++) {
		assert_int_equal(fake_count(bus, address, FAKE_DISABLE), 1);
		assert_int_equal(fake_result(bus), DB_RESULT_OK);
	}
	fake_bus_free(bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_that_stands_is_stopped_at_once),
		cmocka_unit_test(a_confirmed_stop_frees_the_drive_with_its_result),
		cmocka_unit_test(a_disable_is_not_done_by_the_answer_to_an_earlier_one),
		cmocka_unit_test(a_stop_that_is_lost_is_said_again_and_not_confirmed),
		cmocka_unit_test(a_drive_that_runs_on_is_told_of_and_told_on),
		cmocka_unit_test(the_last_resort_is_taken_where_it_is_configured),
		cmocka_unit_test(a_disable_does_not_wait_for_a_stop_without_effect),
		cmocka_unit_test(a_disable_that_is_never_answered_is_told_in_time),
		cmocka_unit_test(a_disable_is_not_undone_by_the_enable_on_the_wire),
		cmocka_unit_test(a_long_deceleration_is_no_failure),
		cmocka_unit_test(a_slow_drive_is_read_between_two_stops),
		cmocka_unit_test(one_that_moves_is_read_between_stops_without_effect),
		cmocka_unit_test(stops_without_effect_are_said_as_often_where_all_are_read_evenly),
		cmocka_unit_test(a_stop_that_was_never_said_waits_for_no_reading),
		cmocka_unit_test(drives_that_do_not_obey_take_turns),
		cmocka_unit_test(one_that_is_gone_does_not_keep_stops_from_one_that_is_there),
		cmocka_unit_test(a_reversal_is_no_stop),
		cmocka_unit_test(a_motion_that_does_not_show_yet_is_waited_for),
		cmocka_unit_test(another_motion_takes_its_place),
		cmocka_unit_test(a_drive_that_returns_moving_is_stopped),
		cmocka_unit_test(the_end_waits_until_it_stops),
		cmocka_unit_test(a_first_stop_waits_for_one_exchange),
		cmocka_unit_test(drives_that_do_not_answer_take_turns),
		cmocka_unit_test(a_ramp_is_followed_on_a_long_cycle),
		cmocka_unit_test(a_computed_speed_that_trembles_is_no_ramp),
		cmocka_unit_test(the_ramp_of_an_earlier_command_hides_nothing_for_long),
		cmocka_unit_test(a_stop_is_not_judged_by_a_sample_from_before_it),
		cmocka_unit_test(moving_at_speed_0_runs_on_and_is_waited_for_no_longer),
		cmocka_unit_test(a_report_right_behind_a_stop_proves_nothing),
		cmocka_unit_test(a_stop_that_ends_unsent_keeps_its_pace),
		cmocka_unit_test(drives_that_all_have_to_stop_get_one_frame_first),
		cmocka_unit_test(drives_have_time_to_act_on_what_all_are_told),
		cmocka_unit_test(what_cannot_be_said_to_all_is_said_to_each),
		cmocka_unit_test(figures_survive_a_clock_that_was_asleep),
		cmocka_unit_test(a_stop_waits_for_no_answer_that_is_outstanding),
		cmocka_unit_test(a_stop_that_was_said_is_not_said_again_before_its_answer),
		cmocka_unit_test(a_stop_without_such_a_frame_is_said_after_the_answer),
	};

	return cmocka_run_group_tests_name("stop", tests, NULL, NULL);
}
