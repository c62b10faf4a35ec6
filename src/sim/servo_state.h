/* SPDX-License-Identifier: Apache-2.0 */
/* The state of a simulated servo. Internal to servo_drive.c and servo_view.c. */
#ifndef DRIVEBRIDGE_SIM_SERVO_STATE_H
#define DRIVEBRIDGE_SIM_SERVO_STATE_H

#include "sim/servo_drive.h"

struct sim_servo {
	struct sim_servo_config config;
	db_time time; /* the motor has been advanced to this time */
	bool powered;

	/* Set by the host. */
	enum servo_can_mode mode;
	bool torque_clockwise;
	bool enabled;
	bool shown_enabled; /* in the status bit, `power_time` later */
	db_time enabled_at;
	double speed;   /* rpm */
	double current; /* A */
	bool speed_staged;
	bool current_staged;
	double next_speed;
	double next_current;
	db_time setpoint_at;
	double internal_positions[SERVO_CAN_SLOT_MAX +
	                          1]; /* counts; without effect before CTRG rises */
	uint16_t word0;
	double max_speed;
	double acceleration;
	double deceleration;

	/* The motor. */
	double position; /* counts, as fed back */
	double rpm;
	double amperes;
	double profile;     /* rpm, within the ramps */
	double planned;     /* counts, the position of a motor without friction or load */
	db_time idle_until; /* it received a command, and has not begun */
	double target;      /* counts, the position that position mode holds or approaches */
	bool limited;       /* by max_current */
	bool blocked;

	/* Shown unchanged. */
	uint16_t faults;
	uint16_t forced;
	uint16_t voltage;
	uint16_t temperature;
	uint16_t analogue;
	uint8_t inputs;

	db_time report_at[SIM_SERVO_REPORTS]; /* DB_TIME_NEVER: off */
	uint32_t counts[SERVO_CAN_KIND_COUNT];
	uint32_t moves;
};

#endif
