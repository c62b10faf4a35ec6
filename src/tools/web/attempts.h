/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Limits login attempts (users/attempts.h): for each address, for each user name, known or not, and
 * for each proxy, whatever addresses it tells. A browser that the user has logged in with before
 * has attempts of its own, which no stranger takes. IPv6 addresses count by their first 64 bits,
 * all of which one machine can have.
 *
 * Pure. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_ATTEMPTS_H
#define DRIVEBRIDGE_WEB_ATTEMPTS_H

#include "users/attempts.h"
#include "web/address.h"

/* Of an address, and of a browser. */
#define DB_WEB_ATTEMPTS_AT_ONCE 10
#define DB_WEB_ATTEMPT_EVERY (6 * DB_NS_PER_S)
/* Of a user's name, by strangers: a hundred in an hour. */
#define DB_WEB_ATTEMPT_USER_EVERY (36 * DB_NS_PER_S)
/* Of a proxy, for all browsers behind it. */
#define DB_WEB_ATTEMPTS_PROXY_AT_ONCE 60
#define DB_WEB_ATTEMPT_PROXY_EVERY (1 * DB_NS_PER_S)

struct db_web_attempt {
	struct db_web_address address;      /* the browser's */
	const struct db_web_address *proxy; /* that has told the address; NULL: it is the peer's */
	const char *user;
	const char *device; /* the browser's, see web/device.h; "": not known */
};

/* 0: the attempt is allowed, and counts. Else the time to wait; then it does not count. */
db_time db_web_attempts_take(struct db_attempts *attempts, const struct db_web_attempt *attempt,
                             db_time now);

/* The password was right: the attempt does not count. */
void db_web_attempts_give_back(struct db_attempts *attempts, const struct db_web_attempt *attempt);

#endif
