/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Frames of XYZA controllers: where they begin and end, their checksum, and the fields that all of
 * them have. Both directions. Pure; any thread. Source: the vendor's protocol V1.00 of 2016-10-20,
 * section 2.
 */
#ifndef DRIVEBRIDGE_CODEC_XYZA_FRAMES_H
#define DRIVEBRIDGE_CODEC_XYZA_FRAMES_H

#include "codec/xyza.h"

enum xyza_mark {
	XYZA_MARK_COMMAND = 0x0A,
	XYZA_MARK_DATA = 0x0B,
	XYZA_MARK_ANSWER = 0x0C,
	XYZA_MARK_PROGRAM_DATA = 0x0D,
	XYZA_MARK_PROGRAM_COMMAND = 0x0E,
	XYZA_MARK_ACTION = 0x0F,
};

enum xyza_level { XYZA_LEVEL_CONTROLLER = 0, XYZA_LEVEL_HOST = 1, XYZA_LEVEL_SYSTEM_HOST = 2 };

/* The content of a frame of one of the marks 0A, 0B, 0C. */
struct xyza_frame {
	uint8_t mark;
	uint8_t order;
	uint8_t level;
	uint8_t object;
	uint8_t item_class;
	uint8_t target;
	uint32_t value; /* mark 0B */
};

/* The frame's length, or XYZA_ERR_SPACE. */
int xyza_write_frame(const struct xyza_frame *content, uint8_t *frame, size_t size);
/* One whole frame; *content is filled in unless the result is XYZA_ERR_FORM. */
enum xyza_error xyza_read_frame(const uint8_t *frame, size_t length, struct xyza_frame *content);

/*
 * Cuts the next frame out of a stream: *skip bytes of garbage, then a frame of
 * *length bytes, or *length 0 when more is needed (at least a whole frame). Frames of all six marks
 * are cut, with right or wrong sums; one with a wrong sum in which another frame begins was cut
 * short on its way, and is garbage up to that.
 */
void xyza_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length);

/* A whole frame from a controller with a right checksum, whatever its content: its object; else
 * 0. */
uint8_t xyza_sender(const uint8_t *frame, size_t length);

/* For a frame that such a controller sent: the kind of its data, a different number for each; 0:
 * none. */
uint32_t xyza_part(const uint8_t *frame, size_t length);

#define XYZA_RAW_MAX (XYZA_FRAME_MAX - 3)

/*
 * Host to controller: a frame given from its mark to the byte before its checksum. Header and sum
 * are added, and an object of 0 becomes `object`. The frame's length, or FORM: not a host's mark,
 * or a wrong length; RANGE: for another object, or with a controller's level; SPACE.
 */
int xyza_encode_raw(const uint8_t *content, size_t length, uint8_t object, uint8_t *frame,
                    size_t size);

/*
 * True if this whole frame may answer that one: from its object, and neither an acknowledgement nor
 * data of another order. *failed: the controller did not accept it; *shows: it is more than an
 * acknowledgement.
 */
bool xyza_raw_fits(const uint8_t *request, const uint8_t *frame, size_t length, bool *failed,
                   bool *shows);

#endif
