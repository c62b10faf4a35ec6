/* SPDX-License-Identifier: Apache-2.0 */
/* Numbers in four bytes, the high one first. Pure. */
#ifndef DRIVEBRIDGE_CODEC_BIG_ENDIAN_H
#define DRIVEBRIDGE_CODEC_BIG_ENDIAN_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

static inline void put_be32(uint32_t value, uint8_t *data)
{
	for (size_t i = 0; i < 4; i++)
		data[i] = (uint8_t)(value >> (24 - 8 * i));
}

static inline uint32_t get_be32(const uint8_t *data)
{
	uint32_t value = 0;

	for (size_t i = 0; i < 4; i++)
		value = value << 8 | data[i];
	return value;
}

static inline uint32_t bits_of_int(int32_t number)
{
	return (uint32_t)number;
}

static inline int32_t int_of_bits(uint32_t bits)
{
	int32_t number;

	memcpy(&number, &bits, sizeof(number));
	return number;
}

static inline uint32_t bits_of_float(float number)
{
	uint32_t bits;

	memcpy(&bits, &number, sizeof(bits));
	return bits;
}

static inline float float_of_bits(uint32_t bits)
{
	float number;

	memcpy(&number, &bits, sizeof(number));
	return number;
}

#endif
