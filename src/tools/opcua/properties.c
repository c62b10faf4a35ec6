/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/properties.h"
#include "opcua/values.h"

#include <open62541/types_generated.h>
#include <stdlib.h>

const UA_DataType *db_opcua_property_type(const struct db_opcua_branch *branch, bool *array)
{
	*array = branch->type != DB_OPCUA_UNIT && branch->type != DB_OPCUA_RANGE;
	switch (branch->type) {
	case DB_OPCUA_UNIT:
		return &UA_TYPES[UA_TYPES_EUINFORMATION];
	case DB_OPCUA_RANGE:
		return &UA_TYPES[UA_TYPES_RANGE];
	case DB_OPCUA_VALUE_NAMES:
		return &UA_TYPES[UA_TYPES_ENUMVALUETYPE];
	case DB_OPCUA_BIT_NAMES:
		return &UA_TYPES[UA_TYPES_LOCALIZEDTEXT];
	default:
		return &UA_TYPES[UA_TYPES_ARGUMENT];
	}
}

static UA_Argument make_argument(const char *name, const char *description, const UA_DataType *type)
{
	return (UA_Argument){ .name = db_opcua_string(name),
		              .description = db_opcua_english(description),
		              .dataType = type->typeId,
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
			arguments[(*count)++] = make_argument(reg->shown, reg->description,
			                                      db_opcua_data_type(reg->type));
	}
	return arguments;
}

static void *list_outputs(size_t *count)
{
	UA_Argument *arguments = calloc(2, sizeof(*arguments));

	*count = 2;
	if (!arguments)
		return NULL;
	arguments[0] = make_argument(
		"Result",
		"How it ended: ok, unproven (taken, and its protocol shows no more), pending (it goes on)",
		&UA_TYPES[UA_TYPES_STRING]);
	arguments[1] = make_argument("Reason",
	                             "Why it was refused, in words; empty when it was not",
	                             &UA_TYPES[UA_TYPES_STRING]);
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
	case DB_OPCUA_VALUE_NAMES:
		return db_opcua_enum_values(reg->codes, count);
	case DB_OPCUA_BIT_NAMES:
		return db_opcua_bit_names(reg->codes, count);
	case DB_OPCUA_INPUTS:
		return list_inputs(tree->kind, json_array_get(tree->kind->commands, branch->place),
		                   count);
	default:
		return list_outputs(count);
	}
}
