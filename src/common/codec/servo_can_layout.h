/* SPDX-License-Identifier: Apache-2.0 */
/* The frames of the document; those of a layout that the user describes, and whether these are
 * possible. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_SERVO_CAN_LAYOUT_H
#define DRIVEBRIDGE_CODEC_SERVO_CAN_LAYOUT_H

#include "codec/servo_can.h"

#define SERVO_CAN_SETPOINT_SPEED 0x01   /* first byte of the frame that speed ... */
#define SERVO_CAN_SETPOINT_CURRENT 0x02 /* ... and current share */

/* SYNC and ACK have their own id or length, and described frames have both: see the codec. */
struct servo_can_shape {
	uint16_t base;
	uint8_t length; /* number of meaningful data bytes */
	uint8_t ack;
	enum servo_can_side from;
	bool broadcast;
};

extern const struct servo_can_shape servo_can_shapes[SERVO_CAN_KIND_COUNT];

/* True for codes with a command of their own; false also for the four that are only explained on
 * missing pages. */
bool servo_can_ack_documented(uint8_t code);

#define SERVO_CAN_REASON_MAX 160

/* Frames of a layout that the user describes. */
enum servo_can_described {
	SERVO_CAN_DESCRIBED_ACK, /* acknowledgements */
	SERVO_CAN_DESCRIBED_WORDS,
	SERVO_CAN_DESCRIBED_WORD_1,
	SERVO_CAN_DESCRIBED_SLOT, /* the internal position's */
	SERVO_CAN_DESCRIBED_MOVE,
};

/*
 * Whether a layout can work: SERVO_CAN_OK, or SERVO_CAN_ERR_LAYOUT with `reason` a sentence for the
 * user and *which the frame that it is about. Refused: ids above 11 bits, words and numbers that
 * overlap or do not fit their frame, ids or an acknowledgement that belong to another frame. The
 * collision of one acknowledgement with sync and of one with the broadcast enable is printed and
 * passes: see servo_can_ack_collision.
 */
enum servo_can_error servo_can_layout_check(const struct servo_can_layout *layout,
                                            enum servo_can_described *which,
                                            char reason[SERVO_CAN_REASON_MAX]);

/* Fills in the bytes of the command words' frame that belong to neither word (length and places of
 * the words must be set) from one number, the last byte lowest. */
void servo_can_put_fixed(struct servo_can_words_layout *words, uint64_t fixed);
/* The same for a number's frame. */
void servo_can_put_number_fixed(struct servo_can_number_layout *number, uint64_t fixed);

/*
 * The frame for which every drive on the bus could mistake the node's acknowledgements:
 * SERVO_CAN_SYNC, SERVO_CAN_ENABLE (to all), or SERVO_CAN_FOREIGN when there is no such danger.
 */
enum servo_can_kind servo_can_ack_collision(const struct servo_can_layout *layout, uint8_t node);

/* For the codec itself: such a frame as used in the checks. */
struct servo_can_described_frame {
	enum servo_can_described which;
	const char *name;
	uint32_t base;
	uint8_t ack;
	bool has_subcode; /* byte 0 is fixed ... */
	uint8_t subcode;  /* ... and this */
};

#define SERVO_CAN_DESCRIBED_MAX 4

/* The frames that are defined; returns their number. */
size_t servo_can_list_described(const struct servo_can_layout *layout,
                                struct servo_can_described_frame list[SERVO_CAN_DESCRIBED_MAX]);

/* The kind of a frame with an id of this base, according to byte 0; else `kind`. */
enum servo_can_kind servo_can_find_described(const struct db_can_frame *frame,
                                             const struct servo_can_layout *layout,
                                             enum servo_can_kind kind, uint32_t base);

static inline bool servo_can_has_slot_frame(const struct servo_can_layout *layout)
{
	return layout->slot_base != 0;
}

#endif
