/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/devices.h"
#include "opcua/values.h"

#define TOPOLOGY_ELEMENT_TYPE 1001
#define IDENTIFICATION 6014
#define COMPONENT_TYPE 15063

/* First members of the two interfaces, and of the component, which has those of both. */
#define OF_VENDOR_NAMEPLATE 15036
#define OF_TAG_NAMEPLATE 15049
#define OF_COMPONENT 15086

/* In the order of their ids; those of the tag's nameplate are the last ones. */
static const struct {
	const char *name;
	UA_UInt32 type;
} nameplate[] = {
	{ "Manufacturer", UA_NS0ID_LOCALIZEDTEXT },
	{ "ManufacturerUri", UA_NS0ID_STRING },
	{ "Model", UA_NS0ID_LOCALIZEDTEXT },
	{ "HardwareRevision", UA_NS0ID_STRING },
	{ "SoftwareRevision", UA_NS0ID_STRING },
	{ "DeviceRevision", UA_NS0ID_STRING },
	{ "ProductCode", UA_NS0ID_STRING },
	{ "DeviceManual", UA_NS0ID_STRING },
	{ "DeviceClass", UA_NS0ID_STRING },
	{ "SerialNumber", UA_NS0ID_STRING },
	{ "ProductInstanceUri", UA_NS0ID_STRING },
	{ "RevisionCounter", UA_NS0ID_INT32 },
	{ "AssetId", UA_NS0ID_STRING },
	{ "ComponentName", UA_NS0ID_LOCALIZEDTEXT },
};
#define MEMBERS (sizeof(nameplate) / sizeof(nameplate[0]))
#define OF_TAG 2

struct adding {
	UA_Server *server;
	UA_UInt16 space;
	UA_StatusCode status; /* the first failure */
};

static void note(struct adding *adding, UA_StatusCode status)
{
	if (adding->status == UA_STATUSCODE_GOOD)
		adding->status = status;
}

static UA_NodeId id_of(const struct adding *adding, UA_UInt32 number)
{
	return UA_NODEID_NUMERIC(adding->space, number);
}

static UA_QualifiedName name_of(const struct adding *adding, const char *name)
{
	return (UA_QualifiedName){ .namespaceIndex = adding->space, .name = db_opcua_string(name) };
}

static void add_type(struct adding *adding, UA_UInt32 number, UA_NodeId above, const char *name,
                     bool abstract)
{
	UA_ObjectTypeAttributes attributes = UA_ObjectTypeAttributes_default;

	attributes.displayName.text = db_opcua_string(name);
	attributes.isAbstract = abstract;
	note(adding, UA_Server_addObjectTypeNode(adding->server, id_of(adding, number), above,
	                                         UA_NODEID_NUMERIC(0, UA_NS0ID_HASSUBTYPE),
	                                         name_of(adding, name), attributes, NULL, NULL));
}

static void add_object(struct adding *adding, UA_UInt32 number, UA_NodeId above, UA_UInt32 tie,
                       const char *name, UA_NodeId type)
{
	UA_ObjectAttributes attributes = UA_ObjectAttributes_default;

	attributes.displayName.text = db_opcua_string(name);
	note(adding, UA_Server_addObjectNode(adding->server, id_of(adding, number), above,
	                                     UA_NODEID_NUMERIC(0, tie), name_of(adding, name), type,
	                                     attributes, NULL, NULL));
}

static void refer(struct adding *adding, UA_UInt32 from, UA_UInt32 tie, UA_NodeId to)
{
	note(adding,
	     UA_Server_addReference(adding->server, id_of(adding, from), UA_NODEID_NUMERIC(0, tie),
	                            UA_EXPANDEDNODEID_NODEID(to), true));
}

static void make_optional(struct adding *adding, UA_UInt32 number)
{
	refer(adding, number, UA_NS0ID_HASMODELLINGRULE,
	      UA_NODEID_NUMERIC(0, UA_NS0ID_MODELLINGRULE_OPTIONAL));
}

/* Members of the nameplate from one on, with ids that follow each other. */
static void add_members(struct adding *adding, UA_UInt32 owner, UA_UInt32 number, size_t first,
                        size_t count)
{
	for (size_t i = first; i < first + count; i++, number++) {
		UA_VariableAttributes attributes = UA_VariableAttributes_default;

		attributes.displayName.text = db_opcua_string(nameplate[i].name);
		attributes.dataType = UA_NODEID_NUMERIC(0, nameplate[i].type);
		attributes.valueRank = UA_VALUERANK_SCALAR;
		note(adding, UA_Server_addVariableNode(adding->server, id_of(adding, number),
		                                       id_of(adding, owner),
		                                       UA_NODEID_NUMERIC(0, UA_NS0ID_HASPROPERTY),
		                                       name_of(adding, nameplate[i].name),
		                                       UA_NODEID_NUMERIC(0, UA_NS0ID_PROPERTYTYPE),
		                                       attributes, NULL, NULL));
		make_optional(adding, number);
	}
}

UA_StatusCode db_opcua_devices_add(UA_Server *server, UA_UInt16 *space)
{
	UA_NodeId interface = UA_NODEID_NUMERIC(0, UA_NS0ID_BASEINTERFACETYPE);
	struct adding adding = { .server = server };

	*space = UA_Server_addNamespace(server, DB_OPCUA_DEVICES_NAMESPACE);
	adding.space = *space;
	add_type(&adding, DB_OPCUA_VENDOR_NAMEPLATE, interface, "IVendorNameplateType", true);
	add_members(&adding, DB_OPCUA_VENDOR_NAMEPLATE, OF_VENDOR_NAMEPLATE, 0, MEMBERS - OF_TAG);
	add_type(&adding, DB_OPCUA_TAG_NAMEPLATE, interface, "ITagNameplateType", true);
	add_members(&adding, DB_OPCUA_TAG_NAMEPLATE, OF_TAG_NAMEPLATE, MEMBERS - OF_TAG, OF_TAG);
	add_type(&adding, DB_OPCUA_FUNCTIONAL_GROUP_TYPE, UA_NODEID_NUMERIC(0, UA_NS0ID_FOLDERTYPE),
	         "FunctionalGroupType", false);
	add_type(&adding, TOPOLOGY_ELEMENT_TYPE, UA_NODEID_NUMERIC(0, UA_NS0ID_BASEOBJECTTYPE),
	         "TopologyElementType", true);
	add_object(&adding, IDENTIFICATION, id_of(&adding, TOPOLOGY_ELEMENT_TYPE),
	           UA_NS0ID_HASCOMPONENT, "Identification",
	           id_of(&adding, DB_OPCUA_FUNCTIONAL_GROUP_TYPE));
	make_optional(&adding, IDENTIFICATION);
	add_type(&adding, COMPONENT_TYPE, id_of(&adding, TOPOLOGY_ELEMENT_TYPE), "ComponentType",
	         true);
	add_members(&adding, COMPONENT_TYPE, OF_COMPONENT, 0, MEMBERS);
	refer(&adding, COMPONENT_TYPE, UA_NS0ID_HASINTERFACE,
	      id_of(&adding, DB_OPCUA_VENDOR_NAMEPLATE));
	refer(&adding, COMPONENT_TYPE, UA_NS0ID_HASINTERFACE,
	      id_of(&adding, DB_OPCUA_TAG_NAMEPLATE));
	add_object(&adding, DB_OPCUA_DEVICE_SET, UA_NODEID_NUMERIC(0, UA_NS0ID_OBJECTSFOLDER),
	           UA_NS0ID_ORGANIZES, "DeviceSet", UA_NODEID_NUMERIC(0, UA_NS0ID_BASEOBJECTTYPE));
	return adding.status;
}
