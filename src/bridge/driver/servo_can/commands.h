/* SPDX-License-Identifier: Apache-2.0 */
/* Commands and the reaction to a fault: chooses the next frame. Internal to the driver; bus thread
 * only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_COMMANDS_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_COMMANDS_H

#include "drivebridge/driver.h"

/* Each sends the next frame of its conversation, or ends it. */
enum db_step servo_can_continue_command(struct db_conversation *talk);
/* See db_driver.interrupt. */
bool servo_can_write_interrupt(struct db_device *device, enum db_command command,
                               struct db_exchange *exchange);
enum db_step servo_can_continue_poll(struct db_conversation *talk);

#endif
