/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One section: from the texts of its keys to the values of its struct, according to the table of
 * keys, or to messages with the correct form.
 */
#ifndef DRIVEBRIDGE_CONFIG_SECTION_H
#define DRIVEBRIDGE_CONFIG_SECTION_H

#include "drivebridge/config.h"
#include "reader/reader.h"

/* The families and transports that a file may name: null-terminated lists. */
struct db_built_in {
	const struct db_driver *const *drivers;
	const struct db_transport *const *transports;
};

/* A configuration while it is being read. */
struct db_load {
	const struct db_built_in *built_in;
	struct db_messages messages;
	struct db_reader reader;
	struct db_config *config;
	/* The file that it is read from, next to which there may be profiles; null: it is read from
	 * texts. */
	const char *path;
	struct db_source *offered; /* profiles with their texts, which need not be read */
	size_t offered_count;
	char *profiles;     /* see struct db_config_reading */
	uint64_t signature; /* signature of the files; 0: they changed while they were read */
};

struct db_section {
	struct db_load *load;
	const char
		*name; /* "modbus", "control", "endpoint", "role", "modbus-rtu", "bus", "drive" */
	const char *title; /* "" for modbus and control */
	size_t index;      /* index in the reader, or DB_READER_NO_SECTION */
	unsigned line;     /* line of its head; 0 when the file has none */
	const struct db_driver
		*driver; /* the family of a bus or drive; null while it is not known */
};

/* The section of this index. */
struct db_section db_section_open(struct db_load *load, size_t index);
/* The only section of its name, modbus or control, which is optional. */
struct db_section db_section_open_only(struct db_load *load, const char *name);

/* True if the file sets the key. The second: true if its value was invalid (known after it was
 * read). */
bool db_section_has(const struct db_section *section, const char *name);
bool db_section_misread(const struct db_section *section, const char *name);

/* Line of a key, or of the section's head when the key was not given. */
unsigned db_section_line(const struct db_section *section, const char *name);

/* The same for a section that was read before; `head` when the key was not given. */
unsigned db_section_find_line(const struct db_load *load, const char *section, const char *title,
                              unsigned head, const char *name);

/* A key's text in the file, else its preset. Null when it is mandatory, which is an error. */
const char *db_section_text(const struct db_section *section, const char *name);

/* The position of a key's word in the table's list. False when it is none of them: an error. */
bool db_section_word(const struct db_section *section, const char *name, unsigned *position);

/*
 * Reads all keys into the section's struct (db_modbus_config, db_control_config,
 * db_endpoint_config, db_role_config, db_rtu_config, db_bus_config or db_drive_config), except
 * those that name something else in the program or the files. Keys that are not in the file, or are
 * for families of another kind, have their preset, without one 0, null or NAN. Invalid ones are
 * errors, and 0 or null.
 */
void db_section_read(const struct db_section *section, void *values);

/* The family's own settings for this kind of section, to be freed; null when out of memory. Keys of
 * other families are errors. Without a family nothing can be checked, and there are none. */
void *db_section_read_options(const struct db_section *section);

#endif
