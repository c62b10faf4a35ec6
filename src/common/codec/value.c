/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/value.h"

#include <math.h>

static const struct {
	const char *name;
	unsigned registers;
} types[] = {
	[DB_U16] = { "u16", 1 },       [DB_I16] = { "i16", 1 },       [DB_U32] = { "u32", 2 },
	[DB_I32] = { "i32", 2 },       [DB_U64] = { "u64", 4 },       [DB_F32] = { "f32", 2 },
	[DB_BITS16] = { "bits16", 1 }, [DB_BITS32] = { "bits32", 2 }, [DB_TEXT] = { "text", 0 },
};

const char *db_type_name(enum db_type type)
{
	return types[type].name;
}

unsigned db_type_registers(enum db_type type)
{
	return types[type].registers;
}

double db_value_number(enum db_type type, union db_value value)
{
	switch (type) {
	case DB_I16:
	case DB_I32:
		return (double)value.i;
	case DB_F32:
		return (double)value.f;
	default:
		return (double)value.u;
	}
}

const char *db_param_trait_name(unsigned bit)
{
	static const char *const names[DB_PARAM_TRAIT_COUNT] = {
		"preset", "address", "derived",  "action", "secret",
		"first",  "last",    "together", "state",  "write_only",
	};

	return names[bit];
}

bool db_value_from_number(enum db_type type, double number, union db_value *value)
{
	float narrowed = (float)number;
	double min = 0.0;
	double max;

	switch (type) {
	case DB_F32:
		if (!isfinite(number) || !isfinite(narrowed))
			return false;
		value->f = narrowed;
		return true;
	case DB_I16:
		min = INT16_MIN;
		max = INT16_MAX;
		break;
	case DB_I32:
		min = INT32_MIN;
		max = INT32_MAX;
		break;
	case DB_U16:
	case DB_BITS16:
		max = UINT16_MAX;
		break;
	case DB_U32:
	case DB_BITS32:
		max = UINT32_MAX;
		break;
	default:
		return false;
	}
	if (!(number >= min && number <= max) || floor(number) != number)
		return false;
	if (min < 0.0)
		value->i = (int32_t)number;
	else
		value->u = (uint32_t)number;
	return true;
}
