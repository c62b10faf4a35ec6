/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/nodes.h"
#include "opcua/conditions.h"
#include "opcua/devices.h"
#include "opcua/enumerations.h"
#include "opcua/events.h"
#include "opcua/historian.h"
#include "opcua/history.h"
#include "opcua/properties.h"
#include "opcua/references.h"
#include "opcua/roster.h"
#include "opcua/store.h"
#include "opcua/values.h"

#include "client/clock.h"
#include "client/log.h"

#include <open62541/server.h>
#include <open62541/types.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* How often the service is asked for figures of its buses, in milliseconds. */
#define FIGURES_INTERVAL 1000.0

/* Of a node that has other children than before. */
#define CHILDREN_CHANGED                                  \
	(UA_MODELCHANGESTRUCTUREVERBMASK_REFERENCEADDED | \
	 UA_MODELCHANGESTRUCTUREVERBMASK_REFERENCEDELETED)

struct db_opcua_nodes {
	const struct db_opcua_config *config;
	const struct db_opcua_nodes_ops *ops;
	void *context;
	UA_Server *server;
	struct db_opcua_plant *plant;
	struct db_opcua_store *store;
	struct db_opcua_roster roster;
	struct db_opcua_conditions *conditions;
	struct db_opcua_past *past;
	struct db_opcua_historian historian;
	UA_MonitoredItem *listeners; /* of the events of all drives */
	UA_DataTypeArray *enumerations;
	/* Of the drives that came and went, for clients; told together. The ids are owned. */
	UA_ModelChangeStructureDataType *changes;
	size_t change_count;
};

static struct db_opcua_nodes *nodes_of(UA_Server *server)
{
	return UA_Server_getConfig(server)->context;
}

/* --- ids -------------------------------------------------------------------------------------- */

/* The types of events are in the library's own store. */
static bool identify_row(UA_String id, struct db_opcua_subject *subject)
{
	const struct db_opcua_type_row *row = db_opcua_type_find((const char *)id.data, id.length);

	*subject = (struct db_opcua_subject){ .type = DB_OPCUA_OF_TYPES, .row = row };
	return row && row->class != DB_OPCUA_EVENT_TYPE_ROW;
}

static bool identify(void *context, UA_UInt16 space, UA_String id, struct db_opcua_subject *subject)
{
	const struct db_opcua_nodes *nodes = context;

	if (id.length == 0)
		return false;
	if (space == nodes->roster.types)
		return identify_row(id, subject);
	return db_opcua_roster_identify(&nodes->roster, (const char *)id.data, id.length, subject);
}

/* --- reading and writing ---------------------------------------------------------------------- */

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
static UA_StatusCode read_identity(const struct db_opcua_nodes *nodes, struct db_opcua_drive *drive,
                                   bool model, UA_DataValue *value)
{
	const char *identity = db_opcua_plant_identify(nodes->plant, drive);
	size_t length = strcspn(identity, "-");
	const char *rest = identity[length] != '\0' ? identity + length + 1 : "";
	UA_LocalizedText name = { .text = db_opcua_string(identity) };
	UA_String revision = db_opcua_string(rest);
	UA_StatusCode status = UA_STATUSCODE_BADNODATA;

	name.text.length = length;
	if (identity[0] == '\0')
		status = UA_STATUSCODE_BADWAITINGFORINITIALDATA;
	else if (model)
		status = UA_Variant_setScalarCopy(&value->value, &name,
		                                  &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]);
	else if (rest[0] != '\0')
		status = UA_Variant_setScalarCopy(&value->value, &revision,
		                                  &UA_TYPES[UA_TYPES_STRING]);
	value->hasValue = status == UA_STATUSCODE_GOOD;
	value->hasStatus = !value->hasValue;
	value->status = status;
	value->hasSourceTimestamp = true;
	value->sourceTimestamp = UA_DateTime_now();
	return UA_STATUSCODE_GOOD;
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

static UA_StatusCode read_value(UA_Server *server, const UA_NodeId *session, void *session_context,
                                const UA_NodeId *node, void *node_context,
                                UA_Boolean source_time_wanted, const UA_NumericRange *range,
                                UA_DataValue *value)
{
	const struct db_opcua_nodes *nodes = nodes_of(server);
	const struct db_opcua_subject *subject = node_context;
	const struct db_opcua_shown *shown = subject->shown;
	const struct db_opcua_branch *branch = subject->branch;
	const struct db_opcua_column *column;

	(void)session;
	(void)session_context;
	(void)node;
	(void)source_time_wanted;
	if (range) {
		value->hasStatus = true;
		value->status = UA_STATUSCODE_BADINDEXRANGENODATA;
		return UA_STATUSCODE_GOOD;
	}
	if (subject->type == DB_OPCUA_FACT) {
		return db_opcua_value_from_json(subject->fact->value, subject->fact->time_us,
		                                quality_of_facts(nodes), value);
	}
	if (subject->type == DB_OPCUA_CONDITION) {
		return db_opcua_condition_read(&nodes->roster, subject,
		                               quality_of_facts(nodes) == DB_OPCUA_GOOD ?
		                                       UA_STATUSCODE_GOOD :
		                                       UA_STATUSCODE_BADNOCOMMUNICATION,
		                               value);
	}
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

static UA_StatusCode write_value(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *node, void *node_context,
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

/* The library writes what it knows of an event into its node; a condition has that already. */
static UA_StatusCode drop_value(UA_Server *server, const UA_NodeId *session, void *session_context,
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

static const json_t *command_of(const struct db_opcua_tree *tree,
                                const struct db_opcua_branch *branch)
{
	return json_array_get(tree->kind->commands, branch->place);
}

static UA_StatusCode call_method(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *method_id, void *method_context,
                                 const UA_NodeId *object, void *object_context, size_t input_count,
                                 const UA_Variant *input, size_t output_count, UA_Variant *output)
{
	const struct db_opcua_nodes *nodes = nodes_of(server);
	const struct db_opcua_subject *subject = method_context;
	const struct db_opcua_shown *shown = subject->shown;
	const json_t *command = command_of(shown->tree, subject->branch);
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

/* A drive's methods are called by their own ids: of a type's the library finds only those of the
 * drive's own type, not of those above it (1.4.11). */
static UA_StatusCode refuse_call(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *method_id, void *method_context,
                                 const UA_NodeId *object, void *object_context, size_t input_count,
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

struct db_opcua_need db_opcua_nodes_need(const struct db_opcua_nodes *nodes, const UA_NodeId *node,
                                         void *node_context)
{
	const struct db_opcua_subject *subject = node_context;
	const struct db_opcua_branch *branch;
	struct db_opcua_need need = { .may = DB_MAYS };

	if (node->namespaceIndex != nodes->roster.space || !subject ||
	    subject->type != DB_OPCUA_OF_DRIVE)
		return need;
	need.written = db_opcua_store_is_written(subject);
	branch = subject->branch;
	if (branch->type == DB_OPCUA_CLOCK) {
		need.may = DB_MAY_MOVE;
		need.name = "clock";
		return need;
	}
	need.of = need.drive = subject->shown->drive->name;
	if (branch->type == DB_OPCUA_METHOD) {
		need.name = json_string_value(
			json_object_get(command_of(subject->shown->tree, branch), "name"));
		need.may = db_may_of_command(need.name, &need.drive);
	} else if (branch->type == DB_OPCUA_VARIABLE) {
		need.name = subject->shown->drive->items[branch->place].reg->name;
		/* By what is written there, which may be a stop. */
		if (strcmp(need.name, "command") == 0)
			need.may = DB_MAY_STOP;
		else if (strcmp(need.name, "staged_command") == 0)
			need.may = DB_MAY_MOVE;
		else
			need.may = db_may_of_write(need.drive, need.name, 1.0);
	}
	return need;
}

/* --- filling ---------------------------------------------------------------------------------- */

/* Names are the same in every language. */
static void set_head(struct db_opcua_node *node, UA_NodeClass class, UA_QualifiedName name,
                     const char *description)
{
	UA_NodeHead *head = &node->node.head;

	head->nodeClass = class;
	head->browseName = name;
	node->display_name.localizedText.text = name.name;
	head->displayName = &node->display_name;
	if (description[0] == '\0')
		return;
	node->description.localizedText = db_opcua_english(description);
	head->description = &node->description;
}

static void set_type(struct db_opcua_node *node, UA_NodeId type, bool array, bool writable)
{
	UA_VariableNode *variable = &node->node.variableNode;

	variable->dataType = type;
	variable->valueRank = array ? UA_VALUERANK_ONE_DIMENSION : UA_VALUERANK_SCALAR;
	if (array) {
		variable->arrayDimensionsSize = 1;
		variable->arrayDimensions = &node->any_length;
	}
	variable->accessLevel = UA_ACCESSLEVELMASK_READ;
	if (writable)
		variable->accessLevel |= UA_ACCESSLEVELMASK_WRITE;
}

static void set_variable(struct db_opcua_node *node, UA_NodeId type, bool array, bool writable,
                         double interval_ms)
{
	UA_VariableNode *variable = &node->node.variableNode;

	set_type(node, type, array, writable);
	variable->valueSource = UA_VALUESOURCE_DATASOURCE;
	variable->value.dataSource = (UA_DataSource){ .read = read_value,
		                                      .write = writable ? write_value : NULL };
	/* Otherwise a client that asks for the fastest sampling, 0, would be notified only of
	 * writes over OPC UA. */
	variable->minimumSamplingInterval = interval_ms;
}

/* Of a register or a column: one of ours, or that of its form in messages. */
static UA_NodeId type_of(const struct db_opcua_nodes *nodes, const struct db_opcua_register *reg)
{
	return reg->data ? db_opcua_type_id(&nodes->roster, reg->data) :
	                   db_opcua_data_type(reg)->typeId;
}

/* A constant value, in memory that the node owns from now on. NULL: there is none, or it was not
 * asked for. */
static void set_constant(struct db_opcua_node *node, const UA_DataType *type, bool array,
                         void *values, size_t count)
{
	UA_VariableNode *variable = &node->node.variableNode;

	set_type(node, type->typeId, array, false);
	variable->valueSource = UA_VALUESOURCE_DATA;
	node->value = values;
	if (!values)
		return;
	variable->value.data.value.hasValue = true;
	if (array)
		UA_Variant_setArray(&variable->value.data.value.value, values, count, type);
	else
		UA_Variant_setScalar(&variable->value.data.value.value, values, type);
}

static void fill_object(struct db_opcua_node *node, UA_QualifiedName name, const char *description)
{
	set_head(node, UA_NODECLASS_OBJECT, name, description);
}

static void let_listen(struct db_opcua_node *node, UA_MonitoredItem **listeners)
{
	node->node.objectNode.eventNotifier = UA_EVENTNOTIFIER_SUBSCRIBE_TO_EVENT |
	                                      UA_EVENTNOTIFIER_HISTORY_READ;
	node->listeners = listeners;
}

static void fill_text(struct db_opcua_node *node, const char *text, bool valued)
{
	UA_String *value = valued ? malloc(sizeof(*value)) : NULL;

	if (value)
		*value = db_opcua_string(text);
	set_constant(node, &UA_TYPES[UA_TYPES_STRING], false, value, 1);
}

/* A name is the same in every language. */
static void fill_name(struct db_opcua_node *node, const char *text, bool valued)
{
	UA_LocalizedText *value = valued ? malloc(sizeof(*value)) : NULL;

	if (value)
		*value = (UA_LocalizedText){ .text = db_opcua_string(text) };
	set_constant(node, &UA_TYPES[UA_TYPES_LOCALIZEDTEXT], false, value, 1);
}

static void fill_property(const struct db_opcua_shown *shown, const struct db_opcua_branch *branch,
                          struct db_opcua_node *node, bool valued)
{
	size_t count = 0;
	bool array;
	const UA_DataType *type = db_opcua_property_type(branch, &array);
	void *values = valued ? db_opcua_property_value(shown->tree, branch, &count) : NULL;

	set_head(node, UA_NODECLASS_VARIABLE,
	         (UA_QualifiedName){ .name = db_opcua_string(branch->name) },
	         db_opcua_property_text(branch));
	set_constant(node, type, array, values, count);
}

/* As its type describes this member. */
static const char *text_of(const struct db_opcua_tree *tree, const struct db_opcua_branch *branch)
{
	const struct db_opcua_type_row *row = db_opcua_type_member(tree->kind->type, branch->path);

	return row ? row->text : "";
}

/* The variable of a register; of some the service keeps the values of a week. */
static void fill_register(const struct db_opcua_nodes *nodes, struct db_opcua_node *node)
{
	const struct db_opcua_shown *shown = node->subject.shown;
	const struct db_opcua_branch *branch = node->subject.branch;
	const struct db_opcua_register *reg = &shown->tree->kind->list[branch->place];

	set_head(node, UA_NODECLASS_VARIABLE, db_opcua_member_name(&nodes->roster, branch->name),
	         reg->description[0] ? reg->description : text_of(shown->tree, branch));
	set_variable(node, type_of(nodes, reg), false, reg->writable, nodes->config->interval_ms);
	if (!shown->gateway && db_opcua_history_field(reg->name)) {
		node->node.variableNode.historizing = true;
		node->node.variableNode.accessLevel |= UA_ACCESSLEVELMASK_HISTORYREAD;
	}
}

static void fill_branch(const struct db_opcua_nodes *nodes, struct db_opcua_node *node, bool valued)
{
	struct db_opcua_shown *shown = node->subject.shown;
	const struct db_opcua_branch *branch = node->subject.branch;
	const struct db_opcua_kind *kind = shown->tree->kind;
	UA_QualifiedName name = db_opcua_branch_name(&nodes->roster, branch);
	double interval_ms = nodes->config->interval_ms;
	const char *text;

	switch (branch->type) {
	case DB_OPCUA_ROOT:
		if (shown->gateway) {
			fill_object(node, db_opcua_member_name(&nodes->roster, "Gateway"),
			            kind->type->text);
			break;
		}
		fill_object(node, db_opcua_own_name(&nodes->roster, shown->name), kind->type->text);
		let_listen(node, &shown->listeners);
		break;
	case DB_OPCUA_FOLDER:
	case DB_OPCUA_IDENTIFICATION:
		fill_object(node, name, text_of(shown->tree, branch));
		break;
	case DB_OPCUA_VARIABLE:
		fill_register(nodes, node);
		break;
	case DB_OPCUA_COLUMN:
		text = text_of(shown->tree, branch);
		set_head(node, UA_NODECLASS_VARIABLE, name,
		         text[0] ? text : "Of the latest commands, the newest first");
		set_variable(node, type_of(nodes, kind->columns[branch->place].first), true, false,
		             interval_ms);
		break;
	case DB_OPCUA_CLOCK:
		set_head(node, UA_NODECLASS_VARIABLE, name, text_of(shown->tree, branch));
		set_variable(node, UA_TYPES[UA_TYPES_STRING].typeId, false, true, interval_ms);
		break;
	case DB_OPCUA_CERTIFICATE_ENDS:
		set_head(node, UA_NODECLASS_VARIABLE, name, text_of(shown->tree, branch));
		set_variable(node, UA_TYPES[UA_TYPES_DATETIME].typeId, false, false,
		             FIGURES_INTERVAL);
		break;
	case DB_OPCUA_METHOD:
		text = json_string_value(
			json_object_get(command_of(shown->tree, branch), "description"));
		set_head(node, UA_NODECLASS_METHOD, name,
		         text ? text : text_of(shown->tree, branch));
		node->node.methodNode.executable = true;
		node->node.methodNode.method = call_method;
		break;
	case DB_OPCUA_COMPONENT_NAME:
		set_head(node, UA_NODECLASS_VARIABLE, name, text_of(shown->tree, branch));
		fill_name(node, shown->name, valued);
		break;
	case DB_OPCUA_LOCATION:
		set_head(node, UA_NODECLASS_VARIABLE, name, text_of(shown->tree, branch));
		fill_text(node, shown->location, valued);
		break;
	case DB_OPCUA_MODEL:
	case DB_OPCUA_SOFTWARE_REVISION:
		set_head(node, UA_NODECLASS_VARIABLE, name, text_of(shown->tree, branch));
		set_variable(node,
		             UA_TYPES[branch->type == DB_OPCUA_MODEL ? UA_TYPES_LOCALIZEDTEXT :
		                                                       UA_TYPES_STRING]
		                     .typeId,
		             false, false, FIGURES_INTERVAL);
		break;
	default:
		fill_property(shown, branch, node, valued);
	}
}

static void fill_condition(const struct db_opcua_nodes *nodes, struct db_opcua_node *node)
{
	const struct db_opcua_alarm *alarm = node->subject.alarm;
	enum db_opcua_member member = node->subject.member;

	if (member == DB_OPCUA_MEMBERS) {
		fill_object(node, db_opcua_condition_name(&nodes->roster, alarm), alarm->text);
		return;
	}
	set_head(node, UA_NODECLASS_VARIABLE,
	         (UA_QualifiedName){ .name = db_opcua_string(db_opcua_members[member].name) }, "");
	set_variable(node, db_opcua_condition_type(member)->typeId, false, false,
	             nodes->config->interval_ms);
	node->node.variableNode.value.dataSource.write = drop_value;
}

/* Members of types have no values and no actions. */
static void fill_row(const struct db_opcua_nodes *nodes, struct db_opcua_node *node, bool valued)
{
	static const UA_NodeClass classes[] = {
		[DB_OPCUA_OBJECT_TYPE_ROW] = UA_NODECLASS_OBJECTTYPE,
		[DB_OPCUA_DATA_TYPE_ROW] = UA_NODECLASS_DATATYPE,
		[DB_OPCUA_OBJECT_ROW] = UA_NODECLASS_OBJECT,
		[DB_OPCUA_VARIABLE_ROW] = UA_NODECLASS_VARIABLE,
		[DB_OPCUA_METHOD_ROW] = UA_NODECLASS_METHOD,
		[DB_OPCUA_NAMES_ROW] = UA_NODECLASS_VARIABLE,
		[DB_OPCUA_BITS_ROW] = UA_NODECLASS_VARIABLE,
		[DB_OPCUA_INPUTS_ROW] = UA_NODECLASS_VARIABLE,
		[DB_OPCUA_OUTPUTS_ROW] = UA_NODECLASS_VARIABLE,
	};
	const struct db_opcua_type_row *row = node->subject.row;
	const struct db_opcua_type_row *data = db_opcua_type_data(row);
	UA_NodeId type = data ? db_opcua_type_id(&nodes->roster, data) :
	                        UA_NODEID_NUMERIC(0, row->basic);
	size_t count = 0;

	set_head(node, classes[row->class], db_opcua_row_name(&nodes->roster, row), row->text);
	if (row->class == DB_OPCUA_VARIABLE_ROW) {
		set_type(node, type, row->array, row->writable);
		node->node.variableNode.valueSource = UA_VALUESOURCE_DATA;
	} else if (row->class == DB_OPCUA_METHOD_ROW) {
		node->node.methodNode.method = refuse_call;
	} else if (row->class >= DB_OPCUA_NAMES_ROW) {
		void *values = valued ? db_opcua_row_value(row, &count) : NULL;

		set_constant(node, db_opcua_row_type(row), true, values, count);
	}
}

static void fill_node(void *context, struct db_opcua_node *node, bool valued)
{
	struct db_opcua_nodes *nodes = context;
	const struct db_opcua_bus *bus = node->subject.bus;
	const struct db_opcua_fact *fact = node->subject.fact;
	const struct db_opcua_type_row *row;

	switch (node->subject.type) {
	case DB_OPCUA_ALL_DRIVES:
		fill_object(node, db_opcua_member_name(&nodes->roster, "Drives"),
		            "The drives by their names");
		let_listen(node, &nodes->listeners);
		break;
	case DB_OPCUA_ALL_BUSES:
		fill_object(node, db_opcua_member_name(&nodes->roster, "Buses"),
		            "The lines that they are on");
		break;
	case DB_OPCUA_ALL_ALARMS:
		fill_object(node, db_opcua_member_name(&nodes->roster, "Alarms"),
		            "The alarms that there have been, as conditions");
		break;
	case DB_OPCUA_CONDITION:
		fill_condition(nodes, node);
		break;
	case DB_OPCUA_BUS:
		fill_object(node, db_opcua_own_name(&nodes->roster, bus->name),
		            db_opcua_type_of_bus()->text);
		break;
	case DB_OPCUA_FACT:
		row = db_opcua_type_member(db_opcua_type_of_bus(), fact->name);
		set_head(node, UA_NODECLASS_VARIABLE,
		         db_opcua_member_name(&nodes->roster, fact->name), row ? row->text : "");
		set_variable(node, db_opcua_json_type(fact->value)->typeId, false, false,
		             FIGURES_INTERVAL);
		break;
	case DB_OPCUA_OF_TYPES:
		fill_row(nodes, node, valued);
		break;
	case DB_OPCUA_OF_DRIVE:
	default:
		fill_branch(nodes, node, valued);
	}
}

static void refer_of_node(void *context, const struct db_opcua_subject *subject,
                          struct db_opcua_references *references)
{
	const struct db_opcua_nodes *nodes = context;

	db_opcua_refer(&nodes->roster, subject, references);
}

/* --- drives ----------------------------------------------------------------------------------- */

/* From a folder of the standard to one of ours; the node itself has the inverse reference. */
static UA_StatusCode link_drive(struct db_opcua_nodes *nodes, const struct db_opcua_shown *shown,
                                bool comes)
{
	struct db_opcua_id id = db_opcua_id_of(shown->name, "");

	UA_NodeId node = db_opcua_node_id(&nodes->roster, &id);
	UA_QualifiedName name;
	UA_StatusCode status;

	if (shown->gateway)
		return db_opcua_store_link(nodes->store,
		                           UA_NODEID_NUMERIC(0, UA_NS0ID_OBJECTSFOLDER),
		                           UA_REFERENCETYPEINDEX_HASCOMPONENT, node,
		                           db_opcua_member_name(&nodes->roster, "Gateway"), comes);
	name = db_opcua_own_name(&nodes->roster, shown->name);
	status = db_opcua_store_link(nodes->store,
	                             UA_NODEID_NUMERIC(nodes->roster.devices, DB_OPCUA_DEVICE_SET),
	                             UA_REFERENCETYPEINDEX_ORGANIZES, node, name, comes);
	/* Not from the folder: a client that browses it would see each drive twice. */
	if (status == UA_STATUSCODE_GOOD || !comes)
		status = db_opcua_store_link(nodes->store, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER),
		                             UA_REFERENCETYPEINDEX_HASNOTIFIER, node, name, comes);
	return status;
}

/* Without memory clients are not told: they find it when they look. */
static void note_change(struct db_opcua_nodes *nodes, const char *owner,
                        const struct db_opcua_type_row *type, unsigned verbs)
{
	struct db_opcua_id id = db_opcua_id_of(owner, "");
	UA_NodeId node = db_opcua_node_id(&nodes->roster, &id);
	UA_ModelChangeStructureDataType *grown = realloc(nodes->changes, (nodes->change_count + 1) *
	                                                                         sizeof(*grown));
	UA_ModelChangeStructureDataType *change;

	if (!grown)
		return;
	nodes->changes = grown;
	change = &grown[nodes->change_count];
	UA_ModelChangeStructureDataType_init(change);
	if (UA_NodeId_copy(&node, &change->affected) != UA_STATUSCODE_GOOD)
		return;
	change->affectedType = type ? db_opcua_type_id(&nodes->roster, type) :
	                              UA_NODEID_NUMERIC(0, UA_NS0ID_FOLDERTYPE);
	change->verb = (UA_Byte)verbs;
	nodes->change_count++;
}

static void forget_changes(struct db_opcua_nodes *nodes)
{
	for (size_t i = 0; i < nodes->change_count; i++)
		UA_NodeId_clear(&nodes->changes[i].affected);
	free(nodes->changes);
	nodes->changes = NULL;
	nodes->change_count = 0;
}

static void tell_changes(void *context)
{
	struct db_opcua_nodes *nodes = context;

	if (nodes->change_count == 0)
		return;
	note_change(nodes, DB_OPCUA_DRIVES, NULL, CHILDREN_CHANGED);
	db_opcua_events_tell_changes(nodes->server, nodes->changes, nodes->change_count);
	forget_changes(nodes);
}

static void show_drive(struct db_opcua_nodes *nodes, struct db_opcua_drive *drive,
                       const json_t *description)
{
	struct db_opcua_shown *shown = db_opcua_roster_add(&nodes->roster, nodes->config, drive,
	                                                   description);
	UA_StatusCode status = shown ? link_drive(nodes, shown, true) :
	                               UA_STATUSCODE_BADOUTOFMEMORY;

	if (status == UA_STATUSCODE_GOOD)
		return;
	db_client_log(DB_CLIENT_ERROR, "drive %s cannot be shown: %s", drive->name,
	              UA_StatusCode_name(status));
	if (shown)
		db_opcua_roster_remove(&nodes->roster, shown);
}

static struct db_opcua_shown *find_shown(const struct db_opcua_nodes *nodes,
                                         const struct db_opcua_drive *drive)
{
	for (size_t i = 0; i < nodes->roster.count; i++) {
		if (nodes->roster.drives[i]->drive == drive)
			return nodes->roster.drives[i];
	}
	return NULL;
}

static void add_drive(void *context, struct db_opcua_drive *drive, const json_t *description)
{
	struct db_opcua_nodes *nodes = context;

	show_drive(nodes, drive, description);
	if (drive->name[0] != '\0')
		note_change(nodes, drive->name, drive->kind->type,
		            UA_MODELCHANGESTRUCTUREVERBMASK_NODEADDED);
}

static void hide_drive(struct db_opcua_nodes *nodes, const struct db_opcua_drive *drive)
{
	struct db_opcua_shown *shown = find_shown(nodes, drive);

	if (!shown)
		return;
	(void)link_drive(nodes, shown, false);
	db_opcua_roster_remove(&nodes->roster, shown);
}

static void remove_drive(void *context, const struct db_opcua_drive *drive)
{
	struct db_opcua_nodes *nodes = context;

	hide_drive(nodes, drive);
	note_change(nodes, drive->name, drive->kind->type,
	            UA_MODELCHANGESTRUCTUREVERBMASK_NODEDELETED);
}

/* Subscriptions to its events continue. */
static void replace_drive(void *context, const struct db_opcua_drive *before,
                          struct db_opcua_drive *drive, const json_t *description)
{
	struct db_opcua_nodes *nodes = context;
	struct db_opcua_shown *shown = find_shown(nodes, before);
	UA_MonitoredItem *listeners = shown ? shown->listeners : NULL;

	hide_drive(nodes, before);
	show_drive(nodes, drive, description);
	shown = find_shown(nodes, drive);
	if (shown)
		shown->listeners = listeners;
	if (drive->name[0] != '\0')
		note_change(nodes, drive->name, drive->kind->type, CHILDREN_CHANGED);
}

/* --- buses and events ------------------------------------------------------------------------- */

static void set_buses(void *context, json_t *buses)
{
	struct db_opcua_nodes *nodes = context;

	db_opcua_buses_describe(&nodes->roster.buses, buses, db_client_wall_us());
}

static void set_figures(void *context, json_t *buses)
{
	const struct db_opcua_nodes *nodes = context;

	db_opcua_buses_measure(nodes->roster.buses, buses, db_client_wall_us());
}

static void set_troubles(void *context, json_t *buses)
{
	const struct db_opcua_nodes *nodes = context;

	db_opcua_buses_diagnose(nodes->roster.buses, buses, db_client_wall_us());
}

static void take_alarms(void *context, const json_t *answer, bool first)
{
	const struct db_opcua_nodes *nodes = context;

	db_opcua_conditions_take(nodes->conditions, answer, first);
}

/* From its drive, or from all drives if there is no such drive. */
static void show_event(void *context, const json_t *event)
{
	const struct db_opcua_nodes *nodes = context;
	const char *drive = db_client_text(event, "drive");
	bool there = db_opcua_roster_find(&nodes->roster, drive, strlen(drive)) != NULL;
	struct db_opcua_id id = db_opcua_id_of(there ? drive : DB_OPCUA_DRIVES, "");

	db_opcua_events_tell(nodes->server, event, db_opcua_node_id(&nodes->roster, &id));
}

const struct db_opcua_plant_ops db_opcua_nodes_plant_ops = {
	.added = add_drive,
	.replaced = replace_drive,
	.removed = remove_drive,
	.settled = tell_changes,
	.buses = set_buses,
	.figures = set_figures,
	.troubles = set_troubles,
	.alarms = take_alarms,
	.event = show_event,
};

/* --- the whole -------------------------------------------------------------------------------- */

struct db_opcua_nodes *db_opcua_nodes_new(sd_event *loop, const struct db_opcua_config *config,
                                          const struct db_opcua_nodes_ops *ops, void *context)
{
	static const struct db_opcua_store_ops store_ops = {
		.find = identify,
		.fill = fill_node,
		.refer = refer_of_node,
	};
	struct db_opcua_nodes *nodes = calloc(1, sizeof(*nodes));

	if (!nodes)
		return NULL;
	nodes->config = config;
	nodes->ops = ops;
	nodes->context = context;
	nodes->store = db_opcua_store_new(&store_ops, nodes);
	nodes->conditions = db_opcua_conditions_new(&nodes->roster, ops->acknowledge, context);
	nodes->past = db_opcua_past_new(loop, config, &nodes->roster, ops->may_read_trail, context);
	if (!nodes->store || !nodes->conditions || !nodes->past) {
		db_opcua_nodes_free(nodes);
		return NULL;
	}
	return nodes;
}

void db_opcua_nodes_free(struct db_opcua_nodes *nodes)
{
	if (!nodes)
		return;
	db_opcua_past_free(nodes->past);
	db_opcua_conditions_free(nodes->conditions);
	db_opcua_roster_clear(&nodes->roster);
	db_opcua_store_free(nodes->store);
	db_opcua_enumerations_free(nodes->enumerations);
	forget_changes(nodes);
	free(nodes);
}

UA_Nodestore db_opcua_nodes_store(struct db_opcua_nodes *nodes)
{
	return db_opcua_store_give(nodes->store);
}

/* A folder or type below a node of the standard, which has the other end of the reference. */
static UA_StatusCode link_to(struct db_opcua_nodes *nodes, UA_UInt32 from, UA_Byte tie,
                             UA_NodeId target, const char *name)
{
	return db_opcua_store_link(nodes->store, UA_NODEID_NUMERIC(0, from), tie, target,
	                           db_opcua_member_name(&nodes->roster, name), true);
}

static UA_StatusCode link_types(struct db_opcua_nodes *nodes)
{
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	for (size_t i = 0; i < db_opcua_type_count && status == UA_STATUSCODE_GOOD; i++) {
		const struct db_opcua_type_row *row = &db_opcua_type_rows[i];

		if (row->above < 0 && row->class != DB_OPCUA_EVENT_TYPE_ROW)
			status = db_opcua_store_link(
				nodes->store,
				UA_NODEID_NUMERIC(row->devices_type ? nodes->roster.devices : 0,
			                          row->standard),
				UA_REFERENCETYPEINDEX_HASSUBTYPE,
				db_opcua_type_id(&nodes->roster, row),
				db_opcua_member_name(&nodes->roster, row->id), true);
	}
	return status;
}

UA_StatusCode db_opcua_nodes_begin(struct db_opcua_nodes *nodes, UA_Server *server,
                                   struct db_opcua_plant *plant)
{
	struct db_opcua_id drives = db_opcua_id_of(DB_OPCUA_DRIVES, "");
	struct db_opcua_id buses = db_opcua_id_of(DB_OPCUA_BUSES, "");
	struct db_opcua_id alarms = db_opcua_id_of(DB_OPCUA_ALARMS, "");
	char uri[DB_OPCUA_URI_MAX];
	UA_StatusCode status;

	nodes->server = server;
	nodes->plant = plant;
	nodes->roster.types = UA_Server_addNamespace(server, DB_OPCUA_TYPES_NAMESPACE);
	db_opcua_config_space(nodes->config, uri);
	nodes->roster.space = UA_Server_addNamespace(server, uri);
	nodes->enumerations = db_opcua_enumerations_new(nodes->roster.types);
	if (!nodes->enumerations)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	UA_Server_getConfig(server)->customDataTypes = nodes->enumerations;
	UA_Server_getConfig(server)->context = nodes;
	nodes->historian = (struct db_opcua_historian){ &nodes->roster, plant, nodes->past };
	UA_Server_getConfig(server)->historyDatabase = db_opcua_historian_give(&nodes->historian);
	db_opcua_store_begin(nodes->store, nodes->roster.space, nodes->roster.types);
	nodes->roster.has_condition = db_opcua_store_reference_type(nodes->store,
	                                                            UA_NS0ID_HASCONDITION);
	nodes->roster.has_interface = db_opcua_store_reference_type(nodes->store,
	                                                            UA_NS0ID_HASINTERFACE);
	status = db_opcua_devices_add(server, &nodes->roster.devices);
	if (status == UA_STATUSCODE_GOOD)
		status = link_to(nodes, UA_NS0ID_OBJECTSFOLDER, UA_REFERENCETYPEINDEX_ORGANIZES,
		                 db_opcua_node_id(&nodes->roster, &drives), "Drives");
	if (status == UA_STATUSCODE_GOOD)
		status = link_to(nodes, UA_NS0ID_SERVER, UA_REFERENCETYPEINDEX_HASNOTIFIER,
		                 db_opcua_node_id(&nodes->roster, &drives), "Drives");
	if (status == UA_STATUSCODE_GOOD)
		status = link_to(nodes, UA_NS0ID_OBJECTSFOLDER, UA_REFERENCETYPEINDEX_ORGANIZES,
		                 db_opcua_node_id(&nodes->roster, &buses), "Buses");
	if (status == UA_STATUSCODE_GOOD)
		status = link_to(nodes, UA_NS0ID_OBJECTSFOLDER, UA_REFERENCETYPEINDEX_ORGANIZES,
		                 db_opcua_node_id(&nodes->roster, &alarms), "Alarms");
	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_writeEventNotifier(server, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER),
		                                      UA_EVENTNOTIFIER_SUBSCRIBE_TO_EVENT |
		                                              UA_EVENTNOTIFIER_HISTORY_READ);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_conditions_begin(nodes->conditions, server);
	if (status == UA_STATUSCODE_GOOD)
		status = link_types(nodes);
	return status;
}

UA_UInt16 db_opcua_nodes_types(const struct db_opcua_nodes *nodes)
{
	return nodes->roster.types;
}

db_time db_opcua_nodes_tend(struct db_opcua_nodes *nodes, db_time now)
{
	db_time due = db_opcua_conditions_tend(nodes->conditions, now);
	db_time other = db_opcua_past_tend(nodes->past, now);

	return other < due ? other : due;
}

void db_opcua_nodes_watch(struct db_opcua_nodes *nodes, const UA_NodeId *node, bool removed)
{
	struct db_opcua_subject subject;
	struct db_opcua_item *item;

	if (node->namespaceIndex != nodes->roster.space ||
	    node->identifierType != UA_NODEIDTYPE_STRING ||
	    !identify(nodes, node->namespaceIndex, node->identifier.string, &subject) ||
	    !subject.branch || subject.branch->type != DB_OPCUA_VARIABLE)
		return;
	item = &subject.shown->drive->items[subject.branch->place];
	if (!removed)
		item->watchers++;
	else if (item->watchers > 0)
		item->watchers--;
	db_opcua_plant_rewatch(nodes->plant);
}
