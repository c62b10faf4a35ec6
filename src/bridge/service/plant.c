/* SPDX-License-Identifier: Apache-2.0 */
#include "service/service_private.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define NUMBER_LIMIT 65535 /* numbers are smaller */

/* --- editions --------------------------------------------------------------------------------- */

static void release_edition(struct edition *edition)
{
	if (!edition || --edition->users > 0)
		return;
	db_config_free(edition->config);
	free(edition);
}

/* --- finding ---------------------------------------------------------------------------------- */

bool plant_has_bus(const struct plant *plant, const struct plant_bus *bus)
{
	for (size_t i = 0; plant && i < plant->bus_count; i++) {
		if (plant->buses[i] == bus)
			return true;
	}
	return false;
}

bool plant_has_drive(const struct plant *plant, const struct plant_drive *drive)
{
	for (size_t i = 0; plant && i < plant->drive_count; i++) {
		if (plant->drives[i] == drive)
			return true;
	}
	return false;
}

const struct plant_bus *plant_bus_named(const struct plant *plant, const char *name)
{
	for (size_t i = 0; plant && i < plant->bus_count; i++) {
		if (strcmp(plant->buses[i]->config->name, name) == 0)
			return plant->buses[i];
	}
	return NULL;
}

const struct plant_drive *plant_drive_named(const struct plant *plant, const char *name)
{
	for (size_t i = 0; plant && i < plant->drive_count; i++) {
		if (strcmp(plant->drives[i]->config->name, name) == 0)
			return plant->drives[i];
	}
	return NULL;
}

bool plant_same(const struct plant *a, const struct plant *b)
{
	if (a->bus_count != b->bus_count || a->drive_count != b->drive_count)
		return false;
	for (size_t i = 0; i < a->bus_count; i++) {
		if (a->buses[i] != b->buses[i])
			return false;
	}
	for (size_t i = 0; i < a->drive_count; i++) {
		if (a->drives[i] != b->drives[i])
			return false;
	}
	return db_config_same_modbus(a->edition->config, b->edition->config) &&
	       db_config_same_control(a->edition->config, b->edition->config);
}

/* --- telling others --------------------------------------------------------------------------- */

struct db_bus_drive *plant_drives_on(const struct plant *plant, const struct plant_bus *bus,
                                     const struct plant *except, size_t *count)
{
	/* One more than needed, so that no allocation has size 0. */
	struct db_bus_drive *drives = calloc(plant->drive_count + 1, sizeof(*drives));

	*count = 0;
	for (size_t i = 0; drives && i < plant->drive_count; i++) {
		const struct plant_drive *drive = plant->drives[i];

		if (drive->bus != bus || plant_has_drive(except, drive))
			continue;
		drives[(*count)++] = (struct db_bus_drive){
			.drive = drive->number,
			.config = drive->config,
			.axis = drive->axis,
		};
	}
	return drives;
}

int plant_roster_init(struct plant_roster *roster, const struct plant *plant)
{
	roster->buses = calloc(plant->bus_count + 1, sizeof(roster->buses[0]));
	roster->drives = calloc(plant->drive_count + 1, sizeof(roster->drives[0]));
	if (!roster->buses || !roster->drives) {
		plant_roster_release(roster);
		return -ENOMEM;
	}
	for (size_t i = 0; i < plant->bus_count; i++) {
		roster->buses[i].config = plant->buses[i]->config;
		roster->buses[i].bus = plant->buses[i]->bus;
	}
	for (size_t i = 0; i < plant->drive_count; i++) {
		const struct plant_drive *drive = plant->drives[i];
		size_t bus = 0;

		while (plant->buses[bus] != drive->bus)
			bus++;
		roster->drives[i] = (struct db_roster_drive){
			.drive = drive->number,
			.bus = bus,
			.config = drive->config,
			.axis = drive->axis,
		};
	}
	roster->roster = (struct db_roster){
		.modbus = &plant->edition->config->modbus,
		.buses = roster->buses,
		.bus_count = plant->bus_count,
		.drives = roster->drives,
		.drive_count = plant->drive_count,
	};
	return 0;
}

void plant_roster_release(struct plant_roster *roster)
{
	free(roster->buses);
	free(roster->drives);
}

/* --- making ----------------------------------------------------------------------------------- */

static bool is_number_taken(const struct plant *plant, uint16_t number)
{
	for (size_t i = 0; plant && i < plant->drive_count; i++) {
		if (plant->drives[i]->number == number)
			return true;
	}
	return false;
}

static int add_buses(struct plant *plant, struct service *service, const struct plant *running)
{
	const struct db_config *config = plant->edition->config;

	for (; plant->bus_count < config->bus_count; plant->bus_count++) {
		const struct db_bus_config *section = &config->buses[plant->bus_count];
		struct plant_bus *bus = NULL;

		/* A running bus that is equal is shared. */
		for (size_t i = 0; !bus && running && i < running->bus_count; i++) {
			if (db_config_same_bus(running->buses[i]->config, section))
				bus = running->buses[i];
		}
		if (!bus) {
			bus = calloc(1, sizeof(*bus));
			if (!bus)
				return -ENOMEM;
			bus->service = service;
			bus->edition = plant->edition;
			bus->edition->users++;
			bus->config = section;
			bus->number = ++service->last_bus;
		}
		plant->buses[plant->bus_count] = bus;
	}
	return 0;
}

static int add_drives(struct plant *plant, const struct plant *running, uint16_t *last_number)
{
	const struct db_config *config = plant->edition->config;

	for (; plant->drive_count < config->drive_count; plant->drive_count++) {
		const struct db_drive_config *section = &config->drives[plant->drive_count];
		struct plant_bus *bus = plant->buses[section->bus];
		struct plant_drive *drive = NULL;

		/* The one that runs with the same configuration goes on. */
		for (size_t i = 0; running && !drive && i < running->drive_count; i++) {
			struct plant_drive *other = running->drives[i];

			if (other->bus == bus &&
			    db_config_same_drive(other->edition->config, other->config, config,
			                         section))
				drive = other;
		}
		if (!drive) {
			drive = calloc(1, sizeof(*drive));
			if (!drive)
				return -ENOMEM;
			drive->axis = db_axis_new(bus->config->driver->param_count);
			if (!drive->axis) {
				free(drive);
				return -ENOMEM;
			}
			drive->edition = plant->edition;
			drive->edition->users++;
			drive->config = section;
			drive->bus = bus;
			do
				*last_number = (uint16_t)((*last_number + 1) % NUMBER_LIMIT);
			while (is_number_taken(plant, *last_number) ||
			       is_number_taken(running, *last_number));
			drive->number = *last_number;
		}
		plant->drives[plant->drive_count] = drive;
	}
	return 0;
}

int plant_new(struct service *service, struct db_config *config, const struct plant *running,
              uint16_t *last_number, struct plant **plant)
{
	struct plant *made = calloc(1, sizeof(*made));
	struct edition *edition = calloc(1, sizeof(*edition));
	int error = -ENOMEM;

	if (!made || !edition) {
		free(made);
		free(edition);
		db_config_free(config);
		return -ENOMEM;
	}
	edition->config = config;
	edition->users = 1;
	made->edition = edition;
	/* One more of each than needed, so that no allocation has size 0. */
	made->buses = calloc(config->bus_count + 1, sizeof(struct plant_bus *));
	made->drives = calloc(config->drive_count + 1, sizeof(struct plant_drive *));
	if (made->buses && made->drives)
		error = add_buses(made, service, running);
	if (error == 0)
		error = add_drives(made, running, last_number);
	for (size_t i = 0; error == 0 && i < made->bus_count; i++) {
		struct plant_bus *bus = made->buses[i];
		struct db_bus_drive *drives;
		size_t count;

		if (bus->bus)
			continue;
		drives = plant_drives_on(made, bus, NULL, &count);
		error = drives ? db_bus_new(bus->config, drives, count, service->log.log,
		                            &bus->bus) :
		                 -ENOMEM;
		free(drives);
	}
	if (error != 0) {
		plant_free(made, running);
		return error;
	}
	*plant = made;
	return 0;
}

void plant_end(struct plant *plant)
{
	for (size_t i = 0; i < plant->bus_count; i++) {
		if (plant->buses[i]->bus)
			db_bus_ask_end(plant->buses[i]->bus);
	}
	for (size_t i = 0; i < plant->bus_count; i++) {
		struct plant_bus *bus = plant->buses[i];

		bus->completions = sd_event_source_disable_unref(bus->completions);
		db_bus_stop(bus->bus);
	}
}

void plant_free(struct plant *plant, const struct plant *other)
{
	if (!plant)
		return;
	for (size_t i = 0; i < plant->bus_count; i++) {
		struct plant_bus *bus = plant->buses[i];

		if (plant_has_bus(other, bus))
			continue;
		sd_event_source_disable_unref(bus->completions);
		db_bus_change_free(bus->change);
		traces_leave(bus);
		db_bus_free(bus->bus);
		release_edition(bus->edition);
		free(bus);
	}
	for (size_t i = 0; i < plant->drive_count; i++) {
		struct plant_drive *drive = plant->drives[i];

		if (plant_has_drive(other, drive))
			continue;
		db_axis_free(drive->axis);
		release_edition(drive->edition);
		free(drive);
	}
	free(plant->buses);
	free(plant->drives);
	release_edition(plant->edition);
	free(plant);
}
