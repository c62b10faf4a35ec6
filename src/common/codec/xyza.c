/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/xyza.h"

#include "codec/xyza_frames.h"

#include <string.h>

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

static uint8_t item_target(enum xyza_item item, enum xyza_axis axis)
{
	if (xyza_items[item].item_class == XYZA_CLASS_SYSTEM)
		return (uint8_t)(TARGET_SYSTEM + xyza_items[item].number - 1);
	return axis_target(axis, xyza_items[item].number);
}

static enum xyza_error put_item(const struct xyza_request *request, struct xyza_frame *content)
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
                                    uint32_t value, struct xyza_frame *content)
{
	if ((unsigned)request->axis >= XYZA_AXIS_COUNT)
		return XYZA_ERR_RANGE;
	content->item_class = XYZA_CLASS_POSITION;
	content->target = axis_target(request->axis, number);
	content->value = value;
	return XYZA_OK;
}

static enum xyza_error put_output(const struct xyza_request *request, struct xyza_frame *content)
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

static enum xyza_error put_motion(const struct xyza_request *request, struct xyza_frame *content)
{
	content->order = motions[request->verb].order;
	content->item_class = motions[request->verb].item_class;
	switch (request->verb) {
	case XYZA_MANUAL_JOG:
	case XYZA_MANUAL_CLEAR:
	case XYZA_PROGRAM_CLEAR:
		if ((unsigned)request->axis >= XYZA_AXIS_COUNT)
			return XYZA_ERR_RANGE;
		content->target = (uint8_t)(TARGET_JOG + 2 * (unsigned)request->axis +
		                            (request->verb == XYZA_MANUAL_JOG &&
		                             request->negative));
		return XYZA_OK;
	case XYZA_PROGRAM_START:
	case XYZA_PROGRAM_DELAY:
		content->target = request->number;
		return XYZA_OK;
	default:
		return XYZA_OK;
	}
}

static enum xyza_error put_request(const struct xyza_request *request, struct xyza_frame *content)
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

int xyza_encode_request(const struct xyza_request *request, uint8_t *frame, size_t size)
{
	struct xyza_frame content = {
		.mark = (request->verb >= XYZA_WRITE_MAGNITUDE &&
		         request->verb <= XYZA_WRITE_ITEM) ?
		                XYZA_MARK_DATA :
		                XYZA_MARK_COMMAND,
		.order = XYZA_ORDER_DATA,
		.level = XYZA_LEVEL_HOST,
		.object = request->object,
	};
	enum xyza_error error = put_request(request, &content);

	if (error != XYZA_OK)
		return error;
	if (request->object == 0)
		return XYZA_ERR_RANGE;
	return xyza_write_frame(&content, frame, size);
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

static enum xyza_error take_position(const struct xyza_frame *content, struct xyza_request *request)
{
	bool write = content->mark == XYZA_MARK_DATA;
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

static enum xyza_error take_ports(const struct xyza_frame *content, struct xyza_request *request)
{
	uint32_t port = content->value >> 4;
	uint32_t state = content->value & 0x0F;

	if (content->mark != XYZA_MARK_DATA) {
		/* The example reads with target 00, the table next to it with A1. */
		request->verb = XYZA_READ_PORTS;
		return content->target == 0 || content->target == axis_target(XYZA_X, 1) ?
		               XYZA_OK :
		               XYZA_ERR_UNKNOWN;
	}
	if (content->target != 0)
		return XYZA_ERR_UNKNOWN;
	if (content->value == ALL_ON || content->value == ALL_OFF) {
		request->verb = XYZA_WRITE_OUTPUTS;
		request->on = content->value == ALL_ON;
		return XYZA_OK;
	}
	if (port < 1 || port > XYZA_OUTPUTS || (state != 0 && state != port))
		return XYZA_ERR_RANGE;
	request->verb = XYZA_WRITE_OUTPUT;
	request->number = (uint8_t)port;
	request->on = state != 0;
	return XYZA_OK;
}

static enum xyza_error take_item(const struct xyza_frame *content, struct xyza_request *request)
{
	bool write = content->mark == XYZA_MARK_DATA;
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

static enum xyza_error take_motion(const struct xyza_frame *content, struct xyza_request *request)
{
	uint8_t target = content->target;
	int verb = XYZA_MANUAL_QUICK_STOP;

	while (verb < XYZA_VERB_COUNT && (motions[verb].order != content->order ||
	                                  motions[verb].item_class != content->item_class))
		verb++;
	if (verb == XYZA_VERB_COUNT)
		return XYZA_ERR_UNKNOWN;
	request->verb = (enum xyza_verb)verb;
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

enum xyza_error xyza_decode_request(const uint8_t *frame, size_t length,
                                    struct xyza_request *request)
{
	struct xyza_frame content;
	enum xyza_error error = xyza_read_frame(frame, length, &content);

	*request = (struct xyza_request){ .verb = XYZA_VERB_ONLINE };
	if (error == XYZA_ERR_FORM)
		return error;
	request->object = content.object;
	request->order = content.order;
	if (error != XYZA_OK)
		return error;
	if (content.level != XYZA_LEVEL_HOST && content.level != XYZA_LEVEL_SYSTEM_HOST)
		return XYZA_ERR_SIDE;
	if (content.mark != XYZA_MARK_COMMAND && content.mark != XYZA_MARK_DATA)
		return XYZA_ERR_UNKNOWN;
	if (content.object == 0)
		return XYZA_ERR_RANGE;
	if (content.order == XYZA_ORDER_DATA) {
		switch (content.item_class) {
		case XYZA_CLASS_POSITION:
			return take_position(&content, request);
		case XYZA_CLASS_PORTS:
			return take_ports(&content, request);
		case XYZA_CLASS_SPEED:
		case XYZA_CLASS_MOTOR:
		case XYZA_CLASS_SYSTEM:
			return take_item(&content, request);
		default:
			return XYZA_ERR_UNKNOWN;
		}
	}
	if (content.mark != XYZA_MARK_COMMAND)
		return XYZA_ERR_UNKNOWN;
	if (content.order != XYZA_ORDER_ONLINE)
		return take_motion(&content, request);
	request->verb = XYZA_VERB_ONLINE;
	return content.item_class == ONLINE_CODE && content.target == ONLINE_CODE ?
	               XYZA_OK :
	               XYZA_ERR_UNKNOWN;
}

/* --- replies ---------------------------------------------------------------------------------- */

enum xyza_error xyza_decode_reply(const uint8_t *frame, size_t length, struct xyza_reply *reply)
{
	struct xyza_frame content;
	enum xyza_error error = xyza_read_frame(frame, length, &content);

	*reply = (struct xyza_reply){ .kind = XYZA_REPLY_DONE };
	if (error != XYZA_OK)
		return error;
	reply->object = content.object;
	if (content.level != XYZA_LEVEL_CONTROLLER)
		return XYZA_ERR_SIDE;
	switch (content.mark) {
	case XYZA_MARK_COMMAND:
	case XYZA_MARK_ANSWER:
		if (content.order == XYZA_ORDER_OK)
			reply->kind = XYZA_REPLY_DONE;
		else if (content.order == XYZA_ORDER_FAILED ||
		         content.order == XYZA_ORDER_FAILED_BB)
			reply->kind = XYZA_REPLY_FAILED;
		else
			return XYZA_ERR_UNKNOWN;
		reply->order = content.target;
		return content.item_class == 0 ? XYZA_OK : XYZA_ERR_UNKNOWN;
	case XYZA_MARK_DATA:
		reply->order = content.order;
		if (content.order == XYZA_ORDER_PROGRAM) {
			reply->kind = XYZA_REPLY_PROGRAM_STATE;
			reply->state = content.item_class;
			reply->program = content.target;
			reply->step = (uint16_t)content.value;
			return XYZA_OK; /* states without a name exist in the document */
		}
		reply->kind = XYZA_REPLY_DATA;
		reply->item_class = content.item_class;
		reply->target = content.target;
		reply->value = content.value;
		if (content.order != XYZA_ORDER_DATA || content.item_class < XYZA_CLASS_POSITION ||
		    content.item_class > XYZA_CLASS_SYSTEM)
			return XYZA_ERR_UNKNOWN;
		return XYZA_OK;
	default:
		return XYZA_ERR_UNKNOWN;
	}
}

int xyza_encode_reply(const struct xyza_reply *reply, const struct xyza_style *style,
                      uint8_t *frame, size_t size)
{
	struct xyza_frame content = { .level = XYZA_LEVEL_CONTROLLER, .object = reply->object };

	switch (reply->kind) {
	case XYZA_REPLY_DONE:
	case XYZA_REPLY_FAILED:
		content.mark = style->answer_mark_0a ? XYZA_MARK_COMMAND : XYZA_MARK_ANSWER;
		content.order = style->failure_bb ? XYZA_ORDER_FAILED_BB : XYZA_ORDER_FAILED;
		if (reply->kind == XYZA_REPLY_DONE)
			content.order = XYZA_ORDER_OK;
		content.target = reply->order;
		break;
	case XYZA_REPLY_DATA:
		content.mark = XYZA_MARK_DATA;
		content.order = XYZA_ORDER_DATA;
		content.item_class = reply->item_class;
		content.target = reply->target;
		content.value = reply->value;
		break;
	case XYZA_REPLY_PROGRAM_STATE:
		content.mark = XYZA_MARK_DATA;
		content.order = XYZA_ORDER_PROGRAM;
		content.item_class = reply->state;
		content.target = reply->program;
		content.value = reply->step;
		break;
	default:
		return XYZA_ERR_UNKNOWN;
	}
	return xyza_write_frame(&content, frame, size);
}

void xyza_fill_data(const struct xyza_request *request, uint32_t value,
                    const struct xyza_style *style, struct xyza_reply *reply)
{
	struct xyza_frame content = { .mark = XYZA_MARK_COMMAND };

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
	struct xyza_frame content = { .mark = XYZA_MARK_COMMAND };
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
		break;
	}
	/* The data of an answer to a read. */
	if (!is_read(request->verb) || put_request(request, &content) != XYZA_OK ||
	    reply->item_class != content.item_class)
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
