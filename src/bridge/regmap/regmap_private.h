/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the register map for each other: the drives that it shows, their reads and writes.
 * Network thread, where not said otherwise.
 */
#ifndef DRIVEBRIDGE_REGMAP_REGMAP_PRIVATE_H
#define DRIVEBRIDGE_REGMAP_REGMAP_PRIVATE_H

#include "drivebridge/axis.h"
#include "drivebridge/client.h"
#include "drivebridge/commander.h"
#include "drivebridge/control.h"
#include "drivebridge/registers.h"
#include "drivebridge/result.h"
#include "drivebridge/server.h"
#include "regmap/image.h"
#include "regmap/index.h"
#include "regmap/map.h"

#include <stdbool.h>
#include <stdint.h>

struct db_registers;
struct db_view_drive;
struct db_view_roster;

/* --- state.c ---------------------------------------------------------------------------------- */

/*
 * The contents of struct db_registers, used by all files of the room.
 */

struct db_view_drive {
	struct db_registers *registers;
	uint16_t drive; /* see struct db_bus_drive */
	bool leaving;   /* clients do not reach it any more; its bus still has it */
	const struct db_drive_config *config;
	const struct db_bus_config *bus_config;
	struct db_bus *bus; /* for the ops */
	size_t bus_index;   /* index in the buses shown */
	const struct db_driver *driver;
	const struct db_map *map;
	struct db_axis *axis;
	struct db_commander *commander;
	struct db_control control;
	struct db_heartbeat heartbeat;
	struct db_heartbeat gateway_heartbeat; /* as written by clients that may feed this drive */
	/* ticket of its part of the latest group command, and whose that is; 0 and null */
	uint32_t group_ticket;
	struct db_group *group;
	uint32_t group_start;           /* group number of its part of a start */
	struct db_vsmd_view *vsmd_view; /* null: it has no unit with the vendor's layout */
	uint32_t capabilities;
	db_time useless_after; /* older data is not shown at all */
};

/* Values for units without a drive. */
#define DB_UNIT_GATEWAY UINT16_MAX
#define DB_UNIT_NONE (UINT16_MAX - 1)

/* What clients of one endpoint see: its units, and its drives in the order of the configuration. */
struct db_view_space {
	uint32_t endpoint;             /* its number */
	struct db_gateway_unit *own;   /* the gateway's own unit there */
	struct db_map gateway;         /* the registers of that */
	uint16_t units[256];           /* index in the roster, DB_UNIT_GATEWAY or DB_UNIT_NONE */
	bool vendor_units[256];        /* the drive's unit has the vendor's layout */
	struct db_view_drive **drives; /* null is possible where there is none */
	size_t drive_count;
};

/* The present roster: struct db_roster, and what follows from it. */
struct db_view_roster {
	const struct db_modbus_config *modbus;
	/* One for each endpoint, the first one first; when there are several, another one with the
	 * drives of all, for programs that name drives. */
	struct db_view_space *spaces;
	size_t space_count;
	struct db_bus **buses;
	const struct db_bus_config **bus_configs; /* in the same order */
	size_t bus_count;
	struct db_view_drive **drives;
	size_t drive_count;
};

/* The current group command of the clients of an endpoint, and the result of the last one. */
struct db_group {
	struct db_write_token writer; /* the writer that waits for it */
	bool waits;                   /* the writer was not answered yet */
	/* distinguishes answers to this command from those to older ones */
	uint32_t generation;
	unsigned pending;               /* number of drives that have not ended their parts */
	uint8_t worst;                  /* worst exception so far */
	uint16_t units[DB_GROUP_WORDS]; /* the units for a stop of a list, as last written */

	/* Shown in registers. */
	uint16_t result;  /* exception of the last group command; 0 = all drives confirmed */
	uint16_t drives;  /* number of drives it was for */
	uint32_t skew_us; /* between the first and the last drive's command on the wire */
	db_time first_out;
	db_time last_out;
};

/* What is written to the gateway's own unit of an endpoint; it outlives a change of the roster. */
struct db_gateway_unit {
	struct db_gateway_unit *next;
	uint32_t endpoint;
	struct db_group group;
	uint16_t heartbeat; /* as last written */
};

struct db_registers {
	const struct db_registers_ops *ops;
	void *context;
	db_time started;
	struct db_map *families; /* of every driver used so far */
	struct db_view_roster *roster;
	uint32_t generation;             /* incremented with each change of the roster */
	struct db_gateway_unit *units;   /* of every endpoint so far */
	uint32_t group_generation;       /* that of the latest group command */
	char model[DB_IDENTITY_MAX + 1]; /* device_id's answer, valid until the next call */
	db_time due;                     /* when db_registers_expire() is due, as last returned */
};

/* --- roster.c --------------------------------------------------------------------------------- */

/*
 * The drives that the registers show, and the change to another configuration:
 * db_registers_prepare(), _retire(), _apply() and _change_free().
 */

/* The drive of this number; null: it was removed, or there is no roster yet. */
struct db_view_drive *db_view_roster_find(const struct db_view_roster *roster, uint16_t drive);

/* What this client sees; null: its endpoint is not there (any more, or yet). */
struct db_view_space *db_view_space_of(const struct db_registers *registers,
                                       const struct db_client *client);
/* The drives of all endpoints. */
struct db_view_space *db_view_space_whole(const struct db_registers *registers);

/* Also frees its drives; null is fine. */
void db_view_roster_free(struct db_view_roster *roster);

/* --- drive.c ---------------------------------------------------------------------------------- */

/*
 * One drive in the registers, with its commander and the callbacks of that: the bus takes the
 * requests, and a write's answer goes to the group, the vendor's layout or the client that waits
 * for it.
 */

/* Makes the view of a drive of the roster. Its settings that a reload may change are set later.
 * Null when out of memory. */
struct db_view_drive *db_view_drive_new(struct db_registers *registers,
                                        const struct db_roster *roster,
                                        const struct db_roster_drive *member);
void db_view_drive_free(struct db_view_drive *drive); /* null is fine */

/* --- read.c ----------------------------------------------------------------------------------- */

/* Reads of a drive's unit and of the gateway's: db_backend's read for each. */

uint8_t db_read_drive(const struct db_view_drive *drive, const struct db_client *client,
                      enum db_table table, uint16_t address, uint16_t count, uint16_t *values);
uint8_t db_read_gateway(const struct db_registers *registers, const struct db_view_space *space,
                        const struct db_client *client, enum db_table table, uint16_t address,
                        uint16_t count, uint16_t *values);

/* Fills in the parts of a drive's image, as db_image_fill_drive(), and the client in control. */
void db_read_image(struct db_drive_image *image, const struct db_view_drive *drive,
                   const struct db_client *client, unsigned parts, uint16_t low, uint16_t high);

/* True if the value of a register in a filled image is known: not old, and no parameter that the
 * drive has not reported. */
bool db_read_is_known(const struct db_view_drive *drive, const struct db_drive_image *image,
                      const struct db_cell *cell);

/* --- write.c ---------------------------------------------------------------------------------- */

/*
 * Writes to a drive's unit: address first (02), then form and range (03), then the commander.
 */

/* db_backend's write. */
int db_write_drive(struct db_view_drive *drive, const struct db_client *client, enum db_table table,
                   uint16_t address, uint16_t count, const uint16_t *values,
                   struct db_write_token token);

/* The stop in a write of holding registers; NONE. */
enum db_command db_write_find_stop(const struct db_view_drive *drive, uint16_t address,
                                   uint16_t count, const uint16_t *values);

/* db_backend's write_same. */
int db_write_drive_same(struct db_view_drive *drive, const struct db_client *client,
                        uint16_t address, uint16_t value, struct db_write_token token);

/* --- record.c --------------------------------------------------------------------------------- */

/* What is asked of drives here, as records of the audit trail. */

/* See struct db_commander_ops. `context`: a struct db_view_drive. */
uint32_t db_record_request(void *context, const struct db_recorded *recorded);
void db_record_end(void *context, uint32_t record, enum db_result result, db_time took);
/* A client has taken or released control of a drive. */
void db_record_control(const struct db_view_drive *drive, const struct db_client *client,
                       bool taken);
/* A client has set the drive's watchdog. */
void db_record_watchdog(const struct db_view_drive *drive, const struct db_client *client,
                        uint32_t old, uint32_t new);
/* A write was refused before a drive was asked; `drive`: null where there is none. */
void db_record_denied(const struct db_registers *registers, const struct db_view_drive *drive,
                      const struct db_client *client, uint8_t unit, uint16_t address,
                      const char *why);

/* --- gateway.c -------------------------------------------------------------------------------- */

/*
 * Writes to the gateway's unit: commands to many drives, and the heartbeat for all. Network thread
 * only.
 */

/* db_backend's write. */
int db_gateway_write(struct db_registers *registers, const struct db_view_space *space,
                     const struct db_client *client, enum db_table table, uint16_t address,
                     uint16_t count, const uint16_t *values, struct db_write_token token);

/* --- exception.c ------------------------------------------------------------------------------ */

/* Results as Modbus exceptions: the only place that converts them. Pure. */

/* The Modbus exception for this result; 0 for NONE, OK and UNPROVEN. PENDING is 05. */
uint8_t db_exception_of(enum db_result result);

/* The most likely result for an exception, where nothing else is known. */
enum db_result db_exception_result(uint8_t exception);

/* The return value of db_backend's write for it: 0, an exception, or DB_WRITE_LATER. */
int db_exception_of_answer(struct db_write_answer answer);

/* Why a drive cannot be reached: 0B, or 0A when its bus is down. */
uint8_t db_exception_unreachable(const struct db_feedback *feedback);

/* --- words.c ---------------------------------------------------------------------------------- */

/* Values to Modbus registers and back: types and word order. Pure. */

/* The longest text: configuration_message. */
#define DB_CELL_REGISTERS_MAX 80

/* Writes the cell's registers from the image to words[]. */
void db_words_encode(const struct db_cell *cell, const void *image, bool low_first,
                     uint16_t *words);

/* The value of a cell's registers. False when a float is not finite. */
bool db_words_decode(const struct db_cell *cell, const uint16_t *words, bool low_first,
                     union db_value *value);

/* Stores a value in an image's member of the cell's type. */
void db_words_store(const struct db_cell *cell, union db_value value, void *image);

/* --- span.c ----------------------------------------------------------------------------------- */

/* The registers or coils that a write covers, and whether it is allowed. Pure. */

struct db_span {
	const struct db_cell *cells;
	uint16_t count;
};

/* 0 when every register exists, may be written, and belongs to the same block as the others; else
 * 02. */
uint8_t db_span_find(const struct db_index *index, uint16_t address, uint16_t count,
                     struct db_span *span);

/* False if the write covers only half of a 32-bit value. */
bool db_span_is_whole(const struct db_span *span, uint16_t address, uint16_t count);

/* The same for one register: 0, 02, or 03 when it is half of a value. */
uint8_t db_span_find_single(const struct db_index *index, uint16_t address, struct db_span *span);

/* --- capabilities.c --------------------------------------------------------------------------- */

/* What a drive can do, as the capabilities register shows it. Pure. */

#define DB_CAPABILITY_COUNT 19

/* The bits for a set of commands (DB_COMMAND_BIT()) and measures (enum db_measure). */
uint32_t db_capabilities(uint64_t commands, unsigned measures);
/* "move_velocity" ...; "unknown" from DB_CAPABILITY_COUNT on. */
const char *db_capability_name(unsigned bit);

#endif
