/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/access.h"

#include <open62541/plugin/accesscontrol_default.h>
#include <open62541/server_config_default.h>
#include <stdlib.h>

struct db_opcua_access {
	const struct db_opcua_config *config;
	const struct db_opcua_network *network;
};

struct db_opcua_access *db_opcua_access_new(const struct db_opcua_config *config,
                                            const struct db_opcua_network *network)
{
	struct db_opcua_access *access = calloc(1, sizeof(*access));

	if (!access)
		return NULL;
	access->config = config;
	access->network = network;
	return access;
}

void db_opcua_access_free(struct db_opcua_access *access)
{
	free(access);
}

static UA_Byte get_access_level(UA_Server *server, UA_AccessControl *control,
                                const UA_NodeId *session, void *session_context,
                                const UA_NodeId *node, void *node_context)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)node;
	(void)node_context;
	return UA_ACCESSLEVELMASK_READ;
}

static UA_Boolean get_executable(UA_Server *server, UA_AccessControl *control,
                                 const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *node, void *node_context)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)node;
	(void)node_context;
	return false;
}

static UA_Boolean get_executable_on_object(UA_Server *server, UA_AccessControl *control,
                                           const UA_NodeId *session, void *session_context,
                                           const UA_NodeId *node, void *node_context,
                                           const UA_NodeId *object, void *object_context)
{
	(void)object;
	(void)object_context;
	return get_executable(server, control, session, session_context, node, node_context);
}

UA_StatusCode db_opcua_access_set_up(struct db_opcua_access *access, UA_ServerConfig *settings)
{
	UA_StatusCode status = UA_ServerConfig_addSecurityPolicyNone(settings, NULL);

	if (status == UA_STATUSCODE_GOOD)
		status = UA_AccessControl_default(
			settings, access->config->anonymous == DB_OPCUA_READ, NULL, 0, NULL);
	settings->accessControl.getUserAccessLevel = get_access_level;
	settings->accessControl.getUserExecutable = get_executable;
	settings->accessControl.getUserExecutableOnObject = get_executable_on_object;
	if (status == UA_STATUSCODE_GOOD && access->config->none == DB_OPCUA_READ)
		status = UA_ServerConfig_addEndpoint(settings, UA_SECURITY_POLICY_NONE_URI,
		                                     UA_MESSAGESECURITYMODE_NONE);
	return status;
}

void db_opcua_access_forget_connection(struct db_opcua_access *access, uintptr_t connection)
{
	(void)access;
	(void)connection;
}
