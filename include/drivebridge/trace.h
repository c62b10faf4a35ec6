/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The latest frames of a bus, and what the bridge made of them. The bus's thread writes, other
 * threads read at the same time without waiting. A reader that is too slow finds that records are
 * missing, and how many.
 */
#ifndef DRIVEBRIDGE_TRACE_H
#define DRIVEBRIDGE_TRACE_H

#include "drivebridge/log.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum db_trace_kind {
	/* Sent, and the purpose. */
	DB_TRACE_STOP,
	DB_TRACE_POLL,
	DB_TRACE_IDENTIFY,
	DB_TRACE_PROBE,
	DB_TRACE_COMMAND,
	DB_TRACE_BROADCAST, /* to all drives: a stop, a common start, a message of the bus */
	/* Received, and what it was taken for. */
	DB_TRACE_ANSWER,  /* to `question` */
	DB_TRACE_PART,    /* a part of the answer to `question`; the rest is awaited */
	DB_TRACE_REPORT,  /* sent by a drive unasked */
	DB_TRACE_LATE,    /* the answer to `question`, after its time-out */
	DB_TRACE_STRAY,   /* a good frame that nobody waited for */
	DB_TRACE_BAD,     /* wrong in its form or checksum */
	DB_TRACE_FOREIGN, /* another family's or another master's */
	DB_TRACE_GARBAGE, /* bytes between frames */
	/* Neither. */
	DB_TRACE_UNANSWERED, /* `question` timed out; no bytes */
	/* of the log: a byte enum db_event, then the drive's name; without a name an event of the
	 * bus */
	DB_TRACE_EVENT,
	DB_TRACE_KIND_COUNT
};

/* Longer names of drives in events are truncated. */
#define DB_TRACE_NAME_MAX 63

/* True if a trace is kept when this happens. */
bool db_trace_is_trouble(enum db_event event);

/* "stop" ... "event" */
const char *db_trace_kind_name(enum db_trace_kind kind);

static inline bool db_trace_is_sent(enum db_trace_kind kind)
{
	return kind <= DB_TRACE_BROADCAST;
}

static inline bool db_trace_is_received(enum db_trace_kind kind)
{
	return kind > DB_TRACE_BROADCAST && kind < DB_TRACE_UNANSWERED;
}

/* Longer records are truncated. No frame is that long. */
#define DB_TRACE_BYTES_MAX 2048

struct db_trace_record {
	uint32_t number;   /* from 1, in the order of writing; never 0, also after an overflow */
	uint32_t question; /* number of the record that this one refers to; 0: none, or too old */
	/* CLOCK_MONOTONIC: when it was handed to the kernel, or completely received */
	db_time time;
	enum db_trace_kind kind;
	size_t length;
	uint8_t bytes[DB_TRACE_BYTES_MAX]; /* on CAN one struct db_can_frame */
};

struct db_trace;

/* A ring of `size` bytes: a power of two, not less than 4096. Null when out of memory. */
struct db_trace *db_trace_new(size_t size);
/* Null is fine. */
void db_trace_free(struct db_trace *trace);

/* --- the one writer: no system call, no allocation, its time depends only on the length ------- */

/* Returns the record's number. */
uint32_t db_trace_write(struct db_trace *trace, db_time time, enum db_trace_kind kind,
                        uint32_t question, const void *bytes, size_t length);
/*
 * A frame was received, and db_trace_close() will classify it; until then its bytes must stay, and
 * only events may be written, which then follow it.
 */
void db_trace_open(struct db_trace *trace, db_time time, const void *bytes, size_t length);
void db_trace_close(struct db_trace *trace, enum db_trace_kind kind, uint32_t question);
/* Writes an event of this drive, or with null of the bus. */
void db_trace_write_event(struct db_trace *trace, db_time time, enum db_event event,
                          const char *drive);

/* --- readers: any thread ---------------------------------------------------------------------- */

/* A reader's position; all zero: at the oldest record that is kept. */
struct db_trace_place {
	unsigned long at;
	uint32_t next; /* number of the record expected there; 0: any */
};

/* After the newest record. */
struct db_trace_place db_trace_end(const struct db_trace *trace);

/* The next record, and the number lost before it. False: there is none yet. */
bool db_trace_read(const struct db_trace *trace, struct db_trace_place *place,
                   struct db_trace_record *record, uint32_t *missed);

/* Number of troubles since the trace was made, modulo 2^32. */
uint32_t db_trace_troubles(const struct db_trace *trace);

/* The event in a record of DB_TRACE_EVENT; "": it is the bus's. */
enum db_event db_trace_event_of(const struct db_trace_record *record,
                                char drive[DB_TRACE_NAME_MAX + 1]);

/* A separate copy of its present content; with `extra`, an event of another thread, at its time.
 * Null when out of memory. */
struct db_trace *db_trace_copy(const struct db_trace *trace, const struct db_trace_record *extra);

#endif
