/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The form of configuration texts: sections with a name and perhaps a title, keys with a value or a
 * list in braces, quotes, escapes, comments. All of it becomes names and texts with their lines.
 * The caller defines the names and the meaning of values.
 *
 * Pure, except for environment variables where the rules allow them.
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
	char *values;   /* one after the other, each with its zero byte; null when there is none */
	size_t size;    /* total size of them in bytes */
	size_t count;   /* 1 unless it is a list */
	bool list;      /* the values were in braces, or were appended with += */
	bool refused;   /* set by the caller: there is no such key */
	bool misread;   /* set by the caller: invalid value */
};

struct db_reader_section {
	char *name;
	char *title; /* "" when it has none */
	unsigned line;
	bool refused; /* set by the caller */
	bool profile; /* it is in a source that is a profile */
	/* Set by the caller: the section whose keys are used where this one has none. */
	size_t base;
};

struct db_reader {
	struct db_reader_section *sections;
	size_t section_count;
	struct db_reader_key *keys; /* keys of a section are adjacent */
	size_t key_count;
};

struct db_reader_rules {
	/* the sections allowed in the text, for messages: "bus NAME or drive NAME" */
	const char *sections;
	/*
	 * Allowed in simulators' files, and not in the service's, where a slip must not be taken
	 * for a value: ${VARIABLE} and ${VARIABLE:-otherwise} outside of single quotes, escapes as
	 * in C, texts over several lines, quoted names, two slashes and typographic characters
	 * inside words, += for lists, and of two keys of one name the last counts.
	 */
	bool lenient;
};

/*
 * Reads all sources of `messages`, to which errors are added with the correct form. False: the form
 * is invalid (the reader has everything before that), or no memory, which is an error too.
 */
bool db_reader_read(struct db_reader *reader, const struct db_reader_rules *rules,
                    struct db_messages *messages);

/* Continues with the sources from this one on, which were added to `messages` since. */
bool db_reader_read_more(struct db_reader *reader, const struct db_reader_rules *rules,
                         struct db_messages *messages, size_t first);

void db_reader_clear(struct db_reader *reader);

/* The first section of this name and title that was not refused, or DB_READER_NO_SECTION. */
size_t db_reader_find_section(const struct db_reader *reader, const char *name, const char *title);

/* The key of this name in the section, else in its base, unless it was refused; else null. */
struct db_reader_key *db_reader_find_key(const struct db_reader *reader, size_t section,
                                         const char *name);

#endif
