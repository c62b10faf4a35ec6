/* SPDX-License-Identifier: Apache-2.0 */
/* The text of a configuration file, of 1 MiB at most. */
#ifndef DRIVEBRIDGE_READER_FILE_H
#define DRIVEBRIDGE_READER_FILE_H

#include <stdio.h>

/*
 * Null after a message to `errors`: it cannot be read, is no file, no text (UTF-16, zero bytes), too long, or just being
 * written. To be freed.
 */
char *db_file_read(const char *path, FILE *errors);

/* "PATH: why", with what to do about it. `error`: an errno. */
void db_file_explain(const char *path, int error, FILE *errors);

#endif
