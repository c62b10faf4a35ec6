/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Bytes and silences on a line of Modbus RTU. What is cut into frames has right sums, goes up to the
 * silence without a gap, and begins where a frame may begin; an echo is taken once for each answer.
 */
#include "fuzz/input.h"
#include "server/rtu_frames.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define SILENCE (2 * DB_NS_PER_MS)

static void require(bool condition)
{
	if (!condition)
		abort();
}

static bool may_begin_at(const struct db_rtu_burst *burst, size_t at)
{
	bool found = at == 0;

	for (unsigned i = 0; i < burst->gap_count; i++)
		found = found || burst->gaps[i] == at;
	return found;
}

static void check_frames(const struct db_rtu_burst *burst, struct db_rtu_echo *echo)
{
	struct db_rtu_piece pieces[DB_RTU_PIECES_MAX];
	size_t count = db_rtu_burst_cut(burst, pieces);
	size_t at = count > 0 ? pieces[0].at : 0;

	require(count <= DB_RTU_PIECES_MAX && (count == 0 || may_begin_at(burst, at)));
	for (size_t i = 0; i < count; i++) {
		require(pieces[i].at == at && pieces[i].length >= DB_RTU_FRAME_MIN &&
		        pieces[i].length <= DB_RTU_FRAME_MAX);
		require(db_rtu_crc(burst->bytes + at, pieces[i].length) == 0);
		at += pieces[i].length;
	}
	require(count == 0 || at == burst->used);
	if (count == 0)
		return;
	(void)db_rtu_echo_take(echo, burst->bytes + pieces[0].at, pieces[0].length, SILENCE,
	                       burst->began);
	require(!db_rtu_echo_take(echo, burst->bytes + pieces[0].at, pieces[0].length, SILENCE,
	                          burst->began));
	db_rtu_echo_sent(echo, burst->bytes + pieces[0].at, pieces[0].length, SILENCE, burst->last);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct input input = { data, size };
	struct db_rtu_burst burst = { .used = 0 };
	struct db_rtu_echo echo = { .expected = false };
	db_time now = DB_NS_PER_MS;

	while (input.left > 0) {
		uint8_t bytes[64];
		size_t length = 0;
		uint8_t what = input_u8(&input);

		/* As many bytes as the low bits say, the last two perhaps with the right sum. */
		while (length < (what & 0x1F) && input.left > 0)
			bytes[length++] = input_u8(&input);
		if (what & 0x20) {
			uint16_t crc = db_rtu_crc(bytes, length);

			bytes[length++] = (uint8_t)crc;
			bytes[length++] = (uint8_t)(crc >> 8);
		}
		if (length > 0)
			db_rtu_burst_add(&burst, bytes, length, SILENCE, now);
		require(burst.used <= sizeof(burst.bytes) && burst.gap_count <= DB_RTU_GAPS_MAX);
		now += what & 0x40 ? SILENCE : 1;
		if (what & 0x80) {
			check_frames(&burst, &echo);
			db_rtu_burst_clear(&burst);
		}
	}
	check_frames(&burst, &echo);
	return 0;
}
