/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All sockets sit in an epoll set of the server's own, and that set is one source of the event
 * loop. sd-event makes a system call for each source it dispatches; a set of our own takes all
 * ready clients with one, and spares the memory of a source per client.
 */
#include "drivebridge/server.h"

#include "drivebridge/loop_clock.h"
#include "identity/certificates.h"
#include "identity/rights.h"
#include "server/acl.h"
#include "server/connection.h"
#include "server/endpoints.h"
#include "server/listener.h"
#include "server/peers.h"
#include "server/plc_lines.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <systemd/sd-event.h>
#include <unistd.h>

#define EVENTS_AT_ONCE 64
#define ACCEPTS_AT_ONCE 16
/* Pause before accepting new connections when descriptors or memory have run out. */
#define ACCEPT_PAUSE (100 * DB_NS_PER_MS)
/* Maximum delay in detecting a time limit. */
#define TIMER_ACCURACY_US 5000

struct db_server {
	struct db_connection_shared shared;
	sd_event *loop;
	struct db_log_source log;
	sd_event_source *io, *timer;
	uint32_t last_id;
	db_time armed;        /* when the timer will fire */
	db_time accept_again; /* DB_TIME_NEVER: accepting now */
	bool busy;            /* a connection is being served */
	bool late_answers;    /* answers arrived meanwhile */
	unsigned kept;        /* descriptors that connections leave for other uses */
	bool users_count;     /* users of this machine have no more rights than these: */
	struct db_rights rights;
	struct db_endpoints *endpoints;
	struct db_certificates *certificates;
	struct db_plc_lines *lines;
	size_t room; /* at least the sum of the endpoints' max_clients */
	size_t count;
	struct db_connection **connections; /* in the order of connecting */
};

/* Time limits. One timer; it may fire early, never late, so requests need not move it. */

static void arm_timer(struct db_server *server, db_time deadline)
{
	if (deadline >= server->armed)
		return;
	if (sd_event_source_set_time(server->timer, (uint64_t)(deadline / DB_NS_PER_US + 1)) < 0 ||
	    sd_event_source_set_enabled(server->timer, SD_EVENT_ONESHOT) < 0)
		return;
	server->armed = deadline;
}

static void set_accepting(struct db_server *server, bool accepting)
{
	db_endpoints_set_accepting(server->endpoints, accepting);
	server->accept_again = accepting ? DB_TIME_NEVER : db_loop_now(server->loop) + ACCEPT_PAUSE;
	arm_timer(server, server->accept_again);
}

/* Connections. */

/* A client with the name of its user or certificate, where it has one. */
static void describe(const struct db_server *server, const struct db_client *client,
                     struct db_client_words *words)
{
	char login[DB_CLIENT_PROCESS_USER_MAX] = "";
	const char *name;
	const char *role;
	uint32_t user;

	if (db_certificates_find(server->certificates, client->address, &name, &role)) {
		db_client_words_init_certificate(words, client->address, name, role);
		return;
	}
	if (db_client_user_of_address(client->address, &user))
		db_rights_name(user, login);
	db_client_words_init(words, client->address, login, "");
}

static void announce_client(const struct db_server *server, const struct db_connection *connection,
                            bool connected)
{
	const struct db_executor *executor = &server->shared.executor;
	const struct db_client *client = &connection->client;
	struct db_client_words words;
	struct db_log_about about = { .client = words.address };
	const char *endpoint = db_modbus_endpoint_name(server->shared.config, client->endpoint);
	char network[DB_CLIENT_ADDRESS_MAX] = "";

	describe(server, client, &words);
	/* An IPv6 address and a certificate are too much for what stands before it. */
	if (connection->role && db_client_ipv4(client->address) == DB_CLIENT_IPV6)
		db_client_address(connection->peer->address, network);
	db_log(&server->log, db_loop_now(server->loop),
	       connected ? DB_EVENT_CLIENT_CONNECTED : DB_EVENT_CLIENT_GONE, &about,
	       "%s (%s%sport %u, %s%s%s%s)", connected ? "connected" : "disconnected", network,
	       network[0] != '\0' ? " " : "", (unsigned)client->port,
	       endpoint[0] != '\0' ? "endpoint " : "", endpoint, endpoint[0] != '\0' ? ", " : "",
	       client->may_write  ? "may read and write" :
	       connection->barred ? "has no role, so every request is refused" :
	                            "may only read");
	if (executor->backend->client)
		executor->backend->client(executor->context, client, connected);
}

/* Adds one to its endpoint's clients, or takes one from them. */
static void count_client(struct db_server *server, const struct db_connection *connection, int one)
{
	const struct db_client *client = &connection->client;
	struct db_endpoint *endpoint = db_endpoints_find(server->endpoints, client->endpoint);

	endpoint->clients += (size_t)one;
	endpoint->readers += client->may_write ? 0 : (size_t)one;
}

static void drop_connection(struct db_server *server, size_t index)
{
	struct db_connection **place = &server->connections[index];
	struct db_connection *connection = *place;

	server->count--;
	memmove(place, place + 1, (server->count - index) * sizeof(*place));
	count_client(server, connection, -1);
	server->shared.stats.clients = (uint32_t)server->count;
	announce_client(server, connection, false);
	db_certificates_let_go(server->certificates, connection->client.address);
	db_connection_free(connection);
}

/* After a connection was served: it is over, or its next deadline counts. */
static void keep_or_drop(struct db_server *server, struct db_connection *connection, bool alive)
{
	size_t index = 0;

	if (alive) {
		arm_timer(server, db_connection_deadline(connection));
		return;
	}
	while (server->connections[index] != connection)
		index++;
	drop_connection(server, index);
}

static struct db_connection *find_connection(const struct db_server *server, uint32_t id)
{
	for (size_t i = 0; i < server->count; i++)
		if (server->connections[i]->client.id == id)
			return server->connections[i];
	return NULL;
}

/* A number that no client has. */
static uint32_t next_number(void *context)
{
	struct db_server *server = context;

	do
		server->last_id = db_client_number_after(server->last_id);
	while (find_connection(server, server->last_id) ||
	       db_plc_lines_has(server->lines, server->last_id));
	return server->last_id;
}

/*
 * A backend may answer one write from inside a call for another request (a stop cancels a move).
 * Such answers are only noted, since the batch is in use, and are sent here.
 */
static void send_late_answers(void *context)
{
	struct db_server *server = context;
	struct db_connection *connection;

	while (server->late_answers) {
		server->late_answers = false;
		for (size_t i = server->count; i-- > 0;) {
			connection = server->connections[i];
			keep_or_drop(server, connection,
			             db_connection_advance(connection, db_loop_now(server->loop)));
		}
		db_plc_lines_flush(server->lines);
	}
	arm_timer(server, db_peers_deadline(server->shared.peers));
	server->busy = false;
}

/* The reason for refusing a client: DB_REFUSAL_COUNT when there is none. */
static enum db_refusal find_refusal(const struct db_server *server,
                                    const struct db_endpoint *endpoint, enum db_access access,
                                    const struct db_peer *peer, int fd)
{
	const struct db_modbus_config *config = server->shared.config;
	struct db_endpoint_config at = { .max_clients = 0 };
	struct rlimit limit;

	(void)db_modbus_endpoint_find(config, endpoint->number, &at);
	if (access == DB_ACCESS_NONE)
		return db_acl_access(config, endpoint->number, peer->address) == DB_ACCESS_NONE ?
		               DB_REFUSED_ADDRESS :
		       config->require_secure == DB_SECURE_FOR_ALL ? DB_REFUSED_INSECURE :
		                                                     DB_REFUSED_USER_READ;
	if (config->max_clients_per_address > 0 &&
	    peer->connections >= config->max_clients_per_address)
		return DB_REFUSED_PER_ADDRESS;
	/* The places of each endpoint are its own: clients of one never lock out those of another.
	 * After a reload there may be more clients than before in fewer places. */
	if (endpoint->clients >= at.max_clients || server->count >= server->room)
		return DB_REFUSED_FULL;
	if (access == DB_ACCESS_READ && endpoint->readers + at.reserved_writers >= at.max_clients)
		return DB_REFUSED_RESERVED;
	/* Every new descriptor is the lowest free one: the number above it shows how many are
	 * free. */
	if (server->kept > 0 && getrlimit(RLIMIT_NOFILE, &limit) == 0 &&
	    (rlim_t)fd + server->kept >= limit.rlim_cur)
		return DB_REFUSED_DESCRIPTORS;
	return DB_REFUSAL_COUNT;
}

/* `role`: see db_connection_new(). */
static void admit_client(struct db_server *server, int fd, struct db_client *client,
                         const char *role, struct db_peer *peer)
{
	struct db_server_stats *stats = &server->shared.stats;
	struct db_connection *connection;

	db_listener_tune(fd);
	client->id = next_number(server);
	connection = db_connection_new(&server->shared, fd, client, role, peer,
	                               db_loop_now(server->loop));
	if (!connection) {
		db_certificates_let_go(server->certificates, client->address);
		return;
	}
	connection->barred = role && !client->role;
	server->connections[server->count++] = connection;
	count_client(server, connection, 1);
	stats->accepted++;
	stats->clients = (uint32_t)server->count;
	if (stats->clients > stats->clients_peak)
		stats->clients_peak = stats->clients;
	announce_client(server, connection, true);
	arm_timer(server, db_connection_deadline(connection));
}

static void add_client(struct db_server *server, const struct db_endpoint *endpoint, int fd,
                       const struct sockaddr_storage *address)
{
	db_time now = db_loop_now(server->loop);
	enum db_access access = DB_ACCESS_NONE;
	struct db_client client = { .endpoint = endpoint->number };
	enum db_refusal refusal;
	uint8_t network[16] = { 0 };
	struct db_peer *peer;

	if (db_acl_peer(address, network, &client.port)) {
		db_acl_identify(fd, network, client.address);
		access = db_acl_of_client(server->shared.config, endpoint->number,
		                          server->users_count ? &server->rights : NULL, network,
		                          client.address);
	}
	client.may_write = access == DB_ACCESS_WRITE;
	peer = db_peers_find(server->shared.peers, network, now);
	refusal = find_refusal(server, endpoint, access, peer, fd);
	if (refusal == DB_REFUSAL_COUNT) {
		admit_client(server, fd, &client, NULL, peer);
		return;
	}
	close(fd);
	db_connection_count_refusal(&server->shared, peer, refusal, now);
}

static void add_secure_client(void *context, struct db_endpoint *endpoint, int fd,
                              const struct db_secure_client *hello)
{
	struct db_server *server = context;
	db_time now = db_loop_now(server->loop);
	struct db_client client = { .port = hello->port, .endpoint = endpoint->number };
	struct db_peer *peer = db_peers_find(server->shared.peers, hello->address, now);
	enum db_access access = db_acl_of_certificate(server->shared.config, endpoint->number,
	                                              hello->address, hello->role, &client.role);
	enum db_refusal refusal = find_refusal(server, endpoint, access, peer, fd);

	client.may_write = access == DB_ACCESS_WRITE;
	if (hello->waited_ms > 0)
		client.arrived = now - (db_time)hello->waited_ms * DB_NS_PER_MS;
	if (refusal == DB_REFUSAL_COUNT &&
	    !db_certificates_hold(server->certificates, hello, client.address))
		refusal = DB_REFUSED_FULL;
	if (refusal == DB_REFUSAL_COUNT) {
		admit_client(server, fd, &client, hello->role, peer);
		return;
	}
	close(fd);
	db_connection_count_refusal(&server->shared, peer, refusal, now);
}

static void accept_clients(void *context, const struct db_endpoint *endpoint, int most)
{
	struct db_server *server = context;
	struct sockaddr_storage peer;
	socklen_t length;
	int fd;

	for (int i = 0; i < most; i++) {
		length = sizeof(peer);
		fd = accept4(endpoint->listener, (struct sockaddr *)&peer, &length,
		             SOCK_NONBLOCK | SOCK_CLOEXEC);
		if (fd >= 0) {
			add_client(server, endpoint, fd, &peer);
			continue;
		}
		if (errno == EAGAIN || errno == EWOULDBLOCK)
			return;
		if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
			set_accepting(server, false);
			return;
		}
		/* Any other error is of that one connection, which is gone already. */
	}
}

/* Returns how many sockets were ready. */
static int serve_ready(struct db_server *server)
{
	struct epoll_event events[EVENTS_AT_ONCE];
	db_time now = db_loop_now(server->loop);
	int count = epoll_wait(server->shared.epoll, events, EVENTS_AT_ONCE, 0);

	server->busy = true;
	/* A connection appears once per round and only ends itself: no event refers to a freed
	 * one. */
	for (int i = 0; i < count; i++) {
		const struct db_endpoint *endpoint = db_endpoints_of_event(server->endpoints,
		                                                           events[i].data.ptr);

		if (endpoint)
			accept_clients(server, endpoint, ACCEPTS_AT_ONCE);
		else
			keep_or_drop(
				server, events[i].data.ptr,
				db_connection_ready(events[i].data.ptr, events[i].events, now));
	}
	send_late_answers(server);
	return count;
}

static int on_ready(sd_event_source *source, int fd, uint32_t revents, void *userdata)
{
	(void)source;
	(void)fd;
	(void)revents;
	(void)serve_ready(userdata);
	return 0;
}

void db_server_catch_up(struct db_server *server)
{
	/* epoll rotates ready sockets; after this many rounds every connection was served. */
	for (size_t served = 0; served <= server->count; served += EVENTS_AT_ONCE) {
		if (serve_ready(server) < EVENTS_AT_ONCE)
			return;
	}
}

static int on_timer(sd_event_source *source, uint64_t usec, void *userdata)
{
	struct db_server *server = userdata;
	db_time now = db_loop_now(server->loop);

	(void)source;
	(void)usec;
	server->armed = DB_TIME_NEVER;
	server->busy = true;
	for (size_t i = server->count; i-- > 0;) {
		struct db_connection *connection = server->connections[i];
		bool has_turn;

		if (now >= db_connection_time_limit(connection)) {
			server->shared.stats.timeouts++;
			drop_connection(server, i);
			continue;
		}
		/* One that waits for its turn and for nothing else goes on when that has come. */
		has_turn = connection->turn != 0 && !connection->out && connection->turn <= now;
		keep_or_drop(server, connection,
		             !has_turn || db_connection_advance(connection, now));
	}
	db_peers_log(server->shared.peers, now);
	if (server->accept_again <= now)
		set_accepting(server, true);
	else
		arm_timer(server, server->accept_again);
	send_late_answers(server);
	return 0;
}

/* --- telling people what was refused ---------------------------------------------------------- */

static void log_refusal(void *context, const uint8_t address[16], enum db_refusal kind,
                        uint32_t count, bool first)
{
	static const char *const what[DB_REFUSAL_COUNT] = {
		[DB_REFUSED_ADDRESS] =
			"connection refused: it is in neither allow-read nor allow-write",
		[DB_REFUSED_FULL] = "connection refused: there are max-clients already",
		[DB_REFUSED_RESERVED] =
			("connection refused: the remaining connections are reserved for "
		         "clients that may write"),
		[DB_REFUSED_PER_ADDRESS] =
			"connection refused: it has max-clients-per-address already",
		[DB_REFUSED_WRITE] = "write refused: it is not in allow-write",
		[DB_REFUSED_USER] =
			("write refused: on this machine only root, the service's own user and "
		         "members of act-group may write (local-writers)"),
		[DB_REFUSED_USER_READ] =
			"connection refused: its user is in neither read-group nor act-group",
		[DB_REFUSED_CONTROL] = "write refused: another client has control of the drive",
		[DB_REFUSED_PACE] =
			"request answered later: it sends more than max-requests-per-second",
		[DB_REFUSED_DESCRIPTORS] =
			("connection refused: the file descriptors left are for buses and reloads; "
		         "lower max-clients, or raise the limit (LimitNOFILE of the unit)"),
		[DB_REFUSED_INSECURE] = "refused: it has no certificate (require-secure)",
		[DB_REFUSED_NO_ROLE] =
			("request refused: its certificate has no role that the configuration has "
		         "a section for"),
		[DB_REFUSED_ROLE] = "request refused: its role does not allow it",
		[DB_REFUSED_LINE] = "write refused: its section has allow = read",
		[DB_REFUSED_BROADCAST] =
			("request to unit 0 ignored: of what is for all units of a line and has no "
		         "answer, only a stop is carried out"),
	};
	const struct db_server *server = context;
	char text[DB_CLIENT_ADDRESS_MAX];
	struct db_log_about about = { .client = text };
	db_time now = db_loop_now(server->loop);

	db_client_address(address, text);
	if (count == 1)
		db_log(&server->log, now, DB_EVENT_CLIENT_REFUSED, &about, "%s", what[kind]);
	else
		db_log(&server->log, now, DB_EVENT_CLIENT_REFUSED, &about,
		       "%" PRIu32 " times%s: %s", count, first ? "" : " more", what[kind]);
}

/* --- serial lines ----------------------------------------------------------------------------- */

static void count_line_refusal(void *context, const uint8_t address[16], enum db_refusal kind)
{
	struct db_server *server = context;
	db_time now = db_loop_now(server->loop);

	db_connection_count_refusal(&server->shared,
	                            db_peers_find(server->shared.peers, address, now), kind, now);
}

static void begin_calls(void *context)
{
	struct db_server *server = context;

	server->busy = true;
}

static int open_lines(struct db_server *server)
{
	const struct db_plc_lines_host host = {
		.loop = server->loop,
		.log = &server->log,
		.executor = &server->shared.executor,
		.stats = &server->shared.stats,
		.number = next_number,
		.refused = count_line_refusal,
		.begin = begin_calls,
		.end = send_late_answers,
		.context = server,
	};
	struct db_plc_lines_change *change;
	int error;

	server->lines = db_plc_lines_new(&host);
	if (!server->lines)
		return -ENOMEM;
	error = db_plc_lines_prepare(server->lines, server->shared.config, &change);
	if (error == 0)
		db_plc_lines_apply(server->lines, change);
	return error;
}

/* --- beginning and end ------------------------------------------------------------------------ */

/* The places for clients of all endpoints. */
static size_t count_places(const struct db_modbus_config *config)
{
	size_t places = 0;

	for (size_t i = 0; i < db_modbus_endpoint_count(config); i++)
		places += db_modbus_endpoint_at(config, i).max_clients;
	return places;
}

static int open_endpoints(struct db_server *server, const char **where)
{
	struct db_endpoints_host host = {
		.loop = server->loop,
		.log = &server->log,
		.admit_secure = add_secure_client,
		.accept = accept_clients,
		.context = server,
	};
	struct db_endpoints_change *change;
	int error;

	server->shared.epoll = epoll_create1(EPOLL_CLOEXEC);
	if (server->shared.epoll < 0)
		return -errno;
	host.epoll = server->shared.epoll;
	server->endpoints = db_endpoints_new(&host);
	if (!server->endpoints)
		return -ENOMEM;
	error = db_endpoints_prepare(server->endpoints, server->shared.config, &change, where);
	if (error == 0)
		db_endpoints_apply(server->endpoints, change);
	return error;
}

int db_server_new(struct sd_event *loop, const struct db_modbus_config *config,
                  const struct db_backend *backend, void *context, const struct db_log_source *log,
                  struct db_server **result, const char **where)
{
	struct db_server *server;
	int error;

	*where = NULL;
	if (config->max_clients == 0 || config->max_pipelined == 0)
		return -EINVAL;
	server = calloc(1, sizeof(*server));
	if (!server)
		return -ENOMEM;
	server->room = count_places(config);
	server->connections = calloc(server->room, sizeof(server->connections[0]));
	if (!server->connections) {
		free(server);
		return -ENOMEM;
	}
	server->shared.config = config;
	server->shared.executor = (struct db_executor){ backend, context };
	server->loop = sd_event_ref(loop);
	server->log = *log;
	server->shared.epoll = -1;
	server->armed = DB_TIME_NEVER;
	server->accept_again = DB_TIME_NEVER;
	server->shared.peers = db_peers_new(server->room, log_refusal, server);
	server->certificates = db_certificates_new();
	error = server->shared.peers && server->certificates ? open_endpoints(server, where) :
	                                                       -ENOMEM;
	if (error == 0)
		error = sd_event_add_io(loop, &server->io, server->shared.epoll, EPOLLIN, on_ready,
		                        server);
	if (error >= 0)
		error = sd_event_add_time(loop, &server->timer, CLOCK_MONOTONIC, UINT64_MAX,
		                          TIMER_ACCURACY_US, on_timer, server);
	if (error >= 0)
		error = sd_event_source_set_enabled(server->timer, SD_EVENT_OFF);
	if (error >= 0)
		error = open_lines(server);
	if (error < 0) {
		db_server_free(server);
		return error;
	}
	*result = server;
	return 0;
}

void db_server_free(struct db_server *server)
{
	if (!server)
		return;
	/* The backend may still answer while it is notified that its clients disconnect. */
	server->busy = true;
	while (server->count > 0)
		drop_connection(server, server->count - 1);
	db_plc_lines_free(server->lines);
	server->lines = NULL;
	db_endpoints_free(server->endpoints);
	sd_event_source_disable_unref(server->timer);
	sd_event_source_disable_unref(server->io);
	if (server->shared.epoll >= 0)
		close(server->shared.epoll);
	free(server->shared.peers);
	db_certificates_free(server->certificates);
	sd_event_unref(server->loop);
	free(server->connections);
	free(server);
}

/* --- other settings --------------------------------------------------------------------------- */

struct db_server_change {
	const struct db_modbus_config *config;
	struct db_endpoints_change *endpoints;
	/* Both null: the present room is enough. */
	struct db_connection **connections;
	struct db_peers *peers;
	struct db_plc_lines_change *lines;
};

int db_server_prepare(struct db_server *server, const struct db_modbus_config *config,
                      struct db_server_change **change, const char **where)
{
	struct db_server_change *made = calloc(1, sizeof(*made));
	size_t places = count_places(config);
	int error = 0;

	*where = NULL;
	if (!made)
		return -ENOMEM;
	made->config = config;
	if (places > server->room) {
		made->connections = calloc(places, sizeof(made->connections[0]));
		made->peers = db_peers_new(places, log_refusal, server);
		if (!made->connections || !made->peers)
			error = -ENOMEM;
	}
	if (error == 0)
		error = db_endpoints_prepare(server->endpoints, config, &made->endpoints, where);
	if (error == 0)
		error = db_plc_lines_prepare(server->lines, config, &made->lines);
	if (error < 0) {
		db_server_change_free(made);
		return error;
	}
	*change = made;
	return 0;
}

void db_server_change_free(struct db_server_change *change)
{
	if (!change)
		return;
	db_endpoints_change_free(change->endpoints);
	db_plc_lines_change_free(change->lines);
	free(change->peers);
	free(change->connections);
	free(change);
}

static void adapt_connection(struct db_server *server, size_t index)
{
	struct db_connection *connection = server->connections[index];
	const struct db_client *client = &connection->client;
	const struct db_executor *executor = &server->shared.executor;
	const char *name = connection->role;
	const uint8_t *network = connection->peer->address;
	const struct db_role_config *role = NULL;
	uint32_t endpoint = client->endpoint;
	bool could_write = client->may_write;
	enum db_access access;

	if (name)
		access = db_acl_of_certificate(server->shared.config, endpoint, network, name,
		                               &role);
	else
		access = db_acl_of_client(server->shared.config, endpoint,
		                          server->users_count ? &server->rights : NULL, network,
		                          client->address);
	if (access == DB_ACCESS_NONE ||
	    (name && !db_endpoints_have_secure(server->shared.config, endpoint))) {
		struct db_client_words words;
		struct db_log_about about = { .client = words.address };

		describe(server, client, &words);
		db_log(&server->log, db_loop_now(server->loop), DB_EVENT_CLIENT_REFUSED, &about,
		       "connection closed: it may not read any more (allow-read, allow-write, "
		       "read-group, act-group, require-secure, secure-socket), or its endpoint is "
		       "gone");
		drop_connection(server, index);
		return;
	}
	count_client(server, connection, -1);
	connection->client.may_write = access == DB_ACCESS_WRITE;
	connection->client.role = role;
	connection->barred = name && !role;
	count_client(server, connection, 1);
	/* The connection has changed it. */
	// cppcheck-suppress knownConditionTrueFalse
	if (could_write && !client->may_write && executor->backend->restricted)
		executor->backend->restricted(executor->context, client);
	else if (role && client->may_write && executor->backend->reassigned)
		executor->backend->reassigned(executor->context, client);
}

void db_server_apply(struct db_server *server, struct db_server_change *change)
{
	unsigned pace = server->shared.config->max_requests_per_second;
	db_time now = db_loop_now(server->loop);

	server->busy = true;
	server->shared.config = change->config;
	server->log.level = change->config->log;
	/* All connections are moved to the new table before anything else happens to one: its end
	 * must be counted where its beginning was. */
	if (change->connections) {
		struct db_connection **connections = server->connections;
		struct db_peers *peers = server->shared.peers;
		memcpy(change->connections, connections, server->count * sizeof(connections[0]));
		db_peers_copy(change->peers, peers);
		server->connections = change->connections;
		server->shared.peers = change->peers;
		server->room = count_places(server->shared.config);
		change->connections = connections;
		change->peers = peers;
		for (size_t i = 0; i < server->count; i++) {
			struct db_connection *connection = server->connections[i];

			connection->peer = db_peers_find(server->shared.peers,
			                                 connection->peer->address, now);
		}
	}
	for (size_t i = server->count; i-- > 0;)
		adapt_connection(server, i);
	db_plc_lines_apply(server->lines, change->lines);
	change->lines = NULL;
	/* The rate used so far belongs to the former limit. */
	if (change->config->max_requests_per_second != pace) {
		db_peers_reset_rates(server->shared.peers);
		/* A request that waits for its turn need not wait any longer. */
		for (size_t i = 0; i < server->count; i++) {
			struct db_connection *connection = server->connections[i];

			if (connection->turn != 0)
				connection->active_since = now;
			connection->turn = 0;
		}
	}
	db_endpoints_apply(server->endpoints, change->endpoints);
	change->endpoints = NULL;
	server->accept_again = DB_TIME_NEVER;
	/* Requests that waited for their turn continue, and time limits may be earlier now. */
	server->late_answers = true;
	send_late_answers(server);
	db_server_change_free(change);
}

void db_server_answer(struct db_server *server, struct db_write_token token, uint8_t exception)
{
	struct db_connection *connection = find_connection(server, token.client);

	if (!connection && !db_plc_lines_answer(server->lines, token, exception))
		return;
	if (connection && !db_connection_answer(connection, token.sequence, exception))
		return;
	if (server->busy) {
		server->late_answers = true;
		return;
	}
	server->busy = true;
	if (!connection)
		server->late_answers = true;
	else
		keep_or_drop(server, connection,
		             db_connection_advance(connection, db_loop_now(server->loop)));
	send_late_answers(server);
}

bool db_server_certificate(const struct db_server *server, const uint8_t address[16],
                           const char **name, const char **role)
{
	return db_certificates_find(server ? server->certificates : NULL, address, name, role);
}

bool db_server_secure_status(const struct db_server *server, struct db_secure_status *status)
{
	return db_endpoints_secure_status(server->endpoints, status);
}

void db_server_keep_descriptors(struct db_server *server, unsigned count)
{
	server->kept = count;
}

void db_server_set_rights(struct db_server *server, const struct db_rights *rights)
{
	server->users_count = rights != NULL;
	if (rights)
		server->rights = *rights;
	server->busy = true;
	for (size_t i = server->count; i-- > 0;)
		adapt_connection(server, i);
	send_late_answers(server);
}

bool db_server_is_early(const struct db_server *server, uint32_t endpoint)
{
	return db_listener_is_early(db_endpoints_find(server->endpoints, endpoint)->listener);
}

uint16_t db_server_port(const struct db_server *server, uint32_t endpoint)
{
	return db_listener_port(db_endpoints_find(server->endpoints, endpoint)->listener);
}

void db_server_stats(const struct db_server *server, struct db_server_stats *stats)
{
	*stats = server->shared.stats;
}

size_t db_server_clients(const struct db_server *server, struct db_server_client *clients,
                         size_t max)
{
	db_time now = db_loop_now(server->loop);
	size_t count = db_plc_lines_list(server->lines, clients, max, now);

	for (size_t i = 0; i < server->count && count < max; i++) {
		const struct db_connection *c = server->connections[i];

		clients[count++] = (struct db_server_client){
			.client = c->client,
			.requests = c->requests,
			.idle = now > c->active_since ? now - c->active_since : 0,
			.connected = now > c->since ? now - c->since : 0,
		};
	}
	return count;
}

bool db_server_read_line(const struct db_server *server, size_t index, struct db_server_line *line)
{
	return db_plc_lines_read(server->lines, index, line);
}

void db_server_refused(struct db_server *server, const struct db_client *client,
                       enum db_refusal kind)
{
	struct db_connection *connection = find_connection(server, client->id);

	if (connection)
		db_connection_count_refusal(&server->shared, connection->peer, kind,
		                            db_loop_now(server->loop));
	else if (db_plc_lines_has(server->lines, client->id))
		count_line_refusal(server, client->address, kind);
}
