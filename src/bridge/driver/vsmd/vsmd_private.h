/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The assumed state of a VSMD drive's axis, on every bus: derived from its answers; restarts and
 * the origin; and the feedback made of that. The link carries the commands. Internal to the driver;
 * bus thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_PRIVATE_H
#define DRIVEBRIDGE_DRIVER_VSMD_PRIVATE_H

#include "codec/vsmd_can.h"
#include "codec/vsmd_serial.h"
#include "drivebridge/driver.h"
#include "driver/conversation.h"

struct vsmd_axis;

enum vsmd_motion {
	VSMD_MOTION_NONE,
	VSMD_MOTION_DISCRETE,
	VSMD_MOTION_CONTINUOUS,
	VSMD_MOTION_HOMING,
	VSMD_MOTION_SHAKE,
	VSMD_MOTION_UNKNOWN, /* not begun by the bridge: before a restart, by a sensor, by hand */
};

/* What is read during a command. */
enum vsmd_read {
	VSMD_READ_STATUS,   /* position and status word; on serial lines the speed, too */
	VSMD_READ_SPEED,    /* the speed */
	VSMD_READ_POSITION, /* the position; on CAN in another frame than with VSMD_LOOK_STATUS */
};

/* How one kind of bus carries commands. */
struct vsmd_link {
	/* True if a drive's answer to a command shows that it received this command. If not (CAN),
	 * its effect is looked for in the status that is read after it. */
	bool acknowledges;
	float shake_frequency_min; /* Hz */
	/* Writes the exchange of one command (the link chooses the id). SEND; DONE with
	 * OUT_OF_RANGE when it cannot be expressed. */
	enum db_step (*send)(struct db_conversation *talk, const struct vsmd_command *command,
	                     bool repeatable);
	enum db_step (*read)(struct db_conversation *talk, enum vsmd_read read);
	/* The answer to save_parameters was received. */
	conversation_fn *saved;
};

/* The motion that the drive was last commanded to make, as far as known. */
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

/* The drive's state as last read before a command. */
struct vsmd_before {
	bool moving;
	uint32_t status;
	int32_t position;
	float velocity;
	bool back;
	db_time at;
	struct vsmd_goal goal;
};

/* The search for the effect of the current command (not for stops). */
struct vsmd_watch {
	struct vsmd_before before;
	bool has_speed; /* a speed was read after the command */
	float first_speed;
	float speed;    /* ... and the last one; reports do not count */
	bool has_place; /* a position was read after it */
	int32_t first_place;
	bool speed_next;  /* the speed is read next */
	db_time since;    /* time of the first reading that did not show it; 0: none */
	unsigned resends; /* number of times it was sent again */
	bool unproven;    /* a part of it did not show */
	bool by_all;      /* it was sent to all drives at once: not acknowledged, not repeated */
	unsigned output;  /* set_outputs: the current port */
	/* number of readings of the position from which a relative move is counted ... */
	unsigned readings;
	int32_t counted_from; /* ... the last reading ... */
	db_time counted_at;   /* ... and its time */
	unsigned upsets;      /* the axis's count when it began */
};

/* Sets of parameters: memory.c says whether the drive would lose some without power. */
struct vsmd_param_set {
	uint64_t valid; /* as the nameplate's */
	union db_value values[VSMD_PARAM_COUNT];
};

struct vsmd_memory {
	struct vsmd_param_set kept;
	struct vsmd_param_set seen; /* values seen last */
	/* it may have been without power since all were read, and then has the saved values */
	bool restarted;
	bool unsaved;
};

/* It may have restarted: the state before that, to be restored if it has not. */
struct vsmd_doubt {
	enum db_doubt kind; /* NONE: no doubt */
	int32_t position;
	bool homed;
	bool placed;
	bool origin_lost;
};

struct vsmd_axis {
	const struct vsmd_link *link;
	const struct db_drive_config *config;
	db_time reaction;     /* how long the drive may take to show an effect */
	db_time save_time;    /* how long writing its flash may take */
	db_time homing_pause; /* how long the axis stands between phases of homing */
	double window;        /* in-position-window, in the drive's counts */
	bool computes_speed;  /* it comes from two positions */
	bool unsigned_speed;  /* the drive does not report the sign of its speed */
	bool back;            /* it moves back, or did so last ... */
	int32_t farthest;     /* ... and has come this far in that direction */
	db_time save_interval;
	db_time last_save;
	bool saved;

	struct vsmd_status last;    /* the newest of each value */
	db_time status_at;          /* when `last` arrived */
	struct vsmd_status process; /* position and velocity of one moment, for the PLC */
	db_time taken;              /* when `process` arrived */
	bool has_status;            /* `process` holds something */
	/* `last` holds something, even if older than its offline time */
	bool known;
	bool away;               /* it was offline at some time since */
	bool handshake_lapses;   /* the hs bit was cleared without a restart, or may have been */
	db_time handshake_since; /* when it was last seen set */
	db_time effect_until;    /* until then commands may change position, power and homing bit */
	/* the homing bit is older than the loss of the origin, or of an earlier homing */
	bool zero_is_old;
	bool placed;       /* homed or set_position, since the counter began */
	unsigned upsets;   /* times its counter was found to have restarted, for whatever reason */
	uint32_t restarts; /* times it was found to have restarted ... */
	uint32_t doubts;   /* ... and times one sign of that was seen */
	struct vsmd_doubt doubt;
	bool params_differ; /* those read since it is back differ from those before */
	struct vsmd_goal goal;
	struct vsmd_watch watch;
	db_time power_asked; /* disable: when the power was first read ... */
	db_time off_sent;    /* ... and when disable was last sent */
	enum vsmd_motion motion;
	enum vsmd_motion begun; /* homing or shaking was requested, and not confirmed since */
	bool just_commanded;    /* a motion was accepted, no status read after it yet */
	bool stopping;
	bool homed;
	bool origin_lost;
	/* the last command was not answered: the next status may show that the drive has refused
	 * it */
	bool unanswered;
	bool refuses; /* the last status answered a command by refusing it */
	bool refused;
	bool has_target;
	int32_t target;
	int32_t wanted; /* the target of the position move being requested, once it is accepted */
	unsigned standstill_count; /* number of statuses in a row that show it standing */
	db_time standstill_since;  /* the first of them */
	struct db_nameplate plate;
	DB_NAMEPLATE_ROOM(VSMD_PARAM_COUNT) plate_room;
	struct vsmd_memory memory;
	bool params_valid;
};

/* Settings of a drive, named as their keys. */
struct vsmd_drive_options {
	double reaction_ms;
	double save_ms;
	double homing_pause_ms;
	unsigned speed_sign; /* 1: in how the position changes */
};

/* The settings of a drive, common to all links, at link->first_option. */
#define VSMD_DRIVE_OPTIONS                                                                       \
	{                                                                                        \
		.section = "drive",                                                              \
		.name = "reaction-ms",                                                           \
		.offset = offsetof(struct vsmd_drive_options, reaction_ms),                      \
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
			.offset = offsetof(struct vsmd_drive_options, save_ms),                  \
			.words = "",                                                             \
			.preset = "500",                                                         \
			.min = 0,                                                                \
			.max = 10000,                                                            \
			.whole = true,                                                           \
			.unit = "ms",                                                            \
			.description = "How long the drive may take to write its flash before "  \
				       "it answers",                                             \
		},                                                                               \
		{                                                                                \
			.section = "drive",                                                      \
			.name = "homing-pause-ms",                                               \
			.offset = offsetof(struct vsmd_drive_options, homing_pause_ms),          \
			.words = "",                                                             \
			.preset = "500",                                                         \
			.min = 0,                                                                \
			.max = 60000,                                                            \
			.whole = true,                                                           \
			.unit = "ms",                                                            \
			.description =                                                           \
				"How long homing may stand still between its phases; standing "  \
				"longer, without its end being shown, it has failed",            \
		},                                                                               \
	{                                                                                        \
		.section = "drive", .name = "speed-sign",                                        \
		.offset = offsetof(struct vsmd_drive_options, speed_sign),                       \
		.words = "signed position", .preset = "signed", .unit = "",                      \
		.description =                                                                   \
			"Where the direction of the velocity is: in the sign of the speed that " \
			"the drive tells, or, of drives that tell none, in how the position "    \
			"changes",                                                               \
	}

/* The devices of both families begin with their axis. */
static inline struct vsmd_axis *axis_of(const struct db_conversation *talk)
{
	return (struct vsmd_axis *)talk->device;
}

void vsmd_axis_init(struct vsmd_axis *axis, const struct vsmd_link *link,
                    const struct db_bus_config *bus, const struct db_drive_config *drive);

/* True if both are the same place within in-position-window. */
static inline bool vsmd_is_at(const struct vsmd_axis *axis, int32_t position, int32_t place)
{
	double way = (double)position - (double)place;

	return way <= axis->window && -way <= axis->window;
}
/* Its counter goes on at the other end when it overflows. */
static inline double vsmd_way(int32_t from, int32_t to)
{
	return (double)(int32_t)((uint32_t)to - (uint32_t)from);
}
/* The speed of moves without a velocity; NAN: not known. */
float vsmd_preset_speed(const struct vsmd_axis *axis);

/* The direction changes when it has come back from the farthest place by more than
 * in-position-window: a slow drive takes several readings for that. Called before the position is
 * taken. */
void vsmd_follow_way(struct vsmd_axis *axis, int32_t position);
/* A speed as it was told, with the sign of the way where it has none. */
float vsmd_with_sign(const struct vsmd_axis *axis, float speed);
void vsmd_take_speed(struct vsmd_axis *axis, float velocity);
void vsmd_take_status(struct vsmd_axis *axis, const struct vsmd_status *status, db_time now);
/* Takes a status without the velocity: used for decisions, not shown. */
void vsmd_take_confirmation(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now);
/* The last status is certainly newer than the last command. */
void vsmd_follow_motion(struct vsmd_axis *axis);
/* An identity without the blanks before it and the quotation marks around it. */
const char *vsmd_bare_identity(const char *text, size_t *length);
void vsmd_take_identity(struct vsmd_axis *axis, const char *text, size_t length);
/* All parameters were read; the plate has their values. */
void vsmd_take_all_params(struct vsmd_axis *axis);
/* The settings of a job are in force now. */
void vsmd_take_settings(struct vsmd_axis *axis, const struct db_request *request);
/* The drive confirmed a command. */
void vsmd_carry_out(struct vsmd_axis *axis, const struct db_request *request);
/* A command is sent that changes position, power or homing bit: until that shows, such a change is
 * no restart. */
void vsmd_expect_change(struct vsmd_axis *axis);
/* The motion that a stop has to end: also one that the drive may have begun although its answer was
 * lost. */
enum vsmd_motion vsmd_motion_to_end(const struct vsmd_axis *axis);
/* True for a port of set_output, 1 to 6, that is known to be an input. */
bool vsmd_is_input(const struct vsmd_axis *axis, unsigned port);
/* input_ports of the drivers: ports whose mode was read as input. */
unsigned vsmd_input_ports(const struct db_nameplate *plate);

/* Members of db_driver for the devices of both families, which begin with their axis. */
void vsmd_axis_gone(struct db_device *device);
void vsmd_write_feedback(const struct db_device *device, struct db_feedback *feedback);
const struct db_nameplate *vsmd_get_nameplate(const struct db_device *device);

/* --- memory.c --------------------------------------------------------------------------------- */

/*
 * Determines whether a drive would lose parameters without power: whether its values differ from
 * those saved last, as far as the bridge knows. The values at the bridge's first reading count as
 * saved.
 */

/* True if the drive holds another value now than in this set. */
bool vsmd_memory_differs(const struct vsmd_param_set *set, const struct db_nameplate *plate);

/* The nameplate changed; `all`: all parameters were read, else some were written. */
void vsmd_memory_follow(struct vsmd_memory *memory, const struct db_nameplate *plate, bool all);

/* The drive has saved its present values. */
void vsmd_memory_keep(struct vsmd_memory *memory, const struct db_nameplate *plate);

/* --- effect.c --------------------------------------------------------------------------------- */

/* Judges whether the readings after a command show that it had its effect. Internal to the driver;
 * pure. */

enum vsmd_effect {
	VSMD_EFFECT_SHOWN,  /* a change that this command explains, and no earlier one */
	VSMD_EFFECT_OPEN,   /* it moves as it should, but an older motion may be the cause */
	VSMD_EFFECT_ABSENT, /* nothing (yet) */
};

/* Judges the effect of the job's command by `last` and the earlier state. */
enum vsmd_effect vsmd_effect_of(const struct vsmd_axis *axis, const struct db_job *job);
/* True if it moved before the command and still moves, and only speed 0 was reported meanwhile. */
bool vsmd_reports_no_speed(const struct vsmd_axis *axis);
/* True if its effect, once seen, is complete. */
bool vsmd_shows_its_effect(const struct vsmd_link *link, enum db_command command);

/* --- serial_wire.c ---------------------------------------------------------------------------- */

/* The frames on a serial line of VSMD drives: where they begin and end, their addresses, and their
 * time on the wire. Members of db_driver, where they are described. */

void vsmd_serial_cut_frame(const struct db_received *received, size_t *skip, size_t *length);
enum db_frame vsmd_serial_accept(const struct db_bus_config *bus, const uint8_t *frame,
                                 size_t length, int *address);
uint32_t vsmd_serial_part(const struct db_bus_config *bus, const uint8_t *frame, size_t length);
void vsmd_serial_describe_any(const struct db_bus_config *bus, bool sent, const uint8_t *frame,
                              size_t length, struct db_description *description);
db_time vsmd_serial_poll_time(const struct db_bus_config *bus);
db_time vsmd_serial_command_time(const struct db_bus_config *bus);
bool vsmd_serial_mishears(unsigned address, const uint8_t *request, size_t length);

/* --- serial_inquiry.c ------------------------------------------------------------------------- */

/* Inquiries of VSMD drives on serial lines, see driver.h. Pure. */

/* Longest answers of undocumented length: an identity, and all parameters as text. */
#define VSMD_IDENTITY_FRAME 64
#define VSMD_PARAMS_FRAME 1000

bool vsmd_serial_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                         struct db_exchange *exchange);
enum db_recognised vsmd_serial_recognise(const struct db_bus_config *bus,
                                         const struct db_inquiry *inquiry, const uint8_t *frame,
                                         size_t length, struct db_inquired *found);

/* --- can_state.c ------------------------------------------------------------------------------ */

/* Frames from a drive: answers to reads of its status, and its own reports. */

/* Takes the answer to a command's read. */
void vsmd_can_take_read(struct db_device *device, db_time now);
/* Takes the answer to the cyclic read. */
void vsmd_can_take_poll(struct db_device *device, db_time now);

/* As in struct db_driver. */
bool vsmd_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                          db_time now);
bool vsmd_can_wants_poll(const struct db_device *device, db_time now);
void vsmd_can_forget_state(struct db_device *device);

/* --- can_steps.c ------------------------------------------------------------------------------ */

/* The conversations with a VSMD drive on CAN. */

/* How CAN carries commands. */
extern const struct vsmd_link vsmd_can_link;

/* As in struct db_driver. */
enum db_step vsmd_can_begin(struct db_conversation *talk);
enum db_step vsmd_can_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length);
enum db_step vsmd_can_lose_answer(struct db_conversation *talk);

/* --- can_inquiry.c ---------------------------------------------------------------------------- */

/* Inquiries of VSMD drives on CAN, see driver.h. Pure. */

bool vsmd_can_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                      struct db_exchange *exchange);
enum db_recognised vsmd_can_recognise(const struct db_bus_config *bus,
                                      const struct db_inquiry *inquiry, const uint8_t *bytes,
                                      size_t length, struct db_inquired *found);

#endif
