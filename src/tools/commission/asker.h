/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The user's side of a commissioning: a terminal, a script, a page. It asks questions, shows
 * results, and reports whether a person is still there. All functions are called by the thread that
 * runs the round.
 */
#ifndef DRIVEBRIDGE_COMMISSION_ASKER_H
#define DRIVEBRIDGE_COMMISSION_ASKER_H

#include "commission/steps.h"

struct db_commission_act;

struct db_commission_asker {
	void *data;
	int fd; /* polled together with the connections; owned by the asker */

	/* `fd` is readable. False: the user ended it, and nothing more is to be done. */
	bool (*hear)(void *data);

	/* Asks until the answer is one of the choices, and handles connections meanwhile
	 * (db_commission_act_wait()). NULL: skipped, or act->interrupted is set. Valid until the
	 * next question. */
	const char *(*ask)(void *data, struct db_commission_act *act,
	                   const struct db_commission_action *question);

	/* A step begins. */
	void (*begin)(void *data, const struct db_commission_step *step);

	/* It has ended; `verdicts` are those of the whole round, `done` the completed steps. False:
	 * the round ends. */
	bool (*end)(void *data, const struct db_commission_step *step, json_t *verdicts,
	            json_t *done);

	/* A motion is about to begin, or it has ended; `again`: a repetition, because its times
	 * could not be trusted. */
	void (*moves)(void *data, bool moving, bool again);

	/* The token that holds the motion now: `own`, the newest that this program received from
	 * the service, or one that a person at another place has sent. NULL: no person is there. */
	const char *(*hold)(void *data, const char *own);
};

/* The choice that `text` means, in full or by a prefix that no other choice has, but `yes` only in
 * full; with "" for choices a number above 0. False: none. Pure. */
bool db_commission_choose(const char *choices, const char *text, char *answer, size_t size);

#endif
