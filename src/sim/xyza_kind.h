/* SPDX-License-Identifier: Apache-2.0 */
#ifndef DRIVEBRIDGE_SIM_XYZA_KIND_H
#define DRIVEBRIDGE_SIM_XYZA_KIND_H

struct sim_bus_kind;

extern const struct sim_bus_kind sim_xyza_kind;

#endif
