/* SPDX-License-Identifier: Apache-2.0 */
#include "log/event.h"
#include "log/repeat.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define S DB_NS_PER_S
#define START (1000 * S)

static struct db_log_record record;
static struct db_repeats *repeats;
static enum db_repeat_verdict verdict; /* of what was passed last */
static uint32_t unkept;

static int set_up(void **state)
{
	(void)state;
	repeats = calloc(1, sizeof *repeats);
	return repeats ? 0 : -1;
}

static int tear_down(void **state)
{
	(void)state;
	free(repeats);
	return 0;
}

__attribute__((format(printf, 4, 5))) static bool pass(enum db_event event, const char *drive,
                                                       db_time now, const char *format, ...)
{
	struct db_log_about about = { .drive = drive };
	va_list arguments;

	va_start(arguments, format);
	db_log_record_init(&record, "line", event, &about, format, arguments);
	va_end(arguments);
	verdict = db_repeats_pass(repeats, &record, now);
	return verdict == DB_REPEAT_LOGGED;
}

static bool due(db_time now, bool all)
{
	return db_repeats_due(repeats, now, all, &record, &unkept);
}

static void what_happens_once_is_told_once(void **state)
{
	(void)state;
	assert_true(pass(DB_EVENT_BUS_SLOW, NULL, START, "slow"));
	assert_false(due(START + 61 * S, false));
	assert_true(db_repeats_next(repeats) == DB_TIME_NEVER);
	/* A quiet minute later it is news again. */
	assert_true(pass(DB_EVENT_BUS_SLOW, NULL, START + 62 * S, "slow"));
}

static void a_thousand_times_are_a_count(void **state)
{
	unsigned logged = 0;

	(void)state;
	for (int i = 0; i < 1000; i++)
		logged += pass(DB_EVENT_DRIVE_FAULT, "feeder", START + i * (S / 100), "fault %d",
		               i);
	assert_int_equal(logged, db_event_kind(DB_EVENT_DRIVE_FAULT)->most);
	assert_true(db_repeats_next(repeats) == START + 60 * S);
	assert_false(due(START + 60 * S - 1, false));
	assert_true(due(START + 60 * S, false));
	assert_string_equal(record.text, "bus line: drive feeder: fault 999; happened 996 times "
	                                 "more in the last 60 s");
	assert_string_equal(record.drive, "feeder");
	assert_false(due(START + 60 * S, false));
}

static void as_long_as_it_goes_on_only_counts_are_told(void **state)
{
	unsigned lines = 0;
	unsigned logged = 0;

	(void)state;
	for (db_time now = START; now < START + 600 * S; now += S / 10) {
		logged += pass(DB_EVENT_DRIVE_LOST, "feeder", now, "gone");
		lines += due(now, false);
	}
	assert_int_equal(logged, db_event_kind(DB_EVENT_DRIVE_LOST)->most);
	assert_int_equal(lines, 9);
}

/* Each of them is remembered, also where the log only counts it; within bounds. */
static void outages_are_remembered_longer_than_they_are_logged(void **state)
{
	unsigned most = db_event_kind(DB_EVENT_DRIVE_LOST)->most;
	unsigned most_kept = db_event_kind(DB_EVENT_DRIVE_LOST)->kept;
	unsigned logged = 0;
	unsigned kept = 0;

	(void)state;
	for (int i = 0; i < 4; i++) {
		logged += pass(DB_EVENT_DRIVE_LOST, "feeder", START + 4 * i * S, "lost %d", i);
		kept += verdict != DB_REPEAT_COUNTED;
		logged += pass(DB_EVENT_DRIVE_ONLINE, "feeder", START + (4 * i + 2) * S, "back %d",
		               i);
		kept += verdict != DB_REPEAT_COUNTED;
	}
	assert_int_equal(logged, most);
	assert_int_equal(kept, 8);
	assert_true(due(START + 60 * S, false));
	assert_string_equal(
		record.text,
		"bus line: drive feeder: back 3; happened 2 times more in the last 60 s");
	assert_int_equal(unkept, 0);
	for (unsigned i = 0; i < most_kept + 5; i++) {
		(void)pass(DB_EVENT_DRIVE_LOST, "feeder", START + 61 * S, "lost");
		assert_int_equal(verdict, i < most_kept ? DB_REPEAT_KEPT : DB_REPEAT_COUNTED);
	}
	assert_true(due(START + 120 * S, false));
	assert_int_equal(unkept, 5);
	/* Of other things no more is remembered than is logged. */
	while (pass(DB_EVENT_DRIVE_FAULT, "feeder", START, "fault"))
		;
	assert_int_equal(verdict, DB_REPEAT_COUNTED);
}

/* The last line of a drive that came and went is what holds. */
static void the_newest_of_a_topic_is_told(void **state)
{
	(void)state;
	for (int i = 0; i < 50; i++) {
		pass(DB_EVENT_DRIVE_LOST, "feeder", START + i * S, "gone");
		pass(DB_EVENT_DRIVE_ONLINE, "feeder", START + i * S + 1, "there");
	}
	assert_true(due(START + 60 * S, false));
	assert_int_equal(record.event, DB_EVENT_DRIVE_ONLINE);
	assert_string_equal(record.text, "bus line: drive feeder: there; happened 94 times more in "
	                                 "the last 60 s");
}

static void one_drive_does_not_hide_another(void **state)
{
	(void)state;
	for (int i = 0; i < 100; i++)
		pass(DB_EVENT_DRIVE_LOST, "feeder", START + i, "gone");
	assert_true(pass(DB_EVENT_DRIVE_LOST, "lift", START + 100, "gone"));
	assert_true(pass(DB_EVENT_DRIVE_FAULT, "feeder", START + 101, "fault"));
}

static void more_subjects_than_places_lose_no_line(void **state)
{
	char name[16];

	(void)state;
	for (int i = 0; i < 3 * DB_REPEATS_MAX; i++) {
		snprintf(name, sizeof name, "drive%d", i);
		assert_true(pass(DB_EVENT_DRIVE_LOST, name, START + i, "gone"));
	}
}

static void what_limits_itself_always_passes(void **state)
{
	(void)state;
	for (int i = 0; i < 100; i++)
		assert_true(pass(DB_EVENT_CLIENT_REFUSED, NULL, START + i, "refused"));
	assert_true(db_repeats_next(repeats) == DB_TIME_NEVER);
}

static void the_end_tells_what_is_left(void **state)
{
	(void)state;
	for (int i = 0; i < 3; i++)
		pass(DB_EVENT_BUS_SLOW, NULL, START + i * S, "slow");
	assert_true(due(START + 5 * S, true));
	assert_string_equal(record.text, "bus line: slow; happened 2 times more in the last 5 s");
	assert_false(due(START + 5 * S, true));
}

static void a_count_is_never_cut_off(void **state)
{
	char text[2 * DB_LOG_TEXT_MAX];

	(void)state;
	memset(text, 'x', sizeof text - 1);
	text[sizeof text - 1] = '\0';
	pass(DB_EVENT_BUS_SLOW, NULL, START, "%s", text);
	pass(DB_EVENT_BUS_SLOW, NULL, START, "%s", text);
	assert_true(due(START + 60 * S, false));
	assert_non_null(strstr(record.text, "xx; happened 1 times more in the last 60 s"));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
	const struct CMUnitTest tests[] = {
		TEST(what_happens_once_is_told_once),
		TEST(a_thousand_times_are_a_count),
		TEST(as_long_as_it_goes_on_only_counts_are_told),
		TEST(outages_are_remembered_longer_than_they_are_logged),
		TEST(the_newest_of_a_topic_is_told),
		TEST(one_drive_does_not_hide_another),
		TEST(more_subjects_than_places_lose_no_line),
		TEST(what_limits_itself_always_passes),
		TEST(the_end_tells_what_is_left),
		TEST(a_count_is_never_cut_off),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
