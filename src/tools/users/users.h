/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file of users: a line NAME:ROLE:HASH each, hashes as in crypt(5); empty lines and those that
 * begin with # are kept unchanged. There is no user until the administrator adds one.
 */
#ifndef DRIVEBRIDGE_USERS_USERS_H
#define DRIVEBRIDGE_USERS_USERS_H

#include "users/roles.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define DB_USERS_MAX 256
#define DB_USERS_FILE_MAX 65536
#define DB_USERS_PASSWORD_MIN 8
#define DB_USERS_PASSWORD_MAX 256

struct db_user {
	char name[DB_USERS_NAME_MAX + 1];
	enum db_role role; /* never DB_ROLE_NONE */
	char hash[160];
};

/* The program that owns the file. */
struct db_users_keeper {
	const char *program; /* its name, for the advice to use --add-user */
	const char *group;   /* whose members may read a newly made file */
};

struct db_users {
	struct db_user *list;
	size_t count;
};

/* True for a valid user name: 1 to 32 ASCII letters, digits, '.', '-' and '_', a letter or digit
 * first. */
bool db_users_name_is_good(const char *name);

/* False: it is neither "reader" nor "operator". */
bool db_role_read(const char *word, enum db_role *role);

/*
 * From the text of a file. False: it cannot be used; errors go to `out` as "PATH:LINE: text" (NULL:
 * nowhere). In every case to be freed with db_users_clear().
 */
bool db_users_parse(struct db_users *users, const char *text, const char *path, FILE *out);

/* The same from a file, which not everybody may read. A missing file has no users. */
bool db_users_load(struct db_users *users, const char *path, const struct db_users_keeper *keeper,
                   FILE *out);
void db_users_clear(struct db_users *users);

/* NULL: there is no user of this name. */
const struct db_user *db_users_find(const struct db_users *users, const char *name);

/* A number that changes when the file does; 0: the file is missing. */
uint64_t db_users_stamp(const char *path);

/* A number that changes when anything of the user does. */
unsigned long db_users_digest(const struct db_user *user);

/*
 * Writes the user's line in the file (or removes it, with a NULL hash), and keeps the other lines:
 * a new file replaces the old one, with its owner and mode. False: it failed; the reason goes to
 * `out`.
 */
bool db_users_change(const struct db_users_keeper *keeper, const char *path, const char *name,
                     enum db_role role, const char *hash, FILE *out);

/* True if the hash is this password's; takes some hundredths of a second. */
bool db_users_has_password(const char *hash, const char *password);

/* The hash of a password, with a fresh salt. False: it could not be made. */
bool db_users_hash(const char *password, char *hash, size_t size);

#endif
