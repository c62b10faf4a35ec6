/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of a drive family or of the gateway by their names. No thread of its own. */
#ifndef DRIVEBRIDGE_REGMAP_NAME_LIST_H
#define DRIVEBRIDGE_REGMAP_NAME_LIST_H

#include "regmap/index.h"

struct db_name_list {
	struct db_entry *entries; /* by table and address; names are unique */
	uint16_t *by_name;        /* indices in the order of the names */
	size_t count;
};

/* Contains the registers that `wanted` selects. Null when out of memory. */
struct db_name_list *db_name_list_new(const struct db_scope *scope,
                                      bool (*wanted)(const struct db_entry *entry));
void db_name_list_free(struct db_name_list *names); /* null is fine */

/* Null: there is none. */
const struct db_entry *db_name_list_find(const struct db_name_list *names, const char *name);

#endif
