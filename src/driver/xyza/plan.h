/* SPDX-License-Identifier: Apache-2.0 */
/* What an XYZA controller is asked for one command or parameter, step by step. Internal to the driver; bus
 * thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_PLAN_H
#define DRIVEBRIDGE_DRIVER_XYZA_PLAN_H

#include "driver/xyza/device.h"

bool xyza_is_jog(enum db_command command);

/* What a reply tells as one number: the value, or a program's state, number << 8 and step << 16. */
uint32_t xyza_content(const struct xyza_reply *reply);

/* Fills in what a command, or a parameter write, consists of. `out_of_step`: the controller may hear and not be heard. */
void xyza_plan_command(struct xyza_plan *plan, struct db_device *device,
                       const struct db_request *request, bool out_of_step);
void xyza_plan_setting(struct xyza_plan *plan, const struct db_device *device,
                       const struct db_setting *setting);

#endif
