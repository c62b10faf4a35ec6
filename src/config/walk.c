/* SPDX-License-Identifier: Apache-2.0 */
/* Walks over all keys, those of the table and those of the families, and what is asked of them. */
#include "config/keys.h"
#include "drivebridge/driver.h"

#include <stdio.h>
#include <string.h>

#define NAME_MAX_COMPARED 63

static const char *const SECTIONS[] = { "modbus", "bus", "drive" };

#define SECTION_COUNT (sizeof(SECTIONS) / sizeof(SECTIONS[0]))

/* --- which families -------------------------------------------------------------------------- */

static void add_family(char text[DB_FAMILIES_TEXT_MAX], const struct db_driver *driver)
{
	size_t used = strlen(text);

	snprintf(text + used, DB_FAMILIES_TEXT_MAX - used, "%s%s", used > 0 ? " " : "",
	         driver->name);
}

void db_config_option_families(const struct db_driver *const *drivers, const char *section,
                               const char *name, char text[DB_FAMILIES_TEXT_MAX])
{
	text[0] = '\0';
	for (; *drivers; drivers++) {
		if (db_config_option_find(*drivers, section, name))
			add_family(text, *drivers);
	}
}

static void families_of_key(const struct db_driver *const *drivers, const struct db_config_key *key,
                            char text[DB_FAMILIES_TEXT_MAX])
{
	text[0] = '\0';
	if (key->scope == DB_KEY_FOR_ALL) {
		snprintf(text, DB_FAMILIES_TEXT_MAX, "all");
		return;
	}
	for (; *drivers; drivers++) {
		if (db_config_key_fits(key, *drivers))
			add_family(text, *drivers);
	}
}

/* --- the walk -------------------------------------------------------------------------------- */

static bool same_option(const struct db_option *a, const struct db_option *b)
{
	return strcmp(a->words, b->words) == 0 && strcmp(a->preset, b->preset) == 0 &&
	       !(a->min < b->min) && !(a->min > b->min) && !(a->max < b->max) &&
	       !(a->max > b->max) && a->whole == b->whole && strcmp(a->unit, b->unit) == 0 &&
	       strcmp(a->description, b->description) == 0;
}

/* Whether a driver has an option just like this one. */
static bool declares(const struct db_driver *driver, const struct db_option *option)
{
	const struct db_option *own = db_config_option_find(driver, option->section, option->name);

	return own && same_option(own, option);
}

/* The option of the driver at this place of the list, unless an earlier one has it just so. */
static void visit_option(const struct db_driver *const *drivers, size_t place,
                         const struct db_option *option, db_config_visit_fn *visit, void *context)
{
	struct db_config_key key = db_config_option_key(option);
	char families[DB_FAMILIES_TEXT_MAX] = "";

	for (size_t i = 0; drivers[i]; i++) {
		if (!declares(drivers[i], option))
			continue;
		if (i < place)
			return;
		add_family(families, drivers[i]);
	}
	visit(context, &key, families);
}

static void visit_options(const struct db_driver *const *drivers, const char *section,
                          db_config_visit_fn *visit, void *context)
{
	for (size_t i = 0; drivers[i]; i++) {
		for (size_t j = 0; j < drivers[i]->option_count; j++) {
			const struct db_option *option = &drivers[i]->options[j];

			if (strcmp(option->section, section) == 0)
				visit_option(drivers, i, option, visit, context);
		}
	}
}

void db_config_each_key(const struct db_driver *const *drivers, db_config_visit_fn *visit,
                        void *context)
{
	size_t count;
	const struct db_config_key *keys = db_config_keys(&count);

	for (size_t s = 0; s < SECTION_COUNT; s++) {
		for (size_t i = 0; i < count; i++) {
			char families[DB_FAMILIES_TEXT_MAX];

			if (strcmp(keys[i].section, SECTIONS[s]) != 0)
				continue;
			families_of_key(drivers, &keys[i], families);
			visit(context, &keys[i], families);
		}
		visit_options(drivers, SECTIONS[s], visit, context);
	}
}

/* --- what is asked --------------------------------------------------------------------------- */

bool db_config_section_known(const char *section)
{
	for (size_t i = 0; i < SECTION_COUNT; i++) {
		if (strcmp(SECTIONS[i], section) == 0)
			return true;
	}
	return false;
}

bool db_config_name_known(const struct db_driver *const *drivers, const char *section,
                          const char *name)
{
	if (db_config_key_find(section, name))
		return true;
	for (; *drivers; drivers++) {
		if (db_config_option_find(*drivers, section, name))
			return true;
	}
	return false;
}

static unsigned least(unsigned a, unsigned b, unsigned c)
{
	unsigned ab = a < b ? a : b;

	return ab < c ? ab : c;
}

/* Levenshtein's distance: letters to insert, delete or replace. */
static unsigned distance(const char *a, const char *b)
{
	unsigned row[NAME_MAX_COMPARED + 1];
	size_t length = strnlen(b, NAME_MAX_COMPARED);

	for (unsigned j = 0; j <= length; j++)
		row[j] = j;
	for (size_t i = 0; i < NAME_MAX_COMPARED && a[i]; i++) {
		unsigned diagonal = row[0];

		row[0]++;
		for (size_t j = 0; j < length; j++) {
			unsigned above = row[j + 1];

			row[j + 1] = least(above + 1, row[j] + 1, diagonal + (a[i] != b[j]));
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
	far = distance(search->name, key->name);
	if (!search->found || far < search->best) {
		search->found = key->name;
		search->best = far;
	}
}

const char *db_config_name_nearest(const struct db_driver *const *drivers, const char *section,
                                   const char *name)
{
	struct search search = { .section = section, .name = name };

	db_config_each_key(drivers, visit_near, &search);
	return search.found;
}

const char *db_config_name_elsewhere(const struct db_driver *const *drivers, const char *section,
                                     const char *name)
{
	for (size_t i = 0; i < SECTION_COUNT; i++) {
		if (strcmp(SECTIONS[i], section) != 0 &&
		    db_config_name_known(drivers, SECTIONS[i], name))
			return SECTIONS[i];
	}
	return NULL;
}
