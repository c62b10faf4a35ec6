/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/vsmd_private.h"

#include "codec/vsmd_serial_frames.h"
#include "driver/vsmd/restart.h"

#include <math.h>
#include <string.h>

/* During homing the axis stands for a moment between phases; standing longer than homing-pause-ms,
 * in several samples, means that it ended without reaching its end. */
#define HOMING_STATUSES 5

void vsmd_axis_init(struct vsmd_axis *axis, const struct vsmd_link *link,
                    const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	const struct vsmd_drive_options *options = drive->options;

	axis->link = link;
	DB_NAMEPLATE_INIT(&axis->plate, &axis->plate_room, VSMD_PARAM_COUNT);
	axis->config = drive;
	axis->save_interval = (db_time)bus->save_interval_s * DB_NS_PER_S;
	axis->window = drive->in_position_window * drive->counts_per_unit;
	axis->reaction = (db_time)options->reaction_ms * DB_NS_PER_MS;
	axis->save_time = (db_time)options->save_ms * DB_NS_PER_MS;
	axis->homing_pause = (db_time)options->homing_pause_ms * DB_NS_PER_MS;
	axis->unsigned_speed = options->speed_sign != 0;
}

float vsmd_preset_speed(const struct vsmd_axis *axis)
{
	if (!(axis->plate.valid[0] >> VSMD_SPD & 1) || axis->plate.doubtful)
		return NAN;
	return axis->plate.values[VSMD_SPD].f;
}

/* --- what the answers teach ------------------------------------------------------------------- */

static void forget_motion(struct vsmd_axis *axis)
{
	axis->motion = VSMD_MOTION_NONE;
	axis->begun = VSMD_MOTION_NONE;
	axis->just_commanded = false;
	axis->stopping = false;
	axis->standstill_count = 0;
	axis->goal = (struct vsmd_goal){ .kind = VSMD_GOAL_REST };
}

const char *vsmd_bare_identity(const char *text, size_t *length)
{
	while (*length > 0 && vsmd_is_blank(*text)) {
		text++;
		(*length)--;
	}
	/* The document's examples have the text in quotation marks, drives send it without. */
	if (*length >= 2 && text[0] == '"' && text[*length - 1] == '"') {
		text++;
		*length -= 2;
	}
	return text;
}

void vsmd_take_identity(struct vsmd_axis *axis, const char *text, size_t length)
{
	char kept[DB_IDENTITY_MAX] = { 0 };

	text = vsmd_bare_identity(text, &length);
	for (size_t i = 0; i < length && i < sizeof(kept) && text[i] >= ' '; i++)
		kept[i] = text[i];
	if (memcmp(kept, axis->plate.identity, sizeof(kept)) != 0) {
		memcpy(axis->plate.identity, kept, sizeof(kept));
		axis->plate.generation++;
		/* Another drive, or another firmware version. */
		axis->memory = (struct vsmd_memory){ .unsaved = false };
	}
}

void vsmd_take_settings(struct vsmd_axis *axis, const struct db_request *request)
{
	for (size_t i = 0; i < request->setting_count; i++) {
		const struct db_setting *setting = &request->settings[i];

		axis->plate.values[setting->param] = setting->value;
		axis->plate.valid[0] |= UINT64_C(1) << setting->param;
		/* A running motor follows the preset speed. */
		if (setting->param == VSMD_SPD)
			axis->goal.kind = VSMD_GOAL_UNKNOWN;
	}
	axis->plate.generation++;
	vsmd_memory_follow(&axis->memory, &axis->plate, false);
}

/* True if it has stood longer than homing stands between two phases; called once for each
 * status. */
static bool stands_for_good(struct vsmd_axis *axis)
{
	if (axis->standstill_count++ == 0)
		axis->standstill_since = axis->status_at;
	return axis->standstill_count > HOMING_STATUSES &&
	       axis->status_at - axis->standstill_since > axis->homing_pause;
}

static void found_origin(struct vsmd_axis *axis)
{
	axis->homed = true;
	axis->placed = true;
	axis->origin_lost = false;
	axis->doubt.kind = DB_DOUBT_NONE;
	axis->effect_until = 0;
}

void vsmd_follow_motion(struct vsmd_axis *axis)
{
	uint32_t status = axis->last.status;

	axis->just_commanded = false;
	if (!(status & VSMD_ST_STP)) {
		axis->standstill_count = 0;
		if (axis->motion == VSMD_MOTION_NONE) {
			axis->motion = VSMD_MOTION_UNKNOWN;
			axis->goal.kind = VSMD_GOAL_UNKNOWN;
		}
		return;
	}
	axis->stopping = false;
	if (axis->motion == VSMD_MOTION_UNKNOWN) {
		/* It may be homing, between two phases. */
		if ((status & VSMD_ST_ZERO) || stands_for_good(axis))
			forget_motion(axis);
	} else if (axis->motion != VSMD_MOTION_HOMING) {
		axis->motion = VSMD_MOTION_NONE;
		axis->goal.kind = VSMD_GOAL_REST;
	} else if ((status & VSMD_ST_ZERO) && !axis->zero_is_old) {
		found_origin(axis);
		forget_motion(axis);
	} else if (stands_for_good(axis)) {
		forget_motion(axis);
	}
}

/* --- origin and restarts ---------------------------------------------------------------------- */

/* The origin of its position is not known any more. */
static void lose_origin(struct vsmd_axis *axis)
{
	axis->upsets++;
	axis->homed = false;
	axis->placed = false;
	axis->origin_lost = true;
	axis->has_target = false;
	axis->goal.kind = VSMD_GOAL_UNKNOWN;
}

/* Its former commands and settings are lost. */
static void forget_drive(struct vsmd_axis *axis)
{
	bool counted = !vsmd_is_at(axis, axis->last.position, 0);
	/* A drive that was never given an origin has lost nothing by being offline. */
	bool lost = !axis->away || axis->placed || axis->homed || counted || axis->origin_lost;

	forget_motion(axis);
	lose_origin(axis);
	axis->origin_lost = lost;
	axis->params_valid = false;
	axis->memory.restarted = true;
	axis->doubt.kind = DB_DOUBT_NONE;
	axis->restarts++;
}

static void refute_doubt(struct vsmd_axis *axis)
{
	axis->homed = axis->doubt.homed;
	axis->placed = axis->doubt.placed;
	axis->origin_lost = axis->doubt.origin_lost;
	axis->doubt.kind = DB_DOUBT_NONE;
}

void vsmd_take_all_params(struct vsmd_axis *axis)
{
	struct vsmd_memory *memory = &axis->memory;
	bool unsaved = memory->unsaved;
	bool differ = vsmd_memory_differs(&memory->seen, &axis->plate);
	bool doubtful = axis->doubt.kind != DB_DOUBT_NONE;

	axis->plate.generation++;
	axis->plate.doubtful = false;
	axis->params_valid = true;
	memory->restarted |= doubtful;
	vsmd_memory_follow(memory, &axis->plate, true);
	axis->params_differ = differ && axis->away;
	if (doubtful && differ) {
		/* The parameters were read again already. */
		forget_drive(axis);
		axis->params_valid = true;
		axis->memory.restarted = false;
	} else if (doubtful && unsaved) {
		/* Without power it would have lost them. */
		refute_doubt(axis);
	}
}

/* Judges by the new status what happened since the previous one. */
static void follow_restarts(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now)
{
	struct vsmd_restart restart = vsmd_judge_restart(axis, position, word, now);

	axis->handshake_lapses |= (axis->last.status & ~word & VSMD_ST_HS) != 0;
	axis->plate.doubtful |= restart.reread;
	switch (restart.verdict) {
	case VSMD_RESTARTED:
		forget_drive(axis);
		break;
	case VSMD_MAY_HAVE_RESTARTED:
		/* The state to be restored when it is found not to have restarted. */
		axis->doubts++;
		axis->doubt = (struct vsmd_doubt){
			.kind = axis->away ? DB_DOUBT_SILENT : DB_DOUBT_SIGN,
			.position = axis->last.position,
			.homed = axis->homed,
			.placed = axis->placed,
			.origin_lost = axis->origin_lost,
		};
		if (restart.origin_lost) {
			forget_motion(axis);
			lose_origin(axis);
		}
		break;
	case VSMD_DISABLED_ITSELF:
		if (restart.origin_lost)
			lose_origin(axis);
		break;
	case VSMD_COUNTS_ON:
	default:
		if (axis->doubt.kind != DB_DOUBT_NONE && vsmd_refutes_doubt(axis, position))
			refute_doubt(axis);
		return;
	}
	axis->zero_is_old = (axis->last.status & word & VSMD_ST_ZERO) != 0;
}

void vsmd_take_confirmation(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now)
{
	uint32_t before = axis->last.status;
	bool first = !axis->known;

	if (!first)
		follow_restarts(axis, position, word, now);
	if (word & ~before & VSMD_ST_HS)
		axis->handshake_since = now;
	axis->known = true;
	axis->away = false;
	axis->params_differ = false;
	axis->last.position = position;
	axis->last.status = word;
	axis->refuses = (word & VSMD_ST_CMD_WRG) && !axis->unanswered;
	axis->unanswered = false;
	axis->status_at = now;
	if (!axis->watch.has_place)
		axis->watch.first_place = position;
	axis->watch.has_place = true;
	/* The homing bit shows that the drive has found its origin, at any master's command; but it
	 * stays set in a drive that was disabled since, whose counter restarted. */
	if (!(word & VSMD_ST_ZERO)) {
		axis->zero_is_old = false;
		return;
	}
	if (axis->zero_is_old || !(word & VSMD_ST_STP) || axis->motion == VSMD_MOTION_HOMING)
		return;
	if (first ? (word & VSMD_ST_PWR) != 0 : !(before & VSMD_ST_ZERO))
		found_origin(axis);
}

void vsmd_take_speed(struct vsmd_axis *axis, float velocity)
{
	axis->last.velocity = velocity;
	if (!axis->watch.has_speed)
		axis->watch.first_speed = velocity;
	axis->watch.speed = velocity;
	axis->watch.has_speed = true;
}

void vsmd_follow_way(struct vsmd_axis *axis, int32_t position)
{
	double way = vsmd_way(axis->farthest, position);

	if (axis->known && (axis->back ? way > 0.0 : way < 0.0)) {
		if (fabs(way) <= axis->window)
			return;
		axis->back = !axis->back;
	}
	axis->farthest = position;
}

float vsmd_with_sign(const struct vsmd_axis *axis, float speed)
{
	if (!axis->unsigned_speed)
		return speed;
	return axis->back ? -fabsf(speed) : fabsf(speed);
}

void vsmd_take_status(struct vsmd_axis *axis, const struct vsmd_status *status, db_time now)
{
	float velocity;

	vsmd_follow_way(axis, status->position);
	velocity = vsmd_with_sign(axis, status->velocity);
	vsmd_take_confirmation(axis, status->position, status->status, now);
	axis->last.velocity = velocity;
	axis->process = *status;
	axis->process.velocity = velocity;
	axis->taken = now;
	axis->has_status = true;
}

static void start_motion(struct vsmd_axis *axis, enum vsmd_motion motion)
{
	axis->motion = motion;
	axis->begun = VSMD_MOTION_NONE;
	axis->just_commanded = true;
	axis->stopping = false;
	axis->standstill_count = 0;
	axis->goal.kind = VSMD_GOAL_UNKNOWN;
	if (motion != VSMD_MOTION_DISCRETE)
		axis->has_target = false;
}

enum vsmd_motion vsmd_motion_to_end(const struct vsmd_axis *axis)
{
	return axis->begun != VSMD_MOTION_NONE ? axis->begun : axis->motion;
}

static void stop_motion(struct vsmd_axis *axis)
{
	axis->begun = VSMD_MOTION_NONE;
	if (axis->motion != VSMD_MOTION_NONE || !(axis->last.status & VSMD_ST_STP)) {
		axis->stopping = true;
		axis->just_commanded = true;
	}
	axis->goal.kind = VSMD_GOAL_REST;
	axis->has_target = false;
}

/* Changes of position, power and homing bit by commands show within this time plus the reaction
 * time. */
#define EFFECT_TIME (500 * DB_NS_PER_MS)

void vsmd_expect_change(struct vsmd_axis *axis)
{
	axis->effect_until = axis->status_at + EFFECT_TIME + axis->reaction;
}

/* After a standstill no motion has shown the direction yet: it is that of the command. */
static void head_for(struct vsmd_axis *axis, double way)
{
	if (axis->watch.before.moving || !(fabs(way) > 0.0))
		return;
	axis->back = way < 0.0;
	axis->farthest = axis->last.position;
}

static void run_with(struct vsmd_axis *axis, float velocity)
{
	head_for(axis, (double)velocity);
	start_motion(axis, VSMD_MOTION_CONTINUOUS);
	axis->goal = (struct vsmd_goal){
		.kind = isnan(velocity) ? VSMD_GOAL_UNKNOWN : VSMD_GOAL_VELOCITY,
		.velocity = velocity,
	};
}

/* The position was set, and seen. */
static void take_set_position(struct vsmd_axis *axis)
{
	axis->origin_lost = false;
	axis->doubt.kind = DB_DOUBT_NONE;
	axis->placed = true;
	axis->effect_until = 0;
	axis->has_target = false;
	/* Its target is counted from the new origin, too, and the direction is not known. */
	if (axis->goal.kind == VSMD_GOAL_POSITION)
		axis->goal.kind = VSMD_GOAL_UNKNOWN;
	/* Setting a position is no motion: the direction stays as it was. */
	axis->back = axis->watch.before.back;
	axis->farthest = axis->last.position;
	axis->last.velocity = vsmd_with_sign(axis, axis->last.velocity);
	axis->process.position = axis->last.position;
}

void vsmd_carry_out(struct vsmd_axis *axis, const struct db_request *request)
{
	const struct db_args *args = request->args;

	switch (request->command) {
	case DB_CMD_MOVE_VELOCITY:
		run_with(axis, args->target_velocity);
		break;
	case DB_CMD_MOVE_PRESET:
		run_with(axis, vsmd_preset_speed(axis));
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		head_for(axis, (double)axis->wanted - (double)axis->watch.before.position);
		start_motion(axis, VSMD_MOTION_DISCRETE);
		axis->has_target = true;
		axis->target = axis->wanted;
		axis->goal = (struct vsmd_goal){
			.kind = VSMD_GOAL_POSITION,
			.position = axis->wanted,
		};
		break;
	case DB_CMD_HOME:
		axis->homed = false;
		start_motion(axis, VSMD_MOTION_HOMING);
		break;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		start_motion(axis, VSMD_MOTION_SHAKE);
		break;
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
	case DB_CMD_HOME_STOP:
	case DB_CMD_SHAKE_STOP:
		stop_motion(axis);
		break;
	case DB_CMD_SET_POSITION:
		take_set_position(axis);
		break;
	case DB_CMD_DISABLE: /* section 2.4.3: the position becomes 0, the origin is lost */
		forget_motion(axis);
		axis->homed = false;
		axis->placed = false;
		axis->effect_until = 0;
		axis->origin_lost = true;
		axis->doubt.kind = DB_DOUBT_NONE;
		axis->zero_is_old = (axis->last.status & VSMD_ST_ZERO) != 0;
		axis->has_target = false;
		break;
	case DB_CMD_CLEAR_FAULT:
		axis->doubt.kind = DB_DOUBT_NONE;
		break;
	default:
		break;
	}
}

/* --- state ------------------------------------------------------------------------------------ */

unsigned vsmd_input_ports(const struct db_nameplate *plate)
{
	unsigned ports = 0;

	for (unsigned i = 0; i < 6; i++) {
		if ((plate->valid[0] >> (VSMD_S1 + i) & 1) && plate->values[VSMD_S1 + i].u == 0)
			ports |= 1u << i;
	}
	return ports;
}

bool vsmd_is_input(const struct vsmd_axis *axis, unsigned port)
{
	return !axis->plate.doubtful && (vsmd_input_ports(&axis->plate) >> (port - 1) & 1);
}

static uint16_t error_of(uint32_t status)
{
	if (status & VSMD_ST_ENC_ERR)
		return DB_ERROR_ENCODER;
	if (status & VSMD_ST_OVER_CURRENT)
		return DB_ERROR_OVER_CURRENT;
	if (status & VSMD_ST_OVER_TEMPERATURE)
		return DB_ERROR_OVER_TEMPERATURE;
	if (status & VSMD_ST_VOLTAGE)
		return DB_ERROR_VOLTAGE;
	if (status & VSMD_ST_FLT)
		return DB_ERROR_HARDWARE;
	if (status & VSMD_ST_FLASH_ERR)
		return DB_ERROR_FLASH;
	return DB_ERROR_NONE;
}

static enum db_axis_state state_of(const struct vsmd_axis *axis, uint16_t error)
{
	bool moving = !(axis->last.status & VSMD_ST_STP) || axis->just_commanded;

	if (error != DB_ERROR_NONE && error != DB_ERROR_FLASH)
		return DB_AXIS_ERROR_STOP;
	if (!(axis->last.status & VSMD_ST_PWR))
		return DB_AXIS_DISABLED;
	if (axis->motion == VSMD_MOTION_HOMING && !axis->stopping)
		return DB_AXIS_HOMING;
	if (!moving)
		return DB_AXIS_STANDSTILL;
	if (axis->stopping)
		return DB_AXIS_STOPPING;
	return axis->motion == VSMD_MOTION_DISCRETE ? DB_AXIS_DISCRETE_MOTION :
	                                              DB_AXIS_CONTINUOUS_MOTION;
}

static uint32_t status_of(const struct vsmd_axis *axis, enum db_axis_state state, uint16_t error)
{
	uint32_t drive = axis->last.status;
	bool stands = (drive & VSMD_ST_STP) && !axis->just_commanded;
	uint32_t status = 0;

	if (drive & VSMD_ST_PWR)
		status |= DB_STATUS_ENABLED;
	if (axis->homed)
		status |= DB_STATUS_HOMED;
	if (!stands)
		status |= DB_STATUS_MOVING;
	if (stands && axis->has_target && vsmd_is_at(axis, axis->last.position, axis->target))
		status |= DB_STATUS_AT_TARGET;
	if (state == DB_AXIS_HOMING)
		status |= DB_STATUS_HOMING;
	if (state == DB_AXIS_STOPPING)
		status |= DB_STATUS_STOPPING;
	if (state == DB_AXIS_ERROR_STOP)
		status |= DB_STATUS_ERROR;
	if (error == DB_ERROR_FLASH)
		status |= DB_STATUS_WARNING;
	if (axis->origin_lost)
		status |= DB_STATUS_ORIGIN_LOST;
	if (axis->params_valid)
		status |= DB_STATUS_PARAMS_VALID;
	if (axis->params_valid && axis->memory.unsaved)
		status |= DB_STATUS_PARAMS_UNSAVED;
	if (axis->refused)
		status |= DB_STATUS_REFUSED;
	return status;
}

void vsmd_write_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	const struct vsmd_axis *axis = (const struct vsmd_axis *)device;
	enum db_axis_state state;
	uint16_t outputs = 0;

	feedback->taken = axis->taken;
	feedback->position = axis->process.position;
	feedback->velocity = axis->process.velocity;
	feedback->velocity_is_computed = axis->computes_speed;
	feedback->has_target = axis->has_target;
	feedback->target = axis->target;
	feedback->drive_status = axis->last.status;
	feedback->inputs = (uint16_t)((axis->last.status & 0xFu) |
	                              (axis->last.status >> 12 & 0x30u));
	for (unsigned i = 0; i < 6; i++) {
		if ((axis->plate.valid[0] >> (VSMD_S1 + i) & 1) &&
		    axis->plate.values[VSMD_S1 + i].u == 1)
			outputs |= (uint16_t)(1u << i);
	}
	feedback->outputs = outputs & feedback->inputs;
	feedback->error = error_of(axis->last.status);
	state = axis->has_status ? state_of(axis, feedback->error) : DB_AXIS_OFFLINE;
	feedback->state = (uint16_t)state;
	feedback->status = status_of(axis, state, feedback->error);
	feedback->restarts = axis->restarts;
	feedback->doubts = axis->doubts;
	feedback->doubt = (uint8_t)axis->doubt.kind;
}

const struct db_nameplate *vsmd_get_nameplate(const struct db_device *device)
{
	return &((const struct vsmd_axis *)device)->plate;
}

void vsmd_axis_gone(struct db_device *device)
{
	struct vsmd_axis *axis = (struct vsmd_axis *)device;

	axis->params_valid = false;
	axis->has_status = false;
	axis->just_commanded = false;
	axis->away = true;
	axis->goal.kind = VSMD_GOAL_UNKNOWN;
}
