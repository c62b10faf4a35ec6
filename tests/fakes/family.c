/* SPDX-License-Identifier: Apache-2.0 */
#include "fakes/family.h"

#include "codec/can.h"
#include "fakes/must.h"

#include <math.h>
#include <string.h>

_Static_assert(sizeof(struct fake_frame) == sizeof(struct db_can_frame), "cut like a CAN frame");

struct fake_frame fake_frame_at(const uint8_t *bytes, size_t length)
{
	struct fake_frame frame;

	must(length == sizeof frame);
	memcpy(&frame, bytes, sizeof frame);
	return frame;
}

enum fake_kind fake_kind_of(const struct db_job *job)
{
	switch (job->kind) {
	case DB_JOB_PROBE:
		return FAKE_PROBE;
	case DB_JOB_IDENTIFY:
		return FAKE_IDENTIFY;
	case DB_JOB_POLL:
		return FAKE_POLL;
	default:
		return job->request->command == DB_CMD_DISABLE   ? FAKE_DISABLE :
		       db_command_is_stop(job->request->command) ? FAKE_STOP :
		                                                   FAKE_COMMAND;
	}
}

enum db_step fake_say(struct db_conversation *talk, enum fake_kind kind)
{
	const struct db_job *job = talk->job;
	struct fake_frame frame = {
		.address = talk->device->address,
		.kind = (uint8_t)kind,
		.axis = talk->device->axis,
		.target = job->kind == DB_JOB_COMMAND ? job->request->args->target_position : 0,
	};

	talk->device->parts = 0;
	memcpy(talk->exchange->request, &frame, sizeof frame);
	talk->exchange->request_length = talk->exchange->answer_length = sizeof frame;
	talk->exchange->extra_time = 0;
	talk->exchange->repeatable = true;
	return DB_STEP_SEND;
}

void fake_write_inquiry(const struct db_inquiry *inquiry, struct db_exchange *exchange)
{
	const struct fake_frame frame = { .address = (uint8_t)inquiry->address,
		                          .kind = FAKE_INQUIRY,
		                          .target = (int32_t)inquiry->kind };

	memcpy(exchange->request, &frame, sizeof frame);
	exchange->request_length = exchange->answer_length = sizeof frame;
	exchange->extra_time = 0;
}

struct fake_bus_options {
	double poll_exchanges;
};

static const struct db_option options[] = {
	{
		.section = "bus",
		.name = "poll-exchanges",
		.offset = offsetof(struct fake_bus_options, poll_exchanges),
		.words = "",
		.preset = "1",
		.min = 0,
		.max = 16,
		.whole = true,
		.unit = "",
		.description = "Exchanges of a poll",
	},
};

static unsigned poll_exchanges(const struct db_bus_config *bus)
{
	const struct fake_bus_options *own = bus->options;

	return own->poll_exchanges > 1 ? (unsigned)own->poll_exchanges : 1;
}

static void init(struct db_device *device, struct db_device *first, const struct db_bus_config *bus,
                 const struct db_drive_config *drive)
{
	device->first = first ? first : device;
	device->address = (uint8_t)drive->address;
	device->axis = (uint8_t)drive->axis;
	device->poll_exchanges = poll_exchanges(bus);
	device->first->axes[device->axis] = device;
}

static void leave(struct db_device *device)
{
	device->first->axes[device->axis] = NULL;
}

static enum db_frame accept_frame(const struct db_bus_config *bus, const uint8_t *bytes,
                                  size_t length, int *address)
{
	struct fake_frame frame = fake_frame_at(bytes, length);

	(void)bus;
	if (frame.kind == FAKE_FOREIGN)
		return DB_FRAME_FOREIGN;
	*address = frame.address;
	return frame.address == 0 ? DB_FRAME_BAD : DB_FRAME_GOOD;
}

static void cut(const struct db_received *received, size_t *skip, size_t *length)
{
	db_can_cut(received->bytes, received->available, skip, length);
}

static enum db_step begin(struct db_conversation *talk)
{
	talk->job->step = 0;
	return fake_say(talk, fake_kind_of(talk->job));
}

static void end_poll(struct db_device *first, db_time now)
{
	for (unsigned i = 0; i < DB_AXES_MAX; i++) {
		if (!first->axes[i])
			continue;
		first->axes[i]->polls++;
		first->axes[i]->taken = now;
	}
}

static enum db_step answer(struct db_conversation *talk, const uint8_t *bytes, size_t length)
{
	struct fake_frame frame = fake_frame_at(bytes, length);
	enum fake_kind kind = fake_kind_of(talk->job);
	struct db_device *device = talk->device;

	if (frame.kind != kind)
		return DB_STEP_IGNORE;
	if (++device->parts < frame.parts)
		return DB_STEP_MORE;
	device->speed = frame.speed;
	device->powered = frame.powered;
	if (kind == FAKE_POLL && ++talk->job->step < device->poll_exchanges)
		return fake_say(talk, FAKE_POLL);
	if (kind == FAKE_POLL)
		end_poll(device->first, talk->now);
	device->identified |= kind == FAKE_IDENTIFY;
	talk->result = frame.refused                           ? DB_RESULT_REFUSED :
	               kind == FAKE_DISABLE && device->powered ? DB_RESULT_FAILED :
	                                                         DB_RESULT_OK;
	return DB_STEP_DONE;
}

static enum db_step lost(struct db_conversation *talk)
{
	talk->result = DB_RESULT_TIMEOUT;
	return DB_STEP_DONE;
}

static void gone(struct db_device *device)
{
	device->identified = false;
}

static void feedback(const struct db_device *device, struct db_feedback *feedback)
{
	bool moves = fabsf(device->speed) > 0.0f;

	feedback->taken = device->taken;
	feedback->position = (int32_t)device->polls;
	feedback->velocity = device->speed;
	feedback->state = device->taken == 0 ? DB_AXIS_OFFLINE :
	                  moves              ? DB_AXIS_CONTINUOUS_MOTION :
	                                       DB_AXIS_STANDSTILL;
	feedback->error = DB_ERROR_NONE;
	feedback->status = (device->identified ? DB_STATUS_PARAMS_VALID : 0) |
	                   (device->powered ? DB_STATUS_ENABLED : 0) |
	                   (moves ? DB_STATUS_MOVING : 0);
}

/* For a drive with the response time of those in fakes/bus.h. */
static db_time poll_time(const struct db_bus_config *bus)
{
	db_time exchanges = poll_exchanges(bus);

	return exchanges * (FAKE_ANSWER_TIME + (db_time)bus->turnaround_us * DB_NS_PER_US);
}

static db_time command_time(const struct db_bus_config *bus)
{
	return FAKE_ANSWER_TIME + (db_time)bus->turnaround_us * DB_NS_PER_US;
}

const struct db_driver fake_family = {
	.poll_time = poll_time,
	.command_time = command_time,
	.name = "fake",
	.title = "Made-up drives",
	.options = options,
	.option_count = 1,
	.bus_options_size = sizeof(struct fake_bus_options),
	.medium = DB_MEDIUM_SERIAL,
	.axes = DB_AXES_MAX,
	.acknowledges = true,
	.device_size = sizeof(struct db_device),
	.init = init,
	.leave = leave,
	.cut = cut,
	.accept = accept_frame,
	.begin = begin,
	.answer = answer,
	.lost = lost,
	.gone = gone,
	.feedback = feedback,
};

static db_time wire_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	(void)bus;
	(void)request;
	(void)request_length;
	(void)answer_length;
	return FAKE_WIRE_TIME;
}

const struct db_transport fake_wire = { .medium = DB_MEDIUM_SERIAL, .wire_time = wire_time };
