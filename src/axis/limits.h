/* SPDX-License-Identifier: Apache-2.0 */
/* Limits of the configuration, checked before a command reaches the bus. Pure. */
#ifndef DRIVEBRIDGE_AXIS_LIMITS_H
#define DRIVEBRIDGE_AXIS_LIMITS_H

#include "drivebridge/command.h"
#include "drivebridge/config.h"
#include "drivebridge/limit.h"

/* What is known of the drive when a command comes. */
struct db_limit_facts {
	double counts;          /* drive units in the user's; 0: as configured */
	bool scale_open;        /* ... but the drive is to tell that, and has not yet */
	int32_t position;       /* drive units */
	bool has_preset;        /* preset_velocity is known */
	float preset_velocity;  /* what a move without a velocity runs at, as target_velocity */
	double velocity_counts; /* position units a second that target_velocity counts; 0: as 1 */
};

/*
 * The limit that the command would break, or NONE. A move or jog at a preset that is not known
 * breaks a limit of the velocity; while the scale is not known, whatever is limited breaks its
 * limit. A motion without a target (velocity, jog, current) breaks a limit of the position when the
 * drive is beyond it already and would go further; after its beginning db_supervise watches it.
 * What speed a current leads to nobody knows.
 */
enum db_limit db_limits_command(const struct db_drive_config *drive, enum db_command command,
                                const struct db_args *args, const struct db_limit_facts *facts);

/* Likewise for an acceleration, in position units per second squared. */
enum db_limit db_limits_acceleration(const struct db_drive_config *drive, double acceleration,
                                     const struct db_limit_facts *facts);

/* The largest target_velocity that max-velocity of the configuration allows, either way; NAN: there is no such limit,
 * or the scale is not known yet. */
double db_limits_max_velocity(const struct db_drive_config *drive,
                              const struct db_limit_facts *facts);

#endif
