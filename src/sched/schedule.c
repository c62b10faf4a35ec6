/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/schedule.h"

#include "sched/common_start.h"
#include "sched/exchange.h"
#include "sched/scan.h"
#include "sched/stop.h"

#include <stdint.h>
#include <string.h>

/* --- commands ------------------------------------------------------------------------------------- */

static bool is_free(const struct db_engine *engine, const struct station *station, db_time now)
{
	return !is_flying(station->node) && !scan_holds_node(engine, station->node) &&
	       !node_waits_out_late_answers(station->node, now);
}

/* False when it ended without anything being sent. */
static bool begin_queued(struct db_engine *engine, size_t index, db_time now)
{
	struct db_queued *queued = engine->waiting[index];
	const struct db_request *request = db_queued_request(queued);
	struct station *station = engine_find_station(engine, request->drive);
	enum db_job_kind kind = request->setting_count > 0 ? DB_JOB_SETTINGS : DB_JOB_COMMAND;
	enum db_result result = DB_RESULT_FAILED;

	engine->waiting_count--;
	memmove(&engine->waiting[index], &engine->waiting[index + 1],
	        (engine->waiting_count - index) * sizeof engine->waiting[0]);
	station->queued = queued;
	station->lanes[LANE_COMMAND].exchange.request = db_queued_bytes(queued);
	station->lanes[LANE_COMMAND].exchange.request_size = DB_REQUEST_MAX;
	station->command_cancelled = false;
	station->alone = !engine->bus->starts_by_broadcast;
	if (standing_gives_way_to(&station->standing, request->command))
		stop_yield(station);
	if (exchange_begin_job(engine, station, LANE_COMMAND, kind, request, now, &result) ==
	    DB_STEP_SEND) {
		if (!common_start_holds(station))
			exchange_send_in_step(engine, station, LANE_COMMAND, now);
		return is_flying(station->node);
	}
	station->lanes[LANE_COMMAND].active = true;
	station_finish_command(station, result, now);
	return false;
}

#define NOBODY SIZE_MAX

/* *again: the first drive whose command only asks once more for what it has asked before, or NOBODY. */
static bool continue_command(struct db_engine *engine, size_t *again, db_time now)
{
	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_command + n) % engine->station_count;
		struct station *station = engine->stations[i];

		if (!station->lanes[LANE_COMMAND].ready || common_start_holds(station) ||
		    station_awaits_stop(station) || !is_free(engine, station, now))
			continue;
		if (station->lanes[LANE_COMMAND].exchange.again) {
			*again = *again == NOBODY ? i : *again;
			continue;
		}
		engine->next_command = i + 1;
		exchange_send_in_step(engine, station, LANE_COMMAND, now);
		return true;
	}
	return false;
}

static bool begin_next_command(struct db_engine *engine, db_time now)
{
	for (size_t i = 0; i < engine->waiting_count;) {
		const struct db_request *request = db_queued_request(engine->waiting[i]);
		const struct station *station = engine_find_station(engine, request->drive);
		size_t before = engine->waiting_count;

		/* A command given after a stop waits until the stop is confirmed. */
		if (station->lanes[LANE_COMMAND].active || station_awaits_stop(station) ||
		    !is_free(engine, station, now))
			i++;
		else if (begin_queued(engine, i, now))
			return true;
		else if (engine->waiting_count == before)
			i++;
	}
	return false;
}

/* They take turns: a command of many exchanges does not hold up other drives' commands. */
static bool try_commands(struct db_engine *engine, size_t *again, db_time now)
{
	*again = NOBODY;
	if (engine->continued && begin_next_command(engine, now)) {
		engine->continued = false;
		return true;
	}
	engine->continued = continue_command(engine, again, now);
	return engine->continued || begin_next_command(engine, now);
}

/* --- cyclic status --------------------------------------------------------------------------------- */

static struct node *due_poll(struct db_engine *engine, db_time now)
{
	for (size_t n = 0; n < engine->node_count; n++) {
		size_t i = (engine->next_poll + n) % engine->node_count;
		struct node *node = engine->nodes[i];

		if (node->online && node->poll_due && is_free(engine, node->first, now)) {
			engine->next_poll = i;
			return node;
		}
	}
	return NULL;
}

static void send_poll(struct db_engine *engine, struct node *node, db_time now)
{
	struct station *station = node->first;
	struct lane *lane = &station->lanes[LANE_POLL];
	enum db_result result;

	if (!node->in_step) {
		exchange_send_probe(engine, node, now);
		return;
	}
	node->polled = now;
	if (lane->active && lane->ready)
		exchange_send(engine, station, LANE_POLL, now);
	else if (exchange_begin_job(engine, station, LANE_POLL, DB_JOB_POLL, NULL, now, &result) ==
	         DB_STEP_SEND)
		exchange_send(engine, station, LANE_POLL, now);
	else
		node->poll_due = false;
	engine->next_poll++;
	engine->polls_in_a_row++;
}

static bool is_watched(const struct node *node)
{
	for (const struct station *s = node->first; s; s = s->next_axis) {
		if (s->snapshot.feedback.status & DB_STATUS_MOVING)
			return true;
	}
	return node_must_stand(node);
}

/* The one whose stop was sent last, or that was read because of it. */
static const struct node *last_stopped(const struct db_engine *engine)
{
	size_t count = engine->station_count;

	return count == 0 ? NULL : engine->stations[(engine->next_stop + count - 1) % count]->node;
}

/*
 * Stops that are sent again and again leave every second exchange to the other drives that move or must stand, if
 * one of those is to be read: else a drive that never obeys would keep all others from being seen. A stop that was
 * never sent waits for none of them.
 */
static bool try_sample_between_stops(struct db_engine *engine, db_time now)
{
	const struct node *last = last_stopped(engine);

	if (!engine->stop_was_last || engine->shutting_down ||
	    exchange_may_begin_at(engine, false, now) > now || !stop_all_are_sent(engine))
		return false;
	engine->stop_was_last = false;
	for (size_t n = 0; n < engine->node_count; n++) {
		size_t i = (engine->next_watched + n) % engine->node_count;
		struct node *node = engine->nodes[i];

		if (node != last && node->online && node->poll_due && node->in_step &&
		    is_watched(node) && is_free(engine, node->first, now)) {
			engine->next_watched = i + 1;
			send_poll(engine, node, now);
			return true;
		}
	}
	return false;
}

/* --- below cyclic status ------------------------------------------------------------------------------ */

/*
 * A stop waits for the exchange on the wire, and the text of all parameters may take 0.3 s. While a
 * drive moves nothing is read that takes longer than this on the wire, and longer than two commands;
 * unless drives move for ever: then one such exchange goes out in each DUMP_PAUSE.
 */
#define DUMP_SHORT (20 * DB_NS_PER_MS)
#define DUMP_PAUSE (5 * DB_NS_PER_S)
/* One that is held up is tried in every cycle: what was not for so long is over. */
#define DUMP_FORGOTTEN (1 * DB_NS_PER_S)

/* A drive of the line moves, or is being stopped. */
static bool may_have_to_stop(const struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (station->node->online && standing_is_open(&station->standing))
			return true;
	}
	return engine_find_moving(engine) != NULL;
}

/* The exchange is prepared. The pause counts from where motion began to hold dumps up. */
static bool may_send_now(struct db_engine *engine, const struct db_exchange *exchange, db_time now)
{
	db_time wire = exchange_wire_time(engine, exchange);
	bool dump = wire > DUMP_SHORT && wire > 2 * engine->driver->command_time(engine->bus);

	if (!dump || !may_have_to_stop(engine))
		return true;
	if (engine->dump_tried == 0 || now - engine->dump_tried > DUMP_FORGOTTEN)
		engine->dumps_held_since = now;
	engine->dump_tried = now;
	if (now - engine->dumps_held_since < DUMP_PAUSE)
		return false;
	engine->dumps_held_since = now;
	return true;
}

static bool wants_identify(const struct db_engine *engine, const struct station *station,
                           db_time now)
{
	if (!station->node->online || station->identify_at > now || !is_free(engine, station, now))
		return false;
	return station->lanes[LANE_IDENTIFY].active ||
	       !(station->snapshot.feedback.status & DB_STATUS_PARAMS_VALID) ||
	       engine->driver->nameplate(station->device)->doubtful;
}

static bool try_identify(struct db_engine *engine, db_time now)
{
	enum db_result result;

	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_identify + n) % engine->station_count;
		struct station *station = engine->stations[i];
		struct lane *lane = &station->lanes[LANE_IDENTIFY];

		if (!wants_identify(engine, station, now))
			continue;
		engine->next_identify = i + (lane->active ? 0 : 1);
		if (!lane->active &&
		    exchange_begin_job(engine, station, LANE_IDENTIFY, DB_JOB_IDENTIFY, NULL, now,
		                       &result) != DB_STEP_SEND)
			continue;
		if (station->node->in_step && !may_send_now(engine, &lane->exchange, now))
			continue;
		exchange_send_in_step(engine, station, LANE_IDENTIFY, now);
		return true;
	}
	return false;
}

/* `new`: only those that were not looked for since the port opened. */
static bool try_probes(struct db_engine *engine, bool new, db_time now)
{
	for (size_t n = 0; n < engine->node_count; n++) {
		size_t i = (engine->next_probe + n) % engine->node_count;
		struct node *node = engine->nodes[i];

		if (node->online || node->probe_at > now || !is_free(engine, node->first, now))
			continue;
		/* The first round after the port opened is free: nothing is known of any drive. */
		if (node->ever_probed && (new || engine->probes_from > now))
			continue;
		engine->next_probe = i + 1;
		exchange_send_probe(engine, node, now);
		return true;
	}
	return false;
}

static bool try_background(struct db_engine *engine, db_time now)
{
	engine->polls_in_a_row = 0;
	/* A drive that moved when the port was lost is not left alone for another one's parameters. */
	return try_probes(engine, true, now) || try_identify(engine, now) ||
	       try_probes(engine, false, now) || scan_send_next(engine, now);
}

/*
 * Commands go before status, but cannot starve it: when a drive's status is two cycles old, they
 * take turns. What only asks again goes behind status, but once in two cycles before it. Likewise status cannot
 * starve what comes after it: once in a round of polls one exchange of those classes is let through.
 */
bool schedule_send_next(struct db_engine *engine, db_time now)
{
	size_t again;
	struct node *poll;
	bool wait;

	/* On a serial line nothing begins while an answer is waited for. */
	if (engine->flights > 0 && !exchange_overlaps(engine))
		return false;
	if (try_sample_between_stops(engine, now))
		return true;
	if (stop_send_next(engine, now)) {
		engine->stop_was_last = true;
		return true;
	}
	/* Not when the wire is only taken by the stop. */
	if (engine->shutting_down || exchange_may_begin_at(engine, false, now) > now)
		return false;
	engine->stop_was_last = false;
	if (common_start_try(engine, &wait, now))
		return true;
	if (wait)
		return false;
	poll = due_poll(engine, now);
	if (poll && engine->command_was_last && now - poll->polled > 2 * engine->period) {
		send_poll(engine, poll, now);
		return true;
	}
	if (try_commands(engine, &again, now))
		return true;
	if (again != NOBODY && (!poll || now - engine->again_sent > 2 * engine->period)) {
		engine->again_sent = now;
		engine->next_command = again + 1;
		exchange_send_in_step(engine, engine->stations[again], LANE_COMMAND, now);
		return true;
	}
	if (poll && engine->polls_in_a_row > engine->node_count && try_background(engine, now))
		return true;
	if (poll) {
		send_poll(engine, poll, now);
		return true;
	}
	return try_background(engine, now);
}
