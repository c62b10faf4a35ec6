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

/* --- stations without an engine --------------------------------------------------------------- */

/* Makes two axes of one controller, which share the node of the first; the caller frees them. */
static void make_axes(struct fake_bus *bus, struct station *stations[2])
{
	struct node *node;

	for (unsigned i = 0; i < 2; i++) {
		bus->drives[i].address = 1;
		bus->drives[i].axis = i;
		stations[i] = station_new(&bus->config, &bus->list[i]);
		assert_non_null(stations[i]);
	}
	node = stations[0]->spare;
	stations[0]->spare = NULL;
	for (unsigned i = 0; i < 2; i++)
		station_join(stations[i], node, &bus->config);
}

static void polls_and_probes_of_a_controller_use_its_first_axis(void **state)
{
	struct fake_bus *bus = fake_bus_new(&fake_family, 2);
	struct station *stations[2];

	(void)state;
	make_axes(bus, stations);
	for (enum lane_kind kind = LANE_STOP; kind < LANE_COUNT; kind++)
		assert_ptr_equal(station_conversation(stations[1], kind, 0).device,
		                 kind == LANE_POLL || kind == LANE_PROBE ? stations[0]->device :
		                                                           stations[1]->device);
	assert_true(stations[1]->stops_others);
	/* An axis that has left the controller has no node, and the controller does not list it. */
	assert_false(station_part(stations[1], &fake_family));
	assert_null(stations[1]->node);
	assert_null(stations[0]->device->axes[1]);
	assert_true(station_part(stations[0], &fake_family));
	station_free(stations[0]);
	station_free(stations[1]);
	/* The first axis may also leave first. */
	make_axes(bus, stations);
	assert_false(station_part(stations[0], &fake_family));
	assert_null(stations[0]->next_axis);
	assert_null(stations[0]->node);
	assert_true(station_part(stations[1], &fake_family));
	station_free(stations[0]);
	station_free(stations[1]);
	fake_bus_free(bus);
}

static void a_drive_with_one_axis_stops_no_others(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = fake_bus_new(&driver, 1);

	(void)state;
	for (unsigned axes = 1; axes <= 2; axes++) {
		struct station *station;

		driver.axes = axes;
		station = station_new(&bus->config, &bus->list[0]);
		assert_non_null(station);
		assert_int_equal(station->stops_others, axes > 1);
		station_free(station);
	}
	fake_bus_free(bus);
}

static void the_shortest_round_trip_is_the_first_one_until_one_is_shorter(void **state)
{
	struct station station = { .number = 1 };
	const struct db_axis_stats *stats = &station.snapshot.stats;

	(void)state;
	station_count_answer(&station, 5 * MS, true);
	assert_int_equal(stats->round_trip_min_us, 5000);
	station_count_answer(&station, 9 * MS, true);
	assert_int_equal(stats->round_trip_min_us, 5000);
	station_count_answer(&station, 4 * MS, true);
	assert_int_equal(stats->round_trip_min_us, 4000);
}

/* A drive has room for DB_QUEUE_STOPS_EACH waiting stops; one more fails. It is posted for another
 * drive here, because the queue would not take it for this one. */
static void all_stops_that_wait_are_sent_with_one_frame(void **state)
{
	struct world *world = open_world(1);
	struct node node;
	struct station station = standing_drive(&node);
	struct db_request *requests[DB_QUEUE_STOPS_EACH + 1];
	struct db_request completion;

	(void)state;
	for (uint16_t i = 0; i <= DB_QUEUE_STOPS_EACH; i++) {
		const struct db_request stop = { .ticket = i + 1u,
			                         .drive = i == DB_QUEUE_STOPS_EACH,
			                         .command = DB_CMD_STOP };

		assert_int_equal(db_queue_grow(world->bus->queue, 2), 0);
		assert_non_null(db_queue_post(world->bus->queue, &stop));
		requests[i] = db_queue_take(world->bus->queue);
		station_add_stop(&station, DB_CMD_STOP, DB_STAND_CLIENT, requests[i], NOW);
	}
	assert_int_equal(station.stop_count, DB_QUEUE_STOPS_EACH);
	assert_true(fake_collect(world->bus->queue, &completion));
	assert_int_equal(completion.ticket, DB_QUEUE_STOPS_EACH + 1);
	assert_int_equal(completion.result, DB_RESULT_FAILED);
	station_stop_sent(&station, true, NOW + 7);
	for (unsigned i = 0; i < DB_QUEUE_STOPS_EACH; i++)
		assert_int_equal(requests[i]->sent, NOW + 7);
	close_world(world);
}

/* The driver is not asked for the result, as it does not know the command. */
static void a_command_that_was_not_sent_ends_when_its_drive_is_lost(void **state)
{
	const struct db_request enable = { .ticket = 1, .command = DB_CMD_ENABLE };
	struct world *world = open_world(1);
	struct node node;
	struct station station = standing_drive(&node);

	(void)state;
	assert_non_null(db_queue_post(world->bus->queue, &enable));
	station.request = db_queue_take(world->bus->queue);
	station.lanes[LANE_COMMAND].active = true;
	station.lanes[LANE_COMMAND].job = (struct db_job){ .kind = DB_JOB_COMMAND,
		                                           .request = station.request };
	station_abandon_command(&station, &fake_family, DB_RESULT_BUS_DOWN, NOW);
	assert_int_equal(fake_result(world->bus), DB_RESULT_BUS_DOWN);
	assert_false(station.lanes[LANE_COMMAND].active);
	close_world(world);
}

static unsigned settled;

static enum db_step count_lost(struct db_conversation *talk)
{
	(void)talk;
	settled++;
	return DB_STEP_DONE;
}

/* Only a parameter write that was begun and sent, and only if the family joins writes. */
static void only_a_write_that_was_sent_is_settled(void **state)
{
	struct db_driver driver = fake_family;

	(void)state;
	driver.lost = count_lost;
	for (unsigned bits = 0; bits < 16; bits++) {
		struct node node;
		struct station station = standing_drive(&node);
		struct lane *lane = &station.lanes[LANE_COMMAND];

		lane->active = bits & 1;
		lane->sent = bits & 2;
		lane->job.kind = bits & 4 ? DB_JOB_SETTINGS : DB_JOB_COMMAND;
		driver.joins_settings = bits & 8;
		settled = 0;
		station_settle_write(&station, &driver, NOW);
		assert_int_equal(settled, bits == 15);
		/* A command that has not begun cannot be finished: the time of the last end
		 * stays. */
		if (!lane->active)
			station_finish_command(&station, DB_RESULT_OK, NOW + 1);
		assert_int_equal(station.command_ended, NOW);
	}
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
		cmocka_unit_test(polls_and_probes_of_a_controller_use_its_first_axis),
		cmocka_unit_test(a_drive_with_one_axis_stops_no_others),
		cmocka_unit_test(the_shortest_round_trip_is_the_first_one_until_one_is_shorter),
		cmocka_unit_test(all_stops_that_wait_are_sent_with_one_frame),
		cmocka_unit_test(a_command_that_was_not_sent_ends_when_its_drive_is_lost),
		cmocka_unit_test(only_a_write_that_was_sent_is_settled),
	};

	return cmocka_run_group_tests_name("sched/station_ends", tests, NULL, NULL);
}
