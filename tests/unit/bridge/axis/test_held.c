/* SPDX-License-Identifier: Apache-2.0 */
/* Motions that somebody holds: a beat that is missing, or a holder that goes, ends them. */
#include "commander_world.h"

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

int main(void)
{
	const struct CMUnitTest tests[] = {
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
	};

	return cmocka_run_group_tests_name("held", tests, NULL, NULL);
}
