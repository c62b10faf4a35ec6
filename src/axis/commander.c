/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/commander.h"

#include "axis/follow.h"
#include "axis/history.h"
#include "axis/limits.h"
#include "axis/watchdog.h"
#include "axis/writers.h"
#include "regmap/commands.h"

#include <errno.h>
#include <modbus.h>
#include <stdlib.h>
#include <string.h>

#define SLOTS (DB_COMMANDER_PENDING + DB_COMMANDER_STOPS)

/* How often a motion under way is looked at, at most and at least. */
#define LOOK_MIN (5 * DB_NS_PER_MS)
#define LOOK_MAX (50 * DB_NS_PER_MS)

/* A drive that stands elsewhere for so many cycles, and so long, does not arrive any more. */
#define PATIENCE_CYCLES 5
#define PATIENCE_MIN (200 * DB_NS_PER_MS)

/* How soon a stop of the watchdog that found no room is tried again. */
#define REACT_AGAIN (5 * DB_NS_PER_MS)
/* ... and one that the drive did not take. */
#define REFUSED_AGAIN (100 * DB_NS_PER_MS)

/* How often a drive that was not there yet is looked for. */
#define FIND_INTERVAL (100 * DB_NS_PER_MS)

struct waiter {
	struct db_write_token token;
	db_time deadline;
};

/* Who asks for something. */
struct origin {
	const struct db_client *client; /* null: the bridge itself */
	struct db_writer *writer;       /* its memory; null: it has none, and no ids */
	bool block;                     /* by the command block, where a write may be sent again */
};

/* One request that the bus has. */
struct slot {
	uint32_t ticket; /* 0 = free */
	uint32_t order;
	enum db_command command; /* NONE: a parameter write */
	uint16_t id;             /* command_id */
	bool overtaken;          /* a stop was handed to the bus after it */
	bool has_client;
	struct db_client client; /* whose it is */
	db_time arrived;
	unsigned waiter_count;
	struct waiter waiters[DB_COMMANDER_WAITERS];
};

struct db_commander {
	struct db_commander_config config;
	const struct db_commander_ops *ops;
	void *context;

	struct db_follow follow; /* the motion that the drive has begun last, if it has an end */
	struct db_follow_config follow_config;
	db_time look_at; /* the next look at it */
	db_time look_interval;

	struct db_watchdog watchdog;
	db_time find_at; /* the next look whether the drive is there and moves; NEVER: it was seen */
	uint32_t react_ticket; /* the watchdog's stop, until the drive has confirmed it; 0 */
	db_time react_at; /* the watchdog's stop is not with the bus yet: try again; or NEVER */

	struct db_command_block kept;
	struct db_writers writers;
	struct db_outcome shown; /* of the latest, whoever wrote it */
	uint32_t newest;         /* the command that was submitted last */
	uint32_t submitted;      /* requests so far */
	unsigned waiting;        /* waiters in all slots */
	struct slot slots[SLOTS];
	struct db_history history;
};

static void init_follow(struct db_commander *commander)
{
	const struct db_drive_config *drive = commander->config.drive_config;
	const struct db_bus_config *bus = commander->config.bus_config;
	db_time cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	db_time patience = PATIENCE_CYCLES * cycle;

	commander->look_interval = cycle < LOOK_MIN ? LOOK_MIN :
	                           cycle > LOOK_MAX ? LOOK_MAX :
	                                              cycle;
	commander->follow_config = (struct db_follow_config){
		.window = drive->in_position_window * drive->counts_per_unit,
		.settling = (db_time)drive->settling_ms * DB_NS_PER_MS,
		.patience = patience < PATIENCE_MIN ? PATIENCE_MIN : patience,
	};
}

int db_commander_new(const struct db_commander_config *config, const struct db_commander_ops *ops,
                     void *context, struct db_commander **commander)
{
	struct db_commander *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	made->config = *config;
	made->ops = ops;
	made->context = context;
	made->react_at = DB_TIME_NEVER;
	made->writers.by_address = config->ids_by_client;
	init_follow(made);
	db_watchdog_init(&made->watchdog,
	                 config->on_client_loss == DB_CMD_NONE ? 0 : config->watchdog_ms,
	                 config->drive_config->watchdog_feed);
	made->find_at = made->watchdog.timeout_ms == 0 ? DB_TIME_NEVER : 0;
	*commander = made;
	return 0;
}

void db_commander_free(struct db_commander *commander)
{
	free(commander);
}

uint16_t db_ticket_drive(uint32_t ticket)
{
	return (uint16_t)((ticket >> 16) - 1);
}

static struct slot *slot_of(struct db_commander *commander, uint32_t ticket)
{
	for (size_t i = 0; i < SLOTS && ticket != 0; i++) {
		if (commander->slots[i].ticket == ticket)
			return &commander->slots[i];
	}
	return NULL;
}

static struct slot *free_slot(struct db_commander *commander, enum db_command command)
{
	bool stop = db_command_is_stop(command);
	size_t first = stop ? DB_COMMANDER_PENDING : 0;
	size_t end = stop ? SLOTS : DB_COMMANDER_PENDING;

	for (size_t i = first; i < end; i++) {
		if (commander->slots[i].ticket == 0)
			return &commander->slots[i];
	}
	return NULL;
}

/* The writer waits for the slot's end, unless it is not to wait or there is no room. */
static int wait_for(struct db_commander *commander, struct slot *slot, struct db_write_token token,
                    db_time now)
{
	if (commander->config.accept_writes)
		return 0;
	if (slot->waiter_count == DB_COMMANDER_WAITERS)
		return MODBUS_EXCEPTION_ACKNOWLEDGE;
	slot->waiters[slot->waiter_count++] = (struct waiter){
		.token = token,
		.deadline = now + (db_time)commander->config.confirm_ms * DB_NS_PER_MS,
	};
	commander->waiting++;
	return DB_WRITE_LATER;
}

/* --- what a write asks for -------------------------------------------------------------------- */

static bool is_supported(const struct db_commander_config *config, uint16_t code)
{
	return code < DB_CMD_LIMIT && (config->commands & DB_COMMAND_BIT(code));
}

static enum db_result check(const struct db_commander_config *config, uint16_t code,
                            const struct db_args *args)
{
	if (!db_command_find(code))
		return DB_RESULT_OUT_OF_RANGE;
	if (!is_supported(config, code))
		return DB_RESULT_UNSUPPORTED;
	return config->driver->check(config->bus_config, config->drive_config,
	                             (enum db_command)code, args);
}

/* OK when the drive can be asked now. A stop is worth queueing for a drive that may come back. */
static enum db_result reach(const struct db_commander *commander, enum db_command command)
{
	struct db_snapshot snapshot;

	db_axis_read(commander->config.axis, &snapshot);
	if (!(snapshot.feedback.status & DB_STATUS_BUS_UP))
		return DB_RESULT_BUS_DOWN;
	if (!(snapshot.feedback.status & DB_STATUS_ONLINE) && !db_command_is_stop(command))
		return DB_RESULT_OFFLINE;
	return DB_RESULT_OK;
}

static bool equals_executed(const struct db_writer *writer, const struct db_command_block *block)
{
	return writer->has_executed && writer->executed.command == block->command &&
	       db_command_same_args(block->command, &writer->executed.args, &block->args);
}

/*
 * The id that a write stands for: the written one, or for a write of `command` alone the kept one,
 * unless that was used for something else already.
 */
static uint16_t id_of(const struct db_writer *writer, const struct db_command_write *write)
{
	uint16_t id = write->block.command_id;

	if (write->has_id || id != writer->last.id || equals_executed(writer, &write->block))
		return id;
	return 0;
}

/* --- limits -------------------------------------------------------------------------------------- */

/* What the drive's parameters will be is open. */
static bool settings_are_pending(const struct db_commander *commander)
{
	for (size_t i = 0; i < SLOTS; i++) {
		if (commander->slots[i].ticket != 0 && commander->slots[i].command == DB_CMD_NONE)
			return true;
	}
	return false;
}

static struct db_limit_facts limit_facts(const struct db_commander *commander)
{
	int param = commander->config.driver->preset_velocity_param;
	struct db_limit_facts facts = { 0 };
	struct db_nameplate plate;
	struct db_snapshot snapshot;

	db_axis_read(commander->config.axis, &snapshot);
	facts.position = snapshot.feedback.position;
	if (param < 0 || param >= DB_PARAMS_MAX)
		return facts;
	db_axis_read_nameplate(commander->config.axis, &plate);
	facts.has_preset = (plate.valid >> param & 1) && !plate.doubtful &&
	                   !settings_are_pending(commander);
	facts.preset_velocity = (float)db_value_number(commander->config.driver->params[param].type,
	                                               plate.values[param]);
	return facts;
}

static enum db_result show_limit(struct db_commander *commander, struct db_writer *writer,
                                 enum db_limit limit)
{
	commander->shown.result_limit = (uint16_t)limit;
	if (writer)
		writer->shown.result_limit = (uint16_t)limit;
	return limit == DB_LIMIT_NONE ? DB_RESULT_OK : DB_RESULT_LIMIT;
}

/* LIMIT when a limit of the configuration would be broken; which one is then shown. */
static enum db_result check_limits(struct db_commander *commander, struct db_writer *writer,
                                   const struct db_command_block *block)
{
	struct db_limit_facts facts = limit_facts(commander);
	enum db_limit limit = db_limits_command(commander->config.drive_config,
	                                        (enum db_command)block->command, &block->args,
	                                        &facts);

	return show_limit(commander, writer, limit);
}

static enum db_result check_acceleration(struct db_commander *commander, struct db_writer *writer,
                                         const struct db_setting *settings, size_t count)
{
	const struct db_driver *driver = commander->config.driver;

	for (size_t i = 0; i < count; i++) {
		int param = settings[i].param;
		enum db_limit limit;

		if (param != driver->acceleration_param && param != driver->deceleration_param)
			continue;
		limit = db_limits_acceleration(
			commander->config.drive_config,
			db_value_number(driver->params[param].type, settings[i].value));
		if (show_limit(commander, writer, limit) != DB_RESULT_OK)
			return DB_RESULT_LIMIT;
	}
	return DB_RESULT_OK;
}

/* --- what is remembered ------------------------------------------------------------------------ */

static void show_write(struct db_commander *commander, struct db_writer *writer,
                       enum db_result result, uint32_t ticket)
{
	commander->shown.write_result = (uint16_t)result;
	commander->shown.write_ticket = ticket;
	if (!writer)
		return;
	writer->shown.write_result = (uint16_t)result;
	writer->shown.write_ticket = ticket;
}

static void show_command(struct db_outcome *outcome, uint16_t id, uint16_t code,
                         enum db_result result, uint32_t ticket)
{
	outcome->result_id = id;
	outcome->result_command = code;
	outcome->result = (uint16_t)result;
	outcome->ticket = ticket;
}

/* A command's result and, if it had an id, its memory. */
static void show(struct db_commander *commander, struct db_writer *writer, uint16_t id,
                 uint16_t code, enum db_result result, uint32_t ticket)
{
	show_command(&commander->shown, id, code, result, ticket);
	show_write(commander, writer, result, ticket);
	if (!writer)
		return;
	show_command(&writer->shown, id, code, result, ticket);
	writer->commanded = true;
	if (id != 0 && result != DB_RESULT_BUSY)
		db_writer_remember(writer, id, result, ticket);
}

/* For the technician. */
static void stamp(const struct db_commander *commander, const struct db_client *client,
                  struct db_history_entry *entry)
{
	entry->timestamp_us = commander->ops->wall_us(commander->context);
	if (!client)
		return;
	memcpy(entry->address, client->address, sizeof entry->address);
	entry->port = client->port;
}

static void record(struct db_commander *commander, const struct db_client *client,
                   const struct db_command_block *block, uint16_t id, enum db_result result,
                   uint32_t ticket, db_time now)
{
	struct db_history_entry entry = {
		.command_id = id,
		.command = block->command,
		.result = (uint16_t)result,
	};

	stamp(commander, client, &entry);
	db_history_args(&entry, block->command, &block->args);
	db_history_add(&commander->history, &entry, ticket, now);
}

static void record_settings(struct db_commander *commander, const struct db_client *client,
                            const struct db_setting *settings, enum db_result result,
                            uint32_t ticket, db_time now)
{
	struct db_history_entry entry = {
		.number = settings[0].param,
		.value = settings[0].value.u,
		.result = (uint16_t)result,
	};

	stamp(commander, client, &entry);
	db_history_add(&commander->history, &entry, ticket, now);
}

static bool sets_in_motion(enum db_command command)
{
	return db_command_ends_motion(command) && !db_command_is_stop(command);
}

/* Ends a command without the bus. */
static int refuse(struct db_commander *commander, const struct origin *by,
                  const struct db_command_block *block, uint16_t id, enum db_result result,
                  db_time now)
{
	show(commander, by->writer, id, block->command, result, 0);
	if (sets_in_motion((enum db_command)block->command)) {
		db_outcome_refuse_motion(&commander->shown);
		if (by->writer)
			db_outcome_refuse_motion(&by->writer->shown);
	}
	record(commander, by->client, block, id, result, 0, now);
	return db_result_exception(result);
}

/* --- carrying out -------------------------------------------------------------------------------- */

/* Whatever moved is ended by another command. Who began it is told so. */
static void abort_motion(struct db_commander *commander, db_time now)
{
	commander->shown.done = commander->shown.aborted = false;
	db_outcome_cancel_motion(&commander->shown);
	db_writers_cancel_motion(&commander->writers);
	if (commander->follow.active)
		db_history_end(&commander->history, commander->follow.ticket, DB_RESULT_CANCELLED,
		               now);
	commander->follow.active = false;
}

/*
 * What was just handed to the bus: a stop ends what moves, and what is still to begin, in any case.
 * Another motion does so only when the drive takes it: until then nobody knows.
 */
static void note_submitted(struct db_commander *commander, struct db_writer *writer,
                           enum db_command command, db_time now)
{
	if (!db_command_ends_motion(command))
		return;
	db_outcome_ask_motion(&commander->shown);
	if (writer)
		db_outcome_ask_motion(&writer->shown);
	if (!db_command_is_stop(command))
		return;
	abort_motion(commander, now);
	for (size_t i = 0; i < SLOTS; i++) {
		if (sets_in_motion(commander->slots[i].command))
			commander->slots[i].overtaken = true;
	}
}

/* False when the drive's or the bus's queue is full. */
static bool submit(struct db_commander *commander, const struct db_client *client,
                   struct db_request *request, uint16_t id, struct slot **slot)
{
	*slot = free_slot(commander, request->command);
	if (!*slot)
		return false;
	request->ticket = ((uint32_t)commander->config.drive + 1) << 16 |
	                  (commander->submitted & 0xFFFFu);
	request->axis = commander->config.drive;
	db_writers_retire(&commander->writers, request->ticket);
	db_outcome_retire(&commander->shown, request->ticket);
	if (!commander->ops->submit(commander->context, request))
		return false;
	(*slot)->ticket = request->ticket;
	(*slot)->order = commander->submitted++;
	(*slot)->command = request->command;
	(*slot)->id = id;
	(*slot)->overtaken = false;
	(*slot)->has_client = client != NULL;
	if (client)
		(*slot)->client = *client;
	(*slot)->arrived = request->submitted;
	(*slot)->waiter_count = 0;
	return true;
}

static void begin(struct db_writer *writer, const struct db_command_block *block, uint32_t ticket)
{
	writer->has_executed = true;
	writer->executed = *block;
	writer->executed_ticket = ticket;
}

static int carry_out(struct db_commander *commander, const struct origin *by,
                     const struct db_command_block *block, uint16_t id, struct db_write_token token,
                     db_time now)
{
	struct db_request request = { 0 };
	enum db_result result = reach(commander, (enum db_command)block->command);
	struct slot *slot;

	if (result != DB_RESULT_OK)
		return refuse(commander, by, block, id, result, now);
	request.command = (enum db_command)block->command;
	request.args = block->args;
	request.submitted = now;
	if (!submit(commander, by->client, &request, id, &slot))
		return refuse(commander, by, block, id, DB_RESULT_BUSY, now);
	if (db_command_is_motion(request.command))
		db_watchdog_arm(&commander->watchdog, now);
	note_submitted(commander, by->writer, request.command, now);
	record(commander, by->client, block, id, DB_RESULT_PENDING, request.ticket, now);
	commander->newest = request.ticket;
	if (by->writer && by->block)
		begin(by->writer, block, request.ticket);
	show(commander, by->writer, id, block->command, DB_RESULT_PENDING, request.ticket);
	return wait_for(commander, slot, token, now);
}

/* The last id came again, and its command was not turned away as busy. */
static bool is_repeat(const struct db_writer *writer, uint16_t id)
{
	return id != 0 && id == writer->last.id && writer->last.result != DB_RESULT_BUSY;
}

/* The last id came again: its answer is that of the first time. */
static int repeat(struct db_commander *commander, struct db_writer *writer,
                  struct db_write_token token, db_time now)
{
	struct slot *slot = slot_of(commander, writer->last.ticket);

	show_write(commander, writer, writer->last.result, slot ? slot->ticket : 0);
	if (slot)
		return wait_for(commander, slot, token, now);
	if (commander->config.accept_writes && writer->last.sent)
		return 0;
	return db_result_exception(writer->last.result);
}

/*
 * The pending stop that this one may join: the drive's newest command. An older one must not be
 * joined, because what was queued after it would run after both.
 */
static struct slot *joinable(struct db_commander *commander, uint16_t code)
{
	struct slot *slot = slot_of(commander, commander->newest);

	return slot && slot->command == (enum db_command)code && db_command_is_stop(slot->command) ?
	               slot :
	               NULL;
}

static bool clears_latch(const struct db_commander *commander, const struct db_command_block *block)
{
	return commander->watchdog.latched && block->command == DB_CMD_CLEAR_FAULT;
}

/* Ends the latch. True when that is all there is to clear: the drive itself has no fault, or nothing
 * that could clear it. */
static bool unlatch(struct db_commander *commander)
{
	struct db_snapshot snapshot;

	db_watchdog_reset(&commander->watchdog);
	commander->react_ticket = 0;
	commander->react_at = DB_TIME_NEVER;
	if (!is_supported(&commander->config, DB_CMD_CLEAR_FAULT))
		return true;
	db_axis_read(commander->config.axis, &snapshot);
	return (snapshot.feedback.status & DB_STATUS_ONLINE) &&
	       snapshot.feedback.error == DB_ERROR_NONE;
}

/* Without a writer there is no id. */
static int command(struct db_commander *commander, const struct origin *by,
                   const struct db_command_block *block, uint16_t id, struct db_write_token token,
                   db_time now)
{
	bool stop = db_command_is_stop((enum db_command)block->command);
	struct db_writer *writer = by->writer;
	enum db_result result;
	struct slot *slot;

	if (is_repeat(writer, id) && !stop)
		return repeat(commander, writer, token, now);
	result = check(&commander->config, block->command, &block->args);
	/* The latch is the bridge's own: it ends also where the drive has nothing to clear. */
	if (result == DB_RESULT_UNSUPPORTED && clears_latch(commander, block))
		result = DB_RESULT_OK;
	if (result == DB_RESULT_OK)
		result = check_limits(commander, writer, block);
	if (result != DB_RESULT_OK)
		return refuse(commander, by, block, id, result, now);
	if (id != 0 && writer->last.id == 0 && !stop)
		return refuse(commander, by, block, id, DB_RESULT_RESTARTED, now);
	if (commander->watchdog.latched && db_command_is_motion((enum db_command)block->command))
		return refuse(commander, by, block, id, DB_RESULT_LATCHED, now);
	if (clears_latch(commander, block) && unlatch(commander)) {
		if (by->block)
			begin(writer, block, 0);
		return refuse(commander, by, block, id, DB_RESULT_OK, now);
	}
	slot = joinable(commander, block->command);
	if (slot) {
		if (writer)
			db_outcome_ask_motion(&writer->shown);
		db_history_repeat(&commander->history, slot->ticket);
		show(commander, writer, id, block->command, DB_RESULT_PENDING, slot->ticket);
		return wait_for(commander, slot, token, now);
	}
	return carry_out(commander, by, block, id, token, now);
}

/* What is staged is checked now, so that the start of a group finds no surprises. */
static int stage(struct db_commander *commander, const struct origin *by,
                 const struct db_command_write *write, db_time now)
{
	struct db_command_block block = write->block;
	enum db_result result;

	block.command = block.staged_command;
	if (write->has_command && write->block.command != DB_CMD_NONE)
		return refuse(commander, by, &block, 0, DB_RESULT_OUT_OF_RANGE, now);
	result = check(&commander->config, block.command, &block.args);
	if (result == DB_RESULT_OK)
		result = check_limits(commander, by->writer, &block);
	return result == DB_RESULT_OK ? 0 : refuse(commander, by, &block, 0, result, now);
}

enum db_command db_commander_staged(const struct db_commander *commander)
{
	return (enum db_command)commander->kept.staged_command;
}

uint32_t db_commander_newest(const struct db_commander *commander)
{
	return commander->newest;
}

int db_commander_start_staged(struct db_commander *commander, const struct db_client *client,
                              struct db_write_token token, db_time now)
{
	struct origin by = { client, db_writers_claim(&commander->writers, client, now), false };
	struct db_command_block block = commander->kept;

	block.command = block.staged_command;
	commander->kept.staged_command = DB_CMD_NONE;
	return command(commander, &by, &block, 0, token, now);
}

int db_commander_write(struct db_commander *commander, const struct db_client *client,
                       const struct db_command_write *write, struct db_write_token token,
                       db_time now)
{
	bool stages = write->has_staged && write->block.staged_command != DB_CMD_NONE;
	bool commands = write->has_command && write->block.command != DB_CMD_NONE;
	struct origin by = { .client = client, .block = true };
	int answer = 0;

	/* Who only writes arguments takes no place from those who number their commands. */
	if (stages || commands || write->has_id)
		by.writer = db_writers_claim(&commander->writers, client, now);
	/* Whatever else stands in the block, a stop is a stop. */
	if (stages && !(commands && db_command_is_stop((enum db_command)write->block.command)))
		answer = stage(commander, &by, write, now);
	else if (commands)
		answer = command(commander, &by, &write->block, id_of(by.writer, write), token,
		                 now);
	/* 05: on its way, though its writer does not wait for it. */
	if (answer > 0 && answer != MODBUS_EXCEPTION_ACKNOWLEDGE)
		return answer;
	commander->kept = write->block;
	if (write->has_id)
		by.writer->kept_id = write->block.command_id;
	return answer;
}

int db_commander_execute(struct db_commander *commander, const struct db_client *client,
                         enum db_command code, const struct db_args *args,
                         struct db_write_token token, db_time now)
{
	struct origin by = { client, db_writers_claim(&commander->writers, client, now), false };
	struct db_command_block block = { .command = (uint16_t)code, .args = *args };

	return command(commander, &by, &block, 0, token, now);
}

void db_commander_set_refused(struct db_commander *commander, const struct db_client *client,
                              enum db_result result)
{
	show_write(commander, db_writers_find(&commander->writers, client), result, 0);
}

void db_commander_refuse(struct db_commander *commander, const struct db_client *client,
                         const struct db_command_block *block, enum db_result result, db_time now)
{
	const struct db_setting unknown = { .param = DB_HISTORY_UNKNOWN };

	db_commander_set_refused(commander, client, result);
	if (block->command == DB_CMD_NONE)
		record_settings(commander, client, &unknown, result, 0, now);
	else
		record(commander, client, block, block->command_id, result, 0, now);
}

int db_commander_set(struct db_commander *commander, const struct db_client *client,
                     const struct db_setting *settings, size_t count, struct db_write_token token,
                     db_time now)
{
	struct db_writer *writer = db_writers_find(&commander->writers, client);
	struct db_request request = { 0 };
	enum db_result result = check_acceleration(commander, writer, settings, count);
	struct slot *slot = NULL;

	if (result == DB_RESULT_OK)
		result = reach(commander, DB_CMD_NONE);
	request.submitted = now;
	request.setting_count = (uint16_t)count;
	request.settings = settings;
	if (result == DB_RESULT_OK && !submit(commander, client, &request, 0, &slot))
		result = DB_RESULT_BUSY;
	if (result != DB_RESULT_OK) {
		show_write(commander, writer, result, 0);
		record_settings(commander, client, settings, result, 0, now);
		return db_result_exception(result);
	}
	/* A later stop is not to join one from before this, which would leave it standing. */
	commander->newest = request.ticket;
	record_settings(commander, client, settings, DB_RESULT_PENDING, request.ticket, now);
	show_write(commander, writer, DB_RESULT_PENDING, request.ticket);
	return wait_for(commander, slot, token, now);
}

/* --- how it ended ---------------------------------------------------------------------------------- */

static void answer_waiters(struct db_commander *commander, struct slot *slot, uint8_t exception)
{
	/* Taken out first: an answer may let the writer's next request in. */
	unsigned count = slot->waiter_count;
	struct waiter waiters[DB_COMMANDER_WAITERS];

	memcpy(waiters, slot->waiters, sizeof waiters);
	slot->waiter_count = 0;
	commander->waiting -= count;
	for (unsigned i = 0; i < count; i++)
		commander->ops->answer(commander->context, waiters[i].token, exception);
}

void db_commander_set_writers(struct db_commander *commander, unsigned confirm_ms,
                              bool accept_writes, bool ids_by_client)
{
	commander->config.confirm_ms = confirm_ms;
	commander->config.accept_writes = accept_writes;
	if (commander->writers.by_address == ids_by_client)
		return;
	/* Whose an id was cannot be said any more: each begins with a baseline again. */
	commander->writers = (struct db_writers){ .by_address = ids_by_client };
}

void db_commander_dismiss(struct db_commander *commander)
{
	for (size_t i = 0; i < SLOTS; i++)
		answer_waiters(commander, &commander->slots[i],
		               db_result_exception(DB_RESULT_CANCELLED));
}

/* The command did nothing: whatever moved before goes on. */
static bool never_began(enum db_result result)
{
	switch (result) {
	case DB_RESULT_TIMEOUT:
	case DB_RESULT_INDETERMINATE:
	case DB_RESULT_FAILED:
		return false;
	default:
		return result != DB_RESULT_OK;
	}
}

/* The drive has taken it: its result stays ok, unless the motion ends badly. */
static void note_begun(struct db_commander *commander, const struct slot *slot, db_time now)
{
	const struct db_client *client = slot->has_client ? &slot->client : NULL;
	struct db_writer *writer = db_writers_find(&commander->writers, client);
	bool ends = db_follow_applies(slot->command);

	abort_motion(commander, now);
	if (!db_command_is_motion(slot->command))
		return;
	db_outcome_begin_motion(&commander->shown, slot->id, ends, slot->overtaken);
	if (writer)
		db_outcome_begin_motion(&writer->shown, slot->id, ends, slot->overtaken);
	if (slot->overtaken || !ends)
		return;
	db_follow_begin(&commander->follow, slot->command, slot->ticket, now);
	commander->look_at = now + LOOK_MIN;
}

/* The drive did not take it. */
static void note_refused(struct db_commander *commander, const struct slot *slot)
{
	const struct db_client *client = slot->has_client ? &slot->client : NULL;
	struct db_writer *writer = db_writers_find(&commander->writers, client);

	db_outcome_refuse_motion(&commander->shown);
	if (writer)
		db_outcome_refuse_motion(&writer->shown);
}

static void note_ended(struct db_commander *commander, const struct slot *slot,
                       enum db_result result, db_time now)
{
	db_history_end(&commander->history, slot->ticket, result, now);
	if (!sets_in_motion(slot->command))
		return;
	if (never_began(result)) {
		note_refused(commander, slot);
		return;
	}
	if (result == DB_RESULT_OK)
		note_begun(commander, slot, now);
	else
		abort_motion(commander, now);
}

/* A motion is on its way to the drive: whether the one before reaches its end is open. */
static bool motion_is_pending(const struct db_commander *commander)
{
	for (size_t i = 0; i < SLOTS; i++) {
		if (commander->slots[i].ticket != 0 && sets_in_motion(commander->slots[i].command))
			return true;
	}
	return false;
}

static void look_at_motion(struct db_commander *commander, db_time now)
{
	struct db_snapshot snapshot;
	enum db_result result;

	if (!commander->follow.active || commander->look_at > now)
		return;
	commander->look_at = now + commander->look_interval;
	if (motion_is_pending(commander))
		return;
	db_axis_read(commander->config.axis, &snapshot);
	result = db_follow_look(&commander->follow, &commander->follow_config, &snapshot.feedback,
	                        now);
	if (result == DB_RESULT_PENDING)
		return;
	db_history_end(&commander->history, commander->follow.ticket, result, now);
	db_outcome_end_motion(&commander->shown, commander->follow.ticket, result);
	db_writers_end_motion(&commander->writers, commander->follow.ticket, result);
}

/* The watchdog's stop ended. One that the drive turned down is said again until it is taken. */
static void note_reaction(struct db_commander *commander, enum db_result result, db_time now)
{
	if (result == DB_RESULT_REFUSED || result == DB_RESULT_FAILED)
		commander->react_at = now + REFUSED_AGAIN;
	else
		commander->react_ticket = 0;
}

static uint32_t microseconds(db_time span)
{
	db_time us = span / DB_NS_PER_US;

	return us < 0 ? 0 : us > UINT32_MAX ? UINT32_MAX : (uint32_t)us;
}

void db_commander_complete(struct db_commander *commander, const struct db_completion *completion,
                           db_time now)
{
	struct slot *slot = slot_of(commander, completion->ticket);
	/* To the confirmation itself, not to when this thread came to hear of it. */
	db_time end = completion->finished ? completion->finished : now;
	uint32_t took_us;
	struct slot ended;

	if (!slot)
		return;
	took_us = microseconds(end - slot->arrived);
	db_outcome_complete(&commander->shown, completion->ticket, completion->result, took_us);
	db_writers_complete(&commander->writers, completion->ticket, completion->result, took_us);
	note_ended(commander, slot, completion->result, end);
	if (commander->react_ticket == completion->ticket)
		note_reaction(commander, completion->result, now);
	ended = *slot;
	slot->ticket = 0;
	slot->waiter_count = 0;
	answer_waiters(commander, &ended, db_result_exception(completion->result));
}

db_time db_commander_next_deadline(const struct db_commander *commander)
{
	db_time next = db_watchdog_deadline(&commander->watchdog);

	if (commander->react_at < next)
		next = commander->react_at;
	if (commander->find_at < next)
		next = commander->find_at;
	if (commander->follow.active && commander->look_at < next)
		next = commander->look_at;
	if (commander->waiting == 0)
		return next;
	for (size_t i = 0; i < SLOTS; i++) {
		const struct slot *slot = &commander->slots[i];

		for (unsigned j = 0; j < slot->waiter_count; j++) {
			if (slot->waiters[j].deadline < next)
				next = slot->waiters[j].deadline;
		}
	}
	return next;
}

/* What a writer whose time is up is told: that it takes longer, or why it surely will. */
static uint8_t late_answer(const struct db_commander *commander)
{
	enum db_result result = reach(commander, DB_CMD_NONE);

	return result == DB_RESULT_OK ? MODBUS_EXCEPTION_ACKNOWLEDGE : db_result_exception(result);
}

static void expire_slot(struct db_commander *commander, struct slot *slot, db_time now)
{
	struct slot due = { .waiter_count = 0 };
	unsigned kept = 0;

	for (unsigned i = 0; i < slot->waiter_count; i++) {
		if (slot->waiters[i].deadline <= now)
			due.waiters[due.waiter_count++] = slot->waiters[i];
		else
			slot->waiters[kept++] = slot->waiters[i];
	}
	slot->waiter_count = kept;
	if (due.waiter_count > 0)
		answer_waiters(commander, &due, late_answer(commander));
}

/* Stops the drive because nobody talks to it. Tried again soon if there is no room for a request. */
static void react(struct db_commander *commander, db_time now)
{
	struct db_command_block block = { .command = (uint16_t)commander->config.on_client_loss };
	struct db_request request = {
		.command = commander->config.on_client_loss,
		.submitted = now,
	};
	struct slot *slot;

	if (!submit(commander, NULL, &request, 0, &slot)) {
		commander->react_at = now + REACT_AGAIN;
		return;
	}
	commander->react_at = DB_TIME_NEVER;
	note_submitted(commander, NULL, request.command, now);
	if (commander->react_ticket == 0)
		record(commander, NULL, &block, 0, DB_RESULT_PENDING, request.ticket, now);
	commander->react_ticket = request.ticket;
	commander->newest = request.ticket;
	show(commander, NULL, 0, (uint16_t)request.command, DB_RESULT_PENDING, request.ticket);
}

void db_commander_hear(struct db_commander *commander, const struct db_client *client, db_time now)
{
	db_writers_hear(&commander->writers, client, now);
}

bool db_commander_feed(struct db_commander *commander, enum db_watchdog_feed by, db_time now)
{
	return db_watchdog_feed(&commander->watchdog, by, now);
}

void db_commander_set_watchdog(struct db_commander *commander, uint32_t timeout_ms, db_time now)
{
	db_watchdog_set(&commander->watchdog, timeout_ms, now);
}

/*
 * A drive that moves when it is first seen was set going before this program ran. Its PLC is watched
 * from now on as if it had commanded the motion here: should it have gone meanwhile, the drive stops.
 */
static void find(struct db_commander *commander, db_time now)
{
	struct db_snapshot snapshot;

	if (commander->find_at > now)
		return;
	db_axis_read(commander->config.axis, &snapshot);
	if (!(snapshot.feedback.status & DB_STATUS_ONLINE)) {
		commander->find_at = now + FIND_INTERVAL;
		return;
	}
	commander->find_at = DB_TIME_NEVER;
	if ((snapshot.feedback.status & DB_STATUS_MOVING) && !commander->watchdog.armed)
		db_watchdog_arm(&commander->watchdog, now);
}

bool db_commander_expire(struct db_commander *commander, db_time now)
{
	bool tripped = db_watchdog_trip(&commander->watchdog, now);

	if (tripped || commander->react_at <= now)
		react(commander, now);
	find(commander, now);
	look_at_motion(commander, now);
	for (size_t i = 0; i < SLOTS && commander->waiting > 0; i++)
		expire_slot(commander, &commander->slots[i], now);
	return tripped;
}

const struct db_history_entry *db_commander_history(const struct db_commander *commander,
                                                    size_t age)
{
	return db_history_get(&commander->history, age);
}

struct db_command_block db_commander_kept(struct db_commander *commander,
                                          const struct db_client *client)
{
	const struct db_writer *writer = db_writers_find(&commander->writers, client);
	struct db_command_block block = commander->kept;

	block.command_id = writer ? writer->kept_id : 0;
	return block;
}

/* Its own latest command's, if it has one that is remembered; else the drive's. */
static const struct db_outcome *outcome_for(struct db_commander *commander,
                                            const struct db_client *client)
{
	const struct db_writer *writer = db_writers_find(&commander->writers, client);

	return commander->writers.by_address && writer && writer->commanded ? &writer->shown :
	                                                                      &commander->shown;
}

void db_commander_state(struct db_commander *commander, const struct db_client *client,
                        struct db_command_state *state, db_time now)
{
	const struct db_outcome *outcome = outcome_for(commander, client);
	uint32_t oldest = 0;

	*state = (struct db_command_state){
		.result_id = outcome->result_id,
		.result = outcome->result,
		.result_command = outcome->result_command,
		.write_result = outcome->write_result,
		.result_time_us = outcome->result_time_us,
		.result_limit = outcome->result_limit,
		.aborted_id = outcome->aborted_id,
		.motion_id = outcome->motion_id,
		.motion_result = outcome->motion_result,
		.done = outcome->done,
		.aborted = outcome->aborted,
	};
	state->busy = false;
	state->latched = commander->watchdog.latched;
	state->watchdog_ms = commander->watchdog.timeout_ms;
	state->watchdog_remaining_ms = db_watchdog_remaining_ms(&commander->watchdog, now);
	state->watchdog_trips = commander->watchdog.trips;
	state->active_command = DB_CMD_NONE;
	for (size_t i = 0; i < SLOTS; i++) {
		const struct slot *slot = &commander->slots[i];
		uint32_t age = commander->submitted - slot->order;

		if (slot->ticket == 0)
			continue;
		state->busy = true;
		if (slot->command != DB_CMD_NONE && age > oldest) {
			oldest = age;
			state->active_command = (uint16_t)slot->command;
		}
	}
}
