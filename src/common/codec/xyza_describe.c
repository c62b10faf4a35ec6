/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/xyza_describe.h"

#include "codec/xyza.h"

/* Positions of a frame's class and target; see codec/xyza.h. */
enum { AT_CLASS = 6, AT_TARGET = 7 };

/* Targets of the items that hold passwords. */
#define TARGET_READ_PASSWORD 0xC5
#define TARGET_PASSWORD 0xC6

static const char *const phrases[XYZA_VERB_COUNT] = {
	[XYZA_VERB_ONLINE] = "are you there?",
	[XYZA_READ_MAGNITUDE] = "position without its sign?",
	[XYZA_READ_SIGN] = "sign of the position?",
	[XYZA_READ_STANDING] = "does it stand?",
	[XYZA_READ_PORTS] = "inputs and outputs?",
	[XYZA_MANUAL_QUICK_STOP] = "stop at once",
	[XYZA_MANUAL_STOP] = "stop",
	[XYZA_MANUAL_CLEAR] = "the position is 0",
	[XYZA_PROGRAM_QUICK_STOP] = "stop the program at once",
	[XYZA_PROGRAM_STOP] = "pause the program",
	[XYZA_PROGRAM_CLEAR] = "the position is 0",
	[XYZA_PROGRAM_CONTINUE] = "continue the program",
	[XYZA_PROGRAM_END] = "end the program",
	[XYZA_PROGRAM_STEP_ON] = "single steps on",
	[XYZA_PROGRAM_STEP_OFF] = "single steps off",
	[XYZA_PROGRAM_STATE] = "state of the program?",
};

/* True if the verb is about an axis. */
static bool is_of_axis(const struct xyza_request *request)
{
	switch (request->verb) {
	case XYZA_READ_MAGNITUDE:
	case XYZA_READ_SIGN:
	case XYZA_READ_STANDING:
	case XYZA_WRITE_MAGNITUDE:
	case XYZA_WRITE_SIGN:
	case XYZA_MANUAL_JOG:
	case XYZA_MANUAL_CLEAR:
	case XYZA_PROGRAM_CLEAR:
		return true;
	case XYZA_READ_ITEM:
	case XYZA_WRITE_ITEM:
		return xyza_item_of_axis(request->item);
	default:
		return false;
	}
}

/* The parameters of an item, with their values or as a question. */
static void describe_item(struct db_description *description, enum xyza_item item,
                          const uint32_t *content)
{
	const char *gap = "";

	for (int i = 0; i < XYZA_PARAM_COUNT; i++) {
		enum xyza_param param = (enum xyza_param)i;

		if (xyza_param_places[param].item != item)
			continue;
		db_description_add(description, "%s", gap);
		if (!content || description->secret)
			db_description_add(description, "%s", xyza_params[param].name);
		else
			db_description_add_param(description, &xyza_params[param],
			                         xyza_param_get(param, *content));
		gap = ", ";
	}
}

static void describe_request(struct db_description *description, const struct xyza_request *request)
{
	switch (request->verb) {
	case XYZA_READ_ITEM:
		describe_item(description, request->item, NULL);
		db_description_add(description, "?");
		break;
	case XYZA_WRITE_ITEM:
		db_description_add(description, "set ");
		describe_item(description, request->item, &request->value);
		break;
	case XYZA_WRITE_MAGNITUDE:
		db_description_add(description, "the position without its sign is %lu pulses",
		                   (unsigned long)request->value);
		break;
	case XYZA_WRITE_SIGN:
		db_description_add(description, "the position is %s",
		                   request->negative ? "negative" : "positive");
		break;
	case XYZA_WRITE_OUTPUT:
		db_description_add(description, "output P%u %s", request->number,
		                   request->on ? "on" : "off");
		break;
	case XYZA_WRITE_OUTPUTS:
		db_description_add(description, "all outputs %s", request->on ? "on" : "off");
		break;
	case XYZA_MANUAL_JOG:
		db_description_add(description, "jog %s",
		                   request->negative ? "backward" : "forward");
		break;
	case XYZA_PROGRAM_START:
		db_description_add(description, "start program %u", request->number);
		break;
	case XYZA_PROGRAM_DELAY:
		db_description_add(description, "programs start after %u s", request->number);
		break;
	default:
		db_description_add(description, "%s", phrases[request->verb]);
		break;
	}
}

/* The read that this is an answer to; if there are several, the first one. */
static bool find_read(const struct xyza_reply *reply, struct xyza_request *request)
{
	static const enum xyza_verb verbs[] = { XYZA_READ_MAGNITUDE, XYZA_READ_SIGN,
		                                XYZA_READ_STANDING, XYZA_READ_PORTS,
		                                XYZA_READ_ITEM };

	for (size_t v = 0; v < sizeof(verbs) / sizeof(verbs[0]); v++) {
		unsigned items = verbs[v] == XYZA_READ_ITEM ? XYZA_ITEM_COUNT : 1;

		for (unsigned i = 0; i < items * XYZA_AXIS_COUNT; i++) {
			*request = (struct xyza_request){
				.verb = verbs[v],
				.object = reply->object,
				.axis = (enum xyza_axis)(i % XYZA_AXIS_COUNT),
				.item = (enum xyza_item)(i / XYZA_AXIS_COUNT),
			};
			if (xyza_fits(request, reply))
				return true;
		}
	}
	return false;
}

static void describe_data(struct db_description *description, const struct xyza_reply *reply)
{
	struct xyza_request read;

	if (!find_read(reply, &read)) {
		db_description_add(description, "class %02X target %02X is %08lX",
		                   reply->item_class, reply->target, (unsigned long)reply->value);
		return;
	}
	if (is_of_axis(&read))
		description->axis = (int)read.axis;
	switch (read.verb) {
	case XYZA_READ_MAGNITUDE:
		db_description_add(description, "position without its sign %lu pulses",
		                   (unsigned long)reply->value);
		break;
	case XYZA_READ_SIGN:
		db_description_add(description, "the position is %s",
		                   reply->value ? "negative" : "positive");
		break;
	case XYZA_READ_STANDING:
		db_description_add(description, "%s", reply->value ? "it stands" : "it moves");
		break;
	case XYZA_READ_PORTS:
		db_description_add(description, "inputs %04X, outputs %04X",
		                   xyza_inputs(reply->value), xyza_outputs(reply->value));
		break;
	default:
		describe_item(description, read.item, &reply->value);
		break;
	}
}

static const char *order_name(uint8_t order)
{
	switch (order) {
	case XYZA_ORDER_ONLINE:
		return "question";
	case XYZA_ORDER_DATA:
		return "read or write";
	case XYZA_ORDER_MANUAL:
		return "manual command";
	case XYZA_ORDER_PROGRAM:
		return "program command";
	default:
		return "an order";
	}
}

static void describe_reply(struct db_description *description, const struct xyza_reply *reply)
{
	static const char *const states[] = { "idle", "running", "waiting", "interrupted" };

	switch (reply->kind) {
	case XYZA_REPLY_DONE:
		if (reply->order == XYZA_ORDER_ONLINE)
			db_description_add(description, "I am here");
		else
			db_description_add(description, "%s accepted", order_name(reply->order));
		break;
	case XYZA_REPLY_FAILED:
		db_description_add(description, "%s refused", order_name(reply->order));
		break;
	case XYZA_REPLY_PROGRAM_STATE:
		if (reply->state < sizeof(states) / sizeof(states[0]))
			db_description_add(description, "program %u %s, instruction %u",
			                   reply->program, states[reply->state], reply->step);
		else
			db_description_add(description, "program %u in state %u, instruction %u",
			                   reply->program, reply->state, reply->step);
		break;
	case XYZA_REPLY_DATA:
	default:
		describe_data(description, reply);
		break;
	}
}

void xyza_describe(const uint8_t *frame, size_t length, bool sent,
                   struct db_description *description)
{
	struct xyza_request request;
	struct xyza_reply reply;

	db_description_begin(description);
	/* A damaged password is still a password. */
	description->secret = length == XYZA_DATA_FRAME && frame[AT_CLASS] == XYZA_CLASS_SYSTEM &&
	                      (frame[AT_TARGET] == TARGET_READ_PASSWORD ||
	                       frame[AT_TARGET] == TARGET_PASSWORD);
	if (sent && xyza_decode_request(frame, length, &request) == XYZA_OK) {
		description->address = request.object;
		if (is_of_axis(&request))
			description->axis = (int)request.axis;
		describe_request(description, &request);
	} else if (!sent && xyza_decode_reply(frame, length, &reply) == XYZA_OK) {
		description->address = reply.object;
		describe_reply(description, &reply);
	}
}
