/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The form of configuration texts: sections with a name and perhaps a title, keys with a value or a
 * list in braces, quotes, escapes, comments. All of it becomes names and texts with the line where
 * they stand. Which names there are and what a value means is a matter of who reads them.
 *
 * Pure, but for environment variables where the rules let them in.
 */
#ifndef DRIVEBRIDGE_READER_READER_H
#define DRIVEBRIDGE_READER_READER_H

#include "reader/messages.h"

#include <stdbool.h>
#include <stddef.h>

#define DB_READER_NO_SECTION ((size_t)-1) /* a key outside of every section */

struct db_reader_key {
	char *name;
	unsigned line;
	size_t section; /* index, or DB_READER_NO_SECTION */
	char *values;   /* one behind the other, each with its zero byte; null when there is none */
	size_t size;    /* of them, in bytes */
	size_t count;   /* 1 unless it is a list */
	bool list;      /* the values stood in braces, or were appended with += */
	bool refused;   /* set by who reads it: there is no such key */
	bool misread;   /* set by who reads it: it has no such value */
};

struct db_reader_section {
	char *name;
	char *title; /* "" when it has none */
	unsigned line;
	bool refused; /* set by who reads it */
};

struct db_reader {
	struct db_reader_section *sections;
	size_t section_count;
	struct db_reader_key *keys; /* those of a section stand together */
	size_t key_count;
};

struct db_reader_rules {
	const char
		*sections; /* what may stand in the text, for messages: "bus NAME or drive NAME" */
	/*
	 * What simulators' files always could and the service's cannot, where a slip must not pass
	 * for a value: ${VARIABLE} and ${VARIABLE:-otherwise} outside of single quotes, escapes as
	 * in C, texts over several lines, quoted names, two slashes and typographic characters
	 * inside words, += for lists, and of two keys of one name the last counts.
	 */
	bool lenient;
};

/*
 * Reads all sources of `messages`, where errors go with what would be right. False: the form is
 * broken (the reader has what came before), or no memory, which is an error too.
 */
bool db_reader_read(struct db_reader *reader, const struct db_reader_rules *rules,
                    struct db_messages *messages);

void db_reader_clear(struct db_reader *reader);

/* The first section of this name and title that was not refused, or DB_READER_NO_SECTION. */
size_t db_reader_find_section(const struct db_reader *reader, const char *name, const char *title);

/* The key of this name in the section, unless it was refused; else null. */
struct db_reader_key *db_reader_find_key(const struct db_reader *reader, size_t section,
                                         const char *name);

#endif
