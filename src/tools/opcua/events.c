/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/events.h"
#include "opcua/names.h"
#include "opcua/types.h"
#include "opcua/values.h"

#include "client/log.h"
#include "words/value.h"

#include <stdio.h>
#include <string.h>

/* The type above all of them. */
#define BASE "DriveEventType"

/* From 1 to 1000; above 667 is high. */
static UA_UInt16 severity_of(const char *level)
{
	static const struct {
		const char *level;
		UA_UInt16 severity;
	} levels[] = {
		{ "error", 900 }, { "warning", 600 }, { "notice", 300 },
		{ "info", 100 },  { "debug", 50 },
	};

	for (size_t i = 0; i < sizeof(levels) / sizeof(levels[0]); i++) {
		if (strcmp(levels[i].level, level) == 0)
			return levels[i].severity;
	}
	return 500;
}

static UA_NodeId node_of(UA_Server *server, const char *id)
{
	size_t space = 0;

	(void)UA_Server_getNamespaceByName(server, db_opcua_string(DB_OPCUA_TYPES_NAMESPACE),
	                                   &space);
	return (UA_NodeId){ .namespaceIndex = (UA_UInt16)space,
		            .identifierType = UA_NODEIDTYPE_STRING,
		            .identifier.string = db_opcua_string(id) };
}

static UA_StatusCode add_type(UA_Server *server, UA_NodeId id, UA_NodeId parent, const char *text)
{
	UA_ObjectTypeAttributes attributes = UA_ObjectTypeAttributes_default;

	attributes.displayName.text = id.identifier.string;
	attributes.description = db_opcua_english(text);
	return UA_Server_addObjectTypeNode(server, id, parent,
	                                   UA_NODEID_NUMERIC(0, UA_NS0ID_HASSUBTYPE),
	                                   (UA_QualifiedName){ .namespaceIndex = id.namespaceIndex,
	                                                       .name = id.identifier.string },
	                                   attributes, NULL, NULL);
}

UA_StatusCode db_opcua_events_set_up(UA_Server *server)
{
	const struct db_opcua_type_row *base = db_opcua_type_find(BASE, strlen(BASE));
	UA_NodeId parent = node_of(server, BASE);
	UA_StatusCode status = add_type(server, parent,
	                                UA_NODEID_NUMERIC(0, UA_NS0ID_BASEEVENTTYPE), base->text);

	for (size_t i = 0; i < db_opcua_type_count && status == UA_STATUSCODE_GOOD; i++) {
		const struct db_opcua_type_row *row = &db_opcua_type_rows[i];

		if (row->class == DB_OPCUA_EVENT_TYPE_ROW && row != base)
			status = add_type(server, node_of(server, row->id), parent, row->text);
	}
	return status;
}

/* drive-lost is DriveLostEventType. A kind that only a newer service knows is added at its first
 * event. */
static UA_StatusCode find_type(UA_Server *server, const char *event, char id[128], UA_NodeId *type)
{
	char name[DB_OPCUA_NAME_MAX];
	char words[DB_OPCUA_NAME_MAX];
	UA_NodeClass class;

	snprintf(words, sizeof(words), "%s", event);
	for (char *at = words; *at; at++)
		*at = *at == '-' ? '_' : *at;
	db_opcua_name_of(words, name);
	snprintf(id, 128, "%sEventType", name);
	*type = node_of(server, id);
	if (UA_Server_readNodeClass(server, *type, &class) == UA_STATUSCODE_GOOD)
		return UA_STATUSCODE_GOOD;
	return add_type(server, *type, node_of(server, BASE), event);
}

static UA_StatusCode set_field(UA_Server *server, UA_NodeId event, const char *name, void *value,
                               const UA_DataType *type)
{
	UA_Variant variant;

	UA_Variant_setScalar(&variant, value, type);
	return UA_Server_writeObjectProperty(
		server, event, (UA_QualifiedName){ .name = db_opcua_string(name) }, variant);
}

/* What an event says, while the library sends it. */
struct message {
	const struct db_opcua_locales *locales;
	const char *text;
};

static UA_StatusCode read_message(UA_Server *server, const UA_NodeId *session,
                                  void *session_context, const UA_NodeId *node, void *node_context,
                                  UA_Boolean source_time_wanted, const UA_NumericRange *range,
                                  UA_DataValue *value)
{
	const struct message *message = node_context;
	char room[DB_WORDS_TEXT_MAX];
	UA_LocalizedText said = db_opcua_locales_say(message->locales, server, session,
	                                             message->text, room);
	UA_StatusCode status;

	(void)session_context;
	(void)node;
	(void)source_time_wanted;
	(void)range;
	status = UA_Variant_setScalarCopy(&value->value, &said, &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]);
	value->hasValue = status == UA_STATUSCODE_GOOD;
	return status;
}

/* The library reads the fields of an event once for each client, with that client's session; so
 * each client gets the message in its own language. */
static UA_StatusCode translate(UA_Server *server, UA_NodeId event, struct message *message)
{
	UA_BrowsePathResult found = UA_Server_browseSimplifiedBrowsePath(
		server, event, 1, &(UA_QualifiedName){ .name = db_opcua_string("Message") });
	UA_StatusCode status = found.statusCode;

	if (status == UA_STATUSCODE_GOOD && found.targetsSize == 0)
		status = UA_STATUSCODE_BADNOTFOUND;
	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_setNodeContext(server, found.targets[0].targetId.nodeId,
		                                  message);
	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_setVariableNode_dataSource(
			server, found.targets[0].targetId.nodeId,
			(UA_DataSource){ .read = read_message });
	UA_BrowsePathResult_clear(&found);
	return status;
}

/* What every event has. */
static UA_StatusCode set_head(UA_Server *server, UA_NodeId event, UA_DateTime time,
                              const char *level, const char *text, const char *source)
{
	UA_UInt16 severity = severity_of(level);
	UA_LocalizedText message = db_opcua_english(text);
	UA_String name = db_opcua_string(source);

	return set_field(server, event, "Time", &time, &UA_TYPES[UA_TYPES_DATETIME]) |
	       set_field(server, event, "Severity", &severity, &UA_TYPES[UA_TYPES_UINT16]) |
	       set_field(server, event, "Message", &message, &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]) |
	       set_field(server, event, "SourceName", &name, &UA_TYPES[UA_TYPES_STRING]);
}

/* Sends the event, if all of it could be set. */
static void trigger(UA_Server *server, const char *what, UA_NodeId event, UA_NodeId origin,
                    UA_StatusCode status)
{
	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_triggerEvent(server, event, origin, NULL, true);
	else if (!UA_NodeId_isNull(&event))
		(void)UA_Server_deleteNode(server, event, true);
	if (status != UA_STATUSCODE_GOOD)
		db_client_log(DB_CLIENT_WARNING, "event %s cannot be told: %s", what,
		              UA_StatusCode_name(status));
}

void db_opcua_events_tell(UA_Server *server, const struct db_opcua_locales *locales,
                          const json_t *event, UA_NodeId origin)
{
	struct message message = { .locales = locales, .text = db_words_text(event, "text") };
	const char *drive = db_words_text(event, "drive");
	UA_DateTime time = UA_DATETIME_UNIX_EPOCH +
	                   json_integer_value(json_object_get(event, "time_us")) * UA_DATETIME_USEC;
	UA_NodeId node = UA_NODEID_NULL;
	char id[128];
	UA_NodeId type;
	UA_StatusCode status = find_type(server, db_words_text(event, "name"), id, &type);

	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_createEvent(server, type, &node);
	if (status == UA_STATUSCODE_GOOD)
		status = set_head(server, node, time, db_words_text(event, "level"),
		                  db_words_text(event, "text"),
		                  drive[0] ? drive : db_words_text(event, "bus"));
	if (status == UA_STATUSCODE_GOOD && translate(server, node, &message) != UA_STATUSCODE_GOOD)
		db_client_log(DB_CLIENT_WARNING, "the event %s is sent in English", id);
	trigger(server, db_words_text(event, "name"), node, origin, status);
}

void db_opcua_events_tell_changes(UA_Server *server, UA_ModelChangeStructureDataType *changes,
                                  size_t count)
{
	UA_NodeId node = UA_NODEID_NULL;
	UA_Variant list;
	UA_StatusCode status = UA_Server_createEvent(
		server, UA_NODEID_NUMERIC(0, UA_NS0ID_GENERALMODELCHANGEEVENTTYPE), &node);

	if (status == UA_STATUSCODE_GOOD) {
		UA_Variant_setArray(&list, changes, count,
		                    &UA_TYPES[UA_TYPES_MODELCHANGESTRUCTUREDATATYPE]);
		status = set_head(server, node, UA_DateTime_now(), "info",
		                  "The drives of this gateway have changed", "Server");
		status |= UA_Server_writeObjectProperty(
			server, node, (UA_QualifiedName){ .name = db_opcua_string("Changes") },
			list);
	}
	trigger(server, "GeneralModelChange", node, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER), status);
}
