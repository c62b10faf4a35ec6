/* SPDX-License-Identifier: Apache-2.0 */
/* Simulated VSMD drives, as the world and the control commands see them. One thread. */
#ifndef DRIVEBRIDGE_SIM_VSMD_FAMILY_H
#define DRIVEBRIDGE_SIM_VSMD_FAMILY_H

#include "sim/family.h"

extern const struct sim_family sim_vsmd_serial_family;
extern const struct sim_family sim_vsmd_can_family;

#endif
