/* SPDX-License-Identifier: Apache-2.0 */
#include "commander_world.h"

#include "fakes/nameplate.h"

#include <stdlib.h>

/* --- ids ------------------------------------------------------------------------------------------------ */

static void id_0_executes_each_time(void **state)
{
	FAKE(false);
	for (unsigned i = 0; i < 3; i++) {
		assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
		assert_int_equal(fake.submitted, i + 1);
		finish(&fake, i, DB_RESULT_OK);
		assert_int_equal(fake.answered, i + 1);
		assert_int_equal(fake.answered_with[i], 0);
	}
	assert_int_equal(fake.requests[0].drive, 7);
	assert_int_equal(fake.requests[0].command, DB_CMD_MOVE_RELATIVE);
	assert_int_equal(fake.requests[0].args->target_position, 5);
	assert_int_equal(fake.requests[0].setting_count, 0);
	assert_int_equal(fake.requests[0].submitted, fake.now);
	assert_int_not_equal(fake.requests[0].ticket, fake.requests[1].ticket);
	assert_int_equal(fake.requests[0].drive, 7);
	drop(&fake);
}

static void first_id_is_only_the_baseline(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_RELATIVE, 5), FAILURE);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(look(&fake).results.result, DB_RESULT_RESTARTED);
	assert_int_equal(look(&fake).results.result_id, 9);
	assert_int_equal(look(&fake).results.result_command, DB_CMD_MOVE_RELATIVE);
	/* The scanner goes on writing it. */
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_RELATIVE, 5), FAILURE);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(put(&fake, 10, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

static void id_0_leaves_the_baseline_open(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 1, DB_CMD_MOVE_RELATIVE, 5), FAILURE);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

static void stops_execute_before_the_baseline(void **state)
{
	static const enum db_command stops[] = { DB_CMD_STOP, DB_CMD_QUICK_STOP, DB_CMD_DISABLE };

	for (size_t i = 0; i < 3; i++) {
		FAKE(false);
		assert_int_equal(put(&fake, 9, stops[i], 0), DB_WRITE_LATER);
		assert_int_equal(fake.submitted, 1);
		finish(&fake, 0, DB_RESULT_OK);
		/* Its id is the baseline. */
		assert_int_equal(put(&fake, 9, DB_CMD_MOVE_RELATIVE, 5), 0);
		assert_int_equal(fake.submitted, 1);
		assert_int_equal(put(&fake, 10, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
		drop(&fake);
	}
}

static void same_id_gets_the_stored_result(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_RELATIVE, 5), 0);
	assert_int_equal(put(&fake, 3, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(put(&fake, 3, DB_CMD_MOVE_RELATIVE, 5), FAILURE);
	assert_int_equal(put(&fake, 4, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_INDETERMINATE);
	assert_int_equal(put(&fake, 4, DB_CMD_MOVE_RELATIVE, 5), NO_ANSWER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

/* Success to the writer, and a motion that is followed; whose end then is the proof. */
static void unproven_is_a_success(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_UNPROVEN);
	assert_int_equal(fake.answered_with[0], 0);
	assert_int_equal(look(&fake).results.result, DB_RESULT_UNPROVEN);
	assert_int_equal(look(&fake).results.motion_id, 2);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_VELOCITY, 0), 0);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_UNPROVEN);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

static void same_id_while_pending_waits_with_the_first(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	for (unsigned i = 0; i < DB_REQUEST_WAITERS; i++)
		assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), LATER);
	assert_int_equal(fake.submitted, 1);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, DB_REQUEST_WAITERS);
	for (unsigned i = 0; i < DB_REQUEST_WAITERS; i++)
		assert_int_equal(fake.answered_with[i], 0);
	drop(&fake);
}

/* A write of `command` alone that comes again, after the drive refused it: refused again, whatever an
 * older id was answered. */
static void a_bare_repeat_gets_its_own_result(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), DB_WRITE_LATER);
	/* While it is under way, together with it. */
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(fake.answered, 3);
	assert_int_equal(fake.answered_with[2], FAILURE);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), FAILURE);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_REFUSED);
	assert_int_equal(fake.submitted, 2);
	/* The id's own result is still there. */
	assert_int_equal(put(&fake, 2, DB_CMD_ENABLE, 0), 0);
	/* Another one executes, and its outcome is the next repeat's. */
	assert_int_equal(write_as(&fake, 0, DB_CMD_HOME, 0, false), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(write_as(&fake, 0, DB_CMD_HOME, 0, false), 0);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static void stored_result_survives_commands_without_id(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_FAILED);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_RELATIVE, 5), FAILURE);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

static void stops_execute_under_a_used_id(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	for (unsigned i = 0; i < 3; i++) {
		assert_int_equal(put(&fake, 5, DB_CMD_STOP, 0), DB_WRITE_LATER);
		assert_int_equal(fake.submitted, i + 1);
		finish(&fake, i, DB_RESULT_OK);
	}
	drop(&fake);
}

static void repeated_stop_joins_the_pending_one(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 5, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 5, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 6, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 1);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(fake.answered, 3);
	assert_int_equal(look(&fake).results.result_id, 6);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	drop(&fake);
}

static void stop_after_a_later_command_is_a_new_one(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(put(&fake, 0, DB_CMD_QUICK_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 4);
	drop(&fake);
}

/* --- writing the command alone ---------------------------------------------------------------------------- */

static void arguments_alone_execute_nothing(void **state)
{
	struct db_command_write write = { .block = { .command_id = 7,
		                                     .command = DB_CMD_HOME,
		                                     .args = { .target_position = 3 } } };
	struct db_write_token token = { 1, 1 };

	FAKE(false);
	assert_int_equal(db_exception_of_answer(db_commander_write(fake.commander, fake.client,
	                                                           &write, token, fake.now)),
	                 0);
	assert_int_equal(db_commander_kept(fake.commander, fake.client).args.target_position, 3);
	write.has_command = true;
	write.has_id = true;
	write.block.command = DB_CMD_NONE;
	assert_int_equal(db_exception_of_answer(db_commander_write(fake.commander, fake.client,
	                                                           &write, token, fake.now)),
	                 0);
	assert_int_equal(fake.submitted, 0);
	assert_int_equal(look(&fake).results.result, DB_RESULT_NONE);
	drop(&fake);
}

static void command_alone_uses_an_unused_kept_id(void **state)
{
	struct db_command_write write = { .block = { .command_id = 7 }, .has_id = true };
	struct db_write_token token = { 1, 1 };

	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(db_exception_of_answer(db_commander_write(fake.commander, fake.client,
	                                                           &write, token, fake.now)),
	                 0);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), DB_WRITE_LATER);
	assert_int_equal(look(&fake).results.result_id, 7);
	finish(&fake, 0, DB_RESULT_OK);
	/* The same again is the same request sent again ... */
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), 0);
	assert_int_equal(fake.submitted, 1);
	/* ... and another one is a command without id. */
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 6, false), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(look(&fake).results.result_id, 0);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(write_as(&fake, 0, DB_CMD_HOME, 6, false), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static void command_alone_without_id_executes_each_time(void **state)
{
	FAKE(false);
	for (unsigned i = 0; i < 2; i++) {
		assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false),
		                 DB_WRITE_LATER);
		finish(&fake, i, DB_RESULT_OK);
	}
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

static void arguments_a_command_does_not_use_make_no_difference(void **state)
{
	struct db_command_write write = { .has_command = true };
	struct db_write_token token = { 1, 1 };

	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	write.block = db_commander_kept(fake.commander, fake.client);
	write.block.args.shake_cycles = 99;
	assert_int_equal(db_exception_of_answer(db_commander_write(fake.commander, fake.client,
	                                                           &write, token, fake.now)),
	                 0);
	assert_int_equal(fake.submitted, 1);
	write.block.args.target_velocity = 99;
	assert_int_equal(db_exception_of_answer(db_commander_write(fake.commander, fake.client,
	                                                           &write, token, fake.now)),
	                 DB_WRITE_LATER);
	drop(&fake);
}

/* --- refusals ---------------------------------------------------------------------------------------------- */

static void refused_writes_store_nothing(void **state)
{
	struct db_command_block kept;
	struct db_command_block again;

	FAKE(false);
	kept = db_commander_kept(fake.commander, fake.client);
	assert_int_equal(put(&fake, 0, 63, 5), ILLEGAL_VALUE);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(look(&fake).results.result_command, 63);
	assert_int_equal(put(&fake, 0, 40000, 5), ILLEGAL_VALUE);
	assert_int_equal(put(&fake, 0, DB_CMD_SET_SV, 5), ILLEGAL_FUNCTION);
	assert_int_equal(look(&fake).results.result, DB_RESULT_UNSUPPORTED);
	pass_baseline(&fake, 4);
	fake.full = true;
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 5), BUSY);
	again = db_commander_kept(fake.commander, fake.client);
	assert_memory_equal(&kept, &again, sizeof kept);
	assert_int_equal(fake.submitted, 0);
	drop(&fake);
}

static void out_of_range_arguments(void **state)
{
	struct db_command_write write = {
		.block = { .command = DB_CMD_MOVE_VELOCITY,
		           .args = { .target_velocity = 1001.0f } },
		.has_command = true,
	};
	struct db_write_token token = { 1, 1 };

	FAKE(false);
	assert_int_equal(db_exception_of_answer(db_commander_write(fake.commander, fake.client,
	                                                           &write, token, fake.now)),
	                 ILLEGAL_VALUE);
	assert_true(db_commander_kept(fake.commander, fake.client).args.target_velocity == 0.0f);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_OUT_OF_RANGE);
	drop(&fake);
}

static void busy_does_not_use_the_id_up(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.full = true;
	assert_int_equal(put(&fake, 3, DB_CMD_MOVE_RELATIVE, 5), BUSY);
	assert_int_equal(look(&fake).results.result, DB_RESULT_BUSY);
	fake.full = false;
	/* Nor does it make the one before new again. */
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), 0);
	assert_int_equal(put(&fake, 3, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

static void busy_of_the_bus_does_not_either(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 3, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_BUSY);
	assert_int_equal(fake.answered_with[1], BUSY);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), 0);
	assert_int_equal(put(&fake, 3, DB_CMD_MOVE_RELATIVE, 5), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static void two_busy_of_the_bus_do_not_lock_an_id(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 3, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_BUSY);
	finish(&fake, 1, DB_RESULT_BUSY);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static void offline_and_bus_down(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	set_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), NO_ANSWER);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OFFLINE);
	set_status(&fake, 0);
	assert_int_equal(put(&fake, 3, DB_CMD_HOME, 0), NO_PATH);
	assert_int_equal(look(&fake).results.result, DB_RESULT_BUS_DOWN);
	/* The id is used up: a client that sends again does not start a move much later. */
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	assert_int_equal(put(&fake, 3, DB_CMD_HOME, 0), NO_PATH);
	assert_int_equal(fake.submitted, 0);
	drop(&fake);
}

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

/* --- time -------------------------------------------------------------------------------------------------- */

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

/* --- several at once ------------------------------------------------------------------------------------------ */

static void old_completions_do_not_overwrite_newer_results(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 3, DB_CMD_SET_POSITION, 5), DB_WRITE_LATER);
	assert_int_equal(look(&fake).active_command, DB_CMD_HOME);
	finish(&fake, 0, DB_RESULT_CANCELLED);
	assert_int_equal(look(&fake).results.result, DB_RESULT_PENDING);
	assert_int_equal(look(&fake).results.result_id, 3);
	assert_int_equal(look(&fake).active_command, DB_CMD_SET_POSITION);
	assert_int_equal(fake.answered_token[0], 2);
	assert_int_equal(fake.answered_with[0], FAILURE);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	/* Once more the same completion: no one is there any more. */
	finish(&fake, 1, DB_RESULT_FAILED);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_int_equal(fake.answered, 2);
	drop(&fake);
}

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

/* --- parameters and coils -------------------------------------------------------------------------------------- */

static void parameters_are_one_request(void **state)
{
	struct db_setting settings[] = { { 4, { .f = 2.5f } }, { 5, { .u = 7 } } };
	struct db_write_token token = { 1, 77 };

	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(db_exception_of_answer(
				 set(fake.commander, fake.client, settings, 2, token, fake.now)),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.requests[1].command, DB_CMD_NONE);
	assert_int_equal(fake.requests[1].setting_count, 2);
	assert_int_equal(fake.requests[1].settings[1].param, 5);
	assert_int_equal(fake.requests[1].settings[1].value.u, 7);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_PENDING);
	assert_int_equal(look(&fake).active_command, DB_CMD_NONE);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_REFUSED);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_int_equal(fake.answered_token[1], 77);
	assert_int_equal(fake.answered_with[1], FAILURE);
	set_status(&fake, DB_STATUS_BUS_UP);
	assert_int_equal(db_exception_of_answer(
				 set(fake.commander, fake.client, settings, 2, token, fake.now)),
	                 NO_ANSWER);
	set_status(&fake, 0);
	assert_int_equal(db_exception_of_answer(
				 set(fake.commander, fake.client, settings, 2, token, fake.now)),
	                 NO_PATH);
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	fake.full = true;
	assert_int_equal(db_exception_of_answer(
				 set(fake.commander, fake.client, settings, 2, token, fake.now)),
	                 BUSY);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_BUSY);
	drop(&fake);
}

static void outside_commands_leave_the_block_alone(void **state)
{
	struct db_args args = { .output_mask = 1, .output_levels = 1 };
	struct db_write_token token = { 1, 5 };

	FAKE(false);
	for (unsigned i = 0; i < 2; i++) {
		assert_int_equal(
			db_exception_of_answer(execute(fake.commander, fake.client,
		                                       DB_CMD_SET_OUTPUTS, &args, token, fake.now)),
			DB_WRITE_LATER);
		finish(&fake, i, DB_RESULT_OK);
	}
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(db_commander_kept(fake.commander, fake.client).args.output_mask, 0);
	assert_int_equal(db_commander_kept(fake.commander, fake.client).command, 0);
	drop(&fake);
}

/* --- what was going on at the start --------------------------------------------------------------- */

static void a_drive_found_moving_is_watched(void **state)
{
	struct fake fake;

	(void)state;
	init_with(&fake, false, 3000, false);
	set_status(&fake, DB_STATUS_BUS_UP);
	for (int i = 0; i < 5; i++)
		wake(&fake);
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_MOVING);
	wake(&fake);
	/* Nothing was sent: it goes on as long as its PLC is there. */
	assert_int_equal(fake.submitted, 0);
	assert_true(db_commander_next_deadline(fake.commander) == fake.now + 3000 * MS);
	fake.now += 2000 * MS;
	db_commander_feed(fake.commander, &(struct db_client){ .id = 1 }, DB_FEED_REQUESTS,
	                  fake.now);
	assert_true(db_commander_next_deadline(fake.commander) == fake.now + 3000 * MS);
	wake(&fake);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(fake.requests[0].command, DB_CMD_STOP);
	assert_true(look(&fake).latched);
	drop(&fake);
}

static void a_drive_found_standing_is_not(void **state)
{
	struct fake fake;

	(void)state;
	init_with(&fake, false, 3000, false);
	wake(&fake);
	assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
	/* What moves it later is not a leftover of the time before. */
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_MOVING);
	db_commander_expire(fake.commander, fake.now);
	assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
	drop(&fake);
}

/* Moves, and its clients fall silent. */
static void trip(struct fake *fake)
{
	init_with(fake, false, 3000, false);
	assert_int_equal(put(fake, 0, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	finish(fake, 0, DB_RESULT_OK);
	fake->now += 3000 * MS;
	db_commander_expire(fake->commander, fake->now);
	assert_int_equal(fake->submitted, 2);
	assert_true(look(fake).latched);
}

static void set_error(struct fake *fake, uint32_t status, enum db_error error)
{
	struct db_snapshot snapshot = {
		.feedback = { .status = status, .error = (uint16_t)error, .taken = 1 },
	};

	db_axis_publish(fake->axis, &snapshot);
}

static void a_drive_that_cannot_be_asked_stays_latched(void **state)
{
	struct fake fake;

	(void)state;
	trip(&fake);
	set_error(&fake, DB_STATUS_BUS_UP, DB_ERROR_NO_ANSWER);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), NO_ANSWER);
	assert_true(look(&fake).latched);
	/* Nor where it is the latch alone that could be cleared. */
	set_error(&fake, DB_STATUS_BUS_UP, DB_ERROR_NONE);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), NO_ANSWER);
	assert_true(look(&fake).latched);
	set_error(&fake, 0, DB_ERROR_BUS_DOWN);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), NO_PATH);
	assert_true(look(&fake).latched);
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), 0);
	assert_false(look(&fake).latched);
	drop(&fake);
}

/* Where the drive itself has a fault, too, the latch ends with that. */
static void the_latch_ends_when_the_drive_has_confirmed(void **state)
{
	struct fake fake;

	(void)state;
	trip(&fake);
	set_error(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE, DB_ERROR_HARDWARE);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), DB_WRITE_LATER);
	assert_true(look(&fake).latched);
	finish(&fake, 2, DB_RESULT_TIMEOUT);
	assert_true(look(&fake).latched);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), DB_WRITE_LATER);
	finish(&fake, 3, DB_RESULT_OK);
	assert_false(look(&fake).latched);
	drop(&fake);
}

/* One that was on its way before does not undo what came after. */
static void an_older_clear_fault_ends_no_latch(void **state)
{
	struct fake fake;

	(void)state;
	init_with(&fake, false, 3000, false);
	set_error(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE, DB_ERROR_HARDWARE);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), DB_WRITE_LATER);
	fake.now += 3000 * MS;
	db_commander_expire(fake.commander, fake.now);
	assert_true(look(&fake).latched);
	finish(&fake, 1, DB_RESULT_OK);
	assert_true(look(&fake).latched);
	drop(&fake);
}

static void what_moves_behind_the_latch_is_watched_again(void **state)
{
	struct fake fake;

	(void)state;
	trip(&fake);
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_MOVING);
	assert_int_equal(put(&fake, 0, DB_CMD_CLEAR_FAULT, 0), 0);
	assert_true(look(&fake).watchdog_remaining_ms > 0);
	/* The watchdog's older stop is not confirmed yet: it is said again. */
	fake.now += 3000 * MS;
	db_commander_expire(fake.commander, fake.now);
	assert_true(look(&fake).latched);
	assert_int_equal(fake.submitted, 2);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(fake.requests[2].command, DB_CMD_STOP);
	drop(&fake);
}

/* --- motions that are held ------------------------------------------------------------------------------------ */

#define HOLDER ((struct db_client){ .id = DB_CLIENT_FIRST_SESSION + 5 })
#define SOMEBODY ((struct db_client){ .id = 3 })

static struct db_write_answer run(struct fake *fake, const struct db_client *client,
                                  enum db_command command, uint32_t hold_ms)
{
	return execute_held(fake->commander, client, command, &(struct db_args){ 0 }, hold_ms,
	                    (struct db_write_token){ client->id, ++fake->next_token }, fake->now);
}

/* The drive moves at the will of HOLDER, for 300 ms from now on; request 0. */
static void hold(struct fake *fake, enum db_command on_client_loss)
{
	struct db_commander_config config;

	init_with(fake, false, 0, false);
	config = config_of(fake);
	config.on_client_loss = on_client_loss;
	db_commander_free(fake->commander);
	assert_int_equal(db_commander_new(&config, &ops, fake, &fake->commander), 0);
	assert_true(run(fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
	finish(fake, 0, DB_RESULT_OK);
	set_status(fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_MOVING);
}

static bool beat(struct fake *fake)
{
	return db_commander_beat(fake->commander, &HOLDER, fake->now);
}

static void pass(struct fake *fake, unsigned ms)
{
	fake->now += ms * MS;
	assert_false(db_commander_expire(fake->commander, fake->now));
}

static void a_missing_beat_stops_without_a_watchdog(void **state)
{
	static const enum db_command reactions[][2] = {
		{ DB_CMD_NONE, DB_CMD_STOP },
		{ DB_CMD_STOP, DB_CMD_STOP },
		{ DB_CMD_QUICK_STOP, DB_CMD_QUICK_STOP },
		{ DB_CMD_DISABLE, DB_CMD_DISABLE },
	};
	struct fake fake;

	(void)state;
	for (size_t i = 0; i < 4; i++) {
		hold(&fake, reactions[i][0]);
		for (unsigned beats = 0; beats < 10; beats++) {
			pass(&fake, 299);
			assert_true(beat(&fake));
		}
		assert_int_equal(fake.submitted, 1);
		assert_true(db_commander_next_deadline(fake.commander) == fake.now + 300 * MS);
		pass(&fake, 300);
		assert_int_equal(fake.submitted, 2);
		assert_int_equal(fake.requests[1].command, reactions[i][1]);
		assert_int_equal(fake.requests[1].cause, DB_STAND_HOLD);
		assert_int_equal(fake.holds_lost, 1);
		assert_int_equal(fake.lost_holder, HOLDER.id);
		assert_false(fake.lost_by_leaving);
		assert_false(beat(&fake));
		/* Nothing is latched, and nothing is sent on. */
		finish(&fake, 1, DB_RESULT_OK);
		assert_false(look(&fake).latched);
		assert_int_equal(look(&fake).watchdog_trips, 0);
		assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
		assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
		assert_true(beat(&fake));
		drop(&fake);
	}
}

static void a_holder_that_goes_stops_it_at_once(void **state)
{
	struct fake fake;

	(void)state;
	hold(&fake, DB_CMD_NONE);
	db_commander_forget(fake.commander, &SOMEBODY, fake.now);
	pass(&fake, 0);
	assert_int_equal(fake.submitted, 1);
	db_commander_forget(fake.commander, &HOLDER, fake.now);
	assert_true(db_commander_next_deadline(fake.commander) == fake.now);
	pass(&fake, 0);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_true(fake.lost_by_leaving);
	drop(&fake);
}

static void what_comes_after_a_lost_hold_comes_behind_its_stop(void **state)
{
	struct fake fake;

	(void)state;
	hold(&fake, DB_CMD_NONE);
	/* Nobody was served meanwhile, this program included. */
	fake.now += 400 * MS;
	assert_false(beat(&fake));
	assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
	assert_int_equal(fake.submitted, 3);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[2].command, DB_CMD_MOVE_VELOCITY);
	assert_int_equal(fake.holds_lost, 1);
	assert_true(beat(&fake));
	drop(&fake);
}

static void any_stop_ends_a_hold(void **state)
{
	static const enum db_command stops[] = { DB_CMD_STOP, DB_CMD_QUICK_STOP, DB_CMD_DISABLE };
	struct fake fake;

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		hold(&fake, DB_CMD_NONE);
		assert_true(run(&fake, &SOMEBODY, stops[i], 0).later);
		assert_false(beat(&fake));
		pass(&fake, 1000);
		assert_int_equal(fake.submitted, 2);
		assert_int_equal(fake.holds_lost, 0);
		drop(&fake);
	}
}

static void another_motion_ends_a_hold_when_the_drive_has_taken_it(void **state)
{
	struct fake fake;

	(void)state;
	hold(&fake, DB_CMD_NONE);
	assert_true(run(&fake, &SOMEBODY, DB_CMD_MOVE_RELATIVE, 0).later);
	assert_true(beat(&fake));
	/* The one that is held goes on. */
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_true(beat(&fake));
	assert_true(run(&fake, &SOMEBODY, DB_CMD_MOVE_RELATIVE, 0).later);
	finish(&fake, 2, DB_RESULT_INDETERMINATE);
	assert_true(beat(&fake));
	assert_true(run(&fake, &SOMEBODY, DB_CMD_MOVE_RELATIVE, 0).later);
	finish(&fake, 3, DB_RESULT_OK);
	assert_false(beat(&fake));
	pass(&fake, 1000);
	assert_int_equal(fake.submitted, 4);
	drop(&fake);
}

/* A motion of before, whose end comes after the held one was commanded. */
static void an_older_motion_ends_no_hold(void **state)
{
	FAKE(false);
	assert_true(run(&fake, &SOMEBODY, DB_CMD_MOVE_RELATIVE, 0).later);
	assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
	finish(&fake, 0, DB_RESULT_OK);
	assert_true(beat(&fake));
	finish(&fake, 1, DB_RESULT_OK);
	assert_true(beat(&fake));
	drop(&fake);
}

static void what_never_began_is_not_held(void **state)
{
	FAKE(false);
	/* Somebody's motion goes on, and is not stopped for it. */
	assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
	assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_true(beat(&fake));
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_false(beat(&fake));
	pass(&fake, 1000);
	assert_int_equal(fake.submitted, 2);
	/* What may have begun is. */
	assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
	finish(&fake, 2, DB_RESULT_TIMEOUT);
	pass(&fake, 300);
	assert_int_equal(fake.submitted, 4);
	assert_int_equal(fake.requests[3].command, DB_CMD_STOP);
	drop(&fake);
}

static void another_speed_that_is_refused_leaves_the_hold(void **state)
{
	struct fake fake;

	(void)state;
	hold(&fake, DB_CMD_NONE);
	assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 300).later);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_true(beat(&fake));
	/* Somebody else takes the hold over with what is then refused: the motion of before is his to hold. */
	assert_true(run(&fake, &SOMEBODY, DB_CMD_MOVE_VELOCITY, 300).later);
	finish(&fake, 2, DB_RESULT_REFUSED);
	assert_false(beat(&fake));
	pass(&fake, 300);
	assert_int_equal(fake.submitted, 4);
	assert_int_equal(fake.lost_holder, SOMEBODY.id);
	drop(&fake);
}

static void a_stop_without_room_is_handed_over_later(void **state)
{
	struct fake fake;

	(void)state;
	hold(&fake, DB_CMD_QUICK_STOP);
	fake.full = true;
	pass(&fake, 300);
	assert_int_equal(fake.submitted, 1);
	fake.full = false;
	wake(&fake);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_QUICK_STOP);
	assert_int_equal(fake.requests[1].cause, DB_STAND_HOLD);
	drop(&fake);
}

static void the_watchdog_keeps_its_own_rule(void **state)
{
	struct fake fake;

	(void)state;
	init_with(&fake, false, 500, false);
	assert_true(run(&fake, &HOLDER, DB_CMD_MOVE_VELOCITY, 1000).later);
	finish(&fake, 0, DB_RESULT_OK);
	set_status(&fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE | DB_STATUS_MOVING);
	fake.now += 500 * MS;
	assert_true(beat(&fake));
	assert_true(db_commander_expire(fake.commander, fake.now));
	assert_int_equal(fake.requests[1].cause, DB_STAND_WATCHDOG);
	assert_int_equal(fake.holds_lost, 0);
	assert_false(beat(&fake));
	drop(&fake);
}

/* --- motions to their end ------------------------------------------------------------------------------------- */

static void result_follows_a_move_to_its_end(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	/* Its writer has his answer; the motion goes on. */
	assert_int_equal(fake.answered_with[0], 0);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_false(look(&fake).results.done);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_DISCRETE_MOTION, DB_STATUS_MOVING, 500);
	let_pass(&fake, 500 * MS);
	assert_false(look(&fake).results.done);
	/* The same id again: it was accepted, and nothing is sent. */
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_ABSOLUTE, 1000), 0);
	assert_int_equal(fake.submitted, 1);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 50 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_true(look(&fake).results.done);
	assert_false(look(&fake).results.aborted);
	assert_false(look(&fake).busy);
	assert_true(db_commander_next_deadline(fake.commander) == DB_TIME_NEVER);
	drop(&fake);
}

static void old_data_ends_no_move(void **state)
{
	FAKE(false);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_AT_TARGET, 1000);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	fake.now += MS;
	finish(&fake, 0, DB_RESULT_OK);
	let_pass(&fake, 1000 * MS);
	assert_false(look(&fake).results.done);
	drop(&fake);
}

static void a_move_that_stops_elsewhere_has_failed(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	let_pass(&fake, 190 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	let_pass(&fake, 60 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_false(look(&fake).results.done);
	drop(&fake);
}

/* The log says how near it came, so that somebody knows what to set. */
static void a_move_that_rests_beside_its_target_says_so(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 999);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	assert_true(fake.refused_write.off < -0.5 && fake.refused_write.off > -1.5);
	/* That far it was stopped by something. */
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	drop(&fake);
}

/* A bit that says "there" may be of the last target, or of the reference only. */
static void no_bit_ends_a_move_elsewhere(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_AT_TARGET, 0);
	let_pass(&fake, 250 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_false(look(&fake).results.done);
	drop(&fake);
}

static void a_new_command_aborts_the_motion(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 8, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_true(look(&fake).results.aborted);
	assert_int_equal(look(&fake).results.aborted_id, 7);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result_id, 8);
	assert_false(look(&fake).results.done);
	/* What moves nothing aborts nothing. */
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_false(look(&fake).results.aborted);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(put(&fake, 10, DB_CMD_READ_PARAMETERS, 0), DB_WRITE_LATER);
	assert_false(look(&fake).results.aborted);
	drop(&fake);
}

/* The drive turned the second one down: the first goes on, and its end is told. */
static void a_refused_motion_leaves_the_one_before(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_DISCRETE_MOTION, DB_STATUS_MOVING, 500);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_ABSOLUTE, 2000), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(look(&fake).results.result_id, 8);
	assert_int_equal(look(&fake).results.result, DB_RESULT_REFUSED);
	assert_false(look(&fake).results.aborted);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	/* `done` is about what was asked for last: who waits for id 8 must not take it for its own. */
	assert_false(look(&fake).results.done);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.result, DB_RESULT_REFUSED);
	drop(&fake);
}

static void a_motion_is_aborted_when_the_drive_takes_the_next(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_VELOCITY, 0), DB_WRITE_LATER);
	/* It would be there, but whether the next one has begun is open: nothing is said yet. */
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 300 * MS);
	assert_false(look(&fake).results.done);
	assert_int_equal(look(&fake).results.motion_id, 7);
	finish(&fake, 1, DB_RESULT_OK);
	assert_true(look(&fake).results.aborted);
	assert_int_equal(look(&fake).results.aborted_id, 7);
	assert_int_equal(look(&fake).results.motion_id, 8);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	/* Nobody knows whether this one moves it: then the one before is over. */
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_INDETERMINATE);
	assert_int_equal(look(&fake).results.motion_id, 8);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_CANCELLED);
	drop(&fake);
}

/* A stop was sent behind it: that it was begun in between is no motion that goes on. */
static void a_motion_that_a_stop_overtook_is_over(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 8, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_CANCELLED);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_false(look(&fake).results.done);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_CANCELLED);
	drop(&fake);
}

static void another_command_does_not_hide_the_end(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_SET_OUTPUT, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

static void a_shake_is_done_when_it_has_moved(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_SHAKE_START, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 0);
	let_pass(&fake, 50 * MS);
	assert_false(look(&fake).results.done);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 5);
	let_pass(&fake, 50 * MS);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 0);
	let_pass(&fake, 50 * MS);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

static void homing_ends_homed_or_failed(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_HOMING, 0, 5);
	let_pass(&fake, 100 * MS);
	assert_false(look(&fake).results.done);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_HOMED, 0);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_true(look(&fake).results.done);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 3);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	drop(&fake);
}

static void home_and_fail(struct fake *fake, unsigned request)
{
	assert_int_equal(put(fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(fake, request, DB_RESULT_OK);
	fake->now += MS;
	set_axis(fake, DB_AXIS_STANDSTILL, 0, 3);
	let_pass(fake, 100 * MS);
	assert_int_equal(look(fake).results.motion_result, DB_RESULT_FAILED);
	assert_int_equal(entry_of(fake, 0).result, DB_RESULT_FAILED);
}

/* It stood for long between two phases, and was not at its end. */
static void a_late_end_of_homing_corrects_its_result(void **state)
{
	FAKE(false);
	home_and_fail(&fake, 0);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 2);
	let_pass(&fake, 5000 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_FAILED);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_HOMED, 0);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_OK);
	assert_true(look(&fake).results.done);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_OK);
	/* One that was stopped since has not come to its end. */
	home_and_fail(&fake, 1);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	set_axis(&fake, DB_AXIS_STANDSTILL, DB_STATUS_HOMED, 0);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_FAILED);
	drop(&fake);
}

/* --- limits --------------------------------------------------------------------------------------------------- */

/* Ten counts a unit: -5..100 units, 20 units per second. The drive stands at 500 counts. */
static void a_speed_that_never_begins_has_failed_and_is_stopped(void **state)
{
	FAKE(false);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_UNPROVEN);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, 0, 3);
	let_pass(&fake, 900 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(fake.submitted, 1);
	let_pass(&fake, 200 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_FAILED);
	/* It may not begin any more. */
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(fake.requests[1].cause, DB_STAND_MOTION);
	assert_int_equal(entry_of(&fake, 1).result, DB_RESULT_FAILED);
	/* One that is seen to begin is left alone. */
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, DB_CMD_JOG_POSITIVE, 0), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_UNPROVEN);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 3);
	let_pass(&fake, 3000 * MS);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static void limits_at_the_door(void **state)
{
	static const struct {
		enum db_command command;
		int32_t position;
		float velocity;
		enum db_limit limit;
	} cases[] = {
		{ DB_CMD_MOVE_ABSOLUTE, 1000, 200.0f, DB_LIMIT_NONE },
		{ DB_CMD_MOVE_ABSOLUTE, 1001, 200.0f, DB_LIMIT_MAX_POSITION },
		{ DB_CMD_MOVE_ABSOLUTE, -50, 200.0f, DB_LIMIT_NONE },
		{ DB_CMD_MOVE_ABSOLUTE, -51, 200.0f, DB_LIMIT_MIN_POSITION },
		{ DB_CMD_MOVE_ABSOLUTE, 0, 200.5f, DB_LIMIT_MAX_VELOCITY },
		{ DB_CMD_MOVE_ABSOLUTE, 0, 0.0f, DB_LIMIT_MAX_VELOCITY }, /* unknown preset */
		{ DB_CMD_MOVE_RELATIVE, 500, 1.0f, DB_LIMIT_NONE },
		{ DB_CMD_MOVE_RELATIVE, 501, 1.0f, DB_LIMIT_MAX_POSITION },
		{ DB_CMD_MOVE_RELATIVE, -551, 1.0f, DB_LIMIT_MIN_POSITION },
		{ DB_CMD_MOVE_VELOCITY, 0, -200.0f, DB_LIMIT_NONE },
		{ DB_CMD_MOVE_VELOCITY, 0, -201.0f, DB_LIMIT_MAX_VELOCITY },
		{ DB_CMD_MOVE_VELOCITY, 0, 0.0f, DB_LIMIT_NONE },
		{ DB_CMD_MOVE_PRESET, 0, 0.0f, DB_LIMIT_MAX_VELOCITY },
		{ DB_CMD_JOG_POSITIVE, 0, 0.0f, DB_LIMIT_MAX_VELOCITY },
		{ DB_CMD_JOG_NEGATIVE, 0, 0.0f, DB_LIMIT_MAX_VELOCITY },
		{ DB_CMD_MOVE_CURRENT, 0, 0.0f, DB_LIMIT_NONE },
	};
	unsigned submitted = 0;

	FAKE(false);
	fake.drive.min_position = -5.0;
	fake.drive.max_position = 100.0;
	fake.drive.max_velocity = 20.0;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 500);
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		int answer = move(&fake, cases[i].command, cases[i].position, cases[i].velocity);

		assert_int_equal(look(&fake).results.result_limit, cases[i].limit);
		if (cases[i].limit == DB_LIMIT_NONE) {
			assert_int_equal(answer, DB_WRITE_LATER);
			finish(&fake, submitted++, DB_RESULT_REFUSED);
		} else {
			assert_int_equal(answer, ILLEGAL_VALUE);
			assert_int_equal(look(&fake).results.result, DB_RESULT_LIMIT);
		}
		assert_int_equal(fake.submitted, submitted);
	}
	/* Beyond a limit already: back, but not further out. */
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1200);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 10.0f), ILLEGAL_VALUE);
	assert_int_equal(look(&fake).results.result_limit, DB_LIMIT_MAX_POSITION);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, -10.0f), DB_WRITE_LATER);
	drop(&fake);
}

static void jogs_and_currents_go_no_further_out(void **state)
{
	const struct db_args pull = { .target_current = -0.5f };
	const struct db_args push = { .target_current = 0.5f };
	const struct db_write_token token = { 1, 1 };

	FAKE(false);
	fake.drive.min_position = -5.0;
	fake.drive.max_position = 100.0;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, -60);
	assert_int_equal(move(&fake, DB_CMD_JOG_NEGATIVE, 0, 0.0f), ILLEGAL_VALUE);
	assert_int_equal(look(&fake).results.result_limit, DB_LIMIT_MIN_POSITION);
	assert_int_equal(move(&fake, DB_CMD_JOG_POSITIVE, 0, 0.0f), DB_WRITE_LATER);
	assert_int_equal(db_exception_of_answer(execute(fake.commander, NULL, DB_CMD_MOVE_CURRENT,
	                                                &pull, token, fake.now)),
	                 ILLEGAL_VALUE);
	assert_int_equal(db_exception_of_answer(execute(fake.commander, NULL, DB_CMD_MOVE_CURRENT,
	                                                &push, token, fake.now)),
	                 DB_WRITE_LATER);
	drop(&fake);
}

/* Ten counts a unit; 100 counts/s take it some 5 counts further before it hears a stop. */
static void a_jog_is_held_back_before_a_limit(void **state)
{
	FAKE(false);
	fake.drive.max_position = 100.0;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 950);
	let_pass(&fake, 50 * MS);
	assert_int_equal(fake.submitted, 1);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 994);
	let_pass(&fake, 50 * MS);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(fake.requests[1].command, DB_CMD_STOP);
	assert_int_equal(look(&fake).results.result_limit, DB_LIMIT_MAX_POSITION);
	finish(&fake, 1, DB_RESULT_OK);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 998);
	let_pass(&fake, 2 * DB_NS_PER_S);
	assert_int_equal(fake.submitted, 2);
	/* A move to a position has been checked, and is not watched. */
	assert_int_equal(move(&fake, DB_CMD_MOVE_ABSOLUTE, 1000, 50.0f), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	set_axis(&fake, DB_AXIS_DISCRETE_MOTION, DB_STATUS_MOVING, 999);
	let_pass(&fake, 200 * MS);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static struct db_driver telling; /* its drives know how many counts a millimetre has */

/* What is shown in the drive's own units is limited in them. */
static void limits_have_the_scale_that_is_shown(void **state)
{
	struct db_commander_config config;
	struct db_snapshot snapshot = {
		.feedback = { .status = DB_STATUS_BUS_UP | DB_STATUS_ONLINE, .taken = 1 },
	};

	FAKE(false);
	db_commander_free(fake.commander);
	telling = driver;
	telling.scale_unit = "mm";
	fake.drive.counts_per_unit = 1.0;
	fake.drive.max_position = 300.0;
	config = (struct db_commander_config){
		.driver = &telling,
		.bus_config = &fake.bus,
		.drive_config = &fake.drive,
		.commands = driver.commands,
		.drive = 7,
		.confirm_ms = 40,
		.axis = fake.axis,
	};
	assert_int_equal(db_commander_new(&config, &ops, &fake, &fake.commander), 0);
	/* It has not told yet. */
	assert_int_equal(move(&fake, DB_CMD_MOVE_ABSOLUTE, 10, 50.0f), ILLEGAL_VALUE);
	assert_int_equal(look(&fake).results.result_limit, DB_LIMIT_MAX_POSITION);
	snapshot.feedback.counts_per_unit = 640.0f;
	db_axis_publish(fake.axis, &snapshot);
	assert_int_equal(move(&fake, DB_CMD_MOVE_ABSOLUTE, 300 * 640, 50.0f), DB_WRITE_LATER);
	assert_int_equal(move(&fake, DB_CMD_MOVE_ABSOLUTE, 301 * 640, 50.0f), ILLEGAL_VALUE);
	drop(&fake);
}

/* Whatever else stands in the same write. */
static void a_stop_beside_a_staged_command_is_a_stop(void **state)
{
	struct db_command_write write = {
		.block = { .command = DB_CMD_STOP, .staged_command = DB_CMD_MOVE_ABSOLUTE },
		.has_command = true,
		.has_staged = true,
	};

	FAKE(false);
	assert_int_equal(db_exception_of_answer(db_commander_write(fake.commander, NULL, &write,
	                                                           (struct db_write_token){ 1, 1 },
	                                                           fake.now)),
	                 DB_WRITE_LATER);
	assert_int_equal(fake.requests[0].command, DB_CMD_STOP);
	drop(&fake);
}

/* What was asked for between two stops would run after both. */
static void a_stop_behind_parameters_joins_no_older_one(void **state)
{
	const struct db_setting setting = { .param = 3 };

	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(db_exception_of_answer(set(fake.commander, NULL, &setting, 1,
	                                            (struct db_write_token){ 1, 1 }, fake.now)),
	                 DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

/* Sent again because its answer was lost, after somebody switched an output. */
static void outputs_in_between_make_no_new_command(void **state)
{
	const struct db_args args = { .output_mask = 1 };

	FAKE(false);
	pass_baseline(&fake, 8);
	assert_int_equal(put(&fake, 9, DB_CMD_NONE, 5), 0);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(
		db_exception_of_answer(execute(fake.commander, NULL, DB_CMD_SET_OUTPUTS, &args,
	                                       (struct db_write_token){ 1, 1 }, fake.now)),
		DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), 0);
	assert_int_equal(fake.submitted, 2);
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

/* With write-confirm = accepted: what went to the bus counts as accepted, what did not does not. */
static void a_bare_repeat_of_an_accepted_write_is_accepted(void **state)
{
	FAKE(true);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_NONE, 0), 0);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), 0);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 5, false), 0);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_REFUSED);
	/* An id whose command the bridge refused is refused again. */
	set_status(&fake, 0);
	assert_int_equal(put(&fake, 3, DB_CMD_HOME, 0), NO_PATH);
	assert_int_equal(put(&fake, 3, DB_CMD_HOME, 0), NO_PATH);
	drop(&fake);
}

/* --- what a preset allows ----------------------------------------------------------------------------- */

static const struct db_param preset_params[] = {
	{ .name = "speed", .type = DB_F32, .unit = "", .min = -1000, .max = 1000 },
};

static struct db_driver presetting; /* its first parameter is the speed of moves without one */

static void set_preset(struct fake *fake, float speed, bool known)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate = fake_nameplate(&room, known);

	plate.values[0].f = speed;
	db_axis_publish_nameplate(fake->axis, &plate);
}

/* Ten counts a unit: 20 units per second are 200. */
static void a_preset_is_within_the_limits_or_not_used(void **state)
{
	static const enum db_command moves[] = { DB_CMD_MOVE_PRESET, DB_CMD_JOG_POSITIVE,
		                                 DB_CMD_JOG_NEGATIVE, DB_CMD_MOVE_ABSOLUTE };
	const struct db_setting setting = { .param = 0, .value.f = 500.0f };
	struct db_commander_config config;

	FAKE(false);
	presetting = driver;
	presetting.params = preset_params;
	presetting.param_count = 1;
	presetting.preset_velocity_param = 0;
	fake.drive.max_velocity = 20.0;
	config = config_of(&fake);
	config.driver = &presetting;
	remake(&fake, &config);
	for (size_t i = 0; i < 4; i++) {
		set_preset(&fake, -200.0f, true);
		assert_int_equal(move(&fake, moves[i], 0, 0.0f), DB_WRITE_LATER);
		finish(&fake, fake.submitted - 1, DB_RESULT_REFUSED);
		set_preset(&fake, -200.5f, true);
		assert_int_equal(move(&fake, moves[i], 0, 0.0f), ILLEGAL_VALUE);
		assert_int_equal(look(&fake).results.result_limit, DB_LIMIT_MAX_VELOCITY);
		set_preset(&fake, 1.0f, false);
		assert_int_equal(move(&fake, moves[i], 0, 0.0f), ILLEGAL_VALUE);
	}
	/* One that is being written is not known. */
	set_preset(&fake, 100.0f, true);
	assert_int_equal(db_exception_of_answer(set(fake.commander, NULL, &setting, 1,
	                                            (struct db_write_token){ 1, 1 }, fake.now)),
	                 DB_WRITE_LATER);
	assert_int_equal(move(&fake, DB_CMD_MOVE_PRESET, 0, 0.0f), ILLEGAL_VALUE);
	finish(&fake, fake.submitted - 1, DB_RESULT_REFUSED);
	assert_int_equal(move(&fake, DB_CMD_MOVE_PRESET, 0, 0.0f), DB_WRITE_LATER);
	drop(&fake);
}

/* It says which way it goes by its sign. */
static void a_preset_leads_no_further_beyond_a_limit(void **state)
{
	struct db_commander_config config;

	FAKE(false);
	presetting = driver;
	presetting.params = preset_params;
	presetting.param_count = 1;
	presetting.preset_velocity_param = 0;
	fake.drive.max_position = 100.0;
	config = config_of(&fake);
	config.driver = &presetting;
	remake(&fake, &config);
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1200);
	set_preset(&fake, 10.0f, true);
	assert_int_equal(move(&fake, DB_CMD_MOVE_PRESET, 0, 0.0f), ILLEGAL_VALUE);
	assert_int_equal(look(&fake).results.result_limit, DB_LIMIT_MAX_POSITION);
	set_preset(&fake, -10.0f, true);
	assert_int_equal(move(&fake, DB_CMD_MOVE_PRESET, 0, 0.0f), DB_WRITE_LATER);
	drop(&fake);
}

/* For whoever shows a user what he may ask for. */
static void the_largest_velocity_is_told(void **state)
{
	struct db_snapshot snapshot = {
		.feedback = { .status = DB_STATUS_BUS_UP | DB_STATUS_ONLINE, .taken = 1 },
	};
	struct db_commander_config config;

	FAKE(false);
	assert_true(isnan(db_commander_allowed(fake.commander).max_velocity));
	fake.drive.max_velocity = 20.0;
	assert_true(fabs(db_commander_allowed(fake.commander).max_velocity - 200.0) < 1e-9);
	/* A drive that is yet to report its scale. */
	telling = driver;
	telling.scale_unit = "mm";
	config = config_of(&fake);
	config.driver = &telling;
	remake(&fake, &config);
	assert_true(isnan(db_commander_allowed(fake.commander).max_velocity));
	snapshot.feedback.counts_per_unit = 640.0f;
	db_axis_publish(fake.axis, &snapshot);
	assert_true(fabs(db_commander_allowed(fake.commander).max_velocity - 20.0 * 640.0) < 1e-9);
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

/* Of relative moves as well, and of nothing else: homing has no target. */
static void what_rests_beside_its_target_is_a_move(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1001);
	let_pass(&fake, 300 * MS);
	assert_int_equal(fake.refused, 1);
	assert_true(fake.refused_write.off > 0.5 && fake.refused_write.off < 1.5);
	assert_int_equal(fake.refused_write.command, DB_CMD_MOVE_RELATIVE);
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1001);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	/* One with a fault did not come to rest there. */
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_ERROR_STOP, 0, 1001);
	let_pass(&fake, 300 * MS);
	assert_int_equal(look(&fake).results.result, DB_RESULT_FAILED);
	assert_int_equal(fake.refused, 1);
	drop(&fake);
}

/* It was refused before the one that was asked for first had begun: whoever waits for it must not take
 * the other one's end for its own. */
static void a_motion_refused_in_between_is_the_newest(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	fake.drive.max_position = 100.0;
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_ABSOLUTE, 1001), ILLEGAL_VALUE);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.result_id, 8);
	assert_int_equal(look(&fake).results.motion_id, 7);
	assert_int_equal(look(&fake).results.motion_result, DB_RESULT_OK);
	assert_false(look(&fake).results.done);
	/* The next one is, again. */
	assert_int_equal(put(&fake, 9, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

/* The one that was asked for last is the one whose end is awaited. */
static void a_refused_motion_leaves_the_one_behind_it(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 7, DB_CMD_MOVE_ABSOLUTE, 500), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 8, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_REFUSED);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_int_equal(look(&fake).results.motion_id, 8);
	assert_true(look(&fake).results.done);
	drop(&fake);
}

/* A motion's, until its own end; of other entries their own results. */
static void the_outcome_of_an_entry_is_that_of_what_it_began(void **state)
{
	uint32_t motion;

	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	motion = entry_of(&fake, 0).sequence;
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, DB_CMD_SET_OUTPUT, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(entry_of(&fake, 1).result, DB_RESULT_OK);
	assert_int_equal(db_commander_outcome(fake.commander, motion), DB_RESULT_PENDING);
	assert_int_equal(db_commander_outcome(fake.commander, motion + 1), DB_RESULT_OK);
	assert_int_equal(db_commander_outcome(fake.commander, motion + 2), DB_RESULT_INDETERMINATE);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_int_equal(db_commander_outcome(fake.commander, motion), DB_RESULT_OK);
	/* What has no end of its own is what its command said once it has begun. */
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 10.0f), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(db_commander_outcome(fake.commander, entry_of(&fake, 0).sequence),
	                 DB_RESULT_OK);
	drop(&fake);
}

/* Before it reached the commander: who asked for what is known all the same. */
static void what_was_refused_elsewhere_is_in_the_history(void **state)
{
	const struct db_args args = { .target_position = 12 };
	struct db_request refused = { .client = { .id = 4, .address = { [15] = 4 }, .port = 44 },
		                      .command = DB_CMD_MOVE_ABSOLUTE,
		                      .args = &args };

	FAKE(false);
	db_commander_refuse(fake.commander, &refused, DB_RESULT_OUT_OF_RANGE, 12);
	assert_int_equal(entry_of(&fake, 0).command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(entry_of(&fake, 0).position, 12);
	assert_int_equal(entry_of(&fake, 0).port, 44);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(look(&fake).results.write_register, 12);
	assert_int_equal(fake.refused, 1);
	assert_int_equal(fake.refused_write.command, DB_CMD_MOVE_ABSOLUTE);
	/* Of parameters it is not known which. */
	refused.command = DB_CMD_NONE;
	db_commander_refuse(fake.commander, &refused, DB_RESULT_NOT_IN_CONTROL, 0);
	assert_int_equal(entry_of(&fake, 0).sequence, 2);
	assert_int_equal(entry_of(&fake, 0).command, DB_CMD_NONE);
	assert_int_equal(entry_of(&fake, 0).number, DB_HISTORY_UNKNOWN);
	/* That is reported elsewhere. */
	assert_int_equal(fake.refused, 1);
	drop(&fake);
}

/* --- the audit trail ---------------------------------------------------------------------------------- */

/* What was recorded, and how it ended. */
static struct {
	unsigned count;
	struct db_recorded last;
	enum db_command command;
	bool full; /* nothing is recorded: there will be no ends either */
	unsigned ended;
	uint32_t ended_record;
	enum db_result ended_with;
	db_time took;
} trail;

static uint32_t note_record(void *context, const struct db_recorded *recorded)
{
	(void)context;
	trail.last = *recorded;
	trail.command = recorded->request->command;
	return trail.full ? 0 : 100 + ++trail.count;
}

static void note_end(void *context, uint32_t record, enum db_result result, db_time took)
{
	(void)context;
	trail.ended++;
	trail.ended_record = record;
	trail.ended_with = result;
	trail.took = took;
}

static void record_in(struct fake *fake)
{
	static struct db_commander_ops recording;
	struct db_commander_config config = config_of(fake);

	recording = ops;
	recording.record = note_record;
	recording.record_end = note_end;
	memset(&trail, 0, sizeof(trail));
	db_commander_free(fake->commander);
	assert_int_equal(db_commander_new(&config, &recording, fake, &fake->commander), 0);
}

static void everything_is_recorded_with_its_end(void **state)
{
	FAKE(false);
	record_in(&fake);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	assert_int_equal(trail.count, 1);
	assert_int_equal(trail.command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(trail.last.result, DB_RESULT_PENDING);
	fake.now += 3 * MS;
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(trail.ended, 1);
	assert_int_equal(trail.ended_record, 101);
	assert_int_equal(trail.ended_with, DB_RESULT_OK);
	assert_true(trail.took == 3 * MS);
	/* The motion's own end, by a stop that is recorded, too. */
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(trail.count, 2);
	assert_int_equal(trail.ended, 2);
	assert_int_equal(trail.ended_record, 101);
	assert_int_equal(trail.ended_with, DB_RESULT_CANCELLED);
	/* One that joins it, and ends with it. */
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(trail.count, 3);
	assert_int_equal(trail.last.joined, 102);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(trail.ended, 3);
	assert_int_equal(trail.ended_record, 102);
	/* A refusal ends at once; a write that was refused for its form is one. */
	assert_int_equal(put(&fake, 0, DB_CMD_SET_SV, 0), ILLEGAL_FUNCTION);
	assert_int_equal(trail.count, 4);
	assert_int_equal(trail.last.result, DB_RESULT_UNSUPPORTED);
	db_commander_set_refused(fake.commander, NULL, DB_RESULT_OUT_OF_RANGE, 103);
	assert_int_equal(trail.count, 5);
	assert_int_equal(trail.command, DB_CMD_NONE);
	assert_int_equal(trail.last.address, 103);
	assert_int_equal(trail.ended, 3);
	drop(&fake);
}

static void what_was_not_recorded_has_no_end(void **state)
{
	FAKE(false);
	record_in(&fake);
	trail.full = true;
	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(trail.ended, 0);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_REFUSED);
	drop(&fake);
}

/* --- the last commands ---------------------------------------------------------------------------------------- */

static void history_tells_who_moved_it(void **state)
{
	const struct db_client plc = { .id = 5, .address = { [15] = 7 }, .port = 4711 };
	const struct db_setting setting = { .param = 3, .value.f = 1.5f };
	struct db_history_entry none;

	FAKE(false);
	assert_false(db_commander_history(fake.commander, 0, &none));
	fake.client = &plc;
	pass_baseline(&fake, 1);
	fake.now += 1000 * MS;
	assert_int_equal(put(&fake, 2, DB_CMD_MOVE_ABSOLUTE, -77), DB_WRITE_LATER);
	assert_int_equal(entry_of(&fake, 0).sequence, 2);
	assert_int_equal(entry_of(&fake, 0).timestamp_us, 1700000002000000u);
	assert_int_equal(entry_of(&fake, 0).address[15], 7);
	assert_int_equal(entry_of(&fake, 0).port, 4711);
	assert_int_equal(entry_of(&fake, 0).command_id, 2);
	assert_int_equal(entry_of(&fake, 0).command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(entry_of(&fake, 0).position, -77);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_PENDING);
	fake.now += 3 * MS;
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_OK);
	assert_int_equal(entry_of(&fake, 0).duration_us, 3000);
	assert_int_equal(entry_of(&fake, 1).result, DB_RESULT_RESTARTED);
	/* A scanner writes it for ever. */
	for (unsigned i = 0; i < 100; i++)
		assert_int_equal(put(&fake, 2, DB_CMD_MOVE_ABSOLUTE, -77), 0);
	assert_int_equal(entry_of(&fake, 0).sequence, 2);
	assert_int_equal(db_exception_of_answer(set(fake.commander, fake.client, &setting, 1,
	                                            (struct db_write_token){ 1, 1 }, fake.now)),
	                 DB_WRITE_LATER);
	assert_int_equal(entry_of(&fake, 0).command, DB_CMD_NONE);
	assert_int_equal(entry_of(&fake, 0).number, 3);
	assert_int_equal(entry_of(&fake, 0).value, 0x3FC00000);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_REFUSED);
	drop(&fake);
}

static void history_keeps_the_last_32(void **state)
{
	struct db_history_entry none;

	FAKE(true);
	for (unsigned i = 0; i < 40; i++) {
		assert_int_equal(put(&fake, 0, DB_CMD_MOVE_RELATIVE, (int32_t)i), 0);
		finish(&fake, i, DB_RESULT_OK);
	}
	for (unsigned i = 0; i < 32; i++) {
		assert_int_equal(entry_of(&fake, i).sequence, 40 - i);
		assert_int_equal(entry_of(&fake, i).position, 39 - i);
	}
	assert_false(db_commander_history(fake.commander, 32, &none));
	/* A completion of what was overwritten meanwhile changes nothing. */
	finish(&fake, 0, DB_RESULT_FAILED);
	for (unsigned i = 1; i < 32; i++)
		assert_int_equal(entry_of(&fake, i).result, DB_RESULT_CANCELLED);
	drop(&fake);
}

/* What was refused before the same way only counts: the cause of the trouble stays to be seen. */
static void history_is_not_flooded_by_refusals(void **state)
{
	const struct db_client other = { .id = 6, .address = { [15] = 8 }, .port = 1 };

	FAKE(false);
	fake.drive.max_position = 1.0;
	for (unsigned i = 0; i < 1000; i++)
		assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 11), ILLEGAL_VALUE);
	assert_int_equal(entry_of(&fake, 0).sequence, 1);
	assert_int_equal(entry_of(&fake, 0).repeats, 999);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 12), ILLEGAL_VALUE);
	assert_int_equal(entry_of(&fake, 0).sequence, 2);
	fake.client = &other;
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 12), ILLEGAL_VALUE);
	assert_int_equal(entry_of(&fake, 0).sequence, 3);
	/* Stops that join one under way. */
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(entry_of(&fake, 0).sequence, 4);
	assert_int_equal(entry_of(&fake, 0).repeats, 1);
	drop(&fake);
}

static void history_follows_a_motion_to_its_end(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += 700 * MS;
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(entry_of(&fake, 1).result, DB_RESULT_CANCELLED);
	assert_int_equal(entry_of(&fake, 1).duration_us, 700000);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(put(&fake, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 2, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	let_pass(&fake, 1000 * MS);
	assert_int_equal(entry_of(&fake, 0).result, DB_RESULT_FAILED);
	assert_in_range(entry_of(&fake, 0).duration_us, 200000, 260000);
	drop(&fake);
}

/* --- an id memory for each client ----------------------------------------------------------------- */

#define CLIENTS 9

static const struct db_client *client(unsigned number)
{
	static struct db_client clients[CLIENTS + 1];

	clients[number] = (struct db_client){ .id = number + 100, .address = { (uint8_t)number } };
	return &clients[number];
}

static int put_as(struct fake *fake, unsigned number, uint16_t id, unsigned command,
                  int32_t position)
{
	fake->client = client(number);
	db_commander_hear(fake->commander, fake->client, ++fake->now);
	return put(fake, id, command, position);
}

static struct db_command_state look_as(struct fake *fake, unsigned number)
{
	fake->client = client(number);
	return look(fake);
}

#define CLIENT_FAKE()     \
	struct fake fake; \
	(void)state;      \
	init_with(&fake, false, 0, true)

static void each_client_numbers_its_own_commands(void **state)
{
	CLIENT_FAKE();
	/* The first of each is a baseline, also after others have commanded. */
	assert_int_equal(put_as(&fake, 1, 5, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 2, 6, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(look_as(&fake, 2).results.result, DB_RESULT_RESTARTED);
	assert_int_equal(put_as(&fake, 2, 7, DB_CMD_DISABLE, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_REFUSED);
	assert_int_equal(fake.submitted, 2);
	/* The same id again is a repeat for the one, whatever the other did meanwhile. */
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), 0);
	assert_int_equal(fake.submitted, 2);
	/* And the id of the other is new for it. */
	assert_int_equal(put_as(&fake, 1, 7, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	finish(&fake, 2, DB_RESULT_OK);
	/* Another connection of the same address is the same client. */
	assert_int_equal(put_as(&fake, 2, 8, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	finish(&fake, 3, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 2, 8, DB_CMD_ENABLE, 0), 0);
	assert_int_equal(fake.submitted, 4);
	drop(&fake);
}

static void each_client_sees_its_own_result(void **state)
{
	struct db_command_state seen;

	CLIENT_FAKE();
	assert_int_equal(put_as(&fake, 1, 0, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_int_equal(look_as(&fake, 1).results.result, DB_RESULT_PENDING);
	assert_int_equal(put_as(&fake, 2, 0, DB_CMD_SET_POSITION, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_REFUSED);
	finish(&fake, 0, DB_RESULT_OK);
	seen = look_as(&fake, 1);
	assert_int_equal(seen.results.result, DB_RESULT_OK);
	assert_int_equal(seen.results.result_command, DB_CMD_ENABLE);
	assert_int_equal(seen.results.write_result, DB_RESULT_OK);
	seen = look_as(&fake, 2);
	assert_int_equal(seen.results.result, DB_RESULT_REFUSED);
	assert_int_equal(seen.results.result_command, DB_CMD_SET_POSITION);
	/* Who has commanded nothing sees the drive's latest. */
	assert_int_equal(look_as(&fake, 3).results.result_command, DB_CMD_SET_POSITION);
	fake.drive.max_position = 1.0;
	assert_int_equal(put_as(&fake, 1, 0, DB_CMD_MOVE_ABSOLUTE, 11), ILLEGAL_VALUE);
	assert_int_equal(look_as(&fake, 1).results.result, DB_RESULT_LIMIT);
	assert_int_equal(look_as(&fake, 1).results.result_limit, DB_LIMIT_MAX_POSITION);
	assert_int_equal(look_as(&fake, 2).results.result_limit, DB_LIMIT_NONE);
	drop(&fake);
}

static void a_motion_aborted_by_another_client_is_told_to_its_own(void **state)
{
	CLIENT_FAKE();
	assert_int_equal(put_as(&fake, 1, 5, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_MOVE_ABSOLUTE, 10), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 2, 0, DB_CMD_MOVE_ABSOLUTE, 20), DB_WRITE_LATER);
	assert_false(look_as(&fake, 1).results.aborted);
	finish(&fake, 1, DB_RESULT_OK);
	assert_true(look_as(&fake, 1).results.aborted);
	assert_int_equal(look_as(&fake, 1).results.aborted_id, 6);
	assert_false(look_as(&fake, 1).results.done);
	assert_int_equal(look_as(&fake, 1).results.result, DB_RESULT_OK);
	assert_int_equal(look_as(&fake, 1).results.motion_id, 6);
	assert_int_equal(look_as(&fake, 1).results.motion_result, DB_RESULT_CANCELLED);
	/* Not to who did it: the id is none of its own. */
	assert_false(look_as(&fake, 2).results.aborted);
	assert_int_equal(look_as(&fake, 2).results.motion_id, 0);
	assert_int_equal(look_as(&fake, 2).results.motion_result, DB_RESULT_PENDING);
	assert_int_equal(put_as(&fake, 1, 7, DB_CMD_MOVE_ABSOLUTE, 30), DB_WRITE_LATER);
	assert_false(look_as(&fake, 1).results.aborted);
	/* Who looks on sees the drive's. */
	assert_int_equal(look_as(&fake, 3).results.motion_result, DB_RESULT_PENDING);
	finish(&fake, 2, DB_RESULT_OK);
	assert_true(look_as(&fake, 2).results.aborted);
	assert_false(look_as(&fake, 1).results.aborted);
	assert_int_equal(look_as(&fake, 1).results.motion_id, 7);
	assert_int_equal(look_as(&fake, 3).results.motion_id, 7);
	/* Its own stop ends its own motion. */
	assert_int_equal(put_as(&fake, 1, 8, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_true(look_as(&fake, 1).results.aborted);
	assert_int_equal(look_as(&fake, 1).results.aborted_id, 7);
	drop(&fake);
}

static void the_client_that_was_silent_longest_is_forgotten(void **state)
{
	CLIENT_FAKE();
	for (unsigned i = 1; i < CLIENTS; i++)
		assert_int_equal(put_as(&fake, i, 5, DB_CMD_ENABLE, 0), FAILURE);
	/* Reading is enough: now it is the second. */
	db_commander_hear(fake.commander, client(1), ++fake.now);
	assert_int_equal(put_as(&fake, CLIENTS, 5, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	/* Forgotten: a baseline again, never an execution. */
	assert_int_equal(put_as(&fake, 2, 6, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(look_as(&fake, 2).results.result, DB_RESULT_RESTARTED);
	assert_int_equal(fake.submitted, 1);
	assert_int_equal(put_as(&fake, 4, 6, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

/* The scope changed in a reload: nobody can say whose an id was, so none is executed on. */
static void another_scope_begins_with_baselines(void **state)
{
	CLIENT_FAKE();
	assert_int_equal(put_as(&fake, 1, 5, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	db_commander_set_writers(fake.commander, 40, false, true);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), 0);
	db_commander_set_writers(fake.commander, 40, false, false);
	assert_int_equal(put_as(&fake, 1, 7, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(look_as(&fake, 2).results.result, DB_RESULT_RESTARTED);
	assert_int_equal(put_as(&fake, 2, 8, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	/* And back, whose memory is asked for before anything is given up. */
	assert_int_equal(db_commander_reserve(fake.commander, true), 0);
	assert_int_equal(put_as(&fake, 1, 8, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	db_commander_set_writers(fake.commander, 40, false, true);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 1, 8, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 2, 8, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 9, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

/* A write of `command` alone, sent again, after another client wrote a block with another id. */
static void the_kept_id_is_the_clients_own(void **state)
{
	CLIENT_FAKE();
	assert_int_equal(put_as(&fake, 1, 5, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 2, 50, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_NONE, 0), 0);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 9, false), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 2, 51, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.client = client(1);
	assert_int_equal(db_commander_kept(fake.commander, fake.client).command_id, 6);
	assert_int_equal(write_as(&fake, 0, DB_CMD_MOVE_RELATIVE, 9, false), 0);
	assert_int_equal(fake.submitted, 2);
	assert_int_equal(db_commander_kept(fake.commander, client(3)).command_id, 0);
	drop(&fake);
}

/* The bus turns one away as busy: only its own id is as good as never seen. */
static void busy_gives_the_id_back_to_its_client(void **state)
{
	CLIENT_FAKE();
	for (unsigned i = 1; i < 3; i++)
		assert_int_equal(put_as(&fake, i, 5, DB_CMD_ENABLE, 0), FAILURE);
	for (unsigned i = 1; i < 3; i++)
		assert_int_equal(put_as(&fake, i, 6, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_BUSY);
	finish(&fake, 1, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 2, 6, DB_CMD_ENABLE, 0), 0);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

/* Tickets come round: one that is given out anew is not the one of long ago. */
static void a_memory_outlives_its_ticket(void **state)
{
	uint32_t ticket;

	CLIENT_FAKE();
	assert_int_equal(put_as(&fake, 1, 5, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	ticket = fake.requests[0].ticket;
	do {
		fake.submitted = fake.answered = 0;
		assert_int_equal(put_as(&fake, 2, 0, DB_CMD_DISABLE, 0), DB_WRITE_LATER);
		if (fake.requests[0].ticket != ticket)
			finish(&fake, 0, DB_RESULT_OK);
	} while (fake.requests[0].ticket != ticket);
	/* Answered at once, not together with the other's. */
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), 0);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(look_as(&fake, 1).results.result, DB_RESULT_OK);
	assert_int_equal(look_as(&fake, 1).results.write_result, DB_RESULT_OK);
	assert_int_equal(put_as(&fake, 1, 6, DB_CMD_ENABLE, 0), 0);
	drop(&fake);
}

/* What it did before is no longer the newest motion it asked for. */
static void a_client_that_joins_a_stop_is_not_done(void **state)
{
	CLIENT_FAKE();
	assert_int_equal(put_as(&fake, 1, 0, DB_CMD_MOVE_ABSOLUTE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_true(look_as(&fake, 1).results.done);
	assert_int_equal(put_as(&fake, 2, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_true(look_as(&fake, 1).results.done);
	assert_int_equal(put_as(&fake, 1, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(fake.submitted, 2);
	assert_false(look_as(&fake, 1).results.done);
	drop(&fake);
}

static void memory_for_clients_is_there_while_it_is_needed(void **state)
{
	struct db_writers writers = { .by_address = false };

	CLIENT_FAKE();
	writers.each = calloc(DB_WRITERS, sizeof(writers.each[0]));
	assert_non_null(writers.each);
	db_writers_set(&writers, true);
	assert_non_null(writers.each);
	for (unsigned i = 1; i < CLIENTS; i++)
		assert_non_null(db_writers_claim(&writers, client(i), i));
	db_writers_set(&writers, true);
	for (unsigned i = 1; i < CLIENTS; i++)
		assert_null(db_writers_find(&writers, client(i)));
	db_writers_set(&writers, false);
	assert_null(writers.each);
	/* Where none is needed there is no lack of it. */
	assert_int_equal(db_commander_reserve(fake.commander, false), 0);
	drop(&fake);
}

/* A later stop takes the place of its own, and ends it. */
static void a_client_sees_the_end_of_the_stop_that_took_its_place(void **state)
{
	CLIENT_FAKE();
	assert_int_equal(put_as(&fake, 3, 1, DB_CMD_ENABLE, 0), FAILURE);
	assert_int_equal(put_as(&fake, 1, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put_as(&fake, 2, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(put_as(&fake, 2, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_CANCELLED);
	assert_int_equal(look_as(&fake, 1).results.result, DB_RESULT_PENDING);
	assert_int_equal(look_as(&fake, 1).results.write_result, DB_RESULT_PENDING);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(look_as(&fake, 1).results.result, DB_RESULT_OK);
	assert_int_equal(look_as(&fake, 1).results.write_result, DB_RESULT_OK);
	drop(&fake);
}

static struct db_write_answer stage(struct fake *fake, enum db_command command,
                                    enum db_command beside, int32_t position)
{
	struct db_command_write write = {
		.block = { .command = (uint16_t)beside,
		           .staged_command = (uint16_t)command,
		           .args.target_position = position },
		.has_staged = true,
		.has_command = beside != DB_CMD_NONE,
	};

	return db_commander_write(fake->commander, fake->client, &write,
	                          (struct db_write_token){ 1, ++fake->next_token }, fake->now);
}

/* What would be refused at the start is refused now. */
static void a_command_is_judged_when_it_is_staged(void **state)
{
	CLIENT_FAKE();
	fake.client = client(1);
	fake.drive.max_position = 100.0;
	assert_int_equal(stage(&fake, DB_CMD_MOVE_ABSOLUTE, DB_CMD_NONE, 1001).result,
	                 DB_RESULT_LIMIT);
	assert_int_equal(look(&fake).results.result, DB_RESULT_LIMIT);
	assert_int_equal(look(&fake).results.result_command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(stage(&fake, DB_CMD_SET_SV, DB_CMD_NONE, 0).result, DB_RESULT_UNSUPPORTED);
	/* Two commands in one write. */
	assert_int_equal(stage(&fake, DB_CMD_MOVE_ABSOLUTE, DB_CMD_HOME, 500).result,
	                 DB_RESULT_OUT_OF_RANGE);
	assert_int_equal(db_commander_staged(fake.commander), DB_CMD_NONE);
	assert_int_equal(stage(&fake, DB_CMD_MOVE_ABSOLUTE, DB_CMD_NONE, 500).result, DB_RESULT_OK);
	assert_int_equal(db_commander_staged(fake.commander), DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake.submitted, 0);
	/* By another client, who is told of it as of a command of its own. */
	assert_true(db_commander_start_staged(fake.commander, client(2), 9,
	                                      (struct db_write_token){ 1, 99 }, fake.now)
	                    .later);
	assert_int_equal(db_commander_staged(fake.commander), DB_CMD_NONE);
	assert_int_equal(fake.requests[0].command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(fake.requests[0].args->target_position, 500);
	assert_int_equal(fake.requests[0].group, 9);
	assert_int_equal(fake.requests[0].id, 0);
	finish(&fake, 0, DB_RESULT_REFUSED);
	assert_int_equal(put_as(&fake, 3, 0, DB_CMD_ENABLE, 0), DB_WRITE_LATER);
	assert_int_equal(look_as(&fake, 2).results.result_command, DB_CMD_MOVE_ABSOLUTE);
	assert_int_equal(look_as(&fake, 2).results.result, DB_RESULT_REFUSED);
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

/* Two cycles and the time of a command: no more than the drive may need to hear of it. */
static void a_jog_is_not_held_back_too_early(void **state)
{
	FAKE(false);
	fake.drive.max_position = 100.0;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 900);
	assert_int_equal(move(&fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 900);
	wake(&fake);
	/* In 50 ms it goes 5 counts. */
	fake.now = db_commander_next_deadline(fake.commander);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 994);
	wake(&fake);
	assert_int_equal(fake.submitted, 1);
	fake.now = db_commander_next_deadline(fake.commander);
	set_axis(&fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 995);
	wake(&fake);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

/* A motion that was refused is the newest that it asked for. */
static void a_client_whose_motion_is_refused_is_not_done(void **state)
{
	CLIENT_FAKE();
	fake.drive.max_position = 100.0;
	assert_int_equal(put_as(&fake, 1, 0, DB_CMD_MOVE_RELATIVE, 1000), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_OK);
	fake.now += MS;
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 1000);
	let_pass(&fake, 100 * MS);
	assert_true(look_as(&fake, 1).results.done);
	assert_int_equal(put_as(&fake, 1, 0, DB_CMD_MOVE_ABSOLUTE, 1001), ILLEGAL_VALUE);
	assert_false(look_as(&fake, 1).results.done);
	drop(&fake);
}

/* The id of before, whose stop another one has replaced, is known by its end. */
static void an_id_of_before_is_known_by_its_end(void **state)
{
	FAKE(false);
	pass_baseline(&fake, 1);
	assert_int_equal(put(&fake, 2, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 3, DB_CMD_HOME, 0), DB_WRITE_LATER);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 0, DB_RESULT_CANCELLED);
	finish(&fake, 2, DB_RESULT_OK);
	finish(&fake, 1, DB_RESULT_BUSY);
	assert_int_equal(put(&fake, 2, DB_CMD_HOME, 0), 0);
	assert_int_equal(fake.submitted, 3);
	drop(&fake);
}

static void a_secret_is_not_in_the_history(void **state)
{
	static const struct db_param secrets[] = {
		{ .name = "open", .type = DB_U16, .unit = "", .max = 9 },
		{ .name = "password",
		  .type = DB_U16,
		  .unit = "",
		  .max = 9,
		  .traits = DB_PARAM_SECRET },
	};
	static struct db_driver discreet;
	struct db_setting setting = { .param = 1, .value.u = 7 };
	struct db_commander_config config;

	FAKE(false);
	discreet = driver;
	discreet.params = secrets;
	discreet.param_count = 2;
	config = config_of(&fake);
	config.driver = &discreet;
	remake(&fake, &config);
	assert_true(
		set(fake.commander, NULL, &setting, 1, (struct db_write_token){ 1, 1 }, fake.now)
			.later);
	assert_int_equal(entry_of(&fake, 0).number, 1);
	assert_int_equal(entry_of(&fake, 0).value, 0);
	assert_int_equal(fake.requests[0].settings[0].value.u, 7);
	setting.param = 0;
	assert_true(
		set(fake.commander, NULL, &setting, 1, (struct db_write_token){ 1, 2 }, fake.now)
			.later);
	assert_int_equal(entry_of(&fake, 0).value, 7);
	drop(&fake);
}

/* Begins a jog towards 1000 counts, at 100 counts/s. */
static void jog(struct fake *fake)
{
	fake->drive.max_position = 100.0;
	set_axis(fake, DB_AXIS_STANDSTILL, 0, 900);
	assert_int_equal(move(fake, DB_CMD_MOVE_VELOCITY, 0, 100.0f), DB_WRITE_LATER);
	finish(fake, fake->submitted - 1, DB_RESULT_OK);
	fake->now += MS;
	set_axis(fake, DB_AXIS_CONTINUOUS_MOTION, DB_STATUS_MOVING, 900);
	wake(fake);
}

/* Looks once, at data of this moment. */
static void pass_by(struct fake *fake, uint32_t status, int32_t position)
{
	fake->now = db_commander_next_deadline(fake->commander);
	set_axis(fake, DB_AXIS_CONTINUOUS_MOTION, status, position);
	wake(fake);
}

/* Its target was checked. */
static void a_move_behind_a_jog_is_not_watched(void **state)
{
	FAKE(false);
	jog(&fake);
	assert_int_equal(move(&fake, DB_CMD_MOVE_ABSOLUTE, 1000, 100.0f), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	pass_by(&fake, DB_STATUS_MOVING, 999);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

/* What a drive that does not answer said last is not what it does. */
static void data_of_before_stop_no_jog(void **state)
{
	struct db_snapshot snapshot = { .feedback = { .status = DB_STATUS_BUS_UP | DB_STATUS_MOVING,
		                                      .state = DB_AXIS_OFFLINE,
		                                      .position = 999,
		                                      .velocity = 100.0f } };

	FAKE(false);
	jog(&fake);
	snapshot.feedback.taken = fake.now;
	db_axis_publish(fake.axis, &snapshot);
	let_pass(&fake, 100 * MS);
	assert_int_equal(fake.submitted, 1);
	drop(&fake);
}

/* As far as it went after the last stop, it may go after the next one. */
static void a_stop_by_a_client_is_measured(void **state)
{
	FAKE(false);
	jog(&fake);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	finish(&fake, 1, DB_RESULT_OK);
	fake.now += 500 * MS;
	/* 50 counts. */
	set_axis(&fake, DB_AXIS_STANDSTILL, 0, 950);
	let_pass(&fake, 50 * MS);
	jog(&fake);
	assert_int_equal(fake.submitted, 3);
	pass_by(&fake, DB_STATUS_MOVING, 940);
	assert_int_equal(fake.submitted, 3);
	pass_by(&fake, DB_STATUS_MOVING, 946);
	assert_int_equal(fake.submitted, 4);
	assert_int_equal(fake.requests[3].cause, DB_STAND_LIMIT);
	drop(&fake);
}

/* Half of the square of its speed by its deceleration. */
static void a_known_deceleration_is_allowed_for(void **state)
{
	struct db_nameplate_copy room;
	struct db_nameplate plate;
	struct db_commander_config config;

	FAKE(false);
	presetting = driver;
	presetting.params = preset_params;
	presetting.param_count = 1;
	presetting.deceleration_param = 0;
	config = config_of(&fake);
	config.driver = &presetting;
	remake(&fake, &config);
	/* 400 counts/s^2: 12.5 counts, and 5 in the time until it hears of the stop. */
	plate = fake_nameplate(&room, 1);
	plate.values[0].f = 400.0f;
	db_axis_publish_nameplate(fake.axis, &plate);
	jog(&fake);
	pass_by(&fake, DB_STATUS_MOVING, 982);
	assert_int_equal(fake.submitted, 1);
	pass_by(&fake, DB_STATUS_MOVING, 983);
	assert_int_equal(fake.submitted, 2);
	drop(&fake);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_found_moving_is_watched),
		cmocka_unit_test(a_drive_found_standing_is_not),
		cmocka_unit_test(a_drive_that_cannot_be_asked_stays_latched),
		cmocka_unit_test(the_latch_ends_when_the_drive_has_confirmed),
		cmocka_unit_test(an_older_clear_fault_ends_no_latch),
		cmocka_unit_test(what_moves_behind_the_latch_is_watched_again),
		cmocka_unit_test(result_follows_a_move_to_its_end),
		cmocka_unit_test(old_data_ends_no_move),
		cmocka_unit_test(a_move_that_stops_elsewhere_has_failed),
		cmocka_unit_test(a_move_that_rests_beside_its_target_says_so),
		cmocka_unit_test(no_bit_ends_a_move_elsewhere),
		cmocka_unit_test(a_new_command_aborts_the_motion),
		cmocka_unit_test(a_refused_motion_leaves_the_one_before),
		cmocka_unit_test(a_motion_is_aborted_when_the_drive_takes_the_next),
		cmocka_unit_test(a_motion_that_a_stop_overtook_is_over),
		cmocka_unit_test(another_command_does_not_hide_the_end),
		cmocka_unit_test(a_shake_is_done_when_it_has_moved),
		cmocka_unit_test(homing_ends_homed_or_failed),
		cmocka_unit_test(a_late_end_of_homing_corrects_its_result),
		cmocka_unit_test(a_speed_that_never_begins_has_failed_and_is_stopped),
		cmocka_unit_test(limits_at_the_door),
		cmocka_unit_test(jogs_and_currents_go_no_further_out),
		cmocka_unit_test(a_jog_is_held_back_before_a_limit),
		cmocka_unit_test(limits_have_the_scale_that_is_shown),
		cmocka_unit_test(a_stop_beside_a_staged_command_is_a_stop),
		cmocka_unit_test(a_stop_behind_parameters_joins_no_older_one),
		cmocka_unit_test(outputs_in_between_make_no_new_command),
		cmocka_unit_test(a_refused_reaction_is_handed_over_once),
		cmocka_unit_test(history_tells_who_moved_it),
		cmocka_unit_test(history_keeps_the_last_32),
		cmocka_unit_test(history_is_not_flooded_by_refusals),
		cmocka_unit_test(history_follows_a_motion_to_its_end),
		cmocka_unit_test(id_0_executes_each_time),
		cmocka_unit_test(first_id_is_only_the_baseline),
		cmocka_unit_test(id_0_leaves_the_baseline_open),
		cmocka_unit_test(stops_execute_before_the_baseline),
		cmocka_unit_test(same_id_gets_the_stored_result),
		cmocka_unit_test(unproven_is_a_success),
		cmocka_unit_test(same_id_while_pending_waits_with_the_first),
		cmocka_unit_test(a_bare_repeat_gets_its_own_result),
		cmocka_unit_test(stored_result_survives_commands_without_id),
		cmocka_unit_test(stops_execute_under_a_used_id),
		cmocka_unit_test(repeated_stop_joins_the_pending_one),
		cmocka_unit_test(stop_after_a_later_command_is_a_new_one),
		cmocka_unit_test(arguments_alone_execute_nothing),
		cmocka_unit_test(command_alone_uses_an_unused_kept_id),
		cmocka_unit_test(command_alone_without_id_executes_each_time),
		cmocka_unit_test(arguments_a_command_does_not_use_make_no_difference),
		cmocka_unit_test(refused_writes_store_nothing),
		cmocka_unit_test(out_of_range_arguments),
		cmocka_unit_test(busy_does_not_use_the_id_up),
		cmocka_unit_test(busy_of_the_bus_does_not_either),
		cmocka_unit_test(two_busy_of_the_bus_do_not_lock_an_id),
		cmocka_unit_test(offline_and_bus_down),
		cmocka_unit_test(stop_of_an_offline_drive_is_queued),
		cmocka_unit_test(stop_is_kept_while_the_bus_is_down),
		cmocka_unit_test(a_motion_that_came_before_the_stop_does_not_begin),
		cmocka_unit_test(a_motion_that_was_taken_before_the_stop_is_cancelled),
		cmocka_unit_test(late_confirmation_is_answered_05),
		cmocka_unit_test(an_acknowledged_parameter_is_a_success_before_confirm_ms_is_over),
		cmocka_unit_test(accepted_writes_do_not_wait),
		cmocka_unit_test(old_completions_do_not_overwrite_newer_results),
		cmocka_unit_test(the_queue_is_bounded),
		cmocka_unit_test(drives_of_a_bus_share_its_room),
		cmocka_unit_test(a_stop_is_never_answered_busy),
		cmocka_unit_test(a_younger_stop_takes_the_place_of_the_older_one),
		cmocka_unit_test(a_stop_without_a_place_is_said_again),
		cmocka_unit_test(a_stop_said_again_is_not_lost),
		cmocka_unit_test(parameters_are_one_request),
		cmocka_unit_test(outside_commands_leave_the_block_alone),
		cmocka_unit_test(each_client_numbers_its_own_commands),
		cmocka_unit_test(each_client_sees_its_own_result),
		cmocka_unit_test(a_motion_aborted_by_another_client_is_told_to_its_own),
		cmocka_unit_test(the_client_that_was_silent_longest_is_forgotten),
		cmocka_unit_test(another_scope_begins_with_baselines),
		cmocka_unit_test(the_kept_id_is_the_clients_own),
		cmocka_unit_test(busy_gives_the_id_back_to_its_client),
		cmocka_unit_test(a_memory_outlives_its_ticket),
		cmocka_unit_test(a_missing_beat_stops_without_a_watchdog),
		cmocka_unit_test(a_holder_that_goes_stops_it_at_once),
		cmocka_unit_test(what_comes_after_a_lost_hold_comes_behind_its_stop),
		cmocka_unit_test(any_stop_ends_a_hold),
		cmocka_unit_test(another_motion_ends_a_hold_when_the_drive_has_taken_it),
		cmocka_unit_test(an_older_motion_ends_no_hold),
		cmocka_unit_test(what_never_began_is_not_held),
		cmocka_unit_test(another_speed_that_is_refused_leaves_the_hold),
		cmocka_unit_test(a_stop_without_room_is_handed_over_later),
		cmocka_unit_test(the_watchdog_keeps_its_own_rule),
		cmocka_unit_test(a_drive_that_is_removed_answers_all_who_wait),
		cmocka_unit_test(a_bare_repeat_of_an_accepted_write_is_accepted),
		cmocka_unit_test(a_preset_is_within_the_limits_or_not_used),
		cmocka_unit_test(a_preset_leads_no_further_beyond_a_limit),
		cmocka_unit_test(the_largest_velocity_is_told),
		cmocka_unit_test(a_motion_from_before_a_stop_at_a_limit_does_not_begin),
		cmocka_unit_test(what_rests_beside_its_target_is_a_move),
		cmocka_unit_test(a_motion_refused_in_between_is_the_newest),
		cmocka_unit_test(a_refused_motion_leaves_the_one_behind_it),
		cmocka_unit_test(the_outcome_of_an_entry_is_that_of_what_it_began),
		cmocka_unit_test(what_was_refused_elsewhere_is_in_the_history),
		cmocka_unit_test(everything_is_recorded_with_its_end),
		cmocka_unit_test(what_was_not_recorded_has_no_end),
		cmocka_unit_test(a_client_that_joins_a_stop_is_not_done),
		cmocka_unit_test(memory_for_clients_is_there_while_it_is_needed),
		cmocka_unit_test(a_client_sees_the_end_of_the_stop_that_took_its_place),
		cmocka_unit_test(a_command_is_judged_when_it_is_staged),
		cmocka_unit_test(a_completion_that_nobody_awaits_frees_its_place),
		cmocka_unit_test(a_jog_is_not_held_back_too_early),
		cmocka_unit_test(a_client_whose_motion_is_refused_is_not_done),
		cmocka_unit_test(an_id_of_before_is_known_by_its_end),
		cmocka_unit_test(a_secret_is_not_in_the_history),
		cmocka_unit_test(a_move_behind_a_jog_is_not_watched),
		cmocka_unit_test(data_of_before_stop_no_jog),
		cmocka_unit_test(a_stop_by_a_client_is_measured),
		cmocka_unit_test(a_known_deceleration_is_allowed_for),
	};

	return cmocka_run_group_tests_name("commander", tests, NULL, NULL);
}
