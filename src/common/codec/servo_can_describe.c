/* SPDX-License-Identifier: Apache-2.0 */
#include "codec/servo_can_describe.h"

static void add_current(struct db_description *description, int16_t tenths)
{
	db_description_add_float(description, (float)tenths / 10.0f, "A");
}

/* The names of its bits; "none". `name_of`: NULL where no bit has one. */
static void add_word(struct db_description *description, uint16_t word,
                     const char *(*name_of)(unsigned bit))
{
	const char *gap = "";

	if (word == 0)
		db_description_add(description, "none");
	for (unsigned bit = 0; bit < 16; bit++) {
		const char *name = name_of ? name_of(bit) : NULL;

		if (!(word >> bit & 1))
			continue;
		if (name)
			db_description_add(description, "%s%s", gap, name);
		else
			db_description_add(description, "%sbit %u", gap, bit);
		gap = " ";
	}
}

static const char *fault_name(unsigned bit)
{
	return servo_can_faults[bit].name;
}

static void describe_read(struct db_description *description, uint8_t selector)
{
	static const char *const names[] = { "position", "speed and current", "status",
		                             "analogue" };
	unsigned answers = servo_can_answers(selector);
	const char *gap = "";

	for (unsigned i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
		if (!(answers >> i & 1))
			continue;
		db_description_add(description, "%s%s", gap, names[i]);
		gap = ", ";
	}
	db_description_add(description, "?");
}

static void describe_ack(struct db_description *description, const struct servo_can_ack *ack)
{
	static const char *const names[] = {
		[SERVO_CAN_ACK_ENABLE] = "enable",
		[SERVO_CAN_ACK_MODE] = "mode",
		[SERVO_CAN_ACK_SPEED] = "speed",
		[SERVO_CAN_ACK_CURRENT] = "current",
		[SERVO_CAN_ACK_POSITION] = "position",
		[SERVO_CAN_ACK_SET_FEEDBACK] = "set position",
		[SERVO_CAN_ACK_RAMPS] = "ramps",
	};
	const char *name = ack->code < sizeof(names) / sizeof(names[0]) ? names[ack->code] : NULL;

	if (name)
		db_description_add(description, "acknowledges %s", name);
	else
		db_description_add(description, "acknowledges %02X", ack->code);
	if (ack->code == SERVO_CAN_ACK_SPEED)
		db_description_add(description, ", measured %d rpm", ack->value);
	if (ack->code == SERVO_CAN_ACK_CURRENT) {
		db_description_add(description, ", measured ");
		add_current(description, ack->value);
	}
}

static void describe_host(struct db_description *description,
                          const struct servo_can_message *message, unsigned slot)
{
	switch (message->kind) {
	case SERVO_CAN_SYNC:
		db_description_add(description, "sync");
		break;
	case SERVO_CAN_ENABLE:
		db_description_add(description, "%s", message->u.enable ? "enable" : "disable");
		break;
	case SERVO_CAN_MODE:
		db_description_add(description, "mode %s",
		                   servo_can_mode_name(message->u.mode.mode));
		if (message->u.mode.torque_clockwise)
			db_description_add(description, ", torque clockwise");
		if (message->u.mode.has_max_speed)
			db_description_add(description, ", at most %u rpm",
			                   message->u.mode.max_speed);
		break;
	case SERVO_CAN_SPEED:
		db_description_add(description, "speed %d rpm", message->u.speed);
		break;
	case SERVO_CAN_CURRENT:
		db_description_add(description, "current ");
		add_current(description, message->u.current);
		break;
	case SERVO_CAN_POSITION:
		db_description_add(description, "internal position %u is %ld counts", slot,
		                   (long)message->u.position);
		break;
	case SERVO_CAN_SET_FEEDBACK:
		db_description_add(description, "the position is %ld counts",
		                   (long)message->u.position);
		break;
	case SERVO_CAN_RAMPS:
		db_description_add(description, "acceleration %lu rpm/s, deceleration %lu rpm/s",
		                   (unsigned long)message->u.ramps.acceleration,
		                   (unsigned long)message->u.ramps.deceleration);
		break;
	case SERVO_CAN_READ:
		describe_read(description, message->u.selector);
		break;
	case SERVO_CAN_WORD_1:
		db_description_add(description, "command word 1 ");
		add_word(description, message->u.word1, NULL);
		break;
	case SERVO_CAN_MOVE:
		db_description_add(description, "move, target %lld steps",
		                   (long long)message->u.target);
		break;
	case SERVO_CAN_WORDS:
	default:
		db_description_add(description, "command words ");
		add_word(description, message->u.words.word0, servo_can_word0_name);
		db_description_add(description, ", ");
		add_word(description, message->u.words.word1, NULL);
		break;
	}
}

static void describe_drive(struct db_description *description,
                           const struct servo_can_message *message)
{
	switch (message->kind) {
	case SERVO_CAN_ACK:
		describe_ack(description, &message->u.ack);
		break;
	case SERVO_CAN_ANSWER_POSITION:
	case SERVO_CAN_REPORT_POSITION:
		db_description_add(description, "position %ld counts", (long)message->u.position);
		break;
	case SERVO_CAN_ANSWER_MOTION:
	case SERVO_CAN_REPORT_MOTION:
		db_description_add(description, "speed %d rpm, current ", message->u.motion.speed);
		add_current(description, message->u.motion.current);
		break;
	case SERVO_CAN_ANSWER_STATUS:
		db_description_add(description, "status ");
		db_description_add_bits(description, servo_can_status_bits, SERVO_CAN_STATUS_BITS,
		                        message->u.status.bits);
		db_description_add(description, ", inputs %02X, outputs %02X",
		                   message->u.status.inputs, message->u.status.outputs);
		break;
	case SERVO_CAN_ANSWER_ANALOGUE:
		db_description_add(description, "analogue input 1 is %u", message->u.analogue);
		break;
	case SERVO_CAN_REPORT_HEALTH:
	default:
		db_description_add(description,
		                   "supply voltage raw %u, temperature raw %u, faults ",
		                   message->u.health.voltage, message->u.health.temperature);
		add_word(description, message->u.health.faults, fault_name);
		break;
	}
}

void servo_can_describe(const struct db_can_frame *frame, const struct servo_can_layout *layout,
                        enum servo_can_side from, struct db_description *description)
{
	struct servo_can_message message;
	enum servo_can_error error = servo_can_decode(frame, layout, from, &message);

	db_description_begin(description);
	if (message.kind == SERVO_CAN_FOREIGN)
		return;
	/* The code of an undocumented acknowledgement is right. */
	if (error != SERVO_CAN_OK &&
	    !(error == SERVO_CAN_ERR_RANGE && message.kind == SERVO_CAN_ACK))
		return;
	/* Node 0 means broadcast. */
	description->address = message.kind == SERVO_CAN_SYNC ? DB_DESCRIBED_ALL : message.node;
	if (from == SERVO_CAN_FROM_HOST)
		describe_host(description, &message, layout->slot);
	else
		describe_drive(description, &message);
}
