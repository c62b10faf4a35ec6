/* SPDX-License-Identifier: Apache-2.0 */
/* What became of requests, for each client, in the history and in the audit trail. */
#include "commander_world.h"

#include <stdlib.h>

/* --- results ---------------------------------------------------------------------------------- */

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

/* The bridge's own stop took its place: what that one ends with is the result of the write. */
static void a_write_ends_as_the_stop_that_took_its_place(void **state)
{
	FAKE(false);
	assert_int_equal(put(&fake, 0, DB_CMD_STOP, 0), DB_WRITE_LATER);
	assert_true(execute(fake.commander, NULL, DB_CMD_HOME, &(struct db_args){ 0 },
	                    (struct db_write_token){ 1, ++fake.next_token }, fake.now)
	                    .later);
	assert_true(execute(fake.commander, NULL, DB_CMD_STOP, &(struct db_args){ 0 },
	                    (struct db_write_token){ 1, ++fake.next_token }, fake.now)
	                    .later);
	finish(&fake, 0, DB_RESULT_CANCELLED);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_PENDING);
	finish(&fake, 2, DB_RESULT_OK);
	assert_int_equal(look(&fake).results.write_result, DB_RESULT_OK);
	drop(&fake);
}

/* --- a memory for each client ----------------------------------------------------------------- */

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

/* --- the last commands ------------------------------------------------------------------------ */

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

/* --- the audit trail -------------------------------------------------------------------------- */

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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(unproven_is_a_success),
		cmocka_unit_test(old_completions_do_not_overwrite_newer_results),
		cmocka_unit_test(a_write_ends_as_the_stop_that_took_its_place),
		cmocka_unit_test(each_client_numbers_its_own_commands),
		cmocka_unit_test(each_client_sees_its_own_result),
		cmocka_unit_test(a_motion_aborted_by_another_client_is_told_to_its_own),
		cmocka_unit_test(the_client_that_was_silent_longest_is_forgotten),
		cmocka_unit_test(another_scope_begins_with_baselines),
		cmocka_unit_test(the_kept_id_is_the_clients_own),
		cmocka_unit_test(busy_gives_the_id_back_to_its_client),
		cmocka_unit_test(a_memory_outlives_its_ticket),
		cmocka_unit_test(a_client_that_joins_a_stop_is_not_done),
		cmocka_unit_test(memory_for_clients_is_there_while_it_is_needed),
		cmocka_unit_test(a_client_sees_the_end_of_the_stop_that_took_its_place),
		cmocka_unit_test(a_client_whose_motion_is_refused_is_not_done),
		cmocka_unit_test(history_tells_who_moved_it),
		cmocka_unit_test(history_keeps_the_last_32),
		cmocka_unit_test(history_is_not_flooded_by_refusals),
		cmocka_unit_test(history_follows_a_motion_to_its_end),
		cmocka_unit_test(the_outcome_of_an_entry_is_that_of_what_it_began),
		cmocka_unit_test(what_was_refused_elsewhere_is_in_the_history),
		cmocka_unit_test(a_secret_is_not_in_the_history),
		cmocka_unit_test(everything_is_recorded_with_its_end),
		cmocka_unit_test(what_was_not_recorded_has_no_end),
	};

	return cmocka_run_group_tests_name("outcome", tests, NULL, NULL);
}
