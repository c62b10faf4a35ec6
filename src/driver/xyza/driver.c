/* SPDX-License-Identifier: Apache-2.0 */
/*
 * XYZA stepper controllers ("5A A5") on RS485 and RS232. A controller has up to four axes, each a
 * drive of its own; ports, programs and system parameters are the controller's and show at all its
 * axes. The first axis polls for all of them.
 *
 * An answer names only the order it answers, and one that comes late fits any later request of that
 * order: so one request is under way at a time, and after a lost answer the controller is first
 * asked whether it is there, which is the only question with that order.
 *
 * A position is two reads, magnitude and sign. It may cross zero in between, so the sign is read
 * before and after, and again with the magnitude when it changed; a value whose sign is in doubt is
 * not shown.
 *
 * The document has no move to a position: only jogging, and programs that are stored in the
 * controller. Position moves are refused, not imitated.
 *
 * Source: the vendor's protocol V1.00 of 2016-10-20, sections 2 to 6.
 */
#include "driver/list.h"
#include "driver/xyza/plan.h"
#include "transport/serial.h"

#include <math.h>
#include <string.h>

/* What a controller usually needs before it answers; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (1 * DB_NS_PER_MS)

/* How long an axis that was told to stop may go on without getting slower. */
#define STOP_TIME (2 * DB_NS_PER_S)

/* Between two writes of a position it is neither the old one nor the new one. */
#define HOLD_TIME (500 * DB_NS_PER_MS)

/* How often the sign is read again when it changes under the reading. */
#define SIGN_TRIES 3

#define RESENDS_MAX 2

/* A controller also refuses what arrived with a wrong sum: it is asked again so often. */
#define REFUSALS_MAX 1

/* How often what was written without effect is written again. */
#define MENDS_MAX 2

/* How often an item is asked for before it counts as one that the controller does not have. */
#define ITEM_TRIES 2

/* scratch[1] of a stop: one of its two modes was stopped, or none needs to. */
#define STOP_TAKEN 1

enum option { OPTION_UNLOCK, OPTION_REACTION, OPTION_SPEED_CHANGE, OPTION_RAW_FRAMES };

static const struct db_option options[] = {
	[OPTION_UNLOCK] = {
		.section = "bus",
		.name = "unlock-system",
		.words = "no yes",
		.preset = "no",
		.unit = "",
		.description = "Lets system_info, factory_reset and slave_number be written",
	},
	[OPTION_REACTION] = {
		.section = "bus",
		.name = "reaction-ms",
		.words = "",
		.preset = "200",
		.min = 0,
		.max = 10000,
		.whole = true,
		.unit = "ms",
		.description = "How long the effect of a command may take to show before it counts as failed",
	},
	[OPTION_SPEED_CHANGE] = {
		.section = "bus",
		.name = "jog-speed-change",
		.words = "moving standing",
		.preset = "moving",
		.unit = "",
		.description = "Whether a jog that goes on the same way takes another speed while it moves, "
		               "or is stopped before",
	},
	[OPTION_RAW_FRAMES] = {
		.section = "bus",
		.name = "raw-frames",
		.words = "off on",
		.preset = "off",
		.unit = "",
		.description = "Lets clients send frames of their own with raw_frame, which the bridge "
		               "cannot judge",
	},
};

/* Where the cyclic reading is. */
enum poll_phase {
	POLL_STANDING,
	POLL_SIGN,
	POLL_MAGNITUDE,
	POLL_SIGN_AGAIN,
	POLL_PORTS,
	POLL_PROGRAM
};

/* Bits of drive_status, which the document does not have: made of what is read. The program's state
 * is a number in three of them. */
#define STATUS_NEGATIVE 0
#define STATUS_STANDS 1
#define STATUS_PROGRAM 8

static const struct db_drive_bit status_bits[] = {
	{ STATUS_NEGATIVE, "negative", "The position is negative" },
	{ STATUS_STANDS, "stands", "The axis stands" },
	{ STATUS_PROGRAM, "program_state_0", "Bit 0 of program_state" },
	{ STATUS_PROGRAM + 1, "program_state_1", "Bit 1 of program_state" },
	{ STATUS_PROGRAM + 2, "program_state_2", "Bit 2 of program_state" },
};

static enum db_step done(enum db_result *result, enum db_result value)
{
	*result = value;
	return DB_STEP_DONE;
}

static enum db_step ask(const struct db_device *device, struct xyza_request request,
                        bool repeatable, struct db_exchange *exchange, enum db_result *result)
{
	int length;

	request.object = device->object;
	length = xyza_encode_request(&request, exchange->request, exchange->request_size);
	if (length < 0)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	exchange->request_length = (size_t)length;
	exchange->answer_length = xyza_reply_length(request.verb);
	exchange->extra_time = 0;
	exchange->repeatable = repeatable;
	return DB_STEP_SEND;
}

static enum db_step ask_verb(const struct db_device *device, enum xyza_verb verb,
                             struct db_exchange *exchange, enum db_result *result)
{
	return ask(device, (struct xyza_request){ .verb = verb, .axis = device->axis }, true,
	           exchange, result);
}

static void take_program(struct db_device *first, const struct xyza_reply *reply)
{
	first->program = reply->program;
	first->program_state = reply->state;
	first->program_step = reply->step;
	first->paused = false;
}

/* --- cyclic reading -------------------------------------------------------------------------------- */

/* The next configured axis from `axis` on, or XYZA_AXIS_COUNT. */
static unsigned next_axis(const struct db_device *first, unsigned axis)
{
	while (axis < XYZA_AXIS_COUNT && !first->axes[axis])
		axis++;
	return axis;
}

static enum db_step poll_ask(struct db_device *first, struct db_job *job, enum poll_phase phase,
                             struct db_exchange *exchange, enum db_result *result)
{
	static const enum xyza_verb verbs[] = {
		[POLL_STANDING] = XYZA_READ_STANDING,   [POLL_SIGN] = XYZA_READ_SIGN,
		[POLL_MAGNITUDE] = XYZA_READ_MAGNITUDE, [POLL_SIGN_AGAIN] = XYZA_READ_SIGN,
		[POLL_PORTS] = XYZA_READ_PORTS,         [POLL_PROGRAM] = XYZA_PROGRAM_STATE,
	};
	struct xyza_request request = {
		.verb = verbs[phase],
	};

	/* Behind the last axis it is not used. */
	// NOLINTNEXTLINE(clang-analyzer-optin.core.EnumCastOutOfRange)
	request.axis = (enum xyza_axis)first->poll_axis;
	job->step = phase;
	return ask(first, request, true, exchange, result);
}

static enum db_step poll_begin(struct db_device *first, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	first->poll_axis = next_axis(first, 0);
	first->poll_asked = job->started;
	first->sign_tries = 0;
	return poll_ask(first, job, POLL_STANDING, exchange, result);
}

static void take_standing(struct db_device *device, const struct db_device *first)
{
	bool standing = first->poll_standing;

	/* What was seen before it was told something says nothing about what it does now. */
	if (first->poll_told != device->told ||
	    (standing && first->poll_asked < device->expected_by))
		return;
	device->standing = standing;
	device->fresh = false;
	if (standing)
		device->jogging = device->stopping = false;
	else
		device->expected_by = 0;
}

/* The sign was the same before and after: this is where the axis is. */
static void take_position(struct db_device *device, const struct db_device *first)
{
	int32_t position;

	take_standing(device, first);
	/* Half of it may be from before it was written. */
	if (first->poll_placed != device->placed || first->poll_taken < device->held_until ||
	    !xyza_position(first->poll_magnitude, first->poll_negative, &position))
		return;
	if (device->heard && first->poll_taken > device->taken)
		device->velocity = first->poll_standing &&
		                                   first->poll_asked >= device->expected_by ?
		                           0.0f :
		                           (float)((double)position - (double)device->position) *
		                                   (float)DB_NS_PER_S /
		                                   (float)(first->poll_taken - device->taken);
	device->position = position;
	device->negative = first->poll_negative;
	device->taken = first->poll_taken;
	device->heard = true;
}

static enum db_step poll_next_axis(struct db_device *first, struct db_job *job, db_time now,
                                   struct db_exchange *exchange, enum db_result *result)
{
	first->poll_axis = next_axis(first, first->poll_axis + 1);
	first->poll_asked = now;
	first->sign_tries = 0;
	return poll_ask(first, job, first->poll_axis < XYZA_AXIS_COUNT ? POLL_STANDING : POLL_PORTS,
	                exchange, result);
}

/* Nothing changed since the last time and nothing moves: the second look at the sign is not needed. */
static bool is_settled(const struct db_device *first, const struct db_device *device)
{
	int32_t position;

	return device->heard && first->poll_standing && device->standing &&
	       first->poll_told == device->told &&
	       xyza_position(first->poll_magnitude, first->poll_negative, &position) &&
	       position == device->position;
}

static enum db_step poll_answer(struct db_device *first, struct db_job *job,
                                const struct xyza_reply *reply, db_time now,
                                struct db_exchange *exchange, enum db_result *result)
{
	/* Behind the last axis come the ports and programs, which are the first one's. */
	struct db_device *device = first->poll_axis < XYZA_AXIS_COUNT ?
	                                   first->axes[first->poll_axis] :
	                                   first;

	if (!device)
		return done(result, DB_RESULT_FAILED);
	switch ((enum poll_phase)job->step) {
	case POLL_STANDING:
		first->poll_standing = reply->value == 1;
		first->poll_told = device->told;
		first->poll_placed = device->placed;
		return poll_ask(first, job, POLL_SIGN, exchange, result);
	case POLL_SIGN:
		first->poll_negative = reply->value == 1;
		return poll_ask(first, job, POLL_MAGNITUDE, exchange, result);
	case POLL_MAGNITUDE:
		first->poll_magnitude = reply->value;
		first->poll_taken = now;
		if (!is_settled(first, device))
			return poll_ask(first, job, POLL_SIGN_AGAIN, exchange, result);
		take_position(device, first);
		return poll_next_axis(first, job, now, exchange, result);
	case POLL_SIGN_AGAIN:
		if (first->poll_negative == (reply->value == 1)) {
			take_position(device, first);
		} else if (++first->sign_tries < SIGN_TRIES) {
			first->poll_negative = reply->value == 1;
			return poll_ask(first, job, POLL_MAGNITUDE, exchange, result);
		}
		return poll_next_axis(first, job, now, exchange, result);
	case POLL_PORTS:
		first->ports = reply->value;
		return poll_ask(first, job, POLL_PROGRAM, exchange, result);
	case POLL_PROGRAM:
	default:
		take_program(first, reply);
		return done(result, DB_RESULT_OK);
	}
}

/* An axis that the controller does not have is not shown; the others are. */
static enum db_step poll_refused(struct db_device *first, struct db_job *job, db_time now,
                                 struct db_exchange *exchange, enum db_result *result)
{
	if (job->step == POLL_PROGRAM)
		return done(result, DB_RESULT_OK);
	if (job->step == POLL_PORTS)
		return poll_ask(first, job, POLL_PROGRAM, exchange, result);
	return poll_next_axis(first, job, now, exchange, result);
}

/* --- what is believed of it ------------------------------------------------------------------------ */

#define SECRET_PARAMS (UINT64_C(1) << XYZA_READ_PASSWORD | UINT64_C(1) << XYZA_PASSWORD)

static void learn_one(struct db_device *device, enum xyza_param param, union db_value value)
{
	uint64_t bit = UINT64_C(1) << param;

	/* Whoever may only read is not to read passwords. */
	if (SECRET_PARAMS & bit)
		value.u = 0;
	if ((device->plate.valid & bit) && device->plate.values[param].u == value.u)
		return;
	device->plate.values[param] = value;
	device->plate.valid |= bit;
	device->plate.generation++;
}

static void learn(struct db_device *device, enum xyza_param param, union db_value value)
{
	struct db_device *const *axes = device->first->axes;

	if (xyza_item_of_axis(xyza_param_item(param))) {
		learn_one(device, param, value);
		return;
	}
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (axes[i])
			learn_one(axes[i], param, value);
	}
}

/* --- ramps ------------------------------------------------------------------------------------------- */

#define RAMP_PARAMS                                                      \
	(UINT64_C(1) << XYZA_MIN_SPEED | UINT64_C(1) << XYZA_MAX_SPEED | \
	 UINT64_C(1) << XYZA_ACCELERATION_TIME)

static void show_ramp(struct db_nameplate *plate, enum xyza_param param, uint64_t needed,
                      union db_value ramp)
{
	uint64_t bit = UINT64_C(1) << param;
	bool known = (plate->valid & needed) == needed;

	plate->missing = plate->missing & needed ? plate->missing | bit : plate->missing & ~bit;
	if (known == ((plate->valid & bit) != 0) && (!known || plate->values[param].u == ramp.u))
		return;
	plate->valid ^= known == ((plate->valid & bit) != 0) ? 0 : bit;
	plate->values[param] = ramp;
	plate->generation++;
}

/* What follows from what is known of an axis. */
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

static void show_all_ramps(struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i])
			show_ramps(first->axes[i]);
	}
}

/* The bits of an item's parameters in a nameplate. */
static uint64_t params_of(enum xyza_item item)
{
	uint64_t bits = 0;

	for (unsigned i = 0; i < XYZA_PARAM_COUNT; i++) {
		if (xyza_param_item((enum xyza_param)i) == item)
			bits |= UINT64_C(1) << i;
	}
	return bits;
}

/* What an item was read as. */
static void learn_item(struct db_device *device, enum xyza_item item, uint32_t content)
{
	device->unread &= ~(1u << item);
	device->plate.missing &= ~params_of(item);
	for (unsigned i = 0; i < XYZA_PARAM_COUNT; i++) {
		enum xyza_param param = (enum xyza_param)i;

		if (xyza_param_item(param) == item && (xyza_param_access(param) & XYZA_CAN_READ))
			learn(device, param, xyza_param_get(param, content));
	}
	show_all_ramps(device->first);
}

/* A controller may not have it. */
static void forget_item(struct db_device *device, enum xyza_item item)
{
	device->unread |= 1u << item;
	device->plate.valid &= ~params_of(item);
	device->plate.missing |= params_of(item);
	show_ramps(device);
}

/* After a reset nothing that is known of any axis counts. */
static void forget_all(struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i])
			first->axes[i]->plate.doubtful = true;
	}
}

/* It was told to move: until it was seen to, it counts as moving. */
static void note_started(struct db_device *device, bool negative)
{
	device->told++;
	device->jogging = true;
	device->jog_negative = negative;
	device->fresh = true;
	device->standing = false;
	device->stopping = false;
}

/* It stands, whatever it was told before. */
static void note_standing(struct db_device *device)
{
	device->told++;
	device->standing = true;
	device->jogging = device->fresh = device->stopping = false;
	device->expected_by = 0;
	device->velocity = 0.0f;
}

/* Any axis may have been set in motion so lately by the program that it still says that it stands. */
static void doubt_standing(struct db_device *first, db_time now)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		struct db_device *device = first->axes[i];

		if (!device)
			continue;
		device->told++;
		device->fresh = true;
		device->expected_by = now + device->reaction;
	}
}

static void note_stopped(struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		struct db_device *device = first->axes[i];

		if (!device)
			continue;
		device->held_until = 0;
		/* A program may have set it in motion since. */
		if (device->standing && first->program_state != XYZA_PROGRAM_RUNNING)
			continue;
		device->told++;
		device->stopping = device->fresh = true;
	}
}

/* --- commands, step by step ------------------------------------------------------------------------- */

/* scratch[0]: of a parameter write, which of its parameters. scratch[1]: of a jog the stops that there
 * had been when it began; of a stop STOP_TAKEN. */

static struct xyza_plan *plan_of(struct db_device *device, const struct db_job *job)
{
	return job->kind == DB_JOB_COMMAND && db_command_is_stop(job->request->command) ?
	               &device->stop :
	               &device->front;
}

static struct xyza_step *step_of(struct db_device *device, const struct db_job *job)
{
	return &plan_of(device, job)->steps[job->step];
}

/* After its answer was lost, saying it again can do no harm. A second stop may end a program that
 * the first one has paused, which is no harm when it was to stop anyway. */
static bool is_repeatable(const struct db_job *job, enum xyza_verb verb)
{
	switch (verb) {
	case XYZA_MANUAL_JOG:
	case XYZA_PROGRAM_START:
	case XYZA_PROGRAM_CONTINUE:
	case XYZA_PROGRAM_END:
		return false;
	case XYZA_PROGRAM_STOP:
		return job->kind != DB_JOB_COMMAND || job->request->command != DB_CMD_PAUSE_PROGRAM;
	default:
		return true;
	}
}

static enum db_step send_step(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_request *request = &plan->steps[job->step].request;

	if (!xyza_is_read(request->verb))
		plan->acted = true;
	return ask(device, *request, is_repeatable(job, request->verb), exchange, result);
}

/* What it is to show it does not show yet. */
static enum db_step ask_again(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	exchange->again = true;
	return send_step(device, job, exchange, result);
}

static enum db_step refuse(struct db_device *device, const struct db_job *job,
                           enum db_result *result)
{
	device->refused = true;
	if (job->kind == DB_JOB_SETTINGS)
		device->plate.doubtful = true;
	return done(result, DB_RESULT_REFUSED);
}

static void note_carried_out(struct db_device *device, const struct db_job *job)
{
	const struct db_request *request = job->request;

	switch (request->command) {
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		note_stopped(device->first);
		break;
	case DB_CMD_SET_POSITION:
		device->position = request->args.target_position;
		device->negative = device->position < 0;
		device->held_until = 0;
		break;
	case DB_CMD_START_PROGRAM:
		device->first->delayed = request->args.program_delay > 0;
		break;
	default:
		break;
	}
}

/* The whole plan was gone through; of several parameters the next one's follows. */
static enum db_step end_plan(struct db_device *device, struct db_job *job,
                             struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	size_t next = (size_t)job->scratch[0] + 1;

	device->refused = false;
	if (job->kind == DB_JOB_COMMAND) {
		note_carried_out(device, job);
	} else if (next < job->request->setting_count) {
		job->scratch[0] = (int64_t)next;
		job->step = 0;
		xyza_plan_setting(plan, device, &job->request->settings[next]);
		return send_step(device, job, exchange, result);
	}
	return done(result, plan->unproven ? DB_RESULT_UNPROVEN : DB_RESULT_OK);
}

static enum db_step next_step(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);

	job->step++;
	plan->entered = 0;
	if (job->step == plan->count)
		return end_plan(device, job, exchange, result);
	return send_step(device, job, exchange, result);
}

static enum db_step go_back(struct db_device *device, struct db_job *job, unsigned steps,
                            struct db_exchange *exchange, enum db_result *result)
{
	plan_of(device, job)->entered = 0;
	job->step -= steps;
	return send_step(device, job, exchange, result);
}

/* Whether what was told may still come to show. */
static bool may_still_show(struct db_device *device, const struct db_job *job, db_time now)
{
	struct xyza_plan *plan = plan_of(device, job);

	if (plan->entered == 0)
		plan->entered = now;
	return now - plan->entered < device->reaction;
}

/* --- what its answers show --------------------------------------------------------------------------- */

static enum db_step changed_answered(struct db_device *device, struct db_job *job,
                                     const struct xyza_reply *reply, struct db_exchange *exchange,
                                     enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	struct xyza_step *step = step_of(device, job);
	uint32_t before = xyza_param_get(step->param, reply->value).u;
	union db_value value = { .u = (before & ~step->mask) | (step->value & step->mask) };

	learn_item(device, step->request.item, reply->value);
	if (value.u == before) {
		job->step += 2;
		return next_step(device, job, exchange, result);
	}
	/* That it has another speed from now on cannot be told from its moving. */
	if (plan->runs_on)
		plan->unproven = true;
	step[1].request.value = xyza_param_put(step->param, value, reply->value);
	return next_step(device, job, exchange, result);
}

/* When all was read from which the time of a ramp follows, it is what is to be changed. */
static enum db_step learned_answered(struct db_device *device, struct db_job *job,
                                     const struct xyza_reply *reply, struct db_exchange *exchange,
                                     enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	struct xyza_step *step = step_of(device, job);
	const union db_value *values = device->plate.values;
	uint32_t time;

	learn_item(device, step->request.item, reply->value);
	if (step->request.item == XYZA_ITEM_BRAKE && !(values[XYZA_BRAKE].u >> device->axis & 1))
		return refuse(device, job, result);
	if (step[1].kind == STEP_LEARN)
		return next_step(device, job, exchange, result);
	time = xyza_ramp_time(values[XYZA_MIN_SPEED].u, values[XYZA_MAX_SPEED].u, plan->ramp);
	if (time == 0)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	for (unsigned i = job->step + 1; i < plan->count; i++) {
		plan->steps[i].value = time;
		plan->steps[i].request.value = time;
	}
	return next_step(device, job, exchange, result);
}

static enum db_step param_answered(struct db_device *device, struct db_job *job,
                                   const struct xyza_reply *reply, db_time now,
                                   struct db_exchange *exchange, enum db_result *result)
{
	const struct xyza_step *step = step_of(device, job);
	uint32_t value = xyza_param_get(step->param, reply->value).u;
	bool enabled = step->param == XYZA_ENABLE;

	if (((value ^ step->value) & step->mask) == 0) {
		learn_item(device, step->request.item, reply->value);
		return next_step(device, job, exchange, result);
	}
	if (may_still_show(device, job, now))
		return ask_again(device, job, exchange, result);
	/* What it has made of it instead is what counts. */
	learn_item(device, step->request.item, reply->value);
	if (job->kind == DB_JOB_COMMAND && enabled)
		return done(result, DB_RESULT_FAILED);
	device->refused = true;
	return done(result, DB_RESULT_REFUSED);
}

static enum db_step expected_answered(struct db_device *device, struct db_job *job,
                                      const struct xyza_reply *reply, db_time now,
                                      struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_step *step = step_of(device, job);

	if (((xyza_content(reply) ^ step->wanted) & step->mask) == 0) {
		/* Where it is was just read: that is as good as a cycle. */
		if (step->request.verb == XYZA_READ_MAGNITUDE)
			device->taken = now;
		return next_step(device, job, exchange, result);
	}
	/* Whatever it has become of the position, that is where the controller sees it. */
	device->held_until = 0;
	if (may_still_show(device, job, now))
		return ask_again(device, job, exchange, result);
	if (step->back == 0 || plan->mends == MENDS_MAX)
		return done(result, DB_RESULT_FAILED);
	plan->mends++;
	return go_back(device, job, step->back, exchange, result);
}

/* A jog that shows nothing. It is ended, so that it does not begin when nobody expects it any more. */
static enum db_step give_up_jog(struct db_device *device, struct db_job *job,
                                struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);

	note_standing(device);
	if (plan->refused)
		return refuse(device, job, result);
	plan->retreating = true;
	job->step = plan->count;
	return send_step(device, job, exchange, result);
}

/* Two cycles since it was told have found it at two places. */
static bool was_seen_elsewhere(const struct db_device *device, struct xyza_plan *plan)
{
	if (plan->entered == 0 || device->taken <= plan->entered)
		return false;
	if (!plan->from_known) {
		plan->from_known = true;
		plan->from = device->position;
	}
	return device->position != plan->from;
}

static enum db_step jog_answered(struct db_device *device, struct db_job *job,
                                 const struct xyza_reply *reply, db_time now,
                                 struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	bool moved = reply->value == 0 || was_seen_elsewhere(device, plan);

	if (moved) {
		/* What a cycle has seen of it before says nothing any more. */
		device->told++;
		/* It moved before, too: whether it has heard this nobody knows. */
		if (plan->lost && plan->runs_on)
			plan->unproven = true;
		device->fresh = false;
		/* Where only its place shows that it moves, what it says of standing is still to come. */
		if (reply->value == 0)
			device->expected_by = 0;
		return next_step(device, job, exchange, result);
	}
	/* It may stand because it was stopped: the operator of another axis stops all of them. */
	if ((plan->lost || plan->refused) && job->scratch[1] != (int64_t)device->first->stops)
		return done(result, DB_RESULT_CANCELLED);
	if (!plan->refused && may_still_show(device, job, now)) {
		device->expected_by = plan->entered + device->reaction;
		return ask_again(device, job, exchange, result);
	}
	if ((plan->lost && device->resends < RESENDS_MAX) ||
	    (plan->refused && device->resends < REFUSALS_MAX)) {
		device->resends++;
		plan->lost = plan->refused = false;
		return go_back(device, job, 1, exchange, result);
	}
	return give_up_jog(device, job, exchange, result);
}

static bool has_ended(uint32_t content)
{
	return (content & UINT8_MAX) == XYZA_PROGRAM_IDLE;
}

static bool has_stopped(uint32_t content)
{
	return (content & UINT8_MAX) >= XYZA_PROGRAM_WAITING;
}

/* Whether the program's state is what this command makes of the state before, and nothing else. */
static bool shows_effect(const struct xyza_plan *plan, const struct db_request *request,
                         uint32_t content)
{
	switch (request->command) {
	case DB_CMD_START_PROGRAM:
		return !has_ended(content) && content != plan->before &&
		       (content >> 8 & UINT8_MAX) == request->args.program_number;
	case DB_CMD_PAUSE_PROGRAM:
		return has_stopped(content) || (has_ended(content) && has_ended(plan->before));
	case DB_CMD_CONTINUE_PROGRAM:
		return content != plan->before;
	default:
		return has_ended(content);
	}
}

static enum db_step program_answered(struct db_device *device, struct db_job *job,
                                     const struct xyza_reply *reply, db_time now,
                                     struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	uint32_t content = xyza_content(reply);

	take_program(device->first, reply);
	if (plan->before_read && shows_effect(plan, job->request, content)) {
		/* What was so before is no proof. */
		plan->unproven = content == plan->before;
		if (!(plan->lost && plan->unproven))
			return next_step(device, job, exchange, result);
	} else if (!plan->refused && !plan->unproven && may_still_show(device, job, now)) {
		return ask_again(device, job, exchange, result);
	}
	if (plan->refused && device->resends < REFUSALS_MAX) {
		device->resends++;
		plan->refused = false;
		return go_back(device, job, 1, exchange, result);
	}
	if (plan->refused)
		return refuse(device, job, result);
	/* A program may also have come to its end between two looks. */
	if (plan->lost ||
	    (plan->before_read && !plan->unproven && job->request->command == DB_CMD_START_PROGRAM))
		return done(result, DB_RESULT_INDETERMINATE);
	if (plan->unproven || !plan->before_read) {
		plan->unproven = true;
		return next_step(device, job, exchange, result);
	}
	return done(result, DB_RESULT_FAILED);
}

/* The program's state right before a command to it decides whether that makes sense. */
static enum db_step before_answered(struct db_device *device, struct db_job *job,
                                    const struct xyza_reply *reply, struct db_exchange *exchange,
                                    enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	enum db_command command = job->request->command;
	bool runs = reply->state == XYZA_PROGRAM_RUNNING;

	take_program(device->first, reply);
	plan->before = xyza_content(reply);
	plan->before_read = true;
	if ((command == DB_CMD_START_PROGRAM && runs) ||
	    (command == DB_CMD_CONTINUE_PROGRAM && !has_stopped(plan->before)))
		return refuse(device, job, result);
	/* A second stop might end what waits. Without an interruption there is nothing to clear. */
	if ((command == DB_CMD_PAUSE_PROGRAM && has_stopped(plan->before)) ||
	    (command == DB_CMD_CLEAR_FAULT && reply->state != XYZA_PROGRAM_INTERRUPTED)) {
		device->refused = false;
		return done(result, DB_RESULT_OK);
	}
	return next_step(device, job, exchange, result);
}

/* However long the brakes take, it is no failure as long as the axis slows down. One that says that it stands
 * may not say yet that it moved. */
static enum db_step standing_answered(struct db_device *device, struct db_job *job,
                                      const struct xyza_reply *reply, db_time now,
                                      struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	float speed = fabsf(device->velocity);

	if (reply->value == 1) {
		if (plan->asked < device->expected_by)
			return ask_again(device, job, exchange, result);
		note_standing(device);
		return next_step(device, job, exchange, result);
	}
	device->expected_by = 0;
	if (plan->entered == 0) {
		plan->entered = plan->progress = now;
		plan->least_speed = INFINITY;
	}
	/* How fast it was before it was stopped says nothing of its slowing down. */
	if (device->taken > plan->entered && speed < plan->least_speed) {
		plan->progress = now;
		plan->least_speed = speed;
	}
	if (now - plan->progress <= STOP_TIME)
		return ask_again(device, job, exchange, result);
	return done(result, DB_RESULT_FAILED);
}

static enum db_step guard_answered(struct db_device *device, struct db_job *job,
                                   const struct xyza_reply *reply, struct db_exchange *exchange,
                                   enum db_result *result)
{
	const struct xyza_step *step = step_of(device, job);
	struct db_device *other = device->first->axes[step->request.axis];

	if (reply->kind == XYZA_REPLY_PROGRAM_STATE)
		take_program(device->first, reply);
	if (((xyza_content(reply) ^ step->wanted) & step->mask) == 0)
		return refuse(device, job, result);
	if (step->request.verb == XYZA_READ_STANDING && other) {
		if (plan_of(device, job)->asked < other->expected_by)
			return ask_again(device, job, exchange, result);
		note_standing(other);
	}
	return next_step(device, job, exchange, result);
}

/* One that was told to move may only not show it yet. */
static enum db_step condition_answered(struct db_device *device, struct db_job *job,
                                       const struct xyza_reply *reply, struct db_exchange *exchange,
                                       enum db_result *result)
{
	const struct xyza_step *step = step_of(device, job);
	bool wanted = ((xyza_content(reply) ^ step->wanted) & step->mask) == 0;

	if (reply->kind == XYZA_REPLY_PROGRAM_STATE)
		take_program(device->first, reply);
	else
		wanted = wanted || plan_of(device, job)->asked < device->expected_by;
	if (!wanted)
		job->step++;
	return next_step(device, job, exchange, result);
}

/* --- answers ------------------------------------------------------------------------------------------ */

/* What can be read back follows: that decides what a refusal or a lost answer means. */
static bool is_proven_next(const struct xyza_plan *plan, unsigned step)
{
	return !plan->retreating && step + 1 < plan->count &&
	       (plan->steps[step + 1].kind == STEP_EXPECT_MOVING ||
	        plan->steps[step + 1].kind == STEP_EXPECT_PROGRAM);
}

/* What could not be read cannot be shown: the command stays as the controller has taken it. */
static enum db_step read_refused(struct db_device *device, struct db_job *job,
                                 struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_step *step = step_of(device, job);

	switch (step->kind) {
	case STEP_CHANGE:
		if (step->param == XYZA_ENABLE || step->request.item == XYZA_ITEM_KEYS)
			return refuse(device, job, result);
		return next_step(device, job, exchange, result);
	case STEP_LEARN:
		return refuse(device, job, result);
	case STEP_UNTIL_STANDING:
		return done(result, DB_RESULT_FAILED);
	case STEP_GUARD:
	case STEP_BEFORE:
	case STEP_IF:
		return next_step(device, job, exchange, result);
	default:
		if (plan->refused)
			return refuse(device, job, result);
		if (plan->lost)
			return done(result, DB_RESULT_INDETERMINATE);
		plan->unproven = true;
		return next_step(device, job, exchange, result);
	}
}

static enum db_step step_refused(struct db_device *device, struct db_job *job,
                                 struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_step *step = step_of(device, job);

	if (xyza_is_read(step->request.verb))
		return read_refused(device, job, exchange, result);
	if (step->kind == STEP_MAY_FAIL ||
	    (step->kind == STEP_OR_BEFORE && job->scratch[1] == STOP_TAKEN))
		return next_step(device, job, exchange, result);
	if (is_proven_next(plan, job->step) && !plan->runs_on) {
		plan->refused = true;
		return next_step(device, job, exchange, result);
	}
	if (step->request.verb == XYZA_WRITE_MAGNITUDE || step->request.verb == XYZA_WRITE_SIGN)
		device->held_until = 0;
	return refuse(device, job, result);
}

static enum db_step act_answered(struct db_device *device, struct db_job *job, db_time now,
                                 struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_step *step = step_of(device, job);

	switch (step->request.verb) {
	case XYZA_MANUAL_JOG:
		note_started(device, step->request.negative);
		device->expected_by = now + device->reaction;
		break;
	case XYZA_WRITE_MAGNITUDE:
	case XYZA_WRITE_SIGN:
	case XYZA_MANUAL_CLEAR:
		device->placed++;
		device->held_until = now + HOLD_TIME;
		break;
	case XYZA_PROGRAM_STOP:
	case XYZA_PROGRAM_QUICK_STOP:
		device->first->paused = device->first->program_state == XYZA_PROGRAM_RUNNING;
		if (device->first->paused)
			doubt_standing(device->first, now);
		break;
	case XYZA_PROGRAM_END:
		if (device->first->program_state == XYZA_PROGRAM_RUNNING)
			doubt_standing(device->first, now);
		break;
	case XYZA_WRITE_ITEM:
		if (step->request.item == XYZA_ITEM_FACTORY_RESET)
			forget_all(device->first);
		break;
	default:
		break;
	}
	if (plan == &device->stop)
		job->scratch[1] = STOP_TAKEN;
	if (job->kind == DB_JOB_COMMAND && job->request->command == DB_CMD_DISABLE &&
	    xyza_is_stop(step->request.verb)) {
		device->first->stops++;
		note_stopped(device->first);
	}
	return next_step(device, job, exchange, result);
}

static enum db_step step_answered(struct db_device *device, struct db_job *job,
                                  const struct xyza_reply *reply, db_time now,
                                  struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_step *step = step_of(device, job);

	plan->asked = plan->answered;
	plan->answered = now;
	if (plan->retreating)
		return done(result, plan->lost ? DB_RESULT_TIMEOUT : DB_RESULT_FAILED);
	if (reply->kind == XYZA_REPLY_FAILED)
		return step_refused(device, job, exchange, result);
	switch (step->kind) {
	case STEP_IF:
		return condition_answered(device, job, reply, exchange, result);
	case STEP_GUARD:
		return guard_answered(device, job, reply, exchange, result);
	case STEP_BEFORE:
		return before_answered(device, job, reply, exchange, result);
	case STEP_LEARN:
		return learned_answered(device, job, reply, exchange, result);
	case STEP_CHANGE:
		return changed_answered(device, job, reply, exchange, result);
	case STEP_UNTIL_STANDING:
		return standing_answered(device, job, reply, now, exchange, result);
	case STEP_EXPECT:
		if (step->request.verb == XYZA_READ_PORTS)
			device->first->ports = reply->value;
		return expected_answered(device, job, reply, now, exchange, result);
	case STEP_EXPECT_PARAM:
		return param_answered(device, job, reply, now, exchange, result);
	case STEP_EXPECT_MOVING:
		return jog_answered(device, job, reply, now, exchange, result);
	case STEP_EXPECT_PROGRAM:
		return program_answered(device, job, reply, now, exchange, result);
	default:
		return act_answered(device, job, now, exchange, result);
	}
}

/* The answer to one of its exchanges was lost, and to all repeats of it. */
static enum db_step step_lost(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_step *step = step_of(device, job);

	device->held_until = 0;
	if (plan->retreating)
		return done(result, DB_RESULT_INDETERMINATE);
	if (is_proven_next(plan, job->step)) {
		plan->lost = true;
		/* Who cannot know counts it as moving. */
		if (step->request.verb == XYZA_MANUAL_JOG)
			note_started(device, step->request.negative);
		return next_step(device, job, exchange, result);
	}
	/* Reads tell nothing of what was done before them; writes can be said again. */
	return done(result, xyza_is_read(step->request.verb) && plan->acted ?
	                            DB_RESULT_INDETERMINATE :
	                            DB_RESULT_TIMEOUT);
}

/* --- parameters -------------------------------------------------------------------------------------- */

/* The next item that can be read, from `item` on, or XYZA_ITEM_COUNT. */
static unsigned next_item(unsigned item)
{
	while (item == XYZA_ITEM_FACTORY_RESET || item == XYZA_ITEM_SLAVE_NUMBER)
		item++;
	return item;
}

static enum db_step ask_item(struct db_device *device, struct db_job *job, unsigned item,
                             struct db_exchange *exchange, enum db_result *result)
{
	item = next_item(item);
	job->step = item;
	job->scratch[0] = 0;
	if (item < XYZA_ITEM_COUNT)
		return ask(device,
		           (struct xyza_request){ .verb = XYZA_READ_ITEM,
		                                  .axis = device->axis,
		                                  .item = (enum xyza_item)item },
		           true, exchange, result);
	device->plate.doubtful = false;
	device->params_valid = true;
	device->plate.generation++;
	return done(result, DB_RESULT_OK);
}

static enum db_step identify_answered(struct db_device *device, struct db_job *job,
                                      const struct xyza_reply *reply, struct db_exchange *exchange,
                                      enum db_result *result)
{
	enum xyza_item item = (enum xyza_item)job->step;

	if (reply->kind == XYZA_REPLY_DATA)
		learn_item(device, item, reply->value);
	else
		forget_item(device, item);
	return ask_item(device, job, job->step + 1, exchange, result);
}

/* The controller is there, it only keeps silent about this: the others are as good without it. A single
 * loss may be the line's; scratch[0] counts them. */
static enum db_step item_lost(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	int64_t losses = job->scratch[0] + 1;
	enum db_step step;

	if (losses >= ITEM_TRIES) {
		forget_item(device, (enum xyza_item)job->step);
		return ask_item(device, job, job->step + 1, exchange, result);
	}
	step = ask_item(device, job, job->step, exchange, result);
	job->scratch[0] = losses;
	return step;
}

/* --- raw frames -------------------------------------------------------------------------------------- */

static int write_raw(const struct db_args *args, uint8_t object, uint8_t *frame, size_t size)
{
	uint8_t content[2 * DB_RAW_REQUEST_WORDS];

	if (args->raw_length > sizeof content)
		return XYZA_ERR_FORM;
	for (size_t i = 0; i < sizeof content; i++)
		content[i] = (uint8_t)(args->raw_request[i / 2] >> (i % 2 == 0 ? 8 : 0));
	return xyza_encode_raw(content, args->raw_length, object, frame, size);
}

static void show_raw(struct db_device *device, const uint8_t *frame, size_t length)
{
	struct db_nameplate *plate = &device->plate;

	memset(plate->raw_answer, 0, sizeof plate->raw_answer);
	for (size_t i = 0; i < length; i++)
		plate->raw_answer[i / 2] |= (uint16_t)(frame[i] << (i % 2 == 0 ? 8 : 0));
	plate->raw_length = (uint16_t)length;
	plate->generation++;
}

/* What it does nobody knows, so it is said once. */
static enum db_step begin_raw(struct db_device *device, const struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	int length = write_raw(&job->request->args, device->object, exchange->request,
	                       exchange->request_size);

	show_raw(device, NULL, 0);
	if (length < 0)
		return done(result, DB_RESULT_OUT_OF_RANGE);
	exchange->request_length = (size_t)length;
	exchange->answer_length = XYZA_FRAME_MAX;
	exchange->extra_time = 0;
	exchange->repeatable = false;
	return DB_STEP_SEND;
}

/* It may have changed anything. An acknowledgement shows nothing of that. */
static enum db_step raw_answered(struct db_device *device, const uint8_t *frame, size_t length,
                                 const struct db_exchange *exchange, enum db_result *result)
{
	struct xyza_request said;
	bool failed;
	bool shows;

	if (!xyza_raw_fits(exchange->request, frame, length, &failed, &shows))
		return DB_STEP_IGNORE;
	show_raw(device, frame, length);
	if (xyza_decode_request(exchange->request, exchange->request_length, &said) != XYZA_OK ||
	    !xyza_is_read(said.verb))
		forget_all(device->first);
	device->refused = failed;
	return done(result, failed ? DB_RESULT_REFUSED : shows ? DB_RESULT_OK : DB_RESULT_UNPROVEN);
}

static bool is_raw(const struct db_job *job)
{
	return job->kind == DB_JOB_COMMAND && job->request->command == DB_CMD_RAW_FRAME;
}

/* --- jobs -------------------------------------------------------------------------------------------- */

static enum db_step begin_command(struct db_device *device, struct db_job *job,
                                  struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;
	struct xyza_plan *plan = plan_of(device, job);

	if (command == DB_CMD_READ_PARAMETERS)
		return ask_item(device, job, 0, exchange, result);
	if (command == DB_CMD_RAW_FRAME)
		return begin_raw(device, job, exchange, result);
	if (command == DB_CMD_STOP || command == DB_CMD_QUICK_STOP)
		device->first->stops++;
	else if (!db_command_is_stop(command))
		device->resends = 0;
	job->scratch[1] = (int64_t)device->first->stops;
	if (plan == &device->stop)
		job->scratch[1] = device->first->paused || device->first->program_state >
		                                                   XYZA_PROGRAM_RUNNING ?
		                          STOP_TAKEN :
		                          0;
	xyza_plan_command(plan, device, job->request);
	plan->answered = job->started;
	return send_step(device, job, exchange, result);
}

static enum db_step begin_settings(struct db_device *device, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	device->front.unproven = false;
	xyza_plan_setting(&device->front, device, &job->request->settings[0]);
	return send_step(device, job, exchange, result);
}

static enum db_step xyza_begin(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	job->step = 0;
	device->refusals[job->kind] = 0;
	switch (job->kind) {
	case DB_JOB_PROBE:
		return ask_verb(device, XYZA_VERB_ONLINE, exchange, result);
	case DB_JOB_IDENTIFY:
		return ask_item(device, job, 0, exchange, result);
	case DB_JOB_POLL:
		return poll_begin(device, job, exchange, result);
	case DB_JOB_SETTINGS:
		return begin_settings(device, job, exchange, result);
	case DB_JOB_COMMAND:
	default:
		return begin_command(device, job, exchange, result);
	}
}

static bool has_plan(const struct db_job *job)
{
	return job->kind == DB_JOB_SETTINGS || (job->kind == DB_JOB_COMMAND && !is_raw(job) &&
	                                        job->request->command != DB_CMD_READ_PARAMETERS);
}

/* A refusal that is no failure, or one that is looked into first. */
static bool is_refusal_final(struct db_device *device, const struct db_job *job)
{
	const struct xyza_plan *plan = plan_of(device, job);
	const struct xyza_step *step = &plan->steps[job->step];

	if (plan->retreating)
		return true;
	if (step->kind == STEP_MAY_FAIL || step->kind == STEP_OR_BEFORE)
		return plan == &device->front || job->scratch[1] == STOP_TAKEN;
	return is_proven_next(plan, job->step) && !plan->runs_on;
}

/* A refused request was not carried out, so saying it again is harmless whatever it is. */
static bool is_asked_again(struct db_device *device, const struct db_job *job,
                           const struct xyza_reply *reply)
{
	unsigned *refusals = &device->refusals[job->kind];

	if (reply->kind == XYZA_REPLY_FAILED && *refusals < REFUSALS_MAX &&
	    !(has_plan(job) && is_refusal_final(device, job))) {
		(*refusals)++;
		return true;
	}
	*refusals = 0;
	return false;
}

static enum db_step xyza_answer(struct db_conversation *talk, const uint8_t *frame, size_t length)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	db_time now = talk->now;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;
	struct xyza_request request;
	struct xyza_reply reply;

	if (is_raw(job))
		return raw_answered(device, frame, length, exchange, result);
	if (xyza_decode_reply(frame, length, &reply) != XYZA_OK ||
	    xyza_decode_request(exchange->request, exchange->request_length, &request) != XYZA_OK ||
	    !xyza_fits(&request, &reply))
		return DB_STEP_IGNORE;
	if (is_asked_again(device, job, &reply))
		return DB_STEP_SEND; /* the exchange is as it was */
	if (has_plan(job))
		return step_answered(device, job, &reply, now, exchange, result);
	switch (job->kind) {
	case DB_JOB_PROBE:
		return done(result, DB_RESULT_OK);
	case DB_JOB_POLL:
		if (reply.kind == XYZA_REPLY_FAILED)
			return poll_refused(device, job, now, exchange, result);
		return poll_answer(device, job, &reply, now, exchange, result);
	case DB_JOB_IDENTIFY:
	default:
		return identify_answered(device, job, &reply, exchange, result);
	}
}

static enum db_step xyza_lost(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct db_job *job = talk->job;
	struct db_exchange *exchange = talk->exchange;
	enum db_result *result = &talk->result;

	if (job->kind == DB_JOB_SETTINGS)
		device->plate.doubtful = true;
	if (is_raw(job)) {
		forget_all(device->first);
		return done(result, DB_RESULT_INDETERMINATE);
	}
	if (has_plan(job))
		return step_lost(device, job, exchange, result);
	if (job->kind == DB_JOB_IDENTIFY || job->kind == DB_JOB_COMMAND)
		return item_lost(device, job, exchange, result);
	return done(result, DB_RESULT_TIMEOUT);
}

/* --- state ------------------------------------------------------------------------------------------- */

static bool is_enabled(const struct db_device *device)
{
	const struct db_nameplate *plate = &device->plate;

	return (plate->valid >> XYZA_ENABLE & 1) &&
	       (plate->values[XYZA_ENABLE].u >> device->axis & 1);
}

static enum db_axis_state state_of(const struct db_device *device)
{
	if (!device->heard)
		return DB_AXIS_OFFLINE;
	if (device->first->program_state == XYZA_PROGRAM_INTERRUPTED && device->standing)
		return DB_AXIS_ERROR_STOP;
	if (device->stopping)
		return DB_AXIS_STOPPING;
	if (!device->standing || device->fresh)
		return DB_AXIS_CONTINUOUS_MOTION;
	return is_enabled(device) ? DB_AXIS_STANDSTILL : DB_AXIS_DISABLED;
}

static uint32_t status_of(const struct db_device *device, enum db_axis_state state)
{
	uint32_t status = 0;

	if (is_enabled(device))
		status |= DB_STATUS_ENABLED;
	if (!device->standing || device->fresh)
		status |= DB_STATUS_MOVING;
	if (state == DB_AXIS_STOPPING)
		status |= DB_STATUS_STOPPING;
	if (state == DB_AXIS_ERROR_STOP)
		status |= DB_STATUS_ERROR;
	if (device->params_valid)
		status |= DB_STATUS_PARAMS_VALID;
	if (device->refused)
		status |= DB_STATUS_REFUSED;
	return status;
}

/* Pulses for a millimetre of the axis, from what the controller knows of motor and spindle; 0. */
static float counts_per_unit(const struct db_nameplate *plate)
{
	uint64_t needed = UINT64_C(1) << XYZA_STEP_ANGLE | UINT64_C(1) << XYZA_MICROSTEP |
	                  UINT64_C(1) << XYZA_LEAD;
	double lead = (double)plate->values[XYZA_LEAD].u / 1000.0;

	if ((plate->valid & needed) != needed || !(lead > 0.0))
		return 0.0f;
	return (float)((double)plate->values[XYZA_STEP_ANGLE].u *
	               (double)plate->values[XYZA_MICROSTEP].u / lead);
}

/* How fast it slows down, Hz/s: INFINITY when it stands at once, 0 when that is not known. */
static float deceleration(const struct db_device *device)
{
	const struct db_nameplate *plate = &device->plate;

	if (!(plate->valid >> XYZA_RAMP_DECELERATION & 1))
		return 0.0f;
	if (!(plate->values[XYZA_BRAKE].u >> device->axis & 1) ||
	    plate->values[XYZA_ACCELERATION_TIME].u == 0)
		return INFINITY;
	return plate->values[XYZA_RAMP_DECELERATION].f;
}

static void xyza_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	const struct db_device *first = device->first;
	enum db_axis_state state = state_of(device);

	feedback->taken = device->taken;
	feedback->position = device->position;
	feedback->velocity = device->velocity;
	feedback->drive_status = (uint32_t)device->negative << STATUS_NEGATIVE |
	                         (uint32_t)device->standing << STATUS_STANDS |
	                         (uint32_t)first->program_state << STATUS_PROGRAM;
	feedback->inputs = xyza_inputs(first->ports);
	feedback->outputs = xyza_outputs(first->ports);
	/* The controller goes on to name the last one that ran. */
	feedback->program = first->program_state == XYZA_PROGRAM_IDLE ? 0 : first->program;
	feedback->program_state = first->program_state;
	feedback->program_step = first->program_step;
	feedback->counts_per_unit = counts_per_unit(&device->plate);
	feedback->deceleration = deceleration(device);
	feedback->error = state == DB_AXIS_ERROR_STOP ? DB_ERROR_INTERRUPTED : DB_ERROR_NONE;
	feedback->state = (uint16_t)state;
	feedback->status = status_of(device, state);
}

static void xyza_gone(struct db_device *device)
{
	device->heard = false;
	device->params_valid = false;
	device->jogging = device->fresh = device->stopping = false;
	device->expected_by = device->held_until = 0;
	/* Another one may come back, which has what this one had not. */
	device->unread = 0;
	device->plate.missing = 0;
}

static const struct db_nameplate *xyza_nameplate(const struct db_device *device)
{
	return &device->plate;
}

static void xyza_init(struct db_device *device, struct db_device *first,
                      const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	device->first = first ? first : device;
	device->front.steps = device->front_steps;
	device->stop.steps = device->stop_steps;
	device->reaction = (db_time)bus->options[OPTION_REACTION] * DB_NS_PER_MS;
	device->stops_for_speed = bus->options[OPTION_SPEED_CHANGE] > 0.0;
	device->object = (uint8_t)drive->address;
	device->axis = (enum xyza_axis)drive->axis;
	device->standing = true;
	device->delayed = true;
	device->first->axes[device->axis] = device;
}

static void xyza_leave(struct db_device *device)
{
	device->first->axes[device->axis] = NULL;
}

/* --- the bus's side ----------------------------------------------------------------------------------- */

static enum db_frame xyza_accept(const struct db_bus_config *bus, const uint8_t *frame,
                                 size_t length, int *address)
{
	struct xyza_reply reply;

	switch (xyza_decode_reply(frame, length, &reply)) {
	case XYZA_OK:
		*address = reply.object;
		return DB_FRAME_GOOD;
	case XYZA_ERR_SIDE: /* our own request, echoed by the line */
		return DB_FRAME_FOREIGN;
	default:
		break;
	}
	/* A raw frame may be answered with what no document has. */
	if (!(bus->options[OPTION_RAW_FRAMES] > 0.0) || xyza_sender(frame, length) == 0)
		return DB_FRAME_BAD;
	*address = xyza_sender(frame, length);
	return DB_FRAME_GOOD;
}

static db_time time_of(const struct db_bus_config *bus, unsigned reads)
{
	return (db_time)reads * (db_serial_wire_time(bus, XYZA_COMMAND_FRAME + XYZA_DATA_FRAME) +
	                         TYPICAL_LATENCY + (db_time)bus->turnaround_us * DB_NS_PER_US);
}

/* Of a controller with one axis: standing, sign, magnitude, sign again, ports and program. */
static db_time xyza_poll_time(const struct db_bus_config *bus)
{
	return time_of(bus, 6);
}

/* Its standing, sign, magnitude and sign again. */
static db_time xyza_axis_time(const struct db_bus_config *bus)
{
	return time_of(bus, 4);
}

/* Of a move at another speed: that is read, written and read back, then the jog and its effect. */
static db_time xyza_command_time(const struct db_bus_config *bus)
{
	return time_of(bus, 5);
}

static bool in(double value, double min, double max)
{
	return value >= min && value <= max;
}

#define COMMANDS                                                                          \
	(DB_COMMAND_BIT(DB_CMD_ENABLE) | DB_COMMAND_BIT(DB_CMD_DISABLE) |                 \
	 DB_COMMAND_BIT(DB_CMD_STOP) | DB_COMMAND_BIT(DB_CMD_QUICK_STOP) |                \
	 DB_COMMAND_BIT(DB_CMD_MOVE_VELOCITY) | DB_COMMAND_BIT(DB_CMD_JOG_POSITIVE) |     \
	 DB_COMMAND_BIT(DB_CMD_JOG_NEGATIVE) | DB_COMMAND_BIT(DB_CMD_SET_POSITION) |      \
	 DB_COMMAND_BIT(DB_CMD_READ_PARAMETERS) | DB_COMMAND_BIT(DB_CMD_SET_OUTPUT) |     \
	 DB_COMMAND_BIT(DB_CMD_SET_OUTPUTS) | DB_COMMAND_BIT(DB_CMD_START_PROGRAM) |      \
	 DB_COMMAND_BIT(DB_CMD_PAUSE_PROGRAM) | DB_COMMAND_BIT(DB_CMD_CONTINUE_PROGRAM) | \
	 DB_COMMAND_BIT(DB_CMD_END_PROGRAM) | DB_COMMAND_BIT(DB_CMD_SINGLE_STEP) |        \
	 DB_COMMAND_BIT(DB_CMD_CLEAR_FAULT) | DB_COMMAND_BIT(DB_CMD_RAW_FRAME))

static uint64_t xyza_forbidden(const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)drive;
	return bus->options[OPTION_RAW_FRAMES] > 0.0 ? 0 : DB_COMMAND_BIT(DB_CMD_RAW_FRAME);
}

static void xyza_check_config(const struct db_bus_config *bus,
                              const struct db_drive_config *const *drives, size_t drive_count,
                              db_complain_fn *complain, void *context)
{
	(void)drives;
	(void)drive_count;
	if (bus->options[OPTION_RAW_FRAMES] > 0.0)
		complain(
			context, NULL, false,
			"raw-frames is on: who may write may send frames that the bridge cannot judge, past "
			"limits, locks and unlock-system; turn it off when it is not needed");
}

static enum db_result xyza_check(const struct db_bus_config *bus,
                                 const struct db_drive_config *drive, enum db_command command,
                                 const struct db_args *args)
{
	uint8_t frame[XYZA_FRAME_MAX];
	bool right = true;

	if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
	    !(COMMANDS & ~xyza_forbidden(bus, drive) & DB_COMMAND_BIT(command)))
		return DB_RESULT_UNSUPPORTED;
	switch (command) {
	case DB_CMD_MOVE_VELOCITY: /* whole Hz on the wire */
		right = in(fabs((double)args->target_velocity), 0.5, 4294967040.0) ||
		        in((double)args->target_velocity, 0.0, 0.0);
		break;
	case DB_CMD_SET_POSITION:
		right = args->target_position != INT32_MIN;
		break;
	case DB_CMD_SET_OUTPUT:
		right = in(args->output_number, 1, XYZA_OUTPUTS) && args->output_value <= 1;
		break;
	case DB_CMD_SET_OUTPUTS:
		right = args->output_mask != 0 && args->output_mask < 1u << XYZA_OUTPUTS;
		break;
	case DB_CMD_START_PROGRAM:
		right = args->program_number <= UINT8_MAX && args->program_delay <= UINT8_MAX;
		break;
	case DB_CMD_SINGLE_STEP:
		right = args->output_value <= 1;
		break;
	case DB_CMD_RAW_FRAME:
		right = write_raw(args, (uint8_t)drive->address, frame, sizeof frame) > 0;
		break;
	default:
		break;
	}
	return right ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
}

static enum db_result xyza_check_param(const struct db_bus_config *bus, size_t param,
                                       union db_value value)
{
	bool unlocked = bus->options[OPTION_UNLOCK] > 0.0;
	unsigned access;

	if (param >= XYZA_SHOWN_COUNT)
		return DB_RESULT_UNSUPPORTED;
	/* Whether the controller can be told so shows when its speeds were read. */
	if (param >= XYZA_PARAM_COUNT)
		return value.f > 0.0f && isfinite(value.f) ? DB_RESULT_OK : DB_RESULT_OUT_OF_RANGE;
	access = xyza_param_access((enum xyza_param)param);
	if (!(access & XYZA_CAN_WRITE) || ((access & XYZA_NEEDS_UNLOCK) && !unlocked))
		return DB_RESULT_UNSUPPORTED;
	return xyza_param_in_range((enum xyza_param)param, value) ? DB_RESULT_OK :
	                                                            DB_RESULT_OUT_OF_RANGE;
}

const struct db_driver db_driver_xyza = {
	.name = "xyza",
	.title = "XYZA stepper controller (5A A5) on RS485 or RS232",
	.medium = DB_MEDIUM_SERIAL,
	.address_min = 1,
	.address_max = XYZA_OBJECT_MAX,
	.default_baud = 9600,
	.axes = XYZA_AXIS_COUNT,
	.options = options,
	.option_count = sizeof options / sizeof options[0],
	.acknowledges = true,
	.commands = COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS | DB_MEASURE_PROGRAM |
	            DB_MEASURE_RAW_ANSWER,
	.output_count = XYZA_OUTPUTS,
	.params = xyza_params,
	.param_count = XYZA_SHOWN_COUNT,
	.secret_params = SECRET_PARAMS,
	.status_bits = status_bits,
	.status_bit_count = sizeof status_bits / sizeof status_bits[0],
	.param_page = 1,
	.acceleration_param = XYZA_RAMP_ACCELERATION,
	.deceleration_param = XYZA_RAMP_DECELERATION,
	.scale_unit = "mm",
	.preset_velocity_param = XYZA_MANUAL_SPEED,
	.check = xyza_check,
	.check_param = xyza_check_param,
	.forbidden = xyza_forbidden,
	.check_config = xyza_check_config,
	.poll_time = xyza_poll_time,
	.axis_time = xyza_axis_time,
	.command_time = xyza_command_time,
	.device_size = sizeof(struct db_device),
	.init = xyza_init,
	.leave = xyza_leave,
	.cut = xyza_cut,
	.accept = xyza_accept,
	.begin = xyza_begin,
	.answer = xyza_answer,
	.lost = xyza_lost,
	.gone = xyza_gone,
	.feedback = xyza_feedback,
	.nameplate = xyza_nameplate,
};
