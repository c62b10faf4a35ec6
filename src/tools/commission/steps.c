/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/steps.h"
#include "commission/judge.h"
#include "commission/stops.h"
#include "commission/tries.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* clang-format off */
const struct db_commission_step db_commission_list[] = {
	{ "presence", false, false, "whether it answers, and who it says it is" },
	{ "round-trips", false, false, "how long its answers take, and whether any are lost" },
	{ "standing", false, false, "what it says while it stands, and whether its position follows the shaft" },
	{ "power", true, false, "whether enable and disable reach the motor" },
	{ "motion", true, false, "which way it turns, and how long it takes to begin" },
	{ "speed", true, false, "whether the velocity that it tells is true, backwards too" },
	{ "stop", true, false, "how it stops: time, way, and what the shaft does" },
	{ "silence", true, false, "whether it stops when nobody says any more that it is to move" },
	{ "watchdog", true, false, "whether it stops watchdog-ms after the last word of a client" },
	{ "scale", true, false, "how many counts a unit or a turn has" },
	{ "limits", true, true, "whether more than max-velocity is refused" },
	{ "power-loss", false, false, "what is left when its power was off and on" },
	{ NULL, false, false, NULL },
};

/* In the order of db_commission_list. */
static const struct {
	db_commission_try *function;
	const char *go; /* the question before its motions */
	bool enables;   /* the motor has to have power */
	const char *what;
	/* checked before any question; NULL: always possible */
	bool (*can)(struct db_commission *commission);
} tries[] = {
	{ db_commission_try_presence, "", false, "", NULL },
	{ db_commission_try_round_trips, "", false, "", NULL },
	{ db_commission_try_standing, "", false, "", NULL },
	{ db_commission_try_power, "power.go", false, "The motor now gets power, and loses it again.", NULL },
	{ db_commission_try_motion, "motion.go", true, "It now turns in positive direction, slowly, and stops.", NULL },
	{ db_commission_try_speed, "speed.go", true, "It now turns in negative direction, slowly, and stops.", NULL },
	{ db_commission_try_stop, "stop.go", true, "It now turns and is stopped, twice: by stop, and by quick_stop.", NULL },
	{ db_commission_try_silence, "silence.go", true,
	  "It now turns, and this program falls silent: the service has to stop it.", NULL },
	{ db_commission_try_watchdog, "watchdog.go", true,
	  "It now turns until the service's watchdog stops it, for watchdog-ms.", db_commission_can_watchdog },
	{ db_commission_try_scale, "scale.go", true, "It now turns farther, to measure its scale. Mark where it stands.", NULL },
	{ db_commission_try_limits, "limits.go", true,
	  "It is now told more than max-velocity, which has to be refused; it is stopped at once.", db_commission_can_limits },
	{ db_commission_try_power_loss, "", false, "", NULL },
};
/* clang-format on */

int db_commission_find(const char *name)
{
	for (int i = 0; db_commission_list[i].name; i++) {
		if (strcmp(db_commission_list[i].name, name) == 0)
			return i;
	}
	return -1;
}

void db_commission_open(struct db_commission *commission, const struct db_commission_facts *facts)
{
	*commission = (struct db_commission){ .facts = *facts, .verdicts = json_array() };
}

void db_commission_close(struct db_commission *commission)
{
	json_decref(commission->verdicts);
	json_decref(commission->before);
	commission->verdicts = NULL;
	commission->before = NULL;
}

void db_commission_begin(struct db_commission *commission, size_t step)
{
	const char *name = db_commission_list[step].name;

	commission->step = step;
	commission->step_name = name;
	commission->stage = 0;
	commission->latest = (struct db_commission_action){ .kind = DB_COMMISSION_READ };
	commission->repeats = 0;
	commission->doubt_ms = 0;
	for (size_t i = json_array_size(commission->verdicts); i-- > 0;) {
		const char *of = json_string_value(
			json_object_get(json_array_get(commission->verdicts, i), "step"));

		if (of && strcmp(of, name) == 0)
			(void)json_array_remove(commission->verdicts, i);
	}
}

/*
 * The stages before motions: the user confirms that the drive is uncoupled, then that this kind of
 * motion may begin, and the motor gets power. True: an action; else `refused` tells whether the
 * step continues.
 */
static bool prepare(struct db_commission *commission, const struct db_commission_outcome *outcome,
                    struct db_commission_action *action, bool *refused)
{
	switch (commission->stage++) {
	case 0:
		if (!commission->may_move)
			return db_commission_ask(
				action, "uncoupled", "yes no",
				"The motor will turn. Is the drive uncoupled from the machine, "
				"and nobody near the shaft?");
		commission->stage++;
		break;
	case 1:
		commission->may_move = db_commission_answered(outcome, "yes");
		break;
	case 2:
		*refused = !db_commission_answered(outcome, "yes");
		commission->stage = 3;
		if (*refused || !tries[commission->step].enables)
			return false;
		*action = (struct db_commission_action){ .kind = DB_COMMISSION_RUN,
			                                 .command = "enable" };
		return true;
	default:
		commission->enabled = outcome->result && (strcmp(outcome->result, "ok") == 0 ||
		                                          strcmp(outcome->result, "unproven") == 0);
		*refused = !commission->enabled;
		if (*refused)
			db_commission_judge(
				commission, "", commission->step_name, DB_COMMISSION_NOT_SEEN, NULL,
				"enable ended as %s, so nothing was moved: look at step "
				"power",
				outcome->result ? outcome->result : "nothing");
		return false;
	}
	*refused = !commission->may_move;
	return commission->may_move &&
	       db_commission_ask(action, tries[commission->step].go, "yes skip", "%s Go on?",
	                         tries[commission->step].what);
}

/* A step's own stages begin here: those before are prepare()'s. */
#define FIRST_STAGE 4

/*
 * True if the latest action is to be repeated because nothing was received for a while: times
 * measured while the computer stood still say nothing about the drive.
 */
static bool repeat(struct db_commission *commission, const struct db_commission_outcome *outcome,
                   struct db_commission_action *action)
{
	const struct db_commission_action *latest = &commission->latest;
	double doubt = 0;

	if (latest->kind == DB_COMMISSION_ASK || latest->kind == DB_COMMISSION_READ || !outcome)
		return false;
	if (outcome->trial)
		doubt = db_trial_find_hole(outcome->trial);
	/* A watch for power belongs to the command before it, and cannot be repeated alone. */
	if (latest->kind == DB_COMMISSION_WATCH && !latest->timed)
		doubt = fmax(doubt, commission->doubt_ms);
	commission->doubt_ms = doubt;
	if (!latest->timed || doubt <= 0 || commission->repeats >= DB_COMMISSION_REPEATS_MAX)
		return false;
	commission->repeats++;
	*action = *latest;
	action->again = true;
	return true;
}

static bool find_next(struct db_commission *commission, const struct db_commission_outcome *outcome,
                      struct db_commission_action *action)
{
	bool refused = false;

	*action = (struct db_commission_action){ .kind = DB_COMMISSION_READ };
	if (commission->stage == 0 && tries[commission->step].can &&
	    !tries[commission->step].can(commission))
		return false;
	if (db_commission_list[commission->step].moves && commission->stage < FIRST_STAGE) {
		if (prepare(commission, outcome, action, &refused))
			return true;
		if (refused)
			return false;
	}
	if (commission->stage < FIRST_STAGE)
		commission->stage = FIRST_STAGE;
	return tries[commission->step].function(commission, commission->stage++ - FIRST_STAGE,
	                                        outcome, action);
}

bool db_commission_next(struct db_commission *commission,
                        const struct db_commission_outcome *outcome,
                        struct db_commission_action *action)
{
	if (commission->absent)
		return false;
	if (repeat(commission, outcome, action))
		return true;
	commission->repeats = 0;
	if (!find_next(commission, outcome, action))
		return false;
	commission->latest = *action;
	return true;
}

static void fill_section(struct db_commission *commission, const char *section, json_t *keys)
{
	const char *name;
	const json_t *value;

	json_object_foreach(keys, name, value)
	{
		if (db_commission_find_verdict(commission, section, name))
			continue;
		(void)json_array_append_new(
			commission->verdicts,
			json_pack("{s:s, s:s, s:s, s:s, s:O, s:n, s:s}", "step", "", "section",
		                  section, "setting", name, "verdict", DB_COMMISSION_NOT_SEEN,
		                  "now", value, "right", "how", "no step looks at it"));
	}
}

/* True if a family has that setting, in either section. */
static bool applies(const char *name, const char *family)
{
	for (const struct db_commission_preset *row = db_commission_presets; row->name; row++) {
		if (strcmp(row->name, name) == 0 && strstr(row->families, family))
			return true;
	}
	return false;
}

static void fill_preset(struct db_commission *commission, const struct db_commission_preset *row,
                        const char *verdict, const char *how)
{
	const char *now = db_commission_setting(commission, row->section, row->name);

	if (db_commission_find_verdict(commission, row->section, row->name))
		return;
	(void)json_array_append_new(commission->verdicts,
	                            json_pack("{s:s, s:s, s:s, s:s, s:s, s:n, s:s}", "step", "",
	                                      "section", row->section, "setting", row->name,
	                                      "verdict", verdict, "now", now, "right", "how", how));
}

void db_commission_fill(struct db_commission *commission)
{
	char family[64];

	snprintf(family, sizeof(family), " %s ", commission->facts.family);
	for (const struct db_commission_preset *row = db_commission_presets; row->name; row++) {
		if (strstr(row->families, family))
			fill_preset(commission, row, DB_COMMISSION_NOT_SEEN,
			            "its step was skipped or did not come to it");
		else if (!applies(row->name, family))
			fill_preset(commission, row, DB_COMMISSION_NOT_FOR,
			            "this family does not have it");
	}
	fill_section(commission, "drive", commission->facts.drive_keys);
	fill_section(commission, "bus", commission->facts.bus_keys);
}
