/* SPDX-License-Identifier: Apache-2.0 */
#include "capture/pcapng.h"
#include "words/value.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum block { BLOCK_INTERFACE = 1, BLOCK_PACKET = 6, BLOCK_SECTION = 0x0A0D0D0A };

enum option {
	OPTION_END = 0,
	OPTION_COMMENT = 1,
	OPTION_NAME = 2,        /* of an interface; for a packet: the flags */
	OPTION_DESCRIPTION = 3, /* of an interface */
	OPTION_DROPPED = 4,     /* of a packet */
	OPTION_RESOLUTION = 9,  /* of an interface */
	OPTION_FLAGS = 2,
};

#define LINKTYPE_CAN_SOCKETCAN 227
#define LINKTYPE_USER0 147
#define LINE_VERSION 1
#define LINE_WORDS_MAX 4096
#define LINE_BYTES_MAX 2048
#define RESOLUTION_US 6
#define FLAG_INBOUND 1
#define FLAG_OUTBOUND 2
#define CAN_HEAD 8
#define CAN_DATA_MAX 8

/* A block under construction: little-endian, in words. */
struct builder {
	uint8_t bytes[LINE_WORDS_MAX + LINE_BYTES_MAX + 1024];
	size_t used;
};

static void put(struct builder *builder, uint64_t value, size_t bytes)
{
	for (size_t i = 0; i < bytes; i++)
		builder->bytes[builder->used++] = (uint8_t)(value >> (8 * i));
}

static void put_padded(struct builder *builder, const void *bytes, size_t length)
{
	memcpy(builder->bytes + builder->used, bytes, length);
	builder->used += length;
	while (builder->used % 4 != 0)
		builder->bytes[builder->used++] = 0;
}

static void put_option(struct builder *builder, enum option option, const void *bytes,
                       size_t length)
{
	put(builder, option, 2);
	put(builder, length, 2);
	put_padded(builder, bytes, length);
}

static void begin_block(struct builder *builder, enum block block)
{
	builder->used = 0;
	put(builder, block, 4);
	put(builder, 0, 4); /* length of the data that follows */
}

static bool write_block(struct builder *builder, FILE *file)
{
	uint32_t length = (uint32_t)builder->used + 4;

	put(builder, length, 4);
	for (size_t i = 0; i < 4; i++)
		builder->bytes[4 + i] = (uint8_t)(length >> (8 * i));
	return fwrite(builder->bytes, 1, builder->used, file) == builder->used;
}

bool db_capture_pcapng_begin(FILE *file, const json_t *bus)
{
	static const uint8_t resolution[] = { RESOLUTION_US };
	const char *interface = db_words_text(bus, "name");
	struct builder builder;
	char description[256];

	snprintf(description, sizeof(description), "%s at %lld bit/s, bus %s of drivebridge",
	         db_words_text(bus, "device"),
	         (long long)json_integer_value(json_object_get(bus, "speed")), interface);
	begin_block(&builder, BLOCK_SECTION);
	put(&builder, 0x1A2B3C4D, 4);
	put(&builder, 1, 2);
	put(&builder, 0, 2);
	put(&builder, UINT64_MAX, 8); /* the section's length is not given */
	if (!write_block(&builder, file))
		return false;
	begin_block(&builder, BLOCK_INTERFACE);
	put(&builder,
	    json_is_false(json_object_get(bus, "can")) ? LINKTYPE_USER0 : LINKTYPE_CAN_SOCKETCAN,
	    2);
	put(&builder, 0, 2);
	put(&builder, 0, 4); /* no limit: packets are whole */
	put_option(&builder, OPTION_NAME, interface, strnlen(interface, 255));
	put_option(&builder, OPTION_DESCRIPTION, description, strlen(description));
	put_option(&builder, OPTION_RESOLUTION, resolution, sizeof(resolution));
	put_option(&builder, OPTION_END, "", 0);
	return write_block(&builder, file);
}

struct frame {
	uint8_t bytes[CAN_HEAD + CAN_DATA_MAX];
	size_t length;
};

static struct frame read_frame(const json_t *record)
{
	uint32_t id = (uint32_t)json_integer_value(json_object_get(record, "id"));
	const char *data = db_words_text(record, "data");
	struct frame frame = { .bytes = { (uint8_t)(id >> 24), (uint8_t)(id >> 16),
		                          (uint8_t)(id >> 8), (uint8_t)id },
		               .length = CAN_HEAD };

	for (; data[0] && data[1] && frame.length < sizeof(frame.bytes); data += 2) {
		const char digits[] = { data[0], data[1], '\0' };

		frame.bytes[frame.length++] = (uint8_t)strtoul(digits, NULL, 16);
	}
	frame.bytes[4] = (uint8_t)(frame.length - CAN_HEAD);
	return frame;
}

static void begin_packet(struct builder *builder, const json_t *record, size_t length)
{
	uint64_t time_us = (uint64_t)json_integer_value(json_object_get(record, "time_us"));

	begin_block(builder, BLOCK_PACKET);
	put(builder, 0, 4); /* index of the one interface */
	put(builder, time_us >> 32, 4);
	put(builder, time_us & UINT32_MAX, 4);
	put(builder, length, 4);
	put(builder, length, 4);
}

/* 0 where it has none. */
static uint8_t find_flag(const json_t *record)
{
	const char *direction = db_words_text(record, "direction");

	return strcmp(direction, "sent") == 0     ? FLAG_OUTBOUND :
	       strcmp(direction, "received") == 0 ? FLAG_INBOUND :
	                                            0;
}

static bool end_packet(struct builder *builder, struct db_capture_pcapng *pcapng,
                       const json_t *record, FILE *file)
{
	uint8_t flags[4] = { find_flag(record) };

	put_option(builder, OPTION_FLAGS, flags, sizeof(flags));
	if (pcapng->comment[0] != '\0')
		put_option(builder, OPTION_COMMENT, pcapng->comment, strlen(pcapng->comment));
	if (pcapng->missed > 0) {
		put(builder, OPTION_DROPPED, 2);
		put(builder, 8, 2);
		put(builder, (uint64_t)pcapng->missed, 8);
	}
	put_option(builder, OPTION_END, "", 0);
	pcapng->missed = 0;
	pcapng->comment[0] = '\0';
	return write_block(builder, file);
}

/* A packet of a serial line: see the header. */
struct packet {
	uint8_t bytes[LINE_WORDS_MAX + LINE_BYTES_MAX + 512];
	size_t length;
};

static void put_text(struct packet *packet, const char *text, size_t most)
{
	size_t length = strnlen(text, most);

	packet->bytes[packet->length++] = (uint8_t)(length >> 8);
	packet->bytes[packet->length++] = (uint8_t)length;
	memcpy(packet->bytes + packet->length, text, length);
	packet->length += length;
}

static bool write_line_packet(struct db_capture_pcapng *pcapng, const json_t *record,
                              const char *words, FILE *file)
{
	const char *data = db_words_text(record, "data");
	uint8_t flag = find_flag(record);
	struct packet packet;
	struct builder builder;

	packet.length = 0;
	packet.bytes[packet.length++] = LINE_VERSION;
	packet.bytes[packet.length++] = flag == FLAG_OUTBOUND ? 1 : flag == FLAG_INBOUND ? 2 : 0;
	put_text(&packet, pcapng->family, 64);
	put_text(&packet, db_words_text(record, "kind"), 64);
	put_text(&packet, words, LINE_WORDS_MAX);
	for (size_t i = 0; data[0] && data[1] && i < LINE_BYTES_MAX; i++, data += 2) {
		const char digits[] = { data[0], data[1], '\0' };

		packet.bytes[packet.length++] = (uint8_t)strtoul(digits, NULL, 16);
	}
	begin_packet(&builder, record, packet.length);
	put_padded(&builder, packet.bytes, packet.length);
	return end_packet(&builder, pcapng, record, file);
}

bool db_capture_pcapng_take(struct db_capture_pcapng *pcapng, const json_t *record,
                            const char *words, FILE *file)
{
	size_t used = strlen(pcapng->comment);
	struct frame frame = read_frame(record);
	struct builder builder;

	if (pcapng->family)
		return write_line_packet(pcapng, record, words, file);
	snprintf(pcapng->comment + used, sizeof(pcapng->comment) - used, "%s%s: %s",
	         used > 0 ? "; " : "", db_words_text(record, "kind"), words);
	if (!json_is_integer(json_object_get(record, "id")))
		return true;
	begin_packet(&builder, record, frame.length);
	put_padded(&builder, frame.bytes, frame.length);
	return end_packet(&builder, pcapng, record, file);
}
