/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/pcapng.h"

#include <string.h>

enum block { BLOCK_INTERFACE = 1, BLOCK_PACKET = 6, BLOCK_SECTION = 0x0A0D0D0A };

enum option {
	OPTION_END = 0,
	OPTION_COMMENT = 1,
	OPTION_NAME = 2,        /* of an interface; of a packet the flags */
	OPTION_DESCRIPTION = 3, /* of an interface */
	OPTION_DROPPED = 4,     /* of a packet */
	OPTION_RESOLUTION = 9,  /* of an interface */
	OPTION_FLAGS = 2,
};

#define LINKTYPE_CAN_SOCKETCAN 227
#define RESOLUTION_US 6
#define FLAG_INBOUND 1
#define FLAG_OUTBOUND 2
#define CAN_HEAD 8
#define COMMENT_MAX 4000

/* A block under construction: little-endian, in words. */
struct builder {
	uint8_t bytes[COMMENT_MAX + 256];
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
	put(builder, 0, 4); /* the length, which follows */
}

static bool write_block(struct builder *builder, FILE *file)
{
	uint32_t length = (uint32_t)builder->used + 4;

	put(builder, length, 4);
	for (size_t i = 0; i < 4; i++)
		builder->bytes[4 + i] = (uint8_t)(length >> (8 * i));
	return fwrite(builder->bytes, 1, builder->used, file) == builder->used;
}

bool db_ctl_pcapng_begin(FILE *file, const char *interface, const char *description)
{
	static const uint8_t resolution[] = { RESOLUTION_US };
	struct builder builder;
	size_t length = strlen(description);

	begin_block(&builder, BLOCK_SECTION);
	put(&builder, 0x1A2B3C4D, 4);
	put(&builder, 1, 2);
	put(&builder, 0, 2);
	put(&builder, UINT64_MAX, 8); /* the section's length is not told */
	if (!write_block(&builder, file))
		return false;
	begin_block(&builder, BLOCK_INTERFACE);
	put(&builder, LINKTYPE_CAN_SOCKETCAN, 2);
	put(&builder, 0, 2);
	put(&builder, 0, 4); /* nothing is cut */
	put_option(&builder, OPTION_NAME, interface, strnlen(interface, 255));
	put_option(&builder, OPTION_DESCRIPTION, description, length < 1024 ? length : 1024);
	put_option(&builder, OPTION_RESOLUTION, resolution, sizeof(resolution));
	put_option(&builder, OPTION_END, "", 0);
	return write_block(&builder, file);
}

bool db_ctl_pcapng_add(FILE *file, const struct db_ctl_pcapng_frame *frame)
{
	uint8_t bytes[CAN_HEAD + 8] = { (uint8_t)(frame->id >> 24), (uint8_t)(frame->id >> 16),
		                        (uint8_t)(frame->id >> 8), (uint8_t)frame->id,
		                        frame->length };
	uint8_t flags[4] = { frame->sent ? FLAG_OUTBOUND : FLAG_INBOUND };
	size_t comment = strlen(frame->comment);
	size_t length = CAN_HEAD + (size_t)frame->length;
	struct builder builder;

	memcpy(bytes + CAN_HEAD, frame->data, frame->length);
	begin_block(&builder, BLOCK_PACKET);
	put(&builder, 0, 4); /* the one interface */
	put(&builder, (uint64_t)frame->time_us >> 32, 4);
	put(&builder, (uint64_t)frame->time_us & UINT32_MAX, 4);
	put(&builder, length, 4);
	put(&builder, length, 4);
	put_padded(&builder, bytes, length);
	put_option(&builder, OPTION_FLAGS, flags, sizeof(flags));
	if (comment > 0)
		put_option(&builder, OPTION_COMMENT, frame->comment,
		           comment < COMMENT_MAX ? comment : COMMENT_MAX);
	if (frame->missed > 0) {
		put(&builder, OPTION_DROPPED, 2);
		put(&builder, 8, 2);
		put(&builder, frame->missed, 8);
	}
	put_option(&builder, OPTION_END, "", 0);
	return write_block(&builder, file);
}
