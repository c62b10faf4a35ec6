/* SPDX-License-Identifier: Apache-2.0 */
/* Values and registers as JSON, and back. Pure but for jansson's memory. */
#ifndef DRIVEBRIDGE_CONTROL_VALUES_H
#define DRIVEBRIDGE_CONTROL_VALUES_H

#include "regmap/named.h"

#include <jansson.h>

#define DB_REASON_MAX 160

/* A text from a drive, which may contain any bytes. */
json_t *db_values_text(const char *text);

/* A db_named_visit_fn; the context is the object (json_t) that gets the value under its name. */
void db_values_collect(void *context, const char *name, const struct db_entry *entry,
                       const struct db_named_value *value);

/* The number of a JSON value in this register: a number, a boolean, or the name of one of its
 * codes. False, and why, for what cannot be one of its values. */
bool db_values_from_json(const struct db_entry *entry, const json_t *json, double *number,
                         char reason[DB_REASON_MAX]);

/* A register with all its data. */
json_t *db_values_register(const struct db_entry *entry, const char *unit);

#endif
