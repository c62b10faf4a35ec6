/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/vsmd_drive.h"

#include "codec/vsmd_can.h"

#include "sim/sim_private.h"
#include "sim/vsmd_mechanics.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A handler returns false when the drive refuses the command. */
typedef bool handler_fn(struct sim_vsmd *drive, const struct vsmd_command *command);

static const struct {
	enum vsmd_param param;
	uint32_t value;
} whole_defaults[] = {
	{ VSMD_MCS, 5 },    { VSMD_PUD, 3 }, { VSMD_MSV, 1 },  { VSMD_PSV, 1 }, { VSMD_ELNS, 1000 },
	{ VSMD_ESTP, 200 }, { VSMD_EZ, 4 },  { VSMD_ERTY, 2 }, { VSMD_EWR, 1 },
};

static const struct {
	enum vsmd_param param;
	float value;
} float_defaults[] = {
	{ VSMD_SPD, 6400.0f },  { VSMD_ACC, 24000.0f }, { VSMD_DEC, 24000.0f },
	{ VSMD_CRA, 0.8f },     { VSMD_CRN, 0.6f },     { VSMD_CRH, 0.3f },
	{ VSMD_ZSD, -1200.0f }, { VSMD_ZCR, 0.4f },     { VSMD_ESDS, 0.5f },
	{ VSMD_ERATIO, 1.0f },  { VSMD_N1RATIO, 1.0f }, { VSMD_N2RATIO, 1.0f },
	{ VSMD_N3RATIO, 1.0f },
};

void sim_vsmd_config_init(struct sim_vsmd_config *config, unsigned address, unsigned baud)
{
	*config = (struct sim_vsmd_config){
		.identity = "VSMD113_025T-1.0.008.170428",
		.address = address,
		.baud = baud,
		.model = 25,
		.max_current = 2.5,
		.travel_min = -INFINITY,
		.travel_max = INFINITY,
	};
	for (size_t i = 0; i < sizeof(whole_defaults) / sizeof(whole_defaults[0]); i++)
		config->defaults[whole_defaults[i].param].u = whole_defaults[i].value;
	for (size_t i = 0; i < sizeof(float_defaults) / sizeof(float_defaults[0]); i++)
		config->defaults[float_defaults[i].param].f = float_defaults[i].value;
}

bool sim_vsmd_takes(const struct sim_vsmd_config *config, enum vsmd_param param,
                    union db_value value)
{
	if (!(config->can ? vsmd_can_param_in_range(param, value) :
	                    vsmd_param_in_range(param, value)))
		return false;
	/* Sensor ports 1 and 2 can be outputs on the 010T, 3 to 6 on all others. */
	if (param >= VSMD_S1 && param <= VSMD_S6)
		return value.u == 0 || (config->model == 10 ? param <= VSMD_S2 : param >= VSMD_S3);
	if (param >= VSMD_S3F && param <= VSMD_S6R)
		return value.u == 0 || config->model != 10;
	switch (param) {
	case VSMD_CRA:
	case VSMD_CRN:
	case VSMD_CRH:
		return (double)value.f <= config->max_current;
	case VSMD_ZCR:
		return config->closed_loop && (double)value.f <= config->max_current;
	case VSMD_EMOD:
	case VSMD_ELNS:
	case VSMD_ESTP:
	case VSMD_EZ:
	case VSMD_ESDS:
	case VSMD_ERTY:
	case VSMD_EDIR:
	case VSMD_EWR:
	case VSMD_ERATIO:
		return config->closed_loop;
	case VSMD_ZMD:
		return value.u < 5 || (value.u > 5 && config->closed_loop);
	case VSMD_N1RATIO:
	case VSMD_N2RATIO:
	case VSMD_N3RATIO:
		return config->external;
	case VSMD_RES:
		return config->model == 80;
	case VSMD_CAF:
		return config->can;
	default:
		return true;
	}
}

/* The flash's values come into effect, also bdr, cid and emod. */
static void power_up(struct sim_vsmd *drive, db_time now)
{
	bool unreadable = false;

	if (drive->flash_path[0] != '\0') {
		union db_value values[VSMD_PARAM_COUNT];
		int result;

		memcpy(values, drive->config.defaults, sizeof(values));
		result = sim_vsmd_flash_read(drive->flash_path, values);
		unreadable = result != 0 && result != -ENOENT;
		memcpy(drive->flash, unreadable ? drive->config.defaults : values,
		       sizeof(drive->flash));
	}
	memcpy(drive->params, drive->flash, sizeof(drive->params));
	drive->powered = true;
	drive->starts++;
	drive->flags = drive->config.temper.keeps_handshake ? drive->flags & VSMD_ST_HS : 0;
	drive->flags |= unreadable ? VSMD_ST_FLASH_ERR : 0;
	drive->waits = false;
	drive->address = drive->params[VSMD_CID].u;
	drive->baud = drive->params[VSMD_BDR].u;
	drive->encoder_mode = drive->params[VSMD_EMOD].u;
	drive->outputs = 0;
	drive->blocked = 0;
	drive->offline_start = drive->params[VSMD_DAR].u == 0 ?
	                               DB_TIME_NEVER :
	                               now + (db_time)drive->params[VSMD_DAR].u * DB_NS_PER_S;
	if (!drive->config.temper.keeps_position)
		sim_mechanics_set_position(drive, 0.0);
	sim_mechanics_settle(drive);
	sim_mechanics_configure(drive);
	if (drive->params[VSMD_PAE].u == 1) {
		drive->flags |= VSMD_ST_PWR;
		if (drive->params[VSMD_ZAR].u == 1)
			(void)sim_mechanics_home(drive);
	}
	/* The bits start in their real state, without a delay. */
	(void)sim_late_bit_follow(&drive->power_bit, drive->flags & VSMD_ST_PWR, 0, now);
	(void)sim_late_bit_follow(&drive->standing_bit, !sim_motion_moving(&drive->motion), 0, now);
}

struct sim_vsmd *sim_vsmd_new(const struct sim_vsmd_config *config, db_time now)
{
	struct sim_vsmd *drive = calloc(1, sizeof(*drive));

	if (!drive)
		return NULL;
	drive->config = *config;
	drive->config.defaults[VSMD_CID].u = config->address;
	drive->config.defaults[VSMD_BDR].u = config->baud;
	drive->config.identity = NULL;
	drive->config.flash_path = NULL;
	if (config->flash_path)
		snprintf(drive->flash_path, sizeof(drive->flash_path), "%s", config->flash_path);
	memcpy(drive->flash, drive->config.defaults, sizeof(drive->flash));
	snprintf(drive->identity, sizeof(drive->identity), "%s", config->identity);
	for (unsigned i = 0; i < SIM_VSMD_SENSORS; i++)
		drive->forced[i] = -1;
	sim_motion_init(&drive->motion, now);
	drive->shaft_offset = config->start;
	power_up(drive, now);
	return drive;
}

static handler_fn *const handlers[VSMD_VERB_COUNT]; /* below */

static bool is_enabled(const struct sim_vsmd *drive)
{
	return (drive->flags & VSMD_ST_PWR) != 0;
}

/* The delay counts from the event, not from the request. */
static void follow_late_bits(struct sim_vsmd *drive, db_time now)
{
	const struct sim_vsmd_temper *temper = &drive->config.temper;

	(void)sim_late_bit_follow(&drive->power_bit, is_enabled(drive), temper->power_delay, now);
	(void)sim_late_bit_follow(&drive->standing_bit, !sim_motion_moving(&drive->motion),
	                          temper->standing_delay, now);
}

void sim_vsmd_advance(struct sim_vsmd *drive, db_time now)
{
	if (!drive->powered)
		return;
	if (drive->waits && drive->begins_at <= now) {
		drive->waits = false;
		sim_mechanics_advance(drive, drive->begins_at);
		(void)handlers[drive->waiting.verb](drive, &drive->waiting);
		follow_late_bits(drive, drive->begins_at);
	}
	sim_mechanics_advance(drive, now);
	follow_late_bits(drive, now);
}

void sim_vsmd_power(struct sim_vsmd *drive, bool on, db_time now)
{
	sim_vsmd_advance(drive, now);
	if (on == drive->powered)
		return;
	if (!on) {
		sim_mechanics_release(drive);
		drive->powered = false;
		return;
	}
	/* Without power no time passes for a motor. */
	sim_motion_advance(&drive->motion, now);
	power_up(drive, now);
}

void sim_vsmd_note_request(struct sim_vsmd *drive, bool named, db_time now)
{
	enum sim_handshake rule = drive->config.temper.handshake;

	if (rule == SIM_HANDSHAKE_OF_BUS)
		rule = drive->config.can ? SIM_HANDSHAKE_ANY : SIM_HANDSHAKE_DEV;
	if (rule == SIM_HANDSHAKE_DEV && !named)
		return;
	drive->flags |= VSMD_ST_HS;
	drive->greeted_at = now;
	drive->offline_start = DB_TIME_NEVER;
}

static bool switch_motor(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	if (command->verb == VSMD_OFF) {
		sim_mechanics_release(drive);
		return true;
	}
	/* After enabling the motor stands, whatever its mode was. */
	sim_mechanics_abandon(drive);
	sim_motion_stop(&drive->motion);
	drive->flags |= VSMD_ST_PWR;
	return true;
}

static bool move_motor(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	bool endless = command->verb == VSMD_MOV;
	float speed = command->has_velocity ? command->velocity : drive->params[VSMD_SPD].f;
	double from = command->verb == VSMD_RMV ? round(drive->motion.position) : 0.0;
	double target = from + command->position;

	if (!is_enabled(drive) ||
	    (!endless && (target < (double)INT32_MIN || target > (double)INT32_MAX)))
		return false;
	sim_mechanics_abandon(drive);
	drive->counts_spd = true;
	if (endless)
		sim_motion_run(&drive->motion, (double)speed);
	else
		sim_motion_move(&drive->motion, target, (double)speed);
	sim_mechanics_hold_limits(drive);
	return true;
}

static bool stop_motor(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	sim_mechanics_abandon(drive);
	if (command->has_value && command->value == 1)
		sim_motion_halt(&drive->motion);
	else
		sim_motion_stop(&drive->motion);
	if (drive->config.temper.coasts)
		drive->flags &= ~(uint32_t)VSMD_ST_PWR;
	return true;
}

static bool set_origin(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	sim_mechanics_set_position(drive, command->has_value ? command->position : 0);
	return true;
}

static bool clear_encoder(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	(void)command;
	if (!drive->config.closed_loop)
		return false;
	drive->flags &= ~(uint32_t)VSMD_ST_ENC_ERR;
	drive->blocked = 0;
	return true;
}

static bool set_output(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	uint32_t bit;

	if (command->verb != VSMD_SENSOR_OUT)
		return drive->config.external; /* the sv and nmos ports: nothing here sees them */
	if (command->port < 1 || command->port > SIM_VSMD_SENSORS ||
	    drive->params[(unsigned)VSMD_S1 + command->port - 1].u != 1)
		return false;
	bit = UINT32_C(1) << (command->port - 1);
	drive->outputs = command->value ? drive->outputs | bit : drive->outputs & ~bit;
	sim_mechanics_sense(drive);
	return true;
}

static bool home_motor(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	if (command->verb == VSMD_ZERO_STOP) {
		if (!drive->config.temper.keeps_zero)
			drive->flags &= ~(uint32_t)VSMD_ST_ZERO;
		if (drive->homing != SIM_HOMING_NONE) {
			sim_mechanics_abandon(drive);
			sim_motion_stop(&drive->motion);
		}
		return true;
	}
	if (!is_enabled(drive))
		return false;
	/* A zero stop is needed first: a set bit is left unchanged and nothing moves. */
	if ((drive->flags & VSMD_ST_ZERO) && !drive->config.temper.keeps_zero)
		return true;
	if (!sim_mechanics_home(drive))
		return false;
	drive->flags &= ~(uint32_t)VSMD_ST_ZERO;
	return true;
}

static bool shake_motor(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	if (command->verb == VSMD_SHAKE_STOP) {
		if (drive->shake != SIM_SHAKE_NONE) {
			sim_mechanics_abandon(drive);
			sim_motion_stop(&drive->motion);
		}
		return true;
	}
	if (!is_enabled(drive))
		return false;
	sim_mechanics_shake(drive, command);
	sim_mechanics_sense(drive);
	return true;
}

static bool write_settings(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	for (size_t i = 0; i < command->setting_count && !drive->config.temper.clamps; i++) {
		const struct vsmd_setting *setting = &command->settings[i];

		if (!sim_vsmd_takes(&drive->config, setting->param, setting->value))
			return false;
	}
	for (size_t i = 0; i < command->setting_count; i++) {
		const struct vsmd_setting *setting = &command->settings[i];
		const struct db_param *row = &vsmd_params[setting->param];
		double max = row->max_is_model ? drive->config.max_current : row->max;
		double number = db_value_number(row->type, setting->value);
		union db_value value = setting->value;

		/* Else the nearest value that this drive accepts, or its present one. */
		if (!sim_vsmd_takes(&drive->config, setting->param, value) &&
		    (!db_value_from_number(row->type, fmin(fmax(number, row->min), max), &value) ||
		     !sim_vsmd_takes(&drive->config, setting->param, value)))
			continue;
		drive->params[setting->param] = value;
	}
	sim_mechanics_configure(drive);
	return true;
}

static bool save_params(struct sim_vsmd *drive, const struct vsmd_command *command)
{
	int result = drive->flash_fails ? -EIO : 0;

	(void)command;
	if (result == 0 && drive->flash_path[0] != '\0')
		result = sim_vsmd_flash_write(drive->flash_path, drive->params);
	if (result != 0) {
		drive->flags |= VSMD_ST_FLASH_ERR;
		return true;
	}
	memcpy(drive->flash, drive->params, sizeof(drive->flash));
	drive->flags &= ~(uint32_t)VSMD_ST_FLASH_ERR;
	return true;
}

/* Null: it only asks. */
static handler_fn *const handlers[VSMD_VERB_COUNT] = {
	[VSMD_ENA] = switch_motor,         [VSMD_OFF] = switch_motor,
	[VSMD_MOV] = move_motor,           [VSMD_POS] = move_motor,
	[VSMD_RMV] = move_motor,           [VSMD_STP] = stop_motor,
	[VSMD_ORG] = set_origin,           [VSMD_ECLR] = clear_encoder,
	[VSMD_SENSOR_OUT] = set_output,    [VSMD_SV] = set_output,
	[VSMD_NMOS] = set_output,          [VSMD_ZERO_START] = home_motor,
	[VSMD_ZERO_STOP] = home_motor,     [VSMD_SHAKE_CYCLES] = shake_motor,
	[VSMD_SHAKE_TIME] = shake_motor,   [VSMD_SHAKE_STOP] = shake_motor,
	[VSMD_CFG_WRITE] = write_settings, [VSMD_SAV] = save_params,
};

static bool is_read(enum vsmd_verb verb)
{
	return verb == VSMD_STS || verb == VSMD_DEV || verb == VSMD_CFG_READ;
}

enum sim_refusal sim_vsmd_refusal(const struct sim_vsmd *drive)
{
	if (drive->config.temper.refusal != SIM_REFUSAL_OF_BUS)
		return drive->config.temper.refusal;
	return drive->config.can ? SIM_REFUSAL_KEPT : SIM_REFUSAL_CLEARED;
}

enum vsmd_reply_code sim_vsmd_execute(struct sim_vsmd *drive, const struct vsmd_command *command,
                                      db_time now)
{
	bool hidden = sim_vsmd_hides_params(drive) && command->verb == VSMD_CFG_READ;
	bool begins = command->verb == VSMD_MOV || command->verb == VSMD_POS ||
	              command->verb == VSMD_RMV || command->verb == VSMD_ZERO_START ||
	              command->verb == VSMD_SHAKE_CYCLES || command->verb == VSMD_SHAKE_TIME;
	bool good = true;

	sim_vsmd_advance(drive, now);
	sim_vsmd_note_request(drive, command->verb == VSMD_DEV, now);
	if (hidden) {
		good = false;
	} else if (drive->config.temper.motion_delay == 0 || !begins || !is_enabled(drive)) {
		/* Any other command for the motor precedes a motion that has not begun. */
		if (!is_read(command->verb) && command->verb != VSMD_ORG &&
		    command->verb != VSMD_CFG_WRITE && command->verb != VSMD_SENSOR_OUT)
			drive->waits = false;
		good = !handlers[command->verb] || handlers[command->verb](drive, command);
	} else {
		/* This drive delays motions. */
		drive->waits = true;
		drive->waiting = *command;
		drive->begins_at = now + drive->config.temper.motion_delay;
	}
	if (!good) {
		sim_vsmd_refuse(drive, now);
		return VSMD_REPLY_STATUS;
	}
	drive->counts[command->verb]++;
	if (!is_read(command->verb) || sim_vsmd_refusal(drive) == SIM_REFUSAL_CLEARED)
		drive->flags &= ~(uint32_t)VSMD_ST_CMD_WRG;
	follow_late_bits(drive, now);
	switch (command->verb) {
	case VSMD_DEV:
		return VSMD_REPLY_IDENTITY;
	case VSMD_CFG_READ:
		return VSMD_REPLY_PARAMS;
	case VSMD_SAV:
		return drive->flags & VSMD_ST_FLASH_ERR ? VSMD_REPLY_STATUS : VSMD_REPLY_PARAMS;
	default:
		return VSMD_REPLY_STATUS;
	}
}

void sim_vsmd_refuse(struct sim_vsmd *drive, db_time now)
{
	sim_vsmd_advance(drive, now);
	sim_vsmd_note_request(drive, false, now);
	drive->flags |= VSMD_ST_CMD_WRG;
	drive->refusals++;
}

void sim_vsmd_status(struct sim_vsmd *drive, db_time now, struct vsmd_status *status)
{
	const struct sim_motion *motion = &drive->motion;
	bool standing;
	uint32_t word;

	sim_vsmd_advance(drive, now);
	if (drive->config.temper.handshake_lapses > 0 &&
	    now - drive->greeted_at >= drive->config.temper.handshake_lapses)
		drive->flags &= ~(uint32_t)VSMD_ST_HS;
	/* The counter is 32 bits wide and wraps in endless running. */
	status->position = (int32_t)(uint32_t)(int64_t)llround(drive->motion.position);
	status->velocity = (float)drive->motion.velocity;
	standing = !sim_motion_moving(motion);
	word = drive->flags | drive->forced_status;
	word |= drive->levels & 0xfu;
	word |= (drive->levels & 0x10u) ? VSMD_ST_S5 : 0;
	word |= (drive->levels & 0x20u) ? VSMD_ST_S6 : 0;
	word |= standing ? VSMD_ST_STP | VSMD_ST_POS_REACHED : 0;
	word |= round(motion->position) == 0.0 ? VSMD_ST_ORG : 0;
	if (standing || fabs(motion->velocity) == fabs(motion->target_velocity))
		word |= VSMD_ST_SPD_REACHED;
	status->status = word;
}

void sim_vsmd_settle(struct sim_vsmd *drive, bool answered)
{
	enum sim_settles settles = drive->config.temper.settles;

	if (settles != SIM_SETTLES_AT_ONCE && !(answered && settles == SIM_SETTLES_AFTER_ANSWER))
		return;
	drive->address = drive->params[VSMD_CID].u;
	drive->baud = drive->params[VSMD_BDR].u;
}

bool sim_vsmd_hides_params(const struct sim_vsmd *drive)
{
	return drive->hides_params || drive->config.temper.parameters != SIM_PARAMETERS_TOLD;
}

void sim_vsmd_force_sensor(struct sim_vsmd *drive, unsigned number, int level, db_time now)
{
	if (number < 1 || number > SIM_VSMD_SENSORS)
		return;
	sim_vsmd_advance(drive, now);
	drive->forced[number - 1] = level;
	sim_mechanics_sense(drive);
}
