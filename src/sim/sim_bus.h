/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a simulated bus is made of: a medium (how bytes travel: serial_medium.c) and a kind (the
 * family of drives on it: vsmd_kind.c, xyza_kind.c). A kind is one file and one line in kinds.c. One
 * thread.
 */
#ifndef DRIVEBRIDGE_SIM_BUS_H
#define DRIVEBRIDGE_SIM_BUS_H

#include "sim/node.h"
#include "sim/port.h"
#include "sim/serial_bus.h"

#include <confuse.h>
#include <stdio.h>

#define SIM_FAULT_TEXTS_MAX 16

struct sim_bus_config {
	const char *name;
	const struct sim_bus_kind *kind;
	const char *device; /* "pty" or a path */
	const char *link;   /* null = none */
	const char *flash;  /* directory, null = none */
	bool one_drive;     /* the line can have only one */
	struct sim_serial_config serial; /* of the serial medium */
	const char *faults[SIM_FAULT_TEXTS_MAX];
	size_t fault_count;
};

struct sim_drive_config {
	const char *name;
	size_t bus; /* index */
	unsigned address;
	void *settings; /* the kind's; owned, freed with free() */
	const char *faults[SIM_FAULT_TEXTS_MAX]; /* as the control socket's `fault` takes them */
	size_t fault_count;
};

struct sim_bus {
	const struct sim_bus_config *config;
	struct sim_port port;
	void *wire;  /* of the medium's own type */
	FILE *trace; /* not owned, may be null */
};

/* How bytes travel. `wire` is what open() left in bus->wire, and never null but for close(). */
struct sim_medium {
	/* Its keys in bus sections, beside those all buses have; ended by CFG_END(). */
	const cfg_opt_t *bus_options;

	/* Checks and takes over a bus section. 0, or -1 after a report (sim_config_wrong()). */
	int (*load_bus)(cfg_t *cfg, struct sim_bus_config *bus);

	/* Opens bus->port and makes bus->wire. 0, or a negative errno. */
	int (*open)(struct sim_bus *bus, sim_trace_fn *trace);
	void (*close)(struct sim_bus *bus);

	/* False when the bus is full. The node outlives the wire. */
	bool (*attach)(void *wire, struct sim_node *node);

	/* As sim_serial_bus_receive(), _run() and _next(). */
	void (*receive)(void *wire, const uint8_t *bytes, size_t length, db_time now);
	size_t (*run)(void *wire, db_time now, uint8_t *out, size_t size);
	db_time (*next)(void *wire);

	struct sim_faults *(*faults)(void *wire);
	void (*set_rate)(void *wire, unsigned rate);
	void (*write_stats)(void *wire, FILE *out); /* "key=value key=value", no line end */
};

extern const struct sim_medium sim_serial_medium;

/* One more thing to be done with drives over the control socket. Null, or what is wrong; "" when it
 * has written its own "ok" line. */
typedef const char *sim_drive_command_fn(struct sim_node *node, const char *text, db_time now,
                                         FILE *out);

struct sim_drive_command {
	const char *name;
	sim_drive_command_fn *run;
};

/* A family of drives on a medium. `drive` is what new_drive() returned. */
struct sim_bus_kind {
	const char *protocol;
	const struct sim_medium *medium;
	const void *framing; /* for the medium: serial wants a struct sim_serial_protocol */
	unsigned address_max; /* addresses are 1.. */

	/* Its keys in drive sections, beside those all drives have; ended by CFG_END(). Kinds may have
	 * keys of the same name when these are of the same type and have the same default. */
	const cfg_opt_t *drive_options;

	/* Checks a drive section and makes drive->settings (malloc). 0, or -1 after a report. */
	int (*load_drive)(cfg_t *cfg, const struct sim_bus_config *bus,
	                  struct sim_drive_config *drive);

	/* Powered on. flash_path may be null. Null when out of memory. */
	void *(*new_drive)(const struct sim_drive_config *config, const char *flash_path,
	                   db_time now);
	void (*free_drive)(void *drive);

	/* Whether something goes on that is better caught up with from time to time; and doing so. */
	bool (*busy)(const void *drive);
	void (*advance)(void *drive, db_time now);

	unsigned (*address)(const void *drive); /* now */
	void (*power)(void *drive, bool on, db_time now);

	/* Faults of the drive itself, as words of `fault`. False when this is none. May be null. */
	bool (*fault)(void *drive, const char *text, db_time now);

	void (*write_state)(struct sim_node *node, db_time now, FILE *out); /* "key=value ..." */
	const struct sim_drive_command *commands; /* ended by a null name */
};

/* Every kind, null-terminated: kinds.c. */
extern const struct sim_bus_kind *const sim_bus_kinds[];

#endif
