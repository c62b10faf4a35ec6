/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Asks the driver of a serial port to pass received bytes on at once. FTDI adapters hold them for
 * 16 ms otherwise, which is longer than a cycle. Internal to src/transport.
 */
#ifndef DRIVEBRIDGE_TRANSPORT_SERIAL_LATENCY_H
#define DRIVEBRIDGE_TRANSPORT_SERIAL_LATENCY_H

#include "drivebridge/transport.h"

/* ioctl() as it is here: 0, or -1 with errno. */
typedef int db_serial_control_fn(int fd, unsigned long request, void *argument);

/* Whether the driver has taken it, which is read back. Never an error: some drivers have no such
 * setting and hold nothing back. */
enum db_port_latency db_serial_lower_latency(int fd, db_serial_control_fn *control);

#endif
