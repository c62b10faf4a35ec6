/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interface between the world or the control commands and a family of simulated drives: one
 * table for each kind of bus. One thread. Members that may be null say so; a node's drive exists
 * unless open() failed.
 */
#ifndef DRIVEBRIDGE_SIM_FAMILY_H
#define DRIVEBRIDGE_SIM_FAMILY_H

#include "sim/node.h"
#include "sim/serial_bus.h"
#include "sim/sim_config.h"

#include <stdio.h>

/* A control command that only this family has. */
struct sim_family_command {
	const char *name;
	/* Null, or the mistake. */
	const char *(*run)(struct sim_node *node, const char *rest, db_time now);
};

struct sim_family {
	const struct sim_serial_protocol *protocol; /* null: on CAN */

	/* Makes the drive of this node with its switches, and attaches it to the wire: a serial bus
	 * or a CAN line. `flash`: its memory's file, or null. False when there is no room; close()
	 * then frees what was made. */
	bool (*open)(struct sim_node *node, void *wire, const struct sim_bus_config *bus,
	             const struct sim_drive_config *config, const char *flash, db_time now);
	void (*close)(struct sim_node *node); /* after the wire was freed */

	/* Something changes as time passes; null: while a motor moves. */
	bool (*is_busy)(const struct sim_node *node);
	void (*advance)(struct sim_node *node, db_time now);
	/* Bit 0; for controllers with several axes one bit each. */
	unsigned (*moving_motors)(const struct sim_node *node);
	/* " NAME=VALUE" pairs about its motion. */
	void (*write_motion)(const struct sim_node *node, db_time now, FILE *out);
	/* The same with all its state, for the command `get`. */
	void (*write_state)(struct sim_node *node, db_time now, FILE *out);

	unsigned (*get_address)(const struct sim_node *node);
	void (*set_address)(struct sim_node *node, unsigned address);
	void (*power)(struct sim_node *node, bool on, db_time now);

	const struct sim_family_command *commands; /* the last one has no name */
};

/* By enum sim_bus_kind. */
extern const struct sim_family *const sim_families[SIM_BUS_KINDS];

/* The families, each beside its name. */
extern const struct sim_family sim_vsmd_serial_family;
extern const struct sim_family sim_vsmd_can_family;
extern const struct sim_family sim_xyza_family;
extern const struct sim_family sim_servo_can_family;

#endif
