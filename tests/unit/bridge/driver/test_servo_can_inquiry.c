/* SPDX-License-Identifier: Apache-2.0 */
/* What a scan asks servos on CAN, and which of their frames it takes for an answer. */
#include "codec/can.h"
#include "codec/servo_can.h"
#include "driver/list.h"
#include "fakes/options.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

static const struct db_driver *const driver = &db_driver_servo_can;
static struct fake_options options;
static struct db_bus_config bus = { .driver = &db_driver_servo_can,
	                            .bitrate = 1000000,
	                            .options = options.bus };

/* False: there is no such question. Else it is in `frame`. */
static bool ask(enum db_inquiry_kind kind, unsigned address, struct db_can_frame *frame)
{
	const struct db_inquiry inquiry = { .kind = kind, .address = address };
	uint8_t bytes[DB_SHORT_REQUEST];
	struct db_exchange exchange = { .request = bytes,
		                        .request_size = sizeof(*frame),
		                        .extra_time = 1 };

	if (!driver->inquire(&bus, &inquiry, &exchange))
		return false;
	assert_int_equal(exchange.request_length, sizeof(*frame));
	/* The head of a frame, and its data; it comes at once. */
	assert_int_equal(exchange.answer_length, 8 + 4);
	assert_true(exchange.extra_time == 0);
	memcpy(frame, bytes, sizeof(*frame));
	return true;
}

/* The analogue input: no cycle reads it at the same moment. */
static void every_node_can_be_asked(void **state)
{
	struct db_can_frame frame;

	(void)state;
	for (unsigned node = 1; node <= SERVO_CAN_NODE_MAX; node++) {
		assert_true(ask(DB_INQUIRY_THERE, node, &frame));
		assert_int_equal(frame.id, 0x140 + node);
		assert_int_equal(frame.length, 1);
		assert_int_equal(frame.data[0], 7);
	}
	assert_false(ask(DB_INQUIRY_THERE, 0, &frame));
	assert_false(ask(DB_INQUIRY_THERE, SERVO_CAN_NODE_MAX + 1, &frame));
	/* 256 more is not the same node. */
	assert_false(ask(DB_INQUIRY_THERE, 256 + 5, &frame));
}

static void nothing_else_can_be_asked_or_set(void **state)
{
	static const enum db_inquiry_kind kinds[] = { DB_INQUIRY_IDENTITY, DB_INQUIRY_STANDING,
		                                      DB_INQUIRY_SET_ADDRESS };
	struct db_can_frame frame;

	(void)state;
	for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
		assert_false(ask(kinds[i], 5, &frame));
	assert_int_equal(driver->address_effect, DB_TAKES_EFFECT_NEVER);
	assert_int_equal(driver->speed_effect, DB_TAKES_EFFECT_NEVER);
}

static void a_question_needs_room_for_a_whole_frame(void **state)
{
	const struct db_inquiry inquiry = { .kind = DB_INQUIRY_THERE, .address = 5 };
	uint8_t bytes[sizeof(struct db_can_frame)] = { 0 };
	struct db_exchange exchange = { .request = bytes, .request_size = sizeof(bytes) - 1 };

	(void)state;
	assert_false(driver->inquire(&bus, &inquiry, &exchange));
	exchange.request_size++;
	assert_true(driver->inquire(&bus, &inquiry, &exchange));
}

static enum db_recognised take(unsigned asked, uint32_t id, uint8_t length,
                               struct db_inquired *found)
{
	const struct db_inquiry inquiry = { .kind = DB_INQUIRY_THERE, .address = asked };
	const struct db_can_frame frame = { .id = id, .length = length, .data = { 1, 2, 3, 4 } };

	return driver->recognise(&bus, &inquiry, (const uint8_t *)&frame, sizeof(frame), found);
}

static void an_answer_is_the_analogue_input_of_the_node_that_was_asked(void **state)
{
	struct db_inquired found = { .parts = 0 };

	(void)state;
	assert_int_equal(take(5, 0x226, 2, &found), DB_RECOGNISED_NOTHING);
	assert_int_equal(take(5, 0x165, 4, &found), DB_RECOGNISED_NOTHING);
	assert_int_equal(take(5, 0x006, 1, &found), DB_RECOGNISED_NOTHING);
	assert_int_equal(take(5, 0x225, 1, &found), DB_RECOGNISED_NOTHING);
	assert_int_equal(found.parts, 0);
	assert_int_equal(take(5, 0x225, 2, &found), DB_RECOGNISED_ANSWER);
	/* A second one is from a second drive. */
	assert_int_equal(take(5, 0x225, 2, &found), DB_RECOGNISED_AGAIN);
	assert_int_equal(
		driver->recognise(&bus,
	                          &(struct db_inquiry){ .kind = DB_INQUIRY_THERE, .address = 5 },
	                          (const uint8_t *)"\x02\x25", 2, &found),
		DB_RECOGNISED_NOTHING);
}

static int preset(void **state)
{
	(void)state;
	fake_preset_options(driver, &options);
	return 0;
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_node_can_be_asked),
		cmocka_unit_test(nothing_else_can_be_asked_or_set),
		cmocka_unit_test(a_question_needs_room_for_a_whole_frame),
		cmocka_unit_test(an_answer_is_the_analogue_input_of_the_node_that_was_asked),
	};

	return cmocka_run_group_tests_name("driver/servo_can_inquiry", tests, preset, NULL);
}
