/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One client: its greeting, in which it shows its certificate; then its Modbus, which goes to the
 * service and back as it is. Nothing of it is kept longer than the service lets it wait: who sends
 * more than the service takes is disconnected, because late bytes must not pass for a sign of life.
 * Network addresses are IPv6, or IPv4 v4-mapped. One thread.
 */
#ifndef DRIVEBRIDGE_TLS_PEER_H
#define DRIVEBRIDGE_TLS_PEER_H

#include "drivebridge/time.h"
#include "tls/trust.h"

#include <systemd/sd-event.h>

struct db_tls_peer;

/* What all have in common. */
struct db_tls_peers {
	sd_event *loop;
	const char *socket; /* of the service */
	gnutls_priority_t priorities;
	struct db_tls_trust *trust; /* for new ones, and for checks */
	/* Bytes of a greeting are there: db_tls_peer_greet() is to be called, sooner or later. */
	void (*ready)(void *context, struct db_tls_peer *peer);
	/* It is over, and to be freed. `why`: what people should know, or null. */
	void (*ended)(void *context, struct db_tls_peer *peer, const char *why);
	void *context;
};

/* Takes over the descriptor, also on failure. Null when out of memory. */
struct db_tls_peer *db_tls_peer_new(struct db_tls_peers *peers, int fd, const uint8_t address[16],
                                    uint16_t port, db_time now);
/* Closes both connections at once. Null is fine. */
void db_tls_peer_free(struct db_tls_peer *peer);

/* Its address and port; after the greeting all of it. */
const struct db_secure_client *db_tls_peer_client(const struct db_tls_peer *peer);
/* "192.168.10.5", with the name of its certificate after the greeting. */
#define DB_TLS_PEER_TEXT 128
void db_tls_peer_write(const struct db_tls_peer *peer, char text[DB_TLS_PEER_TEXT]);

enum db_tls_greeting {
	DB_TLS_GREETING_GOES_ON,
	DB_TLS_GREETING_DONE,   /* call db_tls_peer_open(), or free it */
	DB_TLS_GREETING_FAILED, /* free it; `why` says why */
};

/* Goes on with the greeting as far as its bytes allow. */
enum db_tls_greeting db_tls_peer_greet(struct db_tls_peer *peer, char why[DB_TLS_WHY]);

/* Connects it with the service, within half a second where that has many new connections. False: it
 * is not there; free it. */
bool db_tls_peer_open(struct db_tls_peer *peer, db_time now);

/* Whether its certificate is still good, by the trust of now. False: `why` says why not. */
bool db_tls_peer_check(const struct db_tls_peer *peer, int64_t wall_s, char why[DB_TLS_WHY]);

/* When it has to be over unless something comes of it, and then why; DB_TIME_NEVER. */
db_time db_tls_peer_deadline(const struct db_tls_peer *peer, const char **why);

#endif
