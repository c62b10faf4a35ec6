/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/servo_can.h"

#include "codec/big_endian.h"
#include "codec/servo_can_layout.h"

#include <string.h>

#define ENABLE_ON 10
#define ENABLE_OFF 1
#define MODE_MASK 0x000Fu
#define ACK_WITH_VALUE 3 /* data bytes of the acknowledgement of a speed or current */
#define BITS 16

/* --- what frames there are -------------------------------------------------------------------- */

/* True if the user defines all of it. */
static bool is_described(enum servo_can_kind kind)
{
	return kind == SERVO_CAN_WORDS || kind == SERVO_CAN_WORD_1 || kind == SERVO_CAN_MOVE;
}

static bool is_set(enum servo_can_kind kind, const struct servo_can_layout *layout)
{
	return kind == SERVO_CAN_WORDS  ? layout->words.set :
	       kind == SERVO_CAN_WORD_1 ? layout->word1.set :
	                                  layout->move.set;
}

static uint32_t base_of(enum servo_can_kind kind, const struct servo_can_layout *layout)
{
	switch (kind) {
	case SERVO_CAN_ACK:
		return layout->ack_base;
	case SERVO_CAN_WORDS:
		return layout->words.base;
	case SERVO_CAN_WORD_1:
		return layout->word1.base;
	case SERVO_CAN_MOVE:
		return layout->move.base;
	case SERVO_CAN_POSITION:
		return servo_can_has_slot_frame(layout) ? layout->slot_base :
		                                          servo_can_shapes[kind].base;
	default:
		return servo_can_shapes[kind].base;
	}
}

/* The document has acknowledgements up to 0B, and for four of these codes no command. */
static bool ack_recognised(uint8_t code, const struct servo_can_layout *layout)
{
	/* True if it acknowledges a frame that the user describes. */
	return (code != SERVO_CAN_ACK_NONE && code <= SERVO_CAN_ACK_UNDOCUMENTED_0B) ||
	       (code != SERVO_CAN_ACK_NONE &&
	        ((layout->words.set && code == layout->words.ack) ||
	         (layout->word1.set && code == layout->word1.ack) ||
	         (layout->move.set && code == layout->move.ack) ||
	         (servo_can_has_slot_frame(layout) && code == layout->slot_ack)));
}

uint8_t servo_can_ack_expected(const struct servo_can_message *message,
                               const struct servo_can_layout *layout)
{
	uint8_t none = SERVO_CAN_ACK_NONE;

	if ((unsigned)message->kind >= SERVO_CAN_KIND_COUNT || message->node == SERVO_CAN_BROADCAST)
		return none;
	if (is_described(message->kind) && !is_set(message->kind, layout))
		return none;
	switch (message->kind) {
	case SERVO_CAN_WORDS:
		return layout->words.ack;
	case SERVO_CAN_WORD_1:
		return layout->word1.ack;
	case SERVO_CAN_MOVE:
		return layout->move.ack;
	case SERVO_CAN_POSITION:
		return servo_can_has_slot_frame(layout) ? layout->slot_ack :
		                                          servo_can_shapes[message->kind].ack;
	default:
		return servo_can_shapes[message->kind].ack;
	}
}

/* Checked with each frame: nothing may be sent, or written past 8 bytes, with an unchecked
 * layout. */
static bool is_usable(const struct servo_can_layout *layout, enum servo_can_kind kind)
{
	enum servo_can_described which;
	char reason[SERVO_CAN_REASON_MAX];

	return is_set(kind, layout) &&
	       servo_can_layout_check(layout, &which, reason) == SERVO_CAN_OK;
}

/* --- values ----------------------------------------------------------------------------------- */

static void put16(uint8_t *bytes, uint32_t value)
{
	bytes[0] = (uint8_t)(value >> 8);
	bytes[1] = (uint8_t)value;
}

static uint16_t take16(const uint8_t *bytes)
{
	return (uint16_t)((uint32_t)bytes[0] << 8 | bytes[1]);
}

static int64_t take_number(const uint8_t *data, const struct servo_can_number_layout *number)
{
	const uint8_t *top = data + number->at + (number->low_first ? number->size - 1 : 0);
	uint64_t value = *top & 0x80 ? UINT64_MAX : 0; /* the sign goes up to the top */

	for (unsigned i = 0; i < number->size; i++)
		value = value << 8 | (number->low_first ? *(top - i) : *(top + i));
	return (int64_t)value;
}

/* False when it does not fit into the bytes. */
static bool put_number(uint8_t *data, const struct servo_can_number_layout *number, int64_t value)
{
	uint8_t *lowest = data + number->at + (number->low_first ? 0 : number->size - 1);
	uint64_t left = (uint64_t)value;

	for (unsigned i = 0; i < number->size; i++) {
		*(number->low_first ? lowest + i : lowest - i) = (uint8_t)left;
		left >>= 8;
	}
	return take_number(data, number) == value;
}

/* --- message to frame ------------------------------------------------------------------------- */

static enum servo_can_error put_described(const struct servo_can_message *message,
                                          const struct servo_can_layout *layout, uint8_t *data,
                                          uint8_t *length)
{
	const struct servo_can_number_layout *number = message->kind == SERVO_CAN_MOVE ?
	                                                       &layout->move :
	                                                       &layout->word1;
	bool words = message->kind == SERVO_CAN_WORDS;

	if (!is_usable(layout, message->kind))
		return SERVO_CAN_ERR_LAYOUT;
	*length = words ? layout->words.length : number->length;
	if (words) {
		if ((message->u.words.word0 & ~SERVO_CAN_WORD0_DOCUMENTED) != 0 ||
		    (message->u.words.word1 != 0 && layout->words.word1 == SERVO_CAN_NO_WORD))
			return SERVO_CAN_ERR_RANGE;
		memcpy(data, layout->words.fixed, layout->words.length);
		put16(data + layout->words.word0, message->u.words.word0);
		if (layout->words.word1 != SERVO_CAN_NO_WORD)
			put16(data + layout->words.word1, message->u.words.word1);
		return SERVO_CAN_OK;
	}
	memcpy(data, number->fixed, number->length);
	if (message->kind == SERVO_CAN_MOVE)
		return put_number(data, number, message->u.target) ? SERVO_CAN_OK :
		                                                     SERVO_CAN_ERR_RANGE;
	/* All its bits are defined by the user. */
	(void)put_number(data, number, message->u.word1);
	return SERVO_CAN_OK;
}

static enum servo_can_error put_host(const struct servo_can_message *message, uint8_t *data)
{
	unsigned mode = (unsigned)message->u.mode.mode;

	switch (message->kind) {
	case SERVO_CAN_ENABLE:
		put16(data, message->u.enable ? ENABLE_ON : ENABLE_OFF);
		return SERVO_CAN_OK;
	case SERVO_CAN_MODE:
		if (mode > SERVO_CAN_MODE_CURRENT ||
		    (!message->u.mode.has_max_speed && message->u.mode.max_speed != 0))
			return SERVO_CAN_ERR_RANGE;
		put16(data, message->u.mode.torque_clockwise ?
		                    mode | SERVO_CAN_MODE_TORQUE_CLOCKWISE :
		                    mode);
		data[2] = message->u.mode.has_max_speed;
		put16(data + 3, message->u.mode.max_speed);
		return SERVO_CAN_OK;
	case SERVO_CAN_SPEED:
		data[0] = SERVO_CAN_SETPOINT_SPEED;
		put16(data + 1, (uint16_t)message->u.speed);
		return SERVO_CAN_OK;
	case SERVO_CAN_CURRENT:
		data[0] = SERVO_CAN_SETPOINT_CURRENT;
		put16(data + 1, (uint16_t)message->u.current);
		return SERVO_CAN_OK;
	case SERVO_CAN_POSITION:
	case SERVO_CAN_SET_FEEDBACK:
		put_be32((uint32_t)message->u.position, data);
		return SERVO_CAN_OK;
	case SERVO_CAN_RAMPS:
		put_be32(message->u.ramps.acceleration, data);
		put_be32(message->u.ramps.deceleration, data + 4);
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
		put_be32((uint32_t)message->u.position, data);
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

static enum servo_can_error put_ack(const struct servo_can_ack *ack,
                                    const struct servo_can_layout *layout, uint8_t *data,
                                    uint8_t *length)
{
	if (!ack_recognised(ack->code, layout) || ack->extra > sizeof(ack->bytes))
		return SERVO_CAN_ERR_RANGE;
	data[0] = ack->code;
	*length = 1;
	if (ack->code == SERVO_CAN_ACK_SPEED || ack->code == SERVO_CAN_ACK_CURRENT) {
		put16(data + 1, (uint16_t)ack->value);
		*length = ACK_WITH_VALUE;
	} else if (!servo_can_ack_documented(ack->code)) {
		memcpy(data + 1, ack->bytes, ack->extra);
		*length = (uint8_t)(1 + ack->extra);
	}
	return SERVO_CAN_OK;
}

enum servo_can_error servo_can_encode(const struct servo_can_message *message,
                                      const struct servo_can_layout *layout,
                                      struct db_can_frame *frame)
{
	struct db_can_frame made = { 0 };
	enum servo_can_error error = SERVO_CAN_OK;

	if (message->kind == SERVO_CAN_FOREIGN || (unsigned)message->kind >= SERVO_CAN_KIND_COUNT)
		return SERVO_CAN_ERR_RANGE;
	if (message->node > SERVO_CAN_NODE_MAX ||
	    (message->node == SERVO_CAN_BROADCAST && !servo_can_shapes[message->kind].broadcast))
		return SERVO_CAN_ERR_RANGE;
	made.id = base_of(message->kind, layout);
	if (message->kind != SERVO_CAN_SYNC)
		made.id += message->node;
	if (made.id > DB_CAN_STANDARD_MASK)
		return SERVO_CAN_ERR_LAYOUT;
	made.length = servo_can_shapes[message->kind].length;
	if (is_described(message->kind))
		error = put_described(message, layout, made.data, &made.length);
	else if (message->kind == SERVO_CAN_ACK)
		error = put_ack(&message->u.ack, layout, made.data, &made.length);
	else if (servo_can_shapes[message->kind].from == SERVO_CAN_FROM_HOST)
		error = put_host(message, made.data);
	else
		put_drive(message, made.data);
	if (layout->padded && message->kind != SERVO_CAN_SYNC && !is_described(message->kind))
		made.length = DB_CAN_DATA_MAX;
	if (error == SERVO_CAN_OK)
		*frame = made;
	return error;
}

/* --- frame to message ------------------------------------------------------------------------- */

#define BLOCK 32 /* ids of one base: one for each node */

/* What drives send, by the block of their ids. */
static const uint8_t answers_of_blocks[] = {
	[SERVO_CAN_BASE_ANSWER_POSITION / BLOCK] = SERVO_CAN_ANSWER_POSITION,
	[SERVO_CAN_BASE_ANSWER_MOTION / BLOCK] = SERVO_CAN_ANSWER_MOTION,
	[SERVO_CAN_BASE_ANSWER_STATUS / BLOCK] = SERVO_CAN_ANSWER_STATUS,
	[SERVO_CAN_BASE_REPORT_POSITION / BLOCK] = SERVO_CAN_REPORT_POSITION,
	[SERVO_CAN_BASE_REPORT_MOTION / BLOCK] = SERVO_CAN_REPORT_MOTION,
	[SERVO_CAN_BASE_REPORT_HEALTH / BLOCK] = SERVO_CAN_REPORT_HEALTH,
	[SERVO_CAN_BASE_ANSWER_ANALOGUE / BLOCK] = SERVO_CAN_ANSWER_ANALOGUE,
};

static bool find_kind_of_host(uint32_t id, const struct servo_can_layout *layout,
                              struct servo_can_message *message)
{
	for (int i = SERVO_CAN_SYNC; i < SERVO_CAN_ACK; i++) {
		enum servo_can_kind kind = (enum servo_can_kind)i;
		uint32_t base = base_of(kind, layout);
		uint32_t nodes = kind == SERVO_CAN_SYNC ? 0 : SERVO_CAN_NODE_MAX;

		if (id < base || id > base + nodes ||
		    (id == base && !servo_can_shapes[kind].broadcast) ||
		    (is_described(kind) && !is_set(kind, layout)))
			continue;
		message->kind = kind;
		message->node = (uint8_t)(id - base);
		return true;
	}
	return false;
}

static bool find_kind(uint32_t id, const struct servo_can_layout *layout, enum servo_can_side from,
                      struct servo_can_message *message)
{
	uint32_t node = id - layout->ack_base; /* huge below the base */

	if (from == SERVO_CAN_FROM_HOST)
		return find_kind_of_host(id, layout, message);
	if (node > 0 && node <= SERVO_CAN_NODE_MAX)
		message->kind = SERVO_CAN_ACK;
	else if (id / BLOCK < sizeof(answers_of_blocks) && id % BLOCK != 0)
		message->kind = (enum servo_can_kind)answers_of_blocks[id / BLOCK];
	else
		message->kind = SERVO_CAN_FOREIGN;
	if (message->kind == SERVO_CAN_FOREIGN)
		return false;
	message->node = (uint8_t)(id - base_of(message->kind, layout));
	return true;
}

static enum servo_can_error take_described(const struct db_can_frame *frame,
                                           const struct servo_can_layout *layout,
                                           struct servo_can_message *message)
{
	const struct servo_can_words_layout *words = &layout->words;
	struct db_can_frame expected;
	uint8_t length = message->kind == SERVO_CAN_WORDS ? words->length :
	                 message->kind == SERVO_CAN_MOVE  ? layout->move.length :
	                                                    layout->word1.length;

	if (!is_usable(layout, message->kind))
		return SERVO_CAN_ERR_LAYOUT;
	if (frame->length != length)
		return SERVO_CAN_ERR_LENGTH;
	if (message->kind == SERVO_CAN_MOVE)
		message->u.target = take_number(frame->data, &layout->move);
	else if (message->kind == SERVO_CAN_WORD_1)
		message->u.word1 = (uint16_t)take_number(frame->data, &layout->word1);
	else
		message->u.words.word0 = take16(frame->data + words->word0);
	if (message->kind == SERVO_CAN_WORDS && words->word1 != SERVO_CAN_NO_WORD)
		message->u.words.word1 = take16(frame->data + words->word1);
	/* This finds both undocumented bits and wrong fixed bytes: the host would not write
	 * them. */
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
	if (ack->code != SERVO_CAN_ACK_SPEED && ack->code != SERVO_CAN_ACK_CURRENT)
		return SERVO_CAN_OK;
	if (frame->length < ACK_WITH_VALUE)
		return SERVO_CAN_ERR_LENGTH;
	ack->value = (int16_t)take16(frame->data + 1);
	return SERVO_CAN_OK;
}

static enum servo_can_error take_host(const uint8_t *data, struct servo_can_message *message)
{
	unsigned word;

	switch (message->kind) {
	case SERVO_CAN_ENABLE:
		message->u.enable = take16(data) == ENABLE_ON;
		return message->u.enable || take16(data) == ENABLE_OFF ? SERVO_CAN_OK :
		                                                         SERVO_CAN_ERR_RANGE;
	case SERVO_CAN_MODE:
		word = take16(data);
		message->u.mode.mode = (enum servo_can_mode)(word & MODE_MASK);
		message->u.mode.torque_clockwise = (word & SERVO_CAN_MODE_TORQUE_CLOCKWISE) != 0;
		message->u.mode.has_max_speed = data[2] == 1;
		if (message->u.mode.has_max_speed)
			message->u.mode.max_speed = take16(data + 3);
		return (word & ~(MODE_MASK | SERVO_CAN_MODE_TORQUE_CLOCKWISE)) == 0 &&
		                       (word & MODE_MASK) <= SERVO_CAN_MODE_CURRENT &&
		                       data[2] <= 1 ?
		               SERVO_CAN_OK :
		               SERVO_CAN_ERR_RANGE;
	case SERVO_CAN_SPEED:
		if (data[0] == SERVO_CAN_SETPOINT_SPEED) {
			message->u.speed = (int16_t)take16(data + 1);
			return SERVO_CAN_OK;
		}
		if (data[0] == SERVO_CAN_SETPOINT_CURRENT) {
			message->kind = SERVO_CAN_CURRENT;
			message->u.current = (int16_t)take16(data + 1);
			return SERVO_CAN_OK;
		}
		message->kind = SERVO_CAN_FOREIGN;
		return SERVO_CAN_ERR_RANGE;
	case SERVO_CAN_POSITION:
	case SERVO_CAN_SET_FEEDBACK:
		message->u.position = (int32_t)get_be32(data);
		return SERVO_CAN_OK;
	case SERVO_CAN_RAMPS:
		message->u.ramps.acceleration = get_be32(data);
		message->u.ramps.deceleration = get_be32(data + 4);
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
		message->u.position = (int32_t)get_be32(data);
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

enum servo_can_error servo_can_decode(const struct db_can_frame *frame,
                                      const struct servo_can_layout *layout,
                                      enum servo_can_side from, struct servo_can_message *message)
{
	uint8_t length;

	/* The whole union, whichever member is used: kind FOREIGN is 0. */
	memset(message, 0, sizeof(*message));
	/* A flag in the id makes it larger than any of ours. */
	if (!find_kind(frame->id, layout, from, message))
		return SERVO_CAN_OK;
	if (frame->length > DB_CAN_DATA_MAX)
		return SERVO_CAN_ERR_LENGTH;
	if (message->kind == SERVO_CAN_SPEED || is_described(message->kind))
		message->kind = servo_can_find_described(frame, layout, message->kind,
		                                         base_of(message->kind, layout));
	/* With an id shared with another frame. */
	if (message->node == SERVO_CAN_BROADCAST && !servo_can_shapes[message->kind].broadcast) {
		message->kind = SERVO_CAN_FOREIGN;
		return SERVO_CAN_OK;
	}
	if (is_described(message->kind))
		return take_described(frame, layout, message);
	if (message->kind == SERVO_CAN_ACK)
		return take_ack(frame, layout, &message->u.ack);
	/* Drives may send more than is documented: some pad every frame to 8 bytes. */
	length = servo_can_shapes[message->kind].length;
	if (from == SERVO_CAN_FROM_HOST && layout->padded && message->kind != SERVO_CAN_SYNC)
		length = DB_CAN_DATA_MAX;
	if (from == SERVO_CAN_FROM_HOST ? frame->length != length : frame->length < length)
		return SERVO_CAN_ERR_LENGTH;
	if (from == SERVO_CAN_FROM_HOST)
		return take_host(frame->data, message);
	take_drive(frame->data, message);
	return SERVO_CAN_OK;
}

/* --- selectors and names ---------------------------------------------------------------------- */

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
	{ DB_FAMILY_FAULT + 0, "undervoltage", "check the drive's power supply" },
	{ DB_FAMILY_FAULT + 1, "position_error",
	  "following error: check for a blocked axis, and the load" },
	{ DB_FAMILY_FAULT + 2, "hall_error", "check the encoder cable" },
	{ DB_FAMILY_FAULT + 3, "overcurrent",
	  "check the motor cable for a short circuit, and the load" },
	{ DB_FAMILY_FAULT + 4, "overload", "check for a blocked axis, the brake and the load" },
	{ DB_FAMILY_FAULT + 5, "eeprom_fault",
	  "do not trust its saved parameters; write and save them again" },
	{ DB_FAMILY_FAULT + 6, "igbt_fault",
	  "switch it off and on; check the motor cable; else replace it" },
	{ DB_FAMILY_FAULT + 7, "drive_overtemperature",
	  "let it cool; check ventilation and the load" },
	{ DB_FAMILY_FAULT + 8, "phase_loss", "check the motor cable" },
	{ DB_FAMILY_FAULT + 9, "current_deviation", "check the motor cable and the load" },
	{ DB_FAMILY_FAULT + 10, "speed_deviation", "check for a blocked axis and the load" },
	{ DB_FAMILY_FAULT + 11, "motor_overtemperature", "let the motor cool; check the load" },
	{ DB_FAMILY_FAULT + 12, "overvoltage", "check the power supply and the braking resistor" },
	{ DB_FAMILY_FAULT + 13, "absolute_encoder_fault", "check the encoder cable and battery" },
	{ DB_FAMILY_FAULT + 14, "undocumented_fault_14", "see the drive's manual" },
	{ DB_FAMILY_FAULT + 15, "locked", "see the drive's manual for how it is unlocked" },
};

static const char *const word0_names[BITS] = {
	NULL, "cclr", "zclamp", "ctrg", "trqlm", "spdlm", "pos0", "pos1", "pos2",
};

const char *servo_can_word0_name(unsigned bit)
{
	return bit < BITS ? word0_names[bit] : NULL;
}

const char *servo_can_mode_name(unsigned mode)
{
	static const char *const names[] = { "position", "speed", "current" };

	return mode < sizeof(names) / sizeof(names[0]) ? names[mode] : NULL;
}
