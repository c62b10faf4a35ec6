/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/node_fill.h"
#include "opcua/conditions.h"
#include "opcua/history.h"
#include "opcua/node_values.h"
#include "opcua/nodes_private.h"
#include "opcua/properties.h"
#include "opcua/references.h"
#include "opcua/values.h"

#include <stdlib.h>

/* The browse name is the same in every language, and so is the display name, unless set_words()
 * follows. */
static void set_head(const struct db_opcua_nodes *nodes, struct db_opcua_node *node,
                     UA_NodeClass class, UA_QualifiedName name, const char *description)
{
	UA_NodeHead *head = &node->node.head;

	head->nodeClass = class;
	head->browseName = name;
	head->displayName = db_opcua_locales_fill_name(&nodes->locales, node->display_name,
	                                               name.name, NULL, 0);
	if (description[0] != '\0')
		head->description = db_opcua_locales_fill(&nodes->locales, &node->description,
		                                          description, node->described);
}

/* The display name in the words that the page has for this register or command. */
static void set_words(const struct db_opcua_nodes *nodes, struct db_opcua_node *node,
                      const char *key, const char *unit)
{
	(void)db_opcua_locales_fill_name(&nodes->locales, node->display_name,
	                                 node->node.head.browseName.name, key,
	                                 key ? db_words_name_length(key, unit) : 0);
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
	variable->value.dataSource = (UA_DataSource){ .read = db_opcua_node_read,
		                                      .write = writable ? db_opcua_node_write :
		                                                          NULL };
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

static void let_listen(struct db_opcua_node *node, UA_MonitoredItem **listeners)
{
	node->node.objectNode.eventNotifier = UA_EVENTNOTIFIER_SUBSCRIBE_TO_EVENT |
	                                      UA_EVENTNOTIFIER_HISTORY_READ;
	node->listeners = listeners;
}

static void fill_property(const struct db_opcua_nodes *nodes, const struct db_opcua_shown *shown,
                          const struct db_opcua_branch *branch, struct db_opcua_node *node,
                          bool valued)
{
	size_t count = 0;
	bool array;
	const UA_DataType *type = db_opcua_property_type(branch, &array);
	void *values = valued ? db_opcua_property_value(shown->tree, branch, &count) : NULL;

	set_head(nodes, node, UA_NODECLASS_VARIABLE,
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

	set_head(nodes, node, UA_NODECLASS_VARIABLE,
	         db_opcua_member_name(&nodes->roster, branch->name),
	         reg->description[0] ? reg->description : text_of(shown->tree, branch));
	set_words(nodes, node, reg->name, reg->unit);
	set_variable(node, type_of(nodes, reg), false, reg->writable, nodes->config->interval_ms);
	if (!shown->gateway && db_opcua_history_field(reg->name)) {
		node->node.variableNode.historizing = true;
		node->node.variableNode.accessLevel |= UA_ACCESSLEVELMASK_HISTORYREAD;
	}
}

/* A part of what is known of the drive itself; two of them the drive tells. */
static void fill_identification(const struct db_opcua_nodes *nodes, struct db_opcua_node *node,
                                bool valued)
{
	const struct db_opcua_shown *shown = node->subject.shown;
	const struct db_opcua_branch *branch = node->subject.branch;
	int type = branch->type == DB_OPCUA_MODEL ? UA_TYPES_LOCALIZEDTEXT : UA_TYPES_STRING;
	UA_LocalizedText *name = NULL;
	UA_String *text = NULL;

	set_head(nodes, node, UA_NODECLASS_VARIABLE, db_opcua_branch_name(&nodes->roster, branch),
	         text_of(shown->tree, branch));
	if (branch->type == DB_OPCUA_COMPONENT_NAME) {
		name = valued ? malloc(sizeof(*name)) : NULL;
		/* A name is the same in every language. */
		if (name)
			*name = (UA_LocalizedText){ .text = db_opcua_string(shown->name) };
		set_constant(node, &UA_TYPES[UA_TYPES_LOCALIZEDTEXT], false, name, 1);
	} else if (branch->type == DB_OPCUA_LOCATION) {
		text = valued ? malloc(sizeof(*text)) : NULL;
		if (text)
			*text = db_opcua_string(shown->location);
		set_constant(node, &UA_TYPES[UA_TYPES_STRING], false, text, 1);
	} else {
		set_variable(node, UA_TYPES[type].typeId, false, false, DB_OPCUA_FIGURES_INTERVAL);
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
			set_head(nodes, node, UA_NODECLASS_OBJECT,
			         db_opcua_member_name(&nodes->roster, "Gateway"), kind->type->text);
			break;
		}
		set_head(nodes, node, UA_NODECLASS_OBJECT,
		         db_opcua_own_name(&nodes->roster, shown->name), kind->type->text);
		let_listen(node, &shown->listeners);
		break;
	case DB_OPCUA_FOLDER:
	case DB_OPCUA_IDENTIFICATION:
		set_head(nodes, node, UA_NODECLASS_OBJECT, name, text_of(shown->tree, branch));
		break;
	case DB_OPCUA_VARIABLE:
		fill_register(nodes, node);
		break;
	case DB_OPCUA_COLUMN:
		text = text_of(shown->tree, branch);
		set_head(nodes, node, UA_NODECLASS_VARIABLE, name,
		         text[0] ? text : "Of the latest commands, the newest first");
		set_variable(node, type_of(nodes, kind->columns[branch->place].first), true, false,
		             interval_ms);
		break;
	case DB_OPCUA_CLOCK:
		set_head(nodes, node, UA_NODECLASS_VARIABLE, name, text_of(shown->tree, branch));
		set_variable(node, UA_TYPES[UA_TYPES_STRING].typeId, false, true, interval_ms);
		break;
	case DB_OPCUA_CERTIFICATE_ENDS:
		set_head(nodes, node, UA_NODECLASS_VARIABLE, name, text_of(shown->tree, branch));
		set_variable(node, UA_TYPES[UA_TYPES_DATETIME].typeId, false, false,
		             DB_OPCUA_FIGURES_INTERVAL);
		break;
	case DB_OPCUA_METHOD:
		text = json_string_value(
			json_object_get(db_opcua_tree_command(shown->tree, branch), "description"));
		set_head(nodes, node, UA_NODECLASS_METHOD, name,
		         text ? text : text_of(shown->tree, branch));
		set_words(nodes, node,
		          json_string_value(json_object_get(
				  db_opcua_tree_command(shown->tree, branch), "name")),
		          "");
		node->node.methodNode.executable = true;
		node->node.methodNode.method = db_opcua_node_call;
		break;
	case DB_OPCUA_COMPONENT_NAME:
	case DB_OPCUA_LOCATION:
	case DB_OPCUA_MODEL:
	case DB_OPCUA_SOFTWARE_REVISION:
		fill_identification(nodes, node, valued);
		break;
	default:
		fill_property(nodes, shown, branch, node, valued);
	}
}

static void fill_condition(const struct db_opcua_nodes *nodes, struct db_opcua_node *node)
{
	const struct db_opcua_alarm *alarm = node->subject.alarm;
	enum db_opcua_member member = node->subject.member;

	if (member == DB_OPCUA_MEMBERS) {
		set_head(nodes, node, UA_NODECLASS_OBJECT,
		         db_opcua_condition_name(&nodes->roster, alarm), alarm->text);
		return;
	}
	set_head(nodes, node, UA_NODECLASS_VARIABLE,
	         (UA_QualifiedName){ .name = db_opcua_string(db_opcua_members[member].name) }, "");
	set_variable(node, db_opcua_condition_type(member)->typeId, false, false,
	             nodes->config->interval_ms);
	node->node.variableNode.value.dataSource.write = db_opcua_node_drop;
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

	set_head(nodes, node, classes[row->class], db_opcua_row_name(&nodes->roster, row),
	         row->text);
	if (row->class == DB_OPCUA_VARIABLE_ROW) {
		set_type(node, type, row->array, row->writable);
		node->node.variableNode.valueSource = UA_VALUESOURCE_DATA;
	} else if (row->class == DB_OPCUA_METHOD_ROW) {
		node->node.methodNode.method = db_opcua_node_refuse;
	} else if (row->class == DB_OPCUA_NAMES_ROW || row->class == DB_OPCUA_BITS_ROW) {
		/* Each session reads the names in its language. */
		set_variable(node, db_opcua_row_type(row)->typeId, true, false,
		             DB_OPCUA_FIGURES_INTERVAL);
	} else if (row->class >= DB_OPCUA_NAMES_ROW) {
		void *values = valued ? db_opcua_row_value(row, &count) : NULL;

		set_constant(node, db_opcua_row_type(row), true, values, count);
	}
}

void db_opcua_node_fill(struct db_opcua_nodes *nodes, struct db_opcua_node *node, bool valued)
{
	const struct db_opcua_bus *bus = node->subject.bus;
	const struct db_opcua_fact *fact = node->subject.fact;
	const struct db_opcua_type_row *row;

	switch (node->subject.type) {
	case DB_OPCUA_ALL_DRIVES:
		set_head(nodes, node, UA_NODECLASS_OBJECT,
		         db_opcua_member_name(&nodes->roster, "Drives"),
		         "The drives by their names");
		let_listen(node, &nodes->listeners);
		break;
	case DB_OPCUA_ALL_BUSES:
		set_head(nodes, node, UA_NODECLASS_OBJECT,
		         db_opcua_member_name(&nodes->roster, "Buses"),
		         "The lines that they are on");
		break;
	case DB_OPCUA_ALL_ALARMS:
		set_head(nodes, node, UA_NODECLASS_OBJECT,
		         db_opcua_member_name(&nodes->roster, "Alarms"),
		         "The alarms that there have been, as conditions");
		break;
	case DB_OPCUA_CONDITION:
		fill_condition(nodes, node);
		break;
	case DB_OPCUA_BUS:
		set_head(nodes, node, UA_NODECLASS_OBJECT,
		         db_opcua_own_name(&nodes->roster, bus->name),
		         db_opcua_type_of_bus()->text);
		break;
	case DB_OPCUA_FACT:
		row = db_opcua_type_member(db_opcua_type_of_bus(), fact->name);
		set_head(nodes, node, UA_NODECLASS_VARIABLE,
		         db_opcua_member_name(&nodes->roster, fact->name), row ? row->text : "");
		set_variable(node, db_opcua_json_type(fact->value)->typeId, false, false,
		             DB_OPCUA_FIGURES_INTERVAL);
		break;
	case DB_OPCUA_OF_TYPES:
		fill_row(nodes, node, valued);
		break;
	case DB_OPCUA_OF_DRIVE:
	default:
		fill_branch(nodes, node, valued);
	}
}
