/* SPDX-License-Identifier: Apache-2.0 */
/* Commands and the reaction to a fault: which frame is next. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_COMMANDS_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_COMMANDS_H

#include "drivebridge/driver.h"

/* Each says the next frame of its conversation, or ends it. */
enum db_step servo_can_continue_command(struct db_conversation *talk);
enum db_step servo_can_continue_poll(struct db_conversation *talk);

#endif
