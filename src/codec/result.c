/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/result.h"

#include <modbus.h>
#include <stddef.h>

/* Exceptions that libmodbus names, and the two gateway codes that Modbus adds. */
static const struct {
	const char *name;
	unsigned char exception;
} results[DB_RESULT_COUNT] = {
	[DB_RESULT_NONE] = { "none", 0 },
	[DB_RESULT_OK] = { "ok", 0 },
	[DB_RESULT_PENDING] = { "pending", MODBUS_EXCEPTION_ACKNOWLEDGE },
	[DB_RESULT_REFUSED] = { "refused", MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE },
	[DB_RESULT_OUT_OF_RANGE] = { "out_of_range", MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE },
	[DB_RESULT_TIMEOUT] = { "timeout", MODBUS_EXCEPTION_GATEWAY_TARGET },
	[DB_RESULT_INDETERMINATE] = { "indeterminate", MODBUS_EXCEPTION_GATEWAY_TARGET },
	[DB_RESULT_RESTARTED] = { "restarted", MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE },
	[DB_RESULT_CANCELLED] = { "cancelled", MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE },
	[DB_RESULT_LIMIT] = { "limit", MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE },
	[DB_RESULT_LATCHED] = { "latched", MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE },
	[DB_RESULT_UNSUPPORTED] = { "unsupported", MODBUS_EXCEPTION_ILLEGAL_FUNCTION },
	[DB_RESULT_BUSY] = { "busy", MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY },
	[DB_RESULT_BUS_DOWN] = { "bus_down", MODBUS_EXCEPTION_GATEWAY_PATH },
	[DB_RESULT_OFFLINE] = { "offline", MODBUS_EXCEPTION_GATEWAY_TARGET },
	[DB_RESULT_FAILED] = { "failed", MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE },
	[DB_RESULT_RATE_LIMITED] = { "rate_limited", MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE },
	[DB_RESULT_NOT_IN_CONTROL] = { "not_in_control", MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY },
	[DB_RESULT_UNPROVEN] = { "unproven", 0 },
	[DB_RESULT_RUNS_ON] = { "runs_on", MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE },
};

const char *db_result_name(enum db_result result)
{
	return (size_t)result < DB_RESULT_COUNT ? results[result].name : "unknown";
}

unsigned char db_result_exception(enum db_result result)
{
	return (size_t)result < DB_RESULT_COUNT ? results[result].exception :
	                                          MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE;
}

bool db_result_is_success(enum db_result result)
{
	return result == DB_RESULT_OK || result == DB_RESULT_UNPROVEN;
}
