/* SPDX-License-Identifier: Apache-2.0 */
#include "web/server.h"
#include "client/log.h"
#include "drivebridge/version.h"
#include "web/admit.h"
#include "web/call.h"
#include "web/commission.h"
#include "web/door.h"
#include "web/gateway.h"
#include "web/health.h"
#include "web/login.h"
#include "web/metrics.h"
#include "web/overview.h"
#include "web/parameters.h"
#include "web/request.h"
#include "web/service.h"
#include "web/setup.h"
#include "web/stream.h"
#include "web/tabs.h"
#include "web/trail.h"
#include "web/trail_file.h"
#include "web/trail_search.h"
#include "web/trail_verify.h"
#include "web/users.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#define TICK_US ((uint64_t)(DB_WEB_CONNECTIONS_TICK / DB_NS_PER_US))
#define TICK_ACCURACY_US 5000

/* For a request's headers and the first part of an answer. */
#define CONNECTION_MEMORY ((size_t)16 * 1024)
/* A connection without traffic in either direction for this time is closed. */
#define CONNECTION_SILENT_S 10U

/* Most bytes read of a body that is refused; then the connection is closed. */
#define HEARD_MAX ((size_t)64 * 1024)

/* The library always has something to do while a greeting of TLS is unfinished (seen in 0.9.75 and
 * 1.0.1): after so many runs in a row the next one waits this long. */
#define RUNS_AT_ONCE 1
#define PAUSE_US 2000
#define PAUSE_ACCURACY_US 1
/* Strangers that come all the time cost a quarter of a processor: after a run nothing is done for
 * three times as long as it took. */
#define REST_FACTOR 3
#define REST_MAX DB_NS_PER_MS

#define READ_WITHIN (10 * DB_NS_PER_S)
/* Drives that are moved by a held button are stopped before this program ends, if possible, within
 * this time. */
#define END_WITHIN (4 * DB_NS_PER_S)
/* Runs of the daemon at the end, for the remaining answers. */
#define END_TURNS 16

/* --- requests --------------------------------------------------------------------------------- */

static void answer_file(struct db_web_request *request)
{
	const struct db_web_file *file = db_web_page_find(request->server->page,
	                                                  request->route.name);
	const char *known = MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND,
	                                                MHD_HTTP_HEADER_IF_NONE_MATCH);

	if (!file) {
		db_web_request_refuse(request, MHD_HTTP_NOT_FOUND, "NoSuchPath",
		                      "there is nothing of this name");
		return;
	}
	request->file = file;
	request->type = file->type;
	request->status = known && strstr(known, file->etag) ? MHD_HTTP_NOT_MODIFIED : MHD_HTTP_OK;
}

static bool parse_body(struct db_web_request *request)
{
	json_error_t error;

	if (request->too_long) {
		db_web_request_refuse(request, MHD_HTTP_CONTENT_TOO_LARGE, "TooLong",
		                      "the body may have %zu bytes",
		                      db_web_body_max(&request->route));
		return false;
	}
	request->parameters = request->used > 0 ? json_loadb(request->body, request->used,
	                                                     JSON_REJECT_DUPLICATES, &error) :
	                                          json_object();
	if (json_is_object(request->parameters))
		return true;
	db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
	                      "the body is no JSON object");
	return false;
}

static void make_call(struct db_web_request *request)
{
	if (request->route.acts)
		db_web_tabs_act(request);
	else
		db_web_call(request, db_web_service_reader(request->server->service), READ_WITHIN);
}

static void tell_moment(struct db_web_request *request)
{
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:I}", "moment", (json_int_t)db_web_moment()));
}

/* What a page sends by itself keeps no session. */
static bool is_of_a_person(enum db_web_kind kind)
{
	return kind != DB_WEB_ALIVE && kind != DB_WEB_CLOCK && kind != DB_WEB_COMMISSION_SAY &&
	       kind != DB_WEB_HEALTH && kind != DB_WEB_ALARMS;
}

static void dispatch(struct db_web_request *request)
{
	static void (*const handlers[])(struct db_web_request * request) = {
		[DB_WEB_FILE] = answer_file,
		[DB_WEB_SESSION] = db_web_login_tell,
		[DB_WEB_METRICS] = db_web_metrics,
		[DB_WEB_LOGIN] = db_web_login,
		[DB_WEB_LOGOUT] = db_web_logout,
		[DB_WEB_SESSIONS] = db_web_login_own,
		[DB_WEB_SESSIONS_END] = db_web_login_own,
		[DB_WEB_PASSWORD] = db_web_users_take,
		[DB_WEB_USERS] = db_web_users_take,
		[DB_WEB_USERS_PUT] = db_web_users_take,
		[DB_WEB_USERS_REMOVE] = db_web_users_take,
		[DB_WEB_ALIVE] = db_web_tabs_keep_alive,
		[DB_WEB_CLOCK] = tell_moment,
		[DB_WEB_JOG] = db_web_tabs_jog,
		[DB_WEB_SEQUENCE] = db_web_tabs_sequence,
		[DB_WEB_COMMISSION] = db_web_commission_take,
		[DB_WEB_COMMISSION_SAY] = db_web_commission_take,
		[DB_WEB_COMMISSION_STEPS] = db_web_commission_take,
		[DB_WEB_PARAMETERS] = db_web_parameters_take,
		[DB_WEB_PARAMETERS_END] = db_web_parameters_take,
		[DB_WEB_PARAMETERS_FILE] = db_web_parameters_take,
		[DB_WEB_PARAMETERS_READ] = db_web_parameters_take,
		[DB_WEB_SETUP] = db_web_setup_begin,
		[DB_WEB_SETUP_SAY] = db_web_setup_hear,
		[DB_WEB_CALL] = make_call,
		[DB_WEB_CONFIGURATION] = make_call,
		[DB_WEB_STREAM] = db_web_stream_begin,
		[DB_WEB_OVERVIEW] = db_web_overview_begin,
		[DB_WEB_TRAIL_SEARCH] = db_web_trail_search,
		[DB_WEB_TRAIL_VERIFY] = db_web_trail_verify,
		[DB_WEB_TRAIL_FILE] = db_web_trail_file,
		[DB_WEB_GATEWAY] = db_web_gateway,
		[DB_WEB_HEALTH] = db_web_health,
		[DB_WEB_ALARMS] = db_web_alarms,
		[DB_WEB_ACKNOWLEDGE] = db_web_acknowledge,
	};
	enum db_web_kind kind = request->route.kind;

	if (request->server->ending) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Stopping",
		                      "this server is being stopped");
		return;
	}
	/* The user may have been removed since its headers came, or have another role. */
	if (request->session[0] != '\0') {
		db_web_login_review(request->server);
		db_web_admit_again(request);
	}
	if (request->status != 0 || (kind != DB_WEB_FILE && !parse_body(request)))
		return;
	if (request->route.needs > DB_MAY_LOOK)
		db_web_admit_content(request);
	if (request->status != 0)
		return;
	if (request->session[0] != '\0' && is_of_a_person(kind))
		db_web_sessions_touch(request->server->sessions, request->session, db_client_now());
	if (handlers[kind])
		handlers[kind](request);
	else
		db_web_request_refuse(request, MHD_HTTP_NOT_FOUND, "NoSuchPath",
		                      "there is nothing of this name");
}

static enum MHD_Result begin_request(struct db_web_server *server,
                                     struct MHD_Connection *connection, const char *url,
                                     const char *method, void **context)
{
	struct db_web_request *request = calloc(1, sizeof(*request));
	const union MHD_ConnectionInfo *info;

	if (!request)
		return MHD_NO;
	server->counts.requests++;
	request->server = server;
	request->connection = connection;
	request->number = ++server->last_number;
	request->answer_by = DB_TIME_NEVER;
	request->next = server->requests;
	server->requests = request;
	*context = request;
	request->route = db_web_route_find(method, url);
	db_web_admit(request);
	/* A connection with whole headers ranks above one that has sent none. */
	info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
	request->place = info ? info->socket_context : NULL;
	if (request->place) {
		request->place->heard = true;
		request->place->known = request->session[0] != '\0';
		request->place->busy = true;
		request->place->receives = true;
	}
	/* A refused body is read to its end first: an answer in the middle of it may be lost with
	 * the connection. */
	return request->status == MHD_HTTP_CONTENT_TOO_LARGE ? db_web_request_send(request) :
	                                                       MHD_YES;
}

static void add_body(struct db_web_request *request, const char *bytes, size_t count)
{
	char *grown;

	if (request->too_long || count > db_web_body_max(&request->route) - request->used) {
		request->too_long = true;
		return;
	}
	grown = realloc(request->body, request->used + count);
	if (!grown) {
		request->too_long = true;
		return;
	}
	memcpy(grown + request->used, bytes, count);
	request->body = grown;
	request->used += count;
}

static enum MHD_Result handle_request(void *data, struct MHD_Connection *connection,
                                      const char *url, const char *method, const char *version,
                                      const char *upload, size_t *upload_size, void **context)
{
	struct db_web_request *request = *context;

	(void)version;
	if (!request)
		return begin_request(data, connection, url, method, context);
	if (*upload_size > 0) {
		if (request->status == 0)
			add_body(request, upload, *upload_size);
		request->received += *upload_size;
		*upload_size = 0;
		return request->received <= HEARD_MAX ? MHD_YES : MHD_NO;
	}
	if (request->place)
		request->place->receives = false;
	if (!request->taken && request->status == 0) {
		/* The daemon keeps the path valid while the connection is with it. */
		dispatch(request);
		request->taken = true;
		if (request->place)
			request->place->waits = request->status == 0 || request->stream;
	}
	if (request->status != 0)
		return db_web_request_send(request);
	request->suspended = true;
	MHD_suspend_connection(connection);
	return MHD_YES;
}

static void end_request(void *data, struct MHD_Connection *connection, void **context,
                        enum MHD_RequestTerminationCode how)
{
	struct db_web_request *request = *context;

	(void)data;
	(void)connection;
	(void)how;
	if (request && request->place) {
		request->place->busy = request->place->waits = request->place->receives = false;
		request->place->waited = 0;
	}
	if (request)
		db_web_request_free(request);
	*context = NULL;
}

/* --- connections ------------------------------------------------------------------------------ */

/* The daemon closes the connection when it sees that no more data arrive. */
static void close_connection(void *connection)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		connection, MHD_CONNECTION_INFO_CONNECTION_FD);

	if (info)
		(void)shutdown(info->connect_fd, SHUT_RDWR);
}

/* What it may not take stays with the door. */
static bool take_connection(void *data, int fd, const struct sockaddr *peer, socklen_t size)
{
	struct db_web_server *server = data;
	struct db_web_connection *leaver;
	struct db_web_address address;

	/* Many browsers come through a trusted proxy: its connections are not counted. */
	if (!db_web_address_of(peer, &address) ||
	    !db_web_connections_admit(server->connections, &address,
	                              !db_web_networks_have(&server->config->proxies, &address),
	                              db_client_now(), &leaver))
		return false;
	if (leaver)
		close_connection(leaver->handle);
	/* It closes the descriptor if it cannot take it. */
	(void)MHD_add_connection(server->daemon, fd, peer, size);
	db_web_server_wake(server);
	return true;
}

static void count_connection(void *data, struct MHD_Connection *connection, void **context,
                             enum MHD_ConnectionNotificationCode code)
{
	struct db_web_server *server = data;
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
	struct db_web_address address;

	struct db_web_connection *place = *context;

	if (code != MHD_CONNECTION_NOTIFY_STARTED) {
		if (place)
			db_web_tls_end(place->credentials);
		db_web_connections_remove(server->connections, place);
		*context = NULL;
		return;
	}
	if (!info || !db_web_address_of(info->client_addr, &address))
		memset(&address, 0, sizeof(address));
	place = db_web_connections_add(server->connections, &address,
	                               !db_web_networks_have(&server->config->proxies, &address),
	                               connection);
	*context = place;
	info = place && server->tls ?
	               MHD_get_connection_info(connection, MHD_CONNECTION_INFO_GNUTLS_SESSION) :
	               NULL;
	if (info)
		place->credentials = db_web_tls_begin(server->tls, info->tls_session);
}

/* --- the loop --------------------------------------------------------------------------------- */

static void run_daemon(struct db_web_server *server)
{
	MHD_UNSIGNED_LONG_LONG wait;
	db_time begun = db_client_now();
	db_time rest;

	(void)MHD_run(server->daemon);
	server->ran = db_client_now();
	rest = REST_FACTOR * (server->ran - begun);
	server->rest = rest < REST_MAX ? rest : REST_MAX;
	/* Longer waits are whole seconds, for which the tick is often enough. */
	if (MHD_get_timeout(server->daemon, &wait) != MHD_YES || wait != 0)
		return;
	if (server->runs < RUNS_AT_ONCE) {
		server->runs++;
		(void)sd_event_source_set_enabled(server->turn, SD_EVENT_ONESHOT);
	} else {
		(void)sd_event_source_set_time_relative(server->pause, PAUSE_US);
		(void)sd_event_source_set_enabled(server->pause, SD_EVENT_ONESHOT);
	}
}

static int on_ready(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_web_server *server = data;

	(void)source;
	(void)fd;
	(void)events;
	server->runs = 0;
	/* Each run costs time for each unfinished greeting. */
	if (db_web_connections_crowd(server->connections)) {
		db_time rested = db_client_now() - server->ran;

		if (rested < server->rest) {
			(void)sd_event_source_set_enabled(server->ready, SD_EVENT_OFF);
			(void)sd_event_source_set_time_relative(
				server->pause,
				(uint64_t)(server->rest - rested) / DB_NS_PER_US + 1);
			(void)sd_event_source_set_enabled(server->pause, SD_EVENT_ONESHOT);
			return 0;
		}
	}
	run_daemon(server);
	return 0;
}

static int on_pause(sd_event_source *source, uint64_t us, void *data)
{
	struct db_web_server *server = data;

	(void)source;
	(void)us;
	(void)sd_event_source_set_enabled(server->ready, SD_EVENT_ON);
	run_daemon(server);
	return 0;
}

static int on_turn(sd_event_source *source, void *data)
{
	(void)source;
	run_daemon(data);
	return 0;
}

/* A password was compared, or a user changed, by one of the two threads. */
static int on_compared(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_web_server *server = data;
	struct db_web_hasher *hasher = fd == db_web_hasher_fd(server->hasher) ? server->hasher :
	                                                                        server->asker;
	struct db_web_work work;

	(void)source;
	(void)events;
	while (db_web_hasher_take(hasher, &work)) {
		struct db_web_request *request = db_web_request_find(server, work.number);

		if (request && request->status != 0)
			request = NULL;
		if (work.change != DB_WEB_CHANGE_NONE ||
		    (request && request->route.kind != DB_WEB_LOGIN))
			db_web_users_end(server, request, &work);
		else if (request)
			db_web_login_end(request, &work);
	}
	explicit_bzero(&work, sizeof(work));
	return 0;
}

static int on_tick(sd_event_source *source, uint64_t us, void *data)
{
	struct db_client_error error = { .parameters = NULL };
	struct db_web_server *server = data;
	db_time now = db_client_now();

	(void)us;
	db_web_service_tick(server->service, now);
	db_web_overview_tick(server->overview, now);
	db_web_login_review(server);
	db_web_tabs_tick(server, now);
	db_web_parameters_tick(server, now);
	db_web_setup_tick(server, now);
	db_web_commission_tick(server, now);
	if (db_web_service_is_up(server->service))
		db_stops_prepare(db_lanes_stops(server->lanes));
	db_web_stream_tick(server, now);
	db_web_trail_tick(server, now);
	/* What the service has not answered in time fails. */
	db_client_error_set(&error, DB_CLIENT_TIMEOUT, "the service does not answer in time");
	for (struct db_web_request *request = server->requests; request; request = request->next) {
		if (now >= request->answer_by && request->status == 0)
			db_web_request_fail(request, &error);
	}
	db_client_error_clear(&error);
	run_daemon(server);
	db_web_connections_tick(server->connections, close_connection);
	db_web_door_tick(server->door, now);
	if (server->tls)
		db_web_tls_tick(server->tls);
	(void)sd_event_source_set_time_relative(source, TICK_US);
	(void)sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
	if (server->ending && ((!server->tabs && !server->commissions) || now >= server->end_by))
		(void)sd_event_exit(server->loop, EXIT_SUCCESS);
	return 0;
}

static int on_signal(sd_event_source *source, const struct signalfd_siginfo *info, void *data)
{
	struct db_web_server *server = data;

	(void)source;
	(void)info;
	(void)sd_notify(0, "STOPPING=1");
	server->ending = true;
	server->end_by = db_client_now() + END_WITHIN;
	db_web_tabs_leave(server, NULL, DB_WEB_GRIP_ENDING);
	db_web_commission_yield(server, NULL);
	return 0;
}

static int on_hangup(sd_event_source *source, const struct signalfd_siginfo *info, void *data)
{
	struct db_web_server *server = data;

	(void)source;
	(void)info;
	if (server->tls)
		db_web_tls_reload(server->tls);
	else
		db_client_log(DB_CLIENT_NOTICE,
		              "there is no certificate to be read again; the configuration is read "
		              "at a start");
	return 0;
}

static void on_service_changed(struct db_web_server *server)
{
	if (!db_web_service_is_up(server->service))
		db_web_tabs_close(server);
	if (server->overview)
		db_web_overview_changed(server->overview);
}

/* --- life ------------------------------------------------------------------------------------- */

static void log_daemon(void *data, const char *format, va_list arguments)
	__attribute__((format(printf, 2, 0)));

/* During start-up its errors; later it only reports closed connections. */
static void log_daemon(void *data, const char *format, va_list arguments)
{
	const struct db_web_server *server = data;
	char text[512];

	if (server->daemon)
		return;
	vsnprintf(text, sizeof(text), format, arguments);
	text[strcspn(text, "\n")] = '\0';
	db_client_log(DB_CLIENT_ERROR, "%s", text);
}

static bool start_daemon(struct db_web_server *server)
{
	const struct db_web_config *config = server->config;
	const struct db_certificate_pair *pair = config->tls ? &server->tls->pair : NULL;
	struct MHD_OptionItem tls[] = {
		{ MHD_OPTION_HTTPS_MEM_CERT, 0, pair ? pair->certificate.bytes : NULL },
		{ MHD_OPTION_HTTPS_MEM_KEY, 0, pair ? pair->key.bytes : NULL },
		{ MHD_OPTION_HTTPS_PRIORITIES, 0, (void *)(uintptr_t)DB_WEB_TLS_PRIORITIES },
		{ MHD_OPTION_END, 0, NULL },
	};
	struct MHD_OptionItem none[] = { { MHD_OPTION_END, 0, NULL } };
	const union MHD_DaemonInfo *info;

	server->daemon = MHD_start_daemon(
		MHD_USE_EPOLL | MHD_USE_NO_LISTEN_SOCKET | MHD_ALLOW_SUSPEND_RESUME |
			MHD_USE_ERROR_LOG | (config->tls ? MHD_USE_TLS : 0U),
		0, NULL, NULL, handle_request, server, MHD_OPTION_EXTERNAL_LOGGER, log_daemon,
		server, MHD_OPTION_CONNECTION_LIMIT,
		config->connections + DB_WEB_CONNECTIONS_LEAVING,
		MHD_OPTION_CONNECTION_MEMORY_LIMIT, CONNECTION_MEMORY,
		MHD_OPTION_CONNECTION_TIMEOUT, CONNECTION_SILENT_S, MHD_OPTION_NOTIFY_COMPLETED,
		end_request, server, MHD_OPTION_NOTIFY_CONNECTION, count_connection, server,
		MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_ARRAY, config->tls ? tls : none,
		MHD_OPTION_END);
	if (!server->daemon) {
		db_client_log(DB_CLIENT_ERROR, "the server cannot be started");
		return false;
	}
	info = MHD_get_daemon_info(server->daemon, MHD_DAEMON_INFO_EPOLL_FD);
	if (!info || sd_event_add_io(server->loop, &server->ready, info->epoll_fd, EPOLLIN,
	                             on_ready, server) < 0)
		return false;
	server->door = db_web_door_new(server->loop, config, take_connection, server);
	return server->door;
}

static bool start(struct db_web_server *server)
{
	const struct db_web_config *config = server->config;
	uint64_t seed;

	server->page = db_web_page_load(config->page);
	if (config->tls)
		server->tls = db_web_tls_new(config);
	if (!server->page || (config->tls && !server->tls))
		return false;
	if (getrandom(&seed, sizeof(seed), 0) != (ssize_t)sizeof(seed)) {
		db_client_log(DB_CLIENT_ERROR, "no random numbers are to be had");
		return false;
	}
	server->attempts.seed = seed;
	server->connections = db_web_connections_new(config->connections,
	                                             config->connections_per_address, seed);
	server->sessions = db_web_sessions_new(config->session_idle_min * 60 * DB_NS_PER_S,
	                                       config->session_h * 3600 * DB_NS_PER_S);
	server->hasher = db_web_hasher_new();
	server->asker = db_web_hasher_new();
	server->service = db_web_service_new(server, on_service_changed,
	                                     db_web_overview_take_token);
	server->lanes = db_web_tabs_make_lanes(server);
	if (server->service)
		server->overview = db_web_overview_new(server);
	if (!server->connections || !server->sessions || !server->hasher || !server->asker ||
	    !server->lanes || !server->overview ||
	    sd_event_add_defer(server->loop, &server->turn, on_turn, server) < 0 ||
	    sd_event_add_time_relative(server->loop, &server->pause, CLOCK_MONOTONIC, 0,
	                               PAUSE_ACCURACY_US, on_pause, server) < 0 ||
	    sd_event_add_time_relative(server->loop, &server->tick, CLOCK_MONOTONIC, 0,
	                               TICK_ACCURACY_US, on_tick, server) < 0 ||
	    sd_event_add_io(server->loop, &server->hashed, db_web_hasher_fd(server->hasher),
	                    EPOLLIN, on_compared, server) < 0 ||
	    sd_event_add_io(server->loop, &server->asked, db_web_hasher_fd(server->asker), EPOLLIN,
	                    on_compared, server) < 0 ||
	    sd_event_add_signal(server->loop, &server->signals[0], SIGTERM, on_signal, server) <
	            0 ||
	    sd_event_add_signal(server->loop, &server->signals[1], SIGINT, on_signal, server) < 0 ||
	    sd_event_add_signal(server->loop, &server->signals[2], SIGHUP, on_hangup, server) < 0) {
		db_client_log(DB_CLIENT_ERROR, "out of memory");
		return false;
	}
	(void)sd_event_source_set_enabled(server->turn, SD_EVENT_OFF);
	(void)sd_event_source_set_enabled(server->pause, SD_EVENT_OFF);
	/* The dead man's rule has priority over the requests of browsers. */
	(void)sd_event_source_set_priority(server->tick, SD_EVENT_PRIORITY_IMPORTANT);
	return start_daemon(server);
}

/* libmicrohttpd aborts when it is stopped while a connection is suspended. */
static void stop_daemon(struct db_web_server *server)
{
	if (!server->daemon)
		return;
	db_web_door_free(server->door);
	db_web_stream_end(server, NULL, "Stopping", "this server is being stopped");
	db_web_trail_end(server);
	for (struct db_web_request *request = server->requests; request; request = request->next) {
		if (request->status == 0)
			db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Stopping",
			                      "this server is being stopped");
	}
	/* Each run serves a connection by one step. */
	for (unsigned turn = 0; server->requests && turn < END_TURNS; turn++)
		(void)MHD_run(server->daemon);
	MHD_stop_daemon(server->daemon);
}

int db_web_serve(const void *config, sd_event *loop)
{
	struct db_web_server server = { .loop = loop, .config = config };
	int status = EXIT_FAILURE;

	if (start(&server)) {
		(void)sd_event_set_watchdog(server.loop, true);
		(void)sd_notify(0, "READY=1");
		status = sd_event_loop(server.loop) < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
	}
	db_web_tabs_close(&server);
	db_web_commission_free(&server);
	stop_daemon(&server);
	/* Before the objects that wait for its answers. */
	db_lanes_free(server.lanes);
	db_link_drop(server.trail.link);
	db_web_service_free(server.service);
	db_web_parameters_free(&server);
	db_web_setup_free(&server);
	db_web_overview_free(server.overview);
	db_web_hasher_free(server.hasher);
	db_web_hasher_free(server.asker);
	db_web_sessions_free(server.sessions);
	db_web_page_free(server.page);
	free(server.connections);
	db_web_tls_free(server.tls);
	sd_event_source_disable_unref(server.ready);
	sd_event_source_disable_unref(server.turn);
	sd_event_source_disable_unref(server.pause);
	sd_event_source_disable_unref(server.tick);
	sd_event_source_disable_unref(server.hashed);
	sd_event_source_disable_unref(server.asked);
	sd_event_source_disable_unref(server.signals[0]);
	sd_event_source_disable_unref(server.signals[1]);
	sd_event_source_disable_unref(server.signals[2]);
	return status;
}
