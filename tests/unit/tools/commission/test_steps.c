/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/asker.h"
#include "commission/judge.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

/* Told at 0 ms, it begins after `delay`, runs at 1000 counts/s, is stopped at 1000 ms and runs on for `late`. */
static void add_motion(struct db_trial *trial, double sign, double told, double delay, double late)
{
	*trial = (struct db_trial){ .ended_ms = 1000 };
	for (double ms = -20; ms <= 2000; ms += 20) {
		double end = 1000 + late;
		double way = ms < delay ? 0 : (ms < end ? ms : end) - delay;

		assert_true(db_trial_add(
			trial,
			&(struct db_trial_sample){ .ms = ms,
		                                   .position = sign * way,
		                                   .velocity = ms < delay || ms > end ? 0 : told,
		                                   .online = true,
		                                   .moving = ms >= delay && ms < end + 100 }));
	}
}

static void figures_are_of_the_motion(void **state)
{
	struct db_trial trial;
	struct db_trial_figures figures;

	(void)state;
	add_motion(&trial, 1, 1000, 100, 200);
	db_trial_measure(&trial, &figures);
	assert_float_equal(figures.began_ms, 120, 1);
	assert_float_equal(figures.speed, 1000, 1);
	assert_float_equal(figures.told, 1000, 1);
	assert_float_equal(figures.stood_ms, 200, 1);
	assert_float_equal(figures.slowed_ms, 220, 1);
	assert_float_equal(figures.shown_ms, 300, 1);
	assert_float_equal(figures.way, 1100, 1);
	db_trial_clear(&trial);
}

/* As add_motion(), but nothing is heard from `from` on for `ms`. */
static void cut(struct db_trial *trial, double from, double ms)
{
	size_t kept = 0;

	for (size_t i = 0; i < trial->count; i++) {
		if (trial->samples[i].ms < from || trial->samples[i].ms >= from + ms)
			trial->samples[kept++] = trial->samples[i];
	}
	trial->count = kept;
}

static void what_is_not_heard_is_a_hole(void **state)
{
	struct db_trial trial;

	(void)state;
	add_motion(&trial, 1, 1000, 100, 200);
	assert_float_equal(db_trial_find_hole(&trial), 0, 0);
	/* What came late to this program, which did not run. */
	trial.samples[50].late_ms = 150;
	assert_float_equal(db_trial_find_hole(&trial), 150, 0);
	trial.samples[50].late_ms = 20;
	assert_float_equal(db_trial_find_hole(&trial), 0, 0);
	cut(&trial, 600, 120);
	assert_float_equal(db_trial_find_hole(&trial), 140, 1);
	db_trial_clear(&trial);
	/* A bus with many drives tells each of them seldom. */
	for (double ms = 0; ms < 3000; ms += 150)
		assert_true(db_trial_add(&trial, &(struct db_trial_sample){ .ms = ms }));
	assert_float_equal(db_trial_find_hole(&trial), 0, 0);
	db_trial_clear(&trial);
}

/* One slow reading among fast ones is no stop. */
static void one_slow_sample_is_no_stop(void **state)
{
	struct db_trial trial;
	struct db_trial_figures figures;

	(void)state;
	add_motion(&trial, 1, 1000, 100, 5000);
	for (size_t i = 0; i < trial.count; i++) {
		if (trial.samples[i].ms > 1090 && trial.samples[i].ms < 1110)
			trial.samples[i].position -= 10;
	}
	db_trial_measure(&trial, &figures);
	assert_true(figures.slowed_ms < 0);
	db_trial_clear(&trial);
}

static const json_t *verdict_of(const struct db_commission *commission, const char *setting)
{
	size_t i;
	const json_t *verdict;

	json_array_foreach(commission->verdicts, i, verdict)
	{
		if (strcmp(json_string_value(json_object_get(verdict, "setting")), setting) == 0)
			return verdict;
	}
	fail_msg("nothing is said of %s", setting);
	return NULL;
}

static void expect(const struct db_commission *commission, const char *setting, const char *verdict,
                   const char *right)
{
	const json_t *one = verdict_of(commission, setting);
	const char *said = json_string_value(json_object_get(one, "right"));

	assert_string_equal(json_string_value(json_object_get(one, "verdict")), verdict);
	assert_string_equal(said ? said : "", right);
}

/* Goes through a step with motions up to its MOVE, whose outcome is the trial. */
static void run_speed(struct db_commission *commission, const char *family,
                      const struct db_trial *trial)
{
	struct db_commission_facts facts = { .family = family,
		                             .unit_name = "counts",
		                             .velocity = 1000,
		                             .ms = 1000,
		                             .cycle_ms = 20 };
	struct db_commission_outcome yes = { .answer = "yes", .result = "ok" };
	struct db_commission_outcome moved = { .result = "ok", .trial = trial };
	struct db_commission_action action;

	db_commission_open(commission, &facts);
	db_commission_begin(commission, (size_t)db_commission_find("speed"));
	assert_true(db_commission_next(commission, &yes, &action));
	assert_string_equal(action.id, "uncoupled");
	assert_true(db_commission_next(commission, &yes, &action));
	assert_string_equal(action.id, "speed.go");
	assert_true(db_commission_next(commission, &yes, &action));
	assert_string_equal(action.command, "enable");
	assert_true(db_commission_next(commission, &yes, &action));
	assert_int_equal(action.kind, DB_COMMISSION_MOVE);
	assert_true(action.velocity < 0);
	assert_false(db_commission_next(commission, &moved, &action));
}

static void a_speed_is_judged_by_positions(void **state)
{
	struct db_commission commission;
	struct db_trial trial;

	(void)state;
	add_motion(&trial, -1, -1000, 40, 0);
	run_speed(&commission, "vsmd-can", &trial);
	expect(&commission, "speed-sign", "proven", "");
	expect(&commission, "velocity", "proven", "");
	expect(&commission, "reaction-ms", "proven", "");
	db_commission_close(&commission);
	db_trial_clear(&trial);
	add_motion(&trial, -1, 1000, 400, 0);
	run_speed(&commission, "vsmd-can", &trial);
	expect(&commission, "speed-sign", "contradicted", "position");
	expect(&commission, "reaction-ms", "contradicted", "650");
	db_commission_close(&commission);
	db_trial_clear(&trial);
	add_motion(&trial, -1, 60, 40, 0);
	run_speed(&commission, "servo-can", &trial);
	expect(&commission, "speed-sign", "contradicted", "bits");
	expect(&commission, "counts-per-turn", "contradicted", "1000");
	db_commission_fill(&commission);
	expect(&commission, "enabled-bit", "not seen", "");
	db_commission_close(&commission);
	db_trial_clear(&trial);
}

static struct db_commission begin_at_motion(const char *step,
                                            const struct db_commission_facts *facts,
                                            struct db_commission_action *action)
{
	struct db_commission_outcome yes = { .answer = "yes", .result = "ok" };
	struct db_commission commission;

	db_commission_open(&commission, facts);
	db_commission_begin(&commission, (size_t)db_commission_find(step));
	for (unsigned i = 0; i < 4; i++)
		assert_true(db_commission_next(&commission, &yes, action));
	assert_int_equal(action->kind, DB_COMMISSION_MOVE);
	return commission;
}

/* A reaction that is too late by far: of a computer that stood still it says nothing. */
static void doubtful_times_are_measured_again_and_contradict_nothing(void **state)
{
	struct db_commission_facts facts = { .family = "vsmd-can",
		                             .unit_name = "counts",
		                             .velocity = 1000,
		                             .ms = 1000,
		                             .cycle_ms = 20 };
	struct db_commission_outcome moved = { .result = "ok" };
	struct db_commission commission;
	struct db_commission_action action;
	struct db_trial doubtful;
	struct db_trial sure;

	(void)state;
	add_motion(&doubtful, -1, -1000, 400, 0);
	cut(&doubtful, 100, 120);
	add_motion(&sure, -1, -1000, 400, 0);
	/* Three times in vain. */
	commission = begin_at_motion("speed", &facts, &action);
	moved.trial = &doubtful;
	for (unsigned i = 0; i < 2; i++) {
		action = (struct db_commission_action){ .kind = DB_COMMISSION_READ };
		assert_true(db_commission_next(&commission, &moved, &action));
		assert_int_equal(action.kind, DB_COMMISSION_MOVE);
		assert_true(action.again && action.velocity < 0);
	}
	assert_false(db_commission_next(&commission, &moved, &action));
	expect(&commission, "reaction-ms", "not seen", "");
	/* What is not judged by times stays. */
	expect(&commission, "velocity", "proven", "");
	db_commission_close(&commission);
	/* The second one is good. */
	commission = begin_at_motion("speed", &facts, &action);
	assert_true(db_commission_next(&commission, &moved, &action));
	moved.trial = &sure;
	assert_false(db_commission_next(&commission, &moved, &action));
	expect(&commission, "reaction-ms", "contradicted", "650");
	db_commission_close(&commission);
	db_trial_clear(&doubtful);
	db_trial_clear(&sure);
}

static void judge_watchdog(double ms, double late, const char *verdict)
{
	char text[16];
	json_t *keys = json_object();
	struct db_commission_facts facts = { .family = "vsmd-can",
		                             .unit_name = "counts",
		                             .velocity = 1000,
		                             .ms = 500,
		                             .cycle_ms = 20,
		                             .drive_keys = keys };
	struct db_commission_outcome moved = { .result = "ok" };
	struct db_commission commission;
	struct db_commission_action action;
	struct db_trial trial;

	(void)snprintf(text, sizeof(text), "%.0f", ms);
	(void)json_object_set_new(keys, "watchdog-ms", json_string(text));
	add_motion(&trial, 1, 1000, 40, late);
	moved.trial = &trial;
	commission = begin_at_motion("watchdog", &facts, &action);
	assert_true(action.unheld && action.ms == 1000);
	assert_string_equal(action.ending, "silence");
	/* It stands until its fault is cleared. */
	assert_true(db_commission_next(&commission, &moved, &action));
	assert_string_equal(action.command, "clear_fault");
	assert_false(db_commission_next(&commission, &moved, &action));
	expect(&commission, "watchdog-ms", verdict, "");
	db_commission_close(&commission);
	json_decref(keys);
	db_trial_clear(&trial);
}

static void a_watchdog_is_proven_in_its_time(void **state)
{
	(void)state;
	judge_watchdog(1000, 60, "proven");
	judge_watchdog(1000, 700, "contradicted");
	judge_watchdog(1000, 5000, "contradicted");
	judge_watchdog(1000, -300, "contradicted");
}

/* Nothing turns for a watchdog that is off, or would take too long. */
static void a_watchdog_that_cannot_be_tried_is_not_seen(void **state)
{
	static const char *const settings[] = { "0", "20000" };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		json_t *keys = json_pack("{s:s}", "watchdog-ms", settings[i]);
		struct db_commission_facts facts = { .family = "xyza",
			                             .unit_name = "counts",
			                             .drive_keys = keys };
		struct db_commission_outcome none = { .result = "ok" };
		struct db_commission commission;
		struct db_commission_action action;

		db_commission_open(&commission, &facts);
		db_commission_begin(&commission, (size_t)db_commission_find("watchdog"));
		assert_false(db_commission_next(&commission, &none, &action));
		expect(&commission, "watchdog-ms", "not seen", "");
		db_commission_close(&commission);
		json_decref(keys);
	}
}

/* The step of round trips, with a drive's values before and after two seconds of reading. */
static void try_round_trips(struct db_commission *commission, json_t *before, json_t *after)
{
	struct db_commission_action action;
	struct db_commission_outcome outcome = { .result = "" };
	struct db_trial trial = { .ended_ms = -1 };

	db_commission_begin(commission, (size_t)db_commission_find("round-trips"));
	assert_true(db_commission_next(commission, &outcome, &action));
	outcome.values = before;
	assert_true(db_commission_next(commission, &outcome, &action));
	assert_int_equal(action.kind, DB_COMMISSION_WATCH);
	outcome.trial = &trial;
	assert_true(db_commission_next(commission, &outcome, &action));
	outcome.values = after;
	assert_false(db_commission_next(commission, &outcome, &action));
	json_decref(before);
	json_decref(after);
}

/* With adapt = on everything works, which hides the setting that is wrong. */
static void what_was_learnt_is_to_be_written_down(void **state)
{
	struct db_commission_facts facts = { .family = "vsmd-can", .unit_name = "counts" };
	struct db_commission commission;

	(void)state;
	db_commission_open(&commission, &facts);
	try_round_trips(&commission, json_pack("{s:i}", "requests", 100),
	                json_pack("{s:b, s:i, s:i, s:i, s:i}", "online", 1, "requests", 200,
	                          "learnt_latency_ms", 57, "round_trip_max_us", 42000,
	                          "round_trip_mean_us", 41000));
	expect(&commission, "drive-latency-ms", "contradicted", "63");
	db_commission_close(&commission);
}

static void few_late_answers_are_no_pattern(void **state)
{
	struct db_commission_facts facts = { .family = "vsmd-serial", .unit_name = "counts" };

	(void)state;
	for (int late = 2; late <= 3; late++) {
		struct db_commission commission;

		db_commission_open(&commission, &facts);
		try_round_trips(&commission, json_pack("{s:i}", "requests", 100),
		                json_pack("{s:b, s:b, s:i, s:i}", "online", 1, "late", 1,
		                          "requests", 200, "timeouts", late));
		expect(&commission, "drive-latency-ms", late < 3 ? "not seen" : "contradicted",
		       late < 3 ? "" : "60");
		expect(&commission, "turnaround-us", "not seen", "");
		db_commission_close(&commission);
	}
}

/* Without a yes nothing is asked for that moves or gives power. */
static void nothing_moves_without_a_yes(void **state)
{
	json_t *keys = json_pack("{s:s}", "max-velocity", "100");
	struct db_commission_facts facts = {
		.family = "xyza", .unit_name = "counts", .drive_keys = keys, .max_velocity = 100
	};
	struct db_commission_outcome no = { .answer = NULL };
	struct db_commission commission;
	struct db_commission_action action;

	(void)state;
	db_commission_open(&commission, &facts);
	for (size_t i = 0; db_commission_list[i].name; i++) {
		if (!db_commission_list[i].moves)
			continue;
		db_commission_begin(&commission, i);
		assert_true(db_commission_next(&commission, &no, &action));
		assert_int_equal(action.kind, DB_COMMISSION_ASK);
		assert_false(db_commission_next(&commission, &no, &action));
	}
	db_commission_close(&commission);
	json_decref(keys);
}

static void answers_are_choices(void **state)
{
	char answer[64];

	(void)state;
	assert_true(db_commission_choose("clockwise counterclockwise none", "cl", answer, 64));
	assert_string_equal(answer, "clockwise");
	assert_false(db_commission_choose("clockwise counterclockwise none", "c", answer, 64));
	assert_false(db_commission_choose("yes no", "y", answer, 64));
	assert_true(db_commission_choose("yes no", "yes", answer, 64));
	assert_false(db_commission_choose("yes no", "", answer, 64));
	assert_true(db_commission_choose("", "0.25", answer, 64));
	assert_false(db_commission_choose("", "-1", answer, 64));
	assert_false(db_commission_choose("", "nan", answer, 64));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(figures_are_of_the_motion),
		cmocka_unit_test(what_is_not_heard_is_a_hole),
		cmocka_unit_test(one_slow_sample_is_no_stop),
		cmocka_unit_test(a_speed_is_judged_by_positions),
		cmocka_unit_test(doubtful_times_are_measured_again_and_contradict_nothing),
		cmocka_unit_test(a_watchdog_is_proven_in_its_time),
		cmocka_unit_test(a_watchdog_that_cannot_be_tried_is_not_seen),
		cmocka_unit_test(what_was_learnt_is_to_be_written_down),
		cmocka_unit_test(few_late_answers_are_no_pattern),
		cmocka_unit_test(nothing_moves_without_a_yes),
		cmocka_unit_test(answers_are_choices),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
