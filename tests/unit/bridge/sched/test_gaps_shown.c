/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What one answer or one lost request shows about the pauses that the drives of a line need, and
 * how long the line is then kept silent. The drives are made up, and the bus does not run: each
 * test calls the functions of gaps.c itself.
 */
#include "fakes/bus.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define DRIVES 3
#define FOREIGN 9
#define SURE (3 * MS)

static const uint8_t request[] = "2 stp";

struct world {
	struct fake_bus *bus;
	struct db_engine *engine;
	struct node **nodes;
	struct db_driver driver;
	db_time now;
	unsigned told;
	struct db_engine_timing last_told;
};

static db_time send(void *context, const uint8_t *bytes, size_t length)
{
	(void)bytes;
	(void)length;
	return ((const struct world *)context)->now;
}

static void note_timing(void *context, const struct db_drive_config *drive,
                        const struct db_engine_timing *timing)
{
	struct world *world = context;

	assert_non_null(drive);
	world->told++;
	world->last_told = *timing;
}

static const struct db_engine_ops ops = { .send = send, .on_timing = note_timing };

static bool hears_all_as_its_own(unsigned address, const uint8_t *bytes, size_t length)
{
	(void)address;
	return bytes == request && length == sizeof request;
}

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->driver.mishears = hears_all_as_its_own;
	world->bus = fake_bus_new(&world->driver, DRIVES);
	world->bus->config.adapt = true;
	world->bus->config.turnaround_us = 1000;
	world->bus->config.line = DB_LINE_RS485;
	world->bus->context = world;
	fake_bus_open(world->bus, DRIVES, &ops);
	world->engine = world->bus->engine;
	world->nodes = world->engine->nodes;
	world->now = world->bus->now;
	for (size_t i = 0; i < DRIVES; i++)
		world->nodes[i]->online = world->nodes[i]->in_step = true;
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

/* --- losses ----------------------------------------------------------------------------------- */

/* The second drive loses `count` requests. Each was sent at `own` after its own last answer and at
 * `pause` after the answer of the first drive, which was the last on the line. */
static void lose(struct world *world, unsigned count, db_time own, db_time pause)
{
	struct node *node = world->nodes[1];

	world->engine->last_to_answer = world->nodes[0];
	node->answered_at = world->now - own;
	node->flight.station = node->first;
	node->flight.sent = world->now;
	node->flight.pause = pause;
	node->flight.in_step = node->in_step;
	while (count-- > 0)
		gaps_lost(world->engine, node, world->now);
	node->flight.station = NULL;
}

static void expect_learnt(const struct world *world, unsigned of_others, unsigned of_itself)
{
	assert_int_equal(world->nodes[0]->hold.lost, of_others);
	assert_int_equal(world->nodes[0]->gap.lost, 0);
	assert_int_equal(world->nodes[1]->hold.lost, 0);
	assert_int_equal(world->nodes[1]->gap.lost, of_itself);
}

static void a_loss_after_anothers_answer_shows_that_the_other_holds_the_line(void **state)
{
	struct world *world = *state;

	lose(world, 2, LEARN_GAP_MOST + 1, MS / 2);
	expect_learnt(world, 2, 0);
	assert_int_equal(world->told, 0);
	world->engine->tests_gap = true;
	lose(world, 1, LEARN_GAP_MOST + 1, MS / 2);
	assert_false(world->engine->tests_gap);
	assert_int_equal(world->told, 1);
	assert_int_equal(world->last_told.event, DB_EVENT_DRIVE_DEAF);
	assert_true(world->last_told.others);
	assert_int_equal(world->last_told.time, MS);
	assert_int_equal(world->last_told.learnt, world->nodes[0]->hold.now);
	assert_true(world->nodes[0]->hold.now > MS);
}

static void a_loss_that_may_have_either_cause_shows_nothing(void **state)
{
	struct world *world = *state;

	lose(world, 1, LEARN_GAP_MOST, MS / 2);
	expect_learnt(world, 0, 0);
	lose(world, 1, LEARN_GAP_MOST, LEARN_GAP_MOST);
	expect_learnt(world, 0, 0);
	/* A drive that is offline may be gone; one out of step may have answered an older
	 * question. */
	world->nodes[1]->online = false;
	lose(world, 1, LEARN_GAP_MOST + 1, MS / 2);
	expect_learnt(world, 0, 0);
	world->nodes[1]->online = true;
	world->nodes[1]->in_step = false;
	lose(world, 1, LEARN_GAP_MOST + 1, MS / 2);
	expect_learnt(world, 0, 0);
	world->nodes[1]->in_step = true;
	/* The drive sent an answer that cannot be used, so it has received the request. */
	world->nodes[1]->flight.got_unusable = true;
	lose(world, 1, LEARN_GAP_MOST + 1, MS / 2);
	expect_learnt(world, 0, 0);
	world->nodes[1]->flight.got_unusable = false;
	/* Drives on CAN receive while they send. */
	world->driver.medium = DB_MEDIUM_CAN;
	lose(world, 1, LEARN_GAP_MOST + 1, MS / 2);
	expect_learnt(world, 0, 0);
}

static void a_loss_long_after_anothers_answer_shows_its_own_gap(void **state)
{
	struct world *world = *state;

	lose(world, 1, MS / 2, LEARN_GAP_MOST + 1);
	expect_learnt(world, 0, 1);
	assert_int_equal(world->told, 0);
	lose(world, 2, MS / 2, LEARN_GAP_MOST + 1);
	assert_int_equal(world->told, 1);
	assert_false(world->last_told.others);
	assert_int_equal(world->last_told.learnt, world->nodes[1]->gap.now);
}

/* If the largest gap does not help, the drive is deaf for another reason. If it is offline, that is
 * also shown as its trouble. */
static void the_largest_gap_that_does_not_help_is_told_once(void **state)
{
	struct world *world = *state;

	for (unsigned online = 0; online < 2; online++) {
		struct node *node = world->nodes[1];

		learn_gap_init(&node->gap, true, MS, 0);
		node->gap.now = node->gap.peak = node->gap.most;
		node->timing = DB_TROUBLE_NONE;
		node->online = online;
		world->told = 0;
		lose(world, 3, MS / 2, LEARN_GAP_MOST + 1);
		assert_int_equal(world->told, 1);
		assert_int_equal(world->last_told.learnt, 0);
		assert_int_equal(node->timing, online ? DB_TROUBLE_NONE : DB_TROUBLE_DEAF);
	}
	/* It is no trouble if a larger gap helps. Nothing is told if another drive already holds
	 * the line for the longest time. */
	world->nodes[1]->timing = DB_TROUBLE_NONE;
	world->nodes[1]->online = false;
	learn_gap_init(&world->nodes[1]->gap, true, MS, 0);
	lose(world, 3, MS / 2, LEARN_GAP_MOST + 1);
	assert_int_equal(world->nodes[1]->timing, DB_TROUBLE_NONE);
	world->nodes[1]->online = true;
	world->told = 0;
	world->nodes[0]->hold.now = world->nodes[0]->hold.peak = world->nodes[0]->hold.most;
	lose(world, 3, LEARN_GAP_MOST + 1, MS / 2);
	assert_int_equal(world->nodes[0]->hold.now, MS);
	assert_int_equal(world->told, 0);
}

/* --- answers ---------------------------------------------------------------------------------- */

static bool answer(struct world *world, enum lane_kind lane, db_time now)
{
	world->nodes[1]->flight.lane = lane;
	return gaps_answered(world->engine, world->nodes[1], now);
}

/* True: the drive is asked again at once, to test the gap. That happens after a poll, not after a
 * command, and at most every 50 ms. */
static void a_gap_is_tested_after_a_poll_now_and_then(void **state)
{
	struct world *world = *state;

	assert_false(answer(world, LANE_COMMAND, world->now));
	assert_true(answer(world, LANE_POLL, world->now));
	assert_false(answer(world, LANE_POLL, world->now + 50 * MS - 1));
	assert_true(answer(world, LANE_POLL, world->now + 50 * MS));
	assert_false(answer(world, LANE_COMMAND, world->now + 200 * MS));
	world->nodes[1]->gap.sure = world->nodes[1]->gap.now;
	assert_false(answer(world, LANE_POLL, world->now + 200 * MS));
	world->nodes[1]->gap.sure = world->nodes[1]->gap.most;
	world->driver.medium = DB_MEDIUM_CAN;
	assert_false(answer(world, LANE_POLL, world->now + 200 * MS));
}

/* --- waiting ---------------------------------------------------------------------------------- */

static db_time harmless(const struct world *world, unsigned address)
{
	return gaps_harmless_at(world->engine, address, request, sizeof request, world->now) -
	       world->now;
}

static void a_drive_that_might_mishear_a_request_is_waited_for(void **state)
{
	struct world *world = *state;

	for (size_t i = 0; i < DRIVES; i++)
		world->nodes[i]->gap.sure = SURE;
	assert_int_equal(harmless(world, 2), 0);
	for (size_t i = 0; i < DRIVES; i++)
		world->nodes[i]->received_at = world->now - 10 * MS;
	assert_int_equal(harmless(world, 2), 0);
	/* The drive that the request is for is not waited for. */
	world->nodes[1]->received_at = world->now;
	assert_int_equal(harmless(world, 2), 0);
	assert_int_equal(harmless(world, 1), SURE);
	/* Of several drives, the one that can receive last counts. */
	world->nodes[0]->received_at = world->now - 2 * MS;
	assert_int_equal(harmless(world, 2), SURE - 2 * MS);
	world->nodes[2]->received_at = world->now - 1 * MS;
	assert_int_equal(harmless(world, 2), SURE - 1 * MS);
	world->nodes[0]->received_at = world->now;
	assert_int_equal(harmless(world, 2), SURE);
	/* An RS-232 line has no other drive; and drives of some families mishear nothing. */
	world->bus->config.line = DB_LINE_RS232;
	assert_int_equal(harmless(world, 2), 0);
	world->bus->config.line = DB_LINE_RS485;
	world->driver.mishears = NULL;
	assert_int_equal(harmless(world, 2), 0);
}

/* A drive that is heard on the line without being configured; nothing is learnt about its gap. */
static void a_foreign_drive_is_waited_for_for_the_longest_gap(void **state)
{
	struct world *world = *state;

	world->engine->foreign_received_at = world->now - 1 * MS;
	assert_int_equal(harmless(world, 2), 0);
	world->engine->foreign_address = FOREIGN;
	assert_int_equal(harmless(world, 2), LEARN_GAP_MOST - 1 * MS);
	assert_int_equal(harmless(world, FOREIGN), 0);
	world->engine->foreign_received_at = world->now - LEARN_GAP_MOST - 1;
	assert_int_equal(harmless(world, 2), 0);
	/* The later of both drives, the foreign one and one of the bus, counts. */
	world->nodes[0]->received_at = world->now;
	world->nodes[0]->gap.sure = SURE;
	assert_int_equal(harmless(world, 2), SURE);
	world->engine->foreign_received_at = world->now - LEARN_GAP_MOST + MS;
	assert_int_equal(harmless(world, 2), SURE);
	world->engine->foreign_address = 1;
	world->engine->foreign_received_at = world->now;
	assert_int_equal(harmless(world, 2), LEARN_GAP_MOST);
}

static db_time over(const struct world *world, const struct node *node)
{
	return gaps_over_at(world->engine, node, world->now) - world->now;
}

static void a_request_that_must_not_be_lost_waits_until_drives_can_receive(void **state)
{
	struct world *world = *state;

	for (size_t i = 0; i < DRIVES; i++)
		world->nodes[i]->gap.sure = world->nodes[i]->hold.sure = SURE;
	assert_int_equal(over(world, NULL), 0);
	for (size_t i = 0; i < DRIVES; i++) {
		world->nodes[i]->answered_at = world->now - 1 * MS;
		assert_int_equal(over(world, world->nodes[i]), SURE - 1 * MS);
		assert_int_equal(over(world, NULL), SURE - 1 * MS);
		assert_int_equal(over(world, world->nodes[(i + 1) % DRIVES]), 0);
		world->nodes[i]->answered_at = 0;
	}
	/* After another drive's answer that drive may still hold the line; after its own answer
	 * that is part of the drive's gap. */
	world->engine->last_to_answer = world->nodes[0];
	world->engine->last_answer_at = world->now - 2 * MS;
	assert_int_equal(over(world, world->nodes[1]), SURE - 2 * MS);
	assert_int_equal(over(world, world->nodes[0]), 0);
}

static void the_line_is_silent_for_as_long_as_the_answer_needs(void **state)
{
	struct world *world = *state;
	struct node *node = world->nodes[1];

	node->hold.now = 2 * MS;
	node->hold.least = MS / 2;
	node->gap.now = 3 * MS;
	gaps_keep_silence(world->engine, node, false, world->now);
	assert_int_equal(world->engine->quiet_until, world->now + 2 * MS);
	assert_int_equal(node->answered_at, world->now);
	assert_ptr_equal(world->engine->last_to_answer, node);
	gaps_keep_silence(world->engine, node, true, world->now);
	assert_int_equal(world->engine->quiet_until, world->now + 3 * MS);
	node->gap.now = MS;
	gaps_keep_silence(world->engine, node, true, world->now);
	assert_int_equal(world->engine->quiet_until, world->now + 2 * MS);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(a_loss_after_anothers_answer_shows_that_the_other_holds_the_line),
		TEST(a_loss_that_may_have_either_cause_shows_nothing),
		TEST(a_loss_long_after_anothers_answer_shows_its_own_gap),
		TEST(the_largest_gap_that_does_not_help_is_told_once),
		TEST(a_gap_is_tested_after_a_poll_now_and_then),
		TEST(a_drive_that_might_mishear_a_request_is_waited_for),
		TEST(a_foreign_drive_is_waited_for_for_the_longest_gap),
		TEST(a_request_that_must_not_be_lost_waits_until_drives_can_receive),
		TEST(the_line_is_silent_for_as_long_as_the_answer_needs),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
