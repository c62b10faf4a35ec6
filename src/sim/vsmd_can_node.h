/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A simulated VSMD drive's connection to a CAN bus: frames in, frames out. The wire is separate: it
 * passes in every frame of the bus, asks when this node wants to send, and decides when it may. No
 * I/O, clock or allocation; one thread.
 */
#ifndef DRIVEBRIDGE_SIM_VSMD_CAN_NODE_H
#define DRIVEBRIDGE_SIM_VSMD_CAN_NODE_H

#include "codec/vsmd_can.h"
#include "sim/can_bus.h"
#include "sim/node.h"

#define SIM_VSMD_CAN_QUEUE 64 /* frames waiting to be sent; further ones are lost */

struct sim_vsmd_can_node {
	struct sim_node *node; /* not owned */
	struct vsmd_can_style style;
	db_time latency; /* response time of an answer */

	struct {
		db_time due;
		struct db_can_frame frame;
	} queue[SIM_VSMD_CAN_QUEUE]; /* a ring, in the order of the requests */
	size_t first;
	size_t count;
	db_time busy_until; /* an answer follows those before it */
	uint32_t starts;    /* power-ups of the drive that this node has seen */

	/* auto_res_sts */
	enum vsmd_can_report report;
	db_time interval;
	db_time report_at;
	uint16_t reporting_to;

	/* from the frames before the starting one */
	int32_t shake_start;
	int32_t shake_end;
	float shake_frequency;
};

/* `sim` and its drive must outlive the node. */
void sim_vsmd_can_node_init(struct sim_vsmd_can_node *node, struct sim_node *sim,
                            const struct vsmd_can_style *style, db_time latency);

/* Its end of the bus. */
struct sim_can_station sim_vsmd_can_node_station(struct sim_vsmd_can_node *node);

#endif
