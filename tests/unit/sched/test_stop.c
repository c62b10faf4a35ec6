/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A stop is done when the drive stops: drives that take it and do not, slow down for long, reverse,
 * or begin to move after it, in made-up time.
 */
#include "sched/engine.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 2
#define MS DB_NS_PER_MS
#define ANSWER_TIME (2 * MS)
#define TOP_SPEED 1000.0f

enum kind { KIND_PROBE, KIND_IDENTIFY, KIND_POLL, KIND_MOVE, KIND_STOP, KIND_DISABLE, KIND_COUNT };

/* The drive's side. */
struct drive {
	float speed;
	float target_speed;
	float ramp; /* per ms */
	bool powered;
	bool dead;
	unsigned deaf; /* to so many stops: they are acknowledged and nothing happens */
	bool deaf_to_disable;
	db_time moves_at; /* a motion that was taken and does not show yet; 0: none */
	db_time delay;    /* from taking a motion to showing it */
	unsigned heard[KIND_COUNT];
};

struct world {
	struct db_bus_config bus;
	struct db_driver driver;
	struct db_drive_config drives[DRIVES];
	struct db_bus_drive list[DRIVES];
	struct db_axis *axes[DRIVES];
	struct db_queue *queue;
	struct db_engine *engine;
	struct drive sim[DRIVES];
	db_time now;
	db_time answer_time;
	uint8_t answer[8];
	db_time answer_at; /* 0: none */
	unsigned told[DB_EVENT_COUNT];
};

/* What a family's driver does, as little of it as there can be. */
struct db_device {
	unsigned address;
	float speed;
	bool powered;
	bool identified;
	db_time taken;
	struct db_nameplate plate;
};

static void fake_init(struct db_device *device, struct db_device *first,
                      const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first;
	(void)bus;
	device->address = drive->address;
}

static enum kind kind_of(const struct db_job *job)
{
	switch (job->kind) {
	case DB_JOB_PROBE:
		return KIND_PROBE;
	case DB_JOB_IDENTIFY:
		return KIND_IDENTIFY;
	case DB_JOB_POLL:
		return KIND_POLL;
	default:
		return job->request->command == DB_CMD_DISABLE   ? KIND_DISABLE :
		       db_command_is_stop(job->request->command) ? KIND_STOP :
		                                                   KIND_MOVE;
	}
}

static enum db_step fake_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;

	exchange->request[0] = (uint8_t)device->address;
	exchange->request[1] = (uint8_t)kind_of(job);
	exchange->request_length = exchange->answer_length = 8;
	exchange->repeatable = true;
	return DB_STEP_SEND;
}

static enum db_step fake_answer(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	db_time now = talk->now;
	enum db_result *result = &talk->result;

	(void)length;
	if (frame[1] != kind_of(job))
		return DB_STEP_IGNORE;
	memcpy(&device->speed, frame + 4, sizeof device->speed);
	device->powered = frame[2];
	device->taken = now;
	device->identified |= job->kind == DB_JOB_IDENTIFY;
	*result = kind_of(job) == KIND_DISABLE && device->powered ? DB_RESULT_FAILED : DB_RESULT_OK;
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
	*length = available < 8 ? 0 : 8;
}

static void fake_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	bool moves = fabsf(device->speed) > 0.0f;

	feedback->taken = device->taken;
	feedback->velocity = device->speed;
	feedback->state = device->taken == 0 ? DB_AXIS_OFFLINE :
	                  moves              ? DB_AXIS_CONTINUOUS_MOTION :
	                                       DB_AXIS_STANDSTILL;
	feedback->error = DB_ERROR_NONE;
	feedback->status = (device->identified ? DB_STATUS_PARAMS_VALID : 0) |
	                   (device->powered ? DB_STATUS_ENABLED : 0) |
	                   (moves ? DB_STATUS_MOVING : 0);
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
	.medium = DB_MEDIUM_SERIAL,
	.acknowledges = true,
	.device_size = sizeof(struct db_device),
	.init = fake_init,
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
	return ANSWER_TIME;
}

static const struct db_transport wire = { .medium = DB_MEDIUM_SERIAL, .wire_time = fake_wire_time };

/* --- the world ------------------------------------------------------------------------------------- */

static void obey(struct world *world, struct drive *drive, enum kind kind)
{
	drive->heard[kind]++;
	if (kind == KIND_MOVE) {
		drive->powered = true;
		drive->moves_at = world->now + drive->delay;
	} else if (kind == KIND_STOP && drive->deaf > 0) {
		drive->deaf--;
	} else if (kind == KIND_STOP) {
		drive->target_speed = 0;
		drive->moves_at = 0;
	} else if (kind == KIND_DISABLE && !drive->deaf_to_disable) {
		drive->powered = false;
		drive->target_speed = drive->speed = 0;
	}
}

static void on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	struct drive *drive = &world->sim[bytes[0] - 1];

	assert_int_equal(length, 8);
	if (drive->dead)
		return;
	obey(world, drive, (enum kind)bytes[1]);
	memcpy(world->answer, bytes, 2);
	world->answer[2] = drive->powered;
	memcpy(world->answer + 4, &drive->speed, sizeof drive->speed);
	world->answer_at = world->now + world->answer_time;
}

static void on_tell(void *context, const struct db_drive_config *drive, enum db_event event,
                    const struct db_feedback *feedback)
{
	struct world *world = context;

	(void)drive;
	(void)feedback;
	world->told[event]++;
}

static const struct db_engine_ops ops = { .send = on_send, .tell = on_tell };

static void run_motor(struct drive *drive, db_time now)
{
	float ramp = drive->ramp > 0 ? drive->ramp : TOP_SPEED;
	float way;

	if (drive->moves_at != 0 && now >= drive->moves_at) {
		drive->target_speed = TOP_SPEED;
		drive->moves_at = 0;
	}
	way = drive->target_speed - drive->speed;
	drive->speed += fabsf(way) < ramp ? way : copysignf(ramp, way);
}

static void pass(struct world *world, db_time span)
{
	for (db_time end = world->now + span; world->now < end;) {
		world->now += MS / 2;
		if (world->now % MS == 0) {
			for (size_t i = 0; i < DRIVES; i++)
				run_motor(&world->sim[i], world->now);
		}
		if (world->answer_at != 0 && world->answer_at <= world->now) {
			world->answer_at = 0;
			db_engine_receive(world->engine, world->answer, 8, world->now);
		}
		(void)db_engine_run(world->engine, world->now);
	}
}

static struct world *make(bool acknowledges)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->driver = family;
	world->driver.acknowledges = acknowledges;
	world->bus = (struct db_bus_config){
		.driver = &world->driver,
		.transport = &wire,
		.cycle_ms = 20,
		.drive_latency_ms = 100,
		.retries = 2,
		.queue = 8,
	};
	world->now = 1000 * MS;
	world->answer_time = ANSWER_TIME;
	for (size_t i = 0; i < DRIVES; i++) {
		world->drives[i] = (struct db_drive_config){
			.address = (unsigned)i + 1,
			.stop_reaction_ms = 500,
			.on_exit = DB_ON_LOSS_STOP,
		};
		world->axes[i] = db_axis_new();
		world->list[i] = (struct db_bus_drive){ (uint16_t)i, &world->drives[i],
			                                world->axes[i] };
	}
	assert_int_equal(db_queue_new(8, DRIVES, &world->queue), 0);
	assert_int_equal(db_engine_new(&world->bus, world->list, DRIVES, world->queue, &ops, world,
	                               &world->engine),
	                 0);
	db_engine_port(world->engine, true, 0, world->now);
	pass(world, 300 * MS);
	return world;
}

static void drop(struct world *world)
{
	db_engine_free(world->engine);
	db_queue_free(world->queue);
	for (size_t i = 0; i < DRIVES; i++)
		db_axis_free(world->axes[i]);
	free(world);
}

static void post(struct world *world, uint16_t axis, enum db_command command)
{
	struct db_request request = { .ticket = command, .drive = axis, .command = command };

	assert_true(db_queue_post(world->queue, &request));
}

/* NONE: nothing ended. */
static enum db_result result_of(struct world *world)
{
	struct db_completion completion;

	return db_queue_collect(world->queue, &completion) ? completion.result : DB_RESULT_NONE;
}

static struct db_feedback feedback_of(const struct world *world, size_t axis)
{
	struct db_snapshot snapshot;

	db_axis_read(world->axes[axis], &snapshot);
	return snapshot.feedback;
}

static struct world *moving(bool acknowledges)
{
	struct world *world = make(acknowledges);

	post(world, 0, DB_CMD_MOVE_VELOCITY);
	pass(world, 200 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_true(feedback_of(world, 0).velocity == TOP_SPEED);
	return world;
}

/* --- what is told ----------------------------------------------------------------------------------- */

static void a_drive_that_stands_is_stopped_at_once(void **state)
{
	struct world *world = make(true);

	(void)state;
	post(world, 0, DB_CMD_STOP);
	pass(world, 10 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	pass(world, 200 * MS);
	assert_int_equal(world->sim[0].heard[KIND_STOP], 1);
	drop(world);
}

static void a_stop_that_is_lost_is_said_again_and_not_confirmed(void **state)
{
	for (int acknowledges = 0; acknowledges < 2; acknowledges++) {
		struct world *world = moving(acknowledges);

		(void)state;
		world->sim[0].deaf = 5;
		post(world, 0, DB_CMD_STOP);
		pass(world, 30 * MS);
		assert_int_equal(result_of(world), DB_RESULT_NONE);
		assert_true(world->sim[0].heard[KIND_STOP] >= 2);
		pass(world, 300 * MS);
		assert_int_equal(result_of(world), DB_RESULT_OK);
		assert_int_equal(world->sim[0].heard[KIND_STOP], 6);
		assert_true(world->sim[0].speed == 0.0f);
		assert_int_equal(world->told[DB_EVENT_DRIVE_RUNS_ON], 0);
		drop(world);
	}
}

static void a_drive_that_runs_on_is_told_of_and_told_on(void **state)
{
	struct world *world = moving(true);
	unsigned heard;

	(void)state;
	world->sim[0].deaf = 1000;
	post(world, 0, DB_CMD_QUICK_STOP);
	pass(world, 450 * MS);
	assert_int_equal(result_of(world), DB_RESULT_NONE);
	pass(world, 200 * MS);
	assert_int_equal(result_of(world), DB_RESULT_RUNS_ON);
	assert_int_equal(world->told[DB_EVENT_DRIVE_RUNS_ON], 1);
	assert_int_equal(feedback_of(world, 0).error, DB_ERROR_RUNS_ON);
	assert_true(feedback_of(world, 0).status & DB_STATUS_ERROR);
	heard = world->sim[0].heard[KIND_STOP];
	pass(world, 5000 * MS);
	assert_in_range(world->sim[0].heard[KIND_STOP] - heard, 9, 11);
	assert_int_equal(world->sim[0].heard[KIND_DISABLE], 0);
	assert_int_equal(world->told[DB_EVENT_DRIVE_RUNS_ON], 1);
	/* Who asks again is told the same, and not left waiting. */
	post(world, 0, DB_CMD_STOP);
	pass(world, 200 * MS);
	assert_int_equal(result_of(world), DB_RESULT_RUNS_ON);
	/* The other drive's cycle goes on as ever. */
	assert_true(feedback_of(world, 1).taken > world->now - 30 * MS);
	world->sim[0].deaf = 0;
	pass(world, 700 * MS);
	assert_int_equal(feedback_of(world, 0).error, DB_ERROR_NONE);
	heard = world->sim[0].heard[KIND_STOP];
	pass(world, 2000 * MS);
	assert_int_equal(world->sim[0].heard[KIND_STOP], heard);
	drop(world);
}

static void the_last_resort_is_taken_where_it_is_configured(void **state)
{
	struct world *world = make(true);

	(void)state;
	world->drives[0].on_stop_failure = DB_ON_STOP_FAILURE_DISABLE;
	post(world, 0, DB_CMD_MOVE_VELOCITY);
	pass(world, 100 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	world->sim[0].deaf = 1000;
	world->sim[0].deaf_to_disable = true;
	post(world, 0, DB_CMD_STOP);
	pass(world, 2000 * MS);
	assert_int_equal(result_of(world), DB_RESULT_RUNS_ON);
	assert_true(world->sim[0].heard[KIND_DISABLE] >= 2);
	world->sim[0].deaf_to_disable = false;
	pass(world, 1000 * MS);
	assert_true(world->sim[0].speed == 0.0f);
	assert_int_equal(feedback_of(world, 0).error, DB_ERROR_NONE);
	drop(world);
}

static void a_disable_does_not_wait_for_a_stop_without_effect(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].deaf = 1000;
	post(world, 0, DB_CMD_STOP);
	pass(world, 30 * MS);
	post(world, 0, DB_CMD_DISABLE);
	pass(world, 15 * MS);
	assert_int_equal(world->sim[0].heard[KIND_DISABLE], 1);
	pass(world, 100 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	drop(world);
}

static void a_long_deceleration_is_no_failure(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].ramp = TOP_SPEED / 10000; /* ten seconds */
	post(world, 0, DB_CMD_STOP);
	pass(world, 700 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	pass(world, 11000 * MS);
	assert_int_equal(world->told[DB_EVENT_DRIVE_RUNS_ON], 0);
	assert_true(world->sim[0].speed == 0.0f);
	drop(world);
}

/* Saying it again does not take the time in which the stand could be read. */
static void a_slow_drive_is_read_between_two_stops(void **state)
{
	struct world *world = moving(true);
	unsigned polls;

	(void)state;
	world->answer_time = 60 * MS;
	pass(world, 500 * MS);
	polls = world->sim[0].heard[KIND_POLL];
	world->sim[0].deaf = 1;
	post(world, 0, DB_CMD_STOP);
	pass(world, 1000 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_int_equal(world->sim[0].heard[KIND_STOP], 2);
	assert_true(world->sim[0].heard[KIND_POLL] - polls > 3);
	drop(world);
}

/* The stop came to nothing, while the motion before it was on its way through zero. */
static void a_reversal_is_no_stop(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].ramp = TOP_SPEED / 100;
	world->sim[0].target_speed = -TOP_SPEED;
	world->sim[0].deaf = 10;
	post(world, 0, DB_CMD_STOP);
	pass(world, 4000 * MS);
	assert_true(world->sim[0].speed == 0.0f);
	assert_int_equal(world->sim[0].heard[KIND_STOP], 11);
	drop(world);
}

/* Drives that do not answer: the motion that was just told does not show yet, and the stop is lost. */
static void a_motion_that_does_not_show_yet_is_waited_for(void **state)
{
	struct world *world = make(false);

	(void)state;
	world->sim[0].delay = 60 * MS;
	world->sim[0].deaf = 1;
	post(world, 0, DB_CMD_MOVE_VELOCITY);
	pass(world, 10 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	post(world, 0, DB_CMD_STOP);
	pass(world, 10 * MS);
	assert_int_equal(result_of(world), DB_RESULT_NONE);
	pass(world, 500 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_true(world->sim[0].speed == 0.0f);
	drop(world);
}

static void another_motion_takes_its_place(void **state)
{
	struct world *world = moving(true);
	unsigned heard;

	(void)state;
	world->sim[0].deaf = 1000;
	post(world, 0, DB_CMD_STOP);
	pass(world, 700 * MS);
	assert_int_equal(result_of(world), DB_RESULT_RUNS_ON);
	post(world, 0, DB_CMD_MOVE_VELOCITY);
	pass(world, 20 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	heard = world->sim[0].heard[KIND_STOP];
	pass(world, 2000 * MS);
	assert_int_equal(world->sim[0].heard[KIND_STOP], heard);
	assert_int_equal(feedback_of(world, 0).error, DB_ERROR_NONE);
	drop(world);
}

static void a_drive_that_returns_moving_is_stopped(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].deaf = 3;
	post(world, 0, DB_CMD_STOP);
	pass(world, 10 * MS);
	world->sim[0].dead = true;
	pass(world, 3000 * MS);
	assert_false(feedback_of(world, 0).status & DB_STATUS_ONLINE);
	assert_int_equal(result_of(world), DB_RESULT_NONE);
	world->sim[0].dead = false;
	pass(world, 3000 * MS);
	assert_int_equal(result_of(world), DB_RESULT_OK);
	assert_true(world->sim[0].speed == 0.0f);
	drop(world);
}

static void the_end_waits_until_it_stops(void **state)
{
	struct world *world = moving(true);

	(void)state;
	world->sim[0].deaf = 3;
	db_engine_shut_down(world->engine, world->now);
	pass(world, 20 * MS);
	assert_false(db_engine_is_quiet(world->engine));
	pass(world, 300 * MS);
	assert_true(db_engine_is_quiet(world->engine));
	assert_true(world->sim[0].speed == 0.0f);
	drop(world);
}

/* --- counters -------------------------------------------------------------------------------------- */

static void figures_survive_a_clock_that_was_asleep(void **state)
{
	struct world *world = make(true);
	struct db_bus_stats stats;

	(void)state;
	/* Longer than 32 bits of microseconds. */
	world->now += 100 * 60 * DB_NS_PER_S;
	pass(world, 100 * MS);
	db_engine_stats(world->engine, &stats);
	assert_int_equal(stats.jitter_max_us, UINT32_MAX);
	assert_in_range(stats.overruns, 299990, 300010);
	drop(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_that_stands_is_stopped_at_once),
		cmocka_unit_test(a_stop_that_is_lost_is_said_again_and_not_confirmed),
		cmocka_unit_test(a_drive_that_runs_on_is_told_of_and_told_on),
		cmocka_unit_test(the_last_resort_is_taken_where_it_is_configured),
		cmocka_unit_test(a_disable_does_not_wait_for_a_stop_without_effect),
		cmocka_unit_test(a_long_deceleration_is_no_failure),
		cmocka_unit_test(a_slow_drive_is_read_between_two_stops),
		cmocka_unit_test(a_reversal_is_no_stop),
		cmocka_unit_test(a_motion_that_does_not_show_yet_is_waited_for),
		cmocka_unit_test(another_motion_takes_its_place),
		cmocka_unit_test(a_drive_that_returns_moving_is_stopped),
		cmocka_unit_test(the_end_waits_until_it_stops),
		cmocka_unit_test(figures_survive_a_clock_that_was_asleep),
	};

	return cmocka_run_group_tests_name("stop", tests, NULL, NULL);
}
