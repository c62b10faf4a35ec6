/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/trace_text.h"
#include "words/value.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define ID_EXTENDED 0x80000000u
#define ID_REMOTE 0x40000000u
#define ID_ERROR 0x20000000u

struct text {
	char *bytes;
	size_t size;
	size_t used;
};

__attribute__((format(printf, 2, 3))) static void add(struct text *text, const char *format, ...)
{
	va_list arguments;
	int length;

	va_start(arguments, format);
	length = vsnprintf(text->bytes + text->used, text->size - text->used, format, arguments);
	va_end(arguments);
	if (length > 0)
		text->used += (size_t)length < text->size - text->used ?
		                      (size_t)length :
		                      text->size - text->used - 1;
}

/* The drive's name, or its address; "" for a record without one. */
static void write_who(const json_t *record, char *who, size_t size)
{
	const char *drive = db_words_text(record, "drive");
	const json_t *address = json_object_get(record, "address");

	if (drive[0] != '\0')
		snprintf(who, size, "%s", drive);
	else if (!address || json_is_null(address))
		who[0] = '\0';
	else if (json_integer_value(address) == 0)
		snprintf(who, size, "all drives");
	else
		snprintf(who, size, "address %d", (int)json_integer_value(address));
	db_words_clean(who);
}

static void write_words(const struct db_capture_questions *questions, const json_t *record,
                        char *text, size_t size)
{
	json_int_t question = db_words_number(record, "question");
	size_t place = (size_t)question % DB_CAPTURE_TRACE_QUESTIONS;
	bool known = question > 0 && questions->asked[place].number == question;
	double ms = known ? (double)(db_words_number(record, "time_us") -
	                             questions->asked[place].time_us) /
	                            1000.0 :
	                    0.0;
	struct text out = { .bytes = text, .size = size };
	char who[80];

	text[0] = '\0';
	write_who(record, who, sizeof(who));
	if (strcmp(db_words_text(record, "kind"), "unanswered") == 0) {
		if (known)
			add(&out, "%s%sno answer to \"%s\" within %.3f ms",
			    questions->asked[place].who, questions->asked[place].who[0] ? ": " : "",
			    questions->asked[place].words, ms);
		else
			add(&out, "no answer");
		return;
	}
	add(&out, "%s%s%s", who, who[0] ? ": " : "", db_words_text(record, "words"));
	if (known)
		add(&out, " (%.3f ms)", ms);
	db_words_clean(text);
}

void db_capture_trace_take(struct db_capture_questions *questions, const json_t *record,
                           char *words, size_t size)
{
	json_int_t number;
	size_t place;

	write_words(questions, record, words, size);
	number = db_words_number(record, "number");
	place = (size_t)number % DB_CAPTURE_TRACE_QUESTIONS;
	if (strcmp(db_words_text(record, "direction"), "sent") != 0)
		return;
	questions->asked[place].number = number;
	questions->asked[place].time_us = db_words_number(record, "time_us");
	write_who(record, questions->asked[place].who, sizeof(questions->asked[place].who));
	snprintf(questions->asked[place].words, sizeof(questions->asked[place].words), "%s",
	         db_words_text(record, "words"));
	db_words_clean(questions->asked[place].words);
}

void db_capture_trace_write_bytes(const json_t *record, char *text, size_t size)
{
	const char *data = db_words_text(record, "data");
	const json_t *id = json_object_get(record, "id");
	uint32_t flags = (uint32_t)json_integer_value(id);
	struct text out = { .bytes = text, .size = size };

	text[0] = '\0';
	if (!json_is_string(json_object_get(record, "data")))
		return;
	if (json_is_integer(id)) {
		add(&out, flags & (ID_EXTENDED | ID_ERROR) ? "%08X#%s%s" : "%03X#%s%s",
		    flags & ~(ID_EXTENDED | ID_REMOTE), flags & ID_REMOTE ? "R" : "", data);
		return;
	}
	for (; data[0] != '\0' && data[1] != '\0'; data += 2)
		add(&out, "%s%.2s", out.used > 0 ? " " : "", data);
}

void db_capture_trace_write_head(const json_t *bus, json_int_t time_us, char *text, size_t size)
{
	time_t seconds = (time_t)(time_us / 1000000);
	char day[64] = "";
	struct tm local;

	if (localtime_r(&seconds, &local))
		(void)strftime(day, sizeof(day), "%Y-%m-%d, time of day at UTC %z", &local);
	snprintf(text, size, "# drivebridge trace\n# bus %s: %s, %s at %lld bit/s\n# %s\n",
	         db_words_text(bus, "name"), db_words_text(bus, "protocol"),
	         db_words_text(bus, "device"), (long long)db_words_number(bus, "speed"), day);
}

void db_capture_trace_write_line(const json_t *record, const char *words, char *text, size_t size)
{
	const char *direction = db_words_text(record, "direction");
	const char *kind = db_words_text(record, "kind");
	json_int_t us = db_words_number(record, "time_us");
	time_t seconds = (time_t)(us / 1000000);
	struct text out = { .bytes = text, .size = size };
	char when[16] = "";
	struct tm local;

	if (localtime_r(&seconds, &local))
		(void)strftime(when, sizeof(when), "%H:%M:%S", &local);
	add(&out, "%s.%06d %s %-10s %s", when, (int)(us % 1000000),
	    direction[0] == 's'             ? ">" :
	    direction[0] == 'r'             ? "<" :
	    strcmp(kind, "unanswered") == 0 ? "!" :
	                                      "=",
	    kind, words);
	if (!json_is_string(json_object_get(record, "data")))
		return;
	add(&out, " | ");
	db_capture_trace_write_bytes(record, text + out.used, size - out.used);
}
