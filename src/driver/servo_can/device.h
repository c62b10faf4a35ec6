/* SPDX-License-Identifier: Apache-2.0 */
/* A servo drive as the driver knows it: its settings, what it said of itself, and what it was told.
 * Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_SERVO_CAN_DEVICE_H
#define DRIVEBRIDGE_DRIVER_SERVO_CAN_DEVICE_H

#include "codec/servo_can.h"
#include "drivebridge/driver.h"

#define SERVO_CAN_MODE_NOT_KNOWN (-1) /* beside enum servo_can_mode */
#define SERVO_CAN_CURRENT_STEPS 10.0f /* of an ampere */

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

/* What a drive is to have each time it comes back. NAN and SERVO_CAN_MODE_NOT_KNOWN: nothing. */
struct servo_can_profile {
	int mode;
	double max_speed;    /* rpm */
	double acceleration; /* rpm/s, both or none */
	double deceleration;
};

enum servo_can_level { LEVEL_NOT_KNOWN, LEVEL_LOW, LEVEL_HIGH };

/* The parts of an answer to a read, as they come in. */
struct servo_can_reading {
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
struct servo_can_sample {
	db_time taken;
	int32_t position;
	int16_t speed;   /* rpm */
	int16_t current; /* 0.1 A */
};

/* What a conversation remembers of itself. */
struct servo_can_progress {
	unsigned done;   /* bit of each enum servo_can_step that was taken, or passed over */
	bool checked;    /* it may begin; its target is fixed */
	bool unanswered; /* what was said last was not acknowledged */
	bool strange;    /* something else was acknowledged instead */
	bool dropped;    /* CTRG, after the power went or behind a demand */
	bool had_power;  /* already when it was to be enabled */
	bool has_power;  /* since it was enabled */
	bool ran_out;    /* the motor has stood since then: from there it is not to move */
	bool looked;     /* at the power, behind taking it off because of a fault */
	bool gives_up;   /* its motion is made impossible before it is called failed */
	bool by_all;     /* what begins the motion was said to all drives at once */
	unsigned resends;
	db_time since;  /* when the effect that is looked for could begin */
	int32_t target; /* of a position move */
	int32_t from;   /* the position when the command, or the power, began ... */
	int16_t before; /* ... and speed or current */
	int16_t setpoint;
	uint16_t words[2]; /* what a frame of command words on the wire says, without CTRG */
};

/* Conversations that may be under way side by side, exchange by exchange. */
enum servo_can_lane { LANE_STOPS, LANE_REQUESTS, LANE_POLLS, LANE_IDENTIFIES, SERVO_CAN_LANES };

struct db_device {
	/* Settings. */
	struct servo_can_layout layout;
	uint8_t node;
	bool may_change_mode;
	int fixed_mode; /* when it may not; or SERVO_CAN_MODE_NOT_KNOWN */
	bool torque_clockwise;
	bool synchronous;
	bool uses_reports;
	bool error_is_fault;    /* the error bit alone, whatever reports say */
	bool speed_is_unsigned; /* status bits tell its sign */
	uint16_t enabled_bit;   /* of enum servo_can_status_bit */
	double voltage_scale;
	double temperature_scale;
	double temperature_offset;
	enum servo_can_on_fault on_fault;
	int standstill_speed; /* rpm up to which the zero speed bit is believed */
	db_time reaction;     /* how long an effect may take to show */
	double window;        /* counts around a target that count as there */
	bool follows_late;    /* a move that begins when nobody expects it any more */
	double power_window;  /* counts that the motor may move when it gets its power */
	db_time cycle;
	struct servo_can_profile profile;

	/* What it says of itself. */
	bool has_sample;
	struct servo_can_sample sample;
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
	struct servo_can_reading reading;
	struct servo_can_sample reported; /* halves of a report ... */
	db_time position_at;              /* ... and when they came; 0: not yet */
	db_time motion_at;

	/* What it was told. */
	int mode;                     /* enum servo_can_mode or SERVO_CAN_MODE_NOT_KNOWN */
	enum servo_can_level trigger; /* CTRG */
	bool going;                   /* a position move is under way ... */
	int32_t seen_at;              /* ... and was last seen to get on here ... */
	db_time seen_moving;          /* ... at this time */
	bool unshown; /* CTRG rose, or the power came, and the motor stands: it still may begin */
	bool has_target;
	int32_t target;
	/* By mode; false: another program may have left a speed or a current in the drive. */
	bool setpoint_known[SERVO_CAN_MODE_CURRENT + 1];
	int16_t setpoint; /* the last speed or current, in its mode's units; it outlives the mode */
	int setpoint_mode;
	bool staged; /* it waits for a sync frame */
	bool stopping;
	bool power_taken;  /* by the bridge, since it last came: the drive is not to be suspected */
	bool lost_power;   /* unasked: what it was told before is not to be relied on */
	bool stop_refused; /* something else than speed or current 0 was acknowledged */
	bool refused;
	bool fault_open;   /* what is to be done on a fault is not done yet */
	uint16_t words[2]; /* held in the command words, CTRG not among them ... */
	bool words_given;  /* ... since a parameter write said so */
	bool params_valid;
	struct servo_can_progress progress[SERVO_CAN_LANES];
	struct db_nameplate plate;
};

#endif
