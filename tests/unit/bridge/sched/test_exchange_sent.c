/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One exchange: how it is prepared, delayed, sent and ended, and what its lane, its node and the
 * engine record about it. The drives, the line and the time are simulated (fakes/bus.h).
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define RESERVED_MOST (3 * LEARN_GAP_MOST) /* as in exchange.c */

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	struct db_transport transport;
	struct db_engine *engine;
	struct station *station; /* of the first drive */
	struct station *other;
	struct node *node; /* of the first drive */
};

static unsigned counted; /* calls of wire_time() */

static db_time count_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                               size_t request_length, size_t answer_length)
{
	(void)bus;
	counted++;
	return (db_time)(request[0] + request_length + answer_length) * (MS / 100);
}

/* Opens a bus with two drives that have nothing to do and do not answer. */
static void open_world(struct world *world, enum db_medium medium)
{
	memset(world, 0, sizeof *world);
	world->driver = fake_family;
	world->driver.medium = medium;
	world->transport = fake_wire;
	world->bus = fake_bus_new(&world->driver, 2);
	fake_bus_open(world->bus, 2, NULL);
	world->engine = world->bus->engine;
	fake_port(world->bus, 0);
	fake_settle(world->bus);
	world->bus->obey = fake_answer_nothing;
	world->station = world->engine->stations[0];
	world->other = world->engine->stations[1];
	world->node = world->station->node;
	fake_forget_sent(world->bus);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
}

/* Posts a motion and takes it out of the queue, as the schedule does before a command begins. */
static struct db_request *take_command(struct world *world, uint32_t group)
{
	struct db_request *request;

	fake_request(world->bus, 0,
	             (struct db_request){ .command = DB_CMD_MOVE_ABSOLUTE, .group = group });
	request = db_queue_take(world->bus->queue);
	assert_non_null(request);
	world->station->request = request;
	world->station->lanes[LANE_COMMAND].exchange.request = db_queue_bytes(request);
	world->station->lanes[LANE_COMMAND].exchange.request_size = DB_REQUEST_MAX;
	return request;
}

static void finish_command(struct world *world)
{
	world->station->lanes[LANE_COMMAND].active = true;
	station_finish_command(world->station, DB_RESULT_CANCELLED, world->bus->now);
}

/* Begins a job in this lane, and so prepares its first exchange. */
static struct lane *prepare(struct world *world, struct station *station, enum lane_kind kind)
{
	static const enum db_job_kind jobs[] = { [LANE_POLL] = DB_JOB_POLL,
		                                 [LANE_PROBE] = DB_JOB_PROBE,
		                                 [LANE_COMMAND] = DB_JOB_COMMAND };
	enum db_result result;

	assert_int_equal(exchange_begin_job(world->engine, station, kind, jobs[kind],
	                                    kind == LANE_COMMAND ? station->request : NULL,
	                                    world->bus->now, &result),
	                 DB_STEP_SEND);
	return &station->lanes[kind];
}

/* --- preparing -------------------------------------------------------------------------------- */

static void a_job_begins_without_the_state_of_the_last_one(void **state)
{
	struct world world;
	struct lane *lane;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	lane = &world.station->lanes[LANE_COMMAND];
	(void)take_command(&world, 0);
	lane->tries = 2;
	lane->sent = true;
	lane->exchange.again = lane->exchange.begins = true;
	(void)prepare(&world, world.station, LANE_COMMAND);
	assert_int_equal(lane->tries, 0);
	assert_false(lane->sent);
	assert_false(lane->exchange.again || lane->exchange.begins);
	/* Only a parameter write has parts. */
	assert_null(lane->job.parts);
	finish_command(&world);
	close_world(&world);
}

/* While drives_active is set, every turn looks at all drives. A status read does not set it. */
static void a_stop_makes_the_drives_active(void **state)
{
	struct world world;
	enum db_result result;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	world.engine->drives_active = false;
	(void)prepare(&world, world.station, LANE_POLL);
	assert_false(world.engine->drives_active);
	(void)exchange_begin_job(world.engine, world.station, LANE_STOP, DB_JOB_PROBE, NULL,
	                         world.bus->now, &result);
	assert_true(world.engine->drives_active);
	world.station->lanes[LANE_STOP].active = world.station->lanes[LANE_STOP].ready = false;
	close_world(&world);
}

/* --- reserving the line ----------------------------------------------------------------------- */

/* `since` stays while the line is reserved for the same drive and lane; for another one it
 * begins again. */
static void a_reservation_is_for_one_drive_and_lane(void **state)
{
	struct world world;
	struct db_engine *engine;
	db_time now;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	engine = world.engine;
	now = world.bus->now;
	exchange_reserve(engine, world.station, LANE_COMMAND, now + 5, now);
	exchange_reserve(engine, world.station, LANE_COMMAND, now + 6, now + 1);
	assert_int_equal(engine->reserved.since, now);
	assert_int_equal(engine->reserved.until, now + 6);
	exchange_reserve(engine, world.other, LANE_COMMAND, now + 7, now + 2);
	assert_int_equal(engine->reserved.since, now + 2);
	exchange_reserve(engine, world.other, LANE_POLL, now + 8, now + 3);
	assert_int_equal(engine->reserved.since, now + 3);
	engine->reserved.until = 0;
	close_world(&world);
}

static void a_prepared_stop_waits_while_the_line_is_reserved_for_stops(void **state)
{
	struct world world;
	struct lane *lane;
	db_time now;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	now = world.bus->now;
	lane = &world.station->lanes[LANE_STOP];
	lane->active = lane->ready = true;
	exchange_reserve(world.engine, world.station, LANE_STOP, now + MS, now);
	assert_true(exchange_stop_waits(world.engine, world.station, now));
	assert_false(exchange_stop_waits(world.engine, world.other, now));
	assert_false(exchange_stop_waits(world.engine, world.station, now + MS));
	world.engine->reserved.lane = LANE_COMMAND;
	assert_false(exchange_stop_waits(world.engine, world.station, now));
	lane->active = lane->ready = false;
	world.engine->reserved.until = 0;
	close_world(&world);
}

static bool mishear(unsigned address, const uint8_t *request, size_t length)
{
	(void)address;
	(void)request;
	(void)length;
	return true;
}

/* Another drive that sends all the time can delay a frame for RESERVED_MOST only. */
static void a_frame_is_delayed_for_a_limited_time(void **state)
{
	(void)state;
	for (unsigned waited = 0; waited < 3; waited++) {
		static const db_time since[] = { 1, RESERVED_MOST - 1, RESERVED_MOST };
		struct world world;
		struct lane *lane;
		db_time now;
		bool sends = waited == 2;

		open_world(&world, DB_MEDIUM_SERIAL);
		world.driver.mishears = mishear;
		now = world.bus->now;
		world.other->node->received_at = now;
		world.other->node->gap.sure = 4 * MS;
		lane = prepare(&world, world.station, LANE_POLL);
		exchange_reserve(world.engine, world.station, LANE_POLL, now, now - since[waited]);
		assert_int_equal(exchange_send(world.engine, world.station, LANE_POLL, now), sends);
		assert_int_equal(lane->ready, !sends);
		assert_int_equal(world.bus->sent_count, sends);
		assert_int_equal(world.engine->reserved.until, sends ? 0 : now + 4 * MS);
		close_world(&world);
	}
}

/* Prepares an exchange in this lane and reserves the line for it. True if it is sent now. */
static bool sends_kept(struct world *world, enum lane_kind kind, db_time until)
{
	size_t before = world->bus->sent_count;
	bool sent;

	if (kind == LANE_COMMAND)
		(void)take_command(world, 0);
	(void)prepare(world, world->station, kind);
	world->engine->reserved =
		(struct reserved){ .station = world->station, .lane = kind, .until = until };
	sent = exchange_send_reserved(world->engine, world->bus->now);
	assert_int_equal(world->bus->sent_count, before + sent);
	return sent;
}

static void a_reserved_exchange_is_sent_at_its_time(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	assert_true(sends_kept(&world, LANE_POLL, world.bus->now));
	assert_int_equal(world.engine->reserved.until, 0);
	close_world(&world);
	open_world(&world, DB_MEDIUM_SERIAL);
	assert_false(sends_kept(&world, LANE_POLL, world.bus->now + 1));
	close_world(&world);
	/* With 0 the line is not reserved any more. */
	open_world(&world, DB_MEDIUM_SERIAL);
	assert_false(sends_kept(&world, LANE_POLL, 0));
	close_world(&world);
}

/* A command waits until the effect of the stop was seen. A status read does not wait: it is what
 * shows the effect. */
static void no_command_is_sent_before_a_stop_has_an_effect(void **state)
{
	(void)state;
	for (unsigned reads = 0; reads < 2; reads++) {
		struct world world;

		open_world(&world, DB_MEDIUM_SERIAL);
		world.station->standing.kind = DB_CMD_STOP;
		assert_true(station_awaits_stop(world.station));
		assert_int_equal(
			sends_kept(&world, reads ? LANE_POLL : LANE_COMMAND, world.bus->now),
			reads);
		assert_int_equal(world.engine->reserved.until, 0);
		world.station->standing.kind = DB_CMD_NONE;
		if (!reads)
			finish_command(&world);
		close_world(&world);
	}
}

/* The drive is out of step, and only a probe can change that. */
static void out_of_step_only_a_probe_is_sent(void **state)
{
	(void)state;
	for (unsigned probes = 0; probes < 2; probes++) {
		struct world world;

		open_world(&world, DB_MEDIUM_SERIAL);
		world.node->in_step = false;
		assert_int_equal(
			sends_kept(&world, probes ? LANE_PROBE : LANE_POLL, world.bus->now),
			probes);
		assert_int_equal(world.engine->reserved.until, 0);
		close_world(&world);
	}
}

/* --- sending ---------------------------------------------------------------------------------- */

static void an_exchange_that_is_sent_is_recorded(void **state)
{
	struct world world;
	struct lane *lane;
	uint32_t transactions;
	unsigned exchanges;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	transactions = fake_stats(world.bus).transactions;
	exchanges = world.engine->exchange_count;
	world.node->doubled.seen_count = 1;
	lane = prepare(&world, world.station, LANE_POLL);
	assert_true(exchange_send(world.engine, world.station, LANE_POLL, world.bus->now));
	assert_false(lane->ready);
	assert_true(lane->sent);
	assert_int_equal(lane->exchange.sending, exchanges + 1);
	assert_int_equal(fake_stats(world.bus).transactions, transactions + 1);
	assert_int_equal(world.node->doubled.seen_count, 0);
	close_world(&world);
}

/* Sends a status read. Returns its time on the wire; *counts: wire_time() was called for it. */
static db_time send_reading(struct world *world, bool *counts)
{
	db_time wire;

	counted = 0;
	world->station->lanes[LANE_POLL].ready = true;
	assert_true(exchange_send(world->engine, world->station, LANE_POLL, world->bus->now));
	wire = world->node->flight.wire;
	*counts = counted > 0;
	world->node->flight.station = NULL;
	world->engine->flights = 0;
	world->engine->wire_free = 0;
	return wire;
}

/* On CAN wire_time() counts a frame's stuff bits, which is slow. So the result is kept for the
 * next status read with the same request and the same length of the answer. */
static void on_can_the_wire_time_of_a_status_read_is_kept(void **state)
{
	struct world world;
	struct db_exchange *exchange;
	db_time wire;
	bool counts;

	(void)state;
	open_world(&world, DB_MEDIUM_CAN);
	world.transport.wire_time = count_wire_time;
	world.bus->config.transport = &world.transport;
	exchange = &prepare(&world, world.station, LANE_POLL)->exchange;
	world.node->poll_wire = 0;
	world.node->poll_answer = exchange->answer_length;
	memcpy(&world.node->poll_frame, exchange->request, sizeof world.node->poll_frame);
	wire = (1 + 16 + 16) * (MS / 100);
	assert_int_equal(send_reading(&world, &counts), wire);
	assert_true(counts);
	assert_int_equal(send_reading(&world, &counts), wire);
	assert_false(counts);
	exchange->answer_length = 20;
	assert_int_equal(send_reading(&world, &counts), wire + 4 * (MS / 100));
	assert_true(counts);
	assert_int_equal(send_reading(&world, &counts), wire + 4 * (MS / 100));
	assert_false(counts);
	exchange->request[0] = 2;
	assert_int_equal(send_reading(&world, &counts), wire + 5 * (MS / 100));
	assert_true(counts);
	assert_int_equal(send_reading(&world, &counts), wire + 5 * (MS / 100));
	assert_false(counts);
	exchange->request[0] = 1;
	/* A command does not use the kept time, and does not change it. */
	(void)take_command(&world, 0);
	(void)prepare(&world, world.station, LANE_COMMAND);
	counted = 0;
	world.node->poll_wire = 77;
	assert_true(exchange_send(world.engine, world.station, LANE_COMMAND, world.bus->now));
	assert_int_equal(world.node->flight.wire, wire);
	assert_int_equal(world.node->poll_wire, 77);
	finish_command(&world);
	close_world(&world);
}

/* A serial line has no stuff bits, so wire_time() is called each time and nothing is kept. */
static void on_a_line_the_wire_time_is_not_kept(void **state)
{
	struct world world;
	bool counts;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	world.transport.wire_time = count_wire_time;
	world.bus->config.transport = &world.transport;
	(void)prepare(&world, world.station, LANE_POLL);
	for (unsigned i = 0; i < 2; i++) {
		(void)send_reading(&world, &counts);
		assert_true(counts);
		assert_int_equal(world.node->poll_wire, 0);
	}
	close_world(&world);
}

/* In a common start, the frames before the one that begins the motions have no effect yet. */
static void a_command_counts_as_sent_when_it_may_have_an_effect(void **state)
{
	static const struct {
		uint32_t group;
		bool alone, counts;
	} cases[] = {
		{ 0, false, true }, { 0, true, true }, { 7, true, true }, { 7, false, false }
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct world world;
		struct db_request *request;

		open_world(&world, DB_MEDIUM_SERIAL);
		request = take_command(&world, cases[i].group);
		(void)prepare(&world, world.station, LANE_COMMAND);
		world.station->starts_alone = cases[i].alone;
		assert_true(
			exchange_send(world.engine, world.station, LANE_COMMAND, world.bus->now));
		assert_int_equal(request->sent, cases[i].counts ? world.bus->now : 0);
		finish_command(&world);
		close_world(&world);
	}
}

/* --- ending ----------------------------------------------------------------------------------- */

/* The drive with the least use of the line is read next. A very late answer counts at most as
 * much as DB_SHARE_LATE_TURNS usual exchanges, so the drive waits for some turns only. */
static void a_late_drive_loses_some_turns_only(void **state)
{
	struct world world;
	db_time usual;
	db_time used;

	(void)state;
	open_world(&world, DB_MEDIUM_SERIAL);
	(void)prepare(&world, world.station, LANE_PROBE);
	assert_true(exchange_send(world.engine, world.station, LANE_PROBE, world.bus->now));
	usual = world.node->flight.wire + world.node->hold.now;
	used = world.node->used;
	exchange_end(world.engine, world.node, world.bus->now + 5000 * MS);
	assert_int_equal(world.node->used, used + DB_SHARE_LATE_TURNS * usual);
	close_world(&world);
}

/* After a probe the engine checks whether parameters are to be read. A status read gives no
 * reason to. */
static void after_a_probe_parameters_may_have_to_be_read(void **state)
{
	(void)state;
	for (unsigned reads = 0; reads < 2; reads++) {
		const enum lane_kind kind = reads ? LANE_POLL : LANE_PROBE;
		struct world world;

		open_world(&world, DB_MEDIUM_SERIAL);
		(void)prepare(&world, world.station, kind);
		assert_true(exchange_send(world.engine, world.station, kind, world.bus->now));
		world.engine->may_identify = false;
		exchange_end(world.engine, world.node, world.bus->now);
		assert_int_equal(world.engine->may_identify, !reads);
		close_world(&world);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_job_begins_without_the_state_of_the_last_one),
		cmocka_unit_test(a_stop_makes_the_drives_active),
		cmocka_unit_test(a_reservation_is_for_one_drive_and_lane),
		cmocka_unit_test(a_prepared_stop_waits_while_the_line_is_reserved_for_stops),
		cmocka_unit_test(a_frame_is_delayed_for_a_limited_time),
		cmocka_unit_test(a_reserved_exchange_is_sent_at_its_time),
		cmocka_unit_test(no_command_is_sent_before_a_stop_has_an_effect),
		cmocka_unit_test(out_of_step_only_a_probe_is_sent),
		cmocka_unit_test(an_exchange_that_is_sent_is_recorded),
		cmocka_unit_test(on_can_the_wire_time_of_a_status_read_is_kept),
		cmocka_unit_test(on_a_line_the_wire_time_is_not_kept),
		cmocka_unit_test(a_command_counts_as_sent_when_it_may_have_an_effect),
		cmocka_unit_test(a_late_drive_loses_some_turns_only),
		cmocka_unit_test(after_a_probe_parameters_may_have_to_be_read),
	};

	return cmocka_run_group_tests_name("sched/exchange_sent", tests, NULL, NULL);
}
