/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include <string.h>

void engine_report_event(struct db_engine *engine, const struct station *station,
                         enum db_event event)
{
	if (engine->ops->on_event)
		engine->ops->on_event(engine->context, station->config, event,
		                      &station->snapshot.feedback, NULL);
}

void engine_report_timing(struct db_engine *engine, struct station *station,
                          const struct db_engine_timing *timing)
{
	/* While it cannot come online because of that, its late answers are no news. */
	if (timing->event == DB_EVENT_DRIVE_LATE && !station->last_logged.online)
		station->last_logged.missing = true;
	if (engine->ops->on_timing)
		engine->ops->on_timing(engine->context, station->config, timing);
}

void engine_report_missing(struct db_engine *engine, struct station *station)
{
	if (station->last_logged.missing)
		return;
	station->last_logged.missing = true;
	/* What is received from there says more. */
	if (station->node->unusable.count == 0)
		engine_report_event(engine, station, DB_EVENT_DRIVE_LOST);
	engine_report_unusable(engine, station);
}

void engine_report_unusable(struct db_engine *engine, struct station *station)
{
	if (station->last_logged.unusable || station->node->unusable.count == 0)
		return;
	station->last_logged.unusable = true;
	if (engine->ops->on_unusable)
		engine->ops->on_unusable(engine->context, station->config,
		                         &station->node->unusable);
}

void engine_report_raw_frame(struct db_engine *engine, const struct station *station, bool sent,
                             const uint8_t *bytes, size_t length)
{
	const struct lane *lane = &station->lanes[LANE_COMMAND];

	if (station->request && lane->job.kind == DB_JOB_COMMAND &&
	    lane->job.request->command == DB_CMD_RAW_FRAME && engine->ops->on_raw_frame)
		engine->ops->on_raw_frame(engine->context, station->config, sent, bytes, length);
}

void engine_report_unconfirmed(struct db_engine *engine, const struct station *station)
{
	/* Never received from: we cannot have started it. */
	if (station->snapshot.feedback.taken == 0)
		return;
	if (station->standing.cause == DB_STAND_EXIT && standing_is_open(&station->standing))
		engine_report_event(engine, station, DB_EVENT_DRIVE_UNCONFIRMED);
}

static void report_presence(struct db_engine *engine, struct station *station, bool online)
{
	const struct db_outage outage = {
		.cause = (enum db_trouble_cause)station->last_logged.silence,
		.time = engine->now - station->last_logged.silent,
	};
	bool was_online = station->last_logged.silent != 0;

	station->last_logged.online = online;
	station->last_logged.error = DB_ERROR_NONE;
	memset(station->missing, 0,
	       DB_PARAM_WORDS(engine->driver->param_count) * sizeof(station->missing[0]));
	if (!online)
		station->last_logged.silent = station->snapshot.feedback.taken;
	if (online) {
		station->last_logged.missing = station->last_logged.unusable = false;
		if (engine->ops->on_event)
			engine->ops->on_event(engine->context, station->config,
			                      DB_EVENT_DRIVE_ONLINE, &station->snapshot.feedback,
			                      was_online ? &outage : NULL);
	} else if (engine->stats.up) {
		/* Without a bus no drive answers: that was reported for the bus. */
		engine_report_missing(engine, station);
	}
}

static void report_changes(struct db_engine *engine, struct station *station)
{
	const struct db_feedback *feedback = &station->snapshot.feedback;
	bool online = feedback->status & DB_STATUS_ONLINE;

	if (online != station->last_logged.online)
		report_presence(engine, station, online);
	if (!online) {
		station->last_logged.silence = station->snapshot.trouble.cause;
		return;
	}
	if (feedback->error != station->last_logged.error) {
		enum db_event event = DB_EVENT_DRIVE_FAULT;

		if (feedback->error == DB_ERROR_NONE)
			event = DB_EVENT_DRIVE_FAULT_GONE;
		else if (feedback->error == DB_ERROR_RUNS_ON)
			event = DB_EVENT_DRIVE_RUNS_ON;
		engine_report_event(engine, station, event);
	}
	if ((feedback->status & ~station->last_logged.status & DB_STATUS_WARNING) &&
	    feedback->error == DB_ERROR_NONE)
		engine_report_event(engine, station, DB_EVENT_DRIVE_WARNING);
	if (feedback->restarts != station->last_logged.restarts)
		engine_report_event(engine, station, DB_EVENT_DRIVE_RESTARTED);
	else if (feedback->doubts != station->last_logged.doubts)
		engine_report_event(engine, station, DB_EVENT_DRIVE_MAY_HAVE_RESTARTED);
	station->last_logged.restarts = feedback->restarts;
	station->last_logged.doubts = feedback->doubts;
	station->last_logged.error = feedback->error;
	station->last_logged.status = feedback->status;
}

void engine_publish(struct db_engine *engine, struct station *station)
{
	const struct bus_state bus = {
		.up = engine->stats.up,
		.aside = engine->stats.aside,
		.wall_offset_us = engine->wall_offset_us,
		.interval = station->node->interval,
		.now = engine->now,
	};
	const struct db_driver *driver = engine->driver;
	const uint64_t *missing;
	bool more = false;

	station_publish(station, engine->driver, &bus);
	report_changes(engine, station);
	/* Parameters are found missing one after the other: they are reported together after all
	 * were requested. */
	if (driver->param_count == 0 ||
	    !(station->snapshot.feedback.status & DB_STATUS_PARAMS_VALID))
		return;
	missing = driver->nameplate(station->device)->missing;
	for (size_t i = 0; i < DB_PARAM_WORDS(driver->param_count); i++) {
		more = more || (missing[i] & ~station->missing[i]) != 0;
		station->missing[i] = missing[i];
	}
	if (more && engine->ops->on_missing_params)
		engine->ops->on_missing_params(engine->context, station->config, missing);
}
