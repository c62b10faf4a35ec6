/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What simulated XYZA controllers make of the bytes on their RS485 or RS232 line.
 */
#ifndef DRIVEBRIDGE_SIM_XYZA_BUS_H
#define DRIVEBRIDGE_SIM_XYZA_BUS_H

#include "sim/serial_bus.h"

/* Of the nodes on the bus, those that are controllers (node->xyza) take part. */
extern const struct sim_serial_protocol sim_xyza_protocol;

#endif
