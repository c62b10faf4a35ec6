/* SPDX-License-Identifier: Apache-2.0 */
#include "params/writer.h"
#include "params/set.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

void db_params_writer_begin(struct db_params_writer *writer)
{
	writer->written = json_array();
	writer->failed = json_object();
}

void db_params_writer_clear(struct db_params_writer *writer)
{
	json_decref(writer->written);
	json_decref(writer->failed);
	writer->written = writer->failed = NULL;
}

json_t *db_params_writer_untried(const struct db_params_writer *writer)
{
	json_t *untried = json_array();
	size_t i;
	size_t at;
	const json_t *names;
	json_t *name;

	json_array_foreach(writer->plan, i, names)
	{
		json_array_foreach(names, at, name)
		{
			if (!db_params_has_name(writer->written, json_string_value(name)) &&
			    !json_object_get(writer->failed, json_string_value(name)))
				(void)json_array_append(untried, name);
		}
	}
	return untried;
}

size_t db_params_plan_size(const json_t *plan)
{
	size_t count = 0;
	size_t i;
	const json_t *names;

	json_array_foreach(plan, i, names)
	{
		count += json_array_size(names);
	}
	return count;
}

static void fail(struct db_params_writer *writer, const char *name, const char *reason)
{
	(void)json_object_set_new(writer->failed, name, json_string(reason));
	writer->report(writer->data, name, "failed", reason, NULL);
}

/* Errors of varlink itself: the service does not know the call in this form. */
#define STANDARD "org.varlink.service."

static bool is_of_client(const struct db_client_error *error)
{
	return strncmp(error->name, DB_CLIENT_OWN, strlen(DB_CLIENT_OWN)) == 0;
}

/* Other parameters may succeed where this one failed, unless the drive or the service is gone, or
 * somebody else has the control. */
static void judge_error(struct db_params_writer *writer, const struct db_client_error *error)
{
	static const char *const gone[] = { "offline", "bus_down", "timeout", "indeterminate",
		                            "not_in_control" };
	static const char *const single[] = { DB_CLIENT_SERVICE "Refused",
		                              DB_CLIENT_SERVICE "BadValue",
		                              DB_CLIENT_SERVICE "Busy" };
	const char *result = db_words_text(error->parameters, "result");
	bool goes_on = false;

	for (size_t i = 0; i < sizeof(single) / sizeof(single[0]); i++)
		goes_on = goes_on || strcmp(error->name, single[i]) == 0;
	for (size_t i = 0; i < sizeof(gone) / sizeof(gone[0]); i++)
		goes_on = goes_on && strcmp(result, gone[i]) != 0;
	writer->lost = is_of_client(error);
	writer->for_good = strncmp(error->name, STANDARD, strlen(STANDARD)) == 0;
	if (!goes_on)
		snprintf(writer->over, sizeof(writer->over), "%s", error->text);
}

/* The group whose turn it is; NULL: there is none. */
static const json_t *group_of(struct db_params_writer *writer)
{
	const json_t *names = json_array_get(writer->plan, writer->at);
	size_t i;
	const json_t *name;

	if (writer->checked)
		return NULL;
	if (!names && !writer->again && json_object_size(writer->failed) > 0 &&
	    json_array_size(writer->written) > 0) {
		/* A drive may refuse a parameter because of another one, and accept it after that
		 * was written: so those that failed are tried twice. */
		writer->again = true;
		writer->at = 0;
		names = json_array_get(writer->plan, 0);
	}
	for (; names && writer->again; names = json_array_get(writer->plan, ++writer->at)) {
		json_array_foreach(names, i, name)
		{
			if (json_object_get(writer->failed, json_string_value(name)))
				return names;
		}
	}
	return names;
}

void db_params_writer_end(struct db_params_writer *writer, const char *why)
{
	const json_t *names = writer->over[0] == '\0' ? group_of(writer) : NULL;

	if (!names)
		return;
	snprintf(writer->over, sizeof(writer->over), "%s", why);
	fail(writer, json_string_value(json_array_get(names, 0)), why);
}

static bool is_secret(const struct db_params_writer *writer, const json_t *name)
{
	return db_params_has_trait(db_words_look_up(writer->registers, json_string_value(name)),
	                           "secret");
}

static json_t *write_group(const struct db_params_writer *writer, const json_t *names)
{
	json_t *parameters = json_pack("{s:s, s:{}}", "drive", writer->drive, "values");
	size_t i;
	const json_t *name;

	json_array_foreach(names, i, name)
	{
		(void)json_object_set(json_object_get(parameters, "values"),
		                      json_string_value(name),
		                      json_object_get(writer->values, json_string_value(name)));
		writer->report(writer->data, json_string_value(name), "writing", "", NULL);
	}
	if (writer->standing)
		(void)json_object_set_new(parameters, "standing", json_true());
	return parameters;
}

/* Secrets are not among them: they are never read. */
static void add_readable(const struct db_params_writer *writer, const json_t *names, json_t *read)
{
	size_t i;
	json_t *name;

	json_array_foreach(names, i, name)
	{
		if (!is_secret(writer, name))
			(void)json_array_append(read, name);
	}
}

const char *db_params_writer_next(struct db_params_writer *writer, json_t **parameters)
{
	bool writes = !writer->reads_back && writer->over[0] == '\0';
	const json_t *names = writes ? group_of(writer) : NULL;
	json_t *read;

	*parameters = NULL;
	if (names) {
		*parameters = write_group(writer, names);
		return "Write";
	}
	read = json_array();
	if (writer->reads_back) {
		add_readable(writer, json_array_get(writer->plan, writer->at), read);
	} else {
		add_readable(writer, writer->written, read);
		add_readable(writer, writer->kept, read);
		writer->checks = !writer->checked && !writer->lost && json_array_size(read) > 0;
		if (!writer->checks) {
			json_decref(read);
			return NULL;
		}
	}
	*parameters = json_pack("{s:s, s:o}", "drive", writer->drive, "names", read);
	return "Read";
}

/* The drive has taken a parameter, and now shows this value. */
static void conclude(struct db_params_writer *writer, json_t *name, const json_t *value)
{
	const char *called = json_string_value(name);
	char text[DB_WORDS_VALUE_MAX];
	char reason[DB_WORDS_VALUE_MAX + 32];
	bool secret = is_secret(writer, name);

	if (!secret && !json_is_number(value)) {
		fail(writer, called, "the drive does not tell it");
		return;
	}
	if (!secret && !db_params_agree(value, json_object_get(writer->values, called))) {
		db_words_write_value(db_words_look_up(writer->registers, called), value, text,
		                     sizeof(text));
		snprintf(reason, sizeof(reason), "the drive shows %s", text);
		fail(writer, called, reason);
		return;
	}
	snprintf(text, sizeof(text), "%s%s", writer->result,
	         secret ? "; it cannot be read back" : "");
	if (!db_params_has_name(writer->written, called))
		(void)json_array_append(writer->written, name);
	(void)json_object_del(writer->failed, called);
	writer->report(writer->data, called, "done", text, secret ? NULL : value);
}

static void forget(json_t *names, const char *name)
{
	size_t i;
	const json_t *item;

	json_array_foreach(names, i, item)
	{
		if (strcmp(json_string_value(item), name) == 0) {
			(void)json_array_remove(names, i);
			return;
		}
	}
}

/* What the drive shows at the end. A value that it does not tell then says nothing. */
static void check(struct db_params_writer *writer, const json_t *values)
{
	json_t *names = json_copy(writer->written);
	size_t i;
	const json_t *item;

	(void)json_array_extend(names, writer->kept);
	json_array_foreach(names, i, item)
	{
		const char *name = json_string_value(item);
		const json_t *value = json_object_get(values, name);
		char text[DB_WORDS_VALUE_MAX];
		char reason[DB_WORDS_VALUE_MAX + 64];

		if (!json_is_number(value) ||
		    db_params_agree(value, json_object_get(writer->values, name)))
			continue;
		db_words_write_value(db_words_look_up(writer->registers, name), value, text,
		                     sizeof(text));
		snprintf(reason, sizeof(reason),
		         "something has changed it since: the drive shows %s", text);
		forget(writer->written, name);
		fail(writer, name, reason);
		writer->changed = true;
	}
	json_decref(names);
}

void db_params_writer_take(struct db_params_writer *writer, const json_t *answer,
                           const struct db_client_error *error)
{
	const json_t *names = json_array_get(writer->plan, writer->at);
	const json_t *values = json_object_get(answer, "values");
	bool written = !writer->reads_back && answer;
	size_t readable = 0;
	size_t i;
	json_t *name;

	if (!answer && (!writer->checks || writer->over[0] == '\0'))
		judge_error(writer, error);
	if (writer->checks) {
		if (!answer && writer->over[0] == '\0')
			snprintf(writer->over, sizeof(writer->over), "%s", error->text);
		writer->lost = writer->lost || (!answer && is_of_client(error));
		check(writer, json_object_get(answer, "values"));
		writer->checks = false;
		writer->checked = true;
		return;
	}
	if (written) {
		snprintf(writer->result, sizeof(writer->result), "%s",
		         db_words_text(answer, "result"));
		json_array_foreach(names, i, name)
		{
			readable += !is_secret(writer, name);
		}
		writer->reads_back = readable > 0;
		if (writer->reads_back)
			return;
	}
	json_array_foreach(names, i, name)
	{
		if (written || writer->reads_back)
			conclude(writer, name, json_object_get(values, json_string_value(name)));
		else
			fail(writer, json_string_value(name), error->text);
	}
	writer->reads_back = false;
	writer->at++;
}
