/* SPDX-License-Identifier: Apache-2.0 */
/* The whole simulation: buses with their ports, drives on them. One thread. */
#ifndef DRIVEBRIDGE_SIM_WORLD_H
#define DRIVEBRIDGE_SIM_WORLD_H

#include "sim/node.h"
#include "sim/port.h"
#include "sim/sim_config.h"
#include "sim/wire.h"

#include <stdio.h>

struct sim_bus {
	const struct sim_bus_config *config;
	struct sim_port port;
	const struct sim_wire_ops *ops;
	void *wire;        /* the argument of ops */
	size_t write_unit; /* the port takes this number of bytes at a time; 0: any number */
	FILE *trace;       /* not owned, may be null */
};

/* Records which commands a drive obeyed, and when its motors stopped. */
struct sim_observer {
	const struct sim_node *node;
	FILE *trace;     /* not owned, may be null */
	unsigned moving; /* at the last check: bit 0, for XYZA controllers one bit per axis */
};

struct sim_world {
	struct sim_bus *buses;
	size_t bus_count;
	struct sim_node *nodes;
	struct sim_observer *observers; /* one for each node, at the same index */
	size_t node_count;
};

/*
 * Opens all ports and powers all drives up. `config` must outlive the world. trace may be null. 0,
 * or -1 after a message on standard error; the world is to be closed in both cases.
 */
int sim_world_open(struct sim_world *world, const struct sim_config *config, FILE *trace,
                   db_time now);
void sim_world_close(struct sim_world *world);

/* The host sent something on this bus, or its port failed (negative errno). */
int sim_bus_read(struct sim_bus *bus, db_time now);

/* Does all that is due. */
void sim_world_run(struct sim_world *world, db_time now);

/* When to run next; DB_TIME_NEVER when nothing moves. */
db_time sim_world_next(const struct sim_world *world, db_time now);

/* Writes an event of a drive into the trace, with its motion after it. */
void sim_world_report(struct sim_world *world, const struct sim_node *node, const char *text,
                      db_time now);

/* Sets a fault from its text, for a drive or (node null) for a bus: those of faults.h, for drives
 * also "stall [on|off]", and for those with a flash "flash fail|ok". Null, or the mistake. */
const char *sim_world_fault(struct sim_node *node, struct sim_bus *bus, const char *text,
                            db_time now);

#endif
