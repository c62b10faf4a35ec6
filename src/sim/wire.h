/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The interface between the simulator's world and a bus of any kind: bytes from the host in, bytes
 * for it out, each at its time.
 */
#ifndef DRIVEBRIDGE_SIM_WIRE_H
#define DRIVEBRIDGE_SIM_WIRE_H

#include "drivebridge/time.h"
#include "sim/faults.h"

#include <stddef.h>
#include <stdint.h>

/* direction '>' host to drive, '<' drive to host, 'e' echo. */
typedef void sim_trace_fn(void *context, db_time time, char direction, const uint8_t *bytes,
                          size_t length);

struct sim_wire_ops {
	void (*receive)(void *wire, const uint8_t *bytes, size_t length, db_time now);
	/* Does all that is due and writes the bytes that have arrived at the host by `now` to
	 * `out`; returns their number. Called again while that is not 0. */
	size_t (*run)(void *wire, db_time now, uint8_t *out, size_t size);
	db_time (*next)(void *wire); /* DB_TIME_NEVER when nothing is under way */
	struct sim_faults *(*faults)(void *wire);
	/* "name=value" pairs for the control socket's `get`. */
	void (*describe)(void *wire, char *text, size_t size);
	void (*free)(void *wire);
};

#endif
