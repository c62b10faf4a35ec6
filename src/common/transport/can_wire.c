/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/transport_private.h"

#include <string.h>

#define FRAME_SIZE sizeof(struct db_can_frame)

/* Bits of a frame without data and stuff bits, acknowledge to intermission included. */
#define STANDARD_FRAME_BITS 47u
#define EXTENDED_FRAME_BITS 67u

/* The length of a full frame in answer_length, and of each frame in addition to its data. */
#define FULL_ANSWER_FRAME 16
#define ANSWER_OVERHEAD 8

struct db_can_frame db_can_frame_at(const uint8_t *bytes, size_t offset)
{
	struct db_can_frame frame;

	memcpy(&frame, bytes + offset, sizeof(frame));
	return frame;
}

uint64_t db_can_wire_bits(const uint8_t *request, size_t request_length, size_t answer_length)
{
	bool extended = true;
	uint64_t bits = 0;
	size_t frames;
	size_t overhead;
	size_t data;

	for (size_t at = 0; at + FRAME_SIZE <= request_length; at += FRAME_SIZE) {
		struct db_can_frame frame = db_can_frame_at(request, at);

		extended = frame.id & DB_CAN_EXTENDED;
		bits += db_can_frame_bits(&frame);
	}
	frames = (answer_length + FULL_ANSWER_FRAME - 1) / FULL_ANSWER_FRAME;
	overhead = frames * ANSWER_OVERHEAD;
	data = answer_length > overhead ? answer_length - overhead : 0;
	return bits + (frames * (extended ? EXTENDED_FRAME_BITS : STANDARD_FRAME_BITS) + 8 * data);
}
