/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One frame that begins the same motion on all drives of a bus: when it goes out, when it does not, and
 * what a stop in between does. Drives that are told something before they can begin, in made-up time.
 */
#include "sched/engine.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 3
#define MS DB_NS_PER_MS
#define ANSWER_TIME (2 * MS)
#define ALL 0xFF /* the address of every drive */

enum kind {
	KIND_OTHER = '-',
	KIND_PREPARE = 'p',
	KIND_BEGIN = 'b',
	KIND_LOOK = 'l',
	KIND_STOP = 's'
};

struct world {
	struct db_bus_config bus;
	struct db_drive_config drives[DRIVES];
	struct db_bus_drive list[DRIVES];
	struct db_axis *axes[DRIVES];
	struct db_queue *queue;
	struct db_engine *engine;
	db_time now;
	uint8_t answers[DRIVES][4];
	db_time answer_at[DRIVES]; /* 0: none */
	db_time slow[DRIVES];      /* to be prepared, beyond ANSWER_TIME */
	db_time lag[DRIVES];       /* to answer anything, beyond that */
	bool refuses[DRIVES];      /* to be prepared */
	bool silent[DRIVES];       /* when it is polled */
	char said[256];            /* "1p 2p *b 1l ..." */
	enum db_result results[DRIVES];
	db_time sent[DRIVES];
};

struct db_device {
	unsigned address;
	bool heard;
	struct db_nameplate plate;
};

static void fake_init(struct db_device *device, struct db_device *first,
                      const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first;
	(void)bus;
	device->address = drive->address;
}

static enum db_step say(const struct db_device *device, const struct db_job *job, enum kind kind,
                        struct db_exchange *exchange)
{
	exchange->request[0] = (uint8_t)device->address;
	exchange->request[1] = (uint8_t)kind;
	exchange->request[2] = kind == KIND_BEGIN ? (uint8_t)job->request->args.target_position : 0;
	exchange->request[3] = 0;
	exchange->request_length = exchange->answer_length = 4;
	exchange->repeatable = false;
	exchange->begins = kind == KIND_BEGIN;
	return DB_STEP_SEND;
}

static enum db_step fake_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	bool command = job->kind == DB_JOB_COMMAND;

	return say(device, job,
	           !command                                  ? KIND_OTHER :
	           db_command_is_stop(job->request->command) ? KIND_STOP :
	                                                       KIND_PREPARE,
	           exchange);
}

static enum db_step fake_answer(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	(void)length;
	if (frame[1] != exchange->request[1])
		return DB_STEP_IGNORE;
	device->heard = true;
	*result = frame[3] ? DB_RESULT_REFUSED : DB_RESULT_OK;
	return frame[1] == KIND_PREPARE && !frame[3] ? say(device, job, KIND_BEGIN, exchange) :
	                                               DB_STEP_DONE;
}

static enum db_step fake_lost(struct db_conversation *talk)
{
	enum db_result *result = &talk->result;

	*result = DB_RESULT_TIMEOUT;
	return DB_STEP_DONE;
}

static bool fake_begin_all(const struct db_device *device, const struct db_exchange *prepared,
                           struct db_exchange *all)
{
	(void)device;
	memcpy(all->request, prepared->request, prepared->request_length);
	all->request[0] = ALL;
	all->request_length = prepared->request_length;
	return true;
}

static enum db_step fake_begun_by_all(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;

	return say(device, job, KIND_LOOK, exchange);
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
	*length = available < 4 ? 0 : 4;
}

static void fake_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	feedback->taken = 1;
	feedback->state = device->heard ? DB_AXIS_STANDSTILL : DB_AXIS_OFFLINE;
	feedback->error = DB_ERROR_NONE;
	feedback->status = DB_STATUS_PARAMS_VALID;
}

static void fake_gone(struct db_device *device)
{
	(void)device;
}

static const struct db_nameplate *fake_nameplate(const struct db_device *device)
{
	return &device->plate;
}

static db_time fake_command_time(const struct db_bus_config *bus)
{
	(void)bus;
	return ANSWER_TIME;
}

static const struct db_driver serial_family = {
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
	.command_time = fake_command_time,
	.begin_all = fake_begin_all,
	.begun_by_all = fake_begun_by_all,
};

static db_time fake_wire_time(const struct db_bus_config *bus, const uint8_t *request,
                              size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	(void)request_length;
	(void)answer_length;
	return MS / 10;
}

static const struct db_transport wire = { .medium = DB_MEDIUM_SERIAL, .wire_time = fake_wire_time };

/* --- the world ------------------------------------------------------------------------------------- */

static void on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	size_t said = strlen(world->said);
	unsigned i = bytes[0] - 1u;

	assert_int_equal(length, 4);
	if (bytes[1] != KIND_OTHER && said + 8 < sizeof world->said)
		sprintf(world->said + said, "%s%c%c", said ? " " : "",
		        bytes[0] == ALL ? '*' : (char)('0' + bytes[0]), bytes[1]);
	if (bytes[0] == ALL)
		return;
	if (bytes[1] == KIND_OTHER && world->silent[i])
		return;
	memcpy(world->answers[i], bytes, 4);
	world->answers[i][3] = bytes[1] == KIND_PREPARE && world->refuses[i];
	world->answer_at[i] = world->now + ANSWER_TIME + world->lag[i] +
	                      (bytes[1] == KIND_PREPARE ? world->slow[i] : 0);
}

static const struct db_engine_ops ops = { .send = on_send };

static void collect(struct world *world)
{
	struct db_completion completion;

	while (db_queue_collect(world->queue, &completion)) {
		world->results[completion.drive] = completion.result;
		world->sent[completion.drive] = completion.sent;
	}
}

static void pass(struct world *world, db_time span)
{
	for (db_time end = world->now + span; world->now < end;) {
		world->now += MS / 2;
		for (unsigned i = 0; i < DRIVES; i++) {
			if (world->answer_at[i] == 0 || world->answer_at[i] > world->now)
				continue;
			world->answer_at[i] = 0;
			db_engine_receive(world->engine, world->answers[i], 4, world->now);
		}
		(void)db_engine_run(world->engine, world->now);
		collect(world);
	}
}

static struct world *make_with_cycle(const struct db_driver *driver, unsigned cycle_ms)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->bus = (struct db_bus_config){
		.driver = driver,
		.transport = &wire,
		.cycle_ms = cycle_ms,
		.drive_latency_ms = 100,
		.retries = 2,
		.queue = 8,
		.starts_by_broadcast = true,
	};
	world->now = 1000 * MS;
	for (unsigned i = 0; i < DRIVES; i++) {
		world->drives[i] = (struct db_drive_config){ .address = i + 1,
			                                     .stop_reaction_ms = 500 };
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
	world->said[0] = '\0';
	return world;
}

static struct world *make(const struct db_driver *driver)
{
	return make_with_cycle(driver, 20);
}

static void drop(struct world *world)
{
	db_engine_free(world->engine);
	db_queue_free(world->queue);
	for (size_t i = 0; i < DRIVES; i++)
		db_axis_free(world->axes[i]);
	free(world);
}

static void post(struct world *world, uint16_t axis, enum db_command command, int32_t target)
{
	struct db_request request = {
		.ticket = axis + 1u,
		.drive = axis,
		.command = command,
		.args.target_position = target,
		.submitted = world->now,
		.group = command == DB_CMD_MOVE_ABSOLUTE ? 7 : 0,
	};

	world->results[axis] = DB_RESULT_NONE;
	assert_true(db_queue_post(world->queue, &request));
}

static void post_all(struct world *world)
{
	for (uint16_t i = 0; i < DRIVES; i++)
		post(world, i, DB_CMD_MOVE_ABSOLUTE, 5);
}

static unsigned count(const struct world *world, const char *what)
{
	unsigned found = 0;

	for (const char *at = world->said; (at = strstr(at, what)) != NULL; at++)
		found++;
	return found;
}

static bool all_ended(const struct world *world, enum db_result result)
{
	for (unsigned i = 0; i < DRIVES; i++) {
		if (world->results[i] != result)
			return false;
	}
	return true;
}

/* --- tests ----------------------------------------------------------------------------------------- */

static void one_frame_when_all_are_ready(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	post_all(world);
	pass(world, 60 * MS);
	assert_string_equal(world->said, "1p 2p 3p *b 1l 2l 3l");
	assert_true(all_ended(world, DB_RESULT_OK));
	assert_true(world->sent[0] != 0);
	drop(world);
}

/* The bus may be quicker than the one who hands the requests over. */
static void letters_that_come_later_are_waited_for(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	pass(world, 8 * MS);
	assert_int_equal(count(world, "b"), 0);
	post(world, 1, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 2, DB_CMD_MOVE_ABSOLUTE, 5);
	pass(world, 60 * MS);
	assert_int_equal(count(world, "*b"), 1);
	assert_true(all_ended(world, DB_RESULT_OK));
	drop(world);
}

static void without_one_of_them_each_begins_by_itself(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 2, DB_CMD_MOVE_ABSOLUTE, 5);
	pass(world, 10 * MS);
	assert_int_equal(count(world, "b"), 0);
	pass(world, 60 * MS);
	assert_int_equal(count(world, "*b"), 0);
	assert_int_equal(count(world, "1b"), 1);
	assert_int_equal(count(world, "2b"), 0);
	assert_int_equal(count(world, "3b"), 1);
	drop(world);
}

/* It would be moved by a frame for all. */
static void one_that_refuses_is_not_reached(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	world->refuses[1] = true;
	world->slow[1] = 40 * MS;
	post_all(world);
	pass(world, 120 * MS);
	assert_int_equal(world->results[1], DB_RESULT_REFUSED);
	assert_int_equal(count(world, "*b"), 0);
	assert_int_equal(count(world, "2b"), 0);
	assert_int_equal(count(world, "1b") + count(world, "3b"), 2);
	drop(world);
}

static void different_motions_begin_one_by_one(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	post(world, 0, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 1, DB_CMD_MOVE_ABSOLUTE, 5);
	post(world, 2, DB_CMD_MOVE_ABSOLUTE, 6);
	pass(world, 60 * MS);
	assert_int_equal(count(world, "*b"), 0);
	assert_int_equal(count(world, "b"), 3);
	assert_true(all_ended(world, DB_RESULT_OK));
	drop(world);
}

/* While the others wait for the last one. */
static void a_stop_in_between_wins(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	world->slow[2] = 40 * MS;
	post_all(world);
	pass(world, 20 * MS);
	assert_string_equal(world->said, "1p 2p 3p");
	post(world, 0, DB_CMD_STOP, 0);
	pass(world, 150 * MS);
	/* Its own move never begins, with a frame for all neither. */
	assert_int_equal(count(world, "1s"), 1);
	assert_int_equal(count(world, "1b"), 0);
	assert_int_equal(count(world, "*b"), 0);
	assert_int_equal(count(world, "2b") + count(world, "3b"), 2);
	drop(world);
}

/* The stop of a drive goes out before the frame that was ready, and all of them keep it from moving. */
static void stops_for_all_leave_nothing_to_begin(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	world->slow[2] = 40 * MS;
	post_all(world);
	pass(world, 20 * MS);
	for (uint16_t i = 0; i < DRIVES; i++)
		post(world, i, DB_CMD_STOP, 0);
	pass(world, 200 * MS);
	assert_int_equal(count(world, "b"), 0);
	assert_int_equal(count(world, "s"), 3);
	drop(world);
}

static void a_drive_that_is_away_keeps_the_others_apart(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	world->slow[1] = 10000 * MS;
	post_all(world);
	pass(world, 1500 * MS);
	assert_int_equal(count(world, "*b"), 0);
	assert_int_equal(world->results[0], DB_RESULT_OK);
	assert_int_equal(world->results[1], DB_RESULT_TIMEOUT);
	assert_int_equal(world->results[2], DB_RESULT_OK);
	drop(world);
}

/* Several exchanges are under way there, polls among them: the frame goes out when they are answered. */
static void where_exchanges_overlap_all_is_answered_first(void **state)
{
	struct db_driver shared = serial_family;
	struct world *world;

	(void)state;
	shared.medium = DB_MEDIUM_CAN;
	/* So often that there is always one under way. */
	world = make_with_cycle(&shared, 2);
	world->lag[1] = MS / 2;
	world->lag[2] = 3 * MS / 2;
	for (unsigned i = 0; i < 10; i++) {
		world->said[0] = '\0';
		world->slow[i % DRIVES] = (db_time)i * MS;
		post_all(world);
		pass(world, (40 + i) * MS + MS / 2);
		assert_int_equal(count(world, "*b"), 1);
		assert_int_equal(count(world, "l"), 3);
		assert_true(all_ended(world, DB_RESULT_OK));
	}
	drop(world);
}

/* Nobody knows whether it is still there. */
static void one_that_falls_silent_is_not_counted_on(void **state)
{
	struct db_driver shared = serial_family;
	struct world *world;

	(void)state;
	shared.medium = DB_MEDIUM_CAN;
	world = make(&shared);
	world->slow[2] = 90 * MS;
	post_all(world);
	pass(world, 8 * MS);
	world->silent[1] = true;
	pass(world, 130 * MS);
	assert_int_equal(count(world, "*b"), 0);
	assert_int_equal(count(world, "1b") + count(world, "3b"), 2);
	drop(world);
}

static void not_unless_the_bus_is_told_to(void **state)
{
	struct world *world = make(&serial_family);

	(void)state;
	world->bus.starts_by_broadcast = false;
	post_all(world);
	pass(world, 60 * MS);
	assert_int_equal(count(world, "*b"), 0);
	assert_int_equal(count(world, "b"), 3);
	drop(world);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(one_frame_when_all_are_ready),
		cmocka_unit_test(letters_that_come_later_are_waited_for),
		cmocka_unit_test(without_one_of_them_each_begins_by_itself),
		cmocka_unit_test(one_that_refuses_is_not_reached),
		cmocka_unit_test(different_motions_begin_one_by_one),
		cmocka_unit_test(a_stop_in_between_wins),
		cmocka_unit_test(stops_for_all_leave_nothing_to_begin),
		cmocka_unit_test(a_drive_that_is_away_keeps_the_others_apart),
		cmocka_unit_test(where_exchanges_overlap_all_is_answered_first),
		cmocka_unit_test(one_that_falls_silent_is_not_counted_on),
		cmocka_unit_test(not_unless_the_bus_is_told_to),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
