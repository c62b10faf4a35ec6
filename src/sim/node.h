/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A drive's connection to a bus: its name, the faults of the connection, and the log of received
 * lines.
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
#define SIM_LOG_LENGTH 96 /* longer lines are cut off in the log */

struct sim_log_entry {
	db_time time;
	char line[SIM_LOG_LENGTH]; /* printable */
};

struct sim_family;
struct sim_vsmd_can_node;

struct sim_node {
	const char *name;                /* not owned */
	const struct sim_family *family; /* of those in a world; else null */
	/* Only that of its family is not null; in a world the family makes and frees it. */
	struct sim_vsmd *drive;
	struct sim_vsmd_can_node *vsmd_can; /* in addition to `drive`, on CAN */
	struct sim_servo_node *servo;
	struct sim_xyza *xyza;
	struct sim_faults faults;
	/* a ring; the next entry is heard % SIM_LOG_LINES */
	struct sim_log_entry log[SIM_LOG_LINES];
	uint32_t received; /* received lines, broadcasts included */
	/* on a serial line: in addition to the bus's latency, */
	db_time latency;
	db_time deaf;               /* and to its turnaround */
	db_time deaf_until;         /* after its last reply */
	db_time thinks_until;       /* answers come in the order of the requests */
	uint32_t replies;           /* put on the wire, complete or broken */
	struct sim_witness witness; /* of VSMD drives and XYZA controllers */
	/* Switches of the drive that are set from outside; null: its family has none. */
	bool *stalled;           /* the shaft is held; first advance the drive */
	uint32_t *forced_status; /* these status bits are shown in addition to the real ones */
	bool *flash_fails;       /* its parameters cannot be saved */
};

#endif
