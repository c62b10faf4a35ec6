/* SPDX-License-Identifier: Apache-2.0 */
#include "opcua/operands.h"

#include <stdbool.h>
#include <string.h>

/* The header of a chunk, of its channel and of its sequence; then the message begins with the id of
 * its type. */
#define HEADER_SIZE 24

/* Ids of the standard. */
#define CREATE_MONITORED_ITEMS 751
#define MODIFY_MONITORED_ITEMS 763
#define BASE_EVENT_TYPE 2041
#define CONDITION_TYPE 2782

#define NODE_ID_ATTRIBUTE 1

/* An id of the standard in the one or the other of its encodings; 0: it is none of those. *size is
 * that of the encoding, *at where its number begins. */
static unsigned read_id(const uint8_t *bytes, size_t length, size_t *size, size_t *at)
{
	if (length >= 4 && bytes[0] == 1 && bytes[1] == 0) {
		*size = 4;
		*at = 2;
		return bytes[2] | (unsigned)bytes[3] << 8;
	}
	if (length >= 7 && bytes[0] == 2 && bytes[1] == 0 && bytes[2] == 0 && bytes[5] == 0 &&
	    bytes[6] == 0) {
		*size = 7;
		*at = 3;
		return bytes[3] | (unsigned)bytes[4] << 8;
	}
	return 0;
}

static uint32_t read_number(const uint8_t *bytes)
{
	return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 |
	       (uint32_t)bytes[3] << 24;
}

/* The length of a list or a text: none, or nothing in it. */
static bool is_empty(const uint8_t *bytes)
{
	uint32_t length = read_number(bytes);

	return length == 0 || length == UINT32_MAX;
}

void db_opcua_operands_mend(uint8_t *chunk, size_t length)
{
	size_t size = 0;
	size_t at = 0;
	unsigned type;

	if (length < HEADER_SIZE || memcmp(chunk, "MSG", 3) != 0)
		return;
	type = read_id(chunk + HEADER_SIZE, length - HEADER_SIZE, &size, &at);
	if (type != CREATE_MONITORED_ITEMS && type != MODIFY_MONITORED_ITEMS)
		return;
	/* An operand: the id of a type, a path, an attribute, a range of indexes. */
	for (size_t i = HEADER_SIZE + size; i < length; i++) {
		uint8_t *rest = chunk + i;

		if (read_id(rest, length - i, &size, &at) != CONDITION_TYPE ||
		    length - i < size + 12 || !is_empty(rest + size) ||
		    read_number(rest + size + 4) != NODE_ID_ATTRIBUTE || !is_empty(rest + size + 8))
			continue;
		rest[at] = BASE_EVENT_TYPE & 0xFF;
		rest[at + 1] = BASE_EVENT_TYPE >> 8;
	}
}
