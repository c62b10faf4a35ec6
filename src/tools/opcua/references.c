/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/references.h"
#include "opcua/devices.h"
#include "opcua/values.h"

#include <stdio.h>
#include <string.h>

struct db_opcua_id db_opcua_id_of(const char *owner, const char *part)
{
	struct db_opcua_id id;

	snprintf(id.text, sizeof(id.text), "%s%s%s", owner, part[0] ? "." : "", part);
	return id;
}

UA_NodeId db_opcua_node_id(const struct db_opcua_roster *roster, const struct db_opcua_id *id)
{
	return (UA_NodeId){ .namespaceIndex = roster->space,
		            .identifierType = UA_NODEIDTYPE_STRING,
		            .identifier.string = db_opcua_string(id->text) };
}

UA_NodeId db_opcua_type_id(const struct db_opcua_roster *roster,
                           const struct db_opcua_type_row *row)
{
	return (UA_NodeId){ .namespaceIndex = roster->types,
		            .identifierType = UA_NODEIDTYPE_STRING,
		            .identifier.string = db_opcua_string(row->id) };
}

UA_QualifiedName db_opcua_own_name(const struct db_opcua_roster *roster, const char *name)
{
	return (UA_QualifiedName){ .namespaceIndex = roster->space, .name = db_opcua_string(name) };
}

UA_QualifiedName db_opcua_member_name(const struct db_opcua_roster *roster, const char *name)
{
	return (UA_QualifiedName){ .namespaceIndex = roster->types, .name = db_opcua_string(name) };
}

UA_QualifiedName db_opcua_row_name(const struct db_opcua_roster *roster,
                                   const struct db_opcua_type_row *row)
{
	UA_QualifiedName name = db_opcua_member_name(roster, db_opcua_type_name(row));

	if (row->class >= DB_OPCUA_NAMES_ROW)
		name.namespaceIndex = 0;
	else if (row->devices_name)
		name.namespaceIndex = roster->devices;
	return name;
}

UA_QualifiedName db_opcua_branch_name(const struct db_opcua_roster *roster,
                                      const struct db_opcua_branch *branch)
{
	UA_QualifiedName name = db_opcua_member_name(roster, branch->name);

	switch (branch->type) {
	case DB_OPCUA_IDENTIFICATION:
	case DB_OPCUA_COMPONENT_NAME:
	case DB_OPCUA_MODEL:
	case DB_OPCUA_SOFTWARE_REVISION:
		name.namespaceIndex = roster->devices;
		break;
	case DB_OPCUA_UNIT:
	case DB_OPCUA_RANGE:
	case DB_OPCUA_INPUTS:
	case DB_OPCUA_OUTPUTS:
		name.namespaceIndex = 0;
		break;
	default:
		break;
	}
	return name;
}

/* The type of the reference from the node above to a branch. */
static UA_Byte tie_of(enum db_opcua_branch_type type)
{
	return type < DB_OPCUA_COMPONENT_NAME ? UA_REFERENCETYPEINDEX_HASCOMPONENT :
	                                        UA_REFERENCETYPEINDEX_HASPROPERTY;
}

static UA_UInt32 type_of(const struct db_opcua_tree *tree, const struct db_opcua_branch *branch)
{
	switch (branch->type) {
	case DB_OPCUA_FOLDER:
		return UA_NS0ID_FOLDERTYPE;
	case DB_OPCUA_VARIABLE:
		return tree->kind->list[branch->place].unit[0] ? UA_NS0ID_BASEANALOGTYPE :
		                                                 UA_NS0ID_BASEDATAVARIABLETYPE;
	case DB_OPCUA_COLUMN:
	case DB_OPCUA_CLOCK:
	case DB_OPCUA_CERTIFICATE_ENDS:
		return UA_NS0ID_BASEDATAVARIABLETYPE;
	default:
		return UA_NS0ID_PROPERTYTYPE;
	}
}

static void refer_to_standard(struct db_opcua_references *references, UA_Byte type, bool inverse,
                              UA_UInt32 target, const char *name)
{
	db_opcua_store_refer(references, type, inverse, UA_NODEID_NUMERIC(0, target),
	                     (UA_QualifiedName){ .name = db_opcua_string(name) });
}

static void refer_to(const struct db_opcua_roster *roster, struct db_opcua_references *references,
                     UA_Byte type, bool inverse, const char *owner, const char *part,
                     UA_QualifiedName name)
{
	struct db_opcua_id id;

	/* Mostly only the type is asked for. */
	if (!db_opcua_store_wants(references, type, inverse))
		return;
	id = db_opcua_id_of(owner, part);
	db_opcua_store_refer(references, type, inverse, db_opcua_node_id(roster, &id), name);
}

static void refer_to_type(struct db_opcua_references *references, UA_UInt32 type)
{
	/* By its id alone: nobody searches a type by its name from an instance. */
	refer_to_standard(references, UA_REFERENCETYPEINDEX_HASTYPEDEFINITION, false, type, "");
}

static void refer_to_devices(const struct db_opcua_roster *roster,
                             struct db_opcua_references *references, UA_Byte type, bool inverse,
                             UA_UInt32 target)
{
	db_opcua_store_refer(references, type, inverse, UA_NODEID_NUMERIC(roster->devices, target),
	                     (UA_QualifiedName){ .namespaceIndex = roster->devices });
}

/* What is known of a drive are parts of these interfaces. */
static void refer_to_nameplates(const struct db_opcua_roster *roster,
                                struct db_opcua_references *references, bool vendor)
{
	if (roster->has_interface == 0)
		return;
	refer_to_devices(roster, references, roster->has_interface, false, DB_OPCUA_TAG_NAMEPLATE);
	if (vendor)
		refer_to_devices(roster, references, roster->has_interface, false,
		                 DB_OPCUA_VENDOR_NAMEPLATE);
}

/* --- conditions ------------------------------------------------------------------------------- */

UA_QualifiedName db_opcua_condition_name(const struct db_opcua_roster *roster,
                                         const struct db_opcua_alarm *alarm)
{
	/* Its id begins with that of the folder. */
	return db_opcua_own_name(roster, alarm->id + sizeof(DB_OPCUA_ALARMS));
}

/* From what an alarm is about to its condition. */
static void refer_to_conditions(const struct db_opcua_roster *roster,
                                struct db_opcua_references *references, const char *kind,
                                const char *name)
{
	if (roster->has_condition == 0 ||
	    !db_opcua_store_wants(references, roster->has_condition, false))
		return;
	for (const struct db_opcua_alarm *alarm = roster->alarms.list; alarm; alarm = alarm->next) {
		if (strcmp(alarm->kind, kind) == 0 && strcmp(alarm->name, name) == 0)
			refer_to(roster, references, roster->has_condition, false, alarm->id, "",
			         db_opcua_condition_name(roster, alarm));
	}
}

/* ... and back. */
static void refer_to_source(const struct db_opcua_roster *roster,
                            struct db_opcua_references *references,
                            const struct db_opcua_alarm *alarm)
{
	if (roster->has_condition == 0)
		return;
	if (strcmp(alarm->kind, "drive") == 0) {
		if (db_opcua_roster_find(roster, alarm->name, strlen(alarm->name)))
			refer_to(roster, references, roster->has_condition, true, alarm->name, "",
			         db_opcua_own_name(roster, alarm->name));
	} else if (strcmp(alarm->kind, "bus") == 0) {
		refer_to(roster, references, roster->has_condition, true, DB_OPCUA_BUSES,
		         alarm->name, db_opcua_own_name(roster, alarm->name));
	} else {
		refer_to(roster, references, roster->has_condition, true, DB_OPCUA_GATEWAY, "",
		         db_opcua_member_name(roster, "Gateway"));
	}
}

static UA_UInt32 type_of_member(enum db_opcua_member member)
{
	switch (member) {
	case DB_OPCUA_MEMBER_ENABLED:
	case DB_OPCUA_MEMBER_ACKED:
	case DB_OPCUA_MEMBER_ACTIVE:
		return UA_NS0ID_TWOSTATEVARIABLETYPE;
	case DB_OPCUA_MEMBER_QUALITY:
	case DB_OPCUA_MEMBER_LAST_SEVERITY:
	case DB_OPCUA_MEMBER_COMMENT:
		return UA_NS0ID_CONDITIONVARIABLETYPE;
	default:
		return UA_NS0ID_PROPERTYTYPE;
	}
}

static bool is_property(enum db_opcua_member member)
{
	return type_of_member(member) == UA_NS0ID_PROPERTYTYPE;
}

/* Members of a condition, or of one of its variables: one kind after the other. */
static void refer_to_members(const struct db_opcua_roster *roster,
                             struct db_opcua_references *references,
                             const struct db_opcua_alarm *alarm, enum db_opcua_member above,
                             bool properties)
{
	UA_Byte tie = properties ? UA_REFERENCETYPEINDEX_HASPROPERTY :
	                           UA_REFERENCETYPEINDEX_HASCOMPONENT;

	for (size_t i = 0; i < DB_OPCUA_MEMBERS; i++) {
		const struct db_opcua_member_row *row = &db_opcua_members[i];

		if (row->above == above && is_property((enum db_opcua_member)i) == properties)
			refer_to(roster, references, tie, false, alarm->id, row->path,
			         (UA_QualifiedName){ .name = db_opcua_string(row->name) });
	}
}

static void refer_of_condition(const struct db_opcua_roster *roster,
                               const struct db_opcua_subject *subject,
                               struct db_opcua_references *references)
{
	/* Its methods are those of its types: a client calls them by their ids. */
	static const struct {
		UA_UInt32 id;
		const char *name;
	} methods[] = {
		{ UA_NS0ID_ACKNOWLEDGEABLECONDITIONTYPE_ACKNOWLEDGE, "Acknowledge" },
		{ UA_NS0ID_CONDITIONTYPE_ENABLE, "Enable" },
		{ UA_NS0ID_CONDITIONTYPE_DISABLE, "Disable" },
		{ UA_NS0ID_CONDITIONTYPE_ADDCOMMENT, "AddComment" },
	};
	const struct db_opcua_alarm *alarm = subject->alarm;
	const struct db_opcua_member_row *row;

	if (subject->member == DB_OPCUA_MEMBERS) {
		refer_to_type(references, UA_NS0ID_DISCRETEALARMTYPE);
		refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT, true,
		         DB_OPCUA_ALARMS, "", db_opcua_member_name(roster, "Alarms"));
		refer_to_source(roster, references, alarm);
		for (size_t i = 0; i < sizeof(methods) / sizeof(methods[0]); i++)
			refer_to_standard(references, UA_REFERENCETYPEINDEX_HASCOMPONENT, false,
			                  methods[i].id, methods[i].name);
	} else {
		row = &db_opcua_members[subject->member];
		refer_to_type(references, type_of_member(subject->member));
		refer_to(roster, references,
		         is_property(subject->member) ? UA_REFERENCETYPEINDEX_HASPROPERTY :
		                                        UA_REFERENCETYPEINDEX_HASCOMPONENT,
		         true, alarm->id,
		         row->above == DB_OPCUA_MEMBERS ? "" : db_opcua_members[row->above].path,
		         row->above == DB_OPCUA_MEMBERS ?
		                 db_opcua_condition_name(roster, alarm) :
		                 (UA_QualifiedName){ .name = db_opcua_string(
							     db_opcua_members[row->above].name) });
	}
	refer_to_members(roster, references, alarm, subject->member, false);
	refer_to_members(roster, references, alarm, subject->member, true);
}

/* --- drives ----------------------------------------------------------------------------------- */

static void refer_of_branch(const struct db_opcua_roster *roster,
                            const struct db_opcua_shown *shown,
                            const struct db_opcua_branch *branch,
                            struct db_opcua_references *references)
{
	const struct db_opcua_tree *tree = shown->tree;
	const struct db_opcua_branch *parent = &tree->list[branch->parent];
	bool gateway = shown->gateway;

	if (branch->type == DB_OPCUA_ROOT)
		db_opcua_store_refer(references, UA_REFERENCETYPEINDEX_HASTYPEDEFINITION, false,
		                     db_opcua_type_id(roster, tree->kind->type),
		                     db_opcua_member_name(roster, ""));
	else if (branch->type == DB_OPCUA_IDENTIFICATION)
		refer_to_devices(roster, references, UA_REFERENCETYPEINDEX_HASTYPEDEFINITION, false,
		                 DB_OPCUA_FUNCTIONAL_GROUP_TYPE);
	else if (branch->type != DB_OPCUA_METHOD)
		refer_to_type(references, type_of(tree, branch));
	if (branch->type != DB_OPCUA_ROOT) {
		refer_to(roster, references, tie_of(branch->type), true, shown->name, parent->path,
		         parent->name[0] ? db_opcua_branch_name(roster, parent) :
		                           db_opcua_own_name(roster, shown->name));
	} else if (gateway) {
		refer_to_standard(references, UA_REFERENCETYPEINDEX_HASCOMPONENT, true,
		                  UA_NS0ID_OBJECTSFOLDER, "Objects");
	} else {
		refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT, true,
		         DB_OPCUA_DRIVES, "", db_opcua_member_name(roster, "Drives"));
		refer_to_standard(references, UA_REFERENCETYPEINDEX_HASNOTIFIER, true,
		                  UA_NS0ID_SERVER, "Server");
	}
	for (size_t i = branch->first; i < branch->first + branch->count; i++) {
		const struct db_opcua_branch *child = &tree->list[i];

		refer_to(roster, references, tie_of(child->type), false, shown->name, child->path,
		         db_opcua_branch_name(roster, child));
	}
	if (branch->type == DB_OPCUA_IDENTIFICATION)
		refer_to_nameplates(roster, references, db_opcua_type_has_vendor(tree->kind->type));
	if (branch->type == DB_OPCUA_ROOT)
		refer_to_conditions(roster, references, gateway ? "configuration" : "drive",
		                    gateway ? "" : shown->name);
}

/* --- types ------------------------------------------------------------------------------------ */

static bool is_type(const struct db_opcua_type_row *row)
{
	return row->class <= DB_OPCUA_DATA_TYPE_ROW;
}

/* The type of the reference to a row from the one above it. */
static UA_Byte tie_of_row(const struct db_opcua_type_row *row)
{
	if (is_type(row))
		return UA_REFERENCETYPEINDEX_HASSUBTYPE;
	return row->standard == UA_NS0ID_PROPERTYTYPE ? UA_REFERENCETYPEINDEX_HASPROPERTY :
	                                                UA_REFERENCETYPEINDEX_HASCOMPONENT;
}

static void refer_of_row(const struct db_opcua_roster *roster, const struct db_opcua_type_row *row,
                         struct db_opcua_references *references)
{
	static const UA_Byte ties[] = { UA_REFERENCETYPEINDEX_HASSUBTYPE,
		                        UA_REFERENCETYPEINDEX_HASCOMPONENT,
		                        UA_REFERENCETYPEINDEX_HASPROPERTY };
	if (row->above >= 0) {
		const struct db_opcua_type_row *above = &db_opcua_type_rows[row->above];

		db_opcua_store_refer(references, tie_of_row(row), true,
		                     db_opcua_type_id(roster, above),
		                     db_opcua_row_name(roster, above));
	} else if (row->devices_type) {
		refer_to_devices(roster, references, UA_REFERENCETYPEINDEX_HASSUBTYPE, true,
		                 row->standard);
	} else {
		refer_to_standard(references, UA_REFERENCETYPEINDEX_HASSUBTYPE, true, row->standard,
		                  "");
	}
	if (!is_type(row) && row->devices_type)
		refer_to_devices(roster, references, UA_REFERENCETYPEINDEX_HASTYPEDEFINITION, false,
		                 row->standard);
	else if (!is_type(row) && row->standard != 0)
		refer_to_type(references, row->standard);
	if (!is_type(row) && row->devices_type)
		refer_to_nameplates(roster, references,
		                    db_opcua_type_has_vendor(&db_opcua_type_rows[row->above]));
	/* What a data type has is no part of an instance. */
	if (!is_type(row) && row->class != DB_OPCUA_NAMES_ROW && row->class != DB_OPCUA_BITS_ROW)
		refer_to_standard(references, UA_REFERENCETYPEINDEX_HASMODELLINGRULE, false,
		                  row->always ? UA_NS0ID_MODELLINGRULE_MANDATORY :
		                                UA_NS0ID_MODELLINGRULE_OPTIONAL,
		                  "");
	/* Those below it, each kind of references by itself. */
	for (size_t i = 0; i < sizeof(ties) / sizeof(ties[0]); i++) {
		if (!db_opcua_store_wants(references, ties[i], false))
			continue;
		for (size_t j = 0; j < db_opcua_type_count; j++) {
			const struct db_opcua_type_row *below = &db_opcua_type_rows[j];

			if (below->above == row - db_opcua_type_rows &&
			    tie_of_row(below) == ties[i])
				db_opcua_store_refer(references, ties[i], false,
				                     db_opcua_type_id(roster, below),
				                     db_opcua_row_name(roster, below));
		}
	}
}

static void refer_of_bus(const struct db_opcua_roster *roster, const struct db_opcua_bus *bus,
                         struct db_opcua_references *references)
{
	db_opcua_store_refer(references, UA_REFERENCETYPEINDEX_HASTYPEDEFINITION, false,
	                     db_opcua_type_id(roster, db_opcua_type_of_bus()),
	                     db_opcua_member_name(roster, ""));
	refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT, true, DB_OPCUA_BUSES, "",
	         db_opcua_member_name(roster, "Buses"));
	for (const struct db_opcua_fact *fact = bus->facts; fact; fact = fact->next) {
		char path[sizeof(bus->name) + sizeof(fact->name)];

		snprintf(path, sizeof(path), "%s.%s", bus->name, fact->name);
		refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT, false,
		         DB_OPCUA_BUSES, path, db_opcua_member_name(roster, fact->name));
	}
	refer_to_conditions(roster, references, "bus", bus->name);
}

void db_opcua_refer(const struct db_opcua_roster *roster, const struct db_opcua_subject *subject,
                    struct db_opcua_references *references)
{
	const struct db_opcua_bus *bus = subject->bus;

	switch (subject->type) {
	case DB_OPCUA_ALL_DRIVES:
		refer_to_type(references, UA_NS0ID_FOLDERTYPE);
		refer_to_standard(references, UA_REFERENCETYPEINDEX_ORGANIZES, true,
		                  UA_NS0ID_OBJECTSFOLDER, "Objects");
		refer_to_standard(references, UA_REFERENCETYPEINDEX_HASNOTIFIER, true,
		                  UA_NS0ID_SERVER, "Server");
		for (size_t i = 0; i < roster->count; i++) {
			const struct db_opcua_shown *shown = roster->drives[i];

			if (!shown->gateway)
				refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT,
				         false, shown->name, "",
				         db_opcua_own_name(roster, shown->name));
		}
		break;
	case DB_OPCUA_ALL_BUSES:
		refer_to_type(references, UA_NS0ID_FOLDERTYPE);
		refer_to_standard(references, UA_REFERENCETYPEINDEX_ORGANIZES, true,
		                  UA_NS0ID_OBJECTSFOLDER, "Objects");
		for (bus = roster->buses; bus; bus = bus->next)
			refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT, false,
			         DB_OPCUA_BUSES, bus->name, db_opcua_own_name(roster, bus->name));
		break;
	case DB_OPCUA_ALL_ALARMS:
		refer_to_type(references, UA_NS0ID_FOLDERTYPE);
		refer_to_standard(references, UA_REFERENCETYPEINDEX_ORGANIZES, true,
		                  UA_NS0ID_OBJECTSFOLDER, "Objects");
		for (const struct db_opcua_alarm *alarm = roster->alarms.list; alarm;
		     alarm = alarm->next)
			refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT, false,
			         alarm->id, "", db_opcua_condition_name(roster, alarm));
		break;
	case DB_OPCUA_CONDITION:
		refer_of_condition(roster, subject, references);
		break;
	case DB_OPCUA_BUS:
		refer_of_bus(roster, bus, references);
		break;
	case DB_OPCUA_FACT:
		refer_to_type(references, UA_NS0ID_BASEDATAVARIABLETYPE);
		refer_to(roster, references, UA_REFERENCETYPEINDEX_HASCOMPONENT, true,
		         DB_OPCUA_BUSES, bus->name, db_opcua_own_name(roster, bus->name));
		break;
	case DB_OPCUA_OF_TYPES:
		refer_of_row(roster, subject->row, references);
		break;
	case DB_OPCUA_OF_DRIVE:
	default:
		refer_of_branch(roster, subject->shown, subject->branch, references);
	}
}
