/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The server's record of each address: its connections, its rate limit, and refusals, so that each
 * is logged once and not with every request.
 *
 * The first refusal of a kind is logged at once, later ones by their count: after a minute, then
 * after twice as long each time, up to an hour. With any number of addresses, no more than
 * DB_PEERS_MESSAGES a minute are logged; the counters of the server are complete.
 *
 * Pure: no clock, no I/O, no allocation after db_peers_new(). Network thread only.
 */
#ifndef DRIVEBRIDGE_SERVER_PEERS_H
#define DRIVEBRIDGE_SERVER_PEERS_H

#include "drivebridge/server.h"
#include "drivebridge/time.h"

/*
 * A token bucket for requests: a number per second, a tenth of them at once. A request that is too
 * early is not refused but gets the time of its turn, in the order of arrival. Pure: time is passed
 * in.
 */

/* All zero: a full bucket. */
struct db_rate {
	db_time full; /* when all tokens will be there again */
};

/*
 * Takes a token; returns when it is there: `now`, or the later time of its turn, which is then
 * reserved for it whether or not it is used. per_second > 0.
 */
db_time db_rate_take(struct db_rate *rate, unsigned per_second, db_time now);

#define DB_PEERS_MESSAGES 30

/* Minimum number of addresses without a connection that are remembered. */
#define DB_PEERS_SPARE 64

struct db_peer_refusals {
	db_time logged_at; /* 0: never */
	uint32_t unlogged; /* refusals since then */
	uint32_t silent_s; /* pause before it is logged again, s */
};

struct db_peer {
	uint8_t address[16]; /* IPv6, or IPv4 v4-mapped */
	unsigned connections;
	db_time seen; /* 0: this place was never used */
	struct db_rate rate;
	struct db_peer_refusals refusals[DB_REFUSAL_COUNT];
};

/* To be logged: `count` refusals of a kind since the last time; first: there was none before. */
typedef void db_peers_log_fn(void *context, const uint8_t address[16], enum db_refusal kind,
                             uint32_t count, bool first);

struct db_peers;

/* `connections`: their maximum number. To be freed with free(). Null when out of memory. */
struct db_peers *db_peers_new(size_t connections, db_peers_log_fn *log, void *context);

/* Copies another object's records, as far as there is room: those with connections first, for which
 * there must be. Pointers of connections must then be looked up again. */
void db_peers_copy(struct db_peers *peers, const struct db_peers *from);

/* Resets all rate limits. */
void db_peers_reset_rates(struct db_peers *peers);

/* The entry of an address; when it is new it takes the place of the one not seen for longest. Valid
 * until the next call, or as long as it has connections, which the caller counts. */
struct db_peer *db_peers_find(struct db_peers *peers, const uint8_t address[16], db_time now);

void db_peers_refused(struct db_peers *peers, struct db_peer *peer, enum db_refusal kind,
                      db_time now);

/* When db_peers_log() is due; DB_TIME_NEVER while there is nothing to log. */
db_time db_peers_deadline(const struct db_peers *peers);
void db_peers_log(struct db_peers *peers, db_time now);

#endif
