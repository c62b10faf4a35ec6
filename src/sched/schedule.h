/* SPDX-License-Identifier: Apache-2.0 */
/* What goes out next, by the classes that engine.h names. Bus thread only; internal to src/sched. */
#ifndef DRIVEBRIDGE_SCHED_SCHEDULE_H
#define DRIVEBRIDGE_SCHED_SCHEDULE_H

#include "sched/state.h"

/* Sends what is most urgent. False when nothing is to be sent now. */
bool schedule_send_next(struct db_engine *engine, db_time now);

#endif
