/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What others see of a drive: its snapshot, which the bus's thread publishes, and its nameplate.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static struct fake_bus *open_bus(const struct db_driver *driver)
{
	struct fake_bus *bus = fake_bus_new(driver, 1);

	fake_bus_open(bus, 1, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	return bus;
}

static struct db_snapshot publish(struct fake_bus *bus)
{
	engine_publish(bus->engine, bus->engine->stations[0]);
	return fake_snapshot(bus, 0);
}

/* --- feedback --------------------------------------------------------------------------------- */

static void a_drive_that_never_answered_has_no_time_of_its_data(void **state)
{
	struct fake_bus *bus = fake_bus_new(&fake_family, 1);
	struct db_snapshot shown;

	(void)state;
	bus->dead[1] = true;
	fake_bus_open(bus, 1, NULL);
	bus->engine->wall_offset_us = 1700000000000000;
	fake_port(bus, 0);
	fake_pass(bus, 300 * MS);
	shown = publish(bus);
	assert_int_equal(shown.feedback.taken, 0);
	assert_int_equal(shown.feedback.taken_wall_us, 0);
	assert_int_equal(shown.stats.samples, 0);
	assert_int_equal(shown.feedback.state, DB_AXIS_OFFLINE);
	fake_bus_free(bus);
}

static void a_sample_has_the_time_at_which_it_was_taken(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);
	struct db_snapshot shown;

	(void)state;
	bus->engine->wall_offset_us = 1700000000000000;
	fake_pass(bus, 100 * MS);
	shown = publish(bus);
	assert_int_equal(shown.feedback.taken_wall_us,
	                 shown.feedback.taken / DB_NS_PER_US + 1700000000000000);
	/* The clock is set: what was taken before keeps its time. */
	bus->engine->wall_offset_us += 1000000;
	assert_int_equal(publish(bus).feedback.taken_wall_us, shown.feedback.taken_wall_us);
	/* What is not known any more has none. */
	bus->engine->stations[0]->device->taken = 0;
	assert_int_equal(publish(bus).feedback.taken_wall_us, 0);
	fake_bus_free(bus);
}

/* Not what it did last. */
static void a_drive_that_is_gone_shows_nothing_but_why(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);
	struct db_snapshot shown;

	(void)state;
	fake_post(bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(bus, 100 * MS);
	assert_true(fake_feedback(bus, 0).status & DB_STATUS_MOVING);
	bus->dead[1] = true;
	fake_pass(bus, 500 * MS);
	shown = fake_snapshot(bus, 0);
	assert_int_equal(shown.feedback.status, DB_STATUS_BUS_UP);
	assert_int_equal(shown.feedback.state, DB_AXIS_OFFLINE);
	assert_int_equal(shown.feedback.error, DB_ERROR_NO_ANSWER);
	/* That it must stand shows nevertheless. */
	fake_post(bus, 0, DB_CMD_STOP);
	fake_pass(bus, 100 * MS);
	shown = fake_snapshot(bus, 0);
	assert_int_equal(shown.feedback.status, DB_STATUS_BUS_UP | DB_STATUS_MUST_STAND);
	assert_int_equal(shown.must_stand.command, DB_CMD_STOP);
	fake_port(bus, 5);
	shown = fake_snapshot(bus, 0);
	assert_int_equal(shown.feedback.status, DB_STATUS_MUST_STAND);
	assert_int_equal(shown.feedback.error, DB_ERROR_BUS_DOWN);
	fake_bus_free(bus);
}

static void the_interval_of_readings_shows(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);

	(void)state;
	bus->engine->nodes[0]->interval = 35 * MS;
	assert_int_equal(publish(bus).stats.poll_interval_us, 35000);
	fake_bus_free(bus);
}

static void sums_of_round_trips_show(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);
	struct db_axis_stats before = publish(bus).stats;
	struct db_axis_stats after;

	(void)state;
	station_count_answer(bus->engine->stations[0], 700 * DB_NS_PER_US, true);
	/* When this one arrived is not known. */
	station_count_answer(bus->engine->stations[0], 900 * MS, false);
	after = publish(bus).stats;
	assert_int_equal(after.answers - before.answers, 2);
	assert_int_equal(after.round_trips - before.round_trips, 1);
	assert_int_equal(after.round_trip_sum_us - before.round_trip_sum_us, 700);
	assert_int_equal(after.round_trip_us, 700);
	assert_int_equal(after.round_trip_max_us, 700);
	fake_bus_free(bus);
}

/* --- what is wrong with it -------------------------------------------------------------------- */

static void two_drives_show_as_long_as_they_are_taken_to_answer(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);
	struct node *node = bus->engine->nodes[0];
	db_time now = bus->engine->now;
	struct db_trouble begun;

	(void)state;
	assert_int_equal(publish(bus).trouble.cause, DB_TROUBLE_NONE);
	assert_int_equal(publish(bus).trouble.uncertain_until, 0);
	node->doubled.until = now + 10 * MS;
	begun = publish(bus).trouble;
	assert_int_equal(begun.cause, DB_TROUBLE_TWO_DRIVES);
	assert_int_equal(begun.since, now);
	assert_int_equal(begun.uncertain_until, now + 10 * MS);
	/* Since it began, not since it was looked at. */
	bus->engine->now = now + 10 * MS - 1;
	assert_int_equal(publish(bus).trouble.since, now);
	bus->engine->now = now + 10 * MS;
	assert_int_equal(publish(bus).trouble.cause, DB_TROUBLE_NONE);
	assert_int_equal(publish(bus).trouble.since, now + 10 * MS);
	fake_bus_free(bus);
}

static void why_a_drive_is_silent_shows(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);
	struct node *node = bus->engine->nodes[0];

	(void)state;
	bus->dead[1] = true;
	fake_pass(bus, 500 * MS);
	assert_int_equal(publish(bus).trouble.cause, DB_TROUBLE_NO_ANSWER);
	node->timing = DB_TROUBLE_LATE;
	node->late_ms = 17;
	assert_int_equal(publish(bus).trouble.cause, DB_TROUBLE_LATE);
	assert_int_equal(publish(bus).trouble.late_ms, 17);
	node->unusable.count = 1;
	assert_int_equal(publish(bus).trouble.cause, DB_TROUBLE_NOT_UNDERSTOOD);
	fake_bus_free(bus);
}

/* --- what was learnt -------------------------------------------------------------------------- */

static struct db_learnt learnt(struct fake_bus *bus, int32_t gap, int32_t hold, int32_t latency)
{
	struct node *node = bus->engine->nodes[0];

	node->gap.begin = node->hold.begin = (int32_t)(100 * DB_NS_PER_US);
	node->gap.now = gap;
	node->hold.now = hold;
	node->patience.begin = (int32_t)(10 * MS);
	node->patience.now = latency;
	return publish(bus).learnt;
}

static void what_was_learnt_of_its_times_shows(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);
	const int32_t us = (int32_t)DB_NS_PER_US;
	const int32_t ms = (int32_t)MS;

	(void)state;
	/* As configured. */
	assert_int_equal(learnt(bus, 100 * us, 100 * us, 10 * ms).gap_us, 0);
	assert_int_equal(learnt(bus, 100 * us, 100 * us, 10 * ms).latency_ms, 0);
	/* Whichever of the two pauses is longer; where none is, the shorter one. */
	assert_int_equal(learnt(bus, 300 * us, 200 * us, 10 * ms).gap_us, 300);
	assert_int_equal(learnt(bus, 200 * us, 300 * us, 10 * ms).gap_us, 300);
	assert_int_equal(learnt(bus, 300 * us, 60 * us, 10 * ms).gap_us, 300);
	assert_int_equal(learnt(bus, 60 * us, 300 * us, 10 * ms).gap_us, 300);
	assert_int_equal(learnt(bus, 100 * us, 60 * us, 10 * ms).gap_us, 60);
	assert_int_equal(learnt(bus, 60 * us, 100 * us, 10 * ms).gap_us, 60);
	assert_int_equal(learnt(bus, 60 * us, 40 * us, 10 * ms).gap_us, 40);
	assert_int_equal(learnt(bus, 65535 * us, 0, 10 * ms).gap_us, 65535);
	assert_int_equal(learnt(bus, 65536 * us, 0, 10 * ms).gap_us, 65535);
	/* A part of a millisecond counts as one. */
	assert_int_equal(learnt(bus, 0, 0, 12 * ms).latency_ms, 12);
	assert_int_equal(learnt(bus, 0, 0, 12 * ms + 1).latency_ms, 13);
	assert_int_equal(learnt(bus, 0, 0, 13 * ms - 1).latency_ms, 13);
	fake_bus_free(bus);
}

/* --- what is told of it ----------------------------------------------------------------------- */

static struct db_outage outage;
static unsigned outages;

static void note_outage(void *context, const struct db_drive_config *drive, enum db_event event,
                        const struct db_feedback *feedback, const struct db_outage *was)
{
	(void)context;
	(void)drive;
	(void)feedback;
	if (event != DB_EVENT_DRIVE_ONLINE || !was)
		return;
	outage = *was;
	outages++;
}

/* Since it was read last. */
static void how_long_a_drive_was_gone_is_told(void **state)
{
	struct fake_bus *bus = open_bus(&fake_family);
	struct db_engine_ops ops = *bus->engine->ops;
	db_time last;

	(void)state;
	outages = 0;
	ops.on_event = note_outage;
	bus->engine->ops = &ops;
	last = fake_feedback(bus, 0).taken;
	bus->dead[1] = true;
	fake_pass(bus, 3000 * MS);
	assert_true(fake_feedback(bus, 0).taken - last < 25 * MS);
	last = fake_feedback(bus, 0).taken;
	bus->dead[1] = false;
	while (!fake_is_online(bus, 0))
		fake_pass(bus, MS / 10);
	assert_int_equal(outages, 1);
	assert_int_equal(outage.cause, DB_TROUBLE_NO_ANSWER);
	assert_in_range(outage.time, bus->now - last - 5 * MS, bus->now - last);
	fake_bus_free(bus);
}

static struct db_feedback told_last;

static void tell_told(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	feedback->status |= told_last.status;
	feedback->error = told_last.error;
	feedback->restarts = told_last.restarts;
	feedback->doubts = told_last.doubts;
}

/* What is told when the drive says this, in the order of these events. */
static void expect_told(struct fake_bus *bus, uint32_t status, uint16_t error,
                        const unsigned counts[5])
{
	static const enum db_event events[] = { DB_EVENT_DRIVE_FAULT, DB_EVENT_DRIVE_FAULT_GONE,
		                                DB_EVENT_DRIVE_WARNING, DB_EVENT_DRIVE_RESTARTED,
		                                DB_EVENT_DRIVE_MAY_HAVE_RESTARTED };
	unsigned before[DB_EVENT_COUNT];

	memcpy(before, bus->told, sizeof before);
	told_last.status = status;
	told_last.error = error;
	fake_pass(bus, 50 * MS);
	for (size_t i = 0; i < 5; i++)
		assert_int_equal(bus->told[events[i]] - before[events[i]], counts[i]);
}

/* Once, when it comes; a warning not beside a fault, and no doubt beside what is certain. */
static void what_changes_is_told_once(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus;

	(void)state;
	told_last = (struct db_feedback){ .status = 0 };
	driver.feedback = tell_told;
	bus = open_bus(&driver);
	expect_told(bus, 0, DB_ERROR_NONE, (const unsigned[]){ 0, 0, 0, 0, 0 });
	expect_told(bus, DB_STATUS_WARNING, DB_ERROR_NONE, (const unsigned[]){ 0, 0, 1, 0, 0 });
	expect_told(bus, DB_STATUS_WARNING, DB_ERROR_NONE, (const unsigned[]){ 0, 0, 0, 0, 0 });
	expect_told(bus, 0, DB_ERROR_NONE, (const unsigned[]){ 0, 0, 0, 0, 0 });
	expect_told(bus, DB_STATUS_WARNING, DB_ERROR_HARDWARE, (const unsigned[]){ 1, 0, 0, 0, 0 });
	expect_told(bus, 0, DB_ERROR_HARDWARE, (const unsigned[]){ 0, 0, 0, 0, 0 });
	expect_told(bus, 0, DB_ERROR_NONE, (const unsigned[]){ 0, 1, 0, 0, 0 });
	told_last.doubts++;
	expect_told(bus, 0, DB_ERROR_NONE, (const unsigned[]){ 0, 0, 0, 0, 1 });
	told_last.restarts++;
	told_last.doubts++;
	expect_told(bus, 0, DB_ERROR_NONE, (const unsigned[]){ 0, 0, 0, 1, 0 });
	expect_told(bus, 0, DB_ERROR_NONE, (const unsigned[]){ 0, 0, 0, 0, 0 });
	fake_bus_free(bus);
}

/* --- its nameplate ---------------------------------------------------------------------------- */

static uint64_t none[1];
static uint32_t told[1];
static union db_value values[1];
static struct db_nameplate plate;

static const struct db_nameplate *give_plate(const struct db_device *device)
{
	(void)device;
	return &plate;
}

static union db_value read_value(const struct fake_bus *bus)
{
	static struct db_nameplate_copy copy;

	db_axis_read_nameplate(bus->list[0].axis, &copy);
	return copy.plate.values[0];
}

/* What it says changes with its generation, or when it was told. */
static void a_nameplate_is_published_when_it_has_changed(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus;

	(void)state;
	driver.param_count = 1;
	driver.nameplate = give_plate;
	plate = (struct db_nameplate){
		.param_count = 1, .valid = none, .missing = none, .values = values, .told = told
	};
	values[0].u = 1;
	bus = open_bus(&driver);
	assert_int_equal(read_value(bus).u, 1);
	values[0].u = 2;
	publish(bus);
	assert_int_equal(read_value(bus).u, 1);
	plate.generation++;
	publish(bus);
	assert_int_equal(read_value(bus).u, 2);
	values[0].u = 3;
	publish(bus);
	assert_int_equal(read_value(bus).u, 2);
	plate.tellings++;
	publish(bus);
	assert_int_equal(read_value(bus).u, 3);
	values[0].u = 4;
	publish(bus);
	assert_int_equal(read_value(bus).u, 3);
	fake_bus_free(bus);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_that_never_answered_has_no_time_of_its_data),
		cmocka_unit_test(a_sample_has_the_time_at_which_it_was_taken),
		cmocka_unit_test(a_drive_that_is_gone_shows_nothing_but_why),
		cmocka_unit_test(the_interval_of_readings_shows),
		cmocka_unit_test(sums_of_round_trips_show),
		cmocka_unit_test(two_drives_show_as_long_as_they_are_taken_to_answer),
		cmocka_unit_test(why_a_drive_is_silent_shows),
		cmocka_unit_test(what_was_learnt_of_its_times_shows),
		cmocka_unit_test(how_long_a_drive_was_gone_is_told),
		cmocka_unit_test(what_changes_is_told_once),
		cmocka_unit_test(a_nameplate_is_published_when_it_has_changed),
	};

	return cmocka_run_group_tests_name("sched/station_shown", tests, NULL, NULL);
}
