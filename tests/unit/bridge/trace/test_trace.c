/* SPDX-License-Identifier: Apache-2.0 */
/* The ring of what a bus carried: in order, with gaps that are counted, and never a torn record. */
#include "drivebridge/trace.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <cmocka.h>

#define SIZE 4096

static struct db_trace *trace;
static struct db_trace_place place;
static struct db_trace_record record;
static uint32_t missed;

static int begin(void **state)
{
	(void)state;
	trace = db_trace_new(SIZE);
	place = (struct db_trace_place){ .at = 0 };
	return trace ? 0 : -1;
}

static int end(void **state)
{
	(void)state;
	db_trace_free(trace);
	return 0;
}

static uint32_t write_text(db_time time, enum db_trace_kind kind, uint32_t question,
                           const char *text)
{
	return db_trace_write(trace, time, kind, question, text, strlen(text));
}

static void expect(uint32_t number, enum db_trace_kind kind, uint32_t question, const char *text)
{
	assert_true(db_trace_read(trace, &place, &record, &missed));
	assert_int_equal(record.number, number);
	assert_int_equal(record.kind, kind);
	assert_int_equal(record.question, question);
	assert_int_equal(record.length, strlen(text));
	assert_memory_equal(record.bytes, text, record.length);
}

static void records_come_in_order_with_what_they_refer_to(void **state)
{
	uint32_t question;

	(void)state;
	question = write_text(10, DB_TRACE_POLL, 0, "1 sts\n");
	write_text(20, DB_TRACE_ANSWER, question, "a frame of more than sixteen bytes");
	write_text(30, DB_TRACE_UNANSWERED, question, "");
	for (size_t i = 1; i <= 20; i++)
		db_trace_write(trace, 40, DB_TRACE_STRAY, 0, "abcdefghijklmnopqrstuvwxyz", i);
	expect(1, DB_TRACE_POLL, 0, "1 sts\n");
	assert_true(record.time == 10);
	expect(2, DB_TRACE_ANSWER, 1, "a frame of more than sixteen bytes");
	assert_true(record.time == 20);
	expect(3, DB_TRACE_UNANSWERED, 1, "");
	for (size_t i = 1; i <= 20; i++) {
		char text[32] = "";

		memcpy(text, "abcdefghijklmnopqrstuvwxyz", i);
		expect((uint32_t)(3 + i), DB_TRACE_STRAY, 0, text);
	}
	assert_false(db_trace_read(trace, &place, &record, &missed));
	assert_int_equal(missed, 0);
}

/* What a frame is shows only when it was looked at, and what happens by it stands behind it. */
static void a_frame_is_published_when_it_is_known_what_it_is(void **state)
{
	(void)state;
	write_text(1, DB_TRACE_POLL, 0, "q");
	expect(1, DB_TRACE_POLL, 0, "q");
	db_trace_open(trace, 2, "x", 1);
	assert_false(db_trace_read(trace, &place, &record, &missed));
	db_trace_write_event(trace, 3, DB_EVENT_DRIVE_FAULT, "feeder");
	db_trace_write_event(trace, 4, DB_EVENT_DRIVE_FAULT, "lift");
	assert_false(db_trace_read(trace, &place, &record, &missed));
	db_trace_close(trace, DB_TRACE_ANSWER, 1);
	expect(2, DB_TRACE_ANSWER, 1, "x");
	assert_true(record.time == 2);
	for (int i = 0; i < 2; i++) {
		assert_true(db_trace_read(trace, &place, &record, &missed));
		assert_int_equal(record.kind, DB_TRACE_EVENT);
	}
	assert_false(db_trace_read(trace, &place, &record, &missed));
	db_trace_open(trace, 5, "y", 1);
	db_trace_close(trace, DB_TRACE_LATE, 1);
	expect(5, DB_TRACE_LATE, 1, "y");
}

static void an_event_has_its_drive_and_counts_as_trouble(void **state)
{
	char drive[DB_TRACE_NAME_MAX + 1];
	char longest[100];

	(void)state;
	memset(longest, 'n', sizeof longest);
	longest[sizeof longest - 1] = '\0';
	db_trace_write_event(trace, 1, DB_EVENT_BUS_UP, NULL);
	assert_int_equal(db_trace_troubles(trace), 0);
	db_trace_write_event(trace, 2, DB_EVENT_DRIVE_LOST, longest);
	assert_int_equal(db_trace_troubles(trace), 1);
	assert_true(db_trace_read(trace, &place, &record, &missed));
	assert_int_equal(db_trace_event_of(&record, drive), DB_EVENT_BUS_UP);
	assert_string_equal(drive, "");
	assert_true(db_trace_read(trace, &place, &record, &missed));
	assert_int_equal(db_trace_event_of(&record, drive), DB_EVENT_DRIVE_LOST);
	assert_int_equal(strlen(drive), DB_TRACE_NAME_MAX);
}

static void who_is_too_slow_is_told_how_many_are_missing(void **state)
{
	uint32_t last = 0;
	uint32_t seen = 0;
	uint32_t lost = 0;

	(void)state;
	write_text(1, DB_TRACE_POLL, 0, "the first");
	expect(1, DB_TRACE_POLL, 0, "the first");
	for (int i = 0; i < 1000; i++)
		last = write_text(i, DB_TRACE_POLL, 0, "one of many");
	while (db_trace_read(trace, &place, &record, &missed)) {
		lost += missed;
		seen++;
		assert_int_equal(record.number, 1 + lost + seen);
	}
	assert_int_equal(record.number, last);
	assert_int_equal(1 + lost + seen, last);
	assert_in_range(seen, SIZE / 40, SIZE / 32);
}

static void the_longest_records_fit_and_longer_ones_are_cut(void **state)
{
	static uint8_t bytes[3 * DB_TRACE_BYTES_MAX];

	(void)state;
	memset(bytes, 0x55, sizeof bytes);
	for (int i = 0; i < 10; i++)
		db_trace_write(trace, i, DB_TRACE_GARBAGE, 0, bytes, sizeof bytes);
	assert_true(db_trace_read(trace, &place, &record, &missed));
	assert_int_equal(record.length, DB_TRACE_BYTES_MAX);
	assert_memory_equal(record.bytes, bytes, DB_TRACE_BYTES_MAX);
	assert_int_equal(record.number, 10);
}

static void a_question_that_is_long_ago_is_none(void **state)
{
	uint32_t question;

	(void)state;
	question = write_text(1, DB_TRACE_POLL, 0, "q");
	for (int i = 0; i < 3000; i++)
		write_text(1, DB_TRACE_FOREIGN, 0, "f");
	write_text(2, DB_TRACE_ANSWER, question, "a");
	while (db_trace_read(trace, &place, &record, &missed))
		;
	assert_int_equal(record.kind, DB_TRACE_ANSWER);
	assert_int_equal(record.question, 0);
}

static void reading_from_now_begins_with_what_comes(void **state)
{
	(void)state;
	write_text(1, DB_TRACE_POLL, 0, "before");
	place = db_trace_end(trace);
	assert_false(db_trace_read(trace, &place, &record, &missed));
	write_text(2, DB_TRACE_POLL, 0, "behind");
	expect(2, DB_TRACE_POLL, 0, "behind");
	assert_int_equal(missed, 0);
}

static void a_copy_stands_on_its_own_with_an_event_at_its_time(void **state)
{
	struct db_trace_record extra = { .kind = DB_TRACE_EVENT, .time = 25, .length = 1 };
	struct db_trace *copy;

	(void)state;
	extra.bytes[0] = DB_EVENT_WATCHDOG_TRIPPED;
	write_text(10, DB_TRACE_POLL, 0, "q");
	write_text(20, DB_TRACE_ANSWER, 1, "a");
	write_text(30, DB_TRACE_STOP, 0, "s");
	copy = db_trace_copy(trace, &extra);
	assert_non_null(copy);
	for (int i = 0; i < 1000; i++)
		write_text(40, DB_TRACE_POLL, 0, "later");
	db_trace_free(trace);
	trace = copy;
	expect(1, DB_TRACE_POLL, 0, "q");
	expect(2, DB_TRACE_ANSWER, 1, "a");
	assert_true(db_trace_read(trace, &place, &record, &missed));
	assert_int_equal(record.kind, DB_TRACE_EVENT);
	assert_int_equal(missed, 0);
	expect(3, DB_TRACE_STOP, 0, "s");
	assert_int_equal(missed, 0);
	assert_false(db_trace_read(trace, &place, &record, &missed));
}

static atomic_bool ending;

/* Each byte of a record says which one it is. */
static void *write_on(void *context)
{
	uint8_t bytes[64];

	(void)context;
	for (uint32_t i = 1; !atomic_load(&ending); i++) {
		memset(bytes, (int)(i % 251), sizeof bytes);
		db_trace_write(trace, i, DB_TRACE_POLL, 0, bytes, 1 + i % sizeof bytes);
	}
	return NULL;
}

static void a_reader_beside_the_writer_sees_whole_records_only(void **state)
{
	uint32_t expected = 0;
	uint32_t seen = 0;
	pthread_t writer;

	(void)state;
	atomic_store(&ending, false);
	assert_int_equal(pthread_create(&writer, NULL, write_on, NULL), 0);
	while (seen < 20000) {
		if (!db_trace_read(trace, &place, &record, &missed))
			continue;
		seen++;
		if (expected != 0)
			assert_int_equal(record.number, expected + missed);
		expected = record.number + 1;
		assert_true(record.time == record.number);
		assert_int_equal(record.length, 1 + record.number % 64);
		for (size_t i = 0; i < record.length; i++)
			assert_int_equal(record.bytes[i], record.number % 251);
	}
	atomic_store(&ending, true);
	assert_int_equal(pthread_join(writer, NULL), 0);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void)
{
	const struct CMUnitTest tests[] = {
		TEST(records_come_in_order_with_what_they_refer_to),
		TEST(a_frame_is_published_when_it_is_known_what_it_is),
		TEST(an_event_has_its_drive_and_counts_as_trouble),
		TEST(who_is_too_slow_is_told_how_many_are_missing),
		TEST(the_longest_records_fit_and_longer_ones_are_cut),
		TEST(a_question_that_is_long_ago_is_none),
		TEST(reading_from_now_begins_with_what_comes),
		TEST(a_copy_stands_on_its_own_with_an_event_at_its_time),
		TEST(a_reader_beside_the_writer_sees_whole_records_only),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
