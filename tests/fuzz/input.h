/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A fuzzer's bytes as a list of decisions: what is asked for beyond their end is 0, so every input
 * is a whole story. Header only; one thread.
 */
#ifndef DRIVEBRIDGE_FUZZ_INPUT_H
#define DRIVEBRIDGE_FUZZ_INPUT_H

#include "fakes/must.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct input {
	const uint8_t *bytes;
	size_t left;
};

static inline uint8_t input_u8(struct input *input)
{
	uint8_t byte;

	if (input->left == 0)
		return 0;
	byte = *input->bytes++;
	input->left--;
	return byte;
}

static inline uint16_t input_u16(struct input *input)
{
	uint16_t high = input_u8(input);

	return (uint16_t)(high << 8 | input_u8(input));
}

static inline uint32_t input_u32(struct input *input)
{
	uint32_t high = input_u16(input);

	return high << 16 | input_u16(input);
}

/* 0..limit-1 */
static inline size_t input_below(struct input *input, size_t limit)
{
	return input_u8(input) % limit;
}

static inline float input_float(struct input *input)
{
	uint32_t bits = input_u32(input);
	float value;

	memcpy(&value, &bits, sizeof value);
	return value;
}

/* At most `size` bytes of the input, where they are: *bytes is set, their number returned. */
static inline size_t input_bytes(struct input *input, size_t size, const uint8_t **bytes)
{
	size_t length = size < input->left ? size : input->left;

	*bytes = input->bytes;
	input->bytes += length;
	input->left -= length;
	return length;
}

#endif
