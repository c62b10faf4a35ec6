/* SPDX-License-Identifier: Apache-2.0 */
#include "sched/learn.h"

/* This number of answers in a row proves a gap; this number of losses is a pattern when they are
 * more than one in three. */
#define PROVING_ANSWERS 4
#define TELLING_LOSSES 3
/* Old results count less and less. */
#define REMEMBERED 32

/* Another pause is as good as the gap when it is longer by at most this: the result would have been
 * the same. */
#define NEAR (1 * DB_NS_PER_MS)

/* The first step up from no gap at all. */
#define STEP (500 * DB_NS_PER_US)

#define A_MINUTE (60 * DB_NS_PER_S)
#define AN_HOUR (60 * A_MINUTE)
#define USELESS_PAUSE (10 * A_MINUTE)

/* Gaps and latencies are far below two seconds, by the ranges of their keys. */
static int32_t to_int32(db_time span)
{
	return span < INT32_MAX ? (int32_t)span : INT32_MAX;
}

static void count_up(uint8_t *counter)
{
	if (*counter < UINT8_MAX)
		++*counter;
}

/* --- gaps ------------------------------------------------------------------------------------- */

void learn_gap_init(struct learn_gap *gap, bool adapt, db_time begin, db_time least)
{
	*gap = (struct learn_gap){
		.begin = to_int32(begin),
		.least = to_int32(adapt ? db_time_min(begin, least) : begin),
		.most = to_int32(adapt ? db_time_max(begin, LEARN_GAP_MOST) : begin),
		.now = to_int32(begin),
		.peak = to_int32(begin),
		.lower_pause = A_MINUTE,
	};
	gap->sure = gap->most;
}

bool learn_gap_wants_test(const struct learn_gap *gap)
{
	return gap->sure > gap->now + NEAR;
}

/* The counts belong to the former gap. Those of answers in a row are 0: each caller begins them
 * again whether or not it gets here. */
static void set_gap(struct learn_gap *gap, db_time value)
{
	gap->now = to_int32(value);
	gap->received = gap->lost = gap->lost_later = 0;
}

void learn_gap_received(struct learn_gap *gap, db_time pause, db_time now)
{
	bool learnt = gap->now > gap->begin;
	db_time step;

	if (pause > gap->now + NEAR)
		return;
	count_up(&gap->received);
	if (gap->received + gap->lost > REMEMBERED) {
		gap->received /= 2;
		gap->lost /= 2;
		gap->lost_later /= 2;
	}
	count_up(&gap->received_in_row);
	gap->widest = to_int32(db_time_max(gap->widest, pause));
	if (gap->received_in_row < PROVING_ANSWERS)
		return;
	gap->sure = to_int32(db_time_min(gap->sure, gap->widest));
	gap->received_in_row = 0;
	gap->widest = 0;
	if (gap->now <= gap->least || now < gap->lower_at)
		return;
	/* A learnt value is lowered by a tenth per minute; a configured value is left in bigger
	 * steps, which cost nothing. */
	step = learnt ? db_time_max((gap->peak - gap->begin) / 10, 50 * DB_NS_PER_US) :
	                db_time_max(gap->now / 8, 10 * DB_NS_PER_US);
	set_gap(gap, db_time_max(gap->now - step, learnt ? gap->begin : gap->least));
	if (learnt)
		gap->lower_at = now + A_MINUTE;
}

enum learnt learn_gap_lost(struct learn_gap *gap, db_time pause, db_time now)
{
	if (pause > db_time_max(gap->most, LEARN_GAP_MOST) + NEAR) {
		count_up(&gap->lost_later);
		return LEARNT_NOTHING;
	}
	gap->received_in_row = 0;
	gap->widest = 0;
	if (pause >= gap->sure)
		gap->sure = gap->most;
	/* It was lowered too far, if anything: one loss is enough to raise it again, and each time
	 * it then stays longer. */
	if (gap->now < gap->begin || gap->now < gap->peak) {
		set_gap(gap, gap->now < gap->begin ? gap->begin : gap->peak);
		gap->lower_at = now + gap->lower_pause;
		gap->lower_pause = db_time_min(2 * gap->lower_pause, AN_HOUR);
		return LEARNT_BACK;
	}
	count_up(&gap->lost);
	if (gap->lost < TELLING_LOSSES || gap->lost * 3 <= gap->received ||
	    gap->lost_later * 2 >= gap->lost || now < gap->raise_at)
		return LEARNT_NOTHING;
	if (gap->now >= gap->most) {
		gap->raise_at = now + USELESS_PAUSE;
		gap->peak = gap->begin;
		set_gap(gap, gap->begin);
		gap->sure = gap->most;
		return LEARNT_NO_USE;
	}
	set_gap(gap, db_time_min(db_time_max(db_time_max(2 * (db_time)gap->now, pause + pause / 4),
	                                     STEP),
	                         gap->most));
	gap->peak = gap->now;
	gap->sure = gap->most;
	gap->lower_at = now + A_MINUTE;
	return LEARNT_MORE;
}

/* --- patience --------------------------------------------------------------------------------- */

/* The margin between the longest latency seen and the time-out. */
static db_time with_margin(db_time latency)
{
	return latency + latency * 3 / 10;
}

/* Two late answers within this time are a pattern. */
#define LATE_TIME (10 * DB_NS_PER_S)
#define TELLING_LATE 2

void learn_patience_init(struct learn_patience *patience, bool adapt, db_time begin)
{
	*patience = (struct learn_patience){
		.begin = to_int32(begin),
		.most = to_int32(adapt ? db_time_max(begin, with_margin(LEARN_LATE_MOST)) : begin),
		.now = to_int32(begin),
	};
}

void learn_patience_answered(struct learn_patience *patience, db_time latency, db_time now)
{
	db_time step;

	if (now - patience->since > 5 * A_MINUTE) {
		patience->before = patience->longest;
		patience->longest = 0;
		patience->since = now;
	}
	patience->longest = to_int32(db_time_max(patience->longest, latency));
	if (patience->now <= patience->begin || now < patience->lower_at)
		return;
	step = db_time_max((patience->now - patience->begin) / 10, DB_NS_PER_MS);
	patience->lower_at = now + A_MINUTE;
	/* Not below what its answers take. */
	patience->now = to_int32(db_time_max(
		db_time_max(patience->now - step, patience->begin),
		db_time_min(patience->now,
	                    with_margin(db_time_max(patience->longest, patience->before)))));
}

bool learn_patience_late(struct learn_patience *patience, db_time latency, db_time now)
{
	db_time wanted = db_time_min(with_margin(latency), patience->most);

	if (patience->late > 0 && now - patience->late_at > LATE_TIME)
		patience->late = 0;
	patience->late++;
	patience->late_at = now;
	patience->longest = to_int32(db_time_max(patience->longest, latency));
	/* An answer later than the longest possible time-out is not obtained by waiting longer. */
	if (patience->late < TELLING_LATE || wanted <= patience->now || latency >= patience->most)
		return false;
	patience->now = to_int32(wanted);
	patience->late = 0;
	patience->lower_at = now + A_MINUTE;
	return true;
}
