/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The motors of a simulated XYZA controller: how they start, run and stop by its items and its
 * temper. Time is passed in and must not run backwards. One thread.
 */
#ifndef DRIVEBRIDGE_SIM_XYZA_AXES_H
#define DRIVEBRIDGE_SIM_XYZA_AXES_H

#include "sim/motion.h"
#include "sim/temper.h"
#include "sim/xyza_memory.h"

struct sim_xyza_temper;

struct sim_xyza_axes {
	const struct sim_xyza_memory *memory;
	const struct sim_xyza_temper *temper;
	struct {
		struct sim_motion motion;
		bool negative_zero; /* the sign is stored separately, because 0 has one too */
		db_time due;        /* when a jog begins; DB_TIME_NEVER: none is due */
		double due_velocity;
		struct sim_late_bit standing_bit;
	} list[XYZA_AXIS_COUNT];
};

/* All stand at 0. Memory and temper belong to the caller and must outlive the axes. */
void sim_xyza_axes_init(struct sim_xyza_axes *axes, const struct sim_xyza_memory *memory,
                        const struct sim_xyza_temper *temper, db_time now);

void sim_xyza_axes_advance(struct sim_xyza_axes *axes, db_time now);

/* velocity: pulses/s, signed. */
void sim_xyza_axes_run(struct sim_xyza_axes *axes, enum xyza_axis axis, double velocity);

/* As sim_xyza_axes_run(), after the delay of the temper. */
void sim_xyza_axes_jog(struct sim_xyza_axes *axes, enum xyza_axis axis, double velocity,
                       db_time now);

void sim_xyza_axes_stop(struct sim_xyza_axes *axes); /* with their deceleration */
void sim_xyza_axes_halt(struct sim_xyza_axes *axes); /* at once */

/* True if any of them moves, or its jog is due. */
bool sim_xyza_axes_busy(const struct sim_xyza_axes *axes);

/* Gives the axis's present place this position; -0.0 is a zero with a sign. */
void sim_xyza_axes_set_position(struct sim_xyza_axes *axes, enum xyza_axis axis, double position);

/* Whole pulses; the sign of 0 is significant. */
double sim_xyza_axes_position(const struct sim_xyza_axes *axes, enum xyza_axis axis);

#endif
