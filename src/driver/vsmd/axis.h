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
 *
 * An answer proves that a command arrived, not that something came of it: a command is done when what
 * is read behind it shows its effect, and no older motion explains that (vsmd_effect.c). The effect
 * is waited for as long as the drive's reaction time. What a drive does not show ends as unproven.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_AXIS_H
#define DRIVEBRIDGE_DRIVER_VSMD_AXIS_H

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

/* What is read in the course of a command. */
enum vsmd_look {
	VSMD_LOOK_STATUS,   /* position and status word; on serial lines the speed, too */
	VSMD_LOOK_SPEED,    /* the speed */
	VSMD_LOOK_POSITION, /* the position; on CAN in another frame than with LOOK_STATUS */
};

/* How one kind of bus carries commands. */
struct vsmd_link {
	/* A drive's answer to a command says that it had this command. Where it does not (CAN), its
	 * effect is looked for in the status that is read behind it. */
	bool acknowledges;
	float shake_frequency_min; /* Hz */
	unsigned first_option;     /* where VSMD_DRIVE_OPTIONS stand among the driver's options */
	/* Writes the exchange of one command (its id is the link's part). SEND; DONE with
	 * OUT_OF_RANGE when it cannot be said. */
	enum db_step (*ask)(struct vsmd_axis *axis, const struct vsmd_command *command,
	                    bool repeatable, struct db_exchange *exchange, enum db_result *result);
	enum db_step (*look)(struct vsmd_axis *axis, enum vsmd_look look,
	                     struct db_exchange *exchange, enum db_result *result);
};

/* What the drive was told last that its motion is to become, as far as that is known. */
enum vsmd_goal_kind {
	VSMD_GOAL_UNKNOWN,
	VSMD_GOAL_REST,
	VSMD_GOAL_VELOCITY,
	VSMD_GOAL_POSITION,
};

struct vsmd_goal {
	enum vsmd_goal_kind kind;
	float velocity;
	int32_t position;
};

/* The drive as it was read last before a command. */
struct vsmd_before {
	bool moving;
	uint32_t status;
	int32_t position;
	float velocity;
	db_time at;
	struct vsmd_goal goal;
};

/* Looking for the effect of the command under way (stops have no part in this). */
struct vsmd_watch {
	struct vsmd_before before;
	bool has_speed; /* a speed was read behind the command */
	float first_speed;
	bool speed_next;   /* the next look is for the speed */
	db_time since;     /* the first look that did not show it; 0: none */
	unsigned said;     /* how often it was said again */
	bool unproven;     /* some part of it did not show */
	bool by_all;       /* it was said to all drives at once: not acknowledged, not said again */
	unsigned readings; /* of the position from which a relative move is counted */
	unsigned restarts; /* the axis's, when it began */
};

enum vsmd_effect {
	VSMD_EFFECT_SHOWN,  /* something that this command explains, and nothing before it */
	VSMD_EFFECT_OPEN,   /* it moves as it should, but an older motion may be the cause */
	VSMD_EFFECT_ABSENT, /* nothing (yet) */
};

struct vsmd_axis {
	const struct vsmd_link *link;
	const struct db_drive_config *config;
	db_time reaction;     /* how long the drive may take to show what it was told */
	db_time save_time;    /* how long writing its flash may take */
	db_time homing_pause; /* how long homing stands between its phases */
	double window;        /* in-position-window, in the drive's counts */
	db_time save_interval;
	db_time last_save;
	bool saved;

	struct vsmd_status last;    /* the newest of each value */
	db_time heard_at;           /* when `last` came */
	struct vsmd_status process; /* position and velocity of one moment, for the PLC */
	db_time taken;              /* when `process` came */
	bool heard;                 /* `process` holds something */
	bool known;                 /* `last` holds something, if only of before it went away */
	bool away;                  /* it was offline since */
	bool handshake_lapses;      /* the hs bit dropped without a restart, or may have */
	db_time handshake_since;    /* when it was set last */
	db_time told_until; /* until then position, power and homing bit change by command */
	bool zero_is_old;   /* the homing bit is of before the origin was lost */
	bool placed;        /* homed or set_position, since the counter began */
	unsigned restarts;  /* times it was found to count anew */
	struct vsmd_goal goal;
	struct vsmd_watch watch;
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
	struct db_nameplate plate;
	bool params_valid;
};

/* The settings of a drive that every link has, at link->first_option. */
#define VSMD_DRIVE_OPTIONS                                                                       \
	{                                                                                        \
		.section = "drive",                                                              \
		.name = "reaction-ms",                                                           \
		.words = "",                                                                     \
		.preset = "250",                                                                 \
		.min = 0,                                                                        \
		.max = 10000,                                                                    \
		.whole = true,                                                                   \
		.unit = "ms",                                                                    \
		.description = "How long the drive may take until its status shows what it was " \
			       "told: power, motion, a level",                                   \
	},                                                                                       \
		{                                                                                \
			.section = "drive",                                                      \
			.name = "save-ms",                                                       \
			.words = "",                                                             \
			.preset = "500",                                                         \
			.min = 0,                                                                \
			.max = 10000,                                                            \
			.whole = true,                                                           \
			.unit = "ms",                                                            \
			.description = "How long the drive may take to write its flash before "  \
				       "it answers",                                             \
		},                                                                               \
	{                                                                                        \
		.section = "drive", .name = "homing-pause-ms", .words = "", .preset = "500",     \
		.min = 0, .max = 60000, .whole = true, .unit = "ms",                             \
		.description = "How long homing may stand still between its phases; standing "   \
			       "longer, without its end being shown, it has failed",             \
	}
#define VSMD_DRIVE_OPTION_COUNT 3

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
/* What the exchange was to begin was said to all drives at once: does it show? */
enum db_step vsmd_begun_by_all(struct vsmd_axis *axis, struct db_exchange *exchange,
                               enum db_result *result);
/* Any job's answer was lost. */
enum db_step vsmd_lost(struct vsmd_axis *axis, struct db_job *job, struct db_exchange *exchange,
                       enum db_result *result);

/* Pure: what `last` and what is known of the time before say about the command's effect. */
enum vsmd_effect vsmd_effect_of(const struct vsmd_axis *axis, const struct db_job *job);
/* Whether its effect, once seen, is all of it. */
bool vsmd_shows_its_effect(const struct vsmd_link *link, enum db_command command);
/* The same place, as far as in-position-window goes. */
bool vsmd_is_at(const struct vsmd_axis *axis, int32_t position, int32_t place);
/* Of moves without a velocity; NAN: not known. */
float vsmd_preset_speed(const struct vsmd_axis *axis);

void vsmd_take_speed(struct vsmd_axis *axis, float velocity);
void vsmd_take_position(struct vsmd_axis *axis, int32_t position, db_time now);
void vsmd_take_status(struct vsmd_axis *axis, const struct vsmd_status *status, db_time now);
/* A status without the velocity: good for deciding, not for showing. */
void vsmd_take_confirmation(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now);
/* That status is certainly younger than the last command. */
void vsmd_follow_motion(struct vsmd_axis *axis);
void vsmd_take_identity(struct vsmd_axis *axis, const char *text, size_t length);
/* The settings of a job are in force now. */
void vsmd_take_settings(struct vsmd_axis *axis, const struct db_request *request);
/* input_ports of the drivers: those whose mode was read as input. */
unsigned vsmd_input_ports(const struct db_nameplate *plate);

void vsmd_axis_gone(struct vsmd_axis *axis);
void vsmd_axis_feedback(const struct vsmd_axis *axis, struct db_feedback *feedback);

#endif
