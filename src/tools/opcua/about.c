/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/about.h"
#include "opcua/devices.h"
#include "opcua/types.h"
#include "opcua/values.h"

#include <stdio.h>

#define PROFILE(name) UA_STRING_STATIC("http://opcfoundation.org/UA-Profile/Server/" name)

/* --- namespaces ------------------------------------------------------------------------------- */

struct space {
	const char *uri;
	const char *version;
	const char *day; /* "2026-11-28" */
	bool shared;     /* its nodes are the same on every gateway */
	UA_IdType ids;   /* their ids */
	bool part;       /* not all of its nodes are here */
	/* Where and what the node is that says this; NULL: in the namespace itself. Others define
	 * which nodes theirs has. */
	const char *home;
};

static UA_StatusCode set_property(UA_Server *server, UA_NodeId object, const char *name,
                                  UA_Variant value)
{
	return UA_Server_writeObjectProperty(
		server, object, (UA_QualifiedName){ .name = db_opcua_string(name) }, value);
}

static UA_DateTime date_of_day(const char *day)
{
	UA_DateTimeStruct parts = { .year = 0 };
	int year;
	unsigned month;
	unsigned number;

	if (sscanf(day, "%4d-%2u-%2u", &year, &month, &number) != 3)
		return 0;
	parts.year = (UA_Int16)year;
	parts.month = (UA_UInt16)month;
	parts.day = (UA_UInt16)number;
	return UA_DateTime_fromStruct(parts);
}

static UA_StatusCode describe_space(UA_Server *server, const struct space *space)
{
	UA_String uri = db_opcua_string(space->uri);
	UA_String version = db_opcua_string(space->version);
	UA_DateTime date = date_of_day(space->day);
	UA_Boolean part = space->part;
	UA_IdType ids = space->ids;
	UA_ObjectAttributes attributes = UA_ObjectAttributes_default;
	UA_NodeId node = { .identifierType = UA_NODEIDTYPE_STRING,
		           .identifier.string = db_opcua_string(space->home ? space->uri :
		                                                              "/Namespace") };
	UA_StatusCode status;
	size_t index = 0;
	size_t home = 0;
	UA_Variant value;

	status = UA_Server_getNamespaceByName(server, uri, &index);
	if (status != UA_STATUSCODE_GOOD)
		return status;
	home = index;
	if (space->home)
		status = UA_Server_getNamespaceByName(server, db_opcua_string(space->home), &home);
	if (status != UA_STATUSCODE_GOOD)
		return status;
	node.namespaceIndex = (UA_UInt16)home;
	attributes.displayName.text = uri;
	status = UA_Server_addObjectNode(
		server, node, UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_NAMESPACES),
		UA_NODEID_NUMERIC(0, UA_NS0ID_HASCOMPONENT),
		(UA_QualifiedName){ .namespaceIndex = (UA_UInt16)index, .name = uri },
		UA_NODEID_NUMERIC(0, UA_NS0ID_NAMESPACEMETADATATYPE), attributes, NULL, NULL);
	if (status != UA_STATUSCODE_GOOD)
		return status;
	UA_Variant_setScalar(&value, &uri, &UA_TYPES[UA_TYPES_STRING]);
	status = set_property(server, node, "NamespaceUri", value);
	UA_Variant_setScalar(&value, &version, &UA_TYPES[UA_TYPES_STRING]);
	status |= set_property(server, node, "NamespaceVersion", value);
	UA_Variant_setScalar(&value, &date, &UA_TYPES[UA_TYPES_DATETIME]);
	status |= set_property(server, node, "NamespacePublicationDate", value);
	UA_Variant_setScalar(&value, &part, &UA_TYPES[UA_TYPES_BOOLEAN]);
	status |= set_property(server, node, "IsNamespaceSubset", value);
	/* A gateway's own ids mean nothing elsewhere. */
	UA_Variant_setArray(&value, space->shared ? (void *)&ids : UA_EMPTY_ARRAY_SENTINEL,
	                    space->shared ? 1 : 0, &UA_TYPES[UA_TYPES_IDTYPE]);
	status |= set_property(server, node, "StaticNodeIdTypes", value);
	return status;
}

/* --- capabilities ----------------------------------------------------------------------------- */

/* The standard's variables that the library leaves out. */
static UA_StatusCode add_limits(UA_Server *server, const struct db_opcua_config *config,
                                UA_UInt32 message_max)
{
	const struct {
		UA_UInt32 node;
		const char *name;
		UA_UInt32 number;
	} limits[] = {
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXARRAYLENGTH, "MaxArrayLength",
		  message_max },
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXSTRINGLENGTH, "MaxStringLength",
		  message_max },
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXBYTESTRINGLENGTH, "MaxByteStringLength",
		  message_max },
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXSESSIONS, "MaxSessions", config->sessions },
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXSUBSCRIPTIONS, "MaxSubscriptions",
		  config->sessions * config->subscriptions },
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXSUBSCRIPTIONSPERSESSION,
		  "MaxSubscriptionsPerSession", config->subscriptions },
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXMONITOREDITEMS, "MaxMonitoredItems",
		  config->items },
		{ UA_NS0ID_SERVER_SERVERCAPABILITIES_MAXMONITOREDITEMSPERSUBSCRIPTION,
		  "MaxMonitoredItemsPerSubscription", config->items },
	};
	UA_StatusCode status = UA_STATUSCODE_GOOD;

	for (size_t i = 0; i < sizeof(limits) / sizeof(limits[0]); i++) {
		UA_VariableAttributes attributes = UA_VariableAttributes_default;
		UA_UInt32 number = limits[i].number;

		attributes.displayName.text = db_opcua_string(limits[i].name);
		attributes.dataType = UA_NODEID_NUMERIC(0, UA_NS0ID_UINT32);
		attributes.valueRank = UA_VALUERANK_SCALAR;
		UA_Variant_setScalar(&attributes.value, &number, &UA_TYPES[UA_TYPES_UINT32]);
		status |= UA_Server_addVariableNode(
			server, UA_NODEID_NUMERIC(0, limits[i].node),
			UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_SERVERCAPABILITIES),
			UA_NODEID_NUMERIC(0, UA_NS0ID_HASPROPERTY),
			(UA_QualifiedName){ .name = db_opcua_string(limits[i].name) },
			UA_NODEID_NUMERIC(0, UA_NS0ID_PROPERTYTYPE), attributes, NULL, NULL);
	}
	return status;
}

UA_StatusCode db_opcua_about_set_up(UA_Server *server, const struct db_opcua_config *config,
                                    UA_UInt32 message_max)
{
	/* The library claims more: fifty sessions, and nodes that clients add. */
	UA_String profiles[] = { PROFILE("EmbeddedUA2017"), PROFILE("Methods") };
	UA_Variant value;
	char uri[DB_OPCUA_URI_MAX];
	const struct space types = { .uri = DB_OPCUA_TYPES_NAMESPACE,
		                     .version = db_opcua_types_version,
		                     .day = db_opcua_types_date,
		                     .shared = true,
		                     .ids = UA_IDTYPE_STRING };
	const struct space devices = { .uri = DB_OPCUA_DEVICES_NAMESPACE,
		                       .version = DB_OPCUA_DEVICES_VERSION,
		                       .day = DB_OPCUA_DEVICES_DATE,
		                       .shared = true,
		                       .ids = UA_IDTYPE_NUMERIC,
		                       .part = true,
		                       .home = uri };
	const struct space own = { .uri = uri,
		                   .version = db_opcua_types_version,
		                   .day = db_opcua_types_date };
	UA_StatusCode status = describe_space(server, &types);

	UA_Variant_setArray(&value, profiles, sizeof(profiles) / sizeof(profiles[0]),
	                    &UA_TYPES[UA_TYPES_STRING]);
	db_opcua_config_space(config, uri);
	if (status == UA_STATUSCODE_GOOD)
		status = describe_space(server, &own);
	if (status == UA_STATUSCODE_GOOD)
		status = describe_space(server, &devices);
	if (status == UA_STATUSCODE_GOOD)
		status = add_limits(server, config, message_max);
	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_writeValue(
			server,
			UA_NODEID_NUMERIC(0, UA_NS0ID_SERVER_SERVERCAPABILITIES_SERVERPROFILEARRAY),
			value);
	return status;
}
