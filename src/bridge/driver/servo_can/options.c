/* SPDX-License-Identifier: Apache-2.0 */
/* Keys of the configuration, the commands that they allow, and checks of them. */
#include "driver/servo_can/options.h"

#include "codec/servo_can_layout.h"
#include "driver/conversation.h"

#include <math.h>
#include <string.h>

/* Indices of words in the list below. */
#define NO 0
#define MODE_UNKNOWN 0 /* then position, speed, current as in enum servo_can_mode, plus one */
#define CLOCKWISE 1
#define USE_REPORTS 0
#define ERROR_IS_FAULT 0
#define SIGNED 0
#define DISABLES 0
#define LOW_FIRST 1
#define RELATIVE 1
#define REVERSED 1

/* Places of settings. */
#define BUS(member) offsetof(struct servo_can_bus_options, member)
#define DRIVE(member) offsetof(struct servo_can_drive_options, member)

/* The setting at this place of a section's options. */
static const struct db_option *find_option(const char *section, size_t offset)
{
	size_t i = 0;

	while (strcmp(servo_can_options[i].section, section) != 0 ||
	       servo_can_options[i].offset != offset)
		i++;
	return &servo_can_options[i];
}

/* A setting of a bus that is a number; read with every frame, so not found by its name. */
static bool is_set(const struct db_bus_config *bus, size_t offset)
{
	double value;

	memcpy(&value, (const char *)bus->options + offset, sizeof(value));
	return !isnan(value);
}

/* Values without a default of a frame that the user describes: all or none of them are given. */
struct group {
	const char *name;
	size_t count;
	size_t options[4]; /* offsets */
};

static const struct group words_group = {
	"the command words",
	4,
	{ BUS(command_word_base), BUS(command_word_length), BUS(command_word_0_at),
	  BUS(command_word_ack) },
};
static const struct group word_1_group = {
	"command word 1's own frame",
	3,
	{ BUS(command_word_1_base), BUS(command_word_1_length), BUS(command_word_1_ack) },
};
static const struct group slot_group = {
	"the internal position's frame",
	2,
	{ BUS(position_slot_base), BUS(position_slot_ack) },
};
static const struct group move_group = {
	"the move frame",
	4,
	{ BUS(move_frame_base), BUS(move_frame_length), BUS(move_frame_at), BUS(move_frame_ack) },
};

static size_t count_given(const struct db_bus_config *bus, const struct group *group)
{
	size_t given = 0;

	for (size_t i = 0; i < group->count; i++)
		given += is_set(bus, group->options[i]);
	return given;
}

static bool is_given(const struct db_bus_config *bus, const struct group *group)
{
	return count_given(bus, group) == group->count;
}

struct servo_can_layout servo_can_read_layout(const struct db_bus_config *bus)
{
	const struct servo_can_bus_options *given = bus->options;
	struct servo_can_layout layout = {
		.ack_base = (uint16_t)given->ack_base,
		.padded = given->padded != NO,
	};

	if (is_given(bus, &words_group)) {
		bool together = !isnan(given->command_word_1_at) &&
		                isnan(given->command_word_1_base);

		layout.words.set = true;
		layout.words.base = (uint16_t)given->command_word_base;
		layout.words.length = (uint8_t)given->command_word_length;
		layout.words.word0 = (uint8_t)given->command_word_0_at;
		layout.words.word1 = together ? (uint8_t)given->command_word_1_at :
		                                SERVO_CAN_NO_WORD;
		layout.words.ack = (uint8_t)given->command_word_ack;
		servo_can_put_fixed(&layout.words, (uint64_t)given->command_word_fixed);
		layout.slot = (uint8_t)given->position_slot;
		if (is_given(bus, &word_1_group) && !isnan(given->command_word_1_at)) {
			layout.word1 = (struct servo_can_number_layout){
				.set = true,
				.base = (uint16_t)given->command_word_1_base,
				.length = (uint8_t)given->command_word_1_length,
				.at = (uint8_t)given->command_word_1_at,
				.size = sizeof(uint16_t),
				.ack = (uint8_t)given->command_word_1_ack,
			};
			servo_can_put_number_fixed(&layout.word1,
			                           (uint64_t)given->command_word_1_fixed);
		}
	}
	if (is_given(bus, &slot_group)) {
		layout.slot_base = (uint16_t)given->position_slot_base;
		layout.slot_ack = (uint8_t)given->position_slot_ack;
	}
	if (is_given(bus, &move_group)) {
		layout.move = (struct servo_can_number_layout){
			.set = true,
			.base = (uint16_t)given->move_frame_base,
			.length = (uint8_t)given->move_frame_length,
			.at = (uint8_t)given->move_frame_at,
			.size = (uint8_t)given->move_frame_bytes,
			.low_first = given->move_frame_order == LOW_FIRST,
			.ack = (uint8_t)given->move_frame_ack,
		};
		servo_can_put_number_fixed(&layout.move, (uint64_t)given->move_frame_fixed);
	}
	return layout;
}

/* --- which commands there are ----------------------------------------------------------------- */

/* The mode of a drive whose mode the bridge may not change; or SERVO_CAN_MODE_NOT_KNOWN. */
static int fixed_mode(const struct db_drive_config *drive)
{
	const struct servo_can_drive_options *options = drive->options;

	if (options->allow_mode_change != NO || options->mode == MODE_UNKNOWN)
		return SERVO_CAN_MODE_NOT_KNOWN;
	return (int)options->mode - 1;
}

uint64_t servo_can_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	const struct servo_can_drive_options *options = drive->options;
	/* The motions that are possible on a drive whose mode may not be changed. */
	static const uint64_t moves[] = {
		[SERVO_CAN_MODE_POSITION] = SERVO_CAN_POSITION_MOVES,
		[SERVO_CAN_MODE_SPEED] = DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY),
		[SERVO_CAN_MODE_CURRENT] = DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT),
	};
	int fixed = fixed_mode(drive);
	uint64_t forbidden = 0;

	if (!is_given(bus, &words_group) && !is_given(bus, &move_group))
		forbidden |= SERVO_CAN_POSITION_MOVES;
	if (options->allow_mode_change == NO)
		forbidden |= SERVO_CAN_MOVES &
		             ~(fixed == SERVO_CAN_MODE_NOT_KNOWN ? 0 : moves[fixed]);
	/* It is not documented which part of a position move waits for a sync frame. */
	forbidden |= options->sync == NO ? DB_COMMAND_BIT(DB_CMD_SYNC_START) :
	                                   SERVO_CAN_POSITION_MOVES;
	return forbidden;
}

/* What one step of a command is; where it is not set, as in reports. */
static double command_scale(double given, double reported)
{
	return isnan(given) ? reported : given;
}

enum db_result servo_can_check_command(const struct db_bus_config *bus,
                                       const struct db_drive_config *drive, enum db_command command,
                                       const struct db_args *args)
{
	const struct servo_can_drive_options *options = drive->options;
	bool right = true;

	if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
	    !(SERVO_CAN_COMMANDS & ~servo_can_forbidden(bus, drive) & DB_COMMAND_BIT(command)))
		return DB_RESULT_UNSUPPORTED;
	if (command == DB_CMD_MOVE_VELOCITY)
		right = is_within(
			(double)args->target_velocity /
				command_scale(options->speed_command_scale, options->speed_scale),
			-SERVO_CAN_STEPS_MAX, SERVO_CAN_STEPS_MAX);
	else if (command == DB_CMD_MOVE_CURRENT)
		right = is_within((double)args->target_current /
		                          command_scale(options->current_command_scale,
		                                        options->current_scale),
		                  -SERVO_CAN_STEPS_MAX, SERVO_CAN_STEPS_MAX);
	else if (SERVO_CAN_POSITION_MOVES & DB_COMMAND_BIT(command))
		/* No frame contains the speed of a position move. */
		right = is_within((double)args->target_velocity, 0.0, 0.0);
	return right ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

/* --- a drive's settings ----------------------------------------------------------------------- */

#define SECONDS_PER_MINUTE 60.0

/* Position counts per second at one rpm; 0: not known. */
double servo_can_velocity_counts(const struct db_drive_config *drive)
{
	const struct servo_can_drive_options *options = drive->options;
	double counts = options->counts_per_turn;

	return isnan(counts) ? 0.0 : counts / SECONDS_PER_MINUTE;
}

#define POWER_ON_COUNTS 100.0
#define POWER_ON_TURN 0.01
#define POWER_ON_LEAST 10.0

/* As a mask; 0: the drive has none. */
static uint16_t bit_of(double bit)
{
	return (uint16_t)(bit < 0 ? 0u : 1u << (unsigned)bit);
}

void servo_can_configure(struct db_device *device, struct db_device *first,
                         const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	const struct servo_can_bus_options *bus_options = bus->options;
	const struct servo_can_drive_options *options = drive->options;
	bool fixed = options->allow_mode_change == NO;
	double given = options->power_on_window;
	double turn = options->counts_per_turn;
	double least = isnan(turn) ? POWER_ON_COUNTS : fmax(turn * POWER_ON_TURN, POWER_ON_LEAST);

	DB_NAMEPLATE_INIT(&device->plate, &device->plate_room, SERVO_CAN_PARAM_COUNT);
	device->options = options;
	(void)first;
	device->bus_options = bus_options;
	device->layout = servo_can_read_layout(bus);
	device->node = (uint8_t)drive->address;
	device->may_change_mode = options->allow_mode_change != NO;
	device->fixed_mode = fixed_mode(drive);
	device->torque_clockwise = options->torque_direction == CLOCKWISE;
	device->synchronous = options->sync != NO;
	device->error_is_fault = options->error_bit == ERROR_IS_FAULT;
	device->speed_is_unsigned = options->speed_sign != SIGNED;
	device->uses_reports = options->reports == USE_REPORTS && !device->speed_is_unsigned;
	device->status_inverted = (uint16_t)options->status_inverted;
	device->enabled_bit = bit_of(options->enabled_bit);
	device->fault_bit = bit_of(options->fault_bit);
	device->standstill_bit = bit_of(options->standstill_bit);
	device->moving_bit = bit_of(options->moving_bit);
	device->target_bit = bit_of(options->target_bit);
	device->homed_bit = bit_of(options->homed_bit);
	device->warning_bits = (uint16_t)(bit_of(options->warning_bit) |
	                                  bit_of(options->overload_bit) |
	                                  bit_of(options->limit_bit) | device->fault_bit);
	device->reverse_bit = bit_of(options->reverse_bit);
	device->forward_bit = bit_of(options->forward_bit);
	device->position_reversed = options->position_sign == REVERSED;
	device->move_is_relative = bus_options->move_frame_target == RELATIVE;
	device->speed_reversed = options->speed_scale < 0;
	device->speed_scale = fabs(options->speed_scale);
	device->speed_command_scale = command_scale(options->speed_command_scale,
	                                            options->speed_scale);
	device->current_reversed = options->current_scale < 0;
	device->current_scale = fabs(options->current_scale);
	device->current_command_scale = command_scale(options->current_command_scale,
	                                              options->current_scale);
	device->standstill_speed = (int)(options->standstill_speed / device->speed_scale);
	device->reaction = (db_time)options->reaction_ms * DB_NS_PER_MS;
	device->window = drive->in_position_window * drive->counts_per_unit;
	device->power_window = isnan(given) ?
	                               fmax(drive->in_position_window * drive->counts_per_unit,
	                                    least) :
	                               given * drive->counts_per_unit;
	device->follows_late = options->late_move != DISABLES;
	device->cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	device->profile = (struct servo_can_profile){
		.mode = fixed ? SERVO_CAN_MODE_NOT_KNOWN : (int)options->mode - 1,
		.max_speed = options->max_speed,
		.acceleration = options->ramp_acceleration,
		.deceleration = options->ramp_deceleration,
	};
	device->mode = device->fixed_mode;
}

/* --- what is wrong ---------------------------------------------------------------------------- */

static void check_group(const struct db_bus_config *bus, const struct group *group,
                        db_complain_fn *complain, void *context)
{
	size_t given = count_given(bus, group);

	for (size_t i = 0; i < group->count && given > 0; i++) {
		if (!is_set(bus, group->options[i]))
			complain(context, NULL, true,
			         "%s is missing, but another setting of %s is there; set all or "
			         "none",
			         find_option("bus", group->options[i])->name, group->name);
	}
}

static void check_words(const struct db_bus_config *bus, db_complain_fn *complain, void *context)
{
	const struct servo_can_bus_options *given = bus->options;
	size_t words = count_given(bus, &words_group);

	if (words == 0 && count_given(bus, &move_group) == 0)
		complain(context, NULL, false,
		         "position moves are refused: the frame that starts them is on a missing "
		         "page of the document; set command-word-base, -length, -0-at and -ack "
		         "from the vendor's full manual, or move-frame-base, -length, -at and "
		         "-ack");
	if (words == 0 && (!isnan(given->command_word_1_at) || !isnan(given->command_word_1_base)))
		complain(context, NULL, true,
		         "%s is of no use without command word 0; set command-word-base, -length, "
		         "-0-at and -ack, or remove it",
		         !isnan(given->command_word_1_base) ? "command-word-1-base" :
		                                              "command-word-1-at");
	if (is_given(bus, &word_1_group) && isnan(given->command_word_1_at))
		complain(context, NULL, true,
		         "command-word-1-base needs command-word-1-at, the first byte of the "
		         "word in that frame");
}

static void check_slot(const struct db_bus_config *bus, db_complain_fn *complain, void *context)
{
	const struct servo_can_bus_options *given = bus->options;
	unsigned slot = (unsigned)given->position_slot;

	if (slot == 0)
		return;
	if (is_given(bus, &move_group)) {
		complain(context, NULL, true,
		         "position-slot = %u is for moves through an internal position, but with "
		         "move-frame-base they go through none; remove one of them",
		         slot);
		return;
	}
	if (!is_given(bus, &words_group))
		complain(context, NULL, true,
		         "position-slot = %u is selected by command word 0, whose frame is not "
		         "known; set command-word-base, -length, -0-at and -ack",
		         slot);
	if (count_given(bus, &slot_group) == 0)
		complain(context, NULL, true,
		         "position-slot = %u needs the frame that sets internal position %u; set "
		         "position-slot-base and position-slot-ack",
		         slot, slot);
}

static void check_layout(const struct db_bus_config *bus, db_complain_fn *complain, void *context)
{
	static const char *const keys[] = {
		[SERVO_CAN_DESCRIBED_WORDS] = "command-word-base",
		[SERVO_CAN_DESCRIBED_WORD_1] = "command-word-1-base",
		[SERVO_CAN_DESCRIBED_SLOT] = "position-slot-base",
		[SERVO_CAN_DESCRIBED_MOVE] = "move-frame-base",
	};
	struct servo_can_layout layout = servo_can_read_layout(bus);
	enum servo_can_described which;
	char reason[SERVO_CAN_REASON_MAX];

	if (servo_can_layout_check(&layout, &which, reason) == SERVO_CAN_OK)
		return;
	if (which == SERVO_CAN_DESCRIBED_ACK)
		complain(context, NULL, true, "ack-base = 0x%X cannot be: %s",
		         (unsigned)layout.ack_base, reason);
	else
		complain(context, NULL, true, "%s and what belongs to it cannot be: %s",
		         keys[which], reason);
}

/* A bit may have only one meaning. */
static void check_bits(const struct db_drive_config *drive, db_complain_fn *complain, void *context)
{
	static const size_t bits[] = {
		DRIVE(enabled_bit), DRIVE(fault_bit),   DRIVE(standstill_bit), DRIVE(moving_bit),
		DRIVE(target_bit),  DRIVE(homed_bit),   DRIVE(warning_bit),    DRIVE(overload_bit),
		DRIVE(limit_bit),   DRIVE(reverse_bit), DRIVE(forward_bit),
	};
	const struct servo_can_drive_options *options = drive->options;

	for (size_t i = 0; i < sizeof(bits) / sizeof(bits[0]); i++) {
		int bit = (int)db_option_value(find_option("drive", bits[i]), options);

		for (size_t j = 0; j < i; j++) {
			if (bit < 0 ||
			    (int)db_option_value(find_option("drive", bits[j]), options) != bit)
				continue;
			complain(context, drive, true,
			         "%s = %d is also %s; set one of them to another bit, or to -1 "
			         "where the drive has none",
			         find_option("drive", bits[i])->name, bit,
			         find_option("drive", bits[j])->name);
		}
	}
	if (options->speed_sign != SIGNED && options->reverse_bit < 0 && options->forward_bit < 0)
		complain(context, drive, true,
		         "speed-sign = bits needs reverse-bit or forward-bit; set one of them");
}

static void check_steps(const struct db_drive_config *drive, db_complain_fn *complain,
                        void *context)
{
	static const size_t scales[] = {
		DRIVE(position_command_scale), DRIVE(speed_scale),
		DRIVE(speed_command_scale),    DRIVE(current_scale),
		DRIVE(current_command_scale),
	};

	for (size_t i = 0; i < sizeof(scales) / sizeof(scales[0]); i++) {
		const struct db_option *option = find_option("drive", scales[i]);

		if (fabs(db_option_value(option, drive->options)) <= 0)
			complain(context, drive, true,
			         "%s = 0 makes every value the same; another number", option->name);
	}
}

static void check_scale(const struct db_drive_config *drive, db_complain_fn *complain,
                        void *context)
{
	const struct servo_can_drive_options *options = drive->options;

	if (!isnan(options->counts_per_turn))
		return;
	/* It would be taken for a speed in counts, and allow nearly everything. */
	if (!isnan(drive->max_velocity))
		complain(context, drive, true,
		         "max-velocity is in the user's unit, but the drive's speed is in rpm, "
		         "and how far a turn goes is not known; set counts-per-turn, or remove "
		         "it and set max-speed");
	if (!isnan(drive->max_acceleration))
		complain(context, drive, true,
		         "max-acceleration is in the user's unit, but the drive's ramps are in "
		         "rpm/s; set counts-per-turn, or remove it");
}

static void check_drive(const struct servo_can_layout *layout, const struct db_drive_config *drive,
                        db_complain_fn *complain, void *context)
{
	const struct servo_can_drive_options *options = drive->options;
	enum servo_can_kind taken_for = servo_can_ack_collision(layout, (uint8_t)drive->address);
	bool fixed = options->allow_mode_change == NO;
	bool known = options->mode != MODE_UNKNOWN;

	if (taken_for != SERVO_CAN_FOREIGN)
		complain(context, drive, false,
		         "address %u: the drive's acknowledgements have the id 0x%X, which is %s "
		         "to every drive on the bus; use another address, or set ack-base if the "
		         "drives have another",
		         drive->address, (unsigned)layout->ack_base + drive->address,
		         taken_for == SERVO_CAN_SYNC ? "a sync frame" : "an enable for all");
	if (fixed && !known)
		complain(context, drive, false,
		         "allow-mode-change = no without mode: all moves are refused; set mode to "
		         "what the drive is set to");
	check_bits(drive, complain, context);
	check_steps(drive, complain, context);
	check_scale(drive, complain, context);
	if (isnan(options->ramp_acceleration) != isnan(options->ramp_deceleration))
		complain(context, drive, true,
		         "ramp-acceleration and ramp-deceleration are one frame; set both or "
		         "none");
	if (options->allow_mode_change == NO && !isnan(options->max_speed))
		complain(context, drive, true,
		         "max-speed goes with the mode, which allow-mode-change = no leaves "
		         "alone; remove it, or set it in the drive");
}

void servo_can_check_config(const struct db_bus_config *bus,
                            const struct db_drive_config *const *drives, size_t drive_count,
                            db_complain_fn *complain, void *context)
{
	const struct servo_can_bus_options *given = bus->options;
	struct servo_can_layout layout = servo_can_read_layout(bus);

	check_group(bus, &words_group, complain, context);
	check_group(bus, &word_1_group, complain, context);
	check_group(bus, &slot_group, complain, context);
	check_group(bus, &move_group, complain, context);
	check_words(bus, complain, context);
	check_slot(bus, complain, context);
	check_layout(bus, complain, context);
	if (!(fabs(given->move_frame_scale) > 0))
		complain(context, NULL, true,
		         "move-frame-scale = 0 makes every target the same; "
		         "another number");
	for (size_t i = 0; i < drive_count; i++) {
		check_drive(&layout, drives[i], complain, context);
		/* Servos usually stop some counts away from a target. */
		if ((SERVO_CAN_POSITION_MOVES & ~servo_can_forbidden(bus, drives[i])) != 0 &&
		    drives[i]->in_position_window == 0.0)
			complain(context, drives[i], false,
			         "in-position-window is 0: a position move is done only when the "
			         "drive rests at its target to the count; set what is near "
			         "enough for the machine");
	}
}
