/* SPDX-License-Identifier: Apache-2.0 */
/* Stops on lines with simulated drives of each family that are lost, come back, or leave answers out. */
#include "fakes/rs485.h"
#include "stop_world.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* The exchange that is under way, and one of each other drive that must be stopped; all may go unanswered. */
#define FIRST_STOP (2 * (WORLD_LATENCY_MS + 10) * MS)
#define SAMPLES (100 * MS)

struct story {
	struct world world;
	unsigned lose_stops; /* of the first drive, that many more */
	bool flaky; /* the first drive obeys stops, and leaves out every second answer to them */
	unsigned turn;
	bool listening;
	unsigned heard; /* requests since then */
	bool stop_first;
};

static bool on_request(void *context, size_t drive, bool stop, const uint8_t *bytes, size_t length)
{
	struct story *story = context;

	(void)bytes;
	(void)length;
	if (story->listening && story->heard++ == 0)
		story->stop_first = stop && drive == 0;
	if (drive != 0)
		return true;
	if (story->flaky && stop && ++story->turn % 2 == 0)
		story->world.line.nodes[0].faults.left[SIM_FAULT_DROP] = 1;
	if (stop && story->lose_stops > 0) {
		story->lose_stops--;
		return false;
	}
	return true;
}

static struct story *begin_story(enum family family)
{
	struct story *story = calloc(1, sizeof *story);

	assert_non_null(story);
	world_open(&story->world, family, 0);
	world_enable(&story->world);
	world_set_going(&story->world, 0);
	story->world.context = story;
	story->world.on_request = on_request;
	return story;
}

static void end_story(struct story *story)
{
	world_close(&story->world);
	free(story);
}

static bool stands_within(struct story *story, size_t drive, db_time time)
{
	db_time end = story->world.bus->now + time;

	while (world_moves(&story->world, drive) && story->world.bus->now < end)
		fake_pass(story->world.bus, 5 * MS);
	return !world_moves(&story->world, drive);
}

/* Its stops are lost while it is seen to move on, then it is silent, and comes back still moving; and the first stop
 * that it could obey is lost, too. */
static void a_drive_that_comes_back_moving_is_stopped(void **state)
{
	(void)state;
	for (enum family family = 0; family < FAMILIES; family++) {
		struct story *story = begin_story(family);
		const struct world_ticket *stop;

		story->lose_stops = 1000;
		stop = world_post(&story->world, 0, DB_CMD_STOP);
		fake_pass(story->world.bus, 100 * MS);
		world_silence(&story->world, 0, true);
		fake_pass(story->world.bus, 1500 * MS);
		assert_false(fake_is_online(story->world.bus, 0));
		assert_int_equal(stop->result, DB_RESULT_NONE);
		story->lose_stops = 1;
		world_silence(&story->world, 0, false);
		assert_true(stands_within(story, 0, 1500 * MS));
		fake_pass(story->world.bus, 300 * MS);
		assert_int_equal(stop->result, DB_RESULT_OK);
		end_story(story);
	}
}

/* The time from its posting to the wire. */
static db_time sends_stop_after(struct story *story, size_t drive)
{
	db_time posted = story->world.bus->now;

	world_post(&story->world, drive, DB_CMD_STOP);
	while (story->world.stop_sent[drive] < posted &&
	       story->world.bus->now < posted + DB_NS_PER_S)
		fake_pass(story->world.bus, MS);
	return story->world.bus->now - posted;
}

/* `turn`: whether the first or the second answer is the first to be left out. */
static void disturb(unsigned turn)
{
	struct story *story = begin_story(FAMILY_VSMD_SERIAL);
	db_time end = story->world.bus->now + DB_NS_PER_S;

	story->turn = turn;
	story->flaky = true;
	world_post(&story->world, 0, DB_CMD_STOP);
	while (story->world.bus->now < end) {
		struct db_feedback neighbour = fake_feedback(story->world.bus, 1);

		assert_true(neighbour.status & DB_STATUS_ONLINE);
		assert_true(story->world.bus->now - neighbour.taken < SAMPLES);
		fake_pass(story->world.bus, MS);
	}
	world_post(&story->world, 0, DB_CMD_STOP);
	fake_pass(story->world.bus, 7 * MS);
	assert_true(sends_stop_after(story, 1) <= FIRST_STOP);
	assert_true(stands_within(story, 1, 300 * MS));
	assert_false(world_moves(&story->world, 0));
	end_story(story);
}

static void a_drive_that_leaves_answers_out_keeps_no_other_from_its_stop(void **state)
{
	(void)state;
	disturb(0);
	disturb(1);
}

/* As somebody does who presses the button again and again. */
static void stops_for_a_dead_drive_keep_no_other_from_being_read(void **state)
{
	struct story *story = begin_story(FAMILY_VSMD_SERIAL);

	(void)state;
	world_silence(&story->world, 0, true);
	fake_pass(story->world.bus, 500 * MS);
	for (unsigned i = 0; i < 40; i++) {
		struct db_feedback neighbour = fake_feedback(story->world.bus, 1);

		assert_true(story->world.bus->now - neighbour.taken < SAMPLES);
		if (i % 2 == 0 && i < 2 * DB_QUEUE_STOPS_EACH)
			world_post(&story->world, 0, DB_CMD_STOP);
		fake_pass(story->world.bus, 10 * MS);
	}
	end_story(story);
}

static void a_stop_for_a_port_that_is_down_is_kept(void **state)
{
	(void)state;
	for (enum family family = 0; family < FAMILIES; family++) {
		struct story *story = begin_story(family);
		const struct world_ticket *stop;

		world_set_port(&story->world, false);
		stop = world_post(&story->world, 0, DB_CMD_STOP);
		fake_pass(story->world.bus, 300 * MS);
		assert_int_equal(stop->result, DB_RESULT_NONE);
		assert_true(world_moves(&story->world, 0));
		story->listening = true;
		world_set_port(&story->world, true);
		fake_pass(story->world.bus, MS);
		assert_true(story->stop_first);
		assert_true(stands_within(story, 0, 1000 * MS));
		fake_pass(story->world.bus, 300 * MS);
		assert_int_equal(stop->result, DB_RESULT_OK);
		end_story(story);
	}
}

/* Its answers come later than the pace at which stops are said again: the answer to the stop itself, in which a drive does not
 * show yet that it stands, and the sample after it. */
static void an_obedient_drive_is_told_once_however_late_it_answers(void **state)
{
	static const unsigned one[] = { 1, 0 };

	(void)state;
	for (db_time late = 0; late < 28 * MS; late += 3 * MS) {
		struct rs485 *line = rs485_new(one);

		line->bus->config.cycle_ms = 20;
		rs485_begin(line);
		fake_pass(line->bus, 2000 * MS);
		assert_int_equal(rs485_enable(line, 0), DB_RESULT_OK);
		assert_int_equal(rs485_turn(line, 0, 1600.0f), DB_RESULT_OK);
		line->nodes[0].latency = late;
		fake_post(line->bus, 0, DB_CMD_QUICK_STOP);
		fake_pass(line->bus, 500 * MS);
		assert_int_equal(fake_result(line->bus), DB_RESULT_OK);
		assert_int_equal(rs485_count_heard(&line->nodes[0], "1 stp"), 1);
		rs485_free(line);
	}
}

static int free_configs(void **state)
{
	(void)state;
	world_free_configs();
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_that_comes_back_moving_is_stopped),
		cmocka_unit_test(a_drive_that_leaves_answers_out_keeps_no_other_from_its_stop),
		cmocka_unit_test(stops_for_a_dead_drive_keep_no_other_from_being_read),
		cmocka_unit_test(a_stop_for_a_port_that_is_down_is_kept),
		cmocka_unit_test(an_obedient_drive_is_told_once_however_late_it_answers),
	};

	return cmocka_run_group_tests_name("stops on lines", tests, NULL, free_configs);
}
