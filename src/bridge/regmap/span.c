/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "regmap/image.h"

#include <modbus.h>

uint8_t db_span_find(const struct db_index *index, uint16_t address, uint16_t count,
                     struct db_span *span)
{
	uint16_t first = db_index_find(index, address, count, &span->count);
	unsigned parts = 0;

	if (first == DB_NO_CELL)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	span->cells = &index->cells[first];
	for (uint16_t i = 0; i < span->count; i++) {
		if (!(span->cells[i].flags & DB_ROW_WRITABLE))
			return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
		parts |= span->cells[i].part;
	}
	return (parts & DB_PART_BLOCK) && (parts & ~(unsigned)DB_PART_BLOCK) ?
	               MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS :
	               0;
}

bool db_span_is_whole(const struct db_span *span, uint16_t address, uint16_t count)
{
	const struct db_cell *last = &span->cells[span->count - 1];

	return span->cells[0].address == address &&
	       last->address + last->registers == address + count;
}

uint8_t db_span_find_single(const struct db_index *index, uint16_t address, struct db_span *span)
{
	uint8_t exception = db_span_find(index, address, 1, span);

	if (exception)
		return exception;
	return db_span_is_whole(span, address, 1) ? 0 : MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
}
