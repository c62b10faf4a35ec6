/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include <math.h>
#include <string.h>

void db_words_encode(const struct db_cell *cell, const void *image, bool low_first, uint16_t *words)
{
	const unsigned char *member = (const unsigned char *)image + cell->offset;
	union db_value value;
	uint64_t wide;
	uint16_t narrow;
	bool ended = false;

	if (cell->flags & DB_CELL_GAP) {
		words[0] = 0;
		return;
	}
	switch ((enum db_type)cell->type) {
	case DB_TEXT:
		for (unsigned i = 0; i < 2u * cell->registers; i++) {
			unsigned character = ended ? 0 : member[i];

			ended = character == 0;
			if (i % 2 == 0)
				words[i / 2] = (uint16_t)(character << 8);
			else
				words[i / 2] = (uint16_t)(words[i / 2] | character);
		}
		return;
	case DB_U64:
		memcpy(&wide, member, sizeof(wide));
		for (unsigned i = 0; i < 4; i++) {
			words[low_first ? i : 3 - i] = (uint16_t)wide;
			wide >>= 16;
		}
		return;
	case DB_U32:
	case DB_I32:
	case DB_F32:
	case DB_BITS32:
		memcpy(&value, member, sizeof(value));
		words[low_first] = (uint16_t)(value.u >> 16);
		words[!low_first] = (uint16_t)value.u;
		return;
	default:
		break;
	}
	/* Parameters are 32 bits wide in the image for all types. */
	if (cell->flags & DB_ROW_PARAM) {
		memcpy(&value, member, sizeof(value));
		narrow = (uint16_t)value.u;
	} else {
		memcpy(&narrow, member, sizeof(narrow));
	}
	words[0] = narrow;
}

bool db_words_decode(const struct db_cell *cell, const uint16_t *words, bool low_first,
                     union db_value *value)
{
	switch ((enum db_type)cell->type) {
	case DB_U32:
	case DB_I32:
	case DB_F32:
	case DB_BITS32:
		value->u = (uint32_t)words[low_first] << 16 | words[!low_first];
		break;
	case DB_I16:
		value->i = (int16_t)words[0];
		break;
	default:
		value->u = words[0];
		break;
	}
	return cell->type != DB_F32 || isfinite(value->f);
}

void db_words_store(const struct db_cell *cell, union db_value value, void *image)
{
	unsigned char *member = (unsigned char *)image + cell->offset;
	uint16_t narrow = (uint16_t)value.u;

	if (cell->registers == 1)
		memcpy(member, &narrow, sizeof(narrow));
	else
		memcpy(member, &value, sizeof(value));
}
