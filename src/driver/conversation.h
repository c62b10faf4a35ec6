/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the families' conversations have in common. Internal to src/driver; bus thread only.
 *
 * A family names the steps of its conversations and has one table of them: what is said, what follows
 * when that was answered, turned down or not answered. job->step is the row of what was said last. How
 * an answer is told from other frames follows from the exchange or, where its lines do not show that,
 * from the step's `expects`.
 *
 * Each function of a row writes the next exchange (SEND), ends the job (DONE) or goes on waiting (MORE,
 * IGNORE). What the frame said is in talk->reply, of the family's own type.
 */
#ifndef DRIVEBRIDGE_DRIVER_CONVERSATION_H
#define DRIVEBRIDGE_DRIVER_CONVERSATION_H

#include "drivebridge/driver.h"

typedef enum db_step conversation_fn(struct db_conversation *talk);

struct conversation_step {
	/* Null: what is said depends on more than the step, and is chosen where the step is. */
	conversation_fn *say;
	unsigned expects; /* the family's own code of an answer; 0: the exchange tells */
	conversation_fn *answered;
	conversation_fn *refused; /* null: an answer that turns it down is an answer like others */
	conversation_fn *lost;    /* null: the job ends with a time-out */
};

static inline enum db_step end_job(struct db_conversation *talk, enum db_result result)
{
	talk->result = result;
	return DB_STEP_DONE;
}

/* Says what this row has to say. */
static inline enum db_step say_step(struct db_conversation *talk,
                                    const struct conversation_step *steps, unsigned step)
{
	talk->job->step = step;
	return steps[step].say(talk);
}

/* No answer came to the step that was said last. */
static inline enum db_step lose_step(struct db_conversation *talk,
                                     const struct conversation_step *steps)
{
	conversation_fn *lost = steps[talk->job->step].lost;

	return lost ? lost(talk) : end_job(talk, DB_RESULT_TIMEOUT);
}

static inline bool is_within(double value, double min, double max)
{
	return value >= min && value <= max;
}

#endif
