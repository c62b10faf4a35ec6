/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Watches a motion that has no target (a jog, a velocity, a current), so that it does not pass the
 * limits of the position: it is told to stop as far before them as it may need to stand. Of any
 * family. Pure: what was read and the time are handed in.
 *
 * The way that a stop takes is what passes until the drive hears it, then its braking. That is
 * computed where the drive's deceleration is known, and measured whenever it is stopped; the longer
 * of both counts. Where nothing is known yet, and where a drive gets faster between two looks by
 * more than it did between the two before, it may pass a limit by so much.
 */
#ifndef DRIVEBRIDGE_AXIS_SUPERVISE_H
#define DRIVEBRIDGE_AXIS_SUPERVISE_H

#include "axis/limits.h"
#include "drivebridge/axis.h"
#include "drivebridge/command.h"

struct db_supervise_config {
	double min; /* drive units; NAN: no limit */
	double max;
	double velocity_counts; /* position units a second that a velocity of 1 is */
	double deceleration;    /* position units/s^2; 0: not known, INFINITY: it stands at once */
	db_time delay; /* at most, from the moment of the data to when the drive hears a stop */
};

struct db_supervise {
	bool active;  /* such a motion goes on, or was asked for */
	bool stopped; /* it was told to stop because of a limit */
	db_time begun;
	db_time since; /* when it was begun, or last seen to move */
	double last_speed;
	db_time last_taken; /* of the data that had it */
	bool measuring;     /* it was told to stop, and the way is measured */
	double from;        /* where it was then, at this speed */
	double from_speed;
	double measured; /* the way of the fastest stop, over the square of its speed; s^2/unit */
	double measured_speed;
};

/* Whether a command begins a motion that is watched. */
bool db_supervise_applies(enum db_command command);

/* Such a command was handed to the bus; data of before says nothing about it. */
void db_supervise_begin(struct db_supervise *supervise, db_time now);

/* Any stop was handed to the bus. */
void db_supervise_stop(struct db_supervise *supervise, const struct db_supervise_config *config,
                       const struct db_feedback *feedback, db_time now);

/* The limit that it would pass if it were not told to stop now, once for each time; or NONE. */
enum db_limit db_supervise_check(struct db_supervise *supervise,
                                 const struct db_supervise_config *config,
                                 const struct db_feedback *feedback, db_time now);

#endif
