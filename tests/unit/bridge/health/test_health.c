/* SPDX-License-Identifier: Apache-2.0 */
/* Values and alarms with the thread that writes them, in made-up time. */
#include "health/health_private.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#define NOON (UINT64_C(1767268800) * 1000000)
#define OWNER 7

static char folder[64];

static int make_folder(void **state)
{
	(void)state;
	strcpy(folder, "/tmp/drivebridge-health-XXXXXX");
	return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
	char command[128];

	(void)state;
	snprintf(command, sizeof(command), "rm -rf %s", folder);
	return system(command);
}

static const struct db_health_drive feeder = { .name = "feeder", .unit = 1, .number = 1 };

/* A service with one drive. */
static struct db_health *begin(const char *where, db_time now)
{
	const struct db_health_setup setup = { .folder = where, .on = true };
	struct db_health *health = NULL;

	assert_int_equal(db_health_new(&setup, now, &health), 0);
	assert_int_equal(db_health_set_drives(health, &feeder, 1), 0);
	return health;
}

static uint64_t wall_at(db_time now)
{
	return NOON + (uint64_t)(now / DB_NS_PER_US);
}

static void end(struct db_health *health, db_time now)
{
	assert_true(db_health_free(health, now, wall_at(now)));
}

static struct db_snapshot online(uint32_t requests)
{
	return (struct db_snapshot){
		.feedback = { .status = DB_STATUS_ONLINE, .temperature = 40.6f },
		.stats = { .requests = requests,
		           .answers = requests,
		           .round_trips = requests,
		           .round_trip_sum_us = requests * 1000,
		           .round_trip_us = 1000,
		           .round_trip_max_us = 1000 },
	};
}

static json_t *array_of(const char *text)
{
	char *whole;
	json_t *values;

	assert_true(asprintf(&whole, "[%s]", text ? text : "") > 0);
	values = json_loads(whole, 0, NULL);
	assert_non_null(values);
	free(whole);
	return values;
}

static json_t *running(struct db_health *health, db_time now)
{
	char *text = db_health_running(health, "", now, wall_at(now));
	json_t *values = array_of(text);

	free(text);
	return values;
}

static int64_t number_of(const json_t *values, size_t place, const char *key)
{
	return json_integer_value(json_object_get(json_array_get(values, place), key));
}

/* What the thread reads; it takes its time. */
static json_t *read_values(struct db_health *health, db_time now)
{
	const struct timespec moment = { .tv_nsec = 1000000 };
	struct db_health_query query = { .drive = "feeder" };
	struct db_health_page page;
	json_t *values;

	while (!db_health_ask(health, OWNER, &query, now, wall_at(now)))
		nanosleep(&moment, NULL);
	while (!db_health_take(health, OWNER, &page))
		nanosleep(&moment, NULL);
	values = array_of(page.values);
	free(page.values);
	return values;
}

/* --- values ----------------------------------------------------------------------------------- */

static void an_interval_counts_what_came_in_it(void **state)
{
	struct db_snapshot snapshot = online(UINT32_MAX - 49);
	struct db_health *health = begin(NULL, 0);
	json_t *values;

	(void)state;
	snapshot.stats.round_trip_max_us = 5000;
	db_health_sample(health, 0, &snapshot, true, DB_NS_PER_S);
	/* Counters begin again from 0 after 2^32. */
	snapshot.stats.requests += 100;
	snapshot.stats.round_trips += 90;
	snapshot.stats.round_trip_sum_us += 90 * 1200;
	snapshot.stats.round_trip_us = 2000;
	snapshot.stats.timeouts = 10;
	snapshot.stats.retries = 8;
	snapshot.stats.bad_frames = 3;
	snapshot.feedback.temperature = 52.0f;
	db_health_sample(health, 0, &snapshot, true, 2 * DB_NS_PER_S);
	snapshot.feedback.status = 0;
	snapshot.feedback.temperature = NAN;
	db_health_sample(health, 0, &snapshot, true, 3 * DB_NS_PER_S);
	values = running(health, 3 * DB_NS_PER_S);
	assert_int_equal(number_of(values, 0, "exchanges"), 100);
	assert_int_equal(number_of(values, 0, "losses"), 10);
	assert_int_equal(number_of(values, 0, "retries"), 8);
	assert_int_equal(number_of(values, 0, "damaged"), 3);
	assert_int_equal(number_of(values, 0, "round_trip_us"), 1200);
	assert_int_equal(number_of(values, 0, "round_trip_longest_us"), 2000);
	assert_int_equal(number_of(values, 0, "offline_ms"), 1000);
	assert_int_equal(number_of(values, 0, "coldest"), 41);
	assert_int_equal(number_of(values, 0, "hottest"), 52);
	json_decref(values);
	/* The longest of all is seen although it was between two samples. */
	snapshot.stats.round_trip_max_us = 7000;
	db_health_sample(health, 0, &snapshot, true, 4 * DB_NS_PER_S);
	values = running(health, 4 * DB_NS_PER_S);
	assert_int_equal(number_of(values, 0, "round_trip_longest_us"), 7000);
	json_decref(values);
	end(health, 4 * DB_NS_PER_S);
}

static void a_reload_goes_on_with_the_interval(void **state)
{
	static const struct db_health_drive after[] = {
		{ .name = "slide", .unit = 2, .number = 3 },
		{ .name = "feeder", .unit = 1, .number = 2 },
	};
	struct db_health *health = begin(NULL, 0);
	struct db_snapshot snapshot = online(1000);
	json_t *values;

	(void)state;
	db_health_sample(health, 0, &snapshot, false, DB_NS_PER_S);
	snapshot = online(1010);
	db_health_sample(health, 0, &snapshot, false, 2 * DB_NS_PER_S);
	assert_int_equal(db_health_set_drives(health, after, 2), 0);
	/* Its counters begin anew. */
	snapshot = online(0);
	db_health_sample(health, 1, &snapshot, false, 3 * DB_NS_PER_S);
	snapshot = online(5);
	db_health_sample(health, 1, &snapshot, false, 4 * DB_NS_PER_S);
	/* There is no such place. */
	db_health_sample(health, 2, &snapshot, false, 4 * DB_NS_PER_S);
	values = running(health, 4 * DB_NS_PER_S);
	assert_int_equal(json_array_size(values), 2);
	assert_int_equal(number_of(values, 0, "exchanges"), 0);
	assert_int_equal(number_of(values, 1, "exchanges"), 15);
	assert_true(json_is_null(json_object_get(json_array_get(values, 1), "hottest")));
	json_decref(values);
	end(health, 4 * DB_NS_PER_S);
}

static void intervals_end_by_time_and_are_kept(void **state)
{
	struct db_health *health = begin(folder, 0);
	db_time now = 0;
	json_t *values;

	(void)state;
	/* Two minutes, four looks a second. */
	for (unsigned i = 1; i <= 4 * 130; i++) {
		struct db_snapshot snapshot = online(10 * i);

		now = i * DB_NS_PER_S / 4;
		db_health_sample(health, 0, &snapshot, false, now);
		db_health_tick(health, now, wall_at(now));
		/* The thread has it before the next one can end. */
		if (i % 100 == 0)
			json_decref(read_values(health, now));
	}
	values = read_values(health, now);
	assert_int_equal(json_array_size(values), 3);
	assert_int_equal(number_of(values, 0, "span_s"), DB_HEALTH_FIRST_S);
	assert_int_equal(number_of(values, 1, "span_s"), DB_HEALTH_INTERVAL_S);
	assert_int_equal(number_of(values, 2, "exchanges"), 2400);
	json_decref(values);
	end(health, now);
	health = begin(folder, now);
	values = read_values(health, now);
	/* And what had not ended. */
	assert_int_equal(json_array_size(values), 4);
	assert_int_equal(number_of(values, 3, "span_s"), 5);
	json_decref(values);
	end(health, now);
}

static void readers_take_turns(void **state)
{
	struct db_health_query query = { .drive = "" };
	struct db_health *health = begin(folder, 0);
	struct db_health_page page;
	json_t *values;

	(void)state;
	assert_true(db_health_ask(health, 1, &query, 0, NOON));
	assert_false(db_health_ask(health, 2, &query, 0, NOON));
	assert_false(db_health_take(health, 2, &page));
	/* The first one goes, whether its page is ready or not. */
	db_health_forget(health, 1);
	values = read_values(health, 0);
	assert_int_equal(json_array_size(values), 0);
	json_decref(values);
	assert_false(db_health_take(health, 1, &page));
	assert_true(db_health_ask(health, 2, &query, 0, NOON));
	end(health, 0);
}

static void nothing_is_taken_while_it_is_off(void **state)
{
	struct db_health *health = begin(NULL, 0);
	struct db_snapshot snapshot = online(10);
	struct db_health_state now;
	json_t *values;

	(void)state;
	db_health_change(health, false);
	db_health_sample(health, 0, &snapshot, false, DB_NS_PER_S);
	db_health_see(health, &(struct db_alarm_seen){ .name = "feeder", .detail = "" });
	db_health_tick(health, 100 * DB_NS_PER_S, NOON);
	values = running(health, 100 * DB_NS_PER_S);
	assert_int_equal(json_array_size(values), 0);
	json_decref(values);
	assert_int_equal(db_health_alarms(health).count, 0);
	db_health_state(health, &now);
	assert_false(now.on || now.kept);
	db_health_change(health, true);
	values = running(health, 101 * DB_NS_PER_S);
	assert_int_equal(number_of(values, 0, "span_s"), 1);
	json_decref(values);
	end(health, 101 * DB_NS_PER_S);
}

/* --- alarms ----------------------------------------------------------------------------------- */

static void see(struct db_health *health, const char *name, uint64_t wall_us)
{
	db_health_see(health, &(struct db_alarm_seen){ .kind = DB_ALARM_DRIVE,
	                                               .cause = DB_TROUBLE_FAULT,
	                                               .name = name,
	                                               .detail = "over_current",
	                                               .since_us = wall_us });
}

static void alarms_are_kept(void **state)
{
	struct db_health *health = begin(folder, 0);
	bool fresh = false;

	(void)state;
	see(health, "feeder", NOON);
	db_health_seen(health, NOON);
	db_health_tick(health, DB_NS_PER_S, NOON);
	assert_non_null(
		db_health_acknowledge(health, 1, "", "control, user anna", NOON + 5, &fresh));
	assert_true(fresh);
	end(health, 2 * DB_NS_PER_S);

	health = begin(folder, 0);
	assert_int_equal(db_health_alarms(health).count, 1);
	assert_string_equal(db_health_alarms(health).alarms[0].by, "control, user anna");
	assert_string_equal(db_health_alarms(health).alarms[0].detail, "over_current");
	/* It is gone in this run. */
	db_health_seen(health, NOON + 9);
	assert_int_equal(db_health_alarms(health).alarms[0].gone, NOON + 9);
	assert_int_equal(db_health_alarms(health).last_change, 3);
	end(health, 0);
}

static void a_damaged_file_is_put_aside(void **state)
{
	struct db_health *health;
	char path[96];
	FILE *file;

	(void)state;
	snprintf(path, sizeof(path), "%s/alarms", folder);
	file = fopen(path, "w");
	assert_non_null(file);
	fputs("DBALARMS and something else", file);
	fclose(file);
	health = begin(folder, 0);
	assert_int_equal(db_health_alarms(health).count, 0);
	end(health, 0);
	assert_int_not_equal(access(path, F_OK), 0);
	strcat(path, ".damaged");
	assert_int_equal(access(path, F_OK), 0);
}

int main(void)
{
#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_interval_counts_what_came_in_it),
		cmocka_unit_test(a_reload_goes_on_with_the_interval),
		IN_FOLDER(intervals_end_by_time_and_are_kept),
		IN_FOLDER(readers_take_turns),
		cmocka_unit_test(nothing_is_taken_while_it_is_off),
		IN_FOLDER(alarms_are_kept),
		IN_FOLDER(a_damaged_file_is_put_aside),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
