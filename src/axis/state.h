/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The insides of struct db_commander: what its files work on. They call each other in one direction
 * only, from the top: commander, reaction, motion, admission, requests and account. Network thread
 * only.
 */
#ifndef DRIVEBRIDGE_AXIS_STATE_H
#define DRIVEBRIDGE_AXIS_STATE_H

#include "axis/follow.h"
#include "axis/history.h"
#include "axis/hold.h"
#include "axis/pending.h"
#include "axis/supervise.h"
#include "axis/watchdog.h"
#include "axis/writers.h"
#include "drivebridge/commander.h"

/* How soon a stop that found no room at the bus is handed to it again. */
#define DB_STOP_RETRY (5 * DB_NS_PER_MS)

struct db_commander {
	struct db_commander_config config;
	const struct db_commander_ops *ops;
	void *context;

	struct db_command_block kept; /* as written last */
	struct db_writers writers;
	struct db_history history;

	/* Requests, see requests.h. */
	struct db_pending pending;
	uint32_t newest;        /* ticket of the command or write that was submitted last */
	uint32_t submitted;     /* requests so far */
	unsigned waiting;       /* waiters of all requests */
	db_time stop_repeat_at; /* a client's stop is to be handed over again then; or NEVER */
	db_time stopped; /* the latest stop came then; what moves and came before it is over */

	/* Motions, see motion.h. */
	struct db_follow follow; /* the one that the drive has begun last, if it is followed */
	uint32_t follow_entry;   /* of that in the history */
	db_time follow_arrived;
	struct db_supervise supervise; /* the one without an end */
	db_time check_at;              /* the next look at it */
	db_time check_interval;

	/* Clients that are missed, see reaction.h. */
	struct db_watchdog watchdog;
	struct db_client fed_by; /* who fed it last; DB_CLIENT_NOBODY: nobody did */
	struct db_hold hold;
	enum db_stand_cause reaction_cause; /* of the stop for them */
	db_time reaction_again_at;          /* it found no room and is handed over then; or NEVER */
	db_time find_at; /* the next look whether the drive is there and moves; NEVER: it was */
};

#endif
