/* SPDX-License-Identifier: Apache-2.0 */
#include "server/peers.h"

#include <stdlib.h>
#include <string.h>

#define BURST_PART 10 /* of a second's requests */

db_time db_rate_take(struct db_rate *rate, unsigned per_second, db_time now)
{
	db_time each = DB_NS_PER_S / per_second;
	unsigned burst = per_second > BURST_PART ? per_second / BURST_PART : 1;
	db_time turn = rate->full - (burst - 1) * each;

	if (turn < now)
		turn = now;
	rate->full = (rate->full > turn ? rate->full : turn) + each;
	return turn;
}

#define SILENT_MIN_S 60
#define SILENT_MAX_S 3600

#define MESSAGES_PERIOD (60 * DB_NS_PER_S)

struct db_peers {
	db_peers_log_fn *log;
	void *context;
	db_time deadline;
	db_time period; /* beginning of the period in which `messages` were logged */
	unsigned messages;
	size_t count;
	struct db_peer peers[];
};

struct db_peers *db_peers_new(size_t connections, db_peers_log_fn *log, void *context)
{
	size_t count = connections + DB_PEERS_SPARE;
	struct db_peers *peers = calloc(1, sizeof(*peers) + count * sizeof(peers->peers[0]));

	if (!peers)
		return NULL;
	peers->log = log;
	peers->context = context;
	peers->deadline = DB_TIME_NEVER;
	peers->count = count;
	return peers;
}

void db_peers_copy(struct db_peers *peers, const struct db_peers *from)
{
	size_t used = 0;

	/* Those with connections first. */
	for (int idle = 0; idle < 2; idle++) {
		for (size_t i = 0; i < from->count && used < peers->count; i++) {
			const struct db_peer *peer = &from->peers[i];

			if (peer->seen != 0 && (peer->connections == 0) == idle)
				peers->peers[used++] = *peer;
		}
	}
	peers->deadline = from->deadline;
	peers->period = from->period;
	peers->messages = from->messages;
}

void db_peers_reset_rates(struct db_peers *peers)
{
	for (size_t i = 0; i < peers->count; i++)
		peers->peers[i].rate = (struct db_rate){ 0 };
}

struct db_peer *db_peers_find(struct db_peers *peers, const uint8_t address[16], db_time now)
{
	/* There are more places than connections: the one chosen has no connections. */
	struct db_peer *oldest = &peers->peers[0];

	for (size_t i = 0; i < peers->count; i++) {
		struct db_peer *peer = &peers->peers[i];

		if (peer->seen != 0 && memcmp(peer->address, address, sizeof(peer->address)) == 0) {
			peer->seen = now;
			return peer;
		}
		if (peer->connections == 0 &&
		    (oldest->connections > 0 || peer->seen < oldest->seen))
			oldest = peer;
	}
	*oldest = (struct db_peer){ .seen = now };
	memcpy(oldest->address, address, sizeof(oldest->address));
	return oldest;
}

/* --- logging ---------------------------------------------------------------------------------- */

/* False when enough was logged for now. */
static bool take_message(struct db_peers *peers, db_time now)
{
	if (peers->messages == 0 || now >= peers->period + MESSAGES_PERIOD) {
		peers->period = now;
		peers->messages = 0;
	}
	if (peers->messages == DB_PEERS_MESSAGES)
		return false;
	peers->messages++;
	return true;
}

/* Logs it if it is time; otherwise marks it for later. */
static void log_or_defer(struct db_peers *peers, struct db_peer *peer, enum db_refusal kind,
                         db_time now)
{
	struct db_peer_refusals *refusals = &peer->refusals[kind];
	db_time due = 0;

	if (refusals->logged_at != 0)
		due = refusals->logged_at + refusals->silent_s * DB_NS_PER_S;
	if (due <= now && take_message(peers, now)) {
		peers->log(peers->context, peer->address, kind, refusals->unlogged,
		           refusals->logged_at == 0);
		refusals->logged_at = now;
		refusals->unlogged = 0;
		refusals->silent_s = refusals->silent_s == 0 ? SILENT_MIN_S :
		                                               2 * refusals->silent_s;
		if (refusals->silent_s > SILENT_MAX_S)
			refusals->silent_s = SILENT_MAX_S;
		return;
	}
	if (due <= now)
		due = peers->period + MESSAGES_PERIOD;
	if (due < peers->deadline)
		peers->deadline = due;
}

void db_peers_refused(struct db_peers *peers, struct db_peer *peer, enum db_refusal kind,
                      db_time now)
{
	peer->seen = now;
	peer->refusals[kind].unlogged++;
	log_or_defer(peers, peer, kind, now);
}

db_time db_peers_deadline(const struct db_peers *peers)
{
	return peers->deadline;
}

void db_peers_log(struct db_peers *peers, db_time now)
{
	if (now < peers->deadline)
		return;
	peers->deadline = DB_TIME_NEVER;
	for (size_t i = 0; i < peers->count; i++) {
		for (unsigned kind = 0; kind < DB_REFUSAL_COUNT; kind++) {
			if (peers->peers[i].refusals[kind].unlogged > 0)
				log_or_defer(peers, &peers->peers[i], (enum db_refusal)kind, now);
		}
	}
}
