/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/station.h"

#include <stdlib.h>
#include <string.h>

/* --- nodes ------------------------------------------------------------------------------------- */

struct node *node_new(const struct db_bus_config *bus, unsigned address)
{
	struct node *node = calloc(1, sizeof *node);

	if (!node)
		return NULL;
	node->address = address;
	node->probe_backoff = PROBE_BACKOFF_MIN;
	node->late_answer_time = LATE_ANSWER_LATENCIES * (db_time)bus->drive_latency_ms *
	                         DB_NS_PER_MS;
	return node;
}

void node_free(struct node *node)
{
	while (node) {
		struct node *next_spare = node->next_spare;

		free(node->head);
		free(node);
		node = next_spare;
	}
}

void node_expect_late_answer(struct node *node, bool probe, db_time now)
{
	if (!probe) {
		node->risky_until = now + node->late_answer_time;
		return;
	}
	if (now >= node->late_probes_until)
		node->late_probes = 0;
	node->late_probes++;
	node->late_probes_until = now + node->late_answer_time;
}

void node_inherit_late_answers(struct node *node, const struct node *from)
{
	node->risky_until = from->risky_until;
	node->late_probes = from->late_probes;
	node->late_probes_until = from->late_probes_until;
}

db_time node_late_answers_until(const struct node *node, db_time now)
{
	if (node->late_probes == 0 || now >= node->risky_until)
		return now;
	return node->late_probes_until;
}

bool node_waits_out_late_answers(const struct node *node, db_time now)
{
	return !node->in_step && node_late_answers_until(node, now) > now;
}

bool node_is_late_answer(struct node *node, db_time now)
{
	if (now >= node->late_probes_until)
		node->late_probes = 0;
	if (node->late_probes == 0)
		return false;
	if (now < node->risky_until) {
		node->late_probes--;
		return true;
	}
	/* Whichever probe it answers, as many others may still be. */
	node->late_probes_until = now + node->late_answer_time;
	return false;
}

bool node_must_stand(const struct node *node)
{
	for (const struct station *s = node->first; s; s = s->next_axis) {
		if (!standing_is_free(&s->standing))
			return true;
	}
	return false;
}

bool node_was_sent_blind_stop(const struct node *node)
{
	for (const struct station *s = node->first; s; s = s->next_axis) {
		if (s->blind_stop_sent)
			return true;
	}
	return false;
}

/* What is asked so soon behind an answer may be lost by a drive that still turns its line around. */
#define SOON (6 * DB_NS_PER_MS)

/* So many losses make a pattern. */
#define DEAF_LOSSES 6

static bool was_asked_soon(const struct node *node)
{
	return node->answered != 0 && node->flight.sent - node->answered < SOON;
}

void node_note_answer(struct node *node, db_time now)
{
	if (was_asked_soon(node))
		node->soon_answers++;
	node->answered = now;
	node->lost_sent = 0;
}

void node_note_loss(struct node *node)
{
	if (was_asked_soon(node))
		node->soon_losses++;
	else
		node->later_losses++;
	node->lost_sent = node->flight.sent;
	node->lost_question = node->flight.question;
	node->lost_wire = node->flight.wire;
}

db_time node_late_by(const struct node *node, db_time now)
{
	db_time latency = now - node->lost_sent - node->lost_wire;

	return node->lost_sent == 0 || latency > node->late_answer_time ? 0 : latency;
}

bool node_is_deaf(struct node *node)
{
	bool deaf = node->soon_losses * 3 > node->soon_answers &&
	            node->later_losses * 4 < node->soon_losses;

	if (node->soon_losses < DEAF_LOSSES)
		return false;
	node->soon_answers = node->soon_losses = node->later_losses = 0;
	return deaf;
}

/* --- stations ---------------------------------------------------------------------------------- */

struct station *station_new(const struct db_bus_config *bus, const struct db_bus_drive *drive)
{
	struct station *station = calloc(1, sizeof *station);

	if (!station)
		return NULL;
	station->number = drive->drive;
	station->config = drive->config;
	station->axis = drive->axis;
	station->device = calloc(1, bus->driver->device_size);
	station->spare = node_new(bus, drive->config->address);
	if (!station->device || !station->spare) {
		station_free(station);
		return NULL;
	}
	for (size_t i = 0; i < LANE_COMMAND; i++) {
		struct db_exchange *exchange = &station->lanes[i].exchange;

		exchange->request = station->requests[i];
		exchange->request_size = sizeof station->requests[i];
	}
	return station;
}

void station_free(struct station *station)
{
	if (!station)
		return;
	/* Which of the two has the head, when it is at no node, was settled when it parted. */
	if (!station->node || station->device != station->node->head)
		free(station->device);
	node_free(station->spare);
	free(station);
}

void station_join(struct station *station, struct node *node, const struct db_bus_config *bus)
{
	struct station **end = &node->first;

	while (*end)
		end = &(*end)->next_axis;
	*end = station;
	station->node = node;
	bus->driver->init(station->device, node->head, bus, station->config);
	if (!node->head)
		node->head = station->device;
}

bool station_part(struct station *station, const struct db_driver *driver)
{
	struct node *node = station->node;
	struct station **link = &node->first;

	while (*link != station)
		link = &(*link)->next_axis;
	*link = station->next_axis;
	station->next_axis = NULL;
	station->node = NULL;
	if (node->first) {
		driver->leave(station->device);
	} else {
		node->next_spare = station->spare;
		station->spare = node;
	}
	if (station->device == node->head)
		station->device = NULL;
	return !node->first;
}

struct db_conversation station_conversation(struct station *station, enum lane_kind kind,
                                            db_time now)
{
	bool of_node = kind == LANE_POLL || kind == LANE_PROBE;
	struct lane *lane = &station->lanes[kind];

	return (struct db_conversation){
		.device = of_node ? station->node->head : station->device,
		.job = &lane->job,
		.exchange = &lane->exchange,
		.now = now,
	};
}

/* Until it was seen to stand the drive is not at a standstill, whatever it says of itself. */
static void show_standing(const struct standing *standing, struct db_feedback *feedback)
{
	feedback->status |= DB_STATUS_MUST_STAND;
	if (!(feedback->status & DB_STATUS_ONLINE))
		return;
	if (feedback->state != DB_AXIS_ERROR_STOP && feedback->state != DB_AXIS_DISABLED) {
		feedback->state = DB_AXIS_STOPPING;
		feedback->status |= DB_STATUS_STOPPING;
	}
	if (standing->overdue) {
		feedback->status |= DB_STATUS_ERROR;
		feedback->error = DB_ERROR_RUNS_ON;
	}
}

static void judge_trouble(struct station *station, const struct bus_moment *bus)
{
	const struct node *node = station->node;
	struct db_trouble *trouble = &station->snapshot.trouble;
	const struct db_trouble_signs signs = {
		.silence = node->heard.count > 0 ? DB_TROUBLE_NOT_UNDERSTOOD : node->timing,
		.aside = bus->aside,
		.two_drives = bus->now < node->doubled.until,
	};
	enum db_trouble_cause cause = db_trouble_of(&station->snapshot.feedback, &signs);

	trouble->late_ms = (uint16_t)node->late_ms;
	trouble->uncertain_until = node->doubled.until;
	if (cause == trouble->cause && trouble->since != 0)
		return;
	trouble->cause = (uint16_t)cause;
	trouble->since = bus->now;
}

void station_publish(struct station *station, const struct db_driver *driver,
                     const struct bus_moment *bus)
{
	struct db_feedback *feedback = &station->snapshot.feedback;
	const struct db_nameplate *plate = driver->nameplate(station->device);
	db_time before = feedback->taken;
	uint64_t wall_us = feedback->taken_wall_us;
	bool online;

	/* First the nameplate: who sees that it is valid in the snapshot must find the new one. */
	if (!station->plate_published || plate->generation != station->generation) {
		db_axis_publish_nameplate(station->axis, plate);
		station->generation = plate->generation;
		station->plate_published = true;
	}
	driver->feedback(station->device, feedback);
	/* Told once for each sample: who sees another time takes the drive for alive, and a clock wanders and is set. */
	if (feedback->taken != before) {
		station->snapshot.stats.samples++;
		wall_us = feedback->taken == 0 ?
		                  0 :
		                  (uint64_t)(feedback->taken / DB_NS_PER_US + bus->wall_offset_us);
	}
	feedback->taken_wall_us = wall_us;
	if (bus->up)
		feedback->status |= DB_STATUS_BUS_UP;
	station->snapshot.must_stand = (struct db_must_stand){
		.cause = (uint8_t)station->standing.cause,
		.command = (uint8_t)station->standing.kind,
		.since = station->standing.since,
		.count = station->standing.count,
		.seen = standing_is_seen(&station->standing),
	};
	/* A drive that came back is online for others with its first status, not with old data. */
	online = station->node->online && feedback->state != DB_AXIS_OFFLINE;
	if (online) {
		feedback->status |= DB_STATUS_ONLINE;
	} else {
		feedback->status &= DB_STATUS_BUS_UP;
		feedback->state = DB_AXIS_OFFLINE;
		feedback->error = bus->up ? DB_ERROR_NO_ANSWER : DB_ERROR_BUS_DOWN;
	}
	if (!standing_is_free(&station->standing))
		show_standing(&station->standing, feedback);
	judge_trouble(station, bus);
	db_axis_publish(station->axis, &station->snapshot);
}

void station_count_answer(struct station *station, db_time round_trip)
{
	struct db_axis_stats *stats = &station->snapshot.stats;
	uint32_t us = db_time_us32(round_trip);

	stats->answers++;
	stats->round_trip_us = us;
	if (us > stats->round_trip_max_us)
		stats->round_trip_max_us = us;
	if (station->round_trips == 0 || us < stats->round_trip_min_us)
		stats->round_trip_min_us = us;
	/* Not divided by stats->answers, which begins again from 0 after 2^32. */
	station->round_trips++;
	station->round_trip_sum_us += us;
	stats->round_trip_mean_us = (uint32_t)(station->round_trip_sum_us / station->round_trips);
}

/* --- stops ------------------------------------------------------------------------------------- */

void station_add_stop(struct station *station, enum db_command command, enum db_stand_cause cause,
                      struct db_queued *queued, db_time now)
{
	const struct db_feedback *feedback = &station->snapshot.feedback;
	bool fresh = (feedback->status & DB_STATUS_ONLINE) && station->node->in_step &&
	             !station->lanes[LANE_COMMAND].active &&
	             feedback->taken > station->command_ended;

	standing_enter(&station->standing, command, cause, fresh ? feedback : NULL, now);
	if (!queued)
		return;
	/* Room for requests is bounded where they are posted. */
	if (station->stop_count == DB_QUEUE_STOPS_EACH) {
		db_queued_finish(queued, DB_RESULT_FAILED, now);
		return;
	}
	station->stops[station->stop_count++] = (struct stop_waiter){
		.queued = queued,
		.command = command,
	};
}

void station_note_stop_sent(struct station *station, bool trusted, db_time now)
{
	db_time round_trip = (db_time)station->snapshot.stats.round_trip_us * DB_NS_PER_US;

	standing_note_sent(&station->standing, trusted, round_trip, now);
	for (unsigned i = 0; i < station->stop_count; i++)
		db_queued_sent(station->stops[i].queued, now);
}

void station_finish_stops(struct station *station, enum db_command command, enum db_result result,
                          db_time now)
{
	unsigned kept = 0;

	for (unsigned i = 0; i < station->stop_count; i++) {
		struct stop_waiter *stop = &station->stops[i];
		bool ends = command == DB_CMD_NONE ? stop->command != DB_CMD_DISABLE :
		                                     stop->command == command;

		if (ends)
			db_queued_finish(stop->queued, result, now);
		else
			station->stops[kept++] = *stop;
	}
	station->stop_count = kept;
}

bool station_awaits_stop(const struct station *station)
{
	return station->stop_count > 0 ||
	       (standing_is_open(&station->standing) && !station->standing.overdue);
}

/* How long a drive may take to begin a motion that it was told just before the stop. */
#define DOUBT_TIME (100 * DB_NS_PER_MS)

struct standing_rules station_rules(const struct station *station, const struct db_driver *driver,
                                    db_time now)
{
	bool doubtful = !driver->acknowledges &&
	                (now - station->motion_sent < DOUBT_TIME ||
	                 (station->snapshot.feedback.status & DB_STATUS_HOMING));

	return (struct standing_rules){
		.patience = (db_time)station->config->stop_reaction_ms * DB_NS_PER_MS,
		.doubt = doubtful ? DOUBT_TIME : 0,
	};
}

void station_drop_stops(struct station *station, db_time now)
{
	enum db_result result = station->standing.sent_at != 0 ? DB_RESULT_INDETERMINATE :
	                                                         DB_RESULT_CANCELLED;

	for (unsigned i = 0; i < station->stop_count; i++)
		db_queued_finish(station->stops[i].queued, result, now);
	station->stop_count = 0;
}

/* --- what it does ------------------------------------------------------------------------------ */

bool station_is_read(const struct station *station)
{
	return station->node->online && !station->lanes[LANE_COMMAND].active &&
	       station->stop_count == 0 && standing_is_free(&station->standing) &&
	       station->snapshot.feedback.taken > station->command_ended;
}

bool station_is_seen_to_stand(const struct station *station)
{
	const struct db_feedback *feedback = &station->snapshot.feedback;

	return station_is_read(station) && !(feedback->status & DB_STATUS_MOVING) &&
	       (feedback->state == DB_AXIS_DISABLED || feedback->state == DB_AXIS_STANDSTILL ||
	        feedback->state == DB_AXIS_ERROR_STOP);
}

bool station_command_flies(const struct station *station)
{
	const struct flight *flight = &station->node->flight;

	return flight->station == station && flight->lane == LANE_COMMAND;
}

void station_cancel_command(struct station *station, db_time now)
{
	if (station_command_flies(station))
		station->command_cancelled = true;
	else
		station_finish_command(station, DB_RESULT_CANCELLED, now);
}

/* A motion ends what the drive had to stand for, if the drive took it. What was answered as failed might begin all
 * the same, and must not. */
static void note_motion_ended(struct station *station, enum db_result result, db_time now)
{
	const struct lane *lane = &station->lanes[LANE_COMMAND];
	enum db_command command = lane->job.kind == DB_JOB_COMMAND ? lane->job.request->command :
	                                                             DB_CMD_NONE;

	if (standing_gives_way_to(&station->standing, command))
		standing_note_motion(&station->standing, db_result_is_success(result), now);
	else if (command == DB_CMD_ENABLE && db_result_is_success(result) &&
	         !station->command_cancelled)
		standing_note_enabled(&station->standing);
	if (result == DB_RESULT_FAILED && lane->sent && db_command_is_motion(command))
		standing_enter(&station->standing, DB_CMD_STOP, DB_STAND_MOTION, NULL, now);
}

void station_finish_command(struct station *station, enum db_result result, db_time now)
{
	struct lane *lane = &station->lanes[LANE_COMMAND];

	if (!lane->active)
		return;
	note_motion_ended(station, result, now);
	if (result == DB_RESULT_REFUSED)
		station->snapshot.stats.refusals++;
	db_queued_finish(station->queued, result, now);
	station->queued = NULL;
	station->command_cancelled = false;
	station->command_ended = now;
	lane->active = false;
	lane->ready = false;
}

void station_abandon_command(struct station *station, const struct db_driver *driver,
                             enum db_result unless_known, db_time now)
{
	struct lane *lane = &station->lanes[LANE_COMMAND];
	struct db_conversation talk = station_conversation(station, LANE_COMMAND, now);
	enum db_result result;

	if (!lane->active)
		return;
	if (!lane->sent) {
		station_finish_command(station, unless_known, now);
		return;
	}
	/* The driver may want to read back; with the drive gone that is lost, too. */
	result = driver->lost(&talk) == DB_STEP_SEND ? DB_RESULT_INDETERMINATE : talk.result;
	if (result == DB_RESULT_TIMEOUT)
		result = unless_known;
	if (station->command_cancelled)
		result = DB_RESULT_CANCELLED;
	station_finish_command(station, result, now);
}
