/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/nodes.h"
#include "opcua/conditions.h"
#include "opcua/devices.h"
#include "opcua/enumerations.h"
#include "opcua/events.h"
#include "opcua/node_fill.h"
#include "opcua/nodes_private.h"
#include "opcua/references.h"
#include "opcua/values.h"

#include "client/clock.h"
#include "client/log.h"
#include "words/value.h"

#include <open62541/server.h>
#include <stdlib.h>
#include <string.h>

/* Of a node that has other children than before. */
#define CHILDREN_CHANGED                                  \
	(UA_MODELCHANGESTRUCTUREVERBMASK_REFERENCEADDED | \
	 UA_MODELCHANGESTRUCTUREVERBMASK_REFERENCEDELETED)

/* --- ids -------------------------------------------------------------------------------------- */

static bool identify(void *context, UA_UInt16 space, UA_String id, struct db_opcua_subject *subject)
{
	const struct db_opcua_nodes *nodes = context;
	const struct db_opcua_type_row *row;

	if (id.length == 0)
		return false;
	if (space == nodes->roster.types) {
		row = db_opcua_type_find((const char *)id.data, id.length);
		*subject = (struct db_opcua_subject){ .type = DB_OPCUA_OF_TYPES, .row = row };
		/* The types of events are in the library's own store. */
		return row && row->class != DB_OPCUA_EVENT_TYPE_ROW;
	}
	return db_opcua_roster_identify(&nodes->roster, (const char *)id.data, id.length, subject);
}

/* --- rights ---------------------------------------------------------------------------------- */

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
		need.name = json_string_value(json_object_get(
			db_opcua_tree_command(subject->shown->tree, branch), "name"));
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

/* --- for the store ---------------------------------------------------------------------------- */

static void fill_node(void *context, struct db_opcua_node *node, bool valued)
{
	db_opcua_node_fill(context, node, valued);
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
	const char *drive = db_words_text(event, "drive");
	bool there = db_opcua_roster_find(&nodes->roster, drive, strlen(drive)) != NULL;
	struct db_opcua_id id = db_opcua_id_of(there ? drive : DB_OPCUA_DRIVES, "");

	db_opcua_events_tell(nodes->server, &nodes->locales, event,
	                     db_opcua_node_id(&nodes->roster, &id));
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
	db_opcua_locales_open(&nodes->locales, db_words_folder(getenv));
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
	free(nodes->conditions);
	db_opcua_roster_clear(&nodes->roster);
	db_opcua_store_free(nodes->store);
	db_opcua_locales_close(&nodes->locales);
	free(nodes->enumerations);
	forget_changes(nodes);
	free(nodes);
}

UA_Nodestore db_opcua_nodes_store(struct db_opcua_nodes *nodes)
{
	return db_opcua_store_give(nodes->store);
}

/* Folders and types below nodes of the standard, which have the other ends of the references. */
static UA_StatusCode link_to_standard(struct db_opcua_nodes *nodes)
{
	static const struct {
		UA_UInt32 above;
		UA_Byte tie;
		const char *id;
		const char *name;
	} folders[] = {
		{ UA_NS0ID_OBJECTSFOLDER, UA_REFERENCETYPEINDEX_ORGANIZES, DB_OPCUA_DRIVES,
		  "Drives" },
		{ UA_NS0ID_SERVER, UA_REFERENCETYPEINDEX_HASNOTIFIER, DB_OPCUA_DRIVES, "Drives" },
		{ UA_NS0ID_OBJECTSFOLDER, UA_REFERENCETYPEINDEX_ORGANIZES, DB_OPCUA_BUSES,
		  "Buses" },
		{ UA_NS0ID_OBJECTSFOLDER, UA_REFERENCETYPEINDEX_ORGANIZES, DB_OPCUA_ALARMS,
		  "Alarms" },
	};
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	for (size_t i = 0; i < sizeof(folders) / sizeof(folders[0]) && status == UA_STATUSCODE_GOOD;
	     i++) {
		struct db_opcua_id id = db_opcua_id_of(folders[i].id, "");

		status = db_opcua_store_link(nodes->store, UA_NODEID_NUMERIC(0, folders[i].above),
		                             folders[i].tie, db_opcua_node_id(&nodes->roster, &id),
		                             db_opcua_member_name(&nodes->roster, folders[i].name),
		                             true);
	}
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
		status = db_opcua_locales_tell(&nodes->locales, server);
	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_writeEventNotifier(server, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER),
		                                      UA_EVENTNOTIFIER_SUBSCRIBE_TO_EVENT |
		                                              UA_EVENTNOTIFIER_HISTORY_READ);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_conditions_begin(nodes->conditions, server);
	if (status == UA_STATUSCODE_GOOD)
		status = link_to_standard(nodes);
	return status;
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
