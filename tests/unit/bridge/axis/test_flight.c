/* SPDX-License-Identifier: Apache-2.0 */
/* The requests that the bus has: how many, whose, how long they are waited for, and what a stop does with them. */
#include "commander_world.h"

/* --- time ------------------------------------------------------------------------------------- */

/* At once would be without the proof that may come in time, and at the end of confirm-ms too late. */
static void an_acknowledged_parameter_is_a_success_before_confirm_ms_is_over(void **state)
{
	const struct db_setting setting = { .param = 0, .value.u = 3 };
	FAKE(false);

	fake.taken = true;
	for (unsigned i = 0; i < 2; i++) {
		db_time end = fake.now + 40 * MS;

		assert_int_equal(
			db_exception_of_answer(set(fake.commander, fake.client, &setting, 1,
		                                   (struct db_write_token){ 1, i }, fake.now)),
			DB_WRITE_LATER);
		assert_int_equal(db_commander_next_deadline(fake.commander), end - 5 * MS);
		fake.now = end - 5 * MS - 1;
		db_commander_expire(fake.commander, fake.now);
		assert_int_equal(fake.answered, i);
		fake.now = end - 5 * MS;
		db_commander_expire(fake.commander, fake.now);
		assert_int_equal(fake.answered, 1);
		if (!fake.taken)
			assert_int_equal(db_commander_next_deadline(fake.commander), end);
		fake.now = end;
		db_commander_expire(fake.commander, fake.now);
		assert_int_equal(fake.answered, i + 1);
		/* The second one the drive has not acknowledged. */
		fake.taken = false;
	}
	assert_int_equal(fake.answered_with[0], 0);
	assert_int_equal(fake.answered_with[1], LATER);
	drop(&fake);
}

static void late_confirmation_is_answered_05(void **state)
{
	FAKE(false);
	assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME_STOP, 0), DB_WRITE_LATER);
	assert_true(db_commander_next_deadline(fake.commander) == fake.now + 40 * MS);
	fake.now += 40 * MS - 1;
	db_commander_expire(fake.commander, fake.now);
	assert_int_equal(fake.answered, 0);
	fake.now += 1;
	db_commander_expire(fake.commander, fake.now);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with[0], LATER);
	assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
	assert_int_equal(look(&fake).results.result, DB_RESULT_PENDING);
	assert_true(look(&fake).busy);
	assert_int_equal(look(&fake).active_command, DB_CMD_HOME_STOP);
	fake.now += 20 * MS;
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result_time_us, 60000);
	assert_false(look(&fake).busy);
	assert_int_equal(look(&fake).active_command, DB_CMD_NONE);
	drop(&fake);
}

static void accepted_writes_do_not_wait(void **state)
{
	FAKE(true);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), 0);
	assert_int_equal(look(&fake).results.result, DB_RESULT_PENDING);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), 0);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(look(&fake).results.result, DB_RESULT_REFUSED);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), 0);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.answered, 0);
	assert_int_equal(put(&fake, 0, 63, 0), ILLEGAL_VALUE);
	drop(&fake);
}

/* --- several at once -------------------------------------------------------------------------- */

static void the_queue_is_bounded(void **state)
{
	FAKE(false);
	for (unsigned i = 0; i < DB_COMMANDER_PENDING; i++)
		assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), BUSY);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 1), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), DB_WRITE_LATER);
	drop(&fake);
}

/* A bus takes so many requests, whichever of its drives they are for; room for a drive's stops is its own. */
static void drives_of_a_bus_share_its_room(void **state)
{
	struct db_commander *first;
	struct db_commander_config config;

	FAKE(false);
	db_commander_free(fake.commander);
	fake.bus.queue = DB_COMMANDER_PENDING + 4;
	config = config_of(&fake);
	assert_int_equal(db_commander_new(&config, &ops, &fake, &first), 0);
	config.drive = 8;
	assert_int_equal(db_commander_new(&config, &ops, &fake, &fake.commander), 0);
	for (unsigned i = 0; i < 4; i++)
		assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), DB_WRITE_LATER);
	swap(&fake, &first);
	for (unsigned i = 0; i < DB_COMMANDER_PENDING; i++)
		assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), BUSY);
	swap(&fake, &first);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), BUSY);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(look(&fake).active_command, DB_CMD_MOVE_RELATIVE);
	/* When the bus has ended the requests of one that is removed, all of it is the other's. */
	db_commander_free(first);
	for (size_t i = 0; i < REQUESTS; i++) {
		if (fake.places[i].request.drive == 7)
			fake_release(&fake, &fake.places[i].request);
	}
	for (unsigned i = 4; i < DB_COMMANDER_PENDING; i++)
		assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), BUSY);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1), DB_WRITE_LATER);
	drop(&fake);
}

/* The drive was changed meanwhile: nobody waits, but its place at the bus is wanted. */
static void a_completion_that_nobody_awaits_frees_its_place(void **state)
{
	struct db_commander_config config;

	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	config = config_of(&fake);
	remake(&fake, &config);
	finish(&fake, 0, DB_RESULT_OK);
	for (size_t i = 0; i < REQUESTS; i++)
		assert_false(fake.places[i].used);
	assert_int_equal(fake.answered, 0);
	drop(&fake);
}

/* Each is told that nothing comes of it, and nothing is waited for any more. */
static void a_drive_that_is_removed_answers_all_who_wait(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	db_commander_dismiss(fake.commander);
	assert_int_equal(fake.answered, 3);
	for (unsigned i = 0; i < 3; i++)
		assert_int_equal(fake.answered_with[i], FAILURE);
	assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
	drop(&fake);
}

/* --- stops ------------------------------------------------------------------------------------ */

static void stop_of_an_offline_drive_is_queued(void **state)
{
	FAKE(false);
	set_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	fake.now += 40 * MS;
	db_commander_expire(fake.commander, fake.now);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with[0], NO_ANSWER);
	assert_int_equal(look(&fake).results.result, DB_RESULT_PENDING);
	drop(&fake);
}

/* The drive must stand when the bus is back; until then its writer learns that it is down. */
static void stop_is_kept_while_the_bus_is_down(void **state)
{
	FAKE(false);
	set_status(&fake, 0);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	fake.now += 40 * MS;
	db_commander_expire(fake.commander, fake.now);
	assert_int_equal(fake.answered, 1);
	assert_int_equal(fake.answered_with[0], NO_PATH);
	drop(&fake);
}

/* Who waits for the end of the motion is not told that it came there. */
static void a_motion_that_was_taken_before_the_stop_is_cancelled(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_ABSOLUTE, 5), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(entry_of(&fake, 1).result, DB_RESULT_CANCELLED);
	assert_int_equal(db_commander_outcome(fake.commander, entry_of(&fake, 1).sequence),
	                 DB_RESULT_CANCELLED);
	drop(&fake);
}

/* Somebody else's stop went past it. */
static void a_motion_that_came_before_the_stop_does_not_begin(void **state)
{
	const struct db_args args = { .target_velocity = 100.0f };
	struct db_client late = { .id = 9, .address = { [15] = 9 } };
	struct db_write_answer answer;

	FAKE(false);
	fake.now += 10 * MS;
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	late.arrived = fake.now - 1;
	answer = execute(fake.commander, &late, DB_CMD_MOVE_VELOCITY, &args,
	                 (struct db_write_token){ .client = 9 }, fake.now + MS);
	assert_false(answer.later);
	assert_int_equal(answer.result, DB_RESULT_CANCELLED);
	assert_int_equal(fake.submitted, 1);
	/* What does not move is carried out, and so is what came after it. */
	assert_true(execute(fake.commander, &late, DB_CMD_ENABLE, &args,
	                    (struct db_write_token){ .client = 9 }, fake.now + MS)
	                    .later);
	late.arrived = fake.now;
	assert_true(execute(fake.commander, &late, DB_CMD_MOVE_VELOCITY, &args,
	                    (struct db_write_token){ .client = 9 }, fake.now + MS)
	                    .later);
	drop(&fake);
}

/* As of a stop by a client: what was asked for before it does not begin after it. */
static void a_motion_from_before_a_stop_at_a_limit_does_not_begin(void **state)
{
	const struct db_args args = { .target_velocity = 10.0f };
	struct db_client late = { .id = 9, .address = { [15] = 9 } };

	FAKE(false);
	fake.drive.max_position = 100.0;
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	late.arrived = fake.now;
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 994);
	let_pass(&fake, 50 * MS);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].cause, DB_STAND_LIMIT);
	assert_int_equal(execute(fake.commander, &late, DB_CMD_MOVE_VELOCITY, &args,
	                         (struct db_write_token){ .client = 9 }, fake.now)
	                         .result,
	                 DB_RESULT_CANCELLED);
	late.arrived = fake.now;
	assert_true(execute(fake.commander, &late, DB_CMD_MOVE_VELOCITY, &args,
	                    (struct db_write_token){ .client = 9 }, fake.now)
	                    .later);
	drop(&fake);
}

static unsigned pending_of(const struct fake *fake, unsigned ended, enum db_command command)
{
	unsigned count = 0;

	for (unsigned i = ended; i < fake->submitted; i++)
		count += fake->requests[i].command == command;
	return count;
}

/* However many are asked for, in whatever turns, while the drive is silent. */
static void a_stop_is_never_answered_busy(void **state)
{
	static const enum db_command stops[] = { DB_CMD_STOP, DB_CMD_DISABLE, DB_CMD_QUICK_STOP };

	FAKE(false);
	for (unsigned i = 0; i < 300; i++) {
		int answer = put(&fake, 0, stops[i % 7 % 3], 0);

		/* 05: it is on its way, though its writer does not wait. */
		assert_true(answer == DB_WRITE_LATER || answer == LATER);
	}
	for (unsigned i = 0; i < 3; i++)
		assert_in_range(pending_of(&fake, 0, stops[i]), 1, DB_COMMANDER_STOPS_OF_A_KIND);
	for (unsigned i = 0; i < fake.submitted; i++)
		finish(&fake, i, DB_RESULT_OK);
	assert_int_equal(look(&fake).active_command, DB_CMD_NONE);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	/* Every writer was answered, once. */
	for (unsigned i = 0; i < fake.answered; i++) {
		assert_int_equal(fake.answered_with[i], 0);
		for (unsigned j = 0; j < i; j++)
			assert_int_not_equal(fake.answered_token[i], fake.answered_token[j]);
	}
	drop(&fake);
}

/* What was asked for in between is behind the older stop, so it goes to the bus once more; who waits
 * for the older one waits for the younger one. */
static void a_younger_stop_takes_the_place_of_the_older_one(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	finish(&fake, 0, DB_RESULT_CANCELLED);
	assert_int_equal(fake.answered, 0);
	assert_int_equal(look(&fake).results.result, DB_RESULT_PENDING);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(fake.answered, 2);
	assert_int_equal(fake.answered_token[0], 1);
	assert_int_equal(fake.answered_with[0], 0);
	assert_int_equal(fake.answered_token[1], 3);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	drop(&fake);
}

/* With two of its kind on their way a third one follows as soon as the second ended. */
static void a_stop_without_a_place_is_said_again(void **state)
{
	FAKE(false);
	for (unsigned i = 0; i < 2; i++) {
		assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
		assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	}
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	/* What comes behind it would get before it. */
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), BUSY);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 2);
	assert_int_equal(db_commander_newest(fake.commander), fake.requests[2].ticket);
	/* When it ends, no command that waits for the bus may begin. */
	assert_false(atomic_load(&fake.places[0].request.stop_follows));
	assert_true(atomic_load(&fake.places[2].request.stop_follows));
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 3);
	assert_int_equal(fake.requests[fake.submitted - 1].command, DB_CMD_STOP);
	/* One that comes now joins it: nothing is behind it. */
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 3);
	finish(&fake, fake.submitted - 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 4);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	drop(&fake);
}

/* The controller may have answered the first one, and another axis may have begun to move since. */
static void a_second_stop_of_a_controller_is_sent(void **state)
{
	struct db_driver controller = driver;
	struct db_commander_config config;
	struct db_commander *other;

	FAKE(false);
	controller.axes = 4;
	config = config_of(&fake);
	config.driver = &controller;
	assert_int_equal(db_commander_new(&config, &ops, &fake, &other), 0);
	swap(&fake, &other);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 2);
	/* A third one follows when the second has ended, and a fourth one with it. */
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 2);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 0);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 3);
	finish(&fake, fake.submitted - 1, DB_RESULT_OK);
	assert_int_equal(fake.answered, 4);
	swap(&fake, &other);
	db_commander_free(other);
	drop(&fake);
}

/* ... and, should the bus not take it, until it does. */
static void a_stop_said_again_is_not_lost(void **state)
{
	FAKE(false);
	for (unsigned i = 0; i < 2; i++) {
		assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
		assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	}
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	fake.full = true;
	finish(&fake, 2, DB_RESULT_OK);
	fake.now += 5 * MS;
	db_commander_expire(fake.commander, fake.now);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 2);
	fake.full = false;
	assert_true(db_commander_next_deadline(fake.commander) <= fake.now + 5 * MS);
	fake.now += 5 * MS;
	db_commander_expire(fake.commander, fake.now);
	assert_int_equal(pending_of(&fake, 0, DB_CMD_STOP), 3);
	drop(&fake);
}

/* The write of the third one ends as that one does, not as the one before it. */
static void a_write_ends_as_the_stop_said_again(void **state)
{
	FAKE(false);
	for (unsigned i = 0; i < 2; i++) {
		assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
		assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	}
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result, DB_RESULT_PENDING);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_PENDING);
	finish(&fake, fake.submitted - 1, DB_RESULT_INDETERMINATE);
	assert_int_equal(look(&fake).results.result, DB_RESULT_INDETERMINATE);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_INDETERMINATE);
	drop(&fake);
}

/* The bus keeps what the drive must stand for, and goes on with it. */
static void a_refused_reaction_is_handed_over_once(void **state)
{
	struct fake fake;

	(void)state;
	init_with(&fake, false, 1000, false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	let_pass(&fake, 1000 * MS);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[1].cause, DB_STAND_WATCHDOG);
	finish(&fake, 1, DB_RESULT_REFUSED);
	let_pass(&fake, 1000 * MS);
	assert_int_equal(fake.submitted, 2);
	/* One entry, and the motion's. */
	assert_int_equal(entry_of(&fake, 0).sequence, 2);
	drop(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_acknowledged_parameter_is_a_success_before_confirm_ms_is_over),
		cmocka_unit_test(late_confirmation_is_answered_05),
		cmocka_unit_test(accepted_writes_do_not_wait),
		cmocka_unit_test(the_queue_is_bounded),
		cmocka_unit_test(drives_of_a_bus_share_its_room),
		cmocka_unit_test(a_completion_that_nobody_awaits_frees_its_place),
		cmocka_unit_test(a_drive_that_is_removed_answers_all_who_wait),
		cmocka_unit_test(stop_of_an_offline_drive_is_queued),
		cmocka_unit_test(stop_is_kept_while_the_bus_is_down),
		cmocka_unit_test(a_motion_that_was_taken_before_the_stop_is_cancelled),
		cmocka_unit_test(a_motion_that_came_before_the_stop_does_not_begin),
		cmocka_unit_test(a_motion_from_before_a_stop_at_a_limit_does_not_begin),
		cmocka_unit_test(a_stop_is_never_answered_busy),
		cmocka_unit_test(a_younger_stop_takes_the_place_of_the_older_one),
		cmocka_unit_test(a_stop_without_a_place_is_said_again),
		cmocka_unit_test(a_second_stop_of_a_controller_is_sent),
		cmocka_unit_test(a_stop_said_again_is_not_lost),
		cmocka_unit_test(a_write_ends_as_the_stop_said_again),
		cmocka_unit_test(a_refused_reaction_is_handed_over_once),
	};

	return cmocka_run_group_tests_name("flight", tests, NULL, NULL);
}
