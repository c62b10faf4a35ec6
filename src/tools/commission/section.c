/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/section.h"
#include "reader/reader.h"
#include "reader/source.h"

#include <ctype.h>
#include <glob.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

static json_t *read_key(const struct db_reader_key *key)
{
	json_t *list = json_array();
	const char *at = key->values;

	for (size_t i = 0; i < key->count && at; i++) {
		(void)json_array_append_new(list, json_string(at));
		at += strlen(at) + 1;
	}
	if (!key->list && json_array_size(list) == 1) {
		json_t *one = json_incref(json_array_get(list, 0));

		json_decref(list);
		return one;
	}
	return list;
}

/* NULL: this file does not have the section. */
static json_t *read_file(const char *path, const char *section, const char *name, FILE *errors)
{
	static const struct db_reader_rules rules = { .sections = "bus NAME or drive NAME" };
	char *text = db_file_read(path, errors);
	struct db_source *source = text ? db_sources_of_text(path, text) : NULL;
	struct db_messages messages = { .sources = source, .source_count = 1 };
	struct db_reader reader = { .sections = NULL };
	json_t *keys = NULL;
	size_t at;

	free(text);
	if (!source)
		return NULL;
	db_sources_count_lines(source, 1);
	/* A syntax error is left to drivebridgectl check: the lines before it count. */
	(void)db_reader_read(&reader, &rules, &messages);
	at = db_reader_find_section(&reader, section, name);
	if (at != DB_READER_NO_SECTION) {
		keys = json_object();
		for (size_t i = 0; i < reader.key_count; i++) {
			if (reader.keys[i].section == at)
				(void)json_object_set_new(keys, reader.keys[i].name,
				                          read_key(&reader.keys[i]));
		}
	}
	db_reader_clear(&reader);
	db_messages_clear(&messages);
	db_sources_free(source, 1);
	return keys;
}

json_t *db_commission_section_read(const char *path, const char *section, const char *name,
                                   char *problem, size_t size)
{
	char pattern[PATH_MAX];
	/* As the service reads them: of root, and the one that is edited over the page. */
	static const struct {
		const char *folder;
		const char *files;
	} others[] = { { "conf.d", "*.conf" }, { "edited", "edited.conf" } };
	const char *slash = strrchr(path, '/');
	char *said = NULL;
	size_t length = 0;
	FILE *errors = open_memstream(&said, &length);
	json_t *keys = NULL;

	if (!errors)
		return NULL;
	keys = read_file(path, section, name, errors);
	for (size_t other = 0; other < sizeof(others) / sizeof(others[0]) && !keys; other++) {
		glob_t found = { .gl_pathc = 0 };

		snprintf(pattern, sizeof(pattern), "%.*s%s/%s", slash ? (int)(slash - path) + 1 : 0,
		         path, others[other].folder, others[other].files);
		if (glob(pattern, 0, NULL, &found) == 0) {
			for (size_t i = 0; i < found.gl_pathc && !keys; i++)
				keys = read_file(found.gl_pathv[i], section, name, errors);
		}
		globfree(&found);
	}
	(void)fclose(errors);
	snprintf(problem, size, "%s%s", said && said[0] ? said : "it is not in ",
	         said && said[0] ? "" : path);
	problem[strcspn(problem, "\n")] = '\0';
	free(said);
	return keys;
}

/* In the reader's form: without quotes where possible. */
static void write_word(FILE *out, const char *text)
{
	bool bare = text[0] != '\0';

	for (const char *at = text; *at; at++)
		bare = bare && (isalnum((unsigned char)*at) || strchr("._-:/", *at));
	fprintf(out, bare ? "%s" : "\"%s\"", text);
}

static void write_value(FILE *out, const json_t *value)
{
	size_t i;
	const json_t *word;

	if (json_is_string(value)) {
		write_word(out, json_string_value(value));
		return;
	}
	fputs("{ ", out);
	json_array_foreach(value, i, word)
	{
		write_word(out, json_string_value(word));
		fputs(" ", out);
	}
	fputs("}", out);
}

/* The verdict that changes this key, or NULL. */
static const json_t *find_change(const json_t *verdicts, const char *section, const char *key)
{
	size_t i;
	const json_t *verdict;

	json_array_foreach(verdicts, i, verdict)
	{
		const char *place = json_string_value(json_object_get(verdict, "section"));
		const char *setting = json_string_value(json_object_get(verdict, "setting"));

		if (place && setting && strcmp(place, section) == 0 &&
		    (!key || strcmp(setting, key) == 0) &&
		    json_is_string(json_object_get(verdict, "right")))
			return verdict;
	}
	return NULL;
}

bool db_commission_section_changes(const char *section, const json_t *verdicts)
{
	return find_change(verdicts, section, NULL) != NULL;
}

static void write_change(FILE *out, const json_t *verdict)
{
	const char *now = json_string_value(json_object_get(verdict, "now"));

	fprintf(out, "    # %s%s: %s\n    %s = ", now && now[0] ? "was " : "was not given",
	        now ? now : "", json_string_value(json_object_get(verdict, "how")),
	        json_string_value(json_object_get(verdict, "setting")));
	write_value(out, json_object_get(verdict, "right"));
	fputs("\n", out);
}

void db_commission_section_write(FILE *out, const char *section, const char *name, json_t *keys,
                                 const json_t *verdicts)
{
	const char *key;
	const json_t *value;
	const json_t *verdict;
	size_t i;

	fprintf(out, "%s %s {\n", section, name);
	json_object_foreach(keys, key, value)
	{
		verdict = find_change(verdicts, section, key);
		if (verdict) {
			write_change(out, verdict);
			continue;
		}
		fprintf(out, "    %s = ", key);
		write_value(out, value);
		fputs("\n", out);
	}
	json_array_foreach(verdicts, i, verdict)
	{
		const char *setting = json_string_value(json_object_get(verdict, "setting"));

		if (setting && find_change(verdicts, section, setting) == verdict &&
		    !json_object_get(keys, setting))
			write_change(out, verdict);
	}
	fputs("}\n", out);
}
