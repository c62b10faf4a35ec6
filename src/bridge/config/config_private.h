/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the configuration for each other. One thread.
 */
#ifndef DRIVEBRIDGE_CONFIG_CONFIG_PRIVATE_H
#define DRIVEBRIDGE_CONFIG_CONFIG_PRIVATE_H

#include "config/section.h"
#include "reader/source.h"

#include <stdio.h>

/* --- load.c ----------------------------------------------------------------------------------- */

/* Configurations from texts; db_config_load() is for files. */

/* The families and transports of this program. */
extern const struct db_built_in db_load_built_in;

/* As db_config_load(), from a text that messages name `file`; with other families and transports
 * than this program's they must outlive the configuration. */
int db_load_text(const struct db_built_in *built_in, const char *text, const char *file,
                 FILE *errors, struct db_config **config);

/* The same from sources with their texts, which it takes over: at least one that is no profile,
 * then profiles, with the paths that the others use for them. No file is read. */
int db_load_sources(const struct db_built_in *built_in, struct db_source *sources, size_t count,
                    FILE *errors, struct db_config **config);

/* --- files.c ---------------------------------------------------------------------------------- */

/* The files that make a configuration. */

/*
 * Reads the file at `path`, those of the folder conf.d next to it, in the order of their names, and
 * the edited one (db_config_edited_path()), which has the text `edited` unless that is null. 0, or
 * -1 after a message to `errors` for each that cannot be read. To be freed by db_sources_free() in
 * any case.
 */
int db_files_read(const char *path, const char *edited, FILE *errors, struct db_source **sources,
                  size_t *count);

/* --- copy.c ----------------------------------------------------------------------------------- */

/*
 * All files of a configuration as one text, stored in one file, which exists completely or not at
 * all. It contains the texts unchanged, each after a line with its path, so people can read it,
 * too. Pure.
 */

/* To be freed; null when out of memory, or when a path has a line end. */
char *db_copy_write(const struct db_source *sources, size_t count);

/* The original sources, to be freed by db_sources_free(). False when the text is not exactly what
 * was written. */
bool db_copy_read(const char *text, struct db_source **sources, size_t *count);

/* --- profiles.c ------------------------------------------------------------------------------- */

/*
 * Profiles: files with the settings that all drives of a kind share. A bus or drive names one with
 * `profile`. A profile has a section `profile` with its family, and sections `bus` and `drive`
 * without a name, whose keys are used where the section that names the profile does not have them
 * itself.
 */

/*
 * Reads the profiles that the sections of the reader name, from `offered` or else from files, and
 * makes their sections the bases of those that name them. Mistakes in them are errors with their
 * places there. Names of the reader's own sections and keys were checked before. False: their
 * contents are not available, which was reported.
 */
bool db_profiles_read(struct db_load *load, const struct db_reader_rules *rules);

/* Records in the configuration the profile of the section of this index, which became the bus or
 * drive of this number. False when out of memory. */
bool db_profiles_note(struct db_load *load, size_t index, bool is_drive, size_t number);

/* --- sections.c ------------------------------------------------------------------------------- */

/* From the sections of a file to the structs of the configuration, including what depends on more
 * than one key. */

/* Fills config->modbus, control, buses and drives; members stay 0 or null where there is an error.
 * False when out of memory. */
bool db_sections_read(struct db_load *load);

/* --- check.c ---------------------------------------------------------------------------------- */

/*
 * Checks between sections: the same device, address, axis or unit twice; then, if there are no
 * errors, buses that share an interface, the families' checks, and times that cannot be met.
 * Devices are compared by the file system's data of their paths.
 */

/* Called after db_sections_read(). Also fills in times that were not given. */
void db_check(struct db_load *load);

/* --- doors.c ---------------------------------------------------------------------------------- */

/* Warns where everybody could move the drives: by an address, or by writing the files, whose modes
 * it looks at. Called after db_sections_read(). */
void db_doors_check(struct db_load *load);

#endif
