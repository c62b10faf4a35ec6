/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include "codec/can.h"

#include <string.h>

struct station *engine_find_station(const struct db_engine *engine, uint16_t number)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		if (engine->stations[i]->number == number)
			return engine->stations[i];
	}
	return NULL;
}

struct node *engine_find_node(const struct db_engine *engine, unsigned address)
{
	for (size_t i = 0; i < engine->node_count; i++) {
		if (engine->nodes[i]->address == address)
			return engine->nodes[i];
	}
	return NULL;
}

/* --- stops and commands ----------------------------------------------------------------------- */

void engine_add_stop(struct db_engine *engine, struct station *station, enum db_command command,
                     enum db_stand_cause cause, struct db_request *request, db_time now)
{
	engine->drives_active = true;
	station_add_stop(station, command, cause, request, now);
	engine_publish(engine, station);
}

bool engine_has_active_drives(struct db_engine *engine)
{
	for (size_t i = 0; engine->drives_active && i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];
		const struct lane *command = &station->lanes[LANE_COMMAND];

		if (command->active || command->ready || station->lanes[LANE_STOP].active ||
		    station->blind_stop_sent || !standing_is_free(&station->standing))
			return true;
	}
	engine->drives_active = false;
	return false;
}

/* --- requests that wait ---------------------------------------------------------------------- */

void engine_finish_waiting_requests(struct db_engine *engine, const struct station *station,
                                    enum db_result result, db_time now)
{
	size_t kept = 0;

	for (size_t i = 0; i < engine->waiting_count; i++) {
		struct db_request *request = engine->waiting[i];

		if (request->drive == station->number)
			db_queue_finish(request, result, now);
		else
			engine->waiting[kept++] = request;
	}
	engine->waiting_count = kept;
}

/* Parameters of one job. */
struct written {
	uint64_t params[DB_PARAM_WORDS(DB_PARAMS_MAX)];
	size_t count;
};

static void add_written(struct written *written, const struct db_request *request)
{
	for (size_t i = 0; i < request->setting_count; i++)
		db_params_add(written->params, request->settings[i].param);
	written->count += request->setting_count;
}

/* True if the job has room for these, and none of them yet. */
static bool can_add_written(const struct written *written, const struct db_request *request)
{
	for (size_t i = 0; i < request->setting_count; i++) {
		if (db_params_have(written->params, request->settings[i].param))
			return false;
	}
	return written->count + request->setting_count <= DB_SETTINGS_MAX;
}

void engine_join_waiting_writes(struct db_engine *engine, struct station *station)
{
	struct written written = { .count = 0 };

	for (const struct db_write_part *part = db_queue_parts(station->request); part;
	     part = part->next)
		add_written(&written, part->request);
	for (size_t i = 0; i < engine->waiting_count;) {
		struct db_request *request = engine->waiting[i];

		if (request->drive != station->number) {
			i++;
			continue;
		}
		if (request->setting_count == 0 || !can_add_written(&written, request))
			return;
		add_written(&written, request);
		db_queue_join(station->request, request);
		engine->waiting_count--;
		memmove(&engine->waiting[i], &engine->waiting[i + 1],
		        (engine->waiting_count - i) * sizeof(engine->waiting[0]));
	}
}

/* --- drives coming and going ------------------------------------------------------------------ */

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
	node->free_probes = 0;
	engine_mark_for_reading(engine, node);
	node->timing = DB_TROUBLE_NONE;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_count_online(engine, s, now);
}

void engine_take_offline(struct db_engine *engine, struct node *node, enum db_result result,
                         db_time now)
{
	bool was_online = node->online;

	node->in_step = false;
	for (struct station *s = node->first; s; s = s->next_axis) {
		struct standing_rules rules;

		station_abandon_command(s, engine->driver,
		                        result == DB_RESULT_OFFLINE ? DB_RESULT_TIMEOUT : result,
		                        now);
		engine_finish_waiting_requests(engine, s, result, now);
		for (size_t i = 0; i < LANE_COUNT; i++)
			s->lanes[i].active = s->lanes[i].ready = false;
		s->blind_stop_sent = false;
		if (!was_online)
			continue;
		rules = station_rules(s, engine->driver, now);
		standing_suspend(&s->standing, &rules, now);
		engine->stats.online--;
		if (engine->driver->gone)
			engine->driver->gone(s->device);
	}
	node->online = false;
	engine_end_read(engine, node, now);
	if (!was_online)
		return;
	node->probe_at = now + node->probe_backoff;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_publish(engine, s);
}

void engine_mark_for_reading(struct db_engine *engine, struct node *node)
{
	engine->nodes_due += !node->poll_due;
	node->poll_due = true;
}

void engine_end_read(struct db_engine *engine, struct node *node, db_time now)
{
	uint32_t us;

	engine->nodes_due -= node->poll_due;
	node->poll_due = false;
	if (!node->unread)
		return;
	node->unread = false;
	if (--engine->unread > 0)
		return;
	us = db_time_us32(now - engine->round_started);
	engine->stats.cycle_us = us;
	if (us > engine->stats.cycle_max_us)
		engine->stats.cycle_max_us = us;
}

/* --- the wire --------------------------------------------------------------------------------- */

void engine_count_garbage(struct db_engine *engine, const uint8_t *bytes, size_t length,
                          db_time now)
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
