/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Stops on the bus: what the records of drives that must stand (standing.h) want sent and read, ahead of everything
 * else. Drives take turns, one exchange each: a drive that loses answers does not keep another drive's stop from the
 * wire. Bus thread only; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_STOP_H
#define DRIVEBRIDGE_SCHED_STOP_H

#include "sched/state.h"

/* Sends the most urgent stop, or reads a drive that must stand. False when there is none. */
bool stop_send_next(struct db_engine *engine, db_time now);
/* When the station wants that, if nothing else is in its way. */
db_time stop_wake(const struct db_engine *engine, const struct station *station, db_time now);
/* No drive has a stop that was never sent. */
bool stop_all_are_sent(const struct db_engine *engine);
/* The conversation of a stop came to its end. */
void stop_note_answered(struct db_engine *engine, struct station *station, enum db_result result,
                        db_time now);
/* Something that was sent to this node was not answered, which has cost so much of the wire. `stop`: it was one. */
void stop_note_lost(struct db_engine *engine, struct node *node, bool stop, db_time cost,
                    db_time now);
/* The drive was read; the question left at `asked`. */
void stop_judge(struct db_engine *engine, struct station *station, db_time asked, db_time now);
/* A later motion begins: the drive is told nothing else until that has ended. */
void stop_yield(struct station *station);

#endif
