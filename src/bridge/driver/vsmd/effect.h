/* SPDX-License-Identifier: Apache-2.0 */
/* Judges whether the readings after a command show that it had its effect. Internal to the driver;
 * pure. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_EFFECT_H
#define DRIVEBRIDGE_DRIVER_VSMD_EFFECT_H

#include "driver/vsmd/axis.h"

enum vsmd_effect {
	VSMD_EFFECT_SHOWN,  /* a change that this command explains, and no earlier one */
	VSMD_EFFECT_OPEN,   /* it moves as it should, but an older motion may be the cause */
	VSMD_EFFECT_ABSENT, /* nothing (yet) */
};

/* Judges the effect of the job's command by `last` and the earlier state. */
enum vsmd_effect vsmd_effect_of(const struct vsmd_axis *axis, const struct db_job *job);
/* True if it moved before the command and still moves, and only speed 0 was reported meanwhile. */
bool vsmd_tells_no_speed(const struct vsmd_axis *axis);
/* True if its effect, once seen, is complete. */
bool vsmd_shows_its_effect(const struct vsmd_link *link, enum db_command command);

#endif
