/* SPDX-License-Identifier: Apache-2.0 */
/* The frames of the document. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_SERVO_CAN_SHAPES_H
#define DRIVEBRIDGE_CODEC_SERVO_CAN_SHAPES_H

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

/* True if a documented frame has an id from first to last, both included. */
bool servo_can_is_documented(uint32_t first, uint32_t last);

#endif
