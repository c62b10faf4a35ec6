/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/servo_can_shapes.h"

const struct servo_can_shape servo_can_shapes[SERVO_CAN_KIND_COUNT] = {
	[SERVO_CAN_SYNC] = { SERVO_CAN_ID_SYNC, 0, 0, SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_ENABLE] = { SERVO_CAN_BASE_ENABLE, 2, SERVO_CAN_ACK_ENABLE, SERVO_CAN_FROM_HOST,
	                       true },
	[SERVO_CAN_MODE] = { SERVO_CAN_BASE_MODE, 5, SERVO_CAN_ACK_MODE, SERVO_CAN_FROM_HOST,
	                     false },
	[SERVO_CAN_SPEED] = { SERVO_CAN_BASE_SETPOINT, 3, SERVO_CAN_ACK_SPEED, SERVO_CAN_FROM_HOST,
	                      true },
	[SERVO_CAN_CURRENT] = { SERVO_CAN_BASE_SETPOINT, 3, SERVO_CAN_ACK_CURRENT,
	                        SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_POSITION] = { SERVO_CAN_BASE_POSITION, 4, SERVO_CAN_ACK_POSITION,
	                         SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_SET_FEEDBACK] = { SERVO_CAN_BASE_SET_FEEDBACK, 4, SERVO_CAN_ACK_SET_FEEDBACK,
	                             SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_RAMPS] = { SERVO_CAN_BASE_RAMPS, 8, SERVO_CAN_ACK_RAMPS, SERVO_CAN_FROM_HOST,
	                      false },
	[SERVO_CAN_READ] = { SERVO_CAN_BASE_READ, 1, 0, SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_WORDS] = { 0, 0, 0, SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_WORD_1] = { 0, 0, 0, SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_MOVE] = { 0, 0, 0, SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_ACK] = { 0, 0, 0, SERVO_CAN_FROM_DRIVE, false },
	[SERVO_CAN_ANSWER_POSITION] = { SERVO_CAN_BASE_ANSWER_POSITION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                                false },
	[SERVO_CAN_ANSWER_MOTION] = { SERVO_CAN_BASE_ANSWER_MOTION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
	[SERVO_CAN_ANSWER_STATUS] = { SERVO_CAN_BASE_ANSWER_STATUS, 4, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
	[SERVO_CAN_ANSWER_ANALOGUE] = { SERVO_CAN_BASE_ANSWER_ANALOGUE, 2, 0, SERVO_CAN_FROM_DRIVE,
	                                false },
	[SERVO_CAN_REPORT_POSITION] = { SERVO_CAN_BASE_REPORT_POSITION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                                false },
	[SERVO_CAN_REPORT_MOTION] = { SERVO_CAN_BASE_REPORT_MOTION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
	[SERVO_CAN_REPORT_HEALTH] = { SERVO_CAN_BASE_REPORT_HEALTH, 6, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
};

bool servo_can_ack_documented(uint8_t code)
{
	for (int kind = SERVO_CAN_SYNC; kind < SERVO_CAN_KIND_COUNT; kind++) {
		if (servo_can_shapes[kind].ack == code)
			return code != SERVO_CAN_ACK_NONE;
	}
	return false;
}

bool servo_can_is_documented(uint32_t first, uint32_t last)
{
	for (int kind = SERVO_CAN_SYNC; kind < SERVO_CAN_KIND_COUNT; kind++) {
		uint32_t base = servo_can_shapes[kind].base;
		uint32_t end = kind == SERVO_CAN_SYNC ? base : base + SERVO_CAN_NODE_MAX;

		if (base != 0 && first <= end && last >= base)
			return true;
	}
	return false;
}
