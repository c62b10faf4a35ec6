/* SPDX-License-Identifier: Apache-2.0 */
/* Constant values in the address space, in the types of the OPC UA library: the properties of
 * variables and methods. Pure but for memory. */
#ifndef DRIVEBRIDGE_OPCUA_PROPERTIES_H
#define DRIVEBRIDGE_OPCUA_PROPERTIES_H

#include "opcua/references.h"
#include "opcua/tree.h"

#include <open62541/types.h>

/* The type of a branch that is a property (not of one of a drive's identification), and whether it
 * is an array. */
const UA_DataType *db_opcua_property_type(const struct db_opcua_branch *branch, bool *array);
/* Its description. */
const char *db_opcua_property_text(const struct db_opcua_branch *branch);

/* Its value: one, or `count` of them, whose texts belong to the kind; freed with free(). NULL
 * without memory. */
void *db_opcua_property_value(const struct db_opcua_tree *tree,
                              const struct db_opcua_branch *branch, size_t *count);

/* The same of a property of a type. */
const UA_DataType *db_opcua_row_type(const struct db_opcua_type_row *row);
void *db_opcua_row_value(const struct db_opcua_type_row *row, size_t *count);

#endif
