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
#include "codec/xyza.h"
#include "driver/list.h"
#include "transport/serial.h"

#include <math.h>
#include <string.h>

/* What a controller usually needs before it answers; only for predictions, never a time-out. */
#define TYPICAL_LATENCY (1 * DB_NS_PER_MS)

/* How long an axis may take to come to a stand before it is jogged another way. */
#define STOP_TIME (2 * DB_NS_PER_S)

/* How often the sign is read again when it changes under the reading. */
#define SIGN_TRIES 3

#define RESENDS_MAX 2

/* A controller also refuses what arrived with a wrong sum: it is asked again so often. */
#define REFUSALS_MAX 1

/* scratch[1] of a stop: one of its two modes was stopped, or none needs to. */
#define STOP_TAKEN 1

#define STEPS_MAX (3 * XYZA_PARAM_COUNT)

enum option { OPTION_UNLOCK };

static const struct db_option options[] = {
	[OPTION_UNLOCK] = {
		.section = "bus",
		.name = "unlock-system",
		.words = "no yes",
		.preset = "no",
		.unit = "",
		.description = "Lets system_info, factory_reset and slave_number be written",
	},
};

/* --- the controller and its axes ------------------------------------------------------------------- */

enum step_kind {
	STEP_PLAIN,
	STEP_READ_FOR_NEXT,  /* the content read, with one parameter changed, is written next */
	STEP_UNTIL_STANDING, /* read again until the axis stands */
	STEP_MAY_FAIL,       /* a refusal is no failure: it does not apply to the mode it is in */
};

struct step {
	struct xyza_request request;
	enum step_kind kind;
	enum xyza_param param; /* READ_FOR_NEXT */
	union db_value value;
};

/* What a command or a parameter write consists of. */
struct plan {
	struct step steps[STEPS_MAX];
	unsigned count;
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

struct db_device {
	struct db_device *first; /* of the controller: has what is common */
	uint8_t object;
	enum xyza_axis axis;
	struct plan front;
	struct plan stop;

	/* The axis. */
	bool heard;
	bool standing;
	bool negative;
	int32_t position;
	float velocity; /* computed from two positions */
	db_time taken;
	bool jogging;  /* it was told to, and was not seen to stand since */
	bool fresh;    /* told so after the last look at it */
	unsigned told; /* how often it was told to move or to stop */
	bool stopping;
	bool refused;
	unsigned resends;                       /* of the command under way */
	unsigned refusals[DB_JOB_SETTINGS + 1]; /* of the last request of each kind of job */
	struct db_nameplate plate;
	bool params_valid;

	/* First axis only: the controller. */
	struct db_device *axes[XYZA_AXIS_COUNT]; /* null: not configured */
	uint32_t ports;
	uint8_t program;
	uint8_t program_state;
	uint16_t program_step;
	unsigned stops; /* how often any axis was told to stop: all of them do */
	bool delayed;   /* it may have a start delay, which a start without one has to end */

	/* First axis only: the reading under way. */
	unsigned poll_axis;
	unsigned sign_tries;
	bool poll_standing;
	unsigned poll_told; /* when it was seen to stand or to move */
	bool poll_negative;
	uint32_t poll_magnitude;
	db_time poll_taken;
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
		.axis = (enum xyza_axis)first->poll_axis,
	};

	job->step = phase;
	return ask(first, request, true, exchange, result);
}

static enum db_step poll_begin(struct db_device *first, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
	first->poll_axis = next_axis(first, 0);
	first->sign_tries = 0;
	return poll_ask(first, job, POLL_STANDING, exchange, result);
}

static void take_standing(struct db_device *device, const struct db_device *first)
{
	bool standing = first->poll_standing;

	/* What was seen before it was told something says nothing about what it does now. */
	if (first->poll_told != device->told)
		return;
	device->standing = standing;
	device->fresh = false;
	if (standing)
		device->jogging = device->stopping = false;
}

/* The sign was the same before and after: this is where the axis is. */
static void take_position(struct db_device *device, const struct db_device *first)
{
	int32_t position;

	if (!xyza_position(first->poll_magnitude, first->poll_negative, &position))
		return;
	if (device->heard && first->poll_taken > device->taken)
		device->velocity = first->poll_standing ?
		                           0.0f :
		                           (float)((double)position - (double)device->position) *
		                                   (float)DB_NS_PER_S /
		                                   (float)(first->poll_taken - device->taken);
	device->position = position;
	device->negative = first->poll_negative;
	device->taken = first->poll_taken;
	device->heard = true;
	take_standing(device, first);
}

static enum db_step poll_next_axis(struct db_device *first, struct db_job *job,
                                   struct db_exchange *exchange, enum db_result *result)
{
	first->poll_axis = next_axis(first, first->poll_axis + 1);
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
		return poll_next_axis(first, job, exchange, result);
	case POLL_SIGN_AGAIN:
		if (first->poll_negative == (reply->value == 1)) {
			take_position(device, first);
		} else if (++first->sign_tries < SIGN_TRIES) {
			first->poll_negative = reply->value == 1;
			return poll_ask(first, job, POLL_MAGNITUDE, exchange, result);
		}
		return poll_next_axis(first, job, exchange, result);
	case POLL_PORTS:
		first->ports = reply->value;
		return poll_ask(first, job, POLL_PROGRAM, exchange, result);
	case POLL_PROGRAM:
	default:
		first->program = reply->program;
		first->program_state = reply->state;
		first->program_step = reply->step;
		return done(result, DB_RESULT_OK);
	}
}

/* An axis that the controller does not have is not shown; the others are. */
static enum db_step poll_refused(struct db_device *first, struct db_job *job,
                                 struct db_exchange *exchange, enum db_result *result)
{
	if (job->step == POLL_PROGRAM)
		return done(result, DB_RESULT_OK);
	if (job->step == POLL_PORTS)
		return poll_ask(first, job, POLL_PROGRAM, exchange, result);
	return poll_next_axis(first, job, exchange, result);
}

/* --- plans ----------------------------------------------------------------------------------------- */

static struct step *add(struct plan *plan, struct xyza_request request)
{
	struct step *step = &plan->steps[plan->count++];

	*step = (struct step){ .request = request };
	return step;
}

static struct step *add_verb(struct plan *plan, const struct db_device *device, enum xyza_verb verb)
{
	return add(plan, (struct xyza_request){ .verb = verb, .axis = device->axis });
}

/* Reads an item, puts the parameter in and writes it. */
static void add_change(struct plan *plan, const struct db_device *device, enum xyza_param param,
                       union db_value value)
{
	enum xyza_item item = xyza_param_item(param);
	struct step *step = add(plan, (struct xyza_request){ .verb = XYZA_READ_ITEM,
	                                                     .axis = device->axis,
	                                                     .item = item });

	step->kind = STEP_READ_FOR_NEXT;
	step->param = param;
	step->value = value;
	add(plan,
	    (struct xyza_request){ .verb = XYZA_WRITE_ITEM, .axis = device->axis, .item = item });
}

/*
 * Both modes are stopped: what a controller does not do it may refuse to stop. A program that shows
 * as idle may be about to start, by a key or after its delay. One that is stopped already may end.
 */
static void plan_stop(struct plan *plan, const struct db_device *device, bool quick)
{
	enum xyza_verb manual = quick ? XYZA_MANUAL_QUICK_STOP : XYZA_MANUAL_STOP;
	enum xyza_verb program = quick ? XYZA_PROGRAM_QUICK_STOP : XYZA_PROGRAM_STOP;

	if (device->first->program_state == XYZA_PROGRAM_RUNNING) {
		add_verb(plan, device, program);
		add_verb(plan, device, manual)->kind = STEP_MAY_FAIL;
		return;
	}
	add_verb(plan, device, manual)->kind = STEP_MAY_FAIL;
	/* An emergency stop would leave a program interrupted that never ran. */
	add_verb(plan, device, XYZA_PROGRAM_STOP)->kind = STEP_MAY_FAIL;
}

static void plan_enable(struct plan *plan, const struct db_device *device, bool on)
{
	unsigned bit = 1u << device->axis;
	const struct db_nameplate *plate = &device->plate;
	union db_value mask = { .u = plate->values[XYZA_ENABLE].u };

	/* What is known of the other axes is read again right before it is written. */
	mask.u = on ? mask.u | bit : mask.u & ~bit;
	add_change(plan, device, XYZA_ENABLE, mask);
}

static void plan_jog(struct plan *plan, struct db_device *device, bool negative, float speed)
{
	if (!device->standing || device->jogging) {
		add_verb(plan, device, XYZA_MANUAL_STOP);
		add_verb(plan, device, XYZA_READ_STANDING)->kind = STEP_UNTIL_STANDING;
	}
	if (speed > 0.0f)
		add(plan, (struct xyza_request){ .verb = XYZA_WRITE_ITEM,
		                                 .axis = device->axis,
		                                 .item = XYZA_ITEM_MANUAL_SPEED,
		                                 .value = (uint32_t)llroundf(speed) });
	add(plan, (struct xyza_request){
			  .verb = XYZA_MANUAL_JOG, .axis = device->axis, .negative = negative });
}

static void plan_outputs(struct plan *plan, const struct db_args *args)
{
	for (unsigned port = 1; port <= XYZA_OUTPUTS; port++) {
		if (args->output_mask >> (port - 1) & 1)
			add(plan,
			    (struct xyza_request){ .verb = XYZA_WRITE_OUTPUT,
			                           .number = (uint8_t)port,
			                           .on = args->output_levels >> (port - 1) & 1 });
	}
}

/* Whoever reads between two of these writes, and whatever becomes of the rest of them: the position
 * has the sign of the old value or of the new one, or is 0. */
static void plan_position(struct plan *plan, const struct db_device *device, int32_t position)
{
	uint32_t magnitude = position < 0 ? 0u - (uint32_t)position : (uint32_t)position;

	if (position == 0) {
		add_verb(plan, device, XYZA_MANUAL_CLEAR);
		return;
	}
	if (device->position != 0 && device->negative != (position < 0))
		add_verb(plan, device, XYZA_WRITE_MAGNITUDE);
	add_verb(plan, device, XYZA_WRITE_SIGN)->request.negative = position < 0;
	add_verb(plan, device, XYZA_WRITE_MAGNITUDE)->request.value = magnitude;
}

static void plan_program(struct plan *plan, struct db_device *first, const struct db_args *args)
{
	if (args->program_delay > 0 || first->delayed) {
		struct step *step = add(
			plan, (struct xyza_request){ .verb = XYZA_PROGRAM_DELAY,
		                                     .number = (uint8_t)args->program_delay });

		if (args->program_delay == 0)
			step->kind = STEP_MAY_FAIL;
		first->delayed = true;
	}
	add(plan, (struct xyza_request){ .verb = XYZA_PROGRAM_START,
	                                 .number = (uint8_t)args->program_number });
}

/* Another axis is being jogged, or a program runs: this one cannot be jogged now. */
static bool is_occupied(const struct db_device *device)
{
	const struct db_device *first = device->first;

	if (first->program_state == XYZA_PROGRAM_RUNNING)
		return true;
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		const struct db_device *other = first->axes[i];

		if (other && other != device && (other->jogging || !other->standing))
			return true;
	}
	return false;
}

static bool is_jog(enum db_command command)
{
	return command == DB_CMD_MOVE_VELOCITY || command == DB_CMD_JOG_POSITIVE ||
	       command == DB_CMD_JOG_NEGATIVE;
}

static void make_plan(struct plan *plan, struct db_device *device, const struct db_request *request)
{
	const struct db_args *args = &request->args;
	float velocity = args->target_velocity;

	plan->count = 0;
	switch (request->command) {
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
		plan_stop(plan, device, request->command == DB_CMD_QUICK_STOP);
		break;
	case DB_CMD_ENABLE:
		plan_enable(plan, device, true);
		break;
	case DB_CMD_DISABLE:
		plan_stop(plan, device, true);
		plan_enable(plan, device, false);
		break;
	case DB_CMD_MOVE_VELOCITY:
		if (velocity > 0.0f || velocity < 0.0f)
			plan_jog(plan, device, velocity < 0.0f, fabsf(velocity));
		else
			add_verb(plan, device, XYZA_MANUAL_STOP);
		break;
	case DB_CMD_JOG_POSITIVE:
	case DB_CMD_JOG_NEGATIVE:
		plan_jog(plan, device, request->command == DB_CMD_JOG_NEGATIVE, 0.0f);
		break;
	case DB_CMD_SET_POSITION:
		plan_position(plan, device, args->target_position);
		break;
	case DB_CMD_SET_OUTPUT:
		add(plan, (struct xyza_request){ .verb = XYZA_WRITE_OUTPUT,
		                                 .number = (uint8_t)args->output_number,
		                                 .on = args->output_value != 0 });
		break;
	case DB_CMD_SET_OUTPUTS:
		plan_outputs(plan, args);
		break;
	case DB_CMD_START_PROGRAM:
		plan_program(plan, device->first, args);
		break;
	case DB_CMD_PAUSE_PROGRAM:
		add_verb(plan, device, XYZA_PROGRAM_STOP);
		break;
	case DB_CMD_CONTINUE_PROGRAM:
		add_verb(plan, device, XYZA_PROGRAM_CONTINUE);
		break;
	case DB_CMD_END_PROGRAM:
		add_verb(plan, device, XYZA_PROGRAM_END);
		break;
	case DB_CMD_SINGLE_STEP:
		add_verb(plan, device,
		         args->output_value ? XYZA_PROGRAM_STEP_ON : XYZA_PROGRAM_STEP_OFF);
		break;
	default:
		break;
	}
}

static void plan_settings(struct plan *plan, const struct db_device *device,
                          const struct db_request *request)
{
	plan->count = 0;
	for (size_t i = 0; i < request->setting_count; i++) {
		enum xyza_param param = (enum xyza_param)request->settings[i].param;
		union db_value value = request->settings[i].value;

		if (xyza_param_access(param) & XYZA_CAN_READ)
			add_change(plan, device, param, value);
		else
			add(plan,
			    (struct xyza_request){ .verb = XYZA_WRITE_ITEM,
			                           .axis = device->axis,
			                           .item = xyza_param_item(param),
			                           .value = xyza_param_put(param, value, 0) });
	}
}

static struct plan *plan_of(struct db_device *device, const struct db_job *job)
{
	return job->kind == DB_JOB_COMMAND && db_command_is_stop(job->request->command) ?
	               &device->stop :
	               &device->front;
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
		return job->request->command != DB_CMD_PAUSE_PROGRAM;
	default:
		return true;
	}
}

static enum db_step send_step(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	const struct plan *plan = plan_of(device, job);
	const struct xyza_request *request;

	if (job->step == plan->count)
		return done(result, DB_RESULT_OK);
	request = &plan->steps[job->step].request;
	return ask(device, *request, is_repeatable(job, request->verb), exchange, result);
}

/* --- what a finished command means ------------------------------------------------------------------ */

static void learn_one(struct db_device *device, enum xyza_param param, union db_value value)
{
	uint64_t bit = UINT64_C(1) << param;

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

/* What an item was read as, or written. */
static void learn_item(struct db_device *device, enum xyza_item item, uint32_t content)
{
	for (unsigned i = 0; i < XYZA_PARAM_COUNT; i++) {
		enum xyza_param param = (enum xyza_param)i;

		if (xyza_param_item(param) == item && (xyza_param_access(param) & XYZA_CAN_READ))
			learn(device, param, xyza_param_get(param, content));
	}
}

/* A controller may not have it. */
static void forget_item(struct db_device *device, enum xyza_item item)
{
	for (unsigned i = 0; i < XYZA_PARAM_COUNT; i++) {
		if (xyza_param_item((enum xyza_param)i) == item)
			device->plate.valid &= ~(UINT64_C(1) << i);
	}
}

/* After a reset nothing that is known of any axis counts. */
static void forget_all(struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i])
			first->axes[i]->plate.doubtful = true;
	}
}

static void started(struct db_device *device)
{
	device->told++;
	device->jogging = true;
	device->fresh = true;
	device->standing = false;
	device->stopping = false;
}

static void stopped(struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		struct db_device *device = first->axes[i];

		/* A program may have set it in motion since. */
		if (!device || (device->standing && first->program_state != XYZA_PROGRAM_RUNNING))
			continue;
		device->told++;
		device->stopping = device->fresh = true;
	}
}

static enum db_step carried_out(struct db_device *device, const struct db_job *job,
                                enum db_result *result)
{
	const struct db_request *request = job->request;
	float velocity = request->args.target_velocity;

	if (job->kind == DB_JOB_SETTINGS)
		return done(result, DB_RESULT_OK);
	switch (request->command) {
	case DB_CMD_MOVE_VELOCITY:
		if (!(velocity > 0.0f || velocity < 0.0f)) {
			stopped(device->first);
			break;
		}
		started(device);
		break;
	case DB_CMD_JOG_POSITIVE:
	case DB_CMD_JOG_NEGATIVE:
		started(device);
		break;
	case DB_CMD_STOP:
	case DB_CMD_QUICK_STOP:
	case DB_CMD_DISABLE:
		stopped(device->first);
		break;
	case DB_CMD_SET_POSITION:
		device->position = request->args.target_position;
		device->negative = device->position < 0;
		break;
	case DB_CMD_START_PROGRAM:
		device->first->program = (uint8_t)request->args.program_number;
		device->first->program_state = XYZA_PROGRAM_RUNNING;
		device->first->delayed = request->args.program_delay > 0;
		break;
	default:
		break;
	}
	return done(result, DB_RESULT_OK);
}

/* --- commands, step by step ------------------------------------------------------------------------- */

/* scratch[0]: the step whose answer was lost, plus one. scratch[1]: of a jog the stops that there had
 * been when it began, of a program command the program's state then. */

static enum db_step next_step(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	job->step++;
	if (job->step == plan_of(device, job)->count)
		return carried_out(device, job, result);
	return send_step(device, job, exchange, result);
}

/* The answer to a jog was lost: it moves, then it had it; it stands, then it had not, unless it was
 * stopped meanwhile. */
static enum db_step resolve_jog(struct db_device *device, struct db_job *job,
                                const struct xyza_reply *reply, struct db_exchange *exchange,
                                enum db_result *result)
{
	if (reply->kind == XYZA_REPLY_FAILED)
		return done(result, DB_RESULT_INDETERMINATE);
	if (job->scratch[1] != device->first->stops)
		return done(result, DB_RESULT_CANCELLED);
	if (reply->value == 0)
		return next_step(device, job, exchange, result);
	if (device->resends++ >= RESENDS_MAX)
		return done(result, DB_RESULT_TIMEOUT);
	return send_step(device, job, exchange, result);
}

/* The answer to a program command was lost: a program that has come into the state that it was to
 * come into has had it; else nobody can tell. */
static enum db_step resolve_program(struct db_device *device, struct db_job *job,
                                    const struct xyza_reply *reply, struct db_exchange *exchange,
                                    enum db_result *result)
{
	enum db_command command = job->request->command;
	enum xyza_program_state wanted = command == DB_CMD_PAUSE_PROGRAM ? XYZA_PROGRAM_WAITING :
	                                 command == DB_CMD_END_PROGRAM   ? XYZA_PROGRAM_IDLE :
	                                                                   XYZA_PROGRAM_RUNNING;

	if (reply->kind != XYZA_REPLY_PROGRAM_STATE || reply->state != wanted ||
	    job->scratch[1] == (int64_t)wanted ||
	    (command == DB_CMD_START_PROGRAM &&
	     reply->program != job->request->args.program_number))
		return done(result, DB_RESULT_INDETERMINATE);
	return next_step(device, job, exchange, result);
}

static enum db_step step_answered(struct db_device *device, struct db_job *job,
                                  const struct xyza_reply *reply, db_time now,
                                  struct db_exchange *exchange, enum db_result *result)
{
	struct plan *plan = plan_of(device, job);
	struct step *step = &plan->steps[job->step];

	if (plan == &device->stop && reply->kind != XYZA_REPLY_FAILED)
		job->scratch[1] = STOP_TAKEN;
	if (reply->kind == XYZA_REPLY_FAILED &&
	    (step->kind != STEP_MAY_FAIL ||
	     (plan == &device->stop && job->step == 1 && job->scratch[1] != STOP_TAKEN))) {
		device->refused = true;
		if (job->kind == DB_JOB_SETTINGS)
			device->plate.doubtful = true;
		return done(result, DB_RESULT_REFUSED);
	}
	if (step->kind == STEP_UNTIL_STANDING && reply->value != 1) {
		if (now - job->started > STOP_TIME)
			return done(result, DB_RESULT_FAILED);
		return send_step(device, job, exchange, result);
	}
	if (step->kind == STEP_READ_FOR_NEXT) {
		union db_value value = step->value;
		uint32_t bit = 1u << device->axis;

		/* Of the enabled motors only this axis's bit is to change. */
		if (job->kind == DB_JOB_COMMAND && step->param == XYZA_ENABLE)
			value.u = (xyza_param_get(XYZA_ENABLE, reply->value).u & ~bit) |
			          (value.u & bit);
		step[1].request.value = xyza_param_put(step->param, value, reply->value);
	}
	if (step->request.verb == XYZA_WRITE_ITEM)
		learn_item(device, step->request.item, step->request.value);
	if (step->request.verb == XYZA_WRITE_ITEM && step->request.item == XYZA_ITEM_FACTORY_RESET)
		forget_all(device->first);
	device->refused = false;
	return next_step(device, job, exchange, result);
}

static enum db_step command_answered(struct db_device *device, struct db_job *job,
                                     const struct xyza_reply *reply, db_time now,
                                     struct db_exchange *exchange, enum db_result *result)
{
	if (job->scratch[0] == 0)
		return step_answered(device, job, reply, now, exchange, result);
	job->step = (unsigned)job->scratch[0] - 1;
	job->scratch[0] = 0;
	if (is_jog(job->request->command))
		return resolve_jog(device, job, reply, exchange, result);
	return resolve_program(device, job, reply, exchange, result);
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

/* --- jobs -------------------------------------------------------------------------------------------- */

static enum db_step begin_command(struct db_device *device, struct db_job *job,
                                  struct db_exchange *exchange, enum db_result *result)
{
	enum db_command command = job->request->command;

	if (command == DB_CMD_READ_PARAMETERS)
		return ask_item(device, job, 0, exchange, result);
	if ((is_jog(command) && is_occupied(device)) ||
	    (command == DB_CMD_SET_POSITION && !device->standing)) {
		device->refused = true;
		return done(result, DB_RESULT_REFUSED);
	}
	if (db_command_is_stop(command) || command == DB_CMD_DISABLE)
		device->first->stops++;
	else
		device->resends = 0;
	job->scratch[1] = is_jog(command) ? (int64_t)device->first->stops :
	                                    (int64_t)device->first->program_state;
	if (plan_of(device, job) == &device->stop)
		job->scratch[1] = device->first->program_state > XYZA_PROGRAM_RUNNING ? STOP_TAKEN :
		                                                                        0;
	make_plan(plan_of(device, job), device, job->request);
	return send_step(device, job, exchange, result);
}

static enum db_step xyza_begin(struct db_device *device, struct db_job *job,
                               struct db_exchange *exchange, enum db_result *result)
{
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
		plan_settings(&device->front, device, job->request);
		return send_step(device, job, exchange, result);
	case DB_JOB_COMMAND:
	default:
		return begin_command(device, job, exchange, result);
	}
}

/* A refused request was not carried out, so saying it again is harmless whatever it is. */
static bool is_asked_again(struct db_device *device, const struct db_job *job,
                           const struct xyza_reply *reply)
{
	unsigned *refusals = &device->refusals[job->kind];
	bool steps = job->kind == DB_JOB_SETTINGS ||
	             (job->kind == DB_JOB_COMMAND &&
	              job->request->command != DB_CMD_READ_PARAMETERS && job->scratch[0] == 0);

	if (reply->kind == XYZA_REPLY_FAILED && *refusals < REFUSALS_MAX &&
	    !(steps && plan_of(device, job)->steps[job->step].kind == STEP_MAY_FAIL &&
	      (plan_of(device, job) == &device->front || job->scratch[1] == STOP_TAKEN))) {
		(*refusals)++;
		return true;
	}
	*refusals = 0;
	return false;
}

static enum db_step xyza_answer(struct db_device *device, struct db_job *job, const uint8_t *frame,
                                size_t length, db_time now, struct db_exchange *exchange,
                                enum db_result *result)
{
	struct xyza_request request;
	struct xyza_reply reply;

	if (xyza_decode_reply(frame, length, &reply) != XYZA_OK ||
	    xyza_decode_request(exchange->request, exchange->request_length, &request) != XYZA_OK ||
	    !xyza_fits(&request, &reply))
		return DB_STEP_IGNORE;
	if (is_asked_again(device, job, &reply))
		return DB_STEP_SEND; /* the exchange is as it was */
	switch (job->kind) {
	case DB_JOB_PROBE:
		return done(result, DB_RESULT_OK);
	case DB_JOB_IDENTIFY:
		return identify_answered(device, job, &reply, exchange, result);
	case DB_JOB_POLL:
		if (reply.kind == XYZA_REPLY_FAILED)
			return poll_refused(device, job, exchange, result);
		return poll_answer(device, job, &reply, now, exchange, result);
	case DB_JOB_SETTINGS:
		return step_answered(device, job, &reply, now, exchange, result);
	case DB_JOB_COMMAND:
	default:
		if (job->request->command == DB_CMD_READ_PARAMETERS)
			return identify_answered(device, job, &reply, exchange, result);
		return command_answered(device, job, &reply, now, exchange, result);
	}
}

static enum db_step xyza_lost(struct db_device *device, struct db_job *job,
                              struct db_exchange *exchange, enum db_result *result)
{
	const struct step *step;

	if (job->kind == DB_JOB_SETTINGS)
		device->plate.doubtful = true;
	if (job->kind != DB_JOB_COMMAND || job->request->command == DB_CMD_READ_PARAMETERS)
		return done(result, DB_RESULT_TIMEOUT);
	if (job->scratch[0] != 0)
		return done(result, DB_RESULT_INDETERMINATE);
	step = &plan_of(device, job)->steps[job->step];
	if (is_repeatable(job, step->request.verb))
		return done(result, DB_RESULT_TIMEOUT);
	job->scratch[0] = job->step + 1;
	return ask_verb(device,
	                is_jog(job->request->command) ? XYZA_READ_STANDING : XYZA_PROGRAM_STATE,
	                exchange, result);
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

static void xyza_feedback(const struct db_device *device, struct db_feedback *feedback)
{
	const struct db_device *first = device->first;
	enum db_axis_state state = state_of(device);

	feedback->taken = device->taken;
	feedback->position = device->position;
	feedback->velocity = device->velocity;
	/* Bit 0 negative, 1 stands, then the program's state. */
	feedback->drive_status = (uint32_t)device->negative | (uint32_t)device->standing << 1 |
	                         (uint32_t)first->program_state << 8;
	feedback->inputs = xyza_inputs(first->ports);
	feedback->outputs = xyza_outputs(first->ports);
	feedback->program = first->program;
	feedback->program_state = first->program_state;
	feedback->program_step = first->program_step;
	feedback->counts_per_unit = counts_per_unit(&device->plate);
	feedback->error = state == DB_AXIS_ERROR_STOP ? DB_ERROR_INTERRUPTED : DB_ERROR_NONE;
	feedback->state = (uint16_t)state;
	feedback->status = status_of(device, state);
}

static void xyza_gone(struct db_device *device)
{
	device->heard = false;
	device->params_valid = false;
	device->jogging = device->fresh = device->stopping = false;
}

static const struct db_nameplate *xyza_nameplate(const struct db_device *device)
{
	return &device->plate;
}

static void xyza_init(struct db_device *device, struct db_device *first,
                      const struct db_bus_config *bus, const struct db_drive_config *drive)
{
	(void)bus;
	device->first = first ? first : device;
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

	(void)bus;
	switch (xyza_decode_reply(frame, length, &reply)) {
	case XYZA_OK:
		*address = reply.object;
		return DB_FRAME_GOOD;
	case XYZA_ERR_SIDE: /* our own request, echoed by the line */
		return DB_FRAME_FOREIGN;
	default:
		return DB_FRAME_BAD;
	}
}

static db_time time_of(const struct db_bus_config *bus, unsigned reads)
{
	return (db_time)reads *
	       (db_serial_wire_time(bus, XYZA_COMMAND_FRAME + XYZA_DATA_FRAME) + TYPICAL_LATENCY);
}

/* Of a controller with one axis: standing, sign, magnitude, sign again, ports and program. */
static db_time xyza_poll_time(const struct db_bus_config *bus)
{
	return time_of(bus, 6);
}

static db_time xyza_command_time(const struct db_bus_config *bus)
{
	return time_of(bus, 2);
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
	 DB_COMMAND_BIT(DB_CMD_END_PROGRAM) | DB_COMMAND_BIT(DB_CMD_SINGLE_STEP))

static enum db_result xyza_check(const struct db_bus_config *bus,
                                 const struct db_drive_config *drive, enum db_command command,
                                 const struct db_args *args)
{
	bool right = true;

	(void)bus;
	(void)drive;
	if (command <= DB_CMD_NONE || command >= DB_CMD_LIMIT ||
	    !(COMMANDS & DB_COMMAND_BIT(command)))
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

	if (param >= XYZA_PARAM_COUNT)
		return DB_RESULT_UNSUPPORTED;
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
	.commands = COMMANDS,
	.measures = DB_MEASURE_INPUTS | DB_MEASURE_OUTPUTS | DB_MEASURE_PROGRAM,
	.output_count = XYZA_OUTPUTS,
	.params = xyza_params,
	.param_count = XYZA_PARAM_COUNT,
	.param_page = 1,
	.acceleration_param = -1,
	.deceleration_param = -1,
	.preset_velocity_param = XYZA_MANUAL_SPEED,
	.check = xyza_check,
	.check_param = xyza_check_param,
	.poll_time = xyza_poll_time,
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
