/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/server.h"
#include "opcua/access.h"
#include "opcua/acting.h"
#include "opcua/events.h"
#include "opcua/network.h"
#include "opcua/nodes.h"
#include "opcua/plant.h"

#include "client/log.h"
#include "drivebridge/version.h"

#include <errno.h>
#include <open62541/server.h>
#include <open62541/server_config_default.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Bytes of a request, and how many things it may ask for. */
#define CHUNK_SIZE 65535
#define MESSAGE_MAX (1024 * 1024)
#define CHUNKS_MAX 32
#define OPERATIONS_MAX 5000

/* Of those that take longer: what one client asks for in one request is what all others wait for, and the answer to what all
 * of these nodes refer to is a message of a size that there may be. */
#define BROWSE_MAX 100
#define ITEMS_PER_CALL_MAX 1000

/* Things that it may do: each waits for a drive. */
#define ACTIONS_MAX 100

/* Faster sampling than this shows nothing: buses have cycles of milliseconds. */
#define SAMPLING_MIN_MS 10

/* Values and events that wait in a monitored item for the next publishing: each takes some hundred bytes. Room for one event
 * of each of 32 drives; who has more drives follows them one by one. */
#define QUEUE_MAX 40

/* How often it is looked whether a session that moves something is heard again. */
#define LISTEN_INTERVAL (100 * DB_NS_PER_MS)

struct db_opcua_server {
	const struct db_opcua_config *config;
	struct db_opcua_network *network;
	struct db_opcua_access *access;
	struct db_opcua_acting *acting;
	struct db_opcua_plant *plant;
	struct db_opcua_nodes *nodes;
	UA_Server *library;
};

/* --- between the rooms ------------------------------------------------------------------------ */

static void add_drive(void *context, struct db_opcua_drive *drive, const json_t *description)
{
	struct db_opcua_server *server = context;

	db_opcua_nodes_add(server->nodes, drive, description);
}

static void replace_drive(void *context, const struct db_opcua_drive *before,
                          struct db_opcua_drive *drive, const json_t *description)
{
	struct db_opcua_server *server = context;

	db_opcua_nodes_replace(server->nodes, before, drive, description);
}

static void remove_drive(void *context, struct db_opcua_drive *drive)
{
	struct db_opcua_server *server = context;

	db_opcua_nodes_remove(server->nodes, drive);
}

static void set_buses(void *context, json_t *buses)
{
	struct db_opcua_server *server = context;

	db_opcua_nodes_set_buses(server->nodes, buses);
}

static void set_figures(void *context, json_t *buses)
{
	struct db_opcua_server *server = context;

	db_opcua_nodes_set_figures(server->nodes, buses);
}

static void take_event(void *context, const json_t *event)
{
	struct db_opcua_server *server = context;
	const char *drive = json_string_value(json_object_get(event, "drive"));
	UA_NodeId origin = db_opcua_nodes_of_drive(server->nodes, drive ? drive : "");

	db_opcua_events_tell(server->library, event, origin);
	UA_NodeId_clear(&origin);
}

static void fetch_item(void *context, struct db_opcua_item *item)
{
	struct db_opcua_server *server = context;

	db_opcua_plant_fetch(server->plant, item);
}

static UA_StatusCode read_clock(void *context, char token[DB_OPCUA_TOKEN_MAX])
{
	struct db_opcua_server *server = context;

	return db_opcua_plant_ask_clock(server->plant, token) ? UA_STATUSCODE_GOOD :
	                                                        UA_STATUSCODE_BADNOCOMMUNICATION;
}

static UA_StatusCode write_clock(void *context, const UA_NodeId *session, const char *token)
{
	struct db_opcua_server *server = context;

	return db_opcua_access_set_token(server->access, session, token) ?
	               UA_STATUSCODE_GOOD :
	               UA_STATUSCODE_BADUSERACCESSDENIED;
}

/* What a result of the service, or an error of its calls, is to a client of OPC UA. */
static UA_StatusCode status_of(const struct db_opcua_outcome *outcome)
{
	static const struct {
		const char *result;
		UA_StatusCode status;
	} statuses[] = {
		{ "ok", UA_STATUSCODE_GOOD },
		{ "unproven", UA_STATUSCODE_GOOD },
		{ "pending", UA_STATUSCODE_BADREQUESTNOTCOMPLETE },
		{ "refused", UA_STATUSCODE_BADINVALIDSTATE },
		{ "out_of_range", UA_STATUSCODE_BADOUTOFRANGE },
		{ "limit", UA_STATUSCODE_BADOUTOFRANGE },
		{ "BadValue", UA_STATUSCODE_BADOUTOFRANGE },
		{ "timeout", UA_STATUSCODE_BADTIMEOUT },
		{ "indeterminate", UA_STATUSCODE_BADUNKNOWNRESPONSE },
		{ "restarted", UA_STATUSCODE_BADINVALIDSTATE },
		{ "cancelled", UA_STATUSCODE_BADOPERATIONABANDONED },
		{ "latched", UA_STATUSCODE_BADINVALIDSTATE },
		{ "unsupported", UA_STATUSCODE_BADNOTSUPPORTED },
		{ "NoSuchCommand", UA_STATUSCODE_BADNOTSUPPORTED },
		{ "bus_down", UA_STATUSCODE_BADNOCOMMUNICATION },
		{ "offline", UA_STATUSCODE_BADNOCOMMUNICATION },
		{ "Unreachable", UA_STATUSCODE_BADNOCOMMUNICATION },
		{ "Lost", UA_STATUSCODE_BADNOCOMMUNICATION },
		{ "failed", UA_STATUSCODE_BADDEVICEFAILURE },
		{ "runs_on", UA_STATUSCODE_BADDEVICEFAILURE },
		{ "busy", UA_STATUSCODE_BADRESOURCEUNAVAILABLE },
		{ "Busy", UA_STATUSCODE_BADRESOURCEUNAVAILABLE },
		{ "rate_limited", UA_STATUSCODE_BADRESOURCEUNAVAILABLE },
		{ "not_in_control", UA_STATUSCODE_BADUSERACCESSDENIED },
		{ "NotAllowed", UA_STATUSCODE_BADUSERACCESSDENIED },
		{ "TooOld", UA_STATUSCODE_BADINVALIDTIMESTAMP },
	};

	for (size_t i = 0; i < sizeof(statuses) / sizeof(statuses[0]); i++) {
		if (strcmp(statuses[i].result, outcome->result) == 0)
			return statuses[i].status;
	}
	return UA_STATUSCODE_BADUNEXPECTEDERROR;
}

/* What is known of the drive from now on. */
static void keep_outcome(struct db_opcua_drive *drive, const struct db_opcua_outcome *outcome)
{
	db_opcua_plant_outdate(drive);
	(void)snprintf(drive->result, sizeof(drive->result), "%s", outcome->result);
	(void)snprintf(drive->reason, sizeof(drive->reason), "%s", outcome->reason);
}

static UA_StatusCode run_command(void *context, const UA_NodeId *id, struct db_opcua_drive *drive,
                                 const char *command, json_t *arguments)
{
	struct db_opcua_server *server = context;
	const struct db_opcua_session *session = db_opcua_access_find(server->access, id);
	struct db_opcua_outcome outcome;

	if (!session || session->role != DB_ROLE_OPERATOR) {
		json_decref(arguments);
		return UA_STATUSCODE_BADUSERACCESSDENIED;
	}
	db_opcua_acting_run(server->acting,
	                    &(struct db_opcua_actor){ .session = session->number,
	                                              .user = session->user,
	                                              .label = session->label,
	                                              .token = session->token,
	                                              .stops_only = session->stops_only },
	                    drive->name, command, arguments, &outcome);
	keep_outcome(drive, &outcome);
	return status_of(&outcome);
}

/* The command that is written, by its name; "" when the drive has none of this code. NULL: it is none. */
static const char *command_of(const struct db_opcua_item *item, const json_t *value)
{
	size_t i;
	json_t *command;

	if (item->reg->group != DB_OPCUA_COMMAND || strcmp(item->reg->name, "command") != 0)
		return NULL;
	json_array_foreach(item->drive->kind->commands, i, command)
	{
		if (json_equal(json_object_get(command, "code"), value))
			return json_string_value(json_object_get(command, "name"));
	}
	return "";
}

static UA_StatusCode write_register(void *context, const UA_NodeId *id, struct db_opcua_item *item,
                                    json_t *value)
{
	struct db_opcua_server *server = context;
	const struct db_opcua_session *session = db_opcua_access_find(server->access, id);
	struct db_opcua_outcome outcome;

	if (!session || session->role != DB_ROLE_OPERATOR)
		return UA_STATUSCODE_BADUSERACCESSDENIED;
	db_opcua_acting_write(server->acting,
	                      &(struct db_opcua_actor){ .session = session->number,
	                                                .user = session->user,
	                                                .label = session->label,
	                                                .token = session->token,
	                                                .stops_only = session->stops_only },
	                      item->drive->name, item->reg->name, value,
	                      item->reg->group == DB_OPCUA_COMMAND, command_of(item, value),
	                      &outcome);
	keep_outcome(item->drive, &outcome);
	/* OPC UA's own word for a value that was passed on and is not verified. */
	return outcome.pending ? UA_STATUSCODE_GOODCOMPLETESASYNCHRONOUSLY : status_of(&outcome);
}

static void take_end(void *context, const char *name, const struct db_opcua_outcome *outcome)
{
	struct db_opcua_server *server = context;
	struct db_opcua_drive *drive = db_opcua_plant_find(server->plant, name);

	if (drive)
		keep_outcome(drive, outcome);
}

/* Sessions that were heard lately keep what they move going. */
static void feed(void *context, db_time now)
{
	struct db_opcua_server *server = context;
	db_time silence = server->config->silence_ms * DB_NS_PER_MS;
	const struct db_opcua_session *session;
	size_t place = 0;

	while ((session = db_opcua_access_next(server->access, &place))) {
		db_time heard = db_opcua_network_heard(server->network, session->connection);

		if (heard > 0 && now - heard < silence)
			db_opcua_acting_feed(server->acting, session->number, now);
	}
}

static void lose_session(void *context, unsigned session)
{
	struct db_opcua_server *server = context;

	db_opcua_acting_drop(server->acting, session);
}

static void rewatch(void *context)
{
	struct db_opcua_server *server = context;

	db_opcua_plant_rewatch(server->plant);
}

static void count_watchers(UA_Server *library, const UA_NodeId *session, void *session_context,
                           const UA_NodeId *node, void *node_context, UA_UInt32 attribute,
                           UA_Boolean removed)
{
	(void)session;
	(void)session_context;
	(void)node_context;
	if (attribute == UA_ATTRIBUTEID_VALUE)
		db_opcua_nodes_watch(UA_Server_getConfig(library)->context, node, removed);
}

static void forget_connection(void *context, uintptr_t connection)
{
	struct db_opcua_server *server = context;

	db_opcua_access_forget_connection(server->access, connection);
}

static void go_on(void *context)
{
	struct db_opcua_server *server = context;

	db_opcua_acting_go_on(server->acting);
}

/* --- its life --------------------------------------------------------------------------------- */

static void set_text(UA_String *text, const char *value)
{
	UA_String_clear(text);
	*text = UA_STRING_ALLOC(value);
}

static void describe(UA_ServerConfig *settings, const struct db_opcua_config *config)
{
	char text[160];

	set_text(&settings->buildInfo.productUri, "urn:drivebridge");
	set_text(&settings->buildInfo.manufacturerName, "drivebridge");
	set_text(&settings->buildInfo.productName, "drivebridge-opcua");
	set_text(&settings->buildInfo.softwareVersion, DB_VERSION);
	set_text(&settings->buildInfo.buildNumber, DB_VERSION);
	(void)snprintf(text, sizeof(text), "urn:%s:drivebridge", config->gateway);
	set_text(&settings->applicationDescription.applicationUri, text);
	set_text(&settings->applicationDescription.productUri, "urn:drivebridge");
	(void)snprintf(text, sizeof(text), "drivebridge on %s", config->gateway);
	UA_LocalizedText_clear(&settings->applicationDescription.applicationName);
	settings->applicationDescription.applicationName = UA_LOCALIZEDTEXT_ALLOC("en", text);
}

/* Nothing that a client can ask for without a bound. */
static void set_limits(UA_ServerConfig *settings, const struct db_opcua_config *config)
{
	settings->tcpBufSize = CHUNK_SIZE;
	settings->tcpMaxMsgSize = MESSAGE_MAX;
	settings->tcpMaxChunks = CHUNKS_MAX;
	/* The network knows better whose connection makes room, and the access whose session. */
	settings->maxSecureChannels = DB_OPCUA_NETWORK_PLACES + (UA_UInt16)config->sessions;
	settings->maxSessions = DB_OPCUA_NETWORK_PLACES + (UA_UInt16)config->sessions;
	settings->maxSessionTimeout = 60.0 * 60.0 * 1000.0;
	settings->maxNodesPerRead = OPERATIONS_MAX;
	settings->maxNodesPerWrite = ACTIONS_MAX;
	settings->maxNodesPerMethodCall = ACTIONS_MAX;
	settings->maxNodesPerBrowse = BROWSE_MAX;
	settings->maxNodesPerRegisterNodes = OPERATIONS_MAX;
	settings->maxNodesPerTranslateBrowsePathsToNodeIds = OPERATIONS_MAX;
	settings->maxNodesPerNodeManagement = 1;
	settings->maxMonitoredItemsPerCall = ITEMS_PER_CALL_MAX;
	settings->maxReferencesPerNode = 0;
	settings->maxSubscriptions = config->sessions * config->subscriptions;
	settings->maxSubscriptionsPerSession = config->subscriptions;
	settings->publishingIntervalLimits = (UA_DurationRange){ SAMPLING_MIN_MS, 3600000.0 };
	settings->maxNotificationsPerPublish = 1000;
	settings->maxRetransmissionQueueSize = 10;
	settings->maxEventsPerNode = 100;
	settings->maxMonitoredItems = config->items;
	settings->maxMonitoredItemsPerSubscription = config->items;
	settings->samplingIntervalLimits = (UA_DurationRange){ SAMPLING_MIN_MS, 3600000.0 };
	/* Every item may be of a value that changes: all together stay below what the unit lets this program have. Many clients
	 * ask for a queue of 1 for events as well, which asks for the least that the server requires (OPC 10000-4, 7.21): of two
	 * at once it would keep one, or none but the word that something is missing. The library lets items of values that
	 * ask for 1 have 1, whatever the least is. */
	settings->queueSizeLimits = (UA_UInt32Range){ QUEUE_MAX, QUEUE_MAX };
	settings->maxPublishReqPerSession = 20;
	settings->maxAsyncOperationQueueSize = 1;
}

static UA_StatusCode set_url(UA_ServerConfig *settings, const struct db_opcua_config *config)
{
	bool numeric6 = strchr(config->address, ':') != NULL;
	char url[300];

	(void)snprintf(url, sizeof(url), "opc.tcp://%s%s%s:%u", numeric6 ? "[" : "",
	               config->address, numeric6 ? "]" : "", config->port);
	UA_Array_delete(settings->serverUrls, settings->serverUrlsSize, &UA_TYPES[UA_TYPES_STRING]);
	settings->serverUrls = UA_Array_new(1, &UA_TYPES[UA_TYPES_STRING]);
	settings->serverUrlsSize = settings->serverUrls ? 1 : 0;
	if (!settings->serverUrls)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	settings->serverUrls[0] = UA_STRING_ALLOC(url);
	return UA_STATUSCODE_GOOD;
}

/* The library takes the configuration over, also when that is in vain. */
static UA_Server *new_library(struct db_opcua_server *server)
{
	UA_ServerConfig settings;
	UA_StatusCode status;

	memset(&settings, 0, sizeof(settings));
	settings.nodestore = db_opcua_nodes_store(server->nodes);
	settings.logging = db_opcua_network_logger(server->network);
	settings.eventLoop = db_opcua_network_give_loop(server->network);
	status = UA_ServerConfig_setBasics_withPort(&settings, (UA_UInt16)server->config->port);
	if (status == UA_STATUSCODE_GOOD)
		status = set_url(&settings, server->config);
	if (status == UA_STATUSCODE_GOOD) {
		describe(&settings, server->config);
		set_limits(&settings, server->config);
		settings.monitoredItemRegisterCallback = count_watchers;
		status = db_opcua_access_set_up(server->access, &settings);
	}
	if (status != UA_STATUSCODE_GOOD) {
		db_client_log(DB_CLIENT_ERROR, "the server cannot be set up: %s",
		              UA_StatusCode_name(status));
		UA_ServerConfig_clean(&settings);
		return NULL;
	}
	return UA_Server_newWithConfig(&settings);
}

struct db_opcua_server *db_opcua_server_new(const struct db_opcua_config *config)
{
	static const struct db_opcua_plant_ops plant_ops = {
		.added = add_drive,
		.replaced = replace_drive,
		.removed = remove_drive,
		.buses = set_buses,
		.figures = set_figures,
		.event = take_event,
	};
	static const struct db_opcua_nodes_ops node_ops = {
		.fetch = fetch_item,
		.rewatch = rewatch,
		.write = write_register,
		.read_clock = read_clock,
		.write_clock = write_clock,
		.run = run_command,
	};
	struct db_opcua_server *server = calloc(1, sizeof(*server));
	UA_StatusCode status = UA_STATUSCODE_BADOUTOFMEMORY;

	if (!server)
		return NULL;
	server->config = config;
	server->network = db_opcua_network_new(2 * (config->sessions + DB_OPCUA_STOP_PLACES),
	                                       forget_connection, go_on, server);
	server->access = db_opcua_access_new(config, server->network, lose_session, server);
	server->acting = db_opcua_acting_new(config, server->network, take_end, feed, server);
	server->plant = db_opcua_plant_new(config, &plant_ops, server);
	server->nodes = db_opcua_nodes_new(config, &node_ops, server);
	if (server->network && server->access && server->acting && server->plant && server->nodes)
		server->library = new_library(server);
	if (server->library)
		status = db_opcua_access_watch(server->access, server->library);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_nodes_begin(server->nodes, server->library);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_events_set_up(server->library);
	if (status == UA_STATUSCODE_GOOD)
		status = UA_Server_run_startup(server->library);
	if (status != UA_STATUSCODE_GOOD || db_opcua_network_port(server->network) == 0) {
		db_client_log(DB_CLIENT_ERROR, "%s port %u: cannot listen there: %s",
		              config->address[0] ? config->address : "*", config->port,
		              UA_StatusCode_name(status));
		db_opcua_server_free(server);
		return NULL;
	}
	db_client_log(DB_CLIENT_NOTICE, "listens on opc.tcp://%s:%u",
	              config->address[0] ? config->address : config->gateway,
	              db_opcua_network_port(server->network));
	return server;
}

void db_opcua_server_free(struct db_opcua_server *server)
{
	if (!server)
		return;
	if (server->library) {
		(void)UA_Server_run_shutdown(server->library);
		(void)UA_Server_delete(server->library);
	}
	db_opcua_nodes_free(server->nodes);
	db_opcua_plant_free(server->plant);
	db_opcua_acting_free(server->acting);
	db_opcua_network_free(server->network);
	db_opcua_access_free(server->access);
	free(server);
}

/* --- its loop --------------------------------------------------------------------------------- */

size_t db_opcua_server_places(const struct db_opcua_server *server)
{
	return DB_OPCUA_PLANT_FDS + DB_OPCUA_ACTING_FDS + db_opcua_network_places(server->network);
}

size_t db_opcua_server_watch(const struct db_opcua_server *server, struct pollfd *fds, size_t room)
{
	const size_t own = DB_OPCUA_PLANT_FDS + DB_OPCUA_ACTING_FDS;

	db_opcua_plant_watch(server->plant, fds);
	db_opcua_acting_watch(server->acting, fds + DB_OPCUA_PLANT_FDS);
	return own + db_opcua_network_watch(server->network, DB_ROLE_NONE, fds + own, room - own);
}

db_time db_opcua_server_due(const struct db_opcua_server *server, db_time now)
{
	db_time due = db_opcua_network_due(server->network, now);
	db_time feeding;

	if (db_opcua_plant_due(server->plant) < due)
		due = db_opcua_plant_due(server->plant);
	/* What is due already belongs to a session that is not heard. */
	feeding = db_opcua_acting_due(server->acting);
	if (feeding < now)
		feeding = now + LISTEN_INTERVAL;
	return feeding < due ? feeding : due;
}

static void serve(struct db_opcua_server *server)
{
	db_opcua_access_begin(server->access);
	/* The library takes a connection that is closed for one that has nothing to say while errno says so. */
	errno = 0;
	(void)UA_Server_run_iterate(server->library, false);
}

void db_opcua_server_handle(struct db_opcua_server *server, db_time now, int64_t us)
{
	db_opcua_plant_handle(server->plant, now, us);
	db_opcua_acting_handle(server->acting, now);
	db_opcua_access_review(server->access);
	db_opcua_network_flush(server->network, now);
	serve(server);
	/* Such as closing connections. */
	if (db_opcua_network_is_busy(server->network))
		serve(server);
	feed(server, now);
}
