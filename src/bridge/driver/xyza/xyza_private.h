/* SPDX-License-Identifier: Apache-2.0 */
/* The driver's state of an axis of an XYZA controller; the first axis also has the controller's
 * state. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_PRIVATE_H
#define DRIVEBRIDGE_DRIVER_XYZA_PRIVATE_H

#include "codec/xyza.h"
#include "drivebridge/driver.h"
#include "driver/conversation.h"
#include "driver/restart.h"

/* A row of the table in commands.c. */
enum xyza_plan_kind {
	STEP_PLAIN,    /* a write */
	STEP_MAY_FAIL, /* a refusal is no failure: the step does not apply in the present mode */
	/* of a stop: a refusal is a failure unless the step before it was accepted */
	STEP_OR_BEFORE,
	STEP_IF,      /* read: the next step is skipped unless the value is as wanted */
	STEP_GUARD,   /* read: if the value is as wanted, the command cannot be carried out */
	STEP_BEFORE,  /* read: the program's state, before a command to it */
	STEP_LEARN,   /* read: a ramp depends on it */
	STEP_REFRESH, /* read: its value is refreshed; it may remain unknown */
	STEP_CHANGE,  /* read: with one parameter changed it is written next, and read back; both
	                   are left out when it is so already */
	STEP_UNTIL_STANDING, /* read: repeated until the axis stands */
	STEP_EXPECT,       /* read: the value as wanted shows that the step before had its effect */
	STEP_EXPECT_PARAM, /* read: the same for one parameter in it */
	STEP_EXPECT_MOVING,  /* read: the same for a jog */
	STEP_EXPECT_SPEED,   /* read: repeated until cycles have measured the wanted speed */
	STEP_EXPECT_PROGRAM, /* read: the same for a command to the program */
	STEP_CALL_OFF,       /* a stop, sent when the last of them fails; then the command ends */
	PLAN_KINDS
};

struct xyza_step {
	struct xyza_request request;
	enum xyza_plan_kind kind : 8;
	enum xyza_param param : 8; /* CHANGE, EXPECT_PARAM */
	/* EXPECT: number of steps to go back to write it again; 0: none */
	uint8_t back;
	uint32_t value;
	uint32_t mask;   /* bits of the value written, or read, that matter */
	uint32_t wanted; /* GUARD, EXPECT: their wanted value; see xyza_content() */
};

#define XYZA_STEPS_MAX 16
/* Maximum number of steps of a stop: disable reads, stops, and changes the power in three. */
#define XYZA_STOP_STEPS_MAX 6

/* The steps of a command or of one parameter write, and the current one. */
struct xyza_plan {
	struct xyza_step *steps;
	unsigned count;     /* a CALL_OFF may follow them */
	unsigned at;        /* the step that was sent last */
	size_t setting;     /* of a parameter write: the index of its parameter */
	unsigned stops;     /* of a jog: the number of stops when it began */
	bool stop_taken;    /* of a stop: one of its two modes was stopped, or none needs to be */
	bool acted;         /* a frame that changes the controller was sent */
	bool same_way;      /* the axis is jogged in the direction in which it moves already */
	bool lost;          /* the answer to the command itself was lost */
	bool refused;       /* the controller refused it */
	bool unproven;      /* no reading shows its effect */
	float ramp;         /* LEARN: the wanted ramp, Hz/s */
	float speed_before; /* EXPECT_SPEED: its velocity when the command began, Hz ... */
	float speed;        /* ... and the wanted one */
	db_time sampled;    /* time of the last velocity judged */
	unsigned samples;   /* number of velocities judged ... */
	unsigned near;      /* ... and number of the last ones near it */
	unsigned rewrites;
	db_time answered; /* when the last answer arrived; the next is not older */
	db_time asked;    /* the last answer was requested then */
	db_time entered;  /* when reading for the effect began; 0: not yet */
	uint32_t before;  /* the program's state, as xyza_content() returns it */
	bool before_read; /* the state could be read */
	bool from_known;  /* `from` is its first position since */
	int32_t from;
	/* when the axis was last seen slower than before, or nearer to its speed; 0 */
	db_time progress;
	float least_speed; /* that speed, or the distance to the wanted one */
};

/* Reading all parameters, item by item. */
struct xyza_item_reading {
	unsigned item;   /* the item being read */
	unsigned losses; /* number of lost answers */
};

/* A part of the cyclic reading that a controller may not answer, though it answers the rest. */
struct xyza_part {
	unsigned losses; /* lost answers in a row */
	/* Pause between two reads, once it is skipped because the controller does not answer for
	 * it; earlier values do not count then. 0: not skipped. */
	db_time pause;
	db_time again_at; /* when it is read again */
};

/* When items without an answer are asked for again: each of them once in a round. */
struct xyza_silence {
	db_time at;                      /* when the next round begins */
	db_time pause;                   /* after the next round; 0: there was no such item yet */
	uint32_t tried[XYZA_AXIS_COUNT]; /* a bit for each item that was asked for in this round */
};

/* Items may be changed at the controller: they are read again one after the other. */
struct xyza_turn {
	unsigned polls;                   /* number of complete readings of all axes */
	unsigned axis;                    /* the axis whose item is read next, or was */
	enum xyza_item item;              /* the previous item in turn */
	enum xyza_item asked;             /* the item that is read: that one, or the power */
	db_time at;                       /* when an item was last read */
	unsigned losses;                  /* lost answers in a row */
	unsigned enable_losses;           /* lost answers of the power in a row */
	struct xyza_silence silent;       /* items that were not answered when all were read */
	struct xyza_silence silent_power; /* the power, which has turns of its own */
};

struct db_device {
	struct db_device *first; /* the controller's first axis: has the common state */
	uint8_t object;
	enum xyza_axis axis;
	db_time reaction;     /* how long an effect may take to show */
	bool stops_for_speed; /* a speed can only be changed at standstill */
	bool limited;         /* its jogs are stopped before a position limit */
	struct xyza_plan front;
	struct xyza_plan stop;
	struct xyza_step front_steps[XYZA_STEPS_MAX];
	struct xyza_step stop_steps[XYZA_STOP_STEPS_MAX];

	/* The axis. */
	bool has_position;
	struct xyza_part part; /* its part of the cyclic reading, until it has answered */
	bool standing;
	bool negative;
	int32_t position;
	float velocity; /* computed from two positions */
	db_time span;   /* time between these two; 0: there are none */
	db_time taken;
	bool jogging;        /* it was sent a jog, and was not seen standing since */
	bool jog_negative;   /* ... in the negative direction */
	bool just_commanded; /* commanded after the last reading */
	unsigned commanded;  /* number of commands to move or to stop */
	db_time expected_by; /* until then it may still stand after a command to move; 0 */
	unsigned placed;     /* number of writes to its position */
	db_time held_until;  /* its position is being written: readings until then are not shown */
	struct restart restart;
	bool stopping;
	bool refused;
	unsigned resends;                       /* repeats of the current command */
	unsigned refusals[DB_JOB_SETTINGS + 1]; /* of the last request of each kind of job */
	struct db_nameplate plate;
	DB_NAMEPLATE_ROOM(XYZA_SHOWN_COUNT) plate_room;
	bool params_valid;
	uint32_t unread;                      /* bit i: item i cannot be read, as far as tried */
	struct xyza_item_reading readings[2]; /* of read_parameters, and of an identification */

	/* First axis only: the controller. */
	struct db_device *axes[XYZA_AXIS_COUNT]; /* null: not configured */
	uint32_t ports;
	uint8_t program;
	uint8_t program_state;
	uint16_t program_step;
	unsigned stops; /* number of stops of any axis: all of them stop */
	bool delayed;   /* it may have a start delay, which a start without one has to clear */
	bool paused;    /* its program was stopped since its state was last read */

	/* First axis only: the current reading. */
	bool polling;                     /* it has begun and has not ended */
	unsigned poll_step;               /* the step read last, ... */
	struct xyza_request poll_request; /* ... and its request */
	struct xyza_part ports_part;
	struct xyza_part program_part;
	struct xyza_turn turn;
	unsigned poll_axis;
	unsigned sign_tries;
	bool poll_standing;
	db_time poll_asked;      /* when the request was sent */
	unsigned poll_commanded; /* `commanded` when it was seen standing or moving */
	unsigned poll_placed;
	bool poll_negative;
	uint32_t poll_magnitude;
	db_time poll_taken;
};

/* --- state.c ---------------------------------------------------------------------------------- */

/* The assumed state of a controller's axes, and the feedback made of it. */

/* Bits of drive_status, which are not in the document: made from readings. The program's state is a
 * number in eight of them. */
#define STATUS_NEGATIVE 0
#define STATUS_STANDS 1
#define STATUS_PROGRAM 8

/* program_state of a controller that does not report it. */
#define PROGRAM_STATE_UNKNOWN UINT16_MAX

/* One that is not known counts as idle: it prevents nothing. */
void xyza_take_program(struct db_device *first, const struct xyza_reply *reply);

/* Takes the value that was read for an item. */
void xyza_learn_item(struct db_device *device, enum xyza_item item, uint32_t content, db_time now);
/* A controller may not have the item. */
void xyza_forget_item(struct db_device *device, enum xyza_item item);
/* After a reset nothing known of any axis is valid. */
void xyza_forget_all(struct db_device *first);

/* True if it is stopped and can continue: another stop might end it. */
bool xyza_is_program_stopped(const struct db_device *first);

/* A motion was started: the axis counts as moving until it was seen to move. */
void xyza_note_started(struct db_device *device, bool negative);
/* It stands, whatever was sent before. */
void xyza_note_standing(struct db_device *device);
/* All axes were sent a stop. */
void xyza_note_stopped(struct db_device *first);
/* The program may have started any axis so recently that it still reports standing. */
void xyza_doubt_standing(struct db_device *first, db_time now);

/* The axis does not answer: it is offline until it does, and nothing read before counts then. */
void xyza_forget_state(struct db_device *device);

/* As in struct db_driver. */
void xyza_write_feedback(const struct db_device *device, struct db_feedback *feedback);
void xyza_gone(struct db_device *device);

/* --- frames.c --------------------------------------------------------------------------------- */

/* Requests to a controller, as exchanges. xyza_write_raw() is pure. */

enum db_step xyza_send(struct db_conversation *talk, struct xyza_request request, bool repeatable);

/* The new number that the controller is given; 0: none. */
unsigned xyza_new_number(const struct xyza_request *request);

/* A client's raw frame, raw_frame; its length, or negative: there is none. */
int xyza_write_raw(const struct db_args *args, uint8_t object, uint8_t *frame, size_t size);

/* The conversation of raw_frame. */
enum db_step xyza_begin_raw(struct db_conversation *talk);
enum db_step xyza_answer_raw(struct db_conversation *talk, const uint8_t *frame, size_t length);

/* --- plan.c ----------------------------------------------------------------------------------- */

/* The requests to an XYZA controller for one command or parameter, step by step. */

/* Fills in the steps of a command or a parameter write. `out_of_step`: the controller may receive
 * but cannot be understood. */
void xyza_plan_command(struct xyza_plan *plan, struct db_device *device,
                       const struct db_request *request, bool out_of_step);
void xyza_plan_setting(struct xyza_plan *plan, const struct db_device *device,
                       const struct db_setting *setting);

/* --- commands.c ------------------------------------------------------------------------------- */

/* Commands and parameter writes: a plan (plan.c), step by step. */

/* By enum xyza_plan_kind. */
extern const struct conversation_step xyza_plan_steps[];

/* Not for read_parameters and raw_frame, which have no plan. */
enum db_step xyza_begin_command(struct db_conversation *talk);
enum db_step xyza_begin_settings(struct db_conversation *talk);

/* An answer to a step of a plan was received. */
void xyza_note_answer(struct db_conversation *talk);
/* True for a refusal that is no failure, or that is looked into first: it is not sent again. */
bool xyza_is_refusal_final(const struct db_conversation *talk);

/* --- items.c ---------------------------------------------------------------------------------- */

/* Reading all parameters, item by item. */

extern const struct conversation_step xyza_item_steps[];

/* After this number of unanswered reads an item counts as missing in this controller; one with a
 * known value is read again with all others. */
#define XYZA_ITEM_TRIES 2

/* Reads the next readable item, from this one on. */
enum db_step xyza_read_items(struct db_conversation *talk, unsigned item);

/* --- poll.c ----------------------------------------------------------------------------------- */

/* The cyclic reading of a controller, for all its axes. */

extern const struct conversation_step xyza_poll_steps[];

/* The device is the controller's first axis. */
enum db_step xyza_begin_poll(struct db_conversation *talk);

/* --- steps.c ---------------------------------------------------------------------------------- */

/* The conversations with an XYZA controller. */

/* As in struct db_driver. */
enum db_step xyza_begin(struct db_conversation *talk);
enum db_step xyza_answer(struct db_conversation *talk, const uint8_t *frame, size_t length);
enum db_step xyza_lose_answer(struct db_conversation *talk);

/* --- inquiry.c -------------------------------------------------------------------------------- */

/* Inquiries of XYZA controllers, see driver.h. Pure. */

bool xyza_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                  struct db_exchange *exchange);
enum db_recognised xyza_recognise(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                                  const uint8_t *frame, size_t length, struct db_inquired *found);

/* --- effect.c --------------------------------------------------------------------------------- */

/* Whether what was read shows that a command had its effect. */

/* A speed computed from positions fluctuates by this fraction. Two speeds that are closer than that
 * cannot be distinguished. */
#define XYZA_SPEED_SHARE 0.2f

/* The content of a reply as one number: the value, or a program's state, number << 8 and step <<
 * 16. */
uint32_t xyza_content(const struct xyza_reply *reply);
/* True if two cycles since the command have found it at two places. */
bool xyza_was_seen_elsewhere(const struct db_device *device, struct xyza_plan *plan);
/* True if the speed computed from positions shows which of the two speeds it has. */
bool xyza_can_distinguish_speeds(const struct db_device *device, const struct xyza_plan *plan);
/* Of a program's state. */
bool xyza_has_ended(uint32_t content);
bool xyza_has_stopped(uint32_t content);
/* True if the program's state is what this command makes of the state before, and nothing else. */
bool xyza_shows_effect(const struct xyza_plan *plan, const struct db_request *request,
                       uint32_t content);

#endif
