/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The identities of sessions: the user of the process, confirmed by the kernel, and the user for
 * whom it says it acts (Introduce). Names are stored here once; histories and claims of control
 * have their number, instead of a client's address. So a name outlives its session. Bounded: when
 * all places are taken, the one without sessions for longest is reused, and its number is invalid
 * from then on.
 *
 * Pure. Internal to src/bridge/control.
 */
#ifndef DRIVEBRIDGE_CONTROL_ACTORS_H
#define DRIVEBRIDGE_CONTROL_ACTORS_H

#include "drivebridge/client.h"
#include "drivebridge/control_socket.h"

/* Number of places: a power of two, and far more than there can be sessions. */
#define DB_ACTORS_MAX 256

struct db_actor {
	uint32_t number;   /* 0: the place is free */
	uint32_t user;     /* user of the process */
	uint32_t sessions; /* sessions that have it now */
			   /* order of leaving, when there are no sessions */
	uint64_t left;
	char process_user[DB_CLIENT_PROCESS_USER_MAX]; /* "": no name */
	char named[DB_CLIENT_USER_MAX];                /* for whom it acts; "": not stated */
};

/* Zeroed memory is an empty object. */
struct db_actors {
	uint64_t leavings;
	struct db_actor places[DB_ACTORS_MAX];
};

/*
 * True if it can be the name of a user for whom a session acts: 1 to 32 bytes of visible UTF-8, no
 * space first or last; nothing that breaks a line, changes the direction of writing or has no
 * width.
 */
bool db_actors_name_is_good(const char *name);

/* Returns the same number for the same names while it is valid: held for one session, which
 * releases it when it ends or gets another one. At most DB_SESSIONS_MOST + 1 are held at the same
 * time. */
uint32_t db_actors_hold(struct db_actors *actors, uint32_t user, const char *process_user,
                        const char *named);
void db_actors_let_go(struct db_actors *actors, uint32_t number);

/* The names of any client, see db_control_socket_words(). `actors` may be null. */
void db_actors_words(const struct db_actors *actors, const uint8_t address[16],
                     struct db_client_words *words);

/* Null: the number is no longer valid, or never was. */
const struct db_actor *db_actors_find(const struct db_actors *actors, uint32_t number);

#endif
