/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modbus RTU on a line that may have other devices: from bytes and the silences between them to
 * frames, and which of those may be requests. Pure: time is passed in, no I/O, no allocation.
 *
 * A frame begins after a silence of 3.5 characters or directly after another frame, ends before a
 * silence, and has a right CRC. Bytes that arrive together need not be one frame: an adapter, or a
 * thread that ran late, joins them. A gap inside a frame is no end of it: adapters make such gaps.
 */
#ifndef DRIVEBRIDGE_SERVER_RTU_FRAMES_H
#define DRIVEBRIDGE_SERVER_RTU_FRAMES_H

#include "drivebridge/time.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define DB_RTU_FRAME_MIN 4u /* unit, function, CRC */
#define DB_RTU_FRAME_MAX 256u
#define DB_RTU_BURST_MAX ((size_t)(4 * DB_RTU_FRAME_MAX))
#define DB_RTU_GAPS_MAX 16u

/* The CRC of these bytes, which is sent low byte first; 0 over a whole frame that is right. */
uint16_t db_rtu_crc(const uint8_t *bytes, size_t length);

/* 3.5 characters of this length on the wire, and at least 1.75 ms, as the standard says. */
db_time db_rtu_silence(db_time character);

/* Bytes since the last silence that ended frames. Starts as zeros. */
struct db_rtu_burst {
	uint8_t bytes[DB_RTU_BURST_MAX];
	size_t used;
	uint16_t gaps[DB_RTU_GAPS_MAX]; /* places where a frame may begin, after a gap */
	unsigned gap_count;
	bool overrun;  /* more than fits: nothing of it counts */
	db_time began; /* arrival of the first byte */
	db_time last;  /* and of the last one */
};

/* Bytes were received. `silence` as above. */
void db_rtu_burst_add(struct db_rtu_burst *burst, const uint8_t *bytes, size_t length,
                      db_time silence, db_time now);
void db_rtu_burst_clear(struct db_rtu_burst *burst);

struct db_rtu_piece {
	uint16_t at; /* in the burst's bytes */
	uint16_t length;
};

#define DB_RTU_PIECES_MAX (DB_RTU_BURST_MAX / DB_RTU_FRAME_MIN)

/* The frames up to the end of the burst, from the first place from which all of it is frames.
 * Returns their number; 0: there is no such place (yet). */
size_t db_rtu_burst_cut(const struct db_rtu_burst *burst,
                        struct db_rtu_piece pieces[DB_RTU_PIECES_MAX]);

/*
 * Some adapters receive what they send. Answers to FC 5, 6 and 22 equal their requests, so an echo
 * would be executed: here is known what was sent last, and learned whether the line echoes. While
 * that is not known, a frame like the answer that follows it closely counts as an echo: a PLC whose
 * request is lost to that repeats it later. Starts as zeros.
 */
struct db_rtu_echo {
	bool expected; /* nothing was received since the answer */
	bool echoes;
	unsigned against; /* answers in a row without an echo */
	uint8_t sent[DB_RTU_FRAME_MAX];
	size_t length;
	db_time end; /* when the last byte was on the wire, at the earliest */
};

/* An answer was handed to the port, and takes `wire` to be sent. */
void db_rtu_echo_sent(struct db_rtu_echo *echo, const uint8_t *bytes, size_t length, db_time wire,
                      db_time now);

/* True if the first frame of a burst that began then is the echo of the last answer. */
bool db_rtu_echo_take(struct db_rtu_echo *echo, const uint8_t *bytes, size_t length,
                      db_time silence, db_time began);

#endif
