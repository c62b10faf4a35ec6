/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/can_frames.h"

#include <string.h>

/* What is asked behind a read of parameters: another register than a probe's. */
#define GUARD (VSMD_CAN_IDENTITY + 1)

/* --- bursts ---------------------------------------------------------------------------------- */

void vsmd_can_start_burst(struct db_exchange *exchange, bool repeatable)
{
	exchange->request_length = 0;
	exchange->answer_length = 0;
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
}

bool vsmd_can_add_frame(struct db_exchange *exchange, const struct db_can_frame *frame)
{
	if (exchange->request_length + sizeof *frame > exchange->request_size)
		return false;
	memcpy(exchange->request + exchange->request_length, frame, sizeof *frame);
	exchange->request_length += sizeof *frame;
	return true;
}

bool vsmd_can_add_command(const struct vsmd_can_style *style, unsigned drive,
                          const struct vsmd_can_command *command, struct db_exchange *exchange)
{
	struct db_can_frame frame;

	return vsmd_can_encode_command(style, drive, command, &frame) == VSMD_OK &&
	       vsmd_can_add_frame(exchange, &frame);
}

size_t vsmd_can_answer_length(unsigned registers)
{
	size_t frames = (registers + VSMD_CAN_FRAME_REGS - 1) / VSMD_CAN_FRAME_REGS;

	return 8 * frames + 4 * registers;
}

/* The read that ends every burst. */
static enum db_step add_read(struct db_conversation *talk, enum vsmd_can_code code, unsigned first,
                             unsigned count)
{
	struct vsmd_can_command read = {
		.code = code,
		.first = (uint8_t)first,
		.count = (uint8_t)count,
	};

	if (!vsmd_can_add_command(&talk->device->style, talk->device->drive, &read, talk->exchange))
		return end_job(talk, DB_RESULT_UNSUPPORTED);
	talk->exchange->answer_length = vsmd_can_answer_length(count);
	return DB_STEP_SEND;
}

static enum db_step add_whole_status(struct db_conversation *talk)
{
	return add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, VSMD_CAN_STATUS_REGS);
}

static enum db_step add_position_status(struct db_conversation *talk)
{
	return add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_POSITION, 2);
}

bool vsmd_can_lacks_speed(const struct db_device *device)
{
	return device->report == VSMD_CAN_REPORT_POSITION_STATUS;
}

enum db_step vsmd_can_read_status(struct db_conversation *talk)
{
	vsmd_can_start_burst(talk->exchange, true);
	return vsmd_can_lacks_speed(talk->device) ? add_position_status(talk) :
	                                            add_whole_status(talk);
}

static enum db_step add_confirmation(struct db_conversation *talk)
{
	return vsmd_can_lacks_speed(talk->device) ? add_whole_status(talk) :
	                                            add_position_status(talk);
}

/* Models differ in their registers, and a read that touches one that is not there is not answered at
 * all. So one that is there is asked for behind it: when that is answered, nothing more will come. */
enum db_step vsmd_can_add_registers(struct db_conversation *talk, unsigned first, unsigned count)
{
	if (add_read(talk, VSMD_CAN_READ_DATA, first, count) == DB_STEP_DONE ||
	    add_read(talk, VSMD_CAN_READ_STATUS, GUARD, 1) == DB_STEP_DONE)
		return DB_STEP_DONE;
	talk->exchange->answer_length = vsmd_can_answer_length(count) + vsmd_can_answer_length(1);
	return DB_STEP_SEND;
}

enum db_step vsmd_can_read_probe(struct db_conversation *talk)
{
	vsmd_can_start_burst(talk->exchange, true);
	return add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_IDENTITY, 1);
}

/* --- commands -------------------------------------------------------------------------------- */

/* What a shake is to be comes in frames that nothing confirms: each is said twice, so that one that is
 * lost changes nothing. */
static size_t shake_frames(const struct vsmd_command *command, enum vsmd_can_shake start,
                           struct vsmd_can_command *frames)
{
	size_t count = 0;

	for (unsigned i = 0; i < 2; i++) {
		frames[count++] = (struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
			                                     .shake = VSMD_CAN_SHAKE_START_AT,
			                                     .position = command->shake_start };
		frames[count++] = (struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
			                                     .shake = VSMD_CAN_SHAKE_END_AT,
			                                     .position = command->shake_end };
		frames[count++] =
			(struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
			                           .shake = VSMD_CAN_SHAKE_FREQUENCY,
			                           .shake_frequency = command->shake_frequency };
	}
	frames[count++] = (struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
		                                     .shake = start,
		                                     .shake_count = command->shake_count };
	return count;
}

/* The codes of the commands that one frame carries. */
static enum vsmd_can_code code_of(enum vsmd_verb verb)
{
	switch (verb) {
	case VSMD_ENA:
		return VSMD_CAN_ENA;
	case VSMD_OFF:
		return VSMD_CAN_OFF;
	case VSMD_MOV:
		return VSMD_CAN_MOV;
	case VSMD_POS:
		return VSMD_CAN_POS;
	case VSMD_STP:
		return VSMD_CAN_STP;
	case VSMD_ORG:
		return VSMD_CAN_ORG;
	case VSMD_ECLR:
		return VSMD_CAN_ENCODER;
	case VSMD_SENSOR_OUT:
		return VSMD_CAN_OUTPUT;
	case VSMD_SV:
		return VSMD_CAN_SV;
	case VSMD_NMOS:
		return VSMD_CAN_NMOS;
	case VSMD_ZERO_START:
		return VSMD_CAN_ZERO_START;
	case VSMD_ZERO_STOP:
		return VSMD_CAN_ZERO_STOP;
	case VSMD_SAV:
		return VSMD_CAN_SAV;
	default: /* VSMD_SHAKE_STOP */
		return VSMD_CAN_SHAKE;
	}
}

size_t vsmd_can_frames_of(const struct vsmd_command *command, struct vsmd_can_command *frames)
{
	switch (command->verb) {
	case VSMD_STS:
		return 0;
	case VSMD_SHAKE_CYCLES:
		return shake_frames(command, VSMD_CAN_SHAKE_CYCLES, frames);
	case VSMD_SHAKE_TIME:
		return shake_frames(command, VSMD_CAN_SHAKE_TIME, frames);
	default:
		frames[0] = (struct vsmd_can_command){
			.code = code_of(command->verb),
			.has_position = command->verb == VSMD_ORG && command->has_value,
			.has_velocity = command->has_velocity,
			.position = command->position,
			.velocity = command->velocity,
			.port = command->port,
			.value = command->value,
			.shake = VSMD_CAN_SHAKE_STOP,
		};
		return 1;
	}
}

enum db_step vsmd_can_read_identity(struct db_conversation *talk)
{
	return add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_IDENTITY, VSMD_CAN_IDENTITY_REGS);
}

enum db_step vsmd_can_say_command(struct db_conversation *talk, const struct vsmd_command *command,
                                  bool repeatable)
{
	struct vsmd_can_command frames[VSMD_CAN_BURST_MAX - 1];
	size_t count = vsmd_can_frames_of(command, frames);
	struct db_device *device = talk->device;

	if (command->verb == VSMD_ORG || command->verb == VSMD_OFF)
		device->has_base = false;
	vsmd_can_start_burst(talk->exchange, repeatable);
	for (size_t i = 0; i < count; i++) {
		if (!vsmd_can_add_command(&device->style, device->drive, &frames[i],
		                          talk->exchange))
			return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	}
	if (command->verb == VSMD_SAV)
		talk->exchange->extra_time = device->axis.save_time;
	return add_confirmation(talk);
}

enum db_step vsmd_can_look(struct db_conversation *talk, enum vsmd_look what)
{
	vsmd_can_start_burst(talk->exchange, true);
	switch (what) {
	case VSMD_LOOK_SPEED:
		return add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, 1);
	case VSMD_LOOK_POSITION:
		/* A report of the position alone would look like its answer. */
		if (talk->device->report == VSMD_CAN_REPORT_POSITION)
			return add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, 2);
		return add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_POSITION, 1);
	case VSMD_LOOK_STATUS:
	default:
		return add_confirmation(talk);
	}
}

/* --- what must come back ------------------------------------------------------------------------ */

/* The read that the exchange waits for: the last one, or what that one guards. */
static bool find_read(const struct db_device *device, const struct db_exchange *exchange,
                      struct vsmd_can_command *read)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	for (size_t from_end = 1; from_end <= 2; from_end++) {
		size_t offset = from_end * sizeof frame;

		if (exchange->request_length < offset)
			return false;
		memcpy(&frame, exchange->request + exchange->request_length - offset, sizeof frame);
		if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK)
			return false;
		*read = message.command;
		if (read->code != VSMD_CAN_READ_STATUS || read->first != GUARD)
			return true;
	}
	return false;
}

bool vsmd_can_expect_answer(struct db_device *device, const struct db_exchange *exchange)
{
	struct vsmd_can_command read;

	if (device->answer_to == exchange->sending)
		return true;
	if (!find_read(device, exchange, &read))
		return false;
	device->answer_to = exchange->sending;
	device->whole = false;
	return vsmd_can_expect(&device->answer, &device->style, device->drive,
	                       read.code == VSMD_CAN_READ_STATUS ? VSMD_CAN_STATUS_REPLY :
	                                                           VSMD_CAN_DATA_REPLY,
	                       read.first, read.count) == VSMD_OK;
}

enum db_step vsmd_can_collect_answer(struct db_device *device,
                                     const struct vsmd_can_message *message)
{
	bool guarded = device->answer.id.control == VSMD_CAN_DATA_REPLY;

	if (guarded && message->id.control == VSMD_CAN_STATUS_REPLY && message->id.reg == GUARD &&
	    message->count == 1)
		return DB_STEP_DONE;
	switch (vsmd_can_take(&device->answer, message)) {
	case VSMD_CAN_PART:
		return DB_STEP_MORE;
	case VSMD_CAN_WHOLE:
		device->whole = true;
		return guarded ? DB_STEP_MORE : DB_STEP_DONE;
	default:
		return DB_STEP_IGNORE;
	}
}
