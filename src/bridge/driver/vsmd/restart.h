/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Determines whether a VSMD drive has been without power since it was last read, judged by its
 * signs. One sign has other explanations (a handshake bit that is cleared after a while, another
 * master, a drive that switched its motor off), so only two signs that agree count as a restart.
 * Internal to the driver; bus thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_RESTART_H
#define DRIVEBRIDGE_DRIVER_VSMD_RESTART_H

#include "driver/vsmd/vsmd_private.h"

enum vsmd_verdict {
	VSMD_COUNTS_ON,          /* no sign, or one that refutes the others */
	VSMD_DISABLED_ITSELF,    /* because of a fault that it shows */
	VSMD_MAY_HAVE_RESTARTED, /* one sign */
	VSMD_RESTARTED,          /* two signs; silence in addition to another sign counts as one */
};

struct vsmd_restart {
	enum vsmd_verdict verdict;
	/* whatever the cause, its counter has restarted, or the drive withdrew its homed state */
	bool origin_lost;
	bool reread; /* its parameters may show more */
};

/* Judges the new status (`position` and `word`) against the previous one, which is still in
 * axis->last. */
struct vsmd_restart vsmd_judge_restart(const struct vsmd_axis *axis, int32_t position,
                                       uint32_t word, db_time now);

/* True if the doubt is refuted because the drive stands where it stood before. */
bool vsmd_refutes_doubt(const struct vsmd_axis *axis, int32_t position);

#endif
