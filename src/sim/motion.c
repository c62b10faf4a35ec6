/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/motion.h"

#include <math.h>

/* Rounding errors of positions up to 2^31 in doubles stay well below this many pulses. */
#define POSITION_TOLERANCE 1e-4
/* If the stopping distance is too long by up to this, the motor brakes a little harder instead of
 * overshooting. */
#define LANDING_TOLERANCE 0.5

/* A phase of constant acceleration. */
struct segment {
	double acceleration;
	double duration;     /* s, INFINITY: until something changes */
	double end_velocity; /* exact values at its end, without rounding errors */
	double end_position;
	bool lands; /* end_position is valid */
};

void sim_motion_init(struct sim_motion *motion, db_time now)
{
	*motion = (struct sim_motion){
		.mode = SIM_MOTION_STANDING,
		.time = now,
		.limit_min = -INFINITY,
		.limit_max = INFINITY,
	};
}

void sim_motion_set_position(struct sim_motion *motion, double position)
{
	double shift = position - motion->position;

	motion->position = position;
	motion->target_position += shift;
	motion->shake_centre += shift;
}

static bool outside_limits(const struct sim_motion *motion)
{
	return motion->position < motion->limit_min || motion->position > motion->limit_max;
}

void sim_motion_run(struct sim_motion *motion, double velocity)
{
	if (outside_limits(motion)) {
		sim_motion_halt(motion);
		return;
	}
	if (velocity == 0.0) {
		sim_motion_stop(motion);
		return;
	}
	motion->mode = SIM_MOTION_VELOCITY;
	motion->target_velocity = velocity;
}

void sim_motion_move(struct sim_motion *motion, double target, double speed)
{
	if (outside_limits(motion)) {
		sim_motion_halt(motion);
		return;
	}
	if (speed == 0.0) {
		sim_motion_stop(motion);
		return;
	}
	motion->target_position = target;
	motion->target_velocity = fabs(speed);
	if (motion->velocity == 0.0 && motion->position == target)
		sim_motion_halt(motion);
	else
		motion->mode = SIM_MOTION_POSITION;
}

void sim_motion_shake(struct sim_motion *motion, double to, double frequency, double cycles)
{
	if (outside_limits(motion)) {
		sim_motion_halt(motion);
		return;
	}
	motion->mode = SIM_MOTION_SHAKING;
	motion->velocity = 0.0;
	motion->shake_centre = (motion->position + to) / 2.0;
	motion->shake_amplitude = (motion->position - to) / 2.0;
	motion->shake_frequency = frequency;
	motion->shake_elapsed = 0.0;
	motion->shake_duration = cycles > 0.0 ? cycles / frequency : INFINITY;
}

void sim_motion_stop(struct sim_motion *motion)
{
	if (motion->velocity == 0.0 || motion->dec == 0.0)
		sim_motion_halt(motion);
	else
		motion->mode = SIM_MOTION_STOPPING;
}

void sim_motion_halt(struct sim_motion *motion)
{
	/* A begun pulse is completed: a sensor that just saw the motor still sees it. */
	if (motion->velocity > 0.0)
		motion->position = ceil(motion->position);
	else if (motion->velocity < 0.0)
		motion->position = floor(motion->position);
	else
		motion->position = round(motion->position);
	motion->mode = SIM_MOTION_STANDING;
	motion->velocity = 0.0;
}

bool sim_motion_moving(const struct sim_motion *motion)
{
	return motion->mode != SIM_MOTION_STANDING;
}

static int sign(double number)
{
	return (number > 0.0) - (number < 0.0);
}

int sim_motion_direction(const struct sim_motion *motion)
{
	if (motion->velocity != 0.0)
		return sign(motion->velocity);
	if (motion->mode == SIM_MOTION_VELOCITY)
		return sign(motion->target_velocity);
	if (motion->mode == SIM_MOTION_POSITION)
		return sign(motion->target_position - motion->position);
	return 0;
}

static struct segment ramp_to(double from, double to, double rate)
{
	struct segment segment = { .end_velocity = to };

	if (rate > 0.0) {
		segment.acceleration = to > from ? rate : -rate;
		segment.duration = fabs(to - from) / rate;
	}
	return segment;
}

static struct segment plan_velocity(const struct sim_motion *motion, double target)
{
	double velocity = motion->velocity;

	if (velocity == target)
		return (struct segment){ .duration = INFINITY, .end_velocity = target };
	if (velocity * target < 0.0)
		return ramp_to(velocity, 0.0, motion->dec);
	return ramp_to(velocity, target, fabs(target) > fabs(velocity) ? motion->acc : motion->dec);
}

/* The highest speed from which the move can still end at its target, `distance` ahead. */
static double peak_speed(const struct sim_motion *motion, double speed, double distance)
{
	double acc = motion->acc;
	double dec = motion->dec;
	double peak = INFINITY;

	if (acc > 0.0 && dec > 0.0)
		peak = sqrt((2.0 * acc * dec * distance + dec * speed * speed) / (acc + dec));
	else if (dec > 0.0)
		peak = sqrt(2.0 * dec * distance);
	else if (acc > 0.0)
		peak = sqrt(speed * speed + 2.0 * acc * distance);
	return fmin(peak, motion->target_velocity);
}

static struct segment land(const struct sim_motion *motion, double acceleration, double duration)
{
	return (struct segment){
		.acceleration = acceleration,
		.duration = duration,
		.end_position = motion->target_position,
		.lands = true,
	};
}

static struct segment plan_position(const struct sim_motion *motion)
{
	double way = motion->target_position - motion->position;
	double direction = way != 0.0 ? sign(way) : sign(motion->velocity);
	double speed = motion->velocity * direction;
	double distance = fabs(way);
	double braking = motion->dec > 0.0 ? speed * speed / (2.0 * motion->dec) : 0.0;
	double peak;

	if (speed == 0.0 && distance < POSITION_TOLERANCE)
		return land(motion, 0.0, 0.0);
	if (speed < 0.0)
		return ramp_to(motion->velocity, 0.0, motion->dec);
	if (speed > 0.0 && braking >= distance - POSITION_TOLERANCE) {
		if (motion->dec == 0.0 || distance < POSITION_TOLERANCE / 2.0)
			return braking > LANDING_TOLERANCE ?
			               ramp_to(motion->velocity, 0.0, motion->dec) :
			               land(motion, 0.0, 0.0);
		if (braking > distance + LANDING_TOLERANCE)
			return ramp_to(motion->velocity, 0.0, motion->dec);
		return land(motion, -direction * speed * speed / (2.0 * distance),
		            2.0 * distance / speed);
	}
	if (speed > motion->target_velocity)
		return ramp_to(motion->velocity, direction * motion->target_velocity, motion->dec);
	peak = peak_speed(motion, speed, distance);
	if (peak - speed > 1e-9 * peak)
		return ramp_to(motion->velocity, direction * peak, motion->acc);
	if (motion->dec == 0.0)
		return land(motion, 0.0, distance / speed);
	return (struct segment){ .duration = (distance - braking) / speed,
		                 .end_velocity = motion->velocity };
}

/* Follows the segment for at most `seconds`; returns the time used. */
static double follow(struct sim_motion *motion, const struct segment *segment, double seconds)
{
	double used = fmin(seconds, segment->duration);

	motion->position += motion->velocity * used + 0.5 * segment->acceleration * used * used;
	if (segment->duration > seconds) {
		motion->velocity += segment->acceleration * used;
		return used;
	}
	motion->velocity = segment->end_velocity;
	if (segment->lands) {
		motion->position = segment->end_position;
		sim_motion_halt(motion);
	} else if (motion->mode == SIM_MOTION_STOPPING && motion->velocity == 0.0) {
		sim_motion_halt(motion);
	}
	return used;
}

static double shake(struct sim_motion *motion, double seconds)
{
	double used = fmin(seconds, motion->shake_duration - motion->shake_elapsed);
	double rate = 2.0 * acos(-1.0) * motion->shake_frequency;

	motion->shake_elapsed += used;
	motion->position = motion->shake_centre +
	                   motion->shake_amplitude * cos(rate * motion->shake_elapsed);
	motion->velocity = -motion->shake_amplitude * rate * sin(rate * motion->shake_elapsed);
	if (motion->shake_elapsed >= motion->shake_duration)
		sim_motion_halt(motion);
	return used;
}

void sim_motion_advance(struct sim_motion *motion, db_time now)
{
	double left = (double)(now - motion->time) / (double)DB_NS_PER_S;

	if (now <= motion->time)
		return;
	motion->time = now;
	/* A limit that was moved past the motor stops it where it is. */
	if (sim_motion_moving(motion) && outside_limits(motion))
		sim_motion_halt(motion);
	while (sim_motion_moving(motion) && left > 0.0) {
		if (motion->mode == SIM_MOTION_SHAKING) {
			left -= shake(motion, left);
		} else {
			bool runs = motion->mode == SIM_MOTION_VELOCITY;
			struct segment segment =
				motion->mode == SIM_MOTION_POSITION ?
					plan_position(motion) :
					plan_velocity(motion, runs ? motion->target_velocity : 0.0);

			left -= follow(motion, &segment, left);
		}
		if (motion->position > motion->limit_max && motion->velocity >= 0.0) {
			motion->position = motion->limit_max;
			sim_motion_halt(motion);
		} else if (motion->position < motion->limit_min && motion->velocity <= 0.0) {
			motion->position = motion->limit_min;
			sim_motion_halt(motion);
		}
	}
}
