/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/exchange.h"

#include "sched/scan.h"

/*
 * On CAN requests to several drives are under way at once. So much work, in time on the wire, is
 * given to the wire ahead: enough for it not to fall idle while this thread wakes up, and little
 * enough for a stop not to wait long behind it.
 */
#define AHEAD (1 * DB_NS_PER_MS)

/* What drives are given to act on a broadcast before they are asked something. */
#define BROADCAST_GAP (2 * DB_NS_PER_MS)

bool exchange_overlaps(const struct db_engine *engine)
{
	return engine->driver->medium == DB_MEDIUM_CAN;
}

db_time exchange_may_begin_at(const struct db_engine *engine, bool stop, db_time now)
{
	if (engine->held_since != 0)
		return DB_TIME_NEVER;
	if (now < engine->quiet_until)
		return engine->quiet_until;
	if (engine->flights == 0)
		return now;
	if (!exchange_overlaps(engine))
		return DB_TIME_NEVER;
	return stop || engine->wire_free - AHEAD <= now ? now : engine->wire_free - AHEAD;
}

db_time exchange_wire_time(const struct db_engine *engine, const struct db_exchange *exchange)
{
	return engine->bus->transport->wire_time(engine->bus, exchange->request,
	                                         exchange->request_length, exchange->answer_length);
}

enum db_step exchange_begin_job(struct db_engine *engine, struct station *station,
                                enum lane_kind kind, enum db_job_kind job,
                                const struct db_request *request, db_time now,
                                enum db_result *result)
{
	struct db_conversation talk = station_conversation(station, kind, now);
	struct lane *lane = &station->lanes[kind];
	enum db_step step;

	lane->job = (struct db_job){ .kind = job,
		                     .request = request,
		                     .started = now,
		                     .out_of_step = !station->node->in_step };
	lane->tries = 0;
	lane->sent = false;
	lane->exchange.begins = lane->exchange.again = false;
	step = engine->driver->begin(&talk);
	*result = talk.result;
	lane->active = lane->ready = step == DB_STEP_SEND;
	return step;
}

/* Whoever asked for what goes out now is told when, for the skew of a group. */
static void note_sent(struct station *station, enum lane_kind kind, db_time now)
{
	const struct db_request *request = station->lanes[kind].job.request;

	if (kind != LANE_COMMAND || !station->queued)
		return;
	/* Of a common start what comes before the frame that begins the motion is only preparation. */
	if (request->group == 0 || station->alone)
		db_queued_sent(station->queued, now);
	if (db_command_is_motion(request->command))
		station->motion_sent = now;
}

static const enum db_trace_kind trace_kinds[LANE_COUNT] = {
	[LANE_STOP] = DB_TRACE_STOP,         [LANE_POLL] = DB_TRACE_POLL,
	[LANE_IDENTIFY] = DB_TRACE_IDENTIFY, [LANE_PROBE] = DB_TRACE_PROBE,
	[LANE_COMMAND] = DB_TRACE_COMMAND,
};

void exchange_send(struct db_engine *engine, struct station *station, enum lane_kind kind,
                   db_time now)
{
	struct lane *lane = &station->lanes[kind];
	struct node *node = station->node;
	db_time wire = exchange_wire_time(engine, &lane->exchange);

	scan_yield(engine, node, kind == LANE_COMMAND);
	/* A poll asks for everything once. */
	if (kind != LANE_POLL || !lane->sent)
		doubled_begin(&node->doubled);
	/* What else a stop's conversation sends only asks for its effect. */
	if (kind == LANE_STOP && !lane->sent)
		station_note_stop_sent(station, node->in_step, now);
	lane->ready = false;
	lane->sent = true;
	lane->exchange.sending = ++engine->sendings;
	if (engine->flights == 0) {
		/* Whatever is still in the buffer was said before this question. */
		if (engine->received_length > 0)
			engine_take_garbage(engine, engine->received, engine->received_length, now);
		engine->received_length = 0;
		engine->wire_free = now;
	}
	if (engine->wire_free < now)
		engine->wire_free = now;
	engine->wire_free += wire;
	engine->flights++;
	node->flight = (struct flight){
		.station = station,
		.lane = kind,
		.trusted = node->in_step,
		.sent = now,
		.wire = wire,
		.deadline = engine->wire_free + lane->exchange.extra_time +
		            (db_time)engine->bus->drive_latency_ms * DB_NS_PER_MS,
	};
	engine->stats.transactions++;
	station->snapshot.stats.requests++;
	engine->command_was_last = kind == LANE_COMMAND;
	note_sent(station, kind, now);
	if (kind == LANE_COMMAND)
		engine_tell_raw(engine, station, true, lane->exchange.request,
		                lane->exchange.request_length);
	node->flight.question = engine_send(engine, lane->exchange.request,
	                                    lane->exchange.request_length, trace_kinds[kind]);
}

void exchange_send_probe(struct db_engine *engine, struct node *node, db_time now)
{
	struct station *station = node->first;
	enum db_result result;

	node->ever_probed = true;
	if (exchange_begin_job(engine, station, LANE_PROBE, DB_JOB_PROBE, NULL, now, &result) ==
	    DB_STEP_SEND)
		exchange_send(engine, station, LANE_PROBE, now);
}

/* Sends a prepared exchange, after getting back in step with the drive where that is needed. */
void exchange_send_in_step(struct db_engine *engine, struct station *station, enum lane_kind kind,
                           db_time now)
{
	if (station->node->in_step)
		exchange_send(engine, station, kind, now);
	else
		exchange_send_probe(engine, station->node, now);
}

void exchange_end(struct db_engine *engine, struct node *node, db_time now)
{
	/* Where exchanges overlap, the time they wait side by side is not the wire's. */
	engine->busy += engine->driver->medium == DB_MEDIUM_CAN ? node->flight.wire :
	                                                          now - node->flight.sent;
	node->flight.station = NULL;
	engine->flights--;
}

void exchange_note_broadcast(struct db_engine *engine, const struct db_exchange *exchange,
                             db_time now)
{
	/* On CAN what follows waits for its turn on the wire by itself. */
	if (!exchange_overlaps(engine))
		engine->quiet_until = now + BROADCAST_GAP + exchange_wire_time(engine, exchange);
	engine->stats.transactions++;
}
