/* SPDX-License-Identifier: Apache-2.0 */
/* Gaps and patience by themselves: bounds, what raises them and what brings them down again. */
#include "sched/learn.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define US DB_NS_PER_US
#define S DB_NS_PER_S

/* So many requests follow replies by the gap, a second apart, to a drive that hears after `deaf`. */
static db_time ask(struct learn_gap *gap, unsigned count, db_time deaf, db_time now)
{
	for (unsigned i = 0; i < count; i++, now += S) {
		if (gap->now >= deaf)
			learn_gap_received(gap, gap->now, now);
		else
			(void)learn_gap_lost(gap, gap->now, now);
	}
	return now;
}

static void a_gap_goes_up_to_what_is_heard(void **state)
{
	(void)state;
	for (db_time deaf = 1500 * US; deaf <= 8 * MS; deaf += 500 * US) {
		struct learn_gap gap;

		learn_gap_init(&gap, true, 1 * MS, 300 * US);
		(void)ask(&gap, 20, deaf, S);
		assert_in_range(gap.now, deaf, 2 * deaf);
		assert_int_equal(gap.sure, gap.now);
	}
}

static void a_gap_comes_down_by_a_tenth_a_minute(void **state)
{
	struct learn_gap gap;
	db_time now;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 300 * US);
	now = ask(&gap, 20, 4 * MS, S);
	assert_int_equal(gap.now, 4 * MS);
	now = ask(&gap, 62, 0, now);
	assert_int_equal(gap.now, 3700 * US);
	(void)ask(&gap, 1200, 0, now);
	assert_int_equal(gap.now, 300 * US);
}

static void a_gap_that_went_too_low_goes_back_at_once(void **state)
{
	struct learn_gap gap;
	db_time now;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 300 * US);
	now = ask(&gap, 60, 500 * US, S);
	assert_int_equal(gap.now, 1 * MS);
	/* It is left alone for a minute at least. */
	now = ask(&gap, 20, 0, now);
	assert_int_equal(gap.now, 1 * MS);
}

/* Each time it is left alone twice as long, an hour at most. */
static void a_gap_that_goes_too_low_again_and_again_is_tried_ever_less_often(void **state)
{
	struct learn_gap gap;
	db_time backs[16];
	unsigned count = 0;
	db_time pause = 60 * S;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 300 * US);
	for (db_time now = S; count < 10; now += S) {
		if (gap.now >= 500 * US)
			learn_gap_received(&gap, gap.now, now);
		else if (learn_gap_lost(&gap, gap.now, now) == LEARNT_BACK)
			backs[count++] = now;
	}
	/* Between two of them there is the pause, and the time in which it is lowered. */
	for (unsigned i = 1; i + 1 < count; i++) {
		db_time longer = (backs[i + 1] - backs[i]) - (backs[i] - backs[i - 1]);
		db_time next = 2 * pause < 3600 * S ? 2 * pause : 3600 * S;

		assert_in_range(longer, next - pause - (next > pause ? 15 * S : 0),
		                next - pause + 15 * S);
		pause = next;
	}
	assert_int_equal(pause, 3600 * S);
}

/* Number of requests after such a pause until it is sure that the drive receives them. */
static unsigned proving(struct learn_gap *gap, db_time pause)
{
	unsigned count = 0;

	while (gap->sure > pause) {
		assert_true(count++ < 100);
		learn_gap_received(gap, pause, S);
	}
	return count;
}

static void a_pause_is_sure_after_answers_in_a_row(void **state)
{
	struct learn_gap gap;
	unsigned count;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 1 * MS);
	count = proving(&gap, 1 * MS);
	assert_int_equal(count, 4);
	/* Another pause counts from the beginning. */
	assert_int_equal(proving(&gap, 500 * US), count);
	/* So does everything after a loss, which may come just before it was proven. */
	(void)learn_gap_lost(&gap, 1 * MS, S);
	assert_int_equal(gap.sure, gap.most);
	for (unsigned i = 1; i < count; i++)
		learn_gap_received(&gap, 1 * MS, S);
	assert_int_equal(gap.sure, gap.most);
	(void)learn_gap_lost(&gap, 1 * MS, S);
	assert_int_equal(proving(&gap, 1 * MS), count);
	/* A longer pause before a loss does not make what is proven after it longer. */
	(void)learn_gap_lost(&gap, 1 * MS, S);
	learn_gap_received(&gap, 1900 * US, S);
	(void)learn_gap_lost(&gap, 1 * MS, S);
	assert_int_equal(proving(&gap, 1 * MS), count);
}

/* What was received and lost with a shorter gap says nothing of the longer one. */
static void a_longer_gap_is_judged_by_itself(void **state)
{
	struct learn_gap gap;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 300 * US);
	for (db_time longer = 2 * MS; longer <= 8 * MS; longer *= 2) {
		assert_int_equal(learn_gap_lost(&gap, gap.now, S), LEARNT_NOTHING);
		assert_int_equal(learn_gap_lost(&gap, gap.now, S), LEARNT_NOTHING);
		assert_int_equal(learn_gap_lost(&gap, gap.now, S), LEARNT_MORE);
		assert_int_equal(gap.now, longer);
	}
}

/* Where the gap is already the shortest, one loss among five is chance, however often that is. */
static void losses_among_many_answers_are_chance(void **state)
{
	struct learn_gap gap;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 1 * MS);
	for (unsigned i = 0; i < 99; i++) {
		for (unsigned k = 0; k < 4; k++)
			learn_gap_received(&gap, 1 * MS, S);
		assert_int_equal(learn_gap_lost(&gap, 1 * MS, S), LEARNT_NOTHING);
	}
	assert_int_equal(gap.now, 1 * MS);
	/* Nor are three in a row behind a dozen answers more than one in three; with two more they are. */
	learn_gap_init(&gap, true, 1 * MS, 1 * MS);
	for (unsigned k = 0; k < 12; k++)
		learn_gap_received(&gap, 1 * MS, S);
	for (unsigned k = 0; k < 4; k++)
		assert_int_equal(learn_gap_lost(&gap, 1 * MS, S), LEARNT_NOTHING);
	assert_int_equal(learn_gap_lost(&gap, 1 * MS, S), LEARNT_MORE);
}

static void losses_that_a_gap_does_not_mend_leave_it(void **state)
{
	struct learn_gap gap;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 300 * US);
	(void)ask(&gap, 12, 20 * MS, S);
	assert_int_equal(gap.now, 1 * MS);
	(void)ask(&gap, 30, 20 * MS, 20 * S);
	assert_int_equal(gap.now, 1 * MS);
	assert_int_equal(gap.sure, LEARN_GAP_MOST);
}

static void losses_long_after_a_reply_say_nothing(void **state)
{
	struct learn_gap gap;

	(void)state;
	learn_gap_init(&gap, true, 1 * MS, 300 * US);
	for (unsigned i = 0; i < 30; i++) {
		assert_int_equal(learn_gap_lost(&gap, 1 * MS, (i + 1) * S), LEARNT_NOTHING);
		assert_int_equal(learn_gap_lost(&gap, 50 * MS, (i + 1) * S), LEARNT_NOTHING);
	}
	assert_int_equal(gap.now, 1 * MS);
}

static void what_is_configured_stays_where_nothing_is_to_be_learnt(void **state)
{
	struct learn_gap gap;
	struct learn_patience patience;

	(void)state;
	learn_gap_init(&gap, false, 1 * MS, 300 * US);
	learn_patience_init(&patience, false, 30 * MS);
	(void)ask(&gap, 50, 4 * MS, S);
	(void)ask(&gap, 50, 0, 100 * S);
	assert_int_equal(gap.now, 1 * MS);
	assert_int_equal(gap.sure, 1 * MS);
	assert_false(learn_patience_late(&patience, 40 * MS, S));
	assert_false(learn_patience_late(&patience, 40 * MS, S));
	assert_int_equal(patience.now, 30 * MS);
}

static void patience_grows_with_late_answers_and_comes_down(void **state)
{
	struct learn_patience patience;
	db_time now = S;

	(void)state;
	learn_patience_init(&patience, true, 30 * MS);
	assert_false(learn_patience_late(&patience, 37 * MS, now));
	assert_true(learn_patience_late(&patience, 37 * MS, now));
	assert_in_range(patience.now, 48 * MS, 49 * MS);
	/* As long as it answers like that. */
	for (unsigned i = 0; i < 3600; i++, now += S)
		learn_patience_answered(&patience, 37 * MS, now);
	assert_in_range(patience.now, 48 * MS, 49 * MS);
	for (unsigned i = 0; i < 3600; i++, now += S)
		learn_patience_answered(&patience, 1 * MS, now);
	assert_int_equal(patience.now, 30 * MS);
	/* One that is later than is ever waited for gains nothing. */
	assert_false(learn_patience_late(&patience, 90 * MS, now));
	assert_false(learn_patience_late(&patience, 90 * MS, now));
	assert_int_equal(patience.now, 30 * MS);
}

/* --- limits, to the nanosecond ---------------------------------------------------------------- */

#define NEAR (1 * MS)

static struct learn_gap new_gap(db_time begin, db_time least)
{
	struct learn_gap gap;

	learn_gap_init(&gap, true, begin, least);
	return gap;
}

/* The drive receives as many requests in a row, at this time, as prove the gap. */
static void prove(struct learn_gap *gap, db_time now)
{
	db_time pause = gap->now;

	for (unsigned i = 0; i < 4; i++)
		learn_gap_received(gap, pause, now);
}

static void a_pause_that_is_a_little_longer_is_as_good(void **state)
{
	struct learn_gap gap = new_gap(1 * MS, 300 * US);

	(void)state;
	gap.sure = (int32_t)(gap.now + NEAR);
	assert_false(learn_gap_wants_test(&gap));
	gap.sure++;
	assert_true(learn_gap_wants_test(&gap));
	learn_gap_received(&gap, gap.now + NEAR + 1, S);
	assert_int_equal(gap.received, 0);
	learn_gap_received(&gap, gap.now + NEAR, S);
	assert_int_equal(gap.received, 1);
	(void)learn_gap_lost(&gap, gap.most + NEAR + 1, S);
	assert_int_equal(gap.lost, 0);
	assert_int_equal(gap.lost_later, 1);
	(void)learn_gap_lost(&gap, gap.most + NEAR, S);
	assert_int_equal(gap.lost, 1);
	assert_int_equal(gap.lost_later, 1);
}

static void of_more_than_32_results_half_are_forgotten(void **state)
{
	struct learn_gap gap = new_gap(1 * MS, 1 * MS);

	(void)state;
	gap.received = 29;
	gap.lost = gap.lost_later = 2;
	learn_gap_received(&gap, gap.now, S);
	assert_int_equal(gap.received, 30);
	learn_gap_received(&gap, gap.now, S);
	assert_int_equal(gap.received, 15);
	assert_int_equal(gap.lost, 1);
	assert_int_equal(gap.lost_later, 1);
	gap.received = gap.lost = 0;
	gap.received_in_row = UINT8_MAX;
	gap.received = UINT8_MAX;
	learn_gap_received(&gap, gap.now, S);
	assert_int_equal(gap.received, UINT8_MAX / 2);
}

static void a_gap_comes_down_in_steps(void **state)
{
	struct learn_gap gap = new_gap(1 * MS, 0);

	(void)state;
	gap.lower_at = 5 * S;
	prove(&gap, 5 * S - 1);
	assert_int_equal(gap.now, 1 * MS);
	prove(&gap, 5 * S);
	assert_int_equal(gap.now, 875 * US);
	gap = new_gap(40 * US, 0);
	prove(&gap, S);
	assert_int_equal(gap.now, 30 * US);
	gap = new_gap(1 * MS, 0);
	gap.now = gap.peak = 1300 * US;
	prove(&gap, S);
	assert_int_equal(gap.now, 1250 * US);
	assert_int_equal(gap.lower_at, 61 * S);
}

static void a_gap_goes_back_to_what_was_learnt(void **state)
{
	struct learn_gap gap = new_gap(1 * MS, 0);

	(void)state;
	gap.peak = 4 * MS;
	gap.now = 3700 * US;
	assert_int_equal(learn_gap_lost(&gap, gap.now, S), LEARNT_BACK);
	assert_int_equal(gap.now, 4 * MS);
	gap.now = 1 * MS;
	assert_int_equal(learn_gap_lost(&gap, gap.now, S), LEARNT_BACK);
	assert_int_equal(gap.now, 4 * MS);
	gap.now = 999 * US;
	assert_int_equal(learn_gap_lost(&gap, gap.now, S), LEARNT_BACK);
	assert_int_equal(gap.now, 1 * MS);
}

static void a_gap_goes_up_to_more_than_the_pause_of_the_losses(void **state)
{
	struct learn_gap gap = new_gap(1 * MS, 0);

	(void)state;
	/* Half of the losses came after pauses longer than any gap. */
	gap.lost = 3;
	gap.lost_later = 2;
	assert_int_equal(learn_gap_lost(&gap, gap.now, S), LEARNT_NOTHING);
	gap.lost = 2;
	gap.lost_later = 1;
	gap.raise_at = S + 1;
	assert_int_equal(learn_gap_lost(&gap, 4 * MS, S), LEARNT_NOTHING);
	gap.lost = 2;
	gap.sure = 5 * MS;
	gap.raise_at = S;
	assert_int_equal(learn_gap_lost(&gap, 4 * MS, S), LEARNT_MORE);
	assert_int_equal(gap.now, 5 * MS);
	assert_int_equal(gap.sure, gap.most);
	assert_int_equal(gap.lower_at, 61 * S);
	gap.now = gap.peak = gap.most;
	gap.lost = 2;
	gap.sure = gap.most - 1;
	assert_int_equal(learn_gap_lost(&gap, 4 * MS, S), LEARNT_NO_USE);
	assert_int_equal(gap.sure, gap.most);
}

static void patience_comes_down_by_a_tenth_a_minute(void **state)
{
	struct learn_patience patience;

	(void)state;
	learn_patience_init(&patience, true, 30 * MS);
	patience.since = S;
	patience.now = 50 * MS;
	patience.lower_at = 10 * S;
	learn_patience_answered(&patience, 0, 10 * S - 1);
	assert_int_equal(patience.now, 50 * MS);
	learn_patience_answered(&patience, 0, 10 * S);
	assert_int_equal(patience.now, 48 * MS);
	assert_int_equal(patience.lower_at, 70 * S);
	patience.now = 31 * MS;
	learn_patience_answered(&patience, 0, 70 * S);
	assert_int_equal(patience.now, 30 * MS);
}

static void the_longest_latency_is_remembered_for_five_to_ten_minutes(void **state)
{
	struct learn_patience patience;

	(void)state;
	learn_patience_init(&patience, true, 30 * MS);
	patience.since = 10 * S;
	patience.longest = 20 * MS;
	learn_patience_answered(&patience, 5 * MS, 310 * S);
	assert_int_equal(patience.longest, 20 * MS);
	assert_int_equal(patience.before, 0);
	learn_patience_answered(&patience, 5 * MS, 310 * S + 1);
	assert_int_equal(patience.longest, 5 * MS);
	assert_int_equal(patience.before, 20 * MS);
	learn_patience_answered(&patience, 6 * MS, 610 * S);
	assert_int_equal(patience.before, 20 * MS);
	(void)learn_patience_late(&patience, 40 * MS, 610 * S);
	assert_int_equal(patience.longest, 40 * MS);
}

static void two_late_answers_within_ten_seconds_are_a_pattern(void **state)
{
	struct learn_patience patience;

	(void)state;
	learn_patience_init(&patience, true, 30 * MS);
	assert_false(learn_patience_late(&patience, 40 * MS, 10 * S));
	assert_false(learn_patience_late(&patience, 40 * MS, 20 * S + 1));
	assert_true(learn_patience_late(&patience, 40 * MS, 30 * S + 1));
	assert_int_equal(patience.now, 52 * MS);
	assert_int_equal(patience.lower_at, 90 * S + 1);
	/* The next pattern needs two late answers again. */
	assert_false(learn_patience_late(&patience, 41 * MS, 31 * S));
	/* A latency that the timeout covers already does not raise it, nor does one as long as the
	 * longest timeout, which waiting longer cannot reach. */
	assert_false(learn_patience_late(&patience, 40 * MS, 31 * S));
	assert_false(learn_patience_late(&patience, patience.most, 31 * S));
	assert_true(learn_patience_late(&patience, patience.most - 1, 31 * S));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_gap_goes_up_to_what_is_heard),
		cmocka_unit_test(a_gap_comes_down_by_a_tenth_a_minute),
		cmocka_unit_test(a_gap_that_went_too_low_goes_back_at_once),
		cmocka_unit_test(a_gap_that_goes_too_low_again_and_again_is_tried_ever_less_often),
		cmocka_unit_test(a_pause_is_sure_after_answers_in_a_row),
		cmocka_unit_test(a_longer_gap_is_judged_by_itself),
		cmocka_unit_test(losses_among_many_answers_are_chance),
		cmocka_unit_test(losses_that_a_gap_does_not_mend_leave_it),
		cmocka_unit_test(losses_long_after_a_reply_say_nothing),
		cmocka_unit_test(what_is_configured_stays_where_nothing_is_to_be_learnt),
		cmocka_unit_test(patience_grows_with_late_answers_and_comes_down),
		cmocka_unit_test(a_pause_that_is_a_little_longer_is_as_good),
		cmocka_unit_test(of_more_than_32_results_half_are_forgotten),
		cmocka_unit_test(a_gap_comes_down_in_steps),
		cmocka_unit_test(a_gap_goes_back_to_what_was_learnt),
		cmocka_unit_test(a_gap_goes_up_to_more_than_the_pause_of_the_losses),
		cmocka_unit_test(patience_comes_down_by_a_tenth_a_minute),
		cmocka_unit_test(the_longest_latency_is_remembered_for_five_to_ten_minutes),
		cmocka_unit_test(two_late_answers_within_ten_seconds_are_a_pattern),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
