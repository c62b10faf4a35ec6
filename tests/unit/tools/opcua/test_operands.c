/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/operands.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* Headers, the id of a request's type, two bytes of the request, and one operand. */
#define HEAD "MSGF____channeltokeseqnrequ"
static const uint8_t create[] = { 0x01, 0x00, 0xEF, 0x02 };
static const uint8_t modify[] = { 0x02, 0x00, 0x00, 0xFB, 0x02, 0x00, 0x00 };
static const uint8_t read[] = { 0x01, 0x00, 0x77, 0x02 };
static const uint8_t four[] = { 0x01, 0x00, 0xDE, 0x0A };
static const uint8_t seven[] = { 0x02, 0x00, 0x00, 0xDE, 0x0A, 0x00, 0x00 };
static const uint8_t other[] = { 0x01, 0x00, 0xF9, 0x07 };
static const uint8_t condition_id[] = {
	0xFF, 0xFF, 0xFF, 0xFF, 1, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF
};
static const uint8_t without_path[] = { 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0 };
static const uint8_t with_path[] = { 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0 };
static const uint8_t value[] = { 0, 0, 0, 0, 13, 0, 0, 0, 0, 0, 0, 0 };

struct part {
	const uint8_t *bytes;
	size_t size;
};

#define PART(bytes)                  \
	{                            \
		bytes, sizeof(bytes) \
	}

static size_t put(uint8_t *chunk, const struct part *parts, size_t count)
{
	size_t length = 24;

	memcpy(chunk, HEAD, length);
	for (size_t i = 0; i < count; i++) {
		memcpy(chunk + length, parts[i].bytes, parts[i].size);
		length += parts[i].size;
	}
	return length;
}

static void test_what_is_changed(void **state)
{
	static const uint8_t some[] = { 0x01, 0x00 };
	static const struct {
		struct part parts[4];
		size_t changed; /* where the number of the type begins in its id; 0: nowhere */
	} cases[] = {
		{ { PART(create), PART(some), PART(four), PART(condition_id) }, 2 },
		{ { PART(modify), PART(some), PART(seven), PART(without_path) }, 3 },
		{ { PART(create), PART(some), PART(four), PART(with_path) }, 0 },
		{ { PART(create), PART(some), PART(four), PART(value) }, 0 },
		{ { PART(create), PART(some), PART(other), PART(condition_id) }, 0 },
		{ { PART(read), PART(some), PART(four), PART(condition_id) }, 0 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		uint8_t chunk[64];
		uint8_t before[64];
		size_t length = put(chunk, cases[i].parts, 4);
		size_t at = 24 + cases[i].parts[0].size + sizeof(some) + cases[i].changed;

		memcpy(before, chunk, length);
		/* A part of it has no whole operand. */
		for (size_t part = 0; part < length; part++)
			db_opcua_operands_mend(chunk, part);
		assert_memory_equal(chunk, before, length);
		db_opcua_operands_mend(chunk, length);
		if (cases[i].changed) {
			assert_int_equal(chunk[at], 0xF9);
			assert_int_equal(chunk[at + 1], 0x07);
			memcpy(before + at, chunk + at, 2);
		}
		assert_memory_equal(chunk, before, length);
	}
}

static void test_other_messages_stay(void **state)
{
	static const struct part parts[] = { PART(create), PART(four), PART(condition_id) };
	uint8_t chunk[64];
	uint8_t before[64];
	size_t length = put(chunk, parts, 3);

	(void)state;
	memcpy(chunk, "OPN", 3);
	memcpy(before, chunk, length);
	db_opcua_operands_mend(chunk, length);
	assert_memory_equal(chunk, before, length);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_what_is_changed),
		cmocka_unit_test(test_other_messages_stay),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
