/* SPDX-License-Identifier: Apache-2.0 */
#include "fakes/bus.h"

#include "fakes/must.h"
#include "sched/sched_private.h"

#include <math.h>
#include <string.h>

/* Most calls of the engine within a microsecond. */
#define CALLS_MAX 1000

/* --- the drives' side ------------------------------------------------------------------------- */

static db_time obey_commands(struct fake_bus *bus, struct fake_frame *frame)
{
	float *speed = &bus->speed[frame->address][frame->axis];

	if (frame->kind == FAKE_COMMAND)
		*speed = 1.0f;
	else if (frame->kind == FAKE_STOP || frame->kind == FAKE_DISABLE)
		*speed = 0.0f;
	frame->speed = *speed;
	return bus->answer_time;
}

static db_time take_frame_byte(void *context, const uint8_t *bytes, size_t length)
{
	struct fake_bus *bus = context;
	struct fake_frame frame = fake_frame_at(bytes, length);
	db_time after;

	if (bus->sent_count == bus->sent_size) {
		bus->sent_size = bus->sent_size ? 2 * bus->sent_size : 256;
		bus->sent = realloc(bus->sent, bus->sent_size * sizeof *bus->sent);
		must(bus->sent);
	}
	bus->sent[bus->sent_count++] = (struct fake_sent){ bus->now, frame };
	/* Broadcasts are not answered. */
	if (frame.address == FAKE_ALL)
		return bus->now;
	must(frame.address <= FAKE_DRIVES && frame.axis < DB_AXES_MAX);
	if (bus->dead[frame.address])
		return bus->now;
	after = bus->obey ? bus->obey(bus->context, &frame) : obey_commands(bus, &frame);
	if (after > 0)
		fake_answer_after(bus, after, &frame, sizeof frame);
	return bus->now;
}

static void count_event(void *context, const struct db_drive_config *drive, enum db_event event,
                        const struct db_feedback *feedback, const struct db_outage *outage)
{
	struct fake_bus *bus = context;

	(void)outage;
	must(drive && feedback && event < DB_EVENT_COUNT);
	bus->told[event]++;
}

static const struct db_engine_ops frame_ops = { .send = take_frame_byte, .on_event = count_event };

/* --- making and freeing
 * ------------------------------------------------------------------------ */

struct fake_bus *fake_bus_new(const struct db_driver *driver, size_t drives)
{
	struct fake_bus *bus = malloc(sizeof *bus);

	must(bus && drives <= FAKE_DRIVES);
	*bus = (struct fake_bus){
		.config = {
			.name = (char *)"test",
			.driver = driver,
			.transport = &fake_wire,
			.cycle_ms = 20,
			.drive_latency_ms = 10,
			.retries = 2,
			.queue = 8,
		},
		.drive_count = drives,
		.now = FAKE_BEGIN_TIME,
		.answer_time = FAKE_ANSWER_TIME,
	};
	bus->config.options = bus->options.bus;
	for (size_t i = 0; i < drives; i++) {
		bus->drives[i] = (struct db_drive_config){
			.name = (char *)"d",
			.address = (unsigned)i + 1,
			.options = bus->options.drive,
			.on_exit = DB_ON_LOSS_STOP,
			.stop_reaction_ms = 1000,
			.counts_per_unit = 1.0,
			.min_position = NAN,
			.max_position = NAN,
		};
		bus->list[i] = (struct db_bus_drive){ (uint16_t)i, &bus->drives[i],
			                              db_axis_new(driver->param_count) };
		must(bus->list[i].axis);
	}
	return bus;
}

void fake_option(struct fake_bus *bus, const char *name, double value)
{
	fake_set_option(bus->config.driver, &bus->options, name, value);
}

void fake_bus_open(struct fake_bus *bus, size_t drives, const struct db_engine_ops *ops)
{
	void *context = ops ? bus->context : bus;

	must(db_queue_new(bus->config.queue, bus->drive_count, &bus->queue) == 0);
	must(db_engine_new(&bus->config, bus->list, drives, bus->queue, ops ? ops : &frame_ops,
	                   context, &bus->engine) == 0);
}

void fake_bus_free(struct fake_bus *bus)
{
	db_engine_free(bus->engine);
	db_queue_free(bus->queue);
	for (size_t i = 0; i < bus->drive_count; i++)
		db_axis_free(bus->list[i].axis);
	free(bus->sent);
	free(bus);
}

/* --- time ------------------------------------------------------------------------------------- */

void fake_port(struct fake_bus *bus, int error)
{
	db_engine_port(bus->engine, error == 0, error, bus->now);
}

void fake_receive(struct fake_bus *bus, const void *bytes, size_t length)
{
	db_engine_receive(bus->engine, bytes, length, bus->now);
}

void fake_answer_after(struct fake_bus *bus, db_time after, const void *bytes, size_t length)
{
	struct fake_answer *answer;

	if (bus->config.driver->medium == DB_MEDIUM_SERIAL)
		bus->answer_count = 0;
	answer = &bus->answers[bus->answer_count++];
	must(bus->answer_count <= FAKE_ANSWERS && length <= sizeof answer->bytes);
	answer->at = bus->now + after;
	answer->length = length;
	memcpy(answer->bytes, bytes, length);
}

/* The answer that is due first; null when none is on its way. */
static struct fake_answer *first_answer(struct fake_bus *bus)
{
	struct fake_answer *first = NULL;

	for (size_t i = 0; i < bus->answer_count; i++) {
		if (!first || bus->answers[i].at < first->at)
			first = &bus->answers[i];
	}
	return first;
}

static db_time call_engine(struct fake_bus *bus)
{
	db_time next = db_engine_run(bus->engine, bus->now);

	must(next > bus->now);
	if (bus->now - bus->counted_from >= DB_NS_PER_US) {
		bus->counted_from = bus->now;
		bus->calls = 0;
	}
	must(++bus->calls < CALLS_MAX);
	if (bus->turned)
		bus->turned(bus->context);
	return next;
}

void fake_pass(struct fake_bus *bus, db_time span)
{
	db_time end = bus->now + span;

	while (bus->now < end) {
		db_time next = call_engine(bus);
		db_time own = bus->next ? bus->next(bus->context) : DB_TIME_NEVER;
		struct fake_answer *answer = first_answer(bus);

		next = next < end ? next : end;
		next = next < own ? next : own;
		if (answer && answer->at <= next) {
			struct fake_answer due = *answer;

			*answer = bus->answers[--bus->answer_count];
			bus->now = due.at > bus->now ? due.at : bus->now;
			fake_receive(bus, due.bytes, due.length);
		} else if (next > bus->now) {
			bus->now = next;
		}
		if (bus->happen)
			bus->happen(bus->context);
	}
}

void fake_settle(struct fake_bus *bus)
{
	fake_pass(bus, 300 * DB_NS_PER_MS);
	while (bus->engine->flights > 0 || bus->engine->nodes_due > 0)
		fake_pass(bus, DB_NS_PER_MS / 10);
	bus->engine->cycle_at = bus->now + 10 * DB_NS_PER_S;
	fake_pass(bus, 100 * DB_NS_PER_MS);
}

db_time fake_answer_nothing(void *context, struct fake_frame *frame)
{
	(void)context;
	(void)frame;
	return 0;
}

/* --- requests --------------------------------------------------------------------------------- */

uint32_t fake_ticket(size_t drive, enum db_command command)
{
	return 1 + DB_CMD_LIMIT * (uint32_t)drive + (uint32_t)command;
}

void fake_request(struct fake_bus *bus, size_t drive, struct db_request request)
{
	request.ticket = fake_ticket(drive, request.command);
	request.drive = bus->list[drive].drive;
	request.submitted = bus->now;
	must(db_queue_post(bus->queue, &request));
}

void fake_post(struct fake_bus *bus, size_t drive, enum db_command command)
{
	fake_request(bus, drive, (struct db_request){ .command = command });
}

bool fake_collect(struct db_queue *queue, struct db_request *ended)
{
	struct db_request *request = db_queue_collect(queue);

	if (!request)
		return false;
	*ended = *request;
	db_queue_release(request);
	return true;
}

enum db_result fake_result(struct fake_bus *bus)
{
	struct db_request ended;

	return fake_collect(bus->queue, &ended) ? (enum db_result)ended.result : DB_RESULT_NONE;
}

/* --- what tests check
 * -------------------------------------------------------------------------- */

struct db_snapshot fake_snapshot(const struct fake_bus *bus, size_t drive)
{
	struct db_snapshot snapshot;

	db_axis_read(bus->list[drive].axis, &snapshot);
	return snapshot;
}

struct db_feedback fake_feedback(const struct fake_bus *bus, size_t drive)
{
	return fake_snapshot(bus, drive).feedback;
}

bool fake_is_online(const struct fake_bus *bus, size_t drive)
{
	return fake_feedback(bus, drive).status & DB_STATUS_ONLINE;
}

struct db_bus_stats fake_stats(const struct fake_bus *bus)
{
	struct db_bus_stats stats;

	db_engine_stats(bus->engine, &stats);
	return stats;
}

unsigned fake_count(const struct fake_bus *bus, unsigned address, enum fake_kind kind)
{
	unsigned found = 0;

	for (size_t i = 0; i < bus->sent_count; i++)
		found += bus->sent[i].frame.address == address && bus->sent[i].frame.kind == kind;
	return found;
}

void fake_forget_sent(struct fake_bus *bus)
{
	bus->sent_count = 0;
}
