/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/vsmd_can.h"

#include "codec/big_endian.h"

#include <string.h>

/* Extended ids: 0 | target (9) | broadcast (1) | source (9) | control (2) | register (7). */
#define EXT_FIXED 0x10000000u
#define EXT_TARGET 19
#define EXT_BROADCAST 0x00040000u
#define EXT_SOURCE 9
#define EXT_CONTROL 7

/* Standard ids: target (4) | control (2) | register (5). */
#define STD_TARGET 7
#define STD_CONTROL 5

#define CONTROL_MASK 3u
#define CONTROL_HOST 2u /* the control bit that means: from the host */

#define REG_BYTES 4
#define SENSOR_PORTS 6
#define OUTPUT_PORTS 3

/* --- ids -------------------------------------------------------------------------------------- */

static unsigned reg_max(bool extended)
{
	return extended ? VSMD_CAN_REG_MAX : VSMD_CAN_STD_REG_MAX;
}

static bool is_reply(enum vsmd_can_control control)
{
	return control == VSMD_CAN_STATUS_REPLY || control == VSMD_CAN_DATA_REPLY;
}

static bool is_drive(unsigned drive, bool extended)
{
	return drive >= 1 && drive <= (extended ? VSMD_CAN_DRIVE_MAX : VSMD_CAN_STD_DRIVE_MAX);
}

/* True if sender and receiver are possible for this control. */
static bool sides_possible(const struct vsmd_can_id *id)
{
	unsigned host;

	if (is_reply(id->control)) {
		host = id->target;
		if (id->broadcast || !is_drive(id->source, id->extended))
			return false;
	} else {
		host = id->source;
		if (id->broadcast ? id->target != 0 : !is_drive(id->target, id->extended))
			return false;
	}
	return host <= (id->extended ? VSMD_CAN_SOURCE_MAX : 0);
}

enum vsmd_error vsmd_can_pack_id(const struct vsmd_can_id *id, uint32_t *packed)
{
	uint32_t control = (uint32_t)id->control;

	if (control > CONTROL_MASK || id->reg > reg_max(id->extended) || !sides_possible(id))
		return VSMD_ERR_RANGE;
	if (id->extended) {
		*packed = DB_CAN_EXTENDED | (uint32_t)id->target << EXT_TARGET |
		          (id->broadcast ? EXT_BROADCAST : 0) | (uint32_t)id->source << EXT_SOURCE |
		          control << EXT_CONTROL | id->reg;
	} else {
		uint32_t drive = is_reply(id->control) ? id->source : id->target;

		*packed = drive << STD_TARGET | control << STD_CONTROL | id->reg;
	}
	return VSMD_OK;
}

static void unpack_extended(uint32_t packed, struct vsmd_can_id *id)
{
	id->extended = true;
	id->broadcast = packed & EXT_BROADCAST;
	id->control = (enum vsmd_can_control)(packed >> EXT_CONTROL & CONTROL_MASK);
	if (!id->broadcast)
		id->target = packed >> EXT_TARGET & VSMD_CAN_SOURCE_MAX;
	id->source = packed >> EXT_SOURCE & VSMD_CAN_SOURCE_MAX;
	id->reg = packed & VSMD_CAN_REG_MAX;
}

static void unpack_standard(uint32_t packed, struct vsmd_can_id *id)
{
	uint16_t drive = packed >> STD_TARGET & VSMD_CAN_STD_DRIVE_MAX;

	id->control = (enum vsmd_can_control)(packed >> STD_CONTROL & CONTROL_MASK);
	if (is_reply(id->control)) {
		id->source = drive;
	} else {
		id->target = drive;
		id->broadcast = drive == VSMD_CAN_BROADCAST;
	}
	id->reg = packed & VSMD_CAN_STD_REG_MAX;
}

enum vsmd_error vsmd_can_unpack_id(uint32_t packed, struct vsmd_can_id *id)
{
	struct vsmd_can_id unpacked = { 0 };

	if (packed & (DB_CAN_REMOTE | DB_CAN_ERROR))
		return VSMD_ERR_SYNTAX;
	if (packed & DB_CAN_EXTENDED) {
		if (packed & EXT_FIXED)
			return VSMD_ERR_SYNTAX;
		unpack_extended(packed, &unpacked);
	} else {
		if (packed & ~DB_CAN_STANDARD_MASK)
			return VSMD_ERR_SYNTAX;
		unpack_standard(packed, &unpacked);
	}
	if (!sides_possible(&unpacked))
		return VSMD_ERR_SYNTAX;
	*id = unpacked;
	return VSMD_OK;
}

/* The id of a frame from this host to a drive or to all. */
static struct vsmd_can_id request_id(const struct vsmd_can_style *style, unsigned drive,
                                     enum vsmd_can_control control, unsigned reg)
{
	return (struct vsmd_can_id){
		.extended = style->extended,
		.broadcast = drive == VSMD_CAN_BROADCAST,
		.control = control,
		/* A number that is too large stays too large. */
		.target = (uint16_t)(drive > UINT16_MAX ? UINT16_MAX : drive),
		.source = style->extended ? style->host : 0,
		.reg = (uint8_t)(reg > UINT8_MAX ? UINT8_MAX : reg),
	};
}

/* The id of a drive's answer to this host. */
static struct vsmd_can_id reply_id(const struct vsmd_can_style *style, unsigned drive,
                                   enum vsmd_can_control control, unsigned reg)
{
	struct vsmd_can_id id = request_id(style, drive, control, reg);
	uint16_t host = id.source;

	id.broadcast = false;
	id.source = id.target;
	id.target = host;
	return id;
}

struct db_can_filter vsmd_can_answer_filter(const struct vsmd_can_style *style)
{
	uint32_t kind = DB_CAN_EXTENDED | DB_CAN_REMOTE;

	if (!style->extended)
		return (struct db_can_filter){ 0, kind | CONTROL_HOST << STD_CONTROL };
	return (struct db_can_filter){
		.id = DB_CAN_EXTENDED | (uint32_t)style->host << EXT_TARGET,
		.mask = kind | EXT_FIXED | (uint32_t)VSMD_CAN_SOURCE_MAX << EXT_TARGET |
		        EXT_BROADCAST | CONTROL_HOST << EXT_CONTROL,
	};
}

size_t vsmd_can_any_answer_filters(struct db_can_filter filters[VSMD_CAN_FILTERS])
{
	uint32_t kind = DB_CAN_EXTENDED | DB_CAN_REMOTE;

	filters[0] = (struct db_can_filter){
		.id = DB_CAN_EXTENDED,
		.mask = kind | EXT_FIXED | CONTROL_HOST << EXT_CONTROL,
	};
	filters[1] = (struct db_can_filter){ 0, kind | CONTROL_HOST << STD_CONTROL };
	return VSMD_CAN_FILTERS;
}

/* --- commands --------------------------------------------------------------------------------- */

/* Possible data lengths of a command: without the optional part, and with it. */
struct shape {
	bool known;
	uint8_t least;
	uint8_t most;
};

#define SHAPES 0x20

static const struct shape shapes[SHAPES] = {
	[VSMD_CAN_ENA] = { true, 0, 0 },        [VSMD_CAN_OFF] = { true, 0, 0 },
	[VSMD_CAN_ORG] = { true, 0, 4 },        [VSMD_CAN_STP] = { true, 1, 1 },
	[VSMD_CAN_MOV] = { true, 0, 4 },        [VSMD_CAN_POS] = { true, 4, 8 },
	[VSMD_CAN_SAV] = { true, 0, 0 },        [VSMD_CAN_OUTPUT] = { true, 2, 2 },
	[VSMD_CAN_ZERO_START] = { true, 0, 0 }, [VSMD_CAN_ZERO_STOP] = { true, 0, 0 },
	[VSMD_CAN_RMV] = { true, 4, 8 },        [VSMD_CAN_SV] = { true, 2, 2 },
	[VSMD_CAN_NMOS] = { true, 2, 2 },       [VSMD_CAN_AUTO_RES_STS] = { true, 1, 3 },
	[VSMD_CAN_SHAKE] = { true, 1, 5 }, /* 1 to stop, 5 for all else */
	[VSMD_CAN_ENCODER] = { true, 1, 1 },    [VSMD_CAN_READ_STATUS] = { true, 2, 2 },
	[VSMD_CAN_READ_DATA] = { true, 2, 2 },
};

/* True for a known code. No read is sent to all drives: they would answer at the same time. */
static bool code_possible(unsigned code, bool broadcast)
{
	return code < SHAPES && shapes[code].known &&
	       !(broadcast && (code == VSMD_CAN_READ_STATUS || code == VSMD_CAN_READ_DATA));
}

static bool shake_possible(const struct vsmd_can_command *command)
{
	switch (command->shake) {
	case VSMD_CAN_SHAKE_STOP:
	case VSMD_CAN_SHAKE_START_AT:
	case VSMD_CAN_SHAKE_END_AT:
		return true;
	case VSMD_CAN_SHAKE_CYCLES:
	case VSMD_CAN_SHAKE_TIME:
		return command->shake_count <= INT32_MAX;
	case VSMD_CAN_SHAKE_FREQUENCY:
		return command->shake_frequency >= VSMD_SHAKE_FREQ_MIN_CAN &&
		       command->shake_frequency <= VSMD_SHAKE_FREQ_MAX;
	}
	return false;
}

static bool port_possible(const struct vsmd_can_command *command, unsigned ports)
{
	return command->port >= 1 && command->port <= ports;
}

static bool window_possible(unsigned first, unsigned count, bool extended)
{
	return count >= 1 && count <= VSMD_CAN_READ_MAX && first <= reg_max(extended) &&
	       count - 1 <= reg_max(extended) - first;
}

/* True if all arguments of a known command are in their ranges. */
static bool command_possible(const struct vsmd_can_command *command, bool extended)
{
	switch (command->code) {
	case VSMD_CAN_STP:
		return command->value <= 1;
	case VSMD_CAN_MOV:
	case VSMD_CAN_POS:
	case VSMD_CAN_RMV:
		return !command->has_velocity || (command->velocity >= -VSMD_SPEED_MAX &&
		                                  command->velocity <= VSMD_SPEED_MAX);
	case VSMD_CAN_OUTPUT:
		return port_possible(command, SENSOR_PORTS) && command->value <= 1;
	case VSMD_CAN_SV:
	case VSMD_CAN_NMOS:
		return port_possible(command, OUTPUT_PORTS);
	case VSMD_CAN_AUTO_RES_STS:
		return (unsigned)command->report <= VSMD_CAN_REPORT_POSITION;
	case VSMD_CAN_SHAKE:
		return shake_possible(command);
	case VSMD_CAN_READ_STATUS:
	case VSMD_CAN_READ_DATA:
		return window_possible(command->first, command->count, extended);
	default:
		return true;
	}
}

static uint8_t put_shake(const struct vsmd_can_command *command, uint8_t *data)
{
	data[0] = (uint8_t)command->shake;
	switch (command->shake) {
	case VSMD_CAN_SHAKE_STOP:
		return 1;
	case VSMD_CAN_SHAKE_CYCLES:
	case VSMD_CAN_SHAKE_TIME:
		put_be32(command->shake_count, data + 1);
		break;
	case VSMD_CAN_SHAKE_START_AT:
	case VSMD_CAN_SHAKE_END_AT:
		put_be32(bits_of_int(command->position), data + 1);
		break;
	case VSMD_CAN_SHAKE_FREQUENCY:
		put_be32(bits_of_float(command->shake_frequency), data + 1);
		break;
	}
	return 5;
}

static uint8_t put_pair(unsigned first, unsigned second, uint8_t *data)
{
	data[0] = (uint8_t)first;
	data[1] = (uint8_t)second;
	return 2;
}

/* The data of a possible command; returns its length. */
static uint8_t put_arguments(const struct vsmd_can_command *command, uint8_t output_base,
                             uint8_t *data)
{
	switch (command->code) {
	case VSMD_CAN_ORG:
		if (!command->has_position)
			return 0;
		put_be32(bits_of_int(command->position), data);
		return 4;
	case VSMD_CAN_STP:
		data[0] = command->value;
		return 1;
	case VSMD_CAN_MOV:
		if (!command->has_velocity)
			return 0;
		put_be32(bits_of_float(command->velocity), data);
		return 4;
	case VSMD_CAN_POS:
	case VSMD_CAN_RMV:
		put_be32(bits_of_int(command->position), data);
		if (!command->has_velocity)
			return 4;
		put_be32(bits_of_float(command->velocity), data + 4);
		return 8;
	case VSMD_CAN_OUTPUT:
		return put_pair(command->port - 1u + output_base, command->value, data);
	case VSMD_CAN_SV:
	case VSMD_CAN_NMOS:
		return put_pair(command->port - 1u, command->value, data);
	case VSMD_CAN_AUTO_RES_STS:
		data[0] = (uint8_t)command->report;
		if (!command->has_interval)
			return 1;
		data[1] = (uint8_t)(command->interval >> 8);
		data[2] = (uint8_t)(command->interval & UINT8_MAX);
		return 3;
	case VSMD_CAN_SHAKE:
		return put_shake(command, data);
	case VSMD_CAN_ENCODER:
		data[0] = 0;
		return 1;
	case VSMD_CAN_READ_STATUS:
	case VSMD_CAN_READ_DATA:
		return put_pair(command->first, command->count, data);
	default:
		return 0;
	}
}

enum vsmd_error vsmd_can_encode_command(const struct vsmd_can_style *style, unsigned drive,
                                        const struct vsmd_can_command *command,
                                        struct db_can_frame *frame)
{
	struct vsmd_can_id id = request_id(style, drive, VSMD_CAN_COMMAND, command->code);
	struct db_can_frame built = { 0 };

	if (!code_possible(command->code, id.broadcast))
		return VSMD_ERR_SYNTAX;
	if (style->output_base > 1 || !command_possible(command, style->extended) ||
	    vsmd_can_pack_id(&id, &built.id) != VSMD_OK)
		return VSMD_ERR_RANGE;
	built.length = put_arguments(command, style->output_base, built.data);
	*frame = built;
	return VSMD_OK;
}

static enum vsmd_error get_shake(const uint8_t *data, unsigned length,
                                 struct vsmd_can_command *command)
{
	uint32_t bits;

	command->shake = (enum vsmd_can_shake)data[0];
	/* Everything that is started or set needs its number. */
	if ((length == 1) != (command->shake == VSMD_CAN_SHAKE_STOP))
		return VSMD_ERR_SYNTAX;
	if (length == 1)
		return VSMD_OK;
	bits = get_be32(data + 1);
	switch (command->shake) {
	case VSMD_CAN_SHAKE_CYCLES:
	case VSMD_CAN_SHAKE_TIME:
		command->shake_count = bits;
		break;
	case VSMD_CAN_SHAKE_FREQUENCY:
		command->shake_frequency = float_of_bits(bits);
		break;
	default:
		command->position = int_of_bits(bits);
		break;
	}
	return VSMD_OK;
}

static void get_pair(const uint8_t *data, unsigned base, struct vsmd_can_command *command)
{
	unsigned port = data[0] + 1u - base;

	/* Ports counted from 1; a number below the first becomes 0, which no command accepts. */
	command->port = port > UINT8_MAX ? 0 : (uint8_t)port;
	command->value = data[1];
}

/* Takes the arguments from data whose length the command's shape allows. */
static enum vsmd_error get_arguments(const uint8_t *data, unsigned length, uint8_t output_base,
                                     struct vsmd_can_command *command)
{
	switch (command->code) {
	case VSMD_CAN_ORG:
		command->has_position = length > 0;
		if (command->has_position)
			command->position = int_of_bits(get_be32(data));
		return VSMD_OK;
	case VSMD_CAN_STP:
		command->value = data[0];
		return VSMD_OK;
	case VSMD_CAN_MOV:
		command->has_velocity = length > 0;
		if (command->has_velocity)
			command->velocity = float_of_bits(get_be32(data));
		return VSMD_OK;
	case VSMD_CAN_POS:
	case VSMD_CAN_RMV:
		command->position = int_of_bits(get_be32(data));
		command->has_velocity = length > 4;
		if (command->has_velocity)
			command->velocity = float_of_bits(get_be32(data + 4));
		return VSMD_OK;
	case VSMD_CAN_OUTPUT:
		get_pair(data, output_base, command);
		return VSMD_OK;
	case VSMD_CAN_SV:
	case VSMD_CAN_NMOS:
		get_pair(data, 0, command);
		return VSMD_OK;
	case VSMD_CAN_AUTO_RES_STS:
		command->report = (enum vsmd_can_report)data[0];
		command->has_interval = length > 1;
		if (command->has_interval)
			command->interval = (uint16_t)(data[1] << 8 | data[2]);
		return VSMD_OK;
	case VSMD_CAN_SHAKE:
		return get_shake(data, length, command);
	case VSMD_CAN_ENCODER:
		return data[0] == 0 ? VSMD_OK : VSMD_ERR_RANGE;
	case VSMD_CAN_READ_STATUS:
	case VSMD_CAN_READ_DATA:
		command->first = data[0];
		command->count = data[1];
		return VSMD_OK;
	default:
		return VSMD_OK;
	}
}

/* --- registers in frames ---------------------------------------------------------------------- */

static void put_registers(const uint32_t *values, unsigned count, struct db_can_frame *frame)
{
	frame->length = (uint8_t)(count * REG_BYTES);
	for (unsigned i = 0; i < count; i++)
		put_be32(values[i], frame->data + (size_t)i * REG_BYTES);
}

enum vsmd_error vsmd_can_decode(const struct vsmd_can_style *style,
                                const struct db_can_frame *frame, struct vsmd_can_message *message)
{
	struct vsmd_can_command *command = &message->command;
	const struct shape *shape;
	enum vsmd_error error;
	unsigned count;

	*message = (struct vsmd_can_message){ 0 };
	if (vsmd_can_unpack_id(frame->id, &message->id) != VSMD_OK ||
	    frame->length > DB_CAN_DATA_MAX)
		return VSMD_ERR_SYNTAX;
	if (message->id.control == VSMD_CAN_COMMAND) {
		command->code = (enum vsmd_can_code)message->id.reg;
		if (!code_possible(message->id.reg, message->id.broadcast))
			return VSMD_ERR_SYNTAX;
		shape = &shapes[message->id.reg];
		if (frame->length != shape->least && frame->length != shape->most)
			return VSMD_ERR_SYNTAX;
		error = get_arguments(frame->data, frame->length, style->output_base, command);
		if (error != VSMD_OK)
			return error;
		return style->output_base <= 1 && command_possible(command, message->id.extended) ?
		               VSMD_OK :
		               VSMD_ERR_RANGE;
	}
	count = frame->length / REG_BYTES;
	if (count == 0 || frame->length % REG_BYTES != 0)
		return VSMD_ERR_SYNTAX;
	if (!window_possible(message->id.reg, count, message->id.extended))
		return VSMD_ERR_RANGE;
	message->count = count;
	for (unsigned i = 0; i < count; i++)
		message->values[i] = get_be32(frame->data + (size_t)i * REG_BYTES);
	return VSMD_OK;
}

enum vsmd_error vsmd_can_encode_write(const struct vsmd_can_style *style, unsigned drive,
                                      unsigned first, const uint32_t *values, unsigned count,
                                      struct db_can_frame *frame)
{
	struct vsmd_can_id id = request_id(style, drive, VSMD_CAN_DATA_WRITE, first);
	struct db_can_frame built = { 0 };

	if (count > VSMD_CAN_FRAME_REGS || !window_possible(first, count, style->extended) ||
	    vsmd_can_pack_id(&id, &built.id) != VSMD_OK)
		return VSMD_ERR_RANGE;
	for (unsigned i = 0; i < count; i++) {
		enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
		union db_value value;
		uint32_t again = values[i];

		if (vsmd_can_params_of(first + i, params) == 0)
			return VSMD_ERR_NAME;
		/* A whole register, given raw, holds a possible value of its only parameter. A bit
		 * rate has one documented code and others that mean the same. */
		if (!vsmd_can_reg_packed(first + i) &&
		    (vsmd_can_extract(params[0], values[i], &value) != VSMD_OK ||
		     vsmd_can_insert(params[0], value, &again) != VSMD_OK || again != values[i]))
			return VSMD_ERR_RANGE;
	}
	put_registers(values, count, &built);
	*frame = built;
	return VSMD_OK;
}

int vsmd_can_encode_answer(const struct vsmd_can_style *style, unsigned drive,
                           enum vsmd_can_control control, unsigned first, const uint32_t *values,
                           unsigned count, struct db_can_frame *frames, size_t capacity)
{
	struct vsmd_can_id id = reply_id(style, drive, control, first);
	uint32_t packed;
	size_t used = 0;

	if (!is_reply(control) || !window_possible(first, count, style->extended) ||
	    vsmd_can_pack_id(&id, &packed) != VSMD_OK)
		return VSMD_ERR_RANGE;
	if ((count + 1u) / VSMD_CAN_FRAME_REGS > capacity)
		return VSMD_ERR_SPACE;
	for (unsigned at = 0; at < count; at += VSMD_CAN_FRAME_REGS) {
		unsigned left = count - at;

		/* The register is the lowest field of the id and has room for all of them. */
		frames[used] = (struct db_can_frame){ .id = packed + at };
		put_registers(values + at, left < VSMD_CAN_FRAME_REGS ? left : VSMD_CAN_FRAME_REGS,
		              &frames[used++]);
	}
	return (int)used;
}

/* --- answers of several frames ---------------------------------------------------------------- */

enum vsmd_error vsmd_can_expect(struct vsmd_can_answer *answer, const struct vsmd_can_style *style,
                                unsigned drive, enum vsmd_can_control control, unsigned first,
                                unsigned count)
{
	struct vsmd_can_id id = reply_id(style, drive, control, first);
	uint32_t packed;

	if (!is_reply(control))
		return VSMD_ERR_SYNTAX;
	if (!window_possible(first, count, style->extended) ||
	    vsmd_can_pack_id(&id, &packed) != VSMD_OK)
		return VSMD_ERR_RANGE;
	*answer = (struct vsmd_can_answer){ .id = id, .count = (uint8_t)count };
	return VSMD_OK;
}

/* Number of registers in a frame at this place of the answer; 0: it is not part of it. */
static unsigned registers_in(struct vsmd_can_answer *answer, const struct vsmd_can_message *message,
                             unsigned at)
{
	unsigned left = answer->count - at;
	unsigned due = left < VSMD_CAN_FRAME_REGS ? left : VSMD_CAN_FRAME_REGS;
	bool is_first = at % VSMD_CAN_FRAME_REGS == 0;
	/* Reports contain the first registers of the status. */
	bool is_asked = answer->id.control == VSMD_CAN_DATA_REPLY ||
	                message->id.reg > VSMD_CAN_STATUS_WORD;

	if (is_first && message->count == due)
		return due;
	if (message->count == 1) {
		if (is_asked || message->id.reg == VSMD_CAN_STATUS_SPEED)
			answer->forms |= VSMD_CAN_SINGLES;
		return answer->forms & VSMD_CAN_SINGLES ? 1 : 0;
	}
	if (!is_first) {
		answer->odd = true;
		return 0;
	}
	if (is_asked && !answer->odd)
		answer->forms |= VSMD_CAN_PADDED;
	return (answer->forms & VSMD_CAN_PADDED) && !answer->odd ? 1 : 0;
}

enum vsmd_can_took vsmd_can_take(struct vsmd_can_answer *answer,
                                 const struct vsmd_can_message *message)
{
	const struct vsmd_can_id *id = &message->id;
	unsigned at = (unsigned)id->reg - answer->id.reg; /* huge when below the first */
	unsigned count;
	uint64_t bits;

	/* Same sender, receiver and kind; the register may differ. */
	if (id->extended != answer->id.extended || id->broadcast != answer->id.broadcast ||
	    id->control != answer->id.control || id->target != answer->id.target ||
	    id->source != answer->id.source || at >= answer->count)
		return VSMD_CAN_FOREIGN;
	count = registers_in(answer, message, at);
	if (count == 0)
		return VSMD_CAN_FOREIGN;
	bits = ((UINT64_C(1) << count) - 1) << at;
	if ((answer->seen & bits) == bits)
		return VSMD_CAN_REPEATED;
	answer->seen |= bits;
	memcpy(answer->values + at, message->values, count * sizeof(message->values[0]));
	return answer->seen == UINT64_MAX >> (64 - answer->count) ? VSMD_CAN_WHOLE : VSMD_CAN_PART;
}

int vsmd_can_suspect(const struct db_can_frame *frame)
{
	struct vsmd_can_id id = { 0 };

	if (frame->id & (DB_CAN_REMOTE | DB_CAN_ERROR))
		return -1;
	if (frame->id & DB_CAN_EXTENDED)
		unpack_extended(frame->id, &id);
	else
		unpack_standard(frame->id, &id);
	return is_reply(id.control) && is_drive(id.source, id.extended) ? id.source : -1;
}
