/* SPDX-License-Identifier: Apache-2.0 */
/* What was going on at the start, and the latch of a stop of the bridge's own. */
#include "commander_world.h"

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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_drive_found_moving_is_watched),
		cmocka_unit_test(a_drive_found_standing_is_not),
		cmocka_unit_test(a_drive_that_cannot_be_asked_stays_latched),
		cmocka_unit_test(the_latch_ends_when_the_drive_has_confirmed),
		cmocka_unit_test(an_older_clear_fault_ends_no_latch),
		cmocka_unit_test(what_moves_behind_the_latch_is_watched_again),
	};

	return cmocka_run_group_tests_name("latch", tests, NULL, NULL);
}
