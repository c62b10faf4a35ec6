/* SPDX-License-Identifier: Apache-2.0 */
/* VSMD serial: whatever comes down the line, from either side, stays inside its buffer. */
#include "codec/vsmd_describe.h"
#include "codec/vsmd_serial_frames.h"
#include "fakes/must.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void walk_params(const char *text, size_t length)
{
	struct vsmd_setting setting;
	size_t cursor = 0;
	size_t before = 0;
	int result;

	while ((result = vsmd_serial_next_param(text, length, &cursor, &setting)) != 0) {
		must(result == 1 || result == 2);
		must(cursor > before && cursor <= length);
		if (result == 1)
			must((unsigned)setting.param < VSMD_PARAM_COUNT);
		before = cursor;
	}
}

/* A reply that was accepted is the only one that says the same. */
static void read_reply(const uint8_t *frame, size_t length)
{
	uint8_t again[VSMD_SERIAL_FRAME_MAX];
	struct vsmd_reply reply;
	int written;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return;
	if (reply.code == VSMD_REPLY_STATUS) {
		written = vsmd_serial_encode_status(reply.id, &reply.status, again, sizeof again);
	} else {
		/* Blanks behind a text are no part of it. */
		must(reply.text == (const char *)frame + 3 && reply.text_length <= length - 6);
		walk_params(reply.text, reply.text_length);
		written = vsmd_serial_encode_text(reply.id, reply.code, reply.text, length - 6,
		                                  again, sizeof again);
	}
	must(written == (int)length && memcmp(again, frame, length) == 0);
}

static void read_stream(const uint8_t *data, size_t size)
{
	size_t frame_length;
	size_t skip;

	while (vsmd_serial_cut(data, size, &skip, &frame_length) == VSMD_CUT_FRAME) {
		must(skip <= size && frame_length >= 2 && frame_length <= size - skip);
		must(frame_length <= VSMD_SERIAL_FRAME_MAX);
		must(data[skip] == 0xFF && data[skip + frame_length - 1] == 0xFE);
		read_reply(data + skip, frame_length);
		data += skip + frame_length;
		size -= skip + frame_length;
	}
	must(skip <= size);
}

static bool same(const struct vsmd_command *a, const struct vsmd_command *b)
{
	if (a->setting_count != b->setting_count)
		return false;
	for (size_t i = 0; i < a->setting_count; i++) {
		if (a->settings[i].param != b->settings[i].param ||
		    a->settings[i].value.u != b->settings[i].value.u)
			return false;
	}
	return a->verb == b->verb && a->id == b->id && a->has_value == b->has_value &&
	       a->has_velocity == b->has_velocity && a->position == b->position &&
	       a->velocity == b->velocity && a->port == b->port && a->value == b->value &&
	       a->shake_start == b->shake_start && a->shake_end == b->shake_end &&
	       a->shake_frequency == b->shake_frequency && a->shake_count == b->shake_count;
}

static void read_line(const char *line, size_t length, bool rs485)
{
	/* Room for the widest writing of as many settings as are read. */
	static const size_t widest = 64;
	struct vsmd_setting settings[VSMD_PARAM_COUNT];
	struct vsmd_setting again[VSMD_PARAM_COUNT];
	struct vsmd_command command;
	struct vsmd_command copy;
	char text[64 * (VSMD_PARAM_COUNT + 2)];
	int written;

	if (vsmd_serial_decode_command(line, length, rs485, &command, settings, VSMD_PARAM_COUNT) !=
	    VSMD_OK)
		return;
	written = vsmd_serial_encode_command(&command, text, sizeof text);
	must(written > 0 && (size_t)written <= widest * (command.setting_count + 2));
	must(text[written - 1] == '\n');
	must(vsmd_serial_decode_command(text, (size_t)written - 1, rs485, &copy, again,
	                                VSMD_PARAM_COUNT) == VSMD_OK);
	must(same(&command, &copy));
}

/* The first byte chooses between RS232 and RS485; the rest goes to every reader there is. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct db_description description;

	if (size == 0)
		return 0;
	read_stream(data + 1, size - 1);
	read_reply(data + 1, size - 1 <= VSMD_SERIAL_FRAME_MAX ? size - 1 : 0);
	walk_params((const char *)data + 1, size - 1);
	read_line((const char *)data + 1, size - 1, data[0] & 1);
	vsmd_serial_describe_line(data + 1, size - 1, data[0] & 1, &description);
	must(strlen(description.text) == description.length);
	vsmd_serial_describe_reply(data + 1, size - 1, &description);
	must(strlen(description.text) == description.length);
	return 0;
}
