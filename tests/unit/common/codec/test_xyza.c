/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/xyza_frames.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define SLAVE 3 /* of all examples in the document */

/* --- helpers -------------------------------------------------------------------------------------- */

/* "5A A5 0A" as bytes; returns how many. */
static size_t from_hex(const char *hex, uint8_t *bytes, size_t size)
{
	size_t length = 0;

	for (; *hex && length < size; hex += hex[2] ? 3 : 2)
		bytes[length++] = (uint8_t)strtoul((const char[]){ hex[0], hex[1], 0 }, NULL, 16);
	return length;
}

static void seal(uint8_t *frame, size_t length)
{
	unsigned total = 0;

	assert_in_range(length, 1, XYZA_FRAME_MAX);
	for (size_t i = 3; i + 1 < length; i++)
		total += frame[i];
	frame[length - 1] = (uint8_t)total;
}

static void assert_same_request(const struct xyza_request *a, const struct xyza_request *b)
{
	assert_int_equal(a->verb, b->verb);
	assert_int_equal(a->object, b->object);
	assert_int_equal(a->axis, b->axis);
	assert_int_equal(a->item, b->item);
	assert_int_equal(a->negative, b->negative);
	assert_int_equal(a->on, b->on);
	assert_int_equal(a->number, b->number);
	assert_int_equal(a->value, b->value);
}

static void assert_same_reply(const struct xyza_reply *a, const struct xyza_reply *b)
{
	assert_int_equal(a->kind, b->kind);
	assert_int_equal(a->object, b->object);
	assert_int_equal(a->item_class, b->item_class);
	assert_int_equal(a->target, b->target);
	assert_int_equal(a->value, b->value);
	assert_int_equal(a->state, b->state);
	assert_int_equal(a->program, b->program);
	assert_int_equal(a->step, b->step);
	if (a->kind == XYZA_REPLY_DONE || a->kind == XYZA_REPLY_FAILED)
		assert_int_equal(a->order, b->order);
}

static void assert_cut_whole(const uint8_t *frame, size_t length)
{
	size_t skip = 1;
	size_t cut = 0;

	xyza_cut(frame, length, &skip, &cut);
	assert_int_equal(skip, 0);
	assert_int_equal(cut, length);
	xyza_cut(frame, length - 1, &skip, &cut);
	assert_int_equal(skip, 0);
	assert_int_equal(cut, 0);
}

/* --- the document's frames ------------------------------------------------------------------------ */

#define PRINTED_RIGHT 104
#define PRINTED_WRONG 24

/* Every frame that is printed with a right sum, and how often it is printed. Frames in tables have no
 * header and no mark there; one has the header FF A5, see test_header_misprint(). */
static const struct {
	const char *frame;
	unsigned times;
	struct xyza_request request;
} requests[] = {
	{ "5A A5 0A AC 01 03 AC AC 08", 2, { .verb = XYZA_VERB_ONLINE } },
	{ "5A A5 0A F1 01 03 E1 A1 77", 2, { .verb = XYZA_READ_MAGNITUDE, .axis = XYZA_X } },
	{ "5A A5 0A F1 01 03 E2 A1 78",
	  2,
	  { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_MIN_SPEED } },
	{ "5A A5 0A F1 01 03 E2 A3 7A",
	  1,
	  { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_ACCELERATION_TIME } },
	{ "5A A5 0A F1 01 03 E3 A1 79",
	  2,
	  { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_STEP_ANGLE } },
	{ "5A A5 0A F1 01 03 E3 A3 7B", 1, { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_LEAD } },
	{ "5A A5 0A F1 01 03 E4 A1 7A", 1, { .verb = XYZA_READ_PORTS } },
	{ "5A A5 0A F1 01 03 E5 C1 9B", 1, { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_ENABLE } },
	{ "5A A5 0A F1 01 03 E5 C2 9C", 1, { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_KEYS } },
	{ "5A A5 0A F1 01 03 E5 C3 9D", 1, { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_BRAKE } },
	{ "5A A5 0A F1 01 03 E5 C4 9E", 1, { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_SOUND } },
	{ "5A A5 0A F1 01 03 E5 C7 A1", 1, { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_START_UP } },
	{ "5A A5 0A F3 01 03 03 A1 9B", 1, { .verb = XYZA_MANUAL_JOG, .axis = XYZA_X } },
	{ "5A A5 0A F4 01 03 0A 00 02", 3, { .verb = XYZA_PROGRAM_STATE } },
	{ "5A A5 0A F4 01 03 02 00 FA", 1, { .verb = XYZA_PROGRAM_STOP } },
	{ "5A A5 0B F1 01 03 E2 A1 C8 00 00 00 40",
	  2,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_MIN_SPEED, .value = 200 } },
	{ "5A A5 0B F1 01 03 E1 A1 0C 10 00 00 93",
	  2,
	  { .verb = XYZA_WRITE_MAGNITUDE, .axis = XYZA_X, .value = 4108 } },
	{ "5A A5 0B F1 01 03 E1 A2 01 00 00 00 79",
	  1,
	  { .verb = XYZA_WRITE_SIGN, .axis = XYZA_X, .negative = true } },
	{ "5A A5 0B F1 01 03 E2 A1 40 01 00 00 B9",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_MIN_SPEED, .value = 320 } },
	{ "5A A5 0B F1 01 03 E2 A2 80 0C 00 00 05",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_MAX_SPEED, .value = 3200 } },
	{ "5A A5 0B F1 01 03 E2 A3 05 00 00 00 7F",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_ACCELERATION_TIME, .value = 5 } },
	{ "5A A5 0B F1 01 03 E3 A1 2C 01 00 00 A6",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_STEP_ANGLE, .value = 300 } },
	{ "5A A5 0B F1 01 03 E3 A2 10 00 00 00 8A",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_MICROSTEP, .value = 16 } },
	{ "5A A5 0B F1 01 03 E3 A3 88 13 00 00 16",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_LEAD, .value = 5000 } },
	{ "5A A5 0B F1 01 03 E4 00 88 00 00 00 61",
	  2,
	  { .verb = XYZA_WRITE_OUTPUT, .number = 8, .on = true } },
	{ "5A A5 0B F1 01 03 E4 00 22 00 00 00 FB",
	  1,
	  { .verb = XYZA_WRITE_OUTPUT, .number = 2, .on = true } },
	{ "5A A5 0B F1 01 03 E4 00 20 00 00 00 F9", 1, { .verb = XYZA_WRITE_OUTPUT, .number = 2 } },
	{ "5A A5 0B F1 01 03 E4 00 9F 00 00 00 78", 1, { .verb = XYZA_WRITE_OUTPUTS, .on = true } },
	{ "5A A5 0B F1 01 03 E4 00 90 00 00 00 69", 1, { .verb = XYZA_WRITE_OUTPUTS } },
	{ "5A A5 0B F1 01 03 E5 C1 01 00 00 00 9C",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_ENABLE, .value = 1 } },
	{ "5A A5 0B F1 01 03 E5 C2 06 07 08 00 B1",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_KEYS, .value = 0x080706 } },
	{ "5A A5 0B F1 01 03 E5 C3 0C 00 00 00 A9",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_BRAKE, .value = 12 } },
	{ "5A A5 0B F1 01 03 E5 C4 01 00 00 00 9F",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_SOUND, .value = 1 } },
	{ "5A A5 0B F1 01 03 E5 C7 01 00 00 00 A2",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_START_UP, .value = 1 } },
	{ "5A A5 0B F1 01 03 E5 C9 01 00 00 00 A4",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_PULSE_MODE, .value = 1 } },
	{ "5A A5 0B F1 01 03 E5 CA 00 00 00 00 A4",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_FACTORY_RESET } },
	{ "5A A5 0B F1 01 03 E5 CB 06 00 00 00 AB",
	  1,
	  { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_SLAVE_NUMBER, .value = 6 } },
};

static const struct {
	const char *frame;
	unsigned times;
	struct xyza_reply reply;
} replies[] = {
	{ "5A A5 0C AA 00 03 00 AC 59", 2, { .kind = XYZA_REPLY_DONE, .order = 0xAC } },
	{ "5A A5 0B F1 00 03 E1 A1 01 01 00 00 78",
	  2,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE1, .target = 0xA1, .value = 0x101 } },
	{ "5A A5 0C AB 00 03 00 F1 9F", 8, { .kind = XYZA_REPLY_FAILED, .order = 0xF1 } },
	{ "5A A5 0B F1 00 03 E1 A2 01 00 00 00 78",
	  1,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE1, .target = 0xA2, .value = 0x1 } },
	{ "5A A5 0B F1 00 03 E1 A4 01 00 00 00 7A",
	  1,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE1, .target = 0xA4, .value = 0x1 } },
	{ "5A A5 0B F1 00 03 E2 A1 C8 00 00 00 3F",
	  3,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE2, .target = 0xA1, .value = 0xC8 } },
	{ "5A A5 0B F1 00 03 E2 A3 08 00 00 00 81",
	  1,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE2, .target = 0xA3, .value = 0x8 } },
	{ "5A A5 0B F1 00 03 E3 A1 C8 00 00 00 40",
	  2,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE3, .target = 0xA1, .value = 0xC8 } },
	{ "5A A5 0B F1 00 03 E4 C1 01 00 03 00 9D",
	  2,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE4, .target = 0xC1, .value = 0x30001 } },
	{ "5A A5 0B F1 00 03 E5 C1 01 00 00 00 9B",
	  2,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE5, .target = 0xC1, .value = 0x1 } },
	{ "5A A5 0B F1 00 03 E5 C2 06 07 08 00 B0",
	  1,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE5, .target = 0xC2, .value = 0x80706 } },
	{ "5A A5 0B F1 00 03 E5 C3 03 00 00 00 9F",
	  1,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE5, .target = 0xC3, .value = 0x3 } },
	{ "5A A5 0B F1 00 03 E5 C4 01 00 00 00 9E",
	  1,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE5, .target = 0xC4, .value = 0x1 } },
	{ "5A A5 0B F1 00 03 E5 C7 01 00 00 00 A1",
	  1,
	  { .kind = XYZA_REPLY_DATA, .item_class = 0xE5, .target = 0xC7, .value = 0x1 } },
	{ "5A A5 0C AA 00 03 00 F3 A0", 1, { .kind = XYZA_REPLY_DONE, .order = 0xF3 } },
	{ "5A A5 0C AA 00 03 00 F4 A1", 2, { .kind = XYZA_REPLY_DONE, .order = 0xF4 } },
	{ "5A A5 0B F4 00 03 02 02 08 01 00 00 04",
	  1,
	  { .kind = XYZA_REPLY_PROGRAM_STATE,
	    .state = XYZA_PROGRAM_WAITING,
	    .program = 2,
	    .step = 264 } },
	{ "5A A5 0A AA 00 03 00 F1 9E", 26, { .kind = XYZA_REPLY_DONE, .order = 0xF1 } },
};

/* Every frame that is printed with a wrong sum, as printed, and the right sum. */
static const struct {
	const char *frame;
	uint8_t sum;
} misprints[] = {
	{ "5A A5 0A F1 01 03 E1 A2 77", 0x78 },
	{ "5A A5 0A F1 01 03 E1 A3 77", 0x79 },
	{ "5A A5 0A F1 01 03 E3 A2 7B", 0x7A },
	{ "5A A5 0B F1 00 03 E3 10 00 07 00 00 81", 0xEE },
	{ "5A A5 0B F1 00 03 E3 A3 D0 07 00 00 81", 0x51 },
	{ "5A A5 0C AB 00 03 00 F1 92", 0x9F },
	{ "5A A5 0A F1 01 03 E4 00 D8", 0xD9 },
	{ "5A A5 0A F1 01 03 E5 C1 7B", 0x9B },
	{ "5A A5 0C AB 00 03 00 F1 92", 0x9F },
	{ "5A A5 0A F1 01 03 E5 C8 A1", 0xA2 },
	{ "5A A5 0B F1 00 03 E5 C8 01 00 00 00 A1", 0xA2 },
	{ "5A A5 0A F1 01 03 E5 C9 A1", 0xA3 },
	{ "5A A5 0B F1 00 03 E5 C9 01 00 00 00 A1", 0xA3 },
	{ "5A A5 0A F4 01 03 05 02 9B", 0xFF },
	{ "5A A5 0A F4 01 03 03 02 9B", 0xFD },
	{ "5A A5 0B F4 00 03 01 02 08 01 00 00 02", 0x03 },
	{ "5A A5 0B F4 00 03 01 02 08 01 00 00 02", 0x03 },
	{ "5A A5 0C AA 00 03 00 F4 08", 0xA1 },
	{ "5A A5 0A F4 01 03 06 00 02", 0xFE },
	{ "5A A5 0C AA 00 03 00 F4 08", 0xA1 },
	{ "5A A5 0A F4 01 03 07 00 03", 0xFF },
	{ "5A A5 0C AA 00 03 00 F4 08", 0xA1 },
	{ "5A A5 0B F1 01 03 E3 A1 C8 00 00 00 40", 0x41 },
	{ "5A A5 0B F1 01 03 E5 C1 01 00 00 00 38", 0x9C },
};

static void test_every_frame_is_there(void **state)
{
	unsigned times = 0;

	(void)state;
	for (size_t i = 0; i < COUNT(requests); i++)
		times += requests[i].times;
	for (size_t i = 0; i < COUNT(replies); i++)
		times += replies[i].times;
	assert_int_equal(times, PRINTED_RIGHT);
	assert_int_equal(COUNT(misprints), PRINTED_WRONG);
}

static void test_printed_requests(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(requests); i++) {
		struct xyza_request expected = requests[i].request;
		struct xyza_request request;
		struct xyza_reply reply;
		uint8_t frame[XYZA_FRAME_MAX];
		uint8_t written[XYZA_FRAME_MAX];
		size_t length = from_hex(requests[i].frame, frame, sizeof frame);

		expected.object = SLAVE;
		assert_int_equal(xyza_decode_request(frame, length, &request), XYZA_OK);
		assert_same_request(&request, &expected);
		assert_int_equal(request.order, frame[3]);
		assert_cut_whole(frame, length);
		/* Heard as an echo it is no reply. */
		assert_int_equal(xyza_decode_reply(frame, length, &reply), XYZA_ERR_SIDE);
		/* Ports are read with target 00, as in the example; the table has A1. */
		if (request.verb == XYZA_READ_PORTS) {
			frame[7] = 0;
			seal(frame, length);
		}
		assert_int_equal(xyza_encode_request(&expected, written, sizeof written), length);
		assert_memory_equal(written, frame, length);
	}
}

static void test_printed_replies(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(replies); i++) {
		struct xyza_reply expected = replies[i].reply;
		struct xyza_request request;
		struct xyza_style style = { .answer_mark_0a = false };
		struct xyza_reply reply;
		uint8_t frame[XYZA_FRAME_MAX];
		uint8_t written[XYZA_FRAME_MAX];
		size_t length = from_hex(replies[i].frame, frame, sizeof frame);

		expected.object = SLAVE;
		style.answer_mark_0a = frame[2] == 0x0A;
		assert_int_equal(xyza_decode_reply(frame, length, &reply), XYZA_OK);
		assert_same_reply(&reply, &expected);
		assert_cut_whole(frame, length);
		assert_int_equal(xyza_encode_reply(&expected, &style, written, sizeof written),
		                 length);
		assert_memory_equal(written, frame, length);
		/* No controller takes another one's answer for a request. */
		assert_int_equal(xyza_decode_request(frame, length, &request), XYZA_ERR_SIDE);
	}
}

static void test_misprints(void **state)
{
	(void)state;
	for (size_t i = 0; i < COUNT(misprints); i++) {
		struct xyza_request request;
		struct xyza_reply reply;
		uint8_t frame[XYZA_FRAME_MAX];
		uint8_t written[XYZA_FRAME_MAX];
		size_t length = from_hex(misprints[i].frame, frame, sizeof frame);

		assert_int_not_equal(frame[length - 1], misprints[i].sum);
		assert_int_equal(xyza_decode_request(frame, length, &request), XYZA_ERR_CHECKSUM);
		assert_int_equal(request.object, SLAVE);
		assert_int_equal(request.order, frame[3]);
		assert_int_equal(xyza_decode_reply(frame, length, &reply), XYZA_ERR_CHECKSUM);
		frame[length - 1] = misprints[i].sum;
		if (frame[4] == 0) {
			assert_int_equal(xyza_decode_reply(frame, length, &reply), XYZA_OK);
			continue;
		}
		/* What we send in its place is the same with the right sum. */
		assert_int_equal(xyza_decode_request(frame, length, &request), XYZA_OK);
		assert_int_equal(xyza_encode_request(&request, written, sizeof written), length);
		assert_memory_equal(written, frame, length);
	}
}

static void test_header_misprint(void **state)
{
	uint8_t frame[XYZA_FRAME_MAX];
	size_t length = from_hex("FF A5 0A AC 01 03 AC AC 08", frame, sizeof frame);
	struct xyza_request request;
	size_t skip;
	size_t cut;

	(void)state;
	assert_int_equal(xyza_decode_request(frame, length, &request), XYZA_ERR_FORM);
	xyza_cut(frame, length, &skip, &cut);
	assert_int_equal(skip, length);
	assert_int_equal(cut, 0);
}

static void test_misprinted_reply_fits_nothing(void **state)
{
	/* The answer to a read of the microstep whose target got lost. */
	struct xyza_request request = { .verb = XYZA_READ_ITEM,
		                        .object = SLAVE,
		                        .item = XYZA_ITEM_MICROSTEP };
	uint8_t frame[XYZA_FRAME_MAX];
	size_t length = from_hex("5A A5 0B F1 00 03 E3 10 00 07 00 00 EE", frame, sizeof frame);
	struct xyza_reply reply;

	(void)state;
	assert_int_equal(xyza_decode_reply(frame, length, &reply), XYZA_OK);
	assert_false(xyza_fits(&request, &reply));
}

/* --- every request there is ----------------------------------------------------------------------- */

static void assert_there_and_back(const struct xyza_request *request)
{
	struct xyza_request copy;
	uint8_t frame[XYZA_FRAME_MAX];
	int length = xyza_encode_request(request, frame, sizeof frame);

	if (length <= 0)
		fail_msg("verb %d item %d axis %d: error %d", (int)request->verb,
		         (int)request->item, (int)request->axis, length);
	assert_int_equal(xyza_decode_request(frame, (size_t)length, &copy), XYZA_OK);
	assert_same_request(&copy, request);
	assert_int_equal(xyza_encode_request(request, frame, (size_t)length - 1), XYZA_ERR_SPACE);
	frame[4] = 2; /* the system's host may ask the same */
	seal(frame, (size_t)length);
	assert_int_equal(xyza_decode_request(frame, (size_t)length, &copy), XYZA_OK);
}

static void test_verbs_of_axes(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 2 * XYZA_AXIS_COUNT; i++) {
		enum xyza_axis axis = (enum xyza_axis)(i / 2);
		bool negative = i % 2;
		const struct xyza_request made[] = {
			{ .verb = XYZA_READ_MAGNITUDE },
			{ .verb = XYZA_READ_SIGN },
			{ .verb = XYZA_READ_STANDING },
			{ .verb = XYZA_WRITE_MAGNITUDE, .value = 4294967295u },
			{ .verb = XYZA_WRITE_SIGN, .negative = negative },
			{ .verb = XYZA_MANUAL_JOG, .negative = negative },
			{ .verb = XYZA_MANUAL_CLEAR },
			{ .verb = XYZA_PROGRAM_CLEAR },
		};

		for (size_t k = 0; k < COUNT(made); k++) {
			struct xyza_request request = made[k];

			request.axis = axis;
			request.object = (uint8_t)(1 + i);
			assert_there_and_back(&request);
		}
	}
}

static void test_verbs_of_controllers(void **state)
{
	static const struct xyza_request made[] = {
		{ .verb = XYZA_VERB_ONLINE, .object = 255 },
		{ .verb = XYZA_READ_PORTS, .object = 1 },
		{ .verb = XYZA_WRITE_OUTPUTS, .object = 1, .on = true },
		{ .verb = XYZA_WRITE_OUTPUTS, .object = 1 },
		{ .verb = XYZA_MANUAL_QUICK_STOP, .object = 1 },
		{ .verb = XYZA_MANUAL_STOP, .object = 1 },
		{ .verb = XYZA_PROGRAM_QUICK_STOP, .object = 1 },
		{ .verb = XYZA_PROGRAM_STOP, .object = 1 },
		{ .verb = XYZA_PROGRAM_START, .object = 1, .number = 255 },
		{ .verb = XYZA_PROGRAM_START, .object = 1 },
		{ .verb = XYZA_PROGRAM_DELAY, .object = 1, .number = 255 },
		{ .verb = XYZA_PROGRAM_CONTINUE, .object = 1 },
		{ .verb = XYZA_PROGRAM_END, .object = 1 },
		{ .verb = XYZA_PROGRAM_STEP_ON, .object = 1 },
		{ .verb = XYZA_PROGRAM_STEP_OFF, .object = 1 },
		{ .verb = XYZA_PROGRAM_STATE, .object = 1 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(made); i++)
		assert_there_and_back(&made[i]);
	for (unsigned port = 1; port <= XYZA_OUTPUTS; port++) {
		for (unsigned on = 0; on <= 1; on++) {
			struct xyza_request request = { .verb = XYZA_WRITE_OUTPUT,
				                        .object = 1,
				                        .number = (uint8_t)port,
				                        .on = on };

			assert_there_and_back(&request);
		}
	}
}

/* Codes of the tables that no printed frame has. */
static void test_codes_of_tables(void **state)
{
	static const struct {
		struct xyza_request request;
		uint8_t order;
		uint8_t item_class;
		uint8_t target;
	} rows[] = {
		{ { .verb = XYZA_MANUAL_QUICK_STOP }, 0xF3, 0x01, 0x00 },
		{ { .verb = XYZA_MANUAL_STOP }, 0xF3, 0x02, 0x00 },
		{ { .verb = XYZA_MANUAL_JOG, .axis = XYZA_X, .negative = true }, 0xF3, 0x03, 0xA2 },
		{ { .verb = XYZA_MANUAL_JOG, .axis = XYZA_Y }, 0xF3, 0x03, 0xA3 },
		{ { .verb = XYZA_MANUAL_JOG, .axis = XYZA_Y, .negative = true }, 0xF3, 0x03, 0xA4 },
		{ { .verb = XYZA_MANUAL_JOG, .axis = XYZA_Z }, 0xF3, 0x03, 0xA5 },
		{ { .verb = XYZA_MANUAL_JOG, .axis = XYZA_A, .negative = true }, 0xF3, 0x03, 0xA8 },
		{ { .verb = XYZA_MANUAL_CLEAR, .axis = XYZA_X }, 0xF3, 0x04, 0xA1 },
		{ { .verb = XYZA_MANUAL_CLEAR, .axis = XYZA_Y, .negative = true },
		  0xF3,
		  0x04,
		  0xA3 },
		{ { .verb = XYZA_PROGRAM_QUICK_STOP }, 0xF4, 0x01, 0x00 },
		{ { .verb = XYZA_PROGRAM_START, .number = 2 }, 0xF4, 0x03, 0x02 },
		{ { .verb = XYZA_PROGRAM_CLEAR, .axis = XYZA_X }, 0xF4, 0x04, 0xA1 },
		{ { .verb = XYZA_PROGRAM_DELAY, .number = 1 }, 0xF4, 0x05, 0x01 },
		{ { .verb = XYZA_PROGRAM_CONTINUE }, 0xF4, 0x06, 0x00 },
		{ { .verb = XYZA_PROGRAM_END }, 0xF4, 0x07, 0x00 },
		{ { .verb = XYZA_PROGRAM_STEP_ON }, 0xF4, 0x08, 0x00 },
		{ { .verb = XYZA_PROGRAM_STEP_OFF }, 0xF4, 0x09, 0x00 },
		{ { .verb = XYZA_READ_MAGNITUDE, .axis = XYZA_Y }, 0xF1, 0xE1, 0xB1 },
		{ { .verb = XYZA_READ_SIGN, .axis = XYZA_Z }, 0xF1, 0xE1, 0xC2 },
		{ { .verb = XYZA_READ_STANDING, .axis = XYZA_A }, 0xF1, 0xE1, 0xD3 },
		{ { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_MANUAL_SPEED, .axis = XYZA_A },
		  0xF1,
		  0xE2,
		  0xD4 },
		{ { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_MICROSTEP, .axis = XYZA_Y },
		  0xF1,
		  0xE3,
		  0xB2 },
		{ { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_READ_PASSWORD }, 0xF1, 0xE5, 0xC5 },
		{ { .verb = XYZA_READ_ITEM, .item = XYZA_ITEM_PASSWORD }, 0xF1, 0xE5, 0xC6 },
		{ { .verb = XYZA_WRITE_ITEM, .item = XYZA_ITEM_SYSTEM_INFO }, 0xF1, 0xE5, 0xC8 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		struct xyza_request request = rows[i].request;
		uint8_t frame[XYZA_FRAME_MAX];

		request.object = 9;
		assert_true(xyza_encode_request(&request, frame, sizeof frame) > 0);
		assert_int_equal(frame[3], rows[i].order);
		assert_int_equal(frame[6], rows[i].item_class);
		assert_int_equal(frame[7], rows[i].target);
	}
}

/* A clear may name either direction of an axis. */
static void test_clear_by_either_direction(void **state)
{
	uint8_t frame[XYZA_FRAME_MAX];
	size_t length = from_hex("5A A5 0A F3 01 03 04 A4 00", frame, sizeof frame);
	struct xyza_request request;

	(void)state;
	seal(frame, length);
	assert_int_equal(xyza_decode_request(frame, length, &request), XYZA_OK);
	assert_int_equal(request.verb, XYZA_MANUAL_CLEAR);
	assert_int_equal(request.axis, XYZA_Y);
	assert_false(request.negative);
}

static void test_items(void **state)
{
	(void)state;
	for (int i = 0; i < XYZA_PARAM_COUNT; i++) {
		enum xyza_param param = (enum xyza_param)i;
		enum xyza_item item = xyza_param_places[param].item;
		unsigned access = xyza_param_places[param].access;
		uint32_t content = 0;
		union db_value value;

		assert_true(db_value_from_number(xyza_params[i].type, xyza_params[i].max, &value));
		content = xyza_param_put(param, value, content);
		for (unsigned axis = 0; axis < (xyza_item_of_axis(item) ? XYZA_AXIS_COUNT : 1u);
		     axis++) {
			struct xyza_request request = { .object = 7,
				                        .item = item,
				                        .axis = (enum xyza_axis)axis };
			uint8_t frame[XYZA_FRAME_MAX];

			request.verb = XYZA_READ_ITEM;
			if (access & XYZA_CAN_READ)
				assert_there_and_back(&request);
			else
				assert_int_equal(xyza_encode_request(&request, frame, sizeof frame),
				                 XYZA_ERR_UNKNOWN);
			request.verb = XYZA_WRITE_ITEM;
			request.value = content;
			assert_there_and_back(&request);
		}
	}
}

/* --- what is refused ------------------------------------------------------------------------------ */

static void test_refused_requests(void **state)
{
	static const struct {
		struct xyza_request request;
		enum xyza_error error;
	} rows[] = {
		{ { .verb = XYZA_VERB_ONLINE }, XYZA_ERR_RANGE },
		{ { .verb = XYZA_VERB_COUNT, .object = 1 }, XYZA_ERR_UNKNOWN },
		{ { .verb = XYZA_READ_SIGN, .object = 1, .axis = XYZA_AXIS_COUNT },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_MANUAL_JOG, .object = 1, .axis = XYZA_AXIS_COUNT },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_READ_ITEM, .object = 1, .axis = XYZA_AXIS_COUNT },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_READ_ITEM, .object = 1, .item = XYZA_ITEM_COUNT },
		  XYZA_ERR_UNKNOWN },
		{ { .verb = XYZA_READ_ITEM, .object = 1, .item = XYZA_ITEM_SLAVE_NUMBER },
		  XYZA_ERR_UNKNOWN },
		{ { .verb = XYZA_WRITE_ITEM, .object = 1, .item = XYZA_ITEM_SLAVE_NUMBER },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_ITEM, .object = 1, .item = XYZA_ITEM_SOUND, .value = 2 },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_ITEM, .object = 1, .item = XYZA_ITEM_SOUND, .value = 0x101 },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_ITEM, .object = 1, .item = XYZA_ITEM_ENABLE, .value = 16 },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_ITEM,
		    .object = 1,
		    .item = XYZA_ITEM_KEYS,
		    .value = 0x070706 },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_ITEM,
		    .object = 1,
		    .item = XYZA_ITEM_KEYS,
		    .value = 0x080806 },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_ITEM,
		    .object = 1,
		    .item = XYZA_ITEM_FACTORY_RESET,
		    .value = 1 },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_ITEM, .object = 1, .item = XYZA_ITEM_MICROSTEP },
		  XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_OUTPUT, .object = 1, .on = true }, XYZA_ERR_RANGE },
		{ { .verb = XYZA_WRITE_OUTPUT, .object = 1, .number = 9 }, XYZA_ERR_RANGE },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		uint8_t frame[XYZA_FRAME_MAX] = { 0 };

		assert_int_equal(xyza_encode_request(&rows[i].request, frame, sizeof frame),
		                 rows[i].error);
		assert_int_equal(frame[0], 0);
	}
}

static void test_undocumented_requests(void **state)
{
	static const struct {
		const char *frame; /* the sum is put right here */
		enum xyza_error error;
	} rows[] = {
		{ "5A A5 0A FB 01 03 00 00 00", XYZA_ERR_UNKNOWN }, /* extension ports */
		{ "5A A5 0A F9 01 03 E1 A1 00", XYZA_ERR_UNKNOWN }, /* order of a table only */
		{ "5A A5 0B F7 01 03 E2 A1 01 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E0 A1 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E1 A4 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E1 E1 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E2 A5 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E3 A4 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E4 A2 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E5 CA 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F1 01 03 E5 CC 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0B F1 01 03 E1 A3 01 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0B F1 01 03 E1 A2 02 00 00 00 00", XYZA_ERR_RANGE },
		{ "5A A5 0B F1 01 03 E4 00 99 00 00 00 00", XYZA_ERR_RANGE },
		{ "5A A5 0B F1 01 03 E4 A1 22 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0B F1 01 03 E5 C4 02 00 00 00 00", XYZA_ERR_RANGE },
		{ "5A A5 0B F1 01 03 E5 C4 01 00 00 01 00", XYZA_ERR_RANGE },
		{ "5A A5 0C F1 01 03 E1 A1 00", XYZA_ERR_UNKNOWN }, /* mark of an answer */
		{ "5A A5 0B F1 01 03 E4 00 12 00 00 00 00", XYZA_ERR_RANGE },
		{ "5A A5 0B F1 01 03 E4 00 22 01 00 00 00", XYZA_ERR_RANGE },
		{ "5A A5 0A F3 01 03 05 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F3 01 03 03 A9 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F3 01 03 03 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F3 01 03 02 01 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A F4 01 03 0B 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0B F4 01 03 02 00 00 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A AC 01 03 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0C AC 01 03 AC AC 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0A AC 01 00 AC AC 00", XYZA_ERR_RANGE },
		{ "5A A5 0A AC 03 03 AC AC 00", XYZA_ERR_SIDE },
		{ "5A A5 0E 00 01 03 00 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0D 00 01 03 00 00 00 00 00 00 00 00 00 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0F 00 01 03 00 00 00 00 00 00 00 00 00 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 10 AC 01 03 AC AC 00", XYZA_ERR_FORM },
		{ "5A A5 0B AC 01 03 AC AC 00", XYZA_ERR_FORM },
		{ "5A A4 0A AC 01 03 AC AC 00", XYZA_ERR_FORM },
		{ "5A A5 0A AC 01 03 AC AC", XYZA_ERR_FORM },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		struct xyza_request request;
		uint8_t frame[XYZA_FRAME_MAX];
		size_t length = from_hex(rows[i].frame, frame, sizeof frame);
		enum xyza_error error;

		seal(frame, length);
		error = xyza_decode_request(frame, length, &request);
		if (error != rows[i].error)
			fail_msg("%s: error %d instead of %d", rows[i].frame, (int)error,
			         (int)rows[i].error);
	}
}

static void test_refused_replies(void **state)
{
	static const struct {
		const char *frame;
		enum xyza_error error;
	} rows[] = {
		{ "5A A5 0C AC 00 03 00 AC 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0C AA 00 03 01 F1 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0C AA 01 03 00 F1 00", XYZA_ERR_SIDE },
		{ "5A A5 0B F2 00 03 E1 A1 00 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0B F1 00 03 E0 A1 00 00 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0B F1 00 03 E6 A1 00 00 00 00 00", XYZA_ERR_UNKNOWN },
		/* A state that the document does not name is one. */
		{ "5A A5 0B F4 00 03 FF 01 00 00 00 00 00", XYZA_OK },
		{ "5A A5 0E F4 00 03 06 01 00 00 00", XYZA_ERR_UNKNOWN },
		{ "5A A5 0B F1 00 03 E1 A1 00 00 00 00", XYZA_ERR_FORM },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		struct xyza_reply reply;
		uint8_t frame[XYZA_FRAME_MAX];
		size_t length = from_hex(rows[i].frame, frame, sizeof frame);

		seal(frame, length);
		assert_int_equal(xyza_decode_reply(frame, length, &reply), rows[i].error);
	}
}

/* --- answers and their requests ------------------------------------------------------------------- */

static void test_failure_has_two_codes(void **state)
{
	const struct xyza_request request = { .verb = XYZA_MANUAL_STOP, .object = SLAVE };
	const struct xyza_reply failed = { .kind = XYZA_REPLY_FAILED,
		                           .object = SLAVE,
		                           .order = XYZA_ORDER_MANUAL };

	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		struct xyza_style style = { .answer_mark_0a = i & 1, .failure_bb = i & 2 };
		struct xyza_reply reply;
		uint8_t frame[XYZA_FRAME_MAX];
		int length = xyza_encode_reply(&failed, &style, frame, sizeof frame);

		assert_int_equal(length, XYZA_COMMAND_FRAME);
		assert_int_equal(frame[2], style.answer_mark_0a ? 0x0A : 0x0C);
		assert_int_equal(frame[3], style.failure_bb ? 0xBB : 0xAB);
		assert_int_equal(xyza_decode_reply(frame, (size_t)length, &reply), XYZA_OK);
		assert_same_reply(&reply, &failed);
		assert_true(xyza_fits(&request, &reply));
	}
}

static uint32_t part_of(const struct xyza_reply *reply)
{
	static const struct xyza_style style = { .answer_mark_0a = false };
	uint8_t frame[XYZA_FRAME_MAX];
	int length = xyza_encode_reply(reply, &style, frame, sizeof frame);

	assert_true(length > 0);
	return xyza_part(frame, (size_t)length);
}

/* Every read's own answer fits, and no other read's does. */
static void test_answers_fit_their_requests(void **state)
{
	static const struct xyza_style style = { .answer_mark_0a = false };
	static const struct xyza_request reads[] = {
		{ .verb = XYZA_READ_MAGNITUDE, .object = 5, .axis = XYZA_X },
		{ .verb = XYZA_READ_MAGNITUDE, .object = 5, .axis = XYZA_Y },
		{ .verb = XYZA_READ_SIGN, .object = 5, .axis = XYZA_X },
		{ .verb = XYZA_READ_STANDING, .object = 5, .axis = XYZA_X },
		{ .verb = XYZA_READ_STANDING, .object = 5, .axis = XYZA_A },
		{ .verb = XYZA_READ_PORTS, .object = 5 },
		{ .verb = XYZA_READ_ITEM, .object = 5, .item = XYZA_ITEM_MANUAL_SPEED },
		{ .verb = XYZA_READ_ITEM, .object = 5, .item = XYZA_ITEM_ENABLE },
		{ .verb = XYZA_READ_ITEM, .object = 5, .item = XYZA_ITEM_LEAD, .axis = XYZA_A },
		{ .verb = XYZA_READ_MAGNITUDE, .object = 6, .axis = XYZA_X },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(reads); i++) {
		struct xyza_reply reply;
		struct xyza_reply answer = { .kind = XYZA_REPLY_DONE,
			                     .object = reads[i].object,
			                     .order = XYZA_ORDER_DATA };

		xyza_fill_data(&reads[i], 1, &style, &reply);
		assert_int_equal(part_of(&reply),
		                 1u + ((uint32_t)reply.item_class << 8 | reply.target));
		assert_int_equal(part_of(&answer), 0);
		for (size_t k = 0; k < COUNT(reads); k++)
			assert_int_equal(xyza_fits(&reads[k], &reply), i == k);
		assert_int_equal(xyza_reply_length(reads[i].verb), XYZA_DATA_FRAME);
		assert_false(xyza_fits(&reads[i], &answer));
		answer.kind = XYZA_REPLY_FAILED;
		assert_true(xyza_fits(&reads[i], &answer));
		answer.order = XYZA_ORDER_ONLINE;
		assert_false(xyza_fits(&reads[i], &answer));
	}
}

static void test_ports_are_answered_with_c1(void **state)
{
	static const struct xyza_style style = { .echo_a4 = true };
	const struct xyza_request request = { .verb = XYZA_READ_PORTS, .object = 5 };
	struct xyza_reply reply;

	(void)state;
	xyza_fill_data(&request, 0x30001, &style, &reply);
	assert_int_equal(reply.target, 0xC1);
	/* Other targets pass too. */
	reply.target = 0;
	assert_true(xyza_fits(&request, &reply));
}

/* Data that come late from a read do not confirm a write of the same. */
static void test_data_confirm_no_write(void **state)
{
	static const struct xyza_style style = { .echo_a4 = false };
	struct xyza_request request = { .verb = XYZA_READ_ITEM,
		                        .object = 5,
		                        .item = XYZA_ITEM_LEAD };
	struct xyza_reply reply;

	(void)state;
	xyza_fill_data(&request, 5000, &style, &reply);
	assert_true(xyza_fits(&request, &reply));
	request.verb = XYZA_WRITE_ITEM;
	request.value = 5000;
	assert_false(xyza_fits(&request, &reply));
}

static void test_standing_echoed_as_a4(void **state)
{
	static const struct xyza_style style = { .echo_a4 = true };
	struct xyza_request request = { .verb = XYZA_READ_STANDING, .object = 5, .axis = XYZA_Z };
	struct xyza_reply reply;

	(void)state;
	xyza_fill_data(&request, 1, &style, &reply);
	assert_int_equal(reply.target, 0xC4);
	assert_true(xyza_fits(&request, &reply));
	request.verb = XYZA_READ_SIGN;
	assert_false(xyza_fits(&request, &reply));
}

static void test_impossible_values_fit_nothing(void **state)
{
	static const struct xyza_style style = { .answer_mark_0a = false };
	struct xyza_request request = { .verb = XYZA_READ_SIGN, .object = 5 };
	struct xyza_reply reply;

	(void)state;
	xyza_fill_data(&request, 2, &style, &reply);
	assert_false(xyza_fits(&request, &reply));
	request.verb = XYZA_READ_STANDING;
	xyza_fill_data(&request, 0x100, &style, &reply);
	assert_false(xyza_fits(&request, &reply));
}

static void test_answers_to_commands(void **state)
{
	static const struct {
		enum xyza_verb verb;
		uint8_t order;
	} rows[] = {
		{ XYZA_VERB_ONLINE, 0xAC },   { XYZA_WRITE_SIGN, 0xF1 },
		{ XYZA_WRITE_OUTPUT, 0xF1 },  { XYZA_MANUAL_JOG, 0xF3 },
		{ XYZA_PROGRAM_START, 0xF4 }, { XYZA_PROGRAM_STEP_OFF, 0xF4 },
	};
	struct xyza_reply state_reply = { .kind = XYZA_REPLY_PROGRAM_STATE, .object = 5 };

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		struct xyza_request request = { .verb = rows[i].verb, .object = 5 };
		struct xyza_reply reply = { .kind = XYZA_REPLY_DONE,
			                    .object = 5,
			                    .order = rows[i].order };

		assert_true(xyza_fits(&request, &reply));
		assert_false(xyza_fits(&request, &state_reply));
		assert_int_equal(xyza_reply_length(rows[i].verb), XYZA_COMMAND_FRAME);
		reply.object = 6;
		assert_false(xyza_fits(&request, &reply));
		reply.object = 5;
		reply.order = 0xFB;
		assert_false(xyza_fits(&request, &reply));
		/* A program's state is answered with data, not with "done". */
		reply.order = 0xF4;
		request.verb = XYZA_PROGRAM_STATE;
		assert_false(xyza_fits(&request, &reply));
		assert_true(xyza_fits(&request, &state_reply));
	}
	assert_int_equal(xyza_reply_length(XYZA_PROGRAM_STATE), XYZA_DATA_FRAME);
}

static void test_ports(void **state)
{
	(void)state;
	assert_int_equal(xyza_inputs(0x80030001u), 0x0001);
	assert_int_equal(xyza_outputs(0x80030001u), 0x8003);
}

static void test_position(void **state)
{
	int32_t position = 5;

	(void)state;
	assert_true(xyza_position(268, true, &position));
	assert_int_equal(position, -268);
	assert_true(xyza_position(0, true, &position));
	assert_int_equal(position, 0);
	assert_true(xyza_position(2147483648u, true, &position));
	assert_int_equal(position, INT32_MIN);
	assert_false(xyza_position(2147483648u, false, &position));
	assert_false(xyza_position(2147483649u, true, &position));
	assert_int_equal(position, INT32_MIN);
	assert_true(xyza_position(2147483647u, false, &position));
	assert_int_equal(position, INT32_MAX);
}

/* --- parameters ----------------------------------------------------------------------------------- */

static bool in_range(enum xyza_param param, double number)
{
	union db_value value;

	return db_value_from_number(xyza_params[param].type, number, &value) &&
	       xyza_param_in_range(param, value);
}

static void test_parameter_table(void **state)
{
	(void)state;
	for (int i = 0; i < XYZA_PARAM_COUNT; i++) {
		const struct db_param *row = &xyza_params[i];
		enum xyza_param param = (enum xyza_param)i;

		assert_non_null(row->name);
		assert_true(strlen(row->description) > 0);
		assert_int_equal(xyza_param_find(row->name, strlen(row->name)), i);
		assert_true(in_range(param, row->min));
		assert_true(in_range(param, row->max));
		assert_false(in_range(param, row->min - 1));
		assert_false(in_range(param, row->max + 1));
		assert_true(xyza_param_places[param].access & XYZA_CAN_WRITE);
	}
	assert_int_equal(xyza_param_find("microstepping", 13), -1);
	assert_int_equal(xyza_param_find("lead screw", 4), XYZA_LEAD);
	assert_true(in_range(XYZA_PAUSE_KEY, 0));
	assert_false(in_range(XYZA_PAUSE_KEY, 7));
}

static void test_raw_frames(void **state)
{
	static const uint8_t asked[] = { 0x0A, 0xF1, 0x01, 0x00, 0xE1, 0xA1 };
	static const uint8_t action[16] = { 0x0F, 0x01, 0x02, 0x07, 0x00 };
	uint8_t frame[XYZA_FRAME_MAX] = { 0 };

	(void)state;
	assert_int_equal(xyza_encode_raw(asked, sizeof asked, 3, frame, sizeof frame), 9);
	assert_memory_equal(frame, "\x5A\xA5\x0A\xF1\x01\x03\xE1\xA1\x77", 9);
	assert_int_equal(xyza_encode_raw(asked, sizeof asked, 3, frame, 8), XYZA_ERR_SPACE);
	assert_int_equal(xyza_encode_raw(asked, sizeof asked - 1, 3, frame, sizeof frame),
	                 XYZA_ERR_FORM);
	assert_int_equal(xyza_encode_raw(asked, 0, 3, frame, sizeof frame), XYZA_ERR_FORM);
	assert_int_equal(xyza_encode_raw(action, sizeof action, 7, frame, sizeof frame),
	                 XYZA_FRAME_MAX);
	assert_int_equal(frame[XYZA_FRAME_MAX - 1], 0x0A);
	assert_int_equal(xyza_encode_raw(action, sizeof action, 6, frame, sizeof frame),
	                 XYZA_ERR_RANGE);
	/* Sent by the host, whatever is in it. */
	assert_int_equal(xyza_sender(frame, 9), 0);
	assert_int_equal(xyza_sender((const uint8_t *)"\x5A\xA5\x0C\xAA\x00\x03\x00\xAC\x59", 9),
	                 3);
	assert_int_equal(xyza_sender((const uint8_t *)"\x5A\xA5\x0C\xAA\x00\x03\x00\xAC\x58", 9),
	                 0);
}

/* min_speed, max_speed, acceleration_time. */
static void test_ramps(void **state)
{
	(void)state;
	assert_true(xyza_ramp(320, 3200, 5) == 5760.0f);
	assert_true(xyza_ramp(320, 3200, 0) == 0.0f);
	assert_true(xyza_ramp(3200, 3200, 5) == 0.0f);
	assert_true(xyza_ramp(3200, 320, 5) == 0.0f);
	assert_true(xyza_ramp(0, UINT32_MAX, 1) > 4.29e10f);
	assert_int_equal(xyza_ramp_time(320, 3200, 5760.0f), 5);
	assert_int_equal(xyza_ramp_time(320, 3200, 6000.0f), 5);
	assert_int_equal(xyza_ramp_time(320, 3200, 6500.0f), 4);
	assert_int_equal(xyza_ramp_time(320, 3200, 28800.0f), 1);
	assert_int_equal(xyza_ramp_time(320, 3200, 60000.0f), 0);
	assert_int_equal(xyza_ramp_time(3200, 320, 1.0f), 0);
	assert_int_equal(xyza_ramp_time(0, UINT32_MAX, 1.0f), 0);
	assert_int_equal(xyza_ramp_time(320, 3200, 0.0f), 0);
	assert_int_equal(xyza_ramp_time(320, 3200, -1.0f), 0);
}

static void test_parameters_to_unlock(void **state)
{
	static const enum xyza_param locked[] = { XYZA_FACTORY_RESET, XYZA_SLAVE_NUMBER,
		                                  XYZA_SYSTEM_INFO };
	unsigned count = 0;

	(void)state;
	for (int i = 0; i < XYZA_PARAM_COUNT; i++)
		count += (xyza_param_places[i].access & XYZA_NEEDS_UNLOCK) != 0;
	assert_int_equal(count, COUNT(locked));
	for (size_t i = 0; i < COUNT(locked); i++)
		assert_true(xyza_param_places[locked[i]].access & XYZA_NEEDS_UNLOCK);
}

static void test_parameters_in_items(void **state)
{
	const union db_value one = { .u = 1 };

	(void)state;
	assert_int_equal(xyza_param_get(XYZA_START_KEY, 0x080706).u, 6);
	assert_int_equal(xyza_param_get(XYZA_STOP_KEY, 0x080706).u, 7);
	assert_int_equal(xyza_param_get(XYZA_PAUSE_KEY, 0x080706).u, 8);
	assert_int_equal(xyza_param_put(XYZA_STOP_KEY, one, 0x080706), 0x080106);
	assert_int_equal(xyza_param_put(XYZA_FACTORY_RESET, one, 77), 0);
	assert_int_equal(xyza_param_put(XYZA_LEAD, (union db_value){ .u = 5000 }, 1), 5000);
}

/* What a controller may hold must not keep one from writing a parameter beside it. */
static void test_parameters_beside_what_is_not_set(void **state)
{
	static const struct {
		enum xyza_param param;
		uint32_t held;
		uint32_t written;
	} rows[] = {
		{ XYZA_START_KEY, 0x000000, 0x000006 },
		{ XYZA_STOP_KEY, 0x000000, 0x000600 },
		{ XYZA_START_KEY, 0x01080706, 0x080706 },
		{ XYZA_ENABLE, 0xFFFFFF0F, 0x06 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(rows); i++) {
		struct xyza_request request = { .verb = XYZA_WRITE_ITEM, .object = 5 };
		uint8_t frame[XYZA_FRAME_MAX];

		request.item = xyza_param_places[rows[i].param].item;
		request.value = xyza_param_put(rows[i].param, (union db_value){ .u = 6 },
		                               rows[i].held);
		assert_int_equal(request.value, rows[i].written);
		assert_int_equal(xyza_encode_request(&request, frame, sizeof frame),
		                 XYZA_DATA_FRAME);
	}
	/* What goes back as it was read need not be documented, what changes must. */
	assert_true(xyza_item_in_range(XYZA_ITEM_ENABLE, 0x80000011, 0xFFFFFFFE));
	assert_false(xyza_item_in_range(XYZA_ITEM_ENABLE, 0x80000011, 0x7FFFFFFE));
	assert_false(xyza_item_in_range(XYZA_ITEM_ENABLE, 0x11, 0xFFFFFF00));
	assert_true(xyza_item_in_range(XYZA_ITEM_KEYS, 0x050706, 0xFFFFFF00));
	assert_false(xyza_item_in_range(XYZA_ITEM_KEYS, 0x050709, 0xFFFFFF00));
	assert_false(xyza_item_in_range(XYZA_ITEM_KEYS, 0x050706, 0xFF00FFFF));
	/* To take a key away is not documented. */
	assert_false(in_range(XYZA_START_KEY, 0));
	assert_false(in_range(XYZA_STOP_KEY, 0));
}

/* --- streams -------------------------------------------------------------------------------------- */

static void assert_cut(const char *hex, size_t skip_expected, size_t length_expected)
{
	uint8_t bytes[64];
	size_t available = from_hex(hex, bytes, sizeof bytes);
	size_t skip;
	size_t length;

	xyza_cut(bytes, available, &skip, &length);
	if (skip != skip_expected || length != length_expected)
		fail_msg("%s: skip %zu, length %zu", hex, skip, length);
}

static void test_cut(void **state)
{
	(void)state;
	assert_cut("", 0, 0);
	assert_cut("5A", 0, 0);
	assert_cut("5A A5", 0, 0);
	assert_cut("5A A5 0C", 0, 0);
	assert_cut("FF 00 A5", 3, 0);
	assert_cut("FF 5A 5A", 2, 0);
	assert_cut("5A A5 10 AA 00", 5, 0);
	assert_cut("5A A5 09", 3, 0);
	assert_cut("5A 5A A5 0C AA 00 03 00 F1 9E 77", 1, XYZA_COMMAND_FRAME);
	assert_cut("FF FE 5A A5 0B F1 00 03 E1 A2 01 00 00 00 78 5A", 2, XYZA_DATA_FRAME);
	/* Lengths of marks without described content. */
	assert_cut("5A A5 0E 00 00 00 00 00 00 00 00 5A A5 0C", 0, 11);
	assert_cut("5A A5 0D 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00", 0, 19);
	assert_cut("5A A5 0F 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00", 0, 19);
	assert_cut("5A A5 0F 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00", 0, 0);
	/* A wrong sum is for the decoder to refuse. */
	assert_cut("5A A5 0C AA 00 03 00 F1 9F", 0, XYZA_COMMAND_FRAME);
}

static void test_cut_after_truncated_frame(void **state)
{
	(void)state;
	/* The beginning of the second frame stands where the first should end. */
	assert_cut("5A A5 0B F1 00 03 5A A5 0C AA 00 03 00 F1 9E", 6, XYZA_COMMAND_FRAME);
	assert_cut("5A A5 0B F1 00 03 E1 A1 00 00 00 5A A5 0C AA 00 03 00 F1 9E", 11,
	           XYZA_COMMAND_FRAME);
	/* Until its mark is there, nobody knows. */
	assert_cut("5A A5 0B F1 00 03 E1 A1 00 00 00 5A A5", 11, 0);
	/* It was none. */
	assert_cut("5A A5 0B F1 00 03 E1 A1 00 00 00 5A A5 77", 14, 0);
	assert_cut("5A A5 0B F1 00 03 E1 A1 00 00 5A A5 77", 0, XYZA_DATA_FRAME);
	/* The value of a good frame may look like a beginning. */
	assert_cut("5A A5 0B F1 00 03 E1 A1 5A A5 0C 00 81", 0, XYZA_DATA_FRAME);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_every_frame_is_there),
		cmocka_unit_test(test_printed_requests),
		cmocka_unit_test(test_printed_replies),
		cmocka_unit_test(test_misprints),
		cmocka_unit_test(test_header_misprint),
		cmocka_unit_test(test_misprinted_reply_fits_nothing),
		cmocka_unit_test(test_verbs_of_axes),
		cmocka_unit_test(test_verbs_of_controllers),
		cmocka_unit_test(test_codes_of_tables),
		cmocka_unit_test(test_clear_by_either_direction),
		cmocka_unit_test(test_items),
		cmocka_unit_test(test_refused_requests),
		cmocka_unit_test(test_undocumented_requests),
		cmocka_unit_test(test_refused_replies),
		cmocka_unit_test(test_failure_has_two_codes),
		cmocka_unit_test(test_answers_fit_their_requests),
		cmocka_unit_test(test_ports_are_answered_with_c1),
		cmocka_unit_test(test_data_confirm_no_write),
		cmocka_unit_test(test_standing_echoed_as_a4),
		cmocka_unit_test(test_impossible_values_fit_nothing),
		cmocka_unit_test(test_answers_to_commands),
		cmocka_unit_test(test_ports),
		cmocka_unit_test(test_position),
		cmocka_unit_test(test_parameter_table),
		cmocka_unit_test(test_raw_frames),
		cmocka_unit_test(test_ramps),
		cmocka_unit_test(test_parameters_to_unlock),
		cmocka_unit_test(test_parameters_in_items),
		cmocka_unit_test(test_parameters_beside_what_is_not_set),
		cmocka_unit_test(test_cut),
		cmocka_unit_test(test_cut_after_truncated_frame),
	};

	return cmocka_run_group_tests_name("xyza", tests, NULL, NULL);
}
