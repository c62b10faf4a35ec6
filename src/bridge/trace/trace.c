/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The ring: records one after the other, in words. `begin` moves before words are overwritten and
 * `end` after words are written, both as positions that only grow. As in drivebridge/seqlock.h each
 * word is stored with release and loaded with acquire: a reader that saw any overwritten word of a
 * record finds afterwards that `begin` has passed it.
 */
#include "drivebridge/trace.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define WORD sizeof(unsigned long)
#define DISTANCE_MAX 0x7FF

struct head {
	db_time time;
	struct tail {
		uint32_t number;
		unsigned length : 16;
		unsigned kind : 5;
		unsigned distance : 11; /* to the question; 0: none */
	} tail;
};

_Static_assert(sizeof(struct head) == 16, "a frame on CAN takes 32 bytes");
_Static_assert(DB_TRACE_KIND_COUNT <= 32, "a kind has five bits");

#define HEAD_WORDS (sizeof(struct head) / WORD)
#define TIME_WORDS (sizeof(db_time) / WORD)

struct db_trace {
	unsigned long mask; /* words, less one */

	/* Used by the writer only. */
	unsigned long written; /* end of the written words, including those not published yet */
	uint32_t number;       /* of the newest record there */
	bool frame_is_open;    /* see db_trace_open() */
	/* at `frame_at`, because an event follows it; nothing is published */
	bool frame_is_written;
	unsigned long frame_at;
	db_time frame_time;
	const void *frame_bytes;
	size_t frame_length;

	_Atomic unsigned long begin;
	_Atomic unsigned long end;
	_Atomic uint32_t published; /* number of the newest record before `end` */
	_Atomic uint32_t troubles;
	_Atomic unsigned long words[];
};

static size_t words_of(size_t length)
{
	return HEAD_WORDS + (length + WORD - 1) / WORD;
}

const char *db_trace_kind_name(enum db_trace_kind kind)
{
	static const char *const names[DB_TRACE_KIND_COUNT] = {
		[DB_TRACE_STOP] = "stop",
		[DB_TRACE_POLL] = "poll",
		[DB_TRACE_IDENTIFY] = "identify",
		[DB_TRACE_PROBE] = "probe",
		[DB_TRACE_COMMAND] = "command",
		[DB_TRACE_BROADCAST] = "broadcast",
		[DB_TRACE_ANSWER] = "answer",
		[DB_TRACE_PART] = "part",
		[DB_TRACE_REPORT] = "report",
		[DB_TRACE_LATE] = "late",
		[DB_TRACE_STRAY] = "stray",
		[DB_TRACE_BAD] = "bad",
		[DB_TRACE_FOREIGN] = "foreign",
		[DB_TRACE_GARBAGE] = "garbage",
		[DB_TRACE_UNANSWERED] = "unanswered",
		[DB_TRACE_EVENT] = "event",
	};

	return names[kind];
}

bool db_trace_is_trouble(enum db_event event)
{
	switch (event) {
	case DB_EVENT_WATCHDOG_TRIPPED:
	case DB_EVENT_BUS_LOST:
	case DB_EVENT_BUS_OFF:
	case DB_EVENT_DRIVE_LOST:
	case DB_EVENT_DRIVE_HEARD:
	case DB_EVENT_DRIVE_FAULT:
	case DB_EVENT_DRIVE_RESTARTED:
	case DB_EVENT_DRIVE_MAY_HAVE_RESTARTED:
	case DB_EVENT_DRIVE_UNCONFIRMED:
	case DB_EVENT_DRIVE_DOUBLED:
	case DB_EVENT_DRIVE_RUNS_ON:
		return true;
	default:
		return false;
	}
}

struct db_trace *db_trace_new(size_t size)
{
	struct db_trace *trace = calloc(1, sizeof(*trace) + size);

	if (trace)
		trace->mask = size / WORD - 1;
	return trace;
}

void db_trace_free(struct db_trace *trace)
{
	free(trace);
}

/* --- writing ---------------------------------------------------------------------------------- */

/* As few instructions as possible: this is done for every frame. */
static inline void put_word(struct db_trace *trace, unsigned long at, unsigned long word)
{
	atomic_store_explicit(&trace->words[at & trace->mask], word, memory_order_release);
}

static inline unsigned long get_word(const struct db_trace *trace, unsigned long at)
{
	return atomic_load_explicit(&trace->words[at & trace->mask], memory_order_acquire);
}

/*
 * Bytes in words. A trailing partial word is stored as the last WORD bytes, overlapping the word
 * before; fewer bytes than a word are stored in the same way as two halves.
 */
#define HALF (WORD / 2)

static inline void put(struct db_trace *trace, unsigned long at, const void *bytes, size_t length)
{
	const unsigned char *from = bytes;
	unsigned char part[WORD] = { 0 };
	unsigned long word;
	size_t done;

	for (done = 0; done + WORD <= length; done += WORD) {
		memcpy(&word, from + done, WORD);
		put_word(trace, at++, word);
	}
	if (done == length)
		return;
	if (length >= WORD) {
		memcpy(&word, from + length - WORD, WORD);
	} else if (length >= HALF) {
		memcpy(part, from, HALF);
		memcpy(part + HALF, from + length - HALF, HALF);
		memcpy(&word, part, WORD);
	} else {
		for (size_t i = 0; i < length; i++)
			part[i] = from[i];
		memcpy(&word, part, WORD);
	}
	put_word(trace, at, word);
}

static inline void get(const struct db_trace *trace, unsigned long at, void *bytes, size_t length)
{
	unsigned char *to = bytes;
	unsigned char part[WORD];
	unsigned long word;
	size_t done;

	for (done = 0; done + WORD <= length; done += WORD) {
		word = get_word(trace, at++);
		memcpy(to + done, &word, WORD);
	}
	if (done == length)
		return;
	word = get_word(trace, at);
	memcpy(part, &word, WORD);
	if (length >= WORD) {
		memcpy(to + length - WORD, part, WORD);
	} else if (length >= HALF) {
		memcpy(to, part, HALF);
		memcpy(to + length - HALF, part + HALF, HALF);
	} else {
		memcpy(to, part, length);
	}
}

static inline struct head head_of(db_time time, uint32_t number, enum db_trace_kind kind,
                                  uint32_t question, size_t length)
{
	struct head head = { .time = time, .tail.number = number };
	uint32_t distance;

	head.tail.length = (length < DB_TRACE_BYTES_MAX ? length : DB_TRACE_BYTES_MAX) & 0xFFFF;
	head.tail.kind = kind & 0x1F;
	distance = question == 0 ? 0 : number - question;
	head.tail.distance = (distance > DISTANCE_MAX ? 0 : distance) & DISTANCE_MAX;
	return head;
}

static inline void append(struct db_trace *trace, const struct head *head, const void *bytes)
{
	unsigned long begin = atomic_load_explicit(&trace->begin, memory_order_relaxed);
	unsigned long after = trace->written + words_of(head->tail.length);
	unsigned long first = begin;

	while (after - first > trace->mask + 1) {
		struct tail oldest;

		get(trace, first + TIME_WORDS, &oldest, sizeof(oldest));
		first += words_of(oldest.length);
	}
	if (first != begin)
		atomic_store_explicit(&trace->begin, first, memory_order_relaxed);
	put(trace, trace->written, head, sizeof(*head));
	put(trace, trace->written + HEAD_WORDS, bytes, head->tail.length);
	trace->written = after;
	trace->number = head->tail.number;
}

static inline void publish(struct db_trace *trace)
{
	atomic_store_explicit(&trace->published, trace->number, memory_order_relaxed);
	atomic_store_explicit(&trace->end, trace->written, memory_order_release);
}

static inline uint32_t next_number(const struct db_trace *trace)
{
	return trace->number == UINT32_MAX ? 1 : trace->number + 1;
}

uint32_t db_trace_write(struct db_trace *trace, db_time time, enum db_trace_kind kind,
                        uint32_t question, const void *bytes, size_t length)
{
	struct head head = head_of(time, next_number(trace), kind, question, length);

	append(trace, &head, bytes);
	publish(trace);
	return head.tail.number;
}

void db_trace_open(struct db_trace *trace, db_time time, const void *bytes, size_t length)
{
	trace->frame_is_open = true;
	trace->frame_time = time;
	trace->frame_bytes = bytes;
	trace->frame_length = length;
}

void db_trace_close(struct db_trace *trace, enum db_trace_kind kind, uint32_t question)
{
	trace->frame_is_open = false;
	if (!trace->frame_is_written) {
		db_trace_write(trace, trace->frame_time, kind, question, trace->frame_bytes,
		               trace->frame_length);
		return;
	}
	trace->frame_is_written = false;
	/* Unless later events have taken its place, in a ring that is too small for anything. */
	if ((long)(atomic_load_explicit(&trace->begin, memory_order_relaxed) - trace->frame_at) <=
	    0) {
		struct head head;

		get(trace, trace->frame_at, &head, sizeof(head));
		head = head_of(head.time, head.tail.number, kind, question, head.tail.length);
		put(trace, trace->frame_at, &head, sizeof(head));
	}
	publish(trace);
}

void db_trace_write_event(struct db_trace *trace, db_time time, enum db_event event,
                          const char *drive)
{
	char said[1 + DB_TRACE_NAME_MAX] = { (char)event };
	size_t length = drive ? strnlen(drive, DB_TRACE_NAME_MAX) : 0;
	struct head head;

	if (drive)
		memcpy(said + 1, drive, length);
	if (trace->frame_is_open && !trace->frame_is_written) {
		/* An event follows the frame that is being processed. */
		struct head frame = head_of(trace->frame_time, next_number(trace), DB_TRACE_STRAY,
		                            0, trace->frame_length);

		trace->frame_is_written = true;
		trace->frame_at = trace->written;
		append(trace, &frame, trace->frame_bytes);
	}
	head = head_of(time, next_number(trace), DB_TRACE_EVENT, 0, 1 + length);
	append(trace, &head, said);
	if (!trace->frame_is_open)
		publish(trace);
	if (db_trace_is_trouble(event))
		atomic_fetch_add_explicit(&trace->troubles, 1, memory_order_release);
}

/* --- reading ---------------------------------------------------------------------------------- */

struct db_trace_place db_trace_end(const struct db_trace *trace)
{
	struct db_trace_place place;

	place.at = atomic_load_explicit(&trace->end, memory_order_acquire);
	/* May be one ahead if a record is published in between; that only hides a gap. */
	place.next = atomic_load_explicit(&trace->published, memory_order_relaxed) + 1;
	return place;
}

/* False when it was overwritten meanwhile. */
static bool copy_record(const struct db_trace *trace, unsigned long at, struct head *head,
                        uint8_t *bytes)
{
	unsigned long begin;

	get(trace, at, head, sizeof(*head));
	/* If it is torn, it may have any content. */
	if (head->tail.length > DB_TRACE_BYTES_MAX)
		return false;
	get(trace, at + HEAD_WORDS, bytes, head->tail.length);
	begin = atomic_load_explicit(&trace->begin, memory_order_relaxed);
	return (long)(begin - at) <= 0;
}

bool db_trace_read(const struct db_trace *trace, struct db_trace_place *place,
                   struct db_trace_record *record, uint32_t *missed)
{
	struct head head;

	for (;;) {
		unsigned long end = atomic_load_explicit(&trace->end, memory_order_acquire);
		unsigned long begin = atomic_load_explicit(&trace->begin, memory_order_relaxed);

		if ((long)(begin - place->at) > 0)
			place->at = begin;
		/* `begin` may pass `end` while the writer overwrites. */
		if ((long)(end - place->at) <= 0)
			return false;
		if (copy_record(trace, place->at, &head, record->bytes))
			break;
	}
	*missed = place->next != 0 && (int32_t)(head.tail.number - place->next) > 0 ?
	                  head.tail.number - place->next :
	                  0;
	place->at += words_of(head.tail.length);
	place->next = head.tail.number + 1;
	record->number = head.tail.number;
	record->question = head.tail.distance == 0 ? 0 : head.tail.number - head.tail.distance;
	record->time = head.time;
	record->kind = (enum db_trace_kind)head.tail.kind;
	record->length = head.tail.length;
	return true;
}

uint32_t db_trace_troubles(const struct db_trace *trace)
{
	return atomic_load_explicit(&trace->troubles, memory_order_acquire);
}

enum db_event db_trace_event_of(const struct db_trace_record *record,
                                char drive[DB_TRACE_NAME_MAX + 1])
{
	size_t length = record->length > 1 ? record->length - 1 : 0;

	length = length < DB_TRACE_NAME_MAX ? length : DB_TRACE_NAME_MAX;
	memcpy(drive, record->bytes + 1, length);
	drive[length] = '\0';
	return record->length > 0 && record->bytes[0] < DB_EVENT_COUNT ?
	               (enum db_event)record->bytes[0] :
	               DB_EVENT_COUNT;
}

/* --- copies ----------------------------------------------------------------------------------- */

static void copy_in(struct db_trace *copy, const struct db_trace_record *record, uint32_t number)
{
	struct head head = head_of(record->time, number, record->kind, record->question,
	                           record->length);

	append(copy, &head, record->bytes);
	publish(copy);
}

struct db_trace *db_trace_copy(const struct db_trace *trace, const struct db_trace_record *extra)
{
	struct db_trace *copy = db_trace_new((trace->mask + 1) * WORD);
	struct db_trace_place place = { .at = 0 };
	struct db_trace_record record;
	uint32_t missed;

	while (copy && db_trace_read(trace, &place, &record, &missed)) {
		/* It has the number of the record after it, so that none seems to be missing. */
		if (extra && extra->time <= record.time) {
			copy_in(copy, extra, record.number);
			extra = NULL;
		}
		copy_in(copy, &record, record.number);
	}
	if (copy && extra)
		copy_in(copy, extra, next_number(copy));
	return copy;
}
