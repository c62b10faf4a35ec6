/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file of users: a line NAME:ROLE:DRIVES:PASSWORD each. DRIVES is "*" or a list of names with
 * commas; PASSWORD is a hash as in crypt(5), or "pam". Empty lines and those that begin with # are
 * kept unchanged. There is no user until the administrator adds one.
 *
 * Lines of three parts, NAME:ROLE:HASH, are from before there were four roles: their reader is an
 * observer, and their operator, who might do everything, an engineer of all drives.
 *
 * A file that is called `users` in a folder `access` is the one of all programs. Beside that
 * folder, each of them had a file of its own before, whose users still count; a name that is in
 * both is the new file's.
 */
#ifndef DRIVEBRIDGE_USERS_USERS_H
#define DRIVEBRIDGE_USERS_USERS_H

#include "users/password.h"
#include "users/roles.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define DB_USERS_MAX 256
#define DB_USERS_FILE_MAX 65536

/* The file of all programs, and the group whose members read it. */
#define DB_USERS_PATH "/etc/drivebridge/access/users"
#define DB_USERS_GROUP "drivebridge-users"

/* The files of before. */
#define DB_USERS_FORMER_WEB "web-users"
#define DB_USERS_FORMER_OPCUA "opcua-users"

struct db_user {
	char name[DB_USERS_NAME_MAX + 1];
	struct db_grant grant; /* never DB_ROLE_NONE; `stops` is not in the file */
	bool pam;              /* PAM checks the password; `hash` is "" */
	bool former;           /* stands in the program's file of before */
	char hash[DB_PASSWORD_HASH_MAX + 1];
};

/* A program with users. */
struct db_users_keeper {
	const char *program; /* its name, for advice on the command line */
	const char *former;  /* DB_USERS_FORMER_..., its own file of before; NULL: it had none */
};

struct db_users {
	struct db_user *list;
	size_t count;
	size_t former; /* of these, from the keeper's file of before */
};

/* True for a valid user name: 1 to 32 ASCII letters, digits, '.', '-' and '_', a letter or digit
 * first. */
bool db_users_name_is_good(const char *name);

/*
 * From the text of a file. False: it cannot be used; errors go to `out` as "PATH:LINE: text" (NULL:
 * nowhere). In every case to be freed with db_users_clear().
 */
bool db_users_parse(struct db_users *users, const char *text, const char *path, FILE *out);

/* The same from the file, which not everybody may read, and the keeper's one of before. A missing
 * file has no users. */
bool db_users_load(struct db_users *users, const char *path, const struct db_users_keeper *keeper,
                   FILE *out);
void db_users_clear(struct db_users *users);

/* NULL: there is no user of this name. */
const struct db_user *db_users_find(const struct db_users *users, const char *name);

/* A number that changes when one of the files does; 0: both are missing. */
uint64_t db_users_stamp(const char *path, const struct db_users_keeper *keeper);

/* A number that changes when anything of the user does. */
unsigned long db_users_digest(const struct db_user *user);

/* What has to be true of the users when nobody else can change them any more. */
struct db_users_terms {
	const struct db_users_keeper *keeper; /* whose file of before counts, too */
	const struct db_user *before;         /* the user is still this one; NULL: there is none */
	const char *by; /* is an administrator; NULL: the user himself changes his password */
	/* PAM can check passwords: an administrator who can log in has to be left. */
	bool pam;
};

/*
 * Writes the user's line in the file, and keeps the other lines: a new file replaces the old one,
 * with its owner and mode. Lines in files of before are removed where they can be. `terms`: only
 * under these; NULL: in any case. Waits up to 2 s for others who change the file. False: it failed;
 * the reason goes to `out`.
 */
bool db_users_put(const char *path, const struct db_user *user, const struct db_users_terms *terms,
                  FILE *out);

/* Removes the user from all files, the other lines stay; the rest as above. False: he may still
 * stand in one. */
bool db_users_remove(const char *path, const char *name, const struct db_users_terms *terms,
                     FILE *out);

/* The path of the keeper's file of before; "": there can be none. */
void db_users_former(const char *path, const struct db_users_keeper *keeper, char *former,
                     size_t size);

#endif
