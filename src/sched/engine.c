/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/state.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* --- making -------------------------------------------------------------------------------------- */

int db_engine_new(const struct db_bus_config *bus, const struct db_bus_drive *drives,
                  size_t drive_count, struct db_mailbox *mailbox, const struct db_engine_ops *ops,
                  void *context, struct db_engine **engine)
{
	struct db_engine *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	made->bus = bus;
	made->driver = bus->driver;
	made->mailbox = mailbox;
	made->ops = ops;
	made->context = context;
	made->period = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	made->stats.period_us = bus->cycle_ms * 1000;
	made->waiting_max = bus->queue;
	made->waiting = calloc(made->waiting_max, sizeof made->waiting[0]);
	/* The first drives come as all others do. */
	made->change = change_new(bus, 0, NULL, 0, drives, drive_count);
	if (!made->waiting || !made->change) {
		db_engine_free(made);
		return -ENOMEM;
	}
	engine_carry_change(made, 0);
	change_free(db_engine_take_changed(made));
	*engine = made;
	return 0;
}

void db_engine_free(struct db_engine *engine)
{
	if (!engine)
		return;
	change_free(engine->change);
	change_free(engine->changed);
	for (size_t i = 0; i < engine->station_count; i++)
		station_free(engine->stations[i]);
	for (size_t i = 0; i < engine->node_count; i++)
		node_free(engine->nodes[i]);
	free(engine->stations);
	free(engine->nodes);
	free(engine->waiting);
	free(engine);
}

struct station *engine_station(const struct db_engine *engine, uint16_t number)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		if (engine->stations[i]->number == number)
			return engine->stations[i];
	}
	return NULL;
}

void db_engine_set_wall_offset(struct db_engine *engine, int64_t wall_offset_us)
{
	engine->wall_offset_us = wall_offset_us;
}

/* --- what is told of drives ------------------------------------------------------------------------ */

static void tell(struct db_engine *engine, const struct station *station, enum db_event event)
{
	if (engine->ops->tell)
		engine->ops->tell(engine->context, station->config, event,
		                  &station->snapshot.feedback);
}

void engine_tell_timing(struct db_engine *engine, struct station *station, enum db_event event,
                        db_time time)
{
	/* That it does not answer in time is no news any more. */
	if (event == DB_EVENT_DRIVE_LATE)
		station->told.missing = true;
	if (engine->ops->tell_timing)
		engine->ops->tell_timing(engine->context, station->config, event, time);
}

void engine_tell_missing(struct db_engine *engine, struct station *station)
{
	if (station->told.missing)
		return;
	station->told.missing = true;
	tell(engine, station, DB_EVENT_DRIVE_LOST);
	if (station->node->heard.count > 0 && engine->ops->tell_heard)
		engine->ops->tell_heard(engine->context, station->config, &station->node->heard);
}

void engine_tell_raw(struct db_engine *engine, const struct station *station, bool sent,
                     const uint8_t *bytes, size_t length)
{
	const struct lane *lane = &station->lanes[LANE_FRONT];

	if (station->front_letter && lane->job.kind == DB_JOB_COMMAND &&
	    lane->job.request->command == DB_CMD_RAW_FRAME && engine->ops->tell_raw)
		engine->ops->tell_raw(engine->context, station->config, sent, bytes, length);
}

void engine_tell_unconfirmed(struct db_engine *engine, const struct station *station)
{
	/* One that was never heard was not set going from here. */
	if (station->snapshot.feedback.taken == 0)
		return;
	for (unsigned i = 0; i < station->stop_count; i++) {
		if (station->stops[i].letter)
			continue;
		tell(engine, station, DB_EVENT_DRIVE_UNCONFIRMED);
		return;
	}
}

void db_engine_tell_unconfirmed(struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++)
		engine_tell_unconfirmed(engine, engine->stations[i]);
}

static void tell_presence(struct db_engine *engine, struct station *station, bool online)
{
	station->told.online = online;
	station->told.error = DB_ERROR_NONE;
	station->told.missing_params = 0;
	if (online) {
		station->told.missing = false;
		tell(engine, station, DB_EVENT_DRIVE_ONLINE);
	} else if (engine->stats.up) {
		/* Without a bus no drive answers: that was told of the bus. */
		engine_tell_missing(engine, station);
	}
}

/* Bits that were not set when the drive was last spoken of. */
static bool rose(const struct station *station, uint32_t bit)
{
	return station->snapshot.feedback.status & ~station->told.status & bit;
}

static void tell_changes(struct db_engine *engine, struct station *station)
{
	const struct db_feedback *feedback = &station->snapshot.feedback;
	bool online = feedback->status & DB_STATUS_ONLINE;

	if (online != station->told.online)
		tell_presence(engine, station, online);
	if (!online)
		return;
	if (feedback->error != station->told.error)
		tell(engine, station,
		     feedback->error == DB_ERROR_RUNS_ON ? DB_EVENT_DRIVE_RUNS_ON :
		     feedback->error != DB_ERROR_NONE    ? DB_EVENT_DRIVE_FAULT :
		                                           DB_EVENT_DRIVE_FAULT_GONE);
	if (rose(station, DB_STATUS_WARNING) && feedback->error == DB_ERROR_NONE)
		tell(engine, station, DB_EVENT_DRIVE_WARNING);
	/* Disabling some drives loses the origin as well, but not what was read of their parameters. */
	if (rose(station, DB_STATUS_ORIGIN_LOST) && !(feedback->status & DB_STATUS_PARAMS_VALID))
		tell(engine, station, DB_EVENT_DRIVE_RESTARTED);
	station->told.error = feedback->error;
	station->told.status = feedback->status;
}

static void tell_missing_params(struct db_engine *engine, struct station *station)
{
	uint64_t missing = engine->driver->nameplate(station->device)->missing;

	/* One after the other is found missing: they are told together when all were asked for. */
	if (!(station->snapshot.feedback.status & DB_STATUS_PARAMS_VALID))
		return;
	if ((missing & ~station->told.missing_params) && engine->ops->tell_missing)
		engine->ops->tell_missing(engine->context, station->config, missing);
	station->told.missing_params = missing;
}

void engine_publish(struct db_engine *engine, struct station *station)
{
	station_publish(station, engine->driver, engine->stats.up, engine->wall_offset_us);
	tell_changes(engine, station);
	tell_missing_params(engine, station);
}

/* --- the port -------------------------------------------------------------------------------------- */

void db_engine_port(struct db_engine *engine, bool up, int error, db_time now)
{
	engine->stats.up = up;
	engine->flights = 0;
	engine->held_since = 0;
	engine->received_length = 0;
	if (up) {
		engine->stats.opens++;
		engine->cycle_at = 0;
		engine->probes_from = 0;
	} else {
		engine->stats.last_error = (uint32_t)error;
	}
	for (size_t i = 0; i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];

		node->flight.station = NULL;
		if (!up)
			engine_go_offline(engine, node, DB_RESULT_BUS_DOWN, now);
		node->probe_at = now;
		node->probe_backoff = PROBE_BACKOFF_MIN;
		node->ever_probed = false;
	}
	for (size_t i = 0; i < engine->station_count; i++)
		engine_publish(engine, engine->stations[i]);
}

void db_engine_hold(struct db_engine *engine, bool hold, db_time now)
{
	db_time late;

	if (hold) {
		if (engine->held_since == 0)
			engine->held_since = now;
		return;
	}
	if (engine->held_since == 0)
		return;
	/* What was asked meanwhile went out so much later. */
	late = now - engine->held_since;
	engine->held_since = 0;
	engine->wire_free += late;
	for (size_t i = 0; i < engine->node_count; i++)
		engine->nodes[i]->flight.deadline += late;
}

/* --- letters --------------------------------------------------------------------------------------- */

void engine_finish_waiting(struct db_engine *engine, const struct station *station,
                           enum db_result result, db_time now)
{
	size_t kept = 0;

	for (size_t i = 0; i < engine->waiting_count; i++) {
		struct db_letter *letter = engine->waiting[i];

		if (db_letter_axis(letter) == station->number)
			db_letter_finish(letter, result, now);
		else
			engine->waiting[kept++] = letter;
	}
	engine->waiting_count = kept;
}

static void take_stop(struct db_engine *engine, struct station *station, struct db_letter *letter,
                      db_time now)
{
	engine_finish_waiting(engine, station, DB_RESULT_CANCELLED, now);
	/* Of its controller's other axes nothing half done may go on behind the stop. Disabling one
	 * leaves the others as they are. */
	for (struct station *s = station->node->first; s; s = s->next_axis) {
		if (s == station || db_letter_command(letter) != DB_CMD_DISABLE)
			station_cancel_front(s, now);
	}
	station_add_stop(station, db_letter_command(letter), letter, now);
}

static void take_letters(struct db_engine *engine, db_time now)
{
	struct db_letter *letter;

	while ((letter = db_mailbox_take(engine->mailbox)) != NULL) {
		struct station *station = engine_station(engine, db_letter_axis(letter));

		if (!station)
			db_letter_finish(letter, DB_RESULT_FAILED, now);
		else if (engine->shutting_down)
			db_letter_finish(letter, DB_RESULT_CANCELLED, now);
		else if (db_command_is_stop(db_letter_command(letter)))
			take_stop(engine, station, letter, now);
		else if (station->leaving)
			db_letter_finish(letter, DB_RESULT_CANCELLED, now);
		else if (!engine->stats.up)
			db_letter_finish(letter, DB_RESULT_BUS_DOWN, now);
		else if (!station->node->online)
			db_letter_finish(letter, DB_RESULT_OFFLINE, now);
		else if (engine->waiting_count == engine->waiting_max)
			db_letter_finish(letter, DB_RESULT_BUSY, now);
		else
			engine->waiting[engine->waiting_count++] = letter;
	}
	engine->stats.queued = (uint32_t)engine->waiting_count;
}

/* --- the cycle ------------------------------------------------------------------------------------- */

static void start_cycle(struct db_engine *engine, db_time now)
{
	db_time missed;
	uint32_t late;

	if (engine->cycle_at == 0)
		engine->cycle_at = now;
	if (now < engine->cycle_at)
		return;
	late = db_time_us32(now - engine->cycle_at);
	engine->stats.jitter_us = late;
	if (late > engine->stats.jitter_max_us)
		engine->stats.jitter_max_us = late;
	engine->stats.cycles++;
	if (engine->polling)
		engine->stats.overruns++;
	else
		engine->cycle_started = now;
	/* Cycles that were missed altogether are overruns, and not made up for. */
	missed = (now - engine->cycle_at) / engine->period;
	engine->cycle_at += (missed + 1) * engine->period;
	engine->stats.overruns += (uint32_t)missed;
	for (size_t i = 0; i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];

		if (!node->online ||
		    (engine->driver->wants_poll && !engine->driver->wants_poll(node->head, now)))
			continue;
		node->poll_due = true;
		engine->polling = true;
	}
}

void engine_end_of_polls(struct db_engine *engine, db_time now)
{
	uint32_t us;

	if (!engine->polling)
		return;
	for (size_t i = 0; i < engine->node_count; i++) {
		if (engine->nodes[i]->poll_due)
			return;
	}
	engine->polling = false;
	us = db_time_us32(now - engine->cycle_started);
	engine->stats.cycle_us = us;
	if (us > engine->stats.cycle_max_us)
		engine->stats.cycle_max_us = us;
}

static void measure_utilisation(struct db_engine *engine, db_time now)
{
	if (engine->second_at == 0)
		engine->second_at = now + DB_NS_PER_S;
	if (now < engine->second_at)
		return;
	engine->stats.utilisation = (uint32_t)(engine->busy * 1000 /
	                                       (now - engine->second_at + DB_NS_PER_S));
	engine->busy = 0;
	engine->second_at = now + DB_NS_PER_S;
}

static db_time earliest(db_time a, db_time b)
{
	return a < b ? a : b;
}

/* When a node that is not waiting for an answer wants something at the latest. */
static db_time node_wake(const struct db_engine *engine, const struct node *node, db_time now)
{
	bool haunted = node_is_haunted(node, now);
	db_time wake = DB_TIME_NEVER;
	db_time probe = node->probe_at;

	for (const struct station *s = node->first; s; s = s->next_axis)
		wake = earliest(wake, engine_stop_wake(engine, s, now));
	if (haunted)
		return earliest(wake, node_haunted_until(node, now));
	if (node->ever_probed && probe < engine->probes_from)
		probe = engine->probes_from;
	return !node->online && !engine->shutting_down ? earliest(wake, probe) : wake;
}

static db_time next_wake(const struct db_engine *engine, bool more, db_time now)
{
	db_time may_send = engine_may_send_at(engine, false, now);
	db_time wake = earliest(engine->cycle_at, engine_change_deadline(engine, now));

	wake = earliest(wake, engine_common_wake(engine, now));

	/* There is more to be sent as soon as the wire has room. */
	if (more || may_send > now)
		wake = earliest(wake, may_send > now ? may_send : now + 1);
	for (size_t i = 0; i < engine->node_count; i++) {
		const struct node *node = engine->nodes[i];

		if (is_flying(node))
			/* As long as the port holds, no answer is overdue. */
			wake = earliest(wake, engine->held_since == 0 ? node->flight.deadline :
			                                                DB_TIME_NEVER);
		else if (may_send <= now)
			wake = earliest(wake, node_wake(engine, node, now));
	}
	return wake > now ? wake : now + 1;
}

static void lose_overdue(struct db_engine *engine, db_time now)
{
	if (engine->held_since != 0)
		return;
	for (size_t i = 0; engine->flights > 0 && i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];

		if (is_flying(node) && now >= node->flight.deadline)
			engine_answer_lost(engine, node, now);
	}
}

db_time db_engine_run(struct db_engine *engine, db_time now)
{
	/* Every node may be given something; that some jobs end without sending makes no endless loop. */
	size_t turns = 2 * engine->node_count + 1;

	take_letters(engine, now);
	engine_carry_change(engine, now);
	measure_utilisation(engine, now);
	if (!engine->stats.up)
		return DB_TIME_NEVER;
	lose_overdue(engine, now);
	start_cycle(engine, now);
	while (turns > 0 && engine_send_something(engine, now))
		turns--;
	return next_wake(engine, turns == 0, now);
}

/* --- the end --------------------------------------------------------------------------------------- */

void db_engine_shut_down(struct db_engine *engine, db_time now)
{
	engine->shutting_down = true;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = engine->stations[i];
		enum db_command command = db_on_loss_command(station->config->on_exit);

		engine_finish_waiting(engine, station, DB_RESULT_CANCELLED, now);
		station_cancel_front(station, now);
		/* Who leaves was told already. */
		if (command == DB_CMD_NONE || station->leaving)
			continue;
		station_add_stop(station, command, NULL, now);
	}
}

bool db_engine_is_quiet(const struct db_engine *engine)
{
	if (!engine->stats.up)
		return true;
	if (engine->flights > 0)
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		if (engine->stations[i]->stop_count > 0)
			return false;
	}
	return true;
}

void db_engine_stats(const struct db_engine *engine, struct db_bus_stats *stats)
{
	*stats = engine->stats;
}
