/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Follows a motion that a drive has begun to its end, so that `result` can tell it. Pure; `now` is
 * passed in.
 */
#ifndef DRIVEBRIDGE_AXIS_FOLLOW_H
#define DRIVEBRIDGE_AXIS_FOLLOW_H

#include "drivebridge/axis.h"
#include "drivebridge/command.h"
#include "drivebridge/result.h"

struct db_follow_config {
	double window;    /* drive units around the target that count as there */
	db_time settling; /* how long it must stand there */
	db_time patience; /* a drive that stands elsewhere for so long will not arrive any more */
};

/* What program_state shows: the same in all families that have programs. */
enum db_program_state {
	DB_PROGRAM_IDLE = 0,
	DB_PROGRAM_RUNNING = 1,
	DB_PROGRAM_WAITING = 2,
	DB_PROGRAM_UNTOLD = UINT16_MAX, /* the drive does not tell it */
};

struct db_follow {
	bool active;
	enum db_command command;
	db_time delay;          /* before a program begins */
	uint32_t ticket;        /* of the command that began it */
	db_time since;          /* data must be younger */
	db_time standing_since; /* 0: it moves */
	db_time there_since;    /* 0: it is not at the target */
	bool moved;             /* it was seen to move */
};

/* Whether a command begins something that has an end of its own; and whether it is followed: one that goes
 * on until it is ended is, for it may end unasked. */
bool db_follow_has_end(enum db_command command);
bool db_follow_applies(enum db_command command);

/* `delay`: how long after its command a program begins, ns; else 0. */
void db_follow_begin(struct db_follow *follow, enum db_command command, uint32_t ticket,
                     db_time delay, db_time now);

/* PENDING while it goes on; else how it ended, and it is not followed any more. */
enum db_result db_follow_check(struct db_follow *follow, const struct db_follow_config *config,
                               const struct db_feedback *feedback, db_time now);

#endif
