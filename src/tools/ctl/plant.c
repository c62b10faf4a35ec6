/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/plant.h"
#include "ctl/say.h"
#include "words/value.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

json_t *db_ctl_process_names(const json_t *registers)
{
	json_t *names = json_pack("[s,s,s,s,s,s,s,s]", "axis_state", "error", "status", "age_ms",
	                          "position", "velocity", "position_units", "velocity_units");

	if (db_words_look_up(registers, "must_stand_cause")) {
		(void)json_array_append_new(names, json_string("must_stand_cause"));
		(void)json_array_append_new(names, json_string("must_stand_ms"));
	}
	return names;
}

void db_ctl_judge(const json_t *record, struct db_ctl_judgement *judgement)
{
	const char *cause = db_words_text(record, "cause");
	const char *detail = db_words_text(record, "detail");
	const char *advice = db_words_text(record, "advice");

	judgement->need = db_client_trouble_need(record);
	snprintf(judgement->cause, sizeof(judgement->cause), "%s",
	         strcmp(cause, "none") == 0 ? "" : cause);
	if (strcmp(cause, "fault") != 0 && detail[0] && strstr(advice, detail))
		snprintf(judgement->why, sizeof(judgement->why), "%s", cause);
	else
		db_client_trouble_words(record, judgement->why);
	snprintf(judgement->next, sizeof(judgement->next), "%s", advice);
}

void db_ctl_fit_drives(struct db_ctl_grid *grid, unsigned width)
{
	/* The least important columns go first: age, bus, velocity. */
	static const size_t columns[] = { 5, 1, 4 };

	db_ctl_grid_fit(grid, width, columns, sizeof(columns) / sizeof(columns[0]));
}

void db_ctl_add_heads(struct db_ctl_grid *grid)
{
	static const char *const heads[] = { DB_CTL_TEXT("DRIVE"),    DB_CTL_TEXT("BUS"),
		                             DB_CTL_TEXT("STATE"),    DB_CTL_TEXT("POSITION"),
		                             DB_CTL_TEXT("VELOCITY"), DB_CTL_TEXT("AGE"),
		                             DB_CTL_TEXT("NEEDS") };

	db_ctl_grid_add_heads(grid, heads, sizeof(heads) / sizeof(heads[0]));
}

/* In the user's units if they have a name, else in the drive's own. */
static void add_quantity(struct db_ctl_grid *grid, const json_t *drive, const json_t *registers,
                         const json_t *values, const char *own, const char *users, const char *per)
{
	const char *unit = db_words_text(drive, "unit_name");
	const json_t *value = json_object_get(values, users);
	char text[DB_WORDS_VALUE_MAX];

	if (unit[0] && json_is_number(value)) {
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.2f %s%s", json_number_value(value), unit,
		                per);
		return;
	}
	value = json_object_get(values, own);
	db_words_write_value(db_words_look_up(registers, own), value, text, sizeof(text));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", text);
}

/* Short advice by the name of the service's cause. Other causes, such as errors of a family, are
 * shown by their own names. */
static const char *say_need(const struct db_ctl_judgement *judgement)
{
	static const struct {
		const char *cause;
		const char *words;
	} needs[] = {
		{ "port", "check adapter" },
		{ "aside", "wait: bus is scanned" },
		{ "no_answer", "check power, cable" },
		{ "not_understood", "check baud, wiring" },
		{ "late", "raise drive-latency-ms" },
		{ "deaf", "raise turnaround-us" },
		{ "two_drives", "disconnect one" },
		{ "runs_on", "POWER OFF" },
		{ "must_stand", "POWER OFF if it moves" },
		{ "warning", "look at its warning" },
		{ "watchdog", "clear_fault" },
		{ "may_have_restarted", "check power, home" },
		{ "origin_lost", "home" },
		{ "params_unsaved", "save_parameters" },
	};

	for (size_t i = 0; i < sizeof(needs) / sizeof(needs[0]); i++) {
		if (strcmp(needs[i].cause, judgement->cause) == 0)
			return db_ctl_say(needs[i].words);
	}
	return db_ctl_say_name(judgement->why);
}

void db_ctl_add_drive(struct db_ctl_grid *grid, const json_t *drive, const json_t *registers,
                      const json_t *values, const struct db_ctl_judgement *judgement)
{
	static const enum db_ctl_colour colours[] = {
		[DB_CLIENT_FINE] = DB_CTL_PLAIN,
		[DB_CLIENT_HINT] = DB_CTL_PLAIN,
		[DB_CLIENT_LOOK] = DB_CTL_YELLOW,
		[DB_CLIENT_ACT] = DB_CTL_RED,
	};
	const json_t *value = json_object_get(values, "axis_state");
	const char *state = json_is_integer(value) ?
	                            db_words_code_name(db_words_look_up(registers, "axis_state"),
	                                               json_integer_value(value)) :
	                            NULL;
	const json_t *age = json_object_get(values, "age_ms");
	json_int_t ms = json_is_integer(age) ? json_integer_value(age) : UINT32_MAX;

	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_words_text(drive, "name"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_words_text(drive, "bus"));
	db_ctl_grid_add(grid, colours[judgement->need], "%s",
	                state && state[0] ? db_ctl_say_name(state) : "-");
	add_quantity(grid, drive, registers, values, "position", "position_units", "");
	add_quantity(grid, drive, registers, values, "velocity", "velocity_units", "/s");
	if (ms >= UINT32_MAX)
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_ctl_say("never"));
	else if (ms >= 10000)
		db_ctl_grid_add(grid, colours[judgement->need], "%lld s", (long long)ms / 1000);
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld ms", (long long)ms);
	db_ctl_grid_add(grid, colours[judgement->need], "%s", say_need(judgement));
}

json_t *db_ctl_read_families(struct db_ctl *ctl, enum db_ctl_status *status)
{
	json_t *families = json_object();
	size_t i;
	json_t *bus;

	*status = DB_CTL_OK;
	json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
	{
		const char *protocol = db_words_text(bus, "protocol");
		const char *drive = json_string_value(
			json_array_get(json_object_get(bus, "drives"), 0));

		if (!drive || json_object_get(families, protocol))
			continue;
		(void)json_object_set_new(families, protocol,
		                          db_ctl_read_registers(ctl, drive, status));
		if (*status != DB_CTL_OK)
			break;
	}
	return families;
}

const json_t *db_ctl_registers_of(const struct db_ctl *ctl, const json_t *families,
                                  const json_t *drive)
{
	size_t i;
	const json_t *bus;

	json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
	{
		if (strcmp(db_words_text(bus, "name"), db_words_text(drive, "bus")) == 0)
			return json_object_get(families, db_words_text(bus, "protocol"));
	}
	return NULL;
}
