/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads the audit trail, over a connection of its own: a disk may take its time, and other calls do
 * not wait for it. The service continues a reading fast where the reading before has ended, so
 * readers take turns: each has the trail to itself until it leaves it. One thread.
 */
#ifndef DRIVEBRIDGE_WEB_TRAIL_H
#define DRIVEBRIDGE_WEB_TRAIL_H

#include "client/error.h"
#include "web/state.h"

#include <jansson.h>

/* In front of what reads; belongs to the reader. */
struct db_web_trail_reader {
	/* It is this reader's turn: it asks, or leaves. */
	void (*turn)(struct db_web_trail_reader *reader);
	/* The page that it has asked for, or NULL with an error: it asks again, or leaves. */
	void (*take)(struct db_web_trail_reader *reader, json_t *page,
	             const struct db_client_error *error);
	struct db_web_trail_reader *next;
};

/* Its turn comes, maybe at once. */
void db_web_trail_enter(struct db_web_server *server, struct db_web_trail_reader *reader);

/* Calls the service's method Audit with these parameters, which are taken over. `take` may be
 * called before this returns. */
void db_web_trail_ask(struct db_web_server *server, json_t *query);

/* It may be called at any time, also by a reader that waits for its turn or for a page. Afterwards
 * the reader is not used any more. */
void db_web_trail_leave(struct db_web_server *server, struct db_web_trail_reader *reader);

/* This program ends: each reader is answered with an error, now and later. */
void db_web_trail_end(struct db_web_server *server);

void db_web_trail_tick(struct db_web_server *server, db_time now);

#endif
