/* SPDX-License-Identifier: Apache-2.0 */
/*
 * All values that the registers of one view can show, in one struct of one moment. Register rows
 * refer to its members by offset; only the parts that a read touches are filled in.
 */
#ifndef DRIVEBRIDGE_REGMAP_IMAGE_H
#define DRIVEBRIDGE_REGMAP_IMAGE_H

#include "drivebridge/axis.h"
#include "drivebridge/bus.h"
#include "drivebridge/commander.h"
#include "drivebridge/configuration.h"
#include "drivebridge/server.h"

/* Parts of the images. */
enum db_part {
	DB_PART_PROCESS = 1u << 0, /* cheap: snapshot and results */
	DB_PART_BLOCK = 1u << 1,   /* the command block */
	DB_PART_PLATE = 1u << 2,   /* parameters and identity */
	DB_PART_STATIC = 1u << 3,  /* from the configuration */
	DB_PART_SERVER = 1u << 4,
	DB_PART_BUSES = 1u << 5,
	DB_PART_DRIVES = 1u << 6,
	DB_PART_WINDOWS = 1u << 7,
	DB_PART_CLIENTS = 1u << 8,
	DB_PART_GROUP = 1u << 9,
	DB_PART_HISTORY = 1u << 10,
	DB_PART_HOLDER = 1u << 11, /* names of the client in control */
};

/* Quality of process data, as in OPC. */
#define DB_QUALITY_BAD 0
#define DB_QUALITY_UNCERTAIN 64
#define DB_QUALITY_GOOD 192

#define DB_UNIT_NAME_REGISTERS 8
#define DB_IDENTITY_REGISTERS (DB_IDENTITY_MAX / 2)
#define DB_CLIENT_ADDRESS_REGISTERS 20 /* the longest address has 39 characters */
#define DB_CLIENT_USER_REGISTERS (DB_CLIENT_USER_MAX / 2)
#define DB_CONFIGURATION_MESSAGE_REGISTERS 80

/* A set of units: unit 1 is bit 0 of the first word. */
#define DB_GROUP_WORDS 16

struct db_drive_history {
	struct db_history_entry entry; /* `number` of a parameter is its register */
	uint32_t ipv4;
	char address[2 * DB_CLIENT_ADDRESS_REGISTERS];
	char user[2 * DB_CLIENT_USER_REGISTERS];
};

/* Unit 1..247. */
struct db_drive_image {
	/* DB_PART_PROCESS; `state` and `feedback` belong to it. */
	uint16_t quality;
	uint32_t status;
	uint32_t age_ms;
	uint32_t poll_interval_ms;
	float position_units;
	float velocity_units;
	uint32_t capabilities;
	struct db_command_state state;
	struct db_feedback feedback;
	struct db_axis_stats stats;
	struct db_learnt learnt;
	struct db_must_stand must_stand;
	uint16_t must_stand_cause;
	uint32_t must_stand_ms;
	struct db_trouble trouble;
	uint32_t trouble_ms;
	uint16_t heartbeat;
	/* The same part, but about the client that reads. */
	uint16_t control_request;
	uint16_t control_port;
	uint32_t control_holder;
	uint32_t control_remaining_ms;

	/* DB_PART_HOLDER */
	char control_address[2 * DB_CLIENT_ADDRESS_REGISTERS];
	char control_user[2 * DB_CLIENT_USER_REGISTERS];

	struct db_command_block block;

	/* DB_PART_PLATE */
	struct db_nameplate_copy nameplate;

	/* DB_PART_STATIC */
	uint16_t bus; /* from 1 */
	uint16_t address;
	char unit_name[2 * DB_UNIT_NAME_REGISTERS];
	float counts_per_unit;

	/* DB_PART_HISTORY, the newest first */
	struct db_drive_history history[DB_HISTORY_MAX];
};

/* Every drive of an endpoint has a window: units are 1 to 247. */
#define DB_GATEWAY_WINDOWS 247

/* Number of buses that the gateway view shows in detail; there may be more. */
#define DB_GATEWAY_BUSES 8
#define DB_GATEWAY_DRIVES 32
#define DB_GATEWAY_CLIENTS 16

enum db_line_bit {
	DB_LINE_UP = 1u << 0,
	DB_LINE_BUS_OFF = 1u << 1,
	DB_LINE_PASSIVE = 1u << 2,
	DB_LINE_WARNING = 1u << 3,
};

struct db_gateway_bus {
	uint16_t up;
	uint16_t last_error;
	uint16_t line_state; /* enum db_line_bit */
	uint16_t line_error;
	struct db_bus_stats stats;
};

struct db_gateway_drive {
	uint16_t unit;
	uint16_t online;
	uint16_t axis_state;
	uint16_t error;
	uint32_t age_ms;
	struct db_axis_stats stats;
};

/* One drive in the flat window: what its own unit shows, of one moment. */
struct db_gateway_window {
	uint16_t unit;
	uint16_t online;
	uint16_t axis_state;
	uint16_t error;
	uint32_t status;
	uint16_t quality;
	uint16_t active_command;
	uint32_t age_ms;
	int32_t position;
	float velocity;
	float position_units;
	float velocity_units;
	uint32_t drive_status;
	uint16_t result_id;
	uint16_t result;
	uint16_t inputs;
	uint16_t outputs;
};

struct db_gateway_client {
	uint32_t ipv4;
	uint16_t port;
	uint16_t may_write;
	uint32_t requests;
	uint32_t idle_s;
	uint32_t connected_s;
	uint32_t controls; /* bit 0: the first drive of the endpoint that is read */
	char address[2 * DB_CLIENT_ADDRESS_REGISTERS];
};

/* Units 0, 255 and the configured one. */
struct db_gateway_image {
	/* DB_PART_SERVER */
	uint16_t version_major;
	uint16_t version_minor;
	uint16_t version_patch;
	uint16_t bus_count;
	uint16_t drive_count;
	uint16_t drives_online;
	uint32_t uptime_s;
	struct db_server_stats server;
	uint16_t configuration_state; /* enum db_configuration_state */
	uint64_t configuration_since_us;
	char configuration_message[2 * DB_CONFIGURATION_MESSAGE_REGISTERS]; /* not terminated when
	                                                                       it is full */
	/* DB_PART_GROUP: what is written to the gateway, and the result */
	uint16_t heartbeat;
	uint16_t group_stop; /* these two read as 0 */
	uint16_t group_start;
	uint16_t group_staged;
	uint16_t group_drives;
	uint16_t group_result;
	uint16_t group_busy;
	uint32_t group_skew_us;
	uint16_t group_units[DB_GROUP_WORDS];
	uint16_t group_stop_units; /* reads as 0 */
	/* DB_PART_BUSES, DB_PART_DRIVES, DB_PART_WINDOWS, DB_PART_CLIENTS */
	struct db_gateway_bus buses[DB_GATEWAY_BUSES];
	struct db_gateway_drive drives[DB_GATEWAY_DRIVES];
	struct db_gateway_window windows[DB_GATEWAY_WINDOWS];
	struct db_gateway_client connected[DB_GATEWAY_CLIENTS];
};

struct db_view_drive;
struct db_view_space;
struct db_registers;

/*
 * Fill the parts of an image, as shown to `client`; null: as shown to any client that never
 * commanded. All values of a drive are from one snapshot. Repeated parts are only filled where
 * their members are between the offsets low and high. Network thread.
 */
void db_image_fill_drive(struct db_drive_image *image, const struct db_view_drive *drive,
                         const struct db_client *client, unsigned parts, uint16_t low,
                         uint16_t high);
/* The drives are those of the space, see regmap_private.h. */
void db_image_fill_gateway(struct db_gateway_image *image, const struct db_registers *registers,
                           const struct db_view_space *space, const struct db_client *client,
                           unsigned parts, uint16_t low, uint16_t high);
/* The names of a client, not terminated where they are full; both are zeroed before. */
void db_image_name_client(const struct db_registers *registers, const uint8_t address[16],
                          char shown[2 * DB_CLIENT_ADDRESS_REGISTERS],
                          char user[2 * DB_CLIENT_USER_REGISTERS]);
/* Fills one of the buses shown. */
void db_image_fill_bus(struct db_gateway_bus *bus, const struct db_registers *registers,
                       size_t place);

#endif
