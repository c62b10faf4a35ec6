/* SPDX-License-Identifier: Apache-2.0 */
/* SLCAN: whatever comes down the serial line, from either side, stays inside its buffer, and what
 * is understood is written again in a form that says the same. */
#include "codec/slcan.h"
#include "fakes/must.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static bool same_frame(const struct db_can_frame *a, const struct db_can_frame *b)
{
	return a->id == b->id && a->length == b->length &&
	       memcmp(a->data, b->data, sizeof a->data) == 0;
}

static void check_frame(const struct db_can_frame *frame)
{
	bool extended = frame->id & DB_CAN_EXTENDED;

	must(!(frame->id & DB_CAN_ERROR));
	must(frame->length <= DB_CAN_DATA_MAX);
	must(extended || (frame->id & DB_CAN_ID_MASK) <= DB_CAN_STANDARD_MASK);
	must(db_can_frame_bits(frame) <= db_can_frame_bits_max(extended, frame->length));
}

/* Written in our own way, a line goes through the reader as one line. */
static void read_again(const char *line, int length)
{
	struct slcan_reader reader = { 0 };

	must(length > 0 && length <= SLCAN_LINE_MAX);
	for (int i = 0; i < length - 1; i++)
		must(slcan_take(&reader, (uint8_t)line[i]) == SLCAN_TOOK_MORE);
	must(slcan_take(&reader, (uint8_t)line[length - 1]) == SLCAN_TOOK_LINE);
	must(reader.length == length && memcmp(reader.line, line, (size_t)length) == 0);
}

static void read_command(const char *line, size_t length)
{
	char text[SLCAN_LINE_MAX];
	struct slcan_command command;
	struct slcan_command again;
	int written;

	if (slcan_decode_command(line, length, &command) != SLCAN_OK)
		return;
	check_frame(&command.frame);
	written = slcan_encode_command(&command, text, sizeof text);
	read_again(text, written);
	must(slcan_decode_command(text, (size_t)written, &again) == SLCAN_OK);
	must(again.verb == command.verb && again.digit == command.digit &&
	     again.btr == command.btr && same_frame(&again.frame, &command.frame));
}

static void read_reply(const char *line, size_t length)
{
	char text[SLCAN_LINE_MAX];
	struct slcan_reply reply;
	struct slcan_reply again;
	int written;

	if (slcan_decode_reply(line, length, &reply) != SLCAN_OK)
		return;
	check_frame(&reply.frame);
	written = slcan_encode_reply(&reply, text, sizeof text);
	read_again(text, written);
	must(slcan_decode_reply(text, (size_t)written, &again) == SLCAN_OK);
	must(again.kind == reply.kind && same_frame(&again.frame, &reply.frame) &&
	     again.has_timestamp == reply.has_timestamp && again.timestamp == reply.timestamp &&
	     again.extended == reply.extended && again.flags == reply.flags &&
	     strcmp(again.text, reply.text) == 0);
}

/* Everything as one stream, and once more as one line to both decoders, without the reader. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct slcan_reader reader = { 0 };

	for (size_t i = 0; i < size; i++) {
		enum slcan_took took = slcan_take(&reader, data[i]);

		must(reader.length <= SLCAN_LINE_MAX);
		if (took != SLCAN_TOOK_LINE)
			continue;
		read_command(reader.line, reader.length);
		read_reply(reader.line, reader.length);
	}
	read_command((const char *)data, size);
	read_reply((const char *)data, size);
	return 0;
}
