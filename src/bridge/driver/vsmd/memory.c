/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/vsmd_private.h"

#include <string.h>

bool vsmd_memory_differs(const struct vsmd_param_set *set, const struct db_nameplate *plate)
{
	for (unsigned i = 0; i < VSMD_PARAM_COUNT; i++) {
		if ((set->valid & plate->valid[0]) >> i & 1 &&
		    set->values[i].u != plate->values[i].u)
			return true;
	}
	return false;
}

static void copy(struct vsmd_param_set *set, const struct db_nameplate *plate)
{
	set->valid = plate->valid[0];
	memcpy(set->values, plate->values, sizeof(set->values));
}

void vsmd_memory_follow(struct vsmd_memory *memory, const struct db_nameplate *plate, bool all)
{
	/* A drive that still has its former values kept its power, or had saved them. */
	if (all && (memory->kept.valid == 0 ||
	            (memory->restarted && vsmd_memory_differs(&memory->seen, plate))))
		copy(&memory->kept, plate);
	if (all)
		memory->restarted = false;
	copy(&memory->seen, plate);
	memory->unsaved = vsmd_memory_differs(&memory->kept, plate);
}

void vsmd_memory_keep(struct vsmd_memory *memory, const struct db_nameplate *plate)
{
	copy(&memory->kept, plate);
	copy(&memory->seen, plate);
	memory->unsaved = false;
}
