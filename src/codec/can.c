/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/can.h"

#define CRC_POLYNOMIAL 0x4599u
#define CRC_BITS 15
#define STUFF_RUN 5 /* after so many equal bits an opposite one is put in */

/* CRC delimiter, acknowledge slot and its delimiter, end of frame (7), intermission (3) */
#define TAIL_BITS 13u

/* From start of frame to the end of the CRC, data and stuff bits not counted */
#define STANDARD_BITS 34u
#define EXTENDED_BITS 54u

#define FRAME_SIZE sizeof(struct db_can_frame)

/* A frame going out, as a controller sees it. */
struct wire {
	unsigned bits; /* so far, stuff bits included */
	unsigned crc;
	unsigned last; /* last bit sent */
	unsigned run;  /* how many bits were equal to it */
};

static void put_bit(struct wire *wire, unsigned bit)
{
	wire->run = wire->run > 0 && bit == wire->last ? wire->run + 1 : 1;
	wire->last = bit;
	wire->bits++;
	if (wire->run < STUFF_RUN)
		return;
	/* The stuff bit is the first of the next run. */
	wire->last = !bit;
	wire->run = 1;
	wire->bits++;
}

/* Most significant bit first. The CRC runs over what was meant, not over stuff bits. */
static void put(struct wire *wire, uint32_t value, unsigned count)
{
	while (count-- > 0) {
		unsigned bit = value >> count & 1;
		unsigned top = wire->crc >> (CRC_BITS - 1) & 1;

		wire->crc = wire->crc << 1 & ((1u << CRC_BITS) - 1);
		if (bit != top)
			wire->crc ^= CRC_POLYNOMIAL;
		put_bit(wire, bit);
	}
}

static void put_identifier(struct wire *wire, uint32_t id)
{
	uint32_t remote = id & DB_CAN_REMOTE ? 1 : 0;

	put(wire, 0, 1); /* start of frame */
	if (id & DB_CAN_EXTENDED) {
		put(wire, id >> 18 & DB_CAN_STANDARD_MASK, 11);
		put(wire, 3, 2); /* substitute remote request, identifier extension */
		put(wire, id & 0x3FFFF, 18);
		put(wire, remote, 1);
		put(wire, 0, 2); /* reserved bits */
	} else {
		put(wire, id & DB_CAN_STANDARD_MASK, 11);
		put(wire, remote, 1);
		put(wire, 0, 2); /* identifier extension, reserved bit */
	}
}

unsigned db_can_frame_bits(const struct db_can_frame *frame)
{
	unsigned length = frame->length < DB_CAN_DATA_MAX ? frame->length : DB_CAN_DATA_MAX;
	struct wire wire = { 0 };
	unsigned crc;

	put_identifier(&wire, frame->id);
	put(&wire, length, 4);
	for (unsigned i = 0; i < length && !(frame->id & DB_CAN_REMOTE); i++)
		put(&wire, frame->data[i], 8);
	crc = wire.crc;
	put(&wire, crc, CRC_BITS);
	return wire.bits + TAIL_BITS;
}

unsigned db_can_frame_bits_max(bool extended, unsigned length)
{
	unsigned stuffed = extended ? EXTENDED_BITS : STANDARD_BITS;

	stuffed += 8 * (length < DB_CAN_DATA_MAX ? length : DB_CAN_DATA_MAX);
	/* The first stuff bit needs five bits before it, each further one only four. */
	return stuffed + (stuffed - 1) / (STUFF_RUN - 1) + TAIL_BITS;
}

bool db_can_filter_passes(const struct db_can_filter *filters, size_t count,
                          const struct db_can_frame *frame)
{
	for (size_t i = 0; i < count; i++) {
		if ((frame->id & filters[i].mask) == (filters[i].id & filters[i].mask))
			return true;
	}
	return count == 0;
}

void db_can_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length)
{
	(void)bytes;
	*skip = 0;
	*length = available >= FRAME_SIZE ? FRAME_SIZE : 0;
}
