/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether a VSMD drive has been without power since it was read last, judged by its signs. One sign has other
 * explanations (a handshake bit that lapses, another master, a drive that switched its motor off), so only two
 * that agree are a restart. Internal to the driver; bus thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_RESTART_H
#define DRIVEBRIDGE_DRIVER_VSMD_RESTART_H

#include "driver/vsmd/axis.h"

enum vsmd_verdict {
	VSMD_COUNTS_ON,          /* no sign, or one that refutes the others */
	VSMD_DISABLED_ITSELF,    /* because of a fault that it shows */
	VSMD_MAY_HAVE_RESTARTED, /* one sign */
	VSMD_RESTARTED,          /* two signs; silence is one beside another */
};

struct vsmd_restart {
	enum vsmd_verdict verdict;
	bool origin_lost; /* whatever the cause, its counter has begun anew, or the drive took back that it is homed */
	bool handshake_lapsed; /* without a restart */
	bool reread;           /* its parameters may tell */
};

/* The status (`position` and `word`) that has come, compared with the one before, which is still in axis->last. */
struct vsmd_restart vsmd_judge_restart(const struct vsmd_axis *axis, int32_t position,
                                       uint32_t word, db_time now);

/* Whether a doubt about it is refuted by a drive that stands where it stood before. */
bool vsmd_refutes_doubt(const struct vsmd_axis *axis, int32_t position);

#endif
