/* SPDX-License-Identifier: Apache-2.0 */
/* Stops of the bridge's own: whose silence causes them, and what becomes of them. */
#include "commander_world.h"

#define WATCHDOG_MS 3000

static const struct db_client plc = { .id = 1, .address = { [15] = 1 }, .port = 1 };
static const struct db_client hmi = { .id = 2, .address = { [15] = 2 }, .port = 2 };
static const struct db_client session = { .id = DB_CLIENT_FIRST_SESSION + 5 };

/* A drive with a watchdog that is fed in this way. */
static void watch(struct fake *fake, enum db_watchdog_feed feed, uint32_t timeout_ms)
{
	struct db_commander_config config;

	init_with(fake, false, 0, true);
	fake->drive.watchdog_feed = feed;
	config = config_of(fake);
	config.watchdog_ms = timeout_ms;
	config.ids_by_client = true;
	remake(fake, &config);
}

static struct db_write_answer ask(struct fake *fake, const struct db_client *client,
                                  enum db_command command)
{
	static const struct db_args args = { .target_velocity = 100.0f };

	return execute(fake->commander, client, command, &args,
	               (struct db_write_token){ client->id, ++fake->next_token }, fake->now);
}

/* A motion of this client that the drive has begun. */
static void run(struct fake *fake, const struct db_client *client, enum db_command command)
{
	assert_true(ask(fake, client, command).later);
	finish(fake, fake->submitted - 1, DB_RESULT_OK);
}

static uint32_t remaining_ms(struct fake *fake)
{
	struct db_command_state state;

	db_commander_state(fake->commander, NULL, &state, fake->now);
	return state.watchdog_remaining_ms;
}

/* --- signs of life ---------------------------------------------------------------------------------- */

static void commands_are_signs_of_life_of_who_commands(void **state)
{
	struct fake fake;

	(void)state;
	watch(&fake, DB_FEED_WRITES, WATCHDOG_MS);
	run(&fake, &plc, DB_CMD_MOVE_VELOCITY);
	fake.now += 2000 * MS;
	assert_true(ask(&fake, &hmi, DB_CMD_SET_OUTPUT).later);
	assert_int_equal(remaining_ms(&fake), 1000);
	assert_true(ask(&fake, &plc, DB_CMD_SET_OUTPUT).later);
	assert_int_equal(remaining_ms(&fake), WATCHDOG_MS);
	assert_int_equal(db_commander_fed_by(fake.commander)->id, plc.id);
	/* Refused ones are none. */
	fake.now += 1000 * MS;
	assert_false(ask(&fake, &plc, DB_CMD_SET_SV).later);
	set_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(ask(&fake, &plc, DB_CMD_HOME).result, DB_RESULT_OFFLINE);
	assert_int_equal(remaining_ms(&fake), 2000);
	drop(&fake);
}

/* However little is asked for: that was no read. */
static void commands_of_others_are_none(void **state)
{
	struct fake fake;

	(void)state;
	watch(&fake, DB_FEED_REQUESTS, WATCHDOG_MS);
	run(&fake, &plc, DB_CMD_MOVE_VELOCITY);
	fake.now += 1000 * MS;
	assert_true(ask(&fake, &hmi, DB_CMD_SET_OUTPUT).later);
	assert_int_equal(remaining_ms(&fake), 2000);
	drop(&fake);
	/* While nobody commands a drive that was found moving, anybody's count. */
	watch(&fake, DB_FEED_REQUESTS, WATCHDOG_MS);
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_MOVING);
	wake(&fake);
	fake.now += 1000 * MS;
	assert_true(ask(&fake, &hmi, DB_CMD_SET_OUTPUT).later);
	assert_int_equal(remaining_ms(&fake), WATCHDOG_MS);
	drop(&fake);
}

/* Its connection is there, only the drive or the bus is not, or has no room. */
static void what_cannot_be_done_now_is_a_request_all_the_same(void **state)
{
	static const struct {
		uint32_t status;
		bool full;
		enum db_result result;
	} cases[] = {
		{ DB_STATUS_BUS_UP, false, DB_RESULT_OFFLINE },
		{ 0, false, DB_RESULT_BUS_DOWN },
		{ DB_STATUS_BUS_UP | DB_STATUS_ONLINE, true, DB_RESULT_BUSY },
	};
	const struct db_setting setting = { .param = 3 };
	struct fake fake;

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		watch(&fake, DB_FEED_REQUESTS, WATCHDOG_MS);
		run(&fake, &plc, DB_CMD_MOVE_VELOCITY);
		fake.now += 1000 * MS;
		set_status(&fake, cases[i].status);
		fake.full = cases[i].full;
		assert_int_equal(ask(&fake, &plc, DB_CMD_HOME).result, cases[i].result);
		assert_int_equal(remaining_ms(&fake), WATCHDOG_MS);
		fake.now += 1000 * MS;
		assert_int_equal(set(fake.commander, &plc, &setting, 1,
		                     (struct db_write_token){ 1, 1 }, fake.now)
		                         .result,
		                 cases[i].result);
		assert_int_equal(remaining_ms(&fake), WATCHDOG_MS);
		drop(&fake);
	}
}

/* Its own repetition; anybody could repeat it. */
static void a_repeated_id_is_a_sign_of_life_of_who_commands(void **state)
{
	struct db_commander_config config;
	struct fake fake;

	(void)state;
	watch(&fake, DB_FEED_WRITES, WATCHDOG_MS);
	config = config_of(&fake);
	config.watchdog_ms = WATCHDOG_MS;
	remake(&fake, &config);
	fake.client = &plc;
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += 1000 * MS;
	fake.client = &hmi;
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_VELOCITY, 0), 0);
	assert_int_equal(remaining_ms(&fake), 2000);
	fake.client = &plc;
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_VELOCITY, 0), 0);
	assert_int_equal(remaining_ms(&fake), WATCHDOG_MS);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

/* Reads of the connection that a PLC uses after the bridge was started again under a moving drive. */
static void a_first_id_tells_who_commands_a_drive_found_moving(void **state)
{
	struct fake fake;

	(void)state;
	watch(&fake, DB_FEED_COMMANDERS, WATCHDOG_MS);
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_MOVING);
	wake(&fake);
	fake.client = &plc;
	fake.now += 1000 * MS;
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_VELOCITY, 0), FAILURE);
	assert_int_equal(remaining_ms(&fake), WATCHDOG_MS);
	/* Another one comes too late to be taken for it. */
	fake.client = &hmi;
	fake.now += 1000 * MS;
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_VELOCITY, 0), FAILURE);
	db_commander_feed(fake.commander, &hmi, DB_FEED_REQUESTS, fake.now);
	assert_int_equal(remaining_ms(&fake), 2000);
	db_commander_feed(fake.commander, &plc, DB_FEED_REQUESTS, fake.now);
	assert_int_equal(remaining_ms(&fake), WATCHDOG_MS);
	assert_int_equal(fake.submitted, 0);
	drop(&fake);
}

/* --- a tool that has done its work -------------------------------------------------------------------- */

/* True if the drive was stopped, some time after the only session that commanded it has left. */
static bool stops_after_a_session(struct fake *fake, const struct db_snapshot *seen,
                                  bool still_has_a_request)
{
	bool tripped;

	db_axis_publish(fake->axis, seen);
	if (still_has_a_request)
		assert_true(ask(fake, &session, DB_CMD_SET_OUTPUT).later);
	db_commander_forget(fake->commander, &session, fake->now);
	fake->now += WATCHDOG_MS * MS;
	tripped = db_commander_expire(fake->commander, fake->now);
	assert_int_equal(look(fake).latched, tripped);
	drop(fake);
	return tripped;
}

static struct db_snapshot stand(const struct fake *fake)
{
	return (struct db_snapshot){
		.feedback = { .state = DB_AXIS_STANDSTILL,
		              .status = DB_STATUS_BUS_UP | DB_STATUS_ONLINE,
		              .taken = fake->now + MS },
	};
}

static void begin_and_end(struct fake *fake, struct db_snapshot *seen)
{
	watch(fake, DB_FEED_REQUESTS, WATCHDOG_MS);
	run(fake, &session, DB_CMD_MOVE_CURRENT);
	*seen = stand(fake);
}

static void a_drive_at_rest_is_not_stopped_for_a_session_that_left(void **state)
{
	struct db_snapshot seen;
	struct fake fake;

	(void)state;
	begin_and_end(&fake, &seen);
	assert_false(stops_after_a_session(&fake, &seen, false));
	begin_and_end(&fake, &seen);
	seen.feedback.state = DB_AXIS_DISABLED;
	assert_false(stops_after_a_session(&fake, &seen, false));
}

static void one_that_may_not_be_at_rest_is(void **state)
{
	struct db_snapshot seen;
	struct fake fake;

	(void)state;
	begin_and_end(&fake, &seen);
	seen.feedback.status |= DB_STATUS_MOVING;
	assert_true(stops_after_a_session(&fake, &seen, false));
	begin_and_end(&fake, &seen);
	seen.feedback.status = DB_STATUS_BUS_UP;
	assert_true(stops_after_a_session(&fake, &seen, false));
	begin_and_end(&fake, &seen);
	seen.feedback.state = DB_AXIS_HOMING;
	assert_true(stops_after_a_session(&fake, &seen, false));
	/* That was before it was last told something. */
	begin_and_end(&fake, &seen);
	seen.feedback.taken = fake.now;
	assert_true(stops_after_a_session(&fake, &seen, false));
	begin_and_end(&fake, &seen);
	assert_true(stops_after_a_session(&fake, &seen, true));
	/* It was told to run, and waits for the others that are to run with it. */
	watch(&fake, DB_FEED_REQUESTS, WATCHDOG_MS);
	run(&fake, &session, DB_CMD_MOVE_VELOCITY);
	seen = stand(&fake);
	assert_true(stops_after_a_session(&fake, &seen, false));
}

/* It has limits, and is watched for a second after it was last seen to move. */
static void so_is_one_that_is_kept_within_its_limits(void **state)
{
	struct db_snapshot seen;
	struct fake fake;

	(void)state;
	watch(&fake, DB_FEED_REQUESTS, 500);
	fake.drive.max_position = 100.0;
	run(&fake, &session, DB_CMD_MOVE_CURRENT);
	seen = stand(&fake);
	db_axis_publish(fake.axis, &seen);
	db_commander_forget(fake.commander, &session, fake.now);
	fake.now += 500 * MS;
	assert_true(db_commander_expire(fake.commander, fake.now));
	drop(&fake);
}

/* A PLC may always be one that has died. */
static void a_plc_that_left_is_missed_at_rest_as_well(void **state)
{
	struct db_snapshot seen;
	struct fake fake;

	(void)state;
	watch(&fake, DB_FEED_REQUESTS, WATCHDOG_MS);
	run(&fake, &plc, DB_CMD_MOVE_CURRENT);
	seen = stand(&fake);
	db_axis_publish(fake.axis, &seen);
	db_commander_forget(fake.commander, &plc, fake.now);
	fake.now += WATCHDOG_MS * MS;
	assert_true(db_commander_expire(fake.commander, fake.now));
	drop(&fake);
}

/* --- stops for several causes ------------------------------------------------------------------------- */

static void a_second_cause_repeats_the_stop(void **state)
{
	FAKE(false);
	db_commander_stand(fake.commander, DB_CMD_STOP, DB_STAND_FAULT, fake.now);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.requests[0].cause, DB_STAND_FAULT);
	db_commander_stand(fake.commander, DB_CMD_STOP, DB_STAND_EXIT, fake.now);
	assert_int_equal(fake.submitted, 1);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[1].cause, DB_STAND_EXIT);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	assert_false(look(&fake).busy);
	/* One entry for both. */
	assert_int_equal(entry_of(&fake, 0).sequence, 1);
	assert_int_equal(entry_of(&fake, 0).repeats, 1);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_OK);
	drop(&fake);
}

/* A drive that is to be without power is not only stopped, whatever else asks for a stop. */
static void a_disable_among_stops_wins(void **state)
{
	FAKE(false);
	db_commander_stand(fake.commander, DB_CMD_STOP, DB_STAND_HOLD, fake.now);
	db_commander_stand(fake.commander, DB_CMD_DISABLE, DB_STAND_FAULT, fake.now);
	db_commander_stand(fake.commander, DB_CMD_STOP, DB_STAND_HOLD, fake.now);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_DISABLE);
	drop(&fake);
}

/* The service ends, or nobody can reach it any more. */
static void the_end_of_all_holds_stops_at_once(void **state)
{
	const struct db_args args = { .target_velocity = 100.0f };

	FAKE(false);
	assert_true(execute_held(fake.commander, &session, DB_CMD_MOVE_VELOCITY, &args, 300,
	                         (struct db_write_token){ session.id, 1 }, fake.now)
	                    .later);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(db_commander_owed_stop(fake.commander), DB_CMD_STOP);
	db_commander_end_hold(fake.commander, fake.now);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[1].cause, DB_STAND_HOLD);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(db_commander_owed_stop(fake.commander), DB_CMD_NONE);
	/* Where nothing is held there is nothing to end. */
	db_commander_end_hold(fake.commander, fake.now);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

/* What would have to be sent if the service ended now. */
static void a_stop_is_owed_until_it_has_ended(void **state)
{
	FAKE(false);
	assert_int_equal(db_commander_owed_stop(fake.commander), DB_CMD_NONE);
	run(&fake, &plc, DB_CMD_MOVE_VELOCITY);
	assert_int_equal(db_commander_owed_stop(fake.commander), DB_CMD_NONE);
	assert_true(ask(&fake, &plc, DB_CMD_DISABLE).later);
	assert_true(ask(&fake, &plc, DB_CMD_QUICK_STOP).later);
	assert_int_equal(db_commander_owed_stop(fake.commander), DB_CMD_DISABLE);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(db_commander_owed_stop(fake.commander), DB_CMD_QUICK_STOP);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(db_commander_owed_stop(fake.commander), DB_CMD_NONE);
	drop(&fake);
}

/* Of a hold that was lost: what is commanded after it is what somebody wants now. */
static void a_motion_takes_the_place_of_a_stop_without_room(void **state)
{
	static const enum db_stand_cause causes[] = { DB_STAND_HOLD, DB_STAND_FAULT };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct fake fake;

		init(&fake, false);
		fake.full = true;
		db_commander_stand(fake.commander, DB_CMD_STOP, causes[i], fake.now);
		assert_int_equal(fake.submitted, 0);
		fake.full = false;
		fake.now += MS;
		assert_true(ask(&fake, &plc, DB_CMD_MOVE_CURRENT).later);
		fake.now += 100 * MS;
		db_commander_expire(fake.commander, fake.now);
		/* A stop for another cause is owed all the same. */
		assert_int_equal(fake.submitted, causes[i] == DB_STAND_HOLD ? 1 : 2);
		drop(&fake);
	}
}

/* Through the command block: a program that has died goes on writing the same counter. */
static void a_lost_hold_begins_with_another_counter(void **state)
{
	struct db_command_write write = {
		.block = { .command = DB_CMD_MOVE_VELOCITY,
		           .hold_ms = 300,
		           .hold_beat = 7,
		           .args.target_velocity = 100.0f },
		.has_command = true,
		.has_beat = true,
	};
	const struct db_write_token token = { 1, 1 };

	FAKE(false);
	assert_true(db_commander_write(fake.commander, &plc, &write, token, fake.now).later);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += 300 * MS;
	db_commander_expire(fake.commander, fake.now);
	assert_int_equal(fake.holds_lost, 1);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(db_commander_write(fake.commander, &plc, &write, token, fake.now).result,
	                 DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(fake.submitted, 2);
	write.block.hold_beat = 8;
	assert_true(db_commander_write(fake.commander, &plc, &write, token, fake.now).later);
	drop(&fake);
}

static void what_is_held_is_held_to_its_end(void **state)
{
	static const struct {
		enum db_axis_state state;
		unsigned stops;
	} ends[] = { { DB_AXIS_STANDSTILL, 0 }, { DB_AXIS_ERROR_STOP, 1 } };
	const struct db_args args = { .target_position = 1000 };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct fake fake;

		init(&fake, false);
		assert_true(execute_held(fake.commander, &session, DB_CMD_MOVE_ABSOLUTE, &args,
		                         1000, (struct db_write_token){ session.id, 1 }, fake.now)
		                    .later);
		finish(&fake, 0, DB_RESULT_OK);
		fake.now += MS;
		set_axis(&fake, ends[i].state, 0, 1000);
		let_pass(&fake, 2000 * MS);
		assert_int_equal(fake.submitted, 1 + ends[i].stops);
		drop(&fake);
	}
}

/* Nothing moves: nobody has to be there. */
static void a_cleared_latch_of_a_standing_drive_watches_nobody(void **state)
{
	struct fake fake;

	(void)state;
	watch(&fake, DB_FEED_REQUESTS, WATCHDOG_MS);
	run(&fake, &plc, DB_CMD_MOVE_CURRENT);
	fake.now += WATCHDOG_MS * MS;
	assert_true(db_commander_expire(fake.commander, fake.now));
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(ask(&fake, &plc, DB_CMD_MOVE_CURRENT).result, DB_RESULT_LATCHED);
	assert_int_equal(ask(&fake, &plc, DB_CMD_CLEAR_FAULT).result, DB_RESULT_OK);
	assert_int_equal(remaining_ms(&fake), 0);
	assert_false(look(&fake).latched);
	drop(&fake);
}

/* It ends by clear_fault also of a drive that has no such command; staged, that would be none. */
static void a_latch_is_cleared_at_once_or_not_at_all(void **state)
{
	struct db_command_write staged = {
		.block = { .staged_command = DB_CMD_CLEAR_FAULT },
		.has_staged = true,
	};
	struct db_commander_config config;
	struct fake fake;

	(void)state;
	init_with(&fake, false, 0, false);
	config = config_of(&fake);
	config.watchdog_ms = WATCHDOG_MS;
	config.commands &= ~DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT);
	remake(&fake, &config);
	assert_int_equal(ask(&fake, &plc, DB_CMD_CLEAR_FAULT).result, DB_RESULT_UNSUPPORTED);
	run(&fake, &plc, DB_CMD_MOVE_CURRENT);
	fake.now += WATCHDOG_MS * MS;
	assert_true(db_commander_expire(fake.commander, fake.now));
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(db_commander_write(fake.commander, &plc, &staged,
	                                    (struct db_write_token){ 1, 1 }, fake.now)
	                         .result,
	                 DB_RESULT_UNSUPPORTED);
	assert_true(look(&fake).latched);
	assert_int_equal(ask(&fake, &plc, DB_CMD_CLEAR_FAULT).result, DB_RESULT_OK);
	assert_false(look(&fake).latched);
	drop(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(commands_are_signs_of_life_of_who_commands),
		cmocka_unit_test(what_cannot_be_done_now_is_a_request_all_the_same),
		cmocka_unit_test(a_repeated_id_is_a_sign_of_life_of_who_commands),
		cmocka_unit_test(a_first_id_tells_who_commands_a_drive_found_moving),
		cmocka_unit_test(a_drive_at_rest_is_not_stopped_for_a_session_that_left),
		cmocka_unit_test(one_that_may_not_be_at_rest_is),
		cmocka_unit_test(so_is_one_that_is_kept_within_its_limits),
		cmocka_unit_test(a_plc_that_left_is_missed_at_rest_as_well),
		cmocka_unit_test(a_second_cause_repeats_the_stop),
		cmocka_unit_test(a_disable_among_stops_wins),
		cmocka_unit_test(the_end_of_all_holds_stops_at_once),
		cmocka_unit_test(a_stop_is_owed_until_it_has_ended),
		cmocka_unit_test(commands_of_others_are_none),
		cmocka_unit_test(a_motion_takes_the_place_of_a_stop_without_room),
		cmocka_unit_test(a_lost_hold_begins_with_another_counter),
		cmocka_unit_test(what_is_held_is_held_to_its_end),
		cmocka_unit_test(a_cleared_latch_of_a_standing_drive_watches_nobody),
		cmocka_unit_test(a_latch_is_cleared_at_once_or_not_at_all),
	};

	return cmocka_run_group_tests_name("axis/guard", tests, NULL, NULL);
}
