/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd.h"

#include <string.h>

/* Homing stands still for a moment between its phases; standing longer than this, at more than a few
 * looks, means that it ended without reaching its end. */
#define HOMING_STANDSTILL (500 * DB_NS_PER_MS)
#define HOMING_LOOKS 5

#define RESENDS_MAX 2

/* How long a drive may take to show that it has begun what it was told. */
#define EVIDENCE_TIME (10 * DB_NS_PER_MS)

/* scratch[0] of a motion command: where the drive stood. scratch[1]: these. */
#define WAS_MOVING 1
#define RESENDS_SHIFT 8

static enum db_step ask(struct vsmd_axis *axis, struct vsmd_command command, bool repeatable,
                        struct db_exchange *exchange, enum db_result *result)
{
	if (command.verb == VSMD_ZERO_START)
		axis->begun = VSMD_MOTION_HOMING;
	if (command.verb == VSMD_SHAKE_CYCLES || command.verb == VSMD_SHAKE_TIME)
		axis->begun = VSMD_MOTION_SHAKE;
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

static enum db_step send_output(struct vsmd_axis *axis, struct db_job *job, unsigned port,
                                struct db_exchange *exchange, enum db_result *result)
{
	const struct db_args *args = &job->request->args;

	port = next_output(args, port);
	if (port == 0)
		return done(result, DB_RESULT_OK);
	job->step = port;
	return ask(axis,
	           (struct vsmd_command){ .verb = VSMD_SENSOR_OUT,
	                                  .port = (uint8_t)port,
	                                  .value = (args->output_levels >> (port - 1)) & 1 },
	           true, exchange, result);
}

enum db_step vsmd_begin_command(struct vsmd_axis *axis, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;
	bool repeatable = !needs_read_back(command) || command == DB_CMD_MOVE_RELATIVE ||
	                  command == DB_CMD_HOME;

	if (command == DB_CMD_SET_OUTPUTS)
		return send_output(axis, job, 1, exchange, result);
	if (command == DB_CMD_SAVE_PARAMETERS) {
		if (axis->saved && job->started - axis->last_save < axis->save_interval)
			return done(result, DB_RESULT_RATE_LIMITED);
		axis->saved = true;
		axis->last_save = job->started;
		repeatable = false;
	}
	axis->asked_at = 0;
	if (command == DB_CMD_MOVE_ABSOLUTE)
		axis->wanted = job->request->args.target_position;
	job->scratch[0] = axis->last.position;
	job->scratch[1] = axis->last.status & VSMD_ST_STP ? 0 : WAS_MOVING;
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
}

void vsmd_take_identity(struct vsmd_axis *axis, const char *text, size_t length)
{
	char kept[DB_IDENTITY_MAX] = { 0 };

	/* The document's samples carry the text in quotation marks, drives send it without. */
	if (length >= 2 && text[0] == '"' && text[length - 1] == '"') {
		text++;
		length -= 2;
	}
	memcpy(kept, text, length < sizeof kept ? length : sizeof kept);
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
	}
	axis->plate.generation++;
}

/* For longer than homing stands between two of its phases; asked once for each status. */
static bool stands_for_good(struct vsmd_axis *axis)
{
	if (axis->standstill_looks++ == 0)
		axis->standstill_since = axis->heard_at;
	return axis->standstill_looks > HOMING_LOOKS &&
	       axis->heard_at - axis->standstill_since > HOMING_STANDSTILL;
}

void vsmd_follow_motion(struct vsmd_axis *axis)
{
	uint32_t status = axis->last.status;

	axis->fresh = false;
	if (!(status & VSMD_ST_STP)) {
		axis->standstill_looks = 0;
		if (axis->motion == VSMD_MOTION_NONE)
			axis->motion = VSMD_MOTION_UNKNOWN;
		return;
	}
	axis->stopping = false;
	if (axis->motion == VSMD_MOTION_UNKNOWN) {
		/* It may be homing, between two phases. */
		if ((status & VSMD_ST_ZERO) || stands_for_good(axis))
			forget_motion(axis);
	} else if (axis->motion != VSMD_MOTION_HOMING) {
		axis->motion = VSMD_MOTION_NONE;
	} else if (status & VSMD_ST_ZERO) {
		axis->homed = true;
		axis->origin_lost = false;
		forget_motion(axis);
	} else if (stands_for_good(axis)) {
		forget_motion(axis);
	}
}

void vsmd_take_confirmation(struct vsmd_axis *axis, int32_t position, uint32_t word, db_time now)
{
	bool hs = (word & VSMD_ST_HS) != 0;

	if (axis->handshaken && !hs) {
		/* It lost power between two polls: what it was told before is gone. */
		forget_motion(axis);
		axis->homed = false;
		axis->origin_lost = true;
		axis->has_target = false;
		axis->params_valid = false;
	}
	axis->handshaken = hs;
	axis->last.position = position;
	axis->last.status = word;
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
	axis->has_target = false;
}

static void take_target(struct vsmd_axis *axis)
{
	axis->has_target = true;
	axis->target = axis->wanted;
}

/* The drive confirmed a command: what that means for the axis. */
static void carried_out(struct vsmd_axis *axis, const struct db_job *job)
{
	const struct db_args *args = &job->request->args;

	switch (job->request->command) {
	case DB_CMD_MOVE_VELOCITY:
	case DB_CMD_MOVE_PRESET:
		start_motion(axis, VSMD_MOTION_CONTINUOUS);
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		start_motion(axis, VSMD_MOTION_DISCRETE);
		take_target(axis);
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
		axis->has_target = false;
		axis->last.position = args->target_position;
		axis->process.position = args->target_position;
		break;
	case DB_CMD_DISABLE: /* section 2.4.3: the position becomes 0, the origin is lost */
		forget_motion(axis);
		axis->homed = false;
		axis->origin_lost = true;
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
	carried_out(axis, job);
	return done(result, DB_RESULT_OK);
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

/*
 * Whether the status that was read behind a command shows that it had an effect. Only asked where
 * answers do not tell: of commands whose effect does not show, true.
 */
static bool is_evident(const struct vsmd_axis *axis, const struct db_job *job)
{
	const struct db_args *args = &job->request->args;
	uint32_t status = axis->last.status;
	bool stands = (status & VSMD_ST_STP) != 0;

	switch (job->request->command) {
	case DB_CMD_MOVE_ABSOLUTE:
		return !stands || axis->last.position == args->target_position;
	case DB_CMD_MOVE_RELATIVE:
		return !stands || axis->last.position == axis->wanted;
	case DB_CMD_MOVE_VELOCITY:
		return !stands || !(args->target_velocity > 0.0f || args->target_velocity < 0.0f);
	case DB_CMD_MOVE_PRESET:
		return !stands;
	case DB_CMD_HOME:
		return job->step == VSMD_FIRST || !stands || (status & VSMD_ST_ZERO);
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		return !stands || (status & VSMD_ST_ACT);
	case DB_CMD_SET_POSITION:
		return !stands || axis->last.position == args->target_position;
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		return stands || next_end(axis, job) != VSMD_NO_END;
	case DB_CMD_CLEAR_FAULT:
		return !(status & VSMD_ST_ENC_ERR);
	default:
		return true;
	}
}

/* Has the power stage followed enable or disable? It may be a status too early in the answer. */
static enum db_step check_power(struct vsmd_axis *axis, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	bool wanted = job->request->command == DB_CMD_ENABLE;
	bool powered = (axis->last.status & VSMD_ST_PWR) != 0;

	if (powered == wanted)
		return confirmed(axis, job, result);
	if (job->step < VSMD_THIRD) {
		job->step++;
		return ask_verb(axis, VSMD_STS, exchange, result);
	}
	return done(result, DB_RESULT_FAILED);
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

static enum db_step after_relative(struct vsmd_axis *axis, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	int64_t target;

	if (job->step != VSMD_FIRST)
		return confirmed(axis, job, result);
	target = (int64_t)axis->last.position + job->request->args.target_position;
	if (target < INT32_MIN || target > INT32_MAX)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	/* It may have moved since the limits were checked. Those that are not set are NAN. */
	if ((double)target / axis->config->counts_per_unit < axis->config->min_position ||
	    (double)target / axis->config->counts_per_unit > axis->config->max_position)
		return done(result, DB_RESULT_LIMIT);
	axis->wanted = (int32_t)target;
	job->scratch[0] = axis->last.position;
	job->scratch[1] = axis->last.status & VSMD_ST_STP ? 0 : WAS_MOVING;
	return send_target(axis, job, exchange, result);
}

/* Sends a motion command again that the drive demonstrably did not receive. */
static enum db_step resend(struct vsmd_axis *axis, struct db_job *job, struct db_exchange *exchange,
                           enum db_result *result)
{
	enum db_command command = job->request->command;

	if (job->scratch[1] >> RESENDS_SHIFT >= RESENDS_MAX)
		return done(result, DB_RESULT_TIMEOUT);
	job->scratch[1] += 1 << RESENDS_SHIFT;
	if (command == DB_CMD_MOVE_RELATIVE)
		return send_target(axis, job, exchange, result);
	job->step = command == DB_CMD_HOME ? VSMD_SECOND : VSMD_FIRST;
	if (command == DB_CMD_HOME)
		return ask(axis, (struct vsmd_command){ .verb = VSMD_ZERO_START }, false, exchange,
		           result);
	return ask(axis, vsmd_command_of(command, &job->request->args), false, exchange, result);
}

/*
 * The effect of a command does not show (yet). Looks again for a while, then says it again where
 * that is harmless. A stop is said again at once; that its deceleration is long is no failure.
 */
static enum db_step look_again(struct vsmd_axis *axis, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;
	bool again = job->scratch[1] >> RESENDS_SHIFT < RESENDS_MAX;

	if (db_command_is_stop(command))
		return again ? resend(axis, job, exchange, result) : confirmed(axis, job, result);
	if (axis->asked_at == 0)
		axis->asked_at = axis->heard_at;
	if (axis->heard_at - axis->asked_at < EVIDENCE_TIME)
		return ask_verb(axis, VSMD_STS, exchange, result);
	axis->asked_at = 0;
	/* Homing or shaking that began unnoticed must not begin anew. */
	if (again && command != DB_CMD_HOME && command != DB_CMD_SHAKE_START &&
	    command != DB_CMD_SHAKE_START_TIME)
		return resend(axis, job, exchange, result);
	return done(result, DB_RESULT_FAILED);
}

/* The answer to a motion command or set_position was lost: what does the drive itself say? */
static enum db_step resolve(struct vsmd_axis *axis, struct db_job *job,
                            struct db_exchange *exchange, enum db_result *result)
{
	const struct vsmd_status *now = &axis->last;
	enum db_command command = job->request->command;
	bool positions = command == DB_CMD_MOVE_ABSOLUTE || command == DB_CMD_MOVE_RELATIVE;
	bool stands = (now->status & VSMD_ST_STP) != 0;
	bool stood = !(job->scratch[1] & WAS_MOVING);
	bool unmoved = stood && stands && now->position == job->scratch[0];

	if (unmoved && (now->status & VSMD_ST_CMD_WRG))
		return done(result, DB_RESULT_REFUSED);
	if (command == DB_CMD_SET_POSITION) {
		if (stands && now->position == job->request->args.target_position)
			return confirmed(axis, job, result);
		return unmoved ? resend(axis, job, exchange, result) :
		                 done(result, DB_RESULT_INDETERMINATE);
	}
	if (positions && stands && now->position == axis->wanted)
		return confirmed(axis, job, result);
	if (stood && !stands)
		return confirmed(axis, job, result);
	if (command == DB_CMD_HOME && (now->status & VSMD_ST_ZERO))
		return confirmed(axis, job, result);
	/* A shake may be over already, back where it began. */
	if (unmoved && command != DB_CMD_SHAKE_START && command != DB_CMD_SHAKE_START_TIME)
		return resend(axis, job, exchange, result);
	/* It moved before and moves still: the same target or speed once more changes nothing. */
	if (!stood && !stands &&
	    (positions || command == DB_CMD_MOVE_VELOCITY || command == DB_CMD_MOVE_PRESET))
		return resend(axis, job, exchange, result);
	return done(result, DB_RESULT_INDETERMINATE);
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

enum db_step vsmd_answer_command(struct vsmd_axis *axis, struct db_job *job,
                                 struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;

	if (job->step == VSMD_READ_BACK && needs_read_back(command))
		return resolve(axis, job, exchange, result);
	/* A model that does not shake may refuse to end it: the stop itself was taken. */
	axis->refused = (axis->last.status & VSMD_ST_CMD_WRG) != 0 && !is_precaution(axis, job);
	/* A status read inside a conversation shows the flag of the command before it. */
	if (axis->refused && !is_preparation(job))
		return done(result, DB_RESULT_REFUSED);
	if (!axis->link->acknowledges && !is_preparation(job) && !is_evident(axis, job))
		return look_again(axis, job, exchange, result);
	axis->asked_at = 0;
	switch (command) {
	case DB_CMD_ENABLE:
	case DB_CMD_DISABLE:
		return check_power(axis, job, exchange, result);
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		return after_stop(axis, job, exchange, result);
	case DB_CMD_MOVE_RELATIVE:
		return after_relative(axis, job, exchange, result);
	case DB_CMD_HOME:
		if (job->step == VSMD_FIRST) {
			job->step = VSMD_SECOND;
			return ask(axis, (struct vsmd_command){ .verb = VSMD_ZERO_START }, false,
			           exchange, result);
		}
		return confirmed(axis, job, result);
	case DB_CMD_SET_OUTPUTS:
		return send_output(axis, job, job->step + 1, exchange, result);
	default:
		return confirmed(axis, job, result);
	}
}

enum db_step vsmd_lost(struct vsmd_axis *axis, struct db_job *job, struct db_exchange *exchange,
                       enum db_result *result)
{
	enum db_command command = job->request ? job->request->command : DB_CMD_NONE;
	bool reading;

	if (job->kind == DB_JOB_SETTINGS)
		axis->plate.doubtful = true;
	if (job->kind != DB_JOB_COMMAND)
		return done(result, DB_RESULT_TIMEOUT);
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
		return done(result, DB_RESULT_INDETERMINATE);
	/* It may have been taken. */
	if (command == DB_CMD_MOVE_ABSOLUTE || command == DB_CMD_MOVE_RELATIVE)
		take_target(axis);
	job->step = VSMD_READ_BACK;
	return ask_verb(axis, VSMD_STS, exchange, result);
}

/* --- state ------------------------------------------------------------------------------------- */

static uint16_t inputs_of(uint32_t status)
{
	return (uint16_t)((status & 0xFu) | ((status >> 12) & 0x30u));
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
	if (stands && axis->has_target && axis->last.position == axis->target)
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
}
