/* SPDX-License-Identifier: Apache-2.0 */
/* Frames of servo drives on CAN in words. Pure; any thread. */
#ifndef DRIVEBRIDGE_CODEC_SERVO_CAN_DESCRIBE_H
#define DRIVEBRIDGE_CODEC_SERVO_CAN_DESCRIBE_H

#include "codec/description.h"
#include "codec/servo_can.h"

void servo_can_describe(const struct db_can_frame *frame, const struct servo_can_layout *layout,
                        enum servo_can_side from, struct db_description *description);

#endif
