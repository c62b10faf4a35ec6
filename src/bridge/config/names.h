/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The sections and keys that a file may have, including those of the families, and messages about
 * others. Pure.
 */
#ifndef DRIVEBRIDGE_CONFIG_NAMES_H
#define DRIVEBRIDGE_CONFIG_NAMES_H

#include "reader/reader.h"

struct db_config_key;
struct db_driver;

/* Refuses sections and keys that do not exist with these drivers (a null-terminated list), or that
 * occur twice; the section modbus of several files becomes one. */
void db_names_check(const struct db_driver *const *drivers, struct db_reader *reader,
                    struct db_messages *messages);

#define DB_FAMILIES_TEXT_MAX 128

/* Names of the drivers that have this option, separated by spaces. */
void db_names_list_families(const struct db_driver *const *drivers, const char *section,
                            const char *name, char text[DB_FAMILIES_TEXT_MAX]);

/* `families`: "all", or names of families separated by spaces. Both live during the call only. */
typedef void db_names_visit_fn(void *context, const struct db_config_key *key,
                               const char *families);

/*
 * Every key that a file may have with these drivers, section by section: first the keys of the
 * table, then the options of the families. An option that several families declare in the same way
 * is passed once; one they declare differently once for each way.
 */
void db_names_each_key(const struct db_driver *const *drivers, db_names_visit_fn *visit,
                       void *context);

/* The key of the section whose name looks most like this one; null for an unknown section. */
const char *db_names_find_nearest(const struct db_driver *const *drivers, const char *section,
                                  const char *name);

#endif
