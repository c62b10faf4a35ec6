/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/can_frames.h"

#include <string.h>

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
	if (exchange->request_length + sizeof(*frame) > exchange->request_size)
		return false;
	memcpy(exchange->request + exchange->request_length, frame, sizeof(*frame));
	exchange->request_length += sizeof(*frame);
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

enum db_step vsmd_can_add_read(struct db_conversation *talk, enum vsmd_can_code code,
                               unsigned first, unsigned count)
{
	unsigned most = talk->device->reads_short ? VSMD_CAN_FRAME_REGS : count;

	for (unsigned at = 0; at < count; at += most) {
		struct vsmd_can_command read = {
			.code = code,
			.first = (uint8_t)(first + at),
			.count = (uint8_t)(count - at < most ? count - at : most),
		};

		if (!vsmd_can_add_command(&talk->device->style, talk->device->drive, &read,
		                          talk->exchange))
			return end_job(talk, DB_RESULT_UNSUPPORTED);
	}
	talk->exchange->answer_length = vsmd_can_answer_length(count);
	return DB_STEP_SEND;
}

enum db_step vsmd_can_add_status(struct db_conversation *talk, bool speed)
{
	return speed ? vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED,
	                                 VSMD_CAN_STATUS_REGS) :
	               vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_POSITION, 2);
}

bool vsmd_can_lacks_speed(const struct db_device *device)
{
	return device->report == VSMD_CAN_REPORT_POSITION_STATUS;
}

bool vsmd_can_lacks_identity(const struct db_device *device)
{
	return device->probe_known && device->probe != VSMD_CAN_PROBE_IDENTITY;
}

unsigned vsmd_can_guard_of(const struct db_device *device)
{
	return vsmd_can_lacks_identity(device) ? VSMD_CAN_STATUS_SPEED : VSMD_CAN_IDENTITY + 1;
}

/* Models differ in their registers, and a read that includes a missing one is not answered at all.
 * So an existing register is read after it: when that is answered, no other answer will follow. */
enum db_step vsmd_can_add_guarded(struct db_conversation *talk, enum vsmd_can_code code,
                                  unsigned first, unsigned count)
{
	if (vsmd_can_add_read(talk, code, first, count) == DB_STEP_DONE ||
	    vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, vsmd_can_guard_of(talk->device), 1) ==
	            DB_STEP_DONE)
		return DB_STEP_DONE;
	talk->exchange->answer_length = vsmd_can_answer_length(count) + vsmd_can_answer_length(1);
	return DB_STEP_SEND;
}

/* --- commands -------------------------------------------------------------------------------- */

/* The codes of the commands that fit into one frame. */
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
	size_t count = 0;

	switch (command->verb) {
	case VSMD_STS:
		break;
	case VSMD_SHAKE_CYCLES:
	case VSMD_SHAKE_TIME:
		/* The parameters of a shake are sent in frames that nothing confirms: each is sent
		 * twice, so that losing one changes nothing. */
		for (unsigned i = 0; i < 2; i++) {
			frames[count++] =
				(struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
				                           .shake = VSMD_CAN_SHAKE_START_AT,
				                           .position = command->shake_start };
			frames[count++] =
				(struct vsmd_can_command){ .code = VSMD_CAN_SHAKE,
				                           .shake = VSMD_CAN_SHAKE_END_AT,
				                           .position = command->shake_end };
			frames[count++] = (struct vsmd_can_command){
				.code = VSMD_CAN_SHAKE,
				.shake = VSMD_CAN_SHAKE_FREQUENCY,
				.shake_frequency = command->shake_frequency,
			};
		}
		frames[count++] = (struct vsmd_can_command){
			.code = VSMD_CAN_SHAKE,
			.shake = command->verb == VSMD_SHAKE_TIME ? VSMD_CAN_SHAKE_TIME :
			                                            VSMD_CAN_SHAKE_CYCLES,
			.shake_count = command->shake_count,
		};
		break;
	default:
		frames[count++] = (struct vsmd_can_command){
			.code = code_of(command->verb),
			.has_position = command->verb == VSMD_ORG && command->has_value,
			.has_velocity = command->has_velocity,
			.position = command->position,
			.velocity = command->velocity,
			.port = command->port,
			.value = command->value,
			.shake = VSMD_CAN_SHAKE_STOP,
		};
		break;
	}
	return count;
}

enum db_step vsmd_can_send_command(struct db_conversation *talk, const struct vsmd_command *command,
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
	return vsmd_can_add_status(talk, vsmd_can_lacks_speed(talk->device));
}

enum db_step vsmd_can_read(struct db_conversation *talk, enum vsmd_read what)
{
	vsmd_can_start_burst(talk->exchange, true);
	switch (what) {
	case VSMD_READ_SPEED:
		return vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED, 1);
	case VSMD_READ_POSITION:
		/* A report of the position alone would look like its answer. */
		if (talk->device->report == VSMD_CAN_REPORT_POSITION)
			return vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_SPEED,
			                         2);
		return vsmd_can_add_read(talk, VSMD_CAN_READ_STATUS, VSMD_CAN_STATUS_POSITION, 1);
	case VSMD_READ_STATUS:
	default:
		return vsmd_can_add_status(talk, vsmd_can_lacks_speed(talk->device));
	}
}

/* --- what must come back ---------------------------------------------------------------------- */

/* The frame at this place from the end of those sent, if it is a read. */
static bool read_sent(const struct db_device *device, const struct db_exchange *exchange,
                      size_t from_end, struct vsmd_can_command *read)
{
	struct vsmd_can_message message;
	struct db_can_frame frame;

	if (exchange->request_length < from_end * sizeof(frame))
		return false;
	memcpy(&frame, exchange->request + exchange->request_length - from_end * sizeof(frame),
	       sizeof(frame));
	if (vsmd_can_decode(&device->style, &frame, &message) != VSMD_OK ||
	    message.id.control != VSMD_CAN_COMMAND ||
	    (message.command.code != VSMD_CAN_READ_STATUS &&
	     message.command.code != VSMD_CAN_READ_DATA))
		return false;
	*read = message.command;
	return true;
}

bool vsmd_can_expect_answer(struct db_device *device, const struct db_exchange *exchange)
{
	struct vsmd_can_command before;
	struct vsmd_can_command read;
	size_t from_end = 1;

	if (device->answer_to == exchange->sending)
		return true;
	/* The read that the exchange waits for is the last one, or the one that it guards, with all
	 * its parts. */
	device->guarded = false;
	if (!read_sent(device, exchange, from_end++, &read))
		return false;
	while (read_sent(device, exchange, from_end++, &before)) {
		if (before.code == read.code && before.first + before.count == read.first) {
			before.count = (uint8_t)(before.count + read.count);
		} else if (device->guarded) {
			break;
		} else {
			device->guarded = true;
		}
		read = before;
	}
	device->answer_to = exchange->sending;
	device->whole = false;
	if (vsmd_can_expect(&device->answer, &device->style, device->drive,
	                    read.code == VSMD_CAN_READ_STATUS ? VSMD_CAN_STATUS_REPLY :
	                                                        VSMD_CAN_DATA_REPLY,
	                    read.first, read.count) != VSMD_OK)
		return false;
	device->answer.forms = device->forms;
	return true;
}

enum db_step vsmd_can_collect_answer(struct db_device *device,
                                     const struct vsmd_can_message *message)
{
	enum vsmd_can_took took;

	if (device->guarded && message->id.control == VSMD_CAN_STATUS_REPLY &&
	    message->id.reg == vsmd_can_guard_of(device) &&
	    (message->count == 1 || (device->forms & VSMD_CAN_PADDED)))
		return DB_STEP_DONE;
	took = vsmd_can_take(&device->answer, message);
	device->forms = device->answer.forms;
	switch (took) {
	case VSMD_CAN_PART:
		return DB_STEP_MORE;
	case VSMD_CAN_WHOLE:
		device->whole = true;
		return device->guarded ? DB_STEP_MORE : DB_STEP_DONE;
	default:
		return DB_STEP_IGNORE;
	}
}
