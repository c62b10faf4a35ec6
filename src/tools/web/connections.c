/* SPDX-License-Identifier: Apache-2.0 */
#include "web/connections.h"

#include <stdlib.h>
#include <string.h>

struct db_web_connections {
	unsigned most;
	unsigned most_per_address;
	unsigned count;
	size_t room; /* `most`, and those that are leaving */
	uint64_t last;
	struct db_attempts arrivals;
	struct db_web_connection places[];
};

/* Ticks until a first head has to be there, or a whole request, and when places run short. */
#define PATIENCE 100
#define PATIENCE_SHORT 20

/* Which connection is closed first; the highest rank never is. Up to WAITING nobody is logged in.
 */
enum rank { HEADLESS, STRANGER, WAITING, IDLE, STAYS };

struct db_web_connections *db_web_connections_new(unsigned most, unsigned most_per_address,
                                                  uint64_t seed)
{
	size_t room = most + DB_WEB_CONNECTIONS_LEAVING;
	struct db_web_connections *connections = calloc(
		1, sizeof(*connections) + room * sizeof(connections->places[0]));

	if (connections) {
		connections->room = room;
		connections->most = most;
		connections->most_per_address = most_per_address;
		connections->arrivals.seed = seed;
	}
	return connections;
}

static bool is_same(const struct db_web_address *one, const struct db_web_address *other)
{
	return memcmp(one, other, sizeof(*one)) == 0;
}

static bool is_there(const struct db_web_connection *connection)
{
	return connection->number != 0 && !connection->leaving;
}

static enum rank rank_of(const struct db_web_connection *connection)
{
	if (!connection->heard)
		return HEADLESS;
	if (!connection->known)
		return connection->waits ? WAITING : STRANGER;
	return connection->busy ? STAYS : IDLE;
}

/* Connections of this address with this rank or a lower one. `home`: somebody is logged in from it,
 * and may open another one. */
static unsigned count_of(const struct db_web_connections *connections,
                         const struct db_web_address *address, enum rank rank, bool *home)
{
	unsigned count = 0;

	*home = false;
	for (size_t i = 0; i < connections->room; i++) {
		const struct db_web_connection *one = &connections->places[i];

		if (!is_there(one) || !is_same(&one->address, address))
			continue;
		count += rank_of(one) <= rank;
		*home = *home || one->known;
	}
	return count;
}

static bool goes_before(const struct db_web_connection *one, const struct db_web_connection *other)
{
	return rank_of(one) != rank_of(other) ? rank_of(one) < rank_of(other) :
	                                        one->number < other->number;
}

/*
 * The connection of this address, or of all with NULL, to close first, of those with at most this
 * rank; NULL: there is none. Of all it is one of the address that has most of these: whoever opens
 * many only takes places of his own, and who has just come with one is not the first to go because
 * he has got less far. Addresses from which somebody is logged in come last.
 */
static struct db_web_connection *find_leaver(struct db_web_connections *connections,
                                             const struct db_web_address *address,
                                             enum rank highest)
{
	struct db_web_connection *leaver = NULL;
	bool leaver_is_home = false;
	unsigned most = 0;

	for (size_t i = 0; i < connections->room; i++) {
		struct db_web_connection *one = &connections->places[i];
		unsigned count;
		bool home;

		if (!is_there(one) || rank_of(one) > highest ||
		    (address && !is_same(&one->address, address)))
			continue;
		/* What is known of this address is known. */
		if (leaver && is_same(&leaver->address, &one->address)) {
			leaver = goes_before(one, leaver) ? one : leaver;
			continue;
		}
		count = count_of(connections, &one->address, highest, &home);
		if (leaver && (home != leaver_is_home ?
		                       home :
		                       count < most || (count == most && goes_before(leaver, one))))
			continue;
		leaver = one;
		leaver_is_home = home;
		most = count;
	}
	return leaver;
}

bool db_web_connections_crowd(const struct db_web_connections *connections)
{
	unsigned headless = 0;

	for (size_t i = 0; i < connections->room; i++)
		headless += is_there(&connections->places[i]) &&
		            rank_of(&connections->places[i]) == HEADLESS;
	return headless >= DB_WEB_CONNECTIONS_HEADLESS;
}

/* Whether an address may open one more now. */
static bool may_come(struct db_web_connections *connections, const struct db_web_address *prefix,
                     db_time now)
{
	static const struct db_attempts_limit limit = { .most = DB_WEB_CONNECTIONS_AT_ONCE,
		                                        .every = DB_WEB_CONNECTION_EVERY };
	uint64_t key = db_attempts_key(&connections->arrivals, 'c', prefix->bytes,
	                               sizeof(prefix->bytes));

	if (db_attempts_wait(&connections->arrivals, key, limit, now) > 0)
		return false;
	db_attempts_count(&connections->arrivals, key, 0, limit, now);
	return true;
}

bool db_web_connections_admit(struct db_web_connections *connections,
                              const struct db_web_address *address, bool counted, db_time now,
                              struct db_web_connection **leaver)
{
	struct db_web_address prefix = db_web_address_prefix(address);
	unsigned there = 0;
	unsigned alike = 0;
	unsigned strangers = 0;
	unsigned headless = 0;
	unsigned most_headless = connections->most / 16;

	if (most_headless < DB_WEB_CONNECTIONS_HEADLESS)
		most_headless = DB_WEB_CONNECTIONS_HEADLESS;
	*leaver = NULL;
	for (size_t i = 0; i < connections->room; i++) {
		const struct db_web_connection *one = &connections->places[i];

		if (!is_there(one))
			continue;
		there++;
		alike += one->counted && is_same(&one->address, &prefix);
		strangers += rank_of(one) <= WAITING;
		headless += rank_of(one) == HEADLESS;
	}
	if (connections->count >= connections->room ||
	    (counted && !may_come(connections, &prefix, now)))
		return false;
	if (counted && alike >= connections->most_per_address)
		*leaver = find_leaver(connections, &prefix, IDLE);
	else if (there >= connections->most && strangers == 0)
		*leaver = find_leaver(connections, NULL, IDLE);
	else if (headless >= most_headless)
		*leaver = find_leaver(connections, NULL, HEADLESS);
	else if (there >= connections->most ||
	         strangers >= connections->most - connections->most / 4)
		*leaver = find_leaver(connections, NULL, WAITING);
	else
		return true;
	if (*leaver)
		(*leaver)->leaving = true;
	return *leaver;
}

void db_web_connections_tick(struct db_web_connections *connections, void (*close)(void *handle))
{
	unsigned patience = connections->count > connections->most / 2 ? PATIENCE_SHORT : PATIENCE;

	for (size_t i = 0; i < connections->room; i++) {
		struct db_web_connection *one = &connections->places[i];
		bool headless = rank_of(one) == HEADLESS;

		if (!is_there(one) || (!headless && !one->receives) ||
		    ++one->waited <= (headless ? patience : PATIENCE))
			continue;
		one->leaving = true;
		close(one->handle);
	}
}

struct db_web_connection *db_web_connections_add(struct db_web_connections *connections,
                                                 const struct db_web_address *address, bool counted,
                                                 void *handle)
{
	for (size_t i = 0; i < connections->room; i++) {
		struct db_web_connection *one = &connections->places[i];

		if (one->number != 0)
			continue;
		*one = (struct db_web_connection){ .address = db_web_address_prefix(address),
			                           .number = ++connections->last,
			                           .counted = counted,
			                           .handle = handle };
		connections->count++;
		return one;
	}
	return NULL;
}

void db_web_connections_remove(struct db_web_connections *connections,
                               struct db_web_connection *connection)
{
	if (!connection || connection->number == 0)
		return;
	connection->number = 0;
	connections->count--;
}

unsigned db_web_connections_count(const struct db_web_connections *connections)
{
	return connections->count;
}
