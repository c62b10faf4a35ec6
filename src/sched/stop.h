/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Stops: said ahead of everything, said again until the drive answers, and then until it is seen to
 * stop. What a drive that stops looks like is in braking.h. Bus thread only; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_STOP_H
#define DRIVEBRIDGE_SCHED_STOP_H

#include "sched/state.h"

/* Sends the most urgent stop, or reads a drive that is to be seen to stop. False when there is none. */
bool stop_send_next(struct db_engine *engine, db_time now);
/* When the station wants that, if nothing else is in its way. */
db_time stop_wake(const struct db_engine *engine, const struct station *station, db_time now);
/* The conversation of a stop came to its end. */
void stop_note_answered(struct db_engine *engine, struct station *station, enum db_result result,
                        db_time now);
/* The drive was read: does it stop? */
void stop_judge(struct db_engine *engine, struct station *station, db_time now);
/* It is to move again: whether it has stopped is of no interest any more. */
void stop_forget(struct station *station);

#endif
