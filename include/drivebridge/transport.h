/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The transport contract: one way to a bus. A transport owns its file descriptor, never blocks, and
 * does not interpret what it carries: bytes on a serial line, or whole struct db_can_frame (sixteen
 * bytes each, codec/can.h) on CAN. One thread per port, the bus's.
 */
#ifndef DRIVEBRIDGE_TRANSPORT_H
#define DRIVEBRIDGE_TRANSPORT_H

#include "drivebridge/config.h"
#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

enum db_medium { DB_MEDIUM_SERIAL, DB_MEDIUM_CAN };

/* The transport's own state of one open port. */
struct db_port;

/* Whether the driver of a serial port delivers received bytes at once. */
enum db_port_latency {
	DB_PORT_LATENCY_UNKNOWN, /* no serial port, or a pseudo terminal */
	DB_PORT_LATENCY_LOW,
	DB_PORT_LATENCY_REFUSED, /* requested, but the driver does not, or has no such setting */
};

/* What a port knows of its line in addition to the data. Counters start with each opening. */
struct db_port_health {
	bool up;   /* frames can be carried: the adapter is ready, the controller not bus off */
	int error; /* why not, as an errno; ENETRESET means bus off */
	bool error_warning; /* a CAN controller's error counters */
	bool error_passive;
	uint32_t bus_offs;
	uint32_t error_passives;   /* times it became error passive */
	uint32_t arbitration_lost; /* frames sent again because of it, as far as reported */
	uint32_t line_errors;      /* stuff, form, CRC, acknowledge errors on the wire */
	uint32_t overflows;        /* frames lost in the adapter or controller */
	uint32_t refused;          /* frames or settings the adapter refused */
	uint32_t bitrate;          /* actual bit rate of the interface, bit/s; 0 = not known */
	enum db_port_latency latency;
};

struct db_can_filter;

struct db_transport {
	const char *name; /* transport = NAME */
	enum db_medium medium;
	bool uses_interface; /* the place is `interface`, else `device` */

	/* 0, or a negative errno: ENOENT, ENODEV, EACCES, EBUSY, ENETDOWN (interface is down),
	 * EINVAL (a setting the port refuses) ... Frames that no filter passes are never read (CAN;
	 * they are copied; none = everything). An open port may still be getting ready: see
	 * health(). */
	int (*open)(const struct db_bus_config *bus, const struct db_can_filter *filters,
	            size_t filter_count, db_time now, struct db_port **port);
	void (*close)(struct db_port *port); /* null is fine */

	/* The process that has a port that open() found busy; 0: not known. Null: no other process
	 * can have it. */
	pid_t (*holder)(const struct db_bus_config *bus);

	int (*fd)(const struct db_port *port); /* for poll(); stays the same while open */

	/* Bytes moved (whole frames on CAN), 0 when none can be moved now, or a negative errno: the
	 * port is lost and must be closed. read() may consume bytes of the transport's own and
	 * return 0 with more waiting only if poll() then reports it again. */
	ssize_t (*read)(struct db_port *port, void *bytes, size_t size, db_time now);
	ssize_t (*write)(struct db_port *port, const void *bytes, size_t length, db_time now);

	/* When write() took less than all: 0 = poll() reports when there is room again, else try
	 * again after this time (a socket that is always writable, while the queue after it is
	 * full). */
	db_time write_retry;

	/* Does what is due by time: an adapter's handshake, requesting its status. Returns when to
	 * be called again at the latest. A negative *error means the port is lost. Null: nothing
	 * ever is due. */
	db_time (*run)(struct db_port *port, db_time now, int *error);

	/* Receive everything, or again only what the filters pass. Null: serial lines. */
	void (*pass)(struct db_port *port, bool everything);

	/* From now on poll() reports when this number of bytes wait (0: each one); read() also
	 * returns fewer; false when the port cannot. Waiting bytes are kept. Null: CAN. */
	bool (*gather)(struct db_port *port, size_t bytes);

	/* Null: always up and healthy. */
	const struct db_port_health *(*health)(const struct db_port *port);

	/* Shortest time on the wire of these bytes and of an answer: `answer_length` bytes on a
	 * serial line; on CAN the sum over its frames of 8 + data length. */
	db_time (*wire_time)(const struct db_bus_config *bus, const uint8_t *request,
	                     size_t request_length, size_t answer_length);
};

extern const struct db_transport db_transport_serial;
extern const struct db_transport db_transport_socketcan;
extern const struct db_transport db_transport_slcan;

/* All transports, null-terminated: src/common/transport/list.c. */
extern const struct db_transport *const db_transports[];

#endif
