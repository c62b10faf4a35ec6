/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The motions that the drive was told to make: one with an end is followed to that, one without is
 * stopped before it passes a limit of the position, and who began one is told when another command
 * ends it. Network thread only.
 */
#ifndef DRIVEBRIDGE_AXIS_MOTION_H
#define DRIVEBRIDGE_AXIS_MOTION_H

#include "axis/pending.h"
#include "axis/writers.h"

/*
 * What was just handed to the bus, by this writer or (null) none: a stop ends what moves, and what
 * is still to begin, in any case. Another motion does so only when the drive takes it: until then
 * nobody knows.
 */
void db_motion_note_submitted(struct db_commander *commander, struct db_writer *writer,
                              enum db_command command, db_time now);

/* What became of it. */
void db_motion_note_ended(struct db_commander *commander, const struct db_slot *slot,
                          enum db_result result, db_time now);

/* A motion without an end goes on, or is asked for, and is to be kept within the limits. */
void db_motion_supervise(struct db_commander *commander, enum db_command command, db_time now);

/* Looks at what goes on, if it is time. */
void db_motion_check(struct db_commander *commander, db_time now);
/* When that is due; DB_TIME_NEVER. */
db_time db_motion_deadline(const struct db_commander *commander);

/* How often a motion on this bus is looked at. */
db_time db_motion_check_interval(const struct db_bus_config *bus);

/* A stop came then: no motion that came before it begins any more. */
void db_motion_note_stop(struct db_commander *commander, db_time arrived);

#endif
