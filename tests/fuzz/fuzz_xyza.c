/* SPDX-License-Identifier: Apache-2.0 */
/* XYZA: whatever comes down the line, from either side, stays inside its buffer. */
#include "codec/xyza_describe.h"

#include "codec/xyza_frames.h"
#include "fakes/must.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static bool same_request(const struct xyza_request *a, const struct xyza_request *b)
{
	return a->verb == b->verb && a->object == b->object && a->order == b->order &&
	       a->axis == b->axis && a->item == b->item && a->negative == b->negative &&
	       a->on == b->on && a->number == b->number && a->value == b->value;
}

static bool same_reply(const struct xyza_reply *a, const struct xyza_reply *b)
{
	return a->kind == b->kind && a->object == b->object && a->order == b->order &&
	       a->item_class == b->item_class && a->target == b->target && a->value == b->value &&
	       a->state == b->state && a->program == b->program && a->step == b->step;
}

/* A request that was understood can be said again, and then means the same. */
static void read_request(const uint8_t *frame, size_t length)
{
	uint8_t again[XYZA_FRAME_MAX];
	struct xyza_request request;
	struct xyza_request copy;
	int written;

	if (xyza_decode_request(frame, length, &request) != XYZA_OK)
		return;
	written = xyza_encode_request(&request, again, sizeof again);
	must(written == (int)length);
	must(xyza_decode_request(again, (size_t)written, &copy) == XYZA_OK);
	must(same_request(&request, &copy));
}

static void read_reply(const uint8_t *frame, size_t length)
{
	const struct xyza_style style = { .answer_mark_0a = frame[2] == 0x0A,
		                          .failure_bb = frame[3] == XYZA_ORDER_FAILED_BB };
	uint8_t again[XYZA_FRAME_MAX];
	struct xyza_reply reply;
	struct xyza_reply copy;
	int written;

	if (xyza_decode_reply(frame, length, &reply) != XYZA_OK)
		return;
	written = xyza_encode_reply(&reply, &style, again, sizeof again);
	must(written == (int)length);
	must(xyza_decode_reply(again, (size_t)written, &copy) == XYZA_OK);
	must(same_reply(&reply, &copy));
	/* Two bytes of a program's state are reserved, so not repeated. */
	if (reply.kind != XYZA_REPLY_PROGRAM_STATE)
		must(memcmp(again, frame, length) == 0);
	for (int verb = 0; verb < XYZA_VERB_COUNT; verb++) {
		struct xyza_request request = { .verb = (enum xyza_verb)verb,
			                        .object = reply.object,
			                        .axis = (enum xyza_axis)(frame[7] % 4) };

		if (xyza_fits(&request, &reply))
			must(reply.kind == XYZA_REPLY_FAILED ||
			     xyza_reply_length(request.verb) == length);
	}
}

/* What a host may say by itself: only to the object, and cut out of a stream as a whole. */
static void say_raw(const uint8_t *frame, size_t length)
{
	uint8_t said[XYZA_FRAME_MAX];
	int written = xyza_encode_raw(frame + 2, length - 3, 7, said, sizeof said);
	size_t skip;
	size_t cut;
	bool failed;
	bool shows;

	if (written < 0)
		return;
	must(written == (int)length && said[5] == 7 && said[4] != 0);
	xyza_cut(said, (size_t)written, &skip, &cut);
	must(skip == 0 && cut == (size_t)written);
	must(xyza_sender(said, (size_t)written) == 0);
	if (xyza_raw_fits(said, frame, length, &failed, &shows))
		must(xyza_sender(frame, length) == 7 && !(failed && shows));
}

static void describe(const uint8_t *frame, size_t length)
{
	struct db_description description;

	for (int sent = 0; sent < 2; sent++) {
		xyza_describe(frame, length, sent, &description);
		must(strlen(description.text) == description.length);
		must(description.axis >= -1 && description.axis < XYZA_AXIS_COUNT);
	}
}

/* The whole input as a stream. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	size_t skip;
	size_t length;

	do {
		xyza_cut(data, size, &skip, &length);
		must(skip <= size && length <= XYZA_FRAME_MAX && length <= size - skip);
		if (length > 0) {
			must(length >= XYZA_COMMAND_FRAME);
			must(data[skip] == 0x5A && data[skip + 1] == 0xA5);
			read_request(data + skip, length);
			read_reply(data + skip, length);
			say_raw(data + skip, length);
			describe(data + skip, length);
		} else {
			must(size - skip < XYZA_FRAME_MAX);
		}
		data += skip + length;
		size -= skip + length;
	} while (length > 0);
	return 0;
}
