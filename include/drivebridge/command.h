/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drive-neutral commands: their codes, arguments and how they travel from a PLC's write to a bus
 * and back. The codes are part of the contract with PLC programs: append, never renumber. Functions
 * are pure.
 */
#ifndef DRIVEBRIDGE_COMMAND_H
#define DRIVEBRIDGE_COMMAND_H

#include "drivebridge/config.h"
#include "drivebridge/result.h"
#include "drivebridge/time.h"
#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum db_command {
	DB_CMD_NONE = 0,
	DB_CMD_ENABLE = 1,
	DB_CMD_DISABLE = 2,
	DB_CMD_STOP = 3,       /* decelerate */
	DB_CMD_QUICK_STOP = 4, /* the fastest stop the drive has */
	DB_CMD_MOVE_VELOCITY = 5,
	DB_CMD_MOVE_ABSOLUTE = 6,
	DB_CMD_MOVE_RELATIVE = 7,
	DB_CMD_HOME = 8,
	DB_CMD_HOME_STOP = 9,
	DB_CMD_SET_POSITION = 10,
	DB_CMD_CLEAR_FAULT = 11,
	DB_CMD_SAVE_PARAMETERS = 12,
	DB_CMD_READ_PARAMETERS = 13,  /* read identity and all parameters again */
	DB_CMD_MOVE_PRESET = 14,      /* run at the drive's own preset speed parameter */
	DB_CMD_SET_OUTPUT = 20,       /* one port */
	DB_CMD_SET_OUTPUTS = 21,      /* several ports: mask and levels */
	DB_CMD_SET_SV = 22,           /* duty of an inductive load's port */
	DB_CMD_SET_NMOS = 23,         /* duty of a resistive load's port */
	DB_CMD_SHAKE_START = 24,      /* number of cycles */
	DB_CMD_SHAKE_START_TIME = 25, /* duration */
	DB_CMD_SHAKE_STOP = 26,
	DB_CMD_MOVE_CURRENT = 27, /* torque: run with a motor current */
	DB_CMD_JOG_POSITIVE = 28, /* run at the drive's manual speed until stopped */
	DB_CMD_JOG_NEGATIVE = 29,
	DB_CMD_START_PROGRAM = 30, /* one that is stored in the controller */
	DB_CMD_PAUSE_PROGRAM = 31,
	DB_CMD_CONTINUE_PROGRAM = 32,
	DB_CMD_END_PROGRAM = 33,
	DB_CMD_SINGLE_STEP = 34, /* programs step by step: output_value 1 on, 0 off */
	DB_CMD_SYNC_START = 40,  /* what was staged on drives in sync mode begins on all of them */
	DB_CMD_RAW_FRAME = 41,   /* one frame as its writer has it; where raw-frames is on */
	DB_CMD_LIMIT = 64        /* codes are below this, so that sets of them fit 64 bits */
};

#define DB_COMMAND_BIT(command) (UINT64_C(1) << (command))

/* stop, quick_stop and disable: overtake everything, always execute, are repeated until
 * confirmed. */
bool db_command_is_stop(enum db_command command);

/* Sets the axis in motion (arms the watchdog, refused while latched). */
bool db_command_is_motion(enum db_command command);

/* It, or what nobody knows: likewise arms the watchdog and is refused while latched. */
bool db_command_may_move(enum db_command command);

/* Whatever motion there was is over once this command is on its way: another motion, or an end. */
bool db_command_ends_motion(enum db_command command);

/* The same but for stops: the motion is over when the drive takes the command, and not before. */
bool db_command_replaces_motion(enum db_command command);

/* The stop that a configured reaction stands for; NONE for DB_ON_LOSS_NONE. */
enum db_command db_on_loss_command(enum db_on_loss reaction);

#define DB_RAW_REQUEST_WORDS 8

/* Arguments as the register table holds them; a command uses those its table row names. */
struct db_args {
	int32_t target_position; /* drive units; the distance for move_relative */
	float target_velocity; /* drive units per second; 0 in a position move: the drive's preset */
	uint16_t output_number; /* from 1 */
	uint16_t output_value;
	uint16_t output_mask; /* bit 0 = port 1 */
	uint16_t output_levels;
	int32_t shake_start_position;
	int32_t shake_end_position;
	float shake_frequency; /* Hz */
	uint32_t shake_cycles; /* 0 = no limit */
	uint32_t shake_time;   /* s, 0 = no limit */
	float target_current;  /* A; its sign is the direction */
	uint16_t program_number;
	uint16_t program_delay;                     /* s, from the command to the program's begin */
	uint16_t raw_length;                        /* bytes of a raw frame */
	uint16_t raw_request[DB_RAW_REQUEST_WORDS]; /* two bytes each, the first in the high one */
};

/* A parameter write: the index in the family's table and a value of its type, checked already. */
struct db_setting {
	uint16_t param;
	union db_value value;
};

#define DB_SETTINGS_MAX 64 /* more than one Modbus write can carry */

/* Why a drive must stand. */
enum db_stand_cause {
	DB_STAND_FREE = 0,     /* it need not */
	DB_STAND_CLIENT = 1,   /* a client's stop, quick_stop or disable */
	DB_STAND_WATCHDOG = 2, /* nobody who commands it was heard for watchdog_ms */
	DB_STAND_HOLD = 3,     /* a held motion whose holder is gone */
	DB_STAND_LIMIT = 4,    /* a position limit of the configuration */
	DB_STAND_FAULT = 5,    /* the drive's own fault, by its on-fault */
	DB_STAND_EXIT = 6,     /* the service ends, or a reload takes the drive out: its on-exit */
	DB_STAND_MOTION = 7,   /* a motion that was given up, and might still begin */
	DB_STAND_RESTART = 8,  /* it had to stand when the service ended last */
	DB_STAND_COUNT
};
const char *db_stand_cause_name(unsigned cause); /* "none", "client" ...; "unknown" */

/* What the network thread hands to a bus. The settings are the giver's; a queue copies them. */
struct db_request {
	uint32_t ticket;        /* comes back in the completion; never 0 */
	uint16_t drive;         /* see struct db_bus_drive */
	uint16_t setting_count; /* > 0: a parameter write; command is NONE */
	enum db_command command;
	struct db_args args;
	db_time submitted;
	uint32_t group; /* not 0: with others of the same number it is for every drive of the bus */
	enum db_stand_cause cause; /* of a stop */
	const struct db_setting *settings;
};

/* What comes back, exactly once for each request taken. */
struct db_completion {
	uint32_t ticket;
	uint16_t drive;
	enum db_result result;
	db_time sent; /* when the command itself was first put on the wire; 0: it was not */
	db_time finished;
};

#endif
