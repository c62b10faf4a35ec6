/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A configuration whose keys are in one table, as those of the tools with servers: it is read row
 * by row of the table, and the keys' CSV in docs and their manual page are made from it. Sections
 * have no titles, and each occurs at most once. Reads the file and nothing else.
 */
#ifndef DRIVEBRIDGE_READER_SETTINGS_H
#define DRIVEBRIDGE_READER_SETTINGS_H

#include "reader/reader.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum db_setting_kind {
	DB_SETTING_NUMBER, /* whole number, min..max, stored as unsigned */
	DB_SETTING_WORD,   /* one of `words`, stored as its position in an unsigned */
	DB_SETTING_TEXT,   /* min..max bytes, stored as char * */
	DB_SETTING_LIST, /* one of `words`, or a list of names in braces; struct db_setting_list */
};

struct db_setting {
	const char *section;
	const char *name;
	enum db_setting_kind kind;
	/* As written in a file. NULL: the key must be given; "": the default is not one value, see
	 * `description`. */
	const char *preset;
	unsigned min;
	unsigned max;
	const char *unit;  /* "" when it has none */
	const char *words; /* separated by spaces, "" when it has none */
	size_t offset;     /* offset of the member in the structure with all values */
	const char *description;
};

/* Rows of such a table, each with its offset added. */
#define DB_TEXT_SETTING(section_, name_, preset_, min_, max_, description_)             \
	.section = section_, .name = name_, .kind = DB_SETTING_TEXT, .preset = preset_, \
	.min = min_, .max = max_, .unit = "", .words = "", .description = description_
#define DB_NUMBER_SETTING(section_, name_, preset_, min_, max_, unit_, description_)      \
	.section = section_, .name = name_, .kind = DB_SETTING_NUMBER, .preset = preset_, \
	.min = min_, .max = max_, .unit = unit_, .words = "", .description = description_
#define DB_WORD_SETTING(section_, name_, preset_, words_, description_)                 \
	.section = section_, .name = name_, .kind = DB_SETTING_WORD, .preset = preset_, \
	.unit = "", .words = words_, .description = description_
#define DB_LIST_SETTING(section_, name_, preset_, words_, description_)                 \
	.section = section_, .name = name_, .kind = DB_SETTING_LIST, .preset = preset_, \
	.unit = "", .words = words_, .description = description_

/* A choice of names: by a word that stands for them, or listed. */
struct db_setting_list {
	unsigned word; /* position among the key's words; DB_SETTING_NAMED: the names */
	char *names;   /* one after the other, each with its zero byte; then one more zero byte */
};
#define DB_SETTING_NAMED ((unsigned)-1)

bool db_setting_list_has(const struct db_setting_list *list, const char *name);

struct db_settings;

struct db_settings_form {
	const struct db_setting *keys; /* grouped by section; the last row has no name */
	const char *sections;          /* for messages: "service, broker and publish" */
	size_t size;                   /* of the structure with all values */
	/* Checks of several keys together, called after each is valid; may change the values. */
	void (*check)(struct db_settings *settings, const void *context);
	/* Frees what check() has added to the values; NULL: nothing. */
	void (*clear)(void *values);
};

/* A configuration while it is being read: form->check() adds messages to it. */
struct db_settings {
	const struct db_settings_form *form;
	struct db_messages *messages;
	struct db_reader reader;
	void *values;
};

/* The line of a key, or 0 when it was not given. */
unsigned db_settings_line(const struct db_settings *settings, const char *section,
                          const char *name);

/* A secret that everybody can read is none: this is an error of the key that names its file.
 * `group`: the group whose members should read it. */
void db_settings_check_secret(struct db_settings *settings, const char *section, const char *name,
                              const char *path, const char *group);

/* The keys certificate-file and key-file of a section belong together: an error if only one of
 * them is given. */
void db_settings_check_certificate(struct db_settings *settings, const char *section,
                                   const char *certificate_file, const char *key_file);

/*
 * Fills `values`. False: it is invalid. Errors and warnings go to `out`, "PATH:LINE: text" each.
 * `context` is for the form's check(). To be freed with db_settings_free() in any case.
 */
bool db_settings_load(const struct db_settings_form *form, const char *path, FILE *out,
                      void *values, const void *context);

/* The same from a text; `path` is for messages. */
bool db_settings_parse(const struct db_settings_form *form, const char *text, const char *path,
                       FILE *out, void *values, const void *context);

/* Frees what belongs to the values; they are zero then. */
void db_settings_free(const struct db_settings_form *form, void *values);

/* Writes the table in the form of docs/...-keys.csv. 0, or -1 when it could not be written. */
int db_settings_write_csv(const struct db_setting *keys, FILE *out);

#endif
