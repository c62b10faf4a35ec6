/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The schedule where several exchanges are under way at once (CAN), where drives report by
 * themselves, and where several drives share an address: in made-up time, with a made-up family
 * whose frames are { node, kind, part, parts }.
 */
#include "codec/can.h"
#include "drivebridge/driver.h"
#include "sched/engine.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 12
#define MS DB_NS_PER_MS
#define US DB_NS_PER_US
#define WIRE (200 * US) /* of every exchange */
#define FRAME sizeof(struct db_can_frame)

enum kind { KIND_PROBE = 1, KIND_POLL, KIND_IDENTIFY, KIND_COMMAND, KIND_REPORT };

/* --- the family ---------------------------------------------------------------------------------- */

struct db_device {
	struct db_device *first;
	unsigned address;
	unsigned axis;
	unsigned parts; /* of the answer under way that came */
	unsigned polls; /* answered, of this address */
	unsigned reports;
	unsigned commands;
	db_time taken;
	bool identified;
	struct db_nameplate plate;
};

static void fake_init(struct db_device *device, struct db_device *first,
                      const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)bus;
	device->first = first ? first : device;
	device->address = drive->address;
	device->axis = drive->axis;
}

static enum db_step ask(const struct db_device *device, enum kind kind,
                        struct db_exchange *exchange)
{
	struct db_can_frame frame = { .id = device->address, .length = 2 };

	frame.data[0] = (uint8_t)kind;
	frame.data[1] = (uint8_t)device->axis;
	memcpy(exchange->request, &frame, FRAME);
	exchange->request_length = FRAME;
	exchange->answer_length = 10;
	exchange->extra_time = 0;
	exchange->repeatable = false;
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
		return KIND_COMMAND;
	}
}

static enum db_step fake_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;

	device->parts = 0;
	return ask(device, kind_of(job), exchange);
}

static enum db_step fake_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	db_time now = talk->now;
	enum db_result *result = &talk->result;
	struct db_can_frame frame;

	(void)length;
	memcpy(&frame, bytes, FRAME);
	if (frame.data[0] != kind_of(job))
		return DB_STEP_IGNORE;
	if (++device->parts < frame.data[3])
		return DB_STEP_MORE;
	if (job->kind == DB_JOB_POLL) {
		device->first->polls++;
		device->first->taken = now;
	}
	device->identified |= job->kind == DB_JOB_IDENTIFY;
	device->commands += job->kind == DB_JOB_COMMAND;
	*result = DB_RESULT_OK;
	return DB_STEP_DONE;
}

static enum db_step fake_lost(struct db_conversation *talk)
{
	enum db_result *result = &talk->result;

	*result = DB_RESULT_TIMEOUT;
	return DB_STEP_DONE;
}

static enum db_frame fake_accept(const struct db_bus_config *bus, const uint8_t *bytes,
                                 size_t length, int *address)
{
	struct db_can_frame frame;

	(void)bus;
	(void)length;
	memcpy(&frame, bytes, FRAME);
	if (frame.id == 0x7FF)
		return DB_FRAME_FOREIGN;
	*address = (int)frame.id;
	return frame.id == 0 ? DB_FRAME_BAD : DB_FRAME_GOOD;
}

static bool fake_report(struct db_device *device, const uint8_t *bytes, size_t length, db_time now)
{
	struct db_can_frame frame;

	(void)length;
	memcpy(&frame, bytes, FRAME);
	if (frame.data[0] != KIND_REPORT)
		return false;
	device->reports++;
	device->taken = now;
	return true;
}

static bool fake_wants_poll(const struct db_device *device, db_time now)
{
	return now - device->taken > 15 * MS || device->reports == 0;
}

static void fake_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	feedback->taken = device->first->taken;
	feedback->state = DB_AXIS_STANDSTILL;
	feedback->position = (int32_t)device->first->polls;
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
	.medium = DB_MEDIUM_CAN,
	.device_size = sizeof(struct db_device),
	.init = fake_init,
	.cut = db_can_cut,
	.accept = fake_accept,
	.begin = fake_begin,
	.answer = fake_answer,
	.lost = fake_lost,
	.report = fake_report,
	.wants_poll = fake_wants_poll,
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
	return WIRE;
}

static const struct db_transport wire = { .medium = DB_MEDIUM_CAN, .wire_time = fake_wire_time };

/* --- the world ------------------------------------------------------------------------------------- */

struct answer {
	struct db_can_frame frame;
	db_time at;
};

struct world {
	struct db_bus_config bus;
	struct db_drive_config drives[DRIVES];
	struct db_bus_drive list[DRIVES];
	struct db_axis *axes[DRIVES];
	struct db_queue *queue;
	struct db_engine *engine;
	db_time now;
	db_time latency; /* of every drive */
	uint8_t parts;   /* of every answer */
	bool dead[DRIVES + 1];
	bool full; /* the port takes nothing */
	struct answer answers[64];
	size_t answer_count;
	unsigned flying[DRIVES + 1];
	unsigned most_at_once; /* exchanges under way */
	unsigned sent[DRIVES + 1][KIND_REPORT + 1];
	db_time last_command;
};

static unsigned all_flying(const struct world *world)
{
	unsigned count = 0;

	for (size_t i = 0; i <= DRIVES; i++)
		count += world->flying[i];
	return count;
}

static void on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	struct db_can_frame frame;

	assert_int_equal(length, FRAME);
	assert_false(world->full);
	memcpy(&frame, bytes, FRAME);
	world->sent[frame.id][frame.data[0]]++;
	if (frame.data[0] == KIND_COMMAND)
		world->last_command = world->now;
	/* Never two for one drive. */
	if (world->dead[frame.id])
		return;
	assert_int_equal(world->flying[frame.id], 0);
	world->flying[frame.id] = 1;
	if (all_flying(world) > world->most_at_once)
		world->most_at_once = all_flying(world);
	for (uint8_t part = 1; part <= world->parts; part++) {
		struct answer *answer = &world->answers[world->answer_count++];

		assert_true(world->answer_count <= 64);
		frame.data[2] = part;
		frame.data[3] = world->parts;
		answer->frame = frame;
		answer->at = world->now + world->latency + part * 50 * US;
	}
}

static const struct db_engine_ops ops = { .send = on_send };

static void receive(struct world *world, const struct db_can_frame *frame)
{
	db_engine_receive(world->engine, (const uint8_t *)frame, FRAME, world->now);
}

/* The answer that is due first; null when none is. */
static struct answer *first_answer(struct world *world)
{
	struct answer *first = NULL;

	for (size_t i = 0; i < world->answer_count; i++) {
		if (!first || world->answers[i].at < first->at)
			first = &world->answers[i];
	}
	return first;
}

static void pass(struct world *world, db_time span)
{
	db_time end = world->now + span;

	while (world->now < end) {
		db_time next = db_engine_run(world->engine, world->now);
		struct answer *answer = first_answer(world);

		if (next > end)
			next = end;
		if (answer && answer->at <= next) {
			struct db_can_frame frame = answer->frame;

			world->now = answer->at;
			*answer = world->answers[--world->answer_count];
			if (frame.data[2] == frame.data[3])
				world->flying[frame.id] = 0;
			receive(world, &frame);
		} else {
			world->now = next;
		}
	}
}

static struct world *make(size_t drives, unsigned axes)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->bus = (struct db_bus_config){
		.name = (char *)"test",
		.driver = &family,
		.transport = &wire,
		.cycle_ms = 20,
		.drive_latency_ms = 10,
		.retries = 2,
		.queue = 8,
	};
	world->parts = 1;
	world->latency = 300 * US;
	world->now = 1000 * MS;
	for (size_t i = 0; i < drives; i++) {
		world->drives[i] = (struct db_drive_config){
			.stop_reaction_ms = 1000,
			.name = (char *)"d",
			.address = (unsigned)(i / axes) + 1,
			.axis = (unsigned)(i % axes),
		};
		world->axes[i] = db_axis_new();
		world->list[i] = (struct db_bus_drive){ (uint16_t)i, &world->drives[i],
			                                world->axes[i] };
	}
	assert_int_equal(db_queue_new(8, drives, &world->queue), 0);
	assert_int_equal(db_engine_new(&world->bus, world->list, drives, world->queue, &ops, world,
	                               &world->engine),
	                 0);
	db_engine_port(world->engine, true, 0, world->now);
	pass(world, 500 * MS);
	memset(world->sent, 0, sizeof world->sent);
	world->most_at_once = 0;
	return world;
}

static void drop(struct world *world)
{
	db_engine_free(world->engine);
	db_queue_free(world->queue);
	for (size_t i = 0; i < DRIVES && world->axes[i]; i++)
		db_axis_free(world->axes[i]);
	free(world);
}

static struct db_feedback feedback_of(const struct world *world, size_t axis)
{
	struct db_snapshot snapshot;

	db_axis_read(world->axes[axis], &snapshot);
	return snapshot.feedback;
}

static void post(struct world *world, uint16_t axis, enum db_command command)
{
	struct db_request request = { .ticket = axis + 1u, .drive = axis, .command = command };

	assert_true(db_queue_post(world->queue, &request));
}

static enum db_result result_of(struct world *world)
{
	struct db_completion completion;

	assert_true(db_queue_collect(world->queue, &completion));
	return completion.result;
}

/* --- several at once ---------------------------------------------------------------------------------- */

static void several_are_under_way_but_one_for_each_drive(void **state)
{
	struct world *world = make(DRIVES, 1);
	struct db_bus_stats stats;

	(void)state;
	pass(world, 100 * MS);
	/* A millisecond of the wire ahead, at 200 us each, and those whose drives still think. */
	assert_true(world->most_at_once >= 4);
	assert_true(world->most_at_once <= 8);
	for (size_t i = 1; i <= DRIVES; i++)
		assert_in_range(world->sent[i][KIND_POLL], 5, 6);
	db_engine_stats(world->engine, &stats);
	assert_int_equal(stats.online, DRIVES);
	assert_int_equal(stats.timeouts, 0);
	/* Twelve at 200 us, and not twelve at half a millisecond. */
	assert_in_range(stats.cycle_us, 1500, 3200);
	drop(world);
}

static void an_answer_of_several_frames_is_waited_for(void **state)
{
	struct world *world = make(3, 1);
	int32_t polls;

	(void)state;
	world->parts = 3;
	polls = feedback_of(world, 0).position;
	pass(world, 100 * MS);
	assert_in_range(feedback_of(world, 0).position - polls, 4, 6);
	drop(world);
}

static void a_dead_drive_costs_the_others_nothing(void **state)
{
	struct world *world = make(DRIVES, 1);
	struct db_bus_stats stats;

	(void)state;
	world->dead[5] = true;
	pass(world, 400 * MS);
	assert_false(feedback_of(world, 4).status & DB_STATUS_ONLINE);
	memset(world->sent, 0, sizeof world->sent);
	pass(world, 1000 * MS);
	for (size_t i = 1; i <= DRIVES; i++) {
		if (i != 5)
			assert_in_range(world->sent[i][KIND_POLL], 49, 51);
	}
	db_engine_stats(world->engine, &stats);
	assert_int_equal(stats.online, DRIVES - 1);
	/* It is still looked for, and found when it is back. */
	assert_true(world->sent[5][KIND_PROBE] > 0);
	world->dead[5] = false;
	pass(world, 2500 * MS);
	assert_true(feedback_of(world, 4).status & DB_STATUS_ONLINE);
	drop(world);
}

static void a_stop_does_not_wait_for_others(void **state)
{
	struct world *world = make(DRIVES, 1);
	db_time posted;

	(void)state;
	world->latency = 5 * MS; /* many are under way */
	pass(world, 100 * MS + 500 * US);
	assert_true(all_flying(world) > 0);
	while (world->flying[7])
		pass(world, 100 * US);
	posted = world->now;
	post(world, 6, DB_CMD_STOP);
	pass(world, 1 * MS);
	assert_true(world->last_command >= posted);
	assert_true(world->last_command - posted < 10 * US);
	pass(world, 20 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	drop(world);
}

static void a_full_port_loses_and_doubles_nothing(void **state)
{
	struct world *world = make(DRIVES, 1);
	struct db_bus_stats before;
	struct db_bus_stats after;

	(void)state;
	db_engine_stats(world->engine, &before);
	post(world, 2, DB_CMD_ENABLE);
	/* on_send() fails the test when anything is sent now. */
	db_engine_hold(world->engine, true, world->now);
	world->full = true;
	pass(world, 300 * MS);
	world->full = false;
	db_engine_hold(world->engine, false, world->now);
	pass(world, 50 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_int_equal(world->sent[3][KIND_COMMAND], 1);
	db_engine_stats(world->engine, &after);
	assert_int_equal(after.timeouts, before.timeouts);
	drop(world);
}

/* The bus's thread would run without a pause otherwise, perhaps at real-time priority. */
static void a_full_port_lets_the_engine_sleep(void **state)
{
	struct world *world = make(DRIVES, 1);
	unsigned turns = 0;
	db_time end;

	(void)state;
	while (all_flying(world) == 0)
		pass(world, 50 * US);
	end = world->now + 300 * MS;
	db_engine_hold(world->engine, true, world->now);
	world->full = true;
	while (world->now < end && turns < 1000) {
		world->now = db_engine_run(world->engine, world->now);
		turns++;
	}
	/* One for each cycle, and not for ever when the answers are overdue. */
	assert_in_range(turns, 1, 100);
	drop(world);
}

/* --- reports ------------------------------------------------------------------------------------------ */

static void a_drive_that_reports_is_not_polled(void **state)
{
	struct world *world = make(2, 1);
	struct db_can_frame report = { .id = 1, .length = 4, .data = { KIND_REPORT } };
	struct db_bus_stats stats;

	(void)state;
	for (unsigned i = 0; i < 20; i++) {
		receive(world, &report);
		pass(world, 10 * MS);
	}
	assert_true(world->sent[1][KIND_POLL] <= 1);
	assert_in_range(world->sent[2][KIND_POLL], 9, 11);
	db_engine_stats(world->engine, &stats);
	assert_int_equal(stats.reports, 20);
	/* It falls silent: asked again. */
	pass(world, 100 * MS);
	assert_true(world->sent[1][KIND_POLL] >= 4);
	drop(world);
}

static void what_nobody_asked_for_is_counted(void **state)
{
	struct world *world = make(2, 1);
	struct db_can_frame unknown = { .id = 9, .length = 4, .data = { KIND_POLL, 0, 1, 1 } };
	struct db_can_frame unasked = { .id = 1, .length = 4, .data = { KIND_COMMAND, 0, 1, 1 } };
	struct db_can_frame foreign = { .id = 0x7FF };
	struct db_can_frame bad = { .id = 0 };
	struct db_bus_stats stats;

	(void)state;
	pass(world, 5 * MS);
	receive(world, &unknown);
	receive(world, &unasked);
	receive(world, &foreign);
	receive(world, &bad);
	db_engine_stats(world->engine, &stats);
	assert_int_equal(stats.stray_frames, 2);
	assert_int_equal(stats.bad_frames, 1);
	drop(world);
}

/* --- several drives at one address ----------------------------------------------------------------------- */

static void a_controller_is_polled_once_for_all_its_axes(void **state)
{
	struct world *world = make(8, 4);

	(void)state;
	pass(world, 200 * MS);
	assert_in_range(world->sent[1][KIND_POLL], 9, 11);
	assert_in_range(world->sent[2][KIND_POLL], 9, 11);
	for (size_t i = 0; i < 8; i++) {
		assert_true(feedback_of(world, i).status & DB_STATUS_ONLINE);
		assert_true(feedback_of(world, i).status & DB_STATUS_PARAMS_VALID);
		assert_true(feedback_of(world, i).taken == feedback_of(world, i / 4 * 4).taken);
		assert_true(world->now - feedback_of(world, i).taken < 25 * MS);
	}
	drop(world);
}

static void all_axes_of_a_dead_controller_are_offline(void **state)
{
	struct world *world = make(8, 4);
	struct db_bus_stats stats;

	(void)state;
	world->dead[2] = true;
	post(world, 6, DB_CMD_ENABLE);
	pass(world, 300 * MS);
	assert_int_equal(result_of(world), DB_RESULT_TIMEOUT);
	for (size_t i = 0; i < 8; i++)
		assert_int_equal(!!(feedback_of(world, i).status & DB_STATUS_ONLINE), i < 4);
	db_engine_stats(world->engine, &stats);
	assert_int_equal(stats.online, 4);
	post(world, 7, DB_CMD_ENABLE);
	pass(world, 1 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OFFLINE);
	drop(world);
}

static void a_stop_of_one_axis_leaves_the_other_alone(void **state)
{
	struct world *world = make(4, 4);

	(void)state;
	post(world, 1, DB_CMD_ENABLE);
	post(world, 2, DB_CMD_STOP);
	pass(world, 10 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_int_equal(world->sent[1][KIND_COMMAND], 2);
	drop(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(several_are_under_way_but_one_for_each_drive),
		cmocka_unit_test(an_answer_of_several_frames_is_waited_for),
		cmocka_unit_test(a_dead_drive_costs_the_others_nothing),
		cmocka_unit_test(a_stop_does_not_wait_for_others),
		cmocka_unit_test(a_full_port_loses_and_doubles_nothing),
		cmocka_unit_test(a_full_port_lets_the_engine_sleep),
		cmocka_unit_test(a_drive_that_reports_is_not_polled),
		cmocka_unit_test(what_nobody_asked_for_is_counted),
		cmocka_unit_test(a_controller_is_polled_once_for_all_its_axes),
		cmocka_unit_test(all_axes_of_a_dead_controller_are_offline),
		cmocka_unit_test(a_stop_of_one_axis_leaves_the_other_alone),
	};

	return cmocka_run_group_tests_name("sched/engine_shared", tests, NULL, NULL);
}
