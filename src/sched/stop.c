/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/stop.h"

#include "sched/exchange.h"

/* How soon a stop that the drive turned down is said again. */
#define STOP_AGAIN (20 * DB_NS_PER_MS)

/* How long a drive may take to begin a motion that it was told just before the stop. */
#define DOUBT_TIME (100 * DB_NS_PER_MS)

/* As drivers are handed them: all that there is to a stop. */
static const struct db_request stop_requests[] = {
	[DB_CMD_STOP] = { .command = DB_CMD_STOP },
	[DB_CMD_QUICK_STOP] = { .command = DB_CMD_QUICK_STOP },
	[DB_CMD_DISABLE] = { .command = DB_CMD_DISABLE },
};

/* --- saying it ------------------------------------------------------------------------------------- */

static void send_stop(struct db_engine *engine, struct station *station, db_time now)
{
	const struct pending_stop *asked = station_unanswered_stop(station);
	struct lane *lane = &station->lanes[LANE_STOP];
	bool in_step = station->node->in_step;
	bool last_resort = station->braking.overdue &&
	                   station->config->on_stop_failure == DB_ON_STOP_FAILURE_DISABLE;
	enum db_command command;
	enum db_result result = DB_RESULT_FAILED;

	if (!in_step && station->blind_stop_sent) {
		exchange_send_probe(engine, station->node, now);
		return;
	}
	station->blind_stop_sent = !in_step;
	if (lane->active && lane->ready && in_step) {
		exchange_send(engine, station, LANE_STOP, now);
		return;
	}
	/* A drive that goes on is told to stop, or as a last resort, where that is configured, let go. */
	command = asked ? asked->command : last_resort ? DB_CMD_DISABLE : station->braking_command;
	if (exchange_begin_job(engine, station, LANE_STOP, DB_JOB_COMMAND, &stop_requests[command],
	                       now, &result) == DB_STEP_SEND)
		exchange_send(engine, station, LANE_STOP, now);
	else
		stop_note_answered(engine, station, result, now);
}

/* Does every drive of the bus wait for one and the same stop that was not sent to any of them yet? */
static bool all_want(const struct db_engine *engine, enum db_command command)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct pending_stop *stop = station_unanswered_stop(engine->stations[i]);

		if (!stop || stop->sent || stop->broadcast || stop->command != command)
			return false;
	}
	return true;
}

/* One frame stops everybody at once; each drive is then asked for its confirmation as usual. */
static bool try_broadcast(struct db_engine *engine, db_time now)
{
	uint8_t request[DB_SHORT_REQUEST];
	struct db_exchange exchange = { .request = request, .request_size = sizeof request };
	const struct pending_stop *first;
	enum db_command command;

	if (engine->station_count < 2 || !engine->driver->broadcast)
		return false;
	first = station_unanswered_stop(engine->stations[0]);
	command = first ? first->command : DB_CMD_NONE;
	if (!first || !all_want(engine, command) ||
	    !engine->driver->broadcast(command, engine->bus, &exchange))
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = engine->stations[i];

		for (unsigned j = 0; j < station->stop_count; j++)
			station->stops[j].broadcast = true;
		station_note_stop_sent(station, command, now);
	}
	exchange_note_broadcast(engine, &exchange, now);
	(void)engine_send(engine, request, exchange.request_length, DB_TRACE_BROADCAST);
	return true;
}

/* --- when ------------------------------------------------------------------------------------------ */

/* An offline drive's first; but one that answered its blind stop is only asked about it. */
static db_time asked_stop_at(const struct db_engine *engine, const struct station *station)
{
	bool silent = !station->node->online && !station->blind_stop_sent;

	return silent && station->stop_at < engine->stops_from ? engine->stops_from :
	                                                         station->stop_at;
}

/* A drive that is not there is told when it is back, should it then move. */
static db_time runaway_stop_at(const struct station *station)
{
	const struct braking *braking = &station->braking;

	return braking->active && !braking->slows && braking->looked && station->node->online ?
	               braking->again_at :
	               DB_TIME_NEVER;
}

static db_time stop_at(const struct db_engine *engine, const struct station *station)
{
	if (station_unanswered_stop(station))
		return asked_stop_at(engine, station);
	if (station->lanes[LANE_STOP].active)
		return station->stop_at;
	return runaway_stop_at(station);
}

/* When a drive that was told to stop is to be looked at, without waiting for the cycle. */
static db_time look_at(const struct station *station)
{
	const struct braking *braking = &station->braking;
	const struct lane *poll = &station->node->first->lanes[LANE_POLL];

	if (!braking->active || braking->slows || !station->node->online ||
	    !station->node->in_step || station->lanes[LANE_STOP].active)
		return DB_TIME_NEVER;
	/* One that has begun goes on at once. */
	return poll->active && poll->ready ? braking->begun : braking->look_at;
}

db_time stop_wake(const struct db_engine *engine, const struct station *station, db_time now)
{
	db_time stop = stop_at(engine, station);
	db_time look = look_at(station);

	/* A stop itself is never held back, only the question whether it was obeyed. */
	if (station->blind_stop_sent && node_waits_out_late_answers(station->node, now))
		return DB_TIME_NEVER;
	return look < stop ? look : stop;
}

/* Not counted in the round of polls: it comes on top of it. */
static bool look_at_drive(struct db_engine *engine, struct station *station, db_time now)
{
	struct station *first = station->node->first;
	struct lane *lane = &first->lanes[LANE_POLL];
	enum db_result result;

	station->braking.look_at = DB_TIME_NEVER;
	station->node->polled = now;
	if (!(lane->active && lane->ready) &&
	    exchange_begin_job(engine, first, LANE_POLL, DB_JOB_POLL, NULL, now, &result) !=
	            DB_STEP_SEND) {
		/* A drive that tells by itself what it does. */
		station->braking.looked = true;
		return false;
	}
	exchange_send(engine, first, LANE_POLL, now);
	return true;
}

bool stop_send_next(struct db_engine *engine, db_time now)
{
	if (exchange_may_begin_at(engine, true, now) > now)
		return false;
	if (try_broadcast(engine, now))
		return true;
	/* Those that are there come first. */
	for (size_t n = 0; n < 2 * engine->station_count; n++) {
		size_t i = (engine->next_stop + n) % engine->station_count;
		struct station *station = engine->stations[i];

		if (station->node->online != (n < engine->station_count) ||
		    is_flying(station->node) || stop_wake(engine, station, now) > now)
			continue;
		if (n >= engine->station_count)
			engine->next_stop = i + 1;
		if (stop_at(engine, station) <= now) {
			send_stop(engine, station, now);
			return true;
		}
		if (look_at_drive(engine, station, now))
			return true;
	}
	return false;
}

/* --- its effect ------------------------------------------------------------------------------------ */

/* The drive goes on: whoever asks is told, also who asks once more, and it is told on. */
static void tell_overdue(struct db_engine *engine, struct station *station, db_time now)
{
	if (!station->braking.overdue) {
		station->braking.overdue = true;
		station->braking.again_at = now;
		engine_publish(engine, station);
	}
	(void)station_finish_stops(station, STOP_ANY, DB_RESULT_RUNS_ON, now);
}

static void end_braking(struct db_engine *engine, struct station *station)
{
	bool overdue = station->braking.overdue;

	station->braking.active = false;
	station->braking.overdue = false;
	if (overdue)
		engine_publish(engine, station);
}

void stop_judge(struct db_engine *engine, struct station *station, db_time now)
{
	const struct db_feedback *feedback = &station->snapshot.feedback;
	bool doubtful = !engine->driver->acknowledges && (now - station->motion_sent < DOUBT_TIME ||
	                                                  (feedback->status & DB_STATUS_HOMING));
	db_time patience = (db_time)station->config->stop_reaction_ms * DB_NS_PER_MS;

	if (!station->braking.active || station->lanes[LANE_STOP].active)
		return;
	switch (braking_judge(&station->braking, feedback, patience, doubtful ? DOUBT_TIME : 0,
	                      now)) {
	case BRAKING_STANDS:
		end_braking(engine, station);
		(void)station_finish_stops(station, STOP_ANY, DB_RESULT_OK, now);
		break;
	case BRAKING_SLOWS:
		(void)station_finish_stops(station, STOP_ANY, DB_RESULT_OK, now);
		break;
	case BRAKING_FAILS:
		tell_overdue(engine, station, now);
		break;
	case BRAKING_UNSEEN:
		break;
	}
}

void stop_note_answered(struct db_engine *engine, struct station *station, enum db_result result,
                        db_time now)
{
	enum db_command command = station->lanes[LANE_STOP].job.request->command;
	bool moves = station->snapshot.feedback.status & DB_STATUS_MOVING;
	bool again = false;

	station->lanes[LANE_STOP].active = false;
	station->blind_stop_sent = false;
	station_note_stop_answered(station, command);
	/* Whether the power is off the driver has read by itself. */
	if (command == DB_CMD_DISABLE || result != DB_RESULT_OK)
		again = station_finish_stops(station, command, result, now);
	if (command != DB_CMD_DISABLE && (result == DB_RESULT_OK || moves)) {
		station->braking_command = command;
		if (!station->braking.active)
			braking_begin(&station->braking, &station->snapshot.feedback, now);
	}
	braking_said(&station->braking, now);
	stop_judge(engine, station, now);
	station->stop_at = now + (again ? STOP_AGAIN : 0);
}

void stop_forget(struct station *station)
{
	station->braking.active = station->braking.overdue = false;
	station->lanes[LANE_STOP].active = station->lanes[LANE_STOP].ready = false;
}
