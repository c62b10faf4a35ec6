/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The wire between a host and simulated drives on RS485 or RS232: bytes in, bytes out, each at the
 * time a real line would have delivered it, with faults. What the bytes mean is the protocol's. No
 * I/O and no clock: the owner of the port hands bytes and `now` in, and asks when to come back.
 * Allocates only in sim_serial_bus_new(). One thread.
 *
 * A request is complete when its bytes would have been on the wire at the configured rate, counted
 * from when its first byte was handed in (a host's port may swallow a line at once). The reply's
 * first byte starts `latency` later; bytes are handed out in chunks, each when its last byte is
 * through.
 */
#ifndef DRIVEBRIDGE_SIM_SERIAL_BUS_H
#define DRIVEBRIDGE_SIM_SERIAL_BUS_H

#include "drivebridge/time.h"
#include "sim/node.h"
#include "sim/wire.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SIM_SERIAL_DRIVES_MAX 32
#define SIM_SERIAL_REQUEST_MAX 1537 /* the longest line of VSMD and its end */
#define SIM_SERIAL_REPLY_MAX 8192

/* How two drives with one number answer. */
enum sim_twins {
	SIM_TWINS_NONE, /* there are none; should two get one number later, they answer together */
	SIM_TWINS_TOGETHER, /* bit by bit at the same time: where they say the same, it arrives */
	SIM_TWINS_SHIFTED,  /* the second a byte later: nothing of either arrives */
	SIM_TWINS_IN_TURN,  /* one behind the other */
};

struct sim_serial_config {
	unsigned baud;
	bool rs485;
	bool paced;       /* false: a real line does the pacing itself */
	uint8_t reply_id; /* VSMD: id in RS232 replies */
	enum sim_twins twins;
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

struct sim_serial_request {
	const uint8_t *bytes;
	size_t length;
	db_time end; /* when its last byte was through */
};

/* What drives of one family make of the bytes. */
struct sim_serial_protocol {
	/* The newest byte of what has come: is the request complete? bytes[0..*length) is what there
	 * was room for; garbage at its beginning may be taken out. */
	bool (*ends)(uint8_t *bytes, size_t *length, uint8_t newest);
	size_t untraced;  /* bytes at a request's end that are not worth tracing */
	uint8_t garbage;  /* the byte that begins a reply: garbage has it, too */
	db_time patience; /* an unfinished request is forgotten after so long; 0 = never */
	/* Every drive that hears the request does what it says. */
	void (*process)(struct sim_serial_bus *bus, const struct sim_serial_request *request);
};

/* Null when out of memory. The protocol must outlive the bus; trace may be null. */
struct sim_serial_bus *sim_serial_bus_new(const struct sim_serial_protocol *protocol,
                                          const struct sim_serial_config *config,
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

/* --- for protocols ---------------------------------------------------------------------------------- */

/* A reply on its way to the host. */
struct sim_burst;

const struct sim_serial_config *sim_serial_bus_config(const struct sim_serial_bus *bus);
struct sim_serial_stats *sim_serial_bus_count(struct sim_serial_bus *bus);

/* The drives of the bus, 0.. ; null behind the last. */
struct sim_node *sim_serial_bus_node(const struct sim_serial_bus *bus, size_t index);

/* False when the drive is as if unplugged. */
bool sim_serial_bus_connects(const struct sim_serial_bus *bus, const struct sim_node *node);

/* Whether a fault of the drive's connection or of the whole bus happens now; counts it off. */
bool sim_serial_bus_take(struct sim_serial_bus *bus, struct sim_node *node, enum sim_fault fault);

/* Writes the request into the drive's log, as this text (other than printable: '?'). */
void sim_serial_bus_log(struct sim_node *node, const struct sim_serial_request *request,
                        const char *text, size_t length);

/* Tells the drive's witness about the request that was written into its log last. */
void sim_serial_bus_testify(const struct sim_node *node, bool obeyed);

/* Where a reply is to be written, SIM_SERIAL_REPLY_MAX bytes; null when it is dropped. */
struct sim_burst *sim_serial_bus_begin(struct sim_serial_bus *bus, struct sim_node *node);
uint8_t *sim_serial_bus_bytes(struct sim_burst *burst);

/* Sends what begin() gave, with its faults. Not calling it takes the reply back. */
void sim_serial_bus_send(struct sim_serial_bus *bus, struct sim_node *node, struct sim_burst *burst,
                         size_t length, db_time request_end);

/* Two drives with one number answer, as the bus's `twins` says. Returns what is left of the first; null is
 * fine for both. */
struct sim_burst *sim_serial_bus_overlap(const struct sim_serial_bus *bus, struct sim_burst *first,
                                         struct sim_burst *second);

#endif
