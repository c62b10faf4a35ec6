/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A held motion goes on only while somebody holds it: a page's button, a key, an HMI's push button. Its holder gives
 * signs of life (beats); without one for the hold's span, and when its connection ends, the motion is to be stopped at
 * once, whatever the watchdog says. A hold that is over is over: a late beat begins nothing.
 *
 * The clock is looked at before a beat, so that beats which waited while this program did not run do not count.
 *
 * Pure: time is passed in, one thread.
 */
#ifndef DRIVEBRIDGE_AXIS_HOLD_H
#define DRIVEBRIDGE_AXIS_HOLD_H

#include "drivebridge/client.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/* Zeroed memory: nothing is held. */
struct db_hold {
	struct db_client holder; /* DB_CLIENT_NOBODY: nothing is held */
	db_time span;            /* how long it lasts without a beat */
	db_time until;
	uint32_t order; /* of the request that the holder commanded last, see struct db_slot */
	bool begun;     /* a motion of it has begun, or may have */
	bool deserted;  /* its holder's connection has ended */
	bool lost;      /* the latest one ended because its holder was missed */
	uint16_t beat;  /* the counter of the latest one, as its holder wrote it last */
};

/* How a motion is held. */
struct db_hold_terms {
	uint32_t span_ms;
	uint16_t beat; /* where the holder's counter stands */
	bool counted;  /* only a new value of that is a sign of life, not the command itself */
};

/* What is counted does not begin where the latest hold was lost: its counter must have gone on since. */
bool db_hold_may_begin(const struct db_hold *hold, const struct db_hold_terms *terms);

/* A motion of this client, which arrived then, is on its way to the drive. The same client's hold goes on with it;
 * another one's becomes this client's. */
void db_hold_begin(struct db_hold *hold, const struct db_client *client,
                   const struct db_hold_terms *terms, uint32_t order, db_time arrived);

/* The holder gives a sign of life that arrived then. False: this client holds nothing, or not any more. */
bool db_hold_beat(struct db_hold *hold, const struct db_client *client, db_time arrived,
                  db_time now);

/* The same of a holder that counts: a sign of life when this is another value than before. */
bool db_hold_count(struct db_hold *hold, const struct db_client *client, uint16_t value,
                   db_time arrived, db_time now);

/* This client's connection has ended: a hold of its is overdue from now on. */
void db_hold_desert(struct db_hold *hold, const struct db_client *client, db_time now);

/* Nothing is held any more. */
void db_hold_end(struct db_hold *hold);
/* ... because its holder was missed. */
void db_hold_lose(struct db_hold *hold);

/* From when on the holder is missed; DB_TIME_NEVER while nothing is held. */
db_time db_hold_deadline(const struct db_hold *hold);

#endif
