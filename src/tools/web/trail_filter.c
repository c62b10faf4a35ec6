/* SPDX-License-Identifier: Apache-2.0 */
#include "web/trail_filter.h"
#include "capture/audit_text.h"
#include "words/value.h"

#include <stdlib.h>
#include <string.h>

static bool read_text(const json_t *parameters, const char *name, char text[DB_WEB_TRAIL_TEXT])
{
	const json_t *value = json_object_get(parameters, name);

	text[0] = '\0';
	if (!value)
		return true;
	if (!json_is_string(value) || json_string_length(value) >= DB_WEB_TRAIL_TEXT ||
	    strlen(json_string_value(value)) != json_string_length(value))
		return false;
	strcpy(text, json_string_value(value));
	return true;
}

static bool read_time(const json_t *parameters, const char *name, json_int_t *us)
{
	const json_t *value = json_object_get(parameters, name);

	*us = json_integer_value(value);
	return !value || (json_is_integer(value) && *us >= 0);
}

bool db_web_trail_filter_read(struct db_web_trail_filter *filter, const json_t *parameters)
{
	filter->refused = json_is_true(json_object_get(parameters, "refused"));
	return read_text(parameters, "who", filter->who) &&
	       read_text(parameters, "drive", filter->drive) &&
	       read_text(parameters, "kind", filter->kind) &&
	       read_text(parameters, "through", filter->way) &&
	       read_text(parameters, "text", filter->text) &&
	       read_time(parameters, "since_us", &filter->since_us) &&
	       read_time(parameters, "until_us", &filter->until_us);
}

json_t *db_web_trail_filter_query(const struct db_web_trail_filter *filter, json_int_t from)
{
	return json_pack("{s:I, s:I, s:s, s:s, s:b}", "from", from, "since_us", filter->since_us,
	                 "drive", filter->drive, "who", filter->who, "refused", filter->refused);
}

bool db_web_trail_filter_has(const struct db_web_trail_filter *filter, const json_t *record)
{
	json_int_t time_us = json_integer_value(json_object_get(record, "time_us"));
	char *line;
	bool found;

	if (!db_grant_has(&filter->grant, DB_MAY_AUDIT, db_words_text(record, "drive")) ||
	    (filter->until_us != 0 && time_us > filter->until_us) ||
	    (filter->kind[0] != '\0' && strcmp(filter->kind, db_words_text(record, "kind")) != 0) ||
	    (filter->way[0] != '\0' && strcmp(filter->way, db_capture_audit_way(record)) != 0))
		return false;
	if (filter->text[0] == '\0')
		return true;
	line = db_capture_audit_describe(record);
	found = line && strcasestr(line, filter->text);
	free(line);
	return found || strcasestr(db_words_text(record, "result"), filter->text);
}

void db_web_trail_describe(json_t *record)
{
	char *line = db_capture_audit_describe(record);

	(void)json_object_set_new(record, "line", json_string(line ? line : "?"));
	(void)json_object_set_new(record, "through", json_string(db_capture_audit_way(record)));
	(void)json_object_set_new(record, "failed",
	                          json_boolean(db_capture_audit_is_refused(record)));
	free(line);
}
