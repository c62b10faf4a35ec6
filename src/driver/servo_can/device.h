/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the servo family's driver share. Internal to src/driver:
 *
 *   options.c    keys of the configuration, which commands they allow, what is wrong in them
 *   state.c      what the drive says: readings, reports, the feedback made of them
 *   frames.c     frames to the drive, as exchanges, and what an acknowledgement changes
 *   commands.c   commands and the reaction to a fault: which frame is next
 *   settings.c   parameters and the profile of the configuration
 *   driver.c     jobs, the bus's side, the descriptor
 */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_DEVICE_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_DEVICE_H

#include "codec/servo_can.h"
#include "driver/list.h"

#define SERVO_SPEED_MAX 32767.0   /* rpm; signed 16 bits */
#define SERVO_CURRENT_MAX 3276.7  /* A; as 0.1 A in signed 16 bits */
#define SERVO_CURRENT_STEPS 10.0f /* of an ampere */

#define SERVO_MODE_NOT_KNOWN (-1) /* beside enum servo_can_mode */

/* --- configuration --------------------------------------------------------------------------------- */

enum servo_option {
	OPTION_ACK_BASE,
	OPTION_PADDED,
	OPTION_WORDS_BASE,
	OPTION_WORDS_LENGTH,
	OPTION_WORD_0_AT,
	OPTION_WORD_1_AT,
	OPTION_WORDS_FIXED,
	OPTION_WORDS_ACK,
	OPTION_CHANGE_MODE,
	OPTION_MODE,
	OPTION_TORQUE_DIRECTION,
	OPTION_SYNC,
	OPTION_REPORTS,
	OPTION_ENABLED_BIT,
	OPTION_VOLTAGE_SCALE,
	OPTION_TEMPERATURE_SCALE,
	OPTION_TEMPERATURE_OFFSET,
	OPTION_COUNTS_PER_TURN,
	OPTION_MAX_SPEED,
	OPTION_ACCELERATION,
	OPTION_DECELERATION,
	OPTION_ON_FAULT,
	OPTION_STANDSTILL_SPEED,
	OPTION_REACTION,
	SERVO_OPTION_COUNT
};

enum servo_on_fault { SERVO_ON_FAULT_NONE, SERVO_ON_FAULT_STOP, SERVO_ON_FAULT_DISABLE };

/* What a drive is to have each time it comes back. NAN and SERVO_MODE_NOT_KNOWN: nothing. */
struct servo_profile {
	int mode;
	double max_speed;    /* rpm */
	double acceleration; /* rpm/s, both or none */
	double deceleration;
};

extern const struct db_option servo_options[SERVO_OPTION_COUNT];

#define SERVO_POSITION_MOVES \
	(DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) | DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE))
#define SERVO_MOVES                                                    \
	(SERVO_POSITION_MOVES | DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | \
	 DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT))
/* clear_fault is among them because it is also what resets a latched loss of the client. */
#define SERVO_COMMANDS                                                                  \
	(SERVO_MOVES | DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) | \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |              \
	 DB_COMMAND_BIT(DB_CMD_SET_POSITION) | DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) |     \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_SYNC_START))

struct servo_can_layout servo_layout(const struct db_bus_config *bus);
/* Fills in the settings of a device. */
void servo_configure(struct db_device *device, const struct db_bus_config *bus,
                     const struct db_drive_config *drive);
double servo_velocity_counts(const struct db_drive_config *drive);
uint64_t servo_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive);
enum db_result servo_check(const struct db_bus_config *bus, const struct db_drive_config *drive,
                           enum db_command command, const struct db_args *args);
void servo_check_config(const struct db_bus_config *bus,
                        const struct db_drive_config *const *drives, size_t drive_count,
                        db_complain_fn *complain, void *context);

/* --- parameters ------------------------------------------------------------------------------------ */

/* The drive has no way to read these: they are known once the bridge has written them. */
enum servo_param {
	PARAM_ACCELERATION,
	PARAM_DECELERATION,
	PARAM_MAX_SPEED,
	PARAM_CCLR, /* bits of command word 0, in the order of servo_word_bits */
	PARAM_ZCLAMP,
	PARAM_TRQLM,
	PARAM_SPDLM,
	PARAM_POS0,
	PARAM_POS1,
	PARAM_POS2,
	PARAM_WORD_1,
	SERVO_PARAM_COUNT
};

#define PARAM_BIT(param) (UINT64_C(1) << (param))
#define RAMPS (PARAM_BIT(PARAM_ACCELERATION) | PARAM_BIT(PARAM_DECELERATION))
#define WORDS (PARAM_BIT(SERVO_PARAM_COUNT) - PARAM_BIT(PARAM_CCLR))

extern const struct db_param servo_params[SERVO_PARAM_COUNT];

enum db_result servo_check_param(const struct db_bus_config *bus, size_t param,
                                 union db_value value);

/* --- a drive ------------------------------------------------------------------------------------- */

enum servo_level { LEVEL_NOT_KNOWN, LEVEL_LOW, LEVEL_HIGH };

/* The parts of an answer to a read, as they come in. */
struct servo_reading {
	unsigned sending; /* of the exchange it is for */
	unsigned have;    /* enum servo_can_answer */
	db_time taken;    /* when the position came */
	int32_t position;
	int16_t speed;
	int16_t current;
	uint16_t bits;
	uint8_t inputs;
	uint8_t outputs;
	uint16_t analogue;
};

/* Where the motor is and what it does, of one moment. */
struct servo_sample {
	db_time taken;
	int32_t position;
	int16_t speed;   /* rpm */
	int16_t current; /* 0.1 A */
};

/* What a conversation has done so far. */
enum servo_did {
	DID_LOOK = 1u << 0,
	DID_CLEAR_SPEED = 1u << 1,
	DID_CLEAR_CURRENT = 1u << 2,
	DID_DEMAND = 1u << 3, /* the internal position is where the motor stands */
	DID_CHECK = 1u << 4,  /* the command may begin; its target is fixed */
	DID_TARGET = 1u << 5,
	DID_TRIGGER = 1u << 6,
	DID_SETPOINT = 1u << 7,
	DID_POWER = 1u << 8,
	DID_FEEDBACK = 1u << 9,
	DID_RAMPS = 1u << 10,
	DID_WORDS = 1u << 11,
	DID_MODE = 1u << 12,
	DID_WITHOUT_ANSWER = 1u << 13, /* what was said last was not acknowledged */
	DID_DROP = 1u << 14,           /* CTRG, after the power went */
	DID_BY_ALL = 1u << 15,         /* what begins the motion was said to all drives at once */
};

/* What a conversation remembers of itself. */
struct servo_progress {
	unsigned did; /* enum servo_did */
	unsigned resends;
	db_time since;  /* when the effect that is looked for could begin */
	int32_t target; /* of a position move */
	int32_t from;   /* the position when the command began ... */
	int16_t before; /* ... and speed or current */
	int16_t setpoint;
	int mode;          /* what a mode frame on the wire asks for */
	uint16_t words[2]; /* what a frame of command words on the wire says, without CTRG */
};

/* Conversations that may be under way side by side, exchange by exchange. */
enum servo_lane { LANE_STOPS, LANE_REQUESTS, LANE_POLLS, LANE_IDENTIFIES, SERVO_LANES };

struct db_device {
	/* Settings. */
	struct servo_can_layout layout;
	uint8_t node;
	bool may_change_mode;
	int fixed_mode; /* when it may not; or SERVO_MODE_NOT_KNOWN */
	bool torque_clockwise;
	bool synchronous;
	bool uses_reports;
	uint16_t enabled_bit; /* of enum servo_can_status_bit */
	double voltage_scale;
	double temperature_scale;
	double temperature_offset;
	enum servo_on_fault on_fault;
	int standstill_speed; /* rpm up to which the zero speed bit is believed */
	db_time reaction;     /* how long an effect may take to show */
	double window;        /* counts around a target that count as there */
	db_time cycle;
	struct servo_profile profile;

	/* What it says of itself. */
	bool has_sample;
	struct servo_sample sample;
	bool has_status;
	db_time status_at;
	uint16_t bits;       /* enum servo_can_status_bit */
	db_time error_since; /* when the error bit was first seen; 0: it is not set */
	uint8_t inputs;
	uint8_t outputs;
	db_time analogue_at; /* 0: not since it is online */
	uint16_t analogue;
	bool has_health;
	db_time health_at;
	uint16_t voltage;
	uint16_t temperature;
	uint16_t faults;
	struct servo_reading reading;
	struct servo_sample reported; /* halves of a report ... */
	db_time position_at;          /* ... and when they came; 0: not yet */
	db_time motion_at;

	/* What it was told. */
	int mode;                 /* enum servo_can_mode or SERVO_MODE_NOT_KNOWN */
	enum servo_level trigger; /* CTRG */
	bool going;               /* a position move is under way ... */
	int32_t seen_at;          /* ... and was last seen to get on here ... */
	db_time seen_moving;      /* ... at this time */
	bool has_target;
	int32_t target;
	/* By mode; false: another program may have left a speed or a current in the drive. */
	bool setpoint_known[SERVO_CAN_MODE_CURRENT + 1];
	int16_t setpoint; /* the last speed or current, in its mode's units; it outlives the mode */
	int setpoint_mode;
	bool staged; /* it waits for a sync frame */
	bool stopping;
	bool refused;
	bool fault_open;   /* what is to be done on a fault is not done yet */
	uint16_t words[2]; /* held in the command words, CTRG not among them ... */
	bool words_given;  /* ... since a parameter write said so */
	bool params_valid;
	struct servo_progress progress[SERVO_LANES];
	struct db_nameplate plate;
};

/* --- what the drive says (state.c) -------------------------------------------------------- */

#define SERVO_ALL_PARTS (SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_MOTION | SERVO_CAN_GIVES_STATUS)

bool servo_is_powered(const struct db_device *device);
bool servo_stands(const struct db_device *device);
/* No motion to be seen, and none under way: a blocked motor stands, too. */
bool servo_is_at_rest(const struct db_device *device);
/* As near to a position as counts as being there. */
bool servo_is_at(const struct db_device *device, int32_t position);
/* A fault was reported, or the status shows an error that no report has explained yet. */
bool servo_has_fault(const struct db_device *device);

/* A frame of an answer to a read of `parts`. True when it was one; *complete: all are there, and are
 * taken. */
bool servo_take_part(struct db_device *device, unsigned sending, unsigned parts,
                     const struct servo_can_message *message, db_time now, bool *complete);
/* Its own reports come as often as the bridge would ask. */
bool servo_reports_come(const struct db_device *device, db_time now);
bool servo_report(struct db_device *device, const uint8_t *bytes, size_t length, db_time now);
bool servo_wants_poll(const struct db_device *device, db_time now);
void servo_gone(struct db_device *device);
void servo_feedback(const struct db_device *device, struct db_feedback *feedback);

/* --- frames to the drive (frames.c) ------------------------------------------------------- */

/* What was said last in a conversation. */
enum servo_step {
	STEP_LOOK, /* a read of all parts, or of the status */
	STEP_ANALOGUE,
	STEP_MODE, /* mode and maximum speed */
	STEP_CLEAR_SPEED,
	STEP_CLEAR_CURRENT,
	STEP_SETPOINT,
	STEP_DEMAND, /* the internal position; nothing is to move */
	STEP_TARGET, /* likewise, for the rise of CTRG that follows */
	STEP_TRIGGER_DOWN,
	STEP_TRIGGER_UP,
	STEP_WORDS,
	STEP_POWER,
	STEP_FEEDBACK,
	STEP_SYNC,
	STEP_RAMPS,
};

/* A conversation at the moment when its next frame is to be chosen. */
struct servo_talk {
	struct db_device *device;
	struct db_job *job;
	struct servo_progress *progress;
	db_time now;
	struct db_exchange *exchange;
	enum db_result *result;
};

static inline bool servo_did(const struct servo_talk *talk, unsigned what)
{
	return (talk->progress->did & what) != 0;
}

enum db_step servo_done(const struct servo_talk *talk, enum db_result result);

unsigned servo_count_bits(unsigned bits);
/* `parts` must be a set that a selector has. */
enum db_step servo_read(const struct servo_talk *talk, enum servo_step step, unsigned parts);
enum db_step servo_look(const struct servo_talk *talk);
/* With the profile's maximum speed, if the drive does not have it yet, or another one. */
enum db_step servo_say_mode(const struct servo_talk *talk, enum servo_can_mode mode,
                            const uint16_t *max_speed);
/* A speed 0 or current 0 for whatever mode the drive is in. */
enum db_step servo_say_clear(const struct servo_talk *talk, enum servo_can_kind kind);
/* In the units of the drive's mode. */
enum db_step servo_say_setpoint(const struct servo_talk *talk, int16_t setpoint);
enum db_step servo_say_power(const struct servo_talk *talk, bool on);
/* With the words that are held. */
enum db_step servo_say_trigger(const struct servo_talk *talk, bool up);
/* CTRG stays as it is. */
enum db_step servo_say_words(const struct servo_talk *talk, const uint16_t words[2]);
/* STEP_DEMAND and STEP_TARGET: the internal position; STEP_FEEDBACK: the position itself. */
enum db_step servo_say_position(const struct servo_talk *talk, enum servo_step step,
                                int32_t position);
enum db_step servo_say_sync(const struct servo_talk *talk);
enum db_step servo_say_ramps(const struct servo_talk *talk, uint32_t acceleration,
                             uint32_t deceleration);

/* The frame on the wire was acknowledged: what the drive has now, and what was done. */
void servo_note_acknowledged(const struct servo_talk *talk);
/* The frame on the wire counts as said, though the drive does not have it. */
void servo_pass_over(const struct servo_talk *talk);

/* --- what to say next ------------------------------------------------------------------------------ */

/* Each says the next frame of its conversation, or ends it. */
enum db_step servo_next_of_command(const struct servo_talk *talk);
enum db_step servo_next_of_poll(const struct servo_talk *talk);
enum db_step servo_next_of_settings(const struct servo_talk *talk);
enum db_step servo_next_of_identify(const struct servo_talk *talk);

/* A command's frame was acknowledged with another frame's code, or not answered. */
enum db_step servo_command_refused(const struct servo_talk *talk);
enum db_step servo_command_lost(const struct servo_talk *talk);
/* Likewise for settings: what the drive has is not known any more. */
void servo_forget_settings(struct db_device *device, const struct db_request *request);

/* What of the profile the drive does not have and may be given now. False: nothing. */
bool servo_says_profile(const struct servo_talk *talk, enum db_step *step);
void servo_remember(struct db_device *device, enum servo_param param, double value);
/* The held words as parameters. */
void servo_remember_words(struct db_device *device);

#endif
