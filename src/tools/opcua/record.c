/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/record.h"
#include "opcua/references.h"
#include "opcua/values.h"

#include "capture/audit_text.h"
#include "words/value.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The type of these events, and those above it, numbers of the standard. */
#define OWN_TYPE "AuditTrailEventType"
static const UA_UInt32 above[] = { UA_NS0ID_AUDITEVENTTYPE, UA_NS0ID_BASEEVENTTYPE };

/* Most fields, as for events that are told at once. */
#define FIELDS_MAX 64

#define SEVERITY_USUAL 300
#define SEVERITY_REFUSED 600

/* A message is for people; the whole is in Details. */
#define MESSAGE_MAX 300

static bool is_own_type(const struct db_opcua_roster *roster, const UA_NodeId *type)
{
	UA_NodeId own = { .namespaceIndex = roster->types,
		          .identifierType = UA_NODEIDTYPE_STRING,
		          .identifier.string = db_opcua_string(OWN_TYPE) };

	return UA_NodeId_equal(type, &own);
}

/* One that these events are of. */
static bool is_type(const struct db_opcua_roster *roster, const UA_NodeId *type)
{
	for (size_t i = 0; i < sizeof(above) / sizeof(above[0]); i++) {
		UA_NodeId one = UA_NODEID_NUMERIC(0, above[i]);

		if (UA_NodeId_equal(type, &one))
			return true;
	}
	return is_own_type(roster, type);
}

/* --- the condition of a filter ---------------------------------------------------------------- */

static const UA_NodeId *literal_of(const UA_ExtensionObject *operand)
{
	const UA_LiteralOperand *literal = operand->content.decoded.data;

	if (operand->encoding != UA_EXTENSIONOBJECT_DECODED ||
	    operand->content.decoded.type != &UA_TYPES[UA_TYPES_LITERALOPERAND] ||
	    !UA_Variant_hasScalarType(&literal->value, &UA_TYPES[UA_TYPES_NODEID]))
		return NULL;
	return literal->value.data;
}

static bool is_event_type(const UA_ExtensionObject *operand)
{
	const UA_SimpleAttributeOperand *field = operand->content.decoded.data;
	UA_String name = db_opcua_string("EventType");

	return operand->encoding == UA_EXTENSIONOBJECT_DECODED &&
	       operand->content.decoded.type == &UA_TYPES[UA_TYPES_SIMPLEATTRIBUTEOPERAND] &&
	       field->attributeId == UA_ATTRIBUTEID_VALUE && field->browsePathSize == 1 &&
	       field->browsePath[0].namespaceIndex == 0 &&
	       UA_String_equal(&field->browsePath[0].name, &name);
}

/* Of "EventType is one of these" and "of the type" the index of the first type; SIZE_MAX: it is
 * neither. */
static size_t first_type(const UA_ContentFilterElement *element)
{
	size_t first = element->filterOperator == UA_FILTEROPERATOR_OFTYPE ? 0 : 1;
	bool known = element->filterOperator == UA_FILTEROPERATOR_OFTYPE ||
	             element->filterOperator == UA_FILTEROPERATOR_INLIST ||
	             element->filterOperator == UA_FILTEROPERATOR_EQUALS;

	if (!known || element->filterOperandsSize <= first ||
	    (first == 1 && !is_event_type(&element->filterOperands[0])))
		return SIZE_MAX;
	for (size_t i = first; i < element->filterOperandsSize; i++) {
		if (!literal_of(&element->filterOperands[i]))
			return SIZE_MAX;
	}
	return first;
}

UA_StatusCode db_opcua_record_check(const UA_EventFilter *filter)
{
	const UA_ContentFilter *where = &filter->whereClause;

	if (filter->selectClausesSize == 0 || filter->selectClausesSize > FIELDS_MAX)
		return UA_STATUSCODE_BADEVENTFILTERINVALID;
	if (where->elementsSize > 1 ||
	    (where->elementsSize == 1 && first_type(&where->elements[0]) == SIZE_MAX))
		return UA_STATUSCODE_BADFILTEROPERATORUNSUPPORTED;
	return UA_STATUSCODE_GOOD;
}

bool db_opcua_record_is_wanted(const struct db_opcua_roster *roster, const UA_ContentFilter *where)
{
	const UA_ContentFilterElement *element = where->elements;
	bool wanted = where->elementsSize == 0;

	for (size_t i = wanted ? 0 : first_type(element);
	     !wanted && i < element->filterOperandsSize; i++) {
		const UA_NodeId *type = literal_of(&element->filterOperands[i]);

		wanted = element->filterOperator == UA_FILTEROPERATOR_OFTYPE ?
		                 is_type(roster, type) :
		                 is_own_type(roster, type);
	}
	return wanted;
}

/* --- fields ----------------------------------------------------------------------------------- */

/* A field gets its value here; what is not set stays null. */
struct filling {
	const struct db_opcua_roster *roster;
	const char *server;
	const json_t *record;
	UA_Variant *value;
};

static UA_StatusCode set(const struct filling *filling, const void *value, int type)
{
	return UA_Variant_setScalarCopy(filling->value, value, &UA_TYPES[type]);
}

static UA_StatusCode set_text(const struct filling *filling, const char *text)
{
	UA_String value = db_opcua_string(text);

	return set(filling, &value, UA_TYPES_STRING);
}

static UA_StatusCode fill_id(const struct filling *filling)
{
	char text[40];
	UA_ByteString id;

	snprintf(text, sizeof(text), "audit %lld",
	         (long long)json_integer_value(json_object_get(filling->record, "number")));
	id = db_opcua_string(text);
	return set(filling, &id, UA_TYPES_BYTESTRING);
}

static UA_StatusCode fill_type(const struct filling *filling)
{
	UA_NodeId type = { .namespaceIndex = filling->roster->types,
		           .identifierType = UA_NODEIDTYPE_STRING,
		           .identifier.string = db_opcua_string(OWN_TYPE) };

	return set(filling, &type, UA_TYPES_NODEID);
}

static UA_StatusCode fill_source(const struct filling *filling)
{
	const char *drive = db_words_text(filling->record, "drive");
	bool there = drive[0] != '\0' &&
	             db_opcua_roster_find(filling->roster, drive, strlen(drive));
	struct db_opcua_id id = db_opcua_id_of(drive, "");
	UA_NodeId node = there ? db_opcua_node_id(filling->roster, &id) :
	                         UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER);

	return set(filling, &node, UA_TYPES_NODEID);
}

static UA_StatusCode fill_source_name(const struct filling *filling)
{
	const char *drive = db_words_text(filling->record, "drive");
	const char *bus = db_words_text(filling->record, "bus");

	return set_text(filling, drive[0] ? drive : bus[0] ? bus : "Server");
}

static UA_StatusCode fill_time(const struct filling *filling)
{
	UA_DateTime time = UA_DATETIME_UNIX_EPOCH +
	                   json_integer_value(json_object_get(filling->record, "time_us")) *
	                           UA_DATETIME_USEC;

	return set(filling, &time, UA_TYPES_DATETIME);
}

static UA_StatusCode fill_message(const struct filling *filling)
{
	const char *result = db_words_text(filling->record, "result");
	char *words = db_capture_audit_describe(filling->record);
	char text[MESSAGE_MAX];
	UA_LocalizedText message;
	size_t length;

	snprintf(text, sizeof(text), "%s%s%s", words ? words : "", result[0] ? ": " : "", result);
	free(words);
	/* A cut may have left a part of a letter. */
	length = strlen(text);
	while (length == sizeof(text) - 1 && ((unsigned char)text[length - 1] & 0x80))
		text[--length] = '\0';
	message = db_opcua_english(text);
	return set(filling, &message, UA_TYPES_LOCALIZEDTEXT);
}

static UA_StatusCode fill_severity(const struct filling *filling)
{
	UA_UInt16 severity = db_capture_audit_is_refused(filling->record) ? SEVERITY_REFUSED :
	                                                                    SEVERITY_USUAL;

	return set(filling, &severity, UA_TYPES_UINT16);
}

/* True: it was done, or is on its way. */
static UA_StatusCode fill_status(const struct filling *filling)
{
	UA_Boolean status = !db_capture_audit_is_refused(filling->record);

	return set(filling, &status, UA_TYPES_BOOLEAN);
}

static UA_StatusCode fill_server(const struct filling *filling)
{
	return set_text(filling, filling->server);
}

static UA_StatusCode fill_entry_id(const struct filling *filling)
{
	return set_text(filling, "");
}

static UA_StatusCode fill_user(const struct filling *filling)
{
	return set_text(filling, db_words_text(filling->record, "who"));
}

static UA_StatusCode fill_details(const struct filling *filling)
{
	char *words = db_capture_audit_describe(filling->record);
	UA_StatusCode status = words ? set_text(filling, words) : UA_STATUSCODE_BADOUTOFMEMORY;

	free(words);
	return status;
}

struct field {
	const char *name;
	/* One of these. */
	UA_StatusCode (*fill)(const struct filling *filling);
	const char *text;
	const char *number;
	bool own; /* its name is of our types */
};

static const struct field fields_of_records[] = {
	{ .name = "EventId", .fill = fill_id },
	{ .name = "EventType", .fill = fill_type },
	{ .name = "SourceNode", .fill = fill_source },
	{ .name = "SourceName", .fill = fill_source_name },
	{ .name = "Time", .fill = fill_time },
	{ .name = "ReceiveTime", .fill = fill_time },
	{ .name = "Message", .fill = fill_message },
	{ .name = "Severity", .fill = fill_severity },
	{ .name = "ActionTimeStamp", .fill = fill_time },
	{ .name = "Status", .fill = fill_status },
	{ .name = "ServerId", .fill = fill_server },
	{ .name = "ClientAuditEntryId", .fill = fill_entry_id },
	{ .name = "ClientUserId", .fill = fill_user },
	{ .name = "Number", .number = "number", .own = true },
	{ .name = "Kind", .text = "kind", .own = true },
	{ .name = "What", .text = "what", .own = true },
	{ .name = "Details", .fill = fill_details, .own = true },
	{ .name = "Result", .text = "result", .own = true },
	{ .name = "RecordOf", .number = "of", .own = true },
	{ .name = "TookUs", .number = "took_us", .own = true },
};

static UA_StatusCode fill_field(const struct filling *filling,
                                const UA_SimpleAttributeOperand *wanted)
{
	if (wanted->attributeId != UA_ATTRIBUTEID_VALUE || wanted->browsePathSize != 1 ||
	    wanted->indexRange.length > 0 || !is_type(filling->roster, &wanted->typeDefinitionId))
		return UA_STATUSCODE_GOOD;
	for (size_t i = 0; i < sizeof(fields_of_records) / sizeof(fields_of_records[0]); i++) {
		const struct field *field = &fields_of_records[i];
		const json_t *told;
		UA_UInt64 number;
		UA_QualifiedName name = db_opcua_member_name(filling->roster, field->name);

		if (!field->own)
			name.namespaceIndex = 0;
		if (!UA_QualifiedName_equal(&wanted->browsePath[0], &name))
			continue;
		if (field->fill)
			return field->fill(filling);
		told = json_object_get(filling->record, field->text ? field->text : field->number);
		if (field->text && json_is_string(told))
			return set_text(filling, json_string_value(told));
		number = (UA_UInt64)json_integer_value(told);
		return !field->text && json_is_integer(told) ?
		               set(filling, &number, UA_TYPES_UINT64) :
		               UA_STATUSCODE_GOOD;
	}
	return UA_STATUSCODE_GOOD;
}

UA_StatusCode db_opcua_record_fill(const struct db_opcua_roster *roster, const char *server,
                                   const json_t *record, const UA_EventFilter *filter,
                                   UA_HistoryEventFieldList *fields)
{
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	fields->eventFields = UA_Array_new(filter->selectClausesSize, &UA_TYPES[UA_TYPES_VARIANT]);
	if (!fields->eventFields)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	fields->eventFieldsSize = filter->selectClausesSize;
	for (size_t i = 0; i < filter->selectClausesSize && status == UA_STATUSCODE_GOOD; i++)
		status = fill_field(
			&(struct filling){ roster, server, record, &fields->eventFields[i] },
			&filter->selectClauses[i]);
	return status;
}
