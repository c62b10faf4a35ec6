/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/enumerations.h"
#include "opcua/types.h"
#include "opcua/values.h"

#include <open62541/types_generated.h>
#include <stdlib.h>
#include <string.h>

/* The array, and its types behind it. */
struct enumerations {
	UA_DataTypeArray array;
	UA_DataType types[];
};

static bool is_enumeration(const struct db_opcua_type_row *row)
{
	return row->class == DB_OPCUA_DATA_TYPE_ROW && db_opcua_type_is_enumeration(row);
}

/* A field of the library's array is constant. */
static void set_array(UA_DataTypeArray *array, const UA_DataType *types, size_t count)
{
	const UA_DataTypeArray filled = { .typesSize = count, .types = types, .cleanup = false };

	/* gcc's analyzer takes the types for lost here. */
	memcpy(array, &filled, sizeof(filled));
}

UA_DataTypeArray *db_opcua_enumerations_new(UA_UInt16 types)
{
	struct enumerations *made;
	size_t count = 0;

	for (size_t i = 0; i < db_opcua_type_count; i++)
		count += is_enumeration(&db_opcua_type_rows[i]);
	made = calloc(1, sizeof(*made) + count * sizeof(made->types[0]));
	if (!made)
		return NULL;
	count = 0;
	for (size_t i = 0; i < db_opcua_type_count; i++) {
		const struct db_opcua_type_row *row = &db_opcua_type_rows[i];
		UA_DataType *type = &made->types[count];

		if (!is_enumeration(row))
			continue;
		/* As the library describes one of the standard. */
		*type = UA_TYPES[UA_TYPES_SERVERSTATE];
		type->typeName = row->id;
		type->typeId = (UA_NodeId){ .namespaceIndex = types,
			                    .identifierType = UA_NODEIDTYPE_STRING,
			                    .identifier.string = db_opcua_string(row->id) };
		type->binaryEncodingId = UA_NODEID_NULL;
		count++;
	}
	set_array(&made->array, made->types, count);
	return &made->array;
}
