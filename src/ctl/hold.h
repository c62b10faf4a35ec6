/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether a key is held, as far as a terminal tells: it repeats keys that are held and says nothing when they are
 * released. Pure.
 */
#ifndef DRIVEBRIDGE_CTL_HOLD_H
#define DRIVEBRIDGE_CTL_HOLD_H

#include "drivebridge/time.h"

#include <stdbool.h>

/* A key that stays away for this long is released. Terminals repeat after 25 to 50 ms. */
#define DB_CTL_HOLD (250 * DB_NS_PER_MS)

struct db_ctl_hold {
	int direction; /* of the key that is held: -1, 0 or 1 */
	db_time until; /* it counts as held */
	bool ended; /* until it is released: another direction, a refusal or another key ended it */
};

void db_ctl_hold_press(struct db_ctl_hold *hold, int direction, db_time now);

/* Nothing moves before all keys have been released. */
void db_ctl_hold_cancel(struct db_ctl_hold *hold);

/* Where to move now: -1, 0 or 1. */
int db_ctl_hold_direction(struct db_ctl_hold *hold, db_time now);

#endif
