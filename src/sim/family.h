/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the world and the control commands need of a family of simulated drives: one table for each kind of
 * bus. One thread. What may be null is said; a node's drive is there unless open() failed.
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
	/* Null, or what is wrong. */
	const char *(*run)(struct sim_node *node, const char *rest, db_time now);
};

struct sim_family {
	const struct sim_serial_protocol *protocol; /* null: on CAN */

	/* Makes the drive of this node, and puts it on the wire: of a serial bus or a CAN line. `flash`: its
	 * memory's file, or null. False when there is no room; what was made is freed by close(). */
	bool (*open)(struct sim_node *node, void *wire, const struct sim_bus_config *bus,
	             const struct sim_drive_config *config, const char *flash, db_time now);
	void (*close)(struct sim_node *node); /* after the wire was freed */

	/* Something changes as time passes. */
	bool (*is_busy)(const struct sim_node *node);
	void (*advance)(struct sim_node *node, db_time now);
	/* Bit 0, of controllers with several axes a bit for each. */
	unsigned (*moving_motors)(const struct sim_node *node);
	/* " NAME=VALUE" pairs: how it moves. */
	void (*write_motion)(const struct sim_node *node, db_time now, FILE *out);
	/* Likewise all that there is to see, for the command `get`. */
	void (*write_state)(struct sim_node *node, db_time now, FILE *out);

	unsigned (*get_address)(const struct sim_node *node);
	void (*set_address)(struct sim_node *node, unsigned address);
	void (*power)(struct sim_node *node, bool on, db_time now);

	/* Holds the shaft, or lets it go; null: it does not see its motors. */
	void (*stall)(struct sim_node *node, bool stalled, db_time now);
	/* Shows these status bits beside the real ones; null: it has none. */
	void (*force_status)(struct sim_node *node, uint32_t bits);
	/* Writing its parameters fails; null: it has no such memory. */
	void (*fail_flash)(struct sim_node *node, bool fail);

	const struct sim_family_command *commands; /* the last one has no name */
};

/* By enum sim_bus_kind. */
extern const struct sim_family *const sim_families[SIM_BUS_KINDS];

#endif
