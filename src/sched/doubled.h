/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Second answers to one question. With the same content a frame was doubled on its way (echoing adapters do that), with
 * another one two drives have one address: then neither can be believed. Pure; bus thread; internal to src/sched.
 */
#ifndef DRIVEBRIDGE_SCHED_DOUBLED_H
#define DRIVEBRIDGE_SCHED_DOUBLED_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* So long nothing is certain after a second answer. */
#define DOUBLED_TIME (10 * DB_NS_PER_S)

#define DOUBLED_PARTS 8

struct doubled {
	/* What was answered since then. */
	struct {
		uint32_t part;
		uint32_t content;
	} seen[DOUBLED_PARTS];
	unsigned seen_count;
	db_time last;  /* when its last answer came */
	db_time first; /* the first second answer of those counted; 0: none */
	db_time unasked; /* it sent something that nobody had asked for: second answers show nothing then */
	db_time until; /* two drives answer, as far as is known; 0: never so far */
};

enum doubled_kind {
	DOUBLED_NOT,   /* the first of its part, or one that shows nothing */
	DOUBLED_SAME,  /* the same again */
	DOUBLED_OTHER, /* of another drive */
	DOUBLED_TWO,   /* likewise, and now it is known that there are two */
};

/* It is asked something that may have been asked before. */
void doubled_begin(struct doubled *doubled);
/* A good frame came from there: part as db_driver has it, not 0. `asked`: an answer is waited for. */
enum doubled_kind doubled_take(struct doubled *doubled, uint32_t part, const uint8_t *frame,
                               size_t length, bool asked, db_time now);

#endif
