/* SPDX-License-Identifier: Apache-2.0 */
/* An axis of an XYZA controller as the driver knows it; the first one's has what is the controller's.
 * Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_DEVICE_H
#define DRIVEBRIDGE_DRIVER_XYZA_DEVICE_H

#include "codec/xyza.h"
#include "drivebridge/driver.h"

/* A row of the table in commands.c. */
enum xyza_plan_kind {
	STEP_PLAIN,     /* a write */
	STEP_MAY_FAIL,  /* a refusal is no failure: it does not apply to the mode it is in */
	STEP_OR_BEFORE, /* of a stop: refused is a failure unless one before it was taken */
	STEP_IF,        /* read: the next one is left out unless this is what is wanted of it */
	STEP_GUARD,     /* read: what is wanted of it stands in the way of the command */
	STEP_BEFORE,    /* read: the program's state, before a command to it */
	STEP_LEARN,     /* read: a ramp follows from it */
	STEP_REFRESH,   /* read: what is known of it counts from now on; it may be untold */
	STEP_CHANGE,    /* read: with one parameter changed it is written next, and read back; both
	                   are left out when it is so already */
	STEP_UNTIL_STANDING, /* read: again until the axis stands */
	STEP_EXPECT, /* read: what is wanted of it shows that the step before had its effect */
	STEP_EXPECT_PARAM,   /* read: likewise of one parameter in it */
	STEP_EXPECT_MOVING,  /* read: likewise of a jog */
	STEP_EXPECT_SPEED,   /* read: again until cycles have seen it at the speed that is wanted */
	STEP_EXPECT_PROGRAM, /* read: likewise of a command to the program */
	STEP_RETREAT, /* a stop, for when the last of them fails; what follows is the command's end */
	PLAN_KINDS
};

struct xyza_step {
	struct xyza_request request;
	enum xyza_plan_kind kind : 8;
	enum xyza_param param : 8; /* CHANGE, EXPECT_PARAM */
	uint8_t back;              /* EXPECT: so many steps back it is written again; 0: nowhere */
	uint32_t value;
	uint32_t mask;   /* bits of the value, or of what is read, that matter */
	uint32_t wanted; /* GUARD, EXPECT: what they are; see xyza_content() */
};

#define XYZA_STEPS_MAX 16
/* ... of a stop: disable looks, stops, and changes the power in three. */
#define XYZA_STOP_STEPS_MAX 6

/* What a command or one parameter write consists of, and where it is. */
struct xyza_plan {
	struct xyza_step *steps;
	unsigned count;     /* behind them may be a RETREAT */
	unsigned at;        /* the one that was said last */
	size_t setting;     /* of a parameter write: which of its parameters */
	unsigned stops;     /* of a jog: the stops that there had been when it began */
	bool stop_taken;    /* of a stop: one of its two modes was stopped, or none needs to */
	bool acted;         /* something that changes the controller was sent */
	bool runs_on;       /* the axis is jogged on the way that it goes already */
	bool lost;          /* the answer to the command itself was */
	bool refused;       /* the controller said that it did not take it */
	bool unproven;      /* nothing that can be read shows what it did */
	float ramp;         /* LEARN: what the ramp is to be, Hz/s */
	float speed_before; /* EXPECT_SPEED: its velocity when the command began, Hz ... */
	float speed;        /* ... and what it is to be */
	db_time sampled;    /* the last velocity that was looked at */
	unsigned samples;   /* so many were ... */
	unsigned near;      /* ... and so many of the last ones are near it */
	unsigned mends;
	db_time answered; /* when the last answer came; the next is not older */
	db_time asked;    /* what came last was read after this */
	db_time entered;  /* since when the effect is looked for; 0: not yet */
	uint32_t before;  /* the program, as xyza_content() has it */
	bool before_read; /* it could be read */
	bool from_known;  /* `from` is where it was first seen since */
	int32_t from;
	db_time progress; /* when the axis was last seen slower than ever before, or nearer to its speed; 0 */
	float least_speed; /* that speed, or the distance to what is wanted */
};

/* Reading all parameters, item by item. */
struct xyza_item_reading {
	unsigned item;   /* the one that was asked for */
	unsigned losses; /* how often its answer was lost */
};

/* A part of the cyclic reading that a controller may not answer, though it answers the rest. */
struct xyza_part {
	unsigned losses;  /* answers lost in a row */
	db_time pause;    /* between two questions, once it is passed over; 0: it is not */
	db_time again_at; /* then it is asked for once more */
};

/* Of the items, which anybody may change at the controller: one after the other is read again. */
struct xyza_turn {
	unsigned polls;         /* readings of all axes that came to their end */
	unsigned axis;          /* whose item is read next, or was */
	unsigned item;          /* the one before it in turn */
	db_time at;             /* when one was read last */
	bool of_enable;         /* what is asked now is the power and not an item in turn */
	unsigned losses;        /* answers lost in a row */
	unsigned enable_losses; /* likewise of the power */
};

struct db_device {
	struct db_device *first; /* of the controller: has what is common */
	uint8_t object;
	enum xyza_axis axis;
	db_time reaction;     /* how long an effect may take to show */
	bool stops_for_speed; /* another speed only from a stand */
	bool limited;         /* its jogs are stopped before a limit of its position */
	struct xyza_plan front;
	struct xyza_plan stop;
	struct xyza_step front_steps[XYZA_STEPS_MAX];
	struct xyza_step stop_steps[XYZA_STOP_STEPS_MAX];

	/* The axis. */
	bool heard;
	struct xyza_part part; /* its part of the cyclic reading, until it is heard */
	bool standing;
	bool negative;
	int32_t position;
	float velocity; /* computed from two positions */
	db_time span;   /* between these two; 0: there are none */
	db_time taken;
	bool jogging;        /* it was told to, and was not seen to stand since */
	bool jog_negative;   /* ... that way */
	bool fresh;          /* told so after the last look at it */
	unsigned told;       /* how often it was told to move or to stop */
	db_time expected_by; /* until then it may still stand, though it was told to move; 0 */
	unsigned placed;     /* how often something of its position was written */
	db_time held_until; /* its position is being written: what is read until then is not shown */
	bool stopping;
	bool refused;
	unsigned resends;                       /* of the command under way */
	unsigned refusals[DB_JOB_SETTINGS + 1]; /* of the last request of each kind of job */
	struct db_nameplate plate;
	bool params_valid;
	uint32_t unread; /* bit i: item i cannot be read, as far as was tried */
	struct xyza_item_reading readings[2]; /* of read_parameters, and of an identification */

	/* First axis only: the controller. */
	struct db_device *axes[XYZA_AXIS_COUNT]; /* null: not configured */
	uint32_t ports;
	uint8_t program;
	uint8_t program_state;
	uint16_t program_step;
	unsigned stops; /* how often any axis was told to stop: all of them do */
	bool delayed;   /* it may have a start delay, which a start without one has to end */
	bool paused;    /* its program was stopped since its state was read */

	/* First axis only: the reading under way. */
	bool polling;       /* it has begun and not come to its end */
	unsigned poll_step; /* what was asked last */
	struct xyza_part ports_part;
	struct xyza_part program_part;
	struct xyza_turn turn;
	unsigned poll_axis;
	unsigned sign_tries;
	bool poll_standing;
	db_time poll_asked; /* that was read after this */
	unsigned poll_told; /* when it was seen to stand or to move */
	unsigned poll_placed;
	bool poll_negative;
	uint32_t poll_magnitude;
	db_time poll_taken;
};

#endif
