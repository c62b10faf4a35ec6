/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/tries.h"
#include "commission/judge.h"
#include "words/value.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool is_servo(const struct db_commission *commission)
{
	return strcmp(commission->facts.family, "servo-can") == 0;
}

static double number_of(const json_t *values, const char *name)
{
	return json_number_value(json_object_get(values, name));
}

/* Settings for which a family has a section of its own. */
static const char *reaction_section(const struct db_commission *commission)
{
	return strcmp(commission->facts.family, "xyza") == 0 ? "bus" : "drive";
}

/* So many late answers of one step are the drive's. Fewer may be the computer's, which was busy. */
#define LATE_ANSWERS 3

/* Suggests one and a half times the longest observed latency, or twice the setting if every answer
 * was too late. */
static void judge_latency(struct db_commission *commission, const json_t *values)
{
	double latency = db_commission_number(commission, "bus", "drive-latency-ms");
	double lost = number_of(values, "timeouts") - number_of(commission->before, "timeouts");
	double asked = number_of(values, "requests") - number_of(commission->before, "requests");
	double longest = number_of(values, "round_trip_max_us") / 1000;
	double learnt = number_of(values, "learnt_latency_ms");
	bool has_learnt = learnt > latency;
	char right[32];

	snprintf(right, sizeof(right), "%.0f",
	         has_learnt ? ceil(fmax(learnt, 1.5 * longest)) : 2 * latency);
	if (has_learnt)
		db_commission_judge(
			commission, "bus", "drive-latency-ms", DB_COMMISSION_CONTRADICTED, right,
			"its answers are found only because the service has learnt to wait %.0f ms "
			"(adapt = on); they took up to %.0f ms. Written down, it holds from the "
			"start",
			learnt, longest);
	else if (db_words_flag(values, "late") && (commission->absent || lost >= LATE_ANSWERS))
		db_commission_judge(
			commission, "bus", "drive-latency-ms", DB_COMMISSION_CONTRADICTED, right,
			"answers came after they had been given up, later than %.0f ms; how much "
			"later was not measured: run this step again with it",
			latency);
	else if (db_words_flag(values, "late") && lost > 0)
		db_commission_judge(commission, "bus", "drive-latency-ms", DB_COMMISSION_NOT_SEEN,
		                    NULL,
		                    "%.0f of %.0f answers came late, which is doubtful: the "
		                    "computer may have been busy. Run this step again",
		                    lost, asked);
	else if (lost > 0)
		db_commission_judge(commission, "bus", "drive-latency-ms", DB_COMMISSION_NOT_SEEN,
		                    NULL,
		                    "%.0f of %.0f answers were lost: look at cable and termination",
		                    lost, asked);
	else
		db_commission_judge(
			commission, "bus", "drive-latency-ms", DB_COMMISSION_PROVEN, NULL,
			"%.0f answers, none lost; round trips %.1f ms at a mean, %.1f ms at most",
			asked, number_of(values, "round_trip_mean_us") / 1000, longest);
}

static void judge_turnaround(struct db_commission *commission, const json_t *values)
{
	const char *now = db_commission_setting(commission, "bus", "turnaround-us");
	double lost = number_of(values, "timeouts") - number_of(commission->before, "timeouts");
	double learnt = number_of(values, "learnt_gap_us");
	char right[32];

	if (strcmp(commission->facts.family, "vsmd-serial") != 0 &&
	    strcmp(commission->facts.family, "xyza") != 0)
		return;
	snprintf(right, sizeof(right), "%.0f",
	         learnt > 0 ? learnt : fmax(6000, 2 * strtod(now, NULL)));
	if (db_words_flag(values, "deaf") && learnt > 0)
		db_commission_judge(commission, "bus", "turnaround-us", DB_COMMISSION_CONTRADICTED,
		                    right,
		                    "it did not hear what followed its own answers at once; the "
		                    "service has learnt to leave %.0f us",
		                    learnt);
	else if (db_words_flag(values, "deaf"))
		db_commission_judge(commission, "bus", "turnaround-us", DB_COMMISSION_CONTRADICTED,
		                    right,
		                    "it does not hear what follows its own answers at once; how "
		                    "much it needs was not measured: run this step again with it");
	else if (lost == 0)
		db_commission_judge(commission, "bus", "turnaround-us", DB_COMMISSION_PROVEN, NULL,
		                    "no question behind an answer was lost");
	else
		db_commission_judge(commission, "bus", "turnaround-us", DB_COMMISSION_NOT_SEEN,
		                    NULL,
		                    "%.0f answers were lost, so it is doubtful whether it heard "
		                    "every question: run this step again",
		                    lost);
}

bool db_commission_try_presence(struct db_commission *commission, unsigned stage,
                                const struct db_commission_outcome *outcome,
                                struct db_commission_action *action)
{
	const json_t *values = outcome ? outcome->values : NULL;
	const char *trouble = db_words_text(values, "trouble");

	(void)action; /* the preset action, a read */
	if (stage == 0)
		return true;
	commission->absent = !db_words_flag(values, "online");
	/* Without an answer this is the last step, so what was learnt is judged now. With answers
	 * the step of round trips measures: one late answer on a busy computer is no pattern. */
	if (db_words_flag(values, "late") &&
	    (commission->absent || number_of(values, "learnt_latency_ms") > 0))
		judge_latency(commission, values);
	if (db_words_flag(values, "deaf"))
		judge_turnaround(commission, values);
	if (commission->absent)
		db_commission_judge(commission, "drive", "address", DB_COMMISSION_CONTRADICTED,
		                    NULL, "it does not answer (%s): %s", trouble,
		                    db_words_text(values, "advice"));
	else if (strcmp(trouble, "two_drives") == 0)
		db_commission_judge(commission, "drive", "address", DB_COMMISSION_CONTRADICTED,
		                    NULL, "two drives answer at this address: %s",
		                    db_words_text(values, "advice"));
	else
		db_commission_judge(commission, "drive", "address", DB_COMMISSION_PROVEN, NULL,
		                    "it answers there%s%s",
		                    db_words_text(values, "identity")[0] ? " and says that it is " :
		                                                           "",
		                    db_words_text(values, "identity"));
	return false;
}

bool db_commission_try_round_trips(struct db_commission *commission, unsigned stage,
                                   const struct db_commission_outcome *outcome,
                                   struct db_commission_action *action)
{
	if (stage == 1) {
		json_decref(commission->before);
		commission->before = json_deep_copy(outcome->values);
		(void)db_commission_watch(action, 2000, DB_COMMISSION_TIME);
		action->timed = true;
		return true;
	}
	if (stage < 3)
		return true; /* the preset action, a read */
	judge_latency(commission, outcome->values);
	judge_turnaround(commission, outcome->values);
	return false;
}

static void judge_standing(struct db_commission *commission, const struct db_trial_figures *figures)
{
	double unit = db_commission_number(commission, "drive", "counts-per-unit");
	double window = db_commission_number(commission, "drive", "in-position-window") * unit;
	char right[32];

	snprintf(right, sizeof(right), "%.6g", (figures->span + 1) / unit);
	if (figures->ever_moving)
		db_commission_judge(commission, "", "status", DB_COMMISSION_CONTRADICTED,
		                    is_servo(commission) ? "raise standstill-speed" : NULL,
		                    "it says that it moves while its position goes to and fro by "
		                    "%.0f counts",
		                    figures->span);
	else
		db_commission_judge(commission, "", "status", DB_COMMISSION_PROVEN, NULL,
		                    "it says that it stands, and its position stays");
	if (figures->span > window)
		db_commission_judge(commission, "drive", "in-position-window",
		                    DB_COMMISSION_CONTRADICTED, right,
		                    "its position goes to and fro by %.0f counts while it stands",
		                    figures->span);
}

bool db_commission_try_standing(struct db_commission *commission, unsigned stage,
                                const struct db_commission_outcome *outcome,
                                struct db_commission_action *action)
{
	struct db_trial_figures figures;
	double way;

	switch (stage) {
	case 0:
		return db_commission_watch(action, 1000, DB_COMMISSION_TIME);
	case 1:
		db_trial_measure(outcome->trial, &figures);
		judge_standing(commission, &figures);
		return db_commission_run(action, "disable");
	case 2:
		return true;
	case 3:
		commission->remembered = number_of(outcome->values, "position");
		return db_commission_ask(action, "standing.turned", "turned skip",
		                         "The motor has no power now. Turn the shaft by hand by a "
		                         "part of a turn, and leave it there.");
	case 4:
		if (!db_commission_answered(outcome, "turned"))
			return false;
		return true;
	default:
		way = fabs(number_of(outcome->values, "position") - commission->remembered);
		if (way > DB_TRIAL_DITHER)
			db_commission_judge(commission, "", "hand", DB_COMMISSION_PROVEN, NULL,
			                    "its position follows the shaft: %.0f counts", way);
		else
			db_commission_judge(
				commission, "", "hand",
				is_servo(commission) ? DB_COMMISSION_CONTRADICTED :
						       DB_COMMISSION_NOT_SEEN,
				NULL,
				"its position does not follow a shaft that is turned by hand: it "
				"has to be homed after its power was off");
		return false;
	}
}

/* The result of enable, together with what the user felt by hand. */
static void judge_enable(struct db_commission *commission,
                         const struct db_commission_outcome *outcome)
{
	bool servo = is_servo(commission);
	char right[32];

	if (db_commission_answered(outcome, "yes")) {
		db_commission_judge(commission, "", "enable", DB_COMMISSION_PROVEN, NULL,
		                    "the shaft held; it was told after %.0f ms",
		                    commission->remembered);
		if (servo)
			db_commission_judge(commission, "drive", "enabled-bit",
			                    DB_COMMISSION_PROVEN, NULL,
			                    "the shaft held when the bit said so");
	} else if (db_commission_answered(outcome, "no")) {
		snprintf(right, sizeof(right), "%d",
		         db_commission_number(commission, "drive", "enabled-bit") == 0);
		db_commission_judge(commission, servo ? "drive" : "",
		                    servo ? "enabled-bit" : "enable", DB_COMMISSION_CONTRADICTED,
		                    servo ? right :
		                            "look at the motor's wires, a brake and the current "
		                            "(crh of a VSMD drive)",
		                    "it says that the motor has power, and the shaft did not hold");
	}
}

/* After a failed enable the drive was watched: did it report later that its motor has power? */
#define WATCH_POWER_MS 2000

static void judge_late_power(struct db_commission *commission, const struct db_trial *trial)
{
	double told = -1;
	char right[32];

	for (size_t i = 0; i < trial->count && told < 0; i++) {
		if (trial->samples[i].enabled)
			told = commission->remembered + fmax(trial->samples[i].ms, 0);
	}
	if (told < 0) {
		db_commission_judge(
			commission, "", "enable", DB_COMMISSION_CONTRADICTED,
			is_servo(commission) ?
				"look at its supply and its enable input, then try the other "
				"enabled-bit" :
				"look at its supply and its enable input",
			"enable failed after %.0f ms, and %d ms later it still did not say that "
			"its motor has power",
			commission->remembered, WATCH_POWER_MS);
		return;
	}
	db_commission_write_ms(1.5 * told, right);
	db_commission_judge(commission, reaction_section(commission), "reaction-ms",
	                    DB_COMMISSION_CONTRADICTED, right,
	                    "enable failed after %.0f ms, and it said after %.0f ms that its motor "
	                    "has power",
	                    commission->remembered, told);
}

bool db_commission_try_power(struct db_commission *commission, unsigned stage,
                             const struct db_commission_outcome *outcome,
                             struct db_commission_action *action)
{
	switch (stage) {
	case 0:
		return db_commission_run(action, "disable");
	case 1:
		return db_commission_run(action, "enable");
	case 2:
		commission->remembered = outcome->took_ms;
		if (strcmp(outcome->result, "ok") == 0 || strcmp(outcome->result, "unproven") == 0)
			return db_commission_ask(action, "power.holds", "yes no skip",
			                         "Does the shaft hold when you try to turn it by "
			                         "hand?");
		/* It may report it only later. */
		return db_commission_watch(action, WATCH_POWER_MS, DB_COMMISSION_TIME);
	case 3:
		if (outcome->answer)
			judge_enable(commission, outcome);
		else if (outcome->trial)
			judge_late_power(commission, outcome->trial);
		return db_commission_run(action, "disable");
	case 4:
		return db_commission_ask(action, "power.free", "yes no skip",
		                         "The power is off. Can the shaft be turned by hand now?");
	default:
		if (db_commission_answered(outcome, "yes"))
			db_commission_judge(commission, "", "disable", DB_COMMISSION_PROVEN, NULL,
			                    "the shaft was free without power");
		else if (db_commission_answered(outcome, "no"))
			db_commission_judge(
				commission, "", "disable", DB_COMMISSION_CONTRADICTED,
				"nothing, if a brake holds it; else disable does not reach "
				"this drive",
				"the shaft still held when the power was told to be off");
		return false;
	}
}

bool db_commission_judge_reaction(struct db_commission *commission, const char *setting,
                                  const char *result)
{
	const char *section = reaction_section(commission);
	const struct db_trial_figures *figures = &commission->figures;
	double allowed = db_commission_number(commission, section, "reaction-ms");
	bool failed = strcmp(result, "failed") == 0;
	double began = fmax(figures->began_ms, failed ? figures->shown_moving_ms : 0);
	char right[32];

	if (figures->began_ms < 0) {
		db_commission_write_ms(4 * allowed, right);
		if (failed)
			db_commission_judge(commission, section, "reaction-ms",
			                    DB_COMMISSION_CONTRADICTED, right,
			                    "nothing moved within %.0f ms, and the command failed; "
			                    "run this step again with it",
			                    allowed);
		db_commission_judge(commission, "", setting, DB_COMMISSION_NOT_SEEN, NULL,
		                    "nothing moved: the motion ended as %s", result);
		return false;
	}
	db_commission_write_ms(began > allowed ? 1.5 * began : 4 * allowed, right);
	/* A drive that counts backwards has failed for that reason. */
	if (failed && began <= allowed && figures->way * commission->direction > 0)
		db_commission_judge(
			commission, section, "reaction-ms", DB_COMMISSION_CONTRADICTED, right,
			"it began after %.0f ms, but did not say within %.0f ms that it "
			"moves, and the command failed; run this step again with it",
			figures->began_ms, allowed);
	else if (began > allowed + commission->facts.cycle_ms)
		db_commission_judge(commission, section, "reaction-ms", DB_COMMISSION_CONTRADICTED,
		                    right, "it began %.0f ms after the command", began);
	else
		db_commission_judge(commission, section, "reaction-ms", DB_COMMISSION_PROVEN, NULL,
		                    "it began %.0f ms after the command", figures->began_ms);
	return true;
}

bool db_commission_try_motion(struct db_commission *commission, unsigned stage,
                              const struct db_commission_outcome *outcome,
                              struct db_commission_action *action)
{
	double way;

	switch (stage) {
	case 0:
		return db_commission_move(commission, action, 1, "stop");
	case 1:
		db_trial_measure(outcome->trial, &commission->figures);
		(void)db_commission_judge_reaction(commission, "direction", outcome->result);
		if (commission->figures.way < -DB_TRIAL_DITHER)
			db_commission_judge(commission, "", "position", DB_COMMISSION_CONTRADICTED,
			                    "turn the counting of the encoder around",
			                    "told forwards, its position fell by %.0f counts",
			                    -commission->figures.way);
		/* It may have turned without counting, but not without a command. */
		if (commission->figures.began_ms < 0 && strcmp(outcome->result, "limit") == 0)
			return false;
		return db_commission_ask(action, "motion.turned",
		                         "clockwise counterclockwise none skip",
		                         "Looking at the end of the shaft: which way did it turn?");
	case 2:
		way = commission->figures.way;
		if (db_commission_answered(outcome, "none")) {
			db_commission_judge(
				commission, "", "motion", DB_COMMISSION_CONTRADICTED,
				"look at the motor's wires and its current",
				"the shaft did not turn, and the position changed by %.0f "
				"counts",
				way);
			return false;
		}
		if (!outcome->answer || db_commission_answered(outcome, "skip"))
			return false;
		if (fabs(way) <= DB_TRIAL_DITHER)
			db_commission_judge(commission, "", "motion", DB_COMMISSION_CONTRADICTED,
			                    "look at its encoder",
			                    "the shaft turned %s, and the position stayed",
			                    outcome->answer);
		else
			db_commission_judge(commission, "", "motion", DB_COMMISSION_PROVEN, NULL,
			                    "told forwards, the shaft turned %s and the position "
			                    "changed by %.0f counts",
			                    outcome->answer, way);
		return db_commission_ask(action, "motion.forward", "yes no skip",
		                         "Is that the way that is positive on your machine?");
	default:
		if (db_commission_answered(outcome, "yes"))
			db_commission_judge(commission, "", "direction", DB_COMMISSION_PROVEN, NULL,
			                    "it turned the way that is positive on the machine");
		else if (db_commission_answered(outcome, "no"))
			db_commission_judge(
				commission, "", "direction", DB_COMMISSION_CONTRADICTED,
				is_servo(commission) ?
					"turn the direction around with the vendor's tool" :
					"swap the two wires of one phase of the motor (of a closed "
					"loop, its encoder's too)",
				"told forwards, it turned the other way; no key of the "
				"configuration turns a drive around");
		return false;
	}
}

/* Compares the reported velocity with the one from its positions, backwards. */
static void judge_speed(struct db_commission *commission)
{
	double speed = commission->figures.speed;
	double told = commission->figures.told;
	double turn = db_commission_number(commission, "drive", "counts-per-turn");
	double expected = is_servo(commission) ? (turn > 0 ? speed * 60 / turn : 0) : speed;
	bool vsmd = strncmp(commission->facts.family, "vsmd", strlen("vsmd")) == 0;
	char right[32];

	if (fabs(told) < 1e-3) {
		db_commission_judge(
			commission, "", "velocity", DB_COMMISSION_CONTRADICTED,
			"do not look at velocity: a program has to judge by position and "
			"status",
			"it told 0 while its position changed by %.0f counts a second", speed);
		return;
	}
	if ((told > 0) != (speed > 0))
		db_commission_judge(commission, "drive", "speed-sign", DB_COMMISSION_CONTRADICTED,
		                    is_servo(commission) ? "bits" :
		                    vsmd                 ? "position" :
		                                           NULL,
		                    "it told %.6g while its position fell by %.0f counts a second",
		                    told, -speed);
	else if (is_servo(commission) || vsmd)
		db_commission_judge(commission, "drive", "speed-sign", DB_COMMISSION_PROVEN, NULL,
		                    "it told %.6g while its position fell", told);
	if (is_servo(commission)) {
		snprintf(right, sizeof(right), "%.0f", fabs(speed * 60 / told));
		db_commission_judge(
			commission, "drive", "counts-per-turn",
			turn > 0 && fabs(fabs(expected / told) - 1) < 0.05 ?
				DB_COMMISSION_PROVEN :
				DB_COMMISSION_CONTRADICTED,
			turn > 0 && fabs(fabs(expected / told) - 1) < 0.05 ? NULL : right,
			"at %.4g rpm its position changed by %.0f counts a second", told, speed);
	} else if (fabs(fabs(told / expected) - 1) < 0.1)
		db_commission_judge(
			commission, "", "velocity", DB_COMMISSION_PROVEN, NULL,
			"it told %.6g, and its position changed by %.6g counts a second", told,
			speed);
	else
		db_commission_judge(
			commission, "", "velocity", DB_COMMISSION_CONTRADICTED, NULL,
			"it told %.6g, and its position changed by %.6g counts a second", told,
			speed);
}

bool db_commission_try_speed(struct db_commission *commission, unsigned stage,
                             const struct db_commission_outcome *outcome,
                             struct db_commission_action *action)
{
	if (stage == 0)
		return db_commission_move(commission, action, -1, "stop");
	db_trial_measure(outcome->trial, &commission->figures);
	if (!db_commission_judge_reaction(commission, "velocity", outcome->result))
		return false;
	if (commission->figures.speed < -DB_TRIAL_DITHER)
		judge_speed(commission);
	else
		db_commission_judge(
			commission, "", "velocity", DB_COMMISSION_NOT_SEEN, NULL,
			"told backwards, its position did not fall: look at step motion");
	return false;
}
