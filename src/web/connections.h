/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Connections of browsers, and which of them gives way when there is no place for another one. Who sends half a request,
 * or a whole one without being logged in, keeps nobody out: the oldest of the address that has most of those goes
 * first, then a connection of somebody who is logged in and asks nothing at the moment. A request of theirs that is under way
 * always stays.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_CONNECTIONS_H
#define DRIVEBRIDGE_WEB_CONNECTIONS_H

#include "web/address.h"

#include <stdint.h>

struct db_web_connection {
	struct db_web_address address;
	uint64_t number; /* the higher, the younger; 0: the place is free */
	bool counted;    /* among those of its address */
	bool heard;      /* a whole head has come */
	bool known;      /* the latest came from somebody who is logged in */
	bool busy;       /* that request has no end yet */
	bool waits;      /* for what this program is to do, and not for the browser */
	bool leaving;
	void *handle; /* whoever asked for the place may keep what he needs for closing it */
};

struct db_web_connections;

/* Those that have been told to go, and are still to be closed, come on top of `most`. */
#define DB_WEB_CONNECTIONS_LEAVING 64

/* NULL without memory. Freed with db_web_connections_free(), NULL is allowed. */
struct db_web_connections *db_web_connections_new(unsigned most, unsigned most_per_address);
void db_web_connections_free(struct db_web_connections *connections);

/*
 * Whether there is a place for one more of this address; a proxy's are not counted by address. `*leaver` is the one that has
 * to be closed for that, NULL: none. It is marked as leaving, and counts no more.
 */
bool db_web_connections_admit(struct db_web_connections *connections,
                              const struct db_web_address *address, bool counted,
                              struct db_web_connection **leaver);

/* One has come, or gone. NULL: there is no place, which admit() has kept from happening. */
struct db_web_connection *db_web_connections_add(struct db_web_connections *connections,
                                                 const struct db_web_address *address, bool counted,
                                                 void *handle);
void db_web_connections_remove(struct db_web_connections *connections,
                               struct db_web_connection *connection);

/* With those that are leaving. */
unsigned db_web_connections_count(const struct db_web_connections *connections);

#endif
