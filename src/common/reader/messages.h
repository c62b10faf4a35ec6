/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Messages about a configuration, collected while it is read and printed in the order of its lines:
 * errors, which make it unusable, and warnings. Running out of memory for a message is an error.
 */
#ifndef DRIVEBRIDGE_READER_MESSAGES_H
#define DRIVEBRIDGE_READER_MESSAGES_H

#include "reader/source.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

struct db_message {
	unsigned line; /* counted through all sources; 0 = the configuration as a whole */
	bool warning;
	size_t order;
	char *text;
};

struct db_messages {
	struct db_source *sources; /* the sources whose lines are counted; not owned */
	size_t source_count;
	struct db_message *list;
	size_t count;
	size_t errors; /* number so far: a step compares it to know whether it found any */
};

/* "what is wrong; what would be right", without file and line. */
void db_messages_add_error(struct db_messages *messages, unsigned line, const char *format, ...)
	__attribute__((format(printf, 3, 4)));
void db_messages_add_warning(struct db_messages *messages, unsigned line, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* The source that has this line. */
const struct db_source *db_messages_find_source(const struct db_messages *messages, unsigned line);

/* A line's name for people. */
struct db_line_name {
	char text[300];
};

/* "line 12", or with several sources "line 12 of PATH". */
struct db_line_name db_messages_name_line(const struct db_messages *messages, unsigned line);

/* "PATH:LINE: text" each: the first twenty errors and the first twenty warnings, and how many more
 * there are. Messages without a line name the first path. */
void db_messages_print(struct db_messages *messages, FILE *out);

void db_messages_clear(struct db_messages *messages);

#endif
