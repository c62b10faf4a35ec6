/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a frame is for the drive that sent it, whatever was awaited: an answer, a late one, a report, one of another drive, or
 * damage; and what a loss leaves behind. Made-up drives in made-up time.
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

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	struct db_engine_ops ops;
	struct db_engine *engine;
	struct node *node; /* the first one */
};

/* What was told last. */
static struct {
	struct db_engine_timing timing;
	unsigned timings;
	unsigned unusable;
	unsigned raw_sent;
	unsigned raw_answers; /* with the bytes of one */
	unsigned raw_losses;
} told;

static void note_timing(void *context, const struct db_drive_config *drive,
                        const struct db_engine_timing *timing)
{
	(void)context;
	(void)drive;
	told.timing = *timing;
	told.timings++;
}

static void note_unusable(void *context, const struct db_drive_config *drive,
                          const struct db_unusable *unusable)
{
	(void)context;
	(void)drive;
	assert_true(unusable->count > 0);
	told.unusable++;
}

static void note_raw_frame(void *context, const struct db_drive_config *drive, bool sent,
                           const uint8_t *bytes, size_t length)
{
	(void)context;
	(void)drive;
	told.raw_sent += sent;
	told.raw_losses += !sent && !bytes && length == 0;
	told.raw_answers += !sent && bytes && length == sizeof(struct fake_frame);
}

/* A bus on which nothing is under way or due for ten seconds, and whose drives answer nothing that is asked then. Its driver
 * can be changed before. */
static void open_changed(struct world *world, size_t drives)
{
	memset(&told, 0, sizeof told);
	world->bus = fake_bus_new(&world->driver, drives);
	fake_bus_open(world->bus, drives, NULL);
	world->engine = world->bus->engine;
	world->ops = *world->engine->ops;
	world->ops.on_timing = note_timing;
	world->ops.on_unusable = note_unusable;
	world->ops.on_raw_frame = note_raw_frame;
	world->engine->ops = &world->ops;
	fake_port(world->bus, 0);
	fake_settle(world->bus);
	world->node = world->engine->nodes[0];
	world->bus->obey = fake_answer_nothing;
	fake_forget_sent(world->bus);
}

static void open_world(struct world *world, size_t drives, enum db_medium medium)
{
	world->driver = fake_family;
	world->driver.medium = medium;
	open_changed(world, drives);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
}

static void receive(struct world *world, unsigned address, enum fake_kind kind)
{
	const struct fake_frame frame = { .address = (uint8_t)address, .kind = (uint8_t)kind };

	fake_receive(world->bus, &frame, sizeof frame);
}

/* Lets the drive be read, and waits until it is asked. */
static void ask_for_status(struct world *world, struct node *node)
{
	engine_mark_for_reading(world->engine, node);
	world->engine->idle_until = 0;
	while (!is_flying(node))
		fake_pass(world->bus, MS / 10);
	assert_int_equal(node->flight.lane, LANE_POLL);
}

static void wait_for_loss(struct world *world)
{
	uint32_t before = fake_stats(world->bus).timeouts;

	while (fake_stats(world->bus).timeouts == before)
		fake_pass(world->bus, MS / 10);
}

/* What the node was asked last should have been answered this long ago. */
static void lose(struct world *world, db_time latency)
{
	world->node->lost_due = world->bus->now - latency;
	world->node->late_answer_time = 1000 * MS;
	world->node->gap.lost = 2;
	world->engine->last_to_answer = world->node;
	world->node->hold.lost = 2;
	world->node->unusable.count = 0;
	told.timings = 0;
}

/* --- late answers ----------------------------------------------------------------------------- */

/* That it is late the drive is not blamed for losses, and that a moment longer would do is nothing to be told of. */
static void an_answer_that_comes_late_is_no_loss(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	world.node->patience.most = (int32_t)(100 * MS);
	lose(&world, 12 * MS);
	world.node->online = false;
	receive(&world, 1, FAKE_POLL);
	assert_int_equal(world.node->gap.lost, 0);
	assert_int_equal(world.node->hold.lost, 0);
	assert_int_equal(world.node->unusable.count, 0);
	assert_int_equal(told.timings, 0);
	world.node->online = true;
	close_world(&world);
}

/* How much longer it would have to be waited for, in whole milliseconds. */
static void one_that_no_patience_waits_for_is_told(void **state)
{
	static const struct {
		db_time latency;
		unsigned ms;
	} lates[] = { { 12 * MS, 12 }, { 12 * MS + 1, 13 }, { 10 * MS, 10 } };

	(void)state;
	for (size_t i = 0; i < sizeof lates / sizeof lates[0]; i++) {
		for (unsigned online = 0; online < 2; online++) {
			struct world world;

			open_world(&world, 1, DB_MEDIUM_SERIAL);
			world.node->patience.most = (int32_t)(10 * MS);
			lose(&world, lates[i].latency);
			world.node->online = online;
			receive(&world, 1, FAKE_POLL);
			assert_int_equal(told.timings, 1);
			assert_int_equal(told.timing.event, DB_EVENT_DRIVE_LATE);
			assert_int_equal(told.timing.time, lates[i].latency);
			assert_int_equal(told.timing.learnt, 0);
			assert_int_equal(world.node->late_ms, lates[i].ms);
			/* Why one that is not there is not. */
			assert_int_equal(world.node->timing == DB_TROUBLE_LATE, !online);
			assert_int_equal(world.node->unusable.count, 0);
			world.node->online = true;
			close_world(&world);
		}
	}
}

static void what_is_waited_for_from_now_on_is_told(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	world.node->patience.most = (int32_t)(100 * MS);
	lose(&world, 12 * MS);
	receive(&world, 1, FAKE_POLL);
	assert_int_equal(told.timings, 0);
	lose(&world, 12 * MS);
	world.node->online = false;
	receive(&world, 1, FAKE_POLL);
	assert_int_equal(told.timings, 1);
	assert_true(told.timing.learnt >= 12 * MS);
	assert_int_equal(told.timing.learnt, world.node->patience.now);
	assert_int_equal(world.node->late_ms, 12);
	assert_int_not_equal(world.node->timing, DB_TROUBLE_LATE);
	world.node->online = true;
	close_world(&world);
}

/* When it came is not known, because nobody looked. */
static void a_late_answer_that_was_read_late_shows_no_time(void **state)
{
	(void)state;
	for (unsigned late = 0; late < 2; late++) {
		struct world world;

		open_world(&world, 1, DB_MEDIUM_SERIAL);
		world.node->patience.most = (int32_t)(10 * MS);
		lose(&world, 12 * MS);
		world.node->online = false;
		world.engine->overslept_at = world.node->lost_due + late;
		receive(&world, 1, FAKE_POLL);
		assert_int_equal(told.timings, !late);
		assert_int_equal(world.node->gap.lost, 0);
		assert_int_equal(world.node->unusable.count, 0);
		world.node->online = true;
		close_world(&world);
	}
}

/* It may be the answer to the probe before. */
static void the_late_answer_to_a_probe_is_none_to_the_next(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	world.node->online = false;
	world.engine->stats.online--;
	world.node->in_step = false;
	world.node->probe_at = world.bus->now;
	world.engine->idle_until = 0;
	while (!is_flying(world.node))
		fake_pass(world.bus, MS / 10);
	assert_int_equal(world.node->flight.lane, LANE_PROBE);
	lose(&world, 12 * MS);
	/* What is none at all tells only that something is there. */
	receive(&world, 1, FAKE_POLL);
	assert_int_equal(world.node->gap.lost, 2);
	assert_int_equal(world.node->unusable.count, 1);
	node_expect_late_answer(world.node, true, world.bus->now);
	node_expect_late_answer(world.node, false, world.bus->now);
	receive(&world, 1, FAKE_PROBE);
	assert_true(is_flying(world.node));
	assert_int_equal(world.node->gap.lost, 0);
	receive(&world, 1, FAKE_PROBE);
	assert_false(is_flying(world.node));
	close_world(&world);
}

/* It was said without being sure that it is heard: who answers may answer something else. */
static void the_answer_to_a_stop_out_of_step_proves_nothing(void **state)
{
	struct world world;
	struct node *node;

	(void)state;
	open_world(&world, 2, DB_MEDIUM_SERIAL);
	node = world.node;
	node->in_step = false;
	node->hold.now = 3 * MS;
	fake_post(world.bus, 0, DB_CMD_STOP);
	while (fake_count(world.bus, 1, FAKE_STOP) == 0)
		fake_pass(world.bus, MS / 10);
	assert_int_equal(node->flight.lane, LANE_STOP);
	receive(&world, 1, FAKE_STOP);
	assert_false(is_flying(node));
	assert_int_equal(world.engine->flights, 0);
	assert_false(node->first->lanes[LANE_STOP].active);
	assert_false(node->in_step);
	assert_int_equal(node->risky_until, world.bus->now + node->late_answer_time);
	/* It switches from sending to receiving as after every answer. */
	assert_int_equal(world.engine->quiet_until, world.bus->now + 3 * MS);
	assert_int_equal(fake_result(world.bus), DB_RESULT_NONE);
	close_world(&world);
}

/* --- reports ---------------------------------------------------------------------------------- */

static bool take_report(struct db_device *device, const uint8_t *frame, size_t length, db_time now)
{
	(void)device;
	(void)now;
	return fake_frame_at(frame, length).kind == FAKE_REPORT;
}

/* One that reports is there, and is looked for at once; unless it is asked already, or will be as soon. */
static void a_drive_that_reports_is_looked_for(void **state)
{
	static const struct {
		bool online, flying;
		db_time probe_after;
		db_time backoff;
		bool changes;
	} cases[] = {
		{ false, false, 500 * MS, 4 * PROBE_BACKOFF_MIN, true },
		{ true, false, 500 * MS, 4 * PROBE_BACKOFF_MIN, false },
		{ false, true, 500 * MS, 4 * PROBE_BACKOFF_MIN, false },
		{ false, false, 0, 4 * PROBE_BACKOFF_MIN, false },
		{ false, false, 50 * MS, PROBE_BACKOFF_MIN, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct world world = { .driver = fake_family };
		struct node *node;
		db_time probe_at;

		world.driver.report = take_report;
		open_changed(&world, 1);
		node = world.node;
		if (cases[i].flying)
			ask_for_status(&world, node);
		node->online = cases[i].online;
		node->probe_at = probe_at = world.bus->now + cases[i].probe_after;
		node->probe_backoff = cases[i].backoff;
		receive(&world, 1, FAKE_REPORT);
		assert_int_equal(node->probe_at, cases[i].changes ? world.bus->now : probe_at);
		assert_int_equal(node->probe_backoff,
		                 cases[i].changes ? PROBE_BACKOFF_MIN : cases[i].backoff);
		node->online = true;
		close_world(&world);
	}
}

/* --- whose frame it is ------------------------------------------------------------------------ */

static enum db_frame accept_as_told(const struct db_bus_config *bus, const uint8_t *bytes,
                                    size_t length, int *address)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	(void)bus;
	/* Who sent it does not show. */
	*address = frame.unused ? -1 : frame.address;
	return DB_FRAME_GOOD;
}

/* On a line with one drive it is that drive's, whatever is asked. */
static void a_frame_without_a_sender_is_of_the_only_drive(void **state)
{
	const struct fake_frame frame = { .address = 1, .kind = FAKE_POLL, .unused = 1 };
	struct world world = { .driver = fake_family };

	(void)state;
	world.driver.accept = accept_as_told;
	open_changed(&world, 1);
	world.node->online = false;
	fake_receive(world.bus, &frame, sizeof frame);
	assert_int_equal(world.node->received_at, world.bus->now);
	assert_int_equal(world.node->unusable.count, 1);
	world.node->online = true;
	close_world(&world);
}

static void a_frame_without_a_sender_is_of_the_drive_that_was_asked(void **state)
{
	const struct fake_frame frame = { .kind = FAKE_POLL, .unused = 1, .speed = 7.0f };
	struct world world = { .driver = fake_family };

	(void)state;
	world.driver.accept = accept_as_told;
	open_changed(&world, 2);
	ask_for_status(&world, world.engine->nodes[1]);
	fake_receive(world.bus, &frame, sizeof frame);
	assert_true(fake_feedback(world.bus, 1).velocity == 7.0f);
	assert_false(fake_feedback(world.bus, 0).velocity == 7.0f);
	close_world(&world);
}

/* No drive has the address 0, which may stand in any frame. */
static void a_frame_from_address_0_is_nobodys(void **state)
{
	const struct fake_frame frame = { .address = 0, .kind = FAKE_POLL, .speed = 7.0f };

	(void)state;
	for (size_t drives = 1; drives <= 2; drives++) {
		struct world world = { .driver = fake_family };
		uint32_t stray;

		world.driver.accept = accept_as_told;
		open_changed(&world, drives);
		ask_for_status(&world, world.engine->nodes[drives - 1]);
		stray = fake_stats(world.bus).stray_frames;
		world.engine->foreign_address = 9;
		fake_receive(world.bus, &frame, sizeof frame);
		assert_true(is_flying(world.engine->nodes[drives - 1]));
		assert_int_equal(fake_stats(world.bus).stray_frames, stray + 1);
		assert_int_equal(world.engine->foreign_address, 9);
		close_world(&world);
	}
}

/* On CAN a damaged frame shows its sender, who may be none of ours; on a line it is the one who was asked. */
static void a_damaged_frame_is_blamed_on_whom_it_names(void **state)
{
	struct world world;

	(void)state;
	for (unsigned can = 0; can < 2; can++) {
		open_world(&world, 2, can ? DB_MEDIUM_CAN : DB_MEDIUM_SERIAL);
		ask_for_status(&world, world.engine->nodes[1]);
		receive(&world, 0, FAKE_POLL);
		assert_int_equal(world.engine->nodes[1]->unusable.count, !can);
		assert_int_equal(fake_snapshot(world.bus, 1).stats.bad_frames, 0);
		assert_int_equal(world.engine->stations[1]->snapshot.stats.bad_frames, !can);
		close_world(&world);
	}
}

/* A drive that is being given an address answers from there already, though another one has it. */
static void a_drive_may_answer_from_the_address_that_it_is_given(void **state)
{
	const struct fake_frame frame = { .address = 1, .kind = FAKE_POLL, .speed = 7.0f };
	struct world world;
	struct node *second;

	(void)state;
	open_world(&world, 2, DB_MEDIUM_SERIAL);
	second = world.engine->nodes[1];
	ask_for_status(&world, second);
	second->first->lanes[LANE_POLL].exchange.also_from = 1;
	fake_receive(world.bus, &frame, sizeof frame);
	assert_false(is_flying(second));
	assert_true(fake_feedback(world.bus, 1).velocity == 7.0f);
	second->first->lanes[LANE_POLL].exchange.also_from = 0;
	close_world(&world);
}

/* Requests that it could take for its own wait a moment. */
static void an_address_without_a_drive_that_answers_is_kept(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	receive(&world, 9, FAKE_POLL);
	assert_int_equal(world.engine->foreign_address, 9);
	assert_int_equal(world.engine->foreign_received_at, world.bus->now);
	/* One of ours is none. */
	receive(&world, 1, FAKE_POLL);
	assert_int_equal(world.engine->foreign_address, 9);
	close_world(&world);
}

static void address_1_without_a_drive_is_kept_too(void **state)
{
	struct world world = { .driver = fake_family };

	(void)state;
	world.bus = fake_bus_new(&world.driver, 1);
	world.bus->drives[0].address = 2;
	fake_bus_open(world.bus, 1, NULL);
	fake_port(world.bus, 0);
	receive(&world, 1, FAKE_POLL);
	assert_int_equal(world.bus->engine->foreign_address, 1);
	close_world(&world);
}

static uint32_t name_part(const struct db_bus_config *bus, const uint8_t *frame, size_t length)
{
	(void)bus;
	return fake_frame_at(frame, length).kind == FAKE_POLL ? 1 : 0;
}

/* Unless an answer that timed out may still come in addition. */
static void a_second_answer_is_another_drives(void **state)
{
	const struct fake_frame own = { .address = 1, .kind = FAKE_POLL, .speed = 3.0f };
	const struct fake_frame other = { .address = 1, .kind = FAKE_POLL, .speed = 7.0f };

	(void)state;
	for (unsigned risky = 0; risky < 2; risky++) {
		struct world world = { .driver = fake_family };
		uint32_t stray;

		world.driver.part = name_part;
		open_changed(&world, 1);
		ask_for_status(&world, world.node);
		fake_receive(world.bus, &own, sizeof own);
		stray = fake_stats(world.bus).stray_frames;
		world.node->risky_until = world.bus->now + risky;
		world.node->online = false; /* so that what nobody explains is kept */
		fake_receive(world.bus, &other, sizeof other);
		assert_int_equal(fake_stats(world.bus).stray_frames, stray + 1);
		assert_int_equal(world.node->first->snapshot.stats.doubled_answers, !risky);
		/* The other drive's explains nothing about this one. */
		assert_int_equal(world.node->unusable.count, risky);
		world.node->online = true;
		close_world(&world);
	}
}

/* --- answers ---------------------------------------------------------------------------------- */

static db_time kept_answer(void *context, struct fake_frame *frame)
{
	(void)context;
	(void)frame;
	return FAKE_ANSWER_TIME;
}

/* The first drive's parameters: from then on they are read again, one drive at a time. */
static void refreshing_begins_after_the_first_parameters(void **state)
{
	struct world world = { .driver = fake_family };
	db_time first = 0;

	(void)state;
	world.driver.refresh_pause = 60 * DB_NS_PER_S;
	world.bus = fake_bus_new(&world.driver, 2);
	world.bus->obey = kept_answer;
	fake_bus_open(world.bus, 2, NULL);
	fake_port(world.bus, 0);
	fake_pass(world.bus, 300 * MS);
	for (size_t i = 0; i < world.bus->sent_count && first == 0; i++) {
		if (world.bus->sent[i].frame.kind == FAKE_IDENTIFY)
			first = world.bus->sent[i].at;
	}
	assert_int_equal(fake_count(world.bus, 2, FAKE_IDENTIFY), 1);
	assert_int_equal(world.bus->engine->refresh_at,
	                 first + FAKE_ANSWER_TIME + world.driver.refresh_pause);
	close_world(&world);
}

/* Nothing becomes possible by a part of a status; a command may go on. */
static void a_part_of_an_answer_is_news_for_a_command_only(void **state)
{
	struct fake_frame part = { .address = 1, .kind = FAKE_POLL, .part = 1, .parts = 2 };
	struct world world;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	ask_for_status(&world, world.node);
	world.engine->idle_until = 7;
	fake_receive(world.bus, &part, sizeof part);
	assert_true(is_flying(world.node));
	assert_int_equal(world.engine->idle_until, 7);
	part.part = 2;
	fake_receive(world.bus, &part, sizeof part);
	assert_false(is_flying(world.node));
	fake_post(world.bus, 0, DB_CMD_ENABLE);
	while (!is_flying(world.node))
		fake_pass(world.bus, MS / 10);
	part.part = 1;
	part.kind = FAKE_COMMAND;
	world.engine->idle_until = 7;
	fake_receive(world.bus, &part, sizeof part);
	assert_true(is_flying(world.node));
	assert_int_equal(world.engine->idle_until, 0);
	close_world(&world);
}

static unsigned shown; /* calls of feedback() */

static void count_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	shown++;
	fake_family.feedback(device, feedback);
}

static bool leaves_unchanged;

static enum db_step answer_unchanged(struct db_conversation *talk, const uint8_t *bytes,
                                     size_t length)
{
	enum db_step step = fake_family.answer(talk, bytes, length);

	talk->unchanged = leaves_unchanged;
	return step;
}

/* A status of several answers shows with each one that changes something, and with the last. */
static void an_answer_that_changes_nothing_is_not_shown(void **state)
{
	(void)state;
	for (unsigned unchanged = 0; unchanged < 2; unchanged++) {
		struct world world = { .driver = fake_family };

		leaves_unchanged = false;
		world.driver.answer = answer_unchanged;
		world.driver.feedback = count_feedback;
		open_changed(&world, 1);
		world.engine->stations[0]->device->poll_exchanges = 2;
		leaves_unchanged = unchanged;
		ask_for_status(&world, world.node);
		shown = 0;
		receive(&world, 1, FAKE_POLL);
		assert_int_equal(shown > 0, !unchanged);
		while (!is_flying(world.node))
			fake_pass(world.bus, MS / 10);
		shown = 0;
		receive(&world, 1, FAKE_POLL);
		assert_true(shown > 0);
		close_world(&world);
	}
}

/* Of a command that goes on, too. */
static enum db_step begin_in_two(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	const struct fake_frame frame = fake_frame_at(bytes, length);

	if (frame.kind != FAKE_COMMAND || talk->job->step++ > 0)
		return fake_family.answer(talk, bytes, length);
	talk->device->speed = frame.speed;
	(void)fake_say(talk, FAKE_COMMAND);
	return DB_STEP_SEND;
}

static void every_answer_to_a_command_is_shown(void **state)
{
	const struct fake_frame frame = { .address = 1, .kind = FAKE_COMMAND, .speed = 7.0f };
	struct world world = { .driver = fake_family };

	(void)state;
	world.driver.answer = begin_in_two;
	open_changed(&world, 1);
	fake_post(world.bus, 0, DB_CMD_MOVE_VELOCITY);
	while (!is_flying(world.node))
		fake_pass(world.bus, MS / 10);
	world.node->losses = 2;
	world.engine->overslept_at = world.node->flight.sent;
	world.node->first->round_trips = 5;
	world.node->first->lanes[LANE_COMMAND].exchange.again = true;
	world.node->first->lanes[LANE_COMMAND].exchange.begins = true;
	/* A parameter write of the same drive is no part of it. */
	fake_request(
		world.bus, 0,
		(struct db_request){ .setting_count = 1, .settings = &(struct db_setting){ 0 } });
	(void)db_engine_run(world.engine, world.bus->now);
	assert_int_equal(world.engine->waiting_count, 1);
	fake_receive(world.bus, &frame, sizeof frame);
	assert_int_equal(world.engine->waiting_count, 1);
	assert_true(fake_feedback(world.bus, 0).velocity == 7.0f);
	/* It was there, and was read in time. */
	assert_int_equal(world.node->losses, 0);
	assert_int_equal(world.node->first->round_trips, 6);
	/* What the driver does not say again about the next question is not so. */
	assert_false(world.node->first->lanes[LANE_COMMAND].exchange.again);
	assert_false(world.node->first->lanes[LANE_COMMAND].exchange.begins);
	close_world(&world);
}

/* Its answer tells what the drive does then. */
static enum db_step answer_with_reading(struct db_conversation *talk, const uint8_t *bytes,
                                        size_t length)
{
	talk->device->taken = talk->now;
	return fake_family.answer(talk, bytes, length);
}

/* Without another reading, where its own conversation has read that the drive stands. */
static void a_stop_whose_effect_was_read_has_ended(void **state)
{
	(void)state;
	for (unsigned reads = 0; reads < 2; reads++) {
		const struct fake_frame frame = { .address = 1, .kind = FAKE_STOP };
		struct world world = { .driver = fake_family };

		if (reads)
			world.driver.answer = answer_with_reading;
		open_changed(&world, 1);
		fake_post(world.bus, 0, DB_CMD_STOP);
		while (!is_flying(world.node))
			fake_pass(world.bus, MS / 10);
		assert_int_equal(world.node->flight.lane, LANE_STOP);
		world.bus->now += MS;
		fake_receive(world.bus, &frame, sizeof frame);
		assert_int_equal(fake_result(world.bus), reads ? DB_RESULT_OK : DB_RESULT_NONE);
		close_world(&world);
	}
}

static const struct station *watched;
static bool shown_before; /* feedback() was called before the request had ended */

static void watch_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	shown_before = shown_before || (watched && watched->request);
	fake_family.feedback(device, feedback);
}

/* Who reads the drive right after the response finds it, on whatever thread. */
static void what_a_command_has_done_shows_before_it_ends(void **state)
{
	struct world world = { .driver = fake_family };

	(void)state;
	watched = NULL;
	shown_before = false;
	world.driver.feedback = watch_feedback;
	open_changed(&world, 1);
	fake_post(world.bus, 0, DB_CMD_ENABLE);
	while (!is_flying(world.node))
		fake_pass(world.bus, MS / 10);
	watched = world.node->first;
	receive(&world, 1, FAKE_COMMAND);
	assert_null(watched->request);
	assert_true(shown_before);
	assert_int_equal(fake_result(world.bus), DB_RESULT_OK);
	watched = NULL;
	close_world(&world);
}

static unsigned settled; /* calls of lost() */

static enum db_step settle(struct db_conversation *talk)
{
	settled++;
	talk->result = DB_RESULT_TIMEOUT;
	return DB_STEP_DONE;
}

/* The driver knows which parts of a write the drive has, whether the last of its lines was answered or not. */
static void a_write_that_is_cancelled_is_settled_by_its_driver(void **state)
{
	const struct fake_frame frame = { .address = 1, .kind = FAKE_COMMAND };

	(void)state;
	for (unsigned answered = 0; answered < 2; answered++) {
		struct world world = { .driver = fake_family };
		struct db_request ended;

		world.driver.joins_settings = true;
		world.driver.answer = begin_in_two;
		world.driver.lost = settle;
		open_changed(&world, 1);
		fake_request(world.bus, 0,
		             (struct db_request){ .setting_count = 1,
		                                  .settings = &(struct db_setting){ 0 } });
		while (!is_flying(world.node))
			fake_pass(world.bus, MS / 10);
		assert_int_equal(world.node->flight.lane, LANE_COMMAND);
		fake_post(world.bus, 0, DB_CMD_STOP);
		(void)db_engine_run(world.engine, world.bus->now);
		assert_true(world.node->first->command_cancelled);
		settled = 0;
		if (answered)
			fake_receive(world.bus, &frame, sizeof frame);
		else
			wait_for_loss(&world);
		assert_int_equal(settled, 1);
		assert_true(fake_collect(world.bus->queue, &ended));
		assert_int_equal(ended.result, DB_RESULT_CANCELLED);
		close_world(&world);
	}
}

static void raw_frames_and_their_answers_are_told(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	fake_post(world.bus, 0, DB_CMD_RAW_FRAME);
	while (!is_flying(world.node))
		fake_pass(world.bus, MS / 10);
	receive(&world, 1, FAKE_COMMAND);
	assert_int_equal(told.raw_sent, 1);
	assert_int_equal(told.raw_answers, 1);
	assert_int_equal(told.raw_losses, 0);
	fake_post(world.bus, 0, DB_CMD_RAW_FRAME);
	world.bus->config.retries = 0;
	wait_for_loss(&world);
	assert_int_equal(told.raw_answers, 1);
	assert_int_equal(told.raw_losses, 1);
	close_world(&world);
}

/* While its command waits for something else. */
static void the_answer_to_a_status_is_no_raw_frame(void **state)
{
	struct world world;
	struct station *station;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	station = world.node->first;
	fake_post(world.bus, 0, DB_CMD_RAW_FRAME);
	while (!is_flying(world.node))
		fake_pass(world.bus, MS / 10);
	world.node->flight.lane = LANE_POLL;
	station->lanes[LANE_POLL].job = (struct db_job){ .kind = DB_JOB_POLL };
	receive(&world, 1, FAKE_POLL);
	assert_false(is_flying(world.node));
	assert_int_equal(told.raw_answers, 0);
	close_world(&world);
}

/* --- losses ----------------------------------------------------------------------------------- */

static enum db_step ask_after_loss(struct db_conversation *talk)
{
	return fake_say(talk, FAKE_COMMAND);
}

static void a_lost_command_is_repeated_or_asked_about(void **state)
{
	(void)state;
	for (unsigned repeatable = 0; repeatable < 2; repeatable++) {
		struct world world = { .driver = fake_family };
		struct lane *lane;

		world.driver.lost = ask_after_loss;
		open_changed(&world, 1);
		lane = &world.node->first->lanes[LANE_COMMAND];
		fake_post(world.bus, 0, DB_CMD_ENABLE);
		while (!is_flying(world.node))
			fake_pass(world.bus, MS / 10);
		lane->exchange.repeatable = repeatable;
		lane->exchange.again = lane->exchange.begins = true;
		wait_for_loss(&world);
		assert_true(lane->ready);
		assert_int_equal(lane->tries, repeatable);
		assert_int_equal(fake_stats(world.bus).retries, repeatable);
		assert_int_equal(world.node->first->snapshot.stats.retries, repeatable);
		/* Another question is not what the former one was. */
		assert_int_equal(lane->exchange.again, repeatable);
		assert_int_equal(lane->exchange.begins, repeatable);
		close_world(&world);
	}
}

/* Its answer can be that of no later one then. */
static void a_lost_status_is_read_again_and_may_be_answered_late(void **state)
{
	struct world world;
	uint32_t retries;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	world.node->late_probes = 0;
	ask_for_status(&world, world.node);
	retries = world.node->first->snapshot.stats.retries;
	wait_for_loss(&world);
	assert_in_range(world.node->risky_until,
	                world.bus->now + world.node->late_answer_time - MS / 10,
	                world.bus->now + world.node->late_answer_time);
	assert_int_equal(world.node->late_probes, 0);
	assert_int_equal(world.node->first->snapshot.stats.retries, retries + 1);
	close_world(&world);
}

/* What is known of it then is no more than before. */
static void a_motion_that_was_cancelled_ends_when_its_answer_is_lost(void **state)
{
	struct world world;
	struct db_request ended;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	fake_post(world.bus, 0, DB_CMD_MOVE_ABSOLUTE);
	while (!is_flying(world.node))
		fake_pass(world.bus, MS / 10);
	fake_post(world.bus, 0, DB_CMD_STOP);
	(void)db_engine_run(world.engine, world.bus->now);
	assert_true(world.node->first->command_cancelled);
	wait_for_loss(&world);
	assert_true(fake_collect(world.bus->queue, &ended));
	assert_int_equal(ended.ticket, fake_ticket(0, DB_CMD_MOVE_ABSOLUTE));
	assert_int_equal(ended.result, DB_RESULT_CANCELLED);
	assert_null(world.node->first->request);
	close_world(&world);
}

/* A drive that sends only what cannot be used, five times since its last status. */
static void often_heard_and_never_understood_is_told(void **state)
{
	(void)state;
	for (unsigned heard = 4; heard <= 5; heard++) {
		struct world world;

		open_world(&world, 1, DB_MEDIUM_SERIAL);
		ask_for_status(&world, world.node);
		world.node->unusable.count = heard;
		world.node->flight.got_unusable = true;
		wait_for_loss(&world);
		assert_int_equal(told.unusable, heard == 5);
		close_world(&world);
	}
}

/* A probe of one that is gone for long is lost: what is heard since it was reported is told then. */
static void what_is_heard_of_one_that_is_gone_is_told_later_too(void **state)
{
	struct world world;
	struct node *node;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	node = world.node;
	ask_for_status(&world, node);
	while (node->online || node->probe_backoff < PROBE_BACKOFF_MAX)
		fake_pass(world.bus, 10 * MS);
	while (is_flying(node))
		fake_pass(world.bus, MS / 10);
	assert_true(node->first->last_logged.missing);
	assert_int_equal(told.unusable, 0);
	node->lost_due = 0;
	receive(&world, 1, FAKE_POLL);
	wait_for_loss(&world);
	assert_int_equal(told.unusable, 1);
	assert_false(node->first->lanes[LANE_PROBE].active);
	close_world(&world);
}

/* A question after a stop that was said out of step does not put off the probes of others. */
static void a_question_about_a_stop_is_no_probe_of_the_others_share(void **state)
{
	(void)state;
	for (unsigned stopped = 0; stopped < 2; stopped++) {
		struct world world;
		struct node *node;

		open_world(&world, 1, DB_MEDIUM_SERIAL);
		node = world.node;
		node->online = false;
		world.engine->stats.online--;
		node->probe_at = world.bus->now;
		world.engine->idle_until = 0;
		while (!is_flying(node))
			fake_pass(world.bus, MS / 10);
		assert_int_equal(node->flight.lane, LANE_PROBE);
		node->first->blind_stop_sent = stopped;
		world.engine->probes_from = 0;
		wait_for_loss(&world);
		assert_int_equal(world.engine->probes_from == 0, stopped);
		assert_false(node->first->lanes[LANE_PROBE].active);
		node->first->blind_stop_sent = false;
		close_world(&world);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_answer_that_comes_late_is_no_loss),
		cmocka_unit_test(one_that_no_patience_waits_for_is_told),
		cmocka_unit_test(what_is_waited_for_from_now_on_is_told),
		cmocka_unit_test(a_late_answer_that_was_read_late_shows_no_time),
		cmocka_unit_test(the_late_answer_to_a_probe_is_none_to_the_next),
		cmocka_unit_test(the_answer_to_a_stop_out_of_step_proves_nothing),
		cmocka_unit_test(a_drive_that_reports_is_looked_for),
		cmocka_unit_test(a_frame_without_a_sender_is_of_the_only_drive),
		cmocka_unit_test(a_frame_without_a_sender_is_of_the_drive_that_was_asked),
		cmocka_unit_test(a_frame_from_address_0_is_nobodys),
		cmocka_unit_test(a_damaged_frame_is_blamed_on_whom_it_names),
		cmocka_unit_test(a_drive_may_answer_from_the_address_that_it_is_given),
		cmocka_unit_test(an_address_without_a_drive_that_answers_is_kept),
		cmocka_unit_test(address_1_without_a_drive_is_kept_too),
		cmocka_unit_test(a_second_answer_is_another_drives),
		cmocka_unit_test(refreshing_begins_after_the_first_parameters),
		cmocka_unit_test(a_part_of_an_answer_is_news_for_a_command_only),
		cmocka_unit_test(an_answer_that_changes_nothing_is_not_shown),
		cmocka_unit_test(every_answer_to_a_command_is_shown),
		cmocka_unit_test(a_stop_whose_effect_was_read_has_ended),
		cmocka_unit_test(what_a_command_has_done_shows_before_it_ends),
		cmocka_unit_test(a_write_that_is_cancelled_is_settled_by_its_driver),
		cmocka_unit_test(raw_frames_and_their_answers_are_told),
		cmocka_unit_test(the_answer_to_a_status_is_no_raw_frame),
		cmocka_unit_test(a_lost_command_is_repeated_or_asked_about),
		cmocka_unit_test(a_lost_status_is_read_again_and_may_be_answered_late),
		cmocka_unit_test(a_motion_that_was_cancelled_ends_when_its_answer_is_lost),
		cmocka_unit_test(often_heard_and_never_understood_is_told),
		cmocka_unit_test(what_is_heard_of_one_that_is_gone_is_told_later_too),
		cmocka_unit_test(a_question_about_a_stop_is_no_probe_of_the_others_share),
	};

	return cmocka_run_group_tests_name("sched/answer_frames", tests, NULL, NULL);
}
