/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Errors and warnings about a file, collected while it is read and printed in the order of its
 * lines.
 */
#ifndef DRIVEBRIDGE_CONFIG_REPORT_H
#define DRIVEBRIDGE_CONFIG_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

struct db_config_source;

struct db_report_entry {
	unsigned line; /* counted through all files; 0 = the files as a whole */
	bool warning;
	size_t order;
	char *text;
};

struct db_report {
	/* Whose lines are counted, one file behind the other; not the report's own. */
	struct db_config_source *sources;
	size_t source_count;
	struct db_report_entry *entries;
	size_t count;
	size_t errors; /* those that make the file unusable; running out of memory is one */
};

/* "what is wrong; what would be right", without file and line. */
void db_report_error(struct db_report *report, unsigned line, const char *format, ...)
	__attribute__((format(printf, 3, 4)));
void db_report_warning(struct db_report *report, unsigned line, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* The file that has this line; the first where lines are not of files. */
const struct db_config_source *db_report_source(const struct db_report *report, unsigned line);

/* A line for people. */
struct db_place {
	char text[300];
};

/* "line 12", or with several files "line 12 of PATH". */
struct db_place db_report_place(const struct db_report *report, unsigned line);

/* How many errors so far, to find out whether a step found any. */
size_t db_report_errors(const struct db_report *report);

/* The first twenty errors and the first twenty warnings, and how many more there are. `file` is what is
 * named where there is no line. */
void db_report_print(struct db_report *report, const char *file, FILE *out);
void db_report_clear(struct db_report *report);

#endif
