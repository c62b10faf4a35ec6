/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/command_table.h"

#include <string.h>

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

const struct db_arg_row db_arg_rows[DB_ARG_COUNT] = {
#define ARG(member, type)                                                                         \
	{                                                                                         \
		offsetof(struct db_args, member), sizeof(((struct db_args *)0)->member), #member, \
			type                                                                      \
	}
	[DB_ARG_NONE] = { 0, 0, "", DB_TEXT },
	[DB_ARG_TARGET_POSITION] = ARG(target_position, DB_I32),
	[DB_ARG_TARGET_VELOCITY] = ARG(target_velocity, DB_F32),
	[DB_ARG_OUTPUT_NUMBER] = ARG(output_number, DB_U16),
	[DB_ARG_OUTPUT_VALUE] = ARG(output_value, DB_U16),
	[DB_ARG_OUTPUT_MASK] = ARG(output_mask, DB_U16),
	[DB_ARG_OUTPUT_LEVELS] = ARG(output_levels, DB_U16),
	[DB_ARG_SHAKE_START_POSITION] = ARG(shake_start_position, DB_I32),
	[DB_ARG_SHAKE_END_POSITION] = ARG(shake_end_position, DB_I32),
	[DB_ARG_SHAKE_FREQUENCY] = ARG(shake_frequency, DB_F32),
	[DB_ARG_SHAKE_CYCLES] = ARG(shake_cycles, DB_U32),
	[DB_ARG_SHAKE_TIME] = ARG(shake_time, DB_U32),
	[DB_ARG_TARGET_CURRENT] = ARG(target_current, DB_F32),
	[DB_ARG_PROGRAM_NUMBER] = ARG(program_number, DB_U16),
	[DB_ARG_PROGRAM_DELAY] = ARG(program_delay, DB_U16),
	[DB_ARG_RAW_LENGTH] = ARG(raw_length, DB_U16),
	[DB_ARG_RAW_REQUEST] = ARG(raw_request, DB_U16),
#undef ARG
};

// clang-format off
/* Commands that every family could have, and those of some families by their nature. */
#define ALL false
#define OWN true
#define NO_ARGS { DB_ARG_NONE }
#define ARGS1(a) { DB_ARG_##a }
#define ARGS2(a, b) { DB_ARG_##a, DB_ARG_##b }
#define ARGS4(a, b, c, d) { DB_ARG_##a, DB_ARG_##b, DB_ARG_##c, DB_ARG_##d }

const struct db_command_row db_command_rows[] = {
	{ DB_CMD_ENABLE,            "enable",           ALL, NO_ARGS,
	  "Power the motor" },
	{ DB_CMD_DISABLE,           "disable",          ALL, NO_ARGS,
	  "Take the power off the motor; some drives lose their origin by it; always executes" },
	{ DB_CMD_STOP,              "stop",             ALL, NO_ARGS,
	  "Decelerate to standstill; overtakes everything and cancels what is queued for the "
	  "drive; always executes" },
	{ DB_CMD_QUICK_STOP,        "quick_stop",       ALL, NO_ARGS,
	  "The fastest stop the drive has; otherwise like stop" },
	{ DB_CMD_MOVE_VELOCITY,     "move_velocity",    ALL, ARGS1(TARGET_VELOCITY),
	  "Run at target_velocity; its sign is the direction" },
	{ DB_CMD_MOVE_ABSOLUTE,     "move_absolute",    ALL,
	  ARGS2(TARGET_POSITION, TARGET_VELOCITY),
	  "Go to target_position; target_velocity 0 = at the drive's preset speed" },
	{ DB_CMD_MOVE_RELATIVE,     "move_relative",    ALL,
	  ARGS2(TARGET_POSITION, TARGET_VELOCITY),
	  "Go the distance target_position from where the drive is; target_velocity 0 = at the "
	  "drive's preset speed" },
	{ DB_CMD_HOME,              "home",             ALL, NO_ARGS,
	  "Find the origin the way the drive's parameters say" },
	{ DB_CMD_HOME_STOP,         "home_stop",        ALL, NO_ARGS,
	  "End a homing" },
	{ DB_CMD_SET_POSITION,      "set_position",     ALL, ARGS1(TARGET_POSITION),
	  "Make the present position count as target_position; nothing moves" },
	{ DB_CMD_CLEAR_FAULT,       "clear_fault",      ALL, NO_ARGS,
	  "Clear the drive's faults; and in every family the latch of the watchdog" },
	{ DB_CMD_SAVE_PARAMETERS,   "save_parameters",  ALL, NO_ARGS,
	  "Write the parameters into the drive's flash memory; wears it and is limited in rate" },
	{ DB_CMD_READ_PARAMETERS,   "read_parameters",  ALL, NO_ARGS,
	  "Read identity and all parameters from the drive again" },
	{ DB_CMD_MOVE_PRESET,       "move_preset",      OWN, NO_ARGS,
	  "Run at the preset speed that is a parameter of the drive" },
	{ DB_CMD_SET_OUTPUT,        "set_output",       OWN, ARGS2(OUTPUT_NUMBER, OUTPUT_VALUE),
	  "Set output port output_number (from 1) to output_value 0 or 1" },
	{ DB_CMD_SET_OUTPUTS,       "set_outputs",      OWN, ARGS2(OUTPUT_MASK, OUTPUT_LEVELS),
	  "Set the output ports chosen by output_mask to output_levels; bit 0 = port 1" },
	{ DB_CMD_SET_SV,            "set_sv",           OWN, ARGS2(OUTPUT_NUMBER, OUTPUT_VALUE),
	  "Drive port output_number (1..3) for an inductive load with duty output_value (0..255)" },
	{ DB_CMD_SET_NMOS,          "set_nmos",         OWN, ARGS2(OUTPUT_NUMBER, OUTPUT_VALUE),
	  "Drive port output_number (1..3) for a resistive load with duty output_value (0..255)" },
	{ DB_CMD_SHAKE_START,       "shake_start",      OWN,
	  ARGS4(SHAKE_START_POSITION, SHAKE_END_POSITION, SHAKE_FREQUENCY, SHAKE_CYCLES),
	  "Swing between two positions for shake_cycles cycles; 0 = until stopped" },
	{ DB_CMD_SHAKE_START_TIME,  "shake_start_time", OWN,
	  ARGS4(SHAKE_START_POSITION, SHAKE_END_POSITION, SHAKE_FREQUENCY, SHAKE_TIME),
	  "Swing between two positions for shake_time seconds; 0 = until stopped" },
	{ DB_CMD_SHAKE_STOP,        "shake_stop",       OWN, NO_ARGS,
	  "End the swinging" },
	{ DB_CMD_MOVE_CURRENT,      "move_current",     OWN, ARGS1(TARGET_CURRENT),
	  "Drive the motor with target_current; its sign is the direction of the torque" },
	{ DB_CMD_JOG_POSITIVE,      "jog_positive",     OWN, NO_ARGS,
	  "Run in positive direction at the drive's manual speed until stopped" },
	{ DB_CMD_JOG_NEGATIVE,      "jog_negative",     OWN, NO_ARGS,
	  "Run in negative direction at the drive's manual speed until stopped" },
	{ DB_CMD_START_PROGRAM,     "start_program",    OWN, ARGS2(PROGRAM_NUMBER, PROGRAM_DELAY),
	  "Start a program that is stored in the controller after program_delay" },
	{ DB_CMD_PAUSE_PROGRAM,     "pause_program",    OWN, NO_ARGS,
	  "Stop the running program so that it can go on" },
	{ DB_CMD_CONTINUE_PROGRAM,  "continue_program", OWN, NO_ARGS,
	  "Go on with a stopped program" },
	{ DB_CMD_END_PROGRAM,       "end_program",      OWN, NO_ARGS,
	  "End a stopped program" },
	{ DB_CMD_SINGLE_STEP,       "single_step",      OWN, ARGS1(OUTPUT_VALUE),
	  "Run programs step by step: output_value 1=on 0=off" },
	{ DB_CMD_SYNC_START,        "sync_start",       OWN, NO_ARGS,
	  "One sync frame to the whole bus: what was staged on drives in sync mode begins on all "
	  "of them at once" },
	{ DB_CMD_RAW_FRAME,         "raw_frame",        OWN, ARGS2(RAW_LENGTH, RAW_REQUEST),
	  "One frame of the drive's own protocol, never repeated by the bridge; the answer is in "
	  "raw_answer; only with raw-frames = on" },
};
// clang-format on

const size_t db_command_row_count = COUNT_OF(db_command_rows);

const struct db_command_row *db_command_find(unsigned code)
{
	for (size_t i = 0; i < COUNT_OF(db_command_rows); i++) {
		if ((unsigned)db_command_rows[i].code == code)
			return &db_command_rows[i];
	}
	return NULL;
}

const struct db_command_row *db_command_find_name(const char *name)
{
	for (size_t i = 0; i < COUNT_OF(db_command_rows); i++) {
		if (strcmp(db_command_rows[i].name, name) == 0)
			return &db_command_rows[i];
	}
	return NULL;
}

const char *db_command_name(unsigned code)
{
	const struct db_command_row *row = db_command_find(code);

	if (row)
		return row->name;
	return code == DB_CMD_NONE ? "none" : "unknown";
}

bool db_command_same_args(unsigned code, const struct db_args *a, const struct db_args *b)
{
	const struct db_command_row *row = db_command_find(code);

	for (size_t i = 0; row && i < DB_COMMAND_ARGS_MAX && row->args[i] != DB_ARG_NONE; i++) {
		size_t offset = db_arg_rows[row->args[i]].offset;

		if (memcmp((const char *)a + offset, (const char *)b + offset,
		           db_arg_rows[row->args[i]].bytes) != 0)
			return false;
	}
	return row != NULL;
}

/* --- what kind of command is which ------------------------------------------------------------ */

bool db_command_is_stop(enum db_command command)
{
	return command == DB_CMD_STOP || command == DB_CMD_QUICK_STOP || command == DB_CMD_DISABLE;
}

bool db_command_is_motion(enum db_command command)
{
	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
	case DB_CMD_MOVE_PRESET:
	case DB_CMD_MOVE_CURRENT:
	case DB_CMD_JOG_POSITIVE:
	case DB_CMD_JOG_NEGATIVE:
	case DB_CMD_START_PROGRAM:
	case DB_CMD_CONTINUE_PROGRAM:
	case DB_CMD_SYNC_START:
	case DB_CMD_HOME:
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		return true;
	default:
		return false;
	}
}

bool db_command_may_move(enum db_command command)
{
	return db_command_is_motion(command) || command == DB_CMD_RAW_FRAME;
}

bool db_command_ends_motion(enum db_command command)
{
	return db_command_is_motion(command) || db_command_is_stop(command) ||
	       command == DB_CMD_HOME_STOP || command == DB_CMD_SHAKE_STOP;
}

bool db_command_replaces_motion(enum db_command command)
{
	return db_command_ends_motion(command) && !db_command_is_stop(command);
}

const char *db_stand_cause_name(unsigned cause)
{
	static const char *const names[DB_STAND_COUNT] = {
		[DB_STAND_FREE] = "none",         [DB_STAND_CLIENT] = "client",
		[DB_STAND_WATCHDOG] = "watchdog", [DB_STAND_HOLD] = "hold",
		[DB_STAND_LIMIT] = "limit",       [DB_STAND_FAULT] = "fault",
		[DB_STAND_EXIT] = "exit",         [DB_STAND_MOTION] = "motion",
		[DB_STAND_RESTART] = "restart",
	};

	return cause < DB_STAND_COUNT ? names[cause] : "unknown";
}

enum db_command db_on_loss_command(enum db_on_loss reaction)
{
	switch (reaction) {
	case DB_ON_LOSS_STOP:
		return DB_CMD_STOP;
	case DB_ON_LOSS_QUICK_STOP:
		return DB_CMD_QUICK_STOP;
	case DB_ON_LOSS_DISABLE:
		return DB_CMD_DISABLE;
	case DB_ON_LOSS_NONE:
	default:
		return DB_CMD_NONE;
	}
}
