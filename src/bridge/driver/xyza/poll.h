/* SPDX-License-Identifier: Apache-2.0 */
/* The cyclic reading of a controller, for all its axes. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_POLL_H
#define DRIVEBRIDGE_DRIVER_XYZA_POLL_H

#include "driver/conversation.h"

extern const struct conversation_step xyza_poll_steps[];

/* The device is the controller's first axis. */
enum db_step xyza_begin_poll(struct db_conversation *talk);

#endif
