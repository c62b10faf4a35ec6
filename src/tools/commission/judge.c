/* SPDX-License-Identifier: Apache-2.0 */
#include "commission/judge.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* clang-format off */
const struct db_commission_preset db_commission_presets[] = {
	{ "bus", "drive-latency-ms", " vsmd-serial vsmd-can xyza servo-can ", "30" },
	{ "bus", "turnaround-us", " vsmd-serial xyza ", "" },
	{ "bus", "reaction-ms", " xyza ", "200" },
	{ "drive", "reaction-ms", " vsmd-serial vsmd-can ", "250" },
	{ "drive", "reaction-ms", " servo-can ", "200" },
	{ "drive", "stop-reaction-ms", " vsmd-serial vsmd-can xyza servo-can ", "1000" },
	{ "drive", "watchdog-ms", " vsmd-serial vsmd-can xyza servo-can ", "3000" },
	{ "drive", "counts-per-unit", " vsmd-serial vsmd-can xyza servo-can ", "1.0" },
	{ "drive", "counts-per-turn", " servo-can ", "" },
	{ "drive", "speed-sign", " vsmd-serial vsmd-can servo-can ", "signed" },
	{ "drive", "enabled-bit", " servo-can ", "0" },
	{ "drive", "in-position-window", " vsmd-serial vsmd-can xyza servo-can ", "0" },
	{ NULL, NULL, NULL, NULL },
};
/* clang-format on */

const char *db_commission_setting(const struct db_commission *commission, const char *section,
                                  const char *name)
{
	const json_t *keys = strcmp(section, "bus") == 0 ? commission->facts.bus_keys :
	                                                   commission->facts.drive_keys;
	const char *given = json_string_value(json_object_get(keys, name));
	char family[64];

	if (given)
		return given;
	snprintf(family, sizeof(family), " %s ", commission->facts.family);
	for (const struct db_commission_preset *row = db_commission_presets; row->name; row++) {
		if (strcmp(row->section, section) == 0 && strcmp(row->name, name) == 0 &&
		    strstr(row->families, family))
			return row->preset;
	}
	return "";
}

json_t *db_commission_find_verdict(const struct db_commission *commission, const char *section,
                                   const char *setting)
{
	size_t i;
	json_t *verdict;

	json_array_foreach(commission->verdicts, i, verdict)
	{
		const char *name = json_string_value(json_object_get(verdict, "setting"));
		const char *place = json_string_value(json_object_get(verdict, "section"));

		if (name && place && strcmp(name, setting) == 0 && strcmp(place, section) == 0)
			return verdict;
	}
	return NULL;
}

/* Settings that are judged by times. */
static bool is_timed(const char *setting)
{
	static const char *const timed[] = { "reaction-ms", "stop-reaction-ms", "standing",
		                             "quick_stop",  "drive-latency-ms", "turnaround-us",
		                             "enable",      "silence",          "watchdog-ms" };

	for (size_t i = 0; i < sizeof(timed) / sizeof(timed[0]); i++) {
		if (strcmp(timed[i], setting) == 0)
			return true;
	}
	return false;
}

void db_commission_judge(struct db_commission *commission, const char *section, const char *setting,
                         const char *verdict, const char *right, const char *format, ...)
{
	json_t *old = db_commission_find_verdict(commission, section, setting);
	const char *before = json_string_value(json_object_get(old, "verdict"));
	bool doubted = commission->doubt_ms > 0 && is_timed(setting) &&
	               strcmp(verdict, DB_COMMISSION_CONTRADICTED) == 0;
	char how[DB_COMMISSION_TEXT];
	va_list arguments;

	if (doubted) {
		verdict = DB_COMMISSION_NOT_SEEN;
		right = NULL;
	}
	/* Several steps judge, for example, reaction-ms: a contradiction stays. */
	if (before && (strcmp(before, DB_COMMISSION_CONTRADICTED) == 0 ||
	               strcmp(verdict, DB_COMMISSION_NOT_SEEN) == 0))
		return;
	va_start(arguments, format);
	vsnprintf(how, sizeof(how), format, arguments);
	va_end(arguments);
	if (doubted)
		snprintf(how, sizeof(how),
		         "nothing was heard of the drive for %.0f ms while this was measured, so "
		         "its times are doubtful: run this step again, on a computer that is not "
		         "busy",
		         commission->doubt_ms);
	if (!old) {
		old = json_object();
		(void)json_array_append_new(commission->verdicts, old);
	}
	(void)json_object_set_new(old, "step", json_string(commission->step_name));
	(void)json_object_set_new(old, "section", json_string(section));
	(void)json_object_set_new(old, "setting", json_string(setting));
	(void)json_object_set_new(old, "verdict", json_string(verdict));
	(void)json_object_set_new(old, "now",
	                          json_string(db_commission_setting(commission, section, setting)));
	(void)json_object_set_new(old, "right", right ? json_string(right) : json_null());
	(void)json_object_set_new(old, "how", json_string(how));
}

bool db_commission_ask(struct db_commission_action *action, const char *id, const char *choices,
                       const char *format, ...)
{
	va_list arguments;

	*action = (struct db_commission_action){ .kind = DB_COMMISSION_ASK,
		                                 .id = id,
		                                 .choices = choices };
	va_start(arguments, format);
	vsnprintf(action->text, sizeof(action->text), format, arguments);
	va_end(arguments);
	return true;
}

bool db_commission_watch(struct db_commission_action *action, unsigned ms,
                         enum db_commission_until until)
{
	*action = (struct db_commission_action){ .kind = DB_COMMISSION_WATCH,
		                                 .ms = ms,
		                                 .until = until };
	return true;
}

bool db_commission_run(struct db_commission_action *action, const char *command)
{
	*action = (struct db_commission_action){ .kind = DB_COMMISSION_RUN, .command = command };
	return true;
}

bool db_commission_move(struct db_commission *commission, struct db_commission_action *action,
                        double factor, const char *ending)
{
	commission->direction = factor < 0 ? -1 : 1;
	*action = (struct db_commission_action){
		.kind = DB_COMMISSION_MOVE,
		.velocity = commission->facts.velocity * commission->direction,
		.ms = (unsigned)(commission->facts.ms * fabs(factor)),
		.ending = ending,
		.timed = true,
	};
	return true;
}

double db_commission_number(const struct db_commission *commission, const char *section,
                            const char *name)
{
	return strtod(db_commission_setting(commission, section, name), NULL);
}

void db_commission_write_ms(double ms, char text[32])
{
	snprintf(text, 32, "%.0f", 50 * ceil(ms / 50));
}

bool db_commission_answered(const struct db_commission_outcome *outcome, const char *answer)
{
	return outcome->answer && strcmp(outcome->answer, answer) == 0;
}
