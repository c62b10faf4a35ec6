/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the functions of drives.c leave in the engine: they find drives, join parameter writes, take
 * drives online and offline, write the trace and count the round of reads. Three made-up drives.
 */
#include "drivebridge/trace.h"
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define DRIVES 3

struct world {
	struct fake_bus *bus;
	struct db_engine *engine;
	struct db_driver driver;
};

static unsigned gone;

static void count_gone(struct db_device *device)
{
	fake_family.gone(device);
	gone++;
}

/* Three drives with the numbers 10, 11 and 12; all of them answer. */
static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->driver.gone = count_gone;
	world->bus = fake_bus_new(&world->driver, DRIVES);
	world->bus->config.queue = 16;
	for (size_t i = 0; i < DRIVES; i++)
		world->bus->list[i].drive = (uint16_t)(10 + i);
	fake_bus_open(world->bus, DRIVES, NULL);
	world->engine = world->bus->engine;
	fake_port(world->bus, 0);
	fake_pass(world->bus, 505 * MS); /* the time is now between two cycles */
	fake_forget_sent(world->bus);
	gone = 0;
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	fake_bus_free(world->bus);
	free(world);
	return 0;
}

static void drives_are_found_by_number_and_by_address(void **state)
{
	const struct world *world = *state;

	for (size_t i = 0; i < DRIVES; i++) {
		assert_ptr_equal(engine_find_station(world->engine, (uint16_t)(10 + i)),
		                 world->engine->stations[i]);
		assert_ptr_equal(engine_find_node(world->engine, (unsigned)i + 1),
		                 world->engine->nodes[i]);
	}
	assert_null(engine_find_station(world->engine, 0));
	assert_null(engine_find_station(world->engine, 10 + DRIVES));
	assert_null(engine_find_node(world->engine, 0));
	assert_null(engine_find_node(world->engine, DRIVES + 1));
}

/* Whether the engine finds an active drive if the last drive has only this reason (0: none). */
static bool is_active_with(struct world *world, unsigned what)
{
	struct station *station = world->engine->stations[DRIVES - 1];
	const struct standing standing = station->standing;
	bool active;

	station->lanes[LANE_COMMAND].active = what == 1;
	station->lanes[LANE_COMMAND].ready = what == 2;
	station->lanes[LANE_STOP].active = what == 3;
	station->blind_stop_sent = what == 4;
	if (what == 5)
		standing_enter(&station->standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL,
		               world->bus->now);
	active = engine_has_active_drives(world->engine);
	station->lanes[LANE_COMMAND].active = station->lanes[LANE_COMMAND].ready = false;
	station->lanes[LANE_STOP].active = station->blind_stop_sent = false;
	station->standing = standing;
	return active;
}

static void a_drive_that_wants_something_is_active(void **state)
{
	struct world *world = *state;

	for (unsigned what = 1; what <= 5; what++) {
		world->engine->drives_active = true;
		assert_true(is_active_with(world, what));
		assert_true(world->engine->drives_active);
	}
	assert_false(is_active_with(world, 0));
	/* The engine looks at the drives again only after something has happened, here a stop. */
	assert_false(world->engine->drives_active);
	assert_false(is_active_with(world, 1));
	engine_add_stop(world->engine, world->engine->stations[0], DB_CMD_STOP, DB_STAND_CLIENT,
	                NULL, world->bus->now);
	assert_true(engine_has_active_drives(world->engine));
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
}

/* --- writes that join ------------------------------------------------------------------------- */

/* Posts and takes a write of `count` parameters from `first` on; with a count of 0 a command. */
static struct db_request *post(struct world *world, uint16_t drive, uint16_t first, uint8_t count)
{
	struct db_setting settings[DB_SETTINGS_MAX];
	struct db_request request = { .ticket = 1, .drive = drive, .setting_count = count };
	struct db_request *taken;

	if (count == 0)
		request.command = DB_CMD_ENABLE;
	else
		request.settings = settings;
	for (uint8_t i = 0; i < count; i++)
		settings[i] = (struct db_setting){ .param = (uint16_t)(first + i) };
	assert_non_null(db_queue_post(world->bus->queue, &request));
	taken = db_queue_take(world->bus->queue);
	assert_non_null(taken);
	return taken;
}

static void wait_in_turn(struct world *world, struct db_request *request)
{
	world->engine->waiting[world->engine->waiting_count++] = request;
}

static unsigned count_parts(const struct db_request *request)
{
	unsigned count = 0;

	for (const struct db_write_part *part = db_queue_parts(request); part; part = part->next)
		count++;
	return count;
}

/* Ends the request and all requests that still wait. */
static void end(struct world *world, struct db_request *request)
{
	world->engine->stations[0]->request = NULL;
	db_queue_finish(request, DB_RESULT_OK, world->bus->now);
	for (size_t i = 0; i < world->engine->waiting_count; i++)
		db_queue_finish(world->engine->waiting[i], DB_RESULT_OK, world->bus->now);
	world->engine->waiting_count = 0;
	while (fake_result(world->bus) != DB_RESULT_NONE)
		continue;
}

static void writes_of_one_drive_join_past_those_of_others(void **state)
{
	struct world *world = *state;
	struct db_request *first = post(world, 10, 0, 2);
	struct db_request *others[2];
	struct db_request *stale;

	world->engine->stations[0]->request = first;
	others[0] = post(world, 11, 0, 1);
	wait_in_turn(world, others[0]);
	wait_in_turn(world, post(world, 10, 2, 2));
	others[1] = post(world, 12, 0, 0);
	wait_in_turn(world, others[1]);
	wait_in_turn(world, post(world, 10, 4, 1));
	/* An old pointer after the last waiting request: it is not part of the list. */
	stale = post(world, 10, 9, 1);
	world->engine->waiting[world->engine->waiting_count] = stale;
	engine_join_waiting_writes(world->engine, world->engine->stations[0]);
	assert_int_equal(count_parts(first), 3);
	assert_int_equal(world->engine->waiting_count, 2);
	assert_ptr_equal(world->engine->waiting[0], others[0]);
	assert_ptr_equal(world->engine->waiting[1], others[1]);
	db_queue_finish(stale, DB_RESULT_OK, world->bus->now);
	end(world, first);
}

static void a_write_joins_past_many_requests_of_another_drive(void **state)
{
	struct world *world = *state;
	struct db_request *first = post(world, 10, 0, 1);

	world->engine->stations[0]->request = first;
	for (unsigned i = 0; i < 14; i++)
		wait_in_turn(world, post(world, 11, 0, 1));
	wait_in_turn(world, post(world, 10, 1, 1));
	engine_join_waiting_writes(world->engine, world->engine->stations[0]);
	assert_int_equal(count_parts(first), 2);
	assert_int_equal(world->engine->waiting_count, 14);
	end(world, first);
}

/* The number of writes that are joined after a second request has waited for the first, and a third
 * write after the second. If the second does not join, the third may not overtake it. */
static unsigned count_joined(struct world *world, struct db_request *first, uint16_t param,
                             uint8_t count)
{
	unsigned parts;

	world->engine->stations[0]->request = first;
	wait_in_turn(world, post(world, 10, param, count));
	wait_in_turn(world, post(world, 10, 30, 1));
	engine_join_waiting_writes(world->engine, world->engine->stations[0]);
	parts = count_parts(first);
	assert_int_equal(world->engine->waiting_count, 3 - parts);
	end(world, first);
	return parts;
}

static void a_request_that_must_wait_for_a_write_does_not_join_it(void **state)
{
	struct world *world = *state;

	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 3, 1), 3);
	/* One of the parameters, the first or the last, is in the first write as well. */
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 3, 2), 1);
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 4, 1), 1);
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 5, 1), 1);
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 6, 1), 3);
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 0, 1), 3);
	/* A command joins no write. */
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 0, 0), 1);
	/* All joined writes together have at most DB_SETTINGS_MAX parameters. */
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 10, DB_SETTINGS_MAX - 2), 2);
	assert_int_equal(count_joined(world, post(world, 10, 4, 2), 10, DB_SETTINGS_MAX - 1), 1);
}

static void parameters_of_joined_writes_count_like_the_first_ones(void **state)
{
	struct world *world = *state;
	struct db_request *first = post(world, 10, 0, 1);

	world->engine->stations[0]->request = first;
	wait_in_turn(world, post(world, 10, 1, 1));
	engine_join_waiting_writes(world->engine, world->engine->stations[0]);
	/* Parameter 1 came with the write that joined before. */
	wait_in_turn(world, post(world, 10, 2, 1));
	wait_in_turn(world, post(world, 10, 1, 1));
	engine_join_waiting_writes(world->engine, world->engine->stations[0]);
	assert_int_equal(count_parts(first), 3);
	assert_int_equal(world->engine->waiting_count, 1);
	wait_in_turn(world, post(world, 10, 3, 1));
	engine_join_waiting_writes(world->engine, world->engine->stations[0]);
	assert_int_equal(count_parts(first), 3);
	end(world, first);
}

/* --- coming and going ------------------------------------------------------------------------- */

static void a_drive_that_comes_online_begins_anew(void **state)
{
	struct world *world = *state;
	struct node *node = world->engine->nodes[1];
	struct station *station = node->first;
	uint32_t online = fake_stats(world->bus).online;
	uint32_t came = station->snapshot.stats.came_online;
	size_t due = world->engine->nodes_due;

	node->online = node->in_step = node->poll_due = false;
	node->losses = node->free_probes = 7;
	node->probe_backoff = PROBE_BACKOFF_MAX;
	node->timing = DB_TROUBLE_LATE;
	station->identify_at = DB_TIME_NEVER;
	station->identify_backoff = IDENTIFY_BACKOFF_MAX;
	engine_bring_online(world->engine, node, world->bus->now);
	assert_true(node->online && node->in_step && node->poll_due);
	assert_int_equal(node->losses, 0);
	assert_int_equal(node->free_probes, 0);
	assert_int_equal(node->probe_backoff, PROBE_BACKOFF_MIN);
	assert_int_equal(node->timing, DB_TROUBLE_NONE);
	assert_int_equal(station->identify_at, 0);
	assert_int_equal(station->identify_backoff, IDENTIFY_BACKOFF_MIN);
	assert_int_equal(station->snapshot.stats.came_online, came + 1);
	assert_int_equal(world->engine->stats.online, online + 1);
	assert_int_equal(world->engine->nodes_due, due + 1);
	/* A drive that was online and only out of step does not come online again. */
	node->in_step = false;
	node->losses = 7;
	node->timing = DB_TROUBLE_LATE;
	engine_bring_online(world->engine, node, world->bus->now);
	assert_true(node->in_step);
	assert_int_equal(node->losses, 0);
	assert_int_equal(node->timing, DB_TROUBLE_LATE);
	assert_int_equal(world->engine->stats.online, online + 1);
}

static void a_drive_that_goes_offline_has_nothing_under_way(void **state)
{
	struct world *world = *state;
	struct node *node = world->engine->nodes[1];
	struct station *station = node->first;
	uint32_t online = fake_stats(world->bus).online;

	for (size_t i = 0; i < LANE_COUNT; i++)
		station->lanes[i].ready = true;
	station->lanes[LANE_STOP].active = station->lanes[LANE_POLL].active = true;
	station->blind_stop_sent = true;
	node->probe_backoff = PROBE_BACKOFF_MIN;
	wait_in_turn(world, post(world, 11, 0, 0));
	for (unsigned times = 0; times < 2; times++) {
		engine_take_offline(world->engine, node, DB_RESULT_OFFLINE, world->bus->now);
		assert_false(node->online || node->in_step || node->poll_due);
		for (size_t i = 0; i < LANE_COUNT; i++)
			assert_false(station->lanes[i].active || station->lanes[i].ready);
		assert_false(station->blind_stop_sent);
		/* The second call counts nothing, and does not move the next probe. */
		assert_int_equal(world->engine->stats.online, online - 1);
		assert_int_equal(gone, 1);
		assert_int_equal(node->probe_at, world->bus->now + PROBE_BACKOFF_MIN);
		node->probe_backoff = PROBE_BACKOFF_MAX;
	}
	assert_int_equal(fake_result(world->bus), DB_RESULT_OFFLINE);
	assert_int_equal(world->engine->waiting_count, 0);
	assert_false(fake_is_online(world->bus, 1));
}

/* If the drive fell silent the command ends with a timeout, otherwise with the reason why the drive
 * is offline. */
static void a_command_ends_when_its_drive_goes_offline(void **state)
{
	static const enum db_result results[][2] = { { DB_RESULT_OFFLINE, DB_RESULT_TIMEOUT },
		                                     { DB_RESULT_BUS_DOWN, DB_RESULT_BUS_DOWN } };
	struct world *world = *state;

	for (size_t i = 0; i < 2; i++) {
		struct station *station = world->engine->stations[i];

		station->request = post(world, (uint16_t)(10 + i), 0, 0);
		station->lanes[LANE_COMMAND].active = true;
		station->lanes[LANE_COMMAND].sent = false;
		station->lanes[LANE_COMMAND].job = (struct db_job){ .kind = DB_JOB_COMMAND,
			                                            .request = station->request };
		engine_take_offline(world->engine, station->node, results[i][0], world->bus->now);
		assert_int_equal(fake_result(world->bus), results[i][1]);
	}
}

/* The drive had 50 ms to show that it stops. When it is online again, it has only the rest of the
 * time for that. */
static void a_drive_that_was_to_stop_has_used_part_of_its_time(void **state)
{
	struct world *world = *state;
	struct station *station = world->engine->stations[0];

	standing_enter(&station->standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, world->bus->now);
	station->standing.progress = world->bus->now - 50 * MS;
	station->standing.obeys = true;
	engine_take_offline(world->engine, station->node, DB_RESULT_OFFLINE, world->bus->now);
	assert_int_equal(station->standing.progress, -50 * MS);
	assert_false(station->standing.obeys);
}

/* --- the trace -------------------------------------------------------------------------------- */

static db_time take(void *context, const uint8_t *bytes, size_t length)
{
	(void)context;
	(void)bytes;
	(void)length;
	return 7 * MS;
}

/* On CAN each frame has its own record, on a serial line all bytes of a request share one. Neither
 * these nor garbage belong to a question. */
static void sent_bytes_and_garbage_are_traced(void **state)
{
	static const struct db_engine_ops ops = { .send = take };
	static const uint8_t bytes[2 * sizeof(struct db_can_frame)] = "first frame ... second one";
	const size_t frame = sizeof(struct db_can_frame);

	(void)state;
	for (unsigned can = 0; can < 2; can++) {
		struct db_driver driver = fake_family;
		struct fake_bus *bus = fake_bus_new(&driver, 1);
		struct db_trace_place place = { .at = 0 };
		struct db_trace_record record;
		uint32_t missed;
		uint32_t last;

		driver.medium = can ? DB_MEDIUM_CAN : DB_MEDIUM_SERIAL;
		fake_bus_open(bus, 1, &ops);
		last = engine_send(bus->engine, bytes, sizeof bytes, DB_TRACE_STOP);
		for (size_t at = 0; at < sizeof bytes; at += can ? frame : sizeof bytes) {
			assert_true(db_trace_read(bus->engine->trace, &place, &record, &missed));
			assert_int_equal(record.kind, DB_TRACE_STOP);
			assert_int_equal(record.question, 0);
			assert_int_equal(record.time, 7 * MS);
			assert_int_equal(record.length, can ? frame : sizeof bytes);
			assert_memory_equal(record.bytes, bytes + at, record.length);
		}
		assert_int_equal(record.number, last);
		engine_count_garbage(bus->engine, bytes, 5, 8 * MS);
		assert_true(db_trace_read(bus->engine->trace, &place, &record, &missed));
		assert_int_equal(record.kind, DB_TRACE_GARBAGE);
		assert_int_equal(record.question, 0);
		assert_int_equal(record.length, 5);
		assert_int_equal(fake_stats(bus).garbage_bytes, 5);
		assert_false(db_trace_read(bus->engine->trace, &place, &record, &missed));
		fake_bus_free(bus);
	}
}

/* --- rounds ----------------------------------------------------------------------------------- */

static void a_round_of_reads_ends_with_its_last_drive(void **state)
{
	struct world *world = *state;
	struct db_engine *engine = world->engine;

	engine->nodes_due = engine->unread = 0;
	for (size_t i = 0; i < DRIVES; i++) {
		engine->nodes[i]->poll_due = false;
		engine->nodes[i]->unread = true;
		engine->unread++;
		engine_mark_for_reading(engine, engine->nodes[i]);
		engine_mark_for_reading(engine, engine->nodes[i]);
	}
	assert_int_equal(engine->nodes_due, DRIVES);
	engine->round_started = world->bus->now;
	engine->stats.cycle_us = 1;
	engine->stats.cycle_max_us = 2500;
	for (size_t i = 0; i < DRIVES; i++) {
		engine_end_read(engine, engine->nodes[i], engine->round_started + 3 * MS);
		engine_end_read(engine, engine->nodes[i], engine->round_started + 4 * MS);
		assert_int_equal(engine->nodes_due, DRIVES - 1 - i);
		assert_int_equal(engine->stats.cycle_us, i + 1 < DRIVES ? 1 : 3000);
	}
	assert_int_equal(engine->stats.cycle_max_us, 3000);
	engine->nodes[0]->unread = true;
	engine->unread = 1;
	engine_end_read(engine, engine->nodes[0], engine->round_started + 2 * MS);
	assert_int_equal(engine->stats.cycle_us, 2000);
	assert_int_equal(engine->stats.cycle_max_us, 3000);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(drives_are_found_by_number_and_by_address),
		TEST(a_drive_that_wants_something_is_active),
		TEST(writes_of_one_drive_join_past_those_of_others),
		TEST(a_write_joins_past_many_requests_of_another_drive),
		TEST(a_request_that_must_wait_for_a_write_does_not_join_it),
		TEST(parameters_of_joined_writes_count_like_the_first_ones),
		TEST(a_drive_that_comes_online_begins_anew),
		TEST(a_drive_that_goes_offline_has_nothing_under_way),
		TEST(a_command_ends_when_its_drive_goes_offline),
		TEST(a_drive_that_was_to_stop_has_used_part_of_its_time),
		TEST(a_round_of_reads_ends_with_its_last_drive),
		cmocka_unit_test(sent_bytes_and_garbage_are_traced),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
