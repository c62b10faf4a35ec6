/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drive-neutral commands: their codes, arguments and how they travel from a PLC's write to a bus
 * and back. The codes are part of the contract with PLC programs: append, never renumber. Functions
 * are pure.
 */
#ifndef DRIVEBRIDGE_COMMAND_H
#define DRIVEBRIDGE_COMMAND_H

#include "drivebridge/client.h"
#include "drivebridge/config.h"
#include "drivebridge/result.h"
#include "drivebridge/time.h"
#include "drivebridge/value.h"

#include <stdatomic.h>
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
	DB_CMD_START_PROGRAM = 30, /* starts a program stored in the controller */
	DB_CMD_PAUSE_PROGRAM = 31,
	DB_CMD_CONTINUE_PROGRAM = 32,
	DB_CMD_END_PROGRAM = 33,
	DB_CMD_SINGLE_STEP = 34, /* programs step by step: output_value 1 on, 0 off */
	DB_CMD_SYNC_START = 40,  /* motions staged on drives in sync mode begin on all of them */
	DB_CMD_RAW_FRAME = 41,   /* a raw frame of the client; where raw-frames is on */
	DB_CMD_LIMIT = 64        /* codes are below this, so that sets of them fit 64 bits */
};

#define DB_COMMAND_BIT(command) (UINT64_C(1) << (command))

/* stop, quick_stop and disable: overtake everything, always execute, are repeated until
 * confirmed. */
bool db_command_is_stop(enum db_command command);

/* True if it sets the axis in motion (arms the watchdog, refused while latched). */
bool db_command_is_motion(enum db_command command);

/* True also for commands of unknown effect: they arm the watchdog and are refused while latched,
 * too. */
bool db_command_may_move(enum db_command command);

/* True if the current motion is over once this command was submitted: another motion, or an end. */
bool db_command_ends_motion(enum db_command command);

/* The same except for stops: the motion is over when the drive accepts the command, and not
 * before. */
bool db_command_replaces_motion(enum db_command command);

/* The stop of a configured reaction; NONE for DB_ON_LOSS_NONE. */
enum db_command db_on_loss_command(enum db_on_loss reaction);

#define DB_RAW_REQUEST_WORDS 8

/* Arguments as the register table holds them; a command uses those its table row names. */
struct db_args {
	int32_t target_position; /* drive units; the distance for move_relative */
	/* drive units per second; 0 in a position move: the drive's preset */
	float target_velocity;
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
	/* delay from the command to the program's begin, s */
	uint16_t program_delay;
	uint16_t raw_length;                        /* bytes of a raw frame */
	uint16_t raw_request[DB_RAW_REQUEST_WORDS]; /* two bytes each, the first in the high one */
};

/* A parameter write: the index in the family's table and a checked value of its type. */
struct db_setting {
	uint16_t param;
	union db_value value;
};

#define DB_SETTINGS_MAX 64 /* of one job; more than one Modbus write can carry */

/* Why a drive must stand. */
enum db_stand_cause {
	DB_STAND_FREE = 0,     /* the drive is free */
	DB_STAND_CLIENT = 1,   /* a client's stop, quick_stop or disable */
	DB_STAND_WATCHDOG = 2, /* no client that commands it sent anything for watchdog_ms */
	DB_STAND_HOLD = 3,     /* a held motion whose holder is gone */
	DB_STAND_LIMIT = 4,    /* a position limit of the configuration */
	DB_STAND_FAULT = 5,    /* the drive's own fault, by its on-fault */
	DB_STAND_EXIT = 6,     /* the service ends, or a reload removes the drive: its on-exit */
	DB_STAND_MOTION = 7,   /* a motion that was abandoned, and might still begin */
	DB_STAND_RESTART = 8,  /* the drive had to stand when the service last ended */
	DB_STAND_COUNT
};
const char *db_stand_cause_name(unsigned cause); /* "none", "client" ...; "unknown" */

/* A writer that waits for the end of a request. */
struct db_waiter {
	struct db_write_token token;
	db_time deadline; /* DB_TIME_NEVER: it waits for the end, however long that takes */
};

#define DB_REQUEST_WAITERS 4 /* more are answered as pending at once */
#define DB_REQUEST_WAITERS_MASK 7
#define DB_REQUEST_EARLY_MASK ((1u << DB_REQUEST_WAITERS) - 1u)

/* Where a request was recorded; 0: nowhere. */
struct db_noted {
	uint32_t entry;  /* its number in the drive's history */
	uint32_t record; /* and in the audit trail: see struct db_commander_ops */
};

/*
 * A command or a parameter write, from the write of a client to the drive and back: this one struct
 * is filled in on the way. The network thread makes it and decides about it
 * (drivebridge/commander.h). When it is submitted, a bus copies it into a place of its own, where
 * it stays until its result was recorded. While the bus has it, the bus's thread reads what is asked
 * and fills in what has become of it; the rest is the network thread's at all times.
 */
struct db_request {
	/* What is asked. */
	union {
		const struct db_args *args;        /* of a command; a submitted stop has none */
		const struct db_setting *settings; /* of a parameter write */
	};
	db_time submitted; /* when it was asked for */
	uint32_t ticket;   /* its name at the bus: unique among pending requests, never 0 */
	uint32_t number;   /* counts the requests of the drive */
	/* not 0: together with others of the same number it is for every drive of the bus */
	uint32_t group;
	enum db_command command; /* NONE: a parameter write */
	uint16_t drive;          /* see struct db_bus_drive */
	uint8_t setting_count;
	uint8_t cause; /* enum db_stand_cause, of a stop */

	/* Notes of the network thread, where there is room for them; see below. */
	unsigned early : 4;       /* one bit per waiter: it is also checked before its deadline */
	unsigned again_cause : 4; /* enum db_stand_cause, of `again` */

	/* What has become of it. */
	uint8_t result;           /* enum db_result, once it has ended */
	atomic_bool acknowledged; /* a parameter write that is not proved yet; for both threads */
	/* For both threads: the stop in `again` comes after this one. What waits for the bus now is
	 * older than that stop, and must not begin. */
	atomic_bool stop_follows;
	db_time sent; /* when the command itself was first sent; 0: it was not */
	db_time finished;
	struct db_block *block; /* of its place; the queue's own */

	/* The client that asks, and how its request is to be treated. */
	struct db_client client; /* DB_CLIENT_NOBODY: the bridge itself, or no particular client */
	uint16_t id;             /* command_id; 0: none */
	uint16_t hold_ms;        /* a motion that its client holds; 0: it continues without */
	uint16_t hold_beat;
	bool by_block : 1; /* by the command block, where a write may be repeated */
	bool bare : 1;     /* a write of `command` alone, whose kept id was used already */
	bool staged : 1;   /* it waits for the start of a group */
	bool counted : 1; /* only a change of hold_beat is a sign of life, not the command itself */

	/* Notes about a pending request. */
	bool overtaken : 1;  /* a stop was submitted after it */
	bool reaction : 1;   /* the stop because clients are missed */
	bool held : 1;       /* its client holds the motion */
	bool ends_latch : 1; /* the watchdog's, as it was latched when this was submitted */
	unsigned waiter_count : 3;
	unsigned again : 3; /* a stop that is submitted when this one has ended; NONE */
	struct db_noted noted;
	float before;            /* of a velocity move: the drive's speed when it was submitted */
	struct db_request *next; /* the drive's next pending request */
	struct db_waiter waiters[DB_REQUEST_WAITERS];
};

/* What it does, or a stop that is to be repeated will do in the end. */
static inline enum db_command db_request_stop(const struct db_request *request)
{
	return request->again ? (enum db_command)request->again : request->command;
}

/* The client; null: the bridge itself, or no particular client. */
static inline const struct db_client *db_request_client(const struct db_request *request)
{
	return request->client.id != DB_CLIENT_NOBODY ? &request->client : NULL;
}

#endif
