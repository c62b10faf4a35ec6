/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/record.h"
#include "opcua/references.h"
#include "opcua/values.h"

#include "capture/audit_text.h"
#include "client/objects.h"

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

static UA_NodeId own_type(const struct db_opcua_roster *roster)
{
	return (UA_NodeId){ .namespaceIndex = roster->types,
		            .identifierType = UA_NODEIDTYPE_STRING,
		            .identifier.string = db_opcua_string(OWN_TYPE) };
}

/* One that these events are of. */
static bool is_type(const struct db_opcua_roster *roster, const UA_NodeId *type)
{
	UA_NodeId own = own_type(roster);

	for (size_t i = 0; i < sizeof(above) / sizeof(above[0]); i++) {
		UA_NodeId one = UA_NODEID_NUMERIC(0, above[i]);

		if (UA_NodeId_equal(type, &one))
			return true;
	}
	return UA_NodeId_equal(type, &own);
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

/* Of "EventType is one of these" and "of the type" the index of the first type; SIZE_MAX: it is neither. */
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
	UA_NodeId own = own_type(roster);
	bool wanted = where->elementsSize == 0;

	for (size_t i = wanted ? 0 : first_type(element);
	     !wanted && i < element->filterOperandsSize; i++) {
		const UA_NodeId *type = literal_of(&element->filterOperands[i]);

		wanted = element->filterOperator == UA_FILTEROPERATOR_OFTYPE ?
		                 is_type(roster, type) :
		                 UA_NodeId_equal(type, &own);
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

static UA_StatusCode set_source(const struct filling *filling)
{
	const char *drive = db_client_text(filling->record, "drive");
	bool there = drive[0] != '\0' &&
	             db_opcua_roster_find(filling->roster, drive, strlen(drive));
	struct db_opcua_id id = db_opcua_id_of(drive, "");
	UA_NodeId node = there ? db_opcua_node_id(filling->roster, &id) :
	                         UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER);

	return set(filling, &node, UA_TYPES_NODEID);
}

static UA_StatusCode set_message(const struct filling *filling)
{
	const char *result = db_client_text(filling->record, "result");
	char *words = db_capture_audit_describe(filling->record);
	char text[MESSAGE_MAX];
	UA_LocalizedText message;
	size_t length;

	(void)snprintf(text, sizeof(text), "%s%s%s", words ? words : "", result[0] ? ": " : "",
	               result);
	free(words);
	/* A cut may have left a part of a letter. */
	length = strlen(text);
	while (length == sizeof(text) - 1 && ((unsigned char)text[length - 1] & 0x80))
		text[--length] = '\0';
	message = db_opcua_english(text);
	return set(filling, &message, UA_TYPES_LOCALIZEDTEXT);
}

static UA_StatusCode set_details(const struct filling *filling)
{
	char *words = db_capture_audit_describe(filling->record);
	UA_StatusCode status = words ? set_text(filling, words) : UA_STATUSCODE_BADOUTOFMEMORY;

	free(words);
	return status;
}

enum part {
	EVENT_ID,
	EVENT_TYPE,
	SOURCE_NODE,
	SOURCE_NAME,
	TIME,
	MESSAGE,
	SEVERITY,
	STATUS,
	SERVER_ID,
	ENTRY_ID,
	USER_ID,
	DETAILS,
	TEXT,
	NUMBER,
};

struct field {
	const char *name;
	enum part part;
	const char *key; /* in the record, of a text or number */
	bool own;        /* its name is of our types */
};

static const struct field fields_of_records[] = {
	{ "EventId", EVENT_ID, NULL, false },
	{ "EventType", EVENT_TYPE, NULL, false },
	{ "SourceNode", SOURCE_NODE, NULL, false },
	{ "SourceName", SOURCE_NAME, NULL, false },
	{ "Time", TIME, NULL, false },
	{ "ReceiveTime", TIME, NULL, false },
	{ "Message", MESSAGE, NULL, false },
	{ "Severity", SEVERITY, NULL, false },
	{ "ActionTimeStamp", TIME, NULL, false },
	{ "Status", STATUS, NULL, false },
	{ "ServerId", SERVER_ID, NULL, false },
	{ "ClientAuditEntryId", ENTRY_ID, NULL, false },
	{ "ClientUserId", USER_ID, NULL, false },
	{ "Number", NUMBER, "number", true },
	{ "Kind", TEXT, "kind", true },
	{ "What", TEXT, "what", true },
	{ "Details", DETAILS, NULL, true },
	{ "Result", TEXT, "result", true },
	{ "RecordOf", NUMBER, "of", true },
	{ "TookUs", NUMBER, "took_us", true },
};

static UA_StatusCode set_field(const struct filling *filling, const struct field *field)
{
	const json_t *record = filling->record;
	const json_t *told = field->key ? json_object_get(record, field->key) : NULL;
	const char *drive = db_client_text(record, "drive");
	const char *bus = db_client_text(record, "bus");
	bool refused = db_capture_audit_is_refused(record);
	/* True: it was done, or is on its way. */
	UA_Boolean status = !refused;
	UA_UInt16 severity = refused ? SEVERITY_REFUSED : SEVERITY_USUAL;
	UA_UInt64 number = (UA_UInt64)json_integer_value(told);
	UA_NodeId type = own_type(filling->roster);
	UA_DateTime time;
	char text[40];
	UA_ByteString id;

	switch (field->part) {
	case EVENT_ID:
		(void)snprintf(text, sizeof(text), "audit %lld",
		               (long long)json_integer_value(json_object_get(record, "number")));
		id = db_opcua_string(text);
		return set(filling, &id, UA_TYPES_BYTESTRING);
	case EVENT_TYPE:
		return set(filling, &type, UA_TYPES_NODEID);
	case SOURCE_NODE:
		return set_source(filling);
	case SOURCE_NAME:
		return set_text(filling, drive[0] ? drive : bus[0] ? bus : "Server");
	case TIME:
		time = UA_DATETIME_UNIX_EPOCH +
		       json_integer_value(json_object_get(record, "time_us")) * UA_DATETIME_USEC;
		return set(filling, &time, UA_TYPES_DATETIME);
	case MESSAGE:
		return set_message(filling);
	case SEVERITY:
		return set(filling, &severity, UA_TYPES_UINT16);
	case STATUS:
		return set(filling, &status, UA_TYPES_BOOLEAN);
	case SERVER_ID:
		return set_text(filling, filling->server);
	case ENTRY_ID:
		return set_text(filling, "");
	case USER_ID:
		return set_text(filling, db_client_text(record, "who"));
	case DETAILS:
		return set_details(filling);
	case TEXT:
		return json_is_string(told) ? set_text(filling, json_string_value(told)) :
		                              UA_STATUSCODE_GOOD;
	case NUMBER:
		break;
	}
	return json_is_integer(told) ? set(filling, &number, UA_TYPES_UINT64) : UA_STATUSCODE_GOOD;
}

static UA_StatusCode fill_field(const struct filling *filling,
                                const UA_SimpleAttributeOperand *wanted)
{
	if (wanted->attributeId != UA_ATTRIBUTEID_VALUE || wanted->browsePathSize != 1 ||
	    wanted->indexRange.length > 0 || !is_type(filling->roster, &wanted->typeDefinitionId))
		return UA_STATUSCODE_GOOD;
	for (size_t i = 0; i < sizeof(fields_of_records) / sizeof(fields_of_records[0]); i++) {
		const struct field *field = &fields_of_records[i];
		UA_QualifiedName name = db_opcua_member_name(filling->roster, field->name);

		if (!field->own)
			name.namespaceIndex = 0;
		if (UA_QualifiedName_equal(&wanted->browsePath[0], &name))
			return set_field(filling, field);
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
