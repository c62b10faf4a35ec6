/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Answers that arrive, late or never: what becomes of a command whose request or answer is lost, and what
 * is learnt from it about the drive.
 */
#include "sched/sched_private.h"
#include "vsmd_world.h"

static void a_command_is_sent_once_and_confirmed(void **state)
{
	struct world *world = *state;
	struct db_snapshot snapshot;

	start_bus(world);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	post_motion(world, 0, DB_CMD_MOVE_ABSOLUTE, 25000);
	fake_pass(world->bus, 10 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(count_sent(world, "1 ena\n"), 1);
	assert_int_equal(count_sent(world, "1 pos 25000 spd=100\n"), 1);
	assert_true(strstr(world->log, "ena") < strstr(world->log, "pos"));
	fake_pass(world->bus, 40 * MS);
	snapshot = fake_snapshot(world->bus, 0);
	assert_int_equal(snapshot.feedback.position, 25000);
	assert_int_equal(snapshot.feedback.state, DB_AXIS_STANDSTILL);
	assert_true(snapshot.feedback.status & DB_STATUS_AT_TARGET);
}

static void a_refused_command_says_so(void **state)
{
	struct world *world = *state;

	start_bus(world);
	post_motion(world, 0, DB_CMD_MOVE_ABSOLUTE, 1); /* not enabled */
	fake_pass(world->bus, 20 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_REFUSED);
	assert_int_equal(world->sim[0].executed[VSMD_POS], 1);
	assert_true(status_of(world, 0) & DB_STATUS_REFUSED);
}

static void a_relative_move_whose_answer_is_lost_moves_once(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_POS, FAULT_LOSE_ANSWER);
	post_motion(world, 0, DB_CMD_MOVE_RELATIVE, 500);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(world->sim[0].executed[VSMD_POS], 1);
	assert_int_equal(world->sim[0].executed[VSMD_RMV], 0);
	assert_int_equal(world->sim[0].status.position, 500);
}

static void a_relative_move_whose_request_is_lost_is_sent_again(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].status.position = 70;
	fail_next(world, 0, VSMD_POS, FAULT_LOSE_REQUEST);
	post_motion(world, 0, DB_CMD_MOVE_RELATIVE, 500);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(world->sim[0].executed[VSMD_POS], 1);
	assert_int_equal(world->sim[0].status.position, 570);
}

static void a_lost_set_position_is_read_back(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_ORG, FAULT_LOSE_ANSWER);
	post_motion(world, 0, DB_CMD_SET_POSITION, 1234);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(world->sim[0].executed[VSMD_ORG], 1);
}

static void a_lost_save_is_indeterminate_and_not_repeated(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_SAV, FAULT_LOSE_ANSWER);
	fake_post(world->bus, 0, DB_CMD_SAVE_PARAMETERS);
	fake_pass(world->bus, 1500 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_INDETERMINATE);
	assert_int_equal(world->sim[0].executed[VSMD_SAV], 1);
}

/* The answer to an earlier status poll comes while a command waits for its own. */
static void a_late_answer_is_not_taken_for_the_next_ones(void **state)
{
	struct world *world = *state;

	enable_first(world);
	fail_next(world, 0, VSMD_STS, FAULT_LATE_ANSWER);
	while (world->late_length == 0)
		fake_pass(world->bus, MS);
	fail_next(world, 0, VSMD_MOV, FAULT_LOSE_REQUEST);
	post_motion(world, 0, DB_CMD_MOVE_VELOCITY, 0);
	for (int i = 0; i < 40; i++) {
		fake_pass(world->bus, MS);
		if (world->late_length > 0 && count_sent(world, "1 dev\n") > 0) {
			fake_receive(world->bus, world->late, world->late_length);
			world->late_length = 0;
		}
		/* Never confirmed before the drive has really done it. */
		if (world->sim[0].executed[VSMD_MOV] == 0)
			assert_int_equal(fake_result(world->bus), DB_RESULT_NONE);
	}
	assert_int_equal(world->late_length, 0);
	fake_pass(world->bus, 200 * MS);
	assert_int_equal(world->sim[0].executed[VSMD_MOV], 1);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
}

static void a_shake_whose_answer_is_lost_is_not_begun_again(void **state)
{
	struct world *world = *state;
	const struct db_request request = {
		.command = DB_CMD_SHAKE_START,
		.args = &(struct db_args){ .shake_end_position = 100,
		                           .shake_frequency = 20.0f,
		                           .shake_cycles = 1 },
	};

	start_bus(world);
	world->sim[0].status.status |= VSMD_ST_HS | VSMD_ST_PWR;
	fake_pass(world->bus, 50 * MS);
	world->sim[0].fault = FAULT_LOSE_ANSWER;
	world->sim[0].fault_verb = VSMD_SHAKE_CYCLES;
	fake_request(world->bus, 0, request);
	fake_pass(world->bus, 200 * MS);
	/* It is over by now, back where it began. */
	assert_int_equal(fake_result(world->bus), DB_RESULT_INDETERMINATE);
	assert_int_equal(world->sim[0].executed[VSMD_SHAKE_CYCLES], 1);
}

static void a_homing_run_whose_answer_was_lost_is_ended_by_a_stop(void **state)
{
	struct world *world = *state;
	char *stop;

	start_bus(world);
	world->sim[0].status.status |= VSMD_ST_HS | VSMD_ST_PWR;
	fake_pass(world->bus, 50 * MS);
	world->sim[0].fault = FAULT_LOSE_ANSWER;
	world->sim[0].fault_verb = VSMD_ZERO_START;
	post_motion(world, 0, DB_CMD_HOME, 0);
	while (!strstr(world->log, "zero start"))
		fake_pass(world->bus, MS / 8);
	fake_pass(world->bus, 2 * MS);
	world->sim[0].status.status &= ~(uint32_t)VSMD_ST_STP;
	world->log[0] = '\0';
	fake_post(world->bus, 0, DB_CMD_STOP);
	fake_pass(world->bus, 200 * MS);
	stop = strstr(world->log, "1 stp");
	assert_non_null(stop);
	assert_non_null(strstr(stop, "1 zero stop"));
}

static void commands_to_a_drive_that_is_gone_end(void **state)
{
	struct world *world = *state;

	enable_first(world);
	world->sim[0].dead = true;
	post_motion(world, 0, DB_CMD_MOVE_VELOCITY, 0);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 300 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_INDETERMINATE);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OFFLINE);
	assert_false(status_of(world, 0) & DB_STATUS_ONLINE);
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_pass(world->bus, 1 * MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OFFLINE);
}

/*
 * The thread is not run for a while, again and again, and finds answers that came in time: nothing is lost, nobody is
 * late. `reads`: it finds them before it looks at the clock, as poll() tells; else poll() had just returned in vain.
 */
static void oversleep(struct world *world, bool reads)
{
	struct db_bus_stats before = fake_stats(world->bus);
	struct db_bus_stats after;
	unsigned asleep = 0;

	for (unsigned i = 0; i < 200; i++) {
		/* At another moment of the exchanges each time. */
		fake_pass(world->bus, 21 * MS + i * 77 * MS / 1000);
		for (size_t a = 0; a < world->bus->answer_count; a++)
			asleep += world->bus->answers[a].at > world->bus->now;
		world->bus->now += 35 * MS;
		world->log[0] = '\0';
		while (reads && world->bus->answer_count > 0) {
			struct fake_answer due = world->bus->answers[--world->bus->answer_count];

			fake_receive(world->bus, due.bytes, due.length);
		}
	}
	after = fake_stats(world->bus);
	/* It did happen, while answers were on their way. */
	assert_true(asleep > 20);
	assert_in_range(after.overslept_us - before.overslept_us, 200 * 20000, 200 * 35000);
	assert_int_equal(after.timeouts, before.timeouts);
	assert_int_equal(after.retries, before.retries);
	assert_int_equal(after.stray_frames, before.stray_frames);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_LATE], 0);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_DEAF], 0);
	for (size_t i = 0; i < DRIVES; i++) {
		assert_true(status_of(world, i) & DB_STATUS_ONLINE);
		assert_int_equal(fake_snapshot(world->bus, i).stats.timeouts, 0);
		assert_true(fake_snapshot(world->bus, i).stats.round_trip_max_us < 10000);
		assert_int_equal(fake_snapshot(world->bus, i).learnt.latency_ms, 0);
	}
}

static void a_busy_computer_is_no_drives_fault(void **state)
{
	struct world *world = *state;

	start_bus(world);
	oversleep(world, true);
	oversleep(world, false);
	/* A drive that goes meanwhile is missed all the same. */
	world->sim[0].dead = true;
	for (unsigned i = 0; i < 40; i++) {
		fake_pass(world->bus, 21 * MS);
		world->bus->now += 35 * MS;
		world->log[0] = '\0';
	}
	assert_false(status_of(world, 0) & DB_STATUS_ONLINE);
	assert_true(status_of(world, 1) & DB_STATUS_ONLINE);
}

/* Asks the first drive, which keeps its answer, and has the bus run 5 ms later than it asked for, long before that is
 * overdue. Returns when it is, if the bus had been run in time. */
static db_time oversleep_while_asked(struct world *world)
{
	const struct flight *flight = &world->bus->engine->nodes[0]->flight;
	db_time due;
	db_time next;

	world->late_length = 0;
	fail_next(world, 0, VSMD_STS, FAULT_LATE_ANSWER);
	while (world->late_length == 0)
		fake_pass(world->bus, MS / 10);
	due = flight->deadline;
	next = db_engine_run(world->bus->engine, world->bus->now);
	assert_true(next + 6 * MS < due);
	world->bus->now = next + 5 * MS;
	(void)db_engine_run(world->bus->engine, world->bus->now);
	return due;
}

/* A drive has the time that it has otherwise, and no more. */
static void what_a_busy_computer_takes_of_an_answers_time_is_given_back(void **state)
{
	struct world *world = *state;
	uint32_t timeouts;
	db_time due;

	db_engine_free(world->bus->engine);
	db_queue_free(world->bus->queue);
	/* So that a cycle begins while an answer is awaited. */
	world->bus->config.cycle_ms = 4;
	fake_bus_open(world->bus, DRIVES, &ops);
	start_bus(world);
	timeouts = fake_stats(world->bus).timeouts;
	due = oversleep_while_asked(world);
	fake_pass(world->bus, due + 4 * MS - world->bus->now);
	assert_int_equal(fake_stats(world->bus).timeouts, timeouts);
	fake_receive(world->bus, world->late, world->late_length);
	fake_pass(world->bus, 20 * MS);
	assert_int_equal(fake_stats(world->bus).timeouts, timeouts);
	assert_int_equal(fake_stats(world->bus).stray_frames, 0);
	world->log[0] = '\0';
	due = oversleep_while_asked(world);
	fake_pass(world->bus, due + 6 * MS - world->bus->now);
	assert_int_equal(fake_stats(world->bus).timeouts, timeouts + 1);
}

static void drives_get_time_to_turn_around(void **state)
{
	struct world *world = *state;

	start_bus(world);
	for (size_t i = 0; i < DRIVES; i++)
		world->sim[i].deaf = MS;
	fake_pass(world->bus, 100 * MS); /* what was lost meanwhile is over */
	world->least_gap = 1000 * MS;
	fake_post(world->bus, 0, DB_CMD_ENABLE);
	fake_post(world->bus, 1, DB_CMD_STOP);
	fake_pass(world->bus, 400 * MS);
	assert_int_equal(world->least_gap, MS);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	assert_int_equal(fake_result(world->bus), DB_RESULT_OK);
	for (size_t i = 0; i < DRIVES; i++)
		assert_true(status_of(world, i) & DB_STATUS_ONLINE);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_DEAF], 0);
}

static void a_drive_that_is_deaf_for_longer_is_logged(void **state)
{
	struct world *world = *state;

	/* One on the line, so that every request follows its own answer. */
	world->sim[1].dead = world->sim[2].dead = true;
	start_bus(world);
	world->sim[0].deaf = 4 * MS;
	/* Its parameters are asked for right behind the answer who it is. */
	for (unsigned i = 0; i < 3; i++) {
		fake_post(world->bus, 0, DB_CMD_READ_PARAMETERS);
		fake_pass(world->bus, 1000 * MS);
	}
	assert_true(world->told_timing[DB_EVENT_DRIVE_DEAF] > 0);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_LATE], 0);
	assert_int_equal(world->timing, MS);
}

static void a_drive_that_answers_late_is_logged(void **state)
{
	struct world *world = *state;
	unsigned missing = 0;

	world->sim[0].latency = 14 * MS; /* 10 are waited for */
	start_bus(world);
	fake_pass(world->bus, 3000 * MS);
	assert_true(world->told_timing[DB_EVENT_DRIVE_LATE] > 0);
	assert_in_range(world->timing, 10 * MS, 14 * MS);
	for (size_t i = 0; i < world->told_count; i++)
		missing += world->told[i].event == DB_EVENT_DRIVE_LOST;
	assert_int_equal(missing, 0);
}

static void a_drive_that_is_gone_is_neither_late_nor_deaf(void **state)
{
	struct world *world = *state;

	start_bus(world);
	for (unsigned i = 0; i < 20; i++) {
		world->sim[0].dead = i % 2 == 0;
		fake_pass(world->bus, 200 * MS);
		world->told_count = 0;
	}
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_DEAF], 0);
	assert_int_equal(world->told_timing[DB_EVENT_DRIVE_LATE], 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST_OF_LINE(a_command_is_sent_once_and_confirmed),
		TEST_OF_LINE(a_refused_command_says_so),
		TEST_OF_LINE(a_relative_move_whose_answer_is_lost_moves_once),
		TEST_OF_LINE(a_relative_move_whose_request_is_lost_is_sent_again),
		TEST_OF_LINE(a_lost_set_position_is_read_back),
		TEST_OF_LINE(a_lost_save_is_indeterminate_and_not_repeated),
		TEST_OF_LINE(a_late_answer_is_not_taken_for_the_next_ones),
		TEST_OF_LINE(a_shake_whose_answer_is_lost_is_not_begun_again),
		TEST_OF_LINE(a_homing_run_whose_answer_was_lost_is_ended_by_a_stop),
		TEST_OF_LINE(commands_to_a_drive_that_is_gone_end),
		TEST_OF_LINE(a_busy_computer_is_no_drives_fault),
		TEST_OF_LINE(what_a_busy_computer_takes_of_an_answers_time_is_given_back),
		cmocka_unit_test_setup_teardown(drives_get_time_to_turn_around, open_turning_world,
		                                close_world),
		cmocka_unit_test_setup_teardown(a_drive_that_is_deaf_for_longer_is_logged,
		                                open_turning_world, close_world),
		TEST_OF_LINE(a_drive_that_answers_late_is_logged),
		TEST_OF_LINE(a_drive_that_is_gone_is_neither_late_nor_deaf),
	};

	return cmocka_run_group_tests_name("answer", tests, NULL, NULL);
}
