/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is believed of a VSMD drive's axis, on every bus: what its answers teach, restarts and the origin,
 * and the feedback made of that. How a command travels is the link's part. Internal to the driver; bus
 * thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_AXIS_H
#define DRIVEBRIDGE_DRIVER_VSMD_AXIS_H

#include "codec/vsmd_serial.h"
#include "driver/conversation.h"
#include "driver/vsmd/memory.h"

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
	enum db_step (*say)(struct db_conversation *talk, const struct vsmd_command *command,
	                    bool repeatable);
	enum db_step (*look)(struct db_conversation *talk, enum vsmd_look look);
	/* The answer to save_parameters came. */
	conversation_fn *saved;
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
	bool has_place; /* a position was read behind it */
	int32_t first_place;
	bool speed_next;   /* the next look is for the speed */
	db_time since;     /* the first look that did not show it; 0: none */
	unsigned said;     /* how often it was said again */
	bool unproven;     /* some part of it did not show */
	bool by_all;       /* it was said to all drives at once: not acknowledged, not said again */
	unsigned output;   /* set_outputs: the port that it is at */
	unsigned readings; /* of the position from which a relative move is counted ... */
	int32_t counted_from; /* ... the last of them ... */
	db_time counted_at;   /* ... and when it came */
	unsigned upsets;      /* the axis's, when it began */
};

/* It may have restarted: what was true before that, in case that it has not. */
struct vsmd_doubt {
	enum db_doubt kind; /* NONE: there is none */
	int32_t position;
	bool homed;
	bool placed;
	bool origin_lost;
};

struct vsmd_axis {
	const struct vsmd_link *link;
	const struct db_drive_config *config;
	db_time reaction;     /* how long the drive may take to show what it was told */
	db_time save_time;    /* how long writing its flash may take */
	db_time homing_pause; /* how long homing stands between its phases */
	double window;        /* in-position-window, in the drive's counts */
	bool unsigned_speed;  /* the drive tells no sign of its speed */
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
	unsigned upsets;    /* times it was found to count anew, for whatever reason */
	uint32_t restarts;  /* times it was found to have restarted ... */
	uint32_t doubts;    /* ... and times one sign of that came */
	struct vsmd_doubt doubt;
	bool params_differ; /* those read since it is back from those before */
	struct vsmd_goal goal;
	struct vsmd_watch watch;
	db_time power_asked; /* disable: when it was first asked whether the power is off ... */
	db_time off_said;    /* ... and when that was said last */
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
	struct vsmd_memory memory;
	bool params_valid;
};

/* The settings of a drive that every link has, at link->first_option. */
#define VSMD_DRIVE_OPTIONS                                                                           \
	{                                                                                            \
		.section = "drive",                                                                  \
		.name = "reaction-ms",                                                               \
		.words = "",                                                                         \
		.preset = "250",                                                                     \
		.min = 0,                                                                            \
		.max = 10000,                                                                        \
		.whole = true,                                                                       \
		.unit = "ms",                                                                        \
		.description = "How long the drive may take until its status shows what it was "     \
			       "told: power, motion, a level",                                       \
	},                                                                                           \
		{                                                                                    \
			.section = "drive",                                                          \
			.name = "save-ms",                                                           \
			.words = "",                                                                 \
			.preset = "500",                                                             \
			.min = 0,                                                                    \
			.max = 10000,                                                                \
			.whole = true,                                                               \
			.unit = "ms",                                                                \
			.description = "How long the drive may take to write its flash before "      \
				       "it answers",                                                 \
		},                                                                                   \
		{                                                                                    \
			.section = "drive",                                                          \
			.name = "homing-pause-ms",                                                   \
			.words = "",                                                                 \
			.preset = "500",                                                             \
			.min = 0,                                                                    \
			.max = 60000,                                                                \
			.whole = true,                                                               \
			.unit = "ms",                                                                \
			.description =                                                               \
				"How long homing may stand still between its phases; standing "      \
				"longer, without its end being shown, it has failed",                \
		},                                                                                   \
	{                                                                                            \
		.section = "drive", .name = "speed-sign", .words = "signed position",                \
		.preset = "signed", .unit = "",                                                      \
		.description =                                                                       \
			"Where the direction of the velocity is: in the sign of the speed that the " \
			"drive tells, or, of drives that tell none, in how the position changes",    \
	}
#define VSMD_DRIVE_OPTION_COUNT 4

/* Both families' devices begin with their axis. */
static inline struct vsmd_axis *axis_of(const struct db_conversation *talk)
{
	return (struct vsmd_axis *)talk->device;
}

void vsmd_axis_init(struct vsmd_axis *axis, const struct vsmd_link *link,
                    const struct db_bus_config *bus, const struct db_drive_config *drive);

/* The same place, as far as in-position-window goes. */
static inline bool vsmd_is_at(const struct vsmd_axis *axis, int32_t position, int32_t place)
{
	double way = (double)position - (double)place;

	return way <= axis->window && -way <= axis->window;
}
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
/* The plate holds what all parameters were read as now. */
void vsmd_take_all_params(struct vsmd_axis *axis);
/* The settings of a job are in force now. */
void vsmd_take_settings(struct vsmd_axis *axis, const struct db_request *request);
/* The drive confirmed a command. */
void vsmd_carry_out(struct vsmd_axis *axis, const struct db_request *request);
/* The drive was told something that may have come to it, or not. */
void vsmd_doubt_motion(struct vsmd_axis *axis, enum db_command command);
/* The position move that was asked for may have been taken. */
void vsmd_take_target(struct vsmd_axis *axis);
/* What a stop has to end: also what the drive may have begun without its answer coming back. */
enum vsmd_motion vsmd_motion_to_end(const struct vsmd_axis *axis);
/* A port of set_output, 1 to 6, that is known to be an input. */
bool vsmd_is_input(const struct vsmd_axis *axis, unsigned port);
/* input_ports of the drivers: those whose mode was read as input. */
unsigned vsmd_input_ports(const struct db_nameplate *plate);

void vsmd_axis_gone(struct vsmd_axis *axis);
void vsmd_axis_feedback(const struct vsmd_axis *axis, struct db_feedback *feedback);

#endif
