/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Compares passwords and changes users in a thread of its own: a comparison takes some hundredths
 * of a second of a processor, PAM and the disk as long as they want, and the loop has to keep the
 * dead man's rule. All calls from the loop's thread.
 */
#ifndef DRIVEBRIDGE_WEB_HASHER_H
#define DRIVEBRIDGE_WEB_HASHER_H

#include "users/users.h"

#include <stdbool.h>
#include <stdint.h>

/* Most waiting jobs, and how many places of these are kept for known browsers. */
#define DB_WEB_HASHER_JOBS 8
#define DB_WEB_HASHER_KNOWN 2

enum db_web_change { DB_WEB_CHANGE_NONE, DB_WEB_CHANGE_PUT, DB_WEB_CHANGE_REMOVE };

/* A job, and how it ended. */
struct db_web_work {
	uint64_t number; /* of the request */

	/* First a password is compared. */
	bool compares;
	struct db_user user;    /* whose: with its hash, or by PAM; who is changed below */
	const char *pam_folder; /* "": PAM's own; outlives it */
	char password[DB_PASSWORD_MAX + 1];

	/* If that was right, or none was compared, the file of users is changed. */
	enum db_web_change change;
	bool known;                               /* there was such a user, `user` */
	char by[DB_USERS_NAME_MAX + 1];           /* the administrator; "": the user himself */
	const char *path;                         /* of that file; outlives it */
	struct db_user fresh;                     /* is put, or its name removed */
	char fresh_password[DB_PASSWORD_MAX + 1]; /* whose hash it gets; "": it has one */

	bool right;    /* the password; true if none was compared */
	bool done;     /* the change */
	char why[256]; /* in words: what failed, apart from a wrong password */
};

struct db_web_hasher;

/* NULL without memory or without a thread; freed with db_web_hasher_free(), which waits some
 * seconds for the running job. NULL is allowed. */
struct db_web_hasher *db_web_hasher_new(void);
void db_web_hasher_free(struct db_web_hasher *hasher);

/* Copies the job. False: too many are waiting. `known`: it comes from a browser that the user has
 * logged in with before. */
bool db_web_hasher_ask(struct db_web_hasher *hasher, const struct db_web_work *work, bool known);

/* Readable when jobs have ended; they are taken one by one. The passwords of a taken one are
 * wiped. */
int db_web_hasher_fd(const struct db_web_hasher *hasher);
bool db_web_hasher_take(struct db_web_hasher *hasher, struct db_web_work *work);

#endif
