/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What documents leave open for drives of several families, one way or the other. Pure data and
 * functions; any thread.
 */
#ifndef DRIVEBRIDGE_SIM_TEMPER_H
#define DRIVEBRIDGE_SIM_TEMPER_H

#include "drivebridge/time.h"

#include <stdbool.h>

/* When a drive goes by a new address or speed. */
enum sim_settles {
	SIM_SETTLES_OF_BUS,       /* VSMD: POWER_UP, XYZA: AFTER_ANSWER */
	SIM_SETTLES_POWER_UP,     /* with what was saved */
	SIM_SETTLES_AFTER_ANSWER, /* it is answered as before; without an answer as AT_ONCE */
	SIM_SETTLES_AT_ONCE,      /* it answers by its new address */
};

/* A status bit that follows late. */
struct sim_late_bit {
	bool shown;
	bool real;
	db_time since; /* of `real` */
};

/* What is shown of it `delay` later. */
bool sim_late_bit_follow(struct sim_late_bit *bit, bool real, db_time delay, db_time now);

#endif
