/* SPDX-License-Identifier: Apache-2.0 */
/* The steps of all conversations with a servo drive: the part of the descriptor that communicates.
 * Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_STEPS_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_STEPS_H

#include "drivebridge/driver.h"

/* As in struct db_driver. */
enum db_step servo_can_begin(struct db_conversation *talk);
enum db_step servo_can_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length);
enum db_step servo_can_lose_answer(struct db_conversation *talk);
enum db_step servo_can_begun_by_all(struct db_conversation *talk);

#endif
