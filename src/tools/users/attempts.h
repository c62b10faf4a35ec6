/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Limits login attempts of each key, an address or a user's name, say: some at once and then one at
 * an interval. Bounded memory: when it is full, the least limited key is dropped.
 *
 * Pure. One thread.
 */
#ifndef DRIVEBRIDGE_USERS_ATTEMPTS_H
#define DRIVEBRIDGE_USERS_ATTEMPTS_H

#include "drivebridge/time.h"

#include <stddef.h>
#include <stdint.h>

#define DB_ATTEMPTS_PLACES 512

struct db_attempts {
	uint64_t seed; /* random, so that nobody can find colliding names */
	struct {
		uint64_t key; /* 0: free */
		db_time full; /* when all attempts are available again */
	} places[DB_ATTEMPTS_PLACES];
};

struct db_attempts_limit {
	unsigned most; /* at once */
	db_time every;
};

/* The key of these bytes; those of another kind have other keys. Never 0. */
uint64_t db_attempts_key(const struct db_attempts *attempts, char kind, const void *bytes,
                         size_t count);

/* Time until the next attempt; 0: now. */
db_time db_attempts_wait(const struct db_attempts *attempts, uint64_t key,
                         struct db_attempts_limit limit, db_time now);

/* Counts an attempt; `kept` is a key that is not dropped for it, 0: none. */
void db_attempts_count(struct db_attempts *attempts, uint64_t key, uint64_t kept,
                       struct db_attempts_limit limit, db_time now);

/* An attempt that was counted does not count. */
void db_attempts_give_back(struct db_attempts *attempts, uint64_t key,
                           struct db_attempts_limit limit);

#endif
