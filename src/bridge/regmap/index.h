/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The table expanded for one drive family or one gateway: repeats unrolled, vendor parameters given
 * their addresses, and a lookup from address to register in constant time. Only db_index_init()
 * allocates; an index does not change afterwards. One thread.
 */
#ifndef DRIVEBRIDGE_REGMAP_INDEX_H
#define DRIVEBRIDGE_REGMAP_INDEX_H

#include "regmap/table.h"

#define DB_ROW_NAME_MAX 32

/* Data of one register (or bit) for reading and writing. */
struct db_cell {
	uint16_t address;
	uint16_t offset; /* in the image */
	uint16_t part;   /* enum db_part */
	uint8_t registers;
	uint8_t type;   /* enum db_type */
	uint8_t flags;  /* enum db_row_flag and DB_CELL_GAP */
	uint16_t param; /* with DB_ROW_PARAM: index of the parameter */
	uint8_t bit;    /* bit tables: bit in the word at offset */
};

/* Keeps 32-bit parameters on even addresses: reads as 0, accepts only 0. Has no name. */
#define DB_CELL_GAP (1u << 7)

/* One register with all its data. */
struct db_entry {
	struct db_cell cell;
	const struct db_row *row;       /* null for parameters and gaps */
	const struct db_param *param;   /* parameters and their aliases */
	const struct db_drive_bit *bit; /* of drive_status; else null */
	const struct db_driver *driver; /* family of the drive; null: not of a drive */
	enum db_table table;
	unsigned number;            /* number in a repeat, from 1; else 0 */
	char name[DB_ROW_NAME_MAX]; /* "" for gaps */
};

/* What to expand. */
struct db_scope {
	enum db_view view;
	const struct db_driver *driver; /* drive view */
	size_t buses;                   /* gateway view */
	size_t drives;
};

/* Calls visit() for every register of the scope, in the table's order. */
typedef void db_visit_fn(void *context, const struct db_entry *entry);
void db_table_visit(const struct db_scope *scope, db_visit_fn *visit, void *context);

/* For a row with an alias: the index of its parameter in this family; -1: it has none. */
int db_row_param(const struct db_row *row, const struct db_driver *driver);

#define DB_NO_CELL UINT16_MAX
#define DB_GAP_CELL \
	(UINT16_MAX - 1) /* none, inside an area: reads as 0 next to an existing one \
	                  */

/* The registers of one table, ascending, without overlaps. */
struct db_index {
	struct db_cell *cells;
	size_t count;
	uint16_t *lookup; /* by address: its cell, DB_NO_CELL or DB_GAP_CELL */
	size_t limit;     /* no address from here on has a cell */
};

/* For HOLDING, DISCRETE or COILS. 0 or -ENOMEM. */
int db_index_init(struct db_index *index, const struct db_scope *scope, enum db_table table);
void db_index_release(struct db_index *index);

/*
 * The cells that cover `count` addresses: returns the index of the first, their number in *cells.
 * DB_NO_CELL when some address has none.
 */
uint16_t db_index_find(const struct db_index *index, uint16_t address, uint16_t count,
                       uint16_t *cells);

/* The same for reading: the existing ones, where the others belong to an area. DB_NO_CELL when
 * there are none. */
uint16_t db_index_touch(const struct db_index *index, uint16_t address, uint16_t count,
                        uint16_t *cells);

#endif
