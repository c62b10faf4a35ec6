/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include "regmap/group.h"
#include "regmap/vsmd_view.h"

#include <stdlib.h>

static struct db_request *submit_to_bus(void *context, const struct db_request *request)
{
	const struct db_view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	db_vsmd_view_note_request(drive->vsmd_view, request);
	return registers->ops->submit(registers->context, drive->bus, request);
}

static void release_at_bus(void *context, struct db_request *request)
{
	const struct db_registers *registers = ((const struct db_view_drive *)context)->registers;

	registers->ops->release(registers->context, request);
}

static void answer_client(void *context, struct db_write_token token, enum db_result result)
{
	const struct db_view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	if (db_group_take_answer(drive->registers, token, result))
		return;
	if (!db_vsmd_view_take_answer(drive->vsmd_view, token, &result))
		return;
	if (db_client_is_session(token.client))
		registers->ops->answer_session(registers->context, token, result);
	else
		registers->ops->answer(registers->context, token, db_exception_of(result));
}

static uint64_t read_wall_us(void *context)
{
	const struct db_registers *registers = ((const struct db_view_drive *)context)->registers;

	return registers->ops->wall_us(registers->context);
}

static void pass_on_refusal(void *context, const struct db_client *client,
                            const struct db_refused_write *write)
{
	const struct db_view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	if (registers->ops->write_refused)
		registers->ops->write_refused(registers->context, drive->bus_config, drive->config,
		                              client, write);
}

static void pass_on_lost_hold(void *context, const struct db_client *holder, bool gone)
{
	const struct db_view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	if (registers->ops->hold_lost)
		registers->ops->hold_lost(registers->context, drive->bus_config, drive->config,
		                          holder, gone);
}

static const struct db_commander_ops commander_ops = {
	.submit = submit_to_bus,
	.release = release_at_bus,
	.answer = answer_client,
	.wall_us = read_wall_us,
	.refused = pass_on_refusal,
	.record = db_record_request,
	.record_end = db_record_end,
	.hold_lost = pass_on_lost_hold,
};

struct db_view_drive *db_view_drive_new(struct db_registers *registers,
                                        const struct db_roster *roster,
                                        const struct db_roster_drive *member)
{
	const struct db_bus_config *bus = roster->buses[member->bus].config;
	const struct db_drive_config *config = member->config;
	struct db_commander_config commander = {
		.driver = bus->driver,
		.bus_config = bus,
		.drive_config = config,
		.commands = db_driver_commands(bus, config),
		.axis = member->axis,
		.drive = member->drive,
		.watchdog_ms = config->watchdog_ms,
		.on_client_loss = db_on_loss_command(config->on_client_loss),
	};
	struct db_view_drive *drive = calloc(1, sizeof(*drive));
	unsigned measures = bus->driver->measures;

	if (!drive)
		return NULL;
	drive->registers = registers;
	drive->drive = member->drive;
	drive->config = config;
	drive->axis = member->axis;
	drive->bus_config = bus;
	drive->bus = roster->buses[member->bus].bus;
	drive->driver = bus->driver;
	if (drive->driver->not_measured)
		measures &= ~drive->driver->not_measured(bus);
	drive->capabilities = db_capabilities(commander.commands, measures);
	drive->map = db_map_of_family(&registers->families, bus->driver);
	if (!drive->map)
		goto failed;
	if (config->vendor_layout || config->vendor_unit != 0) {
		drive->vsmd_view = db_vsmd_view_new(config);
		if (!drive->vsmd_view)
			goto failed;
	}
	if (db_commander_new(&commander, &commander_ops, drive, &drive->commander) == 0)
		return drive;
failed:
	db_view_drive_free(drive);
	return NULL;
}

void db_view_drive_free(struct db_view_drive *drive)
{
	if (!drive)
		return;
	db_commander_free(drive->commander);
	free(drive->vsmd_view);
	free(drive);
}
