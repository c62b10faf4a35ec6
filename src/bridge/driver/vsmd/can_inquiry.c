/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/vsmd_private.h"

#include "driver/vsmd/can_frames.h"

#include <string.h>

/* How long a drive may write its flash before it answers. */
#define SAVE_TIME (1000 * DB_NS_PER_MS)

/* The read of an inquiry; for those that change something, the read after that. No report resembles
 * the answer to whether a drive is there; a drive without identity is recognised by its data. */
static struct vsmd_can_command read_of(const struct db_inquiry *inquiry)
{
	struct vsmd_can_command read = { .code = VSMD_CAN_READ_STATUS, .count = 1 };

	switch (inquiry->kind) {
	case DB_INQUIRY_THERE:
		if (inquiry->value % 2 == 0) {
			read.first = VSMD_CAN_IDENTITY;
			break;
		}
		read.code = VSMD_CAN_READ_DATA;
		read.first = VSMD_CAN_DATA_FIRST;
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

/* The new value of a parameter, as its register has it; false: it cannot be expressed. */
static bool put_setting(const struct db_inquiry *inquiry, uint32_t *raw)
{
	enum vsmd_param param = inquiry->kind == DB_INQUIRY_SET_ADDRESS ? VSMD_CID : VSMD_BDR;

	*raw = 0;
	return vsmd_can_insert(param, (union db_value){ .u = inquiry->value }, raw) == VSMD_OK;
}

bool vsmd_can_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                      struct db_exchange *exchange)
{
	const struct vsmd_can_style style = vsmd_can_style_of(bus);
	const struct vsmd_can_command save = { .code = VSMD_CAN_SAV };
	struct vsmd_can_command read = read_of(inquiry);
	struct db_can_frame frame;
	uint32_t raw;
	bool parts;
	unsigned most;
	struct vsmd_can_command part = read;

	if (inquiry->address < 1 ||
	    inquiry->address > (style.extended ? VSMD_CAN_DRIVE_MAX : VSMD_CAN_STD_DRIVE_MAX))
		return false;
	vsmd_can_start_burst(exchange, true);
	/* What sets something is read after it. */
	if ((inquiry->kind == DB_INQUIRY_SET_ADDRESS || inquiry->kind == DB_INQUIRY_SET_SPEED) &&
	    (!put_setting(inquiry, &raw) ||
	     vsmd_can_encode_write(&style, inquiry->address, read.first, &raw, 1, &frame) !=
	             VSMD_OK ||
	     !vsmd_can_add_frame(exchange, &frame)))
		return false;
	if (inquiry->kind == DB_INQUIRY_SAVE) {
		exchange->extra_time = SAVE_TIME;
		if (!vsmd_can_add_command(&style, inquiry->address, &save, exchange))
			return false;
	}
	/* Some drives answer no long read: the identity is read in parts if it was not answered. */
	parts = inquiry->kind == DB_INQUIRY_IDENTITY && inquiry->value % 2 == 1;
	most = parts ? VSMD_CAN_FRAME_REGS : read.count;
	for (unsigned at = 0; at < read.count; at += most) {
		part.first = (uint8_t)(read.first + at);
		part.count = (uint8_t)(read.count - at < most ? read.count - at : most);
		if (!vsmd_can_add_command(&style, inquiry->address, &part, exchange))
			return false;
	}
	exchange->answer_length = vsmd_can_answer_length(read.count);
	return true;
}

/* The values of a complete answer. */
static void take_values(const struct db_inquiry *inquiry, struct db_inquired *found)
{
	uint32_t raw;

	switch (inquiry->kind) {
	case DB_INQUIRY_IDENTITY:
		if (vsmd_can_get_identity(found->values, found->identity) < 0)
			found->identity[0] = '\0';
		break;
	case DB_INQUIRY_SET_ADDRESS:
	case DB_INQUIRY_SET_SPEED:
		found->refused = put_setting(inquiry, &raw) && found->values[0] != raw;
		break;
	case DB_INQUIRY_SAVE:
		found->refused = (found->values[0] & (VSMD_ST_CMD_WRG | VSMD_ST_FLASH_ERR)) != 0;
		break;
	case DB_INQUIRY_STANDING:
		found->tells_standing = true;
		found->stands = (found->values[0] & VSMD_ST_STP) != 0;
		break;
	case DB_INQUIRY_THERE:
	default:
		break;
	}
}

/* In any form that drives use. */
enum db_recognised vsmd_can_recognise(const struct db_bus_config *bus,
                                      const struct db_inquiry *inquiry, const uint8_t *bytes,
                                      size_t length, struct db_inquired *found)
{
	const struct vsmd_can_style style = vsmd_can_style_of(bus);
	struct vsmd_can_command read = read_of(inquiry);
	struct vsmd_can_message message;
	struct vsmd_can_answer answer;
	struct db_can_frame frame;
	enum vsmd_can_took took;

	if (length != sizeof(frame))
		return DB_RECOGNISED_NOTHING;
	memcpy(&frame, bytes, sizeof(frame));
	if (vsmd_can_decode(&style, &frame, &message) != VSMD_OK ||
	    vsmd_can_expect(&answer, &style, inquiry->address,
	                    read.code == VSMD_CAN_READ_STATUS ? VSMD_CAN_STATUS_REPLY :
	                                                        VSMD_CAN_DATA_REPLY,
	                    read.first, read.count) != VSMD_OK)
		return DB_RECOGNISED_NOTHING;
	answer.forms = VSMD_CAN_PADDED | VSMD_CAN_SINGLES;
	answer.seen = found->parts;
	memcpy(answer.values, found->values, read.count * sizeof(found->values[0]));
	took = vsmd_can_take(&answer, &message);
	found->parts = (uint32_t)answer.seen;
	memcpy(found->values, answer.values, read.count * sizeof(found->values[0]));
	switch (took) {
	case VSMD_CAN_REPEATED:
		return DB_RECOGNISED_AGAIN;
	case VSMD_CAN_PART:
		return DB_RECOGNISED_PART;
	case VSMD_CAN_WHOLE:
		take_values(inquiry, found);
		return DB_RECOGNISED_ANSWER;
	case VSMD_CAN_FOREIGN:
	default:
		return DB_RECOGNISED_NOTHING;
	}
}
