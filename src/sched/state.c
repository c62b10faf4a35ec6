/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/state.h"

#include "codec/can.h"

struct station *engine_find_station(const struct db_engine *engine, uint16_t number)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		if (engine->stations[i]->number == number)
			return engine->stations[i];
	}
	return NULL;
}

const struct station *engine_find_moving(const struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (station->node->online && (station->snapshot.feedback.status & DB_STATUS_MOVING))
			return station;
	}
	return NULL;
}

/* --- what is told of drives ----------------------------------------------------------------------- */

void engine_tell_event(struct db_engine *engine, const struct station *station, enum db_event event)
{
	if (engine->ops->tell)
		engine->ops->tell(engine->context, station->config, event,
		                  &station->snapshot.feedback);
}

void engine_tell_timing(struct db_engine *engine, struct station *station, enum db_event event,
                        db_time time)
{
	/* While it cannot come online because of that, it is no news that it does not answer in time. */
	if (event == DB_EVENT_DRIVE_LATE && !station->last_logged.online)
		station->last_logged.missing = true;
	if (engine->ops->tell_timing)
		engine->ops->tell_timing(engine->context, station->config, event, time);
}

void engine_tell_missing(struct db_engine *engine, struct station *station)
{
	if (station->last_logged.missing)
		return;
	station->last_logged.missing = true;
	engine_tell_event(engine, station, DB_EVENT_DRIVE_LOST);
	if (station->node->heard.count > 0 && engine->ops->tell_heard)
		engine->ops->tell_heard(engine->context, station->config, &station->node->heard);
}

void engine_tell_raw(struct db_engine *engine, const struct station *station, bool sent,
                     const uint8_t *bytes, size_t length)
{
	const struct lane *lane = &station->lanes[LANE_COMMAND];

	if (station->queued && lane->job.kind == DB_JOB_COMMAND &&
	    lane->job.request->command == DB_CMD_RAW_FRAME && engine->ops->tell_raw)
		engine->ops->tell_raw(engine->context, station->config, sent, bytes, length);
}

void engine_tell_unconfirmed(struct db_engine *engine, const struct station *station)
{
	/* One that was never heard was not set going from here. */
	if (station->snapshot.feedback.taken == 0)
		return;
	if (station->standing.cause == DB_STAND_EXIT && standing_is_open(&station->standing))
		engine_tell_event(engine, station, DB_EVENT_DRIVE_UNCONFIRMED);
}

static void tell_presence(struct db_engine *engine, struct station *station, bool online)
{
	station->last_logged.online = online;
	station->last_logged.error = DB_ERROR_NONE;
	station->last_logged.missing_params = 0;
	if (online) {
		station->last_logged.missing = false;
		engine_tell_event(engine, station, DB_EVENT_DRIVE_ONLINE);
	} else if (engine->stats.up) {
		/* Without a bus no drive answers: that was told of the bus. */
		engine_tell_missing(engine, station);
	}
}

/* Bits that were not set when the drive was last spoken of. */
static bool status_rose(const struct station *station, uint32_t bit)
{
	return station->snapshot.feedback.status & ~station->last_logged.status & bit;
}

static void tell_changes(struct db_engine *engine, struct station *station)
{
	const struct db_feedback *feedback = &station->snapshot.feedback;
	bool online = feedback->status & DB_STATUS_ONLINE;

	if (online != station->last_logged.online)
		tell_presence(engine, station, online);
	if (!online)
		return;
	if (feedback->error != station->last_logged.error)
		engine_tell_event(engine, station,
		                  feedback->error == DB_ERROR_RUNS_ON ? DB_EVENT_DRIVE_RUNS_ON :
		                  feedback->error != DB_ERROR_NONE    ? DB_EVENT_DRIVE_FAULT :
		                                                        DB_EVENT_DRIVE_FAULT_GONE);
	if (status_rose(station, DB_STATUS_WARNING) && feedback->error == DB_ERROR_NONE)
		engine_tell_event(engine, station, DB_EVENT_DRIVE_WARNING);
	if (feedback->restarts != station->last_logged.restarts)
		engine_tell_event(engine, station, DB_EVENT_DRIVE_RESTARTED);
	else if (feedback->doubts != station->last_logged.doubts)
		engine_tell_event(engine, station, DB_EVENT_DRIVE_MAY_HAVE_RESTARTED);
	station->last_logged.restarts = feedback->restarts;
	station->last_logged.doubts = feedback->doubts;
	station->last_logged.error = feedback->error;
	station->last_logged.status = feedback->status;
}

void engine_publish(struct db_engine *engine, struct station *station)
{
	uint64_t missing = engine->driver->nameplate(station->device)->missing;
	const struct bus_moment bus = {
		.up = engine->stats.up,
		.aside = engine->stats.aside,
		.wall_offset_us = engine->wall_offset_us,
		.now = engine->now,
	};

	station_publish(station, engine->driver, &bus);
	tell_changes(engine, station);
	/* One after the other is found missing: they are told together when all were asked for. */
	if (!(station->snapshot.feedback.status & DB_STATUS_PARAMS_VALID))
		return;
	if ((missing & ~station->last_logged.missing_params) && engine->ops->tell_missing)
		engine->ops->tell_missing(engine->context, station->config, missing);
	station->last_logged.missing_params = missing;
}

/* --- drives coming and going ---------------------------------------------------------------------- */

void engine_finish_waiting(struct db_engine *engine, const struct station *station,
                           enum db_result result, db_time now)
{
	size_t kept = 0;

	for (size_t i = 0; i < engine->waiting_count; i++) {
		struct db_queued *queued = engine->waiting[i];

		if (db_queued_drive(queued) == station->number)
			db_queued_finish(queued, result, now);
		else
			engine->waiting[kept++] = queued;
	}
	engine->waiting_count = kept;
}

void engine_count_online(struct db_engine *engine, struct station *station, db_time now)
{
	standing_resume(&station->standing, now);
	station->identify_at = 0;
	station->identify_backoff = IDENTIFY_BACKOFF_MIN;
	station->snapshot.stats.came_online++;
	engine->stats.online++;
}

void engine_bring_online(struct db_engine *engine, struct node *node, db_time now)
{
	node->in_step = true;
	node->losses = 0;
	node->probe_backoff = PROBE_BACKOFF_MIN;
	if (node->online)
		return;
	node->online = true;
	node->poll_due = true;
	node->heard.count = 0;
	node->timing = DB_TROUBLE_NONE;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_count_online(engine, s, now);
}

static void lose_station(struct db_engine *engine, struct station *station, enum db_result result,
                         db_time now)
{
	struct standing_rules rules;

	station_abandon_command(station, engine->driver,
	                        result == DB_RESULT_OFFLINE ? DB_RESULT_TIMEOUT : result, now);
	engine_finish_waiting(engine, station, result, now);
	for (size_t i = 0; i < LANE_COUNT; i++)
		station->lanes[i].active = station->lanes[i].ready = false;
	station->blind_stop_sent = false;
	if (!station->node->online)
		return;
	rules = station_rules(station, engine->driver, now);
	standing_suspend(&station->standing, &rules, now);
	engine->stats.online--;
	engine->driver->gone(station->device);
}

void engine_take_offline(struct db_engine *engine, struct node *node, enum db_result result,
                         db_time now)
{
	bool was_online = node->online;

	node->in_step = false;
	for (struct station *s = node->first; s; s = s->next_axis)
		lose_station(engine, s, result, now);
	node->online = false;
	node->poll_due = false;
	if (!was_online)
		return;
	node->probe_at = now + node->probe_backoff;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_publish(engine, s);
}

void engine_end_cycle(struct db_engine *engine, db_time now)
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

/* --- the wire --------------------------------------------------------------------------------------- */

void engine_take_garbage(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now)
{
	engine->stats.garbage_bytes += (uint32_t)length;
	db_trace_write(engine->trace, now, DB_TRACE_GARBAGE, 0, bytes, length);
}

uint32_t engine_send(struct db_engine *engine, const uint8_t *bytes, size_t length,
                     enum db_trace_kind why)
{
	db_time sent = engine->ops->send(engine->context, bytes, length);
	size_t frame = engine->driver->medium == DB_MEDIUM_CAN ? sizeof(struct db_can_frame) :
	                                                         length;
	uint32_t number = 0;

	for (size_t at = 0; at < length; at += frame)
		number = db_trace_write(engine->trace, sent, why, 0, bytes + at, frame);
	return number;
}
