/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/regmap_private.h"

#include <errno.h>
#include <stdlib.h>

/* A roster that is to replace the one shown. */
struct db_registers_change {
	struct db_view_roster *roster;
	/* What its drives get from it, in the same order. */
	struct assignment {
		bool made; /* the drive is new, and owned by this change until it is applied */
		size_t bus_index;
		db_time useless_after;
	} * assignments;
};

struct db_view_drive *db_view_roster_find(const struct db_view_roster *roster, uint16_t drive)
{
	for (size_t i = 0; roster && i < roster->drive_count; i++) {
		if (roster->drives[i]->drive == drive)
			return roster->drives[i];
	}
	return NULL;
}

/* The drives are not owned by the roster. */
static void free_roster(struct db_view_roster *roster)
{
	if (!roster)
		return;
	for (size_t i = 0; roster->spaces && i < roster->space_count; i++) {
		db_map_release(&roster->spaces[i].gateway);
		free(roster->spaces[i].drives);
	}
	free(roster->spaces);
	free(roster->buses);
	free(roster->bus_configs);
	free(roster->drives);
	free(roster);
}

void db_view_roster_free(struct db_view_roster *roster)
{
	for (size_t i = 0; roster && i < roster->drive_count; i++)
		db_view_drive_free(roster->drives[i]);
	free_roster(roster);
}

/* --- preparing -------------------------------------------------------------------------------- */

/* One second or ten cycles, and at least three rounds over all the drives of a slow bus. */
static db_time useless_after(const struct db_roster *roster, size_t bus)
{
	const struct db_bus_config *config = roster->buses[bus].config;
	db_time age = 10 * (db_time)config->cycle_ms * DB_NS_PER_MS;
	db_time round = 0;

	/* By the time on the wire; the drives' response times are included later, see image.c. */
	for (size_t i = 0; i < roster->drive_count; i++) {
		if (roster->drives[i].bus == bus)
			round += config->driver->poll_time(config);
	}
	if (age < 3 * round)
		age = 3 * round;
	return age > DB_NS_PER_S ? age : DB_NS_PER_S;
}

/* --- spaces of units -------------------------------------------------------------------------- */

struct db_view_space *db_view_space_whole(const struct db_registers *registers)
{
	const struct db_view_roster *roster = registers->roster;

	return &roster->spaces[roster->space_count - 1];
}

struct db_view_space *db_view_space_of(const struct db_registers *registers,
                                       const struct db_client *client)
{
	const struct db_view_roster *roster = registers->roster;

	if (db_client_is_session(client->id))
		return db_view_space_whole(registers);
	for (size_t i = 0; i < roster->space_count; i++) {
		if (roster->spaces[i].endpoint == client->endpoint)
			return &roster->spaces[i];
	}
	return NULL;
}

static void assign_unit(struct db_view_space *space, unsigned unit, uint16_t drive, bool vendor)
{
	space->units[unit & 0xFF] = drive;
	space->vendor_units[unit & 0xFF] = vendor;
}

/* The drives and units of an endpoint, or of all: then drives have no units. */
static void fill_space(struct db_view_space *space, const struct db_view_roster *roster)
{
	bool all = space->endpoint == DB_ENDPOINT_ALL;
	struct db_endpoint_config endpoint = { .gateway_unit = 0 };

	for (size_t i = 0; i < 256; i++)
		space->units[i] = DB_UNIT_NONE;
	for (size_t i = 0; i < roster->drive_count; i++) {
		const struct db_drive_config *drive = roster->drives[i]->config;

		if (!all && drive->endpoint != space->endpoint)
			continue;
		space->drives[space->drive_count++] = roster->drives[i];
		if (all)
			continue;
		assign_unit(space, drive->unit, (uint16_t)i, drive->vendor_layout);
		if (drive->vendor_unit != 0)
			assign_unit(space, drive->vendor_unit, (uint16_t)i, true);
	}
	(void)db_modbus_endpoint_find(roster->modbus, space->endpoint, &endpoint);
	space->units[0] = DB_UNIT_GATEWAY;
	space->units[255] = DB_UNIT_GATEWAY;
	space->units[endpoint.gateway_unit & 0xFF] = DB_UNIT_GATEWAY;
}

/* After the drives. */
static int make_spaces(struct db_registers *registers, struct db_view_roster *roster)
{
	size_t endpoints = db_modbus_endpoint_count(roster->modbus);
	size_t count = endpoints > 1 ? endpoints + 1 : 1;

	roster->spaces = calloc(count, sizeof(roster->spaces[0]));
	if (!roster->spaces)
		return -ENOMEM;
	for (; roster->space_count < count; roster->space_count++) {
		struct db_view_space *space = &roster->spaces[roster->space_count];
		struct db_scope scope = { .view = DB_VIEW_GATEWAY, .buses = roster->bus_count };

		space->endpoint = DB_ENDPOINT_ALL;
		if (roster->space_count < endpoints)
			space->endpoint =
				db_modbus_endpoint_at(roster->modbus, roster->space_count).number;
		/* The gateway's own unit of an endpoint stays when a reload takes the endpoint
		 * out. */
		space->own = registers->units;
		while (space->own && space->own->endpoint != space->endpoint)
			space->own = space->own->next;
		if (!space->own) {
			space->own = calloc(1, sizeof(*space->own));
			if (space->own) {
				/* Kept in the list, which gcc's analyzer does not see. */
				space->own->endpoint = space->endpoint;
				space->own->next = registers->units;
				registers->units = space->own;
			}
		}
		/* One more than needed, so that no allocation has size 0. The roster is released
		 * with what it has, which gcc's analyzer does not see. */
		space->drives = calloc(roster->drive_count + 1, sizeof(struct db_view_drive *));
		if (space->own && space->drives)
			fill_space(space, roster);
		scope.drives = space->drive_count;
		if (!space->own || !space->drives || db_map_init(&space->gateway, &scope) != 0) {
			roster->space_count++;
			return -ENOMEM;
		}
	}
	return 0;
}

static int fill_roster(struct db_registers *registers, const struct db_roster *roster,
                       struct db_registers_change *change)
{
	struct db_view_roster *next = change->roster;
	bool ids_by_client = roster->modbus->command_id_scope == DB_IDS_OF_CLIENT;

	for (; next->bus_count < roster->bus_count; next->bus_count++) {
		next->buses[next->bus_count] = roster->buses[next->bus_count].bus;
		next->bus_configs[next->bus_count] = roster->buses[next->bus_count].config;
	}
	for (; next->drive_count < roster->drive_count; next->drive_count++) {
		size_t i = next->drive_count;
		const struct db_roster_drive *member = &roster->drives[i];
		struct db_view_drive *drive = db_view_roster_find(registers->roster, member->drive);

		change->assignments[i] = (struct assignment){
			.made = !drive,
			.bus_index = member->bus,
			.useless_after = useless_after(roster, member->bus),
		};
		if (!drive)
			drive = db_view_drive_new(registers, roster, member);
		if (!drive)
			return -ENOMEM;
		next->drives[i] = drive;
	}
	if (make_spaces(registers, next) != 0)
		return -ENOMEM;
	/* Reserved now so that applying it needs no memory. */
	for (size_t i = 0; i < next->drive_count; i++) {
		if (db_commander_reserve(next->drives[i]->commander, ids_by_client) != 0)
			return -ENOMEM;
	}
	return 0;
}

int db_registers_prepare(struct db_registers *registers, const struct db_roster *roster,
                         struct db_registers_change **change)
{
	struct db_registers_change *made = calloc(1, sizeof(*made));
	struct db_view_roster *next = calloc(1, sizeof(*next));

	if (!made || !next) {
		free(made);
		free(next);
		return -ENOMEM;
	}
	/* One more of each than needed, so that no allocation has size 0. */
	made->roster = next;
	made->assignments = calloc(roster->drive_count + 1, sizeof(made->assignments[0]));
	next->modbus = roster->modbus;
	next->buses = calloc(roster->bus_count + 1, sizeof(struct db_bus *));
	next->bus_configs = calloc(roster->bus_count + 1, sizeof(struct db_bus_config *));
	next->drives = calloc(roster->drive_count + 1, sizeof(struct db_view_drive *));
	if (!made->assignments || !next->buses || !next->bus_configs || !next->drives ||
	    fill_roster(registers, roster, made) != 0) {
		db_registers_change_free(made);
		return -ENOMEM;
	}
	*change = made;
	return 0;
}

void db_registers_change_free(struct db_registers_change *change)
{
	if (!change)
		return;
	for (size_t i = 0; i < change->roster->drive_count; i++) {
		if (change->assignments[i].made)
			db_view_drive_free(change->roster->drives[i]);
	}
	free_roster(change->roster);
	free(change->assignments);
	free(change);
}

/* --- changing --------------------------------------------------------------------------------- */

void db_registers_retire(struct db_registers *registers, const struct db_registers_change *change)
{
	struct db_view_roster *roster = registers->roster;

	registers->generation++;
	for (size_t i = 0; i < roster->drive_count; i++) {
		struct db_view_drive *drive = roster->drives[i];

		drive->leaving = db_view_roster_find(change->roster, drive->drive) != drive;
		/* Before the bus releases it according to on_exit, which is for motions without a
		 * hold. */
		if (drive->leaving)
			db_commander_end_hold(drive->commander,
			                      registers->ops->now(registers->context));
	}
	for (size_t i = 0; i < roster->space_count; i++) {
		struct db_view_space *space = &roster->spaces[i];

		for (size_t unit = 0; unit < 256; unit++) {
			size_t drive = space->units[unit];

			if (drive < roster->drive_count && roster->drives[drive]->leaving)
				space->units[unit] = DB_UNIT_NONE;
		}
	}
}

void db_registers_apply(struct db_registers *registers, struct db_registers_change *change)
{
	struct db_view_roster *old = registers->roster;
	struct db_view_roster *roster = change->roster;
	const struct db_modbus_config *modbus = roster->modbus;
	bool controlled = modbus->control == DB_CONTROL_DRIVE;

	for (size_t i = 0; i < roster->drive_count; i++) {
		const struct assignment *assignment = &change->assignments[i];
		struct db_view_drive *drive = roster->drives[i];

		drive->bus_index = assignment->bus_index;
		drive->useless_after = assignment->useless_after;
		db_commander_set_writers(drive->commander, modbus->confirm_ms,
		                         modbus->accept_writes,
		                         modbus->command_id_scope == DB_IDS_OF_CLIENT);
		if (assignment->made)
			db_control_init(&drive->control, controlled, modbus->control_timeout_ms);
		else
			db_control_change(&drive->control, controlled, modbus->control_timeout_ms);
	}
	registers->roster = roster;
	registers->generation++;
	/* Last: a client that is answered may send its next request at once. */
	for (size_t i = 0; old && i < old->drive_count; i++) {
		struct db_view_drive *drive = old->drives[i];

		if (db_view_roster_find(roster, drive->drive) == drive)
			continue;
		db_commander_dismiss(drive->commander);
		db_view_drive_free(drive);
	}
	free_roster(old);
	free(change->assignments);
	free(change);
}
