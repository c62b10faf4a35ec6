/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/access.h"
#include "opcua/login.h"
#include "opcua/nodes.h"
#include "opcua/security.h"
#include "opcua/values.h"

#include "client/clock.h"
#include "client/log.h"

#include <open62541/server_config_default.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ANONYMOUS_POLICY "anonymous"
#define USERNAME_POLICY "username"

/* A session that is not activated yet. */
struct waiting {
	UA_NodeId id;
	uintptr_t connection; /* 0: the place is free */
};

struct db_opcua_access {
	const struct db_opcua_config *config;
	struct db_opcua_network *network;
	db_opcua_left_fn *left;
	db_opcua_note_fn *note;
	void *context;
	unsigned last_number;
	struct db_opcua_logins *logins;
	struct db_certificate_pair own;     /* the server's certificate */
	struct db_client_log_rations lines; /* for logins without a user, and as readers */
	uint64_t users_stamp; /* of the file of users when sessions were last checked against it */
	UA_Server *server;    /* NULL before the server exists */
	struct waiting waiting[DB_OPCUA_NETWORK_PLACES];
	size_t places;
	struct db_opcua_session sessions[];
};

struct db_opcua_access *db_opcua_access_new(const struct db_opcua_config *config,
                                            struct db_opcua_network *network,
                                            db_opcua_left_fn *left, db_opcua_note_fn *note,
                                            void *context)
{
	size_t places = config->sessions + DB_OPCUA_STOP_PLACES;
	struct db_opcua_access *access = calloc(1, sizeof(*access) +
	                                                   places * sizeof(access->sessions[0]));

	if (access)
		access->logins = db_opcua_logins_new(config, &access->lines);
	if (!access || !access->logins) {
		free(access);
		return NULL;
	}
	access->config = config;
	access->network = network;
	access->left = left;
	access->note = note;
	access->context = context;
	access->places = places;
	return access;
}

void db_opcua_access_free(struct db_opcua_access *access)
{
	for (size_t i = 0; access && i < access->places; i++)
		UA_NodeId_clear(&access->sessions[i].id);
	for (size_t i = 0; access && i < DB_OPCUA_NETWORK_PLACES; i++)
		UA_NodeId_clear(&access->waiting[i].id);
	if (access) {
		free(access->logins);
		db_certificate_pair_clear(&access->own);
	}
	free(access);
}

/* --- sessions --------------------------------------------------------------------------------- */

static struct db_opcua_session *find_session(struct db_opcua_access *access, const UA_NodeId *id)
{
	const struct db_opcua_session *found = db_opcua_access_find(access, id);

	return found ? &access->sessions[found - access->sessions] : NULL;
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

bool db_opcua_access_set_token(struct db_opcua_access *access, const UA_NodeId *session,
                               const char *token)
{
	struct db_opcua_session *found = find_session(access, session);

	if (found)
		snprintf(found->token, sizeof(found->token), "%s", token);
	return found;
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

static void close_waiting(struct db_opcua_access *access, uintptr_t connection)
{
	for (size_t i = 0; i < DB_OPCUA_NETWORK_PLACES; i++) {
		/* The entry is removed when the library reports the end of the session. */
		if (access->waiting[i].connection == connection && access->server)
			(void)UA_Server_closeSession(access->server, &access->waiting[i].id);
	}
}

static void forget_waiting(struct db_opcua_access *access, const UA_NodeId *id)
{
	for (size_t i = 0; i < DB_OPCUA_NETWORK_PLACES; i++) {
		struct waiting *waiting = &access->waiting[i];

		if (waiting->connection == 0 || !UA_NodeId_equal(&waiting->id, id))
			continue;
		UA_NodeId_clear(&waiting->id);
		*waiting = (struct waiting){ .connection = 0 };
	}
}

/* The library has made a session. A further one of the same connection ends the one before, unless
 * a user has logged in to it. */
static UA_StatusCode note_session(UA_Server *server, const UA_NodeId *maker, void *maker_context,
                                  const UA_NodeId *type, void *type_context, const UA_NodeId *id,
                                  void **context)
{
	struct db_opcua_access *access = UA_Server_getConfig(server)->accessControl.context;
	uintptr_t connection = db_opcua_network_current(access->network);

	(void)maker;
	(void)maker_context;
	(void)type;
	(void)type_context;
	(void)context;
	if (connection == 0)
		return UA_STATUSCODE_GOOD;
	close_waiting(access, connection);
	for (size_t i = 0; i < DB_OPCUA_NETWORK_PLACES; i++) {
		struct waiting *waiting = &access->waiting[i];

		if (waiting->connection != 0 ||
		    UA_NodeId_copy(id, &waiting->id) != UA_STATUSCODE_GOOD)
			continue;
		waiting->connection = connection;
		break;
	}
	return UA_STATUSCODE_GOOD;
}

UA_StatusCode db_opcua_access_watch(struct db_opcua_access *access, UA_Server *server)
{
	access->server = server;
	/* The library reports a new session only by making an object for it. */
	return UA_Server_setNodeTypeLifecycle(
		server, UA_NODEID_NUMERIC(0, UA_NS0ID_SESSIONDIAGNOSTICSOBJECTTYPE),
		(UA_NodeTypeLifecycle){ .constructor = note_session });
}

/* Reports the highest role logged in over the connection to the network. */
static void update_network(struct db_opcua_access *access, uintptr_t connection)
{
	enum db_role role = DB_ROLE_NONE;

	for (size_t i = 0; i < access->places; i++) {
		const struct db_opcua_session *session = &access->sessions[i];

		if (session->number != 0 && session->connection == connection &&
		    session->grant.role > role)
			role = session->grant.role;
	}
	db_opcua_network_know(access->network, connection, role);
}

void db_opcua_access_forget_connection(struct db_opcua_access *access, uintptr_t connection)
{
	close_waiting(access, connection);
	for (size_t i = 0; i < access->places; i++) {
		struct db_opcua_session *session = &access->sessions[i];

		if (session->number == 0 || session->connection != connection)
			continue;
		session->connection = 0;
		access->left(access->context, session->number);
	}
}

/* The session to end for one of this role: the first one that has lost its connection, or else for
 * one who moves drives the latest of those that do not. NULL: none. */
static struct db_opcua_session *find_least(struct db_opcua_access *access, enum db_role role)
{
	struct db_opcua_session *lost = NULL;
	struct db_opcua_session *reader = NULL;

	for (size_t i = 0; i < access->places - DB_OPCUA_STOP_PLACES; i++) {
		struct db_opcua_session *session = &access->sessions[i];

		if (session->connection == 0) {
			if (!lost || session->number < lost->number)
				lost = session;
		} else if (db_role_moves(role) && !db_role_moves(session->grant.role) &&
		           (!reader || session->number > reader->number)) {
			reader = session;
		}
	}
	return lost ? lost : reader;
}

/* Among these places. NULL: none is free. */
static struct db_opcua_session *find_free(struct db_opcua_access *access, size_t from, size_t to)
{
	for (size_t i = from; i < to; i++) {
		if (access->sessions[i].number == 0)
			return &access->sessions[i];
	}
	return NULL;
}

/* Among these places, all of which are taken: one that has lost its connection, or the oldest
 * one. */
static struct db_opcua_session *find_oldest(struct db_opcua_access *access, size_t from, size_t to)
{
	struct db_opcua_session *oldest = &access->sessions[from];

	for (size_t i = from + 1; i < to; i++) {
		struct db_opcua_session *session = &access->sessions[i];
		bool lost = session->connection == 0;

		if (lost == (oldest->connection == 0) ? session->number < oldest->number : lost)
			oldest = session;
	}
	return oldest;
}

static struct db_opcua_session *add_session(struct db_opcua_access *access, const UA_NodeId *id,
                                            enum db_role role)
{
	size_t ordinary = access->places - DB_OPCUA_STOP_PLACES;
	struct db_opcua_session *session = find_free(access, 0, ordinary);
	bool stops_only = false;

	if (!session)
		session = find_least(access, role);
	if (!session && db_role_moves(role)) {
		stops_only = true;
		session = find_free(access, ordinary, access->places);
		if (!session)
			session = find_oldest(access, ordinary, access->places);
	}
	if (!session)
		return NULL;
	if (session->number != 0) {
		db_client_log_rationed_for(
			&access->lines,
			db_opcua_network_address(access->network, session->connection),
			db_client_now(), DB_CLIENT_NOTICE,
			"%s: closed: others need the session's place", session->label);
		/* This frees the place. */
		(void)UA_Server_closeSession(access->server, &session->id);
	}
	if (session->number != 0 || UA_NodeId_copy(id, &session->id) != UA_STATUSCODE_GOOD)
		return NULL;
	forget_waiting(access, id);
	session->number = ++access->last_number;
	session->stops_only = stops_only;
	return session;
}

void db_opcua_access_begin(struct db_opcua_access *access)
{
	db_opcua_logins_begin(access->logins);
}

void db_opcua_access_review(struct db_opcua_access *access)
{
	struct db_users users = { .list = NULL };
	uint64_t stamp = db_users_stamp(access->config->users, &db_opcua_keeper);

	if (stamp == access->users_stamp)
		return;
	if (access->users_stamp != 0)
		access->note(access->context,
		             &(struct db_plant_note){ .kind = "users",
		                                      .what = "changed",
		                                      .from = "OPC UA",
		                                      .text = access->config->users });
	access->users_stamp = stamp;
	/* If the file cannot be read, there are no users. */
	(void)db_users_load(&users, access->config->users, &db_opcua_keeper, stderr);
	for (size_t i = 0; i < access->places; i++) {
		const struct db_opcua_session *session = &access->sessions[i];
		const struct db_user *user = db_users_find(&users, session->user);

		if (session->number == 0 || session->user[0] == '\0' ||
		    (user && db_users_digest(user) == session->digest))
			continue;
		db_client_log(DB_CLIENT_NOTICE, "%s: closed, for the file of users has changed",
		              session->label);
		(void)UA_Server_closeSession(access->server, &session->id);
	}
	db_users_clear(&users);
}

/* --- callbacks of the library ----------------------------------------------------------------- */

static void note_login(const struct db_opcua_access *access, const char *user, const char *from,
                       const char *text, bool refused)
{
	access->note(access->context, &(struct db_plant_note){ .kind = "login",
	                                                       .what = "in",
	                                                       .user = user,
	                                                       .from = from,
	                                                       .text = text,
	                                                       .refused = refused });
}

static UA_StatusCode activate_session(UA_Server *server, UA_AccessControl *control,
                                      const UA_EndpointDescription *endpoint,
                                      const UA_ByteString *certificate, const UA_NodeId *id,
                                      const UA_ExtensionObject *token, void **session_context)
{
	struct db_opcua_access *access = control->context;
	uintptr_t connection = db_opcua_network_current(access->network);
	uintptr_t before = connection;
	const char *address = db_opcua_network_address(access->network, connection);
	struct db_opcua_session *session = find_session(access, id);
	struct db_opcua_login login;
	char from[sizeof(session->from)];
	UA_StatusCode status = db_opcua_logins_check(
		access->logins, address, endpoint->securityMode != UA_MESSAGESECURITYMODE_NONE,
		token, &login);

	(void)server;
	(void)certificate;
	(void)session_context;
	snprintf(from, sizeof(from), "OPC UA, %s", address);
	/* Another user's session is not taken over. */
	if (status == UA_STATUSCODE_GOOD && session && session->connection != connection &&
	    strcmp(session->user, login.user) != 0)
		status = UA_STATUSCODE_BADIDENTITYCHANGENOTSUPPORTED;
	if (status == UA_STATUSCODE_GOOD && !session) {
		session = add_session(access, id, login.grant.role);
		status = session ? UA_STATUSCODE_GOOD : UA_STATUSCODE_BADTOOMANYSESSIONS;
	} else if (status == UA_STATUSCODE_GOOD) {
		before = session->connection;
		if (before != connection || session->digest != login.digest ||
		    session->grant.role != login.grant.role ||
		    strcmp(session->user, login.user) != 0)
			access->left(access->context, session->number);
	}
	if (status != UA_STATUSCODE_GOOD) {
		const char *who = login.user[0] ? login.user :
		                  login.named   ? "an unknown user" :
		                                  "without a user";

		db_client_log_rationed_for(&access->lines, address, db_client_now(),
		                           DB_CLIENT_WARNING, "%s: not logged in: %s: %s", address,
		                           who, UA_StatusCode_name(status));
		note_login(access, "", from, who, true);
		return status;
	}
	session->connection = connection;
	session->grant = login.grant;
	session->digest = login.digest;
	snprintf(session->user, sizeof(session->user), "%s", login.user);
	snprintf(session->label, sizeof(session->label), "%s at %s",
	         login.user[0] ? login.user : "anonymous", address);
	memcpy(session->from, from, sizeof(from));
	update_network(access, connection);
	update_network(access, before);
	/* Without a user nothing can be done but reading. */
	if (login.user[0])
		note_login(access, login.user, from, db_role_name(login.grant.role), false);
	if (db_role_moves(login.grant.role))
		db_client_log(DB_CLIENT_INFO, "%s: logged in as %s", session->label,
		              db_role_name(login.grant.role));
	else
		db_client_log_rationed_for(&access->lines, address, db_client_now(), DB_CLIENT_INFO,
		                           "%s: logged in as %s", session->label,
		                           db_role_name(login.grant.role));
	return UA_STATUSCODE_GOOD;
}

static void close_session(UA_Server *server, UA_AccessControl *control, const UA_NodeId *id,
                          void *session_context)
{
	struct db_opcua_access *access = control->context;
	struct db_opcua_session *session = find_session(access, id);
	uintptr_t connection;

	(void)server;
	(void)session_context;
	forget_waiting(access, id);
	if (!session)
		return;
	connection = session->connection;
	access->left(access->context, session->number);
	UA_NodeId_clear(&session->id);
	*session = (struct db_opcua_session){ .number = 0 };
	if (connection != 0)
		update_network(access, connection);
}

UA_StatusCode db_opcua_access_deny(const struct db_opcua_access *access,
                                   const struct db_opcua_session *session, const char *what,
                                   const char *of, enum db_may may, const char *drive)
{
	char why[256];

	if (!session)
		return UA_STATUSCODE_BADUSERACCESSDENIED;
	db_grant_explain(&session->grant, may, drive, why, sizeof(why));
	access->note(access->context, &(struct db_plant_note){ .kind = "denied",
	                                                       .what = what,
	                                                       .user = session->user,
	                                                       .from = session->from,
	                                                       .drive = of,
	                                                       .text = why,
	                                                       .refused = true });
	return UA_STATUSCODE_BADUSERACCESSDENIED;
}

static struct db_opcua_need need_of(UA_Server *server, const UA_NodeId *node, void *node_context)
{
	return db_opcua_nodes_need(UA_Server_getConfig(server)->context, node, node_context);
}

static bool has(const struct db_opcua_session *session, const struct db_opcua_need *need)
{
	return session && need->may < DB_MAYS &&
	       db_grant_has(&session->grant, need->may, need->drive);
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

/* What everybody may who is let in. */
#define READ_LEVEL (UA_ACCESSLEVELMASK_READ | UA_ACCESSLEVELMASK_HISTORYREAD)

static UA_Byte get_access_level(UA_Server *server, UA_AccessControl *control, const UA_NodeId *id,
                                void *session_context, const UA_NodeId *node, void *node_context)
{
	const struct db_opcua_session *session = db_opcua_access_find(control->context, id);
	struct db_opcua_need need = need_of(server, node, node_context);

	(void)session_context;
	if (has(session, &need))
		return READ_LEVEL | UA_ACCESSLEVELMASK_WRITE;
	/* Also who reads is asked about here. */
	if (need.written && need.name) {
		char deed[32];

		snprintf(deed, sizeof(deed), "write %s", need.name);
		(void)db_opcua_access_deny(control->context, session, deed, need.of, need.may,
		                           need.drive);
	}
	return READ_LEVEL;
}

/* Also to be read by clients, as an attribute. */
static UA_Boolean get_executable(UA_Server *server, UA_AccessControl *control, const UA_NodeId *id,
                                 void *session_context, const UA_NodeId *method,
                                 void *method_context)
{
	struct db_opcua_need need = need_of(server, method, method_context);

	(void)session_context;
	/* The library's own methods concern the caller's subscriptions. */
	return method->namespaceIndex == 0 ||
	       has(db_opcua_access_find(control->context, id), &need);
}

/* Only for calls. */
static UA_Boolean get_executable_on_object(UA_Server *server, UA_AccessControl *control,
                                           const UA_NodeId *id, void *session_context,
                                           const UA_NodeId *method, void *method_context,
                                           const UA_NodeId *object, void *object_context)
{
	struct db_opcua_need need = need_of(server, method, method_context);

	(void)object;
	(void)object_context;
	if (get_executable(server, control, id, session_context, method, method_context))
		return true;
	if (need.name)
		(void)db_opcua_access_deny(control->context,
		                           db_opcua_access_find(control->context, id), need.name,
		                           need.of, need.may, need.drive);
	return false;
}

/* No client changes the address space. Without such a function the library allows it to
 * everybody. */
#define DENY(name, item_type)                                                   \
	static UA_Boolean name(UA_Server *server, UA_AccessControl *control,    \
	                       const UA_NodeId *session, void *session_context, \
	                       const item_type *item)                           \
	{                                                                       \
		(void)server;                                                   \
		(void)control;                                                  \
		(void)session;                                                  \
		(void)session_context;                                          \
		(void)item;                                                     \
		return false;                                                   \
	}

DENY(allow_add_node, UA_AddNodesItem)
DENY(allow_add_reference, UA_AddReferencesItem)
DENY(allow_delete_node, UA_DeleteNodesItem)
DENY(allow_delete_reference, UA_DeleteReferencesItem)

#undef DENY

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

/* Only to the same user. */
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

/* --- configuration ---------------------------------------------------------------------------- */

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

/* The best first, and with the highest level: clients that choose by themselves use one or the
 * other. */
static UA_StatusCode add_policies(UA_ServerConfig *settings, const UA_ByteString *certificate,
                                  const UA_ByteString *key, bool none)
{
	static const UA_MessageSecurityMode modes[] = { UA_MESSAGESECURITYMODE_SIGNANDENCRYPT,
		                                        UA_MESSAGESECURITYMODE_SIGN };
	UA_StatusCode status = UA_ServerConfig_addSecurityPolicyAes256Sha256RsaPss(
		settings, certificate, key);

	if (status == UA_STATUSCODE_GOOD)
		status = UA_ServerConfig_addSecurityPolicyAes128Sha256RsaOaep(settings, certificate,
		                                                              key);
	if (status == UA_STATUSCODE_GOOD)
		status = UA_ServerConfig_addSecurityPolicyBasic256Sha256(settings, certificate,
		                                                         key);
	for (size_t m = 0; m < sizeof(modes) / sizeof(modes[0]); m++) {
		for (size_t i = 0;
		     i < settings->securityPoliciesSize && status == UA_STATUSCODE_GOOD; i++)
			status = UA_ServerConfig_addEndpoint(
				settings, settings->securityPolicies[i].policyUri, modes[m]);
	}
	for (size_t i = 0; i < settings->endpointsSize; i++)
		settings->endpoints[i].securityLevel = (UA_Byte)(settings->endpointsSize - i);
	for (size_t i = 0; i < settings->securityPoliciesSize; i++)
		db_opcua_security_mend(&settings->securityPolicies[i]);
	/* Without it no client could ask for the endpoints. */
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
	UA_StatusCode status = db_opcua_security_load(access->config, &access->own);
	UA_ByteString certificate = db_opcua_security_bytes(&access->own.certificate);
	UA_ByteString key = db_opcua_security_bytes(&access->own.key);

	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_security_guard(access->config, &settings->secureChannelPKI);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_security_guard(access->config, &settings->sessionPKI);
	if (status == UA_STATUSCODE_GOOD)
		status = set_control(access, &settings->accessControl);
	if (status == UA_STATUSCODE_GOOD)
		status = add_policies(settings, &certificate, &key,
		                      access->config->none == DB_OPCUA_READ);
	return status;
}

void db_opcua_access_renew(struct db_opcua_access *access)
{
	UA_ServerConfig *settings = UA_Server_getConfig(access->server);
	UA_StatusCode status = UA_STATUSCODE_GOOD;
	UA_ByteString certificate;
	UA_ByteString key;

	if (!db_opcua_security_renew(access->config, &access->own))
		return;
	certificate = db_opcua_security_bytes(&access->own.certificate);
	key = db_opcua_security_bytes(&access->own.key);
	/* The library's own function for this looks for the former certificate in the endpoints,
	 * which have none of their own (seen in 1.4.11): they show that of their policy. Sessions
	 * and their channels go on. */
	for (size_t i = 0; status == UA_STATUSCODE_GOOD && i < settings->securityPoliciesSize;
	     i++) {
		UA_SecurityPolicy *policy = &settings->securityPolicies[i];

		status = policy->updateCertificateAndPrivateKey(policy, certificate, key);
	}
	if (status != UA_STATUSCODE_GOOD)
		db_client_log(DB_CLIENT_ERROR,
		              "the certificate cannot be changed: %s; restart this program",
		              UA_StatusCode_name(status));
}

void db_opcua_access_look(struct db_opcua_access *access, int64_t us)
{
	db_opcua_security_look(access->config, &access->own, us);
}

int64_t db_opcua_access_certificate_ends(const struct db_opcua_access *access)
{
	return access->own.facts.ends;
}
