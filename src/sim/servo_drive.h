/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One simulated servo drive with its motor: its reaction to messages, and its own reports. It knows
 * messages but no frames: servo_can_node.h handles those. Pure but for its memory: time is passed
 * in and must not run backwards (an earlier `now` counts as the latest one). One thread.
 *
 * Where the vendor's document is silent the drive does the worst for a careless host: a speed or
 * current stays in force over a loss of power and a change of the mode, setting the position
 * feedback of a motor that is held in position makes it jump, a second rise of CTRG during a move
 * goes to the new target at once, and broadcasts are not acknowledged. Only speed and current wait
 * for the sync frame. Other differences between real drives are in struct sim_servo_temper.
 */
#ifndef DRIVEBRIDGE_SIM_SERVO_DRIVE_H
#define DRIVEBRIDGE_SIM_SERVO_DRIVE_H

#include "codec/servo_can.h"
#include "drivebridge/time.h"
#include "sim/servo_dialect.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum sim_servo_report {
	SIM_SERVO_REPORT_POSITION,
	SIM_SERVO_REPORT_MOTION,
	SIM_SERVO_REPORT_HEALTH,
	SIM_SERVO_REPORTS
};

/* The effect of a fault, in addition to removing the motor's power. */
enum sim_servo_fault_power {
	SIM_SERVO_FAULT_DISABLES, /* it has to be enabled again */
	/* the motor continues when the fault is gone; meanwhile the bit of its power stays set */
	SIM_SERVO_FAULT_KEEPS,
	SIM_SERVO_FAULT_RESUMES, /* the same, but the bit is cleared and set again */
};

/* The origin of the demand in position mode. Only the first one is harmless: the others survive a
 * loss of the motor's power, and become 0 after a loss of the drive's own power. */
enum sim_servo_demand {
	SIM_SERVO_DEMAND_POSITION, /* it holds its position */
	/* an internal position that was written while it is not held there */
	SIM_SERVO_DEMAND_WRITTEN,
	SIM_SERVO_DEMAND_TRIGGERED, /* the demand at the last rise of CTRG, with power or without */
	/* the target of the last position move: CTRG counts only with power */
	SIM_SERVO_DEMAND_MOVED,
};

/* What the document leaves open. All zero: the drive behaves best for a host. */
struct sim_servo_temper {
	enum sim_servo_fault_power fault_power;
	/* Where it goes when it is enabled in, or changed to, position mode. */
	enum sim_servo_demand demand;
	/* "Target position reached" refers to the reference, wherever the motor is. */
	bool reached_by_profile;
	bool counts_anew;       /* its position is 0 at power-up: an encoder without a memory */
	bool ignores_broadcast; /* it ignores messages to all drives */
	bool ignores_trigger;   /* CTRG is acknowledged without effect (address 0x1070 is not 4) */
	bool deaf_to_setpoints; /* no answer to a speed or current outside its mode */
	bool unsigned_speed;    /* its reported speed has no sign, except in the status bits */
	double zero_speed;      /* rpm below which it reports standstill; 0: 1 rpm */
	double dither;          /* counts by which a held position trembles */
	db_time motion_delay;   /* from a setpoint or the rise of CTRG to the begin of the motion */
};

struct sim_servo_config {
	enum servo_can_mode mode;           /* at power-up */
	bool synchronous;                   /* speed and current wait for a sync frame */
	db_time reports[SIM_SERVO_REPORTS]; /* intervals; 0: off */
	db_time power_time;                 /* from enable or disable to the status bit */
	double start;                       /* position of the shaft, counts */
	double counts_per_turn;
	double window;          /* counts around the target that count as reached */
	double inertia;         /* of motor and load, kg m^2 */
	double torque_constant; /* N m/A */
	double friction;        /* N m while turning */
	double load;            /* N m, always in the same direction: a weight */
	double max_current;     /* A, the limit of the current loop */
	double max_speed;       /* rpm, until the host writes another value */
	double acceleration;    /* rpm/s, also until then */
	double deceleration;
	uint16_t voltage; /* raw */
	uint16_t temperature;
	struct sim_servo_temper temper;
	struct sim_servo_dialect dialect;
};

/* Fills in a small motor at 48 V with the vendor's report intervals. */
void sim_servo_config_init(struct sim_servo_config *config);

/* Its state, which anybody may read after sim_servo_advance(). What is shown unchanged may also be
 * set from outside. */
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
	/* When speed or current last came into force; the skew of a synchronous start is the
	 * difference of two drives' times. */
	db_time setpoint_at;
	/* counts; without effect before CTRG rises */
	double internal_positions[SERVO_CAN_SLOT_MAX + 1];
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
	bool blocked;       /* set from outside: the shaft is held, whatever the motor does */

	/* Shown unchanged. */
	uint32_t forced; /* status bits in addition to the real ones */
	uint16_t faults;
	uint16_t voltage;
	uint16_t temperature;
	uint16_t analogue;
	uint8_t inputs;

	db_time report_at[SIM_SERVO_REPORTS];  /* DB_TIME_NEVER: off */
	uint32_t counts[SERVO_CAN_KIND_COUNT]; /* how often it received each kind of message */
	uint32_t moves;                        /* how often a position move began */
};

/* Powered on. Null when out of memory; to be freed with free(). Copies the configuration. */
struct sim_servo *sim_servo_new(const struct sim_servo_config *config, db_time now);

/* Lets the motor catch up. Only needed to keep later calls short. */
void sim_servo_advance(struct sim_servo *drive, db_time now);

#define SIM_SERVO_REPLIES 3

/*
 * Carries out a message of the host. Returns the number of messages in replies[] with which the
 * drive answers it. Their nodes are the message's; a broadcast gets no answer. `layout` has the
 * codes that acknowledge what no page shows, and which internal position POSITION is.
 */
size_t sim_servo_execute(struct sim_servo *drive, const struct servo_can_message *message,
                         const struct servo_can_layout *layout, db_time now,
                         struct servo_can_message replies[SIM_SERVO_REPLIES]);

/* When the next report is due; DB_TIME_NEVER without one. */
db_time sim_servo_next(const struct sim_servo *drive);
/* The due report, its node left 0. False when there is none. Call again until false. */
bool sim_servo_report(struct sim_servo *drive, db_time now, struct servo_can_message *report);
void sim_servo_set_reports(struct sim_servo *drive, enum sim_servo_report report, db_time interval,
                           db_time now);

/* Events from outside. */
void sim_servo_power(struct sim_servo *drive, bool on, db_time now);
/* Sets the fault word; with a value other than 0 the motor has no power. */
void sim_servo_set_faults(struct sim_servo *drive, uint16_t faults, db_time now);

/* True if nothing will change any more by itself. */
bool sim_servo_settled(const struct sim_servo *drive);

#endif
