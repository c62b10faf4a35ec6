/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A simulated CAN bus from the host's side: through a serial adapter that speaks the LAWICEL
 * protocol, or through frames of sixteen bytes (codec/can.h) from and to a network interface. Bytes
 * in, bytes out; no I/O and no clock; allocates only in sim_can_line_new(). One thread.
 */
#ifndef DRIVEBRIDGE_SIM_CAN_LINE_H
#define DRIVEBRIDGE_SIM_CAN_LINE_H

#include "sim/can_bus.h"
#include "sim/wire.h"

struct sim_can_config {
	unsigned bitrate;
	bool adapter;    /* slcan, else frames */
	db_time latency; /* a drive's response time */
};

struct sim_can_line;

/* Null when out of memory. trace may be null. */
struct sim_can_line *sim_can_line_new(const struct sim_can_config *config, sim_trace_fn *trace,
                                      void *context);

/* For sim_can_bus_attach() and the counters. */
struct sim_can_bus *sim_can_line_bus(struct sim_can_line *line);

extern const struct sim_wire_ops sim_can_line_ops;

#endif
