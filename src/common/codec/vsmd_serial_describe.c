/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_serial_describe.h"

#include "codec/vsmd_describe.h"
#include "codec/vsmd_serial_frames.h"

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

static void describe_command(struct db_description *description, const struct vsmd_command *command)
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
	describe_command(description, &command);
}

static void describe_params(struct db_description *description, const char *text, size_t length)
{
	struct vsmd_setting setting;
	const char *gap = "";
	size_t cursor = 0;
	int found;

	while ((found = vsmd_serial_next_param(text, length, &cursor, &setting)) != 0) {
		if (found != 1)
			continue;
		db_description_add(description, "%s", gap);
		db_description_add_param(description, &vsmd_params[setting.param], setting.value);
		gap = ", ";
	}
}

void vsmd_serial_describe_reply(const uint8_t *frame, size_t length,
                                struct db_description *description)
{
	struct vsmd_reply reply;

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
		describe_params(description, reply.text, reply.text_length);
		break;
	case VSMD_REPLY_STATUS:
	default:
		vsmd_describe_position(description, reply.status.position);
		db_description_add(description, ", ");
		vsmd_describe_velocity(description, reply.status.velocity);
		db_description_add(description, ", ");
		vsmd_describe_status(description, reply.status.status);
		break;
	}
}
