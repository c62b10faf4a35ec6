/* SPDX-License-Identifier: Apache-2.0 */
/* One address on the bus: which answers may still arrive after a loss, and what a poll takes. */
#include "fakes/family.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define LATENCY_MS 10
#define LATE (LATE_ANSWER_LATENCIES * LATENCY_MS * MS)
#define NOW (1000 * DB_NS_PER_S)

static int open_node(void **state)
{
	static struct db_bus_config bus;

	bus = (struct db_bus_config){ .driver = &fake_family,
		                      .transport = &fake_wire,
		                      .drive_latency_ms = LATENCY_MS };
	*state = node_new(&bus, 7);
	assert_non_null(*state);
	return 0;
}

static int close_node(void **state)
{
	node_free(*state);
	return 0;
}

/* One question is free, the next ones come ever later, and it counts as one that stands. */
static void a_new_node_begins_as_one_that_may_be_gone(void **state)
{
	const struct node *node = *state;

	assert_int_equal(node->address, 7);
	assert_false(node->online);
	assert_int_equal(node->free_probes, 1);
	assert_int_equal(node->probe_backoff, PROBE_BACKOFF_MIN);
	assert_int_equal(node->share, DB_SHARE_STANDING);
	assert_int_equal(node->late_answer_time, LATE);
	assert_int_equal(node->patience.now, LATENCY_MS * MS);
}

static void the_answer_to_a_probe_counts_when_nothing_else_was_lost(void **state)
{
	struct node *node = *state;

	node_expect_late_answer(node, false, NOW);
	assert_false(node_waits_out_late_answers(node, NOW));
	assert_false(node_is_late_answer(node, NOW + MS));
}

static void after_a_lost_probe_its_own_answer_must_be_over_before_the_next_one(void **state)
{
	struct node *node = *state;

	/* A status and then the probe are lost, and each of them may still be answered. */
	node_expect_late_answer(node, false, NOW);
	node_expect_late_answer(node, true, NOW + 5 * MS);
	assert_true(node_waits_out_late_answers(node, NOW + 6 * MS));
	assert_int_equal(node_late_answers_until(node, NOW + 6 * MS), NOW + 5 * MS + LATE);
	/* Once the status cannot be answered any more, any answer shows that the drive is in step. */
	assert_true(node_waits_out_late_answers(node, NOW + LATE - 1));
	assert_false(node_waits_out_late_answers(node, NOW + LATE));
	node->in_step = true;
	assert_false(node_waits_out_late_answers(node, NOW + 6 * MS));
}

static void each_lost_probe_is_answered_late_once(void **state)
{
	struct node *node = *state;

	node_expect_late_answer(node, true, NOW);
	node_expect_late_answer(node, true, NOW + MS);
	node_expect_late_answer(node, false, NOW + 2 * MS);
	assert_true(node_is_late_answer(node, NOW + 3 * MS));
	assert_true(node_is_late_answer(node, NOW + 3 * MS));
	assert_false(node_is_late_answer(node, NOW + 3 * MS));
}

static void late_probes_are_forgotten_in_time(void **state)
{
	struct node *node = *state;

	node_expect_late_answer(node, true, NOW);
	node_expect_late_answer(node, false, NOW + LATE);
	assert_false(node_is_late_answer(node, NOW + LATE));
	/* The count begins again with the next lost probe. */
	node_expect_late_answer(node, true, NOW + LATE);
	node_expect_late_answer(node, false, NOW + LATE);
	assert_true(node_is_late_answer(node, NOW + LATE + MS));
	assert_false(node_is_late_answer(node, NOW + LATE + MS));
}

static void a_probe_lost_long_ago_is_not_counted(void **state)
{
	struct node *node = *state;

	node_expect_late_answer(node, true, NOW);
	node_expect_late_answer(node, true, NOW + LATE);
	node_expect_late_answer(node, false, NOW + LATE);
	assert_true(node_is_late_answer(node, NOW + LATE + MS));
	assert_false(node_is_late_answer(node, NOW + LATE + MS));
}

static void an_answer_may_belong_to_any_probe_when_only_probes_were_lost(void **state)
{
	struct node *node = *state;

	node_expect_late_answer(node, true, NOW);
	node_expect_late_answer(node, true, NOW + MS);
	assert_false(node_is_late_answer(node, NOW + 10 * MS));
	/* So the others are awaited for as long again. */
	assert_int_equal(node->late_probes_until, NOW + 10 * MS + LATE);
	/* Exactly when the other lost question cannot be answered any more, the answer may belong
	 * to any probe again. */
	node_expect_late_answer(node, false, NOW);
	node_expect_late_answer(node, true, NOW + LATE - MS);
	assert_false(node_is_late_answer(node, NOW + LATE));
}

static void a_new_node_inherits_the_answers_to_the_former_one(void **state)
{
	struct node *node = *state;
	struct node former = { .risky_until = 1, .late_probes = 2, .late_probes_until = 3 };

	node_inherit_late_answers(node, &former);
	assert_int_equal(node->risky_until, 1);
	assert_int_equal(node->late_probes, 2);
	assert_int_equal(node->late_probes_until, 3);
}

static void the_latency_of_a_late_answer_counts_from_the_lost_question(void **state)
{
	struct node *node = *state;

	assert_int_equal(node_latency_of_late_answer(node, NOW), 0);
	/* Without a lost question there is no latency, even soon after the clock began at 0. */
	assert_int_equal(node_latency_of_late_answer(node, LATE / 2), 0);
	node->lost_due = NOW;
	assert_int_equal(node_latency_of_late_answer(node, NOW + 12 * MS), 12 * MS);
	assert_int_equal(node_latency_of_late_answer(node, NOW + LATE), LATE);
	assert_int_equal(node_latency_of_late_answer(node, NOW + LATE + 1), 0);
}

/* The latency counts from when the answer might have begun; that of a late answer or of one without
 * a known length is not learnt. After any answer no question counts as lost any more. */
static void an_answer_shows_the_latency_of_the_drive(void **state)
{
	static const struct {
		db_time at;
		bool open_ended, in_time;
		db_time longest;
	} cases[] = {
		{ 7 * MS, false, true, 4 * MS }, { 2 * MS, false, true, 0 },
		{ 7 * MS, true, true, 0 },       { 7 * MS, false, false, 0 },
		{ 7 * MS, true, false, 0 },
	};
	struct node *node = *state;
	struct station station = { .node = node };

	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		node->flight = (struct flight){ .station = &station,
			                        .lane = LANE_POLL,
			                        .sent = NOW,
			                        .deadline = NOW + 13 * MS,
			                        .patience = 10 * MS };
		station.lanes[LANE_POLL].exchange.open_ended = cases[i].open_ended;
		node->patience.since = NOW;
		node->patience.longest = 0;
		node->lost_due = NOW;
		node_answered(node, cases[i].in_time, NOW + cases[i].at);
		assert_int_equal(node->patience.longest, cases[i].longest);
		assert_int_equal(node->answered_at, NOW + cases[i].at);
		assert_int_equal(node->lost_due, 0);
	}
	node->flight.station = NULL;
}

static void the_cost_of_a_poll_is_averaged(void **state)
{
	struct node *node = *state;
	struct station station = { .node = node };

	node->first = &station;
	station.lanes[LANE_POLL].job.started = NOW;
	node->spent = 8 * MS;
	node_end_poll(node, true, NOW + 10 * MS);
	assert_int_equal(node->poll_cost, 8 * MS);
	assert_int_equal(node->poll_duration, 10 * MS);
	assert_int_equal(node->used, 8 * MS);
	assert_int_equal(node->spent, 0);
	/* A value that is higher by 8 ms raises the average by an eighth of that. */
	node->spent = 16 * MS;
	node_end_poll(node, true, NOW + 18 * MS);
	assert_int_equal(node->poll_cost, 9 * MS);
	assert_int_equal(node->poll_duration, 11 * MS);
	/* A lost poll is charged and shows nothing about the drive. */
	node->spent = 50 * MS;
	node_end_poll(node, false, NOW + 90 * MS);
	assert_int_equal(node->poll_cost, 9 * MS);
	assert_int_equal(node->poll_duration, 11 * MS);
	assert_int_equal(node->used, 74 * MS);
}

static void a_node_is_lively_for_a_second_after_its_command(void **state)
{
	struct node *node = *state;
	struct station station = { .node = node };
	struct station second = { .node = node };

	node->first = &station;
	station.next_axis = &second;
	assert_false(node_is_lively(node, NOW));
	second.commanded = NOW;
	assert_true(node_is_lively(node, NOW + DB_SHARE_LIVELY_MS * MS - 1));
	assert_false(node_is_lively(node, NOW + DB_SHARE_LIVELY_MS * MS));
	second.command_ended = NOW + 100 * MS;
	assert_true(node_is_lively(node, NOW + DB_SHARE_LIVELY_MS * MS + 99 * MS));
	second.commanded = 0;
	assert_false(node_is_lively(node, NOW + MS));
	station.snapshot.feedback.status = DB_STATUS_MOVING;
	assert_true(node_is_lively(node, NOW + MS));
}

int main(void)
{
#define TEST_OF_NODE(name) cmocka_unit_test_setup_teardown(name, open_node, close_node)
	const struct CMUnitTest tests[] = {
		TEST_OF_NODE(a_new_node_begins_as_one_that_may_be_gone),
		TEST_OF_NODE(the_answer_to_a_probe_counts_when_nothing_else_was_lost),
		TEST_OF_NODE(after_a_lost_probe_its_own_answer_must_be_over_before_the_next_one),
		TEST_OF_NODE(each_lost_probe_is_answered_late_once),
		TEST_OF_NODE(late_probes_are_forgotten_in_time),
		TEST_OF_NODE(a_probe_lost_long_ago_is_not_counted),
		TEST_OF_NODE(an_answer_may_belong_to_any_probe_when_only_probes_were_lost),
		TEST_OF_NODE(a_new_node_inherits_the_answers_to_the_former_one),
		TEST_OF_NODE(the_latency_of_a_late_answer_counts_from_the_lost_question),
		TEST_OF_NODE(an_answer_shows_the_latency_of_the_drive),
		TEST_OF_NODE(the_cost_of_a_poll_is_averaged),
		TEST_OF_NODE(a_node_is_lively_for_a_second_after_its_command),
	};

	return cmocka_run_group_tests_name("node", tests, NULL, NULL);
}
