/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A commander between a bus and a server that only take notes, in made-up time. Header only; one thread.
 *
 *	FAKE(false);
 *	assert_int_equal(put(&fake, 0, DB_CMD_HOME, 0), DB_WRITE_LATER);
 *	finish(&fake, 0, DB_RESULT_OK);
 *	assert_int_equal(fake.answered_with[0], 0);
 *	drop(&fake);
 */
#ifndef DRIVEBRIDGE_TESTS_COMMANDER_WORLD_H
#define DRIVEBRIDGE_TESTS_COMMANDER_WORLD_H

#include "axis/axis_private.h"
#include "drivebridge/result.h"
#include "drivebridge/server.h"
#include "fakes/places.h"
#include "regmap/regmap_private.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS

/* Writes are judged by what their writer is told in the end. */
#define ILLEGAL_FUNCTION 0x01
#define ILLEGAL_VALUE 0x03
#define FAILURE 0x04
#define LATER 0x05
#define BUSY 0x06
#define NO_PATH 0x0A
#define NO_ANSWER 0x0B

/* --- a bus and a server that only take notes -------------------------------------------------------- */

#define REQUESTS 64

struct fake {
	struct db_bus_config bus;
	struct db_drive_config drive;
	const struct db_client *client; /* who asks */
	struct db_commander *commander;
	struct db_axis *axis;
	bool full;
	bool taken; /* parameter writes are acknowledged */
	unsigned submitted;
	struct db_request requests[REQUESTS];
	struct db_args args[REQUESTS];
	struct fake_place places[REQUESTS]; /* the bus's */
	unsigned answered;
	uint32_t answered_token[64];
	int answered_with[64];
	uint32_t next_token;
	unsigned holds_lost;
	uint32_t lost_holder;
	bool lost_by_leaving;
	unsigned refused;
	struct db_refused_write refused_write; /* as it was said last */
	db_time now;
};

static inline struct db_request *fake_submit(void *context, const struct db_request *request)
{
	struct fake *fake = context;
	struct db_request *kept = NULL;
	size_t commands = 0;

	for (size_t i = 0; i < REQUESTS; i++)
		commands += fake->places[i].used &&
		            !db_command_is_stop(fake->places[i].request.command);
	if (!fake->full && (db_command_is_stop(request->command) || commands < fake->bus.queue))
		kept = fake_place_fill(fake->places, REQUESTS, request);
	if (!kept)
		return NULL;
	atomic_store(&kept->acknowledged, fake->taken);
	fake->requests[fake->submitted] = *kept;
	if (kept->setting_count == 0) {
		fake->args[fake->submitted] = *kept->args;
		fake->requests[fake->submitted].args = &fake->args[fake->submitted];
	}
	fake->submitted++;
	return kept;
}

static inline void fake_release(void *context, struct db_request *request)
{
	fake_place_release(((struct fake *)context)->places, REQUESTS, request);
}

static inline void fake_answer(void *context, struct db_write_token token, enum db_result result)
{
	struct fake *fake = context;

	fake->answered_token[fake->answered] = token.sequence;
	fake->answered_with[fake->answered++] = db_exception_of(result);
}

static inline uint64_t fake_wall(void *context)
{
	return 1700000000000000u + (uint64_t)((struct fake *)context)->now / 1000;
}

static inline void fake_hold_lost(void *context, const struct db_client *holder, bool gone)
{
	struct fake *fake = context;

	fake->holds_lost++;
	fake->lost_holder = holder->id;
	fake->lost_by_leaving = gone;
}

static inline void fake_refused(void *context, const struct db_client *client,
                                const struct db_refused_write *write)
{
	struct fake *fake = context;

	(void)client;
	fake->refused++;
	fake->refused_write = *write;
}

static const struct db_commander_ops ops = {
	.submit = fake_submit,
	.release = fake_release,
	.answer = fake_answer,
	.wall_us = fake_wall,
	.refused = fake_refused,
	.hold_lost = fake_hold_lost,
};

static inline enum db_result fake_check(const struct db_bus_config *bus,
                                        const struct db_drive_config *drive,
                                        enum db_command command, const struct db_args *args)
{
	(void)bus;
	(void)drive;
	if (command == DB_CMD_MOVE_VELOCITY && args->target_velocity > 1000.0f)
		return DB_RESULT_OUT_OF_RANGE;
	return DB_RESULT_OK;
}

static inline db_time fake_command_time(const struct db_bus_config *bus)
{
	(void)bus;
	return 10 * MS;
}

static const struct db_driver driver = {
	.name = "fake",
	.command_time = fake_command_time,
	.commands = ~DB_COMMAND_BIT(DB_CMD_SET_SV),
	.check = fake_check,
	.acceleration_param = -1,
	.deceleration_param = -1,
	.preset_velocity_param = -1,
};

static inline void set_status(struct fake *fake, uint32_t status)
{
	struct db_snapshot snapshot = { .feedback.status = status, .feedback.taken = 1 };

	db_axis_publish(fake->axis, &snapshot);
}

static inline struct db_commander_config config_of(struct fake *fake)
{
	return (struct db_commander_config){
		.on_client_loss = DB_CMD_STOP,
		.driver = &driver,
		.bus_config = &fake->bus,
		.drive_config = &fake->drive,
		.commands = driver.commands,
		.axis = fake->axis,
		.drive = 7,
		.confirm_ms = 40,
	};
}

static inline void swap(struct fake *fake, struct db_commander **other)
{
	struct db_commander *commander = fake->commander;

	fake->commander = *other;
	*other = commander;
}

static inline void init_with(struct fake *fake, bool accept, uint32_t watchdog_ms,
                             bool ids_by_client)
{
	struct db_commander_config config;

	memset(fake, 0, sizeof *fake);
	fake->bus.cycle_ms = 20;
	fake->bus.queue = 32;
	fake->drive = (struct db_drive_config){
		.counts_per_unit = 10.0,
		.min_position = NAN,
		.max_position = NAN,
		.max_velocity = NAN,
		.max_acceleration = NAN,
	};
	fake->now = 1000 * MS;
	fake->axis = db_axis_new(DB_PARAMS_MAX);
	config = config_of(fake);
	config.watchdog_ms = watchdog_ms;
	config.ids_by_client = ids_by_client;
	config.accept_writes = accept;
	set_status(fake, DB_STATUS_BUS_UP | DB_STATUS_ONLINE);
	assert_int_equal(db_commander_new(&config, &ops, fake, &fake->commander), 0);
}

/* The same drive, with a commander of this configuration. */
static inline void remake(struct fake *fake, const struct db_commander_config *config)
{
	db_commander_free(fake->commander);
	assert_int_equal(db_commander_new(config, &ops, fake, &fake->commander), 0);
}

static inline struct db_history_entry entry_of(const struct fake *fake, size_t age)
{
	struct db_history_entry entry = { .sequence = 0 };

	assert_true(db_commander_history(fake->commander, age, &entry));
	return entry;
}

static inline void init(struct fake *fake, bool accept)
{
	init_with(fake, accept, 0, false);
}

#define FAKE(accept)      \
	struct fake fake; \
	(void)state;      \
	init(&fake, accept)

static inline void drop(struct fake *fake)
{
	db_commander_free(fake->commander);
	db_axis_free(fake->axis);
}

static inline int write_as(struct fake *fake, uint16_t id, unsigned command, int32_t position,
                           bool has_id)
{
	struct db_command_write write = {
		.block = db_commander_kept(fake->commander, fake->client),
		.has_command = true,
		.has_id = has_id,
	};

	if (has_id)
		write.block.command_id = id;
	write.block.command = (uint16_t)command;
	write.block.args.target_position = position;
	return db_exception_of_answer(
		db_commander_write(fake->commander, fake->client, &write,
	                           (struct db_write_token){ 1, ++fake->next_token }, fake->now));
}

/* One FC 16 over the whole block. */
static inline int put(struct fake *fake, uint16_t id, unsigned command, int32_t position)
{
	return write_as(fake, id, command, position, true);
}

static inline void finish(struct fake *fake, unsigned request, enum db_result result)
{
	/* One that has ended before is nowhere. */
	struct db_request late = fake->requests[request];
	struct db_request *kept = fake_place_find(fake->places, REQUESTS, late.ticket);

	db_commander_complete(fake->commander,
	                      fake_place_end(kept ? kept : &late, result, fake->now), fake->now);
}

static inline struct db_write_answer execute_held(struct db_commander *commander,
                                                  const struct db_client *client,
                                                  enum db_command code, const struct db_args *args,
                                                  uint32_t hold_ms, struct db_write_token token,
                                                  db_time now)
{
	struct db_request request = { .command = code, .args = args, .hold_ms = (uint16_t)hold_ms };

	if (client)
		request.client = *client;
	return db_commander_ask(commander, &request, token, now);
}

static inline struct db_write_answer execute(struct db_commander *commander,
                                             const struct db_client *client, enum db_command code,
                                             const struct db_args *args,
                                             struct db_write_token token, db_time now)
{
	return execute_held(commander, client, code, args, 0, token, now);
}

static inline struct db_write_answer set(struct db_commander *commander,
                                         const struct db_client *client,
                                         const struct db_setting *settings, size_t count,
                                         struct db_write_token token, db_time now)
{
	struct db_request request = { .settings = settings, .setting_count = (uint8_t)count };

	if (client)
		request.client = *client;
	return db_commander_ask(commander, &request, token, now);
}

static inline struct db_command_state look(const struct fake *fake)
{
	struct db_command_state state;

	db_commander_state(fake->commander, fake->client, &state, 0);
	return state;
}

/* Uses up the first id, so that what follows is not taken as a baseline. */
static inline void pass_baseline(struct fake *fake, uint16_t id)
{
	assert_int_equal(put(fake, id, DB_CMD_ENABLE, 0), FAILURE);
}

/* Lets the commander do what is due. */
static inline void wake(struct fake *fake)
{
	db_time due = db_commander_next_deadline(fake->commander);

	assert_true(due != DB_TIME_NEVER);
	if (due > fake->now)
		fake->now = due;
	db_commander_expire(fake->commander, fake->now);
}

static inline void set_axis(struct fake *fake, enum db_axis_state state, uint32_t status,
                            int32_t position)
{
	struct db_snapshot snapshot = {
		.feedback = {
			.state = (uint16_t)state,
			.status = DB_STATUS_BUS_UP | DB_STATUS_ONLINE | status,
			.taken = fake->now,
			.position = position,
			.velocity = status & DB_STATUS_MOVING ? 100.0f : 0.0f,
			.has_target = true,
			.target = 1000,
		},
	};

	db_axis_publish(fake->axis, &snapshot);
}

static inline void let_pass(struct fake *fake, db_time span)
{
	db_time end = fake->now + span;

	while (db_commander_next_deadline(fake->commander) <= end) {
		fake->now = db_commander_next_deadline(fake->commander);
		db_commander_expire(fake->commander, fake->now);
	}
	fake->now = end;
}

static inline int move(struct fake *fake, enum db_command code, int32_t position, float velocity)
{
	struct db_args args = { .target_position = position, .target_velocity = velocity };

	return db_exception_of_answer(execute(fake->commander, fake->client, code, &args,
	                                      (struct db_write_token){ 0 }, fake->now));
}

/* --- clients that each have ids and results of their own --------------------------------------------- */

#define CLIENTS 9

static inline const struct db_client *client(unsigned number)
{
	static struct db_client clients[CLIENTS + 1];

	clients[number] = (struct db_client){ .id = number + 100, .address = { (uint8_t)number } };
	return &clients[number];
}

static inline int put_as(struct fake *fake, unsigned number, uint16_t id, unsigned command,
                         int32_t position)
{
	fake->client = client(number);
	db_commander_hear(fake->commander, fake->client, ++fake->now);
	return put(fake, id, command, position);
}

static inline struct db_command_state look_as(struct fake *fake, unsigned number)
{
	fake->client = client(number);
	return look(fake);
}

#define CLIENT_FAKE()     \
	struct fake fake; \
	(void)state;      \
	init_with(&fake, false, 0, true)

#endif
