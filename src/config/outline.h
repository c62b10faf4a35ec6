/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The outline of a configuration text: which sections and keys stand on which line.
 *
 * libconfuse reads the values, but it forgets where a key stood, gives up at the first unknown key,
 * lets the last of two keys or sections of one name win without a word, miscounts lines after a
 * block comment and takes no comments inside lists. So this pass goes first: it finds the places,
 * checks the form, and blanks comments and everything that was refused, so that libconfuse goes on
 * to the values of the rest.
 */
#ifndef DRIVEBRIDGE_CONFIG_OUTLINE_H
#define DRIVEBRIDGE_CONFIG_OUTLINE_H

#include "config/report.h"

#include <stdbool.h>
#include <stddef.h>

struct db_driver;

#define DB_OUTLINE_TOP ((size_t)-1) /* a key outside of every section */

struct db_outline_key {
	char *name;
	unsigned line;
	size_t section; /* index, or DB_OUTLINE_TOP */
	size_t begin;   /* bytes of the text it takes, value included */
	size_t end;
	bool list; /* the value stands in braces */
	bool refused;
};

struct db_outline_section {
	char *name;
	char *title; /* "" when it has none */
	unsigned line;
	size_t begin;
	size_t end;
	bool refused;
};

struct db_outline {
	struct db_outline_section *sections;
	size_t section_count;
	struct db_outline_key *keys;
	size_t key_count;
};

/*
 * Reads the text, blanks its comments, and checks its sections and keys against the table of keys
 * and the options of these drivers (a null-terminated list). What is wrong goes to the report and is blanked. False: the form is broken (reported, with the
 * outline as far as it came), or no memory; the text is then not to be given to libconfuse.
 */
bool db_outline_read(const struct db_driver *const *drivers, char *text, struct db_outline *outline,
                     struct db_report *report);
void db_outline_clear(struct db_outline *outline);

/* Line of a key of a section that was not refused, or 0. */
unsigned db_outline_key_line(const struct db_outline *outline, size_t section, const char *name);

/* Index of the section of this name and title that was not refused, or DB_OUTLINE_TOP. */
size_t db_outline_section_find(const struct db_outline *outline, const char *name,
                               const char *title);

#endif
