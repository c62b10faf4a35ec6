/* SPDX-License-Identifier: Apache-2.0 */
/* Requests to a controller, as exchanges. Internal to the driver; bus thread only, except
 * xyza_write_raw(), which is pure. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_FRAMES_H
#define DRIVEBRIDGE_DRIVER_XYZA_FRAMES_H

#include "driver/conversation.h"
#include "driver/xyza/device.h"

enum db_step xyza_say(struct db_conversation *talk, struct xyza_request request, bool repeatable);
/* Sends it to the conversation's axis. */
enum db_step xyza_say_verb(struct db_conversation *talk, enum xyza_verb verb);

/* The new number that the controller is given; 0: none. */
unsigned xyza_new_number(const struct xyza_request *request);

/* A client's raw frame, raw_frame; its length, or negative: there is none. */
int xyza_write_raw(const struct db_args *args, uint8_t object, uint8_t *frame, size_t size);

/* The conversation of raw_frame. */
enum db_step xyza_begin_raw(struct db_conversation *talk);
enum db_step xyza_answer_raw(struct db_conversation *talk, const uint8_t *frame, size_t length);
enum db_step xyza_lose_raw(struct db_conversation *talk);

#endif
