/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A CAN bus: one frame at a time is on the wire, the waiting frame with the lowest id goes first,
 * and each takes the time of its bits at the bit rate, stuff bits included. At one end is the host
 * (through an adapter or an interface), at the others are drives. No I/O and no clock; allocates
 * only in sim_can_bus_new(). One thread.
 */
#ifndef DRIVEBRIDGE_SIM_CAN_BUS_H
#define DRIVEBRIDGE_SIM_CAN_BUS_H

#include "codec/can.h"
#include "drivebridge/time.h"
#include "sim/faults.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SIM_CAN_STATIONS_MAX 128
#define SIM_CAN_TEXT_MAX 32

/* "00080381#01", as other tools print it. Returns its length. */
size_t sim_can_text(const struct db_can_frame *frame, char text[SIM_CAN_TEXT_MAX]);

/* A drive's end of the bus. */
struct sim_can_station {
	void *self;
	/* A frame was on the bus; `now` is its end. */
	void (*receive)(void *self, const struct db_can_frame *frame, db_time now);
	/* When its next frame is due; DB_TIME_NEVER. */
	db_time (*next)(void *self);
	/* Takes the next frame that is due. False when none is. */
	bool (*send)(void *self, db_time now, struct db_can_frame *frame);
	/* True if a frame of the host is for this station: only such requests can be lost. Null:
	 * all. */
	bool (*wants)(void *self, const struct db_can_frame *frame);
	/* Inverting this bit of the id names another sender. 0: bit 10 of extended ids, bit 1 of
	 * others. */
	uint32_t sender_bit;
	struct sim_faults *faults; /* of its connection */
};

/* direction '>' host to drive, '<' drive to host. */
typedef void sim_can_trace_fn(void *context, db_time time, char direction,
                              const struct db_can_frame *frame);

struct sim_can_stats {
	uint32_t frames; /* on the wire, from either side */
	uint32_t host_frames;
	uint32_t arbitration_lost; /* times a frame of the host had to wait for a lower id */
	uint32_t corrupted;        /* frames sent again after a bit error */
	uint32_t overflows;        /* frames lost because a queue was full */
	uint64_t busy_ns;          /* time the wire was in use */
};

#define SIM_CAN_HOST_QUEUE 64

struct sim_can_waiting {
	struct db_can_frame frame;
	db_time ready;
};

/* A station and its next frame. */
struct sim_can_place {
	struct sim_can_station ops;
	bool has_frame; /* a frame from its queue is ready to send */
	struct db_can_frame frame;
	db_time ready;
};

/* Anybody may read it, and set its faults. */
struct sim_can_bus {
	unsigned bitrate;
	sim_can_trace_fn *trace;
	void *context;
	struct sim_faults faults;
	struct sim_can_stats stats;
	bool cut; /* see sim_can_bus_cut() */

	struct sim_can_waiting host[SIM_CAN_HOST_QUEUE]; /* a ring */
	size_t host_first;
	size_t host_count; /* frames of the host that are not completely sent */
	struct sim_can_waiting to_host[SIM_CAN_HOST_QUEUE]; /* a ring: echoes */
	size_t to_host_first;
	size_t to_host_count;
	struct sim_can_place stations[SIM_CAN_STATIONS_MAX];
	size_t station_count;

	bool on_wire;
	struct db_can_frame frame;
	const struct sim_can_place *sender; /* null: the host */
	db_time wire_end;
};

/* Null when out of memory; to be freed with free(). trace may be null. */
struct sim_can_bus *sim_can_bus_new(unsigned bitrate, sim_can_trace_fn *trace, void *context);

/* Copies the station; what it points to must outlive the bus. False when the bus is full. */
bool sim_can_bus_attach(struct sim_can_bus *bus, const struct sim_can_station *station);

/* The host has a frame to send. False when too many are waiting. */
bool sim_can_bus_put(struct sim_can_bus *bus, const struct db_can_frame *frame, db_time now);

/* Does all that is due up to `now`. True: *frame arrived at the host; call again. */
bool sim_can_bus_run(struct sim_can_bus *bus, db_time now, struct db_can_frame *frame);

/* When sim_can_bus_run() has to be called next. */
db_time sim_can_bus_next(struct sim_can_bus *bus);

/* Bus off: the host is not connected. Waiting frames are dropped. */
void sim_can_bus_cut(struct sim_can_bus *bus, bool cut);

#endif
