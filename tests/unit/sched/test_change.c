/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that leave a bus and drives that come to it while it runs: in made-up time, on a made-up
 * serial line with a made-up family of controllers. What is looked at is the wire: who is asked what,
 * and when to the microsecond.
 */
#include "drivebridge/driver.h"
#include "sched/change.h"
#include "sched/engine.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define US DB_NS_PER_US
#define FRAME 4
#define ANSWER_TIME (500 * US)
#define WIRE_TIME (400 * US)
#define DRIVES 6
#define POLL_PARTS 2 /* exchanges of a poll */

enum kind { KIND_PROBE = 1, KIND_POLL, KIND_IDENTIFY, KIND_MOVE, KIND_STOP };

/* --- the family: frames are { address, kind, axis, 0 } --------------------------------------------- */

struct db_device {
	struct db_device *first;
	struct db_device *axes[DB_AXES_MAX]; /* of the first */
	uint8_t address;
	uint8_t axis;
	unsigned polls; /* that ended, of this axis */
	unsigned parts; /* of a poll */
	bool moving;
	bool identified;
	db_time taken;
	struct db_nameplate plate;
};

static void fake_init(struct db_device *device, struct db_device *first,
                      const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	device->parts = (unsigned)bus->options[0];
	device->first = first ? first : device;
	device->address = (uint8_t)drive->address;
	device->axis = (uint8_t)drive->axis;
	device->first->axes[device->axis] = device;
}

static void fake_leave(struct db_device *device)
{
	device->first->axes[device->axis] = NULL;
}

static enum db_step ask(const struct db_device *device, enum kind kind,
                        struct db_exchange *exchange)
{
	exchange->request[0] = device->address;
	exchange->request[1] = (uint8_t)kind;
	exchange->request[2] = device->axis;
	exchange->request[3] = 0;
	exchange->request_length = FRAME;
	exchange->answer_length = FRAME;
	exchange->extra_time = 0;
	exchange->repeatable = true;
	return DB_STEP_SEND;
}

static enum kind kind_of(const struct db_job *job)
{
	switch (job->kind) {
	case DB_JOB_PROBE:
		return KIND_PROBE;
	case DB_JOB_POLL:
		return KIND_POLL;
	case DB_JOB_IDENTIFY:
		return KIND_IDENTIFY;
	default:
		return db_command_is_stop(job->request->command) ? KIND_STOP : KIND_MOVE;
	}
}

static enum db_step fake_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;

	job->step = 0;
	return ask(device, kind_of(job), exchange);
}

static void end_poll(struct db_device *first, db_time now)
{
	for (unsigned i = 0; i < DB_AXES_MAX; i++) {
		if (!first->axes[i])
			continue;
		first->axes[i]->polls++;
		first->axes[i]->taken = now;
	}
}

static enum db_step fake_answer(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	db_time now = talk->now;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	(void)length;
	if (frame[1] != kind_of(job))
		return DB_STEP_IGNORE;
	*result = DB_RESULT_OK;
	switch (kind_of(job)) {
	case KIND_POLL:
		if (++job->step < device->parts)
			return ask(device, KIND_POLL, exchange);
		end_poll(device, now);
		break;
	case KIND_IDENTIFY:
		device->identified = true;
		break;
	case KIND_MOVE:
		device->moving = true;
		break;
	case KIND_STOP:
		device->moving = false;
		break;
	default:
		break;
	}
	return DB_STEP_DONE;
}

static enum db_step fake_lost(struct db_conversation *talk)
{
	enum db_result *result = &talk->result;

	*result = DB_RESULT_TIMEOUT;
	return DB_STEP_DONE;
}

static enum db_frame fake_accept(const struct db_bus_config *bus, const uint8_t *frame,
                                 size_t length, int *address)
{
	(void)bus;
	(void)length;
	*address = frame[0];
	return DB_FRAME_GOOD;
}

static void fake_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length)
{
	(void)bytes;
	*skip = 0;
	*length = available < FRAME ? 0 : FRAME;
}

static void fake_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	feedback->taken = device->taken;
	feedback->state = device->taken == 0 ? DB_AXIS_OFFLINE :
	                  device->moving     ? DB_AXIS_CONTINUOUS_MOTION :
	                                       DB_AXIS_STANDSTILL;
	feedback->position = (int32_t)device->polls;
	feedback->status = device->identified ? DB_STATUS_PARAMS_VALID : 0;
}

static void fake_gone(struct db_device *device)
{
	device->identified = false;
}

static const struct db_nameplate *fake_nameplate(const struct db_device *device)
{
	return &device->plate;
}

static const struct db_driver family = {
	.name = "fake",
	.acknowledges = true,
	.medium = DB_MEDIUM_SERIAL,
	.axes = DB_AXES_MAX,
	.device_size = sizeof(struct db_device),
	.init = fake_init,
	.leave = fake_leave,
	.cut = fake_cut,
	.accept = fake_accept,
	.begin = fake_begin,
	.answer = fake_answer,
	.lost = fake_lost,
	.gone = fake_gone,
	.feedback = fake_feedback,
	.nameplate = fake_nameplate,
};

static db_time fake_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                              size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	(void)request_length;
	(void)answer_length;
	return WIRE_TIME;
}

static const struct db_transport wire = { .medium = DB_MEDIUM_SERIAL, .wire_time = fake_wire_time };

/* --- the world ------------------------------------------------------------------------------------- */

struct sent {
	db_time at;
	uint8_t frame[FRAME];
};

struct world {
	struct db_bus_config bus;
	struct db_drive_config drives[DRIVES];
	struct db_bus_drive list[DRIVES];
	struct db_queue *queue;
	struct db_engine *engine;
	bool dead[DRIVES + 1]; /* by address */
	db_time now;
	uint8_t answer[FRAME];
	db_time answer_at; /* 0: none is on its way */
	struct sent sent[8192];
	size_t sent_count;
};

static void on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	struct sent *sent = &world->sent[world->sent_count++];

	assert_int_equal(length, FRAME);
	assert_true(world->sent_count < sizeof world->sent / sizeof world->sent[0]);
	sent->at = world->now;
	memcpy(sent->frame, bytes, FRAME);
	if (world->dead[bytes[0]])
		return;
	memcpy(world->answer, bytes, FRAME);
	world->answer_at = world->now + ANSWER_TIME;
}

static const struct db_engine_ops ops = { .send = on_send };

static void pass(struct world *world, db_time span)
{
	db_time end = world->now + span;

	while (world->now < end) {
		db_time next = db_engine_run(world->engine, world->now);

		if (next > end)
			next = end;
		if (world->answer_at != 0 && world->answer_at <= next) {
			world->now = world->answer_at;
			world->answer_at = 0;
			db_engine_receive(world->engine, world->answer, FRAME, world->now);
		} else {
			world->now = next;
		}
	}
}

/* Drive i has the number 10 + i. With two drives at each address from `paired` on. */
static struct world *make_with(size_t drives, size_t paired, unsigned parts)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->bus = (struct db_bus_config){
		.name = (char *)"test",
		.driver = &family,
		.transport = &wire,
		.cycle_ms = 20,
		.drive_latency_ms = 5,
		.retries = 2,
		.queue = 8,
		.options = { parts },
	};
	world->now = 1000 * MS;
	for (size_t i = 0; i < DRIVES; i++) {
		size_t beyond = i > paired ? i - paired : 0;

		world->drives[i] = (struct db_drive_config){
			.name = (char *)"d",
			.address = (unsigned)(i - (beyond + 1) / 2) + 1,
			.axis = beyond % 2,
			.on_exit = DB_ON_LOSS_STOP,
			.stop_reaction_ms = 1000,
		};
		world->list[i] = (struct db_bus_drive){ (uint16_t)(10 + i), &world->drives[i],
			                                db_axis_new() };
	}
	assert_int_equal(db_queue_new(8, DRIVES, &world->queue), 0);
	assert_int_equal(db_engine_new(&world->bus, world->list, drives, world->queue, &ops, world,
	                               &world->engine),
	                 0);
	db_engine_port(world->engine, true, 0, world->now);
	pass(world, 505 * MS); /* to between two cycles */
	world->sent_count = 0;
	return world;
}

static struct world *make(size_t drives, size_t paired)
{
	return make_with(drives, paired, POLL_PARTS);
}

static void drop(struct world *world)
{
	db_engine_free(world->engine);
	db_queue_free(world->queue);
	for (size_t i = 0; i < DRIVES; i++)
		db_axis_free(world->list[i].axis);
	free(world);
}

/* Hands a change to the engine: the drive that leaves and the one that comes, or -1. */
static void change(struct world *world, size_t present, int leaves, int comes)
{
	uint16_t leaving = (uint16_t)(10 + leaves);
	struct db_change *made = change_new(&world->bus, present, &leaving, leaves >= 0,
	                                    comes >= 0 ? &world->list[comes] : NULL, comes >= 0);

	assert_non_null(made);
	change_begin(world->engine, made, world->now);
}

static bool fetch(struct world *world)
{
	struct db_change *changed = change_fetch(world->engine);

	change_free(changed);
	return changed != NULL;
}

static void post(struct world *world, size_t drive, enum db_command command)
{
	struct db_request request = {
		.ticket = 1000 + (uint32_t)(100 * drive) + (uint32_t)command,
		.drive = (uint16_t)(10 + drive),
		.command = command,
	};

	assert_true(db_queue_post(world->queue, &request));
}

static enum db_result result_of(struct world *world, size_t drive, enum db_command command)
{
	struct db_completion completion;

	assert_true(db_queue_collect(world->queue, &completion));
	assert_int_equal(completion.ticket, 1000 + 100 * drive + (size_t)command);
	return completion.result;
}

static bool nothing_finished(struct world *world)
{
	struct db_completion completion;

	return !db_queue_collect(world->queue, &completion);
}

static size_t count(const struct world *world, unsigned address, enum kind kind)
{
	size_t found = 0;

	for (size_t i = 0; i < world->sent_count; i++)
		found += world->sent[i].frame[0] == address && world->sent[i].frame[1] == kind;
	return found;
}

static struct db_snapshot snapshot_of(const struct world *world, size_t drive)
{
	struct db_snapshot snapshot;

	db_axis_read(world->list[drive].axis, &snapshot);
	return snapshot;
}

static bool is_online(const struct world *world, size_t drive)
{
	return snapshot_of(world, drive).feedback.status & DB_STATUS_ONLINE;
}

static struct db_bus_stats stats_of(const struct world *world)
{
	struct db_bus_stats stats;

	db_engine_stats(world->engine, &stats);
	return stats;
}

/* What was sent to the first `drives` addresses is the same in both, at the same times. */
static void expect_same_schedule(const struct world *a, const struct world *b, unsigned drives)
{
	size_t i = 0;
	size_t j = 0;

	for (;;) {
		while (i < a->sent_count && a->sent[i].frame[0] > drives)
			i++;
		while (j < b->sent_count && b->sent[j].frame[0] > drives)
			j++;
		if (i == a->sent_count || j == b->sent_count)
			break;
		assert_true(a->sent[i].at == b->sent[j].at);
		assert_memory_equal(a->sent[i].frame, b->sent[j].frame, FRAME);
		i++;
		j++;
	}
	assert_true(i == a->sent_count && j == b->sent_count);
}

/* --- who leaves ------------------------------------------------------------------------------------ */

static void the_others_stay_on_schedule_when_one_leaves(void **state)
{
	struct world *world = make_with(3, DRIVES, 1);
	struct world *twin = make_with(3, DRIVES, 1);

	(void)state;
	change(world, 3, 2, -1);
	pass(world, 1000 * MS);
	pass(twin, 1000 * MS);
	assert_true(fetch(world));
	expect_same_schedule(world, twin, 2);
	assert_int_equal(count(world, 1, KIND_POLL), 50);
	assert_int_equal(count(world, 3, KIND_STOP), 1);
	assert_int_equal(count(world, 3, KIND_POLL), 0);
	assert_int_equal(stats_of(world).overruns, 0);
	assert_int_equal(stats_of(world).cycles, stats_of(twin).cycles);
	assert_int_equal(stats_of(world).online, 2);
	drop(world);
	drop(twin);
}

static void whoever_leaves_the_others_are_polled_in_every_cycle(void **state)
{
	(void)state;
	for (int leaves = 0; leaves < 4; leaves++) {
		struct world *world = make(4, DRIVES);

		change(world, 4, leaves, -1);
		pass(world, 1000 * MS);
		assert_true(fetch(world));
		for (unsigned i = 0; i < 4; i++)
			assert_int_equal(count(world, i + 1, KIND_POLL),
			                 (int)i == leaves ? 0 : 50 * POLL_PARTS);
		assert_int_equal(stats_of(world).overruns, 0);
		assert_int_equal(stats_of(world).online, 3);
		drop(world);
	}
}

/* At every moment of a cycle: one leaves, and at once another one comes to its address. */
static void whenever_it_happens_no_cycle_is_missed(void **state)
{
	(void)state;
	for (db_time after = 0; after < 20 * MS; after += 130 * US) {
		struct world *world = make(4, after % (260 * US) == 0 ? DRIVES : 2);
		uint32_t cycles = stats_of(world).cycles;
		size_t others = 0;

		world->drives[5].address = world->drives[3].address;
		world->drives[5].axis = world->drives[3].axis;
		pass(world, after);
		change(world, 4, 3, 5);
		pass(world, 400 * MS - after);
		assert_true(fetch(world));
		assert_true(is_online(world, 5));
		for (unsigned i = 0; i < 3; i++) {
			others += count(world, i + 1, KIND_POLL);
			assert_int_equal(snapshot_of(world, i).stats.came_online, 1);
		}
		assert_in_range(others, 3 * 20 * POLL_PARTS, (3 * 20 + 1) * POLL_PARTS);
		assert_int_equal(stats_of(world).overruns, 0);
		assert_int_equal(stats_of(world).cycles, cycles + 20);
		drop(world);
	}
}

static void what_waits_for_it_ends_once(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	for (unsigned i = 0; i < 3; i++)
		post(world, 1, DB_CMD_MOVE_VELOCITY);
	post(world, 0, DB_CMD_ENABLE);
	pass(world, ANSWER_TIME / 2); /* the first one is on the wire */
	change(world, 2, 1, -1);
	post(world, 1, DB_CMD_ENABLE); /* too late */
	pass(world, 100 * MS);
	assert_true(fetch(world));
	assert_int_equal(count(world, 2, KIND_MOVE), 1);
	assert_int_equal(count(world, 2, KIND_STOP), 1);
	assert_int_equal(count(world, 1, KIND_MOVE), 1);
	/* In the order of their slots. */
	assert_int_equal(result_of(world, 1, DB_CMD_MOVE_VELOCITY), DB_RESULT_OK);
	assert_int_equal(result_of(world, 1, DB_CMD_MOVE_VELOCITY), DB_RESULT_CANCELLED);
	assert_int_equal(result_of(world, 1, DB_CMD_MOVE_VELOCITY), DB_RESULT_CANCELLED);
	assert_int_equal(result_of(world, 0, DB_CMD_ENABLE), DB_RESULT_OK);
	assert_int_equal(result_of(world, 1, DB_CMD_ENABLE), DB_RESULT_CANCELLED);
	assert_true(nothing_finished(world));
	/* Nobody of this number is there any more. */
	post(world, 1, DB_CMD_STOP);
	pass(world, 10 * MS);
	assert_int_equal(result_of(world, 1, DB_CMD_STOP), DB_RESULT_FAILED);
	drop(world);
}

static void a_stop_that_is_under_way_is_confirmed(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	post(world, 1, DB_CMD_QUICK_STOP);
	change(world, 2, 1, -1);
	post(world, 1, DB_CMD_STOP);
	pass(world, 100 * MS);
	assert_true(fetch(world));
	assert_int_equal(result_of(world, 1, DB_CMD_QUICK_STOP), DB_RESULT_OK);
	assert_int_equal(result_of(world, 1, DB_CMD_STOP), DB_RESULT_OK);
	drop(world);
}

static void on_exit_none_leaves_it_running(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	world->drives[1].on_exit = DB_ON_LOSS_NONE;
	change(world, 2, 1, -1);
	pass(world, 1 * MS);
	assert_true(fetch(world));
	assert_int_equal(count(world, 2, KIND_STOP), 0);
	drop(world);
}

static void one_that_does_not_answer_is_waited_for_a_bounded_time(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	world->dead[2] = true;
	post(world, 1, DB_CMD_STOP);
	change(world, 2, 1, -1);
	pass(world, 1400 * MS);
	assert_false(fetch(world));
	assert_true(count(world, 2, KIND_STOP) > 3);
	pass(world, 110 * MS);
	assert_true(fetch(world));
	assert_int_equal(result_of(world, 1, DB_CMD_STOP), DB_RESULT_INDETERMINATE);
	assert_true(nothing_finished(world));
	assert_int_equal(stats_of(world).online, 1);
	world->sent_count = 0;
	pass(world, 200 * MS);
	assert_int_equal(count(world, 1, KIND_POLL), 10 * POLL_PARTS);
	assert_int_equal(count(world, 2, KIND_STOP) + count(world, 2, KIND_PROBE), 0);
	drop(world);
}

static void on_a_bus_that_is_down_it_leaves_at_once(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	db_engine_port(world->engine, false, 5, world->now);
	change(world, 2, 1, 2);
	db_engine_run(world->engine, world->now);
	assert_true(fetch(world));
	db_engine_port(world->engine, true, 0, world->now);
	pass(world, 200 * MS);
	assert_true(is_online(world, 0) && is_online(world, 2));
	drop(world);
}

/* --- who comes ------------------------------------------------------------------------------------- */

static void a_drive_that_comes_is_found_and_asked(void **state)
{
	struct world *world = make(3, DRIVES);

	(void)state;
	change(world, 3, -1, 3);
	pass(world, 1000 * MS);
	assert_true(fetch(world));
	assert_true(is_online(world, 3));
	assert_true(snapshot_of(world, 3).feedback.status & DB_STATUS_PARAMS_VALID);
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(count(world, i + 1, KIND_POLL), 50 * POLL_PARTS);
	assert_in_range(count(world, 4, KIND_POLL), 49 * POLL_PARTS, 51 * POLL_PARTS);
	assert_int_equal(stats_of(world).overruns, 0);
	assert_int_equal(stats_of(world).online, 4);
	post(world, 3, DB_CMD_ENABLE);
	pass(world, 5 * MS);
	assert_int_equal(result_of(world, 3, DB_CMD_ENABLE), DB_RESULT_OK);
	drop(world);
}

static void a_drive_that_comes_and_is_silent_costs_little(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	world->dead[3] = true;
	change(world, 2, -1, 2);
	pass(world, 1000 * MS);
	assert_true(fetch(world));
	assert_false(is_online(world, 2));
	assert_int_equal(count(world, 1, KIND_POLL), 50 * POLL_PARTS);
	assert_int_equal(stats_of(world).overruns, 0);
	drop(world);
}

/* A changed drive: the old one leaves, the new one has its address and another number. */
static void an_address_is_used_again(void **state)
{
	struct world *world = make(3, DRIVES);

	(void)state;
	world->drives[3].address = 2;
	change(world, 3, 1, 3);
	pass(world, 300 * MS);
	assert_true(fetch(world));
	assert_int_equal(count(world, 2, KIND_STOP), 1);
	assert_true(count(world, 2, KIND_PROBE) >= 1);
	assert_true(is_online(world, 3));
	assert_int_equal(stats_of(world).online, 3);
	post(world, 3, DB_CMD_ENABLE);
	post(world, 1, DB_CMD_ENABLE);
	pass(world, 5 * MS);
	assert_int_equal(result_of(world, 3, DB_CMD_ENABLE), DB_RESULT_OK);
	assert_int_equal(result_of(world, 1, DB_CMD_ENABLE), DB_RESULT_FAILED);
	drop(world);
}

/* A status and a probe of the old drive were lost, and their answers may still come: the new one is
 * asked nothing before they can have come. */
static void answers_to_the_one_before_are_waited_for(void **state)
{
	struct world *world = make(2, DRIVES);
	db_time changed;

	(void)state;
	world->drives[1].on_exit = DB_ON_LOSS_NONE;
	world->drives[3].address = 2;
	world->dead[2] = true;
	while (count(world, 2, KIND_PROBE) == 0)
		pass(world, 100 * US);
	pass(world, 6 * MS);
	changed = world->now;
	change(world, 2, 1, 3);
	world->sent_count = 0;
	while (count(world, 2, KIND_PROBE) == 0)
		pass(world, 100 * US);
	assert_true(fetch(world));
	assert_in_range(world->now - changed, 10 * MS, 20 * MS);
	drop(world);
}

static void all_may_leave_and_come_back(void **state)
{
	struct world *world = make(1, DRIVES);

	(void)state;
	change(world, 1, 0, -1);
	pass(world, 50 * MS);
	assert_true(fetch(world));
	assert_int_equal(stats_of(world).online, 0);
	change(world, 0, -1, 1);
	pass(world, 200 * MS);
	assert_true(fetch(world));
	assert_true(is_online(world, 1));
	drop(world);
}

/* --- several at one address ------------------------------------------------------------------------ */

static void an_axis_leaves_and_the_others_go_on(void **state)
{
	(void)state;
	for (int leaves = 1; leaves <= 2; leaves++) {
		struct world *world = make(3, 1); /* one alone, two at address 2 */
		size_t stays = leaves == 1 ? 2 : 1;
		int32_t before = snapshot_of(world, stays).feedback.position;

		/* It stands: the stop, which is for all of them, is not needed. */
		change(world, 3, leaves, -1);
		pass(world, 1000 * MS);
		assert_true(fetch(world));
		assert_int_equal(count(world, 2, KIND_STOP), 0);
		assert_int_equal(snapshot_of(world, stays).feedback.position, before + 50);
		assert_int_equal(count(world, 2, KIND_PROBE), 0);
		assert_int_equal(stats_of(world).online, 2);
		assert_int_equal(stats_of(world).overruns, 0);
		drop(world);
	}
}

static void an_axis_that_moves_is_stopped(void **state)
{
	struct world *world = make(3, 1);

	(void)state;
	post(world, 1, DB_CMD_MOVE_VELOCITY);
	pass(world, 50 * MS);
	change(world, 3, 1, -1);
	pass(world, 50 * MS);
	assert_true(fetch(world));
	assert_int_equal(count(world, 2, KIND_STOP), 1);
	drop(world);
}

/* What it was told may not show yet. */
static void an_axis_that_was_just_told_to_move_is_stopped(void **state)
{
	struct world *world = make(3, 1);

	(void)state;
	post(world, 1, DB_CMD_MOVE_VELOCITY);
	pass(world, ANSWER_TIME / 2);
	change(world, 3, 1, -1);
	pass(world, 50 * MS);
	assert_true(fetch(world));
	assert_int_equal(count(world, 2, KIND_STOP), 1);
	drop(world);
}

/* In the middle of a poll, which is one conversation for all of them. */
static void an_axis_leaves_between_two_polls(void **state)
{
	struct world *world = make(3, 1);
	int32_t before = snapshot_of(world, 2).feedback.position;

	(void)state;
	while (count(world, 2, KIND_POLL) == 0)
		pass(world, 100 * US);
	change(world, 3, 1, -1);
	pass(world, 50 * US);
	assert_false(fetch(world));
	pass(world, 100 * MS);
	assert_true(fetch(world));
	assert_in_range(snapshot_of(world, 2).feedback.position, before + 5, before + 6);
	drop(world);
}

static void the_first_axis_comes_back(void **state)
{
	struct world *world = make(3, 1);

	(void)state;
	world->drives[3].address = 2;
	world->drives[3].axis = 0;
	change(world, 3, 1, 3);
	pass(world, 300 * MS);
	assert_true(fetch(world));
	assert_true(is_online(world, 2) && is_online(world, 3));
	assert_true(snapshot_of(world, 3).feedback.status & DB_STATUS_PARAMS_VALID);
	/* Then the other one, and then all of them. */
	change(world, 3, 2, -1);
	pass(world, 100 * MS);
	assert_true(fetch(world));
	change(world, 2, 3, -1);
	pass(world, 100 * MS);
	assert_true(fetch(world));
	assert_int_equal(stats_of(world).online, 1);
	world->sent_count = 0;
	pass(world, 100 * MS);
	assert_int_equal(count(world, 2, KIND_POLL), 0);
	assert_int_equal(count(world, 1, KIND_POLL), 5 * POLL_PARTS);
	drop(world);
}

/* --- the end of the service meanwhile ----------------------------------------------------------------- */

static void the_end_comes_while_one_leaves(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	change(world, 2, 1, 2);
	db_engine_shut_down(world->engine, world->now);
	pass(world, 50 * MS);
	assert_true(db_engine_is_quiet(world->engine));
	assert_int_equal(count(world, 1, KIND_STOP), 1);
	assert_int_equal(count(world, 2, KIND_STOP), 1);
	assert_false(fetch(world));
	drop(world);
}

static void a_change_that_comes_after_the_end_does_nothing(void **state)
{
	struct world *world = make(2, DRIVES);

	(void)state;
	db_engine_shut_down(world->engine, world->now);
	change(world, 2, 1, 2);
	pass(world, 50 * MS);
	assert_true(db_engine_is_quiet(world->engine));
	assert_int_equal(count(world, 2, KIND_STOP), 1);
	drop(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_others_stay_on_schedule_when_one_leaves),
		cmocka_unit_test(whoever_leaves_the_others_are_polled_in_every_cycle),
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
	};

	return cmocka_run_group_tests_name("change", tests, NULL, NULL);
}
