/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sections of the simulator's configuration: their keys, the values allowed, and the defaults. A
 * wrong value is an error, and its default is returned. Pure.
 */
#ifndef DRIVEBRIDGE_SIM_CONFIG_SECTION_H
#define DRIVEBRIDGE_SIM_CONFIG_SECTION_H

#include "reader/reader.h"

struct sim_key;

struct sim_section {
	const struct db_reader *reader;
	struct db_messages *messages;
	const struct sim_key *keys;
	size_t index; /* in the reader */
	const char *title;
};

/* Every unknown section or key, every duplicate and every wrong type is an error. */
void sim_section_check_all(const struct db_reader *reader, struct db_messages *messages);

/* One of the sections that sim_section_check_all() accepted. */
struct sim_section sim_section_open(const struct db_reader *reader, struct db_messages *messages,
                                    size_t index);

/* Values of the section's keys, by type. Texts live as long as the reader; null when it is not
 * given and has no default. */
const char *sim_section_text(const struct sim_section *section, const char *name);
long sim_section_whole(const struct sim_section *section, const char *name);
double sim_section_real(const struct sim_section *section, const char *name);
bool sim_section_flag(const struct sim_section *section, const char *name);

/* The index of the word in the table's list. */
unsigned sim_section_word(const struct sim_section *section, const char *name);

/* The next text of a list: the first one after null, null after the last one. */
const char *sim_section_next(const struct sim_section *section, const char *name, const char *text);
size_t sim_section_length(const struct sim_section *section, const char *name);

/* An error about a key, or about the section as a whole if `name` is null. */
void sim_section_refuse(const struct sim_section *section, const char *name, const char *format,
                        ...) __attribute__((format(printf, 3, 4)));

/* False, and an error, when the value is in the table's range but not in this one. */
bool sim_section_check_range(const struct sim_section *section, const char *name, long min,
                             long max);

#endif
