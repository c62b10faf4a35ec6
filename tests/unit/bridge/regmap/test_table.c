/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/command_table.h"
#include "regmap/image.h"
#include "regmap/index.h"
#include "regmap/regmap_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define ENTRIES_MAX 8192

/* A family that has every measure and parameters that need gaps. */
static const struct db_param params[] = {
	{ "first", DB_U16, "", 0, 9, false, .description = "first" },
	{ "second", DB_F32, "A", 0, 9, false, .description = "second" },
	{ "third", DB_I16, "", -9, 9, false, .description = "third" },
	{ "fourth", DB_U16, "", 0, 9, false, .description = "fourth" },
	{ "fifth", DB_I32, "", -9, 9, false, .description = "fifth" },
};

static const struct db_driver everything = {
	.name = "everything",
	.measures = 0x7F,
	.output_count = 40,
	.params = params,
	.param_count = 5,
	.param_page = 1,
	.acceleration_param = 1,
	.deceleration_param = -1,
};

struct list {
	struct db_entry entries[ENTRIES_MAX];
	size_t count;
};

static void append(void *context, const struct db_entry *entry)
{
	struct list *list = context;

	assert_true(list->count < ENTRIES_MAX);
	list->entries[list->count++] = *entry;
}

static const struct db_scope scopes[] = {
	{ .view = DB_VIEW_DRIVE, .driver = &everything },
	{ .view = DB_VIEW_GATEWAY, .buses = 100, .drives = 100 },
	{ .view = DB_VIEW_GATEWAY, .buses = 1, .drives = 1 },
};

/* Calls check() with every scope, those of the families built in too. */
static void each_scope(void (*check)(const struct db_scope *scope))
{
	for (size_t i = 0; i < sizeof scopes / sizeof scopes[0]; i++)
		check(&scopes[i]);
	for (size_t i = 0; db_drivers[i]; i++) {
		struct db_scope scope = { .view = DB_VIEW_DRIVE, .driver = db_drivers[i] };

		check(&scope);
	}
}

/* They are written through buffers of this size. */
static void check_lengths(const struct db_scope *scope)
{
	static struct list list;

	list.count = 0;
	db_table_visit(scope, append, &list);
	for (size_t i = 0; i < list.count; i++)
		assert_true(list.entries[i].cell.registers <= DB_CELL_REGISTERS_MAX);
}

static void no_register_is_longer_than_the_buffers(void **state)
{
	(void)state;
	each_scope(check_lengths);
}

static void check_overlaps(const struct db_scope *scope)
{
	static uint8_t taken[4][DB_ADDRESS_LIMIT];
	static struct list list;

	memset(taken, 0, sizeof taken);
	list.count = 0;
	db_table_visit(scope, append, &list);
	for (size_t i = 0; i < list.count; i++) {
		const struct db_cell *cell = &list.entries[i].cell;

		assert_true(cell->registers > 0);
		assert_true(cell->address + cell->registers <= DB_ADDRESS_LIMIT);
		for (unsigned j = 0; j < cell->registers; j++) {
			assert_int_equal(taken[list.entries[i].table][cell->address + j], 0);
			taken[list.entries[i].table][cell->address + j] = 1;
		}
	}
}

static void no_overlaps(void **state)
{
	(void)state;
	each_scope(check_overlaps);
}

static void check_alignment(const struct db_scope *scope)
{
	static struct list list;

	list.count = 0;
	db_table_visit(scope, append, &list);
	for (size_t i = 0; i < list.count; i++) {
		const struct db_cell *cell = &list.entries[i].cell;

		if (list.entries[i].table == DB_TABLE_HOLDING && cell->registers > 1)
			assert_int_equal(cell->address % 2, 0);
		if (list.entries[i].table == DB_TABLE_HOLDING && cell->type == DB_U64)
			assert_int_equal(cell->address % 4, 0);
	}
}

static void wide_registers_are_aligned(void **state)
{
	(void)state;
	each_scope(check_alignment);
}

static void check_names(const struct db_scope *scope)
{
	static struct list list;

	list.count = 0;
	db_table_visit(scope, append, &list);
	for (size_t i = 0; i < list.count; i++) {
		const char *name = list.entries[i].name;

		if (list.entries[i].cell.flags & DB_CELL_GAP) {
			assert_string_equal(name, "");
			continue;
		}
		assert_true(strlen(name) > 0 && strlen(name) < DB_ROW_NAME_MAX - 1);
		assert_null(strchr(name, '#'));
		assert_string_not_equal(name, "unknown");
		for (size_t j = 0; j < i; j++)
			assert_string_not_equal(name, list.entries[j].name);
	}
}

static void names_are_unique(void **state)
{
	(void)state;
	each_scope(check_names);
}

static void rows_are_in_order_and_described(void **state)
{
	(void)state;
	for (size_t i = 0; db_row_sets[i]; i++) {
		for (size_t j = 0; j < db_row_sets[i]->count; j++) {
			const struct db_row *row = &db_row_sets[i]->rows[j];

			assert_true(strlen(row->description) > 0);
			assert_null(strpbrk(row->description, ",\"\n|"));
			assert_true(row->part != 0);
			if (j > 0)
				assert_true(row->address > row[-1].address);
		}
	}
}

static void command_block_fits_a_scanner(void **state)
{
	struct db_index index;
	uint16_t cells;
	uint16_t end = 100;

	(void)state;
	assert_int_equal(db_index_init(&index, &scopes[0], DB_TABLE_HOLDING), 0);
	while (index.lookup[end] < DB_GAP_CELL)
		end++;
	assert_true(end > 100 && end - 100 <= 100);
	assert_int_equal(db_index_find(&index, 100, (uint16_t)(end - 100), &cells),
	                 index.lookup[100]);
	for (uint16_t i = 0; i < cells; i++)
		assert_int_equal(index.cells[index.lookup[100] + i].part, DB_PART_BLOCK);
	db_index_release(&index);
}

/* Cells are found where every address of the range has one, and nowhere else. */
static void ranges_with_a_gap_have_no_cells(void **state)
{
	struct db_index index;

	(void)state;
	assert_int_equal(db_index_init(&index, &scopes[0], DB_TABLE_HOLDING), 0);
	for (unsigned address = 0; address <= index.limit; address++) {
		bool whole = true;

		for (uint16_t count = 1; count <= 4; count++) {
			unsigned last = address + count - 1u;
			uint16_t cells = 0;
			uint16_t first = db_index_find(&index, (uint16_t)address, count, &cells);

			whole = whole && last < index.limit && index.lookup[last] < DB_GAP_CELL;
			assert_int_equal(first != DB_NO_CELL, whole);
			if (!whole)
				continue;
			assert_int_equal(first, index.lookup[address]);
			assert_int_equal(first + cells - 1, index.lookup[last]);
		}
	}
	db_index_release(&index);
}

/* Every block can be read in one piece: the first 36 registers, and the parameters. */
static void blocks_have_no_holes(void **state)
{
	(void)state;
	for (size_t i = 0; db_drivers[i]; i++) {
		struct db_scope scope = { .view = DB_VIEW_DRIVE, .driver = db_drivers[i] };
		struct db_index index;
		uint16_t cells;
		uint16_t end;

		assert_int_equal(db_index_init(&index, &scope, DB_TABLE_HOLDING), 0);
		assert_int_not_equal(db_index_find(&index, 0, 30, &cells), DB_NO_CELL);
		end = (uint16_t)(DB_PARAM_BASE + DB_PARAM_PAGE * db_drivers[i]->param_page);
		while (end < index.limit && index.lookup[end] < DB_GAP_CELL)
			end++;
		assert_true(index.cells[index.lookup[end - 1]].param ==
		            db_drivers[i]->param_count - 1);
		assert_int_not_equal(db_index_find(&index, 1000, 56, &cells), DB_NO_CELL);
		db_index_release(&index);
	}
}

static void parameters_stand_in_order_with_gaps(void **state)
{
	struct db_index index;
	uint16_t cells;
	uint16_t first;

	(void)state;
	assert_int_equal(db_index_init(&index, &scopes[0], DB_TABLE_HOLDING), 0);
	first = db_index_find(&index, 400, 8, &cells);
	assert_int_not_equal(first, DB_NO_CELL);
	assert_int_equal(cells, 6);
	assert_true(index.cells[first + 1].flags & DB_CELL_GAP);
	assert_int_equal(index.cells[first + 2].address, 402);
	assert_int_equal(index.cells[first + 5].address, 406);
	assert_int_equal(index.cells[first + 5].param, 4);
	/* `acceleration` is the second parameter under another name, `deceleration` does not exist. */
	assert_int_equal(index.cells[index.lookup[32]].param, 1);
	assert_int_equal(index.cells[index.lookup[32]].offset, index.cells[first + 2].offset);
	assert_int_equal(index.lookup[34], DB_GAP_CELL);
	db_index_release(&index);
}

static void finding_stops_at_holes_and_ends(void **state)
{
	struct db_index index;
	uint16_t cells;

	(void)state;
	assert_int_equal(db_index_init(&index, &scopes[0], DB_TABLE_HOLDING), 0);
	assert_int_equal(db_index_find(&index, 0, 0, &cells), DB_NO_CELL);
	assert_int_equal(db_index_find(&index, 32, 4, &cells), DB_NO_CELL);
	assert_int_equal(db_index_find(&index, 32, 6, &cells), DB_NO_CELL);
	assert_int_equal(db_index_find(&index, UINT16_MAX, 1, &cells), DB_NO_CELL);
	assert_int_equal(db_index_find(&index, UINT16_MAX, UINT16_MAX, &cells), DB_NO_CELL);
	/* Halves of wide registers. */
	assert_int_not_equal(db_index_find(&index, 3, 2, &cells), DB_NO_CELL);
	assert_int_equal(cells, 2);
	db_index_release(&index);
}

/* Reading goes across holes, where there is something, and an area. */
static void touching_goes_across_holes_of_an_area(void **state)
{
	struct db_index index;
	uint16_t cells;

	(void)state;
	assert_int_equal(db_index_init(&index, &scopes[0], DB_TABLE_HOLDING), 0);
	assert_int_equal(db_index_touch(&index, 34, 1, &cells), DB_NO_CELL);
	assert_int_equal(db_index_touch(&index, 32, 4, &cells), index.lookup[32]);
	assert_int_equal(cells, 1);
	assert_int_equal(db_index_touch(&index, 0, 100, &cells), 0);
	assert_int_equal(cells, index.lookup[100]);
	assert_int_equal(db_index_touch(&index, 98, 2, &cells), DB_NO_CELL);
	assert_int_equal(db_index_touch(&index, 990, 20, &cells), DB_NO_CELL);
	assert_int_equal(db_index_touch(&index, 0, 0, &cells), DB_NO_CELL);
	assert_int_equal(db_index_touch(&index, UINT16_MAX, UINT16_MAX, &cells), DB_NO_CELL);
	db_index_release(&index);
}

/* Ascending, apart from each other, and with every register of theirs inside. */
static void areas_are_in_order(void **state)
{
	(void)state;
	for (size_t i = 0; i < db_area_count; i++) {
		const struct db_area *area = &db_areas[i];

		assert_true(area->first <= area->last);
		for (size_t j = 0; j < i; j++) {
			if (db_areas[j].view == area->view && db_areas[j].table == area->table)
				assert_true(db_areas[j].last < area->first);
		}
	}
}

/* The first pages are among the areas of all families; those of later ones have their own. */
static void each_page_of_parameters_is_an_area(void **state)
{
	static const struct {
		unsigned page;
		bool has_area;
		unsigned first;
		unsigned size;
	} pages[] = {
		{ 0, false, 200, 0 },
		{ 2, false, 600, 0 },
		{ 3, true, 800, DB_PARAM_PAGE },
		{ DB_PARAM_LARGE, true, DB_PARAM_LARGE_BASE, DB_PARAM_LARGE_PAGE },
		{ DB_PARAM_LARGE + 2, true, DB_PARAM_LARGE_BASE + 2 * DB_PARAM_LARGE_PAGE,
		  DB_PARAM_LARGE_PAGE },
	};

	(void)state;
	for (size_t i = 0; i < sizeof pages / sizeof pages[0]; i++) {
		struct db_driver family = everything;
		struct db_area area;

		family.param_page = (uint8_t)pages[i].page;
		assert_int_equal(db_param_first(&family), pages[i].first);
		assert_int_equal(db_param_area(&family, &area), pages[i].has_area);
		if (!pages[i].has_area)
			continue;
		assert_int_equal(area.first, pages[i].first);
		assert_int_equal(area.last, pages[i].first + pages[i].size - 1);
		/* One without parameters has none. */
		family.param_count = 0;
		assert_false(db_param_area(&family, &area));
	}
}

static void only_what_exists_has_registers(void **state)
{
	struct db_index index;

	(void)state;
	assert_int_equal(db_index_init(&index, &scopes[2], DB_TABLE_HOLDING), 0);
	assert_int_not_equal(index.lookup[100], DB_NO_CELL);
	assert_int_equal(index.lookup[140], DB_NO_CELL);
	assert_int_not_equal(index.lookup[1015], DB_NO_CELL);
	assert_int_equal(index.lookup[1016], DB_NO_CELL);
	assert_int_not_equal(index.lookup[2023], DB_NO_CELL);
	assert_int_equal(index.lookup[2024], DB_GAP_CELL);
	assert_int_equal(index.limit, 2000 + 24 * 247);
	db_index_release(&index);
	assert_int_equal(db_index_init(&index, &scopes[0], DB_TABLE_COILS), 0);
	assert_int_equal(index.count, 16);
	db_index_release(&index);
}

static void names_that_others_rely_on(void **state)
{
	static const char *const wanted[] = {
		"axis_state",     "status",          "error",           "quality",
		"age_ms",         "timestamp_us",    "position",        "velocity",
		"position_units", "velocity_units",  "drive_status",    "command_id",
		"command",        "target_position", "target_velocity", "result_id",
		"result",         "capabilities",    "inputs",          "outputs",
		"acceleration",   "program",         "program_state",   "current",
		"fault_bits",     "supply_voltage",  "temperature",
	};
	static struct list list;

	(void)state;
	list.count = 0;
	db_table_visit(&scopes[0], append, &list);
	for (size_t i = 0; i < sizeof wanted / sizeof wanted[0]; i++) {
		size_t j = 0;

		while (j < list.count && strcmp(list.entries[j].name, wanted[i]) != 0)
			j++;
		assert_true(j < list.count);
	}
}

static void every_command_has_one_row(void **state)
{
	uint64_t known = 0;

	(void)state;
	for (size_t i = 0; i < db_command_row_count; i++) {
		const struct db_command_row *row = &db_command_rows[i];

		if (i > 0)
			assert_true(row->code > db_command_rows[i - 1].code);
		assert_true(row->code > DB_CMD_NONE && row->code < DB_CMD_LIMIT);
		assert_ptr_equal(db_command_find((unsigned)row->code), row);
		assert_string_equal(db_command_name((unsigned)row->code), row->name);
		known |= DB_COMMAND_BIT(row->code);
	}
	for (size_t i = 0; db_drivers[i]; i++)
		assert_true((db_drivers[i]->commands & ~known) == 0);
	assert_null(db_command_find(DB_CMD_NONE));
	assert_null(db_command_find(UINT16_MAX));
	assert_string_equal(db_command_name(0), "none");
	assert_string_equal(db_command_name(63), "unknown");
}

static void arguments_are_registers(void **state)
{
	(void)state;
	for (unsigned arg = DB_ARG_NONE + 1; arg < DB_ARG_COUNT; arg++) {
		size_t offset = offsetof(struct db_drive_image, block.args) +
		                db_arg_rows[arg].offset;
		unsigned rows = 0;

		for (size_t i = 0; db_row_sets[i]; i++) {
			const struct db_row_set *set = db_row_sets[i];

			for (size_t j = 0; j < set->count; j++)
				rows += set->rows[j].part == DB_PART_BLOCK &&
				        set->rows[j].offset == offset;
		}
		assert_int_equal(rows, 1);
	}
}

static void same_arguments(void **state)
{
	struct db_args a = { .target_position = 1, .shake_time = 2 };
	struct db_args b = a;

	(void)state;
	b.shake_time = 3;
	assert_true(db_command_same_args(DB_CMD_MOVE_ABSOLUTE, &a, &b));
	assert_false(db_command_same_args(DB_CMD_SHAKE_START_TIME, &a, &b));
	assert_true(db_command_same_args(DB_CMD_HOME, &a, &b));
	assert_false(db_command_same_args(63, &a, &a));
}

static void capabilities(void **state)
{
	uint32_t bits = db_capabilities(DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE), DB_MEASURE_INPUTS);
	unsigned count = 0;

	(void)state;
	for (unsigned i = 0; i < 32; i++) {
		if (!(bits >> i & 1))
			continue;
		count++;
		assert_true(strcmp(db_capability_name(i), "move_relative") == 0 ||
		            strcmp(db_capability_name(i), "inputs") == 0);
	}
	assert_int_equal(count, 2);
	assert_string_equal(db_capability_name(31), "unknown");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(no_register_is_longer_than_the_buffers),
		cmocka_unit_test(no_overlaps),
		cmocka_unit_test(wide_registers_are_aligned),
		cmocka_unit_test(names_are_unique),
		cmocka_unit_test(rows_are_in_order_and_described),
		cmocka_unit_test(command_block_fits_a_scanner),
		cmocka_unit_test(ranges_with_a_gap_have_no_cells),
		cmocka_unit_test(blocks_have_no_holes),
		cmocka_unit_test(parameters_stand_in_order_with_gaps),
		cmocka_unit_test(finding_stops_at_holes_and_ends),
		cmocka_unit_test(touching_goes_across_holes_of_an_area),
		cmocka_unit_test(areas_are_in_order),
		cmocka_unit_test(each_page_of_parameters_is_an_area),
		cmocka_unit_test(only_what_exists_has_registers),
		cmocka_unit_test(names_that_others_rely_on),
		cmocka_unit_test(every_command_has_one_row),
		cmocka_unit_test(arguments_are_registers),
		cmocka_unit_test(same_arguments),
		cmocka_unit_test(capabilities),
	};

	return cmocka_run_group_tests_name("table", tests, NULL, NULL);
}
