/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/properties.h"
#include "opcua/values.h"

#include <open62541/nodeids.h>
#include <open62541/types_generated.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const UA_DataType *db_opcua_property_type(const struct db_opcua_branch *branch, bool *array)
{
	*array = branch->type != DB_OPCUA_UNIT && branch->type != DB_OPCUA_RANGE;
	switch (branch->type) {
	case DB_OPCUA_UNIT:
		return &UA_TYPES[UA_TYPES_EUINFORMATION];
	case DB_OPCUA_RANGE:
		return &UA_TYPES[UA_TYPES_RANGE];
	default:
		return &UA_TYPES[UA_TYPES_ARGUMENT];
	}
}

const char *db_opcua_property_text(const struct db_opcua_branch *branch)
{
	switch (branch->type) {
	case DB_OPCUA_UNIT:
		return "The unit of the value";
	case DB_OPCUA_RANGE:
		return "The least and the greatest value that is accepted";
	case DB_OPCUA_INPUTS:
		return "What it takes";
	default:
		return "How it ended";
	}
}

static UA_Argument make_argument(const char *name, const char *description, UA_UInt32 type)
{
	return (UA_Argument){ .name = db_opcua_string(name),
		              .description = db_opcua_english(description),
		              .dataType = UA_NODEID_NUMERIC(0, type),
		              .valueRank = UA_VALUERANK_SCALAR };
}

/* The arguments of a command are registers of its drive. */
static void *list_inputs(const struct db_opcua_kind *kind, const json_t *command, size_t *count)
{
	const json_t *names = json_object_get(command, "arguments");
	UA_Argument *arguments = calloc(json_array_size(names) + 1, sizeof(*arguments));
	size_t i;
	const json_t *name;

	*count = 0;
	json_array_foreach(names, i, name)
	{
		const struct db_opcua_register *reg = db_opcua_kind_find(kind,
		                                                         json_string_value(name));

		if (reg && arguments)
			arguments[(*count)++] = make_argument(
				reg->shown, reg->description,
				db_opcua_data_type(reg)->typeId.identifier.numeric);
	}
	return arguments;
}

static void *list_outputs(size_t *count)
{
	UA_Argument *arguments = calloc(DB_OPCUA_OUTPUTS_COUNT, sizeof(*arguments));

	*count = DB_OPCUA_OUTPUTS_COUNT;
	/* gcc's analyzer takes the count for any other number. */
	for (size_t i = 0; arguments && i < *count; i++)
		arguments[i] = make_argument(db_opcua_outputs[i].name, db_opcua_outputs[i].text,
		                             UA_NS0ID_STRING);
	return arguments;
}

void *db_opcua_property_value(const struct db_opcua_tree *tree,
                              const struct db_opcua_branch *branch, size_t *count)
{
	const struct db_opcua_register *reg = &tree->kind->list[branch->place];
	UA_EUInformation *unit;
	UA_Range *range;

	*count = 1;
	switch (branch->type) {
	case DB_OPCUA_UNIT:
		unit = malloc(sizeof(*unit));
		if (unit)
			*unit = db_opcua_unit(reg->unit);
		return unit;
	case DB_OPCUA_RANGE:
		range = malloc(sizeof(*range));
		if (range)
			*range = (UA_Range){ .low = reg->min, .high = reg->max };
		return range;
	case DB_OPCUA_INPUTS:
		return list_inputs(tree->kind, json_array_get(tree->kind->commands, branch->place),
		                   count);
	default:
		return list_outputs(count);
	}
}

/* --- of types --------------------------------------------------------------------------------- */

const UA_DataType *db_opcua_row_type(const struct db_opcua_type_row *row)
{
	switch (row->class) {
	case DB_OPCUA_NAMES_ROW:
		return &UA_TYPES[UA_TYPES_ENUMVALUETYPE];
	case DB_OPCUA_BITS_ROW:
		return &UA_TYPES[UA_TYPES_LOCALIZEDTEXT];
	default:
		return &UA_TYPES[UA_TYPES_ARGUMENT];
	}
}

/* The arguments of a method of a type are variables of its command block, by their names. */
static void *list_row_inputs(const struct db_opcua_type_row *method, size_t *count)
{
	static const char folder[] = "CommandBlock.";
	size_t room = strlen(method->values) / 2 + 1;
	UA_Argument *arguments = calloc(room, sizeof(*arguments));
	const char *at = method->values;

	*count = 0;
	while (arguments && *at) {
		char path[sizeof(folder) + DB_OPCUA_NAME_MAX];
		size_t length = strcspn(at, " ");
		const struct db_opcua_type_row *row;

		snprintf(path, sizeof(path), "%s%.*s", folder, (int)length, at);
		row = db_opcua_type_member(&db_opcua_type_rows[method->above], path);
		if (row)
			arguments[(*count)++] = make_argument(db_opcua_type_name(row), row->text,
			                                      row->basic);
		at += length;
		at += *at == ' ';
	}
	return arguments;
}

void *db_opcua_row_value(const struct db_opcua_type_row *row, size_t *count)
{
	const struct db_opcua_type_row *above = &db_opcua_type_rows[row->above];

	switch (row->class) {
	case DB_OPCUA_NAMES_ROW:
		return db_opcua_enum_values(above->values, count);
	case DB_OPCUA_BITS_ROW:
		return db_opcua_bit_names(above->values, count);
	case DB_OPCUA_INPUTS_ROW:
		return list_row_inputs(above, count);
	default:
		return list_outputs(count);
	}
}
