/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Parameter writes of several writers to VSMD drives, byte by byte, in made-up time: what shares a line, and how each
 * writer's part ends when a stop, a reload or a lost port comes in the middle. Each ends exactly once.
 */
#include "codec/vsmd_serial_frames.h"
#include "fakes/bus.h"
#include "sched/change.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define DRIVES 2
#define MS DB_NS_PER_MS
#define LATENCY (2 * MS)
#define TICKETS 16
#define HIGHEST_SPD 5000.0f

struct world {
	struct fake_bus *bus;
	uint32_t status[DRIVES];
	float values[DRIVES][VSMD_PARAM_COUNT];
	const char *silent_to; /* a line that begins so is not answered, nor obeyed; null */
	const char *refuses;   /* a line with this is refused, all of it; null */
	bool clamps;           /* spd to HIGHEST_SPD, in silence */
	char log[4096];        /* every line but status requests */
	unsigned ends[TICKETS];
	enum db_result results[TICKETS];
	struct db_request *posted[TICKETS]; /* in the queue */
};

static void obey(struct world *world, const struct vsmd_command *command,
                 const struct vsmd_setting *settings)
{
	size_t drive = (size_t)command->id - 1;

	for (size_t i = 0; command->verb == VSMD_CFG_WRITE && i < command->setting_count; i++) {
		float value = vsmd_params[settings[i].param].type == DB_F32 ?
		                      settings[i].value.f :
		                      (float)settings[i].value.u;

		if (world->clamps && settings[i].param == VSMD_SPD && value > HIGHEST_SPD)
			value = HIGHEST_SPD;
		world->values[drive][settings[i].param] = value;
	}
	if (command->verb == VSMD_STP)
		world->status[drive] |= VSMD_ST_STP;
}

static size_t write_reply(const struct world *world, const struct vsmd_command *command,
                          bool refused, uint8_t *frame)
{
	static const char identity[] = "VSMD113_025T-1.0.008.170428";
	const float *values = world->values[command->id - 1];
	struct vsmd_status status = { .status = world->status[command->id - 1] };
	char text[256];
	int length;

	if (refused)
		status.status |= VSMD_ST_CMD_WRG;
	(void)snprintf(text, sizeof text, "bdr=9600 cid=%d spd=%.2f acc=%.2f dec=%.2f dar=%.0f",
	               command->id, (double)values[VSMD_SPD], (double)values[VSMD_ACC],
	               (double)values[VSMD_DEC], (double)values[VSMD_DAR]);
	if (command->verb == VSMD_DEV)
		length = vsmd_serial_encode_text((uint8_t)command->id, VSMD_REPLY_IDENTITY,
		                                 identity, strlen(identity), frame,
		                                 VSMD_SERIAL_FRAME_MAX);
	else if (command->verb == VSMD_CFG_READ || command->verb == VSMD_SAV)
		length = vsmd_serial_encode_text((uint8_t)command->id, VSMD_REPLY_PARAMS, text,
		                                 strlen(text), frame, VSMD_SERIAL_FRAME_MAX);
	else
		length = vsmd_serial_encode_status((uint8_t)command->id, &status, frame,
		                                   VSMD_SERIAL_FRAME_MAX);
	assert_true(length > 0);
	return (size_t)length;
}

static db_time on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	struct vsmd_setting settings[VSMD_PARAM_COUNT];
	uint8_t answer[VSMD_SERIAL_FRAME_MAX];
	struct vsmd_command command;
	char line[DB_REQUEST_MAX + 1] = "";
	bool refused;

	if (bytes[0] == '\n') {
		bytes++;
		length--;
	}
	memcpy(line, bytes, length);
	assert_int_equal(vsmd_serial_decode_command(line, length - 1, true, &command, settings,
	                                            VSMD_PARAM_COUNT),
	                 VSMD_OK);
	if (command.verb != VSMD_STS) {
		assert_true(strlen(world->log) + length < sizeof world->log);
		strncat(world->log, line, length);
	}
	if (command.id == VSMD_SERIAL_BROADCAST)
		return world->bus->now;
	if (world->silent_to && strncmp(line, world->silent_to, strlen(world->silent_to)) == 0)
		return world->bus->now;
	refused = world->refuses && strstr(line, world->refuses);
	if (!refused)
		obey(world, &command, settings);
	fake_answer_after(world->bus, LATENCY, answer,
	                  write_reply(world, &command, refused, answer));
	return world->bus->now;
}

static const struct db_engine_ops ops = { .send = on_send };

static int open_world(void **state)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->bus = fake_bus_new(db_driver_find("vsmd-serial"), DRIVES);
	world->bus->context = world;
	world->bus->config.transport = &db_transport_serial;
	world->bus->config.baud = 9600;
	world->bus->config.stop_bits = 1;
	world->bus->config.queue = TICKETS;
	for (size_t i = 0; i < DRIVES; i++)
		world->status[i] = VSMD_ST_STP;
	fake_bus_open(world->bus, DRIVES, &ops);
	fake_port(world->bus, 0);
	fake_pass(world->bus, 1500 * MS);
	assert_true(fake_feedback(world->bus, 1).status & DB_STATUS_PARAMS_VALID);
	world->log[0] = '\0';
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

/* One writer's own value, whose ticket is its number. */
static void post_write(struct world *world, uint32_t ticket, enum vsmd_param param, float value)
{
	const struct db_setting setting = { .param = (uint16_t)param,
		                            .value = vsmd_params[param].type == DB_F32 ?
		                                             (union db_value){ .f = value } :
		                                             (union db_value){
								     .u = (uint32_t)value } };
	const struct db_request request = {
		.ticket = ticket,
		.settings = &setting,
		.setting_count = 1,
		.submitted = world->bus->now,
	};

	world->posted[ticket] = db_queue_post(world->bus->queue, &request);
	assert_non_null(world->posted[ticket]);
}

static bool is_acknowledged(struct world *world, uint32_t ticket)
{
	return atomic_load(&world->posted[ticket]->acknowledged);
}

static void collect(struct world *world)
{
	struct db_request completion;

	while (fake_collect(world->bus->queue, &completion)) {
		if (completion.ticket >= TICKETS)
			continue;
		world->ends[completion.ticket]++;
		world->results[completion.ticket] = completion.result;
	}
}

/* Those of tickets 1.., in turn; each must have ended once. */
static void expect_ends(struct world *world, const enum db_result *results, size_t count)
{
	fake_pass(world->bus, 3000 * MS);
	collect(world);
	for (size_t i = 0; i < count; i++) {
		assert_int_equal(world->ends[i + 1], 1);
		assert_int_equal(world->results[i + 1], results[i]);
	}
}

#define EXPECT_ENDS(world, ...)                                                       \
	do {                                                                          \
		const enum db_result expected[] = { __VA_ARGS__ };                    \
		expect_ends((world), expected, sizeof expected / sizeof expected[0]); \
	} while (0)

/* Lets time pass until this was sent. */
static void wait_for(struct world *world, const char *text)
{
	for (unsigned i = 0; i < 4000 && !strstr(world->log, text); i++)
		fake_pass(world->bus, MS / 4);
	assert_non_null(strstr(world->log, text));
}

static void post_three(struct world *world)
{
	post_write(world, 1, VSMD_SPD, 4000);
	post_write(world, 2, VSMD_ACC, 500);
	post_write(world, 3, VSMD_DEC, 600);
}

static void writes_that_wait_share_a_line_and_a_read_back(void **state)
{
	struct world *world = *state;

	post_three(world);
	EXPECT_ENDS(world, DB_RESULT_OK, DB_RESULT_OK, DB_RESULT_OK);
	assert_string_equal(world->log, "1 cfg spd=4000 acc=500 dec=600\n1 cfg\n");
}

static void writes_to_one_parameter_keep_their_order(void **state)
{
	struct world *world = *state;

	post_write(world, 1, VSMD_SPD, 1000);
	post_write(world, 2, VSMD_ACC, 500);
	post_write(world, 3, VSMD_SPD, 2000);
	post_write(world, 4, VSMD_DEC, 600);
	EXPECT_ENDS(world, DB_RESULT_OK, DB_RESULT_OK, DB_RESULT_OK, DB_RESULT_OK);
	assert_string_equal(world->log, "1 cfg spd=1000 acc=500\n1 cfg\n"
	                                "1 cfg spd=2000 dec=600\n1 cfg\n");
	assert_true(world->values[0][VSMD_SPD] == 2000.0f);
}

static void what_comes_while_a_line_is_said_joins_with_the_next(void **state)
{
	struct world *world = *state;

	post_write(world, 1, VSMD_SPD, 1000);
	wait_for(world, "1 cfg spd");
	post_write(world, 2, VSMD_ACC, 500);
	EXPECT_ENDS(world, DB_RESULT_OK, DB_RESULT_OK);
	assert_string_equal(world->log, "1 cfg spd=1000\n1 cfg acc=500\n1 cfg\n");
}

static void a_refused_line_is_said_again_part_by_part(void **state)
{
	struct world *world = *state;

	world->refuses = "acc=";
	post_three(world);
	EXPECT_ENDS(world, DB_RESULT_OK, DB_RESULT_REFUSED, DB_RESULT_OK);
	assert_string_equal(world->log, "1 cfg spd=4000 acc=500 dec=600\n1 cfg spd=4000\n"
	                                "1 cfg acc=500\n1 cfg dec=600\n1 cfg\n");
}

static void a_clamped_value_is_its_writers_alone(void **state)
{
	struct world *world = *state;

	world->clamps = true;
	post_write(world, 1, VSMD_SPD, 9000);
	post_write(world, 2, VSMD_ACC, 500);
	EXPECT_ENDS(world, DB_RESULT_REFUSED, DB_RESULT_OK);
	/* The second time only what the drive did not keep. */
	assert_string_equal(world->log, "1 cfg spd=9000 acc=500\n1 cfg\n1 cfg spd=9000\n1 cfg\n");
}

static void a_stop_while_a_line_is_said_leaves_what_the_drive_took(void **state)
{
	struct world *world = *state;

	post_write(world, 1, VSMD_SPD, 1000);
	wait_for(world, "1 cfg spd");
	post_write(world, 2, VSMD_ACC, 500); /* joins, and has a line of its own */
	post_write(world, 3, VSMD_SPD, 3000);
	fake_pass(world->bus, MS / 2);
	fake_post(world->bus, 0, DB_CMD_STOP);
	EXPECT_ENDS(world, DB_RESULT_UNPROVEN, DB_RESULT_CANCELLED, DB_RESULT_CANCELLED);
	assert_null(strstr(world->log, "acc"));
	assert_null(strstr(world->log, "spd=3000"));
	assert_true(world->values[0][VSMD_SPD] == 1000.0f);
}

static void a_stop_during_the_read_back_leaves_all_as_taken(void **state)
{
	struct world *world = *state;

	post_three(world);
	wait_for(world, "dec=600\n1 cfg\n");
	world->silent_to = "1 cfg";
	fake_pass(world->bus, MS / 4);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 100 * MS);
	world->silent_to = NULL;
	fake_pass(world->bus, 3000 * MS);
	collect(world);
	for (unsigned i = 1; i <= 3; i++) {
		assert_int_equal(world->ends[i], 1);
		assert_true(db_result_is_success(world->results[i]));
	}
}

/* The line was acknowledged, and its read-back or the next line waits for the wire. */
static void a_stop_between_two_lines_leaves_what_the_drive_took(void **state)
{
	for (db_time after = 0; after < 120 * MS; after += MS / 2) {
		struct world *world;
		const char *cfg;

		open_world(state);
		world = *state;
		post_write(world, 1, VSMD_SPD, 1000);
		post_write(world, 2, VSMD_SPD, 2000);
		post_write(world, 3, VSMD_ACC, 700);
		if (after > 0)
			fake_pass(world->bus, after);
		fake_post(world->bus, 0, DB_CMD_STOP);
		fake_pass(world->bus, 3000 * MS);
		collect(world);
		cfg = strstr(world->log, "stp");
		assert_non_null(cfg);
		/* Nothing of them is said after the stop. */
		assert_null(strstr(cfg, "="));
		for (unsigned i = 1; i <= 3; i++)
			assert_int_equal(world->ends[i], 1);
		assert_int_equal(db_result_is_success(world->results[1]),
		                 strstr(world->log, "spd=1000") != NULL);
		assert_int_equal(db_result_is_success(world->results[2]),
		                 strstr(world->log, "spd=2000") != NULL);
		assert_int_equal(db_result_is_success(world->results[3]),
		                 strstr(world->log, "acc=700") != NULL);
		close_world(state);
	}
}

static void a_drive_that_falls_silent_ends_each_once(void **state)
{
	struct world *world = *state;

	world->silent_to = "1 ";
	post_three(world);
	EXPECT_ENDS(world, DB_RESULT_TIMEOUT, DB_RESULT_TIMEOUT, DB_RESULT_TIMEOUT);
}

static void a_drive_that_falls_silent_after_the_line_leaves_it_unproven(void **state)
{
	struct world *world = *state;

	post_three(world);
	wait_for(world, "dec=600\n");
	fake_pass(world->bus, LATENCY);
	world->silent_to = "1 ";
	EXPECT_ENDS(world, DB_RESULT_UNPROVEN, DB_RESULT_UNPROVEN, DB_RESULT_UNPROVEN);
}

static void a_lost_port_ends_each_once(void **state)
{
	struct world *world = *state;

	post_three(world);
	wait_for(world, "dec=600\n");
	post_write(world, 4, VSMD_SPD, 1);
	fake_pass(world->bus, MS / 4);
	fake_port(world->bus, 5);
	EXPECT_ENDS(world, DB_RESULT_BUS_DOWN, DB_RESULT_BUS_DOWN, DB_RESULT_BUS_DOWN,
	            DB_RESULT_BUS_DOWN);
}

static void a_drive_that_leaves_ends_each_once(void **state)
{
	struct world *world = *state;
	const uint16_t leaving = world->bus->list[0].drive;
	struct db_change *change = change_new(&world->bus->config, DRIVES, &leaving, 1, NULL, 0);

	assert_non_null(change);
	post_write(world, 1, VSMD_SPD, 1000);
	wait_for(world, "1 cfg spd");
	post_write(world, 2, VSMD_ACC, 500);
	post_write(world, 3, VSMD_SPD, 2000);
	fake_pass(world->bus, MS / 2);
	change_begin(world->bus->engine, change, world->bus->now);
	EXPECT_ENDS(world, DB_RESULT_UNPROVEN, DB_RESULT_CANCELLED, DB_RESULT_CANCELLED);
	change_free(change_fetch(world->bus->engine));
}

static void what_the_drive_acknowledged_shows_before_it_is_proved(void **state)
{
	struct world *world = *state;

	post_three(world);
	wait_for(world, "dec=600\n");
	for (uint32_t ticket = 1; ticket <= 3; ticket++)
		assert_false(is_acknowledged(world, ticket));
	fake_pass(world->bus, LATENCY + MS);
	for (uint32_t ticket = 1; ticket <= 3; ticket++)
		assert_true(is_acknowledged(world, ticket));
	EXPECT_ENDS(world, DB_RESULT_OK, DB_RESULT_OK, DB_RESULT_OK);
}

static void set_second_going(struct world *world)
{
	world->status[1] = 0;
	fake_pass(world->bus, 300 * MS);
	assert_true(fake_feedback(world->bus, 1).status & DB_STATUS_MOVING);
	world->log[0] = '\0';
}

static void while_a_drive_moves_each_setting_has_a_short_line(void **state)
{
	struct world *world = *state;

	set_second_going(world);
	post_three(world);
	EXPECT_ENDS(world, DB_RESULT_UNPROVEN, DB_RESULT_UNPROVEN, DB_RESULT_UNPROVEN);
	assert_string_equal(world->log, "1 cfg spd=4000\n1 cfg acc=500\n1 cfg dec=600\n");
}

/* A line for all was refused, the parts wait for lines of their own, or all wait for the read-back: then another moves. */
static void a_drive_that_sets_off_in_between_holds_no_write_up(void **state)
{
	for (db_time after = 0; after < 200 * MS; after += 2 * MS) {
		struct world *world;

		open_world(state);
		world = *state;
		post_three(world);
		if (after > 0)
			fake_pass(world->bus, after);
		world->status[1] = 0;
		fake_pass(world->bus, 1000 * MS);
		collect(world);
		for (unsigned i = 1; i <= 3; i++) {
			assert_int_equal(world->ends[i], 1);
			assert_true(db_result_is_success(world->results[i]));
		}
		close_world(state);
	}
}

static void a_save_is_refused_at_once_and_delays_nothing(void **state)
{
	struct world *world = *state;

	set_second_going(world);
	fake_post(world->bus, 0, DB_CMD_SAVE_PARAMETERS);
	fake_post(world->bus, 0, DB_CMD_READ_PARAMETERS);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 200 * MS);
	assert_non_null(strstr(world->log, "1 ena\n"));
	assert_int_equal(fake_result(world->bus), DB_RESULT_LINE_MOVES);
	assert_int_equal(fake_result(world->bus), DB_RESULT_LINE_MOVES);
	assert_null(strstr(world->log, "sav"));
	assert_null(strstr(world->log, "cfg"));
}

static void a_stop_cancels_a_save_that_waits(void **state)
{
	struct world *world = *state;

	post_write(world, 1, VSMD_SPD, 1000);
	wait_for(world, "1 cfg spd");
	fake_post(world->bus, 0, DB_CMD_SAVE_PARAMETERS);
	fake_pass(world->bus, MS / 4);
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 2000 * MS);
	assert_null(strstr(world->log, "sav"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_world, close_world)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(writes_that_wait_share_a_line_and_a_read_back),
		TEST(writes_to_one_parameter_keep_their_order),
		TEST(what_comes_while_a_line_is_said_joins_with_the_next),
		TEST(a_refused_line_is_said_again_part_by_part),
		TEST(a_clamped_value_is_its_writers_alone),
		TEST(a_stop_while_a_line_is_said_leaves_what_the_drive_took),
		TEST(a_stop_during_the_read_back_leaves_all_as_taken),
		cmocka_unit_test(a_stop_between_two_lines_leaves_what_the_drive_took),
		TEST(a_drive_that_falls_silent_ends_each_once),
		TEST(a_drive_that_falls_silent_after_the_line_leaves_it_unproven),
		TEST(a_lost_port_ends_each_once),
		TEST(a_drive_that_leaves_ends_each_once),
		TEST(what_the_drive_acknowledged_shows_before_it_is_proved),
		TEST(while_a_drive_moves_each_setting_has_a_short_line),
		cmocka_unit_test(a_drive_that_sets_off_in_between_holds_no_write_up),
		TEST(a_save_is_refused_at_once_and_delays_nothing),
		TEST(a_stop_cancels_a_save_that_waits),
	};

	return cmocka_run_group_tests_name("parameter writes by line", tests, NULL, NULL);
}
