/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One simulated servo drive with its motor: what it does when told something, and what it reports by
 * itself. It knows messages but no frames: servo_can_node.h is in front of it. Pure but for its
 * memory: time is handed in and must not run backwards (an earlier `now` counts as the latest seen).
 * One thread.
 *
 * Where the vendor's document is silent the drive does what is worst for a careless host: a speed or
 * current stays in force over a loss of power and a change of the mode, setting the position feedback
 * of a motor that is held in position makes it jump, a second rise of CTRG during a move goes to the
 * new target at once, and broadcasts are not acknowledged. Only speed and current wait for the sync
 * frame. What else real drives may do either way is in struct sim_servo_temper.
 */
#ifndef DRIVEBRIDGE_SIM_SERVO_DRIVE_H
#define DRIVEBRIDGE_SIM_SERVO_DRIVE_H

#include "codec/servo_can.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum sim_servo_report {
	SIM_SERVO_REPORT_POSITION,
	SIM_SERVO_REPORT_MOTION,
	SIM_SERVO_REPORT_HEALTH,
	SIM_SERVO_REPORTS
};

/* What a fault does, beside taking the power off the motor. */
enum sim_servo_fault_power {
	SIM_SERVO_FAULT_DISABLES, /* it has to be enabled anew */
	SIM_SERVO_FAULT_KEEPS, /* the motor goes on when the fault is gone; meanwhile the bit of its
	                             power stays */
	SIM_SERVO_FAULT_RESUMES, /* likewise, but the bit goes and comes back */
};

/* Where a demand of position mode comes from. Only the first is harmless: the others outlive the power of
 * the motor, and a loss of the drive's own makes them 0. */
enum sim_servo_demand {
	SIM_SERVO_DEMAND_POSITION, /* it holds its place */
	SIM_SERVO_DEMAND_WRITTEN, /* an internal position that is written while it is not held there */
	SIM_SERVO_DEMAND_TRIGGERED, /* that at the last rise of CTRG, with power or without */
	SIM_SERVO_DEMAND_MOVED, /* the target of the last position move: CTRG counts with power only */
};

/* What the document leaves open. All zero: the drive does what a host would like best. */
struct sim_servo_temper {
	enum sim_servo_fault_power fault_power;
	/* What it goes to when it is enabled in, or changed to, position mode. */
	enum sim_servo_demand demand;
	/* "Target position reached" tells of the reference's way, wherever the motor is. */
	bool reached_by_profile;
	bool ignores_broadcast; /* what is said to all drives at once is not for it */
	bool ignores_trigger; /* CTRG is acknowledged and does nothing (address 0x1070 is not 4) */
	bool deaf_to_setpoints; /* no answer to a speed or current outside its mode */
	bool unsigned_speed;  /* what it tells of its speed has no sign, but for the status bits */
	double zero_speed;    /* rpm below which it says that it stands; 0: 1 rpm */
	double dither;        /* counts that a held position is off, to and fro */
	db_time motion_delay; /* from a setpoint or the rise of CTRG to the motor's beginning */
};

struct sim_servo_config {
	enum servo_can_mode mode;           /* at power-up */
	bool synchronous;                   /* speed and current wait for a sync frame */
	db_time reports[SIM_SERVO_REPORTS]; /* intervals; 0 = off */
	db_time power_time;                 /* from enable or disable to the status bit */
	double start;                       /* where the shaft stands, counts */
	double counts_per_turn;
	double window;          /* counts around the target that count as reached */
	double inertia;         /* of motor and load, kg m^2 */
	double torque_constant; /* N m/A */
	double friction;        /* N m while turning */
	double load;            /* N m, always in the same direction: a weight */
	double max_current;     /* A, the limit of the current loop */
	double max_speed;       /* rpm, until the host writes another */
	double acceleration;    /* rpm/s, likewise */
	double deceleration;
	uint16_t voltage; /* raw */
	uint16_t temperature;
	struct sim_servo_temper temper;
};

/* Fills in a small motor at 48 V with the vendor's report intervals. */
void sim_servo_config_init(struct sim_servo_config *config);

struct sim_servo;

/* Powered on. Null when out of memory. Copies the configuration. */
struct sim_servo *sim_servo_new(const struct sim_servo_config *config, db_time now);
void sim_servo_free(struct sim_servo *drive);

/* Lets the motor catch up. Needed only to keep the later catching-up short. */
void sim_servo_advance(struct sim_servo *drive, db_time now);

#define SIM_SERVO_REPLIES 3

/*
 * Carries a message of the host out. Returns how many messages of the drive answer it, in replies[].
 * Their nodes are the message's; nothing answers a broadcast. `words_ack` is the code that
 * acknowledges command words.
 */
size_t sim_servo_execute(struct sim_servo *drive, const struct servo_can_message *message,
                         uint8_t words_ack, db_time now,
                         struct servo_can_message replies[SIM_SERVO_REPLIES]);

/* When the next report is due; DB_TIME_NEVER when none will be. */
db_time sim_servo_next(const struct sim_servo *drive);
/* The report that is due, its node left 0. False when none is. Call again until false. */
bool sim_servo_report(struct sim_servo *drive, db_time now, struct servo_can_message *report);
void sim_servo_set_reports(struct sim_servo *drive, enum sim_servo_report report, db_time interval,
                           db_time now);

/* What happens to a drive from outside. */
void sim_servo_power(struct sim_servo *drive, bool on, db_time now);
/* Sets the fault word; with anything but 0 in it the motor has no power. */
void sim_servo_set_faults(struct sim_servo *drive, uint16_t faults, db_time now);
/* Shows these status bits beside the real ones. */
void sim_servo_force_status(struct sim_servo *drive, uint16_t bits);
void sim_servo_set_health(struct sim_servo *drive, uint16_t voltage, uint16_t temperature);
void sim_servo_set_inputs(struct sim_servo *drive, uint8_t inputs, uint16_t analogue);
/* Holds the shaft, whatever the motor does. */
void sim_servo_block(struct sim_servo *drive, bool blocked, db_time now);

/* What a test wants to see. Call sim_servo_advance() before. */
bool sim_servo_ignores_broadcast(const struct sim_servo *drive);
bool sim_servo_powered(const struct sim_servo *drive);
bool sim_servo_moving(const struct sim_servo *drive); /* something changes as time passes */
enum servo_can_mode sim_servo_mode(const struct sim_servo *drive);
bool sim_servo_enabled(const struct sim_servo *drive);
double sim_servo_position(const struct sim_servo *drive); /* counts, as fed back */
double sim_servo_speed(const struct sim_servo *drive);    /* rpm */
double sim_servo_current(const struct sim_servo *drive);  /* A */
/* When speed or current last came into force; the skew of a synchronous start is their difference. */
db_time sim_servo_setpoint_at(const struct sim_servo *drive);

/* How often it was told something of this kind, and how often CTRG began a move. */
uint32_t sim_servo_count(const struct sim_servo *drive, enum servo_can_kind kind);
uint32_t sim_servo_moves(const struct sim_servo *drive);

#endif
