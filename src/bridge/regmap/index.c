/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/index.h"

#include "regmap/image.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* --- expanding -------------------------------------------------------------------------------- */

int db_row_param(const struct db_row *row, const struct db_driver *driver)
{
	switch (row->alias) {
	case DB_ALIAS_ACCELERATION:
		return driver->acceleration_param;
	case DB_ALIAS_DECELERATION:
		return driver->deceleration_param;
	default:
		return -1;
	}
}

static unsigned count_repeats(const struct db_row *row, const struct db_scope *scope)
{
	unsigned count = row->repeat ? row->repeat->count : 1;
	size_t most = count;

	switch (row->repeat ? row->repeat->of : DB_REPEAT_FIXED) {
	case DB_REPEAT_OUTPUTS:
		most = scope->driver->output_count;
		break;
	case DB_REPEAT_STATUS_BITS:
		most = scope->driver->status_bit_count;
		break;
	case DB_REPEAT_BUSES:
		most = scope->buses;
		break;
	case DB_REPEAT_DRIVES:
		most = scope->drives;
		break;
	case DB_REPEAT_FIXED:
	default:
		break;
	}
	return most < count ? (unsigned)most : count;
}

static uint16_t param_offset(size_t param)
{
	return (uint16_t)(offsetof(struct db_drive_image, nameplate.room.values) +
	                  param * sizeof(union db_value));
}

static struct db_entry make_entry(const struct db_row *row, enum db_table table,
                                  const struct db_scope *scope, unsigned index)
{
	const struct db_repeat *repeat = row->repeat;
	struct db_entry entry = {
		.cell = {
			.address = (uint16_t)(row->address +
			                      (repeat ? index * repeat->addresses : 0)),
			.offset = (uint16_t)(row->offset + (repeat ? index * repeat->bytes : 0)),
			.type = (uint8_t)row->type,
			.flags = row->flags,
			.part = row->part,
		},
		.row = row,
		.table = table,
		.driver = scope->driver,
		.number = repeat ? index + 1 : 0,
	};
	const char *name;
	const char *mark;

	if (table != DB_TABLE_HOLDING) {
		entry.cell.registers = 1;
		entry.cell.bit = (uint8_t)index;
	} else if (row->type == DB_TEXT) {
		entry.cell.registers = (uint8_t)row->registers;
	} else {
		entry.cell.registers = (uint8_t)db_type_registers(row->type);
	}
	if (row->alias) {
		size_t param = (size_t)db_row_param(row, scope->driver);

		entry.cell.param = (uint16_t)param;
		entry.cell.offset = param_offset(param);
		entry.param = &scope->driver->params[param];
	}
	/* The name of its own, with "#" replaced by the number. */
	name = row->repeat && row->repeat->name ? row->repeat->name(index) : row->name;
	mark = strchr(name, '#');
	if (mark)
		snprintf(entry.name, DB_ROW_NAME_MAX, "%.*s%u%s", (int)(mark - name), name,
		         index + 1, mark + 1);
	else
		snprintf(entry.name, DB_ROW_NAME_MAX, "%s", name);
	/* The family defines the bits and their vendor's names. */
	if (repeat && repeat->of == DB_REPEAT_STATUS_BITS) {
		entry.bit = &scope->driver->status_bits[index];
		entry.cell.address = (uint16_t)(row->address + entry.bit->bit);
		entry.cell.bit = entry.bit->bit;
		entry.number = 0;
		snprintf(entry.name, sizeof(entry.name), "%.*s%s", (int)strcspn(row->name, "#"),
		         row->name, entry.bit->name);
	}
	return entry;
}

void db_table_visit(const struct db_scope *scope, db_visit_fn *visit, void *context)
{
	for (size_t i = 0; db_row_sets[i]; i++) {
		const struct db_row_set *set = db_row_sets[i];

		for (size_t j = 0; set->view == scope->view && j < set->count; j++) {
			const struct db_row *row = &set->rows[j];
			/* What the family does not have has no register. */
			bool lacks = (row->measure && !(scope->driver->measures & row->measure)) ||
			             (row->alias && db_row_param(row, scope->driver) < 0);
			unsigned count = lacks ? 0 : count_repeats(row, scope);

			for (unsigned index = 0; index < count; index++) {
				struct db_entry entry = make_entry(row, set->table, scope, index);

				visit(context, &entry);
			}
		}
	}
	if (scope->view == DB_VIEW_DRIVE) {
		const struct db_driver *driver = scope->driver;
		unsigned address = db_param_first(driver);

		for (size_t i = 0; i < driver->param_count; i++) {
			const struct db_param *param = &driver->params[i];
			unsigned registers = db_type_registers(param->type);
			struct db_entry entry = { .table = DB_TABLE_HOLDING, .driver = driver };

			if (registers > 1 && address % 2 != 0) {
				entry.cell.address = (uint16_t)address++;
				entry.cell.registers = 1;
				entry.cell.type = DB_U16;
				entry.cell.flags = DB_ROW_WRITABLE | DB_CELL_GAP;
				visit(context, &entry);
			}
			entry.cell = (struct db_cell){
				.address = (uint16_t)address,
				.offset = param_offset(i),
				.registers = (uint8_t)registers,
				.type = (uint8_t)param->type,
				.flags = DB_ROW_WRITABLE | DB_ROW_PARAM,
				.part = DB_PART_PLATE,
				.param = (uint16_t)i,
			};
			entry.param = param;
			snprintf(entry.name, sizeof(entry.name), "%s", param->name);
			visit(context, &entry);
			address += registers;
		}
	}
}

/* --- looking up ------------------------------------------------------------------------------- */

struct filling {
	struct db_index *index;
	enum db_table table;
};

static void count_cell(void *context, const struct db_entry *entry)
{
	struct filling *filling = context;
	size_t end = (size_t)entry->cell.address + entry->cell.registers;

	if (entry->table != filling->table)
		return;
	filling->index->count++;
	if (end > filling->index->limit)
		filling->index->limit = end;
}

static void add_cell(void *context, const struct db_entry *entry)
{
	struct filling *filling = context;

	if (entry->table == filling->table)
		filling->index->cells[filling->index->count++] = entry->cell;
}

/* The next area of the scope, those of all families first; false: there are no more. */
static bool find_next_area(const struct db_scope *scope, enum db_table table, size_t *place,
                           struct db_area *area)
{
	while (*place < db_area_count) {
		*area = db_areas[(*place)++];
		if (area->view == scope->view && area->table == table)
			return true;
	}
	return (*place)++ == db_area_count && scope->view == DB_VIEW_DRIVE &&
	       table == DB_TABLE_HOLDING && db_param_area(scope->driver, area);
}

static int compare_addresses(const void *a, const void *b)
{
	const struct db_cell *left = a;
	const struct db_cell *right = b;

	return (left->address > right->address) - (left->address < right->address);
}

int db_index_init(struct db_index *index, const struct db_scope *scope, enum db_table table)
{
	struct filling filling = { .index = index, .table = table };
	struct db_area area;

	*index = (struct db_index){ 0 };
	db_table_visit(scope, count_cell, &filling);
	for (size_t place = 0; find_next_area(scope, table, &place, &area);) {
		if (area.first < index->limit && area.last >= index->limit)
			index->limit = area.last + (size_t)1;
	}
	index->cells = calloc(index->count + 1, sizeof(index->cells[0]));
	index->lookup = malloc((index->limit + 1) * sizeof(index->lookup[0]));
	if (!index->cells || !index->lookup) {
		db_index_release(index);
		return -ENOMEM;
	}
	index->count = 0;
	db_table_visit(scope, add_cell, &filling);
	qsort(index->cells, index->count, sizeof(index->cells[0]), compare_addresses);
	for (size_t i = 0; i < index->limit; i++)
		index->lookup[i] = DB_NO_CELL;
	for (size_t place = 0; find_next_area(scope, table, &place, &area);) {
		for (size_t i = area.first; i <= area.last && i < index->limit; i++)
			index->lookup[i] = DB_GAP_CELL;
	}
	for (size_t i = 0; i < index->count; i++) {
		for (unsigned j = 0; j < index->cells[i].registers; j++)
			index->lookup[index->cells[i].address + j] = (uint16_t)i;
	}
	return 0;
}

void db_index_release(struct db_index *index)
{
	free(index->cells);
	free(index->lookup);
	*index = (struct db_index){ 0 };
}

uint16_t db_index_find(const struct db_index *index, uint16_t address, uint16_t count,
                       uint16_t *cells)
{
	size_t end = (size_t)address + count;
	uint16_t first;
	size_t last;

	if (count == 0 || end > index->limit)
		return DB_NO_CELL;
	first = index->lookup[address];
	last = index->lookup[end - 1];
	if (first >= DB_GAP_CELL || last >= DB_GAP_CELL)
		return DB_NO_CELL;
	/* Without a gap, the cells' sizes add up to the distance from first to last. */
	for (size_t i = first; i < last; i++) {
		if (index->cells[i].address + index->cells[i].registers !=
		    index->cells[i + 1].address)
			return DB_NO_CELL;
	}
	*cells = (uint16_t)(last - first + 1);
	return first;
}

uint16_t db_index_touch(const struct db_index *index, uint16_t address, uint16_t count,
                        uint16_t *cells)
{
	size_t end = (size_t)address + count;
	uint16_t first = DB_NO_CELL;
	uint16_t last = DB_NO_CELL;

	if (end > index->limit)
		return DB_NO_CELL;
	for (size_t i = address; i < end; i++) {
		if (index->lookup[i] == DB_NO_CELL)
			return DB_NO_CELL;
		if (index->lookup[i] == DB_GAP_CELL)
			continue;
		last = index->lookup[i];
		if (first == DB_NO_CELL)
			first = last;
	}
	*cells = (uint16_t)(last - first + 1);
	return first;
}
