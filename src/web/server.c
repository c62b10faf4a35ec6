/* SPDX-License-Identifier: Apache-2.0 */
#include "web/server.h"
#include "client/log.h"
#include "drivebridge/version.h"
#include "web/call.h"
#include "web/login.h"
#include "web/metrics.h"
#include "web/origin.h"
#include "web/overview.h"
#include "web/request.h"
#include "web/service.h"
#include "web/stops.h"
#include "web/stream.h"
#include "web/tabs.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/epoll.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#define TICK_US 100000
#define TICK_ACCURACY_US 5000

/* Of a head, and of what goes out at once. */
#define CONNECTION_MEMORY ((size_t)16 * 1024)
/* A connection that says nothing, and takes nothing, for so long is closed. */
#define CONNECTION_SILENT_S 10U

/* What the system keeps for a browser that does not take it: no more than it may be old. */
#define UNSENT_MAX (32 * 1024)

/* What is taken of a body whatever becomes of it; then the connection is closed. */
#define HEARD_MAX ((size_t)4 * DB_WEB_BODY_MAX)

#define READ_WITHIN (10 * DB_NS_PER_S)
/* Drives that were moved by holding a button are stopped before this program ends, if they can be. */
#define END_WITHIN (4 * DB_NS_PER_S)
/* Turns of the daemon for the answers that are left then. */
#define END_TURNS 16

/* --- whether it may be asked ------------------------------------------------------------------ */

static const char *head(const struct db_web_request *request, const char *name)
{
	return MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND, name);
}

/* What may stand in a head once only, or several times. */
struct head_lines {
	unsigned hosts;
	const char *forwarded; /* the last one */
};

static enum MHD_Result count_line(void *data, enum MHD_ValueKind kind, const char *name,
                                  const char *value)
{
	struct head_lines *lines = data;

	(void)kind;
	lines->hosts += strcasecmp(name, MHD_HTTP_HEADER_HOST) == 0;
	if (strcasecmp(name, "X-Forwarded-For") == 0)
		lines->forwarded = value;
	return MHD_YES;
}

/* Of a request through a proxy that is believed, what that says of it. */
static void find_peer(struct db_web_request *request, const char *forwarded)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		request->connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
	const struct db_web_config *config = request->server->config;
	struct db_web_address told;
	const char *scheme;
	const char *last;

	if (!info || !db_web_address_of(info->client_addr, &request->address))
		memset(&request->address, 0, sizeof(request->address));
	request->secure = config->certificate;
	if (!db_web_networks_have(&config->proxies, &request->address))
		return;
	last = forwarded ? strrchr(forwarded, ',') : NULL;
	last = last ? last + 1 + strspn(last + 1, " ") : forwarded;
	/* Whoever stands further in front may say what he likes. */
	if (last && db_web_address_parse(last, &told))
		request->address = told;
	scheme = head(request, "X-Forwarded-Proto");
	if (scheme && strcmp(scheme, "https") == 0)
		request->secure = true;
}

static void find_session(struct db_web_request *request)
{
	struct db_web_server *server = request->server;
	const char *cookie = MHD_lookup_connection_value(request->connection, MHD_COOKIE_KIND,
	                                                 request->secure ? DB_WEB_COOKIE_SECURE :
	                                                                   DB_WEB_COOKIE);
	const struct db_web_session *session =
		cookie ? db_web_sessions_find(server->sessions, cookie, db_web_clock()) : NULL;

	request->role = server->config->read == DB_WEB_READ_ALL ? DB_ROLE_READER : DB_ROLE_NONE;
	if (session) {
		(void)snprintf(request->user, sizeof(request->user), "%s", session->user);
		(void)snprintf(request->session, sizeof(request->session), "%s", session->id);
		(void)snprintf(request->token, sizeof(request->token), "%s", session->token);
		request->role = session->role;
	} else if (cookie && cookie[0] == DB_WEB_NOBODY && db_web_secret_is_good(cookie + 1)) {
		(void)snprintf(request->token, sizeof(request->token), "%s", cookie + 1);
	}
}

static bool is_json(const char *type)
{
	static const char json[] = "application/json";
	size_t length = sizeof(json) - 1;

	return type && strncasecmp(type, json, length) == 0 &&
	       (type[length] == '\0' || type[length] == ';' || type[length] == ' ');
}

/* What a page of somebody else could make a browser do. */
static void check_post(struct db_web_request *request)
{
	const char *length = head(request, MHD_HTTP_HEADER_CONTENT_LENGTH);
	const char *token = head(request, "X-Drivebridge");
	const char *site = head(request, "Sec-Fetch-Site");
	const char *tab = head(request, "X-Tab");
	const char *call = head(request, "X-Call");

	if (!db_web_origin_is_good(head(request, MHD_HTTP_HEADER_ORIGIN),
	                           head(request, MHD_HTTP_HEADER_HOST)) ||
	    (site && strcmp(site, "same-origin") != 0))
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "WrongOrigin",
		                      "this request was made by another page");
	else if (!is_json(head(request, MHD_HTTP_HEADER_CONTENT_TYPE)))
		db_web_request_refuse(request, MHD_HTTP_UNSUPPORTED_MEDIA_TYPE, "BadContentType",
		                      "the body's type is to be application/json");
	else if (request->role < request->route.role && request->user[0] == '\0')
		db_web_request_refuse(request, MHD_HTTP_UNAUTHORIZED, "LoginRequired",
		                      "this needs a login");
	else if (!token || !db_web_secret_equal(token, request->token))
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "BadToken",
		                      "the token in X-Drivebridge is not this session's; fetch "
		                      "/api/session");
	else if (request->role < request->route.role)
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "NotAllowed",
		                      "this needs the role %s", db_role_name(request->route.role));
	else if (length && strtoul(length, NULL, 10) > DB_WEB_BODY_MAX)
		db_web_request_refuse(request, MHD_HTTP_CONTENT_TOO_LARGE, "TooLong",
		                      "the body may have %d bytes", DB_WEB_BODY_MAX);
	else if (tab && !db_web_tab_is_good(tab))
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "X-Tab is 16 to 32 hexadecimal digits");
	else if (call && !db_web_call_number_read(call, &request->call))
		db_web_request_refuse(request, MHD_HTTP_BAD_REQUEST, "BadRequest",
		                      "X-Call is a number from 1");
	else if (tab)
		(void)snprintf(request->tab, sizeof(request->tab), "%s", tab);
}

static void check_head(struct db_web_request *request, unsigned hosts)
{
	if (hosts != 1 || !db_web_host_is_good(head(request, MHD_HTTP_HEADER_HOST),
	                                       &request->server->config->hosts))
		db_web_request_refuse(
			request, MHD_HTTP_MISDIRECTED_REQUEST, "WrongHost",
			"this gateway is called by its address, or by a name that its "
			"configuration has in hosts");
	else if (request->route.kind == DB_WEB_UNKNOWN)
		db_web_request_refuse(request, MHD_HTTP_NOT_FOUND, "NoSuchPath",
		                      "there is nothing of this name");
	else if (request->route.kind == DB_WEB_WRONG_METHOD)
		db_web_request_refuse(request, MHD_HTTP_METHOD_NOT_ALLOWED, "WrongMethod",
		                      "this needs another method");
	else if (request->route.kind != DB_WEB_FILE && request->route.kind != DB_WEB_SESSION &&
	         request->route.kind != DB_WEB_METRICS)
		check_post(request);
}

/* --- what is asked ---------------------------------------------------------------------------- */

static void answer_file(struct db_web_request *request)
{
	const struct db_web_file *file = db_web_page_find(request->server->page,
	                                                  request->route.name);
	const char *known = head(request, MHD_HTTP_HEADER_IF_NONE_MATCH);

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
		                      "the body may have %d bytes", DB_WEB_BODY_MAX);
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

static void dispatch(struct db_web_request *request)
{
	struct db_web_server *server = request->server;

	if (server->ending) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Stopping",
		                      "this server is being stopped");
		return;
	}
	if (request->route.kind != DB_WEB_FILE && !parse_body(request))
		return;
	if (request->session[0] != '\0' && request->route.kind != DB_WEB_ALIVE)
		db_web_sessions_touch(server->sessions, request->session, db_web_clock());
	switch (request->route.kind) {
	case DB_WEB_FILE:
		answer_file(request);
		break;
	case DB_WEB_SESSION:
		db_web_login_tell(request);
		break;
	case DB_WEB_METRICS:
		db_web_metrics(request);
		break;
	case DB_WEB_LOGIN:
		db_web_login(request);
		break;
	case DB_WEB_LOGOUT:
		db_web_logout(request);
		break;
	case DB_WEB_ALIVE:
		db_web_tabs_hear(request);
		break;
	case DB_WEB_CALL:
		if (request->route.acts)
			db_web_tabs_act(request);
		else
			db_web_call(request, db_web_service_reader(server->service), READ_WITHIN);
		break;
	case DB_WEB_STREAM:
		if (request->route.role == DB_ROLE_OPERATOR)
			db_web_log_action(request, request->route.name, request->parameters);
		db_web_stream_begin(request);
		break;
	case DB_WEB_OVERVIEW:
		db_web_overview_begin(server->overview, request);
		break;
	case DB_WEB_JOG:
		db_web_tabs_jog(request);
		break;
	case DB_WEB_UNKNOWN:
	case DB_WEB_WRONG_METHOD:
	default:
		db_web_request_refuse(request, MHD_HTTP_NOT_FOUND, "NoSuchPath",
		                      "there is nothing of this name");
	}
}

/* Its connection is worth more than one that has sent none. */
static void note_head(struct db_web_request *request)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		request->connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);

	request->place = info ? info->socket_context : NULL;
	if (!request->place)
		return;
	request->place->heard = true;
	request->place->known = request->session[0] != '\0';
	request->place->busy = true;
}

static enum MHD_Result begin_request(struct db_web_server *server,
                                     struct MHD_Connection *connection, const char *url,
                                     const char *method, void **context)
{
	struct db_web_request *request = calloc(1, sizeof(*request));
	struct head_lines lines = { .hosts = 0 };

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
	(void)MHD_get_connection_values(connection, MHD_HEADER_KIND, count_line, &lines);
	find_peer(request, lines.forwarded);
	find_session(request);
	check_head(request, lines.hosts);
	note_head(request);
	/* Who is refused is heard out first: an answer in the middle of a body may be lost with the connection. */
	return request->status == MHD_HTTP_CONTENT_TOO_LARGE ? db_web_request_send(request) :
	                                                       MHD_YES;
}

static void add_body(struct db_web_request *request, const char *bytes, size_t count)
{
	char *grown;

	if (request->too_long || count > DB_WEB_BODY_MAX - request->used) {
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
	if (!request->taken && request->status == 0) {
		request->taken = true;
		/* The daemon keeps the path as long as the connection is in its hands. */
		dispatch(request);
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
	if (request && request->place)
		request->place->busy = request->place->waits = false;
	if (request)
		db_web_request_free(request);
	*context = NULL;
}

/* --- connections ------------------------------------------------------------------------------ */

/* Behind a proxy that is believed there are many. */
static bool is_counted(const struct db_web_server *server, const struct db_web_address *address)
{
	return !db_web_networks_have(&server->config->proxies, address);
}

/* The daemon closes it when it sees that nothing comes any more. */
static void send_away(struct db_web_connection *connection)
{
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		connection->handle, MHD_CONNECTION_INFO_CONNECTION_FD);

	if (info)
		(void)shutdown(info->connect_fd, SHUT_RDWR);
}

static enum MHD_Result admit(void *data, const struct sockaddr *peer, socklen_t size)
{
	struct db_web_server *server = data;
	struct db_web_connection *leaver;
	struct db_web_address address;

	(void)size;
	if (!db_web_address_of(peer, &address) ||
	    !db_web_connections_admit(server->connections, &address, is_counted(server, &address),
	                              &leaver))
		return MHD_NO;
	if (leaver)
		send_away(leaver);
	return MHD_YES;
}

static void count_connection(void *data, struct MHD_Connection *connection, void **context,
                             enum MHD_ConnectionNotificationCode code)
{
	struct db_web_server *server = data;
	const union MHD_ConnectionInfo *info = MHD_get_connection_info(
		connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
	struct db_web_address address;

	if (code != MHD_CONNECTION_NOTIFY_STARTED) {
		db_web_connections_remove(server->connections, *context);
		*context = NULL;
		return;
	}
	if (!info || !db_web_address_of(info->client_addr, &address))
		memset(&address, 0, sizeof(address));
	*context = db_web_connections_add(server->connections, &address,
	                                  is_counted(server, &address), connection);
}

/* --- the loop --------------------------------------------------------------------------------- */

static void run_daemon(struct db_web_server *server)
{
	MHD_UNSIGNED_LONG_LONG wait;

	(void)MHD_run(server->daemon);
	/* Its longer waits are whole seconds, for which the tick is often enough. */
	if (MHD_get_timeout(server->daemon, &wait) == MHD_YES && wait == 0)
		db_web_server_wake(server);
}

static int on_ready(sd_event_source *source, int fd, uint32_t events, void *data)
{
	(void)source;
	(void)fd;
	(void)events;
	run_daemon(data);
	return 0;
}

static int on_turn(sd_event_source *source, void *data)
{
	(void)source;
	run_daemon(data);
	return 0;
}

static int on_hashed(sd_event_source *source, int fd, uint32_t events, void *data)
{
	(void)source;
	(void)fd;
	(void)events;
	db_web_login_compared(data);
	return 0;
}

static void answer_late(struct db_web_server *server, db_time now)
{
	struct db_client_error error = { .parameters = NULL };

	db_client_error_set(&error, DB_CLIENT_TIMEOUT, "the service does not answer in time");
	for (struct db_web_request *request = server->requests; request; request = request->next) {
		if (now >= request->answer_by && request->status == 0)
			db_web_request_fail(request, &error);
	}
	db_client_error_clear(&error);
}

static int on_tick(sd_event_source *source, uint64_t us, void *data)
{
	struct db_web_server *server = data;
	db_time now = db_web_clock();

	(void)us;
	db_web_service_tick(server->service, now);
	db_web_overview_tick(server->overview, now);
	db_web_login_review(server);
	db_web_tabs_tick(server, now);
	db_web_stops_tick(server->stops);
	db_web_stream_tick(server, now);
	answer_late(server, now);
	run_daemon(server);
	(void)sd_event_source_set_time_relative(source, TICK_US);
	(void)sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
	if (server->ending && (!server->tabs || now >= server->end_by))
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
	server->end_by = db_web_clock() + END_WITHIN;
	db_web_tabs_leave(server, NULL, DB_WEB_GRIP_ENDING);
	return 0;
}

static void on_service_changed(void *data)
{
	struct db_web_server *server = data;

	if (!db_web_service_is_up(server->service))
		db_web_tabs_close(server);
	if (server->overview)
		db_web_overview_changed(server->overview);
}

static void on_token(void *data, const char *token)
{
	struct db_web_server *server = data;

	db_web_overview_take_token(server->overview, token);
}

/* --- life ------------------------------------------------------------------------------------- */

/* -1 with an error in the log. */
static int listen_for_browsers(const struct db_web_config *config)
{
	struct sockaddr_storage endpoint;
	struct db_web_address address;
	char text[DB_WEB_ADDRESS_TEXT];
	socklen_t size = 0;
	int unsent = UNSENT_MAX;
	int on = 1;
	int fd;

	(void)db_web_endpoint_parse(config->listen, &endpoint, &size);
	fd = socket(endpoint.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0 ||
	    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &unsent, sizeof(unsent)) != 0 ||
	    bind(fd, (struct sockaddr *)&endpoint, size) != 0 || listen(fd, 128) != 0) {
		db_client_log(DB_CLIENT_ERROR, "cannot listen on %s: %s", config->listen,
		              strerror(errno));
		if (fd >= 0)
			(void)close(fd);
		return -1;
	}
	size = sizeof(endpoint);
	(void)getsockname(fd, (struct sockaddr *)&endpoint, &size);
	(void)db_web_address_of((struct sockaddr *)&endpoint, &address);
	db_web_address_write(&address, text);
	db_client_log(DB_CLIENT_NOTICE, "drivebridge-webd " DB_VERSION " at %s://%s%s%s:%u/",
	              config->certificate ? "https" : "http",
	              endpoint.ss_family == AF_INET6 ? "[" : "", text,
	              endpoint.ss_family == AF_INET6 ? "]" : "",
	              ntohs(endpoint.ss_family == AF_INET6 ?
	                            ((struct sockaddr_in6 *)&endpoint)->sin6_port :
	                            ((struct sockaddr_in *)&endpoint)->sin_port));
	return fd;
}

static void log_daemon(void *data, const char *format, va_list arguments)
	__attribute__((format(printf, 2, 0)));

/* Why it does not start; later only who went away. */
static void log_daemon(void *data, const char *format, va_list arguments)
{
	const struct db_web_server *server = data;
	char text[512];

	if (server->daemon)
		return;
	(void)vsnprintf(text, sizeof(text), format, arguments);
	text[strcspn(text, "\n")] = '\0';
	db_client_log(DB_CLIENT_ERROR, "%s", text);
}

static bool start_daemon(struct db_web_server *server)
{
	const struct db_web_config *config = server->config;
	int fd = listen_for_browsers(config);
	struct MHD_OptionItem tls[] = {
		{ MHD_OPTION_HTTPS_MEM_CERT, 0, config->certificate },
		{ MHD_OPTION_HTTPS_MEM_KEY, 0, config->key },
		{ MHD_OPTION_END, 0, NULL },
	};
	struct MHD_OptionItem none[] = { { MHD_OPTION_END, 0, NULL } };
	const union MHD_DaemonInfo *info;

	if (fd < 0)
		return false;
	server->daemon = MHD_start_daemon(
		MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG |
			(config->certificate ? MHD_USE_TLS : 0U),
		0, admit, server, handle_request, server, MHD_OPTION_EXTERNAL_LOGGER, log_daemon,
		server, MHD_OPTION_LISTEN_SOCKET, fd, MHD_OPTION_CONNECTION_LIMIT,
		config->connections + DB_WEB_CONNECTIONS_LEAVING,
		MHD_OPTION_CONNECTION_MEMORY_LIMIT, CONNECTION_MEMORY,
		MHD_OPTION_CONNECTION_TIMEOUT, CONNECTION_SILENT_S, MHD_OPTION_NOTIFY_COMPLETED,
		end_request, server, MHD_OPTION_NOTIFY_CONNECTION, count_connection, server,
		MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_ARRAY, config->certificate ? tls : none,
		MHD_OPTION_END);
	if (!server->daemon) {
		db_client_log(DB_CLIENT_ERROR, "the server cannot be started%s",
		              config->certificate ? "; certificate and key may not fit" : "");
		(void)close(fd);
		return false;
	}
	info = MHD_get_daemon_info(server->daemon, MHD_DAEMON_INFO_EPOLL_FD);
	return info && sd_event_add_io(server->loop, &server->ready, info->epoll_fd, EPOLLIN,
	                               on_ready, server) >= 0;
}

static bool start(struct db_web_server *server)
{
	const struct db_web_config *config = server->config;

	server->page = db_web_page_load(config->page);
	if (!server->page)
		return false;
	server->connections = db_web_connections_new(config->connections,
	                                             config->connections_per_address);
	server->sessions = db_web_sessions_new(config->session_idle_min * 60 * DB_NS_PER_S,
	                                       config->session_h * 3600 * DB_NS_PER_S);
	server->hasher = db_web_hasher_new();
	server->service = db_web_service_new(server, on_service_changed, on_token, server);
	server->stops = db_web_stops_new(server);
	if (server->service)
		server->overview = db_web_overview_new(server);
	if (!server->connections || !server->sessions || !server->hasher || !server->stops ||
	    !server->overview ||
	    getrandom(&server->attempts.seed, sizeof(server->attempts.seed), 0) < 0 ||
	    sd_event_add_defer(server->loop, &server->turn, on_turn, server) < 0 ||
	    sd_event_add_time_relative(server->loop, &server->tick, CLOCK_MONOTONIC, 0,
	                               TICK_ACCURACY_US, on_tick, server) < 0 ||
	    sd_event_add_io(server->loop, &server->hashed, db_web_hasher_fd(server->hasher),
	                    EPOLLIN, on_hashed, server) < 0 ||
	    sd_event_add_signal(server->loop, &server->signals[0], SIGTERM, on_signal, server) <
	            0 ||
	    sd_event_add_signal(server->loop, &server->signals[1], SIGINT, on_signal, server) < 0) {
		db_client_log(DB_CLIENT_ERROR, "out of memory");
		return false;
	}
	(void)sd_event_source_set_enabled(server->turn, SD_EVENT_OFF);
	/* The dead man's rule comes before whatever browsers want. */
	(void)sd_event_source_set_priority(server->tick, SD_EVENT_PRIORITY_IMPORTANT);
	return start_daemon(server);
}

/* The library aborts when it is stopped with a connection that is suspended. */
static void stop_daemon(struct db_web_server *server)
{
	if (!server->daemon)
		return;
	db_web_stream_end(server, NULL, "Stopping", "this server is being stopped");
	for (struct db_web_request *request = server->requests; request; request = request->next) {
		if (request->status == 0)
			db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Stopping",
			                      "this server is being stopped");
	}
	/* It goes on with each of them step by step. */
	for (unsigned turn = 0; server->requests && turn < END_TURNS; turn++)
		(void)MHD_run(server->daemon);
	MHD_stop_daemon(server->daemon);
}

int db_web_serve(const struct db_web_config *config)
{
	struct db_web_server server = { .config = config };
	int status = EXIT_FAILURE;

	if (sd_event_new(&server.loop) >= 0 && start(&server)) {
		(void)sd_event_set_watchdog(server.loop, true);
		(void)sd_notify(0, "READY=1");
		status = sd_event_loop(server.loop) < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
	}
	db_web_tabs_close(&server);
	stop_daemon(&server);
	/* Before what waits for its answers. */
	db_web_stops_free(server.stops);
	db_web_service_free(server.service);
	db_web_overview_free(server.overview);
	db_web_hasher_free(server.hasher);
	db_web_sessions_free(server.sessions);
	db_web_page_free(server.page);
	db_web_connections_free(server.connections);
	sd_event_source_disable_unref(server.ready);
	sd_event_source_disable_unref(server.turn);
	sd_event_source_disable_unref(server.tick);
	sd_event_source_disable_unref(server.hashed);
	sd_event_source_disable_unref(server.signals[0]);
	sd_event_source_disable_unref(server.signals[1]);
	sd_event_unref(server.loop);
	return status;
}
