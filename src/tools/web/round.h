/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A commissioning of a drive (commission/round.h) in a thread of its own: it waits for drives and
 * for people, and the loop has to keep the dead man's rule. It passes questions and results as
 * texts, and moves the drive only while the page confirms that it is there. All calls from the
 * loop's thread.
 */
#ifndef DRIVEBRIDGE_WEB_ROUND_H
#define DRIVEBRIDGE_WEB_ROUND_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stdint.h>

struct db_web_round;

struct db_web_round_order {
	const char *socket;
	const char *user; /* for the service's history */
	const char *drive;
	int only;        /* index of a step; -1: all */
	double velocity; /* of trial motions; 0: a slow default */
	double seconds;  /* duration of one; 0: the default */
};

/* Begins; copies the order. NULL without memory or without a thread. Freed with
 * db_web_round_free(), which ends it and waits until its drive has been commanded to stop and to
 * switch off its power. NULL is allowed. */
struct db_web_round *db_web_round_new(const struct db_web_round_order *order);
void db_web_round_free(struct db_web_round *round);

/* Readable when there is a text, or it is over. */
int db_web_round_fd(const struct db_web_round *round);

/*
 * The next text. `event` gets its name: step, ask, moving, stood, verdicts, failed or result,
 * `json` an object, which the caller frees. False: nothing now; with `over` nothing follows either,
 * and freeing it does not wait.
 */
bool db_web_round_take(struct db_web_round *round, const char **event, char **json, bool *over);

/* True if a motion was ended because its page did not hold it in time. */
bool db_web_round_is_late(struct db_web_round *round);

/* The answer to the question of this number, "" or "skip": none. False: that question is not open,
 * or the answer is not valid. */
bool db_web_round_answer(struct db_web_round *round, uint64_t question, const char *answer);

/* The person who watches the motion of this number is there, as `token` of the service's clock
 * shows. It holds the motion for DB_WEB_GRIP_LATE. */
void db_web_round_hold(struct db_web_round *round, uint64_t motion, const char *token, db_time now);

/* Ends it: a motion is stopped, then the motor loses its power. */
void db_web_round_end(struct db_web_round *round);

#endif
