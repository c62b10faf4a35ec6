/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drive units to the user's: one scale, for what is shown and for the limits. The configuration's
 * counts-per-unit takes precedence; without it, what the drive reports of its mechanics. Pure.
 */
#ifndef DRIVEBRIDGE_SCALE_H
#define DRIVEBRIDGE_SCALE_H

#include "drivebridge/axis.h"
#include "drivebridge/config.h"
#include "drivebridge/driver.h"

/* Counts per unit; 1 until the drive has reported it. */
double db_scale_counts(const struct db_drive_config *drive, const struct db_feedback *feedback);

/* True if the drive is to report it, and has not yet: nothing can be compared with a limit. */
bool db_scale_is_open(const struct db_driver *driver, const struct db_drive_config *drive,
                      const struct db_feedback *feedback);

/* The name of the unit. */
const char *db_scale_unit(const struct db_driver *driver, const struct db_drive_config *drive);

#endif
