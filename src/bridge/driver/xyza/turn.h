/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Items that are read again while a controller is in service: they may be changed at its keys, or
 * by a short loss of its power. `first` is the controller's first device. Internal to the driver;
 * bus thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_TURN_H
#define DRIVEBRIDGE_DRIVER_XYZA_TURN_H

#include "driver/xyza/device.h"

/* True if an item is to follow now that all axes were read. Then xyza_turn_request() reads it. */
bool xyza_turn_comes(struct db_device *first, db_time now);
struct xyza_request xyza_turn_request(const struct db_device *first);

/* The item was answered. If it is not answered, or refused, it is read again with all other
 * items. */
void xyza_turn_answered(struct db_device *first, uint32_t content, db_time now);
void xyza_turn_lost(struct db_device *first);
void xyza_turn_refused(struct db_device *first);

#endif
