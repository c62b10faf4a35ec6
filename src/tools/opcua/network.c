/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/network.h"
#include "opcua/operands.h"

#include "client/clock.h"
#include "client/log.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <open62541/types.h>
#include <open62541/util.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

/* Most bytes that wait for one client. */
#define OUT_MAX ((size_t)1024 * 1024)

/* A client that accepts none of them for this time is disconnected. */
#define STUCK_MAX (10 * DB_NS_PER_S)

/* Most bytes passed on per client and turn of the loop: a request that takes long is hardly
 * shorter. */
#define BYTES_AT_ONCE 4096

/* Size of a message's header, which includes the message's length. */
#define HEAD_SIZE 8

/* Longest chunk of a message, of the server's configuration: longer ones are not valid. */
#define CHUNK_MAX 65535

/* The library's timed work may be delayed by this time, to do more of it at once. */
#define TOGETHER (5 * DB_NS_PER_MS)

/* IPv4 and IPv6. */
#define LISTENERS 4

/* A connection without a login is closed after this time, or earlier when another client needs its
 * place. */
#define LOGIN_MAX (10 * DB_NS_PER_S)

/* Places of connections that are being closed: the library needs a turn or two for that. */
#define CLOSING_MAX 16

struct db_opcua_network;

/* What the library handed over when it opened listeners, or a connection to a client. */
struct door {
	struct db_opcua_network *network;
	void *application;
	UA_ConnectionManager_connectionCallback callback;
};

struct connection {
	uintptr_t id; /* 0: free; else the descriptor */
	const struct door *door;
	bool listener;
	bool opening; /* by us, to a client: not connected yet */
	bool closing;
	bool served;       /* it is being served: further bytes wait */
	void **library;    /* the library's context of it */
	enum db_role role; /* the highest role logged in over it */
	char address[INET6_ADDRSTRLEN + 8];
	db_time since; /* when it was accepted, or its last login ended */
	db_time heard;
	/* header of the incoming message, and the number of its bytes received */
	UA_Byte head[HEAD_SIZE];
	size_t head_size;
	size_t left; /* of the incoming message */
	/* Its messages are not signed, or it is not known yet: each is passed on as a whole. */
	bool plain;
	UA_Byte *in; /* the begin of an incoming message; NULL: none */
	size_t in_size;
	char *out; /* NULL while nothing waits */
	size_t out_size;
	size_t out_sent;
	db_time out_since; /* when it last accepted bytes */
};

struct db_opcua_network {
	UA_Logger logger; /* its context is this struct */
	UA_EventLoop *loop;
	bool given;  /* the server frees the loop */
	int watched; /* an epoll instance with all connections and listeners */
	UA_ConnectionManager *tcp;
	/* The library's own functions. */
	UA_StatusCode (*open)(UA_ConnectionManager *cm, const UA_KeyValueMap *params,
	                      void *application, void *context,
	                      UA_ConnectionManager_connectionCallback callback);
	UA_StatusCode (*close)(UA_ConnectionManager *cm, uintptr_t id);
	struct door accepting;
	struct door calling;

	db_opcua_gone_fn *gone;
	db_opcua_served_fn *served;
	void *context;
	db_time now; /* of this turn */
	struct db_client_log_rations lines;
	struct db_client_log_ration library_lines;
	uintptr_t current;
	bool busy; /* bytes arrived or a connection ended in this turn */
	unsigned port;
	unsigned most; /* connections, without the listeners */
	size_t places;
	struct connection connections[];
};

/* --- the library's log ------------------------------------------------------------------------ */

__attribute__((format(printf, 4, 0))) static void log_line(void *context, UA_LogLevel level,
                                                           UA_LogCategory category,
                                                           const char *format, va_list arguments)
{
	enum db_client_level shown = level >= UA_LOGLEVEL_ERROR ? DB_CLIENT_ERROR :
	                                                          DB_CLIENT_WARNING;
	struct db_opcua_network *network = context;
	char line[512];

	(void)category;
	/* Lower levels have messages about each received byte. */
	if (level < UA_LOGLEVEL_WARNING)
		return;
	/* Its nodes about a subscription: the library adds them in the client's name, which may not
	 * add any. */
	if (strstr(format, "subscription diagnostics object"))
		return;
	vsnprintf(line, sizeof(line), format, arguments);
	db_client_log_rationed(&network->library_lines, db_client_now(), shown, "open62541: %s",
	                       line);
}

/* --- connections ------------------------------------------------------------------------------ */

static struct connection *find_connection(struct db_opcua_network *network, uintptr_t id)
{
	for (size_t i = 0; i < network->places; i++) {
		if (network->connections[i].id == id)
			return &network->connections[i];
	}
	return NULL;
}

/* The peer of a connection, or a listener's own address. */
static void name_address(struct connection *connection, unsigned *port)
{
	struct sockaddr_storage address = { .ss_family = AF_UNSPEC };
	socklen_t size = sizeof(address);
	int fd = (int)connection->id;
	int failed = connection->listener ? getsockname(fd, (struct sockaddr *)&address, &size) :
	                                    getpeername(fd, (struct sockaddr *)&address, &size);

	*port = 0;
	if (failed == 0 && address.ss_family == AF_INET) {
		const struct sockaddr_in *in = (const void *)&address;

		(void)inet_ntop(AF_INET, &in->sin_addr, connection->address,
		                sizeof(connection->address));
		*port = ntohs(in->sin_port);
	} else if (failed == 0 && address.ss_family == AF_INET6) {
		const struct sockaddr_in6 *in6 = (const void *)&address;

		(void)inet_ntop(AF_INET6, &in6->sin6_addr, connection->address,
		                sizeof(connection->address));
		*port = ntohs(in6->sin6_port);
	}
}

/* Also waits for room while bytes wait, and for the end of an opening. */
static void watch_connection(const struct db_opcua_network *network,
                             const struct connection *connection, int operation)
{
	bool writes = connection->out || connection->opening;
	struct epoll_event event = { .events = writes ? EPOLLIN | EPOLLOUT : EPOLLIN };

	(void)epoll_ctl(network->watched, operation, (int)connection->id, &event);
}

static void drop_connection(struct db_opcua_network *network, const struct connection *connection)
{
	network->tcp->closeConnection(network->tcp, connection->id);
}

/* True for a client's connection without a login. */
static bool is_stranger(const struct connection *connection)
{
	return connection->id != 0 && !connection->listener && connection->role == DB_ROLE_NONE &&
	       !connection->closing;
}

static size_t count_strangers(const struct db_opcua_network *network, const char *address)
{
	size_t count = 0;

	for (size_t i = 0; i < network->places; i++)
		count += is_stranger(&network->connections[i]) &&
		         strcmp(network->connections[i].address, address) == 0;
	return count;
}

/* The oldest connection without a login, of the address with the most of them: so nobody keeps
 * others out by connecting often. */
static struct connection *find_least(struct db_opcua_network *network)
{
	struct connection *least = NULL;
	size_t most = 0;

	for (size_t i = 0; i < network->places; i++) {
		struct connection *connection = &network->connections[i];
		size_t count = is_stranger(connection) ?
		                       count_strangers(network, connection->address) :
		                       0;

		if (count > most ||
		    (count > 0 && count == most && connection->since < least->since)) {
			least = connection;
			most = count;
		}
	}
	return least;
}

/* False: all connections have logins. */
static bool make_room(struct db_opcua_network *network)
{
	struct connection *least;
	size_t count = 0;

	for (size_t i = 0; i < network->places; i++) {
		const struct connection *connection = &network->connections[i];

		count += connection->id != 0 && !connection->listener && !connection->closing;
	}
	if (count < network->most)
		return true;
	least = find_least(network);
	if (least)
		drop_connection(network, least);
	return least;
}

static struct connection *add_connection(struct db_opcua_network *network, const struct door *door,
                                         uintptr_t id, bool opening)
{
	struct connection *connection = find_connection(network, 0);
	socklen_t size = sizeof(int);
	int listens = 0;
	unsigned port;

	/* The library uses the descriptor as the connection's id, which is not documented. */
	if (!connection || getsockopt((int)id, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) != 0)
		return NULL;
	if (listens == 0 && !make_room(network))
		return NULL;
	*connection = (struct connection){
		.id = id,
		.door = door,
		.listener = listens != 0,
		.opening = opening,
		.plain = true,
		.since = network->now,
		.heard = network->now,
	};
	name_address(connection, &port);
	if (connection->listener)
		network->port = port;
	watch_connection(network, connection, EPOLL_CTL_ADD);
	return connection;
}

/* How many of these bytes belong to the same message. */
static size_t find_end(struct connection *connection, const UA_Byte *bytes, size_t length)
{
	size_t size = 0;
	size_t rest;

	while (connection->left == 0 && size < length) {
		const UA_Byte *head = connection->head;

		connection->head[connection->head_size++] = bytes[size++];
		if (connection->head_size < HEAD_SIZE)
			continue;
		connection->head_size = 0;
		connection->left = head[4] | (size_t)head[5] << 8 | (size_t)head[6] << 16 |
		                   (size_t)head[7] << 24;
		/* The length includes the header. A smaller one is an error, which the library
		 * detects. */
		if (connection->left <= HEAD_SIZE)
			connection->left = length - size;
		else
			connection->left -= HEAD_SIZE;
		break;
	}
	rest = length - size < connection->left ? length - size : connection->left;
	connection->left -= rest;
	return size + rest;
}

static void pass_on(struct db_opcua_network *network, struct connection *connection,
                    UA_ConnectionState state, const UA_KeyValueMap *params, UA_ByteString message)
{
	uintptr_t id = connection->id;
	const struct door *door = connection->door;
	bool listener;

	if (message.length > 0)
		connection->heard = network->now;
	network->busy = true;
	network->current = id;
	door->callback(network->tcp, id, door->application, connection->library, state, params,
	               message);
	network->current = 0;
	if (state == UA_CONNECTIONSTATE_CLOSING) {
		listener = connection->listener;
		watch_connection(network, connection, EPOLL_CTL_DEL);
		free(connection->out);
		free(connection->in);
		*connection = (struct connection){ .id = 0 };
		if (!listener)
			network->gone(network->context, id);
	}
	network->served(network->context);
}

static void serve_before(struct db_opcua_network *network, enum db_role role);

/* A message that opens a channel says whether that has security. */
static bool is_secured(UA_ByteString message)
{
	static const char none[] = "http://opcfoundation.org/UA/SecurityPolicy#None";
	const size_t at = HEAD_SIZE + 4;
	const size_t size = sizeof(none) - 1;

	return message.length < at + 4 + size || message.data[at] != size ||
	       memcmp(message.data + at + 4, none, size) != 0;
}

/* Puts a message of a connection without security together, and mends it. False: more of it is to
 * come, or the connection is being closed. What is passed on is valid until the next call. */
static bool gather(struct db_opcua_network *network, struct connection *connection,
                   UA_ByteString *message)
{
	bool whole = connection->left == 0 && connection->head_size == 0;
	size_t size = connection->in_size + message->length;
	/* The library refuses one that says to be longer, without waiting for the rest. */
	bool valid = size + connection->left <= CHUNK_MAX;
	UA_Byte *grown;

	if (!connection->plain || (connection->in_size == 0 && !whole && !valid))
		return true;
	if (!whole || connection->in_size > 0) {
		grown = size <= CHUNK_MAX ? realloc(connection->in, size) : NULL;
		if (!grown) {
			drop_connection(network, connection);
			return false;
		}
		memcpy(grown + connection->in_size, message->data, message->length);
		connection->in = grown;
		connection->in_size = size;
		if (!whole && valid)
			return false;
		*message = (UA_ByteString){ .data = connection->in, .length = size };
		connection->in_size = 0;
	}
	if (message->length > HEAD_SIZE && memcmp(message->data, "OPN", 3) == 0)
		connection->plain = !is_secured(*message);
	db_opcua_operands_mend(message->data, message->length);
	return true;
}

/* One message after the other; before each one, clients that must not wait for it have their
 * turn. */
static void pass_messages_on(struct db_opcua_network *network, struct connection *connection,
                             const UA_KeyValueMap *params, UA_ByteString bytes)
{
	connection->served = true;
	while (bytes.length > 0 && !connection->closing) {
		UA_ByteString message = { .data = bytes.data };
		size_t taken = find_end(connection, bytes.data, bytes.length);

		message.length = taken;
		bytes.data += taken;
		bytes.length -= taken;
		if (!gather(network, connection, &message))
			continue;
		serve_before(network, connection->role);
		pass_on(network, connection, UA_CONNECTIONSTATE_ESTABLISHED, params, message);
		if (connection->in_size == 0) {
			free(connection->in);
			connection->in = NULL;
		}
	}
	connection->served = false;
}

/* Who moves drives goes before all others, and clients that are about to log in before observers:
 * they may be operators. */
static bool goes_before(const struct connection *connection, enum db_role role)
{
	if (connection->id == 0 || connection->closing || connection->served)
		return false;
	if (db_role_moves(connection->role))
		return !db_role_moves(role);
	return role != DB_ROLE_NONE && !db_role_moves(role) && is_stranger(connection);
}

/* Closed connections are left to the library. */
static void serve_before(struct db_opcua_network *network, enum db_role role)
{
	UA_Byte bytes[BYTES_AT_ONCE];

	for (size_t i = 0; i < network->places; i++) {
		struct connection *connection = &network->connections[i];
		ssize_t size = 0;

		if (goes_before(connection, role))
			size = recv((int)connection->id, bytes, sizeof(bytes), MSG_DONTWAIT);
		if (size > 0)
			pass_messages_on(network, connection, &UA_KEYVALUEMAP_NULL,
			                 (UA_ByteString){ .length = (size_t)size, .data = bytes });
	}
}

/* Between the library's sockets and its protocol. */
static void on_bytes(UA_ConnectionManager *cm, uintptr_t id, void *application,
                     void **connection_context, UA_ConnectionState state,
                     const UA_KeyValueMap *params, UA_ByteString message)
{
	const struct door *door = application;
	struct db_opcua_network *network = door->network;
	struct connection *connection = find_connection(network, id);
	unsigned port;

	(void)cm;
	if (!connection && state != UA_CONNECTIONSTATE_CLOSING)
		connection = add_connection(network, door, id,
		                            door == &network->calling &&
		                                    state == UA_CONNECTIONSTATE_OPENING);
	if (!connection) {
		/* There are too many. The library is not informed: it would take this end for that
		 * of the listener whose context the connection still has. */
		(void)shutdown((int)id, SHUT_RDWR);
		return;
	}
	connection->library = connection_context;
	if (connection->opening && state == UA_CONNECTIONSTATE_ESTABLISHED) {
		connection->opening = false;
		name_address(connection, &port);
		watch_connection(network, connection, EPOLL_CTL_MOD);
	}
	if (message.length > 0)
		pass_messages_on(network, connection, params, message);
	else
		pass_on(network, connection, state, params, message);
	/* The library mistakes a closed connection for one without data when errno is still set. */
	errno = 0;
}

static struct db_opcua_network *network_of(const UA_ConnectionManager *cm)
{
	return cm->eventSource.eventLoop->logger->context;
}

static UA_StatusCode open_connection(UA_ConnectionManager *cm, const UA_KeyValueMap *params,
                                     void *application, void *context,
                                     UA_ConnectionManager_connectionCallback callback)
{
	struct db_opcua_network *network = network_of(cm);
	const UA_Boolean *listens = UA_KeyValueMap_getScalar(
		params, UA_QUALIFIEDNAME(0, (char[]){ "listen" }), &UA_TYPES[UA_TYPES_BOOLEAN]);
	struct door *door = listens && *listens ? &network->accepting : &network->calling;

	*door = (struct door){ .network = network,
		               .application = application,
		               .callback = callback };
	return network->open(cm, params, door, context, on_bytes);
}

static UA_StatusCode close_connection(UA_ConnectionManager *cm, uintptr_t id)
{
	struct db_opcua_network *network = network_of(cm);
	struct connection *connection = find_connection(network, id);

	if (connection)
		connection->closing = true;
	return network->close(cm, id);
}

/* --- sending ---------------------------------------------------------------------------------- */

/* Number of bytes sent now; -1: the connection is broken. */
static ssize_t send_now(uintptr_t id, const void *bytes, size_t size)
{
	ssize_t sent;

	do
		sent = send((int)id, bytes, size, MSG_NOSIGNAL | MSG_DONTWAIT);
	while (sent < 0 && errno == EINTR);
	if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
		return 0;
	return sent;
}

static void log_dropped(struct db_opcua_network *network, const struct connection *connection)
{
	db_client_log_rationed_for(&network->lines, connection->address, network->now,
	                           DB_CLIENT_WARNING, "%s: dropped: it does not read its answers",
	                           connection->address);
}

static bool keep_rest(const struct db_opcua_network *network, struct connection *connection,
                      const UA_Byte *bytes, size_t size)
{
	size_t waits = connection->out_size - connection->out_sent;
	char *grown;

	if (waits + size > OUT_MAX)
		return false;
	if (connection->out && connection->out_sent > 0)
		memmove(connection->out, connection->out + connection->out_sent, waits);
	grown = realloc(connection->out, waits + size);
	if (!grown)
		return false;
	memcpy(grown + waits, bytes, size);
	connection->out = grown;
	connection->out_size = waits + size;
	connection->out_sent = 0;
	watch_connection(network, connection, EPOLL_CTL_MOD);
	return true;
}

static UA_StatusCode send_bytes(UA_ConnectionManager *cm, uintptr_t id,
                                const UA_KeyValueMap *params, UA_ByteString *buffer)
{
	struct db_opcua_network *network = network_of(cm);
	struct connection *connection = find_connection(network, id);
	UA_StatusCode status = UA_STATUSCODE_BADCONNECTIONCLOSED;
	ssize_t sent = 0;

	(void)params;
	if (connection && !connection->out) {
		sent = send_now(id, buffer->data, buffer->length);
		connection->out_since = network->now;
	}
	/* gcc's analyzer: what is kept is the connection's, which frees it. */
	if (connection && sent >= 0 &&
	    ((size_t)sent == buffer->length ||
	     keep_rest(network, connection, buffer->data + sent, buffer->length - (size_t)sent)))
		status = UA_STATUSCODE_GOOD;
	cm->freeNetworkBuffer(cm, id, buffer);
	if (connection && status != UA_STATUSCODE_GOOD) {
		if (sent >= 0)
			log_dropped(network, connection);
		drop_connection(network, connection);
	}
	return status;
}

static void flush_connection(struct db_opcua_network *network, struct connection *connection)
{
	ssize_t sent = send_now(connection->id, connection->out + connection->out_sent,
	                        connection->out_size - connection->out_sent);

	if (sent > 0) {
		connection->out_sent += (size_t)sent;
		connection->out_since = network->now;
	}
	if (connection->out_sent == connection->out_size) {
		free(connection->out);
		connection->out = NULL;
		connection->out_size = 0;
		connection->out_sent = 0;
		watch_connection(network, connection, EPOLL_CTL_MOD);
	} else if (sent < 0 || network->now - connection->out_since >= STUCK_MAX) {
		log_dropped(network, connection);
		drop_connection(network, connection);
	}
}

/* --- its life --------------------------------------------------------------------------------- */

struct db_opcua_network *db_opcua_network_new(unsigned connections, db_opcua_gone_fn *gone,
                                              db_opcua_served_fn *served, void *context)
{
	size_t wanted = (size_t)connections + LISTENERS + CLOSING_MAX;
	size_t places = wanted < DB_OPCUA_NETWORK_PLACES ? wanted : DB_OPCUA_NETWORK_PLACES;
	struct db_opcua_network *network = calloc(
		1, sizeof(*network) + places * sizeof(network->connections[0]));
	UA_UInt32 received = BYTES_AT_ONCE;

	if (!network)
		return NULL;
	network->gone = gone;
	network->served = served;
	network->context = context;
	network->places = places;
	network->most = connections;
	network->watched = epoll_create1(EPOLL_CLOEXEC);
	network->logger = (UA_Logger){ .log = log_line, .context = network };
	network->loop = UA_EventLoop_new_POSIX(&network->logger);
	network->tcp = UA_ConnectionManager_new_POSIX_TCP(UA_STRING("tcp connection manager"));
	if (network->watched < 0 || !network->loop || !network->tcp ||
	    UA_KeyValueMap_setScalar(&network->tcp->eventSource.params,
	                             UA_QUALIFIEDNAME(0, (char[]){ "recv-bufsize" }), &received,
	                             &UA_TYPES[UA_TYPES_UINT32]) != UA_STATUSCODE_GOOD ||
	    network->loop->registerEventSource(network->loop, &network->tcp->eventSource) !=
	            UA_STATUSCODE_GOOD) {
		if (network->tcp)
			network->tcp->eventSource.free(&network->tcp->eventSource);
		network->tcp = NULL;
		db_opcua_network_free(network);
		return NULL;
	}
	network->open = network->tcp->openConnection;
	network->close = network->tcp->closeConnection;
	network->tcp->openConnection = open_connection;
	network->tcp->closeConnection = close_connection;
	network->tcp->sendWithConnection = send_bytes;
	return network;
}

void db_opcua_network_free(struct db_opcua_network *network)
{
	if (!network)
		return;
	if (network->loop && !network->given)
		(void)network->loop->free(network->loop);
	for (size_t i = 0; i < network->places; i++) {
		free(network->connections[i].out);
		free(network->connections[i].in);
	}
	if (network->watched >= 0)
		(void)close(network->watched);
	free(network);
}

void db_opcua_network_give(struct db_opcua_network *network, UA_ServerConfig *settings)
{
	network->given = true;
	settings->eventLoop = network->loop;
	settings->logging = &network->logger;
}

unsigned db_opcua_network_port(const struct db_opcua_network *network)
{
	return network->port;
}

uintptr_t db_opcua_network_current(const struct db_opcua_network *network)
{
	return network->current;
}

const char *db_opcua_network_address(struct db_opcua_network *network, uintptr_t connection)
{
	const struct connection *found = connection ? find_connection(network, connection) : NULL;

	return found ? found->address : "";
}

db_time db_opcua_network_heard(struct db_opcua_network *network, uintptr_t connection)
{
	const struct connection *found = connection ? find_connection(network, connection) : NULL;

	return found ? found->heard : 0;
}

void db_opcua_network_know(struct db_opcua_network *network, uintptr_t connection,
                           enum db_role role)
{
	struct connection *found = connection ? find_connection(network, connection) : NULL;

	if (!found)
		return;
	if (found->role != DB_ROLE_NONE && role == DB_ROLE_NONE)
		found->since = network->now;
	found->role = role;
}

bool db_opcua_network_is_busy(const struct db_opcua_network *network)
{
	return network->busy;
}

int db_opcua_network_fd(const struct db_opcua_network *network)
{
	return network->watched;
}

size_t db_opcua_network_watch(const struct db_opcua_network *network, struct pollfd *fds,
                              size_t room)
{
	size_t used = 0;

	for (size_t i = 0; i < network->places && used < room; i++) {
		const struct connection *connection = &network->connections[i];

		if (connection->id != 0 && db_role_moves(connection->role))
			fds[used++] = (struct pollfd){ .fd = (int)connection->id,
				                       .events = POLLIN };
	}
	return used;
}

db_time db_opcua_network_due(const struct db_opcua_network *network, db_time now)
{
	UA_DateTime next = network->loop->nextCyclicTime(network->loop);
	UA_DateTime left = next - network->loop->dateTime_nowMonotonic(network->loop);
	db_time due;

	/* In tenths of microseconds, by the library's own clock. */
	left = left < 0 ? 0 : left > UA_DATETIME_SEC ? UA_DATETIME_SEC : left;
	due = now + left * 100;
	/* Each monitored item has its own time: those that are close are done together. */
	due += TOGETHER - 1 - (due + TOGETHER - 1) % TOGETHER;
	for (size_t i = 0; i < network->places; i++) {
		const struct connection *connection = &network->connections[i];

		if (connection->closing)
			continue;
		if (connection->out && connection->out_since + STUCK_MAX < due)
			due = connection->out_since + STUCK_MAX;
		if (is_stranger(connection) && connection->since + LOGIN_MAX < due)
			due = connection->since + LOGIN_MAX;
	}
	return due;
}

void db_opcua_network_flush(struct db_opcua_network *network, db_time now)
{
	network->now = now;
	network->busy = false;
	for (size_t i = 0; i < network->places; i++) {
		struct connection *connection = &network->connections[i];

		if (connection->out && !connection->closing)
			flush_connection(network, connection);
		if (is_stranger(connection) && now - connection->since >= LOGIN_MAX) {
			if (!connection->opening)
				db_client_log_rationed_for(
					&network->lines, connection->address, now, DB_CLIENT_INFO,
					"%s: closed: nobody has logged in over it",
					connection->address);
			drop_connection(network, connection);
		}
	}
}
