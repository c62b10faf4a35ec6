/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All files of a configuration as one text, which is kept in one file: that is there as a whole or not at all. The texts
 * stand in it as they were written, each after a line with its path, so people can read it, too. Pure.
 */
#ifndef DRIVEBRIDGE_CONFIG_COPY_H
#define DRIVEBRIDGE_CONFIG_COPY_H

#include "reader/source.h"

/* To be freed; null when out of memory, or when a path has a line end. */
char *db_copy_write(const struct db_source *sources, size_t count);

/* The sources again, to be freed by db_sources_free(). False when the text is not, or not exactly, what was written. */
bool db_copy_read(const char *text, struct db_source **sources, size_t *count);

#endif
