/* SPDX-License-Identifier: Apache-2.0 */
/* What the codes of axis.h and command.h are called, and which commands are stops and motions. */
#include "drivebridge/axis.h"
#include "drivebridge/command.h"

const char *db_axis_state_name(enum db_axis_state state)
{
	static const char *const names[DB_AXIS_STATE_COUNT] = {
		[DB_AXIS_OFFLINE] = "Offline",
		[DB_AXIS_DISABLED] = "Disabled",
		[DB_AXIS_STANDSTILL] = "Standstill",
		[DB_AXIS_DISCRETE_MOTION] = "DiscreteMotion",
		[DB_AXIS_CONTINUOUS_MOTION] = "ContinuousMotion",
		[DB_AXIS_HOMING] = "Homing",
		[DB_AXIS_STOPPING] = "Stopping",
		[DB_AXIS_ERROR_STOP] = "ErrorStop",
	};

	return (unsigned)state < DB_AXIS_STATE_COUNT ? names[state] : "unknown";
}

const char *db_status_bit_name(unsigned bit)
{
	static const char *const names[] = {
		"online",   "enabled", "homed", "moving",  "at_target",   "homing",       "stopping", "error",
		"warning",  "busy",    "latched", "origin_lost", "params_valid", "bus_up", "refused",
	};

	return bit < sizeof names / sizeof names[0] ? names[bit] : NULL;
}

const char *db_error_name(uint16_t error)
{
	switch (error) {
	case DB_ERROR_NONE:
		return "none";
	case DB_ERROR_NO_ANSWER:
		return "no_answer";
	case DB_ERROR_BUS_DOWN:
		return "bus_down";
	case DB_ERROR_CLIENT_LOSS:
		return "client_loss";
	case DB_ERROR_HARDWARE:
		return "hardware";
	case DB_ERROR_FLASH:
		return "flash";
	case DB_ERROR_ENCODER:
		return "encoder";
	case DB_ERROR_OVER_TEMPERATURE:
		return "over_temperature";
	case DB_ERROR_OVER_CURRENT:
		return "over_current";
	case DB_ERROR_VOLTAGE:
		return "voltage";
	default:
		return "unknown";
	}
}

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
	case DB_CMD_HOME:
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		return true;
	default:
		return false;
	}
}
