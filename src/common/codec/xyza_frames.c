/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/xyza_frames.h"

#include <string.h>

#define HEADER_0 0x5A
#define HEADER_1 0xA5

/* Positions in a frame. */
enum place {
	AT_MARK = 2,
	AT_ORDER = 3,
	AT_LEVEL = 4,
	AT_OBJECT = 5,
	AT_CLASS = 6,
	AT_TARGET = 7,
	AT_VALUE = 8, /* data frames; in the others the checksum */
};

#define EVEN_BYTES UINT64_C(0x00FF00FF00FF00FF)
#define ONES UINT64_C(0x0001000100010001)

/* Eight bytes at a time: pairs of them, then all pairs into the highest sixteen bits. */
static uint8_t sum_of(const uint8_t *bytes, size_t length)
{
	uint64_t total = 0;
	uint64_t word;

	for (; length >= sizeof(word); length -= sizeof(word)) {
		memcpy(&word, bytes, sizeof(word));
		total += ((word & EVEN_BYTES) + (word >> 8 & EVEN_BYTES)) * ONES >> 48;
		bytes += sizeof(word);
	}
	for (size_t i = 0; i < length; i++)
		total += bytes[i];
	return (uint8_t)total;
}

static bool sum_is_right(const uint8_t *frame, size_t length)
{
	return sum_of(frame + AT_ORDER, length - AT_ORDER - 1) == frame[length - 1];
}

/* Bytes of a whole frame with this mark; 0 when there is no such mark. */
static size_t frame_length(uint8_t mark)
{
	switch (mark) {
	case XYZA_MARK_COMMAND:
	case XYZA_MARK_ANSWER:
		return XYZA_COMMAND_FRAME;
	case XYZA_MARK_DATA:
		return XYZA_DATA_FRAME;
	case XYZA_MARK_PROGRAM_COMMAND:
		return XYZA_COMMAND_FRAME + 2; /* two bytes of instruction */
	case XYZA_MARK_PROGRAM_DATA:
	case XYZA_MARK_ACTION:
		return XYZA_FRAME_MAX;
	default:
		return 0;
	}
}

int xyza_write_frame(const struct xyza_frame *content, uint8_t *frame, size_t size)
{
	size_t length = frame_length(content->mark);

	if (size < length)
		return XYZA_ERR_SPACE;
	frame[0] = HEADER_0;
	frame[1] = HEADER_1;
	frame[AT_MARK] = content->mark;
	frame[AT_ORDER] = content->order;
	frame[AT_LEVEL] = content->level;
	frame[AT_OBJECT] = content->object;
	frame[AT_CLASS] = content->item_class;
	frame[AT_TARGET] = content->target;
	if (content->mark == XYZA_MARK_DATA) {
		for (size_t i = 0; i < sizeof(content->value); i++)
			frame[AT_VALUE + i] = (uint8_t)(content->value >> (8 * i));
	}
	frame[length - 1] = sum_of(frame + AT_ORDER, length - AT_ORDER - 1);
	return (int)length;
}

enum xyza_error xyza_read_frame(const uint8_t *frame, size_t length, struct xyza_frame *content)
{
	if (length < XYZA_COMMAND_FRAME || frame[0] != HEADER_0 || frame[1] != HEADER_1 ||
	    frame_length(frame[AT_MARK]) != length)
		return XYZA_ERR_FORM;
	*content = (struct xyza_frame){
		.mark = frame[AT_MARK],
		.order = frame[AT_ORDER],
		.level = frame[AT_LEVEL],
		.object = frame[AT_OBJECT],
		.item_class = frame[AT_CLASS],
		.target = frame[AT_TARGET],
	};
	if (content->mark == XYZA_MARK_DATA)
		content->value = (uint32_t)frame[AT_VALUE] | (uint32_t)frame[AT_VALUE + 1] << 8 |
		                 (uint32_t)frame[AT_VALUE + 2] << 16 |
		                 (uint32_t)frame[AT_VALUE + 3] << 24;
	return sum_is_right(frame, length) ? XYZA_OK : XYZA_ERR_CHECKSUM;
}

/* The next bytes that may be the beginning of a frame, also where those available are too few to
 * tell. */
static size_t find_beginning(const uint8_t *bytes, size_t from, size_t available)
{
	while (from < available) {
		const uint8_t *header = memchr(bytes + from, HEADER_0, available - from);
		size_t left;

		if (!header)
			return available;
		from = (size_t)(header - bytes);
		left = available - from;
		if ((left < 2 || header[1] == HEADER_1) &&
		    (left <= AT_MARK || frame_length(header[AT_MARK]) != 0))
			break;
		from++;
	}
	return from;
}

void xyza_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length)
{
	size_t start = find_beginning(bytes, 0, available);

	*length = 0;
	while (available - start > AT_MARK) {
		size_t whole = frame_length(bytes[start + AT_MARK]);
		size_t next;

		if (available - start < whole)
			break;
		next = start + whole;
		if (!sum_is_right(bytes + start, whole))
			next = find_beginning(bytes, start + 1, start + whole);
		if (next == start + whole) {
			*length = whole;
			break;
		}
		/* A seeming beginning at the end of that frame may be none. */
		start = find_beginning(bytes, next, available);
	}
	*skip = start;
}

/* --- a controller's frames, whatever their content -------------------------------------------- */

uint32_t xyza_part(const uint8_t *frame, size_t length)
{
	if (length != XYZA_DATA_FRAME || frame[AT_MARK] != XYZA_MARK_DATA ||
	    frame[AT_ORDER] != XYZA_ORDER_DATA || frame[AT_CLASS] < XYZA_CLASS_POSITION ||
	    frame[AT_CLASS] > XYZA_CLASS_SYSTEM)
		return 0;
	return 1u + ((uint32_t)frame[AT_CLASS] << 8 | frame[AT_TARGET]);
}

uint8_t xyza_sender(const uint8_t *frame, size_t length)
{
	struct xyza_frame content;

	if (xyza_read_frame(frame, length, &content) != XYZA_OK ||
	    content.level != XYZA_LEVEL_CONTROLLER)
		return 0;
	return content.object;
}

/* --- frames of users -------------------------------------------------------------------------- */

int xyza_encode_raw(const uint8_t *content, size_t length, uint8_t object, uint8_t *frame,
                    size_t size)
{
	size_t whole = length > 0 ? frame_length(content[0]) : 0;

	if (whole == 0 || content[0] == XYZA_MARK_ANSWER || length != whole - AT_MARK - 1)
		return XYZA_ERR_FORM;
	if (size < whole)
		return XYZA_ERR_SPACE;
	frame[0] = HEADER_0;
	frame[1] = HEADER_1;
	memcpy(frame + AT_MARK, content, length);
	if (frame[AT_OBJECT] == 0)
		frame[AT_OBJECT] = object;
	if (frame[AT_OBJECT] != object || frame[AT_LEVEL] == XYZA_LEVEL_CONTROLLER)
		return XYZA_ERR_RANGE;
	frame[whole - 1] = sum_of(frame + AT_ORDER, whole - AT_ORDER - 1);
	return (int)whole;
}

bool xyza_raw_fits(const uint8_t *request, const uint8_t *frame, size_t length, bool *failed,
                   bool *shows)
{
	uint8_t order = request[AT_ORDER];
	struct xyza_frame content;

	if (xyza_sender(frame, length) != request[AT_OBJECT] ||
	    xyza_read_frame(frame, length, &content) != XYZA_OK)
		return false;
	*shows = !(content.order == XYZA_ORDER_OK || content.order == XYZA_ORDER_FAILED ||
	           content.order == XYZA_ORDER_FAILED_BB);
	*failed = !*shows && content.order != XYZA_ORDER_OK;
	if (!*shows)
		return content.target == order;
	/* Orders whose data the bridge itself requests. */
	return content.order == order ||
	       !(content.order == XYZA_ORDER_DATA || content.order == XYZA_ORDER_PROGRAM);
}
