/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include <math.h>
#include <modbus.h>
#include <string.h>

static const struct db_index *table_of(const struct db_map *map, enum db_table table)
{
	switch (table) {
	case DB_TABLE_COILS:
		return &map->coils;
	case DB_TABLE_DISCRETE:
		return &map->discrete;
	default:
		return &map->holding;
	}
}

/* The cells of a read, and everything that decides whether it is allowed. */
struct selection {
	const struct db_cell *cells;
	uint16_t count;
	unsigned parts;
	unsigned flags;
	unsigned without; /* cells with these flags do not exist for this table: 0 */
	uint16_t low;     /* offsets of the first and the last member of the image that is read */
	uint16_t high;
};

static uint8_t select_cells(const struct db_index *index, enum db_table table, uint16_t address,
                            uint16_t count, struct selection *selected)
{
	uint16_t cells = 0;
	uint16_t first = db_index_touch(index, address, count, &cells);

	if (first == DB_NO_CELL)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	*selected = (struct selection){
		.cells = &index->cells[first],
		.count = cells,
		.without = table == DB_TABLE_INPUT ? DB_ROW_WRITABLE : 0,
		.low = UINT16_MAX,
	};
	for (uint16_t i = 0; i < selected->count; i++) {
		if (selected->cells[i].flags & selected->without)
			continue;
		selected->parts |= selected->cells[i].part;
		selected->flags |= selected->cells[i].flags;
		if (selected->cells[i].offset < selected->low)
			selected->low = selected->cells[i].offset;
		if (selected->cells[i].offset > selected->high)
			selected->high = selected->cells[i].offset;
	}
	return selected->low == UINT16_MAX ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS : 0;
}

/* Addresses without a cell are 0. */
static void copy_registers(const struct selection *selected, const void *image, bool low_first,
                           uint16_t address, uint16_t count, uint16_t *values)
{
	unsigned end = (unsigned)address + count;

	memset(values, 0, count * sizeof(values[0]));
	for (uint16_t i = 0; i < selected->count; i++) {
		const struct db_cell *cell = &selected->cells[i];
		uint16_t words[DB_CELL_REGISTERS_MAX];

		if (cell->flags & selected->without)
			continue;
		/* The usual case: whole cells are written directly to their place. */
		if (cell->address >= address && (unsigned)cell->address + cell->registers <= end) {
			db_words_encode(cell, image, low_first, &values[cell->address - address]);
			continue;
		}
		db_words_encode(cell, image, low_first, words);
		for (unsigned j = 0; j < cell->registers; j++) {
			unsigned at = (unsigned)cell->address + j;

			if (at >= address && at < end)
				values[at - address] = words[j];
		}
	}
}

static void copy_bits(const struct selection *selected, const void *image, uint16_t address,
                      uint16_t count, uint16_t *values)
{
	memset(values, 0, count * sizeof(values[0]));
	for (uint16_t i = 0; i < selected->count; i++) {
		const struct db_cell *cell = &selected->cells[i];
		const unsigned char *member = (const unsigned char *)image + cell->offset;
		uint32_t wide;
		uint16_t narrow;

		if (db_type_registers((enum db_type)cell->type) > 1) {
			memcpy(&wide, member, sizeof(wide));
		} else {
			memcpy(&narrow, member, sizeof(narrow));
			wide = narrow;
		}
		values[cell->address - address] = (uint16_t)(wide >> cell->bit & 1);
	}
}

/*
 * Process data never wait for parameters: an unknown parameter reads as 0 or NaN in a block with
 * anything else, and the status bit params_valid shows it. Alone it is refused. A parameter that is
 * unknown after all were read does not exist in this model.
 */
static uint8_t check_params(const struct db_view_drive *drive, const struct selection *selected,
                            struct db_drive_image *image)
{
	bool stale = drive->registers->roster->modbus->stale_values;
	uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;
	bool fresh = (image->feedback.status & wanted) == wanted;
	bool any = false;

	for (uint16_t i = 0; i < selected->count; i++) {
		const struct db_cell *cell = &selected->cells[i];
		union db_value *value;

		/* A gap is no reason to read a block while its parameters are unknown. */
		if (!(cell->flags & DB_ROW_PARAM)) {
			any = any || fresh || !(cell->flags & DB_CELL_GAP);
			continue;
		}
		if (db_params_have(image->nameplate.plate.valid, cell->param) && (fresh || stale)) {
			any = true;
			continue;
		}
		value = &image->nameplate.plate.values[cell->param];
		if (!fresh && cell->type == DB_F32)
			value->f = NAN;
		else
			value->u = 0;
	}
	if (any)
		return 0;
	return fresh ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS :
	               db_exception_unreachable(&image->feedback);
}

/* Old data is never shown as current. */
static bool is_old(const struct db_view_drive *drive, const struct db_feedback *feedback)
{
	return !drive->registers->roster->modbus->stale_values &&
	       (!(feedback->status & DB_STATUS_ONLINE) || feedback->taken == 0);
}

void db_read_image(struct db_drive_image *image, const struct db_view_drive *drive,
                   const struct db_client *client, unsigned parts, uint16_t low, uint16_t high)
{
	const struct db_client *holder;
	db_time now;

	db_image_fill_drive(image, drive, client, parts, low, high);
	now = drive->registers->ops->now(drive->registers->context);
	holder = db_control_holder(&drive->control, now);
	if (parts & DB_PART_PROCESS) {
		image->control_request = holder && holder->id == client->id;
		image->control_port = holder ? holder->port : 0;
		image->control_holder = holder ? db_client_ipv4(holder->address) : 0;
		image->control_remaining_ms = db_control_remaining_ms(&drive->control, now);
	}
	if (parts & DB_PART_HOLDER) {
		memset(image->control_address, 0, sizeof(image->control_address));
		memset(image->control_user, 0, sizeof(image->control_user));
		if (holder)
			db_image_name_client(drive->registers, holder->address,
			                     image->control_address, image->control_user);
	}
}

bool db_read_is_known(const struct db_view_drive *drive, const struct db_drive_image *image,
                      const struct db_cell *cell)
{
	bool stale = drive->registers->roster->modbus->stale_values;
	uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;

	if ((cell->flags & DB_ROW_MEASURED) && is_old(drive, &image->feedback))
		return false;
	if (!(cell->flags & DB_ROW_PARAM))
		return true;
	return db_params_have(image->nameplate.plate.valid, cell->param) &&
	       (stale || (image->feedback.status & wanted) == wanted);
}

uint8_t db_read_drive(const struct db_view_drive *drive, const struct db_client *client,
                      enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	const struct db_modbus_config *modbus = drive->registers->roster->modbus;
	struct db_drive_image image;
	const struct db_feedback *feedback = &image.feedback;
	struct selection selected;
	uint8_t exception = select_cells(table_of(drive->map, table), table, address, count,
	                                 &selected);

	if (exception)
		return exception;
	db_read_image(&image, drive, client, selected.parts, selected.low, selected.high);
	if ((selected.flags & DB_ROW_MEASURED) && is_old(drive, feedback))
		exception = db_exception_unreachable(feedback);
	if (!exception && (selected.flags & DB_ROW_PARAM))
		exception = check_params(drive, &selected, &image);
	if (exception)
		return exception;
	if (table == DB_TABLE_HOLDING || table == DB_TABLE_INPUT)
		copy_registers(&selected, &image, modbus->low_word_first, address, count, values);
	else
		copy_bits(&selected, &image, address, count, values);
	return 0;
}

uint8_t db_read_gateway(const struct db_registers *registers, const struct db_view_space *space,
                        const struct db_client *client, enum db_table table, uint16_t address,
                        uint16_t count, uint16_t *values)
{
	struct db_gateway_image image;
	struct selection selected;
	uint8_t exception = select_cells(table_of(&space->gateway, table), table, address, count,
	                                 &selected);

	if (exception)
		return exception;
	db_image_fill_gateway(&image, registers, space, client, selected.parts, selected.low,
	                      selected.high);
	copy_registers(&selected, &image, registers->roster->modbus->low_word_first, address, count,
	               values);
	return 0;
}
