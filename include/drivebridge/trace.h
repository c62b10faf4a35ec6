/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a bus carried last, frame by frame, with what the bridge made of it. The bus's thread writes, other threads
 * read along; nobody waits. Who reads too slowly finds that records are missing, and is told how many.
 */
#ifndef DRIVEBRIDGE_TRACE_H
#define DRIVEBRIDGE_TRACE_H

#include "drivebridge/log.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum db_trace_kind {
	/* Sent, and why. */
	DB_TRACE_STOP,
	DB_TRACE_POLL,
	DB_TRACE_IDENTIFY,
	DB_TRACE_PROBE,
	DB_TRACE_COMMAND,
	DB_TRACE_BROADCAST, /* of a stop or a common start, to all drives */
	/* Received, and what it was taken for. */
	DB_TRACE_ANSWER,  /* to `question` */
	DB_TRACE_PART,    /* of the answer to `question`; the rest is waited for */
	DB_TRACE_REPORT,  /* sent by a drive unasked */
	DB_TRACE_LATE,    /* the answer to `question`, which was given up */
	DB_TRACE_STRAY,   /* a good frame that nobody waited for */
	DB_TRACE_BAD,     /* wrong in its form or checksum */
	DB_TRACE_FOREIGN, /* another family's or another master's */
	DB_TRACE_GARBAGE, /* bytes between frames */
	/* Neither. */
	DB_TRACE_UNANSWERED, /* `question` was given up; no bytes */
	DB_TRACE_EVENT, /* of the log: a byte enum db_event, then the drive's name; without that the bus's */
	DB_TRACE_KIND_COUNT
};

/* Names of drives in events are cut there. */
#define DB_TRACE_NAME_MAX 63

/* Whether a trace is kept when this happens. */
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

/* Longer ones are cut. No frame is. */
#define DB_TRACE_BYTES_MAX 2048

struct db_trace_record {
	uint32_t number; /* from 1, in the order of writing; 0 is none's, also behind a wrap */
	uint32_t
		question; /* number of the record that this one refers to; 0: none, or it is long ago */
	db_time time; /* CLOCK_MONOTONIC: of handing over to the kernel, of having been received whole */
	enum db_trace_kind kind;
	size_t length;
	uint8_t bytes[DB_TRACE_BYTES_MAX]; /* on CAN one struct db_can_frame */
};

struct db_trace;

/* A ring of so many bytes: a power of two, not less than 4096. Null when out of memory. */
struct db_trace *db_trace_new(size_t size);
/* Null is fine. */
void db_trace_free(struct db_trace *trace);

/* --- the one writer: no call of the system, no allocation, in a time that depends on the length only --------- */

/* Its number. */
uint32_t db_trace_write(struct db_trace *trace, db_time time, enum db_trace_kind kind,
                        uint32_t question, const void *bytes, size_t length);
/*
 * A frame came, and db_trace_close() says what it was; meanwhile its bytes must stay, and nothing but events may be
 * written, which then stand behind it.
 */
void db_trace_open(struct db_trace *trace, db_time time, const void *bytes, size_t length);
void db_trace_close(struct db_trace *trace, enum db_trace_kind kind, uint32_t question);
/* Something happened, to this drive or with null to the bus. */
void db_trace_write_event(struct db_trace *trace, db_time time, enum db_event event,
                          const char *drive);

/* --- readers: any thread ----------------------------------------------------------------------------------- */

/* Where somebody reads on; everything zero: at the oldest record that is kept. */
struct db_trace_place {
	unsigned long at;
	uint32_t next; /* number of the record expected there; 0: any */
};

/* Behind the newest record. */
struct db_trace_place db_trace_end(const struct db_trace *trace);

/* The next record, and how many were lost before it. False: there is none yet. */
bool db_trace_read(const struct db_trace *trace, struct db_trace_place *place,
                   struct db_trace_record *record, uint32_t *missed);

/* How often there was trouble since it was made, modulo. */
uint32_t db_trace_troubles(const struct db_trace *trace);

/* What a record of DB_TRACE_EVENT says; "": it is the bus's. */
enum db_event db_trace_event_of(const struct db_trace_record *record,
                                char drive[DB_TRACE_NAME_MAX + 1]);

/* What is in it now, on its own; with `extra`, an event of another thread, at its time. Null when out of memory. */
struct db_trace *db_trace_copy(const struct db_trace *trace, const struct db_trace_record *extra);

#endif
