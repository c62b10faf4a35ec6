/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What is asked of the drivers of serial ports beyond speed and form of the characters. Internal to
 * src/transport.
 */
#ifndef DRIVEBRIDGE_TRANSPORT_SERIAL_CONTROL_H
#define DRIVEBRIDGE_TRANSPORT_SERIAL_CONTROL_H

#include "drivebridge/config.h"
#include "drivebridge/transport.h"

/* ioctl() as it is here: 0, or -1 with errno. */
typedef int db_serial_control_fn(int fd, unsigned long request, void *argument);

/*
 * Asks the driver to pass received bytes on at once: FTDI adapters hold them for 16 ms otherwise,
 * which is longer than a cycle. Whether it has taken it, which is read back. Never an error: some
 * drivers have no such setting and hold nothing back.
 */
enum db_port_latency db_serial_lower_latency(int fd, db_serial_control_fn *control);

/*
 * Lets the kernel switch an RS485 line's direction with RTS, where the configuration says so. Where
 * it does not, the port is left as it is: others may have set it up. 0 or a negative errno: -ENOTTY
 * when the driver cannot, -EINVAL when it does not keep what it was told.
 */
int db_serial_set_direction(int fd, const struct db_bus_config *config,
                            db_serial_control_fn *control);

#endif
