/* SPDX-License-Identifier: Apache-2.0 */
/* The record of a drive that must stand: how it is entered, what is sent, what counts as evidence, how it is left. */
#include "sched/standing.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define T (1000 * DB_NS_PER_S)

static const struct standing_rules rules = { .patience = 500 * MS };

static struct db_feedback sample(float velocity, bool moving)
{
	return (struct db_feedback){
		.velocity = velocity,
		.status = DB_STATUS_ONLINE | (moving ? DB_STATUS_MOVING : 0),
	};
}

static enum standing_verdict judge(struct standing *standing, float velocity, bool moving,
                                   db_time asked)
{
	struct db_feedback feedback = sample(velocity, moving);

	return standing_judge(standing, &rules, &feedback, asked, asked + 1 * MS);
}

/* Entered for a drive that was seen to do this, and sent. */
static struct standing entered(float velocity, bool moving)
{
	struct db_feedback feedback = sample(velocity, moving);
	struct standing standing = { .kind = DB_CMD_NONE };

	standing_enter(&standing, DB_CMD_STOP, DB_STAND_CLIENT, &feedback, T);
	assert_true(standing_send_at(&standing) <= T);
	standing_stop_sent(&standing, true, 2 * MS, T);
	return standing;
}

/* A stop is said again when a sample behind it has come, or none for 100 ms: after 20 ms at first, later after 100, and
 * later on a slow line. */
static void a_stop_is_said_again_at_its_pace(void **state)
{
	static const struct {
		db_time after; /* since the record was opened */
		db_time round_trip;
		db_time pause;
	} cases[] = {
		{ 0, 2 * MS, 20 * MS },
		{ 0, 30 * MS, 60 * MS },
		{ 1000 * MS - 1, 2 * MS, 20 * MS },
		{ 1000 * MS, 2 * MS, 100 * MS },
		{ 5000 * MS, 30 * MS, 150 * MS },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct standing standing = entered(1000, true);
		db_time now = T + cases[i].after;

		standing_stop_sent(&standing, true, cases[i].round_trip, now);
		assert_int_equal(standing.count, 2);
		assert_false(standing.read_since);
		assert_int_equal(standing.send_at, now + cases[i].pause);
		assert_int_equal(standing_send_at(&standing),
		                 now + (cases[i].pause > 100 * MS ? cases[i].pause : 100 * MS));
		standing.read_since = true;
		assert_int_equal(standing_send_at(&standing), now + cases[i].pause);
	}
}

/* What was sent out of step is asked about first: no sample is waited for, and no pace begins. */
static void a_stop_that_may_not_have_arrived_has_no_pace(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_stop_sent(&standing, false, 2 * MS, T + 10 * MS);
	assert_true(standing.read_since);
	assert_int_equal(standing.sent_at, T + 10 * MS);
	assert_int_equal(standing.send_at, T + 20 * MS);
}

/* It is read soon after its answer, and until then the stop is not said again. */
static void a_drive_is_read_behind_the_answer_to_its_stop(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 3 * MS);
	assert_int_equal(standing.read_at, T + 8 * MS);
	assert_int_equal(standing_send_at(&standing), T + 103 * MS);
	/* Nothing was said since it has to stand for another cause as well. */
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_WATCHDOG, NULL, T + 4 * MS);
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 5 * MS);
	assert_false(standing.acknowledged);
	assert_int_equal(standing_send_at(&standing), T + 4 * MS);
}

static void only_what_was_asked_after_the_stop_counts(void **state)
{
	struct standing standing = entered(0, false);

	(void)state;
	assert_int_equal(judge(&standing, 0, false, T - 1), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 0, false, T), STANDING_UNSEEN);
	assert_false(standing_is_free(&standing));
	assert_int_equal(judge(&standing, 0, false, T + 1), STANDING_DONE);
	assert_true(standing_is_free(&standing));
}

static void what_is_known_of_an_offline_drive_is_no_evidence(void **state)
{
	struct standing standing = entered(0, false);
	struct db_feedback feedback = { .status = DB_STATUS_BUS_UP };

	(void)state;
	assert_int_equal(standing_judge(&standing, &rules, &feedback, T + MS, T + MS),
	                 STANDING_UNSEEN);
	assert_false(standing_is_free(&standing));
}

static void a_drive_that_moved_is_seen_to_stand_twice(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 60 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 115 * MS), STANDING_DONE);
}

/* It had slowed down for the first stop, then a motion began, and the second stop is lost: it is slower than it was,
 * and gets faster. */
static void a_second_cause_is_judged_by_what_follows(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	assert_int_equal(judge(&standing, 500, true, T + 10 * MS), STANDING_OBEYS);
	standing.gives_way = true;
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T + 20 * MS);
	standing_stop_sent(&standing, true, 2 * MS, T + 20 * MS);
	assert_int_equal(judge(&standing, 600, true, T + 30 * MS), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 700, true, T + 40 * MS), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 600, true, T + 50 * MS), STANDING_OBEYS);
}

static void asking_again_does_not_hurry_a_drive_that_does_not_answer(void **state)
{
	struct standing standing = entered(1000, true);
	db_time at;

	(void)state;
	for (unsigned i = 0; i < 5; i++)
		(void)standing_stop_lost(&standing, false, 2, 20 * MS, T + 20 * MS);
	at = standing_send_at(&standing);
	assert_true(at >= T + 100 * MS);
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_WATCHDOG, NULL, T + 30 * MS);
	assert_true(standing_send_at(&standing) == at);
	assert_int_equal(standing.cause, DB_STAND_WATCHDOG);
	/* A stronger one goes out at once, and so does any once it answers. */
	standing_enter(&standing, DB_CMD_QUICK_STOP, DB_STAND_CLIENT, NULL, T + 40 * MS);
	assert_true(standing_send_at(&standing) == T + 40 * MS);
	standing_stop_sent(&standing, true, 2 * MS, T + 40 * MS);
	standing_stop_answered(&standing, DB_CMD_QUICK_STOP, true, true, T + 42 * MS);
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T + 50 * MS);
	assert_true(standing_send_at(&standing) == T + 50 * MS);
}

/* What was lost then is a sample, not the stop: whoever asks now waits for an answer of its own. */
static void asking_again_counts_once_it_obeys(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T);
	standing_stop_sent(&standing, true, 2 * MS, T);
	standing_stop_answered(&standing, DB_CMD_DISABLE, true, true, T + 2 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_OBEYS);
	(void)standing_stop_lost(&standing, true, 2, 20 * MS, T + 40 * MS);
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T + 50 * MS);
	assert_true(standing_send_at(&standing) == T + 50 * MS);
}

/* Also one of which nothing was known. */
static void an_unknown_drive_is_seen_to_stand_twice(void **state)
{
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_WATCHDOG, NULL, T);
	standing_stop_sent(&standing, true, 0, T);
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_OBEYS);
	assert_false(standing_is_free(&standing));
}

/* Stands by its word, while its position goes on changing. */
static void a_position_that_changes_is_motion(void **state)
{
	struct standing standing = entered(1000, true);
	struct db_feedback feedback = sample(0, false);
	enum standing_verdict verdict = STANDING_UNSEEN;

	(void)state;
	for (unsigned i = 1; i < 60; i++) {
		db_time now = T + i * 10 * MS;

		feedback.position = (int32_t)i * 100;
		verdict = standing_judge(&standing, &rules, &feedback, now, now);
	}
	assert_false(standing_is_seen_still(&standing));
	assert_int_equal(verdict, STANDING_RUNS_ON);
	assert_false(standing_is_free(&standing));
}

static void dither_is_no_motion(void **state)
{
	struct standing standing = entered(1000, true);
	struct db_feedback feedback = sample(0, false);

	(void)state;
	for (unsigned i = 1; i < 30 && !standing_is_free(&standing); i++) {
		db_time now = T + i * 10 * MS;

		feedback.position = i % 2;
		(void)standing_judge(&standing, &rules, &feedback, now, now);
	}
	assert_true(standing_is_free(&standing));
}

/* Speed 0 that stays 0 is not falling. */
static void moving_at_speed_0_runs_on(void **state)
{
	struct standing standing = entered(0, true);

	(void)state;
	for (db_time at = 10 * MS; at < 490 * MS; at += 10 * MS)
		assert_int_equal(judge(&standing, 0, true, T + at), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 0, true, T + 500 * MS), STANDING_RUNS_ON);
}

static void time_alone_ends_in_running_on(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	assert_int_equal(standing_deadline(&standing, &rules), T + 500 * MS);
	/* It slows down, and then nothing is heard of it though it is there. */
	assert_int_equal(judge(&standing, 500, true, T + 99 * MS), STANDING_OBEYS);
	assert_int_equal(standing_deadline(&standing, &rules), T + 600 * MS);
	standing_run_on(&standing, false, T + 600 * MS);
	assert_true(standing.overdue);
	assert_int_equal(standing_deadline(&standing, &rules), DB_TIME_NEVER);
	assert_true(standing_is_open(&standing));
	/* It stands at last. */
	standing_stop_sent(&standing, true, 0, T + 600 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 700 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 801 * MS), STANDING_DONE);
	assert_false(standing.overdue);
}

static void an_obedient_drive_is_left_alone(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 1 * MS);
	assert_int_equal(judge(&standing, 900, true, T + 10 * MS), STANDING_OBEYS);
	assert_int_equal(standing_send_at(&standing), DB_TIME_NEVER);
	/* Faster again: it was a reversal. */
	assert_int_equal(judge(&standing, 990, true, T + 30 * MS), STANDING_UNSEEN);
	assert_true(standing_send_at(&standing) <= T + 31 * MS);
}

/* The slow-down may be that of an older motion: the stop itself was lost. */
static void a_stop_that_nothing_acknowledged_is_sent_until_the_drive_stands(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_stop_answered(&standing, DB_CMD_STOP, true, false, T + 1 * MS);
	assert_int_equal(judge(&standing, 900, true, T + 10 * MS), STANDING_OBEYS);
	assert_int_equal(standing_send_at(&standing), T + 100 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 90 * MS), STANDING_OBEYS);
	assert_int_equal(standing_send_at(&standing), DB_TIME_NEVER);
}

static void an_enable_does_not_let_a_drive_run(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_WATCHDOG, NULL, T);
	standing_stop_sent(&standing, true, 0, T);
	assert_int_equal(judge(&standing, 900, true, T + 10 * MS), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 800, true, T + 20 * MS), STANDING_OBEYS);
	assert_false(standing_gives_way_to(&standing, DB_CMD_ENABLE));
	standing_drive_enabled(&standing);
	assert_int_equal(standing_next(&standing), DB_CMD_STOP);
	assert_false(standing_is_free(&standing));
	/* A disable that came while the enable was under way is not undone by it. */
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T + 25 * MS);
	standing_drive_enabled(&standing);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	standing_stop_sent(&standing, true, 0, T + 26 * MS);
	/* One that was seen to stand may be enabled. */
	assert_int_equal(judge(&standing, 0, false, T + 30 * MS), STANDING_OBEYS);
	assert_true(standing_gives_way_to(&standing, DB_CMD_ENABLE));
}

static void the_stronger_kind_wins_and_is_sent_first(void **state)
{
	struct standing standing = entered(1000, true);
	struct db_feedback fast = sample(1000, true);

	(void)state;
	standing_run_on(&standing, false, T + 500 * MS);
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_WATCHDOG, &fast, T + 600 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	assert_int_equal(standing_send_at(&standing), T + 600 * MS);
	assert_int_equal(standing.cause, DB_STAND_WATCHDOG);
	assert_int_equal(standing.since, T);
	/* It has the time of its own. */
	assert_false(standing.overdue);
	/* A weaker one changes nothing of that. */
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_CLIENT, &fast, T + 610 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
}

static void what_is_refused_gives_way_to_the_next_kind(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T);
	standing_stop_sent(&standing, true, 0, T);
	standing_stop_answered(&standing, DB_CMD_DISABLE, false, true, T + 1 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_STOP);
	assert_int_equal(standing_send_at(&standing), T + 21 * MS);
	standing_stop_sent(&standing, true, 0, T + 21 * MS);
	standing_stop_answered(&standing, DB_CMD_STOP, false, true, T + 22 * MS);
	/* Both: it goes on with the strongest. */
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	standing_stop_sent(&standing, true, 0, T + 42 * MS);
	standing_stop_answered(&standing, DB_CMD_DISABLE, false, true, T + 43 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_STOP);
	/* So it does when the weaker one was taken. */
	standing_stop_sent(&standing, true, 0, T + 63 * MS);
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 64 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
}

static void a_disable_ends_when_the_power_is_known_to_be_off(void **state)
{
	struct db_feedback still = sample(0, false);
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, &still, T);
	standing_stop_sent(&standing, true, 0, T);
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_OBEYS);
	assert_true(standing_send_at(&standing) < DB_TIME_NEVER);
	standing_stop_answered(&standing, DB_CMD_DISABLE, true, true, T + 20 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 30 * MS), STANDING_DONE);
}

/* A stop of a controller with several axes has joined. */
static void owe(struct standing *standing, enum db_command kind, const struct db_feedback *known,
                db_time now)
{
	standing_enter(standing, kind, DB_STAND_CLIENT, known, now);
	standing_owe(standing, kind);
}

/* Of a controller with several axes: its disable is for one of them, its stop for all. */
static void a_stop_of_all_axes_is_not_left_out_for_a_disable(void **state)
{
	struct db_feedback still = sample(0, false);
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, &still, T);
	standing_stop_sent(&standing, true, 0, T);
	owe(&standing, DB_CMD_STOP, &still, T + 1 * MS);
	standing_stop_answered(&standing, DB_CMD_DISABLE, true, true, T + 2 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_STOP);
	assert_true(standing_send_at(&standing) <= T + 2 * MS);
	standing_stop_sent(&standing, true, 0, T + 2 * MS);
	/* That this axis stands does not show that the others were told. */
	assert_int_equal(judge(&standing, 0, false, T + 3 * MS), STANDING_UNSEEN);
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 5 * MS);
	/* Nothing is known of the disable: its answer was an older one's. */
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	assert_true(standing_send_at(&standing) <= T + 5 * MS);
	standing_stop_sent(&standing, true, 0, T + 5 * MS);
	standing_stop_answered(&standing, DB_CMD_DISABLE, true, true, T + 8 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_DONE);
}

/* Neither waits for the other where only one of them gets through. */
static void a_disable_and_an_owed_stop_take_turns(void **state)
{
	struct standing standing = { .kind = DB_CMD_NONE };
	unsigned disables = 0;

	(void)state;
	owe(&standing, DB_CMD_STOP, NULL, T);
	standing_stop_sent(&standing, true, 0, T);
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T + 1 * MS);
	for (unsigned i = 0; i < 8; i++) {
		enum db_command next = standing_next(&standing);

		disables += next == DB_CMD_DISABLE;
		assert_int_equal(next == DB_CMD_DISABLE, i % 2 == 0);
		standing_stop_sent(&standing, true, 0, T + (10 + 10 * i) * MS);
		(void)standing_stop_lost(&standing, true, 2, MS, T + (15 + 10 * i) * MS);
	}
	assert_int_equal(disables, 4);
}

static void an_owed_stop_that_is_never_answered_ends_by_time(void **state)
{
	struct db_feedback still = sample(0, false);
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	owe(&standing, DB_CMD_STOP, &still, T);
	standing_stop_sent(&standing, true, 0, T);
	(void)standing_stop_lost(&standing, true, 2, MS, T + 10 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 20 * MS), STANDING_UNSEEN);
	assert_true(standing_is_open(&standing));
	assert_true(standing_send_at(&standing) <= T + 30 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 600 * MS), STANDING_RUNS_ON);
	/* It is told on, and then that is over. */
	standing_run_on(&standing, false, T + 600 * MS);
	standing_stop_sent(&standing, true, 0, T + 610 * MS);
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 615 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 620 * MS), STANDING_DONE);
}

/* Some refuse a stop while nothing moves. */
static void an_owed_stop_that_is_refused_keeps_no_axis_that_stands(void **state)
{
	struct db_feedback still = sample(0, false);
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	owe(&standing, DB_CMD_STOP, &still, T);
	standing_stop_sent(&standing, true, 0, T);
	standing_stop_answered(&standing, DB_CMD_STOP, false, true, T + 5 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_DONE);
}

/* A controller that answers everything but stops counts as lost, and is back at once. */
static void a_disable_has_its_turn_though_the_controller_comes_and_goes(void **state)
{
	struct standing standing = { .kind = DB_CMD_NONE };
	unsigned disables = 0;

	(void)state;
	owe(&standing, DB_CMD_STOP, NULL, T);
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T);
	for (unsigned i = 0; i < 10; i++) {
		disables += standing_next(&standing) == DB_CMD_DISABLE;
		standing_stop_sent(&standing, true, 0, T + (10 + 20 * i) * MS);
		(void)standing_stop_lost(&standing, true, 2, MS, T + (15 + 20 * i) * MS);
		standing_suspend(&standing, &rules, T + (18 + 20 * i) * MS);
		standing_resume(&standing, T + (20 + 20 * i) * MS);
	}
	assert_int_equal(disables, 5);
}

/* Only its first frame was sent, which may be a read. */
static void a_blind_disable_has_not_had_its_turn(void **state)
{
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	owe(&standing, DB_CMD_STOP, NULL, T);
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T);
	standing_stop_sent(&standing, false, 0, T);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	standing_stop_sent(&standing, false, 0, T + 10 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	standing_stop_sent(&standing, true, 0, T + 20 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_STOP);
}

static void a_refused_quick_stop_does_not_serve_for_a_stop(void **state)
{
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	owe(&standing, DB_CMD_STOP, NULL, T);
	owe(&standing, DB_CMD_QUICK_STOP, NULL, T);
	assert_int_equal(standing_next(&standing), DB_CMD_QUICK_STOP);
	standing_stop_sent(&standing, true, 0, T);
	standing_stop_answered(&standing, DB_CMD_QUICK_STOP, false, true, T + 5 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_STOP);
	standing_stop_sent(&standing, true, 0, T + 10 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 12 * MS), STANDING_UNSEEN);
	assert_true(standing_is_open(&standing));
}

/* The power is known to be off; another one might stop axes that were set going since. */
static void a_confirmed_disable_is_not_repeated_for_an_owed_stop(void **state)
{
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	owe(&standing, DB_CMD_STOP, NULL, T);
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, NULL, T);
	standing_stop_sent(&standing, true, 0, T);
	(void)standing_stop_lost(&standing, true, 2, MS, T + 5 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	standing_stop_sent(&standing, true, 0, T + 10 * MS);
	standing_stop_answered(&standing, DB_CMD_DISABLE, true, true, T + 15 * MS);
	for (unsigned i = 0; i < 4; i++) {
		assert_int_equal(standing_next(&standing), DB_CMD_STOP);
		standing_stop_sent(&standing, true, 0, T + (20 + 10 * i) * MS);
		(void)standing_stop_lost(&standing, true, 2, MS, T + (25 + 10 * i) * MS);
	}
}

/* What was answered before it was away does not count. */
static void an_owed_stop_is_owed_again_by_a_controller_that_comes_back(void **state)
{
	struct db_feedback still = sample(0, false);
	struct standing standing = { .kind = DB_CMD_NONE };

	(void)state;
	owe(&standing, DB_CMD_STOP, NULL, T);
	standing_stop_sent(&standing, true, 0, T);
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 5 * MS);
	standing_enter(&standing, DB_CMD_DISABLE, DB_STAND_CLIENT, &still, T + 10 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
	standing_suspend(&standing, &rules, T + 20 * MS);
	standing_resume(&standing, T + 30 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_STOP);
	standing_stop_sent(&standing, true, 0, T + 30 * MS);
	assert_int_equal(standing_next(&standing), DB_CMD_DISABLE);
}

/* A line with many drives may need longer than that to read each of them once. */
static void a_drive_that_stood_is_read_before_it_runs_on(void **state)
{
	struct standing standing = entered(0, false);

	(void)state;
	assert_int_equal(standing_deadline(&standing, &rules), T + 2000 * MS);
	/* It is seen to move after all. */
	assert_int_equal(judge(&standing, 1000, true, T + 600 * MS), STANDING_RUNS_ON);
	standing = entered(0, false);
	assert_int_equal(judge(&standing, 0, false, T + 1900 * MS), STANDING_DONE);
}

static void a_drive_that_comes_back_is_told_first_and_seen_anew(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_OBEYS);
	standing_suspend(&standing, &rules, T + 50 * MS);
	assert_true(standing_is_open(&standing));
	assert_int_equal(standing_deadline(&standing, &rules), DB_TIME_NEVER);
	standing_resume(&standing, T + 5000 * MS);
	assert_int_equal(standing_send_at(&standing), T + 5000 * MS);
	/* Nothing is overdue before it was told. */
	assert_int_equal(standing_deadline(&standing, &rules), DB_TIME_NEVER);
	assert_int_equal(judge(&standing, 0, false, T + 5001 * MS), STANDING_UNSEEN);
	standing_stop_sent(&standing, true, 0, T + 5002 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 5003 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 5110 * MS), STANDING_DONE);
}

/* What it moved like before it went does not make a slow motion after it look like braking. */
static void a_drive_that_comes_back_slower_does_not_obey(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_suspend(&standing, &rules, T + 50 * MS);
	standing_resume(&standing, T + 5000 * MS);
	standing_stop_sent(&standing, true, 0, T + 5000 * MS);
	assert_int_equal(judge(&standing, 300, true, T + 5010 * MS), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 300, true, T + 5020 * MS), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 100, true, T + 5030 * MS), STANDING_OBEYS);
}

/* Nothing of so short a time is used up before the drive is back. */
static void a_short_patience_waits_for_a_drive_that_is_away(void **state)
{
	static const struct standing_rules hasty = { .patience = 80 * MS };
	struct standing standing = entered(1000, true);

	(void)state;
	assert_int_equal(standing_deadline(&standing, &hasty), T + 80 * MS);
	standing_suspend(&standing, &hasty, T + 50 * MS);
	assert_int_equal(standing_deadline(&standing, &hasty), DB_TIME_NEVER);
	standing_resume(&standing, T + 1000 * MS);
	standing_stop_sent(&standing, true, 0, T + 1000 * MS);
	assert_int_equal(standing_deadline(&standing, &hasty), T + 1080 * MS);
}

/* It comes and goes; each time its patience goes on where it was. */
static void coming_and_going_does_not_put_off_the_end(void **state)
{
	struct standing standing = entered(1000, true);
	db_time now = T;

	(void)state;
	for (unsigned i = 0; i < 20; i++) {
		standing_suspend(&standing, &rules, now + 150 * MS);
		now += 300 * MS;
		standing_resume(&standing, now);
		standing_stop_sent(&standing, true, 0, now);
	}
	assert_in_range(standing_deadline(&standing, &rules), now + 100 * MS, now + 150 * MS);
}

static void losses_cost_the_drive_its_own_share(void **state)
{
	struct standing standing = entered(1000, true);
	db_time now = T + 40 * MS;

	(void)state;
	/* At once, as often as anything is repeated; then a fifth of the wire. */
	assert_false(standing_stop_lost(&standing, true, 2, 40 * MS, now));
	assert_false(standing_stop_lost(&standing, true, 2, 40 * MS, now));
	assert_int_equal(standing_send_at(&standing), now);
	assert_true(standing_stop_lost(&standing, true, 2, 40 * MS, now));
	assert_int_equal(standing_send_at(&standing), now + 160 * MS);
	/* Offline it waits longer and longer, within a bound. */
	for (db_time pause = 20 * MS; pause < 200 * MS; pause *= 2) {
		assert_true(standing_stop_lost(&standing, false, 2, 1 * MS, now));
		assert_int_equal(standing_send_at(&standing), now + pause);
	}
	for (unsigned i = 0; i < 10; i++)
		assert_true(standing_stop_lost(&standing, false, 2, 1 * MS, now));
	assert_int_equal(standing_send_at(&standing), now + 200 * MS);
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, now);
	assert_int_equal(standing.losses, 0);
	/* It begins anew when it has answered. */
	assert_true(standing_stop_lost(&standing, false, 2, 1 * MS, now));
	assert_int_equal(standing_send_at(&standing), now + 20 * MS);
}

static void a_later_motion_ends_it_when_the_drive_took_it(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	assert_true(standing_deadline(&standing, &rules) < DB_TIME_NEVER);
	standing.gives_way = true;
	assert_int_equal(standing_send_at(&standing), DB_TIME_NEVER);
	/* While it moves because of that, nothing is overdue. */
	assert_int_equal(standing_deadline(&standing, &rules), DB_TIME_NEVER);
	assert_int_equal(judge(&standing, 1000, true, T + 10 * MS), STANDING_UNSEEN);
	standing_motion_ended(&standing, false, T + 20 * MS);
	assert_int_equal(standing_send_at(&standing), T + 20 * MS);
	standing.gives_way = true;
	standing_motion_ended(&standing, true, T + 30 * MS);
	assert_true(standing_is_free(&standing));
	/* A stop that came meanwhile is not ended by it. */
	standing = entered(1000, true);
	standing.gives_way = true;
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T + 5 * MS);
	standing_motion_ended(&standing, true, T + 30 * MS);
	assert_false(standing_is_free(&standing));
}

static void a_withdrawn_cause_leaves_the_others(void **state)
{
	struct standing standing = entered(0, false);

	(void)state;
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_EXIT, NULL, T);
	standing_withdraw(&standing, DB_STAND_EXIT);
	assert_false(standing_is_free(&standing));
	standing_withdraw(&standing, DB_STAND_CLIENT);
	assert_true(standing_is_free(&standing));
}

/* --- a velocity that is computed from two positions ------------------------------------------------ */

static const struct standing_rules computed_rules = { .patience = 1000 * MS, .computed = true };

/* An axis that is read every 40 ms, whose answers come up to `late` later than it was there. */
struct computed {
	struct standing standing;
	struct db_feedback last;
	db_time late;
	unsigned seed;
	double (*place)(double s);          /* where it is, s seconds after the stop, in counts */
	const struct standing_rules *rules; /* null: computed_rules */
};

static enum standing_verdict read_computed(struct computed *axis, db_time at, bool moving)
{
	double place = axis->place((double)(at - T) / 1e9);
	struct db_feedback now = sample(0, moving);
	db_time taken;

	axis->seed = axis->seed * 1103515245u + 12345u;
	taken = at + (axis->late ? (db_time)(axis->seed >> 8) % axis->late : 0);
	now.taken = taken;
	now.position = (int32_t)place;
	if (axis->last.taken != 0)
		now.velocity = (float)((now.position - axis->last.position) * 1e9 /
		                       (double)(taken - axis->last.taken));
	axis->last = now;
	return standing_judge(&axis->standing, axis->rules ? axis->rules : &computed_rules, &now,
	                      at, taken);
}

/* When it was first seen to obey, or to run on; in `verdict` which of them. */
static db_time judge_computed(struct computed *axis, double moves_for,
                              enum standing_verdict *verdict)
{
	db_time at = T - 80 * MS;

	(void)read_computed(axis, at, true);
	(void)read_computed(axis, at + 40 * MS, true);
	standing_enter(&axis->standing, DB_CMD_STOP, DB_STAND_CLIENT, &axis->last, T);
	standing_stop_sent(&axis->standing, true, 2 * MS, T);
	standing_stop_answered(&axis->standing, DB_CMD_STOP, true, true, T + 2 * MS);
	for (at = T + 3 * MS; at < T + 20 * DB_NS_PER_S; at += 40 * MS) {
		*verdict = read_computed(axis, at, (double)(at - T) / 1e9 < moves_for);
		if (*verdict != STANDING_UNSEEN)
			return at - T;
	}
	return at - T;
}

static double runs_on(double s)
{
	return 1600 * s;
}

/* At 1600 counts per second, by an even ramp to standing. */
static double brakes_for(double s, double ramp)
{
	double t = s < 0 ? 0 : s > ramp ? ramp : s;

	return (s < 0 ? 1600 * s : 0) + 1600 * (t - t * t / (2 * ramp));
}

static double brakes_for_100_ms(double s)
{
	return brakes_for(s, 0.1);
}

static double brakes_for_a_second(double s)
{
	return brakes_for(s, 1.0);
}

static double brakes_for_5_s(double s)
{
	return brakes_for(s, 5.0);
}

static double brakes_for_10_s(double s)
{
	return brakes_for(s, 10.0);
}

/* The controller has answered the stop, and the axis does not stop: however late answers come, that is not
 * taken for a ramp. */
static void jitter_is_no_slow_down(void **state)
{
	static const struct {
		db_time late;
		db_time most; /* until it is told that it runs on; the patience is 1000 ms */
	} cases[] = {
		{ 0, 1600 * MS },       { 2 * MS, 1600 * MS },  { 5 * MS, 1900 * MS },
		{ 16 * MS, 2600 * MS }, { 30 * MS, 3500 * MS },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		for (unsigned seed = 1; seed <= 200; seed++) {
			struct computed axis = { .late = cases[i].late,
				                 .seed = seed,
				                 .place = runs_on };
			enum standing_verdict verdict;
			db_time after = judge_computed(&axis, 100.0, &verdict);

			assert_int_equal(verdict, STANDING_RUNS_ON);
			assert_in_range(after, 1000 * MS, cases[i].most);
		}
	}
}

/* One answer alone may be later than that: the window before it is slow, the one after it is fast. */
static void one_late_answer_is_no_slow_down(void **state)
{
	(void)state;
	for (db_time late = 20 * MS; late <= 120 * MS; late += 20 * MS) {
		for (unsigned which = 1; which < 25; which++) {
			struct computed axis = { .place = runs_on };
			enum standing_verdict verdict = STANDING_UNSEEN;
			unsigned n = 0;

			standing_enter(&axis.standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T);
			standing_stop_sent(&axis.standing, true, 2 * MS, T);
			standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true, T + 2 * MS);
			for (db_time at = T + 3 * MS; verdict == STANDING_UNSEEN; at += 40 * MS) {
				bool is_late = ++n == which;
				struct db_feedback now = sample(1600, true);

				now.position = (int32_t)runs_on((double)(at - T) / 1e9);
				now.taken = at + (is_late ? late : 0);
				verdict = standing_judge(&axis.standing, &computed_rules, &now, at,
				                         now.taken);
				if (is_late)
					at += late / (40 * MS) * 40 * MS;
			}
			assert_int_equal(verdict, STANDING_RUNS_ON);
		}
	}
}

static void a_ramp_is_seen_over_two_windows(void **state)
{
	static const struct {
		double (*place)(double s);
		double ramp;
		db_time least; /* when it is seen to obey */
		db_time most;
	} cases[] = {
		/* it stands before two windows are over */
		{ brakes_for_100_ms, 0.1, 100 * MS, 200 * MS },
		{ brakes_for_a_second, 1.0, 600 * MS, 1100 * MS },
		{ brakes_for_5_s, 5.0, 1200 * MS, 3000 * MS },
		{ brakes_for_10_s, 10.0, 2000 * MS, 4000 * MS },
	};
	static const db_time late[] = { 0, 5 * MS, 16 * MS };

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		for (size_t k = 0; k < 3; k++) {
			for (unsigned seed = 1; seed <= 100; seed++) {
				struct computed axis = {
					.late = late[k],
					.seed = seed,
					.place = cases[i].place,
				};
				enum standing_verdict verdict;
				db_time after = judge_computed(&axis, cases[i].ramp, &verdict);

				assert_int_equal(verdict, STANDING_OBEYS);
				assert_in_range(after, cases[i].least, cases[i].most);
			}
		}
	}
}

/* While a single sample looks slower no second stop is sent into what may be a ramp, but nothing waits less for it. */
static void one_slower_sample_only_holds_the_next_stop_back(void **state)
{
	struct computed axis = { .place = brakes_for_a_second };
	struct standing unread;

	(void)state;
	standing_enter(&axis.standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T);
	standing_stop_sent(&axis.standing, true, 2 * MS, T);
	standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true, T + 2 * MS);
	for (unsigned i = 0; i < 6; i++)
		assert_int_equal(read_computed(&axis, T + 3 * MS + i * 40 * MS, true),
		                 STANDING_UNSEEN);
	assert_int_equal(standing_send_at(&axis.standing), DB_TIME_NEVER);
	assert_true(standing_is_open(&axis.standing));
	/* Where it is not stopped for this axis alone, it is sent on until it is answered. */
	unread = axis.standing;
	standing_owe(&axis.standing, DB_CMD_STOP);
	assert_int_equal(read_computed(&axis, T + 250 * MS, true), STANDING_UNSEEN);
	assert_true(standing_send_at(&axis.standing) < T + 250 * MS);
	/* Or when no further sample comes, and the time is over. */
	standing_run_on(&unread, false, T + 1500 * MS);
	assert_true(standing_send_at(&unread) < T + 1500 * MS);
}

/* At the turning point of a reversal: what was seen standing goes on. */
static void an_axis_that_stood_and_moves_does_not_obey(void **state)
{
	struct computed axis = { .place = runs_on };
	enum standing_verdict verdict;

	(void)state;
	standing_enter(&axis.standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T);
	standing_stop_sent(&axis.standing, true, 2 * MS, T);
	standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true, T + 2 * MS);
	assert_int_equal(read_computed(&axis, T + 3 * MS, true), STANDING_UNSEEN);
	assert_int_equal(read_computed(&axis, T + 43 * MS, false), STANDING_OBEYS);
	for (db_time at = T + 83 * MS; at < T + 900 * MS; at += 40 * MS) {
		verdict = read_computed(&axis, at, true);
		assert_int_equal(verdict, STANDING_UNSEEN);
		assert_true(standing_is_open(&axis.standing));
	}
}

/* What it did before it moved, came back or got another cause proves nothing: it may be seen where it turns round. */
static void one_that_stood_and_then_moved_is_seen_to_stand_twice(void **state)
{
	struct standing standing = entered(0, false);

	(void)state;
	assert_int_equal(judge(&standing, 100, true, T + 10 * MS), STANDING_UNSEEN);
	assert_int_equal(judge(&standing, 0, false, T + 20 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 120 * MS), STANDING_DONE);
	/* It was away. */
	standing = entered(0, false);
	standing_resume(&standing, T + 10 * MS);
	standing_stop_sent(&standing, true, 2 * MS, T + 10 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 20 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 120 * MS), STANDING_DONE);
	/* Another cause joins. */
	standing = entered(1000, true);
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_OBEYS);
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_WATCHDOG, NULL, T + 50 * MS);
	standing_stop_sent(&standing, true, 2 * MS, T + 50 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 130 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 229 * MS), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 0, false, T + 230 * MS), STANDING_DONE);
}

static enum standing_verdict judge_place(struct standing *standing, int32_t position, db_time asked)
{
	const struct standing_rules doubtful = { .patience = 500 * MS, .doubt = 50 * MS };
	struct db_feedback feedback = sample(0, false);

	feedback.position = position;
	return standing_judge(standing, &doubtful, &feedback, asked, asked + 1 * MS);
}

/* Sixteen counts are dither; more are motion, also of a drive that was known to stand. */
static void one_that_stood_and_then_drifts_moves(void **state)
{
	struct standing standing = entered(0, false);

	(void)state;
	assert_int_equal(judge_place(&standing, 1000, T + 10 * MS), STANDING_UNSEEN);
	assert_int_equal(judge_place(&standing, 1016, T + 40 * MS), STANDING_UNSEEN);
	assert_int_equal(judge_place(&standing, 1016, T + 60 * MS), STANDING_DONE);
	standing = entered(0, false);
	assert_int_equal(judge_place(&standing, 1000, T + 10 * MS), STANDING_UNSEEN);
	assert_int_equal(judge_place(&standing, 1017, T + 40 * MS), STANDING_UNSEEN);
	assert_int_equal(judge_place(&standing, 1017, T + 60 * MS), STANDING_UNSEEN);
	assert_int_equal(judge_place(&standing, 1017, T + 95 * MS), STANDING_OBEYS);
	assert_int_equal(judge_place(&standing, 1017, T + 140 * MS), STANDING_DONE);
}

/* Half as fast is not enough where it then stays so: it is told again. */
static void one_that_slows_down_no_further_runs_on(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	standing_stop_answered(&standing, DB_CMD_STOP, true, true, T + 3 * MS);
	assert_int_equal(judge(&standing, 500, true, T + 10 * MS), STANDING_OBEYS);
	assert_true(standing_send_at(&standing) == DB_TIME_NEVER);
	assert_int_equal(judge(&standing, 500, true, T + 510 * MS - 1), STANDING_OBEYS);
	assert_int_equal(judge(&standing, 500, true, T + 510 * MS), STANDING_RUNS_ON);
	assert_true(standing_is_open(&standing));
	assert_false(standing_send_at(&standing) == DB_TIME_NEVER);
}

/* While a later motion is under way, nothing is judged by what was before it. */
static void a_sample_during_a_later_motion_proves_nothing(void **state)
{
	struct standing standing = entered(0, false);

	(void)state;
	standing.gives_way = true;
	assert_int_equal(judge(&standing, 0, false, T + 10 * MS), STANDING_UNSEEN);
	assert_false(standing_is_free(&standing));
	standing_motion_ended(&standing, false, T + 20 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 30 * MS), STANDING_DONE);
}

/* A drive that was back is hurried again, not as one that is gone for long. */
static void pauses_begin_again_with_a_drive_that_was_back(void **state)
{
	struct standing standing = entered(1000, true);

	(void)state;
	for (unsigned i = 0; i < 3; i++) {
		assert_true(standing_stop_lost(&standing, false, 2, MS, T));
		assert_true(standing_send_at(&standing) == T + (20 * MS << i));
	}
	standing_resume(&standing, T);
	standing_stop_sent(&standing, true, 2 * MS, T);
	assert_true(standing_stop_lost(&standing, false, 2, MS, T));
	assert_true(standing_send_at(&standing) == T + 20 * MS);
}

/* Its time begins again with each sample in which it stands; not while its controller owes an answer. */
static void one_that_stands_has_its_time_again(void **state)
{
	const struct db_feedback moves = sample(1000, true);
	struct standing standing = entered(1000, true);

	(void)state;
	assert_int_equal(standing_deadline(&standing, &rules), T + 500 * MS);
	assert_int_equal(judge(&standing, 0, false, T + 400 * MS), STANDING_OBEYS);
	assert_int_equal(standing_deadline(&standing, &rules), T + 901 * MS);
	standing = (struct standing){ .kind = DB_CMD_NONE };
	standing_enter(&standing, DB_CMD_STOP, DB_STAND_CLIENT, &moves, T);
	standing_owe(&standing, DB_CMD_STOP);
	standing_stop_sent(&standing, true, 2 * MS, T);
	assert_int_equal(judge(&standing, 0, false, T + 400 * MS), STANDING_UNSEEN);
	assert_int_equal(standing_deadline(&standing, &rules), T + 500 * MS);
}

static void stop_again_on_a_ramp(struct computed axis, double ramp, db_time again)
{
	db_time end = T + (db_time)((ramp < 4.0 ? ramp : 4.0) * 1e9);
	bool said = false;

	standing_enter(&axis.standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T);
	standing_stop_sent(&axis.standing, true, 2 * MS, T);
	standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true, T + 2 * MS);
	for (db_time at = T + 3 * MS; at < end; at += 40 * MS) {
		if (!said && at >= T + again) {
			standing_enter(&axis.standing, DB_CMD_STOP, DB_STAND_CLIENT, &axis.last,
			               at - 2);
			standing_stop_sent(&axis.standing, true, 2 * MS, at - 2);
			standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true, at - 1);
			said = true;
		}
		assert_true(standing_deadline(&axis.standing, axis.rules) > at);
		assert_int_not_equal(read_computed(&axis, at, true), STANDING_RUNS_ON);
	}
}

/* Whoever stops it says so again. The speeds before that do not count, and the time to see new ones is not the axis's. */
static void a_second_stop_on_a_ramp_does_not_run_on(void **state)
{
	static const struct standing_rules least = { .patience = STANDING_PATIENCE_COMPUTED,
		                                     .computed = true };
	static const struct {
		double (*place)(double s);
		double ramp;
	} cases[] = {
		{ brakes_for_a_second, 1.0 },
		{ brakes_for_5_s, 5.0 },
		{ brakes_for_10_s, 10.0 },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		for (db_time again = 50 * MS; again < 950 * MS; again += 50 * MS) {
			struct computed axis = { .place = cases[i].place,
				                 .rules = &computed_rules };

			stop_again_on_a_ramp(axis, cases[i].ramp, again);
			axis.rules = &least;
			stop_again_on_a_ramp(axis, cases[i].ramp, again);
		}
	}
}

/* Its disable is answered each time, and it runs on: this is told however often it is disabled. */
static void disables_do_not_put_off_that_it_runs_on(void **state)
{
	(void)state;
	for (db_time every = 100 * MS; every < 1000 * MS; every += 100 * MS) {
		struct computed axis = { .place = runs_on };
		enum standing_verdict verdict = STANDING_UNSEEN;
		db_time next = T;
		db_time at;

		for (at = T; verdict == STANDING_UNSEEN && at < T + 5 * DB_NS_PER_S;
		     at += 40 * MS) {
			if (at >= next) {
				standing_enter(&axis.standing, DB_CMD_DISABLE, DB_STAND_CLIENT,
				               NULL, at);
				standing_stop_sent(&axis.standing, true, 2 * MS, at);
				standing_stop_answered(&axis.standing, DB_CMD_DISABLE, true, true,
				                       at + 2 * MS);
				next = at + every;
			}
			verdict = read_computed(&axis, at + 3 * MS, true);
		}
		assert_int_equal(verdict, STANDING_RUNS_ON);
		assert_in_range(at - T, 1000 * MS, 2000 * MS);
	}
}

/* It is gone for a moment, and has a ramp that nobody has seen yet when it is back. */
static void a_ramp_goes_on_while_it_is_gone(void **state)
{
	(void)state;
	for (db_time gone = 100 * MS; gone < 2000 * MS; gone += 100 * MS) {
		struct computed axis = { .place = brakes_for_10_s };
		db_time back = T + gone + 300 * MS;
		bool is_gone = false;

		standing_enter(&axis.standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T);
		standing_stop_sent(&axis.standing, true, 2 * MS, T);
		standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true, T + 2 * MS);
		for (db_time at = T + 3 * MS; at < T + 5 * DB_NS_PER_S; at += 40 * MS) {
			if (!is_gone && at >= T + gone) {
				standing_suspend(&axis.standing, &computed_rules, at);
				at = back;
				standing_resume(&axis.standing, at - 3);
				standing_stop_sent(&axis.standing, true, 2 * MS, at - 2);
				standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true,
				                       at - 1);
				is_gone = true;
			}
			assert_true(standing_deadline(&axis.standing, &computed_rules) > at);
			assert_int_not_equal(read_computed(&axis, at, true), STANDING_RUNS_ON);
		}
	}
}

/* It runs on, and is gone again and again: however short the times are in which it is there, they add up. */
static void what_comes_and_goes_runs_on_all_the_same(void **state)
{
	(void)state;
	for (db_time there = 200 * MS; there <= 2000 * MS; there += 100 * MS) {
		struct computed axis = { .place = runs_on };
		bool told = false;
		db_time at = T;

		standing_enter(&axis.standing, DB_CMD_STOP, DB_STAND_CLIENT, NULL, T);
		while (!told && at < T + 60 * DB_NS_PER_S) {
			db_time until = at + there;

			standing_stop_sent(&axis.standing, true, 2 * MS, at);
			standing_stop_answered(&axis.standing, DB_CMD_STOP, true, true, at + 1);
			for (at += 3 * MS; !told && at < until; at += 40 * MS)
				told = standing_deadline(&axis.standing, &computed_rules) <= at ||
				       read_computed(&axis, at, true) == STANDING_RUNS_ON;
			standing_suspend(&axis.standing, &computed_rules, at);
			at += 300 * MS;
			standing_resume(&axis.standing, at);
		}
		assert_true(told);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(one_that_stood_and_then_moved_is_seen_to_stand_twice),
		cmocka_unit_test(one_that_stood_and_then_drifts_moves),
		cmocka_unit_test(one_that_slows_down_no_further_runs_on),
		cmocka_unit_test(one_that_stands_has_its_time_again),
		cmocka_unit_test(a_sample_during_a_later_motion_proves_nothing),
		cmocka_unit_test(pauses_begin_again_with_a_drive_that_was_back),
		cmocka_unit_test(a_stop_is_said_again_at_its_pace),
		cmocka_unit_test(a_stop_that_may_not_have_arrived_has_no_pace),
		cmocka_unit_test(a_drive_is_read_behind_the_answer_to_its_stop),
		cmocka_unit_test(only_what_was_asked_after_the_stop_counts),
		cmocka_unit_test(what_is_known_of_an_offline_drive_is_no_evidence),
		cmocka_unit_test(a_drive_that_moved_is_seen_to_stand_twice),
		cmocka_unit_test(asking_again_does_not_hurry_a_drive_that_does_not_answer),
		cmocka_unit_test(asking_again_counts_once_it_obeys),
		cmocka_unit_test(a_second_cause_is_judged_by_what_follows),
		cmocka_unit_test(an_unknown_drive_is_seen_to_stand_twice),
		cmocka_unit_test(a_position_that_changes_is_motion),
		cmocka_unit_test(dither_is_no_motion),
		cmocka_unit_test(moving_at_speed_0_runs_on),
		cmocka_unit_test(time_alone_ends_in_running_on),
		cmocka_unit_test(a_drive_that_stood_is_read_before_it_runs_on),
		cmocka_unit_test(an_obedient_drive_is_left_alone),
		cmocka_unit_test(a_stop_that_nothing_acknowledged_is_sent_until_the_drive_stands),
		cmocka_unit_test(an_enable_does_not_let_a_drive_run),
		cmocka_unit_test(the_stronger_kind_wins_and_is_sent_first),
		cmocka_unit_test(what_is_refused_gives_way_to_the_next_kind),
		cmocka_unit_test(a_disable_ends_when_the_power_is_known_to_be_off),
		cmocka_unit_test(a_stop_of_all_axes_is_not_left_out_for_a_disable),
		cmocka_unit_test(a_disable_and_an_owed_stop_take_turns),
		cmocka_unit_test(an_owed_stop_that_is_never_answered_ends_by_time),
		cmocka_unit_test(an_owed_stop_that_is_refused_keeps_no_axis_that_stands),
		cmocka_unit_test(a_disable_has_its_turn_though_the_controller_comes_and_goes),
		cmocka_unit_test(a_blind_disable_has_not_had_its_turn),
		cmocka_unit_test(a_refused_quick_stop_does_not_serve_for_a_stop),
		cmocka_unit_test(a_confirmed_disable_is_not_repeated_for_an_owed_stop),
		cmocka_unit_test(an_owed_stop_is_owed_again_by_a_controller_that_comes_back),
		cmocka_unit_test(a_drive_that_comes_back_is_told_first_and_seen_anew),
		cmocka_unit_test(a_drive_that_comes_back_slower_does_not_obey),
		cmocka_unit_test(a_short_patience_waits_for_a_drive_that_is_away),
		cmocka_unit_test(coming_and_going_does_not_put_off_the_end),
		cmocka_unit_test(losses_cost_the_drive_its_own_share),
		cmocka_unit_test(a_later_motion_ends_it_when_the_drive_took_it),
		cmocka_unit_test(a_withdrawn_cause_leaves_the_others),
		cmocka_unit_test(jitter_is_no_slow_down),
		cmocka_unit_test(one_late_answer_is_no_slow_down),
		cmocka_unit_test(a_ramp_is_seen_over_two_windows),
		cmocka_unit_test(one_slower_sample_only_holds_the_next_stop_back),
		cmocka_unit_test(an_axis_that_stood_and_moves_does_not_obey),
		cmocka_unit_test(a_second_stop_on_a_ramp_does_not_run_on),
		cmocka_unit_test(a_ramp_goes_on_while_it_is_gone),
		cmocka_unit_test(what_comes_and_goes_runs_on_all_the_same),
		cmocka_unit_test(disables_do_not_put_off_that_it_runs_on),
	};

	return cmocka_run_group_tests_name("standing", tests, NULL, NULL);
}
