/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The wire between a host and simulated VSMD drives on RS485 or RS232: bytes in, bytes out, each
 * at the time a real line would have delivered it. No I/O and no clock: the owner of the port
 * hands bytes and `now` in, and asks when to come back. Allocates only in sim_serial_bus_new().
 * One thread.
 *
 * A request is complete when its bytes would have been on the wire at the configured rate, counted
 * from when its first byte was handed in (a host's port may swallow a line at once). The reply's
 * first byte starts `latency` later; bytes are handed out in chunks, each when its last byte is
 * through.
 */
#ifndef DRIVEBRIDGE_SIM_VSMD_SERIAL_BUS_H
#define DRIVEBRIDGE_SIM_VSMD_SERIAL_BUS_H

#include "drivebridge/time.h"
#include "sim/node.h"
#include "sim/wire.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SIM_SERIAL_DRIVES_MAX 32

struct sim_serial_config {
	unsigned baud;
	bool rs485;
	bool paced;         /* false: a real line does the pacing itself */
	uint8_t reply_id;   /* id in RS232 replies */
	db_time latency;    /* a drive's thinking time */
	db_time turnaround; /* after a reply: requests that begin sooner are not heard */
};

struct sim_serial_stats {
	uint32_t requests;
	uint32_t replies;
	uint32_t collisions; /* requests that began while a reply was on the wire */
	uint32_t unheard;    /* in the turnaround time, too long, too many, or no drive heard it */
	uint32_t foreign;    /* for no drive here */
};

struct sim_serial_bus;

/* Null when out of memory. trace may be null. */
struct sim_serial_bus *sim_serial_bus_new(const struct sim_serial_config *config,
                                          sim_trace_fn *trace, void *context);
void sim_serial_bus_free(struct sim_serial_bus *bus);

/* The node must outlive the bus. False when the bus is full. */
bool sim_serial_bus_attach(struct sim_serial_bus *bus, struct sim_node *node);

void sim_serial_bus_receive(struct sim_serial_bus *bus, const uint8_t *bytes, size_t length,
                            db_time now);

/*
 * Does what is due and writes the bytes that have arrived at the host by `now` to out; returns
 * their number. Call again while it returns `size`.
 */
size_t sim_serial_bus_run(struct sim_serial_bus *bus, db_time now, uint8_t *out, size_t size);

/* When sim_serial_bus_run() has something to do next; DB_TIME_NEVER when nothing is under way. */
db_time sim_serial_bus_next(struct sim_serial_bus *bus);

/* The functions above, for the world. */
extern const struct sim_wire_ops sim_serial_bus_ops;

struct sim_faults *sim_serial_bus_faults(struct sim_serial_bus *bus);
const struct sim_serial_stats *sim_serial_bus_stats(const struct sim_serial_bus *bus);
void sim_serial_bus_set_baud(struct sim_serial_bus *bus, unsigned baud);

#endif
