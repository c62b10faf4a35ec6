/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/commander.h"

#include "axis/follow.h"
#include "axis/history.h"
#include "axis/limits.h"
#include "axis/pending.h"
#include "axis/supervise.h"
#include "axis/watchdog.h"
#include "axis/writers.h"
#include "drivebridge/command_table.h"
#include "drivebridge/scale.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

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

/* Who asks for something. */
struct origin {
	const struct db_client *client; /* null: the bridge itself */
	struct db_writer *writer;       /* its memory; null: it has none, and no ids */
	bool block;                     /* by the command block, where a write may be sent again */
	bool bare;                      /* ... without a command_id */
	uint32_t group;                 /* see struct db_request */
};

struct db_commander {
	struct db_commander_config config;
	const struct db_commander_ops *ops;
	void *context;

	struct db_follow follow; /* the motion that the drive has begun last, if it has an end */
	uint32_t follow_entry;   /* of that in the history */
	db_time follow_arrived;
	struct db_supervise supervise; /* the motion without one */
	db_time look_at;               /* the next look at it */
	db_time look_interval;

	struct db_watchdog watchdog;
	db_time find_at; /* the next look whether the drive is there and moves; NEVER: it was seen */
	uint32_t react_ticket; /* the watchdog's stop, until the drive has confirmed it; 0 */
	db_time again_at;      /* a client's stop is to be said again then; or NEVER */
	db_time react_at;      /* the watchdog's stop is to be said again then; or NEVER */

	struct db_command_block kept;
	struct db_writers writers;
	struct db_outcome shown; /* of the latest, whoever wrote it */
	uint32_t newest;         /* the command that was submitted last */
	uint32_t submitted;      /* requests so far */
	unsigned waiting;        /* waiters in all slots */
	struct db_pending pending;
	struct db_history history;
};

static db_time look_interval(const struct db_bus_config *bus)
{
	db_time cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;

	return cycle < LOOK_MIN ? LOOK_MIN : cycle > LOOK_MAX ? LOOK_MAX : cycle;
}

static struct db_follow_config follow_config(const struct db_commander *commander)
{
	const struct db_drive_config *drive = commander->config.drive_config;
	const struct db_bus_config *bus = commander->config.bus_config;
	db_time cycle = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	db_time patience = PATIENCE_CYCLES * cycle;

	return (struct db_follow_config){
		.window = drive->in_position_window * drive->counts_per_unit,
		.settling = (db_time)drive->settling_ms * DB_NS_PER_MS,
		.patience = patience < PATIENCE_MIN ? PATIENCE_MIN : patience,
	};
}

int db_commander_new(const struct db_commander_config *config, const struct db_commander_ops *ops,
                     void *context, struct db_commander **commander)
{
	const struct db_pending *neighbour = config->neighbour ? &config->neighbour->pending : NULL;
	struct db_commander *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	if (db_pending_init(&made->pending, config->bus_config->queue, neighbour) != 0 ||
	    (config->ids_by_client && db_writers_reserve(&made->writers) != 0)) {
		db_commander_free(made);
		return -ENOMEM;
	}
	made->config = *config;
	made->config.neighbour = NULL; /* it may go first */
	made->ops = ops;
	made->context = context;
	made->react_at = DB_TIME_NEVER;
	made->again_at = DB_TIME_NEVER;
	db_writers_set(&made->writers, config->ids_by_client);
	made->look_interval = look_interval(config->bus_config);
	db_watchdog_init(&made->watchdog,
	                 config->on_client_loss == DB_CMD_NONE ? 0 : config->watchdog_ms,
	                 config->drive_config->watchdog_feed);
	made->find_at = made->watchdog.timeout_ms == 0 ? DB_TIME_NEVER : 0;
	*commander = made;
	return 0;
}

void db_commander_free(struct db_commander *commander)
{
	if (!commander)
		return;
	db_pending_release(&commander->pending);
	db_writers_release(&commander->writers);
	free(commander);
}

uint16_t db_ticket_drive(uint32_t ticket)
{
	return (uint16_t)((ticket >> 16) - 1);
}

static struct db_slot *slot_of(struct db_commander *commander, uint32_t ticket)
{
	return db_pending_find(&commander->pending, ticket);
}

/* The clients' stops of one kind that are pending, and the youngest of them; null. */
static struct db_slot *youngest_stop(struct db_commander *commander, enum db_command command,
                                     unsigned *count)
{
	struct db_slot *youngest = NULL;

	*count = 0;
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (!db_command_is_stop(command) || slot->reaction || slot->command != command)
			continue;
		(*count)++;
		if (!youngest ||
		    commander->submitted - slot->order < commander->submitted - youngest->order)
			youngest = slot;
	}
	return youngest;
}

static struct db_write_answer answer_now(enum db_result result)
{
	return (struct db_write_answer){ .result = result };
}

/* The writer waits for the slot's end, unless it is not to wait or there is no room. */
static struct db_write_answer wait_for(struct db_commander *commander, struct db_slot *slot,
                                       struct db_write_token token, db_time now)
{
	if (commander->config.accept_writes)
		return answer_now(DB_RESULT_OK);
	if (slot->waiter_count == DB_COMMANDER_WAITERS)
		return answer_now(DB_RESULT_PENDING);
	slot->waiters[slot->waiter_count++] = (struct db_waiter){
		.token = token,
		.deadline = now + (db_time)commander->config.confirm_ms * DB_NS_PER_MS,
	};
	commander->waiting++;
	return (struct db_write_answer){ .later = true };
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
 * unless that was used already.
 */
static uint16_t id_of(const struct db_writer *writer, const struct db_command_write *write)
{
	uint16_t id = write->block.command_id;

	return write->has_id || id != writer->last.id ? id : 0;
}

/* The execution that a write repeats: of the id that was used last, or for one of `command` alone whose
 * kept id was used, of what was executed last, if it asks for the same. Null: it repeats nothing. */
static const struct db_used_id *repeated(const struct origin *by,
                                         const struct db_command_block *block, uint16_t id)
{
	const struct db_writer *writer = by->writer;

	if (id != 0 && id == writer->last.id)
		return writer->last.result == DB_RESULT_BUSY ? NULL : &writer->last;
	if (by->bare && id == 0 && block->command_id != 0 && block->command_id == writer->last.id &&
	    equals_executed(writer, block))
		return &writer->execution;
	return NULL;
}

/* --- limits -------------------------------------------------------------------------------------- */

/* What the drive's parameters will be is open. */
static bool settings_are_pending(const struct db_commander *commander)
{
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->command == DB_CMD_NONE)
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
	facts.counts = db_scale_counts(commander->config.drive_config, &snapshot.feedback);
	facts.scale_open = db_scale_is_open(commander->config.driver,
	                                    commander->config.drive_config, &snapshot.feedback);
	facts.position = snapshot.feedback.position;
	facts.velocity_counts = db_driver_velocity_counts(commander->config.driver,
	                                                  commander->config.drive_config);
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
	struct db_limit_facts facts = limit_facts(commander);

	for (size_t i = 0; i < count; i++) {
		int param = settings[i].param;
		enum db_limit limit;

		if (param != driver->acceleration_param && param != driver->deceleration_param)
			continue;
		limit = db_limits_acceleration(
			commander->config.drive_config,
			db_value_number(driver->params[param].type, settings[i].value) *
				facts.velocity_counts,
			&facts);
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
	commander->shown.write_register = 0;
	commander->shown.write_ticket = ticket;
	if (!writer)
		return;
	writer->shown.write_result = (uint16_t)result;
	writer->shown.write_register = 0;
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

/* `slot` is null for what ends without the bus. */
static void record(struct db_commander *commander, const struct db_client *client,
                   const struct db_command_block *block, uint16_t id, enum db_result result,
                   struct db_slot *slot)
{
	uint32_t number;
	struct db_history_entry entry = {
		.command_id = id,
		.command = block->command,
		.result = (uint16_t)result,
	};

	stamp(commander, client, &entry);
	db_history_args(&entry, block->command, &block->args);
	number = db_history_add(&commander->history, &entry, slot != NULL);
	if (slot)
		slot->entry = number;
}

/* Everybody who may read reads the history. */
static bool is_secret(const struct db_commander *commander, unsigned param)
{
	return param < DB_PARAMS_MAX && (commander->config.driver->secret_params >> param & 1);
}

static void record_settings(struct db_commander *commander, const struct db_client *client,
                            const struct db_setting *settings, enum db_result result,
                            struct db_slot *slot)
{
	uint32_t number;
	struct db_history_entry entry = {
		.number = settings[0].param,
		.value = is_secret(commander, settings[0].param) ? 0 : settings[0].value.u,
		.result = (uint16_t)result,
	};

	stamp(commander, client, &entry);
	number = db_history_add(&commander->history, &entry, slot != NULL);
	if (slot)
		slot->entry = number;
}

static bool is_refusal(enum db_result result)
{
	switch (result) {
	case DB_RESULT_NONE:
	case DB_RESULT_PENDING:
	case DB_RESULT_CANCELLED:
	case DB_RESULT_NOT_IN_CONTROL:
	case DB_RESULT_RUNS_ON:
		return false;
	default:
		return !db_result_is_success(result);
	}
}

static void tell_refusal(const struct db_commander *commander, const struct db_client *client,
                         const struct db_refused_write *write)
{
	if (commander->ops->refused && is_refusal(write->result))
		commander->ops->refused(commander->context, client, write);
}

static const char *param_name(const struct db_driver *driver, size_t param)
{
	return param < driver->param_count ? driver->params[param].name : NULL;
}

static bool sets_in_motion(enum db_command command)
{
	return db_command_ends_motion(command) && !db_command_is_stop(command);
}

/* Ends a command without the bus. */
static struct db_write_answer refuse(struct db_commander *commander, const struct origin *by,
                                     const struct db_command_block *block, uint16_t id,
                                     enum db_result result)
{
	show(commander, by->writer, id, block->command, result, 0);
	if (sets_in_motion((enum db_command)block->command)) {
		db_outcome_refuse_motion(&commander->shown);
		if (by->writer)
			db_outcome_refuse_motion(&by->writer->shown);
	}
	record(commander, by->client, block, id, result, NULL);
	tell_refusal(commander, by->client,
	             &(struct db_refused_write){
			     .command = (enum db_command)block->command,
			     .result = result,
		     });
	return answer_now(result);
}

/* --- motion without a target ----------------------------------------------------------------------- */

/* What a stop of it depends on now. */
static struct db_supervise_config supervise_config(const struct db_commander *commander,
                                                   const struct db_feedback *feedback)
{
	const struct db_drive_config *drive = commander->config.drive_config;
	const struct db_bus_config *bus = commander->config.bus_config;
	const struct db_driver *driver = commander->config.driver;
	double counts = db_scale_counts(drive, feedback);
	double velocity_counts = db_driver_velocity_counts(driver, drive);
	struct db_supervise_config config = {
		.min = drive->min_position * counts,
		.max = drive->max_position * counts,
		.velocity_counts = velocity_counts,
		.deceleration = (double)feedback->deceleration,
		.delay = 2 * commander->look_interval + driver->command_time(bus),
	};
	int param = driver->deceleration_param;
	struct db_nameplate plate;

	if (config.deceleration > 0.0 || param < 0)
		return config;
	db_axis_read_nameplate(commander->config.axis, &plate);
	if (plate.valid >> param & 1)
		config.deceleration = db_value_number(driver->params[param].type,
		                                      plate.values[param]) *
		                      velocity_counts;
	return config;
}

static bool has_position_limits(const struct db_commander *commander)
{
	const struct db_drive_config *drive = commander->config.drive_config;

	return !isnan(drive->min_position) || !isnan(drive->max_position);
}

/* What was handed to the bus, or begun, is to be watched, or ends what is. */
static void note_supervised(struct db_commander *commander, enum db_command command, db_time now)
{
	struct db_supervise_config config;
	struct db_snapshot snapshot;

	if (!has_position_limits(commander))
		return;
	if (db_supervise_applies(command)) {
		db_supervise_begin(&commander->supervise, now);
		commander->look_at = now + LOOK_MIN;
	} else if (db_command_is_stop(command)) {
		db_axis_read(commander->config.axis, &snapshot);
		config = supervise_config(commander, &snapshot.feedback);
		db_supervise_stop(&commander->supervise, &config, &snapshot.feedback, now);
	} else if (db_command_is_motion(command)) {
		commander->supervise.active = false;
	}
}

/* --- carrying out -------------------------------------------------------------------------------- */

/* Whatever moved is ended by another command. Who began it is told so. */
static void abort_motion(struct db_commander *commander, db_time now)
{
	commander->shown.done = commander->shown.aborted = false;
	db_outcome_cancel_motion(&commander->shown);
	db_writers_cancel_motion(&commander->writers);
	if (commander->follow.active)
		db_history_end(&commander->history, commander->follow_entry, DB_RESULT_CANCELLED,
		               now - commander->follow_arrived);
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
	note_supervised(commander, command, now);
	db_outcome_ask_motion(&commander->shown);
	if (writer)
		db_outcome_ask_motion(&writer->shown);
	if (!db_command_is_stop(command))
		return;
	abort_motion(commander, now);
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (sets_in_motion(slot->command))
			slot->overtaken = true;
	}
}

/* Of no request that is pending, however long; what it meant before is over. */
static uint32_t new_ticket(struct db_commander *commander)
{
	uint32_t ticket;

	do
		ticket = ((uint32_t)commander->config.drive + 1) << 16 |
		         (commander->submitted++ & 0xFFFFu);
	while (slot_of(commander, ticket));
	db_writers_retire(&commander->writers, ticket);
	db_outcome_retire(&commander->shown, ticket);
	return ticket;
}

/* Who waits for the older stop, or would be told of it, waits for the younger one. */
static void take_place(struct db_commander *commander, struct db_slot *older,
                       struct db_slot *younger)
{
	memcpy(younger->waiters, older->waiters, sizeof younger->waiters);
	younger->waiter_count = older->waiter_count;
	older->waiter_count = 0;
	db_writers_retarget(&commander->writers, older->ticket, younger->ticket);
	db_outcome_retarget(&commander->shown, older->ticket, younger->ticket);
}

/* False when the drive's or the bus's queue is full. */
static bool submit(struct db_commander *commander, const struct db_client *client,
                   struct db_request *request, uint16_t id, struct db_slot **slot)
{
	struct db_slot taken = { .command = request->command };

	*slot = db_pending_place(&commander->pending, request->command);
	if (!*slot)
		return false;
	request->ticket = new_ticket(commander);
	request->drive = commander->config.drive;
	if (!commander->ops->submit(commander->context, request))
		return false;
	taken.ticket = request->ticket;
	taken.order = commander->submitted - 1;
	taken.id = id;
	taken.arrived = request->submitted;
	if (client) {
		taken.has_client = true;
		taken.port = client->port;
		memcpy(taken.address, client->address, sizeof taken.address);
	}
	db_pending_add(&commander->pending, *slot, &taken);
	return true;
}

/* The command block's newest command that went to the bus. */
static void note_executed(struct db_writer *writer, const struct db_command_block *block,
                          uint16_t id, enum db_result result, uint32_t ticket)
{
	writer->has_executed = true;
	writer->executed = *block;
	writer->execution = (struct db_used_id){
		.id = id,
		.result = result,
		.sent = ticket != 0,
		.ticket = ticket,
	};
}

static bool clears_latch(const struct db_commander *commander, enum db_command command)
{
	return commander->watchdog.latched && command == DB_CMD_CLEAR_FAULT;
}

/* A stop is to be handed to the bus as soon as one before it ended. */
static bool stop_is_due(const struct db_commander *commander)
{
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->again)
			return true;
	}
	return false;
}

static struct db_write_answer carry_out(struct db_commander *commander, const struct origin *by,
                                        const struct db_command_block *block, uint16_t id,
                                        struct db_write_token token, db_time now)
{
	struct db_request request = { 0 };
	enum db_result result = reach(commander, (enum db_command)block->command);
	struct db_slot *older;
	struct db_slot *slot;
	unsigned count;

	if (result != DB_RESULT_OK)
		return refuse(commander, by, block, id, result);
	request.command = (enum db_command)block->command;
	request.args = block->args;
	request.submitted = now;
	request.group = by->group;
	older = youngest_stop(commander, request.command, &count);
	/* It would be sent before a stop that came before it. */
	if (!db_command_is_stop(request.command) && stop_is_due(commander))
		return refuse(commander, by, block, id, DB_RESULT_BUSY);
	if (!submit(commander, by->client, &request, id, &slot))
		return refuse(commander, by, block, id, DB_RESULT_BUSY);
	if (older)
		take_place(commander, older, slot);
	if (clears_latch(commander, request.command))
		slot->ends_trip = commander->watchdog.trips;
	if (db_command_may_move(request.command))
		db_watchdog_arm(&commander->watchdog, db_client_arrived(by->client, now));
	note_submitted(commander, by->writer, request.command, now);
	record(commander, by->client, block, id, DB_RESULT_PENDING, slot);
	commander->newest = request.ticket;
	if (by->writer && by->block)
		note_executed(by->writer, block, id, DB_RESULT_PENDING, request.ticket);
	show(commander, by->writer, id, block->command, DB_RESULT_PENDING, request.ticket);
	return wait_for(commander, slot, token, now);
}

/* The same came again: its answer is that of the first time. */
static struct db_write_answer repeat(struct db_commander *commander, struct db_writer *writer,
                                     const struct db_used_id *first, struct db_write_token token,
                                     db_time now)
{
	struct db_slot *slot = slot_of(commander, first->ticket);

	show_write(commander, writer, first->result, slot ? slot->ticket : 0);
	if (slot)
		return wait_for(commander, slot, token, now);
	return answer_now(commander->config.accept_writes && first->sent ? DB_RESULT_OK :
	                                                                   first->result);
}

/*
 * The pending stop that this one may join: the drive's newest command, or one that is to be handed to
 * the bus once more. An older one must not be joined as it is, because what was queued after it would
 * run after both: where there is no place for another of its kind, it will be said again.
 */
static struct db_slot *joinable(struct db_commander *commander, enum db_command command)
{
	struct db_slot *newest = slot_of(commander, commander->newest);
	struct db_slot *youngest;
	unsigned count;

	if (newest && newest->command == command)
		return newest;
	youngest = youngest_stop(commander, command, &count);
	if (count < DB_COMMANDER_STOPS_OF_A_KIND && !(youngest && youngest->again))
		return NULL;
	youngest->again = true;
	commander->newest = youngest->ticket;
	return youngest;
}

static struct db_write_answer join(struct db_commander *commander, const struct origin *by,
                                   struct db_slot *slot, const struct db_command_block *block,
                                   uint16_t id, struct db_write_token token, db_time now)
{
	if (by->writer)
		db_outcome_ask_motion(&by->writer->shown);
	if (by->writer && by->block)
		note_executed(by->writer, block, id, DB_RESULT_PENDING, slot->ticket);
	if (slot->again)
		note_submitted(commander, by->writer, slot->command, now);
	db_history_repeat(&commander->history, slot->entry);
	show(commander, by->writer, id, block->command, DB_RESULT_PENDING, slot->ticket);
	return wait_for(commander, slot, token, now);
}

/* Whether the latch is all there is to clear: the drive itself has no fault, or nothing that could
 * clear it. */
static bool is_only_latched(const struct db_commander *commander)
{
	struct db_snapshot snapshot;

	if (!is_supported(&commander->config, DB_CMD_CLEAR_FAULT))
		return true;
	db_axis_read(commander->config.axis, &snapshot);
	return snapshot.feedback.error == DB_ERROR_NONE;
}

/* Ends the latch. What moves all the same is watched again. */
static void unlatch(struct db_commander *commander, db_time now)
{
	struct db_snapshot snapshot;

	db_watchdog_reset(&commander->watchdog);
	commander->react_ticket = 0;
	commander->react_at = DB_TIME_NEVER;
	db_axis_read(commander->config.axis, &snapshot);
	if (snapshot.feedback.status & DB_STATUS_MOVING)
		db_watchdog_arm(&commander->watchdog, now);
}

unsigned db_commander_input_ports(const struct db_commander *commander)
{
	const struct db_driver *driver = commander->config.driver;
	struct db_nameplate plate;

	if (!driver->input_ports || settings_are_pending(commander))
		return 0;
	db_axis_read_nameplate(commander->config.axis, &plate);
	return plate.doubtful ? 0 : driver->input_ports(&plate);
}

/* The drive is told of one port after the other, and would refuse one in the middle. */
static bool touches_input(const struct db_commander *commander,
                          const struct db_command_block *block)
{
	return block->command == DB_CMD_SET_OUTPUTS &&
	       (block->args.output_mask & db_commander_input_ports(commander)) != 0;
}

/* What may be said before the drive is asked; OK: it is to be asked. */
static enum db_result permit(struct db_commander *commander, struct db_writer *writer,
                             const struct db_command_block *block, uint16_t id)
{
	enum db_command code = (enum db_command)block->command;
	enum db_result result = check(&commander->config, block->command, &block->args);

	/* The latch is the bridge's own: it ends also where the drive has nothing to clear. */
	if (result == DB_RESULT_UNSUPPORTED && clears_latch(commander, code))
		result = DB_RESULT_OK;
	if (result == DB_RESULT_OK)
		result = check_limits(commander, writer, block);
	if (result != DB_RESULT_OK)
		return result;
	if (touches_input(commander, block))
		return DB_RESULT_REFUSED;
	if (id != 0 && writer && writer->last.id == 0 && !db_command_is_stop(code))
		return DB_RESULT_RESTARTED;
	if (commander->watchdog.latched && db_command_may_move(code))
		return DB_RESULT_LATCHED;
	return DB_RESULT_OK;
}

/* The latch of a drive that has no fault itself. One that cannot be asked keeps it: what it does now
 * nobody knows. */
static struct db_write_answer end_latch(struct db_commander *commander, const struct origin *by,
                                        const struct db_command_block *block, uint16_t id,
                                        db_time now)
{
	enum db_result result = reach(commander, DB_CMD_CLEAR_FAULT);

	if (result != DB_RESULT_OK)
		return refuse(commander, by, block, id, result);
	unlatch(commander, now);
	if (by->writer && by->block)
		note_executed(by->writer, block, id, DB_RESULT_OK, 0);
	return refuse(commander, by, block, id, DB_RESULT_OK);
}

/* Without a writer there is no id. */
static struct db_write_answer decide(struct db_commander *commander, const struct origin *by,
                                     const struct db_command_block *block, uint16_t id,
                                     struct db_write_token token, db_time now)
{
	enum db_command code = (enum db_command)block->command;
	bool stop = db_command_is_stop(code);
	const struct db_used_id *first = stop || !by->writer ? NULL : repeated(by, block, id);
	enum db_result result;
	struct db_slot *slot;

	if (first)
		return repeat(commander, by->writer, first, token, now);
	result = permit(commander, by->writer, block, id);
	if (result != DB_RESULT_OK)
		return refuse(commander, by, block, id, result);
	if (clears_latch(commander, code) && is_only_latched(commander))
		return end_latch(commander, by, block, id, now);
	slot = stop ? joinable(commander, code) : NULL;
	return slot ? join(commander, by, slot, block, id, token, now) :
	              carry_out(commander, by, block, id, token, now);
}

/* Who commands a drive is missed when it falls silent; who only stops it need not be. */
static struct db_write_answer command(struct db_commander *commander, const struct origin *by,
                                      const struct db_command_block *block, uint16_t id,
                                      struct db_write_token token, db_time now)
{
	struct db_write_answer answer = decide(commander, by, block, id, token, now);

	if (by->client && !db_command_is_stop((enum db_command)block->command))
		db_watchdog_commanded(&commander->watchdog, by->client->id);
	return answer;
}

/* What is staged is checked now, so that the start of a group finds no surprises. */
static struct db_write_answer stage(struct db_commander *commander, const struct origin *by,
                                    const struct db_command_write *write)
{
	struct db_command_block block = write->block;
	enum db_result result;

	block.command = block.staged_command;
	if (write->has_command && write->block.command != DB_CMD_NONE)
		return refuse(commander, by, &block, 0, DB_RESULT_OUT_OF_RANGE);
	result = check(&commander->config, block.command, &block.args);
	if (result == DB_RESULT_OK)
		result = check_limits(commander, by->writer, &block);
	return result == DB_RESULT_OK ? answer_now(DB_RESULT_OK) :
	                                refuse(commander, by, &block, 0, result);
}

enum db_command db_commander_staged(const struct db_commander *commander)
{
	return (enum db_command)commander->kept.staged_command;
}

uint32_t db_commander_newest(const struct db_commander *commander)
{
	return commander->newest;
}

struct db_write_answer db_commander_start_staged(struct db_commander *commander,
                                                 const struct db_client *client, uint32_t group,
                                                 struct db_write_token token, db_time now)
{
	struct origin by = {
		.client = client,
		.writer = db_writers_claim(&commander->writers, client, now),
		.group = group,
	};
	struct db_command_block block = commander->kept;

	block.command = block.staged_command;
	commander->kept.staged_command = DB_CMD_NONE;
	return command(commander, &by, &block, 0, token, now);
}

struct db_write_answer db_commander_write(struct db_commander *commander,
                                          const struct db_client *client,
                                          const struct db_command_write *write,
                                          struct db_write_token token, db_time now)
{
	bool stages = write->has_staged && write->block.staged_command != DB_CMD_NONE;
	bool commands = write->has_command && write->block.command != DB_CMD_NONE;
	struct origin by = { .client = client, .block = true };
	struct db_write_answer answer = answer_now(DB_RESULT_OK);

	by.bare = !write->has_id;
	/* Who only writes arguments takes no place from those who number their commands. */
	if (stages || commands || write->has_id)
		by.writer = db_writers_claim(&commander->writers, client, now);
	/* Whatever else stands in the block, a stop is a stop. */
	if (stages && !(commands && db_command_is_stop((enum db_command)write->block.command)))
		answer = stage(commander, &by, write);
	else if (commands)
		answer = command(commander, &by, &write->block, id_of(by.writer, write), token,
		                 now);
	if (!db_write_is_taken(answer))
		return answer;
	commander->kept = write->block;
	if (write->has_id && by.writer)
		by.writer->kept_id = write->block.command_id;
	return answer;
}

struct db_write_answer db_commander_execute(struct db_commander *commander,
                                            const struct db_client *client, enum db_command code,
                                            const struct db_args *args, struct db_write_token token,
                                            db_time now)
{
	struct origin by = {
		.client = client,
		.writer = db_writers_claim(&commander->writers, client, now),
	};
	struct db_command_block block = { .command = (uint16_t)code, .args = *args };

	return command(commander, &by, &block, 0, token, now);
}

static void show_refused(struct db_commander *commander, const struct db_client *client,
                         enum db_result result, uint16_t address)
{
	struct db_writer *writer = db_writers_find(&commander->writers, client);

	show_write(commander, writer, result, 0);
	commander->shown.write_register = address;
	if (writer)
		writer->shown.write_register = address;
}

void db_commander_set_refused(struct db_commander *commander, const struct db_client *client,
                              enum db_result result, uint16_t address)
{
	show_refused(commander, client, result, address);
	tell_refusal(commander, client,
	             &(struct db_refused_write){ .address = address, .result = result });
}

void db_commander_refuse(struct db_commander *commander, const struct db_client *client,
                         const struct db_command_block *block, enum db_result result,
                         uint16_t address)
{
	const struct db_setting unknown = { .param = DB_HISTORY_UNKNOWN };

	show_refused(commander, client, result, address);
	tell_refusal(commander, client,
	             &(struct db_refused_write){
			     .command = (enum db_command)block->command,
			     .result = result,
		     });
	if (block->command == DB_CMD_NONE)
		record_settings(commander, client, &unknown, result, NULL);
	else
		record(commander, client, block, block->command_id, result, NULL);
}

struct db_write_answer db_commander_set(struct db_commander *commander,
                                        const struct db_client *client,
                                        const struct db_setting *settings, size_t count,
                                        struct db_write_token token, db_time now)
{
	struct db_writer *writer = db_writers_find(&commander->writers, client);
	struct db_request request = { 0 };
	enum db_result result = check_acceleration(commander, writer, settings, count);
	struct db_slot *slot = NULL;

	if (result == DB_RESULT_OK)
		result = reach(commander, DB_CMD_NONE);
	request.submitted = now;
	request.setting_count = (uint16_t)count;
	request.settings = settings;
	if (result == DB_RESULT_OK && !submit(commander, client, &request, 0, &slot))
		result = DB_RESULT_BUSY;
	if (result != DB_RESULT_OK) {
		show_write(commander, writer, result, 0);
		record_settings(commander, client, settings, result, NULL);
		tell_refusal(
			commander, client,
			&(struct db_refused_write){
				.param = param_name(commander->config.driver, settings[0].param),
				.result = result,
			});
		return answer_now(result);
	}
	/* A later stop is not to join one from before this, which would leave it standing. */
	commander->newest = request.ticket;
	record_settings(commander, client, settings, DB_RESULT_PENDING, slot);
	show_write(commander, writer, DB_RESULT_PENDING, request.ticket);
	return wait_for(commander, slot, token, now);
}

/* --- how it ended ---------------------------------------------------------------------------------- */

static void answer_waiters(struct db_commander *commander, struct db_slot *slot,
                           enum db_result result)
{
	/* Taken out first: an answer may let the writer's next request in. */
	unsigned count = slot->waiter_count;
	struct db_waiter waiters[DB_COMMANDER_WAITERS];

	memcpy(waiters, slot->waiters, sizeof waiters);
	slot->waiter_count = 0;
	commander->waiting -= count;
	for (unsigned i = 0; i < count; i++)
		commander->ops->answer(commander->context, waiters[i].token, result);
}

void db_commander_set_writers(struct db_commander *commander, unsigned confirm_ms,
                              bool accept_writes, bool ids_by_client)
{
	commander->config.confirm_ms = confirm_ms;
	commander->config.accept_writes = accept_writes;
	if (commander->writers.by_address == ids_by_client)
		return;
	/* Whose an id was cannot be said any more: each begins with a baseline again. */
	db_writers_set(&commander->writers, ids_by_client);
}

int db_commander_reserve(struct db_commander *commander, bool ids_by_client)
{
	return ids_by_client ? db_writers_reserve(&commander->writers) : 0;
}

void db_commander_dismiss(struct db_commander *commander)
{
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next)
		answer_waiters(commander, slot, DB_RESULT_CANCELLED);
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
		return !db_result_is_success(result);
	}
}

static struct db_writer *writer_of(struct db_commander *commander, const struct db_slot *slot)
{
	struct db_client client;

	return db_writers_find(&commander->writers, db_slot_client(slot, &client));
}

/* The drive has taken it: its result stays ok, unless the motion ends badly. */
static void note_begun(struct db_commander *commander, const struct db_slot *slot, db_time now)
{
	struct db_writer *writer = writer_of(commander, slot);
	bool ends = db_follow_applies(slot->command);

	abort_motion(commander, now);
	if (!db_command_is_motion(slot->command))
		return;
	if (!slot->overtaken)
		note_supervised(commander, slot->command, now);
	db_outcome_begin_motion(&commander->shown, slot->id, ends, slot->overtaken);
	if (writer)
		db_outcome_begin_motion(&writer->shown, slot->id, ends, slot->overtaken);
	if (slot->overtaken || !ends)
		return;
	db_follow_begin(&commander->follow, slot->command, slot->ticket, now);
	commander->follow_entry = slot->entry;
	commander->follow_arrived = slot->arrived;
	commander->look_at = now + LOOK_MIN;
}

/* The drive did not take it. */
static void note_refused(struct db_commander *commander, const struct db_slot *slot)
{
	struct db_writer *writer = writer_of(commander, slot);

	db_outcome_refuse_motion(&commander->shown);
	if (writer)
		db_outcome_refuse_motion(&writer->shown);
}

static void note_ended(struct db_commander *commander, const struct db_slot *slot,
                       enum db_result result, db_time now)
{
	db_history_end(&commander->history, slot->entry, result, now - slot->arrived);
	if (!sets_in_motion(slot->command))
		return;
	if (never_began(result)) {
		note_refused(commander, slot);
		return;
	}
	if (db_result_is_success(result))
		note_begun(commander, slot, now);
	else
		abort_motion(commander, now);
}

/* A motion is on its way to the drive: whether the one before reaches its end is open. */
static bool motion_is_pending(const struct db_commander *commander)
{
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (sets_in_motion(slot->command))
			return true;
	}
	return false;
}

/* Stops what would pass a limit otherwise. Tried again at the next look if there is no room. */
static void hold_back(struct db_commander *commander, enum db_limit limit, db_time now)
{
	struct db_command_block block = { .command = DB_CMD_STOP };
	struct db_request request = { .command = DB_CMD_STOP, .submitted = now };
	struct db_slot *slot;

	if (!submit(commander, NULL, &request, 0, &slot)) {
		commander->supervise.stopped = false;
		return;
	}
	note_submitted(commander, NULL, request.command, now);
	record(commander, NULL, &block, 0, DB_RESULT_PENDING, slot);
	commander->newest = request.ticket;
	show(commander, NULL, 0, block.command, DB_RESULT_PENDING, request.ticket);
	(void)show_limit(commander, NULL, limit);
}

static void supervise(struct db_commander *commander, const struct db_feedback *feedback,
                      db_time now)
{
	struct db_supervise_config config;
	enum db_limit limit;

	if (!commander->supervise.active || !(feedback->status & DB_STATUS_ONLINE))
		return;
	config = supervise_config(commander, feedback);
	limit = db_supervise_look(&commander->supervise, &config, feedback, now);
	if (limit != DB_LIMIT_NONE)
		hold_back(commander, limit, now);
}

static void look_at_motion(struct db_commander *commander, db_time now)
{
	struct db_follow_config config;
	struct db_snapshot snapshot;
	enum db_result result;

	if (!(commander->follow.active || commander->supervise.active) || commander->look_at > now)
		return;
	commander->look_at = now + commander->look_interval;
	db_axis_read(commander->config.axis, &snapshot);
	supervise(commander, &snapshot.feedback, now);
	if (!commander->follow.active || motion_is_pending(commander))
		return;
	config = follow_config(commander);
	result = db_follow_look(&commander->follow, &config, &snapshot.feedback, now);
	if (result == DB_RESULT_PENDING)
		return;
	db_history_end(&commander->history, commander->follow_entry, result,
	               now - commander->follow_arrived);
	db_outcome_end_motion(&commander->shown, commander->follow.ticket, result);
	db_writers_end_motion(&commander->writers, commander->follow.ticket, result);
}

/* The watchdog's stop ended. One that the drive turned down is said again until it is taken. */
static void note_reaction(struct db_commander *commander, enum db_result result, db_time now)
{
	if (result == DB_RESULT_REFUSED || result == DB_RESULT_FAILED ||
	    result == DB_RESULT_RUNS_ON)
		commander->react_at = now + REFUSED_AGAIN;
	else
		commander->react_ticket = 0;
}

/*
 * A stop that came behind something else while there was no place for another of its kind is handed
 * to the bus now, where the place of the one before has just become free.
 */
static void say_again(struct db_commander *commander, struct db_slot *slot, db_time now)
{
	struct db_request request = {
		.ticket = new_ticket(commander),
		.drive = commander->config.drive,
		.command = slot->command,
		.submitted = now,
	};
	uint32_t before = slot->ticket;

	slot->over = !commander->ops->submit(commander->context, &request);
	if (slot->over) {
		commander->again_at = now + REACT_AGAIN;
		return;
	}
	slot->again = false;
	slot->ticket = request.ticket;
	slot->order = commander->submitted - 1;
	db_writers_retarget(&commander->writers, before, slot->ticket);
	db_outcome_retarget(&commander->shown, before, slot->ticket);
	commander->newest = slot->ticket;
	if (commander->react_ticket == before)
		commander->react_ticket = slot->ticket;
}

static void say_all_again(struct db_commander *commander, db_time now)
{
	if (commander->again_at > now)
		return;
	commander->again_at = DB_TIME_NEVER;
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->over)
			say_again(commander, slot, now);
	}
}

static uint32_t microseconds(db_time span)
{
	db_time us = span / DB_NS_PER_US;

	return us < 0 ? 0 : us > UINT32_MAX ? UINT32_MAX : (uint32_t)us;
}

void db_commander_complete(struct db_commander *commander, const struct db_completion *completion,
                           db_time now)
{
	struct db_slot *slot = slot_of(commander, completion->ticket);
	/* To the confirmation itself, not to when this thread came to hear of it. */
	db_time end = completion->finished ? completion->finished : now;
	uint32_t took_us;
	struct db_client client;
	struct db_slot ended;

	if (!slot)
		return;
	if (slot->again) {
		say_again(commander, slot, now);
		return;
	}
	took_us = microseconds(end - slot->arrived);
	db_outcome_complete(&commander->shown, completion->ticket, completion->result, took_us);
	db_writers_complete(&commander->writers, completion->ticket, completion->result, took_us);
	note_ended(commander, slot, completion->result, end);
	if (slot->ends_trip != 0 && slot->ends_trip == commander->watchdog.trips &&
	    db_result_is_success(completion->result))
		unlatch(commander, now);
	if (commander->react_ticket == completion->ticket)
		note_reaction(commander, completion->result, now);
	tell_refusal(commander, db_slot_client(slot, &client),
	             &(struct db_refused_write){
			     .command = slot->command,
			     .result = completion->result,
		     });
	ended = *slot;
	db_pending_remove(&commander->pending, slot);
	answer_waiters(commander, &ended, completion->result);
}

db_time db_commander_next_deadline(const struct db_commander *commander)
{
	db_time next = db_watchdog_deadline(&commander->watchdog);

	if (commander->react_at < next)
		next = commander->react_at;
	if (commander->again_at < next)
		next = commander->again_at;
	if (commander->find_at < next)
		next = commander->find_at;
	if ((commander->follow.active || commander->supervise.active) && commander->look_at < next)
		next = commander->look_at;
	if (commander->waiting == 0)
		return next;
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		for (unsigned j = 0; j < slot->waiter_count; j++) {
			if (slot->waiters[j].deadline < next)
				next = slot->waiters[j].deadline;
		}
	}
	return next;
}

/* What a writer whose time is up is told: that it takes longer, or why it surely will. */
static enum db_result late_answer(const struct db_commander *commander)
{
	enum db_result result = reach(commander, DB_CMD_NONE);

	return result == DB_RESULT_OK ? DB_RESULT_PENDING : result;
}

static void expire_slot(struct db_commander *commander, struct db_slot *slot, db_time now)
{
	struct db_slot due = { .waiter_count = 0 };
	uint8_t kept = 0;

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

/* The watchdog's stop that is still with the bus; null. */
static struct db_slot *pending_reaction(struct db_commander *commander)
{
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		if (slot->reaction)
			return slot;
	}
	return NULL;
}

/* One of an earlier time, with what came since behind it, is said again when it ends. */
static struct db_slot *submit_reaction(struct db_commander *commander, db_time now)
{
	struct db_request request = {
		.command = commander->config.on_client_loss,
		.submitted = now,
	};
	struct db_slot *slot = pending_reaction(commander);

	if (slot) {
		slot->again = true;
		return slot;
	}
	if (!submit(commander, NULL, &request, 0, &slot))
		return NULL;
	slot->reaction = true;
	return slot;
}

/* Of one that says again what is still with the bus there is an entry. */
static void record_reaction(struct db_commander *commander, const struct db_command_block *block,
                            struct db_slot *slot)
{
	if (slot->entry != 0)
		db_history_repeat(&commander->history, slot->entry);
	else
		record(commander, NULL, block, 0, DB_RESULT_PENDING, slot);
}

/* Stops the drive because nobody talks to it. Tried again soon if there is no room for a request. */
static void react(struct db_commander *commander, db_time now)
{
	struct db_command_block block = { .command = (uint16_t)commander->config.on_client_loss };
	struct db_slot *slot = submit_reaction(commander, now);

	if (!slot) {
		commander->react_at = now + REACT_AGAIN;
		return;
	}
	commander->react_at = DB_TIME_NEVER;
	note_submitted(commander, NULL, slot->command, now);
	if (commander->react_ticket == 0)
		record_reaction(commander, &block, slot);
	commander->react_ticket = slot->ticket;
	commander->newest = slot->ticket;
	show(commander, NULL, 0, block.command, DB_RESULT_PENDING, slot->ticket);
}

void db_commander_hear(struct db_commander *commander, const struct db_client *client, db_time now)
{
	db_writers_hear(&commander->writers, client, now);
}

bool db_commander_feed(struct db_commander *commander, const struct db_client *client,
                       enum db_watchdog_feed by, db_time arrived)
{
	return db_watchdog_feed(&commander->watchdog, by, client->id, arrived);
}

void db_commander_set_watchdog(struct db_commander *commander, uint32_t timeout_ms, db_time arrived)
{
	db_watchdog_set(&commander->watchdog, timeout_ms, arrived);
}

void db_commander_forget(struct db_commander *commander, const struct db_client *client)
{
	db_watchdog_forget(&commander->watchdog, client->id);
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
	if (!(snapshot.feedback.status & DB_STATUS_MOVING))
		return;
	if (!commander->watchdog.armed)
		db_watchdog_arm(&commander->watchdog, now);
	/* A running program of the controller's has its own way. */
	if (snapshot.feedback.state == DB_AXIS_CONTINUOUS_MOTION &&
	    snapshot.feedback.program_state == 0)
		note_supervised(commander, DB_CMD_MOVE_VELOCITY, now);
}

bool db_commander_expire(struct db_commander *commander, db_time now)
{
	bool tripped = db_watchdog_trip(&commander->watchdog, now);

	if (tripped || commander->react_at <= now)
		react(commander, now);
	say_all_again(commander, now);
	find(commander, now);
	look_at_motion(commander, now);
	for (struct db_slot *slot = commander->pending.first; slot; slot = slot->next)
		expire_slot(commander, slot, now);
	return tripped;
}

bool db_commander_history(const struct db_commander *commander, size_t age,
                          struct db_history_entry *entry)
{
	return db_history_get(&commander->history, age, entry);
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
		.write_register = outcome->write_register,
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
	for (const struct db_slot *slot = commander->pending.first; slot; slot = slot->next) {
		uint32_t age = commander->submitted - slot->order;

		state->busy = true;
		if (slot->command != DB_CMD_NONE && age > oldest) {
			oldest = age;
			state->active_command = (uint16_t)slot->command;
		}
	}
}
