/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/clients.h"

#include "regmap/regmap_private.h"

/* A due time is exceeded by this only when this process, or its machine, was suspended. */
#define HELD_TIME (100 * DB_NS_PER_MS)

bool db_clients_are_permitted(const struct db_view_drive *drive, const struct db_client *client,
                              enum db_permission what)
{
	const struct db_role_config *role = client->role;
	const char *name = drive->config->name;

	if (!role)
		return true;
	if (what == DB_MAY_READ && db_drive_set_has(&role->read, name))
		return true;
	return db_drive_set_has(&role->write, name) &&
	       (what != DB_MAY_SET_PARAMETERS || role->parameters) &&
	       (what != DB_MAY_CLAIM || role->control);
}

void db_clients_count_refusal(const struct db_registers *registers, const struct db_client *client,
                              enum db_refusal kind)
{
	if (registers->ops->refused)
		registers->ops->refused(registers->context, client, kind);
}

bool db_clients_permit(const struct db_view_drive *drive, const struct db_client *client,
                       enum db_permission what, uint16_t address)
{
	if (db_clients_are_permitted(drive, client, what))
		return true;
	db_clients_count_refusal(drive->registers, client, DB_REFUSED_ROLE);
	if (what != DB_MAY_READ)
		db_record_denied(drive->registers, drive, client, (uint8_t)drive->config->unit,
		                 address, "its role does not allow it");
	return false;
}

bool db_clients_permit_gateway(const struct db_registers *registers, const struct db_client *client)
{
	bool permitted = !client->role || client->role->control;

	if (!permitted)
		db_clients_count_refusal(registers, client, DB_REFUSED_ROLE);
	return permitted;
}

/* Who may not command a drive does not keep it moving, and has no control of it. */
static bool may_act(const struct db_view_drive *drive, const struct db_client *client)
{
	return client->may_write && db_clients_are_permitted(drive, client, DB_MAY_COMMAND);
}

bool db_clients_may_write(struct db_view_drive *drive, const struct db_client *client, bool stop)
{
	const struct db_registers *registers = drive->registers;
	db_time now = registers->ops->now(registers->context);
	bool holds = db_control_holds(&drive->control, client, now);

	if (stop)
		return !db_control_holder(&drive->control, now) || holds;
	if (db_control_take(&drive->control, client, now)) {
		if (!holds)
			db_record_control(drive, client, true);
		return true;
	}
	db_clients_count_refusal(registers, client, DB_REFUSED_CONTROL);
	return false;
}

void db_clients_feed(struct db_view_drive *drive, const struct db_client *client,
                     enum db_watchdog_feed by)
{
	const struct db_registers *registers = drive->registers;
	db_time now = registers->ops->now(registers->context);

	if (may_act(drive, client) && db_control_holds(&drive->control, client, now))
		db_commander_feed(drive->commander, client, by, db_client_arrived(client, now));
}

void db_clients_hear(struct db_view_drive *drive, const struct db_client *client)
{
	const struct db_registers *registers = drive->registers;
	const struct db_view_roster *roster = registers->roster;
	db_time now = registers->ops->now(registers->context);

	db_commander_hear(drive->commander, client, now);
	/*
	 * Something that was due long ago has not been done: this process was suspended. A client
	 * sends one request after the other and may have waited with its first one for all that
	 * time, so that this one counts for every drive that it had kept going.
	 */
	for (size_t i = 0; now - HELD_TIME >= registers->due && i < roster->drive_count; i++) {
		struct db_commander *commander = roster->drives[i]->commander;

		if (db_commander_fed_by(commander)->id == client->id)
			db_commander_feed(commander, client, DB_FEED_HEARTBEAT,
			                  db_client_arrived(client, now));
	}
	if (may_act(drive, client) && db_control_holds(&drive->control, client, now))
		db_control_hear(&drive->control, client, db_client_arrived(client, now), now);
}

void db_clients_release_control(void *context, const struct db_client *client)
{
	const struct db_registers *registers = context;

	for (size_t i = 0; i < registers->roster->drive_count; i++)
		db_control_release(&registers->roster->drives[i]->control, client);
}

void db_clients_release_lost(void *context, const struct db_client *client)
{
	const struct db_registers *registers = context;

	for (size_t i = 0; i < registers->roster->drive_count; i++) {
		struct db_view_drive *drive = registers->roster->drives[i];

		if (!may_act(drive, client))
			db_control_release(&drive->control, client);
	}
}

void db_clients_forget(struct db_registers *registers, const struct db_client *client)
{
	db_time now = registers->ops->now(registers->context);

	db_clients_release_control(registers, client);
	for (size_t i = 0; i < registers->roster->drive_count; i++)
		db_commander_forget(registers->roster->drives[i]->commander, client, now);
}
