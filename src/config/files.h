/* SPDX-License-Identifier: Apache-2.0 */
/* The files that make a configuration. */
#ifndef DRIVEBRIDGE_CONFIG_FILES_H
#define DRIVEBRIDGE_CONFIG_FILES_H

#include "reader/source.h"

#include <stdio.h>

/*
 * Reads the file at `path` and those of the folder conf.d beside it, in the order of their names.
 * 0, or -1 after a message to `errors` for each that cannot be read. To be freed by
 * db_sources_free() either way.
 */
int db_files_read(const char *path, FILE *errors, struct db_source **sources, size_t *count);

#endif
