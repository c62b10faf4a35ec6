/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/node_values.h"
#include "opcua/conditions.h"
#include "opcua/nodes_private.h"
#include "opcua/properties.h"
#include "opcua/values.h"

#include <open62541/types_generated.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct db_opcua_nodes *nodes_of(UA_Server *server)
{
	return UA_Server_getConfig(server)->context;
}

/* Facts of buses are the service's own, so their quality is the service's. */
static enum db_opcua_quality quality_of_facts(const struct db_opcua_nodes *nodes)
{
	const struct db_opcua_shown *gateway = db_opcua_roster_find(
		&nodes->roster, DB_OPCUA_GATEWAY, strlen(DB_OPCUA_GATEWAY));

	return gateway ? db_opcua_drive_quality(gateway->drive) : DB_OPCUA_NO_CONTACT;
}

static UA_StatusCode read_clock(const struct db_opcua_nodes *nodes, UA_DataValue *value)
{
	char token[DB_OPCUA_TOKEN_MAX];
	UA_StatusCode status = UA_STATUSCODE_BADNOCOMMUNICATION;
	UA_String text;

	if (db_opcua_plant_ask_clock(nodes->plant, token)) {
		text = db_opcua_string(token);
		status = UA_Variant_setScalarCopy(&value->value, &text, &UA_TYPES[UA_TYPES_STRING]);
	}
	value->hasValue = status == UA_STATUSCODE_GOOD;
	value->hasStatus = !value->hasValue;
	value->status = status;
	value->hasSourceTimestamp = true;
	value->sourceTimestamp = UA_DateTime_now();
	return UA_STATUSCODE_GOOD;
}

static UA_StatusCode read_certificate_ends(const struct db_opcua_nodes *nodes, UA_DataValue *value)
{
	UA_DateTime ends = UA_DateTime_fromUnixTime(nodes->ops->certificate_ends(nodes->context));

	value->hasValue = UA_Variant_setScalarCopy(&value->value, &ends,
	                                           &UA_TYPES[UA_TYPES_DATETIME]) ==
	                  UA_STATUSCODE_GOOD;
	value->hasSourceTimestamp = true;
	value->sourceTimestamp = UA_DateTime_now();
	return value->hasValue ? UA_STATUSCODE_GOOD : UA_STATUSCODE_BADOUTOFMEMORY;
}

/* A drive says "VSMD113_025T-1.0.008.170428": its model, and the version of its firmware. */
static UA_StatusCode read_identity(const struct db_opcua_nodes *nodes,
                                   const struct db_opcua_drive *drive, bool model,
                                   UA_DataValue *value)
{
	struct db_opcua_item *item = db_opcua_drive_find(drive, "identity");
	UA_Variant whole;
	UA_LocalizedText name = { .text = db_opcua_string("") };
	UA_String revision = name.text;
	const UA_Byte *dash;
	UA_StatusCode status;

	if (!item)
		return UA_STATUSCODE_BADNOTSUPPORTED;
	db_opcua_plant_fetch(nodes->plant, item);
	/* The quality and the time are the text's. */
	status = db_opcua_value_read(item, value);
	whole = value->value;
	UA_Variant_init(&value->value);
	if (UA_Variant_hasScalarType(&whole, &UA_TYPES[UA_TYPES_STRING]))
		name.text = *(const UA_String *)whole.data;
	dash = name.text.length > 0 ? memchr(name.text.data, '-', name.text.length) : NULL;
	if (dash) {
		revision.data = (UA_Byte *)(uintptr_t)(dash + 1);
		revision.length = (size_t)(name.text.data + name.text.length - revision.data);
		name.text.length = (size_t)(dash - name.text.data);
	}
	if (status == UA_STATUSCODE_GOOD && value->hasValue &&
	    (model ? name.text.length : revision.length) == 0) {
		value->hasValue = false;
		value->status = UA_STATUSCODE_BADWAITINGFORINITIALDATA;
	} else if (status == UA_STATUSCODE_GOOD && value->hasValue) {
		status = model ? UA_Variant_setScalarCopy(&value->value, &name,
		                                          &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]) :
		                 UA_Variant_setScalarCopy(&value->value, &revision,
		                                          &UA_TYPES[UA_TYPES_STRING]);
	}
	UA_Variant_clear(&whole);
	return status;
}

/* The names of an enumeration or of bits, for this session. */
static UA_StatusCode read_names(const struct db_opcua_nodes *nodes, UA_Server *server,
                                const UA_NodeId *session, const struct db_opcua_type_row *row,
                                const UA_NumericRange *range, UA_DataValue *value)
{
	size_t count = 0;
	void *values = db_opcua_row_value(row, &count);
	UA_Variant whole;
	UA_StatusCode status;

	if (!values)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	for (size_t i = 0; i < count; i++) {
		UA_LocalizedText *name = row->class == DB_OPCUA_NAMES_ROW ?
		                                 &((UA_EnumValueType *)values)[i].displayName :
		                                 &((UA_LocalizedText *)values)[i];

		*name = db_opcua_locales_say_name(&nodes->locales, server, session, name->text);
	}
	UA_Variant_setArray(&whole, values, count, db_opcua_row_type(row));
	status = range ? UA_Variant_copyRange(&whole, &value->value, *range) :
	                 UA_Variant_copy(&whole, &value->value);
	free(values);
	value->hasValue = status == UA_STATUSCODE_GOOD;
	return status;
}

static UA_StatusCode write_clock(const struct db_opcua_nodes *nodes, const UA_NodeId *session,
                                 const UA_Variant *value)
{
	const UA_String *text = value->data;
	char token[DB_OPCUA_TOKEN_MAX] = "";

	if (!UA_Variant_hasScalarType(value, &UA_TYPES[UA_TYPES_STRING]))
		return UA_STATUSCODE_BADTYPEMISMATCH;
	/* A text that cannot be a token is refused now, not at the next motion. */
	if (text->length >= sizeof(token) ||
	    (text->length > 0 && memchr(text->data, '\0', text->length)))
		return UA_STATUSCODE_BADOUTOFRANGE;
	if (text->length > 0)
		memcpy(token, text->data, text->length);
	return nodes->ops->write_clock(nodes->context, session, token);
}

static UA_StatusCode read_condition(const struct db_opcua_nodes *nodes,
                                    const struct db_opcua_subject *subject, UA_DataValue *value)
{
	return db_opcua_condition_read(&nodes->roster, subject,
	                               quality_of_facts(nodes) == DB_OPCUA_GOOD ?
	                                       UA_STATUSCODE_GOOD :
	                                       UA_STATUSCODE_BADNOCOMMUNICATION,
	                               value);
}

/* What an alarm says, for this session; its events have it, too, because the library reads them for
 * each session. Its parts are translated one by one: together they are no text of the table. */
static UA_StatusCode read_message(const struct db_opcua_nodes *nodes, UA_Server *server,
                                  const UA_NodeId *session, const struct db_opcua_subject *subject,
                                  UA_DataValue *value)
{
	const struct db_opcua_locales *locales = &nodes->locales;
	const struct db_opcua_alarm *alarm = subject->alarm;
	UA_StatusCode status = read_condition(nodes, subject, value);
	UA_LocalizedText cause = db_opcua_locales_say_name(locales, server, session,
	                                                   db_opcua_string(alarm->cause));
	UA_LocalizedText name = db_opcua_locales_say_name(locales, server, session,
	                                                  db_opcua_string(alarm->kind));
	UA_LocalizedText detail = db_opcua_locales_say_name(locales, server, session,
	                                                    db_opcua_string(alarm->detail));
	char room[DB_WORDS_TEXT_MAX], text[DB_WORDS_TEXT_MAX + 256];

	/* In English it is finished. */
	if (status != UA_STATUSCODE_GOOD || !value->hasValue ||
	    UA_String_equal(&cause.locale, &(UA_String){ .length = 2, .data = (UA_Byte *)"en" }))
		return status;
	if (alarm->name[0])
		name.text = db_opcua_string(alarm->name);
	if (!UA_String_equal(&detail.locale, &cause.locale))
		detail = db_opcua_locales_say(locales, server, session, alarm->detail, room);
	snprintf(text, sizeof(text), "%.*s: %.*s%s%.*s", (int)name.text.length,
	         (const char *)name.text.data, (int)cause.text.length,
	         (const char *)cause.text.data, alarm->detail[0] ? ": " : "",
	         (int)detail.text.length, (const char *)detail.text.data);
	cause.text = db_opcua_string(text);
	UA_Variant_clear(&value->value);
	return UA_Variant_setScalarCopy(&value->value, &cause, &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]);
}

UA_StatusCode db_opcua_node_read(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *node, void *node_context,
                                 UA_Boolean source_time_wanted, const UA_NumericRange *range,
                                 UA_DataValue *value)
{
	const struct db_opcua_nodes *nodes = nodes_of(server);
	const struct db_opcua_subject *subject = node_context;
	const struct db_opcua_shown *shown = subject->shown;
	const struct db_opcua_branch *branch = subject->branch;
	const struct db_opcua_column *column;

	(void)session_context;
	(void)node;
	(void)source_time_wanted;
	if (subject->type == DB_OPCUA_OF_TYPES)
		return read_names(nodes, server, session, subject->row, range, value);
	if (range) {
		value->hasStatus = true;
		value->status = UA_STATUSCODE_BADINDEXRANGENODATA;
		return UA_STATUSCODE_GOOD;
	}
	if (subject->type == DB_OPCUA_FACT) {
		return db_opcua_value_from_json(subject->fact->value, subject->fact->time_us,
		                                quality_of_facts(nodes), value);
	}
	if (subject->type == DB_OPCUA_CONDITION && subject->member == DB_OPCUA_MEMBER_MESSAGE)
		return read_message(nodes, server, session, subject, value);
	if (subject->type == DB_OPCUA_CONDITION)
		return read_condition(nodes, subject, value);
	if (branch->type == DB_OPCUA_CLOCK)
		return read_clock(nodes, value);
	if (branch->type == DB_OPCUA_CERTIFICATE_ENDS)
		return read_certificate_ends(nodes, value);
	if (branch->type == DB_OPCUA_MODEL || branch->type == DB_OPCUA_SOFTWARE_REVISION)
		return read_identity(nodes, shown->drive, branch->type == DB_OPCUA_MODEL, value);
	if (branch->type == DB_OPCUA_VARIABLE) {
		db_opcua_plant_fetch(nodes->plant, &shown->drive->items[branch->place]);
		return db_opcua_value_read(&shown->drive->items[branch->place], value);
	}
	column = &shown->tree->kind->columns[branch->place];
	db_opcua_plant_fetch(nodes->plant, &shown->drive->items[column->places[0]]);
	return db_opcua_value_read_column(shown->drive, column, value);
}

UA_StatusCode db_opcua_node_write(UA_Server *server, const UA_NodeId *session,
                                  void *session_context, const UA_NodeId *node, void *node_context,
                                  const UA_NumericRange *range, const UA_DataValue *value)
{
	const struct db_opcua_nodes *nodes = nodes_of(server);
	const struct db_opcua_subject *subject = node_context;
	const struct db_opcua_shown *shown = subject->shown;
	const struct db_opcua_branch *branch = subject->branch;
	UA_StatusCode status;
	json_t *json;

	(void)session_context;
	(void)node;
	if (range)
		return UA_STATUSCODE_BADINDEXRANGEINVALID;
	if (!value->hasValue || (value->hasStatus && value->status != UA_STATUSCODE_GOOD))
		return UA_STATUSCODE_BADWRITENOTSUPPORTED;
	if (branch->type == DB_OPCUA_CLOCK)
		return write_clock(nodes, session, &value->value);
	status = db_opcua_value_to_json(&value->value, &json);
	if (status != UA_STATUSCODE_GOOD)
		return status;
	status = nodes->ops->write(nodes->context, session, &shown->drive->items[branch->place],
	                           json);
	json_decref(json);
	return status;
}

UA_StatusCode db_opcua_node_drop(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *node, void *node_context,
                                 const UA_NumericRange *range, const UA_DataValue *value)
{
	(void)server;
	(void)session;
	(void)session_context;
	(void)node;
	(void)node_context;
	(void)range;
	(void)value;
	return UA_STATUSCODE_GOOD;
}

UA_StatusCode db_opcua_node_call(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *method_id, void *method_context,
                                 const UA_NodeId *object, void *object_context, size_t input_count,
                                 const UA_Variant *input, size_t output_count, UA_Variant *output)
{
	const struct db_opcua_nodes *nodes = nodes_of(server);
	const struct db_opcua_subject *subject = method_context;
	const struct db_opcua_shown *shown = subject->shown;
	const json_t *command = db_opcua_tree_command(shown->tree, subject->branch);
	const json_t *names = json_object_get(command, "arguments");
	json_t *arguments = json_object();
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	(void)session_context;
	(void)method_id;
	(void)object;
	(void)object_context;
	for (size_t i = 0; i < input_count && status == UA_STATUSCODE_GOOD; i++) {
		const char *name = json_string_value(json_array_get(names, i));
		json_t *json = NULL;

		status = db_opcua_value_to_json(&input[i], &json);
		if (status == UA_STATUSCODE_GOOD)
			(void)json_object_set_new(arguments, name, json);
	}
	if (status != UA_STATUSCODE_GOOD) {
		json_decref(arguments);
		return status;
	}
	status = nodes->ops->run(nodes->context, session, shown->drive,
	                         json_string_value(json_object_get(command, "name")), arguments);
	if (output_count == 2) {
		UA_String result = db_opcua_string(shown->drive->result);
		UA_String reason = db_opcua_string(shown->drive->reason);

		(void)UA_Variant_setScalarCopy(&output[0], &result, &UA_TYPES[UA_TYPES_STRING]);
		(void)UA_Variant_setScalarCopy(&output[1], &reason, &UA_TYPES[UA_TYPES_STRING]);
	}
	return status;
}

UA_StatusCode db_opcua_node_refuse(UA_Server *server, const UA_NodeId *session,
                                   void *session_context, const UA_NodeId *method_id,
                                   void *method_context, const UA_NodeId *object,
                                   void *object_context, size_t input_count,
                                   const UA_Variant *input, size_t output_count, UA_Variant *output)
{
	(void)server;
	(void)session;
	(void)session_context;
	(void)method_id;
	(void)method_context;
	(void)object;
	(void)object_context;
	(void)input_count;
	(void)input;
	(void)output_count;
	(void)output;
	return UA_STATUSCODE_BADMETHODINVALID;
}
