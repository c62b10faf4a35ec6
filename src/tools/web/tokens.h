/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The age of a page's call. The service's tokens (io.drivebridge.Control, Clock) are sent to all
 * pages as they arrive, and a call that starts or holds a motion returns the newest token that its
 * page has: so the call is at most as old as that. A call that a network or a proxy has delayed
 * starts nothing, and no browser's clock is trusted.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_TOKENS_H
#define DRIVEBRIDGE_WEB_TOKENS_H

#include "drivebridge/time.h"

/* A call with an older token is too late: the service's limit. */
#define DB_WEB_TOKEN_FRESH (500 * DB_NS_PER_MS)

/* With its terminating zero; a longer one is not valid. */
#define DB_WEB_TOKEN_MAX 48

/* Tokens kept, to report the age of a late call. One arrives each 100 ms. */
#define DB_WEB_TOKENS_KEPT 100

struct db_web_tokens {
	unsigned count; /* since the beginning */
	struct {
		char text[DB_WEB_TOKEN_MAX];
		db_time heard;
	} kept[DB_WEB_TOKENS_KEPT]; /* the newest at (count - 1) modulo their number */
};

/* The service has sent this one. */
void db_web_tokens_add(struct db_web_tokens *tokens, const char *text, db_time now);

/* Time since its arrival; DB_TIME_NEVER for an unknown one, and for NULL. */
db_time db_web_tokens_age(const struct db_web_tokens *tokens, const char *text, db_time now);

/* Text that says why a call of this age is not carried out. */
#define DB_WEB_LATE_TEXT 64
void db_web_tokens_write_late(char text[DB_WEB_LATE_TEXT], db_time age);

#endif
