/* SPDX-License-Identifier: Apache-2.0 */
#include "config/report.h"

#include <stdarg.h>
#include <stdlib.h>

/* What a file holds must not be able to play with the terminal that shows the message. */
static void make_printable(char *text)
{
	for (; *text; text++) {
		unsigned char c = (unsigned char)*text;

		if (c < 0x20 || c == 0x7F)
			*text = '?';
	}
}

static void add(struct db_report *report, unsigned line, char *text)
{
	struct db_report_entry *entries;

	entries = realloc(report->entries, (report->count + 1) * sizeof(*entries));
	if (!entries) {
		free(text);
		report->errors++;
		return;
	}
	make_printable(text);
	report->entries = entries;
	entries[report->count] =
		(struct db_report_entry){ .line = line, .order = report->count, .text = text };
	report->count++;
}

void db_report_error(struct db_report *report, unsigned line, const char *format, ...)
{
	va_list arguments;
	char *text;
	int length;

	report->errors++;
	va_start(arguments, format);
	length = vasprintf(&text, format, arguments);
	va_end(arguments);
	if (length >= 0)
		add(report, line, text);
}

void db_report_warning(struct db_report *report, unsigned line, const char *format, ...)
{
	va_list arguments;
	char *text, *whole;
	int length;

	va_start(arguments, format);
	length = vasprintf(&text, format, arguments);
	va_end(arguments);
	if (length < 0)
		return;
	length = asprintf(&whole, "warning: %s", text);
	free(text);
	if (length >= 0)
		add(report, line, whole);
}

size_t db_report_errors(const struct db_report *report)
{
	return report->errors;
}

static int compare(const void *left, const void *right)
{
	const struct db_report_entry *a = left, *b = right;

	if (a->line != b->line)
		return a->line < b->line ? -1 : 1;
	return (a->order > b->order) - (a->order < b->order);
}

void db_report_print(struct db_report *report, const char *file, FILE *out)
{
	if (report->count > 0)
		qsort(report->entries, report->count, sizeof(*report->entries), compare);
	for (size_t i = 0; i < report->count; i++) {
		if (report->entries[i].line > 0)
			fprintf(out, "%s:%u: %s\n", file, report->entries[i].line,
			        report->entries[i].text);
		else
			fprintf(out, "%s: %s\n", file, report->entries[i].text);
	}
	if (report->errors > 0 && report->count == 0)
		fprintf(out, "%s: out of memory while reading it; free some and try again\n", file);
}

void db_report_clear(struct db_report *report)
{
	for (size_t i = 0; i < report->count; i++)
		free(report->entries[i].text);
	free(report->entries);
	*report = (struct db_report){ 0 };
}
