/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A simulated servo's connection to a CAN bus: frames in, frames out. The wire is separate: its
 * owner passes in every frame of the bus, asks when this node wants to send, and decides when it
 * may. No I/O, clock or allocation; one thread.
 */
#ifndef DRIVEBRIDGE_SIM_SERVO_CAN_NODE_H
#define DRIVEBRIDGE_SIM_SERVO_CAN_NODE_H

#include "codec/servo_can.h"
#include "drivebridge/time.h"
#include "sim/can_bus.h"
#include "sim/faults.h"
#include "sim/servo_drive.h"
#include "sim/witness.h"

#include <stdbool.h>
#include <stdint.h>

#define SIM_SERVO_QUEUE 16 /* frames waiting to be sent; further ones are lost */

/* Data bytes of the drive's frames. */
enum sim_servo_lengths {
	SIM_SERVO_AS_DOCUMENTED, /* or 8, when the layout is padded */
	SIM_SERVO_ALWAYS_EIGHT,
	SIM_SERVO_MIXED,    /* alternating */
	SIM_SERVO_TOO_SHORT /* one byte less than documented: no host understands that */
};

struct sim_servo_node {
	/* Set by the owner; all else is 0 at first. */
	struct sim_servo *drive; /* not owned; must outlive the node */
	uint8_t address;         /* 1..31 */
	struct servo_can_layout layout;
	db_time latency;     /* response time of an answer */
	db_time ack_latency; /* additional time before an acknowledgement */
	bool stray_acks;     /* before each acknowledgement comes one of something else */
	enum sim_servo_lengths lengths;
	struct sim_witness witness;

	struct sim_faults faults;
	struct {
		db_time due;
		struct db_can_frame frame;
	} queue[SIM_SERVO_QUEUE]; /* in the order in which they arose */
	unsigned queued;

	uint32_t received; /* frames for this drive, broadcasts and sync included */
	uint32_t unknown;  /* of these, frames that the drive does not understand */
	uint32_t answers;  /* put in the queue */
	uint32_t reports;
	uint32_t lost; /* for which the queue had no room */
};

/* Its end of the bus. */
struct sim_can_station sim_servo_node_station(struct sim_servo_node *node);

/* The next ones are members of struct sim_can_station: `self` is a struct sim_servo_node.
 *
 * A frame was on the bus; its end is `now`. Frames for others, and of others, are ignored. */
void sim_servo_node_receive(void *self, const struct db_can_frame *frame, db_time now);

/* When its next frame is due; DB_TIME_NEVER without one. */
db_time sim_servo_node_next(void *self);

/* The next due frame. False when there is none. Call again until false. */
bool sim_servo_node_send(void *self, db_time now, struct db_can_frame *frame);

#endif
