/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive's place on a bus: its name, the faults of its connection, and what it heard.
 */
#ifndef DRIVEBRIDGE_SIM_NODE_H
#define DRIVEBRIDGE_SIM_NODE_H

#include "drivebridge/time.h"
#include "sim/faults.h"
#include "sim/servo_can_node.h"
#include "sim/vsmd_drive.h"
#include "sim/witness.h"
#include "sim/xyza_controller.h"

#define SIM_LOG_LINES 64
#define SIM_LOG_LENGTH 96 /* longer lines are cut in the log */

struct sim_log_entry {
	db_time time;
	char line[SIM_LOG_LENGTH]; /* printable */
};

struct sim_family;
struct sim_vsmd_can_node;

struct sim_node {
	const char *name;                /* not owned */
	const struct sim_family *family; /* of those in a world; else null */
	/* Of these that of its family, which makes and frees it in a world; the others are null. */
	struct sim_vsmd *drive;
	struct sim_vsmd_can_node *vsmd_can; /* beside `drive`, on CAN */
	struct sim_servo_node *servo;
	struct sim_xyza *xyza;
	struct sim_faults faults;
	struct sim_log_entry log[SIM_LOG_LINES]; /* a ring; entry heard % SIM_LOG_LINES is next */
	uint32_t heard;                          /* lines, broadcasts included */
	db_time thinks_until;                    /* answers come in the order of the questions */
	uint32_t replies;                        /* put on the wire, whole or broken */
	struct sim_witness witness;              /* of VSMD drives and XYZA controllers */
};

#endif
