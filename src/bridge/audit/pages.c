/* SPDX-License-Identifier: Apache-2.0 */
#include "audit/audit_private.h"

#include "drivebridge/result.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Read for a page. */
#define READ_BYTES (64 * 1024)

/* Of one drive; it rarely has more commands pending at a time. */
#define BEGUN_OF_DRIVE 4

/* A page while it is read. */
struct collection {
	struct db_pages *pages;
	const struct db_audit_query *query;
	struct db_audit_page *page;
	FILE *out;
	size_t written;
};

/* The oldest record of this drive if it has as many as a drive may have; else a free place; else
 * the oldest of all. */
static struct db_begun *find_begun_place(struct db_pages *pages, const char *drive)
{
	struct db_begun *oldest = &pages->begun[0];
	struct db_begun *of_drive = NULL;
	struct db_begun *unused = NULL;
	unsigned count = 0;

	for (size_t i = 0; i < DB_BEGUN_MAX; i++) {
		struct db_begun *place = &pages->begun[i];

		if (place->number == 0) {
			unused = place;
			continue;
		}
		if (place->number < oldest->number)
			oldest = place;
		if (strcmp(place->drive, drive) != 0)
			continue;
		count++;
		if (!of_drive || place->number < of_drive->number)
			of_drive = place;
	}
	if (of_drive && count >= BEGUN_OF_DRIVE)
		return of_drive;
	return unused ? unused : oldest;
}

/* Who it was, to be freed. An end also gets what it ends, which was read shortly before. */
static char *name_who(struct db_pages *pages, uint64_t number, json_t *object)
{
	uint64_t of = (uint64_t)json_integer_value(json_object_get(object, "of"));
	char *who = db_record_who(object);
	const char *kind = db_record_text(object, "kind");

	if (strcmp(kind, db_audit_kind_name(DB_AUDIT_END)) != 0) {
		const char *result = db_record_text(object, "result");
		const char *drive = db_record_text(object, "drive");
		const char *what = db_record_text(object, "what");
		struct db_begun *place;

		if (strcmp(result, db_result_name(DB_RESULT_PENDING)) != 0)
			return who;
		place = find_begun_place(pages, drive);
		place->number = number;
		snprintf(place->drive, sizeof(place->drive), "%s", drive);
		snprintf(place->what, sizeof(place->what), "%s", what[0] ? what : kind);
		snprintf(place->who, sizeof(place->who), "%s", who ? who : "");
		return who;
	}
	for (size_t i = 0; i < DB_BEGUN_MAX; i++) {
		const struct db_begun *place = &pages->begun[i];

		if (of == 0 || place->number != of)
			continue;
		free(who);
		(void)json_object_set_new(object, "what", json_string(place->what));
		return strdup(place->who);
	}
	/* Its record was not read, or is gone. */
	free(who);
	return strdup("");
}

static bool is_wanted(const struct db_audit_query *query, const json_t *object, const char *who)
{
	const char *drive = json_string_value(json_object_get(object, "drive"));
	json_int_t time = json_integer_value(json_object_get(object, "time_us"));

	return (uint64_t)time >= query->since_us &&
	       (!query->refused || db_record_is_refused(object)) &&
	       (query->drive[0] == '\0' || (drive && strcmp(drive, query->drive) == 0)) &&
	       (query->who[0] == '\0' || strcasestr(who, query->who));
}

static void collect(void *context, const struct db_lines *lines, json_t *object, const char *text,
                    size_t length, const char *why)
{
	struct collection *collection = context;
	struct db_audit_page *page = collection->page;
	char *who;

	(void)text;
	(void)length;
	page->checked++;
	if (why && page->broken_count == DB_AUDIT_BROKEN_MAX) {
		page->more_broken++;
	} else if (why) {
		struct db_audit_broken *broken = &page->broken[page->broken_count++];

		broken->number = lines->number;
		broken->line = lines->line;
		broken->why = why;
		db_trail_name(lines->segment, broken->segment);
	}
	if (!object || collection->query->verify)
		return;
	who = name_who(collection->pages, lines->number, object);
	if (who && lines->number >= collection->query->from &&
	    is_wanted(collection->query, object, who)) {
		(void)json_object_set_new(object, "who", json_string(who));
		if (why)
			(void)json_object_set_new(object, "broken", json_string(why));
		if (collection->written++ > 0)
			fputc(',', collection->out);
		(void)json_dumpf(object, collection->out, JSON_COMPACT | JSON_REAL_PRECISION(9));
	}
	free(who);
}

/* The place from which a reader goes on. What is before the first number that it wants may take
 * several pages, so readers who take turns must not lose theirs. */
static struct db_reader_place *find_reader_place(struct db_pages *pages, struct db_trail *trail,
                                                 uint32_t reader,
                                                 const struct db_audit_query *query)
{
	struct db_reader_place *oldest = &pages->places[0];

	for (size_t i = 0; i < DB_READERS_MAX; i++) {
		struct db_reader_place *place = &pages->places[i];

		if (query->from != 0 && place->reader == reader && place->number == query->from)
			return place;
		if (place->used < oldest->used)
			oldest = place;
	}
	oldest->reader = reader;
	db_trail_find(trail, query->from, query->since_us, &oldest->at);
	return oldest;
}

void db_pages_read(struct db_pages *pages, struct db_trail *trail, uint32_t reader,
                   const struct db_audit_query *query, struct db_audit_page *page)
{
	struct collection collection = { .pages = pages, .query = query, .page = page };
	struct db_reader_place *place;

	*page = (struct db_audit_page){ .over = true };
	if (!trail)
		return;
	collection.out = open_memstream(&page->records, &page->length);
	if (!collection.out)
		return;
	place = find_reader_place(pages, trail, reader, query);
	page->over = !db_trail_read(trail, &place->at, READ_BYTES, collect, &collection);
	page->next = place->at.lines.number + 1;
	if (page->next < query->from)
		page->next = query->from;
	place->number = page->next;
	place->used = ++pages->read;
	/* What was cut off leaves no trace in what is left. */
	if (page->over && place->at.lines.number < db_trail_newest(trail) &&
	    page->broken_count < DB_AUDIT_BROKEN_MAX) {
		page->broken[page->broken_count] = (struct db_audit_broken){
			.number = place->at.lines.number,
			.line = place->at.lines.line,
			.why = "the last records are missing",
		};
		db_trail_name(place->at.lines.segment, page->broken[page->broken_count++].segment);
	}
	fclose(collection.out);
}
