/* SPDX-License-Identifier: Apache-2.0 */
/* A VSMD drive on CAN. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_CAN_DEVICE_H
#define DRIVEBRIDGE_DRIVER_VSMD_CAN_DEVICE_H

#include "codec/vsmd_can.h"
#include "driver/vsmd/axis.h"

/* Reading all parameters: the registers asked for, and those among which one is that was not answered. */
struct vsmd_can_search {
	uint64_t found; /* bit of each parameter */
	unsigned first;
	unsigned count;
	unsigned suspect_end; /* up to which */
	unsigned run;         /* how many of them are asked for at once */
	unsigned tries;       /* how often */
};

struct db_device {
	struct vsmd_axis axis; /* first: see axis_of() */
	struct vsmd_can_style style;
	unsigned drive;
	db_time report_interval; /* 0: drives are asked */
	enum vsmd_can_report report;

	struct vsmd_can_answer answer; /* of the exchange under way */
	unsigned answer_to;            /* its number */

	/* Reports: what came in the first frame of one, until the second is there. */
	uint32_t reported[VSMD_CAN_STATUS_REGS];
	bool half_reported;
	db_time reported_at;

	/* Where no speed is read: the position from which one is computed. */
	bool has_base;
	int32_t base;
	db_time base_at;

	/* Registers: which ones this model has not, and what of a guarded read came. */
	uint64_t lacks;
	bool whole; /* the registers that the read behind them guards are there */
	struct vsmd_can_search searches[2]; /* of read_parameters, and of an identification */

	/* A parameter write: the setting whose register is on, and what was written to it. */
	size_t setting;
	uint32_t written;
	unsigned writes; /* how often it was written */
	bool altered;    /* the drive holds neither that nor what it held before */
};

#endif
