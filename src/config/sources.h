/* SPDX-License-Identifier: Apache-2.0 */
/* The files of a configuration and their texts. */
#ifndef DRIVEBRIDGE_CONFIG_SOURCES_H
#define DRIVEBRIDGE_CONFIG_SOURCES_H

#include "drivebridge/config.h"

/*
 * Reads the file at `path` and those of the folder conf.d beside it, in the order of their names. 0, or
 * -1 after a message to `errors` for each that cannot be read. To be freed by db_sources_free() either
 * way.
 */
int db_sources_read(const char *path, FILE *errors, struct db_config_source **sources,
                    size_t *count);

/* One source with this text. Null when out of memory. */
struct db_config_source *db_sources_of_text(const char *path, const char *text);

void db_sources_free(struct db_config_source *sources, size_t count);

/* All texts, a line end behind each; fills where they begin. To be freed; null when out of memory. */
char *db_sources_join(struct db_config_source *sources, size_t count);

#endif
