/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The inside of a simulated VSMD drive, shared by vsmd_drive.c (commands, parameters, power),
 * vsmd_mechanics.c (motor, sensors, homing, shaking) and vsmd_temper.c (what it reports). Its
 * buses, its family and tests read it; the family also sets what is forced or fails.
 */
#ifndef DRIVEBRIDGE_SIM_VSMD_MECHANICS_H
#define DRIVEBRIDGE_SIM_VSMD_MECHANICS_H

#include "sim/motion.h"
#include "sim/vsmd_drive.h"

#include <limits.h>

enum sim_homing {
	SIM_HOMING_NONE,
	SIM_HOMING_LEAVE, /* the sensor was active at the start: backwards until it opens */
	SIM_HOMING_APPROACH,
	SIM_HOMING_BRAKE, /* stopping after the sensor's edge */
	SIM_HOMING_BACKOFF,
	SIM_HOMING_TURN, /* stopping before the second approach */
	SIM_HOMING_AGAIN,
	SIM_HOMING_END_STOP,  /* zmd 6 */
	SIM_HOMING_TURN_MARK, /* zmd 7 */
	SIM_HOMING_SAFE,      /* on the way to zsp */
};

enum sim_shake { SIM_SHAKE_NONE, SIM_SHAKE_TO_START, SIM_SHAKE_RUN };

struct sim_vsmd {
	struct sim_vsmd_config config;
	char identity[SIM_VSMD_IDENTITY_MAX];
	char flash_path[PATH_MAX]; /* "": none */
	union db_value flash[VSMD_PARAM_COUNT];
	union db_value params[VSMD_PARAM_COUNT];

	/* In effect since power-up. */
	unsigned address;
	unsigned baud;
	uint32_t encoder_mode;

	struct sim_motion motion; /* the counted position */
	double shaft_offset;      /* shaft = counted position + offset */
	bool counts_spd;          /* the present motion uses the spd parameter */
	bool origin_after_stop;
	enum sim_homing homing;
	enum sim_shake shake;
	int32_t shake_end;
	float shake_frequency;
	double shake_cycles;
	db_time blocked;       /* how long the encoder has seen no motion */
	db_time offline_start; /* dar: when the offline program starts, or DB_TIME_NEVER */

	uint32_t levels;              /* bit n-1: sensor n is high */
	uint32_t outputs;             /* the same for output ports */
	int forced[SIM_VSMD_SENSORS]; /* -1: not forced */

	uint32_t flags; /* the stored status bits; the others are computed */
	uint32_t forced_status;
	bool powered;
	bool stalled; /* set from outside, after sim_vsmd_advance() */
	bool hides_params;
	bool flash_fails;

	bool trembled;      /* its last reported position was off */
	db_time greeted_at; /* when the handshake bit was last set */
	struct sim_late_bit power_bit;
	struct sim_late_bit standing_bit;
	bool waits; /* `waiting`, a motion, begins at `begins_at` */
	struct vsmd_command waiting;
	db_time begins_at;

	uint32_t counts[VSMD_VERB_COUNT];
	uint32_t refusals;
	uint32_t starts; /* power-ups */
};

void sim_mechanics_advance(struct sim_vsmd *drive, db_time now);

/* Ends homing, shaking and commands that wait for the end of a motion, because a new motion
 * begins. */
void sim_mechanics_abandon(struct sim_vsmd *drive);

/* A motion in the direction of an active limit sensor does not begin; call after starting any. */
void sim_mechanics_hold_limits(struct sim_vsmd *drive);

/* Reads the sensors and reacts to changes; for changes that no motion caused. */
void sim_mechanics_sense(struct sim_vsmd *drive);

/* Takes the sensors' present state, without events: at power-up. */
void sim_mechanics_settle(struct sim_vsmd *drive);

/* False when the parameters do not allow homing. */
bool sim_mechanics_home(struct sim_vsmd *drive);

void sim_mechanics_shake(struct sim_vsmd *drive, const struct vsmd_command *command);

/* Parameters changed: ramps, limits and speeds follow. */
void sim_mechanics_configure(struct sim_vsmd *drive);

/* Motor off: no current, counter at 0. */
void sim_mechanics_release(struct sim_vsmd *drive);

void sim_mechanics_set_position(struct sim_vsmd *drive, double position);

double sim_mechanics_shaft(const struct sim_vsmd *drive);

#endif
