/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/servo_can.h"

#include <string.h>

#define ENABLE_ON 10
#define ENABLE_OFF 1
#define SETPOINT_SPEED 0x01   /* first byte of the frame that speed ... */
#define SETPOINT_CURRENT 0x02 /* ... and current share */
#define MODE_MASK 0x000Fu
#define ACK_WITH_VALUE 3 /* data bytes of the acknowledgement of a speed or current */
#define BITS 16

/* --- what frames there are ------------------------------------------------------------------------ */

/* SYNC, WORDS and ACK have an id or a length of their own: see base_of and put_data. */
static const struct shape {
	uint16_t base;
	uint8_t length; /* data bytes that mean something */
	uint8_t ack;
	enum servo_can_side from;
	bool broadcast;
} shapes[SERVO_CAN_KIND_COUNT] = {
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

static uint32_t base_of(enum servo_can_kind kind, const struct servo_can_layout *layout)
{
	if (kind == SERVO_CAN_ACK)
		return layout->ack_base;
	return kind == SERVO_CAN_WORDS ? layout->words.base : shapes[kind].base;
}

bool servo_can_may_broadcast(enum servo_can_kind kind)
{
	return (unsigned)kind < SERVO_CAN_KIND_COUNT && shapes[kind].broadcast;
}

bool servo_can_ack_documented(uint8_t code)
{
	for (int kind = SERVO_CAN_SYNC; kind < SERVO_CAN_KIND_COUNT; kind++) {
		if (shapes[kind].ack == code)
			return code != SERVO_CAN_ACK_NONE;
	}
	return false;
}

/* The document has acknowledgements up to 0B, and for four of these codes no command. */
static bool ack_recognised(uint8_t code, const struct servo_can_layout *layout)
{
	return (code != SERVO_CAN_ACK_NONE && code <= SERVO_CAN_ACK_UNDOCUMENTED_0B) ||
	       (layout->words.set && code != SERVO_CAN_ACK_NONE && code == layout->words.ack);
}

uint8_t servo_can_ack_expected(const struct servo_can_message *message,
                               const struct servo_can_layout *layout)
{
	if ((unsigned)message->kind >= SERVO_CAN_KIND_COUNT || message->node == SERVO_CAN_BROADCAST)
		return SERVO_CAN_ACK_NONE;
	if (message->kind == SERVO_CAN_WORDS)
		return layout->words.set ? layout->words.ack : (uint8_t)SERVO_CAN_ACK_NONE;
	return shapes[message->kind].ack;
}

/* --- the layout ----------------------------------------------------------------------------------- */

/* Whether a documented frame has an id from first to last, both included. */
static bool is_documented(uint32_t first, uint32_t last)
{
	for (int kind = SERVO_CAN_SYNC; kind < SERVO_CAN_KIND_COUNT; kind++) {
		uint32_t base = shapes[kind].base;
		uint32_t end = kind == SERVO_CAN_SYNC ? base : base + SERVO_CAN_NODE_MAX;

		if (kind != SERVO_CAN_WORDS && kind != SERVO_CAN_ACK && first <= end &&
		    last >= base)
			return true;
	}
	return false;
}

/* Two ids of other frames are among the acknowledgements as printed, and have to be borne. */
static bool ack_base_possible(uint32_t base)
{
	for (uint32_t id = base + 1; id <= base + SERVO_CAN_NODE_MAX; id++) {
		if (id > DB_CAN_STANDARD_MASK ||
		    (is_documented(id, id) && id != SERVO_CAN_ID_SYNC &&
		     id != SERVO_CAN_BASE_ENABLE))
			return false;
	}
	return true;
}

static bool in_word(unsigned at, unsigned byte)
{
	return byte == at || byte == at + 1;
}

/* Byte 0 tells which of the frames with this id it is, as it does for speed and current. */
static bool has_subcode(const struct servo_can_words_layout *words)
{
	return !in_word(words->word0, 0) && !in_word(words->word1, 0) &&
	       words->fixed[0] != SETPOINT_SPEED && words->fixed[0] != SETPOINT_CURRENT;
}

static const char *words_problem(const struct servo_can_words_layout *words, uint32_t ack_base)
{
	uint32_t last = (uint32_t)words->base + SERVO_CAN_NODE_MAX;

	if (last > DB_CAN_STANDARD_MASK)
		return "the command words' base id leaves no room for 31 nodes in 11 bits";
	if (words->base == SERVO_CAN_BASE_SETPOINT) {
		if (!has_subcode(words))
			return "the command words have the ids of speed and current, so byte 0 must be "
			       "a fixed number other than 1 and 2";
	} else if (is_documented(words->base, last)) {
		return "the command words' ids belong to a documented frame";
	}
	if (words->base <= ack_base + SERVO_CAN_NODE_MAX && last > ack_base)
		return "the command words' ids are those of acknowledgements";
	if (words->length > DB_CAN_DATA_MAX)
		return "the command words' frame has more than 8 bytes";
	if (words->word0 + 2 > words->length)
		return "command word 0 does not fit its frame";
	if (words->word1 != SERVO_CAN_NO_WORD && words->word1 + 2 > words->length)
		return "command word 1 does not fit its frame";
	if (words->word1 != SERVO_CAN_NO_WORD && words->word1 < words->word0 + 2 &&
	    words->word0 < words->word1 + 2)
		return "command words 0 and 1 overlap";
	if (servo_can_ack_documented(words->ack))
		return "the command words' acknowledgement is another frame's";
	return NULL;
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

enum servo_can_error servo_can_layout_check(const struct servo_can_layout *layout,
                                            const char **reason)
{
	*reason = NULL;
	if (!ack_base_possible(layout->ack_base))
		*reason = "the acknowledgements' ids belong to a documented frame, "
			  "or leave no room for 31 nodes in 11 bits";
	else if (layout->words.set)
		*reason = words_problem(&layout->words, layout->ack_base);
	return *reason ? SERVO_CAN_ERR_LAYOUT : SERVO_CAN_OK;
}

enum servo_can_kind servo_can_ack_collision(const struct servo_can_layout *layout, uint8_t node)
{
	uint32_t id = (uint32_t)layout->ack_base + node;

	if (id == SERVO_CAN_ID_SYNC)
		return SERVO_CAN_SYNC;
	return id == SERVO_CAN_BASE_ENABLE ? SERVO_CAN_ENABLE : SERVO_CAN_FOREIGN;
}

/* Checked with each frame: nothing may be sent, or written past 8 bytes, for a layout nobody
 * checked. */
static bool words_usable(const struct servo_can_layout *layout)
{
	return layout->words.set && words_problem(&layout->words, layout->ack_base) == NULL;
}

/* --- values --------------------------------------------------------------------------------------- */

static void put16(uint8_t *bytes, uint32_t value)
{
	bytes[0] = (uint8_t)(value >> 8);
	bytes[1] = (uint8_t)value;
}

static void put32(uint8_t *bytes, uint32_t value)
{
	put16(bytes, value >> 16);
	put16(bytes + 2, value);
}

static uint16_t take16(const uint8_t *bytes)
{
	return (uint16_t)((uint32_t)bytes[0] << 8 | bytes[1]);
}

static uint32_t take32(const uint8_t *bytes)
{
	return (uint32_t)take16(bytes) << 16 | take16(bytes + 2);
}

/* --- message to frame ----------------------------------------------------------------------------- */

static enum servo_can_error put_mode(const struct servo_can_message *message, uint8_t *data)
{
	unsigned mode = (unsigned)message->u.mode.mode;

	if (mode > SERVO_CAN_MODE_CURRENT ||
	    (!message->u.mode.has_max_speed && message->u.mode.max_speed != 0))
		return SERVO_CAN_ERR_RANGE;
	put16(data,
	      message->u.mode.torque_clockwise ? mode | SERVO_CAN_MODE_TORQUE_CLOCKWISE : mode);
	data[2] = message->u.mode.has_max_speed;
	put16(data + 3, message->u.mode.max_speed);
	return SERVO_CAN_OK;
}

static enum servo_can_error put_words(const struct servo_can_message *message,
                                      const struct servo_can_words_layout *words, uint8_t *data)
{
	if ((message->u.words.word0 & ~SERVO_CAN_WORD0_DOCUMENTED) != 0 ||
	    (message->u.words.word1 != 0 && words->word1 == SERVO_CAN_NO_WORD))
		return SERVO_CAN_ERR_RANGE;
	memcpy(data, words->fixed, words->length);
	put16(data + words->word0, message->u.words.word0);
	if (words->word1 != SERVO_CAN_NO_WORD)
		put16(data + words->word1, message->u.words.word1);
	return SERVO_CAN_OK;
}

static enum servo_can_error put_host(const struct servo_can_message *message, uint8_t *data)
{
	switch (message->kind) {
	case SERVO_CAN_ENABLE:
		put16(data, message->u.enable ? ENABLE_ON : ENABLE_OFF);
		return SERVO_CAN_OK;
	case SERVO_CAN_MODE:
		return put_mode(message, data);
	case SERVO_CAN_SPEED:
		data[0] = SETPOINT_SPEED;
		put16(data + 1, (uint16_t)message->u.speed);
		return SERVO_CAN_OK;
	case SERVO_CAN_CURRENT:
		data[0] = SETPOINT_CURRENT;
		put16(data + 1, (uint16_t)message->u.current);
		return SERVO_CAN_OK;
	case SERVO_CAN_POSITION:
	case SERVO_CAN_SET_FEEDBACK:
		put32(data, (uint32_t)message->u.position);
		return SERVO_CAN_OK;
	case SERVO_CAN_RAMPS:
		put32(data, message->u.ramps.acceleration);
		put32(data + 4, message->u.ramps.deceleration);
		return SERVO_CAN_OK;
	case SERVO_CAN_READ:
		data[0] = message->u.selector;
		return message->u.selector <= SERVO_CAN_SELECTOR_MAX ? SERVO_CAN_OK :
		                                                       SERVO_CAN_ERR_RANGE;
	default:
		return SERVO_CAN_OK; /* sync is empty */
	}
}

static void put_drive(const struct servo_can_message *message, uint8_t *data)
{
	switch (message->kind) {
	case SERVO_CAN_ANSWER_POSITION:
	case SERVO_CAN_REPORT_POSITION:
		put32(data, (uint32_t)message->u.position);
		break;
	case SERVO_CAN_ANSWER_MOTION:
	case SERVO_CAN_REPORT_MOTION:
		put16(data, (uint16_t)message->u.motion.speed);
		put16(data + 2, (uint16_t)message->u.motion.current);
		break;
	case SERVO_CAN_ANSWER_STATUS:
		put16(data, message->u.status.bits);
		data[2] = message->u.status.inputs;
		data[3] = message->u.status.outputs;
		break;
	case SERVO_CAN_ANSWER_ANALOGUE:
		put16(data, message->u.analogue);
		break;
	default:
		put16(data, message->u.health.voltage);
		put16(data + 2, message->u.health.temperature);
		put16(data + 4, message->u.health.faults);
	}
}

static bool ack_has_value(uint8_t code)
{
	return code == SERVO_CAN_ACK_SPEED || code == SERVO_CAN_ACK_CURRENT;
}

static enum servo_can_error put_ack(const struct servo_can_ack *ack,
                                    const struct servo_can_layout *layout, uint8_t *data,
                                    uint8_t *length)
{
	if (!ack_recognised(ack->code, layout) || ack->extra > sizeof ack->bytes)
		return SERVO_CAN_ERR_RANGE;
	data[0] = ack->code;
	*length = 1;
	if (ack_has_value(ack->code)) {
		put16(data + 1, (uint16_t)ack->value);
		*length = ACK_WITH_VALUE;
	} else if (!servo_can_ack_documented(ack->code)) {
		memcpy(data + 1, ack->bytes, ack->extra);
		*length = (uint8_t)(1 + ack->extra);
	}
	return SERVO_CAN_OK;
}

static enum servo_can_error put_data(const struct servo_can_message *message,
                                     const struct servo_can_layout *layout, uint8_t *data,
                                     uint8_t *length)
{
	enum servo_can_error error = SERVO_CAN_OK;

	*length = shapes[message->kind].length;
	if (message->kind == SERVO_CAN_WORDS) {
		if (!words_usable(layout))
			return SERVO_CAN_ERR_LAYOUT;
		*length = layout->words.length;
		return put_words(message, &layout->words, data);
	}
	if (message->kind == SERVO_CAN_SYNC)
		return SERVO_CAN_OK;
	if (message->kind == SERVO_CAN_ACK)
		error = put_ack(&message->u.ack, layout, data, length);
	else if (shapes[message->kind].from == SERVO_CAN_FROM_HOST)
		error = put_host(message, data);
	else
		put_drive(message, data);
	if (layout->padded)
		*length = DB_CAN_DATA_MAX;
	return error;
}

enum servo_can_error servo_can_encode(const struct servo_can_message *message,
                                      const struct servo_can_layout *layout,
                                      struct db_can_frame *frame)
{
	struct db_can_frame made = { 0 };
	enum servo_can_error error;

	if (message->kind == SERVO_CAN_FOREIGN || (unsigned)message->kind >= SERVO_CAN_KIND_COUNT)
		return SERVO_CAN_ERR_RANGE;
	if (message->node > SERVO_CAN_NODE_MAX ||
	    (message->node == SERVO_CAN_BROADCAST && !shapes[message->kind].broadcast))
		return SERVO_CAN_ERR_RANGE;
	made.id = base_of(message->kind, layout);
	if (message->kind != SERVO_CAN_SYNC)
		made.id += message->node;
	if (made.id > DB_CAN_STANDARD_MASK)
		return SERVO_CAN_ERR_LAYOUT;
	error = put_data(message, layout, made.data, &made.length);
	if (error == SERVO_CAN_OK)
		*frame = made;
	return error;
}

/* --- frame to message ----------------------------------------------------------------------------- */

/* Speed and current have the same ids: both are SPEED here. */
static bool find_kind(uint32_t id, const struct servo_can_layout *layout, enum servo_can_side from,
                      struct servo_can_message *message)
{
	for (int i = SERVO_CAN_SYNC; i < SERVO_CAN_KIND_COUNT; i++) {
		enum servo_can_kind kind = (enum servo_can_kind)i;
		uint32_t base = base_of(kind, layout);
		uint32_t nodes = kind == SERVO_CAN_SYNC ? 0 : SERVO_CAN_NODE_MAX;

		if (shapes[kind].from != from || id < base || id > base + nodes ||
		    (id == base && !shapes[kind].broadcast) ||
		    (kind == SERVO_CAN_WORDS && !layout->words.set))
			continue;
		message->kind = kind;
		message->node = (uint8_t)(id - base);
		return true;
	}
	return false;
}

static enum servo_can_error take_mode(const uint8_t *data, struct servo_can_message *message)
{
	unsigned word = take16(data);

	message->u.mode.mode = (enum servo_can_mode)(word & MODE_MASK);
	message->u.mode.torque_clockwise = (word & SERVO_CAN_MODE_TORQUE_CLOCKWISE) != 0;
	message->u.mode.has_max_speed = data[2] == 1;
	if (message->u.mode.has_max_speed)
		message->u.mode.max_speed = take16(data + 3);
	return (word & ~(MODE_MASK | SERVO_CAN_MODE_TORQUE_CLOCKWISE)) == 0 &&
	                       (word & MODE_MASK) <= SERVO_CAN_MODE_CURRENT && data[2] <= 1 ?
	               SERVO_CAN_OK :
	               SERVO_CAN_ERR_RANGE;
}

static enum servo_can_error take_words(const struct db_can_frame *frame,
                                       const struct servo_can_layout *layout,
                                       struct servo_can_message *message)
{
	const struct servo_can_words_layout *words = &layout->words;
	struct db_can_frame expected;

	if (!words_usable(layout))
		return SERVO_CAN_ERR_LAYOUT;
	if (frame->length != words->length)
		return SERVO_CAN_ERR_LENGTH;
	message->u.words.word0 = take16(frame->data + words->word0);
	if (words->word1 != SERVO_CAN_NO_WORD)
		message->u.words.word1 = take16(frame->data + words->word1);
	/* Undocumented bits and wrong fixed bytes show in one go: the host would not write them. */
	if (servo_can_encode(message, layout, &expected) != SERVO_CAN_OK ||
	    memcmp(expected.data, frame->data, frame->length) != 0)
		return SERVO_CAN_ERR_RANGE;
	return SERVO_CAN_OK;
}

static enum servo_can_error take_ack(const struct db_can_frame *frame,
                                     const struct servo_can_layout *layout,
                                     struct servo_can_ack *ack)
{
	if (frame->length < 1)
		return SERVO_CAN_ERR_LENGTH;
	ack->code = frame->data[0];
	if (!servo_can_ack_documented(ack->code)) {
		ack->extra = (uint8_t)(frame->length - 1);
		memcpy(ack->bytes, frame->data + 1, ack->extra);
		return ack_recognised(ack->code, layout) ? SERVO_CAN_OK : SERVO_CAN_ERR_RANGE;
	}
	if (!ack_has_value(ack->code))
		return SERVO_CAN_OK;
	if (frame->length < ACK_WITH_VALUE)
		return SERVO_CAN_ERR_LENGTH;
	ack->value = (int16_t)take16(frame->data + 1);
	return SERVO_CAN_OK;
}

static enum servo_can_error take_setpoint(const uint8_t *data, struct servo_can_message *message)
{
	switch (data[0]) {
	case SETPOINT_SPEED:
		message->u.speed = (int16_t)take16(data + 1);
		return SERVO_CAN_OK;
	case SETPOINT_CURRENT:
		message->kind = SERVO_CAN_CURRENT;
		message->u.current = (int16_t)take16(data + 1);
		return SERVO_CAN_OK;
	default:
		message->kind = SERVO_CAN_FOREIGN;
		return SERVO_CAN_ERR_RANGE;
	}
}

static enum servo_can_error take_host(const uint8_t *data, struct servo_can_message *message)
{
	switch (message->kind) {
	case SERVO_CAN_ENABLE:
		message->u.enable = take16(data) == ENABLE_ON;
		return message->u.enable || take16(data) == ENABLE_OFF ? SERVO_CAN_OK :
		                                                         SERVO_CAN_ERR_RANGE;
	case SERVO_CAN_MODE:
		return take_mode(data, message);
	case SERVO_CAN_SPEED:
		return take_setpoint(data, message);
	case SERVO_CAN_POSITION:
	case SERVO_CAN_SET_FEEDBACK:
		message->u.position = (int32_t)take32(data);
		return SERVO_CAN_OK;
	case SERVO_CAN_RAMPS:
		message->u.ramps.acceleration = take32(data);
		message->u.ramps.deceleration = take32(data + 4);
		return SERVO_CAN_OK;
	case SERVO_CAN_READ:
		message->u.selector = data[0];
		return data[0] <= SERVO_CAN_SELECTOR_MAX ? SERVO_CAN_OK : SERVO_CAN_ERR_RANGE;
	default:
		return SERVO_CAN_OK; /* sync is empty */
	}
}

static void take_drive(const uint8_t *data, struct servo_can_message *message)
{
	switch (message->kind) {
	case SERVO_CAN_ANSWER_POSITION:
	case SERVO_CAN_REPORT_POSITION:
		message->u.position = (int32_t)take32(data);
		break;
	case SERVO_CAN_ANSWER_MOTION:
	case SERVO_CAN_REPORT_MOTION:
		message->u.motion.speed = (int16_t)take16(data);
		message->u.motion.current = (int16_t)take16(data + 2);
		break;
	case SERVO_CAN_ANSWER_STATUS:
		message->u.status.bits = take16(data);
		message->u.status.inputs = data[2];
		message->u.status.outputs = data[3];
		break;
	case SERVO_CAN_ANSWER_ANALOGUE:
		message->u.analogue = take16(data);
		break;
	default:
		message->u.health.voltage = take16(data);
		message->u.health.temperature = take16(data + 2);
		message->u.health.faults = take16(data + 4);
	}
}

/* Whether a frame with an id of speed and current has the command words instead. */
static bool has_words_subcode(const struct db_can_frame *frame,
                              const struct servo_can_layout *layout)
{
	return words_usable(layout) && layout->words.base == SERVO_CAN_BASE_SETPOINT &&
	       frame->length > 0 && frame->data[0] == layout->words.fixed[0];
}

/* Drives may send more than is documented: some fill every frame up to 8 bytes. */
static bool length_fits(const struct db_can_frame *frame, const struct servo_can_layout *layout,
                        enum servo_can_side from, enum servo_can_kind kind)
{
	uint8_t length = shapes[kind].length;

	if (from == SERVO_CAN_FROM_DRIVE)
		return frame->length >= length;
	return frame->length ==
	       (layout->padded && kind != SERVO_CAN_SYNC ? DB_CAN_DATA_MAX : length);
}

enum servo_can_error servo_can_decode(const struct db_can_frame *frame,
                                      const struct servo_can_layout *layout,
                                      enum servo_can_side from, struct servo_can_message *message)
{
	/* The whole union, whichever member will count: kind FOREIGN is 0. */
	memset(message, 0, sizeof *message);
	/* A flag in the id makes it larger than any of ours. */
	if (!find_kind(frame->id, layout, from, message))
		return SERVO_CAN_OK;
	if (frame->length > DB_CAN_DATA_MAX)
		return SERVO_CAN_ERR_LENGTH;
	if (message->kind == SERVO_CAN_SPEED && has_words_subcode(frame, layout))
		message->kind = SERVO_CAN_WORDS;
	if (message->kind == SERVO_CAN_WORDS)
		return take_words(frame, layout, message);
	if (message->kind == SERVO_CAN_ACK)
		return take_ack(frame, layout, &message->u.ack);
	if (!length_fits(frame, layout, from, message->kind))
		return SERVO_CAN_ERR_LENGTH;
	if (from == SERVO_CAN_FROM_HOST)
		return take_host(frame->data, message);
	take_drive(frame->data, message);
	return SERVO_CAN_OK;
}

/* --- selectors and names -------------------------------------------------------------------------- */

static const uint8_t answers_of[SERVO_CAN_SELECTOR_MAX + 1] = {
	SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_MOTION | SERVO_CAN_GIVES_STATUS,
	SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_MOTION,
	SERVO_CAN_GIVES_POSITION | SERVO_CAN_GIVES_STATUS,
	SERVO_CAN_GIVES_MOTION | SERVO_CAN_GIVES_STATUS,
	SERVO_CAN_GIVES_POSITION,
	SERVO_CAN_GIVES_MOTION,
	SERVO_CAN_GIVES_STATUS,
	SERVO_CAN_GIVES_ANALOGUE,
};

unsigned servo_can_answers(uint8_t selector)
{
	return selector <= SERVO_CAN_SELECTOR_MAX ? answers_of[selector] : 0;
}

int servo_can_selector(unsigned answers)
{
	for (int i = 0; i <= SERVO_CAN_SELECTOR_MAX; i++) {
		if (answers_of[i] == answers)
			return i;
	}
	return -1;
}

const struct db_drive_bit servo_can_status_bits[SERVO_CAN_STATUS_BITS] = {
	{ 0, "servo_started", "The servo is switched on: the motor has power" },
	{ 1, "servo_running", "The servo runs" },
	{ 2, "zero_speed",
	  "Slower than the drive's own threshold; a hint: see moving, which asks the speed" },
	{ 3, "target_speed_reached", "Target speed reached; a hint" },
	{ 4, "target_position_reached",
	  "Target position reached, perhaps only by the reference; a hint: see at_target" },
	{ 5, "torque_limited", "The torque is being limited" },
	{ 6, "warning", "A warning" },
	{ 7, "brake_output", "Output for the brake" },
	{ 8, "homing_done", "Homing is done" },
	{ 9, "overload_threshold", "Above the threshold of overload" },
	{ 10, "error_warning", "An error or alarm, whose reason is in the next report of faults" },
	{ 11, "command_done", "The command is done; a hint" },
	{ 12, "stall_reverse", "Stalled in the reverse direction" },
	{ 13, "stall_forward", "Stalled in the forward direction" },
	{ 14, "reverse_indication", "Turning in reverse" },
	{ 15, "forward_output", "Turning forward" },
};

const struct db_drive_fault servo_can_faults[SERVO_CAN_FAULTS] = {
	{ "undervoltage", "check the drive's power supply" },
	{ "position_error", "following error: check for a blocked axis, and the load" },
	{ "hall_error", "check the encoder cable" },
	{ "overcurrent", "check the motor cable for a short circuit, and the load" },
	{ "overload", "check for a blocked axis, the brake and the load" },
	{ "eeprom_fault", "do not trust its saved parameters; write and save them again" },
	{ "igbt_fault", "switch it off and on; check the motor cable; else replace it" },
	{ "drive_overtemperature", "let it cool; check ventilation and the load" },
	{ "phase_loss", "check the motor cable" },
	{ "current_deviation", "check the motor cable and the load" },
	{ "speed_deviation", "check for a blocked axis and the load" },
	{ "motor_overtemperature", "let the motor cool; check the load" },
	{ "overvoltage", "check the power supply and the braking resistor" },
	{ "absolute_encoder_fault", "check the encoder cable and battery" },
	{ "undocumented_fault_14", "see the drive's manual" },
	{ "locked", "see the drive's manual for how it is unlocked" },
};

static const char *const word0_names[BITS] = {
	NULL, "cclr", "zclamp", "ctrg", "trqlm", "spdlm", "pos0", "pos1", "pos2",
};

const char *servo_can_status_name(unsigned bit)
{
	return bit < BITS ? servo_can_status_bits[bit].name : NULL;
}

const char *servo_can_word0_name(unsigned bit)
{
	return bit < BITS ? word0_names[bit] : NULL;
}

const char *servo_can_word1_name(unsigned bit)
{
	(void)bit;
	return NULL;
}

const char *servo_can_mode_name(unsigned mode)
{
	static const char *const names[] = { "position", "speed", "current" };

	return mode < sizeof names / sizeof names[0] ? names[mode] : NULL;
}
