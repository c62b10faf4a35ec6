/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the configuration reader share while one file is read.
 */
#ifndef DRIVEBRIDGE_CONFIG_LOAD_H
#define DRIVEBRIDGE_CONFIG_LOAD_H

#include "config/outline.h"
#include "config/report.h"
#include "drivebridge/config.h"

#include <confuse.h>

struct db_option;

/* The families and transports that a file may name: null-terminated lists. */
struct db_built_in {
	const struct db_driver *const *drivers;
	const struct db_transport *const *transports;
};

/* Those of this program. */
extern const struct db_built_in db_config_built_in;

struct db_load {
	const struct db_built_in *built_in;
	struct db_report report;
	struct db_outline outline;
	cfg_t *root;
	struct db_config *config;
};

/* One section being read. All functions of it take keys of the table only. */
struct db_section {
	struct db_load *load;
	const char *name;  /* "modbus", "bus" or "drive" */
	const char *title; /* "" for modbus */
	cfg_t *values;
	size_t place;  /* in the outline, or DB_OUTLINE_TOP */
	unsigned line; /* of its head; 0 when the file has none */
};

/* The section's line of this key, or of the section's head when the key was not given. */
unsigned db_section_line(const struct db_section *section, const char *key);

/* The same, for a section of the finished configuration; `head` when the key was not given. */
unsigned db_load_line(const struct db_load *load, const char *section, const char *title,
                      unsigned head, const char *key);

/* Whether the file sets the key. */
bool db_section_has(const struct db_section *section, const char *key);

/*
 * The value of a key, its preset when it was not given. What is wrong (also a missing key that must
 * be given) is reported, and 0 or null returned. A key without a preset gives 0 or "".
 */
unsigned db_section_number(const struct db_section *section, const char *name);
double db_section_real(const struct db_section *section, const char *name);
unsigned db_section_word(const struct db_section *section, const char *name);
char *db_section_text(const struct db_section *section, const char *name); /* to be freed */
struct db_network *db_section_networks(const struct db_section *section, const char *name,
                                       size_t *count); /* to be freed */

/* Number, or place of the word; NAN when it was not given and has no default. */
double db_section_option(const struct db_section *section, const struct db_option *option);

/* All of a family's options for this kind of section; the others become NAN. Refuses keys and
 * options of other families. `driver` may be null: then nothing can be said. */
void db_section_options(const struct db_section *section, const struct db_driver *driver,
                        double options[DB_OPTIONS_MAX]);

struct db_section db_section_open(struct db_load *load, const char *name, unsigned index);

/* One section each. Fields stay 0 or null where something is wrong, which is reported. A null name:
 * out of memory. */
void db_load_bus(struct db_load *load, unsigned index, struct db_bus_config *bus);
void db_load_drive(struct db_load *load, unsigned index, struct db_drive_config *drive);

/* Fills config->modbus, buses and drives from load->root. False when out of memory. */
bool db_load_sections(struct db_load *load);

/*
 * What only shows between sections: twice the same device, address, axis or unit; then (when nothing
 * is wrong) buses that share an interface and what the families say; then times that cannot be met.
 */
void db_load_check(struct db_load *load);
void db_load_check_interfaces(struct db_load *load);
void db_load_check_families(struct db_load *load);
void db_load_check_times(struct db_load *load);

/* Times that were not given: what the buses need. Everything else is there and right. */
void db_load_fill_times(struct db_load *load);

/* As db_config_load(), from a text. */
int db_config_parse(const char *text, const char *file, FILE *errors, struct db_config **config);

/* With other families and transports than this program's: they must outlive the configuration. */
int db_config_parse_with(const struct db_built_in *built_in, const char *text, const char *file,
                         FILE *errors, struct db_config **config);

/* One transaction on the wire that a command may have to wait for, and its own: nanoseconds. */
int64_t db_config_confirm_time(const struct db_bus_config *bus);

#define DB_SPEED_TEXT_MAX 32

/* How fast the wire is, for people: "9600 baud", "500000 bit/s". */
void db_config_speed(const struct db_bus_config *bus, char text[DB_SPEED_TEXT_MAX]);

/* Drives of a bus, and how many have to be asked in each cycle: axes of one controller are asked
 * together. */
size_t db_config_drives_on(const struct db_config *config, size_t bus);
size_t db_config_stations_on(const struct db_config *config, size_t bus);

#endif
