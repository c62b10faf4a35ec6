/* SPDX-License-Identifier: Apache-2.0 */
#ifndef DRIVEBRIDGE_SIM_VSMD_KIND_H
#define DRIVEBRIDGE_SIM_VSMD_KIND_H

struct sim_bus_kind;

extern const struct sim_bus_kind sim_vsmd_serial_kind;

#endif
