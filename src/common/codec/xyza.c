/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/xyza.h"

#include <string.h>

#define HEADER_0 0x5A
#define HEADER_1 0xA5

enum mark {
	MARK_COMMAND = 0x0A,
	MARK_DATA = 0x0B,
	MARK_ANSWER = 0x0C,
	MARK_PROGRAM_DATA = 0x0D,
	MARK_PROGRAM_COMMAND = 0x0E,
	MARK_ACTION = 0x0F,
};

/* Positions in a frame. */
enum place {
	AT_MARK = 2,
	AT_ORDER = 3,
	AT_LEVEL = 4,
	AT_OBJECT = 5,
	AT_CLASS = 6,
	AT_TARGET = 7,
	AT_VALUE = 8, /* data frames; in the others the checksum */
};

enum level { LEVEL_CONTROLLER = 0, LEVEL_HOST = 1, LEVEL_SYSTEM_HOST = 2 };

#define TARGET_AXIS 0xA0 /* A1.. of X, B1.. of Y, C1.. of Z, D1.. of A */
#define TARGET_AXIS_STEP 0x10
#define TARGET_JOG 0xA1 /* X forward, X backward, Y forward ... */
#define TARGET_SYSTEM 0xC1
#define ONLINE_CODE 0xAC /* class and target of an online check */
#define PORTS_ECHO 0xC1  /* target of the answer to a read of the ports */

/* Numbers of targets within class E1. */
enum position_number { NUMBER_MAGNITUDE = 1, NUMBER_SIGN = 2, NUMBER_STANDING = 3 };

#define ALL_ON 0x9F
#define ALL_OFF 0x90

/* --- frames ----------------------------------------------------------------------------------- */

#define EVEN_BYTES UINT64_C(0x00FF00FF00FF00FF)
#define ONES UINT64_C(0x0001000100010001)

/* Eight bytes at a time: pairs of them, then all pairs into the highest sixteen bits. */
static uint8_t sum_of(const uint8_t *bytes, size_t length)
{
	uint64_t total = 0;
	uint64_t word;

	for (; length >= sizeof(word); length -= sizeof(word)) {
		memcpy(&word, bytes, sizeof(word));
		total += ((word & EVEN_BYTES) + (word >> 8 & EVEN_BYTES)) * ONES >> 48;
		bytes += sizeof(word);
	}
	for (size_t i = 0; i < length; i++)
		total += bytes[i];
	return (uint8_t)total;
}

static bool sum_is_right(const uint8_t *frame, size_t length)
{
	return sum_of(frame + AT_ORDER, length - AT_ORDER - 1) == frame[length - 1];
}

/* Bytes of a whole frame with this mark; 0 when there is no such mark. */
static size_t frame_length(uint8_t mark)
{
	switch (mark) {
	case MARK_COMMAND:
	case MARK_ANSWER:
		return XYZA_COMMAND_FRAME;
	case MARK_DATA:
		return XYZA_DATA_FRAME;
	case MARK_PROGRAM_COMMAND:
		return XYZA_COMMAND_FRAME + 2; /* two bytes of instruction */
	case MARK_PROGRAM_DATA:
	case MARK_ACTION:
		return XYZA_FRAME_MAX;
	default:
		return 0;
	}
}

/* The content of a frame of one of the marks 0A, 0B, 0C. */
struct content {
	uint8_t mark;
	uint8_t order;
	uint8_t level;
	uint8_t object;
	uint8_t item_class;
	uint8_t target;
	uint32_t value; /* mark 0B */
};

static int write_frame(const struct content *content, uint8_t *frame, size_t size)
{
	size_t length = frame_length(content->mark);

	if (size < length)
		return XYZA_ERR_SPACE;
	frame[0] = HEADER_0;
	frame[1] = HEADER_1;
	frame[AT_MARK] = content->mark;
	frame[AT_ORDER] = content->order;
	frame[AT_LEVEL] = content->level;
	frame[AT_OBJECT] = content->object;
	frame[AT_CLASS] = content->item_class;
	frame[AT_TARGET] = content->target;
	if (content->mark == MARK_DATA) {
		for (size_t i = 0; i < sizeof(content->value); i++)
			frame[AT_VALUE + i] = (uint8_t)(content->value >> (8 * i));
	}
	frame[length - 1] = sum_of(frame + AT_ORDER, length - AT_ORDER - 1);
	return (int)length;
}

/* *content is filled in unless the form is wrong. */
static enum xyza_error read_frame(const uint8_t *frame, size_t length, struct content *content)
{
	if (length < XYZA_COMMAND_FRAME || frame[0] != HEADER_0 || frame[1] != HEADER_1 ||
	    frame_length(frame[AT_MARK]) != length)
		return XYZA_ERR_FORM;
	*content = (struct content){
		.mark = frame[AT_MARK],
		.order = frame[AT_ORDER],
		.level = frame[AT_LEVEL],
		.object = frame[AT_OBJECT],
		.item_class = frame[AT_CLASS],
		.target = frame[AT_TARGET],
	};
	if (content->mark == MARK_DATA)
		content->value = (uint32_t)frame[AT_VALUE] | (uint32_t)frame[AT_VALUE + 1] << 8 |
		                 (uint32_t)frame[AT_VALUE + 2] << 16 |
		                 (uint32_t)frame[AT_VALUE + 3] << 24;
	return sum_is_right(frame, length) ? XYZA_OK : XYZA_ERR_CHECKSUM;
}

/* True if these bytes, the last ones available, may be the beginning of a frame. */
static bool may_begin(const uint8_t *bytes, size_t available)
{
	return bytes[0] == HEADER_0 && (available < 2 || bytes[1] == HEADER_1) &&
	       (available <= AT_MARK || frame_length(bytes[AT_MARK]) != 0);
}

static size_t find_beginning(const uint8_t *bytes, size_t from, size_t available)
{
	while (from < available) {
		const uint8_t *header = memchr(bytes + from, HEADER_0, available - from);

		if (!header)
			return available;
		from = (size_t)(header - bytes);
		if (may_begin(header, available - from))
			break;
		from++;
	}
	return from;
}

void xyza_cut(const uint8_t *bytes, size_t available, size_t *skip, size_t *length)
{
	size_t start = find_beginning(bytes, 0, available);

	*length = 0;
	while (available - start > AT_MARK) {
		size_t whole = frame_length(bytes[start + AT_MARK]);
		size_t next;

		if (available - start < whole)
			break;
		next = find_beginning(bytes, start + 1, start + whole);
		if (next == start + whole || sum_is_right(bytes + start, whole)) {
			*length = whole;
			break;
		}
		/* A seeming beginning at the end of that frame may be none. */
		start = find_beginning(bytes, next, available);
	}
	*skip = start;
}

/* --- requests --------------------------------------------------------------------------------- */

/* Verbs of orders F3 and F4: only the class distinguishes them. */
static const struct {
	uint8_t order;
	uint8_t item_class;
} motions[XYZA_VERB_COUNT] = {
	[XYZA_MANUAL_QUICK_STOP] = { XYZA_ORDER_MANUAL, 0x01 },
	[XYZA_MANUAL_STOP] = { XYZA_ORDER_MANUAL, 0x02 },
	[XYZA_MANUAL_JOG] = { XYZA_ORDER_MANUAL, 0x03 },
	[XYZA_MANUAL_CLEAR] = { XYZA_ORDER_MANUAL, 0x04 },
	[XYZA_PROGRAM_QUICK_STOP] = { XYZA_ORDER_PROGRAM, 0x01 },
	[XYZA_PROGRAM_STOP] = { XYZA_ORDER_PROGRAM, 0x02 },
	[XYZA_PROGRAM_START] = { XYZA_ORDER_PROGRAM, 0x03 },
	[XYZA_PROGRAM_CLEAR] = { XYZA_ORDER_PROGRAM, 0x04 },
	[XYZA_PROGRAM_DELAY] = { XYZA_ORDER_PROGRAM, 0x05 },
	[XYZA_PROGRAM_CONTINUE] = { XYZA_ORDER_PROGRAM, 0x06 },
	[XYZA_PROGRAM_END] = { XYZA_ORDER_PROGRAM, 0x07 },
	[XYZA_PROGRAM_STEP_ON] = { XYZA_ORDER_PROGRAM, 0x08 },
	[XYZA_PROGRAM_STEP_OFF] = { XYZA_ORDER_PROGRAM, 0x09 },
	[XYZA_PROGRAM_STATE] = { XYZA_ORDER_PROGRAM, 0x0A },
};

static uint8_t axis_target(enum xyza_axis axis, unsigned number)
{
	return (uint8_t)(TARGET_AXIS + TARGET_AXIS_STEP * (unsigned)axis + number);
}

static uint8_t jog_target(enum xyza_axis axis, bool negative)
{
	return (uint8_t)(TARGET_JOG + 2 * (unsigned)axis + negative);
}

static uint8_t item_target(enum xyza_item item, enum xyza_axis axis)
{
	if (xyza_items[item].item_class == XYZA_CLASS_SYSTEM)
		return (uint8_t)(TARGET_SYSTEM + xyza_items[item].number - 1);
	return axis_target(axis, xyza_items[item].number);
}

static enum xyza_error put_item(const struct xyza_request *request, struct content *content)
{
	enum xyza_item item = request->item;
	bool write = request->verb == XYZA_WRITE_ITEM;

	if ((unsigned)item >= XYZA_ITEM_COUNT ||
	    !xyza_item_can(item, write ? XYZA_CAN_WRITE : XYZA_CAN_READ))
		return XYZA_ERR_UNKNOWN;
	if ((write && !xyza_item_in_range(item, request->value, request->kept)) ||
	    (xyza_item_of_axis(item) && (unsigned)request->axis >= XYZA_AXIS_COUNT))
		return XYZA_ERR_RANGE;
	content->item_class = xyza_items[item].item_class;
	content->target = item_target(item, request->axis);
	content->value = write ? request->value : 0;
	return XYZA_OK;
}

static enum xyza_error put_position(const struct xyza_request *request, unsigned number,
                                    uint32_t value, struct content *content)
{
	if ((unsigned)request->axis >= XYZA_AXIS_COUNT)
		return XYZA_ERR_RANGE;
	content->item_class = XYZA_CLASS_POSITION;
	content->target = axis_target(request->axis, number);
	content->value = value;
	return XYZA_OK;
}

static enum xyza_error put_output(const struct xyza_request *request, struct content *content)
{
	unsigned port = request->number;

	content->item_class = XYZA_CLASS_PORTS;
	if (request->verb == XYZA_WRITE_OUTPUTS) {
		content->value = request->on ? ALL_ON : ALL_OFF;
		return XYZA_OK;
	}
	if (port < 1 || port > XYZA_OUTPUTS)
		return XYZA_ERR_RANGE;
	content->value = port << 4 | (request->on ? port : 0);
	return XYZA_OK;
}

static enum xyza_error put_motion(const struct xyza_request *request, struct content *content)
{
	content->order = motions[request->verb].order;
	content->item_class = motions[request->verb].item_class;
	switch (request->verb) {
	case XYZA_MANUAL_JOG:
	case XYZA_MANUAL_CLEAR:
	case XYZA_PROGRAM_CLEAR:
		if ((unsigned)request->axis >= XYZA_AXIS_COUNT)
			return XYZA_ERR_RANGE;
		content->target = jog_target(request->axis,
		                             request->verb == XYZA_MANUAL_JOG && request->negative);
		return XYZA_OK;
	case XYZA_PROGRAM_START:
	case XYZA_PROGRAM_DELAY:
		content->target = request->number;
		return XYZA_OK;
	default:
		return XYZA_OK;
	}
}

static enum xyza_error put_request(const struct xyza_request *request, struct content *content)
{
	switch (request->verb) {
	case XYZA_VERB_ONLINE:
		content->order = content->item_class = content->target = ONLINE_CODE;
		return XYZA_OK;
	case XYZA_READ_MAGNITUDE:
	case XYZA_WRITE_MAGNITUDE:
		return put_position(request, NUMBER_MAGNITUDE, request->value, content);
	case XYZA_READ_SIGN:
	case XYZA_WRITE_SIGN:
		return put_position(request, NUMBER_SIGN, request->negative, content);
	case XYZA_READ_STANDING:
		return put_position(request, NUMBER_STANDING, 0, content);
	case XYZA_READ_PORTS:
		content->item_class = XYZA_CLASS_PORTS;
		return XYZA_OK;
	case XYZA_READ_ITEM:
	case XYZA_WRITE_ITEM:
		return put_item(request, content);
	case XYZA_WRITE_OUTPUT:
	case XYZA_WRITE_OUTPUTS:
		return put_output(request, content);
	default:
		if ((unsigned)request->verb >= XYZA_VERB_COUNT)
			return XYZA_ERR_UNKNOWN;
		return put_motion(request, content);
	}
}

static bool is_write(enum xyza_verb verb)
{
	return verb >= XYZA_WRITE_MAGNITUDE && verb <= XYZA_WRITE_ITEM;
}

int xyza_encode_request(const struct xyza_request *request, uint8_t *frame, size_t size)
{
	struct content content = {
		.mark = is_write(request->verb) ? MARK_DATA : MARK_COMMAND,
		.order = XYZA_ORDER_DATA,
		.level = LEVEL_HOST,
		.object = request->object,
	};
	enum xyza_error error = put_request(request, &content);

	if (error != XYZA_OK)
		return error;
	if (request->object == 0)
		return XYZA_ERR_RANGE;
	return write_frame(&content, frame, size);
}

/* Splits A1..A9, B1.. C1.. D1.. into axis and number. */
static bool take_axis_target(uint8_t target, struct xyza_request *request, unsigned *number)
{
	if (target < TARGET_AXIS || target >= TARGET_AXIS + TARGET_AXIS_STEP * XYZA_AXIS_COUNT)
		return false;
	request->axis = (enum xyza_axis)((target - TARGET_AXIS) / TARGET_AXIS_STEP);
	*number = ((unsigned)target - TARGET_AXIS) % TARGET_AXIS_STEP;
	return true;
}

static enum xyza_error take_position(const struct content *content, struct xyza_request *request)
{
	bool write = content->mark == MARK_DATA;
	unsigned number;

	if (!take_axis_target(content->target, request, &number))
		return XYZA_ERR_UNKNOWN;
	if (number == NUMBER_MAGNITUDE) {
		request->verb = write ? XYZA_WRITE_MAGNITUDE : XYZA_READ_MAGNITUDE;
		request->value = content->value;
		return XYZA_OK;
	}
	if (number == NUMBER_SIGN) {
		request->verb = write ? XYZA_WRITE_SIGN : XYZA_READ_SIGN;
		request->negative = content->value == 1;
		return content->value <= 1 ? XYZA_OK : XYZA_ERR_RANGE;
	}
	request->verb = XYZA_READ_STANDING;
	return number == NUMBER_STANDING && !write ? XYZA_OK : XYZA_ERR_UNKNOWN;
}

static enum xyza_error take_output(uint32_t value, struct xyza_request *request)
{
	uint32_t port = value >> 4;
	uint32_t state = value & 0x0F;

	if (value == ALL_ON || value == ALL_OFF) {
		request->verb = XYZA_WRITE_OUTPUTS;
		request->on = value == ALL_ON;
		return XYZA_OK;
	}
	if (port < 1 || port > XYZA_OUTPUTS || (state != 0 && state != port))
		return XYZA_ERR_RANGE;
	request->verb = XYZA_WRITE_OUTPUT;
	request->number = (uint8_t)port;
	request->on = state != 0;
	return XYZA_OK;
}

static enum xyza_error take_ports(const struct content *content, struct xyza_request *request)
{
	if (content->mark == MARK_DATA)
		return content->target == 0 ? take_output(content->value, request) :
		                              XYZA_ERR_UNKNOWN;
	/* The example reads with target 00, the table next to it with A1. */
	request->verb = XYZA_READ_PORTS;
	return content->target == 0 || content->target == axis_target(XYZA_X, 1) ? XYZA_OK :
	                                                                           XYZA_ERR_UNKNOWN;
}

static enum xyza_error take_item(const struct content *content, struct xyza_request *request)
{
	bool write = content->mark == MARK_DATA;
	struct xyza_request found = { .axis = XYZA_X };
	unsigned number = 0;

	if (content->item_class != XYZA_CLASS_SYSTEM &&
	    !take_axis_target(content->target, &found, &number))
		return XYZA_ERR_UNKNOWN;
	for (int i = 0; i < XYZA_ITEM_COUNT; i++) {
		enum xyza_item item = (enum xyza_item)i;

		if (xyza_items[item].item_class != content->item_class ||
		    item_target(item, found.axis) != content->target)
			continue;
		if (!xyza_item_can(item, write ? XYZA_CAN_WRITE : XYZA_CAN_READ))
			return XYZA_ERR_UNKNOWN;
		request->verb = write ? XYZA_WRITE_ITEM : XYZA_READ_ITEM;
		request->item = item;
		request->axis = found.axis;
		request->value = content->value;
		return !write || xyza_item_in_range(item, content->value, 0) ? XYZA_OK :
		                                                               XYZA_ERR_RANGE;
	}
	return XYZA_ERR_UNKNOWN;
}

static enum xyza_error take_data(const struct content *content, struct xyza_request *request)
{
	switch (content->item_class) {
	case XYZA_CLASS_POSITION:
		return take_position(content, request);
	case XYZA_CLASS_PORTS:
		return take_ports(content, request);
	case XYZA_CLASS_SPEED:
	case XYZA_CLASS_MOTOR:
	case XYZA_CLASS_SYSTEM:
		return take_item(content, request);
	default:
		return XYZA_ERR_UNKNOWN;
	}
}

static enum xyza_error take_target(uint8_t target, struct xyza_request *request)
{
	switch (request->verb) {
	case XYZA_MANUAL_JOG:
	case XYZA_MANUAL_CLEAR:
	case XYZA_PROGRAM_CLEAR:
		if (target < TARGET_JOG || target >= TARGET_JOG + 2 * XYZA_AXIS_COUNT)
			return XYZA_ERR_UNKNOWN;
		request->axis = (enum xyza_axis)((target - TARGET_JOG) / 2);
		request->negative = request->verb == XYZA_MANUAL_JOG && (target - TARGET_JOG) % 2;
		return XYZA_OK;
	case XYZA_PROGRAM_START:
	case XYZA_PROGRAM_DELAY:
		request->number = target;
		return XYZA_OK;
	default:
		return target == 0 ? XYZA_OK : XYZA_ERR_UNKNOWN;
	}
}

static enum xyza_error take_motion(const struct content *content, struct xyza_request *request)
{
	for (int i = XYZA_MANUAL_QUICK_STOP; i < XYZA_VERB_COUNT; i++) {
		if (motions[i].order != content->order ||
		    motions[i].item_class != content->item_class)
			continue;
		request->verb = (enum xyza_verb)i;
		return take_target(content->target, request);
	}
	return XYZA_ERR_UNKNOWN;
}

static enum xyza_error take_request(const struct content *content, struct xyza_request *request)
{
	if (content->order == XYZA_ORDER_DATA)
		return take_data(content, request);
	if (content->mark != MARK_COMMAND)
		return XYZA_ERR_UNKNOWN;
	if (content->order != XYZA_ORDER_ONLINE)
		return take_motion(content, request);
	request->verb = XYZA_VERB_ONLINE;
	return content->item_class == ONLINE_CODE && content->target == ONLINE_CODE ?
	               XYZA_OK :
	               XYZA_ERR_UNKNOWN;
}

enum xyza_error xyza_decode_request(const uint8_t *frame, size_t length,
                                    struct xyza_request *request)
{
	struct content content;
	enum xyza_error error = read_frame(frame, length, &content);

	*request = (struct xyza_request){ .verb = XYZA_VERB_ONLINE };
	if (error == XYZA_ERR_FORM)
		return error;
	request->object = content.object;
	request->order = content.order;
	if (error != XYZA_OK)
		return error;
	if (content.level != LEVEL_HOST && content.level != LEVEL_SYSTEM_HOST)
		return XYZA_ERR_SIDE;
	if (content.mark != MARK_COMMAND && content.mark != MARK_DATA)
		return XYZA_ERR_UNKNOWN;
	if (content.object == 0)
		return XYZA_ERR_RANGE;
	return take_request(&content, request);
}

/* --- replies ---------------------------------------------------------------------------------- */

static enum xyza_error take_answer(const struct content *content, struct xyza_reply *reply)
{
	if (content->order == XYZA_ORDER_OK)
		reply->kind = XYZA_REPLY_DONE;
	else if (content->order == XYZA_ORDER_FAILED || content->order == XYZA_ORDER_FAILED_BB)
		reply->kind = XYZA_REPLY_FAILED;
	else
		return XYZA_ERR_UNKNOWN;
	reply->order = content->target;
	return content->item_class == 0 ? XYZA_OK : XYZA_ERR_UNKNOWN;
}

static enum xyza_error take_reply_data(const struct content *content, struct xyza_reply *reply)
{
	reply->order = content->order;
	if (content->order == XYZA_ORDER_PROGRAM) {
		reply->kind = XYZA_REPLY_PROGRAM_STATE;
		reply->state = content->item_class;
		reply->program = content->target;
		reply->step = (uint16_t)content->value;
		return XYZA_OK; /* the document's table leaves room for states without a name */
	}
	reply->kind = XYZA_REPLY_DATA;
	reply->item_class = content->item_class;
	reply->target = content->target;
	reply->value = content->value;
	if (content->order != XYZA_ORDER_DATA || content->item_class < XYZA_CLASS_POSITION ||
	    content->item_class > XYZA_CLASS_SYSTEM)
		return XYZA_ERR_UNKNOWN;
	return XYZA_OK;
}

enum xyza_error xyza_decode_reply(const uint8_t *frame, size_t length, struct xyza_reply *reply)
{
	struct content content;
	enum xyza_error error = read_frame(frame, length, &content);

	*reply = (struct xyza_reply){ .kind = XYZA_REPLY_DONE };
	if (error != XYZA_OK)
		return error;
	reply->object = content.object;
	if (content.level != LEVEL_CONTROLLER)
		return XYZA_ERR_SIDE;
	switch (content.mark) {
	case MARK_COMMAND:
	case MARK_ANSWER:
		return take_answer(&content, reply);
	case MARK_DATA:
		return take_reply_data(&content, reply);
	default:
		return XYZA_ERR_UNKNOWN;
	}
}

uint32_t xyza_part(const uint8_t *frame, size_t length)
{
	if (length != XYZA_DATA_FRAME || frame[AT_MARK] != MARK_DATA ||
	    frame[AT_ORDER] != XYZA_ORDER_DATA || frame[AT_CLASS] < XYZA_CLASS_POSITION ||
	    frame[AT_CLASS] > XYZA_CLASS_SYSTEM)
		return 0;
	return 1u + ((uint32_t)frame[AT_CLASS] << 8 | frame[AT_TARGET]);
}

uint8_t xyza_sender(const uint8_t *frame, size_t length)
{
	struct content content;

	if (read_frame(frame, length, &content) != XYZA_OK || content.level != LEVEL_CONTROLLER)
		return 0;
	return content.object;
}

int xyza_encode_reply(const struct xyza_reply *reply, const struct xyza_style *style,
                      uint8_t *frame, size_t size)
{
	struct content content = { .level = LEVEL_CONTROLLER, .object = reply->object };

	switch (reply->kind) {
	case XYZA_REPLY_DONE:
	case XYZA_REPLY_FAILED:
		content.mark = style->answer_mark_0a ? MARK_COMMAND : MARK_ANSWER;
		content.order = style->failure_bb ? XYZA_ORDER_FAILED_BB : XYZA_ORDER_FAILED;
		if (reply->kind == XYZA_REPLY_DONE)
			content.order = XYZA_ORDER_OK;
		content.target = reply->order;
		break;
	case XYZA_REPLY_DATA:
		content.mark = MARK_DATA;
		content.order = XYZA_ORDER_DATA;
		content.item_class = reply->item_class;
		content.target = reply->target;
		content.value = reply->value;
		break;
	case XYZA_REPLY_PROGRAM_STATE:
		content.mark = MARK_DATA;
		content.order = XYZA_ORDER_PROGRAM;
		content.item_class = reply->state;
		content.target = reply->program;
		content.value = reply->step;
		break;
	default:
		return XYZA_ERR_UNKNOWN;
	}
	return write_frame(&content, frame, size);
}

void xyza_fill_data(const struct xyza_request *request, uint32_t value,
                    const struct xyza_style *style, struct xyza_reply *reply)
{
	struct content content = { .mark = MARK_COMMAND };

	(void)put_request(request, &content);
	*reply = (struct xyza_reply){
		.kind = XYZA_REPLY_DATA,
		.object = request->object,
		.order = XYZA_ORDER_DATA,
		.item_class = content.item_class,
		.target = request->verb == XYZA_READ_PORTS ? PORTS_ECHO : content.target,
		.value = value,
	};
	if (request->verb == XYZA_READ_STANDING && style->echo_a4)
		reply->target++;
}

/* Checks the data of an answer to a read. */
static bool data_fits(const struct xyza_request *request, const struct xyza_reply *reply)
{
	struct content content = { .mark = MARK_COMMAND };

	if (put_request(request, &content) != XYZA_OK || reply->item_class != content.item_class)
		return false;
	switch (request->verb) {
	case XYZA_READ_PORTS:
		return true; /* no two places of the document agree on the target */
	case XYZA_READ_SIGN:
		return reply->target == content.target && reply->value <= 1;
	case XYZA_READ_STANDING:
		return (reply->target == content.target || reply->target == content.target + 1) &&
		       reply->value <= 1;
	default:
		return reply->target == content.target;
	}
}

static bool is_read(enum xyza_verb verb)
{
	return verb >= XYZA_READ_MAGNITUDE && verb <= XYZA_READ_ITEM;
}

static uint8_t order_of(enum xyza_verb verb)
{
	if (verb == XYZA_VERB_ONLINE)
		return XYZA_ORDER_ONLINE;
	return motions[verb].order ? motions[verb].order : (uint8_t)XYZA_ORDER_DATA;
}

bool xyza_fits(const struct xyza_request *request, const struct xyza_reply *reply)
{
	if ((unsigned)request->verb >= XYZA_VERB_COUNT || reply->object != request->object)
		return false;
	switch (reply->kind) {
	case XYZA_REPLY_FAILED:
		return reply->order == order_of(request->verb);
	case XYZA_REPLY_DONE:
		return reply->order == order_of(request->verb) && !is_read(request->verb) &&
		       request->verb != XYZA_PROGRAM_STATE;
	case XYZA_REPLY_PROGRAM_STATE:
		return request->verb == XYZA_PROGRAM_STATE;
	case XYZA_REPLY_DATA:
	default:
		return is_read(request->verb) && data_fits(request, reply);
	}
}

bool xyza_is_read(enum xyza_verb verb)
{
	return is_read(verb) || verb == XYZA_PROGRAM_STATE || verb == XYZA_VERB_ONLINE;
}

bool xyza_is_stop(enum xyza_verb verb)
{
	return verb == XYZA_MANUAL_STOP || verb == XYZA_MANUAL_QUICK_STOP ||
	       verb == XYZA_PROGRAM_STOP || verb == XYZA_PROGRAM_QUICK_STOP;
}

size_t xyza_reply_length(enum xyza_verb verb)
{
	return is_read(verb) || verb == XYZA_PROGRAM_STATE ? XYZA_DATA_FRAME : XYZA_COMMAND_FRAME;
}

uint16_t xyza_inputs(uint32_t value)
{
	return (uint16_t)value;
}

uint16_t xyza_outputs(uint32_t value)
{
	return (uint16_t)(value >> XYZA_OUTPUTS_SHIFT);
}

bool xyza_position(uint32_t magnitude, bool negative, int32_t *position)
{
	int64_t number = negative ? -(int64_t)magnitude : (int64_t)magnitude;

	if (number < INT32_MIN || number > INT32_MAX)
		return false;
	*position = (int32_t)number;
	return true;
}

/* --- what the document does not have ---------------------------------------------------------- */

int xyza_encode_raw(const uint8_t *content, size_t length, uint8_t object, uint8_t *frame,
                    size_t size)
{
	size_t whole = length > 0 ? frame_length(content[0]) : 0;
	uint8_t *said = frame + AT_MARK;

	if (whole == 0 || content[0] == MARK_ANSWER || length != whole - AT_MARK - 1)
		return XYZA_ERR_FORM;
	if (size < whole)
		return XYZA_ERR_SPACE;
	frame[0] = HEADER_0;
	frame[1] = HEADER_1;
	memcpy(said, content, length);
	if (frame[AT_OBJECT] == 0)
		frame[AT_OBJECT] = object;
	if (frame[AT_OBJECT] != object || frame[AT_LEVEL] == LEVEL_CONTROLLER)
		return XYZA_ERR_RANGE;
	frame[whole - 1] = sum_of(frame + AT_ORDER, whole - AT_ORDER - 1);
	return (int)whole;
}

static bool is_acknowledgement(const struct content *content)
{
	return content->order == XYZA_ORDER_OK || content->order == XYZA_ORDER_FAILED ||
	       content->order == XYZA_ORDER_FAILED_BB;
}

/* Orders whose data the bridge itself requests. */
static bool is_own_order(uint8_t order)
{
	return order == XYZA_ORDER_DATA || order == XYZA_ORDER_PROGRAM;
}

bool xyza_raw_fits(const uint8_t *request, const uint8_t *frame, size_t length, bool *failed,
                   bool *shows)
{
	uint8_t order = request[AT_ORDER];
	struct content content;

	if (xyza_sender(frame, length) != request[AT_OBJECT] ||
	    read_frame(frame, length, &content) != XYZA_OK)
		return false;
	*shows = !is_acknowledgement(&content);
	*failed = !*shows && content.order != XYZA_ORDER_OK;
	if (!*shows)
		return content.target == order;
	return content.order == order || !is_own_order(content.order);
}
