/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/answer.h"

#include "sched/exchange.h"
#include "sched/scan.h"
#include "sched/stop.h"

#include <string.h>

/* Looking for offline drives may cost one part in this many of the bus's time. */
#define PROBE_SHARE 20

/* How old what a report says may be when it comes. */
#define REPORT_AGE (500 * DB_NS_PER_MS)

/* --- answers --------------------------------------------------------------------------------------- */

/* It does not tell its parameters: it is asked again, and less and less often. */
static void put_off_identify(struct station *station, db_time now)
{
	station->identify_at = now + station->identify_backoff;
	station->identify_backoff *= 2;
	if (station->identify_backoff > IDENTIFY_BACKOFF_MAX)
		station->identify_backoff = IDENTIFY_BACKOFF_MAX;
}

static void lane_done(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      enum db_result result, db_time now)
{
	station->lanes[kind].active = false;
	switch (kind) {
	case LANE_PROBE:
		engine_bring_online(engine, station->node, now);
		break;
	case LANE_POLL:
		station->node->poll_due = false;
		engine_end_cycle(engine, now);
		break;
	case LANE_STOP:
		engine_publish(engine, station);
		stop_note_answered(engine, station, result, now);
		break;
	case LANE_COMMAND:
		/* The PLC must find the command's effect when it reads right behind the response. */
		engine_publish(engine, station);
		station->lanes[kind].active = true;
		station_finish_command(station, result, now);
		break;
	case LANE_IDENTIFY:
		/* What is still missing then may stay so: others want the bus, too. */
		if (result == DB_RESULT_REFUSED)
			put_off_identify(station, now);
		else
			station->identify_at = now + IDENTIFY_BACKOFF_MIN;
		break;
	default:
		break;
	}
}

/* Not for what comes unasked: somebody who talks on and on must not keep a stop from the line. */
static void keep_quiet(struct db_engine *engine, db_time now)
{
	engine->quiet_until = now + (db_time)engine->bus->turnaround_us * DB_NS_PER_US;
}

/* An answer to a stop that was sent while out of step proves nothing, but the wire is free. */
static bool blind_stop_answered(struct db_engine *engine, struct node *node, db_time now)
{
	if (node->flight.lane != LANE_STOP || node->flight.trusted)
		return false;
	node->flight.station->lanes[LANE_STOP].active = false;
	node_expect_late_answer(node, false, now);
	exchange_end(engine, node, now);
	keep_quiet(engine, now);
	return true;
}

static void publish_node(struct db_engine *engine, const struct node *node)
{
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_publish(engine, s);
}

/* All of it was read, by questions from `asked` on: drives that were told to stop before show whether they do. */
static void judge_stops(struct db_engine *engine, const struct node *node, db_time asked,
                        db_time now)
{
	for (struct station *s = node->first; s; s = s->next_axis) {
		stop_judge(engine, s, asked, now);
	}
}

/* It came from there and is of no use: if the drive does not answer, that may explain why. */
static void note_heard(struct node *node, const uint8_t *frame, size_t length)
{
	struct db_heard *heard = &node->heard;

	heard->length = length < sizeof heard->bytes ? length : sizeof heard->bytes;
	memcpy(heard->bytes, frame, heard->length);
	heard->count++;
}

/* A frame that nobody waits for any more: an answer that was given up too soon, if one was. */
static bool note_late_answer(struct db_engine *engine, struct node *node, db_time now)
{
	db_time latency = node_late_by(node, now);

	if (latency <= 0)
		return false;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_tell_timing(engine, s, DB_EVENT_DRIVE_LATE, latency);
	return true;
}

/* Nothing waits for this frame. What it is. */
static enum db_trace_kind unsolicited(struct db_engine *engine, struct node *node,
                                      const uint8_t *frame, size_t length, db_time now)
{
	const struct db_driver *driver = engine->driver;

	if (!driver->report || !driver->report(node->head, frame, length, now)) {
		engine->stats.stray_frames++;
		if (note_late_answer(engine, node, now))
			return DB_TRACE_LATE;
		if (!node->online)
			note_heard(node, frame, length);
		return DB_TRACE_STRAY;
	}
	engine->stats.reports++;
	/* Who reports is there: no need to wait for the next look. */
	if (!node->online && !is_flying(node) && node->probe_at > now &&
	    node->probe_backoff > PROBE_BACKOFF_MIN) {
		node->probe_at = now;
		node->probe_backoff = PROBE_BACKOFF_MIN;
	}
	publish_node(engine, node);
	/* A report answers no question, and may have waited long. */
	judge_stops(engine, node, now - REPORT_AGE, now);
	return DB_TRACE_REPORT;
}

/* What the frame is. */
static enum db_trace_kind take_answer(struct db_engine *engine, struct node *node,
                                      const uint8_t *frame, size_t length, db_time now)
{
	struct station *station = node->flight.station;
	enum lane_kind kind = node->flight.lane;
	struct lane *lane = &station->lanes[kind];
	struct db_conversation talk = station_conversation(station, kind, now);
	enum db_step step;

	if (blind_stop_answered(engine, node, now))
		return DB_TRACE_ANSWER;
	lane->exchange.begins = lane->exchange.again = false;
	step = engine->driver->answer(&talk, frame, length);
	if (step == DB_STEP_MORE)
		return DB_TRACE_PART;
	if (step == DB_STEP_IGNORE)
		return unsolicited(engine, node, frame, length, now);
	if (kind == LANE_PROBE && node_is_late_answer(node, now)) {
		engine->stats.stray_frames++;
		(void)note_late_answer(engine, node, now);
		return DB_TRACE_LATE;
	}
	if (kind == LANE_COMMAND)
		engine_tell_raw(engine, station, false, frame, length);
	station_count_answer(station, now - node->flight.sent);
	node->losses = 0;
	node_note_answer(node, now);
	exchange_end(engine, node, now);
	keep_quiet(engine, now);
	lane->tries = 0;
	lane->ready = step == DB_STEP_SEND;
	if (kind == LANE_COMMAND && station->command_cancelled && step == DB_STEP_SEND) {
		step = DB_STEP_DONE;
		talk.result = DB_RESULT_CANCELLED;
	}
	if (step == DB_STEP_DONE)
		lane_done(engine, station, kind, talk.result, now);
	if (kind != LANE_POLL) {
		engine_publish(engine, station);
		return DB_TRACE_ANSWER;
	}
	publish_node(engine, node);
	if (step == DB_STEP_DONE)
		judge_stops(engine, node, lane->job.started, now);
	return DB_TRACE_ANSWER;
}

/* Who sent it. `address` -1: whoever was asked. Null when there is nobody. */
static struct node *sender_of(struct db_engine *engine, int address)
{
	/* On a line with one drive it can be nobody else. */
	if (address < 0 && engine->node_count == 1)
		return engine->nodes[0];
	for (size_t i = 0; i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];

		if (address < 0 ? is_flying(node) : node->address == (unsigned)address)
			return node;
	}
	return NULL;
}

/* A frame on CAN tells who sent it by its id. On a line where one is asked at a time, what is damaged was
 * probably his. */
static void take_bad_frame(struct db_engine *engine, const uint8_t *frame, size_t length,
                           int address)
{
	bool told = address >= 0 && engine->driver->medium == DB_MEDIUM_CAN;
	struct node *node = told || engine->flights == 1 ? sender_of(engine, told ? address : -1) :
	                                                   NULL;

	engine->stats.bad_frames++;
	if (!node)
		return;
	if (is_flying(node))
		node->flight.station->snapshot.stats.bad_frames++;
	note_heard(node, frame, length);
}

/* Two drives with one address answer each question twice. True: the frame is the other one's, and nobody's. */
static bool take_doubled(struct db_engine *engine, struct node *node, const uint8_t *frame,
                         size_t length, db_time now)
{
	const struct db_driver *driver = engine->driver;
	uint32_t part = driver->part ? driver->part(engine->bus, frame, length) : 0;
	enum doubled_kind kind;

	/* An answer that was given up may still come beside the one to what was asked next. */
	if (part == 0 || !node->in_step || now < node->risky_until)
		return false;
	kind = doubled_take(&node->doubled, part, frame, length, is_flying(node), now);
	if (kind != DOUBLED_OTHER && kind != DOUBLED_TWO)
		return false;
	engine->stats.stray_frames++;
	for (struct station *s = node->first; s; s = s->next_axis) {
		s->snapshot.stats.doubled_answers++;
		engine_publish(engine, s);
		if (kind == DOUBLED_TWO)
			engine_tell_event(engine, s, DB_EVENT_DRIVE_DOUBLED);
	}
	return true;
}

/* A whole frame from an address. What it is, and the question that it belongs to. */
static enum db_trace_kind take_good_frame(struct db_engine *engine, int address,
                                          const uint8_t *frame, size_t length, db_time now,
                                          uint32_t *question)
{
	struct node *node = sender_of(engine, address);
	enum db_trace_kind kind;

	*question = 0;
	if (!node) {
		scan_note_foreign(engine, frame, length);
		engine->stats.stray_frames++;
		return DB_TRACE_STRAY;
	}
	if (take_doubled(engine, node, frame, length, now))
		return DB_TRACE_STRAY;
	kind = is_flying(node) ? take_answer(engine, node, frame, length, now) :
	                         unsolicited(engine, node, frame, length, now);
	if (kind == DB_TRACE_ANSWER || kind == DB_TRACE_PART)
		*question = node->flight.question;
	else if (kind == DB_TRACE_LATE)
		*question = node->lost_question;
	return kind;
}

void answer_take_frame(struct db_engine *engine, const uint8_t *frame, size_t length, db_time now)
{
	enum db_trace_kind kind = DB_TRACE_FOREIGN;
	uint32_t question = 0;
	int address = -1;
	enum db_frame form = engine->driver->accept(engine->bus, frame, length, &address);

	db_trace_open(engine->trace, now, frame, length);
	if (scan_take_frame(engine, form, frame, length, now)) {
		kind = form == DB_FRAME_GOOD ? DB_TRACE_ANSWER : DB_TRACE_BAD;
		db_trace_close(engine->trace, kind, 0);
		return;
	}
	switch (form) {
	case DB_FRAME_GOOD:
		kind = take_good_frame(engine, address, frame, length, now, &question);
		break;
	case DB_FRAME_FOREIGN:
		scan_note_foreign(engine, frame, length);
		break;
	default:
		kind = DB_TRACE_BAD;
		take_bad_frame(engine, frame, length, address);
		break;
	}
	db_trace_close(engine->trace, kind, question);
}

/* --- losses ---------------------------------------------------------------------------------------- */

static void command_lost(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_COMMAND];
	struct db_conversation talk = station_conversation(station, LANE_COMMAND, now);

	engine_tell_raw(engine, station, false, NULL, 0);
	if (station->command_cancelled) {
		station_finish_command(station, DB_RESULT_CANCELLED, now);
		return;
	}
	if (lane->exchange.repeatable && lane->tries < engine->bus->retries) {
		lane->tries++;
		lane->ready = true;
		engine->stats.retries++;
		station->snapshot.stats.retries++;
		return;
	}
	lane->exchange.begins = lane->exchange.again = false;
	if (engine->driver->lost(&talk) == DB_STEP_SEND) {
		lane->tries = 0;
		lane->ready = true;
		return;
	}
	station_finish_command(station, talk.result, now);
}

static void probe_lost(struct db_engine *engine, struct node *node, db_time cost, db_time now)
{
	node->first->lanes[LANE_PROBE].active = false;
	if (node->online)
		return;
	/* What is asked after a stop has its share with the stops, and takes none of the probes'. */
	if (!node_was_sent_blind_stop(node))
		engine->probes_from = now + cost * (PROBE_SHARE - 1);
	node->probe_at = now + node->probe_backoff;
	node->probe_backoff *= 2;
	if (node->probe_backoff <= PROBE_BACKOFF_MAX)
		return;
	/* It was looked for several times: one that was never there is to be told of, too. */
	node->probe_backoff = PROBE_BACKOFF_MAX;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_tell_missing(engine, s);
}

static void lane_lost(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      db_time cost, db_time now)
{
	struct db_conversation talk = station_conversation(station, kind, now);

	switch (kind) {
	case LANE_PROBE:
		probe_lost(engine, station->node, cost, now);
		break;
	case LANE_COMMAND:
		command_lost(engine, station, now);
		break;
	case LANE_IDENTIFY:
		/* The driver leaves out what the drive does not answer, and asks for the rest. */
		station->lanes[kind].ready = engine->driver->lost(&talk) == DB_STEP_SEND;
		if (station->lanes[kind].ready)
			break;
		put_off_identify(station, now);
		/* fall through */
	default: /* begun anew, after getting back in step */
		station->lanes[kind].active = false;
		station->lanes[kind].ready = false;
		engine->stats.retries++;
		station->snapshot.stats.retries++;
		break;
	}
}

void answer_lost(struct db_engine *engine, struct node *node, db_time now)
{
	struct station *station = node->flight.station;
	enum lane_kind kind = node->flight.lane;
	/* What the others lose by it: all of the wait, or only the room on the wire. */
	db_time cost = engine->driver->medium == DB_MEDIUM_CAN ? node->flight.wire :
	                                                         now - node->flight.sent;

	db_trace_write(engine->trace, now, DB_TRACE_UNANSWERED, node->flight.question, NULL, 0);
	exchange_end(engine, node, now);
	engine->stats.timeouts++;
	station->snapshot.stats.timeouts++;
	node->in_step = false;
	node->losses++;
	node_note_loss(node);
	if (node_is_deaf(node))
		engine_tell_timing(engine, station, DB_EVENT_DRIVE_DEAF,
		                   (db_time)engine->bus->turnaround_us * DB_NS_PER_US);
	node_expect_late_answer(node, kind == LANE_PROBE, now);
	lane_lost(engine, station, kind, cost, now);
	stop_note_lost(engine, node, kind == LANE_STOP, cost, now);
	if (node->losses > engine->bus->retries)
		engine_take_offline(engine, node, DB_RESULT_OFFLINE, now);
	engine_end_cycle(engine, now);
	engine_publish(engine, station);
}
