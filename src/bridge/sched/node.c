/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

#include <stdlib.h>

/* Length of a silent line, in half characters. */
#define QUIET_HALF_CHARACTERS 7

struct node *node_new(const struct db_bus_config *bus, unsigned address)
{
	struct node *node = calloc(1, sizeof(*node));
	bool serial;
	db_time turnaround;
	db_time quiet;

	if (!node)
		return NULL;
	node->address = address;
	node->probe_backoff = PROBE_BACKOFF_MIN;
	node->free_probes = 1;
	node->share = DB_SHARE_STANDING;
	node->late_answer_time = LATE_ANSWER_LATENCIES * (db_time)bus->drive_latency_ms *
	                         DB_NS_PER_MS;
	serial = bus->driver->medium == DB_MEDIUM_SERIAL;
	turnaround = (db_time)bus->turnaround_us * DB_NS_PER_US;
	quiet = serial ? bus->transport->wire_time(bus, NULL, 0, QUIET_HALF_CHARACTERS) / 2 : 0;
	/* Drives on CAN receive while they send. */
	learn_gap_init(&node->gap, bus->adapt && serial, turnaround, quiet);
	learn_gap_init(&node->hold, bus->adapt && serial, turnaround, quiet);
	learn_patience_init(&node->patience, bus->adapt,
	                    (db_time)bus->drive_latency_ms * DB_NS_PER_MS);
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
	/* Whichever probe it answers, the others may still be answered. */
	node->late_probes_until = now + node->late_answer_time;
	return false;
}

/* Weight of a new value in an average. */
#define AVERAGE_PART 8

static db_time average(db_time mean, db_time value)
{
	return mean == 0 ? value : mean + (value - mean) / AVERAGE_PART;
}

void node_end_poll(struct node *node, bool answered, db_time now)
{
	if (answered) {
		node->poll_cost = average(node->poll_cost, node->spent);
		node->poll_duration = average(node->poll_duration,
		                              now - node->first->lanes[LANE_POLL].job.started);
	}
	node->used += node->spent;
	node->spent = 0;
}

void node_answered(struct node *node, bool in_time, db_time now)
{
	const struct flight *flight = &node->flight;
	const struct lane *lane = &flight->station->lanes[flight->lane];
	db_time latency = now - (flight->deadline - flight->patience);

	/* An answer without a known length is awaited as long as bytes arrive. */
	if (!lane->exchange.open_ended && in_time)
		learn_patience_answered(&node->patience, latency > 0 ? latency : 0, now);
	node->answered_at = now;
	node->lost_due = 0;
}

db_time node_latency_of_late_answer(const struct node *node, db_time now)
{
	db_time latency = now - node->lost_due;

	return node->lost_due == 0 || latency > node->late_answer_time ? 0 : latency;
}
