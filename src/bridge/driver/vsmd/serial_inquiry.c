/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/vsmd_private.h"

#include "codec/vsmd_serial_frames.h"

#include <string.h>

/* How long a drive may write its flash before it answers. */
#define SAVE_TIME (1000 * DB_NS_PER_MS)

bool vsmd_serial_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                         struct db_exchange *exchange)
{
	struct vsmd_command command = { .id = (int)inquiry->address };
	struct vsmd_setting setting = { .value.u = inquiry->value };
	int length;

	if (bus->line == DB_LINE_RS232)
		command.id = VSMD_SERIAL_NO_ID;
	else if (inquiry->address < 1 || inquiry->address > VSMD_SERIAL_ID_MAX)
		return false;
	exchange->answer_length = VSMD_SERIAL_STATUS_FRAME;
	exchange->extra_time = 0;
	switch (inquiry->kind) {
	case DB_INQUIRY_THERE:
	case DB_INQUIRY_STANDING:
		command.verb = VSMD_STS;
		break;
	case DB_INQUIRY_IDENTITY:
		command.verb = VSMD_DEV;
		exchange->answer_length = VSMD_IDENTITY_FRAME;
		break;
	case DB_INQUIRY_SAVE:
		command.verb = VSMD_SAV;
		exchange->answer_length = VSMD_PARAMS_FRAME;
		exchange->extra_time = SAVE_TIME;
		break;
	case DB_INQUIRY_SET_ADDRESS:
	case DB_INQUIRY_SET_SPEED:
	default:
		command.verb = VSMD_CFG_WRITE;
		setting.param = inquiry->kind == DB_INQUIRY_SET_ADDRESS ? VSMD_CID : VSMD_BDR;
		command.settings = &setting;
		command.setting_count = 1;
		break;
	}
	/* A bare line end first: it separates this line from what the drive received at another
	 * speed. */
	exchange->request[0] = '\n';
	length = vsmd_serial_encode_command(&command, (char *)exchange->request + 1,
	                                    exchange->request_size - 1);
	if (length < 0)
		return false;
	exchange->request_length = (size_t)length + 1;
	return true;
}

static void take_identity(const struct vsmd_reply *reply, struct db_inquired *found)
{
	size_t length = reply->text_length; /* without blanks at its end */
	const char *text = vsmd_bare_identity(reply->text, &length);

	if (length > DB_IDENTITY_MAX)
		length = DB_IDENTITY_MAX;
	memcpy(found->identity, text, length);
	found->identity[length] = '\0';
}

enum db_recognised vsmd_serial_recognise(const struct db_bus_config *bus,
                                         const struct db_inquiry *inquiry, const uint8_t *frame,
                                         size_t length, struct db_inquired *found)
{
	struct vsmd_reply reply;

	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return DB_RECOGNISED_NOTHING;
	/* A drive that accepts its new address at once may already answer with it. */
	if (bus->line == DB_LINE_RS485 && reply.id != inquiry->address &&
	    !(inquiry->kind == DB_INQUIRY_SET_ADDRESS && reply.id == inquiry->value))
		return DB_RECOGNISED_NOTHING;
	switch (reply.code) {
	case VSMD_REPLY_IDENTITY:
		if (inquiry->kind != DB_INQUIRY_IDENTITY)
			return DB_RECOGNISED_NOTHING;
		take_identity(&reply, found);
		break;
	case VSMD_REPLY_PARAMS:
		if (inquiry->kind != DB_INQUIRY_SAVE)
			return DB_RECOGNISED_NOTHING;
		break;
	case VSMD_REPLY_STATUS:
	default:
		if (inquiry->kind == DB_INQUIRY_IDENTITY)
			return DB_RECOGNISED_NOTHING;
		found->tells_standing = true;
		found->stands = (reply.status.status & VSMD_ST_STP) != 0;
		/* A save that worked is answered with the parameters. */
		found->refused = inquiry->kind == DB_INQUIRY_SAVE ||
		                 (inquiry->kind >= DB_INQUIRY_SET_ADDRESS &&
		                  (reply.status.status & VSMD_ST_CMD_WRG));
		break;
	}
	if (found->parts > 0)
		return DB_RECOGNISED_AGAIN;
	found->parts = 1;
	return DB_RECOGNISED_ANSWER;
}
