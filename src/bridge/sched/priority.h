/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The real-time priority of a bus's thread. Its work is short, so it may run before everything else
 * on the computer. A port that never falls silent would make it long: a thread that takes more than
 * half of a processor loses the priority until that is over; one that has not slept for a second of
 * processor time, and so may hang, loses it by a signal (SIGXCPU). Internal to src/bridge/sched;
 * the bus's thread only.
 */
#ifndef DRIVEBRIDGE_SCHED_PRIORITY_H
#define DRIVEBRIDGE_SCHED_PRIORITY_H

#include "drivebridge/time.h"

#include <stdbool.h>

enum priority_change {
	PRIORITY_AS_BEFORE,
	PRIORITY_GIVEN_UP, /* the thread takes too much time; the priority was removed */
	PRIORITY_LOST,     /* it did not sleep for a second, and the signal took the priority */
	PRIORITY_RESTORED  /* the priority was restored */
};

struct priority {
	unsigned wanted; /* of SCHED_FIFO; 0: none */
	bool held;
	db_time judged_at; /* time of the last judgement, */
	db_time used;      /* and the thread's processor time then */
};

/* Gives the priority to the calling thread, and limits how long the threads of this process have
 * one without sleeping. 0, or an errno: the thread then runs without it for good. */
int priority_begin(struct priority *priority, unsigned wanted, db_time now, db_time used);

/* True if it has to be judged again: twice a second. */
bool priority_is_due(const struct priority *priority, db_time now);
/* Judges by the processor time since the last judgement; `used` is the thread's total until now. */
enum priority_change priority_judge(struct priority *priority, db_time now, db_time used);

#endif
