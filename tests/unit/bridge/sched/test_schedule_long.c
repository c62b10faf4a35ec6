/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An exchange was prepared while all drives of a line stood; when a drive moves it is too long, as
 * a stop would have to wait for it. Two made-up drives: the first one does not answer, and the
 * second one begins to move before the lost exchange is repeated.
 */
#include "fakes/bus.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define LONG_TIME (50 * MS)
#define RETRIES 2

/* Parameters of the made-up drive: how long the exchanges are that can write them. */
enum param {
	SHORT_TOO, /* in a long exchange or in a short one */
	ONLY_LONG, /* the driver refuses to write it in a short one */
	PROVED,    /* as SHORT_TOO, and a long question afterwards proves the write */
};

struct world {
	struct fake_bus *bus;
	struct db_driver driver;
	enum fake_kind silent; /* the first drive does not answer frames of this kind */
	bool goes;             /* the second drive moves */
	uint16_t result;       /* of the request; NONE: it has not ended */
	db_time ended;         /* when the request ended */
	uint32_t refusals;     /* of the first drive, when the request ended */
};

static enum db_step say(struct db_conversation *talk, enum fake_kind kind, bool is_long)
{
	enum db_step step = fake_say(talk, kind);

	talk->exchange->extra_time = is_long ? LONG_TIME : 0;
	talk->exchange->proof = talk->exchange->joins = false;
	return step;
}

/* A long exchange is sent as PREPARE, a short one as COMMAND, and a question after either as
 * LOOK. */
static enum db_step begin(struct db_conversation *talk)
{
	const struct db_request *request = talk->job->request;

	if (talk->job->kind == DB_JOB_SETTINGS && talk->brief &&
	    request->settings[0].param == ONLY_LONG) {
		talk->result = DB_RESULT_REFUSED;
		return DB_STEP_DONE;
	}
	if (talk->job->kind == DB_JOB_SETTINGS)
		return say(talk, talk->brief ? FAKE_COMMAND : FAKE_PREPARE, !talk->brief);
	if (talk->job->kind == DB_JOB_COMMAND && !db_command_is_stop(request->command))
		return say(talk, FAKE_PREPARE, true);
	return fake_family.begin(talk);
}

static enum db_step answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	const struct db_job *job = talk->job;
	enum fake_kind kind = fake_frame_at(bytes, length).kind;

	if (kind != FAKE_PREPARE && kind != FAKE_COMMAND && kind != FAKE_LOOK)
		return fake_family.answer(talk, bytes, length);
	talk->result = DB_RESULT_OK;
	if (job->kind != DB_JOB_SETTINGS || job->request->settings[0].param != PROVED ||
	    kind == FAKE_LOOK)
		return DB_STEP_DONE;
	(void)say(talk, FAKE_LOOK, true);
	talk->exchange->proof = true;
	return DB_STEP_SEND;
}

/* After a lost READ_PARAMETERS a short question tells its result; the result of any other request
 * stays unknown. */
static enum db_step lost(struct db_conversation *talk)
{
	const struct db_job *job = talk->job;

	if (job->kind == DB_JOB_COMMAND && job->request->command == DB_CMD_READ_PARAMETERS &&
	    talk->exchange->extra_time > 0)
		return say(talk, FAKE_LOOK, false);
	talk->result = job->kind == DB_JOB_SETTINGS && talk->exchange->proof ? DB_RESULT_UNPROVEN :
	                                                                       DB_RESULT_TIMEOUT;
	return DB_STEP_DONE;
}

static db_time obey(void *context, struct fake_frame *frame)
{
	const struct world *world = context;

	frame->speed = frame->address == 2 && world->goes ? 1.0f : 0.0f;
	return frame->address == 1 && frame->kind == world->silent ? 0 : FAKE_ANSWER_TIME;
}

static void watch(void *context)
{
	struct world *world = context;
	struct db_request ended;

	if (!fake_collect(world->bus->queue, &ended))
		return;
	world->result = ended.result;
	world->ended = world->bus->now;
	world->refusals = fake_snapshot(world->bus, 0).stats.refusals;
}

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->silent = FAKE_KINDS;
	world->driver = fake_family;
	world->driver.begin = begin;
	world->driver.answer = answer;
	world->driver.lost = lost;
	world->bus = fake_bus_new(&world->driver, 2);
	world->bus->config.retries = RETRIES;
	world->bus->config.cycle_ms = 2;
	world->bus->context = world;
	world->bus->obey = obey;
	world->bus->turned = watch;
	fake_bus_open(world->bus, 2, NULL);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 500 * MS);
	*state = world;
	return 0;
}

static int close_world(void **state)
{
	struct world *world = *state;

	fake_bus_free(world->bus);
	free(world);
	return 0;
}

static bool is_going(const struct world *world)
{
	return fake_feedback(world->bus, 1).status & DB_STATUS_MOVING;
}

/* The first drive does not answer the exchange of this kind that its request needs, and then the
 * second drive is seen to move. */
static void lose_one(struct world *world, struct db_request request, enum fake_kind kind)
{
	world->silent = kind;
	fake_forget_sent(world->bus);
	fake_request(world->bus, 0, request);
	for (unsigned i = 0; i < 1000 && fake_count(world->bus, 1, kind) == 0; i++)
		fake_pass(world->bus, MS / 10);
	world->goes = true;
	for (unsigned i = 0; i < 1000 && !is_going(world); i++)
		fake_pass(world->bus, MS / 10);
	assert_true(is_going(world));
	assert_int_equal(fake_count(world->bus, 1, kind), 1);
	assert_int_equal(world->result, DB_RESULT_NONE);
}

static void lose_write(struct world *world, enum param param, enum fake_kind kind)
{
	const struct db_setting setting = { .param = (uint16_t)param };

	lose_one(world, (struct db_request){ .settings = &setting, .setting_count = 1 }, kind);
}

static void a_lost_write_is_repeated_in_a_short_exchange(void **state)
{
	struct world *world = *state;

	lose_write(world, SHORT_TOO, FAKE_PREPARE);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_COMMAND), 1);
	assert_int_equal(world->result, DB_RESULT_OK);
}

/* The write does not wait until all drives stand, and the refusal is shown as soon as it ends. */
static void a_write_that_has_no_short_exchange_is_refused(void **state)
{
	struct world *world = *state;

	lose_write(world, ONLY_LONG, FAKE_PREPARE);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(world->result, DB_RESULT_REFUSED);
	assert_int_equal(world->refusals, 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 1);
	/* The next request begins. */
	world->result = DB_RESULT_NONE;
	world->goes = false;
	fake_pass(world->bus, 100 * MS);
	world->silent = FAKE_KINDS;
	fake_request(world->bus, 0, (struct db_request){ .command = DB_CMD_SAVE_PARAMETERS });
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(world->result, DB_RESULT_OK);
}

static void a_lost_proof_of_a_write_is_not_asked_for_again(void **state)
{
	struct world *world = *state;

	lose_write(world, PROVED, FAKE_LOOK);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(world->result, DB_RESULT_UNPROVEN);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 1);
}

/* The command was sent once: that a drive moves now says nothing about its result, so it is not
 * refused. */
static void the_driver_tells_the_result_of_a_lost_command(void **state)
{
	struct world *world = *state;

	lose_one(world, (struct db_request){ .command = DB_CMD_SAVE_PARAMETERS }, FAKE_PREPARE);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(world->result, DB_RESULT_TIMEOUT);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 1);
}

static void the_result_of_a_lost_command_is_asked_for_in_a_short_exchange(void **state)
{
	struct world *world = *state;

	lose_one(world, (struct db_request){ .command = DB_CMD_READ_PARAMETERS }, FAKE_PREPARE);
	fake_pass(world->bus, 100 * MS);
	assert_int_equal(world->result, DB_RESULT_OK);
	assert_int_equal(fake_count(world->bus, 1, FAKE_PREPARE), 1);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 1);
}

/* It is repeated as often as any other exchange. */
static void the_question_for_the_result_has_retries_of_its_own(void **state)
{
	struct world *world = *state;

	lose_one(world, (struct db_request){ .command = DB_CMD_READ_PARAMETERS }, FAKE_PREPARE);
	world->silent = FAKE_LOOK;
	fake_pass(world->bus, 1000 * MS);
	assert_int_equal(fake_count(world->bus, 1, FAKE_LOOK), 1 + RETRIES);
	assert_int_equal(world->result, DB_RESULT_TIMEOUT);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(a_lost_write_is_repeated_in_a_short_exchange),
		TEST(a_write_that_has_no_short_exchange_is_refused),
		TEST(a_lost_proof_of_a_write_is_not_asked_for_again),
		TEST(the_driver_tells_the_result_of_a_lost_command),
		TEST(the_result_of_a_lost_command_is_asked_for_in_a_short_exchange),
		TEST(the_question_for_the_result_has_retries_of_its_own),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
