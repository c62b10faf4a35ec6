/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Servo drives on CAN. Velocity is in rpm, position in the drive's counts, current in A.
 *
 * Pages of the vendor's document are missing, so what is not written is refused:
 * - The mode cannot be read back. It is known once the drive acknowledged it, and forgotten when
 *   the drive goes offline. It is changed only at standstill.
 * - There is no stop frame. Stopping is speed 0 in speed mode and current 0 in current mode (the
 *   motor then coasts). Anything else, a position move above all, is only stopped by taking the power
 *   off, and so is a drive in sync mode: a sync frame would start what is staged on others.
 * - A position move is one rise of CTRG, which is dropped when the target is reached. What a second
 *   rise does before that is not documented: a move on top of another is refused as busy.
 * - Setting the position feedback of a motor that is held in position would make it jump: it is
 *   refused unless the motor is without power, or stands in speed or current mode.
 * - What a drive does with an old speed or current when its motor gets power again is not
 *   documented: it is set to 0 before enabling.
 * - Faults cannot be reset. clear_fault only resets what the bridge itself has latched.
 *
 * Acknowledgements tell the node and a code, and with speed and current what is measured (not what
 * was commanded). The scheduler has one exchange with a node under way at a time.
 */
#include "codec/servo_can.h"
#include "driver/list.h"

#include <math.h>
#include <string.h>

/* What a drive usually needs before it answers; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (300 * DB_NS_PER_US)

/* How long the power stage may take to follow its acknowledged command. */
#define POWER_TIME (200 * DB_NS_PER_MS)

/* "Target reached" is first what it was before the move. When it has not been seen to fall for so
 * long, the drive was at the target all the time. */
#define SETTLE_TIME (200 * DB_NS_PER_MS)

/* Reports of position and of speed belong together when they come so close to each other. */
#define PAIR_TIME (5 * DB_NS_PER_MS)

/* Status bits and inputs do not come by themselves: how often a drive that reports is asked for them,
 * while nothing is going on. */
#define STATUS_INTERVAL (100 * DB_NS_PER_MS)
#define ANALOGUE_INTERVAL (100 * DB_NS_PER_MS)

#define RESENDS_MAX 2
#define SPEED_MAX 32767.0   /* rpm; signed 16 bits */
#define CURRENT_MAX 3276.7  /* A; as 0.1 A in signed 16 bits */
#define CURRENT_STEPS 10.0f /* of an ampere */
#define ACK_DATA 3          /* data bytes of the longest acknowledgement */
#define ANSWER_DATA 4       /* of the longest answer */
#define FRAME_OVERHEAD 8    /* as answer_length counts a frame */

/* --- settings ------------------------------------------------------------------------------------ */

enum option {
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
	OPTION_COUNT
};

/* Places of words in the list below. */
#define NO 0
#define MODE_UNKNOWN 0 /* then position, speed, current as in enum servo_can_mode, plus one */
#define CLOCKWISE 1
#define USE_REPORTS 0

#define NUMBER(low, high) .words = "", .min = (low), .max = (high), .whole = true, .unit = ""
#define SCALE .words = "", .preset = "1", .min = -1000, .max = 1000

static const struct db_option options[] = {
	[OPTION_ACK_BASE] = {
		.section = "bus",
		.name = "ack-base",
		NUMBER(0, DB_CAN_STANDARD_MASK),
		.preset = "1",
		.description = "Acknowledgements have the id of this plus the node",
	},
	[OPTION_PADDED] = {
		.section = "bus",
		.name = "padded",
		.words = "no yes",
		.preset = "no",
		.unit = "",
		.description = "Frames always have 8 data bytes, unused ones are 0",
	},
	[OPTION_WORDS_BASE] = {
		.section = "bus",
		.name = "command-word-base",
		NUMBER(1, DB_CAN_STANDARD_MASK),
		.preset = "",
		.description = "The frame with the command words, from the vendor's full manual, has "
			       "the id of this plus the node; without it position moves are refused",
	},
	[OPTION_WORDS_LENGTH] = {
		.section = "bus",
		.name = "command-word-length",
		NUMBER(2, DB_CAN_DATA_MAX),
		.preset = "",
		.description = "Data bytes of that frame",
	},
	[OPTION_WORD_0_AT] = {
		.section = "bus",
		.name = "command-word-0-at",
		NUMBER(0, DB_CAN_DATA_MAX - 2),
		.preset = "",
		.description = "First byte of command word 0 in that frame, from 0",
	},
	[OPTION_WORD_1_AT] = {
		.section = "bus",
		.name = "command-word-1-at",
		NUMBER(0, DB_CAN_DATA_MAX - 2),
		.preset = "",
		.description = "First byte of command word 1; not set: it is not in that frame",
	},
	[OPTION_WORDS_FIXED] = {
		.section = "bus",
		.name = "command-word-fixed",
		NUMBER(0, UINT32_MAX),
		.preset = "0",
		.description = "The bytes of that frame that belong to neither word, as one number, "
			       "the last byte lowest",
	},
	[OPTION_WORDS_ACK] = {
		.section = "bus",
		.name = "command-word-ack",
		NUMBER(1, UINT8_MAX),
		.preset = "",
		.description = "Code that acknowledges that frame",
	},
	[OPTION_CHANGE_MODE] = {
		.section = "drive",
		.name = "allow-mode-change",
		.words = "no yes",
		.preset = "yes",
		.unit = "",
		.description = "The bridge may select position, speed or current mode as a command "
			       "needs it, at standstill",
	},
	[OPTION_MODE] = {
		.section = "drive",
		.name = "mode",
		.words = "unknown position speed current",
		.preset = "unknown",
		.unit = "",
		.description = "The mode the drive is in when the bridge may not change it",
	},
	[OPTION_TORQUE_DIRECTION] = {
		.section = "drive",
		.name = "torque-direction",
		.words = "counterclockwise clockwise",
		.preset = "counterclockwise",
		.unit = "",
		.description = "Positive torque, seen from the end of the shaft; written with every "
			       "change of the mode",
	},
	[OPTION_SYNC] = {
		.section = "drive",
		.name = "sync",
		.words = "no yes",
		.preset = "no",
		.unit = "",
		.description = "The drive is set to sync mode: speed and current are staged until "
			       "sync_start; stop takes the power off; no position moves",
	},
	[OPTION_REPORTS] = {
		.section = "drive",
		.name = "reports",
		.words = "use ignore",
		.preset = "use",
		.unit = "",
		.description = "Position, speed and current from the drive's own reports where they "
			       "are as frequent as the cycle; faults always come from reports",
	},
	[OPTION_ENABLED_BIT] = {
		.section = "drive",
		.name = "enabled-bit",
		NUMBER(0, 15),
		.preset = "0",
		.description = "Bit of the status word that tells that the motor has power: 0 "
			       "(servo started) or 1 (servo running)",
	},
	[OPTION_VOLTAGE_SCALE] = {
		.section = "drive",
		.name = "voltage-scale",
		SCALE,
		.unit = "V",
		.description = "What one step of the reported supply voltage is",
	},
	[OPTION_TEMPERATURE_SCALE] = {
		.section = "drive",
		.name = "temperature-scale",
		SCALE,
		.unit = "degC",
		.description = "What one step of the reported temperature is",
	},
};

_Static_assert(OPTION_COUNT <= DB_OPTIONS_MAX, "a configuration has room for so many");

static bool word_is(const double *values, enum option option, int place)
{
	return (int)values[option] == place;
}

static bool is_set(const struct db_bus_config *bus, enum option option)
{
	return !isnan(bus->options[option]);
}

/* Everything about the command words but what has a default. */
static const enum option words_needed[] = { OPTION_WORDS_BASE, OPTION_WORDS_LENGTH,
	                                    OPTION_WORD_0_AT, OPTION_WORDS_ACK };
#define WORDS_NEEDED (sizeof words_needed / sizeof words_needed[0])

static size_t words_given(const struct db_bus_config *bus)
{
	size_t given = 0;

	for (size_t i = 0; i < WORDS_NEEDED; i++)
		given += is_set(bus, words_needed[i]);
	return given;
}

static bool in_word(unsigned at, unsigned byte)
{
	return byte == at || byte == at + 1;
}

static void set_words(struct servo_can_words_layout *words, const struct db_bus_config *bus)
{
	uint32_t fixed = (uint32_t)bus->options[OPTION_WORDS_FIXED];

	words->set = true;
	words->base = (uint16_t)bus->options[OPTION_WORDS_BASE];
	words->length = (uint8_t)bus->options[OPTION_WORDS_LENGTH];
	words->word0 = (uint8_t)bus->options[OPTION_WORD_0_AT];
	words->word1 = is_set(bus, OPTION_WORD_1_AT) ? (uint8_t)bus->options[OPTION_WORD_1_AT] :
	                                               SERVO_CAN_NO_WORD;
	words->ack = (uint8_t)bus->options[OPTION_WORDS_ACK];
	for (unsigned i = words->length; i-- > 0;) {
		if (in_word(words->word0, i) || in_word(words->word1, i))
			continue;
		words->fixed[i] = (uint8_t)fixed;
		fixed >>= 8;
	}
}

static struct servo_can_layout layout_of(const struct db_bus_config *bus)
{
	struct servo_can_layout layout = {
		.ack_base = (uint16_t)bus->options[OPTION_ACK_BASE],
		.padded = !word_is(bus->options, OPTION_PADDED, NO),
	};

	if (words_given(bus) == WORDS_NEEDED)
		set_words(&layout.words, bus);
	return layout;
}

/* --- parameters ---------------------------------------------------------------------------------- */

/* The drive has no way to read these: they are known once the bridge has written them. */
enum param { PARAM_ACCELERATION, PARAM_DECELERATION, PARAM_MAX_SPEED, PARAM_COUNT };

#define PARAM_BIT(param) (UINT64_C(1) << (param))
#define RAMPS (PARAM_BIT(PARAM_ACCELERATION) | PARAM_BIT(PARAM_DECELERATION))

/* The drive's ramps are whole numbers; they are floats here to be the neutral registers' type. */
static const struct db_param params[PARAM_COUNT] = {
	[PARAM_ACCELERATION] = {
		.name = "ramp_acceleration",
		.type = DB_F32,
		.unit = "rpm/s",
		.max = UINT32_MAX,
		.description = "Acceleration; write only in the drive and readable once written; "
			       "written together with ramp_deceleration the first time",
	},
	[PARAM_DECELERATION] = {
		.name = "ramp_deceleration",
		.type = DB_F32,
		.unit = "rpm/s",
		.max = UINT32_MAX,
		.description = "Deceleration; as ramp_acceleration",
	},
	[PARAM_MAX_SPEED] = {
		.name = "max_speed",
		.type = DB_U16,
		.unit = "rpm",
		.max = UINT16_MAX,
		.description = "Speed limit; write only in the drive and readable once written; goes "
			       "with the mode: only while the bridge knows that and the motor stands",
	},
};

/* --- a drive ------------------------------------------------------------------------------------- */

#define MODE_NOT_KNOWN (-1)

enum level { LEVEL_NOT_KNOWN, LEVEL_LOW, LEVEL_HIGH };

/* The parts of an answer to a read, as they come in. */
struct reading {
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
struct sample {
	db_time taken;
	int32_t position;
	int16_t speed;   /* rpm */
	int16_t current; /* 0.1 A */
};

struct db_device {
	/* Settings. */
	struct servo_can_layout layout;
	uint8_t node;
	bool may_change_mode;
	int fixed_mode; /* when it may not; or MODE_NOT_KNOWN */
	bool torque_clockwise;
	bool synchronous;
	bool uses_reports;
	uint16_t enabled_bit; /* of enum servo_can_status_bit */
	double voltage_scale;
	double temperature_scale;
	db_time cycle;

	/* What it says of itself. */
	bool has_sample;
	struct sample sample;
	bool has_status;
	db_time status_at;
	uint16_t bits; /* enum servo_can_status_bit */
	uint8_t inputs;
	uint8_t outputs;
	db_time analogue_at; /* 0: not since it is online */
	uint16_t analogue;
	bool has_health;
	uint16_t voltage;
	uint16_t temperature;
	uint16_t faults;
	struct reading reading;
	struct sample reported; /* halves of a report ... */
	db_time position_at;    /* ... and when they came; 0: not yet */
	db_time motion_at;

	/* What it was told. */
	int mode;           /* enum servo_can_mode or MODE_NOT_KNOWN */
	enum level trigger; /* CTRG */
	db_time triggered;  /* when CTRG was raised */
	bool going;         /* a position move is under way ... */
	bool left_target;   /* ... and "target reached" was seen to be 0 since it began */
	bool has_target;
	int32_t target;
	int16_t setpoint; /* the last speed or current, in its mode's units; it outlives the mode */
	int setpoint_mode;
	bool staged; /* it waits for a sync frame */
	bool stopping;
	bool refused;
	bool params_valid;
	struct db_nameplate plate;
};

static bool powered(const struct db_device *device)
{
	return device->has_status && (device->bits & device->enabled_bit) != 0;
}

static bool stands(const struct db_device *device)
{
	return (device->bits & SERVO_CAN_ST_ZERO_SPEED) != 0 || device->sample.speed == 0;
}

/* No motion to be seen, and none under way: a blocked motor stands, too. */
static bool at_rest(const struct db_device *device)
{
	return stands(device) && !device->going && !(powered(device) && device->setpoint != 0);
}

/* --- exchanges ----------------------------------------------------------------------------------- */

/* Where a conversation is: what was said last. */
enum step {
	STEP_LOOK, /* a read, before anything is said */
	STEP_MODE,
	STEP_SETPOINT,
	STEP_TRIGGER_DOWN,
	STEP_POSITION,
	STEP_TRIGGER_UP,
	STEP_POWER,
	STEP_CONFIRM, /* a read, until the power stage has followed */
	STEP_FEEDBACK,
	STEP_SYNC,
	STEP_READ_BACK, /* a read, after a lost answer */
	STEP_RAMPS,
	STEP_MAX_SPEED,
	STEP_ANALOGUE,
};

static enum db_step done(enum db_result *result, enum db_result value)
{
	*result = value;
	return DB_STEP_DONE;
}

static size_t answer_length(const struct db_device *device, unsigned frames, unsigned data)
{
	return frames * (FRAME_OVERHEAD + (device->layout.padded ? DB_CAN_DATA_MAX : data));
}

static unsigned count_bits(unsigned bits)
{
	unsigned count = 0;

	for (; bits; bits &= bits - 1)
		count++;
	return count;
}

static bool add_frame(const struct db_device *device, const struct servo_can_message *message,
                      struct db_exchange *exchange)
{
	struct db_can_frame frame;

	if (exchange->request_length + sizeof frame > exchange->request_size ||
	    servo_can_encode(message, &device->layout, &frame) != SERVO_CAN_OK)
		return false;
	memcpy(exchange->request + exchange->request_length, &frame, sizeof frame);
	exchange->request_length += sizeof frame;
	return true;
}

static enum db_step say(struct db_device *device, struct db_job *job, enum step step,
                        struct servo_can_message message, bool repeatable,
                        struct db_exchange *exchange, enum db_result *result)
{
	message.node = device->node;
	job->step = step;
	exchange->request_length = 0;
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
	exchange->answer_length = answer_length(device, 1, ACK_DATA);
	return add_frame(device, &message, exchange) ? DB_STEP_SEND :
	                                               done(result, DB_RESULT_UNSUPPORTED);
}

static enum db_step read_parts(struct db_device *device, struct db_job *job, enum step step,
                               unsigned parts, struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = SERVO_CAN_READ };
	enum db_step said;

	message.u.selector = (uint8_t)servo_can_selector(parts);
	said = say(device, job, step, message, true, exchange, result);
	exchange->answer_length = answer_length(device, count_bits(parts), ANSWER_DATA);
	return said;
}

#define ALL_PARTS (SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_MOTION | SERVO_CAN_GIVES_STATUS)

static enum db_step look(struct db_device *device, struct db_job *job, enum step step,
                         struct db_exchange *exchange, enum db_result *result)
{
	return read_parts(device, job, step, ALL_PARTS, exchange, result);
}

static enum db_step say_mode(struct db_device *device, struct db_job *job, enum servo_can_mode mode,
                             struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = SERVO_CAN_MODE };

	if (!device->may_change_mode)
		return done(result, DB_RESULT_UNSUPPORTED);
	message.u.mode.mode = mode;
	message.u.mode.torque_clockwise = device->torque_clockwise;
	/* Until it is acknowledged the drive may be in either. */
	device->mode = MODE_NOT_KNOWN;
	return say(device, job, STEP_MODE, message, true, exchange, result);
}

/* In the units of the drive's mode. */
static enum db_step say_setpoint(struct db_device *device, struct db_job *job, int16_t setpoint,
                                 struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = SERVO_CAN_SPEED };

	if (device->mode == SERVO_CAN_MODE_CURRENT) {
		message.kind = SERVO_CAN_CURRENT;
		message.u.current = setpoint;
	} else {
		message.u.speed = setpoint;
	}
	job->scratch[0] = setpoint;
	/* It may be in force even if the acknowledgement never comes. */
	if (setpoint != 0) {
		device->setpoint = setpoint;
		device->setpoint_mode = device->mode;
		device->stopping = false;
	}
	return say(device, job, STEP_SETPOINT, message, true, exchange, result);
}

static enum db_step say_power(struct db_device *device, struct db_job *job, bool on,
                              struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = SERVO_CAN_ENABLE };

	message.u.enable = on;
	return say(device, job, STEP_POWER, message, true, exchange, result);
}

/* All other bits of the words stay 0. */
static enum db_step say_trigger(struct db_device *device, struct db_job *job, bool up,
                                struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = SERVO_CAN_WORDS };

	message.u.words.word0 = up ? SERVO_CAN_CTRG : 0;
	/* Not repeated blindly: between two rises it could have been dropped. */
	return say(device, job, up ? STEP_TRIGGER_UP : STEP_TRIGGER_DOWN, message, !up, exchange,
	           result);
}

static enum db_step say_position(struct db_device *device, struct db_job *job,
                                 enum servo_can_kind kind, int32_t position,
                                 struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = kind };

	message.u.position = position;
	return say(device, job, kind == SERVO_CAN_POSITION ? STEP_POSITION : STEP_FEEDBACK, message,
	           kind == SERVO_CAN_POSITION, exchange, result);
}

/* Behind the sync frame a read: that the drive answers it shows that the frame was on the wire. */
static enum db_step say_sync(struct db_device *device, struct db_job *job,
                             struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message read = { .kind = SERVO_CAN_READ, .node = device->node };
	enum db_step said;

	read.u.selector = (uint8_t)servo_can_selector(ALL_PARTS);
	said = say(device, job, STEP_SYNC, (struct servo_can_message){ .kind = SERVO_CAN_SYNC },
	           false, exchange, result);
	if (said != DB_STEP_SEND)
		return said;
	exchange->answer_length = answer_length(device, count_bits(ALL_PARTS), ANSWER_DATA);
	return add_frame(device, &read, exchange) ? DB_STEP_SEND : done(result, DB_RESULT_FAILED);
}

/* --- which commands there are ---------------------------------------------------------------------- */

#define POSITION_MOVES (DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE) | DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE))
#define MOVES                                                    \
	(POSITION_MOVES | DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | \
	 DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT))
/* clear_fault is among them because it is also what resets a latched loss of the client. */
#define COMMANDS                                                                    \
	(MOVES | DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) |   \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |          \
	 DB_COMMAND_BIT(DB_CMD_SET_POSITION) | DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) | \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_SYNC_START))

/* The mode that a drive the bridge may not change is in; or MODE_NOT_KNOWN. */
static int fixed_mode(const struct db_drive_config *drive)
{
	if (!word_is(drive->options, OPTION_CHANGE_MODE, NO) ||
	    word_is(drive->options, OPTION_MODE, MODE_UNKNOWN))
		return MODE_NOT_KNOWN;
	return (int)drive->options[OPTION_MODE] - 1;
}

/* The motions that a drive can have whose mode may not be changed. */
static uint64_t moves_of(int mode)
{
	switch (mode) {
	case SERVO_CAN_MODE_POSITION:
		return POSITION_MOVES;
	case SERVO_CAN_MODE_SPEED:
		return DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY);
	case SERVO_CAN_MODE_CURRENT:
		return DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT);
	default:
		return 0;
	}
}

static uint64_t servo_forbidden(const struct db_bus_config *bus,
                                const struct db_drive_config *drive)
{
	uint64_t forbidden = 0;

	if (words_given(bus) != WORDS_NEEDED)
		forbidden |= POSITION_MOVES;
	if (word_is(drive->options, OPTION_CHANGE_MODE, NO))
		forbidden |= MOVES & ~moves_of(fixed_mode(drive));
	/* What of a position move waits for a sync frame is not documented. */
	forbidden |= word_is(drive->options, OPTION_SYNC, NO) ? DB_COMMAND_BIT(DB_CMD_SYNC_START) :
	                                                        POSITION_MOVES;
	return forbidden;
}

static bool in(double value, double min, double max)
{
	return value >= min && value <= max;
}

static enum db_result servo_check(const struct db_bus_config *bus,
                                  const struct db_drive_config *drive, enum db_command command,
                                  const struct db_args *args)
{
	bool right = true;

	if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
	    !(COMMANDS & ~servo_forbidden(bus, drive) & DB_COMMAND_BIT(command)))
		return DB_RESULT_UNSUPPORTED;
	if (command == DB_CMD_MOVE_VELOCITY)
		right = in((double)args->target_velocity, -SPEED_MAX, SPEED_MAX);
	else if (command == DB_CMD_MOVE_CURRENT)
		right = in((double)args->target_current, -CURRENT_MAX, CURRENT_MAX);
	else if (POSITION_MOVES & DB_COMMAND_BIT(command))
		/* No frame gives the speed of a position move. */
		right = in((double)args->target_velocity, 0.0, 0.0);
	return right ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

static enum db_result servo_check_param(const struct db_bus_config *bus, size_t param,
                                        union db_value value)
{
	(void)bus;
	if (param >= PARAM_COUNT)
		return DB_RESULT_UNSUPPORTED;
	return in(db_value_number(params[param].type, value), params[param].min,
	          params[param].max) ?
	               DB_RESULT_OK :
	               DB_RESULT_OUT_OF_RANGE;
}

/* --- commands: what is said next ------------------------------------------------------------------- */

/* scratch[0]: the setpoint that is being written, the target of a position move, or where the drive
 * stood before set_position. scratch[1]: the flag below, and the resends. */
#define TARGET_WRITTEN 1
#define RESENDS_SHIFT 8

static enum servo_can_mode mode_of(enum db_command command)
{
	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
		return SERVO_CAN_MODE_SPEED;
	case DB_CMD_MOVE_CURRENT:
		return SERVO_CAN_MODE_CURRENT;
	default:
		return SERVO_CAN_MODE_POSITION;
	}
}

static int16_t setpoint_of(const struct db_request *request)
{
	float value = request->command == DB_CMD_MOVE_CURRENT ?
	                      request->args.target_current * CURRENT_STEPS :
	                      request->args.target_velocity;

	return (int16_t)lrintf(value);
}

static bool is_stop(const struct db_job *job)
{
	return job->kind == DB_JOB_COMMAND && db_command_is_stop(job->request->command);
}

static bool sets_setpoint(const struct db_job *job)
{
	return job->kind == DB_JOB_COMMAND && (job->request->command == DB_CMD_MOVE_VELOCITY ||
	                                       job->request->command == DB_CMD_MOVE_CURRENT);
}

static enum db_step begin_stop(struct db_device *device, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	bool by_setpoint = device->mode == SERVO_CAN_MODE_SPEED ||
	                   device->mode == SERVO_CAN_MODE_CURRENT;

	device->has_target = false;
	if (by_setpoint && !device->synchronous && powered(device))
		return say_setpoint(device, job, 0, exchange, result);
	if (device->mode == SERVO_CAN_MODE_POSITION && !device->going)
		return look(device, job, STEP_LOOK, exchange, result);
	return say_power(device, job, false, exchange, result);
}

/* A motor that gets its power back must not go on with what it was told before. */
static enum db_step enable(struct db_device *device, struct db_job *job,
                           struct db_exchange *exchange, enum db_result *result)
{
	bool unpowered = !powered(device);

	/* Only a sync frame makes a 0 count, and what else that starts is the PLC's business. */
	if (unpowered && device->synchronous && (device->setpoint != 0 || device->staged))
		return done(result, DB_RESULT_BUSY);
	if (unpowered && device->setpoint != 0) {
		if (device->mode != device->setpoint_mode)
			return say_mode(device, job, (enum servo_can_mode)device->setpoint_mode,
			                exchange, result);
		return say_setpoint(device, job, 0, exchange, result);
	}
	if (unpowered && device->trigger == LEVEL_HIGH)
		return say_trigger(device, job, false, exchange, result);
	return say_power(device, job, true, exchange, result);
}

static enum db_step begin_setpoint(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	int16_t setpoint = setpoint_of(job->request);

	if (device->mode != (int)mode_of(job->request->command))
		return look(device, job, STEP_LOOK, exchange, result);
	/* Without power it would begin when the motor gets it. */
	if (setpoint != 0 && !powered(device))
		return done(result, DB_RESULT_REFUSED);
	return say_setpoint(device, job, setpoint, exchange, result);
}

static enum db_step begin_command(struct db_device *device, struct db_job *job,
                                  struct db_exchange *exchange, enum db_result *result)
{
	switch (job->request->command) {
	case DB_CMD_ENABLE:
		return enable(device, job, exchange, result);
	case DB_CMD_DISABLE:
		return say_power(device, job, false, exchange, result);
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		return begin_stop(device, job, exchange, result);
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_CURRENT:
		return begin_setpoint(device, job, exchange, result);
	case DB_CMD_SYNC_START:
		return say_sync(device, job, exchange, result);
	case DB_CMD_CLEAR_FAULT:
		return done(result, DB_RESULT_UNSUPPORTED);
	default: /* position moves, set_position and read_parameters */
		return look(device, job, STEP_LOOK, exchange, result);
	}
}

/* The next frame of a position move: whatever is still missing. */
static enum db_step go_on(struct db_device *device, struct db_job *job, db_time now,
                          struct db_exchange *exchange, enum db_result *result)
{
	int32_t target = (int32_t)job->scratch[0];

	if (device->mode != SERVO_CAN_MODE_POSITION)
		return say_mode(device, job, SERVO_CAN_MODE_POSITION, exchange, result);
	if (device->trigger != LEVEL_LOW && !(job->scratch[1] & TARGET_WRITTEN))
		return say_trigger(device, job, false, exchange, result);
	if (!(job->scratch[1] & TARGET_WRITTEN))
		return say_position(device, job, SERVO_CAN_POSITION, target, exchange, result);
	/* It may rise even if the acknowledgement never comes. */
	device->trigger = LEVEL_HIGH;
	device->triggered = now;
	device->going = true;
	device->left_target = false;
	device->stopping = false;
	device->has_target = true;
	device->target = target;
	return say_trigger(device, job, true, exchange, result);
}

/* What the drive does now was read: may a position move begin? Its target is fixed here, once. */
static enum db_step begin_position(struct db_device *device, struct db_job *job, db_time now,
                                   struct db_exchange *exchange, enum db_result *result)
{
	int64_t target = job->request->args.target_position;

	if (!powered(device))
		return done(result, DB_RESULT_REFUSED);
	if (!at_rest(device))
		return done(result, DB_RESULT_BUSY);
	if (job->request->command == DB_CMD_MOVE_RELATIVE)
		target += device->sample.position;
	if (target < INT32_MIN || target > INT32_MAX)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	job->scratch[0] = target;
	job->scratch[1] = 0;
	return go_on(device, job, now, exchange, result);
}

static enum db_step change_mode(struct db_device *device, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	if (!powered(device))
		return done(result, DB_RESULT_REFUSED);
	if (!at_rest(device))
		return done(result, DB_RESULT_BUSY);
	return say_mode(device, job, mode_of(job->request->command), exchange, result);
}

static enum db_step set_position(struct db_device *device, struct db_job *job,
                                 struct db_exchange *exchange, enum db_result *result)
{
	bool held = device->mode != SERVO_CAN_MODE_SPEED && device->mode != SERVO_CAN_MODE_CURRENT;

	if (!at_rest(device) || (powered(device) && held))
		return done(result, DB_RESULT_BUSY);
	job->scratch[0] = device->sample.position;
	return say_position(device, job, SERVO_CAN_SET_FEEDBACK, job->request->args.target_position,
	                    exchange, result);
}

/* --- writing parameters ------------------------------------------------------------------------ */

static uint64_t settings_wanted(const struct db_request *request)
{
	uint64_t wanted = 0;

	for (size_t i = 0; i < request->setting_count; i++)
		wanted |= PARAM_BIT(request->settings[i].param);
	return wanted;
}

/* The last value the request has for it, else the one written before. */
static union db_value value_for(const struct db_device *device, const struct db_request *request,
                                enum param param)
{
	union db_value value = device->plate.values[param];

	for (size_t i = 0; i < request->setting_count; i++) {
		if (request->settings[i].param == param)
			value = request->settings[i].value;
	}
	return value;
}

static enum db_step say_ramps(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = SERVO_CAN_RAMPS };

	message.u.ramps.acceleration = (uint32_t)llrint(
		(double)value_for(device, job->request, PARAM_ACCELERATION).f);
	message.u.ramps.deceleration = (uint32_t)llrint(
		(double)value_for(device, job->request, PARAM_DECELERATION).f);
	return say(device, job, STEP_RAMPS, message, true, exchange, result);
}

/* The frame also writes the mode: the same as before. */
static enum db_step say_max_speed(struct db_device *device, struct db_job *job,
                                  struct db_exchange *exchange, enum db_result *result)
{
	struct servo_can_message message = { .kind = SERVO_CAN_MODE };

	message.u.mode.mode = (enum servo_can_mode)device->mode;
	message.u.mode.torque_clockwise = device->torque_clockwise;
	message.u.mode.has_max_speed = true;
	message.u.mode.max_speed = (uint16_t)value_for(device, job->request, PARAM_MAX_SPEED).u;
	return say(device, job, STEP_MAX_SPEED, message, true, exchange, result);
}

static bool may_set_max_speed(const struct db_device *device, enum db_result *result)
{
	if (!device->may_change_mode || device->mode == MODE_NOT_KNOWN)
		*result = DB_RESULT_UNSUPPORTED;
	else if (!at_rest(device))
		*result = DB_RESULT_BUSY;
	else
		return true;
	return false;
}

/* Nothing is sent unless all of it can be. */
static enum db_step begin_settings(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	uint64_t wanted = settings_wanted(job->request);

	if ((wanted & PARAM_BIT(PARAM_MAX_SPEED)) && !may_set_max_speed(device, result))
		return DB_STEP_DONE;
	if (!(wanted & RAMPS))
		return say_max_speed(device, job, exchange, result);
	/* One frame has both, and the one that is not given and was never written is not known. */
	if ((RAMPS & ~(wanted | device->plate.valid)) != 0)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	return say_ramps(device, job, exchange, result);
}

static void remember(struct db_device *device, const struct db_request *request, enum param param)
{
	union db_value value = value_for(device, request, param);

	if (params[param].type == DB_F32)
		value.f = (float)llrint((double)value.f);
	device->plate.values[param] = value;
	device->plate.valid |= PARAM_BIT(param);
	device->plate.generation++;
}

static enum db_step settings_acknowledged(struct db_device *device, struct db_job *job,
                                          struct db_exchange *exchange, enum db_result *result)
{
	if (job->step == STEP_MAX_SPEED) {
		remember(device, job->request, PARAM_MAX_SPEED);
		return done(result, DB_RESULT_OK);
	}
	remember(device, job->request, PARAM_ACCELERATION);
	remember(device, job->request, PARAM_DECELERATION);
	if (!(settings_wanted(job->request) & PARAM_BIT(PARAM_MAX_SPEED)))
		return done(result, DB_RESULT_OK);
	/* A stop may have come between. */
	if (!may_set_max_speed(device, result))
		return DB_STEP_DONE;
	return say_max_speed(device, job, exchange, result);
}

/* What the drive has now is not known. */
static void forget_settings(struct db_device *device, const struct db_request *request)
{
	uint64_t wanted = settings_wanted(request);

	if (wanted & RAMPS)
		wanted |= RAMPS;
	device->plate.valid &= ~wanted;
	device->plate.generation++;
}

/* --- what the drive says --------------------------------------------------------------------------- */

static void show_sample(struct db_device *device, const struct sample *sample)
{
	/* Reports come while a read is under way: time does not go back. */
	if (device->has_sample && sample->taken < device->sample.taken)
		return;
	device->sample = *sample;
	device->has_sample = true;
}

static void follow_target(struct db_device *device, db_time now)
{
	if (!device->going)
		return;
	if (!(device->bits & SERVO_CAN_ST_POSITION_REACHED))
		device->left_target = true;
	else if (device->left_target || now - device->triggered >= SETTLE_TIME)
		device->going = false;
}

static void take_status(struct db_device *device, const struct reading *reading, db_time now)
{
	device->bits = reading->bits;
	device->inputs = reading->inputs;
	device->outputs = reading->outputs;
	device->status_at = now;
	device->has_status = true;
	if (!powered(device))
		device->going = false;
	follow_target(device, now);
	if (!powered(device) || stands(device))
		device->stopping = false;
}

static void take_reading(struct db_device *device, unsigned parts, db_time now)
{
	const struct reading *reading = &device->reading;

	if (parts & SERVO_CAN_GIVES_ANALOGUE) {
		device->analogue = reading->analogue;
		device->analogue_at = now;
	}
	if ((parts & ALL_PARTS) == ALL_PARTS)
		show_sample(device, &(struct sample){ .taken = reading->taken,
		                                      .position = reading->position,
		                                      .speed = reading->speed,
		                                      .current = reading->current });
	if (parts & SERVO_CAN_GIVES_STATUS)
		take_status(device, reading, now);
}

static unsigned part_of(enum servo_can_kind kind)
{
	switch (kind) {
	case SERVO_CAN_ANSWER_POSITION:
		return SERVO_CAN_GIVES_POSITION;
	case SERVO_CAN_ANSWER_MOTION:
		return SERVO_CAN_GIVES_MOTION;
	case SERVO_CAN_ANSWER_STATUS:
		return SERVO_CAN_GIVES_STATUS;
	case SERVO_CAN_ANSWER_ANALOGUE:
		return SERVO_CAN_GIVES_ANALOGUE;
	default:
		return 0;
	}
}

static void take_part(struct reading *reading, unsigned part,
                      const struct servo_can_message *message, db_time now)
{
	reading->have |= part;
	switch (part) {
	case SERVO_CAN_GIVES_POSITION:
		reading->position = message->u.position;
		reading->taken = now;
		break;
	case SERVO_CAN_GIVES_MOTION:
		reading->speed = message->u.motion.speed;
		reading->current = message->u.motion.current;
		break;
	case SERVO_CAN_GIVES_STATUS:
		reading->bits = message->u.status.bits;
		reading->inputs = message->u.status.inputs;
		reading->outputs = message->u.status.outputs;
		break;
	default:
		reading->analogue = message->u.analogue;
		break;
	}
}

/* --- commands: what the drive answered --------------------------------------------------------------- */

/* The mode that the command on the wire asked for. */
static int asked_mode(const struct db_device *device, const struct db_job *job)
{
	return job->request->command == DB_CMD_ENABLE ? device->setpoint_mode :
	                                                (int)mode_of(job->request->command);
}

static enum db_step after_mode(struct db_device *device, struct db_job *job, db_time now,
                               struct db_exchange *exchange, enum db_result *result)
{
	device->mode = asked_mode(device, job);
	if (job->request->command == DB_CMD_ENABLE)
		return enable(device, job, exchange, result);
	if (sets_setpoint(job))
		return say_setpoint(device, job, setpoint_of(job->request), exchange, result);
	return go_on(device, job, now, exchange, result);
}

static enum db_step after_setpoint(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	device->setpoint = (int16_t)job->scratch[0];
	device->setpoint_mode = device->mode;
	if (device->synchronous)
		device->staged = true;
	if (job->request->command == DB_CMD_ENABLE)
		return enable(device, job, exchange, result);
	if (is_stop(job))
		device->stopping = !stands(device);
	else
		device->has_target = false;
	return done(result, DB_RESULT_OK);
}

/* Without power the trigger does nothing: it is dropped now, so that the next move can raise it. */
static enum db_step disabled(struct db_device *device, struct db_job *job,
                             struct db_exchange *exchange, enum db_result *result)
{
	device->has_target = false;
	if (device->trigger != LEVEL_HIGH)
		return done(result, DB_RESULT_OK);
	/* Tried once: a stop does not depend on it, and every move makes sure that it is down. */
	device->trigger = LEVEL_NOT_KNOWN;
	return say_trigger(device, job, false, exchange, result);
}

/* Has the power stage followed? */
static enum db_step confirm_power(struct db_device *device, struct db_job *job, db_time now,
                                  struct db_exchange *exchange, enum db_result *result)
{
	bool wanted = job->request->command == DB_CMD_ENABLE;

	if (powered(device) == wanted)
		return wanted ? done(result, DB_RESULT_OK) :
		                disabled(device, job, exchange, result);
	if (now - job->started > POWER_TIME)
		return done(result, DB_RESULT_FAILED);
	return look(device, job, STEP_CONFIRM, exchange, result);
}

static enum db_step after_trigger_down(struct db_device *device, struct db_job *job, db_time now,
                                       struct db_exchange *exchange, enum db_result *result)
{
	device->trigger = LEVEL_LOW;
	if (is_stop(job) || job->kind == DB_JOB_POLL)
		return done(result, DB_RESULT_OK);
	if (job->request->command == DB_CMD_ENABLE)
		return enable(device, job, exchange, result);
	return go_on(device, job, now, exchange, result);
}

static enum db_step position_set(struct db_device *device, enum db_result *result)
{
	device->has_target = false;
	return done(result, DB_RESULT_OK);
}

/* The frame on the wire was acknowledged with its code. */
static enum db_step acknowledged(struct db_device *device, struct db_job *job, db_time now,
                                 struct db_exchange *exchange, enum db_result *result)
{
	if (job->kind == DB_JOB_SETTINGS)
		return settings_acknowledged(device, job, exchange, result);
	device->refused = false;
	switch ((enum step)job->step) {
	case STEP_MODE:
		return after_mode(device, job, now, exchange, result);
	case STEP_SETPOINT:
		return after_setpoint(device, job, exchange, result);
	case STEP_TRIGGER_DOWN:
		return after_trigger_down(device, job, now, exchange, result);
	case STEP_POSITION:
		job->scratch[1] |= TARGET_WRITTEN;
		return go_on(device, job, now, exchange, result);
	case STEP_POWER:
		return look(device, job, STEP_CONFIRM, exchange, result);
	case STEP_FEEDBACK:
		return position_set(device, result);
	default: /* CTRG is up: the move is on */
		return done(result, DB_RESULT_OK);
	}
}

/* An acknowledgement of something else: the drive did not take this. */
static enum db_step misacknowledged(struct db_device *device, struct db_job *job,
                                    struct db_exchange *exchange, enum db_result *result)
{
	device->refused = true;
	if (job->kind == DB_JOB_SETTINGS)
		forget_settings(device, job->request);
	if (job->step == STEP_TRIGGER_UP)
		device->going = false;
	/* A stop does not end with that. */
	if (is_stop(job) && job->step == STEP_SETPOINT)
		return say_power(device, job, false, exchange, result);
	if (is_stop(job) && job->step == STEP_POWER)
		return look(device, job, STEP_CONFIRM, exchange, result);
	if (is_stop(job))
		return done(result, DB_RESULT_OK);
	return done(result, DB_RESULT_REFUSED);
}

/* May the frame that was not answered be sent again? As often as it makes sense. */
static bool may_resend(struct db_job *job)
{
	if (job->scratch[1] >> RESENDS_SHIFT >= RESENDS_MAX)
		return false;
	job->scratch[1] += 1 << RESENDS_SHIFT;
	return true;
}

/* The answer to set_position or to the rise of CTRG was lost: what does the drive itself say? */
static enum db_step resolve(struct db_device *device, struct db_job *job, db_time now,
                            struct db_exchange *exchange, enum db_result *result)
{
	int32_t position = device->sample.position;

	if (job->request->command == DB_CMD_SET_POSITION) {
		if (stands(device) && position == job->request->args.target_position)
			return position_set(device, result);
		if (!stands(device) || position != job->scratch[0] || !may_resend(job))
			return done(result, DB_RESULT_INDETERMINATE);
		return say_position(device, job, SERVO_CAN_SET_FEEDBACK,
		                    job->request->args.target_position, exchange, result);
	}
	if (!stands(device) || position == (int32_t)job->scratch[0])
		return done(result, DB_RESULT_OK);
	/* CTRG that is up already does not rise again. */
	if (powered(device) && may_resend(job))
		return go_on(device, job, now, exchange, result);
	return done(result, DB_RESULT_INDETERMINATE);
}

/* A read of a command was answered. */
static enum db_step looked(struct db_device *device, struct db_job *job, db_time now,
                           struct db_exchange *exchange, enum db_result *result)
{
	if (job->step == STEP_CONFIRM)
		return confirm_power(device, job, now, exchange, result);
	if (job->step == STEP_READ_BACK)
		return resolve(device, job, now, exchange, result);
	switch (job->request->command) {
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		if (!powered(device) || at_rest(device))
			return done(result, DB_RESULT_OK);
		return say_power(device, job, false, exchange, result);
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_CURRENT:
		return change_mode(device, job, exchange, result);
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		return begin_position(device, job, now, exchange, result);
	case DB_CMD_SET_POSITION:
		return set_position(device, job, exchange, result);
	case DB_CMD_SYNC_START:
		device->staged = false;
		return done(result, DB_RESULT_OK);
	default: /* read_parameters: there are none to be read */
		device->params_valid = true;
		return done(result, DB_RESULT_OK);
	}
}

/* --- jobs ---------------------------------------------------------------------------------------- */

/* Reports come as often as the bridge would ask; half a cycle more is no reason to ask. */
static bool reports_come(const struct db_device *device, db_time now)
{
	return device->has_sample && device->reported.taken != 0 &&
	       now - device->reported.taken <= device->cycle + device->cycle / 2;
}

static enum db_step begin_poll(struct db_device *device, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	unsigned parts = reports_come(device, job->started) ? SERVO_CAN_GIVES_STATUS : ALL_PARTS;

	return read_parts(device, job, STEP_LOOK, parts, exchange, result);
}

static enum db_step polled(struct db_device *device, struct db_job *job, db_time now,
                           struct db_exchange *exchange, enum db_result *result)
{
	if (job->step == STEP_ANALOGUE)
		return done(result, DB_RESULT_OK);
	if (device->trigger == LEVEL_HIGH && !device->going)
		return say_trigger(device, job, false, exchange, result);
	if (device->analogue_at == 0 || now - device->analogue_at >= ANALOGUE_INTERVAL)
		return read_parts(device, job, STEP_ANALOGUE, SERVO_CAN_GIVES_ANALOGUE, exchange,
		                  result);
	return done(result, DB_RESULT_OK);
}

static enum db_step servo_begin(struct db_device *device, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	switch (job->kind) {
	case DB_JOB_PROBE:
		/* An answer that no other exchange has, so that a late one is not taken for it. */
		return read_parts(device, job, STEP_ANALOGUE, SERVO_CAN_GIVES_ANALOGUE, exchange,
		                  result);
	case DB_JOB_IDENTIFY:
		return look(device, job, STEP_LOOK, exchange, result);
	case DB_JOB_POLL:
		return begin_poll(device, job, exchange, result);
	case DB_JOB_SETTINGS:
		return begin_settings(device, job, exchange, result);
	case DB_JOB_COMMAND:
	default:
		return begin_command(device, job, exchange, result);
	}
}

/* All parts of the answer to a read are there. */
static enum db_step read_answered(struct db_device *device, struct db_job *job, db_time now,
                                  struct db_exchange *exchange, enum db_result *result)
{
	switch (job->kind) {
	case DB_JOB_PROBE:
		return done(result, DB_RESULT_OK);
	case DB_JOB_IDENTIFY: /* there is no identity and no parameter that could be read */
		device->params_valid = true;
		return done(result, DB_RESULT_OK);
	case DB_JOB_POLL:
		return polled(device, job, now, exchange, result);
	default:
		return looked(device, job, now, exchange, result);
	}
}

/* The last frame of the request is the one that is answered. */
static bool asked_of(const struct db_device *device, const struct db_exchange *exchange,
                     struct servo_can_message *asked)
{
	struct db_can_frame frame;

	memcpy(&frame, exchange->request + exchange->request_length - sizeof frame, sizeof frame);
	return servo_can_decode(&frame, &device->layout, SERVO_CAN_FROM_HOST, asked) ==
	       SERVO_CAN_OK;
}

static enum db_step answer_read(struct db_device *device, struct db_job *job, unsigned parts,
                                const struct servo_can_message *message, db_time now,
                                struct db_exchange *exchange, enum db_result *result)
{
	struct reading *reading = &device->reading;
	unsigned part = part_of(message->kind);

	if (reading->sending != exchange->sending)
		*reading = (struct reading){ .sending = exchange->sending };
	if (!(part & parts))
		return DB_STEP_IGNORE;
	take_part(reading, part, message, now);
	if ((reading->have & parts) != parts)
		return DB_STEP_MORE;
	take_reading(device, parts, now);
	/* The next read starts afresh, whatever its number. */
	reading->have = 0;
	return read_answered(device, job, now, exchange, result);
}

static enum db_step servo_answer(struct db_device *device, struct db_job *job, const uint8_t *bytes,
                                 size_t length, db_time now, struct db_exchange *exchange,
                                 enum db_result *result)
{
	struct servo_can_message message;
	struct servo_can_message asked;
	struct db_can_frame frame;
	enum servo_can_error error;

	if (length != sizeof frame || !asked_of(device, exchange, &asked))
		return DB_STEP_IGNORE;
	memcpy(&frame, bytes, sizeof frame);
	error = servo_can_decode(&frame, &device->layout, SERVO_CAN_FROM_DRIVE, &message);
	if (error != SERVO_CAN_OK &&
	    !(error == SERVO_CAN_ERR_RANGE && message.kind == SERVO_CAN_ACK))
		return DB_STEP_IGNORE;
	if (asked.kind == SERVO_CAN_READ)
		return error == SERVO_CAN_OK ?
		               answer_read(device, job, servo_can_answers(asked.u.selector),
		                           &message, now, exchange, result) :
		               DB_STEP_IGNORE;
	if (message.kind != SERVO_CAN_ACK)
		return DB_STEP_IGNORE;
	return message.u.ack.code == servo_can_ack_expected(&asked, &device->layout) ?
	               acknowledged(device, job, now, exchange, result) :
	               misacknowledged(device, job, exchange, result);
}

static enum db_step servo_lost(struct db_device *device, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	if (job->kind == DB_JOB_SETTINGS)
		forget_settings(device, job->request);
	if (job->kind != DB_JOB_COMMAND)
		return done(result, DB_RESULT_TIMEOUT);
	switch ((enum step)job->step) {
	case STEP_TRIGGER_UP:
	case STEP_FEEDBACK:
		return look(device, job, STEP_READ_BACK, exchange, result);
	case STEP_SETPOINT: /* before enabling it is 0 */
		return done(result,
		            sets_setpoint(job) ? DB_RESULT_INDETERMINATE : DB_RESULT_TIMEOUT);
	case STEP_POWER:
	case STEP_CONFIRM:
	case STEP_SYNC:
	case STEP_READ_BACK:
		return done(result, DB_RESULT_INDETERMINATE);
	default: /* nothing that moves anything was sent */
		return done(result, DB_RESULT_TIMEOUT);
	}
}

/* --- reports ------------------------------------------------------------------------------------- */

/* Position and speed come in two reports, whose intervals are set separately. Only two that come
 * together are shown, so that they belong to one moment. */
static void pair_reports(struct db_device *device)
{
	db_time apart = device->position_at - device->motion_at;

	if (!device->uses_reports || device->position_at == 0 || device->motion_at == 0 ||
	    apart > PAIR_TIME || apart < -PAIR_TIME)
		return;
	device->reported.taken = device->position_at;
	device->position_at = 0;
	device->motion_at = 0;
	show_sample(device, &device->reported);
}

static bool servo_report(struct db_device *device, const uint8_t *bytes, size_t length, db_time now)
{
	struct servo_can_message message;
	struct db_can_frame frame;

	if (length != sizeof frame)
		return false;
	memcpy(&frame, bytes, sizeof frame);
	if (servo_can_decode(&frame, &device->layout, SERVO_CAN_FROM_DRIVE, &message) !=
	    SERVO_CAN_OK)
		return false;
	switch (message.kind) {
	case SERVO_CAN_REPORT_POSITION:
		device->reported.position = message.u.position;
		device->position_at = now;
		break;
	case SERVO_CAN_REPORT_MOTION:
		device->reported.speed = message.u.motion.speed;
		device->reported.current = message.u.motion.current;
		device->motion_at = now;
		break;
	case SERVO_CAN_REPORT_HEALTH:
		device->voltage = message.u.health.voltage;
		device->temperature = message.u.health.temperature;
		device->faults = message.u.health.faults;
		device->has_health = true;
		break;
	default: /* an answer that is too late */
		return false;
	}
	pair_reports(device);
	return true;
}

static bool servo_wants_poll(const struct db_device *device, db_time now)
{
	bool busy = device->going || device->stopping || device->trigger == LEVEL_HIGH;

	return busy || !device->has_status || !reports_come(device, now) ||
	       now - device->status_at >= STATUS_INTERVAL;
}

/* --- state ------------------------------------------------------------------------------------- */

static uint16_t error_of(const struct db_device *device)
{
	uint16_t bit = 0;

	if (!device->has_health || device->faults == 0)
		return DB_ERROR_NONE;
	while (!(device->faults >> bit & 1))
		bit++;
	return (uint16_t)(DB_ERROR_DRIVE_FAULT + bit);
}

static enum db_axis_state state_of(const struct db_device *device, uint16_t error)
{
	if (error != DB_ERROR_NONE)
		return DB_AXIS_ERROR_STOP;
	if (!powered(device))
		return DB_AXIS_DISABLED;
	if (device->stopping)
		return DB_AXIS_STOPPING;
	if (device->going)
		return DB_AXIS_DISCRETE_MOTION;
	/* Running blocked is running. */
	if (!stands(device) || (device->setpoint != 0 && !device->staged))
		return DB_AXIS_CONTINUOUS_MOTION;
	return DB_AXIS_STANDSTILL;
}

#define WARNINGS (SERVO_CAN_ST_WARNING | SERVO_CAN_ST_OVERLOAD | SERVO_CAN_ST_ERROR)

static uint32_t status_of(const struct db_device *device, enum db_axis_state state)
{
	uint32_t status = 0;

	if (powered(device))
		status |= DB_STATUS_ENABLED;
	if (device->bits & SERVO_CAN_ST_HOMED)
		status |= DB_STATUS_HOMED;
	if (!stands(device) || device->going)
		status |= DB_STATUS_MOVING;
	if (device->has_target && !device->going && powered(device) &&
	    (device->bits & SERVO_CAN_ST_POSITION_REACHED))
		status |= DB_STATUS_AT_TARGET;
	if (state == DB_AXIS_STOPPING)
		status |= DB_STATUS_STOPPING;
	if (state == DB_AXIS_ERROR_STOP)
		status |= DB_STATUS_ERROR;
	if (device->bits & WARNINGS)
		status |= DB_STATUS_WARNING;
	if (device->params_valid)
		status |= DB_STATUS_PARAMS_VALID;
	if (device->refused)
		status |= DB_STATUS_REFUSED;
	return status;
}

static void servo_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	bool known = device->has_sample && device->has_status;
	enum db_axis_state state = DB_AXIS_OFFLINE;

	feedback->taken = device->sample.taken;
	feedback->position = device->sample.position;
	feedback->velocity = (float)device->sample.speed;
	feedback->has_target = device->has_target;
	feedback->target = device->target;
	feedback->current = (float)device->sample.current / CURRENT_STEPS;
	feedback->drive_status = device->bits;
	feedback->inputs = device->inputs;
	feedback->outputs = device->outputs;
	feedback->analogue_1 = device->analogue;
	feedback->fault_bits = device->faults;
	feedback->supply_voltage_raw = device->voltage;
	feedback->temperature_raw = device->temperature;
	/* Reported once a second, unless that was turned off in the drive. */
	feedback->supply_voltage = device->has_health ?
	                                   (float)(device->voltage * device->voltage_scale) :
	                                   NAN;
	feedback->temperature = device->has_health ?
	                                (float)(device->temperature * device->temperature_scale) :
	                                NAN;
	feedback->error = error_of(device);
	if (known)
		state = state_of(device, feedback->error);
	feedback->state = (uint16_t)state;
	feedback->status = status_of(device, state);
}

/* What it was told to do may still be going on: that is not forgotten. */
static void servo_gone(struct db_device *device)
{
	device->mode = device->fixed_mode;
	device->has_sample = false;
	device->has_status = false;
	device->has_health = false;
	device->faults = 0;
	device->reported.taken = 0;
	device->position_at = 0;
	device->motion_at = 0;
	device->analogue_at = 0;
	device->params_valid = false;
	if (device->plate.valid != 0) {
		device->plate.valid = 0;
		device->plate.generation++;
	}
}

static const struct db_nameplate *servo_nameplate(const struct db_device *device)
{
	return &device->plate;
}

static void servo_init(struct db_device *device, struct db_device *first,
                       const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)first; /* one drive an address */
	device->layout = layout_of(bus);
	device->node = (uint8_t)drive->address;
	device->may_change_mode = !word_is(drive->options, OPTION_CHANGE_MODE, NO);
	device->fixed_mode = fixed_mode(drive);
	device->torque_clockwise = word_is(drive->options, OPTION_TORQUE_DIRECTION, CLOCKWISE);
	device->synchronous = !word_is(drive->options, OPTION_SYNC, NO);
	device->uses_reports = word_is(drive->options, OPTION_REPORTS, USE_REPORTS);
	device->enabled_bit = (uint16_t)(1u << (unsigned)drive->options[OPTION_ENABLED_BIT]);
	device->voltage_scale = drive->options[OPTION_VOLTAGE_SCALE];
	device->temperature_scale = drive->options[OPTION_TEMPERATURE_SCALE];
	device->cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	device->mode = device->fixed_mode;
}

/* --- the bus's side ---------------------------------------------------------------------------- */

/* Ids come in blocks of 32, one for each base; those of acknowledgements may lie across two. */
#define BLOCK 0x20u
#define BLOCK_MASK (DB_CAN_EXTENDED | DB_CAN_REMOTE | (DB_CAN_STANDARD_MASK & ~(BLOCK - 1)))

static size_t servo_filters(const struct db_bus_config *bus, struct db_can_filter *filters)
{
	uint32_t ack_base = layout_of(bus).ack_base;
	uint32_t first = (ack_base + 1) & ~(BLOCK - 1);
	uint32_t last = (ack_base + SERVO_CAN_NODE_MAX) & ~(BLOCK - 1);
	size_t count = 0;

	filters[count++] = (struct db_can_filter){ first, BLOCK_MASK };
	if (last != first)
		filters[count++] = (struct db_can_filter){ last, BLOCK_MASK };
	for (uint32_t id = SERVO_CAN_BASE_ANSWER_POSITION; id <= SERVO_CAN_BASE_ANSWER_ANALOGUE;
	     id += BLOCK)
		filters[count++] = (struct db_can_filter){ id, BLOCK_MASK };
	return count;
}

static enum db_frame servo_accept(const struct db_bus_config *bus, const uint8_t *bytes,
                                  size_t length, int *address)
{
	struct servo_can_layout layout = layout_of(bus);
	struct servo_can_message message;
	struct db_can_frame frame;
	enum servo_can_error error;

	if (length != sizeof frame)
		return DB_FRAME_BAD;
	memcpy(&frame, bytes, sizeof frame);
	error = servo_can_decode(&frame, &layout, SERVO_CAN_FROM_DRIVE, &message);
	if (message.kind == SERVO_CAN_FOREIGN)
		return DB_FRAME_FOREIGN;
	*address = message.node;
	/* A code that nobody documents acknowledges something all the same, only not what was sent. */
	return error == SERVO_CAN_OK ||
	                       (error == SERVO_CAN_ERR_RANGE && message.kind == SERVO_CAN_ACK) ?
	               DB_FRAME_GOOD :
	               DB_FRAME_BAD;
}

static db_time wire_time(const struct db_bus_config *bus, unsigned frames, unsigned data)
{
	unsigned bytes = layout_of(bus).padded ? DB_CAN_DATA_MAX : data;
	unsigned bits = frames * db_can_frame_bits_max(false, bytes);

	return (db_time)bits * DB_NS_PER_S / (db_time)bus->bitrate;
}

static db_time servo_poll_time(const struct db_bus_config *bus)
{
	return wire_time(bus, 1, 1) + wire_time(bus, count_bits(ALL_PARTS), ANSWER_DATA) +
	       TYPICAL_LATENCY;
}

/* A position move: a read, then the mode, both edges of CTRG and the target, each acknowledged. */
static db_time servo_command_time(const struct db_bus_config *bus)
{
	const unsigned frames = 4;

	return servo_poll_time(bus) + wire_time(bus, frames, DB_CAN_DATA_MAX) +
	       wire_time(bus, frames, 1) + frames * TYPICAL_LATENCY;
}

/* Speed 0 is not among them: which mode the drives are in would have to be the same. */
static bool servo_broadcast(enum db_command command, const struct db_bus_config *bus,
                            struct db_exchange *exchange)
{
	struct servo_can_layout layout = layout_of(bus);
	struct servo_can_message message = { .kind = SERVO_CAN_ENABLE,
		                             .node = SERVO_CAN_BROADCAST };
	struct db_can_frame frame;

	if (command != DB_CMD_DISABLE && command != DB_CMD_ENABLE)
		return false;
	message.u.enable = command == DB_CMD_ENABLE;
	if (servo_can_encode(&message, &layout, &frame) != SERVO_CAN_OK ||
	    exchange->request_size < sizeof frame)
		return false;
	memcpy(exchange->request, &frame, sizeof frame);
	exchange->request_length = sizeof frame;
	exchange->answer_length = 0;
	return true;
}

/* --- what only this family knows of a configuration -------------------------------------------------- */

static void check_words(const struct db_bus_config *bus, db_complain_fn *complain, void *context)
{
	size_t given = words_given(bus);

	if (given == 0 && !is_set(bus, OPTION_WORD_1_AT)) {
		complain(
			context, NULL, false,
			"position moves are refused: the frame that starts them is on a missing page "
			"of the document; set command-word-base, -length, -0-at and -ack from the "
			"vendor's full manual");
		return;
	}
	for (size_t i = 0; i < WORDS_NEEDED && given < WORDS_NEEDED; i++) {
		if (!is_set(bus, words_needed[i]))
			complain(
				context, NULL, true,
				"%s is missing, but another setting of the command words is there; "
				"set all or none",
				options[words_needed[i]].name);
	}
}

static void check_layout(const struct db_bus_config *bus, db_complain_fn *complain, void *context)
{
	struct servo_can_layout layout = layout_of(bus);
	struct servo_can_layout without = layout;
	const char *reason;

	without.words.set = false;
	if (servo_can_layout_check(&without, &reason) != SERVO_CAN_OK)
		complain(context, NULL, true, "ack-base = 0x%X cannot be: %s",
		         (unsigned)layout.ack_base, reason);
	else if (servo_can_layout_check(&layout, &reason) != SERVO_CAN_OK)
		complain(context, NULL, true,
		         "command-word-base and what belongs to it cannot be: %s", reason);
}

static void check_drive(const struct servo_can_layout *layout, const struct db_drive_config *drive,
                        db_complain_fn *complain, void *context)
{
	enum servo_can_kind taken_for = servo_can_ack_collision(layout, (uint8_t)drive->address);
	bool fixed = word_is(drive->options, OPTION_CHANGE_MODE, NO);
	bool known = !word_is(drive->options, OPTION_MODE, MODE_UNKNOWN);

	if (taken_for != SERVO_CAN_FOREIGN)
		complain(
			context, drive, false,
			"address %u: the drive's acknowledgements have the id 0x%X, which is %s to "
			"every drive on the bus; use another address, or set ack-base if the "
			"drives have another",
			drive->address, (unsigned)layout->ack_base + drive->address,
			taken_for == SERVO_CAN_SYNC ? "a sync frame" : "an enable for all");
	if (fixed && !known)
		complain(context, drive, false,
		         "allow-mode-change = no without mode: all moves are refused; set mode to "
		         "what the drive is set to");
	/* It would be taken for a speed in counts, and let pass nearly everything. */
	if (!isnan(drive->max_velocity))
		complain(
			context, drive, true,
			"max-velocity is in the user's unit, but the drive's speed is in rpm, and how "
			"far a turn goes is not known; remove it and write max_speed");
	if (!isnan(drive->max_acceleration))
		complain(
			context, drive, true,
			"max-acceleration is in the user's unit, but the drive's ramps are in rpm/s; "
			"remove it");
	if (!fixed && known)
		complain(context, drive, true,
		         "mode is for drives with allow-mode-change = no; remove it, or set that");
}

static void servo_check_config(const struct db_bus_config *bus,
                               const struct db_drive_config *const *drives, size_t drive_count,
                               db_complain_fn *complain, void *context)
{
	struct servo_can_layout layout = layout_of(bus);

	check_words(bus, complain, context);
	check_layout(bus, complain, context);
	for (size_t i = 0; i < drive_count; i++)
		check_drive(&layout, drives[i], complain, context);
}

const struct db_driver db_driver_servo_can = {
	.name = "servo-can",
	.title = "servo drive on CAN; velocity in rpm",
	.medium = DB_MEDIUM_CAN,
	.address_min = 1,
	.address_max = SERVO_CAN_NODE_MAX,
	.default_baud = 1000000,
	.options = options,
	.option_count = OPTION_COUNT,
	.commands = COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS | DB_MEASURE_CURRENT |
	            DB_MEASURE_FAULT_BITS | DB_MEASURE_SUPPLY_VOLTAGE | DB_MEASURE_TEMPERATURE |
	            DB_MEASURE_ANALOGUE | DB_MEASURE_RAW_HEALTH,
	.params = params,
	.param_count = PARAM_COUNT,
	.param_page = 2,
	.acceleration_param = PARAM_ACCELERATION,
	.deceleration_param = PARAM_DECELERATION,
	.preset_velocity_param = -1,
	.check = servo_check,
	.check_param = servo_check_param,
	.forbidden = servo_forbidden,
	.check_config = servo_check_config,
	.poll_time = servo_poll_time,
	.command_time = servo_command_time,
	.device_size = sizeof(struct db_device),
	.init = servo_init,
	.filters = servo_filters,
	.cut = db_can_cut,
	.accept = servo_accept,
	.begin = servo_begin,
	.answer = servo_answer,
	.lost = servo_lost,
	.report = servo_report,
	.wants_poll = servo_wants_poll,
	.gone = servo_gone,
	.feedback = servo_feedback,
	.nameplate = servo_nameplate,
	.broadcast = servo_broadcast,
};
