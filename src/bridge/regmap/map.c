/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/map.h"

#include <errno.h>
#include <stdlib.h>

int db_map_init(struct db_map *map, const struct db_scope *scope)
{
	map->driver = scope->driver;
	if (db_index_init(&map->holding, scope, DB_TABLE_HOLDING) != 0 ||
	    db_index_init(&map->discrete, scope, DB_TABLE_DISCRETE) != 0 ||
	    db_index_init(&map->coils, scope, DB_TABLE_COILS) != 0)
		return -ENOMEM;
	return 0;
}

void db_map_release(struct db_map *map)
{
	db_index_release(&map->holding);
	db_index_release(&map->discrete);
	db_index_release(&map->coils);
	db_name_list_free(map->names);
	db_name_list_free(map->windows);
}

const struct db_map *db_map_of_family(struct db_map **families, const struct db_driver *driver)
{
	struct db_scope scope = { .view = DB_VIEW_DRIVE, .driver = driver };
	struct db_map *map = *families;

	while (map && map->driver != driver)
		map = map->next;
	if (map)
		return map;
	map = calloc(1, sizeof(*map));
	if (map && db_map_init(map, &scope) != 0) {
		db_map_release(map);
		free(map);
		return NULL;
	}
	if (map) {
		map->next = *families;
		*families = map;
	}
	return map;
}

void db_map_free_families(struct db_map *families)
{
	while (families) {
		struct db_map *next = families->next;

		db_map_release(families);
		free(families);
		families = next;
	}
}
