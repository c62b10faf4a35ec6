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

/* What the document leaves open. All zero: the drive does what a host would like best. */
struct sim_servo_temper {
	/* A fault takes the power off the motor, but leaves the bit that tells of it, and the setpoint:
	 * the motor goes on when the fault is gone. */
	bool fault_keeps_power;
	/* Enabled in, or changed to, position mode it goes to the demand it had before; what is written
	 * as internal position while it is not held there becomes the demand. Else it holds its place. */
	bool keeps_demand;
	/* "Target position reached" tells of the reference's way, wherever the motor is. */
	bool reached_by_profile;
	bool ignores_broadcast; /* what is said to all drives at once is not for it */
	bool ignores_trigger; /* CTRG is acknowledged and does nothing (address 0x1070 is not 4) */
	bool deaf_to_setpoints; /* no answer to a speed or current outside its mode */
	double zero_speed;      /* rpm below which it says that it stands; 0: 1 rpm */
	double dither;          /* counts that a held position is off, to and fro */
	db_time motion_delay;   /* from a setpoint or the rise of CTRG to the motor's beginning */
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
