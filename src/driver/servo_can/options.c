/* SPDX-License-Identifier: Apache-2.0 */
/* Keys of the configuration, which commands they allow, and what is wrong in them. */
#include "driver/servo_can/options.h"

#include "driver/conversation.h"

#include <math.h>

/* Places of words in the list below. */
#define NO 0
#define MODE_UNKNOWN 0 /* then position, speed, current as in enum servo_can_mode, plus one */
#define CLOCKWISE 1
#define USE_REPORTS 0
#define ERROR_IS_FAULT 0
#define SIGNED 0
#define DISABLES 0

#define FIXED_MAX 281474976710655.0 /* six bytes: at least two are a word's */

#define NUMBER_OF(low, high, of) \
	.words = "", .min = (low), .max = (high), .whole = true, .unit = (of)
#define NUMBER(low, high) NUMBER_OF(low, high, "")
#define SCALE .words = "", .preset = "1", .min = -1000, .max = 1000

const struct db_option servo_can_options[SERVO_CAN_OPTION_COUNT] = {
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
		.description = "Frames to the drives have 8 data bytes, unused ones are 0; those of "
			       "the drives may have more than documented in any case",
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
		NUMBER(0, FIXED_MAX),
		.preset = "0",
		.description = "The bytes of that frame that belong to neither word, as one number, "
			       "the last byte lowest; with command-word-base = 96, the ids of speed "
			       "and current, byte 0 tells the frame from theirs",
	},
	[OPTION_WORDS_ACK] = {
		.section = "bus",
		.name = "command-word-ack",
		NUMBER(0, UINT8_MAX),
		.preset = "",
		.description = "Code that acknowledges that frame; 0: nothing does, and a read behind "
			       "it shows that the drive was there",
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
		.description = "The mode that the drive is given each time it comes back, before its "
			       "motor has power; with allow-mode-change = no, the mode it is in",
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
	[OPTION_TEMPERATURE_OFFSET] = {
		.section = "drive",
		.name = "temperature-offset",
		.words = "",
		.preset = "0",
		.min = -1000,
		.max = 1000,
		.unit = "degC",
		.description = "Added to the scaled temperature, whose raw value is signed",
	},
	[OPTION_COUNTS_PER_TURN] = {
		.section = "drive",
		.name = "counts-per-turn",
		.words = "",
		.preset = "",
		.min = 1,
		.max = INT32_MAX,
		.unit = "",
		.description = "Counts of the position in one turn of the motor: with it velocity_units, "
			       "max-velocity and max-acceleration are in user units a second",
	},
	[OPTION_MAX_SPEED] = {
		.section = "drive",
		.name = "max-speed",
		NUMBER_OF(0, UINT16_MAX, "rpm"),
		.preset = "",
		.description = "Speed limit that the drive is given each time it comes back, before "
			       "its motor has power",
	},
	[OPTION_ACCELERATION] = {
		.section = "drive",
		.name = "ramp-acceleration",
		NUMBER_OF(0, UINT32_MAX, "rpm/s"),
		.preset = "",
		.description = "Ramp that the drive is given each time it comes back; together with "
			       "ramp-deceleration",
	},
	[OPTION_DECELERATION] = {
		.section = "drive",
		.name = "ramp-deceleration",
		NUMBER_OF(0, UINT32_MAX, "rpm/s"),
		.preset = "",
		.description = "As ramp-acceleration",
	},
	[OPTION_ON_FAULT] = {
		.section = "drive",
		.name = "on-fault",
		.words = "none stop disable",
		.preset = "disable",
		.unit = "",
		.description = "What the bridge does when the drive reports a fault, beside bringing "
			       "speed and current to 0: nothing, what a stop does, or taking the power "
			       "off, so that nothing begins by itself when the fault is gone",
	},
	[OPTION_STANDSTILL_SPEED] = {
		.section = "drive",
		.name = "standstill-speed",
		NUMBER_OF(0, 1000, "rpm"),
		.preset = "1",
		.description = "Up to this speed the motor counts as standing when the drive's zero "
			       "speed bit says so",
	},
	[OPTION_REACTION] = {
		.section = "drive",
		.name = "reaction-ms",
		NUMBER_OF(10, 10000, "ms"),
		.preset = "200",
		.description = "How long the drive may take from acknowledging a command to showing "
			       "its effect; for so long it is also watched behind enable",
	},
	[OPTION_ERROR_BIT] = {
		.section = "drive",
		.name = "error-bit",
		.words = "fault alarm",
		.preset = "fault",
		.unit = "",
		.description = "What bit 10 of the status word is: a fault as long as it is set, or an "
			       "alarm, which is a fault until a report says that there is none",
	},
	[OPTION_SPEED_SIGN] = {
		.section = "drive",
		.name = "speed-sign",
		.words = "signed bits",
		.preset = "signed",
		.unit = "",
		.description = "Where the direction of the speed is: in its own sign, or in bits 14 and "
			       "15 of the status word; those come with answers only, so reports of the "
			       "speed are not used then",
	},
	[OPTION_POWER_ON_WINDOW] = {
		.section = "drive",
		.name = "power-on-window",
		.words = "",
		.preset = "",
		.min = 0,
		.max = INT32_MAX,
		.unit = "",
		.description = "How far the motor may move, in user units, when enable gives it its "
			       "power: beyond that the power is taken off again; not set: "
			       "in-position-window, at least a hundredth of a turn and 10 counts, or "
			       "100 counts without counts-per-turn",
	},
	[OPTION_LATE_MOVE] = {
		.section = "drive",
		.name = "late-move",
		.words = "disable follow",
		.preset = "disable",
		.unit = "",
		.description = "What is done about a position move that does not show within "
			       "reaction-ms: its drive's power is taken off, and it has failed; or it "
			       "is indeterminate, and followed when it begins later",
	},
};

_Static_assert(SERVO_CAN_OPTION_COUNT <= DB_OPTIONS_MAX, "a configuration has room for so many");

static bool word_is(const double *values, enum servo_can_option option, int place)
{
	return (int)values[option] == place;
}

static bool is_set(const struct db_bus_config *bus, enum servo_can_option option)
{
	return !isnan(bus->options[option]);
}

/* Everything about the command words but what has a default. */
static const enum servo_can_option words_needed[] = { OPTION_WORDS_BASE, OPTION_WORDS_LENGTH,
	                                              OPTION_WORD_0_AT, OPTION_WORDS_ACK };
#define WORDS_NEEDED (sizeof words_needed / sizeof words_needed[0])

static size_t words_given(const struct db_bus_config *bus)
{
	size_t given = 0;

	for (size_t i = 0; i < WORDS_NEEDED; i++)
		given += is_set(bus, words_needed[i]);
	return given;
}

static void set_words(struct servo_can_words_layout *words, const struct db_bus_config *bus)
{
	words->set = true;
	words->base = (uint16_t)bus->options[OPTION_WORDS_BASE];
	words->length = (uint8_t)bus->options[OPTION_WORDS_LENGTH];
	words->word0 = (uint8_t)bus->options[OPTION_WORD_0_AT];
	words->word1 = is_set(bus, OPTION_WORD_1_AT) ? (uint8_t)bus->options[OPTION_WORD_1_AT] :
	                                               SERVO_CAN_NO_WORD;
	words->ack = (uint8_t)bus->options[OPTION_WORDS_ACK];
	servo_can_put_fixed(words, (uint64_t)bus->options[OPTION_WORDS_FIXED]);
}

struct servo_can_layout servo_can_read_layout(const struct db_bus_config *bus)
{
	struct servo_can_layout layout = {
		.ack_base = (uint16_t)bus->options[OPTION_ACK_BASE],
		.padded = !word_is(bus->options, OPTION_PADDED, NO),
	};

	if (words_given(bus) == WORDS_NEEDED)
		set_words(&layout.words, bus);
	return layout;
}

/* --- which commands there are ---------------------------------------------------------------------- */

/* The mode that a drive the bridge may not change is in; or SERVO_CAN_MODE_NOT_KNOWN. */
static int fixed_mode(const struct db_drive_config *drive)
{
	if (!word_is(drive->options, OPTION_CHANGE_MODE, NO) ||
	    word_is(drive->options, OPTION_MODE, MODE_UNKNOWN))
		return SERVO_CAN_MODE_NOT_KNOWN;
	return (int)drive->options[OPTION_MODE] - 1;
}

/* The motions that a drive can have whose mode may not be changed. */
static uint64_t moves_of(int mode)
{
	switch (mode) {
	case SERVO_CAN_MODE_POSITION:
		return SERVO_CAN_POSITION_MOVES;
	case SERVO_CAN_MODE_SPEED:
		return DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY);
	case SERVO_CAN_MODE_CURRENT:
		return DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT);
	default:
		return 0;
	}
}

uint64_t servo_can_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	uint64_t forbidden = 0;

	if (words_given(bus) != WORDS_NEEDED)
		forbidden |= SERVO_CAN_POSITION_MOVES;
	if (word_is(drive->options, OPTION_CHANGE_MODE, NO))
		forbidden |= SERVO_CAN_MOVES & ~moves_of(fixed_mode(drive));
	/* What of a position move waits for a sync frame is not documented. */
	forbidden |= word_is(drive->options, OPTION_SYNC, NO) ? DB_COMMAND_BIT(DB_CMD_SYNC_START) :
	                                                        SERVO_CAN_POSITION_MOVES;
	return forbidden;
}

enum db_result servo_can_check_command(const struct db_bus_config *bus,
                                       const struct db_drive_config *drive, enum db_command command,
                                       const struct db_args *args)
{
	bool right = true;

	if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
	    !(SERVO_CAN_COMMANDS & ~servo_can_forbidden(bus, drive) & DB_COMMAND_BIT(command)))
		return DB_RESULT_UNSUPPORTED;
	if (command == DB_CMD_MOVE_VELOCITY)
		right = is_within((double)args->target_velocity, -SERVO_CAN_SPEED_MAX,
		                  SERVO_CAN_SPEED_MAX);
	else if (command == DB_CMD_MOVE_CURRENT)
		right = is_within((double)args->target_current, -SERVO_CAN_CURRENT_MAX,
		                  SERVO_CAN_CURRENT_MAX);
	else if (SERVO_CAN_POSITION_MOVES & DB_COMMAND_BIT(command))
		/* No frame gives the speed of a position move. */
		right = is_within((double)args->target_velocity, 0.0, 0.0);
	return right ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

/* --- a drive's settings ---------------------------------------------------------------------------- */

#define SECONDS_PER_MINUTE 60.0

/* Position counts in a second, at one rpm; 0: not known. */
double servo_can_velocity_counts(const struct db_drive_config *drive)
{
	double counts = drive->options[OPTION_COUNTS_PER_TURN];

	return isnan(counts) ? 0.0 : counts / SECONDS_PER_MINUTE;
}

static struct servo_can_profile profile_of(const struct db_drive_config *drive)
{
	bool fixed = word_is(drive->options, OPTION_CHANGE_MODE, NO);

	return (struct servo_can_profile){
		.mode = fixed ? SERVO_CAN_MODE_NOT_KNOWN : (int)drive->options[OPTION_MODE] - 1,
		.max_speed = drive->options[OPTION_MAX_SPEED],
		.acceleration = drive->options[OPTION_ACCELERATION],
		.deceleration = drive->options[OPTION_DECELERATION],
	};
}

#define POWER_ON_COUNTS 100.0
#define POWER_ON_TURN 0.01
#define POWER_ON_LEAST 10.0

static double power_window_of(const struct db_drive_config *drive)
{
	double given = drive->options[OPTION_POWER_ON_WINDOW];
	double turn = drive->options[OPTION_COUNTS_PER_TURN];
	double least = isnan(turn) ? POWER_ON_COUNTS : fmax(turn * POWER_ON_TURN, POWER_ON_LEAST);

	return isnan(given) ? fmax(drive->in_position_window * drive->counts_per_unit, least) :
	                      given * drive->counts_per_unit;
}

void servo_can_configure(struct db_device *device, const struct db_bus_config *bus,
                         const struct db_drive_config *drive)
{
	const double *options = drive->options;

	device->layout = servo_can_read_layout(bus);
	device->node = (uint8_t)drive->address;
	device->may_change_mode = !word_is(options, OPTION_CHANGE_MODE, NO);
	device->fixed_mode = fixed_mode(drive);
	device->torque_clockwise = word_is(options, OPTION_TORQUE_DIRECTION, CLOCKWISE);
	device->synchronous = !word_is(options, OPTION_SYNC, NO);
	device->error_is_fault = word_is(options, OPTION_ERROR_BIT, ERROR_IS_FAULT);
	device->speed_is_unsigned = !word_is(options, OPTION_SPEED_SIGN, SIGNED);
	device->uses_reports = word_is(options, OPTION_REPORTS, USE_REPORTS) &&
	                       !device->speed_is_unsigned;
	device->enabled_bit = (uint16_t)(1u << (unsigned)options[OPTION_ENABLED_BIT]);
	device->voltage_scale = options[OPTION_VOLTAGE_SCALE];
	device->temperature_scale = options[OPTION_TEMPERATURE_SCALE];
	device->temperature_offset = options[OPTION_TEMPERATURE_OFFSET];
	device->on_fault = (enum servo_can_on_fault)options[OPTION_ON_FAULT];
	device->standstill_speed = (int)options[OPTION_STANDSTILL_SPEED];
	device->reaction = (db_time)options[OPTION_REACTION] * DB_NS_PER_MS;
	device->window = drive->in_position_window * drive->counts_per_unit;
	device->power_window = power_window_of(drive);
	device->follows_late = !word_is(options, OPTION_LATE_MOVE, DISABLES);
	device->cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	device->profile = profile_of(drive);
	device->mode = device->fixed_mode;
}

/* --- what is wrong --------------------------------------------------------------------------------- */

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
				servo_can_options[words_needed[i]].name);
	}
}

static void check_layout(const struct db_bus_config *bus, db_complain_fn *complain, void *context)
{
	struct servo_can_layout layout = servo_can_read_layout(bus);
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

static void check_scale(const struct db_drive_config *drive, db_complain_fn *complain,
                        void *context)
{
	if (!isnan(drive->options[OPTION_COUNTS_PER_TURN]))
		return;
	/* It would be taken for a speed in counts, and let pass nearly everything. */
	if (!isnan(drive->max_velocity))
		complain(
			context, drive, true,
			"max-velocity is in the user's unit, but the drive's speed is in rpm, and how "
			"far a turn goes is not known; set counts-per-turn, or remove it and set "
			"max-speed");
	if (!isnan(drive->max_acceleration))
		complain(
			context, drive, true,
			"max-acceleration is in the user's unit, but the drive's ramps are in rpm/s; "
			"set counts-per-turn, or remove it");
}

static void check_profile(const struct db_drive_config *drive, db_complain_fn *complain,
                          void *context)
{
	if (isnan(drive->options[OPTION_ACCELERATION]) !=
	    isnan(drive->options[OPTION_DECELERATION]))
		complain(context, drive, true,
		         "ramp-acceleration and ramp-deceleration are one frame; set both or none");
	if (word_is(drive->options, OPTION_CHANGE_MODE, NO) &&
	    !isnan(drive->options[OPTION_MAX_SPEED]))
		complain(context, drive, true,
		         "max-speed goes with the mode, which allow-mode-change = no leaves alone; "
		         "remove it, or set it in the drive");
}

/* Servos usually rest some counts beside a target. */
static void check_window(const struct db_bus_config *bus, const struct db_drive_config *drive,
                         db_complain_fn *complain, void *context)
{
	if ((SERVO_CAN_POSITION_MOVES & ~servo_can_forbidden(bus, drive)) != 0 &&
	    drive->in_position_window == 0.0)
		complain(
			context, drive, false,
			"in-position-window is 0: a position move is done only when the drive rests "
			"at its target to the count; set what is near enough for the machine");
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
	check_scale(drive, complain, context);
	check_profile(drive, complain, context);
}

void servo_can_check_config(const struct db_bus_config *bus,
                            const struct db_drive_config *const *drives, size_t drive_count,
                            db_complain_fn *complain, void *context)
{
	struct servo_can_layout layout = servo_can_read_layout(bus);

	check_words(bus, complain, context);
	check_layout(bus, complain, context);
	for (size_t i = 0; i < drive_count; i++) {
		check_drive(&layout, drives[i], complain, context);
		check_window(bus, drives[i], complain, context);
	}
}
