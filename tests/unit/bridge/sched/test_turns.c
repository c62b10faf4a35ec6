/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the drives of a bus take turns: long commands, readings of parameters, cycles, repeated stops
 * and probes of offline drives; also drives that report by themselves, damaged frames, and a port
 * that is down or full. Made-up drives in made-up time.
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
#define EXCHANGES 6 /* of a long command */

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	db_time answer_time;
	float speed;
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
	world->answer_time = FAKE_ANSWER_TIME;
	world->bus = fake_bus_new(&world->driver, drives);
	world->bus->context = world;
	world->bus->obey = obey;
	return world;
}

static void open_world(struct world *world)
{
	fake_bus_open(world->bus, world->bus->drive_count, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	fake_forget_sent(world->bus);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	free(world);
}

/* --- commands --------------------------------------------------------------------------------- */

static enum db_step begin_long(struct db_conversation *talk)
{
	enum db_step step = fake_family.begin(talk);

	return fake_kind_of(talk->job) == FAKE_COMMAND ? fake_say(talk, FAKE_PREPARE) : step;
}

static enum db_step answer_long(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	if (fake_frame_at(bytes, length).kind != FAKE_PREPARE)
		return fake_family.answer(talk, bytes, length);
	if (++talk->job->step < EXCHANGES)
		return fake_say(talk, FAKE_PREPARE);
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

/* The addresses of the exchanges of commands, in their order. */
static size_t list_commands(const struct world *world, unsigned *addresses, size_t most)
{
	size_t count = 0;

	for (size_t i = 0; i < world->bus->sent_count; i++) {
		const struct fake_frame *frame = &world->bus->sent[i].frame;

		if (frame->kind == FAKE_PREPARE && count < most)
			addresses[count++] = frame->address;
	}
	return count;
}

static void long_commands_take_turns(void **state)
{
	struct world *world = new_world(3);
	unsigned addresses[3 * EXCHANGES];

	(void)state;
	world->driver.begin = begin_long;
	world->driver.answer = answer_long;
	open_world(world);
	for (size_t i = 0; i < 3; i++)
		fake_post(world->bus, i, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(list_commands(world, addresses, 3 * EXCHANGES), 3 * EXCHANGES);
	for (size_t i = 0; i < 3; i++)
		assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	/* While all three are there, none has two exchanges in a row. */
	for (size_t i = 6; i < 2 * EXCHANGES; i++)
		assert_int_not_equal(addresses[i], addresses[i - 1]);
	close_world(world);
}

/* One that continues waits for one new command, and a new one for one that continues. */
static void new_commands_and_long_ones_take_turns(void **state)
{
	struct world *world = new_world(4);
	unsigned addresses[4 * EXCHANGES];
	size_t count;
	size_t begun = 0;
	bool seen[5] = { false };

	(void)state;
	world->driver.begin = begin_long;
	world->driver.answer = answer_long;
	open_world(world);
	fake_post(world->bus, 0, DB_CMD_MOVE_ABSOLUTE);
	while (list_commands(world, addresses, 1) == 0)
		fake_pass(world->bus, MS / 10);
	for (size_t i = 1; i < 4; i++)
		fake_post(world->bus, i, DB_CMD_MOVE_ABSOLUTE);
	fake_pass(world->bus, 200 * MS);
	count = list_commands(world, addresses, 4 * EXCHANGES);
	assert_int_equal(count, 4 * EXCHANGES);
	for (size_t i = 0; begun < 4; i++) {
		assert_true(i < 7);
		begun += !seen[addresses[i]];
		/* Not two in a row that begin, or that continue. */
		if (i > 0)
			assert_int_equal(seen[addresses[i]], i % 2 == 1);
		seen[addresses[i]] = true;
	}
	close_world(world);
}

/* While true, a command of drive 1 repeats its question after each answer, as commands do that wait
 * for their effect. */
static bool goes_on;

static enum db_step answer_again(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	enum db_step step = fake_family.answer(talk, bytes, length);

	if (step != DB_STEP_DONE || talk->job->kind != DB_JOB_COMMAND || !goes_on ||
	    talk->device->address != 1)
		return step;
	talk->exchange->again = true;
	return fake_say(talk, FAKE_COMMAND);
}

/* The question is repeated every 2 ms on a free line, and once in a cycle on a full one. */
static void a_question_is_not_repeated_all_the_time(void **state)
{
	static const unsigned cycles[] = { 100, 6 };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct world *world = new_world(4);
		unsigned most = i == 0 ? 600 / 2 : 600 / 6;

		world->driver.answer = answer_again;
		world->bus->config.cycle_ms = cycles[i];
		fake_option(world->bus, "poll-exchanges", 6);
		open_world(world);
		goes_on = true;
		fake_post(world->bus, 0, DB_CMD_ENABLE);
		for (unsigned n = 0; n < 6000; n++) {
			const struct flight *flight = &world->bus->engine->nodes[0]->flight;

			fake_pass(world->bus, MS / 10);
			/* The repeated question is charged to a share of the line. */
			assert_false(flight->station && flight->share == DB_SHARE_NONE);
		}
		assert_in_range(fake_count(world->bus, 1, FAKE_COMMAND), most * 3 / 4, most + 2);
		goes_on = false;
		fake_pass(world->bus, 50 * MS);
		assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
		close_world(world);
	}
}

static void commands_that_wait_for_one_drive_delay_no_other(void **state)
{
	struct world *world = new_world(2);

	(void)state;
	world->bus->config.queue = 64;
	world->driver.answer = answer_again;
	open_world(world);
	goes_on = true;
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 20 * MS);
	for (unsigned i = 0; i < 60; i++)
		fake_post(world->bus, 0, DB_CMD_CLEAR_FAULT);
	fake_post(world->bus, 1, DB_CMD_ENABLE);
	fake_pass(world->bus, 20 * MS);
	assert_int_equal(fake_count(world->bus, 2, FAKE_COMMAND), 1);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	close_world(world);
}

/* This family does not set `joins_settings`: two writes that wait together are not joined. */
static void each_write_has_an_exchange_of_its_own(void **state)
{
	const struct db_setting settings[2] = { { .param = 0 }, { .param = 1 } };
	struct world *world = new_world(1);

	(void)state;
	open_world(world);
	for (size_t i = 0; i < 2; i++) {
		const struct db_request request = {
			.ticket = 1 + (uint32_t)i,
			.settings = &settings[i],
			.setting_count = 1,
			.submitted = world->bus->now,
		};

		assert_non_null(db_queue_post(world->bus->queue, &request));
	}
	fake_pass(world->bus, 50 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_COMMAND), 2);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	close_world(world);
}

/* --- parameters ------------------------------------------------------------------------------- */

static void hide_parameters(const struct db_device *device, struct db_feedback *feedback)
{
	fake_family.feedback(device, feedback);
	feedback->status &= ~(uint32_t)DB_STATUS_PARAMS_VALID;
}

/* All is asked for, and something stays unknown. */
static void what_stays_unknown_is_asked_for_twice_a_second(void **state)
{
	struct world *world = new_world(1);

	(void)state;
	world->driver.feedback = hide_parameters;
	open_world(world);
	fake_pass(world->bus, 10000 * MS);
	assert_in_range(fake_count(world->bus, 1, FAKE_IDENTIFY), 19, 21);
	close_world(world);
}

/* Where readings leave no time between them there is no idle moment to look for it. */
static void what_becomes_unknown_is_asked_for_on_a_full_line(void **state)
{
	struct world *world = new_world(4);

	(void)state;
	world->bus->config.cycle_ms = 1;
	open_world(world);
	fake_pass(world->bus, 500 * MS);
	fake_forget_sent(world->bus);
	world->driver.feedback = hide_parameters;
	fake_pass(world->bus, 1000 * MS);
	for (unsigned address = 1; address <= 4; address++)
		assert_true(fake_count(world->bus, address, FAKE_IDENTIFY) > 0);
	close_world(world);
}

static void what_is_not_answered_is_asked_for_ever_less_often(void **state)
{
	struct world *world = new_world(1);

	(void)state;
	world->silent[FAKE_IDENTIFY] = true;
	open_world(world);
	fake_pass(world->bus, 20000 * MS);
	assert_in_range(fake_count(world->bus, 1, FAKE_IDENTIFY), 3, 6);
	assert_true(fake_snapshot(world->bus, 0).stats.timeouts >= 3);
	assert_true(fake_snapshot(world->bus, 0).stats.retries >= 3);
	assert_in_range(fake_stats(world->bus).retries, 3, 20);
	assert_true(fake_is_online(world->bus, 0));
	close_world(world);
}

/* The next cycle begins only after a second: the drive is asked before that. */
static void what_becomes_unknown_is_asked_for_at_once_on_a_free_line(void **state)
{
	(void)state;
	for (size_t drives = 1; drives <= 2; drives++) {
		struct world *world = new_world(drives);

		world->bus->config.cycle_ms = 1000;
		world->answer_time = 3 * MS;
		open_world(world);
		fake_pass(world->bus, 2000 * MS);
		fake_forget_sent(world->bus);
		world->driver.feedback = hide_parameters;
		for (unsigned i = 0; i < 2000 && fake_feedback(world->bus, drives - 1).status &
		                                         DB_STATUS_PARAMS_VALID;
		     i++)
			fake_pass(world->bus, MS);
		fake_pass(world->bus, 10 * MS);
		for (unsigned address = 1; address <= drives; address++)
			assert_int_equal(fake_count(world->bus, address, FAKE_IDENTIFY), 1);
		close_world(world);
	}
}

/* At whichever of the three addresses the drive is. */
static void the_only_drive_that_answers_is_asked_for_its_parameters(void **state)
{
	(void)state;
	for (unsigned there = 1; there <= 3; there++) {
		struct world *world = new_world(3);

		for (unsigned address = 1; address <= 3; address++)
			world->bus->dead[address] = address != there;
		open_world(world);
		assert_true(fake_feedback(world->bus, there - 1).status & DB_STATUS_PARAMS_VALID);
		close_world(world);
	}
}

static enum db_step begin_refresh(struct db_conversation *talk)
{
	return talk->job->kind == DB_JOB_REFRESH ? fake_say(talk, FAKE_LOOK) :
	                                           fake_family.begin(talk);
}

static enum db_step answer_refresh(struct db_conversation *talk, const uint8_t *bytes,
                                   size_t length)
{
	if (talk->job->kind != DB_JOB_REFRESH)
		return fake_family.answer(talk, bytes, length);
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

static struct world *open_refreshing(db_time pause)
{
	struct world *world = new_world(3);

	world->driver.refresh_pause = pause;
	world->driver.begin = begin_refresh;
	world->driver.answer = answer_refresh;
	open_world(world);
	return world;
}

static void known_parameters_are_read_again_in_turn(void **state)
{
	struct world *world = open_refreshing(100 * MS);
	db_time last = 0;
	unsigned before = 0;

	(void)state;
	fake_pass(world->bus, 3000 * MS);
	for (size_t i = 0; i < world->bus->sent_count; i++) {
		const struct fake_sent *sent = &world->bus->sent[i];

		if (sent->frame.kind != FAKE_LOOK)
			continue;
		assert_true(sent->at - last >= 100 * MS);
		if (before != 0)
			assert_int_equal(sent->frame.address, before % 3 + 1);
		last = sent->at;
		before = sent->frame.address;
	}
	for (unsigned address = 1; address <= 3; address++)
		assert_in_range(fake_count(world->bus, address, FAKE_LOOK), 8, 10);
	close_world(world);
}

/* A drive that is offline is left out, and so is a drive whose parameters are not all known. */
static void known_parameters_of_drives_that_answer_are_read_again(void **state)
{
	struct world *world = open_refreshing(100 * MS);

	(void)state;
	world->bus->dead[1] = true;
	fake_pass(world->bus, 1000 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 3000 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 0);
	for (unsigned address = 2; address <= 3; address++)
		assert_in_range(fake_count(world->bus, address, FAKE_LOOK), 12, 15);
	world->driver.feedback = hide_parameters;
	fake_pass(world->bus, 1000 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 1000 * MS);
	for (unsigned address = 1; address <= 3; address++)
		assert_int_equal(fake_count(world->bus, address, FAKE_LOOK), 0);
	close_world(world);
}

static enum db_step answer_refresh_or_again(struct db_conversation *talk, const uint8_t *bytes,
                                            size_t length)
{
	return talk->job->kind == DB_JOB_REFRESH ? answer_refresh(talk, bytes, length) :
	                                           answer_again(talk, bytes, length);
}

/* The command may be changing one of the parameters. */
static void known_parameters_are_not_read_again_during_a_command(void **state)
{
	struct world *world = open_refreshing(100 * MS);

	(void)state;
	world->driver.answer = answer_refresh_or_again;
	goes_on = true;
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 200 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 0);
	for (unsigned address = 2; address <= 3; address++)
		assert_true(fake_count(world->bus, address, FAKE_LOOK) > 0);
	goes_on = false;
	fake_pass(world->bus, 1000 * MS);
	assert_true(fake_count(world->bus, 1, FAKE_LOOK) > 0);
	/* The engine keeps the time at which the command ended: for a while after it the drive is
	 * read more often. */
	assert_true(world->bus->engine->stations[0]->command_ended > world->bus->now - 1000 * MS);
	close_world(world);
}

/* Nor where the family does not ask for it. */
static void known_parameters_are_not_read_again_while_a_drive_moves(void **state)
{
	struct world *world = open_refreshing(100 * MS);

	(void)state;
	world->speed = 1.0f;
	fake_pass(world->bus, 200 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 1000 * MS);
	for (unsigned address = 1; address <= 3; address++)
		assert_int_equal(fake_count(world->bus, address, FAKE_LOOK), 0);
	close_world(world);
	world = open_refreshing(0);
	fake_pass(world->bus, 1000 * MS);
	for (unsigned address = 1; address <= 3; address++)
		assert_int_equal(fake_count(world->bus, address, FAKE_LOOK), 0);
	close_world(world);
}

/* --- cycles ----------------------------------------------------------------------------------- */

/* The cycles of a second that were too short for four drives, each of which takes so long. */
static uint32_t count_overruns(unsigned cycle_ms, db_time answer_time, bool evenly, float speed)
{
	struct world *world = new_world(4);
	uint32_t before;
	uint32_t after;

	world->bus->config.polls_evenly = evenly;
	world->bus->config.cycle_ms = cycle_ms;
	world->bus->config.drive_latency_ms = 50;
	open_world(world);
	world->answer_time = answer_time;
	world->speed = speed;
	fake_pass(world->bus, 500 * MS);
	before = fake_stats(world->bus).overruns;
	fake_pass(world->bus, 1000 * MS);
	after = fake_stats(world->bus).overruns;
	close_world(world);
	return after - before;
}

static void a_cycle_that_is_too_short_counts_where_it_had_to_be_enough(void **state)
{
	(void)state;
	assert_int_equal(count_overruns(20, MS, false, 0.0f), 0);
	assert_int_equal(count_overruns(20, MS, true, 0.0f), 0);
	assert_in_range(count_overruns(20, 10 * MS, false, 0.0f), 20, 50);
	assert_in_range(count_overruns(20, 10 * MS, true, 0.0f), 20, 50);
	/* One in which so many that stand cannot all be read need not be. */
	assert_int_equal(count_overruns(1, FAKE_ANSWER_TIME, false, 0.0f), 0);
	assert_in_range(count_overruns(1, FAKE_ANSWER_TIME, true, 0.0f), 400, 1000);
	/* 2 ms are just enough for four drives that answer in FAKE_ANSWER_TIME. These take longer,
	 * and that counts. */
	assert_in_range(count_overruns(2, 10 * MS, false, 0.0f), 400, 500);
	/* Drives that move must be read in every cycle. */
	assert_in_range(count_overruns(1, FAKE_ANSWER_TIME, false, 1.0f), 900, 1000);
}

static db_time tell_axis_time(const struct db_bus_config *bus)
{
	(void)bus;
	return FAKE_ANSWER_TIME;
}

/* A reading of the controller takes the time of one drive, and axis_time() for each further axis:
 * 2 ms are enough for four axes, so a cycle that is missed counts. */
static void a_cycle_with_room_for_all_axes_counts_if_it_is_too_short(void **state)
{
	struct world *world = new_world(4);

	(void)state;
	world->driver.axis_time = tell_axis_time;
	for (unsigned i = 0; i < 4; i++) {
		world->bus->drives[i].address = 1;
		world->bus->drives[i].axis = i;
	}
	world->bus->config.cycle_ms = 2;
	world->answer_time = 5 * MS;
	open_world(world);
	assert_in_range(fake_stats(world->bus).overruns, 100, 250);
	close_world(world);
}

/* Drives on CAN are asked at the same time: their frames take little time of the wire, but each
 * drive takes 30 ms to answer, and is not read more often than that. */
static void the_poll_interval_is_at_least_the_time_of_a_reading(void **state)
{
	struct world *world = new_world(2);

	(void)state;
	world->driver.medium = DB_MEDIUM_CAN;
	world->bus->config.cycle_ms = 4;
	world->bus->config.drive_latency_ms = 50;
	world->answer_time = 30 * MS;
	open_world(world);
	fake_pass(world->bus, 2000 * MS);
	assert_in_range(fake_snapshot(world->bus, 0).stats.poll_interval_us, 30000, 31000);
	close_world(world);
}

/* --- stops ------------------------------------------------------------------------------------ */

/* All three drives move, and one of them ignores its stop, which is sent again and again: the other
 * two are still read in turn. */
static void a_stop_that_is_repeated_leaves_turns_to_the_others(void **state)
{
	struct world *world = new_world(3);
	unsigned stops = 0;

	(void)state;
	world->speed = 1.0f;
	open_world(world);
	fake_post(world->bus, 1, DB_CMD_STOP);
	for (unsigned i = 0; i < 5000; i++) {
		const struct flight *flight = &world->bus->engine->nodes[1]->flight;

		fake_pass(world->bus, MS / 10);
		if (!flight->station || flight->lane != LANE_STOP)
			continue;
		assert_int_equal(flight->share, DB_SHARE_NONE);
		stops++;
	}
	assert_true(stops > 0);
	assert_in_range(fake_count(world->bus, 1, FAKE_POLL), 20, 30);
	assert_in_range(fake_count(world->bus, 3, FAKE_POLL), 20, 30);
	close_world(world);
}

/* --- drives that are gone --------------------------------------------------------------------- */

/* A twentieth of the line, and all of that. */
static void drives_that_are_gone_are_looked_for_with_their_share(void **state)
{
	struct world *world = new_world(5);
	unsigned probes = 0;

	(void)state;
	world->bus->config.drive_latency_ms = LATENCY / MS;
	open_world(world);
	for (unsigned address = 1; address <= 4; address++)
		world->bus->dead[address] = true;
	fake_pass(world->bus, 10000 * MS);
	fake_forget_sent(world->bus);
	fake_pass(world->bus, 100000 * MS);
	for (unsigned address = 1; address <= 4; address++)
		probes += fake_count(world->bus, address, FAKE_PROBE);
	assert_in_range(probes, 100000 / 100 / 20 - 2, 100000 / 100 / 20 + 1);
	close_world(world);
}

/* The probes of an offline drive belong to the share with the lowest precedence. */
static void a_drive_that_is_gone_is_looked_for_in_the_background(void **state)
{
	struct world *world = new_world(2);
	const struct flight *flight;

	(void)state;
	open_world(world);
	world->bus->dead[1] = true;
	fake_pass(world->bus, 5000 * MS);
	flight = &world->bus->engine->nodes[0]->flight;
	for (unsigned i = 0; i < 100000 && !flight->station; i++)
		fake_pass(world->bus, MS / 10);
	assert_non_null(flight->station);
	assert_int_equal(flight->lane, LANE_PROBE);
	assert_int_equal(flight->share, DB_SHARE_BACKGROUND);
	close_world(world);
}

/* --- reports ---------------------------------------------------------------------------------- */

static unsigned polls_begun;

/* Knows without asking what the drive does. */
static enum db_step begin_no_poll(struct db_conversation *talk)
{
	if (talk->job->kind != DB_JOB_POLL)
		return fake_family.begin(talk);
	polls_begun++;
	talk->result = DB_RESULT_OK;
	return DB_STEP_DONE;
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

/* It is asked for once in each cycle all the same, and not all the time. */
static void a_drive_that_reports_by_itself_takes_no_time(void **state)
{
	struct world *world = new_world(1);
	const struct fake_frame report = { .address = 1, .kind = FAKE_REPORT, .speed = 1.0f };

	(void)state;
	world->driver.begin = begin_no_poll;
	world->driver.report = take_report;
	open_world(world);
	polls_begun = 0;
	for (unsigned i = 0; i < 20; i++) {
		fake_receive(world->bus, &report, sizeof report);
		fake_pass(world->bus, 50 * MS);
	}
	assert_true(fake_feedback(world->bus, 0).status & DB_STATUS_MOVING);
	assert_in_range(polls_begun, 45, 55);
	assert_int_equal(fake_count(world->bus, 1, FAKE_POLL), 0);
	assert_int_equal(fake_stats(world->bus).overruns, 0);
	close_world(world);
}

/* --- frames that cannot be used --------------------------------------------------------------- */

static enum db_frame accept_damaged(const struct db_bus_config *bus, const uint8_t *bytes,
                                    size_t length, int *address)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	if (frame.kind != FAKE_FOREIGN)
		return fake_family.accept(bus, bytes, length, address);
	*address = frame.address;
	return DB_FRAME_BAD;
}

/* A damaged frame that says it is from the second drive, while the first one's answer is awaited, or none. */
static void receive_damaged(enum db_medium medium, bool awaited, uint32_t *first, uint32_t *second,
                            struct db_unusable unusable[2])
{
	const struct fake_frame damaged = { .address = 2, .kind = FAKE_FOREIGN, .unused = 0x5A };
	struct world *world = new_world(2);
	uint32_t before;

	world->driver.medium = medium;
	world->driver.accept = accept_damaged;
	world->answer_time = 5 * MS;
	open_world(world);
	while (world->bus->engine->flights > 0)
		fake_pass(world->bus, MS);
	fake_forget_sent(world->bus);
	world->bus->dead[2] = true;
	while (awaited && !world->bus->engine->nodes[0]->flight.station)
		fake_pass(world->bus, MS / 10);
	before = fake_stats(world->bus).bad_frames;
	fake_receive(world->bus, &damaged, sizeof damaged);
	assert_int_equal(fake_stats(world->bus).bad_frames, before + 1);
	for (size_t i = 0; i < 2; i++) {
		unusable[i] = world->bus->engine->nodes[i]->unusable;
		engine_publish(world->bus->engine, world->bus->engine->stations[i]);
	}
	*first = fake_snapshot(world->bus, 0).stats.bad_frames;
	*second = fake_snapshot(world->bus, 1).stats.bad_frames;
	close_world(world);
}

static void a_damaged_frame_is_kept_as_of_who_may_have_sent_it(void **state)
{
	struct db_unusable unusable[2];
	uint32_t first;
	uint32_t second;

	(void)state;
	/* On a serial line its address may be what is damaged: it is of who was asked. */
	receive_damaged(DB_MEDIUM_SERIAL, true, &first, &second, unusable);
	assert_int_equal(first, 1);
	assert_int_equal(second, 0);
	assert_int_equal(unusable[0].count, 1);
	assert_int_equal(unusable[0].length, sizeof(struct fake_frame));
	assert_int_equal(unusable[1].count, 0);
	receive_damaged(DB_MEDIUM_SERIAL, false, &first, &second, unusable);
	assert_int_equal(first + second, 0);
	assert_int_equal(unusable[0].count + unusable[1].count, 0);
	/* On CAN an id shows who sent it. */
	receive_damaged(DB_MEDIUM_CAN, false, &first, &second, unusable);
	assert_int_equal(first + second, 0);
	assert_int_equal(unusable[0].count, 0);
	assert_int_equal(unusable[1].count, 1);
}

static void a_whole_status_ends_what_could_not_be_used(void **state)
{
	struct world *world = new_world(1);

	(void)state;
	open_world(world);
	world->bus->engine->nodes[0]->unusable.count = 4;
	fake_pass(world->bus, 50 * MS);
	assert_int_equal(world->bus->engine->nodes[0]->unusable.count, 0);
	close_world(world);
}

/* What a drive sends that answers nothing may be why it is not understood; one that is, and was not asked, needs no reason. */
static void what_answers_nothing_is_kept_where_it_may_explain_something(void **state)
{
	const struct fake_frame other = { .address = 1, .kind = FAKE_LOOK };

	(void)state;
	for (unsigned online = 0; online < 2; online++) {
		for (unsigned asked = 0; asked < 2; asked++) {
			struct world *world = new_world(1);
			struct node *node;
			uint32_t stray;

			world->answer_time = 5 * MS;
			open_world(world);
			node = world->bus->engine->nodes[0];
			world->bus->dead[1] = !online;
			while (node->online != online || (node->flight.station != NULL) != asked)
				fake_pass(world->bus, MS / 10);
			node->unusable.count = 0;
			node->lost_due = 0;
			stray = fake_stats(world->bus).stray_frames;
			fake_receive(world->bus, &other, sizeof other);
			assert_int_equal(fake_stats(world->bus).stray_frames - stray, 1);
			assert_int_equal(node->unusable.count, !online || asked);
			close_world(world);
		}
	}
}

static uint32_t tell_part(const struct db_bus_config *bus, const uint8_t *frame, size_t length)
{
	(void)bus;
	return fake_frame_at(frame, length).kind == FAKE_POLL;
}

/* With the second answer, not with the next reading. */
static void two_drives_at_one_address_show_at_once(void **state)
{
	const struct fake_frame first = { .address = 1, .kind = FAKE_POLL, .speed = 1.0f };
	const struct fake_frame second = { .address = 1, .kind = FAKE_POLL, .speed = 2.0f };
	struct world *world = new_world(1);

	(void)state;
	open_world(world);
	world->driver.part = tell_part;
	while (world->bus->engine->flights > 0)
		fake_pass(world->bus, MS / 10);
	world->silent[FAKE_POLL] = true;
	while (world->bus->engine->flights == 0)
		fake_pass(world->bus, MS / 10);
	fake_receive(world->bus, &first, sizeof first);
	assert_int_equal(fake_snapshot(world->bus, 0).stats.doubled_answers, 0);
	fake_receive(world->bus, &second, sizeof second);
	assert_int_equal(fake_snapshot(world->bus, 0).stats.doubled_answers, 1);
	assert_true(fake_feedback(world->bus, 0).velocity == 1.0f);
	close_world(world);
}

/* Where an earlier probe may still be answered, its answer is not that of this one; it is no other question's at all. */
static void the_answer_to_an_earlier_probe_brings_no_drive_back(void **state)
{
	const struct fake_frame probed = { .address = 1, .kind = FAKE_PROBE };
	const struct fake_frame read = { .address = 1, .kind = FAKE_POLL };

	(void)state;
	for (unsigned online = 0; online < 2; online++) {
		const struct fake_frame *answer = online ? &read : &probed;
		struct world *world = new_world(1);
		struct node *node;
		uint32_t stray;

		open_world(world);
		node = world->bus->engine->nodes[0];
		while (node->flight.station)
			fake_pass(world->bus, MS / 10);
		world->bus->dead[1] = true;
		while (node->online != online || !node->flight.station)
			fake_pass(world->bus, MS / 10);
		assert_int_equal(node->flight.lane, online ? LANE_POLL : LANE_PROBE);
		node->late_probes = 1;
		node->late_probes_until = node->risky_until = world->bus->now + 1000 * MS;
		stray = fake_stats(world->bus).stray_frames;
		fake_receive(world->bus, answer, sizeof *answer);
		assert_int_equal(fake_stats(world->bus).stray_frames - stray, !online);
		assert_int_equal(node->flight.station == NULL, online);
		fake_receive(world->bus, answer, online ? 0 : sizeof *answer);
		assert_true(node->online);
		assert_null(node->flight.station);
		close_world(world);
	}
}

/* --- ports ------------------------------------------------------------------------------------ */

static void a_port_is_down_since_it_was_lost(void **state)
{
	struct world *world = new_world(1);
	struct fake_bus *bus = world->bus;
	db_time first;

	(void)state;
	fake_bus_open(bus, 1, NULL);
	/* It was never open. */
	first = bus->now;
	fake_port(bus, 5);
	fake_pass(bus, 100 * MS);
	fake_port(bus, 5);
	assert_int_equal(fake_stats(bus).down_since, first);
	fake_port(bus, 0);
	fake_pass(bus, 100 * MS);
	first = bus->now;
	fake_port(bus, 5);
	fake_pass(bus, 100 * MS);
	fake_port(bus, 6);
	assert_int_equal(fake_stats(bus).down_since, first);
	assert_int_equal(fake_stats(bus).last_error, 6);
	assert_false(fake_stats(bus).aside);
	/* It is down for another reason. */
	fake_pass(bus, 100 * MS);
	db_engine_set_aside(bus->engine, bus->now);
	assert_int_equal(fake_stats(bus).down_since, bus->now);
	assert_true(fake_stats(bus).aside);
	fake_pass(bus, 100 * MS);
	fake_port(bus, 5);
	assert_int_equal(fake_stats(bus).down_since, bus->now);
	assert_false(fake_stats(bus).aside);
	close_world(world);
}

/* What it has taken is sent that much later, and so answered. */
static void a_full_port_gives_each_drive_its_time_back(void **state)
{
	struct world *world = new_world(3);
	struct fake_bus *bus = world->bus;
	uint32_t timeouts;
	db_time wire_free;

	(void)state;
	world->driver.medium = DB_MEDIUM_CAN;
	bus->config.drive_latency_ms = 40;
	bus->config.retries = 5;
	open_world(world);
	for (unsigned address = 1; address <= 3; address++)
		bus->dead[address] = true;
	while (bus->engine->flights < 3)
		fake_pass(bus, MS / 10);
	timeouts = fake_stats(bus).timeouts;
	wire_free = bus->engine->wire_free;
	db_engine_hold(bus->engine, true, bus->now);
	fake_pass(bus, 10 * MS);
	/* As often as it is said, it has been full since then. */
	db_engine_hold(bus->engine, true, bus->now);
	fake_pass(bus, 90 * MS);
	assert_int_equal(fake_stats(bus).timeouts, timeouts);
	db_engine_hold(bus->engine, false, bus->now);
	assert_int_equal(bus->engine->wire_free, wire_free + 100 * MS);
	fake_pass(bus, 35 * MS);
	assert_int_equal(fake_stats(bus).timeouts, timeouts);
	fake_pass(bus, 10 * MS);
	assert_int_equal(fake_stats(bus).timeouts, timeouts + 3);
	/* Said once more, it gives nothing. */
	wire_free = bus->engine->wire_free;
	db_engine_hold(bus->engine, false, bus->now);
	assert_int_equal(bus->engine->wire_free, wire_free);
	close_world(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(long_commands_take_turns),
		cmocka_unit_test(new_commands_and_long_ones_take_turns),
		cmocka_unit_test(a_question_is_not_repeated_all_the_time),
		cmocka_unit_test(commands_that_wait_for_one_drive_delay_no_other),
		cmocka_unit_test(each_write_has_an_exchange_of_its_own),
		cmocka_unit_test(what_stays_unknown_is_asked_for_twice_a_second),
		cmocka_unit_test(what_becomes_unknown_is_asked_for_on_a_full_line),
		cmocka_unit_test(what_becomes_unknown_is_asked_for_at_once_on_a_free_line),
		cmocka_unit_test(the_only_drive_that_answers_is_asked_for_its_parameters),
		cmocka_unit_test(what_is_not_answered_is_asked_for_ever_less_often),
		cmocka_unit_test(known_parameters_are_read_again_in_turn),
		cmocka_unit_test(known_parameters_of_drives_that_answer_are_read_again),
		cmocka_unit_test(known_parameters_are_not_read_again_during_a_command),
		cmocka_unit_test(known_parameters_are_not_read_again_while_a_drive_moves),
		cmocka_unit_test(a_cycle_that_is_too_short_counts_where_it_had_to_be_enough),
		cmocka_unit_test(a_cycle_with_room_for_all_axes_counts_if_it_is_too_short),
		cmocka_unit_test(the_poll_interval_is_at_least_the_time_of_a_reading),
		cmocka_unit_test(a_stop_that_is_repeated_leaves_turns_to_the_others),
		cmocka_unit_test(drives_that_are_gone_are_looked_for_with_their_share),
		cmocka_unit_test(a_drive_that_is_gone_is_looked_for_in_the_background),
		cmocka_unit_test(a_drive_that_reports_by_itself_takes_no_time),
		cmocka_unit_test(a_damaged_frame_is_kept_as_of_who_may_have_sent_it),
		cmocka_unit_test(a_whole_status_ends_what_could_not_be_used),
		cmocka_unit_test(what_answers_nothing_is_kept_where_it_may_explain_something),
		cmocka_unit_test(two_drives_at_one_address_show_at_once),
		cmocka_unit_test(the_answer_to_an_earlier_probe_brings_no_drive_back),
		cmocka_unit_test(a_port_is_down_since_it_was_lost),
		cmocka_unit_test(a_full_port_gives_each_drive_its_time_back),
	};

	return cmocka_run_group_tests_name("sched/turns", tests, NULL, NULL);
}
