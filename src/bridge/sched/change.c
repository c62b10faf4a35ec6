/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/change.h"

#include "sched/sched_private.h"

#include <stdlib.h>
#include <string.h>

/* --- making ----------------------------------------------------------------------------------- */

struct db_change *change_new(const struct db_bus_config *bus, size_t present,
                             const uint16_t *leaving, size_t leaving_count,
                             const struct db_bus_drive *coming, size_t coming_count)
{
	struct db_change *change = calloc(1, sizeof(*change));
	size_t room = present + coming_count;

	if (!change)
		return NULL;
	change->leaving_count = leaving_count;
	change->coming_count = coming_count;
	/* One more of each than needed, so that no allocation has size 0. */
	change->leaving = calloc(leaving_count + 1, sizeof(change->leaving[0]));
	change->removed = calloc(leaving_count + 1, sizeof(struct station *));
	change->coming = calloc(coming_count + 1, sizeof(struct station *));
	change->stations = calloc(room + 1, sizeof(struct station *));
	change->nodes = calloc(room + 1, sizeof(struct node *));
	if (!change->leaving || !change->removed || !change->coming || !change->stations ||
	    !change->nodes)
		goto failed;
	for (size_t i = 0; i < leaving_count; i++)
		change->leaving[i] = leaving[i];
	for (size_t i = 0; i < coming_count; i++) {
		change->coming[i] = station_new(bus, &coming[i]);
		if (!change->coming[i])
			goto failed;
	}
	return change;
failed:
	change_free(change);
	return NULL;
}

void change_free(struct db_change *change)
{
	if (!change)
		return;
	for (size_t i = 0; i < change->removed_count; i++)
		station_free(change->removed[i]);
	for (size_t i = 0; change->coming && i < change->coming_count; i++)
		station_free(change->coming[i]);
	free(change->leaving);
	free(change->removed);
	free(change->coming);
	free(change->stations);
	free(change->nodes);
	free(change);
}

/* --- removing --------------------------------------------------------------------------------- */

void change_begin(struct db_engine *engine, struct db_change *change, db_time now)
{
	engine->change = change;
	change->leave_by = now + DB_EXIT_TIME;
	for (size_t i = 0; i < change->leaving_count && !engine->shutting_down; i++) {
		struct station *station = engine_find_station(engine, change->leaving[i]);

		if (station) {
			enum db_command command = db_on_loss_command(station->config->on_exit);
			/* A controller's stop is for all of its axes: an axis that stands leaves
			 * without disturbing the others. */
			bool stop = command == DB_CMD_DISABLE || !station->node->first->next_axis ||
			            !station_is_seen_to_stand(station);

			station->leaving = true;
			engine_finish_waiting_requests(engine, station, DB_RESULT_CANCELLED, now);
			station_cancel_command(station, engine->driver, now);
			if (stop && command != DB_CMD_NONE)
				engine_add_stop(engine, station, command, DB_STAND_EXIT, NULL, now);
		}
	}
}

struct db_change *change_fetch(struct db_engine *engine)
{
	struct db_change *changed = engine->changed;

	engine->changed = NULL;
	return changed;
}

/* True if nothing of it is on the wire, and no reading for others goes through it. */
static bool may_be_removed(const struct db_engine *engine, const struct station *station,
                           db_time now)
{
	const struct node *node = station->node;

	if (!engine->stats.up)
		return true;
	if (node->flight.station == station)
		return false;
	if (node->first->next_axis && node->first->lanes[LANE_POLL].active)
		return false;
	return !station_has_open_stop(station) || now >= engine->change->leave_by;
}

/* Round robin continues where it was when an entry before that place is removed. */
static void close_gap(size_t *next, size_t index, size_t count)
{
	*next %= count;
	if (*next > index)
		(*next)--;
}

static void remove_station(struct db_engine *engine, size_t index, db_time now)
{
	struct db_change *change = engine->change;
	struct station *station = engine->stations[index];
	struct node *node = station->node;

	engine_finish_waiting_requests(engine, station, DB_RESULT_CANCELLED, now);
	station_finish_command(station, DB_RESULT_CANCELLED, now);
	engine_report_unconfirmed(engine, station);
	station_drop_stops(station, now);
	if (node->online)
		engine->stats.online--;
	/* The last drive of a node takes it along. */
	if (station_part(station, engine->driver)) {
		size_t place = 0;

		for (size_t i = 0; i < change->coming_count; i++) {
			if (change->coming[i]->spare->address == node->address)
				node_inherit_late_answers(change->coming[i]->spare, node);
		}
		while (engine->nodes[place] != node)
			place++;
		close_gap(&engine->next_poll, place, engine->node_count);
		close_gap(&engine->next_probe, place, engine->node_count);
		engine_end_read(engine, node, engine->now);
		if (engine->last_to_answer == node)
			engine->last_to_answer = NULL;
		engine->node_count--;
		memmove(&engine->nodes[place], &engine->nodes[place + 1],
		        (engine->node_count - place) * sizeof(struct node *));
	}
	close_gap(&engine->next_command, index, engine->station_count);
	close_gap(&engine->next_stop, index, engine->station_count);
	close_gap(&engine->next_identify, index, engine->station_count);
	close_gap(&engine->next_refresh, index, engine->station_count);
	engine->station_count--;
	memmove(&engine->stations[index], &engine->stations[index + 1],
	        (engine->station_count - index) * sizeof(struct station *));
	change->removed[change->removed_count++] = station;
}

/* --- adding ----------------------------------------------------------------------------------- */

static void add_stations(struct db_engine *engine, struct db_change *change, db_time now)
{
	struct station **stations = engine->stations;
	struct node **nodes = engine->nodes;

	/* Swap arrays: the engine takes the larger ones, the change frees the old ones. */
	if (engine->station_count > 0)
		memcpy(change->stations, stations, engine->station_count * sizeof(stations[0]));
	if (engine->node_count > 0)
		memcpy(change->nodes, nodes, engine->node_count * sizeof(nodes[0]));
	engine->stations = change->stations;
	engine->nodes = change->nodes;
	change->stations = stations;
	change->nodes = nodes;
	/* Round robin stays within the former number, so that new drives are not served first. */
	if (engine->station_count > 0 && engine->node_count > 0) {
		engine->next_poll %= engine->node_count;
		engine->next_probe %= engine->node_count;
		engine->next_command %= engine->station_count;
		engine->next_stop %= engine->station_count;
		engine->next_identify %= engine->station_count;
		engine->next_refresh %= engine->station_count;
	}
	for (size_t i = 0; i < change->coming_count; i++) {
		struct station *station = change->coming[i];
		struct node *node = engine_find_node(engine, station->spare->address);

		change->coming[i] = NULL;
		engine->stations[engine->station_count++] = station;
		/* The first drive at an address brings its node. */
		if (!node) {
			node = station->spare;
			station->spare = NULL;
			engine->nodes[engine->node_count++] = node;
		}
		station_join(station, node, engine->bus);
		if (station->node->online)
			engine_count_online(engine, station, now);
		engine_publish(engine, station);
	}
}

void change_carry_out(struct db_engine *engine, db_time now)
{
	struct db_change *change = engine->change;
	bool waits = false;

	/* What happens to every drive now is the same as for those that leave. */
	if (engine->shutting_down)
		return;
	for (size_t i = engine->station_count; i-- > 0;) {
		const struct station *station = engine->stations[i];

		if (!station->leaving)
			continue;
		if (may_be_removed(engine, station, now))
			remove_station(engine, i, now);
		else
			waits = true;
	}
	if (waits)
		return;
	add_stations(engine, change, now);
	engine->change = NULL;
	engine->changed = change;
}
