/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/engine.h"

#include "sched/station.h"
#include "transport/serial.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define RECEIVE_MAX (2 * DB_ANSWER_MAX)

/* Looking for offline drives may cost one part in this many of the bus's time. */
#define PROBE_SHARE 20
/* Repeating a stop to a drive that does not answer: one part in this many. */
#define STOP_SHARE 5

/* What drives are given to act on a broadcast before they are asked something. */
#define BROADCAST_GAP (2 * DB_NS_PER_MS)

struct flight {
	struct station *station; /* null: nothing on the wire */
	enum lane_kind lane;
	bool trusted; /* an answer proves something: the drive was in step */
	db_time sent;
	db_time deadline;
};

struct db_engine {
	const struct db_bus_config *bus;
	const struct db_driver *driver;
	struct db_mailbox *mailbox;
	const struct db_engine_ops *ops;
	void *context;
	int64_t wall_offset_us;
	struct db_bus_stats stats;
	struct flight flight;

	db_time quiet_until; /* a broadcast is on the wire; nobody answers it */
	uint8_t received[RECEIVE_MAX];
	size_t received_length;

	struct db_letter **waiting; /* taken, not begun; in order of arrival */
	size_t waiting_count;
	size_t waiting_max;

	db_time period;
	db_time cycle_at; /* when the next cycle is due; 0 before the first */
	db_time cycle_started;
	bool polling; /* this cycle's polls are not all answered */
	unsigned polls_in_a_row;
	bool front_was_last;

	db_time probes_from; /* the share for offline drives is used up until then */
	db_time busy;        /* time with an exchange on the wire in this second */
	db_time second_at;

	bool shutting_down;
	size_t next_poll; /* where round robin goes on */
	size_t next_front;
	size_t next_identify;
	size_t next_probe;
	size_t station_count;
	struct station stations[];
};

/* --- making -------------------------------------------------------------------------------------- */

int db_engine_new(const struct db_bus_config *bus, const struct db_drive_config *const *drives,
                  struct db_axis *const *axes, size_t drive_count, struct db_mailbox *mailbox,
                  const struct db_engine_ops *ops, void *context, struct db_engine **engine)
{
	struct db_engine *made;

	made = calloc(1, sizeof *made + drive_count * sizeof made->stations[0]);
	if (!made)
		return -ENOMEM;
	made->bus = bus;
	made->driver = bus->driver;
	made->mailbox = mailbox;
	made->ops = ops;
	made->context = context;
	made->period = (db_time)bus->cycle_ms * DB_NS_PER_MS;
	made->stats.period_us = bus->cycle_ms * 1000;
	made->waiting_max = bus->queue;
	made->waiting = calloc(made->waiting_max, sizeof made->waiting[0]);
	if (!made->waiting)
		goto fail;
	for (; made->station_count < drive_count; made->station_count++) {
		size_t i = made->station_count;

		if (station_init(&made->stations[i], bus->driver, bus, drives[i], axes[i]) != 0)
			goto fail;
		station_publish(&made->stations[i], bus->driver, false, 0);
	}
	*engine = made;
	return 0;
fail:
	db_engine_free(made);
	return -ENOMEM;
}

void db_engine_free(struct db_engine *engine)
{
	if (!engine)
		return;
	for (size_t i = 0; i < engine->station_count; i++)
		station_release(&engine->stations[i]);
	free(engine->waiting);
	free(engine);
}

void db_engine_set_wall_offset(struct db_engine *engine, int64_t wall_offset_us)
{
	engine->wall_offset_us = wall_offset_us;
}

static void publish(struct db_engine *engine, struct station *station)
{
	station_publish(station, engine->driver, engine->stats.up, engine->wall_offset_us);
}

/* --- drives coming and going ----------------------------------------------------------------------- */

static void come_online(struct db_engine *engine, struct station *station)
{
	station->in_step = true;
	station->losses = 0;
	station->probe_backoff = PROBE_BACKOFF_MIN;
	if (station->online)
		return;
	station->online = true;
	station->poll_due = true;
	station->identify_at = 0;
	station->identify_backoff = IDENTIFY_BACKOFF_MIN;
	station->snapshot.stats.came_online++;
	engine->stats.online++;
	if (engine->ops->presence)
		engine->ops->presence(engine->context, station->config, true);
}

/* Ends what waits for a drive that cannot do it now. */
static void finish_waiting(struct db_engine *engine, const struct station *station,
                           enum db_result result, db_time now)
{
	size_t axis = (size_t)(station - engine->stations);
	size_t kept = 0;

	for (size_t i = 0; i < engine->waiting_count; i++) {
		struct db_letter *letter = engine->waiting[i];

		if (db_letter_request(letter)->axis == axis)
			db_letter_finish(letter, result, now);
		else
			engine->waiting[kept++] = letter;
	}
	engine->waiting_count = kept;
}

static void go_offline(struct db_engine *engine, struct station *station, enum db_result result,
                       db_time now)
{
	station->in_step = false;
	station_abandon_front(station, engine->driver,
	                      result == DB_RESULT_OFFLINE ? DB_RESULT_TIMEOUT : result, now);
	finish_waiting(engine, station, result, now);
	for (size_t i = 0; i < LANE_COUNT; i++)
		station->lanes[i].active = station->lanes[i].ready = false;
	if (!station->online)
		return;
	station->online = false;
	station->poll_due = false;
	station->probe_at = now + station->probe_backoff;
	engine->stats.online--;
	engine->driver->gone(station->device);
	publish(engine, station);
	if (engine->ops->presence)
		engine->ops->presence(engine->context, station->config, false);
}

void db_engine_port(struct db_engine *engine, bool up, int error, db_time now)
{
	engine->stats.up = up;
	engine->flight.station = NULL;
	engine->received_length = 0;
	if (up) {
		engine->stats.opens++;
		engine->cycle_at = 0;
		engine->probes_from = 0;
	} else {
		engine->stats.last_error = (uint32_t)error;
	}
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = &engine->stations[i];

		if (!up)
			go_offline(engine, station, DB_RESULT_BUS_DOWN, now);
		station->probe_at = now;
		station->probe_backoff = PROBE_BACKOFF_MIN;
		station->ever_probed = false;
		publish(engine, station);
	}
}

/* --- sending --------------------------------------------------------------------------------------- */

static enum db_step begin(struct db_engine *engine, struct station *station, enum lane_kind kind,
                          enum db_job_kind job, const struct db_request *request, db_time now,
                          enum db_result *result)
{
	struct lane *lane = &station->lanes[kind];
	enum db_step step;

	lane->job = (struct db_job){ .kind = job, .request = request, .started = now };
	lane->tries = 0;
	step = engine->driver->begin(station->device, &lane->job, &lane->exchange, result);
	lane->active = lane->ready = step == DB_STEP_SEND;
	return step;
}

static db_time deadline_of(const struct db_engine *engine, const struct db_exchange *exchange,
                           db_time now)
{
	db_time wire = db_serial_wire_time(engine->bus,
	                                   exchange->request_length + exchange->answer_length);

	return now + wire + exchange->extra_time +
	       (db_time)engine->bus->drive_latency_ms * DB_NS_PER_MS;
}

static void send_lane(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      db_time now)
{
	struct lane *lane = &station->lanes[kind];

	lane->ready = false;
	/* Whatever is still in the buffer was said before this question. */
	engine->stats.garbage_bytes += (uint32_t)engine->received_length;
	engine->received_length = 0;
	engine->flight = (struct flight){
		.station = station,
		.lane = kind,
		.trusted = station->in_step,
		.sent = now,
		.deadline = deadline_of(engine, &lane->exchange, now),
	};
	engine->stats.transactions++;
	station->snapshot.stats.requests++;
	engine->front_was_last = kind == LANE_FRONT;
	engine->ops->send(engine->context, lane->exchange.request, lane->exchange.request_length);
}

static void send_probe(struct db_engine *engine, struct station *station, db_time now)
{
	enum db_result result;

	station->ever_probed = true;
	if (begin(engine, station, LANE_PROBE, DB_JOB_PROBE, NULL, now, &result) == DB_STEP_SEND)
		send_lane(engine, station, LANE_PROBE, now);
}

/* It must be asked a probe first, and the answer could not be told from an earlier one's yet. */
static bool is_haunted(const struct station *station, db_time now)
{
	return !station->in_step && station_haunted_until(station, now) > now;
}

/* --- choosing -------------------------------------------------------------------------------------- */

static void send_stop(struct db_engine *engine, struct station *station, db_time now)
{
	struct pending_stop *first = &station->stops[0];
	struct lane *lane = &station->lanes[LANE_STOP];
	enum db_result result = DB_RESULT_FAILED;

	if (!station->in_step && station->blind_stop_sent) {
		send_probe(engine, station, now);
		return;
	}
	station->blind_stop_sent = !station->in_step;
	for (unsigned i = 0; i < station->stop_count; i++) {
		if (station->stops[i].request->command == first->request->command)
			station->stops[i].sent = true;
	}
	if (lane->active && lane->ready && station->in_step) {
		send_lane(engine, station, LANE_STOP, now);
		return;
	}
	if (begin(engine, station, LANE_STOP, DB_JOB_COMMAND, first->request, now, &result) ==
	    DB_STEP_SEND)
		send_lane(engine, station, LANE_STOP, now);
	else
		station_finish_stop(station, result, now);
}

/* Does every drive of the bus wait for one and the same stop that was not sent to any of them yet? */
static bool all_want(const struct db_engine *engine, enum db_command command)
{
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = &engine->stations[i];

		if (station->stop_count == 0 || station->stops[0].sent ||
		    station->stops[0].request->command != command)
			return false;
	}
	return true;
}

/* One frame stops everybody at once; each drive is then asked for its confirmation as usual. */
static bool try_broadcast(struct db_engine *engine, db_time now)
{
	uint8_t request[DB_SHORT_REQUEST];
	struct db_exchange exchange = { .request = request, .request_size = sizeof request };
	enum db_command command;

	if (engine->station_count < 2 || engine->stations[0].stop_count == 0 ||
	    !engine->driver->broadcast)
		return false;
	command = engine->stations[0].stops[0].request->command;
	if (!all_want(engine, command) ||
	    !engine->driver->broadcast(command, engine->bus, &exchange))
		return false;
	for (size_t i = 0; i < engine->station_count; i++)
		engine->stations[i].stops[0].sent = true;
	engine->quiet_until = now + BROADCAST_GAP +
	                      db_serial_wire_time(engine->bus, exchange.request_length);
	engine->stats.transactions++;
	engine->ops->send(engine->context, request, exchange.request_length);
	return true;
}

static bool try_stops(struct db_engine *engine, db_time now)
{
	if (try_broadcast(engine, now))
		return true;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = &engine->stations[i];

		/* A stop itself is never held back, only the question whether it was obeyed. */
		if (station->blind_stop_sent && is_haunted(station, now))
			continue;
		if (station->stop_count > 0 && station->stop_at <= now) {
			send_stop(engine, station, now);
			return true;
		}
	}
	return false;
}

/* Sends a prepared exchange, after getting back in step with the drive where that is needed. */
static void send_in_step(struct db_engine *engine, struct station *station, enum lane_kind kind,
                         db_time now)
{
	if (station->in_step)
		send_lane(engine, station, kind, now);
	else
		send_probe(engine, station, now);
}

static bool begin_letter(struct db_engine *engine, size_t index, db_time now)
{
	struct db_letter *letter = engine->waiting[index];
	const struct db_request *request = db_letter_request(letter);
	struct station *station = &engine->stations[request->axis];
	enum db_job_kind kind = request->setting_count > 0 ? DB_JOB_SETTINGS : DB_JOB_COMMAND;
	enum db_result result = DB_RESULT_FAILED;

	engine->waiting_count--;
	memmove(&engine->waiting[index], &engine->waiting[index + 1],
	        (engine->waiting_count - index) * sizeof engine->waiting[0]);
	station->front_letter = letter;
	station->front_cancelled = false;
	if (begin(engine, station, LANE_FRONT, kind, request, now, &result) == DB_STEP_SEND) {
		send_in_step(engine, station, LANE_FRONT, now);
		return engine->flight.station != NULL;
	}
	station->lanes[LANE_FRONT].active = true;
	station_finish_front(station, result, now);
	return false;
}

static bool try_fronts(struct db_engine *engine, db_time now)
{
	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_front + n) % engine->station_count;
		struct station *station = &engine->stations[i];

		if (station->lanes[LANE_FRONT].ready && station->stop_count == 0 &&
		    !is_haunted(station, now)) {
			engine->next_front = i + 1;
			send_in_step(engine, station, LANE_FRONT, now);
			return true;
		}
	}
	for (size_t i = 0; i < engine->waiting_count;) {
		const struct db_request *request = db_letter_request(engine->waiting[i]);
		const struct station *station = &engine->stations[request->axis];
		size_t before = engine->waiting_count;

		/* A command given after a stop waits until the stop is confirmed. */
		if (station->lanes[LANE_FRONT].active || station->stop_count > 0 ||
		    is_haunted(station, now))
			i++;
		else if (begin_letter(engine, i, now))
			return true;
		else if (engine->waiting_count == before)
			i++;
	}
	return false;
}

static struct station *due_poll(struct db_engine *engine, db_time now)
{
	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_poll + n) % engine->station_count;

		if (engine->stations[i].online && engine->stations[i].poll_due &&
		    !is_haunted(&engine->stations[i], now)) {
			engine->next_poll = i;
			return &engine->stations[i];
		}
	}
	return NULL;
}

static void send_poll(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_POLL];
	enum db_result result;

	if (!station->in_step) {
		send_probe(engine, station, now);
		return;
	}
	station->polled = now;
	if (lane->active && lane->ready)
		send_lane(engine, station, LANE_POLL, now);
	else if (begin(engine, station, LANE_POLL, DB_JOB_POLL, NULL, now, &result) == DB_STEP_SEND)
		send_lane(engine, station, LANE_POLL, now);
	engine->next_poll++;
	engine->polls_in_a_row++;
}

static bool wants_identify(const struct db_engine *engine, const struct station *station,
                           db_time now)
{
	if (!station->online || station->identify_at > now || is_haunted(station, now))
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
		struct station *station = &engine->stations[i];
		struct lane *lane = &station->lanes[LANE_IDENTIFY];

		if (!wants_identify(engine, station, now))
			continue;
		engine->next_identify = i + (lane->active ? 0 : 1);
		if (!lane->active && begin(engine, station, LANE_IDENTIFY, DB_JOB_IDENTIFY, NULL,
		                           now, &result) != DB_STEP_SEND)
			continue;
		send_in_step(engine, station, LANE_IDENTIFY, now);
		return true;
	}
	return false;
}

static bool try_probes(struct db_engine *engine, db_time now)
{
	for (size_t n = 0; n < engine->station_count; n++) {
		size_t i = (engine->next_probe + n) % engine->station_count;
		struct station *station = &engine->stations[i];

		if (station->online || station->probe_at > now || is_haunted(station, now))
			continue;
		/* The first round after the port opened is free: nothing is known of any drive. */
		if (station->ever_probed && engine->probes_from > now)
			continue;
		engine->next_probe = i + 1;
		send_probe(engine, station, now);
		return true;
	}
	return false;
}

/* The classes below cyclic status. */
static bool try_background(struct db_engine *engine, db_time now)
{
	engine->polls_in_a_row = 0;
	return try_identify(engine, now) || try_probes(engine, now);
}

/*
 * Commands go before status, but cannot starve it: when a drive's status is two cycles old, they
 * take turns. Likewise status cannot starve what comes after it: once in a round of polls one
 * exchange of those classes is let through.
 */
static bool send_something(struct db_engine *engine, db_time now)
{
	struct station *poll;

	if (try_stops(engine, now))
		return true;
	if (engine->shutting_down)
		return false;
	poll = due_poll(engine, now);
	if (poll && engine->front_was_last && now - poll->polled > 2 * engine->period) {
		send_poll(engine, poll, now);
		return true;
	}
	if (try_fronts(engine, now))
		return true;
	if (poll && engine->polls_in_a_row > engine->station_count && try_background(engine, now))
		return true;
	if (poll) {
		send_poll(engine, poll, now);
		return true;
	}
	return try_background(engine, now);
}

/* --- answers --------------------------------------------------------------------------------------- */

static void end_of_polls(struct db_engine *engine, db_time now)
{
	uint32_t us;

	if (!engine->polling)
		return;
	for (size_t i = 0; i < engine->station_count; i++) {
		if (engine->stations[i].poll_due)
			return;
	}
	engine->polling = false;
	us = (uint32_t)((now - engine->cycle_started) / DB_NS_PER_US);
	engine->stats.cycle_us = us;
	if (us > engine->stats.cycle_max_us)
		engine->stats.cycle_max_us = us;
}

static void lane_done(struct db_engine *engine, struct station *station, enum lane_kind kind,
                      enum db_result result, db_time now)
{
	station->lanes[kind].active = false;
	switch (kind) {
	case LANE_PROBE:
		come_online(engine, station);
		break;
	case LANE_POLL:
		station->poll_due = false;
		end_of_polls(engine, now);
		break;
	case LANE_STOP:
		publish(engine, station);
		station_finish_stop(station, result, now);
		break;
	case LANE_FRONT:
		/* The PLC must find the command's effect when it reads right behind the response. */
		publish(engine, station);
		station->lanes[kind].active = true;
		station_finish_front(station, result, now);
		break;
	default:
		break;
	}
}

static void account(struct db_engine *engine, db_time now)
{
	engine->busy += now - engine->flight.sent;
	engine->flight.station = NULL;
}

/* An answer to a stop that was sent while out of step proves nothing, but the wire is free. */
static bool blind_stop_answered(struct db_engine *engine, struct station *station,
                                enum lane_kind kind, db_time now)
{
	if (kind != LANE_STOP || engine->flight.trusted)
		return false;
	station->lanes[LANE_STOP].active = false;
	station_note_ghost(station, false, now);
	account(engine, now);
	return true;
}

static void take_frame(struct db_engine *engine, const uint8_t *frame, size_t length, db_time now)
{
	struct station *station = engine->flight.station;
	enum lane_kind kind = engine->flight.lane;
	enum db_result result = DB_RESULT_OK;
	struct lane *lane;
	enum db_step step;
	int address;

	if (!engine->driver->accept(frame, length, &address)) {
		engine->stats.bad_frames++;
		if (station)
			station->snapshot.stats.bad_frames++;
		return;
	}
	if (!station || (engine->bus->line == DB_LINE_RS485 && address >= 0 &&
	                 (unsigned)address != station->config->address)) {
		engine->stats.stray_frames++;
		return;
	}
	lane = &station->lanes[kind];
	if (blind_stop_answered(engine, station, kind, now))
		return;
	step = engine->driver->answer(station->device, &lane->job, frame, length, now,
	                              &lane->exchange, &result);
	if (step == DB_STEP_IGNORE || (kind == LANE_PROBE && station_is_ghost(station, now))) {
		engine->stats.stray_frames++;
		return;
	}
	station_count_answer(station, now - engine->flight.sent);
	station->losses = 0;
	account(engine, now);
	lane->tries = 0;
	lane->ready = step == DB_STEP_SEND;
	if (kind == LANE_FRONT && station->front_cancelled && step == DB_STEP_SEND) {
		step = DB_STEP_DONE;
		result = DB_RESULT_CANCELLED;
	}
	if (step == DB_STEP_DONE)
		lane_done(engine, station, kind, result, now);
	publish(engine, station);
}

void db_engine_receive(struct db_engine *engine, const uint8_t *bytes, size_t length, db_time now)
{
	while (length > 0) {
		size_t room = sizeof engine->received - engine->received_length;
		size_t take = length < room ? length : room;
		size_t start = 0;
		size_t skip = 0;
		size_t frame = 0;

		memcpy(engine->received + engine->received_length, bytes, take);
		engine->received_length += take;
		bytes += take;
		length -= take;
		do {
			engine->driver->cut(engine->received + start,
			                    engine->received_length - start, &skip, &frame);
			engine->stats.garbage_bytes += (uint32_t)skip;
			start += skip;
			if (frame > 0)
				take_frame(engine, engine->received + start, frame, now);
			start += frame;
		} while (frame > 0);
		/* take_frame() never sends, so the buffer is still the one that was cut. */
		engine->received_length -= start;
		memmove(engine->received, engine->received + start, engine->received_length);
		if (engine->received_length == sizeof engine->received) {
			engine->stats.garbage_bytes += (uint32_t)engine->received_length;
			engine->received_length = 0;
		}
	}
}

/* --- losses ---------------------------------------------------------------------------------------- */

static void front_lost(struct db_engine *engine, struct station *station, db_time now)
{
	struct lane *lane = &station->lanes[LANE_FRONT];
	enum db_result result = DB_RESULT_TIMEOUT;

	if (station->front_cancelled) {
		station_finish_front(station, DB_RESULT_CANCELLED, now);
		return;
	}
	if (lane->exchange.repeatable && lane->tries < engine->bus->retries) {
		lane->tries++;
		lane->ready = true;
		engine->stats.retries++;
		station->snapshot.stats.retries++;
		return;
	}
	if (engine->driver->lost(station->device, &lane->job, &lane->exchange, &result) ==
	    DB_STEP_SEND) {
		lane->tries = 0;
		lane->ready = true;
		return;
	}
	station_finish_front(station, result, now);
}

static void probe_lost(struct db_engine *engine, struct station *station, db_time cost, db_time now)
{
	station->lanes[LANE_PROBE].active = false;
	if (station->online)
		return;
	engine->probes_from = now + cost * (PROBE_SHARE - 1);
	station->probe_at = now + station->probe_backoff;
	station->probe_backoff *= 2;
	if (station->probe_backoff > PROBE_BACKOFF_MAX)
		station->probe_backoff = PROBE_BACKOFF_MAX;
}

static void identify_lost(struct station *station, db_time now)
{
	station->identify_at = now + station->identify_backoff;
	station->identify_backoff *= 2;
	if (station->identify_backoff > IDENTIFY_BACKOFF_MAX)
		station->identify_backoff = IDENTIFY_BACKOFF_MAX;
}

static void answer_lost(struct db_engine *engine, db_time now)
{
	struct station *station = engine->flight.station;
	enum lane_kind kind = engine->flight.lane;
	db_time cost = now - engine->flight.sent;

	account(engine, now);
	engine->stats.timeouts++;
	station->snapshot.stats.timeouts++;
	station->in_step = false;
	station->losses++;
	station_note_ghost(station, kind == LANE_PROBE, now);
	switch (kind) {
	case LANE_PROBE:
		probe_lost(engine, station, cost, now);
		break;
	case LANE_FRONT:
		front_lost(engine, station, now);
		break;
	case LANE_IDENTIFY:
		identify_lost(station, now);
		/* fall through */
	default: /* begun anew, after getting back in step */
		station->lanes[kind].active = false;
		station->lanes[kind].ready = false;
		engine->stats.retries++;
		station->snapshot.stats.retries++;
		break;
	}
	if (station->stop_count > 0) {
		/* At first at once; to a drive that stays silent, without starving the others. */
		station->blind_stop_sent = false;
		if (station->losses > engine->bus->retries)
			station->stop_at = now + cost * (STOP_SHARE - 1);
	}
	if (station->losses > engine->bus->retries)
		go_offline(engine, station, DB_RESULT_OFFLINE, now);
	end_of_polls(engine, now);
	publish(engine, station);
}

/* --- letters --------------------------------------------------------------------------------------- */

static void take_stop(struct db_engine *engine, struct station *station, struct db_letter *letter,
                      db_time now)
{
	finish_waiting(engine, station, DB_RESULT_CANCELLED, now);
	if (engine->flight.station == station && engine->flight.lane == LANE_FRONT)
		station->front_cancelled = true;
	else
		station_finish_front(station, DB_RESULT_CANCELLED, now);
	station_add_stop(station, db_letter_request(letter), letter, now);
}

static void take_letters(struct db_engine *engine, db_time now)
{
	struct db_letter *letter;

	while ((letter = db_mailbox_take(engine->mailbox)) != NULL) {
		const struct db_request *request = db_letter_request(letter);
		struct station *station = &engine->stations[request->axis];

		if (request->axis >= engine->station_count)
			db_letter_finish(letter, DB_RESULT_FAILED, now);
		else if (engine->shutting_down)
			db_letter_finish(letter, DB_RESULT_CANCELLED, now);
		else if (request->setting_count == 0 && db_command_is_stop(request->command))
			take_stop(engine, station, letter, now);
		else if (!engine->stats.up)
			db_letter_finish(letter, DB_RESULT_BUS_DOWN, now);
		else if (!station->online)
			db_letter_finish(letter, DB_RESULT_OFFLINE, now);
		else if (engine->waiting_count == engine->waiting_max)
			db_letter_finish(letter, DB_RESULT_BUSY, now);
		else
			engine->waiting[engine->waiting_count++] = letter;
	}
	engine->stats.queued = (uint32_t)engine->waiting_count;
}

/* --- the cycle ------------------------------------------------------------------------------------- */

static void start_cycle(struct db_engine *engine, db_time now)
{
	uint32_t late;

	if (engine->cycle_at == 0)
		engine->cycle_at = now;
	if (now < engine->cycle_at)
		return;
	late = (uint32_t)((now - engine->cycle_at) / DB_NS_PER_US);
	engine->stats.jitter_us = late;
	if (late > engine->stats.jitter_max_us)
		engine->stats.jitter_max_us = late;
	engine->stats.cycles++;
	if (engine->polling)
		engine->stats.overruns++;
	else
		engine->cycle_started = now;
	/* Cycles that were missed altogether are overruns, and not made up for. */
	engine->cycle_at += engine->period;
	while (engine->cycle_at <= now) {
		engine->cycle_at += engine->period;
		engine->stats.overruns++;
	}
	for (size_t i = 0; i < engine->station_count; i++) {
		if (!engine->stations[i].online)
			continue;
		engine->stations[i].poll_due = true;
		engine->polling = true;
	}
}

static void measure_utilisation(struct db_engine *engine, db_time now)
{
	if (engine->second_at == 0)
		engine->second_at = now + DB_NS_PER_S;
	if (now < engine->second_at)
		return;
	engine->stats.utilisation = (uint32_t)(engine->busy * 1000 /
	                                       (now - engine->second_at + DB_NS_PER_S));
	engine->busy = 0;
	engine->second_at = now + DB_NS_PER_S;
}

static db_time earliest(db_time a, db_time b)
{
	return a < b ? a : b;
}

static db_time next_wake(const struct db_engine *engine, db_time now)
{
	db_time wake = engine->cycle_at;

	if (engine->flight.station)
		return earliest(wake, engine->flight.deadline);
	if (now < engine->quiet_until)
		return earliest(wake, engine->quiet_until);
	for (size_t i = 0; i < engine->station_count; i++) {
		const struct station *station = &engine->stations[i];
		db_time probe = station->probe_at;

		if (is_haunted(station, now) &&
		    (station->stop_count == 0 || station->blind_stop_sent)) {
			wake = earliest(wake, station_haunted_until(station, now));
			continue;
		}
		if (station->stop_count > 0)
			wake = earliest(wake, station->stop_at);
		if (station->ever_probed && probe < engine->probes_from)
			probe = engine->probes_from;
		if (!station->online && !engine->shutting_down)
			wake = earliest(wake, probe);
	}
	return wake > now ? wake : now + 1;
}

db_time db_engine_run(struct db_engine *engine, db_time now)
{
	take_letters(engine, now);
	measure_utilisation(engine, now);
	if (!engine->stats.up)
		return DB_TIME_NEVER;
	if (engine->flight.station && now >= engine->flight.deadline)
		answer_lost(engine, now);
	start_cycle(engine, now);
	if (!engine->flight.station && now >= engine->quiet_until)
		send_something(engine, now);
	return next_wake(engine, now);
}

/* --- the end --------------------------------------------------------------------------------------- */

void db_engine_shut_down(struct db_engine *engine, db_time now)
{
	engine->shutting_down = true;
	for (size_t i = 0; i < engine->station_count; i++) {
		struct station *station = &engine->stations[i];
		enum db_command command = db_on_loss_command(station->config->on_exit);

		finish_waiting(engine, station, DB_RESULT_CANCELLED, now);
		if (engine->flight.station == station && engine->flight.lane == LANE_FRONT)
			station->front_cancelled = true;
		else
			station_finish_front(station, DB_RESULT_CANCELLED, now);
		if (command == DB_CMD_NONE || !station->online)
			continue;
		station->exit_request.command = command;
		station_add_stop(station, &station->exit_request, NULL, now);
	}
}

bool db_engine_is_quiet(const struct db_engine *engine)
{
	if (!engine->stats.up)
		return true;
	if (engine->flight.station)
		return false;
	for (size_t i = 0; i < engine->station_count; i++) {
		if (engine->stations[i].stop_count > 0)
			return false;
	}
	return true;
}

void db_engine_stats(const struct db_engine *engine, struct db_bus_stats *stats)
{
	*stats = engine->stats;
}
