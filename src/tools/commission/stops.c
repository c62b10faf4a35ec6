/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/stops.h"
#include "commission/judge.h"
#include "commission/tries.h"
#include "words/value.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The service's dead man's rule ends a motion this long after the last keep-alive. */
#define HOLD_MS 300

static void judge_stop(struct db_commission *commission,
                       const struct db_commission_outcome *outcome)
{
	const struct db_trial_figures *figures = &commission->figures;
	double setting = db_commission_number(commission, "drive", "stop-reaction-ms");
	double late = figures->shown_ms - fmax(figures->stood_ms, 0);
	char right[32];

	db_commission_write_ms(2 * figures->slowed_ms, right);
	if (figures->lost_power)
		db_commission_judge(commission, "", "stop", DB_COMMISSION_CONTRADICTED,
		                    "a stop of this drive takes the power off: hold loads with a "
		                    "brake",
		                    "its motor had no power any more after stop: it coasts");
	if (figures->slowed_ms < 0)
		db_commission_judge(commission, "", "stop", DB_COMMISSION_CONTRADICTED,
		                    "do not let it move a machine before that is known: take its "
		                    "power off to stop it (on-client-loss = disable)",
		                    "it did not slow down after stop (%s)", outcome->result);
	else if (figures->slowed_ms > setting)
		db_commission_judge(commission, "drive", "stop-reaction-ms",
		                    DB_COMMISSION_CONTRADICTED, right,
		                    "it slowed down %.0f ms after stop", figures->slowed_ms);
	else
		db_commission_judge(commission, "drive", "stop-reaction-ms", DB_COMMISSION_PROVEN,
		                    NULL, "it slowed down %.0f ms after stop", figures->slowed_ms);
	if (figures->shown_ms < 0)
		db_commission_judge(
			commission, "", "standing", DB_COMMISSION_CONTRADICTED, NULL,
			"it was not told as standing before this step ended; its position "
			"changed last %.0f ms after stop",
			figures->stood_ms);
	else
		db_commission_judge(
			commission, "", "standing",
			late > 100 + 2 * commission->facts.cycle_ms ? DB_COMMISSION_CONTRADICTED :
								      DB_COMMISSION_PROVEN,
			NULL,
			"its position changed last %.0f ms after stop, and it was told as "
			"standing %.0f ms after that",
			figures->stood_ms, late);
}

/* What the user saw, in addition to the measurements. */
static void judge_seen(struct db_commission *commission,
                       const struct db_commission_outcome *outcome)
{
	if (db_commission_answered(outcome, "ramp") || db_commission_answered(outcome, "at-once"))
		db_commission_judge(commission, "", "stop", DB_COMMISSION_PROVEN, NULL,
		                    "it stopped (%s) within %.0f counts, and stood after %.0f ms",
		                    outcome->answer, fabs(commission->figures.stop_way),
		                    commission->figures.stood_ms);
	else if (db_commission_answered(outcome, "coasts"))
		db_commission_judge(commission, "", "stop", DB_COMMISSION_CONTRADICTED,
		                    "a stop of this drive takes the power off: hold loads with a "
		                    "brake",
		                    "the shaft coasted after stop instead of being held");
	else if (db_commission_answered(outcome, "runs"))
		db_commission_judge(commission, "", "stop", DB_COMMISSION_CONTRADICTED,
		                    "take its power off to stop it (on-client-loss = disable)",
		                    "the shaft went on turning after stop");
}

bool db_commission_try_stop(struct db_commission *commission, unsigned stage,
                            const struct db_commission_outcome *outcome,
                            struct db_commission_action *action)
{
	struct db_trial_figures figures;

	switch (stage) {
	case 0:
		return db_commission_move(commission, action, 1, "stop");
	case 1:
		db_trial_measure(outcome->trial, &commission->figures);
		if (!db_commission_judge_reaction(commission, "stop", outcome->result))
			return false;
		judge_stop(commission, outcome);
		return db_commission_ask(
			action, "stop.seen", "ramp at-once coasts runs skip",
			"How did the shaft end: down a ramp, at once, did it coast "
			"without being held, or does it run on?");
	case 2:
		judge_seen(commission, outcome);
		return db_commission_move(commission, action, -1, "quick_stop");
	default:
		db_trial_measure(outcome->trial, &figures);
		if (figures.began_ms < 0) {
			db_commission_judge(commission, "", "quick_stop", DB_COMMISSION_NOT_SEEN,
			                    NULL, "nothing moved: the motion ended as %s",
			                    outcome->result);
			return false;
		}
		if (figures.stood_ms > 1.2 * commission->figures.stood_ms + 100)
			db_commission_judge(
				commission, "", "quick_stop", DB_COMMISSION_CONTRADICTED,
				"use stop",
				"it stood %.0f ms after quick_stop, and %.0f ms after stop",
				figures.stood_ms, commission->figures.stood_ms);
		else
			db_commission_judge(commission, "", "quick_stop", DB_COMMISSION_PROVEN,
			                    NULL,
			                    "it stood %.0f ms and %.0f counts after quick_stop",
			                    fmax(figures.stood_ms, 0), fabs(figures.stop_way));
		return false;
	}
}

bool db_commission_try_silence(struct db_commission *commission, unsigned stage,
                               const struct db_commission_outcome *outcome,
                               struct db_commission_action *action)
{
	const struct db_trial_figures *figures = &commission->figures;

	if (stage == 0)
		return db_commission_move(commission, action, 1, "silence");
	db_trial_measure(outcome->trial, &commission->figures);
	if (!db_commission_judge_reaction(commission, "silence", outcome->result))
		return false;
	if (figures->slowed_ms < 0 || figures->slowed_ms > DB_COMMISSION_SILENT_MS)
		db_commission_judge(commission, "", "silence", DB_COMMISSION_CONTRADICTED,
		                    "look at on-client-loss",
		                    "it went on although nobody said any more that it is to move");
	else
		db_commission_judge(
			commission, "", "silence", DB_COMMISSION_PROVEN, NULL,
			"the service stopped it %.0f ms after the last sign of life (%d "
			"are allowed), and it stood after %.0f ms",
			figures->slowed_ms, HOLD_MS, figures->stood_ms);
	return false;
}

/* A longer watchdog would turn the motor for longer than a trial may. */
#define WATCHDOG_MAX_MS 5000
/* How late it may be: it is checked in each cycle of the bus, and the stop has to be sent and
 * carried out. */
#define WATCHDOG_LATE_MS 250

static void judge_watchdog(struct db_commission *commission, double watchdog)
{
	const struct db_trial_figures *figures = &commission->figures;

	if (figures->stood_ms < 0)
		db_commission_judge(
			commission, "drive", "watchdog-ms", DB_COMMISSION_CONTRADICTED, NULL,
			"it stood already %.0f ms after the client's last word: somebody "
			"else, or something else, stopped it",
			watchdog);
	else if (figures->slowed_ms < 0 || figures->slowed_ms > DB_COMMISSION_SILENT_MS)
		db_commission_judge(
			commission, "drive", "watchdog-ms", DB_COMMISSION_CONTRADICTED, NULL,
			"it went on for more than %.0f ms after the client's last word: look at "
			"on-client-loss and watchdog-feed; this program stopped it",
			watchdog);
	else
		db_commission_judge(commission, "drive", "watchdog-ms",
		                    figures->slowed_ms > WATCHDOG_LATE_MS +
		                                                 2 * commission->facts.cycle_ms ?
		                            DB_COMMISSION_CONTRADICTED :
		                            DB_COMMISSION_PROVEN,
		                    NULL,
		                    "a client said nothing any more, and it slowed down after "
		                    "%.0f ms%s",
		                    watchdog + figures->slowed_ms,
		                    figures->lost_power ? ", without power" : "");
}

bool db_commission_can_watchdog(struct db_commission *commission)
{
	double watchdog = db_commission_number(commission, "drive", "watchdog-ms");

	if (watchdog > 0 && watchdog <= WATCHDOG_MAX_MS)
		return true;
	if (watchdog <= 0)
		db_commission_judge(
			commission, "drive", "watchdog-ms", DB_COMMISSION_NOT_SEEN, NULL,
			"it is off: nothing stops the drive when its client falls silent");
	else
		db_commission_judge(commission, "drive", "watchdog-ms", DB_COMMISSION_NOT_SEEN,
		                    NULL,
		                    "%.0f ms is longer than a trial may turn the motor (%d ms)",
		                    watchdog, WATCHDOG_MAX_MS);
	return false;
}

bool db_commission_try_watchdog(struct db_commission *commission, unsigned stage,
                                const struct db_commission_outcome *outcome,
                                struct db_commission_action *action)
{
	double watchdog = db_commission_number(commission, "drive", "watchdog-ms");

	/* A drive that its watchdog has stopped does not move before its fault is cleared. */
	if (stage % 2 == 1) {
		db_trial_measure(outcome->trial, &commission->figures);
		if (db_commission_judge_reaction(commission, "watchdog", outcome->result))
			judge_watchdog(commission, watchdog);
		commission->remembered = commission->doubt_ms;
		return db_commission_run(action, "clear_fault");
	}
	if (stage > 0 && (commission->remembered <= 0 || stage > 2 * DB_COMMISSION_REPEATS_MAX))
		return false;
	(void)db_commission_move(commission, action, 1, "silence");
	action->ms = (unsigned)watchdog;
	action->unheld = true;
	action->timed = false;
	action->again = stage > 0;
	return true;
}

/* A number that the user measured; below 0: none. */
static double answer_number(const struct db_commission_outcome *outcome)
{
	double value = outcome->answer ? strtod(outcome->answer, NULL) : 0;

	return isfinite(value) && value > 0 ? value : -1;
}

static void judge_scale(struct db_commission *commission, const char *setting, double counts,
                        double measured)
{
	double now = db_commission_number(commission, "drive", setting);
	bool right = now > 0 && fabs(counts / measured / now - 1) < 0.05;
	char text[32];

	snprintf(text, sizeof(text), "%.6g", counts / measured);
	db_commission_judge(commission, "drive", setting,
	                    right ? DB_COMMISSION_PROVEN : DB_COMMISSION_CONTRADICTED,
	                    right ? NULL : text, "%.0f counts were %.6g, as it was measured",
	                    counts, measured);
}

bool db_commission_try_scale(struct db_commission *commission, unsigned stage,
                             const struct db_commission_outcome *outcome,
                             struct db_commission_action *action)
{
	bool servo = strcmp(commission->facts.family, "servo-can") == 0;
	double counts = fabs(commission->figures.way);
	double unit = db_commission_number(commission, "drive", "counts-per-unit");

	switch (stage) {
	case 0:
		/* Not repeated: the user has marked where it stands. */
		(void)db_commission_move(commission, action, 3, "stop");
		action->timed = false;
		return true;
	case 1:
		db_trial_measure(outcome->trial, &commission->figures);
		counts = fabs(commission->figures.way);
		if (!db_commission_judge_reaction(commission, "scale", outcome->result))
			return false;
		return db_commission_ask(
			action, "scale.way", "",
			"Its position changed by %.0f counts, %.6g %s. How far did it "
			"go, measured, in %s?",
			counts, counts / unit, commission->facts.unit_name,
			commission->facts.unit_name);
	case 2:
		if (answer_number(outcome) > 0)
			judge_scale(commission, "counts-per-unit", counts, answer_number(outcome));
		if (!servo)
			return false;
		return db_commission_ask(
			action, "scale.turns", "",
			"How many turns of the motor were that (0.25 is a quarter)?");
	default:
		if (answer_number(outcome) > 0)
			judge_scale(commission, "counts-per-turn", counts, answer_number(outcome));
		return false;
	}
}

bool db_commission_can_limits(struct db_commission *commission)
{
	const char *given = db_commission_setting(commission, "drive", "max-velocity");

	if (given[0] != '\0' && commission->facts.max_velocity > 0)
		return true;
	db_commission_judge(commission, "drive", "max-velocity", DB_COMMISSION_NOT_SEEN, NULL,
	                    "it is not configured: nothing is refused");
	return false;
}

bool db_commission_try_limits(struct db_commission *commission, unsigned stage,
                              const struct db_commission_outcome *outcome,
                              struct db_commission_action *action)
{
	if (stage == 0) {
		(void)db_commission_move(commission, action, 1, "stop");
		action->velocity = 1.05 * commission->facts.max_velocity;
		action->ms = 1;
		action->timed = false;
		return true;
	}
	if (strcmp(outcome->result, "limit") == 0)
		db_commission_judge(commission, "drive", "max-velocity", DB_COMMISSION_PROVEN, NULL,
		                    "a velocity above it was refused");
	else
		db_commission_judge(commission, "drive", "max-velocity", DB_COMMISSION_CONTRADICTED,
		                    NULL, "a velocity above it ended as %s", outcome->result);
	return false;
}

/* Compares its values before and now, and with the service's trouble record. */
static void judge_power_loss(struct db_commission *commission, const json_t *after)
{
	double before = json_number_value(json_object_get(commission->before, "position"));
	double now = json_number_value(json_object_get(after, "position"));
	const char *trouble = json_string_value(json_object_get(after, "trouble"));
	bool kept = fabs(now - before) <= 10 * DB_TRIAL_DITHER;
	bool told = db_words_flag(after, "origin_lost") ||
	            (trouble && strcmp(trouble, "may_have_restarted") == 0);

	if (fabs(before) <= 100 * DB_TRIAL_DITHER)
		db_commission_judge(commission, "", "origin", DB_COMMISSION_NOT_SEEN, NULL,
		                    "it stood at %.0f before: move it away from 0 first", before);
	else if (!kept && !told)
		db_commission_judge(commission, "", "origin", DB_COMMISSION_CONTRADICTED,
		                    "home it after every loss of its power: nothing says that its "
		                    "position is wrong",
		                    "it stood at %.0f, says %.0f now, and counts as homed", before,
		                    now);
	else if (kept && told)
		db_commission_judge(
			commission, "", "origin", DB_COMMISSION_CONTRADICTED,
			"its position can be used after set_position to where it says it "
			"is, if the shaft was not turned",
			"its origin counts as lost, and it still says %.0f", now);
	else
		db_commission_judge(commission, "", "origin", DB_COMMISSION_PROVEN, NULL, "%s",
		                    kept ? "it keeps its position without power" :
		                           "it loses its position without power, and that is told");
	if (db_words_flag(after, "enabled"))
		db_commission_judge(
			commission, "", "power-up", DB_COMMISSION_CONTRADICTED,
			"have it come up without power where its family can (pae = 0 of a "
			"VSMD drive)",
			"its motor has power as soon as the drive has");
	else
		db_commission_judge(commission, "", "power-up", DB_COMMISSION_PROVEN, NULL,
		                    "its motor has no power when the drive comes up");
}

static void judge_parameters(struct db_commission *commission, const json_t *after)
{
	json_t *old = json_object_get(commission->before, "parameters");
	const json_t *fresh = json_object_get(after, "parameters");
	char names[200] = "";
	size_t used = 0;
	const char *name;
	const json_t *value;

	json_object_foreach(old, name, value)
	{
		const json_t *now = json_object_get(fresh, name);

		if (now && !json_is_null(now) && !json_is_null(value) && !json_equal(value, now) &&
		    used + strlen(name) + 3 < sizeof(names))
			used += (size_t)snprintf(names + used, sizeof(names) - used, "%s%s",
			                         used ? ", " : "", name);
	}
	if (json_object_size(old) == 0)
		return;
	if (used > 0)
		db_commission_judge(commission, "", "parameters", DB_COMMISSION_CONTRADICTED,
		                    "set them again, and run save_parameters",
		                    "others than before its power was off: %s", names);
	else
		db_commission_judge(commission, "", "parameters", DB_COMMISSION_PROVEN, NULL,
		                    "they are the same after its power was off");
}

bool db_commission_try_power_loss(struct db_commission *commission, unsigned stage,
                                  const struct db_commission_outcome *outcome,
                                  struct db_commission_action *action)
{
	switch (stage) {
	case 0:
		return true; /* the preset action, a read */
	case 1:
		json_decref(commission->before);
		commission->before = json_deep_copy(outcome->values);
		return db_commission_ask(action, "power-loss.off", "done skip",
		                         "Switch the drive's power off now.");
	case 2:
		if (!db_commission_answered(outcome, "done"))
			return false;
		return db_commission_watch(action, 30000, DB_COMMISSION_OFFLINE);
	case 3:
		if (!db_words_flag(outcome->values, "seen")) {
			db_commission_judge(
				commission, "", "power-loss", DB_COMMISSION_CONTRADICTED,
				"look whether another supply feeds its electronics",
				"it still answers 30 s after its power was switched off");
			return false;
		}
		return db_commission_ask(action, "power-loss.on", "done",
		                         "It does not answer any more. Switch its power on again.");
	case 4:
		return db_commission_watch(action, 60000, DB_COMMISSION_ONLINE);
	case 5:
		if (db_words_flag(outcome->values, "seen"))
			return db_commission_watch(action, 1000, DB_COMMISSION_TIME);
		db_commission_judge(commission, "", "power-loss", DB_COMMISSION_CONTRADICTED, NULL,
		                    "it did not answer within 60 s after its power was on again");
		return false;
	case 6:
		*action = (struct db_commission_action){ .kind = DB_COMMISSION_READ };
		return true;
	default:
		judge_power_loss(commission, outcome->values);
		judge_parameters(commission, outcome->values);
		return false;
	}
}
