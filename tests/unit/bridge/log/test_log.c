/* SPDX-License-Identifier: Apache-2.0 */
#include "log/event.h"
#include "log/log_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <semaphore.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <cmocka.h>

#define LINES 512

/* Takes lines, and hangs while it is told to. */
struct reader {
	sem_t may_go;
	sem_t hangs; /* posted when it does */
	bool hang;
	size_t count;
	struct db_log_record lines[LINES];
};

static struct reader reader;

static void take(void *context, const struct db_log_record *record)
{
	struct reader *to = context;

	if (to->hang) {
		sem_post(&to->hangs);
		sem_wait(&to->may_go);
		to->hang = false;
	}
	if (to->count < LINES)
		to->lines[to->count++] = *record;
}

static struct db_log *new_log(bool hang)
{
	struct db_log *log = NULL;

	memset(&reader, 0, sizeof reader);
	sem_init(&reader.may_go, 0, 0);
	sem_init(&reader.hangs, 0, 0);
	reader.hang = hang;
	assert_int_equal(db_log_new_to(take, &reader, &log), 0);
	return log;
}

static db_time now_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (db_time)now.tv_sec * DB_NS_PER_S + now.tv_nsec;
}

static struct db_log_source source_of(struct db_log *log)
{
	return (struct db_log_source){ .log = log, .bus = "press", .level = DB_LOG_INFO };
}

static void a_line_names_bus_drive_and_client(void **state)
{
	struct db_log *log = new_log(false);
	struct db_log_source source = source_of(log);
	struct db_log_about about = { .drive = "feeder", .unit = 3, .client = "10.0.0.5" };

	(void)state;
	db_log(&source, now_ns(), DB_EVENT_WATCHDOG_TRIPPED, &about, "silent for %d ms", 500);
	db_log_free(log);
	assert_int_equal(reader.count, 1);
	assert_string_equal(reader.lines[0].text,
	                    "bus press: drive feeder: client 10.0.0.5: silent for 500 ms");
	assert_int_equal(reader.lines[0].unit, 3);
}

static void lines_below_the_level_are_left_out(void **state)
{
	struct db_log *log = new_log(false);
	struct db_log_source source = source_of(log);

	(void)state;
	source.level = DB_LOG_WARNING;
	db_log(&source, now_ns(), DB_EVENT_DRIVE_ONLINE, NULL, "notice");
	db_log(&source, now_ns(), DB_EVENT_CLIENT_CONNECTED, NULL, "info");
	db_log(&source, now_ns(), DB_EVENT_DRIVE_LOST, NULL, "warning");
	db_log(&source, now_ns(), DB_EVENT_BUS_OFF, NULL, "error");
	db_log_free(log);
	assert_int_equal(reader.count, 2);
	assert_string_equal(reader.lines[0].text, "bus press: warning");
}

static void without_a_log_nothing_happens(void **state)
{
	struct db_log_source source = source_of(NULL);

	(void)state;
	db_log(&source, now_ns(), DB_EVENT_BUS_OFF, NULL, "error");
	db_log_free(NULL);
}

/* Whoever reads the log hangs: nobody waits for him, and what found no room is counted. */
static void a_reader_that_hangs_stops_nobody(void **state)
{
	struct db_log *log = new_log(true);
	struct db_log_source source = source_of(log);
	db_time slowest = 0;

	(void)state;
	db_log(&source, now_ns(), DB_EVENT_LISTENING, NULL, "first");
	sem_wait(&reader.hangs);
	for (int i = 0; i < DB_LOG_QUEUE + 100; i++) {
		db_time before = now_ns();

		db_log(&source, before, DB_EVENT_LISTENING, NULL, "line %d", i);
		if (now_ns() - before > slowest)
			slowest = now_ns() - before;
	}
	assert_true(slowest < DB_NS_PER_S);
	sem_post(&reader.may_go);
	db_log_free(log);
	assert_int_equal(reader.count, 1 + DB_LOG_QUEUE + 1);
	assert_string_equal(reader.lines[DB_LOG_QUEUE].text, "bus press: line 63");
	assert_string_equal(reader.lines[DB_LOG_QUEUE + 1].text,
	                    "100 messages are missing here: they came faster than they were read");
}

/* The end of the service does not wait for ever either. */
static void the_end_waits_a_second_at_most(void **state)
{
	struct db_log *log = new_log(true);
	struct db_log_source source = source_of(log);
	db_time begin = now_ns();

	(void)state;
	db_log(&source, begin, DB_EVENT_LISTENING, NULL, "first");
	db_log_free(log);
	assert_in_range(now_ns() - begin, DB_NS_PER_S, 5 * DB_NS_PER_S);
}

static void counts_are_told_at_the_end(void **state)
{
	struct db_log *log = new_log(false);
	struct db_log_source source = source_of(log);

	(void)state;
	for (int i = 0; i < 413; i++)
		db_log(&source, now_ns(), DB_EVENT_BUS_SLOW, NULL, "slow");
	db_log_free(log);
	assert_int_equal(reader.count, 2);
	assert_non_null(strstr(reader.lines[1].text, "slow; happened 412 times more in the last"));
}

static const char *field(char fields[DB_LOG_FIELDS_MAX][DB_LOG_FIELD_MAX], size_t count,
                         const char *name)
{
	for (size_t i = 0; i < count; i++) {
		if (strncmp(fields[i], name, strlen(name)) == 0 && fields[i][strlen(name)] == '=')
			return fields[i] + strlen(name) + 1;
	}
	return NULL;
}

static void fields_of_the_journal(void **state)
{
	char fields[DB_LOG_FIELDS_MAX][DB_LOG_FIELD_MAX];
	struct db_log *log = new_log(false);
	struct db_log_source source = source_of(log);
	struct db_log_about about = { .drive = "feeder", .unit = 3, .client = "10.0.0.5" };
	size_t count;

	(void)state;
	db_log(&source, now_ns(), DB_EVENT_WATCHDOG_TRIPPED, &about, "silent");
	source.bus = NULL;
	db_log(&source, now_ns(), DB_EVENT_LISTENING, NULL, "here");
	db_log_free(log);
	count = db_log_record_fields(&reader.lines[0], fields);
	assert_int_equal(count, 9);
	assert_string_equal(field(fields, count, "MESSAGE"),
	                    "bus press: drive feeder: client 10.0.0.5: silent");
	assert_string_equal(field(fields, count, "PRIORITY"), "3");
	assert_string_equal(field(fields, count, "DRIVEBRIDGE_EVENT"), "watchdog-tripped");
	assert_string_equal(field(fields, count, "DRIVEBRIDGE_BUS"), "press");
	assert_string_equal(field(fields, count, "DRIVEBRIDGE_DRIVE"), "feeder");
	assert_string_equal(field(fields, count, "DRIVEBRIDGE_UNIT"), "3");
	assert_string_equal(field(fields, count, "DRIVEBRIDGE_CLIENT"), "10.0.0.5");
	assert_int_equal(strlen(field(fields, count, "MESSAGE_ID")), 32);
	count = db_log_record_fields(&reader.lines[1], fields);
	assert_int_equal(count, 5);
	assert_null(field(fields, count, "DRIVEBRIDGE_BUS"));
}

static void the_journal_is_told_by_its_stream(void **state)
{
	struct stat stat;
	char text[64];

	(void)state;
	assert_int_equal(fstat(STDERR_FILENO, &stat), 0);
	snprintf(text, sizeof text, "%ju:%ju", (uintmax_t)stat.st_dev, (uintmax_t)stat.st_ino);
	assert_true(db_log_is_journal(STDERR_FILENO, text));
	assert_false(db_log_is_journal(STDERR_FILENO, NULL));
	assert_false(db_log_is_journal(STDERR_FILENO, ""));
	assert_false(db_log_is_journal(STDERR_FILENO, "nonsense"));
	/* Inherited from a service, but redirected since. */
	snprintf(text, sizeof text, "%ju:%ju", (uintmax_t)stat.st_dev, (uintmax_t)stat.st_ino + 1);
	assert_false(db_log_is_journal(STDERR_FILENO, text));
	snprintf(text, sizeof text, "%ju:%ju", (uintmax_t)stat.st_dev + 1, (uintmax_t)stat.st_ino);
	assert_false(db_log_is_journal(STDERR_FILENO, text));
}

/* What people filter by is whole, and in the manual. */
static void every_event_is_described(void **state)
{
	static char manual[65536];
	FILE *file = fopen(DRIVEBRIDGE_SOURCE_DIR "/packaging/man/drivebridged.8.in", "r");

	(void)state;
	assert_non_null(file);
	assert_true(fread(manual, 1, sizeof manual - 1, file) > 0);
	fclose(file);
	for (int i = 0; i < DB_EVENT_COUNT; i++) {
		const struct db_event_kind *kind = db_event_kind((enum db_event)i);
		char line[64] = ".B ";
		char *to = line + 3;

		assert_non_null(kind->name);
		assert_in_range(kind->level, DB_LOG_ERROR, DB_LOG_INFO);
		assert_int_equal(strspn(kind->message_id, "0123456789abcdef"), 32);
		assert_int_equal(strlen(kind->message_id), 32);
		for (const char *c = kind->name; *c != '\0'; c++) {
			if (*c == '-')
				*to++ = '\\';
			*to++ = *c;
		}
		strcpy(to, "\n");
		if (!strstr(manual, line))
			fail_msg("drivebridged(8) does not tell of %s", kind->name);
		for (int j = 0; j < i; j++)
			assert_string_not_equal(kind->message_id,
			                        db_event_kind((enum db_event)j)->message_id);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_line_names_bus_drive_and_client),
		cmocka_unit_test(lines_below_the_level_are_left_out),
		cmocka_unit_test(without_a_log_nothing_happens),
		cmocka_unit_test(a_reader_that_hangs_stops_nobody),
		cmocka_unit_test(counts_are_told_at_the_end),
		cmocka_unit_test(fields_of_the_journal),
		cmocka_unit_test(the_journal_is_told_by_its_stream),
		cmocka_unit_test(every_event_is_described),
		cmocka_unit_test(the_end_waits_a_second_at_most), /* last: its thread stays */
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
