/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/family.h"

const struct sim_family *const sim_families[SIM_BUS_KINDS] = {
	[SIM_BUS_VSMD_SERIAL] = &sim_vsmd_serial_family,
	[SIM_BUS_VSMD_CAN] = &sim_vsmd_can_family,
	[SIM_BUS_SERVO_CAN] = &sim_servo_can_family,
	[SIM_BUS_XYZA] = &sim_xyza_family,
};
