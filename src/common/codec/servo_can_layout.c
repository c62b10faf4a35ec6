/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/servo_can_layout.h"

#include <stdarg.h>
#include <stdio.h>

/* --- the frames of the document --------------------------------------------------------------- */

const struct servo_can_shape servo_can_shapes[SERVO_CAN_KIND_COUNT] = {
	[SERVO_CAN_SYNC] = { SERVO_CAN_ID_SYNC, 0, 0, SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_ENABLE] = { SERVO_CAN_BASE_ENABLE, 2, SERVO_CAN_ACK_ENABLE, SERVO_CAN_FROM_HOST,
	                       true },
	[SERVO_CAN_MODE] = { SERVO_CAN_BASE_MODE, 5, SERVO_CAN_ACK_MODE, SERVO_CAN_FROM_HOST,
	                     false },
	[SERVO_CAN_SPEED] = { SERVO_CAN_BASE_SETPOINT, 3, SERVO_CAN_ACK_SPEED, SERVO_CAN_FROM_HOST,
	                      true },
	[SERVO_CAN_CURRENT] = { SERVO_CAN_BASE_SETPOINT, 3, SERVO_CAN_ACK_CURRENT,
	                        SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_POSITION] = { SERVO_CAN_BASE_POSITION, 4, SERVO_CAN_ACK_POSITION,
	                         SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_SET_FEEDBACK] = { SERVO_CAN_BASE_SET_FEEDBACK, 4, SERVO_CAN_ACK_SET_FEEDBACK,
	                             SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_RAMPS] = { SERVO_CAN_BASE_RAMPS, 8, SERVO_CAN_ACK_RAMPS, SERVO_CAN_FROM_HOST,
	                      false },
	[SERVO_CAN_READ] = { SERVO_CAN_BASE_READ, 1, 0, SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_WORDS] = { 0, 0, 0, SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_WORD_1] = { 0, 0, 0, SERVO_CAN_FROM_HOST, true },
	[SERVO_CAN_MOVE] = { 0, 0, 0, SERVO_CAN_FROM_HOST, false },
	[SERVO_CAN_ACK] = { 0, 0, 0, SERVO_CAN_FROM_DRIVE, false },
	[SERVO_CAN_ANSWER_POSITION] = { SERVO_CAN_BASE_ANSWER_POSITION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                                false },
	[SERVO_CAN_ANSWER_MOTION] = { SERVO_CAN_BASE_ANSWER_MOTION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
	[SERVO_CAN_ANSWER_STATUS] = { SERVO_CAN_BASE_ANSWER_STATUS, 4, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
	[SERVO_CAN_ANSWER_ANALOGUE] = { SERVO_CAN_BASE_ANSWER_ANALOGUE, 2, 0, SERVO_CAN_FROM_DRIVE,
	                                false },
	[SERVO_CAN_REPORT_POSITION] = { SERVO_CAN_BASE_REPORT_POSITION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                                false },
	[SERVO_CAN_REPORT_MOTION] = { SERVO_CAN_BASE_REPORT_MOTION, 4, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
	[SERVO_CAN_REPORT_HEALTH] = { SERVO_CAN_BASE_REPORT_HEALTH, 6, 0, SERVO_CAN_FROM_DRIVE,
	                              false },
};

bool servo_can_ack_documented(uint8_t code)
{
	for (int kind = SERVO_CAN_SYNC; kind < SERVO_CAN_KIND_COUNT; kind++) {
		if (servo_can_shapes[kind].ack == code)
			return code != SERVO_CAN_ACK_NONE;
	}
	return false;
}

/* True if a documented frame has an id from first to last, both included. */
static bool is_documented(uint32_t first, uint32_t last)
{
	for (int kind = SERVO_CAN_SYNC; kind < SERVO_CAN_KIND_COUNT; kind++) {
		uint32_t base = servo_can_shapes[kind].base;
		uint32_t end = kind == SERVO_CAN_SYNC ? base : base + SERVO_CAN_NODE_MAX;

		if (base != 0 && first <= end && last >= base)
			return true;
	}
	return false;
}

/* --- the frames that the user describes ------------------------------------------------------- */

static bool in_word(unsigned at, unsigned byte)
{
	return byte == at || byte == at + 1;
}

static struct servo_can_described_frame describe_number(
	enum servo_can_described which, const char *name,
	const struct servo_can_number_layout *number)
{
	return (struct servo_can_described_frame){
		.which = which,
		.name = name,
		.base = number->base,
		.ack = number->ack,
		.has_subcode = number->at > 0,
		.subcode = number->fixed[0],
	};
}

size_t servo_can_list_described(const struct servo_can_layout *layout,
                                struct servo_can_described_frame list[SERVO_CAN_DESCRIBED_MAX])
{
	const struct servo_can_words_layout *words = &layout->words;
	size_t count = 0;

	if (words->set)
		list[count++] = (struct servo_can_described_frame){
			.which = SERVO_CAN_DESCRIBED_WORDS,
			.name = "the command words",
			.base = words->base,
			.ack = words->ack,
			.has_subcode = !in_word(words->word0, 0) && !in_word(words->word1, 0),
			.subcode = words->fixed[0],
		};
	if (layout->word1.set)
		list[count++] = describe_number(SERVO_CAN_DESCRIBED_WORD_1, "command word 1",
		                                &layout->word1);
	if (layout->move.set)
		list[count++] = describe_number(SERVO_CAN_DESCRIBED_MOVE, "the move frame",
		                                &layout->move);
	if (servo_can_has_slot_frame(layout))
		list[count++] = (struct servo_can_described_frame){
			.which = SERVO_CAN_DESCRIBED_SLOT,
			.name = "the internal position",
			.base = layout->slot_base,
			.ack = layout->slot_ack,
		};
	return count;
}

__attribute__((format(printf, 2, 3))) static bool refuse_layout(char *reason, const char *format,
                                                                ...)
{
	va_list arguments;

	va_start(arguments, format);
	vsnprintf(reason, SERVO_CAN_REASON_MAX, format, arguments);
	va_end(arguments);
	return false;
}

static const char *const ack_names[] = {
	[SERVO_CAN_ACK_ENABLE] = "enable",
	[SERVO_CAN_ACK_MODE] = "the mode",
	[SERVO_CAN_ACK_SPEED] = "speed",
	[SERVO_CAN_ACK_CURRENT] = "current",
	[SERVO_CAN_ACK_POSITION] = "internal position 0",
	[SERVO_CAN_ACK_SET_FEEDBACK] = "setting the position",
	[SERVO_CAN_ACK_RAMPS] = "the ramps",
};

static bool check_ids(const struct servo_can_described_frame *frame, uint32_t ack_base,
                      char *reason)
{
	uint32_t last = frame->base + SERVO_CAN_NODE_MAX;

	if (last > DB_CAN_STANDARD_MASK)
		return refuse_layout(reason,
		                     "the base id of %s leaves no room for 31 nodes in 11 bits",
		                     frame->name);
	if (frame->base == SERVO_CAN_BASE_SETPOINT) {
		if (!frame->has_subcode || frame->subcode == SERVO_CAN_SETPOINT_SPEED ||
		    frame->subcode == SERVO_CAN_SETPOINT_CURRENT)
			return refuse_layout(
				reason,
				"%s and speed and current have the same ids, so byte 0 "
				"must be a fixed number other than 1 and 2",
				frame->name);
	} else if (is_documented(frame->base, last) && (frame->which != SERVO_CAN_DESCRIBED_SLOT ||
	                                                frame->base != SERVO_CAN_BASE_POSITION)) {
		return refuse_layout(reason, "the ids of %s belong to a documented frame",
		                     frame->name);
	}
	if (frame->base <= ack_base + SERVO_CAN_NODE_MAX && last > ack_base)
		return refuse_layout(reason, "the ids of %s are those of acknowledgements",
		                     frame->name);
	return true;
}

static bool check_ack(const struct servo_can_described_frame *frame, char *reason)
{
	bool documented = frame->which == SERVO_CAN_DESCRIBED_SLOT &&
	                  frame->ack == SERVO_CAN_ACK_POSITION;

	if (servo_can_ack_documented(frame->ack) && !documented)
		return refuse_layout(reason,
		                     "the acknowledgement of %s is %02X, which is that of %s",
		                     frame->name, frame->ack, ack_names[frame->ack]);
	return true;
}

/* Two frames are distinguished by their ids, or by byte 0; their acknowledgements by the code. */
static bool check_pair(const struct servo_can_described_frame *frame,
                       const struct servo_can_described_frame *other, char *reason)
{
	bool apart = frame->base > other->base + SERVO_CAN_NODE_MAX ||
	             other->base > frame->base + SERVO_CAN_NODE_MAX;
	bool told = frame->base == other->base && frame->has_subcode && other->has_subcode &&
	            frame->subcode != other->subcode;

	if (!apart && !told)
		return refuse_layout(reason,
		                     "%s and %s have ids in common, and no fixed byte 0 that "
		                     "tells one from the other",
		                     frame->name, other->name);
	if (frame->ack == other->ack && frame->ack != SERVO_CAN_ACK_NONE)
		return refuse_layout(reason,
		                     "the acknowledgement of %s is %02X, which is that of %s",
		                     frame->name, frame->ack, other->name);
	return true;
}

/* Checks the content of the frame: what it carries must fit, without overlaps. */
static bool check_contents(const struct servo_can_layout *layout,
                           const struct servo_can_described_frame *frame, char *reason)
{
	const struct servo_can_words_layout *words = &layout->words;
	const struct servo_can_number_layout *number = frame->which == SERVO_CAN_DESCRIBED_MOVE ?
	                                                       &layout->move :
	                                                       &layout->word1;

	switch (frame->which) {
	case SERVO_CAN_DESCRIBED_WORDS:
		if (words->length > DB_CAN_DATA_MAX)
			return refuse_layout(
				reason, "the frame of the command words has more than 8 bytes");
		if (words->word0 + 2 > words->length)
			return refuse_layout(reason, "command word 0 does not fit its frame");
		if (words->word1 == SERVO_CAN_NO_WORD)
			return true;
		if (words->word1 + 2 > words->length)
			return refuse_layout(reason, "command word 1 does not fit its frame");
		if (words->word1 < words->word0 + 2 && words->word0 < words->word1 + 2)
			return refuse_layout(reason, "command words 0 and 1 overlap");
		return true;
	case SERVO_CAN_DESCRIBED_WORD_1:
	case SERVO_CAN_DESCRIBED_MOVE:
		if (number->length > DB_CAN_DATA_MAX || number->size < 2 ||
		    number->at + number->size > number->length)
			return refuse_layout(reason,
			                     "the number in the frame of %s does not fit it",
			                     frame->name);
		return true;
	default:
		return true;
	}
}

void servo_can_put_fixed(struct servo_can_words_layout *words, uint64_t fixed)
{
	for (unsigned i = words->length; i-- > 0;) {
		if (in_word(words->word0, i) || in_word(words->word1, i))
			continue;
		words->fixed[i] = (uint8_t)fixed;
		fixed >>= 8;
	}
}

void servo_can_put_number_fixed(struct servo_can_number_layout *number, uint64_t fixed)
{
	for (unsigned i = number->length; i-- > 0;) {
		if (i >= number->at && i < (unsigned)number->at + number->size)
			continue;
		number->fixed[i] = (uint8_t)fixed;
		fixed >>= 8;
	}
}

enum servo_can_error servo_can_layout_check(const struct servo_can_layout *layout,
                                            enum servo_can_described *which,
                                            char reason[SERVO_CAN_REASON_MAX])
{
	struct servo_can_described_frame list[SERVO_CAN_DESCRIBED_MAX];
	size_t count = servo_can_list_described(layout, list);
	bool good = true;

	*which = SERVO_CAN_DESCRIBED_ACK;
	reason[0] = '\0';
	/* Two ids of other frames are among the acknowledgements as printed, and have to be
	 * accepted. */
	for (uint32_t node = 1; node <= SERVO_CAN_NODE_MAX; node++) {
		uint32_t id = layout->ack_base + node;

		good = good && id <= DB_CAN_STANDARD_MASK &&
		       (!is_documented(id, id) || id == SERVO_CAN_ID_SYNC ||
		        id == SERVO_CAN_BASE_ENABLE);
	}
	if (!good)
		good = refuse_layout(reason,
		                     "the acknowledgements' ids belong to a documented frame, "
		                     "or leave no room for 31 nodes in 11 bits");
	for (size_t i = 0; good && i < count; i++) {
		*which = list[i].which;
		good = check_ids(&list[i], layout->ack_base, reason) &&
		       check_contents(layout, &list[i], reason) && check_ack(&list[i], reason);
		for (size_t j = 0; good && j < i; j++)
			good = check_pair(&list[i], &list[j], reason);
	}
	return good ? SERVO_CAN_OK : SERVO_CAN_ERR_LAYOUT;
}

enum servo_can_kind servo_can_ack_collision(const struct servo_can_layout *layout, uint8_t node)
{
	uint32_t id = (uint32_t)layout->ack_base + node;

	if (id == SERVO_CAN_ID_SYNC)
		return SERVO_CAN_SYNC;
	return id == SERVO_CAN_BASE_ENABLE ? SERVO_CAN_ENABLE : SERVO_CAN_FOREIGN;
}

enum servo_can_kind servo_can_find_described(const struct db_can_frame *frame,
                                             const struct servo_can_layout *layout,
                                             enum servo_can_kind kind, uint32_t base)
{
	static const enum servo_can_kind kinds[] = {
		[SERVO_CAN_DESCRIBED_WORDS] = SERVO_CAN_WORDS,
		[SERVO_CAN_DESCRIBED_WORD_1] = SERVO_CAN_WORD_1,
		[SERVO_CAN_DESCRIBED_SLOT] = SERVO_CAN_POSITION,
		[SERVO_CAN_DESCRIBED_MOVE] = SERVO_CAN_MOVE,
	};
	struct servo_can_described_frame list[SERVO_CAN_DESCRIBED_MAX];
	size_t count = servo_can_list_described(layout, list);

	for (size_t i = 0; i < count; i++) {
		if (list[i].base == base && list[i].has_subcode && frame->length > 0 &&
		    frame->data[0] == list[i].subcode)
			return kinds[list[i].which];
	}
	return kind;
}
