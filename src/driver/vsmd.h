/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What VSMD drives have in common on every bus: what neutral commands mean to them, how a lost
 * answer is resolved, and what their status says of the axis. How a command travels is the link's
 * part. Internal to src/driver; bus thread only, except vsmd_check(), which is pure.
 *
 * A relative move is turned into an absolute one from a freshly read position, so that a lost answer
 * can never make the drive move twice. Commands that start a motion are not repeated blindly
 * either: after a lost answer the drive is read back, and only when it demonstrably did not react
 * (it stood and still stands where it was) is the command sent again.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_H
#define DRIVEBRIDGE_DRIVER_VSMD_H

#include "codec/vsmd_serial.h"
#include "drivebridge/driver.h"

struct vsmd_axis;

enum vsmd_motion {
	VSMD_MOTION_NONE,
	VSMD_MOTION_DISCRETE,
	VSMD_MOTION_CONTINUOUS,
	VSMD_MOTION_HOMING,
	VSMD_MOTION_SHAKE,
	VSMD_MOTION_UNKNOWN, /* not begun from here: before a restart, by a sensor, by hand */
};

/* How one kind of bus carries commands. */
struct vsmd_link {
	/* A drive's answer to a command says that it had this command. Where it does not (CAN), its
	 * effect is looked for in the status that is read behind it. */
	bool acknowledges;
	float shake_frequency_min; /* Hz */
	/* Writes the exchange of one command (its id is the link's part). SEND; DONE with
	 * OUT_OF_RANGE when it cannot be said. */
	enum db_step (*ask)(struct vsmd_axis *axis, const struct vsmd_command *command,
	                    bool repeatable, struct db_exchange *exchange, enum db_result *result);
};

struct vsmd_axis {
	const struct vsmd_link *link;
	const struct db_drive_config *config;
	db_time save_interval;
	db_time last_save;
	bool saved;

	struct vsmd_status last;    /* the newest of each value */
	db_time heard_at;           /* when `last` came */
	struct vsmd_status process; /* position and velocity of one moment, for the PLC */
	db_time taken;              /* when `process` came */
	bool heard;                 /* `process` holds something */
	bool handshaken;            /* hs was seen set: when it drops, the drive has restarted */
	enum vsmd_motion motion;
	enum vsmd_motion begun; /* homing or shaking was asked for, and not heard of since */
	bool fresh;             /* motion accepted, no status read after it yet */
	bool stopping;
	bool homed;
	bool origin_lost;
	bool refused;
	bool has_target;
	int32_t target;
	int32_t wanted; /* by the position move that is being asked for: the target once it is taken */
	unsigned standstill_looks; /* statuses in a row that show it standing */
	db_time standstill_since;  /* the first of them */
	db_time asked_at; /* when the effect of a command was first looked for; 0: not yet */
	struct db_nameplate plate;
	bool params_valid;
};

/* Where a command's conversation is. FIRST is the command itself (or its preparation). */
enum vsmd_step { VSMD_FIRST, VSMD_SECOND, VSMD_THIRD, VSMD_READ_BACK };

#define VSMD_COMMANDS                                                                   \
	(DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) |               \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |              \
	 DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) |  \
	 DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE) | DB_COMMAND_BIT(DB_CMD_HOME) |           \
	 DB_COMMAND_BIT(DB_CMD_HOME_STOP) | DB_COMMAND_BIT(DB_CMD_SET_POSITION) |       \
	 DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) | DB_COMMAND_BIT(DB_CMD_SAVE_PARAMETERS) |  \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_MOVE_PRESET) |  \
	 DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) | DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS) |       \
	 DB_COMMAND_BIT(DB_CMD_SET_SV) | DB_COMMAND_BIT(DB_CMD_SET_NMOS) |              \
	 DB_COMMAND_BIT(DB_CMD_SHAKE_START) | DB_COMMAND_BIT(DB_CMD_SHAKE_START_TIME) | \
	 DB_COMMAND_BIT(DB_CMD_SHAKE_STOP))

enum db_result vsmd_check(const struct vsmd_link *link, enum db_command command,
                          const struct db_args *args);

/* The one command that carries out a neutral one; a status request where it takes several. */
struct vsmd_command vsmd_command_of(enum db_command command, const struct db_args *args);

void vsmd_axis_init(struct vsmd_axis *axis, const struct vsmd_link *link,
                    const struct db_bus_config *bus, const struct db_drive_config *drive);

/* A job of the kind COMMAND begins; not for read_parameters, which is the link's. */
enum db_step vsmd_begin_command(struct vsmd_axis *axis, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result);
/* The status that the exchange brought was taken: go on. Not for save_parameters. */
enum db_step vsmd_answer_command(struct vsmd_axis *axis, struct db_job *job,
                                 struct db_exchange *exchange, enum db_result *result);
/* Any job's answer was lost. */
enum db_step vsmd_lost(struct vsmd_axis *axis, struct db_job *job, struct db_exchange *exchange,
                       enum db_result *result);

void vsmd_take_status(struct vsmd_axis *axis, const struct vsmd_status *status, db_time now);
/* A status without the velocity: good for deciding, not for showing. */
void vsmd_take_confirmation(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now);
/* That status is certainly younger than the last command. */
void vsmd_follow_motion(struct vsmd_axis *axis);
void vsmd_take_identity(struct vsmd_axis *axis, const char *text, size_t length);
/* The settings of a job are in force now. */
void vsmd_take_settings(struct vsmd_axis *axis, const struct db_request *request);

void vsmd_axis_gone(struct vsmd_axis *axis);
void vsmd_axis_feedback(const struct vsmd_axis *axis, struct db_feedback *feedback);

#endif
