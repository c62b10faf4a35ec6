/* SPDX-License-Identifier: Apache-2.0 */
#include "reader/messages.h"

#include <stdarg.h>
#include <stdlib.h>

#define PRINTED_MAX 20

/* Takes over the text; null: there was no memory for it. */
static void add_message(struct db_messages *messages, unsigned line, bool warning, char *text)
{
	struct db_message *list = NULL;

	if (text)
		list = realloc(messages->list, (messages->count + 1) * sizeof(*list));
	if (!list) {
		free(text);
		messages->errors += warning;
		return;
	}
	/* The contents of a file must not affect the terminal that shows the message. */
	for (char *at = text; *at; at++) {
		unsigned char byte = (unsigned char)*at;

		if (byte < 0x20 || byte == 0x7F)
			*at = '?';
	}
	messages->list = list;
	list[messages->count] = (struct db_message){
		.line = line, .warning = warning, .order = messages->count, .text = text
	};
	messages->count++;
}

void db_messages_add_error(struct db_messages *messages, unsigned line, const char *format, ...)
{
	va_list arguments;
	char *text;

	messages->errors++;
	va_start(arguments, format);
	if (vasprintf(&text, format, arguments) < 0)
		text = NULL;
	va_end(arguments);
	add_message(messages, line, false, text);
}

void db_messages_add_warning(struct db_messages *messages, unsigned line, const char *format, ...)
{
	va_list arguments;
	char *text;

	va_start(arguments, format);
	if (vasprintf(&text, format, arguments) < 0)
		text = NULL;
	va_end(arguments);
	add_message(messages, line, true, text);
}

const struct db_source *db_messages_find_source(const struct db_messages *messages, unsigned line)
{
	const struct db_source *found = messages->sources;

	for (size_t i = 0; i < messages->source_count; i++) {
		if (line > messages->sources[i].lines_before)
			found = &messages->sources[i];
	}
	return found;
}

struct db_line_name db_messages_name_line(const struct db_messages *messages, unsigned line)
{
	const struct db_source *source = db_messages_find_source(messages, line);
	struct db_line_name name;

	if (messages->source_count < 2)
		snprintf(name.text, sizeof(name.text), "line %u", line);
	else
		snprintf(name.text, sizeof(name.text), "line %u of %s", line - source->lines_before,
		         source->path);
	return name;
}

static int compare_messages(const void *left, const void *right)
{
	const struct db_message *a = left, *b = right;

	if (a->line != b->line)
		return a->line < b->line ? -1 : 1;
	return (a->order > b->order) - (a->order < b->order);
}

/* Prints the first ones of a kind; returns the number left out. */
static size_t print_first(const struct db_messages *messages, bool warnings, FILE *out)
{
	size_t count = 0;

	for (size_t i = 0; i < messages->count; i++) {
		const struct db_message *message = &messages->list[i];
		const struct db_source *source = db_messages_find_source(messages, message->line);

		if (message->warning != warnings || count++ >= PRINTED_MAX)
			continue;
		fprintf(out, "%s:", source->path);
		if (message->line > 0)
			fprintf(out, "%u:", message->line - source->lines_before);
		fprintf(out, "%s %s\n", warnings ? " warning:" : "", message->text);
	}
	return count > PRINTED_MAX ? count - PRINTED_MAX : 0;
}

void db_messages_print(struct db_messages *messages, FILE *out)
{
	const char *path = messages->sources[0].path;
	size_t more;

	if (messages->count > 0)
		qsort(messages->list, messages->count, sizeof(*messages->list), compare_messages);
	more = print_first(messages, false, out);
	if (more > 0)
		fprintf(out, "%s: %zu more error%s; mend these first\n", path, more,
		        more == 1 ? "" : "s");
	more = print_first(messages, true, out);
	if (more > 0)
		fprintf(out, "%s: warning: %zu more warning%s\n", path, more, more == 1 ? "" : "s");
	if (messages->errors > 0 && messages->count == 0)
		fprintf(out, "%s: out of memory while reading it; free some and try again\n", path);
}

void db_messages_clear(struct db_messages *messages)
{
	for (size_t i = 0; i < messages->count; i++)
		free(messages->list[i].text);
	free(messages->list);
	*messages = (struct db_messages){ 0 };
}
