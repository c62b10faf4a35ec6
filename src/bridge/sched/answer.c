/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include "sched/scan.h"

#include <string.h>

/* Looking for offline drives may cost one part in this many of the bus's time. */
#define PROBE_SHARE 20

/* Maximum age of the data in a report when it arrives. */
#define REPORT_AGE (500 * DB_NS_PER_MS)

/* This number of useless frames without one whole status in between is not damage by chance. */
#define HEARD_OFTEN 5

/* --- answers ---------------------------------------------------------------------------------- */

/* It does not report its parameters: it is asked again, at growing intervals. */
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
		station->node->unusable.count = 0;
		node_end_poll(station->node, true, now);
		engine_end_read(engine, station->node, now);
		break;
	case LANE_STOP:
		engine_publish(engine, station);
		stop_answered(engine, station, result, now);
		break;
	case LANE_COMMAND:
		/* The PLC must find the command's effect when it reads right after the response. */
		engine_publish(engine, station);
		station->lanes[kind].active = true;
		station_finish_command(station, result, now);
		break;
	case LANE_IDENTIFY:
		/* What is still missing may stay so: others want the bus, too. */
		if (station->lanes[kind].job.kind == DB_JOB_REFRESH)
			break;
		if (engine->refresh_at == 0)
			engine->refresh_at = now + engine->driver->refresh_pause;
		if (result == DB_RESULT_REFUSED)
			put_off_identify(station, now);
		else
			station->identify_at = now + IDENTIFY_BACKOFF_MIN;
		break;
	default:
		break;
	}
}

/* An answer to a stop that was sent while out of step proves nothing, but the wire is free. */
static bool blind_stop_answered(struct db_engine *engine, struct node *node, db_time now)
{
	if (node->flight.lane != LANE_STOP || node->flight.in_step)
		return false;
	node->flight.station->lanes[LANE_STOP].active = false;
	node_expect_late_answer(node, false, now);
	exchange_end(engine, node, now);
	gaps_keep_silence(engine, node, false, now);
	return true;
}

static void publish_node(struct db_engine *engine, const struct node *node)
{
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_publish(engine, s);
}

/* The node was read, by requests from `asked` on: drives with a stop before that show whether they
 * obey. A reading may leave an axis out, whose last sample may be older than its stop. */
static void judge_stops(struct db_engine *engine, const struct node *node, db_time asked,
                        db_time now)
{
	for (struct station *s = node->first; s; s = s->next_axis)
		stop_judge(engine, s, db_time_min(asked, s->snapshot.feedback.taken), now);
}

/* Keeps an unusable frame from this address: if the drive does not answer, that may explain why. */
static void keep_unusable(struct node *node, const uint8_t *frame, size_t length)
{
	struct db_unusable *unusable = &node->unusable;

	unusable->length = length < sizeof(unusable->bytes) ? length : sizeof(unusable->bytes);
	memcpy(unusable->bytes, frame, unusable->length);
	unusable->count++;
	node->flight.got_unusable = true;
}

/* An unexpected frame: the answer to an exchange whose time-out was too short, if there was one. */
static bool learn_from_late_answer(struct db_engine *engine, struct node *node, db_time now)
{
	db_time latency = node_latency_of_late_answer(node, now);
	bool learnt;

	if (latency <= 0)
		return false;
	/* The losses that were counted were none. */
	node->gap.lost = 0;
	if (engine->last_to_answer)
		engine->last_to_answer->hold.lost = 0;
	/* Its time of arrival is not known. */
	if (engine->overslept_at > node->lost_due)
		return true;
	learnt = learn_patience_late(&node->patience, latency, now);
	if (!learnt && latency < node->patience.most)
		return true;
	node->late_ms = (unsigned)((latency + DB_NS_PER_MS - 1) / DB_NS_PER_MS);
	if (!learnt && !node->online)
		node->timing = DB_TROUBLE_LATE;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_report_timing(
			engine, s,
			&(struct db_engine_timing){ .event = DB_EVENT_DRIVE_LATE,
		                                    .time = latency,
		                                    .learnt = learnt ? node->patience.now : 0 });
	return true;
}

/* An unexpected frame. Returns its kind. */
static enum db_trace_kind unsolicited(struct db_engine *engine, struct node *node,
                                      const uint8_t *frame, size_t length, db_time now)
{
	const struct db_driver *driver = engine->driver;
	/* An offline node is only sent probes, and the late answer to one would have been taken for
	 * this one's. */
	bool is_probed = !node->online && is_flying(node) && node->flight.lane == LANE_PROBE;

	if (!driver->report || !driver->report(node->head, frame, length, now)) {
		engine->stats.stray_frames++;
		if (!is_probed && learn_from_late_answer(engine, node, now))
			return DB_TRACE_LATE;
		if (!node->online || is_flying(node))
			keep_unusable(node, frame, length);
		return DB_TRACE_STRAY;
	}
	engine->stats.reports++;
	/* A node that reports is there: no need to wait for the next probe. */
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

/* Returns the frame's kind. */
static enum db_trace_kind receive_answer(struct db_engine *engine, struct node *node,
                                         const uint8_t *frame, size_t length, db_time now)
{
	struct station *station = node->flight.station;
	enum lane_kind kind = node->flight.lane;
	struct lane *lane = &station->lanes[kind];
	struct db_conversation talk = station_conversation(station, kind, now);
	enum db_step step;
	bool overslept;
	bool proves;

	if (blind_stop_answered(engine, node, now))
		return DB_TRACE_ANSWER;
	talk.brief = kind == LANE_COMMAND && exchange_must_be_short(engine);
	if (kind == LANE_COMMAND && lane->exchange.joins && !station->command_cancelled)
		engine_join_waiting_writes(engine, station);
	lane->exchange.begins = lane->exchange.again = false;
	step = engine->driver->answer(&talk, frame, length);
	if (kind == LANE_COMMAND && lane->job.parts)
		db_queue_show_acknowledged(station->request);
	/* A partial reading changes nothing for the schedule. */
	if (step == DB_STEP_MORE && kind != LANE_POLL)
		engine->idle_until = 0;
	if (step == DB_STEP_MORE)
		return DB_TRACE_PART;
	if (step == DB_STEP_IGNORE)
		return unsolicited(engine, node, frame, length, now);
	if (kind == LANE_PROBE && node_is_late_answer(node, now)) {
		engine->stats.stray_frames++;
		(void)learn_from_late_answer(engine, node, now);
		return DB_TRACE_LATE;
	}
	if (kind == LANE_COMMAND)
		engine_report_raw_frame(engine, station, false, frame, length);
	overslept = engine->overslept_at > node->flight.sent;
	station_count_answer(station, now - node->flight.sent, !overslept);
	node->losses = 0;
	proves = gaps_answered(engine, node, now);
	node_answered(node, !overslept, now);
	exchange_end(engine, node, now);
	gaps_keep_silence(engine, node, proves, now);
	lane->tries = 0;
	lane->ready = step == DB_STEP_SEND;
	if (kind == LANE_COMMAND && station->command_cancelled && step == DB_STEP_SEND) {
		station_settle_write(station, engine->driver, now);
		step = DB_STEP_DONE;
		talk.result = DB_RESULT_CANCELLED;
	}
	if (step == DB_STEP_DONE)
		lane_done(engine, station, kind, talk.result, now);
	if (kind != LANE_POLL) {
		engine_publish(engine, station);
		return DB_TRACE_ANSWER;
	}
	if (step == DB_STEP_DONE || !talk.unchanged)
		publish_node(engine, node);
	if (step == DB_STEP_DONE)
		judge_stops(engine, node, lane->job.started, now);
	return DB_TRACE_ANSWER;
}

/* The sender. `address` -1: the node that was asked. Null when there is none. */
static struct node *node_sending(struct db_engine *engine, int address)
{
	/* On a line with one drive it can be no other. */
	if (address < 0 && engine->node_count == 1)
		return engine->nodes[0];
	for (size_t i = 0; i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];

		if (address < 0 ? is_flying(node) : node->address == (unsigned)address)
			return node;
	}
	return NULL;
}

/* The node whose exchange this frame may answer: its sender, or a node that waits for an answer
 * from there because it is being given that address. Null: neither. */
static struct node *node_waiting_for(struct db_engine *engine, struct node *sender, int address)
{
	if (sender && is_flying(sender))
		return sender;
	for (size_t i = 0; address > 0 && i < engine->node_count; i++) {
		struct node *node = engine->nodes[i];
		const struct flight *flight = &node->flight;

		if (is_flying(node) &&
		    flight->station->lanes[flight->lane].exchange.also_from == (unsigned)address)
			return node;
	}
	return sender;
}

/* A frame on CAN shows its sender by its id. On a line where one node is asked at a time, a damaged
 * frame is probably from that node. */
static void receive_bad_frame(struct db_engine *engine, const uint8_t *frame, size_t length,
                              int address)
{
	bool known = address >= 0 && engine->driver->medium == DB_MEDIUM_CAN;
	struct node *node = known || engine->flights == 1 ?
	                            node_sending(engine, known ? address : -1) :
	                            NULL;

	engine->stats.bad_frames++;
	if (!node)
		return;
	if (is_flying(node))
		node->flight.station->snapshot.stats.bad_frames++;
	keep_unusable(node, frame, length);
}

/* A frame not in this bus's form. When the driver can name a possible sender, that may explain why
 * that drive does not answer. */
static void receive_foreign_frame(struct db_engine *engine, const uint8_t *frame, size_t length,
                                  int address)
{
	struct node *node = address >= 0 ? node_sending(engine, address) : NULL;
	const struct db_exchange *asked;

	if (!node || node->online || !is_flying(node))
		return;
	/* A line may echo what is sent. */
	asked = &node->flight.station->lanes[node->flight.lane].exchange;
	if (length != asked->request_length || memcmp(frame, asked->request, length) != 0)
		keep_unusable(node, frame, length);
}

/* Two drives with one address answer each question twice. True: the frame is the other drive's and
 * must not be used. */
static bool is_second_drive(struct db_engine *engine, struct node *node, const uint8_t *frame,
                            size_t length, db_time now)
{
	const struct db_driver *driver = engine->driver;
	uint32_t part = driver->part ? driver->part(engine->bus, frame, length) : 0;
	enum doubled_kind kind;

	/* An answer that timed out may still arrive in addition to that of the next request. */
	if (part == 0 || !node->in_step || now < node->risky_until)
		return false;
	kind = doubled_judge(&node->doubled, part, frame, length, is_flying(node), now);
	if (kind != DOUBLED_OTHER && kind != DOUBLED_TWO)
		return false;
	engine->stats.stray_frames++;
	for (struct station *s = node->first; s; s = s->next_axis) {
		s->snapshot.stats.doubled_answers++;
		engine_publish(engine, s);
		if (kind == DOUBLED_TWO)
			engine_report_event(engine, s, DB_EVENT_DRIVE_DOUBLED);
	}
	return true;
}

/* A whole frame from a node, or null: from an unknown one. Returns its kind and the request that it
 * belongs to. */
static enum db_trace_kind receive_good_frame(struct db_engine *engine, struct node *node,
                                             const uint8_t *frame, size_t length, db_time now,
                                             uint32_t *question)
{
	enum db_trace_kind kind;

	*question = 0;
	if (!node) {
		scan_count_foreign(engine, frame, length);
		engine->stats.stray_frames++;
		return DB_TRACE_STRAY;
	}
	if (is_second_drive(engine, node, frame, length, now))
		return DB_TRACE_STRAY;
	kind = is_flying(node) ? receive_answer(engine, node, frame, length, now) :
	                         unsolicited(engine, node, frame, length, now);
	if (kind == DB_TRACE_ANSWER || kind == DB_TRACE_PART)
		*question = node->flight.question;
	else if (kind == DB_TRACE_LATE)
		*question = node->lost_question;
	return kind;
}

void answer_receive(struct db_engine *engine, const uint8_t *frame, size_t length, db_time now)
{
	enum db_trace_kind kind = DB_TRACE_FOREIGN;
	uint32_t question = 0;
	struct node *node = NULL;
	int address = -1;
	enum db_frame form = engine->driver->accept ?
	                             engine->driver->accept(engine->bus, frame, length, &address) :
	                             DB_FRAME_GOOD;

	if (form == DB_FRAME_GOOD) {
		node = node_sending(engine, address);
		if (node) {
			node->received_at = now;
		} else if (address > 0) {
			engine->foreign_address = (unsigned)address;
			engine->foreign_received_at = now;
		}
	}
	db_trace_open(engine->trace, now, frame, length);
	if (scan_receive_frame(engine, form, frame, length, now)) {
		kind = form == DB_FRAME_GOOD ? DB_TRACE_ANSWER : DB_TRACE_BAD;
		db_trace_close(engine->trace, kind, 0);
		return;
	}
	switch (form) {
	case DB_FRAME_GOOD:
		node = node_waiting_for(engine, node, address);
		kind = receive_good_frame(engine, node, frame, length, now, &question);
		break;
	case DB_FRAME_FOREIGN:
		scan_count_foreign(engine, frame, length);
		receive_foreign_frame(engine, frame, length, address);
		break;
	default:
		kind = DB_TRACE_BAD;
		receive_bad_frame(engine, frame, length, address);
		break;
	}
	db_trace_close(engine->trace, kind, question);
	if (kind != DB_TRACE_PART)
		engine->idle_until = 0;
}

/* --- losses ----------------------------------------------------------------------------------- */

static void command_lost(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_COMMAND];
	struct db_conversation talk = station_conversation(station, LANE_COMMAND, now);

	engine_report_raw_frame(engine, station, false, NULL, 0);
	if (station->command_cancelled) {
		station_settle_write(station, engine->driver, now);
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
	bool asks_about_stop = false;

	node->first->lanes[LANE_PROBE].active = false;
	if (node->online)
		return;
	/* A question after a stop that was sent out of step uses the share of stops, not that of
	 * probes. */
	for (const struct station *s = node->first; s; s = s->next_axis)
		asks_about_stop |= s->blind_stop_sent;
	if (!asks_about_stop)
		engine->probes_from = now + cost * (PROBE_SHARE - 1);
	node->probe_at = now + node->probe_backoff;
	node->probe_backoff *= 2;
	if (node->probe_backoff <= PROBE_BACKOFF_MAX)
		return;
	/* It was probed several times: a drive that was never there must be reported, too. */
	node->probe_backoff = PROBE_BACKOFF_MAX;
	for (struct station *s = node->first; s; s = s->next_axis) {
		engine_report_missing(engine, s);
		engine_report_unusable(engine, s);
	}
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
		if (station->lanes[kind].job.kind != DB_JOB_REFRESH)
			put_off_identify(station, now);
		/* fall through */
	default: /* begun again after getting back in step */
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
	/* What the other drives lose by it: the whole wait, or only the time on the wire. The wait
	 * that was planned, not the time that has passed: a full port or a busy computer must not
	 * put off this drive's stops and probes. */
	db_time cost = engine->driver->medium == DB_MEDIUM_CAN ?
	                       node->flight.wire :
	                       node->flight.wire + node->flight.patience +
	                               station->lanes[kind].exchange.extra_time;

	db_trace_write(engine->trace, now, DB_TRACE_UNANSWERED, node->flight.question, NULL, 0);
	exchange_end(engine, node, now);
	engine->stats.timeouts++;
	station->snapshot.stats.timeouts++;
	node->in_step = false;
	node->losses++;
	/* What was received before it fell silent does not explain why. */
	if (node->online && !node->flight.got_unusable)
		node->unusable.count = 0;
	gaps_lost(engine, node, now);
	/* A late answer shows by these when it was due, and to what. */
	node->lost_due = node->flight.deadline - node->flight.patience;
	node->lost_question = node->flight.question;
	node_expect_late_answer(node, kind == LANE_PROBE, now);
	engine->late_until = now + node->late_answer_time;
	node_end_poll(node, false, now);
	lane_lost(engine, station, kind, cost, now);
	/* It answers probes, but sends no valid status. */
	for (struct station *s = node->first; s && node->unusable.count >= HEARD_OFTEN;
	     s = s->next_axis)
		engine_report_unusable(engine, s);
	stop_lost(engine, node, kind == LANE_STOP, cost, now);
	if (node->losses > engine->bus->retries)
		engine_take_offline(engine, node, DB_RESULT_OFFLINE, now);
	engine_publish(engine, station);
}
