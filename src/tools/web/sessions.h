/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The logged-in users. A browser has the session's id in a cookie that its scripts cannot read, and
 * its token, which each request has to send in addition: a page of another site can make a browser
 * send the cookie, but cannot read the token.
 *
 * A browser without a login has no session here: its id and token are the two halves of one secret
 * that only the browser keeps.
 *
 * Pure: time and random bytes are passed in. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_SESSIONS_H
#define DRIVEBRIDGE_WEB_SESSIONS_H

#include "drivebridge/time.h"
#include "users/users.h"
#include "web/address.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* When there would be more, the one that was unused for longest ends. */
#define DB_WEB_SESSIONS_MAX 64

#define DB_WEB_SECRET_BYTES 16
#define DB_WEB_SECRET_TEXT (2 * DB_WEB_SECRET_BYTES + 1)

struct db_web_secret {
	unsigned char bytes[DB_WEB_SECRET_BYTES];
};

struct db_web_session {
	char id[DB_WEB_SECRET_TEXT]; /* "": the place is free */
	char token[DB_WEB_SECRET_TEXT];
	uint32_t number;            /* unique among all since the program's start; no secret */
	struct db_web_address from; /* where the user logged in */
	char user[DB_USERS_NAME_MAX + 1];
	struct db_grant grant;
	bool pam;           /* his password is not this program's */
	const char *weak;   /* what is wrong with his password by today's rules; NULL: nothing */
	unsigned long hash; /* of the user's line, to detect a change */
	db_time begun;
	db_time used;
};

struct db_web_sessions;

/* A session ends `idle` after its last use, and `longest` after its beginning. NULL without memory;
 * freed with db_web_sessions_free(), NULL is allowed. */
struct db_web_sessions *db_web_sessions_new(db_time idle, db_time longest);
void db_web_sessions_free(struct db_web_sessions *sessions);

/* Two lower hexadecimal digits for each byte, and the zero byte. */
void db_web_hex_write(const unsigned char *bytes, size_t count, char *text);

/* True if a text has such digits, as many as a secret. */
bool db_web_secret_is_good(const char *text);

/* True if two texts are equal, in a time that does not depend on where they differ. */
bool db_web_secret_equal(const char *one, const char *other);

/* Begins a session with two unused secrets; `weak` is a constant. Belongs to the sessions, valid
 * until the next call. */
const struct db_web_session *db_web_sessions_begin(struct db_web_sessions *sessions,
                                                   const struct db_user *user, const char *weak,
                                                   const struct db_web_address *from,
                                                   const struct db_web_secret secrets[2],
                                                   db_time now);

/* NULL: no session has this id, or it has ended. Belongs to the sessions, valid until the next
 * call. */
const struct db_web_session *db_web_sessions_find(struct db_web_sessions *sessions, const char *id,
                                                  db_time now);

/* Those of a user, the oldest first. They belong to the sessions, and are valid until one begins.
 * Returns how many. */
size_t db_web_sessions_of(struct db_web_sessions *sessions, const char *user, db_time now,
                          const struct db_web_session *found[DB_WEB_SESSIONS_MAX]);

/* It was used. */
void db_web_sessions_touch(struct db_web_sessions *sessions, const char *id, db_time now);

/* The user of this session has changed his own password: it stays when sessions are reviewed. */
void db_web_sessions_renew(struct db_web_sessions *sessions, const char *id,
                           const struct db_user *user);

void db_web_sessions_end(struct db_web_sessions *sessions, const char *id);

/* Ends sessions whose user was changed: `check` returns whether a session may stay. */
typedef bool db_web_session_check_fn(void *context, const struct db_web_session *session);
void db_web_sessions_review(struct db_web_sessions *sessions, db_web_session_check_fn *check,
                            void *context);

#endif
