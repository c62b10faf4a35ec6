/* SPDX-License-Identifier: Apache-2.0 */
/* Frames from a drive: answers to reads of its status, and its own reports. Internal to the driver;
 * bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_CAN_STATE_H
#define DRIVEBRIDGE_DRIVER_VSMD_CAN_STATE_H

#include "driver/vsmd/can_device.h"

/* Takes the answer to a command's read. */
void vsmd_can_take_look(struct db_device *device, db_time now);
/* Takes the answer to the cyclic read. */
void vsmd_can_take_poll(struct db_device *device, db_time now);

/* As in struct db_driver. */
bool vsmd_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                          db_time now);
bool vsmd_can_wants_poll(const struct db_device *device, db_time now);
void vsmd_can_forget_state(struct db_device *device);

#endif
