/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Answers of VSMD drives on serial lines: frames of FF ... FE with a checksum, of a status or of a
 * text. Both directions. Pure; any thread. Source: VSMD custom protocol for RS232 & RS485, section
 * 3.
 */
#ifndef DRIVEBRIDGE_CODEC_VSMD_SERIAL_FRAMES_H
#define DRIVEBRIDGE_CODEC_VSMD_SERIAL_FRAMES_H

#include "codec/vsmd_serial.h"

/* True for characters between words of a text, and at its ends. */
static inline bool vsmd_is_blank(char character)
{
	return character == ' ' || character == '\t' || character == '\r' || character == '\n' ||
	       character == '\0';
}

enum vsmd_reply_code { VSMD_REPLY_IDENTITY = 1, VSMD_REPLY_STATUS = 2, VSMD_REPLY_PARAMS = 3 };

struct vsmd_reply {
	uint8_t id;
	enum vsmd_reply_code code;
	struct vsmd_status status; /* code STATUS */
	/* codes IDENTITY and PARAMS: points into the frame, not terminated, without blanks at its
	 * end */
	const char *text;
	size_t text_length;
};

/*
 * Cuts the next frame out of a stream. Looks at bytes[0..length) and says what to do:
 *   VSMD_CUT_MORE    nothing complete yet; *skip leading bytes are garbage and can be dropped
 *   VSMD_CUT_FRAME   after dropping *skip bytes, the next *frame_length bytes are FF ... FE with
 *                    all bytes between below 80; checksum not checked yet
 * A byte >= 80 inside a frame, a new FF, or more than VSMD_SERIAL_FRAME_MAX bytes without FE end
 * the attempt: what came before is garbage. Never reads past length.
 */
enum vsmd_cut { VSMD_CUT_MORE, VSMD_CUT_FRAME };
enum vsmd_cut vsmd_serial_cut(const uint8_t *bytes, size_t length, size_t *skip,
                              size_t *frame_length);

/*
 * Reads one whole frame. VSMD_OK, or VSMD_ERR_SYNTAX: bad length for the code, checksum wrong, BH
 * not zero, unknown code, id above 32, group with too many bits, byte above 7F, text with control
 * characters.
 */
enum vsmd_error vsmd_serial_decode_reply(const uint8_t *frame, size_t length,
                                         struct vsmd_reply *reply);

/* The code of a frame that was decoded successfully before. */
static inline enum vsmd_reply_code vsmd_serial_code(const uint8_t *frame)
{
	return (enum vsmd_reply_code)frame[2];
}

/* Drive's side. Returns the frame's length or VSMD_ERR_SPACE / VSMD_ERR_RANGE (byte above 7F in a
 * text). */
int vsmd_serial_encode_status(uint8_t id, const struct vsmd_status *status, uint8_t *frame,
                              size_t size);
int vsmd_serial_encode_text(uint8_t id, enum vsmd_reply_code code, const char *text, size_t length,
                            uint8_t *frame, size_t size);

#endif
