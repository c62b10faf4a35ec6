/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The consequences of a bus's shares (drivebridge/shares.h, docs/schedule.md) for a
 * configuration: the longest waits of a stop, a sample and a parameter, provided that requests are
 * answered. Internal to src/bridge/config; tests check the schedule against it.
 */
#ifndef DRIVEBRIDGE_CONFIG_BOUNDS_H
#define DRIVEBRIDGE_CONFIG_BOUNDS_H

#include "drivebridge/config.h"

/* The load of the bus. */
struct db_load_of_bus {
	size_t nodes; /* number of addresses that are read */
	/* number of drives there: more than addresses where a controller has several axes */
	size_t drives;
	size_t moving; /* number of addresses with a drive that moves */
	bool busy;     /* commands, parameters and drives that are offline want the wire as well */
};

struct db_bounds {
	/* the longest exchange that a stop waits for while a drive moves: two readings of a
	 * status */
	db_time exchange;
	db_time stop;    /* from its arrival to its first byte */
	db_time hearing; /* added where drives of a serial line receive as late as is ever learnt */
	db_time unanswered; /* added when the current exchange is not answered */
	db_time moving;     /* from one sample of a drive that moves to the next; 0: none moves */
	db_time standing;   /* from one sample of a drive that stands to the next; 0: none stands */
	/* from the arrival of a parameter write to the last byte of its answer, where it has no
	 * others before it */
	db_time parameter;
};

void db_bounds_of(const struct db_bus_config *bus, const struct db_load_of_bus *load,
                  struct db_bounds *bounds);

#endif
