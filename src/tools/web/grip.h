/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The dead man's rule. A grip is one press of a button or key; while it is held, beats arrive, each
 * with a higher number. After its end nothing of a grip moves the drive, whether late or repeated;
 * nor does a beat that is older than one received before, or that was long on its way. Times are
 * those of arrival.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_GRIP_H
#define DRIVEBRIDGE_WEB_GRIP_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/* Without a beat for this time it is over. Pages send one each 100 ms. */
#define DB_WEB_GRIP_LATE (300 * DB_NS_PER_MS)

/* Why a grip is over. */
enum db_web_grip_end {
	DB_WEB_GRIP_HELD, /* it is not over */
	DB_WEB_GRIP_RELEASED,
	DB_WEB_GRIP_OVERDUE, /* no beat in time */
	DB_WEB_GRIP_REFUSED, /* the service or the drive refuses it */
	DB_WEB_GRIP_STOPPED, /* by this page's stop, by another client, or by the drive itself */
	DB_WEB_GRIP_LOGOUT,
	DB_WEB_GRIP_LOST,   /* the connection to the service was lost */
	DB_WEB_GRIP_ENDING, /* this program is ending */
	DB_WEB_GRIP_OLD,    /* its first beat was too old to begin anything */
	DB_WEB_GRIP_DONE,   /* a sequence has come to its end */
};

extern const char *const db_web_grip_ends[]; /* "", "released" ..., as pages know them */

struct db_web_grip {
	uint64_t number;          /* of the latest grip; 0: there was none */
	uint64_t beat;            /* number of its latest beat */
	enum db_web_grip_end end; /* of the latest grip */
	double velocity;          /* 0 unless it is held */
	/* end of the hold without a further beat; DB_TIME_NEVER when it is not held */
	db_time until;
};

/*
 * A beat has arrived; numbers count from 1. First checks whether the grip is overdue. `age`: the
 * longest time that it can have been on its way, from its token (tokens.h). A beat that is too old
 * begins nothing and holds nothing; a release is never too late.
 */
void db_web_grip_take(struct db_web_grip *grip, uint64_t number, uint64_t beat, double velocity,
                      db_time age, db_time now);

/* Ends it when it is overdue. */
void db_web_grip_look(struct db_web_grip *grip, db_time now);

/* Ends it if it is held. */
void db_web_grip_finish(struct db_web_grip *grip, enum db_web_grip_end end);

static inline bool db_web_grip_is_held(const struct db_web_grip *grip)
{
	return grip->number != 0 && grip->end == DB_WEB_GRIP_HELD;
}

#endif
