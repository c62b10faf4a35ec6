/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How often a login may be tried: for each address and for each user name, known or not, some at once and then one each
 * DB_WEB_ATTEMPT_EVERY. Addresses of IPv6 count by their first 64 bits, of which one machine has all. Bounded memory:
 * of very many the one that is limited least is forgotten.
 *
 * Pure. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_ATTEMPTS_H
#define DRIVEBRIDGE_WEB_ATTEMPTS_H

#include "drivebridge/time.h"
#include "web/address.h"

#include <stdint.h>

#define DB_WEB_ATTEMPTS_AT_ONCE 10
#define DB_WEB_ATTEMPT_EVERY (6 * DB_NS_PER_S)

#define DB_WEB_ATTEMPTS_PLACES 512

struct db_web_attempts {
	uint64_t seed; /* random, so that nobody finds names that collide */
	struct {
		uint64_t key; /* 0: free */
		db_time full; /* all attempts are there again */
	} places[DB_WEB_ATTEMPTS_PLACES];
};

/* 0: it may be tried, and counts. Else so long to wait; then it does not count. */
db_time db_web_attempts_take(struct db_web_attempts *attempts, const struct db_web_address *address,
                             const char *user, db_time now);

/* It was right: it does not count. */
void db_web_attempts_give_back(struct db_web_attempts *attempts,
                               const struct db_web_address *address, const char *user);

#endif
