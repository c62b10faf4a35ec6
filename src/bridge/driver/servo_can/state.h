/* SPDX-License-Identifier: Apache-2.0 */
/* Frames from the drive: answers to reads, its own reports, and the feedback made of them. Internal
 * to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_STATE_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_STATE_H

#include "driver/servo_can/device.h"

#define SERVO_CAN_ALL_PARTS \
	(SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_MOTION | SERVO_CAN_GIVES_STATUS)

bool servo_can_is_powered(const struct db_device *device);
bool servo_can_stands(const struct db_device *device);
/* True if no motion is seen, and none is in progress: a blocked motor stands, too. */
bool servo_can_is_at_rest(const struct db_device *device);
/* True if it is near enough to a position to count as there. */
bool servo_can_is_at(const struct db_device *device, int32_t position);
/* Converts a position of the drive to the bridge's counts, and back. */
int32_t servo_can_turn_position(const struct db_device *device, int32_t position);
/* True if a fault was reported, or the status shows one. */
bool servo_can_has_fault(const struct db_device *device);
/* True if the status itself shows a fault: reports are older. */
bool servo_can_shows_fault(const struct db_device *device);

/* True if it was not sent the profile's maximum speed since it is back. */
bool servo_can_lacks_max_speed(const struct db_device *device);

/* Takes a frame of an answer to a read of `parts`. True when it was one; *complete: all parts have
 * arrived and were taken. */
bool servo_can_take_part(struct db_device *device, unsigned sending, unsigned parts,
                         const struct servo_can_message *message, db_time now, bool *complete);
/* True if its own reports arrive as often as the bridge would ask. */
bool servo_can_reports_come(const struct db_device *device, db_time now);
bool servo_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                           db_time now);
bool servo_can_wants_poll(const struct db_device *device, db_time now);
/* Its power was lost unasked: it may have been reset, so earlier settings are not relied on any
 * more. */
void servo_can_take_reset(struct db_device *device);
void servo_can_forget_state(struct db_device *device);
void servo_can_write_feedback(const struct db_device *device, struct db_feedback *feedback);

#endif
