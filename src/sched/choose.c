/* SPDX-License-Identifier: Apache-2.0 */
/* What goes on the wire next. */
#include "sched/state.h"

#include <string.h>

/*
 * On CAN requests to several drives are under way at once. So much work, in time on the wire, is
 * given to the wire ahead: enough for it not to fall idle while this thread wakes up, and little
 * enough for a stop not to wait long behind it.
 */
#define AHEAD (1 * DB_NS_PER_MS)

/* --- sending --------------------------------------------------------------------------------------- */

bool engine_is_shared(const struct db_engine *engine)
{
	return engine->driver->medium == DB_MEDIUM_CAN;
}

db_time engine_may_send_at(const struct db_engine *engine, bool stop, db_time now)
{
	if (engine->held_since != 0)
		return DB_TIME_NEVER;
	if (now < engine->quiet_until)
		return engine->quiet_until;
	if (engine->flights == 0)
		return now;
	if (!engine_is_shared(engine))
		return DB_TIME_NEVER;
	return stop || engine->wire_free - AHEAD <= now ? now : engine->wire_free - AHEAD;
}

enum db_step engine_begin_job(struct db_engine *engine, struct station *station,
                              enum lane_kind kind, enum db_job_kind job,
                              const struct db_request *request, db_time now, enum db_result *result)
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

db_time engine_wire_time(const struct db_engine *engine, const struct db_exchange *exchange)
{
	return engine->bus->transport->wire_time(engine->bus, exchange->request,
	                                         exchange->request_length, exchange->answer_length);
}

/* Whoever asked for what goes out now is told when, for the skew of a group. */
static void note_sent(struct station *station, enum lane_kind kind, db_time now)
{
	const struct db_request *request = station->lanes[kind].job.request;

	if (kind == LANE_STOP)
		engine_note_stop_sent(station, request->command, now);
	if (kind != LANE_FRONT || !station->front_letter)
		return;
	/* Of a common start what comes before the frame that begins the motion is only preparation. */
	if (request->group == 0 || station->alone)
		db_letter_sent(station->front_letter, now);
	if (db_command_is_motion(request->command))
		station->motion_sent = now;
}

void engine_send_lane(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      db_time now)
{
	struct lane *lane = &station->lanes[kind];
	struct node *node = station->node;
	db_time wire = engine_wire_time(engine, &lane->exchange);

	lane->ready = false;
	lane->sent = true;
	lane->exchange.sending = ++engine->sendings;
	if (engine->flights == 0) {
		/* Whatever is still in the buffer was said before this question. */
		engine->stats.garbage_bytes += (uint32_t)engine->received_length;
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
	engine->front_was_last = kind == LANE_FRONT;
	note_sent(station, kind, now);
	if (kind == LANE_FRONT)
		engine_tell_raw(engine, station, true, lane->exchange.request,
		                lane->exchange.request_length);
	engine->ops->send(engine->context, lane->exchange.request, lane->exchange.request_length);
}

void engine_send_probe(struct db_engine *engine, struct node *node, db_time now)
{
	struct station *station = node->first;
	enum db_result result;

	node->ever_probed = true;
	if (engine_begin_job(engine, station, LANE_PROBE, DB_JOB_PROBE, NULL, now, &result) ==
	    DB_STEP_SEND)
		engine_send_lane(engine, station, LANE_PROBE, now);
}

/* Sends a prepared exchange, after getting back in step with the drive where that is needed. */
static void send_in_step(struct db_engine *engine, struct station *station, enum lane_kind kind,
                         db_time now)
{
	if (station->node->in_step)
		engine_send_lane(engine, station, kind, now);
	else
		engine_send_probe(engine, station->node, now);
}

/* --- commands -------------------------------------------------------------------------------------- */

static bool is_free(const struct station *station, db_time now)
{
	return !is_flying(station->node) && !node_is_haunted(station->node, now);
}

/* --- common starts --------------------------------------------------------------------------------- */

/* The letters of one start come one after the other; who has none after this will get none. */
#define GATHER_TIME (20 * DB_NS_PER_MS)

static uint32_t group_of(const struct station *station)
{
	const struct lane *lane = &station->lanes[LANE_FRONT];

	return lane->active && lane->job.kind == DB_JOB_COMMAND ? lane->job.request->group : 0;
}

/* Its next frame begins a motion, which may begin on all drives of the bus at once. */
static bool waits_for_others(const struct station *station)
{
	const struct lane *lane = &station->lanes[LANE_FRONT];

	return lane->ready && lane->exchange.begins && !station->alone && group_of(station) != 0;
}

static bool is_waiting(const struct db_engine *engine, const struct station *station,
                       uint32_t group)
{
	for (size_t i = 0; i < engine->waiting_count; i++) {
		const struct db_request *request = db_letter_request(engine->waiting[i]);

		if (request->group == group && request->drive == station->number)
			return true;
	}
	return false;
}

enum gathering {
	GATHERING_NOTHING, /* nobody waits for others */
	GATHERING_MORE,    /* some are still to come, which others need not wait for */
	GATHERING_ANSWERS, /* all are ready, as soon as what is under way is answered */
	GATHERING_ALL,
	GATHERING_NEVER, /* they will not all be ready */
};

/* Whether this drive can be one of the common start `group`, asked for at `asked`. */
static enum gathering readiness(const struct db_engine *engine, const struct station *station,
                                uint32_t group, db_time asked, db_time now)
{
	if (group_of(station) == group && waits_for_others(station)) {
		if (is_flying(station->node))
			return GATHERING_ANSWERS;
		return station->node->in_step && !station_awaits_stop(station) ? GATHERING_ALL :
		                                                                 GATHERING_NEVER;
	}
	/* On its way there, or its letter is. */
	if ((group_of(station) == group && !station->alone) || is_waiting(engine, station, group) ||
	    now - asked < GATHER_TIME)
		return GATHERING_MORE;
	return GATHERING_NEVER;
}

/* A frame for all drives reaches every one: so none may lack, nor be asked for something else. */
static enum gathering gather(const struct db_engine *engine, const struct station **first,
                             db_time now)
{
	enum gathering all = GATHERING_ALL;
	const struct db_request *request;

	*first = NULL;
	if (!engine->bus->starts_by_broadcast)
		return GATHERING_NOTHING;
	for (size_t i = 0; !*first && i < engine->station_count; i++) {
		if (waits_for_others(engine->stations[i]))
			*first = engine->stations[i];
	}
	if (!*first)
		return GATHERING_NOTHING;
	request = (*first)->lanes[LANE_FRONT].job.request;
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

/* Each begins by itself. */
static void part(struct db_engine *engine, uint32_t group)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		if (group_of(engine->stations[i]) == group)
			engine->stations[i]->alone = true;
	}
}

/* The one frame that says to all what is prepared for each. False: they are not to do the same. */
static bool write_common(const struct db_engine *engine, struct db_exchange *all)
{
	uint8_t bytes[DB_SHORT_REQUEST];
	struct db_exchange other = { .request = bytes, .request_size = sizeof bytes };

	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (!engine->driver->begin_all(station->device,
		                               &station->lanes[LANE_FRONT].exchange,
		                               i == 0 ? all : &other))
			return false;
		if (i > 0 && (other.request_length != all->request_length ||
		              memcmp(other.request, all->request, all->request_length) != 0))
			return false;
	}
	return true;
}

static void go_on_behind_common(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_FRONT];
	struct db_conversation talk = station_conversation(station, LANE_FRONT, now);

	lane->sent = true;
	lane->tries = 0;
	lane->exchange.begins = lane->exchange.again = false;
	db_letter_sent(station->front_letter, now);
	station->motion_sent = now;
	lane->ready = engine->driver->begun_by_all(&talk) == DB_STEP_SEND;
	if (!lane->ready)
		station_finish_front(station, talk.result, now);
}

/* All are ready, and nothing is under way. */
static bool begin_all(struct db_engine *engine, uint32_t group, db_time now)
{
	uint8_t bytes[DB_SHORT_REQUEST];
	struct db_exchange all = { .request = bytes, .request_size = sizeof bytes };

	if (!write_common(engine, &all)) {
		part(engine, group);
		return false;
	}
	engine->ops->send(engine->context, all.request, all.request_length);
	engine_after_broadcast(engine, &all, now);
	for (size_t i = 0; i < engine->station_count; i++)
		go_on_behind_common(engine, engine->stations[i], now);
	return true;
}

/* *wait: nothing else is to be sent now. True: something was. */
static bool try_common(struct db_engine *engine, bool *wait, db_time now)
{
	const struct station *first;
	enum gathering gathering = gather(engine, &first, now);

	*wait = gathering == GATHERING_ANSWERS;
	if (gathering == GATHERING_NEVER)
		part(engine, group_of(first));
	return gathering == GATHERING_ALL && begin_all(engine, group_of(first), now);
}

db_time engine_common_wake(const struct db_engine *engine, db_time now)
{
	const struct station *first;

	if (gather(engine, &first, now) != GATHERING_MORE)
		return DB_TIME_NEVER;
	if (now - first->lanes[LANE_FRONT].job.request->submitted >= GATHER_TIME)
		return DB_TIME_NEVER;
	return first->lanes[LANE_FRONT].job.request->submitted + GATHER_TIME;
}

/* --- commands, one by one -------------------------------------------------------------------------- */

/* False when it ended without anything being sent. */
static bool begin_letter(struct db_engine *engine, size_t index, db_time now)
{
	struct db_letter *letter = engine->waiting[index];
	const struct db_request *request = db_letter_request(letter);
	struct station *station = engine_station(engine, request->drive);
	enum db_job_kind kind = request->setting_count > 0 ? DB_JOB_SETTINGS : DB_JOB_COMMAND;
	enum db_result result = DB_RESULT_FAILED;

	engine->waiting_count--;
	memmove(&engine->waiting[index], &engine->waiting[index + 1],
	        (engine->waiting_count - index) * sizeof engine->waiting[0]);
	station->front_letter = letter;
	station->lanes[LANE_FRONT].exchange.request = db_letter_bytes(letter);
	station->lanes[LANE_FRONT].exchange.request_size = DB_REQUEST_MAX;
	station->front_cancelled = false;
	station->alone = !engine->bus->starts_by_broadcast;
	if (db_command_ends_motion(request->command))
		engine_forget_stop(station);
	if (engine_begin_job(engine, station, LANE_FRONT, kind, request, now, &result) ==
	    DB_STEP_SEND) {
		if (!waits_for_others(station))
			send_in_step(engine, station, LANE_FRONT, now);
		return is_flying(station->node);
	}
	station->lanes[LANE_FRONT].active = true;
	station_finish_front(station, result, now);
	return false;
}

/* `again`: one that asks once more for what it has asked before, or one that does not. */
static bool continue_front(struct db_engine *engine, bool again, db_time now)
{
	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_front + n) % engine->station_count;
		struct station *station = engine->stations[i];

		if (station->lanes[LANE_FRONT].ready &&
		    station->lanes[LANE_FRONT].exchange.again == again &&
		    !waits_for_others(station) && !station_awaits_stop(station) &&
		    is_free(station, now)) {
			engine->next_front = i + 1;
			if (again)
				engine->again_sent = now;
			send_in_step(engine, station, LANE_FRONT, now);
			return true;
		}
	}
	return false;
}

static bool begin_front(struct db_engine *engine, db_time now)
{
	for (size_t i = 0; i < engine->waiting_count;) {
		const struct db_request *request = db_letter_request(engine->waiting[i]);
		const struct station *station = engine_station(engine, request->drive);
		size_t before = engine->waiting_count;

		/* A command given after a stop waits until the stop is confirmed. */
		if (station->lanes[LANE_FRONT].active || station_awaits_stop(station) ||
		    !is_free(station, now))
			i++;
		else if (begin_letter(engine, i, now))
			return true;
		else if (engine->waiting_count == before)
			i++;
	}
	return false;
}

/* They take turns: a command of many exchanges does not hold up other drives' commands. */
static bool try_fronts(struct db_engine *engine, db_time now)
{
	if (engine->continued && begin_front(engine, now)) {
		engine->continued = false;
		return true;
	}
	engine->continued = continue_front(engine, false, now);
	return engine->continued || begin_front(engine, now);
}

/* --- cyclic status --------------------------------------------------------------------------------- */

static struct node *due_poll(struct db_engine *engine, db_time now)
{
	for (size_t n = 0; n < engine->node_count; n++) {
		size_t i = (engine->next_poll + n) % engine->node_count;
		struct node *node = engine->nodes[i];

		if (node->online && node->poll_due && is_free(node->first, now)) {
			engine->next_poll = i;
			return node;
		}
	}
	return NULL;
}

static void send_poll(struct db_engine *engine, struct node *node, db_time now)
{
	struct station *station = node->first;
	struct lane *lane = &station->lanes[LANE_POLL];
	enum db_result result;

	if (!node->in_step) {
		engine_send_probe(engine, node, now);
		return;
	}
	node->polled = now;
	if (lane->active && lane->ready)
		engine_send_lane(engine, station, LANE_POLL, now);
	else if (engine_begin_job(engine, station, LANE_POLL, DB_JOB_POLL, NULL, now, &result) ==
	         DB_STEP_SEND)
		engine_send_lane(engine, station, LANE_POLL, now);
	else
		node->poll_due = false;
	engine->next_poll++;
	engine->polls_in_a_row++;
}

/* --- below cyclic status ------------------------------------------------------------------------------ */

/*
 * A stop waits for the exchange on the wire, and the text of all parameters may take 0.3 s. While a
 * drive moves nothing is read that takes longer than this on the wire, and longer than two commands;
 * unless drives move for ever: then one such exchange goes out in each DUMP_PAUSE.
 */
#define DUMP_SHORT (20 * DB_NS_PER_MS)
#define DUMP_PAUSE (5 * DB_NS_PER_S)
/* One that is held up is tried in every cycle: what was not for so long is over. */
#define DUMP_FORGOTTEN (1 * DB_NS_PER_S)

static bool is_dump(const struct db_engine *engine, const struct db_exchange *exchange)
{
	db_time wire = engine_wire_time(engine, exchange);

	return wire > DUMP_SHORT && wire > 2 * engine->driver->command_time(engine->bus);
}

static bool any_moves(const struct db_engine *engine)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (station->node->online && (station->snapshot.feedback.status & DB_STATUS_MOVING))
			return true;
	}
	return false;
}

/* The exchange is prepared. The pause counts from where motion began to hold dumps up. */
static bool may_send_now(struct db_engine *engine, const struct db_exchange *exchange, db_time now)
{
	if (!is_dump(engine, exchange))
		return true;
	if (!any_moves(engine))
		return true;
	if (engine->dump_tried == 0 || now - engine->dump_tried > DUMP_FORGOTTEN)
		engine->dumps_held_since = now;
	engine->dump_tried = now;
	if (now - engine->dumps_held_since < DUMP_PAUSE)
		return false;
	engine->dumps_held_since = now;
	return true;
}

static bool wants_identify(const struct db_engine *engine, const struct station *station,
                           db_time now)
{
	if (!station->node->online || station->identify_at > now || !is_free(station, now))
		return false;
	return station->lanes[LANE_IDENTIFY].active ||
	       !(station->snapshot.feedback.status & DB_STATUS_PARAMS_VALID) ||
	       engine->driver->nameplate(station->device)->doubtful;
}

static bool try_identify(struct db_engine *engine, db_time now)
{
	enum db_result result;

	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_identify + n) % engine->station_count;
		struct station *station = engine->stations[i];
		struct lane *lane = &station->lanes[LANE_IDENTIFY];

		if (!wants_identify(engine, station, now))
			continue;
		engine->next_identify = i + (lane->active ? 0 : 1);
		if (!lane->active &&
		    engine_begin_job(engine, station, LANE_IDENTIFY, DB_JOB_IDENTIFY, NULL, now,
		                     &result) != DB_STEP_SEND)
			continue;
		if (station->node->in_step && !may_send_now(engine, &lane->exchange, now))
			continue;
		send_in_step(engine, station, LANE_IDENTIFY, now);
		return true;
	}
	return false;
}

static bool try_probes(struct db_engine *engine, db_time now)
{
	for (size_t n = 0; n < engine->node_count; n++) {
		size_t i = (engine->next_probe + n) % engine->node_count;
		struct node *node = engine->nodes[i];

		if (node->online || node->probe_at > now || !is_free(node->first, now))
			continue;
		/* The first round after the port opened is free: nothing is known of any drive. */
		if (node->ever_probed && engine->probes_from > now)
			continue;
		engine->next_probe = i + 1;
		engine_send_probe(engine, node, now);
		return true;
	}
	return false;
}

static bool try_background(struct db_engine *engine, db_time now)
{
	engine->polls_in_a_row = 0;
	return try_identify(engine, now) || try_probes(engine, now);
}

/*
 * Commands go before status, but cannot starve it: when a drive's status is two cycles old, they
 * take turns. What only asks again goes behind status, but once in two cycles before it. Likewise status cannot
 * starve what comes after it: once in a round of polls one exchange of those classes is let through.
 */
bool engine_send_something(struct db_engine *engine, db_time now)
{
	struct node *poll;
	bool wait;

	if (engine_send_stop(engine, now))
		return true;
	if (engine->shutting_down || engine_may_send_at(engine, false, now) > now)
		return false;
	if (try_common(engine, &wait, now))
		return true;
	if (wait)
		return false;
	poll = due_poll(engine, now);
	if (poll && engine->front_was_last && now - poll->polled > 2 * engine->period) {
		send_poll(engine, poll, now);
		return true;
	}
	if (try_fronts(engine, now))
		return true;
	if ((!poll || now - engine->again_sent > 2 * engine->period) &&
	    continue_front(engine, true, now))
		return true;
	if (poll && engine->polls_in_a_row > engine->node_count && try_background(engine, now))
		return true;
	if (poll) {
		send_poll(engine, poll, now);
		return true;
	}
	return try_background(engine, now);
}
