/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant: the running buses and drives, each with the section it was made from. A plant made for
 * another configuration shares with the running one all parts that are equal. Internal to
 * src/bridge/service; network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_PLANT_H
#define DRIVEBRIDGE_SERVICE_PLANT_H

#include "drivebridge/axis.h"
#include "drivebridge/bus.h"
#include "drivebridge/config.h"
#include "drivebridge/registers.h"

#include <systemd/sd-event.h>

struct service;

/* A configuration, kept while a part of it is in use: buses and drives that a reload leaves
 * unchanged keep the sections they were made from. */
struct edition {
	struct db_config *config;
	unsigned users;
};

struct plant_bus {
	struct service *service;
	struct edition *edition;
	const struct db_bus_config *config;
	struct db_bus *bus;
	uint32_t number; /* unique for all time */
	sd_event_source *completions;
	uint32_t beats; /* beats when last checked */
	db_time beaten; /* when they changed */

	/* For a reload. */
	bool leaving;             /* the bus ends */
	struct db_change *change; /* change of its drives, to be handed over */
	bool changing;            /* handed over, not yet carried out */
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
 * Makes the plant for a configuration, which it takes over, also on failure; parts equal to those
 * of `running`, which may be null, are shared. Nothing is started. *last_number is the last number
 * used. 0 or a negative errno.
 */
int plant_new(struct service *service, struct db_config *config, const struct plant *running,
              uint16_t *last_number, struct plant **plant);

/* Frees the plant, except the parts shared with `other`, which may be null. Buses are ended
 * first. */
void plant_free(struct plant *plant, const struct plant *other);

/* Ends all buses in parallel. Their drives stay, and the requests that they have not ended. */
void plant_end(struct plant *plant);

bool plant_has_bus(const struct plant *plant, const struct plant_bus *bus);
bool plant_has_drive(const struct plant *plant, const struct plant_drive *drive);

/* The bus of this name; null. */
const struct plant_bus *plant_bus_named(const struct plant *plant, const char *name);
const struct plant_drive *plant_drive_named(const struct plant *plant, const char *name);

/* True if both have the same parts in the same order, and equal settings for clients. */
bool plant_same(const struct plant *a, const struct plant *b);

/* The drives of a bus for db_bus_new(), and those that are added or removed for
 * db_bus_change_new(): those on this bus that only `plant` has. To be freed; null when out of
 * memory. */
struct db_bus_drive *plant_drives_on(const struct plant *plant, const struct plant_bus *bus,
                                     const struct plant *except, size_t *count);

/* The plant in the form for the registers. */
struct plant_roster {
	struct db_roster roster;
	struct db_roster_bus *buses;
	struct db_roster_drive *drives;
};

/* 0 or -ENOMEM. */
int plant_roster_init(struct plant_roster *roster, const struct plant *plant);
void plant_roster_release(struct plant_roster *roster);

#endif
