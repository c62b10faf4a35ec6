/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/name_list.h"

#include <stdlib.h>
#include <string.h>

struct filling {
	struct db_name_list *names; /* null: entries are only counted */
	bool (*wanted)(const struct db_entry *entry);
	size_t count;
};

static void add_entry(void *context, const struct db_entry *entry)
{
	struct filling *filling = context;

	if (entry->name[0] == '\0' || !filling->wanted(entry))
		return;
	if (filling->names)
		filling->names->entries[filling->count] = *entry;
	filling->count++;
}

static int by_place(const void *a, const void *b)
{
	static const int order[] = {
		[DB_TABLE_HOLDING] = 0,
		[DB_TABLE_INPUT] = 1,
		[DB_TABLE_DISCRETE] = 2,
		[DB_TABLE_COILS] = 3,
	};
	const struct db_entry *left = a;
	const struct db_entry *right = b;

	if (left->table != right->table)
		return order[left->table] - order[right->table];
	return (left->cell.address > right->cell.address) -
	       (left->cell.address < right->cell.address);
}

static int by_name(const void *a, const void *b, void *context)
{
	const struct db_entry *entries = context;
	uint16_t left = *(const uint16_t *)a;
	uint16_t right = *(const uint16_t *)b;
	int order = strcmp(entries[left].name, entries[right].name);

	return order != 0 ? order : (left > right) - (left < right);
}

struct db_name_list *db_name_list_new(const struct db_scope *scope,
                                      bool (*wanted)(const struct db_entry *entry))
{
	struct db_name_list *names = calloc(1, sizeof(*names));
	struct filling filling = { .wanted = wanted };
	size_t kept = 0;

	if (!names)
		return NULL;
	db_table_visit(scope, add_entry, &filling);
	names->count = filling.count;
	names->entries = calloc(names->count + 1, sizeof(names->entries[0]));
	names->by_name = calloc(names->count + 1, sizeof(names->by_name[0]));
	if (!names->entries || !names->by_name) {
		db_name_list_free(names);
		return NULL;
	}
	filling = (struct filling){ .names = names, .wanted = wanted };
	db_table_visit(scope, add_entry, &filling);
	qsort(names->entries, names->count, sizeof(names->entries[0]), by_place);
	for (size_t i = 0; i < names->count; i++)
		names->by_name[i] = (uint16_t)i;
	qsort_r(names->by_name, names->count, sizeof(names->by_name[0]), by_name, names->entries);
	/* A neutral name takes precedence over a vendor's parameter of the same name. */
	for (size_t i = 0; i < names->count; i++) {
		const char *name = names->entries[names->by_name[i]].name;

		if (kept == 0 || strcmp(names->entries[names->by_name[kept - 1]].name, name) != 0)
			names->by_name[kept++] = names->by_name[i];
		else
			names->entries[names->by_name[i]].name[0] = '\0';
	}
	if (kept == names->count)
		return names;
	kept = 0;
	for (size_t i = 0; i < names->count; i++) {
		if (names->entries[i].name[0] != '\0')
			names->entries[kept++] = names->entries[i];
	}
	names->count = kept;
	for (size_t i = 0; i < kept; i++)
		names->by_name[i] = (uint16_t)i;
	qsort_r(names->by_name, kept, sizeof(names->by_name[0]), by_name, names->entries);
	return names;
}

void db_name_list_free(struct db_name_list *names)
{
	if (!names)
		return;
	free(names->entries);
	free(names->by_name);
	free(names);
}

const struct db_entry *db_name_list_find(const struct db_name_list *names, const char *name)
{
	size_t low = 0;
	size_t high = names->count;

	while (low < high) {
		size_t middle = low + (high - low) / 2;
		const struct db_entry *entry = &names->entries[names->by_name[middle]];
		int order = strcmp(name, entry->name);

		if (order == 0)
			return entry;
		if (order < 0)
			high = middle;
		else
			low = middle + 1;
	}
	return NULL;
}
