/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The schedule where several exchanges are under way at once (CAN), where drives report by
 * themselves, and where several drives share an address: in made-up time, with a made-up family.
 */
#include "fakes/bus.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 12
#define MS DB_NS_PER_MS
#define US DB_NS_PER_US

/* --- the family: drives may report, and nothing is said twice ------------------------------------- */

static enum db_step begin_once(struct db_conversation *talk)
{
	enum db_step step = fake_family.begin(talk);

	talk->exchange->repeatable = false;
	return step;
}

static bool take_report(struct db_device *device, const uint8_t *bytes, size_t length, db_time now)
{
	if (fake_frame_at(bytes, length).kind != FAKE_REPORT)
		return false;
	device->reports++;
	device->taken = now;
	return true;
}

static bool wants_poll(const struct db_device *device, db_time now)
{
	return now - device->taken > 15 * MS || device->reports == 0;
}

/* --- the world ------------------------------------------------------------------------------------- */

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	db_time latency; /* of every drive */
	uint8_t parts;   /* of every answer */
	bool full;       /* the port takes nothing */
	db_time flying_until[DRIVES + 1];
	unsigned most_at_once; /* exchanges under way */
	db_time last_stop;
};

static bool is_flying(const struct world *world, size_t address)
{
	return world->flying_until[address] > world->bus->now;
}

static unsigned all_flying(const struct world *world)
{
	unsigned count = 0;

	for (size_t i = 0; i <= DRIVES; i++)
		count += is_flying(world, i);
	return count;
}

/* The answer comes in parts. */
static db_time answer_in_parts(void *context, struct fake_frame *frame)
{
	struct world *world = context;
	db_time after = world->latency;

	assert_false(world->full);
	if (frame->kind == FAKE_STOP)
		world->last_stop = world->bus->now;
	/* Never two for one drive. */
	assert_false(is_flying(world, frame->address));
	frame->parts = world->parts;
	for (frame->part = 1; frame->part <= frame->parts; frame->part++) {
		after += 50 * US;
		fake_answer_after(world->bus, after, frame, sizeof *frame);
	}
	world->flying_until[frame->address] = world->bus->now + after;
	if (all_flying(world) > world->most_at_once)
		world->most_at_once = all_flying(world);
	return 0;
}

static struct world *open_world(size_t drives, unsigned axes)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->driver.medium = DB_MEDIUM_CAN;
	world->driver.acknowledges = false;
	world->driver.begin = begin_once;
	world->driver.report = take_report;
	world->driver.wants_poll = wants_poll;
	world->parts = 1;
	world->latency = 300 * US;
	world->bus = fake_bus_new(&world->driver, drives);
	world->bus->context = world;
	world->bus->obey = answer_in_parts;
	for (size_t i = 0; i < drives; i++) {
		world->bus->drives[i].address = (unsigned)(i / axes) + 1;
		world->bus->drives[i].axis = (unsigned)(i % axes);
	}
	fake_bus_open(world->bus, drives, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	fake_forget_sent(world->bus);
	world->most_at_once = 0;
	return world;
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

/* --- several at once ---------------------------------------------------------------------------------- */

static void several_are_under_way_but_one_for_each_drive(void **state)
{
	struct world *world = open_world(DRIVES, 1);
	struct db_bus_stats stats;

	(void)state;
	fake_pass(world->bus, 100 * MS);
	/* A millisecond of the wire ahead, at 200 us each, and those whose drives still think. */
	assert_true(world->most_at_once >= 4);
	assert_true(world->most_at_once <= 8);
	for (unsigned i = 1; i <= DRIVES; i++)
		assert_in_range(fake_count(world->bus, i, FAKE_POLL), 5, 6);
	stats = fake_stats(world->bus);
	assert_int_equal(stats.online, DRIVES);
	assert_int_equal(stats.timeouts, 0);
	/* Twelve at 200 us, and not twelve at half a millisecond. */
	assert_in_range(stats.cycle_us, 1500, 3200);
	close_world(world);
}

static void an_answer_of_several_frames_is_waited_for(void **state)
{
	struct world *world = open_world(3, 1);
	int32_t polls;

	(void)state;
	world->parts = 3;
	polls = fake_feedback(world->bus, 0).position;
	fake_pass(world->bus, 100 * MS);
	assert_in_range(fake_feedback(world->bus, 0).position - polls, 4, 6);
	close_world(world);
}

static void a_dead_drive_costs_the_others_nothing(void **state)
{
	struct world *world = open_world(DRIVES, 1);
	struct db_bus_stats stats;

	(void)state;
	world->bus->dead[5] = true;
	fake_pass(world->bus, 400 * MS);
	assert_false(fake_feedback(world->bus, 4).status & DB_STATUS_ONLINE);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 1000 * MS);
	for (unsigned i = 1; i <= DRIVES; i++) {
		if (i != 5)
			assert_in_range(fake_count(world->bus, i, FAKE_POLL), 49, 51);
	}
	stats = fake_stats(world->bus);
	assert_int_equal(stats.online, DRIVES - 1);
	/* It is still looked for, and found when it is back. */
	assert_true(fake_count(world->bus, 5, FAKE_PROBE) > 0);
	world->bus->dead[5] = false;
	fake_pass(world->bus, 2500 * MS);
	assert_true(fake_feedback(world->bus, 4).status & DB_STATUS_ONLINE);
	close_world(world);
}

static void a_stop_does_not_wait_for_others(void **state)
{
	struct world *world = open_world(DRIVES, 1);
	db_time posted;

	(void)state;
	world->latency = 5 * MS; /* many are under way */
	fake_pass(world->bus, 100 * MS + 500 * US);
	assert_true(all_flying(world) > 0);
	while (is_flying(world, 7))
		fake_pass(world->bus, 100 * US);
	posted = world->bus->now;
	fake_post(world->bus, 6, DB_CMD_STOP);
	fake_pass(world->bus, 1 * MS);
	assert_true(world->last_stop >= posted);
	assert_true(world->last_stop - posted < 10 * US);
	fake_pass(world->bus, 20 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

static void a_full_port_loses_and_doubles_nothing(void **state)
{
	struct world *world = open_world(DRIVES, 1);
	struct db_bus_stats before;
	struct db_bus_stats after;

	(void)state;
	before = fake_stats(world->bus);
	fake_post(world->bus, 2, DB_CMD_ENABLE);
	/* answer_in_parts() fails the test when anything is sent now. */
	db_engine_hold(world->bus->engine, true, world->bus->now);
	world->full = true;
	fake_pass(world->bus, 300 * MS);
	world->full = false;
	db_engine_hold(world->bus->engine, false, world->bus->now);
	fake_pass(world->bus, 50 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 3, FAKE_COMMAND), 1);
	after = fake_stats(world->bus);
	assert_int_equal(after.timeouts, before.timeouts);
	close_world(world);
}

/* The bus's thread would run without a pause otherwise, perhaps at real-time priority. */
static void a_full_port_lets_the_engine_sleep(void **state)
{
	struct world *world = open_world(DRIVES, 1);
	unsigned turns = 0;
	db_time end;

	(void)state;
	while (all_flying(world) == 0)
		fake_pass(world->bus, 50 * US);
	end = world->bus->now + 300 * MS;
	db_engine_hold(world->bus->engine, true, world->bus->now);
	world->full = true;
	while (world->bus->now < end && turns < 1000) {
		world->bus->now = db_engine_run(world->bus->engine, world->bus->now);
		turns++;
	}
	/* One for each cycle, and not for ever when the answers are overdue. */
	assert_in_range(turns, 1, 100);
	close_world(world);
}

/* --- reports ------------------------------------------------------------------------------------------ */

static void a_drive_that_reports_is_not_polled(void **state)
{
	struct world *world = open_world(2, 1);
	struct fake_frame report = { .address = 1, .kind = FAKE_REPORT };
	struct db_bus_stats stats;

	(void)state;
	for (unsigned i = 0; i < 20; i++) {
		fake_receive(world->bus, &report, sizeof report);
		fake_pass(world->bus, 10 * MS);
	}
	assert_true(fake_count(world->bus, 1, FAKE_POLL) <= 1);
	assert_in_range(fake_count(world->bus, 2, FAKE_POLL), 9, 11);
	stats = fake_stats(world->bus);
	assert_int_equal(stats.reports, 20);
	/* It falls silent: asked again. */
	fake_pass(world->bus, 100 * MS);
	assert_true(fake_count(world->bus, 1, FAKE_POLL) >= 4);
	close_world(world);
}

static void what_nobody_asked_for_is_counted(void **state)
{
	struct world *world = open_world(2, 1);
	struct fake_frame unknown = { .address = 9, .kind = FAKE_POLL };
	struct fake_frame unasked = { .address = 1, .kind = FAKE_COMMAND };
	struct fake_frame foreign = { .kind = FAKE_FOREIGN };
	struct fake_frame bad = { .address = 0 };
	struct db_bus_stats stats;

	(void)state;
	fake_pass(world->bus, 5 * MS);
	fake_receive(world->bus, &unknown, sizeof unknown);
	fake_receive(world->bus, &unasked, sizeof unasked);
	fake_receive(world->bus, &foreign, sizeof foreign);
	fake_receive(world->bus, &bad, sizeof bad);
	stats = fake_stats(world->bus);
	assert_int_equal(stats.stray_frames, 2);
	assert_int_equal(stats.bad_frames, 1);
	close_world(world);
}

/* --- several drives at one address ----------------------------------------------------------------------- */

static void a_controller_is_polled_once_for_all_its_axes(void **state)
{
	struct world *world = open_world(8, 4);

	(void)state;
	fake_pass(world->bus, 200 * MS);
	assert_in_range(fake_count(world->bus, 1, FAKE_POLL), 9, 11);
	assert_in_range(fake_count(world->bus, 2, FAKE_POLL), 9, 11);
	for (size_t i = 0; i < 8; i++) {
		assert_true(fake_feedback(world->bus, i).status & DB_STATUS_ONLINE);
		assert_true(fake_feedback(world->bus, i).status & DB_STATUS_PARAMS_VALID);
		assert_true(fake_feedback(world->bus, i).taken ==
		            fake_feedback(world->bus, i / 4 * 4).taken);
		assert_true(world->bus->now - fake_feedback(world->bus, i).taken < 25 * MS);
	}
	close_world(world);
}

static void all_axes_of_a_dead_controller_are_offline(void **state)
{
	struct world *world = open_world(8, 4);
	struct db_bus_stats stats;

	(void)state;
	world->bus->dead[2] = true;
	fake_post(world->bus, 6, DB_CMD_ENABLE);
	fake_pass(world->bus, 300 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_TIMEOUT);
	for (size_t i = 0; i < 8; i++)
		assert_int_equal(!!(fake_feedback(world->bus, i).status & DB_STATUS_ONLINE), i < 4);
	stats = fake_stats(world->bus);
	assert_int_equal(stats.online, 4);
	fake_post(world->bus, 7, DB_CMD_ENABLE);
	fake_pass(world->bus, 1 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OFFLINE);
	close_world(world);
}

static void a_stop_of_one_axis_leaves_the_other_alone(void **state)
{
	struct world *world = open_world(4, 4);

	(void)state;
	fake_post(world->bus, 1, DB_CMD_ENABLE);
	fake_post(world->bus, 2, DB_CMD_STOP);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_COMMAND), 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	close_world(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(several_are_under_way_but_one_for_each_drive),
		cmocka_unit_test(an_answer_of_several_frames_is_waited_for),
		cmocka_unit_test(a_dead_drive_costs_the_others_nothing),
		cmocka_unit_test(a_stop_does_not_wait_for_others),
		cmocka_unit_test(a_full_port_loses_and_doubles_nothing),
		cmocka_unit_test(a_full_port_lets_the_engine_sleep),
		cmocka_unit_test(a_drive_that_reports_is_not_polled),
		cmocka_unit_test(what_nobody_asked_for_is_counted),
		cmocka_unit_test(a_controller_is_polled_once_for_all_its_axes),
		cmocka_unit_test(all_axes_of_a_dead_controller_are_offline),
		cmocka_unit_test(a_stop_of_one_axis_leaves_the_other_alone),
	};

	return cmocka_run_group_tests_name("sched/engine_shared", tests, NULL, NULL);
}
