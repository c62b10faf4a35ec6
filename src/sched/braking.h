/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether a drive that was told to stop does: a stop is done when the drive stands, or is seen to slow
 * down towards that. An acknowledgement proves only that the request arrived. Pure: what was read and
 * the time are handed in. Internal to src/sched; bus thread only.
 *
 * What must be read is how fast the drive is, not how fast it should slow down: deceleration may be
 * seconds long, by the drive's ramps, and is no failure as long as it goes on.
 */
#ifndef DRIVEBRIDGE_SCHED_BRAKING_H
#define DRIVEBRIDGE_SCHED_BRAKING_H

#include "drivebridge/axis.h"
#include "drivebridge/command.h"

#include <stdbool.h>

struct braking {
	bool active;        /* a drive that was told to stop was not seen to stand yet */
	bool slows;         /* it was seen to slow down: who asked for the stop was answered */
	bool overdue;       /* it was not, for longer than it may take */
	bool looked;        /* the drive was read since the stop was said last */
	db_time begun;      /* when the drive first answered a stop, or was found to ignore it */
	db_time progress;   /* when it was last seen slower than ever before */
	float top_speed;    /* fastest since then; drive units per second, without direction */
	float least_speed;  /* slowest since it was fastest */
	db_time still_from; /* when it was first seen standing, in a row; 0: it moves */
	db_time again_at;   /* when the stop is said again, once it was */
	db_time look_at;    /* when the drive is read again, beside the cycle */
};

/* What becomes of it. */
enum braking_verdict {
	BRAKING_STANDS,
	BRAKING_SLOWS,
	BRAKING_UNSEEN, /* nothing to be seen yet */
	BRAKING_FAILS,  /* and it should have been */
};

/* Since when it was told to stop, for a drive that was not yet. What was read before counts for how
 * fast it was. */
void braking_begin(struct braking *braking, const struct db_feedback *before, db_time now);

/*
 * Looks at what was read after the stop. `patience`: how long it may go on without slowing down.
 * `doubt`: how long it must be seen to stand, where it may have been told to move just before the stop
 * and not have begun; 0 where its answer rules that out.
 */
enum braking_verdict braking_judge(struct braking *braking, const struct db_feedback *feedback,
                                   db_time patience, db_time doubt, db_time now);

/* The drive was away: it is told again, and has its time anew. */
void braking_resume(struct braking *braking, db_time now);

/* The stop was said: when to look, and when to say it again. */
void braking_said(struct braking *braking, db_time now);

#endif
