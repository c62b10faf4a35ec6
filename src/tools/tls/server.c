/* SPDX-License-Identifier: Apache-2.0 */
#include "tls/server.h"

#include "certificates/certificate.h"
#include "certificates/expiry.h"
#include "client/clock.h"
#include "client/log.h"
#include "tls/peer.h"
#include "tls/places.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

/* Forward secrecy, authenticated encryption, nothing older. Tickets are sent only where a key for
 * them is set; a session would outlive a revocation. */
#define CIPHERS                                                                         \
	":+ECDHE-ECDSA:+ECDHE-RSA:+GROUP-X25519:+GROUP-SECP256R1:+GROUP-SECP384R1"      \
	":+AES-128-GCM:+AES-256-GCM:+CHACHA20-POLY1305:+AEAD:+CTYPE-X509:+COMP-NULL"    \
	":+SIGN-ECDSA-SECP256R1-SHA256:+SIGN-ECDSA-SHA256:+SIGN-ECDSA-SECP384R1-SHA384" \
	":+SIGN-ECDSA-SHA384:+SIGN-EDDSA-ED25519:+SIGN-RSA-PSS-RSAE-SHA256"             \
	":+SIGN-RSA-PSS-RSAE-SHA384:+SIGN-RSA-PSS-RSAE-SHA512:+SIGN-RSA-SHA256"         \
	":+SIGN-RSA-SHA384:+SIGN-RSA-SHA512:%SERVER_PRECEDENCE"

#define BACKLOG 128
#define ACCEPTS_AT_ONCE 8
/* Pause when descriptors have run out. */
#define ACCEPT_PAUSE (100 * DB_NS_PER_MS)
/* How often a client's certificate, the own one and the list of revoked ones are looked at. */
#define CHECK_INTERVAL (30 * DB_NS_PER_S)
#define STATUS_INTERVAL (5 * DB_NS_PER_S)
/* A greeting costs a millisecond of the processor: afterwards they all rest for twice as long. */
#define REST_FACTOR 2
#define REST_MAX (20 * DB_NS_PER_MS)

struct member {
	struct db_tls_peer *peer;
	bool open;        /* it is a client; else it greets */
	db_time check_at; /* of a client's certificate */
	struct db_certificate_expiry expiry;
};

struct db_tls_server {
	const struct db_tls_config *config;
	struct db_tls_peers peers;
	int listener;
	sd_event_source *io;
	db_time accept_again; /* DB_TIME_NEVER: it accepts */
	db_time rest_until;   /* no greeting is served before */
	struct db_tls_places places;
	struct member *members; /* room for all clients and greetings */
	size_t count;
	size_t clients;
	db_time look_at; /* at its own certificate */
	struct db_certificate_expiry expiry;
	bool crl_said;
	struct db_client_log_rations refusals;
	struct db_client_log_ration comings;
	struct db_secure_status status;
	int teller; /* tells the service the status; -1 */
	db_time tell_at;
};

/* --- who is there ----------------------------------------------------------------------------- */

/* Each peer is one of them until it is dropped. */
static struct member *find(struct db_tls_server *server, const struct db_tls_peer *peer)
{
	struct member *member = server->members;

	while (member->peer != peer)
		member++;
	return member;
}

/* `why`: for the log; null. */
static void drop(void *context, struct db_tls_peer *peer, const char *why)
{
	struct db_tls_server *server = context;
	struct member *member = find(server, peer);
	char text[DB_TLS_PEER_TEXT];
	char address[DB_TLS_PEER_TEXT];

	if (why) {
		db_tls_peer_write(peer, text);
		snprintf(address, sizeof(address), "%.*s", (int)strcspn(text, ","), text);
		db_client_log_rationed_for(
			&server->refusals, address, db_client_now(), DB_CLIENT_WARNING,
			member->open ? "client %s disconnected: %s" : "client %s refused: %s", text,
			why);
	}
	db_tls_places_leave(&server->places, peer);
	if (member->open)
		server->clients--;
	else
		server->status.refused++;
	*member = server->members[--server->count];
	db_tls_peer_free(peer);
}

static void on_ready(void *context, struct db_tls_peer *peer)
{
	struct db_tls_server *server = context;

	db_tls_places_set_ready(&server->places, peer);
}

/* --- greetings -------------------------------------------------------------------------------- */

static bool read_address(const struct sockaddr_storage *from, uint8_t address[16], uint16_t *port)
{
	static const uint8_t mapped[12] = { [10] = 0xFF, [11] = 0xFF };
	struct sockaddr_in6 v6;
	struct sockaddr_in v4;

	if (from->ss_family == AF_INET6) {
		memcpy(&v6, from, sizeof(v6));
		memcpy(address, &v6.sin6_addr, 16);
		*port = ntohs(v6.sin6_port);
	} else if (from->ss_family == AF_INET) {
		memcpy(&v4, from, sizeof(v4));
		memcpy(address, mapped, sizeof(mapped));
		memcpy(address + sizeof(mapped), &v4.sin_addr, 4);
		*port = ntohs(v4.sin_port);
	}
	return from->ss_family == AF_INET6 || from->ss_family == AF_INET;
}

static void begin_greeting(struct db_tls_server *server, int fd,
                           const struct sockaddr_storage *from)
{
	struct db_tls_peer *displaced;
	struct db_tls_peer *peer;
	uint8_t address[16];
	uint16_t port;

	if (!read_address(from, address, &port)) {
		close(fd);
		return;
	}
	displaced = db_tls_places_displaced(&server->places, address);
	if (displaced) {
		server->status.displaced++;
		drop(server, displaced, "its greeting was not finished, and others came");
	}
	peer = db_tls_peer_new(&server->peers, fd, address, port, db_client_now());
	if (!peer)
		return;
	server->members[server->count++] = (struct member){ .peer = peer };
	db_tls_places_take(&server->places, address, peer);
}

static int on_connections(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_tls_server *server = data;

	(void)source;
	(void)events;
	for (int i = 0; i < ACCEPTS_AT_ONCE; i++) {
		struct sockaddr_storage from = { .ss_family = AF_UNSPEC };
		socklen_t size = sizeof(from);
		int client = accept4(fd, (struct sockaddr *)&from, &size,
		                     SOCK_NONBLOCK | SOCK_CLOEXEC);

		if (client >= 0) {
			begin_greeting(server, client, &from);
		} else {
			if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS ||
			    errno == ENOMEM) {
				(void)sd_event_source_set_enabled(server->io, SD_EVENT_OFF);
				server->accept_again = db_client_now() + ACCEPT_PAUSE;
			}
			break;
		}
	}
	return 0;
}

/* The greeting is done: a client, if there is a place for it. */
static void admit(struct db_tls_server *server, struct db_tls_peer *peer, db_time now)
{
	const struct db_secure_client *client = db_tls_peer_client(peer);
	struct member *member = find(server, peer);
	char text[DB_TLS_PEER_TEXT];
	size_t alike = 0;

	if (server->clients >= server->config->clients) {
		drop(server, peer, "there are as many clients as may be (clients)");
		return;
	}
	for (size_t i = 0; i < server->count; i++)
		alike += server->members[i].open &&
		         db_tls_places_same(db_tls_peer_client(server->members[i].peer)->address,
		                            client->address);
	if (alike >= server->config->clients_per_address) {
		drop(server, peer,
		     "its address has as many clients as it may have (clients-per-address)");
		return;
	}
	db_tls_peer_write(peer, text);
	db_tls_places_leave(&server->places, peer);
	member->open = true;
	member->check_at = now + CHECK_INTERVAL;
	db_certificate_expiry_set(&member->expiry, client->expires);
	server->clients++;
	server->status.accepted++;
	db_client_log_rationed(&server->comings, now, DB_CLIENT_INFO, "client %s: %s%s", text,
	                       client->role[0] != '\0' ? "role " : "no role in its certificate",
	                       client->role);
	(void)db_certificate_expiry_look(&member->expiry, text, db_client_wall_us() / 1000000);
	if (!db_tls_peer_open(peer, now))
		drop(server, peer, "drivebridged is not there");
}

static void greet(struct db_tls_server *server, db_time now)
{
	struct db_tls_peer *peer = db_tls_places_next(&server->places);
	char why[DB_TLS_WHY];
	db_time took;

	if (!peer)
		return;
	switch (db_tls_peer_greet(peer, why)) {
	case DB_TLS_GREETING_GOES_ON:
		break;
	case DB_TLS_GREETING_DONE:
		admit(server, peer, now);
		break;
	case DB_TLS_GREETING_FAILED:
		drop(server, peer, why);
		break;
	}
	took = db_client_now() - now;
	server->rest_until = now + took +
	                     (REST_FACTOR * took < REST_MAX ? REST_FACTOR * took : REST_MAX);
}

/* --- what is done now and then ---------------------------------------------------------------- */

/* One at a time: each takes a part of a millisecond. */
static void check_one(struct db_tls_server *server, db_time now)
{
	char why[DB_TLS_WHY];
	char text[DB_TLS_PEER_TEXT];

	for (size_t i = 0; i < server->count; i++) {
		struct member *member = &server->members[i];

		if (!member->open || member->check_at > now)
			continue;
		member->check_at = now + CHECK_INTERVAL;
		db_tls_peer_write(member->peer, text);
		(void)db_certificate_expiry_look(&member->expiry, text,
		                                 db_client_wall_us() / 1000000);
		if (!db_tls_peer_check(member->peer, db_client_wall_us() / 1000000, why))
			drop(server, member->peer, why);
		return;
	}
}

static void look_at_own(struct db_tls_server *server, db_time now)
{
	int64_t due = server->peers.trust->crl_expires;
	char what[300];
	char date[DB_CERTIFICATE_DATE];

	server->look_at = now + CHECK_INTERVAL;
	snprintf(what, sizeof(what), "certificate-file = %s", server->config->certificate_file);
	(void)db_certificate_expiry_look(&server->expiry, what, db_client_wall_us() / 1000000);
	if (due == 0 || db_client_wall_us() / 1000000 < due) {
		server->crl_said = false;
	} else if (!server->crl_said) {
		db_certificate_write_date(due, date);
		db_client_log(DB_CLIENT_WARNING,
		              "crl-file = %s: a newer list was due on %s; what this one revokes "
		              "stays revoked",
		              server->config->crl_file, date);
		server->crl_said = true;
	}
}

/* Tells the service how it is, so that its status and figures show it. */
static void tell_status(struct db_tls_server *server, db_time now)
{
	struct db_secure_hello hello = { .kind = DB_SECURE_STATUS };
	uint8_t bytes[DB_SECURE_HELLO_SIZE];
	struct db_secure_status *status = &server->status;

	server->tell_at = now + STATUS_INTERVAL;
	if (server->teller < 0) {
		struct sockaddr_un name = { .sun_family = AF_UNIX };
		int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);

		snprintf(name.sun_path, sizeof(name.sun_path), "%s", server->config->socket);
		if (fd < 0)
			return;
		if (connect(fd, (const struct sockaddr *)&name, sizeof(name)) != 0) {
			close(fd);
			return;
		}
		server->teller = fd;
	}
	status->expires = server->peers.trust->expires;
	status->crl_expires = server->peers.trust->crl_expires;
	status->client_expires = 0;
	status->clients = (uint32_t)server->clients;
	status->greetings = (uint32_t)(server->count - server->clients);
	for (size_t i = 0; i < server->count; i++) {
		int64_t expires = db_tls_peer_client(server->members[i].peer)->expires;

		if (server->members[i].open &&
		    (status->client_expires == 0 || expires < status->client_expires))
			status->client_expires = expires;
	}
	hello.status = server->status;
	db_secure_hello_write(&hello, bytes);
	if (send(server->teller, bytes, sizeof(bytes), MSG_NOSIGNAL) != (ssize_t)sizeof(bytes)) {
		close(server->teller);
		server->teller = -1;
	}
}

db_time db_tls_server_turn(void *context, db_time now, int64_t us)
{
	struct db_tls_server *server = context;
	const char *why;
	db_time next;

	(void)us;
	for (size_t i = server->count; i-- > 0;) {
		struct db_tls_peer *peer = server->members[i].peer;

		if (db_tls_peer_deadline(peer, &why) <= now)
			drop(server, peer, why);
	}
	if (server->rest_until <= now)
		greet(server, now);
	check_one(server, now);
	if (server->look_at <= now)
		look_at_own(server, now);
	if (server->tell_at <= now)
		tell_status(server, now);
	if (server->accept_again <= now) {
		(void)sd_event_source_set_enabled(server->io, SD_EVENT_ON);
		server->accept_again = DB_TIME_NEVER;
	}
	next = db_time_min(db_time_min(server->look_at, server->tell_at), server->accept_again);
	if (db_tls_places_any_ready(&server->places))
		next = db_time_min(next, server->rest_until);
	for (size_t i = 0; i < server->count; i++) {
		next = db_time_min(next, db_tls_peer_deadline(server->members[i].peer, &why));
		if (server->members[i].open)
			next = db_time_min(next, server->members[i].check_at);
	}
	return next;
}

/* --- its life --------------------------------------------------------------------------------- */

static void make_endpoint(const struct db_tls_config *config, struct sockaddr_storage *endpoint,
                          socklen_t *size)
{
	struct sockaddr_in6 v6 = { .sin6_family = AF_INET6,
		                   .sin6_port = htons((uint16_t)config->port),
		                   .sin6_addr = in6addr_any };
	struct sockaddr_in v4 = { .sin_family = AF_INET,
		                  .sin_port = htons((uint16_t)config->port) };

	memset(endpoint, 0, sizeof(*endpoint));
	if (inet_pton(AF_INET, config->address, &v4.sin_addr) == 1) {
		memcpy(endpoint, &v4, sizeof(v4));
		*size = sizeof(v4);
		return;
	}
	if (config->address[0] != '\0')
		(void)inet_pton(AF_INET6, config->address, &v6.sin6_addr);
	memcpy(endpoint, &v6, sizeof(v6));
	*size = sizeof(v6);
}

static bool listen_for_clients(struct db_tls_server *server, sd_event *loop)
{
	const char *address = server->config->address;
	struct sockaddr_storage endpoint;
	uint8_t bytes[16];
	socklen_t size;
	uint16_t port = 0;
	int on = 1;
	int off = 0;
	int fd;

	make_endpoint(server->config, &endpoint, &size);
	fd = socket(endpoint.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	server->listener = fd;
	if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0 ||
	    (endpoint.ss_family == AF_INET6 &&
	     setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof(off)) != 0) ||
	    /* An address that the machine does not have yet is waited for. */
	    setsockopt(fd, IPPROTO_IP, IP_FREEBIND, &on, sizeof(on)) != 0 ||
	    bind(fd, (const struct sockaddr *)&endpoint, size) != 0 || listen(fd, BACKLOG) != 0 ||
	    getsockname(fd, (struct sockaddr *)&endpoint, &size) != 0) {
		/* The server has the descriptor; gcc's analyzer takes it for lost. */
		db_client_log(DB_CLIENT_ERROR, "cannot listen on port %u of %s: %s",
		              server->config->port, address[0] ? address : "this machine",
		              strerror(errno));
		return false;
	}
	(void)read_address(&endpoint, bytes, &port);
	if (sd_event_add_io(loop, &server->io, fd, EPOLLIN, on_connections, server) < 0 ||
	    sd_event_source_set_priority(server->io, SD_EVENT_PRIORITY_IDLE) < 0)
		return false;
	db_client_log(DB_CLIENT_NOTICE, "listens on port %u of %s", (unsigned)port,
	              address[0] ? address : "this machine");
	return true;
}

static bool load_trust(struct db_tls_server *server)
{
	char why[DB_TLS_WHY];
	char doubt[DB_TLS_WHY];
	struct db_tls_trust *trust = db_tls_trust_load(server->config,
	                                               db_client_wall_us() / 1000000, why, doubt);

	if (!trust) {
		db_client_log(DB_CLIENT_ERROR, "%s%s", why,
		              server->peers.trust ? "; the former files stay in use" : "");
		return false;
	}
	if (doubt[0] != '\0')
		db_client_log(DB_CLIENT_WARNING, "%s", doubt);
	db_tls_trust_let_go(server->peers.trust);
	server->peers.trust = trust;
	server->crl_said = false;
	db_certificate_expiry_set(&server->expiry, trust->expires);
	return true;
}

void db_tls_server_renew(void *context)
{
	struct db_tls_server *server = context;
	db_time now = db_client_now();

	if (!load_trust(server))
		return;
	db_client_log(DB_CLIENT_NOTICE, "its certificates are read again%s",
	              server->config->crl_file[0] != '\0' ?
	                      "" :
	                      "; none is revoked, since it was started without crl-file");
	look_at_own(server, now);
	server->tell_at = now;
	for (size_t i = 0; i < server->count; i++)
		server->members[i].check_at = now;
}

struct db_tls_server *db_tls_server_new(sd_event *loop, const struct db_tls_config *config)
{
	static const char *const versions[] = {
		[DB_TLS_1_2] = "NONE:+VERS-TLS1.3:+VERS-TLS1.2" CIPHERS,
		[DB_TLS_1_3] = "NONE:+VERS-TLS1.3" CIPHERS,
	};
	struct db_tls_server *server = calloc(1, sizeof(*server));
	db_time now = db_client_now();

	if (!server)
		return NULL;
	server->config = config;
	server->listener = -1;
	server->teller = -1;
	server->accept_again = DB_TIME_NEVER;
	server->tell_at = now;
	server->look_at = now;
	server->peers = (struct db_tls_peers){
		.loop = sd_event_ref(loop),
		.socket = config->socket,
		.ready = on_ready,
		.ended = drop,
		.context = server,
	};
	server->members = calloc(config->clients + DB_TLS_GREETINGS, sizeof(*server->members));
	if (server->members &&
	    gnutls_priority_init(&server->peers.priorities, versions[config->min_version], NULL) ==
	            0 &&
	    load_trust(server) && listen_for_clients(server, loop))
		return server;
	db_tls_server_free(server);
	return NULL;
}

void db_tls_server_free(struct db_tls_server *server)
{
	if (!server)
		return;
	while (server->count > 0)
		drop(server, server->members[0].peer, NULL);
	sd_event_source_disable_unref(server->io);
	if (server->listener >= 0)
		close(server->listener);
	if (server->teller >= 0)
		close(server->teller);
	if (server->peers.priorities)
		gnutls_priority_deinit(server->peers.priorities);
	db_tls_trust_let_go(server->peers.trust);
	sd_event_unref(server->peers.loop);
	free(server->members);
	free(server);
}
