/* SPDX-License-Identifier: Apache-2.0 */
/* The conversations with an XYZA controller. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_STEPS_H
#define DRIVEBRIDGE_DRIVER_XYZA_STEPS_H

#include "drivebridge/driver.h"

/* As in struct db_driver. */
enum db_step xyza_begin(struct db_conversation *talk);
enum db_step xyza_answer(struct db_conversation *talk, const uint8_t *frame, size_t length);
enum db_step xyza_lose_answer(struct db_conversation *talk);

#endif
