/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/vsmd/commands.h"

#include "driver/vsmd/vsmd_private.h"

#include <math.h>

#define RESENDS_MAX 2

/* A motion that an older command also explains is observed for this time. */
#define OPEN_TIME (20 * DB_NS_PER_MS)

/* A drive that does not answer commands is sent disable at this interval, until its motor is
 * off. */
#define OFF_AGAIN (10 * DB_NS_PER_MS)

/* Maximum number of readings of the position from which a relative move is counted, until two
 * agree. */
#define READINGS_MAX 5

#define OUTPUTS 6

/* --- what a command looks like ---------------------------------------------------------------- */

/* True when after a lost answer the drive must be read back before anything else is done. */
static bool needs_read_back(enum db_command command)
{
	return db_command_is_motion(command) || command == DB_CMD_SET_POSITION;
}

struct vsmd_command vsmd_command_of(enum db_command command, const struct db_args *args)
{
	bool in_time;

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
		return (struct vsmd_command){ .verb = VSMD_POS,
			                      .position = args->target_position,
			                      .has_velocity = args->target_velocity > 0.0f,
			                      .velocity = args->target_velocity };
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
	case DB_CMD_SET_NMOS:
		return (struct vsmd_command){ .verb = command == DB_CMD_SET_SV ? VSMD_SV :
			                                                         VSMD_NMOS,
			                      .port = (uint8_t)args->output_number,
			                      .value = (uint8_t)args->output_value };
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		in_time = command == DB_CMD_SHAKE_START_TIME;
		return (struct vsmd_command){
			.verb = in_time ? VSMD_SHAKE_TIME : VSMD_SHAKE_CYCLES,
			.shake_start = args->shake_start_position,
			.shake_end = args->shake_end_position,
			.shake_frequency = args->shake_frequency,
			.shake_count = in_time ? args->shake_time : args->shake_cycles,
		};
	case DB_CMD_SHAKE_STOP:
		return (struct vsmd_command){ .verb = VSMD_SHAKE_STOP };
	default: /* relative moves, and anything check() refuses, begin by reading the status */
		return (struct vsmd_command){ .verb = VSMD_STS };
	}
}

enum db_result vsmd_check_command(const struct vsmd_link *link, enum db_command command,
                                  const struct db_args *args)
{
	bool right = true;

	switch (command) {
	case DB_CMD_MOVE_VELOCITY:
		right = is_within((double)args->target_velocity, -VSMD_SPEED_MAX, VSMD_SPEED_MAX);
		break;
	case DB_CMD_MOVE_ABSOLUTE:
	case DB_CMD_MOVE_RELATIVE:
		right = is_within((double)args->target_velocity, 0.0, VSMD_SPEED_MAX);
		break;
	case DB_CMD_SET_OUTPUT:
		right = is_within(args->output_number, 1, OUTPUTS) && args->output_value <= 1;
		break;
	case DB_CMD_SET_OUTPUTS:
		right = args->output_mask != 0 && args->output_mask < 1u << OUTPUTS;
		break;
	case DB_CMD_SET_SV:
	case DB_CMD_SET_NMOS:
		right = is_within(args->output_number, 1, 3) && args->output_value <= 255;
		break;
	case DB_CMD_SHAKE_START:
	case DB_CMD_SHAKE_START_TIME:
		right = is_within((double)args->shake_frequency, (double)link->shake_frequency_min,
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

/* --- what the steps say ----------------------------------------------------------------------- */

static enum db_step send_command(struct db_conversation *talk, struct vsmd_command command,
                                 bool repeatable)
{
	struct vsmd_axis *axis = axis_of(talk);

	if (command.verb == VSMD_ZERO_START)
		axis->begun = VSMD_MOTION_HOMING;
	if (command.verb == VSMD_SHAKE_CYCLES || command.verb == VSMD_SHAKE_TIME)
		axis->begun = VSMD_MOTION_SHAKE;
	if (command.verb == VSMD_ORG || command.verb == VSMD_OFF ||
	    command.verb == VSMD_ZERO_START || command.verb == VSMD_ZERO_STOP)
		vsmd_expect_change(axis);
	talk->exchange->begins = command.verb == VSMD_MOV || command.verb == VSMD_POS ||
	                         command.verb == VSMD_ZERO_START;
	return axis->link->send(talk, &command, repeatable);
}

/* Remember the state before the command; its effect is judged against it. */
static void begin_watch(struct vsmd_axis *axis)
{
	const struct vsmd_status *last = &axis->last;

	axis->watch = (struct vsmd_watch){
		.before = {
			.moving = !(last->status & VSMD_ST_STP),
			.status = last->status,
			.position = last->position,
			.velocity = last->velocity,
			.back = axis->back,
			.at = axis->status_at,
			.goal = axis->goal,
		},
		.unproven = axis->watch.unproven,
		.upsets = axis->upsets,
	};
}

static enum db_step send_order(struct db_conversation *talk)
{
	const struct db_request *request = talk->job->request;
	struct vsmd_command command;

	switch (request->command) {
	case DB_CMD_MOVE_RELATIVE:
		command = vsmd_command_of(DB_CMD_MOVE_ABSOLUTE, request->args);
		command.position = axis_of(talk)->wanted;
		return send_command(talk, command, false);
	case DB_CMD_HOME:
		return send_command(talk, (struct vsmd_command){ .verb = VSMD_ZERO_START }, false);
	default:
		return send_command(talk, vsmd_command_of(request->command, request->args),
		                    !needs_read_back(request->command));
	}
}

/* What the steps send that have their own command; the others read the status. */
static enum db_step send_fixed(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);
	const struct db_args *args;
	unsigned port;

	switch (talk->job->step) {
	case VSMD_STEP_POSITION:
		return send_command(talk, (struct vsmd_command){ .verb = VSMD_STS }, true);
	case VSMD_STEP_CLEAR_HOMED:
		/* A repeat because the effect did not show is not marked as repeatable. */
		return send_command(talk, (struct vsmd_command){ .verb = VSMD_ZERO_STOP },
		                    axis->watch.resends == 0);
	case VSMD_STEP_OUTPUT:
		args = talk->job->request->args;
		port = axis->watch.output;
		return send_command(
			talk,
			(struct vsmd_command){ .verb = VSMD_SENSOR_OUT,
		                               .port = (uint8_t)port,
		                               .value = args->output_levels >> (port - 1) & 1 },
			true);
	case VSMD_STEP_END_HOMING:
		return send_command(talk, (struct vsmd_command){ .verb = VSMD_ZERO_STOP }, true);
	case VSMD_STEP_END_SHAKING:
		return send_command(talk, (struct vsmd_command){ .verb = VSMD_SHAKE_STOP }, true);
	case VSMD_STEP_SAVE:
		return send_command(talk, (struct vsmd_command){ .verb = VSMD_SAV }, false);
	default:
		return axis->link->read(talk, VSMD_READ_STATUS);
	}
}

/* Sends the next port of a set_outputs, from `port` on; or all were set. */
static enum db_step send_next_output(struct db_conversation *talk, unsigned port)
{
	struct vsmd_watch *watch = &axis_of(talk)->watch;

	while (port <= OUTPUTS && !(talk->job->request->args->output_mask >> (port - 1) & 1))
		port++;
	if (port > OUTPUTS)
		return end_job(talk, watch->unproven ? DB_RESULT_UNPROVEN : DB_RESULT_OK);
	watch->output = port;
	watch->since = 0;
	watch->resends = 0;
	return send_step(talk, vsmd_command_steps, VSMD_STEP_OUTPUT);
}

/* --- how a command ends ----------------------------------------------------------------------- */

static enum db_step confirm_command(struct db_conversation *talk)
{
	const struct db_request *request = talk->job->request;
	struct vsmd_axis *axis = axis_of(talk);
	bool proven = vsmd_shows_its_effect(axis->link, request->command) &&
	              (db_command_is_stop(request->command) || !axis->watch.unproven);

	vsmd_carry_out(axis, request);
	return end_job(talk, proven ? DB_RESULT_OK : DB_RESULT_UNPROVEN);
}

static enum db_step fail_command(struct db_conversation *talk, enum db_result result)
{
	/* The drive may have received it or not. */
	if (db_command_is_motion(talk->job->request->command))
		axis_of(talk)->goal.kind = VSMD_GOAL_UNKNOWN;
	return end_job(talk, result);
}

/* --- stops ------------------------------------------------------------------------------------ */

/* A model that does not shake may refuse to end it: the stop itself was accepted. And a status read
 * during a conversation shows the flag of the command before it. */
static bool is_stop_refused(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	/* A drive that moves for an unknown reason is sent all kinds of ends. */
	axis->refused = axis->refuses &&
	                !(talk->job->step != VSMD_STEP_STOP && talk->job->step != VSMD_STEP_OFF &&
	                  vsmd_motion_to_end(axis_of(talk)) == VSMD_MOTION_UNKNOWN);
	return axis->refused;
}

/* The scheduler judges whether it stops. Its homing-done bit shows that a drive is not homing, and
 * ending that would lose the bit. */
static enum db_step answer_stop(struct db_conversation *talk)
{
	const struct vsmd_axis *axis = axis_of(talk);
	enum vsmd_motion motion = vsmd_motion_to_end(axis);
	bool unknown = motion == VSMD_MOTION_UNKNOWN;

	if (is_stop_refused(talk))
		return end_job(talk, DB_RESULT_REFUSED);
	if (talk->job->step < VSMD_STEP_END_HOMING &&
	    (motion == VSMD_MOTION_HOMING || (unknown && !(axis->last.status & VSMD_ST_ZERO))))
		return send_step(talk, vsmd_command_steps, VSMD_STEP_END_HOMING);
	if (talk->job->step < VSMD_STEP_END_SHAKING && (motion == VSMD_MOTION_SHAKE || unknown))
		return send_step(talk, vsmd_command_steps, VSMD_STEP_END_SHAKING);
	return confirm_command(talk);
}

/* Checks whether the power stage has followed disable, which takes time. */
static enum db_step answer_off(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	if (is_stop_refused(talk))
		return end_job(talk, DB_RESULT_REFUSED);
	if (!(axis->last.status & VSMD_ST_PWR))
		return confirm_command(talk);
	if (talk->job->step == VSMD_STEP_OFF)
		axis->power_asked = axis->off_sent = axis->status_at;
	if (axis->status_at - axis->power_asked >= axis->reaction)
		return end_job(talk, DB_RESULT_FAILED);
	if (!axis->link->acknowledges && axis->status_at - axis->off_sent >= OFF_AGAIN) {
		axis->off_sent = axis->status_at;
		return send_order(talk);
	}
	return send_step(talk, vsmd_command_steps, VSMD_STEP_POWER);
}

/* --- other commands --------------------------------------------------------------------------- */

static enum db_step answer_position(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);
	struct vsmd_watch *watch = &axis->watch;
	int64_t target;
	double place;

	/* The start of a relative move is read twice, in two frame types, because one answer may be
	 * stale. A single awaited answer cannot be overtaken. */
	if (!axis->link->acknowledges) {
		double seconds = (double)(axis->status_at - watch->counted_at) /
		                 (double)DB_NS_PER_S;
		double way = axis->last.status & VSMD_ST_STP ? 0.0 :
		                                               (double)VSMD_SPEED_MAX * seconds;
		unsigned readings = watch->readings++;
		bool agreed = readings % 2 == 1 &&
		              fabs((double)axis->last.position - (double)watch->counted_from) <=
		                      axis->window + way;

		watch->counted_from = axis->last.position;
		watch->counted_at = axis->status_at;
		if (!agreed && readings >= READINGS_MAX)
			return end_job(talk, DB_RESULT_FAILED);
		if (!agreed)
			return axis->link->read(talk, readings % 2 == 0 ? VSMD_READ_POSITION :
			                                                  VSMD_READ_STATUS);
	}
	target = (int64_t)axis->last.position + talk->job->request->args->target_position;
	if (target < INT32_MIN || target > INT32_MAX)
		return end_job(talk, DB_RESULT_OUT_OF_RANGE);
	/* It may have moved since the limits were checked. Limits that are not set are NAN. */
	place = (double)target / axis->config->counts_per_unit;
	if (place < axis->config->min_position || place > axis->config->max_position)
		return end_job(talk, DB_RESULT_LIMIT);
	axis->wanted = (int32_t)target;
	begin_watch(axis);
	return send_step(talk, vsmd_command_steps, VSMD_STEP_ORDER);
}

/* The step's part of a command is done: continue with the next one, or end. */
static enum db_step complete_step(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	switch (talk->job->step) {
	case VSMD_STEP_CLEAR_HOMED:
		begin_watch(axis);
		return send_step(talk, vsmd_command_steps, VSMD_STEP_ORDER);
	case VSMD_STEP_OUTPUT:
		return send_next_output(talk, axis->watch.output + 1);
	default:
		return confirm_command(talk);
	}
}

/* Sends a command again. Only where that is harmless, or the drive demonstrably did not accept
 * it. */
static enum db_step send_again(struct db_conversation *talk)
{
	struct vsmd_watch *watch = &axis_of(talk)->watch;
	unsigned step = talk->job->step;

	watch->resends++;
	watch->since = 0;
	watch->speed_next = false;
	return send_step(talk, vsmd_command_steps,
	                 step == VSMD_STEP_READ_BACK ? VSMD_STEP_ORDER : step);
}

/* Output levels are not documented to show in the status: a change is proof, but no change proves
 * nothing. */
static bool may_hide_its_effect(struct db_conversation *talk)
{
	const struct vsmd_axis *axis = axis_of(talk);
	const struct db_request *request = talk->job->request;
	bool single = request->command == DB_CMD_SET_OUTPUT;
	unsigned port = single ? request->args->output_number : axis->watch.output;
	unsigned mode = (unsigned)VSMD_S1 + port - 1;

	if (!single && request->command != DB_CMD_SET_OUTPUTS)
		return false;
	return !(axis->plate.valid[0] >> mode & 1) || axis->plate.values[mode].u == 1;
}

/* The effect of a command does not show (yet), or something else may have caused it. */
static enum db_step check_again(struct db_conversation *talk, enum vsmd_effect effect)
{
	struct vsmd_axis *axis = axis_of(talk);
	struct vsmd_watch *watch = &axis->watch;
	enum db_command command = talk->job->request->command;
	db_time patience = axis->reaction;
	/* Positions may have another meaning now, which the client does not know. */
	bool restarted = watch->upsets != axis->upsets;
	/* Homing or shaking that began unnoticed must not begin again. */
	bool repeats = !restarted && !axis->link->acknowledges && !watch->by_all &&
	               command != DB_CMD_SHAKE_START && command != DB_CMD_SHAKE_START_TIME &&
	               !(command == DB_CMD_HOME && talk->job->step == VSMD_STEP_ORDER);

	if (effect == VSMD_EFFECT_OPEN && patience > OPEN_TIME)
		patience = OPEN_TIME;
	if (watch->since == 0)
		watch->since = axis->status_at;
	/* Send twice without waiting; losing both frames is unlikely. */
	if (effect == VSMD_EFFECT_OPEN && watch->resends == 0 && repeats &&
	    command != DB_CMD_SET_POSITION) {
		db_time since = watch->since;
		enum db_step step = send_again(talk);

		watch->since = since;
		return step;
	}
	if (axis->status_at - watch->since < patience) {
		watch->speed_next = !watch->speed_next && watch->before.moving &&
		                    needs_read_back(command);
		return axis->link->read(talk,
		                        watch->speed_next ? VSMD_READ_SPEED : VSMD_READ_STATUS);
	}
	if (effect == VSMD_EFFECT_ABSENT && watch->resends < RESENDS_MAX && repeats)
		return send_again(talk);
	/* The end of the last homing stays set: the next one may clear it, and is at its end only
	 * after that. */
	if (talk->job->step == VSMD_STEP_CLEAR_HOMED && !restarted) {
		axis->zero_is_old = true;
		return complete_step(talk);
	}
	/* The motion of a drive that does not report its speed cannot be seen: no visible effect is
	 * no failure. */
	if (effect == VSMD_EFFECT_ABSENT && !may_hide_its_effect(talk) &&
	    !(db_command_is_motion(command) && vsmd_reports_no_speed(axis)))
		return fail_command(
			talk,
			command == DB_CMD_SET_OUTPUT &&
					vsmd_is_input(axis,
		                                      talk->job->request->args->output_number) ?
				DB_RESULT_REFUSED :
				DB_RESULT_FAILED);
	watch->unproven = true;
	return complete_step(talk);
}

static enum db_step answer_order(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);
	enum vsmd_effect effect;

	axis->refused = axis->refuses;
	if (axis->refused)
		return end_job(talk, DB_RESULT_REFUSED);
	effect = vsmd_effect_of(axis, talk->job);
	/* It is enough that the drive acknowledged it and moves as it should. */
	if (effect == VSMD_EFFECT_SHOWN ||
	    (effect == VSMD_EFFECT_OPEN && axis->link->acknowledges && !axis->watch.by_all))
		return complete_step(talk);
	return check_again(talk, effect);
}

static enum db_step answer_save(struct db_conversation *talk)
{
	return axis_of(talk)->link->saved(talk);
}

/* The answer to a motion command or set_position was lost: the drive itself is read. */
static enum db_step answer_read_back(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);
	const struct vsmd_status *now = &axis->last;
	const struct vsmd_before *before = &axis->watch.before;
	const struct db_request *request = talk->job->request;
	enum db_command command = request->command;
	bool positions = command == DB_CMD_MOVE_ABSOLUTE || command == DB_CMD_MOVE_RELATIVE;
	bool stands = (now->status & VSMD_ST_STP) != 0;
	bool unmoved = !before->moving && stands &&
	               vsmd_is_at(axis, now->position, before->position);
	bool shakes = command == DB_CMD_SHAKE_START || command == DB_CMD_SHAKE_START_TIME;
	/* After a restart positions have another meaning, which the client does not know. */
	bool again = axis->watch.resends < RESENDS_MAX && !axis->watch.by_all &&
	             axis->watch.upsets == axis->upsets;

	if (positions && stands && vsmd_is_at(axis, now->position, axis->wanted))
		return confirm_command(talk);
	if (unmoved && (now->status & VSMD_ST_CMD_WRG))
		return end_job(talk, DB_RESULT_REFUSED);
	if (command == DB_CMD_SET_POSITION && stands &&
	    vsmd_is_at(axis, now->position, request->args->target_position))
		return confirm_command(talk);
	if (command != DB_CMD_SET_POSITION && !before->moving && !stands)
		return confirm_command(talk);
	if (command == DB_CMD_HOME && (now->status & VSMD_ST_ZERO))
		return confirm_command(talk);
	if (unmoved && axis->watch.since == 0)
		axis->watch.since = axis->status_at;
	/* It may only be slow to begin. */
	if (unmoved && axis->status_at - axis->watch.since < axis->reaction)
		return axis->link->read(talk, VSMD_READ_STATUS);
	/* A shake may be over already, back where it began. */
	if (unmoved && again && !shakes)
		return send_again(talk);
	/* It moved before and still moves: sending the same target or speed once more changes
	 * nothing. */
	if (before->moving && !stands && again &&
	    (positions || command == DB_CMD_MOVE_VELOCITY || command == DB_CMD_MOVE_PRESET))
		return send_again(talk);
	return fail_command(talk, unmoved && !shakes ? DB_RESULT_TIMEOUT : DB_RESULT_INDETERMINATE);
}

/* --- answers that do not come ----------------------------------------------------------------- */

static enum db_step lose_order(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);
	enum db_command command = talk->job->request->command;

	if (!needs_read_back(command))
		return end_job(talk, DB_RESULT_TIMEOUT);
	/* It may have been accepted. */
	if (command == DB_CMD_MOVE_ABSOLUTE || command == DB_CMD_MOVE_RELATIVE) {
		axis->has_target = true;
		axis->target = axis->wanted;
	}
	axis->watch.since = 0;
	return send_step(talk, vsmd_command_steps, VSMD_STEP_READ_BACK);
}

static enum db_step lose_read_back(struct db_conversation *talk)
{
	return fail_command(talk, DB_RESULT_INDETERMINATE);
}

/* --- the table -------------------------------------------------------------------------------- */

/* Without `lost`: nothing was sent that moves anything, or the client may send it again. */
const struct conversation_step vsmd_command_steps[VSMD_STEPS] = {
	[VSMD_STEP_ORDER] = { .send = send_order, .answered = answer_order, .lost = lose_order },
	[VSMD_STEP_POSITION] = { .send = send_fixed, .answered = answer_position },
	[VSMD_STEP_CLEAR_HOMED] = { .send = send_fixed, .answered = answer_order },
	[VSMD_STEP_OUTPUT] = { .send = send_fixed, .answered = answer_order },
	[VSMD_STEP_STOP] = { .send = send_order, .answered = answer_stop },
	[VSMD_STEP_END_HOMING] = { .send = send_fixed, .answered = answer_stop },
	[VSMD_STEP_END_SHAKING] = { .send = send_fixed, .answered = answer_stop },
	[VSMD_STEP_OFF] = { .send = send_order, .answered = answer_off },
	[VSMD_STEP_POWER] = { .send = send_fixed, .answered = answer_off },
	[VSMD_STEP_SAVE] = { .send = send_fixed,
	                     .answered = answer_save,
	                     .lost = end_indeterminate },
	[VSMD_STEP_READ_BACK] = { .send = send_fixed,
	                          .answered = answer_read_back,
	                          .lost = lose_read_back },
};

bool vsmd_is_command(const struct db_job *job)
{
	return job->kind == DB_JOB_COMMAND && job->request->command != DB_CMD_READ_PARAMETERS;
}

enum db_step vsmd_begin_command(struct db_conversation *talk)
{
	const struct db_request *request = talk->job->request;
	struct vsmd_axis *axis = axis_of(talk);

	if (!db_command_is_stop(request->command)) {
		axis->watch.unproven = false;
		begin_watch(axis);
	}
	switch (request->command) {
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		return send_step(talk, vsmd_command_steps, VSMD_STEP_STOP);
	case DB_CMD_DISABLE:
		return send_step(talk, vsmd_command_steps, VSMD_STEP_OFF);
	case DB_CMD_SET_OUTPUTS:
		return send_next_output(talk, 1);
	case DB_CMD_SAVE_PARAMETERS:
		/* Before it counts as one: it may be requested again as soon as all drives
		 * stand. */
		if (talk->brief)
			return end_job(talk, DB_RESULT_LINE_MOVES);
		if (axis->saved && talk->now - axis->last_save < axis->save_interval)
			return end_job(talk, DB_RESULT_RATE_LIMITED);
		axis->saved = true;
		axis->last_save = talk->now;
		return send_step(talk, vsmd_command_steps, VSMD_STEP_SAVE);
	case DB_CMD_MOVE_RELATIVE:
		return send_step(talk, vsmd_command_steps, VSMD_STEP_POSITION);
	case DB_CMD_HOME:
		return send_step(talk, vsmd_command_steps, VSMD_STEP_CLEAR_HOMED);
	case DB_CMD_CLEAR_FAULT:
		/* It says that the position is right. A drive without an encoder refuses eclr. */
		if (axis->doubt.kind != DB_DOUBT_NONE && !(axis->last.status & VSMD_ST_ENC_ERR))
			return confirm_command(talk);
		return send_step(talk, vsmd_command_steps, VSMD_STEP_ORDER);
	case DB_CMD_MOVE_ABSOLUTE:
		axis->wanted = request->args->target_position;
		/* fall through */
	default:
		return send_step(talk, vsmd_command_steps, VSMD_STEP_ORDER);
	}
}

/* It must not begin later than the others: a motion that does not show within the reaction time has
 * failed. */
enum db_step vsmd_begun_by_all(struct db_conversation *talk)
{
	struct vsmd_axis *axis = axis_of(talk);

	axis->watch.by_all = true;
	return axis->link->read(talk, VSMD_READ_STATUS);
}
