/* SPDX-License-Identifier: Apache-2.0 */
/* Records of a trace as lines, and as a file for Wireshark. */
#include "capture/pcapng.h"
#include "capture/trace_text.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

static struct db_capture_questions questions;
static char words[DB_CAPTURE_TRACE_LINE];

static int set_up(void **state)
{
	(void)state;
	(void)setenv("TZ", "Asia/Kolkata", 1);
	tzset();
	memset(&questions, 0, sizeof(questions));
	return 0;
}

static json_t *asked(json_int_t number)
{
	return json_pack("{s:I, s:I, s:s, s:s, s:s, s:s, s:i, s:s}", "number", number, "time_us",
	                 (json_int_t)1795365001812803, "kind", "poll", "direction", "sent", "data",
	                 "3320", "drive", "lift", "address", 3, "words", "status?");
}

static json_t *answered(json_int_t question)
{
	return json_pack("{s:i, s:I, s:s, s:s, s:I, s:s, s:s, s:i, s:s}", "number", 8, "time_us",
	                 (json_int_t)1795365001816087, "kind", "answer", "direction", "received",
	                 "question", question, "data", "FF03", "drive", "lift", "address", 3,
	                 "words", "position 0 pulses");
}

/* Takes the record over. */
static void expect_line(json_t *record, const char *expected)
{
	char line[DB_CAPTURE_TRACE_LINE];

	db_capture_trace_take(&questions, record, words, sizeof(words));
	db_capture_trace_write_line(record, words, line, sizeof(line));
	assert_string_equal(line, expected);
	json_decref(record);
}

static void test_lines_have_words_and_bytes(void **state)
{
	json_t *silent = json_pack("{s:i, s:I, s:s, s:s, s:i, s:s}", "number", 9, "time_us",
	                           (json_int_t)1795365001873101, "kind", "unanswered", "direction",
	                           "none", "question", 7, "words", "");
	json_t *broadcast = asked(10);

	(void)state;
	expect_line(asked(7), "22:00:01.812803 > poll       lift: status? | 33 20");
	expect_line(answered(7),
	            "22:00:01.816087 < answer     lift: position 0 pulses (3.284 ms) | FF 03");
	expect_line(json_incref(silent), "22:00:01.873101 ! unanswered lift: no answer to "
	                                 "\"status?\" within 60.298 ms");
	(void)json_object_set_new(silent, "question", json_integer(5));
	expect_line(silent, "22:00:01.873101 ! unanswered no answer");
	expect_line(json_pack("{s:i, s:I, s:s, s:s, s:s, s:s, s:n}", "number", 11, "time_us",
	                      (json_int_t)1795365001913345, "kind", "event", "direction", "none",
	                      "drive", "lift", "words", "drive-lost", "data"),
	            "22:00:01.913345 = event      lift: drive-lost");
	(void)json_object_del(broadcast, "drive");
	(void)json_object_del(broadcast, "data");
	(void)json_object_set_new(broadcast, "address", json_integer(0));
	(void)json_object_set_new(broadcast, "words", json_string("start\n"));
	expect_line(broadcast, "22:00:01.812803 > poll       all drives: start?");
}

static void expect_bytes(uint32_t id, const char *data, const char *expected)
{
	json_t *record = json_pack("{s:I, s:s}", "id", (json_int_t)id, "data", data);
	char text[64];

	db_capture_trace_write_bytes(record, text, sizeof(text));
	assert_string_equal(text, expected);
	json_decref(record);
}

static void test_bytes_of_can_have_their_id_before_them(void **state)
{
	(void)state;
	expect_bytes(0x123, "0102", "123#0102");
	expect_bytes(0x80000123, "", "00000123#");
	expect_bytes(0x40000123, "", "123#R");
}

static void test_questions_are_remembered_up_to_a_number(void **state)
{
	json_t *record;

	(void)state;
	for (json_int_t number = 1; number <= 5000; number++) {
		record = asked(number);
		db_capture_trace_take(&questions, record, words, sizeof(words));
		json_decref(record);
	}
	record = answered(5000);
	db_capture_trace_take(&questions, record, words, sizeof(words));
	assert_non_null(strstr(words, " ms)"));
	json_decref(record);
	record = answered(3);
	db_capture_trace_take(&questions, record, words, sizeof(words));
	assert_null(strstr(words, " ms)"));
	json_decref(record);
}

static void test_the_head_says_whose_trace_it_is(void **state)
{
	json_t *bus = json_pack("{s:s, s:s, s:s, s:i}", "name", "line", "protocol", "vsmd-serial",
	                        "device", "/dev/ttyUSB0", "speed", 115200);
	char text[256];

	(void)state;
	db_capture_trace_write_head(bus, 1795365001812803, text, sizeof(text));
	assert_string_equal(text, "# drivebridge trace\n# bus line: vsmd-serial, /dev/ttyUSB0 at "
	                          "115200 bit/s\n# 2026-11-22, time of day at UTC +0530\n");
	json_decref(bus);
}

static uint32_t word(const char *bytes, size_t at)
{
	uint32_t value;

	memcpy(&value, bytes + at, sizeof(value));
	return value;
}

/* An event before a frame is in its comment, and so is how many are missing. */
static void test_a_file_of_can_is_what_wireshark_reads(void **state)
{
	json_t *bus = json_pack("{s:s, s:s, s:i}", "name", "can", "device", "an adapter", "speed",
	                        500000);
	json_t *event = json_pack("{s:s, s:s}", "kind", "event", "direction", "none");
	json_t *frame = json_pack("{s:I, s:s, s:s, s:I, s:s}", "time_us",
	                          (json_int_t)1795365001812803, "kind", "answer", "direction",
	                          "received", "id", (json_int_t)0x80000123, "data", "0AFF");
	struct db_capture_pcapng pcapng = { .missed = 3 };
	static const char missing[] = { 4, 0, 8, 0, 3, 0, 0, 0, 0, 0, 0, 0 };
	static const char bytes_of_it[] = "\x80\0\1\x23\2\0\0\0\x0a\xff";
	char *bytes = NULL;
	size_t size = 0;
	size_t head;
	FILE *file = open_memstream(&bytes, &size);

	(void)state;
	assert_true(db_capture_pcapng_begin(file, bus));
	(void)fflush(file);
	head = size;
	assert_true(db_capture_pcapng_take(&pcapng, event, "lost", file));
	(void)fflush(file);
	assert_int_equal(size, head);
	assert_true(db_capture_pcapng_take(&pcapng, frame, "lift", file));
	(void)fclose(file);
	assert_int_equal(pcapng.missed, 0);
	assert_int_equal(word(bytes, 0), 0x0A0D0D0A);
	assert_int_equal(word(bytes, 8), 0x1A2B3C4D);
	assert_int_equal(word(bytes, 24), 28);
	assert_int_equal(word(bytes, 28), 1);
	assert_int_equal(word(bytes, 36) & 0xffff, 227);
	assert_int_equal(head, 28 + word(bytes, 32));
	assert_int_equal(word(bytes, head), 6);
	assert_int_equal(word(bytes, head + 4), size - head);
	assert_int_equal(word(bytes, size - 4), size - head);
	assert_true(((uint64_t)word(bytes, head + 12) << 32 | word(bytes, head + 16)) ==
	            1795365001812803);
	assert_int_equal(word(bytes, head + 20), 10);
	assert_memory_equal(bytes + head + 28, bytes_of_it, 10);
	assert_non_null(memmem(bytes, size, "event: lost; answer: lift", 25));
	assert_non_null(memmem(bytes, size, missing, sizeof(missing)));
	free(bytes);
	json_decref(bus);
	json_decref(event);
	json_decref(frame);
}

/* Every record is a packet: a version, the direction, family, kind, words, bytes. */
static void test_a_file_of_a_serial_line(void **state)
{
	static const char answered[] = "\1\2\0\4xyza\0\6answer\0\4lift\x5a\xa5\0\xff";
	static const char lost[] = "\1\0\0\4xyza\0\5event\0\4lost";
	json_t *bus = json_pack("{s:s, s:s, s:i, s:b}", "name", "line", "device", "/dev/ttyS0",
	                        "speed", 9600, "can", 0);
	json_t *event = json_pack("{s:s, s:s}", "kind", "event", "direction", "none");
	json_t *frame = json_pack("{s:I, s:s, s:s, s:s}", "time_us", (json_int_t)1795365001812803,
	                          "kind", "answer", "direction", "received", "data", "5AA500FF");
	struct db_capture_pcapng pcapng = { .family = "xyza" };
	char *bytes = NULL;
	size_t size = 0;
	size_t head;
	FILE *file = open_memstream(&bytes, &size);

	(void)state;
	assert_true(db_capture_pcapng_begin(file, bus));
	(void)fflush(file);
	head = size;
	assert_int_equal(word(bytes, 36) & 0xffff, 147);
	assert_true(db_capture_pcapng_take(&pcapng, event, "lost", file));
	assert_true(db_capture_pcapng_take(&pcapng, frame, "lift", file));
	(void)fclose(file);
	assert_int_equal(word(bytes, head + 20), sizeof(lost) - 1);
	assert_memory_equal(bytes + head + 28, lost, sizeof(lost) - 1);
	head += word(bytes, head + 4);
	assert_int_equal(word(bytes, head + 20), sizeof(answered) - 1);
	assert_memory_equal(bytes + head + 28, answered, sizeof(answered) - 1);
	assert_int_equal(word(bytes, size - 4), size - head);
	free(bytes);
	json_decref(bus);
	json_decref(event);
	json_decref(frame);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_lines_have_words_and_bytes, set_up),
		cmocka_unit_test(test_bytes_of_can_have_their_id_before_them),
		cmocka_unit_test_setup(test_questions_are_remembered_up_to_a_number, set_up),
		cmocka_unit_test_setup(test_the_head_says_whose_trace_it_is, set_up),
		cmocka_unit_test(test_a_file_of_can_is_what_wireshark_reads),
		cmocka_unit_test(test_a_file_of_a_serial_line),
	};

	return cmocka_run_group_tests_name("capture: traces", tests, NULL, NULL);
}
