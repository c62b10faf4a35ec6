/* SPDX-License-Identifier: Apache-2.0 */
#include "audit/audit_private.h"

#include <string.h>

/* What stands before each record. */
struct head {
	uint32_t size; /* of all */
	uint16_t lengths[8];
};

/* The texts of an entry, which are behind it in the queue. */
static const size_t texts[] = {
	offsetof(struct db_audit_entry, login), offsetof(struct db_audit_entry, user),
	offsetof(struct db_audit_entry, from),  offsetof(struct db_audit_entry, drive),
	offsetof(struct db_audit_entry, bus),   offsetof(struct db_audit_entry, what),
	offsetof(struct db_audit_entry, text),  offsetof(struct db_audit_entry, endpoint),
};

#define TEXTS (sizeof(texts) / sizeof(texts[0]))
#define TEXT_MAX 512
#define ALIGNED(size) (((size) + 7) & ~(size_t)7)

_Static_assert(TEXTS *TEXT_MAX + DB_SETTINGS_MAX * sizeof(struct db_audit_value) <=
                       sizeof(((struct db_audit_taken *)0)->rest),
               "a record that was taken has room for its texts and values");

static const char *text_at(const struct db_audit_entry *entry, size_t i)
{
	const char *text;

	memcpy(&text, (const char *)entry + texts[i], sizeof(text));
	return text ? text : "";
}

/* A place for so many bytes in a row; null: there is none. */
static unsigned char *find_room(struct db_audit_queue *queue, size_t size)
{
	bool wrapped = queue->count > 0 && queue->end <= queue->begin;

	/* An empty queue begins again at its start, so that not all of it is paged in. */
	if (queue->count == 0)
		queue->begin = queue->end = 0;
	if (wrapped)
		return queue->begin - queue->end >= size ? queue->bytes + queue->end : NULL;
	if (sizeof(queue->bytes) - queue->end >= size)
		return queue->bytes + queue->end;
	if (queue->begin < size)
		return NULL;
	queue->wrap = queue->end;
	queue->end = 0;
	return queue->bytes;
}

bool db_audit_queue_put(struct db_audit_queue *queue, const struct db_audit_entry *entry)
{
	size_t values = entry->value_count * sizeof(entry->values[0]);
	struct head head = { .size = sizeof(head) };
	unsigned char *to;

	for (size_t i = 0; i < TEXTS; i++) {
		const char *text = text_at(entry, i);
		size_t length = strnlen(text, TEXT_MAX - 1);

		/* Half a character would make it unreadable. */
		while (length > 0 && ((unsigned char)text[length] & 0xC0) == 0x80)
			length--;
		head.lengths[i] = (uint16_t)length;
		head.size += head.lengths[i] + 1u;
	}
	head.size = (uint32_t)(ALIGNED(head.size + sizeof(*entry)) + values);
	to = find_room(queue, head.size);
	if (!to)
		return false;
	queue->end = (size_t)(to - queue->bytes) + head.size;
	queue->count++;
	memcpy(to, &head, sizeof(head));
	memcpy(to + sizeof(head), entry, sizeof(*entry));
	to += head.size - values;
	if (values > 0)
		memcpy(to, entry->values, values);
	to -= head.size - values - sizeof(head) - sizeof(*entry);
	for (size_t i = 0; i < TEXTS; i++) {
		memcpy(to, text_at(entry, i), head.lengths[i]);
		to[head.lengths[i]] = '\0';
		to += head.lengths[i] + 1;
	}
	return true;
}

bool db_audit_queue_take(struct db_audit_queue *queue, struct db_audit_taken *taken)
{
	const unsigned char *from;
	struct head head;
	const char *text;
	size_t values;

	if (queue->count == 0)
		return false;
	if (queue->end <= queue->begin && queue->begin == queue->wrap)
		queue->begin = 0;
	from = queue->bytes + queue->begin;
	memcpy(&head, from, sizeof(head));
	memcpy(&taken->entry, from + sizeof(head), sizeof(taken->entry));
	values = taken->entry.value_count * sizeof(taken->entry.values[0]);
	/* The values first, because they need to be aligned. */
	memcpy(taken->rest, from + head.size - values, values);
	taken->entry.values = (const struct db_audit_value *)(const void *)taken->rest;
	memcpy(taken->rest + values, from + sizeof(head) + sizeof(taken->entry),
	       head.size - values - sizeof(head) - sizeof(taken->entry));
	text = (const char *)taken->rest + values;
	for (size_t i = 0; i < TEXTS; i++) {
		memcpy((char *)&taken->entry + texts[i], &text, sizeof(text));
		text += head.lengths[i] + 1;
	}
	queue->begin += head.size;
	queue->count--;
	return true;
}
