/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/engine.h"

#include "codec/can.h"
#include "sched/change.h"
#include "sched/scan.h"
#include "sched/sched_private.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* Holds the last seconds of a busy bus; CAN carries more in that time. */
#define TRACE_SIZE_SERIAL 65536
#define TRACE_SIZE_CAN 262144

/* --- making ----------------------------------------------------------------------------------- */

int db_engine_new(const struct db_bus_config *bus, const struct db_bus_drive *drives,
                  size_t drive_count, struct db_queue *queue, const struct db_engine_ops *ops,
                  void *context, struct db_engine **engine)
{
	struct db_engine *made = calloc(1, sizeof(*made));

	if (!made)
		return -ENOMEM;
	made->bus = bus;
	made->driver = bus->driver;
	made->queue = queue;
	made->ops = ops;
	made->context = context;
	made->period = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	made->stats.period_us = bus->cycle_ms * 1000;
	made->poll_time = db_driver_round_time(bus, 1, 1);
	made->axis_time = db_driver_round_time(bus, 1, 2) - made->poll_time;
	if (bus->driver->frame_silence)
		made->frame_silence = bus->driver->frame_silence(bus);
	made->waiting_max = bus->queue;
	made->waiting = calloc(made->waiting_max, sizeof(made->waiting[0]));
	/* The first drives are added as all later ones are. */
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

void db_engine_report_unconfirmed(struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++)
		engine_report_unconfirmed(engine, engine->stations[i]);
}

/* --- the port --------------------------------------------------------------------------------- */

static void change_port(struct db_engine *engine, bool up, bool aside, int error, db_time now)
{
	engine->now = now;
	engine->idle_until = 0;
	if (!up &&
	    (engine->stats.up || engine->stats.aside != aside || engine->stats.down_since == 0))
		engine->stats.down_since = now;
	engine->stats.aside = aside;
	/* This ends a scan of the bus in service. */
	if (!up && engine->stats.up && !scan_port_config(engine))
		scan_port(engine, false, error, now);
	engine->stats.up = up;
	engine->flights = 0;
	engine->port_full_since = 0;
	engine->received_length = 0;
	engine->silent_at = 0;
	engine->reserved.until = 0;
	engine->last_to_answer = NULL;
	engine->tests_gap = false;
	if (up) {
		messages_begin(engine, now);
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
		/* A drive that has answered before is probably still connected and may move. One
		 * damaged frame must not make it wait as long as a drive that is gone. */
		node->free_probes = node->answered_at != 0 ? 1 + engine->bus->retries : 1;
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

	engine->idle_until = 0;
	if (hold) {
		if (engine->port_full_since == 0)
			engine->port_full_since = now;
		return;
	}
	if (engine->port_full_since == 0)
		return;
	/* Requests handed over meanwhile were sent that much later. */
	late = now - engine->port_full_since;
	engine->port_full_since = 0;
	engine->wire_free += late;
	for (size_t i = 0; i < engine->node_count; i++)
		engine->nodes[i]->flight.deadline += late;
}

/* A thread that is run this much later than it asked for had no processor. */
#define OVERSLEPT (2 * DB_NS_PER_MS)
/* Bytes that arrived meanwhile are read within this time. */
#define READ_TIME (1 * DB_NS_PER_MS)

/* A call from outside begins. Delays of this thread on a busy computer are no drive's fault:
 * time-outs are extended by the delay, and the late reading shows nothing about the senders. */
static void extend_for_delay(struct db_engine *engine, db_time now)
{
	db_time late = engine->run_by != 0 ? now - engine->run_by : 0;

	engine->now = now;
	if (late < OVERSLEPT)
		return;
	engine->run_by = 0;
	engine->overslept_at = now;
	engine->stats.overslept_us += (uint64_t)(late / DB_NS_PER_US);
	for (size_t i = 0; engine->flights > 0 && i < engine->node_count; i++) {
		struct flight *flight = &engine->nodes[i]->flight;

		flight->deadline += late;
		if (flight->deadline < now + READ_TIME)
			flight->deadline = now + READ_TIME;
	}
}

/* No answer of a known length is this long, in bytes. */
#define LONG_ANSWER 256

static void skip_garbage(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now)
{
	struct scan *scan = engine->scan;

	if (scan && scan->question.flying && !exchange_overlaps(engine))
		scan->question.garbage += length;
	engine_count_garbage(engine, bytes, length, now);
}

/* `silence` as in db_received: the line was silent for this time since the last byte; 0: it may not
 * be. */
static void take_frames(struct db_engine *engine, db_time silence, db_time now)
{
	struct db_received received = { .silence = silence };
	size_t start = 0;
	size_t skip = 0;
	size_t frame = 0;

	do {
		const struct scan *scan = engine->scan;
		const struct db_exchange *question = scan && scan->question.flying ?
		                                             &scan->exchange :
		                                             NULL;

		/* Where exchanges overlap there is no one question, and the node that was asked
		 * last may have been removed since. */
		if (exchange_overlaps(engine))
			question = NULL;
		else if (!question && engine->flights > 0)
			question = engine->asked;
		received.bytes = engine->received + start;
		received.available = engine->received_length - start;
		received.question = question ? question->request : NULL;
		received.question_length = question ? question->request_length : 0;
		if (engine->driver->cut)
			engine->driver->cut(&received, &skip, &frame);
		else
			db_can_cut(received.bytes, received.available, &skip, &frame);
		if (skip > 0)
			skip_garbage(engine, engine->received + start, skip, now);
		start += skip;
		if (frame > 0)
			answer_receive(engine, engine->received + start, frame, now);
		start += frame;
	} while (frame > 0 && start < engine->received_length);
	/* answer_receive() never sends, so the buffer is still the one that was cut. */
	engine->received_length -= start;
	if (start > 0 && engine->received_length > 0)
		memmove(engine->received, engine->received + start, engine->received_length);
}

void db_engine_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now)
{
	extend_for_delay(engine, now);
	while (length > 0) {
		size_t room = sizeof(engine->received) - engine->received_length;
		size_t take = length < room ? length : room;

		if (engine->scan)
			scan_receive(engine, bytes, take, now);
		memcpy(engine->received + engine->received_length, bytes, take);
		engine->received_length += take;
		bytes += take;
		length -= take;
		take_frames(engine, 0, now);
		if (engine->received_length == sizeof(engine->received)) {
			skip_garbage(engine, engine->received, engine->received_length, now);
			engine->received_length = 0;
		}
	}
	/* An answer of unknown length is arriving: it is awaited as long as bytes arrive, and may
	 * be valid. */
	for (size_t i = 0; engine->received_length > LONG_ANSWER && i < engine->node_count; i++) {
		struct flight *flight = &engine->nodes[i]->flight;
		db_time until = now + flight->patience;
		const struct db_exchange *exchange;
		db_time longest;

		if (!flight->station)
			continue;
		exchange = &flight->station->lanes[flight->lane].exchange;
		longest = flight->sent + flight->patience + exchange->extra_time +
		          engine->bus->transport->wire_time(engine->bus, exchange->request,
		                                            exchange->request_length,
		                                            DB_ANSWER_MAX);
		if (exchange->open_ended && flight->deadline < until && until < longest)
			flight->deadline = until;
	}
	if (engine->frame_silence > 0) {
		engine->silent_at = engine->received_length > 0 ? now + engine->frame_silence : 0;
		engine->idle_until = 0;
	}
}

size_t db_engine_awaited(const struct db_engine *engine, size_t *come)
{
	*come = engine->received_length;
	if (engine->flights > 0)
		return engine->awaited;
	/* The answer to a timed-out exchange may still arrive, of any length, and shows how late
	 * its drive is. */
	return engine->now < engine->late_until ? DB_ANSWER_MAX : 0;
}

bool db_engine_wants_all_frames(const struct db_engine *engine, db_time now)
{
	if (!engine->stats.up || engine->stats.online == engine->station_count)
		return false;
	for (size_t i = 0; i < engine->node_count; i++) {
		const struct node *node = engine->nodes[i];

		if (!node->online && node->probe_backoff > PROBE_BACKOFF_MAX / 2 &&
		    (is_flying(node) || node->probe_at <= now))
			return true;
	}
	return false;
}

/* --- requests --------------------------------------------------------------------------------- */

static void receive_requests(struct db_engine *engine, db_time now)
{
	struct db_request *request;

	while ((request = db_queue_take(engine->queue)) != NULL) {
		struct station *station = engine_find_station(engine, request->drive);

		engine->idle_until = 0;
		if (!station) {
			db_queue_finish(request, DB_RESULT_FAILED, now);
			continue;
		}
		if (db_command_is_stop(request->command)) {
			engine_finish_waiting_requests(engine, station, DB_RESULT_CANCELLED, now);
			/* A stop also cancels unfinished commands of the controller's other axes.
			 * Disabling one axis leaves the others as they are. */
			for (struct station *s = station->node->first; s; s = s->next_axis) {
				if (s == station || request->command != DB_CMD_DISABLE)
					station_cancel_command(s, engine->driver, now);
			}
			engine_add_stop(engine, station, request->command,
			                (enum db_stand_cause)request->cause, request, now);
			continue;
		}
		if (engine->shutting_down || station->leaving)
			db_queue_finish(request, DB_RESULT_CANCELLED, now);
		else if (!engine->stats.up)
			db_queue_finish(request, DB_RESULT_BUS_DOWN, now);
		else if (!station->node->online)
			db_queue_finish(request, DB_RESULT_OFFLINE, now);
		else if (engine->waiting_count == engine->waiting_max)
			db_queue_finish(request, DB_RESULT_BUSY, now);
		else {
			/* A parameter write moves nothing. */
			if (request->setting_count == 0)
				station->commanded = now;
			engine->waiting[engine->waiting_count++] = request;
		}
	}
	engine->stats.queued = (uint32_t)engine->waiting_count;
}

/* --- the cycle -------------------------------------------------------------------------------- */

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
	/* Cycles that were missed completely count as overruns and are not repeated. */
	missed = (now - engine->cycle_at) / engine->period;
	engine->cycle_at += (missed + 1) * engine->period;
	engine->stats.overruns += (uint32_t)missed;
	schedule_begin_cycle(engine, now);
}

/* When a node that does not wait for an answer wants something at the latest. */
static db_time node_run_at(const struct db_engine *engine, const struct node *node, db_time now)
{
	bool has_request = node->poll_due || engine->waiting_count > 0;
	db_time wake = DB_TIME_NEVER;
	db_time probe = node->probe_at;
	db_time receives = node_may_be_asked_at(node);

	for (const struct station *s = node->first; s; s = s->next_axis) {
		if (s->blind_stop_sent || !standing_is_free(&s->standing) ||
		    s->lanes[LANE_STOP].active)
			wake = db_time_min(wake, stop_run_at(engine, s, now));
		if (s->lanes[LANE_COMMAND].ready && s->lanes[LANE_COMMAND].exchange.again &&
		    s->again_sent + SCHEDULE_AGAIN_PAUSE > now)
			wake = db_time_min(wake, s->again_sent + SCHEDULE_AGAIN_PAUSE);
		has_request |= s->lanes[LANE_COMMAND].ready || s->lanes[LANE_IDENTIFY].ready;
	}
	if (node_waits_out_late_answers(node, now))
		return db_time_min(wake, node_late_answers_until(node, now));
	if (receives > now && has_request)
		wake = db_time_min(wake, receives);
	if (node->free_probes == 0 && probe < engine->probes_from)
		probe = engine->probes_from;
	if (probe < receives)
		probe = receives;
	return !node->online && !engine->shutting_down && !scan_is_asking(engine, node) ?
	               db_time_min(wake, probe) :
	               wake;
}

static db_time next_run(struct db_engine *engine, bool more, db_time now)
{
	db_time may_send = exchange_may_begin_at(engine, false, now);
	db_time wake = engine->cycle_at;

	/* After this time only the end of the exchange on the wire is awaited. */
	if (engine->change && engine->change->leave_by > now)
		wake = db_time_min(wake, engine->change->leave_by);
	if (engine->bus->starts_by_broadcast)
		wake = db_time_min(wake, common_start_run_at(engine, now));
	if (engine->scan)
		wake = db_time_min(wake, scan_run_at(engine, now));

	/* There is more to be sent as soon as the wire has room. */
	if (more || may_send > now)
		wake = db_time_min(wake, may_send > now ? may_send : now + 1);
	/* While the port holds, no answer is overdue. */
	if (engine->flights > 0 && engine->port_full_since == 0)
		wake = db_time_min(wake, engine->overdue_from);
	if (engine->next_message_at > now)
		wake = db_time_min(wake, engine->next_message_at);
	if (engine->silent_at != 0)
		wake = db_time_min(wake, engine->silent_at);
	/* A node that does not wait for an answer may want something at its own time. */
	if (may_send <= now &&
	    (engine->drives_active || engine->nodes_due > 0 || engine->waiting_count > 0 ||
	     engine->may_identify || engine->stats.online < engine->station_count)) {
		for (size_t i = 0; i < engine->node_count; i++) {
			const struct node *node = engine->nodes[i];

			if (!is_flying(node))
				wake = db_time_min(wake, node_run_at(engine, node, now));
		}
	}
	/* A reserved line does not delay stops. A stop that is due waits only for the line
	 * itself. */
	for (size_t i = 0; engine->reserved.until > now && i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];
		db_time at = standing_is_free(&station->standing) || is_flying(station->node) ?
		                     DB_TIME_NEVER :
		                     stop_run_at(engine, station, now);

		if (at > now)
			wake = db_time_min(wake, at);
	}
	return wake > now ? wake : now + 1;
}

static void give_up_overdue(struct db_engine *engine, db_time now)
{
	engine->overdue_from = DB_TIME_NEVER;
	for (size_t i = 0; i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];
		struct flight *flight = &node->flight;
		const struct db_exchange *exchange;

		if (!is_flying(node))
			continue;
		exchange = &flight->station->lanes[flight->lane].exchange;
		if (now >= flight->deadline && !exchange_overlaps(engine) && !flight->extended &&
		    engine->received_length > 0) {
			/* The first bytes of a frame have come. We wait for the others, once, and
			 * send nothing that would disturb them: a drive that is late by just this
			 * much would never be understood, and nothing could be learnt about it. */
			db_time rest = engine->bus->transport->wire_time(
				engine->bus, exchange->request, 0, exchange->answer_length);

			flight->extended = true;
			flight->deadline += rest;
			flight->patience += rest;
		} else if (now >= flight->deadline) {
			answer_lost(engine, node, now);
		}
		if (is_flying(node))
			engine->overdue_from = db_time_min(engine->overdue_from, flight->deadline);
	}
}

db_time db_engine_run(struct db_engine *engine, db_time now)
{
	/* Every node may be given a request; the limit prevents an endless loop if jobs end without
	 * sending. */
	size_t turns = 2 * engine->node_count + 1;

	extend_for_delay(engine, now);
	engine->run_by = 0;
	receive_requests(engine, now);
	if (now < engine->idle_until && !engine->change && !engine->scan) {
		engine->run_by = engine->idle_until;
		return engine->idle_until;
	}
	if (engine->change)
		change_carry_out(engine, now);
	/* The first second begins with the first call: nothing was on the wire before. */
	if (now >= engine->second_at) {
		engine->stats.utilisation = (uint32_t)(engine->busy * 1000 /
		                                       (now - engine->second_at + DB_NS_PER_S));
		engine->busy = 0;
		engine->second_at = now + DB_NS_PER_S;
	}
	if (engine->scan)
		scan_check(engine, now);
	/* A bus that is out of service belongs to the scan alone. */
	while (!engine->stats.up && scan_send_next(engine, now))
		;
	if (!engine->stats.up)
		return scan_run_at(engine, now);
	if (engine->silent_at != 0 && now >= engine->silent_at) {
		engine->silent_at = 0;
		if (engine->received_length > 0)
			take_frames(engine, engine->frame_silence, now);
	}
	/* While the port takes nothing, no answer is overdue. */
	if (engine->port_full_since == 0 && engine->flights > 0 && now >= engine->overdue_from)
		give_up_overdue(engine, now);
	start_cycle(engine, now);
	while (turns > 0 && schedule_send_next(engine, now))
		turns--;
	engine->idle_until = next_run(engine, turns == 0, now);
	engine->run_by = engine->idle_until;
	return engine->idle_until;
}

/* --- the end ---------------------------------------------------------------------------------- */

void db_engine_shut_down(struct db_engine *engine, db_time now)
{
	engine->now = now;
	engine->idle_until = 0;
	engine->shutting_down = true;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = engine->stations[i];
		enum db_command command = db_on_loss_command(station->config->on_exit);

		engine_finish_waiting_requests(engine, station, DB_RESULT_CANCELLED, now);
		station_cancel_command(station, engine->driver, now);
		/* A drive that leaves was sent its stop already. */
		if (command == DB_CMD_NONE || station->leaving)
			continue;
		engine_add_stop(engine, station, command, DB_STAND_EXIT, NULL, now);
	}
}

void db_engine_set_aside(struct db_engine *engine, db_time now)
{
	db_engine_report_unconfirmed(engine);
	/* A drive that was lost while its motor turned must still stand for its other causes when
	 * it is back. */
	for (size_t i = 0; i < engine->station_count; i++)
		standing_withdraw(&engine->stations[i]->standing, DB_STAND_EXIT);
	engine->shutting_down = false;
	change_port(engine, false, true, EBUSY, now);
}

bool db_engine_is_quiet(const struct db_engine *engine, bool cleared)
{
	if (!engine->stats.up)
		return true;
	if (engine->flights > 0)
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (station_has_open_stop(station) && (station->node->online || !cleared))
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
