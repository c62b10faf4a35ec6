/* SPDX-License-Identifier: Apache-2.0 */
#include "server/rtu_frames.h"

#include <modbus.h>
#include <string.h>

/* Half characters in the silence around a frame, and its shortest time: above 19200 baud. */
#define SILENCE_HALVES 7
#define SILENCE_LEAST (1750 * DB_NS_PER_US)

/* An adapter hands on what it receives after this time at the latest. */
#define ADAPTER_DELAY (20 * DB_NS_PER_MS)
/* After this number of answers without an echo, the line has none. */
#define PROOFS 3

#define EXCEPTION_FLAG 0x80u

static uint16_t add_to_crc(uint16_t crc, uint8_t byte)
{
	/* The CRC of four bits. */
	static const uint16_t nibbles[16] = {
		0x0000, 0xCC01, 0xD801, 0x1400, 0xF001, 0x3C00, 0x2800, 0xE401,
		0xA001, 0x6C00, 0x7800, 0xB401, 0x5000, 0x9C01, 0x8801, 0x4400,
	};

	crc ^= byte;
	crc = (uint16_t)(crc >> 4 ^ nibbles[crc & 0x0F]);
	return (uint16_t)(crc >> 4 ^ nibbles[crc & 0x0F]);
}

uint16_t db_rtu_crc(const uint8_t *bytes, size_t length)
{
	uint16_t crc = 0xFFFF;

	for (size_t i = 0; i < length; i++)
		crc = add_to_crc(crc, bytes[i]);
	return crc;
}

db_time db_rtu_silence(db_time character)
{
	db_time silence = character * SILENCE_HALVES / 2;

	return silence > SILENCE_LEAST ? silence : SILENCE_LEAST;
}

void db_rtu_burst_clear(struct db_rtu_burst *burst)
{
	burst->used = 0;
	burst->gap_count = 0;
	burst->overrun = false;
}

void db_rtu_burst_add(struct db_rtu_burst *burst, const uint8_t *bytes, size_t length,
                      db_time silence, db_time now)
{
	size_t room = sizeof(burst->bytes) - burst->used;

	if (burst->used == 0) {
		burst->began = now;
	} else if (now - burst->last >= silence && burst->gap_count < DB_RTU_GAPS_MAX) {
		burst->gaps[burst->gap_count++] = (uint16_t)burst->used;
	}
	burst->last = now;
	if (length > room) {
		burst->overrun = true;
		length = room;
	}
	memcpy(burst->bytes + burst->used, bytes, length);
	burst->used += length;
}

/* Where each place that a frame can end is reached from: the place where that frame begins. */
struct path {
	bool reached[DB_RTU_BURST_MAX + 1];
	uint16_t from[DB_RTU_BURST_MAX + 1];
};

static void follow_frames(const struct db_rtu_burst *burst, size_t start, struct path *path)
{
	memset(path->reached, 0, sizeof(path->reached));
	path->reached[start] = true;
	for (size_t at = start; at < burst->used; at++) {
		uint16_t crc = 0xFFFF;

		for (size_t end = at;
		     path->reached[at] && end < burst->used && end - at < DB_RTU_FRAME_MAX;) {
			crc = add_to_crc(crc, burst->bytes[end++]);
			if (crc != 0 || end - at < DB_RTU_FRAME_MIN || path->reached[end])
				continue;
			path->reached[end] = true;
			path->from[end] = (uint16_t)at;
		}
	}
}

size_t db_rtu_burst_cut(const struct db_rtu_burst *burst,
                        struct db_rtu_piece pieces[DB_RTU_PIECES_MAX])
{
	struct path path;
	size_t count = 0;

	if (burst->used == 0 || burst->overrun)
		return 0;
	for (unsigned i = 0; i <= burst->gap_count; i++) {
		size_t start = i == 0 ? 0 : burst->gaps[i - 1];

		follow_frames(burst, start, &path);
		if (!path.reached[burst->used])
			continue;
		for (size_t end = burst->used; end > start; end = path.from[end])
			count++;
		for (size_t end = burst->used, left = count; end > start; end = path.from[end])
			pieces[--left] = (struct db_rtu_piece){
				.at = path.from[end],
				.length = (uint16_t)(end - path.from[end]),
			};
		return count;
	}
	return 0;
}

/* --- echoes ----------------------------------------------------------------------------------- */

void db_rtu_echo_sent(struct db_rtu_echo *echo, const uint8_t *bytes, size_t length, db_time wire,
                      db_time now)
{
	echo->expected = length <= sizeof(echo->sent);
	echo->length = echo->expected ? length : 0;
	memcpy(echo->sent, bytes, echo->length);
	echo->end = now + wire;
}

bool db_rtu_echo_take(struct db_rtu_echo *echo, const uint8_t *bytes, size_t length,
                      db_time silence, db_time began)
{
	bool expected = echo->expected;
	bool same = length == echo->length && memcmp(bytes, echo->sent, length) == 0;
	uint8_t function = echo->sent[1];
	/* A PLC may send the same bytes as a request, too. */
	bool ambiguous = expected && echo->length >= DB_RTU_FRAME_MIN &&
	                 (function & EXCEPTION_FLAG) == 0 &&
	                 (function == MODBUS_FC_WRITE_SINGLE_COIL ||
	                  function == MODBUS_FC_WRITE_SINGLE_REGISTER ||
	                  function == MODBUS_FC_MASK_WRITE_REGISTER || function == 0x08);

	echo->expected = false;
	if (!expected)
		return false;
	/* Nobody else sends while the answer is on the wire, and in the silence after it. */
	if (same && (!ambiguous || echo->echoes || began < echo->end + silence ||
	             (echo->against < PROOFS && began < echo->end + ADAPTER_DELAY))) {
		if (!ambiguous) {
			echo->echoes = true;
			echo->against = 0;
		}
		return true;
	}
	if (echo->against < PROOFS)
		echo->against++;
	if (echo->against == PROOFS)
		echo->echoes = false;
	return false;
}
