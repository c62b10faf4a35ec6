/* SPDX-License-Identifier: Apache-2.0 */
#include "health/health_private.h"

#include <string.h>

/*
 * All numbers have the lowest byte first.
 *
 * Head: text "DBHEALTH", u16 version, u16 columns, u16 slots of each ring, u32 checksum of the head
 * (with 0 in its place), 10 bytes 0; of each column: 32 bytes name, u16 unit, 2 bytes 0, u32 since.
 * Slot: u32 checksum of the following, u8 ring, 1 byte 0, u16 span_s, u32 number, u32 run,
 * u32 clock_s, u64 wall_us; then the values.
 */

#define VERSION 1
#define HEAD 32
#define CHECKSUM_AT 18
#define COLUMN 40

#define HOURS (7 * 24)
#define QUARTERS_MOST (24 * 4)
#define QUARTERS_LEAST (6 * 4)
#define MINUTES_MOST (24 * 60)

static const uint8_t magic[8] = { 'D', 'B', 'H', 'E', 'A', 'L', 'T', 'H' };

const unsigned db_ring_widths[DB_RING_COUNT] = { 1, 15, 60 };

size_t db_ring_head_bytes(const struct db_ring_shape *shape)
{
	return HEAD + (size_t)shape->columns * COLUMN;
}

size_t db_ring_slot_bytes(const struct db_ring_shape *shape)
{
	return DB_RING_SLOT_HEAD + (size_t)shape->columns * DB_HEALTH_VALUE_BYTES;
}

size_t db_ring_file_bytes(const struct db_ring_shape *shape)
{
	size_t slots = 0;

	for (unsigned ring = 0; ring < DB_RING_COUNT; ring++)
		slots += shape->slots[ring];
	return db_ring_head_bytes(shape) + slots * db_ring_slot_bytes(shape);
}

void db_ring_shape_for(size_t drives, struct db_ring_shape *shape)
{
	/* Drives that a reload adds rarely need another file. */
	size_t columns = (drives + 7) / 8 * 8;
	size_t rest;
	size_t quarters;

	if (columns > DB_RING_COLUMNS_MAX)
		columns = DB_RING_COLUMNS_MAX;
	*shape = (struct db_ring_shape){ .columns = (uint16_t)(columns > 0 ? columns : 8),
		                         .slots = { [DB_RING_HOURS] = HOURS } };
	rest = (DB_RING_FILE_MAX - db_ring_file_bytes(shape)) / db_ring_slot_bytes(shape);
	quarters = rest / 4;
	if (quarters < QUARTERS_LEAST)
		quarters = QUARTERS_LEAST;
	if (quarters > QUARTERS_MOST)
		quarters = QUARTERS_MOST;
	rest -= quarters;
	shape->slots[DB_RING_QUARTERS] = (uint16_t)quarters;
	shape->slots[DB_RING_MINUTES] = (uint16_t)(rest < MINUTES_MOST ? rest : MINUTES_MOST);
}

size_t db_ring_place(const struct db_ring_shape *shape, enum db_ring ring, uint32_t number)
{
	size_t slot = number % shape->slots[ring];

	for (unsigned before = 0; before < (unsigned)ring; before++)
		slot += shape->slots[before];
	return db_ring_head_bytes(shape) + slot * db_ring_slot_bytes(shape);
}

/* --- head ------------------------------------------------------------------------------------- */

void db_ring_write_head(const struct db_ring_shape *shape, const struct db_ring_column *columns,
                        uint8_t *bytes)
{
	size_t size = db_ring_head_bytes(shape);

	memset(bytes, 0, size);
	for (size_t i = 0; i < sizeof(magic); i++)
		bytes[i] = magic[i];
	db_bytes_put(bytes + 8, VERSION, 2);
	db_bytes_put(bytes + 10, shape->columns, 2);
	for (unsigned ring = 0; ring < DB_RING_COUNT; ring++)
		db_bytes_put(bytes + 12 + 2 * ring, shape->slots[ring], 2);
	for (size_t i = 0; i < shape->columns; i++) {
		uint8_t *at = bytes + HEAD + i * COLUMN;

		memcpy(at, columns[i].name, DB_HEALTH_NAME_MAX);
		db_bytes_put(at + 32, columns[i].unit, 2);
		db_bytes_put(at + 36, columns[i].since, 4);
	}
	db_bytes_put(bytes + CHECKSUM_AT, db_bytes_crc(bytes, size), 4);
}

bool db_ring_read_head(const uint8_t *bytes, size_t size, struct db_ring_shape *shape,
                       struct db_ring_column columns[DB_RING_COLUMNS_MAX])
{
	struct db_ring_shape wanted;
	uint8_t copy[DB_RING_HEAD_MAX];

	if (size < HEAD || memcmp(bytes, magic, sizeof(magic)) != 0 ||
	    db_bytes_get(bytes + 8, 2) != VERSION)
		return false;
	shape->columns = (uint16_t)db_bytes_get(bytes + 10, 2);
	if (shape->columns == 0 || shape->columns > DB_RING_COLUMNS_MAX ||
	    size < db_ring_head_bytes(shape))
		return false;
	/* Other numbers of slots are another version's. */
	db_ring_shape_for(shape->columns, &wanted);
	for (unsigned ring = 0; ring < DB_RING_COUNT; ring++)
		shape->slots[ring] = (uint16_t)db_bytes_get(bytes + 12 + 2 * ring, 2);
	if (wanted.columns != shape->columns ||
	    memcmp(wanted.slots, shape->slots, sizeof(wanted.slots)) != 0)
		return false;
	/* When the checksum was made, there was 0 in its place. */
	size = db_ring_head_bytes(shape);
	memcpy(copy, bytes, size);
	memset(copy + CHECKSUM_AT, 0, 4);
	if (db_bytes_crc(copy, size) != db_bytes_get(bytes + CHECKSUM_AT, 4))
		return false;
	for (size_t i = 0; i < shape->columns; i++) {
		const uint8_t *at = bytes + HEAD + i * COLUMN;

		/* Nothing but what the service gives to drives may get into a text. */
		if (memchr(at, '\0', DB_HEALTH_NAME_MAX) == NULL)
			return false;
		for (const uint8_t *text = at; *text != '\0'; text++) {
			if (*text <= ' ' || *text > '~' || *text == '"' || *text == '\\')
				return false;
		}
		memcpy(columns[i].name, at, DB_HEALTH_NAME_MAX);
		columns[i].unit = (uint16_t)db_bytes_get(at + 32, 2);
		columns[i].since = (uint32_t)db_bytes_get(at + 36, 4);
	}
	return true;
}

/* --- slots ------------------------------------------------------------------------------------ */

uint8_t *db_ring_value_of(uint8_t *bytes, size_t column)
{
	return bytes + DB_RING_SLOT_HEAD + column * DB_HEALTH_VALUE_BYTES;
}

void db_ring_clear_slot(const struct db_ring_shape *shape, uint8_t *bytes)
{
	const struct db_health_value unknown = { .coldest = DB_HEALTH_NO_TEMPERATURE,
		                                 .hottest = DB_HEALTH_NO_TEMPERATURE };

	for (size_t i = 0; i < shape->columns; i++)
		db_health_value_write(&unknown, db_ring_value_of(bytes, i));
}

void db_ring_write_slot(const struct db_ring_shape *shape, enum db_ring ring,
                        const struct db_ring_slot *slot, uint8_t *bytes)
{
	db_bytes_put(bytes + 4, ring, 2);
	db_bytes_put(bytes + 6, slot->span_s, 2);
	db_bytes_put(bytes + 8, slot->number, 4);
	db_bytes_put(bytes + 12, slot->run, 4);
	db_bytes_put(bytes + 16, slot->clock_s, 4);
	db_bytes_put(bytes + 20, slot->wall_us, 8);
	db_bytes_put(bytes, db_bytes_crc(bytes + 4, db_ring_slot_bytes(shape) - 4), 4);
}

bool db_ring_read_slot(const struct db_ring_shape *shape, enum db_ring ring, const uint8_t *bytes,
                       struct db_ring_slot *slot)
{
	*slot = (struct db_ring_slot){
		.span_s = (uint16_t)db_bytes_get(bytes + 6, 2),
		.number = (uint32_t)db_bytes_get(bytes + 8, 4),
		.run = (uint32_t)db_bytes_get(bytes + 12, 4),
		.clock_s = (uint32_t)db_bytes_get(bytes + 16, 4),
		.wall_us = db_bytes_get(bytes + 20, 8),
	};
	/* Run 0 there is none: bytes that were never written are 0. */
	return slot->run != 0 && db_bytes_get(bytes + 4, 2) == (uint64_t)ring &&
	       db_bytes_get(bytes, 4) == db_bytes_crc(bytes + 4, db_ring_slot_bytes(shape) - 4);
}
