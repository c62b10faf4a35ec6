/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Items that are read again while a controller is in service: anybody may change them at its keys, and a
 * short loss of its power may. `first` is the controller's first device. Internal to the driver; bus
 * thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_TURN_H
#define DRIVEBRIDGE_DRIVER_XYZA_TURN_H

#include "driver/xyza/device.h"

/* All axes were read once more: whether an item is to follow. Then xyza_turn_request() asks for it. */
bool xyza_turn_comes(struct db_device *first, db_time now);
struct xyza_request xyza_turn_request(const struct db_device *first);

/* What came of it. What keeps silent, or is refused, is read anew with all other items. */
void xyza_turn_answered(struct db_device *first, uint32_t content);
void xyza_turn_lost(struct db_device *first);
void xyza_turn_refused(struct db_device *first);

#endif
