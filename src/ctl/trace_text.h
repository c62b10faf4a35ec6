/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records of a trace (objects of the interface's type Record) as lines of text: for people, and for
 * drivebridge-sim --replay. A line is
 *
 *	TIME DIRECTION KIND WHO: WORDS | BYTES
 *
 * with the local time of day, a direction of > (sent), < (received), ! (nothing came) or = (an event), and behind the
 * last stroke the bytes; on CAN ID#DATA. Lines that begin with # are comments.
 *
 * Pure, but for the time zone.
 */
#ifndef DRIVEBRIDGE_CTL_TRACE_TEXT_H
#define DRIVEBRIDGE_CTL_TRACE_TEXT_H

#include "ctl/grid.h"

#include <jansson.h>

/* What the longest record takes: bytes, and as many words. */
#define DB_CTL_TRACE_LINE 9216
/* So long ago a question may be for its answer's line to say how long it took. */
#define DB_CTL_TRACE_QUESTIONS 512

/* What was asked, by the number of its record, modulo. Starts as zeros. */
struct db_ctl_questions {
	struct {
		json_int_t number;
		json_int_t time_us;
		char who[80];
		char words[160];
	} asked[DB_CTL_TRACE_QUESTIONS];
};

/* Three lines of comment: whose trace it is, and of which day. */
void db_ctl_trace_write_head(const json_t *bus, json_int_t time_us, char *text, size_t size);

/* A line without its end; remembers it when it is a question. */
void db_ctl_trace_write_line(struct db_ctl_questions *questions, const json_t *record, char *text,
                             size_t size);

/* WHO: WORDS alone. */
void db_ctl_trace_write_words(const struct db_ctl_questions *questions, const json_t *record,
                              char *text, size_t size);

/* How a terminal shows it. */
enum db_ctl_colour db_ctl_trace_colour(const json_t *record);

#endif
