/* SPDX-License-Identifier: Apache-2.0 */
/* config-export: writes docs/config-keys.csv, every key that a configuration file may have. */
#include "config/keys.h"
#include "config/names.h"
#include "drivebridge/driver.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A field of CSV: quoted when it has to be. */
static void put_text(const char *text, char end)
{
	bool quoted = strpbrk(text, ",\"") != NULL;

	if (quoted)
		putchar('"');
	for (; *text; text++) {
		if (*text == '"')
			putchar('"');
		putchar(*text);
	}
	if (quoted)
		putchar('"');
	putchar(end);
}

static const char *type_of(const struct db_config_key *key)
{
	switch (key->kind) {
	case DB_KEY_NUMBER:
	case DB_KEY_INTEGER:
		return "integer";
	case DB_KEY_REAL:
		return "number";
	case DB_KEY_WORD:
	case DB_KEY_TRANSPORT:
		return "word";
	case DB_KEY_TEXT:
		return "text";
	case DB_KEY_CPUS:
		return "processors";
	case DB_KEY_LISTEN:
		return "address";
	case DB_KEY_NETWORKS:
		return "networks";
	case DB_KEY_DRIVES:
		return "drives";
	case DB_KEY_UNITS:
		return "units";
	case DB_KEY_PROTOCOL:
		return "family";
	case DB_KEY_BUS:
		return "bus";
	case DB_KEY_PROFILE:
		return "path";
	}
	return "";
}

/* Texts have a range too: of their length. */
static bool has_range(const struct db_config_key *key)
{
	return key->kind == DB_KEY_NUMBER || key->kind == DB_KEY_INTEGER ||
	       key->kind == DB_KEY_REAL || key->kind == DB_KEY_TEXT || key->kind == DB_KEY_PROFILE;
}

static void put_key(void *context, const struct db_config_key *key, const char *families)
{
	(void)context;
	put_text(key->section, ',');
	put_text(key->name, ',');
	put_text(type_of(key), ',');
	put_text(key->preset ? "no" : "yes", ',');
	put_text(key->preset ? key->preset : "", ',');
	if (has_range(key))
		printf("%.10g,%.10g,", key->min, key->max);
	else
		printf(",,");
	put_text(key->unit, ',');
	put_text(key->words, ',');
	put_text(families, ',');
	put_text(key->description, '\n');
}

int main(void)
{
	puts("section,name,type,required,default,min,max,unit,words,families,description");
	db_names_each_key(db_drivers, put_key, NULL);
	return fflush(stdout) == 0 ? EXIT_SUCCESS : EXIT_FAILURE;
}
