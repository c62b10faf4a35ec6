/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Detects a held key from the terminal's repeats: a terminal repeats held keys and does not report
 * their release. Pure.
 */
#ifndef DRIVEBRIDGE_CTL_HOLD_H
#define DRIVEBRIDGE_CTL_HOLD_H

#include "drivebridge/time.h"

#include <stdbool.h>

/* Without a repeat for this long the key counts as released. Terminals repeat after 25 to 50 ms. */
#define DB_CTL_HOLD (250 * DB_NS_PER_MS)

struct db_ctl_hold {
	int direction; /* of the held key: -1, 0 or 1 */
	db_time until; /* when it stops counting as held */
	/* no motion until its release: another direction, a refusal or another key ended it */
	bool ended;
};

void db_ctl_hold_press(struct db_ctl_hold *hold, int direction, db_time now);

/* No motion until all keys have been released. */
void db_ctl_hold_cancel(struct db_ctl_hold *hold);

/* The direction to move now: -1, 0 or 1. */
int db_ctl_hold_direction(struct db_ctl_hold *hold, db_time now);

#endif
