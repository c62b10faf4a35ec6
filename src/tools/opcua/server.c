/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/server.h"
#include "opcua/about.h"
#include "opcua/access.h"
#include "opcua/acting.h"
#include "opcua/events.h"
#include "opcua/history.h"
#include "opcua/network.h"
#include "opcua/nodes.h"
#include "opcua/plant.h"
#include "opcua/trail.h"
#include "opcua/values.h"

#include "client/clock.h"
#include "client/log.h"
#include "client/program.h"
#include "drivebridge/version.h"

#include <errno.h>
#include <open62541/server.h>
#include <open62541/server_config_default.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>

/* Bytes of a request, and the number of its items. */
#define CHUNK_SIZE 65535
#define MESSAGE_MAX (1024 * 1024)
#define CHUNKS_MAX 32
#define OPERATIONS_MAX 5000

/* Limits for requests that take longer: all other clients wait for the items of one request, and
 * the answer with all references of these nodes has to fit in a message. */
#define BROWSE_MAX 100
#define ITEMS_PER_CALL_MAX 1000

/* Writes and calls of a request: each waits for a drive. */
#define ACTIONS_MAX 100

/* Faster sampling shows nothing more: buses have cycles of milliseconds. */
#define SAMPLING_MIN_MS 10

/* How often a client that waits to be connected to is tried. */
#define REVERSE_INTERVAL_MS 2000

/* Values and events that wait in a monitored item for the next publishing: each takes some hundred
 * bytes. Room for two of each of 32 drives, a fault and its alarm; a client with more drives can
 * subscribe to them one by one. */
#define QUEUE_MAX 80

/* How often sessions with moving drives are checked for signs of life. */
#define LISTEN_INTERVAL (100 * DB_NS_PER_MS)

/* How long clients wait for the first answers of the service: until then nodes of drives that a
 * client knows would be unknown, and some clients do not ask for such nodes again. */
#define FIRST_DRIVES_WITHIN (3 * DB_NS_PER_S)

struct db_opcua_server {
	const struct db_opcua_config *config;
	db_time serves_from; /* at the latest; 0: it serves */
	sd_event *loop;
	struct db_opcua_network *network;
	struct db_waker network_waker;
	struct db_opcua_access *access;
	struct db_opcua_acting *acting;
	struct db_opcua_plant *plant;
	struct db_opcua_nodes *nodes;
	UA_Server *library;
};

/* --- between the rooms ------------------------------------------------------------------------ */

static UA_StatusCode write_clock(void *context, const UA_NodeId *session, const char *token)
{
	struct db_opcua_server *server = context;

	return db_opcua_access_set_token(server->access, session, token) ?
	               UA_STATUSCODE_GOOD :
	               UA_STATUSCODE_BADUSERACCESSDENIED;
}

static int64_t tell_certificate_ends(void *context)
{
	const struct db_opcua_server *server = context;

	return db_opcua_access_certificate_ends(server->access);
}

/* A result of the service, or an error of its calls, as a status of OPC UA. */
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
		{ "NoSuchAlarm", UA_STATUSCODE_BADEVENTIDUNKNOWN },
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
		{ "line_moves", UA_STATUSCODE_BADRESOURCEUNAVAILABLE },
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

/* Stores the outcome in the drive. */
static void keep_outcome(struct db_opcua_drive *drive, const struct db_opcua_outcome *outcome)
{
	db_opcua_plant_outdate(drive);
	snprintf(drive->result, sizeof(drive->result), "%s", outcome->result);
	snprintf(drive->reason, sizeof(drive->reason), "%s", outcome->reason);
}

/* For whom the service is called. Fills it in, and returns it. */
static const struct db_opcua_actor *actor_of(const struct db_opcua_server *server,
                                             const struct db_opcua_session *session,
                                             struct db_opcua_actor *actor)
{
	*actor = (struct db_opcua_actor){
		.session = session->number,
		.user = session->user,
		.label = session->label,
		.from = db_opcua_plant_has_audit(server->plant) ? session->from : "",
		.token = session->token,
		.stops_only = session->stops_only,
	};
	return actor;
}

static UA_StatusCode run_command(void *context, const UA_NodeId *id, struct db_opcua_drive *drive,
                                 const char *command, json_t *arguments)
{
	struct db_opcua_server *server = context;
	const struct db_opcua_session *session = db_opcua_access_find(server->access, id);
	const char *needed = drive->name;
	enum db_may needs = db_may_of_command(command, &needed);
	struct db_opcua_outcome outcome;
	struct db_opcua_actor actor;

	if (!session || !db_grant_has(&session->grant, needs, needed)) {
		json_decref(arguments);
		return db_opcua_access_deny(server->access, session, command, drive->name, needs,
		                            needed);
	}
	db_opcua_acting_run(server->acting, actor_of(server, session, &actor), drive->name, command,
	                    db_opcua_plant_is_stop(server->plant, command), arguments, &outcome);
	keep_outcome(drive, &outcome);
	return status_of(&outcome);
}

/* The name of the command being written, also of one that waits for group_start; "" when the drive
 * has none of this code. NULL: the item is no command. */
static const char *command_of(const struct db_opcua_item *item, const json_t *value)
{
	size_t i;
	json_t *command;

	if (item->reg->group != DB_OPCUA_COMMAND ||
	    (strcmp(item->reg->name, "command") != 0 &&
	     strcmp(item->reg->name, "staged_command") != 0))
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
	const char *written = command_of(item, value);
	const char *command = strcmp(item->reg->name, "command") == 0 ? written : NULL;
	const char *drive = item->drive->name;
	enum db_may needs = written ? db_may_of_command(written, &drive) :
	                              db_may_of_write(drive, item->reg->name,
	                                              json_number_value(value));
	struct db_opcua_outcome outcome;
	struct db_opcua_actor actor;
	char deed[32];

	if (!session || !db_grant_has(&session->grant, needs, drive)) {
		snprintf(deed, sizeof(deed), "write %s", item->reg->name);
		return db_opcua_access_deny(server->access, session,
		                            written && written[0] ? written : deed,
		                            item->drive->name, needs, drive);
	}
	db_opcua_acting_write(server->acting, actor_of(server, session, &actor), item->drive->name,
	                      item->reg->name, value, item->reg->group == DB_OPCUA_COMMAND, command,
	                      command && db_opcua_plant_is_stop(server->plant, command), &outcome);
	keep_outcome(item->drive, &outcome);
	/* OPC UA's status for a value that was passed on and is not verified. */
	return outcome.pending ? UA_STATUSCODE_GOODCOMPLETESASYNCHRONOUSLY : status_of(&outcome);
}

static UA_StatusCode acknowledge(void *context, const UA_NodeId *id,
                                 const struct db_opcua_alarm *alarm, const char *comment)
{
	struct db_opcua_server *server = context;
	const struct db_opcua_session *session = db_opcua_access_find(server->access, id);
	/* What is of no single drive may be acknowledged by whoever moves one. */
	const char *drive = strcmp(alarm->kind, "drive") == 0 ? alarm->name : NULL;
	struct db_opcua_outcome outcome;
	struct db_opcua_actor actor;

	if (!session || !db_grant_has(&session->grant, DB_MAY_MOVE, drive))
		return db_opcua_access_deny(server->access, session, "acknowledge", drive,
		                            DB_MAY_MOVE, drive);
	db_opcua_acting_acknowledge(server->acting, actor_of(server, session, &actor),
	                            alarm->number, comment, &outcome);
	return outcome.pending ? UA_STATUSCODE_BADREQUESTNOTCOMPLETE : status_of(&outcome);
}

static UA_StatusCode may_read_trail(void *context, const UA_NodeId *id, const char *drive,
                                    unsigned *number)
{
	struct db_opcua_server *server = context;
	const struct db_opcua_session *session = db_opcua_access_find(server->access, id);

	if (!session || !db_grant_has(&session->grant, DB_MAY_AUDIT, drive))
		return db_opcua_access_deny(server->access, session, "audit", drive, DB_MAY_AUDIT,
		                            drive);
	*number = session->number;
	return UA_STATUSCODE_GOOD;
}

static void on_end(void *context, const char *name, const struct db_opcua_outcome *outcome)
{
	struct db_opcua_server *server = context;
	struct db_opcua_drive *drive = db_opcua_plant_find(server->plant, name);

	if (drive)
		keep_outcome(drive, outcome);
}

/* Sessions that were active lately keep their motions alive. */
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

static void note(void *context, const struct db_plant_note *said)
{
	const struct db_opcua_server *server = context;

	db_opcua_plant_note(server->plant, said);
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

static UA_StatusCode describe(UA_ServerConfig *settings, const struct db_opcua_config *config)
{
	bool numeric6 = strchr(config->address, ':') != NULL;
	char uri[DB_OPCUA_URI_MAX];
	char text[300];

	set_text(&settings->buildInfo.productUri, "urn:drivebridge");
	set_text(&settings->buildInfo.manufacturerName, "drivebridge");
	set_text(&settings->buildInfo.productName, "drivebridge-opcua");
	set_text(&settings->buildInfo.softwareVersion, DB_VERSION);
	set_text(&settings->buildInfo.buildNumber, DB_VERSION);
	settings->buildInfo.buildDate = UA_DateTime_fromUnixTime(DB_BUILD_TIME);
	db_opcua_config_server(config, uri);
	set_text(&settings->applicationDescription.applicationUri, uri);
	set_text(&settings->applicationDescription.productUri, "urn:drivebridge");
	snprintf(text, sizeof(text), "drivebridge on %s", config->gateway);
	UA_LocalizedText_clear(&settings->applicationDescription.applicationName);
	settings->applicationDescription.applicationName = UA_LOCALIZEDTEXT_ALLOC("en", text);
	snprintf(text, sizeof(text), "opc.tcp://%s%s%s:%u", numeric6 ? "[" : "", config->address,
	         numeric6 ? "]" : "", config->port);
	UA_Array_delete(settings->serverUrls, settings->serverUrlsSize, &UA_TYPES[UA_TYPES_STRING]);
	settings->serverUrls = UA_Array_new(1, &UA_TYPES[UA_TYPES_STRING]);
	settings->serverUrlsSize = settings->serverUrls ? 1 : 0;
	if (!settings->serverUrls)
		return UA_STATUSCODE_BADOUTOFMEMORY;
	settings->serverUrls[0] = UA_STRING_ALLOC(text);
	return UA_STATUSCODE_GOOD;
}

/* Sets a limit for everything that a client can request. */
static void set_limits(UA_ServerConfig *settings, const struct db_opcua_config *config)
{
	settings->tcpBufSize = CHUNK_SIZE;
	settings->tcpMaxMsgSize = MESSAGE_MAX;
	settings->tcpMaxChunks = CHUNKS_MAX;
	/* The network chooses better which connection makes room, and the access which session. */
	settings->maxSecureChannels = DB_OPCUA_NETWORK_PLACES + (UA_UInt16)config->sessions;
	settings->maxSessions = DB_OPCUA_NETWORK_PLACES + (UA_UInt16)config->sessions;
	settings->reverseReconnectInterval = REVERSE_INTERVAL_MS;
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
	/* Every item may have a changing value: all together stay below the unit's memory limit.
	 * Many clients ask for a queue of 1 for events as well, which means the server's minimum
	 * (OPC 10000-4, 7.21): with two events at once a queue of one would keep one, or none but
	 * the overflow event. For values with a queue of 1 the library keeps 1, whatever the
	 * minimum is. */
	settings->queueSizeLimits = (UA_UInt32Range){ QUEUE_MAX, QUEUE_MAX };
	settings->maxPublishReqPerSession = 20;
	settings->maxAsyncOperationQueueSize = 1;
	settings->historizingEnabled = true;
	settings->accessHistoryDataCapability = true;
	settings->maxReturnDataValues = DB_OPCUA_HISTORY_PAGE;
	settings->accessHistoryEventsCapability = true;
	settings->maxReturnEventValues = DB_OPCUA_TRAIL_PAGE;
}

/* The library takes the configuration over, even if it fails. */
static UA_Server *new_library(struct db_opcua_server *server)
{
	UA_ServerConfig settings;
	UA_StatusCode status;

	memset(&settings, 0, sizeof(settings));
	settings.nodestore = db_opcua_nodes_store(server->nodes);
	db_opcua_network_give(server->network, &settings);
	status = UA_ServerConfig_setBasics_withPort(&settings, (UA_UInt16)server->config->port);
	if (status == UA_STATUSCODE_GOOD)
		status = describe(&settings, server->config);
	if (status == UA_STATUSCODE_GOOD) {
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

struct db_opcua_server *db_opcua_server_new(sd_event *loop, const struct db_opcua_config *config)
{
	static const struct db_opcua_nodes_ops node_ops = {
		.write = write_register,
		.write_clock = write_clock,
		.certificate_ends = tell_certificate_ends,
		.run = run_command,
		.acknowledge = acknowledge,
		.may_read_trail = may_read_trail,
	};
	struct db_opcua_server *server = calloc(1, sizeof(*server));
	UA_StatusCode status = UA_STATUSCODE_BADOUTOFMEMORY;

	if (!server)
		return NULL;
	server->loop = loop;
	server->config = config;
	server->serves_from = db_client_now() + FIRST_DRIVES_WITHIN;
	server->network = db_opcua_network_new(2 * (config->sessions + DB_OPCUA_STOP_PLACES),
	                                       forget_connection, go_on, server);
	server->access = db_opcua_access_new(config, server->network, lose_session, note, server);
	server->acting = db_opcua_acting_new(loop, config, server->network, on_end, feed, server);
	server->nodes = db_opcua_nodes_new(loop, config, &node_ops, server);
	server->plant = db_opcua_plant_new(loop, config, &db_opcua_nodes_plant_ops, server->nodes);
	if (server->network && server->access && server->acting && server->plant && server->nodes)
		server->library = new_library(server);
	if (server->library)
		status = db_opcua_access_watch(server->access, server->library);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_nodes_begin(server->nodes, server->library, server->plant);
	if (status == UA_STATUSCODE_GOOD)
		status = db_opcua_about_set_up(server->library, config, MESSAGE_MAX);
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
	/* A client that cannot be reached is tried again by the library. */
	for (const char *at = config->reverse_connect.names; at && *at; at += strlen(at) + 1)
		(void)UA_Server_addReverseConnect(server->library, db_opcua_string(at), NULL, NULL,
		                                  NULL);
	db_client_log(DB_CLIENT_NOTICE, "listens on opc.tcp://%s:%u",
	              config->address[0] ? config->address : config->gateway,
	              db_opcua_network_port(server->network));
	return server;
}

void db_opcua_server_free(struct db_opcua_server *server)
{
	if (!server)
		return;
	(void)db_waker_take(&server->network_waker);
	if (server->library) {
		(void)UA_Server_run_shutdown(server->library);
		(void)UA_Server_delete(server->library);
	}
	/* Before what it reports the ends of its calls to. */
	db_opcua_acting_free(server->acting);
	db_opcua_nodes_free(server->nodes);
	db_opcua_plant_free(server->plant);
	db_opcua_network_free(server->network);
	db_opcua_access_free(server->access);
	free(server);
}

/* --- its loop --------------------------------------------------------------------------------- */

static void serve(struct db_opcua_server *server)
{
	if (server->serves_from != 0)
		return;
	db_opcua_access_begin(server->access);
	/* The library mistakes a closed connection for one without data when errno is still set. */
	errno = 0;
	(void)UA_Server_run_iterate(server->library, false);
}

void db_opcua_server_renew(void *context)
{
	struct db_opcua_server *server = context;

	db_opcua_access_renew(server->access);
}

db_time db_opcua_server_turn(void *context, db_time now, int64_t us)
{
	struct db_opcua_server *server = context;
	db_time due;
	db_time other;

	db_opcua_access_look(server->access, us);
	(void)db_waker_take(&server->network_waker);
	due = db_opcua_plant_tend(server->plant, now);
	other = db_opcua_nodes_tend(server->nodes, now);
	if (other < due)
		due = other;
	if (db_opcua_plant_is_known(server->plant) || now >= server->serves_from)
		server->serves_from = 0;
	db_opcua_acting_begin(server->acting, now);
	db_opcua_access_review(server->access);
	db_opcua_network_flush(server->network, now);
	serve(server);
	/* For example, closing connections. */
	if (db_opcua_network_is_busy(server->network))
		serve(server);
	feed(server, now);
	if (server->serves_from == 0)
		db_waker_arm(&server->network_waker, server->loop,
		             db_opcua_network_fd(server->network), EPOLLIN);
	else if (server->serves_from < due)
		due = server->serves_from;
	other = db_opcua_network_due(server->network, now);
	if (other < due)
		due = other;
	/* An overdue feeding belongs to a session that shows no sign of life. */
	other = db_opcua_acting_due(server->acting);
	if (other < now)
		other = now + LISTEN_INTERVAL;
	return other < due ? other : due;
}
