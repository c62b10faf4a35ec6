/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/xyza_axes.h"

#include "sim/xyza_controller.h"

#include <math.h>

#define ACCELERATION_TIME_UNIT 0.1 /* s */

static double content(const struct sim_xyza_axes *axes, enum xyza_axis axis, enum xyza_item item)
{
	return (double)sim_xyza_memory_get(axes->memory, item, axis);
}

static double ramp(const struct sim_xyza_axes *axes, enum xyza_axis axis)
{
	double time = content(axes, axis, XYZA_ITEM_ACCELERATION_TIME) * ACCELERATION_TIME_UNIT;
	double change = content(axes, axis, XYZA_ITEM_MAX_SPEED) -
	                content(axes, axis, XYZA_ITEM_MIN_SPEED);

	/* 0 means a jump. */
	return time > 0.0 && change > 0.0 ? change / time : 0.0;
}

/* Its deceleration, pulses/s^2; 0: it stops at once. */
static double braking(const struct sim_xyza_axes *axes, enum xyza_axis axis)
{
	double time = (double)axes->temper->braking / (double)DB_NS_PER_S;

	if (time > 0.0)
		return content(axes, axis, XYZA_ITEM_MAX_SPEED) / time;
	return (sim_xyza_memory_get(axes->memory, XYZA_ITEM_BRAKE, axis) >> axis & 1) != 0 ?
	               ramp(axes, axis) :
	               0.0;
}

void sim_xyza_axes_init(struct sim_xyza_axes *axes, const struct sim_xyza_memory *memory,
                        const struct sim_xyza_temper *temper, db_time now)
{
	*axes = (struct sim_xyza_axes){ .memory = memory, .temper = temper };
	for (size_t axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		sim_motion_init(&axes->list[axis].motion, now);
		axes->list[axis].due = DB_TIME_NEVER;
		axes->list[axis].standing_bit = (struct sim_late_bit){ .shown = true,
			                                               .real = true };
	}
}

void sim_xyza_axes_run(struct sim_xyza_axes *axes, enum xyza_axis axis, double velocity)
{
	struct sim_motion *motion = &axes->list[axis].motion;
	double min = fmin(content(axes, axis, XYZA_ITEM_MIN_SPEED), fabs(velocity));
	double acceleration = ramp(axes, axis);

	motion->acc = acceleration;
	motion->dec = braking(axes, axis);
	/* From standstill it starts with the lowest speed. */
	if (!sim_motion_moving(motion) && acceleration > 0.0)
		motion->velocity = copysign(min, velocity);
	axes->list[axis].negative_zero = false;
	sim_motion_run(motion, velocity);
}

void sim_xyza_axes_stop(struct sim_xyza_axes *axes)
{
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		struct sim_motion *motion = &axes->list[axis].motion;

		axes->list[axis].due = DB_TIME_NEVER;
		motion->dec = braking(axes, (enum xyza_axis)axis);
		sim_motion_stop(motion);
	}
}

void sim_xyza_axes_halt(struct sim_xyza_axes *axes)
{
	for (size_t axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		axes->list[axis].due = DB_TIME_NEVER;
		sim_motion_halt(&axes->list[axis].motion);
	}
}

/* Below its lowest speed a motor stops at once. */
static void advance_axis(struct sim_xyza_axes *axes, enum xyza_axis axis, db_time now)
{
	struct sim_motion *motion = &axes->list[axis].motion;
	double min = content(axes, axis, XYZA_ITEM_MIN_SPEED);

	if (motion->mode == SIM_MOTION_STOPPING && motion->dec > 0.0) {
		double left = fmax(0.0, fabs(motion->velocity) - min) / motion->dec;
		db_time end = motion->time + (db_time)(left * (double)DB_NS_PER_S);

		if (end <= now) {
			sim_motion_advance(motion, end);
			sim_motion_halt(motion);
		}
	}
	sim_motion_advance(motion, now);
}

static void begin_due(struct sim_xyza_axes *axes, enum xyza_axis axis, db_time now)
{
	db_time due = axes->list[axis].due;

	if (due > now)
		return;
	advance_axis(axes, axis, due);
	axes->list[axis].due = DB_TIME_NEVER;
	sim_xyza_axes_run(axes, axis, axes->list[axis].due_velocity);
}

void sim_xyza_axes_jog(struct sim_xyza_axes *axes, enum xyza_axis axis, double velocity,
                       db_time now)
{
	axes->list[axis].due_velocity = velocity;
	axes->list[axis].due = now + axes->temper->motion_delay;
	begin_due(axes, axis, now);
}

void sim_xyza_axes_advance(struct sim_xyza_axes *axes, db_time now)
{
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		begin_due(axes, (enum xyza_axis)axis, now);
		advance_axis(axes, (enum xyza_axis)axis, now);
		(void)sim_late_bit_follow(&axes->list[axis].standing_bit,
		                          !sim_motion_moving(&axes->list[axis].motion),
		                          axes->temper->standing_delay, now);
	}
}

bool sim_xyza_axes_busy(const struct sim_xyza_axes *axes)
{
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		if (sim_motion_moving(&axes->list[axis].motion) ||
		    axes->list[axis].due != DB_TIME_NEVER)
			return true;
	}
	return false;
}

void sim_xyza_axes_set_position(struct sim_xyza_axes *axes, enum xyza_axis axis, double position)
{
	axes->list[axis].negative_zero = position == 0.0 && signbit(position) &&
	                                 !axes->temper->no_negative_zero;
	sim_motion_set_position(&axes->list[axis].motion, position);
}

double sim_xyza_axes_position(const struct sim_xyza_axes *axes, enum xyza_axis axis)
{
	double position = round(axes->list[axis].motion.position);

	if (position == 0.0)
		return axes->list[axis].negative_zero ? -0.0 : 0.0;
	return position;
}
