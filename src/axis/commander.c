/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/commander.h"

#include "drivebridge/axis.h"

#include <stdlib.h>
#include <string.h>

/* Requests of one drive that have not ended, and clients that wait for one of them. */
#define PENDING_MAX 16
#define WAITERS_MAX 4

struct waiter {
	struct db_write_token token;
	db_time deadline;
};

struct pending {
	uint32_t ticket; /* 0: free */
	enum db_command command; /* NONE: a parameter write */
	uint16_t id;
	uint32_t order;
	db_time submitted;
	struct waiter waiters[WAITERS_MAX];
	unsigned waiter_count;
};

/* The last command with an id other than 0. */
struct identified {
	bool known; /* an id was seen since the start */
	uint16_t id;
	uint16_t command;
	struct db_args args;
	enum db_result result;
	uint32_t ticket;
};

struct db_commander {
	const struct db_modbus_config *config;
	const struct db_driver *driver;
	const struct db_commander_ops *ops;
	void *context;
	uint16_t axis_index;
	uint16_t number;
	uint32_t next_order;
	uint16_t next_ticket;
	struct db_command_block block;
	struct identified last;
	struct db_command_result shown;
	uint32_t shown_ticket;    /* the request `shown` describes */
	uint32_t write_ticket;    /* the request write_result describes */
	struct pending pending[PENDING_MAX];
	struct db_request request; /* under construction; too large for a stack */
};

struct db_commander *db_commander_new(const struct db_modbus_config *config,
                                      const struct db_driver *driver, uint16_t axis_index,
                                      uint16_t number, const struct db_commander_ops *ops,
                                      void *context)
{
	struct db_commander *commander = calloc(1, sizeof *commander);

	if (!commander)
		return NULL;
	commander->config = config;
	commander->driver = driver;
	commander->ops = ops;
	commander->context = context;
	commander->axis_index = axis_index;
	commander->number = number;
	return commander;
}

void db_commander_free(struct db_commander *commander)
{
	free(commander);
}

/* Tickets carry the drive in the upper half, counting from 1 so that none is 0. */
static uint32_t new_ticket(struct db_commander *commander)
{
	return ((uint32_t)commander->number + 1) << 16 | commander->next_ticket++;
}

uint16_t db_commander_number(uint32_t ticket)
{
	return (uint16_t)((ticket >> 16) - 1);
}

const struct db_command_block *db_commander_block(const struct db_commander *commander)
{
	return &commander->block;
}

static const struct pending *oldest_command(const struct db_commander *commander)
{
	const struct pending *oldest = NULL;

	for (size_t i = 0; i < PENDING_MAX; i++) {
		const struct pending *pending = &commander->pending[i];

		if (pending->ticket == 0 || pending->command == DB_CMD_NONE)
			continue;
		if (!oldest || (int32_t)(pending->order - oldest->order) < 0)
			oldest = pending;
	}
	return oldest;
}

void db_commander_result(const struct db_commander *commander, struct db_command_result *result)
{
	const struct pending *oldest = oldest_command(commander);

	*result = commander->shown;
	result->active_command = oldest ? (uint16_t)oldest->command : 0;
	result->pending = 0;
	for (size_t i = 0; i < PENDING_MAX; i++)
		result->pending += commander->pending[i].ticket != 0;
}

/* --- pending requests and those who wait -------------------------------------------------------- */

static struct pending *find_pending(struct db_commander *commander, uint32_t ticket)
{
	for (size_t i = 0; i < PENDING_MAX; i++) {
		if (commander->pending[i].ticket == ticket)
			return &commander->pending[i];
	}
	return NULL;
}

static struct pending *find_stop(struct db_commander *commander, enum db_command command)
{
	for (size_t i = 0; i < PENDING_MAX; i++) {
		if (commander->pending[i].ticket != 0 && commander->pending[i].command == command)
			return &commander->pending[i];
	}
	return NULL;
}

static int wait_for(const struct db_commander *commander, struct pending *pending,
                    struct db_write_token token, db_time now)
{
	if (commander->config->accept_writes)
		return 0;
	if (pending->waiter_count == WAITERS_MAX)
		return db_result_exception(DB_RESULT_PENDING);
	pending->waiters[pending->waiter_count++] = (struct waiter){
		.token = token,
		.deadline = now + (db_time)commander->config->confirm_ms * DB_NS_PER_MS,
	};
	return DB_WRITE_LATER;
}

/* Stops may use the last place; so a drive whose places are taken can still be stopped. */
static struct pending *free_place(struct db_commander *commander, bool stop)
{
	struct pending *place = NULL;
	unsigned free_places = 0;

	for (size_t i = 0; i < PENDING_MAX; i++) {
		if (commander->pending[i].ticket == 0) {
			place = &commander->pending[i];
			free_places++;
		}
	}
	/* Three kinds of stops, each pending at most once. */
	return free_places > (stop ? 0u : 3u) ? place : NULL;
}

/* commander->request is filled but for ticket and time. Null: busy. */
static struct pending *submit(struct db_commander *commander, uint16_t id, db_time now)
{
	struct db_request *request = &commander->request;
	bool stop = request->setting_count == 0 && db_command_is_stop(request->command);
	struct pending *place = free_place(commander, stop);

	if (!place)
		return NULL;
	request->axis = commander->axis_index;
	request->ticket = new_ticket(commander);
	request->submitted = now;
	if (!commander->ops->submit(commander->context, request))
		return NULL;
	*place = (struct pending){
		.ticket = request->ticket,
		.command = request->command,
		.id = id,
		.order = commander->next_order++,
		.submitted = now,
	};
	return place;
}

/* --- commands ------------------------------------------------------------------------------------ */

static void show(struct db_commander *commander, uint16_t id, uint16_t command,
                 enum db_result result, uint32_t ticket)
{
	commander->shown.id = id;
	commander->shown.command = command;
	commander->shown.result = result;
	commander->shown.write_result = result;
	commander->shown.duration_us = 0;
	commander->shown_ticket = ticket;
	commander->write_ticket = ticket;
}

static void remember(struct db_commander *commander, const struct db_command_block *block,
                     enum db_result result, uint32_t ticket)
{
	if (block->command_id == 0)
		return;
	commander->last = (struct identified){
		.known = true,
		.id = block->command_id,
		.command = block->command,
		.args = block->args,
		.result = result,
		.ticket = ticket,
	};
}

/* A command that ends before anything was queued. Busy leaves the id unused. */
static int refuse(struct db_commander *commander, const struct db_command_block *block,
                  enum db_result result)
{
	show(commander, block->command_id, block->command, result, 0);
	if (result != DB_RESULT_BUSY)
		remember(commander, block, result, 0);
	return db_result_exception(result);
}

/* May this command be given to the bus now? */
static enum db_result admit(const struct db_commander *commander,
                            const struct db_command_block *block, uint32_t status)
{
	enum db_command command = (enum db_command)block->command;
	enum db_result result;

	if (block->command >= DB_CMD_LIMIT ||
	    !(commander->driver->commands & DB_COMMAND_BIT(block->command)))
		return DB_RESULT_UNSUPPORTED;
	result = commander->driver->check(command, &block->args);
	if (result != DB_RESULT_OK)
		return result;
	if (!(status & DB_STATUS_BUS_UP))
		return DB_RESULT_BUS_DOWN;
	/* A stop is tried all the same: the drive may be deaf only for a moment. */
	if (!(status & DB_STATUS_ONLINE) && !db_command_is_stop(command))
		return DB_RESULT_OFFLINE;
	return DB_RESULT_OK;
}

static int execute(struct db_commander *commander, const struct db_command_block *block,
                   uint32_t status, struct db_write_token token, db_time now)
{
	enum db_command command = (enum db_command)block->command;
	enum db_result result = admit(commander, block, status);
	struct pending *pending;

	if (result != DB_RESULT_OK)
		return refuse(commander, block, result);
	pending = db_command_is_stop(command) ? find_stop(commander, command) : NULL;
	if (!pending) {
		commander->request.command = command;
		commander->request.setting_count = 0;
		commander->request.args = block->args;
		pending = submit(commander, block->command_id, now);
	}
	if (!pending)
		return refuse(commander, block, DB_RESULT_BUSY);
	show(commander, block->command_id, block->command, DB_RESULT_PENDING, pending->ticket);
	remember(commander, block, DB_RESULT_PENDING, pending->ticket);
	return wait_for(commander, pending, token, now);
}

/* The same id again: the answer it had, or the one it is waiting for. */
static int repeat(struct db_commander *commander, struct db_write_token token, db_time now)
{
	struct pending *pending;

	if (commander->last.result != DB_RESULT_PENDING)
		return db_result_exception(commander->last.result);
	pending = find_pending(commander, commander->last.ticket);
	return pending ? wait_for(commander, pending, token, now) :
	                 db_result_exception(DB_RESULT_PENDING);
}

static bool same_args(const struct db_args *a, const struct db_args *b)
{
	return a->target_position == b->target_position &&
	       a->target_velocity == b->target_velocity &&
	       a->output_number == b->output_number && a->output_value == b->output_value &&
	       a->output_mask == b->output_mask && a->output_levels == b->output_levels &&
	       a->shake_start_position == b->shake_start_position &&
	       a->shake_end_position == b->shake_end_position &&
	       a->shake_frequency == b->shake_frequency && a->shake_cycles == b->shake_cycles &&
	       a->shake_time == b->shake_time;
}

/* Not a new event of the PLC: its id was used, or (without id) nothing differs from the last. */
static bool is_repetition(const struct db_commander *commander,
                          const struct db_command_block *block, bool with_id)
{
	const struct identified *last = &commander->last;

	if (block->command_id == 0 || !last->known || block->command_id != last->id)
		return false;
	return with_id ||
	       (block->command == last->command && same_args(&block->args, &last->args));
}

int db_commander_write(struct db_commander *commander, const struct db_command_block *block,
                       bool with_id, bool with_command, uint32_t status,
                       struct db_write_token token, db_time now)
{
	struct db_command_block executed = *block;

	commander->block = *block;
	if (!with_command || block->command == DB_CMD_NONE)
		return 0;
	if (db_command_is_stop((enum db_command)block->command))
		return execute(commander, &executed, status, token, now);
	if (is_repetition(commander, block, with_id))
		return repeat(commander, token, now);
	if (!with_id && commander->last.known && block->command_id == commander->last.id)
		executed.command_id = 0;
	if (executed.command_id != 0 && !commander->last.known)
		return refuse(commander, &executed, DB_RESULT_RESTARTED);
	return execute(commander, &executed, status, token, now);
}

int db_commander_command(struct db_commander *commander, enum db_command command,
                         const struct db_args *args, uint32_t status, struct db_write_token token,
                         db_time now)
{
	struct db_command_block block = { .command = (uint16_t)command, .args = *args };

	return execute(commander, &block, status, token, now);
}

/* --- parameters ---------------------------------------------------------------------------------- */

static int refuse_settings(struct db_commander *commander, enum db_result result)
{
	commander->shown.write_result = result;
	commander->write_ticket = 0;
	return db_result_exception(result);
}

int db_commander_settings(struct db_commander *commander, const struct db_setting *settings,
                          size_t count, uint32_t status, struct db_write_token token, db_time now)
{
	struct pending *pending;

	if (count == 0 || count > DB_SETTINGS_MAX)
		return refuse_settings(commander, DB_RESULT_OUT_OF_RANGE);
	for (size_t i = 0; i < count; i++) {
		if (!commander->driver->check_param(settings[i].param, settings[i].value))
			return refuse_settings(commander, DB_RESULT_OUT_OF_RANGE);
	}
	if (!(status & DB_STATUS_BUS_UP))
		return refuse_settings(commander, DB_RESULT_BUS_DOWN);
	if (!(status & DB_STATUS_ONLINE))
		return refuse_settings(commander, DB_RESULT_OFFLINE);
	commander->request.command = DB_CMD_NONE;
	commander->request.setting_count = (uint16_t)count;
	memcpy(commander->request.settings, settings, count * sizeof settings[0]);
	pending = submit(commander, 0, now);
	if (!pending)
		return refuse_settings(commander, DB_RESULT_BUSY);
	commander->shown.write_result = DB_RESULT_PENDING;
	commander->write_ticket = pending->ticket;
	return wait_for(commander, pending, token, now);
}

/* --- ends ---------------------------------------------------------------------------------------- */

void db_commander_complete(struct db_commander *commander, const struct db_completion *completion)
{
	struct pending *pending = find_pending(commander, completion->ticket);
	struct pending ended;

	if (!pending || completion->ticket == 0)
		return;
	/* The place is free before anyone is answered: an answer may bring the next write. */
	ended = *pending;
	pending->ticket = 0;
	if (commander->shown_ticket == ended.ticket) {
		commander->shown.result = completion->result;
		commander->shown.duration_us =
		        (uint32_t)((completion->finished - ended.submitted) / DB_NS_PER_US);
	}
	if (commander->write_ticket == ended.ticket)
		commander->shown.write_result = completion->result;
	if (commander->last.ticket == ended.ticket)
		commander->last.result = completion->result;
	for (unsigned i = 0; i < ended.waiter_count; i++)
		commander->ops->answer(commander->context, ended.waiters[i].token,
		                       db_result_exception(completion->result));
}

db_time db_commander_deadline(const struct db_commander *commander)
{
	db_time deadline = DB_TIME_NEVER;

	for (size_t i = 0; i < PENDING_MAX; i++) {
		const struct pending *pending = &commander->pending[i];

		/* Waiters stand in the order they came; the first is the most impatient. */
		if (pending->ticket != 0 && pending->waiter_count > 0 &&
		    pending->waiters[0].deadline < deadline)
			deadline = pending->waiters[0].deadline;
	}
	return deadline;
}

static void expire_first(struct pending *pending)
{
	pending->waiter_count--;
	memmove(&pending->waiters[0], &pending->waiters[1],
	        pending->waiter_count * sizeof pending->waiters[0]);
}

void db_commander_expire(struct db_commander *commander, db_time now)
{
	for (size_t i = 0; i < PENDING_MAX; i++) {
		struct pending *pending = &commander->pending[i];

		while (pending->ticket != 0 && pending->waiter_count > 0 &&
		       pending->waiters[0].deadline <= now) {
			struct db_write_token token = pending->waiters[0].token;

			expire_first(pending);
			commander->ops->answer(commander->context, token,
			                       db_result_exception(DB_RESULT_PENDING));
		}
	}
}
