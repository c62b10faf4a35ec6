/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The state of the service in one line for `systemctl status`. Internal to src/bridge/service;
 * network thread.
 */
#ifndef DRIVEBRIDGE_SERVICE_STATUS_H
#define DRIVEBRIDGE_SERVICE_STATUS_H

#include "drivebridge/bus.h"
#include "drivebridge/configuration.h"

#include <stdbool.h>
#include <stdio.h>

struct service;

/* One bus compared with the others: by what is wrong with it, the worst first, and then by its
 * load. */
struct status_bus {
	const char *name; /* null: there is none */
	bool down;
	size_t missing;       /* number of drives offline */
	uint32_t utilisation; /* in thousandths */
	uint32_t last_error;  /* errno; 0: none */
};

struct status_figures {
	size_t drives;
	size_t online;
	struct status_bus worst;
	uint32_t clients;
	enum db_configuration_state configuration;
	bool replaced; /* running code was replaced by an upgrade */
};

/* Counts a bus with `drives` drives. Pure; `name` must stay valid. */
void status_add_bus(struct status_figures *figures, const char *name, size_t drives,
                    const struct db_bus_stats *stats);

/* The line. Pure. */
void status_write(const struct status_figures *figures, FILE *out);

/* From now on systemd is notified whenever the line changes, about a second later. Does nothing
 * without systemd. 0 or a negative errno. */
int status_begin(struct service *service);

void status_end(struct service *service);

#endif
