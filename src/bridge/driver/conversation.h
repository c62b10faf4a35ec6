/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the families' conversations have in common. Internal to src/bridge/driver; bus thread only.
 *
 * A family names the steps of its conversations and has one table of them: what is sent, and what
 * follows when it was answered, refused or not answered. job->step is the row of the step sent
 * last. An answer is recognised by the exchange or, where the exchange does not show it, by the
 * step's `expects`.
 *
 * Each function of a row writes the next exchange (SEND), ends the job (DONE) or continues to wait
 * (MORE, IGNORE). The decoded frame is in talk->reply, of the family's own type.
 */
#ifndef DRIVEBRIDGE_DRIVER_CONVERSATION_H
#define DRIVEBRIDGE_DRIVER_CONVERSATION_H

#include "drivebridge/driver.h"

typedef enum db_step conversation_fn(struct db_conversation *talk);

struct conversation_step {
	/* Null: what is sent depends on more than the step, and is chosen where the step is
	 * chosen. */
	conversation_fn *send;
	unsigned expects; /* the family's own code of an answer; 0: the exchange shows it */
	conversation_fn *answered;
	conversation_fn *refused; /* null: a refusal is handled as any other answer */
	conversation_fn *lost;    /* null: the job ends with a time-out */
};

static inline enum db_step end_job(struct db_conversation *talk, enum db_result result)
{
	talk->result = result;
	return DB_STEP_DONE;
}

/* For rows of a table: the job ends, whatever was answered. */
static inline enum db_step end_done(struct db_conversation *talk)
{
	return end_job(talk, DB_RESULT_OK);
}

static inline enum db_step end_failed(struct db_conversation *talk)
{
	return end_job(talk, DB_RESULT_FAILED);
}

static inline enum db_step end_refused(struct db_conversation *talk)
{
	return end_job(talk, DB_RESULT_REFUSED);
}

static inline enum db_step end_indeterminate(struct db_conversation *talk)
{
	return end_job(talk, DB_RESULT_INDETERMINATE);
}

/* Sends what this row has to send. */
static inline enum db_step send_step(struct db_conversation *talk,
                                     const struct conversation_step *steps, unsigned step)
{
	talk->job->step = (uint16_t)step;
	return steps[step].send(talk);
}

/* No answer to the step sent last was received. */
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
