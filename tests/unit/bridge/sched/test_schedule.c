/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How often each drive of a line is read (docs/schedule.md), in made-up time: 32 drives on a line like RS485 at 115200 baud,
 * where an exchange takes 2.65 ms and a cycle of 10 ms has no room for all.
 */
#include "fakes/bus.h"

#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define DRIVES 32
#define ANSWER (1650 * DB_NS_PER_US)
#define TURNAROUND_US 1000
#define EXCHANGE (2650 * DB_NS_PER_US)
#define CYCLE_MS 10

struct world {
	struct fake_bus *bus;
	unsigned moving;         /* the first so many move */
	unsigned loses[DRIVES];  /* every n-th answer of it is lost; 0: none */
	unsigned asked[DRIVES];  /* polls */
	db_time taken[DRIVES];   /* of the latest sample */
	db_time longest[DRIVES]; /* between two samples */
	db_time since;           /* of what is counted */
	unsigned samples[DRIVES];
};

static db_time obey(void *context, struct fake_frame *frame)
{
	struct world *world = context;
	unsigned drive = frame->address - 1U;

	frame->speed = drive < world->moving ? 100.0f : 0.0f;
	if (frame->kind == FAKE_POLL && world->loses[drive] != 0 &&
	    ++world->asked[drive] % world->loses[drive] == 0)
		return 0;
	return ANSWER;
}

static void watch(void *context)
{
	struct world *world = context;

	for (unsigned i = 0; i < DRIVES; i++) {
		db_time taken = fake_feedback(world->bus, i).taken;

		if (taken == world->taken[i])
			continue;
		if (world->since != 0) {
			db_time last = world->taken[i] > world->since ? world->taken[i] :
			                                                world->since;

			world->samples[i]++;
			if (taken - last > world->longest[i])
				world->longest[i] = taken - last;
		}
		world->taken[i] = taken;
	}
}

static void open_world(struct world *world, size_t drives)
{
	*world = (struct world){ .bus = fake_bus_new(&fake_family, DRIVES) };
	world->bus->config.cycle_ms = CYCLE_MS;
	world->bus->config.turnaround_us = TURNAROUND_US;
	world->bus->config.drive_latency_ms = 30;
	world->bus->context = world;
	world->bus->obey = obey;
	world->bus->turned = watch;
	fake_bus_open(world->bus, drives, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 3000 * MS);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
}

/* So many move from now on; when that is known, samples are counted for so long. */
static void count(struct world *world, unsigned moving, db_time span)
{
	world->moving = moving;
	world->since = 0;
	fake_pass(world->bus, 3000 * MS);
	world->since = world->bus->now;
	for (unsigned i = 0; i < DRIVES; i++)
		world->longest[i] = world->samples[i] = 0;
	fake_pass(world->bus, span);
}

static db_time mean(const struct world *world, unsigned drive, db_time span)
{
	assert_true(world->samples[drive] > 0);
	return span / world->samples[drive];
}

#define SPAN (10000 * MS)

static void one_that_moves_is_read_as_if_it_were_alone(void **state)
{
	struct world alone;
	struct world world;

	(void)state;
	open_world(&alone, 1);
	count(&alone, 1, SPAN);
	open_world(&world, DRIVES);
	count(&world, 1, SPAN);
	assert_true(mean(&world, 0, SPAN) <= mean(&alone, 0, SPAN) * 3 / 2);
	assert_true(world.longest[0] <= alone.longest[0] * 3 / 2);
	for (unsigned i = 1; i < DRIVES; i++)
		assert_true(world.longest[i] <= 130 * MS);
	close_world(&alone);
	close_world(&world);
}

static void four_that_move_take_seventy_percent(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DRIVES);
	count(&world, 4, SPAN);
	for (unsigned i = 0; i < 4; i++) {
		assert_in_range(mean(&world, i, SPAN), 15 * MS, 16 * MS);
		assert_true(world.longest[i] <= 20 * MS);
	}
	for (unsigned i = 4; i < DRIVES; i++)
		assert_true(world.longest[i] <= 300 * MS);
	close_world(&world);
}

static void assert_even(const struct world *world)
{
	for (unsigned i = 0; i < DRIVES; i++) {
		assert_in_range(mean(world, i, SPAN), DRIVES * EXCHANGE - MS,
		                DRIVES * EXCHANGE + MS);
		assert_true(world->longest[i] <= DRIVES * EXCHANGE + EXCHANGE);
	}
}

static void drives_that_all_stand_or_all_move_are_read_evenly(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DRIVES);
	count(&world, 0, SPAN);
	assert_even(&world);
	count(&world, DRIVES, SPAN);
	assert_even(&world);
	close_world(&world);
}

/* Where requests to several drives are on their way at once, what is shared is the time of their frames: 0.2 ms each here. */
static void on_can_one_that_moves_is_read_in_each_cycle(void **state)
{
	struct db_driver driver = fake_family;
	struct world world;

	(void)state;
	driver.medium = DB_MEDIUM_CAN;
	world = (struct world){ .bus = fake_bus_new(&driver, DRIVES) };
	world.bus->config.cycle_ms = 4;
	world.bus->config.drive_latency_ms = 30;
	world.bus->context = &world;
	world.bus->obey = obey;
	world.bus->turned = watch;
	fake_bus_open(world.bus, DRIVES, NULL);
	fake_port(world.bus, 0);
	count(&world, 1, SPAN);
	assert_in_range(mean(&world, 0, SPAN), 4 * MS - MS / 10, 4 * MS + MS / 10);
	assert_true(world.longest[0] <= 6 * MS);
	for (unsigned i = 1; i < DRIVES; i++) {
		assert_in_range(mean(&world, i, SPAN), 5 * MS, 9 * MS);
		assert_true(world.longest[i] <= 13 * MS);
	}
	close_world(&world);
}

static void poll_even_makes_no_difference_between_them(void **state)
{
	struct world world = { .bus = fake_bus_new(&fake_family, DRIVES) };

	(void)state;
	world.bus->config.cycle_ms = CYCLE_MS;
	world.bus->config.turnaround_us = TURNAROUND_US;
	world.bus->config.polls_evenly = true;
	world.bus->context = &world;
	world.bus->obey = obey;
	world.bus->turned = watch;
	fake_bus_open(world.bus, DRIVES, NULL);
	fake_port(world.bus, 0);
	count(&world, 2, SPAN);
	assert_even(&world);
	close_world(&world);
}

/* A command that looks for its effect until enough samples have come, as some do. */
static enum db_step answer_until_sampled(struct db_conversation *talk, const uint8_t *bytes,
                                         size_t length)
{
	enum db_step step = fake_family.answer(talk, bytes, length);

	if (step != DB_STEP_DONE || talk->job->kind != DB_JOB_COMMAND ||
	    db_command_is_stop(talk->job->request->command))
		return step;
	if (talk->job->step == 0)
		talk->job->step = (uint16_t)(talk->device->polls + 4);
	if (talk->device->polls >= talk->job->step)
		return DB_STEP_DONE;
	talk->exchange->again = true;
	return fake_say(talk, FAKE_COMMAND);
}

/* What asks again and the samples that it waits for take turns, however full the line is. */
static void commands_that_ask_again_do_not_keep_samples_away(void **state)
{
	struct db_driver driver = fake_family;
	struct world world;

	(void)state;
	driver.answer = answer_until_sampled;
	world = (struct world){ .bus = fake_bus_new(&driver, DRIVES) };
	world.bus->config.cycle_ms = 6;
	world.bus->config.turnaround_us = TURNAROUND_US;
	world.bus->config.drive_latency_ms = 30;
	fake_option(world.bus, "poll-exchanges", 6);
	world.bus->context = &world;
	world.bus->obey = obey;
	world.bus->turned = watch;
	fake_bus_open(world.bus, 4, NULL);
	fake_port(world.bus, 0);
	count(&world, 4, 1000 * MS);
	for (unsigned i = 0; i < 3; i++)
		fake_post(world.bus, i, DB_CMD_MOVE_VELOCITY);
	fake_pass(world.bus, 3000 * MS);
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
	for (unsigned i = 0; i < 4; i++)
		assert_true(world.longest[i] <= 400 * MS);
	close_world(&world);
}

static void one_that_was_commanded_is_read_as_often_for_a_second(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DRIVES);
	count(&world, 0, 1000 * MS);
	fake_post(world.bus, 7, DB_CMD_ENABLE);
	fake_pass(world.bus, 20 * MS);
	assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
	world.samples[7] = 0;
	fake_pass(world.bus, 900 * MS);
	assert_true(world.samples[7] >= 85);
	fake_pass(world.bus, 200 * MS);
	world.samples[7] = 0;
	fake_pass(world.bus, 1000 * MS);
	assert_true(world.samples[7] <= 12);
	close_world(&world);
}

/* What is said of the interval is what is seen of it. */
static void the_interval_that_is_told_is_kept(void **state)
{
	static const unsigned moving[] = { 0, 1, 3, 4, 10, DRIVES };
	struct world world;

	(void)state;
	open_world(&world, DRIVES);
	for (size_t n = 0; n < sizeof moving / sizeof moving[0]; n++) {
		count(&world, moving[n], SPAN);
		for (unsigned i = 0; i < DRIVES; i++) {
			db_time told = fake_snapshot(world.bus, i).stats.poll_interval_us *
			               DB_NS_PER_US;

			assert_in_range(mean(&world, i, SPAN), told * 8 / 10, told * 11 / 10);
			assert_true(world.longest[i] <= told * 3);
		}
	}
	close_world(&world);
}

/* Each loss takes the line for as long as twelve exchanges; a poll is six of them, which follow each other. */
static void one_that_loses_answers_pays_with_its_own_turns(void **state)
{
	struct world world = { .bus = fake_bus_new(&fake_family, DRIVES) };
	db_time before;

	(void)state;
	world.bus->config.cycle_ms = CYCLE_MS;
	world.bus->config.turnaround_us = TURNAROUND_US;
	world.bus->config.drive_latency_ms = 30;
	fake_option(world.bus, "poll-exchanges", 6);
	world.bus->context = &world;
	world.bus->obey = obey;
	world.bus->turned = watch;
	fake_bus_open(world.bus, 2, NULL);
	fake_port(world.bus, 0);
	count(&world, 2, SPAN);
	before = mean(&world, 1, SPAN);
	assert_in_range(before, 12 * EXCHANGE - MS, 12 * EXCHANGE + MS);
	world.loses[0] = 2;
	count(&world, 2, SPAN);
	assert_true(mean(&world, 1, SPAN) <= 2 * before);
	assert_true(world.longest[1] <= 3 * before);
	close_world(&world);
}

static void a_line_of_drives_with_some_that_lose_answers(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, DRIVES);
	for (unsigned i = 0; i < 4; i++)
		world.loses[i * 8] = 2;
	count(&world, 0, SPAN);
	for (unsigned i = 1; i < DRIVES; i++) {
		if (i % 8 != 0)
			assert_true(mean(&world, i, SPAN) <= 150 * MS);
	}
	close_world(&world);
}

/* A port that tells only of whole answers is to be looked at while one that was given up may still come. */
static void what_comes_after_a_loss_is_looked_for(void **state)
{
	struct world world;
	size_t come;

	(void)state;
	open_world(&world, 1);
	while (db_engine_awaited(world.bus->engine, &come) > 0)
		fake_pass(world.bus, MS / 10);
	world.bus->dead[1] = true;
	fake_pass(world.bus, 60 * MS);
	world.bus->dead[1] = false;
	fake_port(world.bus, ENODEV);
	fake_pass(world.bus, MS);
	assert_int_equal(db_engine_awaited(world.bus->engine, &come), DB_ANSWER_MAX);
	fake_pass(world.bus, 1000 * MS);
	(void)db_engine_run(world.bus->engine, world.bus->now);
	assert_int_equal(db_engine_awaited(world.bus->engine, &come), 0);
	close_world(&world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(one_that_moves_is_read_as_if_it_were_alone),
		cmocka_unit_test(four_that_move_take_seventy_percent),
		cmocka_unit_test(drives_that_all_stand_or_all_move_are_read_evenly),
		cmocka_unit_test(on_can_one_that_moves_is_read_in_each_cycle),
		cmocka_unit_test(poll_even_makes_no_difference_between_them),
		cmocka_unit_test(commands_that_ask_again_do_not_keep_samples_away),
		cmocka_unit_test(one_that_was_commanded_is_read_as_often_for_a_second),
		cmocka_unit_test(the_interval_that_is_told_is_kept),
		cmocka_unit_test(one_that_loses_answers_pays_with_its_own_turns),
		cmocka_unit_test(a_line_of_drives_with_some_that_lose_answers),
		cmocka_unit_test(what_comes_after_a_loss_is_looked_for),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
