/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numbers and bits of a simulated servo's frames: the document's, unless its configuration
 * differs. Pure.
 */
#ifndef DRIVEBRIDGE_SIM_SERVO_DIALECT_H
#define DRIVEBRIDGE_SIM_SERVO_DIALECT_H

#include <stdbool.h>
#include <stdint.h>

#define SIM_SERVO_PLACES 16

/* A step is the value of a difference of 1 in a frame; below 0 it has the opposite sign. */
struct sim_servo_dialect {
	char places[SIM_SERVO_PLACES +
	            1];        /* position of each documented status bit, in hexadecimal; -: none */
	int moving_bit;        /* position of a bit that reports motion; -1: none */
	uint16_t inverted;     /* bits of the status word with inverted meaning */
	bool mirrored;         /* all positions have the opposite sign of the speed */
	bool moves_relatively; /* the frame that moves has a distance */
	double demand_step;    /* counts; of the internal position */
	double move_step;      /* counts; of the frame that moves */
	double speed_step;     /* rpm */
	double setpoint_step;  /* rpm; of the commanded speed */
	double current_step;   /* A */
	double current_setpoint_step; /* A */
};

/* The status word of the documented bits and of motion. */
uint16_t sim_servo_dialect_status(const struct sim_servo_dialect *dialect, unsigned bits,
                                  bool moving);

/* Counts of the shaft to those in a frame, and the reverse. */
double sim_servo_dialect_turn(const struct sim_servo_dialect *dialect, double counts);

/* A value as a number of steps, within 16 bits. */
int16_t sim_servo_dialect_steps(double value, double step);

#endif
