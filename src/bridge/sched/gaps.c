/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/sched_private.h"

/* --- learning --------------------------------------------------------------------------------- */

/* Pause between two tests of a drive's gap. */
#define PROOF_PAUSE (50 * DB_NS_PER_MS)

bool gaps_answered(struct db_engine *engine, struct node *node, db_time now)
{
	const struct flight *flight = &node->flight;

	if (exchange_overlaps(engine))
		return false;
	if (engine->last_to_answer == node)
		learn_gap_received(&node->gap, flight->pause, now);
	else if (engine->last_to_answer)
		learn_gap_received(&engine->last_to_answer->hold, flight->pause, now);
	if (flight->lane != LANE_POLL || now < node->test_gap_at ||
	    !learn_gap_wants_test(&node->gap))
		return false;
	node->test_gap_at = now + PROOF_PAUSE;
	return true;
}

static void report_gap(struct db_engine *engine, struct node *node, const struct learn_gap *gap,
                       enum learnt learnt)
{
	bool helps = learnt == LEARNT_MORE;
	const struct db_engine_timing timing = { .event = DB_EVENT_DRIVE_DEAF,
		                                 .others = gap == &node->hold,
		                                 .time = gap->begin,
		                                 .learnt = helps ? gap->now : 0 };

	/* If a larger gap does not help the others to receive better, that may be their own
	 * fault. */
	if (!helps && !(learnt == LEARNT_NO_USE && gap == &node->gap))
		return;
	if (!helps && !node->online)
		node->timing = DB_TROUBLE_DEAF;
	for (struct station *s = node->first; s; s = s->next_axis)
		engine_report_timing(engine, s, &timing);
}

/*
 * A loss after the node's own reply shows that it cannot receive so soon; after another's reply,
 * that the other drive occupies the line for longer. Where it may be either, it shows nothing.
 */
void gaps_lost(struct db_engine *engine, struct node *node, db_time now)
{
	const struct flight *flight = &node->flight;
	struct node *replier = engine->last_to_answer;
	struct learn_gap *gap = &node->gap;
	db_time own = flight->sent - node->answered_at;

	engine->tests_gap = false;
	/* A request that was answered otherwise was received. */
	if (exchange_overlaps(engine) || !replier || flight->got_unusable)
		return;
	if (replier == node || flight->pause > LEARN_GAP_MOST) {
		report_gap(engine, node, gap, learn_gap_lost(gap, own, now));
	} else if (flight->in_step && node->online && own > LEARN_GAP_MOST) {
		report_gap(engine, replier, &replier->hold,
		           learn_gap_lost(&replier->hold, flight->pause, now));
	}
}

/* --- waiting ---------------------------------------------------------------------------------- */

/* Not after unsolicited frames: a drive that sends all the time must not delay a stop. */
void gaps_keep_silence(struct db_engine *engine, struct node *node, bool proves, db_time now)
{
	/* Alone on the line it need not leave that to others. */
	bool alone = engine->node_count == 1 && !engine->scan;
	db_time pause = alone ? node->hold.least : node->hold.now;

	if (exchange_overlaps(engine))
		return;
	node->answered_at = now;
	engine->last_to_answer = node;
	engine->last_answer_at = now;
	engine->tests_gap = proves;
	engine->quiet_until = now + (proves && node->gap.now > pause ? node->gap.now : pause);
}

/*
 * A drive that misses the first byte of "12 stp" receives "2 stp". A line end first does not help:
 * of "\n12 stp" a drive may miss two bytes. So it must be sure to receive from the first byte on.
 */
db_time gaps_harmless_at(const struct db_engine *engine, unsigned address, const uint8_t *request,
                         size_t length, db_time now)
{
	const struct db_driver *driver = engine->driver;
	db_time at = now;

	if (!driver->mishears || engine->bus->line == DB_LINE_RS232)
		return now;
	for (size_t i = 0; i < engine->node_count; i++) {
		const struct node *node = engine->nodes[i];
		db_time receives = node->received_at + node->gap.sure;

		if (node->received_at != 0 && receives > at && node->address != address &&
		    driver->mishears(node->address, request, length))
			at = receives;
	}
	if (engine->foreign_address != 0 && engine->foreign_address != address &&
	    engine->foreign_received_at + LEARN_GAP_MOST > at &&
	    driver->mishears(engine->foreign_address, request, length))
		at = engine->foreign_received_at + LEARN_GAP_MOST;
	return at;
}

db_time gaps_over_at(const struct db_engine *engine, const struct node *node, db_time now)
{
	const struct node *replier = engine->last_to_answer;
	db_time at = now;

	for (size_t i = 0; i < engine->node_count; i++) {
		const struct node *one = engine->nodes[i];

		if (one->answered_at != 0 && (one == node || !node))
			at = db_time_max(at, one->answered_at + one->gap.sure);
	}
	if (replier && replier != node)
		at = db_time_max(at, engine->last_answer_at + replier->hold.sure);
	return at;
}
