/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include "sched/scan.h"

#include <stdint.h>
#include <string.h>

/* --- commands --------------------------------------------------------------------------------- */

static inline bool is_free(const struct db_engine *engine, const struct station *station,
                           db_time now)
{
	const struct node *node = station->node;

	if (is_flying(node) || node_may_be_asked_at(node) > now)
		return false;
	return (!engine->scan || !scan_is_asking(engine, node)) &&
	       (node->in_step || !node_waits_out_late_answers(node, now));
}

/*
 * The prepared exchange must not be sent now, because a stop would wait for it: a parameter write
 * is sent in short lines and without its proof; anything else is refused at once, so that the
 * drive's next command does not wait for it. False: send it.
 */
static bool refuse_long(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_COMMAND];
	struct db_conversation talk = station_conversation(station, LANE_COMMAND, now);
	enum db_result result = DB_RESULT_LINE_MOVES;

	if (!station->node->in_step || !exchange_is_too_long(engine, &lane->exchange))
		return false;
	if (lane->job.kind == DB_JOB_SETTINGS && !lane->exchange.proof) {
		/* It begins again, in short lines: what was sent before may be sent again. */
		bool sent = lane->sent;
		enum db_step step = exchange_begin_job(engine, station, LANE_COMMAND,
		                                       DB_JOB_SETTINGS, lane->job.request, now,
		                                       &result);

		lane->sent = sent;
		if (step == DB_STEP_SEND)
			return false;
	} else if (lane->exchange.proof || lane->tries > 0) {
		/* It was sent; the driver knows best what became of it. */
		if (engine->driver->lost(&talk) == DB_STEP_SEND) {
			lane->tries = 0;
			return exchange_is_too_long(engine, &lane->exchange);
		}
		result = talk.result;
	}
	lane->active = true;
	station_finish_command(station, result, now);
	engine_publish(engine, station);
	return true;
}

/* False when it ended without anything being sent. */
static bool begin_queued(struct db_engine *engine, size_t index, db_time now)
{
	struct db_request *request = engine->waiting[index];
	struct station *station = engine_find_station(engine, request->drive);
	enum db_job_kind kind = request->setting_count > 0 ? DB_JOB_SETTINGS : DB_JOB_COMMAND;
	enum db_result result = DB_RESULT_FAILED;

	engine->waiting_count--;
	memmove(&engine->waiting[index], &engine->waiting[index + 1],
	        (engine->waiting_count - index) * sizeof(engine->waiting[0]));
	station->request = request;
	station->lanes[LANE_COMMAND].exchange.request = db_queue_bytes(request);
	station->lanes[LANE_COMMAND].exchange.request_size = DB_REQUEST_MAX;
	station->command_cancelled = false;
	station->starts_alone = !engine->bus->starts_by_broadcast;
	if (standing_gives_way_to(&station->standing, request->command)) {
		/* A later motion or enable begins: no stop is sent until it has ended. */
		station->standing.gives_way = true;
		station->lanes[LANE_STOP].active = station->lanes[LANE_STOP].ready = false;
	}
	if (kind == DB_JOB_SETTINGS && engine->driver->joins_settings)
		engine_join_waiting_writes(engine, station);
	if (exchange_begin_job(engine, station, LANE_COMMAND, kind, request, now, &result) ==
	    DB_STEP_SEND) {
		if (!common_start_holds(station) && !refuse_long(engine, station, now))
			exchange_send_in_step(engine, station, LANE_COMMAND, now);
		return is_flying(station->node) ||
		       (engine->reserved.until != 0 && engine->reserved.station == station);
	}
	station->lanes[LANE_COMMAND].active = true;
	station_finish_command(station, result, now);
	return false;
}

#define NO_DRIVE SIZE_MAX

/* The first drive whose command continues, and *again: the first whose command only repeats a
 * question; or NO_DRIVE. */
static size_t find_continued(struct db_engine *engine, size_t *again, db_time now)
{
	*again = NO_DRIVE;
	for (size_t n = 0, i = engine->next_command;
	     engine->drives_active && n < engine->station_count; n++, i++) {
		struct station *station;

		i = i < engine->station_count ? i : 0;
		station = engine->stations[i];
		if (!station->lanes[LANE_COMMAND].ready || common_start_holds(station) ||
		    station_awaits_stop(station) || !is_free(engine, station, now) ||
		    refuse_long(engine, station, now))
			continue;
		if (!station->lanes[LANE_COMMAND].exchange.again)
			return i;
		if (*again == NO_DRIVE ||
		    station->again_sent < engine->stations[*again]->again_sent)
			*again = i;
	}
	return NO_DRIVE;
}

/* The first request in the queue, from `from` on, that can begin, or NO_DRIVE. A command given
 * after a stop waits until the stop is confirmed. */
static size_t find_queued(const struct db_engine *engine, size_t from, db_time now)
{
	for (size_t i = from; i < engine->waiting_count; i++) {
		const struct db_request *request = engine->waiting[i];
		const struct station *station = engine_find_station(engine, request->drive);

		if (!station->lanes[LANE_COMMAND].active && !station_awaits_stop(station) &&
		    is_free(engine, station, now))
			return i;
	}
	return NO_DRIVE;
}

/* Drives take turns: a command of many exchanges does not delay other drives' commands. */
static bool send_command(struct db_engine *engine, db_time now)
{
	size_t again;
	size_t begun = find_continued(engine, &again, now);
	bool may_begin = engine->last_was_continued || begun == NO_DRIVE;
	size_t i = 0;

	while (may_begin && (i = find_queued(engine, i, now)) != NO_DRIVE) {
		if (begin_queued(engine, i, now)) {
			engine->last_was_continued = false;
			return true;
		}
	}
	/* A command that ended without being sent may have changed whose turn it is. */
	begun = find_continued(engine, &again, now);
	if (begun == NO_DRIVE)
		return false;
	engine->last_was_continued = true;
	engine->next_command = begun + 1;
	exchange_send_in_step(engine, engine->stations[begun], LANE_COMMAND, now);
	return true;
}

static void send_again(struct db_engine *engine, size_t index, db_time now)
{
	struct station *station = engine->stations[index];

	station->again_sent = now;
	engine->next_command = index + 1;
	exchange_send_in_step(engine, station, LANE_COMMAND, now);
}

/* --- status ----------------------------------------------------------------------------------- */

/* The class in which the node is read. A node that changes class begins there with the same use as
 * the others. */
static enum db_share classify(struct db_engine *engine, struct node *node, db_time now)
{
	enum db_share share = engine->bus->polls_evenly || node_is_lively(node, now) ?
	                              DB_SHARE_MOVING :
	                              DB_SHARE_STANDING;

	if (share != node->share)
		node->used = 0;
	node->share = share;
	/* Time that a drive did not use while it was not to be read is not owed to it now. */
	if (node->used < engine->served[share])
		node->used = engine->served[share];
	return share;
}

/* How many times longer than its own poll it takes until a drive of this class is read again, with
 * the drives that move and stand now. */
static double stretch(const struct db_engine *engine, enum db_share share)
{
	double moving = (double)engine->demand[DB_SHARE_MOVING] / (double)engine->period;
	double part = db_share_part(DB_SHARE_MOVING, DB_SHARE_BIT(DB_SHARE_STANDING));
	size_t members = engine->members[share];

	if (share == DB_SHARE_STANDING)
		part = moving < part ? 1.0 - moving : 1.0 - part;
	else if (engine->members[DB_SHARE_STANDING] == 0)
		part = 1.0;
	return (double)(members > 0 ? members : 1) / part;
}

void schedule_begin_cycle(struct db_engine *engine, db_time now)
{
	bool round = engine->unread == 0;
	db_time round_time = (db_time)engine->node_count * engine->poll_time +
	                     (db_time)(engine->station_count - engine->node_count) *
	                             engine->axis_time;
	double moving;
	double standing;
	/* A cycle has room for all drives, or must have it. */
	bool late = !round && (engine->bus->polls_evenly || round_time <= engine->period);

	memset(engine->members, 0, sizeof(engine->members));
	memset(engine->demand, 0, sizeof(engine->demand));
	for (size_t i = 0; i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];
		enum db_share share;

		if (!node->online ||
		    (engine->driver->wants_poll && !engine->driver->wants_poll(node->head, now)))
			continue;
		/* It should have been read in the previous cycle. */
		late |= node->poll_due && node->share == DB_SHARE_MOVING;
		share = classify(engine, node, now);
		engine->members[share]++;
		engine->demand[share] += node->poll_cost;
		engine_mark_for_reading(engine, node);
		if (!round)
			continue;
		node->unread = true;
		engine->unread++;
	}
	engine->round_overran = !round;
	engine->may_identify = true;
	engine->stats.overruns += late;
	if (round)
		engine->round_started = now;
	moving = stretch(engine, DB_SHARE_MOVING);
	standing = stretch(engine, DB_SHARE_STANDING);
	for (size_t i = 0; i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];
		db_time interval = (db_time)((double)node->poll_cost *
		                             (node->share == DB_SHARE_STANDING ? standing :
		                                                                 moving));

		if (interval < node->poll_duration)
			interval = node->poll_duration;
		node->interval = interval > engine->period ? interval : engine->period;
	}
}

/* For each class, the node to be read next: the one that has used the least of the wire. */
struct due {
	struct node *node[DB_SHARE_COUNT];
};

static void find_due(struct db_engine *engine, const struct node *except, struct due *due,
                     db_time now)
{
	memset(due, 0, sizeof(*due));
	for (size_t n = 0, i = engine->next_poll; engine->nodes_due > 0 && n < engine->node_count;
	     n++, i++) {
		struct node **first;
		struct node *node;

		i = i < engine->node_count ? i : 0;
		node = engine->nodes[i];
		if (!node->online || !node->poll_due || (except && node == except) ||
		    !is_free(engine, node->first, now))
			continue;
		first = &due->node[classify(engine, node, now)];
		if (!*first || node->used < (*first)->used)
			*first = node;
	}
}

static size_t index_of(const struct db_engine *engine, const struct node *node)
{
	size_t index = 0;

	while (engine->nodes[index] != node)
		index++;
	return index;
}

static void send_poll(struct db_engine *engine, struct node *node, db_time now)
{
	struct station *station = node->first;
	struct lane *lane = &station->lanes[LANE_POLL];
	enum db_result result;

	engine->served[node->share] = node->used;
	if (!node->in_step) {
		exchange_send_probe(engine, node, now);
		return;
	}
	if (lane->active && lane->ready)
		(void)exchange_send(engine, station, LANE_POLL, now);
	else if (exchange_begin_job(engine, station, LANE_POLL, DB_JOB_POLL, NULL, now, &result) ==
	         DB_STEP_SEND)
		(void)exchange_send(engine, station, LANE_POLL, now);
	else
		engine_end_read(engine, node, now);
	engine->next_poll = index_of(engine, node) + 1;
}

/* Asks the drive that has just answered again at once, where it is not known yet how soon it can
 * receive. */
static bool try_gap_test(struct db_engine *engine, db_time now)
{
	struct node *node = engine->last_to_answer;
	struct lane *lane;
	enum db_result result;

	if (!engine->tests_gap)
		return false;
	engine->tests_gap = false;
	engine->charged_class = node ? node->share : DB_SHARE_NONE;
	if (!node || !node->online || !node->in_step || !is_free(engine, node->first, now))
		return false;
	lane = &node->first->lanes[LANE_POLL];
	return !lane->active &&
	       exchange_begin_job(engine, node->first, LANE_POLL, DB_JOB_POLL, NULL, now,
	                          &result) == DB_STEP_SEND &&
	       exchange_send(engine, node->first, LANE_POLL, now);
}

/*
 * Repeated stops leave every second exchange to the other drives that move or must stand, if one of
 * those is to be read: otherwise a drive that never obeys would keep all others from being read. A
 * stop that was never sent waits for none of them. Only while a drive is active: so there is one.
 */
static bool try_sample_between_stops(struct db_engine *engine, db_time now)
{
	size_t count = engine->station_count;
	struct node *node;
	struct due due;

	if (!engine->stop_was_last || engine->shutting_down ||
	    exchange_may_begin_at(engine, false, now) > now || !stop_all_are_sent(engine))
		return false;
	engine->stop_was_last = false;
	/* Not the node whose stop was sent last, or that was read because of it. */
	find_due(engine, engine->stations[(engine->next_stop + count - 1) % count]->node, &due,
	         now);
	node = due.node[DB_SHARE_MOVING];
	if (!node || !node->in_step || !node_is_lively(node, now))
		return false;
	engine->charged_class = DB_SHARE_MOVING;
	send_poll(engine, node, now);
	return true;
}

/* --- below cyclic status ---------------------------------------------------------------------- */

static bool wants_identify(const struct db_engine *engine, const struct station *station,
                           db_time now)
{
	if (!station->node->online || station->identify_at > now)
		return false;
	return station->lanes[LANE_IDENTIFY].active ||
	       !(station->snapshot.feedback.status & DB_STATUS_PARAMS_VALID) ||
	       (engine->driver->nameplate && engine->driver->nameplate(station->device)->doubtful);
}

static bool try_identify(struct db_engine *engine, db_time now)
{
	enum db_result result;

	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_identify + n) % engine->station_count;
		struct station *station = engine->stations[i];
		struct lane *lane = &station->lanes[LANE_IDENTIFY];

		if (!wants_identify(engine, station, now) || !is_free(engine, station, now))
			continue;
		engine->next_identify = i + (lane->active ? 0 : 1);
		if (!lane->active &&
		    exchange_begin_job(engine, station, LANE_IDENTIFY, DB_JOB_IDENTIFY, NULL, now,
		                       &result) != DB_STEP_SEND)
			continue;
		/* A stop would wait for the text of all parameters, which may take 0.5 s: what
		 * is known is shown with its age, and the rest stays unknown until all drives
		 * stand. */
		if (station->node->in_step && exchange_is_too_long(engine, &lane->exchange))
			continue;
		exchange_send_in_step(engine, station, LANE_IDENTIFY, now);
		return true;
	}
	return false;
}

/*
 * A parameter may be changed at the drive, or over another port of it: known parameters are read
 * again, one drive after the other, as seldom as the family asks for. Nothing waits for this, so it
 * is only done while no drive moves that it could delay.
 */
static bool may_refresh(const struct db_engine *engine, db_time now)
{
	return engine->driver->refresh_pause > 0 && now >= engine->refresh_at &&
	       !exchange_must_be_short(engine);
}

static bool try_refresh(struct db_engine *engine, db_time now)
{
	enum db_result result;

	if (!may_refresh(engine, now))
		return false;
	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_refresh + n) % engine->station_count;
		struct station *station = engine->stations[i];

		if (!station->node->online || !station->node->in_step || station->request ||
		    !(station->snapshot.feedback.status & DB_STATUS_PARAMS_VALID) ||
		    station->lanes[LANE_IDENTIFY].active || !is_free(engine, station, now))
			continue;
		engine->next_refresh = i + 1;
		engine->refresh_at = now + engine->driver->refresh_pause;
		if (exchange_begin_job(engine, station, LANE_IDENTIFY, DB_JOB_REFRESH, NULL, now,
		                       &result) != DB_STEP_SEND)
			return false;
		(void)exchange_send(engine, station, LANE_IDENTIFY, now);
		return true;
	}
	return false;
}

/* Interval of this check at most, while nothing else is to be sent. */
#define IDENTIFY_LOOK (2 * DB_NS_PER_MS)

/* Checked once in a cycle, while a drive wants it, and when nothing else is to be sent. A drive
 * that cannot be asked at this very moment counts, too: where readings leave no time between them
 * there is no other moment. */
static bool any_wants_identify(struct db_engine *engine, bool idle, db_time now)
{
	bool can_be_asked;

	if (!engine->may_identify && !(idle && now >= engine->identify_checked_at + IDENTIFY_LOOK))
		return false;
	can_be_asked = may_refresh(engine, now);
	engine->may_identify = can_be_asked;
	engine->identify_checked_at = now;
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (!wants_identify(engine, station, now))
			continue;
		engine->may_identify = true;
		can_be_asked |= is_free(engine, station, now);
	}
	return can_be_asked;
}

/* `first`: only nodes that have not had their free probes since the port was opened. */
static struct node *find_probe(const struct db_engine *engine, bool first, db_time now)
{
	for (size_t n = 0; n < engine->node_count; n++) {
		struct node *node = engine->nodes[(engine->next_probe + n) % engine->node_count];

		if (node->online || node->probe_at > now || !is_free(engine, node->first, now))
			continue;
		/* The first round after the port opened is not charged: nothing is known of any
		 * drive. */
		if (node->free_probes == 0 ? !first && engine->probes_from <= now : first)
			return node;
	}
	return NULL;
}

/* --- what is sent next ------------------------------------------------------------------------ */

#define STATUS (DB_SHARE_BIT(DB_SHARE_MOVING) | DB_SHARE_BIT(DB_SHARE_STANDING))

/* What is to be sent, by class. */
struct agenda {
	unsigned waiting; /* bits */
	size_t again;     /* a drive whose command repeats a question, or NO_DRIVE */
	bool again_due;   /* a cycle has passed since the last repeat */
	struct due due;
	struct node *new; /* to be probed at once, since the port was opened */
	struct node *lost;
};

static void find_work(struct db_engine *engine, struct agenda *agenda, db_time now)
{
	bool all_online = engine->stats.online == engine->station_count;
	unsigned waiting = 0;

	if (find_continued(engine, &agenda->again, now) != NO_DRIVE ||
	    find_queued(engine, 0, now) != NO_DRIVE)
		waiting |= DB_SHARE_BIT(DB_SHARE_COMMANDS);
	find_due(engine, NULL, &agenda->due, now);
	agenda->again_due = agenda->again != NO_DRIVE &&
	                    now - engine->stations[agenda->again]->again_sent >= engine->period;
	if (agenda->due.node[DB_SHARE_MOVING] || agenda->again_due)
		waiting |= DB_SHARE_BIT(DB_SHARE_MOVING);
	if (agenda->due.node[DB_SHARE_STANDING])
		waiting |= DB_SHARE_BIT(DB_SHARE_STANDING);
	agenda->new = all_online ? NULL : find_probe(engine, true, now);
	if (agenda->new || any_wants_identify(engine, waiting == 0, now))
		waiting |= DB_SHARE_BIT(DB_SHARE_PARAMETERS);
	agenda->lost = all_online ? NULL : find_probe(engine, false, now);
	/* A scan's question uses all the time that a cycle leaves, if any. */
	if (agenda->lost || (engine->scan && (engine->round_overran || (waiting & STATUS) == 0)))
		waiting |= DB_SHARE_BIT(DB_SHARE_BACKGROUND);
	agenda->waiting = waiting;
}

static bool send_of(struct db_engine *engine, enum db_share share, const struct agenda *agenda,
                    db_time now)
{
	struct node *probed;

	engine->charged_class = share;
	switch (share) {
	case DB_SHARE_COMMANDS:
		return send_command(engine, now);
	case DB_SHARE_MOVING:
		/* They take turns: a repeated question may wait for just such a sample. */
		engine->repeat_was_last = agenda->again_due &&
		                          !(engine->repeat_was_last && agenda->due.node[share]);
		if (engine->repeat_was_last)
			send_again(engine, agenda->again, now);
		else
			send_poll(engine, agenda->due.node[share], now);
		return true;
	case DB_SHARE_STANDING:
		send_poll(engine, agenda->due.node[share], now);
		return true;
	case DB_SHARE_PARAMETERS:
		/* A drive that moved when the port was lost goes before another one's
		 * parameters. */
		if (!agenda->new)
			return try_identify(engine, now) || try_refresh(engine, now);
		probed = agenda->new;
		break;
	default:
		if (!agenda->lost)
			return scan_send_next(engine, now);
		probed = agenda->lost;
		break;
	}
	engine->next_probe = index_of(engine, probed) + 1;
	exchange_send_probe(engine, probed, now);
	return true;
}

bool schedule_send_next(struct db_engine *engine, db_time now)
{
	struct agenda agenda;
	bool wait = false;

	/* On a serial line nothing begins while an answer is awaited. */
	if (engine->flights > 0 && !exchange_overlaps(engine))
		return false;
	if (engine_has_active_drives(engine) && try_sample_between_stops(engine, now))
		return true;
	engine->charged_class = DB_SHARE_NONE;
	if (engine->drives_active && stop_send_next(engine, now)) {
		engine->stop_was_last = true;
		return true;
	}
	/* Not when the wire is only free for the stop. */
	if (exchange_may_begin_at(engine, false, now) > now)
		return false;
	if (now >= engine->next_message_at && messages_send(engine, now))
		return true;
	if (engine->shutting_down)
		return false;
	engine->stop_was_last = false;
	if ((engine->reserved.until != 0 && exchange_send_reserved(engine, now)) ||
	    try_gap_test(engine, now))
		return true;
	if (engine->bus->starts_by_broadcast && common_start_try(engine, &wait, now))
		return true;
	if (wait)
		return false;
	/* Where exchanges overlap, each node has at most one: all are asked already. */
	if (engine->flights >= engine->node_count && !engine->scan)
		return false;
	find_work(engine, &agenda, now);
	while (agenda.waiting != 0) {
		enum db_share share = shares_choose(&engine->shares, agenda.waiting);

		if (send_of(engine, share, &agenda, now))
			return true;
		agenda.waiting &= ~DB_SHARE_BIT(share);
	}
	if (agenda.again == NO_DRIVE ||
	    now - engine->stations[agenda.again]->again_sent < SCHEDULE_AGAIN_PAUSE)
		return false;
	engine->charged_class = DB_SHARE_MOVING;
	send_again(engine, agenda.again, now);
	return true;
}
