/* SPDX-License-Identifier: Apache-2.0 */
#include "config/names.h"

#include "config/keys.h"
#include "drivebridge/client.h"
#include "drivebridge/driver.h"

#include <stdio.h>
#include <string.h>

#define NAME_MAX_COMPARED 63

static const char *const SECTIONS[] = { "modbus", "control",    "role",    "bus",
	                                "drive",  "modbus-rtu", "endpoint" };

#define SECTION_COUNT (sizeof(SECTIONS) / sizeof(SECTIONS[0]))
#define SECTION_TEXT \
	"modbus, control, role NAME, bus NAME, drive NAME, modbus-rtu NAME and endpoint NAME"

/* --- which families -------------------------------------------------------------------------- */

static void add_family(char text[DB_FAMILIES_TEXT_MAX], const struct db_driver *driver)
{
	size_t used = strlen(text);

	snprintf(text + used, DB_FAMILIES_TEXT_MAX - used, "%s%s", used > 0 ? " " : "",
	         driver->name);
}

void db_names_list_families(const struct db_driver *const *drivers, const char *section,
                            const char *name, char text[DB_FAMILIES_TEXT_MAX])
{
	text[0] = '\0';
	for (; *drivers; drivers++) {
		if (db_keys_find_option(*drivers, section, name))
			add_family(text, *drivers);
	}
}

/* --- the walk -------------------------------------------------------------------------------- */

/* True if a driver has an equal option. */
static bool declares_option(const struct db_driver *driver, const struct db_option *option)
{
	const struct db_option *own = db_keys_find_option(driver, option->section, option->name);

	return own && strcmp(own->words, option->words) == 0 &&
	       strcmp(own->preset, option->preset) == 0 && !(own->min < option->min) &&
	       !(own->min > option->min) && !(own->max < option->max) &&
	       !(own->max > option->max) && own->whole == option->whole &&
	       strcmp(own->unit, option->unit) == 0 &&
	       strcmp(own->description, option->description) == 0;
}

/* The option of the driver at this index of the list, unless an earlier one has an equal option. */
static void visit_option(const struct db_driver *const *drivers, size_t index,
                         const struct db_option *option, db_names_visit_fn *visit, void *context)
{
	struct db_config_key key = db_keys_of_option(option);
	char families[DB_FAMILIES_TEXT_MAX] = "";

	for (size_t i = 0; drivers[i]; i++) {
		if (!declares_option(drivers[i], option))
			continue;
		if (i < index)
			return;
		add_family(families, drivers[i]);
	}
	visit(context, &key, families);
}

void db_names_each_key(const struct db_driver *const *drivers, db_names_visit_fn *visit,
                       void *context)
{
	size_t count;
	const struct db_config_key *keys = db_keys_all(&count);

	for (size_t s = 0; s < SECTION_COUNT; s++) {
		for (size_t i = 0; i < count; i++) {
			char families[DB_FAMILIES_TEXT_MAX] = "";

			if (strcmp(keys[i].section, SECTIONS[s]) != 0)
				continue;
			if (keys[i].scope == DB_KEY_FOR_ALL)
				strcpy(families, "all");
			for (size_t d = 0; keys[i].scope != DB_KEY_FOR_ALL && drivers[d]; d++) {
				if (db_keys_fit(&keys[i], drivers[d]))
					add_family(families, drivers[d]);
			}
			visit(context, &keys[i], families);
		}
		for (size_t d = 0; drivers[d]; d++) {
			for (size_t i = 0; i < drivers[d]->option_count; i++) {
				const struct db_option *option = &drivers[d]->options[i];

				if (strcmp(option->section, SECTIONS[s]) == 0)
					visit_option(drivers, d, option, visit, context);
			}
		}
	}
}

/* --- what there is instead of an unknown name ------------------------------------------------- */

static bool is_known_section(const char *section)
{
	for (size_t i = 0; i < SECTION_COUNT; i++) {
		if (strcmp(SECTIONS[i], section) == 0)
			return true;
	}
	return false;
}

/* True if the section has a key of this name in some family. */
static bool is_known_key(const struct db_driver *const *drivers, const char *section,
                         const char *name)
{
	if (db_keys_find(section, name))
		return true;
	for (; *drivers; drivers++) {
		if (db_keys_find_option(*drivers, section, name))
			return true;
	}
	return false;
}

/* Levenshtein's distance: letters to insert, delete or replace. */
static unsigned edit_distance(const char *a, const char *b)
{
	unsigned row[NAME_MAX_COMPARED + 1] = { 0 };
	size_t length = strnlen(b, NAME_MAX_COMPARED);

	for (unsigned j = 0; j <= length; j++)
		row[j] = j;
	for (size_t i = 0; i < NAME_MAX_COMPARED && a[i]; i++) {
		unsigned diagonal = row[0];

		row[0]++;
		for (size_t j = 0; j < length; j++) {
			unsigned above = row[j + 1];
			unsigned best = diagonal + (a[i] != b[j]);

			best = above + 1 < best ? above + 1 : best;
			row[j + 1] = row[j] + 1 < best ? row[j] + 1 : best;
			diagonal = above;
		}
	}
	return row[length];
}

struct search {
	const char *section;
	const char *name;
	const char *found;
	unsigned best;
};

static void visit_near(void *context, const struct db_config_key *key, const char *families)
{
	struct search *search = context;
	unsigned far;

	(void)families;
	if (strcmp(key->section, search->section) != 0)
		return;
	far = edit_distance(search->name, key->name);
	if (!search->found || far < search->best) {
		search->found = key->name;
		search->best = far;
	}
}

const char *db_names_find_nearest(const struct db_driver *const *drivers, const char *section,
                                  const char *name)
{
	struct search search = { .section = section, .name = name };

	db_names_each_key(drivers, visit_near, &search);
	return search.found;
}

/* A key in the wrong section, or misspelt. */
static void refuse_unknown_key(const struct db_driver *const *drivers,
                               const struct db_reader_key *key, const char *section,
                               struct db_messages *messages)
{
	for (size_t i = 0; i < SECTION_COUNT; i++) {
		if (strcmp(SECTIONS[i], section) == 0 ||
		    !is_known_key(drivers, SECTIONS[i], key->name))
			continue;
		db_messages_add_error(messages, key->line,
		                      "unknown key '%s' in section %s; it belongs to section %s",
		                      key->name, section, SECTIONS[i]);
		return;
	}
	db_messages_add_error(messages, key->line,
	                      "unknown key '%s' in section %s; the nearest one is '%s'", key->name,
	                      section, db_names_find_nearest(drivers, section, key->name));
}

/* --- what is in a file ------------------------------------------------------------------------ */

static bool is_title(const char *text)
{
	static const char ALLOWED[] =
		"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
	size_t length = strspn(text, ALLOWED);

	return length >= 1 && length <= 31 && text[length] == '\0';
}

/* Several files may have a part of it: a file of one's own, next to that of the package. */
static bool is_shared(const struct db_reader_section *section)
{
	return strcmp(section->name, "modbus") == 0 || strcmp(section->name, "control") == 0;
}

/* True when the section may stay. */
static bool check_section(const struct db_reader *reader, size_t index,
                          struct db_messages *messages)
{
	const struct db_reader_section *section = &reader->sections[index];
	bool titled = strcmp(section->name, "bus") == 0 || strcmp(section->name, "drive") == 0 ||
	              strcmp(section->name, "role") == 0 ||
	              strcmp(section->name, "modbus-rtu") == 0 ||
	              strcmp(section->name, "endpoint") == 0;
	const char *article = strcmp(section->name, "endpoint") == 0 ? "an" : "a";

	if (!is_known_section(section->name)) {
		db_messages_add_error(messages, section->line,
		                      "unknown section '%s'; the sections are %s", section->name,
		                      SECTION_TEXT);
		return false;
	}
	if (!titled && section->title[0] != '\0') {
		db_messages_add_error(messages, section->line,
		                      "section %s has no name, but '%s' was given; write %s {",
		                      section->name, section->title, section->name);
		return false;
	}
	if (titled && !is_title(section->title)) {
		db_messages_add_error(
			messages, section->line,
			"'%s' is no name for %s %s; 1 to 31 of the characters A-Z a-z 0-9 _ -",
			section->title, article, section->name);
		return false;
	}
	/* Its name is its address in histories and the audit trail. */
	if (strcmp(section->name, "modbus-rtu") == 0 &&
	    strlen(section->title) > DB_CLIENT_LINE_NAME_MAX) {
		db_messages_add_error(
			messages, section->line,
			"'%s' is too long for the name of a line; at most %d characters",
			section->title, DB_CLIENT_LINE_NAME_MAX);
		return false;
	}
	for (size_t i = 0; i < index; i++) {
		const struct db_reader_section *other = &reader->sections[i];

		if (strcmp(other->name, section->name) != 0 ||
		    strcmp(other->title, section->title) != 0)
			continue;
		if (is_shared(section) && db_messages_find_source(messages, other->line) !=
		                                  db_messages_find_source(messages, section->line))
			continue;
		db_messages_add_error(
			messages, section->line,
			titled ? "there is %s %s '%s' on %s already; choose another name" :
				 "there is %s section %s%s on %s already; put all keys there",
			titled ? article : "a", section->name, section->title,
			db_messages_name_line(messages, other->line).text);
		return false;
	}
	return true;
}

/* True when the key may stay. Its section is a known one. */
static bool check_key(const struct db_driver *const *drivers, const struct db_reader *reader,
                      size_t index, struct db_messages *messages)
{
	const struct db_reader_key *key = &reader->keys[index];
	const struct db_config_key *known;
	const char *section;

	if (key->section == DB_READER_NO_SECTION) {
		db_messages_add_error(messages, key->line,
		                      "key '%s' stands outside of a section; the sections are %s",
		                      key->name, SECTION_TEXT);
		return false;
	}
	section = reader->sections[key->section].name;
	if (db_keys_is_retired(section, key->name)) {
		db_messages_add_warning(
			messages, key->line,
			"%s does nothing any more, its value is fixed; remove the line", key->name);
		return false;
	}
	if (!is_known_key(drivers, section, key->name)) {
		refuse_unknown_key(drivers, key, section, messages);
		return false;
	}
	/* Families have no options that are lists. */
	known = db_keys_find(section, key->name);
	if (key->list &&
	    !(known && (known->kind == DB_KEY_NETWORKS || known->kind == DB_KEY_DRIVES ||
	                known->kind == DB_KEY_UNITS))) {
		db_messages_add_error(messages, key->line,
		                      "%s is a list; '%s' takes one value without braces",
		                      key->name, key->name);
		return false;
	}
	for (size_t i = index; i > 0; i--) {
		const struct db_reader_key *other = &reader->keys[i - 1];

		/* All keys of a section are adjacent, but those of modbus may be in several
		 * files. */
		if (other->section != key->section && strcmp(section, "modbus") != 0)
			break;
		if (other->section != key->section || strcmp(other->name, key->name) != 0)
			continue;
		db_messages_add_error(messages, key->line,
		                      "%s was set on %s already; keep one of them", key->name,
		                      db_messages_name_line(messages, other->line).text);
		return false;
	}
	return true;
}

void db_names_check(const struct db_driver *const *drivers, struct db_reader *reader,
                    struct db_messages *messages)
{
	for (size_t i = 0; i < reader->section_count; i++)
		reader->sections[i].refused = !check_section(reader, i, messages);
	/* Keys of modbus and control in other files are looked up in the first section. */
	for (size_t i = 0; i < reader->key_count; i++) {
		struct db_reader_key *key = &reader->keys[i];
		const struct db_reader_section *section;

		if (key->section == DB_READER_NO_SECTION)
			continue;
		section = &reader->sections[key->section];
		for (size_t j = 0; is_shared(section) && j < key->section; j++) {
			const struct db_reader_section *other = &reader->sections[j];

			if (strcmp(other->name, section->name) == 0 &&
			    db_messages_find_source(messages, other->line) !=
			            db_messages_find_source(messages, section->line))
				key->section = j;
		}
	}
	for (size_t i = 0; i < reader->key_count; i++) {
		struct db_reader_key *key = &reader->keys[i];

		/* Keys of a section refused only for its title are checked too, so that one run
		 * finds all errors. */
		if (key->section == DB_READER_NO_SECTION ||
		    is_known_section(reader->sections[key->section].name))
			key->refused = !check_key(drivers, reader, i, messages);
	}
}
