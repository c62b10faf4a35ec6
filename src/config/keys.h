/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one list of configuration keys: those every configuration knows, and behind them what the
 * families declare as their options. The reader, its messages and the manual page come from it.
 */
#ifndef DRIVEBRIDGE_CONFIG_KEYS_H
#define DRIVEBRIDGE_CONFIG_KEYS_H

#include <stdbool.h>
#include <stddef.h>

struct db_driver;
struct db_option;

enum db_config_kind {
	DB_KEY_NUMBER,  /* whole number in decimal digits, min..max */
	DB_KEY_INTEGER, /* whole number, decimal with sign or 0x and hexadecimal digits, min..max */
	DB_KEY_REAL,    /* number, min..max */
	DB_KEY_WORD,    /* one of `words`; the position of a word is its enum value */
	DB_KEY_TEXT,    /* free text, min..max bytes */
	DB_KEY_CPUS,    /* list of processors, min..max bytes */
	DB_KEY_LISTEN,  /* ADDRESS:PORT */
	DB_KEY_NETWORKS, /* list of ADDRESS or ADDRESS/PREFIX */
	DB_KEY_PROTOCOL, /* name of a family of the driver list */
	DB_KEY_BUS,      /* name of a bus section */
};

/* Which families a key of the table is for. */
enum db_config_scope {
	DB_KEY_FOR_ALL,
	DB_KEY_FOR_SERIAL, /* families on serial lines */
	DB_KEY_FOR_CAN,    /* families on CAN */
	DB_KEY_FOR_AXES,   /* families with several axes behind one address */
	DB_KEY_FOR_VSMD,   /* families whose vendor has a register map of its own */
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
	enum db_config_scope scope;
	/* Of the member of the section's struct that holds the value, so that sections can be
	 * compared. A list's count stands right behind it. Both 0 for a family's option. */
	size_t offset;
	size_t size;
	const char *description;
};

/* The keys that are not a family's own, grouped by section in the order people expect them. Lives
 * as long as the program. */
const struct db_config_key *db_config_keys(size_t *count);

/* The key of this name in this section, or null; options of families are not looked at. */
const struct db_config_key *db_config_key_find(const char *section, const char *name);

bool db_config_key_fits(const struct db_config_key *key, const struct db_driver *driver);

/* A family's option as a key; its texts are the option's. */
struct db_config_key db_config_option_key(const struct db_option *option);

/* The option of this name in this section, or null. */
const struct db_option *db_config_option_find(const struct db_driver *driver, const char *section,
                                              const char *name);

#define DB_FAMILIES_TEXT_MAX 128

/* Names of the drivers (a null-terminated list) that have this option, separated by spaces. */
void db_config_option_families(const struct db_driver *const *drivers, const char *section,
                               const char *name, char text[DB_FAMILIES_TEXT_MAX]);

/* `families`: "all", or names of families separated by spaces. Both live during the call only. */
typedef void db_config_visit_fn(void *context, const struct db_config_key *key,
                                const char *families);

/*
 * Every key that a file may have with these drivers, section by section: first the keys of the
 * table, then the options of the families. An option that several families declare in just the same
 * way comes once; one they declare differently comes once for each way.
 */
void db_config_each_key(const struct db_driver *const *drivers, db_config_visit_fn *visit,
                        void *context);

/* Whether a section of this name exists, and whether it has a key of this name in some family. */
bool db_config_section_known(const char *section);
bool db_config_name_known(const struct db_driver *const *drivers, const char *section,
                          const char *name);

/* The key of the section whose name looks most like this one; null for an unknown section. */
const char *db_config_name_nearest(const struct db_driver *const *drivers, const char *section,
                                   const char *name);

/* The section of another key of this name, or null: a key written in the wrong place. */
const char *db_config_name_elsewhere(const struct db_driver *const *drivers, const char *section,
                                     const char *name);

#endif
