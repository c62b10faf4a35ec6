/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One simulated VSMD drive with its motor, sensors and flash. It knows commands and parameters but
 * no wire: the bus (vsmd_serial_bus.h) converts bytes into struct vsmd_command. Time is passed in
 * and must not run backwards (an earlier `now` counts as the latest one). One thread.
 *
 * Where the vendor's document is silent the drive does this: an open-loop motor that hits a
 * mechanical end or is blocked loses steps and keeps counting, a closed-loop one stands and reports
 * an encoder error; a cfg write is all or nothing; homing as described at sim_vsmd_new().
 */
#ifndef DRIVEBRIDGE_SIM_VSMD_DRIVE_H
#define DRIVEBRIDGE_SIM_VSMD_DRIVE_H

#include "codec/vsmd_serial_frames.h"
#include "drivebridge/time.h"
#include "sim/vsmd_temper.h"

#include <stdbool.h>
#include <stdint.h>

#define SIM_VSMD_SENSORS 6
#define SIM_VSMD_IDENTITY_MAX 64

enum sim_sensor_kind { SIM_SENSOR_NONE, SIM_SENSOR_BELOW, SIM_SENSOR_ABOVE, SIM_SENSOR_BETWEEN };

/* High while the shaft is below `low`, above `low`, or between `low` and `high` (both included). */
struct sim_sensor {
	enum sim_sensor_kind kind;
	double low;
	double high;
};

/* Positions are mechanical: pulses from the shaft's position for `start` 0. */
struct sim_vsmd_config {
	const char *identity;   /* not null; cut off at the maximum */
	const char *flash_path; /* null: saved parameters live as long as the process */
	bool can;               /* on CAN: cid and bdr have other valid values */
	unsigned address;       /* factory value of cid, 1..32, on CAN 1..110 */
	unsigned baud;          /* factory value of bdr */
	unsigned model;         /* 10, 25, 45 or 80: VSMD1xx_0nnT */
	bool closed_loop;
	bool external;      /* has the sv and nmos ports (VSMD1x3E) */
	double max_current; /* A */
	double travel_min;
	double travel_max;
	double start;
	struct sim_sensor sensors[SIM_VSMD_SENSORS];
	union db_value defaults[VSMD_PARAM_COUNT]; /* factory parameters */
	struct sim_vsmd_temper temper;
};

struct sim_vsmd;

/* Fills in usual values; the caller then changes what it needs, defaults[] included. */
void sim_vsmd_config_init(struct sim_vsmd_config *config, unsigned address, unsigned baud);

/* True if a drive of this kind has the parameter and accepts the value. */
bool sim_vsmd_takes(const struct sim_vsmd_config *config, enum vsmd_param param,
                    union db_value value);

/*
 * Powered on. Null when out of memory; to be freed with free(). Copies the configuration (the
 * strings too).
 *
 * Homing: the motor runs with zsd until the origin sensor leaves its open level (if it has left it
 * already, backwards first until it is open). zmd 1, 2: it halts there and the place is 0. zmd 3,
 * 4: it stops, backs off at half the speed until the sensor opens, and approaches again at a
 * quarter. zmd 2, 4 then go to zsp. zmd 6: runs to the mechanical end. zmd 7: runs to the next full
 * turn of the shaft. Soft limits do not hold before the origin is found. Any limit sensor other
 * than the origin sensor ends it unfinished.
 */
struct sim_vsmd *sim_vsmd_new(const struct sim_vsmd_config *config, db_time now);

/* Lets the motor and sensors catch up. Only needed to keep later calls short. */
void sim_vsmd_advance(struct sim_vsmd *drive, db_time now);

/* Carries out a well-formed command (the id is ignored) and returns the kind of reply. */
enum vsmd_reply_code sim_vsmd_execute(struct sim_vsmd *drive, const struct vsmd_command *command,
                                      db_time now);

/* The drive received a message of the host; `named`: one that asks for its identity. */
void sim_vsmd_note_request(struct sim_vsmd *drive, bool named, db_time now);

/* Adopts a new address and speed, if this drive does so at that time: before it answers, or
 * (`answered`) after the answer. */
void sim_vsmd_settle(struct sim_vsmd *drive, bool answered);

/* A line that was no command: sets cmd_wrg. The reply is the status. */
void sim_vsmd_refuse(struct sim_vsmd *drive, db_time now);

/* When the bit of a refused command is cleared. */
enum sim_refusal sim_vsmd_refusal(const struct sim_vsmd *drive);

/* The real status. */
void sim_vsmd_status(struct sim_vsmd *drive, db_time now, struct vsmd_status *status);

/* Events from outside. */
void sim_vsmd_power(struct sim_vsmd *drive, bool on, db_time now);
/* True if it refuses the text of its parameters, and answers no register. */
bool sim_vsmd_hides_params(const struct sim_vsmd *drive);
/* number 1..6; level 0 or 1, or -1 to let the sensor work again. */
void sim_vsmd_force_sensor(struct sim_vsmd *drive, unsigned number, int level, db_time now);
#endif
