/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The axis: one drive as the PLC sees it. The bus thread publishes, every other thread reads
 * copies; a copy is always from one moment (seqlock), never torn.
 */
#ifndef DRIVEBRIDGE_AXIS_H
#define DRIVEBRIDGE_AXIS_H

#include "drivebridge/time.h"
#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* PLCopen's states, plus Offline as 0 so that an empty register image is no good state. */
enum db_axis_state {
	DB_AXIS_OFFLINE = 0,
	DB_AXIS_DISABLED = 1,
	DB_AXIS_STANDSTILL = 2,
	DB_AXIS_DISCRETE_MOTION = 3,
	DB_AXIS_CONTINUOUS_MOTION = 4,
	DB_AXIS_HOMING = 5,
	DB_AXIS_STOPPING = 6,
	DB_AXIS_ERROR_STOP = 7,
	DB_AXIS_STATE_COUNT
};
const char *db_axis_state_name(enum db_axis_state state); /* "Standstill" ... */

/* Bits of the `status` register. Set by the bus side unless marked (net). */
enum db_status_bit {
	DB_STATUS_ONLINE = 1u << 0,
	DB_STATUS_ENABLED = 1u << 1,
	DB_STATUS_HOMED = 1u << 2,
	DB_STATUS_MOVING = 1u << 3,
	DB_STATUS_AT_TARGET = 1u << 4, /* standing at the target of the last position move */
	DB_STATUS_HOMING = 1u << 5,
	DB_STATUS_STOPPING = 1u << 6,
	DB_STATUS_ERROR = 1u << 7,
	DB_STATUS_WARNING = 1u << 8,
	DB_STATUS_BUSY = 1u << 9,     /* (net) a command is pending */
	DB_STATUS_LATCHED = 1u << 10, /* (net) client loss latched */
	DB_STATUS_ORIGIN_LOST =
		1u
		<< 11, /* position was reset by the drive since the last homing or set_position */
	DB_STATUS_PARAMS_VALID =
		1u << 12, /* identity and parameters were read since the drive came online */
	DB_STATUS_BUS_UP = 1u << 13,  /* the port or interface is open */
	DB_STATUS_REFUSED = 1u << 14, /* the drive refused its last command (cmd_wrg) */
	DB_STATUS_DONE = 1u << 15,    /* (net) the last motion command came to its end */
	DB_STATUS_ABORTED = 1u << 16, /* (net) the motion before the last command did not */
	/* the drive holds parameters that it would lose without power, as far as the bridge knows */
	DB_STATUS_PARAMS_UNSAVED = 1u << 17,
	/* a stop was asked for, and the drive was not seen to stand since; also while it is offline */
	DB_STATUS_MUST_STAND = 1u << 18,
};
#define DB_STATUS_BIT_COUNT 19
const char *db_status_bit_name(unsigned bit); /* 0 = "online" ...; "unknown" */

/* Values of the `error` register: 0 none, then the bridge's own causes, then the drives' faults. */
enum db_error {
	DB_ERROR_NONE = 0,
	DB_ERROR_NO_ANSWER = 1,   /* the drive does not answer */
	DB_ERROR_BUS_DOWN = 2,    /* the port or interface is missing */
	DB_ERROR_CLIENT_LOSS = 3, /* the watchdog stopped the drive */
	DB_ERROR_RUNS_ON = 4,     /* it was told to stop, and does not slow down */
	DB_ERROR_HARDWARE = 16,   /* drive: hardware fault */
	DB_ERROR_FLASH = 17,      /* drive: parameter memory */
	DB_ERROR_ENCODER = 18,    /* drive: encoder or stalled motor */
	DB_ERROR_OVER_TEMPERATURE = 19,
	DB_ERROR_OVER_CURRENT = 20,
	DB_ERROR_VOLTAGE = 21,
	DB_ERROR_INTERRUPTED = 22,       /* drive: its program was ended by an emergency stop */
	DB_ERROR_UNEXPLAINED_FAULT = 23, /* drive: a fault whose reason it has not told yet */
	DB_ERROR_DRIVE_FAULT = 32,       /* plus a bit 0..15 of a servo drive's fault word */
};
const char *db_error_name(uint16_t error); /* "none", "no_answer" ...; "unknown" */

/* What families can measure beside position, velocity and drive_status: which fields below hold. */
enum db_measure {
	DB_MEASURE_INPUTS = 1u << 0,
	DB_MEASURE_OUTPUTS = 1u << 1,
	DB_MEASURE_PROGRAM = 1u << 2,
	DB_MEASURE_CURRENT = 1u << 3,
	DB_MEASURE_FAULT_BITS = 1u << 4,
	DB_MEASURE_SUPPLY_VOLTAGE = 1u << 5,
	DB_MEASURE_TEMPERATURE = 1u << 6,
	DB_MEASURE_ANALOGUE = 1u << 7,
	DB_MEASURE_RAW_HEALTH = 1u << 8, /* voltage and temperature before scaling */
	DB_MEASURE_RAW_ANSWER = 1u << 9,
};

/* One moment of a drive, as its driver understood it. */
/* Why the position may be counted from elsewhere than before, until that is confirmed or refuted. */
enum db_doubt {
	DB_DOUBT_NONE,
	DB_DOUBT_SILENT, /* it did not answer for a while */
	DB_DOUBT_SIGN,   /* its status has one sign of a restart */
};

struct db_feedback {
	db_time taken;          /* when the answer was complete; 0 = never */
	uint64_t taken_wall_us; /* the same in microseconds since 1970 */
	int32_t position;       /* drive units */
	float velocity;         /* drive units per second */
	bool has_target;        /* `target` holds where the last position move goes */
	int32_t target;
	uint32_t drive_status; /* the vendor's own word */
	uint32_t fault_bits;
	uint16_t inputs;
	uint16_t outputs;
	uint16_t program;
	uint16_t program_state;
	uint16_t program_step;
	float counts_per_unit; /* what the drive itself knows of its mechanics; 0 = nothing */
	float deceleration; /* of a stop, drive units/s^2; INFINITY: at once; 0: not known, or it is the
	                       driver's deceleration_param */
	float current;
	float supply_voltage;
	float temperature;
	uint16_t analogue_1;
	uint16_t supply_voltage_raw;
	uint16_t temperature_raw;
	uint16_t error;  /* enum db_error, drive's part */
	uint16_t state;  /* enum db_axis_state */
	uint32_t status; /* enum db_status_bit */
	/* Since the bridge started: times that the drive was found to have been without power, and times that only
	 * one sign of that came. */
	uint32_t restarts;
	uint32_t doubts;
	uint8_t doubt; /* enum db_doubt: of the last of these */
};

/* Counters since the bridge started; round trips in microseconds from first byte out to last byte
 * in. */
struct db_axis_stats {
	uint32_t requests;
	uint32_t answers;
	uint32_t timeouts;
	uint32_t retries;
	uint32_t bad_frames;
	uint32_t refusals;
	uint32_t doubled_answers; /* second answers to one question, with another content */
	uint32_t came_online;
	uint32_t samples; /* of its process data: times that feedback.taken changed */
	uint32_t round_trip_us;
	uint32_t round_trip_min_us;
	uint32_t round_trip_max_us;
	uint32_t round_trip_mean_us;
};

/* What the drive must stand for, by what the bus knows. */
struct db_must_stand {
	uint8_t cause;   /* enum db_stand_cause of the latest; FREE: it need not stand */
	uint8_t command; /* enum db_command: the strongest stop that was asked for */
	bool seen; /* it was read after the last one and stood; a drive that moved is read once more */
	uint32_t count; /* stops that were sent since then */
	db_time since;  /* the first cause */
};

/* What the bus knows to be wrong with it: a part of what drivebridge/trouble.h judges. */
struct db_trouble {
	uint16_t cause; /* enum db_trouble_cause */
	uint16_t
		late_ms; /* how late its last answer was that came after it was given up; 0: none was */
	db_time since;
	db_time uncertain_until; /* two drives answer in its place: nobody knows whose data these are */
};

struct db_snapshot {
	struct db_feedback feedback;
	struct db_axis_stats stats;
	struct db_must_stand must_stand;
	struct db_trouble trouble;
};

#define DB_PARAMS_MAX 64
#define DB_IDENTITY_MAX 40

/* Changes rarely: identity and parameters. */
#define DB_RAW_ANSWER_WORDS 10

struct db_nameplate {
	uint64_t valid;   /* bit i: values[i] was read from the drive */
	uint64_t missing; /* bit i: it was asked for values[i] and did not tell it; see the log */
	union db_value values[DB_PARAMS_MAX];
	char identity[DB_IDENTITY_MAX]; /* not terminated when full; "" = not read */
	/* What answered the last raw frame, as DB_CMD_RAW_FRAME has it; length 0: nothing did. */
	uint16_t raw_length;
	uint16_t raw_answer[DB_RAW_ANSWER_WORDS];
	uint32_t generation; /* grows with each change */
	bool doubtful;       /* some value may have changed: to be read again */
};

struct db_axis;

/* Null when out of memory. Starts offline with everything zero. */
struct db_axis *db_axis_new(void);
void db_axis_free(struct db_axis *axis);

/* Bus thread only. */
void db_axis_publish(struct db_axis *axis, const struct db_snapshot *snapshot);
void db_axis_publish_nameplate(struct db_axis *axis, const struct db_nameplate *nameplate);

/* Any thread; waits out a publication in progress (nanoseconds). */
void db_axis_read(const struct db_axis *axis, struct db_snapshot *snapshot);
void db_axis_read_nameplate(const struct db_axis *axis, struct db_nameplate *nameplate);

#endif
