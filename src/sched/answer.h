/* SPDX-License-Identifier: Apache-2.0 */
/* Frames from the wire, and answers that do not come. Bus thread only; internal to src/sched. */
#ifndef DRIVEBRIDGE_SCHED_ANSWER_H
#define DRIVEBRIDGE_SCHED_ANSWER_H

#include "sched/state.h"

/* A frame came that the driver has cut out of the stream. Sends nothing. */
void answer_take_frame(struct db_engine *engine, const uint8_t *frame, size_t length, db_time now);
/* What the node is asked was not answered in time. */
void answer_lost(struct db_engine *engine, struct node *node, db_time now);

#endif
