/* SPDX-License-Identifier: Apache-2.0 */
/* Servo on CAN: any frame from either side, read with any layout, stays inside its bytes, and what
 * was understood is written as it was read. */
#include "codec/servo_can_describe.h"
#include "codec/servo_can_layout.h"
#include "fakes/must.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The input: options, the layout's bytes, the frame's id (low byte first), flags, length and data; behind them there may
 * be the other frames that a layout may have. */
enum {
	AT_OPTIONS = 0,
	AT_ACK_BASE = 1,
	AT_WORDS_BASE = 3,
	AT_WORDS = 5, /* length, word 0, word 1, acknowledgement */
	AT_ID = 9,
	AT_FLAGS = 11,
	AT_LENGTH = 12,
	AT_DATA = 13,
	INPUT_SIZE = AT_DATA + DB_CAN_DATA_MAX,
	AT_MOVE =
		INPUT_SIZE, /* base, length, place, size, whether low byte first, acknowledgement */
	AT_WORD_1 = AT_MOVE + 7, /* base, length, place, acknowledgement */
	AT_SLOT = AT_WORD_1 + 5, /* base, acknowledgement */
	LONG_SIZE = AT_SLOT + 3,
	OPTION_FROM_DRIVE = 1,
	OPTION_PADDED = 2,
	OPTION_WORDS = 4,
	OPTION_MOVE = 8,
	OPTION_WORD_1 = 16,
};

static uint16_t take16(const uint8_t *bytes)
{
	return (uint16_t)(bytes[0] | bytes[1] << 8);
}

static struct servo_can_layout take_layout(const uint8_t *data)
{
	const uint8_t *words = data + AT_WORDS;

	return (struct servo_can_layout){
		.ack_base = take16(data + AT_ACK_BASE),
		.padded = (data[AT_OPTIONS] & OPTION_PADDED) != 0,
		.words = { .set = (data[AT_OPTIONS] & OPTION_WORDS) != 0,
		           .base = take16(data + AT_WORDS_BASE),
		           .length = words[0],
		           .word0 = words[1],
		           .word1 = words[2],
		           .ack = words[3],
		           .fixed = { 0x5A, 0x5A, 0x5A, 0x5A, 0x5A, 0x5A, 0x5A, 0x5A } },
	};
}

#define FIXED                                                  \
	{                                                      \
		0x5B, 0x5A, 0x5A, 0x5A, 0x5A, 0x5A, 0x5A, 0x5A \
	}

static void add_frames(const uint8_t *data, struct servo_can_layout *layout)
{
	const uint8_t *move = data + AT_MOVE;
	const uint8_t *word = data + AT_WORD_1;

	layout->move = (struct servo_can_number_layout){
		.set = (data[AT_OPTIONS] & OPTION_MOVE) != 0,
		.base = take16(move),
		.length = move[2],
		.at = move[3],
		.size = move[4],
		.low_first = (move[5] & 1) != 0,
		.ack = move[6],
		.fixed = FIXED,
	};
	layout->word1 = (struct servo_can_number_layout){
		.set = (data[AT_OPTIONS] & OPTION_WORD_1) != 0,
		.base = take16(word),
		.length = word[2],
		.at = word[3],
		.size = 2,
		.ack = word[4],
		.fixed = FIXED,
	};
	layout->slot_base = take16(data + AT_SLOT);
	layout->slot_ack = data[AT_SLOT + 2];
}

static struct db_can_frame take_frame(const uint8_t *data)
{
	struct db_can_frame frame = { .length = data[AT_LENGTH] };

	frame.id = (uint32_t)data[AT_FLAGS] << 24 | take16(data + AT_ID);
	memcpy(frame.data, data + AT_DATA, sizeof frame.data);
	return frame;
}

/* Some bytes are not read: those that pad, and a maximum speed that does not count. */
static bool every_byte_counts(const struct servo_can_message *message,
                              const struct servo_can_layout *layout)
{
	return (message->kind != SERVO_CAN_MODE || message->u.mode.has_max_speed) &&
	       (!layout->padded || message->kind == SERVO_CAN_WORDS ||
	        message->kind == SERVO_CAN_WORD_1 || message->kind == SERVO_CAN_MOVE);
}

static void round_trip(const struct db_can_frame *frame, const struct servo_can_layout *layout,
                       enum servo_can_side from, const struct servo_can_message *message)
{
	struct servo_can_message back;
	struct db_can_frame written;
	struct db_can_frame again;

	must(servo_can_encode(message, layout, &written) == SERVO_CAN_OK);
	must(written.id == frame->id);
	/* A drive's frame may be longer than we would have written it, or not padded. */
	if (from == SERVO_CAN_FROM_HOST)
		must(written.length == frame->length);
	else
		must(layout->padded || written.length <= frame->length);
	if (every_byte_counts(message, layout))
		must(memcmp(written.data, frame->data, written.length) == 0);
	must(servo_can_decode(&written, layout, from, &back) == SERVO_CAN_OK);
	must(back.kind == message->kind && back.node == message->node);
	must(servo_can_encode(&back, layout, &again) == SERVO_CAN_OK);
	must(memcmp(&again, &written, sizeof again) == 0);
}

static void check_message(const struct servo_can_message *message,
                          const struct servo_can_layout *layout)
{
	must((unsigned)message->kind < SERVO_CAN_KIND_COUNT);
	must(message->node <= SERVO_CAN_NODE_MAX);
	must(message->node != SERVO_CAN_BROADCAST || message->kind == SERVO_CAN_FOREIGN ||
	     servo_can_shapes[message->kind].broadcast);
	if (message->kind == SERVO_CAN_WORDS)
		must(layout->words.set);
	if (message->kind == SERVO_CAN_ACK)
		must(message->u.ack.extra < DB_CAN_DATA_MAX);
}

/* Whatever a message holds, a frame is either refused and untouched, or understood by its reader. */
static void write_anything(const uint8_t *data, const struct servo_can_layout *layout, bool usable)
{
	struct servo_can_message message;
	struct servo_can_message back;
	struct db_can_frame frame;
	struct db_can_frame before;

	memset(&message, 0, sizeof message);
	message.kind = (enum servo_can_kind)(data[AT_LENGTH] % (SERVO_CAN_KIND_COUNT + 1));
	message.node = data[AT_ID] & 0x3F;
	/* Its members that are bool must not be given anything but 0 and 1. */
	if (message.kind == SERVO_CAN_ENABLE)
		message.u.enable = data[AT_DATA] & 1;
	else if (message.kind != SERVO_CAN_MODE)
		memcpy(&message.u, data + AT_DATA, DB_CAN_DATA_MAX);
	memset(&frame, 0xEE, sizeof frame);
	before = frame;
	if (servo_can_encode(&message, layout, &frame) != SERVO_CAN_OK) {
		must(memcmp(&frame, &before, sizeof frame) == 0);
		return;
	}
	must(frame.id <= DB_CAN_STANDARD_MASK && frame.length <= DB_CAN_DATA_MAX);
	if (!usable)
		return;
	must(servo_can_decode(&frame, layout,
	                      message.kind < SERVO_CAN_ACK ? SERVO_CAN_FROM_HOST :
	                                                     SERVO_CAN_FROM_DRIVE,
	                      &back) == SERVO_CAN_OK);
	must(back.kind == message.kind);
	must(back.node == (message.kind == SERVO_CAN_SYNC ? 0 : message.node));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct servo_can_message message;
	struct servo_can_layout layout;
	struct db_can_frame frame;
	struct db_description description;
	enum servo_can_side from;
	enum servo_can_described which;
	char reason[SERVO_CAN_REASON_MAX];
	bool usable;

	if (size != INPUT_SIZE && size != LONG_SIZE)
		return 0;
	layout = take_layout(data);
	if (size == LONG_SIZE)
		add_frames(data, &layout);
	frame = take_frame(data);
	from = data[AT_OPTIONS] & OPTION_FROM_DRIVE ? SERVO_CAN_FROM_DRIVE : SERVO_CAN_FROM_HOST;
	usable = servo_can_layout_check(&layout, &which, reason) == SERVO_CAN_OK;
	must(usable == (reason[0] == '\0'));
	write_anything(data, &layout, usable);
	servo_can_describe(&frame, &layout, from, &description);
	must(strlen(description.text) == description.length);
	if (servo_can_decode(&frame, &layout, from, &message) == SERVO_CAN_OK &&
	    message.kind != SERVO_CAN_FOREIGN && usable)
		round_trip(&frame, &layout, from, &message);
	check_message(&message, &layout);
	return 0;
}
