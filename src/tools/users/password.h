/* SPDX-License-Identifier: Apache-2.0 */
/* Passwords: which are good enough, and their hashes (crypt(5)). No state. */
#ifndef DRIVEBRIDGE_USERS_PASSWORD_H
#define DRIVEBRIDGE_USERS_PASSWORD_H

#include <stdbool.h>
#include <stddef.h>

#define DB_PASSWORD_MAX 256 /* bytes */
#define DB_PASSWORD_HASH_MAX 159

/* The range of the settings that say how many characters one has at least. */
#define DB_PASSWORD_MIN_LEAST 8
#define DB_PASSWORD_MIN_USUAL "12"
#define DB_PASSWORD_MIN_MOST 64

/*
 * NULL, or what is wrong with a new password, in words that may be shown: it has fewer characters
 * (of UTF-8) than `least`, is made of the user's name, of one repeated piece or of a row of letters
 * or digits, or is one that everybody tries first.
 */
const char *db_password_judge(const char *password, const char *user, unsigned least);

/* True if the text has the form of a hash. */
bool db_password_is_hash(const char *text);

/* True if the hash is this password's; takes some hundredths of a second. */
bool db_password_matches(const char *hash, const char *password);

/* The hash of a password, with a fresh salt. False: it could not be made. */
bool db_password_hash(const char *password, char hash[DB_PASSWORD_HASH_MAX + 1]);

#endif
