/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which frames a stop makes, in which order, and which it does not make: axes of one controller, drives that are out of step or
 * gone, and stops of several exchanges. Made-up drives in made-up time.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define LATENCY (100 * MS)

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	db_time answer_time;
	float speed; /* of all drives */
	bool silent[FAKE_KINDS];
};

static db_time obey(void *context, struct fake_frame *frame)
{
	const struct world *world = context;

	frame->speed = world->speed;
	return world->silent[frame->kind] ? 0 : world->answer_time;
}

/* Not open yet. */
static struct world *new_world(size_t drives)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->answer_time = 2 * MS;
	world->bus = fake_bus_new(&world->driver, drives);
	world->bus->context = world;
	world->bus->obey = obey;
	world->bus->config.drive_latency_ms = LATENCY / MS;
	for (size_t i = 0; i < drives; i++)
		world->bus->drives[i].stop_reaction_ms = 500;
	return world;
}

static void open_world(struct world *world)
{
	fake_bus_open(world->bus, world->bus->drive_count, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 300 * MS);
	fake_forget_sent(world->bus);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

/* A controller with two axes, which still counts as online and has not answered its last question. */
static struct world *out_of_step(void)
{
	struct world *world = new_world(2);

	world->bus->drives[1].address = 1;
	world->bus->drives[1].axis = 1;
	world->bus->config.retries = 8;
	open_world(world);
	world->bus->dead[1] = true;
	while (world->bus->engine->nodes[0]->in_step)
		fake_pass(world->bus, MS);
	assert_true(fake_is_online(world->bus, 0));
	fake_forget_sent(world->bus);
	return world;
}

/* --- axes of one controller ------------------------------------------------------------------- */

/* Its stop stops all axes: what one of them was sent without being able to answer is not sent again for another, but asked
 * about. */
static void a_stop_out_of_step_is_sent_once_for_all_axes(void **state)
{
	struct world *world = out_of_step();

	(void)state;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_post(world->bus, 1, DB_CMD_STOP);
	while (fake_count(world->bus, 1, FAKE_PROBE) == 0)
		fake_pass(world->bus, MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	close_world(world);
}

/* But disabling one axis stops no other one. */
static void a_disable_out_of_step_is_no_stop_of_another_axis(void **state)
{
	for (unsigned disabled = 0; disabled < 2; disabled++) {
		struct world *world = out_of_step();

		(void)state;
		fake_post(world->bus, disabled, DB_CMD_DISABLE);
		while (fake_count(world->bus, 1, FAKE_DISABLE) == 0)
			fake_pass(world->bus, MS);
		fake_post(world->bus, 1 - disabled, DB_CMD_STOP);
		while (fake_count(world->bus, 1, FAKE_PROBE) == 0)
			fake_pass(world->bus, MS);
		assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
		close_world(world);
	}
}

static void tell_no_way(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	feedback->position = 0;
}

/* The controller answers everything but stops; this drive is to be disabled where it runs on. */
static unsigned count_disables(float speed)
{
	struct world *world = new_world(1);
	enum db_result result = DB_RESULT_NONE;
	unsigned disables;

	world->bus->drives[0].on_stop_failure = DB_ON_STOP_FAILURE_DISABLE;
	world->driver.feedback = tell_no_way;
	world->speed = speed;
	open_world(world);
	world->silent[FAKE_STOP] = true;
	fake_post(world->bus, 0, DB_CMD_STOP);
	for (unsigned i = 0; i < 5000 && result == DB_RESULT_NONE; i++) {
		fake_pass(world->bus, MS);
		result = fake_result(world->bus);
	}
	assert_int_equal(result, DB_RESULT_RUNS_ON);
	fake_pass(world->bus, 1000 * MS);
	disables = fake_count(world->bus, 1, FAKE_DISABLE);
	close_world(world);
	return disables;
}

static void an_axis_that_stood_all_the_time_keeps_its_power(void **state)
{
	(void)state;
	assert_int_equal(count_disables(0.0f), 0);
	assert_true(count_disables(1.0f) > 0);
}

/* --- several exchanges ------------------------------------------------------------------------ */

static enum db_step answer_stop_twice(struct db_conversation *talk, const uint8_t *bytes,
                                      size_t length)
{
	if (fake_kind_of(talk->job) == FAKE_STOP && ++talk->job->step < 2)
		return fake_say(talk, FAKE_STOP);
	return fake_family.answer(talk, bytes, length);
}

static void a_stronger_stop_does_not_wait_for_the_rest_of_a_weaker_one(void **state)
{
	struct world *world = new_world(1);

	(void)state;
	world->driver.answer = answer_stop_twice;
	world->answer_time = 20 * MS;
	open_world(world);
	fake_post(world->bus, 0, DB_CMD_STOP);
	while (fake_count(world->bus, 1, FAKE_STOP) == 0)
		fake_pass(world->bus, MS);
	fake_post(world->bus, 0, DB_CMD_DISABLE);
	fake_pass(world->bus, 25 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_DISABLE), 1);
	close_world(world);
}

/* Otherwise a stop without effect would keep the drive from ever being seen to run on or to stop. */
static void a_reading_of_several_exchanges_is_not_interrupted_by_a_repeated_stop(void **state)
{
	struct world *world = new_world(1);
	unsigned polls = 0;
	unsigned stops = 0;

	(void)state;
	fake_option(world->bus, "poll-exchanges", 6);
	world->speed = 1.0f;
	world->bus->drives[0].stop_reaction_ms = 10000;
	open_world(world);
	fake_pass(world->bus, 500 * MS);
	world->answer_time = 30 * MS;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 100 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 2000 * MS);
	for (size_t i = 0; i < world->bus->sent_count; i++) {
		if (world->bus->sent[i].frame.kind == FAKE_POLL) {
			polls++;
		} else if (world->bus->sent[i].frame.kind == FAKE_STOP) {
			assert_true(stops == 0 || polls >= 6);
			stops++;
			polls = 0;
		}
	}
	assert_true(stops > 3);
	close_world(world);
}

/* --- drives that are gone --------------------------------------------------------------------- */

/* All of them stopped answering long ago. */
static struct world *all_gone(void)
{
	struct world *world = new_world(4);

	open_world(world);
	for (unsigned address = 1; address <= 3; address++)
		world->bus->dead[address] = true;
	fake_pass(world->bus, 5000 * MS);
	for (unsigned i = 0; i < 3; i++)
		assert_false(fake_is_online(world->bus, i));
	assert_true(fake_is_online(world->bus, 3));
	return world;
}

/* They share a fifth of the line, and have not one each. */
static void stops_to_all_that_are_gone_leave_the_line_to_others(void **state)
{
	struct world *world = all_gone();
	unsigned stops = 0;

	(void)state;
	for (unsigned i = 0; i < 3; i++)
		fake_post(world->bus, i, DB_CMD_STOP);
	fake_pass(world->bus, 2000 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 10000 * MS);
	for (unsigned address = 1; address <= 3; address++)
		stops += fake_count(world->bus, address, FAKE_STOP);
	assert_in_range(stops, 10000 / 100 / 5 - 2, 10000 / 100 / 5 + 1);
	close_world(world);
}

/* Whatever the stops of another one that is gone have used up. */
static void a_first_stop_to_one_that_is_gone_does_not_wait_for_its_share(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 6; i++) {
		struct world *world = all_gone();

		fake_post(world->bus, 0, DB_CMD_STOP);
		fake_pass(world->bus, 2000 * MS + i * LATENCY);
		fake_post(world->bus, 1, DB_CMD_STOP);
		fake_pass(world->bus, LATENCY + LATENCY / 10);
		assert_int_equal(fake_count(world->bus, 2, FAKE_STOP), 1);
		close_world(world);
	}
}

/* --- stops that are not sent ------------------------------------------------------------------ */

/* Knows without asking that this drive does not take it. */
static enum db_step refuse_stops(struct db_conversation *talk)
{
	if (fake_kind_of(talk->job) != FAKE_STOP)
		return fake_family.begin(talk);
	talk->result = DB_RESULT_REFUSED;
	return DB_STEP_DONE;
}

static void a_stop_that_its_driver_refuses_ends_at_once(void **state)
{
	struct world *world = new_world(1);

	(void)state;
	world->driver.begin = refuse_stops;
	world->speed = 1.0f;
	open_world(world);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_REFUSED);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 0);
	/* It must stand all the same. */
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	close_world(world);
}

/* Knows without asking what the drive does. */
static enum db_step begin_no_poll(struct db_conversation *talk)
{
	if (talk->job->kind != DB_JOB_POLL)
		return fake_family.begin(talk);
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

/* No reading is waited for that never comes. */
static void a_stop_of_a_drive_that_reports_by_itself_keeps_its_pace(void **state)
{
	struct world *world = new_world(1);

	(void)state;
	world->speed = 1.0f;
	world->bus->drives[0].stop_reaction_ms = 5000;
	open_world(world);
	fake_pass(world->bus, 100 * MS);
	world->driver.begin = begin_no_poll;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 500 * MS);
	assert_in_range(fake_count(world->bus, 1, FAKE_STOP), 20, 26);
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

/* It may have been on its way for half a second, and then it shows as much as an answer. */
static void a_report_shows_a_stop_when_it_cannot_be_older(void **state)
{
	const struct fake_frame report = { .address = 1, .kind = FAKE_REPORT, .powered = true };
	struct world *world = new_world(1);
	db_time stopped;

	(void)state;
	world->driver.report = take_report;
	world->speed = 1.0f;
	world->bus->drives[0].stop_reaction_ms = 5000;
	open_world(world);
	fake_pass(world->bus, 100 * MS);
	stopped = world->bus->now;
	world->speed = 0.5f;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 30 * MS);
	/* It obeys, and is left alone. */
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	world->driver.begin = begin_no_poll;
	while (world->bus->now < stopped + 500 * MS) {
		assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
		fake_receive(world->bus, &report, sizeof report);
		fake_pass(world->bus, 40 * MS);
	}
	for (unsigned i = 0; i < 6; i++) {
		fake_receive(world->bus, &report, sizeof report);
		fake_pass(world->bus, 40 * MS);
	}
	assert_false(fake_feedback(world->bus, 0).status & DB_STATUS_MUST_STAND);
	assert_int_equal(fake_count(world->bus, 1, FAKE_STOP), 1);
	close_world(world);
}

/* --- drives that run on ----------------------------------------------------------------------- */

/* Who asks again is told at once that it runs on, but not before the drive was told once more to stop. */
static void each_stop_that_is_asked_for_is_sent(void **state)
{
	struct world *world = new_world(1);
	struct db_request ended;

	(void)state;
	world->speed = 1.0f;
	open_world(world);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_RUNS_ON);
	for (unsigned i = 0; i < 5; i++) {
		db_time posted = world->bus->now;

		fake_post(world->bus, 0, DB_CMD_STOP);
		do {
			fake_pass(world->bus, MS);
			assert_true(world->bus->now <= posted + 200 * MS);
		} while (!fake_collect(world->bus->queue, &ended));
		assert_int_equal(ended.result, DB_RESULT_RUNS_ON);
		assert_true(ended.sent >= posted);
		fake_pass(world->bus, 33 * MS);
	}
	close_world(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_stop_out_of_step_is_sent_once_for_all_axes),
		cmocka_unit_test(a_disable_out_of_step_is_no_stop_of_another_axis),
		cmocka_unit_test(an_axis_that_stood_all_the_time_keeps_its_power),
		cmocka_unit_test(a_stronger_stop_does_not_wait_for_the_rest_of_a_weaker_one),
		cmocka_unit_test(
			a_reading_of_several_exchanges_is_not_interrupted_by_a_repeated_stop),
		cmocka_unit_test(stops_to_all_that_are_gone_leave_the_line_to_others),
		cmocka_unit_test(a_first_stop_to_one_that_is_gone_does_not_wait_for_its_share),
		cmocka_unit_test(a_stop_that_its_driver_refuses_ends_at_once),
		cmocka_unit_test(a_stop_of_a_drive_that_reports_by_itself_keeps_its_pace),
		cmocka_unit_test(a_report_shows_a_stop_when_it_cannot_be_older),
		cmocka_unit_test(each_stop_that_is_asked_for_is_sent),
	};

	return cmocka_run_group_tests_name("sched/stop_frames", tests, NULL, NULL);
}
