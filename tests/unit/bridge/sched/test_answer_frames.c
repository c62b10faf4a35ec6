/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the engine judges a received frame: an answer, a late answer, a report, a frame of another
 * drive, or a damaged frame; and what it does when no answer arrives in time. The drives, the line
 * and the time are simulated (fakes/bus.h).
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
	struct node *node; /* of the first drive */
};

/* What the engine has reported since open_changed(): the latest timing, and numbers of calls. */
static struct {
	struct db_engine_timing timing;
	unsigned timings;
	unsigned unusable;
	unsigned raw_sent;
	unsigned raw_answers; /* with the bytes of a frame */
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

/* Opens a bus with world->driver, which the test may have changed before. Nothing is under way,
 * nothing is due for ten seconds, and from now on the drives do not answer. */
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

/* Marks the drive for a status read, and waits until the request was sent. */
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

/* Pretends that the first drive's last exchange timed out: its answer was due `latency` ago, and
 * two losses were counted. */
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

/* A late answer shows that the drive received the request, so the counted losses are cleared. A
 * longer timeout may still cover this delay: nothing is reported. */
static void a_late_answer_clears_the_counted_losses(void **state)
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

/* No timeout that may be learnt is long enough for this drive. The delay is reported, and kept
 * in whole milliseconds, rounded up. */
static void an_answer_later_than_any_timeout_is_reported(void **state)
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
			/* Only an offline drive gets this as the cause of its silence. */
			assert_int_equal(world.node->timing == DB_TROUBLE_LATE, !online);
			assert_int_equal(world.node->unusable.count, 0);
			world.node->online = true;
			close_world(&world);
		}
	}
}

static void a_longer_timeout_is_learnt_and_reported(void **state)
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

/* The bus thread was late after the answer was due, so nobody knows when the answer arrived: no
 * delay is reported. The counted losses are cleared all the same. */
static void a_late_answer_that_was_read_late_shows_no_delay(void **state)
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

/* Drives answer in the order of the requests. So the first answer is taken for that of an
 * earlier, lost probe, and only the second one ends the exchange. */
static void the_late_answer_to_a_probe_does_not_answer_the_next(void **state)
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
	/* A status does not answer a probe: it is only kept as an unusable frame. */
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

/* The drive is out of step, so its answer may belong to an earlier exchange. It frees the line,
 * but does not confirm the stop. */
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
	/* As after every answer, the drive gets time to switch from sending to receiving. */
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

/* A drive that sends a report is connected: an offline one is probed at once, unless an exchange
 * with it is under way or its next probe is soon due anyway. */
static void an_offline_drive_that_reports_is_probed_at_once(void **state)
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

/* --- the sender of a frame -------------------------------------------------------------------- */

static enum db_frame accept_as_told(const struct db_bus_config *bus, const uint8_t *bytes,
                                    size_t length, int *address)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	(void)bus;
	/* With `unused` set, the frame does not show its sender. */
	*address = frame.unused ? -1 : frame.address;
	return DB_FRAME_GOOD;
}

/* On a line with one drive no other can have sent it, even when no answer is awaited. */
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

/* No drive has the address 0, but a frame may contain it. */
static void a_frame_from_address_0_is_of_no_drive(void **state)
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

/* On CAN a damaged frame shows its sender by its id; here this is no drive of the bus. On a
 * serial line the frame is probably from the drive that was asked. */
static void a_damaged_frame_counts_for_its_probable_sender(void **state)
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

/* A drive that is being given a new address may answer from that address already, even if
 * another drive has it. */
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

/* The engine needs the address later: requests that an unknown drive there could take for its
 * own must wait for a moment. */
static void an_unknown_address_that_answers_is_remembered(void **state)
{
	struct world world;

	(void)state;
	open_world(&world, 1, DB_MEDIUM_SERIAL);
	receive(&world, 9, FAKE_POLL);
	assert_int_equal(world.engine->foreign_address, 9);
	assert_int_equal(world.engine->foreign_received_at, world.bus->now);
	/* A frame of a configured drive does not change it. */
	receive(&world, 1, FAKE_POLL);
	assert_int_equal(world.engine->foreign_address, 9);
	close_world(&world);
}

static void the_unknown_address_1_is_remembered_too(void **state)
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

/* A second answer to one request, with other content, is from another drive with the same
 * address; unless the late answer to an earlier request may still arrive. */
static void a_second_answer_is_from_another_drive(void **state)
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
		world.node->online = false; /* so that an unexplained frame is kept */
		fake_receive(world.bus, &other, sizeof other);
		assert_int_equal(fake_stats(world.bus).stray_frames, stray + 1);
		assert_int_equal(world.node->first->snapshot.stats.doubled_answers, !risky);
		/* A frame of the other drive is not kept as an unusable frame of this one. */
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

/* The pause until parameters are read again begins when the first drive has reported all of its
 * parameters. The second drive, which does so later, does not change it. */
static void refreshing_begins_after_the_first_drives_parameters(void **state)
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

/* After a part of a status the engine has nothing new to do, and stays idle. After a part of a
 * command's answer it must check again what can be sent. */
static void a_part_of_an_answer_matters_for_a_command_only(void **state)
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

/* A status takes two exchanges here. The first answer is published only if it changed something,
 * the last one always. */
static void an_answer_that_changes_nothing_is_not_published(void **state)
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

/* A command of two exchanges. The first answer already shows the drive's new speed. */
static enum db_step begin_in_two(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	const struct fake_frame frame = fake_frame_at(bytes, length);

	if (frame.kind != FAKE_COMMAND || talk->job->step++ > 0)
		return fake_family.answer(talk, bytes, length);
	talk->device->speed = frame.speed;
	(void)fake_say(talk, FAKE_COMMAND);
	return DB_STEP_SEND;
}

static void every_answer_to_a_command_is_published(void **state)
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
	/* A parameter write of the same drive waits, and must not join the command. */
	fake_request(
		world.bus, 0,
		(struct db_request){ .setting_count = 1, .settings = &(struct db_setting){ 0 } });
	(void)db_engine_run(world.engine, world.bus->now);
	assert_int_equal(world.engine->waiting_count, 1);
	fake_receive(world.bus, &frame, sizeof frame);
	assert_int_equal(world.engine->waiting_count, 1);
	assert_true(fake_feedback(world.bus, 0).velocity == 7.0f);
	/* The drive has answered, and the answer was read in time: its round trip counts. */
	assert_int_equal(world.node->losses, 0);
	assert_int_equal(world.node->first->round_trips, 6);
	/* The flags of one request do not apply to the next one, unless the driver sets them
	 * again. */
	assert_false(world.node->first->lanes[LANE_COMMAND].exchange.again);
	assert_false(world.node->first->lanes[LANE_COMMAND].exchange.begins);
	close_world(&world);
}

/* The answer to the stop also contains the drive's status. */
static enum db_step answer_with_reading(struct db_conversation *talk, const uint8_t *bytes,
                                        size_t length)
{
	talk->device->taken = talk->now;
	return fake_family.answer(talk, bytes, length);
}

/* If the answer to the stop shows that the drive stands, the stop ends without another status
 * read. */
static void a_stop_ends_when_its_own_answer_shows_the_effect(void **state)
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

/* A client may read the drive right after the response, from another thread, and must find the
 * effect of its command. */
static void the_effect_of_a_command_is_published_before_it_ends(void **state)
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

/* Only the driver knows which parts of a write the drive has acknowledged. So its lost() is
 * called once, whether the last request was answered or timed out. */
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

static void raw_frames_and_their_answers_are_reported(void **state)
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

/* A raw frame's command is still open, but the answer belongs to a status read. */
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
		/* A repeat keeps the flags of the request; another request of the driver begins
		 * without them. */
		assert_int_equal(lane->exchange.again, repeatable);
		assert_int_equal(lane->exchange.begins, repeatable);
		close_world(&world);
	}
}

/* The loss counts as a retry. The late answer may still arrive, as that of an exchange other
 * than a probe. */
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

/* A stop cancelled the motion while its request was on the wire. After the timeout the motion is
 * not repeated: it ends as cancelled. */
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

/* The drive answers, but never with a valid status. This is reported at a timeout, from the
 * fifth unusable frame since the last status on. */
static void five_unusable_frames_without_a_status_are_reported(void **state)
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

/* The drive was already reported as missing, without any received frame. An unusable frame that
 * arrives later is reported when the next probe times out. */
static void an_unusable_frame_of_a_missing_drive_is_reported_later(void **state)
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

/* A probe after a stop that was sent out of step uses the share of stops, not the share of
 * probes: it does not delay the probes of other drives. */
static void a_probe_after_a_stop_does_not_delay_other_probes(void **state)
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
		cmocka_unit_test(a_late_answer_clears_the_counted_losses),
		cmocka_unit_test(an_answer_later_than_any_timeout_is_reported),
		cmocka_unit_test(a_longer_timeout_is_learnt_and_reported),
		cmocka_unit_test(a_late_answer_that_was_read_late_shows_no_delay),
		cmocka_unit_test(the_late_answer_to_a_probe_does_not_answer_the_next),
		cmocka_unit_test(the_answer_to_a_stop_out_of_step_proves_nothing),
		cmocka_unit_test(an_offline_drive_that_reports_is_probed_at_once),
		cmocka_unit_test(a_frame_without_a_sender_is_of_the_only_drive),
		cmocka_unit_test(a_frame_without_a_sender_is_of_the_drive_that_was_asked),
		cmocka_unit_test(a_frame_from_address_0_is_of_no_drive),
		cmocka_unit_test(a_damaged_frame_counts_for_its_probable_sender),
		cmocka_unit_test(a_drive_may_answer_from_the_address_that_it_is_given),
		cmocka_unit_test(an_unknown_address_that_answers_is_remembered),
		cmocka_unit_test(the_unknown_address_1_is_remembered_too),
		cmocka_unit_test(a_second_answer_is_from_another_drive),
		cmocka_unit_test(refreshing_begins_after_the_first_drives_parameters),
		cmocka_unit_test(a_part_of_an_answer_matters_for_a_command_only),
		cmocka_unit_test(an_answer_that_changes_nothing_is_not_published),
		cmocka_unit_test(every_answer_to_a_command_is_published),
		cmocka_unit_test(a_stop_ends_when_its_own_answer_shows_the_effect),
		cmocka_unit_test(the_effect_of_a_command_is_published_before_it_ends),
		cmocka_unit_test(a_write_that_is_cancelled_is_settled_by_its_driver),
		cmocka_unit_test(raw_frames_and_their_answers_are_reported),
		cmocka_unit_test(the_answer_to_a_status_is_no_raw_frame),
		cmocka_unit_test(a_lost_command_is_repeated_or_asked_about),
		cmocka_unit_test(a_lost_status_is_read_again_and_may_be_answered_late),
		cmocka_unit_test(a_motion_that_was_cancelled_ends_when_its_answer_is_lost),
		cmocka_unit_test(five_unusable_frames_without_a_status_are_reported),
		cmocka_unit_test(an_unusable_frame_of_a_missing_drive_is_reported_later),
		cmocka_unit_test(a_probe_after_a_stop_does_not_delay_other_probes),
	};

	return cmocka_run_group_tests_name("sched/answer_frames", tests, NULL, NULL);
}
