/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/can_inquiry.h"

#include "driver/vsmd/can_frames.h"

#include <string.h>

/* How long a drive may write its flash before it answers. */
#define SAVE_TIME (1000 * DB_NS_PER_MS)

/* What is read by an inquiry; by those that change something, behind that. */
static struct vsmd_can_command read_of(const struct db_inquiry *inquiry)
{
	struct vsmd_can_command read = { .code = VSMD_CAN_READ_STATUS, .count = 1 };

	switch (inquiry->kind) {
	case DB_INQUIRY_THERE: /* not what a cycle reads */
		read.first = VSMD_CAN_IDENTITY;
		break;
	case DB_INQUIRY_IDENTITY:
		read.first = VSMD_CAN_IDENTITY;
		read.count = VSMD_CAN_IDENTITY_REGS;
		break;
	case DB_INQUIRY_SET_ADDRESS:
	case DB_INQUIRY_SET_SPEED:
		read.code = VSMD_CAN_READ_DATA;
		read.first = vsmd_can_fields[inquiry->kind == DB_INQUIRY_SET_ADDRESS ? VSMD_CID :
		                                                                       VSMD_BDR]
		                     .reg;
		break;
	case DB_INQUIRY_STANDING:
	case DB_INQUIRY_SAVE:
	default:
		read.first = VSMD_CAN_STATUS_WORD;
		break;
	}
	return read;
}

/* What a parameter is to hold, as its register has it; false: it cannot be said. */
static bool put_setting(const struct db_inquiry *inquiry, uint32_t *raw)
{
	enum vsmd_param param = inquiry->kind == DB_INQUIRY_SET_ADDRESS ? VSMD_CID : VSMD_BDR;

	*raw = 0;
	return vsmd_can_insert(param, (union db_value){ .u = inquiry->value }, raw) == VSMD_OK;
}

bool vsmd_can_inquire(const struct vsmd_can_style *style, const struct db_inquiry *inquiry,
                      struct db_exchange *exchange)
{
	const struct vsmd_can_command save = { .code = VSMD_CAN_SAV };
	struct vsmd_can_command read = read_of(inquiry);
	struct db_can_frame frame;
	uint32_t raw;

	if (inquiry->address < 1 ||
	    inquiry->address > (style->extended ? VSMD_CAN_DRIVE_MAX : VSMD_CAN_STD_DRIVE_MAX))
		return false;
	vsmd_can_start_burst(exchange, true);
	if (read.code == VSMD_CAN_READ_DATA &&
	    (!put_setting(inquiry, &raw) ||
	     vsmd_can_encode_write(style, inquiry->address, read.first, &raw, 1, &frame) !=
	             VSMD_OK ||
	     !vsmd_can_add_frame(exchange, &frame)))
		return false;
	if (inquiry->kind == DB_INQUIRY_SAVE) {
		exchange->extra_time = SAVE_TIME;
		if (!vsmd_can_add_command(style, inquiry->address, &save, exchange))
			return false;
	}
	exchange->answer_length = vsmd_can_answer_length(read.count);
	return vsmd_can_add_command(style, inquiry->address, &read, exchange);
}

/* The values of an answer that is whole. */
static void take_values(const struct db_inquiry *inquiry, struct db_inquired *said)
{
	uint32_t raw;

	switch (inquiry->kind) {
	case DB_INQUIRY_IDENTITY:
		if (vsmd_can_get_identity(said->values, said->identity) < 0)
			said->identity[0] = '\0';
		break;
	case DB_INQUIRY_SET_ADDRESS:
	case DB_INQUIRY_SET_SPEED:
		said->refused = put_setting(inquiry, &raw) && said->values[0] != raw;
		break;
	case DB_INQUIRY_SAVE:
		said->refused = (said->values[0] & (VSMD_ST_CMD_WRG | VSMD_ST_FLASH_ERR)) != 0;
		break;
	case DB_INQUIRY_STANDING:
		said->tells_standing = true;
		said->stands = (said->values[0] & VSMD_ST_STP) != 0;
		break;
	case DB_INQUIRY_THERE:
	default:
		break;
	}
}

enum db_recognised vsmd_can_recognise(const struct vsmd_can_style *style,
                                      const struct db_inquiry *inquiry, const uint8_t *bytes,
                                      size_t length, struct db_inquired *said)
{
	struct vsmd_can_command read = read_of(inquiry);
	struct vsmd_can_message message;
	struct db_can_frame frame;
	unsigned part;

	if (length != sizeof frame)
		return DB_RECOGNISED_NOTHING;
	memcpy(&frame, bytes, sizeof frame);
	if (vsmd_can_decode(style, &frame, &message) != VSMD_OK ||
	    message.id.source != inquiry->address ||
	    message.id.control != (read.code == VSMD_CAN_READ_STATUS ? VSMD_CAN_STATUS_REPLY :
	                                                               VSMD_CAN_DATA_REPLY) ||
	    message.id.reg < read.first || (message.id.reg - read.first) % VSMD_CAN_FRAME_REGS != 0)
		return DB_RECOGNISED_NOTHING;
	part = (unsigned)(message.id.reg - read.first) / VSMD_CAN_FRAME_REGS;
	if (message.id.reg + message.count > (unsigned)read.first + read.count ||
	    (message.count < VSMD_CAN_FRAME_REGS &&
	     message.id.reg + message.count < (unsigned)read.first + read.count))
		return DB_RECOGNISED_NOTHING;
	if (said->parts >> part & 1)
		return DB_RECOGNISED_AGAIN;
	said->parts |= 1u << part;
	for (unsigned i = 0; i < message.count; i++)
		said->values[part * VSMD_CAN_FRAME_REGS + i] = message.values[i];
	if (said->parts != (1u << (read.count + 1u) / VSMD_CAN_FRAME_REGS) - 1)
		return DB_RECOGNISED_PART;
	take_values(inquiry, said);
	return DB_RECOGNISED_ANSWER;
}
