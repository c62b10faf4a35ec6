/* SPDX-License-Identifier: Apache-2.0 */
/* A VSMD drive on CAN. Internal to the driver; bus thread only. */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_CAN_DEVICE_H
#define DRIVEBRIDGE_DRIVER_VSMD_CAN_DEVICE_H

#include "codec/vsmd_can.h"
#include "driver/vsmd/vsmd_private.h"

/* Settings of a bus, named as their keys. */
struct vsmd_can_options {
	unsigned frames; /* 1: standard */
	double host_id;
	double output_base;
	double report_ms;
	unsigned report; /* index of reports[] in can.c */
};

/* How drives of a bus are spoken to. */
static inline struct vsmd_can_style vsmd_can_style_of(const struct db_bus_config *bus)
{
	const struct vsmd_can_options *given = bus->options;

	return (struct vsmd_can_style){
		.extended = !(given->frames != 0),
		.host = (uint16_t)given->host_id,
		.output_base = (uint8_t)given->output_base,
	};
}

/* Reading all parameters: the registers to be read, and a range that contains one that was not
 * answered. */
struct vsmd_can_search {
	uint64_t found; /* one bit per parameter */
	unsigned first;
	unsigned count;
	unsigned suspect_end; /* end of the range */
	unsigned run;         /* number of registers read at once */
	unsigned tries;       /* number of attempts */
};

/* The register read in probes: one that this drive answers, and that no report resembles. While
 * that is not known they are tried in turn. */
enum vsmd_can_probe {
	VSMD_CAN_PROBE_IDENTITY,
	VSMD_CAN_PROBE_SPEED,
	VSMD_CAN_PROBE_DATA, /* a drive that pads answers to the speed as if it reported */
	VSMD_CAN_PROBES,
};

struct db_device {
	struct vsmd_axis axis; /* first: see axis_of() */
	struct vsmd_can_style style;
	unsigned drive;
	db_time report_interval; /* 0: drives are polled */
	enum vsmd_can_report report;

	struct vsmd_can_answer answer; /* of the current exchange */
	unsigned answer_to;            /* its number */
	bool guarded;                  /* another read follows the one that matters */
	bool whole;                    /* of a guarded read: the answer that matters has arrived */

	/* How its answers differ from the documentation. */
	unsigned forms; /* enum vsmd_can_form */
	bool probe_sent;
	bool probe_known;          /* it is known which probe is answered */
	enum vsmd_can_probe probe; /* the last one */
	bool reads_long;           /* a read of three registers, or more, was answered */
	/* such a read repeatedly had no answer: two registers are read at once */
	bool reads_short;
	bool poll_open;      /* the last cyclic read was one, and has had no answer yet */
	unsigned lost_reads; /* such reads that were lost before the first answer to one */

	/* Reports: the content of the first frame, until the second has arrived. */
	uint32_t reported[VSMD_CAN_STATUS_REGS];
	bool half_reported;
	db_time reported_at;

	/* Where no speed is read: the position from which it is computed. */
	bool has_base;
	int32_t base;
	db_time base_at;

	uint64_t lacks;                     /* registers that this model does not have */
	struct vsmd_can_search searches[2]; /* of read_parameters, and of an identification */

	unsigned refreshed; /* the register that was refreshed last */

	/* A parameter write: the setting whose register is being written, and the value written. */
	size_t setting;
	uint32_t written;
	unsigned writes; /* number of writes */
	bool altered;    /* the register holds neither that nor its former value */
};

#endif
