/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is learnt about a drive's times from its answers: the silence that it needs between its
 * reply and the next request, and how long to wait for its answers. Both begin as configured, and
 * each stays within its own bounds. Pure: time is passed in. Internal to src/bridge/sched; one
 * thread.
 */
#ifndef DRIVEBRIDGE_SCHED_LEARN_H
#define DRIVEBRIDGE_SCHED_LEARN_H

#include "drivebridge/time.h"

#include <stdbool.h>

/* The largest values that gaps and lateness are learnt up to, unless more is configured. */
#define LEARN_GAP_MOST (8 * DB_NS_PER_MS)
#define LEARN_LATE_MOST (60 * DB_NS_PER_MS)

/*
 * A gap has two values. `now` is used for requests that may be repeated: it is lowered while the
 * drive is seen to receive, and a request lost because of it costs a repeat. `sure` is a gap at
 * which the drive received often enough in a row for requests that must not be lost; until that is
 * known it is the largest gap.
 */
struct learn_gap {
	int32_t begin; /* ns, as all of these: as configured */
	int32_t least; /* never below this */
	int32_t most;  /* never above this */
	int32_t now;
	int32_t sure;
	int32_t peak;       /* value up to which losses raised it last; begin: never */
	int32_t widest;     /* the longest pause among those received in a row */
	uint8_t received;   /* requests received at `now` since it changed; halved from time to time
	                   */
	uint8_t lost;       /* requests lost at `now`, counted the same way */
	uint8_t lost_later; /* requests lost although the pause was longer than any gap */
	uint8_t received_in_row;
	db_time lower_at;    /* not lowered before this time, ... */
	db_time lower_pause; /* ... and after a lowering that went wrong not for this time */
	db_time raise_at;    /* not raised before this time: raising it had not helped */
};

/* `adapt` false: the gap stays at `begin`, which is trusted. `least`: of the line, 3.5
 * characters. */
void learn_gap_init(struct learn_gap *gap, bool adapt, db_time begin, db_time least);

/* The drive received a request that followed its reply by `pause`. */
void learn_gap_received(struct learn_gap *gap, db_time pause, db_time now);

/* The effect of a loss. */
enum learnt {
	LEARNT_NOTHING,
	LEARNT_MORE,   /* larger than ever before */
	LEARNT_BACK,   /* it had been lowered too far */
	LEARNT_NO_USE, /* the largest gap does not help: learning begins again */
};
enum learnt learn_gap_lost(struct learn_gap *gap, db_time pause, db_time now);

/* True if a few more requests received at `now` would make the gap sure. */
bool learn_gap_wants_test(const struct learn_gap *gap);

struct learn_patience {
	int32_t begin; /* ns, as all of these: as configured */
	int32_t most;
	int32_t now;
	int32_t longest; /* the longest latency since `since`, ... */
	int32_t before;  /* ... and in the period before */
	uint32_t late;   /* number of recent answers that arrived later than it */
	db_time since;
	db_time late_at;
	db_time lower_at;
};

void learn_patience_init(struct learn_patience *patience, bool adapt, db_time begin);
/* An answer arrived in time. */
void learn_patience_answered(struct learn_patience *patience, db_time latency, db_time now);
/* An answer arrived after its time-out. True: the time-out is longer from now on. */
bool learn_patience_late(struct learn_patience *patience, db_time latency, db_time now);

#endif
