/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Second answers to one question. If the content is the same, the frame was doubled on its way
 * (adapters that echo do that); if it differs, two drives have the same address, and neither can be
 * believed. Where a line doubles frames, the copy of an answer may arrive only after the next
 * question, followed by the answer to that question: this proves nothing, either. Pure; bus thread;
 * internal to src/bridge/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_DOUBLED_H
#define DRIVEBRIDGE_SCHED_DOUBLED_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* After a second answer nothing is certain for this time. */
#define DOUBLED_TIME (10 * DB_NS_PER_S)

#define DOUBLED_PARTS 8

struct doubled {
	/* The answers to the last question. */
	struct {
		uint32_t part;
		uint32_t content;
		bool copied; /* may be a copy of the answer to the previous question */
	} seen[DOUBLED_PARTS];
	unsigned seen_count; /* set to 0 with a question that may have been asked before */
	uint32_t previous;   /* hash of the previous answer, whatever it was */
	db_time last;        /* time of its last answer */
	db_time first;       /* time of the first second answer among those counted; 0: none */
	/* time of the last unsolicited frame; second answers prove nothing for a while after it */
	db_time unasked;
	db_time until; /* two drives are taken to answer until then; 0: never seen so far */
};

enum doubled_kind {
	DOUBLED_NOT,   /* the first of its part, or a frame that proves nothing */
	DOUBLED_SAME,  /* the same content again */
	DOUBLED_OTHER, /* content of another drive */
	DOUBLED_TWO,   /* content of another drive, and now it is certain that there are two */
};

/* A good frame was received from this address; `part` as in db_driver, not 0. `asked`: an answer is
 * awaited. */
enum doubled_kind doubled_judge(struct doubled *doubled, uint32_t part, const uint8_t *frame,
                                size_t length, bool asked, db_time now);

#endif
