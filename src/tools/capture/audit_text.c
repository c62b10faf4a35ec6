/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/audit_text.h"
#include "drivebridge/version.h"
#include "words/value.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* How grave it is, in the Common Event Format: 0 to 10. */
#define CEF_USUAL 3
#define CEF_REFUSED 6

/* --- one record ------------------------------------------------------------------------------- */

bool db_capture_audit_is_refused(const json_t *record)
{
	static const char *const good[] = { "", "ok", "unproven", "pending" };
	const char *result = db_words_text(record, "result");

	for (size_t i = 0; i < sizeof(good) / sizeof(good[0]); i++) {
		if (strcmp(result, good[i]) == 0)
			return strcmp(db_words_text(record, "kind"), "denied") == 0;
	}
	return true;
}

char *db_capture_audit_describe(const json_t *record)
{
	const char *kind = db_words_text(record, "kind");
	const char *what = db_words_text(record, "what");
	const json_t *part;
	const char *name;
	size_t size = 0;
	char *text = NULL;
	FILE *out = open_memstream(&text, &size);

	if (!out)
		return NULL;
	if (strcmp(kind, "command") == 0)
		fputs(what, out);
	else
		fprintf(out, "%s%s%s", kind, what[0] ? ": " : "", what);
	json_object_foreach((json_t *)(uintptr_t)json_object_get(record, "arguments"), name, part)
	{
		char *value = json_dumps(part,
		                         JSON_ENCODE_ANY | JSON_COMPACT | JSON_REAL_PRECISION(9));

		fprintf(out, " %s=%s", name, value ? value : "?");
		free(value);
	}
	json_object_foreach((json_t *)(uintptr_t)json_object_get(record, "values"), name, part)
	{
		char *old = json_dumps(json_array_get(part, 0),
		                       JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));
		char *new = json_dumps(json_array_get(part, 1),
		                       JSON_ENCODE_ANY | JSON_REAL_PRECISION(9));

		fprintf(out, " %s %s -> %s", name, old ? old : "?", new ? new : "?");
		free(old);
		free(new);
	}
	if (json_object_get(record, "register"))
		fprintf(out, " register %lld",
		        (long long)json_integer_value(json_object_get(record, "register")));
	if (json_object_get(record, "unit"))
		fprintf(out, " unit %lld",
		        (long long)json_integer_value(json_object_get(record, "unit")));
	if (json_object_get(record, "endpoint"))
		fprintf(out, " endpoint %s", db_words_text(record, "endpoint"));
	if (json_object_get(record, "count"))
		fprintf(out, " %lld times",
		        (long long)json_integer_value(json_object_get(record, "count")));
	if (json_object_get(record, "of"))
		fprintf(out, " (of %lld)",
		        (long long)json_integer_value(json_object_get(record, "of")));
	if (db_words_text(record, "text")[0])
		fprintf(out, "%s %s", what[0] ? "," : "", db_words_text(record, "text"));
	(void)fclose(out);
	if (text)
		db_words_clean(text);
	return text;
}

/* --- ways ------------------------------------------------------------------------------------ */

const char *const db_capture_audit_ways[] = { "page",           "OPC UA",  "MQTT",
	                                      "control socket", "Modbus",  "Modbus over TLS",
	                                      "Modbus RTU",     "service", NULL };

/* From the words alone: the end of a command has nothing else. */
const char *db_capture_audit_way(const json_t *record)
{
	static const char *const tools[] = { ", page", ", OPC UA", ", MQTT" };
	const char *who = db_words_text(record, "who");

	if (strcmp(who, "drivebridged") == 0 || who[0] == '\0')
		return "service";
	if (strncmp(who, "control", strlen("control")) != 0)
		return strstr(who, ", certificate ") ? "Modbus over TLS" :
		       strncmp(who, "rtu ", 4) == 0  ? "Modbus RTU" :
		                                       "Modbus";
	/* What the tool says comes last: before it stands what users call themselves. */
	for (const char *at = who + strlen(who); at > who; at--) {
		for (size_t i = 0; i < sizeof(tools) / sizeof(tools[0]); i++) {
			if (strncmp(at, tools[i], strlen(tools[i])) == 0)
				return db_capture_audit_ways[i];
		}
	}
	return "control socket";
}

/* --- Common Event Format ---------------------------------------------------------------------- */

/* In the extension = and \ are written with a \ before them, in the head | instead of =. */
static void put_cef(FILE *out, const char *text, char special)
{
	for (; *text; text++) {
		if (*text == special || *text == '\\')
			fputc('\\', out);
		if ((unsigned char)*text >= ' ')
			fputc(*text, out);
	}
}

static void put_cef_field(FILE *out, const char *key, const char *value)
{
	if (value[0] == '\0')
		return;
	fprintf(out, " %s=", key);
	put_cef(out, value, '=');
}

void db_capture_audit_write_cef(const json_t *record, FILE *out)
{
	const char *kind = db_words_text(record, "kind");
	const char *what = db_words_text(record, "what");
	char *line = db_capture_audit_describe(record);
	json_int_t time_us = json_integer_value(json_object_get(record, "time_us"));
	json_int_t port = json_integer_value(json_object_get(record, "port"));

	fprintf(out, "CEF:0|drivebridge|drivebridged|" DB_VERSION "|");
	put_cef(out, kind, '|');
	fputc('|', out);
	put_cef(out, what[0] ? what : kind, '|');
	fprintf(out, "|%d|rt=%lld externalId=%lld",
	        db_capture_audit_is_refused(record) ? CEF_REFUSED : CEF_USUAL,
	        (long long)(time_us / 1000),
	        (long long)json_integer_value(json_object_get(record, "number")));
	put_cef_field(out, "src", db_words_text(record, "address"));
	if (port > 0 && db_words_text(record, "address")[0])
		fprintf(out, " spt=%lld", (long long)port);
	put_cef_field(out, "suser",
	              db_words_text(record, "user")[0] ? db_words_text(record, "user") :
	                                                 db_words_text(record, "login"));
	put_cef_field(out, "outcome", db_words_text(record, "result"));
	if (db_words_text(record, "drive")[0]) {
		put_cef_field(out, "cs1Label", "drive");
		put_cef_field(out, "cs1", db_words_text(record, "drive"));
	}
	put_cef_field(out, "cs2Label", "who");
	put_cef_field(out, "cs2", db_words_text(record, "who"));
	put_cef_field(out, "msg", line ? line : "");
	fputc('\n', out);
	free(line);
}
