/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant: the buses and drives that run, each with the section it was made from. A plant that is
 * made for another configuration shares with the one that runs what is the same in both.
 * Internal to src/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_PLANT_H
#define DRIVEBRIDGE_SERVICE_PLANT_H

#include "drivebridge/axis.h"
#include "drivebridge/bus.h"
#include "drivebridge/config.h"
#include "drivebridge/registers.h"

#include <systemd/sd-event.h>

struct service;

/* A configuration, as long as somebody uses a part of it: who was left alone by a reload goes on
 * with the sections it was made from. */
struct edition {
	struct db_config *config;
	unsigned users;
};

struct plant_bus {
	struct service *service;
	struct edition *edition;
	const struct db_bus_config *config;
	struct db_bus *bus;
	uint32_t number; /* no other bus's, ever */
	sd_event_source *completions;
	uint32_t beats; /* seen last */
	db_time beaten; /* when they changed */

	/* Of a reload. */
	bool leaving;             /* it ends */
	struct db_change *change; /* of its drives, to be handed over */
	bool changing;            /* handed over, not carried out */
};

struct plant_drive {
	struct edition *edition;
	const struct db_drive_config *config;
	struct plant_bus *bus;
	struct db_axis *axis;
	uint16_t number; /* see struct db_bus_drive */
};

/* In the order of its configuration. */
struct plant {
	struct edition *edition;
	struct plant_bus **buses;
	size_t bus_count;
	struct plant_drive **drives;
	size_t drive_count;
};

/*
 * For a configuration, which is the plant's from now on, also when this fails; with what it has in
 * common with `running`, which may be null. Nothing is started. *last_number is the number given
 * last. 0 or a negative errno.
 */
int plant_new(struct service *service, struct db_config *config, const struct plant *running,
              uint16_t *last_number, struct plant **plant);

/* Frees the plant, but not what `other` has, too; that may be null. Buses are ended first. */
void plant_free(struct plant *plant, const struct plant *other);

/* Ends all buses side by side, and frees them: their drives stay. */
void plant_end(struct plant *plant);

bool plant_has_bus(const struct plant *plant, const struct plant_bus *bus);
bool plant_has_drive(const struct plant *plant, const struct plant_drive *drive);

/* Of these names; null. */
const struct plant_bus *plant_bus_named(const struct plant *plant, const char *name);
const struct plant_drive *plant_drive_named(const struct plant *plant, const char *name);

/* Whether both have the same parts in the same order, and say the same about clients. */
bool plant_same(const struct plant *a, const struct plant *b);

/* The drives of a bus as db_bus_new() takes them, and those that come to it or leave it as
 * db_bus_change_new() does: those on this bus that only `plant` has. To be freed; null when out of
 * memory. */
struct db_bus_drive *plant_drives_on(const struct plant *plant, const struct plant_bus *bus,
                                     const struct plant *except, size_t *count);

/* The plant as the registers take it. */
struct plant_roster {
	struct db_roster roster;
	struct db_roster_bus *buses;
	struct db_roster_drive *drives;
};

/* 0 or -ENOMEM. */
int plant_roster_init(struct plant_roster *roster, const struct plant *plant);
void plant_roster_release(struct plant_roster *roster);

#endif
