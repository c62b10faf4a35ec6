/* SPDX-License-Identifier: Apache-2.0 */
/* What a drive says: answers to reads of its status, and its own reports. Internal to the driver; bus
 * thread only. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_CAN_STATE_H
#define DRIVEBRIDGE_DRIVER_VSMD_CAN_STATE_H

#include "driver/vsmd/can_device.h"

/* What a command's read brought. */
void vsmd_can_take_look(struct db_device *device, db_time now);
/* What the cyclic read brought. */
void vsmd_can_take_poll(struct db_device *device, db_time now);

/* As in struct db_driver. */
bool vsmd_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                          db_time now);
bool vsmd_can_wants_poll(const struct db_device *device, db_time now);
void vsmd_can_forget_state(struct db_device *device);

#endif
