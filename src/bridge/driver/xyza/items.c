/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

/* After this number of unanswered reads an item counts as missing in this controller; one with a
 * known value is read again with all others. */
#define ITEM_TRIES 2

enum step { STEP_ITEM };

static struct xyza_item_reading *reading_of(const struct db_conversation *talk)
{
	return &talk->device->readings[talk->job->kind == DB_JOB_IDENTIFY];
}

static enum db_step send_item(struct db_conversation *talk)
{
	struct db_device *device = talk->device;
	struct xyza_request request = { .verb = XYZA_READ_ITEM, .axis = device->axis };
	unsigned item = reading_of(talk)->item;

	if (item < XYZA_ITEM_COUNT) {
		request.item = (enum xyza_item)item;
		return xyza_send(talk, request, true);
	}
	device->plate.doubtful = false;
	device->params_valid = true;
	device->plate.generation++;
	return end_job(talk, DB_RESULT_OK);
}

/* Reads the next readable item, from `item` on. */
static enum db_step read_item(struct db_conversation *talk, unsigned item)
{
	while (item == XYZA_ITEM_FACTORY_RESET || item == XYZA_ITEM_SLAVE_NUMBER)
		item++;
	*reading_of(talk) = (struct xyza_item_reading){ .item = item };
	return send_step(talk, xyza_item_steps, STEP_ITEM);
}

static enum db_step answer_item(struct db_conversation *talk)
{
	const struct xyza_reply *reply = talk->reply;
	unsigned item = reading_of(talk)->item;

	xyza_learn_item(talk->device, (enum xyza_item)item, reply->value, talk->now);
	return read_item(talk, item + 1);
}

/* The other items are useful without it. */
static enum db_step skip_item(struct db_conversation *talk)
{
	unsigned item = reading_of(talk)->item;

	xyza_forget_item(talk->device, (enum xyza_item)item);
	return read_item(talk, item + 1);
}

/* The controller is there, it only does not answer this. A single loss may be the line's. */
static enum db_step lose_item(struct db_conversation *talk)
{
	if (++reading_of(talk)->losses >= ITEM_TRIES)
		return skip_item(talk);
	return send_step(talk, xyza_item_steps, STEP_ITEM);
}

const struct conversation_step xyza_item_steps[] = {
	[STEP_ITEM] = { .send = send_item,
	                .answered = answer_item,
	                .refused = skip_item,
	                .lost = lose_item },
};

enum db_step xyza_begin_items(struct db_conversation *talk)
{
	return read_item(talk, 0);
}

/* --- items that are read again in service ----------------------------------------------------- */

/* The power is read again once in this number of readings, and halfway between them an item in
 * turn, if the last one was read a while ago. So they use at most a tenth of an axis's
 * exchanges. */
#define POWER_EVERY 10
#define ITEM_PAUSE DB_NS_PER_S

static enum xyza_item item_of(const struct xyza_turn *turn)
{
	if (turn->of_enable)
		return XYZA_ITEM_ENABLE;
	// NOLINTNEXTLINE(clang-analyzer-optin.core.EnumCastOutOfRange)
	return (enum xyza_item)turn->item;
}

/* The axis of an item; for a common item any axis that is there. */
static struct db_device *item_owner(const struct db_device *first, unsigned axis, unsigned item)
{
	if (xyza_item_of_axis((enum xyza_item)item))
		return first->axes[axis];
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i])
			return first->axes[i];
	}
	return NULL;
}

/* True if it was read when the controller came online. */
static bool is_known(const struct db_device *first, unsigned axis, unsigned item)
{
	const struct db_device *owner = item_owner(first, axis, item);

	return owner && owner->params_valid && !(owner->unread >> item & 1);
}

static bool is_in_turn(const struct db_device *first, unsigned axis, unsigned item)
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
	if (!xyza_item_of_axis((enum xyza_item)item) && axis != XYZA_X)
		return false;
	return is_known(first, axis, item);
}

/* All its axes know it from the same read, and read it again. */
static void doubt_item(struct db_device *first, unsigned axis, unsigned item)
{
	struct db_device *owner = item_owner(first, axis, item);

	if (!xyza_item_of_axis((enum xyza_item)item))
		xyza_forget_all(first);
	else if (owner)
		owner->plate.doubtful = true;
}

void xyza_turn_refused(struct db_device *first)
{
	struct xyza_turn *turn = &first->turn;

	if (turn->of_enable) {
		turn->enable_losses = 0;
		doubt_item(first, XYZA_X, XYZA_ITEM_ENABLE);
	} else {
		turn->losses = 0;
		doubt_item(first, turn->axis, turn->item);
	}
}

void xyza_turn_lost(struct db_device *first)
{
	struct xyza_turn *turn = &first->turn;
	unsigned *losses = turn->of_enable ? &turn->enable_losses : &turn->losses;

	if (++*losses >= ITEM_TRIES)
		xyza_turn_refused(first);
}

/* An axis that was sent a stop is judged by the end of this reading. */
static bool is_any_stopping(const struct db_device *first)
{
	for (unsigned i = 0; i < XYZA_AXIS_COUNT; i++) {
		if (first->axes[i] && first->axes[i]->stopping)
			return true;
	}
	return false;
}

bool xyza_turn_comes(struct db_device *first, db_time now)
{
	struct xyza_turn *turn = &first->turn;
	unsigned phase = ++turn->polls % POWER_EVERY;

	if (phase % (POWER_EVERY / 2) != 0 || is_any_stopping(first))
		return false;
	turn->of_enable = phase == 0;
	if (turn->of_enable)
		return is_known(first, XYZA_X, XYZA_ITEM_ENABLE);
	if (now - turn->at < ITEM_PAUSE)
		return false;
	turn->at = now;
	/* An item whose answer was lost is read again. */
	if (turn->losses > 0)
		return true;
	for (unsigned n = 0; n < (unsigned)XYZA_AXIS_COUNT * XYZA_ITEM_COUNT; n++) {
		if (++turn->item >= XYZA_ITEM_COUNT) {
			turn->item = 0;
			turn->axis = (turn->axis + 1) % XYZA_AXIS_COUNT;
		}
		if (is_in_turn(first, turn->axis, turn->item))
			return true;
	}
	return false;
}

struct xyza_request xyza_turn_request(const struct db_device *first)
{
	const struct xyza_turn *turn = &first->turn;
	struct xyza_request request = { .verb = XYZA_READ_ITEM };

	// NOLINTNEXTLINE(clang-analyzer-optin.core.EnumCastOutOfRange)
	request.axis = (enum xyza_axis)turn->axis;
	request.item = item_of(turn);
	return request;
}

void xyza_turn_answered(struct db_device *first, uint32_t content, db_time now)
{
	struct xyza_turn *turn = &first->turn;
	struct db_device *owner = item_owner(first, turn->axis, item_of(turn));

	*(turn->of_enable ? &turn->enable_losses : &turn->losses) = 0;
	if (owner)
		xyza_learn_item(owner, item_of(turn), content, now);
}
