/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What simulated VSMD drives make of the bytes on their RS485 or RS232 line.
 */
#ifndef DRIVEBRIDGE_SIM_VSMD_SERIAL_BUS_H
#define DRIVEBRIDGE_SIM_VSMD_SERIAL_BUS_H

#include "sim/serial_bus.h"

/* The nodes' drives are struct sim_vsmd. */
extern const struct sim_serial_protocol sim_vsmd_serial_protocol;

#endif
