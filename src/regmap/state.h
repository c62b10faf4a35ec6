/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The insides of struct db_registers: what all files of the room work on. Network thread only.
 */
#ifndef DRIVEBRIDGE_REGMAP_STATE_H
#define DRIVEBRIDGE_REGMAP_STATE_H

#include "drivebridge/commander.h"
#include "drivebridge/control.h"
#include "drivebridge/heartbeat.h"
#include "drivebridge/registers.h"
#include "regmap/image.h"
#include "regmap/map.h"

struct db_view_drive {
	struct db_registers *registers;
	uint16_t drive; /* see struct db_bus_drive */
	bool leaving;   /* nobody reaches it any more; its bus still has it */
	const struct db_drive_config *config;
	const struct db_bus_config *bus_config;
	struct db_bus *bus; /* for the ops */
	size_t bus_index;   /* among the buses shown */
	const struct db_driver *driver;
	const struct db_map *map;
	struct db_axis *axis;
	struct db_commander *commander;
	struct db_control control;
	struct db_heartbeat heartbeat;
	struct db_heartbeat gateway_heartbeat; /* as written by who may feed this drive */
	uint32_t group_ticket;                 /* its part of the group command under way; 0 */
	uint32_t group_start;                  /* how its part of a start is numbered */
	struct db_vsmd_view *vsmd_view;        /* null: it has no unit with the vendor's layout */
	uint32_t capabilities;
	db_time fresh_for;     /* older data is not `good` any more */
	db_time useless_after; /* older data is not shown at all */
};

/* What a unit is that is no drive's. */
#define DB_UNIT_GATEWAY UINT16_MAX
#define DB_UNIT_NONE (UINT16_MAX - 1)

/* What is shown: struct db_roster, and what follows from it. */
struct db_view_roster {
	const struct db_modbus_config *modbus;
	struct db_map gateway;
	uint16_t units[256];    /* index of the drive, DB_UNIT_GATEWAY or DB_UNIT_NONE */
	bool vendor_units[256]; /* the drive's unit has the vendor's layout */
	struct db_bus **buses;
	const struct db_bus_config **bus_configs; /* in the same order */
	size_t bus_count;
	struct db_view_drive **drives;
	size_t drive_count;
};

/* One group command under way, and how the last one went. */
struct db_group {
	struct db_write_token writer;   /* who waits for it */
	bool waits;                     /* the writer was not answered yet */
	uint32_t generation;            /* tells answers of this one from those of older ones */
	unsigned pending;               /* drives that have not ended theirs */
	uint8_t worst;                  /* exception so far */
	uint16_t units[DB_GROUP_WORDS]; /* those that a stop of a list is for, as written last */

	/* Shown. */
	uint16_t result;  /* exception of the last group command; 0 = all drives confirmed */
	uint16_t drives;  /* how many it was for */
	uint32_t skew_us; /* between the first and the last drive's command on the wire */
	db_time first_out;
	db_time last_out;
};

struct db_registers {
	const struct db_registers_ops *ops;
	void *context;
	db_time started;
	struct db_map *families; /* of every driver that was ever there */
	struct db_view_roster *roster;
	uint32_t generation; /* grows with each change of the roster */
	struct db_group group;
	uint16_t heartbeat;              /* of the gateway, written last */
	char model[DB_IDENTITY_MAX + 1]; /* device_id's answer, valid until the next call */
	db_time due; /* when db_registers_expire() is to be called, as returned last */
};

#endif
