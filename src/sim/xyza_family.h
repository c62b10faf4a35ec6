/* SPDX-License-Identifier: Apache-2.0 */
/* Simulated XYZA controllers, as the world and the control commands see them. One thread. */
#ifndef DRIVEBRIDGE_SIM_XYZA_FAMILY_H
#define DRIVEBRIDGE_SIM_XYZA_FAMILY_H

#include "sim/family.h"

extern const struct sim_family sim_xyza_family;

#endif
