/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

#include <math.h>

/* --- what was read ---------------------------------------------------------------------------- */

void xyza_take_program(struct db_device *first, const struct xyza_reply *reply)
{
	first->program = reply->program;
	first->program_state = reply->state;
	first->program_step = reply->step;
	first->paused = false;
}

bool xyza_is_program_stopped(const struct db_device *first)
{
	return first->paused || first->program_state == XYZA_PROGRAM_WAITING ||
	       first->program_state == XYZA_PROGRAM_INTERRUPTED;
}

static void learn_one(struct db_device *device, enum xyza_param param, union db_value value,
                      db_time now)
{
	uint64_t bit = UINT64_C(1) << param;

	db_nameplate_note_told(&device->plate, &bit, now);

	/* A client with read access only must not read passwords. */
	if (xyza_params[param].traits & DB_PARAM_SECRET)
		value.u = 0;
	if ((device->plate.valid[0] & bit) && device->plate.values[param].u == value.u)
		return;
	device->plate.values[param] = value;
	device->plate.valid[0] |= bit;
	device->plate.generation++;
}

/* --- ramps ------------------------------------------------------------------------------------ */

#define RAMP_PARAMS                                                      \
	(UINT64_C(1) << XYZA_MIN_SPEED | UINT64_C(1) << XYZA_MAX_SPEED | \
	 UINT64_C(1) << XYZA_ACCELERATION_TIME)

static void show_ramp(struct db_nameplate *plate, enum xyza_param param, uint64_t needed,
                      union db_value ramp)
{
	uint64_t bit = UINT64_C(1) << param;
	bool known = (plate->valid[0] & needed) == needed;
	uint32_t oldest = 0;
	bool all = true;

	for (unsigned i = 0; i < XYZA_PARAM_COUNT; i++) {
		if (!(needed >> i & 1))
			continue;
		all = all && plate->told[i] != 0;
		if (oldest == 0 || db_told_after(oldest, plate->told[i]))
			oldest = plate->told[i];
	}
	plate->told[param] = all ? oldest : 0;
	plate->missing[0] = plate->missing[0] & needed ? plate->missing[0] | bit :
	                                                 plate->missing[0] & ~bit;
	if (known == ((plate->valid[0] & bit) != 0) && (!known || plate->values[param].u == ramp.u))
		return;
	plate->valid[0] ^= known == ((plate->valid[0] & bit) != 0) ? 0 : bit;
	plate->values[param] = ramp;
	plate->generation++;
}

/* Shows the ramps that result from the known values of an axis. */
static void show_ramps(struct db_device *device)
{
	struct db_nameplate *plate = &device->plate;
	union db_value ramp = { .f = xyza_ramp(plate->values[XYZA_MIN_SPEED].u,
		                               plate->values[XYZA_MAX_SPEED].u,
		                               plate->values[XYZA_ACCELERATION_TIME].u) };

	show_ramp(plate, XYZA_RAMP_ACCELERATION, RAMP_PARAMS, ramp);
	if (!(plate->values[XYZA_BRAKE].u >> device->axis & 1))
		ramp.f = 0.0f;
	show_ramp(plate, XYZA_RAMP_DECELERATION, RAMP_PARAMS | UINT64_C(1) << XYZA_BRAKE, ramp);
}

/* The bits of an item's parameters in a nameplate. */
static uint64_t params_of(enum xyza_item item)
{
	uint64_t bits = 0;

	for (unsigned i = 0; i < XYZA_PARAM_COUNT; i++) {
		if (xyza_param_places[i].item == item)
			bits |= UINT64_C(1) << i;
	}
	return bits;
}

void xyza_learn_item(struct db_device *device, enum xyza_item item, uint32_t content, db_time now)
{
	struct db_device *const *axes = device->first->axes;

	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (!axes[i] || (xyza_item_of_axis(item) && axes[i] != device))
			continue;
		axes[i]->unread &= ~(1u << item);
		axes[i]->plate.missing[0] &= ~params_of(item);
	}
	for (unsigned i = 0; i < XYZA_PARAM_COUNT; i++) {
		enum xyza_param param = (enum xyza_param)i;
		union db_value value;

		if (xyza_param_places[param].item != item ||
		    !(xyza_param_places[param].access & XYZA_CAN_READ))
			continue;
		value = xyza_param_get(param, content);
		if (xyza_item_of_axis(item))
			learn_one(device, param, value, now);
		for (unsigned j = 0; !xyza_item_of_axis(item) && j < XYZA_AXIS_COUNT; j++) {
			if (axes[j])
				learn_one(axes[j], param, value, now);
		}
	}
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (axes[i])
			show_ramps(axes[i]);
	}
}

void xyza_forget_item(struct db_device *device, enum xyza_item item)
{
	device->unread |= 1u << item;
	device->plate.valid[0] &= ~params_of(item);
	device->plate.missing[0] |= params_of(item);
	show_ramps(device);
}

void xyza_forget_all(struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i])
			first->axes[i]->plate.doubtful = true;
	}
}

void xyza_note_started(struct db_device *device, bool negative)
{
	device->commanded++;
	device->jogging = true;
	device->jog_negative = negative;
	device->just_commanded = true;
	device->standing = false;
	device->stopping = false;
}

void xyza_note_standing(struct db_device *device)
{
	device->commanded++;
	device->standing = true;
	device->jogging = device->just_commanded = device->stopping = false;
	device->expected_by = 0;
	device->velocity = 0.0f;
}

void xyza_doubt_standing(struct db_device *first, db_time now)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		struct db_device *device = first->axes[i];

		if (!device)
			continue;
		device->commanded++;
		device->just_commanded = true;
		device->expected_by = now + device->reaction;
	}
}

void xyza_note_stopped(struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		struct db_device *device = first->axes[i];

		if (!device)
			continue;
		device->held_until = 0;
		/* A program may have started it since. */
		if (device->standing && first->program_state != XYZA_PROGRAM_RUNNING)
			continue;
		device->commanded++;
		device->stopping = device->just_commanded = true;
	}
}

/* --- state ------------------------------------------------------------------------------------ */

static bool is_enabled(const struct db_device *device)
{
	const struct db_nameplate *plate = &device->plate;

	return (plate->valid[0] >> XYZA_ENABLE & 1) &&
	       (plate->values[XYZA_ENABLE].u >> device->axis & 1);
}

static enum db_axis_state state_of(const struct db_device *device)
{
	if (!device->has_position)
		return DB_AXIS_OFFLINE;
	if (device->first->program_state == XYZA_PROGRAM_INTERRUPTED && device->standing)
		return DB_AXIS_ERROR_STOP;
	if (device->stopping)
		return DB_AXIS_STOPPING;
	if (!device->standing || device->just_commanded)
		return DB_AXIS_CONTINUOUS_MOTION;
	return is_enabled(device) ? DB_AXIS_STANDSTILL : DB_AXIS_DISABLED;
}

/* Pulses per millimetre of the axis, from the controller's data of motor and spindle; 0. */
static float counts_per_unit(const struct db_nameplate *plate)
{
	uint64_t needed = UINT64_C(1) << XYZA_STEP_ANGLE | UINT64_C(1) << XYZA_MICROSTEP |
	                  UINT64_C(1) << XYZA_LEAD;
	double lead = (double)plate->values[XYZA_LEAD].u / 1000.0;

	if ((plate->valid[0] & needed) != needed || !(lead > 0.0))
		return 0.0f;
	return (float)((double)plate->values[XYZA_STEP_ANGLE].u *
	               (double)plate->values[XYZA_MICROSTEP].u / lead);
}

/* Its deceleration, Hz/s: INFINITY when it stands at once, 0 when that is not known. */
static float deceleration_of(const struct db_device *device)
{
	const struct db_nameplate *plate = &device->plate;

	if (!(plate->valid[0] >> XYZA_RAMP_DECELERATION & 1))
		return 0.0f;
	if (!(plate->values[XYZA_BRAKE].u >> device->axis & 1) ||
	    plate->values[XYZA_ACCELERATION_TIME].u == 0)
		return INFINITY;
	return plate->values[XYZA_RAMP_DECELERATION].f;
}

void xyza_write_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	const struct db_device *first = device->first;
	enum db_axis_state state = state_of(device);
	uint32_t status = 0;

	if (is_enabled(device))
		status |= DB_STATUS_ENABLED;
	if (!device->standing || device->just_commanded)
		status |= DB_STATUS_MOVING;
	if (state == DB_AXIS_STOPPING)
		status |= DB_STATUS_STOPPING;
	if (state == DB_AXIS_ERROR_STOP)
		status |= DB_STATUS_ERROR;
	if (device->params_valid)
		status |= DB_STATUS_PARAMS_VALID;
	if (device->refused)
		status |= DB_STATUS_REFUSED;
	feedback->taken = device->taken;
	feedback->position = device->position;
	feedback->velocity = device->velocity;
	feedback->velocity_is_computed = true;
	feedback->drive_status = (uint32_t)device->negative << STATUS_NEGATIVE |
	                         (uint32_t)device->standing << STATUS_STANDS |
	                         (uint32_t)first->program_state << STATUS_PROGRAM;
	feedback->inputs = xyza_inputs(first->ports);
	feedback->outputs = xyza_outputs(first->ports);
	/* The controller still reports the last program that ran. */
	feedback->program = first->program_state == XYZA_PROGRAM_IDLE ? 0 : first->program;
	feedback->program_state = first->program_part.pause > 0 ? PROGRAM_STATE_UNKNOWN :
	                                                          first->program_state;
	feedback->program_step = first->program_step;
	feedback->counts_per_unit = counts_per_unit(&device->plate);
	feedback->deceleration = deceleration_of(device);
	feedback->error = state == DB_AXIS_ERROR_STOP ? DB_ERROR_INTERRUPTED : DB_ERROR_NONE;
	feedback->state = (uint16_t)state;
	feedback->status = status;
	restart_show(&device->restart, feedback);
}

void xyza_forget_state(struct db_device *device)
{
	device->has_position = false;
	device->params_valid = false;
	device->jogging = device->just_commanded = device->stopping = false;
	device->expected_by = device->held_until = device->span = 0;
	/* A different controller may come back, with items that this one lacked. */
	device->unread = 0;
	device->plate.missing[0] = 0;
	device->first->turn.silent.pause = device->first->turn.silent_power.pause = 0;
	restart_note_away(&device->restart);
}

void xyza_gone(struct db_device *device)
{
	/* The loss by which the controller went says nothing about one of its axes. */
	if (device->has_position) {
		device->first->polling = false;
		device->part.losses = 0;
	}
	/* It may be there now, or another controller. */
	device->part.again_at = 0;
	xyza_forget_state(device);
}
