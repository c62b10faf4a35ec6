/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a drive does when its clients fall silent: the watchdog's stop, until the drive has
 * confirmed it, and the latch behind it. Network thread only.
 */
#ifndef DRIVEBRIDGE_AXIS_REACTION_H
#define DRIVEBRIDGE_AXIS_REACTION_H

#include "drivebridge/commander.h"

/* What is due: the stop, again if it has to be, and the first look at a drive. Whether the watchdog
 * tripped now. */
bool db_reaction_run(struct db_commander *commander, db_time now);
/* When that is; DB_TIME_NEVER. */
db_time db_reaction_deadline(const struct db_commander *commander);

/* The watchdog's stop ended. One that the drive turned down is repeated until it is taken. */
void db_reaction_note_ended(struct db_commander *commander, enum db_result result, db_time now);

/* Ends the latch. What moves all the same is watched again. */
void db_reaction_unlatch(struct db_commander *commander, db_time now);

#endif
