/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/access.h"
#include "opcua/security.h"
#include "opcua/values.h"

#include "client/log.h"

#include <open62541/server_config_default.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define ANONYMOUS_POLICY "anonymous"
#define USERNAME_POLICY "username"

/* Passwords that one address may try at once, and how long each takes to come back. A comparison takes some hundredths
 * of a second, in which nobody else is served. */
#define ATTEMPTS 5
#define ATTEMPT_EVERY (5 * DB_NS_PER_S)
#define ATTEMPT_PLACES 64

const struct db_users_keeper db_opcua_keeper = {
	.program = "drivebridge-opcua",
	.group = "drivebridge-opcua",
};

struct attempts {
	char address[64];
	db_time full; /* all of them are there again */
};

struct db_opcua_access {
	const struct db_opcua_config *config;
	struct db_opcua_network *network;
	db_opcua_left_fn *left;
	void *context;
	unsigned last_number;
	char nobody
		[160]; /* a hash that no password has: an unknown user takes as long as a known one */
	struct attempts attempts[ATTEMPT_PLACES];
	size_t places;
	struct db_opcua_session sessions[];
};

struct db_opcua_access *db_opcua_access_new(const struct db_opcua_config *config,
                                            struct db_opcua_network *network,
                                            db_opcua_left_fn *left, void *context)
{
	size_t places = config->sessions;
	struct db_opcua_access *access = calloc(1, sizeof(*access) +
	                                                   places * sizeof(access->sessions[0]));

	if (!access)
		return NULL;
	access->config = config;
	access->network = network;
	access->left = left;
	access->context = context;
	access->places = places;
	return access;
}

void db_opcua_access_free(struct db_opcua_access *access)
{
	for (size_t i = 0; access && i < access->places; i++)
		UA_NodeId_clear(&access->sessions[i].id);
	free(access);
}

/* --- sessions --------------------------------------------------------------------------------- */

static struct db_opcua_session *find_session(struct db_opcua_access *access, const UA_NodeId *id)
{
	for (size_t i = 0; id && i < access->places; i++) {
		if (access->sessions[i].number != 0 && UA_NodeId_equal(&access->sessions[i].id, id))
			return &access->sessions[i];
	}
	return NULL;
}

const struct db_opcua_session *db_opcua_access_find(const struct db_opcua_access *access,
                                                    const UA_NodeId *session)
{
	for (size_t i = 0; session && i < access->places; i++) {
		if (access->sessions[i].number != 0 &&
		    UA_NodeId_equal(&access->sessions[i].id, session))
			return &access->sessions[i];
	}
	return NULL;
}

const struct db_opcua_session *db_opcua_access_next(const struct db_opcua_access *access,
                                                    size_t *place)
{
	while (*place < access->places) {
		const struct db_opcua_session *session = &access->sessions[(*place)++];

		if (session->number != 0 && session->connection != 0)
			return session;
	}
	return NULL;
}

void db_opcua_access_forget_connection(struct db_opcua_access *access, uintptr_t connection)
{
	for (size_t i = 0; i < access->places; i++) {
		struct db_opcua_session *session = &access->sessions[i];

		if (session->number == 0 || session->connection != connection)
			continue;
		session->connection = 0;
		access->left(access->context, session->number);
	}
}

static struct db_opcua_session *add_session(struct db_opcua_access *access, const UA_NodeId *id)
{
	for (size_t i = 0; i < access->places; i++) {
		struct db_opcua_session *session = &access->sessions[i];

		if (session->number != 0 || UA_NodeId_copy(id, &session->id) != UA_STATUSCODE_GOOD)
			continue;
		session->number = ++access->last_number;
		return session;
	}
	return NULL;
}

/* --- passwords -------------------------------------------------------------------------------- */

static db_time read_clock(void)
{
	struct timespec time;

	(void)clock_gettime(CLOCK_MONOTONIC, &time);
	return (db_time)time.tv_sec * DB_NS_PER_S + time.tv_nsec;
}

/* NULL: this address has tried too often. */
static struct attempts *take_attempt(struct db_opcua_access *access, const char *address)
{
	struct attempts *place = &access->attempts[0];
	db_time now = read_clock();

	for (size_t i = 0; i < ATTEMPT_PLACES; i++) {
		struct attempts *one = &access->attempts[i];

		if (strcmp(one->address, address) == 0) {
			place = one;
			break;
		}
		if (one->full < place->full)
			place = one;
	}
	if (strcmp(place->address, address) != 0) {
		(void)snprintf(place->address, sizeof(place->address), "%s", address);
		place->full = 0;
	}
	if (place->full > now + (ATTEMPTS - 1) * ATTEMPT_EVERY)
		return NULL;
	place->full = (place->full > now ? place->full : now) + ATTEMPT_EVERY;
	return place;
}

/* DB_ROLE_NONE: it is not this user's password, or he is none. */
static enum db_role check_password(struct db_opcua_access *access, const char *address,
                                   const char *name, const char *password)
{
	struct attempts *attempt = take_attempt(access, address);
	const struct db_user *user = NULL;
	enum db_role role = DB_ROLE_NONE;
	struct db_users users = { .list = NULL };

	if (!attempt)
		return DB_ROLE_NONE;
	if (db_users_load(&users, access->config->users, &db_opcua_keeper, stderr))
		user = db_users_find(&users, name);
	if (db_users_has_password(user ? user->hash : access->nobody, password) && user) {
		role = user->role;
		attempt->full -= ATTEMPT_EVERY;
	}
	db_users_clear(&users);
	return role;
}

static bool copy_text(const UA_String *string, char *text, size_t size)
{
	if (string->length >= size || memchr(string->data, '\0', string->length))
		return false;
	memcpy(text, string->data, string->length);
	text[string->length] = '\0';
	return true;
}

static enum db_role find_role(struct db_opcua_access *access, const char *address,
                              const UA_ExtensionObject *token, char *user, size_t size)
{
	char password[DB_USERS_PASSWORD_MAX + 1] = "";
	const UA_UserNameIdentityToken *named;
	enum db_role role = DB_ROLE_NONE;

	user[0] = '\0';
	/* No token at all is anonymous. */
	if (token->encoding == UA_EXTENSIONOBJECT_ENCODED_NOBODY ||
	    (token->encoding >= UA_EXTENSIONOBJECT_DECODED &&
	     token->content.decoded.type == &UA_TYPES[UA_TYPES_ANONYMOUSIDENTITYTOKEN]))
		return access->config->anonymous == DB_OPCUA_READ ? DB_ROLE_READER : DB_ROLE_NONE;
	if (token->encoding < UA_EXTENSIONOBJECT_DECODED ||
	    token->content.decoded.type != &UA_TYPES[UA_TYPES_USERNAMEIDENTITYTOKEN])
		return DB_ROLE_NONE;
	named = token->content.decoded.data;
	if (copy_text(&named->userName, user, size) &&
	    copy_text(&named->password, password, sizeof(password)))
		role = check_password(access, address, user, password);
	else
		user[0] = '\0';
	explicit_bzero(password, sizeof(password));
	return role;
}

/* --- the library's questions ------------------------------------------------------------------ */

static UA_StatusCode activate_session(UA_Server *server, UA_AccessControl *control,
                                      const UA_EndpointDescription *endpoint,
                                      const UA_ByteString *certificate, const UA_NodeId *id,
                                      const UA_ExtensionObject *token, void **session_context)
{
	struct db_opcua_access *access = control->context;
	uintptr_t connection = db_opcua_network_current(access->network);
	const char *address = db_opcua_network_address(access->network, connection);
	struct db_opcua_session *session;
	char user[DB_USERS_NAME_MAX + 1];
	enum db_role role = find_role(access, address, token, user, sizeof(user));

	(void)server;
	(void)certificate;
	(void)session_context;
	if (role == DB_ROLE_NONE) {
		db_client_log(DB_CLIENT_WARNING, "%s: not logged in: %s", address,
		              user[0] ? user : "without a user");
		return UA_STATUSCODE_BADUSERACCESSDENIED;
	}
	/* What is not signed may be anybody's. */
	if (endpoint->securityMode == UA_MESSAGESECURITYMODE_NONE)
		role = DB_ROLE_READER;
	session = find_session(access, id);
	if (session && (strcmp(session->user, user) != 0 || session->role != role))
		access->left(access->context, session->number);
	if (!session)
		session = add_session(access, id);
	if (!session)
		return UA_STATUSCODE_BADTOOMANYSESSIONS;
	if (session->connection != 0 && session->connection != connection)
		access->left(access->context, session->number);
	session->connection = connection;
	session->role = role;
	(void)snprintf(session->user, sizeof(session->user), "%s", user);
	(void)snprintf(session->label, sizeof(session->label), "%s at %s",
	               user[0] ? user : "anonymous", address);
	db_client_log(DB_CLIENT_INFO, "%s: logged in as %s", session->label, db_role_name(role));
	return UA_STATUSCODE_GOOD;
}

static void close_session(UA_Server *server, UA_AccessControl *control, const UA_NodeId *id,
                          void *session_context)
{
	struct db_opcua_access *access = control->context;
	struct db_opcua_session *session = find_session(access, id);

	(void)server;
	(void)session_context;
	if (!session)
		return;
	access->left(access->context, session->number);
	UA_NodeId_clear(&session->id);
	*session = (struct db_opcua_session){ .number = 0 };
}

static bool is_operator(const UA_AccessControl *control, const UA_NodeId *id)
{
	const struct db_opcua_session *session = db_opcua_access_find(control->context, id);

	return session && session->role == DB_ROLE_OPERATOR;
}

static UA_UInt32 get_rights(UA_Server *server, UA_AccessControl *control, const UA_NodeId *session,
                            void *session_context, const UA_NodeId *node, void *node_context)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)node;
	(void)node_context;
	return 0;
}

static UA_Byte get_access_level(UA_Server *server, UA_AccessControl *control,
                                const UA_NodeId *session, void *session_context,
                                const UA_NodeId *node, void *node_context)
{
	(void)server;
	(void)session_context;
	(void)node;
	(void)node_context;
	return is_operator(control, session) ? UA_ACCESSLEVELMASK_READ | UA_ACCESSLEVELMASK_WRITE :
	                                       UA_ACCESSLEVELMASK_READ;
}

static UA_Boolean get_executable(UA_Server *server, UA_AccessControl *control,
                                 const UA_NodeId *session, void *session_context,
                                 const UA_NodeId *method, void *method_context)
{
	(void)server;
	(void)session_context;
	(void)method_context;
	/* The library's own are about the caller's subscriptions. */
	return method->namespaceIndex == 0 || is_operator(control, session);
}

static UA_Boolean get_executable_on_object(UA_Server *server, UA_AccessControl *control,
                                           const UA_NodeId *session, void *session_context,
                                           const UA_NodeId *method, void *method_context,
                                           const UA_NodeId *object, void *object_context)
{
	(void)object;
	(void)object_context;
	return get_executable(server, control, session, session_context, method, method_context);
}

static UA_Boolean allow_add_node(UA_Server *server, UA_AccessControl *control,
                                 const UA_NodeId *session, void *session_context,
                                 const UA_AddNodesItem *item)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)item;
	return false;
}

static UA_Boolean allow_add_reference(UA_Server *server, UA_AccessControl *control,
                                      const UA_NodeId *session, void *session_context,
                                      const UA_AddReferencesItem *item)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)item;
	return false;
}

static UA_Boolean allow_delete_node(UA_Server *server, UA_AccessControl *control,
                                    const UA_NodeId *session, void *session_context,
                                    const UA_DeleteNodesItem *item)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)item;
	return false;
}

static UA_Boolean allow_delete_reference(UA_Server *server, UA_AccessControl *control,
                                         const UA_NodeId *session, void *session_context,
                                         const UA_DeleteReferencesItem *item)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)item;
	return false;
}

static UA_Boolean allow_browse(UA_Server *server, UA_AccessControl *control,
                               const UA_NodeId *session, void *session_context,
                               const UA_NodeId *node, void *node_context)
{
	(void)server;
	(void)control;
	(void)session;
	(void)session_context;
	(void)node;
	(void)node_context;
	return true;
}

/* Only the same user's. */
static UA_Boolean allow_transfer(UA_Server *server, UA_AccessControl *control,
                                 const UA_NodeId *from, void *from_context, const UA_NodeId *to,
                                 void *to_context)
{
	const struct db_opcua_session *old = db_opcua_access_find(control->context, from);
	const struct db_opcua_session *fresh = db_opcua_access_find(control->context, to);

	(void)server;
	(void)from_context;
	(void)to_context;
	return old && fresh && strcmp(old->user, fresh->user) == 0;
}

static void clear_control(UA_AccessControl *control)
{
	UA_Array_delete(control->userTokenPolicies, control->userTokenPoliciesSize,
	                &UA_TYPES[UA_TYPES_USERTOKENPOLICY]);
	control->userTokenPolicies = NULL;
	control->userTokenPoliciesSize = 0;
}

/* --- setting up ------------------------------------------------------------------------------- */

static UA_StatusCode set_control(struct db_opcua_access *access, UA_AccessControl *control)
{
	bool anonymous = access->config->anonymous == DB_OPCUA_READ;
	size_t count = anonymous ? 2 : 1;
	UA_UserTokenPolicy *policies = UA_Array_new(count, &UA_TYPES[UA_TYPES_USERTOKENPOLICY]);

	if (!policies)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	policies[0].tokenType = UA_USERTOKENTYPE_USERNAME;
	policies[0].policyId = UA_STRING_ALLOC(USERNAME_POLICY);
	if (anonymous) {
		policies[1].tokenType = UA_USERTOKENTYPE_ANONYMOUS;
		policies[1].policyId = UA_STRING_ALLOC(ANONYMOUS_POLICY);
	}
	*control = (UA_AccessControl){
		.context = access,
		.clear = clear_control,
		.userTokenPoliciesSize = count,
		.userTokenPolicies = policies,
		.activateSession = activate_session,
		.closeSession = close_session,
		.getUserRightsMask = get_rights,
		.getUserAccessLevel = get_access_level,
		.getUserExecutable = get_executable,
		.getUserExecutableOnObject = get_executable_on_object,
		.allowAddNode = allow_add_node,
		.allowAddReference = allow_add_reference,
		.allowDeleteNode = allow_delete_node,
		.allowDeleteReference = allow_delete_reference,
		.allowBrowseNode = allow_browse,
		.allowTransferSubscription = allow_transfer,
	};
	return UA_STATUSCODE_GOOD;
}

static UA_StatusCode add_policies(UA_ServerConfig *settings, const UA_ByteString *certificate,
                                  const UA_ByteString *key, bool none)
{
	/* The best first: clients that choose by themselves take the first or the highest. */
	UA_StatusCode status = UA_ServerConfig_addSecurityPolicyAes256Sha256RsaPss(
		settings, certificate, key);

	if (status == UA_STATUSCODE_GOOD)
		status = UA_ServerConfig_addSecurityPolicyAes128Sha256RsaOaep(settings, certificate,
		                                                              key);
	if (status == UA_STATUSCODE_GOOD)
		status = UA_ServerConfig_addSecurityPolicyBasic256Sha256(settings, certificate,
		                                                         key);
	for (size_t i = 0; status == UA_STATUSCODE_GOOD && i < settings->securityPoliciesSize;
	     i++) {
		const UA_String uri = settings->securityPolicies[i].policyUri;

		status = UA_ServerConfig_addEndpoint(settings, uri,
		                                     UA_MESSAGESECURITYMODE_SIGNANDENCRYPT);
		if (status == UA_STATUSCODE_GOOD)
			status = UA_ServerConfig_addEndpoint(settings, uri,
			                                     UA_MESSAGESECURITYMODE_SIGN);
	}
	/* Without it nobody could ask for the endpoints. */
	if (status == UA_STATUSCODE_GOOD)
		status = UA_ServerConfig_addSecurityPolicyNone(settings, certificate);
	settings->securityPolicyNoneDiscoveryOnly = !none;
	if (status == UA_STATUSCODE_GOOD && none)
		status = UA_ServerConfig_addEndpoint(settings, UA_SECURITY_POLICY_NONE_URI,
		                                     UA_MESSAGESECURITYMODE_NONE);
	return status;
}

UA_StatusCode db_opcua_access_set_up(struct db_opcua_access *access, UA_ServerConfig *settings)
{
	UA_ByteString certificate;
	UA_ByteString key;
	UA_StatusCode status = db_opcua_security_load(access->config, settings->logging,
	                                              &certificate, &key);

	if (status == UA_STATUSCODE_GOOD &&
	    !db_users_hash("nobody", access->nobody, sizeof(access->nobody)))
		status = UA_STATUSCODE_BADOUTOFMEMORY;
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_security_guard(access->config, &settings->secureChannelPKI);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_security_guard(access->config, &settings->sessionPKI);
	if (status == UA_STATUSCODE_GOOD)
		status = set_control(access, &settings->accessControl);
	if (status == UA_STATUSCODE_GOOD)
		status = add_policies(settings, &certificate, &key,
		                      access->config->none == DB_OPCUA_READ);
	UA_ByteString_memZero(&key);
	UA_ByteString_clear(&key);
	UA_ByteString_clear(&certificate);
	return status;
}
