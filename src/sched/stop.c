/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/stop.h"

#include "sched/exchange.h"

/* As drivers are handed them: all that there is to a stop. */
static const struct db_request stop_requests[] = {
	[DB_CMD_STOP] = { .command = DB_CMD_STOP },
	[DB_CMD_QUICK_STOP] = { .command = DB_CMD_QUICK_STOP },
	[DB_CMD_DISABLE] = { .command = DB_CMD_DISABLE },
};

/* --- sending it ------------------------------------------------------------------------------------ */

/* It runs on: those who wait are answered so, whoever asks again, too. */
static void run_on(struct db_engine *engine, struct station *station, db_time now)
{
	struct standing *standing = &station->standing;
	bool news = !standing->overdue;

	standing_run_on(standing, station->config->on_stop_failure == DB_ON_STOP_FAILURE_DISABLE,
	                now);
	station_finish_stops(station, DB_CMD_NONE, DB_RESULT_RUNS_ON, now);
	station_finish_stops(station, DB_CMD_DISABLE, DB_RESULT_RUNS_ON, now);
	if (news)
		engine_publish(engine, station);
}

static void send_stop(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_STOP];
	bool in_step = station->node->in_step;
	enum db_result result = DB_RESULT_FAILED;

	if (!in_step && station->blind_stop_sent) {
		exchange_send_probe(engine, station->node, now);
		return;
	}
	station->blind_stop_sent = !in_step;
	if (lane->active && lane->ready && in_step && station->standing.sent_at != 0) {
		exchange_send(engine, station, LANE_STOP, now);
		return;
	}
	if (exchange_begin_job(engine, station, LANE_STOP, DB_JOB_COMMAND,
	                       &stop_requests[standing_next(&station->standing)], now,
	                       &result) == DB_STEP_SEND) {
		exchange_send(engine, station, LANE_STOP, now);
		return;
	}
	/* The driver knows without asking that nothing has to be sent. */
	station_note_stop_sent(station, true, now);
	stop_note_answered(engine, station, result, now);
}

/* Does every drive of the bus wait for one and the same stop that was not sent to any of them yet? */
static bool all_want(const struct db_engine *engine, enum db_command command)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct standing *standing = &engine->stations[i]->standing;

		if (standing_is_free(standing) || standing->yields || standing->sent_at != 0 ||
		    standing_next(standing) != command)
			return false;
	}
	return true;
}

/* One frame stops everybody at once; each drive is then asked for its confirmation as usual. */
static bool try_broadcast(struct db_engine *engine, db_time now)
{
	uint8_t request[DB_SHORT_REQUEST];
	struct db_exchange exchange = { .request = request, .request_size = sizeof request };
	enum db_command command;

	if (engine->station_count < 2 || !engine->driver->broadcast)
		return false;
	command = standing_next(&engine->stations[0]->standing);
	if (command == DB_CMD_NONE || !all_want(engine, command) ||
	    !engine->driver->broadcast(command, engine->bus, &exchange))
		return false;
	for (size_t i = 0; i < engine->station_count; i++)
		station_note_stop_sent(engine->stations[i], false, now);
	exchange_note_broadcast(engine, &exchange, now);
	(void)engine_send(engine, request, exchange.request_length, DB_TRACE_BROADCAST);
	return true;
}

/* --- when ------------------------------------------------------------------------------------------ */

/* A reading that was begun after the stop, of several exchanges perhaps, is not broken off for saying it again. */
static bool is_being_read(const struct station *station)
{
	const struct lane *poll = &station->node->first->lanes[LANE_POLL];

	return poll->active && station->standing.sent_at != 0 && !station->standing.looked &&
	       poll->job.started > station->standing.sent_at;
}

static db_time send_at(const struct db_engine *engine, const struct station *station)
{
	bool silent = !station->node->online && !station->blind_stop_sent;
	const struct lane *lane = &station->lanes[LANE_STOP];
	db_time at = standing_send_at(&station->standing);

	/* What has begun goes on at once. */
	if (lane->active && lane->ready)
		return station->standing.since;
	if (is_being_read(station))
		return DB_TIME_NEVER;
	/* An offline drive's first; but one that answered its blind stop is only asked about it. */
	if (silent && station->standing.sent_at != 0 && at < engine->stops_from)
		return engine->stops_from;
	return at;
}

/* When a drive that must stand is to be looked at, without waiting for the cycle. */
static db_time look_at(const struct station *station)
{
	const struct standing *standing = &station->standing;
	const struct lane *poll = &station->node->first->lanes[LANE_POLL];

	if (standing_is_free(standing) || standing->yields || standing->obeys ||
	    !station->node->online || !station->node->in_step || standing->sent_at == 0 ||
	    station->lanes[LANE_STOP].active)
		return DB_TIME_NEVER;
	/* One that has begun goes on at once. */
	return poll->active && poll->ready ? standing->since : standing->look_at;
}

static db_time deadline(const struct db_engine *engine, const struct station *station, db_time now)
{
	struct standing_rules rules = station_rules(station, engine->driver, now);

	return station->node->online ? standing_deadline(&station->standing, &rules) :
	                               DB_TIME_NEVER;
}

db_time stop_wake(const struct db_engine *engine, const struct station *station, db_time now)
{
	db_time next = deadline(engine, station, now);
	db_time send = send_at(engine, station);
	db_time look = look_at(station);

	/* A stop itself is never held back, only the question whether it was obeyed. */
	if (station->blind_stop_sent && node_waits_out_late_answers(station->node, now))
		return next;
	next = send < next ? send : next;
	return look < next ? look : next;
}

bool stop_all_are_sent(const struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct standing *standing = &engine->stations[i]->standing;

		if (!standing_is_free(standing) && !standing->yields && standing->sent_at == 0)
			return false;
	}
	return true;
}

/* Not counted in the round of polls: it comes on top of it. */
static bool look_at_drive(struct db_engine *engine, struct station *station, db_time now)
{
	struct station *first = station->node->first;
	struct lane *lane = &first->lanes[LANE_POLL];
	enum db_result result;

	station->standing.look_at = DB_TIME_NEVER;
	station->node->polled = now;
	if (!(lane->active && lane->ready) &&
	    exchange_begin_job(engine, first, LANE_POLL, DB_JOB_POLL, NULL, now, &result) !=
	            DB_STEP_SEND) {
		/* A drive that tells by itself what it does. */
		station->standing.looked = true;
		return false;
	}
	exchange_send(engine, first, LANE_POLL, now);
	return true;
}

/* Those whose stop was never sent come first, and of them those that are there; then all in turn. */
static unsigned urgency(const struct station *station)
{
	if (station->standing.sent_at != 0)
		return 2;
	return station->node->online ? 0 : 1;
}

#define URGENCIES 3

static bool serve(struct db_engine *engine, struct station *station, db_time now)
{
	if (deadline(engine, station, now) <= now) {
		run_on(engine, station, now);
		return false;
	}
	if (send_at(engine, station) <= now) {
		/* Of one that is known to run on no sample need tell it once more. */
		if (station->standing.overdue && station->standing.sent_at != 0)
			run_on(engine, station, now);
		send_stop(engine, station, now);
		return true;
	}
	return look_at(station) <= now && look_at_drive(engine, station, now);
}

static bool somebody_must_stand(const struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		if (!standing_is_free(&engine->stations[i]->standing))
			return true;
	}
	return false;
}

bool stop_send_next(struct db_engine *engine, db_time now)
{
	if (exchange_may_begin_at(engine, true, now) > now || !somebody_must_stand(engine))
		return false;
	if (try_broadcast(engine, now))
		return true;
	for (unsigned urgent = 0; urgent < URGENCIES; urgent++) {
		for (size_t n = 0; n < engine->station_count; n++) {
			size_t i = (engine->next_stop + n) % engine->station_count;
			struct station *station = engine->stations[i];

			if (standing_is_free(&station->standing) || urgency(station) != urgent ||
			    is_flying(station->node) || stop_wake(engine, station, now) > now)
				continue;
			engine->next_stop = i + 1;
			if (serve(engine, station, now))
				return true;
		}
	}
	return false;
}

/* --- its effect ------------------------------------------------------------------------------------ */

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
		run_on(engine, station, now);
		break;
	case STANDING_UNSEEN:
		break;
	}
}

void stop_note_answered(struct db_engine *engine, struct station *station, enum db_result result,
                        db_time now)
{
	struct standing *standing = &station->standing;
	enum db_command command = station->lanes[LANE_STOP].job.request->command;
	const struct db_feedback *feedback = &station->snapshot.feedback;

	station->lanes[LANE_STOP].active = false;
	station->blind_stop_sent = false;
	/* Whether the power is off the driver has read by itself. */
	if (standing->sent_at != 0 && (command == DB_CMD_DISABLE || result != DB_RESULT_OK))
		station_finish_stops(station, command, result, now);
	standing_note_answered(standing, command, result == DB_RESULT_OK,
	                       engine->driver->acknowledges, now);
	/* What its own conversation has read was asked after the stop. */
	stop_judge(engine, station, feedback->taken, now);
}

void stop_note_lost(struct db_engine *engine, struct node *node, bool stop, db_time cost,
                    db_time now)
{
	for (struct station *s = node->first; s; s = s->next_axis) {
		if (standing_is_free(&s->standing) || s->standing.yields)
			continue;
		/* One that answers everything but stops is there: it is asked before it is taken for offline, and is seen
		 * to run on. */
		s->blind_stop_sent &= stop && node->online;
		if (standing_note_loss(&s->standing, node->online, engine->bus->retries, cost,
		                       now) &&
		    !node->online)
			engine->stops_from = now + cost * (STANDING_LOSSES_SHARE - 1);
	}
}

void stop_yield(struct station *station)
{
	standing_yield(&station->standing);
	station->lanes[LANE_STOP].active = station->lanes[LANE_STOP].ready = false;
}
