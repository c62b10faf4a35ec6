/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_describe.h"

#include "codec/vsmd_serial_frames.h"

#include <ctype.h>
#include <string.h>

/* --- on serial lines -------------------------------------------------------------------------- */

/* Commands without an argument. */
static const char *const phrases[VSMD_VERB_COUNT] = {
	[VSMD_DEV] = "identity?",
	[VSMD_STS] = "status?",
	[VSMD_ENA] = "enable",
	[VSMD_OFF] = "disable",
	[VSMD_ECLR] = "clear the encoder error",
	[VSMD_ZERO_START] = "start homing",
	[VSMD_ZERO_STOP] = "stop homing",
	[VSMD_SHAKE_STOP] = "stop to and fro",
	[VSMD_CFG_READ] = "parameters?",
	[VSMD_SAV] = "save parameters",
};

static void describe_line(struct db_description *description, const struct vsmd_command *command)
{
	switch (command->verb) {
	case VSMD_MOV:
		db_description_add(description, "turn");
		break;
	case VSMD_POS:
		db_description_add(description, "move to %ld pulses", (long)command->position);
		break;
	case VSMD_RMV:
		db_description_add(description, "move by %ld pulses", (long)command->position);
		break;
	case VSMD_STP:
		db_description_add(description, "stop%s",
		                   command->has_value && command->value == 1 ? " at once" : "");
		break;
	case VSMD_ORG:
		db_description_add(description, "the position is %ld pulses",
		                   command->has_value ? (long)command->position : 0L);
		break;
	case VSMD_SENSOR_OUT:
		db_description_add(description, "output s%u %s", command->port,
		                   command->value ? "on" : "off");
		break;
	case VSMD_SV:
	case VSMD_NMOS:
		db_description_add(description, "output %s%u to %u",
		                   command->verb == VSMD_SV ? "sv" : "nmos", command->port,
		                   command->value);
		break;
	case VSMD_SHAKE_CYCLES:
	case VSMD_SHAKE_TIME:
		db_description_add(description, "to and fro from %ld to %ld pulses at ",
		                   (long)command->shake_start, (long)command->shake_end);
		db_description_add_float(description, command->shake_frequency, "Hz");
		if (command->shake_count > 0)
			db_description_add(description, ", %lu %s",
			                   (unsigned long)command->shake_count,
			                   command->verb == VSMD_SHAKE_TIME ? "s" : "times");
		break;
	case VSMD_CFG_WRITE:
		db_description_add(description, "set ");
		for (size_t i = 0; i < command->setting_count; i++) {
			if (i > 0)
				db_description_add(description, ", ");
			db_description_add_param(description,
			                         &vsmd_params[command->settings[i].param],
			                         command->settings[i].value);
		}
		break;
	default:
		db_description_add(description, "%s", phrases[command->verb]);
		break;
	}
	if (command->has_velocity) {
		db_description_add(description, " at ");
		db_description_add_float(description, command->velocity, "pulses/s");
	}
}

void vsmd_serial_describe_line(const uint8_t *line, size_t length, bool rs485,
                               struct db_description *description)
{
	struct vsmd_setting settings[VSMD_PARAM_COUNT];
	struct vsmd_command command;

	db_description_begin(description);
	while (length > 0 && line[0] == '\n') {
		line++;
		length--;
	}
	while (length > 0 && (line[length - 1] == '\n' || line[length - 1] == '\r'))
		length--;
	if (length == 0 || vsmd_serial_decode_command((const char *)line, length, rs485, &command,
	                                              settings, VSMD_PARAM_COUNT) != VSMD_OK)
		return;
	if (command.id != VSMD_SERIAL_NO_ID)
		description->address = command.id; /* for a broadcast this is DB_DESCRIBED_ALL */
	describe_line(description, &command);
}

void vsmd_serial_describe_reply(const uint8_t *frame, size_t length,
                                struct db_description *description)
{
	struct vsmd_setting setting;
	struct vsmd_reply reply;
	const char *gap = "";
	size_t cursor = 0;
	int found;

	db_description_begin(description);
	if (vsmd_serial_decode_reply(frame, length, &reply) != VSMD_OK)
		return;
	description->address = reply.id == 0 ? DB_DESCRIBED_NOBODY : reply.id;
	switch (reply.code) {
	case VSMD_REPLY_IDENTITY:
		db_description_add(description, "identity \"%.*s\"", (int)reply.text_length,
		                   reply.text);
		break;
	case VSMD_REPLY_PARAMS:
		while ((found = vsmd_serial_next_param(reply.text, reply.text_length, &cursor,
		                                       &setting)) != 0) {
			if (found != 1)
				continue;
			db_description_add(description, "%s", gap);
			db_description_add_param(description, &vsmd_params[setting.param],
			                         setting.value);
			gap = ", ";
		}
		break;
	case VSMD_REPLY_STATUS:
	default:
		db_description_add(description, "position %ld pulses, velocity ",
		                   (long)reply.status.position);
		db_description_add_float(description, reply.status.velocity, "pulses/s");
		db_description_add(description, ", status ");
		db_description_add_bits(description, vsmd_status_bits, VSMD_STATUS_BITS,
		                        reply.status.status);
		break;
	}
}

/* --- on CAN ----------------------------------------------------------------------------------- */

/* --- commands --------------------------------------------------------------------------------- */

static void describe_shake(struct db_description *description,
                           const struct vsmd_can_command *command)
{
	switch (command->shake) {
	case VSMD_CAN_SHAKE_STOP:
		db_description_add(description, "stop to and fro");
		break;
	case VSMD_CAN_SHAKE_CYCLES:
	case VSMD_CAN_SHAKE_TIME:
		db_description_add(description, "start to and fro");
		if (command->shake_count > 0)
			db_description_add(description, ", %lu %s",
			                   (unsigned long)command->shake_count,
			                   command->shake == VSMD_CAN_SHAKE_TIME ? "s" : "times");
		break;
	case VSMD_CAN_SHAKE_START_AT:
	case VSMD_CAN_SHAKE_END_AT:
		db_description_add(description, "to and fro %s %ld pulses",
		                   command->shake == VSMD_CAN_SHAKE_START_AT ? "from" : "to",
		                   (long)command->position);
		break;
	case VSMD_CAN_SHAKE_FREQUENCY:
	default:
		db_description_add(description, "to and fro at ");
		db_description_add_float(description, command->shake_frequency, "Hz");
		break;
	}
}

static void describe_report(struct db_description *description,
                            const struct vsmd_can_command *command)
{
	static const char *const what[] = {
		[VSMD_CAN_REPORT_NONE] = "nothing",
		[VSMD_CAN_REPORT_ALL] = "velocity, position and status",
		[VSMD_CAN_REPORT_POSITION_STATUS] = "position and status",
		[VSMD_CAN_REPORT_POSITION] = "the position",
	};

	db_description_add(description, "report %s", what[command->report]);
	if (command->has_interval)
		db_description_add(description, " every %u ms", command->interval);
}

static void describe_read(struct db_description *description,
                          const struct vsmd_can_command *command)
{
	unsigned last = (unsigned)command->first + command->count - 1;

	if (command->code == VSMD_CAN_READ_DATA)
		db_description_add(description, "parameters in registers %02X to %02X?",
		                   command->first, last);
	else if (command->first == VSMD_CAN_IDENTITY)
		db_description_add(description, "identity?");
	else if (last < VSMD_CAN_STATUS_REGS)
		db_description_add(
			description, "%s?",
			command->first == VSMD_CAN_STATUS_SPEED ? "velocity, position and status" :
			command->first == VSMD_CAN_STATUS_POSITION ? "position and status" :
								     "status");
	else
		db_description_add(description, "status registers %02X to %02X?", command->first,
		                   last);
}

static void describe_can_command(struct db_description *description,
                                 const struct vsmd_can_command *command)
{
	switch (command->code) {
	case VSMD_CAN_ENA:
		db_description_add(description, "enable");
		break;
	case VSMD_CAN_OFF:
		db_description_add(description, "disable");
		break;
	case VSMD_CAN_ORG:
		db_description_add(description, "the position is %ld pulses",
		                   command->has_position ? (long)command->position : 0L);
		break;
	case VSMD_CAN_STP:
		db_description_add(description, "stop%s", command->value == 1 ? " at once" : "");
		break;
	case VSMD_CAN_MOV:
		db_description_add(description, "turn");
		break;
	case VSMD_CAN_POS:
	case VSMD_CAN_RMV:
		db_description_add(description, "move %s %ld pulses",
		                   command->code == VSMD_CAN_POS ? "to" : "by",
		                   (long)command->position);
		break;
	case VSMD_CAN_SAV:
		db_description_add(description, "save parameters");
		break;
	case VSMD_CAN_OUTPUT:
		db_description_add(description, "output s%u %s", command->port,
		                   command->value ? "on" : "off");
		break;
	case VSMD_CAN_ZERO_START:
	case VSMD_CAN_ZERO_STOP:
		db_description_add(description, "%s homing",
		                   command->code == VSMD_CAN_ZERO_START ? "start" : "stop");
		break;
	case VSMD_CAN_SV:
	case VSMD_CAN_NMOS:
		db_description_add(description, "output %s%u to %u",
		                   command->code == VSMD_CAN_SV ? "sv" : "nmos", command->port,
		                   command->value);
		break;
	case VSMD_CAN_AUTO_RES_STS:
		describe_report(description, command);
		break;
	case VSMD_CAN_SHAKE:
		describe_shake(description, command);
		break;
	case VSMD_CAN_ENCODER:
		db_description_add(description, "clear the encoder error");
		break;
	case VSMD_CAN_READ_STATUS:
	case VSMD_CAN_READ_DATA:
	default:
		describe_read(description, command);
		break;
	}
	if (command->has_velocity) {
		db_description_add(description, " at ");
		db_description_add_float(description, command->velocity, "pulses/s");
	}
}

/* --- registers -------------------------------------------------------------------------------- */

static void describe_status_register(struct db_description *description, unsigned reg,
                                     uint32_t value)
{
	float velocity;

	switch (reg) {
	case VSMD_CAN_STATUS_SPEED:
		memcpy(&velocity, &value, sizeof(velocity));
		db_description_add(description, "velocity ");
		db_description_add_float(description, velocity, "pulses/s");
		return;
	case VSMD_CAN_STATUS_POSITION:
		db_description_add(description, "position %ld pulses", (long)(int32_t)value);
		return;
	case VSMD_CAN_STATUS_WORD:
		db_description_add(description, "status ");
		db_description_add_bits(description, vsmd_status_bits, VSMD_STATUS_BITS, value);
		return;
	default:
		break;
	}
	if (reg >= VSMD_CAN_IDENTITY && reg < VSMD_CAN_IDENTITY + VSMD_CAN_IDENTITY_REGS) {
		db_description_add(description, "identity, a part: \"");
		for (int shift = 24; shift >= 0; shift -= 8) {
			int character = (int)(value >> shift & 0xFF);

			db_description_add(description, "%c", isprint(character) ? character : ' ');
		}
		db_description_add(description, "\"");
	} else {
		db_description_add(description, "status register %02X is %08lX", reg,
		                   (unsigned long)value);
	}
}

static void describe_data_register(struct db_description *description, unsigned reg, uint32_t raw)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
	size_t count = vsmd_can_params_of(reg, params);
	union db_value value;

	if (count == 0)
		db_description_add(description, "register %02X is %08lX", reg, (unsigned long)raw);
	for (size_t i = 0; i < count; i++) {
		db_description_add(description, "%s", i > 0 ? ", " : "");
		if (vsmd_can_extract(params[i], raw, &value) == VSMD_OK)
			db_description_add_param(description, &vsmd_can_params[params[i]], value);
		else
			db_description_add(description, "%s %08lX", vsmd_can_params[params[i]].name,
			                   (unsigned long)raw);
	}
}

void vsmd_can_describe(const struct vsmd_can_style *style, const struct db_can_frame *frame,
                       struct db_description *description)
{
	struct vsmd_can_message message;
	bool from_drive;

	db_description_begin(description);
	if (vsmd_can_decode(style, frame, &message) != VSMD_OK)
		return;
	from_drive = message.id.control == VSMD_CAN_STATUS_REPLY ||
	             message.id.control == VSMD_CAN_DATA_REPLY;
	description->address = from_drive           ? message.id.source :
	                       message.id.broadcast ? DB_DESCRIBED_ALL :
	                                              message.id.target;
	if (message.id.control == VSMD_CAN_COMMAND) {
		describe_can_command(description, &message.command);
		return;
	}
	if (message.id.control == VSMD_CAN_DATA_WRITE)
		db_description_add(description, "set ");
	for (unsigned i = 0; i < message.count; i++) {
		db_description_add(description, "%s", i > 0 ? ", " : "");
		if (message.id.control == VSMD_CAN_STATUS_REPLY)
			describe_status_register(description, message.id.reg + i,
			                         message.values[i]);
		else
			describe_data_register(description, message.id.reg + i, message.values[i]);
	}
}
