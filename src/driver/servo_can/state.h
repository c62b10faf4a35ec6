/* SPDX-License-Identifier: Apache-2.0 */
/* What the drive says: answers to reads, its own reports, and the feedback made of them. Internal to
 * the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_STATE_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_STATE_H

#include "driver/servo_can/device.h"

#define SERVO_CAN_ALL_PARTS \
	(SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_MOTION | SERVO_CAN_GIVES_STATUS)

bool servo_can_is_powered(const struct db_device *device);
bool servo_can_stands(const struct db_device *device);
/* No motion to be seen, and none under way: a blocked motor stands, too. */
bool servo_can_is_at_rest(const struct db_device *device);
/* As near to a position as counts as being there. */
bool servo_can_is_at(const struct db_device *device, int32_t position);
/* A fault was reported, or the status shows one. */
bool servo_can_has_fault(const struct db_device *device);
/* The status itself shows one: reports are older. */
bool servo_can_shows_fault(const struct db_device *device);

/* It was not given the profile's maximum speed since it is back. */
bool servo_can_lacks_max_speed(const struct db_device *device);

/* A frame of an answer to a read of `parts`. True when it was one; *complete: all are there, and are
 * taken. */
bool servo_can_take_part(struct db_device *device, unsigned sending, unsigned parts,
                         const struct servo_can_message *message, db_time now, bool *complete);
/* Its own reports come as often as the bridge would ask. */
bool servo_can_reports_come(const struct db_device *device, db_time now);
bool servo_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                           db_time now);
bool servo_can_wants_poll(const struct db_device *device, db_time now);
/* Its power went unasked: it may have been reset, so what it was told is not relied on any more. */
void servo_can_take_reset(struct db_device *device);
void servo_can_forget_state(struct db_device *device);
void servo_can_write_feedback(const struct db_device *device, struct db_feedback *feedback);

#endif
