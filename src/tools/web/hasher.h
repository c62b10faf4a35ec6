/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Compares passwords with their hashes in a thread of its own: a comparison takes some hundredths
 * of a second of a processor, and the loop has to keep the dead man's rule. All calls from the
 * loop's thread.
 */
#ifndef DRIVEBRIDGE_WEB_HASHER_H
#define DRIVEBRIDGE_WEB_HASHER_H

#include <stdbool.h>
#include <stdint.h>

/* Most waiting jobs, and how many places of these are kept for known browsers. */
#define DB_WEB_HASHER_JOBS 8
#define DB_WEB_HASHER_KNOWN 2

struct db_web_hasher;

/* NULL without memory or without a thread; freed with db_web_hasher_free(), which waits for the
 * running comparison. NULL is allowed. */
struct db_web_hasher *db_web_hasher_new(void);
void db_web_hasher_free(struct db_web_hasher *hasher);

/* False: too many are waiting. The answer has the same `number`. `known`: it comes from a browser
 * that the user has logged in with before. */
bool db_web_hasher_ask(struct db_web_hasher *hasher, uint64_t number, const char *password,
                       const char *hash, bool known);

/* Readable when there are answers; they are taken one by one. */
int db_web_hasher_fd(const struct db_web_hasher *hasher);
bool db_web_hasher_take(struct db_web_hasher *hasher, uint64_t *number, bool *right);

#endif
