/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/engine.h"

#include "sched/answer.h"
#include "sched/change.h"
#include "sched/common_start.h"
#include "sched/exchange.h"
#include "sched/scan.h"
#include "sched/schedule.h"
#include "sched/state.h"
#include "sched/stop.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* The last seconds of a busy bus, where one on CAN carries more. */
#define TRACE_SIZE_SERIAL 65536
#define TRACE_SIZE_CAN 262144

/* --- making -------------------------------------------------------------------------------------- */

int db_engine_new(const struct db_bus_config *bus, const struct db_bus_drive *drives,
                  size_t drive_count, struct db_queue *queue, const struct db_engine_ops *ops,
                  void *context, struct db_engine **engine)
{
	struct db_engine *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	made->bus = bus;
	made->driver = bus->driver;
	made->queue = queue;
	made->ops = ops;
	made->context = context;
	made->period = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	made->stats.period_us = bus->cycle_ms * 1000;
	made->waiting_max = bus->queue;
	made->waiting = calloc(made->waiting_max, sizeof made->waiting[0]);
	/* The first drives come as all others do. */
	made->change = change_new(bus, 0, NULL, 0, drives, drive_count);
	made->trace = db_trace_new(bus->driver->medium == DB_MEDIUM_CAN ? TRACE_SIZE_CAN :
	                                                                  TRACE_SIZE_SERIAL);
	if (!made->waiting || !made->change || !made->trace) {
		db_engine_free(made);
		return -ENOMEM;
	}
	change_carry_out(made, 0);
	change_free(change_fetch(made));
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
	db_trace_free(engine->trace);
	free(engine);
}

void db_engine_set_wall_offset(struct db_engine *engine, int64_t wall_offset_us)
{
	engine->wall_offset_us = wall_offset_us;
}

void db_engine_tell_unconfirmed(struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++)
		engine_tell_unconfirmed(engine, engine->stations[i]);
}

/* --- the port -------------------------------------------------------------------------------------- */

static void change_port(struct db_engine *engine, bool up, bool aside, int error, db_time now)
{
	engine->now = now;
	if (!up &&
	    (engine->stats.up || engine->stats.aside != aside || engine->stats.down_since == 0))
		engine->stats.down_since = now;
	engine->stats.aside = aside;
	/* A scan of the bus in service ends with that. */
	if (!up && engine->stats.up && !scan_port_config(engine))
		scan_port(engine, false, error, now);
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
			engine_take_offline(engine, node, DB_RESULT_BUS_DOWN, now);
		node->probe_at = now;
		node->probe_backoff = PROBE_BACKOFF_MIN;
		node->ever_probed = false;
	}
	for (size_t i = 0; i < engine->station_count; i++)
		engine_publish(engine, engine->stations[i]);
}

void db_engine_port(struct db_engine *engine, bool up, int error, db_time now)
{
	change_port(engine, up, false, error, now);
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

/* No answer of a known length has so many bytes. */
#define LONG_ANSWER 256

/* One that has no known length is on its way: it is waited for as long as it comes, and may be an answer. */
static void wait_for_rest(struct db_engine *engine, db_time now)
{
	db_time latency = (db_time)engine->bus->drive_latency_ms * DB_NS_PER_MS;

	for (size_t i = 0; i < engine->node_count; i++) {
		struct flight *flight = &engine->nodes[i]->flight;
		const struct db_exchange *exchange;
		db_time longest;

		if (!flight->station)
			continue;
		exchange = &flight->station->lanes[flight->lane].exchange;
		longest = flight->sent + latency + exchange->extra_time +
		          engine->bus->transport->wire_time(engine->bus, exchange->request,
		                                            exchange->request_length,
		                                            DB_ANSWER_MAX);
		if (exchange->open_ended && flight->deadline < now + latency &&
		    now + latency < longest)
			flight->deadline = now + latency;
	}
}

void db_engine_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now)
{
	engine->now = now;
	while (length > 0) {
		size_t room = sizeof engine->received - engine->received_length;
		size_t take = length < room ? length : room;
		size_t start = 0;
		size_t skip = 0;
		size_t frame = 0;

		scan_hear(engine, bytes, take, now);
		memcpy(engine->received + engine->received_length, bytes, take);
		engine->received_length += take;
		bytes += take;
		length -= take;
		do {
			engine->driver->cut(engine->received + start,
			                    engine->received_length - start, &skip, &frame);
			scan_note_garbage(engine, skip);
			if (skip > 0)
				engine_take_garbage(engine, engine->received + start, skip, now);
			start += skip;
			if (frame > 0)
				answer_take_frame(engine, engine->received + start, frame, now);
			start += frame;
		} while (frame > 0);
		/* answer_take_frame() never sends, so the buffer is still the one that was cut. */
		engine->received_length -= start;
		memmove(engine->received, engine->received + start, engine->received_length);
		if (engine->received_length == sizeof engine->received) {
			scan_note_garbage(engine, engine->received_length);
			engine_take_garbage(engine, engine->received, engine->received_length, now);
			engine->received_length = 0;
		}
	}
	if (engine->received_length > LONG_ANSWER)
		wait_for_rest(engine, now);
}

/* --- requests --------------------------------------------------------------------------------------- */

static void take_stop(struct db_engine *engine, struct station *station, struct db_queued *queued,
                      db_time now)
{
	engine_finish_waiting(engine, station, DB_RESULT_CANCELLED, now);
	/* Of its controller's other axes nothing half done may go on behind the stop. Disabling one
	 * leaves the others as they are. */
	for (struct station *s = station->node->first; s; s = s->next_axis) {
		if (s == station || db_queued_command(queued) != DB_CMD_DISABLE)
			station_cancel_command(s, now);
	}
	station_add_stop(station, db_queued_command(queued), db_queued_cause(queued), queued, now);
	/* Others are to see it at once, and not with the drive's next answer, which may never come. */
	engine_publish(engine, station);
}

static void take_queued(struct db_engine *engine, db_time now)
{
	struct db_queued *queued;

	while ((queued = db_queue_take(engine->queue)) != NULL) {
		struct station *station = engine_find_station(engine, db_queued_drive(queued));

		if (!station)
			db_queued_finish(queued, DB_RESULT_FAILED, now);
		else if (db_command_is_stop(db_queued_command(queued)))
			take_stop(engine, station, queued, now);
		else if (engine->shutting_down)
			db_queued_finish(queued, DB_RESULT_CANCELLED, now);
		else if (station->leaving)
			db_queued_finish(queued, DB_RESULT_CANCELLED, now);
		else if (!engine->stats.up)
			db_queued_finish(queued, DB_RESULT_BUS_DOWN, now);
		else if (!station->node->online)
			db_queued_finish(queued, DB_RESULT_OFFLINE, now);
		else if (engine->waiting_count == engine->waiting_max)
			db_queued_finish(queued, DB_RESULT_BUSY, now);
		else
			engine->waiting[engine->waiting_count++] = queued;
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

static db_time earliest(db_time a, db_time b)
{
	return a < b ? a : b;
}

/* When a node that is not waiting for an answer wants something at the latest. */
static db_time node_wake(const struct db_engine *engine, const struct node *node, db_time now)
{
	bool waits_out = node_waits_out_late_answers(node, now);
	db_time wake = DB_TIME_NEVER;
	db_time probe = node->probe_at;

	for (const struct station *s = node->first; s; s = s->next_axis)
		wake = earliest(wake, stop_wake(engine, s, now));
	if (waits_out)
		return earliest(wake, node_late_answers_until(node, now));
	if (node->ever_probed && probe < engine->probes_from)
		probe = engine->probes_from;
	return !node->online && !engine->shutting_down ? earliest(wake, probe) : wake;
}

static db_time next_wake(const struct db_engine *engine, bool more, db_time now)
{
	db_time may_send = exchange_may_begin_at(engine, false, now);
	db_time wake = earliest(engine->cycle_at, change_deadline(engine, now));

	wake = earliest(wake, common_start_wake(engine, now));
	wake = earliest(wake, scan_wake(engine, now));

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

db_time db_engine_run(struct db_engine *engine, db_time now)
{
	/* Every node may be given something; that some jobs end without sending makes no endless loop. */
	size_t turns = 2 * engine->node_count + 1;

	engine->now = now;
	take_queued(engine, now);
	change_carry_out(engine, now);
	if (engine->second_at == 0)
		engine->second_at = now + DB_NS_PER_S;
	if (now >= engine->second_at) {
		engine->stats.utilisation = (uint32_t)(engine->busy * 1000 /
		                                       (now - engine->second_at + DB_NS_PER_S));
		engine->busy = 0;
		engine->second_at = now + DB_NS_PER_S;
	}
	scan_look(engine, now);
	/* A bus that is set aside is nobody's but the scan's. */
	while (!engine->stats.up && scan_send_next(engine, now))
		;
	if (!engine->stats.up)
		return scan_wake(engine, now);
	/* While the port takes nothing, no answer is overdue. */
	for (size_t i = 0; engine->held_since == 0 && engine->flights > 0 && i < engine->node_count;
	     i++) {
		struct node *node = engine->nodes[i];

		if (is_flying(node) && now >= node->flight.deadline)
			answer_lost(engine, node, now);
	}
	start_cycle(engine, now);
	while (turns > 0 && schedule_send_next(engine, now))
		turns--;
	return next_wake(engine, turns == 0, now);
}

/* --- the end --------------------------------------------------------------------------------------- */

void db_engine_shut_down(struct db_engine *engine, db_time now)
{
	engine->now = now;
	engine->shutting_down = true;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = engine->stations[i];
		enum db_command command = db_on_loss_command(station->config->on_exit);

		engine_finish_waiting(engine, station, DB_RESULT_CANCELLED, now);
		station_cancel_command(station, now);
		/* Who leaves was told already. */
		if (command == DB_CMD_NONE || station->leaving)
			continue;
		station_add_stop(station, command, DB_STAND_EXIT, NULL, now);
		engine_publish(engine, station);
	}
}

/* Somebody waits for it, or nothing was seen of it yet. */
static bool stop_is_open(const struct station *station)
{
	return station->stop_count > 0 || standing_is_open(&station->standing);
}

bool db_engine_is_cleared(const struct db_engine *engine)
{
	for (size_t i = 0; engine->stats.up && i < engine->station_count; i++) {
		if (engine->stations[i]->node->online && stop_is_open(engine->stations[i]))
			return false;
	}
	return !engine->stats.up || engine->flights == 0;
}

void db_engine_set_aside(struct db_engine *engine, db_time now)
{
	db_engine_tell_unconfirmed(engine);
	/* Of a drive that was lost while it turned the others are still wanted when it is back. */
	for (size_t i = 0; i < engine->station_count; i++)
		standing_withdraw(&engine->stations[i]->standing, DB_STAND_EXIT);
	engine->shutting_down = false;
	change_port(engine, false, true, EBUSY, now);
}

bool db_engine_is_quiet(const struct db_engine *engine)
{
	if (!engine->stats.up)
		return true;
	if (engine->flights > 0)
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		if (stop_is_open(engine->stations[i]))
			return false;
	}
	return true;
}

struct db_trace *db_engine_trace(const struct db_engine *engine)
{
	return engine->trace;
}

void db_engine_stats(const struct db_engine *engine, struct db_bus_stats *stats)
{
	*stats = engine->stats;
}
