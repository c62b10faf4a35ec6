/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Simulated servos on a simulated CAN wire with 1 Mbit/s: first a node's frames alone, then the
 * scheduler and the driver in front of several. In made-up time.
 */
#include "codec/can.h"
#include "driver/list.h"
#include "fakes/bus.h"
#include "fakes/options.h"
#include "sched/engine.h"
#include "sim/can_bus.h"
#include "sim/servo_can_node.h"
#include "sim/servo_drive.h"
#include "transport/transport_private.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define US DB_NS_PER_US
#define BIT_RATE 1000000
#define NODES 29
#define LATENCY (100 * US)
#define WORDS_BASE 0x0A0
#define WORDS_ACK 7

static const struct servo_can_layout layout = {
	.ack_base = SERVO_CAN_BASE_ACK,
	.words = { .set = true,
	           .base = WORDS_BASE,
	           .length = 4,
	           .word0 = 0,
	           .word1 = 2,
	           .ack = WORDS_ACK },
};

/* --- a node alone -------------------------------------------------------------------------------- */

struct alone {
	struct sim_servo *drive;
	struct sim_servo_node node;
	db_time now;
};

static struct alone make_alone(void)
{
	struct alone alone = { .now = 1000 * MS };
	struct sim_servo_config config;

	sim_servo_config_init(&config);
	config.start = -2;
	alone.drive = sim_servo_new(&config, alone.now);
	assert_non_null(alone.drive);
	alone.node = (struct sim_servo_node){
		.drive = alone.drive, .address = 5, .layout = layout, .latency = LATENCY
	};
	return alone;
}

static void hear(struct alone *alone, uint32_t id, uint8_t length, const uint8_t *data)
{
	struct db_can_frame frame = { .id = id, .length = length };

	if (length > 0)
		memcpy(frame.data, data, length);
	sim_servo_node_receive(&alone->node, &frame, alone->now);
}

static void expect(struct alone *alone, uint32_t id, uint8_t length, const uint8_t *data)
{
	struct db_can_frame frame;

	assert_true(sim_servo_node_send(&alone->node, alone->now, &frame));
	assert_int_equal(frame.id, id);
	assert_int_equal(frame.length, length);
	assert_memory_equal(frame.data, data, length);
}

#define BYTES(...)                                              \
	(sizeof((uint8_t[]){ __VA_ARGS__ })), (const uint8_t[]) \
	{                                                       \
		__VA_ARGS__                                     \
	}

/* A stray acknowledgement, and behind it the right one. */
static void a_node_may_acknowledge_something_else_first(void **state)
{
	struct alone alone = make_alone();
	struct db_can_frame frame;

	(void)state;
	alone.node.stray_acks = true;
	hear(&alone, 0x025, BYTES(0x00, 0x0A));
	alone.now += LATENCY;
	expect(&alone, 0x006, BYTES(0x02));
	expect(&alone, 0x006, BYTES(0x01));
	hear(&alone, 0x085, BYTES(0, 0, 0, 5));
	alone.now += LATENCY;
	expect(&alone, 0x006, BYTES(0x01));
	expect(&alone, 0x006, BYTES(0x06));
	assert_false(sim_servo_node_send(&alone.node, alone.now, &frame));
	free(alone.drive);
}

static void a_node_answers_its_own_frames(void **state)
{
	struct alone alone = make_alone();
	struct db_can_frame frame;

	(void)state;
	hear(&alone, 0x025, BYTES(0, 10));
	assert_int_equal(sim_servo_node_next(&alone.node), alone.now + LATENCY);
	assert_false(sim_servo_node_send(&alone.node, alone.now, &frame));
	alone.now += LATENCY;
	expect(&alone, 0x006, BYTES(1));
	assert_false(sim_servo_node_send(&alone.node, alone.now, &frame));
	hear(&alone, 0x145, BYTES(0));
	hear(&alone, 0x0A5, BYTES(0, 0, 0, 0));
	alone.now += LATENCY;
	expect(&alone, 0x165, BYTES(0xFF, 0xFF, 0xFF, 0xFE));
	expect(&alone, 0x185, BYTES(0, 0, 0, 0));
	expect(&alone, 0x1A5, BYTES(0x00, 0x14, 0, 0)); /* not shown as enabled yet */
	expect(&alone, 0x006, BYTES(WORDS_ACK));
	/* Another's, another's command words, and what nobody documents. */
	hear(&alone, 0x024, BYTES(0, 1));
	hear(&alone, 0x0C5, BYTES(0, 0, 0, 0));
	assert_int_equal(alone.node.received, 3);
	hear(&alone, 0x0A5, BYTES(0x80, 0, 0, 0));
	hear(&alone, 0x025, BYTES(0, 2));
	assert_int_equal(alone.node.unknown, 2);
	assert_true(alone.drive->enabled);
	free(alone.drive);
}

static void broadcasts_are_obeyed_in_silence(void **state)
{
	struct alone alone = make_alone();
	struct db_can_frame frame;

	(void)state;
	hear(&alone, 0x020, BYTES(0, 10));
	assert_true(alone.drive->enabled);
	hear(&alone, 0x01F, 0, NULL);
	assert_int_equal(alone.drive->counts[SERVO_CAN_SYNC], 1);
	assert_false(sim_servo_node_send(&alone.node, alone.now + LATENCY, &frame));
	free(alone.drive);
}

static void a_node_reports(void **state)
{
	struct alone alone = make_alone();

	(void)state;
	assert_int_equal(sim_servo_node_next(&alone.node), alone.now + 100 * MS);
	alone.now += 100 * MS;
	expect(&alone, 0x1C5, BYTES(0xFF, 0xFF, 0xFF, 0xFE));
	expect(&alone, 0x1E5, BYTES(0, 0, 0, 0));
	assert_int_equal(alone.node.reports, 2);
	free(alone.drive);
}

/* --- scheduler and driver in front of several -------------------------------------------------------- */

struct world {
	struct db_bus_config bus;
	struct db_drive_config drives[NODES];
	struct fake_options options;
	struct db_bus_drive list[NODES];
	struct db_axis *axes[NODES];
	struct db_queue *queue;
	struct db_engine *engine;
	struct sim_servo *servos[NODES];
	struct sim_servo_node nodes[NODES];
	size_t count;
	db_time now;

	struct sim_can_bus *wire;
	uint32_t lose_id;     /* frames with this id are destroyed ... */
	unsigned lose;        /* ... so many of them */
	unsigned lose_one_in; /* of all frames; 0 = none */
	uint32_t random;
};

static db_time wire_time(const struct db_bus_config *bus, const uint8_t *request,
                         size_t request_length, size_t answer_length)
{
	(void)bus;
	return (db_time)(db_can_wire_bits(request, request_length, answer_length) * DB_NS_PER_S /
	                 BIT_RATE);
}

static const struct db_transport wire = { .medium = DB_MEDIUM_CAN, .wire_time = wire_time };

static bool is_lost(struct world *world, const struct db_can_frame *frame)
{
	world->random = world->random * 1664525u + 1013904223u;
	if (world->lose_one_in > 0 && (world->random >> 16) % world->lose_one_in == 0)
		return true;
	if (world->lose == 0 || frame->id != world->lose_id)
		return false;
	world->lose--;
	return true;
}

static db_time on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;

	for (size_t at = 0; at < length; at += sizeof(struct db_can_frame)) {
		struct db_can_frame frame = db_can_frame_at(bytes, at);

		if (!is_lost(world, &frame))
			assert_true(sim_can_bus_put(world->wire, &frame, world->now));
	}
	return world->now;
}

static const struct db_engine_ops ops = { .send = on_send };

static db_time earlier(db_time a, db_time b)
{
	return a < b ? a : b;
}

static void pass(struct world *world, db_time span)
{
	db_time end = world->now + span;

	while (world->now < end) {
		struct db_can_frame frame;
		db_time next;

		while (sim_can_bus_run(world->wire, world->now, &frame)) {
			if (!is_lost(world, &frame))
				db_engine_receive(world->engine, (const uint8_t *)&frame,
				                  sizeof frame, world->now);
		}
		next = earlier(end, db_engine_run(world->engine, world->now));
		next = earlier(next, sim_can_bus_next(world->wire));
		world->now = next > world->now ? next : world->now + 1;
	}
}

static void option(struct world *world, const char *name, double value)
{
	fake_set_option(&db_driver_servo_can, &world->options, name, value);
}

static struct world *prepare(size_t count, unsigned cycle_ms)
{
	struct world *world = calloc(1, sizeof *world);

	assert_non_null(world);
	world->bus = (struct db_bus_config){
		.name = (char *)"test",
		.driver = &db_driver_servo_can,
		.transport = &wire,
		.bitrate = BIT_RATE,
		.cycle_ms = cycle_ms,
		.drive_latency_ms = 30,
		.retries = 2,
		.queue = 32,
	};
	world->count = count;
	world->now = 1000 * MS;
	world->bus.options = world->options.bus;
	fake_preset_options(&db_driver_servo_can, &world->options);
	option(world, "command-word-base", WORDS_BASE);
	option(world, "command-word-length", 4);
	option(world, "command-word-0-at", 0);
	option(world, "command-word-1-at", 2);
	option(world, "command-word-ack", WORDS_ACK);
	return world;
}

static void start(struct world *world, const struct sim_servo_config *config)
{
	world->wire = sim_can_bus_new(BIT_RATE, NULL, NULL);
	assert_non_null(world->wire);
	for (size_t i = 0; i < world->count; i++) {
		struct sim_can_station station;

		world->drives[i].options = world->options.drive;
		world->drives[i].name = (char *)"d";
		world->drives[i].address = (unsigned)i + 1;
		world->drives[i].stop_reaction_ms = 1000;
		world->axes[i] = db_axis_new(db_driver_servo_can.param_count);
		world->list[i] = (struct db_bus_drive){ (uint16_t)i, &world->drives[i],
			                                world->axes[i] };
		world->servos[i] = sim_servo_new(config, world->now);
		assert_non_null(world->servos[i]);
		world->nodes[i] = (struct sim_servo_node){ .drive = world->servos[i],
			                                   .address = (uint8_t)(i + 1),
			                                   .layout = layout,
			                                   .latency = LATENCY };
		station = sim_servo_node_station(&world->nodes[i]);
		assert_true(sim_can_bus_attach(world->wire, &station));
	}
	assert_int_equal(db_queue_new(32, 8, &world->queue), 0);
	assert_int_equal(db_engine_new(&world->bus, world->list, world->count, world->queue, &ops,
	                               world, &world->engine),
	                 0);
	db_engine_port(world->engine, true, 0, world->now);
	pass(world, 200 * MS);
}

static void drop(struct world *world)
{
	db_engine_free(world->engine);
	db_queue_free(world->queue);
	free(world->wire);
	for (size_t i = 0; i < world->count; i++) {
		db_axis_free(world->axes[i]);
		free(world->servos[i]);
	}
	free(world);
}

static struct world *make(size_t count)
{
	struct world *world = prepare(count, 20);
	struct sim_servo_config config;

	sim_servo_config_init(&config);
	start(world, &config);
	return world;
}

static struct db_feedback feedback(const struct world *world, size_t i)
{
	struct db_snapshot snapshot;

	db_axis_read(world->axes[i], &snapshot);
	return snapshot.feedback;
}

static const char *state_of(const struct world *world, size_t i)
{
	return db_axis_state_name((enum db_axis_state)feedback(world, i).state);
}

static void post(struct world *world, size_t i, enum db_command command, struct db_args args)
{
	struct db_request request = {
		.ticket = (uint32_t)i + 1,
		.drive = (uint16_t)i,
		.command = command,
		.args = &args,
		.submitted = world->now,
	};

	assert_true(db_queue_post(world->queue, &request));
}

static const char *collect(struct world *world, db_time patience)
{
	struct db_request completion;
	db_time until = world->now + patience;

	while (!fake_collect(world->queue, &completion)) {
		if (world->now >= until)
			return "nothing";
		pass(world, MS);
	}
	return db_result_name(completion.result);
}

static const char *command(struct world *world, size_t i, enum db_command code, struct db_args args)
{
	post(world, i, code, args);
	return collect(world, 1000 * MS);
}

#define PLAIN            \
	(struct db_args) \
	{                \
		0        \
	}
#define VELOCITY(rpm)                    \
	(struct db_args)                 \
	{                                \
		.target_velocity = (rpm) \
	}
#define POSITION(counts)                    \
	(struct db_args)                    \
	{                                   \
		.target_position = (counts) \
	}

static void drives_come_online(void **state)
{
	struct world *world = make(3);

	(void)state;
	for (size_t i = 0; i < 3; i++) {
		assert_string_equal(state_of(world, i), "Disabled");
		assert_true(feedback(world, i).status & DB_STATUS_PARAMS_VALID);
		assert_true(world->now - feedback(world, i).taken < 25 * MS);
	}
	sim_servo_power(world->servos[1], false, world->now);
	pass(world, 200 * MS);
	assert_string_equal(state_of(world, 1), "Offline");
	assert_string_equal(state_of(world, 2), "Disabled");
	sim_servo_power(world->servos[1], true, world->now);
	pass(world, 3000 * MS);
	assert_string_equal(state_of(world, 1), "Disabled");
	drop(world);
}

static void a_speed_and_its_stop(void **state)
{
	struct world *world = make(2);

	(void)state;
	assert_string_equal(command(world, 0, DB_CMD_MOVE_VELOCITY, VELOCITY(500)), "refused");
	assert_string_equal(command(world, 0, DB_CMD_ENABLE, PLAIN), "ok");
	assert_string_equal(command(world, 0, DB_CMD_MOVE_VELOCITY, VELOCITY(500)), "ok");
	pass(world, 300 * MS);
	assert_true(fabs((double)feedback(world, 0).velocity - 500) < 3);
	assert_string_equal(state_of(world, 0), "ContinuousMotion");
	assert_string_equal(command(world, 0, DB_CMD_STOP, PLAIN), "ok");
	assert_string_equal(state_of(world, 0), "Stopping");
	pass(world, 300 * MS);
	assert_string_equal(state_of(world, 0), "Standstill");
	assert_true(world->servos[0]->enabled);
	assert_true(world->servos[1]->rpm == 0);
	drop(world);
}

static void power_that_returns_finds_no_old_speed(void **state)
{
	struct world *world = make(1);

	(void)state;
	assert_string_equal(command(world, 0, DB_CMD_ENABLE, PLAIN), "ok");
	assert_string_equal(command(world, 0, DB_CMD_MOVE_VELOCITY, VELOCITY(500)), "ok");
	pass(world, 200 * MS);
	assert_string_equal(command(world, 0, DB_CMD_DISABLE, PLAIN), "ok");
	pass(world, 5000 * MS);
	assert_string_equal(command(world, 0, DB_CMD_ENABLE, PLAIN), "ok");
	pass(world, 500 * MS);
	assert_true(world->servos[0]->rpm == 0);
	assert_string_equal(state_of(world, 0), "Standstill");
	drop(world);
}

static void relative_moves_survive_every_lost_frame(void **state)
{
	/* The target, its acknowledgement (as all others'), the words and answers to reads. */
	static const uint32_t ids[] = { 0x041, 0x081, 0x0A1, 0x002, 0x141, 0x161, 0x1A1 };

	(void)state;
	for (size_t i = 0; i < sizeof ids / sizeof ids[0]; i++) {
		struct world *world = make(1);

		assert_string_equal(command(world, 0, DB_CMD_ENABLE, PLAIN), "ok");
		world->lose_id = ids[i];
		for (unsigned skip = 0; skip < 4; skip++) {
			world->lose = 1;
			assert_string_equal(command(world, 0, DB_CMD_MOVE_RELATIVE, POSITION(3000)),
			                    "ok");
			pass(world, 2000 * MS);
		}
		assert_true(world->servos[0]->position == 4 * 3000);
		assert_int_equal(feedback(world, 0).position, 4 * 3000);
		assert_true(feedback(world, 0).status & DB_STATUS_AT_TARGET);
		assert_string_equal(state_of(world, 0), "Standstill");
		drop(world);
	}
}

/* Until it stands, online and with power, on a wire that loses nothing. */
static void recover(struct world *world)
{
	world->lose_one_in = 0;
	for (int i = 0; i < 10 && strcmp(state_of(world, 0), "Standstill") != 0; i++) {
		pass(world, 3000 * MS);
		if (strcmp(state_of(world, 0), "Disabled") == 0)
			command(world, 0, DB_CMD_ENABLE, PLAIN);
	}
	assert_string_equal(state_of(world, 0), "Standstill");
}

/* Whatever is lost: what is said to have been done was done, once. */
static void relative_moves_on_a_bad_wire(void **state)
{
	unsigned carried_out = 0;

	(void)state;
	for (uint32_t seed = 1; seed <= 12; seed++) {
		struct world *world = make(1);

		world->random = seed;
		for (int i = 0; i < 10; i++) {
			uint32_t moves = world->servos[0]->moves;
			double from = world->servos[0]->position;
			const char *result;

			recover(world);
			world->lose_one_in = 10;
			post(world, 0, DB_CMD_MOVE_RELATIVE, POSITION(1000));
			result = collect(world, 60000 * MS);
			pass(world, 2000 * MS);
			moves = world->servos[0]->moves - moves;
			if (strcmp(result, "ok") == 0) {
				assert_int_equal(moves, 1);
				assert_true(world->servos[0]->position == from + 1000);
				carried_out++;
			} else if (strcmp(result, "indeterminate") != 0) {
				assert_int_equal(moves, 0);
			}
			assert_true(moves <= 1);
		}
		drop(world);
	}
	assert_true(carried_out > 60);
}

static void stopping_a_move_takes_the_power(void **state)
{
	struct world *world = make(2);

	(void)state;
	assert_string_equal(command(world, 1, DB_CMD_ENABLE, PLAIN), "ok");
	assert_string_equal(command(world, 1, DB_CMD_MOVE_ABSOLUTE, POSITION(500000)), "ok");
	assert_string_equal(state_of(world, 1), "DiscreteMotion");
	pass(world, 200 * MS);
	assert_string_equal(command(world, 1, DB_CMD_MOVE_ABSOLUTE, POSITION(0)), "busy");
	assert_string_equal(command(world, 1, DB_CMD_STOP, PLAIN), "ok");
	assert_false(world->servos[1]->enabled);
	assert_string_equal(state_of(world, 1), "Disabled");
	pass(world, 3000 * MS);
	/* And everything can begin again. */
	assert_string_equal(command(world, 1, DB_CMD_ENABLE, PLAIN), "ok");
	pass(world, 100 * MS);
	assert_true(world->servos[1]->rpm == 0);
	assert_string_equal(command(world, 1, DB_CMD_MOVE_ABSOLUTE, POSITION(0)), "ok");
	pass(world, 4000 * MS);
	assert_true(world->servos[1]->position == 0);
	assert_int_equal(world->servos[1]->moves, 2);
	drop(world);
}

static void faults_show_by_name(void **state)
{
	struct world *world = make(1);

	(void)state;
	sim_servo_set_faults(world->servos[0], SERVO_CAN_FAULT_PHASE, world->now);
	pass(world, 1100 * MS);
	assert_string_equal(state_of(world, 0), "ErrorStop");
	assert_string_equal(db_error_name(&db_driver_servo_can, feedback(world, 0).error),
	                    "phase_loss");
	assert_string_equal(command(world, 0, DB_CMD_ENABLE, PLAIN), "failed");
	assert_string_equal(command(world, 0, DB_CMD_CLEAR_FAULT, PLAIN), "unsupported");
	sim_servo_set_faults(world->servos[0], 0, world->now);
	pass(world, 1100 * MS);
	assert_string_equal(state_of(world, 0), "Disabled");
	drop(world);
}

static void one_sync_frame_starts_all(void **state)
{
	struct world *world = prepare(8, 20);
	struct sim_servo_config config;

	(void)state;
	option(world, "sync", 1);
	sim_servo_config_init(&config);
	config.synchronous = true;
	start(world, &config);
	for (size_t i = 0; i < 8; i++) {
		assert_string_equal(command(world, i, DB_CMD_ENABLE, PLAIN), "ok");
		/* Staged: nothing shows it yet. */
		assert_string_equal(command(world, i, DB_CMD_MOVE_VELOCITY, VELOCITY(300)),
		                    "unproven");
	}
	pass(world, 200 * MS);
	for (size_t i = 0; i < 8; i++)
		assert_true(world->servos[i]->rpm == 0);
	assert_string_equal(command(world, 3, DB_CMD_SYNC_START, PLAIN), "ok");
	pass(world, 300 * MS);
	for (size_t i = 0; i < 8; i++) {
		/* The same frame ends for all at the same moment. */
		assert_int_equal(world->servos[i]->setpoint_at, world->servos[0]->setpoint_at);
		assert_true(fabs(world->servos[i]->rpm - 300) < 3);
	}
	drop(world);
}

/* How busy the wire is, in thousandths, while nothing but the cycle goes on. */
static unsigned load(size_t count, unsigned cycle_ms, db_time report_interval)
{
	struct world *world = prepare(count, cycle_ms);
	struct db_bus_stats stats;
	struct sim_servo_config config;
	uint64_t before;

	sim_servo_config_init(&config);
	config.reports[SIM_SERVO_REPORT_POSITION] = report_interval;
	config.reports[SIM_SERVO_REPORT_MOTION] = report_interval;
	start(world, &config);
	before = world->wire->stats.busy_ns;
	pass(world, 1000 * MS);
	for (size_t i = 0; i < count; i++)
		assert_true(world->now - feedback(world, i).taken <=
		            (db_time)(cycle_ms + cycle_ms / 2 + 5) * MS);
	db_engine_stats(world->engine, &stats);
	assert_int_equal(stats.overruns, 0);
	assert_int_equal(stats.timeouts, 0);
	before = (world->wire->stats.busy_ns - before) * 1000 / (1000 * MS);
	printf("%zu drives, cycle %u ms, reports each %d ms: wire %llu.%llu %%, cycle %u us\n",
	       count, cycle_ms, (int)(report_interval / MS), (unsigned long long)before / 10,
	       (unsigned long long)before % 10, stats.cycle_us);
	drop(world);
	return (unsigned)before;
}

static void reports_spare_the_wire(void **state)
{
	static const size_t counts[] = { 1, 8, NODES };

	(void)state;
	for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
		unsigned asked = load(counts[i], 20, 0);
		unsigned reported = load(counts[i], 20, 20 * MS);

		assert_true(asked <= 1000 && reported < asked);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_node_answers_its_own_frames),
		cmocka_unit_test(a_node_may_acknowledge_something_else_first),
		cmocka_unit_test(broadcasts_are_obeyed_in_silence),
		cmocka_unit_test(a_node_reports),
		cmocka_unit_test(drives_come_online),
		cmocka_unit_test(a_speed_and_its_stop),
		cmocka_unit_test(power_that_returns_finds_no_old_speed),
		cmocka_unit_test(relative_moves_survive_every_lost_frame),
		cmocka_unit_test(relative_moves_on_a_bad_wire),
		cmocka_unit_test(stopping_a_move_takes_the_power),
		cmocka_unit_test(faults_show_by_name),
		cmocka_unit_test(one_sync_frame_starts_all),
		cmocka_unit_test(reports_spare_the_wire),
	};

	return cmocka_run_group_tests_name("sim/servo_can_node", tests, NULL, NULL);
}
