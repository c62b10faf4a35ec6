/* SPDX-License-Identifier: Apache-2.0 */
/* Values, units and codes in the types of the OPC UA library. Pure but for memory. */
#ifndef DRIVEBRIDGE_OPCUA_VALUES_H
#define DRIVEBRIDGE_OPCUA_VALUES_H

#include "opcua/model.h"

#include <open62541/types.h>
#include <open62541/types_generated.h>

/* Texts for the library, which stay the caller's and are not written to. */
UA_String db_opcua_string(const char *text);
UA_LocalizedText db_opcua_english(const char *text);

/* Microseconds since 1970-01-01 UTC, 1 if it is earlier; 0 is none in both. */
int64_t db_opcua_us_of(UA_DateTime date);
UA_DateTime db_opcua_date(int64_t us);

/* The form of a register's values in messages; of an enumeration it is Int32. */
const UA_DataType *db_opcua_data_type(const struct db_opcua_register *reg);

/* The value with its quality and time, for a read of a variable. */
UA_StatusCode db_opcua_value_read(const struct db_opcua_item *item, UA_DataValue *value);
UA_StatusCode db_opcua_value_read_column(const struct db_opcua_drive *drive,
                                         const struct db_opcua_column *column, UA_DataValue *value);

/* A client's value in the service's form: a new value, or the reason why it is not valid. */
UA_StatusCode db_opcua_value_to_json(const UA_Variant *value, json_t **json);

/* Values of the service without a type, a boolean, a number or a text: their type here, and the
 * value for a read of a variable. */
const UA_DataType *db_opcua_json_type(const json_t *json);
UA_StatusCode db_opcua_value_from_json(const json_t *json, int64_t time_us,
                                       enum db_opcua_quality quality, UA_DataValue *value);

/* A unit, with its UNECE code if it has one, else in the namespace of our own units. The texts
 * point to `unit`. */
UA_EUInformation db_opcua_unit(const char *unit);

/* Names of values, in their order; of bits from bit 0 on: of "0=Offline 1=Disabled". An array whose
 * texts belong to `codes`, freed with free(); NULL when there are none or without memory. */
UA_EnumValueType *db_opcua_enum_values(const char *codes, size_t *count);
UA_LocalizedText *db_opcua_bit_names(const char *codes, size_t *count);

#endif
