/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/can.h"

#define CRC_BITS 15
#define STUFF_RUN 5 /* after this number of equal bits an opposite one is inserted */

/* CRC delimiter, acknowledge slot and its delimiter, end of frame (7), intermission (3) */
#define TAIL_BITS 13u

/* From start of frame to the end of the CRC, data and stuff bits not counted */
#define STANDARD_BITS 34u
#define EXTENDED_BITS 54u

#define FRAME_SIZE sizeof(struct db_can_frame)

/* The CRC of four bits after zeros only. */
static const uint16_t crc_of_nibble[16] = {
	0x0000, 0x4599, 0x4EAB, 0x0B32, 0x58CF, 0x1D56, 0x1664, 0x53FD,
	0x7407, 0x319E, 0x3AAC, 0x7F35, 0x2CC8, 0x6951, 0x6263, 0x27FA,
};

/* A frame being sent, as a controller sees it. */
struct wire {
	unsigned bits; /* bits so far, including stuff bits */
	unsigned last; /* last bit sent */
	unsigned run;  /* number of bits equal to it */
};

/* The CRC covers the bits without stuff bits. Zeros before the first bit that is set change
 * nothing. */
static unsigned add_crc(unsigned crc, uint64_t value, unsigned nibbles)
{
	while (nibbles-- > 0) {
		unsigned nibble = (unsigned)(value >> (4 * nibbles) & 0xF);
		unsigned top = crc >> (CRC_BITS - 4);

		crc = (crc << 4 & ((1u << CRC_BITS) - 1)) ^ crc_of_nibble[top ^ nibble];
	}
	return crc;
}

/* 1 to 64 bits, most significant first. Run by run: most bits are equal to the one before. */
static void put(struct wire *wire, uint64_t value, unsigned count)
{
	uint64_t rest = value << (64 - count);

	wire->bits += count;
	while (count > 0) {
		unsigned bit = (unsigned)(rest >> 63);
		uint64_t others = bit ? ~rest : rest;
		unsigned equal = others ? (unsigned)__builtin_clzll(others) : count;
		unsigned run;

		equal = equal < count ? equal : count;
		rest = equal < 64 ? rest << equal : 0;
		count -= equal;
		run = (wire->run > 0 && bit == wire->last ? wire->run : 0) + equal;
		wire->bits += run / STUFF_RUN;
		wire->run = run % STUFF_RUN;
		wire->last = bit;
		/* A stuff bit is the first of the next run. */
		if (wire->run == 0) {
			wire->run = 1;
			wire->last = !bit;
		}
	}
}

unsigned db_can_frame_bits(const struct db_can_frame *frame)
{
	unsigned length = frame->length < DB_CAN_DATA_MAX ? frame->length : DB_CAN_DATA_MAX;
	unsigned bytes = frame->id & DB_CAN_REMOTE ? 0 : length;
	struct wire wire = { 0 };
	uint64_t remote = frame->id & DB_CAN_REMOTE ? 1 : 0;
	uint64_t begin;
	unsigned count; /* of these bits */
	uint64_t data = 0;
	unsigned crc;

	/* From the start of frame to the length. */
	if (frame->id & DB_CAN_EXTENDED) {
		uint64_t high = frame->id >> 18 & DB_CAN_STANDARD_MASK;

		/* 3: substitute remote request, identifier extension; after the remote bit two
		 * reserved ones */
		begin = high << 27 | UINT64_C(3) << 25 | (uint64_t)(frame->id & 0x3FFFF) << 7 |
		        remote << 6 | length;
		count = 39;
	} else {
		/* after the remote bit: identifier extension, reserved bit */
		begin = (uint64_t)(frame->id & DB_CAN_STANDARD_MASK) << 7 | remote << 6 | length;
		count = 19;
	}
	for (unsigned i = 0; i < bytes; i++)
		data = data << 8 | frame->data[i];
	crc = add_crc(add_crc(0, begin, (count + 3) / 4), data, 2 * bytes);
	put(&wire, begin, count);
	if (bytes > 0)
		put(&wire, data, 8 * bytes);
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
