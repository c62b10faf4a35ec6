/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The motion of a stepper: trapezoidal speed profiles, continuous running, position moves that can
 * get a new target at any moment, and oscillation. Pure arithmetic: no clock, no I/O, no
 * allocation; time is passed in. Positions are in pulses, speeds in pulses/s, accelerations in
 * pulses/s^2.
 *
 * Every function except sim_motion_advance() acts at the moment of the last advance. Copying the
 * struct copies the motion, so a caller can compute the future. Ramps and soft limits may be set
 * in the struct at any time.
 */
#ifndef DRIVEBRIDGE_SIM_MOTION_H
#define DRIVEBRIDGE_SIM_MOTION_H

#include "drivebridge/time.h"

#include <stdbool.h>

enum sim_motion_mode {
	SIM_MOTION_STANDING,
	SIM_MOTION_VELOCITY,
	SIM_MOTION_POSITION,
	SIM_MOTION_STOPPING,
	SIM_MOTION_SHAKING,
};

struct sim_motion {
	enum sim_motion_mode mode;
	db_time time;
	double position;
	double velocity;
	double acc;             /* 0: the speed jumps up */
	double dec;             /* 0: the speed jumps down */
	double target_velocity; /* VELOCITY: signed; POSITION: a magnitude */
	double target_position;
	double limit_min; /* soft limits; -INFINITY and INFINITY: none */
	double limit_max;
	double shake_centre;
	double shake_amplitude; /* signed: the start is centre + amplitude */
	double shake_frequency; /* Hz, there and back */
	double shake_elapsed;   /* s */
	double shake_duration;  /* s, INFINITY: endless */
};

void sim_motion_init(struct sim_motion *motion, db_time now);

/* Gives the present place the number `position`; a running move keeps its physical target. */
void sim_motion_set_position(struct sim_motion *motion, double position);

/*
 * Outside the soft limits there is no motion: the motor then stays at standstill. speed 0 stops.
 */
void sim_motion_run(struct sim_motion *motion, double velocity);
void sim_motion_move(struct sim_motion *motion, double target, double speed);

/* Oscillates from its present position to `to` and back, `cycles` times (0: endless), along a
 * sine. */
void sim_motion_shake(struct sim_motion *motion, double to, double frequency, double cycles);

void sim_motion_stop(struct sim_motion *motion); /* with the deceleration */
void sim_motion_halt(struct sim_motion *motion); /* at once, on a whole pulse */

bool sim_motion_moving(const struct sim_motion *motion);

/* -1, 0, 1: its direction, also just before the first pulse. */
int sim_motion_direction(const struct sim_motion *motion);

/* Advances to `now`; earlier times are ignored. */
void sim_motion_advance(struct sim_motion *motion, db_time now);

#endif
