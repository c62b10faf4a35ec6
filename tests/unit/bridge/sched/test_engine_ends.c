/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The engine of a bus: a stop of one of several axes, requests, figures, a port that is opened
 * again, the end of the service, and when a bus is quiet enough for that end or for a scan. Made-up
 * drives in made-up time.
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
};

static enum db_step begin(struct db_conversation *talk)
{
	enum db_step step = fake_family.begin(talk);

	return fake_kind_of(talk->job) == FAKE_COMMAND ? fake_say(talk, FAKE_PREPARE) : step;
}

static enum db_step answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	if (frame.kind == FAKE_PREPARE)
		return fake_say(talk, FAKE_BEGIN);
	if (frame.kind != FAKE_BEGIN)
		return fake_family.answer(talk, bytes, length);
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

/* Each of them has so many axes. */
static struct world *open_world(size_t drives, unsigned axes)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->driver.begin = begin;
	world->driver.answer = answer;
	world->driver.axes = axes;
	world->bus = fake_bus_new(&world->driver, drives);
	for (size_t i = 0; i < drives; i++) {
		world->bus->drives[i].address = (unsigned)(i / axes) + 1;
		world->bus->drives[i].axis = (unsigned)(i % axes);
		world->bus->drives[i].stop_reaction_ms = 500;
	}
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

/* --- several axes ----------------------------------------------------------------------------- */

/* The second axis prepares a motion when the first one gets this. What came of the motion, and whether it began. */
static enum db_result move_beside(enum db_command command, bool *began)
{
	struct world *world = open_world(2, 2);
	const uint32_t ticket = fake_ticket(1, DB_CMD_MOVE_ABSOLUTE);
	struct db_request ended;
	enum db_result result = DB_RESULT_NONE;

	fake_post(world->bus, 1, DB_CMD_MOVE_ABSOLUTE);
	while (fake_count(world->bus, 1, FAKE_PREPARE) == 0)
		fake_pass(world->bus, MS / 10);
	fake_post(world->bus, 0, command);
	fake_pass(world->bus, 200 * MS);
	while (fake_collect(world->bus->queue, &ended)) {
		if (ended.ticket == ticket)
			result = ended.result;
	}
	*began = fake_count(world->bus, 1, FAKE_BEGIN) > 0;
	close_world(world);
	return result;
}

/* A controller's stop is for all axes, so that none of them may begin what it was told before; its disable is for one. */
static void a_stop_of_one_axis_cancels_what_others_prepare(void **state)
{
	bool began;

	(void)state;
	assert_int_equal(move_beside(DB_CMD_STOP, &began), DB_RESULT_CANCELLED);
	assert_false(began);
	assert_int_equal(move_beside(DB_CMD_QUICK_STOP, &began), DB_RESULT_CANCELLED);
	assert_false(began);
	assert_int_equal(move_beside(DB_CMD_DISABLE, &began), DB_RESULT_OK);
	assert_true(began);
}

/* --- requests --------------------------------------------------------------------------------- */

/* A drive that was told something is looked at as often as one that moves. */
static void a_drive_is_lively_after_a_command(void **state)
{
	struct world *world = open_world(2, 1);
	struct db_engine *engine = world->bus->engine;
	db_time posted = world->bus->now;

	(void)state;
	assert_false(node_is_lively(engine->nodes[0], world->bus->now));
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 50 * MS);
	assert_int_equal(engine->stations[0]->commanded, posted);
	assert_true(node_is_lively(engine->nodes[0], world->bus->now));
	assert_false(node_is_lively(engine->nodes[1], world->bus->now));
	fake_pass(world->bus, (DB_SHARE_LIVELY_MS + 10) * MS);
	assert_false(node_is_lively(engine->nodes[0], world->bus->now));
	close_world(world);
}

static void how_many_requests_wait_shows(void **state)
{
	struct world *world = open_world(1, 1);

	(void)state;
	assert_int_equal(fake_stats(world->bus).queued, 0);
	for (unsigned i = 0; i < 3; i++)
		fake_post(world->bus, 0, DB_CMD_ENABLE);
	(void)db_engine_run(world->bus->engine, world->bus->now);
	assert_int_equal(fake_stats(world->bus).queued, 3);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_stats(world->bus).queued, 0);
	close_world(world);
}

/* What is cancelled before that has certainly had no effect. */
static void a_command_is_sent_with_its_first_frame(void **state)
{
	struct world *world = open_world(1, 1);
	struct db_request ended;
	db_time first = 0;

	(void)state;
	fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(world->bus, 50 * MS);
	for (size_t i = 0; i < world->bus->sent_count && first == 0; i++) {
		if (world->bus->sent[i].frame.kind == FAKE_PREPARE)
			first = world->bus->sent[i].at;
	}
	assert_true(fake_collect(world->bus->queue, &ended));
	assert_int_equal(ended.result, DB_RESULT_OK);
	assert_true(first != 0 && ended.sent == first);
	close_world(world);
}

static void one_request_more_than_may_wait_is_refused(void **state)
{
	struct world *world = open_world(1, 1);
	struct db_engine *engine = world->bus->engine;

	(void)state;
	engine->waiting_max = 2;
	for (unsigned i = 0; i < 3; i++)
		fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	while (engine->flights == 0)
		fake_pass(world->bus, MS / 10);
	(void)db_engine_run(engine, world->bus->now);
	assert_int_equal(fake_result(world->bus), DB_RESULT_BUSY);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

/* --- figures ---------------------------------------------------------------------------------- */

static void how_late_a_cycle_began_shows(void **state)
{
	struct world *world = open_world(1, 1);
	struct db_engine *engine = world->bus->engine;

	(void)state;
	while (engine->flights > 0)
		fake_pass(world->bus, MS / 10);
	world->bus->now = engine->cycle_at + MS / 2;
	(void)db_engine_run(engine, world->bus->now);
	assert_int_equal(fake_stats(world->bus).jitter_us, 500);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_stats(world->bus).jitter_us, 0);
	assert_int_equal(fake_stats(world->bus).jitter_max_us, 500);
	close_world(world);
}

/* The figure is in thousandths of a second. It changes when the second that it covers is over. */
static void how_busy_the_wire_was_shows_each_second(void **state)
{
	struct world *world = open_world(1, 1);
	struct db_engine *engine = world->bus->engine;

	(void)state;
	while (engine->flights > 0)
		fake_pass(world->bus, MS / 10);
	engine->busy = DB_NS_PER_S;
	engine->second_at = world->bus->now + 1;
	engine->idle_until = 0;
	(void)db_engine_run(engine, world->bus->now);
	assert_true(fake_stats(world->bus).utilisation < 1000);
	engine->idle_until = 0;
	(void)db_engine_run(engine, ++world->bus->now);
	assert_int_equal(fake_stats(world->bus).utilisation, 1000);
	assert_int_equal(engine->busy, 0);
	/* The engine runs again only after two seconds: the wire was busy for half of that time. */
	engine->busy = DB_NS_PER_S;
	world->bus->now += 2 * DB_NS_PER_S;
	engine->idle_until = 0;
	(void)db_engine_run(engine, world->bus->now);
	assert_int_equal(fake_stats(world->bus).utilisation, 500);
	close_world(world);
}

/* The time that each further axis at an address adds to a reading. */
static db_time take_long_per_axis(const struct db_bus_config *bus)
{
	(void)bus;
	return 3 * MS;
}

static void the_times_of_readings_are_known_from_the_beginning(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus = fake_bus_new(&driver, 1);

	(void)state;
	bus->config.turnaround_us = 250;
	fake_bus_open(bus, 1, NULL);
	assert_int_equal(bus->engine->poll_time, FAKE_ANSWER_TIME + MS / 4);
	assert_int_equal(bus->engine->axis_time, 0);
	fake_bus_free(bus);
	driver.axis_time = take_long_per_axis;
	bus = fake_bus_new(&driver, 1);
	fake_bus_open(bus, 1, NULL);
	assert_int_equal(bus->engine->poll_time, FAKE_ANSWER_TIME);
	assert_int_equal(bus->engine->axis_time, 3 * MS);
	fake_bus_free(bus);
}

/* CAN carries more frames in the same time, so its trace is four times as large. */
static void a_trace_of_can_holds_more(void **state)
{
	uint64_t kept[2] = { 0, 0 };

	(void)state;
	for (unsigned can = 0; can < 2; can++) {
		struct db_trace_record record;
		struct db_trace_place place = { 0 };
		struct db_driver driver = fake_family;
		struct fake_bus *bus;
		struct db_trace *trace;
		uint32_t lost;

		driver.medium = can ? DB_MEDIUM_CAN : DB_MEDIUM_SERIAL;
		bus = fake_bus_new(&driver, 1);
		fake_bus_open(bus, 1, NULL);
		trace = db_engine_trace(bus->engine);
		for (unsigned i = 0; i < 20000; i++)
			(void)db_trace_write(trace, bus->now, DB_TRACE_GARBAGE, 0, "garbage", 7);
		while (db_trace_read(trace, &place, &record, &lost))
			kept[can]++;
		fake_bus_free(bus);
	}
	assert_in_range(kept[1], 4 * kept[0] - 4, 4 * kept[0] + 4);
}

/* --- the port --------------------------------------------------------------------------------- */

/* An awaited answer, received bytes, a reserved turn and a gap test belong to the port that was
 * lost: none of them is left when the port is open again. */
static void a_port_that_is_opened_again_begins_afresh(void **state)
{
	struct world *world = open_world(2, 1);
	struct db_engine *engine = world->bus->engine;

	(void)state;
	while (engine->flights == 0)
		fake_pass(world->bus, MS / 10);
	fake_receive(world->bus, "abc", 3);
	engine->silent_at = world->bus->now + 5 * MS;
	engine->reserved.until = world->bus->now + 5 * MS;
	engine->last_to_answer = engine->nodes[0];
	engine->tests_gap = true;
	engine->probes_from = world->bus->now + 5000 * MS;
	world->bus->now += MS;
	fake_port(world->bus, 5);
	assert_int_equal(engine->now, world->bus->now);
	world->bus->answer_count = 0;
	fake_port(world->bus, 0);
	assert_int_equal(engine->flights, 0);
	assert_int_equal(engine->received_length, 0);
	assert_int_equal(engine->silent_at, 0);
	assert_int_equal(engine->reserved.until, 0);
	assert_null(engine->last_to_answer);
	assert_false(engine->tests_gap);
	assert_int_equal(engine->probes_from, 0);
	close_world(world);
}

/* --- the end ---------------------------------------------------------------------------------- */

/* Commands that wait are cancelled, and so is a command that is posted later; also where on-exit
 * leaves the drive as it is. */
static void commands_that_wait_are_cancelled_at_the_end(void **state)
{
	(void)state;
	for (unsigned leaves = 0; leaves < 2; leaves++) {
		struct world *world = open_world(1, 1);
		struct db_engine *engine = world->bus->engine;

		world->bus->drives[0].on_exit = leaves ? DB_ON_LOSS_NONE : DB_ON_LOSS_STOP;
		while (engine->flights == 0)
			fake_pass(world->bus, MS / 10);
		for (unsigned i = 0; i < 2; i++)
			fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
		(void)db_engine_run(engine, world->bus->now);
		db_engine_shut_down(engine, ++world->bus->now);
		assert_int_equal(engine->now, world->bus->now);
		for (unsigned i = 0; i < 2; i++)
			assert_int_equal(fake_result(world->bus), DB_RESULT_CANCELLED);
		fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
		fake_pass(world->bus, 100 * MS);
		assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 0);
		assert_int_equal(fake_count(world->bus, 1, FAKE_STOP) > 0, !leaves);
		assert_int_equal(fake_result(world->bus), DB_RESULT_CANCELLED);
		close_world(world);
	}
}

/* Only the first frame of the motion was sent: the second one, which begins it, is not sent. */
static void a_motion_that_is_only_prepared_does_not_begin_at_the_end(void **state)
{
	struct world *world = open_world(1, 1);

	(void)state;
	world->bus->drives[0].on_exit = DB_ON_LOSS_NONE;
	fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	while (fake_count(world->bus, 1, FAKE_PREPARE) == 0)
		fake_pass(world->bus, MS / 10);
	db_engine_shut_down(world->bus->engine, world->bus->now);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_BEGIN), 0);
	assert_int_equal(fake_result(world->bus), DB_RESULT_CANCELLED);
	close_world(world);
}

/* A drive that is being removed was sent its stop before: the end of the service sends no other. */
static void a_drive_that_leaves_is_sent_nothing_at_the_end(void **state)
{
	struct world *world = open_world(1, 1);
	struct db_engine *engine = world->bus->engine;

	(void)state;
	engine->stations[0]->leaving = true;
	fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(world->bus, 50 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_CANCELLED);
	db_engine_shut_down(engine, world->bus->now);
	assert_false(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 0);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 0);
	close_world(world);
}

/* What a drive must stand for because the bus goes is over when it is back; what somebody asked for is not. */
static void drives_that_are_left_for_a_scan_need_not_stand_afterwards(void **state)
{
	struct world *world = open_world(3, 1);
	struct db_engine *engine = world->bus->engine;

	(void)state;
	for (unsigned address = 1; address <= 3; address++)
		world->bus->dead[address] = true;
	fake_post(world->bus, 1, DB_CMD_STOP);
	fake_pass(world->bus, 5 * MS);
	db_engine_shut_down(engine, world->bus->now);
	for (unsigned i = 0; i < 3; i++)
		assert_true(fake_feedback(world->bus, i).status & DB_STATUS_MUST_STAND);
	assert_int_equal(world->bus->told[DB_EVENT_DRIVE_UNCONFIRMED], 0);
	db_engine_set_aside(engine, world->bus->now);
	/* All three are reported: they have not confirmed their stops. */
	assert_int_equal(world->bus->told[DB_EVENT_DRIVE_UNCONFIRMED], 3);
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(!!(fake_feedback(world->bus, i).status & DB_STATUS_MUST_STAND),
		                 i == 1);
	/* And commands are taken again. */
	for (unsigned address = 1; address <= 3; address++)
		world->bus->dead[address] = false;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	fake_post(world->bus, 2, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(world->bus, 50 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

static void a_bus_is_quiet_when_all_of_its_drives_are(void **state)
{
	struct world *world = open_world(3, 1);
	struct db_engine *engine = world->bus->engine;
	struct station *last;

	(void)state;
	while (engine->flights > 0)
		fake_pass(world->bus, MS / 10);
	last = engine->stations[2];
	assert_true(db_engine_is_quiet(engine, false));
	last->standing.kind = DB_CMD_STOP;
	assert_false(db_engine_is_quiet(engine, false));
	assert_false(db_engine_is_quiet(engine, true));
	/* Of one that is gone nothing more is awaited where the line is cleared for a scan. */
	last->node->online = false;
	assert_false(db_engine_is_quiet(engine, false));
	assert_true(db_engine_is_quiet(engine, true));
	last->node->online = true;
	last->standing.kind = DB_CMD_NONE;
	while (engine->flights == 0)
		fake_pass(world->bus, MS / 10);
	assert_false(db_engine_is_quiet(engine, false));
	assert_false(db_engine_is_quiet(engine, true));
	fake_port(world->bus, 5);
	last->standing.kind = DB_CMD_STOP;
	assert_true(db_engine_is_quiet(engine, false));
	last->standing.kind = DB_CMD_NONE;
	close_world(world);
}

/* --- frames for others ------------------------------------------------------------------------ */

/* Why it does not answer may show in them: while one is asked that has been gone for long. */
static void all_frames_are_wanted_while_one_that_is_gone_is_asked(void **state)
{
	struct world *world = open_world(2, 1);
	struct db_engine *engine = world->bus->engine;
	struct node *node = engine->nodes[1];
	db_time now = world->bus->now;

	(void)state;
	assert_false(db_engine_wants_all_frames(engine, now));
	node->online = false;
	engine->stats.online--;
	node->probe_backoff = PROBE_BACKOFF_MAX;
	node->probe_at = now + 1;
	assert_false(db_engine_wants_all_frames(engine, now));
	node->probe_at = now;
	assert_true(db_engine_wants_all_frames(engine, now));
	node->probe_backoff = PROBE_BACKOFF_MAX / 2;
	assert_false(db_engine_wants_all_frames(engine, now));
	node->probe_backoff = PROBE_BACKOFF_MAX;
	node->probe_at = now + 1;
	node->flight.station = node->first;
	assert_true(db_engine_wants_all_frames(engine, now));
	node->flight.station = NULL;
	fake_port(world->bus, 5);
	assert_false(db_engine_wants_all_frames(engine, now));
	close_world(world);
}

/* --- drives that come and go ------------------------------------------------------------------ */

/* Not with the drive's next answer, which may never come. */
static void that_a_drive_must_stand_shows_at_once(void **state)
{
	struct world *world = open_world(2, 1);

	(void)state;
	while (world->bus->engine->flights == 0)
		fake_pass(world->bus, MS / 10);
	fake_post(world->bus, 0, DB_CMD_STOP);
	(void)db_engine_run(world->bus->engine, world->bus->now);
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 0);
	close_world(world);
}

/* A controller must answer its stop, for the other axes; a drive that stands is done with it. */
static void a_stop_is_owed_by_families_with_several_axes(void **state)
{
	(void)state;
	for (unsigned axes = 1; axes <= 2; axes++) {
		struct world *world = open_world(axes, axes);
		struct db_engine *engine = world->bus->engine;

		engine_add_stop(engine, engine->stations[0], DB_CMD_STOP, DB_STAND_EXIT, NULL,
		                world->bus->now);
		assert_int_equal(engine->stations[0]->standing.owed != 0, axes > 1);
		close_world(world);
	}
}

static void one_that_is_back_is_read_before_the_next_cycle(void **state)
{
	struct world *world = open_world(1, 1);

	(void)state;
	/* A serial line asks whoever answers once more, to learn its pauses. */
	world->driver.medium = DB_MEDIUM_CAN;
	world->bus->dead[1] = true;
	fake_pass(world->bus, 500 * MS);
	assert_false(fake_is_online(world->bus, 0));
	world->bus->engine->cycle_at = world->bus->now + 5000 * MS;
	world->bus->dead[1] = false;
	fake_forget_sent(world->bus);
	while (!world->bus->engine->nodes[0]->online)
		fake_pass(world->bus, MS);
	fake_pass(world->bus, 5 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_POLL), 1);
	close_world(world);
}

/* What was prepared for a drive is not sent when it is back: it may have been another one meanwhile. */
static void nothing_stays_prepared_for_a_drive_that_goes(void **state)
{
	struct world *world = open_world(2, 2);
	struct db_engine *engine = world->bus->engine;

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		for (size_t lane = 0; lane < LANE_COMMAND; lane++)
			engine->stations[i]->lanes[lane].active =
				engine->stations[i]->lanes[lane].ready = true;
		engine->stations[i]->blind_stop_sent = true;
	}
	engine->stations[1]->lanes[LANE_COMMAND].ready = true;
	engine_take_offline(engine, engine->nodes[0], DB_RESULT_OFFLINE, world->bus->now);
	for (size_t i = 0; i < 2; i++) {
		for (size_t lane = 0; lane < LANE_COUNT; lane++)
			assert_false(engine->stations[i]->lanes[lane].active ||
			             engine->stations[i]->lanes[lane].ready);
		assert_false(engine->stations[i]->blind_stop_sent);
	}
	assert_int_equal(engine->stats.online, 0);
	assert_int_equal(engine->nodes_due, 0);
	assert_int_equal(engine->nodes[0]->probe_at,
	                 world->bus->now + engine->nodes[0]->probe_backoff);
	close_world(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_stop_of_one_axis_cancels_what_others_prepare),
		cmocka_unit_test(a_drive_is_lively_after_a_command),
		cmocka_unit_test(how_many_requests_wait_shows),
		cmocka_unit_test(a_command_is_sent_with_its_first_frame),
		cmocka_unit_test(one_request_more_than_may_wait_is_refused),
		cmocka_unit_test(how_late_a_cycle_began_shows),
		cmocka_unit_test(how_busy_the_wire_was_shows_each_second),
		cmocka_unit_test(the_times_of_readings_are_known_from_the_beginning),
		cmocka_unit_test(a_trace_of_can_holds_more),
		cmocka_unit_test(a_port_that_is_opened_again_begins_afresh),
		cmocka_unit_test(commands_that_wait_are_cancelled_at_the_end),
		cmocka_unit_test(a_motion_that_is_only_prepared_does_not_begin_at_the_end),
		cmocka_unit_test(a_drive_that_leaves_is_sent_nothing_at_the_end),
		cmocka_unit_test(drives_that_are_left_for_a_scan_need_not_stand_afterwards),
		cmocka_unit_test(a_bus_is_quiet_when_all_of_its_drives_are),
		cmocka_unit_test(all_frames_are_wanted_while_one_that_is_gone_is_asked),
		cmocka_unit_test(that_a_drive_must_stand_shows_at_once),
		cmocka_unit_test(a_stop_is_owed_by_families_with_several_axes),
		cmocka_unit_test(one_that_is_back_is_read_before_the_next_cycle),
		cmocka_unit_test(nothing_stays_prepared_for_a_drive_that_goes),
	};

	return cmocka_run_group_tests_name("sched/engine_ends", tests, NULL, NULL);
}
