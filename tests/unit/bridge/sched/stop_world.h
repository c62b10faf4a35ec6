/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Two simulated drives of a family on one line, with the family's own driver and the real schedule, in made-up
 * time: what is lost, late or doubled on the way is the test's. Header only; one thread.
 *
 * The truth is what the drives do, not what the bridge knows of them.
 */
#ifndef DRIVEBRIDGE_TESTS_STOP_WORLD_H
#define DRIVEBRIDGE_TESTS_STOP_WORLD_H

#include "config/config_private.h"
#include "fakes/bus.h"
#include "fuzz/line.h"
#include "sched/change.h"
#include "sim/servo_drive.h"

#include <math.h>

#define MS DB_NS_PER_MS
#define WORLD_DRIVES 2
#define WORLD_REACTION (500 * MS)
#define WORLD_LATENCY_MS 20
#define WORLD_FRAMES 32
#define WORLD_FRAME_MAX 256
#define WORLD_STOPS 24

/* On its way, later than it should be. */
struct world_frame {
	db_time at;
	bool to_drive;
	size_t length;
	uint8_t bytes[WORLD_FRAME_MAX];
};

/* A command that was posted. */
struct world_ticket {
	size_t drive;
	enum db_command command;
	enum db_result result; /* NONE: it waits */
	db_time posted;
	db_time answered;
};

struct world {
	enum family family;
	struct fake_bus *bus;
	struct line line;
	bool up;
	struct world_frame late[WORLD_FRAMES];
	size_t late_count;
	struct world_ticket tickets[WORLD_STOPS];
	size_t ticket_count;

	db_time stop_sent[WORLD_DRIVES]; /* the last one; 0: none yet */
	unsigned stops[WORLD_DRIVES];    /* so many were sent */

	/* The test's own; null where it has none. True: the frame goes its way now. */
	void *context;
	bool (*on_request)(void *context, size_t drive, bool stop, const uint8_t *bytes,
	                   size_t length);
	bool (*on_answer)(void *context, size_t drive, const uint8_t *bytes, size_t length);
	void (*on_result)(void *context, const struct world_ticket *ticket);
	void (*watch)(void *context);
	db_time (*next)(void *context);
};

/* Read once: what no story changes. The caller's of world_free_configs(). */
static inline struct db_config *world_config(enum family family)
{
	static struct db_config *configs[FAMILIES];

	if (!configs[family])
		must(db_load_text(&db_load_built_in, line_configs[family], "f", stderr,
		                  &configs[family]) == 0);
	return configs[family];
}

static inline void world_free_configs(void)
{
	for (enum family family = 0; family < FAMILIES; family++)
		db_config_free(world_config(family));
}

/* --- the truth ------------------------------------------------------------------------------------- */

/* In the family's own unit, without direction. */
static inline double world_speed(struct world *world, size_t drive)
{
	struct sim_node *node = &world->line.nodes[drive];
	struct vsmd_status status;
	db_time now = world->bus->now;

	if (node->drive) {
		sim_vsmd_status(node->drive, now, &status);
		return fabs((double)status.velocity);
	}
	if (node->xyza) {
		sim_xyza_advance(node->xyza, now);
		return fabs(sim_xyza_axis_state(node->xyza, XYZA_X).speed);
	}
	sim_servo_advance(world->line.servos[drive].drive, now);
	return fabs(world->line.servos[drive].drive->rpm);
}

/* As fast as it is told to be. */
static inline float world_top_speed(const struct world *world)
{
	return world->family == FAMILY_SERVO ? 1000.0f : 3000.0f;
}

/* A shaft that creeps to its place is not a motor that runs. */
static inline bool world_moves(struct world *world, size_t drive)
{
	return world_speed(world, drive) > (double)world_top_speed(world) / 200;
}

/* --- the way there and back ------------------------------------------------------------------------- */

/* These bytes come after so much time. */
static inline void world_delay(struct world *world, bool to_drive, const uint8_t *bytes,
                               size_t length, db_time after)
{
	struct world_frame *frame = &world->late[world->late_count++];

	must(world->late_count <= WORLD_FRAMES && length <= sizeof frame->bytes);
	frame->at = world->bus->now + after;
	frame->to_drive = to_drive;
	frame->length = length;
	memcpy(frame->bytes, bytes, length);
}

static inline void world_note_stop(struct world *world, const struct said *said)
{
	for (size_t i = 0; i < WORLD_DRIVES; i++) {
		if (!said->stop || (said->address != LINE_ALL && said->address != i + 1))
			continue;
		world->stop_sent[i] = world->bus->now;
		world->stops[i]++;
	}
}

static inline db_time world_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	size_t step = world->line.can ? sizeof(struct db_can_frame) : length;

	must(world->up && length > 0);
	for (size_t at = 0; at < length; at += step) {
		struct said said = line_read(&world->line, bytes + at, step);
		/* What is for all goes the first one's way. */
		size_t drive = said.address == LINE_ALL ? 0 : said.address - 1;

		must(drive < WORLD_DRIVES);
		world_note_stop(world, &said);
		if (!world->on_request ||
		    world->on_request(world->context, drive, said.stop, bytes + at, step))
			line_hear(&world->line, bytes + at, step, world->bus->now);
	}
	return world->bus->now;
}

static inline void world_tell(void *context, const struct db_drive_config *drive,
                              enum db_event event, const struct db_feedback *feedback,
                              const struct db_outage *outage)
{
	(void)outage;
	(void)feedback;
	must(context && drive && event < DB_EVENT_COUNT);
}

/* Who says this on a line of CAN; on serial lines faults are the simulator's. */
static inline bool world_takes_answer(struct world *world, const uint8_t *bytes, size_t length)
{
	const struct db_bus_config *config = &world->bus->config;
	int address = -1;

	if (!world->on_answer || !world->line.can ||
	    config->driver->accept(config, bytes, length, &address) != DB_FRAME_GOOD)
		return true;
	return world->on_answer(world->context, (size_t)address - 1, bytes, length);
}

static inline void world_hear(struct world *world, const uint8_t *bytes, size_t length)
{
	if (world->up)
		fake_receive(world->bus, bytes, length);
}

static inline void world_deliver_late(struct world *world)
{
	for (size_t i = 0; i < world->late_count;) {
		struct world_frame frame = world->late[i];

		if (frame.at > world->bus->now) {
			i++;
			continue;
		}
		world->late[i] = world->late[--world->late_count];
		if (frame.to_drive)
			line_hear(&world->line, frame.bytes, frame.length, world->bus->now);
		else
			world_hear(world, frame.bytes, frame.length);
	}
}

static inline void world_happen(void *context)
{
	struct world *world = context;
	uint8_t bytes[WORLD_FRAME_MAX];
	size_t length;

	world_deliver_late(world);
	while ((length = line_say(&world->line, world->bus->now, bytes, sizeof bytes)) > 0) {
		if (world_takes_answer(world, bytes, length))
			world_hear(world, bytes, length);
	}
}

static inline db_time world_next(void *context)
{
	struct world *world = context;
	db_time next = line_next(&world->line);
	db_time own = world->next ? world->next(world->context) : DB_TIME_NEVER;

	for (size_t i = 0; i < world->late_count; i++)
		next = world->late[i].at < next ? world->late[i].at : next;
	return own < next ? own : next;
}

static inline void world_collect(struct world *world)
{
	struct db_request completion;

	while (fake_collect(world->bus->queue, &completion)) {
		struct world_ticket *ticket = &world->tickets[completion.ticket - 1];

		must(completion.ticket >= 1 && completion.ticket <= world->ticket_count);
		must(ticket->result == DB_RESULT_NONE);
		ticket->result = completion.result;
		ticket->answered = world->bus->now;
		if (world->on_result)
			world->on_result(world->context, ticket);
	}
}

static inline void world_turned(void *context)
{
	struct world *world = context;

	world_collect(world);
	if (world->watch)
		world->watch(world->context);
}

/* --- what is asked of it ----------------------------------------------------------------------------- */

static inline struct world_ticket *world_post(struct world *world, size_t drive,
                                              enum db_command command)
{
	struct world_ticket *ticket = &world->tickets[world->ticket_count++];
	struct db_request request = {
		.ticket = (uint32_t)world->ticket_count,
		.drive = (uint16_t)drive,
		.command = command,
		.args = &(struct db_args){ .target_velocity = world_top_speed(world) },
		.submitted = world->bus->now,
	};

	must(world->ticket_count <= WORLD_STOPS);
	*ticket = (struct world_ticket){ .drive = drive,
		                         .command = command,
		                         .posted = world->bus->now };
	must(db_queue_post(world->bus->queue, &request));
	return ticket;
}

static inline void world_set_port(struct world *world, bool up)
{
	world->up = up;
	fake_port(world->bus, up ? 0 : 5);
}

/* As if unplugged, with its motor going on. */
static inline void world_silence(struct world *world, size_t drive, bool silent)
{
	world->line.nodes[drive].faults.left[SIM_FAULT_SILENCE] = silent ? -1 : 0;
}

/* --- its life -------------------------------------------------------------------------------------- */

static const struct db_engine_ops world_ops = { .send = world_send, .on_event = world_tell };

/* Both drives stand, and begin a motion so late; their port is down. */
static inline void world_open(struct world *world, enum family family, db_time motion_delay)
{
	const struct db_config *config = world_config(family);
	struct fake_bus *bus = fake_bus_new(config->buses[0].driver, WORLD_DRIVES);

	*world = (struct world){ .family = family, .bus = bus };
	bus->config = config->buses[0];
	bus->config.cycle_ms = 20;
	bus->config.drive_latency_ms = WORLD_LATENCY_MS;
	if (bus->config.driver->medium == DB_MEDIUM_SERIAL)
		bus->config.baud = 115200;
	bus->context = world;
	bus->next = world_next;
	bus->happen = world_happen;
	bus->turned = world_turned;
	line_open(&world->line, family, &bus->config, WORLD_DRIVES, motion_delay, bus->now);
	for (size_t i = 0; i < WORLD_DRIVES; i++) {
		/* The second axis of a controller is no neighbour on the line. */
		bus->drives[i] = config->drives[family == FAMILY_XYZA ? 2 * i : i];
		bus->drives[i].stop_reaction_ms = WORLD_REACTION / MS;
		bus->drives[i].on_exit = DB_ON_LOSS_STOP;
	}
	fake_bus_open(bus, WORLD_DRIVES, &world_ops);
}

static inline void world_close(struct world *world)
{
	fake_bus_free(world->bus);
	line_close(&world->line);
}

static inline bool world_awaits(const struct world *world)
{
	for (size_t i = 0; i < world->ticket_count; i++) {
		if (world->tickets[i].result == DB_RESULT_NONE)
			return true;
	}
	return false;
}

static inline void world_wait(struct world *world)
{
	db_time end = world->bus->now + 10 * DB_NS_PER_S;

	while (world_awaits(world) && world->bus->now < end)
		fake_pass(world->bus, 5 * MS);
}

/* Both are there and have power. */
static inline void world_enable(struct world *world)
{
	world_set_port(world, true);
	while (!fake_is_online(world->bus, 0) || !fake_is_online(world->bus, 1))
		fake_pass(world->bus, 10 * MS);
	world_post(world, 0, DB_CMD_ENABLE);
	world_post(world, 1, DB_CMD_ENABLE);
	world_wait(world);
}

/* From here to the last drive, until they move as fast as they were told. */
static inline void world_set_going(struct world *world, size_t first)
{
	db_time end = world->bus->now + 10 * DB_NS_PER_S;

	for (size_t i = first; i < WORLD_DRIVES; i++)
		world_post(world, i, DB_CMD_MOVE_VELOCITY);
	world_wait(world);
	for (size_t i = first; i < WORLD_DRIVES; i++) {
		while (world_speed(world, i) < 0.99 * (double)world_top_speed(world)) {
			must(world->bus->now < end);
			fake_pass(world->bus, 10 * MS);
		}
	}
}

#endif
