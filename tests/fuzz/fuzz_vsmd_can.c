/* SPDX-License-Identifier: Apache-2.0 */
/* VSMD on CAN: whatever frames come, from either side, what is understood is written again as the
 * same frame, and what is collected or changed is nothing but what was sent or meant. */
#include "codec/vsmd_describe.h"
#include "fakes/must.h"

#include <string.h>

#define FRAME_BYTES 13 /* id, high byte first, length and data */

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static uint32_t get_u32(const uint8_t *data)
{
	return (uint32_t)data[0] << 24 | (uint32_t)data[1] << 16 | (uint32_t)data[2] << 8 | data[3];
}

static struct db_can_frame get_frame(const uint8_t *data)
{
	struct db_can_frame frame = { .id = get_u32(data), .length = data[4] };

	memcpy(frame.data, data + 5, sizeof frame.data);
	return frame;
}

static bool same_frame(const struct db_can_frame *a, const struct db_can_frame *b)
{
	return a->id == b->id && a->length == b->length && memcmp(a->data, b->data, a->length) == 0;
}

/* A style that sends what came: the host of the frame, as far as its kind names one. */
static struct vsmd_can_style style_of(const struct vsmd_can_id *id, uint8_t output_base)
{
	bool reply = id->control == VSMD_CAN_STATUS_REPLY || id->control == VSMD_CAN_DATA_REPLY;

	return (struct vsmd_can_style){
		.extended = id->extended,
		.host = reply ? id->target : id->source,
		.output_base = output_base,
	};
}

/* The id an accepted frame packs into: its own, but for the target of an extended broadcast. */
static uint32_t check_id(const struct vsmd_can_id *id, uint32_t packed)
{
	uint32_t target = 511u << 19;
	uint32_t again;

	must(vsmd_can_pack_id(id, &again) == VSMD_OK);
	if (id->extended && id->broadcast)
		packed &= ~target;
	must(again == packed);
	return again;
}

static void check_command(const struct vsmd_can_style *style, const struct db_can_frame *frame,
                          const struct vsmd_can_message *message)
{
	struct db_can_frame again;

	must(vsmd_can_encode_command(style, message->id.target, &message->command, &again) ==
	     VSMD_OK);
	must(same_frame(&again, frame));
}

/* The drive's values, once read as parameters, go back to where they were. */
static void check_register(unsigned reg, uint32_t raw)
{
	enum vsmd_param params[VSMD_CAN_FIELDS_MAX];
	size_t count = vsmd_can_params_of(reg, params);

	must(count <= VSMD_CAN_FIELDS_MAX);
	for (size_t i = 0; i < count; i++) {
		uint32_t changed = raw;
		union db_value value;
		union db_value other;

		if (vsmd_can_extract(params[i], raw, &value) != VSMD_OK ||
		    vsmd_can_insert(params[i], value, &changed) != VSMD_OK)
			continue;
		must(params[i] == VSMD_BDR || changed == raw);
		changed = ~raw;
		must(vsmd_can_insert(params[i], value, &changed) == VSMD_OK);
		must(vsmd_can_extract(params[i], changed, &other) == VSMD_OK);
		must(other.u == value.u);
		for (size_t j = 0; j < count; j++) {
			if (j != i && vsmd_can_extract(params[j], ~raw, &value) == VSMD_OK) {
				must(vsmd_can_extract(params[j], changed, &other) == VSMD_OK);
				must(other.u == value.u);
			}
		}
	}
}

static void check_write(const struct vsmd_can_style *style, const struct db_can_frame *frame,
                        const struct vsmd_can_message *message)
{
	struct db_can_frame again;

	if (vsmd_can_encode_write(style, message->id.target, message->id.reg, message->values,
	                          message->count, &again) == VSMD_OK)
		must(same_frame(&again, frame));
}

static void check_answer(const struct vsmd_can_style *style, const struct db_can_frame *frame,
                         const struct vsmd_can_message *message)
{
	struct db_can_frame again;
	struct vsmd_can_answer answer;

	must(vsmd_can_encode_answer(style, message->id.source, message->id.control, message->id.reg,
	                            message->values, message->count, &again, 1) == 1);
	must(same_frame(&again, frame));
	must(vsmd_can_expect(&answer, style, message->id.source, message->id.control,
	                     message->id.reg, message->count) == VSMD_OK);
	must(vsmd_can_take(&answer, message) == VSMD_CAN_WHOLE);
	must(vsmd_can_take(&answer, message) == VSMD_CAN_REPEATED);
	must(memcmp(answer.values, message->values, message->count * sizeof(uint32_t)) == 0);
}

static bool read_frame(struct db_can_frame frame, uint8_t output_base,
                       struct vsmd_can_message *message)
{
	struct vsmd_can_style style = { .output_base = output_base };
	struct db_can_filter filter;

	if (vsmd_can_decode(&style, &frame, message) != VSMD_OK)
		return false;
	must(frame.length <= DB_CAN_DATA_MAX);
	must(output_base <= 1 || message->id.control != VSMD_CAN_COMMAND);
	frame.id = check_id(&message->id, frame.id);
	style = style_of(&message->id, output_base);
	filter = vsmd_can_answer_filter(&style);
	switch (message->id.control) {
	case VSMD_CAN_COMMAND:
		check_command(&style, &frame, message);
		must(!db_can_filter_passes(&filter, 1, &frame));
		return true;
	case VSMD_CAN_DATA_WRITE:
		check_write(&style, &frame, message);
		must(!db_can_filter_passes(&filter, 1, &frame));
		break;
	default:
		check_answer(&style, &frame, message);
		must(db_can_filter_passes(&filter, 1, &frame));
		break;
	}
	for (unsigned i = 0; i < message->count; i++)
		check_register(message->id.reg + i, message->values[i]);
	return true;
}

/* All values of an answer that became whole were in frames that were taken. */
static void collect(struct vsmd_can_answer *answer, const struct vsmd_can_message *message,
                    uint64_t *taken)
{
	enum vsmd_can_took took = vsmd_can_take(answer, message);

	if (took == VSMD_CAN_PART || took == VSMD_CAN_WHOLE) {
		unsigned at = (unsigned)message->id.reg - answer->id.reg;
		/* The second register of a frame may be none. */
		unsigned count = at + message->count <= answer->count ? message->count : 1;

		must(at < answer->count);
		must(count == message->count || (answer->forms & VSMD_CAN_PADDED));
		must(memcmp(answer->values + at, message->values, count * sizeof(uint32_t)) == 0);
		for (unsigned i = 0; i < count; i++)
			*taken |= UINT64_C(1) << (at + i);
	}
	must((took == VSMD_CAN_WHOLE) == (*taken == UINT64_MAX >> (64 - answer->count) &&
	                                  took != VSMD_CAN_REPEATED && took != VSMD_CAN_FOREIGN));
}

static void read_identity(const uint8_t *data)
{
	char text[VSMD_CAN_IDENTITY_MAX + 1];
	char again[VSMD_CAN_IDENTITY_MAX + 1];
	uint32_t values[VSMD_CAN_IDENTITY_REGS];
	int length;

	for (size_t i = 0; i < VSMD_CAN_IDENTITY_REGS; i++)
		values[i] = get_u32(data + 4 * i);
	length = vsmd_can_get_identity(values, text);
	if (length < 0)
		return;
	must(length <= VSMD_CAN_IDENTITY_MAX && strlen(text) == (size_t)length);
	must(vsmd_can_put_identity(text, values) == VSMD_OK);
	must(vsmd_can_get_identity(values, again) == length && strcmp(text, again) == 0);
}

/*
 * Six bytes say how the bus is spoken on and which answer is expected; frames follow. The start of
 * the frames serves as an identity as well.
 */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct db_description description;
	struct vsmd_can_message message;
	struct vsmd_can_answer answer;
	struct vsmd_can_style style;
	uint64_t taken = 0; /* bit of each register */
	bool expecting;

	if (size < 6)
		return 0;
	style = (struct vsmd_can_style){
		.extended = data[0] & 1,
		.host = data[1],
		.output_base = data[0] >> 1 & 3,
	};
	expecting = vsmd_can_expect(&answer, &style, data[2],
	                            data[3] & 1 ? VSMD_CAN_DATA_REPLY : VSMD_CAN_STATUS_REPLY,
	                            data[4], data[5]) == VSMD_OK;
	data += 6;
	size -= 6;
	if (size >= VSMD_CAN_IDENTITY_MAX)
		read_identity(data);
	for (; size >= FRAME_BYTES; data += FRAME_BYTES, size -= FRAME_BYTES) {
		struct db_can_frame frame = get_frame(data);

		vsmd_can_describe(&style, &frame, &description);
		must(strlen(description.text) == description.length);
		if (read_frame(frame, style.output_base, &message) && expecting)
			collect(&answer, &message, &taken);
	}
	return 0;
}
