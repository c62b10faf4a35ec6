/* SPDX-License-Identifier: Apache-2.0 */
/* The requests to an XYZA controller for one command or parameter, step by step. Internal to the
 * driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_PLAN_H
#define DRIVEBRIDGE_DRIVER_XYZA_PLAN_H

#include "driver/xyza/device.h"

/* The content of a reply as one number: the value, or a program's state, number << 8 and step <<
 * 16. */
uint32_t xyza_content(const struct xyza_reply *reply);

/* Fills in the steps of a command or a parameter write. `out_of_step`: the controller may receive
 * but cannot be understood. */
void xyza_plan_command(struct xyza_plan *plan, struct db_device *device,
                       const struct db_request *request, bool out_of_step);
void xyza_plan_setting(struct xyza_plan *plan, const struct db_device *device,
                       const struct db_setting *setting);

#endif
