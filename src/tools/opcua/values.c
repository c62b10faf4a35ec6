/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/values.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BITS_MAX 32

UA_String db_opcua_string(const char *text)
{
	UA_String string = { .length = strlen(text) };

	/* The library's strings are writable, but it writes only into its own. */
	memcpy(&string.data, &text, sizeof(text));
	return string;
}

UA_LocalizedText db_opcua_english(const char *text)
{
	return (UA_LocalizedText){ .locale = UA_STRING_STATIC("en"),
		                   .text = db_opcua_string(text) };
}

int64_t db_opcua_us_of(UA_DateTime date)
{
	int64_t us = (date - UA_DATETIME_UNIX_EPOCH) / UA_DATETIME_USEC;

	return date == 0 ? 0 : us > 0 ? us : 1;
}

UA_DateTime db_opcua_date(int64_t us)
{
	return us > 0 ? UA_DATETIME_UNIX_EPOCH + us * UA_DATETIME_USEC : 0;
}

static bool is_enumeration(const struct db_opcua_register *reg)
{
	return reg->data && db_opcua_type_is_enumeration(reg->data);
}

const UA_DataType *db_opcua_data_type(const struct db_opcua_register *reg)
{
	static const unsigned places[] = {
		[DB_OPCUA_BOOL] = UA_TYPES_BOOLEAN, [DB_OPCUA_U16] = UA_TYPES_UINT16,
		[DB_OPCUA_I16] = UA_TYPES_INT16,    [DB_OPCUA_U32] = UA_TYPES_UINT32,
		[DB_OPCUA_I32] = UA_TYPES_INT32,    [DB_OPCUA_U64] = UA_TYPES_UINT64,
		[DB_OPCUA_F32] = UA_TYPES_FLOAT,    [DB_OPCUA_TEXT] = UA_TYPES_STRING,
	};

	return &UA_TYPES[is_enumeration(reg) ? UA_TYPES_INT32 : places[reg->type]];
}

/* A value in the form of one of the library's types. Texts stay the item's. */
union plain {
	UA_Boolean flag;
	UA_UInt16 u16;
	UA_Int16 i16;
	UA_UInt32 u32;
	UA_Int32 i32;
	UA_UInt64 u64;
	UA_Float real;
	UA_String text;
};

static union plain plain_of(const struct db_opcua_register *reg, const struct db_opcua_value *value)
{
	union plain plain;

	memset(&plain, 0, sizeof(plain));
	if (!value->known)
		return plain;
	/* Registers with names of values are without a sign. */
	if (is_enumeration(reg)) {
		plain.i32 = (UA_Int32)value->number;
		return plain;
	}
	switch (reg->type) {
	case DB_OPCUA_BOOL:
		plain.flag = value->flag;
		break;
	case DB_OPCUA_U16:
		plain.u16 = (UA_UInt16)value->number;
		break;
	case DB_OPCUA_I16:
		plain.i16 = (UA_Int16)value->whole;
		break;
	case DB_OPCUA_U32:
		plain.u32 = (UA_UInt32)value->number;
		break;
	case DB_OPCUA_I32:
		plain.i32 = (UA_Int32)value->whole;
		break;
	case DB_OPCUA_U64:
		plain.u64 = value->number;
		break;
	case DB_OPCUA_F32:
		plain.real = value->real;
		break;
	case DB_OPCUA_TEXT:
		plain.text = db_opcua_string(value->text);
		break;
	}
	return plain;
}

static UA_StatusCode status_of(enum db_opcua_quality quality)
{
	switch (quality) {
	case DB_OPCUA_GOOD:
		return UA_STATUSCODE_GOOD;
	case DB_OPCUA_UNCERTAIN:
		return UA_STATUSCODE_UNCERTAINLASTUSABLEVALUE;
	case DB_OPCUA_NOTHING_YET:
		return UA_STATUSCODE_BADWAITINGFORINITIALDATA;
	case DB_OPCUA_NO_CONTACT:
	default:
		return UA_STATUSCODE_BADNOCOMMUNICATION;
	}
}

UA_StatusCode db_opcua_value_read(const struct db_opcua_item *item, UA_DataValue *value)
{
	enum db_opcua_quality quality = db_opcua_item_quality(item);
	union plain plain = plain_of(item->reg, &item->value);
	/* For parameters and the bridge's own values: the time of their last change. */
	int64_t us = item->reg->group == DB_OPCUA_PROCESS || item->reg->group == DB_OPCUA_BITS ?
	                     item->drive->time_us :
	                     item->value.since_us;

	value->hasStatus = true;
	value->status = status_of(quality);
	/* Without a source time the library would set the time of reading; 0 means none. */
	value->hasSourceTimestamp = true;
	value->sourceTimestamp = db_opcua_date(us);
	if (quality != DB_OPCUA_GOOD && quality != DB_OPCUA_UNCERTAIN)
		return UA_STATUSCODE_GOOD;
	value->hasValue = true;
	return UA_Variant_setScalarCopy(&value->value, &plain, db_opcua_data_type(item->reg));
}

UA_StatusCode db_opcua_value_read_column(const struct db_opcua_drive *drive,
                                         const struct db_opcua_column *column, UA_DataValue *value)
{
	const UA_DataType *type = db_opcua_data_type(column->first);
	const struct db_opcua_item *newest = &drive->items[column->places[0]];
	char *array = calloc(column->count, type->memSize);
	UA_StatusCode status;

	if (!array)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	for (size_t i = 0; i < column->count; i++) {
		union plain plain = plain_of(column->first, &drive->items[column->places[i]].value);

		memcpy(array + i * type->memSize, &plain, type->memSize);
	}
	status = UA_Variant_setArrayCopy(&value->value, array, column->count, type);
	free(array);
	value->hasValue = status == UA_STATUSCODE_GOOD;
	/* Without one the library would set the time of reading. */
	value->hasSourceTimestamp = true;
	value->sourceTimestamp = db_opcua_date(newest->value.since_us);
	if (!newest->value.known || db_opcua_drive_quality(drive) != DB_OPCUA_GOOD) {
		value->hasStatus = true;
		value->status = newest->value.known ? UA_STATUSCODE_UNCERTAINLASTUSABLEVALUE :
		                                      UA_STATUSCODE_BADWAITINGFORINITIALDATA;
	}
	return status;
}

UA_StatusCode db_opcua_value_to_json(const UA_Variant *value, json_t **json)
{
	double real;

	*json = NULL;
	if (!UA_Variant_isScalar(value))
		return UA_STATUSCODE_BADTYPEMISMATCH;
	if (value->type == &UA_TYPES[UA_TYPES_BOOLEAN])
		*json = json_boolean(*(UA_Boolean *)value->data);
	else if (value->type == &UA_TYPES[UA_TYPES_UINT16])
		*json = json_integer(*(UA_UInt16 *)value->data);
	else if (value->type == &UA_TYPES[UA_TYPES_INT16])
		*json = json_integer(*(UA_Int16 *)value->data);
	else if (value->type == &UA_TYPES[UA_TYPES_UINT32])
		*json = json_integer(*(UA_UInt32 *)value->data);
	else if (value->type == &UA_TYPES[UA_TYPES_INT32] ||
	         value->type->typeKind == UA_DATATYPEKIND_ENUM)
		*json = json_integer(*(UA_Int32 *)value->data);
	else if (value->type == &UA_TYPES[UA_TYPES_FLOAT]) {
		real = (double)*(UA_Float *)value->data;
		if (!isfinite(real))
			return UA_STATUSCODE_BADOUTOFRANGE;
		*json = json_real(real);
	} else {
		return UA_STATUSCODE_BADTYPEMISMATCH;
	}
	return *json ? UA_STATUSCODE_GOOD : UA_STATUSCODE_BADOUTOFMEMORY;
}

const UA_DataType *db_opcua_json_type(const json_t *json)
{
	switch (json_typeof(json)) {
	case JSON_TRUE:
	case JSON_FALSE:
		return &UA_TYPES[UA_TYPES_BOOLEAN];
	case JSON_INTEGER:
		return &UA_TYPES[UA_TYPES_INT64];
	case JSON_REAL:
		return &UA_TYPES[UA_TYPES_DOUBLE];
	case JSON_STRING:
		return &UA_TYPES[UA_TYPES_STRING];
	default:
		return NULL;
	}
}

UA_StatusCode db_opcua_value_from_json(const json_t *json, int64_t time_us,
                                       enum db_opcua_quality quality, UA_DataValue *value)
{
	const UA_DataType *type = db_opcua_json_type(json);
	UA_Boolean flag = json_is_true(json);
	UA_Int64 whole = json_integer_value(json);
	UA_Double real = json_real_value(json);
	UA_String text = db_opcua_string(json_is_string(json) ? json_string_value(json) : "");
	const void *data = json_is_boolean(json) ? (const void *)&flag :
	                   json_is_integer(json) ? (const void *)&whole :
	                   json_is_real(json)    ? (const void *)&real :
	                                           (const void *)&text;

	value->hasSourceTimestamp = true;
	value->sourceTimestamp = db_opcua_date(time_us);
	value->hasStatus = true;
	value->status = status_of(quality);
	if (quality != DB_OPCUA_GOOD && quality != DB_OPCUA_UNCERTAIN)
		return UA_STATUSCODE_GOOD;
	value->hasValue = true;
	return UA_Variant_setScalarCopy(&value->value, data, type);
}

/* --- units and codes -------------------------------------------------------------------------- */

/* From UNECE Recommendation 20: up to three characters, the first one in the highest
 * byte. */
static const struct {
	const char *unit;
	const char code[4];
	const char *description;
} units[] = {
	{ "um", "4H", "micrometre" },
	{ "mm", "MMT", "millimetre" },
	{ "cm", "CMT", "centimetre" },
	{ "inch", "INH", "inch" },
	{ "in", "INH", "inch" },
	{ "in/s", "IU", "inch per second" },
	{ "mm/s^2", "M41", "millimetre per second squared" },
	{ "m/s^2", "MSK", "metre per second squared" },
	{ "m/min", "2X", "metre per minute" },
	{ "rad", "C81", "radian" },
	{ "rad/s", "2A", "radian per second" },
	{ "rev", "M44", "revolution" },
	{ "rev/s", "RPS", "revolutions per second" },
	{ "rev/min", "RPM", "revolutions per minute" },
	{ "1/min", "C94", "reciprocal minute" },
	{ "min", "MIN", "minute" },
	{ "kHz", "KHZ", "kilohertz" },
	{ "mA", "4K", "milliampere" },
	{ "mV", "2Z", "millivolt" },
	{ "W", "WTT", "watt" },
	{ "N", "NEW", "newton" },
	{ "Nm", "NU", "newton metre" },
	{ "kg", "KGM", "kilogram" },
	{ "bit/s", "B10", "bit per second" },
	{ "permille", "NX", "part per thousand" },
	{ "mm/s", "C16", "millimetre per second" },
	{ "m", "MTR", "metre" },
	{ "m/s", "MTS", "metre per second" },
	{ "deg", "DD", "degree" },
	{ "deg/s", "E96", "degree per second" },
	{ "rpm", "RPM", "revolutions per minute" },
	{ "s", "SEC", "second" },
	{ "ms", "C26", "millisecond" },
	{ "us", "B98", "microsecond" },
	{ "Hz", "HTZ", "hertz" },
	{ "A", "AMP", "ampere" },
	{ "V", "VLT", "volt" },
	{ "degC", "CEL", "degree Celsius" },
	{ "ohm", "OHM", "ohm" },
	{ "%", "P1", "percent" },
};

UA_EUInformation db_opcua_unit(const char *unit)
{
	UA_EUInformation information = {
		.namespaceUri = UA_STRING_STATIC("urn:drivebridge:units"),
		.unitId = -1,
		.displayName = { .text = db_opcua_string(unit) },
		.description = { .text = db_opcua_string(unit) },
	};

	for (size_t i = 0; i < sizeof(units) / sizeof(units[0]); i++) {
		if (strcmp(units[i].unit, unit) != 0)
			continue;
		information.namespaceUri = db_opcua_string(
			"http://www.opcfoundation.org/UA/units/un/cefact");
		information.unitId = 0;
		for (const char *at = units[i].code; *at; at++)
			information.unitId = information.unitId * 256 + *at;
		information.description = db_opcua_english(units[i].description);
	}
	return information;
}

/* The next code of "0=Offline 1=Disabled"; false at the end. */
static bool next_code(const char **codes, long *number, UA_LocalizedText *name)
{
	char *end;
	size_t length;

	*number = strtol(*codes, &end, 10);
	if (*end != '=')
		return false;
	length = strcspn(end + 1, " ");
	*name = db_opcua_english(end + 1);
	name->text.length = length;
	*codes = end + 1 + length;
	return true;
}

UA_EnumValueType *db_opcua_enum_values(const char *codes, size_t *count)
{
	UA_EnumValueType *values;
	size_t most = 1;
	long number;
	UA_LocalizedText name;

	/* There are as many as signs of equality. */
	for (const char *at = codes; *at; at++)
		most += *at == '=';
	values = calloc(most, sizeof(*values));
	*count = 0;
	while (values && next_code(&codes, &number, &name))
		values[(*count)++] = (UA_EnumValueType){ .value = number, .displayName = name };
	return values;
}

UA_LocalizedText *db_opcua_bit_names(const char *codes, size_t *count)
{
	UA_LocalizedText *names = calloc(BITS_MAX, sizeof(*names));
	long bit;
	UA_LocalizedText name;

	*count = 0;
	while (names && next_code(&codes, &bit, &name)) {
		if (bit < 0 || bit >= BITS_MAX)
			continue;
		names[bit] = name;
		if ((size_t)bit >= *count)
			*count = (size_t)bit + 1;
	}
	return names;
}
