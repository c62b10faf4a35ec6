/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include <stdlib.h>

struct station *station_new(const struct db_bus_config *bus, const struct db_bus_drive *drive)
{
	size_t set = DB_PARAM_WORDS(bus->driver->param_count);
	struct station *station = calloc(1, sizeof(*station) + set * sizeof(station->missing[0]));

	if (!station)
		return NULL;
	station->number = drive->drive;
	station->config = drive->config;
	station->axis = drive->axis;
	station->stops_others = bus->driver->axes > 1;
	station->device = calloc(1, bus->driver->device_size);
	station->spare = node_new(bus, drive->config->address);
	if (!station->device || !station->spare) {
		station_free(station);
		return NULL;
	}
	for (size_t i = 0; i < LANE_COMMAND; i++) {
		struct db_exchange *exchange = &station->lanes[i].exchange;

		exchange->request = station->requests[i];
		exchange->request_size = sizeof(station->requests[i]);
	}
	return station;
}

void station_free(struct station *station)
{
	if (!station)
		return;
	/* When it is at no node, it was settled at the parting which of the two has the head, which
	 * gcc's analyzer does not see. */
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

/* Until it was seen standing, the drive does not count as at a standstill, whatever it reports. */
static void show_standing(const struct standing *standing, struct db_feedback *feedback)
{
	if (feedback->state != DB_AXIS_ERROR_STOP && feedback->state != DB_AXIS_DISABLED) {
		feedback->state = DB_AXIS_STOPPING;
		feedback->status |= DB_STATUS_STOPPING;
	}
	if (standing->overdue) {
		feedback->status |= DB_STATUS_ERROR;
		feedback->error = DB_ERROR_RUNS_ON;
	}
}

static void judge_trouble(struct station *station, const struct bus_state *bus)
{
	const struct node *node = station->node;
	struct db_trouble *trouble = &station->snapshot.trouble;
	const struct db_trouble_signs signs = {
		.silence = node->unusable.count > 0 ? DB_TROUBLE_NOT_UNDERSTOOD : node->timing,
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

/* Values learnt upwards take precedence over those learnt downwards. */
static struct db_learnt learnt_values(const struct node *node)
{
	bool down = node->gap.now <= node->gap.begin && node->hold.now <= node->hold.begin;
	db_time begin = node->gap.begin;
	bool own = down == (node->gap.now < node->hold.now);
	db_time gap = own ? node->gap.now : node->hold.now;
	db_time us;

	us = gap / DB_NS_PER_US;
	return (struct db_learnt){
		.gap_us = gap == begin    ? 0 :
		          us > UINT16_MAX ? UINT16_MAX :
		                            (uint16_t)us,
		.latency_ms = node->patience.now == node->patience.begin ?
		                      0 :
		                      (uint16_t)((node->patience.now + DB_NS_PER_MS - 1) /
		                                 DB_NS_PER_MS),
	};
}

void station_publish(struct station *station, const struct db_driver *driver,
                     const struct bus_state *bus)
{
	struct db_feedback *feedback = &station->snapshot.feedback;
	const struct db_nameplate *plate = driver->nameplate ? driver->nameplate(station->device) :
	                                                       NULL;
	db_time before = feedback->taken;
	uint64_t wall_us = feedback->taken_wall_us;
	const struct standing *standing = &station->standing;
	bool online;

	/* First the nameplate: a reader that sees it marked as valid in the snapshot must find the
	 * new one. */
	if (plate && (!station->plate_published || plate->generation != station->generation ||
	              plate->tellings != station->tellings)) {
		db_axis_publish_nameplate(station->axis, plate);
		station->generation = plate->generation;
		station->tellings = plate->tellings;
		station->plate_published = true;
	}
	driver->feedback(station->device, feedback);
	/* Convert to wall time once per sample: a later conversion would differ (the clock drifts
	 * or is set), and a changed timestamp would pass for new data. */
	if (feedback->taken != before) {
		station->snapshot.stats.samples++;
		wall_us = feedback->taken == 0 ?
		                  0 :
		                  (uint64_t)(feedback->taken / DB_NS_PER_US + bus->wall_offset_us);
	}
	feedback->taken_wall_us = wall_us;
	station->snapshot.stats.poll_interval_us = db_time_us32(bus->interval);
	if (bus->up)
		feedback->status |= DB_STATUS_BUS_UP;
	station->snapshot.must_stand = (struct db_must_stand){
		.cause = (uint8_t)standing->cause,
		.command = (uint8_t)standing->kind,
		.since = standing->since,
		.count = standing->count,
		.seen = standing_is_seen_still(standing),
	};
	/* A drive that is back shows as online with its first status, not with old data. */
	online = station->node->online && feedback->state != DB_AXIS_OFFLINE;
	if (online) {
		feedback->status |= DB_STATUS_ONLINE;
	} else {
		feedback->status &= DB_STATUS_BUS_UP;
		feedback->state = DB_AXIS_OFFLINE;
		feedback->error = bus->up ? DB_ERROR_NO_ANSWER : DB_ERROR_BUS_DOWN;
	}
	if (!standing_is_free(standing))
		feedback->status |= DB_STATUS_MUST_STAND;
	if (!standing_is_free(standing) && online)
		show_standing(standing, feedback);
	judge_trouble(station, bus);
	station->snapshot.learnt = learnt_values(station->node);
	db_axis_publish(station->axis, &station->snapshot);
}

void station_count_answer(struct station *station, db_time round_trip, bool in_time)
{
	struct db_axis_stats *stats = &station->snapshot.stats;
	uint32_t us = db_time_us32(round_trip);

	stats->answers++;
	if (!in_time)
		return;
	stats->round_trip_us = us;
	if (us > stats->round_trip_max_us)
		stats->round_trip_max_us = us;
	if (station->round_trips == 0 || us < stats->round_trip_min_us)
		stats->round_trip_min_us = us;
	/* Not divided by stats->answers, which begins again from 0 after 2^32. */
	station->round_trips++;
	station->round_trip_sum_us += us;
	stats->round_trip_mean_us = (uint32_t)(station->round_trip_sum_us / station->round_trips);
	stats->round_trips = (uint32_t)station->round_trips;
	stats->round_trip_sum_us = (uint32_t)station->round_trip_sum_us;
}

/* --- stops ------------------------------------------------------------------------------------ */

static void must_stand(struct station *station, enum db_command command, enum db_stand_cause cause,
                       const struct db_feedback *known, db_time now)
{
	standing_enter(&station->standing, command, cause, known, now);
	if (station->stops_others)
		standing_owe(&station->standing, command);
}

void station_add_stop(struct station *station, enum db_command command, enum db_stand_cause cause,
                      struct db_request *request, db_time now)
{
	const struct db_feedback *feedback = &station->snapshot.feedback;
	bool known = (feedback->status & DB_STATUS_ONLINE) && station->node->in_step &&
	             !station->lanes[LANE_COMMAND].active &&
	             feedback->taken > station->command_ended;

	must_stand(station, command, cause, known ? feedback : NULL, now);
	if (!request)
		return;
	station->stop_follows = false;
	/* The number of requests is limited where they are posted. */
	if (station->stop_count == DB_QUEUE_STOPS_EACH) {
		db_queue_finish(request, DB_RESULT_FAILED, now);
		return;
	}
	station->stops[station->stop_count++] = (struct stop_waiter){
		.request = request,
		.command = command,
	};
}

void station_stop_sent(struct station *station, bool trusted, db_time now)
{
	db_time round_trip = (db_time)station->snapshot.stats.round_trip_us * DB_NS_PER_US;

	standing_stop_sent(&station->standing, trusted, round_trip, now);
	for (unsigned i = 0; i < station->stop_count; i++)
		db_queue_note_sent(station->stops[i].request, now);
}

static void finish_stop(struct station *station, struct db_request *request, enum db_result result,
                        db_time now)
{
	station->stop_follows |= atomic_load_explicit(&request->stop_follows, memory_order_acquire);
	db_queue_finish(request, result, now);
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
			finish_stop(station, stop->request, result, now);
		else
			station->stops[kept++] = *stop;
	}
	station->stop_count = kept;
}

bool station_has_open_stop(const struct station *station)
{
	return station->stop_count > 0 || standing_is_open(&station->standing);
}

bool station_awaits_stop(const struct station *station)
{
	return station->stop_count > 0 || station->stop_follows ||
	       (standing_is_open(&station->standing) && !station->standing.overdue);
}

/* How long a drive may take to begin a motion that was sent just before the stop. */
#define DOUBT_TIME (100 * DB_NS_PER_MS)

struct standing_rules station_rules(const struct station *station, const struct db_driver *driver,
                                    db_time now)
{
	/* Of a stop that was only sent out of step it is not known whether the drive received
	 * it. */
	bool acknowledged = driver->acknowledges && station->standing.acknowledged;
	bool doubtful = !acknowledged && (now - station->motion_sent < DOUBT_TIME ||
	                                  (station->snapshot.feedback.status & DB_STATUS_HOMING));
	db_time patience = (db_time)station->config->stop_reaction_ms * DB_NS_PER_MS;
	bool computed = station->snapshot.feedback.velocity_is_computed;

	return (struct standing_rules){
		.patience = computed ? db_time_max(patience, STANDING_PATIENCE_COMPUTED) : patience,
		.computed = computed,
		.doubt = doubtful ? DOUBT_TIME : 0,
	};
}

void station_drop_stops(struct station *station, db_time now)
{
	bool sent = station->standing.sent_at != 0 || station->standing.interrupted;
	enum db_result result = sent ? DB_RESULT_INDETERMINATE : DB_RESULT_CANCELLED;

	for (unsigned i = 0; i < station->stop_count; i++)
		finish_stop(station, station->stops[i].request, result, now);
	station->stop_count = 0;
}

/* --- what it does ----------------------------------------------------------------------------- */

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

void station_settle_write(struct station *station, const struct db_driver *driver, db_time now)
{
	const struct lane *lane = &station->lanes[LANE_COMMAND];
	struct db_conversation talk = station_conversation(station, LANE_COMMAND, now);

	/* Nothing follows: the next exchange after lost() is never sent. */
	if (lane->active && lane->sent && lane->job.kind == DB_JOB_SETTINGS &&
	    driver->joins_settings)
		(void)driver->lost(&talk);
}

void station_cancel_command(struct station *station, const struct db_driver *driver, db_time now)
{
	const struct flight *flight = &station->node->flight;

	if (flight->station == station && flight->lane == LANE_COMMAND) {
		station->command_cancelled = true;
		return;
	}
	station_settle_write(station, driver, now);
	station_finish_command(station, DB_RESULT_CANCELLED, now);
}

void station_finish_command(struct station *station, enum db_result result, db_time now)
{
	struct lane *lane = &station->lanes[LANE_COMMAND];
	enum db_command command = lane->active && lane->job.kind == DB_JOB_COMMAND ?
	                                  lane->job.request->command :
	                                  DB_CMD_NONE;

	if (!lane->active)
		return;
	/* A motion that the drive accepted ends its record of having to stand. A motion answered as
	 * failed might begin all the same, and must not; a program of a controller moves other axes
	 * than the one that it was started at. */
	if (standing_gives_way_to(&station->standing, command))
		standing_motion_ended(&station->standing, db_result_is_success(result), now);
	else if (command == DB_CMD_ENABLE && db_result_is_success(result) &&
	         !station->command_cancelled)
		standing_drive_enabled(&station->standing);
	if (result == DB_RESULT_FAILED && lane->sent && db_command_is_motion(command))
		must_stand(station, DB_CMD_STOP, DB_STAND_MOTION, NULL, now);
	if (result == DB_RESULT_REFUSED)
		station->snapshot.stats.refusals++;
	db_queue_finish(station->request, result, now);
	station->request = NULL;
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
