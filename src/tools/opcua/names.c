/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/names.h"

#include <ctype.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

const struct db_opcua_name db_opcua_names[] = {
	{ .reg = "axis_state", .own = true },
	{ .reg = "error", .name = "ErrorCode", .own = true },
	{ .reg = "status", .name = "StatusWord", .own = true },
	{ .reg = "quality", .own = true },
	{ .reg = "active_command", .own = true },
	{ .reg = "age_ms", .own = true },
	{ .reg = "timestamp_us", .own = true },
	{ .reg = "position", .name = "PositionActualValue" },
	{ .reg = "velocity", .name = "VelocityActualValue" },
	{ .reg = "position_units", .name = "PositionActualValueUnits" },
	{ .reg = "velocity_units", .name = "VelocityActualValueUnits" },
	{ .reg = "drive_status", .name = "DriveStatusWord" },
	{ .reg = "current", .name = "CurrentActualValue" },
	{ .reg = "temperature", .name = "ConverterTemperature" },
	{ .reg = "result_id", .own = true },
	{ .reg = "result", .own = true },
	{ .reg = "write_result", .own = true },
	{ .reg = "result_command", .own = true },
	{ .reg = "result_time_us", .own = true },
	{ .reg = "capabilities", .own = true },
	{ .reg = "watchdog_ms", .own = true },
	{ .reg = "watchdog_remaining_ms", .own = true },
	{ .reg = "watchdog_trips", .own = true },
	{ .reg = "control_request", .own = true },
	{ .reg = "control_port", .own = true },
	{ .reg = "control_holder", .own = true },
	{ .reg = "control_remaining_ms", .own = true },
	{ .reg = "result_limit", .own = true },
	{ .reg = "aborted_id", .own = true },
	{ .reg = "motion_id", .own = true },
	{ .reg = "motion_result", .own = true },
	{ .reg = "heartbeat", .own = true },
	{ .reg = "write_result_register", .own = true },
	{ .reg = NULL },
};

static const struct db_opcua_name *find_row(const char *reg)
{
	for (const struct db_opcua_name *row = db_opcua_names; row->reg; row++) {
		if (strcmp(row->reg, reg) == 0)
			return row;
	}
	return NULL;
}

void db_opcua_name_of(const char *reg, char name[DB_OPCUA_NAME_MAX])
{
	const struct db_opcua_name *row = find_row(reg);
	bool begins = true;
	size_t used = 0;

	if (row && row->name) {
		snprintf(name, DB_OPCUA_NAME_MAX, "%s", row->name);
		return;
	}
	for (; *reg && used + 1 < DB_OPCUA_NAME_MAX; reg++) {
		/* Between two digits the underscore is significant: n1_2 is not n12. */
		if (*reg == '_' && !(used > 0 && isdigit((unsigned char)name[used - 1]) &&
		                     isdigit((unsigned char)reg[1]))) {
			begins = true;
			continue;
		}
		name[used++] = begins ? (char)toupper((unsigned char)*reg) : *reg;
		begins = false;
	}
	name[used] = '\0';
}

bool db_opcua_name_is_own(const char *reg)
{
	const struct db_opcua_name *row = find_row(reg);

	return row && row->own;
}
