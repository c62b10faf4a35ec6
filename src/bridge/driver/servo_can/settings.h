/* SPDX-License-Identifier: Apache-2.0 */
/* Parameters, and the profile of the configuration. Internal to the driver; bus thread only, except
 * servo_can_check_param(), which is pure. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_SETTINGS_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_SETTINGS_H

#include "driver/servo_can/device.h"

extern const struct db_param servo_can_params[SERVO_CAN_PARAM_COUNT];

enum db_result servo_can_check_param(const struct db_bus_config *bus, size_t param,
                                     union db_value value);

/* The drive has this value now. */
void servo_can_remember(struct db_device *device, enum servo_can_param param, double value,
                        db_time now);
/* Shows the held words as parameters. */
void servo_can_remember_words(struct db_device *device, db_time now);
/* The drive's values of these are no longer known. */
void servo_can_forget_settings(struct db_device *device, const struct db_request *request);

/* Each sends the next frame of its conversation, or ends it. */
enum db_step servo_can_continue_settings(struct db_conversation *talk);
enum db_step servo_can_continue_identify(struct db_conversation *talk);

/* Called before its motor gets power: sends all values, also those that it should have already,
 * because it may have been reset since. False: all were sent. */
bool servo_can_says_all(struct db_conversation *talk, enum db_step *step);

/* Sends those values of the profile that the drive does not have and may be given now. False:
 * none. */
bool servo_can_says_profile(struct db_conversation *talk, enum db_step *step);

#endif
