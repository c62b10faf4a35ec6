/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How a command's end and a drive's having to stand affect each other, in made-up time with a made-up family; and whether a drive
 * is known to stand.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define NOW FAKE_BEGIN_TIME

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	float speed;
	bool refuses;        /* commands */
	bool keeps_prepared; /* its answer to that is the test's */
};

/* What its answers to commands come to. */
static enum db_result answered;

static enum db_step begin_in_two(struct db_conversation *talk)
{
	enum db_step step = fake_family.begin(talk);

	return fake_kind_of(talk->job) == FAKE_COMMAND ? fake_say(talk, FAKE_PREPARE) : step;
}

static enum db_step answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	struct fake_frame frame = fake_frame_at(bytes, length);
	enum db_step step;

	if (frame.kind == FAKE_PREPARE)
		return fake_say(talk, FAKE_BEGIN);
	if (frame.kind == FAKE_BEGIN) {
		talk->result = DB_RESULT_OK;
		return DB_STEP_DONE;
	}
	step = fake_family.answer(talk, bytes, length);
	if (frame.kind == FAKE_COMMAND && !frame.refused)
		talk->result = answered;
	return step;
}

static db_time obey(void *context, struct fake_frame *frame)
{
	const struct world *world = context;

	frame->speed = world->speed;
	frame->powered = true;
	frame->refused = world->refuses && frame->kind == FAKE_COMMAND;
	return world->keeps_prepared && frame->kind == FAKE_PREPARE ? 0 : FAKE_ANSWER_TIME;
}

static struct world *open_world(size_t drives)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	answered = DB_RESULT_OK;
	world->driver = fake_family;
	world->driver.answer = answer;
	world->bus = fake_bus_new(&world->driver, drives);
	world->bus->context = world;
	world->bus->obey = obey;
	for (size_t i = 0; i < drives; i++)
		world->bus->drives[i].stop_reaction_ms = 300;
	fake_bus_open(world->bus, drives, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 300 * MS);
	fake_forget_sent(world->bus);
	return world;
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

static enum db_result run(struct world *world, enum db_command command)
{
	fake_post(world->bus, 0, command);
	fake_pass(world->bus, 10 * MS);
	return fake_result(world->bus);
}

/* --- commands that end ------------------------------------------------------------------------ */

static void a_motion_that_failed_must_not_begin_after_all(void **state)
{
	struct world *world = open_world(1);

	(void)state;
	answered = DB_RESULT_FAILED;
	assert_int_equal(run(world, DB_CMD_SAVE_PARAMETERS), DB_RESULT_FAILED);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 0);
	assert_int_equal(run(world, DB_CMD_MOVE_VELOCITY), DB_RESULT_FAILED);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	close_world(world);
}

static void refusals_are_counted(void **state)
{
	struct world *world = open_world(1);

	(void)state;
	assert_int_equal(run(world, DB_CMD_ENABLE), DB_RESULT_OK);
	assert_int_equal(fake_snapshot(world->bus, 0).stats.refusals, 0);
	world->refuses = true;
	assert_int_equal(run(world, DB_CMD_ENABLE), DB_RESULT_REFUSED);
	assert_int_equal(run(world, DB_CMD_MOVE_VELOCITY), DB_RESULT_REFUSED);
	fake_pass(world->bus, 50 * MS);
	assert_int_equal(fake_snapshot(world->bus, 0).stats.refusals, 2);
	close_world(world);
}

/* A drive that moves and cannot be disabled is sent this; what is sent to it then, in a second. */
static void run_while_to_be_disabled(enum db_command command, enum db_result result,
                                     unsigned *disables, unsigned *stops)
{
	struct world *world = open_world(1);

	world->speed = 1.0f;
	assert_int_equal(run(world, DB_CMD_DISABLE), DB_RESULT_FAILED);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(fake_feedback(world->bus, 0).error, DB_ERROR_RUNS_ON);
	answered = result;
	assert_int_equal(run(world, command), result);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 1000 * MS);
	*disables = fake_count(world->bus, 1, FAKE_DISABLE);
	*stops = fake_count(world->bus, 1, FAKE_STOP);
	close_world(world);
}

/* Who gives it power wants it to have power; that it must stand is another thing. */
static void a_drive_that_was_enabled_is_stopped_and_not_disabled(void **state)
{
	unsigned disables;
	unsigned stops;

	(void)state;
	run_while_to_be_disabled(DB_CMD_ENABLE, DB_RESULT_OK, &disables, &stops);
	assert_int_equal(disables, 0);
	assert_true(stops > 5);
	/* It was not enabled, or by nobody. */
	run_while_to_be_disabled(DB_CMD_ENABLE, DB_RESULT_FAILED, &disables, &stops);
	assert_true(disables > 5);
	run_while_to_be_disabled(DB_CMD_CLEAR_FAULT, DB_RESULT_OK, &disables, &stops);
	assert_true(disables > 5);
}

/* Its first exchange was answered, the second one waits to be sent: it never is. */
static void a_motion_that_was_only_prepared_does_not_begin_after_a_stop(void **state)
{
	struct world *world = open_world(2);
	struct fake_frame prepared = { .address = 1, .kind = FAKE_PREPARE, .powered = true };

	(void)state;
	world->driver.begin = begin_in_two;
	world->keeps_prepared = true;
	fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
	while (fake_count(world->bus, 1, FAKE_PREPARE) == 0)
		fake_pass(world->bus, MS / 4);
	fake_pass(world->bus, MS / 4);
	fake_receive(world->bus, &prepared, sizeof prepared);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_CANCELLED);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_BEGIN), 0);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	/* And the drive takes the next one. */
	world->keeps_prepared = false;
	assert_int_equal(run(world, DB_CMD_MOVE_VELOCITY), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_BEGIN), 1);
	close_world(world);
}

/* Two of each wait; whether one was sent decides what is known of them. */
static void stops_of_a_drive_that_leaves_end_each(void **state)
{
	struct world *world = open_world(1);
	struct station *station = world->bus->engine->stations[0];

	(void)state;
	world->speed = 1.0f;
	fake_port(world->bus, 5);
	for (unsigned i = 0; i < 2; i++)
		fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 10 * MS);
	station_drop_stops(station, world->bus->now);
	for (unsigned i = 0; i < 2; i++)
		assert_int_equal(fake_result(world->bus), DB_RESULT_CANCELLED);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	assert_int_equal(station->stop_count, 0);
	fake_port(world->bus, 0);
	for (unsigned i = 0; i < 2; i++)
		fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 50 * MS);
	assert_true(fake_count(world->bus, 1, FAKE_STOP) > 0);
	station_drop_stops(station, world->bus->now);
	for (unsigned i = 0; i < 2; i++)
		assert_int_equal(fake_result(world->bus), DB_RESULT_INDETERMINATE);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	close_world(world);
}

/* --- what is known ---------------------------------------------------------------------------- */

/* A drive that was read, stands and has nothing to do; alone at this node. */
static struct station standing_drive(struct node *node)
{
	struct station station = { .node = node, .command_ended = NOW };

	*node = (struct node){ .online = true, .in_step = true };
	station.snapshot.feedback.status = DB_STATUS_ONLINE;
	station.snapshot.feedback.state = DB_AXIS_STANDSTILL;
	station.snapshot.feedback.taken = NOW + 1;
	return station;
}

static void a_drive_is_known_to_stand_by_what_was_read_since(void **state)
{
	static const uint16_t standing[] = { DB_AXIS_DISABLED, DB_AXIS_STANDSTILL,
		                             DB_AXIS_ERROR_STOP };
	static const uint16_t others[] = { DB_AXIS_OFFLINE, DB_AXIS_DISCRETE_MOTION,
		                           DB_AXIS_CONTINUOUS_MOTION, DB_AXIS_HOMING,
		                           DB_AXIS_STOPPING };
	struct node node;
	struct station station = standing_drive(&node);

	(void)state;
	for (size_t i = 0; i < sizeof(standing) / sizeof(standing[0]); i++) {
		station.snapshot.feedback.state = standing[i];
		assert_true(station_is_seen_to_stand(&station));
	}
	for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++) {
		station.snapshot.feedback.state = others[i];
		assert_false(station_is_seen_to_stand(&station));
	}
	station = standing_drive(&node);
	station.snapshot.feedback.status |= DB_STATUS_MOVING;
	assert_false(station_is_seen_to_stand(&station));
	station = standing_drive(&node);
	station.snapshot.feedback.taken = NOW;
	assert_false(station_is_seen_to_stand(&station));
	station = standing_drive(&node);
	station.stop_count = 1;
	assert_false(station_is_seen_to_stand(&station));
	station = standing_drive(&node);
	station.standing.kind = DB_CMD_STOP;
	assert_false(station_is_seen_to_stand(&station));
	station = standing_drive(&node);
	station.lanes[LANE_COMMAND].active = true;
	assert_false(station_is_seen_to_stand(&station));
	station = standing_drive(&node);
	node.online = false;
	assert_false(station_is_seen_to_stand(&station));
}

/* A stop joins: whether the drive may be moving. */
static bool may_move(struct station *station)
{
	station_add_stop(station, DB_CMD_STOP, DB_STAND_EXIT, NULL, NOW + 2);
	return station->standing.may_move;
}

static void a_drive_that_is_to_stop_may_move_where_it_was_not_read_since(void **state)
{
	struct node node;
	struct station station = standing_drive(&node);

	(void)state;
	assert_false(may_move(&station));
	station = standing_drive(&node);
	station.snapshot.feedback.status = DB_STATUS_BUS_UP;
	assert_true(may_move(&station));
	station = standing_drive(&node);
	node.in_step = false;
	assert_true(may_move(&station));
	station = standing_drive(&node);
	station.lanes[LANE_COMMAND].active = true;
	assert_true(may_move(&station));
	station = standing_drive(&node);
	station.snapshot.feedback.taken = NOW;
	assert_true(may_move(&station));
	station = standing_drive(&node);
	station.snapshot.feedback.status |= DB_STATUS_MOVING;
	assert_true(may_move(&station));
}

/* One that obeys is not done with its stop before whoever asked for it has the result. */
static void what_is_asked_of_a_drive_waits_while_a_stop_is_not_answered(void **state)
{
	struct station station = { .stop_count = 0 };

	(void)state;
	assert_false(station_has_open_stop(&station));
	assert_false(station_awaits_stop(&station));
	station.standing.kind = DB_CMD_STOP;
	assert_true(station_has_open_stop(&station));
	assert_true(station_awaits_stop(&station));
	/* One that does not obey at all takes commands: they may be what stops it. */
	station.standing.overdue = true;
	assert_true(station_has_open_stop(&station));
	assert_false(station_awaits_stop(&station));
	station.standing.overdue = false;
	station.standing.obeys = true;
	assert_false(station_has_open_stop(&station));
	assert_false(station_awaits_stop(&station));
	station.stop_count = 1;
	assert_true(station_has_open_stop(&station));
	assert_true(station_awaits_stop(&station));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_motion_that_failed_must_not_begin_after_all),
		cmocka_unit_test(refusals_are_counted),
		cmocka_unit_test(a_drive_that_was_enabled_is_stopped_and_not_disabled),
		cmocka_unit_test(a_motion_that_was_only_prepared_does_not_begin_after_a_stop),
		cmocka_unit_test(stops_of_a_drive_that_leaves_end_each),
		cmocka_unit_test(a_drive_is_known_to_stand_by_what_was_read_since),
		cmocka_unit_test(a_drive_that_is_to_stop_may_move_where_it_was_not_read_since),
		cmocka_unit_test(what_is_asked_of_a_drive_waits_while_a_stop_is_not_answered),
	};

	return cmocka_run_group_tests_name("sched/station_ends", tests, NULL, NULL);
}
