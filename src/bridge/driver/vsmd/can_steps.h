/* SPDX-License-Identifier: Apache-2.0 */
/* The conversations with a VSMD drive on CAN. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_CAN_STEPS_H
#define DRIVEBRIDGE_DRIVER_VSMD_CAN_STEPS_H

#include "driver/vsmd/can_device.h"

/* How CAN carries commands. */
extern const struct vsmd_link vsmd_can_link;

/* As in struct db_driver. */
enum db_step vsmd_can_begin(struct db_conversation *talk);
enum db_step vsmd_can_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length);
enum db_step vsmd_can_lose_answer(struct db_conversation *talk);

#endif
