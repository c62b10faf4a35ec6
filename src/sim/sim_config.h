/* SPDX-License-Identifier: Apache-2.0 */
/* The simulator's configuration file, checked, as plain structs. */
#ifndef DRIVEBRIDGE_SIM_CONFIG_H
#define DRIVEBRIDGE_SIM_CONFIG_H

#include "reader/reader.h"
#include "sim/can_line.h"
#include "sim/serial_bus.h"
#include "sim/servo_can_node.h"
#include "sim/servo_drive.h"
#include "sim/vsmd_can_node.h"
#include "sim/vsmd_drive.h"
#include "sim/xyza_controller.h"

#include <stdio.h>
#include <sys/types.h>

#define SIM_FAULT_TEXTS_MAX 16

enum sim_bus_kind {
	SIM_BUS_VSMD_SERIAL,
	SIM_BUS_VSMD_CAN,
	SIM_BUS_SERVO_CAN,
	SIM_BUS_XYZA,
	SIM_BUS_KINDS
};

struct sim_bus_config {
	const char *name;
	enum sim_bus_kind kind;
	const char *device;    /* "pty" or a path */
	const char *interface; /* CAN network interface, null: a serial adapter on device */
	const char *link;      /* null: none */
	/* of the link to a pty, which has the bus's name, if `link` is null */
	const char *folder;
	const gid_t *group; /* whose members may open a pty, null: the system's default */
	const char *flash;  /* directory, null: none */
	const char *replay; /* a trace in place of drives, null: none */
	bool follows_host;  /* for a pty: its line has the speed that the host has set there */
	struct sim_serial_config serial; /* serial lines */
	struct sim_can_config can;       /* CAN */
	struct vsmd_can_style style;
	struct servo_can_layout layout; /* servos */
	const char *faults[SIM_FAULT_TEXTS_MAX];
	size_t fault_count;
};

struct sim_drive_config {
	const char *name;
	size_t bus; /* index */
	unsigned address;
	/* on a serial line: in addition to the bus's latency, */
	db_time latency;
	db_time deaf;                            /* and to its turnaround */
	struct sim_vsmd_config vsmd;             /* flash_path is left null */
	struct sim_servo_config servo;           /* on a bus of servos instead ... */
	enum sim_servo_lengths servo_lengths;    /* ... for its frames ... */
	db_time servo_ack_latency;               /* ... and in addition to the bus's latency */
	bool servo_stray_acks;                   /* see sim_servo_node */
	struct sim_xyza_config xyza;             /* also instead; flash_path is left null */
	const char *faults[SIM_FAULT_TEXTS_MAX]; /* in the form of the control socket's `fault` */
	size_t fault_count;
};

struct sim_config {
	struct sim_bus_config *buses;
	size_t bus_count;
	struct sim_drive_config *drives;
	size_t drive_count;
	struct db_reader reader; /* owns the texts */
};

/*
 * On success 0, and the configuration is to be freed. Otherwise -1, and every mistake was written
 * to standard error as "file:line: what is wrong; what would be right".
 */
int sim_config_load(const char *path, struct sim_config *config);

/* The same from a text; messages to `errors` call it `file`. */
int sim_config_parse(const char *text, const char *file, FILE *errors, struct sim_config *config);

void sim_config_free(struct sim_config *config);

#endif
