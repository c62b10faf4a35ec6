/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The ring: records behind each other, in words. `begin` moves before words are overwritten and `end` behind what is
 * written, both as positions that only grow. As in drivebridge/seqlock.h each word is stored with release and loaded
 * with acquire: a reader that saw any overwritten word of a record finds afterwards that `begin` has passed it.
 */
#include "drivebridge/trace.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define WORD sizeof(unsigned long)
#define DISTANCE_MAX 0x7FF

struct head {
	db_time time;
	uint32_t number;
	unsigned length : 16;
	unsigned kind : 5;
	unsigned distance : 11; /* to the question; 0: none */
};

_Static_assert(sizeof(struct head) == 16, "a frame on CAN takes 32 bytes");
_Static_assert(DB_TRACE_KIND_COUNT <= 32, "a kind has five bits");

#define HEAD_WORDS (sizeof(struct head) / WORD)

struct db_trace {
	unsigned long mask; /* words, less one */

	/* The writer's. */
	unsigned long written; /* what is not published yet included */
	unsigned long first;   /* of the records that are kept */
	unsigned long last;    /* the frame written last: what db_trace_settle() is about */
	uint32_t number;

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
	case DB_EVENT_DRIVE_FAULT:
	case DB_EVENT_DRIVE_RESTARTED:
	case DB_EVENT_DRIVE_UNCONFIRMED:
	case DB_EVENT_DRIVE_RUNS_ON:
		return true;
	default:
		return false;
	}
}

struct db_trace *db_trace_new(size_t size)
{
	struct db_trace *trace = calloc(1, sizeof *trace + size);

	if (trace)
		trace->mask = size / WORD - 1;
	return trace;
}

void db_trace_free(struct db_trace *trace)
{
	free(trace);
}

/* --- writing --------------------------------------------------------------------------------------- */

static void put(struct db_trace *trace, unsigned long at, const void *bytes, size_t length)
{
	const unsigned char *from = bytes;
	unsigned long word;

	for (; length >= WORD; length -= WORD, from += WORD) {
		memcpy(&word, from, WORD);
		atomic_store_explicit(&trace->words[at++ & trace->mask], word,
		                      memory_order_release);
	}
	if (length > 0) {
		word = 0;
		memcpy(&word, from, length);
		atomic_store_explicit(&trace->words[at & trace->mask], word, memory_order_release);
	}
}

static void get(const struct db_trace *trace, unsigned long at, void *bytes, size_t length)
{
	unsigned char *to = bytes;
	unsigned long word;

	for (; length > 0; at++) {
		size_t part = length < WORD ? length : WORD;

		word = atomic_load_explicit(&trace->words[at & trace->mask], memory_order_acquire);
		memcpy(to, &word, part);
		to += part;
		length -= part;
	}
}

static unsigned distance_to(uint32_t number, uint32_t question)
{
	uint32_t distance = question == 0 ? 0 : number - question;

	return distance > DISTANCE_MAX ? 0 : distance;
}

static void append(struct db_trace *trace, struct head head, const void *bytes)
{
	size_t words = words_of(head.length);
	unsigned long first = trace->first;

	while (trace->written + words - first > trace->mask + 1) {
		struct head oldest;

		get(trace, first, &oldest, sizeof oldest);
		first += words_of(oldest.length);
	}
	if (first != trace->first) {
		trace->first = first;
		atomic_store_explicit(&trace->begin, first, memory_order_relaxed);
	}
	put(trace, trace->written, &head, sizeof head);
	put(trace, trace->written + HEAD_WORDS, bytes, head.length);
	trace->written += words;
}

uint32_t db_trace_write(struct db_trace *trace, db_time time, enum db_trace_kind kind,
                        uint32_t question, const void *bytes, size_t length)
{
	struct head head = { .time = time, .kind = kind & 0x1F };

	if (++trace->number == 0)
		trace->number = 1;
	head.number = trace->number;
	head.distance = distance_to(head.number, question) & DISTANCE_MAX;
	head.length = (length < DB_TRACE_BYTES_MAX ? length : DB_TRACE_BYTES_MAX) & 0xFFFF;
	if (kind != DB_TRACE_EVENT)
		trace->last = trace->written;
	append(trace, head, bytes);
	return head.number;
}

void db_trace_write_event(struct db_trace *trace, db_time time, enum db_event event,
                          const char *drive)
{
	char said[1 + DB_TRACE_NAME_MAX] = { (char)event };
	size_t length = drive ? strnlen(drive, DB_TRACE_NAME_MAX) : 0;

	if (drive)
		memcpy(said + 1, drive, length);
	db_trace_write(trace, time, DB_TRACE_EVENT, 0, said, 1 + length);
	db_trace_publish(trace);
	if (db_trace_is_trouble(event))
		atomic_fetch_add_explicit(&trace->troubles, 1, memory_order_release);
}

void db_trace_settle(struct db_trace *trace, enum db_trace_kind kind, uint32_t question)
{
	struct head head;

	/* Events behind it may have taken its place, in a ring that is too small for anything. */
	if ((long)(trace->first - trace->last) > 0)
		return;
	get(trace, trace->last, &head, sizeof head);
	head.kind = kind & 0x1F;
	head.distance = distance_to(head.number, question) & DISTANCE_MAX;
	put(trace, trace->last, &head, sizeof head);
}

void db_trace_publish(struct db_trace *trace)
{
	atomic_store_explicit(&trace->published, trace->number, memory_order_relaxed);
	atomic_store_explicit(&trace->end, trace->written, memory_order_release);
}

/* --- reading --------------------------------------------------------------------------------------- */

struct db_trace_place db_trace_end(const struct db_trace *trace)
{
	struct db_trace_place place;

	place.at = atomic_load_explicit(&trace->end, memory_order_acquire);
	/* Of a record that is published just now the next one's; then nothing counts as missed. */
	place.next = atomic_load_explicit(&trace->published, memory_order_relaxed) + 1;
	return place;
}

/* False when it was overwritten meanwhile. */
static bool copy_record(const struct db_trace *trace, unsigned long at, struct head *head,
                        uint8_t *bytes)
{
	unsigned long begin;

	get(trace, at, head, sizeof *head);
	/* Torn, it may say anything. */
	if (head->length > DB_TRACE_BYTES_MAX)
		return false;
	get(trace, at + HEAD_WORDS, bytes, head->length);
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
		/* What is overwritten is not always what is published. */
		if ((long)(end - place->at) <= 0)
			return false;
		if (copy_record(trace, place->at, &head, record->bytes))
			break;
	}
	*missed = place->next != 0 && (int32_t)(head.number - place->next) > 0 ?
	                  head.number - place->next :
	                  0;
	place->at += words_of(head.length);
	place->next = head.number + 1;
	record->number = head.number;
	record->question = head.distance == 0 ? 0 : head.number - head.distance;
	record->time = head.time;
	record->kind = (enum db_trace_kind)head.kind;
	record->length = head.length;
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

/* --- copies ---------------------------------------------------------------------------------------- */

static void copy_in(struct db_trace *copy, const struct db_trace_record *record, uint32_t number)
{
	struct head head = { .time = record->time,
		             .number = number,
		             .length = record->length & 0xFFFF,
		             .kind = record->kind & 0x1F };

	head.distance = distance_to(number, record->question) & DISTANCE_MAX;
	append(copy, head, record->bytes);
	copy->number = number;
}

struct db_trace *db_trace_copy(const struct db_trace *trace, const struct db_trace_record *extra)
{
	struct db_trace *copy = db_trace_new((trace->mask + 1) * WORD);
	struct db_trace_place place = { .at = 0 };
	struct db_trace_record record;
	uint32_t missed;

	while (copy && db_trace_read(trace, &place, &record, &missed)) {
		/* It has the number of the one behind it, so that none seems to be missing. */
		if (extra && extra->time <= record.time) {
			copy_in(copy, extra, record.number);
			extra = NULL;
		}
		copy_in(copy, &record, record.number);
	}
	if (copy && extra)
		copy_in(copy, extra, copy->number + 1);
	if (copy)
		db_trace_publish(copy);
	return copy;
}
