/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of a unit: its tables, each with its index. No thread of its own. */
#ifndef DRIVEBRIDGE_REGMAP_MAP_H
#define DRIVEBRIDGE_REGMAP_MAP_H

#include "regmap/index.h"
#include "regmap/name_list.h"

/* Drives of a family share theirs. */
struct db_map {
	struct db_map *next;            /* families only */
	const struct db_driver *driver; /* null: the gateway's */
	struct db_index holding;
	struct db_index discrete;
	struct db_index coils;
	/* Null until a client first uses names, see named.h; the second one for the gateway
	 * only. */
	struct db_name_list *names;
	struct db_name_list *windows;
};

/* 0 or -ENOMEM; must also be released after a failure. */
int db_map_init(struct db_map *map, const struct db_scope *scope);
void db_map_release(struct db_map *map);

/* The map of a driver, from a list to which it is added when its first drive is added. Null when
 * out of memory. */
const struct db_map *db_map_of_family(struct db_map **families, const struct db_driver *driver);
void db_map_free_families(struct db_map *families);

#endif
