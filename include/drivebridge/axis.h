/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The axis: one drive as the PLC sees it. The bus thread publishes, every other thread reads
 * copies; a copy is always of one moment (seqlock), never torn.
 */
#ifndef DRIVEBRIDGE_AXIS_H
#define DRIVEBRIDGE_AXIS_H

#include "drivebridge/time.h"
#include "drivebridge/value.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* PLCopen's states, and Offline as 0 so that an empty register image is no good state. */
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
	DB_STATUS_DONE = 1u << 15,    /* (net) the last motion command reached its end */
	/* (net) the motion before the last command did not reach its end */
	DB_STATUS_ABORTED = 1u << 16,
	/* the drive has parameters that it would lose without power, as far as the bridge knows */
	DB_STATUS_PARAMS_UNSAVED = 1u << 17,
	/* a stop was requested, and the drive was not seen standing since; also while it is
	 * offline */
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
	DB_ERROR_RUNS_ON = 4,     /* the drive was told to stop, and does not slow down */
	DB_ERROR_HARDWARE = 16,   /* drive: hardware fault */
	DB_ERROR_FLASH = 17,      /* drive: parameter memory */
	DB_ERROR_ENCODER = 18,    /* drive: encoder or stalled motor */
	DB_ERROR_OVER_TEMPERATURE = 19,
	DB_ERROR_OVER_CURRENT = 20,
	DB_ERROR_VOLTAGE = 21,
	DB_ERROR_INTERRUPTED = 22,       /* drive: its program was ended by an emergency stop */
	DB_ERROR_UNEXPLAINED_FAULT = 23, /* drive: a fault whose reason it has not reported yet */
	/* from here on each family has faults of its own: see struct db_drive_fault (value.h) */
	DB_ERROR_DRIVE_FAULT = DB_FAMILY_FAULT,
};

struct db_driver;

/* "none", "no_answer" ...; "unknown". Without a driver (null) the faults of families are unknown. */
const char *db_error_name(const struct db_driver *driver, uint16_t error);

#define DB_ERROR_TEXT_MAX 48

/* The same for people: a fault without a name is shown as its code. */
const char *db_error_text(const struct db_driver *driver, uint16_t error,
                          char text[DB_ERROR_TEXT_MAX]);

/* What families can measure in addition to position, velocity and drive_status: which fields below
 * are valid. */
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
	DB_MEASURE_VELOCITY = 1u << 10, /* the drive tells it; else it is computed from positions */
};

/* The state of a drive at one moment, as its driver understood it. */
/* Why the origin of the position may have changed, until that is confirmed or refuted. */
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
	/* The velocity is computed from two positions, whose times are those of the answers. */
	bool velocity_is_computed;
	/* `target` is the target of the last position move, and the position alone shows whether
	 * the move is done. False: DB_STATUS_AT_TARGET shows it. */
	bool has_target;
	bool staged; /* its motion begins with a common start */
	int32_t target;
	uint32_t drive_status; /* the vendor's status word */
	uint32_t fault_bits;
	uint16_t inputs;
	uint16_t outputs;
	uint16_t program;
	uint16_t program_state;
	uint16_t program_step;
	float counts_per_unit; /* what the drive reports of its mechanics; 0: nothing */
	/* of a stop, drive units/s^2; INFINITY: at once; 0: not known, or it is the driver's
	 * deceleration_param */
	float deceleration;
	float current;
	float supply_voltage;
	float temperature;
	uint16_t analogue_1;
	uint16_t supply_voltage_raw;
	uint16_t temperature_raw;
	uint16_t error;  /* enum db_error, drive's part */
	uint16_t state;  /* enum db_axis_state */
	uint32_t status; /* enum db_status_bit */
	/* Since the bridge started: how often the drive was found to have been without power, and
	 * how often only one sign of that was seen. */
	uint32_t restarts;
	uint32_t doubts;
	uint8_t doubt; /* enum db_doubt: the kind of the last of these */
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
	uint32_t doubled_answers; /* second answers to one question, with different content */
	uint32_t came_online;
	uint32_t samples; /* new process data: how often feedback.taken changed */
	/* interval at which it is read, with the drives that move on its bus now */
	uint32_t poll_interval_us;
	uint32_t round_trip_us;
	uint32_t round_trip_min_us;
	uint32_t round_trip_max_us;
	uint32_t round_trip_mean_us;
	/* for means over a span of time: their number and their sum, both modulo 2^32 */
	uint32_t round_trips;
	uint32_t round_trip_sum_us;
};

/* Why the drive must stand, as far as the bus knows. */
struct db_must_stand {
	uint8_t cause;   /* enum db_stand_cause of the latest cause; FREE: it need not stand */
	uint8_t command; /* enum db_command: the strongest stop requested */
	/* the drive was read after the last stop and stood; a drive that moved is read once more */
	bool seen;
	uint32_t count; /* stops sent since then */
	db_time since;  /* when the first cause began */
};

/* What is wrong with the drive as far as the bus knows: a part of what drivebridge/trouble.h
 * judges. */
struct db_trouble {
	uint16_t cause;   /* enum db_trouble_cause */
	uint16_t late_ms; /* how late its last answer was after its time-out; 0: none was */
	db_time since;
	/* two drives answer at its address: it is not known which one these data are from */
	db_time uncertain_until;
};

/* What was learnt of the times that a drive needs; 0: they are as configured. */
struct db_learnt {
	uint16_t gap_us;     /* silence after its reply; at most 65535 */
	uint16_t latency_ms; /* time-out of its answers */
};

struct db_snapshot {
	struct db_feedback feedback;
	struct db_axis_stats stats;
	struct db_must_stand must_stand;
	struct db_trouble trouble;
	struct db_learnt learnt;
};

#define DB_PARAMS_MAX 1000 /* parameters of a family */
#define DB_IDENTITY_MAX 40
#define DB_RAW_ANSWER_WORDS 10

/*
 * Sets of a family's parameters: bit i % 64 of word i / 64. A driver with up to 64 parameters may
 * use its only word as a mask.
 */
#define DB_PARAM_WORDS(count) (((count) + 63) / 64)

static inline bool db_params_have(const uint64_t *set, size_t param)
{
	return set[param / 64] >> param % 64 & 1;
}

static inline void db_params_add(uint64_t *set, size_t param)
{
	set[param / 64] |= UINT64_C(1) << param % 64;
}

/*
 * Changes rarely: identity and parameters. Of these there are as many as the family has: they are
 * in the room of the nameplate's owner (DB_NAMEPLATE_ROOM, DB_NAMEPLATE_INIT), so a nameplate must
 * not be assigned to another one.
 */
struct db_nameplate {
	uint32_t tellings;              /* incremented whenever one of `told` changes */
	char identity[DB_IDENTITY_MAX]; /* not terminated when full; "" = not read */
	/* The answer to the last raw frame, see DB_CMD_RAW_FRAME; length 0: none. */
	uint16_t raw_length;
	uint16_t raw_answer[DB_RAW_ANSWER_WORDS];
	uint32_t generation; /* incremented with each change */
	bool doubtful;       /* some value may have changed and is to be read again */

	/* db_axis_publish_nameplate() copies what is before this member, and the room. */
	uint16_t param_count;
	uint64_t *valid;   /* set of those whose value was read from the drive */
	uint64_t *missing; /* set of those it was asked for and did not report; see the log */
	union db_value *values;
	/* When the drive last reported values[i], in the form of db_told_at(); for parameters that
	 * it never reports, when they were written. 0: never. */
	uint32_t *told;
};

/* Room for a constant number of parameters, at least 1. */
#define DB_NAMEPLATE_ROOM(count)                         \
	struct {                                         \
		uint64_t valid[DB_PARAM_WORDS(count)];   \
		uint64_t missing[DB_PARAM_WORDS(count)]; \
		union db_value values[count];            \
		uint32_t told[count];                    \
	}

/* The nameplate uses this room; both are zeroed before and stay where they are. */
#define DB_NAMEPLATE_INIT(plate, room, count)                                      \
	((plate)->param_count = (uint16_t)(count), (plate)->valid = (room)->valid, \
	 (plate)->missing = (room)->missing, (plate)->values = (room)->values,     \
	 (plate)->told = (room)->told)

/* A nameplate of any family as db_axis_read_nameplate() returns it. */
struct db_nameplate_copy {
	struct db_nameplate plate;
	DB_NAMEPLATE_ROOM(DB_PARAMS_MAX) room;
};

/*
 * Times of the monotonic clock, kept for each parameter of each drive: in 10 ms, modulo 2^32. Times
 * less than 497 days ago are exact.
 */
#define DB_TOLD_UNIT (10 * DB_NS_PER_MS)

/* Never 0. */
static inline uint32_t db_told_at(db_time now)
{
	uint32_t told = (uint32_t)((uint64_t)now / (uint64_t)DB_TOLD_UNIT);

	return told == 0 ? 1 : told;
}

/* True if it is later than that. */
static inline bool db_told_after(uint32_t told, uint32_t than)
{
	return (int32_t)(told - than) > 0;
}

/* The time by the monotonic clock; 0: never. Another thread may have set it a little after
 * `now`. */
static inline db_time db_told_time(uint32_t told, db_time now)
{
	const uint32_t ahead = DB_NS_PER_S / DB_TOLD_UNIT;
	uint32_t age = db_told_at(now) - told;

	if (told == 0)
		return 0;
	return age > UINT32_MAX - ahead ? now : now - (db_time)age * DB_TOLD_UNIT;
}

/* The drive has just reported the parameters of this set; an unchanged value is as new as a changed
 * one. */
static inline void db_nameplate_note_told(struct db_nameplate *plate, const uint64_t *params,
                                          db_time now)
{
	uint32_t told = db_told_at(now);

	for (unsigned i = 0; i < plate->param_count; i++) {
		if (db_params_have(params, i))
			plate->told[i] = told;
	}
	plate->tellings++;
}

struct db_axis;

/* Of a drive with this number of parameters. Null when out of memory. Starts offline with everything
 * zero. */
struct db_axis *db_axis_new(size_t param_count);
void db_axis_free(struct db_axis *axis);

/* Bus thread only. */
void db_axis_publish(struct db_axis *axis, const struct db_snapshot *snapshot);
/* Of as many parameters as the axis has. */
void db_axis_publish_nameplate(struct db_axis *axis, const struct db_nameplate *nameplate);

/* Any thread; waits for a publication in progress to end (nanoseconds). */
void db_axis_read(const struct db_axis *axis, struct db_snapshot *snapshot);
void db_axis_read_nameplate(const struct db_axis *axis, struct db_nameplate_copy *copy);

/* One parameter, whose index is below the family's count. False: it was not read yet, or is
 * doubtful. Any thread. */
bool db_axis_read_param(const struct db_axis *axis, size_t param, union db_value *value);

#endif
