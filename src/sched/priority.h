/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The real-time priority of a bus's thread. Its work is short, so it may come before everything else of
 * the computer. A port that never falls silent would make it long: a thread that takes more than
 * half of a processor does without, until that is over. Internal to src/sched; the bus's thread only.
 */
#ifndef DRIVEBRIDGE_SCHED_PRIORITY_H
#define DRIVEBRIDGE_SCHED_PRIORITY_H

#include "drivebridge/time.h"

#include <stdbool.h>

enum priority_news {
	PRIORITY_AS_BEFORE,
	PRIORITY_LENT,      /* it takes too much, and has none now */
	PRIORITY_TAKEN_BACK /* and here again */
};

struct priority {
	unsigned wanted; /* of SCHED_FIFO; 0: none */
	bool held;
	db_time judged_at; /* when this was last looked at, */
	db_time used;      /* and the processor time of the thread then */
};

/* Gives it to the calling thread. 0, or an errno: the thread goes on as it is, for good. */
int priority_begin(struct priority *priority, unsigned wanted, db_time now, db_time used);

/* Whether to judge it again: twice a second. */
bool priority_is_due(const struct priority *priority, db_time now);
/* By the thread's processor time since the last judgement: `used` is all of it until now. */
enum priority_news priority_judge(struct priority *priority, db_time now, db_time used);

#endif
