/* SPDX-License-Identifier: Apache-2.0 */
/* What is taken, what is refused, and what is answered from memory: ids, kept arguments, limits. */
#include "commander_world.h"

#include "fakes/nameplate.h"

/* --- ids -------------------------------------------------------------------------------------- */

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

/* --- stops ------------------------------------------------------------------------------------ */

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

/* --- writing the command alone ---------------------------------------------------------------- */

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

/* --- parameters and coils --------------------------------------------------------------------- */

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

/* --- staged commands -------------------------------------------------------------------------- */

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

/* --- refusals --------------------------------------------------------------------------------- */

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

/* --- limits ----------------------------------------------------------------------------------- */

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

/* --- what a preset allows --------------------------------------------------------------------- */

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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(id_0_executes_each_time),
		cmocka_unit_test(first_id_is_only_the_baseline),
		cmocka_unit_test(id_0_leaves_the_baseline_open),
		cmocka_unit_test(stops_execute_before_the_baseline),
		cmocka_unit_test(same_id_gets_the_stored_result),
		cmocka_unit_test(same_id_while_pending_waits_with_the_first),
		cmocka_unit_test(a_bare_repeat_gets_its_own_result),
		cmocka_unit_test(a_bare_repeat_of_an_accepted_write_is_accepted),
		cmocka_unit_test(stored_result_survives_commands_without_id),
		cmocka_unit_test(an_id_of_before_is_known_by_its_end),
		cmocka_unit_test(stops_execute_under_a_used_id),
		cmocka_unit_test(repeated_stop_joins_the_pending_one),
		cmocka_unit_test(stop_after_a_later_command_is_a_new_one),
		cmocka_unit_test(a_stop_behind_parameters_joins_no_older_one),
		cmocka_unit_test(a_stop_beside_a_staged_command_is_a_stop),
		cmocka_unit_test(arguments_alone_execute_nothing),
		cmocka_unit_test(command_alone_uses_an_unused_kept_id),
		cmocka_unit_test(command_alone_without_id_executes_each_time),
		cmocka_unit_test(arguments_a_command_does_not_use_make_no_difference),
		cmocka_unit_test(outputs_in_between_make_no_new_command),
		cmocka_unit_test(parameters_are_one_request),
		cmocka_unit_test(outside_commands_leave_the_block_alone),
		cmocka_unit_test(a_command_is_judged_when_it_is_staged),
		cmocka_unit_test(refused_writes_store_nothing),
		cmocka_unit_test(out_of_range_arguments),
		cmocka_unit_test(busy_does_not_use_the_id_up),
		cmocka_unit_test(busy_of_the_bus_does_not_either),
		cmocka_unit_test(two_busy_of_the_bus_do_not_lock_an_id),
		cmocka_unit_test(offline_and_bus_down),
		cmocka_unit_test(limits_at_the_door),
		cmocka_unit_test(jogs_and_currents_go_no_further_out),
		cmocka_unit_test(limits_have_the_scale_that_is_shown),
		cmocka_unit_test(a_preset_is_within_the_limits_or_not_used),
		cmocka_unit_test(a_preset_leads_no_further_beyond_a_limit),
		cmocka_unit_test(the_largest_velocity_is_told),
	};

	return cmocka_run_group_tests_name("ask", tests, NULL, NULL);
}
