/* SPDX-License-Identifier: Apache-2.0 */
/* The driver's state of a servo drive: its settings, what it has reported, and what it was sent.
 * Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_PRIVATE_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_PRIVATE_H

#include "codec/servo_can.h"
#include "drivebridge/driver.h"
#include "driver/restart.h"

#define SERVO_CAN_MODE_NOT_KNOWN (-1) /* in addition to enum servo_can_mode */

/* The drive has no way to read these: they are known once the bridge has written them. */
enum servo_can_param {
	PARAM_ACCELERATION,
	PARAM_DECELERATION,
	PARAM_MAX_SPEED,
	PARAM_CCLR, /* bits of command word 0, in the order of word_bits in settings.c */
	PARAM_ZCLAMP,
	PARAM_TRQLM,
	PARAM_SPDLM,
	PARAM_POS0,
	PARAM_POS1,
	PARAM_POS2,
	PARAM_WORD_1,
	SERVO_CAN_PARAM_COUNT
};

#define PARAM_BIT(param) (UINT64_C(1) << (param))
#define RAMPS (PARAM_BIT(PARAM_ACCELERATION) | PARAM_BIT(PARAM_DECELERATION))
#define WORDS (PARAM_BIT(SERVO_CAN_PARAM_COUNT) - PARAM_BIT(PARAM_CCLR))

enum servo_can_on_fault {
	SERVO_CAN_ON_FAULT_NONE,
	SERVO_CAN_ON_FAULT_STOP,
	SERVO_CAN_ON_FAULT_DISABLE
};

/* Values that a drive is given each time it comes back. NAN and SERVO_CAN_MODE_NOT_KNOWN: none. */
struct servo_can_profile {
	int mode;
	double max_speed;    /* rpm */
	double acceleration; /* rpm/s, both or none */
	double deceleration;
};

enum servo_can_level { LEVEL_NOT_KNOWN, LEVEL_LOW, LEVEL_HIGH };

/* The parts of an answer to a read, as they arrive. */
struct servo_can_reading {
	unsigned sending; /* number of the exchange it belongs to */
	unsigned have;    /* enum servo_can_answer */
	db_time taken;    /* when the position arrived */
	int32_t position;
	int16_t speed;
	int16_t current;
	uint16_t bits;
	uint8_t inputs;
	uint8_t outputs;
	uint16_t analogue;
};

/* Position and motion of the motor at one moment. */
struct servo_can_sample {
	db_time taken;
	int32_t position;
	int16_t speed;   /* steps of the speed_scale */
	int16_t current; /* steps of the current_scale */
};

/* The state of a conversation. */
struct servo_can_progress {
	unsigned done;   /* one bit per enum servo_can_step that was acknowledged or skipped */
	bool checked;    /* the motion may begin; its target is fixed */
	bool unanswered; /* the last frame was not acknowledged */
	bool strange;    /* another frame was acknowledged instead */
	bool dropped;    /* CTRG was reset, after the power was switched off or after a demand */
	bool had_power;  /* power was on already when it was to be enabled */
	bool has_power;  /* power is on since it was enabled */
	bool ran_out;    /* the motor has stood since then: from then on it must not move */
	bool power_read; /* the power was read after switching it off because of a fault */
	bool gives_up;   /* its motion is made impossible before it is reported as failed */
	bool by_all;     /* the frame that begins the motion was sent to all drives at once */
	unsigned resends;
	db_time since;  /* when the expected effect could begin */
	int32_t target; /* target of a position move */
	int32_t from;   /* the position when the command, or the power, began ... */
	int16_t before; /* ... and speed or current */
	int16_t setpoint;
	uint16_t words[2]; /* content of a frame of command words on the wire, without CTRG */
};

/* Conversations that may be in progress at the same time, exchange by exchange. */
enum servo_can_lane { LANE_STOPS, LANE_REQUESTS, LANE_POLLS, LANE_IDENTIFIES, SERVO_CAN_LANES };

struct servo_can_bus_options;
struct servo_can_drive_options;

struct db_device {
	/* Settings: those of the configuration, and what follows from them. */
	const struct servo_can_drive_options *options;
	const struct servo_can_bus_options *bus_options;
	struct servo_can_layout layout;
	uint8_t node;
	bool may_change_mode;
	int fixed_mode; /* the mode when it may not be changed; or SERVO_CAN_MODE_NOT_KNOWN */
	bool torque_clockwise;
	bool synchronous;
	bool uses_reports;
	bool error_is_fault;    /* only the error bit counts, whatever reports show */
	bool speed_is_unsigned; /* status bits show its sign */
	/* Bits of the status word, as masks; 0: the drive has none. */
	uint16_t enabled_bit;
	uint16_t fault_bit;
	uint16_t standstill_bit;
	uint16_t moving_bit;
	uint16_t target_bit;
	uint16_t homed_bit;
	uint16_t warning_bits; /* each of them is a warning */
	uint16_t reverse_bit;
	uint16_t forward_bit;
	uint16_t status_inverted; /* bits that are active when they are 0 */
	/* The size of a step: in reports of the drive, and in commands. Signs of reports are
	 * applied to each sample, those of commands are in the scales. */
	bool position_reversed;
	bool speed_reversed;
	bool current_reversed;
	bool move_is_relative;
	double speed_scale;           /* rpm, above 0 */
	double speed_command_scale;   /* rpm */
	double current_scale;         /* A, above 0 */
	double current_command_scale; /* A */
	int standstill_speed; /* number of steps up to which the zero speed bit is believed */
	db_time reaction;     /* how long an effect may take to show */
	double window;        /* counts around a target that count as reached */
	bool follows_late;    /* watch for a move that begins unexpectedly */
	double power_window;  /* counts that the motor may move when it gets power */
	db_time cycle;
	struct servo_can_profile profile;

	/* Reported by the drive. */
	bool has_sample;
	struct servo_can_sample sample;
	bool has_status;
	db_time status_at;
	uint16_t bits;       /* as the drive sends them */
	db_time error_since; /* when the error bit was first seen; 0: it is not set */
	uint8_t inputs;
	uint8_t outputs;
	db_time analogue_at; /* 0: not received since it is online */
	uint16_t analogue;
	struct restart restart;
	bool power_fell; /* power lost unasked, since the last sample */
	bool has_health;
	db_time health_at;
	uint16_t voltage;
	uint16_t temperature;
	uint16_t faults;
	struct servo_can_reading reading;
	struct servo_can_sample reported; /* the halves of a report ... */
	db_time position_at;              /* ... and when they came; 0: not yet */
	db_time motion_at;

	/* Sent to the drive. */
	int mode;                     /* enum servo_can_mode or SERVO_CAN_MODE_NOT_KNOWN */
	enum servo_can_level trigger; /* CTRG ... */
	db_time drop_at;              /* ... which a poll resets from then on; 0: at once */
	bool going;                   /* a position move is in progress ... */
	int32_t seen_at;              /* ... and was last seen progressing here ... */
	db_time seen_moving;          /* ... at this time */
	/* CTRG rose, or the power was switched on, and the motor stands: a motion may still
	 * begin */
	bool may_begin;
	bool has_target;
	int32_t target;
	/* By mode; false: another program may have left a speed or a current in the drive. */
	bool setpoint_known[SERVO_CAN_MODE_CURRENT + 1];
	/* the last speed or current, in steps of its mode; kept when the mode changes */
	int16_t setpoint;
	int setpoint_mode;
	bool staged; /* the setpoint waits for a sync frame */
	bool stopping;
	/* power switched off by the bridge since it was last on: no sign of a reset */
	bool power_taken;
	bool lost_power;   /* power lost unasked: what was sent before is not to be relied on */
	bool stop_refused; /* a frame other than speed or current 0 was acknowledged */
	bool refused;
	bool fault_open;   /* the reaction to a fault is not complete */
	uint16_t words[2]; /* content of the command words, without CTRG ... */
	bool words_given;  /* ... set by a parameter write */
	bool params_valid;
	struct servo_can_progress progress[SERVO_CAN_LANES];
	struct db_nameplate plate;
	DB_NAMEPLATE_ROOM(SERVO_CAN_PARAM_COUNT) plate_room;
};

/* --- state.c ---------------------------------------------------------------------------------- */

/* Frames from the drive: answers to reads, its own reports, and the feedback made of them. */

#define SERVO_CAN_ALL_PARTS \
	(SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_MOTION | SERVO_CAN_GIVES_STATUS)

bool servo_can_is_powered(const struct db_device *device);
bool servo_can_stands(const struct db_device *device);
/* True if no motion is seen, and none is in progress: a blocked motor stands, too. */
bool servo_can_is_at_rest(const struct db_device *device);
/* True if it carries out a speed or current at once. */
bool servo_can_obeys_setpoint(const struct db_device *device);
/* True if speed or current 0 stops the motor; otherwise only switching its power off does. */
bool servo_can_stops_by_setpoint(const struct db_device *device);
/* True if it is near enough to a position to count as there. */
bool servo_can_is_at(const struct db_device *device, int32_t position);
/* Converts a position of the drive to the bridge's counts, and back. */
int32_t servo_can_turn_position(const struct db_device *device, int32_t position);
/* True if a fault was reported, or the status shows one. */
bool servo_can_has_fault(const struct db_device *device);
/* True if the status itself shows a fault: reports are older. */
bool servo_can_shows_fault(const struct db_device *device);

/* True if it was not sent the profile's maximum speed since it is back. */
bool servo_can_lacks_max_speed(const struct db_device *device);

/* Takes a frame of an answer to a read of `parts`. True when it was one; *complete: all parts have
 * arrived and were taken. */
bool servo_can_take_part(struct db_device *device, unsigned sending, unsigned parts,
                         const struct servo_can_message *message, db_time now, bool *complete);
/* True if its own reports arrive as often as the bridge would ask. */
bool servo_can_reports_often(const struct db_device *device, db_time now);
bool servo_can_take_report(struct db_device *device, const uint8_t *bytes, size_t length,
                           db_time now);
bool servo_can_wants_poll(const struct db_device *device, db_time now);
/* Its power was lost unasked: it may have been reset, so earlier settings are not relied on any
 * more. */
void servo_can_take_reset(struct db_device *device);
void servo_can_forget_state(struct db_device *device);
void servo_can_write_feedback(const struct db_device *device, struct db_feedback *feedback);

/* --- settings.c ------------------------------------------------------------------------------- */

/* Parameters, and the profile of the configuration. Internal to the driver; bus thread only,
 * except servo_can_check_param(), which is pure. */

extern const struct db_param servo_can_params[SERVO_CAN_PARAM_COUNT];

enum db_result servo_can_check_param(const struct db_bus_config *bus, size_t param,
                                     union db_value value);

/* The drive has this value now. */
void servo_can_remember(struct db_device *device, enum servo_can_param param, double value,
                        db_time now);
/* Shows the held words as parameters. */
void servo_can_remember_words(struct db_device *device, db_time now);
/* The drive's values of these are no longer known. */
void servo_can_forget_settings(struct db_device *device, const struct db_request *request);

/* Each sends the next frame of its conversation, or ends it. */
enum db_step servo_can_continue_settings(struct db_conversation *talk);
enum db_step servo_can_continue_identify(struct db_conversation *talk);

/* Called before its motor gets power: sends all values, also those that it should have already,
 * because it may have been reset since. False: all were sent. */
bool servo_can_sends_all(struct db_conversation *talk, enum db_step *step);

/* --- commands.c ------------------------------------------------------------------------------- */

/* Commands and the reaction to a fault: chooses the next frame. */

/* Each sends the next frame of its conversation, or ends it. */
enum db_step servo_can_continue_command(struct db_conversation *talk);
enum db_step servo_can_continue_poll(struct db_conversation *talk);

/* --- steps.c ---------------------------------------------------------------------------------- */

/* The steps of all conversations with a servo drive: the part of the descriptor that communicates.
 */

/* As in struct db_driver. */
enum db_step servo_can_begin(struct db_conversation *talk);
enum db_step servo_can_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length);
enum db_step servo_can_lose_answer(struct db_conversation *talk);
enum db_step servo_can_begun_by_all(struct db_conversation *talk);

#endif
