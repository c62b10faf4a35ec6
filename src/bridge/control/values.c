/* SPDX-License-Identifier: Apache-2.0 */
#include "control/values.h"

#include "control/control_private.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DESCRIPTION_MAX 1024

json_t *db_values_text(const char *text)
{
	char clean[256];
	size_t length = 0;

	while (*text) {
		size_t bytes = db_text_character(text);
		size_t taken = bytes > 0 ? bytes : 1;

		if (length + taken > sizeof(clean) - 1)
			break;
		if (bytes > 0)
			memcpy(&clean[length], text, bytes);
		else
			clean[length] = '?';
		length += taken;
		text += taken;
	}
	clean[length] = '\0';
	return json_string(clean);
}

/* The shortest decimal for this float: 0.1, not 0.100000001490116. */
static double shortest(float real)
{
	char text[32];

	for (int digits = 6; digits < 9; digits++) {
		snprintf(text, sizeof(text), "%.*g", digits, (double)real);
		if (fabsf(strtof(text, NULL) - real) <= 0.0f)
			return strtod(text, NULL);
	}
	snprintf(text, sizeof(text), "%.9g", (double)real);
	return strtod(text, NULL);
}

void db_values_collect(void *context, const char *name, const struct db_entry *entry,
                       const struct db_named_value *value)
{
	json_t *json = json_null(); /* for an unknown value */

	(void)entry;
	switch (value->kind) {
	case DB_NAMED_WHOLE:
		json = json_integer(value->whole);
		break;
	case DB_NAMED_REAL:
		if (isfinite(value->real))
			json = json_real(shortest(value->real));
		break;
	case DB_NAMED_TEXT:
		json = db_values_text(value->text);
		break;
	case DB_NAMED_FLAG:
		json = json_boolean(value->whole);
		break;
	case DB_NAMED_UNKNOWN:
	case DB_NAMED_MISSING:
	default:
		break;
	}
	json_object_set_new_nocheck(context, name, json);
}

/* False: the register has no limits here. */
static bool find_limits(const struct db_entry *entry, double *min, double *max)
{
	*min = entry->param ? entry->param->min : entry->row ? entry->row->min : 0.0;
	*max = entry->param ? entry->param->max : entry->row ? entry->row->max : 0.0;
	return *min < 0.0 || *min > 0.0 || *max < 0.0 || *max > 0.0;
}

static const struct db_codes *codes_of(const struct db_entry *entry)
{
	return entry->row && entry->table == DB_TABLE_HOLDING ? entry->row->codes : NULL;
}

static bool find_code(const struct db_entry *entry, const char *name, double *number)
{
	const struct db_codes *codes = codes_of(entry);

	for (unsigned code = 0; codes && !codes->bits && code < codes->count; code++) {
		if (strcmp(codes->name(code), name) == 0 && strcmp(name, "unknown") != 0) {
			*number = code;
			return true;
		}
	}
	return false;
}

bool db_values_from_json(const struct db_entry *entry, const json_t *json, double *number,
                         char reason[DB_REASON_MAX])
{
	enum db_type type = (enum db_type)entry->cell.type;
	union db_value value;
	double min;
	double max;

	if (json_is_boolean(json)) {
		*number = json_is_true(json);
	} else if (json_is_number(json)) {
		*number = json_number_value(json);
	} else if (json_is_string(json)) {
		if (!find_code(entry, json_string_value(json), number)) {
			snprintf(reason, DB_REASON_MAX, "'%.40s' is none of its names",
			         json_string_value(json));
			return false;
		}
	} else {
		snprintf(reason, DB_REASON_MAX, "a number is needed");
		return false;
	}
	if (entry->table == DB_TABLE_COILS) {
		if (*number < 0.0 || *number > 1.0 || floor(*number) < *number) {
			snprintf(reason, DB_REASON_MAX, "true or false is needed");
			return false;
		}
		return true;
	}
	if (!db_value_from_number(type, *number, &value)) {
		snprintf(reason, DB_REASON_MAX, "%.10g is no %s%s", *number, db_type_name(type),
		         type != DB_F32 && floor(*number) < *number ? ", which is whole" : "");
		return false;
	}
	if (find_limits(entry, &min, &max) && (*number < min || *number > max)) {
		snprintf(reason, DB_REASON_MAX, "%.10g is not from %.10g to %.10g%s%s", *number,
		         min, max, entry->param && entry->param->unit[0] ? " " : "",
		         entry->param ? entry->param->unit : "");
		return false;
	}
	return true;
}

/* --- registers -------------------------------------------------------------------------------- */

static json_t *describe(const struct db_entry *entry)
{
	char text[DESCRIPTION_MAX];
	size_t length = 0;

	if (!entry->row)
		return json_string(entry->param->description);
	if (entry->bit) {
		snprintf(text, sizeof(text), "%s: bit %u of drive_status", entry->bit->description,
		         (unsigned)entry->bit->bit);
		return json_string(text);
	}
	for (const char *from = entry->row->description; *from && length + 8 < sizeof(text);
	     from++) {
		if (*from == '#')
			length += (size_t)snprintf(text + length, 8, "%u", entry->number);
		else
			text[length++] = *from;
	}
	text[length] = '\0';
	return json_string(text);
}

static void add_code(json_t *list, unsigned code, const char *name)
{
	char number[12];

	snprintf(number, sizeof(number), "%u", code);
	json_object_set_new(list, number, json_string(name));
}

json_t *db_values_register(const struct db_entry *entry, const char *unit)
{
	static const char *const tables[] = {
		[DB_TABLE_COILS] = "coil",
		[DB_TABLE_DISCRETE] = "discrete",
		[DB_TABLE_HOLDING] = "holding",
		[DB_TABLE_INPUT] = "input",
	};
	const struct db_codes *codes = codes_of(entry);
	const struct db_driver *driver = entry->driver;
	bool bit = entry->table != DB_TABLE_HOLDING;
	json_t *json = json_pack("{s:s, s:s, s:b, s:s, s:b, s:s, s:i}", "name", entry->name, "type",
	                         bit ? "bool" : db_type_name((enum db_type)entry->cell.type),
	                         "writable", (entry->cell.flags & DB_ROW_WRITABLE) != 0, "unit",
	                         unit, "parameter", entry->param && !entry->row, "table",
	                         tables[entry->table], "address", (int)entry->cell.address);
	double min;
	double max;

	if (!bit && find_limits(entry, &min, &max)) {
		json_object_set_new(json, "min", json_real(min));
		json_object_set_new(json, "max", json_real(max));
	}
	if (codes) {
		json_t *list = json_object();

		for (unsigned code = 0; code < codes->count; code++) {
			if (strcmp(codes->name(code), "unknown") != 0)
				add_code(list, code, codes->name(code));
		}
		for (size_t i = 0; codes->faults && driver && i < driver->fault_count; i++)
			add_code(list, driver->faults[i].error, driver->faults[i].name);
		json_object_set_new(json, "codes", list);
	}
	json_object_set_new(json, "description", describe(entry));
	if (!entry->row) {
		json_t *traits = json_array();

		/* For a parameter: what matters to a client that reads or writes them all. */
		for (unsigned trait = 0; trait < DB_PARAM_TRAIT_COUNT; trait++) {
			if (!(entry->param->traits >> trait & 1))
				continue;
			if (1u << trait == DB_PARAM_HAS_PRESET)
				json_object_set_new(json, "default",
				                    json_real(entry->param->preset));
			else
				json_array_append_new(traits,
				                      json_string(db_param_trait_name(trait)));
		}
		if (json_array_size(traits) > 0)
			json_object_set(json, "traits", traits);
		json_decref(traits);
	}
	return json;
}
