/* SPDX-License-Identifier: Apache-2.0 */
/* Our enumerations for the library: without them it takes no value for a variable of such a type.
 * Allocates. */
#ifndef DRIVEBRIDGE_OPCUA_ENUMERATIONS_H
#define DRIVEBRIDGE_OPCUA_ENUMERATIONS_H

#include <open62541/types.h>

/* For the configuration of a server that has the types in this namespace. NULL without memory;
 * the caller frees it after the server. */
UA_DataTypeArray *db_opcua_enumerations_new(UA_UInt16 types);

#endif
