/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One address of a scan: what it is asked next, and what its answers say of who is there. Pure. Internal to
 * src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_VISIT_H
#define DRIVEBRIDGE_SCHED_VISIT_H

#include "drivebridge/scan.h"

struct visit {
	struct db_scan_find find; /* its verdict and mean are visit_end()'s */
	enum db_inquiry_kind set_up;
	unsigned value;
	unsigned axes;       /* whose standing is asked, of a controller; at least 1 */
	unsigned asked;      /* questions whether somebody is there */
	unsigned identities; /* questions who */
	unsigned standings;
	unsigned standing_tries;
	bool told; /* what the drive is set up with */
	uint64_t time_sum_us;
	enum db_scan_end end; /* of setting it up */
};

/* What came of one question. */
struct visit_outcome {
	bool answered;    /* a whole, good answer came */
	bool doubled;     /* and another one, or a part of that */
	bool garbled;     /* bytes came that are neither */
	uint32_t time_us; /* of the whole answer */
	struct db_inquired said;
};

/* `set_up`: THERE looks only. */
void visit_begin(struct visit *visit, const struct db_driver *driver, unsigned speed,
                 unsigned address, enum db_inquiry_kind set_up, unsigned value);

/* The next question. False: there is none, and the visit is over. */
bool visit_next(const struct visit *visit, struct db_inquiry *inquiry);
/* What came of it, or that the family has no such question (null). */
void visit_take(struct visit *visit, const struct db_inquiry *inquiry,
                const struct visit_outcome *outcome);

/* It was told something that may have set it going since it was asked whether it stands. */
void visit_ask_standing_again(struct visit *visit);

/* Whether somebody was heard. Then the find is complete. */
bool visit_end(struct visit *visit);

#endif
