/* SPDX-License-Identifier: Apache-2.0 */
/* The built-in families. A new one is a line here and a line in list.c. */
#ifndef DRIVEBRIDGE_DRIVER_LIST_H
#define DRIVEBRIDGE_DRIVER_LIST_H

#include "drivebridge/driver.h"

extern const struct db_driver db_driver_vsmd_serial;
extern const struct db_driver db_driver_vsmd_can;
extern const struct db_driver db_driver_xyza;
extern const struct db_driver db_driver_servo_can;

#endif
