/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A position is two reads, magnitude and sign. It may cross zero in between, so the sign is read
 * before and after, and again with the magnitude when it changed; a value whose sign is in doubt is
 * not shown.
 */
#include "driver/xyza/xyza_private.h"

#include <math.h>
#include <string.h>

/* Number of times the sign is read again when it changes during the reading. */
#define SIGN_TRIES 3

/* After this number of lost answers in a row a part is skipped; then it is read after a pause,
 * which doubles each time. A single loss may be the line's. */
#define PART_TRIES 2
#define PART_PAUSE_MIN (2 * DB_NS_PER_S)
#define PART_PAUSE_MAX (64 * DB_NS_PER_S)

/* For each axis the first four, then those of the controller. */
enum step {
	STEP_STANDING,
	STEP_SIGN,
	STEP_MAGNITUDE,
	STEP_SIGN_AGAIN,
	STEP_PORTS,
	STEP_PROGRAM,
	STEP_ITEM,
	STEPS
};

/* --- what is passed over ---------------------------------------------------------------------- */

static bool may_ask(const struct xyza_part *part, db_time now)
{
	return part->pause == 0 || now >= part->again_at;
}

/* True when it is skipped from now on. */
static bool note_part_lost(struct xyza_part *part, db_time longest, db_time now)
{
	bool first;

	if (++part->losses < PART_TRIES)
		return false;
	first = part->pause == 0;
	part->pause = first ? PART_PAUSE_MIN : db_time_min(2 * part->pause, longest);
	part->again_at = now + part->pause;
	return first;
}

/* --- items that are read again in service ----------------------------------------------------- */

/* They may be changed at the controller's keys, or by a short loss of its power. The power is read
 * again once in this number of readings, and halfway between them an item in turn, if the last one
 * was read a while ago. So they use at most a tenth of an axis's exchanges. */
#define POWER_EVERY 10
#define ITEM_PAUSE DB_NS_PER_S

/* What was not answered then may have been lost on the line, or the controller does not have it: it
 * is asked for again, less and less often. */
#define SILENT_PAUSE_MIN (15 * DB_NS_PER_S)
#define SILENT_PAUSE_MAX (960 * DB_NS_PER_S)

static unsigned *item_losses(struct xyza_turn *turn)
{
	return turn->asked == XYZA_ITEM_ENABLE ? &turn->enable_losses : &turn->losses;
}

/* The axis of an item; for a common item any axis that is there. */
static struct db_device *item_owner(const struct db_device *first, unsigned axis,
                                    enum xyza_item item)
{
	if (xyza_item_of_axis(item))
		return first->axes[axis];
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i])
			return first->axes[i];
	}
	return NULL;
}

/* True if it was read when the controller came online. */
static bool is_known(const struct db_device *first, unsigned axis, enum xyza_item item)
{
	const struct db_device *owner = item_owner(first, axis, item);

	return owner && owner->params_valid && !(owner->unread >> item & 1);
}

/* True if it was not answered then, nor since. */
static bool is_silent(const struct db_device *first, unsigned axis, enum xyza_item item)
{
	const struct db_device *owner = item_owner(first, axis, item);

	return owner && owner->params_valid && owner->unread >> item & 1;
}

/* True when such an item is asked for now. */
static bool try_silent(struct xyza_silence *silent, unsigned axis, enum xyza_item item, db_time now)
{
	uint32_t bit = UINT32_C(1) << item;

	if (silent->pause == 0)
		*silent = (struct xyza_silence){ .pause = SILENT_PAUSE_MIN,
			                         .at = now + SILENT_PAUSE_MIN };
	/* Its second turn: the round is through. */
	if (silent->tried[axis] & bit) {
		memset(silent->tried, 0, sizeof(silent->tried));
		if (silent->pause < SILENT_PAUSE_MAX)
			silent->pause *= 2;
		silent->at = now + silent->pause;
	}
	if (now < silent->at)
		return false;
	silent->tried[axis] |= bit;
	return true;
}

static bool is_in_turn(struct db_device *first, unsigned axis, enum xyza_item item, db_time now)
{
	switch (item) {
	case XYZA_ITEM_ENABLE:        /* it is read in its own turn */
	case XYZA_ITEM_READ_PASSWORD: /* a value that is not shown need not be read */
	case XYZA_ITEM_PASSWORD:
	case XYZA_ITEM_FACTORY_RESET:
	case XYZA_ITEM_SLAVE_NUMBER:
		return false;
	default:
		break;
	}
	/* Common items are read once in a round. */
	if (!xyza_item_of_axis(item) && axis != XYZA_X)
		return false;
	return is_known(first, axis, item) ||
	       (is_silent(first, axis, item) && try_silent(&first->turn.silent, axis, item, now));
}

/* It was refused, or is not answered: it is read again with all others. All axes know a common item
 * from the same read. */
static void doubt_item(struct db_device *first)
{
	struct xyza_turn *turn = &first->turn;

	*item_losses(turn) = 0;
	if (is_silent(first, turn->axis, turn->asked))
		return;
	if (!xyza_item_of_axis(turn->asked))
		xyza_forget_all(first);
	else if (first->axes[turn->axis])
		first->axes[turn->axis]->plate.doubtful = true;
}

/* True if an item is to follow now that all axes were read. */
static bool choose_item(struct db_device *first, db_time now)
{
	struct xyza_turn *turn = &first->turn;
	unsigned phase = ++turn->polls % POWER_EVERY;

	if (phase % (POWER_EVERY / 2) != 0)
		return false;
	/* An axis that was sent a stop is judged by the end of this reading. */
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i] && first->axes[i]->stopping)
			return false;
	}
	turn->asked = XYZA_ITEM_ENABLE;
	if (phase == 0)
		return is_known(first, XYZA_X, turn->asked) ||
		       (is_silent(first, XYZA_X, turn->asked) &&
		        try_silent(&turn->silent_power, XYZA_X, turn->asked, now));
	if (now - turn->at < ITEM_PAUSE)
		return false;
	turn->at = now;
	turn->asked = turn->item;
	/* An item whose answer was lost is read again. */
	if (turn->losses > 0)
		return true;
	for (unsigned n = 0; n < (unsigned)XYZA_AXIS_COUNT * XYZA_ITEM_COUNT; n++) {
		unsigned next = (turn->item + 1u) % XYZA_ITEM_COUNT;

		if (next == 0)
			turn->axis = (turn->axis + 1) % XYZA_AXIS_COUNT;
		// NOLINTNEXTLINE(clang-analyzer-optin.core.EnumCastOutOfRange)
		turn->asked = turn->item = (enum xyza_item)next;
		if (is_in_turn(first, turn->axis, turn->item, now))
			return true;
	}
	return false;
}

/* --- questions -------------------------------------------------------------------------------- */

/* Reads a value of the current axis, or of the controller, or an item. */
static enum db_step send_read(struct db_conversation *talk)
{
	static const enum xyza_verb verbs[] = {
		[STEP_STANDING] = XYZA_READ_STANDING,   [STEP_SIGN] = XYZA_READ_SIGN,
		[STEP_MAGNITUDE] = XYZA_READ_MAGNITUDE, [STEP_SIGN_AGAIN] = XYZA_READ_SIGN,
		[STEP_PORTS] = XYZA_READ_PORTS,         [STEP_PROGRAM] = XYZA_PROGRAM_STATE,
		[STEP_ITEM] = XYZA_READ_ITEM,
	};
	const struct db_device *first = talk->device;
	struct xyza_request request = { .verb = verbs[talk->job->step] };
	bool item = talk->job->step == STEP_ITEM;

	if (item)
		request.item = first->turn.asked;
	/* Not used after the last axis. */
	// NOLINTNEXTLINE(clang-analyzer-optin.core.EnumCastOutOfRange)
	request.axis = (enum xyza_axis)(item ? first->turn.axis : first->poll_axis);
	return xyza_send(talk, request, true);
}

static enum db_step send_poll_step(struct db_conversation *talk, enum step step)
{
	talk->device->poll_step = step;
	return send_step(talk, xyza_poll_steps, step);
}

/* All axes were read: what is the controller's own follows, from this step on, and then an item. */
static enum db_step read_controller(struct db_conversation *talk, enum step from)
{
	struct db_device *first = talk->device;

	if (from == STEP_PORTS && may_ask(&first->ports_part, talk->now))
		return send_poll_step(talk, STEP_PORTS);
	if (from != STEP_ITEM && may_ask(&first->program_part, talk->now))
		return send_poll_step(talk, STEP_PROGRAM);
	if (choose_item(first, talk->now))
		return send_poll_step(talk, STEP_ITEM);
	first->polling = false;
	return end_job(talk, DB_RESULT_OK);
}

/* From this one on the next axis that is to be read; XYZA_AXIS_COUNT: none. */
static unsigned next_axis(const struct db_device *first, unsigned axis, db_time now)
{
	while (axis < XYZA_AXIS_COUNT &&
	       !(first->axes[axis] && may_ask(&first->axes[axis]->part, now)))
		axis++;
	return axis;
}

/* Continue with this axis, or after the last one with the controller. */
static enum db_step read_axis(struct db_conversation *talk, unsigned axis)
{
	struct db_device *first = talk->device;

	axis = next_axis(first, axis, talk->now);
	first->poll_axis = axis;
	first->poll_asked = talk->now;
	first->sign_tries = 0;
	return axis < XYZA_AXIS_COUNT ? send_poll_step(talk, STEP_STANDING) :
	                                read_controller(talk, STEP_PORTS);
}

/* --- what was read ---------------------------------------------------------------------------- */

/* Programs, and operators at its keys, set positions, too. */
static void judge_restart(const struct db_device *first, struct db_device *device, int32_t position,
                          bool stands)
{
	const struct restart_sample sample = {
		.position = position,
		.stands = stands && device->standing,
		.busy = first->program_state == XYZA_PROGRAM_RUNNING,
	};
	db_time now = first->poll_taken;
	bool restarted = false;

	switch (restart_judge(&device->restart, &sample, now)) {
	case RESTART_SEEN:
		restarted = true;
		break;
	case RESTART_DOUBT:
		/* Nobody sets two axes at once. */
		for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
			if (first->axes[i] && first->axes[i] != device)
				restarted |= restart_confirm(&first->axes[i]->restart, now);
		}
		restarted = restarted && restart_confirm(&device->restart, now);
		break;
	case RESTART_NONE:
	default:
		break;
	}
	if (restarted)
		xyza_forget_all(device->first);
}

/* Pulses are never this fast: a counter has overflowed, or the position was set. */
#define FASTEST 1e7f

/* The last value is kept where nothing can be computed. */
static float velocity_of(struct db_device *device, int32_t position, db_time now)
{
	float way = (float)((double)position - (double)device->position);
	float velocity = way * (float)DB_NS_PER_S / (float)device->span;

	if (fabsf(velocity) <= FASTEST)
		return velocity;
	/* Programs set positions, too. */
	if (device->first->program_state != XYZA_PROGRAM_RUNNING)
		restart_note_jump(&device->restart, device->position, now);
	return device->velocity;
}

/* The sign was the same before and after: this is where the axis is. */
static void take_position(struct db_device *device, const struct db_device *first)
{
	bool stands = first->poll_standing && first->poll_asked >= device->expected_by;
	int32_t position;

	/* What was seen before the command shows nothing about the present. */
	if (first->poll_commanded == device->commanded && (stands || !first->poll_standing)) {
		device->standing = first->poll_standing;
		device->just_commanded = false;
		if (device->standing)
			device->jogging = device->stopping = false;
		else
			device->expected_by = 0;
	}
	/* Half of it may be from before it was written. */
	if (first->poll_placed != device->placed || first->poll_taken < device->held_until ||
	    !xyza_position(first->poll_magnitude, first->poll_negative, &position))
		return;
	if (device->has_position && first->poll_taken > device->taken) {
		device->span = first->poll_taken - device->taken;
		device->velocity = stands ? 0.0f : velocity_of(device, position, first->poll_taken);
	}
	judge_restart(first, device, position, stands);
	device->position = position;
	device->negative = first->poll_negative;
	device->taken = first->poll_taken;
	device->has_position = true;
	device->part = (struct xyza_part){ .losses = 0 };
}

/* Standing, sign, magnitude and sign again of one axis. */
static enum db_step answer_axis(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct db_device *first = talk->device;
	struct db_device *device = first->axes[first->poll_axis];
	bool negative = reply->value == 1;
	unsigned step = talk->job->step;
	int32_t position;

	if (step == STEP_SIGN) {
		first->poll_negative = negative;
		talk->unchanged = true;
		return send_poll_step(talk, STEP_MAGNITUDE);
	}
	if (!device)
		return end_job(talk, DB_RESULT_FAILED);
	if (step == STEP_STANDING) {
		first->poll_standing = reply->value == 1;
		first->poll_commanded = device->commanded;
		first->poll_placed = device->placed;
		talk->unchanged = true;
		return send_poll_step(talk, STEP_SIGN);
	}
	if (step == STEP_MAGNITUDE) {
		first->poll_magnitude = reply->value;
		first->poll_taken = talk->now;
		/* The second read of the sign is only left out where nothing changed since the last
		 * time and nothing moves. */
		if (!device->has_position || !first->poll_standing || !device->standing ||
		    first->poll_commanded != device->commanded ||
		    !xyza_position(first->poll_magnitude, first->poll_negative, &position) ||
		    position != device->position) {
			talk->unchanged = true;
			return send_poll_step(talk, STEP_SIGN_AGAIN);
		}
		take_position(device, first);
	} else if (first->poll_negative == negative) {
		take_position(device, first);
	} else if (++first->sign_tries < SIGN_TRIES) {
		first->poll_negative = negative;
		return send_poll_step(talk, STEP_MAGNITUDE);
	}
	return read_axis(talk, first->poll_axis + 1);
}

/* Ports, program, and an item. A refusal is handled as an answer: the controller does not have
 * this, and the next part is read. */
static enum db_step answer_controller(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	struct db_device *first = talk->device;
	struct xyza_turn *turn = &first->turn;
	bool refused = reply->kind == XYZA_REPLY_FAILED;
	struct db_device *owner;

	switch (talk->job->step) {
	case STEP_PORTS:
		if (!refused) {
			talk->unchanged = first->ports == reply->value;
			first->ports = reply->value;
		}
		first->ports_part = (struct xyza_part){ .losses = 0 };
		return read_controller(talk, STEP_PROGRAM);
	case STEP_PROGRAM:
		if (!refused) {
			talk->unchanged = first->program_part.pause == 0 &&
			                  reply->program == first->program &&
			                  reply->state == first->program_state &&
			                  reply->step == first->program_step;
			xyza_take_program(first, reply);
		}
		first->program_part = (struct xyza_part){ .losses = 0 };
		return read_controller(talk, STEP_ITEM);
	case STEP_ITEM:
	default:
		owner = item_owner(first, turn->axis, turn->asked);
		if (refused)
			doubt_item(first);
		else
			*item_losses(turn) = 0;
		/* What the line lost may not have been lost alone. */
		if (!refused && is_silent(first, turn->axis, turn->asked))
			turn->silent.pause = turn->silent_power.pause = 0;
		if (!refused && owner)
			xyza_learn_item(owner, turn->asked, reply->value, talk->now);
		first->polling = false;
		return end_job(talk, DB_RESULT_OK);
	}
}

/* An axis that the controller does not have is not shown; the others are. */
static enum db_step refuse_axis(struct db_conversation *talk)
{
	return read_axis(talk, talk->device->poll_axis + 1);
}

const struct conversation_step xyza_poll_steps[] = {
	[STEP_STANDING] = { .send = send_read, .answered = answer_axis, .refused = refuse_axis },
	[STEP_SIGN] = { .send = send_read, .answered = answer_axis, .refused = refuse_axis },
	[STEP_MAGNITUDE] = { .send = send_read, .answered = answer_axis, .refused = refuse_axis },
	[STEP_SIGN_AGAIN] = { .send = send_read, .answered = answer_axis, .refused = refuse_axis },
	[STEP_PORTS] = { .send = send_read, .answered = answer_controller },
	[STEP_PROGRAM] = { .send = send_read, .answered = answer_controller },
	[STEP_ITEM] = { .send = send_read, .answered = answer_controller },
};

/* The axis at which the next reading begins. One that keeps silent while others answer is passed
 * over, and offline until it answers. */
static unsigned judge_lost_axis(struct db_device *first, db_time now)
{
	struct db_device *device = first->axes[first->poll_axis];
	bool any_answered = false;

	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++)
		any_answered |= first->axes[i] && first->axes[i]->has_position;
	/* While none has answered they take turns: this one may be the only one that is silent. */
	if (!any_answered)
		return next_axis(first, first->poll_axis + 1, now) % XYZA_AXIS_COUNT;
	/* One that has answered before exists, and a stop may wait for it: ask again soon. */
	if (device &&
	    note_part_lost(&device->part, device->taken > 0 ? PART_PAUSE_MIN : PART_PAUSE_MAX,
	                   now) &&
	    device->has_position)
		xyza_forget_state(device);
	return 0;
}

/* A reading that lost an answer is abandoned: the next one begins, and judges where it ended. */
enum db_step xyza_begin_poll(struct db_conversation *talk)
{
	struct db_device *first = talk->device;
	unsigned from = 0;

	switch (first->polling ? first->poll_step : STEPS) {
	case STEPS: /* the last reading has ended */
		break;
	case STEP_PORTS:
		if (note_part_lost(&first->ports_part, PART_PAUSE_MAX, talk->now))
			first->ports = 0;
		break;
	case STEP_PROGRAM:
		if (note_part_lost(&first->program_part, PART_PAUSE_MAX, talk->now))
			xyza_take_program(first,
			                  &(struct xyza_reply){ .state = XYZA_PROGRAM_IDLE });
		break;
	case STEP_ITEM:
		if (++*item_losses(&first->turn) >= XYZA_ITEM_TRIES ||
		    is_silent(first, first->turn.axis, first->turn.asked))
			doubt_item(first);
		break;
	default:
		from = judge_lost_axis(first, talk->now);
		break;
	}
	first->polling = true;
	return read_axis(talk, from);
}
