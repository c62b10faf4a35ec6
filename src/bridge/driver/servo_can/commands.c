/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Commands and the reaction to a fault. Each has a function that sends what is still missing, given
 * the state of the drive and of the conversation; it is called again after each answer. No frame
 * that starts a motion is sent before a fresh status showed power, no fault and, where it matters,
 * standstill.
 *
 * An acknowledgement shows that a frame arrived. So after it the drive is read until the effect
 * shows, for as long as its reaction may take. If a position move does not show, the motor's power
 * is switched off, so that the move cannot begin later, and the move has failed; a speed or current
 * that does not show (a blocked motor, a slow ramp) is unproven.
 */
#include "driver/servo_can/servo_can_private.h"

#include "driver/servo_can/frames.h"
#include "driver/servo_can/options.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RESENDS_MAX 2

/* A speed or current differing by at most one part in this number from the setpoint shows that it
 * was obeyed. */
#define NEAR 20

static bool took_too_long(const struct db_conversation *talk)
{
	return talk->now - progress_of(talk)->since > talk->device->reaction;
}

/* True if the power must be switched off because of a fault. Where speed or current 0 stops the
 * motor, this is not needed. */
static bool fault_takes_power(const struct db_device *device)
{
	if (device->options->on_fault == SERVO_CAN_ON_FAULT_NONE)
		return false;
	return device->options->on_fault == SERVO_CAN_ON_FAULT_DISABLE ||
	       !servo_can_stops_by_setpoint(device);
}

/* --- power ------------------------------------------------------------------------------------ */

/* If the power is off, the job ends with `result`; else it ends as `not_seen`. */
static enum db_step confirm_no_power(struct db_conversation *talk, enum db_result result,
                                     enum db_result not_seen)
{
	struct db_device *device = talk->device;

	if (talk->job->step == STEP_POWER || talk->job->step == STEP_RETREAT)
		return servo_can_read_all(talk);
	if (servo_can_is_powered(device))
		return took_too_long(talk) ? end_job(talk, not_seen) : servo_can_read_all(talk);
	device->going = false;
	device->has_target = false;
	/* Without power the trigger has no effect: it is reset now, so that the next move can raise
	 * it. */
	if (talk->device->trigger != LEVEL_HIGH || progress_of(talk)->dropped)
		return end_job(talk, result);
	/* Tried once: a stop does not depend on it, and every move makes sure that the trigger is
	 * low. */
	progress_of(talk)->dropped = true;
	talk->device->trigger = LEVEL_NOT_KNOWN;
	return servo_can_send_trigger(talk, false);
}

/* A command reported as failed must not begin any more: without power it cannot. */
static enum db_step confirm_retreat(struct db_conversation *talk)
{
	return confirm_no_power(talk, DB_RESULT_FAILED, DB_RESULT_INDETERMINATE);
}

/* Another program may have left a speed or a current: it is set to 0, if the drive accepts that
 * now. */
static bool sends_clear(struct db_conversation *talk, enum servo_can_mode mode, enum db_step *step)
{
	bool current = mode == SERVO_CAN_MODE_CURRENT;

	if (mode == SERVO_CAN_MODE_POSITION ||
	    is_done(talk, current ? STEP_CLEAR_CURRENT : STEP_CLEAR_SPEED))
		return false;
	*step = servo_can_send_clear(talk, current ? SERVO_CAN_CURRENT : SERVO_CAN_SPEED);
	return true;
}

/* The last speed or current sent by the bridge is set to 0, in its own mode. */
static bool sends_old_setpoint_0(struct db_conversation *talk, enum db_step *step)
{
	struct db_device *device = talk->device;

	if (device->setpoint == 0 && !(device->synchronous && device->staged))
		return false;
	/* Only a sync frame makes a 0 effective, and whatever else that starts is up to the PLC. */
	if (device->synchronous)
		*step = end_job(talk, DB_RESULT_BUSY);
	else if (device->mode == device->setpoint_mode)
		*step = servo_can_send_setpoint(talk, 0);
	else
		*step = servo_can_send_mode(talk, (enum servo_can_mode)device->setpoint_mode, NULL);
	return true;
}

/* Sent whatever the drive's state seems to be: a drive that was reset unnoticed may have another
 * setpoint. It must accept the frame in the mode that it has just been given; in a mode that is
 * only assumed it may not use it. */
static bool sends_setpoint_0(struct db_conversation *talk, enum db_step *step)
{
	struct db_device *device = talk->device;

	if (device->synchronous || device->mode == SERVO_CAN_MODE_POSITION)
		return false;
	if (device->mode == SERVO_CAN_MODE_NOT_KNOWN)
		return sends_clear(talk, SERVO_CAN_MODE_SPEED, step) ||
		       sends_clear(talk, SERVO_CAN_MODE_CURRENT, step);
	if (is_done(talk, STEP_SETPOINT) && device->setpoint_mode == device->mode)
		return false;
	if (!is_done(talk, STEP_MODE))
		return sends_clear(talk, (enum servo_can_mode)device->mode, step);
	*step = servo_can_send_setpoint(talk, 0);
	return true;
}

/* Where moves have their own frame, that frame sets the demand, but a motor with power would move
 * there. */
static enum db_step send_demand(struct db_conversation *talk, int32_t position)
{
	const struct db_device *device = talk->device;
	bool moves = servo_can_is_powered(device) && position != device->sample.position;

	return device->layout.move.set && !device->move_is_relative && !moves ?
	               servo_can_send_move(talk, STEP_DEMAND, position) :
	               servo_can_send_position(talk, STEP_DEMAND, position);
}

/* The position to be held is the one where the motor stands, whatever was commanded before. */
static bool sends_demand(struct db_conversation *talk, enum db_step *step)
{
	if (is_done(talk, STEP_DEMAND))
		return false;
	*step = send_demand(talk, talk->device->sample.position);
	return true;
}

/* Some drives accept a demand only when CTRG rises. Without power that moves nothing. Afterwards
 * CTRG is reset. */
static bool sends_load(struct db_conversation *talk, enum db_step *step)
{
	struct db_device *device = talk->device;

	if (!device->layout.words.set || device->layout.move.set ||
	    (device->words[0] & SERVO_CAN_POSITIONS) != 0)
		return false;
	if (!is_done(talk, STEP_LOAD)) {
		*step = servo_can_send_load(talk);
		return true;
	}
	if (device->trigger != LEVEL_HIGH || progress_of(talk)->dropped)
		return false;
	progress_of(talk)->dropped = true;
	*step = servo_can_send_trigger(talk, false);
	return true;
}

/* A motor that gets power must not move: mode, setpoint and demand are sent each time, because a
 * drive that was reset for a moment has its own. */
static bool sends_before_power(struct db_conversation *talk, enum db_step *step)
{
	const struct db_device *device = talk->device;
	bool by_position;

	if (sends_old_setpoint_0(talk, step) || servo_can_sends_all(talk, step) ||
	    sends_setpoint_0(talk, step))
		return true;
	by_position = device->mode != SERVO_CAN_MODE_SPEED &&
	              device->mode != SERVO_CAN_MODE_CURRENT;
	/* A trigger that another program left high could not rise. Tried once: the drive's reaction
	 * is watched. */
	if ((device->trigger == LEVEL_HIGH ||
	     (by_position && device->trigger != LEVEL_LOW && device->layout.words.set)) &&
	    !is_done(talk, STEP_TRIGGER_DOWN) && !is_done(talk, STEP_LOAD)) {
		*step = servo_can_send_trigger(talk, false);
		return true;
	}
	return by_position && (sends_demand(talk, step) || sends_load(talk, step));
}

/* True if the motor moves unintentionally. A motor that turned when it got power may come to rest
 * first. */
static bool goes_astray(struct db_conversation *talk)
{
	struct servo_can_progress *progress = progress_of(talk);
	const struct db_device *device = talk->device;
	int speed = abs(device->sample.speed);

	if (progress->ran_out)
		return fabs((double)device->sample.position - (double)progress->from) >
		       device->power_window;
	if (speed > abs(progress->before) + device->standstill_speed)
		return true;
	progress->before = device->sample.speed;
	progress->from = device->sample.position;
	progress->ran_out = servo_can_stands(device);
	return false;
}

/* Watched for as long as the drive may take to begin a motion. */
static enum db_step confirm_enable(struct db_conversation *talk)
{
	struct servo_can_progress *progress = progress_of(talk);
	struct db_device *device = talk->device;
	bool powered = servo_can_is_powered(device);

	if (talk->job->step == STEP_POWER)
		return servo_can_read_all(talk);
	if (powered && progress->had_power)
		return end_job(talk, DB_RESULT_OK);
	if (goes_astray(talk) || (progress->has_power && !powered) ||
	    (powered && servo_can_shows_fault(device) && fault_takes_power(device)))
		return servo_can_send_retreat(talk);
	if (powered && !progress->has_power) {
		progress->has_power = true;
		progress->since = talk->now;
	}
	/* A stop that arrives now must not assume that the motor stands for good. */
	device->may_begin = !took_too_long(talk);
	if (device->may_begin) {
		/* Others may go before it: this is repeated for some time. */
		talk->exchange->again = true;
		return servo_can_read_all(talk);
	}
	return powered ? end_job(talk, DB_RESULT_OK) : servo_can_send_retreat(talk);
}

static enum db_step continue_enable(struct db_conversation *talk)
{
	struct servo_can_progress *progress = progress_of(talk);
	const struct db_device *device = talk->device;
	enum db_step step;

	if (!is_done(talk, STEP_READ))
		return servo_can_read_all(talk);
	if (is_done(talk, STEP_RETREAT))
		return confirm_retreat(talk);
	if (is_done(talk, STEP_POWER))
		return confirm_enable(talk);
	if (!servo_can_is_powered(talk->device) && sends_before_power(talk, &step))
		return step;
	progress->had_power = servo_can_is_powered(device);
	progress->ran_out = servo_can_stands(device);
	progress->from = device->sample.position;
	progress->before = device->sample.speed;
	return servo_can_send_power(talk, true);
}

/* --- stops ------------------------------------------------------------------------------------ */

static enum db_step continue_stop(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	if (is_done(talk, STEP_POWER))
		return confirm_no_power(talk, DB_RESULT_OK, DB_RESULT_FAILED);
	if (is_done(talk, STEP_SETPOINT)) {
		device->stopping = !servo_can_stands(device);
		return end_job(talk, DB_RESULT_OK);
	}
	device->has_target = false;
	if (servo_can_stops_by_setpoint(device) && servo_can_is_powered(device))
		return servo_can_send_setpoint(talk, 0);
	if (device->mode != SERVO_CAN_MODE_POSITION || device->going || device->may_begin)
		return servo_can_send_power(talk, false);
	if (!is_done(talk, STEP_READ))
		return servo_can_read_all(talk);
	return !servo_can_is_powered(device) || servo_can_is_at_rest(device) ?
	               end_job(talk, DB_RESULT_OK) :
	               servo_can_send_power(talk, false);
}

/* --- speed and current ------------------------------------------------------------------------ */

/* True if the measured value follows the setpoint. */
static bool follows_setpoint(const struct db_conversation *talk)
{
	const struct servo_can_sample *sample = &talk->device->sample;
	bool current = talk->device->mode == SERVO_CAN_MODE_CURRENT;
	int noise = current ? 0 : talk->device->standstill_speed;
	int is = current ? sample->current : sample->speed;
	int was = progress_of(talk)->before;
	double scale = current ? talk->device->current_command_scale / talk->device->current_scale :
	                         talk->device->speed_command_scale / talk->device->speed_scale;
	int wanted = (int)lrint(progress_of(talk)->setpoint * scale);

	if (progress_of(talk)->setpoint == 0)
		return abs(is) < abs(was) || is == 0 ||
		       (!current && servo_can_stands(talk->device));
	if (is != 0 && abs(is - wanted) <= abs(wanted) / NEAR)
		return true;
	return wanted > was ? is > was + noise : is < was - noise;
}

static enum db_step prove_setpoint(struct db_conversation *talk, enum servo_can_mode mode)
{
	struct servo_can_progress *progress = progress_of(talk);
	struct db_device *device = talk->device;
	bool has_no_power = progress->setpoint != 0 && !servo_can_is_powered(device);

	if (progress->gives_up)
		return end_job(talk, DB_RESULT_FAILED);
	/* The setpoint waits for a sync frame, and nothing shows that. */
	if (device->staged)
		return end_job(talk, DB_RESULT_UNPROVEN);
	if (talk->job->step == STEP_SETPOINT)
		return servo_can_read_all(talk);
	if (follows_setpoint(talk))
		return end_job(talk, DB_RESULT_OK);
	if (!has_no_power && !took_too_long(talk))
		return servo_can_read_all(talk);
	/* For a frame to all drives not even its arrival is known. The setpoint is 0 before the
	 * command is reported as failed; where the mode is no longer known, the power is switched
	 * off. */
	if (has_no_power || progress->by_all) {
		progress->gives_up = true;
		return device->mode == (int)mode ? servo_can_send_setpoint(talk, 0) :
		                                   servo_can_send_retreat(talk);
	}
	return end_job(talk, progress->unanswered ? DB_RESULT_INDETERMINATE : DB_RESULT_UNPROVEN);
}

/* A setpoint left by another program must not be effective in the new mode, not even for one
 * frame's time. */
static enum db_step change_mode(struct db_conversation *talk, enum servo_can_mode mode)
{
	enum db_step step;

	if (!servo_can_is_powered(talk->device))
		return end_job(talk, DB_RESULT_REFUSED);
	if (!servo_can_is_at_rest(talk->device))
		return end_job(talk, DB_RESULT_BUSY);
	if (mode == SERVO_CAN_MODE_POSITION && sends_demand(talk, &step))
		return step;
	if (!talk->device->synchronous && !talk->device->setpoint_known[mode] &&
	    sends_clear(talk, mode, &step))
		return step;
	return servo_can_send_mode(talk, mode, NULL);
}

static enum db_step continue_setpoint(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	const struct db_args *args = talk->job->request->args;
	bool current = talk->job->request->command == DB_CMD_MOVE_CURRENT;
	enum servo_can_mode mode = current ? SERVO_CAN_MODE_CURRENT : SERVO_CAN_MODE_SPEED;
	double steps = current ? (double)args->target_current / device->current_command_scale :
	                         (double)args->target_velocity / device->speed_command_scale;
	int16_t setpoint = (int16_t)lrint(steps);

	if (is_done(talk, STEP_RETREAT))
		return confirm_retreat(talk);
	if (is_done(talk, STEP_SETPOINT)) {
		device->has_target = false;
		return prove_setpoint(talk, mode);
	}
	/* 0 in the drive's mode is as good as a stop: it is sent without waiting. */
	if (device->mode == (int)mode && setpoint == 0)
		return servo_can_send_setpoint(talk, 0);
	if (!is_done(talk, STEP_READ))
		return servo_can_read_all(talk);
	/* Without power, or with a fault, the motion would begin when the power returns or the
	 * fault ends. */
	if (setpoint != 0 && (!servo_can_is_powered(device) || servo_can_has_fault(device)))
		return end_job(talk, DB_RESULT_REFUSED);
	return device->mode == (int)mode ? servo_can_send_setpoint(talk, setpoint) :
	                                   change_mode(talk, mode);
}

/* --- position --------------------------------------------------------------------------------- */

/* The drive's present state was read: decides whether a position move may begin. Its target is
 * fixed here, once. */
static enum db_result check_move(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	int64_t target = talk->job->request->args->target_position;

	/* With another internal position selected CTRG would start a move to a place that the
	 * bridge does not know. */
	if (!servo_can_is_powered(device) ||
	    (!device->layout.move.set && (device->words[0] & SERVO_CAN_POSITIONS) != 0))
		return DB_RESULT_REFUSED;
	if (!servo_can_is_at_rest(device))
		return DB_RESULT_BUSY;
	if (talk->job->request->command == DB_CMD_MOVE_RELATIVE)
		target += device->sample.position;
	if (target < INT32_MIN || target > INT32_MAX)
		return DB_RESULT_OUT_OF_RANGE;
	progress_of(talk)->target = (int32_t)target;
	progress_of(talk)->from = device->sample.position;
	progress_of(talk)->checked = true;
	return DB_RESULT_OK;
}

/* True if it has arrived, or come nearer. */
static bool follows_target(const struct db_conversation *talk)
{
	const struct db_device *device = talk->device;
	double noise = fmax(device->window, 1.0);
	double gone = (double)device->sample.position - (double)progress_of(talk)->from;
	double way = (double)progress_of(talk)->target - (double)progress_of(talk)->from;

	if (servo_can_is_at(device, progress_of(talk)->target))
		return true;
	if (!servo_can_stands(device))
		return (device->sample.speed > 0) == (way > 0);
	return way > 0 ? gone > noise : gone < -noise;
}

static enum db_step begin_move(struct db_conversation *talk)
{
	struct db_device *device = talk->device;

	/* It may begin even if the acknowledgement never arrives. */
	device->going = true;
	device->may_begin = true;
	device->seen_at = device->sample.position;
	device->seen_moving = talk->now;
	device->stopping = false;
	device->has_target = true;
	device->target = progress_of(talk)->target;
	if (device->layout.move.set)
		return servo_can_send_move(talk, STEP_MOVE, device->target);
	device->trigger = LEVEL_HIGH;
	return servo_can_send_trigger(talk, true);
}

/* A move that does not show may still begin later: it is reported as failed when it no longer
 * can. */
static enum db_step give_up_move(struct db_conversation *talk)
{
	return talk->device->follows_late && servo_can_is_powered(talk->device) ?
	               end_job(talk, DB_RESULT_INDETERMINATE) :
	               servo_can_send_retreat(talk);
}

static enum db_step prove_move(struct db_conversation *talk)
{
	/* The same relative way twice is a different move. */
	bool once = talk->device->layout.move.set && talk->device->move_is_relative;

	if (talk->job->step == STEP_TRIGGER_UP || talk->job->step == STEP_MOVE)
		return servo_can_read_all(talk);
	if (follows_target(talk)) {
		talk->device->may_begin = false;
		return end_job(talk, DB_RESULT_OK);
	}
	if (!servo_can_is_powered(talk->device))
		return give_up_move(talk);
	/* If CTRG is high already it does not rise again. */
	if (progress_of(talk)->unanswered && !once)
		return progress_of(talk)->resends++ < RESENDS_MAX ?
		               begin_move(talk) :
		               end_job(talk, DB_RESULT_INDETERMINATE);
	return took_too_long(talk) ? give_up_move(talk) : servo_can_read_all(talk);
}

/* Sends the next frame of a position move: whatever is still missing. */
static enum db_step continue_position(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	enum db_result checked;

	if (is_done(talk, STEP_RETREAT))
		return confirm_retreat(talk);
	if (is_done(talk, STEP_TRIGGER_UP) || is_done(talk, STEP_MOVE))
		return prove_move(talk);
	if (!is_done(talk, STEP_READ))
		return servo_can_read_all(talk);
	if (servo_can_has_fault(device))
		return end_job(talk, DB_RESULT_REFUSED);
	if (!progress_of(talk)->checked) {
		checked = check_move(talk);
		if (checked != DB_RESULT_OK)
			return end_job(talk, checked);
	}
	if (device->mode != SERVO_CAN_MODE_POSITION)
		return change_mode(talk, SERVO_CAN_MODE_POSITION);
	if (device->layout.move.set)
		return begin_move(talk);
	if (device->trigger != LEVEL_LOW && !is_done(talk, STEP_TARGET))
		return servo_can_send_trigger(talk, false);
	if (!is_done(talk, STEP_TARGET))
		return servo_can_send_position(talk, STEP_TARGET, progress_of(talk)->target);
	return begin_move(talk);
}

/* --- set_position ----------------------------------------------------------------------------- */

static enum db_step prove_feedback(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	int32_t wanted = talk->job->request->args->target_position;

	if (talk->job->step == STEP_FEEDBACK)
		return servo_can_read_all(talk);
	if (servo_can_stands(device) && servo_can_is_at(device, wanted)) {
		device->has_target = false;
		restart_note_placed(&device->restart, device->sample.position);
		return end_job(talk, DB_RESULT_OK);
	}
	if (!progress_of(talk)->unanswered)
		return took_too_long(talk) ? end_job(talk, DB_RESULT_FAILED) :
		                             servo_can_read_all(talk);
	if (!servo_can_stands(device) || device->sample.position != progress_of(talk)->from ||
	    progress_of(talk)->resends++ >= RESENDS_MAX)
		return end_job(talk, DB_RESULT_INDETERMINATE);
	return servo_can_send_position(talk, STEP_FEEDBACK, wanted);
}

/* Demand and position become equal, so that nothing jumps when the position is held again. */
static enum db_step continue_set_position(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	int32_t wanted = talk->job->request->args->target_position;
	bool held = device->mode != SERVO_CAN_MODE_SPEED && device->mode != SERVO_CAN_MODE_CURRENT;

	if (is_done(talk, STEP_FEEDBACK))
		return prove_feedback(talk);
	if (!is_done(talk, STEP_READ))
		return servo_can_read_all(talk);
	if (servo_can_is_powered(device) && held)
		return end_job(talk, DB_RESULT_REFUSED);
	if (!servo_can_is_at_rest(device))
		return end_job(talk, DB_RESULT_BUSY);
	if (!is_done(talk, STEP_DEMAND))
		return send_demand(talk, wanted);
	progress_of(talk)->from = device->sample.position;
	return servo_can_send_position(talk, STEP_FEEDBACK, wanted);
}

/* --- commands --------------------------------------------------------------------------------- */

enum db_step servo_can_continue_command(struct db_conversation *talk)
{
	switch (talk->job->request->command) {
	case DB_CMD_ENABLE:
		return continue_enable(talk);
	case DB_CMD_DISABLE:
		return is_done(talk, STEP_POWER) ?
		               confirm_no_power(talk, DB_RESULT_OK, DB_RESULT_FAILED) :
		               servo_can_send_power(talk, false);
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		return continue_stop(talk);
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_CURRENT:
		return continue_setpoint(talk);
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		return continue_position(talk);
	case DB_CMD_SET_POSITION:
		return continue_set_position(talk);
	case DB_CMD_SYNC_START:
		if (!is_done(talk, STEP_SYNC))
			return servo_can_send_sync(talk);
		if (follows_setpoint(talk))
			return end_job(talk, DB_RESULT_OK);
		return took_too_long(talk) ? end_job(talk, DB_RESULT_UNPROVEN) :
		                             servo_can_read_all(talk);
	case DB_CMD_READ_PARAMETERS:
		if (!is_done(talk, STEP_READ))
			return servo_can_read_all(talk);
		/* There are no parameters that could be read. */
		talk->device->params_valid = true;
		return end_job(talk, DB_RESULT_OK);
	default: /* clear_fault: no fault reset, the latch is the bridge's; ends a doubt */
		return end_job(talk, restart_settle(&talk->device->restart) ?
		                             DB_RESULT_OK :
		                             DB_RESULT_UNSUPPORTED);
	}
}

/* --- polls and faults ------------------------------------------------------------------------- */

#define ANALOGUE_INTERVAL (100 * DB_NS_PER_MS)
/* How soon CTRG is reset again, the second time and from then on, where nothing acknowledges that:
 * a poll that ends with a loss is no evidence that a drive stands. */
#define DROP_AGAIN (1 * DB_NS_PER_S)

/* No motion may begin by itself when the fault is gone. Sent again with each poll until this is
 * ensured. */
static bool sends_because_of_fault(struct db_conversation *talk, enum db_step *step)
{
	struct db_device *device = talk->device;

	if (!device->fault_open)
		return false;
	/* The power first: it can be seen, and the drive's reaction to the 0 does not delay it.
	 * Also when it has none now: some drives restore it by themselves when the fault is
	 * gone. */
	if (fault_takes_power(device) && !is_done(talk, STEP_POWER)) {
		*step = servo_can_send_power(talk, false);
		return true;
	}
	if (servo_can_obeys_setpoint(device) && !is_done(talk, STEP_SETPOINT) &&
	    (device->setpoint != 0 || !device->setpoint_known[device->mode])) {
		*step = servo_can_send_setpoint(talk, 0);
		return true;
	}
	if (is_done(talk, STEP_POWER) && !progress_of(talk)->power_read) {
		progress_of(talk)->power_read = true;
		*step = servo_can_read_all(talk);
		return true;
	}
	device->fault_open = fault_takes_power(device) && servo_can_is_powered(device);
	if (!device->fault_open && !servo_can_is_powered(device))
		device->has_target = false;
	return false;
}

enum db_step servo_can_continue_poll(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	enum db_step step;

	if (!is_done(talk, STEP_READ))
		return servo_can_read_parts(talk, STEP_READ,
		                            servo_can_reports_often(device, talk->now) ?
		                                    SERVO_CAN_GIVES_STATUS :
		                                    SERVO_CAN_ALL_PARTS);
	if (talk->job->step == STEP_ANALOGUE)
		return end_job(talk, DB_RESULT_OK);
	if (sends_because_of_fault(talk, &step))
		return step;
	if (device->trigger == LEVEL_HIGH && !device->going && talk->now >= device->drop_at) {
		device->drop_at = talk->now + (device->drop_at != 0 ? DROP_AGAIN : 0);
		return servo_can_send_trigger(talk, false);
	}
	if (device->analogue_at == 0 || talk->now - device->analogue_at >= ANALOGUE_INTERVAL)
		return servo_can_read_parts(talk, STEP_ANALOGUE, SERVO_CAN_GIVES_ANALOGUE);
	return end_job(talk, DB_RESULT_OK);
}
