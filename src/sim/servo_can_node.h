/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A simulated servo's place on a CAN bus: frames in, frames out. Not the wire: whoever owns that
 * hands every frame of the bus in, asks when this node wants to send, and decides when it may. No
 * I/O, clock or allocation; one thread.
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

#define SIM_SERVO_QUEUE 16 /* frames that wait to be sent; more are lost */

/* Data bytes of what the drive sends. */
enum sim_servo_lengths {
	SIM_SERVO_AS_DOCUMENTED, /* or 8, when the layout is padded */
	SIM_SERVO_ALWAYS_EIGHT,
	SIM_SERVO_MIXED,    /* now so, now so */
	SIM_SERVO_TOO_SHORT /* one byte less than documented: nobody understands that */
};

struct sim_servo_node {
	const char *name;        /* not owned */
	struct sim_servo *drive; /* not owned */
	uint8_t address;         /* 1..31 */
	struct servo_can_layout layout;
	db_time latency;     /* thinking before an answer */
	db_time ack_latency; /* and so much more before an acknowledgement */
	bool stray_acks;     /* before each acknowledgement comes one of something else */
	enum sim_servo_lengths lengths;
	struct sim_faults faults;
	struct sim_witness witness;

	struct {
		db_time due;
		struct db_can_frame frame;
	} queue[SIM_SERVO_QUEUE]; /* in the order they came up */
	unsigned queued;

	uint32_t heard;   /* frames for this drive, broadcasts and sync included */
	uint32_t unknown; /* of them, those the drive makes nothing of */
	uint32_t answers; /* put in the queue */
	uint32_t reports;
	uint32_t lost; /* for which the queue had no room */
};

/* `name` and `drive` must outlive the node. */
void sim_servo_node_init(struct sim_servo_node *node, const char *name, struct sim_servo *drive,
                         uint8_t address, const struct servo_can_layout *layout, db_time latency);

/* Its end of the bus. */
struct sim_can_station sim_servo_node_station(struct sim_servo_node *node);

/* A frame was on the bus; the end of it is `now`. Frames for others, and of others, are ignored. */
void sim_servo_node_receive(struct sim_servo_node *node, const struct db_can_frame *frame,
                            db_time now);

/* When it has something to send next; DB_TIME_NEVER when nothing. */
db_time sim_servo_node_next(const struct sim_servo_node *node);

/* The next frame that is due. False when none is. Call again until false. */
bool sim_servo_node_send(struct sim_servo_node *node, db_time now, struct db_can_frame *frame);

#endif
