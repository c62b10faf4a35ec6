/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Records of a trace (objects of the interface's type Record) as lines of text: for people, and for
 * drivebridge-sim --replay. A line is
 *
 *	TIME DIRECTION KIND WHO: WORDS | BYTES
 *
 * with the local time of day, a direction of > (sent), < (received), ! (no answer) or = (an event),
 * and the bytes after the vertical bar; on CAN ID#DATA. Lines that begin with # are comments.
 *
 * Pure, but for the time zone.
 */
#ifndef DRIVEBRIDGE_CAPTURE_TRACE_TEXT_H
#define DRIVEBRIDGE_CAPTURE_TRACE_TEXT_H

#include <jansson.h>

/* Size of the longest record: its bytes, and their words. */
#define DB_CAPTURE_TRACE_LINE 9216
/* An answer's line can say how long it took if its question is at most this number of records
 * older. */
#define DB_CAPTURE_TRACE_QUESTIONS 512

/* Questions by the number of their record, modulo the size. Starts as zeros. */
struct db_capture_questions {
	struct {
		json_int_t number;
		json_int_t time_us;
		char who[80];
		char words[160];
	} asked[DB_CAPTURE_TRACE_QUESTIONS];
};

/* Three lines of comment: the bus, and the day of the trace. */
void db_capture_trace_write_head(const json_t *bus, json_int_t time_us, char *text, size_t size);

/* WHO: WORDS of the next record; a question is remembered. Each record once, in their order. */
void db_capture_trace_take(struct db_capture_questions *questions, const json_t *record,
                           char *words, size_t size);

/* Its bytes with spaces between, on CAN ID#DATA; "" without bytes. */
void db_capture_trace_write_bytes(const json_t *record, char *text, size_t size);

/* A line without its end, with what db_capture_trace_take() has found. */
void db_capture_trace_write_line(const json_t *record, const char *words, char *text, size_t size);

#endif
