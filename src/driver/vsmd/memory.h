/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whether a VSMD drive would lose parameters without power: whether it holds others than those that it kept when they
 * were saved last, as far as the bridge knows. What it had when the bridge first read it counts as kept. Internal to
 * the driver; bus thread only.
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
	struct vsmd_param_set seen; /* last */
	bool restarted; /* it may have been without power since all were read, and then has what it keeps */
	bool unsaved;
};

/* Whether the drive holds another value now than when it was read, or written, last. */
bool vsmd_memory_differs(const struct vsmd_memory *memory, const struct db_nameplate *plate);

/* The nameplate changed; `all`: all was read, else some was written. */
void vsmd_memory_follow(struct vsmd_memory *memory, const struct db_nameplate *plate, bool all);

/* The drive keeps what it holds now. */
void vsmd_memory_keep(struct vsmd_memory *memory, const struct db_nameplate *plate);

#endif
