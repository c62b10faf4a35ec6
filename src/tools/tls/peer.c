/* SPDX-License-Identifier: Apache-2.0 */
#include "tls/peer.h"

#include "client/clock.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/un.h>
#include <unistd.h>

/* Four of the longest frames; more are on the way or wait in the sockets. */
#define CHUNK 1040
/* Time for a whole greeting; and for the service's last answers to who has closed its side. */
#define GREETING_TIME (5 * DB_NS_PER_S)
#define FAREWELL_TIME (5 * DB_NS_PER_S)
/* The service may take less than the client sends for this time, or leave its connection waiting.
 */
#define BEHIND_TIME (500 * DB_NS_PER_MS)
/* Between two tries to connect, where the service's queue of connections is full. */
#define CONNECT_EVERY_US 10000
/* So long the last bytes of a client may wait here. */
#define LATE_MS 100
/* The least that the kernel has: what waits there is older than it looks. */
#define SERVICE_BUFFER 4608
/* Turns of one client before others have theirs. */
#define TURNS_MAX 16
/* A lost client is noticed as by the service on port 502. */
#define KEEPALIVE_S 10
#define KEEPALIVE_PROBES 3

enum state { GREETING, CONNECTING, OPEN };

/* Bytes in one direction. */
struct chunk {
	size_t begin;
	size_t end;
	unsigned char bytes[CHUNK];
};

struct db_tls_peer {
	struct db_tls_peers *peers;
	struct db_tls_trust *trust; /* its session's */
	enum state state;
	int fd;
	int service; /* -1: not yet */
	gnutls_session_t session;
	sd_event_source *io;
	sd_event_source *service_io;
	sd_event_source *connect; /* the next try */
	db_time begun;
	db_time behind; /* since when the service takes less than it sends; 0: it does not */
	db_time parted; /* since when it has closed its side; 0 */
	bool late;      /* what it sent last has waited too long here */
	struct db_secure_client client;
	char why[DB_TLS_WHY]; /* why its certificate was refused */
	struct chunk up;      /* to the service */
	struct chunk down;
};

static void set_option(int fd, int level, int option, int value)
{
	(void)setsockopt(fd, level, option, &value, sizeof(value));
}

/* --- the greeting ----------------------------------------------------------------------------- */

static int on_verify(gnutls_session_t session)
{
	struct db_tls_peer *peer = gnutls_session_get_ptr(session);
	struct db_secure_client found;
	bool good = db_tls_trust_verify(peer->trust, session, &found, peer->why);

	memcpy(found.address, peer->client.address, sizeof(found.address));
	found.port = peer->client.port;
	peer->client = found;
	return good ? 0 : GNUTLS_E_CERTIFICATE_ERROR;
}

static int on_greeting(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_tls_peer *peer = data;

	(void)source;
	(void)fd;
	(void)events;
	peer->peers->ready(peer->peers->context, peer);
	return 0;
}

struct db_tls_peer *db_tls_peer_new(struct db_tls_peers *peers, int fd, const uint8_t address[16],
                                    uint16_t port, db_time now)
{
	struct db_tls_peer *peer = calloc(1, sizeof(*peer));

	if (!peer) {
		close(fd);
		return NULL;
	}
	set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
	set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
	set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, KEEPALIVE_S);
	set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, KEEPALIVE_S);
	set_option(fd, IPPROTO_TCP, TCP_KEEPCNT, KEEPALIVE_PROBES);
	set_option(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, (KEEPALIVE_PROBES + 1) * KEEPALIVE_S * 1000);
	peer->peers = peers;
	peer->fd = fd;
	peer->service = -1;
	peer->begun = now;
	peer->trust = db_tls_trust_hold(peers->trust);
	peer->client.port = port;
	memcpy(peer->client.address, address, sizeof(peer->client.address));
	if (gnutls_init(&peer->session, GNUTLS_SERVER | GNUTLS_NONBLOCK | GNUTLS_NO_SIGNAL) != 0 ||
	    gnutls_priority_set(peer->session, peers->priorities) != 0 ||
	    gnutls_credentials_set(peer->session, GNUTLS_CRD_CERTIFICATE,
	                           peer->trust->credentials) != 0 ||
	    sd_event_add_io(peers->loop, &peer->io, fd, EPOLLIN, on_greeting, peer) < 0 ||
	    sd_event_source_set_priority(peer->io, SD_EVENT_PRIORITY_IDLE) < 0 ||
	    sd_event_source_set_enabled(peer->io, SD_EVENT_ONESHOT) < 0) {
		db_tls_peer_free(peer);
		return NULL;
	}
	gnutls_session_set_ptr(peer->session, peer);
	gnutls_session_set_verify_function(peer->session, on_verify);
	gnutls_certificate_server_set_request(peer->session, GNUTLS_CERT_REQUIRE);
	gnutls_transport_set_int(peer->session, fd);
	return peer;
}

void db_tls_peer_free(struct db_tls_peer *peer)
{
	if (!peer)
		return;
	sd_event_source_disable_unref(peer->io);
	sd_event_source_disable_unref(peer->service_io);
	sd_event_source_disable_unref(peer->connect);
	if (peer->session)
		gnutls_deinit(peer->session);
	if (peer->service >= 0)
		close(peer->service);
	close(peer->fd);
	db_tls_trust_let_go(peer->trust);
	explicit_bzero(peer, sizeof(*peer));
	free(peer);
}

enum db_tls_greeting db_tls_peer_greet(struct db_tls_peer *peer, char why[DB_TLS_WHY])
{
	int result = gnutls_handshake(peer->session);
	bool writes;

	if (result == 0)
		return DB_TLS_GREETING_DONE;
	if (!gnutls_error_is_fatal(result)) {
		writes = gnutls_record_get_direction(peer->session) == 1;
		(void)sd_event_source_set_io_events(peer->io, writes ? EPOLLOUT : EPOLLIN);
		(void)sd_event_source_set_enabled(peer->io, SD_EVENT_ONESHOT);
		return DB_TLS_GREETING_GOES_ON;
	}
	if (result == GNUTLS_E_CERTIFICATE_ERROR)
		(void)gnutls_alert_send(peer->session, GNUTLS_AL_FATAL, GNUTLS_A_BAD_CERTIFICATE);
	else
		(void)gnutls_alert_send_appropriate(peer->session, result);
	snprintf(why, DB_TLS_WHY, "%s",
	         peer->why[0] != '\0' ? peer->why :
	         result == GNUTLS_E_PREMATURE_TERMINATION || result == GNUTLS_E_PULL_ERROR ?
	                                "it left within its greeting" :
	                                gnutls_strerror(result));
	return DB_TLS_GREETING_FAILED;
}

/* --- Modbus to the service and back ----------------------------------------------------------- */

static int on_bytes(sd_event_source *source, int fd, uint32_t events, void *data);

/* What a step in one direction came to. */
enum step { STUCK, MOVED, GONE };

static enum step step_of(ssize_t moved)
{
	if (moved > 0)
		return MOVED;
	return moved < 0 && (errno == EAGAIN || errno == EINTR) ? STUCK : GONE;
}

static enum step tls_step_of(ssize_t moved)
{
	if (moved > 0)
		return MOVED;
	return moved == GNUTLS_E_AGAIN || moved == GNUTLS_E_INTERRUPTED ? STUCK : GONE;
}

static bool is_empty(const struct chunk *chunk)
{
	return chunk->begin == chunk->end;
}

/* A socket to the service, with who the client is on its way, and its first bytes, which become
 * empty. -1: the service is not there, or has no room (EAGAIN). */
static int connect_service(const struct db_tls_peer *peer, struct chunk *first, uint32_t waited_ms)
{
	struct sockaddr_un name = { .sun_family = AF_UNIX };
	struct db_secure_hello hello = { .kind = DB_SECURE_CLIENT, .client = peer->client };
	uint8_t bytes[DB_SECURE_HELLO_SIZE + CHUNK];
	size_t size = DB_SECURE_HELLO_SIZE + first->end - first->begin;
	int error = EPIPE;
	int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);

	snprintf(name.sun_path, sizeof(name.sun_path), "%s", peer->peers->socket);
	hello.client.waited_ms = waited_ms;
	db_secure_hello_write(&hello, bytes);
	memcpy(bytes + DB_SECURE_HELLO_SIZE, first->bytes + first->begin,
	       size - DB_SECURE_HELLO_SIZE);
	first->begin = first->end;
	if (fd < 0)
		return -1;
	set_option(fd, SOL_SOCKET, SO_SNDBUF, SERVICE_BUFFER);
	/* In one piece: the service looks at what has come with the hello. */
	if (connect(fd, (const struct sockaddr *)&name, sizeof(name)) != 0)
		error = errno;
	else if (send(fd, bytes, size, MSG_NOSIGNAL) == (ssize_t)size)
		return fd;
	close(fd);
	errno = error;
	return -1;
}

/* How long ago its last bytes came, if it has closed its side since, in ms. Otherwise 0. */
static uint32_t count_waited_ms(const struct db_tls_peer *peer)
{
	struct tcp_info info = { .tcpi_state = 0 };
	socklen_t size = sizeof(info);

	return getsockopt(peer->fd, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 &&
	                       info.tcpi_state == TCP_CLOSE_WAIT ?
	               info.tcpi_last_data_recv :
	               0;
}

/*
 * This program was stopped, or had no processor, and the client has gone meanwhile. What it had
 * sent is still carried out, a stop above all; but the service must not take it for a client that
 * is there. So it gets the bytes over another connection, with their age.
 */
static enum step hand_over_late(struct db_tls_peer *peer, uint32_t waited_ms)
{
	peer->late = true;
	peer->service_io = sd_event_source_disable_unref(peer->service_io);
	close(peer->service);
	peer->service = connect_service(peer, &peer->up, waited_ms);
	return peer->service >= 0 && sd_event_add_io(peer->peers->loop, &peer->service_io,
	                                             peer->service, EPOLLIN, on_bytes, peer) >= 0 ?
	               MOVED :
	               GONE;
}

/* From the client to the service. */
static enum step move_up(struct db_tls_peer *peer, db_time now)
{
	struct chunk *up = &peer->up;
	uint32_t waited_ms;
	enum step step;
	ssize_t moved;

	if (is_empty(up)) {
		if (peer->parted != 0)
			return STUCK;
		moved = gnutls_record_recv(peer->session, up->bytes, sizeof(up->bytes));
		step = tls_step_of(moved);
		if (moved == 0 || moved == GNUTLS_E_PREMATURE_TERMINATION) {
			/* What it has asked for is still answered. */
			peer->parted = now;
			(void)shutdown(peer->service, SHUT_WR);
			return STUCK;
		}
		if (step == STUCK)
			peer->behind = 0;
		if (step != MOVED)
			return step;
		up->begin = 0;
		up->end = (size_t)moved;
		waited_ms = peer->late ? 0 : count_waited_ms(peer);
		if (waited_ms >= LATE_MS)
			return hand_over_late(peer, waited_ms);
	}
	moved = send(peer->service, up->bytes + up->begin, up->end - up->begin,
	             MSG_NOSIGNAL | MSG_DONTWAIT);
	step = step_of(moved);
	if (step == MOVED)
		up->begin += (size_t)moved;
	else if (step == STUCK && peer->behind == 0)
		peer->behind = now;
	return step;
}

/* From the service to the client. */
static enum step move_down(struct db_tls_peer *peer)
{
	struct chunk *down = &peer->down;
	enum step step;
	ssize_t moved;

	if (is_empty(down)) {
		moved = recv(peer->service, down->bytes, sizeof(down->bytes), MSG_DONTWAIT);
		step = step_of(moved);
		if (step != MOVED)
			return step;
		down->begin = 0;
		down->end = (size_t)moved;
	}
	moved = gnutls_record_send(peer->session, down->bytes + down->begin,
	                           down->end - down->begin);
	step = tls_step_of(moved);
	if (step == MOVED)
		down->begin += (size_t)moved;
	return step;
}

static int on_bytes(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_tls_peer *peer = data;
	db_time now = db_client_now();
	enum step up = MOVED;
	enum step down = MOVED;
	uint32_t client = 0;
	uint32_t service = 0;

	(void)source;
	(void)fd;
	/* What the library has read ahead, one record at most, makes no event. */
	for (int i = 0; (up == MOVED || down == MOVED) &&
	                (i < TURNS_MAX || gnutls_record_check_pending(peer->session) > 0);
	     i++) {
		up = move_up(peer, now);
		down = up == GONE ? GONE : move_down(peer);
	}
	/* An end that is hung up for good would make events for ever. */
	if (down != GONE && (down != MOVED && (events & (EPOLLHUP | EPOLLERR))))
		up = GONE;
	if (up == GONE || down == GONE) {
		if (up != GONE)
			(void)gnutls_bye(peer->session, GNUTLS_SHUT_WR);
		peer->peers->ended(peer->peers->context, peer, NULL);
		return 0;
	}
	/* What is not sent waits for its receiver; only then more is read from its sender. */
	if (is_empty(&peer->up))
		client |= peer->parted == 0 ? EPOLLIN : 0;
	else
		service |= EPOLLOUT;
	if (is_empty(&peer->down))
		service |= EPOLLIN;
	else
		client |= EPOLLOUT;
	(void)sd_event_source_set_io_events(peer->io, client);
	(void)sd_event_source_set_io_events(peer->service_io, service);
	return 0;
}

/* Returns whether it is connected now, or will be. */
static bool connect_peer(struct db_tls_peer *peer, db_time now);

static int on_connect_again(sd_event_source *source, uint64_t time, void *data)
{
	struct db_tls_peer *peer = data;

	(void)source;
	(void)time;
	if (!connect_peer(peer, db_client_now()))
		peer->peers->ended(peer->peers->context, peer, "drivebridged is not there");
	return 0;
}

static bool connect_peer(struct db_tls_peer *peer, db_time now)
{
	peer->connect = sd_event_source_disable_unref(peer->connect);
	peer->service = connect_service(peer, &peer->up, 0);
	if (peer->service < 0)
		return errno == EAGAIN &&
		       sd_event_add_time_relative(peer->peers->loop, &peer->connect,
		                                  CLOCK_MONOTONIC, CONNECT_EVERY_US, 1000,
		                                  on_connect_again, peer) >= 0;
	if (sd_event_add_io(peer->peers->loop, &peer->io, peer->fd, EPOLLIN, on_bytes, peer) < 0 ||
	    sd_event_add_io(peer->peers->loop, &peer->service_io, peer->service, EPOLLIN, on_bytes,
	                    peer) < 0)
		return false;
	peer->state = OPEN;
	peer->begun = now;
	/* Its first request may have come with the end of its greeting, and make no event. */
	(void)on_bytes(peer->io, peer->fd, 0, peer);
	return true;
}

bool db_tls_peer_open(struct db_tls_peer *peer, db_time now)
{
	peer->io = sd_event_source_disable_unref(peer->io);
	peer->state = CONNECTING;
	peer->begun = now;
	return connect_peer(peer, now);
}

/* --- what is known of it ---------------------------------------------------------------------- */

const struct db_secure_client *db_tls_peer_client(const struct db_tls_peer *peer)
{
	return &peer->client;
}

void db_tls_peer_write(const struct db_tls_peer *peer, char text[DB_TLS_PEER_TEXT])
{
	static const uint8_t mapped[12] = { [10] = 0xFF, [11] = 0xFF };
	const uint8_t *address = peer->client.address;
	bool v4 = memcmp(address, mapped, sizeof(mapped)) == 0;
	char place[INET6_ADDRSTRLEN];

	(void)inet_ntop(v4 ? AF_INET : AF_INET6, v4 ? address + sizeof(mapped) : address, place,
	                sizeof(place));
	snprintf(text, DB_TLS_PEER_TEXT, "%s%s%s", place,
	         peer->client.name[0] != '\0' ? ", certificate " : "", peer->client.name);
}

bool db_tls_peer_check(const struct db_tls_peer *peer, int64_t wall_s, char why[DB_TLS_WHY])
{
	struct db_secure_client found;

	snprintf(why, DB_TLS_WHY, "its certificate has ended");
	return wall_s < peer->client.expires &&
	       db_tls_trust_verify(peer->peers->trust, peer->session, &found, why);
}

db_time db_tls_peer_deadline(const struct db_tls_peer *peer, const char **why)
{
	db_time parted = peer->parted == 0 ? DB_TIME_NEVER : peer->parted + FAREWELL_TIME;
	db_time behind = peer->behind == 0 ? DB_TIME_NEVER : peer->behind + BEHIND_TIME;

	if (peer->state == GREETING) {
		*why = "its greeting was not finished in time";
		return peer->begun + GREETING_TIME;
	}
	if (peer->state == CONNECTING) {
		*why = "drivebridged has too many new connections";
		return peer->begun + BEHIND_TIME;
	}
	*why = peer->behind == 0 ? "it has closed its side of the connection" :
	                           "it sends more than the service takes";
	return parted < behind ? parted : behind;
}
