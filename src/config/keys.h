/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one list of configuration keys. The reader, its messages and the manual page come from it.
 */
#ifndef DRIVEBRIDGE_CONFIG_KEYS_H
#define DRIVEBRIDGE_CONFIG_KEYS_H

#include <stdbool.h>
#include <stddef.h>

enum db_config_kind {
	DB_KEY_NUMBER,   /* whole number, min..max */
	DB_KEY_REAL,     /* number, min..max */
	DB_KEY_WORD,     /* one of `words`; the position of a word is its enum value */
	DB_KEY_TEXT,     /* free text, min..max bytes */
	DB_KEY_LISTEN,   /* ADDRESS:PORT */
	DB_KEY_NETWORKS, /* list of ADDRESS or ADDRESS/PREFIX */
	DB_KEY_PROTOCOL, /* name of a family of the driver list */
	DB_KEY_BUS,      /* name of a bus section */
};

struct db_config_key {
	const char *section; /* "modbus", "bus" or "drive" */
	const char *name;
	enum db_config_kind kind;
	/* As it would be written in a file (lists: separated by spaces). Null: the key must be
	 * given; "": what holds then is not one value, `description` tells it. */
	const char *preset;
	double min;
	double max;
	const char *unit;  /* "" when it has none */
	const char *words; /* WORD: separated by spaces, else "" */
	const char *only;  /* not for serial families, but for these; "" = for all */
	const char *description;
};

/* All keys, grouped by section in the order people expect them. Lives as long as the program. */
const struct db_config_key *db_config_keys(size_t *count);

/* The key of this name in this section, or null. */
const struct db_config_key *db_config_key_find(const char *section, const char *name);

/* The key of the section whose name looks most like this one; null for an unknown section. */
const struct db_config_key *db_config_key_nearest(const char *section, const char *name);

/* The section of another key of this name, or null: a key written in the wrong place. */
const char *db_config_key_elsewhere(const char *section, const char *name);

#endif
