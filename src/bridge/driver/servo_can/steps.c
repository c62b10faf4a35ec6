/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The steps of all conversations: what each frame's acknowledgement changes, and what follows when
 * a command is refused or not answered. The next frame is chosen each time from the state of the
 * drive and of the conversation (commands.c, settings.c).
 */
#include "driver/servo_can/servo_can_private.h"

#include "driver/servo_can/frames.h"

#include <string.h>

static enum db_step continue_job(struct db_conversation *talk)
{
	switch (talk->job->kind) {
	case DB_JOB_PROBE:
		return end_job(talk, DB_RESULT_OK);
	case DB_JOB_IDENTIFY:
		return servo_can_continue_identify(talk);
	case DB_JOB_POLL:
		return servo_can_continue_poll(talk);
	case DB_JOB_SETTINGS:
		return servo_can_continue_settings(talk);
	case DB_JOB_COMMAND:
	default:
		return servo_can_continue_command(talk);
	}
}

/* The step sent last counts as done, though the drive may not have accepted it. */
static enum db_step skip_step(struct db_conversation *talk)
{
	progress_of(talk)->done |= 1u << talk->job->step;
	return continue_job(talk);
}

/* --- what was acknowledged -------------------------------------------------------------------- */

/* Decode the frame just acknowledged: the drive now holds these values. */
static struct servo_can_message read_sent(const struct db_conversation *talk)
{
	struct servo_can_message message;
	struct db_can_frame frame;

	memcpy(&frame, talk->exchange->request, sizeof(frame));
	(void)servo_can_decode(&frame, &talk->device->layout, SERVO_CAN_FROM_HOST, &message);
	return message;
}

/* The drive has now what the frame of this step gave it. */
static void take_content(struct db_conversation *talk)
{
	const struct servo_can_progress *progress = progress_of(talk);
	struct db_device *device = talk->device;
	struct servo_can_message sent;

	switch (talk->job->step) {
	case STEP_MODE:
		sent = read_sent(talk);
		device->mode = (int)sent.u.mode.mode;
		if (sent.u.mode.has_max_speed)
			servo_can_remember(device, PARAM_MAX_SPEED, sent.u.mode.max_speed,
			                   talk->now);
		break;
	case STEP_CLEAR_SPEED:
		device->setpoint_known[SERVO_CAN_MODE_SPEED] = true;
		break;
	case STEP_CLEAR_CURRENT:
		device->setpoint_known[SERVO_CAN_MODE_CURRENT] = true;
		break;
	case STEP_SETPOINT:
		device->stop_refused = false;
		device->setpoint = progress->setpoint;
		device->setpoint_mode = device->mode;
		if (device->mode != SERVO_CAN_MODE_NOT_KNOWN)
			device->setpoint_known[device->mode] = true;
		if (device->synchronous)
			device->staged = true;
		break;
	case STEP_TRIGGER_DOWN:
		device->trigger = LEVEL_LOW;
		device->drop_at = 0;
		break;
	case STEP_WORDS:
		memcpy(device->words, progress->words, sizeof(device->words));
		device->words_given = true;
		servo_can_remember_words(device, talk->now);
		break;
	case STEP_WORD_1:
		device->words[1] = progress->words[1];
		device->words_given = true;
		servo_can_remember(device, PARAM_WORD_1, device->words[1], talk->now);
		break;
	case STEP_SYNC:
		device->staged = false;
		break;
	case STEP_RAMPS:
		sent = read_sent(talk);
		servo_can_remember(device, PARAM_ACCELERATION, sent.u.ramps.acceleration,
		                   talk->now);
		servo_can_remember(device, PARAM_DECELERATION, sent.u.ramps.deceleration,
		                   talk->now);
		break;
	default:
		break;
	}
}

static enum db_step take_frame(struct db_conversation *talk)
{
	struct servo_can_progress *progress = progress_of(talk);

	take_content(talk);
	/* A frame sent to all drives is not acknowledged. */
	if (talk->job->kind == DB_JOB_COMMAND && !progress->by_all)
		talk->device->refused = false;
	progress->unanswered = false;
	progress->since = talk->now;
	return skip_step(talk);
}

/* --- what acknowledges something else --------------------------------------------------------- */

static bool is_enable(const struct db_conversation *talk)
{
	return talk->job->kind == DB_JOB_COMMAND && talk->job->request->command == DB_CMD_ENABLE;
}

/*
 * It may be a late acknowledgement of an earlier frame: the right one may still arrive. If it does
 * not, the effect decides or, where there is none to be seen, the frame counts as refused.
 */
static enum db_step doubt_frame(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	progress_of(talk)->strange = true;
	talk->exchange->repeatable = false;
	/* It can be seen at once whether the power is off. */
	if (talk->job->step == STEP_POWER && !is_enable(talk))
		return take_frame(talk);
	/* The next stop switches the power off, which can be seen. */
	if (talk->job->step == STEP_SETPOINT && progress_of(talk)->setpoint == 0)
		device->stop_refused = true;
	return DB_STEP_IGNORE;
}

/* --- what was not answered -------------------------------------------------------------------- */

/* Reads what the drive itself shows. */
static enum db_step lose_motion(struct db_conversation *talk)
{
	struct servo_can_progress *progress = progress_of(talk);

	if (talk->job->step == STEP_SETPOINT || talk->job->step == STEP_POWER)
		progress->since = talk->now;
	progress->unanswered = true;
	progress->done |= 1u << talk->job->step;
	return servo_can_read_all(talk);
}

/* While enabling, the lost setpoint was 0, without which there is no power. */
static enum db_step lose_setpoint(struct db_conversation *talk)
{
	if (is_enable(talk))
		return end_job(talk, DB_RESULT_TIMEOUT);
	if (talk->device->synchronous || progress_of(talk)->gives_up)
		return end_job(talk, DB_RESULT_INDETERMINATE);
	return lose_motion(talk);
}

/* Before enabling: a drive that does not use CTRG is watched when it gets power. */
static enum db_step lose_trigger(struct db_conversation *talk)
{
	return is_enable(talk) ? skip_step(talk) : end_job(talk, DB_RESULT_TIMEOUT);
}

/* Indeterminate if an earlier frame may have started motion. */
static enum db_step lose_read(struct db_conversation *talk)
{
	const unsigned going = 1u << STEP_SETPOINT | 1u << STEP_SYNC | 1u << STEP_TRIGGER_UP |
	                       1u << STEP_MOVE | 1u << STEP_FEEDBACK | 1u << STEP_POWER |
	                       1u << STEP_RETREAT;

	return end_job(talk, (progress_of(talk)->done & going) != 0 ? DB_RESULT_INDETERMINATE :
	                                                              DB_RESULT_TIMEOUT);
}

/* --- the table -------------------------------------------------------------------------------- */

/* `lost` is for commands. Before a clear the drive may not use it in its mode: everything possible
 * was done. */
static const struct conversation_step steps[] = {
	[STEP_READ] = { .answered = skip_step, .lost = lose_read },
	[STEP_ANALOGUE] = { .answered = skip_step },
	[STEP_MODE] = { .answered = take_frame },
	[STEP_CLEAR_SPEED] = { .answered = take_frame, .lost = skip_step },
	[STEP_CLEAR_CURRENT] = { .answered = take_frame, .lost = skip_step },
	[STEP_SETPOINT] = { .answered = take_frame, .lost = lose_setpoint },
	[STEP_DEMAND] = { .answered = take_frame },
	[STEP_TARGET] = { .answered = take_frame },
	[STEP_TRIGGER_DOWN] = { .answered = take_frame, .lost = lose_trigger },
	[STEP_TRIGGER_UP] = { .answered = take_frame, .lost = lose_motion },
	[STEP_WORDS] = { .answered = take_frame },
	[STEP_WORD_1] = { .answered = take_frame },
	[STEP_MOVE] = { .answered = take_frame, .lost = lose_motion },
	[STEP_POWER] = { .answered = take_frame, .lost = lose_motion },
	[STEP_FEEDBACK] = { .answered = take_frame, .lost = lose_motion },
	[STEP_SYNC] = { .answered = take_frame, .lost = end_indeterminate },
	[STEP_RAMPS] = { .answered = take_frame },
	[STEP_LOAD] = { .answered = take_frame, .lost = lose_trigger },
	[STEP_RETREAT] = { .answered = take_frame, .lost = end_indeterminate },
};

/* --- jobs ------------------------------------------------------------------------------------- */

enum db_step servo_can_begin(struct db_conversation *talk)
{
	/* An answer that no other exchange has, so that a late one is not mistaken for it. */
	if (talk->job->kind == DB_JOB_PROBE)
		return servo_can_read_parts(talk, STEP_ANALOGUE, SERVO_CAN_GIVES_ANALOGUE);
	*progress_of(talk) = (struct servo_can_progress){ .since = talk->job->started };
	/* The reaction to a fault is carried out first, in the mode that the drive is probably
	 * in. */
	if (talk->device->lost_power && !talk->device->fault_open &&
	    !(talk->job->kind == DB_JOB_COMMAND && db_command_is_stop(talk->job->request->command)))
		servo_can_take_reset(talk->device);
	if (talk->job->kind == DB_JOB_COMMAND)
		restart_note_command(&talk->device->restart, talk->job->request->command,
		                     talk->now);
	return continue_job(talk);
}

enum db_step servo_can_answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	const struct servo_can_layout *layout = &talk->device->layout;
	const struct db_exchange *exchange = talk->exchange;
	struct servo_can_message message;
	struct servo_can_message asked;
	struct db_can_frame frame;
	enum servo_can_error error;
	bool complete;

	if (length != sizeof(frame))
		return DB_STEP_IGNORE;
	/* The last frame of the request is the one that is answered. */
	memcpy(&frame, exchange->request + exchange->request_length - sizeof(frame), sizeof(frame));
	if (servo_can_decode(&frame, layout, SERVO_CAN_FROM_HOST, &asked) != SERVO_CAN_OK)
		return DB_STEP_IGNORE;
	memcpy(&frame, bytes, sizeof(frame));
	error = servo_can_decode(&frame, layout, SERVO_CAN_FROM_DRIVE, &message);
	if (asked.kind == SERVO_CAN_READ) {
		/* It may have followed a frame that nothing acknowledges. */
		if (error != SERVO_CAN_OK ||
		    !servo_can_take_part(talk->device, exchange->sending,
		                         servo_can_answers(asked.u.selector), &message, talk->now,
		                         &complete))
			return DB_STEP_IGNORE;
		return complete ? steps[talk->job->step].answered(talk) : DB_STEP_MORE;
	}
	/* An undocumented code also acknowledges a frame. */
	if (message.kind != SERVO_CAN_ACK ||
	    (error != SERVO_CAN_OK && error != SERVO_CAN_ERR_RANGE))
		return DB_STEP_IGNORE;
	return message.u.ack.code == servo_can_ack_expected(&asked, layout) ?
	               steps[talk->job->step].answered(talk) :
	               doubt_frame(talk);
}

enum db_step servo_can_lose_answer(struct db_conversation *talk)
{
	bool strange = progress_of(talk)->strange;

	if (strange)
		talk->device->refused = true;
	switch (talk->job->kind) {
	case DB_JOB_COMMAND:
		return strange && !steps[talk->job->step].lost ? end_job(talk, DB_RESULT_REFUSED) :
		                                                 lose_step(talk, steps);
	case DB_JOB_SETTINGS:
		servo_can_forget_settings(talk->device, talk->job->request);
		return end_job(talk, strange ? DB_RESULT_REFUSED : DB_RESULT_TIMEOUT);
	case DB_JOB_IDENTIFY: /* another part of the profile may be accepted */
		return strange ? skip_step(talk) : end_job(talk, DB_RESULT_TIMEOUT);
	default:
		return end_job(talk, DB_RESULT_TIMEOUT);
	}
}

enum db_step servo_can_begun_by_all(struct db_conversation *talk)
{
	progress_of(talk)->by_all = true;
	return steps[talk->job->step].answered(talk);
}
