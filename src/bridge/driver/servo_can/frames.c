/* SPDX-License-Identifier: Apache-2.0 */
/* Frames to the drive, as exchanges. */
#include "driver/servo_can/frames.h"

#include "driver/servo_can/options.h"
#include "driver/servo_can/servo_can_private.h"

#include <math.h>
#include <string.h>

#define ACK_DATA 3       /* data bytes of the longest acknowledgement, as documented */
#define ANSWER_DATA 4    /* data bytes of the longest answer */
#define FRAME_OVERHEAD 8 /* as answer_length counts a frame */
#define WAY_MAX 9e15     /* largest number of steps that a double counts exactly */

static size_t answer_length(const struct db_device *device, unsigned frames, unsigned data)
{
	return frames * (FRAME_OVERHEAD + (device->layout.padded ? DB_CAN_DATA_MAX : data));
}

unsigned servo_can_count_bits(unsigned bits)
{
	unsigned count = 0;

	for (; bits; bits &= bits - 1)
		count++;
	return count;
}

static bool add_frame(const struct db_device *device, const struct servo_can_message *message,
                      struct db_exchange *exchange)
{
	struct db_can_frame frame;

	if (exchange->request_length + sizeof(frame) > exchange->request_size ||
	    servo_can_encode(message, &device->layout, &frame) != SERVO_CAN_OK)
		return false;
	memcpy(exchange->request + exchange->request_length, &frame, sizeof(frame));
	exchange->request_length += sizeof(frame);
	return true;
}

static enum db_step send_message(struct db_conversation *talk, enum servo_can_step step,
                                 struct servo_can_message message, bool repeatable)
{
	struct db_exchange *exchange = talk->exchange;

	message.node = talk->device->node;
	talk->job->step = (uint16_t)step;
	progress_of(talk)->strange = false;
	exchange->request_length = 0;
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
	exchange->answer_length = answer_length(talk->device, 1, ACK_DATA);
	return add_frame(talk->device, &message, exchange) ? DB_STEP_SEND :
	                                                     end_job(talk, DB_RESULT_UNSUPPORTED);
}

/* After a frame that nothing acknowledges a read follows: its answer shows that the frame was sent,
 * and that the drive is there. */
static enum db_step send_and_read(struct db_conversation *talk, enum servo_can_step step,
                                  struct servo_can_message message, bool repeatable)
{
	struct servo_can_message read = { .kind = SERVO_CAN_READ, .node = talk->device->node };
	enum db_step sent = send_message(talk, step, message, repeatable);

	if (sent != DB_STEP_SEND)
		return sent;
	read.u.selector = (uint8_t)servo_can_selector(SERVO_CAN_ALL_PARTS);
	talk->exchange->answer_length = answer_length(
		talk->device, servo_can_count_bits(SERVO_CAN_ALL_PARTS), ANSWER_DATA);
	return add_frame(talk->device, &read, talk->exchange) ? DB_STEP_SEND :
	                                                        end_job(talk, DB_RESULT_FAILED);
}

enum db_step servo_can_read_parts(struct db_conversation *talk, enum servo_can_step step,
                                  unsigned parts)
{
	struct servo_can_message message = { .kind = SERVO_CAN_READ };
	enum db_step sent;

	message.u.selector = (uint8_t)servo_can_selector(parts);
	sent = send_message(talk, step, message, true);
	talk->exchange->answer_length = answer_length(talk->device, servo_can_count_bits(parts),
	                                              ANSWER_DATA);
	return sent;
}

enum db_step servo_can_read_all(struct db_conversation *talk)
{
	return servo_can_read_parts(talk, STEP_READ, SERVO_CAN_ALL_PARTS);
}

/* --- mode, speed and current ------------------------------------------------------------------ */

enum db_step servo_can_send_mode(struct db_conversation *talk, enum servo_can_mode mode,
                                 const uint16_t *max_speed)
{
	struct servo_can_message message = { .kind = SERVO_CAN_MODE };
	struct db_device *device = talk->device;

	if (!device->may_change_mode)
		return end_job(talk, DB_RESULT_UNSUPPORTED);
	message.u.mode.mode = mode;
	message.u.mode.torque_clockwise = device->torque_clockwise;
	message.u.mode.has_max_speed = max_speed || servo_can_lacks_max_speed(device);
	if (max_speed)
		message.u.mode.max_speed = *max_speed;
	else if (message.u.mode.has_max_speed)
		message.u.mode.max_speed = (uint16_t)device->profile.max_speed;
	/* Until it is acknowledged the drive may be in either mode. */
	if (device->mode != (int)mode)
		device->mode = SERVO_CAN_MODE_NOT_KNOWN;
	return send_message(talk, STEP_MODE, message, true);
}

enum db_step servo_can_send_clear(struct db_conversation *talk, enum servo_can_kind kind)
{
	struct servo_can_message message = { .kind = kind };

	/* Not repeated: some drives do not answer a frame that their mode does not use. */
	return send_message(talk, kind == SERVO_CAN_SPEED ? STEP_CLEAR_SPEED : STEP_CLEAR_CURRENT,
	                    message, false);
}

enum db_step servo_can_send_setpoint(struct db_conversation *talk, int16_t setpoint)
{
	struct servo_can_message message = { .kind = SERVO_CAN_SPEED };
	struct db_device *device = talk->device;
	bool current = device->mode == SERVO_CAN_MODE_CURRENT;

	if (current) {
		message.kind = SERVO_CAN_CURRENT;
		message.u.current = setpoint;
	} else {
		message.u.speed = setpoint;
	}
	progress_of(talk)->setpoint = setpoint;
	progress_of(talk)->before = current ? device->sample.current : device->sample.speed;
	/* It may be in force even if the acknowledgement never arrives. */
	if (setpoint != 0) {
		device->setpoint = setpoint;
		device->setpoint_mode = device->mode;
		device->stopping = false;
	}
	talk->exchange->begins = setpoint != 0 && !device->synchronous;
	return send_message(talk, STEP_SETPOINT, message, true);
}

enum db_step servo_can_send_sync(struct db_conversation *talk)
{
	progress_of(talk)->setpoint = talk->device->setpoint;
	progress_of(talk)->before = talk->device->mode == SERVO_CAN_MODE_CURRENT ?
	                                    talk->device->sample.current :
	                                    talk->device->sample.speed;
	return send_and_read(talk, STEP_SYNC, (struct servo_can_message){ .kind = SERVO_CAN_SYNC },
	                     false);
}

/* --- power, position, command words ----------------------------------------------------------- */

enum db_step servo_can_send_power(struct db_conversation *talk, bool on)
{
	struct servo_can_message message = { .kind = SERVO_CAN_ENABLE };

	message.u.enable = on;
	talk->device->power_taken = !on;
	/* It may have been sent this together with the others already. */
	if (!on && talk->job->kind == DB_JOB_COMMAND)
		talk->device->lost_power = false;
	return send_message(talk, STEP_POWER, message, true);
}

enum db_step servo_can_send_retreat(struct db_conversation *talk)
{
	progress_of(talk)->gives_up = true;
	talk->device->power_taken = true;
	return send_message(talk, STEP_RETREAT,
	                    (struct servo_can_message){ .kind = SERVO_CAN_ENABLE }, true);
}

/* A frame described by the user may have no acknowledgement. */
static enum db_step send_described(struct db_conversation *talk, enum servo_can_step step,
                                   struct servo_can_message message, bool repeatable)
{
	message.node = talk->device->node;
	return servo_can_ack_expected(&message, &talk->device->layout) == SERVO_CAN_ACK_NONE ?
	               send_and_read(talk, step, message, repeatable) :
	               send_message(talk, step, message, repeatable);
}

static enum db_step send_word_frame(struct db_conversation *talk, enum servo_can_step step,
                                    const uint16_t words[2], bool trigger, bool repeatable)
{
	struct servo_can_message message = { .kind = SERVO_CAN_WORDS };

	memcpy(progress_of(talk)->words, words, sizeof(progress_of)(talk)->words);
	message.u.words.word0 = trigger ? words[0] | SERVO_CAN_CTRG : words[0];
	/* Selects the internal position for moves, unless the PLC has selected one. */
	if ((words[0] & SERVO_CAN_POSITIONS) == 0)
		message.u.words.word0 |= (uint16_t)(talk->device->layout.slot * SERVO_CAN_POS0);
	if (!talk->device->layout.word1.set)
		message.u.words.word1 = words[1];
	return send_described(talk, step, message, repeatable);
}

enum db_step servo_can_send_trigger(struct db_conversation *talk, bool up)
{
	talk->exchange->begins = up;
	/* A rise is not repeated blindly: the trigger could have been reset between two. */
	return send_word_frame(talk, up ? STEP_TRIGGER_UP : STEP_TRIGGER_DOWN, talk->device->words,
	                       up, !up);
}

enum db_step servo_can_send_load(struct db_conversation *talk)
{
	talk->device->trigger = LEVEL_HIGH;
	return send_word_frame(talk, STEP_LOAD, talk->device->words, true, false);
}

enum db_step servo_can_send_words(struct db_conversation *talk, const uint16_t words[2])
{
	return send_word_frame(talk, STEP_WORDS, words, talk->device->trigger == LEVEL_HIGH, true);
}

enum db_step servo_can_send_word_1(struct db_conversation *talk, uint16_t word)
{
	struct servo_can_message message = { .kind = SERVO_CAN_WORD_1 };

	message.u.word1 = word;
	progress_of(talk)->words[1] = word;
	return send_described(talk, STEP_WORD_1, message, true);
}

enum db_step servo_can_send_move(struct db_conversation *talk, enum servo_can_step step,
                                 int32_t target)
{
	struct servo_can_message message = { .kind = SERVO_CAN_MOVE };
	const struct db_device *device = talk->device;
	double way = servo_can_turn_position(device, target);
	int bits;

	if (device->move_is_relative)
		way -= servo_can_turn_position(device, device->sample.position);
	way = round(way / device->bus_options->move_frame_scale);
	bits = 8 * device->layout.move.size - 1;
	if (!is_within(way, -exp2(bits), exp2(bits) - 1) || fabs(way) > WAY_MAX)
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	message.u.target = llround(way);
	talk->exchange->begins = step == STEP_MOVE;
	/* Not repeated blindly: its effect is read first. */
	return send_described(talk, step, message, step != STEP_MOVE);
}

enum db_step servo_can_send_position(struct db_conversation *talk, enum servo_can_step step,
                                     int32_t position)
{
	struct servo_can_message message = { .kind = SERVO_CAN_SET_FEEDBACK };
	double steps = servo_can_turn_position(talk->device, position);

	if (step != STEP_FEEDBACK) {
		message.kind = SERVO_CAN_POSITION;
		steps = round(steps / talk->device->options->position_command_scale);
		if (!is_within(steps, INT32_MIN, INT32_MAX))
			return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	}
	message.u.position = (int32_t)steps;
	return send_described(talk, step, message, step != STEP_FEEDBACK);
}

enum db_step servo_can_send_ramps(struct db_conversation *talk, uint32_t acceleration,
                                  uint32_t deceleration)
{
	struct servo_can_message message = { .kind = SERVO_CAN_RAMPS };

	message.u.ramps.acceleration = acceleration;
	message.u.ramps.deceleration = deceleration;
	return send_message(talk, STEP_RAMPS, message, true);
}

bool servo_can_write_interrupt(struct db_device *device, enum db_command command,
                               struct db_exchange *exchange)
{
	struct servo_can_message message = { .node = device->node };
	bool power = command == DB_CMD_DISABLE || !servo_can_is_powered(device);
	struct db_can_frame frame;

	if (!power && servo_can_stops_by_setpoint(device))
		message.kind = device->mode == SERVO_CAN_MODE_CURRENT ? SERVO_CAN_CURRENT :
		                                                        SERVO_CAN_SPEED;
	else if (power || device->going || device->may_begin ||
	         (device->mode != SERVO_CAN_MODE_POSITION && !servo_can_is_at_rest(device)))
		message.kind = SERVO_CAN_ENABLE;
	/* a drive that seems to hold its position keeps its power until that was read */
	else
		return false;
	if (servo_can_encode(&message, &device->layout, &frame) != SERVO_CAN_OK ||
	    exchange->request_size < sizeof(frame))
		return false;
	memcpy(exchange->request, &frame, sizeof(frame));
	exchange->request_length = sizeof(frame);
	exchange->answer_length = 0;
	/* What is read from now on may show it already. */
	device->power_taken |= message.kind == SERVO_CAN_ENABLE;
	return true;
}
