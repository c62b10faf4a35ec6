/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/plant.h"
#include "ctl/value.h"

#include <stdint.h>
#include <stdio.h>
#include <string.h>

/* {drive}, {bus} and {device} are filled in. By the names of codes of `error`; the last is for all others. */
static const struct {
	const char *error;
	const char *next;
} advice[] = {
	{ "no_answer", "check its power, its cable and its address; it comes back by itself" },
	{ "bus_down", "the port of bus {bus} is not open: check the adapter and its cable" },
	{ "client_loss",
	  "its client fell silent; when the client is back: drivebridgectl run {drive} "
	  "clear_fault" },
	{ "runs_on",
	  "it did not stop when it was told to: take its power off, then look for the cause" },
	{ "unexplained_fault",
	  "its next report tells the reason; if none comes, turn that report on in the drive" },
	{ "over_temperature", "let it cool down, check load and current; then drivebridgectl run "
	                      "{drive} clear_fault" },
	{ "drive_overtemperature",
	  "let it cool down, check load and current; then drivebridgectl run "
	  "{drive} clear_fault" },
	{ "motor_overtemperature",
	  "let it cool down, check the load; then drivebridgectl run {drive} "
	  "clear_fault" },
	{ "over_current",
	  "check the motor, its wiring and the load; then drivebridgectl run {drive} "
	  "clear_fault" },
	{ "overcurrent",
	  "check the motor, its wiring and the load; then drivebridgectl run {drive} "
	  "clear_fault" },
	{ "voltage", "check its supply; then drivebridgectl run {drive} clear_fault" },
	{ "undervoltage", "check its supply; then drivebridgectl run {drive} clear_fault" },
	{ "overvoltage", "check its supply and the braking; then drivebridgectl run {drive} "
	                 "clear_fault" },
	{ NULL, "find and end the cause; then drivebridgectl run {drive} clear_fault" },
};

json_t *db_ctl_process_names(const json_t *registers)
{
	json_t *names = json_pack("[s,s,s,s,s,s,s,s]", "axis_state", "error", "status", "age_ms",
	                          "position", "velocity", "position_units", "velocity_units");

	if (db_ctl_look_up(registers, "must_stand_cause")) {
		(void)json_array_append_new(names, json_string("must_stand_cause"));
		(void)json_array_append_new(names, json_string("must_stand_ms"));
	}
	return names;
}

static void fill_in(char *text, size_t size, const char *format, const json_t *drive)
{
	size_t used = 0;

	while (*format && used + 1 < size) {
		if (strncmp(format, "{drive}", 7) == 0) {
			used += (size_t)snprintf(text + used, size - used, "%s",
			                         db_ctl_text(drive, "name"));
			format += 7;
		} else if (strncmp(format, "{bus}", 5) == 0) {
			used += (size_t)snprintf(text + used, size - used, "%s",
			                         db_ctl_text(drive, "bus"));
			format += 5;
		} else {
			text[used++] = *format++;
		}
	}
	text[used < size ? used : size - 1] = '\0';
}

/* The name of what `reg` has as this value, "" when there is none. */
static const char *name_of(const json_t *registers, const json_t *values, const char *reg)
{
	const json_t *value = json_object_get(values, reg);
	const char *name = json_is_integer(value) ? db_ctl_code_name(db_ctl_look_up(registers, reg),
	                                                             json_integer_value(value)) :
	                                            NULL;

	return name ? name : "";
}

/* A stop of every day takes less. */
#define STAND_MS 1000

static bool stands_too_late(const json_t *values)
{
	return json_integer_value(json_object_get(values, "must_stand_ms")) > STAND_MS;
}

void db_ctl_judge_drive(const json_t *drive, const json_t *registers, const json_t *values,
                        struct db_ctl_judgement *judgement)
{
	const char *state = name_of(registers, values, "axis_state");
	const char *error = name_of(registers, values, "error");
	const json_t *status_register = db_ctl_look_up(registers, "status");
	const json_t *status = json_object_get(values, "status");
	const size_t others = sizeof(advice) / sizeof(advice[0]) - 1;
	size_t at = 0;

	*judgement = (struct db_ctl_judgement){ .need = DB_CTL_FINE };
	if (strcmp(error, "none") == 0)
		error = "";
	if (strcmp(state, "Offline") == 0 || strcmp(state, "ErrorStop") == 0 || state[0] == '\0') {
		judgement->need = DB_CTL_ACT;
		(void)snprintf(judgement->why, sizeof(judgement->why), "%s",
		               error[0] ? error :
		               state[0] ? state :
		                          "its state is not known");
		if (!error[0] && strcmp(state, "ErrorStop") != 0)
			error = "no_answer";
		while (at < others && strcmp(advice[at].error, error) != 0)
			at++;
		fill_in(judgement->next, sizeof(judgement->next), advice[at].next, drive);
	} else if (stands_too_late(values)) {
		judgement->need = DB_CTL_ACT;
		(void)snprintf(judgement->why, sizeof(judgement->why), "must stand (%s)",
		               name_of(registers, values, "must_stand_cause"));
		fill_in(judgement->next, sizeof(judgement->next),
		        "it was told to stop and is not seen to stand; if it moves, take its power off",
		        drive);
	} else if (db_ctl_has_bit(status_register, status, "latched")) {
		judgement->need = DB_CTL_ACT;
		(void)snprintf(judgement->why, sizeof(judgement->why), "stopped by its watchdog");
		fill_in(judgement->next, sizeof(judgement->next),
		        "its client fell silent; when the client is back: drivebridgectl run {drive} "
		        "clear_fault",
		        drive);
	} else if (db_ctl_has_bit(status_register, status, "warning")) {
		judgement->need = DB_CTL_LOOK;
		(void)snprintf(judgement->why, sizeof(judgement->why), "it warns");
		fill_in(judgement->next, sizeof(judgement->next), "see drivebridgectl show {drive}",
		        drive);
	} else if (db_ctl_has_bit(status_register, status, "origin_lost")) {
		judgement->need = DB_CTL_LOOK;
		(void)snprintf(judgement->why, sizeof(judgement->why), "its origin is lost");
		fill_in(judgement->next, sizeof(judgement->next),
		        "its position means nothing until it is homed or set: drivebridgectl run "
		        "{drive} home (or set_position)",
		        drive);
	} else if (db_ctl_has_bit(status_register, status, "params_unsaved")) {
		judgement->need = DB_CTL_HINT;
		(void)snprintf(judgement->why, sizeof(judgement->why), "unsaved parameters");
		fill_in(judgement->next, sizeof(judgement->next),
		        "without power it forgets them: drivebridgectl run {drive} save_parameters",
		        drive);
	}
}

void db_ctl_judge_bus(const json_t *bus, struct db_ctl_judgement *judgement)
{
	*judgement = (struct db_ctl_judgement){ .need = DB_CTL_FINE };
	if (json_is_true(json_object_get(bus, "up")))
		return;
	judgement->need = DB_CTL_ACT;
	(void)snprintf(judgement->why, sizeof(judgement->why), "its port is not open");
	(void)snprintf(judgement->next, sizeof(judgement->next),
	               "check the adapter at %s; the bus comes back by itself",
	               db_ctl_text(bus, "device"));
}

void db_ctl_judge_configuration(const json_t *description, struct db_ctl_judgement *judgement)
{
	static const struct {
		const char *state;
		enum db_ctl_need need;
		const char *why;
		const char *next;
	} states[] = {
		{ "refused", DB_CTL_ACT, "the one on disk is refused",
		  "what runs goes on, but a restart would not run it; correct the file, then "
		  "drivebridgectl reload" },
		{ "last_good", DB_CTL_ACT,
		  "THE LAST GOOD ONE RUNS, because the one on disk has an error",
		  "correct the file, then drivebridgectl reload" },
		{ "changed", DB_CTL_HINT, "the one on disk has changed",
		  "it is right and not loaded yet: drivebridgectl reload" },
	};
	const char *state = db_ctl_text(description, "configuration_state");

	*judgement = (struct db_ctl_judgement){ .need = DB_CTL_FINE };
	for (size_t i = 0; i < sizeof(states) / sizeof(states[0]); i++) {
		if (strcmp(state, states[i].state) != 0)
			continue;
		judgement->need = states[i].need;
		(void)snprintf(judgement->why, sizeof(judgement->why), "%s", states[i].why);
		(void)snprintf(judgement->next, sizeof(judgement->next), "%s", states[i].next);
	}
}

void db_ctl_add_heads(struct db_ctl_grid *grid)
{
	static const char *const heads[] = { "DRIVE",    "BUS", "STATE", "POSITION",
		                             "VELOCITY", "AGE", "NEEDS" };

	for (size_t i = 0; i < sizeof(heads) / sizeof(heads[0]); i++)
		db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", heads[i]);
}

/* In the user's units where they have a name, else in the drive's own. */
static void add_quantity(struct db_ctl_grid *grid, const json_t *drive, const json_t *registers,
                         const json_t *values, const char *own, const char *users, const char *per)
{
	const char *unit = db_ctl_text(drive, "unit_name");
	const json_t *value = json_object_get(values, users);
	char text[DB_CTL_VALUE_MAX];

	if (unit[0] && json_is_number(value)) {
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%.2f %s%s", json_number_value(value), unit,
		                per);
		return;
	}
	value = json_object_get(values, own);
	db_ctl_write_value(db_ctl_look_up(registers, own), value, text, sizeof(text));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", text);
}

void db_ctl_add_drive(struct db_ctl_grid *grid, const json_t *drive, const json_t *registers,
                      const json_t *values, const struct db_ctl_judgement *judgement)
{
	static const enum db_ctl_colour colours[] = {
		[DB_CTL_FINE] = DB_CTL_PLAIN,
		[DB_CTL_HINT] = DB_CTL_PLAIN,
		[DB_CTL_LOOK] = DB_CTL_YELLOW,
		[DB_CTL_ACT] = DB_CTL_RED,
	};
	const char *state = name_of(registers, values, "axis_state");
	const json_t *age = json_object_get(values, "age_ms");
	json_int_t ms = json_is_integer(age) ? json_integer_value(age) : UINT32_MAX;

	db_ctl_grid_add(grid, DB_CTL_BOLD, "%s", db_ctl_text(drive, "name"));
	db_ctl_grid_add(grid, DB_CTL_PLAIN, "%s", db_ctl_text(drive, "bus"));
	db_ctl_grid_add(grid, colours[judgement->need], "%s", state[0] ? state : "-");
	add_quantity(grid, drive, registers, values, "position", "position_units", "");
	add_quantity(grid, drive, registers, values, "velocity", "velocity_units", "/s");
	if (ms >= UINT32_MAX)
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "never");
	else if (ms >= 10000)
		db_ctl_grid_add(grid, colours[judgement->need], "%lld s", (long long)ms / 1000);
	else
		db_ctl_grid_add(grid, DB_CTL_PLAIN, "%lld ms", (long long)ms);
	db_ctl_grid_add(grid, colours[judgement->need], "%s", judgement->why);
}

json_t *db_ctl_read_families(struct db_ctl *ctl, enum db_ctl_status *status)
{
	json_t *families = json_object();
	size_t i;
	json_t *bus;

	*status = DB_CTL_OK;
	json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
	{
		const char *protocol = db_ctl_text(bus, "protocol");
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
		if (strcmp(db_ctl_text(bus, "name"), db_ctl_text(drive, "bus")) == 0)
			return json_object_get(families, db_ctl_text(bus, "protocol"));
	}
	return NULL;
}
