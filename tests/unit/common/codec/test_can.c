/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The expected numbers of bits come from a second way of counting: the frame as a string of bits,
 * its CRC by long division with x^15+x^14+x^10+x^8+x^7+x^4+x^3+1, stuffing on the string.
 */
#include "codec/can.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

struct vector {
	struct db_can_frame frame;
	unsigned bits;
};

#define EXT DB_CAN_EXTENDED
#define RTR DB_CAN_REMOTE
#define EIGHT(b)                       \
	{                              \
		b, b, b, b, b, b, b, b \
	}

static void bits_of_known_frames(void **state)
{
	static const struct vector vectors[] = {
		{ { .id = 0 }, 53 },
		{ { .id = 0x7FF }, 50 },
		{ { .id = 0x123, .length = 3, .data = { 0x11, 0x22, 0x33 } }, 72 },
		{ { .id = 0x555, .length = 8, .data = EIGHT(0x55) }, 112 },
		{ { .id = 0, .length = 8 }, 127 },
		{ { .id = 0x7FF, .length = 8, .data = EIGHT(0xFF) }, 126 },
		{ { .id = 0x078, .length = 8, .data = EIGHT(0x3C) }, 131 },
		{ { .id = EXT }, 74 },
		{ { .id = EXT | 0x1FFFFFFF, .length = 8, .data = EIGHT(0xFF) }, 149 },
		{ { .id = EXT, .length = 8 }, 150 },
		{ { .id = EXT | 0x12345678, .length = 8, .data = { 1, 2, 3, 4, 5, 6, 7, 8 } },
		  140 },
		{ { .id = EXT | 0x000C0101, .length = 4, .data = { 0, 0, 0x80, 0x3F } }, 111 },
		{ { .id = EXT | 0x15555555, .length = 8, .data = EIGHT(0x55) }, 131 },
		/* The CRC ends in five equal bits: a stuff bit follows it all the same. */
		{ { .id = 0x009 }, 52 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; i++)
		assert_int_equal(db_can_frame_bits(&vectors[i].frame), vectors[i].bits);
}

static void remote_frames_carry_a_length_and_no_data(void **state)
{
	struct db_can_frame standard = { .id = RTR | 0x123, .length = 8, .data = EIGHT(0xFF) };
	struct db_can_frame extended = { .id = EXT | RTR | 0x1ABCDEF, .length = 4 };
	struct db_can_frame empty = { .id = RTR | 0x7FF };

	(void)state;
	assert_int_equal(db_can_frame_bits(&standard), 48);
	assert_int_equal(db_can_frame_bits(&extended), 71);
	assert_int_equal(db_can_frame_bits(&empty), 50);
}

static void the_most_is_what_textbooks_say(void **state)
{
	(void)state;
	assert_int_equal(db_can_frame_bits_max(false, 0), 55);
	assert_int_equal(db_can_frame_bits_max(false, 8), 135);
	assert_int_equal(db_can_frame_bits_max(true, 0), 80);
	assert_int_equal(db_can_frame_bits_max(true, 4), 120);
	assert_int_equal(db_can_frame_bits_max(true, 8), 160);
	assert_int_equal(db_can_frame_bits_max(true, 200), 160);
}

/* A frame that stuffs as often as one can up to its CRC; none may be beyond the most. */
static void no_frame_has_more_bits_than_the_most(void **state)
{
	struct db_can_frame frame = { .length = 8 };
	uint32_t random = 12345;

	(void)state;
	for (unsigned i = 0; i < 20000; i++) {
		unsigned bits;

		random = random * 1664525u + 1013904223u;
		frame.id = (i & 1 ? EXT : 0) | (random >> 3 & (i & 1 ? 0x1FFFFFFFu : 0x7FFu));
		frame.length = (uint8_t)(i % 9);
		memset(frame.data, i & 2 ? 0x3C : (int)(random >> 24), sizeof frame.data);
		bits = db_can_frame_bits(&frame);
		assert_in_range(bits, (i & 1 ? 67u : 47u) + 8u * frame.length,
		                db_can_frame_bits_max(i & 1, frame.length));
	}
}

static void a_length_beyond_eight_counts_as_eight(void **state)
{
	struct db_can_frame frame = { .id = EXT, .length = 255 };

	(void)state;
	assert_int_equal(db_can_frame_bits(&frame), 150);
}

static void filters_compare_the_bits_they_name(void **state)
{
	static const struct db_can_filter filters[] = {
		{ .id = 0x123, .mask = EXT | RTR | DB_CAN_STANDARD_MASK },
		{ .id = EXT | 0x00FF0000, .mask = EXT | 0x00FF0000 },
	};
	struct db_can_frame frame = { .id = 0x123 };

	(void)state;
	assert_true(db_can_filter_passes(filters, 2, &frame));
	frame.id = RTR | 0x123;
	assert_false(db_can_filter_passes(filters, 2, &frame));
	frame.id = EXT | 0x123;
	assert_false(db_can_filter_passes(filters, 2, &frame));
	frame.id = 0x124;
	assert_false(db_can_filter_passes(filters, 2, &frame));
	frame.id = EXT | RTR | 0x1AFFCDEF;
	assert_true(db_can_filter_passes(filters, 2, &frame));
	assert_false(db_can_filter_passes(filters, 1, &frame));
	frame.id = EXT | 0x00FE0000;
	assert_false(db_can_filter_passes(filters, 2, &frame));
	assert_true(db_can_filter_passes(NULL, 0, &frame));
}

/* Bits of the filter's id outside its mask mean nothing. */
static void a_filter_ignores_what_its_mask_leaves_out(void **state)
{
	static const struct db_can_filter filter = { .id = 0x7F5, .mask = 0x00F };
	struct db_can_frame frame = { .id = 0x105 };

	(void)state;
	assert_true(db_can_filter_passes(&filter, 1, &frame));
	frame.id = 0x7F4;
	assert_false(db_can_filter_passes(&filter, 1, &frame));
}

static void frames_are_cut_every_sixteen_bytes(void **state)
{
	uint8_t bytes[40] = { 0 };
	size_t skip = 9;
	size_t length = 9;

	(void)state;
	db_can_cut(bytes, 15, &skip, &length);
	assert_int_equal(skip, 0);
	assert_int_equal(length, 0);
	db_can_cut(bytes, 16, &skip, &length);
	assert_int_equal(length, 16);
	db_can_cut(bytes, sizeof bytes, &skip, &length);
	assert_int_equal(skip, 0);
	assert_int_equal(length, 16);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(bits_of_known_frames),
		cmocka_unit_test(remote_frames_carry_a_length_and_no_data),
		cmocka_unit_test(the_most_is_what_textbooks_say),
		cmocka_unit_test(no_frame_has_more_bits_than_the_most),
		cmocka_unit_test(a_length_beyond_eight_counts_as_eight),
		cmocka_unit_test(filters_compare_the_bits_they_name),
		cmocka_unit_test(a_filter_ignores_what_its_mask_leaves_out),
		cmocka_unit_test(frames_are_cut_every_sixteen_bytes),
	};

	return cmocka_run_group_tests_name("can", tests, NULL, NULL);
}
