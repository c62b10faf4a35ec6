/* SPDX-License-Identifier: Apache-2.0 */
/* Whether what a drive tells behind a command shows that the command had its effect. Internal to the
 * driver; pure. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_EFFECT_H
#define DRIVEBRIDGE_DRIVER_VSMD_EFFECT_H

#include "driver/vsmd/axis.h"

enum vsmd_effect {
	VSMD_EFFECT_SHOWN,  /* something that this command explains, and nothing before it */
	VSMD_EFFECT_OPEN,   /* it moves as it should, but an older motion may be the cause */
	VSMD_EFFECT_ABSENT, /* nothing (yet) */
};

/* What `last` and what is known of the time before say about the effect of the job's command. */
enum vsmd_effect vsmd_effect_of(const struct vsmd_axis *axis, const struct db_job *job);
/* It moved before the command and moves still, and no speed but 0 was told of that. */
bool vsmd_tells_no_speed(const struct vsmd_axis *axis);
/* Whether its effect, once seen, is all of it. */
bool vsmd_shows_its_effect(const struct vsmd_link *link, enum db_command command);

#endif
