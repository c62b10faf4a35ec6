/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The texts that a configuration is read from: one file, or several that count as one. Lines are
 * counted through all of them. Pure, except for the reading of a file.
 */
#ifndef DRIVEBRIDGE_READER_SOURCE_H
#define DRIVEBRIDGE_READER_SOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/*
 * The text of a configuration file, of 1 MiB at most. Null after a message to `errors`: it cannot
 * be read, is no regular file, no text (UTF-16, zero bytes), too long, or is being written. To be
 * freed.
 */
char *db_file_read(const char *path, FILE *errors);

/* "PATH: why", with what to do about it. `error`: an errno. */
void db_file_explain(const char *path, int error, FILE *errors);

struct db_source {
	char *path;
	char *text;            /* as it was read; null once it is no longer needed */
	unsigned lines_before; /* number of lines in the texts before it */
	bool ended;            /* its last line is `end` */
	bool profile;          /* it was read because another source names it */
	bool edited;           /* clients of the service write it: not all sections are theirs */
};

/* One source with copies of both. Null when out of memory. */
struct db_source *db_sources_of_text(const char *path, const char *text);

/* Fills lines_before of each: a missing line end at the end of a text counts. */
void db_sources_count_lines(struct db_source *sources, size_t count);

/* Frees the texts, which are read once; paths and marks stay. */
void db_sources_forget_texts(struct db_source *sources, size_t count);

void db_sources_free(struct db_source *sources, size_t count);

#endif
