/* SPDX-License-Identifier: Apache-2.0 */
/* Names of the codes that the axis shows. */
#include "drivebridge/axis.h"

#include "drivebridge/driver.h"

#define COUNT_OF(array) (sizeof(array) / sizeof((array)[0]))

static const char *const state_names[DB_AXIS_STATE_COUNT] = {
	[DB_AXIS_OFFLINE] = "Offline",
	[DB_AXIS_DISABLED] = "Disabled",
	[DB_AXIS_STANDSTILL] = "Standstill",
	[DB_AXIS_DISCRETE_MOTION] = "DiscreteMotion",
	[DB_AXIS_CONTINUOUS_MOTION] = "ContinuousMotion",
	[DB_AXIS_HOMING] = "Homing",
	[DB_AXIS_STOPPING] = "Stopping",
	[DB_AXIS_ERROR_STOP] = "ErrorStop",
};

static const char *const error_names[] = {
	[DB_ERROR_NONE] = "none",
	[DB_ERROR_NO_ANSWER] = "no_answer",
	[DB_ERROR_BUS_DOWN] = "bus_down",
	[DB_ERROR_CLIENT_LOSS] = "client_loss",
	[DB_ERROR_RUNS_ON] = "runs_on",
	[DB_ERROR_HARDWARE] = "hardware",
	[DB_ERROR_FLASH] = "flash",
	[DB_ERROR_ENCODER] = "encoder",
	[DB_ERROR_OVER_TEMPERATURE] = "over_temperature",
	[DB_ERROR_OVER_CURRENT] = "over_current",
	[DB_ERROR_VOLTAGE] = "voltage",
	[DB_ERROR_INTERRUPTED] = "interrupted",
	[DB_ERROR_UNEXPLAINED_FAULT] = "unexplained_fault",
};

/*
 * By bit number. They are also the names of discrete inputs, which share one name space with the
 * registers: DB_STATUS_ERROR is error_stop because `error` is a register.
 */
static const char *const status_names[DB_STATUS_BIT_COUNT] = {
	"online",  "enabled",     "homed",          "moving",     "at_target",
	"homing",  "stopping",    "error_stop",     "warning",    "busy",
	"latched", "origin_lost", "params_valid",   "bus_up",     "refused",
	"done",    "aborted",     "params_unsaved", "must_stand",
};

const char *db_axis_state_name(enum db_axis_state state)
{
	return (size_t)state < DB_AXIS_STATE_COUNT ? state_names[state] : "unknown";
}

const char *db_error_name(uint16_t error)
{
	const struct db_drive_fault *fault = db_driver_fault(error);

	if (fault)
		return fault->name;
	return error < COUNT_OF(error_names) && error_names[error] ? error_names[error] : "unknown";
}

const char *db_status_bit_name(unsigned bit)
{
	return bit < DB_STATUS_BIT_COUNT ? status_names[bit] : "unknown";
}
