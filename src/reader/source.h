/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The texts that a configuration is read from: one file, or several that count as one. Lines are
 * counted through all of them. Pure.
 */
#ifndef DRIVEBRIDGE_READER_SOURCE_H
#define DRIVEBRIDGE_READER_SOURCE_H

#include <stdbool.h>
#include <stddef.h>

struct db_source {
	char *path;
	char *text;            /* as it was read; null once nobody needs it any more */
	unsigned lines_before; /* in the texts before it */
	bool ended;            /* its last line is `end` */
};

/* One source with copies of both. Null when out of memory. */
struct db_source *db_sources_of_text(const char *path, const char *text);

/* Fills lines_before of each: the line end that a text may lack counts. */
void db_sources_count_lines(struct db_source *sources, size_t count);

/* Frees the texts, which are read once; paths and marks stay. */
void db_sources_forget_texts(struct db_source *sources, size_t count);

void db_sources_free(struct db_source *sources, size_t count);

#endif
