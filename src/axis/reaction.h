/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a drive does when clients are missed: the stop by the watchdog when all of them fall silent, with the latch
 * after it, and by the end of a hold when the holder of a motion is gone. The bus goes on with the stop until the drive
 * stands. Network thread only.
 */
#ifndef DRIVEBRIDGE_AXIS_REACTION_H
#define DRIVEBRIDGE_AXIS_REACTION_H

#include "drivebridge/commander.h"

/* What is due: the stop, again if it has to be, and the first look at a drive. Whether the watchdog
 * tripped now. */
bool db_reaction_run(struct db_commander *commander, db_time now);
/* Of that, what ends a hold: before anything that its holder asks for later. */
void db_reaction_check_hold(struct db_commander *commander, db_time now);
/* The drive is told to stop for this cause. */
void db_reaction_stand(struct db_commander *commander, enum db_command command,
                       enum db_stand_cause cause, db_time now);
/* When the former is due; DB_TIME_NEVER. */
db_time db_reaction_deadline(const struct db_commander *commander);

/* The stop that ended a hold and found no room is not sent any more: a motion was admitted after it. */
void db_reaction_forget_hold(struct db_commander *commander);

/* Ends the latch. What moves all the same is watched again. */
void db_reaction_unlatch(struct db_commander *commander, db_time now);

#endif
