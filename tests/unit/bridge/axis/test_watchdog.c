/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"
#include "drivebridge/commander.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

static void it_sleeps_until_something_moves(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_REQUESTS);
	assert_int_equal(db_watchdog_deadline(&watchdog), DB_TIME_NEVER);
	assert_false(db_watchdog_trip(&watchdog, 3600 * DB_NS_PER_S));
	db_watchdog_arm(&watchdog, 1000 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 1500 * MS);
	assert_int_equal(db_watchdog_remaining_ms(&watchdog, 1100 * MS), 400);
	/* 0 is when there is nothing to wait for. */
	assert_int_equal(db_watchdog_remaining_ms(&watchdog, 1499 * MS), 1);
	assert_int_equal(db_watchdog_remaining_ms(&watchdog, 1500 * MS - 1), 1);
	assert_int_equal(db_watchdog_remaining_ms(&watchdog, 1500 * MS), 0);
}

/* Clients whose addresses are their numbers. */
static struct db_client client_of(uint32_t id)
{
	return (struct db_client){ .id = id, .address = { [15] = (uint8_t)id } };
}

static bool feed(struct db_watchdog *watchdog, enum db_watchdog_feed by, uint32_t id, db_time now)
{
	const struct db_client client = client_of(id);

	return db_watchdog_feed(watchdog, by, &client, now);
}

static void command(struct db_watchdog *watchdog, uint32_t id)
{
	const struct db_client client = client_of(id);

	db_watchdog_commanded(watchdog, &client);
}

static void requests_keep_it_quiet_and_silence_trips_it_once(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_REQUESTS);
	db_watchdog_arm(&watchdog, 0);
	feed(&watchdog, DB_FEED_REQUESTS, 1, 400 * MS);
	assert_false(db_watchdog_trip(&watchdog, 899 * MS));
	assert_true(db_watchdog_trip(&watchdog, 900 * MS));
	assert_true(watchdog.latched);
	assert_int_equal(watchdog.trips, 1);
	assert_false(db_watchdog_trip(&watchdog, 5000 * MS));
	/* Talking again does not end the latch. */
	feed(&watchdog, DB_FEED_REQUESTS, 1, 5000 * MS);
	assert_true(watchdog.latched);
	db_watchdog_reset(&watchdog);
	assert_false(watchdog.latched);
	assert_false(db_watchdog_trip(&watchdog, 9000 * MS));
	db_watchdog_arm(&watchdog, 9000 * MS);
	assert_true(db_watchdog_trip(&watchdog, 9500 * MS));
	assert_int_equal(watchdog.trips, 2);
}

/* Nothing is lost with a tool that has done its work; a PLC may always be one that has died. */
static void only_sessions_may_leave_it(void **state)
{
	const uint32_t session = DB_CLIENT_FIRST_SESSION;
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_COMMANDERS);
	db_watchdog_arm(&watchdog, 0);
	assert_false(db_watchdog_is_deserted(&watchdog));
	command(&watchdog, session);
	command(&watchdog, session + 1);
	assert_false(db_watchdog_is_deserted(&watchdog));
	db_watchdog_forget(&watchdog, session);
	assert_false(db_watchdog_is_deserted(&watchdog));
	db_watchdog_forget(&watchdog, session + 1);
	assert_true(db_watchdog_is_deserted(&watchdog));
	/* Others that come and go have nothing to do with it. */
	db_watchdog_forget(&watchdog, DB_CLIENT_NOBODY);
	db_watchdog_forget(&watchdog, 1);
	assert_true(db_watchdog_is_deserted(&watchdog));
	command(&watchdog, 1);
	assert_false(db_watchdog_is_deserted(&watchdog));
	db_watchdog_forget(&watchdog, 1);
	assert_false(db_watchdog_is_deserted(&watchdog));
	assert_true(db_watchdog_trip(&watchdog, 500 * MS));
	/* Begins anew. */
	db_watchdog_reset(&watchdog);
	db_watchdog_arm(&watchdog, 1000 * MS);
	assert_false(db_watchdog_is_deserted(&watchdog));
	command(&watchdog, session);
	db_watchdog_forget(&watchdog, session);
	assert_true(db_watchdog_is_deserted(&watchdog));
	watchdog.armed = false;
	assert_false(db_watchdog_trip(&watchdog, 9000 * MS));
	assert_false(watchdog.latched);
}

static void zero_turns_it_off(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 0, DB_FEED_REQUESTS);
	db_watchdog_arm(&watchdog, 0);
	assert_false(db_watchdog_trip(&watchdog, 3600 * DB_NS_PER_S));
	assert_int_equal(db_watchdog_remaining_ms(&watchdog, 1), 0);
	db_watchdog_set(&watchdog, 100, 10 * MS);
	assert_true(db_watchdog_trip(&watchdog, 110 * MS));
	db_watchdog_set(&watchdog, 0, 200 * MS);
	assert_true(watchdog.latched);
}

static void each_kind_of_feeding_includes_the_stricter_ones(void **state)
{
	static const enum db_watchdog_feed KINDS[] = { DB_FEED_REQUESTS, DB_FEED_COMMANDERS,
		                                       DB_FEED_WRITES, DB_FEED_HEARTBEAT };
	/* By who commands the drive, and by somebody else. */
	static const bool feeds[2][4][4] = {
		{ { true, true, true, true },
		  { true, true, true, true },
		  { false, false, true, true },
		  { false, false, false, true } },
		{ { true, true, true, true },
		  { false, false, false, false },
		  { false, false, false, false },
		  { false, false, false, true } },
	};

	(void)state;
	for (unsigned who = 0; who < 2; who++) {
		for (unsigned i = 0; i < 16; i++) {
			enum db_watchdog_feed set = KINDS[i / 4];
			enum db_watchdog_feed by = KINDS[i % 4];
			struct db_watchdog watchdog;

			if (by == DB_FEED_COMMANDERS)
				continue;
			db_watchdog_init(&watchdog, 500, set);
			db_watchdog_arm(&watchdog, 0);
			command(&watchdog, 1);
			assert_int_equal(feed(&watchdog, by, 1 + who, 100 * MS),
			                 feeds[who][set][by]);
			assert_int_equal(db_watchdog_deadline(&watchdog),
			                 (feeds[who][set][by] ? 600 : 500) * MS);
		}
	}
}

/* It has connected anew, and repeats its command before it reads. */
static void who_commands_is_known_by_its_address_when_it_writes(void **state)
{
	struct db_client again = client_of(1);
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_COMMANDERS);
	assert_false(db_watchdog_is_commanded_by(&watchdog, NULL));
	db_watchdog_arm(&watchdog, 0);
	command(&watchdog, 1);
	db_watchdog_forget(&watchdog, 1);
	again.id = 50;
	assert_true(db_watchdog_is_commanded_by(&watchdog, NULL));
	assert_true(db_watchdog_is_commanded_by(&watchdog, &again));
	assert_false(db_watchdog_feed(&watchdog, DB_FEED_REQUESTS, &again, 100 * MS));
	assert_true(db_watchdog_feed(&watchdog, DB_FEED_WRITES, &again, 200 * MS));
	db_watchdog_commanded(&watchdog, &again);
	assert_true(db_watchdog_feed(&watchdog, DB_FEED_REQUESTS, &again, 300 * MS));
	assert_int_equal(db_watchdog_deadline(&watchdog), 800 * MS);
	/* Armed anew, nobody does. */
	watchdog.armed = false;
	db_watchdog_arm(&watchdog, 1000 * MS);
	assert_false(db_watchdog_is_commanded_by(&watchdog, NULL));
	assert_false(db_watchdog_feed(&watchdog, DB_FEED_WRITES, &again, 1100 * MS));
}

/* Their reads count, from the first motion on, until their connection ends. */
static void who_commands_feeds_by_reading(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_COMMANDERS);
	command(&watchdog, 1);
	db_watchdog_arm(&watchdog, 0);
	/* That was before; and 0 is nobody. */
	assert_false(feed(&watchdog, DB_FEED_REQUESTS, 1, 10 * MS));
	command(&watchdog, 0);
	assert_false(feed(&watchdog, DB_FEED_REQUESTS, 0, 10 * MS));
	command(&watchdog, 1);
	command(&watchdog, 1);
	assert_true(feed(&watchdog, DB_FEED_REQUESTS, 1, 100 * MS));
	assert_false(feed(&watchdog, DB_FEED_REQUESTS, 2, 200 * MS));
	assert_int_equal(db_watchdog_deadline(&watchdog), 600 * MS);
	assert_false(feed(&watchdog, DB_FEED_WRITES, 2, 200 * MS));
	/* Another motion changes nothing of it. */
	db_watchdog_arm(&watchdog, 300 * MS);
	assert_true(feed(&watchdog, DB_FEED_REQUESTS, 1, 400 * MS));
	for (uint32_t client = 2; client < 1 + DB_WATCHDOG_COMMANDERS; client++)
		command(&watchdog, client);
	assert_true(feed(&watchdog, DB_FEED_REQUESTS, 1, 400 * MS));
	command(&watchdog, 99);
	assert_false(feed(&watchdog, DB_FEED_REQUESTS, 1, 400 * MS));
	assert_true(feed(&watchdog, DB_FEED_REQUESTS, 99, 400 * MS));
	db_watchdog_forget(&watchdog, 99);
	assert_false(feed(&watchdog, DB_FEED_REQUESTS, 99, 400 * MS));
}

/* A request that waited in a buffer tells of the time before. */
static void an_older_sign_of_life_undoes_no_younger_one(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_REQUESTS);
	db_watchdog_arm(&watchdog, 1000 * MS);
	feed(&watchdog, DB_FEED_WRITES, 1, 700 * MS);
	db_watchdog_arm(&watchdog, 700 * MS);
	db_watchdog_set(&watchdog, 400, 700 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 1400 * MS);
	db_watchdog_reset(&watchdog);
	/* Nobody has been heard since its motion was asked for. */
	db_watchdog_arm(&watchdog, 600 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 1000 * MS);
}

/* What an I/O scanner repeats by itself is no sign of life. */
static void only_the_heartbeat_feeds_when_it_is_asked_for(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_HEARTBEAT);
	db_watchdog_arm(&watchdog, 0);
	db_watchdog_arm(&watchdog, 100 * MS);
	db_watchdog_set(&watchdog, 500, 200 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 500 * MS);
	feed(&watchdog, DB_FEED_HEARTBEAT, 1, 300 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 800 * MS);
	/* A new time counts from now. */
	db_watchdog_set(&watchdog, 100, 400 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 500 * MS);
	assert_true(db_watchdog_trip(&watchdog, 500 * MS));
	db_watchdog_reset(&watchdog);
	db_watchdog_arm(&watchdog, 600 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 700 * MS);
}

static void other_feeding_goes_by_every_motion_and_setting(void **state)
{
	struct db_watchdog watchdog;

	(void)state;
	db_watchdog_init(&watchdog, 500, DB_FEED_WRITES);
	db_watchdog_arm(&watchdog, 0);
	db_watchdog_arm(&watchdog, 100 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 600 * MS);
	/* Somebody may write the time that it has for ever. */
	db_watchdog_set(&watchdog, 500, 200 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 600 * MS);
	db_watchdog_set(&watchdog, 600, 200 * MS);
	assert_int_equal(db_watchdog_deadline(&watchdog), 800 * MS);
}

static void a_heart_beats_when_one_client_changes_its_value(void **state)
{
	static const uint8_t PLC[16] = { 1 };
	static const uint8_t OTHER[16] = { 2 };
	struct db_heartbeat heart = { 0 };

	(void)state;
	assert_false(db_heartbeat_write(&heart, PLC, 5));
	assert_false(db_heartbeat_write(&heart, PLC, 5));
	assert_true(db_heartbeat_write(&heart, PLC, 6));
	assert_true(db_heartbeat_write(&heart, PLC, 0));
	assert_int_equal(heart.value, 0);
	/* Two that stand still do not make one that beats. */
	for (unsigned i = 0; i < 3; i++) {
		assert_false(db_heartbeat_write(&heart, OTHER, 7));
		assert_false(db_heartbeat_write(&heart, PLC, 8));
	}
	assert_int_equal(heart.value, 8);
	assert_true(db_heartbeat_write(&heart, PLC, 9));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_sleeps_until_something_moves),
		cmocka_unit_test(requests_keep_it_quiet_and_silence_trips_it_once),
		cmocka_unit_test(only_sessions_may_leave_it),
		cmocka_unit_test(zero_turns_it_off),
		cmocka_unit_test(each_kind_of_feeding_includes_the_stricter_ones),
		cmocka_unit_test(who_commands_feeds_by_reading),
		cmocka_unit_test(who_commands_is_known_by_its_address_when_it_writes),
		cmocka_unit_test(an_older_sign_of_life_undoes_no_younger_one),
		cmocka_unit_test(only_the_heartbeat_feeds_when_it_is_asked_for),
		cmocka_unit_test(other_feeding_goes_by_every_motion_and_setting),
		cmocka_unit_test(a_heart_beats_when_one_client_changes_its_value),
	};

	return cmocka_run_group_tests_name("watchdog", tests, NULL, NULL);
}
