/* SPDX-License-Identifier: Apache-2.0 */
#include "axis/axis_private.h"

#include "drivebridge/commander.h"

#include <errno.h>
#include <stdlib.h>

/* --- making ----------------------------------------------------------------------------------- */

int db_commander_new(const struct db_commander_config *config, const struct db_commander_ops *ops,
                     void *context, struct db_commander **commander)
{
	struct db_commander *made = calloc(1, sizeof(*made));

	if (!made)
		return -ENOMEM;
	made->settle.check_at = DB_TIME_NEVER;
	if (config->driver->holds) {
		made->settle.places = calloc(DB_SETTLE_MAX, sizeof(made->settle.places[0]));
		made->settle.count = DB_SETTLE_MAX;
	}
	if ((config->driver->holds && !made->settle.places) ||
	    db_commander_reserve(made, config->ids_by_client) != 0) {
		db_commander_free(made);
		return -ENOMEM;
	}
	made->config = *config;
	made->ops = ops;
	made->context = context;
	made->reaction = config->on_client_loss == DB_CMD_NONE ? DB_CMD_STOP :
	                                                         config->on_client_loss;
	made->reaction_again_at = DB_TIME_NEVER;
	db_writers_set(&made->writers, config->ids_by_client);
	made->check_interval = db_motion_check_interval(config->bus_config);
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
	free(commander->settle.places);
	free(commander->writers.each);
	free(commander);
}

int db_commander_reserve(struct db_commander *commander, bool ids_by_client)
{
	struct db_writers *writers = &commander->writers;

	if (ids_by_client && !writers->each)
		writers->each = calloc(DB_WRITERS, sizeof(writers->each[0]));
	return !ids_by_client || writers->each ? 0 : -ENOMEM;
}

void db_commander_set_writers(struct db_commander *commander, unsigned confirm_ms,
                              bool accept_writes, bool ids_by_client)
{
	commander->config.confirm_ms = confirm_ms;
	commander->config.accept_writes = accept_writes;
	if (commander->writers.by_address == ids_by_client)
		return;
	/* It is no longer known which client used an id: each begins with a start value. */
	db_writers_set(&commander->writers, ids_by_client);
}

/* --- clients ---------------------------------------------------------------------------------- */

void db_commander_hear(struct db_commander *commander, const struct db_client *client, db_time now)
{
	struct db_writer *writer = db_writers_find(&commander->writers, client);

	if (writer)
		writer->heard = now;
}

void db_commander_feed(struct db_commander *commander, const struct db_client *client,
                       enum db_watchdog_feed by, db_time arrived)
{
	if (db_watchdog_feed(&commander->watchdog, by, client, arrived))
		commander->fed_by = *client;
}

const struct db_client *db_commander_fed_by(const struct db_commander *commander)
{
	return &commander->fed_by;
}

void db_commander_set_watchdog(struct db_commander *commander, uint32_t timeout_ms, db_time arrived)
{
	db_watchdog_set(&commander->watchdog, timeout_ms, arrived);
}

bool db_commander_beat(struct db_commander *commander, const struct db_client *client, db_time now)
{
	return db_hold_beat(&commander->hold, client, db_client_arrived(client, now), now);
}

void db_commander_desert(struct db_commander *commander, const struct db_client *client,
                         db_time now)
{
	db_hold_desert(&commander->hold, client, now);
}

void db_commander_forget(struct db_commander *commander, const struct db_client *client,
                         db_time now)
{
	db_commander_desert(commander, client, now);
	db_watchdog_forget(&commander->watchdog, client->id);
}

enum db_command db_commander_owed_stop(const struct db_commander *commander)
{
	bool held = db_hold_deadline(&commander->hold) != DB_TIME_NEVER;
	enum db_command owed = held ? DB_CMD_STOP : DB_CMD_NONE;

	for (const struct db_request *request = commander->pending; request;
	     request = request->next) {
		if (db_request_stop(request) == DB_CMD_DISABLE)
			return DB_CMD_DISABLE;
		if (db_command_is_stop(request->command))
			owed = db_request_stop(request);
	}
	return owed;
}

void db_commander_end_hold(struct db_commander *commander, db_time now)
{
	struct db_client holder = commander->hold.holder;

	db_hold_desert(&commander->hold, &holder, now);
	db_guard_check_hold(commander, now);
}

/* --- time and the bus ------------------------------------------------------------------------- */

void db_commander_complete(struct db_commander *commander, struct db_request *request, db_time now)
{
	/* Until the confirmation itself, not until this thread learnt of it. */
	db_time end = request->finished ? request->finished : now;
	enum db_result result = (enum db_result)request->result;

	if (db_flight_find(commander, request->ticket) != request) {
		commander->ops->release(commander->context, request);
		return;
	}
	if (request->again) {
		db_flight_repeat_stop(commander, request, now);
		return;
	}
	db_writers_complete(&commander->writers, request->ticket, result,
	                    db_time_us32(end - request->submitted));
	db_motion_ended(commander, request, end);
	db_settle_ended(commander, request, end);
	if (request->ends_latch && db_result_is_success(result))
		db_guard_unlatch(commander, now);
	db_outcome_log(commander, db_request_client(request),
	               &(struct db_refused_write){ .command = request->command, .result = result });
	db_flight_end(commander, request);
}

db_time db_commander_next_deadline(const struct db_commander *commander)
{
	const db_time due[] = {
		/* db_guard_run() */
		db_watchdog_deadline(&commander->watchdog),
		db_hold_deadline(&commander->hold),
		commander->reaction_again_at,
		commander->find_at,
		/* db_motion_check(), db_settle_check() and db_flight_expire() */
		db_motion_deadline(commander),
		commander->settle.check_at,
		db_flight_deadline(commander),
	};
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i < sizeof(due) / sizeof(due[0]); i++) {
		if (due[i] < next)
			next = due[i];
	}
	return next;
}

bool db_commander_expire(struct db_commander *commander, db_time now)
{
	bool tripped = db_guard_run(commander, now);

	db_motion_check(commander, now);
	db_settle_check(commander, now);
	db_flight_expire(commander, now);
	return tripped;
}

/* --- what is shown ---------------------------------------------------------------------------- */

uint32_t db_commander_newest(const struct db_commander *commander)
{
	return commander->newest;
}

struct db_origin_changes db_commander_origin(const struct db_commander *commander)
{
	return commander->origin;
}

bool db_commander_is_to_move(const struct db_commander *commander)
{
	return commander->follow.active || db_flight_has(commander, DB_PENDING_MOTION, NULL);
}

db_time db_commander_stopped(const struct db_commander *commander)
{
	return commander->stopped;
}

bool db_commander_history(const struct db_commander *commander, size_t age,
                          struct db_history_entry *entry)
{
	return db_history_get(&commander->history, age, entry);
}

void db_commander_recall(struct db_commander *commander, const struct db_history_entry *entry,
                         const struct db_args *args)
{
	struct db_history_entry recalled = *entry;

	if (entry->command != DB_CMD_NONE)
		db_history_args(&recalled, entry->command, args);
	db_history_recall(&commander->history, &recalled);
}

enum db_result db_commander_outcome(const struct db_commander *commander, uint32_t entry)
{
	uint32_t age = commander->history.count - entry;
	struct db_history_entry found;

	if (commander->follow.active && commander->follow_noted.entry == entry &&
	    db_motion_of(commander->follow.command) > DB_MOTION_ENDLESS)
		return DB_RESULT_PENDING;
	if (!db_history_get(&commander->history, age, &found) || found.sequence != entry)
		return DB_RESULT_INDETERMINATE;
	return (enum db_result)found.result;
}

struct db_command_block db_commander_kept(struct db_commander *commander,
                                          const struct db_client *client)
{
	const struct db_writer *writer = db_writers_find(&commander->writers, client);
	struct db_command_block block = commander->kept;

	block.command_id = writer ? writer->kept_id : 0;
	return block;
}

void db_commander_state(struct db_commander *commander, const struct db_client *client,
                        struct db_command_state *state, db_time now)
{
	const struct db_writer *writer = db_writers_find(&commander->writers, client);
	const struct db_watchdog *watchdog = &commander->watchdog;
	/* A client whose own commands are remembered is shown what became of these. */
	bool own = commander->writers.by_address && writer && writer->commanded;
	uint32_t oldest = 0;

	*state = (struct db_command_state){
		.results = own ? writer->own.results : commander->writers.latest.results,
		.active_command = DB_CMD_NONE,
		.busy = commander->pending != NULL,
		.latched = watchdog->latched,
		.latched_since = watchdog->latched_at,
		.watchdog_ms = watchdog->timeout_ms,
		.watchdog_remaining_ms = db_watchdog_remaining_ms(watchdog, now),
		.watchdog_trips = watchdog->trips,
	};
	for (const struct db_request *request = commander->pending; request;
	     request = request->next) {
		uint32_t age = commander->submitted - request->number;

		if (request->command != DB_CMD_NONE && age > oldest) {
			oldest = age;
			state->active_command = (uint16_t)db_request_stop(request);
		}
	}
}
