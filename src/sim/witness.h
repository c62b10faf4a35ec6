/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands that a drive really received: each request that is more than a question, at the
 * moment when the drive received it, and whether it obeyed. A request lost on the way is not
 * reported, one that was carried out without an answer is: tests judge a host by it. One thread.
 */
#ifndef DRIVEBRIDGE_SIM_WITNESS_H
#define DRIVEBRIDGE_SIM_WITNESS_H

#include "drivebridge/time.h"

#include <stdbool.h>

struct sim_witness {
	/* `request` as in the drive's log; null `report`: no witness. */
	void (*report)(void *context, db_time time, const char *request, bool obeyed);
	void *context;
};

static inline void sim_witness_report(const struct sim_witness *witness, db_time time,
                                      const char *request, bool obeyed)
{
	if (witness->report)
		witness->report(witness->context, time, request, obeyed);
}

#endif
