/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_bus.h"
#include "sim/vsmd_kind.h"
#include "sim/xyza_kind.h"

#include <stddef.h>

const struct sim_bus_kind *const sim_bus_kinds[] = {
	&sim_vsmd_serial_kind,
	&sim_xyza_kind,
	NULL,
};
