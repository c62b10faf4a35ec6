/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file of users: a line NAME:ROLE:HASH each, hashes as crypt(5) has them; empty lines and those that begin with #
 * are left alone. There is no user until the administrator makes one.
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

/* Whose file it is. */
struct db_users_keeper {
	const char *program; /* that makes users with --add-user */
	const char *group;   /* whose members may read a file that is made */
};

struct db_users {
	struct db_user *list;
	size_t count;
};

/* Whether it can be a user's name: 1 to 32 letters of ASCII, digits, '.', '-' and '_', a letter or digit first. */
bool db_users_name_is_good(const char *name);

/* False: it is neither "reader" nor "operator". */
bool db_role_read(const char *word, enum db_role *role);

/*
 * From the text of a file. False: it cannot be used; errors go to `out` as "PATH:LINE: text" (NULL: nowhere). To be freed
 * with db_users_clear() in any case.
 */
bool db_users_parse(struct db_users *users, const char *text, const char *path, FILE *out);

/* The same from a file, which not everybody may read. One that is not there has nobody in it. */
bool db_users_load(struct db_users *users, const char *path, const struct db_users_keeper *keeper,
                   FILE *out);
void db_users_clear(struct db_users *users);

/* NULL: there is nobody of this name. */
const struct db_user *db_users_find(const struct db_users *users, const char *name);

/* A number that changes when the file does; 0: it is not there. */
uint64_t db_users_stamp(const char *path);

/* A number that changes when anything of the user does. */
unsigned long db_users_digest(const struct db_user *user);

/*
 * Writes the user's line in the file (or takes it out, with a NULL hash), and leaves the others as they are: a new file
 * in the place of the old one, with its owner and mode. False: it could not be; why goes to `out`.
 */
bool db_users_change(const struct db_users_keeper *keeper, const char *path, const char *name,
                     enum db_role role, const char *hash, FILE *out);

/* Whether the hash is this password's; takes some hundredths of a second. */
bool db_users_has_password(const char *hash, const char *password);

/* The hash of a password, with a fresh salt. False: it could not be made. */
bool db_users_hash(const char *password, char *hash, size_t size);

#endif
