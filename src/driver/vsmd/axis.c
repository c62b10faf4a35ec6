/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/axis.h"

#include <math.h>
#include <string.h>

/* Homing stands still for a moment between its phases; standing longer than homing-pause-ms, at more
 * than a few looks, means that it ended without reaching its end. */
#define HOMING_LOOKS 5

#define RESENDS_MAX 2

/* A motion that an older one explains as well is looked at for so long. */
#define OPEN_TIME (20 * DB_NS_PER_MS)

/* A drive that does not answer commands is told to switch its motor off this often, until it is. */
#define OFF_AGAIN (10 * DB_NS_PER_MS)

/* The position from which a relative move is counted is read so often, until two readings agree. */
#define READINGS_MAX 5

/* The handshake bit of some drives lapses after a while. One that stays for longer than this does not. */
#define HANDSHAKE_LAPSES (60 * DB_NS_PER_S)

/* What commands change of position, power and homing bit is seen within this and the reaction time. */
#define TOLD_TIME (500 * DB_NS_PER_MS)

static enum db_step ask(struct vsmd_axis *axis, struct vsmd_command command, bool repeatable,
                        struct db_exchange *exchange, enum db_result *result)
{
	if (command.verb == VSMD_ZERO_START)
		axis->begun = VSMD_MOTION_HOMING;
	if (command.verb == VSMD_SHAKE_CYCLES || command.verb == VSMD_SHAKE_TIME)
		axis->begun = VSMD_MOTION_SHAKE;
	if (command.verb == VSMD_ORG || command.verb == VSMD_OFF ||
	    command.verb == VSMD_ZERO_START || command.verb == VSMD_ZERO_STOP)
		axis->told_until = axis->heard_at + TOLD_TIME + axis->reaction;
	exchange->begins = command.verb == VSMD_MOV || command.verb == VSMD_POS ||
	                   command.verb == VSMD_ZERO_START;
	return axis->link->ask(axis, &command, repeatable, exchange, result);
}

static enum db_step ask_verb(struct vsmd_axis *axis, enum vsmd_verb verb,
                             struct db_exchange *exchange, enum db_result *result)
{
	return ask(axis, (struct vsmd_command){ .verb = verb }, true, exchange, result);
}

static enum db_step done(enum db_result *result, enum db_result value)
{
	*result = value;
	return DB_STEP_DONE;
}

/* --- what a command looks like ------------------------------------------------------------------- */

/* True when after a lost answer the drive must be read back before anything else is done. */
static bool needs_read_back(enum db_command command)
{
	return db_command_is_motion(command) || command == DB_CMD_SET_POSITION;
}

static struct vsmd_command position_command(int32_t target, float velocity)
{
	return (struct vsmd_command){
		.verb = VSMD_POS,
		.position = target,
		.has_velocity = velocity > 0.0f,
		.velocity = velocity,
	};
}

static struct vsmd_command shake_command(enum vsmd_verb verb, const struct db_args *args,
                                         uint32_t count)
{
	return (struct vsmd_command){
		.verb = verb,
		.shake_start = args->shake_start_position,
		.shake_end = args->shake_end_position,
		.shake_frequency = args->shake_frequency,
		.shake_count = count,
	};
}

struct vsmd_command vsmd_command_of(enum db_command command, const struct db_args *args)
{
	switch (command) {
	case DB_CMD_ENABLE:
		return (struct vsmd_command){ .verb = VSMD_ENA };
	case DB_CMD_DISABLE:
		return (struct vsmd_command){ .verb = VSMD_OFF };
	case DB_CMD_STOP:
		return (struct vsmd_command){ .verb = VSMD_STP };
	case DB_CMD_QUICK_STOP:
		return (struct vsmd_command){ .verb = VSMD_STP, .has_value = true, .value = 1 };
	case DB_CMD_MOVE_VELOCITY:
		return (struct vsmd_command){ .verb = VSMD_MOV,
			                      .has_velocity = true,
			                      .velocity = args->target_velocity };
	case DB_CMD_MOVE_PRESET:
		return (struct vsmd_command){ .verb = VSMD_MOV };
	case DB_CMD_MOVE_ABSOLUTE:
		return position_command(args->target_position, args->target_velocity);
	case DB_CMD_HOME:
	case DB_CMD_HOME_STOP:
		return (struct vsmd_command){ .verb = VSMD_ZERO_STOP };
	case DB_CMD_SET_POSITION:
		return (struct vsmd_command){ .verb = VSMD_ORG,
			                      .has_value = true,
			                      .position = args->target_position };
	case DB_CMD_CLEAR_FAULT:
		return (struct vsmd_command){ .verb = VSMD_ECLR };
	case DB_CMD_SAVE_PARAMETERS:
		return (struct vsmd_command){ .verb = VSMD_SAV };
	case DB_CMD_READ_PARAMETERS:
		return (struct vsmd_command){ .verb = VSMD_DEV };
	case DB_CMD_SET_OUTPUT:
		return (struct vsmd_command){ .verb = VSMD_SENSOR_OUT,
			                      .port = (uint8_t)args->output_number,
			                      .value = (uint8_t)args->output_value };
	case DB_CMD_SET_SV:
		return (struct vsmd_command){ .verb = VSMD_SV,
			                      .port = (uint8_t)args->output_number,
			                      .value = (uint8_t)args->output_value };
	case DB_CMD_SET_NMOS:
		return (struct vsmd_command){ .verb = VSMD_NMOS,
			                      .port = (uint8_t)args->output_number,
			                      .value = (uint8_t)args->output_value };
	case DB_CMD_SHAKE_START:
		return shake_command(VSMD_SHAKE_CYCLES, args, args->shake_cycles);
	case DB_CMD_SHAKE_START_TIME:
		return shake_command(VSMD_SHAKE_TIME, args, args->shake_time);
	case DB_CMD_SHAKE_STOP:
		return (struct vsmd_command){ .verb = VSMD_SHAKE_STOP };
	default: /* relative moves, and anything check() refuses, begin by reading the status */
		return (struct vsmd_command){ .verb = VSMD_STS };
	}
}

static bool in(double value, double min, double max)
{
	return value >= min && value <= max;
}

static bool port_and_value(const struct db_args *args, unsigned ports, unsigned max)
{
	return in(args->output_number, 1, ports) && args->output_value <= max;
}

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

enum db_result vsmd_check(const struct vsmd_link *link, enum db_command command,
                          const struct db_args *args)
{
	bool right = true;

	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
		right = in((double)args->target_velocity, -VSMD_SPEED_MAX, VSMD_SPEED_MAX);
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		right = in((double)args->target_velocity, 0.0, VSMD_SPEED_MAX);
		break;
	case DB_CMD_SET_OUTPUT:
		right = port_and_value(args, 6, 1);
		break;
	case DB_CMD_SET_OUTPUTS:
		right = args->output_mask != 0 && args->output_mask < 1u << 6;
		break;
	case DB_CMD_SET_SV:
	case DB_CMD_SET_NMOS:
		right = port_and_value(args, 3, 255);
		break;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		right = in((double)args->shake_frequency, (double)link->shake_frequency_min,
		           (double)VSMD_SHAKE_FREQ_MAX) &&
		        args->shake_cycles <= INT32_MAX && args->shake_time <= INT32_MAX;
		break;
	default:
		if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
		    !(VSMD_COMMANDS & DB_COMMAND_BIT(command)))
			return DB_RESULT_UNSUPPORTED;
		break;
	}
	return right ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

/* --- beginning a command -------------------------------------------------------------------------- */

/* The next port of a set_outputs, from `port` on; 0 when there is none. */
static unsigned next_output(const struct db_args *args, unsigned port)
{
	for (; port <= 6; port++) {
		if (args->output_mask & (1u << (port - 1)))
			return port;
	}
	return 0;
}

/* The port that a set_outputs is at. */
static enum db_step ask_output(struct vsmd_axis *axis, const struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	const struct db_args *args = &job->request->args;

	return ask(axis,
	           (struct vsmd_command){ .verb = VSMD_SENSOR_OUT,
	                                  .port = (uint8_t)job->step,
	                                  .value = (args->output_levels >> (job->step - 1)) & 1 },
	           true, exchange, result);
}

static enum db_step send_output(struct vsmd_axis *axis, struct db_job *job, unsigned port,
                                struct db_exchange *exchange, enum db_result *result)
{
	port = next_output(&job->request->args, port);
	if (port == 0)
		return done(result, axis->watch.unproven ? DB_RESULT_UNPROVEN : DB_RESULT_OK);
	job->step = port;
	axis->watch.since = 0;
	axis->watch.said = 0;
	return ask_output(axis, job, exchange, result);
}

/* From here on the effect of a command is looked for. */
static void begin_watch(struct vsmd_axis *axis)
{
	const struct vsmd_status *last = &axis->last;

	axis->watch = (struct vsmd_watch){
		.before = {
			.moving = !(last->status & VSMD_ST_STP),
			.status = last->status,
			.position = last->position,
			.velocity = last->velocity,
			.at = axis->heard_at,
			.goal = axis->goal,
		},
		.unproven = axis->watch.unproven,
		.restarts = axis->restarts,
	};
}

enum db_step vsmd_begin_command(struct vsmd_axis *axis, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;
	bool repeatable = !needs_read_back(command) || command == DB_CMD_MOVE_RELATIVE ||
	                  command == DB_CMD_HOME;

	if (!db_command_is_stop(command)) {
		axis->watch.unproven = false;
		begin_watch(axis);
	}
	if (command == DB_CMD_SET_OUTPUTS)
		return send_output(axis, job, 1, exchange, result);
	if (command == DB_CMD_SAVE_PARAMETERS) {
		if (axis->saved && job->started - axis->last_save < axis->save_interval)
			return done(result, DB_RESULT_RATE_LIMITED);
		axis->saved = true;
		axis->last_save = job->started;
		repeatable = false;
	}
	if (command == DB_CMD_MOVE_ABSOLUTE)
		axis->wanted = job->request->args.target_position;
	return ask(axis, vsmd_command_of(command, &job->request->args), repeatable, exchange,
	           result);
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

static bool dropped(uint32_t before, uint32_t now, uint32_t bit)
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

	if (!dropped(axis->last.status, word, VSMD_ST_HS))
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
	if (dropped(before, word, VSMD_ST_PWR) || dropped(before, word, VSMD_ST_ZERO))
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

/* What a stop has to end: also what the drive may have begun without its answer coming back. */
static enum vsmd_motion to_be_ended(const struct vsmd_axis *axis)
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

static void take_target(struct vsmd_axis *axis)
{
	axis->has_target = true;
	axis->target = axis->wanted;
}

/* The drive was told something that may have come to it, or not. */
static void doubt_motion(struct vsmd_axis *axis, const struct db_job *job)
{
	if (db_command_is_motion(job->request->command))
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

/* The drive confirmed a command: what that means for the axis. */
static void carried_out(struct vsmd_axis *axis, const struct db_job *job)
{
	const struct db_args *args = &job->request->args;

	switch (job->request->command) {
	case DB_CMD_MOVE_VELOCITY:
		run_with(axis, args->target_velocity);
		break;
	case DB_CMD_MOVE_PRESET:
		run_with(axis, vsmd_preset_speed(axis));
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		start_motion(axis, VSMD_MOTION_DISCRETE);
		take_target(axis);
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

/* --- answers ----------------------------------------------------------------------------------- */

static enum db_step confirmed(struct vsmd_axis *axis, const struct db_job *job,
                              enum db_result *result)
{
	bool proven = vsmd_shows_its_effect(axis->link, job->request->command) &&
	              (db_command_is_stop(job->request->command) || !axis->watch.unproven);

	carried_out(axis, job);
	return done(result, proven ? DB_RESULT_OK : DB_RESULT_UNPROVEN);
}

static enum db_step failed(struct vsmd_axis *axis, const struct db_job *job, enum db_result why,
                           enum db_result *result)
{
	doubt_motion(axis, job);
	return done(result, why);
}

static enum db_step look(struct vsmd_axis *axis, enum vsmd_look look, struct db_exchange *exchange,
                         enum db_result *result)
{
	return axis->link->look(axis, look, exchange, result);
}

/* `stp` is documented for the velocity and position modes; homing and shaking have their own ends. */
enum vsmd_end { VSMD_NO_END, VSMD_HOMING_END, VSMD_SHAKE_END };

/*
 * What a stop says next. A drive that moves for a reason that is not known is told all the ends. Its
 * homing-done bit shows that it is not homing, and would be lost by ending that.
 */
static enum vsmd_end next_end(const struct vsmd_axis *axis, const struct db_job *job)
{
	enum vsmd_motion motion = to_be_ended(axis);
	bool unknown = motion == VSMD_MOTION_UNKNOWN;

	if (job->step < VSMD_SECOND &&
	    (motion == VSMD_MOTION_HOMING || (unknown && !(axis->last.status & VSMD_ST_ZERO))))
		return VSMD_HOMING_END;
	if (job->step < VSMD_THIRD && (motion == VSMD_MOTION_SHAKE || unknown))
		return VSMD_SHAKE_END;
	return VSMD_NO_END;
}

/* Has the power stage followed disable? It takes its time. scratch[0]: when that was first asked;
 * scratch[1]: when it was told last. */
static enum db_step check_power(struct vsmd_axis *axis, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	if (!(axis->last.status & VSMD_ST_PWR))
		return confirmed(axis, job, result);
	if (job->step == VSMD_FIRST)
		job->scratch[0] = job->scratch[1] = axis->heard_at;
	job->step = VSMD_SECOND;
	if (axis->heard_at - job->scratch[0] >= axis->reaction)
		return done(result, DB_RESULT_FAILED);
	if (axis->link->acknowledges || axis->heard_at - job->scratch[1] < OFF_AGAIN)
		return look(axis, VSMD_LOOK_STATUS, exchange, result);
	job->scratch[1] = axis->heard_at;
	return ask_verb(axis, VSMD_OFF, exchange, result);
}

static enum db_step after_stop(struct vsmd_axis *axis, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	switch (next_end(axis, job)) {
	case VSMD_HOMING_END:
		job->step = VSMD_SECOND;
		return ask_verb(axis, VSMD_ZERO_STOP, exchange, result);
	case VSMD_SHAKE_END:
		job->step = VSMD_THIRD;
		return ask_verb(axis, VSMD_SHAKE_STOP, exchange, result);
	default:
		return confirmed(axis, job, result);
	}
}

static enum db_step send_target(struct vsmd_axis *axis, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	job->step = VSMD_SECOND;
	return ask(axis, position_command(axis->wanted, job->request->args.target_velocity), false,
	           exchange, result);
}

/* Two readings of the position from which a relative move is counted, in different frames: one of
 * them may be older than the question. */
static bool agree(const struct vsmd_axis *axis, int32_t first, db_time since)
{
	double seconds = (double)(axis->heard_at - since) / (double)DB_NS_PER_S;
	double way = axis->last.status & VSMD_ST_STP ? 0.0 : (double)VSMD_SPEED_MAX * seconds;

	return fabs((double)axis->last.position - (double)first) <= axis->window + way;
}

static enum db_step after_relative(struct vsmd_axis *axis, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	int64_t target;

	if (job->step != VSMD_FIRST)
		return confirmed(axis, job, result);
	/* An answer that is waited for alone cannot be overtaken. */
	if (!axis->link->acknowledges) {
		unsigned readings = axis->watch.readings++;
		bool agreed = readings % 2 == 1 &&
		              agree(axis, (int32_t)job->scratch[0], job->scratch[1]);

		job->scratch[0] = axis->last.position;
		job->scratch[1] = axis->heard_at;
		if (!agreed && readings >= READINGS_MAX)
			return done(result, DB_RESULT_FAILED);
		if (!agreed)
			return look(axis, readings % 2 == 0 ? VSMD_LOOK_POSITION : VSMD_LOOK_STATUS,
			            exchange, result);
	}
	target = (int64_t)axis->last.position + job->request->args.target_position;
	if (target < INT32_MIN || target > INT32_MAX)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	/* It may have moved since the limits were checked. Those that are not set are NAN. */
	if ((double)target / axis->config->counts_per_unit < axis->config->min_position ||
	    (double)target / axis->config->counts_per_unit > axis->config->max_position)
		return done(result, DB_RESULT_LIMIT);
	axis->wanted = (int32_t)target;
	begin_watch(axis);
	return send_target(axis, job, exchange, result);
}

/* Says a command again. Only where that is harmless, or the drive demonstrably did not take it. */
static enum db_step say_again(struct vsmd_axis *axis, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;

	axis->watch.said++;
	axis->watch.since = 0;
	axis->watch.speed_next = false;
	if (command == DB_CMD_MOVE_RELATIVE)
		return send_target(axis, job, exchange, result);
	if (command == DB_CMD_HOME && job->step != VSMD_FIRST) {
		job->step = VSMD_SECOND;
		return ask(axis, (struct vsmd_command){ .verb = VSMD_ZERO_START }, false, exchange,
		           result);
	}
	if (command == DB_CMD_SET_OUTPUTS)
		return ask_output(axis, job, exchange, result);
	job->step = VSMD_FIRST;
	return ask(axis, vsmd_command_of(command, &job->request->args), !needs_read_back(command),
	           exchange, result);
}

/* A place is another one now, and whoever asked for it does not know. */
static bool has_restarted_since(const struct vsmd_axis *axis)
{
	return axis->watch.restarts != axis->restarts;
}

/* Homing or shaking that began unnoticed must not begin anew. */
static bool may_be_said_again(const struct vsmd_axis *axis, const struct db_job *job)
{
	enum db_command command = job->request->command;

	return !has_restarted_since(axis) && !axis->link->acknowledges && !axis->watch.by_all &&
	       command != DB_CMD_SHAKE_START && command != DB_CMD_SHAKE_START_TIME &&
	       !(command == DB_CMD_HOME && job->step != VSMD_FIRST);
}

/* The output ports' levels are not documented to show: what is seen of them proves, its lack does not. */
static bool may_hide_its_effect(const struct vsmd_axis *axis, const struct db_job *job)
{
	const struct db_args *args = &job->request->args;
	enum db_command command = job->request->command;
	unsigned port = command == DB_CMD_SET_OUTPUT ? args->output_number : job->step;
	unsigned mode = (unsigned)VSMD_S1 + port - 1;

	if (command != DB_CMD_SET_OUTPUT && command != DB_CMD_SET_OUTPUTS)
		return false;
	return !(axis->plate.valid >> mode & 1) || axis->plate.values[mode].u == 1;
}

static enum db_step go_on(struct vsmd_axis *axis, struct db_job *job, struct db_exchange *exchange,
                          enum db_result *result);

/* The effect of a command does not show (yet), or something else may have caused it. */
static enum db_step look_again(struct vsmd_axis *axis, struct db_job *job, enum vsmd_effect effect,
                               struct db_exchange *exchange, enum db_result *result)
{
	struct vsmd_watch *watch = &axis->watch;
	db_time elapsed;

	if (watch->since == 0)
		watch->since = axis->heard_at;
	elapsed = axis->heard_at - watch->since;
	/* Said a second time at once: that both frames are lost is unlikely. */
	if (effect == VSMD_EFFECT_OPEN && watch->said == 0 && may_be_said_again(axis, job) &&
	    job->request->command != DB_CMD_SET_POSITION) {
		db_time since = watch->since;
		enum db_step step = say_again(axis, job, exchange, result);

		watch->since = since;
		return step;
	}
	if (elapsed < (effect == VSMD_EFFECT_OPEN && axis->reaction > OPEN_TIME ? OPEN_TIME :
	                                                                          axis->reaction)) {
		watch->speed_next = !watch->speed_next && watch->before.moving &&
		                    needs_read_back(job->request->command);
		return look(axis, watch->speed_next ? VSMD_LOOK_SPEED : VSMD_LOOK_STATUS, exchange,
		            result);
	}
	if (effect == VSMD_EFFECT_ABSENT && watch->said < RESENDS_MAX &&
	    may_be_said_again(axis, job))
		return say_again(axis, job, exchange, result);
	if (effect == VSMD_EFFECT_ABSENT && !may_hide_its_effect(axis, job))
		return failed(axis, job, DB_RESULT_FAILED, result);
	watch->unproven = true;
	return go_on(axis, job, exchange, result);
}

/* The answer to a motion command or set_position was lost: what does the drive itself say? */
static enum db_step resolve(struct vsmd_axis *axis, struct db_job *job,
                            struct db_exchange *exchange, enum db_result *result)
{
	const struct vsmd_status *now = &axis->last;
	const struct vsmd_before *before = &axis->watch.before;
	enum db_command command = job->request->command;
	bool positions = command == DB_CMD_MOVE_ABSOLUTE || command == DB_CMD_MOVE_RELATIVE;
	bool stands = (now->status & VSMD_ST_STP) != 0;
	bool unmoved = !before->moving && stands &&
	               vsmd_is_at(axis, now->position, before->position);
	bool again = axis->watch.said < RESENDS_MAX && !axis->watch.by_all &&
	             !has_restarted_since(axis);

	if (positions && stands && vsmd_is_at(axis, now->position, axis->wanted))
		return confirmed(axis, job, result);
	if (unmoved && (now->status & VSMD_ST_CMD_WRG))
		return done(result, DB_RESULT_REFUSED);
	if (command == DB_CMD_SET_POSITION && stands &&
	    vsmd_is_at(axis, now->position, job->request->args.target_position))
		return confirmed(axis, job, result);
	if (command != DB_CMD_SET_POSITION && !before->moving && !stands)
		return confirmed(axis, job, result);
	if (command == DB_CMD_HOME && (now->status & VSMD_ST_ZERO))
		return confirmed(axis, job, result);
	if (unmoved && axis->watch.since == 0)
		axis->watch.since = axis->heard_at;
	/* It may only be slow to begin. */
	if (unmoved && axis->heard_at - axis->watch.since < axis->reaction)
		return look(axis, VSMD_LOOK_STATUS, exchange, result);
	/* A shake may be over already, back where it began. */
	if (unmoved && again && command != DB_CMD_SHAKE_START && command != DB_CMD_SHAKE_START_TIME)
		return say_again(axis, job, exchange, result);
	/* It moved before and moves still: the same target or speed once more changes nothing. */
	if (before->moving && !stands && again &&
	    (positions || command == DB_CMD_MOVE_VELOCITY || command == DB_CMD_MOVE_PRESET))
		return say_again(axis, job, exchange, result);
	return failed(axis, job,
	              unmoved && command != DB_CMD_SHAKE_START &&
	                              command != DB_CMD_SHAKE_START_TIME ?
	                      DB_RESULT_TIMEOUT :
	                      DB_RESULT_INDETERMINATE,
	              result);
}

/* A relative move's first exchange only reads. */
static bool is_preparation(const struct db_job *job)
{
	return job->request->command == DB_CMD_MOVE_RELATIVE && job->step == VSMD_FIRST;
}

/* One of the ends that a stop told a drive which may need none of them. */
static bool is_precaution(const struct vsmd_axis *axis, const struct db_job *job)
{
	return db_command_is_stop(job->request->command) && job->step != VSMD_FIRST &&
	       to_be_ended(axis) == VSMD_MOTION_UNKNOWN;
}

/* A part of a command's conversation is done: the next one, or its end. */
static enum db_step go_on(struct vsmd_axis *axis, struct db_job *job, struct db_exchange *exchange,
                          enum db_result *result)
{
	switch (job->request->command) {
	case DB_CMD_DISABLE:
		return check_power(axis, job, exchange, result);
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		return after_stop(axis, job, exchange, result);
	case DB_CMD_MOVE_RELATIVE:
		return after_relative(axis, job, exchange, result);
	case DB_CMD_HOME:
		if (job->step != VSMD_FIRST)
			return confirmed(axis, job, result);
		job->step = VSMD_SECOND;
		begin_watch(axis);
		return ask(axis, (struct vsmd_command){ .verb = VSMD_ZERO_START }, false, exchange,
		           result);
	case DB_CMD_SET_OUTPUTS:
		return send_output(axis, job, job->step + 1, exchange, result);
	default:
		return confirmed(axis, job, result);
	}
}

static bool is_refused(const struct vsmd_axis *axis, const struct db_job *job)
{
	/* A model that does not shake may refuse to end it: the stop itself was taken. And a status read
	 * inside a conversation shows the flag of the command before it. */
	return (axis->last.status & VSMD_ST_CMD_WRG) != 0 && !is_precaution(axis, job);
}

enum db_step vsmd_answer_command(struct vsmd_axis *axis, struct db_job *job,
                                 struct db_exchange *exchange, enum db_result *result)
{
	enum vsmd_effect effect;

	if (job->step == VSMD_READ_BACK && needs_read_back(job->request->command))
		return resolve(axis, job, exchange, result);
	if (is_preparation(job))
		return go_on(axis, job, exchange, result);
	axis->refused = is_refused(axis, job);
	if (axis->refused)
		return done(result, DB_RESULT_REFUSED);
	/* Whether it stops is for the scheduler to see. */
	if (db_command_is_stop(job->request->command))
		return go_on(axis, job, exchange, result);
	effect = vsmd_effect_of(axis, job);
	/* That the drive acknowledged it and moves as it should is enough. */
	if (effect != VSMD_EFFECT_SHOWN &&
	    !(effect == VSMD_EFFECT_OPEN && axis->link->acknowledges && !axis->watch.by_all))
		return look_again(axis, job, effect, exchange, result);
	return go_on(axis, job, exchange, result);
}

/* Later than the others it is not to begin: what does not show within the reaction time has failed. */
enum db_step vsmd_begun_by_all(struct vsmd_axis *axis, struct db_exchange *exchange,
                               enum db_result *result)
{
	axis->watch.by_all = true;
	return look(axis, VSMD_LOOK_STATUS, exchange, result);
}

enum db_step vsmd_lost(struct vsmd_axis *axis, struct db_job *job, struct db_exchange *exchange,
                       enum db_result *result)
{
	enum db_command command;
	bool reading;

	if (job->kind == DB_JOB_SETTINGS)
		axis->plate.doubtful = true;
	if (job->kind != DB_JOB_COMMAND)
		return done(result, DB_RESULT_TIMEOUT);
	command = job->request->command;
	if (command == DB_CMD_SAVE_PARAMETERS)
		return done(result, DB_RESULT_INDETERMINATE);
	if (!needs_read_back(command))
		return done(result, DB_RESULT_TIMEOUT);
	/* The preparation of a relative move or a homing run has not moved anything. */
	reading = job->step == VSMD_FIRST &&
	          (command == DB_CMD_MOVE_RELATIVE || command == DB_CMD_HOME);
	if (reading)
		return done(result, DB_RESULT_TIMEOUT);
	if (job->step == VSMD_READ_BACK)
		return failed(axis, job, DB_RESULT_INDETERMINATE, result);
	/* It may have been taken. */
	if (command == DB_CMD_MOVE_ABSOLUTE || command == DB_CMD_MOVE_RELATIVE)
		take_target(axis);
	axis->watch.since = 0;
	job->step = VSMD_READ_BACK;
	return look(axis, VSMD_LOOK_STATUS, exchange, result);
}

/* --- state ------------------------------------------------------------------------------------- */

static uint16_t inputs_of(uint32_t status)
{
	return (uint16_t)((status & 0xFu) | ((status >> 12) & 0x30u));
}

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
	feedback->inputs = inputs_of(axis->last.status);
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
