/* SPDX-License-Identifier: Apache-2.0 */
/* Reading all parameters, item by item. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_ITEMS_H
#define DRIVEBRIDGE_DRIVER_XYZA_ITEMS_H

#include "driver/conversation.h"

extern const struct conversation_step xyza_item_steps[];

enum db_step xyza_begin_items(struct db_conversation *talk);

#endif
