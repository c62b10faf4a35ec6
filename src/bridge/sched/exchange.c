/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/scan.h"

#include <string.h>

/* Time for drives to act on a broadcast before the next request. */
#define BROADCAST_GAP (2 * DB_NS_PER_MS)

/* --- long exchanges --------------------------------------------------------------------------- */

bool exchange_must_be_short(const struct db_engine *engine)
{
	if (exchange_overlaps(engine))
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];
		const struct lane *command = &station->lanes[LANE_COMMAND];
		bool moves = station->snapshot.feedback.status & DB_STATUS_MOVING;
		/* A motion was sent, and readings since then do not show yet whether it began. */
		bool may_move = station->motion_sent > station->snapshot.feedback.taken ||
		                (command->active && command->sent &&
		                 command->job.kind == DB_JOB_COMMAND &&
		                 db_command_is_motion(command->job.request->command));

		if (station->node->online &&
		    (moves || may_move || standing_is_open(&station->standing)))
			return true;
	}
	return false;
}

bool exchange_is_too_long(const struct db_engine *engine, const struct db_exchange *exchange)
{
	return exchange_must_be_short(engine) &&
	       exchange_wire_time(engine, exchange) + exchange->extra_time >
	               db_driver_brief_time(engine->bus);
}

/* --- conversations ---------------------------------------------------------------------------- */

enum db_step exchange_begin_job(struct db_engine *engine, struct station *station,
                                enum lane_kind kind, enum db_job_kind job,
                                const struct db_request *request, db_time now,
                                enum db_result *result)
{
	struct db_conversation talk = station_conversation(station, kind, now);
	struct lane *lane = &station->lanes[kind];
	bool settings = kind == LANE_COMMAND && job == DB_JOB_SETTINGS;
	enum db_step step;

	engine->drives_active |= kind == LANE_COMMAND || kind == LANE_STOP;
	lane->job = (struct db_job){ .kind = job,
		                     .request = request,
		                     .parts = settings ? db_queue_parts(station->request) : NULL,
		                     .started = now,
		                     .out_of_step = !station->node->in_step };
	lane->tries = 0;
	lane->sent = false;
	lane->exchange.begins = lane->exchange.again = false;
	talk.brief = kind == LANE_COMMAND && exchange_must_be_short(engine);
	step = engine->driver->begin(&talk);
	*result = talk.result;
	lane->active = lane->ready = step == DB_STEP_SEND;
	return step;
}

static const enum db_trace_kind trace_kinds[LANE_COUNT] = {
	[LANE_STOP] = DB_TRACE_STOP,         [LANE_POLL] = DB_TRACE_POLL,
	[LANE_IDENTIFY] = DB_TRACE_IDENTIFY, [LANE_PROBE] = DB_TRACE_PROBE,
	[LANE_COMMAND] = DB_TRACE_COMMAND,
};

/* --- waiting ---------------------------------------------------------------------------------- */

/* The line is reserved for this time at most, however much an unsolicited sender sends. */
#define RESERVED_MOST (3 * LEARN_GAP_MOST)

/* Waiting stops share the reservation: otherwise two of them would delay each other, and begin to
 * wait again, for ever. */
static bool is_reserved_for(const struct reserved *reserved, const struct station *station,
                            enum lane_kind kind)
{
	return reserved->until != 0 && reserved->lane == kind &&
	       (kind == LANE_STOP || reserved->station == station);
}

void exchange_reserve(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      db_time until, db_time now)
{
	struct reserved *reserved = &engine->reserved;
	bool same = is_reserved_for(reserved, station, kind);

	/* The first of several stops must not wait for what the others wait for, nor any stop for
	 * something else. */
	if (reserved->until > now && reserved->lane == LANE_STOP &&
	    (kind != LANE_STOP || reserved->until < until))
		return;
	*reserved = (struct reserved){
		.station = station,
		.lane = kind,
		.share = engine->charged_class,
		.since = same ? reserved->since : now,
		.until = until,
	};
}

/* True: it must not be sent now. */
static bool must_wait(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      db_time now)
{
	const struct reserved *reserved = &engine->reserved;
	const struct db_exchange *exchange = &station->lanes[kind].exchange;
	const struct node *node = station->node;
	bool again = is_reserved_for(reserved, station, kind);
	/* The drive's own gap begins with an answer to this bridge; other traffic does not make it
	 * longer. */
	db_time at = node_may_be_asked_at(node);

	if (!exchange_overlaps(engine) && (!again || now - reserved->since < RESERVED_MOST)) {
		at = db_time_max(at, gaps_harmless_at(engine, node->address, exchange->request,
		                                      exchange->request_length, now));
		/* A frame that must not be lost waits until the drive is sure to receive it. A stop
		 * is repeated anyway. A lost probe costs the drive its place: it waits, too. */
		if (kind != LANE_STOP && (!exchange->repeatable || kind == LANE_PROBE))
			at = db_time_max(at, gaps_over_at(engine, node, now));
	}
	if (at > now) {
		exchange_reserve(engine, station, kind, at, now);
		return true;
	}
	if (again)
		engine->reserved.until = 0;
	return false;
}

bool exchange_stop_waits(const struct db_engine *engine, const struct station *station, db_time now)
{
	const struct lane *lane = &station->lanes[LANE_STOP];

	return engine->reserved.until > now && engine->reserved.lane == LANE_STOP && lane->active &&
	       lane->ready;
}

/* The drive for which it was reserved may have been removed, and its conversation may be over. */
bool exchange_send_reserved(struct db_engine *engine, db_time now)
{
	const struct reserved reserved = engine->reserved;

	if (reserved.until == 0 || reserved.until > now)
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = engine->stations[i];

		if (station != reserved.station || reserved.lane == LANE_STOP ||
		    !station->lanes[reserved.lane].ready || is_flying(station->node) ||
		    (reserved.lane == LANE_COMMAND && station_awaits_stop(station)))
			continue;
		if (reserved.lane != LANE_PROBE && !station->node->in_step)
			break;
		/* A drive of the line may have begun to move, or to be stopped, since it was
		 * prepared. */
		if (station->node->in_step &&
		    exchange_is_too_long(engine, &station->lanes[reserved.lane].exchange))
			break;
		engine->charged_class = reserved.share;
		(void)exchange_send(engine, station, reserved.lane, now);
		return true;
	}
	engine->reserved.until = 0;
	return false;
}

/* --- sending ---------------------------------------------------------------------------------- */

/* Charges the class for the exchange's time on the wire, and the node with its turns; `usual`:
 * without the drive's response time and without a loss. */
static void charge(struct db_engine *engine, struct node *node, db_time cost, db_time usual)
{
	enum db_share share = node->flight.share;
	db_time most = DB_SHARE_LATE_TURNS * usual;

	shares_charge(&engine->shares, share, cost);
	if (cost > most)
		cost = most;
	/* The exchanges of a poll follow each other; after a probe it is the other nodes' turn. */
	if (node->flight.lane == LANE_PROBE)
		node->used += cost;
	else if (node->flight.lane == LANE_POLL)
		node->spent += cost;
}

static db_time poll_wire_time(const struct db_engine *engine, struct node *node,
                              const struct db_exchange *exchange)
{
	if (exchange->request_length != sizeof(node->poll_frame) || !exchange_overlaps(engine))
		return exchange_wire_time(engine, exchange);
	if (node->poll_wire == 0 || node->poll_answer != exchange->answer_length ||
	    memcmp(&node->poll_frame, exchange->request, sizeof(node->poll_frame)) != 0) {
		memcpy(&node->poll_frame, exchange->request, sizeof(node->poll_frame));
		node->poll_answer = exchange->answer_length;
		node->poll_wire = exchange_wire_time(engine, exchange);
	}
	return node->poll_wire;
}

bool exchange_send(struct db_engine *engine, struct station *station, enum lane_kind kind,
                   db_time now)
{
	struct lane *lane = &station->lanes[kind];
	struct node *node = station->node;
	db_time wire = kind == LANE_POLL ? poll_wire_time(engine, node, &lane->exchange) :
	                                   exchange_wire_time(engine, &lane->exchange);

	if (must_wait(engine, station, kind, now))
		return false;
	scan_give_way(engine, node, kind == LANE_COMMAND);
	/* A poll requests everything once. */
	if (kind != LANE_POLL || !lane->sent)
		node->doubled.seen_count = 0;
	/* The later exchanges of a stop's conversation only ask for its effect. */
	if (kind == LANE_STOP && !lane->sent)
		station_stop_sent(station, node->in_step, now);
	if (kind == LANE_PROBE)
		node->free_probes -= node->free_probes > 0;
	lane->ready = false;
	lane->sent = true;
	lane->exchange.sending = ++engine->exchange_count;
	engine_discard_received(engine, now);
	engine->wire_free = (engine->flights == 0 ? now : db_time_max(engine->wire_free, now)) +
	                    wire;
	engine->flights++;
	engine->asked = &lane->exchange;
	node->flight = (struct flight){
		.station = station,
		.lane = kind,
		.share = engine->charged_class,
		.in_step = node->in_step,
		.sent = now,
		.wire = wire,
		.deadline = engine->wire_free + lane->exchange.extra_time + node->patience.now,
		.patience = node->patience.now,
		.pause = now - engine->last_answer_at,
	};
	if (engine->flights == 1 || node->flight.deadline < engine->overdue_from)
		engine->overdue_from = node->flight.deadline;
	/* Where exchanges overlap, the time in which they wait together is not the wire's. */
	if (exchange_overlaps(engine))
		charge(engine, node, wire, wire);
	engine->awaited = lane->exchange.open_ended ? DB_ANSWER_MAX : lane->exchange.answer_length;
	engine->stats.transactions++;
	station->snapshot.stats.requests++;
	if (kind == LANE_COMMAND) {
		/* In a common start, everything before the frame that begins the motion is only
		 * preparation. */
		if (lane->job.request->group == 0 || station->starts_alone)
			db_queue_note_sent(station->request, now);
		if (db_command_is_motion(lane->job.request->command))
			station->motion_sent = now;
		engine_report_raw_frame(engine, station, true, lane->exchange.request,
		                        lane->exchange.request_length);
	}
	node->flight.question = engine_send(engine, lane->exchange.request,
	                                    lane->exchange.request_length, trace_kinds[kind]);
	return true;
}

void exchange_send_probe(struct db_engine *engine, struct node *node, db_time now)
{
	struct station *station = node->first;
	enum db_result result;

	if (exchange_begin_job(engine, station, LANE_PROBE, DB_JOB_PROBE, NULL, now, &result) ==
	    DB_STEP_SEND)
		(void)exchange_send(engine, station, LANE_PROBE, now);
}

/* Sends a prepared exchange, after getting back in step with the drive where that is needed. */
void exchange_send_in_step(struct db_engine *engine, struct station *station, enum lane_kind kind,
                           db_time now)
{
	if (station->node->in_step)
		(void)exchange_send(engine, station, kind, now);
	else
		exchange_send_probe(engine, station->node, now);
}

void exchange_end(struct db_engine *engine, struct node *node, db_time now)
{
	db_time wire = node->flight.wire;
	db_time pause = node->hold.now;

	if (exchange_overlaps(engine)) {
		engine->busy += wire;
	} else {
		engine->busy += now - node->flight.sent;
		charge(engine, node, now - node->flight.sent + pause, wire + pause);
	}
	/* What was sent or lost may have left parameters to be read. */
	engine->may_identify |= node->flight.lane != LANE_POLL;
	node->flight.station = NULL;
	engine->flights--;
}

void exchange_count_unanswered(struct db_engine *engine, const struct db_exchange *exchange,
                               bool to_all, db_time now)
{
	db_time wire = exchange_wire_time(engine, exchange);

	/* On CAN the next frame waits for its turn on the wire by itself. */
	if (to_all && !exchange_overlaps(engine))
		engine->quiet_until = now + BROADCAST_GAP + wire;
	else if (!to_all)
		engine->wire_free = db_time_max(engine->wire_free, now) + wire;
	engine->stats.transactions++;
}
