/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

#include <math.h>

static struct xyza_step *add_step(struct xyza_plan *plan, const struct db_device *device,
                                  enum xyza_verb verb, enum xyza_plan_kind kind)
{
	struct xyza_step *step = &plan->steps[plan->count++];

	*step = (struct xyza_step){
		.request = { .verb = verb, .axis = device->axis },
		.kind = kind,
	};
	return step;
}

/* Adds a read whose bits `mask` are to be `wanted`. */
static struct xyza_step *add_read(struct xyza_plan *plan, const struct db_device *device,
                                  enum xyza_verb verb, enum xyza_plan_kind kind, uint32_t mask,
                                  uint32_t wanted)
{
	struct xyza_step *step = add_step(plan, device, verb, kind);

	step->mask = mask;
	step->wanted = wanted;
	return step;
}

/* --- parameters ------------------------------------------------------------------------------- */

static void add_item(struct xyza_plan *plan, const struct db_device *device, enum xyza_verb verb,
                     enum xyza_plan_kind kind, enum xyza_param param, uint32_t value, uint32_t mask)
{
	struct xyza_step *step = add_step(plan, device, verb, kind);

	step->request.item = xyza_param_places[param].item;
	step->request.value = verb == XYZA_WRITE_ITEM ?
	                              xyza_param_put(param, (union db_value){ .u = value }, 0) :
	                              0;
	step->param = param;
	step->value = value;
	step->mask = mask;
}

/* Sets the bits `mask` of a parameter to those of `value`; written only when they differ, because
 * writing may wear the controller's memory. */
static void add_change(struct xyza_plan *plan, const struct db_device *device,
                       enum xyza_param param, uint32_t value, uint32_t mask)
{
	/* An item with nothing else in it can be written without being read. */
	bool whole = xyza_param_places[param].item != XYZA_ITEM_KEYS && param != XYZA_ENABLE;
	bool unread = device->unread >> xyza_param_places[param].item & 1;

	if (!(xyza_param_places[param].access & XYZA_CAN_READ) || (unread && whole)) {
		add_item(plan, device, XYZA_WRITE_ITEM, STEP_PLAIN, param, value, mask);
		plan->unproven = true;
		return;
	}
	add_item(plan, device, XYZA_READ_ITEM, STEP_CHANGE, param, value, mask);
	add_item(plan, device, XYZA_WRITE_ITEM, STEP_PLAIN, param, value, mask);
	add_item(plan, device, XYZA_READ_ITEM, STEP_EXPECT_PARAM, param, value, mask);
}

void xyza_plan_setting(struct xyza_plan *plan, const struct db_device *device,
                       const struct db_setting *setting)
{
	static const enum xyza_param needed[] = { XYZA_MIN_SPEED, XYZA_MAX_SPEED, XYZA_BRAKE };
	unsigned needed_count = setting->param == XYZA_RAMP_DECELERATION ? 3 : 2;

	*plan = (struct xyza_plan){ .steps = plan->steps,
		                    .setting = plan->setting,
		                    .unproven = plan->unproven };
	if (setting->param < XYZA_PARAM_COUNT) {
		add_change(plan, device, (enum xyza_param)setting->param, setting->value.u,
		           UINT32_MAX);
		return;
	}
	/* The time that results in this ramp is known when the speeds have been read. */
	plan->ramp = setting->value.f;
	for (unsigned i = 0; i < needed_count; i++)
		add_item(plan, device, XYZA_READ_ITEM, STEP_LEARN, needed[i], 0, 0);
	add_change(plan, device, XYZA_ACCELERATION_TIME, 0, UINT32_MAX);
}

/* --- stops ------------------------------------------------------------------------------------ */

/*
 * Both modes are stopped: a controller may refuse to stop a mode that is not active. A program that
 * shows as idle may be about to start, by a key or after its delay. A program that is stopped
 * already would be ended by another stop, and stops are repeated until the axis stands: so it is
 * only stopped when it is seen running. In an undocumented state it may be running.
 */
static void plan_stop(struct xyza_plan *plan, const struct db_device *device, bool quick)
{
	enum xyza_verb manual = quick ? XYZA_MANUAL_QUICK_STOP : XYZA_MANUAL_STOP;
	enum xyza_verb program = quick ? XYZA_PROGRAM_QUICK_STOP : XYZA_PROGRAM_STOP;
	const struct db_device *first = device->first;
	bool runs = first->program_state == XYZA_PROGRAM_RUNNING;

	if (xyza_is_program_stopped(first)) {
		add_step(plan, device, manual, STEP_OR_BEFORE);
		add_read(plan, device, XYZA_PROGRAM_STATE, STEP_IF, UINT8_MAX,
		         XYZA_PROGRAM_RUNNING);
		add_step(plan, device, program, STEP_PLAIN);
		return;
	}
	if (first->program_state != XYZA_PROGRAM_IDLE) {
		add_step(plan, device, program, runs ? STEP_PLAIN : STEP_MAY_FAIL);
		add_step(plan, device, manual, STEP_OR_BEFORE);
		return;
	}
	add_step(plan, device, manual, STEP_MAY_FAIL);
	/* An emergency stop would leave a program interrupted that never ran. */
	add_step(plan, device, XYZA_PROGRAM_STOP, STEP_OR_BEFORE);
}

static void add_standstill(struct xyza_plan *plan, const struct db_device *device)
{
	add_step(plan, device, XYZA_MANUAL_STOP, STEP_PLAIN);
	add_step(plan, device, XYZA_READ_STANDING, STEP_UNTIL_STANDING);
}

/* --- motion ----------------------------------------------------------------------------------- */

/* Manual mode moves one axis at a time, and none while a program runs. A condition that seems to
 * prevent the command is read once more: it may have ended since. */
static void add_guards(struct xyza_plan *plan, const struct db_device *device)
{
	const struct db_device *first = device->first;

	if (first->program_state == XYZA_PROGRAM_RUNNING)
		add_read(plan, device, XYZA_PROGRAM_STATE, STEP_GUARD, UINT8_MAX,
		         XYZA_PROGRAM_RUNNING);
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		const struct db_device *other = first->axes[i];

		if (other && other != device && (other->jogging || !other->standing))
			add_read(plan, other, XYZA_READ_STANDING, STEP_GUARD, UINT32_MAX, 0);
	}
}

/* True if it moves in that direction, as far as known. */
static bool goes_that_way(const struct db_device *device, bool negative)
{
	if (device->stopping)
		return false;
	if (device->jogging)
		return device->jog_negative == negative;
	return negative ? device->velocity < 0.0f : device->velocity > 0.0f;
}

static void plan_jog(struct xyza_plan *plan, struct db_device *device, bool negative, float speed)
{
	static const enum xyza_param needed[] = { XYZA_BRAKE, XYZA_ACCELERATION_TIME };
	bool moves = !device->standing || device->jogging;

	plan->same_way = moves && goes_that_way(device, negative) && !device->stops_for_speed;
	add_guards(plan, device);
	if (moves && !plan->same_way)
		add_standstill(plan, device);
	if (speed > 0.0f)
		add_change(plan, device, XYZA_MANUAL_SPEED, (uint32_t)llroundf(speed), UINT32_MAX);
	/* What the stop before a limit depends on: it may have been changed at the controller. */
	for (unsigned i = 0; device->limited && i < 2; i++) {
		if (!(device->unread >> xyza_param_places[needed[i]].item & 1))
			add_item(plan, device, XYZA_READ_ITEM, STEP_REFRESH, needed[i], 0, 0);
	}
	add_step(plan, device, XYZA_MANUAL_JOG, STEP_PLAIN)->request.negative = negative;
	add_step(plan, device, XYZA_READ_STANDING, STEP_EXPECT_MOVING);
	if (plan->same_way && speed > 0.0f) {
		plan->speed = negative ? -speed : speed;
		plan->speed_before = device->velocity;
		add_step(plan, device, XYZA_READ_STANDING, STEP_EXPECT_SPEED);
	}
	/* The motion must not begin after its writer was notified that it did not. */
	add_step(plan, device, XYZA_MANUAL_STOP, STEP_CALL_OFF);
	plan->count--;
}

/* The magnitude first: a zero need not keep a sign. Then both are read, and written again where
 * they differ. */
static void plan_position(struct xyza_plan *plan, const struct db_device *device, int32_t position)
{
	uint32_t magnitude = position < 0 ? 0u - (uint32_t)position : (uint32_t)position;

	add_read(plan, device, XYZA_READ_STANDING, STEP_GUARD, UINT32_MAX, 0);
	if (position == 0) {
		add_step(plan, device, XYZA_MANUAL_CLEAR, STEP_PLAIN);
		add_read(plan, device, XYZA_READ_MAGNITUDE, STEP_EXPECT, UINT32_MAX, 0)->back = 1;
		return;
	}
	add_step(plan, device, XYZA_WRITE_MAGNITUDE, STEP_PLAIN)->request.value = magnitude;
	add_step(plan, device, XYZA_WRITE_SIGN, STEP_PLAIN)->request.negative = position < 0;
	add_read(plan, device, XYZA_READ_SIGN, STEP_EXPECT, UINT32_MAX, position < 0)->back = 2;
	add_read(plan, device, XYZA_READ_MAGNITUDE, STEP_EXPECT, UINT32_MAX, magnitude)->back = 3;
}

/* --- outputs and programs --------------------------------------------------------------------- */

#define ALL_OUTPUTS ((1u << XYZA_OUTPUTS) - 1)

/* All to one level is one frame, and they change together. */
static void plan_outputs(struct xyza_plan *plan, const struct db_device *device, unsigned mask,
                         unsigned levels)
{
	bool at_once = mask == ALL_OUTPUTS && (levels == 0 || levels == ALL_OUTPUTS);

	if (at_once)
		add_step(plan, device, XYZA_WRITE_OUTPUTS, STEP_PLAIN)->request.on = levels != 0;
	for (unsigned port = 1; port <= XYZA_OUTPUTS; port++) {
		struct xyza_step *step;

		if (at_once || !(mask >> (port - 1) & 1))
			continue;
		step = add_step(plan, device, XYZA_WRITE_OUTPUT, STEP_PLAIN);
		step->request.number = (uint8_t)port;
		step->request.on = levels >> (port - 1) & 1;
	}
	if (device->first->ports_part.pause > 0)
		plan->unproven = true;
	else
		add_read(plan, device, XYZA_READ_PORTS, STEP_EXPECT, mask << XYZA_OUTPUTS_SHIFT,
		         (levels & mask) << XYZA_OUTPUTS_SHIFT);
}

/* The program's state is read right before the command, and the state that results after it. */
static void plan_program(struct xyza_plan *plan, struct db_device *device,
                         const struct db_request *request)
{
	const struct db_args *args = request->args;
	struct db_device *first = device->first;
	bool starts = request->command == DB_CMD_START_PROGRAM;
	bool readable = first->program_part.pause == 0;
	enum xyza_verb verb;

	switch (request->command) {
	case DB_CMD_START_PROGRAM:
		verb = XYZA_PROGRAM_START;
		break;
	case DB_CMD_PAUSE_PROGRAM:
		verb = XYZA_PROGRAM_STOP;
		break;
	case DB_CMD_CONTINUE_PROGRAM:
		verb = XYZA_PROGRAM_CONTINUE;
		break;
	case DB_CMD_END_PROGRAM:
	case DB_CMD_CLEAR_FAULT:
		verb = XYZA_PROGRAM_END;
		break;
	default:
		return;
	}
	if (readable)
		add_step(plan, device, XYZA_PROGRAM_STATE, STEP_BEFORE);
	if (starts && (args->program_delay > 0 || first->delayed)) {
		add_step(plan, device, XYZA_PROGRAM_DELAY,
		         args->program_delay == 0 ? STEP_MAY_FAIL : STEP_PLAIN)
			->request.number = (uint8_t)args->program_delay;
		first->delayed = true;
	}
	add_step(plan, device, verb, STEP_PLAIN)->request.number =
		starts ? (uint8_t)args->program_number : 0;
	if (readable)
		add_step(plan, device, XYZA_PROGRAM_STATE, STEP_EXPECT_PROGRAM);
	/* Before its delay is over a started program shows as idle. */
	plan->unproven = !readable || (starts && args->program_delay > 0);
}

/* --- all of them ------------------------------------------------------------------------------ */

void xyza_plan_command(struct xyza_plan *plan, struct db_device *device,
                       const struct db_request *request, bool out_of_step)
{
	const struct db_args *args = request->args;
	uint32_t power = 1u << device->axis;
	unsigned bit;

	*plan = (struct xyza_plan){ .steps = plan->steps };
	switch (request->command) {
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		plan_stop(plan, device, request->command == DB_CMD_QUICK_STOP);
		break;
	case DB_CMD_ENABLE:
		add_change(plan, device, XYZA_ENABLE, power, power);
		break;
	case DB_CMD_DISABLE:
		/* Switching off the power of a standing axis has no effect on the others. A moving
		 * axis is jogged, and then no other moves, or moves in the program, which cannot
		 * continue without it. A controller that may receive but cannot be understood is
		 * not asked first whether the axis stands. */
		if (!out_of_step)
			add_read(plan, device, XYZA_READ_STANDING, STEP_IF, UINT32_MAX, 0);
		if (device->first->program_state == XYZA_PROGRAM_RUNNING)
			add_step(plan, device, XYZA_PROGRAM_STOP, STEP_MAY_FAIL);
		else
			add_step(plan, device, XYZA_MANUAL_QUICK_STOP, STEP_MAY_FAIL);
		add_change(plan, device, XYZA_ENABLE, 0, power);
		break;
	case DB_CMD_MOVE_VELOCITY:
		if (args->target_velocity > 0.0f || args->target_velocity < 0.0f)
			plan_jog(plan, device, args->target_velocity < 0.0f,
			         fabsf(args->target_velocity));
		else
			add_standstill(plan, device);
		break;
	case DB_CMD_JOG_POSITIVE:
	case DB_CMD_JOG_NEGATIVE:
		plan_jog(plan, device, request->command == DB_CMD_JOG_NEGATIVE, 0.0f);
		break;
	case DB_CMD_SET_POSITION:
		plan_position(plan, device, args->target_position);
		break;
	case DB_CMD_SET_OUTPUT:
		bit = 1u << (args->output_number - 1);
		plan_outputs(plan, device, bit, args->output_value ? bit : 0);
		break;
	case DB_CMD_SET_OUTPUTS:
		plan_outputs(plan, device, args->output_mask,
		             args->output_levels & args->output_mask);
		break;
	case DB_CMD_SINGLE_STEP:
		add_step(plan, device,
		         args->output_value ? XYZA_PROGRAM_STEP_ON : XYZA_PROGRAM_STEP_OFF,
		         STEP_PLAIN);
		plan->unproven = true;
		break;
	default:
		plan_program(plan, device, request);
		break;
	}
}
