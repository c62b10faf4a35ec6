/* SPDX-License-Identifier: Apache-2.0 */
/*
 * FNV-1a, 64 bits: for tables and names of files. Whoever chooses the bytes can make two texts equal,
 * so nothing may depend on that they are not, unless a seed that nobody knows comes first. Pure.
 */
#ifndef DRIVEBRIDGE_HASH_H
#define DRIVEBRIDGE_HASH_H

#include <stddef.h>
#include <stdint.h>

#define DB_HASH_BEGIN UINT64_C(0xCBF29CE484222325)

/* The hash of what `hash` is of, followed by these bytes. */
static inline uint64_t db_hash_add(uint64_t hash, const void *bytes, size_t length)
{
	const unsigned char *at = bytes;

	for (size_t i = 0; i < length; i++)
		hash = (hash ^ at[i]) * UINT64_C(0x100000001B3);
	return hash;
}

#endif
