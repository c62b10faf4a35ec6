/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A serial port: opened, set and owned here. Real ports are opened and set by libserialport; ptys,
 * which libserialport does not know, by termios. Reads and writes never block. One thread.
 */
#ifndef DRIVEBRIDGE_TRANSPORT_SERIAL_H
#define DRIVEBRIDGE_TRANSPORT_SERIAL_H

#include "drivebridge/config.h"
#include "drivebridge/time.h"
#include "drivebridge/transport.h"

#include <sys/types.h>

struct db_serial;

/* 0, or a negative errno: ENOENT, ENODEV, EACCES, EBUSY, EINVAL (a setting the port refuses) ... */
int db_serial_open(const struct db_bus_config *config, struct db_serial **serial);
void db_serial_close(struct db_serial *serial);

enum db_port_latency db_serial_latency(const struct db_serial *serial);

/* For poll(); stays the same while open. */
int db_serial_fd(const struct db_serial *serial);

/* Bytes moved, 0 when none can be moved now, or a negative errno: the port is lost. */
ssize_t db_serial_read(struct db_serial *serial, void *bytes, size_t size);
ssize_t db_serial_write(struct db_serial *serial, const void *bytes, size_t length);

/* The port of a line where this is not the master, in the form that the functions above take. The
 * device is the line's. */
struct db_bus_config db_serial_port_of_line(const struct db_rtu_config *line);

/* Time that a number of characters takes on this line, start, parity and stop bits included. */
db_time db_serial_wire_time(const struct db_bus_config *config, size_t bytes);

#endif
