/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/xyza_controller.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const sim_xyza_kinds[SIM_XYZA_KIND_COUNT + 1] = {
	[SIM_XYZA_POSITION] = "position", [SIM_XYZA_SIGN] = "sign", [SIM_XYZA_ITEM] = "item",
	[SIM_XYZA_OUTPUT] = "output",     [SIM_XYZA_JOG] = "jog",   [SIM_XYZA_PROGRAM] = "program",
};

/* A handler returns false when the request fails. */
typedef bool handler_fn(struct sim_xyza *controller, const struct xyza_request *request);

void sim_xyza_config_init(struct sim_xyza_config *config, unsigned number)
{
	static const struct {
		enum xyza_item item;
		uint32_t content;
	} values[] = {
		{ XYZA_ITEM_MIN_SPEED, 200 },     { XYZA_ITEM_MAX_SPEED, 6400 },
		{ XYZA_ITEM_MANUAL_SPEED, 3200 }, { XYZA_ITEM_ACCELERATION_TIME, 2 },
		{ XYZA_ITEM_STEP_ANGLE, 200 },    { XYZA_ITEM_MICROSTEP, 16 },
		{ XYZA_ITEM_LEAD, 5000 },         { XYZA_ITEM_KEYS, 0x080706 },
		{ XYZA_ITEM_SYSTEM_INFO, 1 },
	};

	*config = (struct sim_xyza_config){
		.number = number,
		.axes = XYZA_AXIS_COUNT,
		.programs = 8,
		.steps = 300,
		.step_time = DB_NS_PER_S / 2,
	};
	for (size_t axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		for (size_t i = 0; i < sizeof(values) / sizeof(values[0]); i++)
			config->defaults[axis][values[i].item] = values[i].content;
	}
}

/* --- programs --------------------------------------------------------------------------------- */

static bool program_active(const struct sim_xyza *controller)
{
	return controller->state != XYZA_PROGRAM_IDLE || controller->starting;
}

static void end_program(struct sim_xyza *controller)
{
	controller->state = XYZA_PROGRAM_IDLE;
	controller->starting = false;
	controller->step = 0;
}

static void next_step(struct sim_xyza *controller)
{
	double speed;

	if (controller->step == controller->config.steps) {
		sim_xyza_axes_stop(&controller->axes);
		end_program(controller);
		return;
	}
	controller->state = XYZA_PROGRAM_RUNNING;
	controller->starting = false;
	controller->step++;
	controller->step_end = controller->now + controller->config.step_time;
	speed = (double)sim_xyza_memory_get(&controller->memory, XYZA_ITEM_MAX_SPEED, XYZA_X);
	sim_xyza_axes_run(&controller->axes, XYZA_X, controller->step % 2 ? speed : -speed);
}

static void pause_program(struct sim_xyza *controller, enum xyza_program_state state)
{
	/* Cancels a start that still waits for its delay. */
	if (controller->starting) {
		end_program(controller);
		return;
	}
	if (controller->state == XYZA_PROGRAM_RUNNING ||
	    (controller->state == XYZA_PROGRAM_WAITING && state == XYZA_PROGRAM_INTERRUPTED))
		controller->state = state;
	sim_xyza_axes_stop(&controller->axes);
}

static bool start_program(struct sim_xyza *controller, unsigned program)
{
	if (program < 1 || program > controller->config.programs || program_active(controller) ||
	    sim_xyza_axes_busy(&controller->axes))
		return false;
	controller->program = program;
	controller->step = 0;
	controller->starting = true;
	controller->step_end = controller->now + (db_time)controller->delay * DB_NS_PER_S;
	if (controller->delay == 0)
		next_step(controller);
	return true;
}

static bool resume_program(struct sim_xyza *controller)
{
	if (controller->state != XYZA_PROGRAM_WAITING &&
	    controller->state != XYZA_PROGRAM_INTERRUPTED)
		return false;
	next_step(controller);
	return true;
}

static bool is_timed(const struct sim_xyza *controller)
{
	return controller->starting || controller->state == XYZA_PROGRAM_RUNNING;
}

void sim_xyza_advance(struct sim_xyza *controller, db_time now)
{
	if (now < controller->now)
		return;
	while (controller->powered && is_timed(controller) && controller->step_end <= now) {
		sim_xyza_axes_advance(&controller->axes, controller->step_end);
		controller->now = controller->step_end;
		if (controller->single_step && controller->step < controller->config.steps &&
		    controller->step > 0)
			pause_program(controller, XYZA_PROGRAM_WAITING);
		else
			next_step(controller);
	}
	sim_xyza_axes_advance(&controller->axes, now);
	controller->now = now;
}

bool sim_xyza_busy(const struct sim_xyza *controller)
{
	return controller->powered &&
	       (is_timed(controller) || sim_xyza_axes_busy(&controller->axes));
}

/* --- power ------------------------------------------------------------------------------------ */

static void set_defaults(struct sim_xyza *controller)
{
	memcpy(controller->memory.items, controller->config.defaults,
	       sizeof(controller->memory.items));
	controller->memory.items[XYZA_X][XYZA_ITEM_SLAVE_NUMBER] = controller->config.number;
}

/* False when the present values will be lost with the power. */
static bool save_items(const struct sim_xyza *controller)
{
	return controller->flash_path[0] == '\0' ||
	       sim_xyza_memory_save(&controller->memory, controller->flash_path) == 0;
}

static void power_up(struct sim_xyza *controller)
{
	if (controller->flash_path[0] != '\0' &&
	    sim_xyza_memory_load(&controller->memory, controller->flash_path) != 0)
		set_defaults(controller);
	controller->powered = true;
	controller->reset_done = DB_TIME_NEVER;
	controller->outputs = 0;
	controller->delay = 0;
	controller->single_step = false;
	controller->program = 0;
	end_program(controller);
	sim_xyza_axes_init(&controller->axes, &controller->memory, &controller->config.temper,
	                   controller->now);
	if (sim_xyza_memory_get(&controller->memory, XYZA_ITEM_START_UP, XYZA_X) == 1)
		(void)start_program(controller, 1);
}

struct sim_xyza *sim_xyza_new(const struct sim_xyza_config *config, db_time now)
{
	struct sim_xyza *controller = calloc(1, sizeof(*controller));

	if (!controller)
		return NULL;
	controller->config = *config;
	controller->config.flash_path = NULL;
	if (config->flash_path)
		snprintf(controller->flash_path, sizeof(controller->flash_path), "%s",
		         config->flash_path);
	controller->now = now;
	set_defaults(controller);
	power_up(controller);
	return controller;
}

void sim_xyza_power(struct sim_xyza *controller, bool on, db_time now)
{
	sim_xyza_advance(controller, now);
	if (on == controller->powered)
		return;
	if (on) {
		power_up(controller);
		return;
	}
	sim_xyza_axes_halt(&controller->axes);
	if (controller->reset_done <= controller->now) {
		set_defaults(controller);
		(void)save_items(controller);
	}
	controller->powered = false;
}

/* --- requests --------------------------------------------------------------------------------- */

/* Sets the amount or the sign of an axis's position, or clears it. */
static bool write_position(struct sim_xyza *controller, const struct xyza_request *request)
{
	double position = sim_xyza_axes_position(&controller->axes, request->axis);
	double magnitude = 0.0;
	bool negative = false;

	if (request->verb == XYZA_WRITE_SIGN) {
		magnitude = fabs(position);
		negative = request->negative;
	} else if (request->verb == XYZA_WRITE_MAGNITUDE) {
		magnitude = (double)request->value;
		negative = !controller->config.temper.amount_clears_sign && signbit(position);
	}
	sim_xyza_axes_set_position(&controller->axes, request->axis,
	                           negative ? -magnitude : magnitude);
	return true;
}

static bool write_output(struct sim_xyza *controller, const struct xyza_request *request)
{
	unsigned bits = request->verb == XYZA_WRITE_OUTPUTS ? (1u << XYZA_OUTPUTS) - 1 :
	                                                      1u << (request->number - 1);

	controller->outputs = (uint16_t)(request->on ? controller->outputs | bits :
	                                               controller->outputs & ~bits);
	return true;
}

static bool write_item(struct sim_xyza *controller, const struct xyza_request *request)
{
	const struct sim_xyza_temper *temper = &controller->config.temper;
	bool sets_min = request->item == XYZA_ITEM_MIN_SPEED;
	bool sets_max = request->item == XYZA_ITEM_MAX_SPEED;
	uint32_t min = sim_xyza_memory_get(&controller->memory, XYZA_ITEM_MIN_SPEED, request->axis);
	uint32_t max = sim_xyza_memory_get(&controller->memory, XYZA_ITEM_MAX_SPEED, request->axis);
	uint32_t content;

	/* The lowest speed would be above the highest one. */
	if (temper->ordered_speeds &&
	    ((sets_min && request->value > max) || (sets_max && request->value < min)))
		return false;
	if (request->item == XYZA_ITEM_FACTORY_RESET) {
		sim_xyza_axes_halt(&controller->axes);
		end_program(controller);
		controller->reset_done = controller->now + SIM_XYZA_RESET_TIME;
		return true;
	}
	content = request->value;
	if (temper->clamps && (sets_min || sets_max || request->item == XYZA_ITEM_MANUAL_SPEED) &&
	    content > SIM_XYZA_SPEED_MAX)
		content = SIM_XYZA_SPEED_MAX;
	sim_xyza_memory_set(&controller->memory, request->item, request->axis, content,
	                    controller->now, controller->now + temper->item_delay);
	return save_items(controller);
}

static bool start_jog(struct sim_xyza *controller, const struct xyza_request *request)
{
	double speed = (double)sim_xyza_memory_get(&controller->memory, XYZA_ITEM_MANUAL_SPEED,
	                                           request->axis);

	if (program_active(controller))
		return false;
	for (unsigned axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		if ((axis != request->axis || controller->config.temper.jogs_from_stand) &&
		    sim_motion_moving(&controller->axes.list[axis].motion))
			return false;
	}
	if (controller->config.temper.latches_speed &&
	    sim_motion_moving(&controller->axes.list[request->axis].motion) &&
	    (sim_xyza_axis_state(controller, request->axis).speed < 0.0) == request->negative)
		return true;
	sim_xyza_axes_jog(&controller->axes, request->axis, request->negative ? -speed : speed,
	                  controller->now);
	return true;
}

static bool manual_stop(struct sim_xyza *controller, const struct xyza_request *request)
{
	if (program_active(controller))
		return true;
	if (request->verb == XYZA_MANUAL_QUICK_STOP)
		sim_xyza_axes_halt(&controller->axes);
	else
		sim_xyza_axes_stop(&controller->axes);
	return true;
}

static bool program_stop(struct sim_xyza *controller, const struct xyza_request *request)
{
	bool quick = request->verb == XYZA_PROGRAM_QUICK_STOP;

	if (!program_active(controller))
		return true;
	if (controller->config.temper.second_stop_ends &&
	    controller->state >= XYZA_PROGRAM_WAITING) {
		end_program(controller);
		return true;
	}
	pause_program(controller, quick ? XYZA_PROGRAM_INTERRUPTED : XYZA_PROGRAM_WAITING);
	if (quick)
		sim_xyza_axes_halt(&controller->axes);
	return true;
}

/* Starts, continues and ends programs, and sets their delay and single steps. */
static bool run_program(struct sim_xyza *controller, const struct xyza_request *request)
{
	switch (request->verb) {
	case XYZA_PROGRAM_START:
		return start_program(controller, request->number);
	case XYZA_PROGRAM_CONTINUE:
		return resume_program(controller);
	case XYZA_PROGRAM_END:
		if (controller->state == XYZA_PROGRAM_RUNNING || controller->starting)
			return false;
		end_program(controller);
		return true;
	case XYZA_PROGRAM_DELAY:
		controller->delay = request->number;
		return true;
	default:
		controller->single_step = request->verb == XYZA_PROGRAM_STEP_ON;
		return true;
	}
}

/* Null: it only asks. */
static handler_fn *const handlers[XYZA_VERB_COUNT] = {
	[XYZA_WRITE_MAGNITUDE] = write_position, [XYZA_WRITE_SIGN] = write_position,
	[XYZA_WRITE_OUTPUT] = write_output,      [XYZA_WRITE_OUTPUTS] = write_output,
	[XYZA_WRITE_ITEM] = write_item,          [XYZA_MANUAL_QUICK_STOP] = manual_stop,
	[XYZA_MANUAL_STOP] = manual_stop,        [XYZA_MANUAL_JOG] = start_jog,
	[XYZA_MANUAL_CLEAR] = write_position,    [XYZA_PROGRAM_QUICK_STOP] = program_stop,
	[XYZA_PROGRAM_STOP] = program_stop,      [XYZA_PROGRAM_START] = run_program,
	[XYZA_PROGRAM_CLEAR] = write_position,   [XYZA_PROGRAM_DELAY] = run_program,
	[XYZA_PROGRAM_CONTINUE] = run_program,   [XYZA_PROGRAM_END] = run_program,
	[XYZA_PROGRAM_STEP_ON] = run_program,    [XYZA_PROGRAM_STEP_OFF] = run_program,
};

static void fill_reply(struct sim_xyza *controller, const struct xyza_request *request,
                       struct xyza_reply *reply)
{
	double position = sim_xyza_axes_position(&controller->axes, request->axis);
	uint32_t value;

	switch (request->verb) {
	case XYZA_READ_MAGNITUDE:
		/* The counter is 32 bits wide and wraps in endless running. */
		value = (uint32_t)(int64_t)llround(fabs(position));
		break;
	case XYZA_READ_SIGN:
		value = signbit(position) != 0;
		break;
	case XYZA_READ_STANDING:
		value = controller->axes.list[request->axis].standing_bit.shown;
		break;
	case XYZA_READ_PORTS:
		value = (uint32_t)controller->outputs << 16 | controller->inputs;
		break;
	case XYZA_READ_ITEM:
		value = sim_xyza_memory_show(&controller->memory, request->item, request->axis,
		                             controller->now);
		break;
	case XYZA_PROGRAM_STATE:
		reply->kind = XYZA_REPLY_PROGRAM_STATE;
		reply->state = controller->state == XYZA_PROGRAM_IDLE ?
		                       controller->config.temper.idle_state :
		                       (uint8_t)controller->state;
		reply->program = (uint8_t)controller->program;
		reply->step = (uint16_t)controller->step;
		return;
	default:
		reply->kind = XYZA_REPLY_DONE;
		return;
	}
	xyza_fill_data(request, value, &controller->config.style, reply);
}

/* SIM_XYZA_KIND_COUNT: no kind that can be ignored. */
static enum sim_xyza_kind kind_of(enum xyza_verb verb)
{
	switch (verb) {
	case XYZA_WRITE_MAGNITUDE:
	case XYZA_MANUAL_CLEAR:
		return SIM_XYZA_POSITION;
	case XYZA_WRITE_SIGN:
		return SIM_XYZA_SIGN;
	case XYZA_WRITE_ITEM:
		return SIM_XYZA_ITEM;
	case XYZA_WRITE_OUTPUT:
	case XYZA_WRITE_OUTPUTS:
		return SIM_XYZA_OUTPUT;
	case XYZA_MANUAL_JOG:
		return SIM_XYZA_JOG;
	case XYZA_PROGRAM_START:
	case XYZA_PROGRAM_CONTINUE:
	case XYZA_PROGRAM_END:
		return SIM_XYZA_PROGRAM;
	default:
		return SIM_XYZA_KIND_COUNT;
	}
}

/* Returns whether it carried out the request. */
static bool carry_out(struct sim_xyza *controller, const struct xyza_request *request,
                      enum xyza_error error)
{
	/* All verbs about an axis name it; the others have x there. */
	return (error == XYZA_OK ||
	        (controller->config.temper.takes_any && error == XYZA_ERR_RANGE &&
	         request->verb == XYZA_WRITE_ITEM)) &&
	       (unsigned)request->axis < controller->config.axes &&
	       !(controller->config.temper.ignores >> kind_of(request->verb) & 1) &&
	       (!handlers[request->verb] || handlers[request->verb](controller, request));
}

/* True if it does not answer this request. */
static bool lacks(const struct sim_xyza *controller, const struct xyza_request *request)
{
	const struct sim_xyza_temper *temper = &controller->config.temper;

	switch (request->verb) {
	case XYZA_READ_ITEM:
		return temper->lacks >> request->item & 1;
	case XYZA_READ_PORTS:
		return temper->lacks_ports;
	case XYZA_PROGRAM_STATE:
		return temper->lacks_program;
	default:
		return false;
	}
}

bool sim_xyza_execute(struct sim_xyza *controller, const struct xyza_request *request,
                      enum xyza_error error, db_time now, struct xyza_reply *reply)
{
	const struct sim_xyza_temper *temper = &controller->config.temper;

	sim_xyza_advance(controller, now);
	if (!controller->powered || controller->reset_done != DB_TIME_NEVER ||
	    (error == XYZA_OK && lacks(controller, request)))
		return false;
	*reply = (struct xyza_reply){
		.kind = XYZA_REPLY_FAILED,
		.object = request->object,
		.order = request->order,
	};
	if (!carry_out(controller, request, error)) {
		controller->failures++;
		/* It may acknowledge what it does not do. */
		if (error == XYZA_OK && !xyza_is_read(request->verb) &&
		    (temper->acknowledges_all || (temper->ignores >> kind_of(request->verb) & 1)))
			reply->kind = XYZA_REPLY_DONE;
		return true;
	}
	controller->counts[request->verb]++;
	fill_reply(controller, request, reply);
	return true;
}

/* --- from outside ----------------------------------------------------------------------------- */

static void press_key(struct sim_xyza *controller, unsigned number)
{
	uint32_t keys = sim_xyza_memory_get(&controller->memory, XYZA_ITEM_KEYS, XYZA_X);

	if (number == xyza_param_get(XYZA_START_KEY, keys).u) {
		if (!resume_program(controller))
			(void)start_program(controller,
			                    controller->program ? controller->program : 1);
	} else if (number == xyza_param_get(XYZA_STOP_KEY, keys).u) {
		if (controller->state == XYZA_PROGRAM_RUNNING || controller->starting)
			pause_program(controller, XYZA_PROGRAM_WAITING);
		else
			end_program(controller);
	} else if (number == xyza_param_get(XYZA_PAUSE_KEY, keys).u) {
		pause_program(controller, XYZA_PROGRAM_WAITING);
	}
}

void sim_xyza_set_input(struct sim_xyza *controller, unsigned number, bool level, db_time now)
{
	unsigned bit;
	bool before;

	if (number < 1 || number > SIM_XYZA_INPUTS)
		return;
	sim_xyza_advance(controller, now);
	bit = 1u << (number - 1);
	before = (controller->inputs & bit) != 0;
	controller->inputs = (uint16_t)(level ? controller->inputs | bit :
	                                        controller->inputs & ~bit);
	if (level && !before && controller->powered && controller->reset_done == DB_TIME_NEVER)
		press_key(controller, number);
}

void sim_xyza_set_item(struct sim_xyza *controller, enum xyza_item item, enum xyza_axis axis,
                       uint32_t content, db_time now)
{
	sim_xyza_advance(controller, now);
	sim_xyza_memory_set(&controller->memory, item, axis, content, now, now);
	(void)save_items(controller);
}

void sim_xyza_place(struct sim_xyza *controller, enum xyza_axis axis, int32_t position, db_time now)
{
	sim_xyza_advance(controller, now);
	controller->axes.list[axis].due = DB_TIME_NEVER;
	sim_motion_halt(&controller->axes.list[axis].motion);
	sim_xyza_axes_set_position(&controller->axes, axis, position);
}

/* --- its behaviour ---------------------------------------------------------------------------- */

struct sim_xyza_axis_state sim_xyza_axis_state(const struct sim_xyza *controller,
                                               enum xyza_axis axis)
{
	return (struct sim_xyza_axis_state){
		.position = controller->axes.list[axis].motion.position,
		.speed = controller->axes.list[axis].motion.velocity,
		.standing = !sim_motion_moving(&controller->axes.list[axis].motion),
	};
}
