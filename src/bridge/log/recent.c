/* SPDX-License-Identifier: Apache-2.0 */
#include "log/log_private.h"

#include <stdio.h>
#include <string.h>

/* The header before the four texts, each of which is terminated. */
struct head {
	uint64_t time_us;
	uint32_t event;
	uint32_t size; /* total size */
};

static void put(struct db_recent *recent, uint32_t at, const void *bytes, size_t size)
{
	const unsigned char *from = bytes;

	for (size_t i = 0; i < size; i++)
		recent->bytes[(at + i) % DB_RECENT_BYTES] = from[i];
}

static void get(const struct db_recent *recent, uint32_t at, void *bytes, size_t size)
{
	unsigned char *to = bytes;

	for (size_t i = 0; i < size; i++)
		to[i] = recent->bytes[(at + i) % DB_RECENT_BYTES];
}

void db_recent_add(struct db_recent *recent, const struct db_log_record *record, uint64_t time_us)
{
	const char *const texts[] = { record->bus, record->drive, record->client,
		                      record->text + record->told };
	struct head head = { .time_us = time_us, .event = (uint32_t)record->event };
	uint32_t at;

	head.size = sizeof(head);
	for (size_t i = 0; i < 4; i++)
		head.size += (uint32_t)strlen(texts[i]) + 1;
	while (recent->count == DB_LOG_RECENT || recent->used + head.size > DB_RECENT_BYTES) {
		struct head oldest;

		get(recent, recent->begin, &oldest, sizeof(oldest));
		recent->begin = (recent->begin + oldest.size) % DB_RECENT_BYTES;
		recent->used -= oldest.size;
		recent->count--;
	}
	at = (recent->begin + recent->used) % DB_RECENT_BYTES;
	recent->last++;
	recent->count++;
	recent->used += head.size;
	recent->places[recent->last % DB_LOG_RECENT] = at;
	put(recent, at, &head, sizeof(head));
	at += sizeof(head);
	for (size_t i = 0; i < 4; i++) {
		put(recent, at, texts[i], strlen(texts[i]) + 1);
		at += (uint32_t)strlen(texts[i]) + 1;
	}
}

/* Reads a text; returns the position after it. */
static uint32_t get_text(const struct db_recent *recent, uint32_t at, char *text, size_t size)
{
	for (size_t length = 0; length < size; length++) {
		text[length] = (char)recent->bytes[at++ % DB_RECENT_BYTES];
		if (text[length] == '\0')
			break;
	}
	text[size - 1] = '\0';
	return at;
}

bool db_recent_find(const struct db_recent *recent, uint64_t from, struct db_log_line *line)
{
	uint64_t oldest = recent->last - recent->count + 1;
	struct head head;
	uint32_t at;

	if (from < oldest)
		from = oldest;
	if (recent->count == 0 || from > recent->last)
		return false;
	at = recent->places[from % DB_LOG_RECENT];
	get(recent, at, &head, sizeof(head));
	line->number = from;
	line->time_us = head.time_us;
	line->event = (enum db_event)head.event;
	at += sizeof(head);
	at = get_text(recent, at, line->bus, sizeof(line->bus));
	at = get_text(recent, at, line->drive, sizeof(line->drive));
	at = get_text(recent, at, line->client, sizeof(line->client));
	get_text(recent, at, line->text, sizeof(line->text));
	return true;
}

bool db_recent_latest(const struct db_recent *recent, uint64_t events, const char *bus,
                      const char *drive, uint64_t since_us, struct db_log_line *line)
{
	for (uint64_t i = 0; i < recent->count; i++) {
		uint64_t number = recent->last - i;
		struct head head;

		get(recent, recent->places[number % DB_LOG_RECENT], &head, sizeof(head));
		if (head.time_us < since_us)
			return false;
		if ((DB_EVENT_BIT(head.event) & events) && db_recent_find(recent, number, line) &&
		    strcmp(line->bus, bus) == 0 && strcmp(line->drive, drive) == 0)
			return true;
	}
	return false;
}
