/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

/* The requests that drivers are given: a stop needs nothing more. */
static const struct db_args no_args;
static const struct db_request stop_requests[] = {
	[DB_CMD_STOP] = { .command = DB_CMD_STOP, .args = &no_args },
	[DB_CMD_QUICK_STOP] = { .command = DB_CMD_QUICK_STOP, .args = &no_args },
	[DB_CMD_DISABLE] = { .command = DB_CMD_DISABLE, .args = &no_args },
};

/* --- sending ---------------------------------------------------------------------------------- */

/* The drive does not stop: all pending stops fail with RUNS_ON, also later ones. */
static void fail_stops(struct db_engine *engine, struct station *station, db_time now)
{
	struct standing *standing = &station->standing;
	bool was_known = standing->overdue;

	/* An axis that has stood all the time keeps its power: only the controller's answer is
	 * missing. */
	standing_run_on(standing,
	                station->config->on_stop_failure == DB_ON_STOP_FAILURE_DISABLE &&
	                        (standing->owed == 0 || standing->may_move),
	                now);
	station_finish_stops(station, DB_CMD_NONE, DB_RESULT_RUNS_ON, now);
	station_finish_stops(station, DB_CMD_DISABLE, DB_RESULT_RUNS_ON, now);
	if (!was_known)
		engine_publish(engine, station);
}

/* Without a known answer, a stop was sent that this drive's next one would only repeat: its own,
 * or, as a controller's stop is for all axes, that of another axis. */
static bool was_sent_blind(const struct station *station)
{
	if (station->blind_stop_sent || standing_next(&station->standing) == DB_CMD_DISABLE)
		return station->blind_stop_sent;
	for (const struct station *s = station->node->first; s; s = s->next_axis) {
		if (s->blind_stop_sent && s->standing.wide != 0)
			return true;
	}
	return false;
}

/* False: nothing was sent; the stop waits until the drives of the line can receive. */
static bool send_stop(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_STOP];
	bool in_step = station->node->in_step;
	enum db_result result = DB_RESULT_FAILED;

	if (!in_step && was_sent_blind(station)) {
		exchange_send_probe(engine, station->node, now);
		return is_flying(station->node);
	}
	if (lane->active && lane->ready && in_step && station->standing.sent_at != 0) {
		station->blind_stop_sent = false;
		return exchange_send(engine, station, LANE_STOP, now);
	}
	if (exchange_begin_job(engine, station, LANE_STOP, DB_JOB_COMMAND,
	                       &stop_requests[standing_next(&station->standing)], now,
	                       &result) == DB_STEP_SEND) {
		if (!exchange_send(engine, station, LANE_STOP, now))
			return false;
		station->blind_stop_sent = !in_step;
		return true;
	}
	/* The driver knows without a request that nothing has to be sent. */
	station_stop_sent(station, true, now);
	stop_answered(engine, station, result, now);
	return true;
}

/* One frame stops all drives at once; each is then asked for its confirmation as usual. */
static bool try_broadcast(struct db_engine *engine, db_time now)
{
	uint8_t request[DB_SHORT_REQUEST];
	struct db_exchange exchange = { .request = request, .request_size = sizeof(request) };
	enum db_command command;

	if (engine->station_count < 2 || !engine->driver->broadcast)
		return false;
	/* All drives must wait for the same stop, and none may have been sent it. */
	command = standing_next(&engine->stations[0]->standing);
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct standing *standing = &engine->stations[i]->standing;

		if (standing_is_free(standing) || standing->gives_way || standing->sent_at != 0 ||
		    standing_next(standing) != command)
			return false;
	}
	if (command == DB_CMD_NONE || !engine->driver->broadcast(command, engine->bus, &exchange))
		return false;
	for (size_t i = 0; i < engine->station_count; i++)
		station_stop_sent(engine->stations[i], false, now);
	exchange_count_unanswered(engine, &exchange, true, now);
	(void)engine_send(engine, request, exchange.request_length, DB_TRACE_BROADCAST);
	return true;
}

/* A drive that owes an answer to another request is sent the stop at once, where the line has room
 * for that: the regular stop follows when the answer has arrived or is lost. */
static bool try_interrupt(struct db_engine *engine, db_time now)
{
	uint8_t request[DB_SHORT_REQUEST];
	bool sent = false;

	if (!exchange_overlaps(engine) || !engine->driver->interrupt)
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = engine->stations[i];
		struct standing *standing = &station->standing;
		struct db_exchange exchange = { .request = request,
			                        .request_size = sizeof(request) };

		if (standing_is_free(standing) || standing->gives_way || standing->sent_at != 0 ||
		    standing->interrupted || !is_flying(station->node) ||
		    !engine->driver->interrupt(station->device, standing_next(standing), &exchange))
			continue;
		/* The regular stop is still to be sent. */
		standing->interrupted = true;
		standing->count++;
		exchange_count_unanswered(engine, &exchange, false, now);
		(void)engine_send(engine, request, exchange.request_length, DB_TRACE_STOP);
		sent = true;
	}
	return sent;
}

/* --- times ------------------------------------------------------------------------------------ */

static db_time send_at(const struct db_engine *engine, const struct station *station)
{
	bool silent = !station->node->online && !station->blind_stop_sent;
	const struct standing *standing = &station->standing;
	const struct lane *lane = &station->lanes[LANE_STOP];
	const struct lane *poll = &station->node->first->lanes[LANE_POLL];
	db_time at = standing_send_at(standing);

	/* An exchange in progress continues at once. */
	if (lane->active && lane->ready)
		return standing->since;
	/* A reading begun after the stop, perhaps of several exchanges, is not interrupted by a
	 * repeat of the stop. */
	if (poll->active && standing->sent_at != 0 && !standing->read_since &&
	    poll->job.started > standing->sent_at)
		return DB_TIME_NEVER;
	/* Only for an offline drive; one that answered its stop sent out of step is only asked
	 * about it. */
	if (silent && standing->sent_at != 0 && at < engine->stops_from)
		return engine->stops_from;
	return at;
}

/* When a drive that must stand is to be read, without waiting for the cycle. */
static db_time read_at(const struct station *station)
{
	const struct standing *standing = &station->standing;
	const struct lane *poll = &station->node->first->lanes[LANE_POLL];

	/* A ramp is followed to its end where its speed is computed from the readings. */
	if (standing_is_free(standing) || standing->gives_way ||
	    (standing->obeys && !station->snapshot.feedback.velocity_is_computed) ||
	    !station->node->online || !station->node->in_step || standing->sent_at == 0 ||
	    station->lanes[LANE_STOP].active)
		return DB_TIME_NEVER;
	/* A reading in progress continues at once. */
	return poll->active && poll->ready ? standing->since : standing->read_at;
}

static db_time deadline(const struct db_engine *engine, const struct station *station, db_time now)
{
	struct standing_rules rules = station_rules(station, engine->driver, now);

	return station->node->online ? standing_deadline(&station->standing, &rules) :
	                               DB_TIME_NEVER;
}

db_time stop_run_at(const struct db_engine *engine, const struct station *station, db_time now)
{
	db_time next = deadline(engine, station, now);
	db_time send = send_at(engine, station);
	db_time read = read_at(station);
	db_time receives = node_may_be_asked_at(station->node);

	/* A stop is only delayed by what its drive needs to receive it. */
	if (station->blind_stop_sent && node_waits_out_late_answers(station->node, now))
		return next;
	/* A first stop does not wait here until its drive can receive: meanwhile the line would be
	 * used for another drive, which may not answer. It reserves the line for itself, see
	 * exchange.c. */
	if (send < receives && station->standing.sent_at != 0)
		send = receives;
	if (read < receives)
		read = receives;
	if (read < send)
		send = read;
	return send < next ? send : next;
}

bool stop_all_are_sent(const struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct standing *standing = &engine->stations[i]->standing;

		if (!standing_is_free(standing) && !standing->gives_way && standing->sent_at == 0)
			return false;
	}
	return true;
}

/* Stops that were never sent come first, online drives before others; then all in turn. */
#define URGENCIES 3

static bool send_or_read(struct db_engine *engine, struct station *station, db_time now)
{
	struct station *first = station->node->first;
	struct lane *poll = &first->lanes[LANE_POLL];
	bool prepared;
	enum db_result result;

	if (deadline(engine, station, now) <= now) {
		fail_stops(engine, station, now);
		return false;
	}
	if (send_at(engine, station) <= now) {
		/* A drive known not to stop need not be shown so by another sample. */
		if (station->standing.overdue && station->standing.sent_at != 0)
			fail_stops(engine, station, now);
		return send_stop(engine, station, now);
	}
	if (read_at(station) > now)
		return false;
	/* An extra poll; it does not count as the cycle's. A poll that was prepared before the stop
	 * was sent, and is not sent yet, would prove nothing. */
	station->standing.read_at = DB_TIME_NEVER;
	prepared = poll->active && poll->ready &&
	           (poll->sent || poll->job.started > station->standing.sent_at);
	if (!prepared && exchange_begin_job(engine, first, LANE_POLL, DB_JOB_POLL, NULL, now,
	                                    &result) != DB_STEP_SEND) {
		/* A drive that reports its motion unasked. */
		station->standing.read_since = true;
		return false;
	}
	return exchange_send(engine, first, LANE_POLL, now);
}

bool stop_send_next(struct db_engine *engine, db_time now)
{
	size_t first = engine->next_stop;
	bool any = false;

	for (size_t i = 0; i < engine->station_count && !any; i++)
		any = !standing_is_free(&engine->stations[i]->standing);
	if (!any || exchange_may_begin_at(engine, true, now) > now)
		return false;
	if (try_broadcast(engine, now) || try_interrupt(engine, now))
		return true;
	for (unsigned urgent = 0; urgent < URGENCIES; urgent++) {
		/* While a first stop waits for silence, no drive is made to send that was sent its
		 * stop already, or may not answer. */
		if (urgent > 0 && engine->reserved.lane == LANE_STOP &&
		    engine->reserved.until > now && !stop_all_are_sent(engine))
			return false;
		for (size_t n = 0; n < engine->station_count; n++) {
			size_t i = (first + n) % engine->station_count;
			struct station *station = engine->stations[i];
			unsigned urgency = station->standing.sent_at != 0 ? 2 :
			                   station->node->online          ? 0 :
			                                                    1;

			if (standing_is_free(&station->standing) || urgency != urgent ||
			    is_flying(station->node) || stop_run_at(engine, station, now) > now ||
			    exchange_stop_waits(engine, station, now))
				continue;
			engine->next_stop = i + 1;
			if (send_or_read(engine, station, now))
				return true;
		}
	}
	return false;
}

/* --- judging the effect ----------------------------------------------------------------------- */

void stop_judge(struct db_engine *engine, struct station *station, db_time asked, db_time now)
{
	struct standing *standing = &station->standing;
	struct standing_rules rules = station_rules(station, engine->driver, now);

	if (station->lanes[LANE_STOP].active)
		return;
	switch (standing_judge(standing, &rules, &station->snapshot.feedback, asked, now)) {
	case STANDING_DONE:
		station_finish_stops(station, DB_CMD_NONE, DB_RESULT_OK, now);
		engine_publish(engine, station);
		break;
	case STANDING_OBEYS:
		station_finish_stops(station, DB_CMD_NONE, DB_RESULT_OK, now);
		break;
	case STANDING_RUNS_ON:
		fail_stops(engine, station, now);
		break;
	case STANDING_UNSEEN:
		break;
	}
}

void stop_answered(struct db_engine *engine, struct station *station, enum db_result result,
                   db_time now)
{
	struct standing *standing = &station->standing;
	enum db_command command = station->lanes[LANE_STOP].job.request->command;
	const struct db_feedback *feedback = &station->snapshot.feedback;

	station->lanes[LANE_STOP].active = false;
	station->blind_stop_sent = false;
	/* The driver has itself read whether the power is off. */
	if (standing->sent_at != 0 && (command == DB_CMD_DISABLE || result != DB_RESULT_OK))
		station_finish_stops(station, command, result, now);
	standing_stop_answered(standing, command, result == DB_RESULT_OK,
	                       engine->driver->acknowledges, now);
	/* What its own conversation has read was requested after the stop. It may show that the
	 * drive obeys; that it does not obey only an extra reading shows, because an answer may be
	 * older than the stop's effect. */
	stop_judge(engine, station, feedback->taken, now);
	standing->read_since &= result != DB_RESULT_OK || standing_next(standing) != command;
}

void stop_lost(struct db_engine *engine, struct node *node, bool stop, db_time cost, db_time now)
{
	for (struct station *s = node->first; s; s = s->next_axis) {
		if (standing_is_free(&s->standing) || s->standing.gives_way)
			continue;
		/* A drive that answers everything but stops is there: it is probed before it counts
		 * as offline, and is seen not to stop. */
		s->blind_stop_sent &= stop && node->online;
		if (standing_stop_lost(&s->standing, node->online, engine->bus->retries, cost,
		                       now) &&
		    !node->online)
			engine->stops_from = now + cost * (STANDING_LOSSES_SHARE - 1);
	}
}
