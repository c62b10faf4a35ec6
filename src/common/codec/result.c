/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/result.h"

#include <stddef.h>

static const char *const names[DB_RESULT_COUNT] = {
	[DB_RESULT_NONE] = "none",
	[DB_RESULT_OK] = "ok",
	[DB_RESULT_PENDING] = "pending",
	[DB_RESULT_REFUSED] = "refused",
	[DB_RESULT_OUT_OF_RANGE] = "out_of_range",
	[DB_RESULT_TIMEOUT] = "timeout",
	[DB_RESULT_INDETERMINATE] = "indeterminate",
	[DB_RESULT_RESTARTED] = "restarted",
	[DB_RESULT_CANCELLED] = "cancelled",
	[DB_RESULT_LIMIT] = "limit",
	[DB_RESULT_LATCHED] = "latched",
	[DB_RESULT_UNSUPPORTED] = "unsupported",
	[DB_RESULT_BUSY] = "busy",
	[DB_RESULT_BUS_DOWN] = "bus_down",
	[DB_RESULT_OFFLINE] = "offline",
	[DB_RESULT_FAILED] = "failed",
	[DB_RESULT_RATE_LIMITED] = "rate_limited",
	[DB_RESULT_NOT_IN_CONTROL] = "not_in_control",
	[DB_RESULT_UNPROVEN] = "unproven",
	[DB_RESULT_RUNS_ON] = "runs_on",
	[DB_RESULT_LINE_MOVES] = "line_moves",
};

const char *db_result_name(enum db_result result)
{
	return (size_t)result < DB_RESULT_COUNT ? names[result] : "unknown";
}

bool db_result_is_success(enum db_result result)
{
	return result == DB_RESULT_OK || result == DB_RESULT_UNPROVEN;
}
