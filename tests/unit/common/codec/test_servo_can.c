/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/servo_can.h"
#include "codec/servo_can_layout.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define COUNT(array) (sizeof(array) / sizeof(array)[0])
#define HOST SERVO_CAN_FROM_HOST
#define DRIVE SERVO_CAN_FROM_DRIVE
#define OUT_OF_RANGE SERVO_CAN_ERR_RANGE

/* --- helpers -------------------------------------------------------------------------------------- */

static const struct servo_can_layout plain = { .ack_base = SERVO_CAN_BASE_ACK };
static const struct servo_can_layout padded = { .ack_base = SERVO_CAN_BASE_ACK, .padded = true };

/* One of many that could be: word 1 before word 0, and a byte between that says what it is. */
static const struct servo_can_layout with_words = {
	.ack_base = SERVO_CAN_BASE_ACK,
	.words = { .set = true,
	           .base = 0x0A0,
	           .length = 6,
	           .word0 = 4,
	           .word1 = 0,
	           .ack = 0x07,
	           .fixed = { 0, 0, 0x5C, 0xC5 } },
};

/* "043#0001000BB8": the notation of can-utils, standard ids only. */
static struct db_can_frame frame_of(const char *text)
{
	struct db_can_frame frame = { 0 };
	const char *at = strchr(text, '#');

	assert_non_null(at);
	frame.id = (uint32_t)strtoul(text, NULL, 16);
	for (at++; at[0] != '\0'; at += 2) {
		char byte[3] = { at[0], at[1], '\0' };

		frame.data[frame.length++] = (uint8_t)strtoul(byte, NULL, 16);
	}
	return frame;
}

static void assert_frame(const struct db_can_frame *frame, const char *text)
{
	struct db_can_frame expected = frame_of(text);

	assert_int_equal(frame->id, expected.id);
	assert_int_equal(frame->length, expected.length);
	assert_memory_equal(frame, &expected, sizeof expected);
}

static struct servo_can_message decoded(const char *text, const struct servo_can_layout *layout,
                                        enum servo_can_side from, enum servo_can_kind kind,
                                        uint8_t node)
{
	struct db_can_frame frame = frame_of(text);
	struct servo_can_message message;
	enum servo_can_error error = servo_can_decode(&frame, layout, from, &message);

	if (error != SERVO_CAN_OK)
		fail_msg("%s: error %d", text, (int)error);
	if (message.kind != kind)
		fail_msg("%s: kind %d", text, (int)message.kind);
	assert_int_equal(message.node, node);
	return message;
}

/* The message makes the frame, and the frame as many bytes of the message's content. */
static void assert_vector(struct servo_can_message message, const struct servo_can_layout *layout,
                          enum servo_can_side from, const char *text)
{
	struct db_can_frame frame;
	struct servo_can_message back;

	assert_int_equal(servo_can_encode(&message, layout, &frame), SERVO_CAN_OK);
	assert_frame(&frame, text);
	back = decoded(text, layout, from, message.kind, message.node);
	memset(&frame, 0xEE, sizeof frame);
	assert_int_equal(servo_can_encode(&back, layout, &frame), SERVO_CAN_OK);
	assert_frame(&frame, text);
}

static void assert_error(const char *text, const struct servo_can_layout *layout,
                         enum servo_can_side from, enum servo_can_error error,
                         enum servo_can_kind kind, uint8_t node)
{
	struct db_can_frame frame = frame_of(text);
	struct servo_can_message message;
	enum servo_can_error got = servo_can_decode(&frame, layout, from, &message);

	if (got != error || message.kind != kind)
		fail_msg("%s: error %d, kind %d", text, (int)got, (int)message.kind);
	assert_int_equal(message.node, node);
}

static void assert_refused(struct servo_can_message message, const struct servo_can_layout *layout,
                           enum servo_can_error error)
{
	struct db_can_frame frame;
	struct db_can_frame before;

	memset(&frame, 0xEE, sizeof frame);
	before = frame;
	assert_int_equal(servo_can_encode(&message, layout, &frame), error);
	assert_memory_equal(&frame, &before, sizeof frame);
}

/* --- every frame of the document ------------------------------------------------------------------ */

static void host_frames(void **state)
{
	const struct {
		struct servo_can_message message;
		const char *text;
	} vectors[] = {
		{ { SERVO_CAN_SYNC, 0, { 0 } }, "01F#" },
		{ { SERVO_CAN_ENABLE, 1, { .enable = true } }, "021#000A" },
		{ { SERVO_CAN_ENABLE, 31, { .enable = false } }, "03F#0001" },
		{ { SERVO_CAN_MODE, 3, { .mode = { .mode = SERVO_CAN_MODE_POSITION } } },
		  "043#0000000000" },
		{ { SERVO_CAN_MODE, 3, { .mode = { SERVO_CAN_MODE_SPEED, false, true, 3000 } } },
		  "043#0001010BB8" },
		{ { SERVO_CAN_MODE, 31, { .mode = { SERVO_CAN_MODE_CURRENT, true, true, 65535 } } },
		  "05F#001201FFFF" },
		{ { SERVO_CAN_SPEED, 1, { .speed = 1000 } }, "061#0103E8" },
		{ { SERVO_CAN_SPEED, 1, { .speed = -1000 } }, "061#01FC18" },
		{ { SERVO_CAN_CURRENT, 1, { .current = 25 } }, "061#020019" },
		{ { SERVO_CAN_CURRENT, 2, { .current = INT16_MIN } }, "062#028000" },
		{ { SERVO_CAN_POSITION, 1, { .position = 0x12345678 } }, "081#12345678" },
		{ { SERVO_CAN_POSITION, 31, { .position = -2 } }, "09F#FFFFFFFE" },
		{ { SERVO_CAN_SET_FEEDBACK, 1, { .position = 0 } }, "0E1#00000000" },
		{ { SERVO_CAN_SET_FEEDBACK, 31, { .position = INT32_MIN } }, "0FF#80000000" },
		{ { SERVO_CAN_RAMPS, 1, { .ramps = { 5000, 0x12345678 } } },
		  "101#0000138812345678" },
		{ { SERVO_CAN_RAMPS, 31, { .ramps = { UINT32_MAX, 1 } } }, "11F#FFFFFFFF00000001" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++)
		assert_vector(vectors[i].message, &plain, HOST, vectors[i].text);
}

static void reads(void **state)
{
	static const struct {
		const char *text;
		unsigned answers;
	} vectors[] = {
		{ "141#00", 7 }, { "141#01", 3 }, { "141#02", 5 }, { "141#03", 6 },
		{ "141#04", 1 }, { "141#05", 2 }, { "141#06", 4 }, { "141#07", 8 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++) {
		uint8_t selector = (uint8_t)i;
		struct servo_can_message read = { SERVO_CAN_READ, 1, { .selector = selector } };

		assert_vector(read, &plain, HOST, vectors[i].text);
		assert_int_equal(servo_can_answers(selector), vectors[i].answers);
		assert_int_equal(servo_can_selector(vectors[i].answers), selector);
	}
	assert_int_equal(servo_can_answers(8), 0);
	assert_int_equal(servo_can_selector(0), -1);
	assert_int_equal(servo_can_selector(SERVO_CAN_GIVES_STATUS | SERVO_CAN_GIVES_ANALOGUE), -1);
}

static void drive_frames(void **state)
{
	const struct {
		struct servo_can_message message;
		const char *text;
	} vectors[] = {
		{ { SERVO_CAN_ANSWER_POSITION, 1, { .position = -100000 } }, "161#FFFE7960" },
		{ { SERVO_CAN_ANSWER_MOTION, 1, { .motion = { -1500, 33 } } }, "181#FA240021" },
		{ { SERVO_CAN_ANSWER_STATUS, 31, { .status = { 0x8412, 0x81, 0x03 } } },
		  "1BF#84128103" },
		{ { SERVO_CAN_ANSWER_ANALOGUE, 1, { .analogue = 0xABCD } }, "221#ABCD" },
		{ { SERVO_CAN_REPORT_POSITION, 31, { .position = INT32_MAX } }, "1DF#7FFFFFFF" },
		{ { SERVO_CAN_REPORT_MOTION, 1, { .motion = { 3000, -7 } } }, "1E1#0BB8FFF9" },
		{ { SERVO_CAN_REPORT_HEALTH, 1, { .health = { 0x0123, 0xFF85, 0x9001 } } },
		  "201#0123FF859001" },
		/* A bit no page explains is a fault all the same, and must not get lost. */
		{ { SERVO_CAN_REPORT_HEALTH, 31, { .health = { 480, 35, 0x4000 } } },
		  "21F#01E000234000" },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++)
		assert_vector(vectors[i].message, &plain, DRIVE, vectors[i].text);
}

static void acknowledgements(void **state)
{
	static const struct {
		const char *text;
		struct servo_can_ack ack;
	} vectors[] = {
		{ "002#01", { .code = SERVO_CAN_ACK_ENABLE } },
		{ "002#02", { .code = SERVO_CAN_ACK_MODE } },
		{ "002#04FC18", { .code = SERVO_CAN_ACK_SPEED, .value = -1000 } },
		{ "002#050019", { .code = SERVO_CAN_ACK_CURRENT, .value = 25 } },
		{ "002#06", { .code = SERVO_CAN_ACK_POSITION } },
		{ "002#09", { .code = SERVO_CAN_ACK_SET_FEEDBACK } },
		{ "002#0A", { .code = SERVO_CAN_ACK_RAMPS } },
		{ "002#03", { .code = SERVO_CAN_ACK_UNDOCUMENTED_03 } },
		{ "002#07", { .code = SERVO_CAN_ACK_UNDOCUMENTED_07 } },
		{ "002#08AABB", { .code = 0x08, .extra = 2, .bytes = { 0xAA, 0xBB } } },
		{ "002#0B01020304050607",
		  { .code = 0x0B, .extra = 7, .bytes = { 1, 2, 3, 4, 5, 6, 7 } } },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(vectors); i++) {
		struct servo_can_message ack = { SERVO_CAN_ACK, 1, { .ack = vectors[i].ack } };
		struct servo_can_message got;

		assert_vector(ack, &plain, DRIVE, vectors[i].text);
		got = decoded(vectors[i].text, &plain, DRIVE, SERVO_CAN_ACK, 1);
		assert_int_equal(got.u.ack.code, vectors[i].ack.code);
		assert_int_equal(got.u.ack.value, vectors[i].ack.value);
		assert_int_equal(got.u.ack.extra, vectors[i].ack.extra);
		assert_memory_equal(got.u.ack.bytes, vectors[i].ack.bytes, sizeof got.u.ack.bytes);
	}
}

static void broadcasts(void **state)
{
	const struct servo_can_message words = { .kind = SERVO_CAN_WORDS,
		                                 .u = { .words = { SERVO_CAN_CTRG, 0 } } };
	static const enum servo_can_kind not_to_all[] = {
		SERVO_CAN_MODE,
		SERVO_CAN_POSITION,
		SERVO_CAN_SET_FEEDBACK,
		SERVO_CAN_RAMPS,
		SERVO_CAN_READ,
		SERVO_CAN_ACK,
		SERVO_CAN_ANSWER_POSITION,
		SERVO_CAN_ANSWER_MOTION,
		SERVO_CAN_ANSWER_STATUS,
		SERVO_CAN_ANSWER_ANALOGUE,
		SERVO_CAN_REPORT_POSITION,
		SERVO_CAN_REPORT_MOTION,
		SERVO_CAN_REPORT_HEALTH,
	};

	(void)state;
	assert_vector((struct servo_can_message){ SERVO_CAN_ENABLE, 0, { .enable = true } }, &plain,
	              HOST, "020#000A");
	assert_vector((struct servo_can_message){ SERVO_CAN_SPEED, 0, { .speed = 1 } }, &plain,
	              HOST, "060#010001");
	assert_vector((struct servo_can_message){ SERVO_CAN_CURRENT, 0, { .current = -1 } }, &plain,
	              HOST, "060#02FFFF");
	assert_vector(words, &with_words, HOST, "0A0#00005CC50008");
	for (size_t i = 0; i < COUNT(not_to_all); i++) {
		struct servo_can_message message = { .kind = not_to_all[i],
			                             .u = { .ack = { .code = 1 } } };

		assert_false(servo_can_shapes[message.kind].broadcast);
		assert_refused(message, &plain, OUT_OF_RANGE);
		message.node = 32;
		assert_refused(message, &plain, OUT_OF_RANGE);
	}
}

/* --- what is refused ------------------------------------------------------------------------------ */

static void encoder_refuses(void **state)
{
	const struct servo_can_message wrong[] = {
		{ SERVO_CAN_FOREIGN, 1, { 0 } },
		{ SERVO_CAN_KIND_COUNT, 1, { 0 } },
		{ (enum servo_can_kind)(-1), 1, { 0 } },
		{ SERVO_CAN_ENABLE, 32, { 0 } },
		{ SERVO_CAN_MODE, 1, { .mode = { .mode = (enum servo_can_mode)3 } } },
		{ SERVO_CAN_MODE, 1, { .mode = { .mode = (enum servo_can_mode)0x10 } } },
		{ SERVO_CAN_MODE, 1, { .mode = { .max_speed = 1 } } },
		{ SERVO_CAN_READ, 1, { .selector = 8 } },
		{ SERVO_CAN_ACK, 1, { .ack = { .code = 0x00 } } },
		{ SERVO_CAN_ACK, 1, { .ack = { .code = 0x0C } } },
		{ SERVO_CAN_ACK, 1, { .ack = { .code = 0x07, .extra = 8 } } },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(wrong); i++)
		assert_refused(wrong[i], &plain, OUT_OF_RANGE);
}

static void wrong_lengths(void **state)
{
	static const struct {
		const char *text;
		enum servo_can_side from;
		enum servo_can_kind kind;
	} wrong[] = {
		{ "01F#00", HOST, SERVO_CAN_SYNC },
		{ "021#0A", HOST, SERVO_CAN_ENABLE },
		{ "021#000A00", HOST, SERVO_CAN_ENABLE },
		{ "041#0001", HOST, SERVO_CAN_MODE },
		{ "041#000101", HOST, SERVO_CAN_MODE },
		{ "041#0001010BB800", HOST, SERVO_CAN_MODE },
		{ "061#", HOST, SERVO_CAN_SPEED },
		{ "061#010A", HOST, SERVO_CAN_SPEED },
		{ "061#02000A00", HOST, SERVO_CAN_SPEED },
		{ "081#000000", HOST, SERVO_CAN_POSITION },
		{ "0E1#0000000000", HOST, SERVO_CAN_SET_FEEDBACK },
		{ "101#00000000", HOST, SERVO_CAN_RAMPS },
		{ "141#", HOST, SERVO_CAN_READ },
		{ "141#0000", HOST, SERVO_CAN_READ },
		{ "002#", DRIVE, SERVO_CAN_ACK },
		{ "002#04", DRIVE, SERVO_CAN_ACK },
		{ "002#0400", DRIVE, SERVO_CAN_ACK },
		{ "161#000000", DRIVE, SERVO_CAN_ANSWER_POSITION },
		{ "181#000000", DRIVE, SERVO_CAN_ANSWER_MOTION },
		{ "1A1#0000", DRIVE, SERVO_CAN_ANSWER_STATUS },
		{ "221#00", DRIVE, SERVO_CAN_ANSWER_ANALOGUE },
		{ "1C1#", DRIVE, SERVO_CAN_REPORT_POSITION },
		{ "1E1#000000", DRIVE, SERVO_CAN_REPORT_MOTION },
		{ "201#0000000000", DRIVE, SERVO_CAN_REPORT_HEALTH },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(wrong); i++)
		assert_error(wrong[i].text, &plain, wrong[i].from, SERVO_CAN_ERR_LENGTH,
		             wrong[i].kind, wrong[i].kind == SERVO_CAN_SYNC ? 0 : 1);
}

/* Some drives fill every frame up, some only a few: what is documented stands in front. */
static void drives_may_send_more(void **state)
{
	static const struct {
		const char *text;
		enum servo_can_kind kind;
	} longer[] = {
		{ "002#0100", SERVO_CAN_ACK },
		{ "002#0100000000000000", SERVO_CAN_ACK },
		{ "002#05001500", SERVO_CAN_ACK },
		{ "161#0000001500000000", SERVO_CAN_ANSWER_POSITION },
		{ "181#0015000000", SERVO_CAN_ANSWER_MOTION },
		{ "1A1#0015000000000000", SERVO_CAN_ANSWER_STATUS },
		{ "221#0015FF", SERVO_CAN_ANSWER_ANALOGUE },
		{ "1C1#0000001500", SERVO_CAN_REPORT_POSITION },
		{ "1E1#0015000000000000", SERVO_CAN_REPORT_MOTION },
		{ "201#0015000000000000", SERVO_CAN_REPORT_HEALTH },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(longer); i++) {
		(void)decoded(longer[i].text, &plain, DRIVE, longer[i].kind, 1);
		(void)decoded(longer[i].text, &padded, DRIVE, longer[i].kind, 1);
	}
	assert_int_equal(
		decoded("161#0000001500000000", &plain, DRIVE, SERVO_CAN_ANSWER_POSITION, 1)
			.u.position,
		0x15);
	assert_int_equal(decoded("002#05001500", &plain, DRIVE, SERVO_CAN_ACK, 1).u.ack.value,
	                 0x15);
}

static void a_length_above_eight(void **state)
{
	struct db_can_frame frame = frame_of("101#0000000000000000");
	struct servo_can_message message;

	(void)state;
	frame.length = 9;
	assert_int_equal(servo_can_decode(&frame, &plain, HOST, &message), SERVO_CAN_ERR_LENGTH);
	frame = frame_of("002#0700000000000000");
	frame.length = 9;
	assert_int_equal(servo_can_decode(&frame, &plain, DRIVE, &message), SERVO_CAN_ERR_LENGTH);
}

static void undocumented_values(void **state)
{
	(void)state;
	assert_error("021#0000", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_ENABLE, 1);
	assert_error("021#0010", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_ENABLE, 1);
	assert_error("021#0A00", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_ENABLE, 1);
	assert_error("041#0003000000", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_MODE, 1);
	assert_error("041#0021000000", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_MODE, 1);
	assert_error("041#8000000000", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_MODE, 1);
	assert_error("041#0001020BB8", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_MODE, 1);
	assert_error("061#000000", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_FOREIGN, 1);
	assert_error("07F#030000", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_FOREIGN, 31);
	assert_error("141#08", &plain, HOST, OUT_OF_RANGE, SERVO_CAN_READ, 1);
}

static void an_unknown_code_can_be_read(void **state)
{
	struct db_can_frame frame = frame_of("01F#0C0102");
	struct servo_can_message message;

	(void)state;
	assert_int_equal(servo_can_decode(&frame, &plain, DRIVE, &message), OUT_OF_RANGE);
	assert_int_equal(message.kind, SERVO_CAN_ACK);
	assert_int_equal(message.node, 30);
	assert_int_equal(message.u.ack.code, 0x0C);
	assert_error("002#00", &plain, DRIVE, OUT_OF_RANGE, SERVO_CAN_ACK, 1);
}

static void a_maximum_speed_that_does_not_count(void **state)
{
	struct servo_can_message mode = decoded("041#0001000BB8", &plain, HOST, SERVO_CAN_MODE, 1);

	(void)state;
	assert_false(mode.u.mode.has_max_speed);
	assert_int_equal(mode.u.mode.max_speed, 0);
}

static void foreign_frames(void **state)
{
	static const struct {
		const char *text;
		enum servo_can_side from;
	} foreign[] = {
		/* bases alone that are no broadcast, and what lies between and behind */
		{ "000#", HOST },
		{ "001#01", DRIVE },
		{ "040#0000000000", HOST },
		{ "080#00000000", HOST },
		{ "0E0#00000000", HOST },
		{ "100#0000000000000000", HOST },
		{ "140#00", HOST },
		{ "160#00000000", DRIVE },
		{ "1C0#00000000", DRIVE },
		{ "220#0000", DRIVE },
		{ "240#0000", DRIVE },
		{ "7FF#0000", DRIVE },
		/* pages that are missing */
		{ "0A1#0000", HOST },
		{ "0C1#0000", HOST },
		{ "121#0000", HOST },
		/* the other side's */
		{ "161#00000000", HOST },
		{ "201#000000000000", HOST },
		{ "002#01", HOST },
		{ "061#0103E8", DRIVE },
		{ "141#00", DRIVE },
		{ "0A1#00005CC50008", DRIVE },
	};
	static const uint32_t flags[] = { DB_CAN_EXTENDED, DB_CAN_REMOTE, DB_CAN_ERROR, 0x800 };

	(void)state;
	for (size_t i = 0; i < COUNT(foreign); i++)
		decoded(foreign[i].text, &plain, foreign[i].from, SERVO_CAN_FOREIGN, 0);
	for (size_t i = 0; i < COUNT(flags); i++) {
		struct db_can_frame frame = frame_of("181#00000000");
		struct servo_can_message message;

		frame.id |= flags[i];
		assert_int_equal(servo_can_decode(&frame, &plain, DRIVE, &message), SERVO_CAN_OK);
		assert_int_equal(message.kind, SERVO_CAN_FOREIGN);
	}
}

/* Every standard id, from each side, belongs to one kind and one node, or to nobody. */
static void every_id(void **state)
{
	unsigned ours[2] = { 0, 0 };

	(void)state;
	for (uint32_t id = 0; id <= DB_CAN_STANDARD_MASK; id++) {
		for (int side = 0; side < 2; side++) {
			struct db_can_frame frame = { .id = id, .length = DB_CAN_DATA_MAX };
			struct servo_can_message message;

			frame.data[0] = SERVO_CAN_ACK_SPEED;
			(void)servo_can_decode(&frame, &with_words, (enum servo_can_side)side,
			                       &message);
			/* The setpoint's first byte is wrong here, but its node is known. */
			ours[side] += message.kind != SERVO_CAN_FOREIGN || message.node != 0;
		}
	}
	/* sync; three with broadcast; five without */
	assert_int_equal(ours[HOST], 1 + 3 * 32 + 5 * 31);
	assert_int_equal(ours[DRIVE], 8 * 31);
}

/* The acknowledgements of nodes 30 and 31 have the ids of sync and of the enable to all. */
static void printed_collisions(void **state)
{
	struct servo_can_layout elsewhere = { .ack_base = 0x240 };

	(void)state;
	decoded("01F#01", &plain, DRIVE, SERVO_CAN_ACK, 30);
	decoded("020#01", &plain, DRIVE, SERVO_CAN_ACK, 31);
	decoded("01F#", &plain, HOST, SERVO_CAN_SYNC, 0);
	decoded("020#000A", &plain, HOST, SERVO_CAN_ENABLE, 0);
	assert_error("01F#", &plain, DRIVE, SERVO_CAN_ERR_LENGTH, SERVO_CAN_ACK, 30);
	assert_int_equal(servo_can_ack_collision(&plain, 29), SERVO_CAN_FOREIGN);
	assert_int_equal(servo_can_ack_collision(&plain, 30), SERVO_CAN_SYNC);
	assert_int_equal(servo_can_ack_collision(&plain, 31), SERVO_CAN_ENABLE);
	assert_int_equal(servo_can_ack_collision(&elsewhere, 30), SERVO_CAN_FOREIGN);
	assert_int_equal(servo_can_ack_collision(&elsewhere, 31), SERVO_CAN_FOREIGN);
}

/* --- what the document leaves open ---------------------------------------------------------------- */

static void command_words(void **state)
{
	struct servo_can_message words = { SERVO_CAN_WORDS, 3, { .words = { 0, 0 } } };
	struct servo_can_layout alone = with_words;

	(void)state;
	assert_vector(words, &with_words, HOST, "0A3#00005CC50000");
	words.u.words.word0 = SERVO_CAN_CTRG;
	assert_vector(words, &with_words, HOST, "0A3#00005CC50008");
	words.u.words.word0 = SERVO_CAN_WORD0_DOCUMENTED;
	assert_vector(words, &with_words, HOST, "0A3#00005CC501FE");
	words.u.words.word1 = 0x8001;
	assert_vector(words, &with_words, HOST, "0A3#80015CC501FE");
	words.u.words.word1 = 0;
	alone.words = (struct servo_can_words_layout){
		.set = true, .base = 0x7E0, .length = 2, .word1 = SERVO_CAN_NO_WORD, .ack = 0x42
	};
	assert_vector(words, &alone, HOST, "7E3#01FE");
	assert_vector((struct servo_can_message){ SERVO_CAN_ACK, 3, { .ack = { .code = 0x42 } } },
	              &alone, DRIVE, "004#42");
}

static void assert_layout(const struct servo_can_layout *layout, bool possible)
{
	char reason[SERVO_CAN_REASON_MAX];
	enum servo_can_described which;
	enum servo_can_error error = servo_can_layout_check(layout, &which, reason);

	if (error != (possible ? SERVO_CAN_OK : SERVO_CAN_ERR_LAYOUT))
		fail_msg("ack base %x, words at %x: %s", layout->ack_base, layout->words.base,
		         reason[0] ? reason : "allowed");
	assert_int_equal(reason[0] == '\0', possible);
}

/* Speed and current share their ids; the words may join them, told apart by byte 0. */
static void command_words_with_a_subcode(void **state)
{
	struct servo_can_message words = {
		SERVO_CAN_WORDS, 3, { .words = { SERVO_CAN_CTRG | SERVO_CAN_TRQLM, 0x1234 } }
	};
	struct servo_can_layout shared = {
		.ack_base = SERVO_CAN_BASE_ACK,
		.words = { .set = true,
		           .base = SERVO_CAN_BASE_SETPOINT,
		           .length = 8,
		           .word0 = 1,
		           .word1 = 3,
		           .ack = SERVO_CAN_ACK_NONE,
		           .fixed = { 0x03, 0, 0, 0, 0, 0, 0, 0x5A } },
	};
	struct servo_can_message ack = { SERVO_CAN_ACK, 3, { .ack = { .code = 0 } } };

	(void)state;
	assert_layout(&shared, true);
	assert_vector(words, &shared, HOST, "063#030018123400005A");
	words.node = SERVO_CAN_BROADCAST;
	assert_vector(words, &shared, HOST, "060#030018123400005A");
	assert_vector((struct servo_can_message){ SERVO_CAN_SPEED, 3, { .speed = 5 } }, &shared,
	              HOST, "063#010005");
	assert_vector((struct servo_can_message){ SERVO_CAN_CURRENT, 3, { .current = 5 } }, &shared,
	              HOST, "063#020005");
	/* Nothing acknowledges them, least of all code 0. */
	assert_int_equal(servo_can_ack_expected(&words, &shared), SERVO_CAN_ACK_NONE);
	assert_refused(ack, &shared, OUT_OF_RANGE);
	shared.words.fixed[0] = 0x01;
	assert_layout(&shared, false);
	shared.words.fixed[0] = 0x02;
	assert_layout(&shared, false);
	shared.words.fixed[0] = 0x03;
	shared.words.word0 = 0;
	assert_layout(&shared, false);
}

static void command_words_are_refused(void **state)
{
	struct servo_can_message words = { SERVO_CAN_WORDS, 3, { .words = { SERVO_CAN_CTRG, 0 } } };
	struct servo_can_layout impossible = with_words;

	(void)state;
	assert_refused(words, &plain, SERVO_CAN_ERR_LAYOUT);
	impossible.words.word0 = 5;
	assert_refused(words, &impossible, SERVO_CAN_ERR_LAYOUT);
	assert_error("0A3#00005CC50000", &impossible, HOST, SERVO_CAN_ERR_LAYOUT, SERVO_CAN_WORDS,
	             3);
	for (unsigned bit = 0; bit < 16; bit++) {
		words.u.words.word0 = (uint16_t)(1u << bit);
		words.u.words.word1 = 0;
		if (!servo_can_word0_name(bit))
			assert_refused(words, &with_words, OUT_OF_RANGE);
	}
	/* Word 1 is the user's, but not where its frame has no room for it. */
	impossible = with_words;
	impossible.words.word1 = SERVO_CAN_NO_WORD;
	words.u.words.word0 = 0;
	words.u.words.word1 = 1;
	assert_refused(words, &impossible, OUT_OF_RANGE);
	assert_error("0A3#00005CC50001", &with_words, HOST, OUT_OF_RANGE, SERVO_CAN_WORDS, 3);
	assert_error("0A3#00005CC40000", &with_words, HOST, OUT_OF_RANGE, SERVO_CAN_WORDS, 3);
	assert_error("0A3#00005CC500", &with_words, HOST, SERVO_CAN_ERR_LENGTH, SERVO_CAN_WORDS, 3);
	assert_error("0A3#00005CC5000000", &with_words, HOST, SERVO_CAN_ERR_LENGTH, SERVO_CAN_WORDS,
	             3);
}

static void acknowledgement_bases(void **state)
{
	static const uint16_t possible[] = {
		0x000, 0x001, 0x0A0, 0x0C0, 0x11F, 0x120, 0x23F, 0x7E0
	};
	static const uint16_t impossible[] = { 0x002, 0x01F, 0x040, 0x081, 0x0C1, 0x0E0,
		                               0x11E, 0x121, 0x23E, 0x7E1, 0x800, 0xFFFF };
	struct servo_can_layout layout = plain;

	(void)state;
	for (size_t i = 0; i < COUNT(possible); i++) {
		layout.ack_base = possible[i];
		assert_layout(&layout, true);
	}
	for (size_t i = 0; i < COUNT(impossible); i++) {
		layout.ack_base = impossible[i];
		assert_layout(&layout, false);
	}
	assert_refused((struct servo_can_message){ SERVO_CAN_ACK, 1, { .ack = { .code = 0x01 } } },
	               &layout, SERVO_CAN_ERR_LAYOUT);
}

static void command_word_bases(void **state)
{
	static const uint16_t possible[] = { 0x0A0, 0x0C0, 0x0B0, 0x120, 0x240, 0x7E0 };
	static const uint16_t impossible[] = { 0x000, 0x001, 0x020, 0x060, 0x09F, 0x0C1,
		                               0x100, 0x121, 0x160, 0x23F, 0x7E1, 0xFFFF };
	struct servo_can_layout layout = with_words;

	(void)state;
	for (size_t i = 0; i < COUNT(possible); i++) {
		layout.words.base = possible[i];
		assert_layout(&layout, true);
	}
	for (size_t i = 0; i < COUNT(impossible); i++) {
		layout.words.base = impossible[i];
		assert_layout(&layout, false);
		layout.words.set = false; /* then nobody cares */
		assert_layout(&layout, true);
		layout.words.set = true;
	}
	layout.words.base = 0x0A0;
	layout.ack_base = 0x0BE;
	assert_layout(&layout, false);
	layout.ack_base = 0x0BF;
	assert_layout(&layout, true);
}

static void command_word_places(void **state)
{
	static const struct {
		uint8_t length, word0, word1;
		bool possible;
	} places[] = {
		{ 2, 0, SERVO_CAN_NO_WORD, true },
		{ 4, 0, 2, true },
		{ 4, 2, 0, true },
		{ 8, 6, 4, true },
		{ 8, 1, 5, true },
		{ 0, 0, SERVO_CAN_NO_WORD, false },
		{ 1, 0, SERVO_CAN_NO_WORD, false },
		{ 9, 0, 2, false },
		{ 8, 7, 0, false },
		{ 8, 0, 7, false },
		{ 4, 0, 1, false },
		{ 4, 1, 0, false },
		{ 4, 0, 0, false },
		{ 8, SERVO_CAN_NO_WORD, 0, false },
		{ 8, 0, 0xFE, false },
	};
	static const uint8_t codes[] = { 0x01, 0x02, 0x04, 0x05, 0x06, 0x09, 0x0A };
	struct servo_can_layout layout = with_words;

	(void)state;
	for (size_t i = 0; i < COUNT(places); i++) {
		layout.words.length = places[i].length;
		layout.words.word0 = places[i].word0;
		layout.words.word1 = places[i].word1;
		assert_layout(&layout, places[i].possible);
	}
	layout = with_words;
	for (size_t i = 0; i < COUNT(codes); i++) {
		layout.words.ack = codes[i];
		assert_layout(&layout, false);
	}
	layout.words.ack = 0x0C;
	assert_layout(&layout, true);
	layout.words.ack = SERVO_CAN_ACK_NONE;
	assert_layout(&layout, true);
}

/* --- frames that the user describes ------------------------------------------------------------------ */

static const struct servo_can_layout described = {
	.ack_base = SERVO_CAN_BASE_ACK,
	.padded = true,
	.words = { .set = true,
	           .base = 0x0A0,
	           .length = 2,
	           .word1 = SERVO_CAN_NO_WORD,
	           .ack = SERVO_CAN_ACK_UNDOCUMENTED_07 },
	.word1 = { .set = true,
	           .base = 0x0C0,
	           .length = 3,
	           .at = 1,
	           .size = 2,
	           .ack = 0x10,
	           .fixed = { 0x5A } },
	.move = { .set = true,
	          .base = SERVO_CAN_BASE_SETPOINT,
	          .length = 5,
	          .at = 1,
	          .size = 3,
	          .low_first = true,
	          .ack = SERVO_CAN_ACK_UNDOCUMENTED_03,
	          .fixed = { 0x04, 0, 0, 0, 0xA5 } },
	.slot = 5,
	.slot_base = 0x120,
	.slot_ack = SERVO_CAN_ACK_UNDOCUMENTED_0B,
};

static void described_frames(void **state)
{
	struct servo_can_message word = { SERVO_CAN_WORD_1, 3, { .word1 = 0x8001 } };
	struct servo_can_message move = { SERVO_CAN_MOVE, 3, { .target = 0x123456 } };
	struct servo_can_message position = { SERVO_CAN_POSITION, 3, { .position = -2 } };

	(void)state;
	assert_layout(&described, true);
	assert_vector(word, &described, HOST, "0C3#5A8001");
	word.node = SERVO_CAN_BROADCAST;
	assert_vector(word, &described, HOST, "0C0#5A8001");
	/* Byte 0 tells it from speed and current. */
	assert_vector(move, &described, HOST, "063#04563412A5");
	move.u.target = -2;
	assert_vector(move, &described, HOST, "063#04FEFFFFA5");
	assert_vector(position, &described, HOST, "123#FFFFFFFE00000000");
	assert_vector((struct servo_can_message){ SERVO_CAN_ACK, 3, { .ack = { .code = 0x10 } } },
	              &described, DRIVE, "004#1000000000000000");
	assert_int_equal(servo_can_ack_expected(&move, &described), 0x03);
	assert_int_equal(servo_can_ack_expected(&position, &described), 0x0B);
	word.node = 3;
	assert_int_equal(servo_can_ack_expected(&word, &described), 0x10);
	assert_int_equal(servo_can_ack_expected(&word, &plain), SERVO_CAN_ACK_NONE);
}

static void described_frames_are_refused(void **state)
{
	struct servo_can_message move = { SERVO_CAN_MOVE, 3, { .target = 0x7FFFFF } };
	struct servo_can_layout impossible = described;

	(void)state;
	assert_vector(move, &described, HOST, "063#04FFFF7FA5");
	move.u.target++;
	assert_refused(move, &described, OUT_OF_RANGE);
	move.u.target = -0x800000;
	assert_vector(move, &described, HOST, "063#04000080A5");
	move.u.target--;
	assert_refused(move, &described, OUT_OF_RANGE);
	move.u.target = 0;
	assert_refused(move, &plain, SERVO_CAN_ERR_LAYOUT);
	move.node = SERVO_CAN_BROADCAST;
	assert_refused(move, &described, OUT_OF_RANGE);
	/* Nothing moves all drives at once. */
	decoded("060#04563412A5", &described, HOST, SERVO_CAN_FOREIGN, 0);
	assert_error("063#04563412A4", &described, HOST, OUT_OF_RANGE, SERVO_CAN_MOVE, 3);
	assert_error("063#04563412", &described, HOST, SERVO_CAN_ERR_LENGTH, SERVO_CAN_MOVE, 3);
	impossible.move.size = 8;
	assert_layout(&impossible, false);
	move.node = 3;
	assert_refused(move, &impossible, SERVO_CAN_ERR_LAYOUT);
	impossible = described;
	impossible.move.fixed[0] = 1;
	assert_layout(&impossible, false);
	impossible = described;
	impossible.word1.base = 0x0A0;
	assert_layout(&impossible, false);
	impossible.word1 = described.word1;
	impossible.word1.ack = 0x03;
	assert_layout(&impossible, false);
	impossible.word1 = described.word1;
	impossible.slot_base = 0x0B0;
	assert_layout(&impossible, false);
	/* The documented frame, with an acknowledgement of its own. */
	impossible.slot_base = SERVO_CAN_BASE_POSITION;
	assert_layout(&impossible, true);
}

static void padded_frames(void **state)
{
	struct servo_can_layout words = with_words;
	struct servo_can_message ack;

	(void)state;
	words.padded = true;
	assert_vector((struct servo_can_message){ SERVO_CAN_ENABLE, 1, { .enable = true } },
	              &padded, HOST, "021#000A000000000000");
	assert_vector((struct servo_can_message){ .kind = SERVO_CAN_SYNC }, &padded, HOST, "01F#");
	assert_vector((struct servo_can_message){ SERVO_CAN_WORDS, 1, { .words = { 8, 0 } } },
	              &words, HOST, "0A1#00005CC50008");
	assert_vector((struct servo_can_message){ SERVO_CAN_ANSWER_ANALOGUE, 1, { .analogue = 7 } },
	              &padded, DRIVE, "221#0007000000000000");
	ack = decoded("002#04FC181122334455", &padded, DRIVE, SERVO_CAN_ACK, 1);
	assert_int_equal(ack.u.ack.value, -1000);
	/* What is sent is padded; a drive that does not pad is understood all the same. */
	ack = decoded("002#04FC18", &padded, DRIVE, SERVO_CAN_ACK, 1);
	assert_int_equal(ack.u.ack.value, -1000);
	(void)decoded("221#0007", &padded, DRIVE, SERVO_CAN_ANSWER_ANALOGUE, 1);
	assert_error("021#000A", &padded, HOST, SERVO_CAN_ERR_LENGTH, SERVO_CAN_ENABLE, 1);
}

/* --- codes and names ------------------------------------------------------------------------------ */

static void expected_acknowledgements(void **state)
{
	static const struct {
		enum servo_can_kind kind;
		uint8_t code;
	} expected[] = {
		{ SERVO_CAN_FOREIGN, 0 },         { SERVO_CAN_SYNC, 0 },
		{ SERVO_CAN_ENABLE, 0x01 },       { SERVO_CAN_MODE, 0x02 },
		{ SERVO_CAN_SPEED, 0x04 },        { SERVO_CAN_CURRENT, 0x05 },
		{ SERVO_CAN_POSITION, 0x06 },     { SERVO_CAN_SET_FEEDBACK, 0x09 },
		{ SERVO_CAN_RAMPS, 0x0A },        { SERVO_CAN_READ, 0 },
		{ SERVO_CAN_WORDS, 0x07 },        { SERVO_CAN_ACK, 0 },
		{ SERVO_CAN_REPORT_HEALTH, 0 },   { SERVO_CAN_KIND_COUNT, 0 },
		{ SERVO_CAN_ANSWER_POSITION, 0 },
	};

	(void)state;
	for (size_t i = 0; i < COUNT(expected); i++) {
		struct servo_can_message message = { .kind = expected[i].kind, .node = 5 };

		assert_int_equal(servo_can_ack_expected(&message, &with_words), expected[i].code);
		message.node = SERVO_CAN_BROADCAST;
		assert_int_equal(servo_can_ack_expected(&message, &with_words), 0);
	}
	assert_int_equal(
		servo_can_ack_expected(
			&(struct servo_can_message){ .kind = SERVO_CAN_WORDS, .node = 5 }, &plain),
		0);
	for (unsigned code = 0; code <= UINT8_MAX; code++)
		assert_int_equal(servo_can_ack_documented((uint8_t)code),
		                 code < 16 && (0x0676u >> code & 1u));
}

static void names(void **state)
{
	unsigned word0 = 0;

	(void)state;
	for (unsigned bit = 0; bit < 40; bit++) {
		if (servo_can_word0_name(bit))
			word0 |= 1u << bit;
	}
	assert_int_equal(word0, SERVO_CAN_WORD0_DOCUMENTED);
	assert_string_equal(servo_can_word0_name(3), "ctrg");
	assert_string_equal(servo_can_word0_name(8), "pos2");
	assert_string_equal(servo_can_status_bits[0].name, "servo_started");
	assert_string_equal(servo_can_status_bits[4].name, "target_position_reached");
	assert_string_equal(servo_can_status_bits[6].name, "warning");
	assert_string_equal(servo_can_status_bits[11].name, "command_done");
	assert_string_equal(servo_can_status_bits[15].name, "forward_output");
	assert_string_equal(servo_can_faults[0].name, "undervoltage");
	assert_string_equal(servo_can_faults[7].name, "drive_overtemperature");
	assert_string_equal(servo_can_faults[13].name, "absolute_encoder_fault");
	assert_string_equal(servo_can_faults[14].name, "undocumented_fault_14");
	assert_string_equal(servo_can_faults[15].name, "locked");
	for (unsigned bit = 0; bit < SERVO_CAN_FAULTS; bit++) {
		assert_non_null(servo_can_faults[bit].name);
		assert_non_null(servo_can_faults[bit].check);
	}
	assert_string_equal(servo_can_mode_name(0), "position");
	assert_string_equal(servo_can_mode_name(1), "speed");
	assert_string_equal(servo_can_mode_name(2), "current");
	assert_null(servo_can_mode_name(3));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(host_frames),
		cmocka_unit_test(reads),
		cmocka_unit_test(drive_frames),
		cmocka_unit_test(acknowledgements),
		cmocka_unit_test(broadcasts),
		cmocka_unit_test(encoder_refuses),
		cmocka_unit_test(wrong_lengths),
		cmocka_unit_test(drives_may_send_more),
		cmocka_unit_test(a_length_above_eight),
		cmocka_unit_test(undocumented_values),
		cmocka_unit_test(an_unknown_code_can_be_read),
		cmocka_unit_test(a_maximum_speed_that_does_not_count),
		cmocka_unit_test(foreign_frames),
		cmocka_unit_test(every_id),
		cmocka_unit_test(printed_collisions),
		cmocka_unit_test(command_words),
		cmocka_unit_test(command_words_with_a_subcode),
		cmocka_unit_test(command_words_are_refused),
		cmocka_unit_test(acknowledgement_bases),
		cmocka_unit_test(command_word_bases),
		cmocka_unit_test(command_word_places),
		cmocka_unit_test(described_frames),
		cmocka_unit_test(described_frames_are_refused),
		cmocka_unit_test(padded_frames),
		cmocka_unit_test(expected_acknowledgements),
		cmocka_unit_test(names),
	};

	return cmocka_run_group_tests_name("codec/servo_can", tests, NULL, NULL);
}
