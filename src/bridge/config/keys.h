/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The one table of configuration keys that are not a family's own: their allowed values, and where
 * each value is stored. Reading, comparing and writing a configuration go through it row by row;
 * messages, the manual page and docs/config-keys.csv come from it. Pure.
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
	/* one of `words`, stored as an enum value or as whether it is not the first */
	DB_KEY_WORD,
	DB_KEY_TEXT,      /* free text, min..max bytes */
	DB_KEY_CPUS,      /* list of processors, min..max bytes */
	DB_KEY_LISTEN,    /* ADDRESS:PORT */
	DB_KEY_NETWORKS,  /* list of ADDRESS or ADDRESS/PREFIX */
	DB_KEY_DRIVES,    /* one of `words`, all and none, or a list of names of drives */
	DB_KEY_UNITS,     /* the word all, or a list of unit ids and ranges of them, as bits */
	DB_KEY_PROTOCOL,  /* name of a family of the driver list, stored as its driver */
	DB_KEY_TRANSPORT, /* one of `words`, stored as the transport of this name */
	DB_KEY_BUS,       /* name of a bus section, stored as its index among the buses */
	DB_KEY_PROFILE,   /* path of a profile, whose keys count; min..max bytes */
};

/* Which families a key of the table is for. */
enum db_config_scope {
	DB_KEY_FOR_ALL,
	DB_KEY_FOR_SERIAL, /* families on serial lines */
	DB_KEY_FOR_CAN,    /* families on CAN */
	DB_KEY_FOR_AXES,   /* families with several axes at one address */
	DB_KEY_FOR_VSMD,   /* families whose vendor has a register map of its own */
};

struct db_config_key {
	/* "modbus", "control", "endpoint", "role", "modbus-rtu", "bus" or "drive" */
	const char *section;
	const char *name;
	enum db_config_kind kind;
	/* As written in a file (lists: separated by spaces). Null: the key must be given; "": the
	 * default is not one value, see `description`. */
	const char *preset;
	double min;
	double max;
	const char *unit;  /* "" when it has none */
	const char *words; /* separated by spaces, "" when it has none */
	unsigned first;    /* enum value of the first word */
	enum db_config_scope scope;
	/* It describes a kind of drives, so that a profile may have it, and not a single one, its
	 * place or the machine. */
	bool of_kind;
	/* Offset of the member of the section's struct that holds the value: unsigned, enum, bool,
	 * double, char *, uint64_t or a pointer, by its kind. A list's count follows it directly.
	 * Both 0 for a profile and for a family's option. */
	size_t offset;
	size_t size;
	const char *description;
};

/* Grouped by section in the usual order. Lives as long as the program. */
const struct db_config_key *db_keys_all(size_t *count);

/* The key of this name in this section, or null. */
const struct db_config_key *db_keys_find(const char *section, const char *name);

/* True for a key of an earlier version that does nothing any more. */
bool db_keys_is_retired(const char *section, const char *name);

/* True if it is for drives of this family. */
bool db_keys_fit(const struct db_config_key *key, const struct db_driver *driver);

/* Converts a word's position in the list to and from the member that holds its value. */
void db_keys_put_word(const struct db_config_key *key, void *member, unsigned position);
unsigned db_keys_get_word(const struct db_config_key *key, const void *member);

/* A family's option as a key; its texts are the option's. */
struct db_config_key db_keys_of_option(const struct db_option *option);

/* The option of this name in this section, or null. */
const struct db_option *db_keys_find_option(const struct db_driver *driver, const char *section,
                                            const char *name);

#endif
