/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Errors and warnings about a file, collected while it is read and printed in the order of its
 * lines.
 */
#ifndef DRIVEBRIDGE_CONFIG_REPORT_H
#define DRIVEBRIDGE_CONFIG_REPORT_H

#include <stddef.h>
#include <stdio.h>

struct db_report_entry {
	unsigned line; /* 0 = the file as a whole */
	size_t order;
	char *text;
};

struct db_report {
	struct db_report_entry *entries;
	size_t count;
	size_t errors; /* those that make the file unusable; running out of memory is one */
};

/* "what is wrong; what would be right", without file and line. */
void db_report_error(struct db_report *report, unsigned line, const char *format, ...)
	__attribute__((format(printf, 3, 4)));
void db_report_warning(struct db_report *report, unsigned line, const char *format, ...)
	__attribute__((format(printf, 3, 4)));

/* How many errors so far, to find out whether a step found any. */
size_t db_report_errors(const struct db_report *report);

void db_report_print(struct db_report *report, const char *file, FILE *out);
void db_report_clear(struct db_report *report);

#endif
