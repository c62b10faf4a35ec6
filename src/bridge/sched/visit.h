/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One address of a scan: which question is next, and what its answers show about the drive there.
 * Pure. Internal to src/bridge/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_VISIT_H
#define DRIVEBRIDGE_SCHED_VISIT_H

#include "drivebridge/scan.h"

struct visit {
	struct db_scan_find find; /* its verdict and mean are set by visit_end() */
	enum db_inquiry_kind set_up;
	unsigned value;
	unsigned axes;  /* axes of a controller that are asked whether they stand; at least 1 */
	unsigned asked; /* number of questions whether a drive is there */
	unsigned identities; /* number of questions for the identity */
	/* number of unanswered questions whether a drive is there, before the first answer ... */
	unsigned unanswered;
	unsigned unidentified; /* ... and for the identity, before the first answer */
	bool identified;
	/* number of axes that stand, and of questions to the next one; both begin again when
	 * something was sent that may have started a motion */
	unsigned standings;
	unsigned standing_tries;
	uint64_t time_sum_us;
	enum db_scan_end end; /* result of the setting */
};

/* The result of one question. */
struct visit_outcome {
	bool answered;    /* a complete, good answer was received */
	bool doubled;     /* and another answer, or a part of one */
	bool garbled;     /* bytes were received that are neither */
	uint32_t time_us; /* duration of the whole answer */
	struct db_inquired said;
};

/* `set_up`: THERE only looks. */
void visit_begin(struct visit *visit, const struct db_driver *driver, unsigned speed,
                 unsigned address, enum db_inquiry_kind set_up, unsigned value);

/* The next question. False: there is none, and the visit is over. */
bool visit_next(const struct visit *visit, struct db_inquiry *inquiry);
/* The result, or null if the family has no such question. */
void visit_add_outcome(struct visit *visit, const struct db_inquiry *inquiry,
                       const struct visit_outcome *outcome);

/* True if a drive answered. The find is complete then. */
bool visit_end(struct visit *visit);

#endif
