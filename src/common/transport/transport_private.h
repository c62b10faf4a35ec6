/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The files of the transports for each other.
 */
#ifndef DRIVEBRIDGE_TRANSPORT_TRANSPORT_PRIVATE_H
#define DRIVEBRIDGE_TRANSPORT_TRANSPORT_PRIVATE_H

#include "codec/can.h"
#include "drivebridge/config.h"
#include "drivebridge/transport.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/types.h>

/* --- can_wire.c ------------------------------------------------------------------------------- */

/* What all transports know of a CAN bus's wire. Pure; any thread. */

/* The frame at this place of a buffer of frames, which need not be aligned. */
struct db_can_frame db_can_frame_at(const uint8_t *bytes, size_t offset);

/*
 * The minimum number of bits of an exchange: all of its request (whole frames), including stuff
 * bits; for its answer, whose content is not known yet, those of as few frames as possible, of the
 * request's kind and without stuff bits. answer_length: the sum over its frames of 8 + data length.
 */
uint64_t db_can_wire_bits(const uint8_t *request, size_t request_length, size_t answer_length);

/* --- can_link.c ------------------------------------------------------------------------------- */

/*
 * The kernel's data of a CAN interface: its bit rate and its controller's state, over rtnetlink.
 * Virtual interfaces have neither.
 */

struct db_can_link {
	uint32_t bitrate; /* bit/s; 0 = not known */
	bool has_state;
	uint32_t state; /* enum can_state of linux/can/netlink.h */
};

/* Asks about the interface with this index. False when no answer arrived in a tenth of a second or
 * the kernel refused; *link then shows that nothing is known. */
bool db_can_link_read(unsigned index, struct db_can_link *link);

/* Pure: reads the kernel's answer. False when it is not valid. */
bool db_can_link_parse(const void *message, size_t length, struct db_can_link *link);

/* --- serial_control.c ------------------------------------------------------------------------- */

/*
 * Requests to the drivers of serial ports beyond speed and character format.
 */

/* ioctl() in this form: 0, or -1 with errno. */
typedef int db_serial_control_fn(int fd, unsigned long request, void *argument);

/*
 * Asks the driver to deliver received bytes at once: FTDI adapters delay them by 16 ms otherwise,
 * which is longer than a cycle. Returns whether this took effect, which is read back. Never an
 * error: some drivers have no such setting and delay nothing.
 */
enum db_port_latency db_serial_lower_latency(int fd, db_serial_control_fn *control);

/*
 * Lets the kernel switch an RS485 line's direction with RTS, where the configuration says so.
 * Otherwise the port is left unchanged: other programs may have set it up. 0 or a negative errno:
 * -ENOTTY when the driver cannot, -EINVAL when it does not keep the setting.
 */
int db_serial_set_direction(int fd, const struct db_bus_config *config,
                            db_serial_control_fn *control);

/* --- holder.c --------------------------------------------------------------------------------- */

/* Finds the process that has a serial port. */

/* The process that has the device locked: according to the kernel (/proc/locks), or to a lock file
 * in /run/lock, which terminal programs write. 0: not known. */
pid_t db_port_holder(const struct db_bus_config *bus);

/* From a file in the form of /proc/locks: the process that has this inode locked; 0: none. */
pid_t db_port_holder_in(FILE *locks, dev_t device, ino_t inode);

#endif
