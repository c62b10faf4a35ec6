/* SPDX-License-Identifier: Apache-2.0 */
/* Judges whether the readings after a command show that it had its effect. */
#include "driver/vsmd/vsmd_private.h"

#include "driver/vsmd/commands.h"

#include <math.h>

/* Equal speeds differ by at most this: absolute, and as a fraction of the larger one. */
#define SPEED_SLACK 1.0f
#define SPEED_SHARE 0.01f
/* Speeds follow the drive's own profile: smaller changes than this do not count. */
#define CHANGE_SLACK 0.5f
#define CHANGE_SHARE 0.001f
/* A shorter way shows no direction. */
#define PLACE_SLACK 2.0

static int sign_of(double number)
{
	return (number > 0.0) - (number < 0.0);
}

static float larger_speed(float a, float b)
{
	return fmaxf(fabsf(a), fabsf(b));
}

static bool is_speed(float speed, float wanted)
{
	return fabsf(speed - wanted) <= SPEED_SLACK + SPEED_SHARE * larger_speed(speed, wanted);
}

/* True if the speed has changed from `base`, and not by rounding. */
static bool has_changed(float base, float speed)
{
	return fabsf(speed - base) > CHANGE_SLACK + CHANGE_SHARE * larger_speed(base, speed);
}

/* The direction in which it has moved since the command, by its position; 0: not yet. */
static int heading_of(const struct vsmd_axis *axis)
{
	const struct vsmd_watch *watch = &axis->watch;
	double way = vsmd_way(watch->first_place, axis->last.position);

	return watch->has_place && fabs(way) > axis->window + PLACE_SLACK ? sign_of(way) : 0;
}

/* The speed, also of drives that never report its sign: then the way since the command gives it.
 * A drive that did report a sign may have turned round since, and has gone back less far than
 * forth. */
static float speed_of(const struct vsmd_axis *axis)
{
	float shown = axis->watch.has_speed ? axis->watch.speed : axis->last.velocity;
	bool shows_sign = axis->watch.before.velocity < 0.0f || axis->watch.first_speed < 0.0f;

	return shown > 0.0f && !shows_sign && heading_of(axis) < 0 ? -shown : shown;
}

bool vsmd_reports_no_speed(const struct vsmd_axis *axis)
{
	const struct vsmd_watch *watch = &axis->watch;

	return watch->before.moving && !(axis->last.status & VSMD_ST_STP) && watch->has_speed &&
	       fabsf(watch->before.velocity) <= 0.0f && fabsf(watch->first_speed) <= 0.0f &&
	       fabsf(axis->last.velocity) <= 0.0f;
}

/* For a drive that does not report its speed, only the direction counts. */
static enum vsmd_effect effect_by_heading(const struct vsmd_axis *axis, int wanted)
{
	const struct vsmd_before *before = &axis->watch.before;
	int earlier = 0; /* the direction of the previous command; 0: not known */

	if (before->goal.kind == VSMD_GOAL_VELOCITY)
		earlier = sign_of((double)before->goal.velocity);
	else if (before->goal.kind == VSMD_GOAL_POSITION)
		earlier = sign_of((double)before->goal.position - (double)before->position);
	if (heading_of(axis) != wanted)
		return VSMD_EFFECT_ABSENT;
	if (earlier == -wanted)
		return VSMD_EFFECT_SHOWN;
	return earlier == 0 ? VSMD_EFFECT_OPEN : VSMD_EFFECT_ABSENT;
}

/* The reference for a change of speed: that of a steady run, else the first one read. */
static float base_of(const struct vsmd_watch *watch)
{
	const struct vsmd_goal *goal = &watch->before.goal;

	if (goal->kind == VSMD_GOAL_VELOCITY && is_speed(watch->before.velocity, goal->velocity))
		return goal->velocity;
	return watch->first_speed;
}

/* True if a drive with the target `place` may move like this: towards it, or away from it while it
 * brakes from its earlier run. */
static bool is_of_position(const struct vsmd_axis *axis, int32_t place, float base, float speed)
{
	int heading = sign_of((double)speed);

	if (heading == 0 || heading == sign_of((double)place - (double)axis->last.position))
		return true;
	return heading == sign_of((double)axis->watch.before.velocity) &&
	       heading == sign_of((double)base) &&
	       !(fabsf(speed) > fabsf(base) && has_changed(base, speed));
}

/* True if the previous command reverses the drive, and its speed has no sign: until the positions
 * show the new direction, a speed that grows may be in either. */
static bool may_have_turned(const struct vsmd_axis *axis, float base)
{
	const struct vsmd_before *before = &axis->watch.before;
	int end = 0;

	if (before->goal.kind == VSMD_GOAL_VELOCITY)
		end = sign_of((double)before->goal.velocity);
	else if (before->goal.kind == VSMD_GOAL_POSITION)
		end = sign_of((double)before->goal.position - (double)before->position);
	return axis->unsigned_speed && end != 0 && end != sign_of((double)base);
}

/* True if the previous command can have changed the speed from `base` to the present one. */
static bool is_explained(const struct vsmd_axis *axis, float base, float speed)
{
	const struct vsmd_goal *goal = &axis->watch.before.goal;
	float slack = SPEED_SLACK + CHANGE_SHARE * larger_speed(base, speed);
	float end = goal->kind == VSMD_GOAL_VELOCITY ? goal->velocity : 0.0f;

	if (may_have_turned(axis, base))
		return goal->kind == VSMD_GOAL_POSITION ||
		       fabsf(speed) <= larger_speed(base, end) + slack;
	switch (goal->kind) {
	case VSMD_GOAL_REST:
	case VSMD_GOAL_VELOCITY:
		return speed >= fminf(base, end) - slack && speed <= fmaxf(base, end) + slack;
	case VSMD_GOAL_POSITION:
		return is_of_position(axis, goal->position, base, speed);
	case VSMD_GOAL_UNKNOWN:
	default:
		return true;
	}
}

static enum vsmd_effect shown_if(bool shown)
{
	return shown ? VSMD_EFFECT_SHOWN : VSMD_EFFECT_ABSENT;
}

static enum vsmd_effect effect_of_velocity(const struct vsmd_axis *axis, float wanted)
{
	const struct vsmd_watch *watch = &axis->watch;
	bool to_rest = !(wanted > 0.0f || wanted < 0.0f);
	float speed = speed_of(axis);
	float base = base_of(watch);

	if (axis->last.status & VSMD_ST_STP)
		return shown_if(to_rest);
	if (!watch->before.moving)
		return shown_if(!to_rest);
	if (watch->before.goal.kind == VSMD_GOAL_VELOCITY &&
	    is_speed(watch->before.goal.velocity, wanted))
		return VSMD_EFFECT_SHOWN; /* the previous command had the same */
	if (!watch->has_speed)
		return VSMD_EFFECT_ABSENT;
	if (!to_rest && vsmd_reports_no_speed(axis))
		return effect_by_heading(axis, sign_of((double)wanted));
	if (!is_speed(speed, wanted) &&
	    !(may_have_turned(axis, base) && is_speed(fabsf(speed), fabsf(wanted))) &&
	    !(has_changed(base, speed) &&
	      sign_of((double)speed - (double)base) == sign_of((double)wanted - (double)base)))
		return VSMD_EFFECT_ABSENT;
	return is_explained(axis, base, speed) ? VSMD_EFFECT_OPEN : VSMD_EFFECT_SHOWN;
}

/* The drive was moving already, and does not stand. Before it can turn to a target that it has
 * passed, it has to slow down; if it was already slowing down, for a halt, that proves nothing. */
static enum vsmd_effect effect_of_new_target(const struct vsmd_axis *axis, int32_t target)
{
	const struct vsmd_watch *watch = &axis->watch;
	const struct vsmd_goal *goal = &watch->before.goal;
	double way = (double)target - (double)axis->last.position;
	float speed = speed_of(axis);
	float base = base_of(watch);
	bool heads_there = sign_of((double)speed) == sign_of(way);

	if (goal->kind == VSMD_GOAL_POSITION && goal->position == target)
		return VSMD_EFFECT_SHOWN;
	if (!watch->has_speed)
		return VSMD_EFFECT_ABSENT;
	if (vsmd_reports_no_speed(axis))
		return effect_by_heading(axis, sign_of(way));
	if (!is_explained(axis, base, speed) && (heads_there || has_changed(base, speed)))
		return VSMD_EFFECT_SHOWN;
	return heads_there || (has_changed(base, speed) && fabsf(speed) < fabsf(base) &&
	                       sign_of((double)speed) != -sign_of((double)base)) ?
	               VSMD_EFFECT_OPEN :
	               VSMD_EFFECT_ABSENT;
}

/* Homing or shaking: the drive chooses its motion. */
static enum vsmd_effect effect_of_own_motion(const struct vsmd_axis *axis, uint32_t end_bit)
{
	const struct vsmd_watch *watch = &axis->watch;

	if (axis->last.status & end_bit & ~watch->before.status)
		return VSMD_EFFECT_SHOWN;
	/* Nothing else has cleared it before. */
	if (end_bit == VSMD_ST_ZERO && (watch->before.status & ~axis->last.status & end_bit))
		return VSMD_EFFECT_SHOWN;
	if (axis->last.status & VSMD_ST_STP)
		return VSMD_EFFECT_ABSENT;
	if (!watch->before.moving)
		return VSMD_EFFECT_SHOWN;
	if (!watch->has_speed)
		return VSMD_EFFECT_ABSENT;
	return is_explained(axis, base_of(watch), watch->speed) ? VSMD_EFFECT_OPEN :
	                                                          VSMD_EFFECT_SHOWN;
}

static enum vsmd_effect effect_of_place(const struct vsmd_axis *axis, int32_t place)
{
	const struct vsmd_before *before = &axis->watch.before;
	double seconds = (double)(axis->status_at - before->at) / (double)DB_NS_PER_S;
	float speed = larger_speed(before->velocity, axis->last.velocity);
	double travel; /* at most, since it was read before the command */

	if ((axis->last.status & VSMD_ST_STP) && !before->moving)
		return shown_if(vsmd_is_at(axis, axis->last.position, place));
	if (before->goal.kind == VSMD_GOAL_VELOCITY)
		speed = larger_speed(speed, before->goal.velocity);
	travel = 2.0 * (double)speed * seconds + axis->window + 1.0;
	if (fabs((double)axis->last.position - (double)place) > travel)
		return VSMD_EFFECT_ABSENT;
	return fabs((double)axis->last.position - (double)before->position) > travel ?
	               VSMD_EFFECT_SHOWN :
	               VSMD_EFFECT_OPEN;
}

/* The level of an input is that of the connected signal, and proves nothing unless it has
 * followed. */
static enum vsmd_effect effect_of_output(const struct vsmd_axis *axis, unsigned port, bool high)
{
	static const uint32_t bits[] = { VSMD_ST_S1, VSMD_ST_S2, VSMD_ST_S3,
		                         VSMD_ST_S4, VSMD_ST_S5, VSMD_ST_S6 };
	bool was = (axis->watch.before.status & bits[port - 1]) != 0;
	bool is = (axis->last.status & bits[port - 1]) != 0;

	return shown_if(is == high && (was != high || !vsmd_is_input(axis, port)));
}

enum vsmd_effect vsmd_effect_of(const struct vsmd_axis *axis, const struct db_job *job)
{
	const struct db_args *args = job->request->args;
	uint32_t status = axis->last.status;

	switch (job->request->command) {
	case DB_CMD_ENABLE:
		return shown_if(status & VSMD_ST_PWR);
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		if (axis->last.status & VSMD_ST_STP)
			return shown_if(vsmd_is_at(axis, axis->last.position, axis->wanted));
		return axis->watch.before.moving ? effect_of_new_target(axis, axis->wanted) :
		                                   VSMD_EFFECT_SHOWN;
	case DB_CMD_MOVE_VELOCITY:
		return effect_of_velocity(axis, args->target_velocity);
	case DB_CMD_MOVE_PRESET:
		if (isnan(vsmd_preset_speed(axis)))
			return (axis->last.status & VSMD_ST_STP) ? VSMD_EFFECT_ABSENT :
			       axis->watch.before.moving         ? VSMD_EFFECT_OPEN :
			                                           VSMD_EFFECT_SHOWN;
		return effect_of_velocity(axis, vsmd_preset_speed(axis));
	case DB_CMD_HOME: /* first the previous end is cleared, then homing begins */
		if (job->step == VSMD_STEP_CLEAR_HOMED)
			return shown_if(!(status & VSMD_ST_ZERO));
		return effect_of_own_motion(axis, VSMD_ST_ZERO);
	case DB_CMD_HOME_STOP:
		return shown_if(!(status & VSMD_ST_ZERO));
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		return effect_of_own_motion(axis, VSMD_ST_ACT);
	case DB_CMD_SET_POSITION:
		return effect_of_place(axis, args->target_position);
	case DB_CMD_CLEAR_FAULT:
		return shown_if(!(status & VSMD_ST_ENC_ERR));
	case DB_CMD_SET_OUTPUT:
		return effect_of_output(axis, args->output_number, args->output_value);
	case DB_CMD_SET_OUTPUTS:
		return effect_of_output(axis, axis->watch.output,
		                        args->output_levels >> (axis->watch.output - 1) & 1);
	default: /* nothing of it can be read */
		return VSMD_EFFECT_SHOWN;
	}
}

bool vsmd_shows_its_effect(const struct vsmd_link *link, enum db_command command)
{
	switch (command) {
	case DB_CMD_SET_SV:
	case DB_CMD_SET_NMOS:
		return false;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		/* Its motion is seen; on CAN its ends and frequency were sent in separate
		 * frames. */
		return link->acknowledges;
	default:
		return true;
	}
}
