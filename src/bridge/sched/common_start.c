/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include <string.h>

/* The requests of one start arrive one after the other; a drive without one after this time will
 * get none. */
#define GATHER_TIME (20 * DB_NS_PER_MS)

static uint32_t group_of(const struct station *station)
{
	const struct lane *lane = &station->lanes[LANE_COMMAND];

	return lane->active && lane->job.kind == DB_JOB_COMMAND ? lane->job.request->group : 0;
}

bool common_start_holds(const struct station *station)
{
	const struct lane *lane = &station->lanes[LANE_COMMAND];

	return lane->ready && lane->exchange.begins && !station->starts_alone &&
	       group_of(station) != 0;
}

enum gathering {
	GATHERING_NOTHING, /* no drive waits for others */
	GATHERING_MORE,    /* some are still missing, but the ready ones need not wait for them */
	GATHERING_ANSWERS, /* all are ready as soon as current exchanges are answered */
	GATHERING_ALL,
	GATHERING_NEVER, /* they will never all be ready */
};

/* Whether this drive can take part in the common start `group`, requested at `asked`. */
static enum gathering readiness(const struct db_engine *engine, const struct station *station,
                                uint32_t group, db_time asked, db_time now)
{
	if (group_of(station) == group && common_start_holds(station)) {
		if (is_flying(station->node))
			return GATHERING_ANSWERS;
		return station->node->in_step && !station_awaits_stop(station) ? GATHERING_ALL :
		                                                                 GATHERING_NEVER;
	}
	if ((group_of(station) == group && !station->starts_alone) || now - asked < GATHER_TIME)
		return GATHERING_MORE;
	for (size_t i = 0; i < engine->waiting_count; i++) {
		const struct db_request *request = engine->waiting[i];

		if (request->group == group && request->drive == station->number)
			return GATHERING_MORE;
	}
	return GATHERING_NEVER;
}

/* A frame to all drives reaches every one: so none may be missing, nor have another request. */
static enum gathering gather(const struct db_engine *engine, const struct station **first,
                             db_time now)
{
	enum gathering all = GATHERING_ALL;
	const struct db_request *request;

	*first = NULL;
	for (size_t i = 0; !*first && i < engine->station_count; i++) {
		if (common_start_holds(engine->stations[i]))
			*first = engine->stations[i];
	}
	if (!*first)
		return GATHERING_NOTHING;
	request = (*first)->lanes[LANE_COMMAND].job.request;
	if (engine->station_count < 2 || !engine->driver->begin_all)
		return GATHERING_NEVER;
	for (size_t i = 0; i < engine->station_count; i++) {
		enum gathering one = readiness(engine, engine->stations[i], request->group,
		                               request->submitted, now);

		if (one == GATHERING_NEVER)
			return one;
		if (one < all)
			all = one;
	}
	return all;
}

/* Each drive begins separately. */
static void begin_one_by_one(struct db_engine *engine, uint32_t group)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		if (group_of(engine->stations[i]) == group)
			engine->stations[i]->starts_alone = true;
	}
}

/* Writes the one frame that tells all drives what is prepared for each. False: they are not to do
 * the same. */
static bool write_common(const struct db_engine *engine, struct db_exchange *all)
{
	uint8_t bytes[DB_SHORT_REQUEST];
	struct db_exchange other = { .request = bytes, .request_size = sizeof(bytes) };

	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (!engine->driver->begin_all(station->device,
		                               &station->lanes[LANE_COMMAND].exchange,
		                               i == 0 ? all : &other))
			return false;
		if (i > 0 && (other.request_length != all->request_length ||
		              memcmp(other.request, all->request, all->request_length) != 0))
			return false;
	}
	return true;
}

/* All are ready, and nothing is under way. */
static bool begin_all(struct db_engine *engine, uint32_t group, db_time now)
{
	uint8_t bytes[DB_SHORT_REQUEST];
	struct db_exchange all = { .request = bytes, .request_size = sizeof(bytes) };

	if (!write_common(engine, &all)) {
		begin_one_by_one(engine, group);
		return false;
	}
	(void)engine_send(engine, all.request, all.request_length, DB_TRACE_BROADCAST);
	exchange_count_unanswered(engine, &all, true, now);
	for (size_t i = 0; i < engine->station_count; i++) {
		struct lane *lane = &engine->stations[i]->lanes[LANE_COMMAND];
		struct db_conversation talk = station_conversation(engine->stations[i],
		                                                   LANE_COMMAND, now);

		lane->sent = true;
		lane->tries = 0;
		lane->exchange.begins = lane->exchange.again = false;
		db_queue_note_sent(engine->stations[i]->request, now);
		engine->stations[i]->motion_sent = now;
		lane->ready = engine->driver->begun_by_all(&talk) == DB_STEP_SEND;
		if (!lane->ready)
			station_finish_command(engine->stations[i], talk.result, now);
	}
	return true;
}

bool common_start_try(struct db_engine *engine, bool *wait, db_time now)
{
	const struct station *first;
	enum gathering gathering = gather(engine, &first, now);

	*wait = gathering == GATHERING_ANSWERS;
	if (gathering == GATHERING_NEVER)
		begin_one_by_one(engine, group_of(first));
	/* No drive acknowledges it: each must be sure to receive. */
	if (gathering == GATHERING_ALL && gaps_over_at(engine, NULL, now) > now) {
		exchange_reserve(engine, NULL, LANE_COMMAND, gaps_over_at(engine, NULL, now), now);
		return true;
	}
	return gathering == GATHERING_ALL && begin_all(engine, group_of(first), now);
}

db_time common_start_run_at(const struct db_engine *engine, db_time now)
{
	const struct station *first;

	if (gather(engine, &first, now) != GATHERING_MORE)
		return DB_TIME_NEVER;
	if (now - first->lanes[LANE_COMMAND].job.request->submitted >= GATHER_TIME)
		return DB_TIME_NEVER;
	return first->lanes[LANE_COMMAND].job.request->submitted + GATHER_TIME;
}
