/* SPDX-License-Identifier: Apache-2.0 */
/* Lines of RFC 4180: commas, a decimal point, quotes where they are needed, CR LF at the end. */
#ifndef DRIVEBRIDGE_CTL_CSV_H
#define DRIVEBRIDGE_CTL_CSV_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* The next cell, `first` of its line or not. NULL: an empty one. */
void db_ctl_csv_add_text(FILE *file, bool first, const char *text);
/* A number, a boolean (0 or 1), a text; what is not known is empty. */
void db_ctl_csv_add_value(FILE *file, bool first, const json_t *value);
void db_ctl_csv_end_line(FILE *file);

#endif
