/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "regmap/clients.h"
#include "regmap/group.h"

#include <modbus.h>

/* Indexed by the value of group_stop and group_stop_units. */
static const enum db_command group_stops[] = { DB_CMD_NONE, DB_CMD_STOP, DB_CMD_QUICK_STOP,
	                                       DB_CMD_DISABLE };

#define GROUP_STOPS (sizeof(group_stops) / sizeof(group_stops[0]))

/*
 * A PLC that uses only this unit is alive for every drive of its endpoint that waits for a
 * heartbeat, as if it had written a new one there. For drives that another client controls it has
 * no effect, which is no error.
 */
static int write_gateway_heartbeat(const struct db_registers *registers,
                                   const struct db_view_space *space,
                                   const struct db_client *client, uint16_t value)
{
	db_time now = registers->ops->now(registers->context);

	space->own->heartbeat = value;
	for (size_t i = 0; i < space->drive_count; i++) {
		struct db_view_drive *drive = space->drives[i];

		if (drive->config->watchdog_feed != DB_FEED_HEARTBEAT ||
		    !db_control_holds(&drive->control, client, now) ||
		    !db_heartbeat_write(&drive->gateway_heartbeat, client->address, value))
			continue;
		db_control_hear(&drive->control, client, db_client_arrived(client, now), now);
		db_clients_feed(drive, client, DB_FEED_HEARTBEAT);
	}
	return 0;
}

int db_gateway_write(struct db_registers *registers, const struct db_view_space *space,
                     const struct db_client *client, enum db_table table, uint16_t address,
                     uint16_t count, const uint16_t *values, struct db_write_token token)
{
	struct db_span span;
	uint8_t exception;

	if (table != DB_TABLE_HOLDING)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	exception = db_span_find(&space->gateway.holding, address, count, &span);
	if (exception)
		return exception;
	if (!db_clients_permit_gateway(registers, client))
		return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	if ((span.cells[0].flags & DB_ROW_LIST) &&
	    (span.cells[span.count - 1].flags & DB_ROW_LIST)) {
		/* Writes some or all of the list's words, and the stop for its units. */
		size_t units = offsetof(struct db_gateway_image, group_units);
		const struct db_cell *last = &span.cells[span.count - 1];
		bool stops = last->offset == offsetof(struct db_gateway_image, group_stop_units);
		uint16_t words = (uint16_t)(span.count - stops);
		uint16_t stop = stops ? values[words] : 0;

		if (stop >= GROUP_STOPS)
			return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
		for (uint16_t i = 0; i < words; i++)
			space->own->group.units[(span.cells[i].offset - units) /
			                        sizeof(values[0])] = values[i];
		return stop == 0 ? 0 :
		                   db_group_stop_listed(registers, space, client, group_stops[stop],
		                                        token);
	}
	/* Only one of them per write: the order of two group commands would be a guess. */
	if (span.count != 1)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	if (span.cells[0].flags & DB_ROW_HEARTBEAT)
		return write_gateway_heartbeat(registers, space, client, values[0]);
	if (values[0] == 0)
		return 0;
	if (span.cells[0].offset == offsetof(struct db_gateway_image, group_start)) {
		if (values[0] != 1)
			return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
		return db_group_start(registers, space, client, token);
	}
	if (values[0] >= GROUP_STOPS)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	return db_group_stop(registers, space, client, group_stops[values[0]], token);
}
