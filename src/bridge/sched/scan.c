/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/scan.h"

#include "codec/can.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* Minimum time for a drive to respond; if a cycle leaves less, nothing is asked. */
#define WAIT_MIN (5 * DB_NS_PER_MS)

/* A drive that has answered once may take twice as long and this time in addition. */
#define THINK_MARGIN (1 * DB_NS_PER_MS)

/* A question ends when nothing was received for this time, so that two answers in a row are both
 * seen. */
#define QUIET (1 * DB_NS_PER_MS)

/* Reserve of a cycle in case this thread wakes up late. */
#define MARGIN (1 * DB_NS_PER_MS)

/* Interval at which the port is checked until it is open. */
#define PORT_TIME (2 * DB_NS_PER_MS)

/* Without time for a question for this long, the scan ends. */
#define PATIENCE (3 * DB_NS_PER_S)

/* --- the network's side ----------------------------------------------------------------------- */

struct scan *scan_new(const struct db_bus_config *bus, const struct db_scan_plan *plan,
                      uint32_t number)
{
	struct scan *scan = calloc(1, sizeof(*scan));

	if (!scan)
		return NULL;
	scan->bus = bus;
	scan->plan = *plan;
	scan->number = number;
	scan->port = *bus;
	scan->latency = (db_time)bus->drive_latency_ms * DB_NS_PER_MS;
	scan->exchange.request = scan->request;
	scan->exchange.request_size = sizeof(scan->request);
	scan->progress.total = (plan->last - plan->first + 1) *
	                       (uint32_t)(plan->aside ? plan->speed_count : 1);
	scan->progress.wait_us = bus->drive_latency_ms * 1000;
	db_seqlock_write(&scan->sequence, scan->words, &scan->progress, sizeof(scan->progress));
	return scan;
}

void scan_free(struct scan *scan)
{
	free(scan);
}

/* --- beginning and ending --------------------------------------------------------------------- */

static void publish(struct scan *scan)
{
	db_seqlock_write(&scan->sequence, scan->words, &scan->progress, sizeof(scan->progress));
}

static void drop_question(struct db_engine *engine)
{
	struct question *question = &engine->scan->question;

	if (question->flying && !exchange_overlaps(engine) && engine->flights > 0) {
		engine->flights--;
		shares_charge(&engine->shares, DB_SHARE_BACKGROUND, engine->now - question->sent);
	}
	question->flying = false;
}

void scan_end(struct db_engine *engine, enum db_scan_end end)
{
	struct scan *scan = engine->scan;

	if (!scan)
		return;
	drop_question(engine);
	engine->scan = NULL;
	engine->idle_until = 0;
	scan->progress.end = end;
	publish(scan);
	atomic_store(&scan->ended, true);
}

void scan_begin(struct db_engine *engine, struct scan *scan, db_time now)
{
	engine->scan = scan;
	scan->idle_since = now;
	scan->progress.speed = engine->driver->medium == DB_MEDIUM_CAN ? scan->bus->bitrate :
	                                                                 scan->bus->baud;
	for (size_t i = 0; scan->plan.aside && i < engine->station_count; i++) {
		if (!engine->stations[i]->node->online ||
		    station_is_seen_to_stand(engine->stations[i]))
			continue;
		scan->progress.drive = engine->stations[i]->number;
		scan_end(engine, DB_SCAN_MOVES);
		return;
	}
	publish(scan);
}

/* --- a bus that is out of service ------------------------------------------------------------- */

const struct db_bus_config *scan_port_config(const struct db_engine *engine)
{
	struct scan *scan = engine->scan;

	if (!scan || !scan->plan.aside)
		return NULL;
	scan->progress.speed = scan->plan.speeds[scan->speed];
	if (scan->bus->driver->medium == DB_MEDIUM_CAN)
		scan->port.bitrate = scan->progress.speed;
	else
		scan->port.baud = scan->progress.speed;
	return &scan->port;
}

/* Changes to the next speed, from the first address on. */
static void change_speed(struct db_engine *engine)
{
	struct scan *scan = engine->scan;

	scan->visiting = false;
	scan->port_up = false;
	scan->speed++;
	scan->progress.asked = (uint32_t)scan->speed * (scan->plan.last - scan->plan.first + 1);
	if (scan->speed == scan->plan.speed_count)
		scan_end(engine, DB_SCAN_DONE);
	else
		publish(scan);
}

void scan_port(struct db_engine *engine, bool up, int error, db_time now)
{
	struct scan *scan = engine->scan;

	if (!scan)
		return;
	drop_question(engine);
	engine->received_length = 0;
	engine->quiet_until = now + (db_time)scan->bus->turnaround_us * DB_NS_PER_US;
	scan->port_up = up;
	if (up)
		return;
	scan->progress.error = error;
	/* A speed that this port does not support is skipped. */
	if (error == EINVAL && scan->plan.aside)
		change_speed(engine);
	else
		scan_end(engine, DB_SCAN_PORT);
}

/* --- asking ----------------------------------------------------------------------------------- */

static const struct db_bus_config *line_of(const struct scan *scan)
{
	return scan->plan.aside ? &scan->port : scan->bus;
}

static db_time wire_time(const struct scan *scan, size_t request, size_t answer)
{
	return scan->bus->transport->wire_time(line_of(scan), scan->exchange.request, request,
	                                       answer);
}

/* With less time than this nothing is asked. Once a drive has answered, wait at most twice its
 * response time. */
static db_time shortest_wait(const struct scan *scan)
{
	db_time least = scan->response_known ? 2 * scan->response_time + THINK_MARGIN : WAIT_MIN;

	return least < scan->latency ? least : scan->latency;
}

/*
 * How long the drive may take to respond, so that the next cycle finds the line free; 0: not now.
 * One question in a cycle gets all the time that is left, so that each address gets the same wait.
 */
static db_time choose_wait(struct db_engine *engine, const struct db_inquiry *inquiry, db_time wire,
                           db_time now)
{
	struct scan *scan = engine->scan;
	db_time room = engine->cycle_at - now - wire - MARGIN - QUIET -
	               (db_time)scan->bus->turnaround_us * DB_NS_PER_US;
	uint32_t wait_us;

	/* Cyclic status does not use this line. */
	if (exchange_overlaps(engine) || scan->plan.aside || engine->stats.online == 0)
		return scan->latency;
	/* Setting requests may exceed the cycle, as commands do. */
	if (inquiry->kind >= DB_INQUIRY_SET_ADDRESS)
		return scan->latency;
	if (room < scan->latency && scan->cycle_used == engine->cycle_at)
		return 0;
	if (room < shortest_wait(scan))
		return 0;
	wait_us = db_time_us32(db_time_min(room, scan->latency));
	if (!scan->response_known && wait_us < scan->progress.wait_us)
		scan->progress.wait_us = wait_us;
	return db_time_min(room, scan->latency);
}

/* True if the drive at this address is in a conversation, or its late answers may still arrive. */
static bool is_engaged(const struct node *node, db_time now)
{
	const struct station *station = node->first;

	if (is_flying(node) || (!node->in_step && now < node_late_answers_until(node, now)))
		return true;
	return station_awaits_stop(station) || station->lanes[LANE_COMMAND].active;
}

static void send_question(struct db_engine *engine, const struct db_inquiry *inquiry, db_time wait,
                          db_time now)
{
	struct scan *scan = engine->scan;
	const struct db_exchange *exchange = &scan->exchange;
	db_time question = wire_time(scan, exchange->request_length, 0);
	db_time answer = wire_time(scan, exchange->request_length, exchange->answer_length) -
	                 question;

	engine_discard_received(engine, now);
	scan->question = (struct question){
		.flying = true,
		.inquiry = *inquiry,
		.sent = now,
		.silent_by = now + question + exchange->extra_time + wait,
		.deadline = now + question + exchange->extra_time + wait + answer,
		.received_at = now,
	};
	scan->cycle_used = engine->cycle_at;
	scan->progress.address = inquiry->address;
	engine->stats.transactions++;
	if (!exchange_overlaps(engine))
		engine->flights++;
	else
		engine->wire_free = (engine->wire_free > now ? engine->wire_free : now) + question +
		                    answer;
	(void)engine_send(engine, exchange->request, exchange->request_length, DB_TRACE_PROBE);
}

/* End of one address: record what was found, if anything. */
static void end_visit(struct db_engine *engine)
{
	struct scan *scan = engine->scan;
	struct db_scan_progress *progress = &scan->progress;
	unsigned address = scan->visit.find.address;

	scan->visiting = false;
	if (visit_end(&scan->visit) && progress->finds < DB_SCAN_FINDS_MAX)
		scan->finds[progress->finds++] = scan->visit.find;
	progress->asked++;
	if (scan->plan.set_up != DB_INQUIRY_THERE)
		scan_end(engine, scan->visit.end);
	else if (address < scan->plan.last)
		publish(scan);
	else if (scan->plan.aside)
		change_speed(engine);
	else
		scan_end(engine, DB_SCAN_DONE);
}

/* The next question of this visit, or of the next one; false: there is none now. */
static bool choose_inquiry(struct db_engine *engine, struct db_inquiry *inquiry)
{
	struct scan *scan = engine->scan;

	while (engine->scan == scan && (!scan->plan.aside || scan->port_up)) {
		if (!scan->visiting) {
			unsigned span = scan->plan.last - scan->plan.first + 1;

			visit_begin(&scan->visit, engine->driver, scan->progress.speed,
			            scan->plan.first + scan->progress.asked % span,
			            scan->plan.set_up, scan->plan.value);
			scan->visiting = true;
			scan->response_known = false;
		}
		if (!visit_next(&scan->visit, inquiry))
			end_visit(engine);
		else if (engine->driver->inquire &&
		         engine->driver->inquire(line_of(scan), inquiry, &scan->exchange))
			return true;
		else
			visit_add_outcome(&scan->visit, inquiry, NULL);
	}
	return false;
}

/* On a serial line the stop of a moving drive would wait for a save, which may take a second. A
 * drive that may have begun to move is read first. */
static bool must_not_save(struct db_engine *engine, const struct db_inquiry *inquiry)
{
	const struct db_driver *driver = engine->driver;
	/* Or a request that is of no use without one. */
	bool saves = inquiry->kind == DB_INQUIRY_SAVE ||
	             (inquiry->kind == DB_INQUIRY_SET_ADDRESS &&
	              driver->address_effect == DB_TAKES_EFFECT_POWER_UP) ||
	             (inquiry->kind == DB_INQUIRY_SET_SPEED &&
	              driver->speed_effect == DB_TAKES_EFFECT_POWER_UP);

	if (exchange_overlaps(engine) || !saves)
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = engine->stations[i];

		if (station->node->online &&
		    (station->snapshot.feedback.status & DB_STATUS_MOVING)) {
			engine->scan->progress.drive = station->number;
			scan_end(engine, DB_SCAN_MOVES);
			return true;
		}
	}
	for (size_t i = 0; i < engine->station_count; i++) {
		if (engine->stations[i]->node->online && !station_is_read(engine->stations[i]))
			return true;
	}
	return false;
}

bool scan_send_next(struct db_engine *engine, db_time now)
{
	struct scan *scan = engine->scan;
	struct db_inquiry inquiry;
	const struct node *node;
	db_time harmless;
	db_time wire;
	db_time wait;

	if (!scan || scan->question.flying || now < engine->quiet_until ||
	    now < engine->reserved.until || now < scan->not_before ||
	    engine->port_full_since != 0 || (!exchange_overlaps(engine) && engine->flights > 0))
		return false;
	if (!choose_inquiry(engine, &inquiry))
		return false;
	node = scan->plan.aside ? NULL : engine_find_node(engine, inquiry.address);
	if ((node && is_engaged(node, now)) || must_not_save(engine, &inquiry))
		return false;
	harmless = gaps_harmless_at(engine, inquiry.address, scan->exchange.request,
	                            scan->exchange.request_length, now);
	if (harmless > now) {
		scan->not_before = harmless;
		return false;
	}
	wire = wire_time(scan, scan->exchange.request_length, scan->exchange.answer_length) +
	       scan->exchange.extra_time;
	scan->progress.needed_us = db_time_us32(wire + shortest_wait(scan) + MARGIN + QUIET) +
	                           scan->bus->turnaround_us;
	wait = choose_wait(engine, &inquiry, wire, now);
	if (wait <= 0)
		return false;
	send_question(engine, &inquiry, wait, now);
	return true;
}

db_time scan_run_at(const struct db_engine *engine, db_time now)
{
	const struct scan *scan = engine->scan;
	const struct question *question;

	/* While the port takes nothing, no answer is overdue; it wakes the bus itself. */
	if (!scan || engine->port_full_since != 0)
		return DB_TIME_NEVER;
	question = &scan->question;
	if (question->flying) {
		db_time quiet = question->received_at + QUIET;

		if (question->received <= question->echoed)
			return question->silent_by > now ? question->silent_by : now + 1;
		if (question->deadline > now)
			return question->deadline;
		return quiet > now ? quiet : now + 1;
	}
	if (scan->not_before > now)
		return scan->not_before;
	if (!scan->plan.aside)
		return DB_TIME_NEVER;
	/* The bus is about to open its port at another speed. */
	if (!scan->port_up)
		return now + PORT_TIME;
	return engine->quiet_until > now ? engine->quiet_until : now + 1;
}

/* --- received frames -------------------------------------------------------------------------- */

/* The drive's minimum response time; frequent questions have an answer of known length. */
static void learn_response_time(struct scan *scan)
{
	db_time thinks = (db_time)scan->question.outcome.time_us * DB_NS_PER_US -
	                 wire_time(scan, scan->exchange.request_length,
	                           scan->exchange.answer_length);

	if (scan->question.inquiry.kind == DB_INQUIRY_THERE &&
	    (!scan->response_known || thinks < scan->response_time))
		scan->response_time = thinks > 0 ? thinks : 0;
	scan->response_known = true;
}

/* Nothing is on the wire: checks whether the scan is over. */
static void check_end(struct db_engine *engine, db_time now)
{
	struct scan *scan = engine->scan;

	if (atomic_load(&scan->cancelled)) {
		scan_end(engine, DB_SCAN_CANCELLED);
	} else if (!scan->plan.aside && !engine->stats.up) {
		/* The bus has no open port. */
		scan->progress.error = (int)engine->stats.last_error;
		scan_end(engine, DB_SCAN_PORT);
	} else if (!scan->plan.aside && now - scan->idle_since > PATIENCE) {
		scan->progress.gap_us = engine->stats.cycle_us < engine->stats.period_us ?
		                                engine->stats.period_us - engine->stats.cycle_us :
		                                0;
		scan_end(engine, DB_SCAN_NO_ROOM);
	}
}

void scan_check(struct db_engine *engine, db_time now)
{
	struct scan *scan = engine->scan;
	struct question *question;
	struct node *node;
	bool received;

	if (engine->port_full_since != 0)
		return;
	question = &scan->question;
	if (!question->flying) {
		check_end(engine, now);
		return;
	}
	received = question->received > question->echoed;
	if (received ? now < question->deadline ||
	                       (now < question->received_at + QUIET &&
	                        now < question->deadline + (question->deadline - question->sent)) :
	               now < question->silent_by)
		return;
	/* Bytes left in the buffer formed no frame; fewer than an answer may be the beginning of a
	 * late one. */
	if (!exchange_overlaps(engine) && engine->received_length >= scan->exchange.answer_length)
		question->garbage += engine->received_length;
	if (!question->outcome.answered && (received || scan->response_known))
		scan->not_before = now + LATE_ANSWER_LATENCIES * scan->latency;
	if (question->echoed == scan->exchange.request_length)
		question->garbage -= question->garbage < question->echoed ? question->garbage :
		                                                            question->echoed;
	question->outcome.garbled = question->garbage > 0;
	if (question->outcome.answered)
		learn_response_time(scan);
	drop_question(engine);
	scan->idle_since = now;
	engine->busy += !exchange_overlaps(engine) ? now - question->sent : 0;
	engine->quiet_until = now + (db_time)scan->bus->turnaround_us * DB_NS_PER_US;
	node = engine_find_node(engine, question->inquiry.address);
	/* The drive known at this address did not answer: what it still sends must not be taken for
	 * a new answer. */
	if (node && node->online && !scan->plan.aside && !question->outcome.answered) {
		node->in_step = false;
		node_expect_late_answer(node, false, now);
	}
	visit_add_outcome(&scan->visit, &question->inquiry, &question->outcome);
}

bool scan_is_asking(const struct db_engine *engine, const struct node *node)
{
	const struct scan *scan = engine->scan;

	return scan && scan->question.flying && !scan->plan.aside &&
	       scan->question.inquiry.address == node->address;
}

void scan_give_way(struct db_engine *engine, const struct node *node, bool commands)
{
	struct scan *scan = engine->scan;

	if (scan_is_asking(engine, node))
		drop_question(engine);
	if (scan && commands && !scan->plan.aside && scan->visit.find.address == node->address)
		scan->visit.standings = scan->visit.standing_tries = 0;
}

void scan_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now)
{
	struct scan *scan = engine->scan;
	struct question *question;

	if (!scan || !scan->question.flying || exchange_overlaps(engine))
		return;
	question = &scan->question;
	for (size_t i = 0; i < length; i++) {
		if (question->echoed == question->received &&
		    question->echoed < scan->exchange.request_length &&
		    bytes[i] == scan->request[question->echoed])
			question->echoed++;
		question->received++;
	}
	question->received_at = now;
}

bool scan_receive_frame(struct db_engine *engine, enum db_frame kind, const uint8_t *frame,
                        size_t length, db_time now)
{
	struct scan *scan = engine->scan;
	struct question *question;
	struct visit_outcome *outcome;

	if (!scan || !scan->question.flying)
		return false;
	question = &scan->question;
	outcome = &question->outcome;
	if (kind == DB_FRAME_BAD && !exchange_overlaps(engine)) {
		question->garbage += length;
		return true;
	}
	if (kind != DB_FRAME_GOOD)
		return false;
	switch (engine->driver->recognise(line_of(scan), &question->inquiry, frame, length,
	                                  &outcome->said)) {
	case DB_RECOGNISED_NOTHING:
		return false;
	case DB_RECOGNISED_AGAIN:
		outcome->doubled = true;
		break;
	case DB_RECOGNISED_ANSWER:
		outcome->answered = true;
		outcome->time_us = db_time_us32(now - question->sent);
		break;
	case DB_RECOGNISED_PART:
	default:
		break;
	}
	question->received += !exchange_overlaps(engine) ? 0 : length;
	question->received_at = now;
	return true;
}

void scan_count_foreign(struct db_engine *engine, const uint8_t *bytes, size_t length)
{
	struct scan *scan = engine->scan;
	struct db_can_frame frame;
	uint32_t i = 0;

	if (!scan || length != sizeof(frame))
		return;
	memcpy(&frame, bytes, sizeof(frame));
	while (i < scan->progress.foreign && i < DB_SCAN_FOREIGN_MAX &&
	       scan->foreign[i].id != frame.id)
		i++;
	if (i == DB_SCAN_FOREIGN_MAX)
		return;
	if (i == scan->progress.foreign)
		scan->foreign[scan->progress.foreign++] =
			(struct db_scan_foreign){ .id = frame.id };
	scan->foreign[i].count++;
}
