/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/nodes.h"
#include "opcua/events.h"
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

struct db_opcua_nodes {
	const struct db_opcua_config *config;
	const struct db_opcua_nodes_ops *ops;
	void *context;
	UA_Server *server;
	struct db_opcua_plant *plant;
	struct db_opcua_store *store;
	struct db_opcua_roster roster;
	UA_MonitoredItem *listeners; /* of the events of all drives */
};

static struct db_opcua_nodes *nodes_of(UA_Server *server)
{
	return UA_Server_getConfig(server)->context;
}

/* --- ids -------------------------------------------------------------------------------------- */

static bool identify(void *context, UA_String id, struct db_opcua_subject *subject)
{
	const struct db_opcua_nodes *nodes = context;

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
	if (branch->type == DB_OPCUA_CLOCK)
		return read_clock(nodes, value);
	if (branch->type == DB_OPCUA_CERTIFICATE_ENDS)
		return read_certificate_ends(nodes, value);
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

static void set_variable(struct db_opcua_node *node, const UA_DataType *type, bool array,
                         bool writable, double interval_ms)
{
	UA_VariableNode *variable = &node->node.variableNode;

	variable->dataType = type->typeId;
	variable->valueRank = array ? UA_VALUERANK_ONE_DIMENSION : UA_VALUERANK_SCALAR;
	if (array) {
		variable->arrayDimensionsSize = 1;
		variable->arrayDimensions = &node->any_length;
	}
	variable->accessLevel = UA_ACCESSLEVELMASK_READ;
	if (writable)
		variable->accessLevel |= UA_ACCESSLEVELMASK_WRITE;
	variable->valueSource = UA_VALUESOURCE_DATASOURCE;
	variable->value.dataSource = (UA_DataSource){ .read = read_value,
		                                      .write = writable ? write_value : NULL };
	/* Otherwise a client that asks for the fastest sampling, 0, would be notified only of
	 * writes over OPC UA. */
	variable->minimumSamplingInterval = interval_ms;
}

/* A constant value, in memory that the node owns from now on. NULL: there is none, or it was not
 * asked for. */
static void set_constant(struct db_opcua_node *node, const UA_DataType *type, bool array,
                         void *values, size_t count)
{
	UA_VariableNode *variable = &node->node.variableNode;

	set_variable(node, type, array, false, 0.0);
	variable->valueSource = UA_VALUESOURCE_DATA;
	memset(&variable->value, 0, sizeof(variable->value));
	node->value = values;
	if (!values)
		return;
	variable->value.data.value.hasValue = true;
	if (array)
		UA_Variant_setArray(&variable->value.data.value.value, values, count, type);
	else
		UA_Variant_setScalar(&variable->value.data.value.value, values, type);
}

static void fill_object(const struct db_opcua_nodes *nodes, struct db_opcua_node *node,
                        const char *name, const char *description)
{
	set_head(node, UA_NODECLASS_OBJECT, db_opcua_browse_name(&nodes->roster, name),
	         description);
}

static void let_listen(struct db_opcua_node *node, UA_MonitoredItem **listeners)
{
	node->node.objectNode.eventNotifier = UA_EVENTNOTIFIER_SUBSCRIBE_TO_EVENT;
	node->listeners = listeners;
}

static void fill_text(struct db_opcua_node *node, const char *text, bool valued)
{
	UA_String *value = valued ? malloc(sizeof(*value)) : NULL;

	if (value)
		*value = db_opcua_string(text);
	set_constant(node, &UA_TYPES[UA_TYPES_STRING], false, value, 1);
}

static void fill_variable(struct db_opcua_node *node, UA_QualifiedName name,
                          const char *description, const UA_DataType *type, bool writable,
                          double interval_ms)
{
	set_head(node, UA_NODECLASS_VARIABLE, name, description);
	set_variable(node, type, false, writable, interval_ms);
}

static void fill_property(const struct db_opcua_shown *shown, const struct db_opcua_branch *branch,
                          struct db_opcua_node *node, bool valued)
{
	size_t count = 0;
	bool array;
	const UA_DataType *type = db_opcua_property_type(branch, &array);
	void *values = valued ? db_opcua_property_value(shown->tree, branch, &count) : NULL;

	set_head(node, UA_NODECLASS_VARIABLE,
	         (UA_QualifiedName){ .name = db_opcua_string(branch->name) }, "");
	set_constant(node, type, array, values, count);
}

static void fill_branch(const struct db_opcua_nodes *nodes, struct db_opcua_node *node, bool valued)
{
	struct db_opcua_shown *shown = node->subject.shown;
	const struct db_opcua_branch *branch = node->subject.branch;
	const struct db_opcua_kind *kind = shown->tree->kind;
	UA_QualifiedName name = db_opcua_browse_name(&nodes->roster, branch->name);
	const struct db_opcua_register *reg;
	const char *text;

	switch (branch->type) {
	case DB_OPCUA_ROOT:
		if (shown->gateway) {
			fill_object(nodes, node, "Gateway", "The service itself and its clients");
			break;
		}
		fill_object(nodes, node, shown->name, "");
		let_listen(node, &shown->listeners);
		break;
	case DB_OPCUA_FOLDER:
		fill_object(nodes, node, branch->name, "");
		break;
	case DB_OPCUA_IDENTIFICATION:
		fill_object(
			nodes, node, branch->name,
			"What is known of the drive itself, in the names of OPC UA for Machinery");
		break;
	case DB_OPCUA_VARIABLE:
		reg = &kind->list[branch->place];
		fill_variable(node, name, reg->description, db_opcua_data_type(reg->type),
		              reg->writable, nodes->config->interval_ms);
		break;
	case DB_OPCUA_COLUMN:
		set_head(node, UA_NODECLASS_VARIABLE, name,
		         "Of the latest commands, the newest first");
		set_variable(node, db_opcua_data_type(kind->columns[branch->place].first->type),
		             true, false, nodes->config->interval_ms);
		break;
	case DB_OPCUA_CLOCK:
		fill_variable(
			node, name,
			"A moment of the service's clock; once a session has written one here, a motion "
			"that it starts is refused when the newest it has written is older than 500 ms",
			&UA_TYPES[UA_TYPES_STRING], true, nodes->config->interval_ms);
		break;
	case DB_OPCUA_CERTIFICATE_ENDS:
		fill_variable(node, name,
		              "When the certificate ends that this server shows to its clients",
		              &UA_TYPES[UA_TYPES_DATETIME], false, FIGURES_INTERVAL);
		break;
	case DB_OPCUA_METHOD:
		text = json_string_value(
			json_object_get(command_of(shown->tree, branch), "description"));
		set_head(node, UA_NODECLASS_METHOD, name, text ? text : "");
		node->node.methodNode.executable = true;
		node->node.methodNode.method = call_method;
		break;
	case DB_OPCUA_COMPONENT_NAME:
	case DB_OPCUA_LOCATION:
		set_head(node, UA_NODECLASS_VARIABLE, name, "");
		fill_text(node, branch->type == DB_OPCUA_LOCATION ? shown->location : shown->name,
		          valued);
		break;
	default:
		fill_property(shown, branch, node, valued);
	}
}

static void fill_node(void *context, struct db_opcua_node *node, bool valued)
{
	struct db_opcua_nodes *nodes = context;
	const struct db_opcua_bus *bus = node->subject.bus;
	const struct db_opcua_fact *fact = node->subject.fact;

	switch (node->subject.type) {
	case DB_OPCUA_ALL_DRIVES:
		fill_object(nodes, node, "Drives", "The drives by their names");
		let_listen(node, &nodes->listeners);
		break;
	case DB_OPCUA_ALL_BUSES:
		fill_object(nodes, node, "Buses", "The lines that they are on");
		break;
	case DB_OPCUA_BUS:
		fill_object(nodes, node, bus->name, "");
		break;
	case DB_OPCUA_FACT:
		set_head(node, UA_NODECLASS_VARIABLE,
		         db_opcua_browse_name(&nodes->roster, fact->name), "");
		set_variable(node, db_opcua_json_type(fact->value), false, false, FIGURES_INTERVAL);
		break;
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

	if (shown->gateway)
		return db_opcua_store_link(nodes->store, UA_NS0ID_OBJECTSFOLDER,
		                           UA_REFERENCETYPEINDEX_HASCOMPONENT,
		                           db_opcua_node_id(&nodes->roster, &id),
		                           db_opcua_browse_name(&nodes->roster, "Gateway"), comes);
	/* Not from the folder: a client that browses it would see each drive twice. */
	return db_opcua_store_link(nodes->store, UA_NS0ID_SERVER, UA_REFERENCETYPEINDEX_HASNOTIFIER,
	                           db_opcua_node_id(&nodes->roster, &id),
	                           db_opcua_browse_name(&nodes->roster, shown->name), comes);
}

static void add_drive(void *context, struct db_opcua_drive *drive, const json_t *description)
{
	struct db_opcua_nodes *nodes = context;
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

static void remove_drive(void *context, const struct db_opcua_drive *drive)
{
	struct db_opcua_nodes *nodes = context;
	struct db_opcua_shown *shown = find_shown(nodes, drive);

	if (!shown)
		return;
	(void)link_drive(nodes, shown, false);
	db_opcua_roster_remove(&nodes->roster, shown);
}

/* Subscriptions to its events continue. */
static void replace_drive(void *context, const struct db_opcua_drive *before,
                          struct db_opcua_drive *drive, const json_t *description)
{
	struct db_opcua_nodes *nodes = context;
	struct db_opcua_shown *shown = find_shown(nodes, before);
	UA_MonitoredItem *listeners = shown ? shown->listeners : NULL;

	remove_drive(nodes, before);
	add_drive(nodes, drive, description);
	shown = find_shown(nodes, drive);
	if (shown)
		shown->listeners = listeners;
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
	.buses = set_buses,
	.figures = set_figures,
	.troubles = set_troubles,
	.event = show_event,
};

/* --- the whole -------------------------------------------------------------------------------- */

struct db_opcua_nodes *db_opcua_nodes_new(const struct db_opcua_config *config,
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
	if (!nodes->store) {
		free(nodes);
		return NULL;
	}
	return nodes;
}

void db_opcua_nodes_free(struct db_opcua_nodes *nodes)
{
	if (!nodes)
		return;
	db_opcua_roster_clear(&nodes->roster);
	db_opcua_store_free(nodes->store);
	free(nodes);
}

UA_Nodestore db_opcua_nodes_store(struct db_opcua_nodes *nodes)
{
	return db_opcua_store_give(nodes->store);
}

UA_StatusCode db_opcua_nodes_begin(struct db_opcua_nodes *nodes, UA_Server *server,
                                   struct db_opcua_plant *plant)
{
	struct db_opcua_id drives = db_opcua_id_of(DB_OPCUA_DRIVES, "");
	struct db_opcua_id buses = db_opcua_id_of(DB_OPCUA_BUSES, "");
	UA_StatusCode status;

	nodes->server = server;
	nodes->plant = plant;
	nodes->roster.space = UA_Server_addNamespace(server, DB_OPCUA_NAMESPACE);
	UA_Server_getConfig(server)->context = nodes;
	db_opcua_store_begin(nodes->store, nodes->roster.space);
	status = db_opcua_store_link(nodes->store, UA_NS0ID_OBJECTSFOLDER,
	                             UA_REFERENCETYPEINDEX_ORGANIZES,
	                             db_opcua_node_id(&nodes->roster, &drives),
	                             db_opcua_browse_name(&nodes->roster, "Drives"), true);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_store_link(nodes->store, UA_NS0ID_SERVER,
		                             UA_REFERENCETYPEINDEX_HASNOTIFIER,
		                             db_opcua_node_id(&nodes->roster, &drives),
		                             db_opcua_browse_name(&nodes->roster, "Drives"), true);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_store_link(nodes->store, UA_NS0ID_OBJECTSFOLDER,
		                             UA_REFERENCETYPEINDEX_ORGANIZES,
		                             db_opcua_node_id(&nodes->roster, &buses),
		                             db_opcua_browse_name(&nodes->roster, "Buses"), true);
	return status;
}

void db_opcua_nodes_watch(struct db_opcua_nodes *nodes, const UA_NodeId *node, bool removed)
{
	struct db_opcua_subject subject;
	struct db_opcua_item *item;

	if (node->namespaceIndex != nodes->roster.space ||
	    node->identifierType != UA_NODEIDTYPE_STRING ||
	    !identify(nodes, node->identifier.string, &subject) || !subject.branch ||
	    subject.branch->type != DB_OPCUA_VARIABLE)
		return;
	item = &subject.shown->drive->items[subject.branch->place];
	if (!removed)
		item->watchers++;
	else if (item->watchers > 0)
		item->watchers--;
	db_opcua_plant_rewatch(nodes->plant);
}
