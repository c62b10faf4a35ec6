/* SPDX-License-Identifier: Apache-2.0 */
/* The insides of struct db_registers. Internal to src/regmap. */
#ifndef DRIVEBRIDGE_REGMAP_VIEW_H
#define DRIVEBRIDGE_REGMAP_VIEW_H

#include "drivebridge/commander.h"
#include "drivebridge/control.h"
#include "drivebridge/heartbeat.h"
#include "drivebridge/registers.h"
#include "regmap/group.h"
#include "regmap/image.h"
#include "regmap/index.h"

/* The tables of one view. Families share theirs between their drives. */
struct view_map {
	struct view_map *next;          /* families only */
	const struct db_driver *driver; /* null: the gateway's */
	struct db_index holding;
	struct db_index discrete;
	struct db_index coils;
};

struct view_drive {
	struct db_registers *registers;
	uint16_t drive; /* see struct db_bus_drive */
	bool leaving;   /* nobody reaches it any more; its bus still has it */
	const struct db_drive_config *config;
	const struct db_bus_config *bus;
	struct db_bus *line; /* for the ops */
	size_t bus_place;    /* among the buses shown */
	const struct db_driver *driver;
	const struct view_map *map;
	struct db_axis *axis;
	struct db_commander *commander;
	struct db_control control;
	struct db_client fed_by; /* who fed the watchdog last; id 0: nobody */
	struct db_heartbeat heartbeat;
	struct db_heartbeat gateway_heartbeat; /* as written by who may feed this drive */
	uint32_t group_ticket;                 /* its part of the group command under way; 0 */
	uint32_t group_start;                  /* how its part of a start is numbered */
	struct vsmd_view *vendor;              /* null: it has no unit with the vendor's layout */
	uint32_t capabilities;
	db_time fresh_for;     /* older data is not `good` any more */
	db_time useless_after; /* older data is not shown at all */
};

/* What follows from a roster. */
struct view_layout {
	const struct db_modbus_config *modbus;
	struct view_map gateway;
	uint16_t units[256];    /* place among the drives, VIEW_GATEWAY or VIEW_NOTHING */
	bool vendor_units[256]; /* the drive's unit has the vendor's layout */
	struct db_bus **buses;
	size_t bus_count;
	struct view_drive **drives;
	size_t drive_count;
};

struct db_registers {
	const struct db_registers_ops *ops;
	void *context;
	db_time started;
	struct view_map *families; /* of every driver that was ever there */
	struct view_layout *layout;
	struct group group;
	uint16_t heartbeat;              /* of the gateway, written last */
	char model[DB_IDENTITY_MAX + 1]; /* device_id's answer, valid until the next call */
	db_time due; /* when db_registers_expire() is to be called, as was told last */
};

#define VIEW_GATEWAY UINT16_MAX
#define VIEW_NOTHING (UINT16_MAX - 1)

/* Fills the parts of an image, as `client` is shown it; null: as any that never commanded. What a
 * drive's registers show is from one snapshot. Of what repeats only those whose members lie between
 * the offsets low and high. */
void view_fill_drive(struct db_drive_image *image, const struct view_drive *drive,
                     const struct db_client *client, unsigned parts, uint16_t low, uint16_t high);
void view_fill_gateway(struct db_gateway_image *image, const struct db_registers *registers,
                       const struct db_client *client, unsigned parts, uint16_t low, uint16_t high);

/* The exception that says why a drive cannot be asked: 0B, or 0A when its bus is down. */
uint8_t view_unreachable(const struct db_feedback *feedback);

/*
 * Whether a write of this client may go to the drive's commander: it has control, or takes it now.
 * A stop takes nothing and is only told whether it comes from who has control; it is to be executed
 * in any case, but by itself, with nothing else of its write. What is refused is counted.
 */
bool view_may_write(struct view_drive *drive, const struct db_client *client, bool stop);

/* Tells the drive's watchdog that this client, who may command the drive, is there. */
void view_feed(struct view_drive *drive, const struct db_client *client, enum db_watchdog_feed by);

/* db_backend's write, for the gateway: group commands and the heartbeat. */
int view_write_gateway(struct db_registers *registers, const struct db_client *client,
                       enum db_table table, uint16_t address, uint16_t count,
                       const uint16_t *values, struct db_write_token token);

/* The exception that a write to this holding register alone gets for its address, or 0. */
uint8_t view_check_write(const struct view_map *map, uint16_t address);

/* db_backend's write_same, for a drive. */
int view_write_same(struct view_drive *drive, const struct db_client *client, uint16_t address,
                    uint16_t value, struct db_write_token token);

/* db_backend's write, for a drive. */
int view_write(struct view_drive *drive, const struct db_client *client, enum db_table table,
               uint16_t address, uint16_t count, const uint16_t *values,
               struct db_write_token token);

#endif
