/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Classical CAN frames as the bridge passes them around: sixteen bytes each, in the layout and with
 * the flags of Linux' struct can_frame, so that a buffer of frames goes to a socket as it is.
 * Pure: no I/O, clock, allocation or global state; any thread.
 */
#ifndef DRIVEBRIDGE_CODEC_CAN_H
#define DRIVEBRIDGE_CODEC_CAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DB_CAN_EXTENDED 0x80000000u /* the id has 29 bits, not 11 */
#define DB_CAN_REMOTE 0x40000000u   /* no data, a request for some */
#define DB_CAN_ERROR 0x20000000u    /* not from the wire: the controller reports trouble */
#define DB_CAN_ID_MASK 0x1FFFFFFFu
#define DB_CAN_STANDARD_MASK 0x7FFu
#define DB_CAN_DATA_MAX 8

struct db_can_frame {
	uint32_t id;    /* with the flags above, in the machine's byte order */
	uint8_t length; /* 0..8 */
	uint8_t reserved[3];
	uint8_t data[DB_CAN_DATA_MAX];
};

_Static_assert(sizeof(struct db_can_frame) == 16, "a frame is passed around as sixteen bytes");

/* Passes a frame when (id & mask) == (this->id & mask), flags included, as SocketCAN's filters
 * do. */
struct db_can_filter {
	uint32_t id;
	uint32_t mask;
};

/*
 * Bits on the wire of a data or remote frame, exactly: stuff bits (which depend on the content and
 * its CRC), acknowledge, end of frame and the three bits of intermission.
 */
unsigned db_can_frame_bits(const struct db_can_frame *frame);

/* For a frame whose content is not known yet: the maximum. */
unsigned db_can_frame_bits_max(bool extended, unsigned length);

/* True if one of the filters passes the frame; no filters at all pass everything. */
bool db_can_filter_passes(const struct db_can_filter *filters, size_t count,
                          const struct db_can_frame *frame);

/* Cuts the next frame out of what a CAN transport carries: frames are sixteen bytes. */
void db_can_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length);

#endif
