/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/command_table.h"

#include <string.h>

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

static const struct {
	size_t offset;
	size_t bytes;
} args[DB_ARG_COUNT] = {
#define ARG(member)                                                                     \
	{                                                                               \
		offsetof(struct db_args, member), sizeof(((struct db_args *)0)->member) \
	}
	[DB_ARG_TARGET_POSITION] = ARG(target_position),
	[DB_ARG_TARGET_VELOCITY] = ARG(target_velocity),
	[DB_ARG_OUTPUT_NUMBER] = ARG(output_number),
	[DB_ARG_OUTPUT_VALUE] = ARG(output_value),
	[DB_ARG_OUTPUT_MASK] = ARG(output_mask),
	[DB_ARG_OUTPUT_LEVELS] = ARG(output_levels),
	[DB_ARG_SHAKE_START_POSITION] = ARG(shake_start_position),
	[DB_ARG_SHAKE_END_POSITION] = ARG(shake_end_position),
	[DB_ARG_SHAKE_FREQUENCY] = ARG(shake_frequency),
	[DB_ARG_SHAKE_CYCLES] = ARG(shake_cycles),
	[DB_ARG_SHAKE_TIME] = ARG(shake_time),
	[DB_ARG_TARGET_CURRENT] = ARG(target_current),
	[DB_ARG_PROGRAM_NUMBER] = ARG(program_number),
	[DB_ARG_PROGRAM_DELAY] = ARG(program_delay),
	[DB_ARG_RAW_LENGTH] = ARG(raw_length),
	[DB_ARG_RAW_REQUEST] = ARG(raw_request),
#undef ARG
};

const struct db_command_row db_command_rows[] = {
	{
		.code = DB_CMD_ENABLE,
		.name = "enable",
		.description = "Power the motor",
	},
	{
		.code = DB_CMD_DISABLE,
		.name = "disable",
		.description = "Take the power off the motor; some drives lose their origin by it; "
			       "always executes",
	},
	{
		.code = DB_CMD_STOP,
		.name = "stop",
		.description = "Decelerate to standstill; overtakes everything and cancels what is "
			       "queued for the drive; always executes",
	},
	{
		.code = DB_CMD_QUICK_STOP,
		.name = "quick_stop",
		.description = "The fastest stop the drive has; otherwise like stop",
	},
	{
		.code = DB_CMD_MOVE_VELOCITY,
		.name = "move_velocity",
		.args = { DB_ARG_TARGET_VELOCITY },
		.description = "Run at target_velocity; its sign is the direction",
	},
	{
		.code = DB_CMD_MOVE_ABSOLUTE,
		.name = "move_absolute",
		.args = { DB_ARG_TARGET_POSITION, DB_ARG_TARGET_VELOCITY },
		.description =
			"Go to target_position; target_velocity 0 = at the drive's preset speed",
	},
	{
		.code = DB_CMD_MOVE_RELATIVE,
		.name = "move_relative",
		.args = { DB_ARG_TARGET_POSITION, DB_ARG_TARGET_VELOCITY },
		.description = "Go the distance target_position from where the drive is; "
			       "target_velocity 0 = at the drive's preset speed",
	},
	{
		.code = DB_CMD_HOME,
		.name = "home",
		.description = "Find the origin the way the drive's parameters say",
	},
	{
		.code = DB_CMD_HOME_STOP,
		.name = "home_stop",
		.description = "End a homing",
	},
	{
		.code = DB_CMD_SET_POSITION,
		.name = "set_position",
		.args = { DB_ARG_TARGET_POSITION },
		.description = "Make the present position count as target_position; nothing moves",
	},
	{
		.code = DB_CMD_CLEAR_FAULT,
		.name = "clear_fault",
		.description =
			"Clear the drive's faults; and in every family the latch of the watchdog",
	},
	{
		.code = DB_CMD_SAVE_PARAMETERS,
		.name = "save_parameters",
		.description =
			"Write the parameters into the drive's flash memory; wears it and is "
			"limited in rate",
	},
	{
		.code = DB_CMD_READ_PARAMETERS,
		.name = "read_parameters",
		.description = "Read identity and all parameters from the drive again",
	},
	{
		.code = DB_CMD_MOVE_PRESET,
		.name = "move_preset",
		.own = true,
		.description = "Run at the preset speed that is a parameter of the drive",
	},
	{
		.code = DB_CMD_SET_OUTPUT,
		.name = "set_output",
		.args = { DB_ARG_OUTPUT_NUMBER, DB_ARG_OUTPUT_VALUE },
		.own = true,
		.description = "Set output port output_number (from 1) to output_value 0 or 1",
	},
	{
		.code = DB_CMD_SET_OUTPUTS,
		.name = "set_outputs",
		.args = { DB_ARG_OUTPUT_MASK, DB_ARG_OUTPUT_LEVELS },
		.own = true,
		.description = "Set the output ports chosen by output_mask to output_levels; "
			       "bit 0 = port 1",
	},
	{
		.code = DB_CMD_SET_SV,
		.name = "set_sv",
		.args = { DB_ARG_OUTPUT_NUMBER, DB_ARG_OUTPUT_VALUE },
		.own = true,
		.description = "Drive port output_number (1..3) for an inductive load with duty "
			       "output_value (0..255)",
	},
	{
		.code = DB_CMD_SET_NMOS,
		.name = "set_nmos",
		.args = { DB_ARG_OUTPUT_NUMBER, DB_ARG_OUTPUT_VALUE },
		.own = true,
		.description = "Drive port output_number (1..3) for a resistive load with duty "
			       "output_value (0..255)",
	},
	{
		.code = DB_CMD_SHAKE_START,
		.name = "shake_start",
		.args = { DB_ARG_SHAKE_START_POSITION, DB_ARG_SHAKE_END_POSITION,
	                  DB_ARG_SHAKE_FREQUENCY, DB_ARG_SHAKE_CYCLES },
		.own = true,
		.description =
			"Swing between two positions for shake_cycles cycles; 0 = until stopped",
	},
	{
		.code = DB_CMD_SHAKE_START_TIME,
		.name = "shake_start_time",
		.args = { DB_ARG_SHAKE_START_POSITION, DB_ARG_SHAKE_END_POSITION,
	                  DB_ARG_SHAKE_FREQUENCY, DB_ARG_SHAKE_TIME },
		.own = true,
		.description =
			"Swing between two positions for shake_time seconds; 0 = until stopped",
	},
	{
		.code = DB_CMD_SHAKE_STOP,
		.name = "shake_stop",
		.own = true,
		.description = "End the swinging",
	},
	{
		.code = DB_CMD_MOVE_CURRENT,
		.name = "move_current",
		.args = { DB_ARG_TARGET_CURRENT },
		.own = true,
		.description = "Drive the motor with target_current; its sign is the direction of "
			       "the torque",
	},
	{
		.code = DB_CMD_JOG_POSITIVE,
		.name = "jog_positive",
		.own = true,
		.description =
			"Run in positive direction at the drive's manual speed until stopped",
	},
	{
		.code = DB_CMD_JOG_NEGATIVE,
		.name = "jog_negative",
		.own = true,
		.description =
			"Run in negative direction at the drive's manual speed until stopped",
	},
	{
		.code = DB_CMD_START_PROGRAM,
		.name = "start_program",
		.args = { DB_ARG_PROGRAM_NUMBER, DB_ARG_PROGRAM_DELAY },
		.own = true,
		.description =
			"Start a program that is stored in the controller after program_delay",
	},
	{
		.code = DB_CMD_PAUSE_PROGRAM,
		.name = "pause_program",
		.own = true,
		.description = "Stop the running program so that it can go on",
	},
	{
		.code = DB_CMD_CONTINUE_PROGRAM,
		.name = "continue_program",
		.own = true,
		.description = "Go on with a stopped program",
	},
	{
		.code = DB_CMD_END_PROGRAM,
		.name = "end_program",
		.own = true,
		.description = "End a stopped program",
	},
	{
		.code = DB_CMD_SINGLE_STEP,
		.name = "single_step",
		.args = { DB_ARG_OUTPUT_VALUE },
		.own = true,
		.description = "Run programs step by step: output_value 1=on 0=off",
	},
	{
		.code = DB_CMD_SYNC_START,
		.name = "sync_start",
		.own = true,
		.description = "One sync frame to the whole bus: what was staged on drives in sync "
			       "mode begins on all of them at once",
	},
	{
		.code = DB_CMD_RAW_FRAME,
		.name = "raw_frame",
		.args = { DB_ARG_RAW_LENGTH, DB_ARG_RAW_REQUEST },
		.own = true,
		.description =
			"One frame of the drive's own protocol, never repeated by the bridge; "
			"the answer is in raw_answer; only with raw-frames = on",
	},
};

const size_t db_command_row_count = COUNT_OF(db_command_rows);

size_t db_arg_offset(enum db_arg arg)
{
	return args[arg].offset;
}

size_t db_arg_bytes(enum db_arg arg)
{
	return args[arg].bytes;
}

const struct db_command_row *db_command_find(unsigned code)
{
	for (size_t i = 0; i < COUNT_OF(db_command_rows); i++) {
		if ((unsigned)db_command_rows[i].code == code)
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
		size_t offset = args[row->args[i]].offset;

		if (memcmp((const char *)a + offset, (const char *)b + offset,
		           args[row->args[i]].bytes) != 0)
			return false;
	}
	return row != NULL;
}

/* --- what kind of command is which ---------------------------------------------------------------- */

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
