/* SPDX-License-Identifier: Apache-2.0 */
/* What is believed of a controller's axes, and the feedback made of it. Internal to the driver; bus thread
 * only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_STATE_H
#define DRIVEBRIDGE_DRIVER_XYZA_STATE_H

#include "driver/xyza/device.h"

/* Bits of drive_status, which the document does not have: made of what is read. The program's state
 * is a number in eight of them. */
#define STATUS_NEGATIVE 0
#define STATUS_STANDS 1
#define STATUS_PROGRAM 8

/* What program_state shows of a controller that does not tell it. */
#define PROGRAM_STATE_UNTOLD UINT16_MAX

/* The controller keeps silent about it, as far as was tried: what it told before does not count. */
bool xyza_is_passed_over(const struct xyza_part *part);

void xyza_take_program(struct db_device *first, const struct xyza_reply *reply);
/* It is not known: nothing of it stands in the way of anything. */
void xyza_forget_program(struct db_device *first);

/* What an item was read as. */
void xyza_learn_item(struct db_device *device, enum xyza_item item, uint32_t content);
/* A controller may not have it. */
void xyza_forget_item(struct db_device *device, enum xyza_item item);
/* After a reset nothing that is known of any axis counts. */
void xyza_forget_all(struct db_device *first);

/* Stopped, and can go on: another stop might end it. */
bool xyza_is_program_stopped(const struct db_device *first);

/* It was told to move: until it was seen to, it counts as moving. */
void xyza_note_started(struct db_device *device, bool negative);
/* It stands, whatever it was told before. */
void xyza_note_standing(struct db_device *device);
/* All axes were told to stop. */
void xyza_note_stopped(struct db_device *first);
/* Any axis may have been set in motion so lately by the program that it still says that it stands. */
void xyza_doubt_standing(struct db_device *first, db_time now);

/* As in struct db_driver. */
void xyza_write_feedback(const struct db_device *device, struct db_feedback *feedback);
void xyza_forget_state(struct db_device *device);

#endif
