/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Limits login attempts (users/attempts.h): for each address and for each user name, known or not.
 * IPv6 addresses count by their first 64 bits, all of which one machine can have.
 *
 * Pure. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_ATTEMPTS_H
#define DRIVEBRIDGE_WEB_ATTEMPTS_H

#include "users/attempts.h"
#include "web/address.h"

#define DB_WEB_ATTEMPTS_AT_ONCE 10
#define DB_WEB_ATTEMPT_EVERY (6 * DB_NS_PER_S)

/* 0: the attempt is allowed, and counts. Else the time to wait; then it does not count. */
db_time db_web_attempts_take(struct db_attempts *attempts, const struct db_web_address *address,
                             const char *user, db_time now);

/* The password was right: the attempt does not count. */
void db_web_attempts_give_back(struct db_attempts *attempts, const struct db_web_address *address,
                               const char *user);

#endif
