/* SPDX-License-Identifier: Apache-2.0 */
/* Modbus TCP frames, literal bytes both ways. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "server/pdu.h"

#define SIZE(array) (sizeof(array) / sizeof((array)[0]))

/* Wraps a PDU into a frame: transaction 1234, unit 5. */
static size_t frame(uint8_t *adu, const uint8_t *pdu, size_t length)
{
	const uint8_t header[] = { 0x12, 0x34, 0, 0, 0, (uint8_t)(length + 1), 5 };

	memcpy(adu, header, sizeof(header));
	memcpy(adu + sizeof(header), pdu, length);
	return sizeof(header) + length;
}

static uint8_t parse(struct db_modbus_request *request, uint8_t *adu, const uint8_t *pdu,
                     size_t length)
{
	size_t size = frame(adu, pdu, length);

	assert_int_equal(db_pdu_cut(adu, size), (int)size);
	return db_pdu_parse(adu, size, request);
}

#define PARSE(request, adu, ...)                                  \
	parse((request), (adu), (const uint8_t[]){ __VA_ARGS__ }, \
	      sizeof((const uint8_t[]){ __VA_ARGS__ }))

static void check_frame(const uint8_t *adu, size_t length, const uint8_t *pdu, size_t size)
{
	uint8_t expected[DB_ADU_MAX];
	size_t total = frame(expected, pdu, size);

	assert_int_equal(length, total);
	assert_memory_equal(adu, expected, total);
}

#define CHECK(adu, length, ...)                                        \
	check_frame((adu), (length), (const uint8_t[]){ __VA_ARGS__ }, \
	            sizeof((const uint8_t[]){ __VA_ARGS__ }))

static void cuts_frames(void **state)
{
	const uint8_t good[] = { 0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1, 0xAA };
	const uint8_t protocol[] = { 0, 1, 0x12, 0x34 };
	const uint8_t zero[] = { 0, 1, 0, 0, 0, 0 };
	const uint8_t one[] = { 0, 1, 0, 0, 0, 1, 1 };
	const uint8_t longest[] = { 0, 1, 0, 0, 0, 254 };
	const uint8_t too_long[] = { 0, 1, 0, 0, 0, 255 };
	const uint8_t huge[] = { 0, 1, 0, 0, 1, 6 };
	uint8_t full[DB_ADU_MAX] = { 0, 1, 0, 0, 0, 254 };

	(void)state;
	for (size_t i = 0; i < 12; i++)
		assert_int_equal(db_pdu_cut(good, i), 0);
	assert_int_equal(db_pdu_cut(good, 12), 12);
	assert_int_equal(db_pdu_cut(good, 13), 12);
	assert_int_equal(db_pdu_cut(protocol, 3), 0);
	assert_int_equal(db_pdu_cut(protocol, 4), -1);
	assert_int_equal(db_pdu_cut(zero, 6), -1);
	assert_int_equal(db_pdu_cut(one, 7), -1);
	assert_int_equal(db_pdu_cut(longest, 6), 0);
	assert_int_equal(db_pdu_cut(full, sizeof(full)), 260);
	assert_int_equal(db_pdu_cut(too_long, 6), -1);
	assert_int_equal(db_pdu_cut(huge, 6), -1);
}

static void reads(void **state)
{
	static const uint16_t bits[] = { 1, 0, 1, 1, 0, 0, 0, 0, 0, 1 };
	static const uint16_t registers[] = { 0x1122, 0xA5FE };
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 1, 0x00, 0x13, 0x00, 0x0A), 0);
	assert_int_equal(r.transaction, 0x1234);
	assert_int_equal(r.unit, 5);
	assert_int_equal(r.function, 1);
	assert_int_equal(r.read_address, 0x13);
	assert_int_equal(r.read_count, 10);
	assert_int_equal(r.write_count, 0);
	CHECK(out, db_pdu_read(&r, bits, out), 1, 2, 0x0D, 0x02);
	assert_int_equal(PARSE(&r, adu, 2, 0xFF, 0xFF, 0, 1), 0);
	CHECK(out, db_pdu_read(&r, bits, out), 2, 1, 1);
	assert_int_equal(PARSE(&r, adu, 3, 0, 0x6B, 0, 2), 0);
	assert_int_equal(r.read_address, 0x6B);
	CHECK(out, db_pdu_read(&r, registers, out), 3, 4, 0x11, 0x22, 0xA5, 0xFE);
	assert_int_equal(PARSE(&r, adu, 4, 0, 8, 0, 1), 0);
	CHECK(out, db_pdu_read(&r, registers, out), 4, 2, 0x11, 0x22);
}

static void read_limits(void **state)
{
	uint8_t adu[DB_ADU_MAX];
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 1, 0, 0, 0x07, 0xD0), 0);
	assert_int_equal(PARSE(&r, adu, 1, 0, 0, 0x07, 0xD1), 3);
	assert_int_equal(PARSE(&r, adu, 2, 0, 0, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 3, 0, 0, 0, 125), 0);
	assert_int_equal(PARSE(&r, adu, 3, 0, 0, 0, 126), 3);
	assert_int_equal(PARSE(&r, adu, 3, 0, 0, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 4, 0, 0, 1, 1), 3);
	/* 65536 is the end; a wrong quantity is told before a wrong address. */
	assert_int_equal(PARSE(&r, adu, 3, 0xFF, 0xFF, 0, 1), 0);
	assert_int_equal(PARSE(&r, adu, 3, 0xFF, 0xFF, 0, 2), 2);
	assert_int_equal(PARSE(&r, adu, 1, 0xFF, 0xF0, 0, 0x11), 2);
	assert_int_equal(PARSE(&r, adu, 3, 0xFF, 0xFF, 0, 126), 3);
}

static void single_writes(void **state)
{
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	struct db_modbus_request r;
	uint16_t value;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 5, 0, 0xAC, 0xFF, 0), 0);
	db_pdu_values(&r, &value);
	assert_int_equal(value, 1);
	assert_int_equal(r.write_address, 0xAC);
	assert_int_equal(r.write_count, 1);
	CHECK(out, db_pdu_written(&r, out), 5, 0, 0xAC, 0xFF, 0);
	assert_int_equal(PARSE(&r, adu, 5, 0, 0xAC, 0, 0), 0);
	db_pdu_values(&r, &value);
	assert_int_equal(value, 0);
	assert_int_equal(PARSE(&r, adu, 5, 0, 0xAC, 0, 1), 3);
	assert_int_equal(PARSE(&r, adu, 5, 0, 0xAC, 0xFF, 1), 3);
	assert_int_equal(PARSE(&r, adu, 6, 0xFF, 0xFF, 0xBE, 0xEF), 0);
	db_pdu_values(&r, &value);
	assert_int_equal(value, 0xBEEF);
	CHECK(out, db_pdu_written(&r, out), 6, 0xFF, 0xFF, 0xBE, 0xEF);
}

static void multiple_writes(void **state)
{
	static const uint16_t bits[] = { 1, 0, 1, 1, 0, 0, 1, 1, 1, 0 };
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	uint16_t values[MODBUS_MAX_WRITE_BITS];
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 15, 0, 0x13, 0, 10, 2, 0xCD, 0x01), 0);
	db_pdu_values(&r, values);
	assert_memory_equal(values, bits, sizeof(bits));
	CHECK(out, db_pdu_written(&r, out), 15, 0, 0x13, 0, 10);
	assert_int_equal(PARSE(&r, adu, 16, 0, 1, 0, 2, 4, 0, 10, 1, 2), 0);
	db_pdu_values(&r, values);
	assert_int_equal(r.write_count, 2);
	assert_int_equal(values[0], 10);
	assert_int_equal(values[1], 0x102);
	CHECK(out, db_pdu_written(&r, out), 16, 0, 1, 0, 2);

	assert_int_equal(PARSE(&r, adu, 15, 0, 0, 0, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 15, 0, 0, 0, 9, 1, 0), 3);
	assert_int_equal(PARSE(&r, adu, 15, 0, 0, 0, 8, 2, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 15, 0xFF, 0xFF, 0, 2, 1, 3), 2);
	assert_int_equal(PARSE(&r, adu, 16, 0, 0, 0, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 16, 0, 0, 0, 1, 3, 0, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 16, 0, 0, 0, 1, 2, 0), 3);
	assert_int_equal(PARSE(&r, adu, 16, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0), 2);
}

/* The largest quantities, whose PDUs are too long to write down. */
static void write_limits(void **state)
{
	static const struct {
		uint8_t function, quantity_high, quantity_low, bytes, expected;
	} cases[] = {
		{ 15, 0x07, 0xB0, 246, 0 },
		{ 15, 0x07, 0xB1, 247, 3 },
		{ 16, 0, 123, 246, 0 },
		{ 16, 0, 124, 248, 3 },
	};
	uint8_t adu[DB_ADU_MAX + 8], pdu[256] = { 0 };
	struct db_modbus_request r;

	(void)state;
	for (size_t i = 0; i < SIZE(cases); i++) {
		pdu[0] = cases[i].function;
		pdu[3] = cases[i].quantity_high;
		pdu[4] = cases[i].quantity_low;
		pdu[5] = cases[i].bytes;
		assert_int_equal(db_pdu_parse(adu, frame(adu, pdu, 6u + cases[i].bytes), &r),
		                 cases[i].expected);
	}
	memcpy(pdu, (const uint8_t[]){ 23, 0, 0, 0, 125, 0, 0, 0, 121, 242 }, 10);
	assert_int_equal(parse(&r, adu, pdu, 10 + 242), 0);
	pdu[4] = 126;
	assert_int_equal(parse(&r, adu, pdu, 10 + 242), 3);
	pdu[4] = 125;
	pdu[8] = 122;
	pdu[9] = 244;
	assert_int_equal(db_pdu_parse(adu, frame(adu, pdu, 10 + 244), &r), 3);
}

static void mask_and_write_read(void **state)
{
	static const uint16_t registers[] = { 0x00FE, 0x0ACD };
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	struct db_modbus_request r;
	uint16_t values[1];

	(void)state;
	assert_int_equal(PARSE(&r, adu, 22, 0, 4, 0, 0xF2, 0, 0x25), 0);
	assert_int_equal(r.write_address, 4);
	assert_int_equal(r.value, 0xF2);
	assert_int_equal(r.or_mask, 0x25);
	assert_int_equal(r.read_count, 0);
	CHECK(out, db_pdu_written(&r, out), 22, 0, 4, 0, 0xF2, 0, 0x25);

	assert_int_equal(PARSE(&r, adu, 23, 0, 3, 0, 2, 0, 14, 0, 1, 2, 0, 0xFF), 0);
	db_pdu_values(&r, values);
	assert_int_equal(r.read_address, 3);
	assert_int_equal(r.write_address, 14);
	assert_int_equal(values[0], 0xFF);
	CHECK(out, db_pdu_read(&r, registers, out), 23, 4, 0, 0xFE, 0x0A, 0xCD);
	assert_int_equal(PARSE(&r, adu, 23, 0, 3, 0, 0, 0, 14, 0, 1, 2, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 23, 0, 3, 0, 1, 0, 14, 0, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 23, 0, 3, 0, 1, 0, 14, 0, 1, 4, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 23, 0xFF, 0xFF, 0, 2, 0, 14, 0, 1, 2, 0, 0), 2);
	assert_int_equal(PARSE(&r, adu, 23, 0, 0, 0, 2, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0), 2);
}

/* One byte too few and one too many, for every function. */
static void wrong_lengths(void **state)
{
	static const struct {
		uint8_t length, pdu[16];
	} good[] = {
		{ 5, { 1, 0, 0, 0, 1 } },        { 5, { 2, 0, 0, 0, 1 } },
		{ 5, { 3, 0, 0, 0, 1 } },        { 5, { 4, 0, 0, 0, 1 } },
		{ 5, { 5, 0, 0, 0xFF, 0 } },     { 5, { 6, 0, 0, 0, 1 } },
		{ 7, { 15, 0, 0, 0, 1, 1, 1 } }, { 8, { 16, 0, 0, 0, 1, 2, 0, 1 } },
		{ 5, { 8, 0, 11, 0, 0 } },       { 1, { 17 } },
		{ 7, { 22, 0, 0, 0, 1, 0, 1 } }, { 12, { 23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 1 } },
		{ 4, { 43, 14, 1, 0 } },
	};
	/* A write hidden behind a read, covered by one length. */
	static const uint8_t hidden[] = { 3, 0, 0,  0, 1, 0, 2, 0, 0, 0,
		                          9, 5, 16, 0, 0, 0, 1, 2, 0, 1 };
	uint8_t adu[DB_ADU_MAX];
	struct db_modbus_request r;

	(void)state;
	for (size_t i = 0; i < SIZE(good); i++) {
		assert_int_equal(parse(&r, adu, good[i].pdu, good[i].length), 0);
		assert_int_equal(parse(&r, adu, good[i].pdu, good[i].length + 1u), 3);
		for (size_t length = 1; length < good[i].length; length++)
			assert_int_equal(parse(&r, adu, good[i].pdu, length), 3);
	}
	assert_int_equal(parse(&r, adu, hidden, sizeof(hidden)), 3);
	assert_int_equal(r.function, 3);
}

static void unknown_functions(void **state)
{
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 7), 1);
	CHECK(out, db_pdu_exception(&r, 1, out), 0x87, 1);
	assert_int_equal(PARSE(&r, adu, 0), 1);
	assert_int_equal(PARSE(&r, adu, 0x83, 0, 0, 0, 1), 1);
	/* CANopen over Modbus is another function, not a bad value. */
	assert_int_equal(PARSE(&r, adu, 43, 13, 0, 0, 0, 0), 1);
	assert_int_equal(PARSE(&r, adu, 43, 14, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 43, 14, 5, 0), 3);
}

static void diagnostics(void **state)
{
	static const struct {
		uint8_t sub_function, counter;
	} cases[] = { { 11, 7 }, { 12, 1 }, { 13, 3 }, { 14, 6 },
		      { 15, 0 }, { 16, 1 }, { 17, 2 }, { 18, 4 } };
	struct db_diagnostics counted = { .counters = { 0 } };
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	uint8_t pdu[253] = { 8, 0, 0, 0x5A };
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 8, 0, 0, 0x12, 0x34), 0);
	CHECK(out, db_pdu_diagnostic(&r, &counted, out), 8, 0, 0, 0x12, 0x34);
	assert_int_equal(PARSE(&r, adu, 8, 0, 0, 1, 2, 3, 4), 0);
	CHECK(out, db_pdu_diagnostic(&r, &counted, out), 8, 0, 0, 1, 2, 3, 4);
	/* The longest one comes back whole. */
	assert_int_equal(parse(&r, adu, pdu, sizeof(pdu)), 0);
	check_frame(out, db_pdu_diagnostic(&r, &counted, out), pdu, sizeof(pdu));
	db_diagnostics_add(&counted, DB_DIAGNOSTIC_BUS_MESSAGES, 7);
	db_diagnostics_add(&counted, DB_DIAGNOSTIC_BUS_ERRORS, 1);
	db_diagnostics_add(&counted, DB_DIAGNOSTIC_MESSAGES, 6);
	db_diagnostics_add(&counted, DB_DIAGNOSTIC_OVERRUNS, 4);
	db_diagnostics_count_answer(&counted, 0);
	db_diagnostics_count_answer(&counted, 6);
	db_diagnostics_count_answer(&counted, 6);
	db_diagnostics_count_answer(&counted, 7);
	for (size_t i = 0; i < SIZE(cases); i++) {
		assert_int_equal(PARSE(&r, adu, 8, 0, cases[i].sub_function, 0, 0), 0);
		CHECK(out, db_pdu_diagnostic(&r, &counted, out), 8, 0, cases[i].sub_function, 0,
		      cases[i].counter);
	}
	db_diagnostics_add(&counted, DB_DIAGNOSTIC_MESSAGES, 65536 - 6 + 0x0102);
	assert_int_equal(PARSE(&r, adu, 8, 0, 14, 0, 0), 0);
	CHECK(out, db_pdu_diagnostic(&r, &counted, out), 8, 0, 14, 1, 2);
	assert_int_equal(PARSE(&r, adu, 8, 0, 10, 0, 0), 0);
	CHECK(out, db_pdu_diagnostic(&r, &counted, out), 8, 0, 10, 0, 0);
	for (size_t i = 0; i < SIZE(counted.counters); i++)
		assert_int_equal(counted.counters[i], 0);
}

static void wrong_diagnostics(void **state)
{
	static const uint8_t others[] = { 1, 2, 3, 4, 9, 19, 20, 255 };
	uint8_t adu[DB_ADU_MAX];
	struct db_modbus_request r;

	(void)state;
	for (size_t i = 0; i < SIZE(others); i++)
		assert_int_equal(PARSE(&r, adu, 8, 0, others[i], 0, 0), 1);
	assert_int_equal(PARSE(&r, adu, 8, 1, 11, 0, 0), 1);
	assert_int_equal(PARSE(&r, adu, 8, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 8, 0, 0, 1), 3);
	assert_int_equal(PARSE(&r, adu, 8, 0, 0, 1, 2, 3), 3);
	assert_int_equal(PARSE(&r, adu, 8, 0, 11, 0, 1), 3);
	assert_int_equal(PARSE(&r, adu, 8, 0, 10, 0xFF, 0), 3);
	assert_int_equal(PARSE(&r, adu, 8, 0, 11, 0, 0, 0, 0), 3);
	assert_int_equal(PARSE(&r, adu, 8), 3);
}

static void every_exception(void **state)
{
	static const uint8_t codes[] = { 1, 2, 3, 4, 5, 6, 0x0A, 0x0B };
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 16, 0, 1, 0, 1, 2, 0, 1), 0);
	for (size_t i = 0; i < SIZE(codes); i++)
		CHECK(out, db_pdu_exception(&r, codes[i], out), 0x90, codes[i]);
}

static void server_id(void **state)
{
	char text[300];
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX];
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 17), 0);
	CHECK(out, db_pdu_server_id(&r, "ab", 2, true, out), 17, 4, 5, 0xFF, 'a', 'b');
	CHECK(out, db_pdu_server_id(&r, NULL, 0, false, out), 17, 2, 5, 0);
	memset(text, 'x', sizeof(text));
	assert_int_equal(db_pdu_server_id(&r, text, sizeof(text), true, out), DB_ADU_MAX);
	assert_int_equal(out[8], 251);
	assert_int_equal(out[10], 0xFF);
}

static const char *const OBJECTS[DB_DEVICE_ID_OBJECTS] = { "V", "PC", "1", NULL, "N", NULL, "app" };

static void device_id_streams(void **state)
{
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX], e;
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 43, 14, 1, 0), 0);
	CHECK(out, db_pdu_device_id(&r, OBJECTS, out, &e), 43, 14, 1, 0x82, 0, 0, 3, 0, 1, 'V', 1,
	      2, 'P', 'C', 2, 1, '1');
	assert_int_equal(PARSE(&r, adu, 43, 14, 2, 2), 0);
	CHECK(out, db_pdu_device_id(&r, OBJECTS, out, &e), 43, 14, 2, 0x82, 0, 0, 3, 2, 1, '1', 4,
	      1, 'N', 6, 3, 'a', 'p', 'p');
	/* An unknown object restarts a stream: 3 is missing, 4 is not basic. */
	assert_int_equal(PARSE(&r, adu, 43, 14, 3, 3), 0);
	CHECK(out, db_pdu_device_id(&r, OBJECTS, out, &e), 43, 14, 3, 0x82, 0, 0, 5, 0, 1, 'V', 1,
	      2, 'P', 'C', 2, 1, '1', 4, 1, 'N', 6, 3, 'a', 'p', 'p');
	assert_int_equal(PARSE(&r, adu, 43, 14, 1, 4), 0);
	assert_int_not_equal(db_pdu_device_id(&r, OBJECTS, out, &e), 0);
	assert_int_equal(out[13], 3);
	assert_int_equal(e, 0);
}

static void device_id_single(void **state)
{
	static const char *const nothing[DB_DEVICE_ID_OBJECTS] = { NULL };
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX], e;
	struct db_modbus_request r;

	(void)state;
	assert_int_equal(PARSE(&r, adu, 43, 14, 4, 6), 0);
	CHECK(out, db_pdu_device_id(&r, OBJECTS, out, &e), 43, 14, 4, 0x82, 0, 0, 1, 6, 3, 'a', 'p',
	      'p');
	assert_int_equal(PARSE(&r, adu, 43, 14, 4, 3), 0);
	assert_int_equal(db_pdu_device_id(&r, OBJECTS, out, &e), 0);
	assert_int_equal(e, 2);
	assert_int_equal(PARSE(&r, adu, 43, 14, 4, 0x80), 0);
	assert_int_equal(db_pdu_device_id(&r, OBJECTS, out, &e), 0);
	assert_int_equal(e, 2);
	assert_int_equal(PARSE(&r, adu, 43, 14, 1, 0), 0);
	assert_int_equal(db_pdu_device_id(&r, nothing, out, &e), 0);
	assert_int_equal(e, 1);
}

static void device_id_more_follows(void **state)
{
	char text[301] = { 0 };
	const char *const objects[DB_DEVICE_ID_OBJECTS] = { "V", text, "1" };
	uint8_t adu[DB_ADU_MAX], out[DB_ADU_MAX], e;
	struct db_modbus_request r;

	(void)state;
	/* Cut to 244 bytes it fills an answer alone. */
	memset(text, 'x', 300);
	assert_int_equal(PARSE(&r, adu, 43, 14, 1, 0), 0);
	CHECK(out, db_pdu_device_id(&r, objects, out, &e), 43, 14, 1, 0x82, 0xFF, 1, 1, 0, 1, 'V');
	assert_int_equal(PARSE(&r, adu, 43, 14, 1, 1), 0);
	assert_int_equal(db_pdu_device_id(&r, objects, out, &e), DB_ADU_MAX);
	assert_int_equal(out[11], 0xFF);
	assert_int_equal(out[12], 2);
	assert_int_equal(out[15], 244);
	assert_int_equal(PARSE(&r, adu, 43, 14, 1, 2), 0);
	CHECK(out, db_pdu_device_id(&r, objects, out, &e), 43, 14, 1, 0x82, 0, 0, 1, 2, 1, '1');
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(cuts_frames),         cmocka_unit_test(reads),
		cmocka_unit_test(read_limits),         cmocka_unit_test(single_writes),
		cmocka_unit_test(multiple_writes),     cmocka_unit_test(write_limits),
		cmocka_unit_test(mask_and_write_read), cmocka_unit_test(wrong_lengths),
		cmocka_unit_test(unknown_functions),   cmocka_unit_test(every_exception),
		cmocka_unit_test(diagnostics),         cmocka_unit_test(wrong_diagnostics),
		cmocka_unit_test(server_id),           cmocka_unit_test(device_id_streams),
		cmocka_unit_test(device_id_single),    cmocka_unit_test(device_id_more_follows),
	};

	return cmocka_run_group_tests_name("server/pdu", tests, NULL, NULL);
}
