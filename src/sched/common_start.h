/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Common starts: commands of one group whose motions begin on all drives of the bus with one frame
 * (group-start = broadcast). Bus thread only; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_COMMON_START_H
#define DRIVEBRIDGE_SCHED_COMMON_START_H

#include "sched/state.h"

/* The drive's next frame begins a motion that may begin on all drives at once: it is held until then. */
bool common_start_holds(const struct station *station);
/* Begins one for which all are ready. *wait: nothing else is to be sent now. True: something was sent. */
bool common_start_try(struct db_engine *engine, bool *wait, db_time now);
/* When somebody has waited long enough for others; DB_TIME_NEVER. */
db_time common_start_wake(const struct db_engine *engine, db_time now);

#endif
