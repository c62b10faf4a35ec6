/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/axis.h"

#include <math.h>
#include <string.h>

/* Homing stands still for a moment between its phases; standing longer than homing-pause-ms, at more
 * than a few looks, means that it ended without reaching its end. */
#define HOMING_LOOKS 5

/* The handshake bit of some drives lapses after a while. One that stays for longer than this does not. */
#define HANDSHAKE_LAPSES (60 * DB_NS_PER_S)

void vsmd_axis_init(struct vsmd_axis *axis, const struct vsmd_link *link,
                    const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	axis->link = link;
	axis->config = drive;
	axis->save_interval = (db_time)bus->save_interval_s * DB_NS_PER_S;
	axis->window = drive->in_position_window * drive->counts_per_unit;
	axis->reaction = (db_time)drive->options[link->first_option] * DB_NS_PER_MS;
	axis->save_time = (db_time)drive->options[link->first_option + 1] * DB_NS_PER_MS;
	axis->homing_pause = (db_time)drive->options[link->first_option + 2] * DB_NS_PER_MS;
}

bool vsmd_is_at(const struct vsmd_axis *axis, int32_t position, int32_t place)
{
	return fabs((double)position - (double)place) <= axis->window;
}

float vsmd_preset_speed(const struct vsmd_axis *axis)
{
	if (!(axis->plate.valid >> VSMD_SPD & 1) || axis->plate.doubtful)
		return NAN;
	return axis->plate.values[VSMD_SPD].f;
}

/* --- what the answers teach -------------------------------------------------------------------- */

static void forget_motion(struct vsmd_axis *axis)
{
	axis->motion = VSMD_MOTION_NONE;
	axis->begun = VSMD_MOTION_NONE;
	axis->fresh = false;
	axis->stopping = false;
	axis->standstill_looks = 0;
	axis->goal = (struct vsmd_goal){ .kind = VSMD_GOAL_REST };
}

void vsmd_take_identity(struct vsmd_axis *axis, const char *text, size_t length)
{
	char kept[DB_IDENTITY_MAX] = { 0 };

	/* The document's samples carry the text in quotation marks, drives send it without. */
	if (length >= 2 && text[0] == '"' && text[length - 1] == '"') {
		text++;
		length -= 2;
	}
	for (size_t i = 0; i < length && i < sizeof kept && text[i] >= ' '; i++)
		kept[i] = text[i];
	if (memcmp(kept, axis->plate.identity, sizeof kept) != 0) {
		memcpy(axis->plate.identity, kept, sizeof kept);
		axis->plate.generation++;
		/* Another drive, or another firmware. */
		axis->memory = (struct vsmd_memory){ .unsaved = false };
	}
}

void vsmd_take_settings(struct vsmd_axis *axis, const struct db_request *request)
{
	for (size_t i = 0; i < request->setting_count; i++) {
		const struct db_setting *setting = &request->settings[i];

		axis->plate.values[setting->param] = setting->value;
		axis->plate.valid |= UINT64_C(1) << setting->param;
		/* A running motor follows the preset speed. */
		if (setting->param == VSMD_SPD)
			axis->goal.kind = VSMD_GOAL_UNKNOWN;
	}
	axis->plate.generation++;
	vsmd_memory_follow(&axis->memory, &axis->plate, false);
}

/* For longer than homing stands between two of its phases; asked once for each status. */
static bool stands_for_good(struct vsmd_axis *axis)
{
	if (axis->standstill_looks++ == 0)
		axis->standstill_since = axis->heard_at;
	return axis->standstill_looks > HOMING_LOOKS &&
	       axis->heard_at - axis->standstill_since > axis->homing_pause;
}

static void found_origin(struct vsmd_axis *axis)
{
	axis->homed = true;
	axis->placed = true;
	axis->origin_lost = false;
	axis->told_until = 0;
}

void vsmd_follow_motion(struct vsmd_axis *axis)
{
	uint32_t status = axis->last.status;

	axis->fresh = false;
	if (!(status & VSMD_ST_STP)) {
		axis->standstill_looks = 0;
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
	} else if (status & VSMD_ST_ZERO) {
		found_origin(axis);
		forget_motion(axis);
	} else if (stands_for_good(axis)) {
		forget_motion(axis);
	}
}

/* --- origin and restarts ------------------------------------------------------------------------- */

static bool has_dropped(uint32_t before, uint32_t now, uint32_t bit)
{
	return (before & ~now & bit) != 0;
}

/* What it was told before is gone. */
static void forget_drive(struct vsmd_axis *axis, bool sure)
{
	bool counted = !vsmd_is_at(axis, axis->last.position, 0);

	forget_motion(axis);
	/* From one that was never given an origin, nothing was lost by a time offline. */
	axis->origin_lost |= axis->placed || axis->homed || counted || sure;
	axis->homed = false;
	axis->placed = false;
	axis->has_target = false;
	axis->params_valid = false;
	axis->memory.restarted = true;
	axis->goal.kind = VSMD_GOAL_UNKNOWN;
}

/* Standing still where it stood, and not where counters begin: it has gone on counting. */
static bool counts_on(const struct vsmd_axis *axis, int32_t position)
{
	return vsmd_is_at(axis, position, axis->last.position) && !vsmd_is_at(axis, position, 0);
}

/* A sensor may be set to make its place the origin. */
static bool sensors_set_origin(const struct vsmd_axis *axis)
{
	for (unsigned param = VSMD_S1F; param <= VSMD_S6R; param++) {
		uint32_t event = axis->plate.values[param].u;

		if ((axis->plate.valid >> param & 1) && (event == 1 || event == 3 || event == 5))
			return true;
	}
	return false;
}

/* It stood, nobody told it anything, and it stands at 0 now. */
static bool jumped_home(const struct vsmd_axis *axis, int32_t position, uint32_t word)
{
	if (!(axis->last.status & VSMD_ST_STP) || !(word & VSMD_ST_STP) ||
	    axis->motion != VSMD_MOTION_NONE || axis->begun != VSMD_MOTION_NONE || axis->fresh)
		return false;
	return vsmd_is_at(axis, position, 0) && !vsmd_is_at(axis, axis->last.position, 0) &&
	       !sensors_set_origin(axis);
}

/* The handshake bit alone proves little: in some drives it lapses. Believed the first time, and when it
 * stood for long. */
static bool dropped_handshake(struct vsmd_axis *axis, int32_t position, uint32_t word)
{
	bool long_set = axis->heard_at - axis->handshake_since > HANDSHAKE_LAPSES;

	if (!has_dropped(axis->last.status, word, VSMD_ST_HS))
		return false;
	if ((axis->last.status & word & VSMD_ST_ZERO) || counts_on(axis, position) ||
	    !(word & VSMD_ST_STP)) {
		axis->handshake_lapses = true;
		return false;
	}
	if (axis->handshake_lapses && !long_set)
		return false;
	axis->handshake_lapses = true;
	return true;
}

/* The highest speed that it may have had since it was read last, as far as is known. */
static double top_speed(const struct vsmd_axis *axis)
{
	bool known = axis->plate.valid >> VSMD_SPD & 1;
	double preset = known ? (double)axis->plate.values[VSMD_SPD].f : (double)VSMD_SPEED_MAX;
	double seen = fmax(fabs((double)axis->last.velocity), fabs((double)axis->process.velocity));

	return fmax(fmax(preset, seen), fabs((double)axis->goal.velocity));
}

/* It moved, and stands at 0 now, sooner than it could have come there. */
static bool jumped_from_motion(const struct vsmd_axis *axis, int32_t position, uint32_t word,
                               db_time now)
{
	double way = fabs((double)axis->last.position - (double)position);
	double time = (double)(now - axis->heard_at) / (double)DB_NS_PER_S;

	if ((axis->last.status & VSMD_ST_STP) || !(word & VSMD_ST_STP) ||
	    !vsmd_is_at(axis, position, 0) || sensors_set_origin(axis))
		return false;
	return way > 2.0 * top_speed(axis) * time + axis->window;
}

/* Whether the drive has begun to count anew since it was read last. */
static bool has_restarted(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now)
{
	uint32_t before = axis->last.status;

	if (axis->away)
		return !(before & word & VSMD_ST_ZERO) && !counts_on(axis, position);
	/* Homing moves the origin, and so do some commands. */
	if (axis->motion == VSMD_MOTION_HOMING || axis->begun == VSMD_MOTION_HOMING ||
	    axis->heard_at <= axis->told_until || (word & ~before & VSMD_ST_ZERO))
		return false;
	if (has_dropped(before, word, VSMD_ST_PWR) || has_dropped(before, word, VSMD_ST_ZERO))
		return !counts_on(axis, position);
	return dropped_handshake(axis, position, word) || jumped_home(axis, position, word) ||
	       jumped_from_motion(axis, position, word, now);
}

/*
 * The homing bit says that the drive has found its origin, whoever told it to; but it stays set in a
 * drive that was disabled since, whose counter began anew.
 */
static void follow_origin(struct vsmd_axis *axis, uint32_t before, bool first)
{
	uint32_t word = axis->last.status;

	if (!(word & VSMD_ST_ZERO)) {
		axis->zero_is_old = false;
		return;
	}
	if (axis->zero_is_old || !(word & VSMD_ST_STP) || axis->motion == VSMD_MOTION_HOMING)
		return;
	if (first ? (word & VSMD_ST_PWR) != 0 : !(before & VSMD_ST_ZERO))
		found_origin(axis);
}

void vsmd_take_confirmation(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now)
{
	uint32_t before = axis->last.status;
	bool first = !axis->known;

	if (!first && has_restarted(axis, position, word, now)) {
		axis->restarts++;
		forget_drive(axis, !axis->away);
		axis->zero_is_old = (before & word & VSMD_ST_ZERO) != 0;
	}
	if (word & ~before & VSMD_ST_HS)
		axis->handshake_since = now;
	axis->known = true;
	axis->away = false;
	axis->last.position = position;
	axis->last.status = word;
	axis->heard_at = now;
	follow_origin(axis, before, first);
}

void vsmd_take_speed(struct vsmd_axis *axis, float velocity)
{
	axis->last.velocity = velocity;
	if (!axis->watch.has_speed)
		axis->watch.first_speed = velocity;
	axis->watch.has_speed = true;
}

void vsmd_take_position(struct vsmd_axis *axis, int32_t position, db_time now)
{
	axis->last.position = position;
	axis->heard_at = now;
}

void vsmd_take_status(struct vsmd_axis *axis, const struct vsmd_status *status, db_time now)
{
	vsmd_take_confirmation(axis, status->position, status->status, now);
	axis->last.velocity = status->velocity;
	axis->process = *status;
	axis->taken = now;
	axis->heard = true;
}

static void start_motion(struct vsmd_axis *axis, enum vsmd_motion motion)
{
	axis->motion = motion;
	axis->begun = VSMD_MOTION_NONE;
	axis->fresh = true;
	axis->stopping = false;
	axis->standstill_looks = 0;
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
		axis->fresh = true;
	}
	axis->goal.kind = VSMD_GOAL_REST;
	axis->has_target = false;
}

void vsmd_take_target(struct vsmd_axis *axis)
{
	axis->has_target = true;
	axis->target = axis->wanted;
}

void vsmd_doubt_motion(struct vsmd_axis *axis, enum db_command command)
{
	if (db_command_is_motion(command))
		axis->goal.kind = VSMD_GOAL_UNKNOWN;
}

static void run_with(struct vsmd_axis *axis, float velocity)
{
	start_motion(axis, VSMD_MOTION_CONTINUOUS);
	axis->goal = (struct vsmd_goal){
		.kind = isnan(velocity) ? VSMD_GOAL_UNKNOWN : VSMD_GOAL_VELOCITY,
		.velocity = velocity,
	};
}

void vsmd_carry_out(struct vsmd_axis *axis, const struct db_request *request)
{
	const struct db_args *args = &request->args;

	switch (request->command) {
	case DB_CMD_MOVE_VELOCITY:
		run_with(axis, args->target_velocity);
		break;
	case DB_CMD_MOVE_PRESET:
		run_with(axis, vsmd_preset_speed(axis));
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		start_motion(axis, VSMD_MOTION_DISCRETE);
		vsmd_take_target(axis);
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
		axis->origin_lost = false;
		axis->placed = true;
		axis->told_until = 0; /* it was seen */
		axis->has_target = false;
		/* Where it was to go is counted anew, too, and nobody says which way. */
		if (axis->goal.kind == VSMD_GOAL_POSITION)
			axis->goal.kind = VSMD_GOAL_UNKNOWN;
		axis->process.position = axis->last.position;
		break;
	case DB_CMD_DISABLE: /* section 2.4.3: the position becomes 0, the origin is lost */
		forget_motion(axis);
		axis->homed = false;
		axis->placed = false;
		axis->told_until = 0;
		axis->origin_lost = true;
		axis->zero_is_old = (axis->last.status & VSMD_ST_ZERO) != 0;
		axis->has_target = false;
		break;
	default:
		break;
	}
}

/* --- state ------------------------------------------------------------------------------------- */

unsigned vsmd_input_ports(const struct db_nameplate *plate)
{
	unsigned ports = 0;

	for (unsigned i = 0; i < 6; i++) {
		if ((plate->valid >> (VSMD_S1 + i) & 1) && plate->values[VSMD_S1 + i].u == 0)
			ports |= 1u << i;
	}
	return ports;
}

static uint16_t outputs_of(const struct vsmd_axis *axis, uint16_t levels)
{
	uint16_t outputs = 0;

	for (unsigned i = 0; i < 6; i++) {
		if ((axis->plate.valid >> (VSMD_S1 + i) & 1) &&
		    axis->plate.values[VSMD_S1 + i].u == 1)
			outputs |= (uint16_t)(1u << i);
	}
	return outputs & levels;
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
	bool moving = !(axis->last.status & VSMD_ST_STP) || axis->fresh;

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
	bool stands = (drive & VSMD_ST_STP) && !axis->fresh;
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

void vsmd_axis_feedback(const struct vsmd_axis *axis, struct db_feedback *feedback)
{
	enum db_axis_state state;

	feedback->taken = axis->taken;
	feedback->position = axis->process.position;
	feedback->velocity = axis->process.velocity;
	feedback->has_target = axis->has_target;
	feedback->target = axis->target;
	feedback->drive_status = axis->last.status;
	feedback->inputs = (uint16_t)((axis->last.status & 0xFu) |
	                              (axis->last.status >> 12 & 0x30u));
	feedback->outputs = outputs_of(axis, feedback->inputs);
	feedback->error = error_of(axis->last.status);
	state = axis->heard ? state_of(axis, feedback->error) : DB_AXIS_OFFLINE;
	feedback->state = (uint16_t)state;
	feedback->status = status_of(axis, state, feedback->error);
}

void vsmd_axis_gone(struct vsmd_axis *axis)
{
	axis->params_valid = false;
	axis->heard = false;
	axis->fresh = false;
	axis->away = true;
	axis->goal.kind = VSMD_GOAL_UNKNOWN;
}
