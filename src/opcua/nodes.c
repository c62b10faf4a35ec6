/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/nodes.h"
#include "opcua/values.h"

#include "client/log.h"

#include <open62541/server.h>
#include <open62541/types.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ID_MAX 256

/* A command of a drive. */
struct method {
	struct db_opcua_nodes *nodes;
	struct db_opcua_drive *drive;
	const json_t *command;
};

/* A field of the history of a drive. */
struct column {
	struct db_opcua_drive *drive;
	const struct db_opcua_column *column;
};

/* What the service tells of a bus. */
struct fact {
	char bus[64];
	char name[DB_OPCUA_NAME_MAX];
	json_t *value;
	UA_DateTime time;
	struct fact *next;
};

/* A property with a fixed value, which all variables share that have it: one for each would take more memory than all
 * else together. Its id is a number, which takes none in references. */
struct shared {
	char what[ID_MAX];
	UA_UInt32 number;
	struct shared *next;
};

struct shown_drive {
	struct db_opcua_drive *drive;
	struct method *methods;
	struct column *columns;
	struct shown_drive *next;
};

struct db_opcua_nodes {
	UA_Server *server;
	const struct db_opcua_config *config;
	const struct db_opcua_nodes_ops *ops;
	void *context;
	UA_UInt16 space;
	/* The library reads a variable while it adds it, and does not add it when its value is bad. */
	bool adding;
	bool failed; /* since it was cleared last */
	struct shown_drive *drives;
	struct fact *facts;
	struct shared *shared;
	UA_UInt32 last_number; /* of a shared property */
	json_t *buses;         /* their names */
};

static struct db_opcua_nodes *nodes_of(UA_Server *server)
{
	return UA_Server_getConfig(server)->context;
}

/* --- ids -------------------------------------------------------------------------------------- */

struct node_id {
	char text[ID_MAX];
};

static UA_NodeId id_of(const struct db_opcua_nodes *nodes, const struct node_id *id)
{
	return (UA_NodeId){ .namespaceIndex = nodes->space,
		            .identifierType = UA_NODEIDTYPE_STRING,
		            .identifier.string = db_opcua_string(id->text) };
}

/* "feeder.Parameters.spd"; an empty part is left out. Names of drives have no slash: what begins with one is none. */
static struct node_id make_id(const char *drive, const char *group, const char *name)
{
	struct node_id id;

	(void)snprintf(id.text, sizeof(id.text), "%s%s%s%s%s", drive[0] ? drive : "/Gateway",
	               group[0] ? "." : "", group, name[0] ? "." : "", name);
	return id;
}

/* --- reading and writing ---------------------------------------------------------------------- */

static UA_StatusCode read_item(UA_Server *server, const UA_NodeId *session, void *session_context,
                               const UA_NodeId *node, void *node_context,
                               UA_Boolean source_time_wanted, const UA_NumericRange *range,
                               UA_DataValue *value)
{
	struct db_opcua_nodes *nodes = nodes_of(server);
	struct db_opcua_item *item = node_context;

	(void)session;
	(void)session_context;
	(void)node;
	(void)source_time_wanted;
	if (range) {
		value->hasStatus = true;
		value->status = UA_STATUSCODE_BADINDEXRANGENODATA;
		return UA_STATUSCODE_GOOD;
	}
	if (nodes->adding)
		return db_opcua_value_zero(item->reg->type, value);
	nodes->ops->fetch(nodes->context, item);
	return db_opcua_value_read(item, value);
}

static UA_StatusCode write_item(UA_Server *server, const UA_NodeId *session, void *session_context,
                                const UA_NodeId *node, void *node_context,
                                const UA_NumericRange *range, const UA_DataValue *value)
{
	struct db_opcua_nodes *nodes = nodes_of(server);
	struct db_opcua_item *item = node_context;
	UA_StatusCode status;
	json_t *json;

	(void)session_context;
	(void)node;
	if (range)
		return UA_STATUSCODE_BADINDEXRANGEINVALID;
	if (!value->hasValue || (value->hasStatus && value->status != UA_STATUSCODE_GOOD))
		return UA_STATUSCODE_BADWRITENOTSUPPORTED;
	status = db_opcua_value_to_json(&value->value, &json);
	if (status != UA_STATUSCODE_GOOD)
		return status;
	status = nodes->ops->write(nodes->context, session, item, json);
	json_decref(json);
	return status;
}

static UA_StatusCode read_column(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *node, void *node_context,
                                 UA_Boolean source_time_wanted, const UA_NumericRange *range,
                                 UA_DataValue *value)
{
	struct db_opcua_nodes *nodes = nodes_of(server);
	const struct column *column = node_context;

	(void)session;
	(void)session_context;
	(void)node;
	(void)source_time_wanted;
	if (range) {
		value->hasStatus = true;
		value->status = UA_STATUSCODE_BADINDEXRANGENODATA;
		return UA_STATUSCODE_GOOD;
	}
	if (nodes->adding)
		return db_opcua_value_zeros(column->column, value);
	nodes->ops->fetch(nodes->context, &column->drive->items[column->column->places[0]]);
	return db_opcua_value_read_column(column->drive, column->column, value);
}

static UA_StatusCode read_fact(UA_Server *server, const UA_NodeId *session, void *session_context,
                               const UA_NodeId *node, void *node_context,
                               UA_Boolean source_time_wanted, const UA_NumericRange *range,
                               UA_DataValue *value)
{
	const struct fact *fact = node_context;

	(void)server;
	(void)session;
	(void)session_context;
	(void)node;
	(void)source_time_wanted;
	(void)range;
	value->hasSourceTimestamp = true;
	value->sourceTimestamp = fact->time;
	return db_opcua_value_from_json(fact->value, value);
}

static UA_StatusCode call_method(UA_Server *server, const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *method_id, void *method_context,
                                 const UA_NodeId *object, void *object_context, size_t input_count,
                                 const UA_Variant *input, size_t output_count, UA_Variant *output)
{
	const struct method *method = method_context;
	const json_t *names = json_object_get(method->command, "arguments");
	const char *command = json_string_value(json_object_get(method->command, "name"));
	json_t *arguments = json_object();
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	(void)server;
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
	status = method->nodes->ops->run(method->nodes->context, session, method->drive, command,
	                                 arguments);
	if (output_count == 2) {
		UA_String result = db_opcua_string(method->drive->result);
		UA_String reason = db_opcua_string(method->drive->reason);

		(void)UA_Variant_setScalarCopy(&output[0], &result, &UA_TYPES[UA_TYPES_STRING]);
		(void)UA_Variant_setScalarCopy(&output[1], &reason, &UA_TYPES[UA_TYPES_STRING]);
	}
	return status;
}

/* --- adding ----------------------------------------------------------------------------------- */

/* A node that cannot be added is said once; everything else is still there. */
static void check(struct db_opcua_nodes *nodes, UA_StatusCode status, const char *id)
{
	if (status == UA_STATUSCODE_GOOD)
		return;
	if (!nodes->failed)
		db_client_log(DB_CLIENT_ERROR, "node %s cannot be added: %s", id,
		              UA_StatusCode_name(status));
	nodes->failed = true;
}

/* Names are the same in every language. */
static UA_LocalizedText shown_as(const char *name)
{
	return (UA_LocalizedText){ .text = db_opcua_string(name) };
}

static UA_QualifiedName browse_name(const struct db_opcua_nodes *nodes, const char *name)
{
	return (UA_QualifiedName){ .namespaceIndex = nodes->space, .name = db_opcua_string(name) };
}

static void add_object(struct db_opcua_nodes *nodes, const struct node_id *id, UA_NodeId parent,
                       const char *name, const char *description, UA_UInt32 type, bool notifies)
{
	UA_ObjectAttributes attributes = UA_ObjectAttributes_default;

	attributes.displayName = shown_as(name);
	attributes.description = db_opcua_english(description);
	attributes.eventNotifier = notifies ? UA_EVENTNOTIFIER_SUBSCRIBE_TO_EVENT : 0;
	check(nodes,
	      UA_Server_addObjectNode(
		      nodes->server, id_of(nodes, id), parent,
		      UA_NODEID_NUMERIC(0, type == UA_NS0ID_FOLDERTYPE ? UA_NS0ID_ORGANIZES :
	                                                                 UA_NS0ID_HASCOMPONENT),
		      browse_name(nodes, name), UA_NODEID_NUMERIC(0, type), attributes, NULL, NULL),
	      id->text);
}

static void add_variable(struct db_opcua_nodes *nodes, const struct node_id *id,
                         const struct node_id *parent, const char *name, UA_UInt32 type,
                         const UA_VariableAttributes *given, UA_DataSource source, void *context)
{
	UA_VariableAttributes attributes = *given;

	attributes.displayName = shown_as(name);
	nodes->adding = true;
	check(nodes,
	      UA_Server_addDataSourceVariableNode(
		      nodes->server, id_of(nodes, id), id_of(nodes, parent),
		      UA_NODEID_NUMERIC(0, UA_NS0ID_HASCOMPONENT), browse_name(nodes, name),
		      UA_NODEID_NUMERIC(0, type), attributes, source, context, NULL),
	      id->text);
	nodes->adding = false;
}

static bool exists(const struct db_opcua_nodes *nodes, const struct node_id *id)
{
	UA_NodeClass class;

	return UA_Server_readNodeClass(nodes->server, id_of(nodes, id), &class) ==
	       UA_STATUSCODE_GOOD;
}

static void share_property(struct db_opcua_nodes *nodes, const struct node_id *owner,
                           const struct node_id *what, const char *name, void *values, size_t count,
                           const UA_DataType *type)
{
	UA_VariableAttributes attributes = UA_VariableAttributes_default;
	struct shared *shared = nodes->shared;
	UA_UInt32 any_length = 0;
	UA_StatusCode status;

	while (shared && strcmp(shared->what, what->text) != 0)
		shared = shared->next;
	if (shared) {
		UA_NodeId property = UA_NODEID_NUMERIC(nodes->space, shared->number);

		check(nodes,
		      UA_Server_addReference(nodes->server, id_of(nodes, owner),
		                             UA_NODEID_NUMERIC(0, UA_NS0ID_HASPROPERTY),
		                             UA_EXPANDEDNODEID_NODEID(property), true),
		      owner->text);
		return;
	}
	shared = calloc(1, sizeof(*shared));
	if (!shared)
		return;
	(void)snprintf(shared->what, sizeof(shared->what), "%s", what->text);
	shared->number = ++nodes->last_number;
	attributes.displayName = shown_as(name);
	attributes.dataType = type->typeId;
	if (count == 0) {
		UA_Variant_setScalar(&attributes.value, values, type);
	} else {
		attributes.valueRank = UA_VALUERANK_ONE_DIMENSION;
		attributes.arrayDimensionsSize = 1;
		attributes.arrayDimensions = &any_length;
		UA_Variant_setArray(&attributes.value, values, count, type);
	}
	status = UA_Server_addVariableNode(
		nodes->server, UA_NODEID_NUMERIC(nodes->space, shared->number), id_of(nodes, owner),
		UA_NODEID_NUMERIC(0, UA_NS0ID_HASPROPERTY),
		(UA_QualifiedName){ .name = db_opcua_string(name) },
		UA_NODEID_NUMERIC(0, UA_NS0ID_PROPERTYTYPE), attributes, NULL, NULL);
	check(nodes, status, what->text);
	if (status != UA_STATUSCODE_GOOD) {
		free(shared);
		return;
	}
	shared->next = nodes->shared;
	nodes->shared = shared;
}

/* The unit in the drive's own words: "user units/s" is mm/s. */
static void name_unit(const char *unit, const char *unit_name, char *name, size_t size)
{
	static const char users[] = "user units";

	if (strncmp(unit, users, sizeof(users) - 1) == 0)
		(void)snprintf(name, size, "%s%s", unit_name[0] ? unit_name : users,
		               unit + sizeof(users) - 1);
	else
		(void)snprintf(name, size, "%s", unit);
}

static void add_unit(struct db_opcua_nodes *nodes, const struct node_id *owner, const char *unit)
{
	UA_EUInformation information = db_opcua_unit(unit);
	struct node_id id;

	(void)snprintf(id.text, sizeof(id.text), "unit %s", unit);
	share_property(nodes, owner, &id, "EngineeringUnits", &information, 0,
	               &UA_TYPES[UA_TYPES_EUINFORMATION]);
}

static void add_range(struct db_opcua_nodes *nodes, const struct node_id *owner, double min,
                      double max)
{
	UA_Range range = { .low = min, .high = max };
	struct node_id id;

	(void)snprintf(id.text, sizeof(id.text), "range %.9g..%.9g", min, max);
	share_property(nodes, owner, &id, "EURange", &range, 0, &UA_TYPES[UA_TYPES_RANGE]);
}

/* Names of values, or of bits. */
static void add_codes(struct db_opcua_nodes *nodes, const struct node_id *owner,
                      const struct db_opcua_register *reg, const struct db_opcua_kind *kind)
{
	size_t count = 0;
	struct node_id id;

	(void)snprintf(id.text, sizeof(id.text), "codes %u %s", kind->number, reg->name);
	if (reg->bits) {
		UA_LocalizedText *names = db_opcua_bit_names(reg->codes, &count);

		if (names)
			share_property(nodes, owner, &id, "OptionSetValues", names, count,
			               &UA_TYPES[UA_TYPES_LOCALIZEDTEXT]);
		free(names);
	} else {
		UA_EnumValueType *values = db_opcua_enum_values(reg->codes, &count);

		if (values)
			share_property(nodes, owner, &id, "EnumValues", values, count,
			               &UA_TYPES[UA_TYPES_ENUMVALUETYPE]);
		free(values);
	}
}

static void add_item(struct db_opcua_nodes *nodes, struct db_opcua_item *item,
                     const char *unit_name)
{
	const struct db_opcua_register *reg = item->reg;
	const char *folder = db_opcua_group_folder(reg->group);
	struct node_id parent = make_id(item->drive->name, folder, "");
	struct node_id id = make_id(item->drive->name, folder, reg->shown);
	UA_VariableAttributes attributes = UA_VariableAttributes_default;
	UA_DataSource source = { .read = read_item, .write = reg->writable ? write_item : NULL };
	char unit[64];

	attributes.description = db_opcua_english(reg->description);
	attributes.dataType = db_opcua_data_type(reg->type)->typeId;
	attributes.accessLevel = UA_ACCESSLEVELMASK_READ;
	if (reg->writable)
		attributes.accessLevel |= UA_ACCESSLEVELMASK_WRITE;
	name_unit(reg->unit, unit_name, unit, sizeof(unit));
	add_variable(nodes, &id, &parent, reg->shown,
	             unit[0] ? UA_NS0ID_BASEANALOGTYPE : UA_NS0ID_BASEDATAVARIABLETYPE, &attributes,
	             source, item);
	if (unit[0])
		add_unit(nodes, &id, unit);
	if (reg->has_range && !reg->codes && !db_opcua_register_is_full(reg))
		add_range(nodes, &id, reg->min, reg->max);
	if (reg->codes)
		add_codes(nodes, &id, reg, item->drive->kind);
}

/* The arguments of a command, as a property that all commands with the same ones share. */
static void add_arguments(struct db_opcua_nodes *nodes, const struct node_id *owner,
                          const struct db_opcua_drive *drive, const json_t *names)
{
	UA_Argument arguments[16];
	struct node_id id;
	size_t used = (size_t)snprintf(id.text, sizeof(id.text), "arguments %u",
	                               drive->kind->number);
	size_t count = 0;
	size_t i;
	const json_t *name;

	json_array_foreach(names, i, name)
	{
		const struct db_opcua_item *item = db_opcua_drive_find(drive,
		                                                       json_string_value(name));

		if (!item || count == sizeof(arguments) / sizeof(arguments[0]))
			continue;
		UA_Argument_init(&arguments[count]);
		arguments[count].name = db_opcua_string(item->reg->shown);
		arguments[count].description = db_opcua_english(item->reg->description);
		arguments[count].dataType = db_opcua_data_type(item->reg->type)->typeId;
		arguments[count].valueRank = UA_VALUERANK_SCALAR;
		count++;
		if (used < sizeof(id.text))
			used += (size_t)snprintf(id.text + used, sizeof(id.text) - used, " %s",
			                         item->reg->name);
	}
	if (count > 0)
		share_property(nodes, owner, &id, "InputArguments", arguments, count,
		               &UA_TYPES[UA_TYPES_ARGUMENT]);
}

static void add_outputs(struct db_opcua_nodes *nodes, const struct node_id *owner)
{
	UA_Argument arguments[2];
	struct node_id id = { .text = "results" };

	UA_Argument_init(&arguments[0]);
	arguments[0].name = db_opcua_string("Result");
	arguments[0].description = db_opcua_english(
		"How it ended: ok, unproven (taken, and its protocol shows no more), pending (it goes on)");
	arguments[0].dataType = UA_TYPES[UA_TYPES_STRING].typeId;
	arguments[0].valueRank = UA_VALUERANK_SCALAR;
	UA_Argument_init(&arguments[1]);
	arguments[1].name = db_opcua_string("Reason");
	arguments[1].description = db_opcua_english(
		"Why it was refused, in words; empty when it was not");
	arguments[1].dataType = UA_TYPES[UA_TYPES_STRING].typeId;
	arguments[1].valueRank = UA_VALUERANK_SCALAR;
	share_property(nodes, owner, &id, "OutputArguments", arguments, 2,
	               &UA_TYPES[UA_TYPES_ARGUMENT]);
}

static void add_method(struct db_opcua_nodes *nodes, struct method *method)
{
	const char *command = json_string_value(json_object_get(method->command, "name"));
	const char *description = json_string_value(
		json_object_get(method->command, "description"));
	struct node_id parent = make_id(method->drive->name, "", "");
	UA_MethodAttributes attributes = UA_MethodAttributes_default;
	char name[DB_OPCUA_NAME_MAX];
	struct node_id id;

	db_opcua_name_of(command, name);
	id = make_id(method->drive->name, "", name);
	attributes.displayName = shown_as(name);
	attributes.description = db_opcua_english(description ? description : "");
	attributes.executable = true;
	attributes.userExecutable = true;
	check(nodes,
	      UA_Server_addMethodNode(nodes->server, id_of(nodes, &id), id_of(nodes, &parent),
	                              UA_NODEID_NUMERIC(0, UA_NS0ID_HASCOMPONENT),
	                              browse_name(nodes, name), attributes, call_method, 0, NULL, 0,
	                              NULL, method, NULL),
	      id.text);
	add_arguments(nodes, &id, method->drive, json_object_get(method->command, "arguments"));
	add_outputs(nodes, &id);
}

static void add_columns(struct db_opcua_nodes *nodes, struct shown_drive *shown)
{
	const struct db_opcua_drive *drive = shown->drive;
	struct node_id parent = make_id(drive->name, "History", "");

	for (size_t i = 0; i < drive->kind->column_count; i++) {
		const struct db_opcua_column *column = &drive->kind->columns[i];
		struct node_id id = make_id(drive->name, "History", column->shown);
		UA_VariableAttributes attributes = UA_VariableAttributes_default;
		UA_DataSource source = { .read = read_column };
		UA_UInt32 any_length = 0;

		shown->columns[i] = (struct column){ .drive = shown->drive, .column = column };
		attributes.description = db_opcua_english(
			"Of the latest commands, the newest first");
		attributes.dataType = db_opcua_data_type(column->first->type)->typeId;
		attributes.valueRank = UA_VALUERANK_ONE_DIMENSION;
		attributes.arrayDimensionsSize = 1;
		attributes.arrayDimensions = &any_length;
		attributes.accessLevel = UA_ACCESSLEVELMASK_READ;
		add_variable(nodes, &id, &parent, column->shown, UA_NS0ID_BASEDATAVARIABLETYPE,
		             &attributes, source, &shown->columns[i]);
	}
}

/* A value that does not change. */
static void add_constant(struct db_opcua_nodes *nodes, const struct node_id *parent,
                         const char *group, const char *drive, const char *name, const char *text)
{
	struct node_id id = make_id(drive, group, name);
	UA_VariableAttributes attributes = UA_VariableAttributes_default;
	UA_String value = db_opcua_string(text);

	attributes.displayName = shown_as(name);
	attributes.dataType = UA_TYPES[UA_TYPES_STRING].typeId;
	attributes.valueRank = UA_VALUERANK_SCALAR;
	UA_Variant_setScalar(&attributes.value, &value, &UA_TYPES[UA_TYPES_STRING]);
	check(nodes,
	      UA_Server_addVariableNode(
		      nodes->server, id_of(nodes, &id), id_of(nodes, parent),
		      UA_NODEID_NUMERIC(0, UA_NS0ID_HASPROPERTY), browse_name(nodes, name),
		      UA_NODEID_NUMERIC(0, UA_NS0ID_PROPERTYTYPE), attributes, NULL, NULL),
	      id.text);
}

static void add_identification(struct db_opcua_nodes *nodes, const struct db_opcua_drive *drive,
                               const json_t *description)
{
	struct node_id parent = make_id(drive->name, "Identification", "");
	struct node_id root = make_id(drive->name, "", "");
	char place[160];

	add_object(nodes, &parent, id_of(nodes, &root), "Identification",
	           "What is known of the drive itself, in the names of OPC UA for Machinery",
	           UA_NS0ID_FOLDERTYPE, false);
	(void)snprintf(place, sizeof(place), "%s/%lld%s%s", drive->bus,
	               (long long)json_integer_value(json_object_get(description, "address")),
	               json_string_length(json_object_get(description, "axis")) ? "/" : "",
	               json_string_length(json_object_get(description, "axis")) ?
	                       json_string_value(json_object_get(description, "axis")) :
	                       "");
	add_constant(nodes, &parent, "Identification", drive->name, "ComponentName", drive->name);
	add_constant(nodes, &parent, "Identification", drive->name, "Location", place);
}

static bool has_group(const struct db_opcua_kind *kind, enum db_opcua_group group)
{
	for (size_t i = 0; i < kind->count; i++) {
		if (kind->list[i].group == group)
			return true;
	}
	return false;
}

/* Buses have nodes of their own, with their names. */
static bool is_of_bus(const char *name)
{
	return ((strncmp(name, "bus", 3) == 0 && name[3] >= '0' && name[3] <= '9') ||
	        (strncmp(name, "line", 4) == 0 && name[4] >= '0' && name[4] <= '9'));
}

void db_opcua_nodes_add(struct db_opcua_nodes *nodes, struct db_opcua_drive *drive,
                        const json_t *description)
{
	const char *unit_name = json_string_value(json_object_get(description, "unit_name"));
	size_t commands = json_array_size(drive->kind->commands);
	struct shown_drive *shown = calloc(1, sizeof(*shown));
	struct node_id folder = { .text = "/Drives" };
	struct node_id root = make_id(drive->name, "", "");
	bool gateway = drive->name[0] == '\0';

	if (shown) {
		shown->drive = drive;
		shown->methods = calloc(commands + 1, sizeof(*shown->methods));
		shown->columns = calloc(drive->kind->column_count + 1, sizeof(*shown->columns));
	}
	if (!shown || !shown->methods || !shown->columns) {
		db_client_log(DB_CLIENT_ERROR, "drive %s: out of memory", drive->name);
		if (shown) {
			free(shown->methods);
			free(shown->columns);
		}
		free(shown);
		return;
	}
	shown->next = nodes->drives;
	nodes->drives = shown;
	nodes->failed = false;
	if (gateway)
		add_object(nodes, &root, UA_NODEID_NUMERIC(0, UA_NS0ID_OBJECTSFOLDER), "Gateway",
		           "The service itself and its clients", UA_NS0ID_BASEOBJECTTYPE, false);
	else
		add_object(nodes, &root, id_of(nodes, &folder), drive->name, "",
		           UA_NS0ID_BASEOBJECTTYPE, true);
	for (int group = DB_OPCUA_COMMAND; group < DB_OPCUA_GROUPS; group++) {
		const char *name = db_opcua_group_folder((enum db_opcua_group)group);
		struct node_id id = make_id(drive->name, name, "");

		if (db_opcua_config_shows(nodes->config, (enum db_opcua_group)group) &&
		    has_group(drive->kind, (enum db_opcua_group)group))
			add_object(nodes, &id, id_of(nodes, &root), name, "", UA_NS0ID_FOLDERTYPE,
			           false);
	}
	for (size_t i = 0; i < drive->kind->count; i++) {
		if (db_opcua_config_shows(nodes->config, drive->kind->list[i].group) &&
		    drive->kind->list[i].group != DB_OPCUA_HISTORY &&
		    !(gateway && is_of_bus(drive->kind->list[i].name)))
			add_item(nodes, &drive->items[i], unit_name ? unit_name : "");
	}
	if (db_opcua_config_shows(nodes->config, DB_OPCUA_HISTORY))
		add_columns(nodes, shown);
	for (size_t i = 0; i < commands; i++) {
		shown->methods[i] = (struct method){
			.nodes = nodes,
			.drive = drive,
			.command = json_array_get(drive->kind->commands, i),
		};
		add_method(nodes, &shown->methods[i]);
	}
	if (!gateway) {
		add_identification(nodes, drive, description);
		/* Not from the folder: who browses that would see each drive twice. */
		(void)UA_Server_addReference(nodes->server, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER),
		                             UA_NODEID_NUMERIC(0, UA_NS0ID_HASNOTIFIER),
		                             UA_EXPANDEDNODEID_NODEID(id_of(nodes, &root)), true);
	}
}

static void forget_shared(struct db_opcua_nodes *nodes)
{
	struct shared **at = &nodes->shared;

	while (*at) {
		struct shared *shared = *at;
		UA_NodeId id = UA_NODEID_NUMERIC(nodes->space, shared->number);
		UA_NodeClass class;

		if (UA_Server_readNodeClass(nodes->server, id, &class) == UA_STATUSCODE_GOOD) {
			at = &shared->next;
		} else {
			*at = shared->next;
			free(shared);
		}
	}
}

void db_opcua_nodes_remove(struct db_opcua_nodes *nodes, const struct db_opcua_drive *drive)
{
	struct node_id root = make_id(drive->name, "", "");
	struct shown_drive **at = &nodes->drives;
	struct shown_drive *shown;

	while (*at && (*at)->drive != drive)
		at = &(*at)->next;
	shown = *at;
	if (!shown)
		return;
	*at = shown->next;
	/* What hangs below goes with it; of what is shared that which nobody has any more. */
	(void)UA_Server_deleteNode(nodes->server, id_of(nodes, &root), true);
	forget_shared(nodes);
	free(shown->methods);
	free(shown->columns);
	free(shown);
}

/* --- buses ------------------------------------------------------------------------------------ */

static struct fact *find_fact(const struct db_opcua_nodes *nodes, const char *bus, const char *name)
{
	for (struct fact *fact = nodes->facts; fact; fact = fact->next) {
		if (strcmp(fact->bus, bus) == 0 && strcmp(fact->name, name) == 0)
			return fact;
	}
	return NULL;
}

static struct node_id bus_id(const char *bus, const char *name)
{
	struct node_id id;

	(void)snprintf(id.text, sizeof(id.text), "/Buses.%s%s%s", bus, name[0] ? "." : "", name);
	return id;
}

static void set_fact(struct db_opcua_nodes *nodes, const char *bus, const char *name, json_t *value)
{
	struct fact *fact = find_fact(nodes, bus, name);
	struct node_id parent = bus_id(bus, "");
	UA_VariableAttributes attributes = UA_VariableAttributes_default;
	UA_DataSource source = { .read = read_fact };
	const UA_DataType *type = db_opcua_json_type(value);
	struct node_id id;

	if (!type || (!fact && !exists(nodes, &parent)))
		return;
	if (fact) {
		json_decref(fact->value);
		fact->value = json_incref(value);
		fact->time = UA_DateTime_now();
		return;
	}
	fact = calloc(1, sizeof(*fact));
	if (!fact)
		return;
	(void)snprintf(fact->bus, sizeof(fact->bus), "%s", bus);
	(void)snprintf(fact->name, sizeof(fact->name), "%s", name);
	fact->value = json_incref(value);
	fact->time = UA_DateTime_now();
	fact->next = nodes->facts;
	nodes->facts = fact;
	id = bus_id(bus, name);
	attributes.dataType = type->typeId;
	attributes.accessLevel = UA_ACCESSLEVELMASK_READ;
	add_variable(nodes, &id, &parent, name, UA_NS0ID_BASEDATAVARIABLETYPE, &attributes, source,
	             fact);
}

static void forget_facts(struct db_opcua_nodes *nodes)
{
	while (nodes->facts) {
		struct fact *fact = nodes->facts;

		nodes->facts = fact->next;
		json_decref(fact->value);
		free(fact);
	}
}

static json_t *names_of(const json_t *buses)
{
	json_t *names = json_array();
	size_t i;
	const json_t *bus;

	json_array_foreach(buses, i, bus)(void)
		json_array_append(names, json_object_get(bus, "name"));
	return names;
}

void db_opcua_nodes_set_buses(struct db_opcua_nodes *nodes, json_t *buses)
{
	json_t *names = names_of(buses);
	struct node_id folder = { .text = "/Buses" };
	size_t i;
	json_t *bus;

	if (!nodes->buses || !json_equal(nodes->buses, names)) {
		json_array_foreach(nodes->buses, i, bus)
		{
			struct node_id id = bus_id(json_string_value(bus), "");

			(void)UA_Server_deleteNode(nodes->server, id_of(nodes, &id), true);
		}
		forget_facts(nodes);
		json_array_foreach(names, i, bus)
		{
			struct node_id id = bus_id(json_string_value(bus), "");

			add_object(nodes, &id, id_of(nodes, &folder), json_string_value(bus), "",
			           UA_NS0ID_BASEOBJECTTYPE, false);
		}
		json_decref(nodes->buses);
		nodes->buses = json_incref(names);
	}
	json_decref(names);
	json_array_foreach(buses, i, bus)
	{
		const char *key;
		json_t *value;

		json_object_foreach(bus, key, value)
		{
			char name[DB_OPCUA_NAME_MAX];

			db_opcua_name_of(key, name);
			set_fact(nodes, json_string_value(json_object_get(bus, "name")), name,
			         value);
		}
	}
}

void db_opcua_nodes_set_figures(struct db_opcua_nodes *nodes, json_t *buses)
{
	const char *bus;
	json_t *figures;

	json_object_foreach(buses, bus, figures)
	{
		const char *key;
		json_t *value;

		json_object_foreach(figures, key, value)
		{
			char name[DB_OPCUA_NAME_MAX];

			db_opcua_name_of(key, name);
			/* Describe says it as well, as a boolean. */
			if (strcmp(key, "up") != 0)
				set_fact(nodes, bus, name, value);
		}
	}
}

/* --- the whole -------------------------------------------------------------------------------- */

struct db_opcua_nodes *db_opcua_nodes_new(UA_Server *server, const struct db_opcua_config *config,
                                          const struct db_opcua_nodes_ops *ops, void *context)
{
	struct db_opcua_nodes *nodes = calloc(1, sizeof(*nodes));
	struct node_id drives = { .text = "/Drives" };
	struct node_id buses = { .text = "/Buses" };
	UA_NodeId objects = UA_NODEID_NUMERIC(0, UA_NS0ID_OBJECTSFOLDER);

	if (!nodes)
		return NULL;
	nodes->server = server;
	nodes->config = config;
	nodes->ops = ops;
	nodes->context = context;
	nodes->space = UA_Server_addNamespace(server, DB_OPCUA_NAMESPACE);
	UA_Server_getConfig(server)->context = nodes;
	add_object(nodes, &drives, objects, "Drives", "The drives by their names",
	           UA_NS0ID_FOLDERTYPE, true);
	add_object(nodes, &buses, objects, "Buses", "The lines that they are on",
	           UA_NS0ID_FOLDERTYPE, false);
	(void)UA_Server_addReference(server, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER),
	                             UA_NODEID_NUMERIC(0, UA_NS0ID_HASNOTIFIER),
	                             UA_EXPANDEDNODEID_NODEID(id_of(nodes, &drives)), true);
	if (nodes->failed) {
		db_opcua_nodes_free(nodes);
		return NULL;
	}
	return nodes;
}

void db_opcua_nodes_free(struct db_opcua_nodes *nodes)
{
	if (!nodes)
		return;
	while (nodes->drives) {
		struct shown_drive *shown = nodes->drives;

		nodes->drives = shown->next;
		free(shown->methods);
		free(shown->columns);
		free(shown);
	}
	forget_facts(nodes);
	while (nodes->shared) {
		struct shared *shared = nodes->shared;

		nodes->shared = shared->next;
		free(shared);
	}
	json_decref(nodes->buses);
	free(nodes);
}

UA_NodeId db_opcua_nodes_of_drive(const struct db_opcua_nodes *nodes, const char *drive)
{
	struct node_id id = make_id(drive, "", "");
	struct node_id folder = { .text = "/Drives" };
	UA_NodeId found;
	UA_NodeId copy;

	for (const struct shown_drive *shown = nodes->drives; shown; shown = shown->next) {
		if (drive[0] != '\0' && strcmp(shown->drive->name, drive) == 0)
			folder = id;
	}
	found = id_of(nodes, &folder);
	if (UA_NodeId_copy(&found, &copy) != UA_STATUSCODE_GOOD)
		return UA_NODEID_NULL;
	return copy;
}

void db_opcua_nodes_watch(struct db_opcua_nodes *nodes, const UA_NodeId *node, void *node_context,
                          bool removed)
{
	struct db_opcua_item *item = node_context;

	if (node->namespaceIndex != nodes->space || !item)
		return;
	/* Other nodes have other contexts. */
	for (const struct shown_drive *shown = nodes->drives; shown; shown = shown->next) {
		if (item < shown->drive->items ||
		    item >= shown->drive->items + shown->drive->kind->count)
			continue;
		if (!removed)
			item->reg->watchers++;
		else if (item->reg->watchers > 0)
			item->reg->watchers--;
		nodes->ops->rewatch(nodes->context);
		return;
	}
}
