/* SPDX-License-Identifier: Apache-2.0 */
/* The server's backend: finds the drive of a unit, and passes the request on. */
#include "drivebridge/registers.h"
#include "drivebridge/version.h"
#include "regmap/clients.h"
#include "regmap/regmap_private.h"
#include "regmap/vsmd_view.h"

#include <modbus.h>
#include <stdio.h>
#include <string.h>

/* The page of the publisher: DRIVEBRIDGE_HOMEPAGE in CMakeLists.txt. */
#ifndef DB_VENDOR_URL
#define DB_VENDOR_URL ""
#endif

/* Null for the gateway. Only called for units that exist. */
static struct db_view_drive *drive_of(const struct db_registers *registers,
                                      const struct db_client *client, uint8_t unit)
{
	const struct db_view_space *space = db_view_space_of(registers, client);
	uint16_t drive = space ? space->units[unit] : DB_UNIT_NONE;

	return drive < registers->roster->drive_count ? registers->roster->drives[drive] : NULL;
}

/* True if the unit, which is there, has the vendor's layout. */
static bool is_vendor_unit(const struct db_registers *registers, const struct db_client *client,
                           uint8_t unit)
{
	return db_view_space_of(registers, client)->vendor_units[unit];
}

static uint8_t backend_unit(void *context, const struct db_client *client, uint8_t unit)
{
	const struct db_view_space *space = db_view_space_of(context, client);

	return space && space->units[unit] != DB_UNIT_NONE ? 0 : MODBUS_EXCEPTION_GATEWAY_PATH;
}

static uint8_t backend_role(void *context, const struct db_client *client, uint8_t unit)
{
	const struct db_view_drive *drive = drive_of(context, client, unit);

	return !drive || db_clients_permit(drive, client, DB_MAY_READ, 0) ?
	               0 :
	               MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
}

static uint8_t backend_read(void *context, const struct db_client *client, uint8_t unit,
                            enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	const struct db_registers *registers = context;
	struct db_view_drive *drive = drive_of(registers, client, unit);

	if (drive) {
		db_clients_hear(drive, client);
		db_clients_feed(drive, client, DB_FEED_REQUESTS);
		if (is_vendor_unit(registers, client, unit))
			return db_vsmd_view_read(drive, table, address, count, values);
		return db_read_drive(drive, client, table, address, count, values);
	}
	if (backend_unit(context, client, unit))
		return MODBUS_EXCEPTION_GATEWAY_PATH;
	return db_read_gateway(registers, db_view_space_of(registers, client), client, table,
	                       address, count, values);
}

static int backend_write(void *context, const struct db_client *client, uint8_t unit,
                         enum db_table table, uint16_t address, uint16_t count,
                         const uint16_t *values, struct db_write_token token)
{
	struct db_view_drive *drive = drive_of(context, client, unit);
	int answer;

	if (drive) {
		db_clients_hear(drive, client);
		if (!db_clients_permit(drive, client, DB_MAY_COMMAND, address))
			return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
		if (is_vendor_unit(drive->registers, client, unit))
			return db_vsmd_view_write(drive, client, table, address, count, values,
			                          token);
		return db_write_drive(drive, client, table, address, count, values, token);
	}
	if (backend_unit(context, client, unit))
		return MODBUS_EXCEPTION_GATEWAY_PATH;
	answer = db_gateway_write(context, db_view_space_of(context, client), client, table,
	                          address, count, values, token);
	if (answer > 0)
		db_record_denied(context, NULL, client, unit, address,
		                 db_result_name(db_exception_result((uint8_t)answer)));
	return answer;
}

static int backend_write_same(void *context, const struct db_client *client, uint8_t unit,
                              uint16_t address, uint16_t value, struct db_write_token token)
{
	const struct db_registers *registers = context;
	struct db_view_drive *drive = drive_of(registers, client, unit);
	struct db_span span;

	if (!drive && backend_unit(context, client, unit))
		return MODBUS_EXCEPTION_GATEWAY_PATH;
	/* It changes nothing at the gateway. */
	if (!drive)
		return db_clients_permit_gateway(registers, client) ?
		               db_span_find_single(
				       &db_view_space_of(registers, client)->gateway.holding,
				       address, &span) :
		               MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	db_clients_hear(drive, client);
	if (!db_clients_permit(drive, client, DB_MAY_COMMAND, address))
		return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	if (is_vendor_unit(registers, client, unit))
		return db_vsmd_view_write_same(drive, client, address, value, token);
	return db_write_drive_same(drive, client, address, value, token);
}

static bool has_unit(const uint8_t units[32], unsigned unit)
{
	return unit != 0 && (units[unit / 8] >> (unit % 8) & 1);
}

static bool backend_stops(void *context, const struct db_client *client, uint8_t unit,
                          uint16_t address, uint16_t count, const uint16_t *values)
{
	const struct db_registers *registers = context;
	const struct db_view_drive *drive = drive_of(registers, client, unit);

	return drive && !is_vendor_unit(registers, client, unit) &&
	       db_write_find_stop(drive, address, count, values) != DB_CMD_NONE;
}

static bool backend_broadcast(void *context, const struct db_client *client,
                              const uint8_t units[32], uint16_t address, uint16_t count,
                              const uint16_t *values)
{
	const struct db_registers *registers = context;
	const struct db_view_space *space = db_view_space_of(registers, client);
	/* No client: answers to it are dropped. */
	const struct db_write_token nobody = { .client = DB_CLIENT_NOBODY };
	db_time now = registers->ops->now(registers->context);
	bool any = false;

	for (size_t i = 0; space && i < space->drive_count; i++) {
		struct db_view_drive *drive = space->drives[i];
		const struct db_drive_config *config = drive->config;
		struct db_request request = {
			.client = *client,
			.command = db_write_find_stop(drive, address, count, values),
		};

		if (drive->leaving || request.command == DB_CMD_NONE ||
		    !(has_unit(units, config->unit) || has_unit(units, config->vendor_unit)))
			continue;
		any = true;
		db_clients_hear(drive, client);
		if (db_clients_permit(drive, client, DB_MAY_COMMAND, address))
			(void)db_commander_ask(drive->commander, &request, nobody, now);
	}
	return any;
}

static size_t backend_server_id(void *context, const struct db_client *client, uint8_t unit,
                                char *text, size_t size, bool *running)
{
	const struct db_registers *registers = context;
	const struct db_view_drive *drive = drive_of(registers, client, unit);
	struct db_nameplate_copy copy;
	const struct db_nameplate *plate = &copy.plate;
	struct db_snapshot snapshot;
	int length;

	if (!drive) {
		*running = true;
		length = snprintf(text, size, "drivebridge %s gateway", DB_VERSION);
	} else {
		db_axis_read(drive->axis, &snapshot);
		db_axis_read_nameplate(drive->axis, &copy);
		*running = (snapshot.feedback.status & DB_STATUS_ONLINE) != 0;
		length = snprintf(text, size, "drivebridge %s unit %u %s%s%.*s", DB_VERSION,
		                  drive->config->unit, drive->config->name,
		                  plate->identity[0] ? " " : "", DB_IDENTITY_MAX, plate->identity);
	}
	if (length < 0 || size == 0)
		return 0;
	return (size_t)length < size ? (size_t)length : size - 1;
}

/* Objects of FC 43/14. */
enum device_object {
	OBJECT_VENDOR_NAME,
	OBJECT_PRODUCT_CODE,
	OBJECT_REVISION,
	OBJECT_VENDOR_URL,
	OBJECT_PRODUCT_NAME,
	OBJECT_MODEL_NAME,
	OBJECT_USER_APPLICATION_NAME,
};

static const char *model_of(const struct db_view_drive *drive)
{
	char *model = drive->registers->model;
	struct db_nameplate_copy copy;
	const struct db_nameplate *plate = &copy.plate;

	db_axis_read_nameplate(drive->axis, &copy);
	if (plate->identity[0] == '\0')
		return drive->driver->title;
	memcpy(model, plate->identity, sizeof(plate->identity));
	model[sizeof(plate->identity)] = '\0';
	return model;
}

static const char *backend_device_id(void *context, const struct db_client *client, uint8_t unit,
                                     uint8_t object)
{
	struct db_view_drive *drive = drive_of(context, client, unit);

	switch (object) {
	case OBJECT_VENDOR_NAME:
		return "drivebridge";
	case OBJECT_PRODUCT_CODE:
		return drive ? drive->driver->name : "gateway";
	case OBJECT_REVISION:
		return DB_VERSION;
	case OBJECT_VENDOR_URL:
		return DB_VENDOR_URL[0] ? DB_VENDOR_URL : NULL;
	case OBJECT_PRODUCT_NAME:
		return drive ? drive->driver->title : "drivebridge gateway";
	case OBJECT_MODEL_NAME:
		return drive ? model_of(drive) : "gateway";
	case OBJECT_USER_APPLICATION_NAME:
		return drive ? drive->config->name : NULL;
	default:
		return NULL;
	}
}

static void backend_denied(void *context, const struct db_client *client, uint8_t unit,
                           uint16_t address)
{
	db_record_denied(context, drive_of(context, client, unit), client, unit, address,
	                 "this client may only read");
}

static void backend_client(void *context, const struct db_client *client, bool connected)
{
	struct db_registers *registers = context;

	if (!connected)
		db_clients_forget(registers, client);
	if (registers->ops->client)
		registers->ops->client(registers->context, client, connected);
}

const struct db_backend db_registers_backend = {
	.unit = backend_unit,
	.role = backend_role,
	.read = backend_read,
	.write = backend_write,
	.write_same = backend_write_same,
	.stops = backend_stops,
	.broadcast = backend_broadcast,
	.server_id = backend_server_id,
	.device_id = backend_device_id,
	.client = backend_client,
	.restricted = db_clients_release_control,
	.reassigned = db_clients_release_lost,
	.denied = backend_denied,
};
