/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Determines whether a VSMD drive would lose parameters without power: whether its values differ
 * from those saved last, as far as the bridge knows. The values at the bridge's first reading count
 * as saved. Internal to the driver; bus thread only.
 */
#ifndef DRIVEBRIDGE_DRIVER_VSMD_MEMORY_H
#define DRIVEBRIDGE_DRIVER_VSMD_MEMORY_H

#include "codec/vsmd.h"
#include "drivebridge/axis.h"

struct vsmd_param_set {
	uint64_t valid; /* as the nameplate's */
	union db_value values[VSMD_PARAM_COUNT];
};

struct vsmd_memory {
	struct vsmd_param_set kept;
	struct vsmd_param_set seen; /* values seen last */
	/* it may have been without power since all were read, and then has the saved values */
	bool restarted;
	bool unsaved;
};

/* True if the drive holds another value now than when it was last read or written. */
bool vsmd_memory_differs(const struct vsmd_memory *memory, const struct db_nameplate *plate);

/* The nameplate changed; `all`: all parameters were read, else some were written. */
void vsmd_memory_follow(struct vsmd_memory *memory, const struct db_nameplate *plate, bool all);

/* The drive has saved its present values. */
void vsmd_memory_keep(struct vsmd_memory *memory, const struct db_nameplate *plate);

#endif
