/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_serial_frames.h"

#include <string.h>

#define FRAME_START 0xFF
#define FRAME_END 0xFE
#define FRAME_LEAST 6 /* FF id code BH BL FE */

#define HIGH_BITS UINT64_C(0x8080808080808080)

/* Number of leading bytes below 80; counted by words, because all bytes of a frame are, and each is
 * checked several times. */
static size_t count_plain(const uint8_t *bytes, size_t length)
{
	size_t count = 0;
	uint64_t word;

	for (; count + sizeof(word) <= length; count += sizeof(word)) {
		memcpy(&word, bytes + count, sizeof(word));
		if (word & HIGH_BITS)
			break;
	}
	while (count < length && bytes[count] < 0x80)
		count++;
	return count;
}

enum vsmd_cut vsmd_serial_cut(const uint8_t *bytes, size_t length, size_t *skip,
                              size_t *frame_length)
{
	const size_t plain_max = VSMD_SERIAL_FRAME_MAX - 2;
	const uint8_t *first;
	size_t end = 0;

	*frame_length = 0;
	while (end < length && (first = memchr(bytes + end, FRAME_START, length - end)) != NULL) {
		size_t start = (size_t)(first - bytes);
		size_t room = length - start - 1;
		size_t plain = count_plain(first + 1, room < plain_max ? room : plain_max);

		end = start + 1 + plain;
		if (end == length || bytes[end] == FRAME_END) {
			*skip = start;
			*frame_length = end == length ? 0 : plain + 2;
			return end == length ? VSMD_CUT_MORE : VSMD_CUT_FRAME;
		}
	}
	*skip = length;
	return VSMD_CUT_MORE;
}

static uint8_t bcc_of(const uint8_t *bytes, size_t length)
{
	uint64_t all = 0;
	uint64_t word;
	uint8_t bcc;

	for (; length >= sizeof(word); length -= sizeof(word)) {
		memcpy(&word, bytes, sizeof(word));
		all ^= word;
		bytes += sizeof(word);
	}
	all ^= all >> 32;
	all ^= all >> 16;
	bcc = (uint8_t)(all ^ all >> 8);
	for (size_t i = 0; i < length; i++)
		bcc ^= bytes[i];
	return bcc;
}

/* Five groups of seven bits, most significant first; the first one carries only four. */
static bool take_groups(const uint8_t *groups, uint32_t *value)
{
	if (groups[0] > 0x0F)
		return false;
	*value = (uint32_t)groups[0] << 28 | (uint32_t)groups[1] << 21 | (uint32_t)groups[2] << 14 |
	         (uint32_t)groups[3] << 7 | groups[4];
	return true;
}

static void put_groups(uint32_t value, uint8_t *groups)
{
	for (size_t i = 0; i < 5; i++)
		groups[i] = value >> (28 - 7 * i) & 0x7F;
}

static bool is_text(const uint8_t *data, size_t length)
{
	for (size_t i = 0; i < length; i++) {
		if ((data[i] < 0x20 || data[i] > 0x7E) && !vsmd_is_blank((char)data[i]))
			return false;
	}
	return true;
}

enum vsmd_error vsmd_serial_decode_reply(const uint8_t *frame, size_t length,
                                         struct vsmd_reply *reply)
{
	const uint8_t *data;
	size_t data_length;
	uint32_t speed;
	uint32_t position;

	*reply = (struct vsmd_reply){ 0 };
	if (length < FRAME_LEAST || frame[0] != FRAME_START || frame[length - 1] != FRAME_END)
		return VSMD_ERR_SYNTAX;
	if (count_plain(frame + 1, length - 2) != length - 2 || frame[length - 3] != 0 ||
	    frame[length - 2] != bcc_of(frame + 1, length - 4) || frame[1] > VSMD_SERIAL_ID_MAX)
		return VSMD_ERR_SYNTAX;
	data = frame + 3;
	data_length = length - FRAME_LEAST;
	reply->id = frame[1];
	switch (frame[2]) {
	case VSMD_REPLY_STATUS:
		reply->code = VSMD_REPLY_STATUS;
		if (data_length != 15 || !take_groups(data, &speed) ||
		    !take_groups(data + 5, &position) ||
		    !take_groups(data + 10, &reply->status.status))
			return VSMD_ERR_SYNTAX;
		memcpy(&reply->status.velocity, &speed, sizeof(speed));
		memcpy(&reply->status.position, &position, sizeof(position));
		return VSMD_OK;
	case VSMD_REPLY_IDENTITY:
	case VSMD_REPLY_PARAMS:
		reply->code = (enum vsmd_reply_code)frame[2];
		reply->text = (const char *)data;
		reply->text_length = data_length;
		while (reply->text_length > 0 && vsmd_is_blank(reply->text[reply->text_length - 1]))
			reply->text_length--;
		return is_text(data, data_length) ? VSMD_OK : VSMD_ERR_SYNTAX;
	default:
		return VSMD_ERR_SYNTAX;
	}
}

static int close_frame(uint8_t *frame, size_t data_length)
{
	size_t end = 3 + data_length;
	uint8_t bcc = bcc_of(frame + 1, end - 1);

	frame[end] = bcc >> 7;
	frame[end + 1] = bcc & 0x7F;
	frame[end + 2] = FRAME_END;
	return (int)(data_length + FRAME_LEAST);
}

int vsmd_serial_encode_status(uint8_t id, const struct vsmd_status *status, uint8_t *frame,
                              size_t size)
{
	uint32_t speed;
	uint32_t position;

	if (size < VSMD_SERIAL_STATUS_FRAME)
		return VSMD_ERR_SPACE;
	if (id > VSMD_SERIAL_ID_MAX)
		return VSMD_ERR_RANGE;
	memcpy(&speed, &status->velocity, sizeof(speed));
	memcpy(&position, &status->position, sizeof(position));
	frame[0] = FRAME_START;
	frame[1] = id;
	frame[2] = VSMD_REPLY_STATUS;
	put_groups(speed, frame + 3);
	put_groups(position, frame + 8);
	put_groups(status->status, frame + 13);
	return close_frame(frame, 15);
}

int vsmd_serial_encode_text(uint8_t id, enum vsmd_reply_code code, const char *text, size_t length,
                            uint8_t *frame, size_t size)
{
	/* A longer frame would be discarded as garbage when the stream is cut. */
	if (size > VSMD_SERIAL_FRAME_MAX)
		size = VSMD_SERIAL_FRAME_MAX;
	if (length > size || size - length < FRAME_LEAST)
		return VSMD_ERR_SPACE;
	if (id > VSMD_SERIAL_ID_MAX || (code != VSMD_REPLY_IDENTITY && code != VSMD_REPLY_PARAMS) ||
	    !is_text((const uint8_t *)text, length))
		return VSMD_ERR_RANGE;
	frame[0] = FRAME_START;
	frame[1] = id;
	frame[2] = (uint8_t)code;
	memcpy(frame + 3, text, length);
	return close_frame(frame, length);
}
