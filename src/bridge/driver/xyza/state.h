/* SPDX-License-Identifier: Apache-2.0 */
/* The assumed state of a controller's axes, and the feedback made of it. Internal to the driver;
 * bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_STATE_H
#define DRIVEBRIDGE_DRIVER_XYZA_STATE_H

#include "driver/xyza/device.h"

/* Bits of drive_status, which are not in the document: made from readings. The program's state is a
 * number in eight of them. */
#define STATUS_NEGATIVE 0
#define STATUS_STANDS 1
#define STATUS_PROGRAM 8

/* program_state of a controller that does not report it. */
#define PROGRAM_STATE_UNTOLD UINT16_MAX

/* True if the controller does not answer for it, as far as tried: earlier values do not count. */
bool xyza_is_passed_over(const struct xyza_part *part);

void xyza_take_program(struct db_device *first, const struct xyza_reply *reply);
/* The program's state is not known: it prevents nothing. */
void xyza_forget_program(struct db_device *first);

/* Takes the value that was read for an item. */
void xyza_learn_item(struct db_device *device, enum xyza_item item, uint32_t content, db_time now);
/* A controller may not have the item. */
void xyza_forget_item(struct db_device *device, enum xyza_item item);
/* After a reset nothing known of any axis is valid. */
void xyza_forget_all(struct db_device *first);

/* True if it is stopped and can continue: another stop might end it. */
bool xyza_is_program_stopped(const struct db_device *first);

/* A motion was started: the axis counts as moving until it was seen to move. */
void xyza_note_started(struct db_device *device, bool negative);
/* It stands, whatever was sent before. */
void xyza_note_standing(struct db_device *device);
/* All axes were sent a stop. */
void xyza_note_stopped(struct db_device *first);
/* The program may have started any axis so recently that it still reports standing. */
void xyza_doubt_standing(struct db_device *first, db_time now);

/* As in struct db_driver. */
void xyza_write_feedback(const struct db_device *device, struct db_feedback *feedback);
void xyza_forget_state(struct db_device *device);

#endif
