/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Who sessions are: the user of the process, which the kernel vouches for, and the user whom that says to act for
 * (Introduce). Names stand here once; histories and claims of control have their number, in the place of a client's
 * address. So a name outlives its session. Bounded: when all places are taken, the one that no session has had
 * for longest goes to somebody new, and its number stands for nobody from then on.
 *
 * Pure. Internal to src/control.
 */
#ifndef DRIVEBRIDGE_CONTROL_ACTORS_H
#define DRIVEBRIDGE_CONTROL_ACTORS_H

#include "drivebridge/client.h"
#include "drivebridge/control_socket.h"

/* Places: a power of two, and far more than there can be sessions. */
#define DB_ACTORS_MAX 256

struct db_actor {
	uint32_t number;                               /* 0: the place is free */
	uint32_t user;                                 /* of the process */
	uint32_t sessions;                             /* that have it now */
	uint64_t left;                                 /* in the order of leaving, when none has */
	char process_user[DB_CLIENT_PROCESS_USER_MAX]; /* "": has no name */
	char named[DB_CLIENT_USER_MAX];                /* whom it acts for; "": it has not said */
};

/* Zeroed memory is an empty one. */
struct db_actors {
	uint64_t leavings;
	struct db_actor places[DB_ACTORS_MAX];
};

/*
 * Whether it can be the name of somebody whom a session acts for: 1 to 32 bytes of UTF-8 that people can see, no
 * space first or last; nothing that breaks a line, turns the direction of writing or has no width.
 */
bool db_actors_name_is_good(const char *name);

/* The same number for the same names, for as long as there is one: for one session, which lets go of it when it ends or
 * has another. At most DB_SESSIONS_MOST + 1 are held at the same time. */
uint32_t db_actors_hold(struct db_actors *actors, uint32_t user, const char *process_user,
                        const char *named);
void db_actors_let_go(struct db_actors *actors, uint32_t number);

/* Any client in words, see db_control_socket_words(). `actors` may be null. */
void db_actors_words(const struct db_actors *actors, const uint8_t address[16],
                     struct db_client_words *words);

/* Null: the number stands for nobody any more, or never did. */
const struct db_actor *db_actors_find(const struct db_actors *actors, uint32_t number);

#endif
