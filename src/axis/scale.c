/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/scale.h"

double db_scale_counts(const struct db_drive_config *drive, const struct db_feedback *feedback)
{
	if (!drive->counts_given && feedback->counts_per_unit > 0.0f)
		return (double)feedback->counts_per_unit;
	return drive->counts_per_unit;
}

bool db_scale_is_open(const struct db_driver *driver, const struct db_drive_config *drive,
                      const struct db_feedback *feedback)
{
	return driver->scale_unit && !drive->counts_given && !(feedback->counts_per_unit > 0.0f);
}

const char *db_scale_unit(const struct db_driver *driver, const struct db_drive_config *drive)
{
	return driver->scale_unit && !drive->counts_given && !drive->unit_given ?
	               driver->scale_unit :
	               drive->unit_name;
}
