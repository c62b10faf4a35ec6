/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Connections of browsers, and which of them is closed when there is no place for another one.
 * Those of nobody who is logged in have three quarters of the places at most, and give way first:
 * of the address that has most, the oldest one of those that have got least far; addresses from
 * which somebody is logged in come last. A logged-in user's request that is under way always stays.
 * A sixteenth of the places is for those that have not sent a whole request yet: with TLS each
 * costs time whenever the others are served. Who opens one after another has to wait a little.
 *
 * An address is what one machine may have to itself: IPv6 counts by its first 64 bits.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_CONNECTIONS_H
#define DRIVEBRIDGE_WEB_CONNECTIONS_H

#include "drivebridge/time.h"
#include "users/attempts.h"
#include "web/address.h"

#include <stdint.h>

struct db_web_connection {
	struct db_web_address address; /* the prefix */
	uint64_t number;               /* higher is younger; 0: the place is free */
	bool counted;                  /* it counts for its address */
	bool heard;                    /* all headers of a request have arrived */
	bool known;                    /* its latest request came from a logged-in user */
	bool busy;                     /* that request is not finished */
	bool waits;                    /* for this program, not for the browser */
	bool leaving;
	bool receives;     /* the body of that request is not whole */
	unsigned waited;   /* ticks without a whole first head, or a whole request */
	void *handle;      /* for the caller, which needs it to close the connection */
	void *credentials; /* for the caller, that it began with */
};

struct db_web_connections;

/* Places in addition to `most`, for connections that were told to close and are not closed yet. */
#define DB_WEB_CONNECTIONS_LEAVING 64

/* So many new connections of an address at once, and then one at this interval. */
#define DB_WEB_CONNECTIONS_AT_ONCE 64
#define DB_WEB_CONNECTION_EVERY (DB_NS_PER_S / 16)
/* At least so many may have sent no whole request yet. */
#define DB_WEB_CONNECTIONS_HEADLESS 8

/* `seed` is random, see users/attempts.h. NULL without memory. Freed with free(). */
struct db_web_connections *db_web_connections_new(unsigned most, unsigned most_per_address,
                                                  uint64_t seed);

/*
 * True if there is a place for one more of this address, and it may come already; a proxy's
 * connections are not counted by address. `*leaver` is the connection to close for that, NULL:
 * none. It is marked as leaving, and counts no more.
 */
bool db_web_connections_admit(struct db_web_connections *connections,
                              const struct db_web_address *address, bool counted, db_time now,
                              struct db_web_connection **leaver);

/* A connection was opened, or closed. NULL: there is no place, which admit() prevents. */
struct db_web_connection *db_web_connections_add(struct db_web_connections *connections,
                                                 const struct db_web_address *address, bool counted,
                                                 void *handle);
void db_web_connections_remove(struct db_web_connections *connections,
                               struct db_web_connection *connection);

/*
 * To be called each DB_WEB_CONNECTIONS_TICK: calls `close` for each connection that has sent no
 * whole head within 10 s, or within 2 s while more than half of the places are taken, or no whole
 * request within 10 s. These are marked as leaving. Ticks are counted, not time: a busy machine is
 * not the client's fault.
 */
#define DB_WEB_CONNECTIONS_TICK (100 * DB_NS_PER_MS)
void db_web_connections_tick(struct db_web_connections *connections, void (*close)(void *handle));

/* Whether so many have sent no whole request yet that strangers must be at work. */
bool db_web_connections_crowd(const struct db_web_connections *connections);

/* Includes those that are leaving. */
unsigned db_web_connections_count(const struct db_web_connections *connections);

#endif
