/* SPDX-License-Identifier: Apache-2.0 */
#include "client/troubles.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

/* `kind` holds the records by their names. */
static void take_records(json_t **kept, json_t *records, const char *kind)
{
	size_t i;
	json_t *record;

	if (!*kept)
		*kept = json_object();
	json_array_foreach(records, i, record)
	{
		const char *name = json_string_value(json_object_get(record, kind));

		if (name)
			(void)json_object_set(*kept, name, record);
	}
}

void db_client_troubles_take(struct db_client_troubles *troubles, json_t *answer)
{
	take_records(&troubles->drives, json_object_get(answer, "drives"), "drive");
	take_records(&troubles->buses, json_object_get(answer, "buses"), "bus");
	json_decref(troubles->configuration);
	troubles->configuration = json_incref(json_object_get(answer, "configuration"));
	troubles->told = true;
	troubles->well = json_is_true(json_object_get(answer, "well"));
}

void db_client_troubles_clear(struct db_client_troubles *troubles)
{
	json_decref(troubles->drives);
	json_decref(troubles->buses);
	json_decref(troubles->configuration);
	*troubles = (struct db_client_troubles){ .told = false };
}

bool db_client_troubles_are_missing(const struct db_client_error *error)
{
	return error && strcmp(error->name, "org.varlink.service.MethodNotFound") == 0;
}

const char *const db_client_needs[] = { "nothing", "hint", "look", "act" };

enum db_client_need db_client_trouble_need(const json_t *record)
{
	const char *need = db_words_text(record, "need");
	size_t at = DB_CLIENT_FINE;

	if (!record)
		return DB_CLIENT_FINE;
	while (at < DB_CLIENT_ACT && strcmp(db_client_needs[at], need) != 0)
		at++;
	return (enum db_client_need)at;
}

void db_client_trouble_words(const json_t *record, char text[DB_CLIENT_TROUBLE_WORDS_MAX])
{
	const char *cause = db_words_text(record, "cause");
	const char *detail = db_words_text(record, "detail");

	if (strcmp(cause, "none") == 0)
		cause = "";
	if (strcmp(cause, "fault") == 0 && detail[0])
		snprintf(text, DB_CLIENT_TROUBLE_WORDS_MAX, "%s", detail);
	else
		snprintf(text, DB_CLIENT_TROUBLE_WORDS_MAX, "%s%s%s%s", cause,
		         detail[0] ? " (" : "", detail, detail[0] ? ")" : "");
}
