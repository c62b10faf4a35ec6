/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A simulated CAN bus from the host's side: through a serial adapter that speaks the LAWICEL
 * protocol, or through frames of sixteen bytes (codec/can.h) from and to a network interface. Bytes
 * in, bytes out; no I/O and no clock; allocates only in sim_can_line_new(). One thread.
 */
#ifndef DRIVEBRIDGE_SIM_CAN_LINE_H
#define DRIVEBRIDGE_SIM_CAN_LINE_H

#include "codec/slcan.h"
#include "sim/can_bus.h"
#include "sim/wire.h"

struct sim_can_config {
	unsigned bitrate;
	bool adapter;    /* slcan, else frames */
	db_time latency; /* a drive's response time */
};

#define SIM_CAN_OUT_MAX 4096

struct sim_can_line {
	struct sim_can_config config;
	sim_trace_fn *trace;
	void *context;
	struct sim_can_bus *bus; /* for sim_can_bus_attach() and the counters */
	uint8_t out[SIM_CAN_OUT_MAX];
	size_t out_length;

	/* The adapter. */
	struct slcan_reader reader;
	bool open;
	bool listens;
	uint8_t digit; /* of the configured rate */
	uint8_t flags;
	uint32_t arbitration_reported; /* losses already reported by the flags */

	/* Frames from an interface. */
	uint8_t partial[sizeof(struct db_can_frame)];
	size_t partial_length;
};

/* Null when out of memory. trace may be null. */
struct sim_can_line *sim_can_line_new(const struct sim_can_config *config, sim_trace_fn *trace,
                                      void *context);

extern const struct sim_wire_ops sim_can_line_ops;

#endif
