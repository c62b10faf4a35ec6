/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that leave a running bus and drives that are added to it: on a made-up serial line with a
 * made-up family of controllers, in made-up time. The tests look at the wire: which drive is asked
 * what, and when, to the microsecond.
 */
#include "fakes/bus.h"
#include "sched/change.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define US DB_NS_PER_US
#define DRIVES 6
#define POLL_EXCHANGES 2

/* Drive i has the number 10 + i. With two drives at each address from `paired` on. */
static struct fake_bus *open_bus_of(size_t drives, size_t paired, unsigned poll_exchanges)
{
	struct fake_bus *bus = fake_bus_new(&fake_family, DRIVES);

	bus->config.drive_latency_ms = 5;
	fake_option(bus, "poll-exchanges", poll_exchanges);
	for (size_t i = 0; i < DRIVES; i++) {
		size_t beyond = i > paired ? i - paired : 0;

		bus->drives[i].address = (unsigned)(i - (beyond + 1) / 2) + 1;
		bus->drives[i].axis = beyond % 2;
		bus->list[i].drive = (uint16_t)(10 + i);
	}
	fake_bus_open(bus, drives, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 505 * MS); /* to between two cycles */
	fake_forget_sent(bus);
	return bus;
}

static struct fake_bus *open_bus(size_t drives, size_t paired)
{
	return open_bus_of(drives, paired, POLL_EXCHANGES);
}

/* Hands a change to the engine: the drive that leaves and the one that comes, or -1. */
static void change_drives(struct fake_bus *bus, size_t present, int leaves, int comes)
{
	uint16_t leaving = (uint16_t)(10 + leaves);
	struct db_change *made = change_new(&bus->config, present, &leaving, leaves >= 0,
	                                    comes >= 0 ? &bus->list[comes] : NULL, comes >= 0);

	assert_non_null(made);
	change_begin(bus->engine, made, bus->now);
}

static bool fetch_change(struct fake_bus *bus)
{
	struct db_change *changed = change_fetch(bus->engine);

	change_free(changed);
	return changed != NULL;
}

/* The next request that ended is this one. */
static enum db_result result_of(struct fake_bus *bus, size_t drive, enum db_command command)
{
	struct db_request completion;

	assert_true(fake_collect(bus->queue, &completion));
	assert_int_equal(completion.ticket, fake_ticket(drive, command));
	return completion.result;
}

/* What was sent to the first `drives` addresses is the same in both, at the same times. */
static void expect_same_schedule(const struct fake_bus *a, const struct fake_bus *b,
                                 unsigned drives)
{
	size_t i = 0;
	size_t j = 0;

	for (;;) {
		while (i < a->sent_count && a->sent[i].frame.address > drives)
			i++;
		while (j < b->sent_count && b->sent[j].frame.address > drives)
			j++;
		if (i == a->sent_count || j == b->sent_count)
			break;
		assert_true(a->sent[i].at == b->sent[j].at);
		assert_memory_equal(&a->sent[i].frame, &b->sent[j].frame, sizeof a->sent[i].frame);
		i++;
		j++;
	}
	assert_true(i == a->sent_count && j == b->sent_count);
}

/* The drive that left is freed as well: the leak sanitizer would report it. */
static void a_change_that_nobody_fetches_is_freed_with_the_bus(void **state)
{
	struct fake_bus *bus = open_bus_of(3, DRIVES, 1);

	(void)state;
	change_drives(bus, 3, 2, -1);
	fake_pass(bus, 1000 * MS);
	assert_non_null(bus->engine->changed);
	fake_bus_free(bus);
}

/* The change removes two drives. One has left when the bus ends, the other is still waited for. */
static void a_bus_may_end_while_its_drives_leave(void **state)
{
	struct fake_bus *bus = open_bus(3, DRIVES);
	const uint16_t leaving[] = { 11, 12 };
	struct db_change *made = change_new(&bus->config, 3, leaving, 2, NULL, 0);

	(void)state;
	assert_non_null(made);
	bus->dead[2] = true;
	change_begin(bus->engine, made, bus->now);
	while (bus->engine->station_count == 3)
		fake_pass(bus, MS);
	assert_int_equal(bus->engine->station_count, 2);
	assert_int_equal(bus->engine->node_count, 2);
	assert_ptr_equal(bus->engine->change, made);
	fake_bus_free(bus);
}

/* --- who leaves ------------------------------------------------------------------------------------ */

static void the_others_stay_on_schedule_when_one_leaves(void **state)
{
	struct fake_bus *bus = open_bus_of(3, DRIVES, 1);
	struct fake_bus *twin = open_bus_of(3, DRIVES, 1);

	(void)state;
	change_drives(bus, 3, 2, -1);
	fake_pass(bus, 1000 * MS);
	fake_pass(twin, 1000 * MS);
	assert_true(fetch_change(bus));
	expect_same_schedule(bus, twin, 2);
	assert_int_equal(fake_count(bus, 1, FAKE_POLL), 50);
	assert_int_equal(fake_count(bus, 3, FAKE_STOP), 1);
	/* It is seen to stand before it goes. */
	assert_int_equal(fake_count(bus, 3, FAKE_POLL), 1);
	assert_int_equal(fake_stats(bus).overruns, 0);
	assert_int_equal(fake_stats(bus).cycles, fake_stats(twin).cycles);
	assert_int_equal(fake_stats(bus).online, 2);
	fake_bus_free(bus);
	fake_bus_free(twin);
}

static void whoever_leaves_the_others_are_polled_in_every_cycle(void **state)
{
	(void)state;
	for (int leaves = 0; leaves < 4; leaves++) {
		struct fake_bus *bus = open_bus(4, DRIVES);

		change_drives(bus, 4, leaves, -1);
		fake_pass(bus, 1000 * MS);
		assert_true(fetch_change(bus));
		for (unsigned i = 0; i < 4; i++)
			assert_int_equal(fake_count(bus, i + 1, FAKE_POLL),
			                 ((int)i == leaves ? 1 : 50) * POLL_EXCHANGES);
		assert_int_equal(fake_stats(bus).overruns, 0);
		assert_int_equal(fake_stats(bus).online, 3);
		fake_bus_free(bus);
	}
}

static db_time run_on(void *context, struct fake_frame *frame)
{
	(void)context;
	frame->speed = 10.0f;
	return 3 * MS;
}

/* Its time is over at every moment of a cycle, also before it was read in it: nobody waits for that reading. */
static void one_that_leaves_unread_leaves_the_cycle_whole(void **state)
{
	(void)state;
	for (db_time after = 0; after < 20 * MS; after += MS) {
		struct fake_bus *bus = open_bus_of(3, DRIVES, 1);
		uint32_t overruns;

		bus->obey = run_on;
		fake_pass(bus, 100 * MS + after);
		change_drives(bus, 3, 2, -1);
		fake_pass(bus, 3000 * MS);
		assert_true(fetch_change(bus));
		overruns = fake_stats(bus).overruns;
		fake_pass(bus, 1000 * MS);
		assert_int_equal(fake_stats(bus).overruns, overruns);
		assert_true(fake_stats(bus).cycle_us <= 10000);
		fake_bus_free(bus);
	}
}

static bool was_last_to_answer(const struct fake_bus *bus, const struct node *node)
{
	return bus->engine->last_to_answer == node;
}

/* The engine points to the drive that answered last. The pointer is cleared when that drive leaves,
 * and kept when another one does. */
static void the_last_drive_to_answer_is_forgotten_when_it_leaves(void **state)
{
	(void)state;
	for (size_t leaves = 0; leaves < 2; leaves++) {
		struct fake_bus *bus = open_bus_of(2, DRIVES, 1);
		const struct node *first = bus->engine->nodes[0];

		bus->drives[0].on_exit = bus->drives[1].on_exit = DB_ON_LOSS_NONE;
		for (unsigned i = 0; i < 1000 && !was_last_to_answer(bus, first); i++)
			fake_pass(bus, 100 * US);
		assert_true(was_last_to_answer(bus, first));
		change_drives(bus, 2, (int)leaves, -1);
		fake_pass(bus, 1);
		assert_true(fetch_change(bus));
		assert_ptr_equal(bus->engine->last_to_answer, leaves == 0 ? NULL : first);
		fake_bus_free(bus);
	}
}

/* A gap test was planned: the drive was to be asked again right after its answer, to learn how soon
 * it can receive. */
static void a_drive_that_has_left_gets_no_gap_test(void **state)
{
	struct fake_bus *bus = fake_bus_new(&fake_family, 2);

	(void)state;
	bus->config.adapt = true;
	bus->config.turnaround_us = 1000;
	for (size_t i = 0; i < 2; i++) {
		bus->drives[i].on_exit = DB_ON_LOSS_NONE;
		bus->list[i].drive = (uint16_t)(10 + i);
	}
	fake_bus_open(bus, 2, NULL);
	fake_port(bus, 0);
	for (unsigned i = 0; i < 10000 && !(bus->engine->tests_gap &&
	                                    was_last_to_answer(bus, bus->engine->nodes[0]));
	     i++)
		fake_pass(bus, 100 * US);
	assert_true(bus->engine->tests_gap);
	change_drives(bus, 2, 0, -1);
	fake_forget_sent(bus);
	fake_pass(bus, 100 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_count(bus, 1, FAKE_POLL), 0);
	assert_in_range(fake_count(bus, 2, FAKE_POLL), 4, 12);
	fake_bus_free(bus);
}

/* The drive did not stop within the time limit of its removal. */
static void a_drive_that_leaves_without_stopping_is_reported(void **state)
{
	struct fake_bus *bus = open_bus_of(3, DRIVES, 1);

	(void)state;
	bus->obey = run_on;
	fake_pass(bus, 100 * MS);
	change_drives(bus, 3, 2, -1);
	fake_pass(bus, 3000 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(bus->told[DB_EVENT_DRIVE_UNCONFIRMED], 1);
	fake_bus_free(bus);
}

/* No other drive leaves, not even drive number 0. */
static void several_leave_and_several_come(void **state)
{
	const uint16_t leaving[] = { 12, 11 };
	struct fake_bus *bus = fake_bus_new(&fake_family, DRIVES);
	struct db_change *change;

	(void)state;
	for (size_t i = 0; i < DRIVES; i++)
		bus->list[i].drive = i == 0 ? 0 : (uint16_t)(10 + i);
	fake_bus_open(bus, 3, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 500 * MS);
	change = change_new(&bus->config, 3, leaving, 2, &bus->list[3], 3);
	assert_non_null(change);
	change_begin(bus->engine, change, bus->now);
	fake_pass(bus, 500 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(bus->engine->station_count, 4);
	assert_true(fake_is_online(bus, 0));
	for (size_t i = 3; i < DRIVES; i++)
		assert_true(fake_is_online(bus, i));
	assert_int_equal(fake_count(bus, 1, FAKE_STOP), 0);
	/* A change of several drives is freed without being carried out. */
	change_free(change_new(&bus->config, 4, leaving, 2, &bus->list[1], 2));
	fake_bus_free(bus);
}

/* A request that waits is cancelled when the removal begins, not when the drive has left. */
static void requests_that_wait_for_a_leaving_drive_end_at_once(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	bus->answer_time = 4 * MS;
	fake_post(bus, 1, DB_CMD_MOVE_VELOCITY);
	fake_post(bus, 1, DB_CMD_ENABLE);
	for (unsigned i = 0; i < 1000 && fake_count(bus, 2, FAKE_COMMAND) == 0; i++)
		fake_pass(bus, 100 * US);
	change_drives(bus, 2, 1, -1);
	assert_int_equal(result_of(bus, 1, DB_CMD_ENABLE), DB_RESULT_CANCELLED);
	assert_int_equal(fake_result(bus), DB_RESULT_NONE);
	/* The command on the wire ends with its own answer. */
	assert_true(bus->engine->stations[1]->command_cancelled);
	fake_pass(bus, 200 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(result_of(bus, 1, DB_CMD_MOVE_VELOCITY), DB_RESULT_OK);
	fake_bus_free(bus);
}

/* At every moment of a cycle: one leaves, and at once another one comes to its address. */
static void whenever_it_happens_no_cycle_is_missed(void **state)
{
	(void)state;
	for (db_time after = 0; after < 20 * MS; after += 130 * US) {
		struct fake_bus *bus = open_bus(4, after % (260 * US) == 0 ? DRIVES : 2);
		uint32_t cycles = fake_stats(bus).cycles;
		size_t others = 0;

		bus->drives[5].address = bus->drives[3].address;
		bus->drives[5].axis = bus->drives[3].axis;
		fake_pass(bus, after);
		change_drives(bus, 4, 3, 5);
		fake_pass(bus, 400 * MS - after);
		assert_true(fetch_change(bus));
		assert_true(fake_is_online(bus, 5));
		for (unsigned i = 0; i < 3; i++) {
			others += fake_count(bus, i + 1, FAKE_POLL);
			assert_int_equal(fake_snapshot(bus, i).stats.came_online, 1);
		}
		assert_in_range(others, 3 * 20 * POLL_EXCHANGES, (3 * 20 + 1) * POLL_EXCHANGES);
		assert_int_equal(fake_stats(bus).overruns, 0);
		assert_int_equal(fake_stats(bus).cycles, cycles + 20);
		fake_bus_free(bus);
	}
}

static void what_waits_for_it_ends_once(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	for (unsigned i = 0; i < 3; i++)
		fake_post(bus, 1, DB_CMD_MOVE_VELOCITY);
	fake_post(bus, 0, DB_CMD_ENABLE);
	fake_pass(bus, bus->answer_time / 2); /* the first one is on the wire */
	change_drives(bus, 2, 1, -1);
	fake_post(bus, 1, DB_CMD_ENABLE); /* too late */
	fake_pass(bus, 100 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_count(bus, 2, FAKE_COMMAND), 1);
	assert_int_equal(fake_count(bus, 2, FAKE_STOP), 1);
	assert_int_equal(fake_count(bus, 1, FAKE_COMMAND), 1);
	/* In the order of their slots. */
	assert_int_equal(result_of(bus, 1, DB_CMD_MOVE_VELOCITY), DB_RESULT_OK);
	assert_int_equal(result_of(bus, 1, DB_CMD_MOVE_VELOCITY), DB_RESULT_CANCELLED);
	assert_int_equal(result_of(bus, 1, DB_CMD_MOVE_VELOCITY), DB_RESULT_CANCELLED);
	assert_int_equal(result_of(bus, 0, DB_CMD_ENABLE), DB_RESULT_OK);
	assert_int_equal(result_of(bus, 1, DB_CMD_ENABLE), DB_RESULT_CANCELLED);
	assert_int_equal(fake_result(bus), DB_RESULT_NONE);
	/* Nobody of this number is there any more. */
	fake_post(bus, 1, DB_CMD_STOP);
	fake_pass(bus, 10 * MS);
	assert_int_equal(result_of(bus, 1, DB_CMD_STOP), DB_RESULT_FAILED);
	fake_bus_free(bus);
}

static void a_stop_that_is_under_way_is_confirmed(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	fake_post(bus, 1, DB_CMD_QUICK_STOP);
	change_drives(bus, 2, 1, -1);
	fake_post(bus, 1, DB_CMD_STOP);
	fake_pass(bus, 100 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(result_of(bus, 1, DB_CMD_QUICK_STOP), DB_RESULT_OK);
	assert_int_equal(result_of(bus, 1, DB_CMD_STOP), DB_RESULT_OK);
	fake_bus_free(bus);
}

static void on_exit_none_leaves_it_running(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	bus->drives[1].on_exit = DB_ON_LOSS_NONE;
	change_drives(bus, 2, 1, -1);
	fake_pass(bus, 1 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_count(bus, 2, FAKE_STOP), 0);
	fake_bus_free(bus);
}

static void one_that_does_not_answer_is_waited_for_a_bounded_time(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	bus->dead[2] = true;
	fake_post(bus, 1, DB_CMD_STOP);
	change_drives(bus, 2, 1, -1);
	fake_pass(bus, 1400 * MS);
	assert_false(fetch_change(bus));
	assert_true(fake_count(bus, 2, FAKE_STOP) > 3);
	fake_pass(bus, 110 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(result_of(bus, 1, DB_CMD_STOP), DB_RESULT_INDETERMINATE);
	assert_int_equal(fake_result(bus), DB_RESULT_NONE);
	assert_int_equal(fake_stats(bus).online, 1);
	fake_forget_sent(bus);
	fake_pass(bus, 200 * MS);
	assert_int_equal(fake_count(bus, 1, FAKE_POLL), 10 * POLL_EXCHANGES);
	assert_int_equal(fake_count(bus, 2, FAKE_STOP) + fake_count(bus, 2, FAKE_PROBE), 0);
	fake_bus_free(bus);
}

static void on_a_bus_that_is_down_it_leaves_at_once(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	fake_port(bus, 5);
	change_drives(bus, 2, 1, 2);
	db_engine_run(bus->engine, bus->now);
	assert_true(fetch_change(bus));
	fake_port(bus, 0);
	fake_pass(bus, 200 * MS);
	assert_true(fake_is_online(bus, 0) && fake_is_online(bus, 2));
	fake_bus_free(bus);
}

/* --- who comes ------------------------------------------------------------------------------------- */

static void a_drive_that_comes_is_found_and_asked(void **state)
{
	struct fake_bus *bus = open_bus(3, DRIVES);

	(void)state;
	change_drives(bus, 3, -1, 3);
	fake_pass(bus, 1000 * MS);
	assert_true(fetch_change(bus));
	assert_true(fake_is_online(bus, 3));
	assert_true(fake_feedback(bus, 3).status & DB_STATUS_PARAMS_VALID);
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(fake_count(bus, i + 1, FAKE_POLL), 50 * POLL_EXCHANGES);
	assert_in_range(fake_count(bus, 4, FAKE_POLL), 49 * POLL_EXCHANGES, 51 * POLL_EXCHANGES);
	assert_int_equal(fake_stats(bus).overruns, 0);
	assert_int_equal(fake_stats(bus).online, 4);
	fake_post(bus, 3, DB_CMD_ENABLE);
	fake_pass(bus, 5 * MS);
	assert_int_equal(result_of(bus, 3, DB_CMD_ENABLE), DB_RESULT_OK);
	fake_bus_free(bus);
}

static void a_drive_that_comes_and_is_silent_costs_little(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	bus->dead[3] = true;
	change_drives(bus, 2, -1, 2);
	fake_pass(bus, 1000 * MS);
	assert_true(fetch_change(bus));
	assert_false(fake_is_online(bus, 2));
	assert_int_equal(fake_count(bus, 1, FAKE_POLL), 50 * POLL_EXCHANGES);
	assert_int_equal(fake_stats(bus).overruns, 0);
	fake_bus_free(bus);
}

/* A changed drive: the old one leaves, the new one has its address and another number. */
static void an_address_is_used_again(void **state)
{
	struct fake_bus *bus = open_bus(3, DRIVES);

	(void)state;
	bus->drives[3].address = 2;
	change_drives(bus, 3, 1, 3);
	fake_pass(bus, 300 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_count(bus, 2, FAKE_STOP), 1);
	assert_true(fake_count(bus, 2, FAKE_PROBE) >= 1);
	assert_true(fake_is_online(bus, 3));
	assert_int_equal(fake_stats(bus).online, 3);
	fake_post(bus, 3, DB_CMD_ENABLE);
	fake_post(bus, 1, DB_CMD_ENABLE);
	fake_pass(bus, 5 * MS);
	assert_int_equal(result_of(bus, 3, DB_CMD_ENABLE), DB_RESULT_OK);
	assert_int_equal(result_of(bus, 1, DB_CMD_ENABLE), DB_RESULT_FAILED);
	fake_bus_free(bus);
}

/* A status and a probe of the old drive were lost, and their answers may still come: the new one is
 * asked nothing before they can have come. */
static void answers_to_the_one_before_are_waited_for(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);
	db_time changed;

	(void)state;
	bus->drives[1].on_exit = DB_ON_LOSS_NONE;
	bus->drives[3].address = 2;
	bus->dead[2] = true;
	while (fake_count(bus, 2, FAKE_PROBE) == 0)
		fake_pass(bus, 100 * US);
	fake_pass(bus, 6 * MS);
	changed = bus->now;
	change_drives(bus, 2, 1, 3);
	fake_forget_sent(bus);
	while (fake_count(bus, 2, FAKE_PROBE) == 0)
		fake_pass(bus, 100 * US);
	assert_true(fetch_change(bus));
	assert_in_range(bus->now - changed, 10 * MS, 20 * MS);
	fake_bus_free(bus);
}

static void all_may_leave_and_come_back(void **state)
{
	struct fake_bus *bus = open_bus(1, DRIVES);

	(void)state;
	change_drives(bus, 1, 0, -1);
	fake_pass(bus, 50 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_stats(bus).online, 0);
	change_drives(bus, 0, -1, 1);
	fake_pass(bus, 200 * MS);
	assert_true(fetch_change(bus));
	assert_true(fake_is_online(bus, 1));
	fake_bus_free(bus);
}

/* --- several at one address ------------------------------------------------------------------------ */

static void an_axis_leaves_and_the_others_go_on(void **state)
{
	(void)state;
	for (int leaves = 1; leaves <= 2; leaves++) {
		struct fake_bus *bus = open_bus(3, 1); /* one alone, two at address 2 */
		size_t stays = leaves == 1 ? 2 : 1;
		int32_t before = fake_feedback(bus, stays).position;

		/* It stands: the stop, which is for all of them, is not needed. */
		change_drives(bus, 3, leaves, -1);
		fake_pass(bus, 1000 * MS);
		assert_true(fetch_change(bus));
		assert_int_equal(fake_count(bus, 2, FAKE_STOP), 0);
		assert_int_equal(fake_feedback(bus, stays).position, before + 50);
		assert_int_equal(fake_count(bus, 2, FAKE_PROBE), 0);
		assert_int_equal(fake_stats(bus).online, 2);
		assert_int_equal(fake_stats(bus).overruns, 0);
		fake_bus_free(bus);
	}
}

static void an_axis_that_moves_is_stopped(void **state)
{
	struct fake_bus *bus = open_bus(3, 1);

	(void)state;
	fake_post(bus, 1, DB_CMD_MOVE_VELOCITY);
	fake_pass(bus, 50 * MS);
	change_drives(bus, 3, 1, -1);
	fake_pass(bus, 50 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_count(bus, 2, FAKE_STOP), 1);
	fake_bus_free(bus);
}

/* What it was told may not show yet. */
static void an_axis_that_was_just_told_to_move_is_stopped(void **state)
{
	struct fake_bus *bus = open_bus(3, 1);

	(void)state;
	fake_post(bus, 1, DB_CMD_MOVE_VELOCITY);
	fake_pass(bus, bus->answer_time / 2);
	change_drives(bus, 3, 1, -1);
	fake_pass(bus, 50 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_count(bus, 2, FAKE_STOP), 1);
	fake_bus_free(bus);
}

/* In the middle of a poll, which is one conversation for all of them. */
static void an_axis_leaves_between_two_polls(void **state)
{
	struct fake_bus *bus = open_bus(3, 1);
	int32_t before = fake_feedback(bus, 2).position;

	(void)state;
	while (fake_count(bus, 2, FAKE_POLL) == 0)
		fake_pass(bus, 100 * US);
	change_drives(bus, 3, 1, -1);
	fake_pass(bus, 50 * US);
	assert_false(fetch_change(bus));
	fake_pass(bus, 100 * MS);
	assert_true(fetch_change(bus));
	assert_in_range(fake_feedback(bus, 2).position, before + 5, before + 6);
	fake_bus_free(bus);
}

static void the_first_axis_comes_back(void **state)
{
	struct fake_bus *bus = open_bus(3, 1);

	(void)state;
	bus->drives[3].address = 2;
	bus->drives[3].axis = 0;
	change_drives(bus, 3, 1, 3);
	fake_pass(bus, 300 * MS);
	assert_true(fetch_change(bus));
	assert_true(fake_is_online(bus, 2) && fake_is_online(bus, 3));
	assert_true(fake_feedback(bus, 3).status & DB_STATUS_PARAMS_VALID);
	/* Then the other one, and then all of them. */
	change_drives(bus, 3, 2, -1);
	fake_pass(bus, 100 * MS);
	assert_true(fetch_change(bus));
	change_drives(bus, 2, 3, -1);
	fake_pass(bus, 100 * MS);
	assert_true(fetch_change(bus));
	assert_int_equal(fake_stats(bus).online, 1);
	fake_forget_sent(bus);
	fake_pass(bus, 100 * MS);
	assert_int_equal(fake_count(bus, 2, FAKE_POLL), 0);
	assert_int_equal(fake_count(bus, 1, FAKE_POLL), 5 * POLL_EXCHANGES);
	fake_bus_free(bus);
}

/* --- the end of the service meanwhile ----------------------------------------------------------------- */

static void the_end_comes_while_one_leaves(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	change_drives(bus, 2, 1, 2);
	db_engine_shut_down(bus->engine, bus->now);
	fake_pass(bus, 50 * MS);
	assert_true(db_engine_is_quiet(bus->engine, false));
	assert_int_equal(fake_count(bus, 1, FAKE_STOP), 1);
	assert_int_equal(fake_count(bus, 2, FAKE_STOP), 1);
	assert_false(fetch_change(bus));
	fake_bus_free(bus);
}

static void a_change_that_comes_after_the_end_does_nothing(void **state)
{
	struct fake_bus *bus = open_bus(2, DRIVES);

	(void)state;
	db_engine_shut_down(bus->engine, bus->now);
	change_drives(bus, 2, 1, 2);
	fake_pass(bus, 50 * MS);
	assert_true(db_engine_is_quiet(bus->engine, false));
	assert_int_equal(fake_count(bus, 2, FAKE_STOP), 1);
	fake_bus_free(bus);
}

/* --- whose turn it is ------------------------------------------------------------------------------ */

#define TURNS 6

static void get_turns(struct db_engine *engine, size_t *turns[TURNS])
{
	turns[0] = &engine->next_poll;
	turns[1] = &engine->next_probe;
	turns[2] = &engine->next_command;
	turns[3] = &engine->next_stop;
	turns[4] = &engine->next_identify;
	turns[5] = &engine->next_refresh;
}

/* On a bus that is down, where nothing else changes whose turn it is: `next` before, and this afterwards. */
static void expect_turns(size_t drives, size_t next, int leaves, int comes, size_t after)
{
	struct fake_bus *bus = open_bus(drives, DRIVES);
	size_t *turns[TURNS];

	fake_port(bus, 5);
	get_turns(bus->engine, turns);
	for (size_t i = 0; i < TURNS; i++)
		*turns[i] = next;
	change_drives(bus, drives, leaves, comes);
	fake_pass(bus, MS);
	assert_true(fetch_change(bus));
	for (size_t i = 0; i < TURNS; i++)
		assert_int_equal(*turns[i], after);
	if (comes >= 0)
		assert_int_equal(fake_feedback(bus, (size_t)comes).error, DB_ERROR_BUS_DOWN);
	fake_bus_free(bus);
}

/* The drive whose turn it was is the next one, whoever leaves; and one that comes is not before the others. */
static void turns_go_on_where_they_were(void **state)
{
	(void)state;
	expect_turns(6, 3, 1, -1, 2);
	expect_turns(6, 3, 2, -1, 2);
	expect_turns(6, 3, 3, -1, 3);
	expect_turns(6, 3, 4, -1, 3);
	expect_turns(6, 0, 0, -1, 0);
	/* Behind the last one it is the first one's. */
	expect_turns(6, 6, 2, -1, 0);
	expect_turns(5, 5, -1, 5, 0);
	expect_turns(5, 2, -1, 5, 2);
	expect_turns(1, 1, -1, 5, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_change_that_nobody_fetches_is_freed_with_the_bus),
		cmocka_unit_test(a_bus_may_end_while_its_drives_leave),
		cmocka_unit_test(the_others_stay_on_schedule_when_one_leaves),
		cmocka_unit_test(whoever_leaves_the_others_are_polled_in_every_cycle),
		cmocka_unit_test(one_that_leaves_unread_leaves_the_cycle_whole),
		cmocka_unit_test(the_last_drive_to_answer_is_forgotten_when_it_leaves),
		cmocka_unit_test(a_drive_that_has_left_gets_no_gap_test),
		cmocka_unit_test(a_drive_that_leaves_without_stopping_is_reported),
		cmocka_unit_test(several_leave_and_several_come),
		cmocka_unit_test(requests_that_wait_for_a_leaving_drive_end_at_once),
		cmocka_unit_test(whenever_it_happens_no_cycle_is_missed),
		cmocka_unit_test(what_waits_for_it_ends_once),
		cmocka_unit_test(a_stop_that_is_under_way_is_confirmed),
		cmocka_unit_test(on_exit_none_leaves_it_running),
		cmocka_unit_test(one_that_does_not_answer_is_waited_for_a_bounded_time),
		cmocka_unit_test(on_a_bus_that_is_down_it_leaves_at_once),
		cmocka_unit_test(a_drive_that_comes_is_found_and_asked),
		cmocka_unit_test(a_drive_that_comes_and_is_silent_costs_little),
		cmocka_unit_test(an_address_is_used_again),
		cmocka_unit_test(answers_to_the_one_before_are_waited_for),
		cmocka_unit_test(all_may_leave_and_come_back),
		cmocka_unit_test(an_axis_leaves_and_the_others_go_on),
		cmocka_unit_test(an_axis_that_moves_is_stopped),
		cmocka_unit_test(an_axis_that_was_just_told_to_move_is_stopped),
		cmocka_unit_test(an_axis_leaves_between_two_polls),
		cmocka_unit_test(the_first_axis_comes_back),
		cmocka_unit_test(the_end_comes_while_one_leaves),
		cmocka_unit_test(a_change_that_comes_after_the_end_does_nothing),
		cmocka_unit_test(turns_go_on_where_they_were),
	};

	return cmocka_run_group_tests_name("change", tests, NULL, NULL);
}
