/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/can_line.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FRAME sizeof(struct db_can_frame)

/* Contents of SocketCAN's error frames. */
#define ERROR_BUS_OFF (DB_CAN_ERROR | 0x40u)
#define ERROR_RESTARTED (DB_CAN_ERROR | 0x100u)

/* Frames that an adapter has room for. */
#define ADAPTER_QUEUE 32

static void trace_frame(void *context, db_time time, char direction,
                        const struct db_can_frame *frame)
{
	const struct sim_can_line *line = context;
	char text[SIM_CAN_TEXT_MAX];
	size_t length = sim_can_text(frame, text);

	if (line->trace)
		line->trace(line->context, time, direction, (const uint8_t *)text, length);
}

struct sim_can_line *sim_can_line_new(const struct sim_can_config *config, sim_trace_fn *trace,
                                      void *context)
{
	struct sim_can_line *line = calloc(1, sizeof(*line));

	if (!line)
		return NULL;
	line->config = *config;
	line->trace = trace;
	line->context = context;
	line->bus = sim_can_bus_new(config->bitrate, trace_frame, line);
	if (!line->bus) {
		free(line);
		return NULL;
	}
	return line;
}

static void put(struct sim_can_line *line, const void *bytes, size_t length)
{
	if (line->out_length + length > sizeof(line->out)) {
		line->flags |= SLCAN_RX_FULL;
		return;
	}
	memcpy(line->out + line->out_length, bytes, length);
	line->out_length += length;
}

/* --- the adapter ------------------------------------------------------------------------------ */

static void reply(struct sim_can_line *line, const struct slcan_reply *reply)
{
	char text[SLCAN_LINE_MAX];
	int length = slcan_encode_reply(reply, text, sizeof(text));

	if (length > 0)
		put(line, text, (size_t)length);
}

static void reply_kind(struct sim_can_line *line, enum slcan_reply_kind kind)
{
	reply(line, &(struct slcan_reply){ .kind = kind });
}

static void send_frame(struct sim_can_line *line, const struct db_can_frame *frame, db_time now)
{
	/* With another rate no station understands the adapter, so none acknowledges. */
	if (!line->open || line->listens || line->bus->cut ||
	    slcan_bitrate(line->digit) != line->config.bitrate) {
		line->flags |= SLCAN_BUS_ERROR;
		reply_kind(line, SLCAN_REPLY_REFUSED);
		return;
	}
	if (line->bus->host_count >= ADAPTER_QUEUE || !sim_can_bus_put(line->bus, frame, now)) {
		line->flags |= SLCAN_TX_FULL;
		reply_kind(line, SLCAN_REPLY_REFUSED);
		return;
	}
	reply(line, &(struct slcan_reply){ .kind = SLCAN_REPLY_SENT,
	                                   .extended = frame->id & DB_CAN_EXTENDED });
}

static void obey(struct sim_can_line *line, const struct slcan_command *command, db_time now)
{
	const struct sim_can_stats *stats = &line->bus->stats;
	enum slcan_reply_kind kind = SLCAN_REPLY_DONE;

	switch (command->verb) {
	case SLCAN_SEND:
		send_frame(line, &command->frame, now);
		return;
	case SLCAN_SET_RATE:
		if (line->open)
			kind = SLCAN_REPLY_REFUSED;
		else
			line->digit = command->digit;
		break;
	case SLCAN_OPEN:
	case SLCAN_LISTEN:
		if (line->open) {
			kind = SLCAN_REPLY_REFUSED;
			break;
		}
		line->open = true;
		line->listens = (command->verb == SLCAN_LISTEN);
		line->flags = 0;
		break;
	case SLCAN_CLOSE:
		line->open = false;
		break;
	case SLCAN_FLAGS:
		if (!line->open) {
			kind = SLCAN_REPLY_REFUSED;
			break;
		}
		if (stats->arbitration_lost != line->arbitration_reported)
			line->flags |= SLCAN_ARBITRATION_LOST;
		line->arbitration_reported = stats->arbitration_lost;
		if (line->bus->cut)
			line->flags |= SLCAN_ERROR_PASSIVE | SLCAN_BUS_ERROR;
		reply(line,
		      &(struct slcan_reply){ .kind = SLCAN_REPLY_FLAGS, .flags = line->flags });
		line->flags = 0;
		return;
	case SLCAN_VERSION:
		reply(line, &(struct slcan_reply){ .kind = SLCAN_REPLY_VERSION, .text = "1013" });
		return;
	case SLCAN_SERIAL:
		reply(line, &(struct slcan_reply){ .kind = SLCAN_REPLY_SERIAL, .text = "DB01" });
		return;
	case SLCAN_SET_BTR: /* rates outside of the table are not simulated */
		kind = SLCAN_REPLY_REFUSED;
		break;
	default: /* an empty line, timestamps */
		break;
	}
	reply_kind(line, kind);
}

/* --- both kinds ------------------------------------------------------------------------------- */

static void line_receive(void *wire, const uint8_t *bytes, size_t length, db_time now)
{
	struct sim_can_line *line = wire;
	struct slcan_command command;
	struct db_can_frame frame;

	for (size_t i = 0; i < length; i++) {
		if (line->config.adapter) {
			enum slcan_took took = slcan_take(&line->reader, bytes[i]);

			if (took == SLCAN_TOOK_LINE &&
			    slcan_decode_command(line->reader.line, line->reader.length,
			                         &command) == SLCAN_OK)
				obey(line, &command, now);
			else if (took != SLCAN_TOOK_MORE)
				reply_kind(line, SLCAN_REPLY_REFUSED);
			continue;
		}
		line->partial[line->partial_length++] = bytes[i];
		if (line->partial_length < FRAME)
			continue;
		line->partial_length = 0;
		memcpy(&frame, line->partial, FRAME);
		if (!(frame.id & (DB_CAN_ERROR | DB_CAN_REMOTE)))
			(void)sim_can_bus_put(line->bus, &frame, now);
	}
}

static size_t line_run(void *wire, db_time now, uint8_t *out, size_t size)
{
	struct sim_can_line *line = wire;
	struct db_can_frame error = { .length = DB_CAN_DATA_MAX };
	struct db_can_frame frame;
	size_t count;
	bool off;

	/* The fault "bus-off on" takes the host off the bus; an interface reports it by error
	 * frames. */
	off = line->bus->faults.left[SIM_FAULT_BUS_OFF] != 0;
	if (off != line->bus->cut) {
		sim_can_bus_cut(line->bus, off);
		error.id = off ? ERROR_BUS_OFF : ERROR_RESTARTED;
		if (!line->config.adapter)
			put(line, &error, FRAME);
	}
	while (line->out_length + SLCAN_LINE_MAX <= sizeof(line->out) &&
	       sim_can_bus_run(line->bus, now, &frame)) {
		if (!line->config.adapter)
			put(line, &frame, FRAME);
		else if (line->open && slcan_bitrate(line->digit) == line->config.bitrate)
			reply(line,
			      &(struct slcan_reply){ .kind = SLCAN_REPLY_FRAME, .frame = frame });
	}
	count = line->out_length < size ? line->out_length : size;
	memcpy(out, line->out, count);
	line->out_length -= count;
	memmove(line->out, line->out + count, line->out_length);
	return count;
}

static db_time line_next(void *wire)
{
	struct sim_can_line *line = wire;

	return line->out_length > 0 ? 0 : sim_can_bus_next(line->bus);
}

static struct sim_faults *line_faults(void *wire)
{
	return &((struct sim_can_line *)wire)->bus->faults;
}

static void line_describe(void *wire, char *text, size_t size)
{
	const struct sim_can_stats *stats = &((struct sim_can_line *)wire)->bus->stats;

	snprintf(text, size,
	         "frames=%" PRIu32 " requests=%" PRIu32 " replies=%" PRIu32
	         " arbitration_lost=%" PRIu32 " corrupted=%" PRIu32 " overflows=%" PRIu32
	         " busy_us=%" PRIu64,
	         stats->frames, stats->host_frames, stats->frames - stats->host_frames,
	         stats->arbitration_lost, stats->corrupted, stats->overflows,
	         stats->busy_ns / 1000);
}

static void line_free(void *wire)
{
	struct sim_can_line *line = wire;

	if (!line)
		return;
	free(line->bus);
	free(line);
}

const struct sim_wire_ops sim_can_line_ops = {
	.receive = line_receive,
	.run = line_run,
	.next = line_next,
	.faults = line_faults,
	.describe = line_describe,
	.free = line_free,
};
