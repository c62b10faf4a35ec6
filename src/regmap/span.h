/* SPDX-License-Identifier: Apache-2.0 */
/* The registers or coils that a write covers, and whether it may. Pure. */
#ifndef DRIVEBRIDGE_REGMAP_SPAN_H
#define DRIVEBRIDGE_REGMAP_SPAN_H

#include "regmap/index.h"

#include <stdbool.h>
#include <stdint.h>

struct db_span {
	const struct db_cell *cells;
	uint16_t count;
};

/* 0 when every register exists, may be written, and belongs to the same block as the others; else
 * 02. */
uint8_t db_span_find(const struct db_index *index, uint16_t address, uint16_t count,
                     struct db_span *span);

/* Half of a 32-bit value cannot be written. */
bool db_span_is_whole(const struct db_span *span, uint16_t address, uint16_t count);

/* The same for one register: 0, 02, or 03 when it is half of a value. */
uint8_t db_span_find_single(const struct db_index *index, uint16_t address, struct db_span *span);

#endif
