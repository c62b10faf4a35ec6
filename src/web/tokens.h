/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How old a call of a page is. The service's tokens (io.drivebridge.Control, Clock) go to all pages as they come, and what a
 * page starts or holds a motion with brings the newest one back that it had: so the call is at most as old as that. What
 * a network or a proxy has held up starts nothing, and no clock of a browser is believed.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_TOKENS_H
#define DRIVEBRIDGE_WEB_TOKENS_H

#include "drivebridge/time.h"

/* A call with an older one is too late: as the service has it. */
#define DB_WEB_TOKEN_FRESH (500 * DB_NS_PER_MS)

/* With its end; a longer one is none. */
#define DB_WEB_TOKEN_MAX 48

/* So many are remembered, to say how late a call is. One comes each 100 ms. */
#define DB_WEB_TOKENS_KEPT 100

struct db_web_tokens {
	unsigned count; /* ever */
	struct {
		char text[DB_WEB_TOKEN_MAX];
		db_time heard;
	} kept[DB_WEB_TOKENS_KEPT]; /* the newest at (count - 1) modulo their number */
};

/* The service has given this one. */
void db_web_tokens_add(struct db_web_tokens *tokens, const char *text, db_time now);

/* How long ago that was; DB_TIME_NEVER for one that is not remembered, and for NULL. */
db_time db_web_tokens_age(const struct db_web_tokens *tokens, const char *text, db_time now);

/* In words why a call that is so old is not carried out. */
#define DB_WEB_LATE_TEXT 64
void db_web_tokens_write_late(char text[DB_WEB_LATE_TEXT], db_time age);

#endif
