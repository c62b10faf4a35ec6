/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/vsmd_private.h"

#include "codec/vsmd_describe.h"
#include "codec/vsmd_serial_frames.h"
#include "transport/serial.h"

#include <string.h>

/* Usual time before a drive starts to answer; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (1 * DB_NS_PER_MS)

void vsmd_serial_cut_frame(const struct db_received *received, size_t *skip, size_t *length)
{
	*length = 0;
	if (vsmd_serial_cut(received->bytes, received->available, skip, length) != VSMD_CUT_FRAME)
		*length = 0;
}

enum db_frame vsmd_serial_accept(const struct db_bus_config *bus, const uint8_t *frame,
                                 size_t length, int *address)
{
	struct vsmd_reply reply;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return DB_FRAME_BAD;
	/* On RS232 there is one drive, and the id in its answers varies. */
	*address = bus->line == DB_LINE_RS232 ? -1 : reply.id;
	return DB_FRAME_GOOD;
}

uint32_t vsmd_serial_part(const struct db_bus_config *bus, const uint8_t *frame, size_t length)
{
	(void)bus;
	(void)length;
	return vsmd_serial_code(frame) == VSMD_REPLY_STATUS ? VSMD_REPLY_STATUS : 0;
}

void vsmd_serial_describe_any(const struct db_bus_config *bus, bool sent, const uint8_t *frame,
                              size_t length, struct db_description *description)
{
	if (sent)
		vsmd_serial_describe_line(frame, length, bus->line == DB_LINE_RS485, description);
	else
		vsmd_serial_describe_reply(frame, length, description);
}

static db_time exchange_time(const struct db_bus_config *bus, size_t request, size_t answer)
{
	return db_serial_wire_time(bus, request + answer) + TYPICAL_LATENCY +
	       (db_time)bus->turnaround_us * DB_NS_PER_US;
}

db_time vsmd_serial_poll_time(const struct db_bus_config *bus)
{
	return exchange_time(bus, strlen("32 sts\n"), VSMD_SERIAL_STATUS_FRAME);
}

db_time vsmd_serial_command_time(const struct db_bus_config *bus)
{
	return exchange_time(bus, strlen("32 pos -2147483648 spd=192000.5\n"),
	                     VSMD_SERIAL_STATUS_FRAME);
}

/* A drive that misses the "1" of "12 stp" receives "2 stp", and of "10 stp" it receives a command
 * to all. Numbers further on may look like an address, too; what follows them is no command, but an
 * address alone is answered. */
bool vsmd_serial_mishears(unsigned address, const uint8_t *request, size_t length)
{
	bool in_address = true;

	for (size_t from = 1; from < length; from++) {
		unsigned id = 0;
		size_t i = from;

		if (request[from - 1] == ' ')
			in_address = false;
		for (; i < length && request[i] >= '0' && request[i] <= '9' &&
		       id <= VSMD_SERIAL_ID_MAX;
		     i++)
			id = 10 * id + (unsigned)(request[i] - '0');
		if (i == from || i == length || (request[i] != ' ' && request[i] != '\n'))
			continue;
		if (id == address || (in_address && id == VSMD_SERIAL_BROADCAST))
			return true;
	}
	return false;
}
