/* SPDX-License-Identifier: Apache-2.0 */
#include "config/report.h"

#include "drivebridge/config.h"

#include <stdarg.h>
#include <stdlib.h>

#define DB_REPORT_MOST 20

/* What a file holds must not be able to play with the terminal that shows the message. */
static void make_printable(char *text)
{
	for (; *text; text++) {
		unsigned char c = (unsigned char)*text;

		if (c < 0x20 || c == 0x7F)
			*text = '?';
	}
}

static void add(struct db_report *report, unsigned line, bool warning, char *text)
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
	entries[report->count] = (struct db_report_entry){
		.line = line, .warning = warning, .order = report->count, .text = text
	};
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
		add(report, line, false, text);
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
		add(report, line, true, whole);
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

const struct db_config_source *db_report_source(const struct db_report *report, unsigned line)
{
	const struct db_config_source *found = report->sources;

	for (size_t i = 0; i < report->source_count; i++) {
		if (line > report->sources[i].lines_before)
			found = &report->sources[i];
	}
	return found;
}

struct db_place db_report_place(const struct db_report *report, unsigned line)
{
	const struct db_config_source *source = db_report_source(report, line);
	struct db_place place;

	if (report->source_count < 2)
		snprintf(place.text, sizeof(place.text), "line %u", line);
	else
		snprintf(place.text, sizeof(place.text), "line %u of %s",
		         line - source->lines_before, source->path);
	return place;
}

static void print_entry(const struct db_report *report, const struct db_report_entry *entry,
                        const char *file, FILE *out)
{
	const struct db_config_source *source = db_report_source(report, entry->line);

	if (entry->line == 0)
		fprintf(out, "%s: %s\n", file, entry->text);
	else
		fprintf(out, "%s:%u: %s\n", source ? source->path : file,
		        entry->line - (source ? source->lines_before : 0), entry->text);
}

/* Returns how many were left out. */
static size_t print_some(const struct db_report *report, const char *file, bool warnings, FILE *out)
{
	size_t count = 0;

	for (size_t i = 0; i < report->count; i++) {
		if (report->entries[i].warning == warnings && count++ < DB_REPORT_MOST)
			print_entry(report, &report->entries[i], file, out);
	}
	return count > DB_REPORT_MOST ? count - DB_REPORT_MOST : 0;
}

void db_report_print(struct db_report *report, const char *file, FILE *out)
{
	size_t errors;
	size_t warnings;

	if (report->count > 0)
		qsort(report->entries, report->count, sizeof(*report->entries), compare);
	errors = print_some(report, file, false, out);
	if (errors > 0)
		fprintf(out, "%s: %zu more error%s; mend these first\n", file, errors,
		        errors == 1 ? "" : "s");
	warnings = print_some(report, file, true, out);
	if (warnings > 0)
		fprintf(out, "%s: warning: %zu more warning%s\n", file, warnings,
		        warnings == 1 ? "" : "s");
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
