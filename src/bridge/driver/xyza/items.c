/* SPDX-License-Identifier: Apache-2.0 */
#include "driver/xyza/xyza_private.h"

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

enum db_step xyza_read_items(struct db_conversation *talk, unsigned item)
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
	return xyza_read_items(talk, item + 1);
}

/* The other items are useful without it. */
static enum db_step skip_item(struct db_conversation *talk)
{
	unsigned item = reading_of(talk)->item;

	xyza_forget_item(talk->device, (enum xyza_item)item);
	return xyza_read_items(talk, item + 1);
}

/* The controller is there, it only does not answer this. A single loss may be the line's. */
static enum db_step lose_item(struct db_conversation *talk)
{
	if (++reading_of(talk)->losses >= XYZA_ITEM_TRIES)
		return skip_item(talk);
	return send_step(talk, xyza_item_steps, STEP_ITEM);
}

const struct conversation_step xyza_item_steps[] = {
	[STEP_ITEM] = { .send = send_item,
	                .answered = answer_item,
	                .refused = skip_item,
	                .lost = lose_item },
};
