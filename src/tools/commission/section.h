/* SPDX-License-Identifier: Apache-2.0 */
/* Today's sections of a drive and its bus from the service's configuration, and the same sections
 * corrected by verdicts. */
#ifndef DRIVEBRIDGE_COMMISSION_SECTION_H
#define DRIVEBRIDGE_COMMISSION_SECTION_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/*
 * The keys of `section` NAME in the file at `path` and those of its folder conf.d: names to texts,
 * lists to arrays of texts, in their order. NULL when no readable file has it: `problem` then has
 * the reason. The caller frees it.
 */
json_t *db_commission_section_read(const char *path, const char *section, const char *name,
                                   char *problem, size_t size);

/* The section with corrected values in place of contradicted ones, each with its reason. Pure but
 * for `out`. */
void db_commission_section_write(FILE *out, const char *section, const char *name, json_t *keys,
                                 const json_t *verdicts);

/* True if a verdict changes anything in that section. Pure. */
bool db_commission_section_changes(const char *section, const json_t *verdicts);

#endif
