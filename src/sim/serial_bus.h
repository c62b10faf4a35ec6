/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The wire between a host and simulated drives on RS485 or RS232: bytes in, bytes out, each at the
 * time at which a real line would deliver it, with faults. The protocol defines the meaning of the
 * bytes. No I/O and no clock: the owner of the port passes bytes and `now` in, and asks when to
 * come back. Allocates only in sim_serial_bus_new(). One thread.
 *
 * A request is complete when its bytes would have been on the wire at the configured rate, counted
 * from the time when its first byte was passed in (a host's port may accept a whole line at once).
 * The reply's first byte starts `latency` later; bytes are handed out in chunks, each when its last
 * byte is complete.
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

/* How two drives with the same number answer. */
enum sim_twins {
	/* there are none; should two get the same number later, they answer together */
	SIM_TWINS_NONE,
	SIM_TWINS_TOGETHER, /* bit by bit at the same time: equal bytes arrive correctly */
	SIM_TWINS_SHIFTED,  /* the second a byte later: nothing of either arrives */
	SIM_TWINS_IN_TURN,  /* one after the other */
};

struct sim_serial_config {
	unsigned baud;
	bool rs485;
	bool paced;       /* false: a real line itself takes the time */
	uint8_t reply_id; /* VSMD: id in RS232 replies */
	enum sim_twins twins;
	db_time latency;    /* a drive's response time */
	db_time turnaround; /* time after its reply in which a drive receives nothing */
	db_time line_hold;  /* time after a reply in which no station receives anything */
};

struct sim_serial_stats {
	uint32_t requests;
	uint32_t replies;
	uint32_t collisions; /* requests that began while a reply was on the wire */
	uint32_t missed;     /* whole or in part; too long, too many, or received by no drive */
	uint32_t foreign;    /* for no drive here */
};

struct sim_serial_bus;
struct sim_serial_protocol;

struct sim_serial_request {
	const uint8_t *bytes;
	size_t length;
	db_time start; /* when its first byte began, */
	db_time end;   /* and when its last one was complete */
};

/* A family's protocol. */
struct sim_serial_protocol {
	/* Called for each newest byte: is the request complete? bytes[0..*length) is what there was
	 * room for; garbage at its beginning may be removed. */
	bool (*ends)(uint8_t *bytes, size_t *length, uint8_t newest);
	size_t untraced;  /* bytes at a request's end that are not traced */
	uint8_t garbage;  /* the byte that begins a reply: garbage contains it too */
	db_time patience; /* an incomplete request is dropped after this time; 0: never */
	/* Every drive that receives the request carries it out. */
	void (*process)(struct sim_serial_bus *bus, const struct sim_serial_request *request);
};

#define SIM_SERIAL_LINES_MAX 16
#define SIM_SERIAL_BURSTS_MAX 16
#define SIM_SERIAL_GARBAGE_MAX 8
#define SIM_SERIAL_BURST_BYTES_MAX (2 * (SIM_SERIAL_REPLY_MAX + 2 * SIM_SERIAL_GARBAGE_MAX))

/* A request on its way; complete at `end`. */
struct sim_serial_line {
	bool used;
	db_time start;
	db_time end;
	size_t length;
	uint8_t bytes[SIM_SERIAL_REQUEST_MAX];
};

/* Bytes on their way to the host. */
struct sim_burst {
	bool used;
	char direction;
	struct sim_node *node; /* its drive; null: noise */
	db_time start;         /* of the first byte; fixed after its begin */
	size_t length;
	size_t sent;
	size_t chunk;
	uint8_t bytes[SIM_SERIAL_BURST_BYTES_MAX];
};

struct sim_serial_bus {
	const struct sim_serial_protocol *protocol;
	struct sim_serial_config config;
	sim_trace_fn *trace;
	void *context;
	struct sim_node *nodes[SIM_SERIAL_DRIVES_MAX]; /* its drives */
	size_t node_count;
	struct sim_faults faults;
	struct sim_serial_stats stats;
	uint32_t random;

	uint8_t input[SIM_SERIAL_REQUEST_MAX];
	size_t input_length;
	bool input_overflow;
	db_time input_start; /* when the request's first byte began */
	db_time input_newest;
	db_time request_end; /* of the last line: the next one cannot begin sooner */
	db_time reply_end;

	struct sim_serial_line lines[SIM_SERIAL_LINES_MAX];
	size_t first_line; /* a ring: lines end in the order of arrival */
	size_t line_count;
	struct sim_burst bursts[SIM_SERIAL_BURSTS_MAX];
	struct sim_burst *current; /* begun and not finished */
};

/* Null when out of memory; to be freed with free(). The protocol must outlive the bus; trace may be
 * null. */
struct sim_serial_bus *sim_serial_bus_new(const struct sim_serial_protocol *protocol,
                                          const struct sim_serial_config *config,
                                          sim_trace_fn *trace, void *context);

/* The node must outlive the bus. False when the bus is full. */
bool sim_serial_bus_attach(struct sim_serial_bus *bus, struct sim_node *node);

/* A member of struct sim_wire_ops, as the next two: `wire` is a struct sim_serial_bus. */
void sim_serial_bus_receive(void *wire, const uint8_t *bytes, size_t length, db_time now);

/*
 * Does all that is due and writes the bytes that have arrived at the host by `now` to `out`;
 * returns their number. Call again while it returns `size`.
 */
size_t sim_serial_bus_run(void *wire, db_time now, uint8_t *out, size_t size);

/* When sim_serial_bus_run() has to be called next; DB_TIME_NEVER when nothing is under way. */
db_time sim_serial_bus_next(void *wire);

/* The functions above, for the world. */
extern const struct sim_wire_ops sim_serial_bus_ops;

struct sim_faults *sim_serial_bus_faults(void *wire);

/* --- for protocols ---------------------------------------------------------------------------- */

/* False when the drive is as if unplugged. */
bool sim_serial_bus_connects(const struct sim_serial_bus *bus, const struct sim_node *node);

/* The number of bytes at the beginning of the request that the drive missed, because its last reply
 * had just ended. */
size_t sim_serial_bus_missed(struct sim_serial_bus *bus, const struct sim_node *node,
                             const struct sim_serial_request *request);

/* True if a fault of the drive's connection or of the whole bus happens now; counts it. */
bool sim_serial_bus_take(struct sim_serial_bus *bus, struct sim_node *node, enum sim_fault fault);

/* Writes the request into the drive's log, as this text (non-printable characters become '?'). */
void sim_serial_bus_log(struct sim_node *node, const struct sim_serial_request *request,
                        const char *text, size_t length);

/* Reports the latest request in the drive's log to its witness. */
void sim_serial_bus_testify(const struct sim_node *node, bool obeyed);

/* Memory for a reply of up to SIM_SERIAL_REPLY_MAX bytes; null when it is dropped. */
struct sim_burst *sim_serial_bus_begin(struct sim_serial_bus *bus, struct sim_node *node);

/* Sends the reply of begin(), with its faults. Without this call the reply is withdrawn. */
void sim_serial_bus_send(struct sim_serial_bus *bus, struct sim_node *node, struct sim_burst *burst,
                         size_t length, db_time request_end);

/* Two drives with the same number answer, as the bus's `twins` defines. Returns what is left of the
 * first; both may be null. */
struct sim_burst *sim_serial_bus_overlap(const struct sim_serial_bus *bus, struct sim_burst *first,
                                         struct sim_burst *second);

/* The protocols. */
/* The nodes' drives are struct sim_vsmd. */
extern const struct sim_serial_protocol sim_vsmd_serial_protocol;
/* Only those nodes of the bus that are controllers (node->xyza) take part. */
extern const struct sim_serial_protocol sim_xyza_protocol;

#endif
