/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A serial line that is kept: for a stop whose drive does not hear yet, and for other things that stops go before; what is
 * never begun while a drive of it may move.
 */
#include "fakes/rs485.h"
#include "sched/sched_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define US DB_NS_PER_US
/* Two readings of a status, as schedule.md has it, and an eighth of that for the steps in which time passes. */
#define EXCHANGE (2 * 3500 * US + MS)

static const unsigned four[] = { 3, 4, 5, 6, 0 };
static const unsigned two_and_twelve[] = { 2, 12, 0 };

/* --- stops that wait for silence --------------------------------------------------------------------- */

/* A full line, on which it is known that the first drive hears so much after its answers, and the others at once. */
static struct rs485 *line_with_deaf_drive(const unsigned *addresses, db_time deaf)
{
	struct rs485 *line = rs485_new(addresses);

	line->bus->config.cycle_ms = 5;
	line->nodes[0].deaf = deaf;
	rs485_begin(line);
	fake_pass(line->bus, 10000 * MS);
	assert_true(fake_snapshot(line->bus, 0).learnt.gap_us * US >= deaf);
	assert_true(fake_snapshot(line->bus, 1).learnt.gap_us < 1000);
	return line;
}

/* Whatever was asked meanwhile, of whom it is not known whether he answers, would make it late by all of that. */
static void nothing_begins_while_a_stop_waits_for_its_drive_to_hear(void **state)
{
	struct rs485 *line = line_with_deaf_drive(four, 6 * MS);
	unsigned waited = 0;

	(void)state;
	for (unsigned i = 0; i < 60; i++) {
		db_time wait;

		fake_pass(line->bus, 100 * MS + i * 370 * US);
		fake_post(line->bus, 0, DB_CMD_STOP);
		wait = rs485_wait_for(line, "3 stp");
		assert_int_equal(line->meanwhile, 0);
		assert_true(wait < EXCHANGE + LEARN_GAP_MOST);
		waited += wait > 4 * MS;
		fake_pass(line->bus, 50 * MS);
		assert_int_equal(fake_result(line->bus), DB_RESULT_OK);
	}
	/* There was something to wait for. */
	assert_true(waited > 10);
	rs485_free(line);
}

/* A whole wait for an answer, if it went first. */
static void a_stop_that_may_not_be_answered_waits_for_one_that_waits_to_be_heard(void **state)
{
	struct rs485 *line = line_with_deaf_drive(four, 6 * MS);

	(void)state;
	line->nodes[1].faults.left[SIM_FAULT_SILENCE] = -1;
	fake_pass(line->bus, 2000 * MS);
	assert_false(fake_is_online(line->bus, 1));
	for (unsigned i = 0; i < DB_QUEUE_STOPS_EACH; i++) {
		fake_pass(line->bus, 300 * MS + i * 370 * US);
		fake_post(line->bus, 1, DB_CMD_STOP);
		fake_post(line->bus, 0, DB_CMD_STOP);
		assert_true(rs485_wait_for(line, "3 stp") < 35 * MS + LEARN_GAP_MOST);
		assert_int_equal(line->meanwhile, 0);
		while (fake_result(line->bus) != DB_RESULT_NONE)
			;
	}
	rs485_free(line);
}

/* Drive 2, which could hear "2 stp" of "12 stp", does not obey: it is told again and again, and read after it. */
static void repeats_do_not_put_a_first_stop_off(void **state)
{
	struct rs485 *line = line_with_deaf_drive(two_and_twelve, 0);

	(void)state;
	assert_int_equal(rs485_enable(line, 0), DB_RESULT_OK);
	assert_int_equal(rs485_turn(line, 0, 400.0f), DB_RESULT_OK);
	line->ignored = "2 stp";
	fake_post(line->bus, 0, DB_CMD_STOP);
	for (unsigned i = 0; i < 100; i++) {
		fake_pass(line->bus, 60 * MS + i * 370 * US);
		while (fake_result(line->bus) != DB_RESULT_NONE)
			;
		/* It may be spoken to soon after its answers, but a stop must not be misheard. */
		line->bus->engine->nodes[0]->gap.sure = LEARN_GAP_MOST;
		fake_post(line->bus, 1, DB_CMD_STOP);
		assert_true(rs485_wait_for(line, "12 stp") < EXCHANGE + LEARN_GAP_MOST);
		assert_int_equal(line->meanwhile, 0);
	}
	assert_true(fake_feedback(line->bus, 0).status & DB_STATUS_MOVING);
	rs485_free(line);
}

/* --- what is kept for something else --------------------------------------------------------------------- */

/* Drives whose exchanges are short, but for reading parameters, which is not said again either. */
struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	float speed; /* of the first drive, as answers show it but those to motions */
	db_time answer_time;
};

static enum db_step begin(struct db_conversation *talk)
{
	enum db_step step = fake_family.begin(talk);

	if (talk->job->kind == DB_JOB_COMMAND &&
	    talk->job->request->command == DB_CMD_READ_PARAMETERS) {
		talk->exchange->extra_time = 50 * MS;
		talk->exchange->repeatable = false;
	}
	return step;
}

static db_time obey(void *context, struct fake_frame *frame)
{
	const struct world *world = context;

	frame->speed = frame->address == 1 && frame->kind != FAKE_COMMAND ? world->speed : 0.0f;
	return FAKE_ANSWER_TIME;
}

static struct world *open_world(void)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = fake_family;
	world->driver.begin = begin;
	world->bus = fake_bus_new(&world->driver, 2);
	world->bus->context = world;
	world->bus->obey = obey;
	world->bus->config.cycle_ms = 100;
	fake_bus_open(world->bus, 2, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	return world;
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

static void pass_until_read(struct world *world)
{
	db_time taken = fake_feedback(world->bus, 1).taken;

	while (fake_feedback(world->bus, 1).taken == taken)
		fake_pass(world->bus, MS / 10);
	fake_forget_sent(world->bus);
}

/* The second drive has just answered, and is sure to hear so much later only: the line is kept for the reading of its
 * parameters until then. */
static void keep_line(struct world *world, db_time time)
{
	pass_until_read(world);
	world->bus->engine->nodes[1]->gap.sure = (int32_t)time;
	fake_post(world->bus, 1, DB_CMD_READ_PARAMETERS);
	fake_pass(world->bus, MS);
	assert_true(world->bus->engine->reserved.until > world->bus->now);
	assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 0);
}

static void what_the_line_is_kept_for_is_sent(void **state)
{
	struct world *world = open_world();

	(void)state;
	keep_line(world, 20 * MS);
	fake_pass(world->bus, 17 * MS);
	assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 0);
	fake_pass(world->bus, 5 * MS);
	assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 1);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

/* Whatever else has become due meanwhile: the answer to that would have it wait once more. */
static void what_the_line_is_kept_for_goes_first(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		struct world *world = open_world();
		const struct fake_sent *first;
		db_time until;

		/* A cycle begins before that, and another command waits. */
		keep_line(world, 120 * MS);
		fake_forget_sent(world->bus);
		until = world->bus->engine->reserved.until;
		world->bus->engine->last_was_continued = i % 2 != 0;
		fake_post(world->bus, 0, i < 2 ? DB_CMD_ENABLE : DB_CMD_READ_PARAMETERS);
		fake_pass(world->bus, 125 * MS);
		assert_true(world->bus->sent_count > 0);
		first = world->bus->sent;
		assert_int_equal(first->frame.address, 2);
		assert_int_equal(first->frame.kind, FAKE_COMMAND);
		assert_true(first->at == until);
		assert_int_equal(world->bus->engine->reserved.until, 0);
		fake_pass(world->bus, 50 * MS);
		assert_int_equal(fake_count(world->bus, 1, FAKE_COMMAND), 1);
		assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 1);
		close_world(world);
	}
}

/* Its command is cancelled by a stop. */
static void what_the_line_was_kept_for_is_not_sent_when_it_is_over(void **state)
{
	struct world *world = open_world();

	(void)state;
	keep_line(world, 60 * MS);
	fake_post(world->bus, 1, DB_CMD_STOP);
	fake_pass(world->bus, 40 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_CANCELLED);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	fake_pass(world->bus, 140 * MS);
	assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 0);
	assert_int_equal(world->bus->engine->reserved.until, 0);
	/* And the line is everybody's again. */
	assert_true(fake_count(world->bus, 1, FAKE_POLL) > 0);
	assert_true(fake_count(world->bus, 2, FAKE_POLL) > 0);
	close_world(world);
}

/* Whatever it was kept for went with its port. */
static void a_line_is_kept_for_nothing_when_it_is_back(void **state)
{
	struct world *world = open_world();

	(void)state;
	keep_line(world, 400 * MS);
	fake_port(world->bus, 5);
	assert_int_equal(fake_result(world->bus), DB_RESULT_BUS_DOWN);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 50 * MS);
	assert_true(fake_is_online(world->bus, 0));
	close_world(world);
}

/* A probe that is lost costs a drive its place in the round: it is sent when the drive is sure to hear. */
static void a_probe_waits_until_its_drive_is_sure_to_hear(void **state)
{
	struct world *world = open_world();
	db_time answered = 0;
	unsigned probes = 0;

	(void)state;
	world->bus->config.cycle_ms = 30;
	world->bus->dead[2] = true;
	fake_pass(world->bus, 1000 * MS);
	assert_false(fake_is_online(world->bus, 1));
	world->bus->engine->nodes[0]->hold.sure = 20 * MS;
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 20000 * MS);
	for (size_t i = 0; i < world->bus->sent_count; i++) {
		const struct fake_sent *sent = &world->bus->sent[i];

		if (sent->frame.address == 1) {
			answered = sent->at + FAKE_ANSWER_TIME;
			continue;
		}
		assert_int_equal(sent->frame.kind, FAKE_PROBE);
		assert_true(sent->at - answered >= 20 * MS);
		probes++;
	}
	assert_true(probes >= 8);
	close_world(world);
}

/* The answer to its stop shows that the first drive moves. */
static void what_the_line_is_kept_for_is_not_sent_when_a_drive_moves_since(void **state)
{
	struct world *world = open_world();

	(void)state;
	keep_line(world, 20 * MS);
	world->speed = 10.0f;
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 60 * MS);
	assert_true(fake_count(world->bus, 1, FAKE_STOP) > 0);
	assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 0);
	assert_int_equal(fake_result(world->bus), DB_RESULT_LINE_MOVES);
	close_world(world);
}

/* One that is not obeyed is said again, and its drive read, while the line is kept for another. */
static void a_stop_is_said_again_while_the_line_is_kept(void **state)
{
	struct world *world = open_world();

	(void)state;
	keep_line(world, 80 * MS);
	world->speed = 10.0f;
	fake_post(world->bus, 0, DB_CMD_STOP);
	/* The first one, and what follows its answers at once. */
	fake_pass(world->bus, 5 * MS);
	assert_true(world->bus->engine->reserved.until > world->bus->now + 60 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 60 * MS);
	assert_true(fake_count(world->bus, 1, FAKE_STOP) >= 2);
	assert_true(fake_count(world->bus, 1, FAKE_POLL) >= 2);
	close_world(world);
}

/* --- what continues ---------------------------------------------------------------------------------- */

/* It is told to get power in two exchanges. */
static enum db_step answer_twice(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	if (talk->job->kind == DB_JOB_COMMAND && talk->job->step++ == 0)
		return fake_say(talk, FAKE_COMMAND);
	return fake_family.answer(talk, bytes, length);
}

/* And not with the next cycle only. */
static void a_command_continues_as_soon_as_its_drive_hears(void **state)
{
	struct db_driver driver = fake_family;
	struct fake_bus *bus;
	const struct node *node;
	db_time gap;

	(void)state;
	driver.answer = answer_twice;
	bus = fake_bus_new(&driver, 1);
	bus->config.cycle_ms = 100;
	bus->config.turnaround_us = 6000;
	bus->config.adapt = true;
	fake_bus_open(bus, 1, NULL);
	fake_port(bus, 0);
	fake_pass(bus, 530 * MS);
	node = bus->engine->nodes[0];
	gap = node->gap.now;
	assert_true(gap > 2 * MS);
	fake_forget_sent(bus);
	fake_post(bus, 0, DB_CMD_ENABLE);
	fake_pass(bus, 20 * MS);
	assert_int_equal(fake_result(bus), DB_RESULT_OK);
	assert_int_equal(bus->sent_count, 2);
	assert_true(bus->sent[1].at == bus->sent[0].at + FAKE_ANSWER_TIME + gap);
	fake_bus_free(bus);
}

/* --- what may move ----------------------------------------------------------------------------------- */

/* A motion that was acknowledged shows with the next sample only. */
static void nothing_long_begins_before_it_shows_whether_a_motion_began(void **state)
{
	struct world *world = open_world();

	(void)state;
	pass_until_read(world);
	fake_post(world->bus, 0, DB_CMD_MOVE_VELOCITY);
	fake_pass(world->bus, 2 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_false(fake_feedback(world->bus, 0).status & DB_STATUS_MOVING);
	assert_true(exchange_must_be_short(world->bus->engine));
	fake_post(world->bus, 1, DB_CMD_READ_PARAMETERS);
	fake_pass(world->bus, 2 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_LINE_MOVES);
	assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 0);
	/* It did not. */
	pass_until_read(world);
	assert_false(exchange_must_be_short(world->bus->engine));
	fake_post(world->bus, 1, DB_CMD_READ_PARAMETERS);
	fake_pass(world->bus, 2 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

/* One that waits for its drive to set off: between its exchanges another drive's parameters could be read. */
static void nothing_long_begins_while_a_motion_waits_for_its_drive(void **state)
{
	struct rs485 *line = rs485_new(four);
	unsigned refused = 0;

	(void)state;
	line->drives[0].temper.motion_delay = 100 * MS;
	rs485_begin(line);
	fake_pass(line->bus, 3000 * MS);
	assert_int_equal(rs485_enable(line, 0), DB_RESULT_OK);
	fake_request(line->bus, 0,
	             (struct db_request){ .command = DB_CMD_MOVE_VELOCITY,
	                                  .args = &(struct db_args){ .target_velocity = 400.0f } });
	assert_true(rs485_wait_for(line, "3 mov") < 20 * MS);
	while (!(fake_feedback(line->bus, 0).status & DB_STATUS_MOVING)) {
		fake_post(line->bus, 1, DB_CMD_READ_PARAMETERS);
		fake_pass(line->bus, 10 * MS);
		while (refused < 9 && fake_result(line->bus) == DB_RESULT_LINE_MOVES)
			refused++;
		assert_int_equal(rs485_count_heard(&line->nodes[1], "4 cfg\r"), 0);
	}
	assert_true(refused >= 5);
	rs485_free(line);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(nothing_begins_while_a_stop_waits_for_its_drive_to_hear),
		cmocka_unit_test(
			a_stop_that_may_not_be_answered_waits_for_one_that_waits_to_be_heard),
		cmocka_unit_test(repeats_do_not_put_a_first_stop_off),
		cmocka_unit_test(what_the_line_is_kept_for_is_sent),
		cmocka_unit_test(what_the_line_is_kept_for_goes_first),
		cmocka_unit_test(what_the_line_was_kept_for_is_not_sent_when_it_is_over),
		cmocka_unit_test(a_line_is_kept_for_nothing_when_it_is_back),
		cmocka_unit_test(a_probe_waits_until_its_drive_is_sure_to_hear),
		cmocka_unit_test(what_the_line_is_kept_for_is_not_sent_when_a_drive_moves_since),
		cmocka_unit_test(a_stop_is_said_again_while_the_line_is_kept),
		cmocka_unit_test(a_command_continues_as_soon_as_its_drive_hears),
		cmocka_unit_test(nothing_long_begins_before_it_shows_whether_a_motion_began),
		cmocka_unit_test(nothing_long_begins_while_a_motion_waits_for_its_drive),
	};

	return cmocka_run_group_tests_name("exchange", tests, NULL, NULL);
}
