/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What documents leave open for drives of several families. Pure data and functions; any thread.
 */
#ifndef DRIVEBRIDGE_SIM_TEMPER_H
#define DRIVEBRIDGE_SIM_TEMPER_H

#include "drivebridge/time.h"

#include <stdbool.h>

/* When a drive adopts a new address or speed. */
enum sim_settles {
	SIM_SETTLES_OF_BUS,       /* VSMD: POWER_UP, XYZA: AFTER_ANSWER */
	SIM_SETTLES_POWER_UP,     /* with the saved values */
	SIM_SETTLES_AFTER_ANSWER, /* it answers with the former one; without an answer as AT_ONCE */
	SIM_SETTLES_AT_ONCE,      /* it answers with its new address */
};

/* A status bit that changes late. */
struct sim_late_bit {
	bool shown;
	bool real;
	db_time since; /* of `real` */
};

/* The shown value, `delay` later than the real one. */
static inline bool sim_late_bit_follow(struct sim_late_bit *bit, bool real, db_time delay,
                                       db_time now)
{
	if (real != bit->real) {
		bit->real = real;
		bit->since = now;
	}
	if (now - bit->since >= delay)
		bit->shown = real;
	return bit->shown;
}

#endif
