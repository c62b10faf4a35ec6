/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/registers.h"

#include "regmap/group.h"
#include "regmap/regmap_private.h"
#include "regmap/vsmd_view.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int db_registers_new(const struct db_roster *roster, const struct db_registers_ops *ops,
                     void *context, struct db_registers **registers)
{
	struct db_registers *made = calloc(1, sizeof(*made));
	struct db_registers_change *change;

	if (!made)
		return -ENOMEM;
	made->ops = ops;
	made->context = context;
	made->started = ops->now(context);
	made->due = DB_TIME_NEVER;
	if (db_registers_prepare(made, roster, &change) != 0) {
		db_registers_free(made);
		return -ENOMEM;
	}
	db_registers_apply(made, change);
	*registers = made;
	return 0;
}

void db_registers_free(struct db_registers *registers)
{
	if (!registers)
		return;
	db_view_roster_free(registers->roster);
	db_map_free_families(registers->families);
	while (registers->units) {
		struct db_gateway_unit *next = registers->units->next;

		free(registers->units);
		registers->units = next;
	}
	free(registers);
}

void db_registers_complete(struct db_registers *registers, struct db_request *request, db_time now)
{
	struct db_view_drive *drive = db_view_roster_find(registers->roster, request->drive);
	enum db_result result = (enum db_result)request->result;
	uint32_t ticket = request->ticket;

	if (!drive) {
		registers->ops->release(registers->context, request);
		return;
	}
	/* First the group's figures: the commander may answer its writer. */
	db_group_note_sent(drive, ticket, request->sent);
	db_commander_complete(drive->commander, request, now);
	db_vsmd_view_send_command(drive, ticket, result, now);
}

enum db_command db_registers_owed_stop(const struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = db_view_roster_find(registers->roster, number);

	return drive ? db_commander_owed_stop(drive->commander) : DB_CMD_NONE;
}

/* The parameter as the drive's family has it now. */
static void find_param(const struct db_driver *driver, const struct db_recalled *recalled,
                       struct db_history_entry *entry)
{
	union db_value value = { .u = 0 };

	entry->number = DB_HISTORY_UNKNOWN;
	for (size_t i = 0; i < driver->param_count; i++) {
		if (strcmp(driver->params[i].name, recalled->param) != 0)
			continue;
		(void)db_value_from_number(driver->params[i].type, recalled->value, &value);
		entry->number = (uint16_t)i;
		entry->value = value.u;
	}
}

void db_registers_recall(struct db_registers *registers, const struct db_recalled *recalled)
{
	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		const struct db_view_drive *drive = registers->roster->drives[i];
		struct db_history_entry entry = recalled->entry;

		/* A name says nothing about which motor it was: addresses may have been swapped. */
		if (strcmp(drive->config->name, recalled->drive) != 0 ||
		    strcmp(drive->bus_config->name, recalled->bus) != 0 ||
		    drive->config->address != recalled->node ||
		    (uint16_t)drive->config->axis != recalled->axis)
			continue;
		if (recalled->param)
			find_param(drive->driver, recalled, &entry);
		db_commander_recall(drive->commander, &entry, &recalled->args);
	}
}

void db_registers_end_holds(struct db_registers *registers, db_time now)
{
	for (size_t i = 0; i < registers->roster->drive_count; i++)
		db_commander_end_hold(registers->roster->drives[i]->commander, now);
}

void db_registers_stand(struct db_registers *registers, uint16_t number, enum db_command stop,
                        enum db_stand_cause cause, db_time now)
{
	struct db_view_drive *drive = db_view_roster_find(registers->roster, number);

	if (drive)
		db_commander_stand(drive->commander, stop, cause, now);
}

db_time db_registers_next_deadline(struct db_registers *registers)
{
	const struct db_view_roster *roster = registers->roster;
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i < roster->drive_count; i++) {
		db_time deadline = db_commander_next_deadline(roster->drives[i]->commander);

		if (deadline < next)
			next = deadline;
	}
	registers->due = next;
	return next;
}

void db_registers_expire(struct db_registers *registers, db_time now)
{
	const struct db_view_roster *roster = registers->roster;

	registers->due = DB_TIME_NEVER;
	db_group_gather(registers, true);
	for (size_t i = 0; i < roster->drive_count; i++) {
		const struct db_view_drive *drive = roster->drives[i];

		if (db_commander_expire(drive->commander, now) && registers->ops->tripped)
			registers->ops->tripped(registers->context, drive->bus_config,
			                        drive->config,
			                        db_commander_fed_by(drive->commander));
	}
	db_group_gather(registers, false);
}
