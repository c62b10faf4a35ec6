/* SPDX-License-Identifier: Apache-2.0 */
/* Frames of Modbus RTU from bytes and silences, and echoes. */
#include "server/rtu_frames.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define SILENCE (2 * MS)

/* The standard's example: unit 2, function 7. */
static const uint8_t short_frame[] = { 0x02, 0x07, 0x41, 0x12 };
static const uint8_t read_request[] = { 0x01, 0x03, 0x00, 0x00, 0x00, 0x0A, 0xC5, 0xCD };
static const uint8_t write_request[] = { 0x11, 0x06, 0x00, 0x01, 0x00, 0x03, 0x9A, 0x9B };

static void expect_frames(const struct db_rtu_burst *burst, size_t count, const size_t *lengths)
{
	struct db_rtu_piece pieces[DB_RTU_PIECES_MAX];
	size_t end = burst->used;

	assert_int_equal(db_rtu_burst_cut(burst, pieces), count);
	while (count-- > 0) {
		assert_int_equal(pieces[count].length, lengths[count]);
		assert_int_equal(pieces[count].at + pieces[count].length, end);
		end = pieces[count].at;
	}
}

static void sums(void **state)
{
	(void)state;
	assert_int_equal(db_rtu_crc(short_frame, 2), 0x1241);
	assert_int_equal(db_rtu_crc(short_frame, sizeof(short_frame)), 0);
	assert_int_equal(db_rtu_crc(read_request, sizeof(read_request)), 0);
	assert_int_equal(db_rtu_crc(write_request, sizeof(write_request)), 0);
}

static void silences(void **state)
{
	(void)state;
	/* 11 bits at 9600 baud; above 19200 baud always the same. */
	assert_int_equal(db_rtu_silence(1145833), 4010415);
	assert_int_equal(db_rtu_silence(95486), 1750000);
}

static void whole_frames(void **state)
{
	static const size_t lengths[] = { sizeof(read_request), sizeof(write_request),
		                          sizeof(short_frame) };
	struct db_rtu_burst burst = { .used = 0 };

	(void)state;
	expect_frames(&burst, 0, NULL);
	for (size_t i = 0; i < sizeof(read_request); i++) {
		db_rtu_burst_add(&burst, &read_request[i], 1, SILENCE, MS + (db_time)i);
		expect_frames(&burst, i + 1 == sizeof(read_request), lengths);
	}
	assert_int_equal(burst.began, MS);
	assert_int_equal(burst.last, MS + (db_time)sizeof(read_request) - 1);
	db_rtu_burst_add(&burst, write_request, sizeof(write_request), SILENCE, MS);
	expect_frames(&burst, 2, lengths);
	db_rtu_burst_add(&burst, short_frame, sizeof(short_frame), SILENCE, MS);
	expect_frames(&burst, 3, lengths);
	db_rtu_burst_clear(&burst);
	expect_frames(&burst, 0, NULL);
}

static void noise(void **state)
{
	static const size_t lengths[] = { sizeof(read_request) };
	static const uint8_t some[] = { 0x5A, 0x17, 0x00 };
	struct db_rtu_burst burst = { .used = 0 };

	(void)state;
	/* Directly before and after a frame. */
	db_rtu_burst_add(&burst, some, sizeof(some), SILENCE, MS);
	db_rtu_burst_add(&burst, read_request, sizeof(read_request), SILENCE, MS);
	expect_frames(&burst, 0, NULL);
	db_rtu_burst_clear(&burst);
	db_rtu_burst_add(&burst, read_request, sizeof(read_request), SILENCE, MS);
	db_rtu_burst_add(&burst, some, sizeof(some), SILENCE, MS);
	expect_frames(&burst, 0, NULL);
	/* Half a frame, then a silence: only what begins after it counts. */
	db_rtu_burst_clear(&burst);
	db_rtu_burst_add(&burst, read_request, 5, SILENCE, MS);
	db_rtu_burst_add(&burst, read_request, sizeof(read_request), SILENCE, MS + SILENCE);
	expect_frames(&burst, 1, lengths);
	/* A silence that is too short is none. */
	db_rtu_burst_clear(&burst);
	db_rtu_burst_add(&burst, read_request, 5, SILENCE, MS);
	db_rtu_burst_add(&burst, read_request, sizeof(read_request), SILENCE, MS + SILENCE - 1);
	expect_frames(&burst, 0, NULL);
	/* A gap inside a frame is no end of it. */
	db_rtu_burst_clear(&burst);
	db_rtu_burst_add(&burst, read_request, 5, SILENCE, MS);
	db_rtu_burst_add(&burst, read_request + 5, 3, SILENCE, MS + 5 * SILENCE);
	expect_frames(&burst, 1, lengths);
}

/* An answer of another device that contains a request is one frame, not two. */
static void frames_inside_frames(void **state)
{
	static const size_t lengths[] = { 3 + sizeof(write_request) + 2 };
	uint8_t bytes[3 + sizeof(write_request) + 2] = { 9, 3, sizeof(write_request) };
	struct db_rtu_burst burst = { .used = 0 };
	uint16_t crc;

	(void)state;
	memcpy(bytes + 3, write_request, sizeof(write_request));
	crc = db_rtu_crc(bytes, sizeof(bytes) - 2);
	bytes[sizeof(bytes) - 2] = (uint8_t)crc;
	bytes[sizeof(bytes) - 1] = (uint8_t)(crc >> 8);
	db_rtu_burst_add(&burst, bytes, sizeof(bytes), SILENCE, MS);
	expect_frames(&burst, 1, lengths);
}

static void more_than_fits(void **state)
{
	static uint8_t many[DB_RTU_BURST_MAX + 1];
	static const size_t lengths[] = { sizeof(short_frame) };
	struct db_rtu_burst burst = { .used = 0 };

	(void)state;
	for (size_t i = 0; i < sizeof(many); i++)
		many[i] = short_frame[i % sizeof(short_frame)];
	db_rtu_burst_add(&burst, many, DB_RTU_BURST_MAX, SILENCE, MS);
	assert_false(burst.overrun);
	db_rtu_burst_add(&burst, many, 4, SILENCE, MS);
	assert_true(burst.overrun);
	expect_frames(&burst, 0, NULL);
	/* More silences than there are places for: the first ones count. */
	db_rtu_burst_clear(&burst);
	for (size_t i = 0; i < DB_RTU_GAPS_MAX + 4; i++)
		db_rtu_burst_add(&burst, many, 1, SILENCE, MS + (db_time)i * SILENCE);
	assert_int_equal(burst.gap_count, DB_RTU_GAPS_MAX);
	expect_frames(&burst, 0, NULL);
	db_rtu_burst_clear(&burst);
	db_rtu_burst_add(&burst, short_frame, sizeof(short_frame), SILENCE, MS);
	expect_frames(&burst, 1, lengths);
}

static bool takes(struct db_rtu_echo *echo, const uint8_t *bytes, size_t length, db_time began)
{
	return db_rtu_echo_take(echo, bytes, length, SILENCE, began);
}

static void an_echo(void **state)
{
	struct db_rtu_echo echo = { .expected = false };

	(void)state;
	/* Nothing was sent. */
	assert_false(takes(&echo, write_request, sizeof(write_request), 0));
	/* As long as nothing is known: soon after the answer it is an echo, later it is a request. */
	db_rtu_echo_sent(&echo, write_request, sizeof(write_request), 8 * MS, 100 * MS);
	assert_true(takes(&echo, write_request, sizeof(write_request), 108 * MS + 19 * MS));
	assert_false(takes(&echo, write_request, sizeof(write_request), 109 * MS));
	db_rtu_echo_sent(&echo, write_request, sizeof(write_request), 8 * MS, 100 * MS);
	assert_false(takes(&echo, write_request, sizeof(write_request), 108 * MS + 20 * MS));
	/* Something else is none. */
	db_rtu_echo_sent(&echo, write_request, sizeof(write_request), 8 * MS, 100 * MS);
	assert_false(takes(&echo, read_request, sizeof(read_request), 101 * MS));
}

/* Answers that no PLC sends show whether the line echoes. */
static void an_echo_is_learned(void **state)
{
	struct db_rtu_echo echo = { .expected = false };

	(void)state;
	db_rtu_echo_sent(&echo, read_request, sizeof(read_request), 8 * MS, 0);
	assert_true(takes(&echo, read_request, sizeof(read_request), 500 * MS));
	db_rtu_echo_sent(&echo, write_request, sizeof(write_request), 8 * MS, 0);
	assert_true(takes(&echo, write_request, sizeof(write_request), 500 * MS));
	/* Three answers in a row without one. */
	for (int i = 0; i < 3; i++) {
		db_rtu_echo_sent(&echo, read_request, sizeof(read_request), 8 * MS, 0);
		assert_false(takes(&echo, short_frame, sizeof(short_frame), 9 * MS));
	}
	db_rtu_echo_sent(&echo, write_request, sizeof(write_request), 8 * MS, 0);
	assert_false(takes(&echo, write_request, sizeof(write_request), 8 * MS + SILENCE));
	/* While the answer is on the wire nobody else sends. */
	db_rtu_echo_sent(&echo, write_request, sizeof(write_request), 8 * MS, 0);
	assert_true(takes(&echo, write_request, sizeof(write_request), 8 * MS + SILENCE - 1));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(sums),
		cmocka_unit_test(silences),
		cmocka_unit_test(whole_frames),
		cmocka_unit_test(noise),
		cmocka_unit_test(frames_inside_frames),
		cmocka_unit_test(more_than_fits),
		cmocka_unit_test(an_echo),
		cmocka_unit_test(an_echo_is_learned),
	};

	return cmocka_run_group_tests_name("rtu_frames", tests, NULL, NULL);
}
