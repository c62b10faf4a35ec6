/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the kernel tells everyone about a CAN interface: its bit rate and its controller's state,
 * over rtnetlink. Virtual interfaces have neither.
 */
#ifndef DRIVEBRIDGE_TRANSPORT_CAN_LINK_H
#define DRIVEBRIDGE_TRANSPORT_CAN_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct db_can_link {
	uint32_t bitrate; /* bit/s; 0 = not known */
	bool has_state;
	uint32_t state; /* enum can_state of linux/can/netlink.h */
};

/* Asks about the interface with this index. False when no answer came in a tenth of a second or
 * the kernel refused; *link then says that nothing is known. */
bool db_can_link_read(unsigned index, struct db_can_link *link);

/* Pure: reads the kernel's answer. False when it is none. */
bool db_can_link_parse(const void *message, size_t length, struct db_can_link *link);

#endif
