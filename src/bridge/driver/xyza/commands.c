/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

#include <math.h>

/* This number of samples in a row shows a speed; and at least this number is read before it counts
 * as ignored. */
#define SPEED_NEAR 2
#define SPEED_SAMPLES 4
/* How long it may come no nearer, in addition to the time in which an effect shows. */
#define SPEED_TIME DB_NS_PER_S

/* How long an axis may continue after a stop without slowing down. */
#define STOP_TIME (2 * DB_NS_PER_S)

/* Between two writes of a position it is neither the old one nor the new one. */
#define HOLD_TIME (500 * DB_NS_PER_MS)

/* Number of repeats of a jog whose answer was lost, or that was refused. */
#define RESENDS_MAX 2
#define REFUSALS_MAX 1

/* Number of repeats of a write without effect. */
#define REWRITES_MAX 2

static struct xyza_plan *plan_of(const struct db_conversation *talk)
{
	const struct db_job *job = talk->job;

	return job->kind == DB_JOB_COMMAND && db_command_is_stop(job->request->command) ?
	               &talk->device->stop :
	               &talk->device->front;
}

static struct xyza_step *step_of(const struct db_conversation *talk)
{
	const struct xyza_plan *plan = plan_of(talk);

	return &plan->steps[plan->at];
}

/* --- going through a plan --------------------------------------------------------------------- */

static enum db_step send_planned(struct db_conversation *talk)
{
	const struct xyza_request *request = &step_of(talk)->request;
	const struct db_job *job = talk->job;
	bool repeatable = true; /* after its answer was lost, sending it again can do no harm */

	switch (request->verb) {
	case XYZA_MANUAL_JOG:
	case XYZA_PROGRAM_START:
	case XYZA_PROGRAM_CONTINUE:
	case XYZA_PROGRAM_END:
		repeatable = false;
		break;
	case XYZA_PROGRAM_STOP:
		/* A second stop may end a program that the first one has paused, which is no harm
		 * when it was to stop anyway. */
		repeatable = job->kind != DB_JOB_COMMAND ||
		             job->request->command != DB_CMD_PAUSE_PROGRAM;
		break;
	default:
		break;
	}
	if (!xyza_is_read(request->verb))
		plan_of(talk)->acted = true;
	return xyza_send(talk, *request, repeatable);
}

/* Sends the plan's current step. */
static enum db_step send_current(struct db_conversation *talk)
{
	return send_step(talk, xyza_plan_steps, step_of(talk)->kind);
}

/* The expected effect does not show yet. */
static enum db_step ask_again(struct db_conversation *talk)
{
	talk->exchange->again = true;
	return send_current(talk);
}

static enum db_step refuse_job(struct db_conversation *talk)
{
	talk->device->refused = true;
	if (talk->job->kind == DB_JOB_SETTINGS)
		talk->device->plate.doubtful = true;
	return end_job(talk, DB_RESULT_REFUSED);
}

/* Sends the next step. When the plan is complete the next parameter's plan follows, or the job
 * ends. */
static enum db_step send_next(struct db_conversation *talk)
{
	const struct db_request *request = talk->job->request;
	struct xyza_plan *plan = plan_of(talk);
	struct db_device *device = talk->device;

	plan->at++;
	plan->entered = 0;
	if (plan->at != plan->count)
		return send_current(talk);
	device->refused = false;
	if (talk->job->kind == DB_JOB_COMMAND) {
		switch (request->command) {
		case DB_CMD_STOP:
		case DB_CMD_QUICK_STOP:
			xyza_note_stopped(device->first);
			break;
		case DB_CMD_SET_POSITION:
			device->position = request->args->target_position;
			device->negative = device->position < 0;
			device->held_until = 0;
			restart_note_placed(&device->restart, device->position);
			break;
		case DB_CMD_START_PROGRAM:
			device->first->delayed = request->args->program_delay > 0;
			break;
		default:
			break;
		}
	} else if (plan->setting + 1 < request->setting_count) {
		plan->setting++;
		xyza_plan_setting(plan, device, &request->settings[plan->setting]);
		return send_current(talk);
	}
	return end_job(talk, plan->unproven ? DB_RESULT_UNPROVEN : DB_RESULT_OK);
}

static enum db_step repeat_steps(struct db_conversation *talk, unsigned steps)
{
	plan_of(talk)->at -= steps;
	return send_current(talk);
}

/* True if the effect may still show. */
static bool may_still_show(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);

	if (plan->entered == 0)
		plan->entered = talk->now;
	return talk->now - plan->entered < talk->device->reaction;
}

/* True if the reading is what the step expects. */
static bool is_wanted(const struct db_conversation *talk)
{
	const struct xyza_step *step = step_of(talk);

	return ((xyza_content(talk->reply) ^ step->wanted) & step->mask) == 0;
}

/* True if a read follows that decides what a refusal or a lost answer means. */
static bool is_proven_next(const struct xyza_plan *plan)
{
	return plan->at + 1 < plan->count &&
	       (plan->steps[plan->at + 1].kind == STEP_EXPECT_MOVING ||
	        plan->steps[plan->at + 1].kind == STEP_EXPECT_PROGRAM);
}

/* --- what was written ------------------------------------------------------------------------- */

static enum db_step answer_write(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);
	const struct xyza_step *step = step_of(talk);
	struct db_device *device = talk->device;
	struct db_device *first = device->first;
	bool ran = first->program_state == XYZA_PROGRAM_RUNNING;

	switch (step->request.verb) {
	case XYZA_MANUAL_JOG:
		xyza_note_started(device, step->request.negative);
		device->expected_by = talk->now + device->reaction;
		break;
	case XYZA_WRITE_MAGNITUDE:
	case XYZA_WRITE_SIGN:
	case XYZA_MANUAL_CLEAR:
		device->placed++;
		device->held_until = talk->now + HOLD_TIME;
		break;
	case XYZA_PROGRAM_STOP:
	case XYZA_PROGRAM_QUICK_STOP:
		first->paused = ran;
		if (ran)
			xyza_doubt_standing(first, talk->now);
		break;
	case XYZA_PROGRAM_END:
		if (ran)
			xyza_doubt_standing(first, talk->now);
		break;
	case XYZA_WRITE_ITEM:
		if (step->request.item == XYZA_ITEM_FACTORY_RESET)
			xyza_forget_all(first);
		break;
	default:
		break;
	}
	plan->stop_taken = true;
	if (talk->job->kind == DB_JOB_COMMAND && talk->job->request->command == DB_CMD_DISABLE &&
	    xyza_is_stop(step->request.verb)) {
		first->stops++;
		xyza_note_stopped(first);
	}
	return send_next(talk);
}

static enum db_step refuse_write(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);
	enum xyza_verb verb = step_of(talk)->request.verb;

	if (step_of(talk)->kind == STEP_OR_BEFORE && plan->stop_taken)
		return send_next(talk);
	if (is_proven_next(plan) && !plan->same_way) {
		plan->refused = true;
		return send_next(talk);
	}
	if (verb == XYZA_WRITE_MAGNITUDE || verb == XYZA_WRITE_SIGN)
		talk->device->held_until = 0;
	return refuse_job(talk);
}

static enum db_step answer_call_off(struct db_conversation *talk)
{
	return end_job(talk, plan_of(talk)->lost ? DB_RESULT_TIMEOUT : DB_RESULT_FAILED);
}

/* --- what was read before --------------------------------------------------------------------- */

/* A motion that was started may only not show yet. */
static enum db_step answer_condition(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	bool wanted = is_wanted(talk);

	if (reply->kind == XYZA_REPLY_PROGRAM_STATE)
		xyza_take_program(talk->device->first, reply);
	else
		wanted = wanted || plan->asked < talk->device->expected_by;
	if (!wanted)
		plan->at++;
	return send_next(talk);
}

static enum db_step answer_guard(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	const struct xyza_step *step = step_of(talk);
	struct db_device *first = talk->device->first;
	struct db_device *other = first->axes[step->request.axis];

	if (reply->kind == XYZA_REPLY_PROGRAM_STATE)
		xyza_take_program(first, reply);
	if (is_wanted(talk))
		return refuse_job(talk);
	if (step->request.verb == XYZA_READ_STANDING && other) {
		if (plan_of(talk)->asked < other->expected_by)
			return ask_again(talk);
		xyza_note_standing(other);
	}
	return send_next(talk);
}

/* The program's state right before a command decides whether the command makes sense. */
static enum db_step answer_before(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	enum db_command command = talk->job->request->command;
	bool runs = reply->state == XYZA_PROGRAM_RUNNING;

	xyza_take_program(talk->device->first, reply);
	plan->before = xyza_content(reply);
	plan->before_read = true;
	if ((command == DB_CMD_START_PROGRAM && runs) ||
	    (command == DB_CMD_CONTINUE_PROGRAM && (runs || xyza_has_ended(plan->before))))
		return refuse_job(talk);
	/* A second stop might end the paused program. Without an interruption there is nothing to
	 * clear. */
	if ((command == DB_CMD_PAUSE_PROGRAM && xyza_has_stopped(plan->before)) ||
	    (command == DB_CMD_CLEAR_FAULT && reply->state != XYZA_PROGRAM_INTERRUPTED)) {
		talk->device->refused = false;
		return end_job(talk, DB_RESULT_OK);
	}
	return send_next(talk);
}

/* The item's value counts now. When all values that determine a ramp's time were read, that is
 * written. */
static enum db_step answer_learn(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	const struct xyza_step *step = step_of(talk);
	const union db_value *values = talk->device->plate.values;
	uint32_t time;

	xyza_learn_item(talk->device, step->request.item, reply->value, talk->now);
	if (step->kind == STEP_REFRESH)
		return send_next(talk);
	if (step->request.item == XYZA_ITEM_BRAKE &&
	    !(values[XYZA_BRAKE].u >> talk->device->axis & 1))
		return refuse_job(talk);
	if (step[1].kind == STEP_LEARN)
		return send_next(talk);
	time = xyza_ramp_time(values[XYZA_MIN_SPEED].u, values[XYZA_MAX_SPEED].u, plan->ramp);
	if (time == 0)
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	for (unsigned i = plan->at + 1; i < plan->count; i++) {
		plan->steps[i].value = time;
		plan->steps[i].request.value = time;
	}
	return send_next(talk);
}

static enum db_step answer_change(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	struct xyza_step *step = step_of(talk);
	uint32_t before = xyza_param_get(step->param, reply->value).u;
	union db_value value = { .u = (before & ~step->mask) | (step->value & step->mask) };
	uint32_t kept; /* the bits that are not to be changed are written as they were read */

	xyza_learn_item(talk->device, step->request.item, reply->value, talk->now);
	if (value.u == before) {
		plan->at += 2;
		return send_next(talk);
	}
	/* Its motion alone does not show whether it has the new speed. */
	if (plan->same_way)
		plan->unproven = true;
	kept = ~xyza_param_put(step->param, (union db_value){ .u = step->mask }, 0);
	step[1].request.kept = kept;
	step[1].request.value = (reply->value & kept) |
	                        (xyza_param_put(step->param, value, 0) & ~kept);
	return send_next(talk);
}

/* --- what shows the effect -------------------------------------------------------------------- */

/* Slow braking is fine as long as speed falls. "Standing" may still be the state before the motion
 * began. */
static enum db_step answer_standing(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	struct db_device *device = talk->device;
	float speed = fabsf(device->velocity);

	if (reply->value == 1) {
		if (plan->asked < device->expected_by)
			return ask_again(talk);
		xyza_note_standing(device);
		return send_next(talk);
	}
	device->expected_by = 0;
	if (plan->entered == 0) {
		plan->entered = plan->progress = talk->now;
		plan->least_speed = INFINITY;
	}
	/* Only samples taken after the stop count. */
	if (device->taken > plan->entered && speed < plan->least_speed) {
		plan->progress = talk->now;
		plan->least_speed = speed;
	}
	return talk->now - plan->progress <= STOP_TIME ? ask_again(talk) :
	                                                 end_job(talk, DB_RESULT_FAILED);
}

static enum db_step answer_expected(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	const struct xyza_step *step = step_of(talk);
	struct db_device *device = talk->device;

	if (step->request.verb == XYZA_READ_PORTS)
		device->first->ports = reply->value;
	if (is_wanted(talk)) {
		/* The position was just read; treat it as a fresh sample. */
		if (step->request.verb == XYZA_READ_MAGNITUDE)
			device->taken = talk->now;
		return send_next(talk);
	}
	/* Whatever became of the position, the controller's value counts now. */
	device->held_until = 0;
	if (may_still_show(talk))
		return ask_again(talk);
	if (step->back == 0 || plan->rewrites == REWRITES_MAX)
		return end_job(talk, DB_RESULT_FAILED);
	plan->rewrites++;
	return repeat_steps(talk, step->back);
}

static enum db_step answer_param(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	const struct xyza_step *step = step_of(talk);
	uint32_t value = xyza_param_get(step->param, reply->value).u;
	bool shows = ((value ^ step->value) & step->mask) == 0;

	if (!shows && may_still_show(talk))
		return ask_again(talk);
	/* The value that it holds instead counts. */
	xyza_learn_item(talk->device, step->request.item, reply->value, talk->now);
	if (shows)
		return send_next(talk);
	if (talk->job->kind == DB_JOB_COMMAND && step->param == XYZA_ENABLE)
		return end_job(talk, DB_RESULT_FAILED);
	talk->device->refused = true;
	return end_job(talk, DB_RESULT_REFUSED);
}

/* The speed setting was read back, and it was moving before: only its velocity shows that it has
 * received the jog. However long it takes, it is no failure as long as it comes nearer. */
static enum db_step answer_speed(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	struct db_device *device = talk->device;
	float distance; /* of its speed from the wanted one */
	float change;

	if (plan->stops != device->first->stops)
		return end_job(talk, DB_RESULT_CANCELLED);
	if (plan->entered == 0) {
		plan->entered = plan->progress = plan->sampled = talk->now;
		plan->least_speed = INFINITY;
	}
	if (reply->value == 0 && device->taken > plan->sampled) {
		plan->sampled = device->taken;
		distance = fabsf(device->velocity - plan->speed);
		change = fabsf(plan->speed - plan->speed_before);
		plan->samples++;
		plan->near = distance <= fmaxf(change / 2.0f,
		                               XYZA_SPEED_SHARE / 2.0f * fabsf(plan->speed)) ?
		                     plan->near + 1 :
		                     0;
		if (distance < plan->least_speed) {
			plan->least_speed = distance;
			plan->progress = talk->now;
		}
	}
	if (plan->near >= SPEED_NEAR) {
		plan->unproven = false;
		return send_next(talk);
	}
	if (reply->value == 0 && (plan->samples < SPEED_SAMPLES ||
	                          talk->now - plan->progress <= device->reaction + SPEED_TIME))
		return ask_again(talk);
	/* The jog is ended: the axis must not continue at a speed that its writer does not know. */
	plan->at = plan->count;
	return send_current(talk);
}

static enum db_step answer_moving(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct xyza_plan *plan = plan_of(talk);
	struct db_device *device = talk->device;

	if (reply->value == 0 || xyza_was_seen_elsewhere(device, plan)) {
		/* What a cycle has measured before shows nothing any more. */
		device->commanded++;
		/* It moved before, too: it is not known whether it received this. */
		if (plan->lost && plan->same_way)
			plan->unproven = true;
		/* Where only its position shows that it moves, "standing" may still be the old
		 * state. A cycle may have found it standing before it began to move. */
		if (reply->value == 0) {
			device->expected_by = 0;
			device->standing = false;
			device->jogging = true;
		}
		if (plan->at + 1 < plan->count &&
		    plan->steps[plan->at + 1].kind == STEP_EXPECT_SPEED &&
		    !xyza_can_distinguish_speeds(device, plan))
			plan->at++;
		return send_next(talk);
	}
	/* It may stand because it was stopped: the operator of another axis stops all of them. */
	if ((plan->lost || plan->refused) && plan->stops != device->first->stops)
		return end_job(talk, DB_RESULT_CANCELLED);
	if (!plan->refused && may_still_show(talk)) {
		device->expected_by = plan->entered + device->reaction;
		return ask_again(talk);
	}
	if ((plan->lost && device->resends < RESENDS_MAX) ||
	    (plan->refused && device->resends < REFUSALS_MAX)) {
		device->resends++;
		plan->lost = plan->refused = false;
		return repeat_steps(talk, 1);
	}
	xyza_note_standing(device);
	if (plan->refused)
		return refuse_job(talk);
	/* The jog is ended, so that it does not begin later, unexpectedly. */
	plan->at = plan->count;
	return send_current(talk);
}

static enum db_step answer_program(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);
	struct db_device *device = talk->device;
	uint32_t content = xyza_content(talk->reply);

	xyza_take_program(device->first, talk->reply);
	if (plan->before_read && xyza_shows_effect(plan, talk->job->request, content)) {
		/* A state that existed before is no proof. */
		plan->unproven = content == plan->before;
		if (!(plan->lost && plan->unproven))
			return send_next(talk);
	} else if (!plan->refused && !plan->unproven && may_still_show(talk)) {
		return ask_again(talk);
	}
	if (plan->refused && device->resends < REFUSALS_MAX) {
		device->resends++;
		plan->refused = false;
		return repeat_steps(talk, 1);
	}
	if (plan->refused)
		return refuse_job(talk);
	/* A program may also have ended between two readings. */
	if (plan->lost || (plan->before_read && !plan->unproven &&
	                   talk->job->request->command == DB_CMD_START_PROGRAM))
		return end_job(talk, DB_RESULT_INDETERMINATE);
	if (plan->unproven || !plan->before_read) {
		plan->unproven = true;
		return send_next(talk);
	}
	return end_job(talk, DB_RESULT_FAILED);
}

/* --- what cannot be read ---------------------------------------------------------------------- */

static enum db_step refuse_change(struct db_conversation *talk)
{
	const struct xyza_step *step = step_of(talk);

	return step->param == XYZA_ENABLE || step->request.item == XYZA_ITEM_KEYS ?
	               refuse_job(talk) :
	               send_next(talk);
}

/* The effect cannot be read: the result is that the controller accepted the command. */
static enum db_step refuse_effect(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);

	if (plan->refused)
		return refuse_job(talk);
	if (plan->lost)
		return end_job(talk, DB_RESULT_INDETERMINATE);
	plan->unproven = true;
	return send_next(talk);
}

/* --- answers that do not come ----------------------------------------------------------------- */

static enum db_step lose_planned(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);
	const struct xyza_request *request = &step_of(talk)->request;

	talk->device->held_until = 0;
	if (step_of(talk)->kind == STEP_CALL_OFF)
		return end_job(talk, DB_RESULT_INDETERMINATE);
	if (is_proven_next(plan)) {
		plan->lost = true;
		/* Unknown: assume that it moves. */
		if (request->verb == XYZA_MANUAL_JOG)
			xyza_note_started(talk->device, request->negative);
		return send_next(talk);
	}
	/* Reads show nothing about earlier actions; writes can be repeated. */
	return end_job(talk, xyza_is_read(request->verb) && plan->acted ? DB_RESULT_INDETERMINATE :
	                                                                  DB_RESULT_TIMEOUT);
}

/* --- the table -------------------------------------------------------------------------------- */

const struct conversation_step xyza_plan_steps[] = {
	[STEP_PLAIN] = { send_planned, 0, answer_write, refuse_write, lose_planned },
	[STEP_MAY_FAIL] = { send_planned, 0, answer_write, send_next, lose_planned },
	[STEP_OR_BEFORE] = { send_planned, 0, answer_write, refuse_write, lose_planned },
	[STEP_IF] = { send_planned, 0, answer_condition, send_next, lose_planned },
	[STEP_GUARD] = { send_planned, 0, answer_guard, send_next, lose_planned },
	[STEP_BEFORE] = { send_planned, 0, answer_before, send_next, lose_planned },
	[STEP_LEARN] = { send_planned, 0, answer_learn, refuse_job, lose_planned },
	[STEP_REFRESH] = { send_planned, 0, answer_learn, send_next, lose_planned },
	[STEP_CHANGE] = { send_planned, 0, answer_change, refuse_change, lose_planned },
	[STEP_UNTIL_STANDING] = { send_planned, 0, answer_standing, end_failed, lose_planned },
	[STEP_EXPECT] = { send_planned, 0, answer_expected, refuse_effect, lose_planned },
	[STEP_EXPECT_PARAM] = { send_planned, 0, answer_param, refuse_effect, lose_planned },
	[STEP_EXPECT_MOVING] = { send_planned, 0, answer_moving, refuse_effect, lose_planned },
	[STEP_EXPECT_SPEED] = { send_planned, 0, answer_speed, refuse_effect, lose_planned },
	[STEP_EXPECT_PROGRAM] = { send_planned, 0, answer_program, refuse_effect, lose_planned },
	[STEP_CALL_OFF] = { send_planned, 0, answer_call_off, answer_call_off, lose_planned },
};

/* --- beginning -------------------------------------------------------------------------------- */

enum db_step xyza_begin_command(struct db_conversation *talk)
{
	enum db_command command = talk->job->request->command;
	struct xyza_plan *plan = plan_of(talk);
	struct db_device *first = talk->device->first;

	if (command == DB_CMD_STOP || command == DB_CMD_QUICK_STOP)
		first->stops++;
	else if (!db_command_is_stop(command))
		talk->device->resends = 0;
	xyza_plan_command(plan, talk->device, talk->job->request, talk->job->out_of_step);
	plan->stops = first->stops;
	plan->stop_taken = xyza_is_program_stopped(first);
	plan->answered = talk->now;
	return send_current(talk);
}

enum db_step xyza_begin_settings(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);

	plan->unproven = false;
	plan->setting = 0;
	xyza_plan_setting(plan, talk->device, &talk->job->request->settings[0]);
	return send_current(talk);
}

void xyza_note_answer(struct db_conversation *talk)
{
	struct xyza_plan *plan = plan_of(talk);

	plan->asked = plan->answered;
	plan->answered = talk->now;
}

bool xyza_is_refusal_final(const struct db_conversation *talk)
{
	const struct xyza_plan *plan = plan_of(talk);

	switch (step_of(talk)->kind) {
	case STEP_CALL_OFF:
		return true;
	case STEP_MAY_FAIL:
	case STEP_OR_BEFORE:
		return plan == &talk->device->front || plan->stop_taken;
	default:
		return is_proven_next(plan) && !plan->same_way;
	}
}
