/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The dead man's rule. A grip is one press of a button or key; while it is held beats come, each with a higher number.
 * A grip that is over is over: whatever comes of it later, or again, moves nothing. Nor does a beat that is older than
 * one that has come, or that was long on its way. Times are those of arrival.
 *
 * Pure.
 */
#ifndef DRIVEBRIDGE_WEB_GRIP_H
#define DRIVEBRIDGE_WEB_GRIP_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

/* Without a beat for so long it is over. Pages send one each 100 ms. */
#define DB_WEB_GRIP_LATE (300 * DB_NS_PER_MS)

/* Why a grip is over. */
enum db_web_grip_end {
	DB_WEB_GRIP_HELD, /* it is not */
	DB_WEB_GRIP_RELEASED,
	DB_WEB_GRIP_OVERDUE, /* no beat in time */
	DB_WEB_GRIP_REFUSED, /* the service or the drive says no */
	DB_WEB_GRIP_STOPPED, /* by this page's stop, by somebody else, or by the drive itself */
	DB_WEB_GRIP_LOGOUT,
	DB_WEB_GRIP_LOST,   /* the connection to the service */
	DB_WEB_GRIP_ENDING, /* this program ends */
	DB_WEB_GRIP_OLD,    /* its first beat came too late to begin anything */
};

/* "", "released", "late", "refused", "stopped", "logout", "lost", "ending", "old". */
const char *db_web_grip_end_name(enum db_web_grip_end end);

struct db_web_grip {
	uint64_t number;          /* of the latest; 0: there was none */
	uint64_t beat;            /* its latest */
	enum db_web_grip_end end; /* of that grip */
	double velocity;          /* 0 unless it is held */
	db_time until; /* it is held without a further beat; DB_TIME_NEVER when it is not */
};

/*
 * A beat has come; numbers from 1. First looks whether the grip is overdue. `age`: how long it was on its way at most, as
 * its token shows (tokens.h). What is not fresh begins nothing, and keeps nothing held; letting go is never too late.
 */
void db_web_grip_take(struct db_web_grip *grip, uint64_t number, uint64_t beat, double velocity,
                      db_time age, db_time now);

/* Ends it when it is overdue. */
void db_web_grip_look(struct db_web_grip *grip, db_time now);

/* Ends it, when it is held. */
void db_web_grip_finish(struct db_web_grip *grip, enum db_web_grip_end end);

static inline bool db_web_grip_is_held(const struct db_web_grip *grip)
{
	return grip->number != 0 && grip->end == DB_WEB_GRIP_HELD;
}

#endif
