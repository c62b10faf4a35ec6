/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/transport_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

static void answers_are_as_few_frames_as_can_be(void **state)
{
	(void)state;
	/* No request: what could be longest is an extended frame. */
	assert_int_equal(db_can_wire_bits(NULL, 0, 0), 0);
	assert_int_equal(db_can_wire_bits(NULL, 0, 8), 67);
	assert_int_equal(db_can_wire_bits(NULL, 0, 16), 131);
	assert_int_equal(db_can_wire_bits(NULL, 0, 24), 198);
	assert_int_equal(db_can_wire_bits(NULL, 0, 36), 297); /* three with four bytes each */
	assert_int_equal(db_can_wire_bits(NULL, 0, 3), 67);
}

static void answers_are_of_the_requests_kind(void **state)
{
	static const struct db_can_frame standard = { .id = 0x7FF };
	static const struct db_can_frame extended = { .id = DB_CAN_EXTENDED };
	uint8_t bytes[16];

	(void)state;
	memcpy(bytes, &standard, sizeof bytes);
	assert_int_equal(db_can_wire_bits(bytes, sizeof bytes, 16), 50 + 111);
	memcpy(bytes, &extended, sizeof bytes);
	assert_int_equal(db_can_wire_bits(bytes, sizeof bytes, 16), 74 + 131);
}

static void frames_need_not_be_aligned(void **state)
{
	static const struct db_can_frame frame = { .id = 0x123, .length = 1, .data = { 7 } };
	uint8_t bytes[40];
	struct db_can_frame got;

	(void)state;
	memcpy(bytes + 3 + 16, &frame, sizeof frame);
	got = db_can_frame_at(bytes + 3, 16);
	assert_memory_equal(&got, &frame, sizeof frame);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(answers_are_as_few_frames_as_can_be),
		cmocka_unit_test(answers_are_of_the_requests_kind),
		cmocka_unit_test(frames_need_not_be_aligned),
	};

	return cmocka_run_group_tests_name("CAN wire", tests, NULL, NULL);
}
