/* SPDX-License-Identifier: Apache-2.0 */
#include "reader/settings.h"
#include "reader/source.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const struct db_setting *find_row(const struct db_settings *settings, const char *section,
                                         const char *name)
{
	for (const struct db_setting *row = settings->form->keys; row->name; row++) {
		if (strcmp(row->section, section) == 0 && (!name || strcmp(row->name, name) == 0))
			return row;
	}
	return NULL;
}

static const struct db_reader_key *find_given(const struct db_settings *settings,
                                              const struct db_setting *row)
{
	size_t section = db_reader_find_section(&settings->reader, row->section, "");

	return db_reader_find_key(&settings->reader, section, row->name);
}

unsigned db_settings_line(const struct db_settings *settings, const char *section, const char *name)
{
	const struct db_setting *row = find_row(settings, section, name);
	const struct db_reader_key *given = row ? find_given(settings, row) : NULL;

	return given ? given->line : 0;
}

void db_settings_check_secret(struct db_settings *settings, const char *section, const char *name,
                              const char *path, const char *group)
{
	struct stat status;

	if (stat(path, &status) == 0 && (status.st_mode & (S_IROTH | S_IWOTH)) != 0)
		db_messages_add_error(
			settings->messages, db_settings_line(settings, section, name),
			"%s = %s can be read or written by everybody: chmod 0640 %s, and chgrp it "
			"to the group %s",
			name, path, path, group);
}

void db_settings_check_certificate(struct db_settings *settings, const char *section,
                                   const char *certificate_file, const char *key_file)
{
	if ((certificate_file[0] == '\0') != (key_file[0] == '\0'))
		db_messages_add_error(
			settings->messages,
			db_settings_line(settings, section,
		                         key_file[0] ? "key-file" : "certificate-file"),
			"certificate-file and key-file belong together; set both or none");
}

/* --- names ------------------------------------------------------------------------------------ */

static void check_name(struct db_settings *settings, struct db_reader_key *key)
{
	const struct db_reader_section *section = key->section == DB_READER_NO_SECTION ?
	                                                  NULL :
	                                                  &settings->reader.sections[key->section];
	char known[512] = "";
	size_t used = 0;

	if (section && section->refused)
		return;
	if (section && find_row(settings, section->name, key->name)) {
		for (const struct db_reader_key *other = settings->reader.keys; other < key;
		     other++) {
			if (other->section == key->section && strcmp(other->name, key->name) == 0) {
				db_messages_add_error(
					settings->messages, key->line,
					"%s is set on line %u already; remove one of them",
					key->name, other->line);
				key->refused = true;
				return;
			}
		}
		return;
	}
	key->refused = true;
	for (const struct db_setting *row = settings->form->keys; row->name; row++) {
		if (section && strcmp(row->section, section->name) == 0 && used < sizeof(known))
			used += (size_t)snprintf(known + used, sizeof(known) - used, " %s",
			                         row->name);
	}
	if (section)
		db_messages_add_error(settings->messages, key->line,
		                      "unknown key '%s' in section %s; there are:%s", key->name,
		                      section->name, known);
	else
		db_messages_add_error(settings->messages, key->line,
		                      "key '%s' is outside of every section; there are %s",
		                      key->name, settings->form->sections);
}

/* --- values ----------------------------------------------------------------------------------- */

/* The position of a word in a list separated by spaces; false when it is none of them. */
static bool find_word(const char *words, const char *text, unsigned *position)
{
	size_t length = strlen(text);

	for (*position = 0; *words; (*position)++) {
		size_t size = strcspn(words, " ");

		if (size == length && memcmp(words, text, size) == 0)
			return true;
		words += size + (words[size] == ' ');
	}
	return false;
}

/* Stores a value of a key that is not a text. False: it is invalid. */
static bool keep_value(const struct db_setting *row, const char *text, void *member)
{
	unsigned long number;
	char *end;

	switch (row->kind) {
	case DB_SETTING_NUMBER:
		errno = 0;
		number = strtoul(text, &end, 10);
		*(unsigned *)member = (unsigned)number;
		return isdigit((unsigned char)text[0]) && *end == '\0' && errno == 0 &&
		       number >= row->min && number <= row->max;
	case DB_SETTING_LIST:
		return find_word(row->words, text, &((struct db_setting_list *)member)->word);
	case DB_SETTING_WORD:
	case DB_SETTING_TEXT:
	default:
		return find_word(row->words, text, member);
	}
}

static void refuse_value(struct db_settings *settings, const struct db_setting *row,
                         const struct db_reader_key *given)
{
	const char *text = given->count > 0 ? given->values : "";

	if (given->list)
		db_messages_add_error(settings->messages, given->line,
		                      "%s has one value, not a list; write %s = VALUE", row->name,
		                      row->name);
	else if (row->kind == DB_SETTING_NUMBER)
		db_messages_add_error(settings->messages, given->line,
		                      "%s = %s is no whole number from %u to %u%s%s", row->name,
		                      text, row->min, row->max, row->unit[0] ? " " : "", row->unit);
	else if (row->kind == DB_SETTING_TEXT)
		db_messages_add_error(settings->messages, given->line,
		                      "%s is too short or too long; %u to %u characters", row->name,
		                      row->min, row->max);
	else
		db_messages_add_error(settings->messages, given->line,
		                      "%s = %s is none of its words; one of: %s%s", row->name, text,
		                      row->words,
		                      row->kind == DB_SETTING_LIST ?
		                              ", or a list of names such as {\"a\", \"b\"}" :
		                              "");
}

/* Copies bytes and a zero byte after them. */
static char *copy_bytes(struct db_settings *settings, const char *bytes, size_t size)
{
	char *copy = calloc(1, size + 1);

	if (copy)
		memcpy(copy, bytes, size);
	else
		db_messages_add_error(settings->messages, 0,
		                      "out of memory; free some and try again");
	return copy;
}

static void read_key(struct db_settings *settings, const struct db_setting *row)
{
	const struct db_reader_key *given = find_given(settings, row);
	void *member = (char *)settings->values + row->offset;

	if (!given && !row->preset)
		db_messages_add_error(settings->messages, 0, "%s must be given in section %s: %s",
		                      row->name, row->section, row->description);
	if (row->kind == DB_SETTING_TEXT) {
		const char *text = given ? given->values : row->preset ? row->preset : "";
		size_t length = strlen(text);
		char *copy;

		/* A preset may mean that there is none. */
		if (given && (given->list || length < row->min || length > row->max)) {
			refuse_value(settings, row, given);
			text = "";
			length = 0;
		}
		copy = copy_bytes(settings, text, length);
		/* gcc's analyzer does not see that the configuration has it now. */
		memcpy(member, &copy, sizeof(copy));
	} else if (given && given->list && row->kind == DB_SETTING_LIST) {
		struct db_setting_list *list = member;

		list->word = DB_SETTING_NAMED;
		list->names = copy_bytes(settings, given->size > 0 ? given->values : "",
		                         given->size);
	} else if (given && (given->list || !keep_value(row, given->values, member)))
		refuse_value(settings, row, given);
	else if (!given && row->preset && row->preset[0] != '\0')
		(void)keep_value(row, row->preset, member);
	/* gcc's analyzer does not see that the configuration has the names of a list now. */
}

/* --- the whole -------------------------------------------------------------------------------- */

bool db_settings_parse(const struct db_settings_form *form, const char *text, const char *path,
                       FILE *out, void *values, const void *context)
{
	const struct db_reader_rules rules = { .sections = form->sections };
	struct db_source *source = db_sources_of_text(path, text);
	struct db_messages messages = { .sources = source, .source_count = 1 };
	struct db_settings settings = { .form = form, .messages = &messages, .values = values };
	size_t before;
	bool good;

	memset(values, 0, form->size);
	if (!source) {
		fprintf(out, "%s: out of memory; free some and try again\n", path);
		return false;
	}
	if (db_reader_read(&settings.reader, &rules, &messages)) {
		for (size_t i = 0; i < settings.reader.section_count; i++) {
			struct db_reader_section *section = &settings.reader.sections[i];

			before = messages.errors;
			if (!find_row(&settings, section->name, NULL))
				db_messages_add_error(&messages, section->line,
				                      "unknown section '%s'; there are %s",
				                      section->name, form->sections);
			else if (section->title[0] != '\0')
				db_messages_add_error(&messages, section->line,
				                      "section %s has no name, but '%s' was given; "
				                      "write %s {",
				                      section->name, section->title, section->name);
			else if (db_reader_find_section(&settings.reader, section->name, "") != i)
				db_messages_add_error(
					&messages, section->line,
					"there is a section %s already; write all its "
					"keys there",
					section->name);
			section->refused = messages.errors != before;
		}
		for (size_t i = 0; i < settings.reader.key_count; i++)
			check_name(&settings, &settings.reader.keys[i]);
		before = messages.errors;
		for (const struct db_setting *row = form->keys; row->name; row++)
			read_key(&settings, row);
		if (messages.errors == before)
			form->check(&settings, context);
	}
	good = messages.errors == 0;
	db_messages_print(&messages, out);
	db_messages_clear(&messages);
	db_reader_clear(&settings.reader);
	db_sources_free(source, 1);
	return good;
}

bool db_settings_load(const struct db_settings_form *form, const char *path, FILE *out,
                      void *values, const void *context)
{
	char *text = db_file_read(path, out);
	bool good;

	memset(values, 0, form->size);
	good = text && db_settings_parse(form, text, path, out, values, context);
	free(text);
	return good;
}

void db_settings_free(const struct db_settings_form *form, void *values)
{
	for (const struct db_setting *row = form->keys; row->name; row++) {
		void *member = (char *)values + row->offset;

		if (row->kind == DB_SETTING_TEXT)
			free(*(char **)member);
		else if (row->kind == DB_SETTING_LIST)
			free(((struct db_setting_list *)member)->names);
	}
	if (form->clear)
		form->clear(values);
	memset(values, 0, form->size);
}

bool db_setting_list_has(const struct db_setting_list *list, const char *name)
{
	for (const char *at = list->names; at && *at; at += strlen(at) + 1) {
		if (strcmp(at, name) == 0)
			return true;
	}
	return false;
}

/* A field of CSV: quoted where necessary. */
static void put_field(FILE *out, const char *text, char end)
{
	bool quoted = strpbrk(text, ",\"") != NULL;

	if (quoted)
		(void)putc('"', out);
	for (; *text; text++) {
		if (*text == '"')
			(void)putc('"', out);
		(void)putc(*text, out);
	}
	if (quoted)
		(void)putc('"', out);
	(void)putc(end, out);
}

int db_settings_write_csv(const struct db_setting *keys, FILE *out)
{
	static const char *const types[] = {
		[DB_SETTING_NUMBER] = "integer",
		[DB_SETTING_WORD] = "word",
		[DB_SETTING_TEXT] = "text",
		[DB_SETTING_LIST] = "list",
	};

	fputs("section,name,type,required,default,min,max,unit,words,families,description\n", out);
	for (const struct db_setting *key = keys; key->name; key++) {
		put_field(out, key->section, ',');
		put_field(out, key->name, ',');
		put_field(out, types[key->kind], ',');
		put_field(out, key->preset ? "no" : "yes", ',');
		put_field(out, key->preset ? key->preset : "", ',');
		if (key->max > 0)
			fprintf(out, "%u,%u,", key->min, key->max);
		else
			fputs(",,", out);
		put_field(out, key->unit, ',');
		put_field(out, key->words, ',');
		/* The same columns as in docs/config-keys.csv. */
		put_field(out, "all", ',');
		put_field(out, key->description, '\n');
	}
	return fflush(out) == 0 ? 0 : -1;
}
