/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "drivebridge/server.h"

#include <modbus.h>
#include <stddef.h>

static const uint8_t exceptions[DB_RESULT_COUNT] = {
	[DB_RESULT_NONE] = 0,
	[DB_RESULT_OK] = 0,
	[DB_RESULT_PENDING] = MODBUS_EXCEPTION_ACKNOWLEDGE,
	[DB_RESULT_REFUSED] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE,
	[DB_RESULT_OUT_OF_RANGE] = MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE,
	[DB_RESULT_TIMEOUT] = MODBUS_EXCEPTION_GATEWAY_TARGET,
	[DB_RESULT_INDETERMINATE] = MODBUS_EXCEPTION_GATEWAY_TARGET,
	[DB_RESULT_RESTARTED] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE,
	[DB_RESULT_CANCELLED] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE,
	[DB_RESULT_LIMIT] = MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE,
	[DB_RESULT_LATCHED] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE,
	[DB_RESULT_UNSUPPORTED] = MODBUS_EXCEPTION_ILLEGAL_FUNCTION,
	[DB_RESULT_BUSY] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY,
	[DB_RESULT_BUS_DOWN] = MODBUS_EXCEPTION_GATEWAY_PATH,
	[DB_RESULT_OFFLINE] = MODBUS_EXCEPTION_GATEWAY_TARGET,
	[DB_RESULT_FAILED] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE,
	[DB_RESULT_RATE_LIMITED] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE,
	[DB_RESULT_NOT_IN_CONTROL] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY,
	[DB_RESULT_UNPROVEN] = 0,
	[DB_RESULT_RUNS_ON] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE,
	[DB_RESULT_LINE_MOVES] = MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY,
};

uint8_t db_exception_of(enum db_result result)
{
	return (size_t)result < DB_RESULT_COUNT ? exceptions[result] :
	                                          MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE;
}

enum db_result db_exception_result(uint8_t exception)
{
	static const enum db_result likely[] = {
		DB_RESULT_OK,   DB_RESULT_PENDING,  DB_RESULT_OUT_OF_RANGE, DB_RESULT_UNSUPPORTED,
		DB_RESULT_BUSY, DB_RESULT_BUS_DOWN, DB_RESULT_OFFLINE,
	};

	/* No result has this one of its own: the drive has no such register. */
	if (exception == MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS)
		return DB_RESULT_UNSUPPORTED;
	for (size_t i = 0; i < sizeof(likely) / sizeof(likely[0]); i++) {
		if (exceptions[likely[i]] == exception)
			return likely[i];
	}
	return DB_RESULT_FAILED;
}

int db_exception_of_answer(struct db_write_answer answer)
{
	return answer.later ? DB_WRITE_LATER : db_exception_of(answer.result);
}

uint8_t db_exception_unreachable(const struct db_feedback *feedback)
{
	return feedback->status & DB_STATUS_BUS_UP ? MODBUS_EXCEPTION_GATEWAY_TARGET :
	                                             MODBUS_EXCEPTION_GATEWAY_PATH;
}
