/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "drivebridge/axis.h"
#include "drivebridge/command.h"

/* A capability is set when the family has one of the commands or measures. Append, never
 * renumber. */
static const struct {
	const char *name;
	uint64_t commands;
	unsigned measures;
} capabilities[DB_CAPABILITY_COUNT] = {
	{ "move_velocity", DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY), 0 },
	{ "move_absolute", DB_COMMAND_BIT(DB_CMD_MOVE_ABSOLUTE), 0 },
	{ "move_relative", DB_COMMAND_BIT(DB_CMD_MOVE_RELATIVE), 0 },
	{ "home", DB_COMMAND_BIT(DB_CMD_HOME), 0 },
	{ "set_position", DB_COMMAND_BIT(DB_CMD_SET_POSITION), 0 },
	{ "clear_fault", DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT), 0 },
	{ "read_parameters", DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS), 0 },
	{ "save_parameters", DB_COMMAND_BIT(DB_CMD_SAVE_PARAMETERS), 0 },
	{ "inputs", 0, DB_MEASURE_INPUTS },
	{ "outputs", DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) | DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS), 0 },
	{ "pwm", DB_COMMAND_BIT(DB_CMD_SET_SV) | DB_COMMAND_BIT(DB_CMD_SET_NMOS), 0 },
	{ "shake", DB_COMMAND_BIT(DB_CMD_SHAKE_START) | DB_COMMAND_BIT(DB_CMD_SHAKE_START_TIME),
	  0 },
	{ "move_preset", DB_COMMAND_BIT(DB_CMD_MOVE_PRESET), 0 },
	{ "programs", 0, DB_MEASURE_PROGRAM },
	{ "measures_current", 0, DB_MEASURE_CURRENT },
	{ "move_current", DB_COMMAND_BIT(DB_CMD_MOVE_CURRENT), 0 },
	{ "sync_start", DB_COMMAND_BIT(DB_CMD_SYNC_START), 0 },
	{ "raw_frame", DB_COMMAND_BIT(DB_CMD_RAW_FRAME), 0 },
	{ "measures_velocity", 0, DB_MEASURE_VELOCITY },
};

uint32_t db_capabilities(uint64_t commands, unsigned measures)
{
	uint32_t bits = 0;

	for (size_t i = 0; i < DB_CAPABILITY_COUNT; i++) {
		if ((commands & capabilities[i].commands) || (measures & capabilities[i].measures))
			bits |= UINT32_C(1) << i;
	}
	return bits;
}

const char *db_capability_name(unsigned bit)
{
	return bit < DB_CAPABILITY_COUNT ? capabilities[bit].name : "unknown";
}
